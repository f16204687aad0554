"""Formats of text logs are recognised, and their clock and columns read as numbers."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from shipid.errors import DataError
from shipid.logs.formats import TextFormat
from shipid.logs.guess.columns import guess
from shipid.logs.guess.sniff import _is_time_of_day, cells, plain, sniff
from shipid.logs.mapping import clock_seconds
from shipid.logs.readers import read_table

T = np.arange(0.0, 10.0, 0.5)
TABLE = pd.DataFrame({"time": T, "N": 1.5 * T, "psi": 30.0 + T})
SUMMER_TIME_ENDS = [f"26.10.2025 02:{59 * (i < 10):02}:{(50 + i) % 60:02}" for i in range(len(T))]


def text(
    separator: str = ",", decimal: str = ".", above: str = "", table: pd.DataFrame = TABLE, header: bool = True
) -> str:
    return above + table.to_csv(index=False, sep=separator, decimal=decimal, header=header)


@pytest.mark.parametrize(
    ("content", "form"),
    [
        (text(), {"separator": ",", "decimal": ".", "skip_rows": 0}),
        (text(";"), {"separator": ";", "decimal": "."}),
        (text(";", ","), {"separator": ";", "decimal": ","}),
        (text("\t"), {"separator": "\t"}),
        (
            "\n".join(",".join(f'"{cell}"' for cell in line.split(";")) for line in text(";", ",").splitlines()),
            {"separator": ",", "decimal": ","},
        ),
        (text(above="Trial of the ship\nof last May\n"), {"separator": ",", "skip_rows": 2}),
        (
            "s,m,deg\n".join(text().split("\n", 1)).replace("psis", "psi\ns"),
            {"skip_rows": 2, "names": ["time [s]", "N [m]", "psi [deg]"]},
        ),
        (
            text(" ", above="# by numpy.savetxt\n# time N psi\n", header=False),
            {"separator": "whitespace", "skip_rows": 2, "names": ["time", "N", "psi"]},
        ),
        (
            text("\t", above="%\ttime\tN\tpsi\n%\ts\tm\tdeg\n", header=False),
            {"skip_rows": 2, "names": ["time [s]", "N [m]", "psi [deg]"]},
        ),
        (
            text("\t", above="% time N psi\n% s m deg\n", header=False),
            {"skip_rows": 2, "names": ["time [s]", "N [m]", "psi [deg]"]},
        ),
        (text(above="# time,N,psi\n", header=False), {"skip_rows": 0}),
        (
            text(" ", above="# time [s] N [m] psi [deg]\n", header=False),
            {"skip_rows": 1, "names": ["time[s]", "N[m]", "psi[deg]"]},
        ),
    ],
)
def test_a_text_log_is_recognised(content: str, form: dict[str, object], tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text(content)
    sniffed = sniff(file)
    assert sniffed.form.items() >= form.items()
    np.testing.assert_allclose(sniffed.t, T)
    assert [plain(name) for name in sniffed.columns] == ["n", "psi"]
    np.testing.assert_allclose(list(sniffed.columns.values()), [1.5 * T, 30.0 + T])


def test_cells_of_a_matlab_file_are_left_out_with_a_note(tmp_path: Path) -> None:
    file = tmp_path / "log.mat"
    savemat(
        file, {**{name: TABLE[name].to_numpy() for name in TABLE}, "rpm": TABLE["N"].to_numpy(dtype=object), "m": 3}
    )
    sniffed = sniff(file)
    assert list(sniffed.columns) == ["N", "psi"]
    assert sniffed.notes == (
        "'rpm' is an array of 20 cells, not a vector of numbers: save rpm = cell2mat(rpm), or datenum(rpm) of dates",
    )


def test_only_variables_that_must_be_saved_anew_have_a_note(tmp_path: Path) -> None:
    """Before, a matrix or a number had one, too, where its name held the word "save"."""
    file = tmp_path / "log.mat"
    columns = {name: TABLE[name].to_numpy() for name in TABLE}
    savemat(file, {**columns, "saved": np.ones((len(TABLE), 2)), "save_rate": 3.0})
    assert sniff(file).notes == ()


def test_a_log_without_a_header_has_numbers_or_the_names_that_are_given(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text(text(header=False))
    numbered = sniff(file)
    assert numbered.form["header"] is False
    assert all(name.isdecimal() for name in numbered.columns)
    assert list(sniff(file, ("clock", "N", "psi")).columns) == ["N", "psi"]


@pytest.mark.parametrize(
    ("encoding", "expected"),
    [("utf-8", "utf-8"), ("utf-8-sig", "utf-8-sig"), ("cp1252", "cp1252"), ("utf-16", "utf-16")],
)
def test_encodings(encoding: str, expected: str, tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_bytes(text(table=TABLE.rename(columns={"psi": "psi [°]"})).encode(encoding))
    sniffed = sniff(file)
    assert sniffed.form["encoding"] == expected
    assert "psi [°]" in sniffed.columns


@pytest.mark.parametrize(
    ("names", "encoding"),
    [
        (("時刻", "船首方位", "舵角"), "cp932"),
        (("时间", "艏向", "舵角"), "gb18030"),
        (("시간", "선수방위", "타각"), "cp949"),
        (("Время", "Курс", "Угол руля"), "cp1251"),
        (("時刻", "船首方位", "舵角"), "utf-8"),
    ],
)
def test_encodings_of_other_scripts(names: tuple[str, ...], encoding: str, tmp_path: Path) -> None:
    table = TABLE.set_axis(names, axis=1)
    (tmp_path / "log.csv").write_bytes(text(table=table).encode(encoding))
    sniffed = sniff(tmp_path / "log.csv")
    assert (sniffed.form["encoding"], sniffed.clock["from"]) == (encoding, names[0])
    assert tuple(sniffed.columns) == names[1:]
    pd.testing.assert_frame_equal(
        read_table(tmp_path / "log.csv", TextFormat(encoding=encoding), names[0]), table.astype(str)
    )


@pytest.mark.parametrize(
    ("clock", "unit", "t"),
    [
        ((1000 * T).astype(int), "ms", T),
        ((1e3 * (1.7e9 + 240 * T)).astype(np.int64), "ms", 1.7e9 + 240 * T),
        ((1e6 * T).astype(np.int64), "us", T),
        ((1e9 * (5.0 + T)).astype(np.int64), "ns", 5.0 + T),
        ((1e6 * (1.7e9 + T)).astype(np.int64), "us", 1.7e9 + T),
        ((1e9 * (1.7e9 + T)).astype(np.int64), "ns", 1.7e9 + T),
        (1.7e9 + T, "s", 1.7e9 + T),
        (pd.to_datetime(1.7e9 + T, unit="s").strftime("%Y-%m-%dT%H:%M:%S.%f"), "date", 1.7e9 + T),
    ],
)
def test_the_unit_of_the_clock(clock: object, unit: str, t: np.ndarray, tmp_path: Path) -> None:
    TABLE.assign(time=clock).to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert sniffed.clock == {"from": "time", "unit": unit}
    np.testing.assert_allclose(sniffed.t, t, atol=1e-6)


@pytest.mark.parametrize("step", [0.2, 1.0, 10.0])
@pytest.mark.parametrize("stored", ["csv", "parquet"])
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
    sniffed = sniff(tmp_path / "log")
    assert sniffed.clock == {"from": "time", "unit": "date"}
    np.testing.assert_allclose(sniffed.t, t + pd.Timestamp("2024-05-14 08:13:20").timestamp(), atol=5e-3)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_text_of_two_bytes_without_a_mark_is_read(encoding: str, tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_bytes("\n".join(["time,x", *(f"{k},{k % 7}.5" for k in range(80))]).encode(encoding))
    sniffed = sniff(file)
    assert sniffed.form["encoding"] == encoding
    np.testing.assert_array_equal(sniffed.t, np.arange(80))


def test_a_rudder_in_words_has_its_remedy(tmp_path: Path) -> None:
    rows = [f"{k},{'PS'[k % 2]}{k % 9}.5,A{k},{k % 3},{k % 5}" for k in range(80)]
    notes = sniff(log_of(tmp_path, ["time,Rudder,remark,x,y", *rows])).notes
    assert "column 'Rudder' holds words, not numbers, such as 'P0.5': write it as a number with a sign" in notes
    assert "column 'remark' holds words, not numbers" in notes


def test_many_lines_that_end_in_a_carriage_return_alone_are_read(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_bytes("\r".join(["time,x,y", *(f"{k},{k % 7}.5,1" for k in range(8000))]).encode())
    np.testing.assert_array_equal(sniff(file).t, np.arange(8000))


@pytest.mark.parametrize(("epoch", "who"), [(11_644_473_600, "Windows"), (62_135_596_800, ".NET")])
def test_ticks_of_100_ns_are_refused_with_what_to_write(epoch: int, who: str, tmp_path: Path) -> None:
    rows = [f"{(1_715_673_600 + k + epoch) * 10**7},{k % 7}" for k in range(80)]
    with pytest.raises(DataError, match=rf"as {who} does: write seconds since 1970, value / 1e7 - {epoch}"):
        sniff(log_of(tmp_path, ["Timestamp,x", *rows]))


def test_a_date_without_a_century_in_one_number_is_refused(tmp_path: Path) -> None:
    moments = pd.Timestamp("2024-05-14 08:13:20") + pd.to_timedelta(np.arange(200), "s")
    log = pd.DataFrame({"time": moments.strftime("%d%m%y%H%M%S"), "N": 1.0, "psi": 2.0})
    log.to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(DataError, match="'time' is a date and a time of day in one number, 140524081320: write 2024"):
        sniff(tmp_path / "log.csv")


@pytest.mark.parametrize("name", ["utc", "time", "t"])
@pytest.mark.parametrize("step", [0.2, 1.0, 10.0])
def test_hours_minutes_and_seconds_in_one_number_are_no_seconds(name: str, step: float, tmp_path: Path) -> None:
    t = step * np.arange(900)
    moments = pd.Timestamp("2024-05-14 08:13:20") + pd.to_timedelta(t, "s")
    log = pd.DataFrame({name: moments.strftime("%H%M%S.%f").str[:-4], "N": t, "psi": t})
    log.to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert sniffed.clock == {"from": name, "unit": "hhmmss"}
    np.testing.assert_allclose(sniffed.t, 8 * 3600 + 13 * 60 + 20 + t, atol=1e-6)


@pytest.mark.parametrize("step", [0.1, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 50.0, 60.0, 100.0])
@pytest.mark.parametrize("begin", [0.0, 37.0, 120.0, 86340.0, 123000.0])
def test_seconds_are_no_hours_minutes_and_seconds(step: float, begin: float) -> None:
    for count in (5, 40, 400):
        assert not _is_time_of_day(begin + step * np.arange(count))


START = pd.Timestamp("2024-05-14 08:00:05")
DAYS_OF = {
    "datenum": START.toordinal() + 366 + 8 / 24,
    "excel": (START - pd.Timestamp(1899, 12, 30)) / pd.Timedelta("1D"),
}
DAYS_OF["datenum"] += 5 / 86400


@pytest.mark.parametrize("unit", DAYS_OF)
@pytest.mark.parametrize("name", ["time", "Time [d]", "datenum", "t_days", "Time [days]"])
@pytest.mark.parametrize("step", [0.01, 0.5, 10.0])
def test_days_of_matlab_and_excel_are_known_by_their_size(unit: str, name: str, step: float, tmp_path: Path) -> None:
    """A double has such a day to 1e-5 s, a table to as much as it writes."""
    t = step * np.arange(60)
    table = pd.DataFrame({name: [f"{DAYS_OF[unit] + one / 86400:.10f}" for one in t], "N": t, "psi": t})
    table.to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert sniffed.clock == {"from": name, "unit": unit}
    np.testing.assert_allclose(sniffed.t, START.timestamp() + t, atol=3e-5)


@pytest.mark.parametrize("unit", DAYS_OF)
@pytest.mark.parametrize(("step", "digits"), [(0.25, 5), (0.5, 6), (1.0, 5)])
def test_rounded_days_keep_their_rate(unit: str, step: float, digits: int, tmp_path: Path) -> None:
    """Five digits of a day are 0.86 s: rows of 4 Hz appear three or four times at one time."""
    t = step * np.arange(400)
    stamps = [f"{DAYS_OF[unit] + one / 86400:.{digits}f}" for one in t]
    pd.DataFrame({"time": stamps, "N": t, "psi": t}).to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert sniffed.clock == {"from": "time", "unit": unit, "every": pytest.approx(step, rel=1e-3)}
    np.testing.assert_allclose(sniffed.t, START.timestamp() + t, atol=1.0)


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
        ("time_s", 45000.0 + T / 1e4, "s"),
        ("Time [s]", 738000.3 + T / 1e4, "s"),
        ("time", 738000.3 + T, "s"),
        ("time_s", 1.7e9 + 40 * T, "s"),  # since 1970, a row every 20 s
        ("time", 1.7e9 + 40 * T, "ms"),  # since 20 days, a row every 20 ms
    ],
)
def test_what_a_clock_counts_in(name: str, values: np.ndarray, unit: str, tmp_path: Path) -> None:
    table = TABLE.assign(time=values).rename(columns={"time": name})
    table.to_csv(tmp_path / "log.csv", index=False, float_format="%.10f")
    assert sniff(tmp_path / "log.csv").clock["unit"] == unit


def test_a_row_of_units_says_that_of_the_clock(tmp_path: Path) -> None:
    lines = ["time,u,v", "h,mph,mm/s", *(f"{k / 3600:.8f},{0.1 * k:.1f},{k}" for k in range(30))]
    sniffed = sniff(log_of(tmp_path, lines))
    assert sniffed.clock == {"from": "time [h]", "unit": "h"}
    np.testing.assert_allclose(sniffed.t, np.arange(30), atol=1e-4)
    assert list(sniffed.columns) == ["u [mph]", "v [mm/s]"]


@pytest.mark.parametrize("day", ["%d.%m.%Y", "%Y-%m-%d", "%Y/%m/%d", "%m/%d/%Y", "%d.%m.%y"])
def test_a_date_beside_times_of_day(day: str, tmp_path: Path) -> None:
    moments = pd.to_datetime(1.7e9 + T, unit="s")
    split = TABLE.assign(time=moments.strftime("%H:%M:%S.%f"))
    split.insert(0, "Day", moments.strftime(day))
    split.to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert sniffed.clock == {"from": "time", "unit": "date", "date": "Day"}
    np.testing.assert_allclose(sniffed.t, 1.7e9 + T, atol=1e-5)
    assert sniffed.notes == ()


def test_a_clock_rounded_to_seconds_has_its_rate(tmp_path: Path) -> None:
    t = np.arange(0.0, 60.0, 0.1)
    pd.DataFrame({"time": np.floor(t + 1e-9), "N": t, "psi": t}).to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert sniffed.clock == {"from": "time", "unit": "s", "every": 0.1}
    np.testing.assert_allclose(np.diff(sniffed.t), 0.1, rtol=1e-6)


def test_a_clock_is_preferred_by_its_name_and_to_numbers_of_rows(tmp_path: Path) -> None:
    counted = TABLE.rename(columns={"time": "time_s"})
    counted.insert(0, "row", range(len(T)))
    counted.to_csv(tmp_path / "log.csv", index=False)
    assert sniff(tmp_path / "log.csv").clock["from"] == "time_s"
    counted.rename(columns={"time_s": "x"}).assign(N=1.0, psi=2.0).to_csv(tmp_path / "log.csv", index=False)
    assert sniff(tmp_path / "log.csv").clock["from"] == "x"


def test_words_and_empty_columns_are_left_out_with_a_note(tmp_path: Path) -> None:
    TABLE.assign(mode="auto", spare=np.nan, N=TABLE["N"].where(T != 2.0)).to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert list(sniffed.columns) == ["N", "psi"]
    assert sniffed.notes == ("column 'mode' holds words, not numbers", "column 'spare' is empty")
    assert np.flatnonzero(np.isnan(sniffed.columns["N"])).tolist() == [4]
    assert not sniffed.scattered


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"\x00\x01\x02 binary", "a binary file of unknown format"),
        (b"a letter\nto the captain\nwith no numbers\n", "no table of numbers with any separator"),
        (text(table=TABLE.assign(time=np.minimum(T, 8.0), N=1.0, psi=1.0)).encode(), "'time' repeats in row 18"),
        (
            text(table=TABLE.assign(time=np.abs(T - 2.0), N=1.0, psi=1.0)).encode(),
            "'time' goes back from 2 s to 1.5 s in row 2",
        ),
        (
            text(table=TABLE.assign(time=SUMMER_TIME_ENDS)).encode(),
            "row 11: time goes back by an hour, from 2025-10-26 02:59:59 to 2025-10-26 02:00:00",
        ),
        (
            text(table=TABLE.assign(time=TABLE["time"].where(T != 1.0), N=1.0, psi=1.0)).encode(),
            "'time' has no value in row 3",
        ),
        (text(table=TABLE.assign(time=1.0, N=1.0, psi=1.0).rename(columns={"time": "x"})).encode(), "none rises"),
    ],
)
def test_what_is_no_log_is_one_sentence(content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_bytes(content)
    with pytest.raises(DataError, match=rf"log\.csv.*{message}"):
        sniff(tmp_path / "log.csv")


@pytest.mark.parametrize(
    ("first", "style", "jump", "words"),
    [
        (
            "2024-05-08 08:00",
            "%d/%m/%Y %H:%M:%S",
            0,
            "'08/05/2024 08:00:00' is read as 2024-05-08: or is it 2024-08-05",
        ),
        (
            "2024-05-08 08:00",
            "%m/%d/%Y %H:%M:%S",
            0,
            "'05/08/2024 08:00:00' is read as 2024-08-05: or is it 2024-05-08",
        ),
        ("2024-05-08 12:59:30", "%I:%M:%S", 0, "after 12:59:59 comes 01:00:00, read as 12 hours later"),
        ("2024-03-31 01:59:30", "%Y-%m-%d %H:%M:%S", 3600, "after 01:59:59 comes 03:00:00: is it local time"),
        ("2024-05-08 08:00", "%d.%m.%Y %H:%M:%S", 0, ""),
        ("2024-05-14 08:00", "%d/%m/%Y %H:%M:%S", 0, ""),
        ("2024-05-05 08:00", "%d/%m/%Y %H:%M:%S", 0, ""),
        ("2024-05-08 12:59:30", "%H:%M:%S", 0, ""),
        ("2024-05-08 23:59:30", "%H:%M:%S", 0, ""),
        ("2024-03-31 01:50:10", "%Y-%m-%d %H:%M:%S", 3605, ""),
    ],
)
def test_dates_that_may_be_other_moments_are_asked(
    first: str, style: str, jump: int, words: str, tmp_path: Path
) -> None:
    moments = pd.Timestamp(first) + pd.to_timedelta([k + jump * (k >= 30) for k in range(60)], "s")
    rows = [f"{one.strftime(style)},{k % 7}" for k, one in enumerate(moments)]
    doubts = sniff(log_of(tmp_path, ["time,x", *rows])).doubts
    assert [words in doubt for doubt in doubts] == [True] * bool(words)


def test_dates_that_rise_are_the_clock_beside_dates_that_go_back(tmp_path: Path) -> None:
    """A receiver's clock set back is no reason to refuse the logger's own."""
    table = TABLE.assign(
        time=SUMMER_TIME_ENDS, utc=pd.date_range("2025-10-26", periods=len(T), freq="500ms").astype(str)
    )
    (tmp_path / "log.csv").write_text(text(table=table))
    assert sniff(tmp_path / "log.csv").clock["from"] == "utc"


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"cannot be read \(No such file"):
        sniff(tmp_path / "gone.csv")


def test_cells_and_names() -> None:
    assert cells('1, "a b" ,', ",") == ["1", "a b", ""]
    assert cells(" 1   2\t3", "whitespace") == ["1", "2", "3"]
    assert plain(" Yaw-Rate (deg/s)") == "yaw_rate"


def log_of(tmp_path: Path, lines: list[str], name: str = "log.csv") -> Path:
    file = tmp_path / name
    file.write_text("\n".join(lines) + "\n")
    return file


@pytest.mark.parametrize("separator", [",", ";"])
def test_a_separator_between_quotes_is_part_of_a_name(separator: str, tmp_path: Path) -> None:
    """Such a header was taken for no header, and columns were called by their numbers."""
    names = ["time", f"Rudder angle [deg{separator} + port]", f"x{separator} y", "n"]
    rows = "".join(f"{t}{separator}{t % 7}{separator}1.5{separator}{t * t}\n" for t in range(50))
    header = separator.join(f'"{name}"' if separator in name else name for name in names)
    (tmp_path / "log.csv").write_text(f"{header}\n{rows}")
    sniffed = sniff(tmp_path / "log.csv")
    assert list(sniffed.columns) == names[1:]
    assert "header" not in sniffed.form


def test_rows_that_repeat_the_row_before_are_dropped_and_reported(tmp_path: Path) -> None:
    rows = [f"{0.2 * k:.1f},{np.sin(k):.3f},{np.cos(k):.3f}" for k in range(60)]
    twice = sorted(rows + rows[7:9], key=lambda row: float(row.split(",")[0]))
    sniffed = sniff(log_of(tmp_path, ["time,x,y", *twice]))
    assert sniffed.clock == {"from": "time", "unit": "s", "repeated": "drop"}
    np.testing.assert_allclose(sniffed.t, 0.2 * np.arange(60))
    assert all(len(values) == 60 for values in sniffed.columns.values())
    assert any("repeat" in note for note in sniffed.notes)


@pytest.mark.parametrize("seed", range(4))
def test_a_rounded_clock_keeps_its_rate_where_rows_are_lost(tmp_path: Path, seed: int) -> None:
    """Stamps of whole seconds at 2 or 4 Hz, some rows lost and a long pause: no instant is off by more than a step."""
    rng = np.random.default_rng(seed)
    every, count = (0.5, 0.25)[seed % 2], 900
    true = every * np.arange(count) + np.where(np.arange(count) < 500, 0.0, 300.0)
    true = true[rng.random(count) > 0.006]
    stamp = [f"{int(t // 3600) + 8:02d}:{int(t // 60) % 60:02d}:{int(t % 60):02d}" for t in true]
    x = rng.normal(size=len(true))
    sniffed = sniff(log_of(tmp_path, ["time,x", *(f"{s},{value:.4f}" for s, value in zip(stamp, x, strict=True))]))
    assert sniffed.clock["every"] == pytest.approx(every)
    off = sniffed.t - sniffed.t[0] - (true - true[0])
    assert np.ptp(off) < 1.0 + every, "within the rounding"
    assert (np.diff(sniffed.t) > 0).all()


@pytest.mark.parametrize("word", ["-999", "9999", "-99.0"])
def test_a_number_for_missing_values_is_reported_and_not_taken(tmp_path: Path, word: str) -> None:
    rows = [f"{k},{np.sin(k):.3f},{360 * ((0.01 * k) % 1):.1f}" for k in range(80)]
    rows[40] = f"40,{word},{word if word != '-99.0' else '144.0'}"
    sniffed = sniff(log_of(tmp_path, ["time,x,heading", *rows]))
    assert sniffed.form["missing"][-1] == word
    assert np.isnan(sniffed.columns["x"][40])
    assert np.nanmax(np.abs(sniffed.columns["heading"])) <= 360


@pytest.mark.parametrize("word", ["---", "N/A", "#N/A", "NULL", "None", "***", "--.-", "-1.#IND", "inf", "-nan"])
def test_a_word_for_nothing_is_declared_as_a_missing_value(tmp_path: Path, word: str) -> None:
    """Before, the draft could not be imported: this word is no number."""
    rows = [f"{k};{str(np.sin(k)).replace('.', ',')};{k % 360}" for k in range(80)]
    rows[40] = f"40;{word};{word}"
    sniffed = sniff(log_of(tmp_path, ["time;x;heading", *rows]))
    assert sniffed.form["missing"] == ["", "nan", "NaN", word]
    assert f"{word!r} stands for a value that is missing" in sniffed.notes
    assert all(np.flatnonzero(np.isnan(values)).tolist() == [40] for values in sniffed.columns.values())


@pytest.mark.parametrize(("name", "value"), [("heading", 511), ("SOG [kn]", 102.3), ("lat", 91), ("Longitude", 181)])
def test_what_ais_writes_for_nothing_is_a_missing_value(tmp_path: Path, name: str, value: float) -> None:
    """Before, a speed over ground was taken for one with a factor of 0.64."""
    held = [f"{12 + 5 * np.sin(k / 9):.1f}" if k % 20 else str(value) for k in range(80)]
    sniffed = sniff(log_of(tmp_path, [f"time,{name},rpm", *(f"{k},{one},{k % 3}" for k, one in enumerate(held))]))
    assert sniffed.form["missing"][-1] == str(value)
    assert np.isnan(sniffed.columns[name]).sum() == 4


@pytest.mark.parametrize(
    ("value", "others", "row", "lost"),
    [
        ("4095", [7.201, 6.12], 3, True),  # a counter of 12 bits at its end
        ("409.5", [*np.round(np.linspace(8.0, 12.0, 41), 1)], 3, True),
        ("409.5", [*np.round(np.linspace(108.0, 312.0, 41), 1)], 3, False),
        ("1023", [*np.round(np.linspace(0.0, 0.5, 41) ** 4, 4)], 3, True),  # a helm in rad, mostly amidships
        ("80", [0.0], 3, False),  # a thruster that is switched on
        ("80", [5.0], 3, False),
        ("80", [*np.round(np.linspace(0.0, 5.0, 41), 1)], 79, False),  # once
    ],
)
def test_a_number_far_beyond_all_others_again_and_again_is_a_missing_value(
    value: str, others: list[float], row: int, lost: bool, tmp_path: Path
) -> None:
    rows = [
        f"{k / 2},{k % 7},{value if k % 20 == row % 20 and k >= row else others[k % len(others)]}" for k in range(80)
    ]
    sniffed = sniff(log_of(tmp_path, ["time,psi,n", *rows]))
    assert np.isnan(sniffed.columns["n"]).any() == lost
    assert (value in sniffed.form.get("missing", [])) == lost
    rows[9] = f"4.5,{value},{others[0]}"  # of another column it is a value
    assert "missing" not in sniff(log_of(tmp_path, ["time,psi,n", *rows])).form


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("MMSI", ("219001234", "219009999"), "holds 2 ships ('MMSI' is 219001234, 219009999)"),
        ("mmsi", ("219001234", "219001234"), ""),
        ("IMO", ("9123456", "Unknown"), ""),
        ("Callsign", ("OXYZ", "OABC"), "holds 2 ships"),
    ],
)
def test_a_log_of_several_ships_is_refused(name: str, values: tuple[str, str], words: str, tmp_path: Path) -> None:
    rows = [f"{k},{values[k % 2]},{10 + k % 2},{np.sin(k):.3f}" for k in range(80)]
    log = log_of(tmp_path, [f"time,{name},lat,heading", *rows])
    if not words:
        assert "lat" in sniff(log).columns
        return
    with pytest.raises(DataError, match=f"{re.escape(words)}.*: write the rows of each ship to a separate log"):
        sniff(log)


def test_a_number_for_missing_values_is_one_in_every_column(tmp_path: Path) -> None:
    """In hundredths of a degree -999 is not far from the others, but the import takes it for a missing value."""
    rows = [f"{k},{np.sin(k):.3f},{400 * k}" for k in range(80)]
    rows[40] = "40,-999,-999"
    assert np.isnan(sniff(log_of(tmp_path, ["time,x,heading", *rows])).columns["heading"][40])


def test_a_speed_of_999_rpm_is_no_missing_value(tmp_path: Path) -> None:
    rows = [f"{k},{600 + 5 * k}" for k in range(80)] + ["80,999"]
    assert "missing" not in sniff(log_of(tmp_path, ["time,rpm", *rows])).form


@pytest.mark.parametrize("others", [(98,), (0,), (60, 99), (0, 55)])
def test_a_shaft_speed_of_99_rpm_is_no_missing_value(others: tuple[int, ...], tmp_path: Path) -> None:
    """Before, every row of 99 was taken out where the rest was 98, or stood."""
    speeds = np.repeat([*others, 99], 40)
    sniffed = sniff(log_of(tmp_path, ["time,heading,rpm", *(f"{k},{k % 360}.5,{n}" for k, n in enumerate(speeds))]))
    assert "missing" not in sniffed.form
    assert sniffed.columns["rpm"].tolist() == speeds.tolist()


def test_one_name_over_a_date_and_a_time(tmp_path: Path) -> None:
    lines = ["  time            east  north", "  -                 m      m"]
    lines += [f"2023-11-12 08:17:{k:02d}.5  {k}  {2 * k}" for k in range(30)]
    sniffed = sniff(log_of(tmp_path, lines, "log.dat"))
    assert sniffed.clock["date"] == "date"
    np.testing.assert_allclose(np.diff(sniffed.t), 1.0)
    assert list(sniffed.columns) == ["east [m]", "north [m]"]


@pytest.mark.parametrize("name", ["log.csv.gz", "log.csv.bz2", "log.csv.xz", "log.zip"])
def test_a_packed_log_is_named_as_one(name: str, tmp_path: Path) -> None:
    TABLE.to_csv(tmp_path / name, index=False)
    with pytest.raises(DataError, match=r"packed by|a ZIP archive") as caught:
        sniff(tmp_path / name)
    assert "unpack it" in caught.value.message


def test_a_column_of_yes_and_no_is_no_number(tmp_path: Path) -> None:
    TABLE.assign(rpm=T > 3).to_parquet(tmp_path / "log.parquet")
    sniffed = sniff(tmp_path / "log.parquet")
    assert "rpm" not in sniffed.columns
    assert any("'rpm' holds words" in note for note in sniffed.notes)


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
    file = tmp_path / "log.csv"
    with_clock(name, values).to_csv(file, index=False)
    sniffed = sniff(file)
    assert sniffed.clock == {"from": name, "unit": unit}
    np.testing.assert_allclose(np.diff(sniffed.t), 0.5, atol=1e-4)
    if unit == "date":
        assert sniffed.t[0] == pytest.approx(START_OF_DAY[0].timestamp())
        return
    read = clock_seconds(pd.read_csv(file)[name].to_numpy(float), unit)
    np.testing.assert_allclose(np.diff(read), 0.5, atol=1e-4)


@pytest.mark.parametrize(
    "write", ["{:g} sec", "{:g}s", lambda t: f"{t / 60:.9f} min", lambda t: f"0 days 00:{t // 60:02.0f}:{t % 60:09.6f}"]
)
def test_durations_as_text(write: Callable[[float], str] | str, tmp_path: Path) -> None:
    """As MATLAB writes those of a timetable, and pandas its own."""
    times = [write.format(0.5 * k) if isinstance(write, str) else write(0.5 * k) for k in range(600)]
    with_clock("Time", times).to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert sniffed.clock == {"from": "Time", "unit": "date"}
    np.testing.assert_allclose(sniffed.t, 0.5 * np.arange(600), atol=1e-6)


@pytest.mark.parametrize(("name", "digits"), [("Decimal year", 12), ("time", 12), ("Jahr", 12), ("time", 4)])
def test_a_year_with_decimals_is_no_clock_in_seconds(name: str, digits: int, tmp_path: Path) -> None:
    """With four digits an hour has one number, which repeats."""
    with_clock(name, [f"{2024.3655 + 0.5 * k / 366 / 86400:.{digits}f}" for k in range(600)]).to_csv(
        tmp_path / "log.csv", index=False
    )
    with pytest.raises(DataError, match=rf"'{name}' is a year with decimals, 2024.3655.*: write a date"):
        sniff(tmp_path / "log.csv")


@pytest.mark.parametrize(("size", "step"), [(2**16, 500), (2**32, 500_000)])
def test_a_counter_that_is_full_has_its_remedy(size: int, step: int, tmp_path: Path) -> None:
    """As of milliseconds in 16 bits, or microseconds in 32."""
    values = [(size - 100 * step + 7 + step * k) % size for k in range(600)]
    with_clock("time", values).assign(north=0.0).to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(DataError, match=rf"'time' is a counter that begins again at {size} in row 101: add {size}"):
        sniff(tmp_path / "log.csv")


def test_a_clock_that_goes_back_by_less_than_a_day_is_refused(tmp_path: Path) -> None:
    values = [86280 + 0.5 * k if k < 300 else 40000 + 0.5 * k for k in range(600)]
    with_clock("Seconds of day", values).assign(north=0.0).to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(DataError, match=r"goes back from .* in row 301"):
        sniff(tmp_path / "log.csv")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("# operator, zigzag,2", "holds '# operator' in row 31, a comment: remove the line"),
        ("2016-12-31T23:59:60Z,1,2", "a leap second: remove the line"),
        ("later,1,2", "holds 'later' in row 31, no time: remove the line"),
    ],
)
def test_a_line_without_a_time_is_named(line: str, words: str, tmp_path: Path) -> None:
    lines = ["time,north,heading", *(f"{k},{2 * k},0.1" for k in range(60))]
    with pytest.raises(DataError) as caught:
        sniff(log_of(tmp_path, [*lines[:31], line, *lines[31:]]))
    assert words in caught.value.message


@pytest.mark.parametrize("time", ["", "---"])
def test_a_time_that_is_missing_beside_dates_is_named(time: str, tmp_path: Path) -> None:
    """Not the dates, that repeat from row to row."""
    rows = [f"2024/05/14,{time if k == 30 else f'08:00:{k:02}'},{2 * k},0.1" for k in range(60)]
    with pytest.raises(DataError, match="'Time' has no value in row 31"):
        sniff(log_of(tmp_path, ["Date,Time,north,heading", *rows]))


def test_a_line_below_times_of_day_is_named(tmp_path: Path) -> None:
    """The first row has a time that can be read: it was said to have none."""
    lines = ["Time,north,heading", *(f"08:00:{k:02},{2 * k},0.1" for k in range(60)), "Average,59,0.1"]
    with pytest.raises(DataError, match="holds 'Average' in row 61, no time: remove the line"):
        sniff(log_of(tmp_path, lines))
    moments = [f"2024-05-14 {line}" for line in lines[1:-1]]
    for below, which in (
        ("Run,1,2", "the line"),
        ("Run,1,2\n1,1,2\n2,1,2", "the 3 such lines"),
    ):  # a number made it no column of dates
        with pytest.raises(DataError, match=f"holds 'Run' in row 61, no time: remove {which}"):
            sniff(log_of(tmp_path, [lines[0], *moments, below]))


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (
            [f"14/05/2024 08.{k // 60:02}.{k % 60:02}" for k in range(90)],
            "holds '14/05/2024 08.00.00' in row 1, no number",
        ),
        ([f'"{k:,.1f}"' for k in range(680, 1070)], "'1,000.0' in row 321: take the mark of thousands out of the log"),
        ([str(k) if k % 9 != 8 else "late" for k in range(90)], "'late' in row 9, no time: remove the 10 such lines"),
        ([f"{1.715e12 + 500 * k:.5E}" for k in range(90)], "'1.71500E+12' in row 1, with too few digits: export it"),
        (
            [f"{k // 60:02}:{k % 60:02}.5" for k in range(90)],
            "'00:00.5' in row 1, without the hour, as Excel shows times",
        ),
        (
            [str(1000 * (k + (604_755 if k < 45 else 5000))) for k in range(90)],
            "goes back from 604799 s to 5045 s in row 46",
        ),
    ],
)
def test_a_clock_that_cannot_be_read_says_its_text(times: list[str], words: str, tmp_path: Path) -> None:
    lines = ["GPS time [ms],north,heading", *(f"{time},{200 - k},{k % 7}" for k, time in enumerate(times))]
    with pytest.raises(DataError, match="no column can be the clock: 'GPS time") as caught:
        sniff(log_of(tmp_path, lines))
    assert words in caught.value.message


def test_the_header_again_and_lines_of_words_are_left_out(tmp_path: Path) -> None:
    lines = ["time,north,heading", *(f"{k},{2 * k},0.1" for k in range(60))]
    file = log_of(tmp_path, [*lines[:20], "# zigzag", *lines[20:40], lines[0], *lines[40:]])
    sniffed = sniff(file)
    assert sniffed.form["ragged"] == "drop"
    assert sniffed.notes == (
        "2 lines repeat the header or have another number of cells, the first is line 21: left out",
    )
    np.testing.assert_array_equal(sniffed.t, np.arange(60.0))
    with pytest.raises(DataError, match="repeats the header: remove the line") as caught:
        read_table(log_of(tmp_path, [*lines[:40], lines[0], *lines[40:]]), TextFormat(), "time")
    assert caught.value.path == "line 41"


def test_rows_in_too_short_a_time_name_the_clock(tmp_path: Path) -> None:
    frame = pd.DataFrame({"t": 1e-5 * np.arange(6), "N": np.arange(6.0), "E": 0.0, "heading": 0.1})
    frame.to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(DataError, match=r"6 rows over 5e-05 s are too few .* is 't' the clock, in s\?"):
        guess(tmp_path / "log.csv")


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
    file = tmp_path / "log.csv"
    in_columns(TABLE, fields).to_csv(file, index=False)
    sniffed = sniff(file)
    np.testing.assert_allclose(sniffed.t, zero + T, atol=1e-5)
    assert sniffed.clock.items() >= clock.items()
    assert list(sniffed.columns) == ["N", "psi"]


def test_a_date_in_columns_without_names_is_the_clock(tmp_path: Path) -> None:
    """As datevec of MATLAB has it, beside a count of rows."""
    fields = {"Year": "%Y", "Month": "%m", "Day": "%d", "Hour": "%H", "Minute": "%M", "Second": "%S.%f"}
    log = in_columns(TABLE, fields)
    log.insert(0, "row", range(1, 1 + len(log)))
    log.to_csv(tmp_path / "log.csv", index=False, header=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert (sniffed.clock["from"], sniffed.clock["date"]) == (["5", "6", "7"], ["2", "3", "4"])
    np.testing.assert_allclose(sniffed.t, 1709251197.5 + T, atol=1e-5)
    assert list(sniffed.columns) == ["1", "8", "9"]


def test_a_date_in_columns_beside_a_time_of_day(tmp_path: Path) -> None:
    log = in_columns(TABLE, {"Day": "%d", "Month": "%m", "Year": "%Y"})
    moments = pd.Timestamp("2024-02-29T23:59:57.5") + pd.to_timedelta(T, "s")
    log.assign(Time=moments.strftime("%H:%M:%S.%f")).to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert sniffed.clock == {"from": "Time", "unit": "date", "date": ["Year", "Month", "Day"]}
    np.testing.assert_allclose(sniffed.t, 1709251197.5 + T, atol=1e-5)


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        (("Lat deg", "Lat min"), {"Lat deg + Lat min": ("Lat deg", "Lat min")}),
        (("Latitude (deg)", "Latitude (')", 'Latitude (")'), {}),
        (("LatD", "LatM", "LatS"), {}),
        (("Lat 1", "Lat 2"), None),
    ],
)
def test_degrees_and_minutes_in_columns(
    names: tuple[str, ...], columns: dict[str, tuple[str, ...]] | None, tmp_path: Path
) -> None:
    """Not two latitudes of two receivers."""
    size = 33.3 + 1e-4 * T
    parts = [-np.floor(size), np.floor(size % 1 * 60), size % 1 * 60 % 1 * 60]
    parts = [parts[0], size % 1 * 60] if len(names) == 2 else parts
    parts = [-size, -size] if columns is None else parts
    TABLE.assign(**dict(zip(names, parts, strict=True))).to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert sniffed.in_parts == (columns or {} if columns is None else columns or {" + ".join(names): names})
    if columns is not None:
        np.testing.assert_allclose(sniffed.columns[" + ".join(names)], -size)
        assert not set(names) & set(sniffed.columns)


@pytest.mark.parametrize(
    ("names", "made"),
    [
        (("Latitude", "Longitude"), {}),
        (("Position",), {"Position latitude": ("Position",), "Position longitude": ("Position",)}),
        (("Latitude", "remark"), {}),
    ],
)
@pytest.mark.parametrize("nothing", ["", "---"])
def test_positions_as_text(
    names: tuple[str, ...], made: dict[str, tuple[str, ...]], nothing: str, tmp_path: Path
) -> None:
    degrees = -33.3 + 1e-4 * T
    south = [f"{-one:.0f}°{-one % 1 * 60:.5f}'S" for one in degrees]
    texts = [south, [f"010°{one % 1 * 60:.5f}'E" for one in degrees]]
    texts = [[f"{one} {other}" for one, other in zip(*texts, strict=True)]] if len(names) == 1 else texts
    texts[0][3] = nothing
    TABLE.assign(**dict(zip(names, texts, strict=True))).to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert sniffed.in_parts == made
    assert sniffed.sides == ({"S", "E"} if names[-1] != "remark" else {"S"})
    latitude = sniffed.columns["Position latitude" if made else "Latitude"]
    np.testing.assert_allclose(np.delete(latitude, 3), np.delete(degrees, 3), atol=1e-7)
    assert np.isnan(latitude[3])
    assert ("remark" in sniffed.words) == ("remark" in names)
    assert not any("Latitude" in note or "Position" in note for note in sniffed.notes)


@pytest.mark.parametrize(
    ("above", "names"),
    [
        ("time,GPS,\n,N,psi\n", ["time", "GPS N", "GPS psi"]),
        ("time,GPS,\n,North,Heading\ns,m,deg\n", ["time [s]", "GPS North [m]", "GPS Heading [deg]"]),
        ("time,North,Heading\nT01,AI02,AI03\n", ["time", "North", "Heading"]),
        ("T01,AI02,AI03\ntime,North,Heading\n", None),
        ("time,Wind,Wind\n,Speed,Direction\n", ["time", "Wind Speed", "Wind Direction"]),
        ("time,North,Heading\ns,m,deg\nDOUBLE,DOUBLE,DOUBLE\n", ["time [s]", "North [m]", "Heading [deg]"]),
        ("s,m,deg\ntime,North,Heading\n", ["time [s]", "North [m]", "Heading [deg]"]),
        ("Trial,Ada,\ntime,North,Heading\n", None),
    ],
)
def test_names_in_several_lines(above: str, names: list[str] | None, tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text(text(above=above, header=False))
    sniffed = sniff(file)
    assert sniffed.form.get("names") == names
    assert [sniffed.clock["from"], *sniffed.columns] == (names or ["time", "North", "Heading"])
    np.testing.assert_allclose(list(sniffed.columns.values()), [1.5 * T, 30.0 + T])


def test_a_table_beside_the_first_lines_is_left_out(tmp_path: Path) -> None:
    """A block of statistics has made the header longer than the rows, and the names of the log were lost."""
    lines = text().splitlines()
    beside = ["channel,mean", "psi,34.75", "N,7.1"]
    lines = [",".join([line, "", *beside[i : i + 1]]) if i < len(beside) else line for i, line in enumerate(lines)]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    sniffed = sniff(tmp_path / "log.csv")
    assert list(sniffed.columns) == ["N", "psi"]
    np.testing.assert_allclose(sniffed.columns["psi"], 30.0 + T[2:])
    assert any("2 lines repeat the header or have another number of cells" in note for note in sniffed.notes)
    table = read_table(tmp_path / "log.csv", TextFormat.model_validate(sniffed.form), "time")
    np.testing.assert_allclose(table["psi"].astype(float), 30.0 + T[2:])


def test_words_beside_the_first_lines_are_no_header(tmp_path: Path) -> None:
    """Notes on the weather, on the right, have made the third line one of names, such as 0.5 and 30.5."""
    lines = text().splitlines()
    beside = ["Weather", "Sea state 2", "Depth 54 m"]
    lines = [f"{line},,{beside[i] if i < len(beside) else ''}" for i, line in enumerate(lines)]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    sniffed = sniff(tmp_path / "log.csv")
    assert list(sniffed.columns)[:2] == ["N", "psi"]
    np.testing.assert_allclose(sniffed.columns["psi"], 30.0 + T)


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
    log.to_csv(tmp_path / "log.csv", index=False)
    doubts = sniff(tmp_path / "log.csv").doubts
    assert [doubt.partition(",")[0] for doubt in doubts] == [f"{next(iter(second))!r} is a clock"] * asked


@pytest.mark.parametrize(
    ("decimal", "mark", "separator"),
    [
        (".", ",", ";"),
        (",", ".", ";"),
        (".", "'", ","),
        (",", " ", ";"),
        (",", "\u00a0", "\t"),
        (".", ",", ","),
        (".", ",", "\t"),
    ],
)
@pytest.mark.parametrize("digits", [0, 2])
def test_marks_of_thousands_are_read(decimal: str, mark: str, separator: str, digits: int, tmp_path: Path) -> None:
    """Also of whole numbers, as 1,800 rpm, where the positions show which sign is the decimal one."""

    def written(value: float) -> str:
        text = f"{value:,.{digits}f}"
        return text.replace(",", "#").replace(".", decimal).replace("#", mark)

    large = np.round(7_034_120.4 + 97.3 * T * (-1) ** np.arange(len(T)), digits) if digits else np.round(1800 + 3 * T)
    table = TABLE.assign(lat=63.4399978 + 1e-5 * T, N=[written(one) for one in large])
    table.to_csv(tmp_path / "log.csv", index=False, sep=separator, decimal=decimal)
    sniffed = sniff(tmp_path / "log.csv")
    assert sniffed.form.items() >= {"decimal": decimal, "thousands": mark, "separator": separator}.items()
    np.testing.assert_allclose(sniffed.columns["N"], large)
    np.testing.assert_allclose(sniffed.columns["lat"], table["lat"])


@pytest.mark.parametrize("decimal", [".", ","])
def test_three_decimals_are_no_groups(decimal: str, tmp_path: Path) -> None:
    """1,800 is 1.8 where nothing in the log says that it is 1800."""
    table = TABLE.assign(time=TABLE["time"] + 1.0)
    table.to_csv(tmp_path / "log.csv", index=False, sep=";", decimal=decimal, float_format="%.3f")
    sniffed = sniff(tmp_path / "log.csv")
    assert "thousands" not in sniffed.form
    np.testing.assert_allclose(list(sniffed.columns.values()), [1.5 * T, 30.0 + T])


@pytest.mark.parametrize(
    "value", ["32767", "-32768", "65535", "-999.25", "1e+20", "2147483647", "9.96921e+36", "327.67"]
)
def test_what_recorders_write_for_no_value_is_missing(value: str, tmp_path: Path) -> None:
    """The largest number of an integer of 16 or 32 bits, perhaps in tenths, and what netCDF and well logs have."""
    table = TABLE.assign(rudder=np.sin(T)).astype(object)
    table.loc[4:7, "rudder"] = value
    table.to_csv(tmp_path / "log.csv", index=False)
    sniffed = sniff(tmp_path / "log.csv")
    assert value in sniffed.form["missing"]
    assert np.flatnonzero(np.isnan(sniffed.columns["rudder"])).tolist() == [4, 5, 6, 7]


@pytest.mark.parametrize(
    ("name", "others", "asked"),
    [
        ("SOG", 5.0 + 0.1 * T, True),
        ("SOG", np.floor(T), False),  # one knot astern
        ("heading", 300.0 + T, True),
        ("heading", 3.0 + T, False),
        ("shaft rpm", 140.0 + T, True),
        ("shaft rpm", T, False),
        ("rudder", 5.0 + T, False),
    ],
)
def test_minus_one_is_asked_where_nothing_else_is_negative(
    name: str, others: np.ndarray, asked: bool, tmp_path: Path
) -> None:
    values = np.where(np.isin(np.arange(len(T)), (3, 11)), -1.0, others)
    TABLE.drop(columns="psi").assign(**{name: values}).to_csv(tmp_path / "log.csv", index=False)
    doubts = sniff(tmp_path / "log.csv").doubts
    assert [doubt.partition(" and ")[0] for doubt in doubts] == [f"{name!r} is -1 in 2 rows"] * asked


@pytest.mark.parametrize("more", ["", ",192"])
def test_a_row_for_each_value_is_named(more: str, tmp_path: Path) -> None:
    """As historians write: what the value is stands in a cell beside it."""
    tags = ("GPS1.LAT", "GPS1.LON", "GYRO1.HDG", "STG.RUDDER")
    rows = [f"2024-05-14 08:00:{t:02},{tag},{t + k / 7:.3f}{more}" for t in range(50) for k, tag in enumerate(tags)]
    with pytest.raises(
        DataError, match=r"a row for each value, called 'GPS1.LAT', 'GPS1.LON', .*: write a row for each"
    ):
        sniff(log_of(tmp_path, [f"Timestamp,Tag,Value{',Quality' * bool(more)}", *rows]))


def test_a_header_longer_than_its_rows_keeps_its_names(tmp_path: Path) -> None:
    """As LabVIEW writes: a column of comments has a name and no cells."""
    lines = text().splitlines()
    sniffed = sniff(log_of(tmp_path, [f"{lines[0]},,Comment", *lines[1:]]))
    assert list(sniffed.columns) == ["N", "psi"]
