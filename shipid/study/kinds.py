"""The kind of a run, from its orders and its motion."""

from __future__ import annotations

from collections.abc import Container
from itertools import pairwise

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import Dataset, pieces_by_run
from shipid.logs.kinds import COASTING, LOW_SPEED, RANDOM, declared_kind
from shipid.logs.segments import kind_of
from shipid.physics.signals import is_shaft, is_steering

Array = NDArray[np.float64]

STOPPED, MOSTLY = 0.05, 0.6  # of the usual shaft speed; of the time
SLOW = 0.3  # of the usual speed of the runs
LEVELS, APART = 4, np.radians(3.0)  # levels of helm, and how far apart, from which orders count as random
ALIKE = 0.25  # spread of the helm over its size in a zigzag
LEAST_HELD, SHORTEST = 0.03, 3  # of the time of the run, and rows: a level


def kinds_of(dataset: Dataset, runs: Container[str] | None = None, test: Container[str] = ()) -> dict[str, str]:
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
        run: declared.get(run) or declared_kind(run) or seen_kind(longest(parts), speed, shaft)
        for run, parts in pieces_by_run(dataset).items()
        if runs is None or run in runs
    }


def longest(parts: list[pd.DataFrame]) -> pd.DataFrame:
    """The longest of the unbroken pieces of a run."""
    return max(parts, key=lambda part: float(part["t"].iloc[-1] - part["t"].iloc[0]))


def seen_kind(rows: pd.DataFrame, speed: float, shaft: float) -> str:
    """Kind of one unbroken stretch by what is ordered and how the ship moves.

    Parameters
    ----------
    speed, shaft : usual speed [m/s] and shaft speed [rev/s] of the runs, that say what is slow and what is stopped.
    """
    shafts = [name for name in map(str, rows.columns) if is_shaft(name)]
    moved = float(np.hypot(rows["u"], rows["v"]).mean())
    if shafts and shaft > 0:
        turning = rows[shafts].abs().max(axis=1).to_numpy()
        if float((turning < STOPPED * shaft).mean()) > MOSTLY and float(rows["u"].iloc[0]) > SLOW * speed:
            return COASTING
    if moved < SLOW * speed:
        return LOW_SPEED
    kind = kind_of(rows)
    return RANDOM if kind in ("zigzag", "speed run", "transit") and _random(rows) else kind


def _random(rows: pd.DataFrame) -> bool:
    """Whether the helm goes through many levels that have no size in common, as no standard manoeuvre does."""
    levels = _levels(rows)
    if len(levels) < LEVELS:
        return False
    distinct = {round(level / APART) for level in levels}
    over = np.abs(levels)[np.abs(levels) > APART]
    if len(distinct) < LEVELS or len(over) < LEVELS:
        return False
    return float(over.std() / over.mean()) > ALIKE


def _levels(rows: pd.DataFrame) -> Array:
    """Angles [rad] at which the helm is held for a while, one after another."""
    names = [name for name in map(str, rows.columns) if is_steering(name)]
    if not names or len(rows) < SHORTEST:
        return np.empty(0)
    t, helm = rows["t"].to_numpy(), rows[names].to_numpy().mean(axis=1)
    jumps = np.flatnonzero(np.abs(np.diff(helm)) > APART / 2) + 1
    edges = np.concatenate([[0], jumps, [len(helm)]])
    least = max(LEAST_HELD * float(t[-1] - t[0]), 0.0)
    held = [
        float(np.median(helm[first:end]))
        for first, end in pairwise(edges)
        if end - first >= SHORTEST and t[end - 1] - t[first] >= least
    ]
    return np.array(held)
