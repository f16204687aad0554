"""What physics is worth, by hand and under laws that hold for all tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from scipy import stats

from shipid.answer.error_table import ErrorTable
from shipid.answer.worth import _quantile_estimate, break_even, runs_without_physics


def table(
    A: Mapping[str, float], H: Mapping[str, Sequence[float]], amounts: tuple[int, ...], runs: int = 8
) -> ErrorTable:
    """Errors that are up to a tenth lower or higher by manoeuvre, alike for all models."""
    hard = np.linspace(0.9, 1.1, runs)
    return ErrorTable(
        amounts,
        np.ones(runs),
        {name: value * hard for name, value in A.items()},
        {name: np.array(values)[:, None, None] * hard for name, values in H.items()},
    )


A = {f"m{k}": 2.0**k for k in range(5)}


@pytest.mark.parametrize("runs", [5, 8, 30])
def test_of_normal_means_the_interval_is_students(runs: int) -> None:
    """Resampled means scatter less than means do, by sqrt(1 - 1 / runs): the expansion makes up for it."""
    error = 0.7
    drawn = 4.0 + error * (1 - 1 / runs) ** 0.5 * stats.norm.ppf((np.arange(19999) + 0.5) / 19999)
    estimate = _quantile_estimate(np.array([4.0]), drawn, runs, (0.0, 100.0))
    wide = stats.t.ppf(0.975, runs - 1) * error
    assert (estimate.low, estimate.high) == pytest.approx((4.0 - wide, 4.0 + wide), abs=0.02 * wide)


def test_break_even_by_hand() -> None:
    """H = A / 2 meets 3 m at A = 6 m."""
    worth = break_even(table(A, {m: [a / 2] for m, a in A.items()} | {"none": [3.0]}, (10,)), list(A), 0)
    assert worth is not None
    assert worth.value == pytest.approx(6.0)
    assert worth.low < 6.0 < worth.high
    assert not any((worth.above, worth.below))
    assert break_even(table(A, {m: [1.0] for m in [*A, "none"]}, (10,)), list(A)[:3], 0) is None


@pytest.mark.parametrize("runs", [5, 8, 20])
def test_a_limit_of_A_reaches_as_far_as_that_of_the_mean_error_of_unequal_manoeuvres(runs: int) -> None:
    """All errors rise and fall with how hard a manoeuvre is, so ln A is that of its mean; resampling ends too early."""
    hard = np.random.default_rng(runs).lognormal(0.0, 1.0, runs)
    alone, trained = {m: a * hard for m, a in A.items()}, {m: a / 2 * hard for m, a in A.items()}
    H = {name: values[None, None] for name, values in {**trained, "none": 2.1 * hard}.items()}
    worth = break_even(ErrorTable((10,), np.ones(runs), alone, H), list(A), 0)
    assert worth is not None
    assert worth.value == pytest.approx(4.2 * hard.mean())
    without = np.log((hard.sum() - hard) / (runs - 1))
    error = np.sqrt((runs - 1) / runs * np.square(without - without.mean()).sum())
    wide = stats.t.ppf(0.975, runs - 1) * error
    least, most = worth.limits
    assert worth.low <= max(worth.value * np.exp(-wide), least) * (1 + 1e-9)
    assert worth.high >= min(worth.value * np.exp(wide), most) * (1 - 1e-9)


@pytest.mark.parametrize(("none", "where"), [(100.0, "above"), (0.01, "below")])
def test_break_even_beyond_the_models_tried_is_a_bound(none: float, where: str) -> None:
    worth = break_even(table(A, {m: [a / 2] for m, a in A.items()} | {"none": [none]}, (10,)), list(A), 0)
    assert worth is not None
    assert getattr(worth, where)
    assert worth.value == {"above": 16.0, "below": 1.0}[where]


@pytest.mark.parametrize(("none", "value"), [(1.3, 16.0), (0.8, 1.0)])
@pytest.mark.parametrize("gain", [1.0, 0.9])
def test_where_accuracy_does_not_pay_all_models_serve_or_none_does(none: float, value: float, gain: float) -> None:
    worth = break_even(
        table(A, {m: [gain**k] for k, m in enumerate(A)} | {"none": [none * gain**2]}, (10,)), list(A), 0
    )
    assert worth is not None
    assert worth.value == value


def test_runs_are_interpolated_between_amounts() -> None:
    """4 m at 10 runs, 1 m at 40: 2 m takes 20."""
    worth = runs_without_physics(table(A, {"m0": [2.0, 1.0], "none": [4.0, 1.0]}, (10, 40)), "m0", 0)
    assert worth.value == pytest.approx(20.0)
    assert 10 < worth.low < 20 < worth.high < 40
    never = runs_without_physics(table(A, {"m0": [0.5, 0.5], "none": [4.0, 1.0]}, (10, 40)), "m0", 0)
    assert never.above
    assert never.value == 40
    at_once = runs_without_physics(table(A, {"m0": [5.0, 0.5], "none": [4.0, 1.0]}, (10, 40)), "m0", 0)
    assert at_once.below
    assert at_once.value == 10


@pytest.mark.parametrize("runs", [6, 20])
def test_runs_that_the_test_cannot_tell_from_the_model_are_in_the_interval(runs: int) -> None:
    """100 tables of one model, which is as good as no physics with the fewest runs, and no better."""
    rng, excluded, amounts = np.random.default_rng(runs), 0, (3, 8, 13)
    for _ in range(100):
        hard, level = rng.lognormal(0.0, 1.0, runs), np.array([4.0, 2.45, 1.92])
        H = {
            name: level[:, None, None] * hard * rng.lognormal(0, 0.25, runs) * rng.lognormal(0, 0.03, (3, 1, 1))
            for name in ("m0", "none")
        }
        errors = ErrorTable(amounts, np.ones(runs), {"m0": hard}, H)
        worth = runs_without_physics(errors, "m0", 0)
        differs = errors.lead("none", ["m0"], 0)
        excluded += worth.low > amounts[0]
        assert differs.above[0] <= 0.025 or differs.below[0] <= 0.025 or worth.low == amounts[0]
    assert excluded <= stats.binom.ppf(0.999, 100, 0.025)


def test_more_data_that_harm_take_nothing_back() -> None:
    worth = runs_without_physics(table(A, {"m0": [2.0] * 3, "none": [4.0, 1.0, 3.0]}, (10, 40, 80)), "m0", 0)
    assert worth.value == pytest.approx(20.0)


def test_exact_physics_pays_and_no_data_replace_it() -> None:
    exact = {"m0": 0.0, "m1": 1.0, "m2": 2.0, "m3": 3.0}
    H = {name: (value, value / 2) for name, value in exact.items()}
    errors = table(exact, {**H, "none": (9.0, 4.0)}, (10, 30))
    limit = break_even(errors, list(exact), 0)
    assert limit is not None
    assert limit.above
    assert runs_without_physics(errors, "m0", 0).above
    assert runs_without_physics(table(exact, {**H, "none": (9.0, 0.0)}, (10, 30)), "m0", 0).value == 30


def test_one_manoeuvre_has_no_interval() -> None:
    worth = runs_without_physics(table(A, {"m0": [2.0, 1.0], "none": [4.0, 1.0]}, (10, 40), runs=1), "m0", 0)
    assert np.isnan([worth.low, worth.high]).all()
