"""Few drawn cases of a law in every run of the tests, and many more in the slow ones."""

from __future__ import annotations

from typing import Any

import pytest


def seeds(few: int, many: int) -> list[Any]:
    """The numbers from 0, as parameters: those from `few` on are marked slow."""
    return [*range(few), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(few, many))]
