"""NMEA 0183: sentences come back as the motion that they tell, with their times."""

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pynmea2
import pytest

from shipid.errors import DataError
from shipid.logs.formats import NmeaFormat
from shipid.logs.guess.columns import guess
from shipid.logs.importing import import_log, read_mapping
from shipid.logs.nmea import sentence_moment, sentence_values
from shipid.logs.readers import READERS, read_log_table
from tests.logs.conftest import T, turning


def sentence(body: str) -> str:
    """NMEA 0183: $body*checksum, the exclusive or of all characters of the body."""
    check = 0
    for character in body:
        check ^= ord(character)
    return f"${body}*{check:02X}"


def degrees_minutes(value: float, width: int) -> str:
    degrees = int(abs(value))
    return f"{degrees:0{width}d}{60 * (abs(value) - degrees):011.8f}"


NMEA = """
name = "bridge"
[format]
kind = "nmea"
[clock]
from = "time"
max_gap = 5.0
step = 0.5
[origin]
latitude = 63.45
longitude = 10.4
[columns.latitude]
from = "latitude"
unit = "deg"
[columns.longitude]
from = "longitude"
unit = "deg"
[columns.psi]
from = "heading"
unit = "deg"
wrap = true
[columns.speed]
from = "sog"
unit = "kn"
[columns.course]
from = "cog"
unit = "deg"
wrap = true
[columns.r]
from = "rot"
unit = "deg/min"
[columns.V_w]
from = "apparent_speed"
unit = "m/s"
[columns.beta_w]
from = "apparent_angle"
unit = "deg"
direction = "from"
relative = true
wrap = true
[columns."rudder.delta"]
from = "rudder"
unit = "deg"
"""


def bridge_log(time: str, midnight: float, motion: pd.DataFrame) -> tuple[str, pd.DataFrame]:
    """Sentences of a ship in a steady turn in a wind of 8 m/s towards the east; 1 is damaged, 1 is a message of AIS."""
    radius = 6378137.0  # m; close enough to the ellipsoid's for a check to 1 %
    lines = ["!AIVDM,1,1,,A,14eG;o@034o8sd<L9i:a;WF>062D,0*7D", "$GPRMC,noise"]
    course = np.degrees(motion["psi"] + np.arctan2(motion["v"], motion["u"])) % 360
    speed = np.hypot(motion["u"], motion["v"]) * 3600 / 1852
    for row in motion.itertuples():
        index = row.Index
        clock = (midnight + row.t) % 86400
        stamp = f"{int(clock // 3600):02d}{int(clock % 3600 // 60):02d}{clock % 60:05.2f}"
        latitude = 63.45 + np.degrees(row.north / radius)
        longitude = 10.4 + np.degrees(row.east / radius / np.cos(np.radians(63.45)))
        where = f"{degrees_minutes(latitude, 2)},N,{degrees_minutes(longitude, 3)},E"
        psi = np.degrees(row.psi) % 360
        ahead, abeam = 8 * np.sin(row.psi) - row.u, 8 * np.cos(row.psi) - row.v
        comes_from = (np.degrees(np.arctan2(abeam, ahead)) + 180) % 360
        bodies = [
            f"GPRMC,{stamp},A,{where},{speed[index]:.6f},{course[index]:.5f},271022,,,A",
            f"HEHDT,{psi:.5f},T",
            f"TIROT,{np.degrees(row.r) * 60:.5f},A",
            f"WIMWV,{comes_from:.4f},R,{np.hypot(ahead, abeam):.5f},M,A",
            "AGRSA,10.0,A,,",
        ]
        before = f"{row.t:.1f} " if time == "line" else ""
        lines += [before + sentence(body) for body in bodies]
    return "\r\n".join(lines) + "\r\n", motion


def test_values_that_a_sentence_calls_invalid_are_not_taken(tmp_path: Path) -> None:
    begin = [
        "GPRMC,120000,A,4807.0,N,01131.0,E,5.0,84.0,271022,,,A",
        "AGRSA,10.5,A,4.0,V",
        "GPVTG,54.0,T,,M,5.5,N,,K,A",
    ]
    later = ["GPRMC,120001,A,4807.0,N,01131.0,E,,,271022,,,A", "AGRSA,33.0,V,,", "GPVTG,99.0,T,,M,77.0,N,,K,N"]
    (tmp_path / "log").write_text("\n".join(map(sentence, begin + later)))
    table = read_log_table(tmp_path / "log", NmeaFormat(kind="nmea"), "time")
    assert table["rudder"].tolist() == pytest.approx([10.5, np.nan], nan_ok=True)
    assert table["rudder_port"].isna().all()
    assert table["sog"].tolist() == pytest.approx([5.0, np.nan], nan_ok=True)
    assert table.attrs["unreadable"] == 0


@pytest.mark.parametrize(
    ("fixes", "hours"),
    [
        (["GGA 230000", "RMC 230000 271022", "GGA 010000", "RMC 010000 281022"], [0, 2]),
        (["RMC 080000 271022", "GGA 080100", "GGA 090000", "RMC 090000 281022"], [0, 1 / 60, 25]),
        (["RMC 080000 271022", "RMC 070000 301022", "GGA 070100"], [0, 71, 71 + 1 / 60]),
        (["ZDA 080000 271022", "GGA 090000", "ZDA 090000 281022"], [0, 25]),
        (["RMC 235959 311222", "RMC 000000 311222", "RMC 000001 010123"], [0, 1 / 3600, 2 / 3600]),
        (["RMC 080000 271022", "RMC 090000 -"], [0, 1]),
        (["GGA 230000", "GGA 010000"], [0, 2]),
    ],
)
def test_a_fix_is_of_the_day_that_the_sentences_say(fixes: list[str], hours: list[float], tmp_path: Path) -> None:
    """Before, a log that was off for 25 h went on after one; a date that changes a second late makes no day."""
    lines = []
    for kind, time, *date in map(str.split, fixes):
        day = (date or ["-"])[0].replace("-", "")
        if kind == "RMC":
            lines.append(f"GPRMC,{time},A,4807.0,N,01131.0,E,5.0,84.0,{day},,,A")
        elif kind == "ZDA":
            lines.append(f"GPZDA,{time},{day[:2]},{day[2:4]},20{day[4:]},00,00")
        else:
            lines.append(f"GPGGA,{time},4807.0,N,01131.0,E,1,8,0.9,5.0,M,46.9,M,,")
    (tmp_path / "log").write_text("\n".join(map(sentence, lines)))
    t = read_log_table(tmp_path / "log", NmeaFormat(kind="nmea"), "time")["time"]
    np.testing.assert_allclose((t - t[0]) / 3600, hours)
    days = [
        datetime.strptime(fix.split()[2], "%d%m%y").replace(tzinfo=UTC)
        for fix in fixes
        if re.search(r" \d{6} \d{6}$", fix)
    ]
    begin = min(days).timestamp() if days else 0.0  # dated, so that it can be joined with other dated logs
    assert 0 <= t[0] - begin < 86400


@pytest.mark.parametrize(("time", "midnight"), [("fix", 86400.0 - 30.0), ("line", 0.0)])
def test_nmea(time: str, midnight: float, tmp_path: Path) -> None:
    text, motion = bridge_log(time, midnight, turning(T))
    if time == "line":
        text = "\n".join(text.splitlines()[2:])
    (tmp_path / "bridge.nmea").write_text(text)
    (tmp_path / "mapping.toml").write_text(NMEA.replace('"nmea"', f'"nmea"\ntime = "{time}"'))
    dataset = import_log(read_mapping(tmp_path / "mapping.toml"), tmp_path / "bridge.nmea")
    frame = dataset.frame
    assert len(frame) == len(T)
    first = datetime(2022, 10, 27, tzinfo=UTC).timestamp() if time == "fix" else 0.0  # RMC says the date
    np.testing.assert_allclose(frame["t"], first + T + midnight, rtol=0, atol=1e-6)
    for name, tolerance in {"psi": 1e-6, "u": 1e-5, "v": 1e-5, "r": 1e-6}.items():
        np.testing.assert_allclose(frame[name], motion[name], atol=tolerance, err_msg=name)
    extent = np.ptp(motion["north"])
    for name in ("north", "east"):
        np.testing.assert_allclose(frame[name], motion[name], atol=0.01 * extent, err_msg=name)
    np.testing.assert_allclose(frame["V_w"], 8.0, atol=1e-3)
    np.testing.assert_allclose(np.sin(frame["beta_w"]), 1.0, atol=1e-3)
    np.testing.assert_allclose(np.degrees(frame["rudder.delta"]), 10.0)
    counted = [record["count"] for record in dataset.metadata["repairs"] if record["kind"] == "unreadable"]
    assert counted == ([1] if time == "fix" else [])
    assert dataset.metadata["origin"] == {"latitude": 63.45, "longitude": 10.4}


@pytest.mark.parametrize(
    "written",
    [
        lambda moment: f"{moment.timestamp():.3f} ",
        lambda moment: f"{moment:%d.%m.%Y};{moment:%H:%M:%S.%f};",
        lambda moment: f"{moment:%Y-%m-%dT%H:%M:%S.%f}Z ",
        lambda moment: f"{moment:%Y%m%d%H%M%S.%f},",  # a number, too: minutes were of 100 s
        lambda moment: f"\\g:1-1-1234,s:r3669961,c:{round(1000 * moment.timestamp())}*5F\\",
    ],
)
def test_stamps_before_sentences_and_speeds_of_shafts(written: Any, tmp_path: Path) -> None:
    """6 May, not 5 June; shafts and engines by their number."""
    begin = datetime(2025, 5, 6, 7, 8, 9, 500000, tzinfo=UTC)
    lines = []
    for second in range(20):
        bodies = [f"{kind},{number},{100.0 * factor + 10 * number + second},,A" for kind, factor in (("E", 5), ("S", 1))
                  for number in (1, 2)]  # fmt: skip
        stamp = written(begin + timedelta(seconds=second))
        lines += [stamp + sentence(f"IIRPM,{body}") for body in bodies] + [stamp + sentence("HEHDT,10.0,T")]
    file = tmp_path / "bridge.nmea"
    file.write_text("\n".join(lines))
    assert READERS["nmea"].detect is not None
    assert READERS["nmea"].detect(file, file.read_bytes()) == {"kind": "nmea", "time": "line"}
    table = READERS["nmea"].read(file, NmeaFormat(kind="nmea", time="line"), "time")
    np.testing.assert_allclose(table["time"], begin.timestamp() + np.arange(20.0), atol=1e-3)
    for name, base in (("rpm", 100.0), ("engine_rpm", 500.0)):
        for column, number in ((name, 1), (f"{name}_2", 2)):
            np.testing.assert_allclose(table[column], base + 10 * number + np.arange(20))


@pytest.mark.parametrize("stamp", ["06/05/2025 12:00:00,", "12:00:01 "])
def test_a_stamp_that_is_no_moment_is_refused(stamp: str, tmp_path: Path) -> None:
    """A time without a date, or a date that may be two days; a guess takes the time of the fix."""
    file = tmp_path / "bridge.nmea"
    file.write_text(stamp + sentence("HEHDT,10.0,T") + "\n")
    assert READERS["nmea"].detect is not None
    assert READERS["nmea"].detect(file, file.read_bytes()) == {"kind": "nmea", "time": "fix"}
    with pytest.raises(DataError, match=r"row 1: no .*: set \[format\] time = 'fix'"):
        READERS["nmea"].read(file, NmeaFormat(kind="nmea", time="line"), "time")


RMC = "GPRMC,12{:02d}{:02d},A,4807.0,N,01131.0,E,5.0,84.0,271022,,,A"


def read(lines: list[str], file: Path) -> pd.DataFrame:
    file.write_text("\n".join(lines) + "\n")
    assert READERS["nmea"].detect is not None
    assert READERS["nmea"].detect(file, file.read_bytes()) == {"kind": "nmea", "time": "fix"}
    return read_log_table(file, NmeaFormat(kind="nmea"), "time")


def test_messages_of_ais_and_targets_of_a_radar_are_passed_over(tmp_path: Path) -> None:
    """Before, a log with more of them than of the ship was no log, and the time of a target moved the clock back."""
    lines = []
    for k in range(30):
        lines += [sentence(RMC.format(0, k)), sentence(f"HEHDT,{k}.0,T"), "$PUBX,no,checksum"]
        lines += [sentence(f"RATTM,01,2.3,45.0,T,9,90.0,T,1.0,5.0,N,X,T,,1159{k + 27:02d}.00,A")]
        lines += ["!AIVDM,1,1,,A,14eG;o@034o8sd<L9i:a;WF>062D,0*7D"] * 6
    table = read(lines, tmp_path / "log")
    np.testing.assert_allclose(table["time"] - table["time"][0], np.arange(30.0))
    np.testing.assert_allclose(table["heading"], np.arange(30.0))
    assert table.attrs["unreadable"] == 30
    assert table.attrs["notes"] == ["sentences of these kinds are not read: AIVDM (180), TTM (30)"]
    with pytest.raises(DataError, match=r"0 unreadable lines, AIVDM\).*decode messages of AIS"):
        read(lines[4:5] * 20, tmp_path / "ais")


WHERE = "4807.038,N,01131.000,W"
PLACE = {"latitude": 48 + 7.038 / 60, "longitude": -(11 + 31 / 60)}


@pytest.mark.parametrize(
    ("body", "values"),
    [
        (f"GNGNS,120000,{WHERE},AN,09,0.9,5.0,40.0,,", PLACE),
        (f"GNGNS,120000,{WHERE},NN,09,0.9,5.0,40.0,,", {}),
        (f"GPGGA,120000,{WHERE},1,8,0.9,5.0,M,46.9,M,,", PLACE),
        (f"GPGGA,120000,{WHERE},0,0,,,M,,M,,", {}),
        (f"GPGLL,{WHERE},120000,A", PLACE),
        (f"GPRMC,120000,A,{WHERE},5.0,,271022", PLACE | {"sog": 5.0}),
        ("GPRMC,120000,A,,,,,5.0,84.0,271022,,,A", {"sog": 5.0, "cog": 84.0}),
        ("GPVTG,54.0,T,,M,,N,18.52,K,A", {"cog": 54.0, "sog": 10.0}),
        ("HETHS,123.4,A", {"heading": 123.4}),
        ("HETHS,123.4,V", {}),
        ("TIROT,0.0,A", {"rot": 0.0}),
        ("AGRSA,0.0,A,-4.0,V", {"rudder": 0.0}),
        ("IIRPM,S,0,90.0,,A", {"rpm_0": 90.0}),
        ("IIRPM,S,3,0.0,,A", {"rpm_3": 0.0}),
        ("WIMWV,0.0,R,36.0,K,A", {"apparent_angle": 0.0, "apparent_speed": 10.0}),
        ("WIMWD,270.0,T,,M,,N,5.0,M", {"wind_from": 270.0, "wind_speed": 5.0}),
        ("HCHDG,359.0,2.0,W,3.5,E", {"heading_compass": 0.5}),
        ("HCHDG,120.0,2.0,W,,", {"heading_magnetic": 118.0}),
        ("HCHDM,120.0,M", {"heading_magnetic": 120.0}),
        ("VWVHW,121.0,T,118.0,M,,N,18.52,K", {"heading_log": 121.0, "heading_magnetic": 118.0, "stw": 10.0}),
    ],
)
def test_what_a_sentence_says(body: str, values: dict[str, float]) -> None:
    """A compass plus its deviation is magnetic, plus the variation true; east is positive (IEC 61162-1)."""
    assert sentence_values(pynmea2.parse(sentence(body))) == pytest.approx(values)


@pytest.mark.parametrize("fields", ["4860.000,N,01131.000,W", "4807.038,,01131.000,W", "4807.038,N,01131.000,N"])
def test_a_position_that_is_none_is_refused(fields: str) -> None:
    """Before, a position without its side was at 0 deg."""
    with pytest.raises(ValueError, match=r"is no (latitude|longitude)"):
        sentence_values(pynmea2.parse(sentence(f"GPGLL,{fields},120000,A")))


def test_fixes_say_the_time_and_others_do_not() -> None:
    moment = sentence_moment(pynmea2.parse(sentence(f"GPRMC,235960.5,A,{WHERE},5,84,020170")))
    assert moment == (86400.5, 1.0)
    assert np.isnan(sentence_moment(pynmea2.parse(sentence("HEHDT,10.0,T")))).all()


@pytest.mark.parametrize("time", ["240000", "126000", "120061", "-10000", "12-100"])
def test_a_time_that_no_day_has_is_refused(time: str) -> None:
    with pytest.raises(ValueError, match=r"is no time of day|invalid literal|could not convert"):
        sentence_moment(pynmea2.parse(sentence(f"GPGLL,{WHERE},{time},A")))


@pytest.mark.parametrize("kind", ["HCHDG,{:.1f},0.0,E,2.0,E", "HCHDM,{:.1f},M", "VWVHW,{:.1f},T,,M,5.0,N,,K"])
def test_a_log_whose_heading_is_of_a_compass_or_log_is_drafted(kind: str, tmp_path: Path) -> None:
    """Before, no column could be the heading; a magnetic one is asked."""
    text, _ = bridge_log("fix", 3600.0, turning(T))
    said = [
        re.sub(r".HEHDT,([\d.]+),T.*", lambda one: sentence(kind.format(float(one[1]))), line) for line in text.split()
    ]
    (tmp_path / "log.nmea").write_text("\n".join(said))
    heading = guess(tmp_path / "log.nmea").column("psi")
    assert heading is not None
    assert heading.source == {"HDG": "heading_compass", "HDM": "heading_magnetic", "VHW": "heading_log"}[kind[2:5]]
