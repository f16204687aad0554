"""Sensors that stand still are found where the rest of the log says that the ship turned, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.files import write_new
from shipid.logs.guess.columns import guess
from shipid.logs.guess.draft import draft_mapping
from shipid.logs.importing import import_log, read_mapping
from tests.logs.simulated import SCHEDULE, as_bridge, si_log

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


def test_a_heading_of_few_rows_that_stands_still_in_a_turn_is_found(tmp_path: Path) -> None:
    """One row a second: five seconds are six rows."""
    stood("Heading", TURNING, 5.0).iloc[::2].to_csv(tmp_path / "log.csv", index=False)
    assert "frozen sensor" in guess(tmp_path / "log.csv").kinds


@pytest.mark.parametrize("name", ["Heading", "r", "COG"])
def test_a_sensor_that_stands_still_in_a_turn_is_broken_out(name: str, tmp_path: Path) -> None:
    stood(name, TURNING, 30.0).to_csv(tmp_path / "log.csv", index=False)
    proposal = guess(tmp_path / "log.csv")
    (found,) = [finding for finding in proposal.findings if finding.kind == "frozen sensor"]
    assert found.columns == (name,)
    assert found.repair is not None
    (interval,) = found.repair["intervals"]
    assert interval == pytest.approx([TURNING, TURNING + 31.0], abs=0.1)
    mapping = write_new(draft_mapping(proposal), tmp_path / "draft.toml")
    whole = import_log(read_mapping(mapping).model_copy(update={"segment": ()}), tmp_path / "log.csv").frame
    assert not whole["t"].between(TURNING + 0.6, TURNING + 29.9).any()
    truth = np.interp(whole["t"], LOG["t"], LOG["v"])
    assert np.abs(whole["v"] - truth).max() < 0.1


@pytest.mark.parametrize(("name", "start", "duration"), [("Heading", TURNING, 3.0), ("COG", STRAIGHT, 30.0)])
def test_what_may_be_so_is_not_reported(name: str, start: float, duration: float, tmp_path: Path) -> None:
    """A short repetition, and a course that stays in a straight run."""
    stood(name, start, duration).to_csv(tmp_path / "log.csv", index=False)
    assert "frozen sensor" not in guess(tmp_path / "log.csv").kinds


@pytest.mark.parametrize("every", [1, 4, 10])
def test_a_slow_receiver_in_a_fast_log_is_not_stuck(every: int, tmp_path: Path) -> None:
    """Course and speed come once in some rows, as of a receiver of 1 Hz or less."""
    frame = bridge()
    held = (np.arange(len(frame)) // every) * every
    frame[["SOG", "COG"]] = frame[["SOG", "COG"]].to_numpy()[held]
    frame.to_csv(tmp_path / "log.csv", index=False)
    assert "frozen sensor" not in guess(tmp_path / "log.csv").kinds


@pytest.mark.parametrize(("name", "share", "told"), [("SOG", 0.9, True), ("r", 0.7, True), ("SOG", 1.2, False)])
def test_a_sensor_that_stops_at_a_limit_is_clipped(name: str, share: float, told: bool, tmp_path: Path) -> None:
    frame = bridge()
    most = share * np.percentile(frame[name].abs(), 99)
    frame.assign(**{name: frame[name].clip(-most, most)}).to_csv(tmp_path / "log.csv", index=False)
    found = [finding for finding in guess(tmp_path / "log.csv").findings if finding.kind == "clipped"]
    assert [finding.columns for finding in found if finding.columns == (name,)] == ([(name,)] if told else [])


@pytest.mark.parametrize("noise", [0.0, 3.0])
def test_a_shaft_at_what_was_ordered_is_not_clipped(noise: float, tmp_path: Path) -> None:
    """Trials at two shaft speeds in turn; a measured speed that varies and never passes the larger one is clipped."""
    frame = bridge()
    orders = np.where(np.arange(len(frame)) // 50 % 2, 180.0, 130.0)
    shaft = np.minimum(orders + np.random.default_rng(3).normal(0, noise, len(frame)), 180.0) if noise else orders
    frame.assign(rpm=shaft).to_csv(tmp_path / "log.csv", index=False)
    found = [one for one in guess(tmp_path / "log.csv").findings if one.columns == ("rpm",)]
    assert [one.kind for one in found if one.kind == "clipped"] == (["clipped"] if noise else [])
    assert all("'rpm'" in one.sentence for one in found if one.kind == "clipped")


@pytest.mark.parametrize("decimals", [0, 1])
def test_a_speed_in_coarse_steps_is_not_clipped(decimals: int, tmp_path: Path) -> None:
    frame = bridge().assign(SOG=lambda x: (x["SOG"] / 0.5144).round(decimals))
    frame.to_csv(tmp_path / "log.csv", index=False)
    found = [finding for finding in guess(tmp_path / "log.csv").findings if finding.kind == "clipped"]
    assert ("SOG",) not in [finding.columns for finding in found]
