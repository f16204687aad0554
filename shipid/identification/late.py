"""Commands that come late: held from its row, one that changes between two rows counts half an interval late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Dataset, mean_commands, sample_columns
from shipid.physics.signals import is_steering
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

Changes = Literal["held", "between"]
"""When commands change: at the row that has them, until the next; or between that row and the one before."""
COARSE = 1.5  # rows: a longer step loses changes of the commands, and has a warning of its own
CONSIDERABLE = 0.006  # of the time in which a ship goes her length: so late, N_v came out 2 % wrong in zigzags


@dataclass(frozen=True)
class LateCommands:
    """Commands that steer and change between rows. interval : of the rows [s]."""

    interval: float

    @property
    def words(self) -> str:
        """How late, for a sentence."""
        when = f"commands count from their row, {self.delay:.3g} s late on average"
        return f"rows are {self.interval:.3g} s apart and {when}"

    @property
    def delay(self) -> float:
        """By how much commands are late on average [s]."""
        return self.interval / 2


def row_interval(dataset: Dataset, runs: Sequence[str]) -> float:
    """Median time from row to row of some runs [s]."""
    rows = dataset.frame[dataset.frame["run"].isin(runs)]
    return float(rows.groupby("run", sort=False)["t"].diff().median())


def late_commands(vessel: Vessel, dataset: Dataset, runs: Sequence[str]) -> LateCommands | None:
    """How late the commands of some runs come, where that is considerable for how fast the ship turns; else None.

    A vessel without a length is not judged.
    """
    rows = dataset.frame[dataset.frame["run"].isin(runs)]
    by_run = rows.groupby("run", sort=False)
    steering = [name for name in vessel_dynamics(vessel).commands if is_steering(name) and name in rows]
    steering = [name for name in steering if (by_run[name].nunique() > 1).any()]
    if not steering or vessel.length is None:
        return None
    late = LateCommands(row_interval(dataset, runs))
    return late if late.delay * float(rows["u"].abs().mean()) / vessel.length >= CONSIDERABLE else None


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
