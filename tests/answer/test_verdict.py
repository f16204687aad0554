"""Words of verdicts and numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

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
