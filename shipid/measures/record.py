"""A manoeuvre as it was sailed, and how instants, extremes and means are found between its samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from shipid.errors import DataError

Array = NDArray[np.float64]

POINTS = 4  # of the polynomial on which a value between samples lies
HALVINGS = 60
TOP = 0.2  # share of a rise that is its top
DRIFT = 1.5  # tolerances by which a level differs from the next one at least
STEADY = 0.05  # relative change over a stretch that counts as none


@dataclass(frozen=True, eq=False)
class Record:
    """One manoeuvre, arrays (N,), SI.

    Parameters
    ----------
    t : increasing [s].
    north, east, psi : place [m] and heading [rad] of the logged point; the heading may jump by full turns.
    u, v, r : velocity over ground along and across the heading [m/s], yaw rate [rad/s].
    helm : helm as ordered, or as measured, > 0 where it turns the ship to starboard [rad].
    shaft : shaft speed as ordered [rev/s]; None where it is not known.

    Raises
    ------
    DataError : fewer than two rows, unequal lengths, a value that is not finite, time that does not increase.
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
        for one in fields(self):
            values = getattr(self, one.name)
            if values is None:
                continue
            if values.shape != self.t.shape or values.ndim != 1 or len(values) < 2:
                raise DataError(f"has the shape {values.shape}: needs (N,) like t, N at least 2", path=one.name)
            if not np.isfinite(values).all():
                raise DataError("holds a value that is not finite", path=one.name)
        if (np.diff(self.t) <= 0).any():
            raise DataError("does not increase", path="t")
        object.__setattr__(self, "psi", np.unwrap(self.psi))

    @property
    def speed(self) -> Array:
        """Speed over ground (N,) [m/s]."""
        return np.hypot(self.u, self.v)

    def upto(self, row: int) -> Record:
        """The rows before one, two at least."""
        cut = slice(0, max(row, 2))
        names = ("t", "north", "east", "psi", "u", "v", "r", "helm")
        given = {name: getattr(self, name)[cut] for name in names}
        return replace(self, **given, shaft=None if self.shaft is None else self.shaft[cut])

    def along(self, start: float) -> tuple[Array, Array]:
        """Place ahead and to starboard (N,) [m] of where the ship is at `start` [s], on her heading there."""
        psi, north, east = (value_at(self.t, values, start) for values in (self.psi, self.north, self.east))
        c, s = np.cos(psi), np.sin(psi)
        return c * (self.north - north) + s * (self.east - east), c * (self.east - east) - s * (self.north - north)


@dataclass(frozen=True)
class Measure:
    """A number with its SI unit; where it is NaN, `why` says in a sentence what is missing."""

    value: float
    unit: str
    why: str = ""


class Measures(Mapping[str, Measure]):
    """Measures by name, in the order in which they were added."""

    def __init__(self) -> None:
        self._found: dict[str, Measure] = {}

    def add(self, name: str, value: float, unit: str, why: str) -> None:
        """Add one; `why` is kept where the value is NaN."""
        missing = not np.isfinite(value)
        self._found[name] = Measure(float("nan") if missing else float(value), unit, why if missing else "")

    def __getitem__(self, name: str) -> Measure:
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)


def value_at(t: Array, values: Array, when: float) -> float:
    """Value at an instant [s] on the cubic through the two samples before and the two after it; NaN outside the log."""
    if not t[0] <= when <= t[-1]:
        return float("nan")
    first = int(np.clip(np.searchsorted(t, when) - POINTS // 2, 0, max(len(t) - POINTS, 0)))
    near, some = t[first : first + POINTS] - when, values[first : first + POINTS]
    apart = near[:, None] - near + np.eye(len(near))
    others = np.where(np.eye(len(near), dtype=bool), 1.0, -near / apart)
    return float(some @ others.prod(axis=1))


def crossing(t: Array, values: Array, level: float, start: float, rising: bool = True) -> float:
    """First instant [s] from `start` on at which values pass a level upwards (or downwards); NaN if they do not.

    It is `start` where they are beyond the level by then.
    """
    beyond = (values - level) * (1.0 if rising else -1.0)
    here = value_at(t, beyond, start)
    if not here < 0:
        return start if here >= 0 else float("nan")
    after = np.flatnonzero((t > start) & (beyond >= 0))
    if not len(after):
        return float("nan")
    low, high = max(float(t[after[0] - 1]), start), float(t[after[0]])
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if value_at(t, beyond, middle) >= 0 else (middle, high)
    return high


def extreme(t: Array, values: Array, start: float, end: float) -> tuple[float, float]:
    """Instant [s] and value of the greatest of values between two instants, on a quartic about it.

    The quartic is the best through the samples within a fifth of the rise since `start`, five at least: the
    stretch does not depend on how often one samples, and noise is averaged where samples are many. NaN where the
    greatest lies at an end of the stretch: then it is none of the values' own.
    """
    nothing = float("nan"), float("nan")
    inside = np.flatnonzero((t >= start) & (t <= end))
    top = int(inside[np.argmax(values[inside])]) if len(inside) else 0
    if top in (0, len(t) - 1) or len(t) < 5:
        return nothing
    low = np.flatnonzero(values < values[top] - TOP * (values[top] - value_at(t, values, start)))
    left, right = low[low < top], low[low > top]
    first, last = int(left[-1]) + 1 if len(left) else 0, int(right[0]) - 1 if len(right) else len(t) - 1
    if last - first < 4:
        first = int(np.clip(top - 2, 0, len(t) - 5))
        last = first + 4
    some = slice(first, last + 1)
    shape = np.polynomial.Polynomial.fit(t[some] - t[top], values[some], 4)
    roots = np.asarray(shape.deriv().roots(), dtype=complex)
    turns = roots.real[np.abs(roots.imag) < 1e-9] + t[top]
    turns = turns[(turns > max(t[first], start)) & (turns < min(t[last], end))]
    if not len(turns):
        return nothing
    best = float(turns[np.argmax(shape(turns - t[top]))])
    return best, float(shape(best - t[top]))


def integral(t: Array, values: Array, start: float, end: float) -> float:
    """Integral of values over time between two instants [s] by the trapezoid rule; NaN where one is."""
    if not start <= end:
        return float("nan")
    instants = np.concatenate([[start], t[(t > start) & (t < end)], [end]])
    return float(np.trapezoid(np.interp(instants, t, values), instants))


def mean(t: Array, values: Array, start: float, end: float) -> float:
    """Mean of values over the time between two instants [s]; NaN where there is none."""
    return integral(t, values, start, end) / (end - start) if end > start else float("nan")


def settled(t: Array, values: Array, start: float, end: float, scale: float) -> float:
    """Mean over the last quarter of a stretch; NaN if it differs from the quarter before by 5 % of `scale`."""
    quarter = (end - start) / 4
    before, last = (mean(t, values, end - (i + 1) * quarter, end - i * quarter) for i in (1, 0))
    return last if abs(last - before) <= STEADY * abs(scale) else float("nan")


def departure(t: Array, order: Array, index: int) -> float:
    """Instant [s] at which a move that is under way in row `index` (at least 1) began.

    An order that jumps holds from its row on; a measured angle that moves is traced back to where its motion began.
    """
    sense = np.sign(order[index] - order[index - 1])
    moved = sense * np.diff(order)
    begin = index - 1
    while begin > 0 and moved[begin - 1] > 0.2 * moved[index - 1]:
        begin -= 1
    after = begin + 2
    if after >= len(t) or moved[begin + 1] <= 0.05 * moved[begin]:
        return float(t[begin + 1])
    rate = moved[begin + 1] / (t[after] - t[begin + 1])
    return float(np.clip(t[begin + 1] - moved[begin] / rate, t[begin], t[begin + 1]))


@dataclass(frozen=True)
class HelmOver:
    """The helm as it is first put over.

    Parameters
    ----------
    start : instant [s] at which it began to move; NaN where it never does.
    row : first in which it is over by half.
    angle, side : how far [rad], the median while it is over by half or more of the most, and +1 to starboard.
    """

    start: float
    row: int
    angle: float
    side: float


def helm_over(record: Record) -> HelmOver:
    """How the helm is first put over.

    One that is over from the first row on was put over there if the ship does not turn by then; else it is left from
    before, and the next time counts.
    """
    size = np.abs(record.helm)
    if not size.max() > 0:
        return HelmOver(float("nan"), 0, 0.0, 1.0)
    angle = float(np.median(size[size >= size.max() / 2]))
    over = size >= angle / 2
    if over[0] and abs(record.r[0]) > STEADY * np.abs(record.r).max():
        same = np.sign(record.helm) == np.sign(record.helm[0])
        over &= np.logical_or.accumulate(~(over & same))  # what is left from before ends where it is first let go
    if not over.any():
        return HelmOver(float("nan"), 0, 0.0, 1.0)
    row = int(np.argmax(over))
    start = departure(record.t, record.helm, row) if row else float(record.t[0])
    return HelmOver(start, row, angle, float(np.sign(record.helm[row])))


def released(record: Record, over: HelmOver) -> int:
    """First row after the helm is put over in which it is back by half; the number of rows if it is held to the end."""
    back = np.flatnonzero(over.side * record.helm[over.row :] < over.angle / 2)
    return over.row + int(back[0]) if over.angle and len(back) else len(record.t)


def plateaus(t: Array, values: Array, tolerance: float) -> list[tuple[int, int]]:
    """First and last rows of the stretches that end level: all within `tolerance` of their last value.

    Left out are stretches shorter than a quarter of the longest, and those that drift into the next one.
    """
    found: list[tuple[int, int]] = []
    last = len(t) - 1
    while last > 0:
        off = np.flatnonzero(np.abs(values[:last] - values[last]) > tolerance)
        first = int(off[-1]) + 1 if len(off) else 0
        found.append((first, last))
        last = first - 1
    longest = max((t[b] - t[a] for a, b in found), default=0.0)
    level = [(a, b) for a, b in reversed(found) if t[b] - t[a] >= longest / 4 > 0]
    return [
        (a, b)
        for (a, b), (c, d) in zip(level, [*level[1:], (-1, -1)], strict=True)
        if b + 1 != c or abs(values[d] - values[b]) > DRIFT * tolerance
    ]
