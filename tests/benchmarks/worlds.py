"""Simulated worlds with runs that no model sees: a ship, manoeuvres, weather, noise, and a wrong model of the ship.

Ships are bundled ones, and made-up ones drawn by seed. The paper's ship is also simulated in irregular waves, which
its model lacks.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from shipid.data.dataset import Dataset
from shipid.data.windows import Windows, cut_windows
from shipid.hybrid.physics import Physics
from shipid.simulation.approach import Controls
from shipid.simulation.log import state_column
from shipid.simulation.standard import shaft_speed
from shipid.simulation.truth import Truth, draw_manoeuvres, simulate_truth
from shipid.study.new import _round_number_below
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, check_document, load_vessel
from tests.strangers import strange_vessel

SHIPS = ("gunnerus-28.9", "kvlcc2-l7", "esso-190k", "container-175", "cybership2", "naval-51", "stranger", "waves")
"""`waves` is the paper's ship in six degrees of freedom, predicted by its model in calm water."""
SHARES = (0.25, 0.07, 0.07, 0.07, 0.07, 0.07, 0.3, 0.1)
KINDS = ("steps", "turning", "zigzag")
COEFFICIENT = re.compile(r"hull\..*\.(\")?[XYNK]_")
LENGTHS = 7.0  # steps of prediction in which a ship at its service speed passes a length


@dataclass(frozen=True)
class World:
    """Windows of runs that may train, and of runs that no model sees; kind of manoeuvre by run; a wrong vessel."""

    ship: str
    pool: Windows
    fresh: Windows
    kinds: dict[str, str]
    physics: Physics
    mixed: str


@dataclass(frozen=True)
class Ship:
    """True vessel, vessel that the model is degraded from, service speed [m/s] and its shaft speed [rpm]."""

    truth: Vessel
    model: Vessel
    speed: float
    rpm: float

    @property
    def pace(self) -> float:
        """Time [s] in which the ship passes its length at service speed."""
        return float(self.truth.document["particulars"]["L_pp"]) / self.speed


def world(seed: int, fresh: int = 200, pool: int = 50, ship: str = "") -> World:
    """Draw a world: a ship, one to three kinds of manoeuvre, weather, a horizon, and a model with drawn factors."""
    draw = np.random.default_rng([seed, 16])
    ship = ship or str(draw.choice(SHIPS, p=SHARES))
    one = _ship(ship, seed)
    names = sorted(map(str, draw.choice(KINDS, size=draw.integers(1, 4), replace=False)))
    horizon, interval = int(draw.integers(8, 21)), float(draw.integers(2, 6))
    step = _round_number_below(one.pace / LENGTHS)
    ranges = _ranges(one)
    environment = vessel_dynamics(one.truth).environment
    changes: dict[str, Any] = {}
    if "V_w" in environment:
        changes["wind_speed"] = (0.0, float(draw.choice([0.0, 6.0, 12.0])))
    if "V_c" in environment:
        changes["current_speed"] = (0.0, 0.04 * one.speed)
    if ship == "waves":
        changes["waves"] = {"H_s": float(draw.uniform(0.3, 1.2)), "T_p": float(draw.uniform(4.5, 6.5))}
    if ship == "esso-190k":  # course-unstable: no helmsman holds her straight at every shaft speed
        names = sorted({*names, "steps"} - {"zigzag"})
    truth = Truth(
        vessel=ship,
        manoeuvres=pool + fresh,
        duration=step * (horizon + float(draw.integers(20, 41))),
        step=step / (20 if ship == "waves" else 5),
        interval=step,
        seed=seed,
        manoeuvre=[{"kind": name, "share": float(draw.uniform(0.5, 2.0)), **ranges[name]} for name in names],
        **{"wind_speed": (0.0, 0.0), **changes},
    )
    frame = simulate_truth(truth, one.truth)
    model = vessel_dynamics(one.model)
    seen = {state_column(name) for name in model.state} | {*model.commands, *model.environment, "run", "t", "flags"}
    frame = frame.drop(columns=[name for name in frame if name not in seen])
    noise = float(draw.choice([0.0, 0.005, 0.0125])) * one.speed
    length = one.pace * one.speed
    for name, size in (("u", noise), ("v", noise), ("r", 3.0 * noise / length)):
        frame[name] += size * draw.standard_normal(len(frame))
    data = Dataset(frame, {"clock": "run", "flags": []})
    windows = cut_windows(data, horizon=horizon, step=step, interval=interval * step)
    runs = list(dict.fromkeys(map(str, frame["run"])))
    kinds = {run: type(made).__name__ for run, made in zip(runs, draw_manoeuvres(truth), strict=True)}
    train = np.isin(windows.run, runs[:pool])
    physics = Physics(_wrong(one.model, draw), horizon, step)
    return World(ship, windows.select(train), windows.select(~train), kinds, physics, "+".join(names))


def _ship(name: str, seed: int) -> Ship:
    if name == "stranger":
        truth, speed, n = strange_vessel(seed)
        document = {key: value for key, value in truth.document.items() if key not in ("current", "name")}
        return Ship(truth, check_document({**document, "name": "its model"}, "model.toml"), speed, 60 * n)
    model = load_vessel("gunnerus-28.9" if name == "waves" else name)
    truth = load_vessel("gunnerus-28.9-6dof") if name == "waves" else model
    if model.name.startswith("R/V Gunnerus"):
        return Ship(truth, model, 4.13, 145.0)
    speed = float(model.document["particulars"]["U_0"])
    return Ship(truth, model, speed, 60 * shaft_speed(Controls(model), speed))


def _ranges(ship: Ship) -> dict[str, dict[str, Any]]:
    """Ranges of every kind of manoeuvre, by the ship's size and speed."""
    commands = vessel_dynamics(ship.truth).commands
    shafts = [0.5 * ship.rpm, 1.1 * ship.rpm]
    orders: dict[str, Any] = {"n_rpm": shafts}
    if any(name.endswith(".alpha") for name in commands):
        orders["alpha_deg"] = [-45.0, 45.0]
    if any(name.endswith(".delta") for name in commands):
        orders["delta_deg"] = [-30.0, 30.0]
    orders |= {f"{name}_rpm": [-0.3 * ship.rpm, 0.3 * ship.rpm] for name in commands if name == "bow.n"}
    start = {"start_speed": [0.3 * ship.speed, ship.speed]}
    execute = [0.2 * ship.pace, 1.2 * ship.pace]
    return {
        "turning": orders | start,
        "steps": orders | start | {"hold": [1.2 * ship.pace, 4 * ship.pace]},
        "zigzag": {
            "approach": "helmsman",
            "n_rpm": shafts,
            "angle_deg": [8.0, 30.0],
            "side": ["starboard", "port"],
            "execute_at": execute,
        },
    }


def _wrong(vessel: Vessel, draw: np.random.Generator) -> Vessel:
    """The vessel with drawn factors on its numbers: nearly right to badly wrong."""
    width = float(draw.choice([0.1, 0.4, 0.7]))
    paths = [path for path in vessel.parameters if COEFFICIENT.match(path)]
    paths += ["added_mass.X_udot", "added_mass.Y_vdot", "added_mass.N_rdot"] * bool(draw.integers(2))
    return vessel.with_values({p: vessel.parameters[p] * draw.uniform(1 - width, 1 + width) for p in sorted(paths)})
