"""Direct (Dieudonne) spiral: yaw rate over helm, and the loop of an unstable ship."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shipid.measures.record import NAN, Array, Measures, Record, find_plateaus, settled_mean
from shipid.measures.turning import MIDSHIPS
from shipid.units import DEGREE

LEVEL_HELM, LEVEL_SHARE = 0.5 * DEGREE, 0.02  # closer helm angles are one level, and such a share of the greatest one
QUIET_SHARE, HELM_SCATTER = 0.9, 3.0  # of the changes from row to row, and how far such changes scatter about a level
NARROWEST_LOOP = 0.01  # of the distance of levels: a narrower loop is what is left of turns that were not quite steady
ONE_SIDE = "the ship turns to one side at every helm angle"


@dataclass(frozen=True, eq=False)
class SpiralLevels:
    """Steady points of a spiral in the order of time: helm (K,) [rad] and yaw rate (K,) [rad/s].

    skipped : levels that were not steady.
    """

    helm: Array
    rate: Array
    skipped: int


def helm_levels(record: Record) -> SpiralLevels:
    """Helm levels of a direct spiral with the yaw rate over the last quarter of each, where that has settled."""
    t, most = record.t, float(np.abs(record.r).max())
    helm, rate = [], []
    stretches = find_plateaus(t, record.helm, _one_level(record.helm))
    for first, last in stretches:
        settled_rate = settled_mean(t, record.r, float(t[first]), float(t[last]), most)
        if np.isfinite(settled_rate):
            helm.append(float(np.median(record.helm[first : last + 1])))
            rate.append(settled_rate)
    return SpiralLevels(np.array(helm), np.array(rate), len(stretches) - len(helm))


def _one_level(helm: Array) -> float:
    """How far helm angles of one level may be apart [rad]: the less, the finer the levels of a quiet helm are."""
    scatter = HELM_SCATTER * float(np.quantile(np.abs(np.diff(helm)), QUIET_SHARE))
    return min(max(scatter, LEVEL_SHARE * float(np.abs(helm).max())), LEVEL_HELM)


def spiral_measures(record: Record) -> Measures:
    """Measures of a direct spiral from one side to the other and back.

    Returns
    -------
    Measures : `neutral_helm` [rad], mean of the helm angles at which the rate changes sign on the two branches;
        `loop_width` [rad], their difference; `loop_height` [rad/s], the difference of the rates at helm 0. Their
        resolution is `levels_apart` [rad], the distance of the steady levels between which the rate changes sign, the
        larger of both ways. Width and height are 0 for a stable ship, as is a loop below a hundredth of that distance.
        `helm_levels`, `levels_not_steady`: counts. A ship that turns to one side at every helm angle has no height: its
        loop may be wider than the spiral.
    """
    measures, points = Measures(), helm_levels(record)
    ways = [(points.helm[way], points.rate[way]) for way in _ways_there_and_back(points.helm)]
    zero = [_at_zero(rate, helm) for helm, rate in ways] if len(ways) == 2 else [NAN, NAN]
    flat = [_at_zero(helm, rate) for helm, rate in ways] if len(ways) == 2 else [NAN, NAN]
    apart = [_around_zero(rate, helm) for helm, rate in ways] if len(ways) == 2 else [NAN, NAN]
    why = "the rate does not change sign on the way there and on the way back, on levels that are steady"
    width, height, resolved = abs(zero[1] - zero[0]), abs(flat[1] - flat[0]), max(apart)
    if width < NARROWEST_LOOP * resolved:
        width = height = 0.0
    measures.add(why, neutral_helm=((zero[0] + zero[1]) / 2, "rad"), loop_width=(width, "rad"))
    branch = bool(np.isnan(zero).all() and flat[0] * flat[1] > 0)  # both ways may lie on one branch of a loop
    unknown = ONE_SIDE if branch else "the helm does not pass 0 on both ways"
    measures.add(unknown, loop_height=(NAN if branch else height, "rad/s"))
    measures.add(why, levels_apart=(resolved if np.isfinite(apart).all() else NAN, "rad"))
    measures.add("", levels=(len(points.helm), "-"), levels_not_steady=(points.skipped, "-"))
    return measures


def _ways_there_and_back(helm: Array) -> list[slice]:
    """Levels of the way there and of the way back, from helm over to one side to the other side or amidships.

    The levels before and after, as of the straight course to the first helm, belong to neither.
    """
    turns = np.flatnonzero(np.diff(np.sign(np.diff(helm))) != 0) + 1
    over = MIDSHIPS * float(np.abs(helm).max(initial=0.0))
    stretches = pairwise([0, *turns.tolist(), len(helm) - 1])
    return [slice(a, b + 1) for a, b in stretches if a < b and abs(helm[a]) >= over and helm[a] * helm[b] <= 0][:2]


def _sign_change(x: Array) -> int | None:
    """First point at which x is 0, or after which it changes sign; None where it does not."""
    return next((i for i in range(len(x)) if x[i] == 0 or x[i] * x[min(i + 1, len(x) - 1)] < 0), None)


def _at_zero(x: Array, y: Array) -> float:
    """Value y where x first changes sign, linear between points; NaN if it does not."""
    i = _sign_change(x)
    if i is None:
        return NAN
    return float(y[i] if x[i] == 0 else y[i] - x[i] * (y[i + 1] - y[i]) / (x[i + 1] - x[i]))


def _around_zero(x: Array, y: Array) -> float:
    """How far the values y are apart between which x first changes sign, or at the neighbours of x = 0; else NaN."""
    i = _sign_change(x)
    if i is None:
        return NAN
    others = y[[j for j in (i - (x[i] == 0), i + 1) if 0 <= j < len(y)]]
    return float(np.abs(others - y[i]).max()) if len(others) else NAN
