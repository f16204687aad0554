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
    DAY_OF,
    DAY_OF_EXCEL,
    LAST_DATE,
    NEXT_DAY,
    TIME_OF_DAY,
    are_in_one_number,
    days_with_marks,
    parse_dates,
)
from shipid.logs.formats import Format
from shipid.logs.guess.evidence import usual_step
from shipid.logs.guess.words import is_run, name_parts, units_in_name
from shipid.logs.instants import check_times, clock_rounding, even_clock, read_time_column, rows_repeated
from shipid.logs.mapping import AGAIN, EPOCHS, RESTS, Clock, clock_seconds, since_midnight, source_columns, to_si

Rows = NDArray[np.bool_]
LONG = 1e4  # rows between two runs that have a clock each
DATES_SHOWN = 20  # rows of a column by which it is taken for dates
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
        "gmt datenum czas zaman aika aikaleima vrijeme tow itow sow sod ticks filetime mjd jd julian"
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


def clock_restarts(table: pd.DataFrame, columns: dict[str, Array]) -> tuple[dict[str, int], dict[str, Array]]:
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
    return {}, {}


def clock_without_repeats(
    table: pd.DataFrame, columns: dict[str, Array], form: Format, file: Path
) -> tuple[dict[str, Any], Array, Rows]:
    """The clock, its times, and which rows it takes: all but a few that repeat the row before."""
    again = rows_repeated(table)
    few = 0 < again.sum() <= REPEATED * len(table)
    once: Rows = ~again if few else np.ones(len(table), dtype=bool)
    try:
        clock, t = _choose_clock(table, columns, once, form, file)
    except DataError:
        once = _unrepeated_rows(table, columns)
        if few or once.all():
            raise
        clock, t = _choose_clock(table, columns, once, form, file)
        if "every" in clock:  # a rounded clock has rows of one time that are not repeated
            raise
    return clock | ({} if once.all() else {"repeated": "drop"}), t, once


def _unrepeated_rows(table: pd.DataFrame, columns: dict[str, Array]) -> Rows:
    """The rows that do not say the time of the row before once more; all where no clock has a few of these."""
    for name in filter(is_clock, map(str, table.columns)):
        steps = np.diff(_as_numbers(table, columns, name), prepend=-np.inf)
        if np.isfinite(steps[1:]).all() and np.all(steps >= 0) and 0 < np.sum(steps == 0) <= REPEATED * len(table):
            return np.asarray(steps > 0)
    return np.ones(len(table), dtype=bool)


def _as_numbers(table: pd.DataFrame, columns: dict[str, Array], name: str) -> Array:
    """A column (N,) as its numbers, or else as dates [s]; NaN for what is neither."""
    return columns[name] if name in columns else parse_dates(column_called(table, name))


def _choose_clock(
    table: pd.DataFrame, columns: dict[str, Array], once: Rows, form: Format, file: Path
) -> tuple[dict[str, Any], Array]:
    """The first clock that can be imported, with its times; DataError says what is wrong with the surest."""
    table, columns = table.loc[once], {name: values[once] for name, values in columns.items()}
    faults: list[tuple[bool, str]] = []
    for keys in itertools.chain(_clocks_by_name(table, columns), _further_clocks(columns, faults)):
        try:
            return _read_clock(table, columns, keys, form, file)
        except DataError as error:
            name, place = keys["from"], f" in {error.path}" * ("row" in str(error.path))
            sure = "date" in keys or not isinstance(name, str) or _nearly_rises(_as_numbers(table, columns, name))
            sure = sure or bool(name in columns and np.isnan(columns[name]).all())  # nor is a counter the clock then
            faults.append((sure, f"{name!r}{place}: {error.message}"))
    fault = max(faults, key=lambda one: one[0], default=(False, "none rises from row to row"))[1]
    raise DataError(f"no column can be the clock: {fault}", file=file)


def _clocks_by_name(table: pd.DataFrame, columns: dict[str, Array]) -> Iterator[dict[str, Any]]:
    """Yield keys of clocks, the surest first: of two columns, of texts, of fields, of numbers that are called so."""
    begins = [(name, re.fullmatch(r"(.*?)_?(?:secs?|seconds?)", name)) for name in columns]
    for (name, begin), other in itertools.product([one for one in begins if one[1]], columns):  # as ROS and C write it
        rest = re.fullmatch(rf"{re.escape(begin[1] if begin else '')}_?(n|nano|u|micro)secs?(?:onds?)?", other)
        unit = "s + ns" if rest and rest[1][0] == "n" else "s + us"
        if rest and are_whole(columns[name], LAST_DATE) and columns[other].max() * RESTS[unit] < 1.0:
            yield {"from": [name, other], "unit": unit}
    fields, dates = _date_fields(columns), _date_column(table, columns)
    ways = (("year", "month", "day"), ("year", "day of the year"))
    days = dates or next(([fields[one] for one in way] for way in ways if {*way} <= fields.keys()), None)
    beside = {"unit": "date"} | ({"date": days} if days else {})
    texts = [name for name in map(str, table.columns) if name not in columns and name]
    for name in sorted(texts, key=lambda name: (name == dates, not is_clock(name))):  # a date repeats
        column = column_called(table, name).dropna()
        if days and len(column) and column.astype(str).str.fullmatch(TIME_OF_DAY).all():
            yield {"from": name} | beside
        if is_clock(name) or (len(column) and np.isfinite(parse_dates(column.head(DATES_SHOWN))).all()):
            yield {"from": name, "unit": "date"}
    if {"hour", "minute"} <= fields.keys():
        yield {"from": [fields[one] for one in ("hour", "minute", "second") if one in fields]} | beside
    for name in sorted(filter(is_clock, columns), key=lambda name: not np.all(np.diff(columns[name]) > 0)):
        keys = _number_clock(columns, name)
        if days and (keys["unit"] == "hhmmss" or (columns[name].min() >= 0 and columns[name].max() < 1)):
            yield {"from": name} | beside
        yield keys


def _further_clocks(columns: dict[str, Array], faults: list[tuple[bool, str]]) -> Iterator[dict[str, Any]]:
    """Yield keys of clocks of numbers that are not called so, where no other is at fault; counters rise, too."""
    rising = [name for name, values in columns.items() if np.all(np.diff(values) > 0)]
    unnamed = [*columns][:1] if all(name.isdecimal() for name in columns) else []
    for name in [*unnamed, *sorted(rising, key=lambda name: bool(np.all(np.diff(columns[name]) == 1.0)))]:
        if not any(sure for sure, _ in faults):
            yield _number_clock(columns, name)


def _number_clock(columns: dict[str, Array], name: str) -> dict[str, Any]:
    return {"from": name, "unit": _unit_of_clock(name, columns[name][np.isfinite(columns[name])])}


def _read_clock(
    table: pd.DataFrame, columns: dict[str, Array], keys: dict[str, Any], form: Format, file: Path
) -> tuple[dict[str, Any], Array]:
    """A clock and its times (N,) [s] as the import reads them, at an even rate where they are rounded."""
    clock = Clock.model_validate(keys)
    t = read_time_column(table, clock, form, file, "clock")
    counted = columns.get(str(clock.source)) if clock.unit != "date" else None
    if counted is not None and counted.min() > 1e9 and _is_time_of_day(counted % 1e6):
        raise DataError(f"it is a date and a time of day in one number, {counted[0]:.15g}: write 2024-05-14 08:00:00")
    if t[0] > LATEST:
        raise DataError(f"it begins at {t[0]:.12g} s, read in {clock.unit}: write dates, or seconds since 1970")
    rounded = not np.all(np.diff(t) > 0) or (counted is not None and _is_coarse(t))
    if rounded and (rate := _even_rate(t)) is not None:
        return keys | {"every": rate[0]}, rate[1]
    return keys, check_times(table, t, clock, file, "clock")


def other_clocks(table: pd.DataFrame, columns: dict[str, Array], clock: dict[str, Any], t: Array) -> Iterator[str]:
    """Yield a question for each further clock that goes otherwise than the times t (N,) [s] of the rows."""
    of_rows = {one for key in ("from", "date") if key in clock for one in source_columns(clock[key])}
    for name in filter(is_clock, map(str, table.columns)):
        if name in of_rows:
            continue
        other = _as_numbers(table, columns, name)
        known = np.isfinite(other)
        since, times = other[known], t[known]
        if len(since) < FEWEST_TIMES or not np.all(np.diff(since) > 0):
            continue
        since = clock_seconds(since, _unit_of_clock(name, since)) if name in columns else since
        off = float(np.ptp(since - times))
        if off > max(APART * usual_step(t), OFF * float(times[-1] - times[0])):
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


def is_clock(name: str) -> bool:
    """Whether a column has the name of a clock."""
    parts = {*name_parts(name)}
    return bool(parts & CLOCK_WORDS) and not parts & NO_CLOCK_WORDS


def _unit_of_clock(name: str, values: Array) -> str:
    """The unit of a clock: as its name says; else dates, times of day, or ms, us or ns if it counts so."""
    if not len(values):
        return "s"  # what reads it says that it is empty
    if are_in_one_number(values):
        return "date"
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
    if len(steps) and usual_step(values) >= 20 and not (since and np.any(values % 1)):
        return next((unit for unit, least in FINE.items() if usual_step(values) >= least), "ms")
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
    if len(t) < 20 or not np.all(np.diff(t) >= 0) or len(np.unique(t)) < 10:
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
