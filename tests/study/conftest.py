"""What the tests of studies share."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from shipid.data.dataset import Dataset, write_dataset
from shipid.study.plan import Plan, build_plan
from tests.answer.byhand import by_hand
from tests.study.tiny import tiny_plan


@pytest.fixture
def made(tmp_path: Path) -> Any:
    """`by_hand` in a new folder."""
    return partial(by_hand, tmp_path)


@pytest.fixture
def recorded(tmp_path: Path) -> Callable[..., tuple[Plan, Dataset]]:
    """A plan on a recorded dataset that the test makes."""

    def make(dataset: Dataset, **changes: Any) -> tuple[Plan, Dataset]:
        file = write_dataset(dataset, tmp_path / "log.parquet")
        document = tiny_plan(tmp_path).document
        del document["truth"]
        document |= {"data": {"dataset": str(file)}, "grid": {"N_D": [2]}, **changes}
        return build_plan(document, tmp_path / "tiny.toml"), dataset

    return make
