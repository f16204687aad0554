"""Ships by seed, from 1 to 300 m and 0.1 to 12 m/s, with a noisy log in a current and a wrong guess of each.

A bundled vessel is scaled by Froude; its coefficients are drawn anew. The guess is wrong in the numbers to identify.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset
from shipid.engine.rollout import rollout
from shipid.identification.fit import Solution
from shipid.identification.free_run import ALL, simulate_free_runs, with_current
from shipid.identification.settings import Identify
from shipid.identification.solve import identify
from shipid.simulation.approach import Controls
from shipid.simulation.log import log_columns
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.stability import service_shaft

BASES = (
    "cybership2", "esso-190k", "gunnerus-28.9", "gunnerus-33.9", "gunnerus-33.9-template", "kvlcc2-hsva", "kvlcc2-l7",
    "mariner", "otter", "supply-vessel",
)  # fmt: skip
RUNS, TESTS, ROWS, HELD = 5, 4, 120, 15  # runs to fit and held out, rows of each, rows between orders
INTERVAL, AHEAD = 0.15, 4.0  # L / U between rows, and of a prediction
FREE = re.compile(r"hull\.\w+\.(R_\w+|C_d|[XYN]_[uvr|]+)")


@dataclass(frozen=True)
class DrawnLog:
    """A ship and its log: the true vessel, a wrong guess, settings, speed [m/s] and time of a prediction [s]."""

    truth: Vessel
    guess: Vessel
    log: Dataset
    settings: Identify
    speed: float
    ahead: float

    @property
    def held_out(self) -> list[str]:
        """Runs that no fit sees."""
        return [run for run in self.log.runs if run.startswith("T")]

    @property
    def fitted(self) -> list[str]:
        """Runs of the fit."""
        return [run for run in self.log.runs if not run.startswith("T")]

    def fit(self, **more: object) -> Solution:
        """The fit with these settings besides."""
        return identify(self.guess, self.log, self.fitted, self.settings.model_copy(update=more))

    def error(self, vessel: Vessel, current: tuple[float, float] = (0.0, 0.0)) -> float:
        """Root mean square error of the position [m] of free runs of runs held out, in a current [m/s]."""
        sea, settings = with_current(vessel, self.settings, self.held_out, current)
        errors = simulate_free_runs({"it": sea}, self.log, self.held_out, settings, self.ahead).errors
        return float(errors.loc[errors["run"] == ALL, "position"].iloc[0])


def _froude_power(unit: str) -> float:
    """Exponent of the length by which a number of a unit grows with a ship: a mass by 3, a time by 1/2."""
    base, total = {"kg": 3.0, "m": 1.0, "s": 0.5, "N": 3.0}, 0.0
    over, _, under = unit.partition("/")
    for sign, tokens in ((1, over), (-1, under)):
        for symbol, power in re.findall(r"([a-zA-Z]+)(?:\^(-?\d+))?", tokens):
            total += sign * base.get(symbol, 0.0) * int(power or 1)
    return total


def scaled_vessel(vessel: Vessel, scale: float) -> Vessel:
    """The ship so many times as long, by Froude."""
    values = {path: value * scale ** _froude_power(vessel.units[path]) for path, value in vessel.parameters.items()}
    powers = {"U_0": 0.5} | dict.fromkeys(("L_pp", "L_oa", "B", "T", "D"), 1.0)
    sizes = {f"particulars.{name}": x * scale ** powers[name] for name, x in vessel.document["particulars"].items()
             if name in powers}  # fmt: skip
    return vessel.with_values(sizes | values)


def _orders(vessel: Vessel, speed: float, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Command -> (ROWS, runs): shafts about those of the speed, and helm to both sides, held for a while."""
    controls, shape = Controls(vessel), (-(-ROWS // HELD), RUNS + TESTS)
    shaft = service_shaft(controls.vessel, speed) or 0.0

    def held(low: float, high: float) -> np.ndarray:
        return np.repeat(rng.uniform(low, high, shape), HELD, axis=0)[:ROWS]

    n, helm = shaft * held(0.6, 1.1), held(-0.5, 0.5)
    orders = {name: np.zeros_like(n) for name in vessel_dynamics(vessel).commands}
    for name in orders:
        if name in controls.effects[0]:
            side = {"port": 1.0, "starboard": -1.0}.get(name.split(".")[0], 0.0) * (not controls.effects[1])
            orders[name] = n * (1 + side * helm)
        elif name in controls.effects[1]:
            orders[name] = controls.effects[1][name] * helm
    return orders


def drawn_log(seed: int, speeds: tuple[float, float] = (0.1, 12.0)) -> DrawnLog:
    """The ship of a seed; speeds : least and greatest speed [m/s]."""
    rng = np.random.default_rng([seed, 57])
    base = load_vessel(str(rng.choice(BASES)))
    while True:
        length, froude = float(np.exp(rng.uniform(0, np.log(300)))), float(rng.uniform(0.03, 0.25))
        speed = froude * float(np.sqrt(9.81 * length))
        truth = scaled_vessel(base, length / base.length)
        if speeds[0] <= speed <= speeds[1] and service_shaft(truth, speed):
            break
    coefficients = [path for path, x in truth.parameters.items() if FREE.fullmatch(path) and x]
    truth = truth.with_values({path: truth.parameters[path] * rng.uniform(0.9, 1.1) for path in coefficients})
    wrong = {path: truth.parameters[path] * float(np.exp(rng.normal(0, 0.35))) for path in coefficients}
    time = length / speed
    orders = _orders(truth, speed, rng)
    kind = str(rng.choice(["none", "one", "by run"]))
    size = rng.uniform(0.02, 0.1) * speed * (kind != "none")
    angle = rng.uniform(-np.pi, np.pi, RUNS + TESTS if kind == "by run" else 1) + np.zeros(RUNS + TESTS)
    sea = truth if "current" in truth.document else truth.with_values({"current.kind": "uniform"})
    model = vessel_dynamics(sea)
    environment = {name: np.zeros(RUNS + TESTS) for name in model.environment}
    environment |= {"V_c": np.full(RUNS + TESTS, size), "beta_c": angle}
    start = {name: np.zeros(RUNS + TESTS) for name in model.state}
    start |= {"psi": rng.uniform(-3, 3, RUNS + TESTS), "u": speed * rng.uniform(0.6, 1.0, RUNS + TESTS)}
    path = rollout(
        sea, start, {name: x[:-1] for name, x in orders.items()}, environment, step=INTERVAL * time,
        num_steps=ROWS - 1, method="rk4", engine="casadi",
    )  # fmt: skip
    assert not path.diverged.any(), base.key
    noise = float(np.exp(rng.uniform(np.log(0.002), np.log(0.02))))
    spread = {"u": speed, "v": speed, "r": speed / length, "psi": 0.3, "north": 0.3 * length, "east": 0.3 * length}
    columns = {
        name: values + rng.normal(0, noise * spread.get(name, 0.0), values.shape)
        for name, values in log_columns(path, model.state).items()
    }
    frames = [
        pd.DataFrame({"run": f"R{i}" if i < RUNS else f"T{i}", "t": INTERVAL * time * np.arange(ROWS)}
                     | {name: x[:, i] for name, x in (columns | orders).items()})
        for i in range(RUNS + TESTS)
    ]  # fmt: skip
    log = Dataset(pd.concat(frames, ignore_index=True).assign(flags=0), {"clock": "run", "flags": []})
    priors = {"hull.*": 0.5} if rng.random() < 0.5 else {}
    free = coefficients if priors else sorted(rng.permutation(coefficients)[:6].tolist())
    step = INTERVAL * time
    settings = Identify(parameters=free, prior=dict.fromkeys(free, 0.5) if priors else {}, step=step,
                        horizon=max(30.0, 4 * step))  # fmt: skip
    guess = truth.with_values({path: wrong[path] for path in free})
    return DrawnLog(truth, guess, log, settings, speed, AHEAD * time)
