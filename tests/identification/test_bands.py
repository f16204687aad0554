"""Bands on manoeuvres of an identified vessel: linear measures exactly, coverage, and when there is none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from shipid.errors import DataError, ShipidError
from shipid.identification.bands import (
    Perform,
    Reach,
    band_refusal,
    data_reach,
    extrapolation_sentence,
    measure_bands,
    of_log,
    principal_axes,
)
from shipid.identification.fit import Solution
from shipid.identification.outcome import run_identification
from shipid.identification.solve import identify
from shipid.identification.statistics import Statistics, fit_statistics
from shipid.simulation.manoeuvre import TurningCircle
from shipid.simulation.perform import perform_manoeuvres
from shipid.units import DEGREE
from shipid.vessel.load import Vessel, load_vessel
from tests.identification.test_outcome import FEW, NOISE, settings
from tests.identification.trials import noisy, trials

SHIP = load_vessel("gunnerus-28.9")
SLOPES = np.array([0.3, -1.2, 0.5])


def linear(vessel: Vessel) -> Mapping[str, float]:
    """A measure that is linear in the factors, and one of the other sign in other units."""
    factors = np.array([vessel.parameters[path] / SHIP.parameters[path] for path in FEW])
    value = float(SLOPES @ factors)
    return {"one": value, "other": 10.0 - 1000.0 * value}


def at_once(title: str, measure: Callable[[Vessel], Mapping[str, float]]) -> Perform:
    """One manoeuvre with these measures."""
    return lambda vessel: {title: measure(vessel)}


def judged(seed: int) -> tuple[Solution, Statistics]:
    data = noisy(trials(SHIP, runs=5, steps=40), NOISE, seed)
    solution = identify(SHIP, data, data.runs, settings(nuisance=["initial_state"]))
    return solution, fit_statistics(solution)


@pytest.fixture(scope="module")
def fitted() -> tuple[Solution, Statistics]:
    return judged(3)


def test_of_a_linear_measure_it_is_the_propagated_covariance(fitted: tuple[Solution, Statistics]) -> None:
    solution, known = fitted
    rows = measure_bands(SHIP, solution, known, at_once("all", linear), 0.8).set_index("measure")
    best = known.covariances[known.chosen]
    slopes = SLOPES[[FEW.index(path) for path in solution.paths]]
    deviation = np.sqrt(slopes @ best.matrix @ slopes)
    half = deviation * stats.t.ppf(0.9, np.median(best.freedom))
    assert rows["deviation"]["one"] == pytest.approx(deviation, rel=1e-3)
    assert (rows["high"]["one"] - rows["low"]["one"]) / 2 == pytest.approx(half, rel=1e-3)
    assert rows["high"]["other"] - rows["low"]["other"] == pytest.approx(2000 * half, rel=1e-3)
    wider = measure_bands(SHIP, solution, known, at_once("all", linear), 0.95).set_index("measure")
    assert (wider["low"] < rows["low"]).all()
    assert (wider["high"] > rows["high"]).all()


@pytest.mark.parametrize("bend", [0.5, -0.5])
def test_of_a_bent_measure_it_has_the_moments_of_a_normal_error(
    fitted: tuple[Solution, Statistics], bend: float
) -> None:
    """2 z + b z^2 of a standard normal z has the mean b and the variance 4 + 2 b^2: the band moves to one side."""
    solution, known = fitted
    best = known.covariances[known.chosen]
    axis = principal_axes(best.matrix)[:, 0]
    base = np.array([SHIP.parameters[path] for path in solution.paths])

    def bent(vessel: Vessel) -> Mapping[str, float]:
        factors = np.array([vessel.parameters[path] for path in solution.paths]) / base
        z = float(axis @ (factors - solution.factors)) / float(axis @ axis)
        return {"bent": 2 * z + bend * z**2}

    row = measure_bands(SHIP, solution, known, at_once("one", bent), 0.8).iloc[0]
    half = np.sqrt(4.5) * stats.t.ppf(0.9, np.median(best.freedom))
    assert row["deviation"] == pytest.approx(np.sqrt(4.5), rel=1e-6)
    assert (row["low"], row["high"]) == pytest.approx((-half + min(bend, 0), half + max(bend, 0)), rel=1e-6)


def test_a_manoeuvre_that_cannot_be_performed_within_the_interval_says_so(fitted: tuple[Solution, Statistics]) -> None:
    solution, known = fitted
    centre = SHIP.with_values(solution.values).parameters

    def perform(vessel: Vessel) -> Mapping[str, Mapping[str, float]]:
        return ({"fast": linear(vessel)} if vessel.parameters == centre else {}) | {"all": linear(vessel)}

    rows = measure_bands(SHIP, solution, known, perform)
    assert rows["note"][0] == "diverges within the interval of the numbers"
    assert np.isfinite(rows["low"][1])

    def refused(vessel: Vessel) -> Mapping[str, Mapping[str, float]]:
        if vessel.parameters != centre:
            raise ShipidError("no shaft speed gives it 9 m/s")
        return {"fast": linear(vessel)}

    assert measure_bands(SHIP, solution, known, refused)["note"].tolist() == ["no shaft speed gives it 9 m/s"]


def test_short_horizons_with_coloured_residuals_are_refused(fitted: tuple[Solution, Statistics]) -> None:
    solution, known = fitted
    coloured = {name: replace(one, memory=4.0, probability=0.0) for name, one in known.whiteness.items()}
    bad = replace(known, whiteness=coloured)
    short = replace(solution, settings=settings(horizon=20.0))
    assert band_refusal(solution, known) == ""
    assert "the horizon of 20 s is short against residuals that are correlated over 4 s" in band_refusal(short, bad)
    assert band_refusal(replace(solution, settings=settings(horizon=50.0)), bad) == ""
    assert band_refusal(solution, bad) == ""  # whole runs
    best = replace(known.covariances[known.chosen], trusted=False, reason="3 runs")
    vague = replace(known, covariances={known.chosen: best})
    assert band_refusal(solution, vague) == "the standard errors are not to be trusted: 3 runs"
    silent = replace(known, errors=np.where(np.arange(len(FEW)) == 1, np.inf, known.errors))
    name = FEW[1].rpartition(".")[2]
    assert band_refusal(solution, silent) == f"the data do not determine {name}: give priors, or fix some"


def test_a_level_that_is_none_is_refused_before_the_fit() -> None:
    with pytest.raises(DataError, match="is no level of a band"):
        run_identification(SHIP, trials(SHIP, runs=2, steps=10), settings(), band=90.0)


TANKER = load_vessel("kvlcc2-l7")


def test_it_is_the_greatest_of_the_motion() -> None:
    u, v, r = np.array([2.0, 2.0, 0.8]), np.array([0.0, -2.0, 0.0]), np.array([0.0, 0.1, -0.3])
    helm = np.array([0.0, -30.0, 10.0]) * DEGREE
    reach = Reach.of(TANKER, {"u": u, "v": v, "r": r, "rudder.delta": helm, "propeller.n": u})
    assert reach.drift == pytest.approx(45)
    assert reach.rate == pytest.approx(0.3 * 7 / 0.8)
    assert reach.helm == pytest.approx(30)
    assert reach.speed == 0.8


@pytest.mark.parametrize(
    ("name", "words", "near", "far"),
    [
        ("drift", "deg of drift", 21.8, 23.0),
        ("rate", "r L / U of", 0.54, 0.58),
        ("helm", "deg of helm", 32.5, 34.0),
        ("speed", "a speed of", 1.9, 1.7),
    ],
)
def test_each_part_has_a_tenth_to_spare(name: str, words: str, near: float, far: float) -> None:
    data = Reach(drift=20.0, rate=0.5, helm=30.0, speed=2.0)
    assert extrapolation_sentence("a turn", replace(data, **{name: near}), data) == ""
    sentence = extrapolation_sentence("a turn", replace(data, **{name: far}), data)
    assert words in sentence
    assert " and " not in sentence
    little = Reach(drift=0.5, rate=0.01, helm=0.5, speed=2.0)
    assert extrapolation_sentence("a turn", Reach(drift=1.4, rate=0.029, helm=1.4, speed=2.0), little) == ""
    sentence = extrapolation_sentence("a turn", Reach(drift=1.6, rate=0.031, helm=1.6, speed=2.0), little)
    assert sentence == "a turn reaches 2 deg of drift, r L / U of 0.03 and 2 deg of helm; the data reach 0, 0.01 and 0"


def test_a_ship_at_rest_has_no_drift() -> None:
    still = dict.fromkeys(("u", "v", "r", "rudder.delta", "propeller.n"), np.zeros(3))
    assert Reach.of(TANKER, still) == Reach(0.0, 0.0, 0.0, 0.0)


def test_a_hard_turn_goes_beyond_gentle_trials_and_not_beyond_itself() -> None:
    hard = perform_manoeuvres(TANKER, [TurningCircle(n_rpm=627, angle_deg=35, duration=60)], step=0.1)
    gentle = perform_manoeuvres(TANKER, [TurningCircle(n_rpm=627, angle_deg=3, duration=20)], step=0.1)
    sentence = extrapolation_sentence("turning 35", of_log(TANKER, hard), of_log(TANKER, gentle))
    assert sentence.startswith("turning 35 reaches ")
    for word in ("deg of drift", "r L / U of", "35 deg of helm", "a speed of", "; the data reach"):
        assert word in sentence
    assert extrapolation_sentence("turning 35", of_log(TANKER, hard), of_log(TANKER, hard)) == ""
    data = trials(TANKER, runs=2, steps=40)
    assert data_reach(TANKER, data, ["M01"]).helm <= 0.6 / DEGREE
