"""Esso tanker of 190,000 dwt, 304.8 m: van Berlekom and Goddard (1972), SNAME Transactions 80, 264-298.

Written from tanker.m of the MSS toolbox by a person who had not read the vessel document; deep water, so the terms with
the depth parameter zeta are zero. All numbers are in the bis system. Ship ahead, shaft ahead or stopped, in rpm;
delta > 0 turns to port. The source has accelerations only, and no mass. Drawn within the stops of the vessel: those of
the source stop the rudder at 10 deg and the shaft at 80 rpm.
"""

from __future__ import annotations

from math import atan

import numpy as np

DRAWN = {"u": (0.02, 12.0), "v": (-4.0, 4.0), "r": (-0.02, 0.02), "delta": (-0.61, 0.61), "rpm": (0.0, 90.0)}

LENGTH = 304.8


def accelerations(*, u: float, v: float, r: float, delta: float, rpm: float) -> np.ndarray:
    n, sway, drift = rpm / 60, abs(v), atan(v / u)
    turn = LENGTH * r  # m/s
    thrust = -0.00695 * u * u - 0.00063 * LENGTH * u * n + 0.0000354 * LENGTH**2 * n * n  # T'' g L
    stream = 0.605 * u * n + 38.2 * n * n  # c^2, of the flow at the rudder
    across = stream * drift * abs(drift) * abs(delta)  # c^2 beta|beta||delta|

    surge = -0.0377 * u * u + 0.3 * v * v + 2.020 * v * turn + (1 - 0.22) * thrust
    surge += stream * delta * (0.152 * drift - 0.093 * delta)
    side = -(1.205 * u + 2.4 * sway) * v - 0.752 * u * turn + 0.208 * stream * delta - 2.16 * across + 0.04 * thrust
    yaw = -0.451 * u * v - (0.3 * sway + 0.231 * u) * turn - 0.098 * stream * delta + 0.688 * across - 0.02 * thrust
    return np.array([surge, side, yaw / LENGTH]) / LENGTH / [1.050, 2.020, 0.1232]
