"""A CasADi SX function as PyTorch: one tensor operation an instruction, so that whole batches go at once.

The printer walks the instructions of the function. What depends on parameters alone is printed into a prologue that
runs once a rollout; the rest broadcasts over (variant, sample). Nothing of the physics is written twice.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
import torch

from shipid.simulation.rollout import Batch, Method, integrate
from shipid.vessel.dynamics import Dynamics

EAGER_BLOCK = 16384  # samples of one block: the intermediate results of a step stay in the cache
COMPILED_BLOCK = 8192

_UNARY = {
    ca.OP_NEG: "(-{0})",
    ca.OP_EXP: "torch.exp({0})",
    ca.OP_LOG: "torch.log({0})",
    ca.OP_SQRT: "torch.sqrt({0})",
    ca.OP_SQ: "({0} * {0})",
    ca.OP_TWICE: "({0} + {0})",
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
    ca.OP_NOT: "({0} == 0)",
    ca.OP_FLOOR: "torch.floor({0})",
    ca.OP_CEIL: "torch.ceil({0})",
}
_BINARY = {
    ca.OP_ADD: "({0} + {1})",
    ca.OP_SUB: "({0} - {1})",
    ca.OP_MUL: "({0} * {1})",
    ca.OP_DIV: "({0} / {1})",
    ca.OP_POW: "torch.pow({0}, {1})",
    ca.OP_CONSTPOW: "torch.pow({0}, {1})",
    ca.OP_ATAN2: "_atan2({0}, {1})",
    ca.OP_FMIN: "_minimum({0}, {1})",
    ca.OP_FMAX: "_maximum({0}, {1})",
    ca.OP_LT: "({0} < {1})",
    ca.OP_LE: "({0} <= {1})",
    ca.OP_EQ: "({0} == {1})",
    ca.OP_NE: "({0} != {1})",
    ca.OP_AND: "(({0} != 0) & ({1} != 0))",
    ca.OP_OR: "(({0} != 0) | ({1} != 0))",
    ca.OP_IF_ELSE_ZERO: "_where({0}, {1})",
}
_TRUTH = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT}  # give booleans
_TAKES_TRUTH = {ca.OP_NOT: 1, ca.OP_AND: 2, ca.OP_OR: 2, ca.OP_IF_ELSE_ZERO: 1}  # so many operands, from the first


def _minimum(a: Any, b: Any) -> torch.Tensor:
    if isinstance(b, float):
        return torch.clamp(a, max=b)
    return torch.clamp(b, max=a) if isinstance(a, float) else torch.minimum(a, b)


def _maximum(a: Any, b: Any) -> torch.Tensor:
    if isinstance(b, float):
        return torch.clamp(a, min=b)
    return torch.clamp(b, min=a) if isinstance(a, float) else torch.maximum(a, b)


def _atan2(a: Any, b: Any) -> torch.Tensor:
    like = b if isinstance(a, float) else a
    return torch.atan2(torch.as_tensor(a, dtype=like.dtype), torch.as_tensor(b, dtype=like.dtype))


def _where(condition: Any, value: Any) -> torch.Tensor:
    if isinstance(value, float):  # two bare numbers would give single precision
        value = torch.full((), value, dtype=torch.float64, device=condition.device)
    return torch.where(condition != 0, value, 0.0)


def _number(truth: torch.Tensor) -> torch.Tensor:
    return truth.to(torch.float64)  # arithmetic on booleans is logic in PyTorch, counting in CasADi


_NAMES = {
    "torch": torch,
    "_minimum": _minimum,
    "_maximum": _maximum,
    "_atan2": _atan2,
    "_where": _where,
    "_number": _number,
    "inf": math.inf,
    "nan": math.nan,
}


@dataclass(frozen=True)
class Lowered:
    """A lowered function.

    prologue : parameters (num_parameters, ...) -> hoisted (num_hoisted, ...), once a rollout.
    main : the function's inputs in order, parameters replaced by hoisted, channel first -> list of output channels.
    """

    prologue: Callable[[torch.Tensor], torch.Tensor]
    main: Callable[..., list[Any]]
    num_instructions: int


def lower(function: ca.Function, parameters: str = "parameters") -> Lowered:
    """Lower an SX function of dense vectors with one output; `parameters` names the input that the prologue takes.

    An instruction that has no PyTorch counterpart raises ValueError with its number.
    """
    names = [function.name_in(i) for i in range(function.n_in())]
    held = names.index(parameters)
    lines: dict[bool, list[str]] = {True: [], False: []}  # True: prologue
    slot: dict[int, tuple[str, bool | None]] = {}  # work slot -> expression, is it parameter-only (None: a number)
    hoisted: dict[str, int] = {}
    truths: set[str] = set()  # names of booleans
    outputs: dict[int, tuple[str, bool | None]] = {}

    def use(operand: tuple[str, bool | None], in_prologue: bool) -> str:
        text, parameter_only = operand
        if in_prologue or not parameter_only:
            return text
        return f"h[{hoisted.setdefault(text, len(hoisted))}]"

    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_CONST:
            slot[target[0]] = (repr(float(function.instruction_constant(k))), None)
        elif operation == ca.OP_INPUT:
            slot[target[0]] = (f"{names[source[0]]}[{source[1]}]", source[0] == held)
        elif operation == ca.OP_OUTPUT:
            outputs[target[1]] = slot[source[0]]
        else:
            operands = [slot[i] for i in source]
            template = _UNARY.get(operation) or _BINARY.get(operation)
            if template is None:
                raise ValueError(f"CasADi operation {operation} of {function.name()} has no PyTorch counterpart")
            kinds = {kind for _, kind in operands}
            if kinds == {None}:
                value = float(ca.evalf(_on_numbers(operation, [float(text) for text, _ in operands])))
                slot[target[0]] = (repr(value), None)
                continue
            in_prologue = kinds <= {True, None}
            texts = [use(operand, in_prologue) for operand in operands]
            bare = _TAKES_TRUTH.get(operation, 0)
            texts[bare:] = [f"_number({text})" if text in truths else text for text in texts[bare:]]
            expression = template.format(*texts)
            name = f"{'p' if in_prologue else 'a'}{k}"
            truths |= {name} if operation in _TRUTH else set()
            lines[in_prologue].append(f"    {name} = {expression}")
            slot[target[0]] = (name, in_prologue)

    arguments = ["h" if name == parameters else name for name in names]
    result = ", ".join(use(outputs[i], False) for i in sorted(outputs))
    main = [f"def main({', '.join(arguments)}):", *lines[False], f"    return [{result}]"]
    saved = ", ".join(hoisted) or f"{parameters}[0]"
    prologue = [f"def prologue({parameters}):", *lines[True], f"    return _stack({parameters}, [{saved}])"]
    space: dict[str, Any] = {**_NAMES, "_stack": _stack}
    exec(compile("\n".join([*prologue, "", *main]), f"<lowered {function.name()}>", "exec"), space)
    return Lowered(space["prologue"], space["main"], len(lines[False]))


def _on_numbers(operation: int, values: Sequence[float]) -> ca.SX:
    return ca.SX.unary(operation, values[0]) if len(values) == 1 else ca.SX.binary(operation, *values)


def _stack(like: torch.Tensor, values: Sequence[Any]) -> torch.Tensor:
    shape = like.shape[1:]
    return torch.stack([torch.as_tensor(value, dtype=like.dtype).expand(shape) for value in values])


@dataclass(frozen=True)
class Program:
    """A lowered step.

    prologue : parameters (P, V, 1) -> hoisted tensors, once a rollout.
    step : (state, memory, greatest, commands, environment, tau, *hoisted) -> the first three after the step, and the
        record (C, V, S) of the kept channels. One kernel when compiled: nothing is written that is not kept.
    """

    prologue: Callable[[torch.Tensor], list[torch.Tensor]]
    step: Callable[..., tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]]


@lru_cache(maxsize=32)
def _program(model: Dynamics, method: Method, step: float, rows: tuple[int, ...], compiled: bool) -> Program:
    """Lower the functions of a vessel's structure and put the integrator around them; one compilation each."""
    lowered_rates, lowered_advance = lower(model.rates), lower(model.advance)
    lowered_sums = [(lower(term.function), torch.tensor(term.arrays.T)) for term in model.sums]
    speeds = slice(model.num_dof, 2 * model.num_dof)

    def prologue(parameters: torch.Tensor) -> list[torch.Tensor]:
        hoisted = [lowered_rates.prologue(parameters), lowered_advance.prologue(parameters)]
        return hoisted + [function.prologue(parameters).unsqueeze(-1) for function, _ in lowered_sums]

    def one_step(
        x: torch.Tensor,
        m: torch.Tensor,
        greatest: torch.Tensor,
        commands: torch.Tensor,
        environment: torch.Tensor,
        tau: torch.Tensor,
        *hoisted: torch.Tensor,
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        h_rates, h_advance, *h_sums = hoisted

        def rates(state: Any, memory: Any) -> Any:
            total = list(tau)
            for (function, arrays), h in zip(lowered_sums, h_sums, strict=True):
                groups = (state, memory, commands, environment)
                wide = [[channel.unsqueeze(-1) for channel in group] for group in groups]
                wrench = function.main(*wide, h, arrays.to(tau))
                total = [a + _sum(b, arrays.shape[1]) for a, b in zip(total, wrench, strict=True)]
            return lowered_rates.main(state, memory, commands, environment, h_rates, total)

        def advance(memory: Any, dt: float) -> Any:
            return lowered_advance.main(x, memory, commands, environment, h_advance, [dt])

        after, memory_after = integrate(rates, advance, _add, list(x), list(m), step, method)
        both = [*after, *memory_after]
        speed = greatest
        for value in after[speeds]:
            speed = torch.maximum(speed, torch.abs(value))  # both keep NaN
        for value in both:
            speed = speed + 0 * value
        record = torch.stack([both[row] for row in rows])
        return torch.stack(after), torch.stack(memory_after) if memory_after else m, speed, record

    return Program(prologue, torch.compile(one_step, dynamic=False, fullgraph=True) if compiled else one_step)


def _sum(value: Any, count: int) -> Any:
    """Sum over components (last axis); what is the same for all of them counts as often as there are components."""
    if not isinstance(value, torch.Tensor):
        return count * value
    return value.expand(*value.shape[:-1], count).sum(-1)


def _add(x: Sequence[Any], a: float, k: Sequence[Any]) -> list[Any]:
    return [xi + a * ki for xi, ki in zip(x, k, strict=True)]


def run_torch(
    model: Dynamics,
    batch: Batch,
    step: float,
    num_steps: int,
    method: Method,
    every: int,
    rows: list[int],
    compiled: bool,
    device: str,
) -> tuple[np.ndarray, np.ndarray]:
    """Records (R, V, S, C) and the greatest speed (V, S), in blocks of one fixed shape, the last one padded.

    Eager, a block holds all variants; compiled, one variant and a number of samples that is a power of two, so that
    a family of any size needs one compilation and a block stays in the cache.
    """
    program = _program(model, method, step, tuple(rows), compiled)
    num_samples, num_variants = batch.state.shape[1], len(batch.parameters)
    width = min(COMPILED_BLOCK if compiled else EAGER_BLOCK, 1 << max(0, num_samples - 1).bit_length())
    padded = -(-num_samples // width) * width
    place = torch.device(device)

    def tensor(array: np.ndarray) -> torch.Tensor:  # (..., channel, S) -> (..., channel, 1, padded S)
        filled = np.concatenate([array, np.repeat(array[..., -1:], padded - num_samples, axis=-1)], axis=-1)
        return torch.tensor(filled, dtype=torch.float64, device=place).unsqueeze(-2)

    start, memory = tensor(batch.state), tensor(batch.memory)
    held = [tensor(batch.commands), tensor(batch.environment), tensor(batch.tau_extra)]
    values = torch.tensor(batch.parameters, dtype=torch.float64, device=place).T[..., None]
    groups = [slice(v, v + 1) for v in range(num_variants)] if compiled else [slice(0, num_variants)]
    records = torch.empty((num_steps // every + 1, len(rows), num_variants, padded), dtype=torch.float64, device=place)
    worst = torch.empty((num_variants, padded), dtype=torch.float64, device=place)
    with torch.no_grad():
        for group in groups:
            hoisted = program.prologue(values[:, group])
            for left in range(0, padded, width):
                block = slice(left, left + width)
                inputs = [channel[..., block] for channel in held]
                shape = (-1, hoisted[0].shape[1], width)
                x, m = (part[..., block].expand(shape).contiguous() for part in (start, memory))
                both = torch.cat([x, m])
                records[0, :, group, block] = both[rows]
                greatest = both[model.num_dof : len(model.state)].abs().amax(0) + 0 * both.sum(0)
                for k in range(num_steps):
                    now = [series[min(k, len(series) - 1)] for series in inputs]
                    x, m, greatest, record = program.step(x, m, greatest, *now, *hoisted)
                    if (k + 1) % every == 0:
                        records[(k + 1) // every, :, group, block] = record
                worst[group, block] = greatest
    result = records.permute(0, 2, 3, 1)[:, :, :num_samples]
    return result.cpu().numpy(), worst[:, :num_samples].cpu().numpy()
