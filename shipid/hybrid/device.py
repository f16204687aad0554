"""What computes here: the device, the threads and the vector instructions. PyTorch is imported where it is needed."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from shipid.errors import ShipidError


def check_device(device: str) -> None:
    """Raise ShipidError unless PyTorch can compute on the device, such as `cpu` or `cuda:0`."""
    if device == "cpu":
        return
    import torch

    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError, NotImplementedError):
        raise ShipidError("PyTorch has no such device here: use cpu", path=f"--device {device}") from None


def vectors() -> str:
    """Names of the vector instructions that NumPy found on this processor, such as X86_V4."""
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return " ".join(found) or "no further vectors"


def use_threads(count: int) -> None:
    """Set the threads of PyTorch and of NumPy's and SciPy's BLAS in this process.

    Networks and matrices as small as these lose time on more than one, and the last digit of a product depends on it.
    """
    import torch

    torch.set_num_threads(count)
    threadpool_limits(count, user_api="blas")
