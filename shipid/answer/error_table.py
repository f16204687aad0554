"""Errors of a study by test manoeuvre: what findings and the answer judge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shipid.evidence import Differences, paired_difference, training_noise
from shipid.metrics import position_error
from shipid.report.wording import metres_text
from shipid.study.declared import NO_MODEL
from shipid.study.results import Results

Array = NDArray[np.float64]
Metric = Literal["H", "H_90"]
PHYSICS_ONLY = -1  # place of the physics alone in a term
SMALLEST_ERROR = 1e-9  # m: errors below count as this one, which has a logarithm and can be divided by
ErrorTerm = tuple[float, str, int]  # factor, model, place of its N_D in `amounts` or PHYSICS_ONLY


@dataclass(frozen=True)
class ErrorTable:
    """Errors [m] by test manoeuvre.

    amounts : N_D, rising. counts : (R,) windows of each test manoeuvre.
    A : model -> (R,) mean error of the physics alone. H : model -> (amounts, seeds, R) of the prediction.
    """

    amounts: tuple[int, ...]
    counts: Array
    A: Mapping[str, Array]
    H: Mapping[str, Array]

    @property
    def runs(self) -> int:
        """Number of test manoeuvres R."""
        return len(self.counts)

    @property
    def weights(self) -> Array:
        """(R,) share of the windows in each manoeuvre."""
        return np.asarray(self.counts / self.counts.sum())

    @cached_property
    def noise(self) -> Array:
        """(amounts,) relative standard error [1] that H of one cell has from training, as a mean over seeds."""
        by_seed = [values @ self.weights for values in self.H.values()]
        seeds = max((values.shape[1] for values in by_seed), default=1)
        each = [training_noise([values[k] for values in by_seed]) for k in range(len(self.amounts))]
        return np.asarray(np.array(each, dtype=float) / seeds**0.5)

    def by_run(self, model: str, place: int) -> Array:
        """(R,) error of a model at an amount, mean over seeds, or of its physics alone; `SMALLEST_ERROR` at least.

        Of the physics that made the data it is 0.
        """
        errors = self.A[model] if place == PHYSICS_ONLY else self.H[model][place].mean(axis=0)
        return np.maximum(errors, SMALLEST_ERROR)

    def mean(self, model: str, place: int) -> float:
        """Error [m] of a model at an amount, mean over seeds and windows, or of its physics alone."""
        return float(self.by_run(model, place) @ self.weights)

    def metres(self, model: str, place: int) -> str:
        """Error of a model at an amount, or of its physics alone, in words."""
        return metres_text(self.mean(model, place))

    def interval(self, model: str, place: int) -> tuple[float, float]:
        """95 % interval [m] of the error of a model at an amount, mean over seeds and windows."""
        errors = self.compare([[(1.0, model, place)]])
        return max(float(errors.low[0]), 0.0), float(errors.high[0])

    def compare(self, differences: Sequence[Sequence[ErrorTerm]]) -> Differences:
        """Judge sums of errors, each with its factor: `[(1, "none", 0), (-1, "good", 0)]` is what physics saves."""
        values, training = np.zeros((len(differences), self.runs)), np.zeros(len(differences))
        for row, terms in enumerate(differences):
            for factor, model, place in terms:
                values[row] += factor * self.by_run(model, place)
                if place != PHYSICS_ONLY:
                    training[row] += (factor * self.mean(model, place) * self.noise[place]) ** 2
        return paired_difference(values, self.counts, np.sqrt(training))

    def lead(self, rival: str, models: Sequence[str], place: int) -> Differences:
        """How much lower [m] than a rival's the errors of models are at an amount of data."""
        return self.compare([[(1.0, rival, place), (-1.0, model, place)] for model in models])


def error_table(
    results: Results, models: Sequence[str], metric: Metric = "H", amounts: Sequence[int] | None = None
) -> ErrorTable:
    """Errors of models and `none` that have a result in every cell; H_90 is taken in each manoeuvre.

    amounts : values of N_D that count, rising; all by default.
    """
    cells = results.judged_cells
    of_path = results.path_errors if metric == "H" else partial(_upper_errors, results)
    good = [cell for cell in cells["cell"] if cell in results.paths]
    errors = results.errors if metric == "H" else {cell: of_path(results.paths[cell]) for cell in good}
    amounts = sorted(set(cells["N_D"])) if amounts is None else amounts
    seeds = sorted(set(cells["seed"]))
    keys = zip(cells["foundation"], cells["N_D"], cells["seed"], strict=True)
    known = dict(zip(keys, cells["cell"], strict=True))
    H = {}
    for name in (*models, NO_MODEL):
        mine = [[known.get((name, N, seed)) for seed in seeds] for N in amounts]
        if all(cell in errors for row in mine for cell in row):
            H[name] = np.array([[errors[str(cell)] for cell in row] for row in mine])
    alone = {
        name: of_path(path)
        for name, path in results.physics.items()
        if name in models and name != NO_MODEL and np.isfinite(path).all()
    }
    return ErrorTable(tuple(int(N) for N in amounts), results.windows, alone, H)


def _upper_errors(results: Results, path: Array) -> Array:
    """(R,) 90th percentile [m] of the errors of a path (T, S, 2) [m] in each test manoeuvre."""
    error, run = position_error(path, results.test.future), results.test.run
    return np.array([np.quantile(error[:, run == name], 0.9) for name in np.unique(run)])
