"""Otter USV, 2 m, with a payload of 25 kg: Fossen (2021), Handbook of Marine Craft Hydrodynamics and Motion Control.

Written from otter.py and gnc.py of PythonVehicleSimulator by a person who had not read the vessel document; otter.m of
the MSS toolbox is a later calibration. Heave, roll and pitch are held at zero: the rows and columns of surge, sway and
yaw. Kept as in the source: a moment of inertia about the origin that is moved to the origin a second time, no Munk
moment, the cross-flow of one pontoon on 21 strips of a twentieth of the length. Shafts in rad/s, with stops.
"""

from __future__ import annotations

import numpy as np

DRAWN = {
    **{"u": (-2.0, 4.0), "v": (-1.5, 1.5), "r": (-1.0, 1.0), "n1": (-115.0, 115.0), "n2": (-115.0, 115.0)},
    **{"X": (-100.0, 100.0), "Y": (-100.0, 100.0), "N": (-50.0, 50.0)},
}

LENGTH, PONTOON, GRAVITY = 2.0, 0.25, 9.81
HULL, PAYLOAD = 55.0, 25.0
MASS = HULL + PAYLOAD
X_G = HULL * 0.2 / MASS  # the payload is amidships
I_Z = HULL * ((0.25 * LENGTH) ** 2 + X_G**2)
DRAUGHT = MASS / 1025 / (2 * 0.4 * PONTOON * LENGTH)
ADDED = [0.1 * HULL, 1.5 * HULL, 1.7 * I_Z]
INERTIA = np.array([[MASS, 0, 0], [0, MASS, MASS * X_G], [0, MASS * X_G, I_Z + MASS * X_G**2]]) + np.diag(ADDED)
HOERNER = [0.5585, 0.6464], [1.0836, 0.9986]  # the two points of the curve about B / (2 T)
DRAG = np.interp(PONTOON / (2 * DRAUGHT), *HOERNER)
STRIPS = LENGTH / 20 * np.arange(-10, 11)


def screw(n: float) -> float:
    pull, most = (0.02216 / 2, 24.4) if n > 0 else (0.01289 / 2, 13.6)  # N s^2; kg, of both
    return np.sign(n) * min(pull * n * n, most / 2 * GRAVITY)


def accelerations(*, u: float, v: float, r: float, n1: float, n2: float, X: float, Y: float, N: float) -> np.ndarray:
    port, starboard = screw(n1), screw(n2)
    force = np.array([X + port + starboard, Y, N + 0.395 * (port - starboard)])
    force[0] -= 24.4 * GRAVITY / (6 * 0.5144) * u
    force[2] -= INERTIA[2, 2] * (1 + 10 * abs(r)) * r  # the time constant is 1 s
    flow = v + STRIPS * r
    strip = -0.5 * 1026 * DRAUGHT * DRAG * LENGTH / 20 * flow * abs(flow)
    force[1:] += strip.sum(), STRIPS @ strip
    force += MASS * r * np.array([v + X_G * r, -u, -X_G * u])
    force += r * np.array([ADDED[1] * v, -ADDED[0] * u, 0])
    return np.linalg.solve(INERTIA, force)
