"""Position and heading are the columns whose track keeps to the heading, whatever they are called."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pymap3d import geodetic2ecef, ned2geodetic

from shipid.errors import DataError
from shipid.logs.guess.clues import State
from shipid.logs.guess.pose import Frame, choose_pose, local_plane
from tests.logs.simulated import si_log, state_of

LOG = si_log()
T, NORTH, EAST, PSI = (LOG[name].to_numpy() for name in ("t", "north", "east", "psi"))
DEG = np.degrees(PSI) % 360.0
COURSE = np.degrees(PSI + np.arctan2(LOG["v"], LOG["u"]).to_numpy()) % 360.0
FILE = Path("log.csv")


def chosen(columns: dict[str, np.ndarray]) -> State:
    state = state_of(columns, T)
    choose_pose(state, FILE)
    return state


def sources(state: State) -> dict[str, str]:
    return {column.name: column.source for column in state.suggestions}


def assert_motion(state: State) -> None:
    """The position and the heading of the state are those of the ship."""
    assert state.psi is not None
    assert state.position is not None
    np.testing.assert_allclose(np.exp(1j * state.psi), np.exp(1j * PSI), atol=1e-6)
    np.testing.assert_allclose(state.position - state.position[0], NORTH + 1j * EAST - NORTH[0] - 1j * EAST[0])


@pytest.mark.parametrize("latitude", [63.4, -63.4])
def test_far_from_the_first_place_the_way_is_along_the_meridians_there(latitude: float) -> None:
    """Manoeuvres 200 km away seemed turned by 3.6 deg, and an offset of the heading was drafted for that."""
    lat, lon = ned2geodetic(NORTH, EAST, 0.0, latitude, 14.4, 0.0)[:2]
    first = np.arange(len(T)) < 20
    columns = {"lat": np.where(first, latitude, lat), "lon": np.where(first, 10.4, lon)}
    way = np.diff(local_plane(state_of(columns, T), "lat", "lon", on_globe=True))[20:]
    np.testing.assert_allclose(way, np.diff(NORTH + 1j * EAST)[20:], rtol=2e-3)


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
    """A mirror image fits as well, which is asked; a signal that is no motion is not taken."""
    state = chosen({"2": np.sin(T / 7), "3": DEG, "4": NORTH, "5": EAST})
    assert sources(state) == {"north": "4", "east": "5", "psi": "3"}
    assert [question.about for question in state.questions] == [("psi", "north", "east")]
    assert_motion(state)


def test_names_that_mislead_are_overridden_with_a_reason() -> None:
    state = chosen({"N": np.cos(T / 11), "E": np.sin(T / 7), "heading": DEG, "A": NORTH, "B": EAST})
    assert set(sources(state).values()) == {"A", "B", "heading"}
    (finding,) = (finding for finding in state.findings if finding.kind == "misleading names")
    assert "'N', 'E', 'heading' do not fit together" in finding.sentence


@pytest.mark.parametrize(
    ("columns", "kind"),
    [
        ({"N": EAST, "E": NORTH, "heading": DEG}, "north and east swapped"),
        ({"x": EAST, "y": NORTH, "heading": DEG}, "x is east"),
        ({"N": NORTH, "E": EAST, "heading": -DEG % 360.0}, "heading counted to port"),
        ({"N": NORTH, "E": EAST, "yaw": (90.0 - DEG) % 360.0}, "heading counted from east"),
        ({"N": NORTH, "E": EAST, "heading": (DEG + 180.0) % 360.0}, "zero of the heading"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_frames_signs_and_zeros(columns: dict[str, np.ndarray], kind: str) -> None:
    state = chosen(columns)
    assert {finding.kind for finding in state.findings} == {kind}
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
    assert ("frame by course or velocity" in {finding.kind for finding in state.findings}) == bool(signs)
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
@pytest.mark.parametrize("unit", [1.0, 3600.0 / 1852.0])
def test_velocities_to_north_and_east_show_the_frame(
    columns: dict[str, np.ndarray], signs: dict[str, int], unit: float
) -> None:
    """In whatever unit they are; letters of positions are another hand's."""
    state = chosen(columns | {name: unit * speed for name, speed in SPEEDS.items()})
    assert {one.name: one.extra["sign"] for one in state.suggestions if "sign" in one.extra} == signs
    assert_motion(state)


def test_velocities_of_another_frame_settle_nothing() -> None:
    """A column named as a speed to north that is not the rate of the track in any frame."""
    odd = {"v_north": np.gradient(EAST, T) - 3.0, "v_east": -np.gradient(NORTH, T)}
    state = chosen({"x0": EAST, "y0": NORTH, "yaw": (90.0 - DEG) % 360.0} | odd)
    assert [question.about for question in state.questions] == [("psi", "north", "east")]


@pytest.mark.parametrize(("north", "asked"), [("x0_m", True), ("N", False)])
def test_letters_that_fit_a_frame_of_another_hand_are_asked(north: str, asked: bool) -> None:
    """x and y with a yaw that counts from x to port: y is to port, or x is east; the motion is the same."""
    east = "y0_m" if asked else "E"
    state = chosen({north: NORTH, east: EAST, "yaw_deg": (90.0 - DEG) % 360.0})
    assert [question.about for question in state.questions] == [("psi", "north", "east")] * asked


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
    choose_pose(state, FILE, frame)
    assert_motion(state)
    assert state.questions == []


@pytest.mark.parametrize(("frame", "x", "y"), [("enu", "x", "y"), ("ned", "lat", "lon")])
def test_a_frame_in_which_the_ship_does_not_move_is_refused(frame: Frame, x: str, y: str) -> None:
    size = 1e5 if x == "lat" else 1.0
    with pytest.raises(DataError, match=r"--frame: .*(fit ned or zup or ros|no other frame)"):
        choose_pose(state_of({x: NORTH / size, y: EAST / size, "yaw": DEG}, T), FILE, frame)


def test_a_magnetic_heading_beside_another_is_left() -> None:
    state = chosen({"N": NORTH, "E": EAST, "heading_mag": (DEG + 4.0) % 360.0, "heading": DEG})
    assert sources(state)["psi"] == "heading"


def test_false_samples_across_360_are_counted_and_repaired() -> None:
    slow = np.interp(T, T[::4], DEG[::4])
    state = chosen({"N": NORTH, "E": EAST, "heading": slow})
    (finding,) = state.findings
    assert finding.kind == "interpolation across 360"
    assert finding.repair is not None
    assert finding.repair["kind"] == "wrap_interpolation"


def test_of_a_heading_and_a_course_without_names_the_one_that_keeps_to_the_track_is_the_course() -> None:
    """A ship drifts in a turn. Before, the course was the heading, and a lever arm made up for the drift."""
    state = chosen({"2": COURSE, "3": DEG, "4": NORTH, "5": EAST})
    assert sources(state)["psi"] == "3"
    assert any("is '3' the heading and '2' the course, or the other way" in one.sentence for one in state.questions)
    assert_motion(state)


@pytest.mark.parametrize(
    ("columns", "missing"),
    [({"N": NORTH, "E": EAST, "rpm": np.sin(T)}, "heading"), ({"heading": DEG, "rpm": np.sin(T)}, "position")],
    ids=["heading", "position"],
)
def test_what_is_missing_is_named(columns: dict[str, np.ndarray], missing: str) -> None:
    with pytest.raises(DataError, match=rf"log\.csv.*no column can be the {missing}"):
        chosen(columns)


def test_a_degree_of_latitude_is_sixty_miles() -> None:
    state = state_of({"lat": np.array([60.0, 60.5, 61.0]), "lon": np.array([5.0, 5.0, 6.0])}, np.arange(3.0))
    assert local_plane(state, "lat", "lon", on_globe=True)[1] == pytest.approx(30 * 1852, rel=5e-3)
    np.testing.assert_array_equal(local_plane(state, "lat", "lon", on_globe=False), [60 + 5j, 60.5 + 5j, 61 + 6j])


@pytest.mark.parametrize(("off", "asked"), [(5.0, True), (0.2, False)])
def test_two_headings_that_differ_are_asked(off: float, asked: bool) -> None:
    """Before, that which kept closer to the track was taken without a word, though the ship drifts."""
    state = chosen({"N": NORTH, "E": EAST, "heading": DEG, "heading2": (DEG + off) % 360.0})
    said = [one.sentence for one in state.questions if "differ by" in one.sentence]
    assert len(said) == asked
    assert not asked or "5.0 deg: which is the heading?" in said[0]


ASTERN = (DEG + 180.0) % 360.0
SURGE, SWAY = LOG["u"].to_numpy(), LOG["v"].to_numpy()


def _on_earth() -> dict[str, np.ndarray]:
    latitude, longitude, _ = ned2geodetic(NORTH, EAST, 0 * NORTH, 59.0, 10.0, 0.0)
    return {"lat": latitude, "lon": longitude}


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"u": -SURGE, "v": -SWAY}, "'u' along the heading gives the track"),
        ({"rpm": -60.0 - SURGE}, "'rpm' is negative"),
        ({"rpm": -60.0 - SURGE, "cog": COURSE, "sog": np.hypot(SURGE, SWAY)}, "'rpm' is negative"),
    ],
)
@pytest.mark.parametrize("place", [{"N": NORTH, "E": EAST}, _on_earth()], ids=["plane", "Earth"])
def test_a_ship_that_goes_astern_all_the_time_keeps_her_heading(
    place: dict[str, np.ndarray], more: dict[str, np.ndarray], why: str
) -> None:
    """Before, her heading was turned by 180 deg, or her positions to the other side of the Earth."""
    state = chosen({**place, "heading": ASTERN, **more})
    assert state.psi is not None
    np.testing.assert_allclose(np.exp(1j * state.psi), -np.exp(1j * PSI), atol=1e-6)
    assert not state.negated
    assert [one.sentence for one in state.findings if one.kind == "astern" and why in one.sentence]
    assert not state.questions


def test_a_heading_against_the_track_is_asked_where_nothing_decides() -> None:
    state = chosen({"N": NORTH, "E": EAST, "heading": ASTERN})
    assert any("does the ship go astern" in one.sentence for one in state.questions)
    state = chosen({**_on_earth(), "heading": ASTERN, "cog": COURSE})
    assert not state.negated
    assert any("does the ship go astern" in one.sentence for one in state.questions)


def test_the_track_of_a_moored_ship_says_nothing_of_her_heading() -> None:
    """Before, a heading of 100 deg was one in radians that counts to port, with an offset of 180 deg."""
    random = np.random.default_rng(1)
    place = {name: random.normal(0, 0.3, len(T)) for name in "NE"}
    psi = 100.0 + 0.2 * np.sin(T / 40.0)
    column = chosen({**place, "heading": psi.round(1)}).suggestions[-1]
    assert (column.unit, column.extra, column.confidence < 0.2) == ("deg", {"wrap": True}, True)


def test_a_heading_of_a_magnetic_compass_alone_is_asked() -> None:
    columns = {"north": NORTH, "east": EAST, "magnetic heading": DEG}
    assert any("is of a magnetic compass" in question.sentence for question in chosen(columns).questions)
    assert not any("magnetic" in one.sentence for one in chosen({**columns, "heading": DEG}).questions)


def test_a_position_of_one_column_has_its_remedy() -> None:
    state = state_of({"heading": DEG, "x": DEG}, T)
    state.words = {"mode": "AUTO 1", "Position": "63°26.400'N 010°24.000'E"}
    with pytest.raises(DataError, match=r"'Position' holds .*: write latitude and longitude in two columns"):
        choose_pose(state, FILE)


@pytest.mark.parametrize(
    ("north", "east"), [("REF.North", "REF.East"), ("PosRef1 North", "PosRef1 East"), ("Ref N", "Ref E")]
)
def test_a_reference_system_that_alone_has_the_position_is_taken_and_asked(north: str, east: str) -> None:
    """By its name it may be a set point: it is left where another column is measured."""
    alone = {north: NORTH, east: EAST, "heading": DEG}
    state = chosen(alone)
    assert_motion(state)
    assert any("measured, or a set point?" in question.sentence for question in state.questions)
    state = chosen(alone | {"North": NORTH + 0.5, "East": EAST})
    assert {*sources(state).values()} == {"North", "East", "heading"}
    assert not any("set point" in question.sentence for question in state.questions)
    with pytest.raises(DataError, match="no column can be the position"):
        chosen({"setpoint N": NORTH, "setpoint E": EAST, "heading": DEG})


def test_words_for_east_and_north_beside_letters_say_the_frame() -> None:
    """x to east, y to north, and an angle theta counted from east to port, which was no heading and then a pitch."""
    state = chosen({"x_east": EAST, "y_north": NORTH, "theta": (np.pi / 2 - PSI + np.pi) % (2 * np.pi) - np.pi})
    assert sources(state) == {"north": "y_north", "east": "x_east", "psi": "theta"}
    heading = next(one for one in state.suggestions if one.name == "psi")
    assert (heading.extra["sign"], heading.unit) == (-1, "rad")
    assert not any("north and does" in question.sentence for question in state.questions)
    assert_motion(state)


def test_a_pitch_is_no_heading() -> None:
    with pytest.raises(DataError, match="no column can be the heading"):
        chosen({"N": NORTH, "E": EAST, "theta": 0.02 * np.sin(T)})


@pytest.mark.parametrize("names", [("X ECEF", "Y ECEF", "Z ECEF"), ("pos.x", "pos.y", "pos.z")])
def test_positions_from_the_centre_of_the_Earth_are_refused(names: tuple[str, str, str]) -> None:
    """Two of them are no level plane: the track was 20 times too far off, and z was called east."""
    place = ned2geodetic(NORTH, EAST, 0.0, -33.9, 18.4, 0.0)
    columns = dict(zip(names, geodetic2ecef(*place), strict=True))
    with pytest.raises(DataError, match=f"'{names[0]}', .* count from the centre of the Earth: write latitude"):
        chosen(columns | {"heading": DEG})
    assert_motion(chosen({"pos.x": NORTH, "pos.y": EAST, "pos.z": 0.0 * EAST, "heading": DEG}))


def test_positions_in_ship_lengths_are_asked_for_the_length() -> None:
    state = chosen({"X/Lpp": NORTH / 30.0, "Y/Lpp": EAST / 30.0, "heading": DEG})
    assert any("write factor = the length in m" in question.sentence for question in state.questions)


def test_a_longitude_that_by_its_name_counts_to_the_west_does_so() -> None:
    """Before, the heading, the yaw rate and the rudder of the log were said to count to port."""
    place = _on_earth()
    state = chosen({"Lat": place["lat"], "Lon W": -place["lon"], "heading": DEG})
    assert {one.name: one.extra.get("sign", 1) for one in state.suggestions} == {
        "latitude": 1,
        "longitude": -1,
        "psi": 1,
    }
    assert any("does the log count 'Lon W' to west?" in question.sentence for question in state.questions)
