"""Sentences on tables made by hand: the numbers they name, the harm they tell, the doubt they keep."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.answer.error_table import Estimate
from shipid.answer.sentences import _bounds, answer_sentences, best_model, errors_by_model
from shipid.report.content import AnswerSentence
from shipid.report.page import split_answer
from shipid.report.sections import SECTIONS
from shipid.study.plan import Batch
from shipid.study.results import Results
from tests.answer.byhand import grid


def text(results: Results) -> str:
    sentences = answer_sentences(results)
    anchors = {name for section in SECTIONS.values() for name in section.items}
    assert all(anchor in anchors for _, anchor in sentences)
    for sentence, _ in sentences:
        assert re.fullmatch(r"[\"A-Z0-9].*\.", sentence), sentence
        assert "nan" not in sentence.split()
        assert "inf" not in sentence.split()
    return "\n".join(sentence for sentence, _ in sentences)


def test_best_model_and_its_worth_in_runs(made: Any) -> None:
    """10 runs with `good` leave 1.5 m; without physics 30 runs leave 4 m and 60 leave 1.25 m."""
    H = {"good": (1.5, 1.0, 0.5), "bad": (3.0, 2.0, 1.5), "none": (9.0, 4.0, 1.25)}
    advice = text(made(grid(H, (10, 30, 60))))
    assert advice.startswith(
        "8 s ahead, good (best in validation) with 60 runs errs by 0.50 m on average, nine in ten below 0.75 m. "
        "Without physics: 1.25 m, too few test runs.\n"
    )
    assert "H is the mean error over all 8 s, not only at their end: 0.50 m for good with 60 runs." in advice
    assert "Its physics alone has A = 2.00 m. Without physics H is 1.25 m, too few test runs." in advice
    runs = 30 * 2 ** (np.log(4.0 / 1.5) / np.log(4.0 / 1.25))
    assert "How many runs? With 10 runs, H of good (best in validation) is 1.50 m. " in advice
    assert f"Without physics the same error takes about {runs:.0f} runs, interpolated between amounts." in advice
    assert "With 10 and 60 runs, every compared model beats constant u, v, r (H 10.0 m)." in advice
    assert (
        "With 60 runs, 1 of 2 physics models does better than no physics over the whole horizon: good; "
        "bad does worse." in advice
    )


@pytest.mark.parametrize(("error", "told"), [(0.5, True), (2.0, False)])
def test_the_headline_says_that_a_regression_errs_by_less(made: Any, error: float, told: bool) -> None:
    results = made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)}), runs=8)
    paths = {Batch(amount, 0).key: error / 10 * results.naive[..., None] * [1.0, 0.0] for amount in (10, 30)}
    headline = text(replace(results, regression=paths)).partition("\n")[0]
    assert headline.startswith("8 s ahead, good (best in validation) with 30 runs errs by 1.00 m")
    regressed = re.search(r" A regression errs by less: 0\.50 m \[.*\], shown to be less\.", headline)
    assert bool(regressed) == told == ("regression" in headline)


@pytest.mark.parametrize(
    ("losses", "regression", "first"),
    [
        ({}, 9.0, "good (best in validation) with 30 runs errs by 1.00 m"),
        ({"none": 0.5}, 9.0, "no physics (best in validation) with 30 runs errs by 4.00 m"),
        ({"none": 0.5}, 0.1, "a regression on accelerations (best in validation) with 30 runs errs by 2.00 m"),
        ({"none": 0.5}, np.nan, "no physics (best in validation) with 30 runs errs by 4.00 m"),
    ],
)
def test_the_headline_names_the_best_of_all_by_validation(
    made: Any, losses: dict[str, float], regression: float, first: str
) -> None:
    """Not by the test, on which `good` is lowest; the best physics is named beside it."""
    results = made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)}), losses=losses)
    keys = [Batch(amount, 0).key for amount in (10, 30)]
    known = {"regression": {key: 0.2 * results.naive[..., None] * [1.0, 0.0] for key in keys}}
    headline = text(replace(results, **known, regression_loss=dict.fromkeys(keys, regression))).partition("\n")[0]
    assert headline.startswith(f"8 s ahead, {first}")
    assert ("With physics (good): 1.00 m, too few test runs." in headline) == (not first.startswith("good"))


@pytest.mark.parametrize("runs", [1, 8])
def test_the_headline_is_short_and_begins_with_the_error_at_the_horizon(made: Any, runs: int) -> None:
    """Errors grow: H is 2.5 m, the error 8 s ahead 4 m. No sentence has two intervals."""
    alone = {f"m{k}": 2.0**k for k in range(5)}
    cells = grid({name: (A / 2, 2.5) for name, A in alone.items()} | {"none": (3.0, 2.9)})
    curves = {(name, 30, 0): [1.0, 2.0, 3.0, 4.0] for name in alone}
    answer = answer_sentences(made(cells, alone=alone, claims=None, curves=curves, runs=runs))
    assert re.match(r"8 s ahead, m\d \(best in validation\) with 30 runs errs by 4\.00 m", answer[0][0])
    headline, details = split_answer([AnswerSentence(sentence) for sentence, _ in answer])
    assert 1 <= len(headline) <= 3
    assert sum(len(one.text.split()) for one in headline) <= 60
    assert len(headline) + len(details) == len(answer)
    for text in (one for sentence, _ in answer for one in re.split(r"(?<=[.?]) (?=[A-Z])", sentence)):
        assert text.count("[") <= 1, text


def test_validation_chooses_and_never_the_test(made: Any) -> None:
    advice = text(
        made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)}), losses={"good": 2.0, "bad": 1.0})
    )
    assert "bad (best in validation)" in advice
    assert "0 m for bad with 30 runs. Its physics alone has A = 6.00 m." in advice


def test_harmful_compensation_is_reported(made: Any) -> None:
    """`good` alone has 2 m and `bad` 4 m."""
    advice = text(made(grid({"good": (3.0, 2.5), "bad": (3.0, 2.2), "none": (9.0, 4.0)})))
    assert "Compensation harms good.\n" in advice
    assert "harms" not in text(made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)})))


def test_physics_worth_no_run_at_all(made: Any) -> None:
    """Where the least data does without physics what the best physics does, nobody needs more runs."""
    advice = text(made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (1.25, 1.1)})))
    assert (
        "H of good (best in validation) is 1.50 m. Without physics the same 10 runs do as well. H is then 1.25 m."
        in advice
    )


def test_what_holds_at_both_ends_is_said_once(made: Any) -> None:
    advice = text(made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)})))
    assert "\nWith 10 or 30 runs, both physics models do better than no physics over the whole horizon.\n" in advice


def test_the_best_model_is_called_best_without_a_rival_too(made: Any) -> None:
    methods = [{"name": "kernel", "kind": "kernel", "families": ["good", "bad"]}]
    advice = text(made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0)}), changes={"method": methods}))
    assert "8 s ahead, good (best in validation) with 30 runs errs by 1.00 m" in advice
    assert "It is unknown whether physics harms, since no method here predicts without physics." in advice


def test_methods_without_physics_are_answered_with_their_errors(made: Any) -> None:
    methods = [{"name": name, "kind": "kernel", "families": ["none"]} for name in ("kernel", "other")]
    methods += [{"name": "alone", "kind": "alone"}]
    results = made(grid({"none": (4.0, 3.0)}), changes={"method": methods}, claims=None, planned=8)
    (row,) = results.cells[results.cells["N_D"] == 30].to_dict("records")
    further = [{**row, "method": "other", "model": "none + other", "H_end": 2.5}]
    further += [
        {**row, "method": "alone", "foundation": "good", "model": "good + alone", "family": "good", "H_end": 2.0}
    ]
    results = replace(results, cells=pd.concat([results.cells, pd.DataFrame(further)], ignore_index=True))
    assert (
        "No result joins physics and data, so there is no conclusion. Mean errors 8 s ahead: good + alone 2.00 m, "
        '"no physics" + other 2.50 m and "no physics" 3.00 m.'
    ) in text(results)


def test_data_that_did_not_help_is_reported(made: Any) -> None:
    advice = text(made(grid({"good": (1.5, 1.6), "bad": (3.0, 2.0), "none": (4.0, 5.0)})))
    assert '30 runs are worse than 10 for good and "no physics".' in advice
    assert "are worse than" not in text(made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (5.0, 4.0)})))


def test_constant_u_v_r_that_are_not_beaten(made: Any) -> None:
    advice = text(made(grid({"good": (1.5, 1.0), "bad": (5.0, 2.0), "none": (4.0, 3.0)}), naive=2.5))
    assert 'With 10 runs constant u, v, r (H 2.50 m) beat bad and "no physics".' in advice
    assert 'With 30 runs constant u, v, r (H 2.50 m) beat "no physics".' in advice
    assert "every compared model beats" not in advice
    advice = text(made(grid({"good": (1.5, 1.0), "bad": (5.0, 2.0), "none": (4.0, 3.0)}), naive=1.9))
    assert 'With 30 runs constant u, v, r (H 1.90 m) beat bad and "no physics".' in advice


def test_test_manoeuvres_become_an_interval_and_seeds_do_not(made: Any) -> None:
    cells = {("good", 10, seed): H for seed, H in enumerate((1.0, 2.0, 3.0))}
    cells |= {("bad", 10, seed): 4.0 for seed in range(3)} | {("none", 10, seed): 9.0 for seed in range(3)}
    assert "errs by 2.00 m on average" in text(made(cells))
    assert "1 test manoeuvre gives no interval, 5 would: every comparison here holds on this test" in text(made(cells))
    advice = text(made(cells, runs=8))
    assert re.search(r"2\.00 m \[1\.\d\d, 2\.\d\d\] on average", advice)
    assert "Brackets are 95 % intervals over 8 test manoeuvres" in advice
    table = errors_by_model(made(cells)).set_index("model")
    assert table.loc["good", "H"] == 2.0


def test_what_the_brackets_hold_is_said(made: Any) -> None:
    H = {"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (5.0, 4.0)}
    words = "Brackets are 95 % intervals over 8 test manoeuvres "
    assert f"{words}of one draw of training runs: errors with other draws may lie outside." in text(
        made(grid(H), runs=8)
    )
    assert "Brackets" not in text(made(grid(H)))  # one manoeuvre: no brackets
    cells = {
        (name, N, seed): value for name in H for N, value in zip((10, 30), H[name], strict=True) for seed in (0, 1)
    }
    assert f"{words}and 2 draws of 10 training runs: where the mean of many such runs is expected." in text(
        made(cells, runs=8)
    )


def test_how_good_physics_must_be(made: Any) -> None:
    """H = A / 2 for five models, `none` has 3 m: physics pays below A = 6 m; with 30 runs it is all the same."""
    alone = {f"m{k}": 2.0**k for k in range(5)}
    H = {name: (A / 2, 1.0) for name, A in alone.items()} | {"none": (3.0, 1.0)}
    advice = text(made(grid(H), alone=alone, claims=None, runs=8))
    assert re.search(
        r"With 10 runs, physics pays if its own mean error over the horizon, A, is below about 6\.0 m \[\d\.\d, \d",
        advice,
    )
    assert (
        "\nWith 30 runs, none of 5 physics models is shown to do better than no physics over the whole horizon; "
        "for all of them the test" in advice
    )
    H = {name: (A / 2, 1.0) for name, A in alone.items()} | {"none": (30.0, 20.0)}
    advice = text(made(grid(H), alone=alone, claims=None, runs=8))
    assert (
        "With 10 or 30 runs, physics pays even if its own mean error over the horizon, A, is 16.0 m, the worst tried.\n"
        in advice
    )
    assert "\nWith 10 or 30 runs, all 5 physics models do better than no physics over the whole horizon.\n" in advice
    H = {name: (A / 2, 1.0) for name, A in alone.items()} | {"none": (0.2, 0.2)}
    advice = text(made(grid(H), alone=alone, claims=None, runs=8))
    assert (
        "With 10 or 30 runs, physics does not pay even if its own mean error over the horizon, A, is 1.00 m, "
        "the best tried" in advice
    )


def test_models_that_do_not_go_by_the_limit_are_named_beside_it(made: Any) -> None:
    """The worst physics but one does as well as the best: no limit of A holds, and the same breath says so."""
    alone = {f"m{k}": 2.0**k for k in range(6)}
    errors = [0.5, 0.6, 9.0, 9.0, 0.7, 9.0]
    H = {name: (error, 1.0) for name, error in zip(alone, errors, strict=True)} | {"none": (3.0, 1.0)}
    (sentence,) = [
        line for line in text(made(grid(H), alone=alone, claims=None, runs=8)).splitlines() if "; yet" in line
    ]
    assert re.search(r"A, is below about \d\.\d m \[[^]]*\]; yet m4 \(A 16\.0 m\) does better\.$", sentence), sentence


def test_two_errors_beside_each_other_are_tested(made: Any) -> None:
    for none, words in ((4.0, "shown to be larger"), (0.2, "shown to be less"), (1.0, "not shown to differ")):
        advice = text(
            made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, none)}), losses={"none": 5.0}, runs=8)
        )
        first, *rest = advice.splitlines()
        assert first.endswith(f", {words}."), first
        assert [line for line in rest if "Without physics H is" in line and line.endswith(f", {words}.")], rest


def test_runs_that_are_not_enough_may_still_be_too_many(made: Any) -> None:
    """`none` with 30 runs has about what `good` has with 10: the test cannot tell which has less."""
    H = grid({"good": (2.0, 1.0), "bad": (3.0, 2.0), "none": (2.1, 2.05)})
    advice = text(made(H, runs=8))
    assert (
        "Without physics 30 runs are not shown to be enough for that [at most 10, over 30]. They give 2.05 m" in advice
    )


def test_that_all_physics_does_worse_is_one_clause(made: Any) -> None:
    """It was `none of 2 physics models is shown to do better than no physics; a and b do worse`."""
    advice = text(made(grid({"a": (9.0, 8.0), "b": (8.0, 7.0), "none": (3.0, 2.0)}), runs=8))
    assert "With 10 or 30 runs, both physics models do worse than no physics over the whole horizon.\n" in advice


def test_names_are_those_that_the_test_can_tell(made: Any) -> None:
    """`bad` is 1 % below no physics in all eight manoeuvres; another training may differ by 3 %."""
    advice = text(made(grid({"good": (1.5, 1.0), "bad": (8.91, 2.0), "none": (9.0, 4.0)}), runs=8))
    assert (
        "With 10 runs, 1 of 2 physics models does better than no physics over the whole horizon: good; "
        "for bad the test cannot tell.\n" in advice
    )


def test_known_orders_are_an_upper_bound_where_they_may_react(made: Any) -> None:
    H = grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)})
    known = {"prediction": {"ahead": 8.0, "step": 2.0, "commands": "known"}}
    results = made(H, changes=known)
    assert "upper bound" not in text(results), "turns under constant orders react to nothing"
    truth = dict(results.plan.document["truth"]) | {"manoeuvre": [{"kind": "zigzag", "n_rpm": 120.0}]}
    assert "an upper bound of what knowing the plan is worth" in text(made(H, changes={**known, "truth": truth}))


def test_identified_models_are_not_best_in_validation(made: Any) -> None:
    """They were fitted to the runs that validate them; `good` is best of the others."""
    family = [
        {"name": "good", "base": "gunnerus-28.9"},
        {"name": "bad", "base": "gunnerus-28.9"},
        {"name": "fitted", "extends": "bad", "identify": {"parameters": ["hull.derivatives.N_ur"]}},
    ]
    H = grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "fitted": (0.8, 0.7), "none": (9.0, 4.0)})
    alone = {"good": 2.0, "bad": 6.0, "fitted": 3.0}
    results = made(H, alone=alone, changes={"family": family})
    advice = text(results)
    assert best_model(results) == "good"
    harmed = grid({"good": (3.0, 2.5), "bad": (3.0, 2.2), "fitted": (0.8, 0.7), "none": (9.0, 4.0)})
    said = text(made(harmed, alone=alone, changes={"family": family}))
    assert "Compensation harms good." in said, "2 m alone, but `fitted` has less"
    assert "Identified models were fitted to the runs that validate them" in advice
    told = np.where(results.cells["family"].eq("fitted"), 0.03, 0.0)
    advice = text(replace(results, cells=results.cells.assign(physics_diverged=told)))
    assert "\nFitted to the runs, the physics of fitted diverges on test windows of 2 cells." in advice


def test_numbers_that_were_set_from_runs_that_train_are_named(made: Any) -> None:
    """Such a model knows more runs than its N_D says. One that saw a test run is in one sentence, which says so."""
    H = grid({"good": (1.0, 0.5), "bad": (2.0, 1.0), "none": (4.0, 2.0)})

    def seen(*runs: str) -> Results:
        bad = {"name": "bad", "base": "gunnerus-28.9"}
        family = [{"name": "good", "base": "gunnerus-28.9", "seen": list(runs)}, bad]
        results: Results = made(H, changes={"family": family})
        every = pd.concat([results.dataset.frame, results.dataset.frame.assign(run="trains")], ignore_index=True)
        return replace(results, dataset=replace(results.dataset, frame=every))

    assert "The numbers of good were set from runs that train, whatever the amount of data" in text(seen("trains"))
    assert "were set from" not in text(seen("no run"))
    assert best_model(seen("trains")) == "good"
    assert best_model(seen("trains", "a")) == "bad"
    unfair = text(seen("trains", "a"))
    assert "The numbers of good were set from runs that test: shown, but counted in no other sentence." in unfair
    assert unfair.count("good ") == 1, "the figures have two models, the other sentences one"
    assert "were set from" not in text(seen())


def test_incomplete_study_is_provisional(made: Any) -> None:
    cells = grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)})
    del cells["bad", 10, 0]
    advice = text(made(cells, planned=6))
    assert advice.startswith("1 of 6 cells are not finished: what follows is provisional.")


def test_failed_cells_are_reported_and_not_counted(made: Any) -> None:
    """`bad` has no result at 30 runs: nothing is claimed of every model, and the failure is named."""
    advice = text(made(grid({"good": (1.5, 1.0), "bad": (3.0, None), "none": (9.0, 4.0)})))
    assert "1 of 6 cells has no result (bad: no training converged)" in advice
    assert "With 10 or 30 runs, 1 of 1 physics models does better than no physics over the whole horizon" in advice


def test_nothing_is_claimed_against_a_missing_data_driven_model(made: Any) -> None:
    advice = text(made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, None)})))
    assert "does better" not in advice
    assert "How many runs?" not in advice
    assert "It is unknown whether physics harms, since not every cell without physics has a result." in advice


def test_without_results_there_is_no_conclusion(made: Any) -> None:
    advice = text(made(grid({"good": (None, None), "bad": (None, None), "none": (9.0, 4.0)})))
    assert "there is no conclusion" in advice
    assert "does better" not in advice
    assert "there is no conclusion" in text(made(grid({"good": (None,), "bad": (None,), "none": (None,)}, (10,))))


def test_bounds_are_those_that_the_study_covers() -> None:
    """An interval of everything is no bound, and one beyond all that was tried is none at all."""
    ends = (2.0, 9.0)
    known = [
        _bounds(Estimate(5.0, *interval, ends), "{:.0f}".format) for interval in ((3.0, 7.0), (2.0, 9.0), (9.0, 9.0))
    ]
    assert known == [" [3, 7]", " [at most 2, over 9]", ""]


def test_the_comparison_of_methods_comes_next(made: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    results = made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)}))
    plain = [sentence for sentence, _ in answer_sentences(results, ["Memory errs least."])]
    monkeypatch.setattr("shipid.answer.sentences.learning_methods", lambda _: ["kernel", "memory"])
    sentences = [sentence for sentence, _ in answer_sentences(results, ["Memory errs least."])]
    assert sentences[1] == "Memory errs least.", "after the error at the horizon"
    assert [one for one in sentences if one != sentences[1] and "methods that learn" not in one] == plain
    assert len(sentences) == len(plain) + 2


def test_an_amount_without_any_result_is_left_out(made: Any) -> None:
    advice = text(made(grid({"good": (1.5, None), "bad": (3.0, None), "none": (9.0, None)})))
    assert "good (best in validation) with 10 runs errs" in advice
