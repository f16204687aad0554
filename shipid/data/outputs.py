"""Measured outputs of components, such as the thrust of a propeller, beside what a vessel predicts for them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset, stretches_of_runs
from shipid.engine.casadi import evaluate_samples, memory_along
from shipid.simulation.log import body_velocities, state_column
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel


def outputs_in_common(vessel: Vessel, dataset: Dataset) -> list[str]:
    """Outputs that were measured and that the vessel predicts; none where a command was not recorded."""
    model = vessel_dynamics(vessel)
    if not set(model.commands) <= set(dataset.commands):
        return []
    return [name for name in dataset.outputs if name in model.outputs]


def predicted_outputs(vessel: Vessel, dataset: Dataset, weather: Mapping[str, float] | None = None) -> pd.DataFrame:
    """Outputs that the vessel predicts in the recorded motion, by the recorded orders, through the actuators' lags.

    Returns one row for each row of the dataset, with `run`, `t` [s] and a column [SI] for each of `outputs_in_common`.
    Nothing is simulated but the actuators, so that errors of the hull do not count. weather : signal of the environment
    that the log lacks, such as a current -> its value in all runs; 0 by default.
    """
    model, wanted = vessel_dynamics(vessel), outputs_in_common(vessel, dataset)
    places = [list(model.outputs).index(name) for name in wanted]
    values, parts = np.array(list(vessel.parameters.values())), []
    for run, rows in stretches_of_runs(dataset):
        columns = {str(name): rows[name].to_numpy() for name in rows.columns if name != "run"}
        still = np.zeros(len(rows))
        columns |= {name: still + value for name, value in (weather or {}).items()}
        motion = columns | body_velocities(columns)
        states = [motion.get(state_column(name), still) for name in (*model.state, *model.hidden)]
        memory = memory_along(vessel, {name: columns[name] for name in model.commands}, columns["t"]) or {}
        seen = (
            states,
            [memory[name] for name in model.memory],
            [columns[name] for name in model.commands],
            [columns.get(name, still) for name in model.environment],
        )
        shown = evaluate_samples(model, "measured", seen, values)[places]
        parts.append(pd.DataFrame({"run": run, "t": columns["t"], **dict(zip(wanted, shown, strict=True))}))
    return pd.concat(parts, ignore_index=True)
