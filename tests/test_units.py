"""Factors to SI against quantities that are known in both units."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import shipid
from shipid.logs.mapping import UNITS
from shipid.units import (
    DEGREE,
    KNOT,
    MINUTE,
    RPM,
    decimals_for,
    digits,
    interval_text,
    length_text,
    level_text,
    listed,
    percent,
    unit_fault,
)


@pytest.mark.parametrize(
    ("value", "factor", "si"),
    [(120.0, RPM, 2.0), (180.0, DEGREE, math.pi), (1.0, KNOT, 1852.0 / 3600.0), (2.5, MINUTE, 150.0)],
)
def test_a_value_times_its_factor_is_si(value: float, factor: float, si: float) -> None:
    assert value * factor == pytest.approx(si, rel=1e-15)


def test_logs_use_the_same_factors() -> None:
    assert UNITS["rev/s"]["rpm"] == RPM
    assert UNITS["rad"]["deg"] == UNITS["rad/s"]["deg/s"] == DEGREE
    assert UNITS["rad/s"]["deg/min"] == pytest.approx(DEGREE / MINUTE)
    assert UNITS["m/s"]["kn"] == KNOT
    assert UNITS["s"]["min"] == MINUTE
    assert UNITS["rev/s"]["rad/s"] == pytest.approx(1 / (2 * math.pi))


@pytest.mark.parametrize(
    ("length", "text"),
    [
        (14.018, "14.02"),
        (0.1, "0.10"),
        (0.0344, "0.034"),
        (0.0995, "0.10"),
        (0.0994, "0.099"),
        (0.00995, "0.010"),
        (0.0121, "0.012"),
        (0.00994, "0.0099"),
        (-0.00052, "-0.00052"),
        (0.00004, "0.000040"),
        (0.0000006, "0.000001"),
        (0.0000004, "0.00"),
        (math.nan, "nan"),
        (0.0, "0.00"),
    ],
)
def test_lengths_of_a_small_model_are_no_zeros(length: float, text: str) -> None:
    assert length_text(length) == text


@pytest.mark.parametrize(
    ("value", "digits", "decimals"), [(12.3, 3, 1), (-0.0451, 3, 4), (1234.0, 3, 0), (9.99, 4, 3), (0.0, 3, 2)]
)
def test_a_number_has_so_many_digits(value: float, digits: int, decimals: int) -> None:
    assert decimals_for(value, digits) == decimals


def test_percent_signs_stand_apart_from_their_number() -> None:
    assert [percent(0.284), percent(0.0312, 1), percent(1.0), percent(-0.14, signed=True)] == [
        "28 %",
        "3.1 %",
        "100 %",
        "-14 %",
    ]
    assert percent(0.02, signed=True) == "+2 %"


def test_there_is_one_way_to_write_percent() -> None:
    """A format such as .0% joins the sign to its number."""
    for file in Path(shipid.__file__).parent.rglob("*.py"):
        assert not re.search(r":[+.\d]*%\}", file.read_text()), file


@pytest.mark.parametrize(
    ("low", "high", "shown"),
    [
        (0.681, 1.4, "0.68 ... 1.40"),
        (1.02548, 1.03594, "1.0255 ... 1.0359"),
        (-9.281, -1.1, "-9.3 ... -1.1"),
        (-0.004, 5.2, "0.0 ... 5.2"),
        (1450.2, 2210.0, "1450 ... 2210"),
        (1.0, 1.0 + 1e-9, "1.000000 ... 1.000000"),
        (1.0, 1.0, "1.0 ... 1.0"),
        (-float("inf"), float("inf"), "-inf ... inf"),
    ],
)
def test_both_ends_of_an_interval_have_the_decimals_of_its_width(low: float, high: float, shown: str) -> None:
    assert interval_text(low, high) == shown


def test_names_are_listed_as_in_a_sentence() -> None:
    assert [listed(list("abc")[:count]) for count in range(4)] == ["", "a", "a and b", "a, b and c"]


def test_digits_before_the_point_are_never_rounded() -> None:
    values = (0.012345, 12.345, 999.4, 1234.5, -4321.0)
    assert [digits(value) for value in values] == ["0.0123", "12.3", "999", "1234", "-4321"]
    assert digits(12.345, 2, "+") == "+12"


def test_digits_have_no_exponent_above_one() -> None:
    """Nor is 999.7, which has three digits, written 1e+03."""
    for value in [*10.0 ** np.arange(-6, 8), 999.4, 999.5, 999.7, 99.97, 123456.7, 0.0123456]:
        for most in (2, 3):
            for signed in (value, -value):
                text = digits(signed, most)
                assert "e+" not in text
                assert float(text) == pytest.approx(signed, rel=0.5 * 10.0 ** (1 - most))
                assert abs(value) < 10**most or abs(float(text) - signed) <= 0.5


def test_a_level_has_all_its_decimals() -> None:
    levels = {0.9: "90 %", 0.975: "97.5 %", 0.125: "12.5 %", 0.29: "29 %", 0.57: "57 %", 0.999: "99.9 %"}
    assert {level: level_text(level) for level in levels} == levels


QUOTIENTS = ["N s^1.5 m^-1.5", "m^0.5", "kg/m/s", "N/(m/s)^2", "1/(m s)", "N/(m (rad/s)^2)", "deg/s", "rev/s"]


@pytest.mark.parametrize(
    "unit", ["m", "N m", "kg m^-3", "kg m^-1 s^2", "m/s^2", "1/s", "rad/s", "-", "prime", *QUOTIENTS]
)
def test_products_of_powers_are_units(unit: str) -> None:
    assert unit_fault(unit) == ""


@pytest.mark.parametrize(
    ("unit", "right"),
    [
        ("meter", "m"),
        ("metres^2", "m^2"),
        ("m2", "m^2"),
        ("m²", "m^2"),
        ("kg m⁻³", "kg m^-3"),
        ("kg*m**-1", "kg m^-1"),
        ("kg·m2 / s", "kg m^2/s"),
        ("Nm", "N m"),
        ("Seconds", "s"),
        ("kg*m^1.5", "kg m^1.5"),
        ("N/(metre*s)", "N/(m s)"),
        ("m^(-1)", "m^-1"),
        ("metre per second", "m/s"),
        ("", "-"),
        ("1", "-"),
    ],
)
def test_another_spelling_of_a_unit_is_put_right(unit: str, right: str) -> None:
    assert unit_fault(unit) == f"write {right!r}"


@pytest.mark.parametrize(
    ("unit", "part", "right"),
    [
        ("kN", "kN", "N"),
        ("kN m", "kN", "N"),
        ("kg/mm^2", "mm", "m"),
        ("%", "%", "-"),
        ("N/knots", "knots", "m/s"),
        ("rpm", "rpm", "rev/s"),
        ("lb", "lb", "kg"),
        ("kPa", "kPa", "Pa"),
    ],
)
def test_the_part_that_is_none_of_the_units_is_named_with_one_that_is(unit: str, part: str, right: str) -> None:
    assert unit_fault(unit) == f"{part} is none of the units: write {right}"


@pytest.mark.parametrize(
    ("unit", "begin"), [("foo m^2", "foo is none of the units: write a"), ("m/(s", "write a"), ("m^", "m^ is none")]
)
def test_no_unit_of_shipid_is_refused_with_all_that_are(unit: str, begin: str) -> None:
    assert unit_fault(unit).startswith(begin)
    assert "kg, m, s, N, rad, deg, rev, Pa, W, J, K and Hz" in unit_fault(unit)
