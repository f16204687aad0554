"""Intervals over test manoeuvres: what they cover, and what corrections do by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from shipid.evidence import (
    FEWEST_RUNS,
    SIGNIFICANT,
    TRAINING,
    at_least,
    by_chance,
    contrasts,
    contrasts_apart,
    holm,
    mean_errors,
    over_worlds,
    resampled_means,
    training_error,
    training_noise,
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
    contrast = contrasts(draw(), rng.integers(30, 60, runs).astype(float))
    limit = stats.binom.ppf(0.999, 400, 0.05)
    assert (contrast.low > 0).sum() <= limit
    assert (contrast.high < 0).sum() <= limit


UNEQUAL = [(1, 1, 1, 1, 50), (200, *[10] * 6), (1, 2, 30, 4, 50, 1, 1, 7), (*[1] * 10, 30, 30), (51, 38, 31, 16, 3)]


@pytest.mark.parametrize("windows", UNEQUAL)
@pytest.mark.parametrize("paired", [True, False])
def test_intervals_cover_where_few_manoeuvres_have_most_of_the_windows(windows: tuple[int, ...], paired: bool) -> None:
    """As above: a long manoeuvre is near the mean because it makes the mean, and proves no more than a short one."""
    rng, counts = np.random.default_rng(len(windows)), np.array(windows, dtype=float)
    one, other = (rng.normal(size=(1000, len(windows))) for _ in range(2))
    contrast = contrasts(one, counts) if paired else contrasts_apart(one, counts, other, counts[::-1])
    limit = stats.binom.ppf(0.999, 1000, 0.025)
    assert (contrast.low > 0).sum() <= limit
    assert (contrast.high < 0).sum() <= limit
    assert ((contrast.low > 0) == (contrast.above <= SIGNIFICANT)).mean() > 0.99


@pytest.mark.parametrize("runs", [5, 12])
@pytest.mark.parametrize("spread", [0.3, 0.6, 1.0])
def test_intervals_of_errors_are_never_below_0_and_cover_as_before(runs: int, spread: float) -> None:
    """2,000 sets of errors with the mean 1, the more skewed the larger `spread`: no interval that held 1 loses it."""
    errors = np.random.default_rng(runs).lognormal(-(spread**2) / 2, spread, (2000, runs))
    before, cut = contrasts(errors, np.ones(runs)), mean_errors(errors, np.ones(runs))
    assert (cut.low >= 0).all()
    if (runs, spread) == (5, 1.0):
        assert (before.low < 0).mean() > 0.5, "there is something to cut off"
    held = (cut.low <= 1) & (cut.high >= 1)
    np.testing.assert_array_equal(held, (before.low <= 1) & (before.high >= 1))
    assert held.mean() > {0.3: 0.94, 0.6: 0.92, 1.0: 0.88}[spread], "of 95 %: few skewed errors hide their mean"


def test_an_interval_free_of_0_and_a_small_p_value_are_the_same() -> None:
    rng = np.random.default_rng(2)
    contrast = contrasts(rng.normal(0.4, 1.0, (300, 12)), np.ones(12), 0.05)
    same = (contrast.low > 0) == (contrast.above <= SIGNIFICANT)
    assert same.mean() > 0.99, "but for the rounding of a quantile"
    assert ((contrast.high < 0) == (contrast.below <= SIGNIFICANT)).mean() > 0.99


def test_student_for_normal_differences_by_hand() -> None:
    values = np.random.default_rng(3).normal(1.0, 1.0, (1, 30))
    contrast = contrasts(values, np.ones(30))
    wide = stats.t.ppf(0.975, 29) * values.std(ddof=1) / 30**0.5
    assert contrast.low[0] <= values.mean() - wide + 1e-9
    assert contrast.high[0] == pytest.approx(values.mean() + wide, rel=0.15)


def test_weights_are_windows_and_training_widens() -> None:
    values = np.array([[1.0, 2.0, 3.0, 4.0, 5.0]])
    assert contrasts(values, np.array([1.0, 1.0, 1.0, 1.0, 4.0])).mean[0] == pytest.approx(30 / 8)
    narrow, wide = contrasts(values, np.ones(5)), contrasts(values, np.ones(5), 2.0)
    assert wide.low[0] < narrow.low[0]
    assert wide.high[0] > narrow.high[0]
    assert wide.above[0] > narrow.above[0]


def test_differences_that_are_all_alike() -> None:
    contrast = contrasts(np.array([[0.5] * 6, [0.0] * 6]), np.ones(6))
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
    for judged in (
        mean_errors(errors, counts, training),
        contrasts_apart(errors, counts, np.zeros_like(errors), counts, training),
    ):
        for side in (judged.high - judged.mean, judged.mean - judged.low):
            assert (side >= stats.norm.ppf(0.975) * training * (1 - 1e-9)).all()
            assert (side <= 1.05 * stats.t.ppf(0.975, runs - 1) * training).all()
    alone = mean_errors(np.full((1, runs), size), counts)
    assert (alone.low[0], alone.high[0]) == pytest.approx((size, size))


@pytest.mark.parametrize(("runs", "others"), [(6, 6), (6, 30), (20, 8)])
def test_intervals_of_manoeuvres_that_are_no_pairs_cover(runs: int, others: int) -> None:
    """As above, for two sets of manoeuvres of unequal number and spread."""
    rng = np.random.default_rng([runs, others])
    one, other = rng.normal(2.0, 1.0, (400, runs)), rng.lognormal(0, 0.5, (400, others)) + 2.0 - np.exp(0.125)
    contrast = contrasts_apart(one, np.ones(runs), other, rng.integers(30, 60, others).astype(float))
    limit = stats.binom.ppf(0.999, 400, 0.05)
    assert (contrast.low > 0).sum() <= limit
    assert (contrast.high < 0).sum() <= limit


@pytest.mark.parametrize(("runs", "others"), [(7, 60), (60, 7), (12, 25)])
@pytest.mark.parametrize("ratio", [0.05, 1.0, 20.0])
def test_welch_for_normal_errors_by_hand(runs: int, others: int, ratio: float) -> None:
    """Sets of unequal number and spread, of the quantiles of a normal distribution: the interval is Welch's."""
    one, other = (stats.norm.ppf((np.arange(n) + 0.5) / n) for n in (runs, others))
    one, other = 3.0 + one, 1.0 + ratio * other
    contrast = contrasts_apart(one[None], np.ones(runs), other[None], np.ones(others))
    welch = stats.ttest_ind(one, other, equal_var=False).confidence_interval()
    wide = (welch.high - welch.low) / 2
    assert contrast.mean[0] == pytest.approx(2.0)
    assert wide * (1 - 1e-6) <= contrast.mean[0] - contrast.low[0] <= 1.15 * wide
    assert wide * (1 - 1e-6) <= contrast.high[0] - contrast.mean[0] <= 1.15 * wide


def test_pairs_are_narrower_than_manoeuvres_apart() -> None:
    """What is hard in both runs cancels in pairs alone; the mean is the same, and turning round changes the sign."""
    rng = np.random.default_rng(5)
    hard = rng.lognormal(0, 0.6, (50, 12))
    one, other, counts = 1.2 * hard, hard + rng.normal(0, 0.05, hard.shape), np.ones(12)
    paired, apart = contrasts(one - other, counts), contrasts_apart(one, counts, other, counts)
    np.testing.assert_allclose(apart.mean, paired.mean)
    assert np.median((apart.high - apart.low) / (paired.high - paired.low)) > 3
    back = contrasts_apart(other, counts, one, counts)
    np.testing.assert_allclose(back.mean, -apart.mean)
    np.testing.assert_allclose(back.high, -apart.low, rtol=0.2, atol=0.1)
    wide = contrasts_apart(one, counts, other, counts, 1.0)
    assert (wide.high - wide.low > apart.high - apart.low).all()


def test_a_set_without_spread_and_one_that_is_too_small() -> None:
    same = contrasts_apart(np.ones((1, 6)), np.ones(6), np.full((1, 8), 0.5), np.ones(8))
    assert (same.mean[0], same.low[0], same.high[0]) == pytest.approx((0.5, 0.5, 0.5))
    few = contrasts_apart(np.ones((1, 9)), np.ones(9), np.ones((1, FEWEST_RUNS - 1)), np.ones(FEWEST_RUNS - 1))
    assert few.mean[0] == pytest.approx(0.0)
    assert np.isnan([few.low[0], few.high[0], few.above[0], few.below[0]]).all()


def test_too_few_manoeuvres_have_no_interval() -> None:
    contrast = contrasts(np.ones((2, FEWEST_RUNS - 1)), np.ones(FEWEST_RUNS - 1))
    assert contrast.mean.tolist() == [1.0, 1.0]
    assert np.isnan([*contrast.low, *contrast.high, *contrast.above, *contrast.below]).all()
    assert len(contrast) == 2


def test_holm_by_hand() -> None:
    """0.01 x 3, then 0.02 x 2, then 0.03 x 1, never falling."""
    assert holm(np.array([0.02, 0.01, 0.03])) == pytest.approx([0.04, 0.03, 0.04])
    assert holm(np.array([0.5, 0.9])) == pytest.approx([1.0, 1.0])


def test_at_least_so_many() -> None:
    chances = np.array([0.001, 0.01, 0.02, 0.9])
    assert at_least(chances, 1) == pytest.approx(0.004)
    assert at_least(chances, 3) == pytest.approx(0.04)
    assert at_least(chances, 4) == pytest.approx(0.9)


def test_an_order_by_chance() -> None:
    """Five models in the very order have one of 120 orders, or half of them where nothing is alike."""
    A = np.arange(5.0)
    assert by_chance(A, np.array([[1.0, 2.0, 3.0, 4.0, 5.0]]))[0] == pytest.approx(1 / 120, abs=0.006)
    assert by_chance(A, np.array([[5.0, 4.0, 3.0, 2.0, 1.0]]))[0] == 1.0


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


def test_the_error_that_training_gives_a_mean_over_cells() -> None:
    """That of the mean of all cells, drawn again and again; cells that another training leaves alone add nothing."""
    rng, sizes = np.random.default_rng(6), (3.0, 1.0, 6.0)
    alone = [np.array([size]) for size in sizes]
    means = np.mean([size * (1 + TRAINING * rng.normal(size=20_000)) for size in sizes], axis=0)
    assert training_error(alone) == pytest.approx(means.std(), rel=0.03)
    pairs = [np.full(2, size) for size in sizes]
    assert training_error(pairs) == pytest.approx(training_noise(pairs) * np.sqrt(2 * 46) / 6)
    moved = [np.array([change]) for change in (True, True, False)]
    assert training_error(alone, moved) == pytest.approx(TRAINING * np.sqrt(10) / 3)
    assert training_error([]) == 0.0


def test_worlds() -> None:
    for few in (1, 2):
        assert np.isnan(over_worlds(np.arange(1.0, 1.0 + few))).all()
    wide = 4.3027 / 3**0.5
    assert over_worlds(np.array([1.0, 2.0, 3.0])) == pytest.approx((2 - wide, 2 + wide), abs=1e-3)
    assert over_worlds(np.array([1.0, 2.0, 3.0]), 0.0, 3.5) == (0.0, 3.5)
