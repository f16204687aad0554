"""What was put into a log is named, and nothing else; every documented trap of the recorded sets is detected."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.logs.guess.clues import LIKELY, unit_in_name
from shipid.logs.guess.columns import Guess, guess
from tests.logs.simulated import KNOT, Change, as_bridge, si_log


def guessed(log: pd.DataFrame, folder: Path) -> Guess:
    log.to_csv(folder / "log.csv", index=False)
    return guess(folder / "log.csv")


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


@pytest.mark.parametrize(("seed", "every"), [(0, 1), (0, 5), (1, 5), (2, 10), (3, 20)])
def test_a_clean_log_has_no_defect(seed: int, every: int, tmp_path: Path) -> None:
    proposal = guessed(as_bridge(si_log(seed, every)).round(4), tmp_path)
    assert proposal.findings == ()
    assert described(proposal) == CLEAN
    assert all(column.confidence > 0.8 and column.evidence for column in proposal.columns)


@pytest.mark.parametrize(("name", "asked"), [("time", 0), ("Elapsed [s]", 0), ("distance", 1)])
def test_a_column_that_only_rises_is_asked_for(name: str, asked: int, tmp_path: Path) -> None:
    proposal = guessed(as_bridge(si_log(0, 5)).round(4).rename(columns={"time": name}), tmp_path)
    said = [question.sentence for question in proposal.questions if "clock" in question.about]
    assert said == ["no column is called a clock: 'distance' rises from row to row. Is it the time?"] * asked


@pytest.mark.parametrize("along", [False, True])
def test_velocities_through_the_water_are_no_jitter_of_the_positions(along: bool, tmp_path: Path) -> None:
    """u and v of a Doppler log, or its speed beside the course of the receiver, in a current."""
    log = as_bridge(si_log(0, 5))
    stream = 0.3 * float(np.median(log["u"])) * np.exp(1j * np.radians(200.0))
    drifted = log.assign(N=log["N"] + stream.real * log["time"], E=log["E"] + stream.imag * log["time"])
    if along:
        ground = (log["u"] + 1j * log["v"]) * np.exp(1j * np.radians(log["psi"])) + stream
        course = np.degrees(np.angle(ground)) % 360.0
        drifted = drifted.drop(columns=["u", "v"]).assign(speed=np.hypot(log["u"], log["v"]), cog=course)
    proposal = guessed(drifted.round(4), tmp_path)
    (found,) = [finding for finding in proposal.findings if finding.kind == "speed through water"]
    assert f"a current of {abs(stream):.2g} m/s towards" in found.sentence
    assert 190.0 < float(found.sentence.split("towards ")[1].split(" deg")[0]) < 210.0
    assert "position jitter" not in proposal.kinds


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
    # defect -> how it is put in, the kind that must be named, the column it changes, what it then is
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
    "azimuth": (  # > 0 to starboard here; a unit aft turns the ship to port
        lambda f: f.rename(columns={"rudder": "azimuth"}),
        "wrong sign of rudder",
        "thruster.alpha",
        ("azimuth", "deg", -1, "body"),
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
    change, kind, column, expected = DEFECTS[name]
    proposal = guessed(change(as_bridge(si_log())), tmp_path)
    assert kind in proposal.kinds
    assert proposal.kinds - BESIDE.get(name, set()) == {kind}
    if column is not None:
        assert described(proposal)[column] == expected
    finding = next(entry for entry in proposal.findings if entry.kind == kind)
    assert 0.2 <= finding.confidence <= 1.0
    assert "\n" not in finding.sentence


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
        "factor",
        "interpolated from a slower log",
        "clipped",  # at 205 rpm
        "position jumps",
        "position jitter",
        "heading offset",
    }
    assert findings["interpolation across 360"].sentence.startswith("77 steps")
    repairs = {kind: finding.repair or {} for kind, finding in findings.items()}
    assert repairs["factor"]["factor"] == 1.0204  # 1.9834 / 1.9438
    assert repairs["heading offset"]["offset"] == pytest.approx(0.040, abs=0.01)
    inside = repairs["position jumps"]["intervals"]
    assert [[start <= at <= end for start, end in inside] for at in (2699.0, 4213.5)] == [[True, False], [False, True]]


HSVA = "time,x0,y0,psi,u,v,p,r,delta,rev,thrust,torque"
RUNS = [
    "05_01",
    "10_01",
    "10_05",
    "10_10_P",
    "10_10_S",
    "15_01",
    "15_05",
    "20_05",
    "20_10_P",
    "20_10_S",
    "25_05",
    "30_05",
    "35_05",
]


@pytest.mark.slow
@pytest.mark.parametrize(
    "run", [*RUNS[::3], *(pytest.param(run, marks=pytest.mark.slow) for run in RUNS if run not in RUNS[::3])]
)
def test_hsva(run: str, data_folder: Path) -> None:
    """The names of the publication are seen through, and the same columns result where there are no names at all."""
    log = data_folder / "kvlcc2_hsva" / f"HSVA_CPMC_KVLCC2_Z_{run}.dat"
    if not log.is_file():
        pytest.skip(f"no {log.name} in the data folder")
    proposal = guess(log, tuple(HSVA.split(",")))
    assert proposal.sniffed.form["encoding"] == "cp1252"
    assert (proposal.sniffed.form["separator"], proposal.sniffed.form["skip_rows"]) == ("whitespace", 4)
    columns = described(proposal)
    assert columns["u"] == ("u", "m/s", 1, "earth")
    assert columns["v"] == ("v", "m/s", 1, "earth")
    assert columns["r"] == ("p", "deg/s", 1, "body")
    assert columns["rudder.delta"] == ("delta", "deg", -1, "body")  # positive to port there
    assert columns["propeller.n"] == ("rev", "rev/s", 1, "body")
    assert proposal.kinds == {"earth-fixed velocities", "yaw rate under another name", "wrong sign of rudder"}
    if run not in RUNS[::3]:
        return
    numbered = {name: entry[0] for name, entry in described(guess(log)).items()}
    assert numbered == {"north": "2", "east": "3", "psi": "4", "u": "5", "v": "6", "r": "7", "rudder.delta": "9"}


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


@pytest.mark.parametrize("name", WRITTEN)
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
    columns = {name: entry[:2] for name, entry in described(guessed(globe, tmp_path)).items()}
    assert columns == {
        "latitude": ("lat", "deg"),
        "longitude": ("lon", "deg"),
        "psi": ("heading", "deg"),
        "speed": ("sog_kn", "kn"),
        "course": ("cog", "deg"),
        "r": ("rot", "deg/min"),
    }


def test_a_log_without_a_heading_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no column can be the heading"):
        guessed(as_bridge(si_log()).drop(columns="psi"), tmp_path)


def test_a_turn_while_the_logger_was_off_is_no_interpolation_across_360(tmp_path: Path) -> None:
    """Ten runs with pauses in which the ship comes round: large steps of the heading, each over a hole in time."""
    log = as_bridge(si_log()).round(4)
    rows, pauses = np.arange(len(log)), len(log) // 10
    turned = (log["psi"] + 200.0 * (rows // pauses)) % 360.0
    proposal = guessed(log.assign(psi=turned, time=log["time"] + 300.0 * (rows // pauses)), tmp_path)
    assert "interpolation across 360" not in proposal.kinds


@pytest.mark.parametrize(
    ("name", "unit"), [("Wind kn", "kn"), ("wind_kn", "kn"), ("Wind [kn]", "kn"), ("Wind", None), ("Wind speed", None)]
)
def test_a_name_says_its_unit(name: str, unit: str | None) -> None:
    assert unit_in_name(name, "m/s") == unit


@pytest.mark.parametrize(
    ("names", "taken", "relative"),
    [
        (("AWS", "AWA"), ("AWS", "AWA"), True),
        (("Apparent wind speed kn", "Apparent wind angle"), ("Apparent wind speed kn", "Apparent wind angle"), True),
        (("rel_wind_speed", "rel_wind_dir"), ("rel_wind_speed", "rel_wind_dir"), True),
        (("AWS", "AWA", "TWS", "TWD"), ("TWS", "TWD"), None),
        (("TWS", "AWA", "AWS"), ("AWS", "AWA"), True),
        (("Wind speed", "Wind true from [deg]"), ("Wind speed", "Wind true from [deg]"), None),
        (("Wind", "Wind dir"), ("Wind", "Wind dir"), None),
        (("TWS", "TWA"), ("TWS", "TWA"), "angle"),
    ],
)
def test_names_say_which_wind(
    names: tuple[str, ...], taken: tuple[str, str], relative: bool | str | None, tmp_path: Path
) -> None:
    log = as_bridge(si_log())
    wind = {name: np.random.default_rng(i).uniform(3.0, 8.0, len(log)) for i, name in enumerate(names)}
    proposed = {column.name: column for column in guessed(log.assign(**wind), tmp_path).columns}
    assert (proposed["V_w"].source, proposed["beta_w"].source) == taken
    assert proposed["beta_w"].extra.get("relative") is relative
    silent = not any(word in " ".join(taken) for word in ("AW", "Apparent", "rel", "true", "TWS"))
    assert ("does not show" in proposed["V_w"].evidence) is silent


def test_a_shaft_without_a_unit_among_radians_may_count_radians(tmp_path: Path) -> None:
    """As Simulink writes it: before, 17.8 rad/s were 17.8 rev/s without a question."""
    log = si_log()[["t", "north", "east", "psi", "u", "v", "r"]].assign(n=2 * np.pi * as_bridge(si_log())["rpm"] / 60)
    proposal = guessed(log, tmp_path)
    shaft = proposal.column("propeller.n")
    assert shaft is not None
    assert shaft.confidence < LIKELY
    assert any("rev/s, or rad/s" in question.sentence for question in proposal.questions)
    degrees = guessed(log.assign(psi=np.degrees(log["psi"])), tmp_path)
    assert not any("rad/s" in question.sentence for question in degrees.questions)


@pytest.mark.parametrize("nanoseconds", [0.0, 5e8])
def test_the_stamps_of_ROS_are_no_pitch(nanoseconds: float, tmp_path: Path) -> None:
    """`stamp` is a pitch in Norwegian."""
    log = as_bridge(si_log()).assign(**{"header.stamp.nsecs": nanoseconds * (np.arange(2740) % 2)})
    assert described(guessed(log, tmp_path)) == CLEAN


def test_a_roll_of_more_than_90_deg_is_none(tmp_path: Path) -> None:
    log = as_bridge(si_log()).assign(Roll=500.0 * np.sin(np.arange(2740.0)))
    assert described(guessed(log, tmp_path)) == CLEAN


@pytest.mark.parametrize("exchanged", [True, False])
def test_roll_and_pitch_that_are_exchanged_are_asked(exchanged: bool, tmp_path: Path) -> None:
    """A ship heels as she turns; what else shows the sides of her is nothing of her pitch."""
    log = si_log()
    waves = np.sin(log["t"])
    angles = {"roll": np.degrees(0.1 * log["u"] * log["r"]) + 0.2 * waves, "pitch": 0.5 + 0.3 * waves - 0.05 * log["u"]}
    names = ["pitch", "roll"] if exchanged else ["roll", "pitch"]
    file = tmp_path / "log.csv"
    as_bridge(log).assign(**dict(zip(names, angles.values(), strict=True))).to_csv(file, index=False)
    asked = [question.sentence for question in guess(file).questions if "phi" in question.about]
    assert [sentence.partition("?")[0] for sentence in asked] == ["are 'roll' and 'pitch' exchanged"] * exchanged


def test_a_clock_in_bursts_is_named(tmp_path: Path) -> None:
    """It was said that 1,000 rows were too few."""
    row = np.arange(1000)
    turn = 0.5 * np.sin(row / 60)
    way = np.cumsum(np.exp(1j * turn))
    log = {"time": row // 5 + 0.003 * (row % 5), "north": way.real, "east": way.imag, "psi": np.degrees(turn)}
    pd.DataFrame(log).round(4).to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(DataError, match=r"'time' comes in bursts: most steps are 0\.003 s, their mean is 0\.2 s"):
        guess(tmp_path / "log.csv")
