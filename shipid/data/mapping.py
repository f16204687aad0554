"""A mapping: the declaration, in TOML, of what the columns of a log are and what is wrong with them."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, SerializeAsAny, field_validator

from shipid import document
from shipid.data.dataset import OPTIONAL, REQUIRED, SIGNALS, unit_of
from shipid.data.repairs import REPAIRS, Break, ColumnRepair, Despike, HeadingOffset, Repair, Strict, WrapInterpolation
from shipid.errors import DocumentError, choices

UNITS: dict[str, dict[str, float]] = {
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "ft": 0.3048, "nmi": 1852.0},
    "m/s": {"m/s": 1.0, "kn": 1852.0 / 3600.0, "km/h": 1.0 / 3.6},
    "rad": {"rad": 1.0, "deg": 0.017453292519943295},
    "rad/s": {"rad/s": 1.0, "deg/s": 0.017453292519943295, "deg/min": 0.017453292519943295 / 60.0},
    "rev/s": {"rev/s": 1.0, "rpm": 1.0 / 60.0, "rad/s": 0.15915494309189535},
}
"""SI unit -> unit a log may use -> factor to SI (knot and nautical mile: BIPM, SI Brochure, 9th ed., table 8)."""


class Source(Strict):
    """Where the log is published, and the exact bytes that the mapping was written for."""

    file: str | None = None  # relative to the data folder
    url: str | None = None
    sha256: str | None = Field(default=None, pattern="^[0-9a-f]{64}$")
    citation: str | None = None
    licence: str | None = None


class Format(Strict):
    """How the text of the log is to be read; `names` where it has no header line."""

    separator: str = Field(default=",", min_length=1)  # one character, or "whitespace"
    decimal: Literal[".", ","] = "."
    encoding: str = "utf-8"
    skip_rows: int = Field(default=0, ge=0)
    comment: str | None = Field(default=None, min_length=1, max_length=1)
    names: tuple[str, ...] | None = Field(default=None, min_length=1)
    missing: tuple[str, ...] = ("", "nan", "NaN")

    @field_validator("separator")
    @classmethod
    def _single(cls, separator: str) -> str:
        # pandas would take a longer one for a regular expression
        if separator != "whitespace" and (len(separator) > 1 or not separator.isascii() or separator in '"\r\n\0'):
            raise ValueError("must be one ASCII character but a quote or a line's end, or the word 'whitespace'")
        return separator

    @field_validator("encoding")
    @classmethod
    def _known(cls, encoding: str) -> str:
        try:
            "a".encode(encoding)  # base64 and the like are codecs, too, but not of text
            return codecs.lookup(encoding).name
        except (LookupError, UnicodeError):
            raise ValueError("no such encoding of text; for example utf-8, cp1252, latin-1, utf-16") from None


class Clock(Strict):
    """The column of time; gaps up to `max_gap` [s] are interpolated, longer ones break the run."""

    source: str = Field(alias="from")
    unit: str = "s"
    max_gap: float | None = Field(default=None, gt=0)


class Column(Strict):
    """One column of the dataset: value = sign * factor * (source column in `unit`), then turned as declared."""

    source: str = Field(alias="from")
    unit: str
    factor: float = 1.0
    sign: Literal[-1, 1] = 1
    frame: Literal["body", "earth"] = "body"
    direction: Literal["towards", "from"] | None = None
    wrap: bool = False


class Segment(Strict):
    """One run: its unique name, start and end on the log's clock."""

    run: str = Field(min_length=1)
    start: float
    end: float


class Resample(Strict):
    """Instants `step` [s] apart from the start of every unbroken stretch."""

    step: float = Field(gt=0)


class Mapping(Strict):
    """A whole mapping; `repair` holds parameters in SI units."""

    name: str
    vessel: str | None = None
    source: Source = Source()
    format: Format = Format()
    clock: Clock
    columns: dict[str, Column]
    repair: tuple[SerializeAsAny[Repair], ...] = ()
    segment: tuple[Segment, ...] = ()
    resample: Resample | None = None
    digest: str


def read_mapping(name: str | Path) -> Mapping:
    """Read a bundled mapping by name, or one's own by path; raises DocumentError with file, path and remedy."""
    file = document.find(str(name), "studies/mappings")
    raw = document.read(file)
    if "digest" in raw:
        raise DocumentError("the digest is computed, not written: remove it", file=file, path="digest")
    parts: dict[str, Any] = {"repair": list(_repairs(raw.get("repair", []), file)), "digest": document.digest(raw)}
    if isinstance(raw.get("columns"), dict):
        parts["columns"] = {
            key: document.parse(Column, entry, file, prefix=f"columns.{key}") for key, entry in raw["columns"].items()
        }
    mapping: Mapping = document.parse(Mapping, {**raw, **parts}, file)
    _check_columns(mapping, file)
    _check_segments(mapping, file)
    clock = _factor(mapping.clock.unit, "s", file, "clock.unit")
    for index, repair in enumerate(mapping.repair):
        for column in repair.columns if isinstance(repair, ColumnRepair) else ():
            if column not in mapping.columns:
                raise DocumentError(
                    f"no column {column!r} to repair: {choices(column, mapping.columns)}",
                    file=file,
                    path=f"repair.{index}.columns",
                )
            if isinstance(repair, WrapInterpolation) and not mapping.columns[column].wrap:
                message = f"{column!r} does not wrap: write wrap = true in its column, or take it off this repair"
                raise DocumentError(message, file=file, path=f"repair.{index}.columns")
    converted = [_in_si(repair, clock, file, f"repair.{index}.unit") for index, repair in enumerate(mapping.repair)]
    return mapping.model_copy(update={"repair": tuple(converted)})


def to_si(unit: str, name: str) -> float:
    """Factor from a unit of the log to the SI unit of a column."""
    return UNITS[str(unit_of(name))][unit]


def _repairs(raw: Any, file: Path) -> Iterator[Repair]:
    """Every [[repair]] as the model of its kind, so that an unknown key is named with the keys of that kind."""
    if not isinstance(raw, list) or not all(isinstance(entry, dict) for entry in raw):
        raise DocumentError("must be a list of tables: write [[repair]]", file=file, path="repair")
    for index, entry in enumerate(raw):
        kind = str(entry.get("kind", ""))
        if kind not in REPAIRS:
            raise DocumentError(f"unknown kind {kind!r}: {choices(kind, REPAIRS)}", file=file, path=f"repair.{index}")
        yield document.parse(REPAIRS[kind][0], entry, file, prefix=f"repair.{index}")


def _check_columns(mapping: Mapping, file: Path) -> None:
    _factor(mapping.clock.unit, "s", file, "clock.unit")
    columns, mapped = mapping.columns, (*REQUIRED.keys() - {"t"}, *OPTIONAL)
    for name, column in columns.items():
        unit, path = unit_of(name), f"columns.{name}"
        if unit is None or name == "t":
            hint = f"or a command, <component>.<signal> with a signal of {', '.join(SIGNALS)}"
            raise DocumentError(f"unknown column: {choices(name, mapped)} ({hint})", file=file, path=path)
        _factor(column.unit, unit, file, f"{path}.unit")
        if (column.direction is None) == (name == "beta_w"):
            message = "must be 'towards' or 'from' for beta_w, and belongs to no other column"
            raise DocumentError(message, file=file, path=f"{path}.direction")
        if column.wrap and unit != "rad":
            raise DocumentError("only an angle wraps", file=file, path=f"{path}.wrap")
    for name in sorted(REQUIRED.keys() - {"t"} - columns.keys()):
        raise DocumentError(
            f"missing: a dataset needs {', '.join(list(REQUIRED)[1:])}", file=file, path=f"columns.{name}"
        )
    if columns["u"].frame != columns["v"].frame:
        raise DocumentError(
            "u and v must be in one frame, both 'body' or both 'earth'", file=file, path="columns.v.frame"
        )
    for name in columns.keys() - {"u", "v"}:
        if columns[name].frame == "earth":
            raise DocumentError("only u and v can be earth-fixed", file=file, path=f"columns.{name}.frame")
    if ("V_w" in columns) != ("beta_w" in columns):
        raise DocumentError("wind needs both V_w and beta_w", file=file, path="columns")


def _check_segments(mapping: Mapping, file: Path) -> None:
    seen: set[str] = set()
    for index, segment in enumerate(mapping.segment):
        path = f"segment.{index}"
        if segment.run in seen:
            raise DocumentError(f"a run {segment.run!r} exists: add ' (2)'", file=file, path=f"{path}.run")
        if not segment.start < segment.end:
            raise DocumentError(f"start {segment.start:g} must lie before end {segment.end:g}", file=file, path=path)
        seen.add(segment.run)


def _in_si(repair: Repair, clock: float, file: Path, path: str) -> Repair:
    """Give the repair with its parameters in SI units."""
    match repair:
        case WrapInterpolation():
            return repair.model_copy(update={"threshold": repair.threshold * _factor(repair.unit, "rad", file, path)})
        case HeadingOffset():
            return repair.model_copy(update={"offset": repair.offset * _factor(repair.unit, "rad", file, path)})
        case Despike(unit=str(unit)):
            factors = [_factor(unit, unit_of(name) or "", file, path) for name in repair.columns]
            return repair.model_copy(update={"threshold": repair.threshold * factors[0]})
        case Break():
            intervals = tuple((clock * start, clock * end) for start, end in repair.intervals)
            return repair.model_copy(update={"intervals": intervals})
    return repair


def _factor(unit: str, si: str, file: Path, path: str) -> float:
    if unit not in UNITS[si]:
        raise DocumentError(f"unknown unit {unit!r}: valid here: {', '.join(UNITS[si])}", file=file, path=path)
    return UNITS[si][unit]
