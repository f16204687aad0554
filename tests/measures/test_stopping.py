"""A stop at constant deceleration on a slowly turning heading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.measures.stopping import stopping_measures
from tests.measures.made_records import DECELERATION, SPEED, START, VEER, every, stopped


@pytest.mark.parametrize("interval", [0.1, 1.0])
def test_reaches_of_a_constant_deceleration(interval: float) -> None:
    """Track U^2 / 2a in U / a; head reach and deviation as the integral of U cos, sin of the heading."""
    measures, time = stopping_measures(every(stopped(), interval)), SPEED / DECELERATION
    s = np.linspace(0, time, 200001)
    u = SPEED - DECELERATION * s
    assert measures["execute"].value == START
    assert measures["stopping_time"].value == pytest.approx(time, abs=1e-6)
    assert measures["track_reach"].value == pytest.approx(SPEED**2 / 2 / DECELERATION, abs=1e-3)
    assert measures["head_reach"].value == pytest.approx(np.trapezoid(u * np.cos(VEER * s), s), abs=1e-3)
    assert measures["lateral_deviation"].value == pytest.approx(np.trapezoid(u * np.sin(VEER * s), s), abs=1e-3)
    assert measures["heading_change"].value == pytest.approx(VEER * time, abs=1e-6)


def test_a_shaft_that_is_stopped_is_ordered_to_stop() -> None:
    record = every(stopped(), 0.5)
    drifting = replace(record, shaft=np.maximum(record.shaft, 0.0))
    for name, one in stopping_measures(record).items():
        assert stopping_measures(drifting)[name].value == pytest.approx(one.value), name
    astern = replace(record, shaft=np.full_like(record.t, -1.0))
    assert stopping_measures(astern)["execute"].value == record.t[0]


def test_without_a_shaft_nothing_is_known() -> None:
    measures = stopping_measures(replace(every(stopped(), 1.0), shaft=None))
    assert all(one.why == "the shaft is not ordered to stop or astern" for one in measures.values())
