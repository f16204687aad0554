"""Multipurpose naval vessel, 51.5 m, with roll: Blanke and Christensen (1993), 10th Ship Control Systems Symposium.

Numbers of Perez for the vessel of ADI-Limited, as in the MSS toolbox (navalvessel.m). N_{phi|uv|} multiplies phi|uv|,
as its name and its siblings in sway and roll have it; navalvessel.m multiplies it by phi|u phi|. The hull alone: the
source takes the forces of screws and rudders from outside, here as X, Y, K, N in N and N m.
"""

from __future__ import annotations

import numpy as np

DRAWN = {
    **{"u": (-3.0, 9.0), "v": (-2.0, 2.0), "p": (-0.2, 0.2), "r": (-0.1, 0.1), "phi": (-0.4, 0.4)},
    **{"X": (-1e5, 3e5), "Y": (-1e5, 1e5), "K": (-3e5, 3e5), "N": (-2e6, 2e6)},
}


def accelerations(
    *, u: float, v: float, p: float, r: float, phi: float, X: float, Y: float, K: float, N: float
) -> np.ndarray:
    rho, g, volume, gm = 1014.0, 9.81, 357.0, 1.1
    m, I_xx, I_zz, x_G, z_G = volume * rho, 2.3763e6, 47.934e6, -3.38, -(3.36 - 2.3)
    M = np.array(
        [
            [m + 17400.0, 0, 0, 0],
            [0, m + 393000, -(m * z_G - 296000), m * x_G + 1400000],
            [0, -(m * z_G + 296000), I_xx + 774000, 0],
            [0, m * x_G - 538000, 0, I_zz + 38.7e6],
        ]
    )
    X_h = -1.96e3 * u * abs(u) + 0.33 * m * v * r
    Y_h = -11800 * abs(u) * v + 131000 * u * r - 3700 * v * abs(v) - 794000 * v * abs(r) - 182000 * r * abs(v)
    Y_h += 10800 * phi * abs(u * v) + 251000 * phi * abs(u * r) - 74 * phi * u**2
    K_h = 9260 * abs(u) * v - 102000 * u * r + 29300 * v * abs(v) + 621000 * v * abs(r) + 142000 * r * abs(v)
    K_h += -8400 * phi * abs(u * v) - 196000 * phi * abs(u * r) - 1180 * phi * u**2
    K_h += -15500 * abs(u) * p - 416000 * p * abs(p) - 500000 * p - 0.325 * m * g * phi**3 - rho * g * gm * volume * phi
    N_h = -92000 * abs(u) * v - 4710000 * abs(u) * r - 202000000 * r * abs(r) - 15600000 * r * abs(v)
    N_h += -214000 * phi * abs(u * v) - 4980000 * phi * u * abs(r) - 8000 * phi * u * abs(u)
    turning = m * np.array([r * v + x_G * r**2 - z_G * p * r, -u * r, z_G * u * r, -x_G * u * r])
    return np.linalg.solve(M, np.array([X_h + X, Y_h + Y, K_h + K, N_h + N]) + turning)
