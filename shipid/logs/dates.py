"""Dates and times of day as they are written in logs, as seconds; and seconds as dates."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import FIRST_DATED_TIME, Array

DAY, HALF_DAY = 86400.0, 43200.0  # s
NEXT_DAY = 600.0  # s: times of day that go back by more are of the next day, but for those that go back by an hour
HOUR = 3600.0  # s: by which local time goes back at the end of daylight saving
WEEKS = 7 * 1024  # days after which the week number of GPS begins again
TIME_OF_DAY = r"\s*\d{1,2}:\d\d(:\d\d([.,]\d+)?)?(\s*[AaPp][Mm])?\s*"
DAY_OF = (
    r"\d{4}[-/]\d\d?[-/]\d\d?|\d\d?(?P<mark>[./-])\d\d?(?P=mark)(\d{4}|\d\d)|\d\d?(?P<gap>[- ])[A-Za-z]{3}(?P=gap)\d{4}"
)
"""A date without a time."""
DAY_OF_EXCEL = r"(?:3[3-9]|4\d|5[0-4])\d{3}"
"""A date as a day of Excel, from 1990 to 2050."""
EXCEL = 25569  # day of Excel of 1 January 1970
FRACTION = r"0|0?\.\d+|\d(?:\.\d+)?[eE]-\d+"
"""A time of day as a part of a day."""
UTC_BEHIND = r"\s+(?:UTC|GMT)$"
"""The end of a date that says in letters that it has no other zone."""
COMPACT = r"(\d{8})[-_ ]?(\d{6})(?:\.?(\d{1,8})\d?)?"
"""A date and a time of day in one number, or nearly: 20240514080000, 20240514080000.5, 20240514_080000."""
JOINED = (
    (r"(\d{4})[-:/ ](\d{3})[-:/ T](\d\d:\d\d:\d\d(?:\.\d+)?)Z?", r"\1 \2 \3", "%Y %j %H:%M:%S"),
    (COMPACT, r"\1 \2.\g<3>0", "%Y%m%d %H%M%S.%f"),
)
"""How dates are joined with times of day, with blanks between them, and how these are then written: with the day of the
year, 2024-135 08:00:00 or 2024:135:08:00:00.5, or in one number."""
DURATION = (
    r"[+-]?\d+(?:\.\d+)? ?(?:d|days?|h|hrs?|hours?|min|minutes?|s|secs?|seconds?|ms)(?: \+?\d+:\d\d:\d\d(?:\.\d+)?)?"
)
"""A time since the begin of a log as MATLAB and pandas write it: 0.5 sec, 0 days 00:00:00.5."""
ZONE = r":\d\d(?:\.\d+)?\s*(?:Z|[+-]\d\d(?::?\d\d)?)$|T\d\d(?::?\d\d)*(?:\.\d+)?(?:Z|[+-]\d\d(?::?\d\d)?)$"
"""The end of a date in ISO 8601 that says its zone."""
_SAID = re.compile(
    r"(?:\b(?:UTC|GMT)|\b(?:tz|time[ _]?zone|Zeitzone|UTC[ _]?offset)\W{1,4}(?:UTC|GMT)?)"
    r"\s*[+-]\s*0?[1-9]\d?(?::?\d\d)?\b"
    r"|\b(?:tz|time[ _]?zone|Zeitzone)\W{1,4}(?!UTC|GMT|Etc)[A-Z]\w+(?:/\w+)*|\blocal[ _]time\b|\b(?:Orts|Lokal)zeit\b"
    r"|\blokale?[ _]?(?:tid|tijd)\b|\b(?:heure|ora)[ _]locale\b|\bhora[ _]local\b",
    re.IGNORECASE,
)
"""A zone other than UTC in the head of a log, or in the name of its clock."""
_SAID_OF_CLOCK = re.compile(
    r"(?<![A-Za-z])(?:CES?T|MES?Z|[ECMP][SD]T|JST|KST|AE[SD]T|LT"
    r"|(?i:(?:heure |ora )?locale|local|lokale?(?:[ _]?(?:tid|tijd))?))(?![A-Za-z])"
)
"""A zone in letters, in the name of a clock alone."""
ZONE_REMEDY = "write UTC, or the zone behind every time, as in 2024-05-14T08:00:00+01:00"
DAYS: tuple[str, ...] = ("%d.%m.%Y", "%d.%m.%y", "%Y/%m/%d", "%d/%m/%Y", "%m/%d/%Y", "%d/%m/%y", "%m/%d/%y")
DAYS += ("%d-%m-%Y", "%m-%d-%Y", "%y/%m/%d", "%d-%b-%Y", "%d %b %Y")
HOURS = ("%H:%M:%S", "%H:%M", "%I:%M:%S %p", "%I:%M %p")
WAYS = (*(f"{day} {hour}" for day in DAYS for hour in HOURS), *(f"%Y-%m-%d {hour}" for hour in HOURS if "%p" in hour))
"""Ways in which a date and a time of day may be written, but for ISO 8601."""
LAST_DATE = 253_402_300_800.0  # s: the begin of the year 10000, as a clock that counts from 1970 has it
SAMPLES = 60  # texts by which the way of writing is looked for


def other_zone(head: str, clock: str, first: str) -> str:
    """Say that a first time without a zone is read as UTC, where the head of a log, or its clock's name, has one."""
    said = _SAID_OF_CLOCK.search(clock) or _SAID.search(f"{head}\n{clock}")
    if said is None or re.search(f"{ZONE}|{UTC_BEHIND}|^{TIME_OF_DAY}$", first):
        return ""
    return f"{first!r} is read as UTC, and the log says {said[0]!r}"


def parse_dates(dates: pd.Series[Any]) -> Array:
    """Dates as seconds since 1970 (UTC where no zone is given), times of day as seconds since midnight.

    Read are ISO 8601, dates and durations of pandas, and `DAYS` with `HOURS`: of those that every row can be, that with
    which the log is shorter, else day/month. NaN where there is none, or no zone while others have one.
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
        for form, parts, way in JOINED:
            if len(texts) and texts.str.fullmatch(form).all():
                joined = texts.str.replace(form, parts, regex=True)
                return _since_1970(_parse_moments(joined, way).reindex(dates.index))
        written = date_formats(texts)
        if written:
            moments = min(
                (_parse_moments(texts, one) for one in written),
                key=lambda one: (int(one.isna().sum()), float((one.max() - one.min()).total_seconds())),
            )
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


def date_formats(texts: pd.Series[Any]) -> list[str]:
    """Ways in which dates (N,) of text may be written, none for ISO 8601: most of a sample can be read so."""
    places = np.random.default_rng(0).integers(0, max(1, len(texts)), SAMPLES)  # a stride may meet one kind
    some = texts.iloc[np.unique(places)] if len(texts) else texts
    some = some[some.str.fullmatch(rf"(?:{DAY_OF})\s+{TIME_OF_DAY}")]
    shown = some.tolist()
    ways = [
        one for one in WAYS if sum(_date_pattern(one).fullmatch(text) is not None for text in shown) > 0.5 * len(some)
    ]
    return [one for one in ways if _parse_moments(some, one).notna().mean() > 0.5] if len(some) else []


@cache
def _date_pattern(way: str) -> re.Pattern[str]:
    """A regular expression of the texts that may be dates of a way of writing: it is much faster to ask first."""
    digits = {"Y": r"\d{4}", "b": "[A-Za-z]{3}", "S": r"\d\d?(?:\.\d+)?", "p": "[AaPp][Mm]"}
    letters = re.escape(way).replace("\\ ", r"\s+")
    return re.compile(re.sub("%(.)", lambda one: digits.get(one[1], r"\d\d?"), letters))


def parse_dates_as(texts: pd.Series[Any], way: str) -> Array:
    """Dates (N,) of one of the `date_formats` writing as seconds since 1970, NaN for others."""
    return _since_1970(_parse_moments(texts, way))


def _parse_moments(texts: pd.Series[Any], way: str) -> pd.Series[Any]:
    """Dates of one way of writing, NaT for others; a second may have a fraction, or none."""
    moments = pd.to_datetime(texts, format=way, utc=True, errors="coerce").dt.as_unit("us")
    missing = moments.isna()
    if "%S" in way and missing.any():
        again = pd.to_datetime(texts[missing], format=way.replace("%S", "%S.%f"), utc=True, errors="coerce")
        moments = moments.fillna(again.dt.as_unit("us"))
    return moments


def format_date(moment: float) -> str:
    """A moment in seconds since 1970 as date and time in UTC, the reverse of `parse_dates`."""
    return datetime.fromtimestamp(moment, UTC).strftime("%Y-%m-%d %H:%M:%S")


def format_moment(t: float) -> str:
    """A time [s] of a log in words: a date where it counts from 1970, else seconds."""
    return f"{format_date(t)} UTC" if FIRST_DATED_TIME < t < LAST_DATE else f"{t:.10g} s"


def rollover_words(step: float) -> str:
    """Words for a step [s] of 1,024 weeks, to an hour, forward or back; empty for any other."""
    remedy = f"add {WEEKS * DAY:.0f} s to the older dates"
    words = f" (1,024 weeks apart: the week number of a GPS receiver rolled over, {remedy})"
    return words if abs(abs(step) - WEEKS * DAY) < HOUR else ""


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
    """Year, month and day, or year and day of the year (N,), as text; nothing where these are no date."""
    year, *rest = (pd.Series(part).where(part % 1 == 0).astype("Int64") for part in parts)
    year = year + (1900 + 100 * (year < 69)).where(year < 100, 0)
    texts = year.astype("string")
    for part in rest:
        texts = texts + "-" + part.astype("string")
    moments = pd.to_datetime(texts, format="%Y-%m-%d" if len(rest) == 2 else "%Y-%j", errors="coerce")
    return moments.dt.strftime("%Y-%m-%d").astype(object)


def time_texts(parts: list[Array]) -> pd.Series[Any]:
    """Hour, minute and, if there is a third, second (N,), as text for `parse_dates`; nothing where they are no time."""
    hour, minute, second = (*parts, np.zeros(len(parts[0])))[:3]
    known = (hour % 1 == 0) & (minute % 1 == 0)
    for part, most in ((hour, 24.0), (minute, 60.0), (second, 61.0)):  # with a leap second
        known &= (part >= 0.0) & (part < most)
    micros = np.where(known, np.round(1e6 * (3600.0 * hour + 60.0 * minute + second)), np.nan)
    moments = pd.to_datetime(pd.Series(np.minimum(micros, 1e6 * DAY - 1.0)), unit="us")  # 24:00:00 is no time of day
    return moments.dt.strftime("%H:%M:%S.%f").astype(object)


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
    """Times of day (N,) [s] as seconds since the first midnight: after one that goes back, the next day has begun."""
    steps = np.diff(since, prepend=since[:1])
    hour_back = (steps >= -HOUR) & (steps <= NEXT_DAY - HOUR)  # less a pause of up to ten minutes
    return np.asarray(since + DAY * np.cumsum((steps < -NEXT_DAY) & ~hour_back), dtype=np.float64)
