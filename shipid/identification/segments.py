"""Cuts runs into segments (multiple shooting): each is one prediction from one measured state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import (
    Array,
    Dataset,
    clock_slack,
    mean_commands,
    sample_columns,
    stretch_rows,
    stretches_of_runs,
)
from shipid.data.windows import is_without_rows
from shipid.engine.casadi import memory_along
from shipid.errors import DataError, suggest_name
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

Changes = Literal["held", "between"]
"""When commands change: at the row that has them, until the next; or between that row and the one before."""
COARSE = 1.5  # rows: a longer step loses changes of the commands, and has a warning of its own


def row_interval(dataset: Dataset, runs: Sequence[str]) -> float:
    """Median time from row to row of some runs [s]."""
    rows = dataset.frame[dataset.frame["run"].isin(runs)]
    return float(rows.groupby("run", sort=False)["t"].diff().median())


def interpolate_commands(
    vessel: Vessel, rows: Mapping[str, NDArray[Any]], instants: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Commands of one unbroken stretch at instants [s] (any shape), where they change between the rows.

    An order to an actuator changes midway between two rows; a command without one goes on evenly.
    """
    t, model = np.asarray(rows["t"]), vessel_dynamics(vessel)
    nearest = np.searchsorted((t[1:] + t[:-1]) / 2, instants, side="right")
    return {
        name: np.asarray(rows[name])[nearest] if name in model.memory else np.interp(instants, t, rows[name])
        for name in model.commands
    }


def held_over_steps(
    vessel: Vessel, rows: Mapping[str, NDArray[Any]], instants: NDArray[np.float64], step: float
) -> dict[str, NDArray[np.float64]]:
    """Commands of one unbroken stretch in steps from instants (N,) [s], where they hold from row to row.

    Within a step an order to an actuator counts from the nearest begin of a step, any other command with its mean.
    """
    model, edges = vessel_dynamics(vessel), np.append(instants, instants[-1] + step)
    nearest, mean = sample_columns(rows, instants + step / 2), mean_commands(rows, edges)
    return {name: np.asarray((nearest if name in model.memory else mean)[name]) for name in model.commands}


LEAST_STEPS = 2


@dataclass(frozen=True)
class ShootingSegment:
    """Data of one prediction: an unbroken part of a run, sampled at the steps of the integrator.

    run : index into the runs of the fit.
    t : (N + 1,) [s], in equal steps.
    columns : name -> (N + 1,), states, commands and environment, SI.
    earlier : command -> (lags,) values at the steps before the segment, the latest first.
    memory : actuator state -> (N + 1,), simulated from the commands.
    measured : (N + 1,) whether a row of the log lies within half a step.
    """

    run: int
    t: Array
    columns: Mapping[str, Array]
    earlier: Mapping[str, Array]
    memory: Mapping[str, Array]
    measured: NDArray[np.bool_]

    @property
    def num_steps(self) -> int:
        """Number of integrator steps N."""
        return len(self.t) - 1


def cut_segments(
    vessel: Vessel,
    dataset: Dataset,
    runs: Sequence[str],
    step: float,
    horizon: float,
    lags: int = 0,
    overrides: Mapping[str, Mapping[str, float]] | None = None,
    commands: Changes = "held",
) -> list[ShootingSegment]:
    """Cut runs into consecutive segments of `horizon` [s]; 0: one segment for each unbroken stretch.

    Each begins at the last row that the segment before it holds; one at the end has at least half a horizon.

    step : of the integrator [s]. lags : number of earlier command values to keep.
    overrides : run -> values of `resolve_overrides`: of parameters, for its actuators, and of the environment.
    commands : `held` from each row to the next, or changing `between` rows.

    Raises DataError for an unknown run, a command that was not recorded, a run without a long enough stretch or with
    rows further apart than the horizon, or a step too long for orders that change between rows.
    """
    unknown = next((run for run in runs if run not in dataset.runs), None)
    if unknown is not None:
        raise DataError(f"there is no run {unknown!r}: {suggest_name(unknown, dataset.runs)}", path="runs")
    model = vessel_dynamics(vessel)
    missing = next((name for name in model.commands if name not in dataset.commands), None)
    if missing is not None:
        recorded = ", ".join(dataset.commands) or "none"
        raise DataError(f"{vessel.name} needs this command; the data have {recorded}", path=missing)
    result = []
    table = {name: dataset.frame[name].to_numpy() for name in map(str, dataset.frame.columns) if name != "run"}
    for run, places in stretch_rows(dataset):
        if run in runs:
            rows, own = {name: values[places] for name, values in table.items()}, (overrides or {}).get(run, {})
            result += _cut_segments(vessel, rows, own, list(runs).index(run), step, horizon, lags, commands)
    without = next((run for i, run in enumerate(runs) if not any(segment.run == i for segment in result)), None)
    if without is not None:
        wanted = _shortest_segment(step, horizon)
        half = f", half of {horizon:g} s" if horizon and wanted == horizon / 2 else ""
        message = f"{without!r} has no unbroken stretch of {wanted:g} s{half}: predict less far, or leave it out"
        raise DataError(message, path="runs")
    seen = {segment.run for segment in result if segment.measured[1:].any()}
    unseen = next((run for i, run in enumerate(runs) if i not in seen), None)
    if unseen is not None:
        message = f"rows of {unseen!r} are so far apart that no prediction of {horizon:g} s holds two of them"
        raise DataError(f"{message}: predict farther, or leave it out", path="runs")
    return sorted(result, key=lambda segment: segment.run)


def too_short(dataset: Dataset, runs: Sequence[str], step: float, horizon: float) -> list[str]:
    """Runs without a stretch that is long enough for a prediction; arguments as of `cut_segments`."""
    longest = dict.fromkeys(runs, 0)
    for run, rows in stretches_of_runs(dataset.select(runs)):
        longest[run] = max(longest[run], _num_steps(rows["t"].to_numpy(), step))
    return [run for run, count in longest.items() if count < _shortest_segment(step, horizon) / step]


def _num_steps(t: Array, step: float) -> int:
    return int((t[-1] - t[0] + clock_slack(t)) / step)


def _shortest_segment(step: float, horizon: float) -> float:
    """Shortest time [s] that is predicted: two steps, or half a horizon."""
    return max(LEAST_STEPS * step, round(horizon / step) * step / 2 if horizon else 0.0)


def near_a_row(t: Array, instants: Array, step: float) -> NDArray[np.bool_]:
    """Whether a row at t (N,) [s] of the log lies within half a step of each of some instants [s]."""
    around = np.clip(np.searchsorted(t, instants) - [[0], [1]], 0, len(t) - 1)
    return np.asarray(np.abs(t[around] - instants).min(axis=0) <= step / 2 + clock_slack(t))


def _cut_segments(
    vessel: Vessel,
    rows: Mapping[str, NDArray[Any]],
    overrides: Mapping[str, float],
    run: int,
    step: float,
    horizon: float,
    lags: int,
    between: Changes,
) -> list[ShootingSegment]:
    t = rows["t"]
    count = _num_steps(t, step)
    each = round(horizon / step) if horizon else max(count, 1)
    least = _shortest_segment(step, horizon) / step
    if count < least:
        return []
    grid = t[0] + step * np.arange(count + 1)
    columns = sample_columns(rows, grid)
    measured = near_a_row(t, grid, step)
    if between == "between":
        _check_step(vessel, rows, step)
        columns |= interpolate_commands(vessel, rows, grid + step / 2)  # as they are in the middle of each step
    elif step <= COARSE * float(np.median(np.diff(t))):
        columns |= held_over_steps(vessel, rows, grid, step)
    commands = {name: columns[name] for name in vessel_dynamics(vessel).commands}
    numbers = {path: x for path, x in overrides.items() if path in vessel.parameters}
    memory = memory_along(vessel.with_values(numbers) if numbers else vessel, commands, grid) or {}
    columns |= {path.partition(".")[2]: np.full(len(grid), overrides[path]) for path in overrides.keys() - numbers}
    result, begin = [], 0
    beginnings = measured & ~is_without_rows(t, grid, step)  # a state between two rows is no beginning
    while begin < count:
        last = min(begin + each, count)
        first = begin + int(np.argmax(beginnings[begin : last + 1]))
        seen = first + 1 + np.flatnonzero(measured[first + 1 : last + 1])
        begin = int(seen[-1]) if len(seen) else last  # no time from row to row is left out
        if last - first < least or not beginnings[first]:
            continue
        here = slice(first, last + 1)
        past = np.clip(first - 1 - np.arange(lags), 0, None)
        result.append(
            ShootingSegment(
                run,
                grid[here],
                {name: np.asarray(values[here], dtype=float) for name, values in columns.items()},
                {name: values[past] for name, values in commands.items()},
                {name: values[here] for name, values in memory.items()},
                measured[here],
            )
        )
    return result


def _check_step(vessel: Vessel, rows: Mapping[str, NDArray[Any]], step: float) -> None:
    """Raise DataError for steps too long for orders to actuators that change in the middle between two rows."""
    interval = float(np.median(np.diff(rows["t"])))
    if step <= interval / 2 + clock_slack(rows["t"]):
        return
    model = vessel_dynamics(vessel)
    name = next((name for name in model.commands if name in model.memory and np.ptp(rows[name]) > 0), None)
    if name is not None:
        message = f"{step:g} s: orders to the actuator of {name} change in the middle between rows, which are"
        raise DataError(f"{message} {interval:.3g} s apart: give at most {interval / 2:.3g}", path="step")
