"""Ships of strangers and their tests: by ship type, with hulls, rudders and gear that a template does not have.

Beside the types' ranges: hulls of MMG, cross-flow and Abkowitz kind, four rudder laws, gear with stops, a current that
changes with the tide, gusts, and a programme of tests with what instruments could see of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pandas as pd
import pymap3d
from numpy.typing import NDArray

from shipid.errors import ShipidError
from shipid.simulation.approach import Controls
from shipid.simulation.manoeuvre import (
    CrashStop,
    Excitation,
    Manoeuvre,
    PullOut,
    StepManoeuvre,
    TimedManoeuvre,
    TurningCircle,
    Zigzag,
)
from shipid.simulation.perform import perform_manoeuvres
from shipid.simulation.standard import shaft_speed
from shipid.simulation.weather import Gusts, gust_series
from shipid.units import RPM
from shipid.vessel.load import Vessel, check_document

Array = NDArray[np.float64]
Random = np.random.Generator

TYPES: dict[str, tuple[tuple[float, float], ...]] = {  # L [m], C_b, L/B, B/T, Froude number
    "tanker": ((100, 320), (0.77, 0.85), (5.2, 6.4), (2.3, 3.1), (0.12, 0.165)),
    "bulk": ((90, 290), (0.76, 0.86), (5.5, 6.8), (2.2, 3.0), (0.13, 0.175)),
    "container": ((110, 320), (0.55, 0.70), (6.0, 7.6), (2.4, 3.4), (0.19, 0.25)),
    "coaster": ((60, 130), (0.66, 0.80), (5.0, 6.6), (2.2, 3.1), (0.15, 0.22)),
    "ferry": ((60, 200), (0.52, 0.64), (4.6, 6.8), (3.0, 4.8), (0.21, 0.28)),
    "offshore": ((45, 100), (0.58, 0.72), (3.8, 4.9), (2.5, 3.6), (0.18, 0.26)),
    "research": ((30, 110), (0.48, 0.64), (3.7, 5.6), (2.5, 3.7), (0.17, 0.25)),
    "fishing": ((30, 70), (0.52, 0.64), (3.6, 4.6), (2.2, 2.9), (0.18, 0.27)),
}
OPTION = {"bulk": "cargo", "coaster": "cargo"}  # word of `--ship-type`, where it is another
MERCHANT = ("tanker", "bulk", "container", "coaster", "fishing")
DRIVES = ("screw", "screw and tunnel", "twin screw", "azimuth")
TRIES = 40  # ships are drawn until one goes straight and turns
TURN = (1.4, 9.0)  # lengths across: tactical diameter of a ship that is taken
RACE = ("race", "polynomial", "coefficients")


class SpeedChange(TimedManoeuvre):
    """The shaft goes from `n_rpm` to `to_rpm`, the helm amidships: acceleration, slowing down, coasting."""

    to_rpm: float

    def shaft(self, t: Array) -> Array:
        return np.where(t >= self.execute_at - 1e-9, self.to_rpm, self.n_rpm) * RPM


@dataclass(frozen=True)
class Run:
    """One test of the programme. speed : share of the service shaft speed."""

    kind: str
    angle: int = 0
    other: int = 0
    side: str = "starboard"
    speed: float = 1.0


def draw_ship(random: Random) -> dict[str, Any]:
    """Sizes, speed and document of a ship or a model, by ship type."""
    kind = str(random.choice(list(TYPES)))
    length, block, slender, flat, froude = (float(random.uniform(*limits)) for limits in TYPES[kind])
    model = bool(random.random() < 0.5)
    scale = length / float(random.uniform(2.0, 7.0)) if model else 1.0
    L = length / scale
    B = L / slender
    T = B / flat
    U = froude * float(np.sqrt(9.81 * L))
    rho = 1000.0 if model else 1025.0
    drive = str(
        random.choice(
            DRIVES[:2] if kind in MERCHANT else DRIVES, p=None if kind in MERCHANT else (0.15, 0.2, 0.3, 0.35)
        )
    )
    rudder = "azimuth" if drive == "azimuth" else str(random.choice([*RACE, "speed"]))
    hull = str(random.choice(["cubic", "cross-flow", "abkowitz"]))
    size: dict[str, Any] = {"L": L, "B": B, "T": T, "C_b": block, "U": U, "rho": rho, "scale": scale}
    size["quick"] = float(np.sqrt(scale))

    def f(low: float = 0.8, high: float = 1.25) -> float:
        return float(random.uniform(low, high))

    m, k = rho * block * L * B * T, 2 * T / L
    lift = {  # Inoue et al. (1981), each with a factor
        "Y_v": -(np.pi * k / 2 + 1.4 * block * B / L) * f(),
        "Y_r": np.pi * k / 4 * f(0.5, 1.2),
        "N_v": -k * f(0.75, 1.15),
        "N_r": -(0.54 * k - k**2) * f(0.85, 1.5),
    }
    R = 0.5 * rho * U**2 * _wetted(size) * f(0.0026, 0.005)
    I_z = m * (L * f(0.23, 0.27)) ** 2
    document: dict[str, Any] = {
        "name": f"Stranger of {L:.3g} m", "dof": 3, "source": "made up",
        "particulars": {"L_pp": L, "B": B, "T": T, "C_b": block, "U_0": U},
        "constants": {"rho": rho, "rho_a": 1.225},
        "inertia": {"m": m, "I_z": I_z, "x_G": L * f(-0.025, 0.03)},
        "added_mass": {
            "coriolis": "mmg", "X_udot": -m * f(0.03, 0.09), "Y_vdot": -m * f(0.7, 1.1), "N_rdot": -I_z * f(0.5, 1.1)
        },
        "current": {"kind": "uniform"}, "wind": _wind(size, f),
        "hull": _shape(hull, size, lift, R, f),
        "thruster": _thrusters(drive, "race" if rudder in RACE else rudder, size, f, R),
    }  # fmt: skip
    _steering(document["thruster"], rudder, size, f, servo=model and random.random() < 0.5)
    words = f"{kind} {'model' if model else 'ship'} of {L:.3g} m, {drive}, {hull} hull, rudder by {rudder}"
    name = f"{random.choice(['MV', 'MS', 'RV', 'Hull', 'Model'])} {random.integers(100, 5000)}"
    return size | {
        "document": _plain(document), "words": words, "model": model, "drive": drive, "type": kind, "name": name
    }  # fmt: skip


def _plain(values: Any) -> Any:
    """Numbers as TOML has them."""
    if isinstance(values, dict):
        return {key: _plain(value) for key, value in values.items()}
    return float(values) if isinstance(values, np.floating) else values


def _wetted(size: Mapping[str, float]) -> float:
    return size["L"] * (1.8 * size["T"] + size["C_b"] * size["B"])


def _wind(size: Mapping[str, float], f: Any) -> dict[str, Any]:
    L, B = size["L"], size["B"]
    return {
        "kind": "blendermann", "C_Dt": f(0.7, 0.95), "C_Dl_bow": f(0.5, 0.8), "C_Dl_stern": f(0.5, 0.8),
        "delta": f(0.4, 0.7), "kappa": f(1.1, 2.0), "A_FW": 0.7 * B**2 * f(), "A_LW": 0.45 * L * B * f(),
        "L_oa": 1.04 * L, "s_L": L * f(-0.05, 0.05), "s_H": 0.25 * B,
    }  # fmt: skip


def _hull(kind: str, size: Mapping[str, float], lift: Mapping[str, float], R: float, f: Any) -> dict[str, Any]:
    L, T, rho, U = size["L"], size["T"], size["rho"], size["U"]
    if kind == "cubic":
        more = {
            "X_vv": -0.04 * f(),
            "X_vr": 0.01 * f(-2, 2),
            "X_rr": 0.01 * f(0, 1),
            "Y_vvv": -1.5 * f(),
            "Y_vvr": 0.3 * f(0, 1),
        }
        more |= {
            "Y_vrr": -0.4 * f(),
            "N_vvv": -0.03 * f(),
            "N_vvr": -0.3 * f(),
            "N_vrr": 0.05 * f(),
            "N_rrr": -0.013 * f(),
        }
        return {"mmg": {"R_0": R / (0.5 * rho * L * T * U**2), **lift, **more}}
    unit = 0.5 * rho * L * T
    derivatives = {
        "X_u|u|": -0.7 * R / U**2, "X_uuu": -0.3 * R / U**3, "X_vr": unit * L * 0.02 * f(-1, 1),
        "Y_uv": unit * lift["Y_v"] * 0.8, "Y_ur": unit * L * lift["Y_r"],
        "N_uv": unit * L * lift["N_v"], "N_ur": unit * L**2 * lift["N_r"],
    }  # fmt: skip
    return {
        "derivatives": derivatives,
        "crossflow": {"strips": 12, "C_d": f(0.6, 1.1), "x_aft": -L / 2, "x_fwd": L / 2},
    }


def _thrusters(drive: str, rudder: str, size: Mapping[str, float], f: Any, R: float) -> dict[str, Any]:
    L, B, T, quick = size["L"], size["B"], size["T"], size["quick"]
    gear = {"kind": "first_order", "T": f(0.3, 1.2) / quick, "rate": np.radians(f(2.3, 5.0)) * quick}
    shaft = {"kind": "first_order", "T": f(2.0, 6.0) / quick, "rate": 1e3}
    if drive == "azimuth":
        turned = {"kind": "first_order", "T": f(0.4, 1.2) / quick, "rate": np.radians(f(8, 15)) * quick}
        D = f(0.45, 0.65) * T
        unit = {
            "kind": "azimuth", "x": -0.45 * L, "z": 0.7 * T, "D_p": D, "k_T": f(0.7, 1.0), "k_astern": f(0.6, 0.8),
            "J_t": 0.06, "J_min": -0.3, "J_max": 1.3, "Jy_max": 0.6,
            "k_over": 0.5, "k_over2": 0.12, "k_under": 0.1, "k_side": 0.6, "k_sideJ": 0.4,
            "K_x": {"1": f(0.5, 0.8), "J": -f(0.4, 0.6), "JJ": -f(0.0, 0.1), "yy": 0.3 * f()},
            "K_y": {"y": -f(0.6, 1.2), "Jy": -f(0.3, 0.7)}, "actuator": {"n": shaft, "alpha": turned},
        }  # fmt: skip
        return {name: {**unit, "y": side * 0.25 * B} for side, name in ((-1, "port"), (1, "starboard"))}
    sides = ((-1, "port"), (1, "starboard")) if drive == "twin screw" else ((0, ""),)
    D = f(0.45, 0.7) * T * (0.8 if len(sides) == 2 else 1.0)
    wake = f(0.2, 0.4) if len(sides) == 1 else f(0.05, 0.15)
    pitch = f(0.65, 1.1)
    area = f(0.015, 0.022) * L * T / (1 if len(sides) == 1 else 1.6)
    span = min(np.sqrt(f(1.3, 1.9) * area), 0.85 * T)
    slope = 2 * np.pi / (1 + 2 * area / span**2)
    blocks: dict[str, Any] = {}
    fins = (f(0.3, 0.55), f(0.3, 0.55), f(0.9, 1.15), f(0.45, 0.65), f(0.6, 0.9), f(0.2, 0.4))
    for side, name in sides:
        y = {"y": side * 0.2 * B}
        blocks[name or "propeller"] = {
            "kind": "propeller", "x": -0.47 * L, **y, "z": 0.65 * T, "D_p": D, "k_astern": 0.7,
            "t_P": 0.12 + 0.2 * wake, "w_P0": wake, "C_1": 1.8, "C_2_plus": 1.4, "C_2_minus": 1.2,
            "K_T": {"1": 0.44 * pitch - 0.02, "J": -0.29, "JJ": -0.12}, "actuator": {"n": shaft},
        }  # fmt: skip
        steered = f"{name}_rudder" if name else "rudder"
        if rudder == "race":
            blocks[steered] = {
                "kind": "rudder", "behind": name or "propeller", "x": -0.5 * L, **y, "z": 0.6 * T,
                "A_R": area, "H_R": float(span), "f_alpha": float(slope * 0.95), "epsilon": fins[2], "kappa": fins[3],
                "gamma_R_plus": fins[0], "gamma_R_minus": fins[1], "ell_R": -fins[4] * L, "t_R": 0.3, "a_H": fins[5],
                "x_H": -0.45 * L, "actuator": {"delta": gear},
            }  # fmt: skip
        else:
            force = area / L**2 * slope * (1 + fins[5]) * fins[2] ** 2
            odd = {"Y_delta": -force, "N_delta": 0.5 * force}
            fin = {"Y_vdeltadelta": force, "N_vdeltadelta": -0.5 * force}  # less lift on a rudder that is over
            blocks[steered] = {
                "kind": "rudder_derivatives", "X_deltadelta": -0.7 * force, "X_udeltadelta": -1.4 * force, **odd, **fin,
                **{f"{key[0]}_u{key[2:]}": 2 * value for key, value in odd.items()},
                **{f"{key[0]}_uu{key[2:]}": value for key, value in odd.items()}, "actuator": {"delta": gear},
            }  # fmt: skip
    if drive == "screw and tunnel":
        push = 0.15 * R
        blocks["bow"] = {
            "kind": "tunnel",
            "x": 0.38 * L,
            "z": 0.6 * T,
            "F_1": 0.0,
            "F_2": push / 25.0 / quick**2,
            "F_3": 0.0,
        }
    return blocks


def _shape(kind: str, size: Mapping[str, Any], lift: Mapping[str, float], R: float, f: Any) -> dict[str, Any]:
    """Hull forces; Abkowitz: the cubic's terms about the service speed, their lift with the speed, resistance apart."""
    terms = _hull("cross-flow" if kind == "cross-flow" else "cubic", size, lift, R, f)
    if kind == "cross-flow":
        terms["crossflow"] |= {"k_fwd": f(-0.3, 0.5), "k_ends": f(-0.4, 0.4)}
    if kind != "abkowitz":
        return terms
    flat = {key: value * size["T"] / size["L"] for key, value in terms["mmg"].items() if key != "R_0"}
    growing = {f"{key[:2]}u{key[2:]}": flat[key] * f(0.7, 1.2) for key in lift}
    resistance = {"R_0": R * 0.8 / size["U"] ** 2, "R_1": R * 0.2 / size["U"] ** 3}
    return {"abkowitz": flat | growing, "resistance": resistance}


def _steering(thruster: dict[str, Any], rudder: str, size: Mapping[str, Any], f: Any, *, servo: bool) -> None:
    """Other rudder laws in place of the rudder in the race; gear with stops; screws as large as the draught allows."""
    quick = size["quick"]
    rate = f(12, 45) if servo else f(2.32, 5.5) * quick
    stop = float(np.radians(round(f(0.0, 2.99) // 1 * 5 + 35)))
    limits = {"rate": np.radians(rate), "low": -stop, "high": stop}
    gear: dict[str, Any] = (
        {"kind": "rate_limit"} if f(0, 1) < 0.4 else {"kind": "first_order", "T": f(0.2, 1.5) / quick}
    )
    skew, loss = f(-0.08, 0.08), f(0.0, 0.4)
    screw = f(0.58, 0.75) * size["T"] * (0.8 if "port" in thruster else 1.0)
    for name, block in thruster.items():
        if block["kind"] == "tunnel":
            block["actuator"] = {"n": {"kind": "first_order", "T": f(1, 3) / quick, "rate": 1e3}}
        elif block["kind"] == "propeller":
            block["D_p"] = screw
        if "rudder" not in block["kind"]:
            continue
        if rudder == "race":
            block |= {"f_side": skew, "f_angle": -loss}
        elif rudder == "polynomial":
            kept = ("behind", "x", "y", "z", "A_R", "f_alpha", "epsilon", "t_R", "a_H", "x_H")
            straight = block["gamma_R_plus"]
            flow = {"v": -straight, "r": -straight * block["ell_R"] / size["L"], "rrr": f(0, 0.15), "vrr": f(-0.3, 0.3)}
            block = {key: block[key] for key in kept if key in block} | {"k_x": f(0.3, 0.7), "v_R": flow}
            thruster[name] = block | {"kind": "rudder_polynomial"}
        elif rudder == "coefficients":
            force = block["A_R"] / size["L"] ** 2 * block["f_alpha"] * (1 + block["a_H"])
            straight = block["gamma_R_plus"]
            side = {"cdelta": -1, "cdelta|delta|": 0.5 * loss, "c|delta|": -0.3 * skew, "cbeta": straight}
            values = {f"{axis}_|c|{key}": lever * force * value
                      for axis, lever in (("Y", 1.0), ("N", -0.5)) for key, value in side.items()}  # fmt: skip
            thruster[name] = {
                "kind": "rudder_coefficients", "behind": block["behind"], "kappa": block["kappa"],
                "X_|c|cdeltadelta": -0.7 * force, **values,
            }  # fmt: skip
        thruster[name]["actuator"] = {"delta": gear | limits}


def _sails(vessel: Vessel, n: float, drawn: Mapping[str, Any]) -> bool:
    """Whether it turns at 35 deg neither on the spot nor hardly, and a zigzag comes back; she may be unstable."""
    pace = drawn["L"] / drawn["U"]
    how: dict[str, Any] = {"n_rpm": 60 * n, "approach": "helmsman"}
    turn = perform_manoeuvres(vessel, [TurningCircle(duration=25 * pace, **how)], step=pace / 40)
    across = (turn["east"].max() - turn["east"].min()) / drawn["L"]
    zigzag = perform_manoeuvres(vessel, [Zigzag(angle_deg=20, duration=20 * pace, **how)], step=pace / 40)
    return bool(TURN[0] < across < TURN[1] and np.abs(zigzag["psi"]).max() < np.radians(80))


def candidates(random: Random, name: str) -> Iterator[tuple[dict[str, Any], Vessel, float]]:
    """Ships that go straight and turn: how each was drawn, the vessel, and its shaft speed [rev/s] at U."""
    for _ in range(TRIES):
        drawn = draw_ship(random)
        try:
            vessel = check_document(drawn["document"], name)
            n = shaft_speed(Controls(vessel), drawn["U"])
            if _sails(vessel, n, drawn):
                yield drawn, vessel, n
        except ShipidError:
            continue
    raise AssertionError(f"no ship of {name} goes straight and turns")


def known_of(random: Random, drawn: Mapping[str, Any], n: float) -> dict[str, float | str | bool]:
    """What people know, rounded as they say it; some know little, some much."""

    def digits(value: float, count: int) -> float:
        return float(f"{value:.{count}g}")

    known: dict[str, float | str | bool] = {
        "length": digits(drawn["L"], 4), "beam": digits(drawn["B"], 3), "draught": digits(drawn["T"], 3),
        "block": digits(drawn["C_b"], int(random.integers(2, 4))),
    }  # fmt: skip
    blocks = drawn["document"]["thruster"].values()
    screw = next(block for block in blocks if "D_p" in block)
    fin = next((block for block in blocks if "A_R" in block), None)
    if drawn["drive"] == "azimuth":
        known["propulsor"] = "azimuth"
    elif drawn["drive"] == "twin screw":
        known["shafts"] = 2
    elif "tunnel" in drawn["drive"]:
        known["tunnel-thruster"] = True
    more: dict[str, float | str] = {
        "speed": digits(drawn["U"] * random.uniform(0.97, 1.03), 2), "rpm": digits(60 * n, 2),
        "propeller-diameter": digits(screw["D_p"], 3),
        "ship-type": OPTION.get(drawn["type"], drawn["type"]),
    }  # fmt: skip
    if fin is not None:
        more["rudder-area"] = digits(fin["A_R"], 2)
    if drawn["model"]:
        more["scale"] = digits(drawn["scale"], 3)
    share = float(random.choice([0.25, 0.55, 0.9]))
    first = ("speed", "rpm", "scale", "propeller-diameter")  # what most of them know
    return known | {key: value for key, value in more.items() if random.random() < share + 0.3 * (key in first)}


def options_of(known: Mapping[str, float | str | bool]) -> list[str]:
    """What people know, as options of the command line."""
    texts = {name: f"{value:.6g}" if isinstance(value, float) else str(value) for name, value in known.items()}
    return [word for name, text in texts.items() for word in ([f"--{name}"] if text == "True" else [f"--{name}", text])]


def programme_of(random: Random, count: int, style: Mapping[str, Any]) -> list[Run]:
    """The tests in the order they were made: zigzags and circles to both sides, and others."""
    zigzags = [
        ((10, 10), (20, 20), (15, 15), (5, 5), (20, 10), (35, 20))[i] for i in (0, 1, *random.permutation(4) + 2)
    ]
    angles = (35, 20, 10, 25, 15, 30)
    speeds = ((1.0,), (1.0, 0.75), (1.0, 0.8, 0.55))[int(random.integers(3))]
    others = ["random", "acceleration", "coasting", "straight", "random", "crash stop", "pull-out", "slowing down"]
    random.shuffle(others)
    free = style["team"] == "autonomy" and random.random() < 0.5  # teams that drive about more than they test
    runs: list[Run] = []
    for place in range(count):
        turn, side = divmod(place // (2 if free else 1), 2)
        speed = speeds[turn // 3 % len(speeds)]
        name = ("starboard", "port")[side]
        if free and place % 2:
            runs.append(Run("random", 20, 0, name, speed))
        elif turn % 3 == 0:
            runs.append(Run("zigzag", *zigzags[turn // 3 % len(zigzags)], name, speed))
        elif turn % 3 == 1:
            runs.append(Run("circle", angles[turn // 3 % len(angles)], 0, name, speed))
        else:
            kind = others[(2 * (turn // 3) + side) % len(others)]
            runs.append(Run(kind, int(random.choice([10, 15, 20, 25])), 0, name, speed))
    order = {"zigzag": 1, "circle": 0, "straight": -1}
    return sorted(runs, key=lambda run: order.get(run.kind, 2)) if style["tidy"] else runs


def _manoeuvre(random: Random, run: Run, name: str, n: float, pace: float, drawn: Mapping[str, Any]) -> Manoeuvre:
    """A test as the simulation runs it."""
    rpm = 60 * n * run.speed
    slow = pace / run.speed
    how: dict[str, Any] = {"name": name, "course_deg": float(random.uniform(0, 360)), "n_rpm": rpm}
    how |= {"approach": "helmsman", "execute_at": slow * float(random.uniform(0.5, 4.0))}
    length = how["execute_at"] + slow * float(random.uniform(16, 26))
    turned: dict[str, Any] = {"angle_deg": run.angle, "side": run.side}
    if run.kind == "zigzag":
        return Zigzag(**turned, execute_heading_deg=run.other, duration=length, **how)
    if run.kind == "circle":
        return TurningCircle(**turned, duration=length, **how)
    if run.kind == "pull-out":
        return PullOut(**turned, turn=slow * 8, duration=length, **how)
    if run.kind == "acceleration":
        return SpeedChange(to_rpm=rpm, duration=length, **how | {"approach": "rest", "execute_at": 0.0})
    if run.kind in ("coasting", "slowing down"):
        return SpeedChange(to_rpm=0.0 if run.kind == "coasting" else 0.5 * rpm, duration=length, **how)
    if run.kind == "crash stop":
        return CrashStop(astern_rpm=0.6 * rpm, duration=length, **how)
    seed = int(random.integers(1_000_000))
    if run.kind == "straight":
        return Excitation(angle_deg=2.0, seed=seed, duration=0.7 * length, **how)
    steps = drawn["drive"] != "screw" and random.random() < 0.5
    if steps:
        orders: dict[str, tuple[float, float]] = {"n_rpm": (0.4 * rpm, rpm)}
        orders["alpha_deg" if drawn["drive"] == "azimuth" else "delta_deg"] = (-run.angle, run.angle)
        if "tunnel" in drawn["drive"]:
            most = 60 * 25.0 * drawn["quick"]
            orders = orders | {"n_rpm": (0.2 * rpm, 0.5 * rpm), "bow.n_rpm": (-most, most)}
        start = drawn["U"] * run.speed * 0.6
        held = (1.5 * slow, 6 * slow)
        return StepManoeuvre(name=name, course_deg=how["course_deg"], orders=orders, hold=held, seed=seed,
                     start_speed=start, duration=1.5 * length)  # fmt: skip
    return Excitation(
        angle_deg=run.angle, amplitude_rpm=rpm * float(random.choice([0.0, 0.2])), seed=seed,
        hold=(1.5 * slow, 5 * slow), duration=1.5 * length, **how,
    )  # fmt: skip


def record_of(
    random: Random,
    vessel: Vessel,
    n: float,
    drawn: Mapping[str, Any],
    style: dict[str, Any],
    programme: Sequence[Run],
) -> tuple[pd.DataFrame, dict[str, datetime]]:
    """True rows of all runs, with all that instruments can see; run -> time of its first row."""
    pace, U = drawn["L"] / drawn["U"], drawn["U"]
    interval = 1.0 / style["hz"]
    step = interval / max(1, int(np.ceil(interval / (pace / 40))))
    names = [f"R{place + 1:02d}" for place in range(len(programme))]
    tests = [_manoeuvre(random, run, name, n, pace, drawn) for run, name in zip(programme, names, strict=True)]
    count = len(tests)
    rows = round(interval / step) * int(max(one.length for one in tests) / interval + 1e-9) + 1
    weather: dict[str, Any] = {}
    towards = random.uniform(-np.pi, np.pi)
    flow = U * (random.uniform(0, 0.01) if style["team"] == "basin" else random.uniform(0, 0.07))
    V_c = flow * np.cos(np.linspace(0, random.uniform(0, 2), count))  # the tide of the day
    if style["team"] != "basin":
        mean = np.full(count, random.uniform(0.5, 8) / drawn["quick"])
        keys = [(int(random.integers(1_000_000)), run) for run in range(count)]
        gusts = gust_series(Gusts(kind="npd"), mean, step * np.arange(rows), keys)
        weather = {"V_w": np.maximum(mean + gusts, 0.0), "beta_w": np.full((rows, count), random.uniform(-3, 3))}
    weather |= {"V_c": V_c, "beta_c": np.full(count, towards)}
    frame = perform_manoeuvres(vessel, tests, step=step, interval=interval, environment=weather)
    frame = frame.drop(columns=[name for name in ("V_c", "beta_c") if name in frame])
    numbers = [name for name in frame if name not in ("run", "flags")]
    frame = frame.astype({**dict.fromkeys(numbers, "float64"), "run": "str"})
    which = pd.Index(names).get_indexer(pd.Index(frame["run"]))
    area = 3 * drawn["L"] * (0 if style["team"] == "basin" else 4)
    frame["north"] += random.uniform(-area - 1, area + 1, count)[which]
    frame["east"] += random.uniform(-area - 1, area + 1, count)[which]
    _see(random, frame, drawn, (V_c[which], towards))
    moment = datetime(int(random.integers(2012, 2025)), int(random.integers(1, 13)), int(random.integers(1, 28)), 8)
    starts: dict[str, datetime] = {}
    for place, (name, one) in enumerate(zip(names, tests, strict=True)):
        if place and place % style["a day"] == 0:
            moment = (moment + timedelta(days=int(random.integers(1, 4)))).replace(hour=8, minute=0)
        moment += timedelta(seconds=int(random.integers(60, 900)))
        starts[name] = moment
        moment += timedelta(seconds=int(one.length) + 1)
    return frame, starts


def _see(random: Random, frame: pd.DataFrame, drawn: Mapping[str, Any], current: tuple[Array, float]) -> None:
    """Add columns that instruments show and datasets do not have."""
    psi, u, v = (frame[name].to_numpy() for name in ("psi", "u", "v"))
    frame["stw"] = u - current[0] * np.cos(current[1] - psi)
    frame["wind_from"] = frame["beta_w"] + np.pi
    felt_u = frame["V_w"] * np.cos(frame["beta_w"] - psi) - u
    felt_v = frame["V_w"] * np.sin(frame["beta_w"] - psi) - v
    frame["aws"], frame["awa"] = np.hypot(felt_u, felt_v), np.arctan2(-felt_v, -felt_u)
    frame["phi"] = -random.uniform(0.1, 0.4) * frame["r"] * u / 9.81 * 10
    frame["theta"] = random.uniform(-0.01, 0.01) + 0 * u
    frame.attrs["origin"] = (float(random.uniform(25, 64)), float(random.uniform(-10, 140)))
    for name, block in drawn["document"]["thruster"].items():
        if block["kind"] != "propeller":
            continue
        n = frame[f"actual.{name}.n"].to_numpy()
        J = np.clip(u * (1 - block["w_P0"]) / (np.maximum(np.abs(n), 1e-2) * block["D_p"]), -1, 1.5)
        K = block["K_T"]["1"] + block["K_T"]["J"] * J + block["K_T"]["JJ"] * J**2
        frame[f"thrust.{name}"] = drawn["rho"] * n * np.abs(n) * block["D_p"] ** 4 * K
        frame[f"torque.{name}"] = frame[f"thrust.{name}"] * block["D_p"] * 0.16


def true_values(frame: pd.DataFrame, signal: str, at: float = 0.0) -> Array:
    """True values [SI] at a sensor `at` metres forward; latitude and longitude in rad."""
    x, psi = at, frame["psi"].to_numpy()
    u, v = frame["u"].to_numpy(), frame["v"].to_numpy() + x * frame["r"].to_numpy()
    north, east = frame["north"].to_numpy() + x * np.cos(psi), frame["east"].to_numpy() + x * np.sin(psi)
    place = {"lat": 0, "lon": 1}.get(signal)
    if place is not None:
        return np.asarray(np.radians(pymap3d.ned2geodetic(north, east, 0.0, *frame.attrs["origin"], 0.0)[place]))
    computed = {
        "north": north, "east": east, "v": v, "sog": np.hypot(u, v), "cog": psi + np.arctan2(v, u),
        "vn": u * np.cos(psi) - v * np.sin(psi), "ve": u * np.sin(psi) + v * np.cos(psi),
    }  # fmt: skip
    return np.asarray(computed.get(signal, frame.get(signal, 0.0)))


def dataset_columns(record: pd.DataFrame, *, wind: bool) -> list[str]:
    """Names of the columns of a record that a dataset has: what was ordered, not what was reached."""
    orders = [name for name in map(str, record) if name.endswith((".n", ".delta", ".alpha"))]
    kept = ["run", "t", "north", "east", "psi", "u", "v", "r", "flags", *(["V_w", "beta_w"] if wind else [])]
    return [*kept, *(name for name in orders if not name.startswith("actual."))]
