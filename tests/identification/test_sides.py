"""Errors by side, helm and speed: what is wrong on one side only is said, and noise is not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.identification.sides import HEADS, by_group, shown, uneven
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
    found = compared(port=-0.14, starboard=0.02)
    of = found[found["group"] == "all"].set_index("side")
    assert of["turning"]["port"] == pytest.approx(-0.14)
    assert of["turning"]["starboard"] == pytest.approx(0.02)
    assert of["r"]["port"] == pytest.approx(0.14 * 0.03)
    assert {"helm about 10 deg", "helm about 30 deg"} <= set(found["group"])
    assert sum(name.startswith("speed ") for name in found["group"]) == 3
    assert all(len(row) == len(HEADS) for row in shown(found))


def test_one_side_that_is_worse_is_said_with_what_to_run_next() -> None:
    said = uneven(compared(port=-0.14, starboard=0.02))
    assert said[0].startswith("the error of the turning is -14% to port and +2% to starboard")
    assert any(
        "at helm about 30 deg" in sentence and "to run next: turns to both sides" in sentence for sentence in said
    )


@pytest.mark.parametrize(("port", "starboard", "noise"), [(-0.14, -0.13, 0.0), (0.01, 0.0, 0.003), (0.0, 0.0, 0.02)])
def test_sides_alike_and_noise_are_not_said(port: float, starboard: float, noise: float) -> None:
    assert uneven(compared(port, starboard, noise)) == ()
