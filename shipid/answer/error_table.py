"""Errors of a study by test manoeuvre, and what physics is worth: how good it must be, and how many runs it saves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, stdtrit

from shipid.evidence import (
    FEWEST_RUNS,
    SEED,
    SIGNIFICANT,
    Differences,
    paired_difference,
    resampled_means,
    training_noise,
)
from shipid.metrics import error_at_horizon, position_error
from shipid.report.wording import metres_text
from shipid.study.declared import NO_MODEL
from shipid.study.results import Results

Array = NDArray[np.float64]
Metric = Literal["H", "H_90", "H_end"]
PHYSICS_ONLY = -1  # place of the physics alone in a term
SMALLEST_ERROR = 1e-9  # m: errors below count as this one, which has a logarithm and can be divided by
ErrorTerm = tuple[float, str, int]  # factor, model, place of its N_D in `amounts` or PHYSICS_ONLY
FEWEST_FOR_LINE = 4  # for a line of H over A
STEPS_OF_A = 400  # of A from its least to its greatest, in an interval


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
    """Errors of models and `none` that have a result in every cell, over the horizon (H, H_90) or at its end (H_end).

    amounts : values of N_D that count, rising; all by default.
    """
    cells = results.judged_cells
    of_path = partial(ERRORS_BY_RUN[metric], results)
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


def _errors_at_horizon(results: Results, path: Array) -> Array:
    """(R,) mean error [m] of a path (T, S, 2) [m] at the end of the horizon in each test manoeuvre."""
    return results.by_run(error_at_horizon(position_error(path, results.test.future)))


ERRORS_BY_RUN: dict[Metric, Callable[[Results, Array], Array]] = {
    "H": Results.path_errors,
    "H_90": _upper_errors,
    "H_end": _errors_at_horizon,
}


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval over test manoeuvres; the interval is not a number where there are too few.

    limits : least and greatest value that the study covers; a value there is a bound.
    """

    value: float
    low: float
    high: float
    limits: tuple[float, float]

    @property
    def below(self) -> bool:
        """Whether the value is at most the least value that the study covers."""
        return self.value <= self.limits[0]

    @property
    def above(self) -> bool:
        """Whether the value is at least the greatest value that the study covers."""
        return self.value >= self.limits[1]


def _quantile_estimate(value: Array, drawn: Array, runs: int, limits: tuple[float, float]) -> Estimate:
    """Quantiles of resampled values, further out where manoeuvres are few (expanded percentiles; Hesterberg 2015)."""
    level = float(ndtr(stdtrit(runs - 1, SIGNIFICANT) * (runs / (runs - 1)) ** 0.5)) if runs >= FEWEST_RUNS else np.nan
    low, high = np.quantile(drawn, [level, 1 - level]) if runs >= FEWEST_RUNS else (np.nan, np.nan)
    middle, least, greatest = (
        next((end for end in limits if np.isclose(end, number)), float(number)) for number in (value[0], low, high)
    )
    return Estimate(middle, least, greatest, limits)


def _with_other_trainings(drawn: Array, noise: Array) -> Array:
    """Resampled means (B, ...) as other trainings would give them: each times a factor of relative spread `noise`."""
    return drawn * np.exp(np.random.default_rng(SEED).standard_normal(drawn.shape) * noise)


def break_even(table: ErrorTable, models: Sequence[str], place: int) -> Estimate | None:
    """Accuracy A [m] at which compensated physics is as good as none, at the amount of this place.

    A line ln H over ln A, by least squares, crosses H of `none`; values beyond the models tried are bounds. The
    interval holds at least every A at which Student's test over manoeuvres cannot tell the line from `none`. None with
    fewer than four models, or where all have the same A.
    """
    if len(models) < FEWEST_FOR_LINE:
        return None
    values = np.stack(
        [
            [table.by_run(model, PHYSICS_ONLY) for model in (*models, models[0])],
            [table.by_run(model, place) for model in (*models, NO_MODEL)],
        ]
    )  # (A or H, models and none, R)
    noise = np.array([[0.0], [float(table.noise[place])]])
    means, drawn = values @ table.weights, _with_other_trainings(resampled_means(values, table.counts), noise)
    A = means[0, :-1]
    limits = float(A.min()), float(A.max())
    if np.isclose(*limits):
        return None
    estimate = _quantile_estimate(
        _crossing_of_line(means[None], limits), _crossing_of_line(drawn, limits), table.runs, limits
    )
    if table.runs < FEWEST_RUNS:
        return estimate
    low, high = _undecided_range(values, table.counts, limits)
    return replace(estimate, low=min(estimate.low, low), high=max(estimate.high, high))


def _undecided_range(values: Array, counts: Array, limits: tuple[float, float]) -> tuple[float, float]:
    """Least and greatest A within limits at which Student's test, by the jackknife, cannot tell the line from none.

    values : (2, models and none, R).
    """
    runs, A = len(counts), np.geomspace(*limits, STEPS_OF_A)
    left = np.vstack([counts, counts * (1 - np.eye(runs))])  # all manoeuvres, and all without each in turn
    centre, slope, margin = _line_of_logs(np.moveaxis(values @ (left / left.sum(axis=1, keepdims=True)).T, -1, 0))
    ahead = margin[:, None] - slope[:, None] * (np.log(A) - centre[:, None])  # of none, (1 + R, A)
    wide = stdtrit(runs - 1, 1 - SIGNIFICANT) * np.sqrt(runs - 1) * ahead[1:].std(axis=0)
    open_below, open_above = np.flatnonzero(ahead[0] <= wide), np.flatnonzero(ahead[0] >= -wide)
    least = A[max(open_below[0] - 1, 0)] if len(open_below) else limits[1]  # where the least A is not shown to pay
    most = A[min(open_above[-1] + 1, STEPS_OF_A - 1)] if len(open_above) else limits[0]
    return float(least), float(most)


def _line_of_logs(values: Array) -> tuple[Array, Array, Array]:
    """Line of ln H over ln A: middle of ln A, slope, and how far ln H of none is above the mean of the models.

    values : (B, 2, models and none); each result (B,).
    """
    logs = np.log(values)
    x, y, none = logs[:, 0, :-1], logs[:, 1, :-1], logs[:, 1, -1]
    middle = x.mean(axis=1)
    centred = x - middle[:, None]
    slope: Array = (centred * y).sum(axis=1) / np.maximum((centred**2).sum(axis=1), 1e-12)
    return middle, slope, none - y.mean(axis=1)


def _crossing_of_line(values: Array, limits: tuple[float, float]) -> Array:
    """Where the line through (A, H) of models reaches the H of none, within limits; values (B, 2, models and none)."""
    middle, slope, margin = _line_of_logs(values)
    low, high = np.log(limits)
    rising = slope > 1e-9
    at = middle + np.divide(margin, slope, out=np.zeros_like(margin), where=rising)
    flat = np.where(margin > 0, high, low)  # no better for being more accurate: all pay, or none does
    return np.asarray(np.exp(np.clip(np.where(rising, at, flat), low, high)))


def runs_without_physics(table: ErrorTable, model: str, place: int) -> Estimate:
    """Runs that no physics needs for the error that a model has with the amount of this place.

    Interpolated along ln H over ln N_D; where more data made it worse, the best so far counts. The interval holds every
    amount at which the test cannot tell the two.
    """
    rivals = np.stack([table.by_run(NO_MODEL, k) for k in range(len(table.amounts))])
    values = np.vstack([rivals, table.by_run(model, place)[None]])
    limits = float(table.amounts[0]), float(table.amounts[-1])
    noise = np.array([*table.noise, table.noise[place]])
    mean, drawn = (values @ table.weights)[None], _with_other_trainings(resampled_means(values, table.counts), noise)
    amounts = np.array(table.amounts, dtype=float)
    estimate = _quantile_estimate(_runs_needed(amounts, mean), _runs_needed(amounts, drawn), table.runs, limits)
    differences = table.compare([[(1.0, NO_MODEL, k), (-1.0, model, place)] for k in range(len(amounts))])
    alike = amounts[(differences.above > SIGNIFICANT) & (differences.below > SIGNIFICANT)]
    return replace(estimate, low=min([estimate.low, *alike]), high=max([estimate.high, *alike]))


def _runs_needed(amounts: Array, values: Array) -> Array:
    """Amounts (B,) at which curves reach a level, along their logarithms; values (B, amounts and level)."""
    logs = np.log(values)
    curves = np.minimum.accumulate(logs[:, :-1], axis=1)[:, ::-1]  # rising, as `interp` takes them
    least_first = np.log(amounts)[::-1]
    return np.exp([np.interp(goal, curve, least_first) for curve, goal in zip(curves, logs[:, -1], strict=True)])
