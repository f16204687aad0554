"""Esso 190,000 dwt tanker, 304.8 m: van Berlekom and Goddard (1972), Trans. SNAME 80, 264-298.

Accelerations in the bis system; coefficients as in the MSS toolbox (tanker.m) and PythonVehicleSimulator (tanker.py,
MIT), in deep water (z = 0). delta > 0 is to port there. u and the shaft speed are positive.
"""

from __future__ import annotations

import numpy as np

DRAWN = {"u": (1.0, 9.0), "v": (-2.0, 2.0), "r": (-0.01, 0.01), "delta": (-0.6, 0.6), "rpm": (10.0, 90.0)}


def accelerations(*, u: float, v: float, r: float, delta: float, rpm: float) -> np.ndarray:
    L, n, t = 304.8, rpm / 60, 0.22
    beta = np.arctan(v / u)
    cc = 0.605 * u * n + 38.2 * n**2  # square of the flow at the rudder
    gT = -0.00695 * u**2 / L - 0.00063 * u * n + 0.0000354 * L * n * abs(n)
    gX = (-0.0377 * u**2 + 0.3 * v**2 - 0.093 * cc * delta**2 + 0.152 * cc * beta * delta) / L + 2.020 * v * r
    gX += gT * (1 - t)
    gY = (-1.205 * u * v - 2.400 * abs(v) * v + 0.208 * cc * delta - 2.16 * cc * abs(beta) * beta * abs(delta)) / L
    gY += -0.752 * u * r + 0.04 * gT
    gLN = -0.451 * u * v - 0.098 * cc * delta + 0.688 * cc * abs(beta) * beta * abs(delta)
    gLN += L * (-0.300 * abs(v) * r - 0.231 * u * r - 0.02 * gT)
    return np.array([gX / 1.050, gY / 2.020, gLN / (L**2 * 0.1232)])
