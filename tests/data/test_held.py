"""Commands that no run varies: they are named, and a log that varies one at all is left alone."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.data.held import held_commands, nothing_varies

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
    (words,) = nothing_varies(dataset, dataset.runs)
    assert set(held_commands(dataset, dataset.runs)) == set(HELD)
    assert "rudder.delta" in words
    assert "are the same in all 5 runs: what they do cannot be learnt" in words
    assert "is the same" not in words
    assert "throughout the only run" in nothing_varies(dataset, ["run 0"])[0]


@pytest.mark.parametrize("where", ["one run", "a moment", "between runs"])
def test_a_command_that_varies_anywhere_varies(where: str) -> None:
    other = HELD["rudder.delta"].copy()
    other[slice(60, 65) if where == "a moment" else slice(100, N) if where == "one run" else slice(None)] = -0.1
    dataset = log({}, {}, {}, {"rudder.delta": other})
    assert held_commands(dataset, dataset.runs) == ("propeller.n",)
    assert nothing_varies(dataset, dataset.runs) == []
    assert nothing_varies(dataset, ["run 0", "run 1"]) != []
