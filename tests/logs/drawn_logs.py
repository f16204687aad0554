"""Logs as strangers write them: ship, manoeuvres, columns, names, units, frames, signs and faults drawn by a seed.

`draw(seed, folder)` writes one log, a file or a folder of files, and returns what it truly holds; `judge(drawn)` takes
a guess of it, imports it with that mapping and compares the result with the truth, quantity by quantity.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pymap3d

from shipid.errors import ShipidError
from shipid.logs.guess.clues import LIKELY
from shipid.logs.guess.columns import Guess, guess
from shipid.logs.guess.draft import draft_text
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping
from tests.logs.drawn_words import FILE_NAMES, SIDES, STYLES, UNIT_SUFFIX, UNIT_TEXT, WORDS

Array = np.ndarray[Any, np.dtype[np.float64]]
FACTORS = {  # SI units in one unit
    **{
        "s": 1.0,
        "ms": 1e-3,
        "m": 1.0,
        "m/s": 1.0,
        "kn": 1852 / 3600,
        "km/h": 1 / 3.6,
        "mph": 1609.344 / 3600,
        "rad": 1.0,
        "deg": np.pi / 180,
    },
    **{"cm/s": 1e-2, "mm/s": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0},
    **{"rad/s": 1.0, "deg/s": np.pi / 180, "deg/min": np.pi / 10800, "rpm": 1 / 60, "rev/s": 1.0},
}
CLOCKS = ("seconds", "ms", "us", "ns", "min", "h", "d", "datenum", "excel", "iso")


@dataclass
class Drawn:
    """A log and its truth.

    path : file, or folder of files. runs : expected signals of every run in the order of the files, SI, with `t`.
    present : quantities that the log holds. asks : quantities that no log like this can decide: it must be asked.
    impossible : whether a dataset cannot be made of it. slack : quantity -> error [SI] that its faults may cause.
    story : what was drawn, in words.
    """

    path: Path
    runs: list[dict[str, Array]]
    present: set[str]
    asks: set[str] = field(default_factory=set)
    impossible: bool = False
    slack: dict[str, float] = field(default_factory=dict)
    kinds: list[str] = field(default_factory=list)
    story: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Verdict:
    """`right`, `reported` (wrong, and the guess says that it is unsure or fails) or `silent`; with reasons."""

    word: str
    reasons: tuple[str, ...]


# --- ship and motion ---


@dataclass(frozen=True)
class Ship:
    """A first-order ship: length [m], speed [m/s], shaft [rev/s] at that speed, gains, current [m/s], steering."""

    length: float
    speed: float
    shaft: float
    gain: float
    lag: float
    pivot: float
    loss: float
    current: complex
    azimuth: bool
    pair: bool
    rate: float


def _ship(random: np.random.Generator) -> Ship:
    model = random.random() < 0.35
    length = random.uniform(2, 7) if model else np.exp(random.uniform(np.log(30), np.log(320)))
    speed = random.uniform(0.15, 0.28) * np.sqrt(9.81 * length)
    shaft = speed / (length * random.uniform(0.02, 0.04))
    drift = random.uniform(0, 0.12) * speed if random.random() < 0.6 else 0.0
    return Ship(
        length=length,
        speed=speed,
        shaft=shaft,
        gain=random.uniform(0.8, 2.0),
        lag=random.uniform(0.6, 2.5),
        pivot=random.uniform(0.25, 0.5),
        loss=random.uniform(0.5, 2.0),
        current=drift * np.exp(1j * random.uniform(0, 2 * np.pi)),
        azimuth=random.random() < 0.25,
        pair=random.random() < 0.3,
        rate=np.radians(random.uniform(2.5, 6)) * (np.sqrt(70 / length) if model else 1.0),
    )


def _motion(ship: Ship, kind: str, angle: float, random: np.random.Generator, duration: float) -> dict[str, Array]:
    """Return t, north, east, psi, u, v (over ground), r, delta (> 0 to starboard), n on a fine clock, SI."""
    unit = ship.length / ship.speed  # s
    step = unit / 40
    count = int(duration / step)
    psi, u, v, r, delta = random.uniform(0, 2 * np.pi), ship.speed, 0.0, 0.0, 0.0
    start, place, side, order, until = psi, 0j, 1.0, 0.0, 0.0
    level = random.uniform(0.75, 1.0)
    speed_step = random.random() < 0.4
    gust, rows = 0.0, np.empty((count, 9))
    for index in range(count):
        t = index * step
        lead = 5 * unit
        n = ship.shaft * (level if not speed_step or t < 0.6 * duration else 0.7 * level)
        if t < lead:
            order = 1.5 * (start - psi) - 2.0 * r * unit
        elif kind == "zigzag":
            if side * (psi - start) > angle:
                side = -side
            order = side * angle
        elif kind == "turning":
            order = angle if t < 0.75 * duration else 0.0
        elif t > until:
            until = t + random.uniform(1.5, 5) * unit
            order = random.uniform(-1, 1) * 1.3 * angle
        order = float(np.clip(order, -0.61, 0.61))
        delta += float(np.clip(order - delta, -ship.rate * step, ship.rate * step))
        gust += -gust * step / (2 * unit) + 0.01 * random.standard_normal() * np.sqrt(step / unit)
        water = place_velocity = (u + 1j * v) * np.exp(1j * psi)
        place_velocity = water + ship.current
        ground = place_velocity * np.exp(-1j * psi)
        rows[index] = t, place.real, place.imag, psi, ground.real, ground.imag, r, delta, n
        r_1 = r * unit
        change = (ship.gain * delta * (u / ship.speed) ** 2 - r_1 - 0.8 * abs(r_1) * r_1 + gust) / ship.lag
        u += step / unit / 3 * (ship.speed * n / ship.shaft - u - ship.loss * ship.speed * r_1**2)
        v += step / unit / 0.3 * (-ship.pivot * ship.length * r - v)
        place += step * place_velocity
        psi += step * r
        r += step / unit**2 * change
    names = ("t", "north", "east", "psi", "u", "v", "r", "delta", "n")
    return dict(zip(names, rows.T, strict=True))


def _kinds(random: np.random.Generator) -> tuple[str, float]:
    kind = str(random.choice(["zigzag", "zigzag", "turning", "random"]))
    return kind, float(np.radians(random.choice([10, 15, 20, 20, 25, 35])))


# --- columns ---


@dataclass
class Column:
    """One column of a log: what it is called by, a key of `WORDS`; its unit, values in that unit, and decimals."""

    word: str
    unit: str | None
    values: Array
    decimals: int | None = 4
    side: int | None = None


def draw(seed: int, folder: Path, clock: str | None = None, speed: str | None = None) -> Drawn:
    """Draw a log by a seed, write it into the folder, and return it with its truth.

    clock, speed : units of the clock (one of `CLOCKS`) and of velocities, instead of those drawn.
    """
    random = np.random.default_rng([2026, seed])
    ship = _ship(random)
    style = str(random.choice(STYLES, p=[0.17, 0.14, 0.17, 0.17, 0.13, 0.08, 0.06, 0.08]))
    layout = str(random.choice(["geo", "ned", "enu", "xy"], p=[0.42, 0.3, 0.18, 0.1]))
    several = random.random() < 0.25
    unit = ship.length / ship.speed
    steps = [s for s in (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0) if unit / 25 < s < unit / 3.5]
    step = float(random.choice(steps))
    span = 60 if several else float(random.uniform(70, 160))
    drawn_motions = [
        (kind, angle, _motion(ship, kind, angle, random, unit * span))
        for kind, angle in [_kinds(random) for _ in range(int(random.integers(3, 7)) if several else 1)]
    ]
    faults = _faults(ship, step, random)
    plan = _plan(layout, ship, random)
    plan["speed unit"] = speed or plan["speed unit"]
    story = {"style": style, "layout": layout, "length": round(ship.length, 1), "step": step, **faults, **plan}
    frames, runs = [], []
    for _, _, motion in drawn_motions:
        truth, columns = _columns(_sampled(motion, step, faults, random), ship, faults, plan, random)
        runs.append(truth)
        frames.append(columns)
    form = _form(style, several, random)
    form["time"] = clock or form["time"]
    story |= {key: value for key, value in form.items() if key != "names"}
    names = _names(frames[0], style, plan, form, random)
    drawn = Drawn(folder, runs, _present(plan), story=story, kinds=[kind for kind, _, _ in drawn_motions])
    drawn.impossible = plan["position"] is None or plan["heading"] is None
    drawn.asks = _undecidable(plan, style)
    size = ship.speed
    drawn.slack = {
        "position": 2.2 * abs(faults["antenna"])
        + 6 * faults["position"]
        + 3 * faults["late"] * size
        + 0.1 * step * size,
        "psi": np.radians(6) + abs(faults["compass"]) + 6 * faults["heading"],
        "velocity": 0.06 * size + 6 * faults["speed"] + abs(faults["compass"]) * size,
    }
    if not several:
        drawn.path = folder / f"log{form['suffix']}"
        _write(frames[0], names, drawn.path, form, runs[0], random)
        return drawn
    _write_folder(drawn, frames, names, form, [(kind, angle) for kind, angle, _ in drawn_motions], random)
    return drawn


def _faults(ship: Ship, step: float, random: np.random.Generator) -> dict[str, Any]:
    small = ship.length < 10
    antenna = ship.length * complex(random.uniform(-0.4, 0.4), random.uniform(-0.08, 0.08))
    return {
        "position": float(random.uniform(0.001, 0.02) if small else np.exp(random.uniform(np.log(0.01), np.log(1.5)))),
        "heading": float(np.radians(np.exp(random.uniform(np.log(0.01), np.log(0.5))))),
        "speed": float(ship.speed * random.uniform(0.001, 0.02)),
        "rate": float(random.uniform(0.002, 0.05) * ship.speed / ship.length),
        "antenna": antenna if random.random() < 0.3 else 0j,
        "late": float(random.uniform(0.3, 1.5)) if not small and random.random() < 0.15 else 0.0,
        "compass": float(np.radians(random.uniform(-3, 3))) if random.random() < 0.1 else 0.0,
        "lost": random.random() < 0.1,
        "clock noise": float(random.uniform(0, 0.02) * step) if random.random() < 0.2 else 0.0,
    }


def _plan(layout: str, ship: Ship, random: np.random.Generator) -> dict[str, Any]:
    """Which columns there are, in which unit, frame and sign."""

    def one_of(*values: Any, p: list[float] | None = None) -> Any:
        return values[random.choice(len(values), p=p)]

    imu = layout == "enu"
    velocity = {
        "geo": one_of("speed course", "body", "none", "speed", "earth", p=[0.55, 0.2, 0.12, 0.08, 0.05]),
        "ned": one_of("body", "earth", "none", p=[0.6, 0.2, 0.2]),
        "enu": one_of("body", "earth", "none", p=[0.5, 0.3, 0.2]),
        "xy": one_of("body", "earth", "none", p=[0.6, 0.2, 0.2]),
    }[layout]
    shaft = one_of("rpm", "rev/s", "%", p=[0.8, 0.14, 0.06])
    missing = one_of(None, "heading", "position", p=[0.95, 0.025, 0.025])
    return {
        "position": None if missing == "position" else layout,
        "heading": None
        if missing == "heading"
        else ("rad" if imu and random.random() < 0.8 else "rad" if random.random() < 0.12 else "deg"),
        "wrap": one_of("360", "180", "unwrapped", p=[0.75, 0.2, 0.05]) if not imu else one_of("180", "unwrapped"),
        "heading named": "yaw" if layout == "xy" or imu else "heading",
        "velocity": velocity,
        "speed unit": one_of("kn", "m/s", "km/h", p=[0.6, 0.35, 0.05])
        if "speed" in velocity
        else one_of("m/s", "kn", p=[0.85, 0.15]),
        "v sign": -1 if imu else one_of(1, -1, p=[0.9, 0.1]),
        "r": one_of("deg/s", "rad/s", "deg/min", None, p=[0.4, 0.25, 0.2, 0.15]),
        "r sign": -1 if imu else one_of(1, -1, p=[0.92, 0.08]),
        "steer": "azimuth" if ship.azimuth else "rudder",
        "steer unit": one_of("deg", "rad", p=[0.85, 0.15]),
        "steer sign": one_of(1, -1, p=[0.6, 0.4]),
        "shaft": shaft,
        "no shaft": random.random() < 0.06,
        "pair": ship.pair,
        "units written": one_of("names", "row", "none", p=[0.5, 0.12, 0.38]),
        "extra": [
            w
            for w in ("roll", "pitch", "wind", "water speed", "rudder order", "heading order", "other", "other")
            if random.random() < 0.25
        ],
    }


def _present(plan: dict[str, Any]) -> set[str]:
    present = {"position", "psi", "steer"}
    present |= {"velocity"} if plan["velocity"] not in ("none", "speed") else set()
    present |= {"r"} if plan["r"] else set()
    return present if plan["no shaft"] else present | {"n"}


def _undecidable(plan: dict[str, Any], style: str) -> set[str]:
    asks = {"n"} if plan["shaft"] == "%" or style == "numbers" else set()
    if plan["position"] == "xy" or (style == "numbers" and plan["position"] in ("enu", "ned")):
        asks.add("frame")
    return asks


def _sampled(
    motion: dict[str, Array], step: float, faults: dict[str, Any], random: np.random.Generator
) -> dict[str, Array]:
    t = np.arange(0.0, motion["t"][-1], step)
    t = t + random.normal(0, faults["clock noise"], len(t)) if faults["clock noise"] else t
    t = np.maximum.accumulate(np.clip(t, 0, motion["t"][-1]))
    late = dict.fromkeys(("u", "v"), faults["late"])
    signals = {name: np.interp(t - late.get(name, 0.0), motion["t"], values) for name, values in motion.items()}
    ground = np.interp(t - faults["late"], motion["t"], motion["psi"])
    signals["over ground"] = ground  # heading at the time of the velocities
    return signals | {"t": t}


def _columns(
    now: dict[str, Array], ship: Ship, faults: dict[str, Any], plan: dict[str, Any], random: np.random.Generator
) -> tuple[dict[str, Array], list[Column]]:
    """Return the truth that a right import gives of these rows, and the columns as written."""
    size = len(now["t"])

    def noise(scale: float) -> Array:
        return np.asarray(random.normal(0, scale, size))

    psi = now["psi"] + noise(faults["heading"]) + faults["compass"]
    place = now["north"] + 1j * now["east"] + faults["antenna"] * np.exp(1j * now["psi"])
    place = place + noise(faults["position"]) + 1j * noise(faults["position"])
    body = now["u"] + 1j * now["v"] + noise(faults["speed"]) + 1j * noise(faults["speed"])
    if plan["velocity"] in ("speed course", "earth", "speed"):  # of the antenna, turned by nothing
        body = body + faults["antenna"] * 1j * now["r"]
        ground = body * np.exp(1j * now["over ground"])
    else:
        ground = body * np.exp(1j * psi)
    r = now["r"] + noise(faults["rate"])
    truth = {
        "t": now["t"].copy(),
        **{"north": place.real, "east": place.imag, "psi": psi, "r": r, "steer": now["delta"], "n": now["n"]},
        **{"u": (ground * np.exp(-1j * psi)).real, "v": (ground * np.exp(-1j * psi)).imag},
    }
    columns = [*_position(place, plan), *_heading(psi, plan), *_velocity(ground, psi, plan), *_rate(r, plan)]
    columns += _commands(truth, plan, random)
    columns += [column for word in plan["extra"] for column in _extra(word, truth, now, ship, random)]
    order = random.permutation(len(columns)) if random.random() < 0.5 else np.arange(len(columns))
    if "order" not in plan:
        plan["order"] = order
    return truth, [columns[i] for i in plan["order"]]


def _position(place: Any, plan: dict[str, Any]) -> list[Column]:
    if plan["position"] is None:
        return []
    if plan["position"] == "geo":
        lat, lon, _ = pymap3d.ned2geodetic(place.real, place.imag, 0, *plan.setdefault("origin", (54.3, 10.2)), 0)
        return [Column("latitude", "deg", lat, 8), Column("longitude", "deg", lon, 8)]
    pair = {"ned": ("north", "east"), "enu": ("east", "north"), "xy": ("x", "y")}[plan["position"]]
    values = (place.imag, place.real) if plan["position"] == "enu" else (place.real, place.imag)
    if plan["position"] == "xy" and plan["v sign"] == -1:  # a mirrored frame: x east, y north, angles to port
        values = (place.imag, place.real)
    return [Column(word, "m", part, 3) for word, part in zip(pair, values, strict=True)]


def _mirrored(plan: dict[str, Any]) -> bool:
    return plan["position"] == "enu" or (plan["position"] == "xy" and plan["v sign"] == -1)


def _heading(psi: Array, plan: dict[str, Any]) -> list[Column]:
    if plan["heading"] is None:
        return []
    angle = np.pi / 2 - psi if _mirrored(plan) else psi
    if plan["wrap"] == "360":
        angle = angle % (2 * np.pi)
    elif plan["wrap"] == "180":
        angle = (angle + np.pi) % (2 * np.pi) - np.pi
    decimals = 5 if plan["heading"] == "rad" else 2
    return [Column(plan["heading named"], plan["heading"], angle / FACTORS[plan["heading"]], decimals)]


def _velocity(ground: Any, psi: Array, plan: dict[str, Any]) -> list[Column]:
    unit, kind = plan["speed unit"], plan["velocity"]
    factor, decimals = FACTORS[unit], {"m/s": 3, "cm/s": 1, "mm/s": 0}.get(unit, 2)
    if kind in ("speed course", "speed"):
        course = np.degrees(np.angle(ground)) % 360
        both = [Column("speed", unit, np.abs(ground) / factor, decimals), Column("course", "deg", course, 1)]
        return both if kind == "speed course" else both[:1]
    if kind == "earth":
        pair = (ground.real, ground.imag)
        words = ("velocity_north", "velocity_east")
        if _mirrored(plan):
            pair, words = pair[::-1], words[::-1]
        if plan["position"] == "xy":
            words = ("u", "v")  # of the axes x and y, and called so
        return [Column(word, unit, part / factor, decimals) for word, part in zip(words, pair, strict=True)]
    if kind == "body":
        body = ground * np.exp(-1j * psi)
        sign = -1 if _mirrored(plan) else plan["v sign"]
        return [Column("u", unit, body.real / factor, decimals), Column("v", unit, sign * body.imag / factor, decimals)]
    return []


def _rate(r: Array, plan: dict[str, Any]) -> list[Column]:
    if plan["r"] is None:
        return []
    sign = -1 if _mirrored(plan) else plan["r sign"]
    return [Column("r", plan["r"], sign * r / FACTORS[plan["r"]], {"deg/min": 2, "rad/s": 6}.get(plan["r"], 4))]


def _commands(truth: dict[str, Array], plan: dict[str, Any], random: np.random.Generator) -> list[Column]:
    angle = plan["steer sign"] * truth["steer"] / FACTORS[plan["steer unit"]]
    angle = angle + random.normal(0, 0.02 * FACTORS["deg"] / FACTORS[plan["steer unit"]], len(angle))
    factor = 0.9 * truth["n"].max() / 100 if plan["shaft"] == "%" else FACTORS[plan["shaft"]]
    shaft = truth["n"] / factor * (1 + random.normal(0, 0.002, len(angle)))
    sides: tuple[int | None, ...] = (0, 1) if plan["pair"] else (None,)
    digits = 4 if plan["steer unit"] == "rad" else 2
    result = [Column(plan["steer"], plan["steer unit"], angle, digits, side) for side in sides]
    if not plan["no shaft"]:
        result += [Column("shaft", plan["shaft"], shaft, 3 if plan["shaft"] == "rev/s" else 1, side) for side in sides]
    return result


def _extra(
    word: str, truth: dict[str, Array], now: dict[str, Array], ship: Ship, random: np.random.Generator
) -> list[Column]:
    size = len(truth["t"])
    wave = np.asarray(np.sin(2 * np.pi * truth["t"] / (1.5 * np.sqrt(ship.length)) + random.uniform(0, 6)))
    if word == "wind":
        speed = random.uniform(2, 12) + random.normal(0, 0.5, size)
        return [
            Column("wind speed", "m/s", speed, 1),
            Column("wind angle", "deg", (random.uniform(0, 360) + random.normal(0, 4, size)) % 360, 0),
        ]
    if word == "water speed":
        stream = (now["u"] + 1j * now["v"]) - ship.current * np.exp(-1j * now["psi"])
        return [Column(word, "kn", stream.real / FACTORS["kn"], 1)]
    if word == "rudder order":
        steps = np.round(np.degrees(truth["steer"]) / 5) * 5
        return [Column(word, "deg", steps, 0)]
    if word == "heading order":
        return [Column(word, "deg", np.full(size, float(np.round(np.degrees(now["psi"][0]) % 360))), 0)]
    if word in ("roll", "pitch"):
        return [Column(word, "deg", random.uniform(0.3, 3) * wave + 20 * truth["r"], 2)]
    return [Column("other", None, random.uniform(1, 500) * (1 + 0.1 * wave) + random.normal(0, 0.5, size), 2)]


# --- names and files ---


def _names(
    columns: list[Column], style: str, plan: dict[str, Any], form: dict[str, Any], random: np.random.Generator
) -> list[str]:
    """Return a name for every column, none twice; units in the names or collected for a row."""
    of_time = form["time"] if form["time"] in FACTORS else ""
    units = ["s" if form["time"] in ("seconds", "epoch") else of_time]
    time = str(random.choice(WORDS["time"][style])) if style != "numbers" else "1"
    if of_time:
        time = f"time_{of_time}" if style == "snake" else f"Time [{of_time}]"
    elif form["time"] not in ("seconds",):
        time = time.partition(" [")[0].partition(" (")[0].replace("_s", "").replace("Sec", "")
    names, chosen = [time], {}
    pattern = SIDES[style][random.integers(len(SIDES[style]))] if style != "numbers" else ("{}", "{}")
    for column in columns:
        if style == "numbers":
            names.append(str(len(names) + 1))
            units.append("")
            continue
        words = WORDS[column.word][style]
        if column.unit == "%":  # nobody calls a share of the power rpm
            words = tuple(word for word in words if "rpm" not in word.lower()) or ("shaft",)
        base = (
            chosen.setdefault(column.word, str(random.choice(words)))
            if column.word != "other"
            else str(random.choice(WORDS["other"][style]))
        )
        if column.side is not None:
            base = pattern[column.side].format(base)
        unit = "" if column.unit is None or column.word in ("latitude", "longitude") else column.unit
        units.append(str(random.choice(UNIT_TEXT[unit])) if unit else "")
        if (
            plan["units written"] == "names"
            and unit
            and not any(mark in base for mark in "[(")
            and "rpm" not in base.lower()
        ):
            base = _with_unit(base, unit, style, random)
        while base in names:
            base += "_2" if style != "spaced" else " 2"
        names.append(base)
    form["units"] = units if plan["units written"] == "row" and style not in ("numbers",) else None
    return names


def _with_unit(base: str, unit: str, style: str, random: np.random.Generator) -> str:
    if style in ("snake", "symbols") or (style == "camel" and random.random() < 0.5):
        return base if base.endswith(UNIT_SUFFIX[unit]) else f"{base}_{random.choice(UNIT_SUFFIX[unit])}"
    text = random.choice(UNIT_TEXT[unit])
    left, right = [("[", "]"), ("(", ")")][random.integers(2)]
    return f"{base}{' ' if random.random() < 0.7 else ''}{left}{text}{right}"


def _form(style: str, several: bool, random: np.random.Generator) -> dict[str, Any]:
    separator = str(random.choice([",", ";", "\t", " "], p=[0.55, 0.22, 0.17, 0.06]))
    if separator == " " and style in ("spaced", "marine", "german", "norwegian"):
        separator = "\t"
    decimal = "," if separator in (";", "\t") and random.random() < 0.4 else "."
    special = style in ("german", "norwegian", "symbols") or random.random() < 0.2
    encodings = ["utf-8", "utf-8-sig", "cp1252", "latin-1", "utf-16"] if style != "symbols" else ["utf-8", "utf-16"]
    time = str(
        random.choice(
            ["seconds", "rounded", "epoch", "iso", "ms", "clock", "dotted"], p=[0.5, 0.12, 0.1, 0.12, 0.06, 0.06, 0.04]
        )
    )
    return {
        "separator": separator,
        "decimal": decimal,
        "encoding": str(random.choice(encodings)) if special else "utf-8",
        "time": time,
        "suffix": str(random.choice([".csv", ".txt", ".dat", ".log"], p=[0.6, 0.2, 0.1, 0.1])),
        "preamble": int(random.integers(1, 6)) if random.random() < 0.15 and style != "numbers" else 0,
        "empty column": bool(random.random() < 0.15 and separator != " "),
        "empty rows": int(random.choice([0, 1, 3], p=[0.8, 0.1, 0.1])),
        "blank rows": bool(random.random() < 0.07 and separator != " "),
        "quoted": bool(random.random() < 0.1 and separator != " "),
        "words": bool(random.random() < 0.1),
        "several": several,
        "digits": int(random.choice([3, 4, 5])),
    }


def _clock(t: Array, form: dict[str, Any]) -> list[str]:
    start = pd.Timestamp("2023-06-15 09:12:31")
    step = float(np.median(np.diff(t)))
    digits = 3 if step < 0.2 else 2
    match form["time"]:
        case "rounded":  # so many digits in all: 99.9 s, 100 s, 100 s
            return [f"{value:.{form['digits']}g}" for value in t]
        case "epoch":
            return [f"{start.timestamp() + value:.3f}" for value in t]
        case "iso":
            return [str((start + pd.Timedelta(value, "s")).isoformat(timespec="milliseconds")) for value in t]
        case "ms" | "us" | "ns" as unit:
            return [f"{value / FACTORS[unit]:.0f}" for value in t]
        case "min" | "h" | "d" as unit:
            return [f"{value / FACTORS[unit]:.9f}" for value in t]
        case "datenum" | "excel":  # days since the year 0, and since 30 December 1899
            midnight = start.normalize()
            day = (
                midnight.toordinal() + 366
                if form["time"] == "datenum"
                else (midnight - pd.Timestamp(1899, 12, 30)).days
            )
            return [f"{day + ((start - midnight).total_seconds() + value) / 86400:.9f}" for value in t]
        case "clock":
            return [(start + pd.Timedelta(value, "s")).strftime("%H:%M:%S.%f")[:-3] for value in t]
        case "dotted":
            return [(start + pd.Timedelta(value, "s")).strftime("%d.%m.%Y %H:%M:%S.%f")[:-3] for value in t]
    return [f"{value:.{digits}f}" for value in t]


def _since(form: dict[str, Any]) -> float:
    """Seconds to add to t so that it is the clock of a right import."""
    start = pd.Timestamp("2023-06-15 09:12:31", tz="UTC")
    if form["time"] in ("epoch", "iso", "dotted", "datenum", "excel"):
        return float(start.timestamp())
    return 9 * 3600 + 12 * 60 + 31 if form["time"] == "clock" else 0.0


def _write(
    columns: list[Column],
    names: list[str],
    file: Path,
    form: dict[str, Any],
    truth: dict[str, Array],
    random: np.random.Generator,
) -> None:
    t = truth["t"]
    truth["t"] = t + _since(form)
    cells = [_clock(t, form)]
    for column in columns:
        text = [f"{value:.{column.decimals}f}" for value in column.values]
        if column.word in ("speed", "u") and form.get("lost"):
            for row in random.choice(len(text), max(1, len(text) // 200), replace=False):
                text[int(row)] = ""
        cells.append(text)
    head, rows = list(names), [list(row) for row in zip(*cells, strict=True)]
    if form["decimal"] == ",":
        dates = form["time"] in ("iso", "dotted", "clock")
        rows = [[cell if dates and not i else cell.replace(".", ",") for i, cell in enumerate(row)] for row in rows]
    units = form["units"]
    if form["words"]:
        head, rows = [*head, "mode"], [[*row, "AUTO"] for row in rows]
        units = [*units, "-"] if units else None
    if form["empty column"]:
        head, rows = [*head, ""], [[*row, ""] for row in rows]
        units = [*units, ""] if units else None
    if form["quoted"]:
        head = [f'"{name}"' for name in head]
    separator = form["separator"]
    lines = [f"# line {i} of the logger, version 2.{i}" for i in range(form["preamble"])]
    if not names[0].isdecimal():
        lines.append(separator.join(head))
        lines += [separator.join(units)] if units else []
    lines += [separator.join(row) for row in rows]
    lines += [separator * (len(head) - 1)] * form["empty rows"] if separator != " " else [""] * form["empty rows"]
    lines += ["\t \t "] * form["blank rows"]
    encoding = form["encoding"]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(("\n".join(lines) + "\n").encode(encoding, "replace"))


def _write_folder(
    drawn: Drawn,
    frames: list[list[Column]],
    names: list[str],
    form: dict[str, Any],
    kinds: list[tuple[str, float]],
    random: np.random.Generator,
) -> None:
    days = random.random() < 0.4
    entries = []
    for index, (kind, angle) in enumerate(kinds):
        name = str(random.choice(FILE_NAMES[kind])) if index == 0 or random.random() < 0.5 else FILE_NAMES[kind][0]
        stem = name.format(a=round(np.degrees(angle)), i=index + 1)
        folder = drawn.path / f"day{1 + index % 2}" if days else drawn.path
        entries.append((folder / f"{stem}{form['suffix']}", index))
    for file, index in entries:
        _write(frames[index], names, file, form, drawn.runs[index], random)
    order = [index for _, index in sorted(entries)]
    drawn.runs = [drawn.runs[index] for index in order]
    drawn.kinds = [drawn.kinds[index] for index in order]


# --- judgement ---


def judge(drawn: Drawn) -> Verdict:
    """Guess, import as drafted, compare: every quantity right, or wrong and reported, or wrong and silent."""
    try:
        guessed = guess(drawn.path)
    except ShipidError as error:
        return Verdict("right" if drawn.impossible else "reported", (f"refused: {error.message}",))
    return judge_guess(drawn, guessed)


def judge_guess(drawn: Drawn, guessed: Guess) -> Verdict:
    """Import as drafted, and compare."""
    file = drawn.path.parent / f"{drawn.path.stem}-draft.toml"
    file.write_text(draft_text(guessed), encoding="utf-8")
    try:
        whole = read_mapping(file).model_copy(update={"segment": ()})
        frame = import_log(whole, drawn.path).frame
    except ShipidError as error:
        return Verdict(
            "right" if drawn.impossible else "reported", (f"not imported: {error.path or ''}: {error.message}",)
        )
    if drawn.impossible:
        reported = _unsure(guessed, "psi", "north", "east", "latitude")
        return Verdict("reported" if reported else "silent", ("imported what has no position or no heading",))
    wrong = _compare(drawn, frame, guessed)
    if any(reported and reason.startswith("psi") for reported, reason in wrong):  # the rest follows from the heading
        wrong = [(True, reason) for _, reason in wrong]
    if not wrong:
        return Verdict("right", ())
    word = "reported" if all(reported for reported, _ in wrong) else "silent"
    return Verdict(word, tuple(("reported: " if reported else "SILENT: ") + reason for reported, reason in wrong))


def _unsure(guessed: Guess, *names: str) -> bool:
    """Whether the guess says that it is not sure of columns of these names."""
    asked = {name for question in guessed.questions for name in question.about}
    columns = [c for c in guessed.columns if c.name in names or c.name.rpartition(".")[2] in names]
    return bool(asked & set(names)) or any(column.confidence < LIKELY for column in columns)


def _compare(drawn: Drawn, frame: pd.DataFrame, guessed: Guess) -> list[tuple[bool, str]]:
    groups = [rows for _, rows in frame.groupby("run", sort=False)]
    if len(groups) != len(drawn.runs):
        return [(bool(guessed.source.skipped), f"{len(groups)} runs for {len(drawn.runs)} files")]
    if "frame" in drawn.asks:
        asked = _unsure(guessed, "psi", "north")
        return [] if asked else [(False, "a frame that nothing decides was not asked")]
    wrong = []
    steering = [str(c) for c in frame if str(c).endswith((".delta", ".alpha"))]
    shafts = [str(c) for c in frame if str(c).endswith(".n")]
    checks = [
        ("position", ("north", "latitude")),
        ("psi", ("psi",)),
        ("u", ("u", "speed")),
        ("v", ("v", "course")),
        ("r", ("r",)),
    ]
    for name, columns in checks:
        reasons = [
            reason
            for rows, truth in zip(groups, drawn.runs, strict=True)
            if (reason := _motion_error(name, rows, truth, drawn))
        ]
        if reasons:
            wrong.append((_unsure(guessed, *columns), reasons[0]))
    if not steering:
        wrong.append((True, "no column steers: listed as not used"))
    for column in steering:
        turns = -1 if column.endswith("alpha") else 1
        for rows, truth in zip(groups, drawn.runs, strict=True):
            error = _relative(turns * rows[column], rows["t"], truth, "steer")
            if error > 0.4:
                wrong.append((_unsure(guessed, column.rpartition(".")[2]), f"{column} off by {error:.2f} of its size"))
                break
    if "n" in drawn.asks:
        if shafts and not _unsure(guessed, "n"):
            wrong.append((False, "a shaft that nothing decides was not asked"))
    elif "n" in drawn.present:
        if not shafts:
            wrong.append((True, "no shaft: listed as not used"))
        for column in shafts:
            worst = max(
                _relative(rows[column], rows["t"], truth, "n") for rows, truth in zip(groups, drawn.runs, strict=True)
            )
            if worst > 0.25:
                wrong.append((_unsure(guessed, "n"), f"{column} off by {worst:.2f} of its size"))
    elif shafts:
        wrong.append((_unsure(guessed, "n"), f"{shafts[0]} is no shaft"))
    return wrong


def _at(rows: Any, truth: dict[str, Array], name: str) -> Array:
    values = truth[name]
    order = np.argsort(truth["t"], kind="stable")
    return np.asarray(np.interp(rows, truth["t"][order], values[order]))


def _relative(values: Any, t: Any, truth: dict[str, Array], name: str) -> float:
    wanted = _at(t, truth, name)
    return float(np.sqrt(np.mean((values - wanted) ** 2) / np.mean(wanted**2)))


def _motion_error(name: str, rows: pd.DataFrame, truth: dict[str, Array], drawn: Drawn) -> str:
    """Return what is wrong with one quantity in a run; an empty text if it is right."""
    t = rows["t"].to_numpy()
    if name == "position":
        apart = (rows["north"] - _at(t, truth, "north")) + 1j * (rows["east"] - _at(t, truth, "east"))
        apart = apart.to_numpy() - np.mean(apart.to_numpy())
        error, limit = float(np.sqrt(np.mean(np.abs(apart) ** 2))), drawn.slack["position"]
        limit += 0.02 * float(np.hypot(np.ptp(truth["north"]), np.ptp(truth["east"])))
        return f"position off by {error:.3g} m (limit {limit:.3g})" if error > limit else ""
    wanted = _at(t, truth, name)
    error_now = rows[name].to_numpy() - wanted
    if name == "psi":
        error = float(np.sqrt(np.mean(np.angle(np.exp(1j * error_now)) ** 2)))
        return f"psi off by {np.degrees(error):.3g} deg" if error > drawn.slack["psi"] else ""
    error, size = float(np.sqrt(np.mean(error_now**2))), float(np.sqrt(np.mean(wanted**2)))
    measured = ("velocity" if name in "uv" else name) in drawn.present
    limit = (0.35 if measured else 0.6) * size
    if name in "uv":
        limit = limit + drawn.slack["velocity"] * (1 if measured else 2)
        limit = min(limit, 0.35 * size + drawn.slack["velocity"]) if name == "u" else limit
    return f"{name} off by {error:.3g}, of {size:.3g} (limit {limit:.3g})" if error > limit else ""
