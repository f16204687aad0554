"""What the tests of studies share."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.study.byhand import by_hand


@pytest.fixture
def made(tmp_path: Path) -> Any:
    """`by_hand` in a folder of its own."""
    return partial(by_hand, tmp_path)
