"""Keys of a study document: times in whole steps."""

from __future__ import annotations

import pytest

from shipid.study.schema import Prediction


@pytest.mark.parametrize(("ahead", "step", "steps"), [(30.0, 1.0, 30), (10.0, 1 / 3, 30), (5.0, 0.3333333, 15)])
def test_a_horizon_is_whole_steps(ahead: float, step: float, steps: int) -> None:
    assert Prediction(ahead=ahead, step=step, interval=1.0).horizon == steps
