"""Commands that come half a row late: what that does to the estimates of a fit, and whether the log shows it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Dataset, pieces
from shipid.document import short_names
from shipid.identification.collinearity import digits
from shipid.identification.covariance import inverted
from shipid.identification.fit import evaluate
from shipid.identification.late import COARSE, interval_of
from shipid.identification.residuals import build
from shipid.identification.settings import unknowns
from shipid.identification.solve import Solution
from shipid.identification.statistics import Statistics
from shipid.vessel.dynamics import dynamics

Array = NDArray[np.float64]
LEAST_ROWS = 0.2  # rows by which the fit is best with earlier commands: below, the log has them in time
OUTSIDE = 1.0  # of half the interval: a larger change of an estimate is reported
WORTH = 0.02  # of a factor: a smaller change is not


@dataclass(frozen=True)
class Lateness:
    """What commands half a row earlier would do to a fit, linearised.

    between : from row to row [s]. rows : rows by which the fit is best with earlier commands. changes : (n,) of the
        factors by half a row.
    """

    between: float
    rows: float
    changes: Array


def lateness(solution: Solution, dataset: Dataset) -> Lateness | None:
    """The effect of commands half a row earlier; None where it cannot be computed.

    An order that is given between two rows is first seen in the later one. Its mean delay is half a row. The residuals
    with all commands one row earlier show what that does, and whether they become smaller.
    """
    settings = solution.settings
    between = interval_of(dataset, solution.runs)
    if settings.commands == "between" or settings.step > COARSE * between:
        return None
    problem = build(solution.vessel, _earlier(dataset), solution.runs, settings)
    at = evaluate(problem, solution.factors, solution.point).at
    shifted = at.marginal(settings.linear_from)[0]
    if shifted.shape != solution.residuals.shape or not np.isfinite(shifted).all():
        return None
    free = ~(solution.held | solution.at_bound)
    J, change = solution.jacobian[:, free], shifted - solution.residuals
    inverse = inverted(J.T @ J + np.diag(1 / solution.prior_widths[free] ** 2))[0]
    moved = -inverse @ (J.T @ change)
    left = change + J @ moved  # what no factor makes up for
    size = float(left @ left)
    changes = np.zeros(len(free))
    changes[free] = moved / 2
    return Lateness(between, -float(solution.residuals @ left) / size if size > 0 else 0.0, changes)


def late_fit(solution: Solution, dataset: Dataset, judged: Statistics) -> str:
    """A sentence where commands half a row earlier move an estimate out of its interval and fit better; else none."""
    late = lateness(solution, dataset)
    if late is None or late.rows < LEAST_ROWS:
        return ""
    half = (judged.high - judged.low) / 2
    share = np.where(np.isfinite(half) & judged.identifiable, np.abs(late.changes) / np.maximum(half, 1e-12), 0.0)
    worst = int(np.argmax(share))
    if share[worst] < OUTSIDE or abs(late.changes[worst]) < WORTH * abs(solution.factors[worst]):
        return ""
    name = short_names(unknowns(solution.vessel, solution.settings).paths)[worst]
    factor = solution.factors[worst]
    change, width = 100 * late.changes[worst] / abs(factor), 100 * half[worst] / abs(factor)
    vessel, fitted = solution.vessel, dataset.select(solution.runs)
    gear = any(
        fitted.frame[order].nunique() > 1 for order in dynamics(vessel).commands if order in dynamics(vessel).memory
    )
    remedy = f"--set commands=between{f' --set step={late.between / 2:.3g}' if gear else ''}"
    remedy = f"compare with {remedy}" if not solution.settings.outputs else "log faster"
    return (
        f"commands count from their row, on average {digits(late.between / 2)} s late, and the fit is better with "
        f"commands {late.rows:.2g} rows earlier: half a row moves {name} by {change:+.2g} %, its interval is "
        f"+-{width:.2g} %; {remedy}"
    )


def _earlier(dataset: Dataset) -> Dataset:
    """The dataset with every command one row earlier; the last of a stretch stays."""
    frame = dataset.frame.copy()
    for _, rows in pieces(dataset):
        for name in dataset.commands:
            values = rows[name].to_numpy()
            frame.loc[rows.index, name] = np.append(values[1:], values[-1:])
    return replace(dataset, frame=frame)
