"""Verdicts S1 to S7 on maps H(A, N_D) made by hand: what confirms, what refutes, what cannot be told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pytest

from shipid.study.findings import findings
from shipid.study.findings_simulation import CLAIMS
from shipid.study.results import Results

AMOUNTS = (10, 30, 100)
ALONE = {"moderate-1": 2.0, "moderate-2": 4.0, "high-1": 8.0, "high-2": 16.0}
FAMILY = {"moderate": 2, "high": 2}
ROLES = {"moderate": "moderate", "high": "high"}
#: as the paper has it: all fall, `high-2` stays worse than no physics
H = {
    "moderate-1": (1.5, 0.9, 0.5),
    "moderate-2": (2.5, 1.2, 0.6),
    "high-1": (4.5, 2.0, 0.8),
    "high-2": (8.5, 4.2, 1.4),
    "none": (8.0, 4.0, 1.0),
}
ROUGH, SMOOTH = [0.0, 1.0, 0.0, 1.0], [0.0, 1.0, 2.0, 3.0]
Rows = Mapping[str, Sequence[float | None]]


def cells(rows: Rows, *, seeds: int = 1, wobble: Mapping[str, float] | None = None) -> dict[Any, float | None]:
    """H by model and amount for some seeds; odd seeds are higher, even ones lower by the model's `wobble`."""
    found: dict[Any, float | None] = {}
    for model, values in rows.items():
        for amount, value in zip(AMOUNTS, values, strict=False):
            for seed in range(seeds):
                factor = 1 + (wobble or {}).get(model, 0.0) * (1 if seed % 2 else -1)
                found[model, amount, seed] = None if value is None else value * factor
    return found


@pytest.fixture
def judged(made: Any) -> Any:
    """Findings S1-S7 of a map by hand, by name."""

    def judge(rows: Rows = H, *, seeds: int = 1, wobble: Mapping[str, float] | None = None, **options: Any) -> Any:
        made_up = cells(rows, seeds=seeds, wobble=wobble) if "none" in rows else rows
        curves = {(name, 10, seed): ROUGH if name == "none" else SMOOTH for name, _, seed in made_up}
        options = {"curves": curves, "family": FAMILY, "alone": ALONE, "claims": ROLES, **options}
        found = findings(made(made_up, **options))
        assert [finding["id"] for finding in found] == list(CLAIMS)
        assert all("nan" not in finding["evidence"].split() for finding in found)
        return {finding["id"]: finding for finding in found}

    return judge


def verdicts(found: Mapping[str, Any]) -> dict[str, str]:
    return {key: finding["verdict"] for key, finding in found.items()}


def test_the_paper_by_hand(judged: Any) -> None:
    """With five seeds, and the worst model moved most by them, all is confirmed."""
    found = judged(seeds=5, wobble={"high-2": 0.04, "none": 0.01, "moderate-1": 0.01, "moderate-2": 0.01})
    assert verdicts(found) == dict.fromkeys(CLAIMS, "confirmed")


def test_one_seed_cannot_tell_a_fluctuation(judged: Any) -> None:
    found = judged()
    assert verdicts(found) == {**dict.fromkeys(CLAIMS, "confirmed"), "S4": "undecided"}
    assert found["S4"]["evidence"] == (
        "at N_D = 100, 1 of 2 high models beat pure data-driven (1.00 m), 1 does not (high-2 1.40 m); fluctuation "
        "needs 5 nested orders (grid seeds), the study has 1 seed"
    )
    assert "needs 5 nested orders (grid seeds), the study has 4 seeds" in judged(seeds=4)["S4"]["evidence"]


def test_S1_every_moderate_model_and_most_to_the_end(judged: Any) -> None:
    found = judged({**H, "moderate-2": (8.1, 1.2, 0.6)})["S1"]
    assert found["verdict"] == "refuted"
    assert "1 of 2 moderate models (1.50 m to 8.10 m) beat pure data-driven (8.00 m)" in found["evidence"]
    found = judged({**H, "moderate-2": (2.5, 4.0, 0.6)})["S1"]
    assert found["verdict"] == "refuted", "one of two is not most"
    assert found["numbers"]["share in the lead at every N_D"] == 0.5
    assert found["numbers"]["share in the lead at N_D = 100"] == 1.0


def test_S1_only_on_average(judged: Any) -> None:
    """9.5 % below pure data-driven, and 10 % up and down with the seed."""
    found = judged({**H, "moderate-2": (7.24, 1.2, 0.6)}, seeds=2, wobble={"moderate-2": 0.11})["S1"]
    assert found["verdict"] == "undecided"


def test_S2_names_what_does_not_fall(judged: Any) -> None:
    found = judged({**H, "high-2": (8.5, 9.5, 8.6)})["S2"]
    assert found["verdict"] == "refuted"
    assert "4 of 5 models fall" in found["evidence"]
    assert "9 of 10 steps fall, 1 rise by more than 5%; not: high-2" in found["evidence"]
    bump = judged({**H, "high-2": (8.5, 8.6, 8.0)})["S2"]
    assert bump["verdict"] == "confirmed", "a small rise on the way down is no refutation"
    assert "9 of 10 steps fall, 0 rise by more than 5%" in bump["evidence"]
    assert bump["numbers"]["H at N_D = 100 / at 10, median"] == pytest.approx(0.24)


def test_S3_slope_by_hand(judged: Any) -> None:
    """H = 0.5 A at 10 runs, 0.1 A at 30, 0.05 A at 100."""
    slopes = dict(zip(AMOUNTS, (0.5, 0.1, 0.05), strict=True))
    rows = {model: tuple(slope * A for slope in slopes.values()) for model, A in ALONE.items()} | {"none": H["none"]}
    found = judged(rows)["S3"]
    assert found["verdict"] == "confirmed"
    assert found["numbers"] == {
        "least rank correlation of H and A": pytest.approx(1.0),
        "slope at N_D = 10 [m/m]": pytest.approx(0.5),
        "slope at N_D = 100 [m/m]": pytest.approx(0.05),
    }
    turned = {model: values[::-1] for model, values in rows.items()}
    found = judged(turned)["S3"]
    assert found["verdict"] == "refuted"
    assert "steepest at 100" in found["evidence"]


def test_a_weak_trend_is_undecided(judged: Any) -> None:
    """H at 100 runs in the order 3, 1, 2, 4 of A: rank correlation 0.4; H that ends lower, up and down between."""
    found = judged({**H, "moderate-1": (1.5, 0.9, 1.3)})["S3"]
    assert found["verdict"] == "undecided"
    assert found["numbers"]["least rank correlation of H and A"] == pytest.approx(0.4)
    amounts = (10, 20, 30, 100)
    waves = {("none", amount, 0): value for amount, value in zip(amounts, (3.0, 1.0, 3.5, 2.0), strict=True)}
    rows = {model: (8.0, 4.0, 2.0, 1.0) for model in H if model != "none"}
    made_up = waves | {(m, n, 0): v for m, values in rows.items() for n, v in zip(amounts, values, strict=True)}
    assert judged(made_up)["S2"]["verdict"] == "undecided"


def test_S3_needs_a_trend(judged: Any) -> None:
    level = {**H, "moderate-1": (9.0, 9.0, 9.0)}
    assert judged(level)["S3"]["verdict"] == "refuted"
    few = judged({**H, "high-2": (8.5, None, 1.4)})["S3"]
    assert (few["verdict"], few["evidence"][:39]) == ("undecided", "3 physics models, a trend needs 4; left")


def test_S4_worst_and_calm(judged: Any) -> None:
    calm = judged(seeds=5, wobble={"high-2": 0.01, "moderate-1": 0.05, "moderate-2": 0.05})["S4"]
    assert calm["verdict"] == "refuted"
    assert "over 5 nested orders H of these varies by 1%, of moderate models by 6%" in calm["evidence"]
    all_better = judged({**H, "high-2": (7.0, 3.0, 0.9)}, seeds=5)["S4"]
    assert all_better["verdict"] == "refuted"
    assert (
        "2 of 2 high models beat pure data-driven (1.00 m [1.00, 1.00] over 5 seeds), 0 do not"
        in all_better["evidence"]
    )
    none_better = judged({**H, "high-1": (9.0, 5.0, 2.0)}, seeds=5, wobble={"high-1": 0.1, "high-2": 0.1})["S4"]
    assert none_better["verdict"] == "refuted"


def test_S5_sees_where_percentiles_tell_another_story(judged: Any) -> None:
    assert judged()["S5"]["numbers"] == {
        "rank correlation of H and H_90": pytest.approx(1.0),
        "verdicts of S1-S4 that differ": 0.0,
    }
    other = judged(H_90={("moderate-2", 10, 0): 20.0})["S5"]
    assert other["verdict"] == "refuted"
    assert "by H_90 S1 is refuted instead of confirmed" in other["evidence"]
    scrambled = {(model, amount, 0): 1 / value for (model, amount, _), value in cells(H).items() if value}
    assert judged(H_90=scrambled)["S5"]["verdict"] == "refuted"


def test_S6_names_pairs(judged: Any) -> None:
    """The pairs that save most: 30 runs for 100 (0.9 m, 1.0 m), 10 for 30 (2.5 m, 4.0 m); 1.2 m for 2 m alone."""
    evidence = judged()["S6"]["evidence"]
    assert "2 of 2 moderate models beat pure data-driven with more runs: " in evidence
    assert "moderate-1 with 30 runs 0.90 m beats 100 runs without physics, 1.00 m, moderate-2 with 10 runs" in evidence
    assert "moderate-2 with 10 runs 2.50 m beats 30 runs without physics, 4.00 m" in evidence
    assert "1 of 2 moderate models beat more accurate physics alone: " in evidence
    assert evidence.endswith("moderate-2 (4.00 m alone) with 30 runs 1.20 m beats moderate-1 alone, 2.00 m")
    assert "100 runs 0.60 m" not in evidence, "100 runs are not few"


def test_S6_refuted_and_only_on_average(judged: Any) -> None:
    hopeless = {**H, "moderate-1": (4.5, 4.3, 0.5), "moderate-2": (4.6, 4.4, 0.6)}
    found = judged(hopeless)["S6"]
    assert found["verdict"] == "refuted"
    assert found["evidence"].startswith("0 of 2 moderate models beat pure data-driven with more runs; 0 of 2")
    narrow = {**H, "moderate-1": (3.9, 3.8, 0.5), "moderate-2": (3.9, 1.9, 0.6)}
    assert judged(narrow, seeds=2)["S6"]["verdict"] == "confirmed"
    wobble = {"moderate-1": 0.1, "moderate-2": 0.1}
    assert judged(narrow, seeds=2, wobble=wobble)["S6"]["verdict"] == "undecided"


def test_S7_by_second_differences(judged: Any) -> None:
    """Of 0, 1, 0, 1 both second differences are 2 m long; a straight path has none."""
    found = judged()["S7"]
    assert found["verdict"] == "confirmed"
    assert (
        "pure data-driven 2.00 m, cooperative 0.00 m in the median, physics alone 0.00 m, true paths 0.00 m"
        in (found["evidence"])
    )
    curves = {(name, 10, 0): ROUGH for name in H}
    assert judged(curves=curves)["S7"]["verdict"] == "refuted"
    assert judged(curves={})["S7"]["verdict"] == "refuted"


def test_a_failed_member_is_left_out_and_named(judged: Any) -> None:
    """Where it has results, `moderate-2` would refute S1."""
    found = judged({**H, "moderate-2": (9.0, None, 9.0)})
    assert found["S1"]["verdict"] == "confirmed"
    assert all(f["evidence"].endswith("left out for want of results: moderate-2") for f in found.values())


def test_nothing_is_decided_without_the_whole(judged: Any, made: Any) -> None:
    without = judged({**H, "none": (8.0, None, 1.0)})
    assert set(verdicts(without).values()) == {"undecided"}
    assert without["S1"]["evidence"] == "pure data-driven has no result in every cell"
    one = judged({model: values[:1] for model, values in H.items()})
    assert set(verdicts(one).values()) == {"undecided"}
    some = cells(H)
    del some["high-1", 30, 0]
    partial: Results = made(some, planned=15, family=FAMILY, alone=ALONE, claims=ROLES)
    assert {f["evidence"] for f in findings(partial)} == {"1 of 15 cells are not finished"}


def test_a_family_without_results_is_told(judged: Any) -> None:
    found = judged({**H, "high-1": (None,) * 3, "high-2": (None,) * 3})
    assert found["S4"]["verdict"] == "undecided"
    assert found["S4"]["evidence"].startswith("no high model has a result in every cell")
    assert found["S1"]["verdict"] == "confirmed"
    found = judged({**H, "moderate-1": (None,) * 3, "moderate-2": (None,) * 3})
    assert [found[key]["verdict"] for key in ("S1", "S6")] == ["undecided"] * 2


def test_the_nominal_model_counts_nowhere(judged: Any) -> None:
    """It rises with N_D and would refute S2, and it is rough."""
    options = {
        "family": {**FAMILY, "nominal": 1},
        "alone": {**ALONE, "nominal": 0.5},
        "claims": {**ROLES, "nominal": "nominal"},
    }
    with_it = judged({**H, "nominal": (0.5, 0.6, 0.7)}, **options)
    assert {key: found["evidence"] for key, found in with_it.items()} == {
        key: found["evidence"] for key, found in judged().items()
    }
