"""Intervals over test manoeuvres: what they cover, and what corrections do by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from shipid.evidence import (
    FEWEST_RUNS,
    SIGNIFICANT,
    TRAINING,
    all_significant,
    any_significant,
    holm_correction,
    order_chance,
    paired_difference,
    partial_conjunction,
    resampled_means,
    share_interval,
    training_noise,
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
    contrast = paired_difference(draw(), rng.integers(30, 60, runs).astype(float))
    limit = stats.binom.ppf(0.999, 400, 0.05)
    assert (contrast.low > 0).sum() <= limit
    assert (contrast.high < 0).sum() <= limit


UNEQUAL = [(1, 1, 1, 1, 50), (200, *[10] * 6), (1, 2, 30, 4, 50, 1, 1, 7), (*[1] * 10, 30, 30), (51, 38, 31, 16, 3)]


@pytest.mark.parametrize("windows", UNEQUAL)
def test_intervals_cover_where_few_manoeuvres_have_most_of_the_windows(windows: tuple[int, ...]) -> None:
    """As above: a long manoeuvre is near the mean because it makes the mean, and proves no more than a short one."""
    rng, counts = np.random.default_rng(len(windows)), np.array(windows, dtype=float)
    contrast = paired_difference(rng.normal(size=(1000, len(windows))), counts)
    limit = stats.binom.ppf(0.999, 1000, 0.025)
    assert (contrast.low > 0).sum() <= limit
    assert (contrast.high < 0).sum() <= limit
    assert ((contrast.low > 0) == (contrast.above <= SIGNIFICANT)).mean() > 0.99


def test_an_interval_free_of_0_and_a_small_p_value_are_the_same() -> None:
    rng = np.random.default_rng(2)
    contrast = paired_difference(rng.normal(0.4, 1.0, (300, 12)), np.ones(12), 0.05)
    same = (contrast.low > 0) == (contrast.above <= SIGNIFICANT)
    assert same.mean() > 0.99, "but for the rounding of a quantile"
    assert ((contrast.high < 0) == (contrast.below <= SIGNIFICANT)).mean() > 0.99


def test_weights_are_windows_and_training_widens() -> None:
    values = np.array([[1.0, 2.0, 3.0, 4.0, 5.0]])
    assert paired_difference(values, np.array([1.0, 1.0, 1.0, 1.0, 4.0])).mean[0] == pytest.approx(30 / 8)
    narrow, wide = paired_difference(values, np.ones(5)), paired_difference(values, np.ones(5), 2.0)
    assert wide.low[0] < narrow.low[0]
    assert wide.high[0] > narrow.high[0]
    assert wide.above[0] > narrow.above[0]


def test_differences_that_are_all_alike() -> None:
    contrast = paired_difference(np.array([[0.5] * 6, [0.0] * 6]), np.ones(6))
    assert contrast.low[0] == pytest.approx(0.5)
    assert contrast.above[0] < 1e-6
    assert (contrast.low[1], contrast.high[1]) == (0.0, 0.0)
    assert contrast.above[1] >= 0.5


@pytest.mark.parametrize("size", [0.0016, 0.3, 7.0])
@pytest.mark.parametrize("spread", [0.0, 1e-15, 1e-6, 1e-4])
@pytest.mark.parametrize("runs", [5, 6, 9, 20])
def test_errors_that_differ_by_far_less_than_training_have_the_interval_of_training(
    runs: int, spread: float, size: float
) -> None:
    """Equal but for rounding, they had an interval up to 30,000 times the error: rounding was measured by rounding."""
    errors = size * (1 + spread * np.random.default_rng(runs).normal(size=(40, runs)))
    counts, training = np.random.default_rng(1).integers(3, 60, runs).astype(float), 0.03 * size
    one = paired_difference(errors, counts, training)
    for side in (one.high - one.mean, one.mean - one.low):
        assert (side >= stats.norm.ppf(0.975) * training * (1 - 1e-9)).all()
        assert (side <= 1.05 * stats.t.ppf(0.975, runs - 1) * training).all()
    alone = paired_difference(np.full((1, runs), size), counts)
    assert (alone.low[0], alone.high[0]) == pytest.approx((size, size))


def test_too_few_manoeuvres_have_no_interval() -> None:
    contrast = paired_difference(np.ones((2, FEWEST_RUNS - 1)), np.ones(FEWEST_RUNS - 1))
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


def test_resampled_means_keep_pairs() -> None:
    values = np.random.default_rng(4).normal(size=(2, 3, 7))
    drawn = resampled_means(np.concatenate([values, values + 1.0]), np.arange(1.0, 8.0))
    assert drawn.shape[1:] == (4, 3)
    np.testing.assert_allclose(drawn[:, 2:] - drawn[:, :2], 1.0)


def test_noise_of_training() -> None:
    """One seed says nothing; many seeds of many models take the place of what is assumed."""
    assert training_noise([np.array([2.0]), np.array([3.0])]) == pytest.approx(TRAINING)
    assert training_noise([np.zeros(3)]) == pytest.approx(TRAINING), "without any error there is no share of it"
    rng = np.random.default_rng(5)
    many = [rng.normal(2.0, 0.2, 5) for _ in range(200)]
    assert training_noise(many) == pytest.approx(0.1, rel=0.1)


def test_worlds() -> None:
    for few in (1, 2):
        assert np.isnan(world_interval(np.arange(1.0, 1.0 + few))).all()
    wide = 4.3027 / 3**0.5
    assert world_interval(np.array([1.0, 2.0, 3.0])) == pytest.approx((2 - wide, 2 + wide), abs=1e-3)
    assert world_interval(np.array([1.0, 2.0, 3.0]), 0.0, 3.5) == (0.0, 3.5)


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
