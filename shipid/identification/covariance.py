"""Covariance from an information matrix, with the directions that the data do not see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shipid.identification.collinearity import UNSEEN

Array = NDArray[np.float64]


def invert_information(information: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Pseudo-inverse (n, n) of an information matrix, and a mask (n,) of parameters along its null directions."""
    scale = np.sqrt(np.diag(information))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    silent = values <= UNSEEN * max(float(values[-1]), UNSEEN)
    kept = vectors[:, ~silent]
    inverse = (kept / values[~silent]) @ kept.T / np.outer(scale, scale)
    return inverse, np.asarray((np.abs(vectors[:, silent]) > np.sqrt(UNSEEN)).any(axis=1))
