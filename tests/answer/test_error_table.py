"""Errors by test manoeuvre: the means of a study are the weighted means of its table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from shipid.answer.error_table import (
    PHYSICS_ONLY,
    ErrorTable,
    _quantile_estimate,
    break_even,
    error_table,
    runs_without_physics,
)
from tests.answer.byhand import grid

H = {"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)}


def test_means_are_those_of_the_cells(made: Any) -> None:
    table = error_table(made(grid(H), runs=8), ["good", "bad"])
    assert (table.amounts, table.runs) == ((10, 30), 8)
    assert [table.mean("good", k) for k in (0, 1)] == pytest.approx([1.5, 1.0])
    assert table.mean("bad", PHYSICS_ONLY) == pytest.approx(6.0)
    lead = table.lead("none", ["good", "bad"], 0)
    assert lead.mean.tolist() == pytest.approx([7.5, 6.0])
    assert (lead.low > 0).all()


def test_a_model_without_a_result_in_every_cell_is_not_there(made: Any) -> None:
    table = error_table(made(grid({**H, "bad": (3.0, None)}), runs=8), ["good", "bad"])
    assert set(table.H) == {"good", "none"}


def test_percentiles_are_taken_within_manoeuvres(made: Any) -> None:
    curves = {("good", 10, 0): [0.0, 0.0, 0.0, 10.0]}
    table = error_table(made(grid(H), curves=curves, runs=8), ["good"], "H_90")
    assert table.mean("good", 0) == pytest.approx(np.quantile([0.0, 0.0, 0.0, 10.0], 0.9))


def test_the_error_at_the_horizon_is_that_of_the_last_step(made: Any) -> None:
    results = made(grid(H), curves={("good", 10, 0): [0.0, 0.0, 0.0, 10.0]}, runs=8)
    table = error_table(results, ["good"], "H_end")
    assert table.mean("good", 0) == pytest.approx(10.0)
    assert table.mean("good", 0) == pytest.approx(results.cells.set_index("cell").loc["good+drawn-10-0", "H_end"])
    assert error_table(results, ["good"]).mean("good", 0) == pytest.approx(2.5)


def test_an_interval_of_an_error_is_that_of_its_difference_to_0_without_what_is_below_0(made: Any) -> None:
    results = made(grid(H), runs=8)
    table = error_table(results, ["good", "bad"])
    unbound = table.compare([[(1.0, "bad", 1)]])
    assert table.interval("bad", 1) == pytest.approx((unbound.low[0], unbound.high[0]), rel=1e-12)
    skewed = replace(table, H={**table.H, "bad": table.H["bad"] * np.array([0.01] * 7 + [9.0])})
    assert skewed.compare([[(1.0, "bad", 1)]]).low[0] < 0, "most of the error is in one manoeuvre"
    low, high = skewed.interval("bad", 1)
    assert low == 0 < skewed.mean("bad", 1) < high


def test_physics_alone_makes_the_training_noise_of_others_no_smaller(made: Any) -> None:
    """Its seeds are alike, since it learns nothing: they say nothing of models that do."""
    by_seed = {"good": (1.0, 1.5), "bad": (2.0, 3.0), "none": (4.0, 6.0)}
    learned = {(name, 10, seed): H for name, both in by_seed.items() for seed, H in enumerate(both)}
    still = {("still", 10, seed): 6.0 for seed in range(2)}
    methods = {"method": [{"name": "drawn", "kind": "path-drawn"}, {"name": "alone", "kind": "alone"}]}
    alone = dict.fromkeys(("good", "bad", "still"), 6.0)
    results = made(learned | still, alone=alone, runs=8, planned=8, changes=methods)
    cells = results.cells
    mixed = replace(results, cells=cells.assign(method=cells["method"].where(cells["model"] != "still", "alone")))
    table = error_table(mixed, ["good", "bad"])
    without = error_table(made(learned, runs=8), ["good", "bad"])
    for name in by_seed:
        assert table.interval(name, 0) == without.interval(name, 0)


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
