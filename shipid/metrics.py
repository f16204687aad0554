"""Measures of the distance between predicted and true paths: arrays in, named numbers out.

Errors have the shape (T, S): horizon step first, window last. A divergence is reported in the status, never averaged.
"""

from __future__ import annotations

from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from shipid.arguments import as_float_array
from shipid.errors import ShipidError

Array = NDArray[np.float64]


class ErrorSummary(TypedDict):
    """Position error [m] over all points: A or H (mean), H_90 (p90) and the root mean square; and at the horizon.

    `end` and `end_90` are mean and 90 % quantile over the windows at the last step: H_end, H_end_90, A_end, A_end_90.
    `status` is `ok`, or `diverged` with NaN for the numbers if any point is not finite.
    """

    mean: float
    p90: float
    rms: float
    end: float
    end_90: float
    status: str


PREDICTION_ERRORS = {"H_end": "end", "H_end_90": "end_90", "H": "mean", "H_90": "p90"}
"""Columns of a prediction's errors [m] in tables, the error at the horizon first -> their key in `ErrorSummary`."""


def vector_lengths(vectors: Array) -> Array:
    """Return the length (...) of vectors (..., 2), as `numpy.hypot` to 4 units in the last place, ten times as fast."""
    pairs = np.ascontiguousarray(vectors, dtype=float)
    return np.abs(pairs.view(np.complex128)[..., 0])


def position_error(predicted: Array, true: Array) -> Array:
    """Return the distance (T, S) [m] between paths (T, S, 2) [m], e_k of (14) and (15); both in one frame.

    Raises ShipidError for another shape, and for what holds no numbers.
    """
    predicted, true = as_float_array("predicted", predicted), as_float_array("true", true)
    if predicted.shape != true.shape or predicted.shape[-1:] != (2,):
        raise ShipidError(f"paths must both be (T, S, 2), got {predicted.shape} and {true.shape}")
    # order C: a sum over errors must not depend on the memory layout of the paths
    return vector_lengths(np.subtract(predicted, true, order="C"))


def coverage_by_run(held: NDArray[Any], run: NDArray[Any]) -> Array:
    """Share of the windows (S,) of each run that lie in their bands, runs by name."""
    _, place = np.unique(run, return_inverse=True)
    return np.asarray(np.bincount(place, held) / np.bincount(place))


def coverage_share(held: NDArray[Any], run: NDArray[Any]) -> float:
    """Coverage: share of windows (S,) in the mean over their runs, so a long run counts as much as a short one."""
    return float(coverage_by_run(held, run).mean())


def summarise_errors(error: Array) -> ErrorSummary:
    """Condense errors (T, S) [m] to A (14) or H (15), H_90, the root mean square, and the error at the horizon."""
    whole = bool(np.isfinite(error).all())
    error = error if whole else np.full_like(error, np.nan)
    return ErrorSummary(
        mean=float(error.mean()),
        p90=float(np.quantile(error, 0.9)),
        rms=float(np.sqrt(np.square(error).mean())),
        end=float(error_at_horizon(error).mean()),
        end_90=float(np.quantile(error_at_horizon(error), 0.9)),
        status="ok" if whole else "diverged",
    )


FIRST_OCTAVE, LAST_OCTAVE, BINS_AN_OCTAVE = (
    -10,
    20,
    512,
)  # octaves of a tally: 1 mm to 1,000 km, bins 0.2 % wide or narrower
LEAST, MOST = 2.0**FIRST_OCTAVE, float(np.nextafter(2.0**LAST_OCTAVE, 0))
BINS = BINS_AN_OCTAVE * (LAST_OCTAVE - FIRST_OCTAVE)
SHIFT = 52 - 9  # a double without its last bits is the number of its bin
FIRST = (1023 + FIRST_OCTAVE) * BINS_AN_OCTAVE  # number of the bin that begins at LEAST


def tally_errors(error: Array) -> NDArray[np.uint32]:
    """Histogram (BINS,) of errors [m] of any shape on a geometric scale; values beyond it count in the end bins."""
    kept = np.where(error > LEAST, np.minimum(error, MOST), LEAST)
    bins = (np.ascontiguousarray(kept).view(np.int64) >> SHIFT) - FIRST
    return np.bincount(bins.ravel(), minlength=BINS).astype(np.uint32)


def tally_quantile(counts: NDArray[np.uint32], share: float) -> Array:
    """Return the quantile [m] for a share (0 to 1) from counts (..., BINS) of `tally_errors`, to 0.2 %."""
    rows, places = counts.reshape(-1, BINS), []
    for row in rows:
        running = np.cumsum(row, dtype=float)
        place = share * (running[-1] - 1)
        bin_ = int(np.searchsorted(running, place, side="right"))
        places.append(bin_ + min((place - running[bin_] + row[bin_] + 0.5) / row[bin_], 1.0))
    octave, step = np.divmod(np.reshape(places, counts.shape[:-1]), BINS_AN_OCTAVE)
    return np.asarray(2.0 ** (octave + FIRST_OCTAVE) * (1 + step / BINS_AN_OCTAVE))


SLOW = 0.2  # m/s over ground: a slower ship has no course


def course_over_horizon(predicted: Array, true: Array, step: float) -> Array:
    """Return the mean absolute error (T,) [rad] of the course, the direction of the track, of paths (T, S, 2) [m].

    A point each `step` [s] from the origin on. Windows slower than `SLOW` in that step are left out; NaN where all are.
    """
    going, truly = (np.diff(path, axis=0, prepend=np.zeros_like(path[:1])) for path in (predicted, true))
    cross = truly[..., 0] * going[..., 1] - truly[..., 1] * going[..., 0]
    moves = vector_lengths(truly) >= SLOW * step
    angle = np.abs(np.arctan2(cross, (truly * going).sum(axis=-1)))
    count = moves.sum(axis=1)
    return np.asarray(np.where(count > 0, (angle * moves).sum(axis=1) / np.maximum(count, 1), np.nan))


def error_of_windows(error: Array) -> Array:
    """Return the mean error (S,) [m] over the horizon of each window, so over the instants of prediction (Fig. 13)."""
    return np.asarray(error.mean(axis=0))


def error_at_horizon(error: Array) -> Array:
    """Return the error (S,) [m] of each window at the last step of the horizon, of errors (T, S)."""
    return np.asarray(error[-1])


def path_roughness(paths: Array) -> float:
    """Return the mean length [m] of the second difference over the horizon of paths (T, S, 2) [m], T at least 3.

    Steady motion has (U^2 / R) h^2 at speed U, radius R and step h: compare with true paths, not with zero.
    """
    return float(vector_lengths(np.diff(paths, n=2, axis=0)).mean())


def error_by_axis(predicted: Array, true: Array) -> tuple[float, float]:
    """Return the mean absolute error [m] along x and across, along y, of paths (T, S, 2) [m] in the frame (11)."""
    along, across = np.abs(predicted - true).mean(axis=(0, 1))
    return float(along), float(across)


def rank_correlation(first: Array, second: Array) -> float:
    """Return Spearman's rank correlation of two samples (n,), ties sharing their mean rank; 0 if one is constant."""
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0
    from scipy.stats import rankdata

    return float(np.corrcoef(rankdata(first), rankdata(second))[0, 1])
