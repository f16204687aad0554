"""The outline of a ship from above, for drawings to scale."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

LENGTH, SLENDERNESS = 30.0, 6.0  # of a ship whose particulars do not say: m; length over beam


def ship_outline(particulars: Mapping[str, float]) -> np.ndarray:
    """Return the outline (k, 2) of a ship from above [m]: a box with a pointed bow.

    Body axes: the first column is ahead, the second to starboard, midships at 0, 0.

    particulars : of a vessel [m]: L_oa, else L_pp, else 30 m; B, else a sixth of the length.
    """
    length = particulars.get("L_oa", particulars.get("L_pp", LENGTH))
    beam = particulars.get("B", length / SLENDERNESS)
    half, shoulder = beam / 2, length / 2 - 0.25 * length
    stern = -length / 2
    points = [(stern, -half), (shoulder, -half), (length / 2, 0.0), (shoulder, half), (stern, half), (stern, -half)]
    return np.array(points)
