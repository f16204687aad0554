"""What was put into a log is named, and nothing else; every documented trap of the recorded sets is detected."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.logs.guess.clues import LIKELY
from shipid.logs.guess.columns import Guess, guess
from tests.drawn import seeds
from tests.logs.simulated import KNOT, as_bridge, guess_of, si_log


def described(proposal: Guess) -> dict[str, tuple[str, str, int, str]]:
    """Column of the dataset -> source, unit, sign, frame."""
    return {c.name: (c.source, c.unit, c.extra.get("sign", 1), c.extra.get("frame", "body")) for c in proposal.columns}


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


@pytest.mark.parametrize(("seed", "every"), [(0, 5), (3, 20)])
def test_a_clean_log_has_no_defect(seed: int, every: int, tmp_path: Path) -> None:
    proposal = guess_of(tmp_path, as_bridge(si_log(seed, every)).round(4))
    assert proposal.findings == ()
    assert described(proposal) == CLEAN
    assert all(column.confidence > 0.8 and column.evidence for column in proposal.columns)


@pytest.mark.parametrize(("name", "asked"), [("time", 0), ("Elapsed [s]", 0), ("distance", 1)])
def test_a_column_that_only_rises_is_asked_for(name: str, asked: int, tmp_path: Path) -> None:
    proposal = guess_of(tmp_path, as_bridge(si_log(0, 5)).round(4).rename(columns={"time": name}))
    said = [question.sentence for question in proposal.questions if "clock" in question.about]
    assert said == ["no column is called a clock: 'distance' rises from row to row. Is it the time?"] * asked


@pytest.mark.parametrize("along", [True])
def test_velocities_through_the_water_are_named_with_the_current(along: bool, tmp_path: Path) -> None:
    """u and v of a Doppler log, or its speed beside the course of the receiver, in a current."""
    log = as_bridge(si_log(0, 5))
    stream = 0.3 * float(np.median(log["u"])) * np.exp(1j * np.radians(200.0))
    drifted = log.assign(N=log["N"] + stream.real * log["time"], E=log["E"] + stream.imag * log["time"])
    if along:
        ground = (log["u"] + 1j * log["v"]) * np.exp(1j * np.radians(log["psi"])) + stream
        course = np.degrees(np.angle(ground)) % 360.0
        drifted = drifted.drop(columns=["u", "v"]).assign(speed=np.hypot(log["u"], log["v"]), cog=course)
    proposal = guess_of(tmp_path, drifted.round(4))
    (found,) = [finding for finding in proposal.findings if finding.kind == "speed through water"]
    sizes = re.search(r"velocity through water = (\S+) \[.*?\], (\S+) \[", found.sentence)
    assert sizes
    assert complex(float(sizes[1]), float(sizes[2])) == pytest.approx(stream, rel=0.15)


def test_gunnerus(gunnerus_log: Path) -> None:
    """Every trap of the description that a log can betray: places as it gives them, sizes within the scatter."""
    proposal = guess(gunnerus_log)
    columns = described(proposal)
    assert columns["psi"] == ("psi", "deg", 1, "body")
    assert columns["u"] == ("u", "m/s", 1, "body")
    assert columns["r"] == ("r", "deg/s", 1, "body")
    assert columns["thruster.alpha"] == ("Azi", "deg", 1, "body")  # positive turns to port
    findings = {finding.kind: finding for finding in proposal.findings}
    assert set(findings) == {
        "interpolation across 360",
        "position jumps",
    }
    assert findings["interpolation across 360"].sentence.startswith("77 steps")
    repairs = {kind: finding.repair or {} for kind, finding in findings.items()}
    inside = repairs["position jumps"]["intervals"]
    assert [[start <= at <= end for start, end in inside] for at in (2699.0, 4213.5)] == [[True, False], [False, True]]


WITH_UNITS = list(
    zip(
        ["time", "N", "E", "psi", "u", "v", "r", "rpm", "rudder"],
        ["s", "m", "m", "deg", "m/s", "m/s", "deg/s", "rpm", "deg"],
        strict=True,
    )
)
WRITTEN: dict[str, tuple[Callable[[pd.DataFrame, Path], object], dict[str, object]]] = {
    "tabs": (lambda f, p: f.to_csv(p, sep="\t", index=False), {"separator": "\t"}),
    "semicolons, commas": (
        lambda f, p: f.to_csv(p, sep=";", decimal=",", index=False),
        {"separator": ";", "decimal": ","},
    ),
    "blanks": (lambda f, p: p.write_text(f.to_string(index=False)), {"separator": "whitespace"}),
    "utf-16": (lambda f, p: f.to_csv(p, index=False, encoding="utf-16"), {"encoding": "utf-16"}),
    "cp1252 above": (
        lambda f, p: p.write_bytes("Kurs in °\nFähre\n".encode("cp1252") + f.to_csv(index=False).encode()),
        {"encoding": "cp1252", "skip_rows": 2},
    ),
    "units below the names": (
        lambda f, p: p.write_text(f.to_csv(index=False).replace("\n", "\ns,m,m,deg,m/s,m/s,deg/s,rpm,deg\n", 1)),
        {"skip_rows": 2, "names": [f"{name} [{unit}]" for name, unit in WITH_UNITS]},
    ),
    "parquet": (lambda f, p: f.to_parquet(p), {"kind": "parquet"}),
    "numbers of rows": (lambda f, p: f.to_csv(p), {"separator": ","}),
    "dates": (
        lambda f, p: f.assign(time=pd.Timestamp("2022-10-27") + pd.to_timedelta(f["time"], "s")).to_csv(p, index=False),
        {"separator": ","},
    ),
}


@pytest.mark.parametrize("name", [*WRITTEN][::2])
def test_how_it_is_written(name: str, tmp_path: Path) -> None:
    write, form = WRITTEN[name]
    write(as_bridge(si_log()).iloc[:1200], tmp_path / "log.csv")
    proposal = guess(tmp_path / "log.csv")
    assert {key: proposal.sniffed.form[key] for key in form} == form
    columns = {column: (source.partition(" [")[0], *rest) for column, (source, *rest) in described(proposal).items()}
    assert columns == CLEAN
    assert proposal.findings == ()


def test_position_on_the_earth_with_speed_and_course(tmp_path: Path) -> None:
    log = as_bridge(si_log())
    course = np.degrees(np.arctan2(si_log()["v"], si_log()["u"])) + log["psi"]
    globe = pd.DataFrame(
        {
            "time": log["time"],
            "lat": 63.4 + log["N"] / 111_400.0,
            "lon": 10.4 + log["E"] / 111_400.0 / np.cos(np.radians(63.4)),
            "sog_kn": np.hypot(log["u"], log["v"]) / KNOT,
            "cog": course % 360.0,
            "heading": log["psi"],
            "rot": log["r"] * 60.0,
        }
    )
    columns = {name: entry[:2] for name, entry in described(guess_of(tmp_path, globe)).items()}
    assert columns == {
        "latitude": ("lat", "deg"),
        "longitude": ("lon", "deg"),
        "psi": ("heading", "deg"),
        "speed": ("sog_kn", "kn"),
        "course": ("cog", "deg"),
        "r": ("rot", "deg/min"),
    }


@pytest.mark.parametrize(
    ("names", "taken", "relative"),
    [
        (("AWS", "AWA"), ("AWS", "AWA"), True),
        (("AWS", "AWA", "TWS", "TWD"), ("TWS", "TWD"), None),
        (("Wind speed", "Wind true from [deg]"), ("Wind speed", "Wind true from [deg]"), None),
        (("TWS", "TWA"), ("TWS", "TWA"), "angle"),
    ],
)
def test_names_say_which_wind(
    names: tuple[str, ...], taken: tuple[str, str], relative: bool | str | None, tmp_path: Path
) -> None:
    log = as_bridge(si_log())
    wind = {name: np.random.default_rng(i).uniform(3.0, 8.0, len(log)) for i, name in enumerate(names)}
    proposed = {column.name: column for column in guess_of(tmp_path, log.assign(**wind)).columns}
    assert (proposed["V_w"].source, proposed["beta_w"].source) == taken
    assert proposed["beta_w"].extra.get("relative") is relative
    silent = not any(word in " ".join(taken) for word in ("AW", "Apparent", "rel", "true", "TWS"))
    assert ("does not show" in proposed["V_w"].evidence) is silent


def test_a_shaft_without_a_unit_among_radians_may_count_radians(tmp_path: Path) -> None:
    """As Simulink writes it: before, 17.8 rad/s were 17.8 rev/s without a question."""
    log = si_log()[["t", "north", "east", "psi", "u", "v", "r"]].assign(n=2 * np.pi * as_bridge(si_log())["rpm"] / 60)
    proposal = guess_of(tmp_path, log)
    shaft = proposal.column("propeller.n")
    assert shaft is not None
    assert shaft.confidence < LIKELY
    assert any("rev/s, or rad/s" in question.sentence for question in proposal.questions)
    degrees = guess_of(tmp_path, log.assign(psi=np.degrees(log["psi"])))
    assert not any("rad/s" in question.sentence for question in degrees.questions)


def test_numbers_of_rows_are_no_quantity_though_some_are_lost(tmp_path: Path) -> None:
    """A robot counts its messages: some do not arrive, and a new recording begins anew."""
    log = as_bridge(si_log(0, 5)).round(4)
    count = np.arange(len(log)) + 77 * (np.arange(len(log)) > 500)
    count[-300:] = np.arange(300)
    found = guess_of(tmp_path, log.assign(seq=count, odd=3 * count, half=count // 2))
    assert [name for name, why in found.unused.items() if why == "it holds the numbers of the rows"] == ["seq"]


def test_a_clock_of_two_columns_is_said_by_their_names(tmp_path: Path) -> None:
    log = as_bridge(si_log(0, 5)).round(4).drop(index=range(800, 900))
    seconds = 1_700_000_000.0 + log.pop("time").to_numpy()
    whole = np.floor(seconds)
    found = guess_of(tmp_path, log.assign(secs=whole, nsecs=np.round(1e9 * (seconds - whole))))
    (hole,) = (one for one in found.findings if one.kind == "holes in time")
    assert hole.columns == ("secs", "nsecs")
    assert not [one for one in found.questions if "clock" in one.about]


@pytest.mark.parametrize(
    ("names", "asked"),
    [
        (("giring [deg/min]", "langs_kn", "tvers_kn"), ()),
        (("col7", "col8", "col9"), ()),
        (("giring", "langs", "tvers"), ("r", "u")),
        (("heave", "roll", "pitch"), ("r", "u", "v")),
    ],
)
def test_the_motion_is_read_whatever_the_word(names: tuple[str, ...], asked: tuple[str, ...], tmp_path: Path) -> None:
    """A yaw rate called `giring`, and velocities in knots called `langs` and `tvers`, were left out."""
    log = si_log(5)
    values = np.degrees(log["r"]) * 60.0, log["u"] / KNOT, log["v"] / KNOT
    frame = as_bridge(log).drop(columns=["u", "v", "r"]).assign(**dict(zip(names, values, strict=True)))
    proposal = guess_of(tmp_path, frame)
    read = {one.name: (one.source, one.unit) for one in proposal.columns if one.name in ("r", "u", "v")}
    assert read == dict(zip(("r", "u", "v"), zip(names, ("deg/min", "kn", "kn"), strict=True), strict=True))
    doubted = [one.about for one in proposal.questions if "By its name it is another quantity" in one.sentence]
    assert sorted(doubted) == sorted((name,) for name in asked)


@pytest.mark.parametrize("seed", seeds(2, 12))
def test_speed_course_and_commands_are_read_in_a_language_that_is_not_known(seed: int, tmp_path: Path) -> None:
    """In a log of Polish names speed, course and the second rudder were left out without a word."""
    draw, log = np.random.default_rng(seed), si_log(seed)
    words = ["".join(draw.choice(list("bcdghjkqvwxz"), 8)) for _ in range(6)]
    rudders, shafts = ([f"{words[k]} {side}" for side in words[4:]] for k in (2, 3))
    ground = (log["u"] + 1j * log["v"]).to_numpy() * np.exp(1j * log["psi"].to_numpy())
    frame = as_bridge(log).drop(columns=["u", "v", "rpm", "rudder"])
    frame[words[0]], frame[words[1]] = np.abs(ground) / KNOT, np.degrees(np.angle(ground)) % 360.0
    frame = frame.assign(**dict.fromkeys(rudders, np.degrees(log["alpha"])), **dict.fromkeys(shafts, 60.0 * log["n"]))
    proposal = guess_of(tmp_path, frame.round(4))
    read = {one.name: (one.source, one.unit) for one in proposal.columns}
    assert (read["speed"], read["course"]) == ((words[0], "kn"), (words[1], "deg"))
    assert [one.source for one in proposal.columns if one.name.endswith(".delta")] == rudders
    asked = " ".join(one.sentence for one in proposal.questions if {"n", "speed"} & {*one.about})
    assert all(repr(name) in asked for name in (*shafts, *words[:2]))
