"""Every column that a draft leaves out has a reason, which names what is in its place."""

from pathlib import Path

import numpy as np
import pytest

from shipid.logs.guess.draft import draft_text
from tests.logs.simulated import as_bridge, guess_of, si_log


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("Fuel rate", "noise", "a quantity that a dataset does not take"),
        ("Rudder order", "rudder", "an order, and the measured rudder is read from 'rudder'"),
        ("Wind speed [deg]", "noise", "its unit deg does not fit wind speed"),
        ("GPS time", "clock", "it is another clock"),
        ("GPS Week", "noise", "315964800 + 604800 weeks + seconds, less 18 s"),
        ("row", "number", "it holds the numbers of the rows"),
    ],
)
def test_a_column_that_is_not_used_says_why(name: str, values: str, message: str, tmp_path: Path) -> None:
    log = as_bridge(si_log())
    drawn = {"noise": np.random.default_rng(1).normal(size=len(log)), "number": np.arange(len(log))}
    drawn["clock"] = 3600.0 + 0.997 * log["time"]
    added = drawn.get(values, log.get(values))
    proposal = guess_of(tmp_path, log.assign(**{name: added}))
    assert list(proposal.unused) == [name]
    assert message in proposal.unused[name]
    assert f"# column {name!r} is not used: {proposal.unused[name]}" in draft_text(proposal)


@pytest.mark.parametrize("name", ["SOG [km/h]", "Fahrt \u00fc. Grund [km/h]"])
def test_a_speed_without_a_course_is_not_said_to_differ_from_the_motion(name: str, tmp_path: Path) -> None:
    """It was said that the motion did not bear out a speed that agreed with the positions."""
    log = as_bridge(si_log())
    speed = 3.6 * np.hypot(log["u"], log["v"])
    assert guess_of(tmp_path, log.drop(columns=["u", "v"]).assign(**{name: speed})).unused == {
        name: "it may be speed: speed and course are read where both are there and fit the track"
    }
