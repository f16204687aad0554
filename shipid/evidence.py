"""Evidence by levels: test manoeuvres, draws of training runs, worlds; and how easily chance makes a difference.

The variance of a mean is that over test manoeuvres, which count alike, and that over draws of the training runs: two
crossed factors (Owen 2007, Annals of Applied Statistics 1). Their degrees of freedom are those of Satterthwaite (1946).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, stdtr, stdtrit

from shipid.metrics import Array, coverage_by_run

SIGNIFICANT = 0.025  # of one side: an interval of 95 % is free of 0
FEWEST_RUNS = 5  # test manoeuvres below which no interval is given
FEWEST_WORLDS = 3  # below which no interval over worlds is given
SMALLEST_ERROR = 1e-9  # m: errors below count as this one, which has a logarithm and can be divided by
ROUNDING = 1e-9  # of the mean: a smaller spread between manoeuvres is none
FEWEST_MODELS = 5  # whose order by A says anything: that of fewer comes by chance too often
DOUBT = 0.5  # of the standard error of a slope: widths on worlds of `quick` (record worlds)
TRAINING = 0.03  # relative sd of H between trainings, assumed where no amount of data was drawn twice


@dataclass(frozen=True)
class Differences:
    """Differences (J,) of errors over test manoeuvres, of their logarithms by default.

    mean, low, high : with the 95 % interval of each.
    above, below : chance of a difference as far above 0, or as far below, if there were none (one-sided p-values).
    """

    mean: Array
    low: Array
    high: Array
    above: Array
    below: Array


def paired_difference(differences: Array, noise: Array | float = 0.0, freedom: float = np.inf) -> Differences:
    """Student's intervals and chances of mean differences; only means with fewer than `FEWEST_RUNS` manoeuvres.

    differences : (J, R) in each test manoeuvre; each counts alike. noise : variance that other training runs give
    these means, (J,) or one for all, with its degrees of freedom.
    """
    mean, runs = differences.mean(axis=1), differences.shape[1]
    if runs < FEWEST_RUNS:
        blank = np.full_like(mean, np.nan)
        return Differences(mean, blank, blank, blank, blank)
    spread = differences.std(axis=1, ddof=1)
    tests = np.where(spread <= ROUNDING * np.abs(mean), 0.0, np.square(spread)) / runs
    variance = tests + noise
    degrees = np.full_like(mean, runs - 1.0)
    squares = np.square(tests) / (runs - 1) + np.square(noise) / freedom
    np.divide(np.square(variance), squares, out=degrees, where=squares > 0)
    wide = stdtrit(degrees, 1 - SIGNIFICANT) * np.sqrt(variance)
    far = mean / np.maximum(np.sqrt(variance), 1e-12 * np.abs(mean) + 1e-300)
    return Differences(mean, mean - wide, mean + wide, stdtr(degrees, -far), stdtr(degrees, far))


def draw_variance(
    by_draw: Sequence[Array], amounts: Sequence[int], pool: float, place: int, fall: float = 1.0
) -> tuple[Array | float, float]:
    """Variance that other training runs give a mean over the draws of one amount of data, and its degrees of freedom.

    Up to the largest amount that was drawn several times it falls as 1 / N_D, estimated from all of them; 0 degrees of
    freedom where none was. Draws of one pool share runs, and scatter less by 1 - N_D / pool than those of other pools
    (Cochran 1977, section 2.6): so there is an estimate where all runs are used.

    Parameters
    ----------
    by_draw : for each amount the means (S, J) of its draws. pool : runs from which all are drawn.
    place : of the amount. fall : factor beyond the largest amount that was drawn several times, as of `fall_beyond`.
    """
    squares, freedom, known, amount = 0.0, 0.0, 0, amounts[place]
    for drawn, values in zip(amounts, by_draw, strict=True):
        if len(values) > 1 and drawn < pool:
            squares = squares + drawn * np.square(values - values.mean(axis=0)).sum(axis=0) / (1 - drawn / pool)
            freedom, known = freedom + len(values) - 1, max(known, drawn)
    share = min(amount / max(pool, 1), 1.0)
    alike = ((1 - share) / len(by_draw[place]) + share) / amount * (fall if amount > known else 1.0)
    return squares * alike / max(freedom, 1.0), freedom


def fall_beyond(curve: Sequence[Array], amounts: Sequence[int], pool: float, place: int) -> float:
    """Factor, 1 at most, by which a variance between draws falls faster than 1 / N_D from one amount to the next.

    To first order other runs move the logarithm of an error as more or fewer runs would: by the slope of the learning
    curve. The variance falls as its square, which becomes small near a floor. Each slope is taken `DOUBT` of its
    standard error to the side of a larger factor. 1 where there are fewer than three amounts.

    curve : logarithms (S, 1) of errors at each amount, a row a draw.
    """
    if place < 2:
        return 1.0
    ends = slice(place - 2, place + 1)
    noise = np.array([np.sum(draw_variance(curve, amounts, pool, k)[0]) for k in range(len(amounts))])[ends]
    falls = np.abs(np.diff([draws.mean() for draws in curve[ends]])) + [-DOUBT, DOUBT] * np.sqrt(noise[1:] + noise[:-1])
    before, last = falls / np.diff(np.log(amounts[ends]))
    return float(min(1.0, last / max(before, 1e-9)) ** 2)


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


def world_interval(values: Array) -> tuple[float, float]:
    """Student's 95 % interval of a mean over worlds, which are independent; NaN from fewer than `FEWEST_WORLDS`."""
    if len(values) < FEWEST_WORLDS:
        return np.nan, np.nan
    wide = float(stdtrit(len(values) - 1, 1 - SIGNIFICANT) * values.std(ddof=1) / len(values) ** 0.5)
    return float(values.mean()) - wide, float(values.mean()) + wide


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


@dataclass(frozen=True, eq=False)
class CellErrors:
    """Mean error (R,) [m] of one cell in every test manoeuvre, and the windows (R,) of each.

    trained : whether another training would change the errors. world : test manoeuvres of two worlds are not the same
    ones. seed : of the draw of its runs. share : of the runs that could train, those that did.
    """

    model: str
    errors: Array
    windows: Array
    trained: bool = True
    world: str = ""
    seed: int = 0
    share: float = 1.0

    @property
    def mean(self) -> float:
        """Mean error [m] over all windows."""
        return float(self.errors @ self.windows / self.windows.sum())


@dataclass(frozen=True)
class CellDifference:
    """By how much errors of cells are above those of others [%]: a geometric mean over test manoeuvres.

    low, high, above, below : 95 % interval and one-sided chances. runs, better : test manoeuvres, and those with a
    lower error. worlds : (W,) logarithm of the ratio in each world; `percent_above` gives the others.
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
    """Compare cells with others, pair by pair, by logarithms; every pair and every test manoeuvre weighs the same.

    Draws of the training runs count where there are several; with one, `TRAINING` is assumed.
    """
    by_world: dict[str, list[tuple[CellErrors, CellErrors]]] = {}
    for pair in zip(mine, others, strict=True):
        by_world.setdefault(pair[0].world, []).append(pair)
    count, values, noise, freedom = len(mine), list[Array](), 0.0, 0.0
    for pairs in by_world.values():
        apart = np.array([log_error(one.errors) - log_error(other.errors) for one, other in pairs])
        seeds, part = np.array([one.seed for one, _ in pairs]), len(pairs) / count
        draws = np.array([apart[seeds == seed].mean() for seed in np.unique(seeds)])
        share = max(one.share for one, _ in pairs)
        variance, known = draw_variance([draws], [1], 1 / share if share > 0 else np.inf, 0)
        moved = sum(
            cell.trained for pair in pairs for cell in pair if not np.array_equal(pair[0].errors, pair[1].errors)
        )
        noise += part**2 * (float(variance) if known else TRAINING**2 * moved / len(pairs) ** 2)
        freedom += known
        values.append(part * apart.mean(axis=0))
    runs = sum(map(len, values))
    one = paired_difference(
        np.concatenate([runs / len(each) * each for each in values])[None], noise, freedom or np.inf
    )
    mean, low, high = (percent_above(number[0]) for number in (one.mean, one.low, one.high))
    worlds = np.array([count / len(by_world[name]) * each.mean() for name, each in zip(by_world, values, strict=True)])
    better = sum(int((each < 0).sum()) for each in values)
    return CellDifference(mean, low, high, float(one.above[0]), float(one.below[0]), runs, better, worlds)


def percent_above(logarithm: float) -> float:
    """How far above 1 a ratio is [%], from its logarithm."""
    return float(100 * np.expm1(logarithm))


def log_error(errors: Array) -> Array:
    """Logarithms of errors [m]; below `SMALLEST_ERROR` they count as this one."""
    return np.log(np.maximum(errors, SMALLEST_ERROR))
