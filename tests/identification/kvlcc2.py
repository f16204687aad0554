"""KVLCC2 identified from zigzags of HSVA, checked on others; `python -m tests.identification.kvlcc2` prints the table.

The logs hold the rudder angle as it stood, so the vessel to identify has no steering gear. In the zigzags that she
sails by herself she has one: the helmsman of the tests is late, by the same time in all of them.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from shipid.data.dataset import Dataset
from shipid.engine.rollout import Trajectories, rollout
from shipid.identification.fit import Solution
from shipid.identification.settings import Identify
from shipid.identification.solve import identify
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping
from shipid.measures.recognise import record_of
from shipid.measures.record import Measures
from shipid.measures.turning import turning_measures
from shipid.measures.zigzag import zigzag_measures
from shipid.physics import helm
from shipid.physics.helm import Helmsman, Named
from shipid.units import DEGREE
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel

FITTED = ("05_01", "10_05", "15_01", "20_10_P", "25_05", "35_05")
OTHERS = ("10_01", "10_10_P", "10_10_S", "15_05", "20_05", "20_10_S", "30_05")
LENGTH, SHAFT = 7.0, 10.229  # m, rev/s
LATE = 0.356  # s from the execute heading to the rudder's middle, less what its rate takes; +-0.02 s in all runs
STEP = 0.05  # s, as the logs have it: 20 Hz
BETWEEN = 2.0  # s from one window to the next
CIRCLE = 200.0  # s

SETTINGS = Identify(
    parameters=["hull.mmg.*", "added_mass.Y_vdot", "added_mass.N_rdot"]
    + [f"thruster.rudder.{name}" for name in ("f_alpha", "gamma_R_*", "ell_R", "t_R", "a_H")],
    scale={"hull.mmg.Y_u": 1e-3, "hull.mmg.N_u": 5e-4},
    prior={"hull.mmg.*": 0.2, "hull.mmg.*_u": 1.0, "added_mass.*": 0.2, "thruster.rudder.*": 0.1},
    horizon=60.0,
    step=0.1,
    weights={"u": 0.02, "v": 0.01, "r": 0.1 * DEGREE},
    nuisance={"initial_state": 0.5},
    start="base",
    current="none",
)


@cache
def logs(folder: Path) -> Dataset:
    """All 13 runs."""
    return import_log(read_mapping("kvlcc2-hsva"), folder)


def columns(data: Dataset, run: str) -> dict[str, np.ndarray]:
    """Columns of a run."""
    return {str(name): values.to_numpy() for name, values in data.frame[data.frame["run"] == run].items()}


def to_identify() -> Vessel:
    """The vessel without its steering gear."""
    return load_vessel("kvlcc2-hsva").with_values({"thruster.rudder.actuator": {}})


def sailing(solution: Solution) -> Vessel:
    """The identified vessel, with the steering gear."""
    return load_vessel("kvlcc2-hsva").with_values(solution.values)


@lru_cache
def late_helmsman(commands: tuple[str, ...]) -> Helmsman:
    """The zigzag's, who reacts to the heading of `LATE` ago, and counts from the course that was ordered, 0."""
    prompt = helm.zigzag_helmsman(commands)
    ordered = {"original": 0.0, "executed": 1.0}

    def past(signals: Named) -> Named:
        return {**signals, "psi": signals["psi"] - LATE * signals["r"]}

    return Helmsman(
        "late zigzag",
        prompt.inputs,
        prompt.memory,
        orders=lambda signals, given, memory: prompt.orders(past(signals), given, memory | ordered),
        advance=lambda signals, given, memory, dt: prompt.advance(past(signals), given, memory | ordered, dt),  # type: ignore[misc]
    )


def measured(log: Mapping[str, np.ndarray], run: str) -> Measures:
    """Measures of a zigzag about the course that was ordered, 0; the run's name says its execute heading."""
    return zigzag_measures(record_of(log), execute_heading=float(run.split("_")[1]) * DEGREE, course=0.0)


def simulated(vessel: Vessel, log: Mapping[str, np.ndarray], run: str) -> Measures:
    """The same of the zigzag that the vessel sails from the state in which the test began, with the same helm."""
    trial, model, count = measured(log, run), vessel_dynamics(vessel), len(log["t"]) - 1
    record = record_of(log)
    side = float(np.sign(record.helm[int(np.argmax(np.abs(record.helm) > trial["helm"].value / 2))]))
    helm_over = np.where(log["t"][:-1] >= trial["execute"].value, side * trial["helm"].value, 0.0)
    inputs = {
        "propeller.n": log["propeller.n"][:-1, None],
        "rudder.delta": helm_over[:, None],
        "executed": np.ones(1),
        "execute_heading": np.full(1, side * trial["execute_heading"].value),
    }
    start = {name: log[name][:1] for name in model.state}
    path = rollout(
        vessel, start, inputs, step=STEP, num_steps=count, method="rk4", helmsman=late_helmsman(model.commands)
    )
    return measured(_columns(path, model.state), run)


def _columns(path: Trajectories, state: Sequence[str]) -> dict[str, np.ndarray]:
    logged = {name: path[name][:, 0, 0] for name in state}
    logged |= {"t": STEP * np.arange(len(logged["psi"])), "rudder.delta": path["actual.rudder.delta"][:, 0, 0]}
    return logged | {"propeller.n": np.full(len(logged["psi"]), SHAFT)}


def windows(vessel: Vessel, data: Dataset, runs: Sequence[str], horizon: float) -> tuple[float, float]:
    """RMS error of the position [m] after a horizon [s] with the rudder as measured, and of constant u, v, r."""
    model, count, error, naive = vessel_dynamics(vessel), round(horizon / STEP), [], []
    for run in runs:
        log = columns(data, run)
        begins = np.arange(0, len(log["t"]) - count, round(BETWEEN / STEP))
        start = {name: log[name][begins] for name in model.state}
        held = begins + np.arange(count)[:, None]
        path = rollout(
            vessel, start, {name: log[name][held] for name in model.commands}, step=STEP, num_steps=count, method="rk4"
        )
        last = np.array([path[name][-1, 0] for name in ("north", "east")])
        there = np.array([log[name][begins + count] for name in ("north", "east")])
        error.append(((last - there) ** 2).sum(axis=0))
        t = np.linspace(0, horizon, count + 1)[:, None]
        way = (start["u"] + 1j * start["v"]) * np.exp(1j * (start["psi"] + start["r"] * t))
        gone = np.trapezoid(way, t[:, 0], axis=0)
        naive.append(np.abs(start["north"] + 1j * start["east"] + gone - there[0] - 1j * there[1]) ** 2)
    return float(np.sqrt(np.concatenate(error).mean())), float(np.sqrt(np.concatenate(naive).mean()))


def whole(vessel: Vessel, log: Mapping[str, np.ndarray]) -> tuple[float, float]:
    """RMS over a whole run, from its first state on with the rudder as measured: position [m], heading [rad]."""
    model, count = vessel_dynamics(vessel), len(log["t"]) - 1
    start = {name: log[name][:1] for name in model.state}
    commands = {name: log[name][:-1, None] for name in model.commands}
    path = rollout(vessel, start, commands, step=STEP, num_steps=count, method="rk4")
    away = {name: path[name][:, 0, 0] - log[name] for name in ("north", "east", "psi")}
    return float(np.sqrt((away["north"] ** 2 + away["east"] ** 2).mean())), float(np.sqrt((away["psi"] ** 2).mean()))


def circle(vessel: Vessel, side: float, angle: float = 35 * DEGREE, speed: float = 1.179) -> Measures:
    """Turning circle, side +1 to starboard, from straight ahead."""
    model, count = vessel_dynamics(vessel), round(CIRCLE / STEP)
    start = {name: np.full(1, speed if name == "u" else 0.0) for name in model.state}
    over = np.where(np.arange(count) * STEP >= 1.0, side * angle, 0.0)[:, None]
    inputs = {"propeller.n": np.full(1, SHAFT), "rudder.delta": over}
    path = rollout(vessel, start, inputs, step=STEP, num_steps=count, method="rk4")
    return turning_measures(record_of(_columns(path, model.state)))


def fitted(data: Dataset, runs: Sequence[str] = FITTED) -> Solution:
    """The factors that predict these runs best."""
    return identify(to_identify(), data, runs, SETTINGS)


def main(folder: Path, fit: Sequence[str] = FITTED) -> None:
    """Print what was predicted, run by run."""
    data = logs(folder)
    solution = fitted(data, fit)
    vessel, bare = sailing(solution), solution.identified
    print(solution.sentence, f"{solution.seconds:.1f} s")
    for run in data.runs:
        log = columns(data, run)
        pairs = [(measured(log, run), simulated(vessel, log, run))]
        both = [[one[f"overshoot_{k}"].value / DEGREE for one in pairs[0]] for k in (1, 2)]
        position, heading = whole(bare, log)
        overshoots = " ".join(f"{a:6.2f} {b:6.2f} {b - a:+.2f}" for a, b in both)
        print(f"{run:8} {'fit ' if run in fit else 'held'} {overshoots} {position:6.1f} m {heading / DEGREE:5.1f} deg")
    others = [run for run in data.runs if run not in fit]
    for horizon in (15.0, 30.0):
        print(f"{horizon:g} s:", *(f"{value:.3f} m" for value in windows(bare, data, others, horizon)))
    for name, side in (("starboard", 1.0), ("port", -1.0)):
        turn = circle(vessel, side)
        ratio = {key: round(turn[key].value / LENGTH, 3) for key in ("advance", "tactical_diameter", "steady_diameter")}
        print(name, ratio)
    for path, factor in zip(solution.paths, solution.factors, strict=True):
        print(f"{path} {factor:.3f}")


if __name__ == "__main__":
    main(Path(os.environ["SHIPID_DATA"]) / "kvlcc2_hsva")
