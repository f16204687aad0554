"""Made-up ships that the template has never seen, with their logs: drawn by seed, from other terms than the template's.

The truth has a hull of cubic MMG terms, or linear lift with cross-flow drag; a rudder in the race, or one that knows
the ship's speed alone; lags of shaft and steering gear; a current and gusts that nobody measured. Slopes are those of
Inoue et al. (1981), each times a separate factor; the template has Clarke's and Kijima's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset
from shipid.errors import ShipidError
from shipid.simulation.approach import Controls
from shipid.simulation.manoeuvre import ApproachedManoeuvre, Excitation, TurningCircle, Zigzag
from shipid.simulation.perform import perform_manoeuvres
from shipid.simulation.standard import shaft_speed
from shipid.simulation.weather import Gusts, gust_series
from shipid.vessel.load import Vessel, check_document

DRIVES = ("screw", "twin screw", "azimuth", "screw and tunnel")
TRIES = 40  # ships are drawn until one goes straight and turns
TURN = (1.4, 9.0)  # lengths across: tactical diameter of a ship that is taken


@dataclass(frozen=True)
class Stranger:
    """A ship that nobody has seen.

    seed, drive, words : how it was drawn. truth : the vessel that made the log. dataset : the log, with noise.
    known : option of `shipid vessel new` -> what people know of the ship.
    """

    seed: int
    drive: str
    words: str
    truth: Vessel
    dataset: Dataset
    known: Mapping[str, float | str | bool]

    @property
    def options(self) -> list[str]:
        """What is known, as options of the command line."""
        words_: list[str] = []
        for name, value in self.known.items():
            words_ += (
                [f"--{name}"]
                if value is True
                else [f"--{name}", f"{value:g}" if isinstance(value, float) else str(value)]
            )
        return words_


def stranger(seed: int, runs: int = 24) -> Stranger:
    """Draw a ship and its log."""
    random, drive = np.random.default_rng([seed, 20]), DRIVES[seed % len(DRIVES)]
    for drawn, vessel, n in _candidates(random, drive, f"stranger-{seed}.toml"):
        try:
            dataset = _log(random, vessel, n, drawn, runs)
        except ShipidError:
            continue
        return Stranger(seed, drive, drawn["words"], vessel, dataset, _known(random, drawn, n))
    raise AssertionError(f"no ship of seed {seed} goes straight and turns")


def strange_vessel(seed: int) -> tuple[Vessel, float, float]:
    """Draw a ship without a log: the vessel, its service speed U [m/s], and the shaft speed [rev/s] of that speed."""
    random, drive = np.random.default_rng([seed, 21]), DRIVES[seed % len(DRIVES)]
    drawn, vessel, n = next(_candidates(random, drive, f"stranger-{seed}.toml"))
    return vessel, drawn["U"], n


def _candidates(random: np.random.Generator, drive: str, name: str) -> Iterator[tuple[dict[str, Any], Vessel, float]]:
    """Ships that go straight and turn: how each was drawn, the vessel, and its shaft speed [rev/s] at U."""
    for _ in range(TRIES):
        drawn = _ship(random, drive)
        try:
            vessel = check_document(drawn["document"], name)
            n = shaft_speed(Controls(vessel), drawn["U"])
            if _sails(vessel, n, drawn):
                yield drawn, vessel, n
        except ShipidError:
            continue


def _ship(random: np.random.Generator, drive: str) -> dict[str, Any]:
    """Sizes, speed and document of a ship."""
    model = bool(random.random() < 0.5)
    length = float(random.uniform(2.0, 7.0)) if model else float(np.exp(random.uniform(np.log(30.0), np.log(320.0))))
    full = float(random.uniform(0.5, 0.83))
    scale = float(np.exp(random.uniform(np.log(15), np.log(60)))) if model else 1.0
    L = length
    B = L / random.uniform(*((4.2, 5.6) if L * scale < 90 else (5.2, 7.4)))
    T = B / random.uniform(2.3, 3.6)
    froude = random.uniform(0.13, 0.17) if full > 0.75 else random.uniform(0.17, 0.27)
    U = float(froude * np.sqrt(9.81 * L))
    rho = 1000.0 if model else 1025.0
    size = {"L": L, "B": B, "T": T, "C_b": full, "U": U, "rho": rho, "scale": scale, "quick": np.sqrt(scale)}
    hull_kind = str(random.choice(["cubic", "cross-flow"]))
    rudder_kind = str(random.choice(["race", "speed"])) if drive != "azimuth" else "azimuth"
    m = rho * full * L * B * T

    def f(low: float = 0.8, high: float = 1.25) -> float:
        return float(random.uniform(low, high))

    k = 2 * T / L
    lift = {
        "Y_v": -(np.pi * k / 2 + 1.4 * full * B / L) * f(),
        "Y_r": np.pi * k / 4 * f(0.5, 1.2),
        "N_v": -k * f(0.75, 1.1),
        "N_r": -(0.54 * k - k**2) * f(0.9, 1.4),
    }
    mass = {"m_x": m * f(0.04, 0.09), "m_y": m * f(0.75, 1.05)}
    I_z = m * (L * f(0.235, 0.27)) ** 2
    R = 0.5 * rho * U**2 * _wetted(size) * f(0.0028, 0.0048)  # N at U
    document: dict[str, Any] = {
        "name": f"Stranger of {L:.3g} m", "dof": 3, "source": "made up",
        "particulars": {"L_pp": L, "B": B, "T": T, "C_b": full, "U_0": U},
        "constants": {"rho": rho, "rho_a": 1.225},
        "inertia": {"m": m, "I_z": I_z, "x_G": L * f(-0.02, 0.03)},
        "added_mass": {
            "coriolis": "mmg", "X_udot": -mass["m_x"], "Y_vdot": -mass["m_y"], "N_rdot": -I_z * f(0.55, 1.0)
        },
        "current": {"kind": "uniform"},
        "wind": _wind(size, f),
    }  # fmt: skip
    document["hull"] = _hull(hull_kind, size, lift, R, f)
    document["thruster"] = _thrusters(drive, rudder_kind, size, f, R)
    words = f"{'model' if model else 'ship'} of {L:.3g} m, {drive}, {hull_kind} hull, rudder by {rudder_kind}"
    return size | {"document": _plain(document), "words": words, "model": model, "drive": drive, "rudder": rudder_kind}


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


def _sails(vessel: Vessel, n: float, drawn: Mapping[str, Any]) -> bool:
    """Whether it turns at 35 deg neither on the spot nor hardly."""
    pace = drawn["L"] / drawn["U"]
    turn = TurningCircle(n_rpm=60 * n, duration=25 * pace)
    log = perform_manoeuvres(vessel, [turn], step=pace / 60)
    across = (log["east"].max() - log["east"].min()) / drawn["L"]
    zigzag = perform_manoeuvres(vessel, [Zigzag(n_rpm=60 * n, angle_deg=10, duration=20 * pace)], step=pace / 60)
    return bool(TURN[0] < across < TURN[1] and np.abs(zigzag["psi"]).max() < np.radians(60))


def _log(random: np.random.Generator, vessel: Vessel, n: float, drawn: Mapping[str, Any], count: int) -> Dataset:
    """Runs of several kinds at two speeds, in a current and gusts, with noise of the sensors."""
    pace, U, L, quick = drawn["L"] / drawn["U"], drawn["U"], drawn["L"], drawn["quick"]
    interval = _round(pace / 12)
    step = interval / 6
    kinds: list[ApproachedManoeuvre] = []
    for number in range(count):
        how: dict[str, Any] = {"n_rpm": 60 * n * (1.0, 0.75)[number % 2], "course_deg": float(random.uniform(0, 360))}
        how["execute_at"] = float(np.ceil(2 * pace / interval) * interval)
        side = ("starboard", "port")[(number // 2) % 2]
        kind = (number // 4) % 6
        if kind in (0, 1, 3):
            angle = (10, 20, 0, 15)[kind]
            kinds.append(Zigzag(name=f"zigzag {number}", angle_deg=angle, side=side, duration=20 * pace, **how))
        elif kind in (2, 5):
            angle = 35 if kind == 2 else 15
            kinds.append(TurningCircle(name=f"circle {number}", angle_deg=angle, side=side, duration=18 * pace, **how))
        else:
            kinds.append(
                Excitation(
                    name=f"random {number}", signal="aprbs", angle_deg=25, amplitude_rpm=60 * n * 0.2,
                    hold=(1.5 * pace, 5 * pace), seed=number, duration=20 * pace, **how,
                )
            )  # fmt: skip
    every = round(interval / step)
    rows = every * int(max(one.length for one in kinds) / interval + 1e-9) + 1
    t = step * np.arange(rows)
    weather: dict[str, Any] = {"V_c": random.uniform(0, 0.05) * U, "beta_c": random.uniform(-3, 3)}
    if not drawn["model"]:
        mean = np.full(count, random.uniform(0, 7))
        gusts = mean + gust_series(
            Gusts(kind="npd"), mean, t, [(int(random.integers(1e6)), run) for run in range(count)]
        )
        weather |= {"V_w": np.maximum(gusts, 0.0), "beta_w": random.uniform(-3, 3)}
    environment = {
        name: value if np.ndim(value) == 2 else np.full((rows, count), value) for name, value in weather.items()
    }
    frame = perform_manoeuvres(vessel, kinds, step=step, interval=interval, environment=environment)
    hidden = [name for name in frame if str(name).startswith("actual.") or name in ("V_w", "beta_w", "V_c", "beta_c")]
    frame = frame.drop(columns=hidden)
    noise = {
        "u": 0.008 * U, "v": 0.008 * U, "r": np.radians(0.04) * quick, "psi": np.radians(0.2),
        "north": 0.008 * L, "east": 0.008 * L,
    }  # fmt: skip
    for name, size in noise.items():
        frame[name] = frame[name] + random.normal(0, size, len(frame))
    return Dataset(_typed(frame), {"clock": "run", "flags": []})


def _typed(frame: pd.DataFrame) -> pd.DataFrame:
    numbers = [name for name in frame.columns if name not in ("run", "flags")]
    return frame.astype({**dict.fromkeys(numbers, "float64"), "run": "str"})


def _known(random: np.random.Generator, drawn: Mapping[str, Any], n: float) -> dict[str, float | str | bool]:
    """What people know: main particulars and service speed and rpm, each rounded; the rest of some ships."""
    known: dict[str, float | str | bool] = {
        name: float(f"{drawn[key]:.3g}") for name, key in (("length", "L"), ("beam", "B"), ("draught", "T"))
    }
    known |= {"block": float(f"{drawn['C_b']:.2g}"), "speed": float(f"{drawn['U']:.2g}"), "rpm": float(f"{60 * n:.2g}")}
    first, *_ = (block for block in drawn["document"]["thruster"].values() if "D_p" in block)
    if random.random() < 0.5:
        known["propeller-diameter"] = float(f"{first['D_p']:.2g}")
    if drawn["model"]:
        known["scale"] = float(f"{drawn['scale']:.3g}")
    if drawn["drive"] == "azimuth":
        known["propulsor"] = "azimuth"
    elif drawn["drive"] == "twin screw":
        known["shafts"] = 2
    elif "tunnel" in drawn["drive"]:
        known["tunnel-thruster"] = True
    steered = next((block for block in drawn["document"]["thruster"].values() if "A_R" in block), None)
    if steered is not None and random.random() < 0.5:
        known["rudder-area"] = float(f"{steered['A_R']:.2g}")
    return known


def _round(value: float) -> float:
    decade = 10.0 ** np.floor(np.log10(value))
    return float(f"{max(step * decade for step in (1, 2, 5) if step * decade <= value * (1 + 1e-9)):.6g}")
