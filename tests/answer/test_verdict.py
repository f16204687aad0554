"""Words of verdicts and numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import binom

from shipid.answer.verdict import (
    ClaimRule,
    UndecidedClaim,
    difference_with_interval,
    judge_claims,
    length_with_interval,
    model_list,
    quoted_model,
    ratio_with_interval,
    stricter_list,
    too_few_manoeuvres,
    verdict_of,
    weakest_verdict,
)
from shipid.evidence import Differences
from shipid.study.declared import NO_MODEL
from tests.answer.made_up import CASES, Size, rates


def test_verdicts() -> None:
    assert [verdict_of(*given) for given in ((True, False), (False, True), (False, False))] == [
        "confirmed",
        "refuted",
        "undecided",
    ]
    assert weakest_verdict(["confirmed", "confirmed"]) == "confirmed"
    assert weakest_verdict(["confirmed", "undecided"]) == "undecided"
    assert weakest_verdict(["undecided", "refuted"]) == "refuted"


def test_a_rule_without_what_it_needs_is_undecided() -> None:
    def lacking(_: object) -> Any:
        raise UndecidedClaim("no model")

    rules = {"S1": ClaimRule("one", lambda _: ("confirmed", "so", {"x": 1.0})), "S2": ClaimRule("two", lacking)}
    assert [tuple(one.values()) for one in judge_claims(rules, None, "of few")] == [
        ("S1", "one", "confirmed", "so; of few", {"x": 1.0}),
        ("S2", "two", "undecided", "no model; of few", {}),
    ]


def test_numbers_in_words() -> None:
    assert length_with_interval(9.8, 8.13, 11.52) == "9.8 m [8.1, 11.5]"
    assert length_with_interval(0.018, np.nan, np.nan) == "0.018 m"
    mean, low, high = (np.array([value]) for value in (-9.0, -12.0, -6.0))
    assert difference_with_interval(Differences(mean, low, high, mean, mean), 0) == "−9.0 m [−12.0, −6.0]"
    assert too_few_manoeuvres(1) == "1 test manoeuvre gives no interval, 5 would"
    assert too_few_manoeuvres(5) == ""


def test_a_stricter_list_is_said_in_the_same_breath() -> None:
    """0.02 is shown by itself; corrected for four it is not, beside one that is."""
    chances = np.array([0.001, 0.02, 0.02, 0.9])
    assert stricter_list("abcd", chances) == " (after correction for 4 comparisons, Holm: a)"
    assert stricter_list("abcd", chances, names=False).endswith("Holm: 1)")
    assert stricter_list("abc", np.array([0.02, 0.02, 0.5])).endswith("3 comparisons, Holm: none)")
    assert stricter_list("abc", np.array([0.001, 0.9, 0.9])) == stricter_list("ab", chances[1:3]) == ""


def test_ratios_in_words() -> None:
    mean, low, high = (np.log([value]) for value in (2.0, 1.5, 3.0))
    assert ratio_with_interval(Differences(mean, low, high, mean, mean)) == "2.00 [1.50, 3.00]"
    blank = np.array([np.nan])
    assert ratio_with_interval(Differences(mean, blank, blank, blank, blank)) == "2.00"


def test_many_names_are_cut_and_one_more_than_the_limit_is_not() -> None:
    assert quoted_model(NO_MODEL) == '"no physics"'
    assert quoted_model(f"{NO_MODEL} + near") == '"no physics" + near'
    assert model_list([]) == ""
    assert model_list([NO_MODEL, "b"]) == '"no physics" and b'
    assert model_list("abcdef") == "a, b, c, d, e and f"
    assert model_list("abcdefg") == "a, b, c, d, e and 2 more"


TABLES, FEW = 40, 10  # FEW: of S5, which judges S1-S4 twice
SMALL = {"amounts": (10, 30, 100), "moderate": 3, "high": 3}


def allowed(tables: int) -> int:
    """So many tables are confirmed by a rule that errs in 5 % of cases, but for one time in a thousand."""
    return int(binom.ppf(0.999, tables, 0.05))


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(("runs", "seeds"), [(20, 1), pytest.param(6, 5, marks=pytest.mark.slow)])
def test_no_effect_is_confirmed_in_at_most_5_percent(case: str, runs: int, seeds: int) -> None:
    tables = FEW if case == "S5" else TABLES
    moved = rates(case, Size(runs=runs, seeds=seeds, **SMALL), 0.0, tables)  # type: ignore[arg-type]
    assert round(moved["confirmed"] * tables) <= allowed(tables)
    if case != "S5":  # there, H_90 that has nothing to do with H is the opposite of the claim
        assert round(moved["refuted"] * tables) <= allowed(tables)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_more_evidence_never_makes_a_true_effect_less_likely_confirmed(case: str) -> None:
    """More test manoeuvres, then more seeds: the share may fall by what 20 tables leave to chance, no more."""
    seeds = 5 if case == "S4" else 1
    sizes = [Size(runs=8, seeds=seeds, **SMALL), Size(runs=32, seeds=seeds, **SMALL)]  # type: ignore[arg-type]
    sizes.append(Size(runs=32, seeds=seeds + 4, **SMALL))  # type: ignore[arg-type]
    tables = FEW if case == "S5" else 20
    shares = [rates(case, size, 1.0, tables)["confirmed"] for size in sizes]
    chance = 3.3 * np.sqrt(2 * 0.25 / tables)
    assert shares[1] >= shares[0] - chance
    assert shares[2] >= shares[1] - chance
    assert shares[2] > 0.5, "a plain effect is confirmed by 32 manoeuvres"
