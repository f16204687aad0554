"""Logs and datasets whose motion is known exactly."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.logs.importing import import_log, read_mapping

REPOSITORY = Path(__file__).parents[2]
PLAIN = REPOSITORY / "tests" / "bad" / "logs" / "plain.toml"


@pytest.fixture(scope="session")
def gunnerus_log(shared_data: Path) -> Path:
    file = shared_data / "gunnerus_2022" / "RVG_ManeuveringTests.csv"
    if not file.is_file():
        pytest.skip(f"no {file.name} in the data folder")
    return file


@pytest.fixture
def plain_mapping(tmp_path: Path) -> Callable[[str], Path]:
    """Write the plain mapping with more TOML behind it."""

    def write(more: str = "", replace: tuple[str, str] = ("", "")) -> Path:
        file = tmp_path / "mapping.toml"
        file.write_text(PLAIN.read_text().replace(*replace) + more)
        return file

    return write


def turning(t: np.ndarray, *, u: float = 4.0, v: float = -0.5, r: float = 0.05, psi0: float = 6.0) -> pd.DataFrame:
    """Steady turn, analytically: psi = psi0 + r t, and the exact integral of R(psi) (u, v)."""
    psi = psi0 + r * t
    north = (u * (np.sin(psi) - np.sin(psi0)) + v * (np.cos(psi) - np.cos(psi0))) / r
    east = (-u * (np.cos(psi) - np.cos(psi0)) + v * (np.sin(psi) - np.sin(psi0))) / r
    return pd.DataFrame(
        {"t": t, "north": north, "east": east, "psi": psi, "u": u, "v": v, "r": r, "port.n": np.floor(t / 7.0) % 1000}
    )


def as_dataset(*frames: pd.DataFrame, names: tuple[str, ...] = (), **metadata: object) -> Dataset:
    """Join frames as runs `a`, `b`, ... without flags set."""
    runs = []
    for index, frame in enumerate(frames):
        name = names[index] if names else "abcdefghijklmnopqrstuvwxyz"[index]
        flags = frame.get("flags", 0)
        runs.append(frame.assign(run=pd.Series([name] * len(frame), dtype="str"), flags=flags))
    return Dataset(pd.concat(runs, ignore_index=True).astype({"flags": "int64"}), {"flags": ["break"], **metadata})


CLOCKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0}
SPEEDS = {"m/s": 1.0, "kn": 1852 / 3600, "km/h": 1 / 3.6, "mph": 1609.344 / 3600, "cm/s": 1e-2, "mm/s": 1e-3}
DATES = ("date", "datenum", "excel")


def stamps(t: np.ndarray, unit: str) -> list[float] | list[str]:
    """Write times t (N,) [s], for dates since 1970, in a unit of a clock, by the calendar and not by the importer."""
    if unit in CLOCKS:
        return [float(value / CLOCKS[unit]) for value in t]
    moments = pd.to_datetime(np.round(1e9 * t).astype(np.int64), unit="ns")
    if unit == "date":
        return [moment.isoformat() for moment in moments]
    zero = pd.Timestamp(1899, 12, 30)
    days = [moment.toordinal() + 366 if unit == "datenum" else (moment - zero).days for moment in moments]
    rests = (moments - moments.normalize()) / pd.Timedelta("1D")
    return [float(day + rest) for day, rest in zip(days, rests, strict=True)]


def as_log(frame: pd.DataFrame, file: Path, clock: str = "s", speed: str = "m/s") -> Path:
    """Write a frame as a log of the plain mapping: degrees 0..360, deg/min, rpm; units of the clock and of u, v."""
    log = pd.DataFrame(
        {
            "time": stamps(frame["t"].to_numpy(), clock),
            "N": frame["north"],
            "E": frame["east"],
            "heading": np.degrees(frame["psi"]) % 360.0,
            "u": frame["u"] / SPEEDS[speed],
            "v": frame["v"] / SPEEDS[speed],
            "rot": np.degrees(frame["r"]) * 60.0,
            "rpm": frame["port.n"] * 60.0,
        }
    )
    log.to_csv(file, index=False)
    return file


T = np.arange(0.0, 60.0, 0.5)
STATES = ["t", "north", "east", "psi", "u", "v", "r", "propeller.n"]
NAMES = ["time", "N", "E", "heading", "u", "v", "rot", "rpm"]


@pytest.fixture
def log(tmp_path: Path) -> pd.DataFrame:
    return pd.read_csv(as_log(turning(T), tmp_path / "plain.csv"))


def mapping_with(tmp_path: Path, form: str, *changes: tuple[str, str]) -> Path:
    """Write the plain mapping with a format and changes."""
    text = PLAIN.read_text().replace("[clock]", f"[format]\n{form}\n[clock]")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "mapping.toml"
    file.write_text(text)
    return file


def import_written(mapping: Path | str, log: pd.DataFrame, folder: Path) -> Dataset:
    """Import a table, written as a text, by a mapping: its file, or its text."""
    file = folder / "mapping.toml" if isinstance(mapping, str) else mapping
    if isinstance(mapping, str):
        file.write_text(mapping)
    log.to_csv(folder / "log.csv", index=False)
    return import_log(read_mapping(file), folder / "log.csv")


def assert_is_the_motion(mapping: Path, file: Path) -> None:
    frame = import_log(read_mapping(mapping), file).frame
    motion = turning(T).rename(columns={"port.n": "propeller.n"})
    for name in STATES:
        np.testing.assert_allclose(frame[name], motion[name], atol=1e-6, err_msg=name)
