"""Defects put into a clean log are reported with their size; a clean log has none."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.logs.guess import sniff
from shipid.logs.guess.columns import Guess
from shipid.logs.guess.draft import draft_mapping, draft_text
from tests.logs.conftest import import_written
from tests.logs.simulated import as_bridge, globe, guess_of, import_draft, si_log

CLEAN = as_bridge(si_log()).round(4)


def with_course(seed: int) -> pd.DataFrame:
    """A log with speed and course over ground in place of u and v."""
    frame = si_log(seed)
    course = np.degrees(frame["psi"] + np.arctan2(frame["v"], frame["u"])) % 360.0
    bridge = as_bridge(frame).drop(columns=["u", "v"])
    return bridge.assign(SOG=np.hypot(frame["u"], frame["v"]), COG=course).rename(columns={"psi": "HDG"}).round(4)


def said_of_course(found: Guess) -> list[str]:
    return [one.sentence for one in found.questions if "is the heading the course over ground" in one.sentence]


@pytest.mark.parametrize("digits", [4, 0])
def test_a_heading_that_is_the_course_is_asked_and_not_taken_for_late(digits: int, tmp_path: Path) -> None:
    """v became 0 in every row, and the yaw rate seemed to lead: a latency was drafted."""
    clean = with_course(1)
    assert said_of_course(guess_of(tmp_path, clean)) == []
    found = guess_of(tmp_path, clean.assign(HDG=clean["COG"].round(digits)))
    assert len(said_of_course(found)) == 1
    assert "delay" not in found.kinds


def late(frame: pd.DataFrame, columns: list[str], delay: float) -> pd.DataFrame:
    t = frame["time"].to_numpy()
    return frame.assign(**{name: np.interp(t - delay, t, frame[name]) for name in columns})


def moved(frame: pd.DataFrame, x: float, y: float) -> pd.DataFrame:
    c, s = np.cos(np.radians(frame["psi"])), np.sin(np.radians(frame["psi"]))
    return frame.assign(N=frame["N"] + x * c - y * s, E=frame["E"] + x * s + y * c)


DEFECTS: dict[str, tuple[Callable[[pd.DataFrame], pd.DataFrame], str]] = {
    "holes in time": (lambda frame: frame.drop(range(500, 540)), r"1 steps are more than 3 times"),
    "missing values": (lambda frame: frame.assign(u=frame["u"].where(frame.index % 50 != 7)), r"no value in 'u'"),
    "lever arm": (
        lambda frame: moved(frame, 9.0, -3.0),
        r"lever arm position = (8\.9|9)\S* \[.*\], -(2\.9|3)\S* \[.*\] m ",
    ),
    "position jumps": (
        lambda frame: frame.assign(E=frame["E"] + np.where(frame["time"] >= 300.0, 80.0, 0.0)),
        r"by up to (79|80|81) m and does not come back in \d rows? at 1 place, near t = (29|30)\d",
    ),
    "position spikes": (
        lambda frame: frame.assign(N=frame["N"] + np.where(frame["time"] == 300.0, 90.0, 0.0)),
        r"comes back in 1 row at 1 place, near t = 300",
    ),
    "delay": (lambda frame: late(frame, ["N", "E"], 1.5), r"sensor position delay = 1\.[45]\S* \[.*\] s "),
}


@pytest.mark.parametrize("kind", DEFECTS)
def test_a_defect_is_reported_with_its_size(kind: str, tmp_path: Path) -> None:
    spoil, sentence = DEFECTS[kind]
    result = guess_of(tmp_path, spoil(CLEAN))
    findings = {finding.kind: finding for finding in result.findings}
    assert kind in findings, sorted(findings)
    assert re.search(sentence, findings[kind].sentence), findings[kind].sentence


@pytest.mark.parametrize("delay", [-2.5, 2.5])
def test_positions_that_are_late_do_not_jump_at_an_end_of_the_log(delay: float, tmp_path: Path) -> None:
    found = guess_of(tmp_path, late(CLEAN, ["N", "E"], delay).iloc[6:-6])
    assert found.kinds == {"delay"}
    (repair,) = (one.repair or {} for one in found.findings)
    assert repair["signal"] == ("position" if delay > 0 else "velocity")
    assert repair["seconds"] == pytest.approx(abs(delay), abs=0.3)


def read_otherwise(kind: str, angle: float) -> pd.DataFrame:
    """A log whose heading, course, or north of velocities is low by an angle [deg]."""
    if kind == "psi":
        return CLEAN.assign(psi=(CLEAN["psi"] - angle) % 360.0)
    course = with_course(1)
    way = (course["COG"] - angle) % 360.0
    if kind == "course":
        return course.assign(COG=way)
    north, east = (course["SOG"] * along(np.radians(way)) for along in (np.cos, np.sin))
    return course.drop(columns=["SOG", "COG"]).assign(v_north=north, v_east=east)


@pytest.mark.parametrize("angle", [0.2, 1.0, -8.0])
@pytest.mark.parametrize("kind", ["psi", "course", "earth"])
def test_velocities_that_are_not_along_the_track_are_asked(kind: str, angle: float, tmp_path: Path) -> None:
    """As by the north of a map or a compass: no factor of the speed, which its cosine looked like, and no repair."""
    result = guess_of(tmp_path, read_otherwise(kind, angle))
    asked = [one.sentence for one in result.questions if "the track is turned" in one.sentence]
    assert len(asked) == (abs(angle) >= 1.0)
    assert "factor" not in result.kinds
    for sentence in asked:
        assert re.search(rf"turned by {re.escape(f'{angle:+.1f}')} \+- 0\.\d deg against", sentence), sentence
        offset = re.search(rf"offset = (\S+) \(deg\) for {kind}", sentence)
        assert kind == "earth" or (offset and float(offset[1]) == pytest.approx(angle, abs=0.1)), sentence


@pytest.mark.parametrize(("factor", "delay"), [(0.9, 0.0), (1.0, 2.0), (10 / 9, 2.0)])
def test_a_yaw_rate_times_a_factor_is_scaled(factor: float, delay: float, tmp_path: Path) -> None:
    """As in gon/s, or of a gyro that is off; a heading that is late has no other factor."""
    unwrapped = CLEAN.assign(psi=np.unwrap(CLEAN["psi"], period=360.0))
    frame = late(unwrapped, ["psi"], delay).assign(r=factor * CLEAN["r"])
    found = [one for one in guess_of(tmp_path, frame.assign(psi=frame["psi"] % 360.0)).findings if one.kind == "factor"]
    assert len(found) == (factor != 1.0)
    for one in found:
        assert one.repair is not None
        assert one.repair["columns"] == ["r"]
        assert one.repair["factor"] == pytest.approx(1 / factor, rel=0.01)


def test_a_repair_is_what_would_undo_the_defect(tmp_path: Path) -> None:
    (arm,) = (f for f in guess_of(tmp_path, moved(CLEAN, 9.0, -3.0)).findings if f.kind == "lever arm")
    assert arm.repair is not None
    assert (arm.repair["kind"], arm.repair["moves"]) == ("lever_arm", "position")
    assert (arm.repair["x"], arm.repair["y"]) == (pytest.approx(9.0, abs=0.5), pytest.approx(-3.0, abs=0.5))


def test_a_log_with_drawn_spikes_is_healed_by_its_draft(tmp_path: Path) -> None:
    """Imported by its draft, without an edit, it is the clean log imported by the same draft."""
    random = np.random.default_rng(0)
    spoilt = CLEAN.copy()
    for name, size in (("u", 45.0), ("r", 90.0), ("N", 900.0), ("E", -700.0)):
        rows = random.choice(np.arange(20, len(CLEAN) - 20, 11), 4, replace=False)
        spoilt.loc[rows, name] += size
    drafted = guess_of(tmp_path, spoilt)
    assert {"spikes", "position spikes"} <= drafted.kinds
    mapping = draft_text(drafted).replace("sha256", "# sha256")
    healed, clean = (import_written(mapping, log, tmp_path).frame for log in (spoilt, CLEAN))
    for name, most in (("u", 0.5), ("v", 0.5), ("r", 0.02), ("north", 6.0), ("east", 6.0)):
        assert (healed[name] - clean[name]).abs().max() < most, name


def test_what_was_not_looked_at_is_no_hole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a large log only samples are read: the clock jumps from one to the next."""
    rows = len(CLEAN.to_csv(index=False))
    monkeypatch.setattr(sniff, "SAMPLE", rows // 2)
    monkeypatch.setattr(sniff, "BLOCK", rows // 30)
    seen = guess_of(tmp_path, CLEAN)
    assert "places of" in draft_mapping(seen)
    assert "holes in time" not in seen.kinds
    with_a_hole = CLEAN.drop(CLEAN.index[20:60])  # in the head, which is read
    assert "holes in time" in guess_of(tmp_path, with_a_hole).kinds


@pytest.mark.parametrize("nothing", [0.0, -1.0])
def test_a_speed_of_0_far_from_the_others_is_no_speed(nothing: float, tmp_path: Path) -> None:
    """Before, one speed in twenty-five that was 0 was drafted as a factor of 1.04."""
    drawn = np.random.default_rng(0).random(len(CLEAN)) < 0.04
    lost = {name: CLEAN[name].mask(drawn, nothing) for name in ("u",)}
    proposal = guess_of(tmp_path, CLEAN.assign(**lost))
    assert proposal.kinds == {"spikes"}
    assert import_draft(tmp_path, proposal).frame["u"].to_numpy() == pytest.approx(CLEAN["u"], abs=0.1)


@pytest.mark.parametrize("where", [{"Lat": [300]}, {"Lat": [300], "Lon": [304, 1500]}])
def test_one_coordinate_of_0_is_no_fix(where: dict[str, list[int]], tmp_path: Path) -> None:
    """Before, five rows in which the latitude alone is 0 turned the heading into radians, and mirrored all the rest."""
    clean = globe(0)
    frame = clean.copy()
    for name, places in where.items():
        for place in places:
            frame.loc[place : place + 4, name] = 0.0
    expected, proposal = guess_of(tmp_path, clean), guess_of(tmp_path, frame)
    assert "no fix" not in expected.kinds
    drafted = [(one.name, one.source, one.unit, one.extra) for one in proposal.columns]
    assert drafted == [(one.name, one.source, one.unit, one.extra) for one in expected.columns]
    assert proposal.kinds == expected.kinds | {"no fix"}
    sentences = [one.sentence for one in proposal.findings if one.kind == "no fix"]
    assert [sentence.partition(" is 0 ")[0] for sentence in sentences] == [repr(name) for name in where]
    dataset = import_draft(tmp_path, proposal).frame
    log = si_log(0)
    kept = log["t"].isin(dataset["t"]).to_numpy()
    assert 5 <= np.sum(~kept) <= 15
    for name in ("north", "east"):
        assert np.ptp(dataset[name].to_numpy() - log[name].to_numpy()[kept]) < 1.0


@pytest.mark.parametrize(("name", "value"), [("Lat", 91.0), ("Lon", 181.0)])
def test_a_coordinate_that_no_place_has_is_a_missing_value(name: str, value: float, tmp_path: Path) -> None:
    frame = globe(0)
    frame.loc[300:304, name] = value
    proposal = guess_of(tmp_path, frame)
    assert proposal.kinds == {"missing values"}
    assert {("latitude", "Lat"), ("longitude", "Lon")} <= {(one.name, one.source) for one in proposal.columns}
