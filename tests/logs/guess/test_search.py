"""Position and heading are the columns whose track keeps to the heading, whatever they are called."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pymap3d import ned2geodetic

from shipid.errors import DataError
from shipid.logs.guess.clues import State
from shipid.logs.guess.motion import choose_motion
from shipid.logs.guess.search import Frame
from shipid.logs.mapping import to_si
from tests.logs.simulated import si_log, state_of

LOG = si_log()
T, NORTH, EAST, PSI = (LOG[name].to_numpy() for name in ("t", "north", "east", "psi"))
DEG = np.degrees(PSI) % 360.0
COURSE = np.degrees(PSI + np.arctan2(LOG["v"], LOG["u"]).to_numpy()) % 360.0
FILE = Path("log.csv")


def chosen(columns: dict[str, np.ndarray]) -> State:
    state = state_of(columns, T)
    choose_motion(state, FILE)
    return state


def sources(state: State) -> dict[str, str]:
    return {column.name: column.source for column in state.suggestions}


def assert_motion(state: State) -> None:
    """The position and the heading of the state are those of the ship, and the drafted heading is read so."""
    assert state.psi is not None
    assert state.position is not None
    (psi,) = (one for one in state.suggestions if one.name == "psi")
    angle = psi.extra.get("sign", 1) * state.columns[psi.source] + psi.extra.get("offset", 0.0)
    np.testing.assert_allclose(np.exp(1j * to_si(psi.unit, "psi") * angle), np.exp(1j * PSI), atol=1e-6)
    np.testing.assert_allclose(np.exp(1j * state.psi), np.exp(1j * PSI), atol=1e-6)
    np.testing.assert_allclose(state.position - state.position[0], NORTH + 1j * EAST - NORTH[0] - 1j * EAST[0])


def test_named_columns_in_degrees_or_radians() -> None:
    for values in (DEG, PSI):
        state = chosen({"N": NORTH, "E": EAST, "heading": values})
        assert sources(state) == {"north": "N", "east": "E", "psi": "heading"}
        assert state.suggestions[-1].unit == ("deg" if values is DEG else "rad")
        assert state.findings == []
        assert_motion(state)


@pytest.mark.parametrize(
    ("names", "unit", "size"),
    [
        (("North [ft]", "East [ft]"), "ft", 0.3048),
        (("x_ft", "y_ft"), "ft", 0.3048),
        (("Northing km", "Easting km"), "km", 1000.0),
        (("north_mm", "east_mm"), "mm", 0.001),
        (("North [NM]", "East [NM]"), "nmi", 1852.0),
        (("North [m]", "East [m]"), "m", 1.0),
        (("North [ft]", "East"), "m", 1.0),
    ],
)
def test_positions_have_the_unit_of_length_in_their_names(names: tuple[str, str], unit: str, size: float) -> None:
    state = chosen({names[0]: NORTH / size, names[1]: EAST / size, "heading": DEG})
    assert [column.unit for column in state.suggestions[:2]] == [unit, unit]
    assert_motion(state)


def test_columns_without_names() -> None:
    """A course and a mirror image fit as well, which is asked; a signal that is no motion is not taken."""
    state = chosen({"2": np.sin(T / 7), "3": DEG, "4": NORTH, "5": EAST})
    assert sources(state) == {"north": "4", "east": "5", "psi": "3"}
    assert [question.about for question in state.questions] == [("psi",), ("psi", "north", "east", "delta", "alpha")]
    assert_motion(state)


def test_names_that_mislead_are_overridden() -> None:
    state = chosen({"N": np.cos(T / 11), "E": np.sin(T / 7), "heading": DEG, "A": NORTH, "B": EAST})
    assert set(sources(state).values()) == {"A", "B", "heading"}


@pytest.mark.parametrize(
    "columns",
    [
        {"N": EAST, "E": NORTH, "heading": DEG},
        {"x": EAST, "y": NORTH, "heading": DEG},
        {"N": NORTH, "E": EAST, "heading": -DEG % 360.0},
        {"N": NORTH, "E": EAST, "yaw": (90.0 - DEG) % 360.0},
        {"N": NORTH, "E": EAST, "heading": (DEG + 180.0) % 360.0},
    ],
    ids=["swapped", "x is east", "to port", "from east", "zero"],
)
def test_frames_signs_and_zeros(columns: dict[str, np.ndarray]) -> None:
    state = chosen(columns)
    assert {finding.kind for finding in state.findings} == {"frame"}
    assert_motion(state)


COURSE = np.degrees(np.unwrap(np.angle(np.gradient(NORTH) + 1j * np.gradient(EAST)))) % 360.0


@pytest.mark.parametrize(
    ("columns", "signs"),
    [
        ({"x": EAST, "y": NORTH, "yaw": (90.0 - DEG) % 360.0, "cog": COURSE}, {"psi": -1}),
        ({"x": NORTH, "y": -EAST, "yaw": -DEG % 360.0, "cog": COURSE}, {"psi": -1, "east": -1}),
        ({"x": NORTH, "y": EAST, "yaw": DEG, "cog": COURSE}, {}),
    ],
    ids=["x is east", "z is upwards", "z is downwards"],
)
def test_a_course_over_ground_shows_the_frame(columns: dict[str, np.ndarray], signs: dict[str, int]) -> None:
    state = chosen(columns)
    assert {one.name: one.extra["sign"] for one in state.suggestions if "sign" in one.extra} == signs
    assert ("frame" in {finding.kind for finding in state.findings}) == bool(signs)
    assert bool(state.questions) != bool(signs)
    assert_motion(state)


SPEEDS = {"v_north": np.gradient(NORTH, T), "v_east": np.gradient(EAST, T)}


@pytest.mark.parametrize(
    ("columns", "signs"),
    [
        ({"x0": EAST, "y0": NORTH, "yaw": (90.0 - DEG) % 360.0}, {"psi": -1}),
        ({"pos_x": NORTH, "pos_y": -EAST, "yaw": -DEG % 360.0}, {"psi": -1, "east": -1}),
        ({"x0": NORTH, "y0": EAST, "yaw": DEG}, {}),
        ({"X": EAST, "Y": NORTH, "heading": DEG}, {}),
    ],
    ids=["x is east", "z is upwards", "z is downwards", "x is east, with a compass"],
)
def test_velocities_to_north_and_east_show_the_frame(columns: dict[str, np.ndarray], signs: dict[str, int]) -> None:
    """In whatever unit they are, here knots; letters of positions are another hand's."""
    state = chosen(columns | {name: 3600.0 / 1852.0 * speed for name, speed in SPEEDS.items()})
    assert {one.name: one.extra["sign"] for one in state.suggestions if "sign" in one.extra} == signs
    assert_motion(state)


@pytest.mark.parametrize(
    ("frame", "x", "y", "yaw"),
    [
        ("ned", NORTH, EAST, DEG),
        ("enu", EAST, NORTH, DEG),
        ("zup", NORTH, -EAST, -DEG),
        ("ros", EAST, NORTH, 90.0 - DEG),
    ],
)
def test_a_frame_that_is_known_is_taken(frame: Frame, x: np.ndarray, y: np.ndarray, yaw: np.ndarray) -> None:
    state = state_of({"x": x, "y": y, "yaw": yaw % 360.0}, T)
    choose_motion(state, FILE, frame)
    assert_motion(state)
    assert state.questions == []


@pytest.mark.parametrize(("frame", "x", "y"), [("enu", "x", "y"), ("ned", "lat", "lon")])
def test_a_frame_in_which_the_ship_does_not_move_is_refused(frame: Frame, x: str, y: str) -> None:
    size = 1e5 if x == "lat" else 1.0
    with pytest.raises(DataError, match=r"--frame: .*(fit ned or zup or ros|no other frame)"):
        choose_motion(state_of({x: NORTH / size, y: EAST / size, "yaw": DEG}, T), FILE, frame)


@pytest.mark.parametrize(
    ("columns", "missing"),
    [({"N": NORTH, "E": EAST, "rpm": np.sin(T)}, "heading"), ({"heading": DEG, "rpm": np.sin(T)}, "position")],
    ids=["heading", "position"],
)
def test_what_is_missing_is_named(columns: dict[str, np.ndarray], missing: str) -> None:
    with pytest.raises(DataError, match=rf"log\.csv.*no column can be the {missing}"):
        chosen(columns)


ASTERN = (DEG + 180.0) % 360.0
SURGE, SWAY = LOG["u"].to_numpy(), LOG["v"].to_numpy()


def _on_earth() -> dict[str, np.ndarray]:
    latitude, longitude, _ = ned2geodetic(NORTH, EAST, 0 * NORTH, 59.0, 10.0, 0.0)
    return {"lat": latitude, "lon": longitude}


def test_a_ship_that_goes_astern_all_the_time_is_asked() -> None:
    for place in ({"N": NORTH, "E": EAST}, _on_earth()):
        state = chosen({**place, "heading": ASTERN, "rpm": -60.0 - SURGE})
        assert [one for one in state.questions if "psi" in one.about]


@pytest.mark.parametrize(
    ("x", "y", "yaw", "reading"),
    [
        (NORTH, EAST, DEG, "'x' to north, 'y' to east, '{}' counted to starboard from north"),
        (NORTH, -EAST, -DEG, "'x' to north, 'y' to west, '{}' counted to port from north"),
        (EAST, NORTH, 90.0 - DEG, "'x' to east, 'y' to north, '{}' counted to port from east"),
    ],
    ids=["ned", "zup", "ros"],
)
@pytest.mark.parametrize("name", ["yaw", "heading", "theta"])
def test_the_true_frame_is_among_those_that_are_asked(
    x: np.ndarray, y: np.ndarray, yaw: np.ndarray, reading: str, name: str
) -> None:
    """The motion is the same in all of them; port and starboard change places, and all that says them is named."""
    log = si_log()
    speed, drift = np.hypot(log["u"], log["v"]).to_numpy(), np.degrees(np.arctan2(log["v"], log["u"])).to_numpy()
    turns = {"cog": (yaw + drift) % 360.0, "rate of turn": np.degrees(log["r"].to_numpy())}
    questions = chosen({"x": x, "y": y, name: yaw % 360.0, "sog": speed, **turns}).questions
    (question,) = [one for one in questions if "north" in one.about and reading.format(name) in one.sentence]
    assert {"psi", "north", "east", "course", "r", "delta", "alpha"} <= {*question.about}
    assert "with it turn 'cog', 'rate of turn', all that steers" in question.sentence


@pytest.mark.parametrize("share", [0.0, 0.9, 1.2])
def test_a_course_is_no_heading_beside_a_column_named_as_one(share: float) -> None:
    """Of a slow ship in a current, whose track keeps to its course and hardly to its heading; r was not read either."""
    log = si_log()
    t, stream = log["t"].to_numpy(), share * float(np.median(SURGE)) * np.exp(2.0j)
    ground = (SURGE + 1j * SWAY) * np.exp(1j * PSI) + stream
    course, rate = np.degrees(np.angle(ground)) % 360.0, log["r"].to_numpy()
    place = {"N": NORTH + stream.real * t, "E": EAST + stream.imag * t}
    words = {"ground_course": course, "ground_speed": np.abs(ground), "AHR2.Yaw": DEG % 360.0, "RATE.Y": rate}
    drafted = {one.name: one.source for one in chosen({**place, **words}).suggestions}
    assert (drafted["psi"], drafted["course"], drafted["r"]) == ("AHR2.Yaw", "ground_course", "RATE.Y")


@pytest.mark.parametrize("share", [0.0, 1.0, 2.0])
def test_velocities_show_the_heading_of_a_ship_that_drifts(share: float) -> None:
    """In wind a boat goes to any side: a false heading kept to the track, and the true frame was refused."""
    t, stream = T, share * float(np.median(SURGE)) * np.exp(2.0j)
    body = SURGE + 1j * SWAY + stream * np.exp(-1j * PSI)
    place = {"pose.position.x": EAST + stream.imag * t, "pose.position.y": NORTH + stream.real * t}
    twist = {"twist.linear.x": body.real, "twist.linear.y": -body.imag}
    columns = {**place, "orientation yaw": np.pi / 2 - PSI, **twist, "twist.angular.z": -LOG["r"].to_numpy()}
    state = state_of(columns, t)
    choose_motion(state, FILE, "ros")
    np.testing.assert_allclose(np.exp(1j * state.psi), np.exp(1j * PSI), atol=1e-6)
    drafted = {one.name: (one.source, one.extra.get("sign", 1)) for one in state.suggestions}
    assert drafted["u"] == ("twist.linear.x", 1)
    assert drafted["v"] == ("twist.linear.y", -1)
    assert drafted["r"] == ("twist.angular.z", -1)
    assert not [one for one in state.questions if "agree badly" in one.sentence]


def test_the_yaw_of_a_quaternion_is_no_place() -> None:
    """Its draft would be refused; a pair of other columns without names is."""
    columns = {"N": np.cos(T / 11), "E": np.sin(T / 7), "heading": DEG, "A": NORTH, "B": EAST}
    assert {"A", "B"} <= {*sources(chosen(columns)).values()}
    state = state_of(columns, T)
    state.units["B"] = "quaternion"
    choose_motion(state, FILE)
    assert not {"north", "east", "latitude", "longitude"} & {one.name for one in state.suggestions if one.source == "B"}
