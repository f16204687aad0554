"""Excitation signals for identification: multisine and APRBS.

Series are arrays about zero or between limits, in the unit of the command; the caller adds the mean value.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shipid.errors import DocumentError
from shipid.vessel.perturb import uniform_draw
from shipid.vessel.stability import bisect_root

Array = NDArray[np.float64]

STARTS, ROUNDS = 24, 400  # of the search for phases: 0.1 s; eight times as many starts improve it by 2 % at most
SAMPLES = 32  # per period of the highest harmonic in the search for the peak
STRATA = 8  # strata of the range of levels


def multisine_series(
    time: Array,
    *,
    period: float,
    harmonics: Sequence[int],
    amplitude: float,
    key: tuple[object, ...] = (),
) -> Array:
    """Sum (T,) of sines of equal amplitude at harmonics / period [Hz], within +- amplitude at all times, 0 at t = 0.

    x(t) = a sum_k sin(2 pi h_k t / period + phi_k) at times (T,) [s]. For a low crest factor the phases are searched,
    from those of Schroeder (1970, IEEE Trans. Inf. Theory 16) and from random ones by `key`: clip the peaks, keep the
    phases of the clipped signal, restore the amplitudes (Van der Ouderaa, Schoukens and Renneboog 1988, IEEE Trans.
    Instrum. Meas. 37). Several commands get disjoint harmonics (`deal_harmonics`), and begin at 0 each: Morelli's
    design (2003, AIAA 2003-5807).

    DocumentError for harmonics that are too fast for the steps of `time`.
    """
    fastest, step = max(harmonics), float(np.diff(time).max()) if len(time) > 1 else 0.0
    if 2 * fastest * step >= period:
        raise DocumentError(
            f"harmonic {fastest} of {period:g} s is too fast for steps of {step:g} s: less than two a cycle",
            path="harmonics",
        )
    h = np.array(harmonics, dtype=np.int64)
    start = -np.pi * np.arange(len(h)) * np.arange(1, len(h) + 1) / len(h)
    phi = _shift_to_zero(h, _optimise_phases(h, start, key))
    shape = np.sin(2 * np.pi * np.outer(time, h) / period + phi).sum(axis=1)
    peak = np.abs(_one_period(h, phi)).max() / np.cos(np.pi / SAMPLES)  # at all times at most: Ehlich and Zeller 1964
    return np.asarray(amplitude / float(peak) * shape)


def deal_harmonics(harmonics: Sequence[int], count: int) -> tuple[tuple[int, ...], ...]:
    """Distribute harmonics to `count` orthogonal multisines in turn, so that each covers the whole band."""
    if not 1 <= count <= len(harmonics):
        raise DocumentError(f"{len(harmonics)} harmonics cannot be shared by {count} commands", path="harmonics")
    return tuple(tuple(sorted(harmonics)[first::count]) for first in range(count))


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
    limit. A multisine that is limited contains additional harmonics.
    """
    result = np.array(series, dtype=np.float64)
    for now in range(1, len(result)):
        result[now] = result[now - 1] + np.clip(result[now] - result[now - 1], -rate * step, rate * step)
    return result


def _one_period(harmonics: NDArray[np.int64], phi: Array) -> Array:
    """One period of the sum of unit sines with phases (..., K): (..., SAMPLES * greatest harmonic)."""
    count = SAMPLES * int(harmonics.max())
    lines = np.zeros((*phi.shape[:-1], count // 2 + 1), dtype=complex)
    lines[..., harmonics] = -0.5j * count * np.exp(1j * phi)
    return np.fft.irfft(lines, count)


def _optimise_phases(harmonics: NDArray[np.int64], schroeder: Array, key: tuple[object, ...]) -> Array:
    """Phases (K,) with the lowest peak of STARTS searches of ROUNDS iterations."""
    drawn = [
        [uniform_draw(*key, "phase", start, int(harmonic)) for harmonic in harmonics] for start in range(1, STARTS)
    ]
    phi = np.vstack([schroeder, 2 * np.pi * np.array(drawn).reshape(STARTS - 1, len(harmonics))])
    best, lowest = schroeder, np.inf
    for level in np.linspace(0.75, 0.995, ROUNDS):
        wave = _one_period(harmonics, phi)
        peaks = np.abs(wave).max(axis=1)
        if peaks.min() < lowest:
            best, lowest = phi[int(np.argmin(peaks))], float(peaks.min())
        limit = level * peaks[:, None]
        phi = np.angle(1j * np.fft.rfft(np.clip(wave, -limit, limit))[:, harmonics])
    return best


def _shift_to_zero(harmonics: NDArray[np.int64], phi: Array) -> Array:
    """Phases (K,) of the wave shifted in time so that it rises through 0 at t = 0."""
    wave = _one_period(harmonics, phi)
    rising = int(np.flatnonzero((wave <= 0) & (np.roll(wave, -1) > 0))[0])
    low, high = 2 * np.pi * rising / len(wave), 2 * np.pi * (rising + 1) / len(wave)
    return phi + harmonics * bisect_root(lambda angle: float(np.sin(harmonics * angle + phi).sum()), low, high)


def _stratified_draws(count: int, key: tuple[object, ...]) -> Array:
    """Stratified random numbers (count,) in [0, 1): each block of STRATA numbers has one in each equal part."""
    blocks = range(-(-count // STRATA))
    order = np.array([[uniform_draw(*key, "order", block, part) for part in range(STRATA)] for block in blocks])
    within = np.array([[uniform_draw(*key, "level", block, part) for part in range(STRATA)] for block in blocks])
    return np.asarray(((np.argsort(order, axis=1) + within) / STRATA).ravel()[:count])
