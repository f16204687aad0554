"""A fit as numbers: weighted residuals of many predictions and their exact derivatives.

Each prediction begins at a measured state of the log (or one to be found near it), and all of them run at once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Dataset
from shipid.engine.native import compiler
from shipid.errors import DataError, DocumentError
from shipid.identification.compiled import pack, run_compiled
from shipid.identification.segments import Segment, cut_segments
from shipid.identification.sensitivities import COLUMNS, Layout, Variation, is_thrust, run_machine, variation
from shipid.identification.settings import (
    BLOCK,
    ENVIRONMENT,
    MOVING,
    NUISANCES,
    Identify,
    Unknowns,
    overrides,
    unknowns,
)
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel

Array = NDArray[np.float64]
SIZES = {"u": 0.1, "v": 0.1, "w": 0.1, "north": 1.0, "east": 1.0, "down": 0.1, "psi": math.radians(1.0)} | {
    **dict.fromkeys(("phi", "theta"), math.radians(1.0)),
    **dict.fromkeys(("p", "q", "r"), math.radians(0.2)),
}
"""Ordinary error of a state that is not fitted [SI]: the scale on which the solver sees it."""
COMPILE_FROM = 4e4  # steps times entries of the sensitivities: below it the virtual machine is done sooner
MOST_LATE = 4.0  # prior widths that a latency may reach


@dataclass(frozen=True, eq=False)
class Problem:
    """All numbers of one fit.

    names, centres, widths : scalars of the per-run nuisances, (nq,) values where nothing is wrong and prior widths.
    start_width : of the initial states in standard deviations of the signals; None where they are as measured.
    base : (R, P) parameters of each run with its own overrides. deviations : (ny,) of the signals.
    """

    vessel: Vessel
    runs: tuple[str, ...]
    settings: Identify
    unknown: Unknowns
    layout: Layout
    segments: tuple[Segment, ...]
    base: Array
    names: tuple[str, ...]
    centres: Array
    widths: Array
    start_width: float | None
    deviations: Array

    @cached_property
    def model(self) -> Variation:
        """The compiled equations."""
        return variation(self.layout)

    @cached_property
    def node_scale(self) -> Array:
        """(nn,) size of the error of each entry of a node: of the signal where it is fitted."""
        own = dict(zip(self.layout.signals, self.deviations, strict=True))
        return np.array([own.get(name, SIZES.get(name, 1.0)) for name in self.model.node])

    @cached_property
    def whole(self) -> Predictions:
        """The predictions, packed."""
        return Predictions(self)

    @property
    def num_factors(self) -> int:
        """Factors to find."""
        return len(self.unknown.groups)

    def fixed(self, factors: Array, nuisances: Array) -> Array:
        """(R, .) numbers that stay the same along each run: factors, its nuisances, base parameters, scales."""
        scale = np.concatenate([*map(np.array, self.unknown.scale)])
        count = len(self.runs)
        return np.hstack([np.tile(factors, (count, 1)), nuisances, self.base, np.tile(scale, (count, 1))])


def build(vessel: Vessel, dataset: Dataset, runs: Sequence[str], settings: Identify) -> Problem:
    """Everything that a fit needs; DocumentError or DataError says what is missing."""
    if not runs:
        raise DataError("no run to fit: name at least one", path="runs")
    if len(set(runs)) < len(runs):
        raise DataError("a run is named twice: name each once", path="runs")
    widths = settings.widths
    if "current" in widths and "current" not in vessel.document:
        vessel = vessel.with_values({"current.kind": "uniform"})
    if "thrust_scale" in widths and not any(map(is_thrust, vessel.parameters)):
        message = f"{vessel.name} has no thrust coefficient: leave it out"
        raise DocumentError(message, file=vessel.file, path=f"{BLOCK}.nuisance.thrust_scale")
    model, unknown = dynamics(vessel), unknowns(vessel, settings)
    own = overrides(settings, runs, vessel, model.environment, dataset.runs)
    scalars = {name: (centre, widths[key]) for key in widths for name, centre in NUISANCES[key].items()}
    names = tuple(sorted(scalars, key=lambda name: name not in MOVING))
    lags = math.ceil(MOST_LATE * widths["latency"] / settings.step) if "latency" in widths else 0
    numbers = {run: {path: x for path, x in of.items() if path in vessel.parameters} for run, of in own.items()}
    segments = cut_segments(vessel, dataset, runs, settings.step, settings.horizon, lags, numbers)
    weather = _weather(segments, own, model.environment, [n for n in names if n.startswith("current")])
    free = {path for group in unknown.groups for path in group}
    twice = next(((run, path) for run, values in own.items() for path in values if path in free), None)
    if twice is not None:
        path = f"{BLOCK}.runs.{'.'.join(twice)}"
        raise DocumentError("is free in the fit: fix it, or set it in no run", file=vessel.file, path=path)
    return Problem(
        vessel=vessel,
        runs=tuple(runs),
        settings=settings,
        unknown=unknown,
        layout=Layout(
            model, unknown.groups, tuple(settings.signals), names, tuple(weather), lags, settings.step, settings.method
        ),
        segments=tuple(_with_weather(segment, weather, own[runs[segment.run]]) for segment in segments),
        base=np.array([[own[run].get(path, value) for path, value in vessel.parameters.items()] for run in runs]),
        names=names,
        centres=np.array([scalars[name][0] for name in names]),
        widths=np.array([scalars[name][1] for name in names]),
        start_width=widths.get("initial_state"),
        deviations=np.array(list(settings.signals.values())),
    )


def _weather(
    segments: Sequence[Segment],
    own: Mapping[str, Mapping[str, float]],
    channels: Sequence[str],
    estimated: Sequence[str],
) -> list[str]:
    """Environment channels that the data or an override give."""
    given = {name for segment in segments for name, values in segment.columns.items() if np.any(values != 0)}
    given |= {path.removeprefix(f"{ENVIRONMENT}.") for values in own.values() for path in values}
    return [name for name in channels if name in given and not (estimated and name in ("V_c", "beta_c"))]


def _with_weather(segment: Segment, weather: Sequence[str], own: Mapping[str, float]) -> Segment:
    zero = np.zeros_like(segment.t)
    columns = {
        **segment.columns,
        **{name: segment.columns.get(name, zero) for name in weather},
        **{name: zero + own[f"{ENVIRONMENT}.{name}"] for name in weather if f"{ENVIRONMENT}.{name}" in own},
    }
    return Segment(segment.run, segment.t, columns, segment.earlier, segment.memory, segment.measured)


@dataclass(frozen=True)
class Evaluation:
    """Predictions at one place: nn entries of an initial state, nc columns (initial state, factors, nuisances).

    r : (S, N ny) weighted residuals. R : (S, N ny, nc) their slopes.
    """

    r: Array
    R: Array


class Predictions:
    """The predictions of a fit side by side, packed for the engine; shorter ones are padded without weight.

    run : (S,) of each. log : (S, columns) the log where they begin, for the states there.
    weight : (S, N, ny), 0 where nothing was measured. time : (S, N) [s] of each residual.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.length = max(segment.num_steps for segment in problem.segments)
        self.run = np.array([segment.run for segment in problem.segments])
        self.log = np.array([self._log(segment) for segment in problem.segments])
        known = np.array([self._known(segment) for segment in problem.segments])
        seen, self.weight, self.time = (
            np.array(list(each)) for each in zip(*map(self._seen, problem.segments), strict=True)
        )
        self.native = known.shape[0] * self.length * problem.model.size > COMPILE_FROM and compiler() is not None
        self.known: Array = pack(known) if self.native else known
        self.seen: Array = pack(seen) if self.native else seen

    def __len__(self) -> int:
        return len(self.run)

    def _log(self, segment: Segment) -> list[float]:
        columns = (segment.columns.get(COLUMNS.get(name, name)) for name in self.problem.model.entries)
        values = [0.0 if column is None else float(column[0]) for column in columns]
        if self.problem.layout.carried:
            values += [float(segment.memory[name][0]) for name in self.problem.layout.model.memory]
        return values

    def _known(self, segment: Segment) -> Array:
        """Inputs of every step (N, .), the last ones held where the prediction is shorter than the longest."""
        layout = self.problem.layout
        steps = np.minimum(np.arange(self.length), segment.num_steps - 1)
        commands = {
            name: np.concatenate([segment.earlier[name][::-1], segment.columns[name]]) for name in layout.model.commands
        }
        columns = [
            commands[name][steps + layout.lags - j] for j in range(layout.lags + 1) for name in layout.model.commands
        ]
        columns += [segment.columns[name][steps] for name in layout.weather]
        if not layout.carried:
            columns += [segment.memory[name][steps] for name in layout.model.memory]
        return np.array(columns).reshape(-1, self.length).T

    def _seen(self, segment: Segment) -> tuple[Array, Array, Array]:
        """Measured signals beside their weights (N, 2 ny), the weights, and the times (N,)."""
        layout, steps = self.problem.layout, 1 + np.arange(self.length)
        at = np.minimum(steps, segment.num_steps)
        weight = ((steps <= segment.num_steps) & segment.measured[at])[:, None] / self.problem.deviations
        y = np.array([segment.columns[name][at] for name in layout.signals]).T
        return np.hstack([y, weight]), weight, segment.t[0] + layout.step * steps

    def begin(self, nuisances: Array) -> tuple[Array, Array]:
        """Initial states in the log (S, nn), and their slopes in the nuisances (S, nn, nq), given those (R, nq)."""
        model, count = self.problem.model, len(self)
        entries, states, q = model.begin.size1_in(0), len(model.states), nuisances[self.run]
        nodes = np.array(model.begin.map(count)(self.log[:, :entries].T, q.T)).T
        slope = np.zeros((count, len(model.node), q.shape[1]))
        if q.shape[1]:
            slopes = np.array(model.begin_slope.map(count)(self.log[:, :entries].T, q.T))
            slope[:, :states] = slopes.reshape(states, count, -1).transpose(1, 0, 2)
        return np.hstack([nodes, self.log[:, entries:]]), slope

    def evaluate(self, nodes: Array, factors: Array, nuisances: Array) -> Evaluation:
        """Run all from initial states (S, nn) with factors (n,) and nuisances (R, nq); what diverges is not finite."""
        model, count = self.problem.model, len(self)
        num_nodes, num_states = len(model.node), len(model.states)
        num_signals, split = len(self.problem.layout.signals), num_states * (1 + model.num_columns)
        x = np.zeros((count, model.size))
        x[:, :num_states], x[:, split : split + num_nodes - num_states] = nodes[:, :num_states], nodes[:, num_states:]
        entry = np.arange(num_nodes)
        rows = np.where(
            entry < num_states,
            num_states + entry * num_states + entry,
            split + (num_nodes - num_states) * (1 + entry) + entry - num_states,
        )
        x[:, rows] = 1.0
        fixed = self.problem.fixed(factors, nuisances)[self.run]
        with np.errstate(all="ignore"):
            run = run_compiled if self.native else run_machine
            record = run(self.problem.layout, x, fixed, self.known, self.seen)
        r = record[..., :num_signals].reshape(-1, self.length * num_signals)[:count]
        R = record[..., num_signals:].reshape(*record.shape[:3], -1, num_signals).swapaxes(3, 4)
        return Evaluation(r, R.reshape(-1, r.shape[1], R.shape[4])[:count])


@dataclass(frozen=True, eq=False)
class Prediction:
    """Residuals of all predictions and their slopes.

    factors (n,), nuisances (R, nq) and away (S, nn): starts less what was measured, all in prior widths (away is empty
    where starts are as measured). r : (m,) weighted residuals; by_factor (m, n), by_nuisance (m, nq), by_start (m, nn)
    their slopes. segment, run, time, signals : (m,) where each belongs.
    """

    problem: Problem
    factors: Array
    nuisances: Array
    away: Array
    r: Array
    by_factor: Array
    by_nuisance: Array
    by_start: Array
    segment: NDArray[np.intp]
    run: NDArray[np.intp]
    time: Array
    signals: NDArray[np.str_]

    def marginal(self, threshold: float = np.inf) -> tuple[Array, Array, Array]:
        """Residuals (m,) and their slopes (m, n) with the nuisances taken out, and the share (m,) that those take.

        With A the slopes in the nuisances xi ~ N(0, 1), e = (I + A A^T)^(-1/2) (r - A xi): its squares sum to those of
        r and xi where xi is best, and its slopes give the information on the factors. Robust weights are within.
        """
        root = np.ones(len(self.r))
        if np.isfinite(threshold):
            root = np.sqrt(threshold / np.maximum(np.abs(self.r), threshold))
        e, J, spent = root * self.r, root[:, None] * self.by_factor, np.zeros(len(self.r))
        if not (self.nuisances.size or self.away.size) or not np.isfinite(e).all():
            return e, J, spent
        for run in range(len(self.problem.runs)):
            rows = self.rows(run)
            A, xi = self.unknown(run, rows, root)
            U, s, _ = np.linalg.svd(A, full_matrices=False)
            shrunk = U * (1 / np.sqrt(1 + s**2) - 1)
            own = e[rows] - A @ xi
            e[rows], J[rows] = own + shrunk @ (U.T @ own), J[rows] + shrunk @ (U.T @ J[rows])
            spent[rows] = (U**2) @ (s**2 / (1 + s**2))
        return e, J, spent

    def rows(self, run: int) -> slice:
        """Rows of a run, which lie together."""
        first, last = np.searchsorted(self.run, [run, run + 1])
        return slice(int(first), int(last))

    def unknown(self, run: int, rows: slice, root: Array) -> tuple[Array, Array]:
        """Slopes (rows, k) in a run's nuisances and initial states, times `root` (m,), and the values of those (k,)."""
        parts, xi = [self.by_nuisance[rows]], [self.nuisances[run]]
        if self.away.size:
            segments = np.unique(self.segment[rows])
            own = self.segment[rows][:, None] == segments  # (rows, segments)
            parts.append((own[:, :, None] * self.by_start[rows][:, None]).reshape(len(own), -1))
            xi.append(self.away[segments].ravel())
        return np.hstack(parts) * root[rows, None], np.concatenate(xi)

    def named(self) -> dict[str, dict[str, float]]:
        """Run -> nuisance -> value [SI]; initial states as differences from the measured ones."""
        problem, result = self.problem, dict[str, dict[str, float]]()
        values = problem.centres + problem.widths * self.nuisances
        for number, run in enumerate(problem.runs):
            result[run] = dict(zip(problem.names, values[number].tolist(), strict=True))
            own = [i for i, segment in enumerate(problem.segments) if segment.run == number] if self.away.size else []
            for place, i in enumerate(own):
                for name, away, size in zip(problem.model.node, self.away[i], problem.node_scale, strict=True):
                    key = f"initial_state.{name}" if len(own) == 1 else f"initial_state.{place + 1}.{name}"
                    result[run][key] = float(away * size * (problem.start_width or 0.0))
        return result


def predict(problem: Problem, factors: Array, nuisances: Array, away: Array | None = None) -> Prediction:
    """Run every prediction from its start.

    Parameters
    ----------
    nuisances : (R, nq) in prior widths. away : (S, nn) initial states less those of the log, in prior widths of
        `initial_state`; default, or where those are not free: none.
    """
    whole = problem.whole
    q = problem.centres + problem.widths * nuisances
    measured, slope = whole.begin(q)
    width, begun = problem.start_width or 0.0, measured
    if problem.start_width is None:
        away = np.zeros((0, 0))
    elif away is None:
        away = np.zeros_like(measured)
    if away.size:
        begun = measured + width * problem.node_scale * away
    evaluation = whole.evaluate(begun, factors, q)
    num_nodes, n, num_signals = len(problem.model.node), problem.num_factors, len(problem.layout.signals)
    keep = (whole.weight > 0).reshape(len(whole), -1)
    where, place = np.nonzero(keep)
    R = evaluation.R[keep]  # (m, nc)
    by_q, by_start = R[:, num_nodes + n :], R[:, :num_nodes]
    if by_q.size:
        with np.errstate(all="ignore"):
            by_q = (by_q + np.einsum("mi,mij->mj", by_start, slope[where])) * problem.widths
    return Prediction(
        problem=problem,
        factors=factors,
        nuisances=nuisances,
        away=away,
        r=evaluation.r[keep],
        by_factor=R[:, num_nodes : num_nodes + n],
        by_nuisance=by_q,
        by_start=by_start * (problem.node_scale * width) if away.size else by_start[:, :0],
        segment=where,
        run=whole.run[where],
        time=np.repeat(whole.time, num_signals, axis=1).reshape(len(whole), -1)[keep],
        signals=np.array(problem.layout.signals)[place % num_signals],
    )
