"""From a raw field log to a report by commands of the documentation, no file edited: ten drawn craft.

`python docs/records.py field-logs python docs/field_logs.py FOLDER` from the root of a checkout. The logs are by the
equations of this file, stepped by Euler, with a hull and a rudder that no vessel document has (lift with a wake behind
the drift, drag by five strips), gusts that no log shows and a current of 2 to 6 % of the speed: 40 minutes at 0.2 s of
a USV, 50 minutes at 1 s of a ship. Each log speaks a dialect of `DIALECTS`.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pymap3d

from shipid.answer.sentences import best_model
from shipid.logs.guess.draft import QUESTIONS
from shipid.metrics import position_error
from shipid.study.results import Results, read_results
from shipid.units import KNOT

Array = np.ndarray
Random = np.random.Generator
FIRST = 7100
DIALECTS = (
    *("servos", "mavlink", "ros", "outboard", "utm"),
    *("semicolons", "knots", "german", "nmea", "spanish"),
)
STRIPS = (-0.4, -0.2, 0.0, 0.2, 0.4)  # L
STEP, GUST, SWING = 0.05, 3.0, 0.6  # L / U, at most; L / U; rad


@dataclass(frozen=True)
class FieldCraft:
    """A craft by its sizes [SI]; masses, forces and times of its equations are those of L = U = m = 1."""

    kind: str  # twin: two thrusters; outboard: one that swivels; rudder: a screw and a rudder
    L: float
    B: float
    T: float
    U: float
    rpm: float
    numbers: dict[str, float]


def draw_field_craft(place: int, random: Random) -> FieldCraft:
    """The craft of a dialect."""

    def between(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    usv = place < 5
    length = between(1.5, 3.2) if usv else float(np.exp(between(np.log(22), np.log(140))))
    speed = between(0.25, 0.4) * np.sqrt(9.81 * length) if usv else between(0.15, 0.28) * np.sqrt(9.81 * length)
    kind = "rudder" if not usv else "outboard" if DIALECTS[place] == "outboard" else "twin"
    beam = length * (between(0.35, 0.5) if usv else between(0.16, 0.26))
    numbers = {
        "drag": between(0.08, 0.2), "thrust": between(0.9, 1.1), "m_v": between(1.5, 2.0), "m_r": between(0.1, 0.14),
        "lift": between(0.5, 1.1), "centre": between(0.05, 0.2), "cross": between(0.5, 1.5),
        "damp": between(0.02, 0.06),
        "fin": between(0.25, 0.5), "race": between(0.3, 0.7), "wake": between(0.3, 0.6), "arm": between(0.14, 0.2),
        "lag": between(0.1, 0.4), "wind": between(0.002, 0.006), "current": between(0.02, 0.06),
        "towards": between(-np.pi, np.pi), "wind_towards": between(-np.pi, np.pi), "mean_wind": between(0.3, 0.9),
    }  # fmt: skip
    draught = beam / between(2.2, 3.0)
    rpm = 60 * speed / (0.65 * draught * between(0.55, 0.8))  # of a screw of 0.65 draughts at an advance of 0.55 to 0.8
    return FieldCraft(kind, length, beam, draught, speed, rpm, numbers)


def draw_orders(craft: FieldCraft, t: Array, random: Random) -> tuple[Array, Array]:
    """Shares (N,) of the greatest thrust order and helm order: legs, turns and steps, as a crew would."""
    unit = craft.L / craft.U
    drive, helm = np.zeros_like(t), np.zeros_like(t)
    now = 0.0
    while now < t[-1]:
        level, kind = float(random.uniform(0.45, 1.0)), str(random.choice(["zigzag", "circle", "steps", "leg"]))
        size = float(random.uniform(0.25, 1.0))
        lengths = {"zigzag": 24, "circle": 20, "steps": 24, "leg": 8}[kind] * float(random.uniform(0.8, 1.3))
        mine = (t >= now) & (t < now + lengths * unit)
        drive[mine] = level
        if kind == "circle":
            helm[mine & (t >= now + 4 * unit)] = size * random.choice([-1, 1])
        elif kind in ("zigzag", "steps"):
            at, side = now + 3 * unit, float(random.choice([-1, 1]))
            while at < now + lengths * unit:
                held = float(random.uniform(2, 4)) * unit
                helm[mine & (t >= at)] = side * size
                at, side = at + held, -side
                size = float(random.uniform(0.15, 1.0)) if kind == "steps" else size
                if kind == "steps":
                    drive[mine & (t >= at)] = random.uniform(0.4, 1.0)
        now += lengths * unit
    return drive, helm


def sail(craft: FieldCraft, t: Array, drive: Array, helm: Array, random: Random) -> pd.DataFrame:
    """Rows at times (N,) [s]: north, east [m], psi [rad], u, v over ground [m/s], r [rad/s], and the orders."""
    c, unit = craft.numbers, craft.L / craft.U
    every = int(np.ceil((t[1] - t[0]) / (STEP * unit)))
    h = float(t[1] - t[0]) / every / unit
    towards, blows = c["current"] * np.exp(1j * c["towards"]), 1.5 * c["mean_wind"] * np.exp(1j * c["wind_towards"])
    gusts, share = random.normal(size=(len(t), 2)) @ [1, 1j], np.sqrt(2 * h * every / GUST)
    place, psi, motion, order, turn, gust = 0j, float(random.uniform(-3, 3)), [0.7, 0.0, 0.0], 0.0, 0.0, 0j
    rows = []
    for row, aimed in enumerate(zip(drive.tolist(), helm.tolist(), strict=True)):
        gust += -gust * h * every / GUST + 0.3 * c["mean_wind"] * share * gusts[row]
        for _ in range(every):
            order += min(max((aimed[0] - order) / c["lag"], -1.0), 1.0) * h
            turn += min(max((aimed[1] - turn) / c["lag"], -1.0), 1.0) * h
            ahead = complex(np.exp(-1j * psi))
            ground, air = complex(*motion[:2]) + towards * ahead, (blows + gust) * ahead
            forces = forces_of_craft(craft, motion, order, turn, air - ground)
            place += ground / ahead * h
            psi += motion[2] * h
            motion = [one + force * h for one, force in zip(motion, forces, strict=True)]
        over = complex(*motion[:2]) + towards * np.exp(-1j * psi)
        rows.append([place.real * craft.L, place.imag * craft.L, psi, over.real * craft.U, over.imag * craft.U])
        rows[-1].append(motion[2] / unit)
    return pd.DataFrame(rows, columns=["north", "east", "psi", "u", "v", "r"]).assign(t=t, drive=drive, helm=helm)


def forces_of_craft(craft: FieldCraft, motion: list[float], order: float, turn: float, air: complex) -> list[float]:
    """Accelerations of u, v, r through the water by motion, thrust and helm as they act, and air over the craft."""
    c, (u, v, r) = craft.numbers, motion
    X, Y, N = c["m_v"] * 0.6 * v * r - c["drag"] * u * abs(u), -0.75 * u * r, 0.0
    lift = -c["lift"] * u * v * (1 + 0.6 * np.tanh(4 * abs(v)))
    strips = [(x, -c["cross"] / len(STRIPS) * (v + x * r) * abs(v + x * r)) for x in STRIPS]
    Y += lift + sum(one for _, one in strips)
    N += c["centre"] * lift + sum(x * one for x, one in strips) - c["damp"] * r * (abs(u) + 0.5 * abs(r))
    thrust = c["drag"] * (1.15 * order * abs(order) - 0.15 * order * u)
    if craft.kind == "twin":
        sides = [min(max(order + 0.45 * side * turn, -1.0), 1.0) for side in (1, -1)]
        pulls = [0.5 * c["drag"] * (1.15 * one * abs(one) - 0.15 * one * u) for one in sides]
        X, N = X + sum(pulls), N + c["arm"] * (pulls[0] - pulls[1])
    elif craft.kind == "outboard":
        X, Y, N = (
            X + thrust * np.cos(SWING * turn),
            Y - thrust * np.sin(SWING * turn),
            N + thrust * np.sin(SWING * turn) / 2,
        )
    else:
        race = u + c["race"] * max(order - u, 0.0)
        angle = SWING * turn - np.arctan2(c["wake"] * (0.5 * r - v), max(race, 0.1))
        force = 0.15 * c["fin"] * race * abs(race) * np.sin(2 * angle)
        X, Y, N = X + thrust - 0.2 * abs(force * np.sin(angle)), Y - force, N + 0.5 * force
    pressed = c["wind"] * abs(air)
    X, Y, N = X + pressed * air.real, Y + 2.5 * pressed * air.imag, N + 0.2 * pressed * air.imag
    return [X / 1.06, Y / c["m_v"], N / c["m_r"]]


def measured(craft: FieldCraft, log: pd.DataFrame, random: Random) -> dict[str, Array]:
    """What the instruments show: positions, angles [deg], speeds [m/s], yaw rate [deg/s], and their noise."""
    usv, size = craft.L < 10, len(log)
    jitter = float(np.exp(random.uniform(*np.log([0.01, 0.05] if usv else [0.1, 0.5]))))
    north, east = (log[name] + random.normal(0, jitter, size) for name in ("north", "east"))
    psi, r = log["psi"] + random.normal(0, 0.004, size), log["r"] + random.normal(0, 0.0005, size)
    u, v = (log[name] + random.normal(0, 0.01, size) for name in "uv")
    lat, lon, _ = pymap3d.ned2geodetic(north, east, 0, 63.44, 10.40, 0)
    over = np.asarray(np.exp(1j * psi) * (u + 1j * v))
    seen = {"north": north, "east": east, "lat": lat, "lon": lon, "heading": np.degrees(psi) % 360, "psi": psi}
    seen |= {"sog": np.abs(over), "cog": np.degrees(np.angle(over)) % 360, "vn": over.real, "ve": over.imag}
    seen |= {"u": u, "v": v, "rot": np.degrees(r), "r": r, "drive": log["drive"], "helm": log["helm"]}
    return {name: np.asarray(values) for name, values in seen.items()} | {"t": log["t"].to_numpy()}


def pulses(shares: Array) -> Array:
    """Pulses [us] of shares of the greatest order."""
    return np.round(1500 + 400 * np.clip(shares, -1, 1)).astype(int)


def write_log(place: int, craft: FieldCraft, seen: dict[str, Array], folder: Path) -> str:
    """Write a log in its dialect; return its name."""
    dialect, deg = DIALECTS[place], np.degrees(SWING) * seen["helm"]
    left, right = (pulses(seen["drive"] + 0.45 * side * seen["helm"]) for side in (1, -1))
    rpm, clock = (
        np.round(craft.rpm * seen["drive"]),
        pd.Timestamp("2025-06-03 09:12:40") + pd.to_timedelta(seen["t"], "s"),
    )
    geo, motion = {"lat": np.round(seen["lat"], 8), "lon": np.round(seen["lon"], 8)}, np.round(seen["heading"], 1)
    if dialect == "nmea":
        (folder / "log.nmea").write_text("".join(nmea_sentences(seen, deg, rpm, clock)))
        return "log.nmea"
    tables: dict[str, dict[str, Any]] = {
        "servos": {"time": seen["t"], **geo, "heading": motion, "SOG": np.round(seen["sog"], 3),
                   "COG": np.round(seen["cog"], 1), "servo1_raw": left, "servo3_raw": right},
        "mavlink": {"TimeUS": np.round(seen["t"] * 1e6).astype(int) + 73_000_000,
                    "lat": np.round(seen["lat"] * 1e7).astype(int), "lon": np.round(seen["lon"] * 1e7).astype(int),
                    "hdg": np.round(seen["heading"] * 100).astype(int), "vx": np.round(seen["vn"] * 100).astype(int),
                    "vy": np.round(seen["ve"] * 100).astype(int), "RCOU.C1": left, "RCOU.C3": right},
        "ros": {"header.stamp": seen["t"] + 1.7e9, "pose.pose.position.x": seen["east"],
                "pose.pose.position.y": seen["north"], "pose.pose.orientation.x": 0.0, "pose.pose.orientation.y": 0.0,
                "pose.pose.orientation.z": np.sin(np.pi / 4 - seen["psi"] / 2),
                "pose.pose.orientation.w": np.cos(np.pi / 4 - seen["psi"] / 2), "twist.twist.linear.x": seen["u"],
                "twist.twist.linear.y": -seen["v"], "twist.twist.angular.z": -seen["r"], "left_pwm": left,
                "right_pwm": right},
        "outboard": {"time_s": seen["t"], **geo, "heading_deg": motion, "speed_mps": np.round(seen["sog"], 3),
                     "course_deg": np.round(seen["cog"], 1), "steering_pwm": pulses(-seen["helm"]),
                     "throttle_pwm": pulses(seen["drive"])},
        "utm": {"t": seen["t"], "utm_easting": 569_000 + seen["east"], "utm_northing": 7_034_000 + seen["north"],
                "heading": motion, "yaw_rate": np.round(seen["rot"], 2), "pwm_port": left, "pwm_stbd": right},
        "semicolons": {"Time": clock, "Latitude": geo["lat"], "Longitude": geo["lon"], "Heading": motion,
                       "SOG": np.round(seen["sog"], 2), "COG": np.round(seen["cog"], 1),
                       "ROT": np.round(60 * seen["rot"], 1), "Rudder": np.round(-deg, 1), "RPM": rpm},
        "knots": {"timestamp": clock, **geo, "heading": motion, "sog_kn": np.round(seen["sog"] / KNOT, 2),
                  "cog": np.round(seen["cog"], 1), "rudder_deg": np.round(deg, 1), "rpm": rpm},
        "german": {"Zeit": clock, "Breite": geo["lat"], "Länge": geo["lon"], "Kurs [°]": motion,
                   "Fahrt über Grund [kn]": np.round(seen["sog"] / KNOT, 2),
                   "Kurs über Grund [°]": np.round(seen["cog"], 1),
                   "Drehrate [°/min]": np.round(60 * seen["rot"], 1), "Ruderlage [°]": np.round(deg, 1),
                   "Drehzahl [1/min]": rpm},
        "spanish": {"Hora": clock, "Latitud": geo["lat"], "Longitud": geo["lon"], "Rumbo": motion,
                    "Velocidad [kn]": np.round(seen["sog"] / KNOT, 2), "Rumbo sobre fondo": np.round(seen["cog"], 1),
                    "Timón [°]": np.round(deg, 1), "RPM": rpm},
    }  # fmt: skip
    marks = {"sep": ";", "decimal": ","} if dialect in ("semicolons", "german") else {}
    pd.DataFrame(tables[dialect]).to_csv(folder / "log.csv", index=False, **marks)
    return "log.csv"


def nmea_sentences(seen: dict[str, Array], deg: Array, rpm: Array, clock: Any) -> list[str]:
    """RMC, HDT, ROT, RSA and RPM of every row, with their sums."""
    lines = []
    for row, now in enumerate(clock):
        places = []
        for name, sides, wide in (("lat", "NS", 2), ("lon", "EW", 3)):
            value = abs(seen[name][row])
            minutes = f"{60 * (value % 1):09.6f}"
            places.append(f"{int(value):0{wide}d}{minutes},{sides[int(seen[name][row] < 0)]}")
        sog, cog = seen["sog"][row] / KNOT, seen["cog"][row]
        for body in (
            f"GPRMC,{now:%H%M%S},A,{','.join(places)},{sog:.2f},{cog:.1f},{now:%d%m%y},,,A",
            f"HEHDT,{seen['heading'][row]:.1f},T",
            f"TIROT,{60 * seen['rot'][row]:.1f},A",
            f"AGRSA,{deg[row]:.1f},A,,",
            f"ERRPM,S,1,{rpm[row]:.0f},,A",
        ):
            total = 0
            for letter in body.encode():
                total ^= letter
            lines.append(f"${body}*{total:02X}\r\n")
    return lines


def new_vessel(craft: FieldCraft, random: Random) -> list[str]:
    """Words of `vessel new`: what its owner knows of the craft."""
    if craft.kind == "rudder":
        block = f"{random.uniform(0.55, 0.75):.2f}"
        return ["--length", f"{craft.L:.1f}", "--beam", f"{craft.B:.1f}", "--draught", f"{craft.T:.1f}",
                "--block", block,
                "--speed", f"{craft.U:.2f}", "--rpm", f"{craft.rpm:.0f}"]  # fmt: skip
    at = [-0.45 * craft.L] if craft.kind == "outboard" else [-0.4 * craft.L] * 2
    sides = [0.0] if craft.kind == "outboard" else [-0.17 * craft.L, 0.17 * craft.L]
    words = ["--kind", "usv", "--length", f"{craft.L:.2f}", "--beam", f"{craft.B:.2f}", "--speed", f"{craft.U:.2f}"]
    words += ["--mass", f"{9 * craft.L**3:.0f}"]
    words += [f"--thruster={x:.2f},{y:.2f}" for x, y in zip(at, sides, strict=True)]
    return [*words, "--swivel", f"{np.degrees(SWING):.0f}"] if craft.kind == "outboard" else words


def type_command(folder: Path, *words: str) -> str:
    """Type a command in a folder and return what it says; SystemExit with its last line where it fails."""
    done = subprocess.run([sys.executable, "-m", "shipid", *words], cwd=folder, capture_output=True, text=True)
    (folder / "commands.txt").open("a").write(f"$ shipid {' '.join(words)}\n{done.stdout}{done.stderr}")
    if done.returncode:
        raise SystemExit(f"{folder}: shipid {' '.join(words)}: {done.stderr.strip()}")
    return done.stdout


def report_of_log(seed: int, folder: Path) -> tuple[str, list[Any], Results]:
    """Words on a craft, the questions, minutes to the study and of the run, and the results of a log."""
    place, random = seed % len(DIALECTS), np.random.default_rng(seed)
    craft, usv = draw_field_craft(place, random), place < len(DIALECTS) // 2
    t = np.arange(0, 2400, 0.2) if usv else np.arange(0, 3000, 1.0)
    folder.mkdir(parents=True)
    log = sail(craft, t, *draw_orders(craft, t, random), random)
    name = write_log(place, craft, measured(craft, log, random), folder)
    begun = time.perf_counter()
    type_command(folder, "vessel", "new", *new_vessel(craft, random), "--out", "craft.toml")
    way = ["--frame", "ros"] if DIALECTS[place] == "ros" else []
    type_command(folder, "data", "import", "--guess", name, "--vessel", "./craft.toml", "--out", "map.toml", *way)
    type_command(folder, "data", "import", "map.toml", name, "--out", "log.parquet")
    type_command(folder, "study", "new", "--vessel", "./craft.toml", "--data", "log.parquet", "--out", "study.toml")
    drafted = time.perf_counter()
    type_command(folder, "study", "run", "study.toml", "--workers", "1", "--out", "run")
    minutes = [(drafted - begun) / 60, (time.perf_counter() - drafted) / 60]
    questions = (folder / "map.toml").read_text().count("# ? ") - len(QUESTIONS)
    return f"{craft.L:.1f} m, {DIALECTS[place]}", [questions, *minutes], read_results(folder / "run")


def row_of_log(words: str, known: list[Any], results: Results) -> str:
    """The row of a log in the table: H [m] with the most runs, of the physics that validation prefers."""
    cells = results.judged_cells
    largest = int(cells["N_D"].max())
    last = cells[cells["N_D"] == largest].groupby("model", sort=False)["H"].mean()
    rivals = [results.regression[one.key] for one in results.plan.batches if largest == one.N_D]
    rival = float(np.mean([position_error(path, results.test.future).mean() for path in rivals]))
    physics, none = float(last[best_model(results)]), float(last["none"])
    lower = "yes" if physics < rival else "no"
    numbers = [f"{value:.3g}" for value in (physics, none, rival, float(results.naive.mean()))]
    minutes = f"{known[1]:.1f} + {known[2]:.1f}"
    return f"| {words} | {known[0]} | {minutes} | {largest} | {' | '.join(numbers)} | {lower} |"


def main() -> None:
    """Print a row a log."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="new folder for logs, studies and runs")
    parser.add_argument("seeds", nargs="*", type=int, default=[*range(FIRST, FIRST + len(DIALECTS))])
    given = parser.parse_args()
    heads = ["log", "questions", "minutes: to the study + run", "N_D", "physics", "no physics", "`regression`"]
    print(f"| {' | '.join([*heads, 'constant u, v, r', 'lower than `regression`'])} |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |")
    for seed in given.seeds:
        try:
            print(row_of_log(*report_of_log(seed, given.folder / str(seed))), flush=True)
        except SystemExit as stopped:
            print(f"| {DIALECTS[seed % len(DIALECTS)]} | {stopped} |", flush=True)


if __name__ == "__main__":
    main()
