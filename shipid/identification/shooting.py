"""Direct multiple shooting: factors, nuisances and the nodes of all intervals found together by IPOPT.

Every interval starts from a node of its own, first the measured state, and its end is tied to the next node by a
constraint (Bock and Plitt 1984). So a start from which a whole run would diverge does not: errors cannot grow beyond an
interval. Objective, constraints, their sparse derivatives and the Gauss-Newton Hessian come from one evaluation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from shipid.identification.residuals import Evaluation, Fit, Intervals
from shipid.interrupts import uninterrupted

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Progress = Callable[[int, float], object]
INTERVALS = (40, 10, 1)  # steps between nodes: the first at whose ends the start is not lost
LOST = 300.0  # scales of a node: far beyond what a step of the solver mends
MOST_ITERATIONS = 60  # then single shooting from there, whose objective cannot cycle
MOST_POLISHING = 200
TOLERANCE = 1e-9  # of the scaled optimality conditions
CIRCLED = ("Maximum_Iterations_Exceeded", "Restoration_Failed", "Search_Direction_Becomes_Too_Small")
OPTIONS: dict[str, Any] = {
    "print_time": False,
    "show_eval_warnings": False,
    "error_on_fail": False,
    "no_nlp_grad": True,
    "calc_lam_p": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": TOLERANCE,
    "ipopt.acceptable_iter": 2,  # kinks of |v| and of limited advance ratios keep the last digits from settling
    "ipopt.acceptable_tol": 1e-4,
    "ipopt.acceptable_constr_viol_tol": 1e-5,
    "ipopt.acceptable_obj_change_tol": 1e-8,
    "ipopt.mu_init": 1e-4,  # the objective is of order one
    "ipopt.nlp_scaling_method": "none",  # the unknowns and residuals are scaled already
    "ipopt.bound_relax_factor": 0.0,
}


@dataclass(frozen=True)
class Point:
    """Where a solve begins or ends: factors (n,), nuisances (R, nq) in prior widths, off centre; nodes (K, nn)."""

    factors: Array
    nuisances: Array
    nodes: Array


@dataclass(frozen=True)
class Result:
    """What IPOPT found: the point, the objective there (sum of squares, priors included), and what it says."""

    point: Point
    objective: float
    iterations: int
    word: str


def loss(r: Array, threshold: float) -> tuple[Array, Array]:
    """What each residual adds to the objective, and its weight: r^2 and 1, linear beyond the threshold (Huber)."""
    size = np.abs(r)
    inside = size <= threshold
    with np.errstate(all="ignore"):
        return np.where(inside, r**2, 2 * threshold * size - threshold**2), np.where(inside, 1.0, threshold / size)


class Problem:
    """The nonlinear programme of one fit; variables are factors, nuisances in prior widths, nodes in their scale."""

    def __init__(self, fit: Fit, length: int = INTERVALS[0]) -> None:
        self.fit, self.intervals = fit, Intervals(fit, length)
        count, self.nn, self.nq, n = len(self.intervals), len(fit.model.node), len(fit.names), fit.num_factors
        self.size = n + len(fit.runs) * self.nq + count * self.nn
        self.sum = max(1, int((self.intervals.weight > 0).sum()))
        first, inner = np.flatnonzero(self.intervals.first), self.intervals.inner
        places = np.arange(count * self.nn).reshape(count, self.nn) + n + len(fit.runs) * self.nq
        own = n + self.nq * self.intervals.run[:, None] + np.arange(self.nq)
        self.columns = np.hstack([places, np.tile(np.arange(n), (count, 1)), own])  # (K, nc) places of the variables
        self.ties, self.starts = inner, first
        self.free_start = fit.start_width is not None
        self.column_scale = np.concatenate([fit.node_scale, np.ones(n), fit.widths])
        self._last: tuple[Array, _Numbers] | None = None
        self._lay_out()

    @property
    def num_constraints(self) -> int:
        """Rows of the constraints."""
        return self.nn * (len(self.ties) + (0 if self.free_start else len(self.starts)))

    def _lay_out(self) -> None:
        """Sparsity of the Jacobian and the upper triangle of the Hessian, and where each number goes."""
        nn, nc = self.nn, self.columns.shape[1]
        rows = np.arange(self.num_constraints).reshape(-1, nn)
        tied = rows[: len(self.ties)]
        parts = [
            (np.repeat(tied, nc, axis=1).ravel(), np.tile(self.columns[self.ties][:, None], (1, nn, 1)).ravel()),
            (tied.ravel(), self.columns[self.ties + 1, :nn].ravel()),
        ]
        if not self.free_start:
            held, q = rows[len(self.ties) :], self.columns[self.starts][:, nc - self.nq :]
            parts.append((held.ravel(), self.columns[self.starts, :nn].ravel()))
            parts.append((np.repeat(held, self.nq, axis=1).ravel(), np.tile(q[:, None], (1, nn, 1)).ravel()))
        row, column = (np.concatenate(each) for each in zip(*parts, strict=True))
        self.jacobian, self.jacobian_place = _pattern(row, column, self.num_constraints, self.size)
        a, b = (
            np.broadcast_to(x, (len(self.columns), nc, nc))
            for x in (self.columns[:, :, None], self.columns[:, None, :])
        )
        self.upper = a <= b
        diagonal = np.arange(self.size)
        row, column = np.concatenate([a[self.upper], diagonal]), np.concatenate([b[self.upper], diagonal])
        if self.free_start and self.nq:
            q = self.columns[self.starts][:, nc - self.nq :]
            nodes = self.columns[self.starts, :nn]
            crossed = [np.repeat(q, nn, axis=1).ravel(), np.tile(q, (1, self.nq)).ravel()]
            along = [np.tile(nodes, (1, self.nq)).ravel(), np.repeat(q, self.nq, axis=1).ravel()]
            keep = crossed[1] <= along[1]
            self.crossed_keep = keep
            row = np.concatenate([row, crossed[0], crossed[1][keep]])
            column = np.concatenate([column, along[0], along[1][keep]])
        self.hessian, self.hessian_place = _pattern(row, column, self.size, self.size)

    def split(self, x: Array) -> Point:
        """Variables by meaning, nodes in SI."""
        n, runs = self.fit.num_factors, len(self.fit.runs)
        factors, nuisances, nodes = np.split(x, [n, n + runs * self.nq])
        return Point(factors, nuisances.reshape(runs, self.nq), nodes.reshape(-1, self.nn) * self.fit.node_scale)

    def join(self, point: Point) -> Array:
        """The reverse of `split`."""
        return np.concatenate([point.factors, point.nuisances.ravel(), (point.nodes / self.fit.node_scale).ravel()])

    def start(self, factors: Array) -> Point:
        """Nodes as measured; nuisances near nothing, but not where their slope vanishes."""
        fit = self.fit
        first = np.array(
            [{"current_north": 0.01, "current_east": 0.01, "latency": 0.3}.get(name, 0.0) for name in fit.names]
        )
        nuisances = np.tile(first, (len(fit.runs), 1))
        return Point(factors, nuisances, self.intervals.begin(fit.centres + fit.widths * nuisances)[0])

    def lost(self, point: Point) -> NDArray[np.bool_]:
        """(K,) intervals that leave what was measured so far that no step of the solver brings them back."""
        with np.errstate(all="ignore"):
            found = self.at(self.join(point)).found
            away = np.zeros(len(self.intervals))
            away[self.ties] = np.abs((found.end[self.ties] - point.nodes[self.ties + 1]) / self.fit.node_scale).max(
                axis=1
            )
            finite = np.isfinite(found.r).all(axis=1) & np.isfinite(found.end).all(axis=1)
        return ~finite | ~(away < LOST)

    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest value of every variable."""
        low, high = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        n, fit = self.fit.num_factors, self.fit
        low[:n], high[:n] = fit.unknown.low, fit.unknown.high
        for i, name in enumerate(fit.names):
            if name == "latency":
                own = n + self.nq * np.arange(len(fit.runs)) + i
                low[own], high[own] = 0.0, fit.layout.lags * fit.layout.step / fit.widths[i]
        return low, high

    def at(self, x: Array) -> _Numbers:
        """Objective, constraints and their derivatives at one place; the last is remembered, as IPOPT asks in turn."""
        if self._last is None or not np.array_equal(x, self._last[0]):
            self._last = x.copy(), self._evaluate(x)
        return self._last[1]

    def _evaluate(self, x: Array) -> _Numbers:
        fit, point = self.fit, self.split(x)
        found = self.intervals.evaluate(point.nodes, point.factors, fit.centres + fit.widths * point.nuisances)
        begin, begin_slope = self.intervals.begin(fit.centres + fit.widths * point.nuisances)
        away = ((point.nodes - begin) / fit.node_scale)[self.starts]
        slope = begin_slope[self.starts] * fit.widths / fit.node_scale[:, None]  # of the measured start, in variables
        return _Numbers(self, point, found, away, slope)


class _Numbers:
    """Everything at one place, worked out when it is asked for."""

    def __init__(self, problem: Problem, point: Point, found: Evaluation, away: Array, slope: Array) -> None:
        self.problem, self.point, self.found, self.away, self.slope = problem, point, found, away, slope
        fit = problem.fit
        threshold = fit.settings.threshold if fit.settings.loss == "huber" else np.inf
        parts, self.weight = loss(found.r, threshold)
        self.prior = (point.factors - fit.unknown.centre) / fit.unknown.prior
        self.width = fit.start_width
        squares = [parts.sum(), (self.prior**2).sum(), (point.nuisances**2).sum()]
        squares += [0.0 if self.width is None else (away**2).sum() / self.width**2]
        self.objective = float(sum(squares))

    def constraints(self) -> Array:
        """Ends less the nodes that follow, then starts less what was measured; in the scale of the nodes."""
        problem, scale = self.problem, self.problem.fit.node_scale
        ties = (self.found.end[problem.ties] - self.point.nodes[problem.ties + 1]) / scale
        return np.concatenate([ties.ravel(), [] if problem.free_start else self.away.ravel()])

    def jacobian(self) -> Array:
        """Nonzeros of the constraints' Jacobian."""
        problem, scale = self.problem, self.problem.fit.node_scale
        slope = self.found.slope[problem.ties] * (problem.column_scale / scale[:, None])
        parts = [slope.ravel(), np.full(problem.nn * len(problem.ties), -1.0)]
        if not problem.free_start:
            parts += [np.ones(self.away.size), -self.slope.ravel()]
        return _placed(problem.jacobian_place, np.concatenate(parts), problem.jacobian.nnz())

    def gradient(self) -> Array:
        """Of half the objective."""
        problem, fit = self.problem, self.problem.fit
        own = (self.found.R @ (self.weight * self.found.r)[:, :, None])[:, :, 0] * problem.column_scale
        result: Array = np.bincount(problem.columns.ravel(), own.ravel(), problem.size).astype(float)
        n, nuisances = fit.num_factors, self.point.nuisances.ravel()
        result[:n] += self.prior / fit.unknown.prior
        result[n : n + len(nuisances)] += nuisances
        if self.width is not None:
            pull = self.away / self.width**2
            columns = problem.columns[problem.starts]
            result[columns[:, : problem.nn]] += pull
            q = columns[:, columns.shape[1] - problem.nq :]
            np.subtract.at(result, q, (pull[:, None] @ self.slope)[:, 0])
        return result

    def hessian(self) -> Array:
        """Nonzeros of the upper triangle of the Gauss-Newton Hessian of half the objective."""
        problem, fit, n = self.problem, self.problem.fit, self.problem.fit.num_factors
        R = self.found.R * problem.column_scale[:, None]
        blocks = (R * self.weight[:, None] if fit.settings.loss == "huber" else R) @ R.transpose(0, 2, 1)
        diagonal = np.zeros(problem.size)
        diagonal[:n] = 1 / fit.unknown.prior**2
        diagonal[n : n + self.point.nuisances.size] = 1.0
        parts = [blocks[problem.upper], diagonal]
        if self.width is not None:
            diagonal[problem.columns[problem.starts, : problem.nn]] = 1 / self.width**2
            if problem.nq:
                crossed = -self.slope.transpose(0, 2, 1) / self.width**2
                own = (self.slope.transpose(0, 2, 1) @ self.slope / self.width**2).ravel()
                parts += [crossed.ravel(), own[problem.crossed_keep]]
        return _placed(problem.hessian_place, np.concatenate(parts), problem.hessian.nnz())


def _pattern(row: Index, column: Index, num_rows: int, num_columns: int) -> tuple[ca.Sparsity, Index]:
    """Sparsity of entries that may repeat, and the nonzero that each adds to."""
    key, place = np.unique(column.astype(np.int64) * num_rows + row, return_inverse=True)
    columns, rows = np.divmod(key, max(num_rows, 1))
    starts = np.searchsorted(columns, np.arange(num_columns + 1))
    return ca.Sparsity(num_rows, num_columns, starts.tolist(), rows.tolist()), place


def _placed(place: Index, values: Array, count: int) -> Array:
    return np.bincount(place, values, count).astype(float) if count else np.zeros(0)


class _Watch:
    """Counts the iterations and says when to stop."""

    def __init__(self, problem: Problem, progress: Progress | None, held: list[int]) -> None:
        self.problem, self.progress, self.held = problem, progress, held
        self.iterations = -1
        self.failure: Exception | None = None

    def iterated(self, objective: float) -> bool:
        """Note one more iteration; whether to stop."""
        self.iterations += 1
        stop = False
        if self.progress is not None:
            try:
                stop = bool(self.progress(self.iterations, 2 * objective * self.problem.sum))
            except Exception as error:  # CasADi would turn it into a complaint of its own
                self.failure = error
        return stop or self.failure is not None or bool(self.held)


class _Callback(ca.Callback):
    """A CasADi function of numbers: names and sparsities of what goes in and out, and what it does."""

    def __init__(
        self, name: str, inputs: dict[str, Any], outputs: dict[str, Any], run: Callable[..., list[Any]]
    ) -> None:
        super().__init__()
        self.inputs, self.outputs, self.run = inputs, outputs, run
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self.inputs)

    def get_n_out(self) -> int:
        return len(self.outputs)

    def get_name_in(self, i: int) -> str:
        return list(self.inputs)[i]

    def get_name_out(self, i: int) -> str:
        return list(self.outputs)[i]

    def get_sparsity_in(self, i: int) -> Any:
        return list(self.inputs.values())[i]

    def get_sparsity_out(self, i: int) -> Any:
        return list(self.outputs.values())[i]

    def eval(self, arg: Sequence[Any]) -> list[Any]:
        return self.run(*arg)


def poses(fit: Fit, factors: Array) -> Iterator[tuple[Problem, Point]]:
    """The programme of a fit and where it begins, with ever closer nodes, from the first whose ends are not lost."""
    for length in INTERVALS:
        problem = Problem(fit, length)
        start = problem.start(factors)
        if length == INTERVALS[-1] or not problem.lost(start).any():
            yield problem, start


def solve(problem: Problem, start: Point, progress: Progress | None = None, before: int = 0) -> Result:
    """Minimise from a start; the sentence for what happened is the caller's. Ctrl-C stops after the iteration.

    Iterations are counted on from those `before`. On real data, kinks and large residuals can make Gauss-Newton steps
    trade continuity for fit in a circle. The nodes are near the truth by then, so single shooting from there ends it:
    its objective falls with every step.
    """
    result = _minimise(problem, start, progress, MOST_ITERATIONS, before)
    if result.word not in CIRCLED:
        return result
    whole = Problem(problem.fit, 0)
    point = Point(result.point.factors, result.point.nuisances, result.point.nodes[problem.starts])
    second = _minimise(whole, point, progress, MOST_POLISHING, result.iterations)
    if not np.isfinite(second.objective):
        return result
    nodes = result.point.nodes.copy()
    nodes[problem.starts] = second.point.nodes
    return replace(second, point=replace(second.point, nodes=nodes))


def _minimise(problem: Problem, start: Point, progress: Progress | None, most: int, before: int) -> Result:
    """One run of IPOPT of at most so many iterations, after those `before`."""
    with uninterrupted() as held, np.errstate(all="ignore"):
        watch = _Watch(problem, progress, held)
        watch.iterations += before
        low, high = problem.bounds()
        found, word = _ipopt(problem, watch, np.clip(problem.join(start), low, high), most)
        if watch.failure is not None:
            raise watch.failure
        numbers = problem.at(found)
    return Result(numbers.point, numbers.objective, max(watch.iterations, before), word)


def _ipopt(problem: Problem, watch: _Watch, x0: Array, most: int) -> tuple[Array, str]:
    """Variables at the end, and IPOPT's word for it."""
    low, high = problem.bounds()
    dense, m = ca.Sparsity.dense, problem.num_constraints
    x, p, one = dense(problem.size), dense(0, 0), dense(1)

    def at(given: Any) -> _Numbers:
        return problem.at(np.asarray(given).ravel())

    def f(given: Any) -> Any:
        return at(given).objective / (2 * problem.sum)

    def gradient(given: Any) -> Any:
        return ca.DM(at(given).gradient() / problem.sum)

    def hessian(given: Any, lam_f: Any) -> Any:
        return ca.DM(problem.hessian, at(given).hessian() * (float(lam_f) / problem.sum))

    def jacobian(given: Any) -> Any:
        return ca.DM(problem.jacobian, at(given).jacobian())

    both = {"x": x, "p": p}
    functions = {
        "both": _Callback("both", {"x": x}, {"f": one, "g": dense(m)}, lambda v: [f(v), ca.DM(at(v).constraints())]),
        "grad_f": _Callback("grad_f", both, {"f": one, "grad_f_x": x}, lambda v, _: [f(v), gradient(v)]),
        "jac_g": _Callback(
            "jac_g",
            both,
            {"g": dense(m), "jac_g_x": problem.jacobian},
            lambda v, _: [ca.DM(at(v).constraints()), jacobian(v)],
        ),
        "hess_lag": _Callback(
            "hess_lag",
            {**both, "lam_f": one, "lam_g": dense(m)},
            {"hess_gamma_x_x": problem.hessian},
            lambda v, _p, lam_f, _g: [hessian(v, lam_f)],
        ),
    }
    after = _Callback(
        "after",
        {
            name: {"x": x, "f": one, "g": dense(m), "lam_x": x, "lam_g": dense(m), "lam_p": p}[name]
            for name in ca.nlpsol_out()
        },
        {"stop": one},
        lambda *given: [watch.iterated(float(given[ca.nlpsol_out().index("f")]))],
    )
    symbol: Any = ca.MX.sym("x", problem.size)
    value, rows = functions["both"](symbol)
    options: dict[str, Any] = {
        **OPTIONS,
        "ipopt.max_iter": most,
        **{name: functions[name] for name in ("grad_f", "jac_g", "hess_lag")},
        "iteration_callback": after,
    }
    programme: dict[str, Any] = {"x": symbol, "f": value, "g": rows}
    solver = ca.nlpsol("solver", "ipopt", programme, options)
    answer = solver(x0=x0, lbx=low, ubx=high, lbg=0, ubg=0)
    return np.asarray(answer["x"]).ravel(), str(solver.stats()["return_status"])
