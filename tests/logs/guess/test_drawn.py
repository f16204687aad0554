"""A few logs drawn by seed: the guess is right, or says that it is unsure; the benchmark `guess` takes 400."""

from __future__ import annotations

from pathlib import Path

import pytest

from shipid.logs.guess.columns import guess
from tests.logs.crews import draw_folder
from tests.logs.drawn_logs import CLOCKS, Drawn, draw, judge
from tests.logs.judged_raw import judge_raw
from tests.strangers_raw import raw_stranger

SEEDS = (302, 306, 323)  # velocities of north and east, speed and course, along and across without units in names
LEAST = 0.85  # share right of the logs of a range
RAW, RUNS = {870183: "right", 870176: "reported"}, 4  # raw folders: all that the log can decide; a frame with z upwards


@pytest.fixture(
    scope="module", params=[range(300, 304), pytest.param(range(304, 324), marks=pytest.mark.slow)], ids=["few", "more"]
)
def words(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[int, str]:
    return {seed: judge(draw(seed, tmp_path_factory.mktemp("drawn") / "logs")).word for seed in request.param}


def test_nothing_is_wrong_and_silent(words: dict[int, str]) -> None:
    assert [seed for seed, word in words.items() if word == "silent"] == []


def test_most_are_right(words: dict[int, str]) -> None:
    assert sum(word == "right" for word in words.values()) >= LEAST * len(words)


@pytest.mark.parametrize("clock", CLOCKS[1::4])
def test_a_clock_in_any_unit_is_read_as_one_in_seconds(clock: str, tmp_path: Path) -> None:
    """Same ship, same columns: the verdict is that of the log in seconds, and nothing is asked of a right clock."""
    seed = SEEDS[CLOCKS.index(clock) % len(SEEDS)]
    words = []
    for one in ("seconds", clock):
        drawn = draw(seed, tmp_path / one / "logs", one)
        words.append(judge(drawn).word)
        assert quiet(drawn)
    assert words == ["right", "right"]


@pytest.mark.parametrize(("seed", "unit"), [(302, "kn"), (323, "mm/s")])
def test_speeds_in_any_unit_are_read(unit: str, seed: int, tmp_path: Path) -> None:
    drawn = draw(seed, tmp_path / "logs", speed=unit)
    assert judge(drawn).word == "right"
    assert unit == "mm/s" or quiet(drawn)  # which is asked where no name says it


def quiet(drawn: Drawn) -> bool:
    """Whether a guess says nothing of the clock and of factors."""
    proposal = guess(drawn.path)
    return not proposal.kinds & {"clock unit", "factor"} and not any("t" in one.about for one in proposal.questions)


@pytest.mark.parametrize("seed", RAW)
def test_raw_folders_are_read_or_it_says_why_not(seed: int, tmp_path: Path) -> None:
    verdict = judge_raw(raw_stranger(seed, tmp_path / "raw", RUNS))
    assert verdict.word == RAW[seed], verdict.reasons


def test_degrees_of_a_log_without_names_are_no_metres(tmp_path: Path) -> None:
    """A noisy track of a boat at 54 N fitted a little better as metres, at 0.015 mm/s, and u came from it."""
    assert judge(draw(710115, tmp_path / "logs")).word == "right"


@pytest.mark.parametrize("seed", [393344, 393381])
def test_revolutions_a_second_that_are_called_rpm_are_read_by_the_way_of_the_ship(seed: int, tmp_path: Path) -> None:
    """They were 60 times too slow without a word."""
    assert judge(draw(seed, tmp_path / "logs")).word == "right"


@pytest.mark.parametrize(("seed", "word"), [(73047, "reported"), (73322, "right")])
def test_columns_without_names_are_not_taken_for_heading_and_sway(seed: int, word: str, tmp_path: Path) -> None:
    """The course alone was taken for the heading, a roll for the sway, without a word."""
    assert judge(draw(seed, tmp_path / "logs")).word == word


@pytest.mark.parametrize("seed", [50459871, 50459918, 50459920])
def test_folders_of_crews_are_read(seed: int, tmp_path: Path) -> None:
    """Positions by their letters alone; 9999 for none among them; the rudder of a ship that takes minutes to turn."""
    verdict = judge_raw(draw_folder(seed, tmp_path))  # type: ignore[arg-type]
    assert verdict.word == "right", verdict.reasons
