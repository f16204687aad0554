"""Commands that come late: held from its row, one that changes between two rows counts half an interval late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Dataset, mean_commands, sample_columns
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

Changes = Literal["held", "between"]
"""When commands change: at the row that has them, until the next; or between that row and the one before."""
COARSE = 1.5  # rows: a longer step loses changes of the commands, and has a warning of its own


def row_interval(dataset: Dataset, runs: Sequence[str]) -> float:
    """Median time from row to row of some runs [s]."""
    rows = dataset.frame[dataset.frame["run"].isin(runs)]
    return float(rows.groupby("run", sort=False)["t"].diff().median())


def interpolate_commands(
    vessel: Vessel, rows: Mapping[str, NDArray[Any]], instants: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Commands of one unbroken stretch at instants [s] (any shape), where they change between the rows.

    An order to an actuator changes midway between two rows; a command without one goes on evenly.
    """
    t, model = np.asarray(rows["t"]), vessel_dynamics(vessel)
    nearest = np.searchsorted((t[1:] + t[:-1]) / 2, instants, side="right")
    return {
        name: np.asarray(rows[name])[nearest] if name in model.memory else np.interp(instants, t, rows[name])
        for name in model.commands
    }


def held_over_steps(
    vessel: Vessel, rows: Mapping[str, NDArray[Any]], instants: NDArray[np.float64], step: float
) -> dict[str, NDArray[np.float64]]:
    """Commands of one unbroken stretch in steps from instants (N,) [s], where they hold from row to row.

    Within a step an order to an actuator counts from the nearest begin of a step, any other command with its mean.
    """
    model, edges = vessel_dynamics(vessel), np.append(instants, instants[-1] + step)
    nearest, mean = sample_columns(rows, instants + step / 2), mean_commands(rows, edges)
    return {name: np.asarray((nearest if name in model.memory else mean)[name]) for name in model.commands}
