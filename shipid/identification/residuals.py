"""Weighted residuals of many predictions, and their exact derivatives to the unknowns, in one call of the engine.

The variational equations are compiled as C: each SIMD lane integrates one prediction, groups of lanes run on threads.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipid.data.checks import white_noise_of
from shipid.data.dataset import Array, Dataset, stretches_of_runs
from shipid.engine.libraries import NoLibrary
from shipid.engine.native import (
    C,
    StagedSource,
    compile_source,
    compiler_target,
    find_compiler,
    pack_lanes,
    refuse_compiling,
    step_statements,
)
from shipid.engine.printing import print_function
from shipid.engine.threads import run_tasks, threaded_source
from shipid.engine.vectors import CompilerTarget, vector_source
from shipid.errors import DataError, DocumentError, suggest_name
from shipid.identification.segments import ShootingSegment, cut_segments
from shipid.identification.sensitivities import FitLayout, Variation, build_variation, is_thrust, run_machine
from shipid.identification.settings import (
    BLOCK,
    ENVIRONMENT,
    MOVING,
    NUISANCES,
    Identify,
    Unknowns,
    free_factors,
    resolve_overrides,
)
from shipid.simulation.log import state_column
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

STAGES = (("fixed",), ("known",))  # once an interval; once a step
_ARRAYS = dict.fromkeys(("numbers", "inputs", "signals", "state", "records"), "double")


class _VariationSource(StagedSource):
    """C source of one variation: terms of parameters alone are computed once, terms of the inputs once per step."""

    def __init__(self, model: Variation) -> None:
        self.model = model
        self.all = [print_function(f, STAGES, C) for f in (model.rates, model.advance, model.outputs)]

    def main(self, number: int) -> str:
        """Body of function `number` (rates, advance, outputs): the part evaluated at every integrator stage."""
        printed = self.all[number]
        ends = [f"out[{i}] = {text};" for i, text in enumerate(printed.outputs)]
        return self.block(printed, (0, 1), [*printed.lines[2], *ends])

    def one_step(self) -> str:
        """C statements of one step, with the outputs after it."""
        num_z, num_m = self.model.rates.size1_in(0), self.model.rates.size1_in(1)
        layout, ends = self.model.layout, "saved0, saved1, {2});"
        lines, after, later = step_statements(
            num_z, num_m, f"rates({{0}}, {{1}}, {ends}", f"advance({{0}}, {{1!r}}, {ends}", layout.step, layout.method
        )
        lines.append(f"outputs({after}, {later}, saved0, saved1, seen, record);")
        lines.append(f"for (int i = 0; i < {num_z}; ++i) x[i] = {after}[i];")
        if layout.carried:
            lines.append(f"for (int i = 0; i < {num_m}; ++i) m[i] = {later}[i];")
        return "\n".join(lines)

    def text(self, wanted: CompilerTarget) -> str:
        """The complete C source for the target processor."""
        model = self.model
        num_z, num_m = model.rates.size1_in(0), model.rates.size1_in(1)
        fixed, known = model.rates.size1_in(2), model.rates.size1_in(3)
        seen, record = model.outputs.size1_in(3), model.outputs.size1_out(0)
        memory = f"x + {num_z}" if model.layout.carried else f"given + {known - num_m}"
        task = f"""V fixed[{max(1, fixed)}], given[{max(1, known)}], saved0[{self.total(0)}], saved1[{self.total(1)}];
V x[{model.size}];
const U *n = (const U *)numbers + number * {fixed};
for (int i = 0; i < {fixed}; ++i) fixed[i] = n[i];
const U *s = (const U *)state + number * {model.size};
for (int i = 0; i < {model.size}; ++i) x[i] = s[i];
stage0(fixed, saved0);
for (long k = number * steps; k < (number + 1) * steps; ++k) {{
  const U *now = (const U *)inputs + k * {known}, *seen = (const U *)signals + k * {seen};
  U *note = (U *)records + k * {record};
  for (int i = 0; i < {known}; ++i) given[i] = now[i];
  V *m = {memory}, record[{record}];
  stage1(given, saved0, saved1);
  {{ {self.one_step()} }}
  for (int i = 0; i < {record}; ++i) note[i] = record[i];
}}"""
        return f"""{vector_source(wanted)}
static void stage0(const V *fixed, V *saved) {{ {self.stage(0)} }}
static void stage1(const V *known, const V *saved0, V *saved) {{ {self.stage(1)} }}
static void rates(const V *z, const V *m, const V *saved0, const V *saved1, V *out) {{ {self.main(0)} }}
static void advance(const V *m, double step, const V *saved0, const V *saved1, V *out) {{
const V dt[1] = {{ K(step) }}; {self.main(1)} }}
static void outputs(const V *z, const V *m, const V *saved0, const V *saved1, const U *seen, V *out) {{
{self.main(2)} }}
{threaded_source(("steps",), _ARRAYS, task)}"""


@lru_cache(maxsize=32)
def _compile_variation(layout: FitLayout) -> Any:
    return compile_source(_VariationSource(build_variation(layout)).text(compiler_target()))


def run_compiled(layout: FitLayout, x: Array, fixed: Array, known: Array, seen: Array) -> Array:
    """Outputs (groups, lanes, N, .) of K predictions, by the compiled library.

    x : (K, size) initial states with their sensitivities. fixed : (K, .) constants of each prediction.
    known, seen : inputs and measured signals of each step, grouped by `pack_lanes`: (groups, N, ., lanes).
    """
    run, model = _compile_variation(layout), build_variation(layout)
    state, numbers = pack_lanes(x), pack_lanes(fixed)
    groups, num_steps = known.shape[:2]
    records = np.empty((groups, num_steps, model.outputs.size1_out(0), compiler_target().lanes))
    work = num_steps * model.size  # of one group
    run_tasks(run, (num_steps,), (numbers, known, seen, state, records), groups, work)
    return np.moveaxis(records, -1, 1)


MISSED = 0.02  # of speed, length and 1 rad: what a fitted model misses; 0.1 m/s and 0.2 deg/s at 5 m/s and 29 m
# Steps times entries of the sensitivities: below it CasADi's virtual machine is faster than compiling.
COMPILE_FROM = 4e4
CURRENT = ("V_c", "beta_c")  # channels that the nuisance of that name estimates
MOST_LATE = 4.0  # prior widths that a latency may reach


@dataclass(frozen=True, eq=False)
class Problem:
    """All data of one fit with R runs, P parameters, nq nuisances and ny signals.

    segments : by run. unknown : the factors to estimate. names, centres, widths : nuisances of a run, their fault-free
    values (nq,) and prior widths (nq,). start_width : of the initial states in standard deviations of the signals;
    None:
    they are not free. base : (R, P) parameters with the overrides of each run. deviations : (ny,) of the signals.
    sizes : of `typical_errors`.
    """

    vessel: Vessel
    runs: tuple[str, ...]
    settings: Identify
    unknown: Unknowns
    layout: FitLayout
    segments: tuple[ShootingSegment, ...]
    base: Array
    names: tuple[str, ...]
    centres: Array
    widths: Array
    start_width: float | None
    deviations: Array
    sizes: Mapping[str, float]

    @cached_property
    def model(self) -> Variation:
        """The variational equations of this fit, as CasADi functions."""
        return build_variation(self.layout)

    @cached_property
    def node_scale(self) -> Array:
        """(nn,) scale of each initial state: the signal's standard deviation where it is fitted, else `sizes`."""
        deviation_of = dict(zip(self.layout.signals, self.deviations, strict=True))
        return np.array([deviation_of.get(name, self.sizes.get(name, 1.0)) for name in self.model.node])

    @cached_property
    def whole(self) -> Predictions:
        """All predictions with their inputs, as arrays for the engine."""
        return Predictions(self)

    @property
    def num_factors(self) -> int:
        """Number of factors."""
        return len(self.unknown.groups)

    @cached_property
    def common(self) -> list[int]:
        """Places among the nuisances of those that are one for all runs: the last factors."""
        return [self.names.index(path) for path in self.unknown.paths if path in self.names]

    @property
    def common_width(self) -> float:
        """Width of the prior of what is one for all runs [SI]."""
        return self.unknown.scale[-1][0]

    def run_values(self, factors: Array, nuisances: Array) -> Array:
        """Nuisances (R, nq) [SI] of factors (n,) and nuisances (R, nq) in prior widths."""
        values = self.centres + self.widths * nuisances
        values[:, self.common] += self.common_width * factors[len(self.layout.groups) :]
        return values

    def fixed(self, factors: Array, nuisances: Array) -> Array:
        """(R, .) inputs that are constant along each run: factors, nuisances, base parameters, scales."""
        count, own = len(self.runs), len(self.layout.groups)
        scale = np.concatenate([*map(np.array, self.unknown.scale[:own])])
        return np.hstack([np.tile(factors[:own], (count, 1)), nuisances, self.base, np.tile(scale, (count, 1))])


def build_problem(vessel: Vessel, dataset: Dataset, runs: Sequence[str], settings: Identify) -> Problem:
    """Assemble a fit of the vessel to the runs; DocumentError or DataError names what is missing or wrong."""
    if not runs:
        raise DataError("no run to fit: name at least one", path="runs")
    if len(set(runs)) < len(runs):
        raise DataError("a run is named twice: name each once", path="runs")
    sizes = typical_errors(vessel, dataset, runs)
    settings = settings.with_sizes(sizes)
    widths = settings.widths
    if "current" in widths and "current" not in vessel.document:
        vessel = vessel.with_values({"current.kind": "uniform"})
    if "thrust_scale" in widths and not any(map(is_thrust, vessel.parameters)):
        message = f"{vessel.name} has no thrust coefficient: leave it out"
        raise DocumentError(message, path=f"{BLOCK}.nuisance.thrust_scale")
    model, unknown = vessel_dynamics(vessel), free_factors(vessel, settings)
    _check_outputs(vessel, dataset, settings)
    overridden = resolve_overrides(settings, runs, vessel, model.environment, dataset.runs)
    scalars = {name: (centre, widths[key]) for key in widths for name, centre in NUISANCES[key].items()}
    groups = tuple(group for group in unknown.groups if group[0] not in scalars)
    scalars |= {path: (0.0, 0.0) for path in unknown.paths if path in scalars}  # one for all runs: a factor
    names = tuple(sorted(scalars, key=lambda name: name not in MOVING))
    lags = math.ceil(MOST_LATE * widths["latency"] / settings.step) if "latency" in widths else 0
    segments = cut_segments(vessel, dataset, runs, settings.step, settings.horizon, lags, overridden, settings.commands)
    _check_set_for_a_run(unknown, overridden, widths)
    given = {path.removeprefix(f"{ENVIRONMENT}.") for values in overridden.values() for path in values}
    given |= {name for one in segments for name in model.environment if np.any(one.columns.get(name, 0.0))}
    given -= set(CURRENT) if set(NUISANCES["current"]) & set(names) else set()
    return Problem(
        vessel=vessel,
        runs=tuple(runs),
        settings=settings,
        unknown=unknown,
        layout=FitLayout(
            model=model,
            groups=groups,
            signals=tuple(settings.signals),
            nuisances=names,
            weather=tuple(name for name in model.environment if name in given),
            lags=lags,
            step=settings.step,
            method=settings.method,
        ),
        segments=tuple(segments),
        base=np.array(
            [[overridden[run].get(path, value) for path, value in vessel.parameters.items()] for run in runs]
        ),
        names=names,
        centres=np.array([scalars[name][0] for name in names]),
        widths=np.array([scalars[name][1] for name in names]),
        start_width=widths.get("initial_state"),
        deviations=np.array(list(settings.signals.values())),
        sizes=sizes,
    )


def typical_errors(vessel: Vessel, dataset: Dataset, runs: Sequence[str]) -> dict[str, float]:
    """State -> typical error [SI] of its prediction, from its own noise in the runs and the ship's speed U.

    It is the root of white noise^2 + (`MISSED` x)^2, x being U for u, v, w, U / L for p, q, r, L for a position and 1
    for an angle.
    """
    rows = dataset.select(runs)
    speed = float(np.sqrt((rows.frame[["u", "v"]] ** 2).sum(axis=1).mean())) or 1.0
    length = vessel.length or speed / (float(np.sqrt((rows.frame["r"] ** 2).mean())) or 1.0)
    scale = dict.fromkeys(("u", "v", "w"), speed) | dict.fromkeys(("p", "q", "r"), speed / length)
    scale |= dict.fromkeys(("north", "east", "down"), length) | dict.fromkeys(("psi", "phi", "theta"), 1.0)
    stretches = [stretch for _, stretch in stretches_of_runs(rows)]
    series = {name: [stretch[name].to_numpy() for stretch in stretches] for name in scale if name in rows.frame}
    noise = dict.fromkeys(scale, 0.0) | {name: white_noise_of(*values) for name, values in series.items()}
    return {name: math.hypot(noise[name], MISSED * size) for name, size in scale.items()}


def _check_outputs(vessel: Vessel, dataset: Dataset, settings: Identify) -> None:
    """Raise DocumentError for an output that is fitted and that the vessel or the data lack."""
    for name in settings.outputs:
        predicted, path = vessel_dynamics(vessel).outputs, f"{BLOCK}.weights.{name}"
        if name not in predicted:
            lacks = "; a torque needs K_Q of the propeller" if name.endswith(".torque") else ""
            message = f"{vessel.name} predicts no {name}: {suggest_name(name, predicted)}{lacks}"
            raise DocumentError(message, path=path)
        if name not in dataset.outputs:
            message = f"was not measured; the data have {', '.join(dataset.outputs) or 'no output of a component'}"
            raise DataError(message, path=path)


def _check_set_for_a_run(
    unknown: Unknowns, overridden: Mapping[str, Mapping[str, float]], widths: Mapping[str, float]
) -> None:
    """Raise DocumentError for a value of a run that the fit estimates: a factor, or the current of each run."""
    remedies = {path: "is free in the fit and also set for a run: fix it" for group in unknown.groups for path in group}
    if "current" in widths:
        estimated = "is set for a run, and nuisance.current estimates it: leave that nuisance out"
        remedies |= {f"{ENVIRONMENT}.{name}": estimated for name in CURRENT}
    for run, values in overridden.items():
        for path in (path for path in values if path in remedies):
            message = f"{remedies[path]}, or remove the value of the run"
            raise DocumentError(message, path=f"{BLOCK}.runs.{run}.{path}")


class Predictions:
    """All S predictions of a fit as arrays for the engine; shorter predictions are padded with weight 0.

    run : (S,) index of the run. log : (S, columns) row of the log where each prediction begins.
    weight : (S, N, ny), 1 / standard deviation, or 0 without a measurement. time : (S, N) [s] of each residual.
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
        compiled = known.shape[0] * self.length * problem.model.size > COMPILE_FROM and find_compiler() is not None
        self.steps = known, seen
        self.packed = (pack_lanes(known), pack_lanes(seen)) if compiled else None

    def _log(self, segment: ShootingSegment) -> list[float]:
        columns = (segment.columns.get(state_column(name)) for name in self.problem.model.entries)
        values = [0.0 if column is None else float(column[0]) for column in columns]
        if self.problem.layout.carried:
            values += [float(segment.memory[name][0]) for name in self.problem.layout.model.memory]
        return values

    def _known(self, segment: ShootingSegment) -> Array:
        """Inputs (N, .) of every step: commands, weather, memories; the last are repeated up to the common length."""
        layout = self.problem.layout
        steps = np.minimum(np.arange(self.length), segment.num_steps - 1)
        columns = self._given(segment, steps)
        if not layout.carried:
            columns += [segment.memory[name][steps] for name in layout.model.memory]
        return np.array(columns).reshape(-1, self.length).T

    def _given(self, segment: ShootingSegment, at: NDArray[np.intp]) -> list[Array]:
        """Commands, with those before them, and weather, each (N,), at N rows of a segment."""
        layout = self.problem.layout
        commands = {
            name: np.concatenate([segment.earlier[name][::-1], segment.columns[name]]) for name in layout.model.commands
        }
        columns = [
            commands[name][at + layout.lags - j] for j in range(layout.lags + 1) for name in layout.model.commands
        ]
        still = np.zeros_like(segment.t)
        return columns + [segment.columns.get(name, still)[at] for name in layout.weather]

    def _seen(self, segment: ShootingSegment) -> tuple[Array, Array, Array]:
        """Measured signals beside their weights (N, 2 ny), the weights, and the times (N,)."""
        layout, steps = self.problem.layout, 1 + np.arange(self.length)
        at = np.minimum(steps, segment.num_steps)
        weight = ((steps <= segment.num_steps) & segment.measured[at])[:, None] / self.problem.deviations
        y = np.array([segment.columns[name][at] for name in layout.signals]).T
        now = self._given(segment, at) if layout.outputs else []
        seen = np.hstack([y, weight, np.array(now).reshape(-1, self.length).T])
        return seen, weight, segment.t[0] + layout.step * steps

    def _run(self, x: Array, fixed: Array) -> Array:
        """Outputs of all predictions by the compiled library, or by CasADi where they are few or it cannot be made."""
        if self.packed is not None:
            try:
                return run_compiled(self.problem.layout, x, fixed, *self.packed)
            except NoLibrary as error:
                refuse_compiling(error.message)
                self.packed = None
        return run_machine(self.problem.layout, x, fixed, *self.steps)

    def begin(self, nuisances: Array) -> tuple[Array, Array]:
        """Initial states (S, nn) from the log, and their derivatives (S, nn, nq) to the nuisances (R, nq) [SI]."""
        model, count = self.problem.model, len(self.run)
        entries, states, q = model.begin.size1_in(0), len(model.states), nuisances[self.run]
        nodes = np.array(model.begin.map(count)(self.log[:, :entries].T, q.T)).T
        slope = np.zeros((count, len(model.node), q.shape[1]))
        if q.shape[1]:
            slopes = np.array(model.begin_slope.map(count)(self.log[:, :entries].T, q.T))
            slope[:, :states] = slopes.reshape(states, count, -1).transpose(1, 0, 2)
        return np.hstack([nodes, self.log[:, entries:]]), slope

    def evaluate(self, nodes: Array, factors: Array, nuisances: Array) -> tuple[Array, Array]:
        """Weighted residuals (S, N ny) of all predictions; where one diverges they are not finite.

        And their derivatives (S, N ny, nc) to initial state, factors and nuisances.

        nodes : (S, nn) initial states. factors : (n,). nuisances : (R, nq) [SI].
        """
        model, count = self.problem.model, len(self.run)
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
            record = self._run(x, fixed)
        r = record[..., :num_signals].reshape(-1, self.length * num_signals)[:count]
        R = record[..., num_signals:].reshape(*record.shape[:3], -1, num_signals).swapaxes(3, 4)
        return r, R.reshape(-1, r.shape[1], R.shape[4])[:count]


@dataclass(frozen=True, eq=False)
class ResidualPrediction:
    """Residuals of all predictions with their derivatives.

    factors : (n,). nuisances : (R, nq) in prior widths. away : (S, nn) initial states minus the measured ones, in prior
        widths; empty if the initial states are not free.
    r : (m,) weighted residuals. by_factor (m, n), by_nuisance (m, nq), by_start (m, nn) : their derivatives.
    segment, run, time, signals : (m,) prediction, run, time [s] and column of each residual.
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

    def within(self, threshold: float) -> dict[str, float]:
        """Signal -> share of its residuals up to the threshold of the Huber loss; at least that of one residual."""
        small = np.abs(self.r) <= threshold
        selected = {name: self.signals == name for name in self.problem.layout.signals}
        return {name: max(float(small[at].mean()), 1 / at.sum()) for name, at in selected.items() if at.any()}

    def marginal(self, threshold: float = np.inf) -> tuple[Array, Array, Array]:
        """Marginal residuals (m,), their Jacobian (m, n), and the leverage (m,) of the nuisances.

        With A the derivatives to the nuisances xi ~ N(0, 1), e = (I + A A^T)^(-1/2) (r - A xi). At the optimum of xi
        its sum of squares is that of r and xi, and its Jacobian gives the Fisher information of the factors.

        With the Huber loss r is psi / sqrt(p) here, psi = r up to the threshold and constant beyond it, p the share of
        the signal that is `within`, and derivatives are times sqrt(p): then information is that of Huber's covariance,
        (J^T J)^-1 E[psi^2] / p^2 (Huber, Robust Statistics (1981), sec. 7.6).

        threshold : of the Huber loss, in standard deviations.
        """
        e, root = self.r, np.ones(len(self.r))
        if np.isfinite(threshold):
            shares = self.within(threshold)
            root = np.sqrt(np.array([shares[name] for name in self.signals.tolist()]))
            e = np.clip(self.r, -threshold, threshold) / root
        e, J, spent = np.array(e), root[:, None] * self.by_factor, np.zeros(len(self.r))
        if not (self.nuisances.size or self.away.size) or not np.isfinite(e).all():
            return e, J, spent
        for run in range(len(self.problem.runs)):
            rows = self.rows(run)
            A, xi = self.unknown(run, rows, root)
            U, s, _ = np.linalg.svd(A, full_matrices=False)
            shrunk = U * (1 / np.sqrt(1 + s**2) - 1)
            remaining = e[rows] - A @ xi
            e[rows], J[rows] = remaining + shrunk @ (U.T @ remaining), J[rows] + shrunk @ (U.T @ J[rows])
            spent[rows] = (U**2) @ (s**2 / (1 + s**2))
        return e, J, spent

    def rows(self, run: int) -> slice:
        """Slice of the residuals of a run, which are contiguous."""
        first, last = np.searchsorted(self.run, [run, run + 1])
        return slice(int(first), int(last))

    def unknown(self, run: int, rows: slice, root: Array) -> tuple[Array, Array]:
        """Derivatives (rows, k) to a run's nuisances and initial states, times `root` (m,), and their values (k,)."""
        parts, xi = [self.by_nuisance[rows]], [self.nuisances[run]]
        if self.away.size:
            segments = np.flatnonzero(self.problem.whole.run == run)  # one without a measured row stays at 0
            belongs = self.segment[rows][:, None] == segments  # (rows, segments)
            parts.append((belongs[:, :, None] * self.by_start[rows][:, None]).reshape(len(belongs), -1))
            xi.append(self.away[segments].ravel())
        return np.hstack(parts) * root[rows, None], np.concatenate(xi)

    def named(self) -> dict[str, dict[str, float]]:
        """Run -> nuisance -> estimate [SI]; initial states as differences from the measured ones."""
        problem, result = self.problem, dict[str, dict[str, float]]()
        values = problem.run_values(self.factors, self.nuisances)
        for number, run in enumerate(problem.runs):
            result[run] = dict(zip(problem.names, values[number].tolist(), strict=True))
            places = (
                [i for i, segment in enumerate(problem.segments) if segment.run == number] if self.away.size else []
            )
            for place, i in enumerate(places):
                for name, away, size in zip(problem.model.node, self.away[i], problem.node_scale, strict=True):
                    key = f"initial_state.{name}" if len(places) == 1 else f"initial_state.{place + 1}.{name}"
                    result[run][key] = float(away * size * (problem.start_width or 0.0))
        return result


def predict_residuals(
    problem: Problem, factors: Array, nuisances: Array, away: Array | None = None
) -> ResidualPrediction:
    """Run all predictions of a fit.

    factors : (n,). nuisances : (R, nq) in prior widths.
    away : (S, nn) initial states minus those of the log, in prior widths of `initial_state`; default: 0.
    """
    whole = problem.whole
    q = problem.run_values(factors, nuisances)
    measured, slope = whole.begin(q)
    width, begun = problem.start_width or 0.0, measured
    if problem.start_width is None:
        away = np.zeros((0, 0))
    elif away is None:
        away = np.zeros_like(measured)
    if away.size:
        begun = measured + width * problem.node_scale * away
    r, slopes = whole.evaluate(begun, factors, q)
    num_nodes, n, num_signals = len(problem.model.node), len(problem.layout.groups), len(problem.layout.signals)
    keep = (whole.weight > 0).reshape(len(whole.run), -1)
    where, place = np.nonzero(keep)
    R = slopes[keep]  # (m, nc)
    by_q, by_start = R[:, num_nodes + n :], R[:, :num_nodes]
    if by_q.size:
        with np.errstate(all="ignore"):
            by_q = by_q + np.einsum("mi,mij->mj", by_start, slope[where])
    return ResidualPrediction(
        problem=problem,
        factors=factors,
        nuisances=nuisances,
        away=away,
        r=r[keep],
        by_factor=np.hstack([R[:, num_nodes : num_nodes + n], problem.common_width * by_q[:, problem.common]]),
        by_nuisance=by_q * problem.widths,
        by_start=by_start * (problem.node_scale * width) if away.size else by_start[:, :0],
        segment=where,
        run=whole.run[where],
        time=np.repeat(whole.time, num_signals, axis=1).reshape(len(whole.run), -1)[keep],
        signals=np.array(problem.layout.signals)[place % num_signals],
    )
