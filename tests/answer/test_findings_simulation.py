"""Verdicts S1 to S7 on maps H(A, N_D) made by hand: what confirms, what refutes, what cannot be decided."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest

from shipid.answer.findings import judge_findings
from shipid.answer.findings_simulation import SIMULATION_RULES as CLAIMS
from shipid.answer.findings_simulation import compare_roughness
from shipid.study.results import Results

AMOUNTS = (10, 30, 100)
ALONE = {"moderate-1": 2.0, "moderate-2": 4.0, "moderate-3": 6.0, "high-1": 8.0, "high-2": 16.0}
FAMILY = {"moderate": 3, "high": 2}
ROLES = {"moderate": "moderate", "high": "high"}
#: as the paper has it: all fall, `high-2` stays worse than no physics
H = {
    "moderate-1": (1.5, 0.9, 0.5),
    "moderate-2": (2.5, 1.2, 0.6),
    "moderate-3": (3.5, 1.6, 0.7),
    "high-1": (4.5, 2.0, 0.8),
    "high-2": (8.5, 4.2, 1.6),
    "none": (8.0, 4.0, 1.0),
}
ROUGH, SMOOTH = [0.0, 1.0, 0.0, 1.0], [0.0, 1.0, 2.0, 3.0]
JAGGED = {"method": [{"name": "kernel", "kind": "path-trained"}]}  # no polynomial of time
Rows = Mapping[str, Sequence[float | None]]


def cells(rows: Rows, *, seeds: int = 1, wobble: Mapping[str, float] | None = None) -> dict[Any, float | None]:
    """H by model and amount for some seeds; odd seeds are higher, even ones lower by the model's `wobble`."""
    errors: dict[Any, float | None] = {}
    for model, values in rows.items():
        for amount, value in zip(AMOUNTS, values, strict=False):
            for seed in range(seeds):
                factor = 1 + (wobble or {}).get(model, 0.0) * (1 if seed % 2 else -1) * (1 + seed / 10)
                errors[model, amount, seed] = None if value is None else value * factor
    return errors


@pytest.fixture
def judged(made: Any) -> Any:
    """Findings S1-S7 of a map by hand, by name, over eight test manoeuvres."""

    def judge(rows: Rows = H, *, seeds: int = 1, wobble: Mapping[str, float] | None = None, **options: Any) -> Any:
        made_up = cells(rows, seeds=seeds, wobble=wobble) if "none" in rows else rows
        options = {"family": FAMILY, "alone": ALONE, "claims": ROLES, "runs": 8, **options}
        claims = [one for one in judge_findings(made(made_up, **options)) if one["id"].startswith("S")]
        assert [finding["id"] for finding in claims] == list(CLAIMS)
        assert all("nan" not in finding["evidence"].split() for finding in claims)
        return {finding["id"]: finding for finding in claims}

    return judge


def verdicts(by_claim: Mapping[str, Any]) -> dict[str, str]:
    return {key: finding["verdict"] for key, finding in by_claim.items()}


def test_the_paper_by_hand(judged: Any) -> None:
    """With five seeds, and the worst model moved most by them, all that can be tested is confirmed."""
    wobble = {"high-2": 0.08, "none": 0.01, "moderate-1": 0.01, "moderate-2": 0.01, "moderate-3": 0.01}
    by_claim = judged(seeds=5, wobble=wobble)
    assert verdicts(by_claim) == {**dict.fromkeys(CLAIMS, "confirmed"), "S7": "not testable"}


def test_one_seed_cannot_tell_a_fluctuation(judged: Any) -> None:
    by_claim = judged()
    assert verdicts(by_claim) == {**dict.fromkeys(CLAIMS, "confirmed"), "S4": "undecided", "S7": "not testable"}
    assert by_claim["S4"]["evidence"] == (
        "at N_D = 100, 1 of 2 high models is shown to beat no physics (1.00 m), 1 is shown to be worse "
        "(high-2 1.60 m); fluctuation needs 5 nested orders (grid seeds), the study has 1 seed"
    )
    assert "needs 5 nested orders (grid seeds), the study has 4 seeds" in judged(seeds=4)["S4"]["evidence"]


def test_too_few_test_manoeuvres_decide_nothing(judged: Any) -> None:
    by_claim = judged(runs=4, seeds=5)
    assert set(verdicts(by_claim).values()) == {"undecided", "not testable"}
    assert "0 of 3 moderate models are shown to beat no physics" in by_claim["S1"]["evidence"], "though all do"
    assert all("4 test manoeuvres give no interval, 5 would" in finding["evidence"] for finding in by_claim.values())


def test_S1_every_moderate_model_and_most_to_the_end(judged: Any) -> None:
    finding = judged({**H, "moderate-2": (9.5, 1.2, 0.6)})["S1"]
    assert finding["verdict"] == "refuted"
    assert (
        "at N_D = 10 refuted: 2 of 3 moderate models are shown to beat no physics, whose error of 8.00 m is "
        "0.84 [" in finding["evidence"]
    )
    finding = judged({**H, "moderate-2": (2.5, 4.0, 0.6), "moderate-3": (3.5, 4.0, 0.7)})["S1"]
    assert finding["verdict"] == "undecided", "one of three is not most at 30 runs, and no most is worse"
    assert "that most keep the lead is undecided: 1 at 30, 3 at 100" in finding["evidence"]
    assert finding["numbers"]["share shown to lead at N_D = 100"] == 1.0


def test_S2_names_what_does_not_fall(judged: Any) -> None:
    finding = judged({**H, "high-2": (8.5, 9.5, 11.0)})["S2"]
    assert finding["verdict"] == "refuted"
    assert "H is shown to fall for 5 of 6 models" in finding["evidence"]
    assert "not shown for: high-2" in finding["evidence"]
    bump = judged({**H, "high-2": (8.5, 8.6, 5.0)})["S2"]
    assert bump["verdict"] == "confirmed", "a small rise on the way down is no refutation"
    level = judged({**H, "high-2": (8.5, 8.6, 8.5)})["S2"]
    assert level["verdict"] == "undecided"


def test_S3_for_twice_the_A_by_hand(judged: Any) -> None:
    """H = a + b log2 A: a rise of 2 m at 10 runs, 1 m at 30, 0.1 m at 100."""
    alone = {"moderate-1": 1.0, "moderate-2": 2.0, "moderate-3": 4.0, "high-1": 8.0, "high-2": 16.0}
    rises = (2.0, 1.0, 0.1)
    rows = {m: tuple(3.0 + rise * k for rise in rises) for k, m in enumerate(alone)} | {"none": H["none"]}
    finding = judged(rows, alone=alone)["S3"]
    assert finding["verdict"] == "confirmed"
    assert finding["numbers"] == {
        "least rank correlation of H and A": pytest.approx(1.0),
        "rise for twice the A at N_D = 10 [m]": pytest.approx(2.0),
        "rise for twice the A at N_D = 100 [m]": pytest.approx(0.1),
    }
    turned = {model: values[::-1] for model, values in rows.items()}
    steeper = judged(turned, alone=alone)["S3"]
    assert steeper["verdict"] == "undecided", "one of 120 orders of five models, of four comparisons"
    assert "−1.90 m [" in steeper["evidence"]


def test_S3_an_order_that_comes_by_chance_is_undecided(judged: Any) -> None:
    """H at 100 runs is in the order 4, 1, 2, 3, 5 of A."""
    finding = judged({**H, "moderate-1": (1.5, 0.9, 1.3)})["S3"]
    assert finding["verdict"] == "undecided"
    few = judged({**H, "moderate-1": (8.5, None, 1.4)})["S3"]
    assert (few["verdict"], few["evidence"][:39]) == ("undecided", "4 physics models, a trend needs 5; left")


@pytest.mark.parametrize("seeds", [1, 4, 5])
def test_S4_can_be_refuted_with_any_number_of_seeds(judged: Any, seeds: int) -> None:
    """Before, fewer than five seeds left it undecided, although no order of the runs could have confirmed it."""
    all_better = judged({**H, "high-2": (7.0, 3.0, 0.7)}, seeds=seeds)["S4"]
    none_better = judged({**H, "high-1": (9.0, 5.0, 2.0)}, seeds=seeds)["S4"]
    assert all_better["verdict"] == none_better["verdict"] == "refuted"


def test_S4_worst_and_calm(judged: Any) -> None:
    calm = judged(seeds=5, wobble={"high-2": 0.001, "moderate-1": 0.05, "moderate-2": 0.05, "moderate-3": 0.05})["S4"]
    assert calm["verdict"] == "refuted"
    assert "over 5 nested orders H of these varies by 0 %, of moderate models by 6 %" in calm["evidence"]
    all_better = judged({**H, "high-2": (7.0, 3.0, 0.7)}, seeds=5)["S4"]
    assert all_better["verdict"] == "refuted"
    assert "2 of 2 high models are shown to beat no physics (1.00 m), 0 are shown to be worse" in all_better["evidence"]
    none_better = judged({**H, "high-1": (9.0, 5.0, 2.0)}, seeds=5)["S4"]
    assert none_better["verdict"] == "refuted"


def test_S5_sees_where_percentiles_tell_another_story(judged: Any) -> None:
    """The 90th percentile of four errors is taken from their curve over the horizon."""
    assert judged()["S5"]["numbers"] == {
        "rank correlation of H and H_90": pytest.approx(1.0),
        "verdicts of S1-S4 that differ": 0.0,
    }
    late = {("moderate-2", 10, 0): [0.1, 0.1, 0.1, 20.0]}
    other = judged(curves=late)["S5"]
    assert other["verdict"] == "refuted"
    assert "S1 is refuted instead of confirmed" in other["evidence"] or "S1 is refuted" in other["evidence"]


def test_S6_names_pairs(judged: Any) -> None:
    finding = judged()["S6"]
    assert finding["verdict"] == "confirmed"
    evidence = finding["evidence"]
    words = "4 of 6 comparisons show a moderate model better than no physics with more runs "
    assert f"{words}(after correction for 6 comparisons, Holm: 2), such as " in evidence
    assert "moderate-1 with 10 runs 1.50 m against 30 runs without physics, 4.00 m" in evidence
    assert "moderate-2 (4.00 m alone) with 30 runs 1.20 m against moderate-1 alone, 2.00 m" in evidence
    assert "100 runs 0.60 m" not in evidence, "100 runs are not few"


def test_S6_refuted_and_undecided(judged: Any) -> None:
    worse = {"moderate-1": (8.5, 5.3, 0.5), "moderate-2": (8.6, 5.4, 0.6), "moderate-3": (8.6, 6.6, 0.7)}
    finding = judged({**H, **worse})["S6"]
    assert finding["verdict"] == "refuted"
    assert finding["evidence"].startswith("0 of 6 comparisons show a moderate model better than no physics")
    same = {"moderate-1": (4.0, 1.0, 0.5), "moderate-2": (4.0, 1.0, 0.6), "moderate-3": (4.0, 1.0, 0.7)}
    assert judged({**H, **same})["S6"]["verdict"] == "undecided"


def test_S7_by_second_differences(judged: Any) -> None:
    """Of 0, 1, 0, 1 both second differences are 2 m long; a straight path has none."""
    curves = {(name, 10, 0): ROUGH if name == "none" else SMOOTH for name in H}
    finding = judged(curves=curves, changes=JAGGED)["S7"]
    assert finding["verdict"] == "undecided", "straight true paths: nothing is smoother"
    assert '"no physics" 2.00 m, cooperative 0.00 m in the mean, true paths 0.00 m' in finding["evidence"]
    alike = {(name, 10, 0): ROUGH for name in H}
    assert judged(curves=alike, changes=JAGGED)["S7"]["verdict"] == "refuted"
    true, counts = np.linspace(0.9, 1.1, 8), np.ones(8)
    assert compare_roughness(true, 2.0 * true, 1.2 * true, counts)[0] == "confirmed"
    assert compare_roughness(true, 1.3 * true, 1.2 * true, counts)[0] == "refuted"


def test_a_failed_member_is_left_out_and_named(judged: Any) -> None:
    """Where it has results, `moderate-2` would refute S1."""
    by_claim = judged({**H, "moderate-2": (12.0, None, 9.0)})
    assert by_claim["S1"]["verdict"] == "confirmed"
    assert all(f["evidence"].endswith("left out for want of results: moderate-2") for f in by_claim.values())


def test_nothing_is_decided_without_the_whole(judged: Any, made: Any) -> None:
    without = judged({**H, "none": (8.0, None, 1.0)})
    assert set(verdicts(without).values()) == {"undecided"}
    assert without["S1"]["evidence"] == '"no physics" has no result in every cell'
    one = judged({model: values[:1] for model, values in H.items()})
    assert set(verdicts(one).values()) == {"undecided"}
    some = cells(H)
    del some["high-1", 30, 0]
    partial: Results = made(some, planned=18, family=FAMILY, alone=ALONE, claims=ROLES)
    assert {f["evidence"] for f in judge_findings(partial)} == {"1 of 18 cells are not finished"}
