"""Instants in place of a rounded clock."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.logs.formats import TextFormat
from shipid.logs.instants import even_clock, even_instants, read_clock
from shipid.logs.mapping import Clock
from tests.drawn import seeds


@pytest.mark.parametrize(
    ("every", "lost"), [(0.1, [(400, 7), (900, 9)]), (0.1, [(300, 12)]), (0.5, [(200, 1), (400, 1)])]
)
def test_lost_rows_of_a_rounded_clock_are_found_whatever_it_counts_from(
    every: float, lost: list[tuple[int, int]]
) -> None:
    """In whole seconds since 1970 as in those since the begin of the log."""
    t = 0.03 + every * np.arange(int(300 / every))
    seconds = np.floor(np.delete(t, np.concatenate([np.arange(first, first + count) for first, count in lost])))
    log = pd.DataFrame(index=range(len(seconds)))
    even, since_1970 = (even_instants(seconds + begin, every, log, Path("log.csv")) - begin for begin in (0.0, 1.7e9))
    np.testing.assert_allclose(since_1970, even, atol=1e-5)
    assert np.abs(even - seconds).max() < 1.0 + every


def test_a_rounded_clock_starts_anew_after_a_pause() -> None:
    t = np.concatenate([np.arange(0.0, 20.0, 0.1), np.arange(300.0, 320.0, 0.1)])
    even, pauses = even_clock(np.floor(t + 1e-9), 0.1)
    assert pauses == 1
    np.testing.assert_allclose(even, t, atol=1.0)
    np.testing.assert_allclose(np.delete(np.diff(even), 199), 0.1)


def test_a_row_that_is_written_late_moves_no_other() -> None:
    """By less than half a step; the instants were moved by half of it where rows were taken for lost."""
    true = 0.1 * np.arange(200)
    even, _ = even_clock(true + 0.03 * (np.arange(200) % 10 == 5), 0.1)
    np.testing.assert_allclose(even, true, atol=1e-9)


def test_a_clock_of_another_rate_is_refused() -> None:
    t = np.floor(np.arange(0.0, 60.0, 0.1) + 1e-9)
    with pytest.raises(DataError, match=r"log\.csv: row \d+, clock\.every: the time is .* from rows every 0\.2 s"):
        even_instants(t, 0.2, pd.DataFrame(index=range(len(t))), Path("log.csv"))


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_a_rounded_clock_keeps_time_where_rows_were_lost(seed: int) -> None:
    """Times err by less than a rounding against each other; rows are whole steps apart, and none goes back."""
    random = np.random.default_rng(seed)
    step = float(random.choice([0.05, 0.1, 0.2]))
    kept = np.sort(random.choice(2000, 1900, replace=False))
    t = 5.0 + step * kept
    even, _ = even_clock(np.floor(t + 1e-9), step)
    assert np.ptp(even - t) <= 1.0 + 1e-9
    apart = np.diff(even) / step
    np.testing.assert_allclose(apart, np.round(apart), atol=1e-6)
    assert apart.min() > 0.5


def test_seconds_and_the_rest_of_them_are_one_time() -> None:
    log = pd.DataFrame({"secs": ["100", "100", "101"], "nsecs": ["0", "500000000", "250000000"]})
    clock = Clock.model_validate({"from": ("secs", "nsecs"), "unit": "s + ns"})
    t = read_clock(log, clock, TextFormat(), Path("log.csv"), "clock")
    np.testing.assert_array_equal(t, [100.0, 100.5, 101.25])
