"""Commands that no run varies: they are named, and a log that varies one at all is left alone."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.data.held import constant_commands, warn_of_constant_commands

N = 200
HELD = {"rudder.delta": np.full(N, 0.35), "propeller.n": np.full(N, 10.0)}


def log(*changes: dict[str, np.ndarray]) -> Dataset:
    """Runs with one helm and one shaft speed, but for what changes."""
    motion = dict.fromkeys(("north", "east", "psi", "u", "v", "r"), 0.0)
    frames = [
        pd.DataFrame({"run": f"run {i}", "t": np.arange(float(N)), **motion, **HELD, **change, "flags": 0})
        for i, change in enumerate(changes)
    ]
    return Dataset(pd.concat(frames, ignore_index=True).astype({"run": "str"}), {"clock": "run", "flags": []})


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_commands_that_are_the_same_in_all_runs_are_named(noise: float) -> None:
    rng = np.random.default_rng(1)
    noisy = [{name: x + noise * np.abs(x) * rng.standard_normal(N) for name, x in HELD.items()} for _ in range(5)]
    dataset = log(*noisy)
    (words,) = warn_of_constant_commands(dataset, dataset.runs)
    assert set(constant_commands(dataset, dataset.runs)) == set(HELD)
    assert "rudder.delta" in words
    assert "are the same in all 5 runs: what they do cannot be learnt" in words
    assert "is the same" not in words
    assert "throughout the only run" in warn_of_constant_commands(dataset, ["run 0"])[0]


@pytest.mark.parametrize("where", ["one run", "a moment", "between runs"])
def test_a_command_that_varies_anywhere_varies(where: str) -> None:
    other = HELD["rudder.delta"].copy()
    other[slice(60, 65) if where == "a moment" else slice(100, N) if where == "one run" else slice(None)] = -0.1
    dataset = log({}, {}, {}, {"rudder.delta": other})
    assert constant_commands(dataset, dataset.runs) == ("propeller.n",)
    assert warn_of_constant_commands(dataset, dataset.runs) == []
    assert warn_of_constant_commands(dataset, ["run 0", "run 1"]) != []


def one_run(rows: int, step: float = 1.0, **commands: np.ndarray) -> Dataset:
    """A run of so many rows; names of commands with _ for the point."""
    columns = {name.replace("_", "."): x for name, x in commands.items()}
    motion = dict.fromkeys(("north", "east", "psi", "u", "v", "r"), 0.0)
    frame = pd.DataFrame({"run": "long", "t": step * np.arange(rows), **motion, **columns, "flags": 0})
    return Dataset(frame.astype({"run": "str"}), {"clock": "run", "flags": []})


@pytest.mark.parametrize(
    ("hours", "step", "lasts", "size", "held"),
    [
        (1, 1.0, 20.0, 5.0, False),
        (1 / 6, 1.0, 5.0, 5.0, False),
        (10, 1.0, 5.0, 5.0, False),
        (10, 0.1, 5.0, 5.0, False),
        (10, 10.0, 10.0, 5.0, False),
        (1, 1.0, 20.0, 3.0, False),
        (1, 1.0, 20.0, 1.5, True),
        (1, 1.0, 1.0, 35.0, True),
        (1, 0.1, 1.0, 35.0, True),
        (1 / 6, 1.0, 1.0, 35.0, False),
    ],
)
def test_a_short_kick_in_a_long_run_varies(hours: float, step: float, lasts: float, size: float, held: bool) -> None:
    """The scatter of a whole run shrinks with its length; what is one faulty row in a thousand is no kick."""
    rows = round(3600 * hours / step)
    helm = np.zeros(rows)
    for begin in (0, rows // 2, rows - round(lasts / step)):
        moved = helm.copy()
        moved[begin : begin + round(lasts / step)] = np.radians(size)
        log = one_run(rows, step, rudder_delta=moved, propeller_n=np.full(rows, 2.0))
        assert ("rudder.delta" in constant_commands(log, log.runs)) == held
        assert bool(warn_of_constant_commands(log, log.runs)) == held


@pytest.mark.parametrize(("angle", "share", "held"), [(0.4, 0.008, True), (0.65, 0.013, False)])
def test_noise_of_feedback_is_no_order(angle: float, share: float, held: bool) -> None:
    """Standard deviations of 0.5 deg and of 1 % count as none, in a run of any length."""
    rng = np.random.default_rng(2)
    for rows in (100, 100_000):
        helm = 0.1 + np.radians(angle) * rng.standard_normal(rows)
        log = one_run(rows, rudder_delta=helm, propeller_n=2.0 * (1 + share * rng.standard_normal(rows)))
        assert constant_commands(log, log.runs) == (("rudder.delta", "propeller.n") if held else ())
