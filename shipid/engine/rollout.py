"""Rollouts: simulations of many samples by many variants of a vessel, on any engine.

The integrator is written once, for `rates` and `advance`. With a C compiler it runs as C on SIMD vectors; otherwise
CasADi runs it sample by sample, or PyTorch in batches. The results of all engines are equal up to rounding.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from shipid.arguments import as_float_array, as_names, check_choice, check_class, check_mapping, check_whole_number
from shipid.engine.engines import REPEATED, Engine, choose_engine, engine_by_name, run_with_fallback
from shipid.engine.integrate import Array, Method, RolloutBatch, RolloutJob
from shipid.errors import DataError, ShipidError, suggest_name
from shipid.metrics import position_error, tally_errors
from shipid.notebooks import NotebookView
from shipid.physics.helm import Helmsman
from shipid.physics.signals import ACTUAL, is_command, signal_row
from shipid.vessel.dynamics import HELM, Dynamics, vessel_dynamics
from shipid.vessel.load import Vessel

log = logging.getLogger(__name__)
MOST_STEPS = 10**12
SPEED_LIMIT = 100.0  # m/s: beyond any ship; a faster sample has diverged
PATHS_KEPT = 4_000_000  # numbers of north and east that are kept at a time where an engine cannot measure on its way


@dataclass(frozen=True, eq=False, repr=False)
class Trajectories(NotebookView, shown=("names", "states", "interval")):
    """Result of a rollout.

    u, v and r are along the axes of the ship; those of a log are horizontal, see `horizontal_velocities`.

    states : (num_records, num_variants, num_samples, num_channels), SI; channels named by `names`.
    diverged : (num_variants, num_samples): an input or a record is not finite, or a speed is above 100 m/s. Others are
        unharmed.
    interval : time between records [s].
    """

    states: Array = field(repr=False)
    names: tuple[str, ...]
    diverged: Array = field(repr=False)
    interval: float

    def __getitem__(self, name: str) -> Array:
        """One channel, (num_records, num_variants, num_samples); ShipidError for one that was not recorded."""
        if not isinstance(name, str) or name not in self.names:
            raise ShipidError(f"no channel {name!r} was recorded: {suggest_name(name, self.names)}")
        return self.states[..., self.names.index(name)]


def rollout(
    vessel: Vessel,
    start: Mapping[str, Array],
    commands: Mapping[str, Array],
    environment: Mapping[str, Array] | None = None,
    *,
    step: float,
    num_steps: int,
    method: Method = "euler",
    every: int = 1,
    parameters: Array | None = None,
    memory: Mapping[str, Array] | None = None,
    tau_extra: Array | None = None,
    components: Mapping[str, Array] | None = None,
    helmsman: Helmsman | None = None,
    keep: Sequence[str] | None = None,
    engine: str = "auto",
    device: str = "cpu",
) -> Trajectories:
    """Open-loop prediction of many samples by many variants of one vessel structure.

    start : state name -> (S,), SI; names that the vessel does not have are passed over, missing ones raise DataError.
    commands, environment : name -> (S,) held over the horizon, or (num_steps, S) in force from step to step.
    step, num_steps, every : step [s], number of steps, and one record every so many steps (the start is a record).
    parameters : (V, P) in the order of `vessel.parameters`; one row for each variant. A DataFrame, a Series or a dict
        with dotted paths is read by these. Default: the numbers of the vessel.
    memory : hidden state -> (S,); default: each actuator has reached its first order.
    tau_extra : (n_dof,), (S, n_dof) or (num_steps, S, n_dof) extra force [N, N m]; zero by default.
    components : path of a term whose components are drawn (`waves.first_order`) -> (S, num_components, num_entries), as
        from `shipid.simulation.weather`; default: none, calm water.
    helmsman : control law that gives the orders; `commands` are then its inputs; see `shipid.physics.helm`.
    keep : channels to record, default all states and memories.
    engine : of `ENGINES`, or `auto`: by size and by what there is; `repeated` is `auto` where so many calls follow that
        compiling pays. `single` counts a northing of 6,500 km in steps of 0.5 m.
    device : a PyTorch device; the engines `native` and `casadi` are for the CPU.

    DataError for an input that is missing, ShipidError for one that does not fit or is not known.
    """
    asked = engine_by_name(engine, device)
    num_steps, every = check_whole_number("num_steps", num_steps, 1), check_whole_number("every", every, 1)
    if num_steps % every:
        raise ShipidError(f"num_steps must be a multiple of every, not {num_steps} and {every}")
    if num_steps > MOST_STEPS:
        raise ShipidError(f"{num_steps:.2g} steps, at most {MOST_STEPS:.0e}: give a longer step, or a shorter time")
    given = start, commands, {} if environment is None else environment, {} if components is None else components
    model, batch = prepare_batch(vessel, *given, num_steps, parameters, memory, tau_extra, helmsman)
    _check_channel_names("environment", environment, model.environment, vessel)
    _check_channel_names("commands", commands, model.commands, vessel)
    _warn_of_units(model.commands, batch.commands)
    names = channel_names(model)
    kept = names if keep is None else as_names("keep", keep)
    job = RolloutJob(step, num_steps, method, every, channel_places(kept, names, vessel), device)
    with np.errstate(all="ignore"):
        records, diverged = run_with_fallback(
            asked,
            lambda: choose_engine(batch, job, engine == REPEATED),
            lambda way: _with_divergence(way, batch, *way.run(model, batch, job)),
        )
    return Trajectories(records, kept, diverged, step * every)


def _with_divergence(way: Engine, batch: RolloutBatch, *results: Array) -> tuple[Array, ...]:
    """Results of an engine, with whether each (variant, sample) has diverged in place of its greatest speed."""
    *kept, worst = results
    slow = worst <= SPEED_LIMIT
    return *kept, ~(slow if way.checks else slow & finite_samples(batch))


def _check_channel_names(what: str, given: object, names: Sequence[str], vessel: Vessel) -> None:
    """Raise ShipidError for a name in a dict that is neither of the vessel nor of any signal; a table may have more.

    A command belongs to a component of one vessel, so a command that this vessel lacks is an error, too.
    """
    odd = [] if not isinstance(given, Mapping) else [str(name) for name in given if name not in names]
    commands = what == "commands"
    unknown = next((name for name in odd if signal_row(name) is None or (commands and is_command(name))), None)
    if unknown is not None:
        raise ShipidError(f"{what}: {vessel.name} has no {unknown!r}: {suggest_name(unknown, names)}")


def _warn_of_units(names: Sequence[str], commands: Array) -> None:
    """Warn of a command (T, channel, S) beyond what is plausible: it was probably meant in another unit than SI."""
    for name, values in zip(names, commands.swapaxes(0, 1), strict=True):
        row, largest = signal_row(name), max(values.max(), -values.min())
        if row is not None and row.plausible is not None and largest > row.plausible:
            log.warning("command %s reaches %.4g %s: was %s meant?", name, largest, row.unit, row.read_in)


@dataclass(frozen=True)
class Distances:
    """Distances of variants to true paths, without the predicted paths.

    total : (V, S) sum [m] over the steps of the distance to the true path.
    tally : (V, BINS) how often each distance occurs, see `shipid.metrics.tally_errors`.
    diverged : (V, S) as in `Trajectories`.
    """

    total: Array
    tally: Array
    diverged: Array


def rollout_distances(
    vessel: Vessel,
    start: Mapping[str, Array],
    commands: Mapping[str, Array],
    environment: Mapping[str, Array],
    goal: Array,
    *,
    step: float,
    method: Method = "euler",
    parameters: Array | None = None,
    memory: Mapping[str, Array] | None = None,
    engine: str = "auto",
    device: str = "cpu",
) -> Distances:
    """Distances of variants to true positions `goal` (T, S, 2) [m] north and east after each of T steps.

    For the other arguments see `rollout`. The native engine keeps no path, others those of a few variants at a time.
    """
    num_steps = len(goal)
    asked = engine_by_name(engine, device)
    if num_steps < 1:
        raise ShipidError("goal holds no step: give one position or more for each sample")
    model, batch = prepare_batch(vessel, start, commands, environment, {}, num_steps, parameters, memory, None, None)
    rows = model.state.index("north"), model.state.index("east")
    job = RolloutJob(step, num_steps, method, 1, rows, device)
    return run_with_fallback(
        asked,
        lambda: choose_engine(batch, job, engine == REPEATED),
        lambda way: _distances_of_engine(way, model, batch, job, goal),
    )


def _distances_of_engine(way: Engine, model: Dynamics, batch: RolloutBatch, job: RolloutJob, goal: Array) -> Distances:
    """Distances by one engine."""
    if way.measure is not None:
        return Distances(*_with_divergence(way, batch, *way.measure(model, batch, job, goal.transpose(0, 2, 1))))
    few = max(1, PATHS_KEPT // goal.size)
    measured = []
    for first in range(0, len(batch.parameters), few):
        part = replace(batch, parameters=batch.parameters[first : first + few])
        with np.errstate(all="ignore"):
            records, diverged = _with_divergence(way, part, *way.run(model, part, job))
            apart = [position_error(records[1:, v], goal) for v in range(records.shape[1])]
        measured.append(
            (np.array([errors.sum(axis=0) for errors in apart]), np.array(list(map(tally_errors, apart))), diverged)
        )
    return Distances(*(np.concatenate(parts) for parts in zip(*measured, strict=True)))


def prepare_batch(
    vessel: Vessel,
    start: Mapping[str, Array],
    commands: Mapping[str, Array],
    environment: Mapping[str, Array],
    components: Mapping[str, Array],
    num_steps: int,
    parameters: Array | None,
    memory: Mapping[str, Array] | None,
    tau_extra: Array | None,
    helmsman: Helmsman | None,
) -> tuple[Dynamics, RolloutBatch]:
    """Equations, and inputs as a `RolloutBatch`; DataError or ShipidError for a missing input or a wrong shape."""
    given = {"start": start, "commands": commands, "environment": environment, "components": components}
    for name, value in (given if memory is None else {**given, "memory": memory}).items():
        check_mapping(name, value, "a name to an array")
    if helmsman is not None:
        check_class("helmsman", helmsman, Helmsman, "as of `Manoeuvre.helmsman`")
    model = vessel_dynamics(vessel, helmsman)
    first = next((name for name in model.state if name in start), None)
    if first is None:
        raise DataError(f"start holds no state; {vessel.name} needs {', '.join(model.state)}")
    shape = np.shape(start[first])
    if len(shape) != 1:
        raise ShipidError(f"state {first!r} must be (S,), a value for each of S samples, not {shape}")
    num_samples = shape[0]
    if num_samples == 0:
        raise ShipidError("a rollout needs at least one sample")
    values = _variant_numbers(vessel, model.parameters, parameters)
    begun = {**dict.fromkeys(model.hidden, np.zeros(num_samples)), **start}
    batch = RolloutBatch(
        state=_stack_channels((*model.state, *model.hidden), begun, num_samples, num_steps, "state", vessel, held=True)[
            0
        ],
        memory=np.zeros((0, num_samples)),
        commands=_stack_channels(model.commands, commands, num_samples, num_steps, "command", vessel),
        environment=_stack_channels(model.environment, environment, num_samples, num_steps, "environment", vessel),
        tau_extra=_extra_force(tau_extra, model.num_dof, num_samples, num_steps),
        parameters=values,
        components=_drawn_components(model, components, num_samples),
    )
    return model, replace(batch, memory=_initial_memory(model, memory, batch, num_steps, vessel))


def channel_names(model: Dynamics) -> tuple[str, ...]:
    """Names of all channels that a rollout can record: states, states of terms, actuator states (`actual.port.n`)."""
    return (*model.state, *model.hidden, *(f"{ACTUAL}{name}" for name in model.memory))


def channel_places(kept: Sequence[str], names: Sequence[str], vessel: Vessel) -> tuple[int, ...]:
    """Indices of the channels to keep in `names`; ShipidError for an unknown channel."""
    for name in kept:
        check_choice(f"keep, of {vessel.name}:", name, names)
    return tuple(names.index(name) for name in kept)


def finite_samples(batch: RolloutBatch) -> Array:
    """Whether every input of a (variant, sample) is a number: fmin and fmax may hide a NaN in CasADi."""
    drawn = (part.swapaxes(1, 2) for part in batch.components)
    inputs = (batch.state, batch.memory, batch.commands, batch.environment, batch.tau_extra, *drawn)
    samples = np.all([np.isfinite(array).all(axis=tuple(range(array.ndim - 1))) for array in inputs], axis=0)
    return np.asarray(np.isfinite(batch.parameters).all(axis=1)[:, None] & samples)


def _variant_numbers(vessel: Vessel, names: Sequence[str], parameters: Any) -> Array:
    """Numbers (V, P) of the variants in the order of the names; what has labels is read by them."""
    if parameters is None:
        return np.array([list(vessel.parameters.values())])
    labels = parameters if isinstance(parameters, Mapping) else None
    if hasattr(parameters, "to_numpy"):  # pandas, which the engine does not import
        labels = getattr(parameters, "columns", getattr(parameters, "index", None))
    if labels is not None and any(isinstance(label, str) for label in labels):
        absent = next((name for name in names if name not in labels), None)
        odd = next((label for label in labels if label not in names), None)
        if absent is not None or odd is not None:
            what = f"lack {absent!r}" if odd is None else f"hold {odd!r}, {suggest_name(odd, names)}"
            raise ShipidError(f"parameters {what}: give every parameter of {vessel.name}, and no other")
        parameters = np.stack([as_float_array(f"parameter {name!r}", parameters[name]) for name in names], axis=-1)
    values = np.atleast_2d(as_float_array("parameters", parameters))
    if values.ndim != 2 or values.shape[1] != len(names) or not len(values):
        raise ShipidError(f"parameters must be (variants, {len(names)}), not {values.shape}")
    return np.ascontiguousarray(values)


def _stack_channels(
    names: Sequence[str],
    given: Mapping[str, Array],
    num_samples: int,
    num_steps: int,
    what: str,
    vessel: Vessel,
    *,
    held: bool = False,
) -> Array:
    """Named arrays as (T, channel, S), T = 1 when all are held; a missing name says which vessel needs it."""
    shapes = [(num_samples,)] if held else [(num_samples,), (num_steps, num_samples)]
    columns = []
    for name in names:
        if name not in given:
            raise DataError(
                f"{what} {name!r} is needed by {vessel.name} and missing: give an array {shapes[0]}", file=vessel.file
            )
        column = as_float_array(f"{what} {name!r}", given[name])
        if column.shape not in shapes:
            raise ShipidError(f"{what} {name!r} must be {' or '.join(map(str, shapes))}: {column.shape}")
        columns.append(column)
    length = num_steps if any(column.ndim == 2 for column in columns) else 1
    stacked = np.empty((length, len(columns), num_samples))
    for i, column in enumerate(columns):
        stacked[:, i] = column
    return stacked


def _initial_memory(
    model: Dynamics, memory: Mapping[str, Array] | None, batch: RolloutBatch, num_steps: int, vessel: Vessel
) -> Array:
    """Memories (nm, S) at the start: as given, or the initial values of the helmsman and the first orders."""
    num_samples = batch.state.shape[1]
    begun = model.helmsman.memory if model.helmsman else {}
    helm = {f"{HELM}.{name}": np.full(num_samples, float(value)) for name, value in begun.items()}
    if memory is not None:
        return np.asarray(
            _stack_channels(
                tuple(model.memory), {**helm, **memory}, num_samples, num_steps, "memory", vessel, held=True
            )[0]
        )
    if model.helmsman is None:
        return np.asarray(batch.commands[0, [model.commands.index(name) for name in model.memory]])
    unknown = np.zeros((len(model.memory) - len(helm), num_samples))
    known = np.concatenate([np.array(list(helm.values())).reshape(-1, num_samples), unknown])
    inputs = (batch.state, known, batch.commands[0], batch.environment[0], batch.parameters[:1].T)
    orders = dict(zip(model.ordered, np.array(model.orders.map(num_samples)(*inputs)), strict=True))
    return np.array([helm[name] if name in helm else orders[name] for name in model.memory]).reshape(-1, num_samples)


def _drawn_components(model: Dynamics, given: Mapping[str, Array], num_samples: int) -> tuple[Array, ...]:
    """Components (num_entries, S, num_components) of each sum with drawn components; zeros if none are given."""
    result, paths = [], [term.path for term in model.drawn]
    for path in given:
        check_choice("components: a term whose components are drawn,", path, paths)
    for term in model.drawn:
        entries = sum(term.widths.values())
        values = as_float_array(f"components of {term.path}", given.get(term.path, np.zeros((num_samples, 1, entries))))
        if values.ndim != 3 or values.shape[::2] != (num_samples, entries):
            raise ShipidError(
                f"components of {term.path} must be ({num_samples}, count, {entries}), not {values.shape}"
            )
        result.append(np.ascontiguousarray(values.transpose(2, 0, 1)))
    return tuple(result)


def _extra_force(tau_extra: Array | None, num_dof: int, num_samples: int, num_steps: int) -> Array:
    if tau_extra is None:
        return np.zeros((1, num_dof, num_samples))
    tau = as_float_array("tau_extra", tau_extra)
    length = num_steps if tau.ndim == 3 else 1
    widest = (num_steps, num_samples, num_dof)[-tau.ndim :] if 1 <= tau.ndim <= 3 else ()
    if tau.shape[-1:] != (num_dof,) or any(size not in (1, most) for size, most in zip(tau.shape, widest, strict=True)):
        shapes = f"({num_dof},), ({num_samples}, {num_dof}) or ({num_steps}, {num_samples}, {num_dof})"
        raise ShipidError(f"tau_extra must be {shapes}, not {tau.shape}")
    return np.ascontiguousarray(np.broadcast_to(tau, (length, num_samples, num_dof)).transpose(0, 2, 1))
