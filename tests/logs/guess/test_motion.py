"""Velocities and yaw rate are the columns whose integrals are the track and the heading."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.logs.guess.clues import State
from shipid.logs.guess.motion import choose_velocities, choose_yaw_rate
from tests.logs.simulated import KNOT, si_log, state_with_pose

LOG = si_log()
T, PSI, U, V, R = (LOG[name].to_numpy() for name in ("t", "psi", "u", "v", "r"))
BODY = U + 1j * V
GROUND = BODY * np.exp(1j * PSI)


def described(state: State) -> dict[str, tuple[str, str, int]]:
    """Column of the dataset -> source, unit, sign."""
    return {c.name: (c.source, c.unit, c.extra.get("sign", 1)) for c in state.suggestions}


def kinds(state: State) -> set[str]:
    return {finding.kind for finding in state.findings}


VELOCITIES: dict[str, tuple[dict[str, np.ndarray], dict[str, tuple[str, str, int]], set[str]]] = {
    "body": ({"u": U, "v": V}, {"u": ("u", "m/s", 1), "v": ("v", "m/s", 1)}, set()),
    "knots": ({"u": U / KNOT, "v": V / KNOT}, {"u": ("u", "kn", 1), "v": ("v", "kn", 1)}, {"knots"}),
    "to port": ({"u": U, "v": -V}, {"u": ("u", "m/s", 1), "v": ("v", "m/s", -1)}, {"wrong sign of v"}),
    "swapped": ({"v": U, "u": V}, {"u": ("v", "m/s", 1), "v": ("u", "m/s", 1)}, {"u and v swapped"}),
    "earth": (
        {"u": GROUND.real, "v": GROUND.imag},
        {"u": ("u", "m/s", 1), "v": ("v", "m/s", 1)},
        {"earth-fixed velocities"},
    ),
    "under other names": (
        {"channel a": U, "channel b": V, "channel c": np.sin(T)},
        {"u": ("channel a", "m/s", 1), "v": ("channel b", "m/s", 1)},
        {"velocities under other names"},
    ),
    "speed and course": (
        {"sog": np.abs(GROUND) / KNOT, "cog": np.degrees(np.angle(GROUND)) % 360.0},
        {"speed": ("sog", "kn", 1), "course": ("cog", "deg", 1)},
        set(),
    ),
    "of another ship": ({"u": 3.0 * np.sin(T), "v": np.cos(T)}, {}, set()),
}


@pytest.mark.parametrize("name", VELOCITIES)
def test_velocities(name: str) -> None:
    columns, expected, findings = VELOCITIES[name]
    state = state_with_pose(columns)
    choose_velocities(state)
    assert described(state) == expected
    assert kinds(state) == findings
    if expected:
        assert state.velocity is not None
        assert state.body is not None
        np.testing.assert_allclose(state.velocity, GROUND, atol=1e-9)
        np.testing.assert_allclose(state.body, BODY, atol=1e-9)


def test_a_factor_is_seen_with_its_error() -> None:
    state = state_with_pose({"u": 1.05 * U, "v": 1.05 * V})
    choose_velocities(state)
    (finding,) = state.findings
    assert finding.kind == "factor"
    assert finding.repair is not None
    assert finding.repair["factor"] == pytest.approx(1 / 1.05, abs=0.003)


@pytest.mark.parametrize(
    ("columns", "expected", "findings"),
    [
        ({"rot": np.degrees(R)}, ("rot", "deg/s", 1), set()),
        ({"rot": -R}, ("rot", "rad/s", -1), {"wrong sign of r"}),
        ({"rot [deg/s]": R}, ("rot [deg/s]", "rad/s", 1), {"unit of r"}),
        ({"p": R, "r": np.sin(T / 3)}, ("p", "rad/s", 1), {"yaw rate under another name"}),
        ({"r": np.sin(T / 3)}, None, {"yaw rate does not fit"}),
        ({"roll rate": 0.3 * R + 0.1 * np.sin(T)}, None, set()),
    ],
    ids=["deg/s", "sign", "unit", "misleading", "none", "roll"],
)
def test_yaw_rate(columns: dict[str, np.ndarray], expected: tuple[str, str, int] | None, findings: set[str]) -> None:
    state = state_with_pose(columns)
    choose_yaw_rate(state)
    assert described(state).get("r") == expected
    assert kinds(state) == findings
    if expected is not None:
        assert state.r is not None
        np.testing.assert_allclose(state.r, R, atol=1e-12)


def test_a_ship_that_hardly_turns_has_a_yaw_rate_by_its_name_alone() -> None:
    state = state_with_pose({"rot": 0.01 * np.sin(T), "other": np.cos(T)})
    state.psi = 1e-4 * np.sin(T)
    choose_yaw_rate(state)
    (column,) = state.suggestions
    assert (column.source, column.unit) == ("rot", "deg/s")
    assert column.confidence < 0.5
