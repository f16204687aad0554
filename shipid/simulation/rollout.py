"""Rollouts: one step rule, many ways to run it.

The integrator is written once, over `rates` and `advance`; CasADi runs it sample by sample (long simulations, few
samples), PyTorch runs it over whole batches (many windows, many variants). Both give the same numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import casadi as ca
import numpy as np

from shipid.errors import DataError, ShipidError, choices
from shipid.vessel.dynamics import Dynamics, dynamics
from shipid.vessel.load import Vessel

Array = np.ndarray
Method = Literal["euler", "rk4"]
Engine = Literal["auto", "casadi", "torch", "compiled"]

SPEED_LIMIT = 100.0  # m/s: no ship, so the member has diverged
COMPILE_FROM = 5e8  # rate evaluations: below it a compilation costs more than it saves
BATCH_FROM = 2048  # samples x variants: below it CasADi beats one tensor operation an instruction


@dataclass(frozen=True)
class Trajectories:
    """What a rollout returns.

    states : (num_records, num_variants, num_samples, num_channels), SI; channels named by `names`.
    diverged : (num_variants, num_samples): an input or a record is not finite, or a speed is above 100 m/s. Others are
        unharmed.
    interval : time between records [s].
    """

    states: Array
    names: tuple[str, ...]
    diverged: Array
    interval: float

    def __getitem__(self, name: str) -> Array:
        """One channel, (num_records, num_variants, num_samples)."""
        return self.states[..., self.names.index(name)]


@dataclass(frozen=True)
class Batch:
    """Inputs of a rollout as plain arrays, channel first: the layout that both engines share.

    state (nx, S), memory (nm, S), commands (T, nc, S), environment (T, ne, S), tau_extra (T, n_dof, S) with T = 1 when
    held over the horizon, parameters (V, P).
    """

    state: Array
    memory: Array
    commands: Array
    environment: Array
    tau_extra: Array
    parameters: Array


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
    keep: Sequence[str] | None = None,
    engine: Engine = "auto",
    device: str = "cpu",
) -> Trajectories:
    """Open-loop prediction of many samples by many variants of one vessel structure.

    Parameters
    ----------
    start : state name -> (S,), SI; names that the vessel does not have are ignored, missing ones raise DataError.
    commands, environment : name -> (S,) held over the horizon, or (num_steps, S) in force from step to step.
    step, num_steps, every : step [s], number of steps, and one record every so many steps (the start is a record).
    parameters : (V, P) in the order of `vessel.parameters`; one row for each variant. Default: the vessel's own.
    memory : hidden state -> (S,); default: each actuator has reached its first command.
    tau_extra : (n_dof,), (S, n_dof) or (num_steps, S, n_dof) extra force [N, N m]; zero by default.
    keep : channels to record, default all states and memories.
    engine : `casadi`, `torch` (eager), `compiled` (torch.compile), or by size.
    """
    model = dynamics(vessel)
    num_samples = len(next(iter(start.values())))
    values = np.array([list(vessel.parameters.values())]) if parameters is None else np.atleast_2d(parameters)
    if values.shape[1] != len(model.parameters):
        raise ShipidError(f"parameters must be (variants, {len(model.parameters)}), found {values.shape}")
    command_array = _channels(model.commands, commands, num_samples, num_steps, "command", vessel)
    batch = Batch(
        state=_channels(model.state, start, num_samples, num_steps, "state", vessel)[0],
        memory=_memory(model, memory, command_array, num_samples, num_steps, vessel),
        commands=command_array,
        environment=_channels(model.environment, environment or {}, num_samples, num_steps, "environment", vessel),
        tau_extra=_tau(tau_extra, model.num_dof, num_samples, num_steps),
        parameters=values,
    )
    names = (*model.state, *(f"actual.{name}" for name in model.memory))
    kept = tuple(names if keep is None else keep)
    rows = [names.index(name) for name in kept]
    if num_steps % every:
        raise ShipidError(f"num_steps must be a multiple of every, found {num_steps} and {every}")
    work = num_steps * num_samples * len(values) * (4 if method == "rk4" else 1)
    chosen = _by_size(work, num_samples * len(values)) if engine == "auto" else engine
    with np.errstate(all="ignore"):
        if chosen == "casadi":
            records, worst = _run_casadi(model, batch, step, num_steps, method, every, rows)
        else:
            from shipid.simulation.lowering import run_torch

            records, worst = run_torch(model, batch, step, num_steps, method, every, rows, chosen == "compiled", device)
    diverged = ~(worst <= SPEED_LIMIT) | ~_finite(batch)
    return Trajectories(records, kept, diverged, step * every)


def integrate(
    rates: Callable[[Any, Any], Any],
    advance: Callable[[Any, float], Any],
    add: Callable[[Any, float, Any], Any],
    state: Any,
    memory: Any,
    step: float,
    method: Method,
) -> tuple[Any, Any]:
    """One step of explicit Euler or classical RK4; `add(x, a, k)` is x + a k in the arithmetic at hand.

    Memories advance exactly: the stages of RK4 see them at their own time, so it keeps its order with held commands.
    """
    if method == "euler":
        return add(state, step, rates(state, memory)), advance(memory, step)
    half, full = advance(memory, step / 2), advance(memory, step)
    k1 = rates(state, memory)
    k2 = rates(add(state, step / 2, k1), half)
    k3 = rates(add(state, step / 2, k2), half)
    k4 = rates(add(state, step, k3), full)
    for weight, slope in ((1, k1), (2, k2), (2, k3), (1, k4)):
        state = add(state, step * weight / 6, slope)
    return state, full


def _finite(batch: Batch) -> Array:
    """Whether every input of a (variant, sample) is a number: fmin and fmax may hide a NaN in CasADi."""
    inputs = (batch.state, batch.memory, batch.commands, batch.environment, batch.tau_extra)
    samples = np.all([np.isfinite(array).all(axis=tuple(range(array.ndim - 1))) for array in inputs], axis=0)
    return np.asarray(np.isfinite(batch.parameters).all(axis=1)[:, None] & samples)


def _by_size(work: float, width: int) -> Engine:
    if width < BATCH_FROM:
        return "casadi"
    return "compiled" if work > COMPILE_FROM and _has_compiler() else "torch"


@lru_cache
def _has_compiler() -> bool:
    import shutil

    return any(shutil.which(name) for name in ("g++", "clang++", "c++"))


def _channels(
    names: Sequence[str], given: Mapping[str, Array], num_samples: int, num_steps: int, what: str, vessel: Vessel
) -> Array:
    """Named arrays as (T, channel, S), T = 1 when all are held; a missing name says which vessel needs it."""
    columns = []
    for name in names:
        if name not in given:
            raise DataError(
                f"{what} {name!r} is needed by {vessel.name} and missing: {choices(name, given)}", file=vessel.file
            )
        column = np.asarray(given[name], dtype=float)
        if column.shape not in ((num_samples,), (num_steps, num_samples)):
            raise ShipidError(
                f"{what} {name!r} must be ({num_samples},) or ({num_steps}, {num_samples}): {column.shape}"
            )
        columns.append(np.atleast_2d(column))
    length = max((len(column) for column in columns), default=1)
    stacked = [np.broadcast_to(column, (length, num_samples)) for column in columns]
    return np.stack(stacked, axis=1) if stacked else np.zeros((1, 0, num_samples))


def _memory(
    model: Dynamics,
    memory: Mapping[str, Array] | None,
    commands: Array,
    num_samples: int,
    num_steps: int,
    vessel: Vessel,
) -> Array:
    if memory is None:
        return np.asarray(commands[0, [model.commands.index(name) for name in model.memory]])
    return np.asarray(_channels(tuple(model.memory), memory, num_samples, num_steps, "memory", vessel)[0])


def _tau(tau_extra: Array | None, num_dof: int, num_samples: int, num_steps: int) -> Array:
    if tau_extra is None:
        return np.zeros((1, num_dof, num_samples))
    tau = np.asarray(tau_extra, dtype=float)
    length = num_steps if tau.ndim == 3 else 1
    return np.ascontiguousarray(np.broadcast_to(tau, (length, num_samples, num_dof)).transpose(0, 2, 1))


@lru_cache(maxsize=32)
def casadi_scan(model: Dynamics, step: float, num_steps: int, method: Method, every: int) -> ca.Function:
    """One sample: (state, memory, commands, environment, tau_extra, parameters) -> records, steps inside."""
    state, memory = ca.MX.sym("state", len(model.state)), ca.MX.sym("memory", len(model.memory))
    commands, environment = ca.MX.sym("commands", len(model.commands)), ca.MX.sym("environment", len(model.environment))
    tau, parameters = ca.MX.sym("tau", model.num_dof), ca.MX.sym("parameters", len(model.parameters))

    def rates(x: Any, m: Any) -> Any:
        total = tau
        for term in model.sums:
            mapped = term.function.map(len(term.arrays))
            columns = [ca.repmat(a, 1, len(term.arrays)) for a in (x, m, commands, environment, parameters)]
            total = total + ca.sum2(mapped(*columns, ca.DM(term.arrays.T)))
        return model.rates(x, m, commands, environment, parameters, total)

    def advance(m: Any, dt: float) -> Any:
        return model.advance(state, m, commands, environment, parameters, dt)

    after, memory_after = integrate(rates, advance, lambda x, a, k: x + a * k, state, memory, step, method)
    one = ca.Function(
        "step",
        [ca.vertcat(state, memory), commands, environment, tau, parameters],
        [ca.vertcat(after, memory_after)],
    )
    if every > 1:
        x, c = ca.MX.sym("x", one.size1_in(0)), ca.MX.sym("c", len(model.commands), every)
        e, t = ca.MX.sym("e", len(model.environment), every), ca.MX.sym("t", model.num_dof, every)
        inner = one.mapaccum(every)(x, c, e, t, ca.repmat(parameters, 1, every))
        one = ca.Function("steps", [x, c, e, t, parameters], [inner[:, -1]])
    count = num_steps // every
    x = ca.MX.sym("x", len(model.state) + len(model.memory))
    c, e = ca.MX.sym("c", len(model.commands), num_steps), ca.MX.sym("e", len(model.environment), num_steps)
    t = ca.MX.sym("t", model.num_dof, num_steps)
    path = one.mapaccum(count)(x, c, e, t, ca.repmat(parameters, 1, count))
    return ca.Function("rollout", [x, c, e, t, parameters], [path])


def _run_casadi(
    model: Dynamics, batch: Batch, step: float, num_steps: int, method: Method, every: int, rows: list[int]
) -> tuple[Array, Array]:
    """Records (R, V, S, C) and the greatest speed (V, S), sample by sample on CasADi's threads."""
    scan = casadi_scan(model, step, num_steps, method, every)
    num_samples, num_records = batch.state.shape[1], num_steps // every
    start = np.concatenate([batch.state, batch.memory])
    speed_rows = slice(model.num_dof, len(model.state))

    def over_time(held: Array) -> Array:  # (T, C, S) -> (C, S * num_steps), a sample's steps side by side
        full = np.broadcast_to(held, (num_steps, *held.shape[1:]))
        return full.transpose(1, 2, 0).reshape(held.shape[1], num_samples * num_steps)

    inputs = [start, over_time(batch.commands), over_time(batch.environment), over_time(batch.tau_extra)]
    mapped = scan.map(num_samples, "thread", min(2, num_samples))
    records, worst = [], []
    for values in batch.parameters:
        found = np.array(mapped(*inputs, np.tile(values[:, None], (1, num_samples))))
        path = found.reshape(len(start), num_samples, num_records).transpose(2, 1, 0)
        path = np.concatenate([start.T[None], path])
        records.append(path[:, :, rows])
        worst.append(np.abs(path[:, :, speed_rows]).max(axis=(0, 2)) + 0 * path.sum(axis=(0, 2)))
    return np.stack(records, axis=1), np.stack(worst)


def memory_along(vessel: Vessel, commands: Mapping[str, Array], t: Array) -> dict[str, Array] | None:
    """Hidden actuator states (n,) along one run's orders (n,) at the times t (n,) [s]; None if the vessel has none.

    The first order is taken as reached; each order is held until the next row. They are modelled, not measured.
    """
    model = dynamics(vessel)
    if not model.memory:
        return None
    orders = np.stack([np.asarray(commands[name], dtype=float) for name in model.commands])
    first = orders[[model.commands.index(name) for name in model.memory], 0]
    count = len(t) - 1
    if count == 0:
        return dict(zip(model.memory, first[:, None], strict=True))
    scan = ca.Function(
        "advance",
        [
            memory := ca.MX.sym("memory", len(model.memory)),
            order := ca.MX.sym("order", len(model.commands)),
            dt := ca.MX.sym("dt"),
            parameters := ca.MX.sym("parameters", len(model.parameters)),
        ],
        [
            model.advance(
                ca.MX.zeros(len(model.state)), memory, order, ca.MX.zeros(len(model.environment)), parameters, dt
            )
        ],
    ).mapaccum(count)
    values = np.array(list(vessel.parameters.values()))[:, None]
    after = np.array(scan(first, orders[:, :-1], np.diff(t)[None], np.tile(values, (1, count))))
    states = np.concatenate([first[:, None], after], axis=1)
    return dict(zip(model.memory, states, strict=True))
