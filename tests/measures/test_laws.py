"""Laws that the measures of every kind of manoeuvre obey."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.measures.criteria import judge_criteria, measure_rows
from shipid.measures.recognise import recognise_kinds
from shipid.measures.record import Measures, Record
from shipid.simulation.standard import standard_manoeuvres
from shipid.units import DEGREE
from tests.measures.made_records import RECORDS, every, rows

MEASURES = {kind: trial.measures for kind, trial in standard_manoeuvres().items()}
KINDS = list(MEASURES)
DENSE = {kind: every(sail(), 0.05) for kind, sail in RECORDS.items()}
SIGNED = ("lateral_deviation", "neutral_helm")  # to starboard
TOLERANCE = {"rad": 0.02 * DEGREE, "m": 0.1, "s": 0.02, "m/s": 0.002, "rad/s": 0.002 * DEGREE, "-": 0.002}


def same(measures: Measures, expected: Measures, scale: float = 1.0) -> None:
    """Equal to `scale` of the stated tolerance."""
    assert list(measures) == list(expected)
    for name, one in expected.items():
        close = pytest.approx(one.value, abs=scale * TOLERANCE[one.unit], nan_ok=True)
        assert measures[name].value == close, name
        assert measures[name].why == one.why, name


def test_every_kind_has_a_record() -> None:
    assert set(RECORDS) == set(MEASURES)


@pytest.mark.parametrize("interval", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("kind", KINDS)
def test_sampling_changes_nothing(kind: str, interval: float) -> None:
    """0.02 deg, 0.1 m, 0.02 s and 0.2 % between 20 Hz and 1 Hz; all that can be measured is."""
    dense = MEASURES[kind](DENSE[kind])
    assert all(np.isfinite(one.value) for one in dense.values())
    same(MEASURES[kind](every(RECORDS[kind](), interval)), dense)


@pytest.mark.parametrize("kind", KINDS)
def test_place_course_and_clock_change_nothing(kind: str) -> None:
    one, turn = DENSE[kind], 2.5
    moved = replace(
        one,
        t=one.t,
        north=np.cos(turn) * one.north - np.sin(turn) * one.east + 4e3,
        east=np.sin(turn) * one.north + np.cos(turn) * one.east - 7e3,
        psi=(one.psi + turn + np.pi) % (2 * np.pi) - np.pi,
    )
    same(MEASURES[kind](moved), MEASURES[kind](one), 1e-4)
    later = MEASURES[kind](replace(one, t=one.t + 1e4))
    expected = MEASURES[kind](one)
    for name in expected:
        offset = 1e4 if name == "execute" else 0.0
        assert later[name].value == pytest.approx(expected[name].value + offset, abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_port_mirrors_starboard(kind: str) -> None:
    one = DENSE[kind]
    mirrored = replace(one, **{name: -getattr(one, name) for name in ("east", "psi", "v", "r", "helm")})
    expected, measures = MEASURES[kind](one), MEASURES[kind](mirrored)
    for name in expected:
        signed = name in SIGNED or (kind == "stop" and name == "heading_change")
        assert measures[name].value == pytest.approx(
            -expected[name].value if signed else expected[name].value, abs=1e-9
        )


@pytest.mark.parametrize("kind", KINDS)
def test_models_scale_to_ships_by_froude(kind: str) -> None:
    """Lengths times 4, times times 2: each measure follows its unit."""
    one, (length, time) = DENSE[kind], (4.0, 2.0)
    grown = replace(
        one,
        t=one.t * time,
        north=one.north * length,
        east=one.east * length,
        u=one.u * length / time,
        v=one.v * length / time,
        r=one.r / time,
    )
    factors = {"rad": 1.0, "-": 1.0, "m": length, "s": time, "m/s": length / time, "rad/s": 1 / time}
    expected, measures = MEASURES[kind](one), MEASURES[kind](grown)
    for name in expected:
        factor = factors[expected[name].unit]
        assert measures[name].value == pytest.approx(factor * expected[name].value, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_missing_says_why(kind: str) -> None:
    """However early a log ends, and whatever it holds: no exception, and a sentence for each NaN."""
    one = every(DENSE[kind], 0.01 * 20)  # 1 Hz
    short = [rows(one, slice(0, count)) for count in (2, 3, 5, 9, 11, 12, 14, 20, 30, 60, 100)]
    still = Record(one.t, *(np.zeros_like(one.t) for _ in range(7)))
    for record in (*short, still, *(every(DENSE[other], 0.2) for other in KINDS)):
        for measure in MEASURES.values():
            measures = measure(record)
            assert all(np.isfinite(m.value) == (m.why == "") for m in measures.values()), measures
            measure_rows(measures, 100.0)
        judge_criteria(kind, MEASURES[kind](record), 100.0)
        recognise_kinds(record)


@pytest.mark.parametrize("kind", KINDS)
def test_kinds_are_recognised(kind: str) -> None:
    """A spiral is seen to be one; which, the user has to say."""
    kinds, why = recognise_kinds(every(DENSE[kind], 0.2))
    expected = {"pull-out": ("turning", "pull-out"), "spiral": ()}
    assert kinds == expected.get(kind, (kind,))
    assert ("whether it is a spiral" in why) == ("spiral" in kind)
