from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest
from pydantic import PositiveInt

from shipid.hybrid.journal import open_journal
from shipid.hybrid.search import (
    Scale,
    SearchMethod,
    diverged_result,
    trial_points,
    trial_row,
)


class Counting(SearchMethod):
    """Whole numbers, shares, and a number by its logarithm."""

    SEARCHED: ClassVar[tuple[str, ...]] = ("neighbours", "share", "width")
    COUNTS: ClassVar[tuple[str, ...]] = ("neighbours",)
    LINEAR: ClassVar[tuple[str, ...]] = ("share",)

    trials: PositiveInt = 64
    neighbours: Scale = (1.5, 20.0)
    share: tuple[float, float] = (0.2, 0.7)
    width: Scale = (1.0, 100.0)

    def fit(self, task):
        return {name: diverged_result(self, trial_points(self)) for name in task.targets}


def test_counts_are_whole_and_linear_settings_evenly_spread(tmp_path):
    """And the journal gives every trial back to the digit, whole numbers as such."""
    method = Counting()
    points = list(trial_points(method))
    neighbours = {point["neighbours"] for point in points}
    assert {2.0, 3.0} <= neighbours <= {float(number) for number in range(2, 21)}
    for name, middle in (("share", 0.45), ("width", 10.0)):
        assert np.mean([point[name] < middle for point in points]) == pytest.approx(0.5, abs=0.05)
    assert all(0.2 <= point["share"] <= 0.7 and 1 <= point["width"] <= 100 for point in points)
    rows = [trial_row(number, point, 1.0, 0.0) for number, point in enumerate(points)]
    open_journal(tmp_path / "trials.log").add({"a": rows})
    kept = open_journal(tmp_path / "trials.log").rows("a")
    assert [repr(row["params"]) for row in kept] == [repr(point) for point in points]
