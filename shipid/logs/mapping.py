"""A mapping: the declaration, in TOML, of what the columns of a log are and what is wrong with them."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field, FiniteFloat, SerializeAsAny

from shipid import document
from shipid.data.dataset import (
    FIRST_DATED_TIME,
    STANDARD_DEVIATIONS,
    optional_columns,
    required_columns,
    unit_of_column,
)
from shipid.errors import DocumentError, suggest_name
from shipid.logs.dates import DAY, EXCEL, LAST_DATE, NEXT_DAY, over_midnights
from shipid.logs.formats import Format, TextFormat
from shipid.logs.readers import READERS
from shipid.logs.repairs import (
    INPUTS,
    REPAIRS,
    Break,
    ColumnRepair,
    Despike,
    HeadingOffset,
    LeverArm,
    Repair,
    StrictPart,
    WrapInterpolation,
)
from shipid.physics.signals import is_command, is_output, rows_of_role, signal_row
from shipid.units import DEGREE, KNOT, MINUTE, RPM

UNITS: dict[str, dict[str, float]] = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": MINUTE, "h": 3600.0, "d": DAY}
    | {
        "date": 1.0,
        "datenum": 1.0,
        "excel": 1.0,
        "mjd": 1.0,
        "jd": 1.0,
        "hhmmss": 1.0,
        "s of day": 1.0,
        "s of week": 1.0,
        "ms of day": 1e-3,
        "ms of week": 1e-3,
        "s + ns": 1.0,
        "s + us": 1.0,
    },
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "ft": 0.3048, "nmi": 1852.0},
    "m/s": {"m/s": 1.0, "kn": KNOT, "km/h": 1.0 / 3.6, "mph": 0.44704, "cm/s": 1e-2, "mm/s": 1e-3},
    "rad": {"rad": 1.0, "deg": DEGREE, "ddmm": DEGREE, "quaternion": 1.0},
    "rad/s": {"rad/s": 1.0, "deg/s": DEGREE, "deg/min": DEGREE / MINUTE},
    "rev/s": {"rev/s": 1.0, "rpm": RPM, "rad/s": 0.15915494309189535},
    "N": {"N": 1.0, "kN": 1e3},
    "N m": {"N m": 1.0, "kN m": 1e3, "Nm": 1.0, "kNm": 1e3},
    "-": {"-": 1.0, "%": 1e-2},
}
"""SI unit -> unit a log may use -> factor to SI (knot and nautical mile: BIPM, SI Brochure, 9th ed., table 8;
mile per hour: 1609.344 m, international yard and pound agreement, 1959).

`date`, `datenum`, `excel`, `mjd` and `jd` are read as seconds since 1970 (UTC), and so are the times of segments and
breaks; `hhmmss` as seconds since the first midnight; `s + ns` is of two columns, seconds and the rest of them.
`ddmm`, of latitude and longitude only, are degrees and minutes; `quaternion`, of the heading only, four columns
x, y, z, w.
"""
EPOCHS = {"datenum": 719529.0, "excel": float(EXCEL), "mjd": 40587.0, "jd": 2440587.5}
"""Unit of a clock in days -> number of 1 January 1970 (MATLAB: datenum; Excel: 1900 date system; Julian dates, modified
or not: IAU resolution B1 of 1997)."""
AGAIN = {"s of day": DAY, "s of week": 7 * DAY, "ms of day": DAY, "ms of week": 7 * DAY}
"""Unit of a clock that begins again -> after how many seconds."""
RESTS = {"s + ns": 1e-9, "s + us": 1e-6}
"""Unit of a clock in two columns -> that of the second [s]."""
SIDES = {"latitude": "NS", "longitude": "EW"}
"""Column of a position on the Earth -> the letters of its sides in a text, that of positive numbers first."""
_BOTH = re.compile(r"([^A-Za-z]*\d[^A-Za-z]*[NS])[\s,;/]*([^A-Za-z]+[EW])|([NS][^A-Za-z]+?)[\s,;/]*([EW][^A-Za-z]+)")
"""A text that holds a latitude and a longitude, each with its letter behind it or before it."""
_ANGLE = re.compile(
    r"([NSEW]?)\s*([+-]?)(\d+(?:\.\d*)?)\s*"
    r"(?:[°º˚:\s-]\s*(?:(\d+(?:\.\d*)?)\s*(?:['′’´:\s-]\s*(?:(\d+(?:\.\d*)?)\s*(?:[\"″”]|'')?)?)?)?)?[\s,]*([NSEW]?)"
)
"""An angle as text: side or sign, degrees, perhaps minutes and seconds, side."""
_COMMA = re.compile(r"(?<=\d),(?=\d+\s*(?:['′’´\"″”°º˚]|[NSEW]\b))")
"""A decimal comma of degrees, minutes or seconds, also in a log whose numbers have points."""
OF_SHIP = "SP"
"""Letters of the sides of a ship in the text of an angle, as in P12.5, that of positive numbers first."""
_PORT, _STARBOARD = "P|PORT|PS|BB|BD|BAB|L", "S|STBD|STB|SB|TD|TB|TRI|R"
_SIDED = re.compile(
    rf"(?:({_PORT})|({_STARBOARD}))?[\s.:]*([+-]?\d+(?:\.\d*)?)\s*(?:°|DEG)?\s*(?:({_PORT})|({_STARBOARD}))?"
)
"""An angle to one side of a ship as text: side, degrees, side."""
REPLACED = {"north": "latitude", "east": "longitude", "u": "speed", "v": "course"}
Faults = Iterator[tuple[object, str, str]]
"""Whether something is wrong, the dotted path of it, and what it is."""
ESTIMATED = ("u", "v", "r")
Manoeuvre = Literal[
    "zigzag",
    "turning",
    "spiral",
    "pull-out",
    "stop",
    "coasting",
    "speed run",
    "transit",
    "random",
    "manoeuvring at low speed",
    "mixed",
]


Named = str | Annotated[tuple[str, ...], Field(min_length=2, max_length=3)]
"""A column of the log, or two or three that say one value in parts: degrees and minutes; hour, minute and second."""


Four = Annotated[tuple[str, ...], Field(min_length=4, max_length=4)]
"""The columns x, y, z, w of a quaternion."""


def source_columns(source: Named | Four) -> tuple[str, ...]:
    """The names of the columns of the log that say a value."""
    return (source,) if isinstance(source, str) else tuple(source)


class LogSource(StrictPart):
    """Where the log is published, and the exact bytes that the mapping was written for.

    runs : a pattern such as `Z_*.dat` or `**/*.csv`: the log is a folder, every file one run with a separate clock,
    named by the text that the star matches, or by its path. skip : files that are left out. manoeuvres : what runs are.
    """

    file: str | None = None  # relative to the data folder
    runs: str | None = Field(default=None, pattern=r"^([^/.][^/]*/)*[^/*]*\*[^/]*$")  # never above the folder
    skip: tuple[str, ...] = ()
    manoeuvres: dict[str, Manoeuvre] = Field(default_factory=dict)
    url: str | None = None
    sha256: str | None = Field(default=None, pattern="^[0-9a-f]{64}$")
    citation: str | None = None
    licence: str | None = None


class TimeColumn(StrictPart):
    """The column of time of a file, or two or three of hour, minute and second; beside times of day the date.

    date : a column, or two or three of year, month and day, or of year and day of the year.
    """

    source: Named = Field(alias="from")
    unit: str = "s"
    date: Named | None = None

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of all columns of the log that say the time."""
        return (*source_columns(self.source), *(source_columns(self.date) if self.date is not None else ()))


class Clock(TimeColumn):
    """The column of time; gaps up to `max_gap` [s] are interpolated, longer ones break the run.

    step : [s] between rows of the dataset, by interpolation. every : [s] between rows of the log, rounded in its time.
    """

    max_gap: float | None = Field(default=None, gt=0)
    step: float | None = Field(default=None, gt=0)
    every: float | None = Field(default=None, gt=0)
    repeated: Literal["refuse", "drop"] = "refuse"


class FileClock(TimeColumn):
    """The column of time of a further file."""


class File(StrictPart):
    """A further file of the log, with its format and clock; `path` is relative to the folder of the log."""

    path: str
    format: SerializeAsAny[Format] = TextFormat()
    clock: FileClock


class PlaneOrigin(StrictPart):
    """Where north and east are zero [deg]."""

    latitude: float = Field(ge=-90, le=90)
    longitude: float = Field(ge=-180, le=360)


class Column(StrictPart):
    """One column of the dataset: value = sign * factor * (source column) + offset, in `unit`, then turned as declared.

    curve : of a command or output, pairs (number in the log, value in `unit`), linear between them, in place of the
    source column: dead band, neutral and stops of a servo, or a throttle.

    The source of a latitude or longitude may be two or three columns: degrees, minutes and seconds; of a heading the
    four of a quaternion. `missing`: numbers in the log that stand for no value of this column. `latency` [s]: how late
    samples are stamped; `interpolation`: the rule between samples.
    """

    source: Named | Four = Field(alias="from")
    unit: str
    file: str | None = None
    factor: float = 1.0
    offset: float = 0.0
    curve: Annotated[tuple[tuple[FiniteFloat, FiniteFloat], ...], Field(min_length=2)] | None = None
    missing: tuple[FiniteFloat, ...] = ()
    sign: Literal[-1, 1] = 1
    frame: Literal["body", "earth"] = "body"
    direction: Literal["towards", "from"] | None = None
    relative: bool | Literal["angle"] = False
    wrap: bool = False
    latency: float = 0.0
    interpolation: Literal["linear", "previous", "angle"] | None = None


class VelocityEstimate(StrictPart):
    """How u, v, r that the log lacks are estimated: standard deviations of one sample, and of the change in 1 s."""

    position: float = Field(gt=0)
    heading_deg: float = Field(gt=0)
    velocity: float = Field(default=0.1, gt=0)
    rate_deg: float = Field(default=0.1, gt=0)
    acceleration: float = Field(gt=0)
    angular_acceleration_deg: float = Field(gt=0)


class Segment(StrictPart):
    """One run: its unique name, start and end on the log's clock, and what it is; `file` names one of `source.runs`."""

    run: str = Field(min_length=1)
    file: str | None = None
    start: float
    end: float
    manoeuvre: Manoeuvre | None = None


class RunParts(StrictPart):
    """Where a new run begins in a file of several: a column that changes its value, or a pause of the clock [s]."""

    source: str | None = Field(default=None, alias="from")
    pause: float | None = Field(default=None, gt=0)


class Mapping(StrictPart):
    """A whole mapping; `repair` holds parameters in SI units."""

    name: str
    vessel: str | None = None
    source: LogSource = LogSource()
    format: SerializeAsAny[Format] = TextFormat()
    clock: Clock
    file: dict[str, File] = Field(default_factory=dict)
    origin: PlaneOrigin | None = None
    columns: dict[str, Column]
    estimate: VelocityEstimate | None = None
    repair: tuple[SerializeAsAny[Repair], ...] = ()
    segment: tuple[Segment, ...] = ()
    parts: RunParts | None = None
    digest: str

    @property
    def resamples(self) -> bool:
        """Whether columns have other instants than the dataset, so that they must be interpolated."""
        return self.clock.step is not None or any(column.file or column.latency for column in self.columns.values())


def read_mapping(name: str | Path) -> Mapping:
    """Read a mapping: a bundled one by name, any other by path; raises DocumentError with file, path and remedy."""
    file = document.find_document(str(name), "studies/mappings")
    return parse_mapping(document.read_document(file), file)


def parse_mapping(raw: document.Document, file: Path) -> Mapping:
    """Make a mapping of the content of a document; `file` is what errors name."""
    if "digest" in raw:
        raise DocumentError("the digest is computed, not written: remove it", file=file, path="digest")
    parts: dict[str, Any] = {"digest": document.digest_document(raw)}
    format_of = partial(_parse_kind, kinds=READERS, model_of=lambda kind: READERS[kind].options, file=file)
    if "format" in raw:
        parts["format"] = format_of(raw["format"], path="format")
    if isinstance(tables := raw.get("file"), dict):
        parts["file"] = {
            key: {**one, "format": format_of(one.get("format", {}), path=f"file.{key}.format")}
            if isinstance(one, dict)
            else one
            for key, one in tables.items()
        }
    if not isinstance(tables := raw.get("repair", []), list):
        raise DocumentError("must be a list of tables: write [[repair]]", file=file, path="repair")
    parts["repair"] = [
        _parse_kind(one, REPAIRS, lambda kind: REPAIRS[kind][0], file, f"repair.{index}")
        for index, one in enumerate(tables)
    ]
    mapping: Mapping = document.parse_model(Mapping, {**raw, **parts}, file)
    clock = _unit_factor(mapping.clock.unit, "s", file, "clock.unit")
    for check in (_check_mapped_columns, _check_missing, _check_instants, _check_segments, _check_repairs):
        for wrong, path, message in check(mapping, file):
            if wrong:
                raise DocumentError(message, file=file, path=path)
    converted = [_in_si(repair, clock, file, f"repair.{index}.unit") for index, repair in enumerate(mapping.repair)]
    return mapping.model_copy(update={"repair": tuple(converted)})


def to_si(unit: str, name: str) -> float:
    """The factor from a unit of the log to the SI unit of a column."""
    return UNITS[str(INPUTS.get(name) or unit_of_column(name))][unit]


def clock_seconds(values: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    """Numbers (N,) of a clock in one of its units as seconds; days of a calendar as seconds since 1970."""
    if unit == "hhmmss":
        return since_midnight(values)
    if unit in AGAIN:
        since = values * to_si(unit, "t")
        steps = np.diff(since, prepend=since[:1])
        return np.asarray(since + AGAIN[unit] * np.cumsum(steps < NEXT_DAY - AGAIN[unit]), dtype=np.float64)
    return (values - EPOCHS[unit]) * DAY if unit in EPOCHS else values * to_si(unit, "t")


def since_midnight(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Numbers (N,) such as 123005.5, half past twelve, as seconds since the first midnight; NaN for no time."""
    hour, minute, second = values // 10_000, values // 100 % 100, values % 100
    since = 3600.0 * hour + 60.0 * minute + second
    since[~((values >= 0) & (hour < 24) & (minute < 60) & (second < 61))] = np.nan  # 60: a leap second
    known = np.flatnonzero(np.isfinite(since))
    since[known] = over_midnights(since[known])
    return since


def degrees_and_minutes(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Numbers (N,) such as 6326.4, 63 degrees and 26.4 minutes, in degrees; NaN where there are 60 minutes or more."""
    size = np.abs(values)
    degrees = size // 100 + np.where(size % 100 < 60, size % 100, np.nan) / 60.0
    return np.asarray(np.copysign(degrees, values), dtype=np.float64)


def degrees_in_parts(parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Degrees, minutes and, if there are three, seconds (N,) in degrees; NaN where there are 60 of them or more."""
    degrees = np.abs(parts[0])
    for part, share in zip(parts[1:], (60.0, 3600.0), strict=False):
        degrees = degrees + np.where(np.abs(part) < 60.0, np.abs(part), np.nan) / share
    return np.asarray(np.where(np.any(np.signbit(parts), axis=0), -degrees, degrees), dtype=np.float64)


def quaternion_yaw(parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Yaw [rad] of quaternions x, y, z, w (4, N), counted about z from x to y; NaN where all four are 0.

    It is the first turn of the three by yaw, pitch and roll.
    """
    x, y, z, w = parts
    yaw = np.arctan2(2.0 * (w * z + x * y), w**2 + x**2 - y**2 - z**2)
    return np.asarray(np.where(np.any(np.array(parts) != 0.0, axis=0), yaw, np.nan), dtype=np.float64)


def quaternion_size(parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Size (N,) of quaternions (4, N): 1, but for rounding."""
    return np.asarray(np.sqrt(np.sum(np.square(parts), axis=0)), dtype=np.float64)


def degrees_in_text(texts: pd.Series[Any], sides: str) -> NDArray[np.float64]:
    """Texts (N,) such as 59°26'12.3"N, N59 26.205 or 5926.205N in degrees; NaN for a text that says no angle.

    sides : letters of this angle, "NS" or "EW", the positive one first; all texts have one or none has. Four digits
    before the point are degrees and minutes, six also seconds.
    """
    upper = texts.astype(str).str.strip().str.upper().str.replace(_COMMA, ".", regex=True)
    found = upper.str.extract(rf"^(?:{_ANGLE.pattern})$")
    others = found[2].isna()
    if others.any():
        both = upper[others].str.extract(rf"^(?:{_BOTH.pattern})$")
        one = (0, 2) if sides == SIDES["latitude"] else (1, 3)
        parts = both[one[0]].fillna(both[one[1]]).str.strip()
        found = found.mask(others, parts.str.extract(rf"^(?:{_ANGLE.pattern})$"))
    found = found.fillna("")
    before, sign, *numbers, behind = (found[place] for place in range(6))
    letter = before + behind
    values = [pd.to_numeric(one, errors="coerce").to_numpy(dtype=np.float64) for one in numbers]
    digits = numbers[0].str.partition(".")[0].str.len()
    alone = np.isnan(values[1])
    degrees = degrees_in_parts([values[0], *(np.nan_to_num(one) for one in values[1:])])
    packed = int(digits[alone].max()) if alone.any() else 0
    if packed > 3:
        minutes = (
            degrees_and_minutes(values[0])
            if packed < 6
            else degrees_and_minutes(values[0] // 100.0) + values[0] % 100.0 / 3600.0
        )
        degrees = np.where(alone, minutes if packed < 8 else np.nan, degrees)
    one_letter = letter.isin([*sides]) if letter.ne("").any() else letter.eq("")
    whole = np.isnan(values[1]) | (values[0] % 1 == 0) & (np.isnan(values[2]) | (values[1] % 1 == 0))
    right = one_letter.to_numpy() & whole & ~(letter.ne("") & sign.ne("")).to_numpy()
    right &= degrees <= (90.0 if sides == SIDES["latitude"] else 360.0)
    minus = sign.eq("-").to_numpy() | letter.eq(sides[1]).to_numpy()
    return np.asarray(np.where(right, np.where(minus, -degrees, degrees), np.nan), dtype=np.float64)


def is_position(text: str) -> bool:
    """Whether a text is a latitude or longitude in degrees and minutes with its letter, such as N 63 26.4012."""
    angle = _ANGLE.fullmatch(text.strip().upper())
    return angle is not None and angle[4] is not None and angle[1] + angle[6] != ""


def side_letters(name: str) -> str:
    """Letters of the sides that an angle may have in a text, by its column of the dataset; empty where it has none."""
    row = signal_row(name)
    sided = name == "phi" or (row is not None and row.angle and is_command(name))
    return SIDES.get(name, OF_SHIP if sided else "")


def degrees_to_sides(texts: pd.Series[Any]) -> NDArray[np.float64]:
    """Texts (N,) such as P12.5, 7.0 S or STBD 20 in degrees, those to starboard positive; NaN for any other text."""
    upper = texts.astype(str).str.strip().str.upper().str.replace(",", ".", regex=False)
    before, other, number, behind, another = (
        upper.str.extract(rf"^(?:{_SIDED.pattern})$")[place].fillna("") for place in range(5)
    )
    port, starboard = (before + behind).ne(""), (other + another).ne("")
    value = pd.to_numeric(number, errors="coerce")
    right = np.where(port | starboard, (port != starboard) & ~number.str.contains(r"[+-]"), value.eq(0.0))
    return np.asarray(np.where(right, value.where(~port, -value), np.nan), dtype=np.float64)


def degrees_to_side(texts: pd.Series[Any], sides: str) -> NDArray[np.float64]:
    """Texts (N,) with one of the letters of two sides, as of `SIDES` or `OF_SHIP`, in degrees; NaN for any other."""
    return degrees_to_sides(texts) if sides == OF_SHIP else degrees_in_text(texts, sides)


def is_dated(unit: str) -> bool:
    """Whether a clock in this unit is read as seconds since 1970."""
    return unit == "date" or unit in EPOCHS


def is_date(t: float, unit: str) -> bool:
    """Whether a time [s] on a clock in this unit is a date: it counts from 1970, not from a midnight, to year 9999."""
    return is_dated(unit) and FIRST_DATED_TIME < t < LAST_DATE


def _parse_kind(raw: Any, kinds: Collection[str], model_of: Callable[[str], Any], file: Path, path: str) -> Any:
    """A table as the model of its kind, so that an unknown key is named with the keys of that kind."""
    kind = str(raw.get("kind", "" if kinds is REPAIRS else "text")) if isinstance(raw, dict) else ""
    if isinstance(raw, dict) and kind not in kinds:
        raise DocumentError(f"unknown kind {kind!r}: {suggest_name(kind, kinds)}", file=file, path=f"{path}.kind")
    return document.parse_model(model_of(kind), raw, file, prefix=path) if isinstance(raw, dict) else raw


def _check_mapped_columns(mapping: Mapping, file: Path) -> Faults:
    columns = mapping.columns
    mapped = (
        *required_columns().keys() - {"t"},
        *optional_columns().keys() - set(STANDARD_DEVIATIONS.values()),
        *INPUTS,
    )
    for name, column in columns.items():
        unit, path = INPUTS.get(name) or unit_of_column(name), f"columns.{name}"
        if unit is None or not (name in mapped or is_command(name) or is_output(name)):
            signals = ", ".join((*rows_of_role("command"), *rows_of_role("output")))
            hint = f"or <component>.<signal> with a signal of {signals}"
            raise DocumentError(f"unknown column: {suggest_name(name, mapped)} ({hint})", file=file, path=path)
        _unit_factor(column.unit, unit, file, f"{path}.unit")
        yield (
            column.unit == "ddmm" and name not in ("latitude", "longitude"),
            f"{path}.unit",
            "only latitude and longitude are in degrees and minutes: write deg or rad",
        )
        four = not isinstance(column.source, str) and len(column.source) == 4
        yield (
            four != (column.unit == "quaternion") or (four and name != "psi"),
            f"{path}.unit",
            "a quaternion is the heading, from four columns: write from = [x, y, z, w] and this unit for psi",
        )
        yield (
            (
                not (four or isinstance(column.source, str))
                and (name not in ("latitude", "longitude") or column.unit != "deg")
            ),
            f"{path}.from",
            "only a latitude or longitude in deg is written in degrees, minutes and seconds: name one column",
        )
        yield (
            (column.direction is None) == (name == "beta_w"),
            f"{path}.direction",
            "must be 'towards' or 'from' for beta_w, and belongs to no other column",
        )
        if column.curve is not None:
            rises = all(first[0] < second[0] for first, second in pairwise(column.curve))
            yield (
                not (is_command(name) or is_output(name)) or column.wrap or not rises,
                f"{path}.curve",
                "belongs to a command or output that does not wrap, and the numbers of the log rise in it",
            )
        yield column.wrap and unit != "rad", f"{path}.wrap", "only a column in rad or deg can wrap: remove wrap"
        yield (
            column.relative and name != "beta_w",
            f"{path}.relative",
            "only beta_w can be relative to the bow: remove relative",
        )
    for name in sorted(column for column in columns.keys() - {"u", "v"} if columns[column].frame == "earth"):
        raise DocumentError("only u and v can be earth-fixed: remove frame", file=file, path=f"columns.{name}.frame")
    yield (
        "u" in columns and "v" in columns and columns["u"].frame != columns["v"].frame,
        "columns.v.frame",
        "u and v must be in one frame, both 'body' or both 'earth'",
    )
    yield ("V_w" in columns) != ("beta_w" in columns), "columns", "wind needs both V_w and beta_w"


def _check_missing(mapping: Mapping, _: Path) -> Faults:
    """Yield the faults of required columns that are not mapped, converted from another, or estimated."""
    columns = mapping.columns
    for name, other in REPLACED.items():
        yield (
            name in columns and other in columns,
            f"columns.{name}",
            f"{other} is converted to {name}, so both cannot be mapped: remove one of them",
        )
    for pair in (("latitude", "longitude"), ("speed", "course")):
        missing = set(pair) - columns.keys()
        yield len(missing) == 1, f"columns.{next(iter(missing), '')}", f"missing: {' and '.join(pair)} belong together"
    for name in sorted(required_columns().keys() - {"t"} - columns.keys()):
        if REPLACED.get(name) in columns or (name in ESTIMATED and mapping.estimate is not None):
            continue
        remedy = ", or [estimate]" if name in ESTIMATED else ""
        yield True, f"columns.{name}", f"missing: a dataset needs {', '.join(list(required_columns())[1:])}{remedy}"
    yield (
        mapping.origin is not None and "latitude" not in columns,
        "origin",
        "is used with latitude and longitude only, and they are not mapped: remove it",
    )
    yield (
        mapping.source.runs is not None and "latitude" in columns and mapping.origin is None,
        "origin",
        "missing: one origin for the files of all runs",
    )
    lacking = [name for name in ESTIMATED if name not in columns and REPLACED.get(name) not in columns]
    yield (
        mapping.estimate is not None and not lacking,
        "estimate",
        "u, v and r are all logged, so there is nothing to estimate: remove [estimate]",
    )
    yield (
        "u" in columns and columns["u"].frame == "earth" and "v" not in columns,
        "columns.u.frame",
        "an earth-fixed u cannot be turned without v: map v too",
    )
    for index, repair in enumerate(mapping.repair):
        moves = isinstance(repair, LeverArm) and repair.moves != "position" and not {"u", "v"} <= set(lacking)
        yield (
            moves and "r" in lacking,
            f"repair.{index}.moves",
            'velocities are moved by r, which is estimated afterwards: write moves = "position"',
        )


def _check_instants(mapping: Mapping, file: Path) -> Faults:
    """Yield the faults of columns with other instants that cannot be interpolated at those of the dataset."""
    for name, column in mapping.columns.items():
        path = f"columns.{name}"
        yield (
            column.file is not None and column.file not in mapping.file,
            f"{path}.file",
            f"no [file.{column.file}]: {suggest_name(column.file or '', mapping.file)}",
        )
        yield (
            column.interpolation == "angle" and (INPUTS.get(name) or unit_of_column(name)) != "rad",
            f"{path}.interpolation",
            "only a column in rad or deg can be interpolated as an angle: use linear or previous",
        )
        yield (
            column.interpolation is not None and not mapping.resamples,
            f"{path}.interpolation",
            "nothing is interpolated at other instants: set [clock] step, a latency or a file",
        )
    for name, entry in mapping.file.items():
        _unit_factor(entry.clock.unit, "s", file, f"file.{name}.clock.unit")
    clocks: dict[str, Clock | FileClock] = {"clock": mapping.clock}
    clocks |= {f"file.{name}.clock": entry.clock for name, entry in mapping.file.items()}
    for path, clock in clocks.items():
        yield (
            clock.date is not None and clock.unit != "date",
            f"{path}.date",
            f"a column of dates is used only with the unit 'date', not with {clock.unit!r}: write unit = 'date'",
        )
        yield (
            clock.unit in RESTS and len(source_columns(clock.source)) != 2,
            f"{path}.from",
            f"{clock.unit!r} is of two columns: write from = [seconds, the rest of them]",
        )
        yield (
            not isinstance(clock.source, str) and clock.unit not in ("date", *RESTS),
            f"{path}.unit",
            "hour, minute and second in several columns are a time of day: write unit = 'date'",
        )
    yield (
        mapping.resamples and mapping.clock.max_gap is None,
        "clock.max_gap",
        "missing: columns are interpolated at other instants, so set the longest gap",
    )
    yield (
        mapping.source.runs is not None and mapping.file,
        "source.runs",
        "source.runs reads one run from each file, [file.*] several files for one run: remove one of them",
    )
    yield (
        mapping.parts is not None and mapping.parts.source is None and mapping.parts.pause is None,
        "parts",
        "says nothing: give `from`, a column that says the run, or `pause`, a time between two runs [s]",
    )
    yield (
        mapping.parts is not None and mapping.segment,
        "parts",
        "both [parts] and segments say where runs begin: remove one of them",
    )
    for index, repair in enumerate(mapping.repair):
        yield (
            isinstance(repair, WrapInterpolation) and mapping.resamples,
            f"repair.{index}.kind",
            "cannot see false samples after resampling: import without step, file and latency",
        )


def _check_segments(mapping: Mapping, _: Path) -> Faults:
    seen: set[str] = set()
    ends: dict[str | None, float] = {}
    for index, segment in enumerate(mapping.segment):
        path = f"segment.{index}"
        yield segment.run in seen, f"{path}.run", f"a run {segment.run!r} exists: add ' (2)'"
        yield not segment.start < segment.end, path, f"start {segment.start:g} must lie before end {segment.end:g}"
        seen.add(segment.run)
        yield (
            (segment.file is None) != (mapping.source.runs is None),
            f"{path}.file",
            "names the file of a segment where source.runs reads several, and only there",
        )
        yield (
            segment.file is not None and segment.start < ends.get(segment.file, -np.inf),
            f"{path}.start",
            f"begins before the last segment of {segment.file!r} ends: write them in order, without overlap",
        )
        ends[segment.file] = segment.end


def _check_repairs(mapping: Mapping, _: Path) -> Faults:
    repairable = [*mapping.columns, *(name for name, other in REPLACED.items() if other in mapping.columns)]
    columns = (
        (k, one, name) for k, one in enumerate(mapping.repair) if isinstance(one, ColumnRepair) for name in one.columns
    )
    for index, repair, name in columns:
        path = f"repair.{index}.columns"
        yield name not in repairable, path, f"no column {name!r} to repair: {suggest_name(name, repairable)}"
        yield (
            repair.of_inputs and name not in mapping.columns,
            path,
            f"{name!r} is made of columns that this repair mends: write two repairs",
        )
        yield (
            isinstance(repair, WrapInterpolation) and not (name in mapping.columns and mapping.columns[name].wrap),
            path,
            f"{name!r} does not wrap: write wrap = true in its column, or take it off this repair",
        )


def _in_si(repair: Repair, clock: float, file: Path, path: str) -> Repair:
    """Give the repair with its parameters in SI units."""
    match repair:
        case WrapInterpolation():
            return repair.model_copy(
                update={"threshold": repair.threshold * _unit_factor(repair.unit, "rad", file, path)}
            )
        case HeadingOffset():
            return repair.model_copy(update={"offset": repair.offset * _unit_factor(repair.unit, "rad", file, path)})
        case Despike(unit=str(unit)):
            factors = [
                _unit_factor(unit, INPUTS.get(name) or unit_of_column(name) or "", file, path)
                for name in repair.columns
            ]
            return repair.model_copy(update={"threshold": repair.threshold * factors[0]})
        case Break():
            intervals = tuple((clock * start, clock * end) for start, end in repair.intervals)
            return repair.model_copy(update={"intervals": intervals})
    return repair


def _unit_factor(unit: str, si: str, file: Path, path: str) -> float:
    if unit not in UNITS[si]:
        share = ""
        if unit in ("%", "percent", "pct") and "rev/s" in UNITS[si]:
            share = '; of a share of full speed write `unit = "rev/s"` and, as `factor`, the rev/s of 1 %'
        raise DocumentError(f"unknown unit {unit!r}: valid here: {', '.join(UNITS[si])}{share}", file=file, path=path)
    return UNITS[si][unit]
