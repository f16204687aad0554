"""Simulators of tests: the rollout of a vessel as a function, as a module of a user, and as a table of its paths."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.engine.rollout import rollout
from shipid.study.windows import StudyWindows
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.study.tiny import TINY

Array = np.ndarray
SHIP = load_vessel("gunnerus-28.9")
STATES = ("north", "east", "psi", "u", "v", "r")
MODULE = """
import numpy as np
from tests.foundations.ships import gunnerus

def simulate(states, orders, weather, step, N_ur=1.0, Y_uv=1.0):
    return gunnerus(states, orders, weather, step, {"N_ur": N_ur, "Y_uv": Y_uv})

def few(states, orders, weather): ...
def narrow(states, orders, weather, step): return np.zeros((len(states), 1, 6))
def broken(states, orders, weather, step): return states[:, None] / orders["no"]
def fails(states, orders, weather, step):
    after = simulate(states, orders, weather, step)
    after[states[:, 3] > 2.0] = np.nan
    return after
"""


def gunnerus(states: Array, orders: Any, weather: Any, step: float, factors: dict[str, float] | None = None) -> Array:
    """States (S, K, 6) of the bundled ship by Euler's rule; factors on some of its derivatives."""
    vessel = SHIP
    paths = {f"hull.derivatives.{name}": factor for name, factor in (factors or {}).items()}
    vessel = vessel.with_values({path: vessel.parameters[path] * factor for path, factor in paths.items()})
    model, given = vessel_dynamics(vessel), {name: values.T for name, values in orders.items()}
    air = {name: weather.get(name, np.zeros((len(states), 1)))[:, 0] for name in model.environment}
    begun, steps = dict(zip(STATES, states.T, strict=True)), len(next(iter(given.values())))
    commands = {name: given[name] for name in model.commands}
    result = rollout(vessel, begun, commands, air, step=step, num_steps=steps)
    return np.stack([result[name][1:, 0].T for name in STATES], axis=-1)


def study_file(folder: Path, families: str, more: str = "", methods: str = "") -> Path:
    """The tiny study with other families, and in a folder with the module `my_ship`; 'more' comes first."""
    text = TINY.read_text().split("[[family]]")[0]
    text = text.split("[[method]]")[0] + methods if methods else text
    (folder / "my_ship.py").write_text(MODULE)
    file = folder / "study.toml"
    file.write_text(f"{more}\n{text}\n{families}")
    return file


def simulated_table(cut: StudyWindows, motion: bool = True) -> pd.DataFrame:
    """What a simulator makes of the tables of `study windows`: every row of `windows` over its rows of `future`."""
    tables = cut.tables()
    windows, future, parts = tables["windows"], dict([*tables["future"].groupby(["run", "instant"])]), []
    for _, row in windows.iterrows():
        ahead = future[row["run"], row["instant"]]
        orders = {name: ahead[name].to_numpy()[None] for name in cut.names["orders"]}
        weather = {name: ahead[name].to_numpy()[None] for name in cut.names["wind"]}
        after = gunnerus(row[list(STATES)].to_numpy(float)[None], orders, weather, cut.windows.step)[0]
        parts.append(ahead[["run", "instant", "ahead"]].assign(**dict(zip(STATES, after.T, strict=True))))
    kept = STATES if motion else STATES[:2]
    return pd.concat(parts)[["run", "instant", "ahead", *kept]]
