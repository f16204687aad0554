"""Ships and logs with known faults, drawn by seed, for the diagnosis of a misfit; and its score.

`python -m tests.identification.faulty_logs --seed S --count 1000 --sound 500` prints the table. *extra*: the cause is
named, and beside it one that is not there.
40 ships of 1 to 300 m and 0.1 to 12 m/s. The truth is from the midpoint rule of this file, at a step of its own, with a
hull that the vessel document has no terms for: cubic and modulus damping, a wake that depends on the drift and is not
alike on both sides, gusts and waves that no log shows. The document has some quadratic terms, fitted.

A fault has a *factor*: how many times it multiplies the mean error of the document over five ship lengths, without
noise. Factors of 1.3, 2 and 4 are asked for; a fault without an amount (a sign, an exchange) has its own, if above 1.2.
Causes that a log cannot tell apart are *equal*, written down before the first measurement:

- rudder.zero: a hull that is not alike on both sides (an odd force), a side force of the screw;
- rudder.scale: a factor of the rudder's force; rpm.scale: a factor of the thrust (both go with n |n|);
- rudder.delay, rpm.delay: a lag of the actuator;
- rpm.unsigned: a zero or a sign of the shaft where the ship goes astern;
- heading.bias: a sideways velocity in proportion to the speed; heading.course: a heading that is the course;
- position.delay: the antenna at U x delay ahead; velocity.delay: all of u and v late;
- speed.scale: u and v are multiplied, as by a wrong unit; wind.scale: a factor of the wind's force;
- thrust.factor, damping.factor: at steady speed only their ratio shows; mass.factor: a delay of thrust and helm;
- antenna: position.delay, as above; rudder.factor: rudder.scale, as above.
"""

from __future__ import annotations

import argparse
import math
import re
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

Array = np.ndarray
Table = dict[str, Array]
STEPS, EVERY, LENGTHS = 48, 4, 20  # steps a unit of time L / U, steps a row, length of a run in L
YAW, SWAY, SURGE = 0.115, 1.8, 1.06  # masses of yaw, sway and surge, of which 0.0625, 1, 1 are the ship's own
K_ASTERN = 0.65
FACTORS = (1.3, 2.0, 4.0)
NOISES = {"none": 0.0, "good": 0.07, "fair": 0.25, "poor": 0.6}


@dataclass(frozen=True)
class FieldShip:
    """A ship with L = U = m = n_max = 1, and its size. `c` are the numbers of its true equations."""

    L: float
    U: float
    n_max: float
    drive: str  # rudder (one screw), both (two screws, one rudder), screws (two screws alone)
    c: dict[str, float]
    fit: dict[str, float] = field(default_factory=dict)

    @property
    def lever(self) -> float:
        """Distance of a screw from the middle line, in L."""
        return 0.0 if self.drive == "rudder" else 0.12


def draw_ship(number: int, seed: int) -> FieldShip:
    """Draw a ship and fit its document."""
    random = np.random.default_rng([seed, number, 1])
    length = float(np.exp(random.uniform(0, math.log(300))))
    speed = float(np.clip(random.uniform(0.05, 0.35) * math.sqrt(9.81 * length), 0.1, 12))
    drag, wake = random.uniform(0.05, 0.25), random.uniform(0.15, 0.35)
    b1, b2 = random.uniform(0.8, 1.4), random.uniform(0.3, 0.6)
    c2 = random.uniform(0.01, 0.08)
    numbers = {
        **{"drag": drag, "wake": wake, "t_u": random.uniform(0.2, 0.5) * drag},
        **{"vv": random.uniform(0.05, 0.3), "rr": random.uniform(0.0, 0.03), "vvvv": random.uniform(0, 1.5)},
        **{
            "b1": b1,
            "b2": b2,
            "b3": random.uniform(0.5, 2),
            "b4": random.uniform(1, 5),
            "b5": random.uniform(0.1, 0.6),
        },
        **{"c1": c2 * (1 - b2) / b1 + random.uniform(0.03, 0.07), "c2": c2, "c3": random.uniform(0.01, 0.04)},
        **{"c4": random.uniform(0.02, 0.15), "c5": random.uniform(0.2, 2), "e": random.uniform(0.06, 0.11)},
        **{
            "race": random.uniform(0.2, 0.6),
            "port": random.uniform(0.25, 0.45),
            "starboard": random.uniform(0.35, 0.55),
        },
        **{"wind": random.uniform(0.001, 0.004), "yaw_screws": random.uniform(0.9, 1.1)},
    }
    drive = ["rudder", "both", "screws"][number % 3]
    ship = FieldShip(length, speed, float(random.uniform(20, 40) / length**0.55), drive, numbers)
    return FieldShip(**{**vars(ship), "fit": fit_document(ship, random)})


def wind_force(c: float, psi: Array, u: Array, v: Array, wind: Array) -> tuple[Array, Array]:
    """Surge and sway force of a wind (2, ...) towards north and east; the side has 2.5 times the coefficient."""
    along = wind[0] * np.cos(psi) + wind[1] * np.sin(psi) - u
    across = wind[1] * np.cos(psi) - wind[0] * np.sin(psi) - v
    speed = np.hypot(along, across)
    return c * speed * along, 2.5 * c * speed * across


def true_rates(ship: FieldShip, state: Array, wind: Array, waves: Array) -> Array:
    """Accelerations of u, v, r (3, ...) of state = psi, u, v, r, n1, n2, delta (7, ...)."""
    c = ship.c
    psi, u, v, r, n1, n2, delta = state
    speed = np.sqrt(u * u + v * v + 1e-8)
    drift = np.arctan2(v - 0.4 * r, np.abs(u) + 0.05)
    wake = c["wake"] * np.exp(-3 * drift**2) * (1 + 0.4 * np.tanh(3 * drift))
    u_p = (1 - wake) * u
    thrusts = []
    for n in (n1, n2):
        full = (c["drag"] * 1.05 + c["t_u"] * (1 - c["wake"])) / 2
        thrusts.append(full * n * np.abs(n) * np.where(n > 0, 1, K_ASTERN) - c["t_u"] / 2 * np.abs(n) * u_p)
    flow = u_p * np.abs(u_p) + c["race"] * (n1 * np.abs(n1) + n2 * np.abs(n2)) / 2
    flow = np.maximum(flow, 0)
    gamma = np.where(drift > 0, c["starboard"], c["port"])
    angle = delta + gamma * (v - 0.9 * r) / np.sqrt(flow + 0.05) if ship.drive != "screws" else 0.0
    helm = c["e"] * flow * np.sin(angle) if ship.drive != "screws" else 0.0
    x = sum(thrusts) - c["drag"] * (u * np.abs(u) + 0.05 * u) - c["vv"] * v * v - c["rr"] * r * r
    x = x + c["vvvv"] * v**4 + 1.5 * v * r - 0.6 * np.abs(helm * np.sin(angle))
    y = -c["b1"] * speed * v + (c["b2"] - 1) * u * r - c["b3"] * v * np.abs(v) - c["b4"] * v**3
    y = y - c["b5"] * v * v * r - 2.2 * helm - 0.01 * (n1 * np.abs(n1) + n2 * np.abs(n2)) / 2
    n = -c["c1"] * speed * r - c["c2"] * u * v - c["c3"] * r * np.abs(r) - c["c4"] * r**3 - c["c5"] * v * v * r
    n = n + helm + ship.lever * c["yaw_screws"] * (thrusts[0] - thrusts[1])
    blow = wind_force(c["wind"], psi, u, v, wind)
    return np.stack([(x + blow[0]) / SURGE, (y + blow[1] + waves[0]) / SWAY, (n + waves[1]) / YAW])


#: term of the document -> its formula of u, v, r
HULL: dict[str, Callable[[Table], Array]] = {
    "X_u": lambda s: s["u"],
    "X_u|u|": lambda s: s["u"] * np.abs(s["u"]),
    "X_vr": lambda s: s["v"] * s["r"],
    "Y_|u|v": lambda s: np.abs(s["u"]) * s["v"],
    "Y_ur": lambda s: s["u"] * s["r"],
    "Y_v|v|": lambda s: s["v"] * np.abs(s["v"]),
    "N_uv": lambda s: s["u"] * s["v"],
    "N_|u|r": lambda s: np.abs(s["u"]) * s["r"],
    "N_r|r|": lambda s: s["r"] * np.abs(s["r"]),
}


def document_columns(ship: FieldShip, state: Array) -> dict[str, tuple[int, Array]]:
    """Each term of the document: its axis (0, 1, 2) and what multiplies its number, at states as in `true_rates`."""
    _, u, v, r, n1, n2, delta = state
    columns = {name: ("XYN".index(name[0]), form({"u": u, "v": v, "r": r})) for name, form in HULL.items()}
    screws = [n * np.abs(n) * np.where(n >= 0, 1, K_ASTERN) / 2 for n in (n1, n2)]
    columns["T_nn"], columns["T_nu"] = (0, sum(screws)), (0, -(np.abs(n1) + np.abs(n2)) / 2 * u)
    if ship.drive != "screws":
        race = np.maximum(u * np.abs(u) + ship.c["race"] * n1 * np.abs(n1), 0)  # that of the first screw
        columns["Y_d"], columns["N_d"] = (1, race * delta), (2, race * delta)
        columns["X_d"] = (0, race * delta**2)
    return columns


def yaw_of_screws(fit: dict[str, float], state: Array) -> Array:
    """Half the difference of the document's thrusts of two screws, port less starboard."""
    push = [
        fit["T_nn"] * n * np.abs(n) * np.where(n >= 0, 1, K_ASTERN) - fit["T_nu"] * np.abs(n) * state[1]
        for n in state[4:6]
    ]
    return (push[0] - push[1]) / 2


def document_rates(ship: FieldShip, fit: dict[str, float], state: Array, wind: Array) -> Array:
    """Accelerations of u, v, r by the document, whose own masses are those of the truth."""
    psi, u, v, r = state[:4]
    force = [v * r, -u * r, np.zeros_like(u)]
    for name, (axis, column) in document_columns(ship, state).items():
        force[axis] = force[axis] + fit[name] * column
    force[2] = force[2] + ship.lever * yaw_of_screws(fit, state)
    blow = wind_force(ship.c["wind"], psi, u, v, wind)
    mass = fit.get("mass", 1.0)
    return np.stack(
        [
            (force[0] + (mass - 1) * v * r + blow[0]) / (SURGE + mass - 1),
            (force[1] - (mass - 1) * u * r + blow[1]) / (SWAY + mass - 1),
            force[2] / (YAW + 0.0625 * (mass - 1)),
        ]
    )


def fit_document(ship: FieldShip, random: np.random.Generator) -> dict[str, float]:
    """Least squares of the document's numbers on the true accelerations of 24 runs without wind; T_nn at least 0."""
    table = simulate_runs(ship, random, 24, 0.0, 0.0)
    state = np.stack([table[key].ravel() for key in ("psi", "u", "v", "r", "n1", "n2", "delta")])
    calm = np.zeros((2, state.shape[1]))
    goal = true_rates(ship, state, calm, calm) * np.array([[SURGE], [SWAY], [YAW]])
    goal = goal - np.stack([state[2] * state[3], -state[1] * state[3], 0 * state[1]])
    fit: dict[str, float] = {}
    for axis in (0, 1, 2):
        if axis == 2:
            goal[2] -= ship.lever * yaw_of_screws(fit, state)
        columns = {name: column for name, (at, column) in document_columns(ship, state).items() if at == axis}
        design = np.stack(list(columns.values()), 1)
        fit |= dict(zip(columns, np.linalg.lstsq(design, goal[axis], rcond=1e-6)[0].tolist(), strict=True))
    return fit


def simulate_runs(ship: FieldShip, random: np.random.Generator, runs: int, wind: float, rough: float) -> Table:
    """Runs of zigzags, turns, steps and stops by the midpoint rule: name -> (runs, rows), without dimension.

    wind : mean speed in U. rough : strength of gusts and waves, both Ornstein-Uhlenbeck.
    """
    kind = np.resize([0, 1, 2, 3, 0, 1, 2, 4], runs)  # zigzag, turn, steps, straight with steps of the shaft, stop
    side = np.resize([1, -1], runs) * np.where(np.arange(runs) % 4 < 2, 1, -1).astype(float)
    level = random.uniform(0.5, 1.0, runs)
    size, angle = random.uniform(0.3, 1.0, runs), random.uniform(0.15, 0.4, runs)
    table = random.uniform(-1, 1, (3, LENGTHS, runs))
    state = np.zeros((9, runs))  # north, east, psi, u, v, r, n1, n2, delta
    state[2], state[3] = random.uniform(-3, 3, runs), 0.85 * level
    state[6] = state[7] = level
    start, gust, waves = state[2].copy(), np.zeros((2, runs)), np.zeros((2, runs))
    towards = random.uniform(-3, 3)
    mean = wind * np.array([[math.cos(towards)], [math.sin(towards)]]) * np.ones(runs)
    h, rows = 1 / STEPS, []

    def rate(at: Array) -> Array:
        kick = np.concatenate([at[3:6], at[6:9]])
        moved = true_rates(ship, np.concatenate([at[2:3], kick]), mean + gust, waves)
        cos, sin = np.cos(at[2]), np.sin(at[2])
        lag = (order - at[6:9]) / np.array([[0.15], [0.15], [0.12]])
        return np.concatenate([[at[3] * cos - at[4] * sin, at[3] * sin + at[4] * cos, at[5]], moved, lag])

    for step in range(LENGTHS * STEPS):
        slot = step // (2 * STEPS)
        side = np.where((kind == 0) & ((state[2] - start) * side > angle), -side, side)
        helm = np.select(
            [kind == 0, kind == 1, kind == 2], [side * angle / 0.6, side * size, table[0, slot]], 0.1 * side
        )
        n = np.select([kind == 3, kind == 2], [0.65 + 0.35 * table[1, slot], level], level)
        n = np.where((kind == 4) & (step > 5 * STEPS), np.where(step < 12 * STEPS, -0.5, 0.7), n)
        part = 0.35 * helm if ship.drive == "screws" else 0.15 * table[2, slot] * (ship.drive == "both") * (kind == 2)
        order = np.stack([n + part, n - part, 0.6 * helm * (ship.drive != "screws")])
        if step % EVERY == 0:
            rows.append(np.concatenate([state, mean + 0 * gust]))
        gust += -gust * h / 0.5 + rough * 0.3 * wind * math.sqrt(2 * h / 0.5) * random.normal(size=(2, runs))
        kick = random.normal(size=(2, runs)) * math.sqrt(2 * h / 0.3)
        waves += -waves * h / 0.3 + rough * kick * np.array([[0.006], [0.0004]])
        state = state + h * rate(state + h / 2 * rate(state))
    grid = np.stack(rows, 2)
    names = ("north", "east", "psi", "u", "v", "r", "n1", "n2", "delta", "wind_n", "wind_e")
    out = dict(zip(names, grid, strict=True))
    return out | {"t": np.broadcast_to(np.arange(grid.shape[2]) * EVERY * h, grid.shape[1:])}


def physics_error(ship: FieldShip, fit: dict[str, float], log: Table) -> float:
    """Mean distance over five ship lengths between the path by the document from rows of a log, and the log, in L."""
    span, rows = 5 * STEPS // EVERY, log["t"].shape[1]
    starts = np.arange(0, rows - span, span // 2)
    take = lambda key, k: log[key][:, starts + k].ravel()  # noqa: E731
    state = np.stack([take(key, 0) for key in ("north", "east", "psi", "u", "v", "r")])
    h, total = EVERY / STEPS, 0.0
    for k in range(span):
        inputs = np.stack([(take(key, k) + take(key, k + 1)) / 2 for key in ("n1", "n2", "delta")])
        wind = np.stack([take("wind_n", k), take("wind_e", k)])

        def rate(at: Array, inputs: Array = inputs, wind: Array = wind) -> Array:
            cos, sin = np.cos(at[2]), np.sin(at[2])
            moved = document_rates(ship, fit, np.concatenate([at[2:6], inputs]), wind)
            return np.concatenate([[at[3] * cos - at[4] * sin, at[3] * sin + at[4] * cos, at[5]], moved])

        state = np.clip(state + h * rate(state + h / 2 * rate(state)), -1e3, 1e3)
        total += float(np.mean(np.hypot(state[0] - take("north", k + 1), state[1] - take("east", k + 1))))
    return total / span


# ------------------------------------------------------------------------------------------------- the faults


def late(values: Array, rows: float) -> Array:
    """Series (runs, rows) as it comes some rows late, linear between rows."""
    at = np.arange(values.shape[1])
    return np.stack([np.interp(at - rows, at, run) for run in values])


def with_current(log: Table, north: Array, east: Array) -> Table:
    """The log in a current of each run (runs, 1): the same motion through the water."""
    cos, sin = np.cos(log["psi"]), np.sin(log["psi"])
    moved = {"north": log["north"] + north * log["t"], "east": log["east"] + east * log["t"]}
    return log | moved | {"u": log["u"] + north * cos + east * sin, "v": log["v"] - north * sin + east * cos}


def with_lever(log: Table, x: float, velocities: bool) -> Table:
    """The log of an antenna x ahead of the origin."""
    moved = {"north": log["north"] + x * np.cos(log["psi"]), "east": log["east"] + x * np.sin(log["psi"])}
    return log | moved | ({"v": log["v"] + x * log["r"]} if velocities else {})


def as_course(log: Table) -> Table:
    """The log whose heading is its course over ground; u is the speed, v nothing."""
    course = np.unwrap(log["psi"] + np.arctan2(log["v"], log["u"]), axis=1)
    return log | {"psi": course, "u": np.hypot(log["u"], log["v"]), "v": 0 * log["v"]}


def scale(log: Table, keys: tuple[str, ...], factor: float) -> Table:
    """The log with some columns times a factor."""
    return log | {key: factor * log[key] for key in keys}


def by_run(log: Table, direction: float) -> tuple[Array, Array]:
    """A direction of the current for each run, turning from run to run: north and east (runs, 1)."""
    way = direction + 2.4 * np.arange(len(log["t"]))[:, None]
    return np.cos(way), np.sin(way)


Change = Callable[[Table, float, float], Table]
#: cause -> the log that it makes of a sound one, by an amount (its greatest beside it; 0: no amount) and a direction
CAUSES: dict[str, tuple[float, Change]] = {
    "rudder.zero": (0.4, lambda log, a, w: log | {"delta": log["delta"] + math.copysign(a, w)}),
    "rudder.sign": (0, lambda log, _a, _w: scale(log, ("delta",), -1)),
    "rudder.scale": (1.5, lambda log, a, w: scale(log, ("delta",), 1 + a if w > 0 else 1 / (1 + a))),
    "rudder.delay": (36, lambda log, a, _w: log | {"delta": late(log["delta"], a)}),
    "rpm.scale": (1.5, lambda log, a, w: scale(log, ("n1",), 1 + a if w > 0 else 1 / (1 + a))),
    "rpm.zero": (0.6, lambda log, a, w: log | {"n1": log["n1"] + math.copysign(a, w)}),
    "rpm.delay": (36, lambda log, a, _w: log | {"n1": late(log["n1"], a)}),
    "rpm.unsigned": (0, lambda log, _a, _w: log | {"n1": np.abs(log["n1"])}),
    "rpm.sign": (0, lambda log, _a, _w: scale(log, ("n1",), -1)),
    "heading.bias": (0.6, lambda log, a, w: log | {"psi": log["psi"] + math.copysign(a, w)}),
    "heading.delay": (24, lambda log, a, _w: log | {"psi": late(log["psi"], a)}),
    "heading.course": (0, lambda log, _a, _w: as_course(log)),
    "position.delay": (24, lambda log, a, _w: log | {key: late(log[key], a) for key in ("north", "east")}),
    "velocity.delay": (24, lambda log, a, _w: log | {key: late(log[key], a) for key in ("u", "v")}),
    "speed.scale": (1.0, lambda log, a, w: scale(log, ("u", "v"), 1 + a if w > 0 else 1 / (1 + a))),
    "sway.bias": (0.5, lambda log, a, w: log | {"v": log["v"] + math.copysign(a, w)}),
    "yaw.bias": (0.5, lambda log, a, w: log | {"r": log["r"] + math.copysign(a, w)}),
    "yaw.scale": (1.5, lambda log, a, w: scale(log, ("r",), 1 + a if w > 0 else 1 / (1 + a))),
    "antenna": (1.5, lambda log, a, w: with_lever(log, math.copysign(a, w), velocities=False)),
    "antenna.velocities": (1.5, lambda log, a, w: with_lever(log, math.copysign(a, w), velocities=True)),
    "sides.exchanged": (0, lambda log, _a, _w: log | {"n1": log["n2"], "n2": log["n1"]}),
    "current": (0.5, lambda log, a, w: with_current(log, np.array(a * math.cos(w)), np.array(a * math.sin(w)))),
    "current.by_run": (0.5, lambda log, a, w: with_current(log, *(a * part for part in by_run(log, w)))),
    "wind.scale": (3.0, lambda log, a, _w: scale(log, ("wind_n", "wind_e"), 1 + a)),
}
#: cause in the document -> its numbers that are multiplied
FALSE_NUMBERS = {
    "damping.factor": ("X_u", "X_u|u|", "Y_|u|v", "Y_v|v|", "N_|u|r", "N_r|r|"),
    "thrust.factor": ("T_nn", "T_nu"),
    "rudder.factor": ("X_d", "Y_d", "N_d"),
    "mass.factor": ("mass",),
}
ALL_CAUSES = (*CAUSES, *FALSE_NUMBERS)


def possible_causes(ship: FieldShip, windy: bool) -> list[str]:
    """Causes that this ship can have."""
    out = [cause for cause in ALL_CAUSES if ship.drive != "screws" or not cause.startswith("rudder")]
    out = [cause for cause in out if cause != "sides.exchanged" or ship.drive != "rudder"]
    return [cause for cause in out if cause != "wind.scale" or windy]


def apply_fault(
    ship: FieldShip, cause: str, amount: float, way: float, log: Table, fit: dict[str, float]
) -> tuple[Table, dict[str, float]]:
    """The log and the document with a fault; that of a shaft is of the first one, which may be the only one."""
    if cause in FALSE_NUMBERS:
        factor = 1 + amount if way > 0 else 1 / (1 + amount)
        return log, fit | {
            name: factor * fit.get(name, 1.0) for name in FALSE_NUMBERS[cause] if name in fit or name == "mass"
        }
    changed = CAUSES[cause][1](log, amount, way)
    return changed | ({"n2": changed["n1"]} if ship.drive == "rudder" else {}), fit


def find_amount(
    ship: FieldShip, cause: str, way: float, log: Table, factor: float, sound: float
) -> tuple[float, float]:
    """The least amount that multiplies the error by the factor, by bisection; and the factor that it has."""
    most = CAUSES[cause][0] if cause in CAUSES else 3.0
    error = lambda a: physics_error(ship, *reversed(apply_fault(ship, cause, a, way, log, ship.fit))) / sound  # noqa: E731
    if most == 0:
        return 0.0, error(0.0)
    low, high = 0.0, most
    if error(high) > factor:
        for _ in range(12):
            middle = (low + high) / 2
            low, high = (low, middle) if error(middle) > factor else (middle, high)
    return high, error(high)


@dataclass(frozen=True)
class FaultyLog:
    """A drawn log: the numbers of its document, its table without dimension with noise, and the truth."""

    ship: FieldShip
    fit: dict[str, float]
    table: Table
    causes: tuple[str, ...]
    amounts: tuple[float, ...]
    factors: tuple[float, ...]
    noise: str
    windy: bool


def draw_faulty_log(seed: int, number: int, ship: FieldShip, faults: int) -> FaultyLog:
    """Draw a log of a ship with so many faults (0, 1, 2)."""
    random = np.random.default_rng([seed, number, 2])
    windy = bool(random.random() < 0.4)
    wind = float(random.uniform(1, 4)) if windy else 0.0
    clean = simulate_runs(ship, random, 8, wind, float(random.choice([0.0, 0.5, 1.0])))
    possible = possible_causes(ship, windy)
    possible = [possible[(number // 40 + 7 * (number % 40)) % len(possible)], *random.permutation(possible)]
    table, fit, sound = clean, ship.fit, physics_error(ship, ship.fit, clean)
    chosen: dict[str, tuple[float, float]] = {}
    while len(chosen) < faults:
        cause, way = str(possible.pop(0)), float(random.uniform(-math.pi, math.pi))
        amount, factor = find_amount(ship, cause, way, clean, FACTORS[int(random.integers(3))], sound)
        if factor > 1.2 and cause.split(".")[0] not in [other.split(".")[0] for other in chosen]:
            table, fit = apply_fault(ship, cause, amount, way, table, fit)
            chosen[cause] = amount, factor
    noise = str(random.choice(list(NOISES)))
    table = dict(table)
    for key, sigma in {"north": 0.03, "east": 0.03, "psi": 0.009, "u": 0.03, "v": 0.03, "r": 0.04}.items():
        table[key] = table[key] + NOISES[noise] * sigma * random.normal(size=table[key].shape)
    amounts, factors = zip(*chosen.values(), strict=True) if chosen else ((), ())
    return FaultyLog(ship, fit, table, tuple(chosen), amounts, factors, noise, windy)


# ------------------------------------------------------------------------------------------------- what is diagnosed


def vessel_document(log: FaultyLog) -> str:
    """The vessel document in SI, as TOML."""
    ship, fit, rho = log.ship, log.fit, 1025.0
    L, U, m = ship.L, ship.U, 7.0 * ship.L**3
    mass = fit.get("mass", 1.0) * m
    text = (
        f'name = "Drawn"\ndof = 3\n[particulars]\nL_pp = {L!r}\nU_0 = {U!r}\n[constants]\nrho = {rho}\nrho_a = 1.225\n'
    )
    text += f'[inertia]\nm = {mass!r}\nI_z = {0.0625 * mass * L * L!r}\nx_G = 0.0\n[added_mass]\ncoriolis = "none"\n'
    text += f"X_udot = {-(SURGE - 1) * m!r}\nY_vdot = {-(SWAY - 1) * m!r}\nN_rdot = {-(YAW - 0.0625) * m * L * L!r}\n"
    text += "[hull.derivatives]\n"
    for name in HULL:
        letters = name[2:].replace("|", "")
        power = letters.count("r") - 1 + (name[0] == "N")
        power_of_u = 2 - len(letters)
        text += f'"{name}" = {fit[name] * m * L**power * U**power_of_u!r}\n'
    screws = {"propeller": 0.0} if ship.drive == "rudder" else {"port": -ship.lever * L, "starboard": ship.lever * L}
    share = m * U * U / L / len(screws)
    for name, y in screws.items():
        text += f'[thruster.{name}]\nkind = "quadratic"\nx = {-0.45 * L!r}\ny = {y!r}\nk_astern = {K_ASTERN}\n'
        text += f"T_nn = {fit['T_nn'] * share / ship.n_max**2!r}\nT_nu = {fit['T_nu'] * share / ship.n_max / U!r}\n"
        text += f"c_uu = 1.0\nc_nn = {ship.c['race'] * (U / ship.n_max) ** 2!r}\n"
    if ship.drive != "screws":
        text += f'[thruster.rudder]\nkind = "rudder_coefficients"\nbehind = "{next(iter(screws))}"\n'
        unit = m / (rho / 2 * L**3)
        for name, own in (("Y_|c|cdelta", "Y_d"), ("N_|c|cdelta", "N_d"), ("X_|c|cdeltadelta", "X_d")):
            text += f'"{name}" = {fit[own] * unit!r}\n'
    if log.windy:
        area, grid = ship.c["wind"] * m / L / (0.5 * 1.225), np.arange(0, 181, 10)
        table = {"C_X": -0.7 * np.cos(grid * np.pi / 180), "C_Y": 0.8 * np.sin(grid * np.pi / 180), "C_N": 0.0 * grid}
        text += f'[wind]\nkind = "table"\ngamma_deg = {grid.tolist()}\n'
        text += "".join(f"{name} = {values.round(6).tolist()}\n" for name, values in table.items())
        text += f"A_FW = {area / 0.7!r}\nA_LW = {2.5 * area / 0.8!r}\nL_oa = {L!r}\n"
    return text


def dataset_frame(log: FaultyLog) -> pd.DataFrame:
    """The table of the log in SI, with the columns of a dataset."""
    ship, table = log.ship, log.table
    tau = ship.L / ship.U
    runs, rows = table["t"].shape
    unit = {"t": tau, "north": ship.L, "east": ship.L, "psi": 1.0, "u": ship.U, "v": ship.U, "r": 1 / tau}
    columns: dict[str, Any] = {"run": np.repeat([f"run{i}" for i in range(runs)], rows)}
    columns |= {key: (table[key] * scale).ravel() for key, scale in unit.items()}
    names = {"n1": "propeller.n"} if ship.drive == "rudder" else {"n1": "port.n", "n2": "starboard.n"}
    columns |= {name: (table[key] * ship.n_max).ravel() for key, name in names.items()}
    columns |= {} if ship.drive == "screws" else {"rudder.delta": table["delta"].ravel()}
    if log.windy:
        columns["V_w"] = (np.hypot(table["wind_n"], table["wind_e"]) * ship.U).ravel()
        columns["beta_w"] = np.arctan2(table["wind_e"], table["wind_n"]).ravel()
    return pd.DataFrame(columns).assign(flags=0)


# ------------------------------------------------------------------------------------------------- the score

RUDDER, SHAFT = r"command rudder\S* ", r"command (?:propeller|port)\S* "
#: cause -> form of the keys of the diagnosis that name it, or one of its equals at the head of this file
ACCEPTED = {
    "rudder.zero": RUDDER + "zero",
    "rudder.sign": RUDDER + "sign",
    "rudder.scale": f"{RUDDER}scale|coefficient rudder",
    "rudder.delay": RUDDER + "delay",
    "rpm.scale": f"{SHAFT}scale|coefficient thrust",
    "rpm.zero": SHAFT + "zero",
    "rpm.delay": SHAFT + "delay",
    "rpm.unsigned": f"{SHAFT}(unsigned|scale astern)",
    "rpm.sign": SHAFT + "sign",
    "heading.bias": "sensor psi bias",
    "heading.delay": "sensor psi delay",
    "heading.course": "heading is course",
    "position.delay": "sensor position delay|lever arm position",
    "velocity.delay": "sensor velocity delay",
    "speed.scale": "sensor velocity scale",
    "sway.bias": "sensor v bias",
    "yaw.bias": "sensor r bias",
    "yaw.scale": "sensor r scale",
    "antenna": "lever arm position|sensor position delay",
    "antenna.velocities": "lever arm position and velocity",
    "sides.exchanged": "exchange .*",
    "current": "current",
    "current.by_run": "current by run",
    "wind.scale": "wind scale",
    "damping.factor": "coefficient (damping|thrust)|several coefficients",
    "thrust.factor": rf"coefficient (damping|thrust)|several coefficients|{SHAFT}scale",
    "rudder.factor": f"{RUDDER}scale|coefficient rudder|several coefficients",
    "mass.factor": r"coefficient mass|several coefficients|command \S* delay",
}


def names_cause(key: str, cause: str) -> bool:
    """Whether a key of the diagnosis names a cause or one of its equals."""
    return re.fullmatch(ACCEPTED[cause], key) is not None


def diagnose_log(log: FaultyLog, folder: Path) -> tuple[list[str], list[str]]:
    """Write the document and the dataset, diagnose them: the causes that are named, and all their equals."""
    from shipid import Dataset, load_vessel, read_dataset, write_dataset  # what is judged, and its formats
    from shipid.identification.diagnosis import diagnose

    document, table = folder / "drawn.toml", folder / "drawn.parquet"
    document.write_text(vessel_document(log))
    write_dataset(Dataset(dataset_frame(log), {}), table)
    causes, equals, result = [], [], diagnose(load_vessel(str(document)), read_dataset(table))
    while result is not None and result.cause not in ("none", "unexplained"):
        causes.append(result.cause)
        equals += list(result.equals)
        result = result.next
    return causes, equals


def judge_causes(log: FaultyLog, causes: list[str], equals: list[str]) -> str:
    """How a diagnosis ended; of two faults the greater must be named (`part`: only the other one is)."""
    if not log.causes or not causes:
        return "missed" if log.causes else "alarm" if causes else "quiet"
    main = max(zip(log.factors, log.causes, strict=True))[1]
    if causes[0] == "cannot tell":
        return "cannot tell"
    known = [key for key in causes if key == "cannot tell" or any(names_cause(key, cause) for cause in log.causes)]
    if not any(names_cause(key, main) for key in causes):
        told = any(names_cause(key, main) for key in equals)
        return "part" if known == causes else "cannot tell" if told else "wrong"
    return "right" if known == causes else "extra"


def print_scores(scores: list[tuple[FaultyLog, str, str]]) -> None:
    """Print shares by fault and factor, by noise and by size of the ship, and the confusions."""
    words = ("right", "part", "extra", "cannot tell", "missed", "wrong", "quiet", "alarm")
    size = lambda log: min(FACTORS, key=lambda f: abs(math.log(f / max(log.factors))))  # noqa: E731
    groups: dict[str, Counter[str]] = {}
    for log, word, _ in scores:
        keys = [
            "all, factor " + str(size(log)) if log.causes else "sound",
            f"noise {log.noise}, {len(log.causes)} faults",
        ]
        keys += [f"{log.ship.drive}, {log.ship.L:4.0f} m"] if log.causes else []
        keys += [f"{log.causes[0]}, factor {size(log)}"] if len(log.causes) == 1 else []
        for key in keys:
            groups.setdefault(key, Counter())[word] += 1
    print(f"{'':34}{'n':>6}" + "".join(f"{word:>13}" for word in words))
    for key, counts in sorted(groups.items()):
        total = counts.total()
        print(f"{key:34}{total:6}" + "".join(f"{100 * counts[word] / total:11.1f} %" for word in words))
    confusions = Counter(
        (" + ".join(log.causes) or "none", named) for log, word, named in scores if word in ("wrong", "alarm")
    )
    for (true, named), count in confusions.most_common():
        print(f"{count:4} x {true} -> {named}")


def score_log(
    options: argparse.Namespace, number: int, ship: FieldShip
) -> tuple[FaultyLog, str, list[str], list[str], float]:
    """Draw and diagnose one log: what it is, how it ended, the named causes, their equals, and CPU time [s]."""
    faults = 0 if number >= options.count else (0, 1, 1, 1, 2)[number // options.ships % 5]
    log = draw_faulty_log(options.seed, number, ship, faults)
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        causes, equals = diagnose_log(log, Path(folder))
    return log, judge_causes(log, causes, equals), causes, equals, time.process_time() - begun


def main() -> None:
    """Draw, diagnose and score."""
    parser = argparse.ArgumentParser(description="Score the diagnosis of drawn faults.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--count", type=int, default=1000, help="logs with none, one or two faults, a fifth of them sound"
    )
    parser.add_argument("--sound", type=int, default=0, help="further sound logs")
    parser.add_argument("--ships", type=int, default=40)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    options = parser.parse_args()
    ships = [draw_ship(number, options.seed) for number in range(options.ships)]
    scores, longest = [], 0.0
    with ProcessPoolExecutor(options.jobs) as pool:
        each = pool.map(partial(score_log, options), range(options.count + options.sound), cycle(ships))
        for number, (log, word, causes, equals, seconds) in enumerate(each):
            longest = max(longest, seconds)
            scores.append((log, word, " + ".join(causes)))
            if word in ("extra", "wrong", "alarm", "missed"):
                factors = ", ".join(f"{factor:.2g}" for factor in log.factors)
                print(number, word, log.causes, f"x {factors}, noise {log.noise} ->", causes, equals, flush=True)
    print_scores(scores)
    print(f"longest diagnosis {longest:.0f} s of CPU time")


if __name__ == "__main__":
    main()
