"""Identification as one writes it by hand today: a NumPy model, `solve_ivp`, `least_squares` with finite differences.

The 28.9 m Gunnerus in calm water and no wind: 32 hull derivatives, two azimuth thrusters, drag of the air.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, degrees, sin, tanh

import numpy as np
from scipy.integrate import solve_ivp

from shipid.vessel.load import Vessel

MOTIONS = ("1", "u", "v", "r", "|u|", "|v|", "|r|")
DERIVATIVES = "hull.derivatives."
FINENESS = 1e-6  # rtol of RK45


class Model:
    """Rates of u, v, r from SI numbers by name, and motions along held orders."""

    def __init__(self, vessel: Vessel) -> None:
        value = vessel.parameters
        self.base = np.array([x for path, x in value.items() if path.startswith(DERIVATIVES)])
        names = [path.removeprefix(DERIVATIVES) for path in value if path.startswith(DERIVATIVES)]
        self.factors = np.array([[MOTIONS.index(each) for each in _factors(name)] for name in names]).T
        self.axis = np.array([["XYN".index(name[0]) == row for name in names] for row in range(3)], dtype=float)
        m, I_z = value["inertia.m"], value["inertia.I_z"]
        self.m, self.value = m, value
        self.added = -np.array(
            [
                [value["added_mass.X_udot"], 0, 0],
                [0, value["added_mass.Y_vdot"], value["added_mass.Y_rdot"]],
                [0, value["added_mass.N_vdot"], value["added_mass.N_rdot"]],
            ]
        )
        self.inverse = np.linalg.inv(np.diag([m, m, I_z]) + self.added)
        self.sides = [
            {
                key.removeprefix(f"thruster.{side}."): x
                for key, x in value.items()
                if key.startswith(f"thruster.{side}.")
            }
            for side in ("port", "starboard")
        ]
        wind = vessel.document["wind"]
        self.gamma, self.air = np.array(wind["gamma_deg"]), [np.array(wind[name]) for name in ("C_X", "C_Y", "C_N")]
        self.area = value["wind.A_FW"], value["wind.A_LW"], value["wind.L_oa"], value["constants.rho_a"]

    def rates(self, nu: np.ndarray, orders: Sequence[float], theta: np.ndarray) -> np.ndarray:
        """Accelerations (3,) at nu = (u, v, r) with orders (n, alpha) of both units."""
        u, v, r = (float(x) for x in nu)
        of = np.array([1.0, u, v, r, abs(u), abs(v), abs(r)])
        one, two, three = (of[places] for places in self.factors)
        force = self.axis @ (theta * self.base * one * two * three)
        a, m = self.added, self.m
        c = (a[1, 2] + a[2, 1]) / 2
        side = (m + a[1, 1]) * v + c * r
        force += np.array([side * r, -(m + a[0, 0]) * u * r, (m + a[0, 0]) * u * v - side * u])
        for unit in self.sides:
            force += self.thrust(unit, u, v, r, *orders)
        return np.asarray(self.inverse @ (force + self.drag(u, v)))

    def thrust(self, of: dict[str, float], u: float, v: float, r: float, n: float, alpha: float) -> np.ndarray:
        """Force (3,) of one unit going ahead."""
        along, across = u - r * of["y"], v + r * of["x"]
        c, s, width = cos(alpha), sin(alpha), n * of["D_p"]
        J, y = (c * along + s * across) / width, (c * across - s * along) / width
        J_c, y_c = min(max(J, of["J_min"]), of["J_max"]), min(max(y, -of["Jy_max"]), of["Jy_max"])
        t = tanh(abs(y_c) / of["J_t"])
        over, under = J - min(J, of["J_max"]), J - max(J, of["J_min"])
        K_x = of["K_x.1"] + of["K_x.J"] * J_c + of["K_x.JJ"] * J_c**2 + of["K_x.JJJ"] * J_c**3
        K_x += of["K_x.Jt"] * J_c * t + of["K_x.yy"] * y_c**2 + of["K_x.Jyy"] * J_c * y_c**2
        K_x -= over * (of["k_over"] + of["k_over2"] * over) + of["k_under"] * under
        K_y = of["K_y.y"] * y_c + of["K_y.Jy"] * J_c * y_c + of["K_y.y|y|"] * y_c * abs(y_c)
        K_y -= (of["k_side"] + of["k_sideJ"] * max(J_c, 0)) * (y - y_c)
        scale = of["k_T"] * self.value["constants.rho"] * n**2 * of["D_p"] ** 4
        F_x, F_y = scale * (c * K_x - s * K_y), scale * (s * K_x + c * K_y)
        return np.array([F_x, F_y, of["x"] * F_y - of["y"] * F_x])

    def drag(self, u: float, v: float) -> np.ndarray:
        """Force (3,) of air at rest."""
        gamma, (front, side, length, rho) = -atan2(v, u), self.area
        C_X, C_Y, C_N = (np.interp(abs(degrees(gamma)), self.gamma, values) for values in self.air)
        q, sense = rho / 2 * (u**2 + v**2), np.sign(gamma)
        return np.array([q * front * C_X, sense * q * side * C_Y, sense * q * side * length * C_N])

    def motion(self, start: np.ndarray, orders: np.ndarray, theta: np.ndarray, step: float) -> np.ndarray:
        """u, v, r (N, 3) after every step with orders (N, 2) held over each; nan where it cannot go on."""
        count = len(orders)
        solution = solve_ivp(
            lambda t, nu: self.rates(nu, orders[min(int(t / step), count - 1)], theta),
            (0.0, count * step),
            start,
            t_eval=step * np.arange(1, count + 1),
            rtol=FINENESS,
        )
        return solution.y.T if solution.success else np.full((count, 3), np.nan)


def _factors(name: str) -> list[str]:
    """`Y_v|r|` -> v, |r|, 1: three factors."""
    rest, factors = name.split("_", 1)[1], []
    while rest:
        size = 3 if rest[0] == "|" else 1
        factors.append(rest[:size])
        rest = rest[size:]
    return [*factors, "1", "1"][:3]
