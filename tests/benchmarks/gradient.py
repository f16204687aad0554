"""What an exact gradient costs, in rollouts of the same windows by the native engine.

1,000 windows of 15 Euler steps of set A with a learned force of 203 weights; the loss is the mean squared distance.
"""

from __future__ import annotations

import tempfile
import time
from typing import Any

import numpy as np
import pytest

from shipid.engine.gradient import rollout_gradient, squared_distance_loss
from shipid.engine.native import find_compiler
from shipid.engine.rollout import rollout
from shipid.vessel.load import Vessel, load_vessel
from tests.benchmarks.rollouts import inputs
from tests.benchmarks.timing import best_of

WINDOWS, STEPS, UNITS, ROUNDS = 1000, 15, 29, 30
SCALES = {"u_scale": 5.0, "v_scale": 1.0, "r_scale": 0.1, "X_max": 2e4, "Y_max": 3e4, "N_max": 4e5}


def run() -> dict[str, Any]:
    """Milliseconds of a rollout and of a gradient, their ratio, and the time to compile the sweep."""
    vessel = learning()
    names = tuple(path for path in vessel.parameters if path.startswith("hull.learned.") and path[-1].isdecimal())
    given = inputs(WINDOWS)
    options: dict[str, Any] = {"step": 1.0, "num_steps": STEPS}
    truth = rollout(load_vessel("gunnerus-28.9"), *given, **options, keep=("north", "east"), engine="native")
    loss = squared_distance_loss(truth.states[1:, 0])

    def gradient(engine: str) -> np.ndarray:
        return rollout_gradient(vessel, *given, loss, **options, names=names, engine=engine).parameters

    def rolled(engine: str) -> Any:
        return rollout(vessel, *given, **options, keep=("north", "east"), engine=engine)

    ways: dict[str, Any] = {"rollout": lambda: rolled("native"), "gradient": lambda: gradient("native")}
    figures: dict[str, Any] = {}
    if find_compiler() is None:
        ways = {"rollout": lambda: rolled("torch"), "gradient": lambda: gradient("torch")}
    else:
        rolled("native")
        with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
            patch.setenv("XDG_CACHE_HOME", folder)
            begun = time.perf_counter()
            slopes = gradient("native")
            figures["compile [s]"] = round(time.perf_counter() - begun, 1)
        exact = gradient("torch")
        assert np.allclose(slopes, exact, rtol=1e-8, atol=1e-9 * np.abs(exact).max())
    seconds = best_of(ways, ROUNDS)
    figures |= {f"{name} [ms]": round(1e3 * value, 2) for name, value in seconds.items()}
    return figures | {"gradient / rollout": round(seconds["gradient"] / seconds["rollout"], 2)}


def learning() -> Vessel:
    """Set A with a learned force of UNITS units."""
    rng = np.random.default_rng(3)
    lists = ("w_u", "w_v", "w_r", "w_0", "c_X", "c_Y", "c_N")
    return load_vessel("gunnerus-28.9").with_values(
        {"hull.learned": SCALES | {name: rng.normal(0, 0.5, UNITS).tolist() for name in lists}}
    )
