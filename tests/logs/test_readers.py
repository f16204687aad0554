"""One motion, written in every format a log may have, comes back as the same dataset."""

import os
import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from shipid.errors import DataError, DocumentError
from shipid.logs import readers
from shipid.logs.guess.sniff import sniff
from shipid.logs.importing import import_log, read_mapping
from shipid.logs.readers import (
    READERS,
    NmeaFormat,
    ParquetFormat,
    TextFormat,
    date_of,
    moment_of,
    read_table,
    require_file,
    seconds,
    span_of,
    widest,
)
from shipid.logs.workbook import WIDEST
from tests.logs.conftest import PLAIN, as_log, turning

Write = Callable[..., Path]
T = np.arange(0.0, 60.0, 0.5)
STATES = ["t", "north", "east", "psi", "u", "v", "r", "propeller.n"]
NAMES = ["time", "N", "E", "heading", "u", "v", "rot", "rpm"]


@pytest.fixture
def log(tmp_path: Path) -> pd.DataFrame:
    return pd.read_csv(as_log(turning(T), tmp_path / "plain.csv"))


def mapping_with(tmp_path: Path, form: str, *changes: tuple[str, str]) -> Path:
    text = PLAIN.read_text().replace("[clock]", f"[format]\n{form}\n[clock]")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "mapping.toml"
    file.write_text(text)
    return file


def assert_is_the_motion(mapping: Path, file: Path) -> None:
    frame = import_log(read_mapping(mapping), file).frame
    motion = turning(T).rename(columns={"port.n": "propeller.n"})
    for name in STATES:
        np.testing.assert_allclose(frame[name], motion[name], atol=1e-6, err_msg=name)


TEXTS: dict[str, tuple[str, Callable[[pd.DataFrame, Path], object]]] = {
    "tabs": ('separator = "\\t"', lambda f, p: f.to_csv(p, sep="\t", index=False)),
    "semicolons and decimal commas": (
        'separator = ";"\ndecimal = ","',
        lambda f, p: f.to_csv(p, sep=";", decimal=",", index=False),
    ),
    "blanks": ('separator = "whitespace"', lambda f, p: p.write_text(f.to_string(index=False))),
    "utf-16": ('encoding = "utf-16"', lambda f, p: f.to_csv(p, encoding="utf-16", index=False)),
    "lines before the header": (
        "skip_rows = 2",
        lambda f, p: p.write_text("R/V Ferry\n27 October\n" + f.to_csv(index=False)),
    ),
    "names in the mapping": (f"names = {NAMES}", lambda f, p: f.to_csv(p, index=False, header=False)),
    "parquet": ('kind = "parquet"', lambda f, p: f.to_parquet(p)),
    "matlab": ('kind = "mat"', lambda f, p: savemat(p, {name: f[name].to_numpy() for name in f}, appendmat=False)),
}


@pytest.mark.parametrize("name", TEXTS)
def test_format(name: str, log: pd.DataFrame, tmp_path: Path) -> None:
    form, write = TEXTS[name]
    write(log, tmp_path / "log")
    assert_is_the_motion(mapping_with(tmp_path, form), tmp_path / "log")


def test_column_numbers(log: pd.DataFrame, tmp_path: Path) -> None:
    log.to_csv(tmp_path / "log", index=False, header=False)
    changes = [(f'from = "{name}"', f'from = "{number}"') for number, name in enumerate(NAMES, start=1)]
    assert_is_the_motion(mapping_with(tmp_path, "header = false", *changes), tmp_path / "log")


def test_matlab_structs_and_matrices(log: pd.DataFrame, tmp_path: Path) -> None:
    log_struct = {"t": log["time"].to_numpy(), "xy": log[["N", "E"]].to_numpy(), "note": "sea state 2", "scale": 3.0}
    others = {name: log[name].to_numpy() for name in NAMES[3:]}
    savemat(tmp_path / "log.mat", {"log": log_struct, "gps": np.arange(7.0), **others})
    changes = [('"time"', '"log.t"'), ('"N"', '"log.xy.1"'), ('"E"', '"log.xy.2"')]
    assert_is_the_motion(mapping_with(tmp_path, 'kind = "mat"', *changes), tmp_path / "log.mat")


def cells(values: np.ndarray) -> np.ndarray:
    array = np.empty(len(values), dtype=object)
    array[:] = list(values)
    return array


NO_VECTORS: dict[str, tuple[Any, str]] = {
    "cells": (cells(T), r"'rpm' is an array of 120 cells, not a vector of numbers: save rpm = cell2mat\(rpm\)"),
    "text": ("120 rpm", "'rpm' is text, not a vector of numbers: save str2double"),
    "complex": (T + 1j, r"'rpm' is complex, not a vector of real numbers: save real\(rpm\)"),
    "of another length": (T[:7], "'rpm' is of 7 values, and 'time' has 120"),
    "a single number": (2.0, "'rpm' is a single number, not a vector"),
    "a matrix": (np.stack([T, T], axis=1), r"'rpm' is a matrix: its columns are rpm\.1 to rpm\.2"),
    "of three axes": (np.zeros((120, 2, 2)), "'rpm' is an array of 120 x 2 x 2, not a vector or matrix"),
}


@pytest.mark.parametrize("name", NO_VECTORS)
def test_a_matlab_variable_that_is_no_vector_is_named(name: str, log: pd.DataFrame, tmp_path: Path) -> None:
    value, message = NO_VECTORS[name]
    savemat(tmp_path / "log.mat", {**{name: log[name].to_numpy() for name in log}, "rpm": value})
    with pytest.raises(DataError, match=message) as caught:
        import_log(read_mapping(mapping_with(tmp_path, 'kind = "mat"')), tmp_path / "log.mat")
    assert caught.value.path == "columns.propeller.n.from"


def test_a_matlab_array_of_structs_is_named(log: pd.DataFrame, tmp_path: Path) -> None:
    """Alone it is all that the file holds; beside vectors its fields are columns that the mapping may name."""
    rows = log.to_records(index=False)
    file = tmp_path / "log.mat"
    savemat(file, {"log": rows})
    message = r"no variable .* 'log' is an array of 120 structs, .* such as s\.time = \[log\.time\]"
    with pytest.raises(DataError, match=message):
        read_table(file, readers.MatFormat(kind="mat"), "time")
    savemat(file, {**{name: log[name].to_numpy() for name in log}, "log": rows})
    changes = [('from = "rpm"', 'from = "log.rpm"')]
    with pytest.raises(DataError, match=r"'log\.rpm' is in an array of structs: save"):
        import_log(read_mapping(mapping_with(tmp_path, 'kind = "mat"', *changes)), file)


def test_a_matlab_object_of_a_class_is_named() -> None:
    """As scipy returns a datetime: its name, the system of types, its class and numbers."""
    kind = [("s0", "O"), ("s1", "O"), ("s2", "O"), ("arr", "O")]
    opaque = np.array([(b"t", b"MCOS", b"datetime", np.zeros(6))], dtype=kind)
    ((name, what, remedy),) = readers._no_vectors({"None": opaque, "__function_workspace__": np.zeros(3)})
    assert name == "t"
    assert what == "an object of class datetime, not a vector of numbers"
    assert remedy.startswith("save seconds(t - t(1))")


def test_a_matlab_file_of_version_7_3_has_its_remedy(tmp_path: Path) -> None:
    """As MATLAB writes its first 128 bytes: text, no subsystem, version 0x0200, byte order; HDF5 follows."""
    (tmp_path / "log.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM" + bytes(600))
    with pytest.raises(DataError, match=r"a MATLAB file of version 7\.3: save it with") as caught:
        import_log(read_mapping(mapping_with(tmp_path, 'kind = "mat"')), tmp_path / "log.mat")
    assert caught.value.path == "format.kind"


def test_dates(log: pd.DataFrame, tmp_path: Path) -> None:
    since = pd.Timestamp("2022-10-27T08:00:00Z")
    log.assign(time=[(since + pd.Timedelta(seconds=t)).isoformat() for t in log["time"]]).to_csv(tmp_path / "log")
    mapping = mapping_with(tmp_path, "", ('from = "time"', 'from = "time"\nunit = "date"'))
    frame = import_log(read_mapping(mapping), tmp_path / "log").frame
    np.testing.assert_allclose(frame["t"] - 1666857600.0, T, atol=1e-5)  # date -u -d 2022-10-27T08:00 +%s


@pytest.mark.parametrize(
    ("style", "unix"),
    [
        ("%d.%m.%Y %H:%M:%S.%f", True),
        ("%Y/%m/%d %H:%M:%S.%f", True),
        ("%Y-%m-%d %H:%M:%S.%f", True),
        ("%d.%m.%y %H:%M:%S.%f", True),
        ("%d/%m/%Y %H:%M:%S.%f", True),
        ("%m/%d/%Y %H:%M:%S.%f", True),
        ("%m/%d/%Y %I:%M:%S.%f %p", True),
        ("%d-%m-%Y %I:%M:%S.%f %p", True),
        ("%d-%b-%Y %H:%M:%S.%f", True),
        ("%d %b %Y %H:%M:%S.%f", True),
        ("%y/%m/%d %H:%M:%S.%f", True),
        ("%d/%m/%Y, %H:%M:%S.%f", True),
        ("%m/%d/%Y, %I:%M:%S.%f %p", True),
        ("%Y%m%d%H%M%S.%f", True),
        ("%Y%m%d%H%M%S%f", True),
        ("%Y%m%d_%H%M%S.%f", True),
        ("%Y-%m-%d %H:%M:%S.%f UTC", True),
        ("%d.%m.%Y %H:%M:%S.%f GMT", True),
        ("%H:%M:%S.%f UTC", False),
        ("%H:%M:%S.%f", False),
        ("%I:%M:%S.%f %p", False),
    ],
)
def test_dates_as_they_are_written(style: str, unix: bool) -> None:
    """From a minute before midnight; a time of day goes on after it."""
    moments = pd.Timestamp("2022-10-26T23:59:30.5") + pd.to_timedelta(T, "s")
    times = seconds(pd.Series(moments.strftime(style)))
    np.testing.assert_allclose(times, T + (1666828770.5 if unix else 86370.5), atol=1e-5)


def test_few_ways_of_writing_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each costs milliseconds, in each of two thousand files of a folder: only those are tried that a text may have."""
    tried: list[str] = []
    by_pandas = readers._moments
    monkeypatch.setattr(readers, "_moments", lambda texts, way: tried.append(way) or by_pandas(texts, way))
    for way in readers.WAYS:
        tried.clear()
        moments = pd.Timestamp("2022-10-26T23:40:30.5") + pd.to_timedelta(T * 20, "s")
        assert way in readers.ways_of(pd.Series(moments.strftime(way.replace("%S", "%S.%f"))))
        assert len(tried) <= 8, way
    tried.clear()
    assert readers.ways_of(pd.Series(moments.strftime("%Y-%m-%d %H:%M:%S"))) == []
    assert tried == []


@pytest.mark.parametrize("kind", ["int64", "float64"])
def test_dates_in_one_number(kind: str) -> None:
    moments = pd.Timestamp("2022-10-26T23:59:30") + pd.to_timedelta(np.arange(90), "s")
    times = seconds(pd.Series(moments.strftime("%Y%m%d%H%M%S").astype("int64").astype(kind)))
    assert times.tolist() == (1666828770 + np.arange(90)).tolist()


TWICE = {
    "date": ("%Y-%m-%d %H:%M:%S.%f", "2024-10-27 02:59:59 to 2024-10-27 02:00:00"),
    "time of day": ("%H:%M:%S.%f", "02:59:59 to 02:00:00"),
    "time of day, of twelve hours": ("%I:%M:%S.%f %p", "02:59:59 to 02:00:00"),
    "hhmmss": ("%H%M%S.%f", "02:59:59 to 02:00:00"),
    "whole minutes": ("%H:%M", "02:59:00 to 02:00:00"),
}


@pytest.mark.parametrize("every", ["", "\nevery = 0.5"])
@pytest.mark.parametrize("name", TWICE)
def test_an_hour_that_occurs_twice_is_refused(name: str, every: str, log: pd.DataFrame, tmp_path: Path) -> None:
    """Half a minute before the clocks of Berlin were set back to half a minute after."""
    style, span = TWICE[name]
    moments = pd.Timestamp("2024-10-27T00:59:30Z").tz_convert("Europe/Berlin") + pd.to_timedelta(T, "s")
    log.assign(time=moments.strftime(style)).to_csv(tmp_path / "log.csv", index=False)
    unit = "hhmmss" if name == "hhmmss" else "date"
    mapping = mapping_with(tmp_path, "", ('from = "time"', f'from = "time"\nunit = "{unit}"{every}'))
    message = f"time goes back by an hour, from {span}: is it local time as daylight saving ends"
    with pytest.raises(DataError, match=message) as caught:
        import_log(read_mapping(mapping), tmp_path / "log.csv")
    assert caught.value.path == "row 61"
    if name != "hhmmss":  # numbers that go back may be anything
        with pytest.raises(DataError, match=message) as caught:
            sniff(tmp_path / "log.csv")
        assert caught.value.path == "row 61"


@pytest.mark.parametrize("style", ["%Y-%m-%dT%H:%M:%S.%f%z", "%H:%M:%S.%f"])
def test_the_end_of_daylight_saving_in_times_that_say_their_zone_or_are_utc(style: str) -> None:
    zone = "Europe/Berlin" if "z" in style else "UTC"
    moments = pd.Timestamp("2024-10-27T00:59:30Z").tz_convert(zone) + pd.to_timedelta(T, "s")
    np.testing.assert_allclose(np.diff(seconds(pd.Series(moments.strftime(style)))), 0.5, atol=1e-6)


@pytest.mark.parametrize("style", ["%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S"])
def test_of_day_and_month_that_is_taken_with_which_the_log_is_short(style: str) -> None:
    """From 5 June to 6 June, not from 6 May; and where nothing decides, the day comes first."""
    moments = pd.Timestamp("2025-06-05T23:59:00") + pd.to_timedelta(10.0 * np.arange(20), "s")
    times = seconds(pd.Series(moments.strftime(style)))
    np.testing.assert_allclose(np.diff(times), 10.0)
    one_day = seconds(pd.Series(["05/06/2025 10:00:00", "05/06/2025 10:00:01"]))
    assert date_of(one_day[0]) == "2025-06-05 10:00:00"
    assert date_of(times[0]) == "2025-06-05 23:59:00"


def test_noon_and_midnight_of_twelve_hours() -> None:
    texts = ["12:00:00 AM", "12:30:00 am", "1:00:00 AM", "12:00:00 PM", "12:15:00PM", "11:59:59 pm"]
    np.testing.assert_allclose(seconds(pd.Series(texts)), [0, 1800, 3600, 43200, 44100, 86399])


def test_what_is_no_date_is_not_a_number() -> None:
    times = seconds(pd.Series(["27.10.2022 08:00:00", "later", "27.10.2022 08:00:01"]))
    np.testing.assert_array_equal(times, [1666857600.0, np.nan, 1666857601.0])


@pytest.mark.parametrize("zone", ["Z", "+02:00", "-0330", "+02"])
def test_a_date_without_a_zone_beside_others_with_one_is_refused(zone: str, log: pd.DataFrame, tmp_path: Path) -> None:
    """As UTC it would be hours off; with no zone anywhere every row is UTC."""
    moments = (pd.Timestamp("2024-05-14T08:00:00") + pd.to_timedelta(log["time"], "s")).dt.strftime(
        "%Y-%m-%dT%H:%M:%S.%f"
    )
    zoned = moments + zone
    assert np.isfinite(seconds(zoned)).all()
    assert np.isfinite(seconds(moments)).all()
    zoned[3] = moments[3]
    log.assign(time=zoned).to_csv(tmp_path / "log", index=False)
    mapping = mapping_with(tmp_path, "", ('from = "time"', 'from = "time"\nunit = "date"'))
    with pytest.raises(DataError, match=f"{moments[3]}' has no time zone, while other rows have one") as caught:
        import_log(read_mapping(mapping), tmp_path / "log")
    assert caught.value.path == "row 4"


@pytest.mark.parametrize("text", ["14.05.2024 08:00:00 +02:00", "1715731140.5", "080000"])
def test_a_time_that_cannot_be_read_is_shown(text: str, log: pd.DataFrame, tmp_path: Path) -> None:
    log.assign(time=text).to_csv(tmp_path / "log", index=False)
    mapping = mapping_with(tmp_path, "", ('from = "time"', 'from = "time"\nunit = "date"'))
    with pytest.raises(DataError, match=rf"'{re.escape(text)}' is no date or time of day .* unit = \"s\"") as caught:
        import_log(read_mapping(mapping), tmp_path / "log")
    assert caught.value.path == "row 1"


@pytest.mark.parametrize(("day", "time"), [("%d.%m.%Y", "%H:%M:%S.%f"), ("%Y-%m-%d", "%H:%M:%S,%f")])
def test_date_and_time_in_two_columns(day: str, time: str, log: pd.DataFrame, tmp_path: Path) -> None:
    moments = pd.Timestamp("2022-10-26T23:59:30") + pd.to_timedelta(log["time"], "s")
    split = log.assign(time=moments.dt.strftime(time), day=moments.dt.strftime(day))
    split.to_csv(tmp_path / "log", sep=";", index=False)
    clock = 'from = "time"\nunit = "date"\ndate = "day"'
    mapping = mapping_with(tmp_path, 'separator = ";"', ('from = "time"', clock))
    frame = import_log(read_mapping(mapping), tmp_path / "log").frame
    np.testing.assert_allclose(frame["t"] - 1666828770.0, T, atol=1e-5)
    mapping.write_text(mapping.read_text().replace('unit = "date"\n', ""))
    with pytest.raises(DocumentError, match=r"clock\.date: .*write unit = 'date'"):
        read_mapping(mapping)


LARGE_TEXTS: dict[str, tuple[TextFormat, str]] = {
    "commas": (TextFormat(), "a,b,c\n0.5,1,x\n1.5,,y\n2.5,3,z\n"),
    "decimal commas": (TextFormat(separator=";", decimal=","), "a;b;c\n0,5;1;x\n1,5;;y\n2,5;3;z\n"),
    "no header": (TextFormat(names=("a", "b", "c")), "0.5,1,x\n1.5,,y\n2.5,3,z\n"),
    "lines above": (TextFormat(skip_rows=2), "ship\nday\na,b,c\n0.5,1,x\n1.5,,y\n2.5,3,z\n"),
    "utf-16": (TextFormat(encoding="utf-16"), "a,b,c\n0.5,1,x\n1.5,,y\n2.5,3,z\n"),
}


@pytest.mark.parametrize("name", LARGE_TEXTS)
def test_a_large_text_is_read_by_blocks_as_a_small_one(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    form, text = LARGE_TEXTS[name]
    file = tmp_path / "log.csv"
    file.write_text(text, encoding=form.encoding)
    small = read_table(file, form, "a")
    monkeypatch.setattr(readers, "LARGE", 1)
    shares: list[float] = []
    large = read_table(file, form, "a", ("b", "c"), shares.append)
    assert [str(column) for column in large] == ["a", "b", "c"]
    assert large["a"].to_numpy().tolist() == [0.5, 1.5, 2.5]
    np.testing.assert_array_equal(large["b"].to_numpy(dtype=float), [1.0, np.nan, 3.0])
    assert large["c"].tolist() == small["c"].tolist()
    assert shares
    assert max(shares) <= 1.0
    assert list(read_table(file, form, "a", ("b",))) == ["a", "b"]


@pytest.mark.parametrize(
    "text",
    ["a,b,c\r0.5,1,x\r1.5,2,y\r", "a,b,c\n0.5,1,x\n1.5,2,y\n,,\n", "a,b,c\n0.5,NAN,x\n1.5,2,y\n"],
    ids=["carriage returns alone", "an empty line of separators", "another word for no number"],
)
def test_a_large_text_is_read_as_a_small_one(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "log.csv"
    file.write_bytes(text.encode())
    small = read_table(file, TextFormat(), "a", ("b", "c"))
    monkeypatch.setattr(readers, "LARGE", 1)
    pd.testing.assert_frame_equal(read_table(file, TextFormat(), "a", ("b", "c")), small)


@pytest.mark.parametrize("first", [0, 200], ids=["short lines", "long lines first"])
def test_a_large_text_whose_lines_become_shorter_is_read_to_its_end(
    first: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The number of rows is guessed from the first megabyte: with long lines there, it is guessed too low."""
    lines = [f"{row}.{'0' * first if row < 6000 else ''}5,{2 * row}" for row in range(150_000)]
    (tmp_path / "log.csv").write_text("a,b\n" + "\n".join(lines) + "\n")
    monkeypatch.setattr(readers, "LARGE", 1)
    table = read_table(tmp_path / "log.csv", TextFormat(), "a", ("b",))
    assert len(table) == len(lines)
    np.testing.assert_array_equal(table["b"], 2.0 * np.arange(len(lines)))


@pytest.mark.parametrize("bad", ["2.5,oops,z", "2.5,3"], ids=["a word", "a short line"])
def test_what_blocks_cannot_read_is_left_to_the_thorough_way(
    bad: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error of a large text names the same place as that of a small one."""
    file = as_log(turning(T), tmp_path / "log.csv")
    file.write_text(file.read_text() + ("60.0,1,2,3,4,5,oops,7\n" if "oops" in bad else "60.0,1,2\n"))
    messages = []
    for large in (readers.LARGE, 1):
        monkeypatch.setattr(readers, "LARGE", large)
        with pytest.raises(DataError) as error:
            import_log(read_mapping(mapping_with(tmp_path, "")), file)
        messages.append(str(error.value))
    assert messages[0] == messages[1]
    assert "row 121" in messages[0] or "line 122" in messages[0]


def test_a_device_and_a_folder_are_no_logs(tmp_path: Path) -> None:
    for path, message in ((Path("/dev/zero"), "a device or a pipe, not a file"), (tmp_path, "it is a folder")):
        with pytest.raises(DataError, match=message):
            require_file(path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DataError, match="a device or a pipe"):
        read_table(tmp_path / "pipe", TextFormat(), "time")


def test_a_short_line_is_refused_or_left_out(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("a,b,c\n1,2,3\n2,3\n3,4,\n4,5,6\n")
    with pytest.raises(DataError, match=r"line 3: 2 cells, where the header has 3: .*ragged = 'drop'"):
        read_table(file, TextFormat(), "a")
    table = read_table(file, TextFormat(ragged="drop"), "a")
    assert table["a"].tolist() == ["1", "3", "4"]  # an empty cell is none that is missing
    assert table.attrs["ragged"] == [3]


@pytest.mark.parametrize(("wrong", "said"), [("2", "1 cells"), ("2,3,4", "3 cells"), ("a,b", "repeats the header")])
def test_the_number_of_a_wrong_line_counts_the_comments_before_it(tmp_path: Path, wrong: str, said: str) -> None:
    file = tmp_path / "log.csv"
    file.write_text(f"recorder 7\n# of a day\na,b\n0,1\n# noon\n{wrong}\n3,4\n4,5\n")
    with pytest.raises(DataError, match=f"line 6: {said}"):
        read_table(file, TextFormat(comment="#", skip_rows=1), "a")
    table = read_table(file, TextFormat(comment="#", skip_rows=1, ragged="drop"), "a")
    assert table.attrs["ragged"] == [6]


@pytest.mark.parametrize(("kind", "remedy"), [("parquet", "not a Parquet file"), ("mat", "not a MATLAB file")])
def test_another_format_than_declared(kind: str, remedy: str, log: pd.DataFrame, tmp_path: Path) -> None:
    log.to_csv(tmp_path / "log")
    with pytest.raises(DataError, match=remedy):
        import_log(read_mapping(mapping_with(tmp_path, f'kind = "{kind}"')), tmp_path / "log")


@pytest.mark.parametrize(
    ("form", "path", "remedy"),
    [
        ('kind = "nmae"', "format.kind", "did you mean 'nmea'"),
        ('kind = "parquet"\nseparator = ";"', "format.separator", "unknown key: valid: kind"),
        ('kind = "nmea"\ntime = "utc"', "format.time", "'fix' or 'line'"),
    ],
)
def test_keys_of_a_format(form: str, path: str, remedy: str, tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=remedy) as caught:
        read_mapping(mapping_with(tmp_path, form))
    assert caught.value.path == path


def sentence(body: str) -> str:
    """NMEA 0183: $body*checksum, the exclusive or of all characters of the body."""
    check = 0
    for character in body:
        check ^= ord(character)
    return f"${body}*{check:02X}"


def degrees_minutes(value: float, width: int) -> str:
    degrees = int(abs(value))
    return f"{degrees:0{width}d}{60 * (abs(value) - degrees):011.8f}"


NMEA = """
name = "bridge"
[format]
kind = "nmea"
[clock]
from = "time"
max_gap = 5.0
step = 0.5
[origin]
latitude = 63.45
longitude = 10.4
[columns.latitude]
from = "latitude"
unit = "deg"
[columns.longitude]
from = "longitude"
unit = "deg"
[columns.psi]
from = "heading"
unit = "deg"
wrap = true
[columns.speed]
from = "sog"
unit = "kn"
[columns.course]
from = "cog"
unit = "deg"
wrap = true
[columns.r]
from = "rot"
unit = "deg/min"
[columns.V_w]
from = "apparent_speed"
unit = "m/s"
[columns.beta_w]
from = "apparent_angle"
unit = "deg"
direction = "from"
relative = true
wrap = true
[columns."rudder.delta"]
from = "rudder"
unit = "deg"
"""


def bridge_log(time: str, midnight: float, motion: pd.DataFrame) -> tuple[str, pd.DataFrame]:
    """Sentences of a ship in a steady turn in a wind of 8 m/s towards the east; 2 of them are damaged."""
    radius = 6378137.0  # m; close enough to the ellipsoid's for a check to 1 %
    lines = ["!AIVDM,1,1,,A,14eG;o@034o8sd<L9i:a;WF>062D,0*7D", "$GPRMC,noise"]
    course = np.degrees(motion["psi"] + np.arctan2(motion["v"], motion["u"])) % 360
    speed = np.hypot(motion["u"], motion["v"]) * 3600 / 1852
    for row in motion.itertuples():
        index = row.Index
        clock = (midnight + row.t) % 86400
        stamp = f"{int(clock // 3600):02d}{int(clock % 3600 // 60):02d}{clock % 60:05.2f}"
        latitude = 63.45 + np.degrees(row.north / radius)
        longitude = 10.4 + np.degrees(row.east / radius / np.cos(np.radians(63.45)))
        where = f"{degrees_minutes(latitude, 2)},N,{degrees_minutes(longitude, 3)},E"
        psi = np.degrees(row.psi) % 360
        ahead, abeam = 8 * np.sin(row.psi) - row.u, 8 * np.cos(row.psi) - row.v
        comes_from = (np.degrees(np.arctan2(abeam, ahead)) + 180) % 360
        bodies = [
            f"GPRMC,{stamp},A,{where},{speed[index]:.6f},{course[index]:.5f},271022,,,A",
            f"HEHDT,{psi:.5f},T",
            f"TIROT,{np.degrees(row.r) * 60:.5f},A",
            f"WIMWV,{comes_from:.4f},R,{np.hypot(ahead, abeam):.5f},M,A",
            "AGRSA,10.0,A,,",
        ]
        before = f"{row.t:.1f} " if time == "line" else ""
        lines += [before + sentence(body) for body in bodies]
    return "\r\n".join(lines) + "\r\n", motion


def test_values_that_a_sentence_calls_invalid_are_not_taken(tmp_path: Path) -> None:
    begin = [
        "GPRMC,120000,A,4807.0,N,01131.0,E,5.0,84.0,271022,,,A",
        "AGRSA,10.5,A,4.0,V",
        "GPVTG,54.0,T,,M,5.5,N,,K,A",
    ]
    later = ["GPRMC,120001,A,4807.0,N,01131.0,E,,,271022,,,A", "AGRSA,33.0,V,,", "GPVTG,99.0,T,,M,77.0,N,,K,N"]
    (tmp_path / "log").write_text("\n".join(map(sentence, begin + later)))
    table = readers.read_table(tmp_path / "log", readers.NmeaFormat(kind="nmea"), "time")
    assert table["rudder"].tolist() == pytest.approx([10.5, np.nan], nan_ok=True)
    assert table["rudder_port"].isna().all()
    assert table["sog"].tolist() == pytest.approx([5.0, np.nan], nan_ok=True)
    assert table.attrs["unreadable"] == 0


@pytest.mark.parametrize(
    ("fixes", "hours"),
    [
        (["GGA 230000", "RMC 230000 271022", "GGA 010000", "RMC 010000 281022"], [0, 2]),
        (["RMC 080000 271022", "GGA 080100", "GGA 090000", "RMC 090000 281022"], [0, 1 / 60, 25]),
        (["RMC 080000 271022", "RMC 070000 301022", "GGA 070100"], [0, 71, 71 + 1 / 60]),
        (["ZDA 080000 271022", "GGA 090000", "ZDA 090000 281022"], [0, 25]),
        (["RMC 235959 311222", "RMC 000000 311222", "RMC 000001 010123"], [0, 1 / 3600, 2 / 3600]),
        (["RMC 080000 271022", "RMC 090000 -"], [0, 1]),
        (["GGA 230000", "GGA 010000"], [0, 2]),
    ],
)
def test_a_fix_is_of_the_day_that_the_sentences_say(fixes: list[str], hours: list[float], tmp_path: Path) -> None:
    """Before, a log that was off for 25 h went on after one; a date that changes a second late makes no day."""
    lines = []
    for kind, time, *date in map(str.split, fixes):
        day = (date or ["-"])[0].replace("-", "")
        if kind == "RMC":
            lines.append(f"GPRMC,{time},A,4807.0,N,01131.0,E,5.0,84.0,{day},,,A")
        elif kind == "ZDA":
            lines.append(f"GPZDA,{time},{day[:2]},{day[2:4]},20{day[4:]},00,00")
        else:
            lines.append(f"GPGGA,{time},4807.0,N,01131.0,E,1,8,0.9,5.0,M,46.9,M,,")
    (tmp_path / "log").write_text("\n".join(map(sentence, lines)))
    t = readers.read_table(tmp_path / "log", readers.NmeaFormat(kind="nmea"), "time")["time"]
    np.testing.assert_allclose((t - t[0]) / 3600, hours)
    assert 0 <= t[0] < 86400


@pytest.mark.parametrize("speed", ["10.0,N,,M", ",N,5.1444,M", "10.0,N,5.1444,M"])
def test_the_true_wind_is_read_in_knots_too(speed: str, tmp_path: Path) -> None:
    fixes = [f"GPRMC,12000{k},A,4807.0,N,01131.0,E,5.0,84.0,271022,,,A" for k in (0, 1)]
    lines = [line for fix in fixes for line in (fix, f"WIMWD,120.0,T,118.0,M,{speed}")]
    (tmp_path / "log").write_text("\n".join(map(sentence, lines)))
    table = readers.read_table(tmp_path / "log", readers.NmeaFormat(kind="nmea"), "time")
    assert table["wind_speed"].tolist() == pytest.approx([5.1444, 5.1444], abs=1e-4)


def test_times_of_day_that_go_back_are_of_the_next_day() -> None:
    """Trials of three days in one file, each from eight in the morning; a minute back is an error, and stays one."""
    hours = pd.Series(["08:00:00", "11:30:00", "08:15:00", "16:00:00", "08:05:00", "08:04:00"])
    times = seconds(hours)
    np.testing.assert_allclose(np.diff(times) / 3600, [3.5, 20.75, 7.75, 16 + 5 / 60, -1 / 60])


@pytest.mark.parametrize(("time", "midnight"), [("fix", 0.0), ("fix", 86400.0 - 30.0), ("line", 0.0)])
def test_nmea(time: str, midnight: float, tmp_path: Path) -> None:
    text, motion = bridge_log(time, midnight, turning(T))
    if time == "line":
        text = "\n".join(text.splitlines()[2:])
    (tmp_path / "bridge.nmea").write_text(text)
    (tmp_path / "mapping.toml").write_text(NMEA.replace('"nmea"', f'"nmea"\ntime = "{time}"'))
    dataset = import_log(read_mapping(tmp_path / "mapping.toml"), tmp_path / "bridge.nmea")
    frame = dataset.frame
    assert len(frame) == len(T)
    np.testing.assert_allclose(frame["t"], T + midnight, atol=1e-6)
    for name, tolerance in {"psi": 1e-6, "u": 1e-5, "v": 1e-5, "r": 1e-6}.items():
        np.testing.assert_allclose(frame[name], motion[name], atol=tolerance, err_msg=name)
    extent = np.ptp(motion["north"])
    for name in ("north", "east"):
        np.testing.assert_allclose(frame[name], motion[name], atol=0.01 * extent, err_msg=name)
    np.testing.assert_allclose(frame["V_w"], 8.0, atol=1e-3)
    np.testing.assert_allclose(np.sin(frame["beta_w"]), 1.0, atol=1e-3)
    np.testing.assert_allclose(np.degrees(frame["rudder.delta"]), 10.0)
    counted = [record["count"] for record in dataset.metadata["repairs"] if record["kind"] == "unreadable"]
    assert counted == ([2] if time == "fix" else [])
    assert dataset.metadata["origin"] == {"latitude": 63.45, "longitude": 10.4}


@pytest.mark.parametrize(
    "written",
    [
        lambda moment: f"{moment.timestamp():.3f} ",
        lambda moment: f"{moment:%d.%m.%Y};{moment:%H:%M:%S.%f};",
        lambda moment: f"{moment:%d.%m.%Y %H:%M:%S.%f},",
        lambda moment: f"{moment:%Y-%m-%dT%H:%M:%S.%f}Z ",
        lambda moment: f"{moment:%Y%m%dT%H%M%S.%f} ",
        lambda moment: f"{moment:%Y/%m/%d %H:%M:%S.%f},",
        lambda moment: f"\\g:1-1-1234,s:r3669961,c:{round(1000 * moment.timestamp())}*5F\\",
    ],
)
@pytest.mark.parametrize("source", ["S", "E", "both"])
def test_stamps_before_sentences_and_speeds_of_shafts(written: Any, source: str, tmp_path: Path) -> None:
    """6 May, not 5 June; shafts and engines by their number."""
    begin = datetime(2025, 5, 6, 7, 8, 9, 500000, tzinfo=UTC)
    lines = []
    for second in range(20):
        bodies = [f"{kind},{number},{100.0 * factor + 10 * number + second},,A" for kind, factor in (("E", 5), ("S", 1))
                  for number in (1, 2) if source in (kind, "both")]  # fmt: skip
        stamp = written(begin + timedelta(seconds=second))
        lines += [stamp + sentence(f"IIRPM,{body}") for body in bodies] + [stamp + sentence("HEHDT,10.0,T")]
    file = tmp_path / "bridge.nmea"
    file.write_text("\n".join(lines))
    assert READERS["nmea"].detect is not None
    assert READERS["nmea"].detect(file, file.read_bytes()) == {"kind": "nmea", "time": "line"}
    table = READERS["nmea"].read(file, NmeaFormat(kind="nmea", time="line"), "time")
    np.testing.assert_allclose(table["time"], begin.timestamp() + np.arange(20.0), atol=1e-3)
    for kind, name, base in (("S", "rpm", 100.0), ("E", "engine_rpm", 500.0)):
        for column, number in ((name, 1), (f"{name}_2", 2)):
            logged = source in (kind, "both")
            expected = base + 10 * number + np.arange(20) if logged else np.full(20, np.nan)
            np.testing.assert_allclose(table[column], expected)


@pytest.mark.parametrize("stamp", ["06/05/2025 12:00:00,", "12:00:01 ", "\\s:GPS*1C\\", "bridge "])
def test_a_stamp_that_is_no_moment_is_refused(stamp: str, tmp_path: Path) -> None:
    """A time without a date, or a date that may be two days; a guess takes the time of the fix."""
    file = tmp_path / "bridge.nmea"
    file.write_text(stamp + sentence("HEHDT,10.0,T") + "\n")
    assert READERS["nmea"].detect is not None
    assert READERS["nmea"].detect(file, file.read_bytes()) == {"kind": "nmea", "time": "fix"}
    with pytest.raises(DataError, match=r"row 1: no .*: set \[format\] time = 'fix'"):
        READERS["nmea"].read(file, NmeaFormat(kind="nmea", time="line"), "time")


@pytest.mark.parametrize("separator", [",", ";", "\t", "whitespace"])
@pytest.mark.parametrize(("cells", "refused"), [(WIDEST, False), (WIDEST + 1, True), (10**6, True)])
def test_a_line_of_very_many_cells_is_refused(separator: str, cells: int, refused: bool) -> None:
    mark = b" " if separator == "whitespace" else separator.encode()
    head = b"t,u\n" + mark.join([b"a"] * cells) + b"\n"
    if not refused:
        widest(head, separator, Path("log.csv"))
        return
    with pytest.raises(DataError, match=f"a line of {cells} cells: a log has {WIDEST} columns at most"):
        widest(head, separator, Path("log.csv"))


def test_a_moment_and_its_date() -> None:
    text = "2022-11-30 09:15:02"
    t = float(seconds(pd.Series([text]))[0])
    assert date_of(t) == text
    assert moment_of(t) == f"{text} UTC"
    assert span_of(t, t + 60.0) == f"{text} to 2022-11-30 09:16:02 UTC"


@pytest.mark.parametrize("t", [-1e308, -5.0, 0.0, 12.5, 9.99e7, 1e13, 1e308, float("inf"), float("nan")])
def test_a_moment_without_a_date_is_seconds(t: float) -> None:
    """A damaged clock too: no date is beyond the year 9999."""
    assert moment_of(t) == f"{t:.10g} s"
    assert span_of(0.0, t) == f"0 to {t:.10g} s"
    assert span_of(t, 1.7e9).endswith(" s")


def test_nested_columns_of_parquet_are_left_and_durations_are_seconds(tmp_path: Path) -> None:
    """A list in every row is no column of a log; a clock that counts from the begin is one."""
    steps = np.arange(40) * 0.5
    plain = {"t": pd.to_timedelta(steps, unit="s"), "u": np.sin(steps)}
    frame = pd.DataFrame({**plain, "cells": [[1.0, 2.0]] * 40, "box": [{"a": 1}] * 40})
    frame.to_parquet(tmp_path / "log.parquet")
    table = read_table(tmp_path / "log.parquet", ParquetFormat(kind="parquet"), "t")
    assert list(table.columns) == ["t", "u"]
    np.testing.assert_allclose(seconds(table["t"]), steps)


@pytest.mark.parametrize("rate", [1, 2, 5, 10, 20])
@pytest.mark.parametrize("style", ["%d.%m.%Y %H:%M:%S.%f", "%m/%d/%Y %I:%M:%S.%f %p", "%Y-%m-%d %I:%M:%S.%f %p"])
def test_whole_seconds_may_be_written_without_a_fraction(style: str, rate: int) -> None:
    moments = pd.Timestamp("2024-02-01T10:00:00") + pd.to_timedelta(np.arange(1200) / rate, "s")
    texts = pd.Series(moments.strftime(style)).str.replace(".000000", "", regex=False)
    times = seconds(texts)
    np.testing.assert_allclose(np.diff(times), 1 / rate, atol=1e-5)
    np.testing.assert_array_equal(seconds(texts.astype("category")), times)
