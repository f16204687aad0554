"""A few logs drawn by seed: the guess is right, or says that it is unsure; the benchmark `guess` takes 400."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.logs.drawn_logs import draw, judge
from tests.logs.judged_raw import judge_raw
from tests.strangers_raw import raw_stranger

LEAST = 0.85  # share right of the logs of a range
RAW, RUNS = {870183: "right", 870176: "reported"}, 4  # raw folders: all that the log can decide; a frame with z upwards


@pytest.fixture(
    scope="module", params=[range(300, 308), pytest.param(range(308, 328), marks=pytest.mark.slow)], ids=["few", "more"]
)
def words(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[int, str]:
    return {seed: judge(draw(seed, tmp_path_factory.mktemp("drawn") / "logs")).word for seed in request.param}


def test_nothing_is_wrong_and_silent(words: dict[int, str]) -> None:
    assert [seed for seed, word in words.items() if word == "silent"] == []


def test_most_are_right(words: dict[int, str]) -> None:
    assert sum(word == "right" for word in words.values()) >= LEAST * len(words)


def test_a_log_is_the_same_for_the_same_seed(tmp_path: Path) -> None:
    first, second = (draw(7, tmp_path / name / "logs") for name in ("a", "b"))
    files = [sorted(file for file in (tmp_path / name).rglob("*") if file.is_file()) for name in ("a", "b")]
    assert [file.read_bytes() for file in files[0]] == [file.read_bytes() for file in files[1]]
    assert first.asks == second.asks


@pytest.mark.parametrize("seed", RAW)
def test_raw_folders_are_read_or_it_says_why_not(seed: int, tmp_path: Path) -> None:
    verdict = judge_raw(raw_stranger(seed, tmp_path / "raw", RUNS))
    assert verdict.word == RAW[seed], verdict.reasons
