"""Flight logs of PX4, written by their public format, come back as the motion that was written."""

import struct
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.logs.formats import TopicsFormat
from shipid.logs.guess.sniff import recognise_log
from shipid.logs.readers import list_topics, read_log_table
from tests.logs.conftest import T, turning

pytest.importorskip("pyulog", reason="pyulog is not installed")
FIELDS = {
    "pose": "uint64_t timestamp;double x;double y;uint8_t[4] _padding0;float[4] q",
    "motor": "uint64_t timestamp;float speed",
}


def written_ulog(file: Path, motion: pd.DataFrame) -> Path:
    """ULog, version 1: header, formats, subscriptions, data (docs.px4.io, ULog file format); two motors."""

    def message(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<HB", len(content), kind[0]) + content

    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)]
    parts += [message(b"F", f"{name}:{fields};".encode()) for name, fields in FIELDS.items()]
    topics = [("pose", 0), ("motor", 0), ("motor", 1)]
    parts += [message(b"A", struct.pack("<BH", of, number) + name.encode()) for number, (name, of) in enumerate(topics)]
    for row in motion.itertuples():
        now, half = round(1e6 * (row.t + 5.0)), row.psi / 2
        pose = struct.pack("<HQdd4x4f", 0, now, row.north, row.east, np.cos(half), 0.0, 0.0, np.sin(half))
        parts += [message(b"D", pose)]
        parts += [message(b"D", struct.pack("<HQf", 1 + of, now + 100_000, 10.0 * of + row.t)) for of in (0, 1)]
    file.write_bytes(b"".join(parts))
    return file


def test_a_flight_log_of_px4(tmp_path: Path) -> None:
    """Each topic has its own instants; a second motor is another topic."""
    motion = turning(T)
    file = written_ulog(tmp_path / "log.ulg", motion)
    table = read_log_table(file, TopicsFormat(kind="ulog"), "time")
    pose, motor = table.dropna(subset=["pose.x"]), table.dropna(subset=["motor[1].speed"])
    np.testing.assert_allclose(pose["time"], T + 5.0, atol=1e-6)
    np.testing.assert_allclose(pose[["pose.x", "pose.y"]], motion[["north", "east"]], rtol=1e-12)
    yaw = 2 * np.arctan2(pose["pose.q[3]"], pose["pose.q[0]"])
    np.testing.assert_allclose(np.sin(yaw - motion["psi"].to_numpy()), 0.0, atol=1e-6)
    np.testing.assert_allclose(motor["time"], T + 5.1, atol=1e-6)
    np.testing.assert_allclose(motor["motor[1].speed"], 10.0 + T, atol=1e-5)
    assert not [name for name in table if "padding" in name]
    assert [row["topic"] for row in list_topics(file)] == ["motor", "motor[1]", "pose"]
    assert list(read_log_table(file, TopicsFormat(kind="ulog"), "time", ("pose.x",))) == [
        "time", *(f"pose.{name}" for name in ("x", "y", "q[0]", "q[1]", "q[2]", "q[3]")),
    ]  # fmt: skip
    log = recognise_log(file, ("pose",))
    assert log.form == {"kind": "ulog", "topics": ["pose"]}
    assert log.clock == {"from": "time", "unit": "s"}


def test_a_damaged_flight_log_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "log.ulg").write_bytes(b"ULog\x01\x12\x35\x01" + bytes(range(256)) * 40)
    with pytest.raises(DataError, match=r"not a flight log of PX4, or damaged|none of its topics"):
        read_log_table(tmp_path / "log.ulg", TopicsFormat(kind="ulog"), "time")
