"""What is asked of a standard manoeuvre: times in ship lengths, whole rows, the side."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shipid.simulation.approach import Controls
from shipid.simulation.request import Request, round_to_rows
from shipid.vessel.load import load_vessel

KEYS = {"n_rpm": 120.0, "execute_at": 10.0, "course_deg": 0.0, "approach": "steady"}
ASKED = Request(Controls(load_vessel("gunnerus-28.9")), 2.0, 3.0, (15.0,), "port", None, 8.0, 0.5, KEYS)


def test_times_are_in_ship_lengths_unless_they_are_given() -> None:
    """A log has what goes by before the first order, too."""
    assert (ASKED.time(30), replace(ASKED, duration=70.0).time(30)) == (250.0, 70.0)


def test_rows_are_whole() -> None:
    assert [round_to_rows(time, ASKED.interval) for time in (1.0, 1.1, 1.5)] == [1.0, 1.5, 1.5]


def test_a_turn_settles_in_time_constants_of_the_ship_within_limits() -> None:
    """The number of lengths is that of the ship between 0 and 200; never less than asked."""
    lengths = ASKED.settling(0.0)
    assert 0 < lengths < 200
    assert ASKED.settling(150.0) == pytest.approx(max(150.0, lengths))
    assert replace(ASKED, passing=1e-6).settling(0.0) == 200.0
