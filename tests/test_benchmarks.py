"""The rule of `make bench`: a ratio that is worse than recorded by more than 20 % fails, whichever way is better."""

from __future__ import annotations

from typing import Any

import pytest

from tests.benchmarks.__main__ import THREADS, verdict
from tests.benchmarks.compare import Ratio, accepted, compare, read_recorded

RECORDED: dict[str, dict[str, dict[str, Any]]] = {
    "engine": {
        "speed-up": {"better": "higher", "value": 10.0},
        "growth": {"better": "lower", "value": 1.0, "promise": 1.1},
    },
    "study": {"whole [s]": {"better": "lower", "promise": 90.0}, "share": {"better": "lower", "value": None}},
}


@pytest.mark.parametrize(
    ("better", "value", "worse_by", "regressed"),
    [
        ("higher", 10.0, 0.0, False),
        ("higher", 20.0, -0.5, False),
        ("higher", 8.34, 0.199, False),
        ("higher", 8.33, 0.2005, True),
        ("lower", 11.99, 0.199, False),
        ("lower", 12.01, 0.201, True),
        ("lower", 5.0, -0.5, False),
        ("lower", float("nan"), float("nan"), True),
        ("higher", float("nan"), float("nan"), True),
    ],
)
def test_twenty_percent_either_way(better: Any, value: float, worse_by: float, regressed: bool) -> None:
    ratio = Ratio("engine", "speed-up", value, 10.0, better)
    assert ratio.worse_by == pytest.approx(worse_by, abs=1e-3, nan_ok=True)
    assert ratio.regressed is regressed


@pytest.mark.parametrize(
    ("better", "value", "kept"), [("lower", 1.05, True), ("lower", 1.06, False), ("higher", 1.04, False)]
)
def test_a_promise_is_a_bound(better: Any, value: float, kept: bool) -> None:
    assert Ratio("study", "share", value, None, better, 1.05).kept is kept
    assert Ratio("study", "share", value, None, better).kept is None


def test_only_groups_that_ran_are_held_against_theirs() -> None:
    comparison = compare({"engine": {"speed-up": 9.0, "growth": 1.3, "time [s]": 3.0}, "other": {"x": 1.0}}, RECORDED)
    assert [(one.label, one.regressed, one.kept) for one in comparison] == [
        ("speed-up", False, None),
        ("growth", True, False),
    ]


def test_accepting_replaces_values_of_what_ran_and_nothing_else() -> None:
    new = accepted({"study": {"whole [s]": 50.0, "share": 0.3}}, RECORDED)
    assert new["engine"] == RECORDED["engine"]
    assert new["study"] == {"whole [s]": RECORDED["study"]["whole [s]"], "share": {"better": "lower", "value": 0.3}}
    assert RECORDED["study"]["share"]["value"] is None


def test_the_verdict_names_what_regressed_and_how_to_accept_it(capsys: pytest.CaptureFixture[str]) -> None:
    good, bad = Ratio("engine", "speed-up", 9.0, 10.0, "higher"), Ratio("truth", "growth", 14.0, 10.0, "lower")
    assert verdict([good]) == 0
    assert capsys.readouterr().err == ""
    assert verdict([good, bad]) == 1
    output = capsys.readouterr().err
    assert "truth: growth: 14, recorded 10 (lower is better): worse by 40%, more than 20%" in output
    assert "speed-up" not in output
    assert "python -m tests.benchmarks truth --record" in output


def test_what_is_recorded_is_whole() -> None:
    """Every entry belongs to a group and says which way is better; a time is of one machine and is never recorded."""
    for group, entries in read_recorded().items():
        assert group in THREADS
        for label, entry in entries.items():
            assert entry["better"] in ("higher", "lower")
            assert entry.keys() <= {"better", "value", "promise"}
            assert entry.keys() & {"value", "promise"}
            assert "[" not in label or "value" not in entry, label
