"""Supply vessel, 76.2 m, about zero speed: Fossen, Sagatun and Soerensen (1996), Control Engineering Practice 4(3).

Written from supply.py of PythonVehicleSimulator by a person who had not read the vessel document. supply.m of the MSS
toolbox has the same two bis matrices and no thrusters, and takes 9.8 m/s^2 where supply.py has 9.81. Shafts in rpm;
n1 and n2 drive the tunnels at the bow, n3 the starboard screw and n4 the port screw, with stops.
"""

from __future__ import annotations

import numpy as np

DRAWN = {
    **{"u": (-5.0, 5.0), "v": (-3.0, 3.0), "r": (-0.05, 0.05)},
    **{"n1": (-280.0, 280.0), "n2": (-280.0, 280.0), "n3": (-180.0, 180.0), "n4": (-180.0, 180.0)},
    **{"X": (-5e5, 5e5), "Y": (-5e5, 5e5), "N": (-2e7, 2e7)},
}

LENGTH, MASS, GRAVITY = 76.2, 6e6, 9.81
SCALE = MASS * np.outer([1, 1, LENGTH], [1, 1, LENGTH])  # of the bis system, an entry each
INERTIA = SCALE * [[1.1274, 0, 0], [0, 1.8902, -0.0744], [0, -0.0744, 0.1278]]
DAMPING = SCALE * np.sqrt(GRAVITY / LENGTH) * [[0.0358, 0, 0], [0, 0.1183, -0.0124], [0, -0.0041, 0.0308]]


def accelerations(
    *, u: float, v: float, r: float, n1: float, n2: float, n3: float, n4: float, X: float, Y: float, N: float
) -> np.ndarray:
    shafts = np.clip([n1, n2, n3, n4], [-250, -250, -160, -160], [250, 250, 160, 160])
    bow, aft, starboard, port = [2.4, 2.4, 17.6, 17.6] * shafts * abs(shafts)
    driven = [starboard + port, bow + aft, 30 * bow + 22 * aft + LENGTH / 2 * (port - starboard)]
    return np.linalg.solve(INERTIA, np.add(driven, [X, Y, N]) - DAMPING @ [u, v, r])
