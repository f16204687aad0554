"""Excitation signals for identification: random levels (APRBS), and limits of their rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shipid.vessel.perturb import uniform_draw

Array = NDArray[np.float64]

STRATA = 8  # strata of the range of levels


def aprbs_series(
    time: Array, *, hold: tuple[float, float], levels: tuple[float, float], key: tuple[object, ...]
) -> Array:
    """Amplitude-modulated pseudo-random binary sequence (T,) at times (T,) [s]: levels held for random times.

    Hold times are uniform in `hold` [s]. Of every eight successive levels one lies in each eighth of `levels`, at
    random (Nelles 2001, Nonlinear System Identification, ch. 17). A longer series begins with the shorter one.
    """
    most = int((time[-1] - time[0]) / hold[0]) + 1
    draws = np.array([uniform_draw(*key, "hold", number) for number in range(most)])
    ends = time[0] + np.cumsum(hold[0] + (hold[1] - hold[0]) * draws)
    slack = 1e-9 * max(1.0, float(np.abs(time).max()))  # a level ends at 3 * 0.1 where it should at 0.3
    number = np.searchsorted(ends, time + slack, side="right")
    return np.asarray(levels[0] + (levels[1] - levels[0]) * _stratified_draws(int(number[-1]) + 1, key)[number])


def limit_rate(series: Array, step: float, rate: float) -> Array:
    """Rate-limited copy of a series (T,) or (T, S): it changes by at most rate [1/s] * step [s] per sample.

    It starts at the first value and follows the series at full rate until it reaches it, like an actuator with a rate
    limit.
    """
    result = np.array(series, dtype=np.float64)
    for now in range(1, len(result)):
        result[now] = result[now - 1] + np.clip(result[now] - result[now - 1], -rate * step, rate * step)
    return result


def _stratified_draws(count: int, key: tuple[object, ...]) -> Array:
    """Stratified random numbers (count,) in [0, 1): each block of STRATA numbers has one in each equal part."""
    blocks = range(-(-count // STRATA))
    order = np.array([[uniform_draw(*key, "order", block, part) for part in range(STRATA)] for block in blocks])
    within = np.array([[uniform_draw(*key, "level", block, part) for part in range(STRATA)] for block in blocks])
    return np.asarray(((np.argsort(order, axis=1) + within) / STRATA).ravel()[:count])
