"""Container ship, 175 m, with roll: Son and Nomoto (1982), Naval Architecture and Ocean Engineering 20, 73-83.

Written from container.m of the MSS toolbox (corrected wake of 2022) by a person who had not read the vessel document.
All numbers are in the prime system of length 175 m and the present speed. Shaft ahead, ship ahead.
"""

from __future__ import annotations

from math import atan, cos, pi, sin, sqrt

import numpy as np

DRAWN = {
    **{"u": (3.0, 12.0), "v": (-2.0, 2.0), "p": (-0.05, 0.05), "r": (-0.02, 0.02), "phi": (-0.3, 0.3)},
    **{"delta": (-0.6, 0.6), "rpm": (40.0, 160.0)},
}

LENGTH, GRAVITY = 175.0, 9.81
POWERS = np.array(  # of v, r, p, phi, a row each, in the columns of the derivatives below
    [
        [1, 0, 0, 0, 3, 0, 2, 1, 2, 1, 0, 0],
        [0, 1, 0, 0, 0, 3, 1, 2, 0, 0, 2, 1],
        [0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 1, 0, 0, 0, 0, 1, 2, 1, 2],
    ]
)
# v, r, p, phi, vvv, rrr, vvr, vrr, vvphi, vphiphi, rrphi, rphiphi
SWAY = [-116e-4, 242e-5, 0, -63e-6, -109e-3, 177e-5, 214e-4, -405e-4, 4605e-5, 304e-5, 9325e-6, -1368e-6]
ROLL = [3026e-7, -63e-6, -75e-7, -21e-6, 2843e-6, -462e-7, -588e-6, 10565e-7, -12012e-7, -793e-7, -243e-6, 3569e-8]
YAW = [
    -38545e-7,
    -222e-5,
    213e-6,
    -1424e-7,
    1492e-6,
    -229e-5,
    -424e-4,
    156e-5,
    -19058e-6,
    -53766e-7,
    -38592e-7,
    24195e-7,
]


def accelerations(*, u: float, v: float, p: float, r: float, phi: float, delta: float, rpm: float) -> np.ndarray:
    speed = sqrt(u * u + v * v)
    rate, shaft = speed / LENGTH, rpm / 60
    u, v, p, r = u / speed, v / speed, p / rate, r / rate

    inflow = u * (0.816 + 1.09 * (v - 0.526 * r) ** 2)
    advance = inflow * speed / (shaft * 6.533)
    K_T = 0.527 - 0.455 * advance
    thrust = 2 * 6.533**4 * K_T * shaft**2 / (LENGTH * speed) ** 2
    along = 0.921 * inflow * sqrt(1 + 8 * 0.631 * K_T / (pi * advance**2))
    across = 0.088 * v - 0.156 * r - 0.275 * r**3 + 1.96 * r * r * v
    lift = 6.13 * 1.8219 / (1.8219 + 2.25) * 33.0376 / LENGTH**2
    F_N = -lift * (along**2 + across**2) * sin(delta + atan(across / along))

    m, m_x, m_y = 0.00792, 0.000238, 0.007049
    X = -4226e-7 * u**2 + (1 - 0.175) * thrust - 386e-5 * v**2 + 2e-4 * (r**2 - phi**2)
    X += (m + m_y - 311e-5) * v * r + 0.71 * F_N * sin(delta)
    monomials = np.prod(np.array([v, r, p, phi])[:, None] ** POWERS, axis=0)
    Y, K, N = np.array([SWAY, ROLL, YAW]) @ monomials
    side = F_N * cos(delta)
    weight = GRAVITY * 21222 / (LENGTH**2 * speed**2 / 2)
    Y += 1.237 * side - (m + m_x) * u * r
    K += -1.237 * 0.033 * side + m_x * 0.0313 * u * r - weight * 0.3 / LENGTH * phi
    N += (-0.5 - 0.237 * 0.48) * side
    coupled = np.array(  # sway, roll, yaw
        [
            [m + m_y, -m_y * 0.0313, m_y * 0.05],
            [-m_y * 0.0313, 176e-7 + 34e-7, 0],
            [m_y * 0.05, 0, 456e-6 + 419e-6],
        ]
    )
    v_dot, p_dot, r_dot = np.linalg.solve(coupled, [Y, K, N])
    return np.array([X / (m + m_x), v_dot, p_dot / LENGTH, r_dot / LENGTH]) * speed * rate
