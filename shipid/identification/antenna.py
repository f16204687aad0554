"""Logs of an antenna away from the origin of the vessel: where it looks to be, and what that does to the estimates."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shipid.data.dataset import Array, Dataset
from shipid.document import short_names
from shipid.identification.covariance import invert_information
from shipid.identification.late_fit import OUTSIDE
from shipid.identification.settings import free_factors
from shipid.identification.solution import Solution
from shipid.identification.solve import by_log, identify
from shipid.identification.statistics import LinearFit, Statistics, fit_statistics
from shipid.logs.repairs import HeadingOffset, LeverArm, move_origin, turn_heading
from shipid.units import join_names, percent_text, significant_digits

AHEAD, ABEAM = ("antenna.x", "antenna.y")  # unknowns beside the factors, in lengths of the ship
ARM = 0.1  # of the length: by which the log is moved for the derivatives
OFF = 0.02  # [rad] by which the heading is turned for the derivatives
REFITS = 2  # with the log moved from the antenna to the origin
NEAREST, FARTHEST, WIDEST = 0.1, 0.6, 0.25  # of the length: from the origin; ahead or astern; to a side
NEGLIGIBLE = 0.02  # of the length: a way that the sentence leaves out
CERTAIN = 2.5  # half-widths of its 95 % interval: so far from the origin an antenna is not chance
WORTH, EXPLAINED = 0.1, 0.3  # of the squares of the residuals: less is not fitted again; less has been a wrong vessel


@dataclass(frozen=True)
class Antenna:
    """The point of the ship that the log looks to be of.

    x, y : [m] ahead and to starboard of the origin. certain : the larger of both in half-widths of its 95 % interval.
    explained : share of the squares of the residuals that it takes away. factors : (n,) estimates with it.
    """

    x: float
    y: float
    certain: float
    explained: float
    factors: Array

    @property
    def shown(self) -> bool:
        """Whether it is more than chance, and more than a vessel that is a little wrong."""
        return self.certain >= CERTAIN and self.explained >= EXPLAINED


def locate_antenna(solution: Solution, dataset: Dataset) -> Antenna | None:
    """The point that the log looks to be of; None where it is estimated already, or cannot be computed.

    A step of Gauss-Newton is fitted again with the log moved to the origin.
    """
    length = solution.vessel.length
    if length is None or "lever_arm" in solution.settings.widths:
        return None
    seen, total = step_antenna(solution, dataset, length), _sum_of_squares(solution)
    for _ in range(REFITS):
        if seen is None or seen.certain < CERTAIN or seen.explained < WORTH:
            return seen
        moved = _to_origin(dataset, seen.x, seen.y)
        again = identify(solution.vessel, moved, solution.runs, solution.settings)
        more = step_antenna(again, moved, length, (seen.x, seen.y)) if again.status == "ok" else None
        explained = 1 - _sum_of_squares(again) / total
        seen = None if more is None else replace(more, explained=explained, factors=again.factors)
    return seen


def step_antenna(
    solution: Solution, dataset: Dataset, length: float, at: tuple[float, float] = (0.0, 0.0)
) -> Antenna | None:
    """The point after one step of Gauss-Newton with the factors; None where predictions diverge, or rows are too few.

    At (x, y) the ship goes u - y r along and v + x r across. at : [m] from where the log has been moved to the origin.
    """
    free = ~(solution.held | solution.at_bound)
    arms = ((ARM * length, 0.0), (0.0, ARM * length))
    changes = [by_log(solution, dataset, _to_origin(dataset, *arm)) for arm in arms]
    added = np.array([change / ARM for change in changes if change is not None]).T
    if added.shape != (len(solution.residuals), 2) or len(added) <= free.sum() + 2:
        return None
    J = np.hstack([solution.jacobian[:, free], added])
    prior = np.append(solution.prior_widths[free], [np.inf, np.inf])
    inverse = invert_information(J.T @ J + np.diag(1 / prior**2))[0]
    step = -inverse[:, -2:] @ (added.T @ solution.residuals)  # the factors are at their optimum
    left = solution.residuals + J @ step
    paths = (*np.array(solution.paths)[free].tolist(), AHEAD, ABEAM)
    factors = np.append(solution.factors[free], np.array(at) / length) + step
    clusters, signals = solution.clusters, solution.signals
    judged = fit_statistics(
        LinearFit(paths, factors, left, J, clusters, signals, prior, solution.spent, runs=solution.runs)
    )
    half = (judged.high - judged.low)[-2:] / 2
    sizes = np.where(np.isfinite(half), np.abs(factors[-2:]) / np.maximum(half, 1e-12), 0.0)
    total, every = float(solution.residuals @ solution.residuals), solution.factors.copy()
    every[free] = factors[:-2]
    explained = 1 - float(left @ left) / total if total > 0 else 0.0
    x, y = (length * factors[-2:]).tolist()
    return Antenna(x, y, float(sizes.max()), explained, every)


def heading_share(solution: Solution, dataset: Dataset) -> float:
    """Share of the squares of the residuals that a heading which is off takes away, by one step of Gauss-Newton."""
    free = ~(solution.held | solution.at_bound)
    change = by_log(solution, dataset, _rotate_log(dataset, OFF))
    total = float(solution.residuals @ solution.residuals)
    if change is None or not total > 0:
        return 0.0
    added = change / OFF
    J = np.column_stack([solution.jacobian[:, free], added])
    inverse = invert_information(J.T @ J + np.diag(np.append(solution.prior_widths[free], np.inf) ** -2.0))[0]
    left = solution.residuals - J @ (inverse[:, -1] * float(added @ solution.residuals))
    return 1 - float(left @ left) / total


def _rotate_log(dataset: Dataset, angle: float) -> Dataset:
    """The log with the heading turned by an angle [rad]; the velocity over ground is unchanged."""
    repair = HeadingOffset(kind="heading_offset", reason="a trial", offset=angle)
    return replace(dataset, frame=turn_heading(dataset.frame, repair).rows)


def _sum_of_squares(solution: Solution) -> float:
    """Sum of the squares of the residuals; with huber of what each counts as, whatever share is within."""
    shares = np.array([solution.within[name] for name in solution.signals])
    return float((shares * solution.residuals) @ solution.residuals)


def _to_origin(dataset: Dataset, x: float, y: float) -> Dataset:
    rows = move_origin(dataset.frame, LeverArm(kind="lever_arm", reason="a trial", x=x, y=y)).rows
    return replace(dataset, frame=rows)


def antenna_fit(solution: Solution, dataset: Dataset, judged: Statistics) -> str:
    """A sentence where the log looks like that of an antenna away from the origin; else none."""
    seen, length = locate_antenna(solution, dataset), solution.vessel.length
    if seen is None or length is None or not seen.shown:
        return ""
    far = np.hypot(seen.x, seen.y) >= NEAREST * length
    if not far or abs(seen.x) > FARTHEST * length or abs(seen.y) > WIDEST * length:
        return ""
    if heading_share(solution, dataset) >= seen.explained:  # a heading that is off explains as much
        return ""
    half, changes = (judged.high - judged.low) / 2, seen.factors - solution.factors
    share = np.where(np.isfinite(half), np.abs(changes) / np.maximum(half, 1e-12), 0.0)
    worst = int(np.argmax(share))
    size, moves = abs(solution.factors[worst]), ""
    if share[worst] >= OUTSIDE and size > 0:
        name = short_names(free_factors(solution.vessel, solution.settings).paths)[worst]
        change, width = 100 * changes[worst] / size, 100 * half[worst] / size
        moves = f" and moves {name} by {significant_digits(change, 2, '+')} %, "
        moves += f"its interval is +-{significant_digits(width, 2)} %"
    ways = ((seen.x, "ahead", "astern"), (seen.y, "to starboard", "to port"))
    parts = [
        f"{significant_digits(abs(size), 2)} m {there if size > 0 else back}"
        for size, there, back in ways
        if abs(size) >= NEGLIGIBLE * length
    ]
    remedy = "if so,"
    if abs(seen.x) > abs(seen.y):
        remedy = f"compare with --nuisance lever_arm={significant_digits(abs(seen.x), 2)}, or"
    return (
        f"the log looks like that of an antenna about {join_names(parts)} of the vessel's origin: that takes "
        f"{percent_text(seen.explained)} of the squares of the residuals away{moves}; {remedy} give the place as a "
        "lever_arm in the mapping, and import again"
    )
