"""Kinematic tests on columns of unknown meaning: which columns fit together, in which unit, frame and sign.

Changes over windows of a few seconds are compared with integrals. The plane is north + i east; a body vector turns by
exp(i psi).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import Array, cumulative_integral

Complex = NDArray[np.complex128]
TURNS = (360.0, 2 * np.pi, 400.0, 3600.0, 36000.0, 6400.0)  # a whole turn in deg, rad, gon, 0.1 and 0.01 deg, mils
CLOSE = 0.1  # of the longer steps: a shorter one leads to another row of the same moment
GAP = 3.0  # usual steps: a longer one is a hole, and no window reaches over it
WINDOW, STEPS, MOST = 10.0, 4, 1500  # s; steps and windows
FALSE_STEP = np.radians(20.0)  # of a heading between two rows
WILD, RARE = 5.0, 0.03  # times the larger rates, and share of the windows at most: then it is no turn of a ship
LIVELY = 0.1  # of the larger changes over a window: in one of less nothing happens
NEAR_TURN, NEIGHBOURS = 0.6, 9  # of a turn, that many steps together make when they lead across 360


@dataclass(frozen=True)
class RowWindows:
    """Index of the first and last row of every window, (W,)."""

    first: NDArray[np.intp]
    last: NDArray[np.intp]

    def change(self, values: NDArray[np.generic]) -> Complex:
        """The change of a signal (N,) over each window, end minus start, (W,)."""
        plane = np.asarray(values, dtype=np.complex128)
        return np.asarray(plane[self.last] - plane[self.first])


@dataclass(frozen=True)
class Fit:
    """A fit of observed changes = scale * integrated changes: scale, its standard error, unexplained share (0 to 1)."""

    scale: float
    error: float
    left: float


def usual_step(t: Array) -> float:
    """The usual step of instants (N,); several that are close, as of the sensors of one moment, are one."""
    steps = np.diff(t)
    return float(np.median(steps[steps >= CLOSE * np.percentile(steps, 90)]))


def row_windows(t: Array, duration: float = WINDOW) -> RowWindows:
    """Windows of about `duration` [s] without a hole: at least `STEPS` rows, at most a fifth of the log."""
    usual = usual_step(t)
    duration = max(STEPS * usual, min(duration, (t[-1] - t[0]) / 5))
    first = np.arange(len(t))
    last = np.searchsorted(t, t + duration)
    inside = last < len(t)
    first, last = first[inside], last[inside]
    stretch = _stretch_numbers(t)
    whole = (stretch[last] == stretch[first]) & (last - first >= STEPS)
    first, last = first[whole], last[whole]
    thin = max(1, len(first) // MOST)
    return RowWindows(first[::thin], last[::thin])


def integrate_rate(t: Array, rate: NDArray[np.generic]) -> Complex:
    """The integral of a real or complex rate (N,) from t[0] to each t [s], (N,)."""
    return cumulative_integral(t, np.real(rate)) + 1j * cumulative_integral(t, np.imag(rate))


def fit_scale(seen: Complex, integrated: Complex) -> Fit:
    """Fit one real scale by least squares; its error is the scatter of the scale between twenty parts of the log."""
    power = float(np.sum(np.abs(integrated) ** 2))
    total = float(np.sum(np.abs(seen) ** 2))
    if power <= 0.0 or total <= 0.0:
        return Fit(0.0, np.inf, 1.0)
    scale = float(np.real(np.vdot(integrated, seen))) / power
    scales = [
        float(np.real(np.vdot(ran, part))) / size
        for ran, part in zip(np.array_split(integrated, 20), np.array_split(seen, 20), strict=True)
        if (size := float(np.sum(np.abs(ran) ** 2))) > 0.01 * power / 20
    ]
    error = 1.25 * float(np.std(scales)) / np.sqrt(len(scales)) if len(scales) > 2 else np.inf
    return Fit(scale, error, float(np.sum(np.abs(seen - scale * integrated) ** 2)) / total)


def fit_without_outliers(seen: Complex, integrated: Complex) -> Fit:
    """Fit one real scale to the windows without spikes and jumps: outliers in their unexplained change."""
    miss, size = np.abs(seen - fit_scale(seen, integrated).scale * integrated), np.abs(integrated)
    moving = size >= LIVELY * np.percentile(size, 90)
    keep = miss <= 6.0 * np.median(miss[moving]) + 1e-9
    return fit_scale(seen[keep], integrated[keep])


def heal_angle(values: Array, turn: float, t: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Unwrap an angle that jumps at a whole turn; replace false samples within a jump.

    Returns the angle in the unit of the log, (N,), and a mask of other steps of more than 20 deg, without those over a
    hole in time t (N,) [s].
    """
    signed = np.diff(values) / turn
    steps = np.abs(signed)
    ordinary = np.percentile(steps, 90) if len(steps) else 0.0
    large = steps > max(FALSE_STEP / (2 * np.pi), 5 * ordinary)
    large &= np.diff(t) <= GAP * usual_step(t) if len(t) > 1 else True
    between = large & (steps < 1.0 - max(FALSE_STEP / (2 * np.pi), 5 * ordinary))
    # the steps through false samples add up to about a whole turn; those of a spike to nothing
    near = np.abs(np.convolve(signed, np.ones(NEIGHBOURS), "same")) if len(signed) > NEIGHBOURS else steps
    false = between & (near > NEAR_TURN)
    dropped = np.append(false, False) | np.insert(false, 0, False)
    known = ~dropped & np.isfinite(values)
    index = np.arange(len(values))
    if known.sum() < 2:
        return values, false
    return np.interp(index, index[known], np.unwrap(values[known], period=turn)), false


def order_effects(t: Array, r: Array, orders: Array, duration: float) -> Array:
    """The t values (K,) of a in r' = a orders + b r + c: > 0 if an order turns to starboard, 0 where none is seen.

    t, r : (N,), r [rad/s]. orders : (K, N). duration : of the windows [s].
    """
    design, change = _yaw_regression(t, r, orders, duration)
    sizes, none = np.linalg.norm(design, axis=0), np.zeros(len(orders))
    if len(change) < 12 or np.any(np.ptp(orders, axis=1) == 0.0) or not np.all(sizes > 0.0):
        return none
    solution, _, rank, _ = np.linalg.lstsq(design / sizes, change, rcond=None)
    if rank < len(sizes):
        return none
    rest = change - design / sizes @ solution
    spread = np.sum(np.linalg.pinv(design / sizes) ** 2, axis=1) * (rest @ rest) / max(1, len(rest) - len(sizes))
    return np.asarray(np.divide(solution, np.sqrt(spread), out=np.zeros(len(sizes)), where=spread > 0.0)[: len(orders)])


def _yaw_regression(t: Array, r: Array, orders: Array, duration: float) -> tuple[Array, Array]:
    """Columns (W, K + 2), left side (W,) of r' = a orders + b r + c over windows without jumps of r; orders (K, N)."""
    chosen = row_windows(t, duration)
    thin = max(1, len(chosen.first) // 400)
    chosen = RowWindows(chosen.first[::thin], chosen.last[::thin])
    width = max(1, round(duration / 2 / usual_step(t)))
    signals = *(cumulative_integral(t, one) for one in (*orders, r)), t, r
    parts = _stretch_numbers(t)
    smooth = [pd.Series(x).groupby(parts).rolling(width, center=True, min_periods=1).mean().to_numpy() for x in signals]
    *columns, change = (chosen.change(x).real for x in smooth)  # the equation holds for means, too
    design = np.stack(columns, axis=1)
    wild = np.zeros(len(change), dtype=bool)
    for one in (change, design[:, -2]) if len(change) else ():
        wild |= np.abs(one) > WILD * np.percentile(np.abs(one), 95)
    tame = ~wild | (np.sum(wild) > RARE * len(wild))
    return design[tame], change[tame]


def _stretch_numbers(t: Array) -> NDArray[np.int_]:
    """The number of the stretch without a hole that each row at t (N,) [s] is in."""
    return np.append(0, np.cumsum(np.diff(t) > GAP * usual_step(t)))


def position_jumps(t: Array, position: Complex, integrated: Complex) -> list[tuple[int, int, float]]:
    """Where a position leaves its integrated velocity in one step: rows before and after, and lasting error [m]."""
    usual = usual_step(t)
    reach = max(1, round(2.0 / usual))
    if len(t) < 20 * reach:
        return []
    drift = position - integrated
    miss = np.abs(drift[reach:] - drift[:-reach])
    limit = max(5.0 * float(np.percentile(miss, 98)), 2.0 * usual)
    holes = _stretch_numbers(t)
    wild = (miss > limit) & (holes[reach:] == holes[:-reach])
    if not wild.any() or wild.mean() > 0.05:
        return []
    edges = np.flatnonzero(wild)
    groups = np.split(edges, np.flatnonzero((np.diff(edges) > 2 * reach) | (np.diff(holes[edges]) > 0)) + 1)
    leaps = []
    for group in groups:
        first, last = np.searchsorted(holes, holes[group[0]] + np.array([0, 1]))  # rows of its stretch
        start, end = max(first, group[0] - 1), min(last - 1, group[-1] + reach + 1)
        around = 3 * reach
        before, after = drift[max(first, start - around) : start + 1], drift[end : min(last, end + around + 1)]
        stays = abs(_complex_median(after) - _complex_median(before))
        leaps.append((int(start), int(end), float(stays)))
    return leaps


def _complex_median(points: Complex) -> complex:
    return complex(np.median(points.real), np.median(points.imag))


def spike_rows(values: Array) -> NDArray[np.bool_]:
    """The rows (N,) of a signal that leave it and come back within two rows, as no ship and no order does.

    They leave the median of five rows by more than all else ever does, or by 0.02 of the range of a signal that moves
    in most rows, and by far more than nine in ten of the rows around. An angle that counts from 0 again, and a signal
    with more than one such row in fifty, has none, but where all have one value.
    """
    result = _plain_spike_rows(values, values)
    for turn in TURNS:
        if result.any() and 0.9 * turn < np.ptp(values) and _may_be_angle(values, turn):
            result &= _plain_spike_rows(
                np.unwrap(values, period=turn), values
            )  # an angle that crosses its 0 for a row?
    return result


def _plain_spike_rows(values: Array, written: Array) -> NDArray[np.bool_]:
    """Rows (N,) that leave a signal, were it no angle; `written` is as it is in the log."""
    none = np.zeros(len(values), dtype=bool)
    low, high = np.percentile(values, [0.5, 99.5])
    if len(values) < 50 or not high > low:
        return none

    def around(of: Array, share: float) -> Array:
        rolled = pd.Series(of).rolling(41, center=True, min_periods=1)
        return np.asarray(rolled.max() if share == 1.0 else rolled.quantile(share))

    off = np.abs(values - pd.Series(values).rolling(5, center=True, min_periods=1).median().to_numpy())
    steps = np.abs(np.diff(values, prepend=values[0]))
    moves = float(np.mean(steps > 0)) > 0.5  # an order is held, and may be given for a moment
    wild = off > np.maximum((0.02 if moves else 1.0) * (high - low), 8 * around(off, 0.9))
    for turn in TURNS:
        whole = np.abs(off / turn - 1) < 0.05
        if _may_be_angle(values[whole | ~wild], turn):
            wild &= ~whole
    touching = wild | np.append(False, wild[:-1])
    usual = around(np.where(touching, 0.0, steps), 1.0)
    result = none.copy()
    for first, end in row_spans(wild):
        before, after = max(first - 1, 0), min(end, len(values) - 1)
        size = float(off[first:end].min())
        agrees = abs(values[after] - values[before]) < 0.25 * size
        result[first:end] = end - first <= 2 and agrees and size > 4 * usual[first:end].max()
    one_value = len(np.unique(written[result])) == 1
    return result if result.mean() <= (0.1 if one_value else 0.02) else none


def _may_be_angle(values: Array, turn: float) -> bool:
    """Whether all values (N,) lie within one turn that begins at 0, or up to three quarters of a turn below."""
    low, high = values.min() / turn, values.max() / turn
    return bool(any(low > -0.02 - below and high < 1.02 - below for below in (0.0, 0.25, 0.5, 0.75)))


def row_spans(rows: NDArray[np.bool_]) -> NDArray[np.intp]:
    """First row of each stretch of chosen rows (N,), and the row after its last, (K, 2)."""
    return np.flatnonzero(np.diff(np.concatenate([[0], rows.astype(int), [0]]))).reshape(-1, 2)


def fill_columns(t: Array, columns: Iterable[tuple[str, Array]]) -> dict[str, Array]:
    """The columns with missing values interpolated in time; good enough for these tests, not for a dataset."""
    result = {}
    for name, values in columns:
        known = np.isfinite(values)
        result[name] = _fill_column(t, values, known) if known.any() and not known.all() else values.copy()
    return result


def _fill_column(t: Array, values: Array, known: NDArray[np.bool_]) -> Array:
    """Values (N,) interpolated in time where they are not known; an angle that jumps at a whole turn the short way."""
    held = values[known]
    spread, jump = float(np.ptp(held)), float(np.abs(np.diff(held)).max(initial=0.0))
    turn = next((one for one in (2 * np.pi, 360.0) if jump > one / 2 and 0.9 * one < spread <= one), None)
    if turn is None:
        return np.interp(t, t[known], held)
    least = 0.0 if held.min() >= 0.0 else -turn / 2
    between = np.interp(t, t[known], np.unwrap(held, period=turn))
    return np.where(known, values, (between - least) % turn + least)


def window_length(t: Array, psi: Array, chosen: RowWindows, most: float = WINDOW) -> float:
    """The length of windows [s] for this ship: about a radian of its usual turning, `most` at most.

    t (N,) [s], psi (N,) [rad].
    """
    span = t[chosen.last] - t[chosen.first]
    rates = np.abs(chosen.change(psi).real) / span
    turning = float(np.percentile(rates, 90)) if len(rates) else 0.0
    return float(np.clip(1.0 / turning, 0.2, most)) if turning > 0 else most
