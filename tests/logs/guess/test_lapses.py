"""Lapses of commands are drafted with what mends them, or asked about where they may be orders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.logs.guess.columns import guess
from tests.drawn import seeds
from tests.logs.simulated import as_bridge, globe, guess_of, import_draft, si_log


def test_lapses_of_commands_are_drafted_and_mended(tmp_path: Path) -> None:
    """Before, a shaft that is 0 for two seconds, and a rudder of 90 deg in one row, came into the dataset silently."""
    clean = globe(0)
    frame = clean.copy()
    for place in (300, 1200, 2000):
        frame.loc[place : place + 3, "rpm"] = 0.0
        frame.loc[place + 20, "rudder"] = 90.0
    expected, proposal = guess_of(tmp_path, clean), guess_of(tmp_path, frame)
    assert "lapses of a command" not in expected.kinds
    found = {one.columns: one for one in proposal.findings if one.kind == "lapses of a command"}
    assert set(found) == {("rpm",), ("rudder",)}
    assert "is 0 in 12 rows at 3 places" in found["rpm",].sentence
    assert f"t = {clean['time'][300]:g}" in found["rpm",].sentence
    log, mended = si_log(0), import_draft(tmp_path, proposal)
    shaft = next(one.name for one in proposal.columns if one.source == "rpm")
    truth = np.interp(mended.frame["t"], log["t"], log["n"])
    assert mended.frame[shaft].to_numpy() == pytest.approx(truth, abs=0.05)


def test_lapses_in_files_of_a_folder_are_asked(tmp_path: Path) -> None:
    """A repair would have times of one file."""
    frame = globe(0)
    frame.loc[300:303, "rpm"] = 0.0
    for number, rows in enumerate(np.array_split(np.arange(len(frame)), 2)):
        frame.iloc[rows].to_csv(tmp_path / f"run{number}.csv", index=False)
    proposal = guess(tmp_path)
    (found,) = (one for one in proposal.findings if one.kind == "lapses of a command")
    (asked,) = (one for one in proposal.questions if "'rpm' is 0" in one.sentence)
    assert found.repair is None
    assert asked.sentence.endswith("Unless it was so, leave these cells empty, and draft again")


def turning_log(seed: int) -> pd.DataFrame:
    """A log with heading, yaw rate, speed and course over ground, from the begin of its circles on."""
    log = si_log(seed)
    course = np.degrees(log["psi"] + np.arctan2(log["v"], log["u"])) % 360.0
    frame = as_bridge(log).drop(columns=["u", "v"]).rename(columns={"psi": "Heading"})
    return frame.assign(SOG=np.hypot(log["u"], log["v"]).round(3), COG=course.round(1))


@pytest.mark.parametrize("name", ["Heading", "r", "COG"])
@pytest.mark.parametrize("seed", seeds(1, 6))
def test_a_sensor_that_is_stuck_in_a_turn_is_broken_out(name: str, seed: int, tmp_path: Path) -> None:
    """For 5 to 15 % of the log, from the begin of a circle; a short repetition is none."""
    random, frame = np.random.default_rng(seed), turning_log(seed)
    first = 822 + int(random.integers(0, 6))
    for rows, found in ((int(random.uniform(0.05, 0.15) * len(frame)), 1), (6, 0)):
        stuck = frame.copy()
        stuck.loc[first : first + rows, name] = frame.loc[first, name]
        seen = [one for one in guess_of(tmp_path, stuck).findings if one.kind == "frozen sensor"]
        assert [one.columns for one in seen] == [(name,)] * found
        for one in seen:
            assert one.repair is not None
            (interval,) = one.repair["intervals"]
            assert interval == pytest.approx(frame["time"].iloc[[first, first + rows + 1]].to_list(), abs=1.1)
            ended = guess_of(tmp_path, stuck.iloc[: first + rows])  # stuck to its last row
            spans = [
                one.repair["intervals"][-1] for one in ended.findings if one.kind == "frozen sensor" and one.repair
            ]
            assert all(span[1] < frame["time"].iloc[first + rows] + 1.1 for span in spans)
