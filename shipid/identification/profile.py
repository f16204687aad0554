"""Profile likelihood: how much worse the best fit becomes when one factor is held away from its estimate.

For a factor f it is (C(f) - C_min) / s^2, C(f) the least objective over all other factors, priors included, and s^2 the
variance of the residuals over the declared one. The 95 % interval holds all f with at most t^2, t the quantile of
Student's distribution; a side on which the profile stays below is open, the factor not identified there. Of coloured
residuals s^2 is the ratio of the robust to the plain variance of that factor (`variance_ratio`; Chandler and Bate).

Sources: Raue et al., Bioinformatics 25 (2009) 1923; Bates, Watts, Nonlinear Regression Analysis (1988), ch. 6;
Chandler, Bate, Biometrika 94 (2007) 167.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from shipid.data.dataset import Array
from shipid.identification.statistics import LEVEL, Statistics

Refit = Callable[[str, float, Array], tuple[float, Array]]
"""(path, value at which its factor is held, factors to start from (n,)) -> objective, factors (n,)."""

STEP, GROWTH = 0.5, 1.5  # first step in half-widths of the linear interval, and what each next one is of it
MOST_REFITS = 12  # on each side
NEAR = 0.02  # of t: so near an end must lie to the limit of the profile
FARTHEST = 10.0  # of the base value, or of a larger estimate: how far from its estimate a factor without bounds goes


@dataclass(frozen=True)
class Profile:
    """Profile of one factor.

    values, rises : factors held and (C - C_min) / s^2, rising in values. limit : t^2.
    low, high : 95 % interval; -inf or inf on a side that is open.
    sentence : the interval in words, with what is open.
    """

    path: str
    values: Array
    rises: Array
    limit: float
    low: float
    high: float
    sentence: str


def profile_table(curve: Profile) -> pd.DataFrame:
    """The points of a profile: `factor`, `rise`, and in every row `path`, `limit`, `sentence`."""
    points = pd.DataFrame({"factor": curve.values, "rise": curve.rises})
    return points.assign(path=curve.path, limit=curve.limit, sentence=curve.sentence)


@dataclass
class _Curve:
    """Points of a profile so far.

    points : value of the factor -> objective, infinite where the refit failed, and factors (n,) of its refit.
    """

    path: str
    refit: Refit
    ratio: float
    points: dict[float, tuple[float, Array]] = field(default_factory=dict)

    @property
    def sound(self) -> list[float]:
        """Values whose refit succeeded, rising."""
        return sorted(value for value, (objective, _) in self.points.items() if np.isfinite(objective))

    @property
    def least(self) -> float:
        return min(objective for objective, _ in self.points.values())

    def rise(self, value: float) -> float:
        """(C - C_min) / s^2 with the factor held at `value`; infinite where the refit fails.

        The refit begins at the factors of the nearest known point.
        """
        if value not in self.points:
            start = self.points[min(self.sound, key=lambda known: abs(known - value))][1]
            objective, factors = self.refit(self.path, value, start)
            self.points[value] = objective if np.isfinite(objective) else float("inf"), factors
        return max((self.points[value][0] - self.least) / self.ratio, 0.0)


def profile_factor(
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
    unit: str = "its base value",
) -> Profile:
    """The profile of one factor, from the estimate to both sides, until it leaves the 95 % interval.

    path : name of the factor. factors, index, objective : the estimate (n,), place of the factor, objective there.
    refit : fits the other factors with this one held. half_width : of the linear 95 % interval. freedom : of t.
    ratio : s^2. bounds : of the factor. unit : what the factor is relative to, in words.
    """
    curve = _Curve(path, refit, ratio, {float(factors[index]): (objective, np.asarray(factors, dtype=float))})
    limit = float(stdtrit(freedom, 0.5 + LEVEL / 2) ** 2)
    far = FARTHEST * max(1.0, abs(float(factors[index])))
    step = STEP * (half_width if 0 < half_width < far else 1.0)
    ends: dict[int, float] = {}
    least = np.inf
    while curve.least < least * (1 - 1e-6) - 1e-9 or not ends:  # again if a refit improves on the estimate
        least = curve.least
        centre = min(curve.points, key=lambda value: curve.points[value][0])
        for side, bound in ((-1, bounds[0]), (1, bounds[1])):
            farthest = bound if np.isfinite(bound) else centre + side * far
            ends[side] = _profile_crossing(curve, centre, side, step, limit, farthest)
    values = np.array(curve.sound)
    rises = np.array([curve.rise(value) for value in values])
    best = float(values[np.argmin(rises)])
    moved = (objective - curve.least) / ratio > 0.01 * limit
    tried = tuple(f"{value:.4g}{' (its bound)' * (value in bounds)}" for value in (values[0], values[-1]))
    sentence = _profile_sentence(path, unit, ends[-1], ends[1], tried, best if moved else None)
    failed = len(curve.points) - len(values)
    sentence += f"; {failed} refits failed and count as outside" if failed else ""
    return Profile(path, values, rises, limit, ends[-1], ends[1], sentence)


def _profile_crossing(curve: _Curve, estimate: float, side: int, step: float, limit: float, farthest: float) -> float:
    """Value of the factor where the profile crosses the limit on one side (-1 or 1); infinite if it stays below.

    Growing steps bracket it, then regula falsi on sqrt(profile), nearly linear in the factor.
    """
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
        middle = np.sqrt(curve.rise(value))
        if abs(middle - root) <= NEAR * root or abs(outside - inside) <= 1e-6 * max(abs(value), 1.0):
            break
        inside, outside = (value, outside) if middle < root else (inside, value)
    return float(value)


def _profile_sentence(path: str, unit: str, low: float, high: float, tried: Sequence[str], best: float | None) -> str:
    """One sentence with the interval, open sides with the farthest value tried, and a better fit if there is one."""
    fitted = "the data are fitted as well"
    if np.isfinite(low) and np.isfinite(high):
        sentence = f"{path} lies between {low:.4g} and {high:.4g} times {unit}"
    elif np.isfinite(low):
        sentence = f"{path} is above {low:.4g} times {unit}; upwards it is open: at {tried[1]} {fitted}"
    elif np.isfinite(high):
        sentence = f"{path} is below {high:.4g} times {unit}; downwards it is open: at {tried[0]} {fitted}"
    else:
        sentence = f"{path} is not identified: from {tried[0]} to {tried[1]} times {unit} {fitted}"
    return (
        sentence if best is None else f"{sentence}; the fit had not converged: {best:.4g} fits better than the estimate"
    )


def variance_ratio(judged: Statistics, path: str) -> float:
    """s^2 for the profile of one factor: its variance in the chosen form, over that for the declared deviations."""
    j = judged.free.index(path)
    return float(judged.errors[judged.fit.free[j]] ** 2 / judged.basis.inverse[j, j])
