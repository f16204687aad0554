"""Channels of a log on common instants, and the gaps in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import BREAK, clock_slack
from shipid.errors import DataError
from shipid.logs.cells import row_in_words
from shipid.logs.dates import format_moment
from shipid.logs.frames import TURN, is_turn
from shipid.logs.mapping import Column
from shipid.logs.repairs import FLAGS, Records, interpolate_missing
from shipid.physics.signals import is_command

Channel = tuple[NDArray[np.float64], NDArray[np.float64]]  # instants [s] and values, (N,) each
MANY, FAR_MORE = 10_000_000, 100  # instants, and those for each row: beyond both the clock or the step is wrong


def common_instants(
    channels: dict[str, Channel], held: set[str], t: NDArray[np.float64], step: float | None, file: Path
) -> NDArray[np.float64]:
    """The instants [s] that every channel covers: `step` [s] apart, or the instants of the log."""
    spans = {name: times[np.isfinite(values)] for name, (times, values) in channels.items()}
    empty = [name for name, times in spans.items() if not len(times)]
    if empty:
        raise DataError(
            "has no number in any row: name another column, or check decimal and separator",
            file=file,
            path=f"columns.{empty[0]}.from",
        )
    spans |= {name: np.append(spans[name], channels[name][0][-1]) for name in held}
    first, last = max(times[0] for times in spans.values()), min(times[-1] for times in spans.values())
    slack = clock_slack(t)
    if step is not None:
        t = _instants_at_step(first, last + slack, step, [*spans.values()], file)
    shared: NDArray[np.float64] = t[(t >= first - slack) & (t <= last + slack)]
    if len(shared) < 2:
        late, early = (pick(spans, key=lambda name: spans[name][end]) for pick, end in ((max, 0), (min, -1)))
        begin, end = format_moment(first), format_moment(last)
        raise DataError(
            f"columns share no time: {late!r} begins at {begin}, {early!r} ends at {end}",
            file=file,
            path=f"columns.{late}",
        )
    return shared


def _instants_at_step(
    first: float, last: float, step: float, times: list[NDArray[np.float64]], file: Path
) -> NDArray[np.float64]:
    """The instants `step` [s] apart from first to last; none where it is before first.

    times : of the samples (N,) [s] of every channel. Raises DataError for far more instants than these: a wrong date.
    """
    count = max(0, int(np.floor((last - first) / step)) + 1)
    if count > MANY and count > FAR_MORE * len(samples := np.unique(np.concatenate(times))):
        row = int(np.argmax(np.diff(samples)))
        before, after = (format_moment(samples[row + one]) for one in (0, 1))
        message = f"{step:g} s makes {count:.3g} instants of {len(samples)} rows, where after {before} comes {after}"
        remedy = (
            "was the clock set there? Remove the rows of the wrong time, or split the log; else write a longer step"
        )
        raise DataError(f"{message}: {remedy}", file=file, path="clock.step")
    return np.asarray(first + step * np.arange(count), dtype=np.float64)


def interpolation_rule(name: str, column: Column) -> str:
    """The rule of interpolation: as declared, else `previous` for orders, `angle` where it wraps, `linear`."""
    usual = "short way" if name == "longitude" else "linear"
    return column.interpolation or ("previous" if is_command(name) else "angle" if column.wrap else usual)


def resample_channel(
    t: NDArray[np.float64], times: NDArray[np.float64], values: NDArray[np.float64], how: str, max_gap: float
) -> NDArray[np.float64]:
    """Interpolate a channel at instants t [s]; NaN between samples more than max_gap [s] apart, unless it is held."""
    known = np.isfinite(values)
    times, values = times[known], values[known]
    if how == "previous":
        held = np.searchsorted(times, t + clock_slack(times), side="right") - 1
        return values[np.clip(held, 0, len(values) - 1)]
    if len(times) == 1:
        return np.full(len(t), values[0])
    result = np.interp(t, times, np.unwrap(values) if how == "angle" else values)
    index = np.clip(np.searchsorted(times, t, side="right"), 1, len(times) - 1)
    if how == "short way":  # from 180 to -180 deg, or from 360 to 0: nothing else is changed, a wrong value stays one
        step = values[index] - values[index - 1]
        share = (t - times[index - 1]) / (times[index] - times[index - 1])
        around = values[index - 1] + share * (step - np.sign(step) * TURN)
        result = np.where(is_turn(step), np.remainder(around + np.pi, TURN) - np.pi, result)
    on_sample = (t == times[index]) | (t == times[index - 1])
    return np.where((times[index] - times[index - 1] > max_gap + clock_slack(times)) & ~on_sample, np.nan, result)


def close_gaps(rows: pd.DataFrame, max_gap: float | None, file: Path) -> tuple[pd.DataFrame, Records]:
    """Fill gaps of at most `max_gap` [s] between known values, remove the other rows, and break the run there."""
    t, flags = rows["t"].to_numpy(), rows["flags"].to_numpy().copy()
    longest = np.inf if max_gap is None else max_gap + clock_slack(t)  # 0.3 s is three steps of 0.1 s, rounded or not
    removed, records, filled = np.zeros(len(t), dtype=bool), [], {}
    for name in rows.columns.drop(["t", "flags"]):
        values = rows[name].to_numpy()
        missing = ~np.isfinite(values)
        if not missing.any():
            continue
        if max_gap is None:
            raise DataError(
                f"no number in {int(missing.sum())} rows of {name!r}: set max_gap to interpolate short gaps",
                file=file,
                path=f"{row_in_words(rows, int(np.argmax(missing)))}, clock.max_gap",
            )
        before = np.maximum.accumulate(np.where(missing, -np.inf, t))
        after = np.minimum.accumulate(np.where(missing, np.inf, t)[::-1])[::-1]
        short = missing & (after - before <= longest)
        held = pd.Series(values).ffill().to_numpy() if is_command(name) else interpolate_missing(t, values, missing)
        filled[name] = np.where(short, held, values)
        flags |= np.where(short, 1 << FLAGS.index("interpolated"), 0)
        removed |= missing & ~short
        note = f"{int((missing & ~short).sum())} rows removed"
        records.append({"kind": "interpolated", "column": name, "count": int(short.sum()), "note": note})
    kept = t[~removed] if removed.any() else t
    if len(kept) < 2:
        long = {
            name: int((values.isna() & removed).sum()) for name, values in rows.drop(columns=["t", "flags"]).items()
        }
        worst = str(max(long, key=long.__getitem__))
        message = f"every row has a gap longer than max_gap, {long[worst]} rows of {worst!r} for one"
        message += ": orders written only where they change are held with [clock] step" * is_command(worst)
        raise DataError(message, file=file, path="clock.max_gap")
    if longest < np.median(np.diff(t)):
        raise DataError(
            f"{max_gap:g} s is shorter than the step of the log, {np.median(np.diff(t)):g} s",
            file=file,
            path="clock.max_gap",
        )
    broken = np.append(False, np.diff(kept) > longest)
    if broken.any():
        note = f"gaps longer than {max_gap:g} s"
        records.append({"kind": BREAK, "column": "", "count": int(broken.sum()), "note": note})
        flags[np.flatnonzero(~removed)[broken]] |= 1 << FLAGS.index(BREAK)
    rows = rows.assign(**filled, flags=flags)
    return (rows.loc[~removed].reset_index(drop=True) if removed.any() else rows), records
