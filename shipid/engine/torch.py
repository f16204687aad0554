"""The PyTorch engine: functions of CasADi lowered to PyTorch, and rollouts of all samples and variants at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
import torch

from shipid.engine.adjoint import Adjoint, Loss, evaluate_loss
from shipid.engine.integrate import Method, RolloutBatch, RolloutJob, integrate_step
from shipid.engine.printing import ARITHMETIC, STAGES, Dialect, print_function
from shipid.errors import ShipidError
from shipid.vessel.dynamics import Dynamics

_UNARY: dict[int, str] = {
    ca.OP_EXP: "torch.exp({0})",
    ca.OP_LOG: "torch.log({0})",
    ca.OP_SQRT: "torch.sqrt({0})",
    ca.OP_SIN: "torch.sin({0})",
    ca.OP_COS: "torch.cos({0})",
    ca.OP_TAN: "torch.tan({0})",
    ca.OP_ASIN: "torch.asin({0})",
    ca.OP_ACOS: "torch.acos({0})",
    ca.OP_ATAN: "torch.atan({0})",
    ca.OP_SINH: "torch.sinh({0})",
    ca.OP_COSH: "torch.cosh({0})",
    ca.OP_TANH: "torch.tanh({0})",
    ca.OP_FABS: "torch.abs({0})",
    ca.OP_SIGN: "torch.sign({0})",
    ca.OP_INV: "torch.reciprocal({0})",
    ca.OP_FLOOR: "torch.floor({0})",
    ca.OP_CEIL: "torch.ceil({0})",
}
_BINARY: dict[int, str] = {
    ca.OP_POW: "torch.pow({0}, {1})",
    ca.OP_CONSTPOW: "torch.pow({0}, {1})",
    ca.OP_ATAN2: "_atan2({0}, {1})",
    ca.OP_FMIN: "_minimum({0}, {1})",
    ca.OP_FMAX: "_maximum({0}, {1})",
    ca.OP_IF_ELSE_ZERO: "_where({0}, {1})",
}


def _torch_minimum(a: Any, b: Any) -> torch.Tensor:
    if isinstance(b, float):
        return torch.clamp(a, max=b)
    return torch.clamp(b, max=a) if isinstance(a, float) else torch.minimum(a, b)


def _torch_maximum(a: Any, b: Any) -> torch.Tensor:
    if isinstance(b, float):
        return torch.clamp(a, min=b)
    return torch.clamp(b, min=a) if isinstance(a, float) else torch.maximum(a, b)


def _torch_atan2(a: Any, b: Any) -> torch.Tensor:
    like = b if isinstance(a, float) else a
    return torch.atan2(torch.as_tensor(a, dtype=like.dtype), torch.as_tensor(b, dtype=like.dtype))


def _torch_where(condition: Any, value: Any) -> torch.Tensor:
    if isinstance(value, float):  # two bare numbers would give single precision
        value = torch.full((), value, dtype=torch.float64, device=condition.device)
    return torch.where(condition != 0, value, 0.0)


def _truth_as_number(truth: torch.Tensor) -> torch.Tensor:
    return truth.to(torch.float64)  # arithmetic on booleans is logic in PyTorch, counting in CasADi


_NAMES = {
    "torch": torch,
    "_minimum": _torch_minimum,
    "_maximum": _torch_maximum,
    "_atan2": _torch_atan2,
    "_where": _torch_where,
    "_number": _truth_as_number,
    "inf": math.inf,
    "nan": math.nan,
}


PYTORCH = Dialect(ARITHMETIC | _UNARY | _BINARY, "    {0} = {1}", repr, "_number({0})")


@dataclass(frozen=True)
class LoweredFunction:
    """A lowered function as PyTorch, in stages.

    early : one function a stage: (the stage's inputs, then what earlier stages saved) -> saved (num_saved, ...).
    main : the other inputs in the function's order, then what all stages saved -> list of output channels.
    stage_of : the stage that takes each input of the function (main takes the last).
    """

    early: tuple[Callable[..., torch.Tensor], ...]
    main: Callable[..., list[Any]]
    stage_of: tuple[int, ...]

    def __call__(self, *inputs: Any) -> list[Any]:
        """Output channels for all inputs in the function's order: every stage, then main."""
        saved: list[Any] = []
        for number, stage in enumerate((*self.early, self.main)):
            arguments = [given for given, place in zip(inputs, self.stage_of, strict=True) if place == number]
            saved.append(stage(*arguments, *saved))
        return list(saved[-1])


def lower_function(function: ca.Function) -> LoweredFunction:
    """Lower an SX function of dense vectors with one output; `STAGES` names the inputs that are known early.

    An instruction that has no PyTorch counterpart raises ValueError with its number.
    """
    printed = print_function(function, STAGES, PYTORCH)
    last = len(STAGES)
    space: dict[str, Any] = {**_NAMES, "_stack": _stack_broadcast, "_channels": _split_saved}
    for number in range(last + 1):
        arguments = ", ".join([*printed.inputs(number), *(f"s{earlier}" for earlier in range(number))])
        saved = "" if number == last else ", ".join(printed.saved[number])
        end = f"[{', '.join(printed.outputs)}]" if number == last else f"_stack([{arguments}], [{saved}])"
        split = [f"    s{earlier} = _channels(s{earlier})" for earlier in range(number) if number == last]
        source = [f"def stage{number}({arguments}):", *split, *printed.lines[number], f"    return {end}"]
        exec(compile("\n".join(source), f"<lowered {function.name()}>", "exec"), space)
    early = tuple(space[f"stage{number}"] for number in range(last))
    return LoweredFunction(early, space[f"stage{last}"], printed.stage_of)


def _split_saved(saved: torch.Tensor) -> Any:
    """Saved channels, taken apart at once where they are differentiated: each index would make a gradient of all."""
    return saved.unbind(0) if saved.requires_grad else saved


def _stack_broadcast(inputs: Sequence[torch.Tensor], values: Sequence[Any]) -> torch.Tensor:
    """Numbers and tensors as one tensor (num_values, ...), in the broadcast shape of the inputs."""
    shape = np.broadcast_shapes(*(channels.shape[1:] for channels in inputs))
    like = inputs[0]
    if not values:
        return like.new_empty((0, *shape))
    return torch.stack([torch.as_tensor(value, dtype=like.dtype).expand(shape) for value in values])


CPU_BLOCK, DEVICE_BLOCK = (
    16384,
    1048576,
)  # samples x variants of one block, by `python -m tests.benchmarks rollouts`, `gpu`
LEAST_SAMPLES = 256  # samples of one block of a large family


@dataclass(frozen=True, eq=False)
class Program:
    """One step of a rollout as PyTorch functions, in stages.

    parameters_stage : parameters (P, V, 1) -> saved tensors, once a rollout.
    held_stage : (commands, environment, saved) -> known, once while these are held.
    step : (state, memory, greatest, tau, drawn, known) -> the first three after the step, and the record (C, V, S).
        drawn : components of each drawn sum, (num_entries, 1, S, num_components).
    """

    parameters_stage: Callable[[torch.Tensor], list[torch.Tensor]]
    held_stage: Callable[[torch.Tensor, torch.Tensor, Sequence[torch.Tensor]], list[torch.Tensor]]
    step: Callable[..., tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]]


@lru_cache(maxsize=32)
def _lower_step(model: Dynamics, method: Method, step: float, rows: tuple[int, ...]) -> Program:
    """Lower the functions of a vessel structure to PyTorch, and build the integrator step from them."""
    functions = [lower_function(f) for f in (model.rates, model.advance, *(term.function for term in model.sums))]
    speeds = slice(model.num_dof, 2 * model.num_dof)
    fixed = [None if term.arrays is None else torch.tensor(term.arrays.T) for term in model.sums]

    def parameters_stage(parameters: torch.Tensor) -> list[torch.Tensor]:
        return [function.early[0](parameters) for function in functions]

    def held_stage(
        commands: torch.Tensor, environment: torch.Tensor, first: Sequence[torch.Tensor]
    ) -> list[torch.Tensor]:
        second = [f.early[1](commands, environment, saved) for f, saved in zip(functions, first, strict=True)]
        return [*first, *second]

    def one_step(
        x: torch.Tensor,
        m: torch.Tensor,
        greatest: torch.Tensor,
        tau: torch.Tensor,
        drawn: Sequence[torch.Tensor],
        known: Sequence[torch.Tensor],
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        saved = list(zip(known[: len(functions)], known[len(functions) :], strict=True))

        def rates(state: torch.Tensor, memory: torch.Tensor) -> torch.Tensor:
            left, total = list(drawn), list(tau)
            for arrays, function, early in zip(fixed, functions[2:], saved[2:], strict=True):
                wide = [[channel.unsqueeze(-1) for channel in group] for group in (state, memory)]
                entries = left.pop(0) if arrays is None else arrays.to(tau)
                wrench = function.main(*wide, entries, *(part.unsqueeze(-1) for part in early))
                total = [a + _sum_components(b, entries.shape[-1]) for a, b in zip(total, wrench, strict=True)]
            return _stack_broadcast([state], functions[0].main(state, memory, total, *saved[0]))

        def advance(memory: torch.Tensor, dt: float) -> torch.Tensor:
            time = [torch.full_like(greatest, dt)]
            return _stack_broadcast([memory], functions[1].main(x, memory, time, *saved[1])) if len(memory) else memory

        both = torch.cat(integrate_step(rates, advance, lambda state, a, k: state + a * k, x, m, step, method))
        speed = torch.maximum(greatest, both[speeds].abs().amax(0)) + 0 * both.sum(0)  # keeps what is not finite
        return both[: len(x)], both[len(x) :], speed, both[list(rows)]

    return Program(parameters_stage, held_stage, one_step)


def _sum_components(value: Any, count: int) -> Any:
    """Sum over `count` components (last axis); a value without that axis is multiplied by `count`."""
    if not isinstance(value, torch.Tensor):
        return count * value
    return value.expand(*value.shape[:-1], count).sum(-1)


def check_torch_device(name: str) -> None:
    """Raise ShipidError unless PyTorch can compute on a device here; each kind that is missing fails in another way."""
    try:
        float(torch.zeros(1, device=torch.device(name)))
    except (RuntimeError, AssertionError, TypeError, ImportError, AttributeError):
        raise ShipidError("PyTorch has no such device here: use cpu", path=f"--device {name}") from None


def _series_tensor(array: np.ndarray, place: torch.device) -> torch.Tensor:
    """(..., channel, S) -> (..., channel, 1, S)."""
    return torch.tensor(array, dtype=torch.float64, device=place).unsqueeze(-2)


def run_torch(model: Dynamics, batch: RolloutBatch, job: RolloutJob) -> tuple[np.ndarray, np.ndarray]:
    """Records (R, V, S, C) and the greatest speed (V, S), in blocks of samples with all variants.

    Each call costs as much as many samples.
    """
    num_steps, every, rows = job.num_steps, job.every, list(job.rows)
    varying = len(batch.commands) > 1 or len(batch.environment) > 1
    program, place = _lower_step(model, job.method, job.step, job.rows), torch.device(job.device)
    num_samples, num_variants = batch.state.shape[1], len(batch.parameters)
    most_components = max((part.shape[2] for part in batch.components), default=1)
    width = _block_width(num_samples, num_variants, most_components, job.device)

    start, memory = _series_tensor(batch.state, place), _series_tensor(batch.memory, place)
    held = [
        _series_tensor(batch.commands, place),
        _series_tensor(batch.environment, place),
        _series_tensor(batch.tau_extra, place),
    ]
    drawn = [
        _series_tensor(part.swapaxes(1, 2), place).movedim(1, -1) for part in batch.components
    ]  # (entries, 1, S, components)
    values = torch.tensor(batch.parameters, dtype=torch.float64, device=place).T[..., None]
    shape = (num_variants, num_samples)
    records = torch.empty((num_steps // every + 1, len(rows), *shape), dtype=torch.float64, device=place)
    worst = torch.empty(shape, dtype=torch.float64, device=place)
    with torch.no_grad():
        saved = program.parameters_stage(values)
        for left in range(0, num_samples, width):
            block = slice(left, left + width)
            commands, environment, tau = (series[..., block] for series in held)
            x, m = (part[..., block].expand(-1, num_variants, -1) for part in (start, memory))
            both = torch.cat([x, m])
            target = records[..., block]
            target[0] = both[rows]
            greatest = both[model.num_dof : 2 * model.num_dof].abs().amax(0) + 0 * both.sum(0)
            drawn_here = [part[:, :, block] for part in drawn]
            for k in range(num_steps):
                if varying or k == 0:
                    known = program.held_stage(_series_at(commands, k), _series_at(environment, k), saved)
                x, m, greatest, record = program.step(x, m, greatest, _series_at(tau, k), drawn_here, known)
                if (k + 1) % every == 0:
                    target[(k + 1) // every] = record
            worst[:, block] = greatest
    return records.permute(0, 2, 3, 1).cpu().numpy(), worst.cpu().numpy()


def gradient_torch(
    model: Dynamics, batch: RolloutBatch, job: RolloutJob, wanted: tuple[int, ...], loss: Loss
) -> Adjoint:
    """A loss on the job's channels and its derivatives, by PyTorch's reverse mode; see `gradient_native`."""
    program = _lower_step(model, job.method, job.step, job.rows)
    place, num_samples = torch.device(job.device), batch.state.shape[1]

    start, memory = _series_tensor(batch.state, place).requires_grad_(), _series_tensor(batch.memory, place)
    commands, environment = _series_tensor(batch.commands, place), _series_tensor(batch.environment, place)
    force = _series_tensor(
        np.repeat(batch.tau_extra, job.num_steps // len(batch.tau_extra), axis=0), place
    ).requires_grad_()
    values = _series_tensor(np.repeat(batch.parameters.T, num_samples, axis=1), place).requires_grad_()
    saved = program.parameters_stage(values)
    x, m, both = start, memory, torch.cat([start, memory])
    worst = both[model.num_dof : 2 * model.num_dof].abs().amax(0) + 0 * both.sum(0)
    records = [both[list(job.rows)]]
    for k in range(job.num_steps):
        known = program.held_stage(_series_at(commands, k), _series_at(environment, k), saved)
        x, m, worst, record = program.step(x, m, worst.detach(), force[k], [], known)
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


def _block_width(num_samples: int, num_variants: int, num_components: int, device: str) -> int:
    """Number of samples in a block: about equal blocks whose intermediate results fit in the cache."""
    most = (CPU_BLOCK if device == "cpu" else DEVICE_BLOCK) // num_variants
    most = max(max(LEAST_SAMPLES, most) // num_components, 1)
    return -(-num_samples // -(-num_samples // most))
