"""CyberShip II, 1.255 m: Skjetne, Smogeli and Fossen (2004), Modeling, Identification and Control 25(1), 3-27.

Two screws and two rudders aft, port first, and a bow tunnel; shaft speeds in rev/s, rudder angles > 0 to port as in the
source. The paper has no race of a screw that drives ahead while the ship goes astern: such states are left out.
"""

from __future__ import annotations

import numpy as np

DRAWN = {
    **{"u": (-0.4, 1.2), "v": (-0.3, 0.3), "r": (-0.5, 0.5)},
    **{"n1": (-30.0, 33.0), "n2": (-30.0, 33.0), "n3": (-30.0, 30.0), "d1": (-0.6, 0.6), "d2": (-0.6, 0.6)},
}


def in_domain(*, u: float, n1: float, n2: float, **_: float) -> bool:
    return u >= 0 or max(n1, n2) <= 0


def thrust(n: float, u: float) -> float:
    """No thrust between the shaft speeds at which a screw is driven by the water."""
    if n >= max(0.0, 1.52468e-4 / 3.65034e-3 * u):
        return 3.65034e-3 * abs(n) * n - 1.52468e-4 * abs(n) * u
    if n <= min(0.0, 4.55822e-2 / 5.10256e-3 * u):
        return 5.10256e-3 * abs(n) * n - 4.55822e-2 * abs(n) * u
    return 0.0


def lift(T: float, u: float, delta: float) -> float:
    flow = u + 0.5 * (np.sqrt(max(0.0, 8 / (np.pi * 1014 * 0.06**2) * T + u**2)) - u) if u >= 0 else u
    first, second = (6.43306, 5.83594) if flow >= 0 else (3.19573, 2.34356)
    return (first * delta - second * abs(delta) * delta) * abs(flow) * flow


def accelerations(*, u: float, v: float, r: float, n1: float, n2: float, n3: float, d1: float, d2: float) -> np.ndarray:
    m, I_z, x_g = 23.8, 1.760, 0.046
    X_udot, Y_vdot, Y_rdot, N_vdot, N_rdot = -2.0, -10.0, 0.0, 0.0, -1.0
    M = np.array([[m - X_udot, 0, 0], [0, m - Y_vdot, m * x_g - Y_rdot], [0, m * x_g - N_vdot, I_z - N_rdot]])
    c13 = -m * (x_g * r + v) + Y_vdot * v + (N_vdot + Y_rdot) / 2 * r
    c23 = m * u - X_udot * u
    C = np.array([[0, 0, c13], [0, 0, c23], [-c13, -c23, 0]])
    D = np.array(
        [
            [0.72253 + 1.32742 * abs(u) + 5.86643 * u**2, 0, 0],
            [0, 0.88965 + 36.47287 * abs(v) + 0.805 * abs(r), 7.250 + 0.845 * abs(v) + 3.450 * abs(r)],
            [0, -0.03130 - 3.95645 * abs(v) - 0.130 * abs(r), 1.900 - 0.080 * abs(v) + 0.750 * abs(r)],
        ]
    )
    T1, T2, T3 = thrust(n1, u), thrust(n2, u), 1.56822e-4 * abs(n3) * n3
    L1, L2 = lift(T1, u, d1), lift(T2, u, d2)
    tau = [T1 + T2, T3 + L1 + L2, 0.078 * T1 - 0.078 * T2 + 0.466 * T3 - 0.549 * L1 - 0.549 * L2]
    nu = np.array([u, v, r])
    return np.linalg.solve(M, np.array(tau) - C @ nu - D @ nu)
