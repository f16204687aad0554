"""Defects put into a clean log are reported with their size; a clean log has none."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pymap3d import ned2geodetic

from shipid.logs.guess import sniff
from shipid.logs.guess.clues import LIKELY
from shipid.logs.guess.columns import Guess, guess
from shipid.logs.guess.defects import LEVELS, _piles_up, lost_fixes
from shipid.logs.guess.draft import draft_mapping, draft_text
from shipid.logs.importing import import_log, read_mapping
from tests.logs.simulated import as_bridge, globe, si_log

CLEAN = as_bridge(si_log()).round(4)


def guessed(folder: Path, frame: pd.DataFrame) -> Guess:
    frame.to_csv(folder / "log.csv", index=False)
    return guess(folder / "log.csv")


def test_a_clean_log_has_no_defect(tmp_path: Path) -> None:
    assert guessed(tmp_path, CLEAN).kinds == set()


def with_course(seed: int) -> pd.DataFrame:
    """A log with speed and course over ground in place of u and v."""
    frame = si_log(seed)
    course = np.degrees(frame["psi"] + np.arctan2(frame["v"], frame["u"])) % 360.0
    bridge = as_bridge(frame).drop(columns=["u", "v"])
    return bridge.assign(SOG=np.hypot(frame["u"], frame["v"]), COG=course).rename(columns={"psi": "HDG"}).round(4)


def said_of_course(found: Guess) -> list[str]:
    return [one.sentence for one in found.questions if "is it the course over ground" in one.sentence]


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("digits", [4, 1, 0])
def test_a_heading_that_is_the_course_is_asked_and_not_taken_for_late(seed: int, digits: int, tmp_path: Path) -> None:
    """v became 0 in every row, and the yaw rate seemed to lead: a latency was drafted."""
    clean = with_course(seed)
    assert said_of_course(guessed(tmp_path, clean)) == []
    found = guessed(tmp_path, clean.assign(HDG=clean["COG"].round(digits)))
    (said,) = said_of_course(found)
    assert re.match(r"'HDG' is 'COG' in (9\d|100) % of the rows in which the ship turns: is it the course", said)
    assert "late heading" not in found.kinds
    assert next(one for one in found.columns if one.name == "psi").confidence < LIKELY


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_course_under_the_name_of_a_heading_is_seen_by_the_yaw_rate_and_the_track(seed: int, tmp_path: Path) -> None:
    clean = with_course(seed)
    found = guessed(tmp_path, clean.assign(HDG=clean["COG"]).drop(columns="COG"))
    (said,) = said_of_course(found)
    assert said.startswith("'HDG' turns later than the yaw rate says, and the track keeps to it in turns: is it")
    assert "late heading" not in found.kinds
    for delay in (0.0, 1.5):
        alone = clean.drop(columns="COG")
        psi = np.degrees(np.unwrap(np.radians(alone["HDG"])))
        moved = np.interp(alone["time"] - delay, alone["time"], psi) % 360.0
        assert said_of_course(guessed(tmp_path, alone.assign(HDG=moved))) == []


def late(frame: pd.DataFrame, columns: list[str], delay: float) -> pd.DataFrame:
    t = frame["time"].to_numpy()
    return frame.assign(**{name: np.interp(t - delay, t, frame[name]) for name in columns})


def moved(frame: pd.DataFrame, x: float, y: float) -> pd.DataFrame:
    c, s = np.cos(np.radians(frame["psi"])), np.sin(np.radians(frame["psi"]))
    return frame.assign(N=frame["N"] + x * c - y * s, E=frame["E"] + x * s + y * c)


def turned(frame: pd.DataFrame, angle: float) -> pd.DataFrame:
    """The heading reads `angle` [deg] low; the velocities are along the wrong heading."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    u, v = c * frame["u"] - s * frame["v"], s * frame["u"] + c * frame["v"]
    return frame.assign(psi=(frame["psi"] - angle) % 360.0, u=u, v=v)


DEFECTS: dict[str, tuple[Callable[[pd.DataFrame], pd.DataFrame], str]] = {
    "frozen rows": (
        lambda frame: frame.assign(
            **{
                name: frame[name].where((frame.index // 20) % 4 != 0).ffill().bfill()
                for name in frame
                if name != "time"
            }
        ),
        r"2\d % of the rows repeat",
    ),
    "holes in time": (lambda frame: frame.drop(range(500, 540)), r"1 steps are more than 3 times"),
    "missing values": (lambda frame: frame.assign(u=frame["u"].where(frame.index % 50 != 7)), r"no value in 'u'"),
    "lever arm": (lambda frame: moved(frame, 9.0, -3.0), r"\+(8\.9|9\.\d) m forward and -(2\.9|3\.\d) m to starboard"),
    "position jumps": (
        lambda frame: frame.assign(E=frame["E"] + np.where(frame["time"] >= 300.0, 80.0, 0.0)),
        r"does not come back: t = 29\d\S* to t = 30\d\S* \((79|80|81) m\)",
    ),
    "position spikes": (
        lambda frame: frame.assign(N=frame["N"] + np.where(frame["time"] == 300.0, 90.0, 0.0)),
        r"comes back near t = 300",
    ),
    "late position": (lambda frame: late(frame, ["N", "E"], 1.5), r"1\.\d s later than the velocity"),
    "heading offset": (lambda frame: turned(frame, 4.0), r"by \+[34]\.\d deg"),
}


@pytest.mark.parametrize("far", [80.0, -660e3])
def test_positions_that_jump_are_reported_without_velocities_too(far: float, tmp_path: Path) -> None:
    """As where the zone of UTM changes, or a receiver starts anew; a clean log has none."""
    for size in (far, 0.0):
        east = CLEAN["E"] + np.where(CLEAN["time"] >= 300.0, size, 0.0)
        findings = {one.kind: one for one in guessed(tmp_path, CLEAN.drop(columns=["u", "v"]).assign(E=east)).findings}
        assert ("position jumps" in findings) == bool(size)
        assert not size or findings["position jumps"].repair is not None


@pytest.mark.parametrize("kind", DEFECTS)
def test_a_defect_is_reported_with_its_size(kind: str, tmp_path: Path) -> None:
    spoil, sentence = DEFECTS[kind]
    result = guessed(tmp_path, spoil(CLEAN))
    findings = {finding.kind: finding for finding in result.findings}
    assert kind in findings, sorted(findings)
    assert re.search(sentence, findings[kind].sentence), findings[kind].sentence


def in_a_current(frame: pd.DataFrame, north: float, east: float) -> pd.DataFrame:
    c, s = np.cos(np.radians(frame["psi"])), np.sin(np.radians(frame["psi"]))
    moved = {"N": frame["N"] + north * frame["time"], "E": frame["E"] + east * frame["time"]}
    return frame.assign(**moved, u=frame["u"] + c * north + s * east, v=frame["v"] + c * east - s * north)


@pytest.mark.parametrize("angle", [-5.0, -3.0, 0.0, 3.0, 5.0, 30.0])
@pytest.mark.parametrize("velocities", [True, False])
def test_a_heading_that_is_off_is_found_in_a_current_and_without_velocities(
    angle: float, velocities: bool, tmp_path: Path
) -> None:
    """Straight runs alone tell a current of 0.7 m/s and 3 deg not apart, and they need velocities."""
    log = turned(in_a_current(CLEAN, -0.4, 0.6), angle)
    log = log if velocities else log.drop(columns=["u", "v"])
    found = [one for one in guessed(tmp_path, log).findings if one.kind == "heading offset"]
    assert len(found) == (angle != 0.0)
    for one in found:
        assert one.repair is not None
        assert np.degrees(one.repair["offset"]) == pytest.approx(angle, abs=0.5)
        assert re.search(r"current of 0\.[67]\d? m/s", one.sentence), one.sentence


def test_a_current_across_one_course_is_no_heading_that_is_off_on_all(tmp_path: Path) -> None:
    t = np.arange(0.0, 900.0, 0.5)
    psi = 0.35 * np.sin(t / 12)
    place = np.cumsum(5.0 * np.exp(1j * psi) + 0.3j) * 0.5
    log = {"time": t, "N": place.real, "E": place.imag, "psi": np.degrees(psi)}
    assert "heading offset" not in guessed(tmp_path, pd.DataFrame(log).round(3)).kinds


@pytest.mark.parametrize("delay", [-2.5, 2.5])
def test_positions_that_are_late_do_not_jump_at_an_end_of_the_log(delay: float, tmp_path: Path) -> None:
    kinds = guessed(tmp_path, late(CLEAN, ["N", "E"], delay).iloc[6:-6]).kinds
    assert kinds == {"late position" if delay > 0 else "late velocity"}


@pytest.mark.parametrize("angle", [-4.0, 0.0, 4.0])
def test_a_heading_along_which_the_velocities_are_not_the_track_is_asked(angle: float, tmp_path: Path) -> None:
    """u and v were measured in the ship, so that they are right; a repair that turns them is none."""
    result = guessed(tmp_path, CLEAN.assign(psi=(CLEAN["psi"] - angle) % 360.0))
    asked = [one.sentence for one in result.questions if "track is turned" in one.sentence]
    assert len(asked) == (angle != 0.0)
    assert "heading offset" not in result.kinds
    for sentence in asked:
        offset = re.search(r"offset = (\S+) \(deg\) for psi", sentence)
        assert offset is not None
        assert float(offset[1]) == pytest.approx(angle, abs=0.3)


@pytest.mark.parametrize("factor", [0.9, 1.0, 10 / 9])
@pytest.mark.parametrize("delay", [0.0, 2.0])
def test_a_yaw_rate_times_a_factor_is_scaled(factor: float, delay: float, tmp_path: Path) -> None:
    """As in gon/s, or of a gyro that is off; a heading that is late has no other factor."""
    unwrapped = CLEAN.assign(psi=np.unwrap(CLEAN["psi"], period=360.0))
    frame = late(unwrapped, ["psi"], delay).assign(r=factor * CLEAN["r"])
    found = [one for one in guessed(tmp_path, frame.assign(psi=frame["psi"] % 360.0)).findings if one.kind == "factor"]
    assert len(found) == (factor != 1.0)
    for one in found:
        assert one.repair is not None
        assert one.repair["columns"] == ["r"]
        assert one.repair["factor"] == pytest.approx(1 / factor, rel=0.01)


def test_a_repair_is_what_would_undo_the_defect(tmp_path: Path) -> None:
    (arm,) = (f for f in guessed(tmp_path, moved(CLEAN, 9.0, -3.0)).findings if f.kind == "lever arm")
    assert arm.repair is not None
    assert (arm.repair["kind"], arm.repair["moves"]) == ("lever_arm", "position")
    assert (arm.repair["x"], arm.repair["y"]) == (pytest.approx(9.0, abs=0.5), pytest.approx(-3.0, abs=0.5))


@pytest.mark.parametrize(("forward", "cut"), [(True, False), (False, True), (True, True)])
def test_a_clock_that_was_set_forward_is_asked(forward: bool, cut: bool, tmp_path: Path) -> None:
    """The ship went on as from row to row, so no time is missing; not where rows are."""
    log = CLEAN.drop(CLEAN.index[500:540]) if cut else CLEAN.copy()
    log.loc[log["time"] >= 270.0, "time"] += 20.0 if forward else 0.0
    asked = [one.sentence for one in guessed(tmp_path, log).questions if "was the clock set forward" in one.sentence]
    assert len(asked) == (forward and not cut)
    assert all("after t = 269.5 comes t = 290" in one for one in asked)


@pytest.mark.parametrize("rows", [1, 5, 40])
def test_a_receiver_that_began_in_1980_is_asked_by_its_dates(rows: int, tmp_path: Path) -> None:
    since = CLEAN["time"] + np.where(np.arange(len(CLEAN)) < rows, 315_964_800.0, 1_715_673_600.0)
    times = [pd.to_datetime(1e9 * since[rows - 1 + k]).strftime("%Y-%m-%d %H:%M:%S") for k in (0, 1)]
    (asked,) = (one.sentence for one in guessed(tmp_path, CLEAN.assign(time=since)).questions if "set" in one.sentence)
    assert f"after {times[0]} comes {times[1]}, but" in asked


@pytest.mark.parametrize("seed", range(3))
def test_a_log_with_drawn_spikes_is_healed_by_its_draft(seed: int, tmp_path: Path) -> None:
    """Imported by its draft, without an edit, it is the clean log imported by the same draft."""
    random = np.random.default_rng(seed)
    spoilt = CLEAN.copy()
    for name, size in (("u", 45.0), ("r", 90.0), ("N", 900.0), ("E", -700.0)):
        rows = random.choice(np.arange(20, len(CLEAN) - 20, 11), 4, replace=False)
        spoilt.loc[rows, name] += size
    (tmp_path / "spoilt").mkdir()
    drafted = guessed(tmp_path / "spoilt", spoilt)
    assert {"spikes", "position spikes"} <= drafted.kinds
    mapping = tmp_path / "draft.toml"
    mapping.write_text(draft_text(drafted).replace("sha256", "# sha256"))
    CLEAN.to_csv(tmp_path / "clean.csv", index=False)
    healed, clean = (import_log(read_mapping(mapping), file).frame for file in (drafted.file, tmp_path / "clean.csv"))
    for name, most in (("u", 0.5), ("v", 0.5), ("r", 0.02), ("north", 6.0), ("east", 6.0)):
        assert (healed[name] - clean[name]).abs().max() < most, name


def test_what_was_not_looked_at_is_no_hole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a large log only samples are read: the clock jumps from one to the next."""
    rows = len(CLEAN.to_csv(index=False))
    monkeypatch.setattr(sniff, "SAMPLE", rows // 2)
    monkeypatch.setattr(sniff, "BLOCK", rows // 30)
    seen = guessed(tmp_path, CLEAN)
    assert "places of" in draft_mapping(seen)
    assert "holes in time" not in seen.kinds
    with_a_hole = CLEAN.drop(CLEAN.index[20:60])  # in the head, which is read
    assert "holes in time" in guessed(tmp_path, with_a_hole).kinds


@pytest.mark.parametrize("every", [1, 2, 5, 20])
def test_a_slower_receiver_that_was_held_is_named(every: int, tmp_path: Path) -> None:
    log = as_bridge(si_log()).round(4)
    place = np.arange(len(log)) // every * every
    log[["N", "E"]] = log[["N", "E"]].to_numpy()[place]
    log[["time", "N", "E", "psi", "r", "rudder", "rpm"]].to_csv(tmp_path / "log.csv", index=False)
    found = [one for one in guess(tmp_path / "log.csv").findings if one.kind == "held positions"]
    assert len(found) == (every > 1)


@pytest.mark.parametrize(("every", "late"), [(25, "0.48"), (100, "2"), (1, "")])
def test_how_late_held_positions_are_does_not_depend_on_the_digits_of_the_heading(
    every: int, late: str, tmp_path: Path
) -> None:
    """At 25 Hz a heading in tenths of a degree repeats, too; positions in decimetres, each for itself, are not held."""
    t = np.arange(0.0, 300.0, 0.04)
    psi = 0.8 * np.sin(t / 25)
    way = np.cumsum(5.0 * np.exp(1j * psi)) * 0.04
    place = way[np.arange(len(t)) // every * every]
    both = (np.round(part, 1 if every == 1 else 4) for part in (place.real, place.imag))
    log = dict(zip(("time", "N", "E"), (np.round(t, 2), *both), strict=True))
    log |= {"psi": np.round(np.degrees(psi), 1), "r [deg/s]": np.round(np.degrees(0.8 / 25 * np.cos(t / 25)), 1)}
    pd.DataFrame(log).to_csv(tmp_path / "log.csv", index=False)
    found = [one.sentence for one in guess(tmp_path / "log.csv").findings if one.kind == "held positions"]
    assert len(found) == (late != "")
    assert all(f"on average {late} s late" in sentence for sentence in found)


def test_a_speed_of_0_far_from_the_others_is_no_speed(tmp_path: Path) -> None:
    """Before, one speed in twenty-five that was 0 was drafted as a factor of 1.04."""
    drawn = np.random.default_rng(0).random(len(CLEAN)) < 0.04
    lost = {name: CLEAN[name].mask(drawn, 0.0) for name in ("u",)}
    proposal = guessed(tmp_path, CLEAN.assign(**lost))
    assert proposal.kinds == {"spikes"}
    (tmp_path / "draft.toml").write_text(draft_mapping(proposal))
    mapping = read_mapping(tmp_path / "draft.toml").model_copy(update={"segment": ()})
    assert import_log(mapping, tmp_path / "log.csv").frame["u"].to_numpy() == pytest.approx(CLEAN["u"], abs=0.1)


@pytest.mark.parametrize("earth", [False, True])
def test_a_heading_is_mended_before_velocities_over_ground_are_turned_by_it(earth: bool, tmp_path: Path) -> None:
    """Before, u and v of these rows stayed those of the wrong heading."""
    psi = np.radians(CLEAN["psi"])
    ground = (CLEAN["u"] + 1j * CLEAN["v"]) * np.exp(1j * psi)
    spiky = CLEAN["psi"].where(CLEAN.index % 200 != 150, (CLEAN["psi"] + 70) % 360)
    both = {"V north": ground.to_numpy().real, "V east": ground.to_numpy().imag}
    if not earth:
        both = {"SOG [m/s]": np.abs(ground), "COG [deg]": np.degrees(np.angle(ground)) % 360}
    proposal = guessed(tmp_path, CLEAN.drop(columns=["u", "v"]).assign(psi=spiky, **both))
    assert "spikes" in proposal.kinds
    (tmp_path / "draft.toml").write_text(draft_mapping(proposal))
    mapping = read_mapping(tmp_path / "draft.toml").model_copy(update={"segment": ()})
    rows = import_log(mapping, tmp_path / "log.csv").frame
    assert rows["v"].to_numpy() == pytest.approx(CLEAN["v"], abs=0.1)


def test_a_heading_of_0_far_from_the_others_breaks_the_log(tmp_path: Path) -> None:
    far = int(np.argmax((CLEAN["psi"] > 120) & (CLEAN["psi"] < 200)))
    frame = CLEAN.assign(psi=CLEAN["psi"].mask(np.isin(CLEAN.index, range(far, far + 10)), 0.0))
    found = next(one for one in guessed(tmp_path, frame).findings if one.kind == "zeros")
    assert found.repair == {"kind": "break", "intervals": [[CLEAN["time"][far - 1], CLEAN["time"][far + 10]]]}


@pytest.mark.parametrize("rows", [slice(0, 30), slice(600, 640), slice(-20, None)], ids=["begin", "middle", "end"])
def test_positions_of_0_north_0_east_are_no_fix(rows: slice, tmp_path: Path) -> None:
    """Before, heading, yaw rate and rudder were drafted to port, and the shaft in other units."""
    log = si_log()
    lat, lon, _ = ned2geodetic(log["north"], log["east"], 0.0, 63.44, 10.40, 0.0)
    frame = CLEAN.drop(columns=["N", "E"]).assign(lat=lat.round(7), lon=lon.round(7))
    frame.loc[frame.index[rows], ["lat", "lon"]] = 0.0
    proposal = guessed(tmp_path, frame)
    assert proposal.kinds == {"no fix"}
    (tmp_path / "draft.toml").write_text(draft_mapping(proposal))
    whole = read_mapping(tmp_path / "draft.toml").model_copy(update={"segment": ()})
    dataset = import_log(whole, tmp_path / "log.csv").frame
    kept = log["t"].isin(dataset["t"]).to_numpy()
    assert kept.sum() == len(log) - len(frame.index[rows])
    for name in ("north", "east"):
        off = dataset[name].to_numpy() - log[name].to_numpy()[kept]
        assert np.ptp(off) < 1.0, "centimetres of rounding, and a plane that touches the Earth elsewhere"


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("where", [{"Lat": [300]}, {"Lon": [300, 1500]}, {"Lat": [300], "Lon": [304, 1500]}])
def test_one_coordinate_of_0_is_no_fix(where: dict[str, list[int]], seed: int, tmp_path: Path) -> None:
    """Before, five rows in which the latitude alone is 0 turned the heading into radians, and mirrored all the rest."""
    clean = globe(seed)
    frame = clean.copy()
    for name, places in where.items():
        for place in places:
            frame.loc[place : place + 4, name] = 0.0
    expected, proposal = guessed(tmp_path, clean), guessed(tmp_path, frame)
    assert "no fix" not in expected.kinds
    drafted = [(one.name, one.source, one.unit, one.extra) for one in proposal.columns]
    assert drafted == [(one.name, one.source, one.unit, one.extra) for one in expected.columns]
    assert proposal.kinds == expected.kinds | {"no fix"}
    sentence = next(one.sentence for one in proposal.findings if one.kind == "no fix")
    assert all(f"{name!r} is 0" in sentence for name in where)
    (tmp_path / "draft.toml").write_text(draft_mapping(proposal))
    whole = read_mapping(tmp_path / "draft.toml").model_copy(update={"segment": ()})
    dataset = import_log(whole, tmp_path / "log.csv").frame
    log = si_log(seed)
    kept = log["t"].isin(dataset["t"]).to_numpy()
    assert 5 <= np.sum(~kept) <= 15
    for name in ("north", "east"):
        assert np.ptp(dataset[name].to_numpy() - log[name].to_numpy()[kept]) < 1.0


def test_a_compass_that_goes_to_359_is_in_degrees_whatever_the_positions_do(tmp_path: Path) -> None:
    frame = globe(0)
    frame.loc[300:304, "Lat"] = 12.0
    heading = guessed(tmp_path, frame).column("psi")
    assert heading is not None
    assert (heading.source, heading.unit) == ("HDG", "deg")


@pytest.mark.parametrize(
    ("name", "value"), [("Lat", 91.0), ("Lat", 99.0), ("Lon", 181.0), ("Lat", -9999.0), ("Lon", 999.0)]
)
def test_a_coordinate_that_no_place_has_is_a_missing_value(name: str, value: float, tmp_path: Path) -> None:
    frame = globe(0)
    frame.loc[300:304, name] = value
    proposal = guessed(tmp_path, frame)
    assert proposal.kinds == {"missing values"}
    assert {("latitude", "Lat"), ("longitude", "Lon")} <= {(one.name, one.source) for one in proposal.columns}


@pytest.mark.parametrize(("value", "lost"), [(0.0, True), (180.0, True), (12.0, False)])
def test_a_coordinate_that_a_receiver_writes_is_lost_where_it_is_far_away(value: float, lost: bool) -> None:
    values = 10.0 + 1e-5 * np.arange(100.0)
    values[40:45] = value
    assert list(np.flatnonzero(lost_fixes(values))) == (list(range(40, 45)) if lost else [])
    across = 1e-4 * (np.arange(100.0) - 50.0)
    assert not lost_fixes(across).any(), "the ship crosses the meridian"


@pytest.mark.parametrize("count", [LEVELS - 6, LEVELS + 6])
def test_a_signal_of_few_levels_is_not_clipped(count: int) -> None:
    """A speed logged to 0.1 m/s rests at its largest value; the fewest levels were those of a shaft, by one name."""
    rng = np.random.default_rng(0)
    rise = [np.round(np.linspace(3.0, 3.0 + 0.1 * (count - 2), 6 * count) + rng.normal(0, 0.02, 6 * count), 1)] * 8
    values = np.concatenate([np.concatenate([part, np.full(5 * count, part.max() + 0.1)]) for part in rise])
    assert abs(len(np.unique(values)) - count) <= 2
    assert _piles_up(values, float(values.max())) == (count > LEVELS)
