"""Laws of currents that no log has: none, one of all runs, or one by run is estimated, as the residuals show."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.identification import solve
from shipid.identification.fit import Solution
from shipid.identification.outcome import _next_manoeuvres, run_identification
from shipid.identification.settings import Identify
from shipid.identification.solve import identify
from shipid.identification.statistics import fit_statistics
from shipid.vessel.load import Vessel, load_vessel
from tests.identification.trials import changed, noisy, trials

SHIP = load_vessel("gunnerus-28.9")
FEW = ["hull.derivatives.N_ur", "hull.derivatives.N_uv", "hull.derivatives.Y_ur"]
NOISE = {"u": 0.02, "v": 0.02, "r": 2e-3}


def drawn(seed: int, runs: int = 6) -> np.ndarray:
    """(runs, 2) currents [m/s], north and east."""
    return np.random.default_rng(seed).normal(0, 0.3, (runs, 2))


def log_of(seed: int, currents: np.ndarray | None = None) -> Dataset:
    """Six runs with noise, each in its current."""
    if currents is None:
        return noisy(trials(SHIP, steps=90, seed=seed), NOISE, seed)
    weather = {"V_c": np.hypot(*currents.T), "beta_c": np.arctan2(currents[:, 1], currents[:, 0])}
    return noisy(
        trials(SHIP.with_values({"current.kind": "uniform"}), steps=90, seed=seed, weather=weather), NOISE, seed
    )


def fitted(log: Dataset, **more: object) -> Solution:
    how = {"parameters": FEW, "weights": NOISE, "horizon": 0, "start": "base", **more}
    solution = identify(SHIP, log, log.runs, Identify(**how))
    assert solution.status == "ok"
    return solution


@cache
def steady_log() -> Dataset:
    """Six runs in one current."""
    return log_of(1, np.tile([0.3, 0.2], (6, 1)))


@cache
def steady_fit() -> Solution:
    return fitted(steady_log())


def estimated(solution: Solution) -> np.ndarray:
    """(R, 2) currents of the runs [m/s]."""
    return np.array([[run["current_north"], run["current_east"]] for run in solution.nuisances.values()])


@pytest.mark.parametrize(("seed", "more"), [(2, {"horizon": 45})])
def test_another_current_in_each_run_is_estimated_by_run(seed: int, more: dict) -> None:
    """For a vessel without a current term the numbers made up for it, and intervals were far from the truth."""
    log = log_of(seed, drawn(seed))
    solution, without = fitted(log, **more), fitted(log, current="none", **more)
    assert solution.settings.current == "by run"
    np.testing.assert_allclose(estimated(solution), drawn(seed), atol=0.05)
    assert np.abs(solution.factors - 1).max() < 0.3 * np.abs(without.factors - 1).max()
    assert "another current in each run, 0." in " ".join(solution.warnings)
    assert solution.common_current == (0.0, 0.0)


@pytest.mark.parametrize("more", [{}, {"nuisance": {"current": 0.3}}])
def test_one_current_of_all_runs_is_a_number_with_an_interval(more: dict) -> None:
    solution = fitted(steady_log(), **more) if more else steady_fit()
    assert solution.settings.current == "one"
    assert solution.common_current == pytest.approx((0.3, 0.2), abs=0.02)
    assert solution.paths[-2:] == ("current_north", "current_east")
    assert solution.values.keys() <= SHIP.parameters.keys()
    assert ("one current of all runs, 0.3" in " ".join(solution.warnings)) is (not more)


@pytest.mark.parametrize(("seed", "runs"), [(0, 4), (1, 4), (2, 4), (3, 6)])
def test_one_current_of_all_runs_is_not_taken_for_others_by_run(seed: int, runs: int) -> None:
    """In 3 to 5 of 10 logs it was: the motion is not linear in half a metre per second."""
    log = log_of(seed, np.tile([0.5, 0.4], (6, 1)))
    solution = identify(SHIP, log, log.runs[:runs], Identify(parameters=FEW))
    assert solution.settings.current == "one"
    assert solution.common_current == pytest.approx((0.5, 0.4), abs=0.02)


@pytest.mark.parametrize("seed", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_currents_that_scatter_about_a_strong_one_are_estimated_by_run(seed: int) -> None:
    currents = np.array([2.0, 0.4]) + drawn(seed)
    log = log_of(seed, currents)
    solution = identify(SHIP, log, log.runs, Identify(parameters=FEW))
    assert solution.settings.current == "by run"
    np.testing.assert_allclose(estimated(solution), currents, atol=0.05)


def test_wind_that_the_log_lacks_is_named_for_a_vessel_that_feels_it() -> None:
    seed = 1
    windy = trials(SHIP, steps=90, seed=seed, weather={"V_w": np.full(6, 12.0), "beta_w": np.full(6, 1.0)})
    log = noisy(changed(windy, V_w=np.zeros(len(windy.frame)), beta_w=np.zeros(len(windy.frame))), NOISE, seed)
    assert "or of wind that the log lacks" in " ".join(fitted(log).warnings)
    ship = Vessel({key: block for key, block in SHIP.document.items() if key != "wind"}, SHIP.file)
    log = log_of(seed, drawn(seed))
    solution = identify(ship, log, log.runs, Identify(parameters=FEW, weights=NOISE, horizon=0, start="base"))
    said = " ".join(solution.warnings)
    assert "another current in each run" in said
    assert "wind" not in said


def test_logs_without_a_current_are_given_none() -> None:
    sound = log_of(1)
    assert fitted(sound).settings.current == "none"
    late = changed(sound, **{name: np.roll(sound.frame[name].to_numpy(), 2) for name in sound.commands})
    assert fitted(late).settings.current == "none"


def test_a_current_that_is_set_is_not_looked_for() -> None:
    log = log_of(1, drawn(1))
    V_c, beta_c = np.hypot(*drawn(1).T), np.arctan2(*drawn(1).T[::-1])
    known = {f"{run}.environment.V_c": float(V) for run, V in zip(log.runs, V_c, strict=True)}
    known |= {f"{run}.environment.beta_c": float(b) for run, b in zip(log.runs, beta_c, strict=True)}
    vessel = SHIP.with_values({"current.kind": "uniform"})
    settings = Identify(parameters=FEW, weights=NOISE, horizon=0, start="base", runs=known)
    assert identify(vessel, log, log.runs, settings).settings.current == "none"
    assert fitted(log.select(log.runs[:1])).settings.current == "none"


HOW = {"parameters": FEW, "weights": NOISE, "horizon": 0, "start": "base"}


def test_the_sentence_stays_where_residuals_are_discounted() -> None:
    assert "one current of all runs" in " ".join(fitted(steady_log(), discount=True).warnings)


def test_a_fit_begins_from_one_that_chose_a_current() -> None:
    log, before = steady_log(), steady_fit()
    after = identify(SHIP, log, log.runs, Identify(**HOW), start=before)
    np.testing.assert_allclose(after.factors, before.factors, atol=1e-5)


@pytest.mark.parametrize("nuisance", [[], ["current"]])
def test_a_stop_by_the_user_is_kept(nuisance: list[str]) -> None:
    """Soon or late: the fit went on with a current, or gave the one without as if nobody had stopped."""
    log, seen = steady_log(), list[int]()
    settings = Identify(**HOW, nuisance=nuisance)
    identify(SHIP, log, log.runs, settings, progress=lambda number, _: seen.append(number))
    for most in (len(seen) // 10, 9 * len(seen) // 10):
        count = list[int]()

        def stop(number: int, _: float, most: int = most, count: list[int] = count) -> bool:
            count.append(number)
            return len(count) > most

        assert identify(SHIP, log, log.runs, settings, progress=stop).status == "stopped"
        assert len(count) == most + 1


def test_a_fit_with_a_current_that_fails_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    log = steady_log()
    real = solve._fit_dropping_factors

    def failing(*args: object) -> Solution:
        solution = real(*args)
        return replace(solution, status="ok" if solution.settings.current == "none" else "not converged")

    monkeypatch.setattr(solve, "_fit_dropping_factors", failing)
    solution = identify(SHIP, log, log.runs, Identify(**HOW))
    assert solution.settings.current == "none"
    assert "a current, but the fit with it fails: converged" in " ".join(solution.warnings)


def test_what_a_current_takes_away_is_not_known_of_the_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    known = list[np.ndarray]()
    monkeypatch.setattr("shipid.identification.design.rank_candidates", lambda *given: known.append(given[-1]))
    log = log_of(1, np.tile([0.3, 0.0], (6, 1))).select(["M01", "M02"])
    solution = fitted(log, current="one")
    judged = fit_statistics(solution)
    _next_manoeuvres(SHIP.with_values(solution.values), log, log.runs, solution, judged)
    whole = judged.information + np.diag(solution.prior_widths**-2.0)
    np.testing.assert_allclose(np.linalg.inv(known[0]), np.linalg.inv(whole)[:3, :3], rtol=1e-6)


@pytest.mark.parametrize("more", [{}, {"nuisance": {"current": 0.05}}])
def test_only_a_prior_of_a_current_that_is_named_is_contradicted(monkeypatch: pytest.MonkeyPatch, more: dict) -> None:
    monkeypatch.setattr(
        "shipid.identification.outcome.STARBOARD_TRIALS", {"turning 35": ("turning", (35,), "starboard")}
    )
    log = log_of(1, np.tile([1.8, 0.0], (6, 1)))
    said = " ".join(run_identification(SHIP, log, Identify(**HOW, current="one", **more), log.runs).warnings)
    assert ("current_north would be 1.8 +- 0.0" in said) is bool(more)
    assert ("m/s (prior 0.05)" in said) is bool(more)
