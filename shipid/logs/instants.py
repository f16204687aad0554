"""The clock of a log: its column of time in seconds, checked, and instants in place of rounded ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import Array
from shipid.errors import DataError
from shipid.logs.cells import log_column, parse_numbers, row_in_words
from shipid.logs.dates import (
    date_texts,
    format_moment,
    join_date_and_time,
    parse_dates,
    time_texts,
)
from shipid.logs.formats import Format
from shipid.logs.mapping import RESTS, Clock, FileClock, Named, clock_seconds, source_columns
from shipid.logs.repairs import Records

SHORTEST = 1e-4  # s between rows, on average: no recorder of a ship has more than 10 kHz


def read_clock(log: pd.DataFrame, clock: Clock | FileClock, form: Format, file: Path, path: str) -> NDArray[np.float64]:
    """The time of every row [s]; raises DataError where it is missing or does not rise."""
    return check_times(log, read_time_column(log, clock, form, file, path), clock, file, path)


def check_times(log: pd.DataFrame, t: Array, clock: Clock | FileClock, file: Path, path: str) -> Array:
    """The times (N,) [s] of a log, even ones where they are rounded; raises DataError where one is missing or late."""
    every, steps = clock.every if isinstance(clock, Clock) else None, np.diff(t, prepend=-np.inf)
    faults = (~np.isfinite(t), steps < 0, (steps == 0) & (every is None))
    wrong = next((rows for rows in faults if rows.any()), None)
    if wrong is not None:
        row = int(np.argmax(wrong))
        if not np.isfinite(t[row]):
            what = _bad_time(log, clock, row, file, path)
        elif t[row] == t[row - 1]:
            what = f"the time {format_moment(t[row])} appears twice: "
            what += "remove one of the rows, or set [clock] repeated = 'drop'"
        else:
            back = f"from {format_moment(t[row - 1])} to {format_moment(t[row])}"
            what = f"time goes back {back}: sort or split the log; if it is local time, write UTC"
        raise DataError(what, file=file, path=row_in_words(log, row))
    if every is not None:
        return even_instants(t, every, log, file)
    if len(t) > 1 and (t[-1] - t[0]) / (len(t) - 1) < SHORTEST:
        what = f"rows are {(t[-1] - t[0]) / (len(t) - 1):.3g} s apart, as of no ship: is the unit of the clock right?"
        raise DataError(what, file=file, path=f"{path}.unit")
    return t


def read_time_column(
    log: pd.DataFrame, clock: Clock | FileClock, form: Format, file: Path, path: str
) -> NDArray[np.float64]:
    """The column of time [s] as it is written, not a number where it is missing."""
    if clock.unit == "date":
        times = _as_text(log, clock.source, time_texts, form, file, f"{path}.from")
        if clock.date is None:
            return parse_dates(times)
        return parse_dates(join_date_and_time(_as_text(log, clock.date, date_texts, form, file, f"{path}.date"), times))
    whole, *rest = (parse_numbers(log, name, form, file, f"{path}.from") for name in source_columns(clock.source))
    return clock_seconds(whole, clock.unit) + (RESTS[clock.unit] * rest[0] if rest else 0.0)


def _as_text(
    log: pd.DataFrame,
    source: Named,
    write: Callable[[list[Array]], pd.Series[Any]],
    form: Format,
    file: Path,
    path: str,
) -> pd.Series[Any]:
    """The column of dates or times, or those of its parts as one."""
    if isinstance(source, str):
        return log_column(log, source, file, path)
    return write([parse_numbers(log, name, form, file, path) for name in source]).set_axis(log.index)


def _bad_time(log: pd.DataFrame, clock: Clock | FileClock, row: int, file: Path, path: str) -> str:
    """Say what is wrong with the time of a row: nothing is there, or a text that is no date."""
    times, days = source_columns(clock.source), source_columns(clock.date) if clock.date is not None else ()
    places = [*((name, f"{path}.date") for name in days), *((name, f"{path}.from") for name in times)]
    cells = [log_column(log, name, file, place).iloc[row] for name, place in places]
    if any(pd.isna(cell) or not str(cell).strip() for cell in cells):
        return "no time here: remove the row"
    text = " ".join(str(cell).strip() for cell in cells)
    if clock.unit != "date":
        return f"{text} is no time of day, hours, minutes and seconds as in 123005.5: correct it, or write another unit"
    if np.isfinite(parse_dates(pd.Series([text]))[0]):
        return f"{text!r} has no time zone, while other rows have one: write it in every row, or in none"
    return (
        f"{text!r} is no date or time of day that can be read: write dates as 2024-05-14 08:00:00; "
        'for a number of seconds write [clock] unit = "s"'
    )


def without_repeats(log: pd.DataFrame, clock: Clock, form: Format, file: Path) -> tuple[pd.DataFrame, Records]:
    """The log without rows that repeat the time of the row before (with `every`: the whole row), and their number."""
    if clock.every is None:
        again = np.diff(read_time_column(log, clock, form, file, "clock"), prepend=-np.inf) == 0
    else:
        again = rows_repeated(log)
    note = "rows that repeat the row before" if clock.every is not None else "rows with the time of the row before"
    records: Records = [{"kind": "repeated", "column": "", "count": int(again.sum()), "note": note}]
    return (log.loc[~again], records) if again.any() else (log, [])


def rows_repeated(table: pd.DataFrame) -> NDArray[np.bool_]:
    """Whether each row (N,) has the values of the row before in all columns."""
    before = table.shift()
    same = (table.eq(before) | (table.isna() & before.isna())).fillna(False).all(axis=1).to_numpy(dtype=bool, copy=True)
    same[:1] = False
    return same


def even_instants(t: NDArray[np.float64], every: float, log: pd.DataFrame, file: Path) -> NDArray[np.float64]:
    """Instants `every` [s] apart in place of a rounded column of time t (N,) [s]; lost rows leave out steps.

    Raises DataError where the column leaves the instants by more than it is rounded.
    """
    even, _ = even_clock(t, every)
    rounding = clock_rounding(t)
    off = np.abs(even - t)
    wrong = (off > rounding + every) | (np.diff(even, prepend=-np.inf) <= 0)
    if np.any(wrong):
        row = int(np.argmax(wrong))
        raise DataError(
            f"the time is {off[row]:.3g} s from rows every {every:g} s: the clock has another rate",
            file=file,
            path=f"{row_in_words(log, row)}, clock.every",
        )
    return even


def even_clock(t: NDArray[np.float64], every: float) -> tuple[NDArray[np.float64], int]:
    """Instants `every` [s] apart that follow a rounded column of time, and the number of pauses in it."""
    rounding = clock_rounding(t)
    pauses = np.flatnonzero(np.diff(t) > 2.0 * rounding[1:] + 3.0 * every) + 1
    even = np.empty(len(t))
    for first, last in zip([0, *pauses], [*pauses, len(t)], strict=True):
        part = slice(first, last)
        count = every * np.arange(last - first)
        even[part] = count + np.median(t[part] - count)
        if np.any(np.abs(even[part] - t[part]) > 0.6 * rounding[part] + 0.5 * every):  # rows were lost
            even[part] = _with_losses(t[part], every, rounding[part])
    return even, len(pauses)


def _with_losses(t: NDArray[np.float64], every: float, rounding: NDArray[np.float64]) -> NDArray[np.float64]:
    """Instants a whole number of steps apart, as few as the rounded times t (N,) allow.

    A row at offset + every n fits while one offset in [low, high] lies within half a rounding of all rows so far; where
    none does, n leaves out as many steps as it must, or the offset starts anew, for a rate that is slightly off.
    """
    half = 0.5 * rounding + 1e-9 * (t - t[0]) + 4.0 * np.spacing(np.abs(t).max())  # digits of `every`, and of t
    steps, low, high = np.zeros(len(t)), t[0] - half[0], t[0] + half[0]
    offset, number, begin = np.empty(len(t)), 0.0, 0
    for row in range(1, len(t)):
        number += 1.0
        least, most = t[row] - half[row] - every * number, t[row] + half[row] - every * number
        if least > high:
            lost = np.ceil((least - high) / every - 1e-9)
            number, least, most = number + lost, least - every * lost, most - every * lost
        if most < low:
            offset[begin:row] = (low + high) / 2
            begin, low, high = row, least, most
        low, high = max(low, least), min(high, most)
        steps[row] = number
    offset[begin:] = (low + high) / 2
    return np.asarray(offset + every * steps)


def clock_rounding(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far a rounded time may be from the truth in each row [s]: its largest step to the next other value so far."""
    values = np.unique(t)
    if len(values) < 3:
        return np.full(len(t), np.inf)
    steps = np.diff(values)
    near = np.append(steps, steps[-1])
    usual = pd.Series(near).rolling(9, center=True, min_periods=1).median().to_numpy()
    return np.asarray(np.maximum.accumulate(usual)[np.searchsorted(values, t)])
