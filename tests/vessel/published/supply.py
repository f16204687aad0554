"""Supply vessel, 76.2 m: Fossen, Sagatun and Soerensen (1996), Control Eng. Practice 4(3), 369-376.

Bis-scaled matrices as in the MSS toolbox (supply.m) and PythonVehicleSimulator (supply.py, MIT), whose thrusters these
are: two bow tunnels, then the starboard and the port propeller, rpm.
"""

from __future__ import annotations

import numpy as np

DRAWN = {
    **{"u": (-2.0, 3.0), "v": (-1.5, 1.5), "r": (-0.03, 0.03)},
    **{"n1": (-250.0, 250.0), "n2": (-250.0, 250.0), "n3": (-160.0, 160.0), "n4": (-160.0, 160.0)},
}


def accelerations(*, u: float, v: float, r: float, n1: float, n2: float, n3: float, n4: float) -> np.ndarray:
    L, g, m = 76.2, 9.81, 6000.0e3
    M_bis = np.array([[1.1274, 0, 0], [0, 1.8902, -0.0744], [0, -0.0744, 0.1278]])
    D_bis = np.array([[0.0358, 0, 0], [0, 0.1183, -0.0124], [0, -0.0041, 0.0308]])
    to_SI = np.diag([1.0, 1.0, L])
    M = m * to_SI @ M_bis @ to_SI
    D = m * np.sqrt(g / L) * to_SI @ D_bis @ to_SI
    thrust = np.array([2.4, 2.4, 17.6, 17.6]) * np.array([n * abs(n) for n in (n1, n2, n3, n4)])
    configuration = np.array([[0, 0, 1, 1], [1, 1, 0, 0], [30, 22, -L / 2, L / 2]])
    return np.linalg.solve(M, configuration @ thrust - D @ np.array([u, v, r]))
