"""Limits of IMO MSC.137(76), 5.3, and when a manoeuvre is judged by them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shipid.measures.criteria import (
    Criterion,
    criterion_rows,
    first_overshoot_limit,
    judge_criteria,
    measure_rows,
    second_overshoot_limit,
)
from shipid.measures.record import AT_REST, Measures
from shipid.units import DEGREE
from tests.measures.made_records import RECORDS, every
from tests.measures.test_laws import MEASURES


@pytest.mark.parametrize(
    ("ratio", "first", "second"), [(5, 10, 25), (10, 10, 25), (20, 15, 32.5), (30, 20, 40), (60, 20, 40)]
)
def test_limits_of_the_overshoots(ratio: float, first: float, second: float) -> None:
    """5.3.3.1 and 5.3.3.2: constant below L/V = 10 s and from 30 s on, linear between."""
    assert first_overshoot_limit(ratio) / DEGREE == pytest.approx(first)
    assert second_overshoot_limit(ratio) / DEGREE == pytest.approx(second)


def judged(kind: str, length: float | None, **values: float) -> dict[str, tuple[float, float, bool | None, str]]:
    measures = MEASURES[kind](every(RECORDS[kind](), 0.5))
    changed = Measures()
    for name, one in measures.items():
        changed.add(one.why or "is missing", **{name: (values.get(name, one.value), one.unit)})
    judgements = judge_criteria(kind, changed, length)
    return {one.name.rpartition("(")[2].rstrip(")"): (one.value, one.limit, one.met, one.note) for one in judgements}


def test_a_turning_circle() -> None:
    assert judged("turning", 200.0, advance=880.0, tactical_diameter=1010.0) == {
        "5.3.1": (pytest.approx(5.05), 5.0, False, "")
    }
    rows = judge_criteria("turning", MEASURES["turning"](every(RECORDS["turning"](), 0.5)), 200.0)
    assert [(one.limit, one.met) for one in rows] == [(4.5, True), (5.0, True)]
    value, _, met, note = judged("turning", 200.0, helm=20 * DEGREE)["5.3.1"]
    assert np.isfinite(value)
    assert met is None
    assert "not 35" in note


def test_a_turning_circle_in_a_current_is_not_judged() -> None:
    slow = judged("turning", 200.0, steady_speed=5.0, current_speed=0.4)["5.3.1"]
    assert slow[2:] == (True, "")
    _, _, met, note = judged("turning", 200.0, steady_speed=5.0, current_speed=0.6)["5.3.1"]
    assert met is None
    assert "carried the ship at 0.6 m/s" in note


def test_a_zigzag() -> None:
    by_claim = judged("zigzag", 200.0, approach_speed=5.0, overshoot_1=19 * DEGREE, overshoot_2=41 * DEGREE)
    assert list(by_claim) == ["5.3.2", "5.3.3.1", "5.3.3.2"]
    assert by_claim["5.3.3.1"] == (pytest.approx(19 * DEGREE), pytest.approx(20 * DEGREE), True, "")
    assert by_claim["5.3.3.2"][1:] == (pytest.approx(40 * DEGREE), False, "")
    both = {"helm": 20 * DEGREE, "execute_heading": 20 * DEGREE}
    assert list(judged("zigzag", 200.0, **both)) == ["5.3.3.3"]
    assert judged("zigzag", 200.0, helm=20 * DEGREE) == {}


@pytest.mark.parametrize(("helm", "heading"), [(10, 5), (10, 20), (20, 10), (15, 15), (9, 10), (10, 11)])
def test_a_zigzag_of_other_angles_is_not_judged(helm: float, heading: float) -> None:
    """The standards are for 10/10 and 20/20: both angles count."""
    assert judged("zigzag", 200.0, helm=helm * DEGREE, execute_heading=heading * DEGREE) == {}


def test_a_stop() -> None:
    assert judged("stop", 100.0, track_reach=1500.0)["5.3.4"][2:] == (True, "")
    _, _, met, note = judged("stop", 100.0, track_reach=1600.0)["5.3.4"]
    assert met is False
    assert "up to 20 L" in note


def test_what_is_not_judged_says_why() -> None:
    assert judged("stop", None)["5.3.4"][2:] == (None, "the length of the ship is not known")
    assert judged("stop", 100.0, track_reach=np.nan)["5.3.4"][2:] == (None, "is missing")
    assert "100 m and more" in judged("stop", 50.0)["5.3.4"][3]
    at_rest = judged("zigzag", 200.0, approach_speed=0.0)
    assert [at_rest[one][2:] for one in ("5.3.3.1", "5.3.3.2")] == [(None, AT_REST)] * 2


@pytest.mark.parametrize(
    ("kind", "measure", "most", "paragraph", "changes"),
    [
        ("turning", "tactical_diameter", 5.0 * 200.0, "5.3.1", {}),
        ("zigzag", "initial_turning", 2.5 * 200.0, "5.3.2", {}),
        ("zigzag", "overshoot_1", 15.0 * DEGREE, "5.3.3.1", {"approach_speed": 10.0}),
        ("zigzag", "overshoot_2", 32.5 * DEGREE, "5.3.3.2", {"approach_speed": 10.0}),
        ("zigzag", "overshoot_1", 25.0 * DEGREE, "5.3.3.3", {"helm": 20 * DEGREE, "execute_heading": 20 * DEGREE}),
        ("stop", "track_reach", 15.0 * 200.0, "5.3.4", {}),
    ],
)
def test_a_measure_up_to_its_limit_is_met(
    kind: str, measure: str, most: float, paragraph: str, changes: dict[str, float]
) -> None:
    """Of a ship of 200 m; the numbers are those of the resolution."""
    for value, met in ((most * (1 - 1e-9), True), (most * (1 + 1e-9), False)):
        assert judged(kind, 200.0, **{**changes, measure: value})[paragraph][2] is met


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
