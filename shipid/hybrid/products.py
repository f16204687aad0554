"""Products of matrices for tensors of PyTorch on the processor, by NumPy: both share their memory.

On AMD products and functions of NumPy take a third to nine tenths of the time of those of PyTorch, except tanh with
AVX2 only: docs/performance.md, "Where the time goes". Tensors have no gradients here.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from torch import Tensor


def matrix_product(left: Tensor, right: Tensor) -> Tensor:
    """Return left @ right, of matrices or stacks of them."""
    return torch.from_numpy(np.matmul(left.numpy(), right.numpy()))


def hidden_layer(values: Tensor, weight: Tensor, offset: Tensor) -> Tensor:
    """Return tanh(values @ weight + offset): units (S, M) of inputs (S, d) by weights (d, M) and offsets (M,)."""
    units = np.matmul(values.numpy(), weight.numpy())
    units += offset.numpy()
    return torch.from_numpy(units).tanh_() if _tanh_by_torch() else torch.from_numpy(np.tanh(units, out=units))


@cache
def _tanh_by_torch() -> bool:
    """Whether NumPy's tanh is the one for AVX2, which takes twice the time of PyTorch's; that for AVX-512 does not."""
    functions = np.lib.introspect.opt_func_info(func_name="^tanh$", signature="float64")  # empty on some processors
    used = [kind["current"] for kinds in functions.values() for kind in kinds.values()]
    return any(name in ("X86_V3", "FMA3__AVX2") for name in used)  # as NumPy 2.4 calls AVX2, and as 2.3 does
