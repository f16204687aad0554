"""Laws of the start: growing horizons lead a lost start to where whole runs can be predicted."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.identification.fit import evaluate_factors, initial_point
from shipid.identification.residuals import build_problem
from shipid.identification.settings import Identify
from shipid.identification.start import by_inverse_dynamics, grow_horizon
from shipid.vessel.load import load_vessel
from tests.identification.trials import trials

SHIP = load_vessel("gunnerus-28.9")
DATA = trials(SHIP, runs=4)
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
