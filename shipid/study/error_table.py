"""Errors of a study by test manoeuvre: what findings and the answer judge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.metrics import position_error
from shipid.study.declared import NO_MODEL
from shipid.study.evidence import Contrasts, contrasts, mean_errors, training_noise
from shipid.study.plan import learns_from_runs, plain_rival
from shipid.study.results import Results, judged_cells

Array = NDArray[np.float64]
Metric = Literal["H", "H_90"]
PLAIN = "none, plain"
"""Prediction with no physics and without the mirror symmetry of the hull, where the study has it."""
ALONE = -1  # place of the physics alone in a term
EXACT = 1e-9  # m: errors below count as this one, which has a logarithm and can be divided by
Term = tuple[float, str, int]  # factor, model, place of its N_D in `amounts` or ALONE


@dataclass(frozen=True)
class ErrorTable:
    """Errors [m] by test manoeuvre.

    amounts : N_D, rising. counts : (R,) windows of each test manoeuvre.
    A : model -> (R,) mean error of the physics alone. H : model -> (amounts, seeds, R) of the prediction. What is below
        `EXACT`, such as the error of the physics that made the data, is raised to it.
    """

    amounts: tuple[int, ...]
    counts: Array
    A: Mapping[str, Array]
    H: Mapping[str, Array]

    def __post_init__(self) -> None:
        """Raise errors to `EXACT`."""
        for name in ("A", "H"):
            raised = {model: np.maximum(values, EXACT) for model, values in getattr(self, name).items()}
            object.__setattr__(self, name, raised)

    @property
    def runs(self) -> int:
        """Number of test manoeuvres R."""
        return len(self.counts)

    @property
    def weights(self) -> Array:
        """(R,) share of the windows in each manoeuvre."""
        weights: Array = self.counts / self.counts.sum()
        return weights

    @cached_property
    def noise(self) -> Array:
        """(amounts,) relative standard error [1] that H of one cell has from training, as a mean over seeds."""
        by_seed = {model: values @ self.weights for model, values in self.H.items()}
        seeds = max((values.shape[1] for values in by_seed.values()), default=1)
        every = range(len(self.amounts))
        noise = np.array([training_noise([values[k] for values in by_seed.values()]) for k in every], dtype=float)
        relative: Array = noise / seeds**0.5
        return relative

    def by_run(self, model: str, place: int) -> Array:
        """(R,) error of a model at an amount, mean over seeds, or of its physics alone."""
        return self.A[model] if place == ALONE else self.H[model][place].mean(axis=0)

    def mean(self, model: str, place: int) -> float:
        """Error [m] of a model at an amount, mean over seeds and windows, or of its physics alone."""
        return float(self.by_run(model, place) @ self.weights)

    def interval(self, model: str, place: int) -> tuple[float, float]:
        """95 % interval [m] of the error of a model at an amount, mean over seeds and windows."""
        judged = mean_errors(
            self.by_run(model, place)[None], self.counts, self.mean(model, place) * float(self.noise[place])
        )
        return float(judged.low[0]), float(judged.high[0])

    def compare(self, differences: Sequence[Sequence[Term]]) -> Contrasts:
        """Judge sums of errors, each with its factor: `[(1, "none", 0), (-1, "good", 0)]` is what physics saves."""
        values, training = np.zeros((len(differences), self.runs)), np.zeros(len(differences))
        for row, terms in enumerate(differences):
            for factor, model, place in terms:
                values[row] += factor * self.by_run(model, place)
                if place != ALONE:
                    training[row] += (factor * self.mean(model, place) * self.noise[place]) ** 2
        return contrasts(values, self.counts, np.sqrt(training))

    def against(self, rival: str, models: Sequence[str], place: int) -> Contrasts:
        """How much lower [m] than a rival's the errors of models are at an amount of data."""
        return self.compare([[(1.0, rival, place), (-1.0, model, place)] for model in models])


def error_table(
    results: Results, models: Sequence[str], metric: Metric = "H", amounts: Sequence[int] | None = None
) -> ErrorTable:
    """Errors of models, `none` and plain `none` that have a result in every cell; H_90 is taken in each manoeuvre.

    amounts : values of N_D that count, rising; all by default.
    """
    _, place, counts = np.unique(results.test.run, return_inverse=True, return_counts=True)

    def by_run(path: Array) -> Array:
        return _by_run(path, results.test.future, place, metric)

    cells = judged_cells(results)
    amounts = sorted(set(cells["N_D"])) if amounts is None else amounts
    seeds = sorted(set(cells["seed"]))
    wanted = {name: cells[cells["foundation"] == name] for name in (*models, NO_MODEL)}
    if plain := plain_rival(results.plan):
        every = results.cells
        wanted[PLAIN] = every[(every["foundation"] == NO_MODEL) & (every["method"] == plain)]
    H = {}
    for name, mine in wanted.items():
        known = {(row.N_D, row.seed): str(row.cell) for row in mine.itertuples()}
        if all(known.get((N, seed)) in results.paths for N in amounts for seed in seeds):
            H[name] = np.array([[by_run(results.paths[known[N, seed]]) for seed in seeds] for N in amounts])
    alone = {
        name: by_run(path)
        for name, path in results.physics.items()
        if name in models and name != NO_MODEL and np.isfinite(path).all()
    }
    return ErrorTable(tuple(int(N) for N in amounts), counts.astype(float), alone, H)


def intervals_frame(results: Results) -> pd.DataFrame:
    """95 % interval of H over test manoeuvres, of every model at every amount of data.

    Columns: model, N_D, low, high [m]; not numbers with fewer than five test manoeuvres. H is the mean over seeds; what
    another training would give is in the interval of every model that learns.
    """
    _, place, counts = np.unique(results.test.run, return_inverse=True, return_counts=True)
    cells = results.cells[results.cells["cell"].map(results.paths.__contains__)]
    parts, weights, true = [], counts / counts.sum(), results.test.future
    for N_D, mine in cells.groupby("N_D", sort=True):
        errors = {
            str(model): np.stack(
                [_by_run(results.paths[str(cell)], true, place) for cell in same["cell"]]
            )  # (seeds, R)
            for model, same in mine.groupby("model", sort=False)
        }
        means = np.stack([each.mean(axis=0) for each in errors.values()])
        of_model = {
            row.model: learns_from_runs(results.plan, str(row.family), str(row.method)) for row in mine.itertuples()
        }
        trained = np.array([of_model[model] for model in errors])
        noise = training_noise([each @ weights for each, moved in zip(errors.values(), trained, strict=True) if moved])
        seeds = np.array([len(each) for each in errors.values()])
        judged = mean_errors(means, counts.astype(float), trained * noise * (means @ weights) / np.sqrt(seeds))
        parts.append(pd.DataFrame({"model": list(errors), "N_D": N_D, "low": judged.low, "high": judged.high}))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=["model", "N_D", "low", "high"])


def _by_run(path: Array, true: Array, place: NDArray[np.int64], metric: Metric = "H") -> Array:
    """(R,) mean error, or 90th percentile, [m] of a path in each test manoeuvre; place : (S,) that of each window."""
    error = position_error(path, true)
    if metric == "H":
        return np.bincount(place, error.mean(axis=0)) / np.bincount(place)
    sizes = np.bincount(place)
    if (sizes == sizes[0]).all():  # all at once: a call of each takes ten times as long
        order = np.argsort(place, kind="stable")
        return np.asarray(np.quantile(error[:, order].reshape(len(error), len(sizes), -1), 0.9, axis=(0, 2)))
    return np.array([np.quantile(error[:, place == k], 0.9) for k in range(len(sizes))])
