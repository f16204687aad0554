"""The table of signals: every row is whole, and every question is answered by the table alone."""

from __future__ import annotations

import re

import pytest

from shipid.logs.mapping import UNITS
from shipid.physics.signals import (
    SIGNALS,
    is_shaft,
    is_steering,
    mirror_sign,
    neutral_value,
    signal_of,
    signal_units,
)


@pytest.mark.parametrize("name", SIGNALS)
def test_a_row_is_whole(name: str) -> None:
    row = SIGNALS[name]
    re.compile(row.names)
    assert row.reach[0] < row.reach[1]
    assert row.factor > 0
    assert (row.shown is None) == (row.factor == 1.0)
    assert row.column == "none" or row.role in ("motion", "environment")
    assert not row.turns or (row.angle and row.mirror == -1), (
        "what steers to one side steers to the other in the mirror"
    )
    if row.names:  # the importer reads it in the unit of sailors, too
        assert UNITS[row.unit].get(row.read_in) == pytest.approx(row.factor, rel=1e-15)


def test_commands_are_recognised_by_their_last_name() -> None:
    commands = ("port.n", "port.alpha", "port.delta", "port.pitch")
    assert [is_shaft(name) for name in commands] == [True, False, False, False]
    assert [is_steering(name) for name in commands] == [False, True, True, False]
    assert [mirror_sign(name) for name in commands] == [1, -1, -1, 1]
    assert [neutral_value(name) for name in commands] == [0.0, 0.0, 0.0, 0.8]
    assert signal_units(commands) == dict(zip(commands, ("rev/s", "rad", "rad", "-"), strict=True))
    assert (signal_of("port.n"), signal_of("u")) == ("n", "u")


@pytest.mark.parametrize(
    ("called", "signal"),
    [
        *(("rpm_port", "n"), ("rudder_angle", "delta"), ("azi_port", "alpha"), ("heading", "psi"), ("sog", None)),
        *(
            ("pitch", "theta"),
            ("cpp", "pitch"),
            ("port_pitch", "pitch"),
            ("propeller_pitch", "pitch"),
            ("p/d", "pitch"),
        ),
        *(("pitch_rate", "q"), ("pitch_ratio", "pitch")),
    ],
)
def test_a_name_in_a_log_is_one_signal_at_most(called: str, signal: str | None) -> None:
    matches = [name for name, row in SIGNALS.items() if row.names and re.fullmatch(row.names, called)]
    assert matches == ([signal] if signal else [])
