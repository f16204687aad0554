"""Evidence of test manoeuvres: intervals of paired differences, and how easily chance makes them.

Test manoeuvres are resampled, whole and paired (cluster bootstrap; Davison and Hinkley 1997, section 3.8), in standard
errors (bootstrap-t; Efron and Tibshirani 1993, section 12.5). Where Student's interval is wider, it counts. What
another training would give adds to the standard error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, stdtr, stdtrit

from shipid.metrics import coverage_by_run

Array = NDArray[np.float64]
SIGNIFICANT = 0.025  # of one side: an interval of 95 % is free of 0
RESAMPLES, SEED = 1999, 0
FEWEST_RUNS = 5  # test manoeuvres below which no interval is given
FEWEST_WORLDS = 3  # below which no interval over worlds is given
LEAST_SPREAD, ROUNDING = 0.01, 1e-9  # of training and of the mean: a smaller spread between manoeuvres is none
FEWEST_MODELS = 5  # whose order by A says anything: that of fewer comes by chance too often
TRAINING, WORTH = 0.03, 4  # relative sd of H between trainings, and how many observations this number counts for


@dataclass(frozen=True)
class Differences:
    """Differences (J,) of mean errors over test manoeuvres.

    mean, low, high : [m], with the 95 % interval of each.
    above, below : chance of a difference as far above 0, or as far below, if there were none (one-sided p-values).
    """

    mean: Array
    low: Array
    high: Array
    above: Array
    below: Array


def paired_difference(differences: Array, counts: Array, training: Array | float = 0.0) -> Differences:
    """Means of paired differences with intervals and chances; only means with fewer than `FEWEST_RUNS` manoeuvres.

    Parameters
    ----------
    differences : (J, R) mean of each difference in each test manoeuvre [m].
    counts : (R,) windows of each manoeuvre, its weight.
    training : standard error of each difference from training alone [m], (J,) or one for all.
    """
    weights, freedom = counts / counts.sum(), len(counts) - 1
    mean = differences @ weights
    if len(counts) < FEWEST_RUNS:
        blank = np.full_like(mean, np.nan)
        return Differences(mean, blank, blank, blank, blank)
    drawn, spread = _bootstrap_distances(differences, weights, training)
    # If all manoeuvres scatter alike: one with most of the windows lies near the mean because it makes the mean.
    alike = np.sqrt(np.square(weights).sum()) * differences.std(axis=1, ddof=1)
    error, widest = np.hypot(spread, training), np.hypot(np.maximum(spread, alike), training)
    student = stdtrit(freedom, 1 - SIGNIFICANT) * widest
    lower = np.minimum(np.quantile(drawn, SIGNIFICANT, axis=0, method="lower") * error, -student)
    upper = np.maximum(np.quantile(drawn, 1 - SIGNIFICANT, axis=0, method="higher") * error, student)
    least = 1e-12 * np.abs(mean) + 1e-300
    ahead, far = mean / np.maximum(error, least), mean / np.maximum(widest, least)
    above, below = (
        np.maximum((sign * drawn >= sign * ahead).mean(axis=0), stdtr(freedom, -sign * far)) for sign in (1, -1)
    )
    return Differences(mean, mean - upper, mean - lower, above, below)


def _bootstrap_distances(values: Array, weights: Array, training: Array | float) -> tuple[Array, Array]:
    """(B, J) resampled weighted means less the mean, in their standard errors, and (J,) the standard error of the mean.

    0 where the spread of manoeuvres is that of rounding, or far below that of training.
    """
    draws = _resampling_counts(len(weights))
    mean, sums, total = values @ weights, weights * values, draws @ weights
    means = (draws @ sums.T) / total[:, None]
    squares = draws @ (sums**2).T - 2 * means * (draws @ (sums * weights).T)
    squares += means**2 * (draws @ weights**2)[:, None]
    correction = len(weights) / (len(weights) - 1)
    spread = np.sqrt(correction * np.maximum(squares, 0.0)) / total[:, None]
    here = np.sqrt(correction * np.square(sums - mean[:, None] * weights).sum(axis=1))
    least = np.maximum(ROUNDING * np.abs(mean), LEAST_SPREAD * np.asarray(training))
    smallest = np.maximum(1e-6 * here, 1e-300)
    return np.where(here <= least, 0.0, (means - mean) / np.maximum(spread, smallest)), here


@lru_cache(maxsize=8)
def _resampling_counts(runs: int) -> Array:
    """(B, R) how often each of R manoeuvres is drawn, with replacement."""
    rng = np.random.default_rng(SEED)
    return rng.multinomial(runs, np.full(runs, 1 / runs), RESAMPLES).astype(float)


def resampled_means(values: Array, counts: Array) -> Array:
    """(B, ...) weighted means of values (..., R) over resampled manoeuvres, the same resamples for all values."""
    draws = _resampling_counts(len(counts))
    means: Array = np.tensordot(draws * counts, values, axes=(1, values.ndim - 1))
    return means / (draws @ counts).reshape(-1, *[1] * (values.ndim - 1))


def share_interval(held: NDArray[Any], run: NDArray[Any]) -> tuple[float, float]:
    """95 % interval of `coverage_share`, by Clopper and Pearson for so many windows as those of few runs are worth.

    Windows of one run are alike: their number is reduced until their variance is that between runs, never below the
    number of runs. Source: Korn and Graubard (1998), Survey Methodology 24.

    held : (S,) whether each window lies in its band. run : its run, (S,).
    """
    shares, windows = coverage_by_run(held, run), len(held)
    runs, share = len(shares), float(shares.mean())
    count = float(runs)
    if runs > 1 and 0 < share < 1:
        variance = float(shares.var(ddof=1)) / runs
        freedom = (stdtrit(max(windows - 1, 1), SIGNIFICANT) / stdtrit(runs - 1, SIGNIFICANT)) ** 2
        count = float(np.clip(freedom * share * (1 - share) / max(variance, 1e-12), runs, windows))
    inside = share * count
    low = 0.0 if inside == 0 else float(betaincinv(inside, count - inside + 1, SIGNIFICANT))
    high = 1.0 if inside >= count else float(betaincinv(inside + 1, count - inside, 1 - SIGNIFICANT))
    return low, high


def world_interval(values: Array, least: float = -np.inf, greatest: float = np.inf) -> tuple[float, float]:
    """Student's 95 % interval of a mean over worlds, which are independent; NaN from fewer than `FEWEST_WORLDS`.

    least, greatest : what such a number can be; what lies beyond is cut off, which costs no coverage.
    """
    if len(values) < FEWEST_WORLDS:
        return np.nan, np.nan
    wide = float(stdtrit(len(values) - 1, 1 - SIGNIFICANT) * values.std(ddof=1) / len(values) ** 0.5)
    return max(float(values.mean()) - wide, least), min(float(values.mean()) + wide, greatest)


def doubling_weights(x: Array) -> Array:
    """Weights (J,) that turn values at x, a logarithm, into their slope by least squares, for a doubling."""
    centred = x - x.mean()
    return np.asarray(np.log(2) * centred / np.square(centred).sum())


def holm_correction(chances: Array) -> Array:
    """Return p-values (J,) corrected for their number (Holm 1979): one of them at most `SIGNIFICANT` is a finding."""
    order = np.argsort(chances)
    raised = np.maximum.accumulate(chances[order] * np.arange(len(chances), 0, -1))
    corrected = np.empty_like(chances)
    corrected[order] = np.minimum(raised, 1.0)
    return corrected


def all_significant(chances: Array) -> bool:
    """Whether each difference is shown: "all of them" needs no correction for their number (Berger 1982)."""
    return bool(len(chances) and (chances <= SIGNIFICANT).all())


def which_significant(chances: Array) -> NDArray[np.bool_]:
    """Which differences are shown: all where each is, else those that are after Holm's correction."""
    return np.full(len(chances), True) if all_significant(chances) else holm_correction(chances) <= SIGNIFICANT


def any_significant(chances: Array) -> bool:
    """Whether at least one difference is shown, corrected for their number (Holm)."""
    return bool(which_significant(chances).any())


def partial_conjunction(chances: Array, count: int) -> float:
    """Return the p-value of "at least `count` of these are real" (Benjamini and Heller 2008)."""
    return float(min(1.0, (len(chances) - count + 1) * np.sort(chances)[count - 1]))


def order_chance(A: Array, values: Array) -> Array:
    """Chance (J,) that values (J, M) rise with A as they do, if models were in any order (Kendall's rank test)."""
    from scipy.stats import kendalltau  # its import takes longer than the rest of a page's

    return np.array([kendalltau(A, row, alternative="greater").pvalue for row in values])


def training_noise(H: Sequence[Array]) -> float:
    """Relative standard deviation [1] of H between trainings, from H by seed of several models at one amount of data.

    With one seed it is `TRAINING`, the value of bundled studies; more seeds replace it.
    """
    squares, freedom = WORTH * TRAINING**2, float(WORTH)
    for values in H:
        if len(values) > 1 and values.mean() > 0:
            squares += float(np.square(values / values.mean() - 1).sum())
            freedom += len(values) - 1
    return float(np.sqrt(squares / freedom))


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
    """Compare cells with others, pair by pair; every pair weighs the same.

    All windows and cells of a test manoeuvre, in its world, are drawn together; the interval holds another training.
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
    by_seed = [np.array(seeds, dtype=float).T for seeds in models.values()]  # means, and whether each would change
    squares = sum(means.mean() ** 2 * moved.sum() for means, moved in by_seed)
    return training_noise([means for means, _ in by_seed]) * float(np.sqrt(squares)) / len(cells)
