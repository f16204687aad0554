"""Kinds of runs: names that people give win; orders and motion say the rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shipid.logs.kinds import LOW_SPEED, RANDOM
from shipid.study.prepare import kinds_of_runs, obtain_runs
from tests.study.tiny import logged, tiny_plan

T = np.arange(0.0, 200.0)


def steps(levels: list[float]) -> np.ndarray:
    return np.repeat(np.radians(levels), len(T) // len(levels))


def test_the_mapping_wins_over_the_name_and_the_name_over_the_motion() -> None:
    helm = steps([10, -10, 10, -10, 10, -10, 10, -10])
    columns = {"psi": np.cumsum(-0.05 * helm), "r": -0.05 * helm, "u": 4.0, "port.n": 2.0, "port.alpha": helm}
    runs = {"ZZ 1": columns, "berthing 1": columns, "run 3": columns}
    log = logged(runs, T, manoeuvres={"ZZ 1": "turning"})
    assert kinds_of_runs(log) == {"ZZ 1": "turning", "berthing 1": LOW_SPEED, "run 3": "zigzag"}


def test_a_simulated_run_is_of_the_kind_that_was_drawn(tmp_path: Path) -> None:
    """What its motion looks like is another question: turns of random length look like anything."""
    blocks = [
        {"kind": "zigzag", "n_rpm": 150.0},
        {"kind": "turning", "n_rpm": [100.0, 200.0], "alpha_deg": [-30.0, 30.0]},
        {"kind": "turning_circle", "n_rpm": 150.0},
        {"kind": "excitation", "n_rpm": [100.0, 200.0], "angle_deg": 20.0, "signal": "aprbs"},
        {"kind": "steps", "n_rpm": [100.0, 200.0], "alpha_deg": [-30.0, 30.0]},
    ]
    for block, kind in zip(blocks, ["zigzag", "turning", "turning", RANDOM, RANDOM], strict=True):
        plan = tiny_plan(tmp_path, {"truth.manoeuvre": [block], "truth.manoeuvres": 10})
        assert set(kinds_of_runs(obtain_runs(plan)).values()) == {kind}
