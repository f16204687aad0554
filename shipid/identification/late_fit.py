"""Commands that come late or early: what that does to the estimates of a fit, and whether the log shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shipid.data.dataset import Array, Dataset, stretches_of_runs
from shipid.document import short_names
from shipid.identification.covariance import invert_information
from shipid.identification.late import COARSE, row_interval
from shipid.identification.settings import free_factors
from shipid.identification.solution import Solution
from shipid.identification.solve import by_log
from shipid.identification.statistics import Statistics
from shipid.units import significant_digits
from shipid.vessel.dynamics import vessel_dynamics

HALF = 0.5  # rows by which commands that change between rows and are held from their row are late on average
LEAST_ROWS = 0.2  # rows by which the fit is best with earlier commands: below, the log has them in time
FARTHER = 0.5  # rows more or less than rows explain: the log, or an actuator, has another delay
EXPLAINED = 0.15  # of the squares of the residuals: more than noise, wind or current has looked like a delay
OUTSIDE = 1.0  # of half the interval: a larger change of an estimate is reported
WORTH = 0.02  # of a factor: a smaller change is not


@dataclass(frozen=True)
class Lateness:
    """What commands half a row earlier would do to a fit, linearised.

    between : from row to row [s]. rows : rows by which the fit is best with earlier commands. changes : (n,) of the
        factors by half a row. explained : share of the squares of the residuals that those rows take away.
    """

    between: float
    rows: float
    changes: Array
    explained: float


def command_lateness(solution: Solution, dataset: Dataset) -> Lateness | None:
    """The effect of commands half a row earlier, by the residuals with all one row earlier; None where it cannot be."""
    settings = solution.settings
    between = row_interval(dataset, solution.runs)
    if settings.step > COARSE * between:
        return None
    change = by_log(solution, dataset, _advance_commands(dataset))
    if change is None:
        return None
    free = ~(solution.held | solution.at_bound)
    J = solution.jacobian[:, free]
    inverse = invert_information(J.T @ J + np.diag(1 / solution.prior_widths[free] ** 2))[0]
    moved = -inverse @ (J.T @ change)
    left = change + J @ moved  # what no factor makes up for
    size, along = float(change @ left), float(solution.residuals @ change)  # the factors are at their optimum
    changes = np.zeros(len(free))
    changes[free] = HALF * moved
    if not size > 0:
        return Lateness(between, 0.0, changes, 0.0)
    total = float(solution.residuals @ solution.residuals)
    return Lateness(between, -along / size, changes, along**2 / (size * total) if total > 0 else 0.0)


def late_fit(solution: Solution, dataset: Dataset, judged: Statistics) -> str:
    """A sentence where commands at another time move an estimate out of its interval and fit better; else none."""
    late = command_lateness(solution, dataset)
    if late is None:
        return ""
    held = solution.settings.commands == "held"
    apart = not -FARTHER <= late.rows <= (HALF if held else 0.0) + FARTHER
    if not apart and (not held or late.rows < LEAST_ROWS):
        return ""
    changes = late.changes * (late.rows / HALF if apart else 1.0)
    half = (judged.high - judged.low) / 2
    share = np.where(np.isfinite(half) & judged.identifiable, np.abs(changes) / np.maximum(half, 1e-12), 0.0)
    worst = int(np.argmax(share))
    shown = share[worst] >= OUTSIDE or (apart and late.explained >= EXPLAINED)
    if not shown or abs(changes[worst]) < WORTH * abs(solution.factors[worst]):
        return ""
    name = short_names(free_factors(solution.vessel, solution.settings).paths)[worst]
    factor = solution.factors[worst]
    change, width = 100 * changes[worst] / abs(factor), 100 * half[worst] / abs(factor)
    moves = f"moves {name} by {change:+.2g} %, its interval is +-{width:.2g} %"
    gear = _actuated_commands(solution, dataset)
    if apart:
        rows, seconds = abs(late.rows), significant_digits(abs(late.rows) * late.between)
        when = f"{seconds} s ({rows:.2g} rows) {'earlier' if late.rows > 0 else 'later'} than in the log: that {moves}"
        return f"the fit is better with commands {when}; {_lateness_causes(late.rows > 0, gear)}"
    remedy = f"--set commands=between{f' --set step={late.between / 2:.3g}' if gear else ''}"
    remedy = f"compare with {remedy}" if not solution.settings.outputs else "log faster"
    return (
        f"commands count from their row, on average {significant_digits(late.between / 2)} s late, and the fit "
        f"is better with commands {late.rows:.2g} rows earlier: half a row {moves}; {remedy}"
    )


def _actuated_commands(solution: Solution, dataset: Dataset) -> list[str]:
    """Commands to actuators of the vessel that change in the fitted runs."""
    model, fitted = vessel_dynamics(solution.vessel), dataset.select(solution.runs)
    return [name for name in model.commands if name in model.memory and fitted.frame[name].nunique() > 1]


def _lateness_causes(late: bool, gear: Sequence[str]) -> str:
    if not late:
        lag = "an actuator of the vessel is too fast" if gear else "the vessel lacks an actuator"
        return f"{lag}, or the log has the motion late: compare with --nuisance latency"
    if not gear:
        return "the log has its commands late, as a feedback may be: shift their columns"
    actuators = " and ".join(f"thruster.{name.replace('.', '.actuator.')}" for name in gear)
    return (
        f"the log has measured angles and no orders ({actuators}: off = true), an actuator is too slow, or the log has "
        "its commands late"
    )


def _advance_commands(dataset: Dataset) -> Dataset:
    """The dataset with every command one row earlier; the last of a stretch stays."""
    frame = dataset.frame.copy()
    for _, rows in stretches_of_runs(dataset):
        for name in dataset.commands:
            values = rows[name].to_numpy()
            frame.loc[rows.index, name] = np.append(values[1:], values[-1:])
    return replace(dataset, frame=frame)
