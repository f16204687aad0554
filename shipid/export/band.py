"""The band of a predictor as CasADi expressions, with the arithmetic of `shipid.hybrid.bands`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.export.correctors import distance_to_nearest
from shipid.export.known import NamedExpressions
from shipid.hybrid.bands import FEWEST, LEVELS, Bands, track_directions
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
    columns: dict[str, Any] = {name: ca.ArrayInterface.MX(now[name], shape=(1,)) for name in (*MOTIONS, *bands.names)}
    paths: Any = ca.ArrayInterface.MX(path.T, shape=(path.shape[1], 1, 2))
    grown = MX(SymbolicBands(**vars(bands)).growth(paths, columns, step, past))
    ahead: Any = track_directions(paths)
    return ca.vertcat(grown * half.T, MX(ahead.reshape(path.shape[1], 2)).T)


class SymbolicBands(Bands):
    """Bands of symbols."""

    def away(self, points: Any) -> Any:
        """Distance (1,) of points (1, d) from the windows of training."""
        nearest = distance_to_nearest(MX(points / self.spread).T, self.centres / self.spread)
        return ca.ArrayInterface.MX(nearest / np.sqrt(self.centres.shape[1]), shape=(1,))


def is_band_promised(bands: Bands, level: MX, pointwise: MX, kind: MX) -> MX:
    """Whether enough runs calibrated the level, or the kind, as `Bands.check`."""
    counts = ca.DM([bands.runs, *bands.kinds.values()])
    runs = ca.dot(counts, kind == ca.DM(range(len(bands.kinds) + 1)))
    promised = ca.logic_and(ca.logic_and(level > 0, level <= float(LEVELS[-1])), runs >= FEWEST)
    promised = ca.logic_and(promised, level / (1 - level) - 1e-9 <= runs)
    return ca.logic_and(promised, ca.logic_not(ca.logic_and(pointwise != 0, kind != 0)))
