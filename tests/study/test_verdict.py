from __future__ import annotations

import pytest

from shipid.study.plan import NO_MODEL
from shipid.study.verdict import interval, metres, named, runs, undecided, verdict, words


@pytest.mark.parametrize(
    ("always", "on_average", "expected"),
    [(True, True, "confirmed"), (False, True, "undecided"), (False, False, "refuted")],
)
def test_a_verdict_needs_every_seed(always: bool, on_average: bool, expected: str) -> None:
    assert verdict(always, on_average) == expected


def test_undecided_claims_keep_their_words_and_say_why() -> None:
    found = undecided({"S1": "one", "S2": "two"}, "not finished")
    assert [(f["id"], f["claim"], f["verdict"], f["evidence"], f["numbers"]) for f in found] == [
        ("S1", "one", "undecided", "not finished", {}),
        ("S2", "two", "undecided", "not finished", {}),
    ]


def test_numbers_in_sentences() -> None:
    assert [metres(x) for x in (0.123, 9.994, 10.0, 123.46)] == ["0.12 m", "9.99 m", "10.0 m", "123.5 m"]
    assert interval(1.0, 2.5, 3) == " [1.00, 2.50] over 3 seeds"
    assert interval(1.0, 2.5, 1) == ""
    assert [runs(count) for count in (1, 2)] == ["1 run", "2 runs"]


def test_many_names_are_cut_and_one_more_than_the_limit_is_not() -> None:
    assert words(NO_MODEL) == "pure data-driven"
    assert named([NO_MODEL, "b"]) == "pure data-driven, b"
    assert named("abcdef") == "a, b, c, d, e, f"
    assert named("abcdefg") == "a, b, c, d, e and 2 more"
