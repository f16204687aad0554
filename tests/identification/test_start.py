"""Laws of the start: growing horizons lead a lost start to where whole runs can be predicted."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DataError
from shipid.identification.fit import evaluate_factors, initial_point
from shipid.identification.residuals import Problem, build_problem
from shipid.identification.settings import Identify
from shipid.identification.solve import by_inverse_dynamics, grow_horizon
from shipid.simulation.truth import Truth, simulate_truth
from shipid.vessel.load import Vessel, load_vessel
from tests.identification.trials import trials

SHIP = load_vessel("gunnerus-28.9")
DATA = trials(SHIP, runs=4)
MAIN = tuple(f"hull.derivatives.{name}" for name in ("X_u|u|", "X_rv", "Y_ur", "Y_rrr", "N_ur", "N_rrr", "N_r|r|"))
PORT, STARBOARD = "thruster.port.D_p", "thruster.starboard.D_p"
SETTINGS = Identify(parameters=["hull.derivatives.*"], horizon=0, weights={"u": 1e-2, "v": 1e-2, "r": 1e-3})


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 5])
def test_growing_horizons_end_near_the_truth(seed: int) -> None:
    problem = build_problem(SHIP, DATA, DATA.runs, SETTINGS)
    lost = 1 + 3 * np.random.default_rng(seed).uniform(-1, 1, problem.num_factors)
    assert not np.isfinite(evaluate_factors(problem, lost, initial_point(problem)).objective)
    factors, iterations, stopped = grow_horizon(problem, DATA, lost)
    assert not stopped
    assert iterations > 0
    assert np.abs(factors - 1).max() < 0.05


def test_a_horizon_that_is_short_needs_no_start() -> None:
    problem = build_problem(SHIP, DATA, DATA.runs, SETTINGS.model_copy(update={"horizon": 2.0}))
    factors, iterations, stopped = grow_horizon(problem, DATA, np.full(problem.num_factors, 1.3))
    assert (iterations, stopped) == (0, False)
    assert (factors == 1.3).all()


def test_it_stops_on_request_and_counts_on() -> None:
    problem, seen = build_problem(SHIP, DATA, DATA.runs, SETTINGS), list[int]()

    def progress(iteration: int, _objective: float) -> bool:
        seen.append(iteration)
        return iteration == 7

    _, iterations, stopped = grow_horizon(problem, DATA, np.full(problem.num_factors, 1.3), progress, 5)
    assert stopped
    assert iterations == 7
    assert seen == [5, 6, 7]


def test_inverse_dynamics_keeps_within_the_bounds() -> None:
    bounded = SETTINGS.model_copy(update={"bounds": {"hull.derivatives.N_ur": (1.5, 2.0)}})
    problem = build_problem(SHIP, DATA, DATA.runs, bounded)
    factors = by_inverse_dynamics(problem, DATA)
    place = problem.unknown.paths.index("hull.derivatives.N_ur")
    assert factors[place] == 1.5


@cache
def turning_log(noise: float = 0.0, wind: tuple[float, float] = (0.0, 6.0)) -> Dataset:
    """Eight manoeuvres of a minute, rows at 5 Hz with noise of u and v [m/s], and of r a tenth of it [rad/s]."""
    orders, times = {"n_rpm": (50, 200), "alpha_deg": (-50, 50), "start_speed": (1, 4)}, {"step": 0.05, "interval": 0.2}
    wanted = Truth(vessel=SHIP.key, manoeuvres=8, duration=60, **times, wind_speed=wind, manoeuvre=[orders])
    frame, rng = simulate_truth(wanted, SHIP), np.random.default_rng(0)
    sizes = {"u": noise, "v": noise, "r": 0.1 * noise, "psi": 0.1 * noise, "north": 15 * noise, "east": 15 * noise}
    noisy = {name: frame[name] + rng.normal(0, size, len(frame)) for name, size in sizes.items()}
    return Dataset(frame.assign(**noisy), {})


def first_guess(base: Vessel, log: Dataset, **more: object) -> tuple[Problem, np.ndarray]:
    """The problem, and its start by inverse dynamics."""
    problem = build_problem(base, log, log.runs, Identify(**{"parameters": MAIN, "step": 0.2, "horizon": 10.0, **more}))
    return problem, by_inverse_dynamics(problem, log)


def objective(problem: Problem, factors: np.ndarray) -> float:
    return evaluate_factors(problem, factors, initial_point(problem)).objective


@pytest.mark.parametrize("seed", range(2))
def test_forces_give_the_truth_also_of_numbers_in_which_they_are_not_linear(seed: int) -> None:
    """Both propellers share one factor of their diameter; thrust goes with its fourth power and more."""
    draw, paths = np.random.default_rng(seed), (*MAIN, PORT, STARBOARD)
    factors = np.append(draw.uniform(0.7, 1.3, len(MAIN)), 2 * [draw.uniform(0.8, 1.2)])
    base = SHIP.with_values({path: SHIP.parameters[path] / x for path, x in zip(paths, factors, strict=True)})
    problem, start = first_guess(base, turning_log(), parameters=paths, together=[[PORT, STARBOARD]])
    np.testing.assert_allclose(start, factors[:-1], rtol=5e-3)
    assert objective(problem, start) < 1e-6 * objective(problem, np.ones(len(start)))


def test_forces_give_a_derivative_that_the_base_lacks() -> None:
    base = SHIP.with_values({MAIN[4]: 0.0})
    _, start = first_guess(base, turning_log(), parameters=MAIN[4:5], scale={MAIN[4]: 1e6})
    assert start[0] * 1e6 == pytest.approx(SHIP.parameters[MAIN[4]], rel=1e-3)


def test_the_wind_of_a_run_may_be_logged_or_given() -> None:
    """Without the wind of the runs that lack it these factors were up to 2.5 times the truth."""
    rows, names = turning_log(wind=(8.0, 15.0)).frame, ["V_w", "beta_w"]
    given = rows.groupby("run")[names].first().iloc[::2]
    still = rows.assign(**{name: rows[name].mask(rows["run"].isin(given.index), 0.0) for name in names})
    _, start = first_guess(
        SHIP, Dataset(still, {}), runs={run: {"environment": dict(row)} for run, row in given.iterrows()}
    )
    np.testing.assert_allclose(start, 1, rtol=5e-3)


def test_what_forces_do_not_show_stays_at_the_base_and_priors_hold() -> None:
    unseen = "thruster.port.k_over2"
    _, free = first_guess(SHIP, turning_log(), parameters=[MAIN[4], unseen])
    assert free[1] == pytest.approx(1)
    base = SHIP.with_values({MAIN[4]: -2e6})
    _, tight = first_guess(base, turning_log(), parameters=[MAIN[4]], prior={MAIN[4]: 1e-9})
    np.testing.assert_allclose(tight, 1, atol=1e-6)


def test_noise_is_averaged_and_a_start_can_be_simulated() -> None:
    """0.1 m/s at 5 Hz would be an acceleration noise of 0.7 m/s^2; Y_v|r| and Y_r|v| do the same."""
    log, pair = turning_log(0.1), ["hull.derivatives.Y_v|r|", "hull.derivatives.Y_r|v|"]
    assert np.abs(first_guess(SHIP, log, parameters=pair)[1] - 1).max() < 0.1
    _, start = first_guess(SHIP.with_values({MAIN[4]: 0.7 * SHIP.parameters[MAIN[4]]}), log, parameters=[MAIN[4]])
    assert start[0] == pytest.approx(1 / 0.7, rel=0.05)


def test_runs_too_short_for_a_bump_are_reported() -> None:
    short = Dataset(turning_log().frame.groupby("run").head(8).reset_index(drop=True), {})
    problem = build_problem(SHIP, short, short.runs, Identify(parameters=MAIN, step=0.2, horizon=1.0))
    with pytest.raises(DataError, match="no stretch is longer"):
        by_inverse_dynamics(problem, short)
