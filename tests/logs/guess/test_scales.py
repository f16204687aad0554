"""Angles and positions in numbers that are no degrees, and values that are shares of something: right, or asked."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from shipid.data.dataset import Dataset
from shipid.errors import DataError, DocumentError
from shipid.files import write_new
from shipid.logs.guess.columns import Guess, guess
from shipid.logs.guess.draft import draft_mapping, draft_text
from shipid.logs.guess.pose import Frame
from shipid.logs.importing import import_log, read_mapping
from shipid.logs.mapping import degrees_and_minutes
from tests.logs.simulated import SCHEDULE, as_bridge, si_log

LOG = si_log()
BRIDGE = as_bridge(LOG)
SIZE = 6378137.0  # m
LATITUDE, LONGITUDE = 63.44, 10.40
ROUND = 1.0 - 0.00669438  # b^2 / a^2 of WGS 84
WIDE = 1.0 - 0.00669438 * np.sin(np.radians(LATITUDE)) ** 2
LAT = LATITUDE + np.degrees(LOG["north"] / (SIZE * ROUND / WIDE**1.5))
LON = LONGITUDE + np.degrees(LOG["east"] / (SIZE / WIDE**0.5 * np.cos(np.radians(LATITUDE))))


def on_globe(lat: pd.Series, lon: pd.Series, **more: object) -> pd.DataFrame:
    frame = BRIDGE.drop(columns=["N", "E"]).rename(columns={"psi": "Heading"})
    return frame.assign(lat=lat, lon=lon, **more)


def drafted(frame: pd.DataFrame, folder: Path) -> tuple[Guess, Dataset]:
    frame.to_csv(folder / "log.csv", index=False)
    proposal = guess(folder / "log.csv")
    mapping = write_new(draft_mapping(proposal), folder / "draft.toml")
    whole = read_mapping(mapping).model_copy(update={"segment": ()})
    return proposal, import_log(whole, folder / "log.csv")


def turned_round(first: float) -> pd.DataFrame:
    """The zigzag of the log [rows], turned so that it begins with this heading [deg]."""
    frame = BRIDGE.iloc[:600]
    angle = np.radians(first - frame["psi"].iloc[0])
    north, east = (frame[name] * np.cos(angle) for name in ("N", "E"))
    turned = {"N": north - frame["E"] * np.sin(angle), "E": east + frame["N"] * np.sin(angle)}
    return frame.assign(**turned, psi=(frame["psi"] + np.degrees(angle)) % 360.0)


def asked(proposal: Guess) -> str:
    return " ".join(question.sentence for question in proposal.questions)


def turned(dataset: Dataset) -> np.ndarray:
    """Error of the heading [rad], rows of the import against the truth."""
    psi = np.interp(dataset.frame["t"], LOG["t"], np.unwrap(LOG["psi"]))
    return np.asarray(np.abs(np.angle(np.exp(1j * (dataset.frame["psi"].to_numpy() - psi)))))


@pytest.mark.parametrize(
    ("name", "turn", "decimals"),
    [("Heading", 400.0, 2), ("Heading [gon]", 400.0, 2), ("hdg", 36000.0, 0), ("Heading", 3600.0, 0)],
)
def test_a_heading_in_other_parts_of_a_turn_is_the_heading(
    name: str, turn: float, decimals: int, tmp_path: Path
) -> None:
    frame = BRIDGE.drop(columns="psi")
    frame[name] = (BRIDGE["psi"] * turn / 360.0).round(decimals) % turn
    proposal, dataset = drafted(frame, tmp_path)
    column = proposal.column("psi")
    assert column is not None
    assert column.extra["factor"] == pytest.approx(360.0 / turn)
    assert f"a whole turn is {turn:g}" in column.evidence
    assert turned(dataset).max() < np.radians(0.3)
    assert dataset.frame["v"].to_numpy() == pytest.approx(LOG["v"].to_numpy(), abs=1e-6)


def test_a_unit_in_the_name_decides_where_a_heading_never_jumps(tmp_path: Path) -> None:
    frame = BRIDGE.drop(columns="psi").iloc[:400]
    frame["Heading [0.01 deg]"] = (BRIDGE["psi"] * 100).round()
    proposal, dataset = drafted(frame, tmp_path)
    column = proposal.column("psi")
    assert column is not None
    assert column.extra["factor"] == 0.01
    assert turned(dataset).max() < np.radians(0.3)


@pytest.mark.parametrize(
    ("column", "name", "size"),
    [
        ("rpm", "Engine [krpm]", 1e-3),
        ("rpm", "Shaft speed [krpm]", 1e-3),
        ("rudder", "Rudder [mrad]", 1e3 * np.pi / 180.0),
        ("rudder", "rudder_cdeg", 1e2),
        ("rudder", "Rudder [0.1 deg]", 10.0),
        ("r", "ROT [mrad/s]", 1e3 * np.pi / 180.0),
        ("psi", "Heading [mrad]", 1e3 * np.pi / 180.0),
    ],
)
def test_a_prefix_of_a_unit_is_read(column: str, name: str, size: float, tmp_path: Path) -> None:
    """A shaft in krpm was read as rev/s, and a rudder in mrad as degrees, both without a question."""
    (tmp_path / "plain").mkdir()
    plain = drafted(BRIDGE, tmp_path / "plain")[1].frame
    frame = BRIDGE.assign(**{column: (BRIDGE[column] * size).round(5)}).rename(columns={column: name})
    proposal, dataset = drafted(frame, tmp_path)
    assert name not in asked(proposal)
    for one in plain.columns.drop(["run", "flags"]):
        np.testing.assert_allclose(dataset.frame[one], plain[one], atol=2e-4, err_msg=one)


@pytest.mark.parametrize(("turn", "first"), [(400.0, 260.0), (36000.0, 120.0), (3600.0, 200.0), (6400.0, 250.0)])
def test_a_heading_that_never_jumps_is_read_as_it_keeps_to_the_track(turn: float, first: float, tmp_path: Path) -> None:
    frame = turned_round(first).drop(columns="psi")
    frame["Heading"] = (turned_round(first)["psi"] * turn / 360.0).round(2)
    column = drafted(frame, tmp_path)[0].column("psi")
    assert column is not None
    assert column.extra["factor"] == pytest.approx(360.0 / turn)
    assert "keeps to the track" in column.evidence


@pytest.mark.parametrize("digits", [6, 7])
def test_whole_numbers_of_parts_of_a_degree_are_told_by_the_speed(digits: int, tmp_path: Path) -> None:
    proposal, _ = drafted(on_globe(*((10**digits * one).round().astype(int) for one in (LAT, LON))), tmp_path)
    columns = [proposal.column(name) for name in ("latitude", "longitude")]
    assert [one.extra["factor"] for one in columns if one is not None] == [10.0**-digits] * 2


@pytest.mark.parametrize(
    ("names", "speed", "asks"),
    [
        (("lat", "lon"), "SOG [kn]", False),
        (("lat", "lon"), "SOG", False),
        (("lat", "lon"), "", True),
        (("lat [1/10000 min]", "lon [1/10000 min]"), "", False),
    ],
)
def test_positions_of_AIS_are_whole_numbers_of_parts_of_a_minute(
    names: tuple[str, str], speed: str, asks: bool, tmp_path: Path
) -> None:
    """As 1e-6 deg the ship would be elsewhere on the Earth, and 0.6 times as fast."""
    frame = on_globe(LAT, LON).drop(columns=["lat", "lon", "u", "v"])
    for name, degrees in zip(names, (LAT, LON), strict=True):
        frame[name] = (600_000 * degrees).round().astype(int)
    if speed:
        frame[speed] = (np.hypot(LOG["u"], LOG["v"]) * 3600 / 1852).round(1)
        frame["COG"] = np.degrees(LOG["psi"] + np.arctan2(LOG["v"], LOG["u"])) % 360
    frame.to_csv(tmp_path / "log.csv", index=False)
    proposal = guess(tmp_path / "log.csv")
    assert ("whole numbers of" in asked(proposal)) == asks
    columns = [proposal.column(name) for name in ("latitude", "longitude")]
    read = [one.extra["factor"] for one in columns if one is not None]
    assert asks or read == pytest.approx([1 / 600_000] * 2)


def as_ais(names: tuple[str, ...]) -> pd.DataFrame:
    """The log every 4 s in the whole numbers of messages of AIS (ITU-R M.1371), under these names."""
    heading = np.degrees(LOG["psi"]) % 360
    course = np.degrees(LOG["psi"] + np.arctan2(LOG["v"], LOG["u"])) % 360
    rate = np.degrees(LOG["r"]) * 60
    columns = [
        LOG["t"],
        600_000 * LAT,
        600_000 * LON,
        10 * np.hypot(LOG["u"], LOG["v"]) * 3600 / 1852,
        (10 * course).round() % 3600,
        heading.round() % 360,
        np.sign(rate) * np.minimum(4.733 * np.sqrt(np.abs(rate)), 126),
    ]
    whole = {name: one.round().astype(int) for name, one in zip(names, columns, strict=True)}
    return pd.DataFrame(whole).iloc[::8].reset_index(drop=True)


@pytest.mark.parametrize(
    ("names", "silent"),
    [
        (("time", "LATITUDE", "LONGITUDE", "SOG", "COG", "TRUE_HEADING", "ROT"), False),
        (
            ("t [s]", "Lat [1/10000 min]", "Lon [1/10000 min]", "SOG [1/10 kn]", "COG [1/10 deg]", "HDG", "ROT_AIS"),
            True,
        ),
        (("timestamp", "lat", "lon", "speed", "course", "heading", "turn"), True),
    ],
)
def test_messages_of_AIS_are_decoded(names: tuple[str, ...], silent: bool, tmp_path: Path) -> None:
    """Before, a speed in tenths of a knot was one in km/h, and the coded rate of turn was left out."""
    frame = as_ais(names)
    if silent:  # a receiver that was away
        frame.loc[100:104, [names[3], names[6]]] = 1023, -128
    proposal, dataset = drafted(frame, tmp_path)
    assert "whole numbers" not in asked(proposal)
    assert {one.name: one.unit for one in proposal.columns}["r"] == "ais"
    rows = dataset.frame.loc[~dataset.frame["t"].between(396, 420)]
    truth = {name: np.interp(rows["t"], LOG["t"], LOG[name]) for name in ("u", "v", "r")}
    speed = np.hypot(truth["u"], truth["v"])
    np.testing.assert_allclose(np.hypot(rows["u"], rows["v"]), speed, rtol=0, atol=0.06 * 1852 / 3600)
    rate = np.degrees(truth["r"]) * 60
    step = (2 * np.sqrt(np.abs(rate)) * 4.733 + 1) / 4.733**2  # deg/min: the next number, at most
    assert np.all(np.abs(np.degrees(rows["r"]) * 60 - rate) < step)


def test_numbers_that_are_no_rate_of_AIS_are_refused(tmp_path: Path) -> None:
    frame = as_ais(("t", "lat", "lon", "speed", "course", "heading", "turn"))
    draft = draft_text(guess(as_file(frame, tmp_path))).replace("sha256", "# sha256")
    wrong = as_file(frame.assign(turn=frame["turn"].where(frame.index != 5, 300)), tmp_path)
    with pytest.raises(DataError, match=r"columns\.r\.unit: 300 in row 6 is none of -128 to 127, as AIS has: is the"):
        import_log(read_mapping(write_new(draft, tmp_path / "draft.toml")), wrong)
    for_roll = draft + '\n[columns.p]\nfrom = "turn"\nunit = "ais"\n'
    with pytest.raises(DocumentError, match="only the yaw rate r is in numbers of AIS"):
        read_mapping(write_new(for_roll, tmp_path / "other.toml"))


@pytest.mark.parametrize(("turn", "asks"), [(400.0, True), (360.0, False)])
def test_gon_that_a_compass_in_degrees_may_show_are_asked(turn: float, asks: bool, tmp_path: Path) -> None:
    frame = turned_round(200.0).drop(columns="psi")
    frame["Heading"] = (turned_round(200.0)["psi"] * turn / 360.0).round(2)
    assert ("'Heading', " in asked(drafted(frame, tmp_path)[0])) == asks


@pytest.mark.parametrize(("unit", "parts"), [("min", 60.0), ("arcmin", 60.0), ('"', 3600.0), ("arcsec", 3600.0)])
def test_positions_in_minutes_of_arc_are_read_as_their_names_say(unit: str, parts: float, tmp_path: Path) -> None:
    """3806 minutes were taken for 38 degrees and 6 minutes."""
    frame = on_globe(parts * LAT, parts * LON).rename(columns={one: f"{one} [{unit}]" for one in ("lat", "lon")})
    proposal, dataset = drafted(frame, tmp_path)
    for name in ("latitude", "longitude"):
        column = proposal.column(name)
        assert column is not None
        assert column.extra["factor"] == pytest.approx(1 / parts)
    north = dataset.frame["north"].to_numpy()
    assert north - north[0] == pytest.approx(LOG["north"] - LOG["north"].iloc[0], abs=2.0)


@pytest.mark.parametrize("how", ["blanks", "near Greenwich", "Italian"])
def test_positions_of_receivers_are_degrees_in_strange_logs(how: str, tmp_path: Path) -> None:
    """Before, whole numbers with blanks between, and a longitude of less than a degree, were metres."""
    if how == "blanks":
        lat, lon = ((x * 1e7).round().where(x.index % 4 == 0) for x in (LAT, LON))
        frame = on_globe(lat, lon)
    else:
        east = LON - (10.0 if how == "near Greenwich" else 0.0)
        frame = on_globe(*((x // 1 * 100 + x % 1 * 60).round(6) for x in (LAT, east)))
        frame = frame.rename(columns={"lat": "Latitudine", "lon": "Longitudine"}) if how == "Italian" else frame
    _, dataset = drafted(frame, tmp_path)
    run = dataset.frame.merge(LOG, on="t", suffixes=("", "_true"))
    for name in ("north", "east"):
        off = run[name] - run[f"{name}_true"]
        np.testing.assert_allclose(off - off.iloc[0], 0.0, atol=2.0, err_msg=name)


def test_a_position_in_radians_is_read_as_its_name_says(tmp_path: Path) -> None:
    """Before, it was drafted in degrees."""
    frame = on_globe(LAT, LON).drop(columns=["lat", "lon"])
    frame["Latitude [rad]"], frame["Longitude [rad]"] = np.radians(LAT).round(9), np.radians(LON).round(9)
    proposal, dataset = drafted(frame, tmp_path)
    assert proposal.kinds == set()
    run = dataset.frame
    for name in ("north", "east"):
        np.testing.assert_allclose(run[name] - run[name][0], LOG[name] - LOG[name][0], atol=1.0, err_msg=name)


@pytest.mark.parametrize("text", ["63°66.4'N", "about 63.44 N"])
def test_a_position_of_words_is_named_with_its_text(text: str, tmp_path: Path) -> None:
    frame = on_globe(LAT, LON).assign(lat=text, lon=text.replace("N", "E"))
    with pytest.raises(DataError, match=r"no column can be the position.*: 'lat' holds .*63.*N.*, no number"):
        drafted(frame, tmp_path)


@pytest.mark.parametrize("how", ["1e-7", "ddmm"])
def test_positions_of_receivers_are_degrees(how: str, tmp_path: Path) -> None:
    if how == "1e-7":
        frame = on_globe((LAT * 1e7).round().astype("int64"), (LON * 1e7).round().astype("int64"))
    else:
        frame = on_globe(*((x // 1 * 100 + x % 1 * 60).round(6) for x in (LAT, LON)))
    proposal, dataset = drafted(frame, tmp_path)
    run = dataset.frame
    for name in ("north", "east"):
        np.testing.assert_allclose(run[name] - run[name][0], LOG[name] - LOG[name][0], atol=1.0, err_msg=name)
    assert ("without a sign" in asked(proposal)) == (how == "ddmm")


@pytest.mark.parametrize("letters", [True, False], ids=["letters", "no letters"])
@pytest.mark.parametrize("unit", ["deg", "ddmm"])
@pytest.mark.parametrize("sides", ["SE", "NW", "SW"])
def test_the_side_of_a_position_without_a_sign_is_found(sides: str, unit: str, letters: bool, tmp_path: Path) -> None:
    """Before, the heading, the yaw rate and the rudder counted to port, or the heading was half a turn off."""
    lat, lon = (2 * 63.44 - LAT if "S" in sides else LAT), (2 * 10.40 - LON if "W" in sides else LON)
    if unit == "ddmm":
        lat, lon = ((x // 1 * 100 + x % 1 * 60).round(6) for x in (lat, lon))
    frame = on_globe(lat, lon)
    if letters:
        frame.insert(list(frame).index("lat") + 1, "N/S", sides[0])
        frame.insert(list(frame).index("lon") + 1, "E/W", sides[1])
    proposal, dataset = drafted(frame, tmp_path)
    run = dataset.frame
    for name in ("north", "east"):
        np.testing.assert_allclose(run[name] - run[name][0], LOG[name] - LOG[name][0], atol=1.0, err_msg=name)
    assert turned(dataset).max() < np.radians(0.3)
    assert run["rudder.delta"].to_numpy() == pytest.approx(-LOG["alpha"].to_numpy(), abs=1e-6)
    assert "sign of a position" in proposal.kinds
    assert ("does the log count" in asked(proposal)) == (not letters)


def test_letters_of_a_status_are_no_side_of_the_earth(tmp_path: Path) -> None:
    frame = on_globe(LAT, LON).assign(quality="W")
    frame.insert(1, "mode", "S")
    proposal, dataset = drafted(frame, tmp_path)
    assert "does the log count 'lon' to east?" in asked(
        proposal
    )  # the letter beside it misleads, and the motion shows it
    assert turned(dataset).max() < np.radians(0.3)


def test_latitude_and_longitude_changed_round_are_found(tmp_path: Path) -> None:
    proposal, dataset = drafted(on_globe(LON.round(7), LAT.round(7)), tmp_path)
    assert "latitude and longitude swapped" in proposal.kinds
    assert turned(dataset).max() < np.radians(0.3)
    assert proposal.column("psi").extra == {"wrap": True}  # type: ignore[union-attr]
    right = guess(as_file(on_globe(LAT.round(7), LON.round(7)), tmp_path))
    assert "latitude and longitude swapped" not in right.kinds


def test_names_of_north_and_east_changed_round_are_said_where_a_course_shows_it(tmp_path: Path) -> None:
    course = np.degrees(LOG["psi"] + np.arctan2(LOG["v"], LOG["u"])) % 360.0
    frame = BRIDGE.rename(columns={"N": "East", "E": "North", "psi": "Heading"}).assign(COG=course)
    proposal, _ = drafted(frame, tmp_path)
    assert proposal.column("north").source == "East"  # type: ignore[union-attr]
    assert "north and east swapped" in proposal.kinds


@pytest.mark.parametrize(("text", "value"), [(6326.4, 63.44), (-1024.0, -10.4), (5960.0, np.nan), (0.0, 0.0)])
def test_degrees_and_minutes(text: float, value: float) -> None:
    np.testing.assert_allclose(degrees_and_minutes(np.array([text])), [value])


def test_minutes_above_60_are_refused_with_their_row(tmp_path: Path) -> None:
    frame = on_globe(*((x // 1 * 100 + x % 1 * 60).round(6) for x in (LAT, LON)))
    frame.to_csv(tmp_path / "log.csv", index=False)
    mapping = write_new(draft_text(guess(tmp_path / "log.csv")), tmp_path / "draft.toml")
    frame.loc[3, "lat"] = 6375.0
    frame.to_csv(tmp_path / "log.csv", index=False)
    mapping.write_text("\n".join(line for line in mapping.read_text().splitlines() if "sha256" not in line))
    with pytest.raises(DataError, match="6375 in row 4 has 60 minutes or more"):
        import_log(read_mapping(mapping), tmp_path / "log.csv")


def test_only_positions_are_in_degrees_and_minutes(tmp_path: Path) -> None:
    mapping = draft_text(guess(as_file(BRIDGE, tmp_path))).replace('unit = "deg"', 'unit = "ddmm"', 1)
    with pytest.raises(DocumentError, match="only latitude and longitude"):
        read_mapping(write_new(mapping, tmp_path / "draft.toml"))


def as_file(frame: pd.DataFrame, folder: Path) -> Path:
    frame.to_csv(folder / "log.csv", index=False)
    return folder / "log.csv"


FULL = 35.0  # deg: the largest angle
RUDDER = BRIDGE["rudder"]


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("rudder [%]", RUDDER / FULL * 100, "is in per cent: of which angle"),
        ("rudder [‰]", RUDDER / FULL * 1000, "is in per mille: of which angle"),
        ("rudder", RUDDER / FULL * 1000, "per cent or per mille of the largest angle"),
        ("rudder", RUDDER / FULL, "a share (-1 to 1) of the largest angle"),
        ("rudder", RUDDER.abs(), "is never negative, but the ship turns to both sides"),
        ("rudder", RUDDER + FULL, "is never negative, but the ship turns to both sides"),
        ("motor_erpm", BRIDGE["rpm"] * 7, "is the electrical speed of a motor: of how many poles"),
        ("eRPM", BRIDGE["rpm"] * 7, "is the electrical speed of a motor: of how many poles"),
        ("bow thruster erpm", BRIDGE["rpm"] * 7, "is the electrical speed of a motor: of how many poles"),
    ],
)
def test_what_the_log_does_not_say_is_asked(name: str, values: pd.Series, words: str, tmp_path: Path) -> None:
    old = "rudder" if "rudder" in name else "rpm"
    proposal = guess(as_file(BRIDGE.drop(columns=old).assign(**{name: values}), tmp_path))
    assert words in asked(proposal)
    assert not any(finding.kind == "wrong sign of rudder" for finding in proposal.findings if "never" in words)


def test_a_sound_log_is_not_asked(tmp_path: Path) -> None:
    for frame in (BRIDGE, BRIDGE.assign(rudder=np.radians(RUDDER), psi=np.radians(BRIDGE["psi"]))):
        text = asked(guess(as_file(frame, tmp_path)))
        assert "rudder" not in text
        assert "rpm" not in text


def test_circles_to_one_side_with_a_rudder_to_one_side_are_not_asked(tmp_path: Path) -> None:
    """A rudder that is never negative is right where the ship turns to starboard only."""
    ends = np.cumsum([seconds for seconds, _, _ in SCHEDULE])
    inside = LOG["t"].between(ends[9] + 20, ends[10] - 20)
    assert LOG["r"][inside].min() > 0
    frame = BRIDGE[inside].assign(rudder=RUDDER[inside].clip(lower=0))
    assert "never negative" not in asked(guess(as_file(frame.reset_index(drop=True), tmp_path)))


def quaternion(yaw: np.ndarray, roll: float = 0.08, pitch: float = -0.03) -> dict[str, np.ndarray]:
    """x, y, z, w of turns by roll about x, then pitch about y, then yaw about z."""
    parts = Rotation.from_euler("ZYX", np.stack([yaw, np.full(len(yaw), pitch), np.full(len(yaw), roll)], 1)).as_quat()
    return dict(zip("xyzw", parts.T, strict=True))


@pytest.mark.parametrize("names", ["orientation.{}", "q{}", "att_quat_{}", "Q_{} [-]"])
@pytest.mark.parametrize("frame", ["ned", "ros"])
def test_a_quaternion_is_the_heading(names: str, frame: Frame, tmp_path: Path) -> None:
    psi = LOG["psi"].to_numpy()
    four = quaternion(psi if frame == "ned" else np.pi / 2 - psi)
    log = BRIDGE.drop(columns=["psi", "N", "E"]).assign(x=LOG["north" if frame == "ned" else "east"])
    log["y"] = LOG["east" if frame == "ned" else "north"]
    for letter, values in four.items():
        log[names.format(letter.upper() if "Q" in names else letter)] = values.round(6)
    log.to_csv(tmp_path / "log.csv", index=False)
    mapping = write_new(draft_mapping(guess(tmp_path / "log.csv", frame=frame)), tmp_path / "draft.toml")
    dataset = import_log(read_mapping(mapping).model_copy(update={"segment": ()}), tmp_path / "log.csv")
    assert turned(dataset).max() < 1e-5
    assert dataset.frame["v"].to_numpy() == pytest.approx(LOG["v"].to_numpy(), abs=1e-3)


@pytest.mark.parametrize("frame", get_args(Frame))
@pytest.mark.parametrize("ahead", [0.3, 0.45, 0.5, 0.6])
def test_a_given_frame_is_taken_where_a_ship_that_goes_astern_does_not_show_it(
    ahead: float, frame: Frame, tmp_path: Path
) -> None:
    """Ahead and astern by turns, the course says little of the heading; another frame was said to fit."""
    way = np.where(np.arange(len(LOG)) < ahead * len(LOG), 1.0, -1.0)
    place = np.append(0, np.cumsum(way[1:] * np.diff(LOG["north"] + 1j * LOG["east"])))
    psi, east_first = LOG["psi"].to_numpy(), frame in ("enu", "ros")
    log = BRIDGE.drop(columns=["psi", "N", "E"]).assign(u=way * LOG["u"], v=way * LOG["v"])
    log["x"], log["y"] = (place.imag, place.real) if east_first else (place.real, place.imag)
    log["y"] *= -1.0 if frame == "zup" else 1.0
    log["psi"] = {"ros": np.pi / 2 - psi, "zup": -psi}.get(frame, psi)
    log.to_csv(tmp_path / "log.csv", index=False)
    result = guess(tmp_path / "log.csv", frame=frame)
    assert [one.source for one in result.columns if one.name in ("north", "east")] == list("yx" if east_first else "xy")
    assert "agree badly" in asked(result)
    mapping = write_new(draft_mapping(result), tmp_path / "draft.toml")
    dataset = import_log(read_mapping(mapping).model_copy(update={"segment": ()}), tmp_path / "log.csv")
    assert turned(dataset).max() < 1e-5
    assert dataset.frame["u"].to_numpy() == pytest.approx(way * LOG["u"].to_numpy(), abs=1e-3)


@pytest.mark.parametrize(
    ("row", "said"), [([0.0, 0.0, 0.0, 0.0], "row 6, clock.max_gap"), ([0.0, 0.0, 1.0, 1.0], "size 1.414 in row 6")]
)
def test_four_zeros_are_no_quaternion_and_have_no_heading(row: list[float], said: str, tmp_path: Path) -> None:
    """As an angle they would be 0."""
    log = pd.DataFrame({"t": np.arange(20.0), "x": np.arange(20.0), **dict.fromkeys(["y", "u", "v", "r"], 0.0)})
    log = log.assign(**{f"q{one}": values for one, values in quaternion(np.zeros(20)).items()})
    log.loc[5, ["qx", "qy", "qz", "qw"]] = row
    log.to_csv(tmp_path / "log.csv", index=False)
    plain = {"north": "x", "east": "y", "u": "u", "v": "v", "r": "r"}
    units = {"north": "m", "east": "m", "u": "m/s", "v": "m/s", "r": "rad/s"}
    text = "".join(f'[columns.{one}]\nfrom = "{name}"\nunit = "{units[one]}"\n' for one, name in plain.items())
    text += '[columns.psi]\nfrom = ["qx", "qy", "qz", "qw"]\nunit = "quaternion"\n'
    mapping = write_new('name = "q"\n[clock]\nfrom = "t"\n' + text, tmp_path / "mapping.toml")
    with pytest.raises(DataError, match=said):
        import_log(read_mapping(mapping), tmp_path / "log.csv")
    mapping.write_text(mapping.read_text().replace("quaternion", "rad"))
    with pytest.raises(DocumentError, match="a quaternion is the heading, from four columns"):
        read_mapping(mapping)


TEXTS = {
    "P12.5": lambda x: f"{'P' if x < 0 else 'S'}{abs(x):.1f}",
    "12.5 P": lambda x: f"{abs(x):.1f} {'P' if x < 0 else 'S'}" if round(x, 1) else "0.0",
    "PORT 12.5": lambda x: f"{'PORT' if x < 0 else 'STBD'} {abs(x):.1f}",
    "Bb 12,5": lambda x: f"{'Bb' if x < 0 else 'Stb'} {abs(x):.1f}".replace(".", ","),
    "Bd 12.5": lambda x: f"{'Bd' if x < 0 else 'Td'} {abs(x):.1f}",
    "L12.5": lambda x: f"{'L' if x < 0 else 'R'}{abs(x):04.1f}",
}


@pytest.mark.parametrize("style", TEXTS)
def test_a_rudder_with_its_side_in_letters_is_read(style: str, tmp_path: Path) -> None:
    """Before, it was left out as a column of words."""
    proposal, dataset = drafted(BRIDGE.assign(rudder=RUDDER.map(TEXTS[style])), tmp_path)
    column = proposal.column("rudder.delta")
    assert column is not None
    assert (column.unit, column.extra) == ("deg", {})
    np.testing.assert_allclose(np.degrees(dataset.frame["rudder.delta"]), RUDDER, atol=0.051)


@pytest.mark.parametrize("text", ["12.5", "P-12.5", "P12.5S", "Q12.5"])
def test_a_rudder_without_its_side_among_others_is_refused(text: str, tmp_path: Path) -> None:
    frame = BRIDGE.assign(rudder=RUDDER.map(TEXTS["P12.5"]))
    draft = draft_text(guess(as_file(frame, tmp_path))).replace("sha256", "# sha256")
    wrong = as_file(frame.assign(rudder=frame["rudder"].where(frame.index != 5, text)), tmp_path)
    with pytest.raises(DataError, match=r"row 6: .* is no number( and no angle with S or P)? \(column 'rudder'"):
        import_log(read_mapping(write_new(draft, tmp_path / "draft.toml")), wrong)


@pytest.mark.parametrize("speed", ["m/s", "kn", ""])
def test_positions_in_radians_without_a_unit_are_told_by_the_speed(speed: str, tmp_path: Path) -> None:
    """As degrees they are off West Africa, and the ship is 57 times too slow; without a speed that is asked."""
    frame = on_globe(np.radians(LAT), np.radians(LON)).drop(columns=["u", "v"])
    if speed:
        frame["SOG"] = np.hypot(LOG["u"], LOG["v"]) * (3600 / 1852 if speed == "kn" else 1.0)
        frame["COG"] = np.degrees(LOG["psi"] + np.arctan2(LOG["v"], LOG["u"])) % 360
    proposal = guess(as_file(frame, tmp_path))
    columns = [proposal.column(name) for name in ("latitude", "longitude")]
    assert [one.unit for one in columns if one is not None] == (["rad"] * 2 if speed else ["deg"] * 2)
    assert ("or radians?" in asked(proposal)) == (not speed)
    here = guess(as_file(on_globe(LAT - 63.4, LON - 10.4), tmp_path))
    assert here.column("latitude").unit == "deg"  # type: ignore[union-attr]
