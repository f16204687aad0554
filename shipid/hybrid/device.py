"""What computes here: the threads and the vector instructions. PyTorch is imported where it is needed."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits


def vector_instructions() -> str:
    """Vector instructions that NumPy found on this processor, and the kernels of its BLAS, such as X86_V4, Zen."""
    found = np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", [])
    kernels = {str(library["architecture"]) for library in threadpool_info() if "architecture" in library}
    return ", ".join(filter(None, [" ".join(found), *sorted(kernels)])) or "no further vectors"


def use_threads(count: int) -> None:
    """Set the threads of PyTorch and of NumPy's and SciPy's BLAS in this process.

    Networks and matrices as small as these lose time on more than one, and the last digit of a product depends on it.
    """
    import scipy.linalg  # noqa: F401  - a BLAS can be limited once it is loaded
    import torch

    torch.set_num_threads(count)
    threadpool_limits(count, user_api="blas")
