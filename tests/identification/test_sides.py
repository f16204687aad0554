"""Errors by side, helm and speed: what is wrong on one side only is reported, and noise is not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.identification.sides import HEADS, by_group, side_table_rows, uneven_side_warnings
from shipid.units import DEGREE
from shipid.vessel.load import load_vessel

SHIP = load_vessel("kvlcc2-l7")
STEP, ROWS = 0.5, 400


def compared(port: float, starboard: float, noise: float = 0.0) -> pd.DataFrame:
    """Groups of a zigzag whose predicted yaw rate is wrong by these shares."""
    rng, t = np.random.default_rng(1), STEP * np.arange(ROWS)
    side = np.sign(np.sin(2 * np.pi * t / 50))
    r = 0.03 * side
    predicted = r * np.where(side > 0, 1 + starboard, 1 + port) + noise * rng.normal(size=ROWS)
    motion = {"run": "A", "piece": (t // 20).astype(int), "t": t, "u": 1.0 + 0.1 * np.cos(t / 9), "v": 0.0}
    series = pd.concat(
        [
            pd.DataFrame({**motion, "r": r, "model": "measured"}),
            pd.DataFrame({**motion, "r": predicted, "model": "after"}),
        ]
    )
    helm = np.where(t < 100, 10.0, 30.0) * DEGREE * side
    still = dict.fromkeys(("north", "east", "psi", "u", "v", "r"), 0.0)
    frame = pd.DataFrame({"run": "A", "t": t, **still, "rudder.delta": helm, "propeller.n": 10.0, "flags": 0})
    return by_group(series, "after", SHIP, Dataset(frame, {"clock": "run", "flags": []}))


def test_the_error_of_the_turning_is_that_of_each_side() -> None:
    groups = compared(port=-0.14, starboard=0.02)
    of = groups[groups["group"] == "all"].set_index("side")
    assert of["turning"]["port"] == pytest.approx(-0.14)
    assert of["turning"]["starboard"] == pytest.approx(0.02)
    assert of["r"]["port"] == pytest.approx(0.14 * 0.03)
    assert {"helm about 10 deg", "helm about 30 deg"} <= set(groups["group"])
    assert sum(name.startswith("speed ") for name in groups["group"]) == 3
    assert all(len(row) == len(HEADS) for row in side_table_rows(groups))


@pytest.mark.parametrize(("seed", "after"), [(0, 0.0), (1, 0.999)])
def test_an_error_that_comes_with_a_helm_is_found_at_that_helm_alone(seed: int, after: float) -> None:
    """Orders at drawn instants, rows at or after those of the log: an order holds until the next one."""
    rng, t = np.random.default_rng(seed), STEP * np.arange(ROWS)
    hard = np.cumsum(rng.random(ROWS) < 0.1) % 2 == 1
    side = np.sign(np.sin(2 * np.pi * t / 50) + 1e-3)
    r = 0.03 * side
    motion = {"run": "A", "piece": (t // 20).astype(int), "t": t + after * STEP, "u": 1.0, "v": 0.0}
    turns = {"measured": r, "after": r * np.where(hard, 1.2, 1.0)}
    series = pd.concat([pd.DataFrame({**motion, "r": values, "model": name}) for name, values in turns.items()])
    still = dict.fromkeys(("north", "east", "psi", "u", "v", "r"), 0.0)
    helm = np.where(hard, 30.0, 10.0) * DEGREE * side
    frame = pd.DataFrame({"run": "A", "t": t, **still, "rudder.delta": helm, "propeller.n": 10.0, "flags": 0})
    groups = by_group(series, "after", SHIP, Dataset(frame, {"clock": "run", "flags": []}))
    found = groups[groups["group"].str.startswith("helm")].set_index(["group", "side"])
    assert len(found) == 4
    for degrees, error in ((10, 0.0), (30, 0.2)):
        here = found.loc[f"helm about {degrees} deg"]
        assert here["turning"].tolist() == pytest.approx([error, error], abs=1e-12)
        assert here["r"].tolist() == pytest.approx([0.03 * error] * 2, abs=1e-12)


def test_one_side_that_is_worse_is_reported_with_what_to_run_next() -> None:
    sentences = uneven_side_warnings(compared(port=-0.14, starboard=0.02))
    assert sentences[0].startswith("the error of the turning is -14 % to port and +2 % to starboard")
    assert any(
        "at helm about 30 deg" in sentence and "to run next: turns to both sides" in sentence for sentence in sentences
    )


@pytest.mark.parametrize(("port", "starboard", "noise"), [(-0.14, -0.13, 0.0), (0.01, 0.0, 0.003), (0.0, 0.0, 0.02)])
def test_sides_alike_and_noise_are_not_reported(port: float, starboard: float, noise: float) -> None:
    assert uneven_side_warnings(compared(port, starboard, noise)) == ()
