"""Flight logs of ArduPilot, written by their public format, come back as the motion that was written."""

import struct
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.logs.formats import TopicsFormat
from shipid.logs.readers import list_topics, read_log_table
from tests.logs.conftest import T, turning

pytest.importorskip("pymavlink", reason="pymavlink is not installed")
KINDS = {
    129: ("ATT", "QffH", "TimeUS,Yaw,Roll,Cnt"),
    130: ("RCOU", "QHH", "TimeUS,C1,C3"),
    131: ("MSG", "QZ", "TimeUS,Message"),
    132: ("GPS", "QBLL", "TimeUS,I,Lat,Lng"),
    133: ("FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
}
CODES = {"Q": "Q", "f": "f", "H": "H", "B": "B", "L": "i", "Z": "64s", "N": "16s"}


def written_dataflash(file: Path, motion: pd.DataFrame) -> Path:
    """FMT messages, then messages of these types (ardupilot.org, onboard message log formats); two receivers."""

    def message(kind: int, *values: object) -> bytes:
        form = "".join(CODES[letter] for letter in KINDS[kind][1])
        return b"\xa3\x95" + bytes([kind]) + struct.pack(f"<{form}", *values)

    parts = [
        b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", 0x80, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    ]
    for kind, (name, form, columns) in KINDS.items():
        size = 3 + struct.calcsize("<" + "".join(CODES[letter] for letter in form))
        heads = (kind, size, name.encode(), form.encode(), columns.encode())
        parts.append(b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", *heads))
    parts.append(message(133, 0, 132, b"s#DU", b"----"))  # I is the number of the receiver
    parts.append(message(131, 0, b"ArduRover V4.5"))
    for index, row in enumerate(motion.itertuples()):
        now = round(1e6 * (row.t + 5.0))
        parts.append(message(129, now, np.degrees(row.psi) % 360, 0.0, index))
        parts.append(message(130, now + 20_000, 1500 + index, 1500 - index))
        parts += [message(132, now, of, round(1e7 * (63.4 + of)) + index, 104_000_000 + index) for of in (0, 1)]
    file.write_bytes(b"".join(parts))
    return file


def test_a_flight_log_of_ardupilot(tmp_path: Path) -> None:
    """Types of messages are topics, each with its own instants; a second receiver is another one; no texts."""
    motion = turning(T)
    file = written_dataflash(tmp_path / "log.bin", motion)
    assert [row["topic"] for row in list_topics(file)] == ["ATT", "GPS[0]", "GPS[1]", "RCOU"]
    table = read_log_table(file, TopicsFormat(kind="dataflash"), "time")
    heading, output = table.dropna(subset=["ATT.Yaw"]), table.dropna(subset=["RCOU.C1"])
    np.testing.assert_allclose(heading["time"], T + 5.0, atol=1e-6)
    np.testing.assert_allclose(np.sin(np.radians(heading["ATT.Yaw"]) - motion["psi"].to_numpy()), 0.0, atol=1e-5)
    np.testing.assert_allclose(heading["GPS[1].Lat"], 64.4 + 1e-7 * np.arange(len(T)), atol=1e-9)
    np.testing.assert_allclose(output["time"], T + 5.02, atol=1e-6)
    np.testing.assert_array_equal(output["RCOU.C3"], 1500 - np.arange(len(T)))
    assert list(read_log_table(file, TopicsFormat(kind="dataflash"), "time", ("RCOU.C1",))) == [
        "time", "RCOU.C1", "RCOU.C3",
    ]  # fmt: skip


def test_a_damaged_flight_log_is_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "log.bin").write_bytes(b"\xa3\x95\x80\x80" + bytes(range(256)) * 40)
    capfd.readouterr()
    with pytest.raises(DataError, match=r"not a flight log of ArduPilot, or damaged|none of its topics"):
        read_log_table(tmp_path / "log.bin", TopicsFormat(kind="dataflash"), "time")
    assert capfd.readouterr() == ("", "")
