"""Laws of an antenna: one away from the origin is found where it is and named; sound logs are not blamed."""

from __future__ import annotations

import re

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.identification.antenna import antenna_fit, locate_antenna
from shipid.identification.settings import Identify
from shipid.identification.solution import Solution
from shipid.identification.solve import identify
from shipid.identification.statistics import LinearFit, fit_statistics
from shipid.vessel.load import Vessel, load_vessel
from tests.identification.trials import changed, trials

SHIP = load_vessel("gunnerus-28.9")
LENGTH = float(SHIP.document["particulars"]["L_pp"])
FEW = ["hull.derivatives.N_ur", "hull.derivatives.N_uv", "hull.derivatives.Y_ur"]
NOISE = {"u": 0.02, "v": 0.02, "r": 2e-3}


def log_of(seed: int, x: float = 0.0, y: float = 0.0) -> Dataset:
    """Six runs, logged by an antenna (x, y) [lengths] from the origin, with noise."""
    sound, rng = trials(SHIP, runs=6, steps=60, seed=seed), np.random.default_rng(seed)
    rows, size = sound.frame, len(sound.frame)
    ahead, side = x * LENGTH, y * LENGTH
    c, s = np.cos(rows["psi"]), np.sin(rows["psi"])
    return changed(
        sound,
        north=(rows["north"] + ahead * c - side * s).to_numpy(),
        east=(rows["east"] + ahead * s + side * c).to_numpy(),
        u=(rows["u"] - side * rows["r"]).to_numpy() + rng.normal(0, NOISE["u"], size),
        v=(rows["v"] + ahead * rows["r"]).to_numpy() + rng.normal(0, NOISE["v"], size),
        r=rows["r"].to_numpy() + rng.normal(0, NOISE["r"], size),
    )


def fitted(log: Dataset, vessel: Vessel = SHIP, **more: object) -> Solution:
    how = {"parameters": FEW, "weights": NOISE, "horizon": 30, "start": "base", **more}
    solution = identify(vessel, log, log.runs, Identify(**how))
    assert solution.status == "ok"
    return solution


def sentence(solution: Solution, log: Dataset) -> str:
    return antenna_fit(solution, log, fit_statistics(LinearFit.of(solution)))


@pytest.mark.parametrize(
    ("x", "y", "words"),
    [
        (-0.4, -0.1, r"about 1\d m astern and 2\.\d m to port of the vessel's origin"),
    ],
)
def test_an_antenna_away_from_the_origin_is_named_with_its_place(x: float, y: float, words: str) -> None:
    """Before, the estimates were far outside of their intervals, and no sentence gave the reason."""
    log = log_of(1, x, y)
    solution = fitted(log)
    seen = locate_antenna(solution, log)
    assert seen is not None
    assert (seen.x / LENGTH, seen.y / LENGTH) == pytest.approx((x, y), abs=0.02)
    said = sentence(solution, log)
    assert re.search(words, said), said
    assert ("--nuisance lever_arm=" in said) == (abs(x) > abs(y))
    assert np.abs(seen.factors - 1).max() < 0.7 * np.abs(solution.factors - 1).max()


def test_sound_logs_and_those_whose_antenna_is_estimated_are_not_blamed() -> None:
    sound = log_of(2)
    assert sentence(fitted(sound), sound) == ""
    ahead = log_of(2, 0.3)
    mended = fitted(ahead, nuisance={"lever_arm": 0.3 * LENGTH})
    assert np.abs(mended.factors - 1).max() < 0.1
    assert locate_antenna(mended, ahead) is None
    assert sentence(mended, ahead) == ""
