"""Ships that nobody would build: any terms of the physics in any lawful combination, by seed, and extreme states.

Sizes of numbers are those of ships from 0.8 to 350 m, so that a rollout of a few steps stays finite; nothing else about
them is sensible.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shipid.physics.grammar import hull_derivative
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, check_document

Random = np.random.Generator
GRAVITY = 9.81
AXES = {3: "XYN", 4: "XYKN", 6: "XYZKMN"}
MOTIONS = {3: "uvr", 4: "uvpr", 6: "uvwpqr"}
DAMPING = {"X_u|u|": 0.02, "Y_v|v|": 0.6, "N_r|r|": 0.05, "Z_w|w|": 0.5, "K_p|p|": 0.3, "M_q|q|": 0.1}
SCREWS = ("propeller", "controllable_pitch", "four_quadrant", "quadratic")
DRIVES = (*SCREWS, "azimuth", "tunnel", "service_speed")
FORCES = ("force", "swivel_force")
RUDDERS = ("rudder", "rudder_polynomial", "rudder_coefficients", "rudder_derivatives")


@dataclass(frozen=True)
class Size:
    """Main numbers of a ship [SI]: sizes, mass, service speed and shaft speed, and a force of the hull."""

    L: float
    B: float
    T: float
    m: float
    U: float
    n: float
    rho: float

    @property
    def force(self) -> float:
        """Half rho L T U^2 [N]."""
        return 0.5 * self.rho * self.L * self.T * self.U**2

    @property
    def D_p(self) -> float:
        """Diameter of a screw [m]."""
        return 0.55 * self.T

    @property
    def thrust(self) -> float:
        """Thrust of a screw [N]."""
        return 0.25 * self.rho * self.D_p**4 * self.n**2

    @property
    def time(self) -> float:
        """Square root of L / g [s]."""
        return float(np.sqrt(self.L / GRAVITY))


@dataclass(frozen=True)
class Dice:
    """Draws: a number in a range, and whether something happens."""

    random: Random

    def __call__(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def maybe(self, share: float = 0.5) -> bool:
        """Whether it happens."""
        return bool(self.random.random() < share)

    def choice(self, names: Any) -> str:
        """Return one of some words."""
        return str(self.random.choice(list(names)))


def drawn_ship(seed: int, dof: int = 3) -> Vessel:
    """A ship with terms drawn by seed."""
    dice = Dice(np.random.default_rng([seed, dof]))
    L = float(np.exp(dice(np.log(0.8), np.log(350.0))))
    B = L / dice(3.2, 8)
    T, U, rho = B / dice(2, 5), dice(0.1, 0.4) * float(np.sqrt(GRAVITY * L)), 1025.0
    size = Size(L, B, T, rho * dice(0.45, 0.85) * L * B * T, U, dice(0.7, 1.2) * U / (0.7 * 0.55 * T), rho)
    document: dict[str, Any] = {
        "name": f"Ship {seed}", "dof": dof,
        "particulars": {"L_pp": L, "L_oa": 1.05 * L, "B": B, "T": T, "U_0": U},
        "constants": {"rho": rho, "rho_a": 1.2, "g": GRAVITY},
        **_masses(size, dof, dice), "hull": _hull(size, dof, dice), "thruster": _thrusters(size, dice),
    }  # fmt: skip
    if dof > 3:
        document["restoring"] = {"hydrostatic": {
            "A_wp": 0.8 * L * B, "x_F": dice(-0.05, 0.05) * L, "nabla": size.m / rho, "GM_T": dice(0.02, 0.2) * B,
            "GM_L": dice(0.8, 1.5) * L,
        }}  # fmt: skip
        document["radiation"] = _radiation(size, dof, dice)
    if dice.maybe(0.7):
        document["wind"] = _wind(size, dice)
    if dice.maybe():
        document["current"] = {"kind": "uniform"}
    document["thruster"] |= _forces(size, Dice(np.random.default_rng([seed, dof, len(FORCES)])))
    return check_document(document, f"drawn-{seed}.toml")


def _masses(size: Size, dof: int, dice: Dice) -> dict[str, Any]:
    m, L, T = size.m, size.L, size.T
    I_x, I_y, I_z = m * (0.4 * size.B) ** 2, m * (0.25 * L) ** 2, m * (dice(0.2, 0.28) * L) ** 2
    inertia = {"m": m, "I_z": I_z, "x_G": dice(-0.05, 0.05) * L, "coriolis": dice.choice(["full", "none"])}
    added = {
        "coriolis": dice.choice(["full", "mmg", "none"]),
        "X_udot": -m * dice(0.02, 0.15), "Y_vdot": -m * dice(0.4, 1.2),
        "N_rdot": -I_z * dice(0.3, 1.2), "Y_rdot": dice(-0.05, 0.05) * m * L, "N_vdot": dice(-0.05, 0.05) * m * L,
    }  # fmt: skip
    if dof > 3:
        inertia |= {"z_G": dice(-0.3, 0.1) * T, "I_x": I_x}
        added |= {"K_pdot": -I_x * dice(0.1, 0.4), "K_vdot": dice(-0.05, 0.05) * m * T}
    if dof == 6:
        inertia["I_y"] = I_y
        added |= {"Z_wdot": -m * dice(0.5, 1.5), "M_qdot": -I_y * dice(0.5, 1.5), "Z_qdot": dice(-0.05, 0.05) * m * L}
    return {"inertia": inertia, "added_mass": added}


def _hull(size: Size, dof: int, dice: Dice) -> dict[str, Any]:
    """Quadratic damping on every axis, and other hulls laid over it."""
    L, U = size.L, size.U
    lever = {"K": 0.2 * size.T, "M": L, "N": L}
    scale = {"u": U, "v": U, "w": U, "p": U / size.B, "q": U / L, "r": U / L, "phi": 0.3}
    si = {name: -share * dice(0.5, 1.5) * size.force * lever.get(name[0], 1.0) / scale[name[2]] ** 2
          for name, share in DAMPING.items() if name[0] in AXES[dof]}  # fmt: skip
    for name, factors in _monomials(dice, AXES[dof], MOTIONS[dof], set(si)).items():
        unit = float(np.prod([scale[factor] for factor in factors]))
        si[name] = dice(-0.03, 0.03) * size.force * lever.get(name[0], 1.0) / unit
    units = int(dice(2, 6))
    weights = ("w_u", "w_v", "w_r", "w_0", "c_X", "c_Y", "c_N")
    others: dict[str, Callable[[], dict[str, Any]]] = {
        "prime_derivatives": lambda: dict.fromkeys(_monomials(dice, AXES[dof], MOTIONS[dof]), 0.002),
        "bis_derivatives": lambda: {
            "nabla": size.m / size.rho,
            **dict.fromkeys(_monomials(dice, AXES[dof], MOTIONS[dof]), -0.002),
        },
        "abkowitz": lambda: dict.fromkeys(_monomials(dice, "XYN", "uvr", heel=False), -0.001),
        "mmg": lambda: {
            **{"R_0": 0.02, "k_astern": dice(0.8, 1.5), "X_vv": -0.04, "Y_v": -dice(0.1, 0.4), "Y_r": 0.08},
            **{"N_v": -0.1, "N_r": -dice(0.02, 0.08), "Y_vvv": -1.6, "N_vvr": -0.3, "N_rrr": -0.02, "N_vv": 0.01},
        },
        "crossflow": lambda: {
            **{"strips": int(dice(1, 45)), "C_d": dice(0.3, 1.2), "x_aft": -L / 2, "x_fwd": L / 2},
            **{"k_fwd": dice(-0.5, 0.5), "k_ends": dice(-0.5, 0.5)},
        },
        "resistance": lambda: {"R_0": 0.01 * size.force / U**2, "R_1": 0.002 * size.force / U**3, "k_astern": 1.2},
        "learned": lambda: {
            **{"u_scale": U, "v_scale": U / 3, "r_scale": U / L, "X_max": 0.02 * size.force},
            **{"Y_max": 0.05 * size.force, "N_max": 0.02 * size.force * L},
            **{name: [dice(-1, 1) for _ in range(units)] for name in weights},
        },
    }
    return {"derivatives": si, **{name: draw() for name, draw in others.items() if dice.maybe(0.4)}}


def _monomials(
    dice: Dice, axes: str, motions: str, taken: set[str] | None = None, heel: bool = True
) -> dict[str, list[str]]:
    """Names of coefficients, each of another monomial, and their factors."""
    seen = {hull_derivative(name).canonical for name in taken or ()}
    names: dict[str, list[str]] = {}
    for _ in range(int(dice(2, 9))):
        factors = [dice.choice(motions) for _ in range(int(dice(1, 4)))] + ["phi"] * (heel and dice.maybe(0.2))
        name = f"{dice.choice(axes)}_{''.join(f'|{one}|' if dice.maybe(0.3) else one for one in factors)}"
        if hull_derivative(name).canonical not in seen:
            seen.add(hull_derivative(name).canonical)
            names[name] = factors
    return names


def _radiation(size: Size, dof: int, dice: Dice) -> dict[str, Any]:
    count, m, L = int(dice(2, 5)), size.m / size.time**2, size.L
    modes = {
        "sigma": [dice(0.3, 3) / size.time for _ in range(count)],
        "omega": [dice(0, 4) / size.time for _ in range(count)],
    }
    parts = ("cos", "sin")
    kernels = {"roll": {"K44": m * (0.4 * size.B) ** 2}}
    if dof == 6:
        kernels["heave_pitch"] = {"K33": m, "K35": 0.05 * m * L, "K55": m * L**2 / 16}
    return {
        term: {
            **modes,
            **{f"{name}_{part}": [dice(0, 0.1) * value] * count for name, value in kernel.items() for part in parts},
        }
        for term, kernel in kernels.items()
        if dice.maybe(0.7)
    }  # fmt: skip


def _wind(size: Size, dice: Dice) -> dict[str, Any]:
    areas = {"A_FW": size.B * size.T, "A_LW": 1.5 * size.L * size.T}
    if dice.maybe():
        shape = {"C_Dt": 0.8, "C_Dl_bow": 0.55, "C_Dl_stern": 0.6, "delta": 0.5, "kappa": 1.2}
        return {"kind": "blendermann", **shape, "s_L": dice(-0.1, 0.1) * size.L, "s_H": size.T, **areas}
    gamma = np.linspace(0, np.pi, int(dice(3, 12)))
    tables = {"C_X": -0.7 * np.cos(gamma), "C_Y": 0.8 * np.sin(gamma), "C_N": 0.1 * np.sin(2 * gamma)}
    return {
        "kind": "table", "gamma_deg": np.degrees(gamma).tolist(), **{k: v.tolist() for k, v in tables.items()}, **areas
    }  # fmt: skip


def _thrusters(size: Size, dice: Dice) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for place in range(int(dice(0, 4))):
        kind = dice.choice(DRIVES)
        name, y = f"{kind[:3]}{place}", dice(-0.3, 0.3) * size.B * dice.maybe()
        if kind == "service_speed" and kind in (block["kind"] for block in result.values()):
            continue
        drive = _drive(kind, size, dice, {"x": -0.4 * size.L, "y": y, "z": dice(0, 1) * size.T})
        orders = {"azimuth": ("n", "alpha"), "controllable_pitch": ("n", "pitch")}.get(kind, ("n",))
        result[name] = {"kind": kind, **drive, **_gear(size, dice, *orders)}
        for number in range(int(dice(0, 3)) if kind in SCREWS else 0):
            steering = dice.choice(RUDDERS)
            behind = {} if steering == "rudder_derivatives" else {"behind": name}
            block = {"kind": steering, **behind, **_rudder(steering, size, dice, 0.9 * y)}
            result[f"{name}_{steering}{number}"] = {**block, **_gear(size, dice, "delta")}
    return result


def _forces(size: Size, dice: Dice) -> dict[str, Any]:
    """Thrusters that are ordered by force, on one ship in five each."""
    result = {}
    for kind in filter(lambda _: dice.maybe(0.2), FORCES):
        at = {"x": -0.3 * size.L, "y": dice(-0.3, 0.3) * size.B, "z": dice(0, 1) * size.T}
        orders = ("force", "alpha") if kind == "swivel_force" else ("force",)
        result[kind] = {"kind": kind, **at, "k_T": dice(0.7, 1.1), "k_astern": dice(0.5, 1)}
        result[kind] |= _gear(size, dice, *orders)
    return result


def _gear(size: Size, dice: Dice, *orders: str) -> dict[str, Any]:
    """Actuators of some orders: lags, rates and stops, or none."""
    fast = {"n": size.n / 3, "force": size.thrust / 3, "alpha": 0.3, "delta": 0.3, "pitch": 0.5}
    stops = {"n": size.n, "force": size.thrust, "alpha": 1.5, "delta": 0.5, "pitch": 0.8}
    found: dict[str, Any] = {}
    for order in filter(lambda _: dice.maybe(), orders):
        rate = {"rate": fast[order] / size.time * dice(0.3, 3)}
        lag = {"kind": "first_order", "T": dice(0.05, 3) * size.time, **(rate if dice.maybe() else {})}
        found[order] = lag if dice.maybe() else {"kind": "rate_limit", **rate}
        if dice.maybe():
            found[order] |= {"low": -0.7 * stops[order], "high": stops[order]}
    return {"actuator": found} if found else {}


def _drive(kind: str, size: Size, dice: Dice, at: dict[str, float]) -> dict[str, Any]:
    n, U, thrust = size.n, size.U, size.thrust
    if kind == "tunnel":
        return {"x": 0.4 * size.L, "z": at["z"], "F_1": 0.01 * thrust / n, "F_2": 0.1 * thrust / n**2, "F_3": 0.0}
    if kind == "service_speed":
        return {"n_0": n, "X_u": -dice(0.001, 0.004), "X_uu": dice(-0.001, 0.001), "X_uuu": -0.001}
    if kind == "azimuth":
        return {
            **at, "D_p": size.D_p, "k_T": dice(0.8, 1.2), "k_astern": dice(0.5, 1), "J_t": 0.2,
            "K_x": {"1": 0.4, "J": -0.3, "yy": 0.1}, "K_y": {"y": -0.2, "Jy": dice(-0.1, 0.1), "t": 0.02},
            "J_min": -0.3, "J_max": 1.2, "Jy_max": 0.8,
            "k_over": -0.2, "k_over2": -0.1, "k_under": dice(-0.3, 0.3), "k_side": -0.2, "k_sideJ": dice(-0.1, 0.1),
        }  # fmt: skip
    wake = {"t_P": dice(0, 0.3), "w_P0": dice(0, 0.4), "C_1": dice(1, 3), "C_2_plus": 1.4, "C_2_minus": dice(0.8, 1.3)}
    wake |= {"tau": dice(-0.3, 0.6), "C_P": dice(-1, 1)} if dice.maybe(0.3) else {}
    if kind == "quadratic":
        more: list[dict[str, Any]] = [
            {"k_driven": dice(0.1, 1)}, {"T_uu": 0.1 * thrust / U**2}, {"Y_T": 0.1, "N_T": -0.03 * size.L},
            {"D_p": size.D_p}, {"c_uu": 0.4, "c_un": 0.1 * size.D_p, "c_nn": 0.3 * size.D_p**2},
        ]  # fmt: skip
        law = {"T_nn": thrust / n**2, "T_nu": 0.4 * thrust / n / U, "k_astern": dice(0.5, 1), "w_P0": wake["w_P0"]}
        return {**at, **law, **_some(dice, more)}
    if kind == "controllable_pitch":
        return {**at, "D_p": size.D_p, "k_P": 0.4, "k_J": dice(0.3, 0.5), "k_astern": dice(0.6, 1), **wake}
    if kind == "four_quadrant":
        beta = np.linspace(-np.pi, np.pi, int(dice(5, 20)))
        C_T = 0.9 * np.cos(beta) - 0.7 * np.sin(beta)
        C_T[-1] = C_T[0]
        return {**at, "D_p": size.D_p, "beta_deg": np.degrees(beta).tolist(), "C_T": C_T.tolist(), **wake}
    more = [
        {"K_Q": {"1": 0.04, "J": -0.03}}, {"K_T_astern": {"1": 0.25, "J": -0.2}}, {"J_min": -0.5, "J_max": 1.0},
        {"Y_astern": {"1": -0.03}, "N_astern": {"1": 0.02, "J": 0.01}}, {"k_drag": 0.2}, {"k_suction": dice(0.1, 0.5)},
    ]  # fmt: skip
    screw = {"D_p": size.D_p, "K_T": {"1": 0.35, "J": -0.3, "JJ": -0.1}, "k_astern": dice(0.5, 1)}
    return {**at, **screw, **wake, **_some(dice, more)}


def _some(dice: Dice, blocks: list[dict[str, Any]]) -> dict[str, Any]:
    """About half of some blocks, in one."""
    return {key: value for block in blocks if dice.maybe() for key, value in block.items()}


def _rudder(kind: str, size: Size, dice: Dice, y: float) -> dict[str, Any]:
    if kind == "rudder_derivatives":
        return {"Y_delta": -0.003, "N_delta": 0.0015, "X_deltadelta": -0.001, "Y_udelta": -0.003, "N_|r|delta": 0.001}
    if kind == "rudder_coefficients":
        lift = size.T / size.L / 27
        values = {
            "X_|c|cdeltadelta": -0.7,
            "Y_|c|cdelta": -1,
            "N_|c|cdelta": 0.5,
            "Y_cc|delta|": 0.05,
            "Y_|c|cbeta": 0.3,
        }
        return {"kappa": dice(0.5, 1), **{name: value * lift for name, value in values.items()}}
    blade = {
        "x": -0.5 * size.L, "y": y, "z": 0.5 * size.T, "A_R": size.L * size.T / 55, "f_alpha": dice(2, 3), "t_R": 0.3,
        "epsilon": dice(0.8, 1.2), "a_H": dice(0.1, 0.4), "x_H": -0.45 * size.L,
    }  # fmt: skip
    if kind == "rudder_polynomial":
        return {**blade, "k_x": dice(0.3, 0.7), "v_R": {"v": -0.5, "r": dice(0.1, 0.5), "rrr": 0.1, "vr|r|": 0.1}}
    sides = {"f_angle": dice(-0.4, 0), "f_side": dice(-0.1, 0.1)} if dice.maybe() else {}
    flow = {"kappa": dice(0.4, 0.7), "gamma_R_plus": 0.6, "gamma_R_minus": dice(0.3, 0.7), "ell_R": -0.7 * size.L}
    return {**blade, "H_R": 0.8 * size.T, **flow, **sides}


def extreme_inputs(vessel: Vessel, count: int, seed: int = 0) -> dict[str, dict[str, np.ndarray]]:
    """Start, commands, environment: rest, sternway, sideslip, hurricanes, shafts that stand or turn the other way."""
    random, model, sizes = np.random.default_rng(seed), vessel_dynamics(vessel), vessel.document["particulars"]
    U, L = sizes["U_0"], sizes["L_pp"]
    n = U / (0.6 * sizes["T"] * 0.55)
    thrust = 0.25 * vessel.document["constants"]["rho"] * (0.55 * sizes["T"]) ** 4 * n**2
    ranges: Mapping[str, tuple[float, float, list[float]]] = {  # least, greatest, and what is often taken instead
        **dict.fromkeys(("north", "east"), (-100.0, 100.0, [0.0])), "psi": (-7.0, 7.0, [0.0, np.pi, -np.pi]),
        "down": (-0.1 * sizes["T"], 0.1 * sizes["T"], [0.0]), "phi": (-0.5, 0.5, [0.0]), "theta": (-0.1, 0.1, [0.0]),
        "u": (-0.5 * U, 1.2 * U, [0.0, -0.5 * U, 1e-9]), "v": (-0.7 * U, 0.7 * U, [0.0, U]),
        "w": (-0.1 * U, 0.1 * U, [0.0]), "p": (-0.3, 0.3, [0.0]), "q": (-0.05, 0.05, [0.0]),
        "r": (-U / L, U / L, [0.0]),
        "n": (-n, 1.3 * n, [0.0, -n]), "force": (-thrust, 1.3 * thrust, [0.0, -thrust]),
        "alpha": (-4.0, 4.0, [0.0, np.pi]), "delta": (-1.2, 1.2, [0.0]),
        "pitch": (-1.2, 1.4, [0.0]), "V_w": (0.0, 60.0, [0.0, 60.0]), "beta_w": (-4.0, 7.0, [0.0]),
        "V_c": (0.0, 0.5 * U, [0.0]), "beta_c": (-4.0, 7.0, [0.0]),
    }  # fmt: skip

    def group(names: tuple[str, ...]) -> dict[str, np.ndarray]:
        values = {}
        for name in names:
            low, high, special = ranges[name.rsplit(".", 1)[-1]]
            taken = random.random(count) < 0.35
            values[name] = np.where(taken, random.choice(special, count), random.uniform(low, high, count))
        return values

    return {
        "start": group(model.state),
        "commands": group(model.commands),
        "environment": group(model.environment),
    }
