"""Flight logs of PX4 (.ulg), read by pyulog."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from shipid.logs.topics import Topics, recording_errors


def read_ulog(file: Path, is_needed: Callable[[str], bool]) -> Topics:
    """The topics of a flight log: `time` [s] since the start of the autopilot, and their fields.

    A second instance of a topic is `topic[1]`.
    """
    with recording_errors(file, "a flight log of PX4", "pyulog"):
        from pyulog import ULog

        with file.open("rb") as stream:
            heads = ULog(stream, parse_header_only=True)
            names = [name for name in heads.message_formats if is_needed(name)]
        with file.open("rb") as stream:
            parts = ULog(stream, names).data_list if names else []
        topics = {f"{one.name}[{one.multi_id}]" if one.multi_id else one.name: one.data for one in parts}
        return {
            name: pd.DataFrame(
                {"time": 1e-6 * said["timestamp"]}
                | {key: values for key, values in said.items() if key != "timestamp" and not key.startswith("_padding")}
            )
            for name, said in topics.items()
            if is_needed(name) and len(said["timestamp"])
        }


def is_ulog(_: Path, head: bytes) -> dict[str, Any] | None:
    """Recognise a flight log of PX4 by its first bytes."""
    return {"kind": "ulog"} if head.startswith(b"ULog\x01\x12\x35") else None
