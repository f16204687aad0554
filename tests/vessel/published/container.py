"""Container ship, 175 m, with roll: Son and Nomoto (1982), Naval Arch. Ocean Eng. 20, 73-83.

Equations and numbers as in the MSS toolbox (container.m, with its corrections of 2001 and 2022), in primes of the
speed of the moment. rpm of the shaft, delta > 0 to starboard.
"""

from __future__ import annotations

import numpy as np

DRAWN = {
    **{"u": (3.0, 12.0), "v": (-2.0, 2.0), "p": (-0.05, 0.05), "r": (-0.02, 0.02), "phi": (-0.3, 0.3)},
    **{"delta": (-0.6, 0.6), "rpm": (40.0, 160.0)},
}

# one row a monomial: factors, then the derivatives of Y, K and N
HULL = """
v         -0.0116    0.0003026   -0.0038545
r          0.00242  -0.000063    -0.00222
p          0        -0.0000075    0.000213
h         -0.000063 -0.000021    -0.0001424
vvv       -0.109     0.002843     0.001492
rrr        0.00177  -0.0000462   -0.00229
vvr        0.0214   -0.000588    -0.0424
vrr       -0.0405    0.0010565    0.00156
vvh        0.04605  -0.0012012   -0.019058
vhh        0.00304  -0.0000793   -0.0053766
rrh        0.009325 -0.000243    -0.0038592
rhh       -0.001368  0.00003569   0.0024195
"""


def accelerations(*, u: float, v: float, p: float, r: float, phi: float, delta: float, rpm: float) -> np.ndarray:
    L, rho, g, nabla, D, GM = 175.0, 1025.0, 9.81, 21222.0, 6.533, 0.3
    U = np.hypot(u, v)
    u, v, p, r, n = u / U, v / U, p * L / U, r * L / U, rpm / 60
    m, mx, my, Ix, Iz = 0.00792, 0.000238, 0.007049, 0.0000176, 0.000456
    Jx, Jz, alpha_y, l_x, l_y = 0.0000034, 0.000419, 0.05, 0.0313, 0.0313

    v_R = 0.088 * v - 0.156 * r - 0.275 * r**3 + 1.96 * r**2 * v
    u_P = u * ((1 - 0.184) + 1.09 * (v - 0.526 * r) ** 2)
    J = u_P * U / (n * D)
    K_T = 0.527 - 0.455 * J
    u_R = u_P * 0.921 * np.sqrt(1 + 8 * 0.631 * K_T / (np.pi * J**2))
    aspect, A_R = 1.8219, 33.0376
    F_N = -6.13 * aspect / (aspect + 2.25) * A_R / L**2 * (u_R**2 + v_R**2) * np.sin(delta + np.arctan(v_R / u_R))
    T = 2 * D**4 / (U**2 * L**2) * K_T * n * abs(n)
    W = rho * g * nabla / (rho * L**2 * U**2 / 2)

    factors = {"v": v, "r": r, "p": p, "h": phi}
    rows = [line.split() for line in HULL.strip().splitlines()]
    Y, K, N = sum(np.prod([factors[f] for f in row[0]]) * np.array(row[1:], float) for row in rows)
    X = -0.0004226 * u**2 + (1 - 0.175) * T - 0.00311 * v * r - 0.00386 * v**2 + 0.00020 * r**2 - 0.00020 * phi**2
    X += 0.71 * F_N * np.sin(delta) + (m + my) * v * r
    Y += (1 + 0.237) * F_N * np.cos(delta) - (m + mx) * u * r
    K += -(1 + 0.237) * 0.033 * F_N * np.cos(delta) + mx * l_x * u * r - W * GM / L * phi
    N += (-0.5 + 0.237 * -0.48) * F_N * np.cos(delta)

    M = np.array([[m + my, -my * l_y, my * alpha_y], [-my * l_y, Ix + Jx, 0], [my * alpha_y, 0, Iz + Jz]])
    v_dot, p_dot, r_dot = np.linalg.solve(M, [Y, K, N])
    return np.array([X / (m + mx) * U**2 / L, v_dot * U**2 / L, p_dot * U**2 / L**2, r_dot * U**2 / L**2])
