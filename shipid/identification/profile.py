"""Profile likelihood: how much worse the best fit becomes when one factor is held away from its estimate.

For a factor f the profile is (C(f) - C_min) / s^2, with C(f) the least objective (the sum of squares of the whitened
residuals, priors included) over all other factors, and s^2 the variance of the residuals over the declared one.
The 95 % interval holds all f whose profile is at most t^2, t the quantile of Student's distribution. Where the problem
is linear it is the interval of the standard error; where it is not, it need be neither symmetric nor finite: a side on
which the profile stays below t^2 is open, and the factor is not identified on that side.

Coloured residuals count more than they are worth: s^2 is then the ratio of the robust to the plain variance of that
factor (`variance_ratio`), the vertical correction of Chandler and Bate.

Sources: Raue et al., Bioinformatics 25 (2009) 1923; Bates, Watts, Nonlinear Regression Analysis (1988), ch. 6;
Chandler, Bate, Biometrika 94 (2007) 167.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from shipid.identification.statistics import LEVEL, Statistics, declared_error

Array = NDArray[np.float64]
Refit = Callable[[str, float, Array], tuple[float, Array]]
"""(path, value at which its factor is held, factors to start from (n,)) -> objective, factors (n,)."""

STEP, GROWTH = 0.5, 1.5  # first step in half-widths of the linear interval, and what each next one is of it
MOST_REFITS = 12  # on each side
NEAR = 0.02  # of t: so near an end must lie to the limit of the profile
FARTHEST = 10.0  # base values, the farthest that a factor without bounds is taken from its estimate


@dataclass(frozen=True)
class Profile:
    """Profile of one factor.

    values, rises : factors held and (C - C_min) / s^2, rising in values. limit : t^2.
    low, high : 95 % interval; -inf or inf on a side that is open. failed : refits that gave no finite objective.
    sentence : the interval in words, with what is open.
    """

    path: str
    values: Array
    rises: Array
    limit: float
    low: float
    high: float
    failed: int
    sentence: str


@dataclass
class _Curve:
    """Points of the profile: what has been asked of `refit`, best objective so far."""

    path: str
    refit: Refit
    ratio: float
    points: dict[float, tuple[float, Array]] = field(default_factory=dict)
    failed: set[float] = field(default_factory=set)

    @property
    def least(self) -> float:
        return min(objective for objective, _ in self.points.values())

    def rise(self, value: float) -> float:
        """Profile at a value, refitted from the nearest point; infinite where the refit fails."""
        if value in self.failed:
            return float("inf")
        if value not in self.points:
            nearest = min(self.points, key=lambda own: abs(own - value))
            start = self.points[nearest][1]
            objective, factors = self.refit(self.path, value, start)
            if not np.isfinite(objective):
                self.failed.add(value)
                return float("inf")
            self.points[value] = objective, factors
        return max((self.points[value][0] - self.least) / self.ratio, 0.0)


def profile(
    path: str,
    factors: Array,
    index: int,
    objective: float,
    refit: Refit,
    *,
    half_width: float,
    freedom: float,
    ratio: float = 1.0,
    bounds: tuple[float, float] = (-np.inf, np.inf),
) -> Profile:
    """Follow the profile of one factor from the estimate to both sides until it leaves the 95 % interval.

    Parameters
    ----------
    factors, index, objective : the estimate (n,), which of them is held, and the objective there.
    half_width, freedom : of the linear interval, for the first step, and of t (`Statistics.chosen`).
    ratio : s^2, variance of the residuals over the declared one, or `variance_ratio`.
    bounds : of the factor.
    """
    curve = _Curve(path, refit, ratio, {float(factors[index]): (objective, np.asarray(factors, dtype=float))})
    limit = float(stats.t.ppf(0.5 + LEVEL / 2, freedom) ** 2)
    step = STEP * (half_width if 0 < half_width < FARTHEST else 1.0)
    ends: dict[int, float] = {}
    least = np.inf
    while curve.least < least * (1 - 1e-6) - 1e-9 or not ends:  # anew where a better fit is found on the way
        least = curve.least
        centre = min(curve.points, key=lambda value: curve.points[value][0])
        for side, bound in ((-1, bounds[0]), (1, bounds[1])):
            ends[side] = _end(curve, centre, side, step, limit, bound)
    values = np.array(sorted(curve.points))
    rises = np.array([curve.rise(value) for value in values])
    best = float(values[np.argmin(rises)])
    moved = (objective - curve.least) / ratio > 0.01 * limit
    sentence = _sentence(path, ends[-1], ends[1], (float(values[0]), float(values[-1])), best if moved else None)
    if curve.failed:
        sentence += f"; {len(curve.failed)} refits failed and count as outside"
    return Profile(path, values, rises, limit, ends[-1], ends[1], len(curve.failed), sentence)


def _end(curve: _Curve, estimate: float, side: int, step: float, limit: float, bound: float) -> float:
    """Where the profile crosses the limit on one side: outwards by growing steps, then regula falsi on its root.

    sqrt(profile) is nearly linear in the factor, so few refits do. Infinite where it stays below.
    """
    farthest = bound if np.isfinite(bound) else estimate + side * FARTHEST
    inside, outside, value = estimate, None, estimate
    for _ in range(MOST_REFITS):
        value = value + side * step
        value = min(value, farthest) if side > 0 else max(value, farthest)
        if curve.rise(value) > limit:
            outside = value
            break
        inside = value
        if value == farthest:
            return side * float("inf")
        step *= GROWTH
    if outside is None:
        return side * float("inf")
    root = np.sqrt(limit)
    for _ in range(MOST_REFITS):
        low, high = np.sqrt(curve.rise(inside)), np.sqrt(curve.rise(outside))
        share = (root - low) / (high - low) if np.isfinite(high) else 0.5
        value = inside + float(np.clip(share, NEAR, 1 - NEAR)) * (outside - inside)
        found = np.sqrt(curve.rise(value))
        if abs(found - root) <= NEAR * root or abs(outside - inside) <= 1e-6 * max(abs(value), 1.0):
            break
        inside, outside = (value, outside) if found < root else (inside, value)
    return float(value)


def _sentence(path: str, low: float, high: float, tried: tuple[float, float], best: float | None) -> str:
    """The interval in words."""
    if np.isfinite(low) and np.isfinite(high):
        told = f"{path} lies between {low:.4g} and {high:.4g} times its base value"
    elif np.isfinite(low):
        told = f"{path} is above {low:.4g}; upwards it is open: at {tried[1]:.4g} the data are fitted as well"
    elif np.isfinite(high):
        told = f"{path} is below {high:.4g}; downwards it is open: at {tried[0]:.4g} the data are fitted as well"
    else:
        told = f"{path} is not identified: from {tried[0]:.4g} to {tried[1]:.4g} the data are fitted as well"
    return told if best is None else f"{told}; the fit had not ended: {best:.4g} is better than the estimate"


def variance_ratio(found: Statistics, path: str) -> float:
    """s^2 of one factor's profile: its variance in the chosen form, over that under the declared deviations."""
    j = found.fit.paths.index(path)
    return float((found.errors[j] / declared_error(found.fit, path)) ** 2)
