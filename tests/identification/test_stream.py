"""Laws of currents that no log has: another one in each run is named with the remedy; sound logs are not blamed."""

from __future__ import annotations

import re

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.identification.settings import Identify
from shipid.identification.solve import Solution, identify
from shipid.identification.statistics import LinearFit, fit_statistics
from shipid.identification.stream import current_fit, estimate_currents
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


def sentence(solution: Solution, log: Dataset) -> str:
    return current_fit(solution, log, fit_statistics(LinearFit.of(solution)))


@pytest.mark.parametrize(("seed", "more"), [(2, {"horizon": 45})])
def test_another_current_in_each_run_is_named_with_the_nuisance_that_estimates_it(seed: int, more: dict) -> None:
    """For a vessel without a current term nothing named it, and intervals were far from the truth."""
    log, currents = log_of(seed, drawn(seed)), drawn(seed)
    solution = fitted(log, **more)
    seen = estimate_currents(solution, log)
    assert seen is not None
    assert seen.size == pytest.approx(np.sqrt(np.mean(np.sum(currents**2, axis=1))), rel=0.35)
    assert re.search(
        r"another current in each run, 0\.\d+ m/s, .* with --nuisance current=0\.\d", sentence(solution, log)
    )
    mended = fitted(log, nuisance={"current": 0.3})
    assert np.abs(mended.factors - 1).max() < 0.3 * np.abs(solution.factors - 1).max()
    assert sentence(mended, log) == ""


def test_one_current_of_all_runs_is_not_called_another_one_in_each() -> None:
    log = log_of(1, np.tile([0.3, 0.2], (6, 1)))
    said = sentence(fitted(log), log)
    assert re.search(
        r"those of a current, about the same in all runs, 0\.3\d m/s, .* with --nuisance current=0\.4", said
    )
    assert "another current" not in said


def test_wind_that_the_log_lacks_is_named_for_a_vessel_that_feels_it() -> None:
    seed = 1
    windy = trials(SHIP, steps=90, seed=seed, weather={"V_w": np.full(6, 12.0), "beta_w": np.full(6, 1.0)})
    log = noisy(changed(windy, V_w=np.zeros(len(windy.frame)), beta_w=np.zeros(len(windy.frame))), NOISE, seed)
    assert "away, or of wind that the log lacks: estimates" in sentence(fitted(log), log)
    ship = Vessel({key: block for key, block in SHIP.document.items() if key != "wind"}, SHIP.file)
    log = log_of(seed, drawn(seed))
    solution = identify(ship, log, log.runs, Identify(parameters=FEW, weights=NOISE, horizon=0, start="base"))
    assert "another current in each run" in sentence(solution, log)
    assert "wind" not in sentence(solution, log)


def test_logs_without_a_current_are_not_blamed() -> None:
    sound = log_of(1)
    assert sentence(fitted(sound), sound) == ""
    wrong = {path: 1.3 * SHIP.parameters[path] for path in SHIP.parameters if "derivatives.X_" in path}
    late = changed(sound, **{name: np.roll(sound.frame[name].to_numpy(), 2) for name in sound.commands})
    for vessel, log in ((SHIP.with_values(wrong), sound), (SHIP, late)):
        solution = identify(vessel, log, log.runs, Identify(parameters=FEW, weights=NOISE, horizon=0, start="base"))
        seen = estimate_currents(solution, log)
        assert seen is not None
        assert seen.explained < 0.1
        assert sentence(solution, log) == ""


def test_a_current_that_is_set_is_not_looked_for() -> None:
    log = log_of(1, drawn(1))
    V_c, beta_c = np.hypot(*drawn(1).T), np.arctan2(*drawn(1).T[::-1])
    known = {f"{run}.environment.V_c": float(V) for run, V in zip(log.runs, V_c, strict=True)}
    known |= {f"{run}.environment.beta_c": float(b) for run, b in zip(log.runs, beta_c, strict=True)}
    vessel = SHIP.with_values({"current.kind": "uniform"})
    settings = Identify(parameters=FEW, weights=NOISE, horizon=0, start="base", runs=known)
    assert estimate_currents(identify(vessel, log, log.runs, settings), log) is None
    alone = log.select(log.runs[:1])
    assert estimate_currents(fitted(alone), alone) is None
