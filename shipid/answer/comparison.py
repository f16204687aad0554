"""The same cells in two ways: what one set of cells errs less than another, paired over test manoeuvres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shipid.evidence import paired_difference, training_error

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CellErrors:
    """Mean error (R,) [m] of one cell in every test manoeuvre, and the windows (R,) of each.

    model : cells of one model in one world differ by their seed alone. trained : whether another training would change
    the errors. world : test manoeuvres of two worlds are not the same ones.
    """

    model: str
    errors: Array
    windows: Array
    trained: bool = True
    world: str = ""

    @property
    def mean(self) -> float:
        """Mean error [m] over all windows."""
        return float(self.errors @ self.windows / self.windows.sum())


@dataclass(frozen=True)
class CellDifference:
    """Mean error of cells less that of others [m], with its 95 % interval and one-sided chances.

    runs, better : test manoeuvres, and those with a lower error. worlds : (W,) the difference in each world [m].
    """

    mean: float
    low: float
    high: float
    above: float
    below: float
    runs: int
    better: int
    worlds: Array


def compare_cells(mine: Sequence[CellErrors], others: Sequence[CellErrors]) -> CellDifference:
    """Compare cells with others, pair by pair; every pair weighs the same, whatever the number of its windows.

    All windows and cells of a test manoeuvre, in its world, are drawn together; what another training would give is in
    the interval, but for cells that err alike to the digit.
    """
    pairs = list(zip(mine, others, strict=True))
    by_world: dict[str, list[tuple[CellErrors, CellErrors]]] = {}
    for pair in pairs:
        by_world.setdefault(pair[0].world, []).append(pair)
    means = [np.mean([one.errors - other.errors for one, other in same], axis=0) for same in by_world.values()]
    shares = [len(same) * same[0][0].windows / same[0][0].windows.sum() for same in by_world.values()]
    values, weights = np.concatenate(means), np.concatenate(shares)
    training = math.hypot(*(_training_of(side, pairs) for side in zip(*pairs, strict=True)))
    one = paired_difference(values[None], weights, training)
    mean, low, high, above, below = (float(number[0]) for number in (one.mean, one.low, one.high, one.above, one.below))
    worlds = np.array([mean @ share / share.sum() for mean, share in zip(means, shares, strict=True)])
    return CellDifference(mean, low, high, above, below, len(values), int((values < 0).sum()), worlds)


def _training_of(cells: Sequence[CellErrors], pairs: Sequence[tuple[CellErrors, CellErrors]]) -> float:
    """Standard error [m] that training alone gives the mean error of one side of pairs."""
    models: dict[tuple[str, str], list[tuple[float, bool]]] = {}
    for cell, (one, other) in zip(cells, pairs, strict=True):
        moved = cell.trained and not np.array_equal(one.errors, other.errors)
        models.setdefault((cell.world, cell.model), []).append((cell.mean, moved))
    H, trained = zip(*(zip(*cells, strict=True) for cells in models.values()), strict=True)
    return training_error([np.array(means) for means in H], [np.array(moved) for moved in trained])
