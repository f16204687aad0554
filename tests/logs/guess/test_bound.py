"""Commands of a draft take the names of a vessel: by signal and side; what is not logged is stopped, or asked."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.logs.guess.bound import name_commands
from shipid.logs.guess.clues import State
from shipid.logs.guess.commands import choose_commands
from shipid.logs.guess.outputs import reserve_outputs, suggest_outputs
from shipid.vessel.load import Vessel
from shipid.vessel.template import Particulars, first_guess
from tests.logs.simulated import si_log, state_with_pose

LOG = si_log()
R, ALPHA, N = (LOG[name].to_numpy() for name in ("r", "alpha", "n"))
RUDDER, RPM = -np.degrees(ALPHA), 60.0 * N
TWIN = {"port_rudder.delta", "starboard_rudder.delta", "port.n", "starboard.n"}


def vessel(**known: object) -> Vessel:
    return first_guess(Particulars(30.0, 8.0, 2.8, 0.55, **known), "guess", "guess.toml").vessel  # type: ignore[arg-type]


def drafted(columns: dict[str, np.ndarray], ship: Vessel) -> tuple[State, dict[str, str]]:
    state = state_with_pose(columns)
    state.r = R
    outputs = reserve_outputs(state)
    choose_commands(state)
    suggest_outputs(state, outputs)
    name_commands(state, ship)
    return state, {one.name: one.source for one in state.suggestions}


@pytest.mark.parametrize(
    ("columns", "asked"),
    [
        (("rudder port", "rudder stbd", "rpm port", "rpm stbd"), 0),
        (("rudder", "rpm"), 0),
        (("rudder port", "rpm port", "rpm stbd"), 1),
    ],
)
def test_two_shafts_have_their_sides_or_share_a_column(columns: tuple[str, ...], asked: int) -> None:
    values = {name: RUDDER if "rudder" in name else RPM for name in columns}
    state, names = drafted(values, vessel(shafts=2))
    assert set(names) == TWIN
    assert len(state.questions) == asked
    assert names["starboard.n"] in ("rpm stbd", "rpm")


def test_a_ship_with_one_rudder_takes_one_of_two_columns_and_says_so() -> None:
    state, names = drafted({"rudder port": RUDDER, "rudder stbd": RUDDER, "rpm": RPM, "thrust [kN]": RPM}, vessel())
    assert names["rudder.delta"] == "rudder port"
    assert names["propeller.thrust"] == "thrust [kN]"
    assert [one.kind for one in state.findings] == ["several columns for one command"]


def test_an_azimuth_without_a_side_turns_both_units() -> None:
    _, names = drafted({"azimuth": ALPHA, "rpm": RPM}, vessel(propulsor="azimuth"))
    assert set(names) == {"port.alpha", "starboard.alpha", "port.n", "starboard.n"}


def test_a_ship_without_an_angle_takes_its_shafts() -> None:
    _, names = drafted({"rpm port": RPM, "rpm stbd": RPM}, vessel(propulsor="differential"))
    assert {"port.n", "starboard.n"} <= set(names)


def test_a_tunnel_thruster_that_is_not_logged_is_stopped() -> None:
    state, names = drafted({"rudder": RUDDER, "rpm": RPM}, vessel(tunnel_thruster=True))
    assert set(names) == {"rudder.delta", "propeller.n", "bow.n"}
    (bow,) = (one for one in state.suggestions if one.name == "bow.n")
    assert bow.extra == {"factor": 0.0}
    assert [one.sentence for one in state.findings] == ["no column of the log is bow.n: taken as stopped"]


def test_a_tunnel_thruster_without_a_unit_is_asked() -> None:
    state, names = drafted({"rudder": RUDDER, "rpm": RPM, "bt": RPM}, vessel(tunnel_thruster=True))
    assert names["bow.n"] == "bt"
    assert "'bt' the shaft speed of thruster.bow? rpm is a guess" in state.questions[-1].sentence


def test_a_command_that_the_ship_needs_is_asked() -> None:
    state, names = drafted({"rudder": RUDDER}, vessel())
    assert set(names) == {"rudder.delta"}
    assert "which column is propeller.n?" in state.questions[-1].sentence


@pytest.mark.parametrize(
    ("components", "y", "bound"),
    [
        (("left", "right"), 1.0, True),  # a side is the whole name
        (("m1", "m2"), 1.0, True),  # the document says where they are
        (("m1", "m2"), 0.0, False),  # one behind the other
    ],
)
def test_two_screws_under_any_names_take_their_own_columns(components: tuple[str, str], y: float, bound: bool) -> None:
    """Before, both took the column of port."""
    known = {"shafts": 2, "propulsor": "differential"}
    document = vessel(**known).document
    thrusters = document["thruster"]
    renamed = {
        name: {**thrusters[side], "y": sign * y}
        for name, side, sign in zip(components, ("port", "starboard"), (-1, 1), strict=True)
    }
    if not bound:
        renamed["rudder"] = {**vessel().document["thruster"]["rudder"], "behind": "m1"}
    ship = Vessel({**document, "thruster": renamed}, "made.toml")
    columns = {"rpm port": RPM, "rpm stbd": RPM + 10.0 * R} | ({} if bound else {"rudder": RUDDER})
    state, names = drafted(columns, ship)
    if bound:
        assert names == {f"{components[0]}.n": "rpm port", f"{components[1]}.n": "rpm stbd"}
    else:
        assert not {f"{name}.n" for name in components} & set(names)
        assert [question.sentence for question in state.questions] == [
            f"which column is {name}.n? {ship.name} needs it" for name in components
        ]
