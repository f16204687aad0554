"""The PyTorch engine: width of blocks. `test_lowering.py` has its agreement with CasADi."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from shipid.engine import torch as engine  # noqa: E402


@pytest.mark.parametrize("num_samples", [1, 255, 256, 8193, 20000])
@pytest.mark.parametrize("num_variants", [1, 16, 10_000])
def test_blocks_are_about_equal_and_bounded(num_samples: int, num_variants: int) -> None:
    width = engine._block_width(num_samples, num_variants, 1, "cpu")
    assert width * num_variants <= max(engine.CPU_BLOCK, engine.LEAST_SAMPLES * num_variants)
    assert -(-num_samples // width) * width - num_samples <= num_samples // width
