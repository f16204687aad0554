"""Velocities and yaw rate are the columns whose integrals are the track and the heading."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shipid.logs.guess.clues import State
from shipid.logs.guess.motion import check_clock, choose_motion, report_misnomers
from tests.logs.conftest import SPEEDS
from tests.logs.simulated import KNOT, si_log, state_of, state_with_pose

LOG = si_log()
T, PSI, U, V, R = (LOG[name].to_numpy() for name in ("t", "psi", "u", "v", "r"))
BODY = U + 1j * V
GROUND = BODY * np.exp(1j * PSI)


def chosen(columns: dict[str, np.ndarray]) -> State:
    """The motion of these columns beside a position and a heading."""
    pose = {"N": LOG["north"].to_numpy(), "E": LOG["east"].to_numpy(), "heading": np.degrees(PSI) % 360.0}
    state = state_of(pose | columns, T)
    choose_motion(state, Path("log.csv"))
    report_misnomers(state)
    return state


def described(state: State) -> dict[str, tuple[str, str, int]]:
    """Column of the dataset -> source, unit, sign."""
    return {
        c.name: (c.source, c.unit, c.extra.get("sign", 1))
        for c in state.suggestions
        if c.name in ("u", "v", "r", "speed", "course")
    }


def kinds(state: State) -> set[str]:
    return {finding.kind for finding in state.findings}


VELOCITIES: dict[str, tuple[dict[str, np.ndarray], dict[str, tuple[str, str, int]], set[str]]] = {
    "body": ({"u": U, "v": V}, {"u": ("u", "m/s", 1), "v": ("v", "m/s", 1)}, set()),
    "knots": ({"u": U / KNOT, "v": V / KNOT}, {"u": ("u", "kn", 1), "v": ("v", "kn", 1)}, {"other unit"}),
    "to port": ({"u": U, "v": -V}, {"u": ("u", "m/s", 1), "v": ("v", "m/s", -1)}, {"other sign"}),
    "swapped": ({"v": U, "u": V}, {"u": ("v", "m/s", 1), "v": ("u", "m/s", 1)}, {"other name"}),
    "earth": (
        {"u": GROUND.real, "v": GROUND.imag},
        {"u": ("u", "m/s", 1), "v": ("v", "m/s", 1)},
        {"other name"},
    ),
    "under other names": (
        {"channel a": U, "channel b": V, "channel c": np.sin(T)},
        {"u": ("channel a", "m/s", 1), "v": ("channel b", "m/s", 1)},
        {"other name"},
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
    state = chosen(columns)
    assert described(state) == expected
    assert kinds(state) == findings
    if expected:
        assert state.velocity is not None
        assert state.body is not None
        np.testing.assert_allclose(state.velocity, GROUND, atol=1e-9)
        np.testing.assert_allclose(state.body, BODY, atol=1e-9)


def test_a_factor_is_seen_with_its_error() -> None:
    state = chosen({"u": 1.05 * U, "v": 1.05 * V})
    (finding,) = state.findings
    assert finding.kind == "factor"
    assert finding.repair is not None
    assert finding.repair["factor"] == pytest.approx(1 / 1.05, abs=0.003)


def spoken(unit: str, kind: str, named: bool, factor: float = 1.0) -> dict[str, np.ndarray]:
    """Body velocities, or speed and course, in a unit that the names say or not."""
    more, size = f" [{unit}]" * named, factor / SPEEDS[unit]
    if kind == "body":
        return {f"u{more}": size * U, f"v{more}": size * V}
    return {f"sog{more}": size * np.abs(GROUND), "cog": np.degrees(np.angle(GROUND)) % 360.0}


@pytest.mark.parametrize("unit", SPEEDS)
@pytest.mark.parametrize(("kind", "named"), [("body", False), ("speed and course", True), ("speed and course", False)])
def test_every_unit_of_speed_is_drafted(unit: str, kind: str, named: bool) -> None:
    """A unit in the name is no finding; another than m/s that no name says is one, if rare."""
    state = chosen(spoken(unit, kind, named))
    assert {one.unit for one in state.suggestions if one.name in ("u", "v", "speed")} == {unit}
    usual = unit == "m/s" or (kind != "body" and unit in ("kn", "km/h"))
    assert kinds(state) == (set() if named or usual else {"other unit"})
    assert state.questions == []
    assert state.velocity is not None
    np.testing.assert_allclose(state.velocity, GROUND, atol=1e-9)


@pytest.mark.parametrize(("wrong", "asked"), [(3.0, 0), (60.0, 1), (1e-3, 1)])
def test_a_ship_that_goes_as_none_does_is_asked(wrong: float, asked: int) -> None:
    """Without velocities in the log the pace of the track says that the clock has another unit."""
    state = state_with_pose({}, 1.0 / wrong)
    check_clock(state)
    check_clock(state)  # once is enough
    assert len(state.questions) == asked


@pytest.mark.parametrize(
    ("columns", "expected", "findings"),
    [
        ({"rot": np.degrees(R)}, ("rot", "deg/s", 1), set()),
        ({"rot": -R}, ("rot", "rad/s", -1), {"other sign"}),
        ({"rot [deg/s]": R}, ("rot [deg/s]", "rad/s", 1), {"other unit"}),
        ({"p": R, "r": np.sin(T / 3)}, ("p", "rad/s", 1), {"other name"}),
        ({"r": np.sin(T / 3)}, None, {"yaw rate does not fit"}),
        ({"roll rate": 0.3 * R + 0.1 * np.sin(T)}, None, set()),
    ],
    ids=["deg/s", "sign", "unit", "misleading", "none", "roll"],
)
def test_yaw_rate(columns: dict[str, np.ndarray], expected: tuple[str, str, int] | None, findings: set[str]) -> None:
    state = chosen(columns)
    assert described(state).get("r") == expected
    assert kinds(state) == findings
    if expected is not None:
        assert state.r is not None
        np.testing.assert_allclose(state.r, R, atol=1e-12)
