"""Flight logs of ArduPilot (.bin), read by pymavlink."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from shipid.logs.topics import Topics, recording_errors

OF_FORMAT = {"FMT", "FMTU", "UNIT", "MULT", "PARM"}  # messages on the log itself and on settings


def read_dataflash(file: Path, is_needed: Callable[[str], bool]) -> Topics:
    """The types of messages of a flight log: `time` [s] since the start of the autopilot, and their numbers.

    A sensor of several is `IMU[0]`.
    """
    rows: dict[str, list[dict[str, float]]] = defaultdict(list)
    with recording_errors(file, "a flight log of ArduPilot", "pymavlink"):
        from pymavlink import DFReader

        log = DFReader.DFReader_binary(str(file), zero_time_base=True)
        try:
            names = {
                one.name: [*one.columns]
                for one in log.formats.values()
                if "TimeUS" in one.columns and one.name not in OF_FORMAT
            }
            while (message := log.recv_match(type=[*names])) if names else None:
                kind, place = message.get_type(), message.fmt.instance_field
                topic = kind if place is None else f"{kind}[{getattr(message, place)}]"
                if is_needed(topic):
                    said = ((name, getattr(message, name)) for name in names[kind] if name not in ("TimeUS", place))
                    numbers = {name: value for name, value in said if isinstance(value, int | float)}
                    rows[topic].append({"time": 1e-6 * message.TimeUS} | numbers)
        finally:
            log.close()
        return {topic: pd.DataFrame(said) for topic, said in rows.items() if len(said[0]) > 1}


def is_dataflash(_: Path, head: bytes) -> dict[str, Any] | None:
    """Recognise a flight log of ArduPilot by its first bytes."""
    return {"kind": "dataflash"} if head.startswith(b"\xa3\x95") else None
