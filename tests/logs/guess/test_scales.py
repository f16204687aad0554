"""Angles and positions in numbers that are no degrees, and values that are shares of something: right, or asked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from shipid.data.dataset import Dataset
from shipid.logs.guess.columns import Guess, guess
from shipid.logs.guess.search import Frame
from tests.logs.simulated import as_bridge, drafted, guess_of, import_draft, si_log

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


def asked(proposal: Guess) -> str:
    return " ".join(question.sentence for question in proposal.questions)


def turned(dataset: Dataset) -> np.ndarray:
    """Error of the heading [rad], rows of the import against the truth."""
    psi = np.interp(dataset.frame["t"], LOG["t"], np.unwrap(LOG["psi"]))
    return np.asarray(np.abs(np.angle(np.exp(1j * (dataset.frame["psi"].to_numpy() - psi)))))


@pytest.mark.parametrize(
    ("name", "turn", "decimals"),
    [("Heading", 400.0, 2), ("hdg", 36000.0, 0)],
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


def as_ais(names: tuple[str, ...]) -> pd.DataFrame:
    """The log every 4 s in the whole numbers of messages of AIS (ITU-R M.1371), under these names."""
    heading = np.degrees(LOG["psi"]) % 360
    course = np.degrees(LOG["psi"] + np.arctan2(LOG["v"], LOG["u"])) % 360
    columns = [
        LOG["t"],
        600_000 * LAT,
        600_000 * LON,
        10 * np.hypot(LOG["u"], LOG["v"]) * 3600 / 1852,
        (10 * course).round() % 3600,
        heading.round() % 360,
    ]
    whole = {name: one.round().astype(int) for name, one in zip(names, columns, strict=True)}
    return pd.DataFrame(whole).iloc[::8].reset_index(drop=True)


@pytest.mark.parametrize(
    ("names", "silent"),
    [
        (("time", "LATITUDE", "LONGITUDE", "SOG", "COG", "TRUE_HEADING"), False),
        (("timestamp", "lat", "lon", "speed", "course", "heading"), True),
    ],
)
def test_messages_of_AIS_are_decoded(names: tuple[str, ...], silent: bool, tmp_path: Path) -> None:
    """Before, a speed in tenths of a knot was one in km/h."""
    frame = as_ais(names)
    if silent:  # a receiver that was away
        frame.loc[100:104, names[3]] = 1023
    proposal, dataset = drafted(frame, tmp_path)
    assert "whole numbers" not in asked(proposal)
    rows = dataset.frame.loc[~dataset.frame["t"].between(396, 420)]
    truth = {name: np.interp(rows["t"], LOG["t"], LOG[name]) for name in ("u", "v")}
    speed = np.hypot(truth["u"], truth["v"])
    np.testing.assert_allclose(np.hypot(rows["u"], rows["v"]), speed, rtol=0, atol=0.06 * 1852 / 3600)


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


@pytest.mark.parametrize(("sides", "unit", "letters"), [("SE", "deg", True), ("SW", "ddmm", False)])
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
    assert {"sign of a position", "frame"} & proposal.kinds
    assert ("does the log count" in asked(proposal)) == (not letters)


def test_latitude_and_longitude_changed_round_are_found(tmp_path: Path) -> None:
    proposal, dataset = drafted(on_globe(LON.round(7), LAT.round(7)), tmp_path)
    assert "other name" in proposal.kinds
    assert turned(dataset).max() < np.radians(0.3)
    assert proposal.column("psi").extra == {"wrap": True}  # type: ignore[union-attr]
    right = guess_of(tmp_path, on_globe(LAT.round(7), LON.round(7)))
    assert "other name" not in right.kinds


FULL = 35.0  # deg: the largest angle
RUDDER = BRIDGE["rudder"]


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("rudder [%]", RUDDER / FULL * 100, "is in per cent: of which angle"),
        ("rudder", RUDDER / FULL * 1000, "per cent or per mille of the largest angle"),
        ("rudder", RUDDER.abs(), "is never negative, but the ship turns to both sides"),
        ("motor_erpm", BRIDGE["rpm"] * 7, "is the electrical speed of a motor: of how many poles"),
    ],
)
def test_what_the_log_does_not_say_is_asked(name: str, values: pd.Series, words: str, tmp_path: Path) -> None:
    old = "rudder" if "rudder" in name else "rpm"
    proposal = guess_of(tmp_path, BRIDGE.drop(columns=old).assign(**{name: values}))
    assert words in asked(proposal)
    assert not any(finding.kind == "other sign" for finding in proposal.findings if "never" in words)


def test_a_sound_log_is_not_asked(tmp_path: Path) -> None:
    for frame in (BRIDGE, BRIDGE.assign(rudder=np.radians(RUDDER), psi=np.radians(BRIDGE["psi"]))):
        text = asked(guess_of(tmp_path, frame))
        assert "rudder" not in text
        assert "rpm" not in text


def quaternion(yaw: np.ndarray, roll: float = 0.08, pitch: float = -0.03) -> dict[str, np.ndarray]:
    """x, y, z, w of turns by roll about x, then pitch about y, then yaw about z."""
    parts = Rotation.from_euler("ZYX", np.stack([yaw, np.full(len(yaw), pitch), np.full(len(yaw), roll)], 1)).as_quat()
    return dict(zip("xyzw", parts.T, strict=True))


@pytest.mark.parametrize(("names", "frame"), [("orientation.{}", "ros"), ("Q_{} [-]", "ned"), ("q[{}]", "ned")])
def test_a_quaternion_is_the_heading(names: str, frame: Frame, tmp_path: Path) -> None:
    """Numbers begin with the scalar, as in PX4."""
    psi = LOG["psi"].to_numpy()
    four = quaternion(psi if frame == "ned" else np.pi / 2 - psi)
    log = BRIDGE.drop(columns=["psi", "N", "E"]).assign(x=LOG["north" if frame == "ned" else "east"])
    log["y"] = LOG["east" if frame == "ned" else "north"]
    for letter, values in four.items():
        number = "wxyz".index(letter)
        log[names.format(number if "[{" in names else letter.upper() if "Q" in names else letter)] = values.round(6)
    log.to_csv(tmp_path / "log.csv", index=False)
    dataset = import_draft(tmp_path, guess(tmp_path / "log.csv", frame=frame))
    assert turned(dataset).max() < 1e-5
    assert dataset.frame["v"].to_numpy() == pytest.approx(LOG["v"].to_numpy(), abs=1e-3)


TEXTS = {
    "P12.5": lambda x: f"{'P' if x < 0 else 'S'}{abs(x):.1f}",
    "Bb 12,5": lambda x: f"{'Bb' if x < 0 else 'Stb'} {abs(x):.1f}".replace(".", ","),
}


@pytest.mark.parametrize("style", TEXTS)
def test_a_rudder_with_its_side_in_letters_is_read(style: str, tmp_path: Path) -> None:
    """Before, it was left out as a column of words."""
    proposal, dataset = drafted(BRIDGE.assign(rudder=RUDDER.map(TEXTS[style])), tmp_path)
    column = proposal.column("rudder.delta")
    assert column is not None
    assert (column.unit, column.extra) == ("deg", {})
    np.testing.assert_allclose(np.degrees(dataset.frame["rudder.delta"]), RUDDER, atol=0.051)


@pytest.mark.parametrize("speed", ["kn", ""])
def test_positions_in_radians_without_a_unit_are_told_by_the_speed(speed: str, tmp_path: Path) -> None:
    """As degrees they are off West Africa, and the ship is 57 times too slow; without a speed that is asked."""
    frame = on_globe(np.radians(LAT), np.radians(LON)).drop(columns=["u", "v"])
    if speed:
        frame["SOG"] = np.hypot(LOG["u"], LOG["v"]) * (3600 / 1852 if speed == "kn" else 1.0)
        frame["COG"] = np.degrees(LOG["psi"] + np.arctan2(LOG["v"], LOG["u"])) % 360
    proposal = guess_of(tmp_path, frame)
    columns = [proposal.column(name) for name in ("latitude", "longitude")]
    assert [one.unit for one in columns if one is not None] == (["rad"] * 2 if speed else ["deg"] * 2)
    assert ("or radians?" in asked(proposal)) == (not speed)
    here = guess_of(tmp_path, on_globe(LAT - 63.4, LON - 10.4))
    assert here.column("latitude").unit == "deg"  # type: ignore[union-attr]
