"""The PyTorch engine: all samples and variants of a step at once, eager or as one compiled kernel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np
import torch

from shipid.engine.adjoint import Adjoint, Loss, evaluate_loss
from shipid.engine.integrate import Method, RolloutBatch, RolloutJob, integrate_step
from shipid.engine.lowering import lower_function
from shipid.vessel.dynamics import Dynamics

EAGER_BLOCK = 16384  # samples x variants of one block
COMPILED_BLOCK = 8192  # samples of one block, one variant
DEVICE_BLOCK = 1048576  # samples x variants of one block on a GPU, eager or compiled
GRAIN = 256  # compiled blocks are a multiple of it: similar batches share a kernel
COMPONENT_GRAIN = 8  # grain of compiled blocks if each sample has drawn components


@dataclass(frozen=True, eq=False)
class Program:
    """One step of a rollout as PyTorch functions, in stages.

    parameters_stage : parameters (P, V, 1) -> saved tensors of all functions, once a rollout.
    held_stage : (commands, environment, saved) -> what else is known before the state is, once while they are held.
    rates : (state, memory, tau, *drawn, *known) -> d(state)/dt. `drawn` are the components of each drawn sum,
        (num_entries, 1, S, num_components); `known` is what the two stages saved or, with commands that vary,
        (commands, environment, *saved of the first stage).
    advance : (state, memory, dt, *known) -> memory after dt.
    step : (rates, advance, state, memory, greatest, tau, *drawn, *known) -> the three after the step, and the record
        (C, V, S) of the kept channels.
    """

    parameters_stage: Callable[[torch.Tensor], list[torch.Tensor]]
    held_stage: Callable[[torch.Tensor, torch.Tensor, Sequence[torch.Tensor]], list[torch.Tensor]]
    rates: Callable[..., torch.Tensor]
    advance: Callable[..., torch.Tensor]
    step: Callable[..., tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]]


@lru_cache(maxsize=32)
def _lower_step(model: Dynamics, method: Method, step: float, rows: tuple[int, ...], varying: bool) -> Program:
    """Lower the functions of a vessel structure to PyTorch, and build the integrator step from them."""
    functions = [lower_function(f) for f in (model.rates, model.advance, *(term.function for term in model.sums))]
    num_drawn, speeds = len(model.drawn), slice(model.num_dof, 2 * model.num_dof)
    fixed = [None if term.arrays is None else torch.tensor(term.arrays.T) for term in model.sums]

    def parameters_stage(parameters: torch.Tensor) -> list[torch.Tensor]:
        return [function.early[0](parameters) for function in functions]

    def held_stage(
        commands: torch.Tensor, environment: torch.Tensor, first: Sequence[torch.Tensor]
    ) -> list[torch.Tensor]:
        second = [f.early[1](commands, environment, saved) for f, saved in zip(functions, first, strict=True)]
        return [*first, *second]

    def saved_of(known: Sequence[torch.Tensor]) -> list[tuple[torch.Tensor, torch.Tensor]]:
        saved = held_stage(known[0], known[1], known[2:]) if varying else known
        return list(zip(saved[: len(functions)], saved[len(functions) :], strict=True))

    def rates(state: torch.Tensor, memory: torch.Tensor, tau: torch.Tensor, *rest: torch.Tensor) -> torch.Tensor:
        drawn, saved = list(rest[:num_drawn]), saved_of(rest[num_drawn:])
        total = list(tau)
        for arrays, function, early in zip(fixed, functions[2:], saved[2:], strict=True):
            wide = [[channel.unsqueeze(-1) for channel in group] for group in (state, memory)]
            entries = drawn.pop(0) if arrays is None else arrays.to(tau)
            wrench = function.main(*wide, entries, *(part.unsqueeze(-1) for part in early))
            total = [a + _sum_components(b, entries.shape[-1]) for a, b in zip(total, wrench, strict=True)]
        return _stack_tensors(functions[0].main(state, memory, total, *saved[0]), state)

    def advance(state: torch.Tensor, memory: torch.Tensor, dt: torch.Tensor, *known: torch.Tensor) -> torch.Tensor:
        return _stack_tensors(functions[1].main(state, memory, [dt], *saved_of(known)[1]), memory)

    def one_step(
        rates: Callable[..., torch.Tensor],
        advance: Callable[..., torch.Tensor],
        x: torch.Tensor,
        m: torch.Tensor,
        greatest: torch.Tensor,
        tau: torch.Tensor,
        *rest: torch.Tensor,
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        after, memory_after = integrate_step(
            lambda state, memory: rates(state, memory, tau, *rest),
            lambda memory, dt: (
                advance(x, memory, torch.full_like(greatest, dt), *rest[num_drawn:]) if len(memory) else memory
            ),
            lambda state, a, k: state + a * k,
            x,
            m,
            step,
            method,
        )
        both = torch.cat([after, memory_after])
        speed = torch.maximum(greatest, after[speeds].abs().amax(0)) + 0 * both.sum(
            0
        )  # keeps values that are not finite
        return after, memory_after, speed, torch.stack([both[row] for row in rows])

    return Program(parameters_stage, held_stage, rates, advance, one_step)


Key = tuple[Any, tuple[tuple[int, ...], ...], torch.device]
kernels: dict[Key, Callable[..., Any]] = {}


def _compile_kernel(function: Callable[..., Any], inputs: Sequence[torch.Tensor]) -> Callable[..., Any]:
    """A function compiled to one kernel for the shapes of the inputs, from a cache.

    It is traced and compiled by TorchInductor directly: this takes less than half the time of `torch.compile`, and a
    call checks no guards. None are needed, because shapes are part of the cache key.
    """
    key = (function, tuple(tuple(tensor.shape) for tensor in inputs), inputs[0].device)
    if key not in kernels:
        from torch._inductor import compile as kernel_of  # two seconds, which an eager rollout need not wait
        from torch.fx.experimental.proxy_tensor import make_fx

        kernels[key] = kernel_of(make_fx(function)(*inputs), list(inputs))
    return kernels[key]


@lru_cache(maxsize=64)
def _whole_step(program: Program) -> Callable[..., Any]:
    return partial(program.step, program.rates, program.advance)


def _compile_step(
    program: Program, method: Method, inputs: Sequence[torch.Tensor], num_drawn: int
) -> Callable[..., Any]:
    """A compiled step: Euler as one kernel, so that nothing is written that is not kept; RK4 around two kernels.

    The four stages of RK4 in one kernel would take four times as long to compile and run no faster.
    """
    whole = _whole_step(program)
    if method == "euler":
        return _compile_kernel(whole, inputs)
    x, m, greatest, tau, *rest = inputs
    rates = _compile_kernel(program.rates, [x, m, tau, *rest])
    advance = _compile_kernel(program.advance, [x, m, greatest, *rest[num_drawn:]]) if len(m) else program.advance
    return partial(program.step, rates, advance)


def _stack_tensors(channels: Sequence[Any], like: torch.Tensor) -> torch.Tensor:
    """Channels as one tensor of the shape of `like`; numbers and smaller tensors are broadcast."""
    if not channels:
        return like
    return torch.stack([torch.as_tensor(channel, dtype=like.dtype).expand(like.shape[1:]) for channel in channels])


def _sum_components(value: Any, count: int) -> Any:
    """Sum over `count` components (last axis); a value without that axis is multiplied by `count`."""
    if not isinstance(value, torch.Tensor):
        return count * value
    return value.expand(*value.shape[:-1], count).sum(-1)


def is_torch_device(name: str) -> bool:
    """Whether PyTorch can compute on a device here.

    Each kind of device that is not there fails in another way: RuntimeError (no such name; no numbers come back from
    `meta`), AssertionError (`cuda` of a build without it), ImportError and AttributeError (`hpu`, `privateuseone`).
    """
    try:
        float(torch.zeros(1, device=torch.device(name)))
    except (RuntimeError, AssertionError, TypeError, ImportError, AttributeError):
        return False
    return True


def run_torch(model: Dynamics, batch: RolloutBatch, job: RolloutJob, compiled: bool) -> tuple[np.ndarray, np.ndarray]:
    """Records (R, V, S, C) and the greatest speed (V, S), in blocks of one fixed shape, the last one padded.

    A block holds all variants, because each call costs as much as many samples. Compiled on the CPU it holds one
    variant, so that a family of any size needs one compilation and a block stays in the cache.
    """
    num_steps, every, rows, device = job.num_steps, job.every, list(job.rows), job.device
    varying = len(batch.commands) > 1 or len(batch.environment) > 1
    program = _lower_step(model, job.method, job.step, job.rows, varying)
    num_samples, num_variants = batch.state.shape[1], len(batch.parameters)
    most_components = max((part.shape[2] for part in batch.components), default=1)
    width = _block_width(num_samples, num_variants, most_components, compiled, device)
    padded = -(-num_samples // width) * width
    place = torch.device(device)

    def tensor(array: np.ndarray) -> torch.Tensor:  # (..., channel, S) -> (..., channel, 1, padded S)
        filled = np.concatenate([array, np.repeat(array[..., -1:], padded - num_samples, axis=-1)], axis=-1)
        return torch.tensor(filled, dtype=torch.float64, device=place).unsqueeze(-2)

    start, memory = tensor(batch.state), tensor(batch.memory)
    held = [tensor(batch.commands), tensor(batch.environment), tensor(batch.tau_extra)]
    drawn = [tensor(part.swapaxes(1, 2)).movedim(1, -1) for part in batch.components]  # (entries, 1, S, components)
    values = torch.tensor(batch.parameters, dtype=torch.float64, device=place).T[..., None]
    together = 1 if compiled and device == "cpu" else num_variants
    groups = [slice(v, v + together) for v in range(0, num_variants, together)]
    records = torch.empty((num_steps // every + 1, len(rows), num_variants, padded), dtype=torch.float64, device=place)
    worst = torch.empty((num_variants, padded), dtype=torch.float64, device=place)
    with torch.no_grad():
        first = program.parameters_stage(values)
        for group in groups:
            saved = [entries[:, group].contiguous() for entries in first]  # a kernel knows one layout
            for left in range(0, padded, width):
                block = slice(left, left + width)
                commands, environment, tau = (series[..., block].contiguous() for series in held)
                shape = (-1, saved[0].shape[1], width)
                x, m = (part[..., block].expand(shape).contiguous() for part in (start, memory))
                both = torch.cat([x, m])
                target = records[:, :, group, block]
                target[0] = both[rows]
                greatest = both[model.num_dof : 2 * model.num_dof].abs().amax(0) + 0 * both.sum(0)
                drawn_here = [part[:, :, block].contiguous() for part in drawn]
                known = saved if varying else program.held_stage(commands[0], environment[0], saved)
                advance = _whole_step(program)
                for k in range(num_steps):
                    if varying:
                        known = [_series_at(commands, k), _series_at(environment, k), *saved]
                    inputs = [x, m, greatest, _series_at(tau, k), *drawn_here, *known]
                    if compiled and k == 0:
                        advance = _compile_step(program, job.method, inputs, len(drawn_here))
                    x, m, greatest, record = advance(*inputs)
                    if (k + 1) % every == 0:
                        target[(k + 1) // every] = record
                worst[group, block] = greatest
    result = records.permute(0, 2, 3, 1)[:, :, :num_samples]
    return result.cpu().numpy(), worst[:, :num_samples].cpu().numpy()


def gradient_torch(
    model: Dynamics, batch: RolloutBatch, job: RolloutJob, wanted: tuple[int, ...], loss: Loss
) -> Adjoint:
    """A loss on the job's channels and its derivatives, by PyTorch's reverse mode; see `gradient_native`."""
    program = _lower_step(model, job.method, job.step, job.rows, True)
    place, num_samples = torch.device(job.device), batch.state.shape[1]

    def tensor(array: np.ndarray) -> torch.Tensor:  # (..., channel, S) -> (..., channel, 1, S)
        return torch.tensor(array, dtype=torch.float64, device=place).unsqueeze(-2)

    start, memory = tensor(batch.state).requires_grad_(), tensor(batch.memory)
    commands, environment = tensor(batch.commands), tensor(batch.environment)
    force = tensor(np.repeat(batch.tau_extra, job.num_steps // len(batch.tau_extra), axis=0)).requires_grad_()
    values = tensor(np.repeat(batch.parameters.T, num_samples, axis=1)).requires_grad_()
    saved = program.parameters_stage(values)
    x, m, both = start, memory, torch.cat([start, memory])
    worst = both[model.num_dof : 2 * model.num_dof].abs().amax(0) + 0 * both.sum(0)
    records = [both[list(job.rows)]]
    for k in range(job.num_steps):
        known = [_series_at(commands, k), _series_at(environment, k), *saved]
        x, m, worst, record = _whole_step(program)(x, m, worst.detach(), force[k], *known)
        records.append(record)
    path = torch.stack(records)[:, :, 0].transpose(1, 2)  # (T + 1, S, C)
    numbers = path.detach().cpu().numpy()
    losses, slopes = evaluate_loss(loss, numbers)
    inputs = [start, values, force]
    gradients = torch.autograd.grad(path, inputs, torch.tensor(slopes, device=place), allow_unused=True)
    state, parameters, tau = (
        (torch.zeros_like(one) if gradient is None else gradient).squeeze(-2).cpu().numpy()
        for one, gradient in zip(inputs, gradients, strict=True)
    )
    return Adjoint(losses, numbers, worst.detach().cpu().numpy()[0], parameters[list(wanted)], tau, state)


def _series_at(series: torch.Tensor, k: int) -> torch.Tensor:
    """Entry k of a time series; the last entry if the series is shorter (constant input)."""
    return series[min(k, len(series) - 1)]


def _block_width(num_samples: int, num_variants: int, num_components: int, compiled: bool, device: str) -> int:
    """Number of samples in a block: equal blocks with little padding whose intermediate results fit in the cache."""
    if device != "cpu":
        most = max(GRAIN, DEVICE_BLOCK // num_variants)
    else:
        most = COMPILED_BLOCK if compiled else max(256, EAGER_BLOCK // num_variants)
    grain = GRAIN if compiled else 1
    if num_components > 1:
        most, grain = max(most // num_components, 1), min(grain, COMPONENT_GRAIN)
    blocks = -(-num_samples // most)
    return -(-num_samples // (blocks * grain)) * grain
