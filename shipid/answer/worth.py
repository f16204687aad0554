"""What physics is worth: how good it must be to beat none, and how many runs it saves; interpolated, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, stdtrit

from shipid.answer.error_table import PHYSICS_ONLY, ErrorTable
from shipid.evidence import FEWEST_RUNS, SEED, SIGNIFICANT, resampled_means
from shipid.study.declared import NO_MODEL

Array = NDArray[np.float64]
FEWEST_FOR_LINE = 4  # for a line of H over A
STEPS_OF_A = 400  # of A from its least to its greatest, in an interval


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
