"""Topics are joined on one clock, and each keeps its own instants."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.logs.topics import join_topics, message_times, recording_errors, topic_rows
from tests.drawn import seeds


@pytest.mark.parametrize("seed", seeds(3, 20))
def test_what_is_joined_is_what_was_said(seed: int) -> None:
    rng = np.random.default_rng(seed)
    topics = {
        name: pd.DataFrame({"time": np.sort(rng.choice(200, size, replace=False)) / 10.0, "x": rng.normal(size=size)})
        for name, size in zip("abc", rng.integers(2, 100, 3), strict=True)
    }
    table = join_topics(topics, Path("log"))
    assert np.all(np.diff(table["time"]) > 0)
    for name, said in topics.items():
        here = table.dropna(subset=[f"{name}.x"])
        np.testing.assert_array_equal(here[["time", f"{name}.x"]], said)
    assert {row["topic"]: row["messages"] for row in topic_rows(topics)} == {
        name: len(one) for name, one in topics.items()
    }


def test_a_table_that_no_memory_holds_is_refused() -> None:
    wide = pd.DataFrame(np.zeros((1000, 1000))).assign(time=np.arange(1000.0))
    with pytest.raises(DataError, match="name the topics that are needed"):
        join_topics({str(number): wide for number in range(25)}, Path("log"))


def test_stamps_that_go_back_or_are_of_another_clock_are_not_taken() -> None:
    came = 1000.0 + np.arange(10.0)
    np.testing.assert_array_equal(message_times(came, came - 0.2), came - 0.2)
    for stamps in (came - 500.0, came[::-1], np.where(came == 1005.0, np.nan, came)):
        np.testing.assert_array_equal(message_times(came, stamps), came)


def test_a_library_that_is_not_there_is_named() -> None:
    with (
        pytest.raises(DataError, match=r"needs rosbags: pip install 'shipid\[robots\]'"),
        recording_errors(Path("log.bag"), "a recording of ROS", "rosbags"),
    ):
        raise ImportError


def test_a_count_that_no_memory_holds_is_one_line() -> None:
    with (
        pytest.raises(DataError, match="more memory than there is: damaged"),
        recording_errors(Path("log.mcap"), "a recording of ROS", "rosbags"),
    ):
        raise MemoryError
