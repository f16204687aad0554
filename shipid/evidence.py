"""Evidence of test manoeuvres: intervals of paired differences, and how easily chance makes them.

Windows of one test manoeuvre are alike, test manoeuvres are not: so manoeuvres are resampled, whole and paired (cluster
bootstrap; Davison and Hinkley 1997, section 3.8), and the difference is measured in its standard error (bootstrap-t;
Efron and Tibshirani 1993, section 12.5), which suits few manoeuvres and skewed errors. Where Student's interval is
wider, it counts. What another training would give adds to the standard error. Repeated training is no evidence: it only
averages this part out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

Array = NDArray[np.float64]
SIGNIFICANT = 0.025  # of one side: an interval of 95 % is free of 0
RESAMPLES, SEED = 1999, 0
FEWEST_RUNS = 5  # test manoeuvres below which no interval is given
FEWEST_WORLDS = 3  # below which no interval over worlds is given
LEAST_SPREAD, ROUNDING = 0.01, 1e-9  # of training and of the mean: a smaller spread between manoeuvres is none
FEWEST_MODELS = 5  # whose order by A says anything: that of fewer comes by chance too often
TRAINING, WORTH = 0.03, 4  # relative sd of H between trainings, and how many observations this number counts for


@dataclass(frozen=True)
class Contrasts:
    """Differences (J,) of mean errors over test manoeuvres.

    mean, low, high : [m], with the 95 % interval of each.
    above, below : chance of a difference as far above 0, or as far below, if there were none (one-sided p-values).
    """

    mean: Array
    low: Array
    high: Array
    above: Array
    below: Array

    def __len__(self) -> int:
        """Return how many differences there are."""
        return len(self.mean)


def contrasts(differences: Array, counts: Array, training: Array | float = 0.0) -> Contrasts:
    """Judge differences of mean errors; not a number for all but the mean with fewer than `FEWEST_RUNS` manoeuvres.

    Parameters
    ----------
    differences : (J, R) mean of each difference in each test manoeuvre [m].
    counts : (R,) windows of each manoeuvre, its weight.
    training : standard error of each difference from training alone [m], (J,) or one for all.
    """
    weights = counts / counts.sum()
    mean = differences @ weights
    if len(counts) < FEWEST_RUNS:
        blank = np.full_like(mean, np.nan)
        return Contrasts(mean, blank, blank, blank, blank)
    away, spreads, spread = _bootstrap(differences, weights)
    error, alike = np.hypot(spread, training), np.hypot(_alike(differences, weights), training)
    drawn = _distances(away, spreads, spread, _least(mean, training))
    return _judged(mean, drawn, error, alike, len(counts) - 1)


def mean_errors(errors: Array, counts: Array, training: Array | float = 0.0) -> Contrasts:
    """Mean errors over test manoeuvres with intervals that end at 0, as for `contrasts`: an error is never negative.

    What is below 0 is cut off, which costs no coverage. errors : (J, R) mean error in each test manoeuvre [m].
    """
    judged = contrasts(errors, counts, training)
    return replace(judged, low=np.maximum(judged.low, 0.0))


def contrasts_apart(
    one: Array, one_counts: Array, other: Array, other_counts: Array, training: Array | float = 0.0
) -> Contrasts:
    """Judge differences of mean errors over two sets of manoeuvres that are not the same ones: one less other.

    Each set is resampled by itself; the degrees of freedom are Welch's (1947). Not a number for all but the mean where
    either set has fewer than `FEWEST_RUNS` manoeuvres.

    Parameters
    ----------
    one, other : (J, R) and (J, Q) mean error in each test manoeuvre [m].
    one_counts, other_counts : (R,) and (Q,) windows of each manoeuvre, its weight.
    training : standard error of each difference from training alone [m], (J,) or one for all.
    """
    sides = [(one, one_counts / one_counts.sum()), (other, other_counts / other_counts.sum())]
    mean: Array = one @ sides[0][1] - other @ sides[1][1]
    if min(len(one_counts), len(other_counts)) < FEWEST_RUNS:
        blank = np.full_like(mean, np.nan)
        return Contrasts(mean, blank, blank, blank, blank)
    (here, spreads, spread), (there, more, wide) = (_bootstrap(*side, SEED + k) for k, side in enumerate(sides))
    error = np.hypot(spread, wide)
    shares = np.square(np.stack([spread, wide]) / np.maximum(error, 1e-300))
    least = min(len(one_counts), len(other_counts)) - 1
    freedom = np.maximum(
        1 / (shares[0] ** 2 / (len(one_counts) - 1) + shares[1] ** 2 / (len(other_counts) - 1) + 1e-12), least
    )
    alike = np.hypot(*(_alike(*side) for side in sides))
    drawn = _distances(here - there, np.hypot(spreads, more), error, _least(mean, training))
    return _judged(mean, drawn, np.hypot(error, training), np.hypot(alike, training), freedom)


def _judged(mean: Array, drawn: Array, error: Array, alike: Array, freedom: Array | int) -> Contrasts:
    """Intervals and chances of means from resampled distances (B, J); those of Student where they are wider.

    error, alike : (J,) standard errors, of the manoeuvres as they scatter, and if all scatter alike; Student's
        interval takes the larger one.
    """
    wide, least = np.maximum(error, alike), 1e-12 * np.abs(mean) + 1e-300
    student = stdtrit(freedom, 1 - SIGNIFICANT) * wide
    lower = np.minimum(np.quantile(drawn, SIGNIFICANT, axis=0, method="lower") * error, -student)
    upper = np.maximum(np.quantile(drawn, 1 - SIGNIFICANT, axis=0, method="higher") * error, student)
    ahead, apart = (mean / np.maximum(one, least) for one in (error, wide))
    chances = (_beyond(drawn, ahead, apart, freedom), _beyond(-drawn, -ahead, -apart, freedom))
    return Contrasts(mean, mean - upper, mean - lower, *chances)


def _alike(values: Array, weights: Array) -> Array:
    """(J,) standard errors of weighted means of values (J, R), if the values of all manoeuvres scatter alike.

    A manoeuvre with most of the windows lies near the mean because it makes the mean: its distance from it says little.
    """
    errors: Array = np.sqrt(np.square(weights).sum()) * values.std(axis=1, ddof=1)
    return errors


def _bootstrap(values: Array, weights: Array, seed: int = SEED) -> tuple[Array, Array, Array]:
    """(B, J) resampled weighted means less the mean, (B, J) their standard errors, (J,) that of the mean [m]."""
    draws = _draws(len(weights), seed)
    mean = values @ weights
    sums = weights * values  # (J, R)
    total = draws @ weights
    means = (draws @ sums.T) / total[:, None]
    squares = draws @ (sums**2).T - 2 * means * (draws @ (sums * weights).T)
    squares += means**2 * (draws @ weights**2)[:, None]
    correction = len(weights) / (len(weights) - 1)
    spread = np.sqrt(correction * np.maximum(squares, 0.0)) / total[:, None]
    here = np.sqrt(correction * np.square(sums - mean[:, None] * weights).sum(axis=1))
    return means - mean, spread, here


def _distances(away: Array, spread: Array, here: Array, least: Array) -> Array:
    """(B, J) distances from the mean in standard errors (bootstrap-t); 0 where that of the mean is at most `least`.

    One manoeuvre drawn again and again has no spread: its distance is very large.
    """
    distances: Array = np.where(here <= least, 0.0, away / np.maximum(spread, np.maximum(1e-6 * here, 1e-300)))
    return distances


def _least(mean: Array, training: Array | float) -> Array:
    """(J,) standard error [m] up to which manoeuvres count as alike: of rounding, or far below that of training."""
    least: Array = np.maximum(ROUNDING * np.abs(mean), LEAST_SPREAD * np.asarray(training))
    return least


def _beyond(drawn: Array, ahead: Array, apart: Array, freedom: Array | int) -> Array:
    """Share of resampled distances that reach the observed one, or Student's where that is larger or none reaches.

    ahead, apart : (J,) the observed mean in standard errors, as in `_judged` for the resampled ones and for Student's.
    """
    share, student = (drawn >= ahead).mean(axis=0), stdtr(freedom, -apart)
    chance: Array = np.maximum(share, student)
    return chance


@lru_cache(maxsize=8)
def _draws(runs: int, seed: int = SEED) -> Array:
    """(B, R) how often each of R manoeuvres is drawn, with replacement."""
    rng = np.random.default_rng(seed)
    return rng.multinomial(runs, np.full(runs, 1 / runs), RESAMPLES).astype(float)


def resampled_means(values: Array, counts: Array) -> Array:
    """(B, ...) weighted means of values (..., R) over resampled manoeuvres, the same resamples for all values."""
    draws = _draws(len(counts))
    means: Array = np.tensordot(draws * counts, values, axes=(1, values.ndim - 1))
    return means / (draws @ counts).reshape(-1, *[1] * (values.ndim - 1))


def over_worlds(values: Array, least: float = -np.inf, greatest: float = np.inf) -> tuple[float, float]:
    """Student's 95 % interval of a mean over worlds, which are independent; no numbers from fewer than `FEWEST_WORLDS`.

    least, greatest : what such a number can be; what lies beyond is cut off, which costs no coverage.
    """
    if len(values) < FEWEST_WORLDS:
        return np.nan, np.nan
    wide = float(stdtrit(len(values) - 1, 1 - SIGNIFICANT) * values.std(ddof=1) / len(values) ** 0.5)
    return max(float(values.mean()) - wide, least), min(float(values.mean()) + wide, greatest)


def doubling(x: Array) -> Array:
    """Weights (J,) that turn values at x, a logarithm, into their slope by least squares, for a doubling."""
    centred = x - x.mean()
    weights: Array = np.log(2) * centred / np.square(centred).sum()
    return weights


def holm(chances: Array) -> Array:
    """Return p-values (J,) corrected for their number (Holm 1979): one of them at most `SIGNIFICANT` is a finding."""
    order = np.argsort(chances)
    raised = np.maximum.accumulate(chances[order] * np.arange(len(chances), 0, -1))
    corrected = np.empty_like(chances)
    corrected[order] = np.minimum(raised, 1.0)
    return corrected


def at_least(chances: Array, count: int) -> float:
    """Return the p-value of "at least `count` of these are real" (partial conjunction; Benjamini and Heller 2008)."""
    ordered = np.sort(chances)
    return float(min(1.0, (len(chances) - count + 1) * ordered[count - 1]))


def by_chance(A: Array, values: Array) -> Array:
    """Chance (J,) of rank correlations with A as high as those of values (J, M), if models were in any order."""
    ranks = _ranks(np.vstack([A, values]))
    mine, others = ranks[0], ranks[1:]
    rng = np.random.default_rng(SEED)
    shuffled = rng.permuted(np.tile(mine, (RESAMPLES, 1)), axis=1)
    share: Array = (1 + ((shuffled @ others.T) >= others @ mine - 1e-9).sum(axis=0)) / (RESAMPLES + 1)
    return share


def _ranks(values: Array) -> Array:
    """Ranks (J, M) without their mean; ties keep their order, which no permutation prefers."""
    ranks = np.argsort(np.argsort(values, axis=1, kind="stable"), axis=1, kind="stable").astype(float)
    centred: Array = ranks - ranks.mean(axis=1, keepdims=True)
    return centred


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


def training_error(H: Sequence[Array], trained: Sequence[NDArray[np.bool_]] | None = None) -> float:
    """Standard error [m] that training alone gives a mean over cells of equal weight, from H by seed of each model.

    trained : which cells another training would change, as H; default all.
    """
    if trained is None:
        trained = [np.ones(len(values), dtype=bool) for values in H]
    cells = sum(map(len, H))
    squares = sum(values.mean() ** 2 * moved.sum() for values, moved in zip(H, trained, strict=True))
    return training_noise(H) * float(np.sqrt(squares)) / max(cells, 1)
