"""Factors to SI against quantities that are known in both units."""

from __future__ import annotations

import math

import pytest

from shipid.logs.mapping import UNITS
from shipid.units import (
    DEGREE,
    KNOT,
    MINUTE,
    RPM,
    digit_decimals,
    interval_text,
    join_names,
    length_text,
    percent_text,
    significant_digits,
    unit_fault,
    unit_value,
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
    assert digit_decimals(value, digits) == decimals


def test_percent_signs_stand_apart_from_their_number() -> None:
    assert [percent_text(0.284), percent_text(0.0312, 1), percent_text(1.0), percent_text(-0.14, signed=True)] == [
        "28 %",
        "3.1 %",
        "100 %",
        "-14 %",
    ]
    assert percent_text(0.02, signed=True) == "+2 %"


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
    assert [join_names(list("abc")[:count]) for count in range(4)] == ["", "a", "a and b", "a, b and c"]


def test_digits_before_the_point_are_never_rounded() -> None:
    values = (0.012345, 12.345, 999.4, 1234.5, -4321.0)
    assert [significant_digits(value) for value in values] == ["0.0123", "12.3", "999", "1234", "-4321"]
    assert significant_digits(12.345, 2, "+") == "+12"


QUOTIENTS = ["N s^1.5 m^-1.5", "m^0.5", "kg/m/s", "N/(m/s)^2", "1/(m s)", "N/(m (rad/s)^2)", "deg/s", "rev/s"]


@pytest.mark.parametrize(
    "unit", ["m", "N m", "kg m^-3", "kg m^-1 s^2", "m/s^2", "1/s", "rad/s", "-", "prime", *QUOTIENTS]
)
def test_products_of_powers_are_units(unit: str) -> None:
    assert unit_fault(unit) == ""


@pytest.mark.parametrize(
    ("unit", "begin"), [("foo m^2", "write a product"), ("m/(s", "write a product"), ("kN", "write a product")]
)
def test_no_unit_of_shipid_is_refused_with_all_that_are(unit: str, begin: str) -> None:
    assert unit_fault(unit).startswith(begin)
    assert "kg, m, s, N, rad, deg, rev, Pa, W, J, K and Hz" in unit_fault(unit)


@pytest.mark.parametrize(
    ("unit", "value"),
    [
        ("kg m^-5 s^4", 7 * 2**-5 * 3**4),
        ("N s^1.5/m", 7 * 3**-0.5),
        ("1/(kg m)/s", 1 / 42),
        ("rad/s", 1 / 3),
        ("W", 28 / 27),
        ("prime", 1),
        ("-", 1),
        ("(m/(s kg))^2", (2 / 21) ** 2),
        ("Pa", 7 / 18),
        ("rev/s^2", 1 / 9),
    ],
)
def test_a_unit_has_the_value_of_its_parts(unit: str, value: float) -> None:
    assert unit_value(unit, {"m": 2, "s": 3, "kg": 7}) == pytest.approx(value, rel=1e-15)
    assert unit_value(unit, {}) == 1
