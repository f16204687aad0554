"""CyberShip II, 1.255 m: Skjetne, Smogeli and Fossen (2004), Modeling, Identification and Control 25(1), 3-27.

Written by a person who had not read the vessel document, from two programs that have the paper's numbers and actuators:
CyberShipII in FossenEnv.py of MarWaltz/TUD_RL and CyberShip2 of NTNU-TTO/colav-simulator. They differ in two numbers of
the slipstream: 0.06 m (Lindegaard's thesis) and 1014 kg/m^3 in the first, 0.08 m and 1000 kg/m^3 in the second. Shafts
in rev/s: port, starboard, bow; rudders in rad, d > 0 turns to port; drawn within the stops of the vessel, for the paper
has none. Not where she goes astern and a screw pushes ahead.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

DRAWN = {
    **{"u": (-1.0, 1.5), "v": (-0.8, 0.8), "r": (-1.0, 1.0)},
    **{"n1": (-33.0, 33.0), "n2": (-33.0, 33.0), "n3": (-33.0, 33.0), "d1": (-0.61, 0.61), "d2": (-0.61, 0.61)},
    **{"X": (-5.0, 5.0), "Y": (-5.0, 5.0), "N": (-2.0, 2.0)},
}

MASS, X_G = 23.8, 0.046
ADDED = np.array([2.0, 10.0, 1.0])
INERTIA = np.array([[MASS, 0, 0], [0, MASS, MASS * X_G], [0, MASS * X_G, 1.760]]) + np.diag(ADDED)
DIAMETER, RHO = 0.06, 1014.0


def screw(n: float, u: float) -> float:
    if n >= max(0.0, 1.52468e-4 / 3.65034e-3 * u):
        return abs(n) * (3.65034e-3 * n - 1.52468e-4 * u)
    if n <= min(0.0, 4.55822e-2 / 5.10256e-3 * u):
        return abs(n) * (5.10256e-3 * n - 4.55822e-2 * u)
    return 0.0


def rudder(d: float, thrust: float, u: float) -> float:
    flow = u
    if u >= 0:
        flow += 0.5 * (sqrt(max(0.0, 8 * thrust / (pi * RHO * DIAMETER**2) + u * u)) - u)
    slope, stall = (6.43306, 5.83594) if flow >= 0 else (3.19573, 2.34356)
    return d * (slope - stall * abs(d)) * flow * abs(flow)


def in_domain(*, u: float, n1: float, n2: float, **_: float) -> bool:
    return u >= 0 or max(screw(n1, u), screw(n2, u)) <= 0


def accelerations(
    *,
    u: float,
    v: float,
    r: float,
    n1: float,
    n2: float,
    n3: float,
    d1: float,
    d2: float,
    X: float,
    Y: float,
    N: float,
) -> np.ndarray:
    port, starboard = screw(n1, u), screw(n2, u)
    bow = 1.56822e-4 * n3 * abs(n3)
    aft = rudder(d1, port, u) + rudder(d2, starboard, u)
    force = np.array([X + port + starboard, Y + bow + aft, N + 0.078 * (port - starboard) + 0.466 * bow - 0.549 * aft])

    sway, yaw = abs(v), abs(r)
    force[0] += u * (-0.72253 - 1.32742 * abs(u) - 5.86643 * u * u)
    force[1] += v * (-0.88965 - 36.47287 * sway - 0.805 * yaw) + r * (-7.250 - 0.845 * sway - 3.450 * yaw)
    force[2] += v * (0.03130 + 3.95645 * sway + 0.130 * yaw) + r * (-1.900 + 0.080 * sway - 0.750 * yaw)

    along, across = (MASS + ADDED[0]) * u, (MASS + ADDED[1]) * v + MASS * X_G * r  # momentum
    force += [across * r, -along * r, along * v - across * u]
    return np.linalg.solve(INERTIA, force)
