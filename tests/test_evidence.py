"""Intervals over test manoeuvres: what they cover, and what corrections do by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from shipid.evidence import (
    FEWEST_RUNS,
    SIGNIFICANT,
    CellErrors,
    all_significant,
    any_significant,
    compare_cells,
    draw_variance,
    fall_beyond,
    holm_correction,
    order_chance,
    paired_difference,
    partial_conjunction,
    share_interval,
    which_significant,
    world_interval,
)


@pytest.mark.parametrize("runs", [6, 20])
@pytest.mark.parametrize("tail", ["normal", "heavy", "skewed"])
def test_intervals_cover(runs: int, tail: str) -> None:
    """Of 400 differences of mean 0, at most 5 % and what chance adds have an interval that is free of 0 on one side."""
    rng = np.random.default_rng([runs, len(tail)])
    draw = {
        "normal": lambda: rng.normal(size=(400, runs)),
        "heavy": lambda: rng.standard_t(3, (400, runs)),
        "skewed": lambda: rng.lognormal(0, 0.5, (400, runs)) - np.exp(0.125),
    }[tail]
    contrast = paired_difference(draw())
    limit = stats.binom.ppf(0.999, 400, 0.05)
    assert (contrast.low > 0).sum() <= limit
    assert (contrast.high < 0).sum() <= limit


def test_an_interval_free_of_0_and_a_small_p_value_are_the_same() -> None:
    rng = np.random.default_rng(2)
    contrast = paired_difference(rng.normal(0.4, 1.0, (300, 12)), 0.05**2)
    same = (contrast.low > 0) == (contrast.above <= SIGNIFICANT)
    assert same.mean() > 0.99, "but for the rounding of a quantile"
    assert ((contrast.high < 0) == (contrast.below <= SIGNIFICANT)).mean() > 0.99


def crossed(rng: np.random.Generator, worlds: int, amounts: dict[int, int], pool: int, runs: int) -> list[Any]:
    """Worlds without an effect: terms of test manoeuvres, and for each amount the means of its draws of training runs.

    What training runs add is their mean: of N_D runs it scatters by 1 / sqrt(N_D), and by less between draws of a pool.
    """
    each = rng.normal(0.0, 1.0, (worlds, pool))
    tests, made = rng.normal(0.0, 0.3, (worlds, runs)), []
    for amount, draws in amounts.items():
        orders = rng.permuted(np.tile(np.arange(pool), (worlds, draws, 1)), axis=2)[:, :, :amount]
        made.append(np.take_along_axis(each[:, None], orders, axis=2).mean(axis=2))
    return [tests, made]


@pytest.mark.parametrize(("draws", "place"), [({5: 4, 10: 2}, 0), ({5: 4, 10: 2}, 1), ({5: 5, 10: 3, 40: 2}, 1)])
def test_intervals_hold_what_other_worlds_give(draws: dict[int, int], place: int) -> None:
    """Of 600 worlds, 95 % and what chance leaves hold the mean over worlds, which is 0."""
    rng, pool, held = np.random.default_rng(place), 40, 0
    tests, made = crossed(rng, 600, draws, pool, 20)
    for world in range(600):
        by_draw = [each[world][:, None] for each in made]
        noise, freedom = draw_variance(by_draw, list(draws), pool, place)
        one = paired_difference((tests[world] + by_draw[place].mean())[None], noise, freedom)
        held += one.low[0] <= 0 <= one.high[0]
    assert stats.binom.ppf(0.001, 600, 0.94) <= held <= stats.binom.ppf(0.999, 600, 0.98)


def test_where_all_runs_train_the_draws_of_fewer_say_what_others_would_give() -> None:
    """By hand: one draw of all runs has the variance of a draw of a world, 1 / N_D times what the curve says."""
    draws = [np.array([[1.0], [3.0]]), np.array([[5.0], [5.0]]), np.array([[9.0]])]
    scale = (5 * 2.0 / (1 - 5 / 40) + 0.0) / 2
    for fall in (1.0, 0.3):
        noise, freedom = draw_variance(draws, [5, 10, 40], 40, 2, fall)
        assert (float(np.sum(noise)), freedom) == (pytest.approx(scale / 40 * fall), 2)
    assert draw_variance(draws, [5, 10, 40], 40, 1, 0.3) == draw_variance(draws, [5, 10, 40], 40, 1)
    assert draw_variance([draws[2], draws[0]], [10, 40], 40, 1)[1] == 0, "all draws of all runs are the same one"


@pytest.mark.parametrize(("error", "fall"), [([2, 1, 0.5], 1), ([9, 3, 2.5], 0.0275), ([3, 2.9, 1], 1)])
def test_a_variance_falls_as_the_square_of_the_slope_of_the_learning_curve(error: list[float], fall: float) -> None:
    """By hand: a power law has one slope, near a floor it is small, and no variance falls slower than 1 / N_D."""
    amounts, curve = [4, 8, 16], [np.array([[np.log(value)]]) for value in error]
    known = fall_beyond(curve, amounts, 16, 2)
    assert known == pytest.approx(fall, rel=0.01)
    assert fall_beyond([of + 1.2 for of in curve], amounts, 16, 2) == pytest.approx(known), "whatever the unit"
    assert fall_beyond(curve, amounts, 16, 1) == 1.0
    doubtful = [np.concatenate([of - 0.3, of + 0.3]) for of in curve[:2]] + curve[2:]
    assert known <= fall_beyond(doubtful, amounts, 16, 2) <= 1, "slopes that may be alike count as alike"


@pytest.mark.parametrize("floor", [0.0, 0.1])
def test_intervals_hold_where_all_runs_train_with_a_floor_and_without(floor: float) -> None:
    """Of 400 worlds: runs teach more or less, and an error of N_D runs is floor + 1 / sqrt(what they teach)."""
    rng, amounts, pool, found = np.random.default_rng(7), {10: 3, 30: 2, 100: 1}, 100, []
    for _ in range(400):
        teaches = rng.lognormal(0.0, 1.2, pool)
        error = [[floor + rng.permutation(teaches)[:N].sum() ** -0.5 for _ in range(S)] for N, S in amounts.items()]
        by_draw = [np.log(draws)[:, None] for draws in error]
        fall = fall_beyond(by_draw, list(amounts), pool, 2)
        noise, freedom = draw_variance(by_draw, list(amounts), pool, 2, fall)
        one = paired_difference((rng.normal(0.0, 0.2, 20) + by_draw[2][0])[None], noise, freedom)
        found.append((one.mean[0], one.low[0], one.high[0]))
    mean, low, high = np.array(found).T
    held = ((low <= mean.mean()) & (mean.mean() <= high)).sum()
    assert held >= stats.binom.ppf(0.001, 400, 0.92)
    assert np.median(high - low) <= 1.5 * 2 * 1.96 * mean.std()


def test_what_changes_nothing() -> None:
    """The order of manoeuvres and of draws, the unit of errors, and a manoeuvre cut into more windows."""
    rng = np.random.default_rng(3)
    errors = rng.lognormal(0.0, 0.6, (2, 4, 9))
    order, windows = rng.permutation(9), np.full(9, 7.0)

    def told(errors: np.ndarray, windows: np.ndarray) -> tuple[float, ...]:
        cells = [
            [CellErrors("one", of, windows, seed=seed, share=0.1) for seed, of in enumerate(side)] for side in errors
        ]
        one = compare_cells(*cells)
        return one.mean, one.low, one.high, one.above, one.below

    known = told(errors, windows)
    assert told(errors[:, ::-1, order], windows[order]) == pytest.approx(known)
    assert told(1000.0 * errors, windows) == pytest.approx(known)
    assert told(errors, windows * np.arange(1.0, 10.0)) == pytest.approx(known)
    turned = told(errors[::-1], windows)
    assert turned[3:] == pytest.approx(known[:2:-1])
    assert (1 + turned[0] / 100) * (1 + known[0] / 100) == pytest.approx(1.0)


def test_gains_on_every_run_are_shown_whatever_the_length_of_the_runs() -> None:
    """Gains of 50 to 87 % on every run: in metres one long and difficult run had the interval reach below 0."""
    physics = np.array([1.0, 1.1, 0.9, 1.2, 1.0, 0.8, 1.3])
    gain = np.array([0.5, 0.6, 0.7, 0.87, 0.55, 0.65, 0.8])
    hard, windows = np.array([1.0, 1.0, 9.0, 1.0, 1.0, 1.0, 1.0]), np.array([51.0, 38, 410, 31, 16, 20, 60])
    plain, good = (CellErrors("m", hard * physics * left, windows) for left in (np.ones(7), 1 - gain))
    one = compare_cells([good], [plain])
    assert one.below <= SIGNIFICANT
    assert -87 < one.low < one.mean < one.high < -50
    assert (one.better, one.runs) == (7, 7)


def test_differences_that_are_all_alike() -> None:
    contrast = paired_difference(np.array([[0.5] * 6, [0.0] * 6]))
    assert contrast.low[0] == pytest.approx(0.5)
    assert contrast.above[0] < 1e-6
    assert (contrast.low[1], contrast.high[1]) == (0.0, 0.0)
    assert contrast.above[1] >= 0.5


def test_too_few_manoeuvres_have_no_interval() -> None:
    contrast = paired_difference(np.ones((2, FEWEST_RUNS - 1)))
    assert contrast.mean.tolist() == [1.0, 1.0]
    assert np.isnan([*contrast.low, *contrast.high, *contrast.above, *contrast.below]).all()


def test_holm_by_hand() -> None:
    """0.01 x 3, then 0.02 x 2, then 0.03 x 1, never falling."""
    assert holm_correction(np.array([0.02, 0.01, 0.03])) == pytest.approx([0.04, 0.03, 0.04])
    assert holm_correction(np.array([0.5, 0.9])) == pytest.approx([1.0, 1.0])


def test_at_least_so_many() -> None:
    chances = np.array([0.001, 0.01, 0.02, 0.9])
    assert partial_conjunction(chances, 1) == pytest.approx(0.004)
    assert partial_conjunction(chances, 3) == pytest.approx(0.04)
    assert partial_conjunction(chances, 4) == pytest.approx(0.9)


def test_an_order_by_chance() -> None:
    """Five models in the very order have one of 120 orders, or half of them where nothing is alike."""
    A = np.arange(5.0)
    assert order_chance(A, np.array([[1.0, 2.0, 3.0, 4.0, 5.0]]))[0] == pytest.approx(1 / 120, abs=0.006)
    assert order_chance(A, np.array([[5.0, 4.0, 3.0, 2.0, 1.0]]))[0] == 1.0


def test_worlds() -> None:
    for few in (1, 2):
        assert np.isnan(world_interval(np.arange(1.0, 1.0 + few))).all()
    wide = 4.3027 / 3**0.5
    assert world_interval(np.array([1.0, 2.0, 3.0])) == pytest.approx((2 - wide, 2 + wide), abs=1e-3)


def test_all_need_no_correction_and_some_do() -> None:
    """0.02 for each of three: all are shown; beside one that is not, 0.02 x 3 shows none."""
    assert all_significant(np.array([0.02, 0.02, 0.02]))
    assert which_significant(np.array([0.02, 0.02, 0.02])).all()
    assert not any_significant(np.array([0.02, 0.02, 0.5]))
    assert which_significant(np.array([0.002, 0.02, 0.5])).tolist() == [True, False, False]
    assert not all_significant(np.array([]))
    assert not all_significant(np.array([np.nan]))


@pytest.mark.parametrize(("inside", "count"), [(0, 7), (3, 7), (7, 7), (18, 20)])
def test_one_window_a_run_has_the_exact_interval(inside: int, count: int) -> None:
    held, run = np.arange(count) < inside, np.arange(count)
    exact = stats.binomtest(inside, count).proportion_ci(method="exact")
    np.testing.assert_allclose(share_interval(held, run), (exact.low, exact.high), atol=1e-9)


def test_windows_that_are_alike_count_once() -> None:
    """Whole runs inside or outside: a hundred windows of each are worth no more than one."""
    once = np.arange(10) < 8
    low, high = share_interval(np.repeat(once, 100), np.repeat(np.arange(10), 100))
    np.testing.assert_allclose((low, high), share_interval(once, np.arange(10)), atol=0.02)
    rng = np.random.default_rng(0)
    apart = share_interval(rng.random(1000) < 0.8, np.repeat(np.arange(10), 100))
    assert apart[1] - apart[0] < 0.5 * (high - low)


@pytest.mark.parametrize("sizes", [(200, *[10] * 6), (5, 5, 5, 5, 5, 100), (1, 1, 1, 1, 50), (300, *[40] * 8)])
def test_a_long_run_that_is_mostly_outside_breaks_no_promise(sizes: tuple[int, ...]) -> None:
    """Bands of 90 % that hold 90 %: at most one in forty intervals lies below, whatever share one long run makes."""
    rng, run, below = np.random.default_rng(2), np.repeat(np.arange(len(sizes)), sizes), 0
    for _ in range(200):
        chance = rng.beta(0.9, 0.1, len(sizes))  # of each run; 0.9 in the mean
        held = rng.random(len(run)) < chance[run]
        below += share_interval(held, run)[1] < 0.9
    assert below <= stats.binom.ppf(0.999, 200, 0.025)
