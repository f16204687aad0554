"""Names of columns: their stems, their units, and what they may be."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State, stem, unit_said


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Heading [deg]", "heading"),
        ("SOG_kn", "sog"),
        ("Yaw Rate(deg/s)", "yaw_rate"),
        ("shaft_rpm", "shaft_rpm"),
        ("rpm", "rpm"),
        ("wind-speed_m/s", "wind_speed"),
    ],
)
def test_a_stem_has_no_unit(name: str, expected: str) -> None:
    assert stem(name) == expected


@pytest.mark.parametrize(
    ("name", "si", "unit"),
    [
        ("sog [kn]", "m/s", "kn"),
        ("sog (knots)", "m/s", "kn"),
        ("speed_kmh", "m/s", "km/h"),
        ("psi_rad", "rad", "rad"),
        ("rot [deg/min]", "rad/s", "deg/min"),
        ("shaft rpm", "rev/s", "rpm"),
        ("rpm", "rev/s", "rpm"),
        ("heading", "rad", None),
        ("sog [kn]", "rad", None),
        ("deg", "rad", None),
    ],
)
def test_a_unit_is_read_only_where_the_column_can_have_it(name: str, si: str, unit: str | None) -> None:
    assert unit_said(name, si) == unit


@pytest.fixture
def state() -> State:
    t = np.arange(100.0)
    names = ("heading [deg]", "hdg_2", "sog", "SOG [kn]", "lat", "fuel")
    return State(t, "s", dict.fromkeys(names, t), evidence.windows(t))


def test_a_name_fits_a_meaning(state: State) -> None:
    assert "heading [deg]" in state.called("psi")
    assert state.called("speed") == ["sog", "SOG [kn]"]
    assert state.called("latitude") == ["lat"]
    assert state.called("longitude") == []


def test_a_suggestion_takes_its_column(state: State) -> None:
    state.suggest("u", "sog", "m/s", 0.87654, "a reason", sign=-1)
    assert "sog" not in state.free()
    assert state.called("speed") == ["SOG [kn]"]
    assert state.all_called("speed") == ["sog", "SOG [kn]"]
    (suggestion,) = state.suggestions
    assert (suggestion.confidence, suggestion.extra) == (0.88, {"sign": -1})


def test_findings_are_kept_in_order(state: State) -> None:
    state.find("clipped", ("rpm",), 0.7, "a sentence")
    state.find("late heading", ("psi",), 0.9, "another", {"kind": "break"})
    assert [(finding.kind, finding.repair) for finding in state.findings] == [
        ("clipped", None),
        ("late heading", {"kind": "break"}),
    ]
