"""Initial factors of a fit: by inverse dynamics, and by continuation from short horizons, which are nearly linear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipid.data.dataset import Array, Dataset
from shipid.errors import DataError
from shipid.identification.fit import BEGIN, Progress, Result, initial_point, search_factors
from shipid.identification.inverse import inverse_dynamics
from shipid.identification.residuals import Problem, build_problem
from shipid.identification.segments import ShootingSegment
from shipid.identification.settings import resolve_overrides

HORIZONS = (2.0, 5.0, 15.0, 60.0)  # s
ENOUGH = 20000  # steps of all predictions of a short horizon: more take time and change a start little
ROUGH, MOST = 1e-3, 25  # tolerance and evaluations of a short horizon


def grow_horizon(
    problem: Problem, dataset: Dataset, factors: Array, progress: Progress | None = None, before: int = 0
) -> tuple[Array, int, bool]:
    """Initial factors by fits over growing horizons, each shorter than the horizon of the fit.

    Returns factors (n,), number of iterations including those `before`, and whether `progress` asked to stop.
    """
    longest = max(segment.num_steps for segment in problem.segments) * problem.settings.step
    iterations = before
    for horizon in HORIZONS:
        steps = max(2, round(horizon / problem.settings.step))
        if steps * problem.settings.step >= longest:
            break
        result = _fit_at_horizon(problem, dataset, factors, steps * problem.settings.step, progress, iterations)
        if result is None or not np.isfinite(result.objective):
            continue
        factors, iterations = result.factors, result.iterations
        if result.status == "stopped":
            return factors, iterations, True
    return factors, iterations, False


def _fit_at_horizon(
    problem: Problem, dataset: Dataset, factors: Array, horizon: float, progress: Progress | None, before: int
) -> Result | None:
    """Result of the fit with a shorter horizon [s]; None if the runs cannot be cut into such segments."""
    widths = {name: width for name, width in problem.settings.widths.items() if name != "initial_state"}
    settings = problem.settings.model_copy(update={"horizon": horizon, "nuisance": widths})
    try:
        short = build_problem(problem.vessel, dataset, problem.runs, settings)
    except DataError:
        return None
    short = replace(short, unknown=problem.unknown, segments=_spread_segments(short))
    return search_factors(short, factors, initial_point(short), progress, before=before, tolerance=ROUGH, most=MOST)


def _spread_segments(problem: Problem) -> tuple[ShootingSegment, ...]:
    """A subset of the segments at equal distances, at least one of every run, with about `ENOUGH` steps in all."""
    steps = sum(segment.num_steps for segment in problem.segments)
    every = max(1, round(steps / ENOUGH))
    runs = [[one for one in problem.segments if one.run == run] for run in range(len(problem.runs))]
    return tuple(one for of_run in runs for one in of_run[::every])


def by_inverse_dynamics(problem: Problem, dataset: Dataset) -> Array:
    """Initial factors (n,) by inverse dynamics, clipped to the bounds."""
    unknown, groups, vessel = problem.unknown, problem.layout.groups, problem.vessel
    known = problem.layout.model.environment
    overrides = resolve_overrides(problem.settings, problem.runs, vessel, known, dataset.runs)
    own = slice(len(groups))
    factors, _ = inverse_dynamics(
        vessel, dataset, problem.runs, groups, unknown.scale[own], unknown.prior[own], overrides
    )
    factors = np.append(factors, [BEGIN[path] for path in unknown.paths[len(groups) :]])
    return np.asarray(np.clip(factors, unknown.low, unknown.high))
