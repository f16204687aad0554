"""What was put into a log is named, and nothing else; every documented trap of the recorded sets is found."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.data.guess import Guess, guess
from shipid.errors import DataError
from tests.data.simulated import KNOT, Change, as_bridge, motion, si_log


def guessed(log: pd.DataFrame, folder: Path) -> Guess:
    log.to_csv(folder / "log.csv", index=False)
    return guess(folder / "log.csv")


def told(found: Guess) -> dict[str, tuple[str, str, int, str]]:
    """Column of the dataset -> source, unit, sign, frame."""
    return {c.name: (c.source, c.unit, c.extra.get("sign", 1), c.extra.get("frame", "body")) for c in found.columns}


CLEAN = {
    "north": ("N", "m", 1, "body"),
    "east": ("E", "m", 1, "body"),
    "psi": ("psi", "deg", 1, "body"),
    "u": ("u", "m/s", 1, "body"),
    "v": ("v", "m/s", 1, "body"),
    "r": ("r", "deg/s", 1, "body"),
    "rudder.delta": ("rudder", "deg", 1, "body"),
    "propeller.n": ("rpm", "rpm", 1, "body"),
}


@pytest.mark.parametrize(("seed", "every"), [(0, 1), (0, 5), (1, 5), (2, 10), (3, 20)])
def test_a_clean_log_has_no_defect(seed: int, every: int, tmp_path: Path) -> None:
    found = guessed(as_bridge(si_log(seed, every)).round(4), tmp_path)
    assert found.findings == ()
    assert told(found) == CLEAN
    assert all(column.confidence > 0.8 and column.evidence for column in found.columns)


def spread(log: pd.DataFrame) -> pd.DataFrame:
    """As from a slower log of 2 s, interpolated linearly, the heading across 360, too."""
    slow = log.iloc[::4]
    fast = log["time"][log["time"] <= slow["time"].iloc[-1]]
    return pd.DataFrame({name: np.interp(fast, slow["time"], slow[name]) for name in log})


def only_psi_spread(log: pd.DataFrame) -> pd.DataFrame:
    return log.assign(psi=spread(log)["psi"]).dropna()


def earth(log: pd.DataFrame) -> pd.DataFrame:
    psi = np.radians(log["psi"])
    c, s = np.cos(psi), np.sin(psi)
    return log.assign(u=log["u"] * c - log["v"] * s, v=log["u"] * s + log["v"] * c)


def jumped(log: pd.DataFrame) -> pd.DataFrame:
    return log.assign(N=log["N"] + 120.0 * (log["time"] > 700.0))


def spiked(log: pd.DataFrame) -> pd.DataFrame:
    return log.assign(E=log["E"] + 60.0 * log["time"].between(500.0, 500.5) - 50.0 * log["time"].between(900.0, 900.5))


def late(column: str, seconds: float) -> Change:
    def shift(log: pd.DataFrame) -> pd.DataFrame:
        values = np.interp(log["time"] - seconds, log["time"], np.unwrap(log[column], period=360.0))
        late = log.assign(**{column: values % 360.0 if column == "psi" else values})
        return late[log["time"] > seconds]

    return shift


def antenna(log: pd.DataFrame) -> pd.DataFrame:
    psi = np.radians(log["psi"])
    c, s = np.cos(psi), np.sin(psi)
    return log.assign(N=log["N"] + 12.0 * c - 3.0 * s, E=log["E"] + 12.0 * s + 3.0 * c)


def frozen(log: pd.DataFrame) -> pd.DataFrame:
    rows = np.arange(len(log)) - np.arange(len(log)) % 3
    return log.iloc[rows].reset_index(drop=True).assign(time=log["time"])


def offset(log: pd.DataFrame) -> pd.DataFrame:
    """The compass reads 4 deg low; the velocities over ground come from the GPS and are turned by the compass."""
    turn = np.radians(4.0)
    u, v = log["u"] * np.cos(turn) - log["v"] * np.sin(turn), log["v"] * np.cos(turn) + log["u"] * np.sin(turn)
    return log.assign(psi=(log["psi"] - 4.0) % 360.0, u=u, v=v)


DEFECTS: dict[str, tuple[Change, str, str | None, tuple[object, ...] | None]] = {
    # defect -> how it is put in, the kind that must be named, the column it changes, what is said of that
    "earth": (earth, "earth-fixed velocities", "u", ("u", "m/s", 1, "earth")),
    "rate": (
        lambda f: f.rename(columns={"r": "p"}).assign(r=np.sin(f["time"] / 3)),
        "yaw rate under another name",
        "r",
        ("p", "deg/s", 1, "body"),
    ),
    "rudder": (
        lambda f: f.assign(rudder=-f["rudder"]),
        "wrong sign of rudder",
        "rudder.delta",
        ("rudder", "deg", -1, "body"),
    ),
    "knots": (lambda f: f.assign(u=f["u"] / KNOT, v=f["v"] / KNOT), "knots", "u", ("u", "kn", 1, "body")),
    "km/h": (lambda f: f.assign(u=f["u"] * 3.6, v=f["v"] * 3.6), "speed unit", "u", ("u", "km/h", 1, "body")),
    "slip of knots": (
        lambda f: f.assign(u=(f["u"] / KNOT).round(2) / 1.9834, v=(f["v"] / KNOT).round(2) / 1.9834),
        "factor",
        "u",
        ("u", "m/s", 1, "body"),
    ),
    "factor": (lambda f: f.assign(u=f["u"] * 1.05, v=f["v"] * 1.05), "factor", "u", ("u", "m/s", 1, "body")),
    "psi across 360": (only_psi_spread, "interpolation across 360", "psi", ("psi", "deg", 1, "body")),
    "sign of r": (lambda f: f.assign(r=-f["r"]), "wrong sign of r", "r", ("r", "deg/s", -1, "body")),
    "sign of v": (lambda f: f.assign(v=-f["v"]), "wrong sign of v", "v", ("v", "m/s", -1, "body")),
    "u and v": (lambda f: f.rename(columns={"u": "v", "v": "u"}), "u and v swapped", "u", ("v", "m/s", 1, "body")),
    "N and E": (
        lambda f: f.rename(columns={"N": "E", "E": "N"}),
        "north and east swapped",
        "north",
        ("E", "m", 1, "body"),
    ),
    "heading to port": (
        lambda f: f.assign(psi=(360.0 - f["psi"]) % 360.0),
        "heading counted to port",
        "psi",
        ("psi", "deg", -1, "body"),
    ),
    "unit of r": (lambda f: f.rename(columns={"r": "r [rad/s]"}), "unit of r", "r", ("r [rad/s]", "deg/s", 1, "body")),
    "jump": (jumped, "position jumps", None, None),
    "spikes": (spiked, "position spikes", None, None),
    "late heading": (late("psi", 2.0), "late heading", None, None),
    "late position": (lambda f: late("N", 1.5)(late("E", 1.5)(f)), "late position", None, None),
    "antenna": (antenna, "lever arm", None, None),
    "frozen": (frozen, "frozen rows", None, None),
    "slower": (spread, "interpolated from a slower log", None, None),
    "offset": (offset, "heading offset", None, None),
    "clipped": (
        lambda f: f.assign(rpm=np.minimum(f["rpm"] + 9 * np.sin(f["time"] / 7), 172.0)),
        "clipped",
        None,
        None,
    ),
    "holes": (lambda f: f[~f["time"].between(300.0, 320.0)], "holes in time", None, None),
    "missing": (lambda f: f.assign(v=f["v"].where(~f["time"].between(300.0, 302.0))), "missing values", None, None),
    "jitter": (
        lambda f: f.assign(N=f["N"] + np.random.default_rng(1).normal(0, 4, len(f))),
        "position jitter",
        None,
        None,
    ),
}
BESIDE = {  # what cannot but come with a defect
    "slower": {"interpolation across 360"},
    "frozen": {"position jitter"},
    "heading to port": {"wrong sign of r"},  # against that heading
}


@pytest.mark.parametrize("name", DEFECTS)
def test_a_defect_is_named(name: str, tmp_path: Path) -> None:
    change, kind, column, said = DEFECTS[name]
    found = guessed(change(as_bridge(si_log())), tmp_path)
    assert kind in found.kinds
    assert found.kinds - BESIDE.get(name, set()) == {kind}
    if column is not None:
        assert told(found)[column] == said
    finding = next(entry for entry in found.findings if entry.kind == kind)
    assert 0.2 <= finding.confidence <= 1.0
    assert "\n" not in finding.sentence
