"""The clock of an unknown log: its column or columns, unit and rate, what is doubtful in it, and what is wrong."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import Array
from shipid.errors import DataError
from shipid.logs.dates import (
    DAY,
    DAY_OF,
    DAY_OF_EXCEL,
    LAST_DATE,
    NEXT_DAY,
    TIME_OF_DAY,
    date_formats,
    date_texts,
    days_with_marks,
    format_date,
    format_moment,
    in_one_number,
    join_date_and_time,
    parse_dates,
    parse_dates_as,
    rollover_words,
    time_texts,
)
from shipid.logs.guess.words import is_run, name_parts, units_in_name
from shipid.logs.instants import SHORTEST, clock_rounding, even_clock, rows_repeated
from shipid.logs.mapping import AGAIN, EPOCHS, RESTS, clock_seconds, since_midnight, source_columns, to_si

Rows = NDArray[np.bool_]
LONG = 1e4  # rows between two runs that have a clock each
FEWEST_TIMES = 10  # of a second clock that are compared with the first
APART, OFF = 10, 0.02  # steps of the first clock, and share of its span, by which a second one may go otherwise
ROWS = 10  # of a day in a column of dates that are numbers, at least
FEWEST, NEARLY = 0.3, 0.9  # shares of the rows of a clock with a fault that have a time, and that rise, at least
PAUSE = 3.0  # usual steps, or roundings of the clock: a longer one is a pause
LOST = 0.1  # share of the rows that may be lost at a rate, at most; a pause loses none
REPEATED = 0.05  # share of the rows that may repeat the row before, at most
CLOCK_WORDS = frozenset(
    (
        "t tvec time timestamp stamp clock sec secs seconds date datetime utc ms zeit messzeit zeitstempel "
        "tid tidspunkt sekunden millis epoch zulu hora temps heure elapsed stempel mess uhrzeit klokke tiempo "
        "gmt datenum tow itow sow sod ticks filetime mjd jd julian"
    ).split()
)
WRITTEN = {
    "ns": "ns nsec nanos nanosec nanoseconds",
    "us": "us usec micros microsec microseconds",
    "ms": "ms msec millis millisec milliseconds",
    "s": "s sec secs second seconds sekunden",
    "min": "min mins minute minutes minuten",
    "h": "h hr hrs hour hours stunden",
    "d": "d day days tage",
}
"""Unit of a clock -> words for it, in brackets or at the end of a name."""
FIELDS = {
    "year": ("year yr yyyy yy jahr annee anno ano jaar aar ar", 0.0, 2100.0),
    "month": ("month mon mo mm m monat mois mese mes maand maaned manad", 1.0, 12.0),
    "day": ("day dd d dom tag jour giorno dia dag", 1.0, 31.0),
    "day of the year": ("doy yday jday", 1.0, 366.0),
    "hour": ("hour hours hr hh h stunde heure ora hora uur timme", 0.0, 23.0),
    "minute": ("minute minutes min mm m mi minuto minuut minutt", 0.0, 59.0),
    "second": ("second seconds sec ss s sekunde seconde secondo segundo sekund sek", 0.0, 60.0),
}
"""Field of a date or time in columns -> words for it, and its least and largest number."""
FINE = {"ns": 1.5e7, "us": 1.5e4}
"""Unit of a clock -> least step of whole numbers in it: 15 ms. In the next unit it is 15 s: no log is so slow."""
DATES = {unit: (epoch + 7305.0, epoch + 29220.0) for unit, epoch in EPOCHS.items()}
"""Unit of a clock in days -> its numbers of 1990 and 2050. Those of Excel from 2031 and
modified Julian dates to 2008 are the same numbers."""
RECENT, LATEST = (9.46e8, 2.53e9), 5e9  # s since 1970: from 2000 to 2050, and of no log
SHORT_DAY = 1e-3  # d, 86 s: rows of a log are closer; in seconds no log of a ship has a thousand rows in one
NO_CLOCK_WORDS = frozenset(["delay", "constant", "zone", "diff", "delta", "step"])


def are_whole(values: Array, most: float) -> bool:
    """Whether all numbers (N,) that are there are whole, and at most that large."""
    known = values[np.isfinite(values)]
    return bool(len(known) and np.all(known % 1 == 0.0) and np.all(np.abs(known) <= most))


def _date_fields(columns: dict[str, Array]) -> dict[str, str]:
    """Field of a date or time -> column of whole numbers that is called so: year, month, day, hour, minute, second."""
    found: dict[str, str] = {}
    for name, values in columns.items():
        word = (name_parts(name) or ("",))[-1]
        called = [one for one, (words, _, _) in FIELDS.items() if word in words.split() and one not in found]
        one = "minute" if "minute" in called and "hour" in found else next(iter(called), "")
        if one and one in ("minute", "second") and "hour" not in found:
            continue
        whole = np.floor(values) if one == "second" else values
        if one and are_whole(whole, FIELDS[one][2]) and np.nanmin(whole) >= FIELDS[one][1]:
            found[one] = name
    return found


def _day_columns(fields: dict[str, str]) -> list[str]:
    """Columns of year, month and day, or of year and day of the year; none where one is not there."""
    ways = (("year", "month", "day"), ("year", "day of the year"))
    return next(([fields[one] for one in way] for way in ways if {*way} <= fields.keys()), [])


def _in_columns(
    table: pd.DataFrame, columns: dict[str, Array], dates: str | None
) -> tuple[dict[str, Any], Array] | None:
    """The clock of a log with hour, minute and second in columns; `dates` is a column of dates."""
    fields = _date_fields(columns)
    times, days = [fields[one] for one in ("hour", "minute", "second") if one in fields], _day_columns(fields)
    if not {"hour", "minute"} <= fields.keys():
        return None
    texts = time_texts([columns[name] for name in times])
    day: str | list[str] | None = dates or days or None
    if day is not None:
        written = column_called(table, day) if isinstance(day, str) else date_texts([columns[name] for name in day])
        texts = join_date_and_time(written, texts)
    keys = {"from": times, "unit": "date"} | ({"date": day} if day is not None else {})
    return _rising_clock(keys, parse_dates(texts))


def _in_pair(columns: dict[str, Array]) -> tuple[dict[str, Any], Array] | None:
    """The clock of a log with whole seconds in one column and the rest of them in another, as ROS and C write it."""
    for name in columns:
        begin = re.fullmatch(r"(.*?)_?(?:secs?|seconds?)", name)
        for other, (unit, rest) in itertools.product(columns, RESTS.items()) if begin else ():
            letters = {"s + ns": r"n(?:ano)?", "s + us": r"(?:u|micro)"}[unit]
            if re.fullmatch(rf"{re.escape(begin[1] if begin else '')}_?{letters}secs?(?:onds?)?", other):
                whole, parts = columns[name], columns[other]
                t = whole + rest * parts
                if are_whole(whole, LAST_DATE) and parts.max() * rest < 1.0 and np.all(np.diff(t) > 0):
                    return {"from": [name, other], "unit": unit}, t
    return None


def _rising_clock(keys: dict[str, Any], t: Array) -> tuple[dict[str, Any], Array] | None:
    """The clock with these keys and times (N,) [s], at an even rate where it is rounded; None if it does not rise."""
    if not np.isfinite(t).all():
        return None
    if np.all(np.diff(t) > 0):
        return keys, t
    rate = _even_rate(t)
    return None if rate is None else (keys | {"every": rate[0]}, rate[1])


def clock_restarts(table: pd.DataFrame, columns: dict[str, Array]) -> tuple[dict[str, int], dict[str, Array] | None]:
    """The column that says the run with the number of runs, and the clock, where it begins again with each."""
    for name in filter(is_clock, columns):
        steps = np.diff(columns[name])
        if not np.isfinite(columns[name]).all() or not np.any(steps < 0) or _wrapping_clock_unit(columns[name]):
            continue
        for run in (str(run) for run in table.columns if str(run) and is_run(str(run))):
            texts = column_called(table, run).astype(str).str.strip().to_numpy(dtype=object)
            changed = texts[1:] != texts[:-1]
            if np.all(changed[steps < 0]) and np.mean(changed) < 0.1:
                length = float(np.ptp(columns[name])) + LONG * float(np.median(steps))
                return {run: 1 + int(changed.sum())}, {name: columns[name] + np.append(0, np.cumsum(changed)) * length}
    return {}, None


def clock_without_repeats(
    table: pd.DataFrame, columns: dict[str, Array], file: Path
) -> tuple[dict[str, Any], Array, Rows]:
    """The clock, its times, and which rows it takes: all but a few that repeat the row before."""
    again = rows_repeated(table)
    if 0 < again.sum() <= REPEATED * len(table):
        kept = {name: values[~again] for name, values in columns.items()}
        clock, t = _choose_clock(table.loc[~again].reset_index(drop=True), kept, file)
        return {**clock, "repeated": "drop"}, t, ~again
    try:
        return *_choose_clock(table, columns, file), np.ones(len(table), dtype=bool)
    except DataError:
        once = _unrepeated_rows(table, columns)
        if once is None:
            raise
        kept = {name: values[once] for name, values in columns.items()}
        clock, t = _choose_clock(table.loc[once].reset_index(drop=True), kept, file)
        if "every" in clock:  # a rounded clock has rows of one time that are not repeated
            raise
        return {**clock, "repeated": "drop"}, t, once


def _unrepeated_rows(table: pd.DataFrame, columns: dict[str, Array]) -> Rows | None:
    """The rows that do not say the time of the row before once more; None where no clock has a few of these."""
    for name in map(str, table.columns):
        if not is_clock(name):
            continue
        times = columns[name] if name in columns else parse_dates(column_called(table, name))
        steps = np.diff(times, prepend=-np.inf)
        if np.isfinite(times).all() and np.all(steps >= 0) and 0 < np.sum(steps == 0) <= REPEATED * len(table):
            return np.asarray(steps > 0)
    return None


def _choose_clock(table: pd.DataFrame, columns: dict[str, Array], file: Path) -> tuple[dict[str, Any], Array]:
    """The first clock that rises: of two columns, of texts, of fields, of numbers called so, of any other number."""
    if (pair := _in_pair(columns)) is not None:
        return pair
    rising = [name for name, values in columns.items() if len(values) and np.all(np.diff(values) > 0)]
    dates, tried = _date_column(table, columns), dict[str, Array]()
    texts = [name for name in map(str, table.columns) if name not in columns and name]
    for name in sorted(texts, key=lambda name: not is_clock(name)):
        column = column_called(table, name)
        of_day = column.dropna().astype(str).str.fullmatch(TIME_OF_DAY)
        if len(of_day) and of_day.all() and (clock := _with_date(table, columns, name)):
            return clock
        since = parse_dates(column) if is_clock(name) or _looks_dated(column) else np.full(len(table), np.nan)
        if clock := _rising_clock({"from": name, "unit": "date"}, since):
            return clock
        if is_clock(name) or np.isfinite(since).all():
            tried[name] = since
    if clock := _in_columns(table, columns, dates):
        return clock
    unnamed = list(columns)[:1] if not tried and all(name.isdecimal() for name in columns) else []
    called = [name for name in columns if is_clock(name)] or unnamed
    for name in sorted(called, key=lambda name: name not in rising):
        if np.isfinite(columns[name]).all() and (clock := _of_numbers(table, columns, name, file)):
            return clock
    tried |= {name: columns[name] for name in called}
    tried = {name: t for name, t in tried.items() if name != dates} or tried  # that repeats: the times are at fault
    faulty = [name for name, t in tried.items() if _nearly_rises(t) or (dates is not None and name in texts)]
    for name in sorted(rising, key=lambda name: bool(np.all(np.diff(columns[name]) == 1.0))) if not faulty else ():
        if clock := _of_numbers(table, columns, name, file):  # a counter rises, too
            return clock
    fault = "none rises from row to row"
    for name in [*faulty, *tried][:1]:
        t = tried[name]
        t = clock_seconds(t, _unit_of_clock(name, t)) if name in columns and np.isfinite(t).all() else t
        fault = f"{name!r} {_clock_fault(table, name, t)}"
    raise DataError(f"no column can be the clock: {fault}", file=file)


def _of_numbers(
    table: pd.DataFrame, columns: dict[str, Array], name: str, file: Path
) -> tuple[dict[str, Any], Array] | None:
    """The clock of a column of numbers, with dates beside it where it is a time of day; None if it does not rise."""
    unit, t = _read_clock(table, name, columns[name], file)
    within_day = unit == "hhmmss" or (columns[name].min() >= 0 and columns[name].max() < 1)
    if within_day and (with_date := _with_date(table, columns, name)):
        return with_date
    rate = _even_rate(t) if np.all(np.diff(t) > 0) and _is_coarse(t) else None
    keys = {"from": name, "unit": unit}
    return _rising_clock(keys, t) if rate is None else (keys | {"every": rate[0]}, rate[1])


def doubts_on(table: pd.DataFrame, clock: dict[str, Any], t: Array) -> Iterator[str]:
    """Yield questions on dates and times of day at t (N,) [s] that may mean another moment."""
    if clock["unit"] == "excel" and DATES["mjd"][0] < t[0] / DAY + EPOCHS["excel"]:
        excel, other = (format_date(t[0] + days * DAY)[:10] for days in (0.0, EPOCHS["excel"] - EPOCHS["mjd"]))
        yield f"{clock['from']!r} is read as a day of Excel, {excel}: or is it a modified Julian date (mjd), {other}?"
    if clock["unit"] not in ("date", "hhmmss") or {type(clock["from"]), type(clock.get("date", ""))} != {str}:
        return
    texts = column_called(table, clock["from"])
    texts = join_date_and_time(column_called(table, clock["date"]), texts) if "date" in clock else texts
    if pd.api.types.is_string_dtype(texts.dtype):
        texts = texts.astype(str).str.strip()
        ways = date_formats(texts)
        spans = {way: parse_dates_as(texts, way) for way in ways}
        least = min((since[-1] - since[0] for since in spans.values()), default=0.0)
        alike = [s for s in spans.values() if np.all(np.diff(s) >= 0) and s[-1] - s[0] == least]  # false where NaN
        firsts = sorted({format_date(since[0])[:10] for since in alike} - {format_date(t[0])[:10]})
        if firsts and len(alike) > 1:
            others = " or ".join(firsts)
            yield f"{texts.iloc[0]!r} is read as {format_date(t[0])[:10]}: or is it {others}? Then write 2024-05-14"


def other_clocks(table: pd.DataFrame, columns: dict[str, Array], clock: dict[str, Any], t: Array) -> Iterator[str]:
    """Yield a question for each further clock that goes otherwise than the times t (N,) [s] of the rows."""
    of_rows = {one for key in ("from", "date") if key in clock for one in source_columns(clock[key])}
    for name in map(str, table.columns):
        if name in of_rows or not is_clock(name):
            continue
        other = columns[name] if name in columns else parse_dates(column_called(table, name))
        known = np.isfinite(other)
        values, times = other[known], t[known]
        if len(values) < FEWEST_TIMES or not np.all(np.diff(values) > 0):
            continue
        since = clock_seconds(values, _unit_of_clock(name, values)) if name in columns else values
        off = float(np.ptp(since - times))
        if off > max(APART * float(np.median(np.diff(t))), OFF * float(times[-1] - times[0])):
            how = f"{name!r} is a clock, too, and goes otherwise than that of the rows: they part by {off:.3g} s"
            yield f"{how}. Are the columns beside it of its times? Then write them to another file ([file.<name>])"


def column_called(table: pd.DataFrame, name: str) -> pd.Series[Any]:
    """The first column of this name."""
    return table.iloc[:, list(map(str, table.columns)).index(name)]


def _date_column(table: pd.DataFrame, columns: dict[str, Array]) -> str | None:
    for name in sorted(filter(None, map(str, table.columns)), key=lambda name: name in columns):
        if name in columns and not (is_clock(name) and len(np.unique(columns[name])) <= max(1, len(table) // ROWS)):
            continue
        days = days_with_marks(column_called(table, name))
        form = rf"{DAY_OF}|{DAY_OF_EXCEL}" if name in columns else DAY_OF
        if days.str.fullmatch(form).fillna(False).all():
            return name
    return None


def _with_date(table: pd.DataFrame, columns: dict[str, Array], name: str) -> tuple[dict[str, Any], Array] | None:
    """The clock of a column of times of day beside dates; None where there are none, or it does not rise."""
    day = _date_column(table, columns) or _day_columns(_date_fields(columns))
    if not day:
        return None
    of_date = column_called(table, day) if isinstance(day, str) else date_texts([columns[one] for one in day])
    t = parse_dates(join_date_and_time(of_date, column_called(table, name)))
    return _rising_clock({"from": name, "unit": "date", "date": day}, t)


def is_clock(name: str) -> bool:
    """Whether a column has the name of a clock."""
    parts = set(name_parts(name)) | {name_without_unit(name)}
    return bool(parts & CLOCK_WORDS) and not parts & NO_CLOCK_WORDS


def _looks_dated(column: pd.Series[Any]) -> bool:
    texts = column.dropna().astype(str).head(20)
    dated = texts.str.fullmatch(rf"{TIME_OF_DAY}|\d{{4}}-\d\d-\d\d[T ].*|(?:{DAY_OF}),? .*")
    return bool(len(texts) and dated.all())


def _read_clock(table: pd.DataFrame, name: str, values: Array, file: Path) -> tuple[str, Array]:
    """The unit of a clock of numbers, and its times [s]."""
    if in_one_number(values):
        return "date", parse_dates(column_called(table, name))
    if values.min() > 1e9 and _is_time_of_day(values % 1e6):
        message = f"{name!r} is a date and a time of day in one number, {values[0]:.15g}: write 2024-05-14 08:00:00"
        raise DataError(f"no column can be the clock: {message}", file=file)
    unit = _unit_of_clock(name, values)
    t = clock_seconds(values, unit)
    step = float(np.ptp(t)) / max(1, len(t) - 1)
    if 0.0 < step < SHORTEST or t[0] > LATEST:
        message = f"{name!r}, read in {unit}, begins at {t[0]:.12g} s, with rows {step:.3g} s apart"
        raise DataError(f"no column can be the clock: {message}: write dates, or seconds since 1970", file=file)
    return unit, t


def _unit_of_clock(name: str, values: Array) -> str:
    """The unit of a clock: as its name says; else dates, times of day, or ms, us or ns if it counts so."""
    again = _wrapping_clock_unit(values)
    if again is not None and not _is_time_of_day(values):
        return again
    inside = [text.strip().lower().replace("µ", "u").replace("μ", "u") for text in units_in_name(name)]
    parts = name_parts(name)
    last = [] if "of" in parts else parts[-1:]  # seconds of the day
    written, ends = (next((one for one in WRITTEN if {*WRITTEN[one].split()} & {*said}), "") for said in (inside, last))
    steps = np.diff(values)
    rising = steps[steps > 0]  # a rounded clock often stands
    short = len(rising) > 0 and float(np.median(rising)) < SHORT_DAY
    calendar = "mjd" if {"mjd", "modified"} & {*parts} else ""  # of those in days the first that may be
    units = sorted(EPOCHS, key=lambda unit: unit != calendar)
    dates = next((unit for unit in units if DATES[unit][0] < values[0] < DATES[unit][1]), "")
    if dates and (written == "d" if written else short and ends in ("", "d")):
        return dates
    if written or ends not in ("", "s"):
        return written or ends
    if {"day", "year"} <= set(parts) or {"doy", "yday", "jday"} & set(parts):
        return "d"  # the day of the year
    if _is_time_of_day(values):
        return "hhmmss"
    since = [unit for unit in ("s", "ms", "us", "ns") if RECENT[0] < values[0] * to_si(unit, "t") < RECENT[1]]
    if since and (since != ["s"] or ends):  # however far apart; seconds without the name may be milliseconds of weeks
        return since[0]
    if len(steps) and np.median(steps) >= 20 and not (since and np.any(values % 1)):
        return next((unit for unit, least in FINE.items() if np.median(steps) >= least), "ms")
    return "s"


def _wrapping_clock_unit(values: Array) -> str | None:
    """The unit of a clock that begins again after a day or a week; None where none does."""
    steps = np.diff(values)
    back = steps[steps < 0]
    for unit, seconds_of in AGAIN.items():
        period, next_day = seconds_of / to_si(unit, "t"), NEXT_DAY / to_si(unit, "t")
        if len(back) and values.min() >= 0 and values.max() < period and np.all(back + period < next_day):
            return unit
    return None


def _is_time_of_day(values: Array) -> bool:
    """Whether numbers (N,) are hours, minutes and seconds: only so do they go on evenly where a minute is full."""
    since, steps = since_midnight(values), np.diff(values)
    full = np.flatnonzero(steps - np.diff(since) > 1.0)
    if not np.isfinite(since).all() or not len(full):
        return False
    usual = float(np.median(np.diff(since)))
    return bool(np.median(np.diff(since)[full]) <= 1.5 * usual and np.median(steps[full]) > 1.2 * np.median(steps))


def _is_coarse(t: Array) -> bool:
    steps = np.diff(t)
    usual = float(np.median(steps))
    spread = float(np.percentile(np.abs(steps - usual), 90))
    if spread < 0.05 * usual or len(t) < 20:
        return False
    return len(np.unique(np.round(steps / usual, 6))) <= max(4, len(steps) // 50)


def _even_rate(t: Array) -> tuple[float, Array] | None:
    """The step [s] of even rows and their instants (N,) that explain a rounded clock; None if none does."""
    if len(t) < 20 or np.any(np.diff(t) < 0) or len(np.unique(t)) < 10:
        return None
    _values, first = np.unique(t, return_index=True)
    early = float(np.median(np.diff(t[: max(3, int(first[min(len(first) - 1, 40)]))])))
    rounding = clock_rounding(t)
    steps = np.diff(t)
    going = steps <= PAUSE * max(float(np.median(steps)), float(np.median(rounding)))  # on, without a pause
    mean = float(steps[going].mean())
    slack = float(rounding[-1]) * (1 + np.sum(~going)) / going.sum()
    stretches = [  # whatever rows were lost, most short stretches are whole
        _roundest_number(float(np.median(t[far:] - t[:-far])) / far, float(rounding[-1]) / far)
        for far in (min(len(t) - 1, most) for most in (200, 60))
    ]
    for step in (_roundest_number(mean, slack), *stretches, early, mean):
        if not step > 0:
            continue
        even, _ = even_clock(t, step)
        ahead = np.diff(even) / step
        lost = float((ahead[ahead < 4 + 2 * rounding[1:] / step] - 1).sum())
        if lost > LOST * len(t) and step is not mean:
            continue
        if np.all(np.abs(even - t) <= 0.6 * rounding + 0.5 * step) and np.all(np.diff(even) > 0):
            return float(f"{step:.9g}"), even
    return None


def _roundest_number(value: float, slack: float) -> float:
    """The number with the fewest digits within `slack` of a value, or one over such a number."""
    for digits in range(1, 7):
        near = float(f"{value:.{digits}g}")
        if abs(near - value) <= slack:
            return near
        inverse = float(f"{1 / value:.{digits}g}") if value > 0 else 0.0
        if inverse and abs(1 / inverse - value) <= slack:
            return 1.0 / inverse
    return value


def _nearly_rises(values: Array) -> bool:
    """Whether a column (N,) rises but for a few rows that are lost or go back, as a clock with a fault does."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(len(steps) > FEWEST * len(values) and np.mean(steps > 0) > NEARLY)


def _clock_fault(table: pd.DataFrame, name: str, values: Array) -> str:
    """What is wrong with a clock (N,): its first text that is no time, or where it goes back or repeats."""
    wrong = ~np.isfinite(values)
    if wrong.any():
        texts = column_called(table, name).astype(str).fillna("").str.strip()
        of_day = texts.str.fullmatch(TIME_OF_DAY).to_numpy(dtype=bool)
        wrong = ~of_day if wrong.all() and of_day.mean() > 0.5 else wrong  # a single other text, and none is read
        row = int(np.argmax(wrong))
        count = f" or in {wrong.sum() - 1} rows like it" * bool(wrong.sum() > 1)
        remedy = "remove them, or write all times in one way, as 2024-05-14 08:00:00"
        return f"holds {texts.iloc[row][:40]!r} in row {row + 1}, no number or time that can be read{count}: {remedy}"
    row = int(np.argmax(np.diff(values) < 0)) + 1
    if values[row] < values[row - 1]:  # rows of one time alone may be a rounded clock
        before, after = format_moment(values[row - 1]), format_moment(values[row])
        back = f"goes back from {before} to {after}{rollover_words(values[row] - values[row - 1])} in row {row + 1}"
        return f"{back}: sort the log, or split it there, and join the parts; if it is local time, write UTC"
    return f"repeats in row {int(np.argmax(np.diff(values) == 0)) + 2}"


def name_without_unit(name: str) -> str:
    """A name in lower case without its unit in brackets."""
    return re.sub(r"[\[(].*", "", name).strip().lower().replace(" ", "_").replace("-", "_")
