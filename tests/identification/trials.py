"""Trials by the simulator of shipid: random orders held for a while, logged once a step, without noise."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset
from shipid.engine.rollout import rollout
from shipid.simulation.log import log_columns as log_columns
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel
from tests.conftest import pace

HELD = 10  # steps
RANGES = {"n": (1.5, 3.3), "alpha": (-0.6, 0.6), "delta": (-0.6, 0.6)}


def orders(vessel: Vessel, runs: int, steps: int, seed: int) -> dict[str, np.ndarray]:
    """Command -> (steps + 1, runs), the same for both sides."""
    rng = np.random.default_rng(seed)
    count = -(-(steps + 1) // HELD)
    drawn = {
        name: np.repeat(rng.uniform(*limits, (count, runs)), HELD, axis=0)[: steps + 1]
        for name, limits in RANGES.items()
    }
    return {name: drawn[name.rsplit(".", 1)[-1]] for name in vessel_dynamics(vessel).commands}


def trials(
    vessel: Vessel,
    runs: int = 6,
    steps: int = 60,
    seed: int = 1,
    *,
    step: float = 1.0,
    true_commands: Mapping[str, np.ndarray] | None = None,
    weather: Mapping[str, np.ndarray] | None = None,
    parameters: np.ndarray | None = None,
    method: str = "rk4",
) -> Dataset:
    """Sail the runs and log them.

    true_commands : commands in force where they differ from those logged. weather : channel -> (runs,), not logged.
    parameters : (runs, P), of each run.
    """
    model = vessel_dynamics(vessel)
    rng = np.random.default_rng(seed + 1000)
    start = {name: np.zeros(runs) for name in model.state}
    start |= {"psi": rng.uniform(-3, 3, runs), "u": pace(vessel) * rng.uniform(2, 5, runs)}
    logged = orders(vessel, runs, steps, seed)
    environment = {name: np.zeros(runs) for name in model.environment} | dict(weather or {})
    values = np.tile(list(vessel.parameters.values()), (runs, 1)) if parameters is None else parameters
    names = [f"M{number + 1:02d}" for number in range(runs)]
    frames = []
    for i, name in enumerate(names):
        path = rollout(
            vessel,
            {key: value[[i]] for key, value in start.items()},
            {key: value[:-1, [i]] for key, value in (true_commands or logged).items()},
            {key: value[[i]] for key, value in environment.items()},
            step=step,
            num_steps=steps,
            method=method,  # type: ignore[arg-type]
            parameters=values[[i]],
            engine="casadi",
        )
        assert not path.diverged.any()
        columns = {key: values[:, 0] for key, values in log_columns(path, model.state).items()}
        frames.append(
            pd.DataFrame(
                {
                    "run": name,
                    "t": step * np.arange(steps + 1),
                    **columns,
                    **{key: value[:, i] for key, value in logged.items()},
                }
            )
        )
    frame = pd.concat(frames, ignore_index=True)
    frame["flags"] = 0
    return Dataset(frame, {"clock": "run", "flags": []})


def noisy(dataset: Dataset, deviations: Mapping[str, float], seed: int) -> Dataset:
    """The same log with errors of these standard deviations."""
    rng, count = np.random.default_rng(seed), len(dataset.frame)
    return changed(dataset, **{name: dataset.frame[name] + rng.normal(0, s, count) for name, s in deviations.items()})


def changed(dataset: Dataset, **columns: np.ndarray) -> Dataset:
    """The same log with some columns replaced."""
    return Dataset(dataset.frame.assign(**columns), dataset.metadata)
