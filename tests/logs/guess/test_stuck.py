"""Sensors that stand still are found where the rest of the log says that the ship turned, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.logs.simulated import SCHEDULE, as_bridge, guess_of, import_draft, si_log

LOG = si_log()
ENDS = np.cumsum([seconds for seconds, _, _ in SCHEDULE])
TURNING = float(ENDS[7]) + 2.0  # s: the first circle begins
STRAIGHT = float(ENDS[6]) + 40.0


def bridge() -> pd.DataFrame:
    """A log with speed and course over ground."""
    course = np.degrees(LOG["psi"] + np.arctan2(LOG["v"], LOG["u"])) % 360.0
    frame = as_bridge(LOG).drop(columns=["u", "v"]).rename(columns={"psi": "Heading"})
    return frame.assign(SOG=np.hypot(LOG["u"], LOG["v"]).round(3), COG=course.round(1))


def stood(name: str, start: float, duration: float) -> pd.DataFrame:
    frame = bridge()
    rows = frame["time"].between(start, start + duration)
    frame.loc[rows, name] = frame.loc[rows, name].iloc[0]
    return frame


@pytest.mark.parametrize("name", ["Heading", "r", "COG"])
def test_a_sensor_that_stands_still_in_a_turn_is_broken_out(name: str, tmp_path: Path) -> None:
    proposal = guess_of(tmp_path, stood(name, TURNING, 30.0))
    (found,) = [finding for finding in proposal.findings if finding.kind == "frozen sensor"]
    assert found.columns == (name,)
    assert found.repair is not None
    turned, told = LOG.loc[LOG["t"].between(TURNING, TURNING + 30.0), ["t", "psi", "r"]], found.sentence
    turn = turned["psi"].iloc[-1] - turned["psi"].iloc[0] - 30.0 * turned["r"].iloc[0] * (name == "r")
    assert float(told[told.rindex("(") + 1 :].removesuffix(" deg)")) == pytest.approx(np.degrees(turn), abs=2.0)
    (interval,) = found.repair["intervals"]
    assert interval == pytest.approx([TURNING, TURNING + 31.0], abs=0.1)
    whole = import_draft(tmp_path, proposal).frame
    assert not whole["t"].between(TURNING + 0.6, TURNING + 29.9).any()
    truth = np.interp(whole["t"], LOG["t"], LOG["v"])
    assert np.abs(whole["v"] - truth).max() < 0.1


@pytest.mark.parametrize(("name", "start", "duration"), [("Heading", TURNING, 3.0), ("COG", STRAIGHT, 30.0)])
def test_what_may_be_so_is_not_reported(name: str, start: float, duration: float, tmp_path: Path) -> None:
    """A short repetition, and a course that stays in a straight run."""
    assert "frozen sensor" not in guess_of(tmp_path, stood(name, start, duration)).kinds
