"""Sentences on tables made by hand: the numbers they name, the harm they tell, the doubt they keep."""

from __future__ import annotations

import re
from typing import Any

from shipid.report.section import declared
from shipid.report.sections import SECTIONS
from shipid.study.advise import answer, by_model
from shipid.study.results import Results
from tests.study.byhand import grid


def text(results: Results) -> str:
    sentences = answer(results)
    assert all(anchor in declared(SECTIONS) for _, anchor in sentences)
    for sentence, _ in sentences:
        assert re.fullmatch(r"[A-Z0-9].*\.", sentence), sentence
        assert "nan" not in sentence.split()
        assert "inf" not in sentence.split()
    return "\n".join(sentence for sentence, _ in sentences)


def test_best_model_and_its_worth_in_runs(made: Any) -> None:
    """10 runs with `good` leave 1.5 m; without physics it takes 60 runs to get there."""
    H = {"good": (1.5, 1.0, 0.5), "bad": (3.0, 2.0, 1.5), "none": (9.0, 4.0, 1.25)}
    said = text(made(grid(H, (10, 30, 60))))
    assert (
        "With 60 runs, good (best in validation; 2.00 m mean error on its own) predicts 8 s ahead with 0.50 m mean"
        in said
    )
    assert "nine errors in ten are below 0.75 m" in said
    assert "it takes 60 runs to do as well: with 10 runs good has 1.50 m" in said
    assert "leaves 25% to 25% of the error of physics alone (over 2 models)" in said
    assert "Keeping u, v and r constant gives 10.0 m: at 60 runs every model beats it." in said
    assert "At 60 runs bad does no better than no physics at all." in said


def test_validation_chooses_and_never_the_test(made: Any) -> None:
    said = text(
        made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)}), losses={"good": 2.0, "bad": 1.0})
    )
    assert "With 30 runs, bad (best in validation;" in said


def test_harmful_compensation_is_told(made: Any) -> None:
    """`good` alone has 2 m and `bad` 4 m."""
    said = text(made(grid({"good": (3.0, 2.5), "bad": (3.0, 2.2), "none": (9.0, 4.0)})))
    assert (
        "Compensation makes good no better than it is alone; good alone has 2.00 m, less than any compensated" in said
    )
    assert "no better than it is alone" not in text(
        made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)}))
    )


def test_no_amount_of_data_replaces_physics(made: Any) -> None:
    said = text(made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)})))
    assert "Without physics 30 runs give 4.00 m" in said
    assert "with 10 runs good has 1.50 m" in said
    assert "every physics model does better than none" in said


def test_physics_worth_no_run_at_all(made: Any) -> None:
    """Where the least data does without physics what the best physics does, nobody needs more runs."""
    said = text(made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (1.25, 1.1)})))
    assert "Without physics 10 runs do as well, 1.25 m: with 10 runs good has 1.50 m." in said


def test_harm_is_told_with_names(made: Any) -> None:
    """At 10 runs `bad` harms; at 30 it does not."""
    said = text(made(grid({"good": (1.5, 1.0), "bad": (5.0, 2.0), "none": (4.0, 3.0)})))
    assert re.search(r"[Aa]t 10 runs bad ", said)
    assert re.search(r"[Aa]t 30 runs every physics model does better than none", said)
    both = text(made(grid({"good": (1.5, 3.5), "bad": (5.0, 4.0), "none": (4.0, 3.0)})))
    assert re.search(r"[Aa]t 30 runs good, bad do ", both)
    assert "every physics model" not in both


def test_a_tie_is_no_help(made: Any) -> None:
    said = text(made(grid({"good": (1.5, 3.0), "bad": (2.0, 2.0), "none": (4.0, 3.0)})))
    assert "every physics model does better" not in said


def test_data_that_did_not_help_is_told(made: Any) -> None:
    said = text(made(grid({"good": (1.5, 1.6), "bad": (3.0, 2.0), "none": (4.0, 5.0)})))
    assert "With 30 runs good, pure data-driven are no better than with 10." in said
    assert "no better than with" not in text(made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (5.0, 4.0)})))


def test_constant_motion_that_is_not_beaten(made: Any) -> None:
    said = text(made(grid({"good": (1.5, 1.0), "bad": (5.0, 2.0), "none": (4.0, 3.0)}), naive=2.5))
    assert "gives 2.50 m: at 30 runs pure data-driven does not beat it." in said
    said = text(made(grid({"good": (1.5, 1.0), "bad": (5.0, 2.0), "none": (4.0, 3.0)}), naive=2.0))
    assert "bad, pure data-driven do not beat it." in said


def test_seeds_become_an_interval(made: Any) -> None:
    cells = {("good", 10, seed): H for seed, H in enumerate((1.0, 2.0, 3.0))}
    cells |= {("bad", 10, seed): 4.0 for seed in range(3)} | {("none", 10, seed): 9.0 for seed in range(3)}
    results = made(cells)
    assert "2.00 m mean error [1.00, 3.00] over 3 seeds" in text(results)
    table = by_model(results).set_index("model")
    assert table.loc["good", ["H", "low", "high", "seeds"]].tolist() == [2.0, 1.0, 3.0, 3]


def test_incomplete_study_is_provisional(made: Any) -> None:
    cells = grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)})
    del cells["bad", 10, 0]
    said = text(made(cells, planned=6))
    assert said.startswith("1 of 6 cells are not finished: what follows is provisional.")


def test_failed_cells_are_told_and_not_counted(made: Any) -> None:
    """`bad` has no result at 30 runs: nothing is claimed of every model, and the failure is named."""
    said = text(made(grid({"good": (1.5, 1.0), "bad": (3.0, None), "none": (9.0, 4.0)})))
    assert "1 of 6 cells have no result (bad: no training converged)" in said
    assert "every physics model with a result does better than none" in said
    assert "(over 1 model)" in said


def test_nothing_is_claimed_against_a_missing_data_driven_model(made: Any) -> None:
    said = text(made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, None)})))
    assert "at 30 runs every physics model does better" not in said.lower()
    assert "10 runs give 9.00 m" in said


def test_nothing_can_be_said(made: Any) -> None:
    said = text(made(grid({"good": (None, None), "bad": (None, None), "none": (9.0, 4.0)})))
    assert "nothing can be said yet" in said
    assert "does better" not in said
    assert "nothing can be said yet" in text(made(grid({"good": (None,), "bad": (None,), "none": (None,)}, (10,))))


def test_an_exact_model_has_no_error_to_leave(made: Any) -> None:
    H = {"good": (0.1, 0.1), "bad": (3.0, 1.5), "none": (9.0, 4.0)}
    said = text(made(grid(H), alone={"good": 0.0, "bad": 6.0}))
    assert "leaves 25% of the error of physics alone (over 1 model)" in said


def test_the_map_carries_what_needs_it(made: Any) -> None:
    H = {"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)}
    anchors = [anchor for _, anchor in answer(made(grid(H)))]
    assert anchors.count("map") == 2
    alone = {"good": 2.0}
    one_model = made(grid({name: H[name] for name in ("good", "none")}), alone=alone, claims=None)
    assert "map" not in [anchor for _, anchor in answer(one_model)]
    assert "map" not in [anchor for _, anchor in answer(made(grid({m: H[m][:1] for m in H}, (10,))))]


def test_the_nominal_model_is_a_floor_and_no_degraded_model(made: Any) -> None:
    """It would be the best of all; the answer speaks of `good` and tells the floor once."""
    H = {"good": (1.5, 1.0), "bad": (3.0, 2.0), "exact": (0.5, 0.25), "none": (9.0, 4.0)}
    results = made(grid(H), alone={"good": 2.0, "bad": 6.0, "exact": 0.75}, claims={"nominal": "exact"})
    said = text(results)
    assert "With 30 runs, good (best in validation;" in said
    assert "(over 2 models)" in said
    assert said.count("exact") == 1
    assert "Exact coefficients (exact) leave 0.75 m alone, the floor" in said
    assert said.endswith("and 0.25 m compensated with 30 runs.")


def test_a_long_list_of_names_is_cut(made: Any) -> None:
    names = [f"m{k}" for k in range(9)]
    H = dict.fromkeys(names, (5.0, 5.0)) | {"good": (1.5, 1.0), "none": (4.0, 3.0)}
    assert "At 30 runs m0, m1, m2, m3, m4 and 4 more do no better" in text(
        made(grid(H), alone=dict.fromkeys([*names, "good"], 9.0), claims=None)
    )
