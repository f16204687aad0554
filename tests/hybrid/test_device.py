"""What computes: one thread is one thread for every library."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest
import torch
from threadpoolctl import threadpool_info

from shipid.hybrid.device import use_threads, vector_instructions


def threads() -> set[int]:
    """Threads of PyTorch and of every BLAS in this process."""
    _ = np.ones((2, 2)) @ np.ones((2, 2))
    return {torch.get_num_threads(), *(one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas")}


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    yield
    use_threads(1)


@pytest.mark.parametrize("count", [2, 1])
def test_threads_are_those_of_every_library(count: int) -> None:
    use_threads(count)
    assert threads() == {count}


def test_the_processor_needs_no_pytorch() -> None:
    code = (
        "import sys; from shipid.engine.engines import check_device; from shipid.hybrid import device; "
        "check_device('cpu'); print(device.vector_instructions(), 'torch' in sys.modules)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == f"{vector_instructions()} False\n"
