"""A survey of runs against motion known in closed form."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.study.new import Survey, separation_of_sources, survey_dataset, typical_runs
from tests.logs.conftest import as_dataset, turning

T = np.arange(0.0, 100.0, 0.5)


def test_a_steady_turn_is_described_by_its_numbers() -> None:
    summary = survey_dataset(as_dataset(turning(T), turning(T[:81])))
    assert list(summary.runs.index) == ["a", "b"]
    assert summary.runs["duration"].tolist() == [99.5, 40.0]
    assert summary.step == 0.5
    assert summary.speed == pytest.approx(np.hypot(4.0, 0.5))
    np.testing.assert_allclose(summary.runs["rate"], 0.05)
    assert summary.runs["whole"].all()


def test_a_broken_run_is_judged_by_its_longest_piece() -> None:
    frame = turning(T)
    frame["flags"] = np.where(T == 30.0, 1, 0)
    summary = survey_dataset(as_dataset(frame)).runs.loc["a"]
    assert not summary["whole"]
    assert summary["duration"] == 99.5 - 30.0


def test_jitter_does_not_grow_with_the_lag_and_a_wrong_speed_does() -> None:
    rng, frame = np.random.default_rng(2), turning(T)
    jitter = as_dataset(frame.assign(north=frame["north"] + rng.normal(0, 2.0, len(T))))
    wrong = as_dataset(frame.assign(u=1.1 * frame["u"]))
    assert separation_of_sources(jitter, 20.0) == pytest.approx(separation_of_sources(jitter, 5.0), rel=0.3)
    assert separation_of_sources(wrong, 20.0) > 3 * separation_of_sources(wrong, 5.0)
    assert separation_of_sources(wrong, 1000.0) == 0.0


def surveyed(kinds: list[str], speeds: list[float], failed: str = "") -> Survey:
    numbers = {"kind": kinds, "speed": speeds, "rate": 0.05, "helm": 0.2, "whole": True, "duration": 60.0}
    runs = pd.DataFrame(numbers, index=list("abcdefgh"[: len(kinds)]))
    runs.loc["a", "duration"] = 90.0
    return Survey(runs, 1.0, pd.DataFrame({"run": list(failed)}))


def test_the_typical_run_is_the_middle_one_and_neither_broken_nor_faulty() -> None:
    one = surveyed(["zigzag"] * 5, [5.0, 3.0, 3.9, 4.0, 4.1])
    assert typical_runs(one) == ["d"]
    one.runs.loc["d", "whole"] = False
    assert typical_runs(one)[0] in ("c", "e")
    assert typical_runs(surveyed(["zigzag"] * 5, [5.0, 3.0, 3.9, 4.0, 4.1], "ed")) == ["c"]


def test_each_kind_gives_a_typical_run_where_more_than_six_runs_are_there() -> None:
    for count, chosen in ((6, 1), (8, 2)):
        assert len(typical_runs(surveyed(["zigzag", "turning"] * (count // 2), [3.0] * count))) == chosen
