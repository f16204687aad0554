"""Recordings of ROS 1 (.bag) and ROS 2 (.mcap, .db3), read by rosbags."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.errors import DataError
from shipid.logs.topics import MOST_ITEMS, Topics, message_times, recording_errors

ENDINGS_OF_ROS = (".bag", ".mcap", ".db3")
BEGINS_OF_ROS = (b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\0")


def read_bag(file: Path, is_needed: Callable[[str], bool]) -> Topics:
    """The topics of a recording: `time` since 1970 of the header, else when a message came, and its numbers.

    A field of a part is `part.field`, an item of an array `field[0]`.
    """
    if file.suffix not in ENDINGS_OF_ROS:
        raise DataError(f"a recording of ROS ends in one of {', '.join(ENDINGS_OF_ROS)}: rename it", file=file)
    rows: dict[str, list[dict[str, float]]] = defaultdict(list)
    with recording_errors(file, "a recording of ROS", "rosbags"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        with AnyReader([file], default_typestore=get_typestore(Stores.LATEST)) as bag:
            needed = [one for one in bag.connections if is_needed(one.topic)]
            for connection, received, content in bag.messages(needed) if needed else ():
                message = bag.deserialize(content, connection.msgtype)
                rows[connection.topic].append({"time": 1e-9 * received} | dict(_numbers_in(message)))
        return {topic: _with_stamps(pd.DataFrame(said)) for topic, said in rows.items() if len(said[0]) > 1}


def _with_stamps(said: pd.DataFrame) -> pd.DataFrame:
    """Messages with the time of their header, where it is one, in place of that at which they came."""
    stamp = {"header.stamp.sec", "header.stamp.nanosec"}
    if not stamp <= {*said}:
        return said
    stamps = said["header.stamp.sec"] + 1e-9 * said["header.stamp.nanosec"]
    times = message_times(said["time"].to_numpy(), stamps.to_numpy())
    return said.drop(columns=[name for name in said if str(name).startswith("header.")]).assign(time=times)


def _numbers_in(part: Any, before: str = "") -> Iterator[tuple[str, float]]:
    """Yield name and value of the numbers in a message."""
    if isinstance(part, bool | int | float | np.number):
        yield before.removesuffix("."), float(part)
    elif is_dataclass(part):
        for one in fields(part):
            yield from _numbers_in(getattr(part, one.name), f"{before}{one.name}.")
    elif isinstance(part, list | np.ndarray) and len(part) <= MOST_ITEMS:
        for index, item in enumerate(part):
            yield from _numbers_in(item, f"{before.removesuffix('.')}[{index}].")


def is_bag(file: Path, head: bytes) -> dict[str, Any] | None:
    """Recognise a recording of ROS; other data bases of SQLite have another ending."""
    begins = head.startswith(BEGINS_OF_ROS) and (file.suffix == ".db3" or not head.startswith(BEGINS_OF_ROS[-1]))
    return {"kind": "rosbag"} if begins else None
