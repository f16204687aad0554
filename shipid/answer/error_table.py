"""Errors of a study by test manoeuvre, and what physics is worth: how good it must be, and how many runs it saves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.optimize import isotonic_regression

from shipid.evidence import (
    SMALLEST_ERROR,
    TRAINING,
    Differences,
    draw_variance,
    fall_beyond,
    log_error,
    paired_difference,
)
from shipid.metrics import Array, error_at_horizon, position_error
from shipid.report.wording import REGRESSION, metres_text
from shipid.study.declared import NO_MODEL
from shipid.study.plan import Batch
from shipid.study.results import Results

Metric = Literal["H", "H_90", "H_end"]
PHYSICS_ONLY = -1  # place of the physics alone in a term
ErrorTerm = tuple[float, str, int]  # factor, model, place of its N_D in `amounts` or PHYSICS_ONLY
FEWEST_FOR_CURVE = 4  # models, for the lead over A
STEPS = 200  # of A, or of runs, from the least to the greatest, in an interval


@dataclass(frozen=True)
class ErrorTable:
    """Errors [m] by test manoeuvre.

    amounts : N_D, rising. counts : (R,) windows of each test manoeuvre.
    A : model -> (R,) mean error of the physics alone. H : model -> for each amount (draws, R) of the prediction.
    pool : runs from which those that train are drawn.
    """

    amounts: tuple[int, ...]
    counts: Array
    A: Mapping[str, Array]
    H: Mapping[str, Sequence[Array]]
    pool: float = np.inf

    @property
    def models(self) -> list[str]:
        """Models with a result, without the regression: it is no model, and tells nothing of how they vary."""
        return [name for name in self.H if name != REGRESSION]

    @property
    def runs(self) -> int:
        """Number of test manoeuvres R."""
        return len(self.counts)

    @property
    def weights(self) -> Array:
        """(R,) share of the windows in each manoeuvre."""
        return np.asarray(self.counts / self.counts.sum())

    def draws(self, model: str, place: int) -> Array:
        """(draws, R) errors of a model at an amount, or (1, R) of its physics alone; `SMALLEST_ERROR` at least.

        Of the physics that made the data it is 0.
        """
        return np.maximum(self.A[model][None] if place == PHYSICS_ONLY else self.H[model][place], SMALLEST_ERROR)

    def mean(self, model: str, place: int) -> float:
        """Error [m] of a model at an amount, mean over draws and windows, or of its physics alone."""
        return float(self.draws(model, place).mean(axis=0) @ self.weights)

    def metres(self, model: str, place: int) -> str:
        """Error of a model at an amount, or of its physics alone, in words."""
        return metres_text(self.mean(model, place))

    def interval(self, model: str, place: int) -> tuple[float, float]:
        """95 % interval [m] of the error of a model at an amount: that of its logarithm (delta method)."""
        mean, errors = self.mean(model, place), self.draws(model, place).mean(axis=0)
        noise, freedom = self._draw_variance(self._curve([model]), place)
        known = (noise, freedom) if freedom else (TRAINING**2 / len(self.H[model][place]), np.inf)
        one = paired_difference((self.runs * self.weights * errors / mean - 1)[None], *known)
        return mean * float(np.exp(one.low[0])), mean * float(np.exp(one.high[0]))

    def compare(
        self,
        sums: Sequence[Sequence[ErrorTerm]],
        plus: Array | float = 0.0,
        mix: Array | None = None,
        logs: bool = True,
    ) -> Differences:
        """Judge sums of logarithms of errors, each with its factor, or of errors [m] weighted by windows.

        `[(1, "none", 0), (-1, "good", 0)]` is by how much physics lowers the error. mix : (J, sums) factors of the sums
        in what is judged. plus : is added to it, (J,) or one for all.
        """
        weights = np.eye(len(sums)) if mix is None else mix
        value = log_error if logs else self._weighted
        values = np.array([self._sum(terms, PHYSICS_ONLY, value).mean(axis=0) for terms in sums])
        return paired_difference((weights @ values + np.reshape(plus, (-1, 1))), *self.noise(sums, weights, logs))

    def noise(
        self, sums: Sequence[Sequence[ErrorTerm]], mix: Array | None = None, logs: bool = True
    ) -> tuple[Array, float]:
        """Variance (J,) that other draws of runs give what `compare` judges, and its degrees of freedom."""
        weights = np.eye(len(sums)) if mix is None else mix
        value = log_error if logs else self._weighted
        noise, freedom, assumed = np.zeros(len(weights)), 0.0, np.zeros(len(weights))
        for place in {at for terms in sums for *_, at in terms} - {PHYSICS_ONLY}:
            mine = [[term for term in terms if term[2] == place] for terms in sums]
            by_draw = [
                np.stack([self._sum(terms, k, value).mean(axis=1) for terms in mine], axis=1) @ weights.T
                for k in range(len(self.amounts))
            ]
            variance, freedom = self._draw_variance(by_draw, place)
            noise += variance
            sizes = [[f * (1.0 if logs else self.mean(model, place)) for f, model, _ in terms] for terms in mine]
            each = np.array([np.square(size).sum() for size in sizes])
            assumed += TRAINING**2 * np.square(weights) @ each / len(by_draw[place])
        return (noise, freedom) if freedom else (assumed, np.inf)

    def _curve(self, models: Sequence[str]) -> list[Array]:
        """For each amount the logarithm (draws, 1) of the error, mean over models."""
        each = [[np.log(self.draws(model, k) @ self.weights) for model in models] for k in range(len(self.amounts))]
        return [np.mean(values, axis=0)[:, None] for values in each]

    def _draw_variance(self, by_draw: Sequence[Array], place: int) -> tuple[Array | float, float]:
        """As of `draw_variance`; beyond what was drawn several times it falls as all models let one expect."""
        fall = fall_beyond(self._curve(self.models), self.amounts, self.pool, place)
        return draw_variance(by_draw, self.amounts, self.pool, place, fall)

    def _sum(self, terms: Sequence[ErrorTerm], place: int, value: Callable[[Array], Array]) -> Array:
        """A sum of errors: (draws, R) of its models at an amount; (1, R) at their own, mean over draws, for none."""
        of = [
            factor * value(self.draws(model, at)).mean(axis=0, keepdims=True)
            if place == PHYSICS_ONLY
            else factor * value(self.draws(model, place))
            for factor, model, at in terms
        ]
        drawn = 1 if place == PHYSICS_ONLY else max(len(errors[place]) for errors in self.H.values())
        return np.asarray(sum(of, np.zeros((drawn, self.runs))))

    def _weighted(self, errors: Array) -> Array:
        """Errors (..., R) times what makes their mean that over windows."""
        return errors * self.weights * self.runs

    def lead(self, rival: str, models: Sequence[str], place: int) -> Differences:
        """By how much the errors of models are lower than a rival's at an amount of data, as logarithms of ratios."""
        return self.compare([[(1.0, rival, place), (-1.0, model, place)] for model in models])


def error_table(
    results: Results, models: Sequence[str], metric: Metric = "H", amounts: Sequence[int] | None = None
) -> ErrorTable:
    """Errors of models and `none` that have a result in every cell, and of the regression.

    Over the horizon (H, H_90) or at its end (H_end).

    amounts : values of N_D that count, rising; all by default.
    """
    cells = results.judged_cells
    of_path = partial(ERRORS_BY_RUN[metric], results)
    good = [cell for cell in cells["cell"] if cell in results.paths]
    errors = results.errors if metric == "H" else {cell: of_path(results.paths[cell]) for cell in good}
    amounts = sorted(set(cells["N_D"])) if amounts is None else amounts
    seeds = {N: sorted(set(cells["seed"][cells["N_D"] == N])) for N in amounts}
    keys = zip(cells["foundation"], cells["N_D"], cells["seed"], strict=True)
    known = dict(zip(keys, cells["cell"], strict=True))
    H, regressed = {}, [[results.regression.get(Batch(N, seed).key) for seed in seeds[N]] for N in amounts]
    if all(path is not None for row in regressed for path in row):
        H[REGRESSION] = [np.array([of_path(path) for path in row if path is not None]) for row in regressed]
    for name in (*models, NO_MODEL):
        mine = [[known.get((name, N, seed)) for seed in seeds[N]] for N in amounts]
        if all(cell in errors for row in mine for cell in row):
            H[name] = [np.array([errors[str(cell)] for cell in row]) for row in mine]
    alone = {
        name: of_path(path)
        for name, path in results.physics.items()
        if name in models and name != NO_MODEL and np.isfinite(path).all()
    }
    return ErrorTable(tuple(int(N) for N in amounts), results.windows, alone, H, results.pool)


def _upper_errors(results: Results, path: Array) -> Array:
    """(R,) 90th percentile [m] of the errors of a path (T, S, 2) [m] in each test manoeuvre."""
    error, run = position_error(path, results.test.future), results.test.run
    return np.array([np.quantile(error[:, run == name], 0.9) for name in np.unique(run)])


ERRORS_BY_RUN: dict[Metric, Callable[[Results, Array], Array]] = {
    "H": Results.path_errors,
    "H_90": _upper_errors,
    "H_end": lambda results, path: results.by_run(error_at_horizon(position_error(path, results.test.future))),
}


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval; the interval is not a number where there are too few test manoeuvres.

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


def _undecided_range(values: Array, differences: Differences) -> tuple[float, float]:
    """Least and greatest of rising values (J,) at which a test cannot tell a falling difference from 0 (Fieller 1954).

    A step more on both sides, since the ends lie between two values.
    """
    if np.isnan(differences.low).any():
        return np.nan, np.nan
    open_below, open_above = np.flatnonzero(differences.low <= 0), np.flatnonzero(differences.high >= 0)
    low = values[max(open_below[0] - 1, 0)] if len(open_below) else values[-1]
    high = values[min(open_above[-1] + 1, len(values) - 1)] if len(open_above) else values[0]
    return float(low), float(high)


def _level_at(table: ErrorTable, sums: Sequence[Sequence[ErrorTerm]], mix: Array, marks: Array) -> Estimate:
    """Where a falling difference is 0: mixed of sums of errors at some marks (J,), by (J, sums), and between along ln.

    Where it rises for once, the least so far counts.
    """
    tried = np.geomspace(marks[0], marks[-1], STEPS)
    between = np.stack([np.interp(np.log(tried), np.log(marks), one) for one in mix.T], axis=1)
    ahead = table.compare(sums, 0.0, between)
    curve = np.minimum.accumulate(ahead.mean)
    value = float(np.exp(np.interp(0.0, curve[::-1], np.log(tried[::-1]))))
    limits = float(marks[0]), float(marks[-1])
    value = next((end for end in limits if np.isclose(end, value)), value)
    low, high = _undecided_range(tried, ahead)
    return Estimate(value, min(low, value), max(high, value), limits)


def break_even(table: ErrorTable, models: Sequence[str], place: int) -> Estimate | None:
    """Accuracy A [m] at which compensated physics is as good as none, at the amount of this place.

    The lead over `none`, made to fall with A (isotonic regression) and interpolated along ln A, is 0 there; values
    beyond the models tried are bounds. The interval holds every A at which the test cannot tell it from 0, A of every
    model that `lead` does not show to be better, or worse, as the order has it, and what other manoeuvres make of A
    (Zou and Donner 2008). None with fewer than four models, or where all have the same A.
    """
    models = sorted(models, key=lambda model: table.mean(model, PHYSICS_ONLY))
    A = np.array([table.mean(model, PHYSICS_ONLY) for model in models])
    if len(models) < FEWEST_FOR_CURVE or np.isclose(A[0], A[-1]):
        return None
    lead, pooled = table.lead(NO_MODEL, models, place), np.zeros((len(models), len(models)))
    for first, end in pairwise(isotonic_regression(lead.mean, increasing=False).blocks):
        pooled[first:end, first:end] = 1 / (end - first)
    found = _level_at(table, [[(1.0, NO_MODEL, place), (-1.0, model, place)] for model in models], pooled, A)
    harder = table.compare([[(1 / len(models), model, PHYSICS_ONLY) for model in models]])  # all A rise together
    wide = np.hypot(np.log([found.value / found.low, found.high / found.value]), (harder.high - harder.low) / 2)
    low, high = np.clip(found.value * np.exp(wide * [-1, 1]), *found.limits)
    return replace(
        found,
        low=min([found.low if found.low >= A[-1] else low, *A[lead.low <= 0]]),
        high=max([found.high if found.high <= A[0] else high, *A[lead.high >= 0]]),
    )


def runs_without_physics(table: ErrorTable, model: str, place: int) -> Estimate:
    """Runs that no physics needs for the error that a model has with the amount of this place.

    Interpolated along ln H over ln N_D; where more data made it worse, the best so far counts. The interval holds every
    number of runs at which the test cannot tell the two.
    """
    sums = [[(1.0, NO_MODEL, k)] for k in range(len(table.amounts))]
    mix = np.eye(len(sums), len(sums) + 1)
    mix[:, -1] = 1.0
    return _level_at(table, [*sums, [(-1.0, model, place)]], mix, np.array(table.amounts, dtype=float))
