"""Profile likelihood: how much worse the best fit becomes when one factor is held away from its estimate.

For a factor f it is (C(f) - C_min) / s^2, C(f) the least objective over all other factors, priors included, and s^2 the
variance of the residuals over the declared one. The 95 % interval holds all f with at most t^2, t the quantile of
Student's distribution; a side on which the profile stays below is open, the factor not identified there. Of coloured
residuals s^2 is the ratio of the robust to the plain variance of that factor (`variance_ratio`; Chandler and Bate).

Sources: Raue et al., Bioinformatics 25 (2009) 1923; Bates, Watts, Nonlinear Regression Analysis (1988), ch. 6;
Chandler, Bate, Biometrika 94 (2007) 167.

**Curvature.** Whether the linear 95 % interval of a factor holds is seen by one step of its profile on each side.

The factor is moved to an end of its interval, the others with it along their regression on it. The fit is linearised
there: residuals e, Jacobian J_o of the others. After a step of Gauss-Newton of these the objective |e|^2 - |P e|^2, P
the projection on J_o, has risen by h^2 / a where the problem is linear (h the half-width, a the variance of the factor
for the declared deviations). Where it rises by q times that, the end is about 1 / sqrt(q) times as far. This costs one
prediction of all runs for each end.

Sources: Bates, Watts, Journal of the Royal Statistical Society B 42 (1980) 1, and Nonlinear Regression Analysis (1988),
ch. 6 (profile t); Cook, Witmer, The American Statistician 39 (1985) 119 (parameters one by one); Donaldson, Schnabel,
Technometrics 29 (1987) 67 (linear intervals of curved problems cover too little).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from shipid.data.dataset import Array, Dataset
from shipid.document import short_names
from shipid.identification.fit import Solution, local_linearisation
from shipid.identification.residuals import build_problem
from shipid.identification.statistics import LEVEL, Statistics
from shipid.units import join_names

Refit = Callable[[str, float, Array], tuple[float, Array]]
"""(path, value at which its factor is held, factors to start from (n,)) -> objective, factors (n,)."""

STEP, GROWTH = 0.5, 1.5  # first step in half-widths of the linear interval, and what each next one is of it
MOST_REFITS = 12  # on each side
NEAR = 0.02  # of t: so near an end must lie to the limit of the profile
FARTHEST = 10.0  # of the base value, or of a larger estimate: how far from its estimate a factor without bounds goes
Beside = Callable[[Array], tuple[Array, Array]]
"""Change of the factors (n,) from the estimate -> residuals (m,) and Jacobian (m, n) there, priors included."""

SHORT = 1.2  # times as far as the linear end, from which on an interval is too short
NARROW = 0.1
"""Of the factor: intervals of a smaller half-width are not looked at, which saves two predictions each. The end of a
fit as curved as exp(factor) belongs 1.05 times as far there; for SHORT it has to be four times as curved."""
MOST = 3.0
"""Times as far, at most. Beyond it the squares rise by less than a ninth of h^2 / a: the profile is so flat there that
it may as well be open, and the rise, the difference of two sums of squares, may be 0 or below by rounding."""
RANK = 1e-9  # relative, of a Jacobian


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


def interval_end_ratios(judged: Statistics, at: Beside, profiled: Sequence[str] = ()) -> dict[str, tuple[float, float]]:
    """Factor -> how many times as far its lower and upper end are from the estimate as those of its interval.

    Of identified factors, but those with a narrow interval or `profiled`; at most `MOST`. 0 where a prediction
    diverges.
    """
    fit, places, inverse = judged.fit, judged.fit.free, judged.basis.inverse
    least = float(np.square(at(np.zeros(len(fit.paths)))[0]).sum())
    result = {}
    for j in _wide_factors(judged, profiled):
        half, variance = float(judged.high[places[j]] - fit.factors[places[j]]), float(inverse[j, j])
        times = []
        for side in (-1, 1):
            change = np.zeros(len(fit.paths))
            change[places] = side * half * inverse[:, j] / variance
            e, slopes = at(change)
            share = (_squares_after_step(e, slopes[:, np.delete(places, j)]) - least) * variance / half**2
            times.append(share**-0.5 if share > MOST**-2 else MOST)
        result[judged.free[j]] = (times[0], times[1])
    return result


def _squares_after_step(e: Array, J: Array) -> float:
    """Sum of the squares of e (m,) after one step of Gauss-Newton with J (m, k); infinite where it diverges."""
    if not (np.isfinite(e).all() and np.isfinite(J).all()):
        return float("inf")
    size = np.linalg.norm(J, axis=0)
    scaled = J / np.where(size > 0, size, 1.0)
    return float(np.square(e - scaled @ np.linalg.lstsq(scaled, e, rcond=RANK)[0]).sum())


def curvature_sentence(judged: Statistics, seen: Mapping[str, tuple[float, float]]) -> str:
    """Name the factors whose intervals end too early, and by how much; empty for none. seen : `interval_end_ratios`."""
    names = dict(zip(judged.fit.paths, short_names(judged.fit.paths), strict=True))
    short = [
        (times, path, f"{names[path]} {side} {times:.2g}")
        for path, both in seen.items()
        for side, times in zip(("downwards", "upwards"), both, strict=True)
        if times > SHORT
    ]
    if not short:
        return ""
    return (
        "the fit is not linear, and these intervals end too early; their ends are at least so many times as far from "
        f"the estimates: {join_names([words for _, _, words in short])}; compare with --profile {max(short)[1]}, or "
        "fit runs whose commands vary more"
    )


def curvature_warning(solution: Solution, dataset: Dataset, judged: Statistics, profiled: Sequence[str] = ()) -> str:
    """The sentence on intervals that are too short; none: empty. profiled : factors that have a profile."""
    if not _wide_factors(judged, profiled):
        return ""
    problem = build_problem(solution.vessel, dataset, solution.runs, solution.settings)
    at = local_linearisation(problem, solution.factors, solution.point)
    return curvature_sentence(judged, interval_end_ratios(judged, at, profiled))


def _wide_factors(judged: Statistics, profiled: Sequence[str]) -> list[int]:
    """Places among the free factors of those that are identified, not profiled, with intervals that are not narrow."""
    half, size = judged.high - judged.fit.factors, np.abs(judged.fit.factors)
    wide = judged.identifiable & (half > NARROW * size)
    return [j for j, place in enumerate(judged.fit.free) if wide[place] and judged.free[j] not in profiled]
