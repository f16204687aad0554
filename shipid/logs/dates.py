"""Dates and times of day as they are written in logs, as seconds; and seconds as dates."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import FIRST_DATED_TIME, Array

DAY, HALF_DAY = 86400.0, 43200.0  # s
NEXT_DAY = 600.0  # s: times of day that go back by more are of the next day, but for those that go back by an hour
HOUR = 3600.0  # s: by which local time goes back at the end of daylight saving
TIME_OF_DAY = r"\s*(\d\d?):(\d\d)(?::(\d\d(?:[.,]\d+)?))?\s*([AaPp][Mm])?\s*"
MOMENT = rf"^(?:(.*?\S)(?:[\sT_]+|(?<=\D\d\d\d):))??{TIME_OF_DAY}$"
"""A date, if there is one, and a time of day: its groups are these, hour, minute, second, and half of the day."""
DAY_OF = (
    r"\d{4}[-/]\d\d?[-/]\d\d?|\d\d?(?P<mark>[./-])\d\d?(?P=mark)(\d{4}|\d\d)|\d\d?(?P<gap>[- ])[A-Za-z]{3}(?P=gap)\d{4}"
)
"""A date without a time."""
DAY_OF_EXCEL = r"(?:3[3-9]|4\d|5[0-4])\d{3}"
"""A date as a day of Excel, from 1990 to 2050."""
EXCEL = 25569  # day of Excel of 1 January 1970
FRACTION = r"0|0?\.\d+|\d(?:\.\d+)?[eE]-\d+"
"""A time of day as a part of a day."""
UTC_BEHIND = r"(?:\s*Z|\s+(?:UTC|GMT))$"
"""The end of a date that says in letters that it has no other zone."""
COMPACT = r"(\d{4})(\d\d)(\d\d)[-_ ]?(\d\d)(\d\d)(\d\d)(?:\.?(\d{1,8})\d?)?"
"""A date and a time of day in one number, or nearly: 20240514080000, 20240514080000.5, 20240514_080000."""
DURATION = (
    r"[+-]?\d+(?:\.\d+)? ?(?:d|days?|h|hrs?|hours?|min|minutes?|s|secs?|seconds?|ms)(?: \+?\d+:\d\d:\d\d(?:\.\d+)?)?"
)
"""A time since the begin of a log as MATLAB and pandas write it: 0.5 sec, 0 days 00:00:00.5."""
ISO = r"\d{4}-\d\d-\d\d[T ][\d:.]+\s*(?:Z|[+-][\d:]+)?"
"""A date and a time of day in ISO 8601."""
ZONE = r":\d\d(?:\.\d+)?\s*(?:Z|[+-]\d\d(?::?\d\d)?)$|T\d\d(?::?\d\d)*(?:\.\d+)?(?:Z|[+-]\d\d(?::?\d\d)?)$"
"""The end of a date in ISO 8601 that says its zone."""
DAYS = (
    *("%Y-%m-%d", "%Y-%j", "%d.%m.%Y", "%d.%m.%y", "%d-%b-%Y"),
    *("%d-%m-%Y", "%m-%d-%Y", "%d-%m-%y", "%m-%d-%y", "%y-%m-%d"),
)
"""Ways in which a date may be written, with - for any other mark than a point, and between eight digits."""
LAST_DATE = 253_402_300_800.0  # s: the begin of the year 10000, as a clock that counts from 1970 has it


def parse_dates(dates: pd.Series[Any]) -> Array:
    """Dates as seconds since 1970 (UTC where no zone is given), times of day as seconds since midnight.

    Read are ISO 8601, dates and durations of pandas, and `DAYS` with a `TIME_OF_DAY`: as most rows are. NaN where there
    is none, or no zone while others have one.
    """
    if isinstance(dates.dtype, pd.CategoricalDtype):
        dates = dates.astype(object)
    if pd.api.types.is_timedelta64_dtype(dates.dtype):
        return np.array(dates.dt.total_seconds(), dtype=np.float64)
    if pd.api.types.is_numeric_dtype(dates.dtype) and are_in_one_number(dates.to_numpy(np.float64, na_value=np.nan)):
        dates = dates.map(lambda one: f"{one:.16g}")
    if not (pd.api.types.is_string_dtype(dates.dtype) or dates.dtype == object):
        return _since_1970(dates)
    texts = dates.dropna().astype(str).str.strip()
    if texts.str.contains(",", regex=False).any():
        texts = texts.str.replace(r",\s+", " ", regex=True).str.replace(",", ".", regex=False)
    if texts.str.fullmatch(COMPACT).any():
        texts = texts.str.replace(f"^{COMPACT}$", r"\1-\2-\3 \4:\5:\6.\g<7>0", regex=True)
    if texts.str.contains(UTC_BEHIND).all():
        texts = texts.str.replace(UTC_BEHIND, "", regex=True)
    since = np.full(len(texts), np.nan)
    if texts.str.fullmatch(DURATION).all():
        since = np.array(pd.to_timedelta(texts, errors="coerce").dt.total_seconds())
    elif not texts.str.fullmatch(ISO).mean() > 0.5 and (found := texts.str.extract(MOMENT))[1].notna().mean() > 0.5:
        hour, minute, second = (pd.to_numeric(found[place]) for place in (1, 2, 3))
        of_clock = (hour < 24) & (minute < 60) & ~(second >= 61)  # others are damaged
        since = (3600.0 * hour + 60.0 * minute + second.fillna(0.0)).where(of_clock).to_numpy(np.float64)
        half = found[4].str.lower()
        of_day = np.where(half.isna(), since, since % HALF_DAY + HALF_DAY * half.eq("pm"))  # 12 AM is midnight
        alone = found[0].isna()
        of_one = over_midnights(np.where(alone, of_day, np.nan))
        since = of_one if alone.mean() > 0.5 else read_days(found[0]) + of_day
    else:
        zoned = texts.str.contains(ZONE)
        since = _since_1970(texts.where(zoned | (not zoned.any())))
    return np.array(pd.Series(since, texts.index).reindex(dates.index), dtype=np.float64)


def are_in_one_number(values: Array) -> bool:
    """Whether numbers (N,) may be dates and times of day, as 20240514080000 is."""
    return bool(len(values) and np.all((values > 1.9e13) & (values < 2.1e13)))


def read_days(days: pd.Series[Any]) -> Array:
    """Dates (N,) of text as seconds since 1970, NaN for none, in the way that reads most of them.

    Of several that with which the log is shortest, day/month first; NaN alone where no way reads most.
    """
    places, known = pd.factorize(days)
    texts = pd.Series(known, dtype="str").str.replace(r"[/ :_]+", "-", regex=True)
    texts = texts.str.replace(r"^(\d{4})(\d\d)(\d\d)$", r"\1-\2-\3", regex=True)
    moments = (pd.Series(pd.to_datetime(texts, format=way, utc=True, errors="coerce")) for way in DAYS)
    read = (np.append(_since_1970(one), np.nan)[places] for one in moments)
    readings = [one for one in read if np.isfinite(one).sum() > 0.5 * len(one)]
    return min(
        readings,
        key=lambda one: (int(np.isnan(one).sum()), np.ptp(one[np.isfinite(one)])),
        default=np.full(len(days), np.nan),
    )


def format_date(moment: float) -> str:
    """A moment in seconds since 1970 as date and time in UTC, the reverse of `parse_dates`."""
    return datetime.fromtimestamp(moment, UTC).strftime("%Y-%m-%d %H:%M:%S")


def format_moment(t: float) -> str:
    """A time [s] of a log in words: a date where it counts from 1970, else seconds."""
    return f"{format_date(t)} UTC" if FIRST_DATED_TIME < t < LAST_DATE else f"{t:.10g} s"


def format_span(first: float, last: float) -> str:
    """Two times [s] of a log in words: dates where they count from 1970, else seconds."""
    dates = min(first, last) > FIRST_DATED_TIME and max(first, last) < LAST_DATE
    return f"{format_date(first)} to {format_date(last)} UTC" if dates else f"{first:.10g} to {last:.10g} s"


def join_date_and_time(dates: pd.Series[Any], times: pd.Series[Any]) -> pd.Series[Any]:
    """Dates and times of day of two columns (N,) as text for `parse_dates`; both may be numbers, or days of Excel."""
    days, hours = _as_texts(dates), _as_texts(times).str.replace(",", ".")
    if days.str.fullmatch(DAY_OF_EXCEL).all() and hours.str.fullmatch(FRACTION).all():
        micros = (1e6 * DAY * (days.astype("Float64") - EXCEL + hours.astype("Float64"))).round()
        return pd.to_datetime(micros, unit="us").dt.strftime("%Y-%m-%d %H:%M:%S.%f").astype(object)
    if hours.str.match(r"\d{5}").any():  # shorter ones are before one o'clock
        hours = hours.str.replace(r"^\d{1,6}(?![\d:])", lambda one: f"{int(one[0]):06d}", regex=True)
        hours = hours.str.replace(r"^(\d\d)(\d\d)(?=\d\d(?:\.|$))", r"\1:\2:", regex=True)
    return (days_with_marks(days) + " " + hours).astype(object)


def days_with_marks(dates: pd.Series[Any]) -> pd.Series[Any]:
    """Dates (N,) as text, those in one number with marks: 2024-05-14, 14/05/2024, and 14/05/24 or 24/05/14."""
    texts = _as_texts(dates).str.replace(r"^(\d{5}|\d{7})$", r"0\1", regex=True)
    texts = texts.str.replace(r"^((?:19|20)\d\d)(0[1-9]|1[0-2])(\d\d)$", r"\1-\2-\3", regex=True)
    return texts.str.replace(r"^(\d\d)(\d\d)((?:19|20)\d\d|\d\d)$", r"\1/\2/\3", regex=True)


def _as_texts(cells: pd.Series[Any]) -> pd.Series[Any]:
    """Cells (N,) as text, numbers with all their digits, without a point where they are whole."""
    if pd.api.types.is_numeric_dtype(cells.dtype):
        cells = cells.astype(object).map(lambda one: f"{one:.15g}", na_action="ignore")
    return cells.astype("string").str.strip().str.replace(r"^(\d+)\.0*$", r"\1", regex=True)


def date_texts(parts: list[Array]) -> pd.Series[Any]:
    """Year, month and day, or year and day of the year (N,), as text for `parse_dates`; none where one is not whole."""
    year, *rest = parts
    year = year + np.where(year < 100, 1900 + 100 * (year < 69), 0)
    rows, digits = zip(year, *rest, strict=True), 5 - len(parts)
    return _texts_of(("-".join(f"{one:0{digits}.0f}" for one in row) for row in rows), np.all(np.mod(parts, 1) == 0, 0))


def time_texts(parts: list[Array]) -> pd.Series[Any]:
    """Hour, minute and, if there is a third, second (N,), as text for `parse_dates`; none where they are no time."""
    hour, minute, second = (*parts, np.zeros(len(parts[0])))[:3]
    known = np.all(np.mod([hour, minute], 1) == 0, 0)
    for part, most in ((hour, 24.0), (minute, 60.0), (second, 61.0)):  # with a leap second
        known &= (part >= 0.0) & (part < most)
    since = np.minimum(np.round(3600.0 * hour + 60.0 * minute + second, 6), DAY - 1e-6)  # 24:00:00 is no time of day
    return _texts_of((f"{t // 3600:02.0f}:{t // 60 % 60:02.0f}:{t % 60:09.6f}" for t in since), known)


def _texts_of(texts: Iterable[str], known: NDArray[np.bool_]) -> pd.Series[Any]:
    return pd.Series([text if right else None for text, right in zip(texts, known, strict=True)], dtype=object)


def _since_1970(moments: pd.Series[Any]) -> Array:
    dates = pd.to_datetime(moments, format="ISO8601", utc=True, errors="coerce")
    return np.array((dates - pd.Timestamp("1970-01-01", tz="UTC")).dt.total_seconds(), dtype=np.float64)


def over_midnights(since: Array) -> Array:
    """Times of day (N,) [s] as seconds since the first midnight: after one that goes back, the next day has begun."""
    steps = np.diff(since, prepend=since[:1])
    hour_back = (steps >= -HOUR) & (steps <= NEXT_DAY - HOUR)  # less a pause of up to ten minutes
    return np.asarray(since + DAY * np.cumsum((steps < -NEXT_DAY) & ~hour_back), dtype=np.float64)
