"""Lowers a CasADi SX function to PyTorch: each instruction becomes a tensor operation over (variant, sample)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import torch

from shipid.engine.printing import ARITHMETIC, STAGES, Dialect, print_function

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
    space: dict[str, Any] = {**_NAMES, "_stack": _stack_saved, "_channels": _split_saved}
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


def _stack_saved(inputs: Sequence[torch.Tensor], values: Sequence[Any]) -> torch.Tensor:
    """Saved values of a stage as one tensor (num_saved, ...), in the broadcast shape of the inputs."""
    shape = np.broadcast_shapes(*(channels.shape[1:] for channels in inputs))
    like = inputs[0]
    if not values:
        return like.new_empty((0, *shape))
    return torch.stack([torch.as_tensor(value, dtype=like.dtype).expand(shape) for value in values])
