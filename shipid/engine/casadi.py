"""The CasADi engine: the steps of one sample as a scan, samples on threads. For long runs of few samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, Literal

import casadi as ca
import numpy as np

from shipid.engine.integrate import Array, Method, RolloutBatch, RolloutJob, count_threads, integrate_step
from shipid.interrupts import hold_interrupts
from shipid.vessel.dynamics import INPUTS, Dynamics, vessel_dynamics
from shipid.vessel.load import Vessel

# steps of one call in `memory_along`, samples of one in `evaluate_samples`: made once, whatever is asked for; steps
# of the former that are one expression
BLOCK, UNROLLED = 256, 16


def call_function(function: ca.Function, *inputs: Array) -> Array:
    """Output of a function of one dense output at dense inputs, none of which is copied into a matrix of CasADi's."""
    (buffer, evaluate), result = function.buffer(), np.empty(function.size_out(0), order="F")
    given = [np.ravel(np.asarray(one, dtype=float), "F") for one in inputs]
    if [one.size for one in given] != [function.nnz_in(i) for i in range(function.n_in())]:
        raise ValueError(f"{function.name()} takes inputs of other sizes")
    for i, one in enumerate(given):
        buffer.set_arg(i, memoryview(one))  # type: ignore[call-arg]  # a view has its size
    buffer.set_res(0, memoryview(result.T))  # type: ignore[call-arg]
    with hold_interrupts():
        evaluate()
    return result


def input_symbols(model: Dynamics) -> list[ca.SX]:
    """State, memory, commands, environment and parameters as symbols."""
    states = ca.SX.sym("state", len(model.state) + len(model.hidden))
    return [states, *(ca.SX.sym(name, len(getattr(model, name))) for name in INPUTS[1:])]


def summed_rates(model: Dynamics, inputs: Sequence[Any], tau: Any, drawn: Mapping[str, Any]) -> Any:
    """d(state)/dt with sums over components; in calm water, without the drawn sums that are not in `drawn`.

    drawn : path of a drawn sum -> (entries, components).
    """
    for term in (term for term in model.sums if term.arrays is not None or term.path in drawn):
        entries = drawn[term.path] if term.arrays is None else ca.DM(term.arrays.T)
        columns = [ca.repmat(one, 1, entries.shape[1]) for one in inputs]
        tau = tau + ca.sum2(term.function.map(entries.shape[1])(*columns, entries))
    return model.rates(*inputs, tau)


@lru_cache(maxsize=32)
def casadi_scan(
    model: Dynamics, step: float, num_steps: int, method: Method, every: int, counts: tuple[int, ...]
) -> ca.Function:
    """One sample: ([state, memory, greatest speed], commands, environment, tau, fixed) -> records of the first.

    fixed : inputs that are constant in time: the parameters, then the drawn components of the sample. counts : number
    of components of each drawn sum.
    """
    num_states = len(model.state) + len(model.hidden)
    state, memory = ca.MX.sym("state", num_states), ca.MX.sym("memory", len(model.memory))
    commands, environment = ca.MX.sym("commands", len(model.commands)), ca.MX.sym("environment", len(model.environment))
    tau = ca.MX.sym("tau", model.num_dof)
    sizes = [sum(term.widths.values()) for term in model.drawn]
    places = np.cumsum([0, len(model.parameters), *(n * size for n, size in zip(counts, sizes, strict=True))])
    fixed = ca.MX.sym("fixed", int(places[-1]))
    parameters, *drawn = ca.vertsplit(fixed, places.tolist())
    entries = {
        term.path: ca.reshape(part, size, -1) for term, part, size in zip(model.drawn, drawn, sizes, strict=True)
    }

    def rates(x: Any, m: Any) -> Any:
        return summed_rates(model, [x, m, commands, environment, parameters], tau, entries)

    def advance(m: Any, dt: float) -> Any:
        return model.advance(state, m, commands, environment, parameters, dt)

    greatest = ca.MX.sym("greatest")
    after, memory_after = integrate_step(rates, advance, lambda x, a, k: x + a * k, state, memory, step, method)
    one = ca.Function(
        "step",
        [ca.vertcat(state, memory, greatest), commands, environment, tau, fixed],
        [
            ca.vertcat(
                after, memory_after, ca.fmax(greatest, ca.mmax(ca.fabs(after[model.num_dof : 2 * model.num_dof])))
            )
        ],
    )

    def scan(name: str, one: ca.Function, count: int, steps: int, kept: slice) -> ca.Function:
        """So many calls of a function, one after the other, over so many steps in all; `kept` of what they reach."""
        x, c = ca.MX.sym("x", one.size1_in(0)), ca.MX.sym("c", len(model.commands), steps)
        e, t = ca.MX.sym("e", len(model.environment), steps), ca.MX.sym("t", model.num_dof, steps)
        path = one.mapaccum(count)(x, c, e, t, ca.repmat(fixed, 1, count))
        return ca.Function(name, [x, c, e, t, fixed], [path[:, kept]])

    if every > 1:
        one = scan("steps", one, every, every, slice(-1, None))
    return scan("rollout", one, num_steps // every, num_steps, slice(None))


def run_casadi(model: Dynamics, batch: RolloutBatch, job: RolloutJob) -> tuple[Array, Array]:
    """Records (R, V, S, C) and the greatest speed (V, S), sample by sample on CasADi's threads."""
    num_steps, counts = job.num_steps, tuple(drawn.shape[2] for drawn in batch.components)
    scan = casadi_scan(model, job.step, num_steps, job.method, job.every, counts)
    num_samples, num_records = batch.state.shape[1], num_steps // job.every
    greatest = np.abs(batch.state[model.num_dof : 2 * model.num_dof]).max(axis=0, keepdims=True)
    start = np.concatenate([batch.state, batch.memory, greatest])

    def over_time(held: Array) -> Array:  # (T, C, S) -> (C, S * num_steps), a sample's steps side by side
        full = np.broadcast_to(held, (num_steps, *held.shape[1:]))
        return full.transpose(1, 2, 0).reshape(held.shape[1], num_samples * num_steps)

    inputs = [start, over_time(batch.commands), over_time(batch.environment), over_time(batch.tau_extra)]
    mapped = scan.map(num_samples, "thread", min(count_threads(), num_samples))
    drawn = [part.transpose(2, 0, 1).reshape(-1, num_samples) for part in batch.components]
    records, worst = [], []
    for values in batch.parameters:
        fixed = np.concatenate([np.tile(values[:, None], (1, num_samples)), *drawn])
        result = call_function(mapped, *inputs, fixed)
        path = result.reshape(len(start), num_samples, num_records).transpose(2, 1, 0)
        path = np.concatenate([start.T[None], path])
        records.append(path[:, :, list(job.rows)])
        worst.append(path[-1, :, -1] + 0 * path.sum(axis=(0, 2)))  # keeps values that are not finite
    return np.stack(records, axis=1), np.stack(worst)


@lru_cache(maxsize=32)
def _memory_scan(model: Dynamics, num_runs: int) -> tuple[ca.Function, tuple[int, ...]]:
    """(memory, its orders, dt, parameters) -> memory after each of `BLOCK` steps, and which parameters it takes.

    All commands and parameters at every step would cost more than the steps, as would a call of each step.
    """
    memory, order = ca.SX.sym("memory", len(model.memory)), ca.SX.sym("order", len(model.commands))
    dt, parameters = ca.SX.sym("dt"), ca.SX.sym("parameters", len(model.parameters))
    still = ca.SX(len(model.state) + len(model.hidden), 1), ca.SX(len(model.environment), 1)
    after = model.advance(still[0], memory, order, still[1], parameters, dt)
    used = tuple(np.flatnonzero(ca.which_depends(after, parameters, 1, False)).tolist())
    of_memory = [model.commands.index(name) for name in model.memory]
    steps = ca.Function("advance", [memory, order[of_memory], dt, parameters[list(used)]], [after]).mapaccum(UNROLLED)
    return steps.expand().mapaccum(BLOCK // UNROLLED).map("runs", "serial", num_runs, [2, 3], []), used


def memory_along(vessel: Vessel, commands: Mapping[str, Array], t: Array) -> dict[str, Array] | None:
    """Hidden actuator states (n,) or (R, n) along the orders of one run or of R at the times t (n,) [s] of all of them.

    None if the vessel has none. The states begin at the first order; each order is held until the next row. They are
    simulated, not measured.
    """
    model = vessel_dynamics(vessel)
    if not model.memory:
        return None
    orders = np.stack([np.asarray(commands[name], dtype=float) for name in model.memory])
    shape, orders = orders.shape, orders.reshape(len(orders), -1, len(t))
    (scan, used), parts = _memory_scan(model, orders.shape[1]), [orders[:, :, :1]]
    values = np.tile(np.array(list(vessel.parameters.values()))[list(used), None], (1, BLOCK))
    dt, count = np.diff(t), len(t) - 1
    held = np.minimum(np.arange(-(-count // BLOCK) * BLOCK), count - 1)  # the last block is padded
    for rows in held.reshape(-1, BLOCK):
        now = parts[-1][:, :, -1], orders[:, :, rows].reshape(len(orders), -1)
        parts.append(call_function(scan, *now, dt[rows], values).reshape(len(orders), -1, BLOCK))
    return dict(zip(model.memory, np.concatenate(parts, axis=2)[:, :, : len(t)].reshape(shape), strict=True))


@lru_cache(maxsize=64)
def _map_function(model: Dynamics, name: Literal["orders", "measured"]) -> ca.Function:
    """A function of a model over `BLOCK` samples with the same parameters."""
    function: ca.Function = getattr(model, name)
    return function.map(name, "serial", BLOCK, [function.n_in() - 1], [])


def evaluate_samples(
    model: Dynamics, name: Literal["orders", "measured"], inputs: Sequence[Sequence[Array]], parameters: Array
) -> Array:
    """Orders of the helmsman, or what instruments on the components show, (entries, n), in n samples.

    inputs : states, memory, commands and environment, channels (n,) each. parameters : (P,).
    """
    count = len(inputs[0][0])
    given, mapped = [np.array(part).reshape(len(part), count) for part in inputs], _map_function(model, name)
    blocks = np.minimum(np.arange(-(-count // BLOCK) * BLOCK), count - 1).reshape(-1, BLOCK)  # the last is padded
    parts = [call_function(mapped, *(part[:, samples] for part in given), parameters) for samples in blocks]
    return np.concatenate(parts, axis=1)[:, :count]
