"""Multipurpose naval vessel, 51.5 m, with roll: Blanke and Christensen (1993), 10th Ship Control Systems Symposium.

Written from navalvessel.m of the MSS toolbox (numbers of Perez for the vessel of ADI-Limited) by a person who had not
read the vessel document, but for one term: N_{phi|uv|} multiplies phi|uv|, as its name and its siblings in sway and
roll have it; navalvessel.m multiplies it by phi|u phi|. The hull alone: the source takes the forces of screws and
rudders from outside, here as X, Y, K, N in N and N m.
"""

from __future__ import annotations

import numpy as np

DRAWN = {
    **{"u": (-3.0, 9.0), "v": (-2.0, 2.0), "p": (-0.2, 0.2), "r": (-0.1, 0.1), "phi": (-0.4, 0.4)},
    **{"X": (-1e5, 3e5), "Y": (-1e5, 1e5), "K": (-3e5, 3e5), "N": (-2e6, 2e6)},
}

RHO, GRAVITY, VOLUME = 1014.0, 9.81, 357.0
MASS = RHO * VOLUME
X_G, Z_G = -3.38, 2.3 - 3.36


def accelerations(
    *, u: float, v: float, p: float, r: float, phi: float, X: float, Y: float, K: float, N: float
) -> np.ndarray:
    surge, sway, yaw, roll = abs(u), abs(v), abs(r), abs(p)
    lever_x, lever_z = MASS * X_G, MASS * Z_G
    inertia = np.zeros((4, 4))
    inertia[0, 0] = MASS + 17400
    inertia[1] = [0, MASS + 393e3, 296e3 - lever_z, lever_x + 1400e3]
    inertia[2] = [0, -lever_z - 296e3, 2.3763e6 + 774e3, 0]
    inertia[3] = [0, lever_x - 538e3, 0, 47.934e6 + 38.7e6]

    heeled = phi * surge * np.array([sway, yaw, surge])  # phi|uv|, phi|ur|, phi u^2
    crossed = np.array([v * sway, v * yaw, r * sway])  # v|v|, v|r|, r|v|
    force = np.array([X, Y, K, N])
    force[0] += -1960 * u * surge + 0.33 * MASS * v * r
    force[1] += -11800 * surge * v + 131e3 * u * r + crossed @ [-3700, -794e3, -182e3] + heeled @ [10800, 251e3, -74]
    force[2] += 9260 * surge * v - 102e3 * u * r + crossed @ [29300, 621e3, 142e3] + heeled @ [-8400, -196e3, -1180]
    force[2] += -(15500 * surge + 416e3 * roll + 500e3) * p
    force[2] += MASS * GRAVITY * (-0.325 * phi**3 - 1.1 * phi)  # weight is buoyancy
    force[3] += -surge * (92e3 * v + 4710e3 * r) - 202e6 * r * yaw - 15.6e6 * r * sway
    force[3] += -214e3 * heeled[0] - u * phi * (4980e3 * yaw + 8000 * surge)

    force[0] += MASS * (v * r - Z_G * p * r + X_G * r * r)
    force[1:] += MASS * u * r * np.array([-1, Z_G, -X_G])
    return np.linalg.solve(inertia, force)
