"""Noisy voyages in gusty wind at 10 Hz, and a first guess of the ship from her main particulars."""

from __future__ import annotations

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset
from shipid.engine.rollout import rollout
from shipid.identification.settings import Identify
from shipid.simulation.log import log_columns
from shipid.simulation.weather import Gusts, gust_series
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from shipid.vessel.template import FirstGuess, Particulars, first_guess

SHIP = "gunnerus-28.9"
STEP, HELD = 0.1, 20.0  # s
NOISE = {"u": 0.05, "v": 0.05, "r": np.radians(0.1), "psi": np.radians(0.2), "north": 0.5, "east": 0.5}
SETTINGS = Identify(
    parameters=["hull.mmg.*", "thruster.*.k_T", "wind.C_Dt"]
    + [f"added_mass.{name}" for name in ("X_udot", "Y_vdot", "N_rdot")],
    fixed=["hull.mmg.X_vv", "hull.mmg.X_vvvv"],
    together=[["thruster.port.k_T", "thruster.starboard.k_T"]],
    prior={"hull.mmg.*": 1.0, "thruster.*.k_T": 0.2, "added_mass.*": 0.3, "wind.*": 0.5},
    horizon=30.0,
    step=STEP,
    weights={"u": NOISE["u"], "v": NOISE["v"], "r": NOISE["r"]},
)
"""20 factors."""


def guess() -> FirstGuess:
    """A vessel as `shipid vessel new` makes it, of the size of the one that made the voyages."""
    given = Particulars(28.9, 9.6, 2.65, 0.56, speed=5.0, propulsor="azimuth", ship_type="research")
    return first_guess(given, "guess", "guess.toml")


def voyages(runs: int, shortest: float = 100.0, longest: float = 300.0, seed: int = 7) -> Dataset:
    """Runs of a length [s] between the two, random orders held for 20 s, wind of 1 to 9 m/s with gusts, noise."""
    vessel, rng = load_vessel(SHIP), np.random.default_rng(seed)
    model, steps = vessel_dynamics(vessel), round(longest / STEP)
    count = -(-steps // round(HELD / STEP))

    def held(low: float, high: float) -> np.ndarray:
        return np.repeat(rng.uniform(low, high, (count, runs)), round(HELD / STEP), axis=0)[:steps]

    n, alpha = held(1.5, 3.3), held(-0.6, 0.6)
    orders = {name: n if name.endswith(".n") else alpha for name in model.commands}
    t, mean, beta = STEP * np.arange(steps + 1), rng.uniform(1, 9, runs), rng.uniform(-3, 3, runs)
    V_w = np.maximum(mean + gust_series(Gusts(kind="npd"), mean, t, [(seed, run) for run in range(runs)]), 0.0)
    start = {name: np.zeros(runs) for name in model.state}
    start |= {"u": rng.uniform(2, 4, runs), "psi": rng.uniform(-3, 3, runs)}
    weather = {"V_w": V_w[:-1], "beta_w": np.tile(beta, (steps, 1))}
    path = rollout(vessel, start, orders, weather, step=STEP, num_steps=steps, method="rk4")
    assert not path.diverged.any()
    columns = log_columns(path, model.state) | {k: np.vstack([x, x[-1:]]) for k, x in orders.items()}
    columns |= {"V_w": V_w, "beta_w": np.tile(beta, (steps + 1, 1))}
    frames = []
    for run, length in enumerate(rng.uniform(shortest, longest, runs)):
        rows = round(length / STEP) + 1
        measured = {name: x[:rows, run] + rng.normal(0, NOISE.get(name, 0.0), rows) for name, x in columns.items()}
        frames.append(pd.DataFrame({"run": f"R{run + 1:02d}", "t": t[:rows], **measured}))
    frame = pd.concat(frames, ignore_index=True)
    frame["flags"] = 0
    return Dataset(frame, {"clock": "run", "flags": []})
