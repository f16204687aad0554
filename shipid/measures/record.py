"""The record of a manoeuvre, and interpolation of instants, extremes and means between its samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipid.errors import DataError

Array = NDArray[np.float64]

NAN = float("nan")
HELM_NEVER_MOVED = "the helm is never moved"
AT_REST = "the ship does not move at the execute"
CUBIC_SAMPLES = 4  # samples of the interpolating polynomial
TOP_SHARE = 0.2  # share of a rise that is its top
LEVEL_DRIFT = 1.5  # tolerances by which a level differs from the next one at least
LEAST_SLOPE = 1e-10  # of the largest coefficient of a fitted slope: smaller ones of higher powers are rounding
TRACED_SHARE = 0.05  # of the rise of an angle in motion: how near to the level before its start is traced back
SCATTER_SHARE = 0.1  # of that rise: how far values may scatter about a level and the line after it
FEWEST_LINE = 3  # rows of an angle in motion that show its rate
FEWEST_ROWS = 16  # in which to look for where an angle leaves its level
FULL_HELM = 0.95  # of the helm angle: the helm is all the way over
STEADY_CHANGE = 0.05  # relative change over a stretch that counts as none
CREEPING_CHANGE, REMAINING_CHANGE = (
    0.005,
    0.01,
)  # change from quarter to quarter that is looked at, and what may follow after the end


@dataclass(frozen=True, eq=False)
class Record:
    """One manoeuvre, arrays (N,), SI.

    t : increasing [s].
    north, east, psi : place [m] and heading [rad] of the logged point; the heading may jump by full turns.
    u, v, r : velocity over ground along and across the heading [m/s], yaw rate [rad/s].
    helm : helm as ordered, or as measured, > 0 where it turns the ship to starboard [rad].
    shaft : shaft speed as ordered [rev/s], < 0 also where the pitch drives astern; None where it is not known.

    DataError for a single row. Columns are those of a dataset: finite, and in order of time.
    """

    t: Array
    north: Array
    east: Array
    psi: Array
    u: Array
    v: Array
    r: Array
    helm: Array
    shaft: Array | None = None

    def __post_init__(self) -> None:
        if len(self.t) < 2:
            raise DataError("a single row: a manoeuvre needs two or more", path="t")
        object.__setattr__(self, "psi", np.unwrap(self.psi))

    @property
    def speed(self) -> Array:
        """Speed over ground (N,) [m/s]."""
        return np.hypot(self.u, self.v)

    def upto(self, row: int) -> Record:
        """The record up to, and without, a row; at least two rows."""
        cut = slice(0, max(row, 2))
        kept: dict[str, Any] = {name: values[cut] for name, values in vars(self).items() if values is not None}
        return replace(self, **kept)

    def along(self, start: float) -> tuple[Array, Array]:
        """Position (N,) [m] ahead and to starboard of that at time `start` [s], in axes of the heading at that time."""
        psi, north, east = (cubic_value_at(self.t, values, start) for values in (self.psi, self.north, self.east))
        c, s = np.cos(psi), np.sin(psi)
        return c * (self.north - north) + s * (self.east - east), c * (self.east - east) - s * (self.north - north)


@dataclass(frozen=True)
class MeasuredNumber:
    """A number with its SI unit; if it is NaN, `why` is a sentence with the reason."""

    value: float
    unit: str
    why: str = ""


class Measures(dict[str, MeasuredNumber]):
    """Measures by name, in the order in which they were added."""

    def add(self, why: str, **values: tuple[float, str]) -> None:
        """Add measures, each a value and its unit; `why` is the reason of those that are not finite."""
        for name, (value, unit) in values.items():
            self[name] = MeasuredNumber(float(value), unit) if np.isfinite(value) else MeasuredNumber(NAN, unit, why)


def cubic_value_at(t: Array, values: Array, when: float) -> float:
    """Value at the time `when` [s] by cubic interpolation of the two samples before and after; NaN outside the log."""
    if not t[0] <= when <= t[-1]:
        return NAN
    first = int(np.clip(np.searchsorted(t, when) - CUBIC_SAMPLES // 2, 0, max(len(t) - CUBIC_SAMPLES, 0)))
    near, some = t[first : first + CUBIC_SAMPLES] - when, values[first : first + CUBIC_SAMPLES]
    apart = near[:, None] - near + np.eye(len(near))
    others = np.where(np.eye(len(near), dtype=bool), 1.0, -near / apart)
    return float(some @ others.prod(axis=1))


def time_of_crossing(t: Array, values: Array, level: float, start: float, rising: bool = True) -> float:
    """First time [s] from `start` on at which values cross a level upwards (or downwards); NaN if they do not.

    It is `start` if the values are already beyond the level at `start`.
    """
    beyond = (values - level) * (1.0 if rising else -1.0)
    here = cubic_value_at(t, beyond, start)
    if not here < 0:
        return start if here >= 0 else NAN
    after = np.flatnonzero((t > start) & (beyond >= 0))
    if not len(after):
        return NAN
    from scipy.optimize import brentq  # most commands measure nothing, and it takes its time

    low, high = max(float(t[after[0] - 1]), start), float(t[after[0]])
    return float(brentq(lambda when: cubic_value_at(t, beyond, when), low, high))


def maximum_between(t: Array, values: Array, start: float, end: float) -> tuple[float, float]:
    """Time [s] and value of the maximum between two times, from a fitted polynomial of degree 4.

    It is fitted to the samples at most a fifth of the rise since `start` below the maximum, at least five. NaN if the
    largest value is at an end of the interval.
    """
    nothing = NAN, NAN
    inside = np.flatnonzero((t >= start) & (t <= end))
    top = int(inside[np.argmax(values[inside])]) if len(inside) else 0
    if top in (0, len(t) - 1) or len(t) < 5:
        return nothing
    low = np.flatnonzero(values < values[top] - TOP_SHARE * (values[top] - cubic_value_at(t, values, start)))
    left, right = low[low < top], low[low > top]
    first = max(int(left[-1]) + 1 if len(left) else 0, int(inside[0]))
    last = min(int(right[0]) - 1 if len(right) else len(t) - 1, int(inside[-1]))
    if last - first < 4:
        first = int(np.clip(top - 2, 0, len(t) - 5))
        last = first + 4
    some = slice(first, last + 1)
    shape = np.polynomial.Polynomial.fit(t[some] - t[top], values[some], 4)
    slope = shape.deriv()
    slope = slope.trim(LEAST_SLOPE * float(np.abs(slope.coef).max()))  # else far roots take the digits of the near one
    roots = np.asarray(slope.roots(), dtype=complex)
    turns = roots.real[np.abs(roots.imag) < 1e-9] + t[top]
    turns = turns[(turns > max(t[first], start)) & (turns < min(t[last], end))]
    if not len(turns):
        return nothing
    best = float(turns[np.argmax(shape(turns - t[top]))])
    return best, float(shape(best - t[top]))


def integral_between(t: Array, values: Array, start: float, end: float) -> float:
    """Integral of values over time from `start` to `end` [s] by the trapezoid rule; NaN if either is NaN."""
    if not start <= end:
        return NAN
    instants = np.concatenate([[start], t[(t > start) & (t < end)], [end]])
    return float(np.trapezoid(np.interp(instants, t, values), instants))


def mean_between(t: Array, values: Array, start: float, end: float) -> float:
    """Mean of values over the time from `start` to `end` [s]; NaN if end <= start."""
    return integral_between(t, values, start, end) / (end - start) if end > start else NAN


def settled_mean(t: Array, values: Array, start: float, end: float, scale: float) -> float:
    """Mean over the last quarter of the time; NaN where the values are still on their way.

    They are where it differs from the quarter before by more than 5 % of `scale`, or where the last three quarters show
    that more than 1 % of it is still to come: a slow decay changes little from one to the next, and goes on for long.
    """
    quarter = (end - start) / 4
    early, before, last = (mean_between(t, values, end - (i + 1) * quarter, end - i * quarter) for i in (2, 1, 0))
    change, steady = last - before, STEADY_CHANGE * abs(scale)
    if not abs(change) <= steady:
        return NAN
    slower = before - early - change  # by how much the change falls from quarter to quarter
    if abs(change) <= CREEPING_CHANGE * abs(scale) or change * (before - early) <= 0:
        return last
    to_come = change**2 / abs(slower) if slower * change > 0 else np.inf  # of a geometric series
    return last if to_come <= REMAINING_CHANGE * abs(scale) else NAN


def start_of_change(t: Array, order: Array, index: int) -> float:
    """Time [s] at which the change of `order` that is in progress in row `index` (at least 1) began.

    A step order begins at its row; a measured angle that moves gradually is traced back to the start of its motion.
    Where noise or coarse digits end the trace on the way, the motion begins where a straight line through it meets the
    level before.
    """
    sense = np.sign(order[index] - order[index - 1])
    moved = sense * np.diff(order)
    begin = index - 1
    while begin > 0 and moved[begin - 1] > 0.2 * moved[index - 1]:
        begin -= 1
    bend = _bend_in_motion(t[: index + 1], sense * order[: index + 1])
    if bend is not None:
        bent, level = bend
        rise = sense * order[index] - level
        if sense * order[begin] - level > TRACED_SHARE * rise and moved[index - 1] < rise / 2:  # no jump
            return bent
    after = begin + 2
    if after >= len(t) or moved[begin + 1] <= 0.05 * moved[begin]:
        return float(t[begin + 1])
    rate = moved[begin + 1] / (t[after] - t[begin + 1])
    return float(np.clip(t[begin + 1] - moved[begin] / rate, t[begin], t[begin + 1]))


def _bend_in_motion(t: Array, values: Array) -> tuple[float, float] | None:
    """Time at which values, which rise at the end, leave their level, and this level; None where they do not.

    The last rows are divided into a level and a straight line by least squares. So many rows are taken that at least
    half of them are level, and that half as many give the same level.
    """
    count, before = FEWEST_ROWS, np.inf
    while True:
        some = slice(max(len(t) - count, 0), None)
        found = _level_and_line(t[some], values[some])
        if found is not None and found[2] < len(t[some]) / 2:
            found = None
        if found is not None and (count >= len(t) or abs(before - found[1]) <= TOP_SHARE * (values[-1] - found[1])):
            return found[:2]
        if count >= len(t):
            return None
        before = np.inf if found is None else found[1]
        count *= 2


def _level_and_line(t: Array, values: Array) -> tuple[float, float, int] | None:
    """Time at which a level meets the straight line after it, the level, and its number of rows.

    None where it does not rise, where too few rows make a line, or where both do not describe the values.
    """
    end, count = float(t[-1]), len(t)
    t = t - end
    if count < FEWEST_LINE + 1:
        return None
    left = np.arange(1, count - FEWEST_LINE + 1)  # rows of the level
    right = count - left
    sums = [np.append(0.0, np.cumsum(part)) for part in (values, values**2, t, t**2, t * values)]
    (y, yy, *_), (line_y, line_yy, line_t, line_tt, line_ty) = (
        [part[left] for part in sums],
        [part[-1] - part[left] for part in sums],
    )
    spread = line_tt - line_t**2 / right
    slope = (line_ty - line_t * line_y / right) / spread
    missed = np.stack([yy - y**2 / left, line_yy - line_y**2 / right - slope**2 * spread])
    best = int(np.argmin(missed.sum(axis=0)))
    level = y[best] / left[best]
    scatter = np.sqrt(np.maximum(missed[:, best], 0.0) / (left[best], right[best]))
    if slope[best] <= 0 or scatter.max() > SCATTER_SHARE * (values[-1] - level):
        return None
    meets = (level - line_y[best] / right[best]) / slope[best] + line_t[best] / right[best]
    return end + float(np.clip(meets, t[0], 0.0)), float(level), int(left[best])


@dataclass(frozen=True)
class FirstExecute:
    """The first execute: the helm is first put over.

    start : time [s] at which the helm begins to move; NaN if it never moves.
    row : first row with at least half of the angle.
    angle : helm angle [rad], the median of the angles above half of the largest. side : +1 to starboard, -1 to port.
    """

    start: float
    row: int
    angle: float
    side: float


def first_execute(record: Record) -> FirstExecute:
    """The first execute of a record.

    A helm may be over in the first row already. If the ship turns there, it belongs to an earlier manoeuvre, and the
    next execute counts. If it does not turn, this is the execute. There is one exception: it does not turn until the
    helm is all the way over. Then the helm held its course until there, as against wind, and the full helm is the
    execute.
    """
    size, rate = np.abs(record.helm), np.abs(record.r)
    if not size.max() > 0:
        return FirstExecute(NAN, 0, 0.0, 1.0)
    angle = _helm_angle(size)
    over = size >= angle / 2
    if over[0] and rate[0] > STEADY_CHANGE * rate.max():
        same = np.sign(record.helm) == np.sign(record.helm[0])
        over &= np.logical_or.accumulate(~(over & same))  # the helm of an earlier manoeuvre ends at its first release
    elif over[0]:
        angle = _helm_angle(size[int(np.argmax(rate > STEADY_CHANGE * rate.max())) :])
        full = int(np.argmax(size >= FULL_HELM * angle))
        before = np.interp(start_of_change(record.t, record.helm, full), record.t, rate) if full else np.inf
        if before <= STEADY_CHANGE * rate.max():
            over[:full] = False
    if not over.any():
        return FirstExecute(NAN, 0, 0.0, 1.0)
    row = int(np.argmax(over))
    start = start_of_change(record.t, record.helm, row) if row else float(record.t[0])
    return FirstExecute(start, row, angle, float(np.sign(record.helm[row])))


def _helm_angle(size: Array) -> float:
    """Median [rad] of the angles above half of the largest."""
    return float(np.median(size[size >= size.max() / 2]))


def row_of_release(record: Record, over: FirstExecute) -> int:
    """First row after the execute with less than half of the helm angle; the number of rows if there is none."""
    back = np.flatnonzero(over.side * record.helm[over.row :] < over.angle / 2)
    return over.row + int(back[0]) if over.angle and len(back) else len(record.t)


def _level_from(values: Array, last: int, tolerance: float) -> int:
    """First row from which on all values are within `tolerance` of that of row `last`; back in doubled strides."""
    end, stride = last, 64
    while end > 0:
        start = max(end - stride, 0)
        off = np.flatnonzero(np.abs(values[start:end] - values[last]) > tolerance)
        if len(off):
            return start + int(off[-1]) + 1
        end, stride = start, 2 * stride
    return 0


def find_plateaus(t: Array, values: Array, tolerance: float) -> list[tuple[int, int]]:
    """First and last rows of the plateaus: stretches with all values within `tolerance` of their last value.

    Plateaus shorter than a quarter of the longest are left out, and those that drift into the next one.
    """
    stretches: list[tuple[int, int]] = []
    last = len(t) - 1
    while last > 0:
        first = _level_from(values, last, tolerance)
        stretches.append((first, last))
        last = first - 1
    longest = max((t[b] - t[a] for a, b in stretches), default=0.0)
    level = [(a, b) for a, b in reversed(stretches) if t[b] - t[a] >= longest / 4 > 0]
    return [
        (a, b)
        for (a, b), (c, d) in zip(level, [*level[1:], (-1, -1)], strict=True)
        if b + 1 != c or abs(values[d] - values[b]) > LEVEL_DRIFT * tolerance
    ]
