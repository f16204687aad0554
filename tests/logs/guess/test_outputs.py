"""Measured thrust and torque are found by their names and units, and no other column is."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.logs.guess.outputs import reserve_outputs, suggest_outputs
from tests.logs.simulated import si_log, state_with_pose

LOG = si_log()
FORCE = 1000.0 + 10 * np.sin(0.1 * LOG["t"].to_numpy())


def told(**columns: np.ndarray) -> dict[str, tuple[str, str]]:
    """Outputs that are drafted in a log whose shaft speed is known: name -> column, unit."""
    state = state_with_pose(columns)
    chosen = reserve_outputs(state)
    state.suggest("propeller.n", "rpm", "rpm", 1.0, "known")
    suggest_outputs(state, chosen)
    return {one.name: (one.source, one.unit) for one in state.suggestions if one.source != "rpm"}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("thrust", ("propeller.thrust", "N")),
        ("Thrust [kN]", ("propeller.thrust", "kN")),
        ("thrust_kN", ("propeller.thrust", "kN")),
        ("thrustkN", ("propeller.thrust", "kN")),
        ("THRUST_KN", ("propeller.thrust", "kN")),
        ("T_prop [N]", ("propeller.thrust", "N")),
        ("Schub_BB [kN]", ("port.thrust", "kN")),
        ("shaftTorque_kNm", ("propeller.torque", "kN m")),
        ("torque stbd (Nm)", ("starboard.torque", "N m")),
        ("Q [kNm]", ("propeller.torque", "kN m")),
        ("Drehmoment", ("propeller.torque", "N m")),
        ("rudder force [N]", ("rudder.normal_force", "N")),
        ("Bow thruster force [kN]", ("bow.side_force", "kN")),
        ("stern_tunnel_force_kN", ("stern.side_force", "kN")),
        ("tunnelForce [N]", ("bow.side_force", "N")),
        ("bow thruster power", None),
        ("q", None),
        ("thrust_cmd", None),
        ("thrust [%]", None),
        ("bow thruster", None),
        ("thruster angle", None),
        ("torque [A]", ("propeller.torque", "N m")),
        ("power_kw", None),
    ],
)
def test_a_name_says_an_output_and_its_unit(name: str, expected: tuple[str, str] | None) -> None:
    assert told(**{name: FORCE}) == ({} if expected is None else {expected[0]: (name, expected[1])})


def test_a_thrust_without_a_shaft_may_be_an_order_and_its_unit_is_asked_for() -> None:
    state = state_with_pose({"thrust": FORCE})
    suggest_outputs(state, reserve_outputs(state))
    assert [question.about for question in state.questions] == [("thrust",), ("force", "thrust")]
    assert [(one.name, one.source) for one in state.suggestions] == [("propeller.force", "thrust")]


def test_an_output_belongs_to_the_only_shaft() -> None:
    state = state_with_pose({"thrust [N]": FORCE, "rpm": FORCE})
    state.suggest("thruster.n", "rpm", "rpm", 1.0, "a test")
    suggest_outputs(state, reserve_outputs(state))
    assert state.suggestions[-1].name == "thruster.thrust"


def test_a_constant_column_is_no_measurement() -> None:
    assert told(**{"thrust [N]": 0 * FORCE}) == {}


@pytest.mark.parametrize(("command", "asked"), [("propeller.n", True), ("propeller.force", False)])
def test_a_thrust_is_the_order_that_the_vessel_takes(command: str, asked: bool) -> None:
    """Before, a vessel that takes a shaft speed had no order of its screw, and no question named the column."""
    state = state_with_pose({"thrust [N]": FORCE})
    state.commands = (command,)
    suggest_outputs(state, reserve_outputs(state))
    (drafted,) = state.suggestions
    unit, extra = ("rpm", {"factor": 1.0}) if asked else ("N", {})  # an empty factor is asked for
    assert (drafted.name, drafted.source, drafted.unit, drafted.extra) == (command, "thrust [N]", unit, extra)
    (question,) = state.questions
    assert ("curve of pairs (N, rpm)" in question.sentence) == asked
