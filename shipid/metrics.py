"""Arrays in, named numbers out: how far a predicted path is from the true one.

Errors have the shape (T, S): horizon step first, window last. A member that diverged is said so, never averaged away.
"""

from __future__ import annotations

from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Summary(TypedDict):
    """Position error over all predicted points: A or H (mean), H_90 (p90) and the root mean square, all in metres.

    `status` is `ok`, or `diverged` with NaN for the numbers if any point is not finite; `failed_share` is the share of
    windows with such a point.
    """

    mean: float
    p90: float
    rms: float
    status: str
    failed_share: float


def position_error(predicted: Array, true: Array) -> Array:
    """Return the distance (T, S) [m] between paths (T, S, 2) [m], e_k of (14) and (15), in whatever frame both are."""
    if predicted.shape != true.shape or predicted.shape[-1:] != (2,):
        raise ValueError(f"paths must both be (T, S, 2), got {predicted.shape} and {true.shape}")
    # order C: a sum over errors must not depend on how the paths happen to lie in memory
    return np.hypot(predicted[..., 0] - true[..., 0], predicted[..., 1] - true[..., 1], order="C")


def summary(error: Array) -> Summary:
    """Condense errors (T, S) [m] to A (14) or H (15), H_90 and the root mean square over all points of all windows."""
    if error.size == 0:
        raise ValueError("no window to summarise")
    failed = ~np.isfinite(error).all(axis=0)
    if failed.any():
        return Summary(mean=np.nan, p90=np.nan, rms=np.nan, status="diverged", failed_share=float(failed.mean()))
    return Summary(
        mean=float(error.mean()),
        p90=float(np.quantile(error, 0.9)),
        rms=float(np.sqrt(np.square(error).mean())),
        status="ok",
        failed_share=0.0,
    )


def over_horizon(error: Array) -> dict[str, Array]:
    """Return mean and 90th percentile (T,) [m] of errors (T, S) at each step of the horizon (Fig. 14)."""
    return {"mean": error.mean(axis=1), "p90": np.quantile(error, 0.9, axis=1)}


def over_time(error: Array) -> Array:
    """Return the mean error (S,) [m] over the horizon of each window, so over the instants of prediction (Fig. 13)."""
    mean: Array = error.mean(axis=0)
    return mean
