"""Published regressions for a ship of which only main particulars are known: resistance, and thrust of a screw.

They hold for displacement ships; each function names its source. Nothing here knows vessel documents.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from shipid.units import GRAVITY

Array = NDArray[np.float64]

PITCHES = (0.4, 1.5)  # P / D of the Wageningen B-series, 0.5 to 1.4, with a little on either side

# K_T of a Wageningen B 4-55 screw, usual for merchant ships: row s, column t are the factor of J^s (P / D)^t.
# Oosterveld and van Oossanen (1975), table 5, Reynolds number 2e6, with four blades and an area ratio of 0.55.
K_T_SERIES = (
    (0.0197526437, 0.2237434, 0.381633694, -0.207260926, 0.0, 0.0, 0.00638407),
    (-0.23762198, -0.02209295, -0.02618432, 0.0673696, 0.0, 0.0, -0.0020949295),
    (-0.22576794, 0.0, 0.0, 0.0, 0.0, 0.0, -0.0014241708),
    (0.0684439833, 0.0, 0.0, -0.00409184, 0.0, 0.0, 0.00049740152),
)  # fmt: skip


def series_thrust_coefficient(J: Array, pitch: float) -> Array:
    """K_T [-] of a Wageningen B 4-55 screw at advance ratios J (N,) and pitch ratio P / D."""
    return np.asarray(polyval(J, np.array(K_T_SERIES) @ pitch ** np.arange(7)))


@cache
def thrust_polynomial(pitch: float) -> tuple[float, float, float]:
    """(k_0, k_1, k_2) of K_T = k_0 + k_1 J + k_2 J^2: least squares from J = 0 to where K_T is 0.

    Within 0.01 of the series up to P / D = 1.4.
    """
    J = np.linspace(0.0, 1.6 * pitch, 200)
    K_T = series_thrust_coefficient(J, pitch)
    J, K_T = J[K_T > 0], K_T[K_T > 0]
    k_2, k_1, k_0 = np.polyfit(J, K_T, 2).tolist()
    return k_0, k_1, k_2


def ittc_friction(speed: float, length: float, nu: float) -> float:
    """C_F [-] of the ITTC-57 line at a speed [m/s] and length [m] in water of viscosity nu [m^2/s]."""
    return float(0.075 / (math.log10(speed * length / nu) - 2) ** 2)


def form_factor(L: float, B: float, T: float, C_b: float) -> float:
    """Form factor k [-] of Watanabe, at least 0: viscous resistance is (1 + k) times that of friction.

    Beamier ships than L / B = 3 have the factor of that, which the square would make twice as large at 2.2.
    """
    return max(-0.095 + 25.6 * C_b / (max(L / B, 3.0) ** 2 * math.sqrt(B / T)), 0.0)


def mumford_surface(L: float, B: float, T: float, C_b: float) -> float:
    """S [m^2] of Mumford."""
    return 1.025 * L * (C_b * B + 1.7 * T)


def motora_added_mass(L: float, B: float, T: float, C_b: float) -> tuple[float, float, float]:
    """Added mass in surge and sway over the mass [-], and radius of gyration of the added yaw inertia [m].

    Regressions by Zhou, Sheng and Feng (1983, Ship Engineering 6, 21-29) of the charts of Motora (1959).
    """
    ratio, d = L / B, T / B
    m_x = (
        0.398
        + 11.97 * C_b * (1 + 3.73 * d)
        - 2.89 * C_b * ratio * (1 + 1.13 * d)
        + 0.175 * C_b * ratio**2 * (1 + 0.54 * d)
        - 1.107 * ratio * d
    ) / 100
    m_y = (
        0.882
        - 0.54 * C_b * (1 - 1.6 * d)
        - 0.156 * ratio * (1 - 0.673 * C_b)
        + 0.826 * d * ratio * (1 - 0.678 * d)
        - 0.638 * C_b * d * ratio * (1 - 0.669 * d)
    )
    gyration = L / 100 * (33 - 76.85 * C_b * (1 - 0.784 * C_b) + 3.43 * ratio * (1 - 0.63 * C_b))
    return m_x, m_y, gyration


def correlation_allowance(L: float) -> float:
    """C_A [-] of a ship's rough hull: 0.006 (L + 100)^-0.16 - 0.00205, Holtrop and Mennen (1982); L [m]."""
    return float(0.006 * (L + 100) ** -0.16 - 0.00205)


def wave_resistance(L: float, B: float, T: float, C_b: float, speed: float) -> float:
    """R_W over the displaced weight [-], Holtrop and Mennen (1982): no bulb, no immersed transom, LCB amidships.

    C_M by Kerlen (1970), C_WP = (1 + 2 C_b) / 3. Lengths [m], speed [m/s]. The formula is for Froude numbers up to 0.4.
    """
    C_M = min(max(1.006 - 0.0056 * C_b**-3.56, 0.75), 0.995)
    C_P, C_WP = min(C_b / C_M, 0.9), (1 + 2 * C_b) / 3
    volume = C_b * L * B * T
    run = 1 - C_P  # length of the run over L
    entrance = 1 + 89 * math.exp(
        -((L / B) ** 0.80856)
        * (1 - C_WP) ** 0.30484
        * (1 - C_P) ** 0.6367
        * (run * L / B) ** 0.34574
        * (100 * volume / L**3) ** 0.16302
    )
    return wave_resistance_of_hull(L, B, T, volume, C_P, entrance, speed)


def wave_resistance_of_hull(
    L: float, B: float, T: float, volume: float, C_P: float, entrance: float, speed: float
) -> float:
    """R_W over the displaced weight [-] as above, of a hull whose volume [m^3], C_P and angle of entrance are known.

    entrance : half the angle [deg] of the waterline at the bow. Lengths [m], speed [m/s].
    """
    ratio, froude = B / L, speed / math.sqrt(GRAVITY * L)
    c_7 = 0.229577 * ratio ** (1 / 3) if ratio < 0.11 else ratio if ratio < 0.25 else 0.5 - 0.0625 / ratio
    c_1 = 2223105 * c_7**3.78613 * (T / B) ** 1.07961 * (90 - entrance) ** -1.37565
    slender = L**3 / volume
    c_15 = -1.69385 if slender < 512 else 0.0 if slender > 1727 else -1.69385 + (slender ** (1 / 3) - 8) / 2.36
    c_16 = 8.07981 * C_P - 13.8673 * C_P**2 + 6.984388 * C_P**3 if C_P < 0.8 else 1.73014 - 0.7067 * C_P
    m_1 = 0.0140407 * L / T - 1.75254 * volume ** (1 / 3) / L - 4.79323 * B / L - c_16
    m_2 = c_15 * C_P**2 * math.exp(-0.1 * froude**-2)
    hollows = 1.446 * C_P - (0.03 * L / B if L / B < 12 else 0.36)
    return float(c_1 * math.exp(m_1 * froude**-0.9 + m_2 * math.cos(hollows * froude**-2)))
