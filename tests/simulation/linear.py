"""The linear ship in the frequency domain, from the numbers of a vessel document alone: no code of the simulation.

[-omega^2 (M_RB + M_A) + i omega (K(i omega) + B) + C] xi = F, about the document's origin, time factor exp(+i omega t).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from shipid.vessel.load import Vessel

AXES = "XYZKMN"
SPEEDS = "uvwpqr"
HEAVE, ROLL, PITCH = 2, 3, 4
UPRIGHT = (HEAVE, ROLL, PITCH)
MIRROR = np.array([1, -1, 1, -1, 1, -1])


@dataclass(frozen=True, eq=False)
class Linear:
    """Matrices [6 x 6] and transfer functions of a document at zero speed."""

    document: Mapping[str, Any]

    @cached_property
    def M(self) -> np.ndarray:
        """Rigid-body mass."""
        inertia = self.document["inertia"]
        m, x, z = inertia["m"], inertia["x_G"], inertia["z_G"]
        M = np.diag([m, m, m, inertia["I_x"], inertia["I_y"], inertia["I_z"]])
        for i, j, value in ((0, 4, m * z), (1, 3, -m * z), (1, 5, m * x), (2, 4, -m * x)):
            M[i, j] = M[j, i] = value
        return M

    @cached_property
    def A(self) -> np.ndarray:
        """Added mass, at infinite frequency where there is memory."""
        A = np.zeros((6, 6))
        for name, value in self.document["added_mass"].items():
            if name != "source":
                A[AXES.index(name[0]), SPEEDS.index(name[2])] = -value
        return A

    @cached_property
    def B(self) -> np.ndarray:
        """Damping without memory: linear hull derivatives."""
        B = np.zeros((6, 6))
        for name, value in self.document["hull"]["derivatives"].items():
            if len(name) == 3 and name[1] == "_" and name[2] in SPEEDS:
                B[AXES.index(name[0]), SPEEDS.index(name[2])] = -value
        return B

    @cached_property
    def C(self) -> np.ndarray:
        """Restoring."""
        hydrostatic, constants = self.document["restoring"]["hydrostatic"], self.document["constants"]
        stiffness, weight = (constants["rho"] * constants["g"] * hydrostatic[name] for name in ("A_wp", "nabla"))
        C = np.zeros((6, 6))
        C[2, 2], C[3, 3], C[4, 4] = stiffness, weight * hydrostatic["GM_T"], weight * hydrostatic["GM_L"]
        C[2, 4] = C[4, 2] = -hydrostatic["x_F"] * stiffness
        return C

    def memory(self, omega: np.ndarray) -> np.ndarray:
        """K(i omega) = int_0^inf K(t) exp(-i omega t) dt, (..., 6, 6)."""
        omega = np.asarray(omega)
        K = np.zeros((*omega.shape, 6, 6), dtype=complex)
        pairs = {"33": (2, 2), "35": (2, 4), "55": (4, 4), "44": (3, 3)}
        for block in self.document["radiation"].values():
            sigma, mode = np.array(block["sigma"]), np.array(block["omega"])
            s = 1j * omega[..., None] + sigma
            for name, (i, j) in pairs.items():
                if f"K{name}_cos" in block:
                    a, b = np.array(block[f"K{name}_cos"]), np.array(block[f"K{name}_sin"])
                    K[..., i, j] = K[..., j, i] = ((a * s + b * mode) / (s**2 + mode**2)).sum(axis=-1)
        return K

    def added_mass(self, omega: np.ndarray) -> np.ndarray:
        """A(omega), (..., 6, 6)."""
        return np.asarray(self.A + self.memory(omega).imag / np.asarray(omega)[..., None, None])

    def excitation(self, omega: np.ndarray, beta: float) -> np.ndarray:
        """F(omega, beta), (n, 6), per metre of amplitude: trigonometric in the heading, Lagrange in the frequency."""
        return heading_weights(beta, self.table[1].shape[1]) @ lagrange(omega, *self.table)

    @cached_property
    def table(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies, and F (num_omega, 24 headings all round, 6)."""
        columns = {name: np.array(values) for name, values in self.document["waves"]["first_order"]["table"].items()}
        omega, headings = np.unique(columns["omega"]), np.unique(columns["beta_deg"])
        F = np.empty((len(omega), len(headings), 6), dtype=complex)
        i, j = np.searchsorted(omega, columns["omega"]), np.searchsorted(headings, columns["beta_deg"])
        for axis, name in enumerate(AXES):
            F[i, j, axis] = columns[f"{name}_real"] + 1j * columns[f"{name}_imag"]
        return omega, all_round(F, MIRROR)

    def response(self, omega: np.ndarray, beta: float) -> np.ndarray:
        """Motions per metre of amplitude, (n, 6)."""
        w = omega[:, None, None]
        system = -(w**2) * (self.M + self.A) + 1j * w * (self.memory(omega) + self.B) + self.C
        return np.asarray(np.linalg.solve(system, self.excitation(omega, beta)[..., None])[..., 0])


def linear(vessel: Vessel) -> Linear:
    """The linear ship of a vessel."""
    return Linear(vessel.document)


def all_round(values: np.ndarray, mirror: np.ndarray) -> np.ndarray:
    """Values (n, 13, k) at 0 ... 180 deg continued to 24 headings by port/starboard symmetry."""
    return np.concatenate([values, values[:, -2:0:-1] * mirror], axis=1)


def heading_weights(beta: float | np.ndarray, count: int) -> np.ndarray:
    """Weights (..., count) of equally spaced headings: the Dirichlet kernel, with half of its last harmonic."""
    apart = np.asarray(beta, dtype=float)[..., None] - 2 * np.pi * np.arange(count) / count
    harmonics = sum((np.cos(m * apart) for m in range(1, count // 2)), np.zeros_like(apart))
    return np.asarray((1 + 2 * harmonics + np.cos(count / 2 * apart)) / count)


def lagrange(x: np.ndarray, grid: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Cubic through the four nodes about each x (n,): values (len(grid), ...) -> (n, ...)."""
    result = np.empty((len(x), *values.shape[1:]), dtype=values.dtype)
    for row, at in enumerate(x):
        first = int(np.clip(np.searchsorted(grid, at) - 2, 0, len(grid) - 4))
        nodes = grid[first : first + 4]
        weights = [np.prod([(at - b) / (a - b) for b in nodes if b != a]) for a in nodes]
        result[row] = np.tensordot(weights, values[first : first + 4], axes=1)
    return result
