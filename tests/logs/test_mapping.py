"""Mappings: what is declared is read in SI units; what contradicts itself is refused with its key."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.document import bundled_documents
from shipid.errors import DocumentError
from shipid.logs.mapping import (
    EPOCHS,
    INPUTS,
    UNITS,
    clock_seconds,
    degrees_in_text,
    is_dated,
    read_mapping,
    to_si,
)
from shipid.logs.repairs import REPAIRS, Despike

Write = Callable[..., Path]


@pytest.mark.parametrize("name", bundled_documents("studies/mappings"))
def test_bundled_mappings_are_valid_and_have_a_source(name: str) -> None:
    mapping = read_mapping(name)
    assert mapping.source.url is not None or mapping.source.file is not None
    assert len(mapping.digest) >= 16


DEFINED = {  # from the definitions: an inch is 25.4 mm, a nautical mile 1852 m, a turn 2 pi
    "s": {"s": 1, "ms": 1 / 1000, "us": 1 / 1000**2, "ns": 1 / 1000**3, "min": 60, "h": 60 * 60, "d": 24 * 60 * 60}
    | {
        "date": 1,
        "datenum": 1,
        "excel": 1,
        "mjd": 1,
        "jd": 1,
        "hhmmss": 1,
        "s of day": 1,
        "s of week": 1,
        "ms of day": 1e-3,
        "ms of week": 1e-3,
        "s + ns": 1,
        "s + us": 1,
    },
    "m": {"m": 1, "cm": 1 / 100, "mm": 1 / 1000, "km": 1000, "ft": 12 * 0.0254, "nmi": 1852},
    "m/s": {
        "m/s": 1,
        "kn": 1852 / 3600,
        "km/h": 1000 / 3600,
        "mph": 1609.344 / 3600,
        "cm/s": 1 / 100,
        "mm/s": 1 / 1000,
    },
    "rad": {"rad": 1, "deg": 2 * math.pi / 360, "ddmm": 2 * math.pi / 360, "quaternion": 1},
    "rad/s": {"rad/s": 1, "deg/s": 2 * math.pi / 360, "deg/min": 2 * math.pi / 360 / 60},
    "rev/s": {"rev/s": 1, "rpm": 1 / 60, "rad/s": 1 / (2 * math.pi)},
    "N": {"N": 1, "kN": 1000},
    "N m": {"N m": 1, "kN m": 1000, "Nm": 1, "kNm": 1000},
    "-": {"-": 1, "%": 1 / 100},
}


@pytest.mark.parametrize("si", UNITS)
def test_every_unit_is_as_it_is_defined(si: str) -> None:
    assert UNITS[si] == pytest.approx(DEFINED[si], rel=1e-15)


@pytest.mark.parametrize(
    ("unit", "name", "factor"),
    [
        ("deg", "psi", math.pi / 180),
        ("kn", "speed", 1852 / 3600),
        ("rpm", "port.n", 1 / 60),
        ("deg/min", "r", math.pi / 10800),
        ("ms", "t", 1e-3),
        ("deg", "latitude", math.pi / 180),
    ],
)
def test_units_of_columns(unit: str, name: str, factor: float) -> None:
    assert to_si(unit, name) == pytest.approx(factor)


@pytest.mark.parametrize(
    ("unit", "value", "moment"),
    [
        ("datenum", 738000.25, "2020-07-28 06:00"),  # MATLAB: datestr(738000.25)
        ("datenum", 719529.0, "1970-01-01 00:00"),
        ("excel", 44040.25, "2020-07-28 06:00"),  # a sheet shows the cell 44040.25 so
        ("excel", 25569.0, "1970-01-01 00:00"),
        ("excel", 61.0, "1900-03-01 00:00"),  # after 29 February 1900, which only Excel has
        ("jd", 2451545.0, "2000-01-01 12:00"),  # J2000.0
        ("mjd", 51544.5, "2000-01-01 12:00"),
        ("mjd", 40587.0, "1970-01-01 00:00"),
    ],
)
def test_days_of_a_calendar_are_dates(unit: str, value: float, moment: str) -> None:
    since = datetime.fromisoformat(moment).replace(tzinfo=UTC).timestamp()
    assert clock_seconds(np.array([value]), unit).tolist() == [since]
    assert is_dated(unit)


@pytest.mark.parametrize("unit", UNITS["s"])
def test_a_clock_has_the_same_seconds_in_every_unit(unit: str) -> None:
    """Differences are those of the unit; only days of a calendar have another zero."""
    random = np.random.default_rng(7)
    days = random.uniform(44000.0, 46000.0) if unit in EPOCHS else random.uniform(0.0, 2.0)
    values = days + np.cumsum(random.uniform(1e-6, 1e-3, 50))
    t = clock_seconds(values, unit)
    size = 24 * 3600 if unit in EPOCHS else DEFINED["s"][unit]
    np.testing.assert_allclose(np.diff(t), np.diff(values) * size, rtol=1e-4, atol=1e-9 * size)
    assert is_dated(unit) or t[0] == pytest.approx(values[0] * size)


def test_hours_minutes_and_seconds_in_one_number_go_on_after_midnight() -> None:
    values = np.array([235958.5, 235959.5, 0.5, 1.5, 100.0, 123005.25])
    since = [86398.5, 86399.5, 86400.5, 86401.5, 86460.0, 86400.0 + 45005.25]
    np.testing.assert_allclose(clock_seconds(values, "hhmmss"), since, atol=1e-9)
    assert np.isnan(clock_seconds(np.array([240000.0, 126000.0, 120061.0, -1.0, np.nan]), "hhmmss")).all()


def test_every_table_of_units_holds_its_si_unit() -> None:
    assert all(units[si] == 1.0 for si, units in UNITS.items())
    assert set(INPUTS.values()) <= set(UNITS)


def test_the_digest_follows_the_content_and_not_the_layout(plain_mapping: Write) -> None:
    first = read_mapping(plain_mapping()).digest
    assert read_mapping(plain_mapping("\n# a remark\n")).digest == first
    assert read_mapping(plain_mapping(replace=('unit = "rpm"', 'unit = "rev/s"'))).digest != first


def test_parameters_of_repairs_are_in_si(plain_mapping: Write) -> None:
    repair = (
        '[[repair]]\nkind = "despike"\ncolumns = ["psi"]\nwindow = 5.0\nthreshold = 90.0\nunit = "deg"\nreason = "x"\n'
    )
    (despike,) = read_mapping(plain_mapping("\n" + repair)).repair
    assert isinstance(despike, Despike)
    assert despike.threshold == pytest.approx(math.pi / 2)
    assert despike.window == 5.0


@pytest.mark.parametrize(
    ("more", "replace", "path", "message"),
    [
        ('digest = "x"\n', None, "digest", "computed, not written"),
        ("", ('unit = "rpm"', 'unit = "deg"'), "columns.propeller.n.unit", "unknown unit 'deg'"),
        ("", ('unit = "rpm"', 'unit = "%"'), "columns.propeller.n.unit", "share of full speed .* `factor`"),
        ("", ("[columns.psi]", "[columns.head]"), "columns.head", "unknown column"),
        ('[columns.wobble]\nfrom = "u"\nunit = "m"\n', None, "columns.wobble", "unknown column"),
        ('[columns.V_w]\nfrom = "u"\nunit = "m/s"\n', None, "columns", "wind needs both"),
        (
            "[estimate]\nposition = 1.0\nheading_deg = 1.0\nacceleration = 0.1\nangular_acceleration_deg = 0.1\n",
            None,
            "estimate",
            "nothing to estimate",
        ),
        ("[origin]\nlatitude = 63.0\nlongitude = 10.0\n", None, "origin", "is used with latitude and longitude only"),
        ('[[repair]]\nkind = "polish"\n', None, "repair.0", "unknown kind 'polish'"),
        ('[repair]\nkind = "scale"\n', None, "repair", r"write \[\[repair\]\]"),
        ('[[segment]]\nrun = "a"\nstart = 5.0\nend = 2.0\n', None, "segment.0", "must lie before"),
        ('[[segment]]\nrun = "a"\nstart = 1.0\nend = 2.0\n' * 2, None, "segment.1", "a run 'a' exists"),
        ("[parts]\n", None, "parts", "says nothing"),
        ('[parts]\npause = 9.0\n[[segment]]\nrun = "a"\nstart = 1.0\nend = 2.0\n', None, "parts", "remove one of them"),
    ],
)
def test_a_contradiction_is_refused_with_its_key(
    more: str, replace: tuple[str, str] | None, path: str, message: str, plain_mapping: Write
) -> None:
    file = plain_mapping("", replace or ("", ""))
    text = file.read_text()
    file.write_text(more + text if more.startswith("digest") else f"{text}\n{more}")
    with pytest.raises(DocumentError, match=message) as caught:
        read_mapping(file)
    assert str(caught.value.path).startswith(path)
    assert "mapping.toml" in str(caught.value)


@pytest.mark.parametrize("kind", REPAIRS)
def test_unknown_keys_of_a_repair_are_named_with_those_of_its_kind(kind: str, plain_mapping: Write) -> None:
    with pytest.raises(DocumentError, match="wobble"):
        read_mapping(plain_mapping(f'\n[[repair]]\nkind = "{kind}"\nreason = "x"\nwobble = 1.0\n'))


def test_columns_are_interpolated_where_their_instants_differ(plain_mapping: Write) -> None:
    assert not read_mapping(plain_mapping()).resamples
    late = plain_mapping(replace=('from = "N"', 'from = "N"\nlatency = 0.5'))
    late.write_text(late.read_text().replace("[clock]", "[clock]\nmax_gap = 3.0"))
    assert read_mapping(late).resamples


@pytest.mark.parametrize(
    ("text", "sides", "degrees"),
    [
        ("59°26'12.3\"N", "NS", 59 + 26 / 60 + 12.3 / 3600),
        ("010° 36' 12.3″ W", "EW", -(10 + 36 / 60 + 12.3 / 3600)),
        ("S33 51.2", "NS", -(33 + 51.2 / 60)),
        ("-33 51.2", "NS", -(33 + 51.2 / 60)),
        ("59-26.205n", "NS", 59 + 26.205 / 60),
        ("59:26:12", "NS", 59 + 26 / 60 + 12 / 3600),
        ("5926.205,N", "NS", 59 + 26.205 / 60),
        ("00036.205W", "EW", -36.205 / 60),
        ("0103612W", "EW", -(10 + 36 / 60 + 12 / 3600)),
        ("103.75° E", "EW", 103.75),
        ("59°26.2'N 010°36'W", "NS", 59 + 26.2 / 60),
        ("59°26.2'N 010°36'W", "EW", -10.6),
        ("N59 26.2, W010 36.0", "EW", -10.6),
        ("5926.2N/01036.0W", "EW", -10.6),
        ("59°26,205'N", "NS", 59 + 26.205 / 60),
        ("59°26'12,3\"N 10°36,5'W", "NS", 59 + 26 / 60 + 12.3 / 3600),
        ("59°26'12,3\"N 10°36,5'W", "EW", -(10 + 36.5 / 60)),
        ("59,4367N", "NS", 59.4367),
        ("59°26'E", "NS", np.nan),  # another side
        ("-33°51'S", "NS", np.nan),
        ("59 61.0N", "NS", np.nan),
        ("59.5°26'N", "NS", np.nan),
        ("95°N", "NS", np.nan),
        ("10°36'O", "EW", np.nan),  # Ost, or ouest
        ("59,10", "NS", np.nan),
        ("---", "NS", np.nan),
    ],
)
def test_a_position_as_text_in_degrees(text: str, sides: str, degrees: float) -> None:
    np.testing.assert_allclose(degrees_in_text(pd.Series([text]), sides), [degrees], rtol=1e-13)


def test_positions_as_text_have_a_letter_in_all_rows_or_in_none_and_one_way_of_writing() -> None:
    assert np.isnan(degrees_in_text(pd.Series(["33 51.2 S", "33 51.2"]), "NS")).tolist() == [False, True]
    degrees = degrees_in_text(pd.Series(["00959.9E", "01000.1E", "959.9E"]), "EW")
    np.testing.assert_allclose(degrees, [9 + 59.9 / 60, 10 + 0.1 / 60, 9 + 59.9 / 60])
