"""The kind of a run, from its orders and its motion."""

from __future__ import annotations

from collections.abc import Container
from itertools import pairwise

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import Dataset, stretches_by_run
from shipid.logs.kinds import COASTING, LOW_SPEED, RANDOM, kind_in_name
from shipid.logs.segments import run_kind
from shipid.physics.signals import is_shaft, is_steering

Array = NDArray[np.float64]

STOPPED_SHAFT, STOPPED_TIME = 0.05, 0.6  # of the usual shaft speed; of the time
SLOW_SHARE = 0.3  # of the usual speed of the runs
RANDOM_LEVELS, LEVEL_DISTANCE = (
    4,
    np.radians(3.0),
)  # levels of helm, and how far apart, from which orders count as random
ZIGZAG_SPREAD = 0.25  # spread of the helm over its size in a zigzag
LEAST_LEVEL_TIME, LEAST_LEVEL_ROWS = 0.03, 3  # of the time of the run, and rows: a level


def kinds_of_runs(dataset: Dataset, runs: Container[str] | None = None, test: Container[str] = ()) -> dict[str, str]:
    """Run -> kind of manoeuvre: as the mapping says, else as the words in its name say, else by orders and motion.

    runs : those wanted; all by default. test : runs of the test; the usual speeds come from all others.
    """
    declared = dataset.metadata.get("manoeuvres", {})
    frame = dataset.frame[[run not in test for run in dataset.frame["run"]]]
    shafts = [name for name in dataset.commands if is_shaft(name)]
    speeds = pd.Series(np.hypot(frame["u"].to_numpy(), frame["v"].to_numpy()))
    speed = float(speeds.groupby(frame["run"].to_numpy()).mean().median())
    shaft = float(frame[shafts].abs().max(axis=1).median()) if shafts else 0.0
    return {
        run: declared.get(run) or kind_in_name(run) or kind_by_motion(longest_piece(parts), speed, shaft)
        for run, parts in stretches_by_run(dataset).items()
        if runs is None or run in runs
    }


def longest_piece(parts: list[pd.DataFrame]) -> pd.DataFrame:
    """The longest of the unbroken pieces of a run."""
    return max(parts, key=lambda part: float(part["t"].iloc[-1] - part["t"].iloc[0]))


def kind_by_motion(rows: pd.DataFrame, speed: float, shaft: float) -> str:
    """Kind of one unbroken stretch by what is ordered and how the ship moves.

    Parameters
    ----------
    speed, shaft : usual speed [m/s] and shaft speed [rev/s] of the runs, that say what is slow and what is stopped.
    """
    shafts = [name for name in map(str, rows.columns) if is_shaft(name)]
    moved = float(np.hypot(rows["u"], rows["v"]).mean())
    if shafts and shaft > 0:
        turning = rows[shafts].abs().max(axis=1).to_numpy()
        if (
            float((turning < STOPPED_SHAFT * shaft).mean()) > STOPPED_TIME
            and float(rows["u"].iloc[0]) > SLOW_SHARE * speed
        ):
            return COASTING
    if moved < SLOW_SHARE * speed:
        return LOW_SPEED
    kind = run_kind(rows)
    return RANDOM if kind in ("zigzag", "speed run", "transit") and _is_random_helm(rows) else kind


def _is_random_helm(rows: pd.DataFrame) -> bool:
    """Whether the helm goes through many levels that have no size in common, as no standard manoeuvre does."""
    levels = _helm_levels(rows)
    distinct = {round(level / LEVEL_DISTANCE) for level in levels}
    over = np.abs(levels)[np.abs(levels) > LEVEL_DISTANCE]
    if len(distinct) < RANDOM_LEVELS or len(over) < RANDOM_LEVELS:
        return False
    return float(over.std() / over.mean()) > ZIGZAG_SPREAD


def _helm_levels(rows: pd.DataFrame) -> Array:
    """Angles [rad] at which the helm is held for a while, one after another."""
    names = [name for name in map(str, rows.columns) if is_steering(name)]
    if not names or len(rows) < LEAST_LEVEL_ROWS:
        return np.empty(0)
    t, helm = rows["t"].to_numpy(), rows[names].to_numpy().mean(axis=1)
    jumps = np.flatnonzero(np.abs(np.diff(helm)) > LEVEL_DISTANCE / 2) + 1
    edges = np.concatenate([[0], jumps, [len(helm)]])
    least = max(LEAST_LEVEL_TIME * float(t[-1] - t[0]), 0.0)
    held = [
        float(np.median(helm[first:end]))
        for first, end in pairwise(edges)
        if end - first >= LEAST_LEVEL_ROWS and t[end - 1] - t[first] >= least
    ]
    return np.array(held)
