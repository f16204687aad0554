"""Otter USV of Maritime Robotics, 2 m, with 25 kg payload: Fossen (2021), in PythonVehicleSimulator (otter.py, MIT).

The six degrees of freedom of the source in the horizontal plane: heave, roll and pitch, their rates and accelerations
are zero. Shaft speeds in rad/s, port first.
"""

from __future__ import annotations

import numpy as np

DRAWN = {"u": (-1.0, 3.0), "v": (-0.8, 0.8), "r": (-0.8, 0.8), "n1": (-110.0, 115.0), "n2": (-110.0, 115.0)}

RATIO = [0.0109, 0.1766, 0.3530, 0.4519, 0.4728, 0.4929, 0.4933, 0.5585, 0.6464, 0.8336]
RATIO += [0.9880, 1.3081, 1.6392, 1.8600, 2.3129, 2.6000, 3.0088, 3.4508, 3.7379, 4.0031]
HOERNER = [1.9661, 1.9657, 1.8976, 1.7872, 1.5837, 1.2786, 1.2108, 1.0836, 0.9986, 0.8796]
HOERNER += [0.8284, 0.7599, 0.6914, 0.6571, 0.6307, 0.5962, 0.5868, 0.5859, 0.5599, 0.5593]


def cross(a: np.ndarray) -> np.ndarray:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def accelerations(*, u: float, v: float, r: float, n1: float, n2: float) -> np.ndarray:
    g, rho, L, m, payload, B_pontoon, y_pontoon = 9.81, 1025.0, 2.0, 55.0, 25.0, 0.25, 0.395
    nu = np.array([u, v, 0, 0, 0, r])
    r_p = np.array([0, 0, -0.35])
    r_g = (m * np.array([0.2, 0, -0.2]) + payload * r_p) / (m + payload)
    draught = (m + payload) / rho / (2 * 0.4 * B_pontoon * L)
    I_g = m * np.diag([(0.4 * 1.08) ** 2, (0.25 * L) ** 2, (0.25 * L) ** 2])
    I_g = I_g - m * cross(r_g) @ cross(r_g) - payload * cross(r_p) @ cross(r_p)
    H = np.eye(6)
    H[:3, 3:] = cross(r_g).T
    M_CG, C_CG = np.zeros((6, 6)), np.zeros((6, 6))
    M_CG[:3, :3], M_CG[3:, 3:] = (m + payload) * np.eye(3), I_g
    C_CG[:3, :3], C_CG[3:, 3:] = (m + payload) * cross(nu[3:]), -cross(I_g @ nu[3:])
    M_A = np.diag([0.1 * m, 1.5 * m, 1.0 * m, 0.2 * I_g[0, 0], 0.8 * I_g[1, 1], 1.7 * I_g[2, 2]])
    C_A = np.zeros((6, 6))
    C_A[:3, 3:] = C_A[3:, :3] = -cross(M_A[:3, :3] @ nu[:3])
    C_A[3:, 3:] = -cross(M_A[3:, 3:] @ nu[3:])
    C_A[5, :2] = 0  # no Munk moment in yaw
    M = H.T @ M_CG @ H + M_A
    k = (0.02216 / 2, 0.01289 / 2)
    most, least = np.sqrt(0.5 * 24.4 * g / k[0]), -np.sqrt(0.5 * 13.6 * g / k[1])
    thrust = [(k[0] if n > 0 else k[1]) * n * abs(n) for n in np.clip([n1, n2], least, most)]
    tau = np.array([sum(thrust), 0, 0, 0, 0, y_pontoon * (thrust[0] - thrust[1])])
    X_u, N_r = -24.4 * g / (6 * 0.5144), -M[5, 5] / 1.0
    tau += np.array([X_u * u, 0, 0, 0, 0, N_r * r + 10 * N_r * abs(r) * r])
    C_d = np.interp(B_pontoon / (2 * draught), RATIO, HOERNER)
    for i in range(21):  # the source counts both ends whole
        x = -L / 2 + i * L / 20
        drag = -0.5 * 1026 * draught * C_d * abs(v + x * r) * (v + x * r) * L / 20
        tau += np.array([0, drag, 0, 0, 0, x * drag])
    plane = [0, 1, 5]
    force = tau - (H.T @ C_CG @ H + C_A) @ nu
    return np.linalg.solve(M[np.ix_(plane, plane)], force[plane])
