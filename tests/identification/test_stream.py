"""Laws of currents that no log has: none, one of all runs, or one by run is estimated, as the residuals show."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.identification.settings import Identify
from shipid.identification.solution import Solution
from shipid.identification.solve import identify
from shipid.identification.stream import estimate_currents
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
    solution = fitted(log_of(1, np.tile([0.3, 0.2], (6, 1))), **more)
    assert solution.settings.current == "one"
    assert solution.common_current == pytest.approx((0.3, 0.2), abs=0.02)
    assert solution.paths[-2:] == ("current_north", "current_east")
    assert solution.values.keys() <= SHIP.parameters.keys()
    assert ("one current of all runs, 0.3" in " ".join(solution.warnings)) is (not more)


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
    solution = fitted(late, current="none")
    assert all(one.explained < 0.2 for one in estimate_currents(solution, late))


def test_a_current_that_is_set_is_not_looked_for() -> None:
    log = log_of(1, drawn(1))
    V_c, beta_c = np.hypot(*drawn(1).T), np.arctan2(*drawn(1).T[::-1])
    known = {f"{run}.environment.V_c": float(V) for run, V in zip(log.runs, V_c, strict=True)}
    known |= {f"{run}.environment.beta_c": float(b) for run, b in zip(log.runs, beta_c, strict=True)}
    vessel = SHIP.with_values({"current.kind": "uniform"})
    settings = Identify(parameters=FEW, weights=NOISE, horizon=0, start="base", runs=known)
    assert not estimate_currents(identify(vessel, log, log.runs, settings), log)
    alone = log.select(log.runs[:1])
    assert not estimate_currents(fitted(alone), alone)
