"""Repairs of a recorded log: each declared with a reason, counted, flagged row by row, and possible to switch off.

A repair is a document and a function `(rows, repair) -> Outcome` of the whole log in SI units, with `t` and `flags`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from shipid.data.dataset import BREAK
from shipid.data.windows import from_frame, to_frame
from shipid.errors import DataError, placed_errors

INPUTS = {"latitude": "rad", "longitude": "rad", "speed": "m/s", "course": "rad"}
"""Columns of a mapping that become others: position on the Earth north and east, speed and course over ground u, v."""
Mask = NDArray[np.bool_]
Records = list[dict[str, Any]]  # kind, column, count and note of what was done to a log
Interval = Annotated[tuple[float, ...], Field(min_length=2, max_length=2)]
FEWEST_AT_END = 3  # rows in half a window, from which spikes at the end of a stretch are looked for


class StrictPart(BaseModel):
    """Base of every part of a mapping: unknown keys are refused, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Repair(StrictPart):
    """Fields of every repair: its kind, the reason for it, and whether it is enabled."""

    kind: str
    reason: str = Field(min_length=1)
    enabled: bool = True


class ColumnRepair(Repair):
    """A repair of columns that it names; the others act on columns that their formula names."""

    columns: Annotated[tuple[str, ...], Field(min_length=1)]

    @property
    def of_inputs(self) -> bool:
        """Whether it mends columns that become others, and so comes before them."""
        return bool(set(self.columns) & set(INPUTS))


class WrapInterpolation(ColumnRepair):
    """A channel in 0..360 deg was interpolated linearly across 360/0; steps above `threshold` [`unit`] show it."""

    threshold: float = Field(gt=0)
    unit: str = "rad"


class Despike(ColumnRepair):
    """Values further than `threshold` [`unit`] from the median of a centred `window` [s] are replaced."""

    window: float = Field(gt=0)
    threshold: float = Field(gt=0)
    unit: str | None = None


class ScaleRepair(ColumnRepair):
    """Columns carry a known wrong factor: multiply them by `factor`."""

    factor: float


class HeadingOffset(Repair):
    """The heading reads `offset` [`unit`] low: psi + offset, and (u, v) turn so that the path stays."""

    offset: float
    unit: str = "rad"


class LeverArm(Repair):
    """What was logged `x` [m] forward and `y` [m] to starboard of the vessel's origin moves to the origin."""

    x: float
    y: float = 0.0
    moves: Literal["both", "position", "velocity"] = "both"


class Latency(Repair):
    """An earth-fixed signal comes `seconds` [s] late: what was logged at t was true at t - seconds.

    signal : `position`, `velocity` (over ground), `heading` or `yaw rate`. turn : whether u and v turn with a heading.
    """

    signal: Literal["position", "velocity", "heading", "yaw rate"]
    seconds: float
    turn: bool | None = None


class Break(Repair):
    """Time is missing inside `intervals` of the log's clock: rows strictly inside go, the run is broken there."""

    intervals: tuple[Interval, ...] = Field(min_length=1)


@dataclass(frozen=True)
class Outcome:
    """Result of a repair: the rows, a mask of those that it `touched`, and a note for the record."""

    rows: pd.DataFrame
    touched: Mask
    count: int
    note: str


def interpolate_missing(t: NDArray[np.float64], values: NDArray[np.float64], missing: Mask) -> NDArray[np.float64]:
    """Values (N,) with the `missing` ones interpolated linearly in time from the finite others."""
    known = ~missing & np.isfinite(values)
    filled = np.where(missing, np.nan, values)
    if known.any():
        filled[missing] = np.interp(t[missing], t[known], values[known])
    return filled


def _interpolate_in_stretches(rows: pd.DataFrame, values: NDArray[np.float64], missing: Mask) -> NDArray[np.float64]:
    """`interpolate_missing` within each unbroken stretch of rows: nothing after a break says what was before it."""
    filled, t, stretch = values.copy(), rows["t"].to_numpy(), _stretch_number(rows)
    for number in np.unique(stretch[missing]):
        here = stretch == number
        filled[here] = interpolate_missing(t[here], values[here], missing[here])
    return filled


def _between_known(rows: pd.DataFrame, known: Mask) -> Mask:
    """Whether each row (N,) has a `known` one before it and one after it in its unbroken stretch."""
    before = pd.Series(known).groupby(_stretch_number(rows)).cummax()
    after = pd.Series(known)[::-1].groupby(_stretch_number(rows)[::-1]).cummax()[::-1]
    between: Mask = before.to_numpy() & after.to_numpy()
    return between


def _stretch_number(rows: pd.DataFrame) -> NDArray[np.int64]:
    """Number of the unbroken stretch of each row (N,)."""
    return np.cumsum((rows["flags"].to_numpy() >> FLAGS.index(BREAK)) & 1)


def heal_wrap(rows: pd.DataFrame, repair: WrapInterpolation) -> Outcome:
    """Drop both neighbours of every step |d psi| > threshold, unwrap the rest, interpolate the dropped."""
    touched, count = np.zeros(len(rows), dtype=bool), 0
    healed: dict[str, NDArray[np.float64]] = {}
    for name in repair.columns:
        values = rows[name].to_numpy().copy()
        false = np.abs(np.diff(values)) > repair.threshold
        dropped = np.append(false, False) | np.insert(false, 0, False)
        known = ~dropped & np.isfinite(values)
        values[known] = np.unwrap(values[known])
        healed[name] = _interpolate_in_stretches(rows, values, dropped)
        touched |= dropped
        count += int(false.sum())
    return Outcome(rows.assign(**healed), touched, count, f"{int(touched.sum())} rows interpolated")


def remove_spikes(rows: pd.DataFrame, repair: Despike) -> Outcome:
    """Replace x where |x - median(x over the window)| > threshold by interpolation of the rest of its stretch.

    Windows are whole and do not reach over a break; at the ends of a stretch a line through the whole window takes the
    place of the median, where it fits. Raises DataError for a window of a single row.
    """
    t, touched, count = rows["t"].to_numpy(), np.zeros(len(rows), dtype=bool), 0
    step = float(np.median(np.diff(t)))
    width = 2 * round(repair.window / 2 / step) + 1
    if width == 1:
        raise DataError(
            f"its window, {repair.window:g} s, holds one row, which is its own median"
            f": rows are {step:.3g} s apart, give {2 * step:.3g} s or more",
            path="repair.despike",
        )
    stretch, healed = _stretch_number(rows), {}
    for name in repair.columns:
        pieces = rows[name].interpolate(limit_area="inside").groupby(stretch)
        median = pieces.transform(lambda piece: _expected_values(piece, width, repair.threshold))
        spikes = (rows[name] - median).abs().to_numpy() > repair.threshold
        values = rows[name].to_numpy()
        known = ~spikes & np.isfinite(values)
        healed[name] = np.where(
            spikes & ~_between_known(rows, known), median, _interpolate_in_stretches(rows, values, spikes)
        )
        touched |= spikes
        count += int(spikes.sum())
    return Outcome(rows.assign(**healed), touched, count, f"median of {width} rows")


def _expected_values(piece: pd.Series[float], width: int, threshold: float) -> pd.Series[float]:
    """The median over whole windows of a stretch; in half a window at its ends a robust line, unless it fits badly."""
    median = piece.rolling(width, center=True, min_periods=width).median()
    half, values = width // 2, piece.to_numpy()
    for window, end in ((slice(0, width), slice(0, half)), (slice(-width, None), slice(-half, None))):
        x, k = values[window], np.arange(width)
        if len(x) < width or half < FEWEST_AT_END or not np.isfinite(x).all():
            continue
        slope = np.median(x[half:] - x[: half + 1]) / half
        line = np.median(x - slope * k) + slope * k
        if np.quantile(np.abs(x - line), 0.75) < threshold / 4:
            median.iloc[end] = line[end]
    return median


def scale_columns(rows: pd.DataFrame, repair: ScaleRepair) -> Outcome:
    """Multiply: x <- factor x, for every column named."""
    scaled = {name: repair.factor * rows[name] for name in repair.columns}
    return _all_rows(rows.assign(**scaled), f"times {repair.factor:g}")


def turn_heading(rows: pd.DataFrame, repair: HeadingOffset) -> Outcome:
    """Turn: psi <- psi + d; (u, v) <- R(-d) (u, v); the velocity over ground, R(psi) (u, v), does not change."""
    turned = rows.assign(psi=rows["psi"] + repair.offset)
    if "u" in rows and "v" in rows:  # else they are estimated from the heading as it now is
        u, v = to_frame(rows["u"], rows["v"], 0.0, 0.0, repair.offset)
        turned = turned.assign(u=u, v=v)
    return _all_rows(turned, f"{np.degrees(repair.offset):+.2f} deg")


def move_origin(rows: pd.DataFrame, repair: LeverArm) -> Outcome:
    """Move: (north, east) <- (north, east) - R(psi) (x, y); u <- u + y r; v <- v - x r (rigid body)."""
    moved = rows
    if repair.moves != "velocity":
        north, east = from_frame(repair.x, repair.y, 0.0, 0.0, rows["psi"])
        moved = moved.assign(north=rows["north"] - north, east=rows["east"] - east)
    if repair.moves != "position" and "v" in rows:  # else it is estimated from the position as it now is
        moved = moved.assign(v=rows["v"] - repair.x * rows["r"])
    if repair.moves != "position" and "u" in rows:
        moved = moved.assign(u=rows["u"] + repair.y * rows["r"])
    side = f", {repair.y:g} m to starboard" if repair.y else ""
    return _all_rows(moved, f"sensor {repair.x:g} m forward{side} of the origin")


def take_earlier(rows: pd.DataFrame, repair: Latency) -> Outcome:
    """Shift: x(t) <- x(t + d), x interpolated in an unbroken stretch; a velocity as v e^(i psi), turned back by psi(t).

    Rows whose t + d lies outside the stretch are removed.
    """
    t, stretch, psi = rows["t"].to_numpy(), _stretch_number(rows), rows["psi"].to_numpy()
    names = {"position": ("north", "east"), "heading": ("psi",), "yaw rate": ("r",), "velocity": ("u", "v")}[
        repair.signal
    ]
    missing = [name for name in names if name not in rows]
    if missing:
        return Outcome(rows, np.zeros(len(rows), dtype=bool), 0, f"no {missing[0]} is logged: nothing to shift")
    signals = {name: rows[name].to_numpy() for name in names}
    ground = (rows["u"] + 1j * rows["v"]).to_numpy() * np.exp(1j * psi) if {"u", "v"} <= set(rows.columns) else None
    if ground is not None and repair.signal == "velocity":
        signals = {"u": ground.real, "v": ground.imag}
    inside, healed = np.zeros(len(t), dtype=bool), {name: values.copy() for name, values in signals.items()}
    for part in np.unique(stretch):
        here = np.flatnonzero(stretch == part)
        at = t[here] + repair.seconds
        inside[here] = (at >= t[here[0]]) & (at <= t[here[-1]])
        for name, values in signals.items():
            healed[name][here] = np.interp(at, t[here], values[here])
    if ground is not None and (repair.signal == "velocity" or (repair.signal == "heading" and repair.turn)):
        moved = healed["u"] + 1j * healed["v"] if repair.signal == "velocity" else ground
        body = moved * np.exp(-1j * healed.get("psi", psi))
        healed |= {"u": body.real, "v": body.imag}
    result = rows.assign(**healed).loc[inside].reset_index(drop=True)
    begins = np.diff(stretch[inside], prepend=stretch[:1]) > 0  # the first row that is left of a stretch is a break
    result["flags"] |= np.where(begins, 1 << FLAGS.index(BREAK), 0)
    note = f"{repair.signal} taken {repair.seconds:g} s later, {int((~inside).sum())} rows at the ends removed"
    return Outcome(result, np.ones(len(result), dtype=bool), len(result), note)


def break_runs(rows: pd.DataFrame, repair: Break) -> Outcome:
    """Remove rows strictly inside each interval; the first row after it is touched, and so a break."""
    t = rows["t"].to_numpy()
    removed = np.zeros(len(t), dtype=bool)
    for start, end in repair.intervals:
        removed |= (t > start) & (t < end)
    kept = t[~removed]
    touched = np.zeros(len(kept), dtype=bool)
    for _, end in repair.intervals:
        touched |= np.arange(len(kept)) == np.searchsorted(kept, end)
    note = f"{int(removed.sum())} rows removed"
    return Outcome(rows.loc[~removed].reset_index(drop=True), touched, len(repair.intervals), note)


def _all_rows(rows: pd.DataFrame, note: str) -> Outcome:
    return Outcome(rows, np.ones(len(rows), dtype=bool), len(rows), note)


REPAIRS: dict[str, tuple[type[Repair], Callable[[pd.DataFrame, Any], Outcome]]] = {
    "wrap_interpolation": (WrapInterpolation, heal_wrap),
    BREAK: (Break, break_runs),
    "despike": (Despike, remove_spikes),
    "scale": (ScaleRepair, scale_columns),
    "heading_offset": (HeadingOffset, turn_heading),
    "lever_arm": (LeverArm, move_origin),
    "latency": (Latency, take_earlier),
}
FLAGS = ("interpolated", *REPAIRS)
"""Names of the bits of the column `flags` of an imported log, lowest first."""


def apply_repairs(
    rows: pd.DataFrame, repairs: Iterable[Repair], without: Iterable[str] = (), file: Path | None = None
) -> tuple[pd.DataFrame, Records]:
    """Apply repairs in order and flag what they touch; a record {kind, column, count, note} for each, also if off.

    Raises DataError, with the file, for a repair that leaves no row or that can mend nothing.
    """
    off, records = set(without), []
    for repair in repairs:
        count, note = 0, "switched off"
        if repair.enabled and repair.kind not in off:
            with placed_errors(DataError, file=file):
                outcome = REPAIRS[repair.kind][1](rows, repair)
            if outcome.rows.empty:
                raise DataError(
                    f"no row is left ({outcome.note}): change it, or leave it out with --without {repair.kind}",
                    file=file,
                    path=f"repair.{repair.kind}",
                )
            bit = 1 << FLAGS.index(repair.kind)
            flags = outcome.rows["flags"].to_numpy() | np.where(outcome.touched, bit, 0)
            rows, count, note = outcome.rows.assign(flags=flags), outcome.count, outcome.note
        column = ", ".join(repair.columns) if isinstance(repair, ColumnRepair) else ""
        records.append({"kind": repair.kind, "column": column, "count": count, "note": note})
    return rows, records
