"""`identify`: estimates factors on a vessel's parameters from recorded runs."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.arguments import as_float_array, as_names, check_class, check_function_or_none, check_mapping
from shipid.data.dataset import Array, Dataset
from shipid.errors import DataError, DocumentError, suggest_name
from shipid.identification.diagnosis import diagnose, fit_forces
from shipid.identification.fit import (
    BEGIN,
    Point,
    Progress,
    Result,
    Solution,
    evaluate_factors,
    initial_point,
    search_factors,
)
from shipid.identification.residuals import CURRENT, Problem, build_problem, typical_errors
from shipid.identification.segments import COARSE, ShootingSegment, row_interval
from shipid.identification.settings import (
    BLOCK,
    ENVIRONMENT,
    NUISANCES,
    Identify,
    resolve_overrides,
    run_overrides,
    weighted_columns,
)
from shipid.identification.statistics import Basis, residual_whiteness, restrict_fit
from shipid.units import percent_text, significant_digits
from shipid.vessel.load import Vessel

CurrentKind = Literal["one", "by run"]
CURRENT_KINDS: Mapping[str, CurrentKind] = {"current": "one", "current by run": "by run"}
"""Cause of a diagnosis -> setting `current`."""
LEAST_RUNS = 2  # of one run a current is as well a wrong vessel
HALVINGS = 3  # of the default step, at most, as `study new` does
DISCOUNTS, LEAST = 2, 1e-3  # fits with discounted residuals; least factor on a deviation
UNEVEN = 0.01  # of the time between rows: a difference above it counts
FAR = 0.05  # of the time in which a ship goes her length: between rows so far apart, lines miss how she turns
LOOSE = 1.0  # base values: widest prior of a start by inverse dynamics
HORIZONS = (2.0, 5.0, 15.0, 60.0)  # s
ENOUGH = 20000  # steps of all predictions of a short horizon: more take time and change a start little
ROUGH, MOST = 1e-3, 25  # tolerance and evaluations of a short horizon
NEAR = 1e-6  # of a factor: so close to a bound it is at the bound
ORDER = {"growing": ("growing", "inverse"), "inverse": ("inverse", "growing"), "base": ("straight", "growing")}
"""Setting `start` -> kinds of initial factors, tried in this order until the search converges."""


def identify(
    vessel: Vessel,
    dataset: Dataset,
    runs: Iterable[str] | str,
    settings: Identify,
    start: Mapping[str, float] | Solution | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Estimate the factors that minimise the weighted prediction errors of the runs.

    With `discount` the fit is repeated with the deviations of the signals times their level and the square root of the
    correlation time of their residuals, in samples; the settings of the solution have these. Where predictions diverge
    at the default step, as those of a small craft do, it is halved; the settings of the solution have that, too.

    runs : names, or one. settings : unknowns, weights, horizon and solver.
    start : path -> initial factor, or an earlier solution; default: the setting `start`.
    progress : called with the iteration number and the objective after each iteration; a true return value stops.

    Raises DocumentError or DataError where the settings, the vessel and the data do not fit together.
    """
    check_class("dataset", dataset, Dataset, "as of `read_dataset`", DataError)
    check_class("settings", settings, Identify, "such as Identify(parameters=[...])", DocumentError)
    if start is not None and not isinstance(start, Solution):
        check_mapping("start", start, "a path to a factor, or a Solution", DocumentError)
    check_function_or_none("progress", progress)
    runs = as_names("runs", () if runs is None else runs, DataError)
    plain = settings.model_copy(update={"discount": False})
    solution = _fit_choosing_current(vessel, dataset, runs, plain, start, progress)
    for _ in range(0 if "step" in settings.model_fields_set else HALVINGS):
        if solution.status == "diverged":
            plain = plain.model_copy(update={"step": plain.step / 2})
            solution = _fit_choosing_current(vessel, dataset, runs, plain, start, progress)
            words = f"predictions diverge in steps of {settings.step:g} s, the default: steps are {plain.step:g} s"
            solution = replace(solution, warnings=(words, *solution.warnings))
    if not settings.discount:
        return solution
    for _ in range(DISCOUNTS):
        if solution.status != "ok":
            break
        discounted, effective = _discount_residuals(solution)
        again = _fit_dropping_factors(vessel, dataset, runs, discounted, solution, progress)
        seconds = solution.seconds + again.seconds
        solution = replace(again, effective=effective, warnings=solution.warnings, seconds=seconds)
    problem = build_problem(vessel, dataset, runs, solution.settings)  # both objectives with the same deviations
    return replace(solution, objective_start=evaluate_factors(problem, *_initial_unknowns(problem, start)).objective)


def _discount_residuals(solution: Solution) -> tuple[Identify, dict[str, float]]:
    """Settings with the deviations that correlated residuals deserve, and signal -> residuals that they are worth."""
    settings, seen = solution.settings, residual_whiteness(solution, Basis.of_none(solution))
    factors = {
        name: max(
            float(np.mean([seen[column].level * seen[column].memory ** 0.5 for column in weighted_columns(name)])),
            LEAST,
        )
        for name in settings.weights
    }
    widths = settings.widths
    if "initial_state" in widths:  # a start is one row, however long residuals remember
        widths["initial_state"] /= float(np.exp(np.mean(np.log(list(factors.values())))))
    update = {
        "weights": {name: width * factors[name] for name, width in settings.weights.items()},
        "nuisance": widths,
    }
    return settings.model_copy(update=update), {name: one.effective for name, one in seen.items()}


def _fit_choosing_current(
    vessel: Vessel,
    dataset: Dataset,
    runs: Sequence[str],
    settings: Identify,
    start: Mapping[str, float] | Solution | None,
    progress: Progress | None,
) -> Solution:
    """The fit with the current of the settings, or with that which a diagnosis of the fit without current names.

    Currents by run are judged about a fit with one of all runs: far from it the numbers make up for a part of it. Where
    the current is asked for as a nuisance they are the rule, unless the diagnosis names one of all runs.
    """
    wanted = "current" in settings.widths
    if settings.current != "chosen" or (wanted and len(runs) < LEAST_RUNS):
        return _fit_dropping_factors(vessel, dataset, runs, settings, start, progress)
    without = settings.model_copy(update={"current": "none"})
    solution = _fit_dropping_factors(vessel, dataset, runs, without, start, progress)
    if solution.status == "stopped":
        return solution
    kind = _current_kind(solution, dataset)
    if kind is None and not wanted:
        return solution
    own = dict(zip(solution.paths, solution.factors.tolist(), strict=True))
    by_run = wanted and kind != "one"
    begin = start if by_run else own  # numbers that the currents of runs have bent are no place to begin
    fits = [solution]
    for one in ("one", "by run")[by_run:]:
        if one == "one" or by_run or _current_kind(fits[-1], dataset) == one:
            chosen = settings.model_copy(update={"current": one}).with_sizes(typical_errors(vessel, dataset, runs))
            fits.append(_fit_dropping_factors(vessel, dataset, runs, chosen, begin, progress))
    again = fits[-1]
    if again.status not in ("ok", "stopped") and not wanted:
        failed = f"residuals look like those of a current, but the fit with it fails: {again.sentence}"
        return replace(solution, warnings=(*solution.warnings, failed))
    said = () if wanted else (_current_sentence(solution, again),)
    return replace(
        again,
        warnings=(*again.warnings, *said),
        objective_start=solution.objective_start,
        iterations=sum(one.iterations for one in fits),
        seconds=sum(one.seconds for one in fits),
    )


def _current_kind(solution: Solution, dataset: Dataset) -> CurrentKind | None:
    """The kind of current that the runs of a fit show beside what it has, if any; no run may have a known one."""
    given = run_overrides(solution.settings, solution.runs)
    known = any(key.endswith(f".{ENVIRONMENT}.{name}") for key in given for name in CURRENT)
    if solution.status != "ok" or len(solution.runs) < LEAST_RUNS or known:
        return None
    with suppress(DataError, DocumentError):  # runs too short for a diagnosis; estimates that the vessel refuses
        fitted, (north, east) = solution.vessel.with_values(solution.values), solution.common_current
        there = {"V_c": float(np.hypot(north, east)), "beta_c": float(np.arctan2(east, north))}
        return CURRENT_KINDS.get(diagnose(fitted, dataset, solution.runs, CURRENT_KINDS, there).cause)
    return None


def _current_sentence(before: Solution, after: Solution) -> str:
    """What residuals without a current show, and how the fit after, with currents, may be chosen otherwise."""
    which = {"one": "one current of all runs", "by run": "another current in each run"}[after.settings.current]
    currents = [[of_run[name] for name in NUISANCES["current"]] for of_run in after.nuisances.values()]
    size = np.sqrt(np.square(currents).sum(axis=1).mean())
    explained = 1 - np.square(after.residuals).sum() / max(np.square(before.residuals).sum(), 1e-300)
    return (
        f"residuals look like those of {which}, {significant_digits(float(size), 2)} m/s, which takes "
        f"{percent_text(float(explained))} of their squares away"
        f"{', or of wind that the log lacks' if 'wind' in before.vessel.document else ''}: "
        "it is estimated beside the numbers; compare with --set current=none"
    )


def _fit_dropping_factors(
    vessel: Vessel,
    dataset: Dataset,
    runs: Sequence[str],
    settings: Identify,
    start: Mapping[str, float] | Solution | None,
    progress: Progress | None,
) -> Solution:
    begun = time.perf_counter()
    problem = build_problem(vessel, dataset, runs, settings)
    result, objective_start = _search_from_starts(problem, dataset, start, progress)
    solution = _build_solution(problem, result, objective_start, time.perf_counter() - begun)
    targets = solution.centre if settings.drop_to == "base" else np.zeros(len(solution.centre))
    while settings.drop is not None and solution.status in ("ok", "refused"):
        weakest = _weakest_factor(solution, settings.drop, targets)
        if weakest is None:
            break
        problem = _hold_factor(problem, weakest, targets[weakest])
        dropped = (*solution.dropped, problem.unknown.paths[weakest])
        factors = np.where(np.arange(len(targets)) == weakest, targets, solution.factors)
        result = search_factors(problem, factors, result.point, progress, before=result.iterations)
        solution = replace(
            _build_solution(problem, result, objective_start, time.perf_counter() - begun), dropped=dropped
        )
    warning = _step_warning(vessel, dataset, runs, settings)
    return replace(solution, warnings=(warning,) if warning else ())


def _search_from_starts(
    problem: Problem, dataset: Dataset, start: Mapping[str, float] | Solution | None, progress: Progress | None
) -> tuple[Result, float]:
    """Result of the first search that converges (else of the best), and the objective at the initial factors.

    One that converges above that objective is followed by one from these factors.
    """
    factors, point = _initial_unknowns(problem, start)
    objective_start = evaluate_factors(problem, factors, point).objective
    ways = ORDER["base"] if start is not None else ORDER[problem.settings.start]
    result, before = None, 0
    for way in ways:
        begin = factors
        if way == "growing":
            begin, before, stopped = grow_horizon(problem, dataset, factors, progress, before)
            if stopped:
                value = evaluate_factors(problem, begin, point)
                return Result(begin, value.at, value.point, value.objective, before, "stopped"), objective_start
        elif way == "inverse":
            try:
                begin = by_inverse_dynamics(problem, dataset)
            except DataError:  # runs too short for a regression
                continue
        attempt = search_factors(problem, begin, point, progress, before=before)
        before = attempt.iterations
        if result is None or attempt.status in ("ok", "stopped") or attempt.objective < result.objective:
            result = attempt
        if attempt.status in ("ok", "stopped"):
            break
    assert result is not None
    if result.status == "ok" and result.objective > objective_start:  # led away, to an optimum worse than the base
        attempt = search_factors(problem, factors, point, progress, before=before)
        result = attempt if attempt.objective < result.objective else result
    return result, objective_start


def _step_warning(vessel: Vessel, dataset: Dataset, runs: Sequence[str], settings: Identify) -> str:
    """A warning if the step of the fit is longer than the interval of the log or does not divide it, else no text."""
    between, length = row_interval(dataset, runs), vessel.length
    if settings.step > COARSE * between:
        return (
            f"rows of the log are {between:.3g} s apart and commands are held over steps of {settings.step:g} s: "
            f"faster changes of the commands are lost; compare with step {between:.3g}"
        )
    for run in runs:
        rows = dataset.select([run]).frame
        times = np.diff(rows["t"].to_numpy())
        between = float(np.median(times))
        steps, even = between / settings.step, np.abs(times - between) < UNEVEN * between
        far = length is not None and between * float(rows["u"].abs().mean()) >= FAR * length
        if far and even.mean() > 0.5 and abs(steps - round(steps)) > UNEVEN * steps:
            return (
                f"rows of run {run} are {between:.4g} s apart, which steps of {settings.step:g} s do not divide: "
                "measured values are interpolated to the steps, and the estimates may be off by more than their "
                f"intervals; compare with step {between / max(round(steps), 1):.4g}"
            )
    return ""


def _initial_unknowns(problem: Problem, start: Mapping[str, float] | Solution | None) -> tuple[Array, Point]:
    """Initial factors (n,) within the bounds, those in `start` or of the base, and where the unknowns of runs begin."""
    unknown, point = problem.unknown, initial_point(problem)
    if isinstance(start, Solution):
        gone = NUISANCES["current"].keys() - set(unknown.paths)  # the other fit may have chosen a current
        one, begin = start.point, zip(start.paths, start.factors.tolist(), strict=True)
        start = {path: factor for path, factor in begin if path not in gone}
        alike = one.nuisances.shape == point.nuisances.shape and one.away.shape == point.away.shape
        point = one if alike else point
    factors = unknown.centre + np.array([BEGIN.get(path, 0.0) for path in unknown.paths])
    for path, factor in (start or {}).items():
        if path not in unknown.paths:
            message = f"{path!r} is not free in the fit: {suggest_name(path, unknown.paths)}"
            raise DocumentError(message, path=f"{BLOCK}.start")
        factors[unknown.paths.index(path)] = float(as_float_array(f"start of {path}", factor, DocumentError))
    return np.asarray(np.clip(factors, unknown.low, unknown.high)), point


def _build_solution(problem: Problem, result: Result, objective_start: float, seconds: float) -> Solution:
    unknown, settings, end, word = problem.unknown, problem.settings, result.at, result.status
    factors = result.factors
    at_bound = (unknown.low < unknown.high) & ((factors - unknown.low < NEAR) | (unknown.high - factors < NEAR))
    residuals, jacobian, spent = end.marginal(settings.linear_from)
    values, sentence = unknown.values(factors), _search_sentence(problem, result, at_bound)
    reason = _estimate_refusal(problem.vessel, values)
    if reason is not None:
        word, sentence = ("refused" if word == "ok" else word), f"{sentence}; {reason}"
    return Solution(
        vessel=problem.vessel,
        runs=problem.runs,
        settings=settings,
        paths=unknown.paths,
        factors=factors,
        values=values,
        nuisances=end.named(),
        residuals=residuals,
        jacobian=jacobian,
        prior_widths=unknown.prior,
        centre=unknown.centre,
        clusters=end.run,
        signals=tuple(end.signals),
        times=end.time,
        spent=spent,
        objective_start=objective_start,
        objective=result.objective,
        iterations=result.iterations,
        seconds=seconds,
        status=word,
        sentence=sentence,
        at_bound=at_bound,
        held=unknown.low == unknown.high,
        dropped=(),
        sizes=tuple(
            (scales[0], problem.vessel.units.get(path, "m/s"))
            for path, scales in zip(unknown.paths, unknown.scale, strict=True)
        ),
        point=result.point,
    )


def _estimate_refusal(vessel: Vessel, values: Mapping[str, float]) -> str | None:
    try:
        vessel.with_values(values)
    except DocumentError as error:
        return f"the vessel refuses the estimates: {error.path}: {error.message}; give bounds or priors, or fix some"
    return None


def _search_sentence(problem: Problem, result: Result, at_bound: NDArray[np.bool_]) -> str:
    if result.status == "ok":
        limited = [path for path, there in zip(problem.unknown.paths, at_bound, strict=True) if there]
        tail = f"; at a bound, so without an interval: {', '.join(limited)}" if limited else ""
        return f"converged in {result.iterations} iterations{tail}"
    if result.status == "diverged":
        bad = result.at.run[~np.isfinite(result.at.r)]
        place = f"run {problem.runs[bad[0]]!r} diverges" if len(bad) else "a prediction diverges"
        finer = ["a smaller step", *(["rk4"] if problem.settings.method != "rk4" else [])]
        remedy = f"take {', '.join(finer)}, or a start nearer the truth"
        return f"{place} within {problem.settings.step:g} s steps: {remedy}"
    if result.status == "stopped":
        return f"stopped after {result.iterations} iterations: this is not the optimum"
    return (
        f"not converged after {result.iterations} iterations: give priors or bounds, fix or tie parameters that the "
        "data do not distinguish, or shorten the horizon"
    )


def _weakest_factor(solution: Solution, threshold: float, targets: Array) -> int | None:
    """Index of the free factor with the smallest |factor - target| / standard error; None if above the threshold."""
    free = np.flatnonzero(~solution.held)
    if not len(free):
        return None
    inner = restrict_fit(solution, free)
    basis = Basis.of(inner)
    level = (inner.residuals**2).sum() / max(1, len(inner.residuals) - len(free))
    errors = np.where(basis.unseen, np.inf, np.sqrt(np.diag(basis.inverse) * level))
    away = np.abs(solution.factors - targets)[free] / np.maximum(errors, 1e-300)
    weakest = int(np.argmin(away))
    return int(free[weakest]) if away[weakest] < threshold else None


def _hold_factor(problem: Problem, number: int, target: float) -> Problem:
    low, high = problem.unknown.low.copy(), problem.unknown.high.copy()
    low[number] = high[number] = target
    return replace(problem, unknown=replace(problem.unknown, low=low, high=high))


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
    """Initial factors (n,) with which forces in the weather of each run explain its motion, within the bounds."""
    unknown, vessel, frame = problem.unknown, problem.vessel, dataset.frame
    channels = problem.layout.model.environment
    given = pd.DataFrame(resolve_overrides(problem.settings, problem.runs, vessel, channels, dataset.runs)).T
    weather = {
        name: frame["run"].map(given[path]).fillna(frame.get(name, 0.0))
        for name in channels
        if (path := f"{ENVIRONMENT}.{name}") in given
    }
    log, begin = replace(dataset, frame=frame.assign(**weather)), _initial_unknowns(problem, None)[0]
    factors = fit_forces(vessel, log, problem.runs, unknown.values, begin, np.minimum(unknown.prior, LOOSE))
    return np.asarray(np.clip(factors, unknown.low, unknown.high))
