"""The outline of a ship from above, for drawings to scale."""

from __future__ import annotations

import numpy as np


def ship_outline(length: float, beam: float) -> np.ndarray:
    """Return the outline (k, 2) of a ship from above [m]: a box with a pointed bow.

    Parameters
    ----------
    length, beam : over all [m]. Body axes: the first column is ahead, the second to starboard, midships at 0, 0.
    """
    half, shoulder = beam / 2, length / 2 - 0.25 * length
    stern = -length / 2
    points = [(stern, -half), (shoulder, -half), (length / 2, 0.0), (shoulder, half), (stern, half), (stern, -half)]
    return np.array(points)
