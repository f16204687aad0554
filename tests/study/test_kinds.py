"""Kinds of runs: names that people give win; orders and motion say the rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from shipid.logs.kinds import COASTING, LOW_SPEED, RANDOM
from shipid.study.kinds import kind_by_motion, kinds_of_runs
from shipid.study.prepare import obtain_runs
from tests.study.tiny import logged, tiny_plan

T = np.arange(0.0, 200.0)


def rows(helm: np.ndarray, n: np.ndarray | float = 2.0, u: np.ndarray | float = 4.0) -> pd.DataFrame:
    """A ship whose yaw rate follows the helm of both azimuth units."""
    r = -0.05 * helm
    columns = {"psi": np.cumsum(r), "r": r, "u": u, "port.n": n, "starboard.n": n}
    return logged({"x": columns | {"port.alpha": helm, "starboard.alpha": helm}}, T).frame


def steps(levels: list[float]) -> np.ndarray:
    return np.repeat(np.radians(levels), len(T) // len(levels))


def test_random_helm_is_no_zigzag() -> None:
    assert kind_by_motion(rows(steps([20, -5, 12, -18, 3, -9, 15, -20])), 4.0, 2.0) == RANDOM
    assert kind_by_motion(rows(steps([10, -10, 10, -10, 10, -10, 10, -10])), 4.0, 2.0) == "zigzag"


def test_a_stopped_shaft_at_speed_is_coasting_and_a_slow_ship_manoeuvres() -> None:
    helm = np.zeros(len(T))
    assert kind_by_motion(rows(helm, n=0.0, u=np.linspace(4, 1, len(T))), 4.0, 2.0) == COASTING
    assert kind_by_motion(rows(steps([20, -5, 12, -18]), u=0.4), 4.0, 2.0) == LOW_SPEED


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


def test_the_motion_of_the_test_says_nothing_of_other_runs() -> None:
    """What is slow is slow beside the runs that train: a kind in training may not hang on the test."""
    t = np.arange(60.0)
    for fast in (1.0, 12.0):
        speeds = {"a": 4.0, "b": 1.0, "c": 4.0, "test": fast, "more": fast, "last": fast}
        runs = {name: {"u": u, "port.n": 2.0, "starboard.n": 2.0} for name, u in speeds.items()}
        known = kinds_of_runs(logged(runs, t), test={"test", "more", "last"})
        assert known["b"] == LOW_SPEED
        assert known["a"] == known["c"] != LOW_SPEED
