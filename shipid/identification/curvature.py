"""Curvature of a fit: whether the linear 95 % interval of a factor holds, by one step of its profile on each side.

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

import numpy as np

from shipid.data.dataset import Array, Dataset
from shipid.document import short_names
from shipid.identification.fit import Solution, local_linearisation
from shipid.identification.residuals import build_problem
from shipid.identification.statistics import Statistics
from shipid.units import join_names

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


def interval_end_ratios(judged: Statistics, at: Beside, profiled: Sequence[str] = ()) -> dict[str, tuple[float, float]]:
    """Factor -> how many times as far its lower and upper end are from the estimate as those of its interval.

    Of identified factors, but those with a narrow interval or `profiled`; at most `MOST`. 0 where a prediction
    diverges.
    """
    fit, wide = judged.fit, _wide_factors(judged, profiled)
    if not wide:
        return {}
    places, inverse = fit.free, judged.basis.inverse
    least = float(np.square(at(np.zeros(len(fit.paths)))[0]).sum())
    result = {}
    for j in wide:
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
