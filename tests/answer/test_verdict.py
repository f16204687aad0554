"""Words of verdicts and numbers."""

from __future__ import annotations

import numpy as np

from shipid.answer.verdict import (
    every,
    interval,
    measured,
    metres,
    named,
    runs,
    shown,
    some,
    span,
    too_few,
    undecided,
    verdict,
    weakest,
    words,
)
from shipid.evidence import Contrasts
from shipid.study.declared import NO_MODEL


def test_verdicts() -> None:
    assert verdict(True, False) == "confirmed"
    assert verdict(False, True) == "refuted"
    assert verdict(False, False) == "undecided"
    assert weakest(["confirmed", "confirmed"]) == "confirmed"
    assert weakest(["confirmed", "undecided"]) == "undecided"
    assert weakest(["undecided", "refuted"]) == "refuted"


def test_all_need_no_correction_and_some_do() -> None:
    """0.02 for each of three: all are shown; beside one that is not, 0.02 x 3 shows none."""
    assert every(np.array([0.02, 0.02, 0.02]))
    assert shown(np.array([0.02, 0.02, 0.02])).all()
    assert not some(np.array([0.02, 0.02, 0.5]))
    assert shown(np.array([0.002, 0.02, 0.5])).tolist() == [True, False, False]
    assert not every(np.array([]))
    assert not every(np.array([np.nan]))


def test_numbers_in_words() -> None:
    assert metres(9.99) == "9.99 m"
    assert metres(9.996) == "10.0 m"
    assert interval(1.0, 12.0, 10.5) == " [1.0, 12.0]"
    assert (metres(-1e-9), interval(-1e-9, 0.5, 0.2)) == ("0.00 m", " [0.00, 0.50]"), "no minus zero"
    assert [metres(value) for value in (0.42, 0.0423, -0.00423, 0.000423, 1e-7)] == [
        "0.42 m",
        "0.042 m",
        "-0.0042 m",
        "0.00042 m",
        "0.00 m",
    ]
    assert metres(0.018) + interval(0.0, 3.42, 0.018) == "0.018 m [0.000, 3.420]", "digits that match"
    assert metres(9.8) + interval(8.13, 11.52, 9.8) == "9.80 m [8.13, 11.52]"
    assert interval(-0.001, 0.0123, 0.01) == " [-0.001, 0.012]"
    assert interval(np.nan, np.nan, 1.0) == ""
    assert runs(1) == "1 run"
    assert too_few(1) == "1 test manoeuvre gives no interval, 5 would"
    assert too_few(5) == ""


def test_a_difference_has_the_decimals_of_its_greatest_number_whatever_its_sign() -> None:
    mean, low, high = (np.array([value]) for value in (-9.0, -12.0, -6.0))
    assert measured(Contrasts(mean, low, high, mean, mean), 0) == "-9.0 m [-12.0, -6.0]"
    assert measured(Contrasts(-mean, -high, -low, mean, mean), 0) == "9.0 m [6.0, 12.0]"


def test_a_range_of_one_number_is_that_number() -> None:
    assert span(metres(0.5), metres(2.0)) == "0.50 m to 2.00 m"
    assert span("85%", "85%") == "85%"


def test_undecided_claims_keep_their_words_and_say_why() -> None:
    claims = undecided({"S1": "one", "S2": "two"}, "not finished")
    assert [(f["id"], f["claim"], f["verdict"], f["evidence"], f["numbers"]) for f in claims] == [
        ("S1", "one", "undecided", "not finished", {}),
        ("S2", "two", "undecided", "not finished", {}),
    ]


def test_many_names_are_cut_and_one_more_than_the_limit_is_not() -> None:
    assert words(NO_MODEL) == '"no physics"'
    assert words(f"{NO_MODEL} + near") == '"no physics" + near'
    assert named([]) == ""
    assert named([NO_MODEL, "b"]) == '"no physics" and b'
    assert named("abcdef") == "a, b, c, d, e and f"
    assert named("abcdefg") == "a, b, c, d, e and 2 more"
