"""Wind gusts: a stationary Gaussian series with a given spectrum, to be added to the mean wind speed.

The series is that of one fixed point, along the mean wind direction: the ship's motion does not change its frequencies.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat

from shipid.checked import CheckedModel
from shipid.vessel.perturb import check_rising, uniform_draw

Array = NDArray[np.float64]
Positive = Annotated[FiniteFloat, Field(gt=0)]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


class Gusts(CheckedModel, BaseModel):
    """A `gusts` block: spectrum, which depends on wind speed and height only, and frequency band [Hz]."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    kind: Literal["npd"]
    height: Annotated[Positive, Field(description="m above the sea")] = 10.0
    frequencies: Annotated[
        tuple[Positive, Positive],
        AfterValidator(check_rising),
        Field(description="Hz, lowest and highest frequency of the gusts"),
    ] = (1 / 600, 0.5)
    harmonics: Annotated[int, Field(ge=2, le=10000)] = 100


def gust_series(gusts: Gusts, mean_speed: Array, time: Array, keys: Sequence[tuple[object, ...]]) -> Array:
    """Gust speed (T, S) [m/s] at times (T,) [s], for mean speeds (S,) [m/s]; mean + gust is never negative.

    x(t) = sum_k a_k cos(2 pi f_k t + phi_k). The band is divided into bins of equal width in ln f; f_k is uniform in
    ln f within its bin, and a_k^2 / 2 the integral of the spectrum over it.

    keys : for each of the S series the key of its random draws, such as (seed, "manoeuvre", number).
    """
    amplitudes = np.sqrt(2 * _bin_variances(gusts, mean_speed))
    result = np.empty((len(time), len(mean_speed)))
    # one by one: no series may depend on the others, not even in the last bit
    for column, key, amplitude in zip(result.T, keys, amplitudes, strict=True):
        frequencies, phases = _draw_harmonics(gusts, key)
        column[:] = np.cos(2 * np.pi * np.outer(time, frequencies) + phases) @ amplitude
    return np.maximum(result, -mean_speed)


def gust_spectrum(gusts: Gusts, mean_speed: Array, frequency: Array) -> Array:
    """One-sided spectral density [m^2/s^2/Hz] at frequencies [Hz], for mean speeds [m/s] (shapes that broadcast).

    S = 320 (U/10)^2 (z/10)^0.45 (1 + x^n)^(-5/(3n)), x = 172 f (z/10)^(2/3) (U/10)^(-3/4), n = 0.468, with the
    hourly mean U at 10 m; ISO 19901-1, DNV-RP-C205 (Froya model), Fossen (2021) ch. 10. Measured in strong wind over
    open sea in neutral stability; light wind is an extrapolation.
    """
    speed = np.asarray(mean_speed, dtype=np.float64)
    blows = speed > 0
    U = np.where(blows, speed, 1.0)
    n, z = 0.468, gusts.height / 10
    x = 172 * frequency * z ** (2 / 3) * (U / 10) ** -0.75
    density = 320 * (U / 10) ** 2 * z**0.45 * (1 + x**n) ** (-5 / (3 * n))
    return np.asarray(np.where(blows, density, 0.0))


def _band_edges(gusts: Gusts) -> Array:
    """Natural logarithm of the limits (K + 1,) of the bins in Hz."""
    low, high = np.log(gusts.frequencies)
    return np.linspace(low, high, gusts.harmonics + 1)


def _bin_variances(gusts: Gusts, mean_speed: Array) -> Array:
    """Integral of the spectrum over each bin (S, K) [m^2/s^2], by Gauss's rule in ln f."""
    edges = _band_edges(gusts)
    half = np.diff(edges)[:, None] / 2
    frequency = np.exp(edges[:-1, None] + half * (1 + NODES))
    density = gust_spectrum(gusts, np.asarray(mean_speed)[:, None, None], frequency)
    return np.asarray((density * frequency * half * WEIGHTS).sum(axis=2))


def _draw_harmonics(gusts: Gusts, key: tuple[object, ...]) -> tuple[Array, Array]:
    """Frequencies [Hz] and phases [rad] of the harmonics, (K,) each."""
    place, turn = (
        np.array([uniform_draw(*key, "gust", quantity, k) for k in range(gusts.harmonics)])
        for quantity in ("frequency", "phase")
    )
    edges = _band_edges(gusts)
    return np.exp(edges[:-1] + np.diff(edges) * place), 2 * np.pi * turn
