"""Nonlinear least squares for the factors, by SciPy's trust region (`least_squares`, trf).

The unknowns of each run, xi (nuisances and initial states, with a prior of width 1), are eliminated at every
evaluation by Gauss-Newton steps, and the Jacobian is projected onto the complement of their derivatives:

minimise over f    sum over runs of min over xi of (|r(f, xi)|^2 + |xi|^2)    + |(f - centre) / prior|^2

Of each run SciPy gets the (n + 1) rows of the triangular factor, which have the same squares and gradient.

Sources: Branch, Coleman, Li, SIAM Journal on Scientific Computing 21 (1999) 1 (the trust region with bounds); Golub,
Pereyra, Inverse Problems 19 (2003) R1 (variable projection), with the Jacobian of Kaufman, BIT 15 (1975) 49.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from shipid.identification.residuals import Problem, ResidualPrediction, predict_residuals
from shipid.identification.settings import NUISANCES, Identify
from shipid.identification.statistics import LinearFit
from shipid.interrupts import hold_interrupts
from shipid.vessel.load import Vessel

Array = NDArray[np.float64]
Progress = Callable[[int, float], object]
TOLERANCE = 1e-10  # relative change of objective and factors at which the search ends
MOST_EVALUATIONS = 200
MOST_RESTARTS, STRIDES = 40, 8  # searches after the first; halvings of the Gauss-Newton step between them
LEFT, RANK = 1e-6, 1e-9  # relative fall of the objective that is worth another search; relative rank of a Jacobian
SAMPLES, AROUND = 6, 1e-2  # points around a kink; rise of the objective, relative, at their mean distance
CROSSINGS, ROUNDS, MISSES = 4, 40, 4  # searches across kinks, steps of one, and those in turn that fail
FALL = 1e-3  # relative fall of the objective that is worth a search across a kink
INNER, HALVINGS, CLOSE = 12, 6, 1e-10  # Gauss-Newton steps of one run, halvings of one, and the change that ends them
BEGIN = {"current_north": 0.01, "current_east": 0.01, "latency": 0.3}  # in prior widths: off a vanishing slope
FAR, DIRECTIONS = 0.5, 4  # prior widths, and on the circle: currents that a run is also begun from
NEAR = 1e-3  # of a factor: nearer to a bound than this, with the objective falling towards it, it is set to the bound


@dataclass(frozen=True)
class Point:
    """Unknowns of the runs in prior widths: nuisances (R, q), and initial states less the measured ones (S, nn)."""

    nuisances: Array
    away: Array


@dataclass(frozen=True)
class Result:
    """Result of one search.

    factors : (n,). at, point : prediction and unknowns of the runs with these factors. objective : sum of squares with
    priors; inf if it diverges. iterations : of the trust region. status : `ok`, `not converged`, `diverged`, `stopped`.
    """

    factors: Array
    at: ResidualPrediction
    point: Point
    objective: float
    iterations: int
    status: str


@dataclass(frozen=True, kw_only=True)
class Solution(LinearFit):
    """Result of a fit: its linearisation at the estimates, and the status of the solver.

    values : path -> value [SI] of every parameter that a factor acts on, tied ones included.
    nuisances : run -> name -> estimate [SI] of the unknowns of that run. times : (m,) [s] of each residual.
    objective_start, objective : sum of squares at the start, from the measured states, and at the end.
    status : `ok`, `refused` (values that the vessel's checks refuse), `not converged`, `diverged` or `stopped`.
    sentence : the status with its reason and a remedy. warnings : what the fit cannot see, one sentence each.
    effective : signal -> independent residuals that its residuals were counted as, where `discount` is on.
    """

    vessel: Vessel
    settings: Identify
    values: Mapping[str, float]
    nuisances: Mapping[str, Mapping[str, float]]
    times: Array
    objective_start: float
    objective: float
    iterations: int
    seconds: float
    status: str
    sentence: str
    point: Point = field(repr=False)
    effective: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def common_current(self) -> tuple[float, float]:
        """Current of all runs, to north and to east [m/s]; 0 where none was estimated, or another one by run."""
        if self.settings.current != "one":
            return 0.0, 0.0
        north, east = (self.nuisances[self.runs[0]][name] for name in NUISANCES["current"])
        return north, east

    @property
    def identified(self) -> Vessel:
        """The vessel with the estimated values; DocumentError if its checks refuse them (status `refused`)."""
        return self.vessel.with_values(self.values)


def huber_loss(r: Array, threshold: float) -> Array:
    """Huber loss of whitened residuals r: r^2 up to the threshold, linear beyond it."""
    size = np.abs(r)
    with np.errstate(all="ignore"):
        return np.where(size <= threshold, r**2, 2 * threshold * size - threshold**2)


def initial_point(problem: Problem) -> Point:
    """Initial unknowns of the runs: no fault, except a small value where the derivative would vanish at 0."""
    first = np.array([BEGIN.get(name, 0.0) for name in problem.names])
    starts = (len(problem.segments), len(problem.model.node)) if problem.start_width is not None else (0, 0)
    return Point(np.tile(first, (len(problem.runs), 1)), np.zeros(starts))


def search_factors(
    problem: Problem,
    factors: Array,
    point: Point,
    progress: Progress | None = None,
    *,
    before: int = 0,
    tolerance: float = TOLERANCE,
    most: int = MOST_EVALUATIONS,
) -> Result:
    """Minimise the objective from given factors.

    factors, point : initial factors (n,) and unknowns of the runs.
    progress : called with iteration number and objective after each iteration; a true return value stops.
    before : iterations of earlier searches. tolerance : relative change at which to end. most : evaluations.

    Raises KeyboardInterrupt for Ctrl-C, after the current iteration. Errors raised by `progress` are passed on.
    """
    with hold_interrupts() as held, np.errstate(all="ignore"):
        begin = np.clip(factors, problem.unknown.low, problem.unknown.high)
        start = evaluate_factors(problem, begin, best_valley(problem, begin, point) or point)
        if not np.isfinite(start.objective):
            return Result(begin, start.at, start.point, float("inf"), before, "diverged")
        run = _SearchState(problem, start, progress, held, before)
        word, at_bound = run.minimise(tolerance, most), run.pushed()
        if word == "ok" and at_bound.any():
            word = run.settle(at_bound, tolerance, most)
    best = run.best
    return Result(best.factors, best.at, best.point, best.objective, run.iterations, word)


def best_valley(problem: Problem, factors: Array, point: Point) -> Point | None:
    """Unknowns of the runs in the deepest valley of several guesses of each run's current; None where these are none.

    Each run is begun from its unknowns as they are, from the median current of all runs, and from currents around 0.
    """
    if not NUISANCES["current"].keys() <= set(problem.names) or problem.common:
        return None
    places = [problem.names.index(name) for name in NUISANCES["current"]]
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    guesses = [FAR * np.array([np.cos(angle), np.sin(angle)]) for angle in angles]
    best = _eliminate_run_unknowns(problem, factors, point)
    costs = np.nan_to_num(_run_objectives(problem, best, problem.settings.linear_from), nan=np.inf)
    nuisances, away = best.nuisances.copy(), best.away.copy()
    for guess in [np.median(best.nuisances[:, places], axis=0), *guesses]:
        begin = point.nuisances.copy()
        begin[:, places] = guess
        at = _eliminate_run_unknowns(problem, factors, Point(begin, point.away))
        found = np.nan_to_num(_run_objectives(problem, at, problem.settings.linear_from), nan=np.inf)
        better = found < costs * (1 - FALL)
        nuisances[better], costs[better] = at.nuisances[better], found[better]
        if away.size:
            mine = better[problem.whole.run]
            away[mine] = at.away[mine]
    return Point(nuisances, away)


@dataclass(frozen=True)
class _Evaluation:
    """One evaluation: residuals f (m,) and Jacobian J (m, n) in the form that is given to SciPy."""

    factors: Array
    at: ResidualPrediction
    f: Array
    J: Array

    @property
    def point(self) -> Point:
        """The unknowns of the runs."""
        return Point(self.at.nuisances, self.at.away)

    @property
    def objective(self) -> float:
        total = float(self.f @ self.f)
        return total if np.isfinite(total) else float("inf")


class _SearchState:
    """State of one search: the last and the best evaluation, which factors are free, and whether it is to stop.

    held : Ctrl-C deferred by `hold_interrupts`. iterations : count so far.
    """

    def __init__(
        self, problem: Problem, start: _Evaluation, progress: Progress | None, held: list[int], iterations: int
    ) -> None:
        self.problem, self.free = problem, problem.unknown.low < problem.unknown.high
        self.last = self.best = start
        self.progress, self.held, self.iterations, self.stopped = progress, held, iterations, False
        self._report(start.objective)

    def _report(self, objective: float) -> None:
        """Report an iteration; `progress` or Ctrl-C may ask to stop."""
        asked = self.progress is not None and bool(self.progress(self.iterations, objective))
        self.stopped = asked or bool(self.held)

    def _at(self, x: Array) -> _Evaluation:
        factors = self.best.factors.copy()
        factors[self.free] = x
        if not np.array_equal(factors, self.last.factors):
            self.last = evaluate_factors(self.problem, factors, self.best.point)
            if self.last.objective < self.best.objective:
                self.best = self.last
        return self.last

    def _after(self, intermediate_result: OptimizeResult) -> None:
        self.iterations += 1
        self._report(2 * float(intermediate_result.cost))
        if self.stopped:
            raise StopIteration

    def minimise(self, tolerance: float, most: int) -> str:
        """Run the trust region over the free factors; the status: `ok`, `not converged` or `stopped`.

        Where kinks of the equations (|v|, |r|) have stopped the short steps of a region, and a long Gauss-Newton step
        still goes down, the search goes on from there with a fresh region and scale.
        """
        if self.stopped:
            return "stopped"
        if not self.free.any():
            return "ok"
        word = self._minimise(tolerance, most)
        if word != "ok":
            return word
        crossings = 0
        for _ in range(MOST_RESTARTS):
            if not self._stride():
                crossings += 1
                if crossings > CROSSINGS or not self._across():
                    return "stopped" if self.stopped else word
            word = self._minimise(tolerance, most)
            if word == "stopped":
                return word
        return "not converged"

    def _stride(self) -> bool:
        """Take the Gauss-Newton step from the best point; False where it lowers the objective by less than `LEFT`."""
        free = self.free & ~self.pushed()
        scale, step, fall = _gauss_newton(self.best.J[:, free], self.best.f)
        return fall > LEFT * self.best.objective and self._taken(free, step / scale, LEFT)

    def _taken(self, free: NDArray[np.bool_], step: Array, least: float) -> bool:
        """Take the longest of a step's halves that lowers the objective by the share `least`; False where none does."""
        begin = self.best
        for halved in range(STRIDES):
            factors = begin.factors.copy()
            factors[free] -= 0.5**halved * step
            there = self._beside(begin, factors)
            if there.objective < begin.objective * (1 - least):
                self.last = self.best = there
                return True
        return False

    def _beside(self, begin: _Evaluation, factors: Array) -> _Evaluation:
        """The evaluation at other factors, clipped to their bounds."""
        factors = np.clip(factors, self.problem.unknown.low, self.problem.unknown.high)
        return evaluate_factors(self.problem, factors, begin.point)

    def _across(self) -> bool:
        """Take steps where the best point is in a kink; True if they lower the objective by the share `FALL`.

        Each is a Gauss-Newton step for the residuals linearised at the best point and at `SAMPLES` points around it.
        Source: Burke, Lewis, Overton, SIAM Journal on Optimization 15 (2005) 751 (gradient sampling).
        """
        draw, around, misses, first = np.random.default_rng(0), AROUND, 0, self.best.objective
        for _ in range(ROUNDS):
            free = self.free & ~self.pushed()
            promised = _gauss_newton(self.best.J[:, free], self.best.f)[2]
            if misses == MISSES or self.stopped or promised <= FALL * self.best.objective:
                break  # the derivatives promise no such fall, as they do in a kink
            if self._taken(free, self._sampled(free, draw, around), FALL / ROUNDS):
                around, misses = min(3 * around, AROUND), 0
            else:
                around, misses = around / 10, misses + 1
        return self.best.objective < first * (1 - FALL)

    def _sampled(self, free: NDArray[np.bool_], draw: np.random.Generator, around: float) -> Array:
        """Gauss-Newton step (free,) for the sum of the squares linearised at the best point and at points around it."""
        begin = self.best
        scale = _column_norms(begin.J[:, free])
        _, s, axes = np.linalg.svd(begin.J[:, free] / scale, full_matrices=False)
        s, axes = s[s > RANK * s[0]], axes[s > RANK * s[0]]
        J, f = [begin.J[:, free] / scale], [begin.f]
        for _ in range(SAMPLES):
            factors = begin.factors.copy()
            length = np.sqrt(around * begin.objective / len(s))
            factors[free] += axes.T @ (length * draw.standard_normal(len(s)) / s) / scale
            there = self._beside(begin, factors)
            if np.isfinite(there.objective):
                J.append(there.J[:, free] / scale)
                f.append(there.f - there.J[:, free] @ (there.factors - begin.factors)[free])
        return np.asarray(np.linalg.lstsq(np.vstack(J), np.concatenate(f), rcond=RANK)[0] / scale)

    def _minimise(self, tolerance: float, most: int) -> str:
        low, high = self.problem.unknown.low[self.free], self.problem.unknown.high[self.free]
        result = least_squares(
            lambda x: self._at(x).f,
            np.clip(self.best.factors[self.free], low, high),
            jac=lambda x: self._at(x).J[:, self.free],
            bounds=(low, high),
            x_scale="jac",
            ftol=tolerance,
            xtol=tolerance,
            gtol=tolerance,
            max_nfev=most,
            callback=self._after,
        )
        if self.stopped:
            return "stopped"
        return "not converged" if result.status == 0 else "ok"

    def pushed(self) -> NDArray[np.bool_]:
        """Mask (n,) of free factors near a bound with the objective falling towards that bound."""
        unknown, best = self.problem.unknown, self.best
        slope = best.J.T @ best.f
        low, high = best.factors - unknown.low < NEAR, unknown.high - best.factors < NEAR
        return self.free & ((low & (slope > 0)) | (high & (slope < 0)))

    def settle(self, at_bound: NDArray[np.bool_], tolerance: float, most: int) -> str:
        """Set factors exactly to their bounds and search over the others: the trust region only approaches a bound."""
        unknown, before = self.problem.unknown, self.best
        nearer = np.where(before.factors - unknown.low < unknown.high - before.factors, unknown.low, unknown.high)
        there = evaluate_factors(self.problem, np.where(at_bound, nearer, before.factors), before.point)
        if not np.isfinite(there.objective):
            return "ok"
        self.free = self.free & ~at_bound
        self.last = self.best = there
        return self.minimise(tolerance, most)


def _column_norms(J: Array) -> Array:
    """Norms (n,) of the columns of a Jacobian (m, n); 1 for a column of zeros."""
    size = np.linalg.norm(J, axis=0)
    return np.asarray(np.where(size > 0, size, 1.0), dtype=float)


def _gauss_newton(J: Array, f: Array) -> tuple[Array, Array, float]:
    """Scale (n,) of the columns, the scaled Gauss-Newton step (n,), and the fall of the squares that it promises."""
    scale = _column_norms(J)
    step = np.linalg.lstsq(J / scale, f, rcond=RANK)[0]
    return scale, np.asarray(step, dtype=float), float(np.square(J / scale @ step).sum())


def evaluate_factors(problem: Problem, factors: Array, point: Point) -> _Evaluation:
    """Residuals and Jacobian at given factors (n,), with the unknowns of the runs at their optimum."""
    at = _eliminate_run_unknowns(problem, factors, point)
    whole = _run_triangles(problem, at)
    return _Evaluation(factors, at, whole[:, -1], whole[:, :-1])


def _run_triangles(problem: Problem, at: ResidualPrediction) -> Array:
    """Jacobian and residuals (m, n + 1), with the priors of the factors; the triangular factor of each run.

    The Jacobian loses what the unknowns of the runs can do; these are at their optimum.
    """
    parts, n = list[Array](), problem.num_factors
    f, J, A = _robust_residuals(at, problem.settings.linear_from)
    if np.isfinite(f).all() and np.isfinite(J).all():
        for run in range(len(problem.runs)):
            rows = at.rows(run)
            both = np.column_stack([J[rows], f[rows]])
            slopes, xi = at.unknown(run, rows, A)
            if len(xi):
                both = np.vstack([both, np.column_stack([np.zeros((len(xi), n)), xi])])
                basis = np.linalg.qr(np.vstack([slopes, np.eye(len(xi))]))[0]
                both[:, :n] -= basis @ (basis.T @ both[:, :n])
            parts.append(np.asarray(np.linalg.qr(both, mode="r")))
    else:
        parts.append(np.full((1, n + 1), np.nan))
    known = np.isfinite(problem.unknown.prior)
    prior = np.column_stack(
        [np.diag(1 / problem.unknown.prior), (at.factors - problem.unknown.centre) / problem.unknown.prior]
    )
    return np.vstack([*parts, prior[known]])


def _robust_residuals(at: ResidualPrediction, threshold: float) -> tuple[Array, Array, Array]:
    """Residuals (m,) whose squares are the loss, their Jacobian (m, n), and the weight (m,) of any other derivative."""
    if not np.isfinite(threshold):
        return at.r, at.by_factor, np.ones(len(at.r))
    f = np.sign(at.r) * np.sqrt(huber_loss(at.r, threshold))
    slope = np.where(np.abs(at.r) <= threshold, 1.0, threshold / np.maximum(np.abs(f), threshold))
    return f, slope[:, None] * at.by_factor, slope


def _eliminate_run_unknowns(problem: Problem, factors: Array, point: Point) -> ResidualPrediction:
    """The prediction with the unknowns of each run at their optimum, by Gauss-Newton steps with step halving."""
    at = predict_residuals(problem, factors, point.nuisances, point.away)
    if not (point.nuisances.size or point.away.size) or not np.isfinite(at.r).all():
        return at
    threshold = problem.settings.linear_from
    costs = _run_objectives(problem, at, threshold)
    for _ in range(INNER):
        step, fall = _run_steps(problem, at, threshold)
        if (fall <= CLOSE * costs).all():
            break
        share = np.where(fall > CLOSE * costs, 1.0, 0.0)
        for _ in range(HALVINGS):
            trial = predict_residuals(problem, factors, *_apply_run_steps(problem, at, step, share))
            after = _run_objectives(problem, trial, threshold)
            worse = ~(after <= costs) & (share > 0)
            if not worse.any():
                break
            share = np.where(worse, share / 2, share)
        else:
            share = np.where(worse, 0.0, share)
            trial = predict_residuals(problem, factors, *_apply_run_steps(problem, at, step, share))
            after = _run_objectives(problem, trial, threshold)
        settled = (costs - after <= CLOSE * costs).all()
        at, costs = trial, after
        if settled:
            break
    return at


def _run_objectives(problem: Problem, at: ResidualPrediction, threshold: float) -> Array:
    """Objective (R,) of each run, without the priors of the factors."""
    total = np.bincount(at.run, huber_loss(at.r, threshold), len(problem.runs)) + (at.nuisances**2).sum(axis=1)
    if at.away.size:
        total += np.bincount(problem.whole.run, (at.away**2).sum(axis=1), len(problem.runs))
    return np.asarray(total)


def _run_steps(problem: Problem, at: ResidualPrediction, threshold: float) -> tuple[list[Array], Array]:
    """Gauss-Newton step of the unknowns of each run, and the predicted decrease (R,) of its objective."""
    f, _, root = _robust_residuals(at, threshold)
    steps, fall = list[Array](), np.zeros(len(problem.runs))
    for run in range(len(problem.runs)):
        rows = at.rows(run)
        A, xi = at.unknown(run, rows, root)
        slope = A.T @ f[rows] + xi
        step = _regularised_step(A, f[rows], xi)
        steps.append(step)
        fall[run] = -slope @ step
    return steps, fall


def _regularised_step(A: Array, f: Array, xi: Array) -> Array:
    """Step (k,) to the least |f + A step|^2 + |xi + step|^2; A : (m, k). f : (m,). xi : (k,)."""
    unit = np.eye(len(xi))
    try:
        return np.asarray(-np.linalg.solve(A.T @ A + unit, A.T @ f + xi), dtype=float)
    except np.linalg.LinAlgError:  # a small yaw grows so much that rounding loses the unit matrix beside A^T A
        scale, step, _ = _gauss_newton(np.vstack([A, unit]), np.concatenate([f, xi]))
        return -step / scale


def _apply_run_steps(problem: Problem, at: ResidualPrediction, steps: list[Array], share: Array) -> tuple[Array, Array]:
    """Nuisances and initial states after `share` (R,) of each run's step; latencies are limited to the lags kept."""
    nuisances, away, q = at.nuisances.copy(), at.away.copy(), len(problem.names)
    for run, step in enumerate(steps):
        nuisances[run] += share[run] * step[:q]
        if away.size:
            away[problem.whole.run == run] += share[run] * step[q:].reshape(-1, away.shape[1])
    for i in (i for i, name in enumerate(problem.names) if name == "latency"):
        nuisances[:, i] = np.clip(nuisances[:, i], 0.0, problem.layout.lags * problem.layout.step / problem.widths[i])
    return nuisances, away
