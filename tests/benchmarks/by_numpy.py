"""Rollouts as one writes them by hand in NumPy: arrays over samples, the 28.9 m Gunnerus in wind, explicit Euler."""

from __future__ import annotations

from typing import Any

import numpy as np

from shipid.vessel.load import Vessel

MOTIONS = ("1", "u", "v", "r", "|u|", "|v|", "|r|")
DERIVATIVES = "hull.derivatives."

Array = np.ndarray[Any, Any]


class Fleet:
    """The vessel as one writes it by hand, for many samples at once, with wind."""

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

    def roll_out(self, state: Array, commands: Array, wind: Array, step: float, num_steps: int) -> Array:
        """States (6, S) after `num_steps` steps from north, east, psi, u, v, r (6, S); commands (4, S), wind (2, S).

        commands : n and alpha of the port unit, then of the starboard unit [Hz, rad]; wind : speed [m/s] and the
        direction that it blows to [rad].
        """
        weights = self.axis * self.base
        north, east = wind[0] * np.cos(wind[1]), wind[0] * np.sin(wind[1])
        units = [
            (unit, n, np.cos(alpha), np.sin(alpha))
            for unit, n, alpha in zip(self.sides, commands[0::2], commands[1::2], strict=True)
        ]
        state = state.copy()
        for _ in range(num_steps):
            psi, (u, v, r) = state[2], state[3:]
            c, s = np.cos(psi), np.sin(psi)
            force = self.hull(weights, u, v, r)
            for unit, n, ahead, aside in units:
                force += self.thrusts(unit, u, v, r, n, ahead, aside)
            force += self.wind(u - north * c - east * s, v - east * c + north * s)
            rates = np.stack([c * u - s * v, s * u + c * v, r, *(self.inverse @ force)])
            state += step * rates
        return state

    def hull(self, weights: Array, u: Array, v: Array, r: Array) -> Array:
        """Force (3, S) of the hull and of the turning of the axes."""
        of = np.stack([np.ones_like(u), u, v, r, np.abs(u), np.abs(v), np.abs(r)])
        one, two, three = (of[places] for places in self.factors)
        force = weights @ (one * two * three)
        a, m = self.added, self.m
        side = (m + a[1, 1]) * v + (a[1, 2] + a[2, 1]) / 2 * r
        force[0] += side * r
        force[1] -= (m + a[0, 0]) * u * r
        force[2] += (m + a[0, 0]) * u * v - side * u
        return np.asarray(force)

    def thrusts(
        self, of: dict[str, float], u: Array, v: Array, r: Array, n: Array, ahead: Array, aside: Array
    ) -> Array:
        """Force (3, S) of one unit; all turn ahead."""
        along, across, width = u - r * of["y"], v + r * of["x"], n * of["D_p"]
        J, y = (ahead * along + aside * across) / width, (ahead * across - aside * along) / width
        J_c, y_c = np.clip(J, of["J_min"], of["J_max"]), np.clip(y, -of["Jy_max"], of["Jy_max"])
        t = np.tanh(np.abs(y_c) / of["J_t"])
        over, under = np.maximum(J - of["J_max"], 0), np.minimum(J - of["J_min"], 0)
        K_x = of["K_x.1"] + J_c * (of["K_x.J"] + J_c * (of["K_x.JJ"] + J_c * of["K_x.JJJ"]) + of["K_x.Jt"] * t)
        K_x += y_c**2 * (of["K_x.yy"] + of["K_x.Jyy"] * J_c)
        K_x -= over * (of["k_over"] + of["k_over2"] * over) + of["k_under"] * under
        K_y = y_c * (of["K_y.y"] + of["K_y.Jy"] * J_c + of["K_y.y|y|"] * np.abs(y_c))
        K_y -= (of["k_side"] + of["k_sideJ"] * np.maximum(J_c, 0)) * (y - y_c)
        scale = of["k_T"] * self.value["constants.rho"] * of["D_p"] ** 4 * n**2
        F_x, F_y = scale * (ahead * K_x - aside * K_y), scale * (aside * K_x + ahead * K_y)
        return np.stack([F_x, F_y, of["x"] * F_y - of["y"] * F_x])

    def wind(self, u: Array, v: Array) -> Array:
        """Force (3, S) of the air that comes with -u, -v."""
        gamma, (front, side, length, rho) = -np.arctan2(v, u), self.area
        angle = np.abs(np.degrees(gamma))
        C_X, C_Y, C_N = (np.interp(angle, self.gamma, values) for values in self.air)
        q, sense = rho / 2 * (u**2 + v**2), np.sign(gamma)
        return np.stack([q * front * C_X, sense * q * side * C_Y, sense * q * side * length * C_N])


def _factors(name: str) -> list[str]:
    """`Y_v|r|` -> v, |r|, 1: three factors."""
    rest, factors = name.split("_", 1)[1], []
    while rest:
        size = 3 if rest[0] == "|" else 1
        factors.append(rest[:size])
        rest = rest[size:]
    return [*factors, "1", "1"][:3]
