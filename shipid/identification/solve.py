"""`identify`: from recorded runs to the factors of a vessel's parameters that predict them best."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Dataset
from shipid.errors import DocumentError, choices
from shipid.identification.problem import BLOCK, Identify, overrides
from shipid.identification.residuals import Fit, Prediction, build, predict
from shipid.identification.shooting import Point, Progress, Result, loss, poses, solve
from shipid.identification.statistics import inverted
from shipid.vessel.load import Vessel

Array = NDArray[np.float64]
NEAR = 1e-6  # of a factor: so close to a bound it stands at it
WORDS = {
    "Solve_Succeeded": "ok",
    "Solved_To_Acceptable_Level": "ok",
    "Infeasible_Problem_Detected": "infeasible",
    "Invalid_Number_Detected": "diverged",
    "User_Requested_Stop": "stopped",
}


@dataclass(frozen=True)
class Solution:
    """What was found.

    Parameters
    ----------
    paths, factors : name and estimate (n,) of each factor; a tied group goes by its first path.
    values : path -> value of every parameter that a factor acts on, ties written out.
    nuisances : run -> name -> value [SI] of its own unknowns.
    residuals : (m,) predicted less measured over the declared standard deviation, nuisances projected out; by run, then
        time. Their sum of squares is the objective without the priors of the factors, those of the nuisances included.
        With huber each is scaled by the square root of its weight, and their squares sum to less than that.
    jacobian : (m, n) d residual / d factor with the nuisances projected out: J^T J is the Fisher information.
    prior_widths : (n,) standard deviations of the factors' priors; inf: none. centre : (n,) where they stand.
    clusters, signals, times : (m,) index of the run, column and time [s] of each residual.
    spent : (m,) share of each residual that the nuisances have taken.
    objective_start, objective : sum of squares at the start, from the measured states, and at the end.
    status, sentence : `ok`, `refused` (converged to values that the vessel's own checks refuse), `not converged`,
        `infeasible`, `diverged` or `stopped`, and what that means here.
    at_bound : (n,) whether the estimate stands at a bound. held : (n,) factors that are not free: dropped, or given
        bounds that are equal. dropped : paths of the former.
    """

    vessel: Vessel
    runs: tuple[str, ...]
    settings: Identify
    paths: tuple[str, ...]
    factors: Array
    values: Mapping[str, float]
    nuisances: Mapping[str, Mapping[str, float]]
    residuals: Array
    jacobian: Array
    prior_widths: Array
    centre: Array
    clusters: NDArray[np.intp]
    signals: tuple[str, ...]
    times: Array
    spent: Array
    objective_start: float
    objective: float
    iterations: int
    seconds: float
    status: str
    sentence: str
    at_bound: NDArray[np.bool_]
    held: NDArray[np.bool_]
    dropped: tuple[str, ...] = ()
    point: Point | None = field(default=None, repr=False)

    @property
    def identified(self) -> Vessel:
        """The vessel with the values found; DocumentError where it refuses them, as the sentence says then."""
        return self.vessel.with_values(self.values)


def identify(
    vessel: Vessel,
    dataset: Dataset,
    runs: Sequence[str],
    settings: Identify,
    start: Mapping[str, float] | Solution | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Find the factors that predict the runs best, over the horizon and with the weights of the settings.

    Parameters
    ----------
    start : factors to begin with, or an earlier solution; default: as the settings say.
    progress : called with the iteration and the objective after each; what is true stops there.

    Raises
    ------
    DocumentError, DataError : the settings, the vessel and the data do not fit together.
    """
    begun = time.perf_counter()
    fit = build(vessel, dataset, runs, settings)
    factors = _start(fit, dataset, start)
    solution = _solved(fit, factors, start.point if isinstance(start, Solution) else None, progress, begun)
    targets = solution.centre if settings.drop_to == "base" else np.zeros(len(solution.centre))
    while settings.drop is not None and solution.status in ("ok", "refused"):
        weakest = _weakest(solution, settings.drop, targets)
        if weakest is None:
            break
        fit = _without(fit, weakest, targets[weakest])
        dropped = (*solution.dropped, fit.unknown.paths[weakest])
        solution = _solved(fit, solution.factors, solution.point, progress, begun, solution.objective_start)
        solution = replace(solution, dropped=dropped)
    return solution


def _start(fit: Fit, dataset: Dataset, start: Mapping[str, float] | Solution | None) -> Array:
    """Factors to begin with, within the bounds."""
    unknown, settings = fit.unknown, fit.settings
    if isinstance(start, Solution):
        start = dict(zip(start.paths, start.factors.tolist(), strict=True))
    factors = unknown.centre.copy()
    if start is not None:
        for path, factor in start.items():
            if path not in unknown.paths:
                message = f"{path!r} is not free in the fit: {choices(path, unknown.paths)}"
                raise DocumentError(message, file=fit.vessel.file, path=f"{BLOCK}.start")
            factors[unknown.paths.index(path)] = factor
    elif settings.start == "inverse":
        from shipid.identification.inverse import inverse_dynamics  # it needs all of this package

        own = overrides(settings, fit.runs, fit.vessel, fit.layout.model.environment, dataset.runs)
        weather = {
            run: {key.split(".", 1)[1]: value for key, value in values.items() if key.startswith("environment.")}
            for run, values in own.items()
        }
        found = inverse_dynamics(
            fit.vessel, dataset, fit.runs, unknown.groups, scale=unknown.scale, prior=unknown.prior, environment=weather
        )
        return _better(fit, found.factors, factors)
    return np.clip(factors, unknown.low, unknown.high)


def _better(fit: Fit, first: Array, second: Array) -> Array:
    """Whichever predicts better: what explains accelerations step by step may diverge in a long prediction."""
    unknown = fit.unknown
    starts = [np.clip(factors, unknown.low, unknown.high) for factors in (first, second)]
    begun = [next(iter(poses(fit, factors)))[1] for factors in starts]
    objectives = [_objective(fit, predict(fit, x, b.nuisances)) for x, b in zip(starts, begun, strict=True)]
    return starts[int(np.argmin(objectives))]


def _solved(
    fit: Fit,
    factors: Array,
    earlier: Point | None,
    progress: Progress | None,
    begun: float,
    objective_start: float | None = None,
) -> Solution:
    """One solve and what it says."""
    before = 0
    for problem, begin in poses(fit, factors):
        if objective_start is None:
            objective_start = _objective(fit, predict(fit, factors, begin.nuisances))
        result = solve(problem, _warm(begin, factors, earlier), progress, before)
        end = predict(fit, result.point.factors, result.point.nuisances, result.point.nodes[problem.starts])
        word, before = WORDS.get(result.word, "not converged"), result.iterations
        if word == "ok" and not np.isfinite(end.r).all():
            word = "diverged"
        if word in ("ok", "stopped"):
            break
    assert objective_start is not None
    where = None
    if word in ("not converged", "diverged"):
        lost = problem.lost(begin)
        word, where = ("diverged", fit.runs[problem.intervals.run[np.argmax(lost)]]) if lost.any() else (word, None)
    return _solution(fit, result, end, objective_start, word, where, time.perf_counter() - begun)


def _warm(begin: Point, factors: Array, earlier: Point | None) -> Point:
    """Where an earlier solution ended, if it was of the same shape."""
    if earlier is None or earlier.nodes.shape != begin.nodes.shape or earlier.nuisances.shape != begin.nuisances.shape:
        return begin
    return Point(factors, earlier.nuisances, earlier.nodes)


def _objective(fit: Fit, at: Prediction) -> float:
    """Sum of squares, priors included; inf where a prediction diverges."""
    threshold = fit.settings.threshold if fit.settings.loss == "huber" else np.inf
    prior = (at.factors - fit.unknown.centre) / fit.unknown.prior
    with np.errstate(all="ignore"):
        squares = loss(at.r, threshold)[0].sum() + (prior**2).sum()
        total = float(squares + (at.nuisances**2).sum() + (at.away**2).sum())
    return total if np.isfinite(total) else float("inf")


def _solution(
    fit: Fit, result: Result, end: Prediction, objective_start: float, word: str, lost: str | None, seconds: float
) -> Solution:
    unknown, settings = fit.unknown, fit.settings
    factors = result.point.factors
    threshold = settings.threshold if settings.loss == "huber" else np.inf
    at_bound = (unknown.low < unknown.high) & ((factors - unknown.low < NEAR) | (unknown.high - factors < NEAR))
    residuals, jacobian, spent = end.marginal(threshold)
    values, sentence = unknown.values(factors), _sentence(fit, result, word, lost, at_bound)
    reason = _refusal(fit.vessel, values)
    if reason is not None:
        word, sentence = ("refused" if word == "ok" else word), f"{sentence}; {reason}"
    return Solution(
        vessel=fit.vessel,
        runs=fit.runs,
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
        point=result.point,
    )


def _refusal(vessel: Vessel, values: Mapping[str, float]) -> str | None:
    """Why the vessel refuses the values found; None if it takes them."""
    try:
        vessel.with_values(values)
    except DocumentError as error:
        return f"the vessel refuses the values found: {error.path}: {error.message}; give bounds or priors, or fix some"
    return None


def _sentence(fit: Fit, result: Result, word: str, lost: str | None, at_bound: NDArray[np.bool_]) -> str:
    """What happened, and what to do about it."""
    if word == "ok":
        stand = [path for path, there in zip(fit.unknown.paths, at_bound, strict=True) if there]
        tail = f"; at a bound, so without an interval: {', '.join(stand)}" if stand else ""
        return f"converged in {result.iterations} iterations{tail}"
    if word == "diverged":
        place = f"run {lost!r} diverges" if lost is not None else "a prediction diverges"
        return f"{place} within {fit.settings.step:g} s steps: take a smaller step, rk4, or a start nearer the truth"
    if word == "infeasible":
        return "no factors within the bounds make the predictions hang together: widen the bounds, or start elsewhere"
    if word == "stopped":
        return f"stopped after {result.iterations} iterations: what stands here is not the optimum"
    return (
        f"not converged after {result.iterations} iterations ({result.word}): give priors or bounds, fix or tie "
        "parameters that the data cannot tell apart, or shorten the horizon"
    )


def _weakest(solution: Solution, threshold: float, targets: Array) -> int | None:
    """The free factor nearest to its target in standard errors (infinite ones if unseen), if within the threshold."""
    information = solution.jacobian.T @ solution.jacobian + np.diag(1 / solution.prior_widths**2)
    free = ~solution.held
    if not free.any():
        return None
    level = (solution.residuals**2).sum() / max(1, len(solution.residuals) - free.sum())
    inverse, unseen = inverted(information[np.ix_(free, free)])
    errors = np.where(unseen, np.inf, np.sqrt(np.diag(inverse) * level))
    away = np.abs(solution.factors - targets)[free] / np.maximum(errors, 1e-300)
    weakest = int(np.argmin(away))
    return int(np.flatnonzero(free)[weakest]) if away[weakest] < threshold else None


def _without(fit: Fit, number: int, target: float) -> Fit:
    """The same fit with one factor held."""
    low, high = fit.unknown.low.copy(), fit.unknown.high.copy()
    low[number] = high[number] = target
    return replace(fit, unknown=replace(fit.unknown, low=low, high=high))
