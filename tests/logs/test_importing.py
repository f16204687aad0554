"""The real log is imported to known facts; defects put into synthetic logs are detected and repaired."""

import csv
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset, flag_bit, stretches_of_runs
from shipid.errors import DataError, DocumentError
from shipid.logs import readers
from shipid.logs.importing import clean_name, import_log, read_mapping, run_files
from shipid.logs.mapping import LogSource
from tests.logs.conftest import CLOCKS, DATES, SPEEDS, as_log, import_written, turning

Write = Callable[..., Path]
T = np.arange(0.0, 120.0, 0.5)


@pytest.fixture(scope="module")
def gunnerus(gunnerus_log: Path) -> Dataset:
    return import_log(read_mapping("gunnerus-2022"), gunnerus_log)


def counts(dataset: Dataset) -> dict[str, int]:
    return {record["kind"]: record["count"] for record in dataset.metadata["repairs"]}


def imported(frame: pd.DataFrame, mapping: Path, tmp_path: Path, **options: object) -> Dataset:
    return import_log(read_mapping(mapping), as_log(frame, tmp_path / "log.csv"), **options)  # type: ignore[arg-type]


class TestGunnerus:
    """Facts of the published log, from the description that comes with it."""

    def test_counts(self, gunnerus: Dataset) -> None:
        assert gunnerus.metadata["rows"] == 17701
        assert counts(gunnerus)["wrap_interpolation"] == 77
        assert len(gunnerus.runs) == 23

    def test_runs_are_the_tests_of_the_trial(self, gunnerus: Dataset, gunnerus_log: Path) -> None:
        with (gunnerus_log.parent / "test_segments.csv").open() as stream:
            tests = [(row["name"], float(row["t0"]), float(row["t1"])) for row in csv.DictReader(stream)]
        times = gunnerus.frame.groupby("run", sort=False)["t"].agg(["min", "max"])
        spans = [(run.partition(" (")[0], start, end) for run, start, end in times.itertuples()]
        assert spans == tests

    def test_straight_runs_do_not_drift_after_the_repairs(self, gunnerus: Dataset, gunnerus_log: Path) -> None:
        raw = import_log(read_mapping("gunnerus-2022"), gunnerus_log, without=("heading_offset", "lever_arm"))
        for dataset, drift in ((raw, 0.040), (gunnerus, 0.0)):
            rows = dataset.frame[dataset.frame["run"].str.startswith("Speed")]
            assert np.median(rows["v"] / rows["u"]) == pytest.approx(drift, abs=0.01)

    def test_breaks_lie_where_a_minute_is_missing(self, gunnerus: Dataset) -> None:
        broken = gunnerus.frame["flags"] & flag_bit(gunnerus.metadata, "break") != 0
        assert gunnerus.frame.loc[broken, ["run", "t"]].to_numpy().tolist() == [
            ["ZZ 5/10", 2702.0],
            ["ZZ 20/20", 4215.0],
        ]

    def test_a_changed_log_is_refused(self, gunnerus_log: Path, tmp_path: Path) -> None:
        other = tmp_path / "log.csv"
        other.write_bytes(gunnerus_log.read_bytes()[:-1])
        with pytest.raises(DataError, match="sha256 differs"):
            import_log(read_mapping("gunnerus-2022"), other)


def test_units_wrapping_and_names(plain_mapping: Write, tmp_path: Path) -> None:
    """A clean log comes back exactly as the motion that made it; psi passes 360 deg at once."""
    motion = turning(T)
    dataset = imported(motion, plain_mapping(), tmp_path)
    for name in ("t", "north", "east", "psi", "u", "v", "r"):
        np.testing.assert_allclose(dataset.frame[name], motion[name], atol=1e-9, err_msg=name)
    np.testing.assert_allclose(dataset.frame["propeller.n"], motion["port.n"], atol=1e-12)
    assert dataset.frame["flags"].eq(0).all()
    assert dataset.metadata["repairs"] == []


def test_a_heading_that_counts_from_0_again_is_refused_without_wrap(plain_mapping: Write, tmp_path: Path) -> None:
    """The mean of 359 and 1 deg would be 180: the ship would look back between two rows."""
    motion = turning(T)
    plain = plain_mapping("", ("wrap = true", "wrap = false"))
    with pytest.raises(DataError, match=r"columns.psi: .* jumps by a whole turn, once at .* s: write wrap = true"):
        imported(motion, plain, tmp_path)
    straight = motion.assign(psi=1.0 + 0.1 * np.sin(motion["t"]))
    np.testing.assert_allclose(imported(straight, plain, tmp_path).frame["psi"], straight["psi"], atol=1e-9)


def test_segments_may_overlap_and_rows_in_none_are_counted(plain_mapping: Write, tmp_path: Path) -> None:
    more = '\n[[segment]]\nrun = "a"\nstart = 10\nend = 20\n[[segment]]\nrun = "b"\nstart = 15\nend = 30\n'
    dataset = imported(turning(T), plain_mapping(more), tmp_path)
    sizes = dataset.frame.groupby("run")["t"].agg(["min", "max", "size"])
    assert sizes.to_numpy().tolist() == [[10, 20, 21], [15, 30, 31]]
    assert counts(dataset) == {"left out": len(T) - 41}


@pytest.mark.parametrize("clock", [*CLOCKS, *DATES])
def test_a_log_imports_to_the_same_numbers_from_every_unit(clock: str, plain_mapping: Write, tmp_path: Path) -> None:
    """Segments and breaks are on the clock of the log, those of dates in seconds since 1970."""
    random = np.random.default_rng(11)
    begin = random.uniform(8e8, 1.9e9) if clock in DATES else random.uniform(0.0, 1e4)
    t = np.round(begin, 3) + np.cumsum(random.choice([0.25, 0.5, 1.0], 120))
    motion = turning(t, psi0=6.0 - 0.05 * t[0])
    speed = str(random.choice(list(SPEEDS)))
    size = CLOCKS.get(clock, 1.0)
    start, end, hole = (float(t[row] + 0.125) / size for row in (20, 99, 60))
    more = f'[[segment]]\nrun = "a"\nstart = {start!r}\nend = {end!r}\n'
    more += f'[[repair]]\nkind = "break"\nintervals = [[{hole!r}, {hole + 2.25 / size!r}]]\nreason = "x"\n'
    mapping = plain_mapping(more, ('from = "time"', f'from = "time"\nunit = "{clock}"'))
    mapping.write_text(mapping.read_text().replace('"m/s"', f'"{speed}"'))
    rows = import_log(read_mapping(mapping), as_log(motion, tmp_path / "log.csv", clock, speed)).frame
    expected = motion.iloc[21:100]
    expected = expected[(expected["t"] < hole * size) | (expected["t"] > hole * size + 2.25)]
    for name, tolerance in (("t", 2e-5), ("u", 1e-12), ("v", 1e-12), ("r", 1e-12), ("north", 1e-9)):
        np.testing.assert_allclose(rows[name], expected[name], rtol=1e-12, atol=tolerance, err_msg=name)
    assert np.flatnonzero(rows["flags"]).tolist() == [int((expected["t"] < hole * size).sum())]


@pytest.mark.parametrize(("step", "rounded"), [(0.02, 0.1)])
def test_a_rounded_clock_runs_evenly(step: float, rounded: float, plain_mapping: Write, tmp_path: Path) -> None:
    """The rows are `every` apart; without the key, the same log is refused, for its times stand twice."""
    t = 30.0 + step * np.arange(400)
    motion = turning(t)
    log = as_log(motion.assign(t=np.round(np.floor(t / rounded + 1e-9) * rounded, 6)), tmp_path / "log.csv")
    with pytest.raises(DataError, match="appears twice"):
        import_log(read_mapping(plain_mapping()), log)
    mapping = plain_mapping("", ('from = "time"', f'from = "time"\nevery = {step}'))
    times = import_log(read_mapping(mapping), log).frame["t"].to_numpy()
    np.testing.assert_allclose(np.diff(times), step, rtol=1e-9)
    np.testing.assert_allclose(times, t, atol=rounded)


def test_short_gaps_are_filled_and_long_ones_break(plain_mapping: Write, tmp_path: Path) -> None:
    motion = turning(T)
    holes = motion.assign(
        u=motion["u"].where(~motion["t"].between(10.0, 10.5)),  # 1.5 s between known values: filled
        v=motion["v"].where(~motion["t"].between(50.0, 60.0)),  # too long: the rows go
    )
    holes = holes[~holes["t"].between(80.0, 90.0)]  # no rows at all: a break, too
    mapping = plain_mapping(replace=('from = "time"', 'from = "time"\nmax_gap = 2.0'))
    dataset = imported(holes, mapping, tmp_path)
    assert [(rows["t"].iloc[0], rows["t"].iloc[-1]) for _, rows in stretches_of_runs(dataset)] == [
        (0.0, 49.5),
        (60.5, 79.5),
        (90.5, 119.5),
    ]
    filled = dataset.frame["flags"] & flag_bit(dataset.metadata, "interpolated") != 0
    assert dataset.frame.loc[filled, "t"].tolist() == [10.0, 10.5]
    np.testing.assert_allclose(dataset.frame["u"], 4.0)
    assert counts(dataset) == {"interpolated": 0, "break": 2}  # of v none, of u two: the last record wins
    assert [record["count"] for record in dataset.metadata["repairs"]] == [2, 0, 2]


def test_resampling_keeps_the_motion(plain_mapping: Write, tmp_path: Path) -> None:
    mapping = plain_mapping(replace=('from = "time"', 'from = "time"\nmax_gap = 2.0\nstep = 1.0'))
    frame = imported(turning(T), mapping, tmp_path).frame
    assert np.unique(np.diff(frame["t"])).tolist() == [1.0]
    every_other = turning(T).iloc[::2].reset_index(drop=True)
    np.testing.assert_allclose(frame["north"], every_other["north"], atol=1e-9)
    np.testing.assert_allclose(frame["propeller.n"], every_other["port.n"], atol=1e-12)
    unix = turning(T).assign(t=1.7e9 + T)
    moved = imported(unix, mapping, tmp_path).frame
    np.testing.assert_array_equal(moved["propeller.n"], frame["propeller.n"])


def test_unknown_repair_to_leave_out(plain_mapping: Write, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="did you mean 'heading_offset'"):
        imported(turning(T), plain_mapping(), tmp_path, without=("heading-offset",))


@pytest.mark.parametrize("direction", ["from", "towards"])
def test_wind_felt_on_board_becomes_the_wind_over_ground(direction: str, plain_mapping: Write, tmp_path: Path) -> None:
    """A ship that turns and drifts feels the true wind less the ship's velocity, from another side each second."""
    rng = np.random.default_rng(1)
    motion = turning(T, u=rng.uniform(2, 6), v=rng.uniform(-2, 2), psi0=rng.uniform(0, 6))
    speed, towards = rng.uniform(1, 12), rng.uniform(0, 2 * np.pi)
    felt = speed * np.exp(1j * (towards - motion["psi"])) - (motion["u"] + 1j * motion["v"])
    came = -felt if direction == "from" else felt
    log = as_log(motion, tmp_path / "log.csv")
    table = pd.read_csv(log).assign(speed=np.abs(felt), angle=np.degrees(np.angle(came)) % 360)
    table.to_csv(log, index=False)
    columns = '[columns.V_w]\nfrom = "speed"\nunit = "m/s"\n[columns.beta_w]\nfrom = "angle"\nunit = "deg"\n'
    columns += f'direction = "{direction}"\nrelative = true\nwrap = true\n'
    frame = import_log(read_mapping(plain_mapping(columns)), log).frame
    np.testing.assert_allclose(frame["V_w"], speed, atol=1e-6)
    np.testing.assert_allclose(np.exp(1j * frame["beta_w"]), np.exp(1j * towards), atol=1e-6)


def test_files_are_parted_by_a_column_and_by_pauses(plain_mapping: Write, tmp_path: Path) -> None:
    first, second, third = (turning(T + start) for start in (0.0, 300.0, 420.0))  # a pause, and none
    log = as_log(pd.concat([first, second, third]).drop_duplicates("t"), tmp_path / "log.csv")
    table = pd.read_csv(log)
    table.assign(run=np.where(table["time"] < 420.0, "a", "b")).to_csv(log, index=False)
    parted = {
        "pause = 60.0": ["log 1", "log 2"],
        'from = "run"': ["log a", "log b"],
        'from = "run"\npause = 60.0': ["log a", "log a (2)", "log b"],
    }
    for keys, names in parted.items():
        dataset = import_log(read_mapping(plain_mapping(f"\n[parts]\n{keys}\n")), log)
        assert dataset.runs == names
        assert len(dataset.frame) == len(table)
    missing = plain_mapping('\n[parts]\nfrom = "runn"\n')
    with pytest.raises(DataError, match="did you mean"):
        import_log(read_mapping(missing), log)


def test_rows_that_repeat_a_time_are_left_out_where_the_mapping_asks(plain_mapping: Write, tmp_path: Path) -> None:
    motion = turning(T)
    twice = motion.iloc[np.sort(np.append(np.arange(len(T)), [7, 50, 51]))]
    log = as_log(twice, tmp_path / "log.csv")
    with pytest.raises(DataError, match=r"row 9: the time 3\.5 s appears twice: .* repeated = 'drop'"):
        import_log(read_mapping(plain_mapping()), log)
    dataset = import_log(read_mapping(plain_mapping("", ('from = "time"', 'from = "time"\nrepeated = "drop"'))), log)
    assert counts(dataset)["repeated"] == 3
    np.testing.assert_allclose(dataset.frame["north"], motion["north"], atol=1e-6)


def test_a_folder_for_a_mapping_of_one_file_says_what_to_write(plain_mapping: Write, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"a folder, and the mapping reads one file; .* runs = "):
        import_log(read_mapping(plain_mapping()), tmp_path)


PARTED = """
name = "parts"
[clock]
from = ["h", "min", "s"]
date = ["year", "month", "day"]
unit = "date"
[columns.latitude]
from = ["lat", "lat min", "lat s"]
unit = "deg"
[columns.longitude]
from = ["lon", "lon min"]
unit = "deg"
[columns.psi]
from = "psi"
unit = "rad"
[estimate]
position = 1.0
heading_deg = 1.0
acceleration = 0.1
angular_acceleration_deg = 1.0
"""


def parted(side: float = 1.0) -> pd.DataFrame:
    """Five seconds over a midnight in columns; at 33 deg 18 min, from one minute to the next."""
    moments = pd.Timestamp("2023-12-31T23:59:58") + pd.to_timedelta(0.5 * np.arange(10), "s")
    size = 33.3 + 1e-5 * np.arange(10)
    log = pd.DataFrame({one: getattr(moments, one) for one in ("year", "month", "day")})
    log = log.assign(h=moments.hour, min=moments.minute, s=moments.second + 1e-6 * moments.microsecond)
    log["lat"], minutes = side * np.floor(size), 60.0 * (size % 1)
    log["lat min"], log["lat s"] = np.floor(minutes), 60.0 * (minutes % 1)
    return log.assign(lon="-0", **{"lon min": 7.5, "psi": 0.0})


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_dates_and_angles_in_several_columns(side: float, tmp_path: Path) -> None:
    dataset = import_written(PARTED, parted(side), tmp_path)
    np.testing.assert_allclose(dataset.frame["t"] - 1704067198.0, 0.5 * np.arange(10), atol=1e-5)  # date -u +%s
    assert dataset.metadata["origin"] == pytest.approx({"latitude": side * 33.3, "longitude": -0.125})
    metres = side * 111.0e3 * 1e-5 * np.arange(10)  # of latitude there: a degree has 110.9 km
    np.testing.assert_allclose(dataset.frame["north"], metres, atol=0.02)


@pytest.mark.parametrize("large", [False, True])
def test_positions_as_text(large: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(readers, "LARGE", 0 if large else readers.LARGE)
    mapping = PARTED.replace('["lat", "lat min", "lat s"]', '"place"').replace('["lon", "lon min"]', '"place"')
    log = parted()
    minutes = [f"{1.8e-2 + 6e-4 * row:.6f}" for row in range(10)]
    log["place"] = [f"33°{one}'S 000°07.5'W" for one in minutes]
    dataset = import_written(mapping, log, tmp_path)
    assert dataset.metadata["origin"] == pytest.approx({"latitude": -33.0003, "longitude": -0.125})
    np.testing.assert_allclose(dataset.frame["north"], -110.9e3 * 1e-5 * np.arange(10), atol=0.02)
    log.loc[4, "place"] = "33°18.0'N"
    with pytest.raises(DataError, match=r"row 5: .*33°18.0'N.* is no number and no position with E or W"):
        import_written(mapping, log, tmp_path)


@pytest.mark.parametrize(
    ("change", "row", "said"),
    [
        ({"min": 75}, 4, "'2023 12 31 23 75 59.5' is no date or time of day"),
        ({"month": 13}, 4, "'2023 13 31 23 59 59.5' is no date or time of day"),
        ({"s": None}, 4, "no time here: remove the row"),
        ({"lon min": 60.5}, 4, "'lon min': 60.5 in row 4 is 60 or more: are these minutes or seconds"),
    ],
)
def test_parts_that_cannot_be_are_named(change: dict[str, float], row: int, said: str, tmp_path: Path) -> None:
    log = parted()
    for name, value in change.items():
        log.loc[row - 1, name] = value
    with pytest.raises(DataError, match=re.escape(said)):
        import_written(PARTED, log, tmp_path)


CURVE = "[[1000, -40], [1100, -40], [1480, 0], [1520, 0], [1900, 100]]"


def craft_log(pulses: list[float], folder: Path, name: str = "log.csv") -> Path:
    rows = {"t": range(len(pulses)), "north": 0.0, "east": 0.0, "psi": 0.0, "u": 0.0, "v": 0.0, "r": 0.0}
    file = folder / name
    pd.DataFrame({**rows, "pwm": pulses}).to_csv(file, index=False)
    return file


def craft_mapping(tmp_path: Path, more: str, head: str = "") -> Path:
    columns = {"north": "m", "east": "m", "psi": "rad", "u": "m/s", "v": "m/s", "r": "rad/s"}
    blocks = [f'[columns.{name}]\nfrom = "{name}"\nunit = "{unit}"\n' for name, unit in columns.items()]
    file = tmp_path / "craft.toml"
    file.write_text(f'name = "craft"\n{head}[clock]\nfrom = "t"\n{"".join(blocks)}{more}')
    return file


def test_a_curve_reads_pulses_with_a_dead_band_both_directions_and_stops(tmp_path: Path) -> None:
    """Each value by hand from the pairs; between them a line."""
    command = f'[columns."left.force"]\nfrom = "pwm"\nunit = "N"\ncurve = {CURVE}\n'
    mapping = read_mapping(craft_mapping(tmp_path, command))
    pulses = [1000.0, 1050.0, 1290.0, 1480.0, 1500.0, 1520.0, 1710.0, 1900.0]
    force = import_log(mapping, craft_log(pulses, tmp_path)).frame["left.force"]
    np.testing.assert_allclose(force, [-40, -40, -20, 0, 0, 0, 50, 100], atol=1e-12)
    with pytest.raises(DataError, match=r"0 in row 2 is outside the curve, 1000 to 1900: give it another end"):
        import_log(mapping, craft_log([1500.0, 0.0, 1500.0], tmp_path))


@pytest.mark.parametrize(
    ("command", "path", "message"),
    [
        (
            '[columns."left.n"]\nfrom = "pwm"\nunit = "rpm"\ncurve = [[2,0], [1,5]]\n',
            "left.n.curve",
            "numbers of the log rise",
        ),
        ('[columns.phi]\nfrom = "pwm"\nunit = "deg"\ncurve = [[1, 0], [2, 5]]\n', "phi.curve", "belongs to a command"),
    ],
)
def test_a_curve_that_cannot_be_read_is_refused(command: str, path: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=message) as caught:
        read_mapping(craft_mapping(tmp_path, command))
    assert str(caught.value.path) == f"columns.{path}"


SEGMENTS = """
[[segment]]
run = "drive 1"
file = "a"
start = 1.0
end = 3.0
manoeuvre = "mixed"
[[segment]]
run = "drive 2"
file = "a"
start = 4.0
end = 8.0
"""


def test_segments_of_several_files_cut_those_that_they_name_and_leave_the_others_whole(tmp_path: Path) -> None:
    head, logs = '[source]\nruns = "*.csv"\n', tmp_path / "logs"
    logs.mkdir()
    for name in "ab":
        craft_log([1500.0] * 10, logs, f"{name}.csv")
    data = import_log(read_mapping(craft_mapping(tmp_path, SEGMENTS, head)), logs)
    assert data.frame.groupby("run")["t"].apply(list).to_dict() == {
        "drive 1": [1, 2, 3],
        "drive 2": [4, 5, 6, 7, 8],
        "b": [*range(10)],
    }
    assert data.metadata["manoeuvres"] == {"drive 1": "mixed"}
    (left,) = (one for one in data.metadata["repairs"] if one["kind"] == "left out")
    assert (left["count"], left["note"]) == (2, "of 20 rows: in no segment")
    crossed = SEGMENTS.replace('run = "drive 2"\nfile = "a"', 'run = "a"\nfile = "b"')  # no file stays whole
    assert {*import_log(read_mapping(craft_mapping(tmp_path, crossed, head)), logs).frame["run"]} == {"drive 1", "a"}
    for wrong, message in (('file = "c"', "no file 'c'"), ('run = "b"', "a run 'b' exists")):
        written = SEGMENTS.replace('file = "a"' if "file" in wrong else 'run = "drive 2"', wrong)
        with pytest.raises(DataError, match=message):
            import_log(read_mapping(craft_mapping(tmp_path, written, head)), logs)


@pytest.mark.parametrize(
    ("segments", "head", "message"),
    [
        (SEGMENTS, "", "names the file of a segment where source.runs reads several, and only there"),
        (SEGMENTS.replace('file = "a"\n', ""), '[source]\nruns = "*.csv"\n', "names the file of a segment"),
        (SEGMENTS.replace("4.0", "2.0"), '[source]\nruns = "*.csv"\n', "begins before the last segment of 'a' ends"),
    ],
)
def test_segments_say_their_file_and_do_not_overlap_in_it(
    segments: str, head: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(DocumentError, match=message):
        read_mapping(craft_mapping(tmp_path, segments, head))


@pytest.mark.parametrize("name", ["N", "u", "rot", "rpm", "heading"])
@pytest.mark.parametrize("value", [1e300, -(2.0**64)])
@pytest.mark.parametrize("estimated", [False, True])
def test_a_value_that_no_ship_has_is_refused_with_its_row(
    name: str, value: float, estimated: bool, log: pd.DataFrame, plain_mapping: Callable[..., Path], tmp_path: Path
) -> None:
    """Before, it was imported, and what followed ended in an overflow; the estimate of a velocity, too."""
    log.loc[40, name] = value
    sway, names = '[columns.v]\nfrom = "v"\nunit = "m/s"\n', ("position", "heading_deg", "velocity", "rate_deg")
    noise = "".join(f"{one} = 0.1\n" for one in (*names, "acceleration", "angular_acceleration_deg"))
    more = (f"[estimate]\n{noise}", (sway, "")) if estimated else ()
    with pytest.raises(DataError, match=r"row 41: .* no ship has more than"):
        import_written(plain_mapping(*more), log, tmp_path)


def test_a_spike_that_is_mended_is_no_such_value(
    log: pd.DataFrame, plain_mapping: Callable[[str], Path], tmp_path: Path
) -> None:
    log.loc[40, "u"] = 1e30
    repair = '\n[[repair]]\nkind = "despike"\ncolumns = ["u"]\nwindow = 5.0\nthreshold = 2.0\nreason = "spikes"\n'
    assert import_written(plain_mapping(repair), log, tmp_path).frame["u"].max() < 5.0


def test_a_clock_of_no_ship_is_refused(log: pd.DataFrame, plain_mapping: Callable[[str], Path], tmp_path: Path) -> None:
    with pytest.raises(DataError, match="is the unit of the clock right"):
        import_written(plain_mapping(""), log.assign(time=1e-300 * np.arange(len(log))), tmp_path)


NAMES_OF_FILES = {
    "=cmd|calc!A1": "cmd|calc!A1",
    "@SUM(1)": "SUM(1)",
    "-2+3|x": "2+3|x",
    " =A1": "A1",
    "a\x1b[31mb\n": "a[31mb",
    "-20": "-20",
    "+10 stbd": "+10 stbd",
    "Z_20": "Z_20",
    "Überfahrt ø": "Überfahrt ø",
    "=": "run",
    "\x1b=cmd": "cmd",
    "\u202e @SUM(1)": "SUM(1)",
}


@pytest.mark.parametrize("name", NAMES_OF_FILES)
def test_names_of_runs_are_no_formulas_and_steer_no_terminal(name: str) -> None:
    assert clean_name(name) == NAMES_OF_FILES[name]
    assert clean_name(NAMES_OF_FILES[name]) == NAMES_OF_FILES[name]


def test_names_that_are_one_when_cleaned_stay_two_runs(tmp_path: Path) -> None:
    for name in ("=a", "@a", "a"):
        (tmp_path / f"{name}.csv").write_text("t\n1\n")
    files = run_files(LogSource(runs="*.csv"), tmp_path)
    assert list(files) == ["a", "a (2)", "a (3)"]
    assert len({*files.values()}) == 3
