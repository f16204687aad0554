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
    break_even,
    error_table,
    runs_without_physics,
)
from shipid.evidence import SIGNIFICANT
from tests.answer.byhand import grid

H = {"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)}


def test_means_are_those_of_the_cells(made: Any) -> None:
    table = error_table(made(grid(H), runs=8), ["good", "bad"])
    assert (table.amounts, table.runs) == ((10, 30), 8)
    assert [table.mean("good", k) for k in (0, 1)] == pytest.approx([1.5, 1.0])
    assert table.mean("bad", PHYSICS_ONLY) == pytest.approx(6.0)
    lead = table.lead("none", ["good", "bad"], 0)
    assert np.exp(lead.mean).tolist() == pytest.approx([6.0, 3.0])
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
    assert table.mean("good", 0) == pytest.approx(results.cells.set_index("cell").loc["good+kernel-10-0", "H_end"])
    assert error_table(results, ["good"]).mean("good", 0) == pytest.approx(2.5)


def test_the_interval_of_an_error_is_that_of_its_logarithm(made: Any) -> None:
    """It is above 0 whatever one manoeuvre does, and goes with the unit of the errors."""
    results = made(grid(H), runs=8)
    table = error_table(results, ["good", "bad"])
    skewed = replace(table, H={**table.H, "bad": [of * np.array([0.01] * 7 + [9.0]) for of in table.H["bad"]]})
    low, high = skewed.interval("bad", 1)
    assert 0 < low < skewed.mean("bad", 1) < high
    feet = replace(skewed, H={name: [3.28 * of for of in values] for name, values in skewed.H.items()})
    assert feet.interval("bad", 1) == pytest.approx((3.28 * low, 3.28 * high))


def test_draws_of_few_runs_widen_every_interval(made: Any) -> None:
    """Four draws of 10 runs and one of 30: H of 10 differs by draw, and H of 30 would in another world."""
    cells = {(name, 10, seed): H[name][0] * (1 + 0.2 * seed * (name == "good")) for name in H for seed in range(4)}
    cells |= {(name, 30, 0): H[name][1] for name in H}
    study = made(cells, runs=8, planned=15)
    ragged = replace(error_table(study, ["good", "bad"]), pool=60)
    alike = replace(ragged, H={name: [of[:1] for of in values] for name, values in ragged.H.items()})
    assert [len(of) for of in ragged.H["good"]] == [4, 1]
    for place in (0, 1):
        wide, narrow = (np.subtract(*np.log(of.interval("good", place))[::-1]) for of in (ragged, alike))
        assert wide > narrow
        wide, narrow = (of.lead("none", ["good"], place) for of in (ragged, alike))
        assert wide.high[0] - wide.low[0] > narrow.high[0] - narrow.low[0]


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


def test_break_even_by_hand() -> None:
    """H = A / 2 meets 3 m at A = 6 m."""
    worth = break_even(table(A, {m: [a / 2] for m, a in A.items()} | {"none": [3.0]}, (10,)), list(A), 0)
    assert worth.value == pytest.approx(6.0)
    assert worth.low < 6.0 < worth.high
    assert not any((worth.above, worth.below))
    assert break_even(table(A, {m: [1.0] for m in [*A, "none"]}, (10,)), list(A)[:3], 0) is None


@pytest.mark.parametrize("runs", [5, 8, 20])
def test_a_limit_of_A_reaches_as_far_as_that_of_the_mean_error_of_unequal_manoeuvres(runs: int) -> None:
    """All errors rise and fall with how hard a manoeuvre is, and so does the A at which physics pays."""
    hard = np.random.default_rng(runs).lognormal(0.0, 1.0, runs)
    alone, trained = {m: a * hard for m, a in A.items()}, {m: a / 2 * hard for m, a in A.items()}
    H = {name: values[None, None] for name, values in {**trained, "none": 2.1 * hard}.items()}
    worth = break_even(ErrorTable((10,), np.ones(runs), alone, H), list(A), 0)
    assert worth.value == pytest.approx(4.2 * hard.mean())
    wide = stats.t.ppf(0.975, runs - 1) * np.log(hard).std(ddof=1) / runs**0.5
    least, most = worth.limits
    assert worth.low <= max(worth.value * np.exp(-wide), least) * (1 + 1e-9)
    assert worth.high >= min(worth.value * np.exp(wide), most) * (1 - 1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_break_even_never_disagrees_with_what_is_shown_of_a_model(seed: int) -> None:
    """Each model with a lower A than the interval holds is shown to be better, each with a larger one to be worse."""
    rng, runs = np.random.default_rng(seed), 12
    hard = rng.lognormal(0.0, 0.5, runs)
    spread = {m: rng.lognormal(0.0, 0.6) for m in A}
    H = {m: [a**0.5 * spread[m] * hard * rng.lognormal(0.0, 0.3, (4, runs))] for m, a in A.items()}
    H["none"] = [2.0 * hard * rng.lognormal(0.0, 0.3, (4, runs)) * rng.lognormal(0.0, 0.2, (4, 1))]
    errors = ErrorTable((10,), np.ones(runs), {m: a * hard for m, a in A.items()}, H, 100)
    worth, lead = break_even(errors, list(A), 0), errors.lead("none", list(A), 0)
    for k, m in enumerate(A):
        assert errors.mean(m, PHYSICS_ONLY) >= worth.low or lead.above[k] <= SIGNIFICANT
        assert errors.mean(m, PHYSICS_ONLY) <= worth.high or lead.below[k] <= SIGNIFICANT


@pytest.mark.parametrize("seed", range(8))
def test_one_bad_model_does_not_bend_the_limit(seed: int) -> None:
    """Where leads fall with A, the limit lies between the last model that is ahead and the first that is not."""
    rng = np.random.default_rng(seed)
    H = np.sort(rng.lognormal(0.0, 0.4, len(A)))
    H[-1] *= 1e3  # it diverges
    none = float(rng.uniform(H[0], H[-2]))
    worth = break_even(table(A, {m: [h] for m, h in zip(A, H, strict=True)} | {"none": [none]}, (10,)), list(A), 0)
    last = max(2.0**k for k, h in enumerate(H) if h < none)
    assert last <= worth.value <= 2 * last


@pytest.mark.parametrize(("none", "where"), [(100.0, "above"), (0.01, "below")])
def test_break_even_beyond_the_models_tried_is_a_bound(none: float, where: str) -> None:
    worth = break_even(table(A, {m: [a / 2] for m, a in A.items()} | {"none": [none]}, (10,)), list(A), 0)
    assert getattr(worth, where)
    assert worth.value == {"above": 16.0, "below": 1.0}[where]


@pytest.mark.parametrize(("none", "value"), [(1.3, 16.0), (0.8, 1.0)])
@pytest.mark.parametrize("gain", [1.0, 0.9])
def test_where_accuracy_does_not_pay_all_models_serve_or_none_does(none: float, value: float, gain: float) -> None:
    worth = break_even(
        table(A, {m: [gain**k] for k, m in enumerate(A)} | {"none": [none * gain**2]}, (10,)), list(A), 0
    )
    assert worth.value == value


def test_runs_are_interpolated_between_amounts() -> None:
    """4 m at 10 runs, 1 m at 40: 2 m takes 20."""
    worth = runs_without_physics(table(A, {"m0": [2.0, 1.0], "none": [4.0, 1.0]}, (10, 40)), "m0", 0)
    assert worth.value == pytest.approx(20.0, rel=1e-3)
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
    assert worth.value == pytest.approx(20.0, rel=1e-3)


def test_exact_physics_pays_and_no_data_replace_it() -> None:
    exact = {"m0": 0.0, "m1": 1.0, "m2": 2.0, "m3": 3.0}
    H = {name: (value, value / 2) for name, value in exact.items()}
    errors = table(exact, {**H, "none": (9.0, 4.0)}, (10, 30))
    limit = break_even(errors, list(exact), 0)
    assert limit.above
    assert runs_without_physics(errors, "m0", 0).above
    assert runs_without_physics(table(exact, {**H, "none": (9.0, 0.0)}, (10, 30)), "m0", 0).value == 30


def test_one_manoeuvre_has_no_interval() -> None:
    worth = runs_without_physics(table(A, {"m0": [2.0, 1.0], "none": [4.0, 1.0]}, (10, 40), runs=1), "m0", 0)
    assert np.isnan([worth.low, worth.high]).all()
