"""The clock of logs that nobody has seen: found, read in its unit, asked about or refused with its remedy."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.logs.guess.sniff import recognise_log
from shipid.logs.mapping import clock_seconds
from tests.logs.guess.conftest import TABLE, T, log_of, sniff


@pytest.mark.parametrize(
    ("clock", "unit", "t"),
    [
        ((1000 * T).astype(int), "ms", T),
        (1000 * T + 0.25, "ms", T + 2.5e-4),
        (1.7e9 + 240.5 * T, "s", 1.7e9 + 240.5 * T),
        ((1e3 * (1.7e9 + 240 * T)).astype(np.int64), "ms", 1.7e9 + 240 * T),
        ((1e6 * T).astype(np.int64), "us", T),
        ((1e6 * (9.0 + T / 4)).astype(np.int64), "us", 9.0 + T / 4),
        ((1e9 * (5.0 + T)).astype(np.int64), "ns", 5.0 + T),
        ((1e6 * (1.7e9 + T)).astype(np.int64), "us", 1.7e9 + T),
        ((1e9 * (1.7e9 + T)).astype(np.int64), "ns", 1.7e9 + T),
        (1.7e9 + T, "s", 1.7e9 + T),
        (pd.to_datetime(1.7e9 + T, unit="s").strftime("%Y-%m-%dT%H:%M:%S.%f"), "date", 1.7e9 + T),
    ],
)
def test_the_unit_of_the_clock(clock: object, unit: str, t: np.ndarray, tmp_path: Path) -> None:
    sniffed = sniff(tmp_path, TABLE.assign(time=clock))
    assert sniffed.clock == {"from": "time", "unit": unit}
    np.testing.assert_allclose(sniffed.t, t, atol=1e-6)


@pytest.mark.parametrize(("step", "stored"), [(0.2, "csv"), (10.0, "parquet")])
def test_a_date_and_a_time_in_one_number_are_no_seconds(step: float, stored: str, tmp_path: Path) -> None:
    """Before, every minute had a hole of 41 s."""
    t = step * np.arange(900)
    moments = pd.Timestamp("2024-05-14 08:13:20") + pd.to_timedelta(t, "s")
    numbers = moments.strftime("%Y%m%d%H%M%S.%f").str[:-4]
    log = pd.DataFrame({"time": numbers, "N": t, "psi": t})
    if stored == "csv":
        log.to_csv(tmp_path / "log", index=False)
    else:
        log.assign(time=numbers.astype(float)).to_parquet(tmp_path / "log")
    sniffed = recognise_log(tmp_path / "log")
    assert sniffed.clock == {"from": "time", "unit": "date"}
    np.testing.assert_allclose(sniffed.t, t + pd.Timestamp("2024-05-14 08:13:20").timestamp(), atol=5e-3)


@pytest.mark.parametrize("epoch", [11_644_473_600, 62_135_596_800])  # of Windows and .NET
def test_ticks_of_100_ns_are_refused_with_what_to_write(epoch: int, tmp_path: Path) -> None:
    rows = [f"{(1_715_673_600 + k + epoch) * 10**7},{k % 7}" for k in range(80)]
    with pytest.raises(
        DataError, match=r"'Timestamp': it begins at .* s, read in us: write dates, or seconds since 1970"
    ):
        recognise_log(log_of(tmp_path, ["Timestamp,x", *rows]))


def test_a_date_without_a_century_in_one_number_is_refused(tmp_path: Path) -> None:
    moments = pd.Timestamp("2024-05-14 08:13:20") + pd.to_timedelta(np.arange(200), "s")
    log = pd.DataFrame({"time": moments.strftime("%d%m%y%H%M%S"), "N": 1.0, "psi": 2.0})
    with pytest.raises(
        DataError, match="'time': it is a date and a time of day in one number, 140524081320: write 2024"
    ):
        sniff(tmp_path, log)


@pytest.mark.parametrize(("name", "step"), [("utc", 0.2), ("t", 10.0)])
def test_hours_minutes_and_seconds_in_one_number_are_no_seconds(name: str, step: float, tmp_path: Path) -> None:
    t = step * np.arange(900)
    moments = pd.Timestamp("2024-05-14 08:13:20") + pd.to_timedelta(t, "s")
    log = pd.DataFrame({name: moments.strftime("%H%M%S.%f").str[:-4], "N": t, "psi": t})
    sniffed = sniff(tmp_path, log)
    assert sniffed.clock == {"from": name, "unit": "hhmmss"}
    np.testing.assert_allclose(sniffed.t, 8 * 3600 + 13 * 60 + 20 + t, atol=1e-6)


START = pd.Timestamp("2024-05-14 08:00:05")
DAYS_OF = {
    "datenum": START.toordinal() + 366 + 8 / 24,
    "excel": (START - pd.Timestamp(1899, 12, 30)) / pd.Timedelta("1D"),
}
DAYS_OF["datenum"] += 5 / 86400


@pytest.mark.parametrize("unit", DAYS_OF)
@pytest.mark.parametrize(("name", "step"), [("time", 0.5), ("Time [d]", 10.0)])
def test_days_of_matlab_and_excel_are_known_by_their_size(unit: str, name: str, step: float, tmp_path: Path) -> None:
    """A double has such a day to 1e-5 s, a table to as much as it writes."""
    t = step * np.arange(60)
    table = pd.DataFrame({name: [f"{DAYS_OF[unit] + one / 86400:.10f}" for one in t], "N": t, "psi": t})
    sniffed = sniff(tmp_path, table)
    assert sniffed.clock == {"from": name, "unit": unit}
    np.testing.assert_allclose(sniffed.t, START.timestamp() + t, atol=3e-5)


@pytest.mark.parametrize(
    ("name", "values", "unit"),
    [
        ("t_min", T / 60, "min"),
        ("Time [hours]", T / 3600, "h"),
        ("elapsed_hours", T / 3600, "h"),
        ("Zeit / min", T / 60, "min"),
        ("Time (d)", T / 86400, "d"),
        ("time_d", 134.3 + T / 86400, "d"),  # the day of the year
        ("Time [d]", 60443.3 + T / 86400, "mjd"),  # no date of Excel
        ("JD", 2460444.8 + T / 86400, "jd"),
        ("mjd_utc", 54000.3 + T / 86400, "mjd"),
        ("time", 54000.3 + T / 86400, "excel"),
        ("time", 45000.0 + T, "s"),  # seconds of a day, half past twelve
        ("time", np.floor(45000.0 + T), "s"),  # the same, in whole seconds: most steps are 0
        ("time_of_day", 45000.0 + T, "s"),
        ("time_s", 45000.0 + T / 1e3, "s"),
        ("Time [s]", 738000.3 + T / 1e3, "s"),
        ("time", 738000.3 + T, "s"),
        ("time_s", 1.7e9 + 40 * T, "s"),  # since 1970, a row every 20 s
        ("time", 1.7e9 + 40 * T, "ms"),  # since 20 days, a row every 20 ms
    ],
)
def test_what_a_clock_counts_in(name: str, values: np.ndarray, unit: str, tmp_path: Path) -> None:
    table = TABLE.assign(time=values).rename(columns={"time": name})
    assert sniff(tmp_path, table, float_format="%.10f").clock["unit"] == unit


@pytest.mark.parametrize("day", ["%d.%m.%Y", "%m/%d/%Y"])
def test_a_date_beside_times_of_day(day: str, tmp_path: Path) -> None:
    moments = pd.to_datetime(1.7e9 + T, unit="s")
    split = TABLE.assign(time=moments.strftime("%H:%M:%S.%f"))
    split.insert(0, "Day", moments.strftime(day))
    sniffed = sniff(tmp_path, split)
    assert sniffed.clock == {"from": "time", "unit": "date", "date": "Day"}
    np.testing.assert_allclose(sniffed.t, 1.7e9 + T, atol=1e-5)
    assert sniffed.notes == ()


def test_a_clock_rounded_to_seconds_has_its_rate(tmp_path: Path) -> None:
    t = np.arange(0.0, 60.0, 0.1)
    sniffed = sniff(tmp_path, pd.DataFrame({"time": np.floor(t + 1e-9), "N": t, "psi": t}))
    assert sniffed.clock == {"from": "time", "unit": "s", "every": 0.1}
    np.testing.assert_allclose(np.diff(sniffed.t), 0.1, rtol=1e-6)


def test_a_clock_is_preferred_by_its_name_and_to_numbers_of_rows(tmp_path: Path) -> None:
    counted = TABLE.rename(columns={"time": "time_s"})
    counted.insert(0, "row", range(len(T)))
    assert sniff(tmp_path, counted).clock["from"] == "time_s"
    assert sniff(tmp_path, counted.rename(columns={"time_s": "x"}).assign(N=1.0, psi=2.0)).clock["from"] == "x"


def test_rows_that_repeat_the_row_before_are_dropped_and_reported(tmp_path: Path) -> None:
    rows = [f"{0.2 * k:.1f},{np.sin(k):.3f},{np.cos(k):.3f}" for k in range(60)]
    twice = sorted(rows + rows[7:9], key=lambda row: float(row.split(",")[0]))
    sniffed = recognise_log(log_of(tmp_path, ["time,x,y", *twice]))
    assert sniffed.clock == {"from": "time", "unit": "s", "repeated": "drop"}
    np.testing.assert_allclose(sniffed.t, 0.2 * np.arange(60))
    assert all(len(values) == 60 for values in sniffed.columns.values())
    assert any("repeat" in note for note in sniffed.notes)


START_OF_DAY = pd.Timestamp("2024-05-14 23:58:00") + pd.to_timedelta(0.5 * np.arange(600), unit="s")


def with_clock(name: str, values: list[object]) -> pd.DataFrame:
    return pd.DataFrame({name: values, "north": np.arange(600.0), "heading": 0.1})


@pytest.mark.parametrize(
    ("name", "values", "unit"),
    [
        ("UTC", [moment.strftime("%H%M%S.%f")[:9] for moment in START_OF_DAY], "hhmmss"),
        ("Seconds of day", [(86280 + 0.5 * k) % 86400 for k in range(600)], "s of day"),
        ("TOW [s]", [(604680 + 0.5 * k) % 604800 for k in range(600)], "s of week"),
        ("TOW [ms]", [(604680000 + 500 * k) % 604800000 for k in range(600)], "ms of week"),
        ("ms of day", [(86280000 + 500 * k) % 86400000 for k in range(600)], "ms of day"),
        ("Time", [moment.strftime("%Y-%j %H:%M:%S.%f") for moment in START_OF_DAY], "date"),
        ("Time", [moment.strftime("%Y:%j:%H:%M:%S.%f") for moment in START_OF_DAY], "date"),
        ("Day of year", [135.9986 + 0.5 * k / 86400 for k in range(600)], "d"),
    ],
)
def test_clocks_that_begin_again_and_days_of_the_year(
    name: str, values: list[object], unit: str, tmp_path: Path
) -> None:
    """Rows are 0.5 s apart, over midnight or the end of the week, in the draft and in the import."""
    sniffed = sniff(tmp_path, with_clock(name, values))
    assert sniffed.clock == {"from": name, "unit": unit}
    np.testing.assert_allclose(np.diff(sniffed.t), 0.5, atol=1e-4)
    if unit == "date":
        assert sniffed.t[0] == pytest.approx(START_OF_DAY[0].timestamp())
        return
    read = clock_seconds(pd.read_csv(tmp_path / "log.csv")[name].to_numpy(float), unit)
    np.testing.assert_allclose(np.diff(read), 0.5, atol=1e-4)


@pytest.mark.parametrize("write", ["{:g} sec", lambda t: f"0 days 00:{t // 60:02.0f}:{t % 60:09.6f}"])
def test_durations_as_text(write: Callable[[float], str] | str, tmp_path: Path) -> None:
    """As MATLAB writes those of a timetable, and pandas its own."""
    times = [write.format(0.5 * k) if isinstance(write, str) else write(0.5 * k) for k in range(600)]
    sniffed = sniff(tmp_path, with_clock("Time", times))
    assert sniffed.clock == {"from": "Time", "unit": "date"}
    np.testing.assert_allclose(sniffed.t, 0.5 * np.arange(600), atol=1e-6)


@pytest.mark.parametrize(("name", "digits"), [("Decimal year", 12), ("time", 12)])
def test_a_year_with_decimals_is_no_clock_in_seconds(name: str, digits: int, tmp_path: Path) -> None:
    years = [f"{2024.3655 + 0.5 * k / 366 / 86400:.{digits}f}" for k in range(600)]
    with pytest.raises(DataError, match=f"'{name}': rows are .* s apart, as of no ship: is the unit"):
        sniff(tmp_path, with_clock(name, years))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("# operator, zigzag,2", "in row 31: '# operator' is no number"),
        ("2016-12-31T23:59:60Z,1,2", "in row 31: '2016-12-31T23:59:60Z' is no number"),
        ("later,1,2", "in row 31: 'later' is no number"),
    ],
)
def test_a_line_without_a_time_is_named(line: str, words: str, tmp_path: Path) -> None:
    lines = ["time,north,heading", *(f"{k},{2 * k},0.1" for k in range(60))]
    with pytest.raises(DataError) as caught:
        recognise_log(log_of(tmp_path, [*lines[:31], line, *lines[31:]]))
    assert words in caught.value.message


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (
            [f"14/05/2024 08.{k // 60:02}.{k % 60:02}" for k in range(90)],
            "in row 1: '14/05/2024 08.00.00' is no date or time of day",
        ),
        ([f'"{k:,.1f}"' for k in range(680, 1070)], "in row 321: '1,000.0' is no number"),
        ([str(k) if k % 9 != 8 else "late" for k in range(90)], "in row 9: 'late' is no number"),
        ([f"{1.715e12 + 500 * k:.5E}" for k in range(90)], "in row 2: the time 2024-05-06 12:53:20 UTC appears twice"),
        ([f"{k // 60:02}:{k % 60:02}.5" for k in range(90)], "in row 1: '00:00.5' is no date or time of day"),
        (
            [str(1000 * (k + (604_755 if k < 45 else 5000))) for k in range(90)],
            "in row 46: time goes back from 604799 s to 5045 s",
        ),
    ],
)
def test_a_clock_that_cannot_be_read_says_its_text(times: list[str], words: str, tmp_path: Path) -> None:
    lines = ["GPS time [ms],north,heading", *(f"{time},{200 - k},{k % 7}" for k, time in enumerate(times))]
    with pytest.raises(DataError, match="no column can be the clock: 'GPS time") as caught:
        recognise_log(log_of(tmp_path, lines))
    assert words in caught.value.message


@pytest.mark.parametrize("first", [3, 0])
def test_a_clock_of_numbers_that_lacks_some_or_all_is_named(first: int, tmp_path: Path) -> None:
    frame = pd.DataFrame({"time": np.arange(90.0), "north": np.arange(90.0) ** 2})
    frame.loc[first : 90 * (first == 0) + first, "time"] = np.nan
    frame.to_parquet(tmp_path / "log.parquet")
    with pytest.raises(DataError, match=f"'time' in row {first + 1}: no time here: remove the row"):
        recognise_log(tmp_path / "log.parquet")


def in_columns(frame: pd.DataFrame, fields: dict[str, str], begin: str = "2024-02-29T23:59:57.5") -> pd.DataFrame:
    """A log with its moments in columns: name -> what `strftime` makes of a moment, as a number."""
    moments = pd.Timestamp(begin) + pd.to_timedelta(frame["time"], "s")
    written = {name: moments.dt.strftime(form).astype(float) for name, form in fields.items()}
    return pd.concat([pd.DataFrame(written), frame.drop(columns="time")], axis=1)


@pytest.mark.parametrize(
    ("fields", "clock", "zero"),
    [
        (
            {"Year": "%Y", "Month": "%m", "Day": "%d", "Hour": "%H", "Minute": "%M", "Second": "%S.%f"},
            {"from": ["Hour", "Minute", "Second"], "date": ["Year", "Month", "Day"]},
            1709251197.5,
        ),
        (
            {"dd": "%d", "mm": "%m", "yy": "%y", "hh": "%H", "MM": "%M", "ss": "%S.%f"},
            {"from": ["hh", "MM", "ss"], "date": ["yy", "mm", "dd"]},
            1709251197.5,
        ),
        ({"Jahr": "%Y", "DOY": "%j", "Stunde": "%H", "Minute": "%M", "Sekunde": "%S.%f"}, {}, 1709251197.5),
        ({"UTC hour": "%H", "UTC minute": "%M", "UTC second": "%S.%f"}, {}, 86397.5),
    ],
)
def test_a_date_in_columns_is_the_clock(
    fields: dict[str, str], clock: dict[str, object], zero: float, tmp_path: Path
) -> None:
    sniffed = sniff(tmp_path, in_columns(TABLE, fields))
    np.testing.assert_allclose(sniffed.t, zero + T, atol=1e-5)
    assert sniffed.clock.items() >= clock.items()
    assert list(sniffed.columns) == ["N", "psi"]


@pytest.mark.parametrize(
    ("second", "asked"),
    [
        ({"Time 2": 2.0 * T}, True),
        ({"Time 2": np.where(np.arange(len(T)) < 15, 2.0 * T, np.nan)}, True),
        ({"Time 2": 1e3 * T}, False),  # milliseconds of the same clock
        ({"timestamp": 1.7e9 + T}, False),
        ({"Time received": T + 0.05 * np.sin(T)}, False),
    ],
)
def test_a_second_clock_that_goes_otherwise_is_asked(
    second: dict[str, np.ndarray], asked: bool, tmp_path: Path
) -> None:
    """Each channel of some recorders has a time beside it, and a row then holds moments that do not belong together."""
    long = np.arange(0.0, 100.0, 5.0)
    log = TABLE.assign(
        time=long, **{name: 10.0 * values if name != "timestamp" else values for name, values in second.items()}
    )
    log = log.assign(timestamp=1.7e9 + long) if "timestamp" in second else log
    doubts = sniff(tmp_path, log).doubts
    assert [doubt.partition(",")[0] for doubt in doubts] == [f"{next(iter(second))!r} is a clock"] * asked


@pytest.mark.parametrize(
    ("names", "unit", "rest"),
    [
        (("header.stamp.secs", "header.stamp.nsecs"), "s + ns", 1e-9),
        (("stamp.sec", "stamp.nanosec"), "s + ns", 1e-9),
        (("tv_sec", "tv_usec"), "s + us", 1e-6),
        (("seconds", "microseconds"), "s + us", 1e-6),
    ],
)
def test_a_clock_in_two_columns_is_read_beside_one_that_goes_back(
    names: tuple[str, str], unit: str, rest: float, tmp_path: Path
) -> None:
    """As ROS and C write it; the moments at which messages came are not in order."""
    rng = np.random.default_rng(3)
    t = 1_715_673_600 + np.cumsum(rng.uniform(0.05, 0.15, len(TABLE)))
    whole = np.floor(t)
    log = TABLE.drop(columns=[name for name in TABLE if name == "time"])
    log[names[0]], log[names[1]] = whole.astype(int), np.round((t - whole) / rest).astype(int)
    log["%time"] = np.round(1e9 * (t + rng.normal(0.0, 0.2, len(t)))).astype(np.int64)
    found = sniff(tmp_path, log)
    assert found.clock == {"from": [*names], "unit": unit}
    np.testing.assert_allclose(found.t, t, atol=2e-6)


def test_a_number_of_milliseconds_since_1970_may_have_decimals(tmp_path: Path) -> None:
    log = with_clock("stamp", list(1_715_673_600_000.5 + 100.0 * np.arange(600)))
    found = sniff(tmp_path, log)
    assert found.clock == {"from": "stamp", "unit": "ms"}
