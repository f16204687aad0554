"""Wind gusts and irregular seas: random harmonics of a spectrum for each sample, and wave loads from a vessel's tables.

Gusts are those of one fixed point, along the mean wind direction: the ship's motion does not change their frequencies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    FiniteFloat,
    PositiveFloat,
    PositiveInt,
    model_validator,
)

from shipid.checked import CheckedModel, Positive
from shipid.physics.grammar import AXES
from shipid.physics.waves import EVEN
from shipid.units import GRAVITY
from shipid.vessel.load import Vessel
from shipid.vessel.perturb import check_rising, uniform_draw
from shipid.vessel.schema import term_blocks

Array = np.ndarray

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
LOWEST, HIGHEST = 0.5, 3.2  # of the peak frequency: 99.2 % of the energy of a JONSWAP spectrum lies between
SIDE = {axis: 1 if place in EVEN else -1 for place, axis in enumerate(AXES)}  # in the relative heading: -1 for odd


class Gusts(CheckedModel, BaseModel):
    """A `gusts` block: spectrum, which depends on wind speed and height only, and frequency band [Hz]."""

    kind: Literal["npd"]
    height: Annotated[Positive, Field(description="m above the sea")] = 10.0
    frequencies: Annotated[
        tuple[Positive, Positive],
        AfterValidator(check_rising),
        Field(description="Hz, lowest and highest frequency of the gusts"),
    ] = (1 / 600, 0.5)
    harmonics: Annotated[int, Field(ge=2, le=10000)] = 100

    @model_validator(mode="after")
    def _has_width(self) -> Gusts:
        if self.frequencies[0] == self.frequencies[1]:
            raise ValueError(f"frequencies must be [low, high], not {list(self.frequencies)} Hz")
        return self


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
    return np.asarray(np.maximum(result, -mean_speed))


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


class Sea(CheckedModel, BaseModel):
    """`[truth.waves]`: an irregular sea with a JONSWAP spectrum, long-crested unless `spreading` is given.

    Its components hold 99 % of the energy: those from half to 3.2 times the peak frequency.
    """

    H_s: Annotated[FiniteFloat, Field(ge=0, description="m, significant wave height")]
    T_p: Annotated[PositiveFloat, Field(description="s, peak period")]
    gamma: Annotated[FiniteFloat, Field(ge=1, le=10, description="peak enhancement; 1 is Pierson-Moskowitz")] = 3.3
    components: Annotated[PositiveInt, Field(le=2000)] = 60
    spreading: Annotated[PositiveInt, Field(le=100)] | None = Field(
        default=None, description="s of the cos^2s law of directions about the mean; long-crested if not given"
    )

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest frequency [rad/s] of the components."""
        peak = 2 * np.pi / self.T_p
        return LOWEST * peak, HIGHEST * peak


def jonswap_spectrum(omega: Array, sea: Sea) -> Array:
    """S(omega) [m^2 s] with m_0 = H_s^2 / 16 (Hasselmann et al. 1973; normalised numerically over its whole range)."""
    peak = 2 * np.pi / sea.T_p

    def shape(w: Array) -> Array:
        width = np.where(w <= peak, 0.07, 0.09)
        bell = np.exp(-((w / peak - 1) ** 2) / (2 * width**2))
        return np.asarray(w**-5.0 * np.exp(-1.25 * (peak / w) ** 4) * sea.gamma**bell)

    whole = peak * np.linspace(0.2, 12.0, 20000)
    return np.asarray(sea.H_s**2 / 16 * shape(omega) / np.trapezoid(shape(whole), whole))


def share_outside(sea: Sea, low: float, high: float) -> float:
    """Share (0 to 1) of the energy of the components below `low` or above `high` [rad/s]."""
    omega = np.linspace(*sea.range, 2001)
    energy = jonswap_spectrum(omega, sea.model_copy(update={"H_s": 1.0}))
    return float(energy[(omega < low) | (omega > high)].sum() / energy.sum())


def wave_table_range(vessel: Vessel) -> tuple[float, float]:
    """Lowest and highest frequency [rad/s] that all wave tables of a vessel contain."""
    blocks = [block for _, key, block in term_blocks(vessel.document) if key.startswith("waves.")]
    columns = [block["table"]["omega"] for block in blocks]
    return max(min(column) for column in columns), min(max(column) for column in columns)


def draw_components(sea: Sea, direction: Array, names: Sequence[Any]) -> dict[str, Array]:
    """Components of each sample, (S, num_components): omega [rad/s], amplitude [m], epsilon and chi [rad].

    Equal bins of frequency with one component in each. It has the energy of the bin, and its frequency is drawn within
    the bin, so that the sea does not repeat. direction : (S,) [rad, towards]. names : (S,) keys of the random draws; a
    sample does not depend on the others.
    """
    edges = np.linspace(*sea.range, sea.components + 1)
    fine = np.linspace(edges[:-1], edges[1:], 33)
    energy = np.trapezoid(jonswap_spectrum(fine, sea), fine, axis=0)
    rows = [np.random.default_rng(int(uniform_draw("sea", name) * 2**53)).random((3, sea.components)) for name in names]
    jitter, phase, turn = np.array(rows).reshape(-1, 3, sea.components).transpose(1, 0, 2)
    spread = np.zeros_like(turn) if sea.spreading is None else spread_angles(sea.spreading, turn)
    return {
        "omega": edges[:-1] + jitter * np.diff(edges),
        "amplitude": np.broadcast_to(np.sqrt(2 * energy), jitter.shape),
        "epsilon": 2 * np.pi * phase,
        "chi": np.asarray(direction)[:, None] + spread,
    }


def spread_angles(s: int, share: Array) -> Array:
    """Angles [rad] from the mean direction by the inverse of the cumulative cos^2s law within +-90 deg."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 2001)
    density = np.cos(angle) ** (2 * s)
    cumulative = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    return np.asarray(np.interp(share, cumulative / cumulative[-1], angle))


def wave_loads(vessel: Vessel, drawn: Mapping[str, Array]) -> dict[str, Array]:
    """Wave loads for the argument `components` of a rollout: wave term -> (S, num_components, num_entries).

    drawn : result of `draw_components`.
    """
    result = {}
    for path, key, block in term_blocks(vessel.document):
        if key == "waves.first_order":
            g = vessel.document.get("constants", {}).get("g", GRAVITY)
            result[path] = _first_order_loads(block, drawn, g)
        elif key == "waves.drift":
            result[path] = _drift_loads(block, drawn)
    return result


def _first_order_loads(block: Mapping[str, Any], drawn: Mapping[str, Array], g: float) -> Array:
    columns = {name: np.asarray(values) for name, values in block["table"].items()}
    series = [
        heading_series(columns, columns[f"{axis}_real"] + 1j * columns[f"{axis}_imag"], SIDE[axis], block["harmonics"])
        for axis in SIDE
    ]
    omega, grid = drawn["omega"], np.unique(columns["omega"])
    coefficients_by_axis = [interpolate_lagrange(omega, grid, one) * drawn["amplitude"][..., None] for one in series]
    coefficients = np.concatenate(coefficients_by_axis, axis=-1)
    head = (omega, omega**2 / g, np.cos(drawn["chi"]), np.sin(drawn["chi"]), drawn["epsilon"])
    return np.concatenate([np.stack(head, axis=-1), coefficients.real, coefficients.imag], axis=-1)


def _drift_loads(block: Mapping[str, Any], drawn: Mapping[str, Array]) -> Array:
    """Mean drift: components of one direction are summed beforehand."""
    columns = {name: np.asarray(values) for name, values in block["table"].items()}
    grid = np.unique(columns["omega"])
    coefficients_by_axis = [
        interpolate_lagrange(
            drawn["omega"], grid, heading_series(columns, columns[f"{axis}_drift"], SIDE[axis], block["harmonics"])
        )
        for axis in ("X", "Y", "N")
    ]
    series = np.concatenate(coefficients_by_axis, axis=-1) * drawn["amplitude"][..., None] ** 2
    chi = drawn["chi"]
    if np.ptp(chi, axis=1).max() == 0:
        series, chi = series.sum(axis=1, keepdims=True), chi[:, :1]
    return np.concatenate([np.cos(chi)[..., None], np.sin(chi)[..., None], series], axis=-1)


def heading_series(columns: Mapping[str, Array], values: Array, side: int, harmonics: int) -> Array:
    """Coefficients (num_omega, harmonics + 1) of a cosine (side 1) or sine (side -1) series in the relative heading.

    The table must hold, for each frequency, the same equally spaced headings from 0 to 180 deg.
    """
    grid, headings = np.unique(columns["omega"]), np.unique(columns["beta_deg"])
    order = np.lexsort((columns["beta_deg"], columns["omega"]))
    half = values[order].reshape(len(grid), len(headings))
    whole = np.concatenate([half, side * half[:, -2:0:-1]], axis=1)
    spectrum = np.fft.fft(whole, axis=1) / whole.shape[1]
    nyquist = whole.shape[1] // 2
    kept = min(harmonics, nyquist)
    result = np.zeros((len(grid), harmonics + 1), dtype=spectrum.dtype)
    result[:, : kept + 1] = (2 if side > 0 else 2j) * spectrum[:, : kept + 1]
    if side > 0:
        result[:, 0] /= 2
    if kept == nyquist:
        result[:, nyquist] /= 2
    return result if np.iscomplexobj(values) else result.real


def interpolate_lagrange(x: Array, grid: Array, values: Array) -> Array:
    """Four-point Lagrange interpolation of values (len(grid), n) at x (...); zero above the grid, held below it."""
    first = np.clip(np.searchsorted(grid, x) - 2, 0, len(grid) - 4)
    places = first[..., None] + np.arange(4)
    inside, nodes = np.clip(x, grid[0], grid[-1]), grid[places]
    result = np.zeros((*x.shape, values.shape[1]), dtype=values.dtype)
    for k in range(4):
        others = [m for m in range(4) if m != k]
        weight = np.prod([(inside - nodes[..., m]) / (nodes[..., k] - nodes[..., m]) for m in others], axis=0)
        result += weight[..., None] * values[places[..., k]]
    return np.where((x > grid[-1])[..., None], 0, result)
