"""Sentences and verdicts on tables made by hand: the numbers they name, the harm they tell, the doubt they keep."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.data.windows import Windows
from shipid.report.content import ANCHORS
from shipid.study.advise import CLAIMS, answer, by_model, findings
from shipid.study.plan import build_plan
from shipid.study.results import Results
from tests.study.tiny import logged, tiny_plan

STEPS = 4
ALONE = {"good": 2.0, "bad": 6.0}
Cells = Mapping[tuple[str, int, int], float | None]


@pytest.fixture
def made(tmp_path: Path) -> Any:
    """Results of cells (model, N_D, seed) -> H [m]; None has failed. Errors are equal at all steps unless said."""

    def make(
        cells: Cells,
        *,
        planned: int | None = None,
        claims: bool = True,
        naive: float = 10.0,
        alone: Mapping[str, float] = ALONE,
        curves: Mapping[tuple[str, int, int], list[float]] | None = None,
        losses: Mapping[str, float] | None = None,
    ) -> Results:
        document = tiny_plan(tmp_path).document
        document["family"] = [{"name": name, "base": "gunnerus-28.9"} for name in alone]
        document["grid"] = {"N_D": sorted({N for _, N, _ in cells}), "seeds": sorted({seed for *_, seed in cells})}
        if claims:
            document["claims"] = {"accurate": "good", "inaccurate": "bad"}
        document["truth"]["manoeuvres"] = 200
        plan = build_plan(document, tmp_path / "tiny.toml")
        if planned is None:
            assert plan.cells == len(cells), "a complete study by hand"
        rows, paths = [], {}
        for (model, N_D, seed), H in cells.items():
            A = alone.get(model, np.nan)
            row = {
                "cell": f"{model}-{N_D}-{seed}",
                "model": model,
                "kind": model,
                "member": 0,
                "N_D": N_D,
                "seed": seed,
            }
            row |= {"runs": N_D, "minutes": 1.0, "A": A, "A_90": A, "A_rms": A, "H": np.nan, "H_90": np.nan}
            row["trials"] = [{"value": (losses or {}).get(model, H)}]
            row |= {"rms": np.nan, "status": "failed", "sentence": "no training converged"}
            if H is not None:
                row |= {"H": H, "H_90": 1.5 * H, "rms": 1.1 * H, "status": "ok", "sentence": ""}
                curve = (curves or {}).get((model, N_D, seed), [H] * STEPS)
                paths[row["cell"]] = np.stack([np.array(curve), np.zeros(STEPS)], axis=-1)[:, None, :]
            rows.append(row)
        straight = np.zeros((STEPS, 1, 2))
        physics = {name: straight + np.array([A, 0.0]) for name, A in alone.items()} | {"none": straight}
        columns = {name: np.zeros(1) for name in ("north", "east", "psi", "u", "v", "r")}
        return Results(
            folder=tmp_path,
            plan=plan,
            cells=pd.DataFrame(rows),
            models=pd.DataFrame(),
            test=Windows(np.array(["a"]), np.zeros(1), columns, straight, {}, STEPS, 2.0),
            physics=physics,
            naive=np.full((STEPS, 1), naive),
            paths=paths,
            dataset=Dataset(logged({"a": {}}, np.arange(2.0)).frame, {"flags": []}),
            provenance={},
        )

    return make


def grid(H: Mapping[str, tuple[float | None, ...]], amounts: tuple[int, ...] = (10, 30)) -> dict[Any, float | None]:
    return {(model, N, 0): value for model, values in H.items() for N, value in zip(amounts, values, strict=True)}


def text(results: Results) -> str:
    sentences = answer(results)
    assert all(anchor in ANCHORS for _, anchor in sentences)
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
    assert "leaves 25% to 25% of the error of physics alone (over 1 model)" in said


# R1 to R4


def verdicts(results: Results) -> dict[str, str]:
    found = findings(results)
    assert [finding["id"] for finding in found] == list(CLAIMS)
    assert all(finding["claim"] == CLAIMS[finding["id"]] for finding in found)
    return {finding["id"]: finding["verdict"] for finding in found}


def one(good: float, bad: float, none: float) -> dict[Any, float | None]:
    return grid({"good": (good,), "bad": (bad,), "none": (none,)}, (30,))


def test_all_confirmed(made: Any) -> None:
    assert verdicts(made(one(1.0, 2.1, 9.0))) == dict.fromkeys(CLAIMS, "confirmed")


@pytest.mark.parametrize(
    ("H", "refuted"),
    [
        ((2.1, 2.0, 9.0), {"R1"}),  # compensation worsens `good`
        ((1.0, 2.3, 9.0), {"R2"}),  # 15 % above what accurate physics does alone
        ((1.0, 5.5, 9.0), {"R2", "R3"}),  # gap 4.0 m before, 4.5 m after
        ((1.0, 2.0, 3.0), {"R4"}),  # `bad` alone is worse than pure data-driven
    ],
)
def test_refuted(made: Any, H: tuple[float, float, float], refuted: set[str]) -> None:
    found = verdicts(made(one(*H)))
    assert {key for key, verdict in found.items() if verdict == "refuted"} == refuted
    assert {verdict for key, verdict in found.items() if key not in refuted} == {"confirmed"}


def test_undecided_where_seeds_disagree(made: Any) -> None:
    """Each holds on average over two seeds and not for one of them."""

    def seeds(good: tuple[float, float], bad: tuple[float, float]) -> dict[Any, float | None]:
        cells = {("good", 30, k): good[k] for k in (0, 1)} | {("bad", 30, k): bad[k] for k in (0, 1)}
        return {**cells, **{("none", 30, k): 9.0 for k in (0, 1)}}

    assert verdicts(made(seeds((1.0, 2.5), (2.0, 2.0))))["R1"] == "undecided"
    assert verdicts(made(seeds((1.0, 1.0), (1.5, 2.5))))["R2"] == "undecided"
    assert verdicts(made(seeds((0.5, 0.5), (0.6, 5.0))))["R3"] == "undecided"


def test_data_driven_that_is_worst_at_most_steps(made: Any) -> None:
    curves = {("none", 30, 0): [9.0, 9.0, 9.0, 1.0]}
    results = made(one(1.0, 2.1, 7.0), curves=curves)
    assert verdicts(results)["R4"] == "undecided"
    assert "worst at 75% of the steps" in findings(results)[3]["evidence"]
    results = made(one(1.0, 2.1, 3.0))
    assert "worst at 0% of the steps" in findings(results)[3]["evidence"]
    assert "most often worst: bad alone" in findings(results)[3]["evidence"]


def test_evidence_names_the_numbers(made: Any) -> None:
    evidence = {finding["id"]: finding["evidence"] for finding in findings(made(one(1.0, 2.1, 9.0)))}
    assert evidence["R1"] == "good 2.00 m -> 1.00 m; bad 6.00 m -> 2.10 m"
    assert evidence["R2"] == "inaccurate and compensated 2.10 m, accurate alone 2.00 m"
    assert evidence["R3"] == "gap 4.00 m before, 1.10 m after"


def test_a_missing_cell_leaves_all_undecided(made: Any) -> None:
    results = made(grid({"good": (1.0,), "bad": (None,), "none": (9.0,)}, (30,)))
    assert set(verdicts(results).values()) == {"undecided"}


def test_no_claims_no_findings(made: Any) -> None:
    assert findings(made(one(1.0, 2.0, 9.0), claims=False)) == []
    assert findings(made(grid({"good": (None,), "bad": (None,), "none": (None,)}, (30,)))) == []
