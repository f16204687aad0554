"""Recordings of ROS, written by rosbags, come back as the motion that was written."""

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.logs.formats import TopicsFormat
from shipid.logs.guess.sniff import recognise_log
from shipid.logs.importing import import_log, read_mapping
from shipid.logs.readers import list_topics, read_log_table
from tests.logs.conftest import T, turning

pytest.importorskip("rosbags", reason="rosbags is not installed")
BEGIN = 1_715_673_600  # s since 1970
MAPPING = """
name = "robot"
[format]
kind = "rosbag"
[clock]
from = "time"
max_gap = 3.0
step = 0.5
[columns.north]
from = "/odom.pose.pose.position.y"
unit = "m"
[columns.east]
from = "/odom.pose.pose.position.x"
unit = "m"
[columns.psi]
from = [OF_TURN.x", OF_TURN.y", OF_TURN.z", OF_TURN.w"]
unit = "quaternion"
sign = -1
offset = 1.5707963267948966
wrap = true
[columns.u]
from = "/odom.twist.twist.linear.x"
unit = "m/s"
[columns.v]
from = "/odom.twist.twist.linear.y"
unit = "m/s"
sign = -1
[columns.r]
from = "/odom.twist.twist.angular.z"
unit = "rad/s"
sign = -1
[columns."port.n"]
from = "/shaft.data"
unit = "rev/s"
""".replace("OF_TURN", '"/odom.pose.pose.orientation')


def write_motion(writer: Any, connection: dict[str, Any], store: Any, version: int, motion: pd.DataFrame) -> None:
    """Odometry (x east, y north, heading from east to port) stamped 0.2 s before it comes; a shaft when it changes."""
    of = store.types
    zeros = np.zeros(36)
    write = store.serialize_ros1 if version == 1 else store.serialize_cdr
    before = np.nan
    for row in motion.itertuples():
        now = BEGIN * 10**9 + round(1e9 * row.t)
        stamp = of["builtin_interfaces/msg/Time"](*divmod(now, 10**9))
        head = {"seq": 0} if version == 1 else {}
        yaw = np.pi / 2 - row.psi
        odometry = of["nav_msgs/msg/Odometry"](
            of["std_msgs/msg/Header"](stamp=stamp, frame_id="odom", **head),
            "base",
            of["geometry_msgs/msg/PoseWithCovariance"](
                of["geometry_msgs/msg/Pose"](
                    of["geometry_msgs/msg/Point"](row.east, row.north, 0.0),
                    of["geometry_msgs/msg/Quaternion"](0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)),
                ),
                zeros,
            ),
            of["geometry_msgs/msg/TwistWithCovariance"](
                of["geometry_msgs/msg/Twist"](
                    of["geometry_msgs/msg/Vector3"](row.u, -row.v, 0.0),
                    of["geometry_msgs/msg/Vector3"](0.0, 0.0, -row.r),
                ),
                zeros,
            ),
        )
        writer.write(connection["/odom"], now + 200_000_000, write(odometry, "nav_msgs/msg/Odometry"))
        if row.shaft != before:
            writer.write(
                connection["/shaft"], now, write(of["std_msgs/msg/Float64"](row.shaft), "std_msgs/msg/Float64")
            )
            writer.write(connection["/mode"], now, write(of["std_msgs/msg/String"]("auto"), "std_msgs/msg/String"))
            before = row.shaft


def written_bag(kind: str, folder: Path) -> Path:
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    version = 1 if kind == "bag" else 2
    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    module: ModuleType = rosbag1 if version == 1 else rosbag2
    plugin = {} if version == 1 else {"version": 9, "storage_plugin": getattr(rosbag2.StoragePlugin, kind)}
    place = folder / ("log.bag" if version == 1 else "log")
    topics = {"/odom": "nav_msgs/msg/Odometry", "/shaft": "std_msgs/msg/Float64", "/mode": "std_msgs/msg/String"}
    with module.Writer(place, **plugin) as writer:
        connection = {topic: writer.add_connection(topic, name, typestore=store) for topic, name in topics.items()}
        write_motion(writer, connection, store, version, turning(T).rename(columns={"port.n": "shaft"}))
    return place if version == 1 else next(file for file in place.iterdir() if file.suffix in (".mcap", ".db3"))


@pytest.mark.parametrize("kind", ["bag", "MCAP", "SQLITE3"])
def test_a_recording_of_ros(kind: str, tmp_path: Path) -> None:
    """The motion of the stamps, not of the moments at which messages came; orders are held from their own topic."""
    file = written_bag(kind, tmp_path)
    (tmp_path / "mapping.toml").write_text(MAPPING)
    frame = import_log(read_mapping(tmp_path / "mapping.toml"), file).frame
    motion = turning(T)
    np.testing.assert_allclose(frame["t"] - BEGIN, motion["t"], atol=1e-6)
    for name in ("north", "east", "psi", "u", "v", "r", "port.n"):
        turns = 2 * np.pi if name == "psi" else np.inf
        np.testing.assert_allclose(np.mod(frame[name], turns), np.mod(motion[name], turns), atol=1e-6, err_msg=name)
    listed = {row["topic"]: row for row in list_topics(file)}
    assert listed.keys() == {"/odom", "/shaft"}  # a text is no number
    assert listed["/odom"]["messages"] == len(T)
    assert listed["/odom"]["rate"] == pytest.approx(2.0)
    assert "pose.pose.orientation.w" in listed["/odom"]["fields"]
    assert recognise_log(file, ("/odom",)).form == {"kind": "rosbag", "topics": ["/odom"]}


def test_topics_that_are_not_asked_for_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from rosbags.highlevel import AnyReader

    file, read = written_bag("MCAP", tmp_path), []
    deserialize = AnyReader.deserialize

    def counted(self: Any, content: bytes, kind: str) -> object:
        read.append(kind)
        return deserialize(self, content, kind)

    monkeypatch.setattr(AnyReader, "deserialize", counted)
    table = read_log_table(file, TopicsFormat(kind="rosbag"), "time", ("/shaft.data",))
    assert list(table) == ["time", "/shaft.data"]
    assert {*read} == {"std_msgs/msg/Float64"}


def test_a_topic_that_is_not_there_is_named(tmp_path: Path) -> None:
    file = written_bag("MCAP", tmp_path)
    with pytest.raises(DataError, match=r"no topic '/odm': .*'/odom'"):
        read_log_table(file, TopicsFormat(kind="rosbag", topics=("/odm",)), "time")
    with pytest.raises(DataError, match=r"has '/odom', '/shaft'"):
        read_log_table(file, TopicsFormat(kind="rosbag"), "time", ("/imu.x",))


@pytest.mark.parametrize("name", ["log.bag", "log.mcap", "log.db3"])
def test_a_damaged_recording_is_one_line(name: str, tmp_path: Path) -> None:
    begin = {"log.bag": b"#ROSBAG V2.0\n", "log.mcap": b"\x89MCAP0\r\n", "log.db3": b"SQLite format 3\0"}[name]
    (tmp_path / name).write_bytes(begin + bytes(range(256)) * 40)
    with pytest.raises(DataError, match="not a recording of ROS, or damaged"):
        list_topics(tmp_path / name)
