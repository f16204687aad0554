"""The band of a predictor as CasADi expressions, with the arithmetic of `shipid.hybrid.bands`."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.export.correctors import distance_to_nearest
from shipid.export.known import NamedExpressions, column_of_entries
from shipid.hybrid.bands import FEWEST, LEVELS, Bands
from shipid.hybrid.features import MOTIONS

BAND_CHOICE = ("level", "pointwise", "kind")
"""Inputs of a band: its level, whether each step is taken alone (0 or 1), the kind of manoeuvre (0: any)."""
BAND_ROWS = ("along", "across", "ahead_x", "ahead_y")
"""Rows of a band: half axes [m], and the unit vector of the track in body axes; a column for each step."""


def half_axes_at(bands: Bands, level: MX, pointwise: MX, kind: MX) -> MX:
    """Half axes (T, 2) of a band before it grows: radius, linear between `LEVELS`, times scale.

    Each table has a weight of 1 at its place.
    """
    whole = np.vstack([bands.whole[None], bands.by_kind.reshape(-1, len(LEVELS))])
    near = ca.fmax(0, 1 - ca.fabs(100 * level - ca.DM(100 * LEVELS)))
    of = ca.fmax(0, 1 - ca.fabs(kind - ca.DM(range(len(whole)))))
    radius = ca.dot(of, ca.mtimes(ca.DM(whole), near))
    radii = ca.if_else(pointwise != 0, ca.mtimes(ca.DM(bands.steps.T), near), ca.repmat(radius, len(bands.along), 1))
    scales = np.concatenate([np.stack([bands.along, bands.across], axis=1)[None], bands.scales])
    return ca.horzcat(*(ca.mtimes(ca.DM(scales[..., side].T), of) * radii for side in (0, 1)))


def band_rows(
    bands: Bands, now: NamedExpressions, path: MX, step: float, half: MX, past: Mapping[str, Any] | None = None
) -> MX:
    """Rows (4, T) of `BAND_ROWS` around a path (2, T) of steps [s]; half axes (T, 2), rows of the past."""
    point = column_of_entries(now, bands.names) / ca.DM(bands.spread)
    grown = _band_growth(bands, path, now["r"], step, distance_to_nearest(point, bands.centres / bands.spread))
    if bands.fast is not None:
        columns: Mapping[str, Any] = {name: ca.ArrayInterface.MX(now[name], shape=(1,)) for name in MOTIONS}
        grown *= MX(bands.fast.growth(columns, past or {}))
    return ca.vertcat(grown * half.T, _track_directions(path))


def _track_directions(path: MX) -> MX:
    """Unit vectors (2, T) along a path, as `shipid.hybrid.bands.track_directions`; ahead where it does not move."""
    first = ca.horzcat(MX(np.zeros((2, 1))), path[:, :-1])
    chords = ca.horzcat(path[:, 1:] - first[:, :-1], path[:, -1] - first[:, -1])
    length = ca.sqrt(ca.sum1(chords**2))
    moves = ca.repmat(length > 1e-12 * ca.mmax(length), 2, 1)
    ahead = ca.repmat(ca.DM([1, 0]), 1, path.shape[1])
    return ca.if_else(moves, chords / ca.if_else(moves, ca.repmat(length, 2, 1), 1), ahead)


def _band_growth(bands: Bands, path: MX, r: MX, step: float, nearest_: MX) -> MX:
    """How much wider the band is than that of an average prediction, as `Bands.growth`."""
    away, horizon = nearest_ / np.sqrt(bands.centres.shape[1]), path.shape[1]
    ends = [MX(np.zeros(2)), *(path[:, -(-horizon * part // 3) - 1] for part in (1, 2, 3))]
    chords = [after - before for before, after in itertools.pairwise(ends)]
    length = sum(ca.sqrt(ca.sumsqr(chord)) for chord in chords)
    turns = []
    for one, other in itertools.pairwise(chords):
        dot = ca.dot(one, other)
        turns.append(ca.atan2(one[0] * other[1] - one[1] * other[0], ca.if_else(dot == 0, 0, dot)))  # 0 and not -0
    first, second = turns
    traits = ca.vertcat(
        ca.log(length / bands.length + 0.02),
        ca.fabs(first + second),
        ca.fabs(second - first),
        ca.fmin(ca.fabs(first + second - r * step * horizon * 2 / 3), np.pi),
        ca.log(1 + ca.fmin(away, bands.far)),
    )
    seen = ca.fmin(ca.fmax(traits, ca.DM(bands.low)), ca.DM(bands.high))
    harder = ca.dot((seen - ca.DM(bands.middle)) / ca.DM(bands.deviation), ca.DM(bands.slopes))
    return MX(ca.exp(harder) * ca.fmax(away / bands.far, 1))


def is_band_promised(bands: Bands, level: MX, pointwise: MX, kind: MX) -> MX:
    """Whether enough runs calibrated the level, or the kind, as `Bands.check`."""
    counts = ca.DM([bands.runs, *bands.kinds.values()])
    runs = ca.dot(counts, kind == ca.DM(range(len(bands.kinds) + 1)))
    promised = ca.logic_and(ca.logic_and(level > 0, level <= float(LEVELS[-1])), runs >= FEWEST)
    promised = ca.logic_and(promised, level / (1 - level) - 1e-9 <= runs)
    return ca.logic_and(promised, ca.logic_not(ca.logic_and(pointwise != 0, kind != 0)))
