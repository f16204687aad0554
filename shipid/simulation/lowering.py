"""A CasADi SX function in another language, one operation an instruction, so that whole batches go at once.

The printer walks the instructions of the function. What depends on parameters alone, or on commands and weather, is
printed into stages that run early; the rest goes over (variant, sample). Nothing of the physics is written twice.
PyTorch is one dialect; the C of `shipid.simulation.native` is another.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import torch

_UNARY: dict[int, str] = {
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
_BINARY: dict[int, str] = {
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
class Dialect:
    """How a language writes an operation, an assignment `a = ...`, a plain number, and a truth value as a number."""

    operations: Mapping[int, str]
    assignment: str
    constant: Callable[[float], str]
    number: str


PYTORCH = Dialect(_UNARY | _BINARY, "    {0} = {1}", repr, "_number({0})")
STAGES = (("parameters",), ("commands", "environment"))  # once a rollout; once a window while commands are held


@dataclass(frozen=True)
class Printed:
    """A function as text, in stages: what depends on early inputs alone is computed early, and once.

    lines : of each stage, then of main; a value `a7` of an earlier stage is read as `s0[3]`.
    saved : of each stage, what later ones read, in order.
    outputs : text of each output entry, in order.
    names, stage_of : the function's inputs in order, and the stage that takes each (main takes the last).
    """

    lines: tuple[tuple[str, ...], ...]
    saved: tuple[tuple[str, ...], ...]
    outputs: tuple[str, ...]
    names: tuple[str, ...]
    stage_of: tuple[int, ...]

    def inputs(self, stage: int) -> list[str]:
        """Names of the inputs that a stage takes."""
        return [name for name, place in zip(self.names, self.stage_of, strict=True) if place == stage]


@dataclass(frozen=True)
class Lowered:
    """A lowered function as PyTorch, in stages.

    early : one function a stage: (the stage's inputs, then what earlier stages saved) -> saved (num_saved, ...).
    main : the other inputs in the function's order, then what all stages saved -> list of output channels.
    stage_of : the stage that takes each input of the function (main takes the last).
    num_instructions : of main.
    """

    early: tuple[Callable[..., torch.Tensor], ...]
    main: Callable[..., list[Any]]
    stage_of: tuple[int, ...]
    num_instructions: int

    def __call__(self, *inputs: Any) -> list[Any]:
        """Output channels for all inputs in the function's order: every stage, then main."""
        saved: list[Any] = []
        for number, stage in enumerate((*self.early, self.main)):
            own = [given for given, place in zip(inputs, self.stage_of, strict=True) if place == number]
            saved.append(stage(*own, *saved))
        return list(saved[-1])


def lower(function: ca.Function, stages: Sequence[Sequence[str]] = STAGES) -> Lowered:
    """Lower an SX function of dense vectors with one output; `stages` names the inputs that are known early.

    An instruction that has no PyTorch counterpart raises ValueError with its number.
    """
    printed = print_function(function, stages, PYTORCH)
    last = len(stages)
    space: dict[str, Any] = {**_NAMES, "_stack": _stack}
    for number in range(last + 1):
        arguments = ", ".join([*printed.inputs(number), *(f"s{earlier}" for earlier in range(number))])
        saved = "" if number == last else ", ".join(printed.saved[number])
        end = f"[{', '.join(printed.outputs)}]" if number == last else f"_stack([{arguments}], [{saved}])"
        source = [f"def stage{number}({arguments}):", *printed.lines[number], f"    return {end}"]
        exec(compile("\n".join(source), f"<lowered {function.name()}>", "exec"), space)
    early = tuple(space[f"stage{number}"] for number in range(last))
    return Lowered(early, space[f"stage{last}"], printed.stage_of, len(printed.lines[last]))


def print_function(function: ca.Function, stages: Sequence[Sequence[str]], dialect: Dialect) -> Printed:
    """Print an SX function of dense vectors with one output; ValueError for an instruction the dialect lacks."""
    printer = _Printer(function, stages, dialect)
    for k in range(function.n_instructions()):
        printer.instruction(k)
    return printer.finish()


@dataclass(frozen=True)
class _Value:
    """What a work slot holds: its text, the stage that computes it (-1: a plain number), and if it is a boolean."""

    text: str
    stage: int
    truth: bool = False


class _Printer:
    """Prints instructions as lines, each in the earliest stage that knows its operands."""

    def __init__(self, function: ca.Function, stages: Sequence[Sequence[str]], dialect: Dialect) -> None:
        self.function = function
        self.dialect = dialect
        self.names = [function.name_in(i) for i in range(function.n_in())]
        early = {name: number for number, stage in enumerate(stages) for name in stage}
        self.last = len(stages)
        self.stage_of = [early.get(name, self.last) for name in self.names]
        self.lines: list[list[str]] = [[] for _ in range(self.last + 1)]
        self.saved: list[dict[str, int]] = [{} for _ in stages]
        self.slot: dict[int, _Value] = {}
        self.outputs: dict[int, _Value] = {}

    def instruction(self, k: int) -> None:
        """Print one instruction, or note a number, an input or an output."""
        operation = self.function.instruction_id(k)
        source, target = self.function.instruction_input(k), self.function.instruction_output(k)
        if operation == ca.OP_CONST:
            self.slot[target[0]] = _Value(repr(float(self.function.instruction_constant(k))), -1)
        elif operation == ca.OP_INPUT:
            self.slot[target[0]] = _Value(f"{self.names[source[0]]}[{source[1]}]", self.stage_of[source[0]])
        elif operation == ca.OP_OUTPUT:
            self.outputs[target[1]] = self.slot[source[0]]
        else:
            self.slot[target[0]] = self.operation(k, operation, [self.slot[i] for i in source])

    def operation(self, k: int, operation: int, operands: list[_Value]) -> _Value:
        """Print an operation; one on numbers alone is done here and now."""
        template = self.dialect.operations.get(operation)
        if template is None:
            raise ValueError(f"CasADi operation {operation} of {self.function.name()} has no counterpart")
        stage = max(operand.stage for operand in operands)
        if stage < 0:
            return _Value(repr(float(ca.evalf(_on_numbers(operation, [float(o.text) for o in operands])))), -1)
        bare = _TAKES_TRUTH.get(operation, 0)
        texts = [self.use(operand, stage, place < bare) for place, operand in enumerate(operands)]
        self.lines[stage].append(self.dialect.assignment.format(f"a{k}", template.format(*texts)))
        return _Value(f"a{k}", stage, operation in _TRUTH)

    def use(self, value: _Value, stage: int, truth_is_fine: bool = False) -> str:
        """Text of a value inside a stage; one of an earlier stage is saved there, as a number."""
        if value.stage < 0:
            return self.dialect.constant(float(value.text))
        if value.stage == stage:
            return self.dialect.number.format(value.text) if value.truth and not truth_is_fine else value.text
        text = self.dialect.number.format(value.text) if value.truth else value.text
        saved = self.saved[value.stage]
        return f"s{value.stage}[{saved.setdefault(text, len(saved))}]"

    def finish(self) -> Printed:
        """Everything that was printed."""
        outputs = tuple(self.use(self.outputs[i], self.last) for i in sorted(self.outputs))
        lines = tuple(tuple(stage) for stage in self.lines)
        return Printed(lines, tuple(map(tuple, self.saved)), outputs, tuple(self.names), tuple(self.stage_of))


def _on_numbers(operation: int, values: Sequence[float]) -> ca.SX:
    return ca.SX.unary(operation, values[0]) if len(values) == 1 else ca.SX.binary(operation, *values)


def _stack(inputs: Sequence[torch.Tensor], values: Sequence[Any]) -> torch.Tensor:
    """What a stage saves (num_saved, ...), as numbers; the shape is that of its inputs broadcast together."""
    shape = np.broadcast_shapes(*(channels.shape[1:] for channels in inputs))
    like = inputs[0]
    if not values:
        return like.new_empty((0, *shape))
    return torch.stack([torch.as_tensor(value, dtype=like.dtype).expand(shape) for value in values])
