"""Seeds of drawn cases: a few in `make test`, the others in `make slow`."""

from __future__ import annotations

from typing import Any

import pytest

FEW = 2


def seeds(count: int) -> list[Any]:
    """Seeds 0, 1, ... for `pytest.mark.parametrize`; those from the third on are slow."""
    return [seed if seed < FEW else pytest.param(seed, marks=pytest.mark.slow) for seed in range(count)]
