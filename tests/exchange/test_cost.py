"""Laws of what to buy: prices, scale, certainty, and what looking is worth, by hand and over drawn ships."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipid import figures
from shipid.answer.pages import report_content
from shipid.exchange.cost import Ways, cost_frame, cost_sentences, study_ways
from shipid.study.results import Results, read_results
from shipid.study.schema import Cost, Data

AMOUNTS = np.array([0.0, 1, 2, 4, 8, 16, 32, 64, 100])
NAMES = ("none", "template", "model test")
GOALS = ({"per_metre": 30.0}, {"H_end_required": 2.0})


def made_ways(seed: int, goal: dict[str, float], draws: int = 400, spread: float = 1.0, **cost: float) -> Ways:
    """Ships that differ in all that a curve has: A, the runs that halve it, a floor."""
    rng = np.random.default_rng(seed)
    one = rng.normal(size=(draws, 1, 1)) * spread
    A = np.array([12.0, 6.0, 2.5])[:, None] * np.exp(0.5 * spread * rng.normal(size=(draws, 3, 1)))
    error = np.hypot(0.6, A * (1 + AMOUNTS / (4 * np.exp(0.5 * one))) ** -(0.6 * np.exp(0.2 * one)))
    error[:, 0, 0] = 15.0
    block = Cost(unit="EUR", **({"run": 1.0, "mobilisation": 5.0} | cost), **goal)
    return Ways(block, NAMES, AMOUNTS, error, np.array([0.0, 3.0, 40.0]))


def test_prices_are_those_of_the_physics_and_of_runs_that_are_not_there_with_one_mobilisation() -> None:
    ways = made_ways(0, GOALS[0], run=2.0)
    assert ways.price[1].tolist() == [3, 10, 12, 16, 24, 40, 72, 136, 208]
    later = replace(ways, amounts=AMOUNTS[3:], error=ways.error[:, :, 3:])
    assert later.price[0].tolist() == [0, 8, 24, 56, 120, 192]


@pytest.mark.parametrize("goal", GOALS, ids=str)
@pytest.mark.parametrize("seed", range(5))
def test_a_decision_depends_on_no_unit_of_money_or_length(seed: int, goal: dict[str, float]) -> None:
    ways = made_ways(seed, goal)
    dearer = {name: value * (7 if name == "per_metre" else 1) for name, value in goal.items()}
    money = made_ways(seed, dearer, run=7.0, mobilisation=35.0)
    money = replace(money, prices=7 * ways.prices)
    longer = {name: value * (3 if name == "H_end_required" else 1 / 3) for name, value in goal.items()}
    length = made_ways(seed, longer)
    length = replace(length, error=3 * ways.error)
    for other, factor in ((money, 7), (length, 1)):
        np.testing.assert_allclose(other.expected, factor * ways.expected, rtol=1e-12)
        assert other.steps == {step: pytest.approx(factor * loss) for step, loss in ways.steps.items()}


@pytest.mark.parametrize("goal", GOALS, ids=str)
@pytest.mark.parametrize("seed", range(8))
def test_whoever_knows_the_ship_pays_the_least_that_is_possible(seed: int, goal: dict[str, float]) -> None:
    """All draws are the true ship: the steps, one after the other, cost what the best way costs in hindsight."""
    ways = made_ways(seed, goal, draws=1)
    ways, truth = replace(ways, error=np.repeat(ways.error, 60, axis=0)), ways.error[0]
    wanted = ways.cost.H_end_required
    good = (truth <= wanted) & (AMOUNTS > 0) if wanted else truth > 0
    least = np.min((ways.price + (0 if wanted else ways.cost.per_metre * truth))[good])  # type: ignore[operator]
    place, spent = 0, 0.0
    while True:
        paid = ways.prices == 0
        if wanted and place and truth[paid, place].min() <= wanted:
            break
        step = next(iter(ways.steps))
        if isinstance(step, int):
            spent += ways.prices[step]
            ways = replace(ways, prices=np.where(np.arange(3) == step, 0.0, ways.prices))
        elif step == "run":
            spent += ways.runs[1]
            place += 1
            ways = replace(ways, amounts=ways.amounts[1:], error=ways.error[:, :, 1:])
        else:
            break
    spent += 0.0 if wanted else ways.cost.per_metre * np.min(truth[ways.prices == 0, place])  # type: ignore[operator]
    assert spent == pytest.approx(least)


@pytest.mark.parametrize("goal", GOALS, ids=str)
@pytest.mark.parametrize("seed", range(4))
def test_dearer_prices_never_lower_what_is_paid_for_a_ship_that_is_known(seed: int, goal: dict[str, float]) -> None:
    known = [made_ways(seed, goal, draws=1, **dearer) for dearer in ({}, {"run": 1.5}, {"mobilisation": 9.0})]
    ways, *others = [replace(one, error=np.repeat(one.error, 60, axis=0)) for one in known]
    for dearer in (*others, replace(ways, prices=2 * ways.prices)):
        assert min(dearer.steps.values()) >= min(ways.steps.values())


def test_looking_is_worth_what_it_is_by_hand() -> None:
    """Half of the ships err by 1 m with no physics, half by 100 m; a model test for 40 makes it 1 m for all.

    Not knowing: 40 + 1 for all. One run for 2 tells: then half pay 2 + 1, half 2 + 40 + 1.
    """
    kind = np.tile([1.0, 1.0, 100.0, 100.0], 100)
    error = np.stack([np.repeat(kind[:, None], 2, axis=1), np.ones((400, 2))], axis=1)
    error[:, 0, 0] = 100.0
    cost = Cost(unit="EUR", run=2.0, per_metre=1.0)
    ways = Ways(cost, ("none", "test"), np.array([0.0, 1.0]), error, np.array([0.0, 40.0]))
    assert ways.expected.min() == pytest.approx(41)
    assert ways.steps == {"run": pytest.approx(23), "stop": pytest.approx(100), 1: pytest.approx(41)}
    assert next(iter(ways.steps)) == "run"
    assert next(iter(replace(ways, cost=cost.model_copy(update={"run": 30.0})).steps)) == 1


@pytest.mark.parametrize("seed", range(4))
def test_looking_at_what_all_ships_share_is_worth_nothing(seed: int) -> None:
    ways = made_ways(seed, GOALS[0], spread=0.0)
    assert min(ways.steps.values()) >= ways.expected.min() * (1 - 1e-9)


def test_towards_a_goal_a_way_goes_on_until_it_is_seen() -> None:
    """By hand: goal 2 m; the free physics gets there with 4 runs, the test (40) with 1."""
    error = np.repeat(np.array([[[9.0, 9, 5, 2, 1], [1, 1, 1, 1, 1]]]), 2, axis=0)
    cost = Cost(unit="EUR", run=3.0, mobilisation=10.0, H_end_required=2.0)
    ways = Ways(cost, ("none", "test"), np.array([0.0, 1, 2, 4, 8]), error, np.array([0.0, 40.0]))
    assert ways.steps == {"run": pytest.approx(10 + 3 * 4), 1: pytest.approx(40 + 10 + 3)}
    assert ways.reach[1].tolist() == [1] * 5


def test_towards_a_goal_runs_tell_which_ships_need_other_physics() -> None:
    """As above for half of the ships; for the others no runs help the free physics. Two runs tell them apart.

    Then half pay 10 + 3 * 4, half 10 + 3 * 2 + 40; whoever buys the test first pays 40 + 13.
    """
    error = np.array([[[9.0, 9, 5, 2, 1], [1, 1, 1, 1, 1]], [[9, 9, 9, 9, 9], [1, 1, 1, 1, 1]]])
    cost = Cost(unit="EUR", run=3.0, mobilisation=10.0, H_end_required=2.0)
    ways = Ways(cost, ("none", "test"), np.array([0.0, 1, 2, 4, 8]), np.tile(error, (50, 1, 1)), np.array([0.0, 40.0]))
    assert ways.steps == {"run": pytest.approx((22 + 56) / 2), 1: pytest.approx(53)}


def test_the_table_has_a_row_for_each_way() -> None:
    ways = made_ways(1, GOALS[1])
    table = ways.table()
    assert len(table) == 3 * len(AMOUNTS)
    assert (table["low"] <= table["H_end"]).all()
    assert (table["H_end"] <= table["high"]).all()
    assert table.groupby("foundation")["probability"].apply(lambda p: p.is_monotonic_increasing).all()


def with_cost(run: Path, **goal: float) -> Results:
    """Results of a run, as if its study had costs."""
    results = read_results(run)
    block = Cost(unit="EUR", run=20.0, foundations={"wrong": 40.0, "sister": 5.0}, **goal)
    return replace(results, plan=replace(results.plan, study=results.plan.study.model_copy(update={"cost": block})))


def test_the_ways_of_a_study_agree_with_its_cells(tiny_run: Path) -> None:
    """Errors at amounts that were run hold those of the study, times a factor, or those of constant u, v, r."""
    results = with_cost(tiny_run, H_end_required=1.0)
    ways = study_ways(results)
    assert ways.foundations == ["none", "wrong", "sister"]
    known = results.cells[results.cells["foundation"] == "none"].set_index("N_D")["H"]
    factor = (results.cells["H_end"] / results.cells["H"]).median()
    for amount, H in known.items():
        place = list(ways.amounts).index(amount)
        low, high = np.quantile(ways.error[:, 0, place], [0.025, 0.975])
        assert low < min(H, results.naive.mean()) * factor <= high * 1.0001
    alone = np.log(ways.error[:, 0, 0])
    assert 0.01 < alone.std() < 1.0, "constant u, v, r on other tests: it was known to the digit"
    widths = np.log(ways.error[:, 1:, 4]).std(axis=0)
    assert widths[1] > widths[0], "physics that was not tried is less known"


@pytest.mark.parametrize("goal", [{"per_metre": 100.0}, {"H_end_required": 1.0}, {"H_end_required": 1e-6}], ids=str)
def test_a_study_says_what_to_buy(tiny_run: Path, goal: dict[str, float]) -> None:
    content = report_content(with_cost(tiny_run, **goal))
    said = [one.text for one in content.answer if one.figure == "frontier"]
    first = {"per_metre": "The cheapest way in all", "H_end_required": "The cheapest way to 1.00 m at the horizon"}
    start = "No way that was tried is likely" if goal == {"H_end_required": 1e-6} else first[next(iter(goal))]
    assert content.answer[1].text.startswith(start), "the second sentence, which needs no unfolding"
    enough = goal == {"H_end_required": 1.0}
    assert said[-3].startswith("The best with other physics" if enough else "Next: ")
    assert said[-2].startswith("Stop here: nothing" if enough else "Stop ")
    assert said[-1] == "This study simulated up to 6 runs; at sea none is there yet, so runs count from 0."
    assert all("EUR" in one for one in said[:-2])
    assert figures.frontier(content).data


def test_a_study_without_costs_says_nothing_and_one_without_a_length_says_why(tiny_run: Path) -> None:
    results = read_results(tiny_run)
    assert cost_sentences(results) == []
    assert cost_frame(results).empty
    priced = with_cost(tiny_run, per_metre=1.0)
    bare = replace(priced, plan=replace(priced.plan, vessels={}))
    assert cost_frame(bare).empty
    assert cost_sentences(bare)[0].startswith("What to buy cannot be said: the law needs a vessel")


def test_recorded_runs_are_paid(tiny_run: Path) -> None:
    """The same runs as a log: those that may train are there, and a study begins at their number."""
    results = with_cost(tiny_run, per_metre=1.0)
    study = results.plan.study.model_copy(update={"truth": None, "data": Data(dataset="runs.parquet")})
    ways = study_ways(replace(results, plan=replace(results.plan, study=study)))
    assert ways.amounts[0] == results.pool == 8
    assert ways.price[0, 0] == 0
