"""Rows of a table: degrees for radians, ship lengths for metres, words for verdicts."""

from __future__ import annotations

import math

import pytest

from shipid.measures.criteria import Criterion
from shipid.measures.record import Measures
from shipid.measures.rows import criterion_rows, measure_rows


def test_angles_are_in_degrees_and_distances_also_in_ship_lengths() -> None:
    measures = Measures()
    measures.add("", overshoot_1=(math.radians(12.0), "rad"))
    measures.add("", advance=(150.0, "m"))
    measures.add("the log ends before the fourth execute", period=(float("nan"), "s"))
    angle, distance, period = measure_rows(measures, 50.0)
    assert (angle["measure"], angle["unit"]) == ("overshoot 1", "deg")
    assert angle["value"] == pytest.approx(12.0)
    assert math.isnan(angle["lengths"])
    assert (distance["value"], distance["lengths"], distance["unit"]) == (150.0, 3.0, "m")
    assert period["note"] == "the log ends before the fourth execute"


def test_without_a_ship_length_there_are_no_lengths() -> None:
    measures = Measures()
    measures.add("", advance=(150.0, "m"))
    assert math.isnan(measure_rows(measures, None)[0]["lengths"])


@pytest.mark.parametrize(("met", "verdict"), [(True, "met"), (False, "not met"), (None, "not judged")])
def test_a_verdict_is_in_words(met: bool | None, verdict: str) -> None:
    row = criterion_rows([Criterion("yaw", math.radians(9.0), math.radians(10.0), "rad", met, "why")])[0]
    assert row["verdict"] == verdict
    assert (row["value"], row["limit"]) == (pytest.approx(9.0), pytest.approx(10.0))
    assert row["unit"] == "deg"
