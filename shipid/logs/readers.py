"""Readers: a log as a table of columns named as in the log, from text, a sheet, Parquet, MATLAB or NMEA 0183.

A reader is a row of `READERS`: the options of its format, a function that reads, and one that recognises a file. Values
are returned as written, as text or numbers; the mapping gives units and meaning.
"""

from __future__ import annotations

import bisect
import codecs
import io
import math
import re
import stat
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet
from numpy.typing import NDArray
from pydantic import Field, ValidationInfo, field_validator

from shipid.data.dataset import DATED, Array
from shipid.errors import DataError
from shipid.logs.foreign import ENOUGH, foreign
from shipid.logs.repairs import Strict
from shipid.logs.workbook import SEPARATOR, check_width, is_workbook, sheet_text, sheets_of
from shipid.units import KNOT

DAY, HALF_DAY = 86400.0, 43200.0  # s
NEXT_DAY = 600.0  # s: times of day that go back by more are of the next day, but for those that go back by an hour
HOUR = 3600.0  # s: by which local time goes back at the end of daylight saving
LATE_DATE = 60.0  # s after midnight: so long a receiver may write the date of the day before
LOOKED_AT = 300  # lines that a guess at the format looks at
LONGEST_LINE = 8_000_000  # bytes: more is no log
LARGE = 32_000_000  # bytes: a longer text is read by blocks, and only the columns that are asked for
TIME_OF_DAY = r"\s*\d{1,2}:\d\d(:\d\d([.,]\d+)?)?(\s*[AaPp][Mm])?\s*"
DAY_OF = (
    r"\d{4}[-/]\d\d?[-/]\d\d?|\d\d?(?P<mark>[./-])\d\d?(?P=mark)(\d{4}|\d\d)|\d\d?(?P<gap>[- ])[A-Za-z]{3}(?P=gap)\d{4}"
)
"""A date without a time."""
ORDINAL = r"^(\d{4})[-:/ ](\d{3})[-:/ T](\d\d:\d\d:\d\d(?:\.\d+)?)Z?$"
"""A date with the day of the year: 2024-135 08:00:00, 2024:135:08:00:00.5."""
UTC_BEHIND = r"\s+(?:UTC|GMT)$"
"""The end of a date that says in letters that it has no other zone."""
COMPACT = r"^(\d{8})[-_ ]?(\d{6})(?:\.?(\d{1,9}))?$"
"""A date and a time of day in one number, or nearly: 20240514080000, 20240514080000.5, 20240514_080000."""
DURATION = (
    r"[+-]?\d+(?:\.\d+)? ?(?:d|days?|h|hrs?|hours?|min|minutes?|s|secs?|seconds?|ms)(?: \+?\d+:\d\d:\d\d(?:\.\d+)?)?"
)
"""A time since the begin of a log as MATLAB and pandas write it: 0.5 sec, 0 days 00:00:00.5."""
ZONE = r":\d\d(?:\.\d+)?\s*(?:Z|[+-]\d\d(?::?\d\d)?)$|T\d\d(?::?\d\d)*(?:\.\d+)?(?:Z|[+-]\d\d(?::?\d\d)?)$"
"""The end of a date in ISO 8601 that says its zone."""
DAYS: tuple[str, ...] = ("%d.%m.%Y", "%d.%m.%y", "%Y/%m/%d", "%d/%m/%Y", "%m/%d/%Y", "%d/%m/%y", "%m/%d/%y")
DAYS += ("%d-%m-%Y", "%m-%d-%Y", "%y/%m/%d", "%d-%b-%Y", "%d %b %Y")
HOURS = ("%H:%M:%S", "%H:%M", "%I:%M:%S %p", "%I:%M %p")
WAYS = (*(f"{day} {hour}" for day in DAYS for hour in HOURS), *(f"%Y-%m-%d {hour}" for hour in HOURS if "%p" in hour))
"""Ways in which a date and a time of day may be written, but for ISO 8601."""
LAST_DATE = 253_402_300_800.0  # s: the begin of the year 10000, as a clock that counts from 1970 has it
SAMPLES = 60  # texts by which the way of writing is looked for
_DOTTED = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})")
_DATED = re.compile(r"\d{4}([-/]?)\d\d\1\d\d")
_TAG_TIME = re.compile(r"[\\,]c:(\d+)")
_SENTENCE = re.compile(r"\$[A-Z]{2}[A-Z]{3},")
Progress = Callable[[float], None]


class Format(Strict):
    """Field of every format: its kind."""

    kind: str = "text"


class TableFormat(Format):
    """Keys of a table of text; `names`, or `header = false` and the numbers 1, 2, ..., where it has no header line."""

    decimal: Literal[".", ","] = "."
    thousands: Literal[",", ".", "'", "’", " ", "\u00a0", "\u202f"] | None = None  # between groups of three digits
    skip_rows: int = Field(default=0, ge=0)
    header: bool = True
    names: tuple[str, ...] | None = Field(default=None, min_length=1)
    missing: tuple[str, ...] = ("", "nan", "NaN")
    ragged: Literal["refuse", "drop"] = "refuse"  # lines with more or fewer cells than the header, or its names again

    def text(self) -> TextFormat:
        """Return how the lines of the table are read."""
        return TextFormat(separator=SEPARATOR, **{name: getattr(self, name) for name in TableFormat.model_fields})

    @field_validator("thousands")
    @classmethod
    def _other(cls, thousands: str | None, values: ValidationInfo) -> str | None:
        if thousands is not None and thousands == values.data.get("decimal"):
            raise ValueError("must be another sign than decimal")
        return thousands


class TextFormat(TableFormat):
    """Text with one separator."""

    separator: str = Field(default=",", min_length=1)  # one character, or "whitespace"
    encoding: str = "utf-8"
    comment: str | None = Field(default=None, min_length=1, max_length=1)

    def text(self) -> TextFormat:
        """Return this format."""
        return self

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


class SheetFormat(TableFormat):
    """A sheet of a workbook (.xlsx, .ods): that of this name, or the one with most cells."""

    sheet: str | None = None


class ParquetFormat(Format):
    """A Parquet file; its columns have names and types."""


class MatFormat(Format):
    """A MATLAB file up to version 7: fields of structs are `struct.field`, columns of a matrix `name.1`, `name.2`."""


class NmeaFormat(Format):
    """NMEA 0183 sentences; `time` is of the last fix, or a number or ISO date before each sentence (`"line"`)."""

    time: Literal["fix", "line"] = "fix"


def require_file(file: Path) -> int:
    """Return the size of a file in bytes; raises DataError where it is no file: absent, a folder, a device, a pipe."""
    try:
        state = file.stat()
        if stat.S_ISDIR(state.st_mode):
            raise DataError("cannot be read (it is a folder)", file=file)
        if not stat.S_ISREG(state.st_mode):
            raise DataError("a device or a pipe, not a file: save its output to a file first", file=file)
        return state.st_size
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror})", file=file) from None


def read_table(
    file: Path, form: Format, clock: str, columns: Iterable[str] = (), progress: Progress | None = None
) -> pd.DataFrame:
    """Read a log as its format says; `attrs["unreadable"]` counts the lines that were skipped.

    Parameters
    ----------
    clock : name of the column of time. columns : names of the others that are needed; a large text is read for them
        alone, as numbers where they are.
    progress : called with the share of a large log that has been read, 0 to 1.

    Raises
    ------
    DataError : with the log, the key of the format or the row, and what would be right.
    """
    size = require_file(file)
    if size == 0:
        raise DataError("the file is empty", file=file)
    try:
        table: pd.DataFrame | None = None
        if isinstance(form, TextFormat) and size > LARGE and columns:
            table = _large_text(file, form, {clock, *columns}, progress, size)
        if table is None:
            table = READERS[form.kind].read(file, form, clock)
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror})", file=file) from None
    if len(table) < 2:
        raise DataError(f"a header and {len(table)} rows: a log needs two rows or more", file=file)
    return table


def seconds(dates: pd.Series[Any]) -> Array:
    """Return dates as seconds since 1970 (UTC where no zone is given), times of day as seconds since midnight.

    Read are ISO 8601, dates and durations of pandas, durations as text, and `DAYS` with `HOURS`; of those that every
    row can be, that with which the log is shorter, else day/month. A time of day goes on after midnight. NaN where
    there is none, and where a date has no zone while others have one.
    """
    if isinstance(dates.dtype, pd.CategoricalDtype):
        dates = dates.astype(object)
    if pd.api.types.is_timedelta64_dtype(dates.dtype):
        return np.array(dates.dt.total_seconds(), dtype=np.float64)
    if pd.api.types.is_numeric_dtype(dates.dtype) and in_one_number(dates.to_numpy(dtype=np.float64, na_value=np.nan)):
        dates = dates.map(lambda one: f"{one:.16g}")
    if pd.api.types.is_string_dtype(dates.dtype) or dates.dtype == object:
        texts = dates.dropna().astype(str).str.strip()
        if texts.str.contains(",", regex=False).any():
            texts = texts.str.replace(r",\s+", " ", regex=True).str.replace(",", ".")
        if len(texts) and texts.str.contains(UTC_BEHIND).all():
            texts = texts.str.replace(UTC_BEHIND, "", regex=True)
            dates = texts.reindex(dates.index)
        if len(texts) and texts.str.fullmatch(TIME_OF_DAY).all():
            return _since_midnight(dates)
        if len(texts) and texts.str.fullmatch(DURATION).all():
            since = pd.to_timedelta(texts, errors="coerce").dt.total_seconds()
            return np.array(since.reindex(dates.index), dtype=np.float64)
        ordinal = texts.str.extract(ORDINAL)
        if len(texts) and ordinal.notna().all(axis=None):
            joined = ordinal[0] + " " + ordinal[1] + " " + ordinal[2]
            return _since_1970(_moments(joined, "%Y %j %H:%M:%S").reindex(dates.index))
        compact = texts.str.extract(COMPACT)
        if len(texts) and compact[[0, 1]].notna().all(axis=None):
            joined = compact[0] + " " + compact[1] + "." + compact[2].fillna("0")
            return _since_1970(_moments(joined, "%Y%m%d %H%M%S.%f").reindex(dates.index))
        written = ways_of(texts)
        if written:
            moments = min((_moments(texts, one) for one in written), key=_unlikely)
            return _since_1970(moments.reindex(dates.index))
        zoned = texts.str.contains(ZONE)
        dates = (texts[zoned] if zoned.any() else texts).reindex(dates.index)
    return _since_1970(pd.to_datetime(dates, format="ISO8601", utc=True, errors="coerce"))


def in_one_number(values: Array) -> bool:
    """Whether numbers (N,) are dates and times of day, as 20240514080000 is: year, month, day, hour, minute, second."""
    if not len(values) or not np.all((values > 1.9e13) & (values < 2.1e13)):
        return False
    fields = ((values // 10.0**place % 100).astype(int) for place in (8, 6, 4, 2, 0))
    limits = ((1, 12), (1, 31), (0, 23), (0, 59), (0, 60))
    return all(bool(np.all((one >= low) & (one <= high))) for one, (low, high) in zip(fields, limits, strict=True))


def ways_of(texts: pd.Series[Any]) -> list[str]:
    """Ways in which dates (N,) of text may be written, none for ISO 8601: most of a sample can be read so."""
    places = np.random.default_rng(0).integers(0, max(1, len(texts)), SAMPLES)  # a stride may meet one kind
    some = texts.iloc[np.unique(places)] if len(texts) else texts
    some = some[some.str.fullmatch(rf"(?:{DAY_OF})\s+{TIME_OF_DAY}")]
    shown = some.tolist()
    ways = [one for one in WAYS if sum(_shape(one).fullmatch(text) is not None for text in shown) > 0.5 * len(some)]
    return [one for one in ways if _moments(some, one).notna().mean() > 0.5] if len(some) else []


@cache
def _shape(way: str) -> re.Pattern[str]:
    """A regular expression of the texts that may be dates of a way of writing: it is much faster to ask first."""
    digits = {"Y": r"\d{4}", "b": "[A-Za-z]{3}", "S": r"\d\d?(?:\.\d+)?", "p": "[AaPp][Mm]"}
    letters = re.escape(way).replace("\\ ", r"\s+")
    return re.compile(re.sub("%(.)", lambda one: digits.get(one[1], r"\d\d?"), letters))


def days_by(texts: pd.Series[Any], way: str) -> Array:
    """Dates (N,) of one of the `ways_of` writing as seconds since 1970, NaN for others."""
    return _since_1970(_moments(texts, way))


def _moments(texts: pd.Series[Any], way: str) -> pd.Series[Any]:
    """Dates of one way of writing, NaT for others; a second may have a fraction, or none."""
    moments = pd.to_datetime(texts, format=way, utc=True, errors="coerce").dt.as_unit("us")
    missing = moments.isna()
    if "%S" in way and missing.any():
        again = pd.to_datetime(texts[missing], format=way.replace("%S", "%S.%f"), utc=True, errors="coerce")
        moments = moments.fillna(again.dt.as_unit("us"))
    return moments


def _unlikely(moments: pd.Series[Any]) -> tuple[int, float]:
    """Rows that are no dates, then the time between the first and the last."""
    return int(moments.isna().sum()), float((moments.max() - moments.min()).total_seconds())


def date_of(moment: float) -> str:
    """A moment in seconds since 1970 as date and time in UTC, the reverse of `seconds`."""
    return datetime.fromtimestamp(moment, UTC).strftime("%Y-%m-%d %H:%M:%S")


def moment_of(t: float) -> str:
    """A time [s] of a log in words: a date where it counts from 1970, else seconds."""
    return f"{date_of(t)} UTC" if DATED < t < LAST_DATE else f"{t:.10g} s"


def span_of(first: float, last: float) -> str:
    """Two times [s] of a log in words: dates where they count from 1970, else seconds."""
    dates = min(first, last) > DATED and max(first, last) < LAST_DATE
    return f"{date_of(first)} to {date_of(last)} UTC" if dates else f"{first:.10g} to {last:.10g} s"


def dated(dates: pd.Series[Any], times: pd.Series[Any]) -> pd.Series[Any]:
    """Return dates and times of day, of two columns (N,) of text, as one column of text for `seconds`."""
    text = dates.astype("string").str.strip() + " " + times.astype("string").str.strip().str.replace(",", ".")
    return text.astype(object)


def in_points(text: pd.Series[Any], decimal: str, thousands: str | None) -> pd.Series[Any]:
    """Numbers (N,) as text, with a point for the decimal sign and without marks of thousands between full groups."""
    if thousands is not None:
        grouped = text.str.fullmatch(grouped_by(decimal, thousands))
        whole = text.str.replace(thousands, "", regex=False).where(grouped, "no number")
        text = text.where(~text.str.contains(thousands, regex=False), whole)
    text = text.str.replace(",", ".", regex=False) if decimal == "," else text
    return text.replace("-0", "-0.0")  # degrees before minutes: a whole number has no such sign


def grouped_by(decimal: str, thousands: str) -> str:
    """A regular expression of a number with such marks of thousands."""
    mark, point = re.escape(thousands), re.escape(decimal)
    return rf"[+-]?[1-9]\d{{0,2}}(?:{mark}\d{{3}})+(?:{point}\d*)?"


def date_texts(parts: list[Array]) -> pd.Series[Any]:
    """Return year, month and day, or year and day of the year (N,), as text for `dated`; None where there is no such.

    Years of two digits are of 1969 to 2068, as everywhere in Python.
    """
    year, last = parts[0], 31 if len(parts) == 3 else 366
    year = np.where((year >= 0) & (year < 100), year + np.where(year < 69, 2000, 1900), year)
    limits = [(1900, 9999), *([(1, 12)] if len(parts) == 3 else []), (1, last)]
    form = "{:.0f}-{:02.0f}-{:02.0f}" if len(parts) == 3 else "{:.0f}-{:03.0f}"
    known = _all_whole([year, *parts[1:]], limits)
    cells = zip(*(part.tolist() for part in (year, *parts[1:])), strict=True)
    return pd.Series(
        [form.format(*cell) if one else None for one, cell in zip(known, cells, strict=True)], dtype=object
    )


def time_texts(parts: list[Array]) -> pd.Series[Any]:
    """Return hour, minute and, if there is a third, second (N,), as text for `seconds`; None where there is no such."""
    hour, minute, *rest = parts
    second = rest[0] if rest else np.zeros(len(hour))
    known = _all_whole([hour, minute, np.floor(second)], [(0, 23), (0, 59), (0, 60)])
    micros = np.round(1e6 * (3600.0 * hour + 60.0 * minute + second)[known]).astype(np.int64)
    texts = pd.Series([None] * len(hour), dtype=object)
    whole = micros // 1_000_000
    numbers = zip(whole // 3600, whole // 60 % 60, whole % 60, micros % 1_000_000, strict=True)
    texts[known] = ["{:02d}:{:02d}:{:02d}.{:06d}".format(*one) for one in numbers]
    return texts


def _all_whole(parts: list[Array], limits: list[tuple[int, int]]) -> NDArray[np.bool_]:
    """Whether all parts (N,) are whole numbers from the first to the second of their limits."""
    pairs = zip(parts, limits, strict=True)
    inside = [(part >= low) & (part <= high) & (part % 1 == 0) for part, (low, high) in pairs]
    return np.asarray(np.all(inside, axis=0), dtype=np.bool_)


def _since_1970(moments: pd.Series[Any]) -> Array:
    since = (moments - pd.Timestamp("1970-01-01", tz="UTC")).dt.total_seconds()
    return np.array(since, dtype=np.float64)


def _since_midnight(times: pd.Series[Any]) -> Array:
    texts = times.astype("string").str.strip().str.replace(",", ".")
    half = texts.str[-2:].str.lower()
    of_twelve = half.isin(["am", "pm"]).to_numpy(dtype=bool, na_value=False)
    parts = texts.where(~of_twelve, texts.str[:-2]).str.split(":", expand=True)
    numbers = parts.apply(pd.to_numeric, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan)
    since = np.nansum(numbers * [3600.0, 60.0, 1.0][: numbers.shape[1]], axis=1)
    afternoon = half.eq("pm").to_numpy(dtype=bool, na_value=False)
    since[of_twelve] = since[of_twelve] % HALF_DAY + HALF_DAY * afternoon[of_twelve]  # 12:30 AM is half past midnight
    since[np.isnan(numbers[:, 0])] = np.nan
    return over_midnights(since)


def over_midnights(since: Array) -> Array:
    """Times of day (N,) [s] as seconds since the first midnight: after one that goes back, the next day has begun.

    Where it goes back by an hour it is not the next day: see `hour_twice`.
    """
    steps = np.diff(since, prepend=since[:1])
    return np.asarray(since + DAY * np.cumsum((steps < -NEXT_DAY) & ~_hour_back(steps)), dtype=np.float64)


def hour_twice(t: Array) -> tuple[int, str] | None:
    """Row (from 0) of a log at t (N,) [s] that begins an hour anew, and what to do; None if no row does.

    So local time does at the end of daylight saving. A pause of up to ten minutes may lie between the rows.
    """
    steps = np.diff(t)
    row = int(np.argmax(steps < 0)) + 1 if np.any(steps < 0) else 0
    if row == 0 or not _hour_back(steps[row - 1]):
        return None
    last, first = (date_of(one) if DATED < one < LAST_DATE else date_of(one % DAY)[11:] for one in t[row - 1 : row + 1])
    remedy = "write UTC, or in every row the zone that holds there; else sort or split the log"
    return row, f"time goes back by an hour, from {last} to {first}: is it local time as daylight saving ends? {remedy}"


def _hour_back(steps: Any) -> Any:
    """Whether steps (N,) [s] of a clock go back by an hour, less a pause of up to ten minutes."""
    return (steps >= -HOUR) & (steps <= NEXT_DAY - HOUR)


def _text(file: Path, form: TextFormat, _: str) -> pd.DataFrame:
    """Read a delimited text log as columns of text, named by its header, by `form.names` or by number."""
    if form.skip_rows == 0:
        _refuse_foreign(file)
    with file.open("rb") as stream:
        head = stream.read(LONGEST_LINE)
    if b"\0" in head[:4096] and not form.encoding.startswith(("utf-16", "utf-32")):
        kind = next((name for name, one in READERS.items() if one.detect and one.detect(file, head[:4096])), None)
        message = "holds NUL bytes: binary, or UTF-16 text; export it as text or set the encoding"
        if kind is not None:
            raise DataError(f"is no text: set [format] kind = {kind!r}", file=file, path="format.kind")
        raise DataError(message, file=file, path="format.encoding")
    widest(head, form.separator, file)
    return parse_text(file, form, file)


def widest(head: bytes, separator: str, file: Path) -> None:
    """Raise DataError where a line in the first bytes of a log has more cells than any log has."""
    mark = b" " if separator == "whitespace" else separator.encode()
    end = b"\n" if b"\n" in head else b"\r"
    for line in head.split(end, LOOKED_AT)[:LOOKED_AT]:
        check_width(line.count(mark) + 1, file)


def parse_text(source: Path | io.StringIO, form: TextFormat, file: Path) -> pd.DataFrame:
    """Read text as a table of text; `file` is the log that errors name.

    Lines without any value are left out. A line with more or fewer cells than the header is an error, or left out and
    counted in `attrs["ragged"]` (their line numbers) if `form.ragged` says so.
    """
    width = _width(source, form)
    try:
        table = pd.read_csv(
            source,
            sep=r"\s+" if form.separator == "whitespace" else form.separator,
            encoding=form.encoding,
            skiprows=form.skip_rows,
            comment=form.comment,
            header=None,
            names=range(width),
            index_col=False,
            dtype=str,
            keep_default_na=False,
            skip_blank_lines=False,
            on_bad_lines="error" if form.ragged == "refuse" else "skip",
        )
    except UnicodeDecodeError as error:
        message = f"not {form.encoding} text (byte {error.start}): set the encoding it was saved in, often cp1252"
        raise DataError(message, file=file, path="format.encoding") from None
    except pd.errors.EmptyDataError:
        raise _nothing_left(form, file) from None
    except (pd.errors.ParserError, ValueError) as error:
        message = f"not a table with this separator ({error}): check separator and skip_rows"
        raise DataError(message, file=file, path="format.separator") from None
    blank = np.ones(len(table), dtype=bool)
    for name in table:
        blank &= (table[name].isna() | table[name].str.strip().eq("")).to_numpy()
    table = table.loc[~blank]
    if not len(table):
        raise _nothing_left(form, file)
    names, table = _named_columns(table, form, file)
    table, again = _without_headers(table, names, source, form, file)
    table, ragged = _without_ragged(table, names, source, form, file)
    table.columns = pd.Index(names)
    table.attrs["ragged"] = sorted([*again, *ragged])
    return table.reset_index(drop=True)


def _width(source: Path | io.StringIO, form: TextFormat) -> int:
    """Return the largest number of cells in the first lines after those that are skipped."""
    if isinstance(source, Path):
        with source.open("rb") as stream:
            lines = stream.read(LONGEST_LINE // 8).decode(form.encoding, "replace").splitlines()
    else:
        lines = source.getvalue()[: LONGEST_LINE // 8].splitlines()
    lines = lines[form.skip_rows : form.skip_rows + LOOKED_AT]
    if form.separator == "whitespace":
        return max((len(line.split()) for line in lines), default=1) or 1
    counts = [len(re.sub(r'"[^"]*"', "", line).split(form.separator)) for line in lines]
    return max(counts, default=1)


def _nothing_left(form: TextFormat, file: Path) -> DataError:
    if not form.skip_rows:
        return DataError("holds no line with values", file=file)
    message = f"no line is left after {form.skip_rows} skipped lines: lower skip_rows"
    return DataError(message, file=file, path="format.skip_rows")


def _named_columns(table: pd.DataFrame, form: TextFormat, file: Path) -> tuple[list[str], pd.DataFrame]:
    """Return a name for every column, empty where the header has none, and the rows below the header."""
    filled = [bool(table[name].fillna("").str.strip().ne("").any()) for name in table]
    width = max((index + 1 for index, one in enumerate(filled) if one), default=1)
    if form.names is not None:
        if len(form.names) != width and len(form.names) != table.shape[1]:
            message = f"{len(form.names)} names for the {width} columns of the log"
            raise DataError(message, file=file, path="format.names")
        names = [*form.names, *[""] * (table.shape[1] - len(form.names))]
        return names, table
    if form.header:
        return ["" if pd.isna(name) else str(name).strip() for name in table.iloc[0]], table.iloc[1:]
    return [str(number + 1) if number < width else "" for number in range(table.shape[1])], table


def _without_headers(
    table: pd.DataFrame, names: list[str], source: Path | io.StringIO, form: TextFormat, file: Path
) -> tuple[pd.DataFrame, list[int]]:
    """Return the rows that do not repeat the header, and the line numbers of the others; refuse them if so declared.

    Files that were put one behind the other have such lines.
    """
    named = [index for index, name in enumerate(names) if name]
    again = np.zeros(len(table), dtype=bool)
    if form.header and form.names is None and named:
        again = table.iloc[:, named[0]].str.strip().eq(names[named[0]]).to_numpy(dtype=bool, na_value=False)
    for index in named if again.any() else ():
        again = again & table.iloc[:, index].str.strip().eq(names[index]).to_numpy(dtype=bool, na_value=False)
    if not again.any():
        return table, []
    lines = _line_numbers(table.index[again], source, form)
    if form.ragged == "refuse":
        more = f" ({len(lines)} such lines)" if len(lines) > 1 else ""
        message = f"repeats the header{more}: remove the line, split the log there, or set [format] ragged = 'drop'"
        raise DataError(message, file=file, path=f"line {lines[0]}")
    return table.loc[~again], lines


def _without_ragged(
    table: pd.DataFrame, names: list[str], source: Path | io.StringIO, form: TextFormat, file: Path
) -> tuple[pd.DataFrame, list[int]]:
    """Return the rows with one cell for every name, and the line numbers of the others; refuse them if so declared."""
    named = [index for index, name in enumerate(names) if name]
    beyond = [index for index in range(len(names)) if index > (named[-1] if named else 0)]
    wrong = np.zeros(len(table), dtype=bool)
    short: dict[int, int] = {}
    for index in named[-1:]:  # a short line lacks the last cells
        empty = table.iloc[:, index].fillna("").eq("").to_numpy()
        short = _short_lines(source, form, {int(number) for number in table.index[empty]}, index + 1)
        wrong |= np.isin(table.index, list(short))
    for index in beyond:
        wrong |= table.iloc[:, index].fillna("").str.strip().ne("").to_numpy()
    lines = _line_numbers(table.index[wrong], source, form)
    if len(lines) > len(table) / 2:
        message = f"not a table with this separator: {len(lines)} of {len(table)} lines have another number of cells "
        raise DataError(f"{message}than the header: check separator and skip_rows", file=file, path="format.separator")
    if lines and form.ragged == "refuse":
        first = int(np.argmax(wrong))
        row = table.iloc[first]
        filled = row.fillna("").str.strip().ne("").to_numpy()
        cells = short.get(int(table.index[first]), int(filled.nonzero()[0].max()) + 1)
        count = len(named) if not beyond or cells < beyond[0] else beyond[0]
        more = f" ({len(lines)} such lines)" if len(lines) > 1 else ""
        message = (
            f"{cells} cells, where the header has {count}{more}: correct the line, or set [format] ragged = 'drop'"
        )
        raise DataError(message, file=file, path=f"line {lines[0]}")
    return (table.loc[~wrong] if lines else table), lines


def _short_lines(source: Path | io.StringIO, form: TextFormat, asked: set[int], width: int) -> dict[int, int]:
    """Return number -> count of cells of the lines asked for that have fewer than `width` cells.

    Lines are counted as by `_lines`. To pandas, a cell that is not there is an empty one.
    """
    short = {}
    for place, (_, line) in enumerate(_lines(source, form) if asked else ()):
        if place in asked:
            whole = re.sub(r'"[^"]*"', "", line)
            count = len(whole.split() if form.separator == "whitespace" else whole.split(form.separator))
            if count < width:
                short[place] = count
    return short


def _line_numbers(places: Iterable[int], source: Path | io.StringIO, form: TextFormat) -> list[int]:
    """Return the numbers in the log, from 1, of lines counted as by `_lines`."""
    if form.comment is None:
        return [int(place) + 1 + form.skip_rows for place in places]
    asked = set(places)
    return [number for place, (number, _) in enumerate(_lines(source, form) if asked else ()) if place in asked]


def _lines(source: Path | io.StringIO, form: TextFormat) -> Iterator[tuple[int, str]]:
    """Yield number, from 1, and text of the lines that pandas takes for rows: neither skipped nor a comment."""
    text = io.StringIO(source.getvalue()) if isinstance(source, io.StringIO) else source.open(encoding=form.encoding)
    with text:
        for number, line in enumerate(text, start=1):
            if number > form.skip_rows and (form.comment is None or not line.startswith(form.comment)):
                yield number, line


def _large_text(
    file: Path, form: TextFormat, wanted: set[str], progress: Progress | None, size: int
) -> pd.DataFrame | None:
    """Read only the wanted columns of a text log, block by block, as numbers; None where that cannot be done.

    What cannot be read so (blanks as separator, comments, text among the numbers, ragged lines) is left to the slow and
    thorough way, which names the place.
    """
    import pyarrow.csv as arrow

    if form.separator == "whitespace" or form.comment is not None or form.ragged == "drop":
        return None
    with file.open("rb") as stream:
        head = stream.read(1_000_000)
    if b"\0" in head[:4096] and not form.encoding.startswith(("utf-16", "utf-32")):
        return None
    widest(head, form.separator, file)
    text = head.decode(form.encoding, "replace").rpartition("\n")[0]
    if not text:  # lines end with a carriage return alone
        return None
    first = parse_text(io.StringIO(text), form.model_copy(update={"ragged": "drop"}), file)
    names = [str(name) for name in first.columns]
    places = [index for index, name in enumerate(names) if name in wanted]
    if {names[index] for index in places} != wanted or len(places) != len(wanted):
        return None
    plain = {
        index: pd.to_numeric(_decimal(first.iloc[:, index], form), errors="coerce").notna().any() for index in places
    }
    skip = form.skip_rows + int(form.header and form.names is None)
    expected = int(1.02 * size * len(first) / max(1, len(text))) + 1000  # rows: what is not filled takes no memory
    numbers = {index: np.empty(expected) for index in places if plain[index]}
    texts: dict[int, list[Any]] = {index: [] for index in places if not plain[index]}
    try:
        reader = arrow.open_csv(
            file,
            arrow.ReadOptions(
                column_names=[str(i) for i in range(len(names))],
                skip_rows=skip,
                encoding=form.encoding,
                block_size=1_000_000,
                use_threads=True,
            ),
            arrow.ParseOptions(delimiter=form.separator, ignore_empty_lines=True),
            arrow.ConvertOptions(
                include_columns=[str(index) for index in places],
                column_types={str(i): pyarrow.float64() if plain[i] else pyarrow.string() for i in places},
                null_values=list(form.missing),
                strings_can_be_null=True,
                decimal_point=form.decimal,
            ),
        )
        rows = 0
        for batch in reader:
            before, rows = rows, rows + batch.num_rows
            for place, column in zip(places, batch.columns, strict=True):
                values = column.to_numpy(zero_copy_only=False)
                if place in texts:
                    texts[place].append(values)
                    continue
                if np.count_nonzero(np.isnan(values)) > column.null_count:  # a word that this mapping does not declare
                    return None
                if rows > len(numbers[place]):
                    more = np.empty(max(rows - len(numbers[place]), len(numbers[place]) // 4))
                    numbers[place] = np.concatenate([numbers[place], more])
                numbers[place][before:rows] = values
            if progress is not None and rows:
                progress(min(1.0, rows * (len(text) / max(1, len(first))) / size))
    except (pyarrow.ArrowException, UnicodeError, ValueError):
        return None
    joined = {
        names[place]: numbers[place][:rows]
        if place in numbers
        else np.concatenate([np.empty(0, object), *texts[place]])
        for place in places
    }
    table = pd.DataFrame(joined, copy=False)
    blank = np.ones(len(table), dtype=bool)
    for name in table:
        blank &= table[name].isna().to_numpy()
    return None if blank.any() else table  # whether such a line is empty, only all its cells tell


def _decimal(column: pd.Series[Any], form: TextFormat) -> pd.Series[Any]:
    return column.str.replace(",", ".") if form.decimal == "," else column


def _refuse_foreign(file: Path) -> None:
    """Raise DataError with the remedy where a file is of a kind that no reader reads."""
    with file.open("rb") as stream:
        other = foreign(stream.read(ENOUGH))
    if other is not None:
        raise DataError(other.sentence, file=file, path="format.kind")


def _sheet(file: Path, form: SheetFormat, _: str) -> pd.DataFrame:
    _refuse_foreign(file)
    name = sheets_of(file)[0] if form.sheet is None else form.sheet
    return parse_text(io.StringIO(sheet_text(file, name)), form.text(), file)


def _parquet(file: Path, _: ParquetFormat, __: str) -> pd.DataFrame:
    _refuse_foreign(file)
    try:
        stored = pyarrow.parquet.read_table(file)
        plain = [place for place, field in enumerate(stored.schema) if not pyarrow.types.is_nested(field.type)]
        table: pd.DataFrame = stored.select(plain).to_pandas(ignore_metadata=True)  # an index is a column
        return table
    except (pyarrow.ArrowException, ValueError):
        raise DataError("not a Parquet file, or damaged: set [format] kind", file=file, path="format.kind") from None


def _mat(file: Path, _: MatFormat, clock: str) -> pd.DataFrame:
    """Return the vectors of a MATLAB file that are as long as the clock, as a table.

    `attrs["other"]` says of every other variable what it is, and how to make a vector of it; `attrs["to save anew"]`
    names those that MATLAB must save otherwise.
    """
    from scipy.io import loadmat

    _refuse_foreign(file)
    try:
        variables = loadmat(file, simplify_cells=True)
        vectors, further = dict(_vectors(variables)), list(_no_vectors(variables))
    except NotImplementedError:
        message = "a MATLAB file of version 7.3: save it with save(..., '-v7')"
        raise DataError(message, file=file, path="format.kind") from None
    except Exception as error:  # scipy defines no error class: a damaged file raises any of a dozen
        message = f"not a MATLAB file, or damaged ({type(error).__name__}): set [format] kind"
        raise DataError(message, file=file, path="format.kind") from None
    other = {name: f"{what}: {remedy}" if remedy else what for name, what, remedy in further}
    if not vectors:
        first = next(iter(other), None)
        which = f"; {first!r} is {other[first]}" if first is not None else ""
        raise DataError(f"no variable of this MATLAB file is a vector of numbers{which}", file=file)
    longest = max(vectors, key=lambda name: len(vectors[name]))
    measure = clock if clock in vectors else longest
    length = len(vectors[measure])
    for name, values in vectors.items():
        if len(values) != length:
            other[name] = f"of {len(values)} values, and {measure!r} has {length}: a column has a value for every time"
    table = pd.DataFrame({name: values for name, values in vectors.items() if len(values) == length})
    table.attrs["other"] = other
    table.attrs["to save anew"] = list(dict.fromkeys(name for name, _, remedy in further if remedy))
    return table


def _vectors(variables: dict[str, Any]) -> Iterable[tuple[str, np.ndarray[Any, Any]]]:
    """Dotted name and values of every numeric vector, structs and matrices opened."""
    for name, value in _opened(variables):
        if isinstance(value, np.ndarray) and np.issubdtype(value.dtype, np.number) and not np.iscomplexobj(value):
            if value.ndim == 1:
                yield name, value.astype(float)
            elif value.ndim == 2:
                yield from (
                    (f"{name}.{column + 1}", value[:, column].astype(float)) for column in range(value.shape[1])
                )


def _opened(variables: dict[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    """Dotted name and value of every variable, structs opened."""
    for key, value in variables.items():
        if key.startswith("__"):
            continue
        if isinstance(value, dict):
            yield from _opened(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _no_vectors(variables: dict[str, Any]) -> Iterable[tuple[str, str, str]]:
    """Dotted name of every variable that is no vector of numbers, what it is, and how MATLAB makes a vector of it.

    The last is empty where nothing has to be saved anew.
    """
    for name, value in _opened(variables):
        last = name.rpartition(".")[2]
        cells = list(value.flat) if isinstance(value, np.ndarray) and value.dtype == object else value
        if isinstance(value, np.ndarray) and value.dtype.names:  # a datetime, a table: scipy does not open them
            about = [text.decode() if isinstance(text, bytes) else str(text) for text in value.ravel()[0]][:3]
            remedy = "save seconds(t - t(1)) of a datetime, table2struct(T, 'ToScalar', true) of a table"
            yield about[0], f"an object of class {about[2]}, not a vector of numbers", remedy
        elif isinstance(cells, list) and cells and isinstance(cells[0], dict):
            field = next(iter(cells[0]), "x")
            remedy = f"save a struct of vectors, such as s.{field} = [{name}.{field}]"
            yield name, f"an array of {len(cells)} structs, not a struct of vectors", remedy
            yield from ((f"{name}.{key}", "in an array of structs", remedy) for key in cells[0])
        elif isinstance(cells, list):
            remedy = f"save {last} = cell2mat({last}), or datenum({last}) of dates"
            yield name, f"an array of {len(cells)} cells, not a vector of numbers", remedy
        elif np.asarray(value).dtype.kind == "U":
            yield name, "text, not a vector of numbers", f"save str2double({last}), or datenum({last}) of dates"
        elif np.iscomplexobj(value):
            yield name, "complex, not a vector of real numbers", f"save real({last})"
        elif np.ndim(value) > 2:
            shape = " x ".join(map(str, value.shape))
            yield name, f"an array of {shape}, not a vector or matrix", f"save squeeze({last}), or one part of it"
        elif np.ndim(value) == 0:
            yield name, "a single number, not a vector", ""
        elif np.ndim(value) == 2:
            yield name, f"a matrix: its columns are {name}.1 to {name}.{value.shape[1]}", ""


def _nmea(file: Path, form: NmeaFormat, _: str) -> pd.DataFrame:
    """Return sentences as rows: `time` [s] and the columns of `SENTENCES`, NaN where a sentence has no value."""
    import pynmea2

    _refuse_foreign(file)
    rows: list[dict[str, float]] = []
    unreadable, clock = 0, _Clock()
    for number, line in enumerate(file.read_bytes().decode("latin-1").splitlines(), start=1):
        stamp, dollar, body = line.partition("$")
        if not line.strip():
            continue
        try:
            sentence = pynmea2.parse(dollar + body.strip(), check=True) if dollar else None
            values = _values_of(sentence)
        except (pynmea2.ParseError, ValueError, TypeError, AttributeError, IndexError):
            sentence = None
        if sentence is None:
            unreadable += 1
            continue
        if form.time == "line":
            try:
                rows.append({"time": _stamp(stamp), **values})
            except ValueError as error:
                message = f"{error}: set [format] time = 'fix'"
                raise DataError(message, file=file, path=f"row {number}") from None
            continue
        clock.read(sentence)
        if clock.fixes:  # before the first fix the time is unknown
            rows.append({"time": len(clock.fixes) - 1, **values})
    if not rows:
        message = f"no NMEA 0183 sentence with a time in {unreadable} unreadable lines: set [format] kind or time"
        raise DataError(message, file=file, path="format.kind")
    table = pd.DataFrame(rows).reindex(columns=["time", *NMEA_COLUMNS])
    if form.time == "fix":
        table["time"] = clock.times()[table["time"]]
    again = table["time"].ne(table["time"].shift()).cumsum()  # sentences of one instant are one row
    table = table.groupby(again).first().reset_index(drop=True)
    table.attrs["unreadable"] = unreadable
    return table


class _Clock:
    """Times of fixes: seconds since the midnight before the first one, over further midnights.

    RMC and ZDA say the date. Another fix is of the day of that one before or behind it whose time of day is nearer.
    Without any date a time of day that goes back by twelve hours is of the next day.
    """

    def __init__(self) -> None:
        self.fixes: list[tuple[float, int | None]] = []  # s of the day, and day

    def read(self, sentence: Any) -> None:
        """Add the fix of a sentence that has one."""
        time: Any = getattr(sentence, "timestamp", None)
        if hasattr(time, "hour"):
            seconds = 3600.0 * time.hour + 60.0 * time.minute + time.second + 1e-6 * time.microsecond
            self.fixes.append((seconds, _day_of(sentence)))

    def times(self) -> Array:
        """Return the times (N,) [s] of the fixes."""
        since = np.array([seconds for seconds, _ in self.fixes])
        known = [place for place, (_, day) in enumerate(self.fixes) if day is not None]
        if not known:
            return np.asarray(since + DAY * np.cumsum(np.diff(since, prepend=since[:1]) < -HALF_DAY))
        days = [self._day(place, known) for place in range(len(since))]
        result = since + DAY * (np.array(days) - days[0])
        for place in np.flatnonzero(since < LATE_DATE):
            if place and 0.0 <= result[place] + DAY - result[place - 1] < NEXT_DAY:  # the date is of the day before
                result[place] += DAY
        return np.asarray(result)

    def _day(self, place: int, known: list[int]) -> int:
        """Day of a fix, where those at the places `known` say theirs."""
        now, day = self.fixes[place]
        if day is not None:
            return day
        behind = bisect.bisect_left(known, place)
        near = [self.fixes[one] for one in known[max(0, behind - 1) : behind + 1]]
        apart = [(now - seconds + HALF_DAY) % DAY - HALF_DAY for seconds, _ in near]
        nearest = int(np.argmin(np.abs(apart)))
        seconds, day = near[nearest]
        return int(day or 0) + round((seconds + apart[nearest] - now) / DAY)


def _day_of(sentence: Any) -> int | None:
    """Day of a valid RMC or ZDA, None of another sentence and of one without a date."""
    kind = getattr(sentence, "sentence_type", "")
    if kind not in ("RMC", "ZDA") or getattr(sentence, "status", "A") == "V":
        return None
    try:
        return int(sentence.datestamp.toordinal())
    except (AttributeError, TypeError, ValueError):
        return None


def _stamp(text: str) -> float:
    """Time before a sentence: a number, a date as seconds since 1970, or the time of an NMEA 4.10 TAG block.

    Dates are year-month-day, or day.month.year with dots. ValueError where it is none, or a date that may be two days.
    """
    words = text.strip().rstrip(",;")
    if words.startswith("\\"):
        tag = _TAG_TIME.search(words)
        if tag is None:
            raise ValueError("no time in the TAG block before the sentence")
        return float(tag[1]) / (1000.0 if len(tag[1]) > 11 else 1.0)  # some write milliseconds
    try:
        return float(words)
    except ValueError:
        pass
    shown = repr(words[:30])
    if _DOTTED.match(words):
        words = _DOTTED.sub(r"\3-\2-\1", words)
    elif not _DATED.match(words):
        raise ValueError(f"no number and no date year-month-day before the sentence ({shown})")
    try:
        moment = pd.Timestamp(words)
        return (moment if moment.tzinfo else moment.tz_localize("UTC")).timestamp()
    except (ValueError, AttributeError):
        raise ValueError(f"no number and no date before the sentence ({shown})") from None


def _is_stamp(text: str) -> bool:
    try:
        return math.isfinite(_stamp(text))
    except ValueError:
        return False


def _values_of(sentence: Any) -> dict[str, float]:
    """Return the values of a sentence by column; none of an invalid one (status V; GGA: quality 0; VTG: mode N)."""
    kind = getattr(sentence, "sentence_type", "")
    if getattr(sentence, "status", "A") == "V" or str(getattr(sentence, "gps_qual", 1)) == "0":
        return {}
    if kind == "VTG" and getattr(sentence, "faa_mode", None) == "N":
        return {}
    values = {name: read(sentence) for name, read in SENTENCES.get(kind, {}).items()}
    return {name: float(value) for name, value in values.items() if value not in (None, "")}


def _position(name: str) -> Callable[[Any], Any]:
    """Return the position in decimal degrees; nothing where the field is empty (the parser would return 0)."""
    return lambda sentence: getattr(sentence, name) if getattr(sentence, name[:3]) else None


def _apparent(name: str) -> Callable[[Any], Any]:
    return lambda sentence: getattr(sentence, name) if sentence.reference == "R" else None


def _turns(sentence: Any, source: str) -> str | None:
    """Number of the shaft (source S) or engine (E) whose speed a sentence has; None where it is of the other kind."""
    return str(sentence.engine_no) if sentence.source == source else None


def _revolutions(source: str, *numbers: str) -> Callable[[Any], Any]:
    return lambda sentence: sentence.speed if _turns(sentence, source) in numbers else None


def _rudder(side: str) -> Callable[[Any], Any]:
    """Return the angle of the rudder of a side; nothing where its status says that it is invalid."""
    return lambda s: None if getattr(s, f"rsa_{side}_status", "A") == "V" else getattr(s, f"rsa_{side}")


def _speed(sentence: Any) -> Any:
    """Return the apparent wind speed [m/s] from a value in N (knots), K (km/h) or M (m/s)."""
    if sentence.reference != "R" or not sentence.wind_speed:
        return None
    factor = {"N": KNOT, "K": 1.0 / 3.6, "M": 1.0}.get(sentence.wind_speed_units)
    return None if factor is None else float(sentence.wind_speed) * factor


def _true_wind(sentence: Any) -> Any:
    """Return the true wind speed [m/s], which a sentence has in m/s, in knots or in both."""
    if sentence.wind_speed_meters in (None, "") and sentence.wind_speed_knots:
        return float(sentence.wind_speed_knots) * KNOT
    return sentence.wind_speed_meters


SENTENCES: dict[str, dict[str, Callable[[Any], Any]]] = {
    "GGA": {"latitude": _position("latitude"), "longitude": _position("longitude")},
    "GLL": {"latitude": _position("latitude"), "longitude": _position("longitude")},
    "RMC": {
        "latitude": _position("latitude"),
        "longitude": _position("longitude"),
        "sog": lambda s: s.spd_over_grnd,
        "cog": lambda s: s.true_course,
    },
    "VTG": {"sog": lambda s: s.spd_over_grnd_kts, "cog": lambda s: s.true_track},
    "HDT": {"heading": lambda s: s.heading},
    "ROT": {"rot": lambda s: s.rate_of_turn},
    "RSA": {"rudder": _rudder("starboard"), "rudder_port": _rudder("port")},
    "RPM": {
        "rpm": _revolutions("S", "0", "1"),
        "rpm_2": _revolutions("S", "2"),
        "engine_rpm": _revolutions("E", "0", "1"),
        "engine_rpm_2": _revolutions("E", "2"),
    },
    "MWV": {"apparent_angle": _apparent("wind_angle"), "apparent_speed": _speed},
    "MWD": {"wind_from": lambda s: s.direction_true, "wind_speed": _true_wind},
}
"""Sentence -> column -> how it is read: deg; rot deg/min; sog kn; rpm; wind speeds m/s."""
NMEA_COLUMNS = tuple(dict.fromkeys(name for columns in SENTENCES.values() for name in columns))


@dataclass(frozen=True)
class Reader:
    """One format of logs.

    options : model of the keys of [format] in a mapping.
    read : (file, options, name of the column of time) -> table; raises DataError.
    detect : (file, its first bytes) -> keys of [format] where it is of this format, else None; without it, no guess.
    scattered : whether rows are single sentences that do not say everything, so that empty cells are no defect.
    """

    options: type[Format]
    read: Callable[[Path, Any, str], pd.DataFrame]
    detect: Callable[[Path, bytes], dict[str, Any] | None] | None = None
    scattered: bool = False


def _is_sheet(_: Path, head: bytes) -> dict[str, Any] | None:
    return {"kind": "sheet"} if is_workbook(head[:ENOUGH]) else None


def _is_parquet(_: Path, head: bytes) -> dict[str, Any] | None:
    return {"kind": "parquet"} if head.startswith(b"PAR1") else None


def _is_mat(_: Path, head: bytes) -> dict[str, Any] | None:
    return {"kind": "mat"} if head.startswith((b"MATLAB 5.0", b"MATLAB 7.3")) else None


def _is_nmea(_: Path, head: bytes) -> dict[str, Any] | None:
    """Recognise NMEA 0183: most lines are sentences; the time is before them, or in the position fixes."""
    if b"\0" in head:
        return None
    lines = [line for line in head.decode("latin-1").splitlines()[:LOOKED_AT] if line.strip()]
    sentences = [line for line in lines if _SENTENCE.search(line)]
    if len(sentences) <= len(lines) / 2:
        return None
    stamped = sum(_is_stamp(line.partition("$")[0]) for line in sentences)
    return {"kind": "nmea", "time": "line" if stamped > len(sentences) / 2 else "fix"}


READERS: dict[str, Reader] = {
    "text": Reader(TextFormat, _text),  # no signature: a guess takes every other file for text
    "sheet": Reader(SheetFormat, _sheet, _is_sheet),
    "parquet": Reader(ParquetFormat, _parquet, _is_parquet),
    "mat": Reader(MatFormat, _mat, _is_mat),
    "nmea": Reader(NmeaFormat, _nmea, _is_nmea, scattered=True),
}
"""Kind, as in [format] of a mapping -> reader. To add a format: its options, its two functions, a row here."""
