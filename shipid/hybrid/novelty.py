"""An alarm at an instant whose inputs are not those of the training: no band is promised there.

It sees every input that a method may take, and whether an order has changed in the past that is given. Two scores are
compared with those of runs left out of the training in turn: the distance from the middle of the training, with the
inputs' covariance, and how far an order, or an input that was constant, lies outside its range. Smaller waves or less
wind than in training are no alarm: such inputs lie near the middle. More wind widens the band by its distance instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shipid.data.windows import Instants
from shipid.hybrid.bands import FEWEST, radius_at_level
from shipid.hybrid.calibration import band_radii, shares_of_runs
from shipid.hybrid.features import TOLERANCE, Inputs, input_group, select_inputs
from shipid.hybrid.physics import Physics
from shipid.hybrid.stored import StoredData
from shipid.metrics import Array

ALARM_LEVEL = 0.96
"""Share of the instants of a new run like those of training that each score leaves without an alarm."""


@dataclass(frozen=True, eq=False)
class NoveltyAlarm(StoredData):
    """A calibrated alarm.

    inputs : what it sees. past : rows of the past in which a change of an order counts.
    names : inputs that vary in training; middle : (d,) their mean. root : (d, d), with which the distance of inputs x
    is the length of (x - middle) @ root. farthest : distance without an alarm.
    limited : orders, their ranges over the past, and inputs that are constant in training; low, high : (k,) what
    training has seen. slack : share of high - low that is no alarm.
    """

    inputs: Inputs
    past: int
    names: tuple[str, ...]
    middle: Array
    root: Array
    farthest: float
    limited: tuple[str, ...]
    low: Array
    high: Array
    slack: float

    def is_raised(self, table: Mapping[str, Array]) -> NDArray[np.bool_]:
        """Whether the alarm is raised (S,), also where an input is not a number."""
        away = np.square((select_inputs(table, self.names) - self.middle) @ self.root).sum(axis=1)
        beyond = range_excess(select_inputs(table, self.limited), self.low, self.high, self.high - self.low)
        inside = np.logical_and(np.sqrt(away) <= self.farthest, (beyond <= self.slack).all(axis=1))
        raised: NDArray[np.bool_] = np.logical_not(inside)
        return raised


def range_of_orders(name: str) -> str:
    """Name of the input that says how much an order has changed over the past, `port.range.n` of `port.n`."""
    component, _, signal = name.rpartition(".")
    return f"{component}.range.{signal}"


def alarm_inputs(inputs: Inputs, past: int, physics: Physics, instants: Instants) -> dict[str, Array]:
    """Inputs (S,) of an alarm: those of a method, and the range of each order over the last rows of the past."""
    table = inputs.table(physics, instants)
    for name in inputs.commands:
        now = np.stack([instants.columns[name]])
        series = np.concatenate([instants.past[name][-past:], now]) if past else now
        known = (np.abs(series) < np.inf).all(axis=0)
        table[range_of_orders(name)] = np.where(known, np.ptp(series, axis=0), np.nan)
    return table


def range_rounding(low: Array, high: Array) -> Array:
    """What is no departure (k,) from ranges."""
    return np.asarray(TOLERANCE * np.maximum(1.0, np.maximum(np.abs(low), np.abs(high))))


def range_excess(values: Array, low: Array, high: Array, width: Array) -> Array:
    """How far values (S, k) lie outside their ranges, over the width; below 0 inside."""
    rounding = range_rounding(low, high)
    beyond: Array = (np.maximum(low - values, values - high) - rounding) / np.maximum(width, rounding)
    return beyond


def calibrate_alarm(
    inputs: Inputs, past: int, table: Mapping[str, Array], run: NDArray[np.str_]
) -> NoveltyAlarm | None:
    """Calibrate an alarm on inputs (S,) of windows of training, run by run; None with fewer than three runs."""
    sound = np.isfinite(np.stack([*table.values()])).all(axis=0)
    table, runs = {name: values[sound] for name, values in table.items()}, shares_of_runs(run[sound])
    if runs.count < FEWEST:
        return None
    fixed = {name for name, values in table.items() if np.ptp(values) <= range_rounding(values, values).max()}
    fixed |= {range_of_orders(name) for name in inputs.commands}
    limited = tuple(name for name in table if name in fixed or input_group(name) == "command")
    names = tuple(name for name in table if name not in fixed and input_group(name) != "wind")
    values, bounded = select_inputs(table, names), select_inputs(table, limited)
    scale = np.sqrt(runs.weight @ (values - runs.weight @ values) ** 2)
    values = values / scale
    full = np.column_stack([np.ones(len(values)), values])
    moments = np.stack(  # (G, d + 1, d + 1)
        [rows.T @ rows / len(rows) for rows in (full[runs.place == one] for one in range(runs.count))]
    )
    lows, highs = (
        np.stack([end(bounded[runs.place == one], axis=0) for one in range(runs.count)]) for end in (np.min, np.max)
    )
    low, high, total = lows.min(axis=0), highs.max(axis=0), moments.sum(axis=0)
    away, beyond, width = np.empty(len(values)), np.empty(len(values)), high - low
    for one in range(runs.count):
        mine = runs.place == one
        middle, root = _middle_and_root((total - moments[one]) / (runs.count - 1), runs.count)
        away[mine] = np.linalg.norm((values[mine] - middle) @ root, axis=1)
        ends = np.delete(lows, one, axis=0).min(axis=0), np.delete(highs, one, axis=0).max(axis=0)
        beyond[mine] = range_excess(bounded[mine], *ends, width).max(axis=1, initial=0.0)
    middle, root = _middle_and_root(total / runs.count, runs.count)
    farthest, slack = (float(radius_at_level(band_radii(score, runs), ALARM_LEVEL)) for score in (away, beyond))
    return NoveltyAlarm(inputs, past, names, middle * scale, root / scale[:, None], farthest, limited, low, high, slack)


def _middle_and_root(moments: Array, count: int) -> tuple[Array, Array]:
    """Mean (d,) and root (d, d) of the inverse covariance, as if a tenth of a run had seen all inputs independent."""
    middle = moments[0, 1:]
    covariance = moments[1:, 1:] - np.outer(middle, middle) + np.eye(len(middle)) / (10 * count)
    values, axes = np.linalg.eigh(covariance)
    return middle, np.asarray(axes / np.sqrt(values))
