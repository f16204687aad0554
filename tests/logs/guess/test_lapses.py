"""A sensor that is stuck is drafted with the repair that breaks the run there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.drawn import seeds
from tests.logs.simulated import as_bridge, guess_of, si_log


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
