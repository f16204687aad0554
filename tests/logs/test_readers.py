"""One motion, written in every format a log may have, comes back as the same dataset."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from shipid.errors import DataError
from shipid.logs import readers
from shipid.logs.cells import log_column
from shipid.logs.dates import parse_dates
from shipid.logs.formats import ParquetFormat, TextFormat
from shipid.logs.readers import parse_text, read_log_table, require_file
from shipid.logs.workbook import WIDEST
from tests.drawn import seeds
from tests.logs.conftest import NAMES, assert_is_the_motion, mapping_with

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


LARGE_TEXTS: dict[str, tuple[TextFormat, str]] = {
    "commas": (TextFormat(), "a,b,c\n0.5,1,x\n1.5,,y\n2.5,3,z\n"),
    "decimal commas": (TextFormat(separator=";", decimal=","), "a;b;c\n0,5;1;x\n1,5;;y\n2,5;3;z\n"),
    "no header": (TextFormat(names=("a", "b", "c")), "0.5,1,x\n1.5,,y\n2.5,3,z\n"),
    "lines above": (TextFormat(skip_rows=2), "ship\nday\na,b,c\n0.5,1,x\n1.5,,y\n2.5,3,z\n"),
    "blanks": (TextFormat(separator="whitespace"), "a b  c\n 0.5 1\tx\n1.5 nan  y \n2.5 3 z\n"),
    "utf-16": (TextFormat(encoding="utf-16"), "a,b,c\n0.5,1,x\n1.5,,y\n2.5,3,z\n"),
}


@pytest.mark.parametrize("name", LARGE_TEXTS)
def test_a_large_text_is_read_by_blocks_as_a_small_one(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    form, text = LARGE_TEXTS[name]
    file = tmp_path / "log.csv"
    file.write_text(text, encoding=form.encoding)
    small = read_log_table(file, form, "a")
    monkeypatch.setattr(readers, "LARGE", 1)
    shares: list[float] = []
    large = read_log_table(file, form, "a", ("b", "c"), shares.append)
    assert [str(column) for column in large] == ["a", "b", "c"]
    assert large["a"].to_numpy().tolist() == [0.5, 1.5, 2.5]
    np.testing.assert_array_equal(large["b"].to_numpy(dtype=float), [1.0, np.nan, 3.0])
    assert large["c"].tolist() == small["c"].tolist()
    assert shares
    assert max(shares) <= 1.0
    assert list(read_log_table(file, form, "a", ("b",))) == ["a", "b"]


@pytest.mark.parametrize(
    "text",
    ["a,b,c\r0.5,1,x\r1.5,2,y\r", "a,b,c\n0.5,1,x\n1.5,2,y\n,,\n", "a,b,c\n0.5,NAN,x\n1.5,2,y\n"],
    ids=["carriage returns alone", "an empty line of separators", "another word for no number"],
)
def test_a_large_text_is_read_as_a_small_one(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "log.csv"
    file.write_bytes(text.encode())
    small = read_log_table(file, TextFormat(), "a", ("b", "c"))
    monkeypatch.setattr(readers, "LARGE", 1)
    pd.testing.assert_frame_equal(read_log_table(file, TextFormat(), "a", ("b", "c")), small)


def test_a_device_and_a_folder_are_no_logs(tmp_path: Path) -> None:
    for path, message in ((Path("/dev/zero"), "a device or a pipe, not a file"), (tmp_path, "it is a folder")):
        with pytest.raises(DataError, match=message):
            require_file(path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DataError, match="a device or a pipe"):
        read_log_table(tmp_path / "pipe", TextFormat(), "time")


def test_a_short_line_is_refused_or_left_out(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("a,b,c\n1,2,3\n2,3\n3,4,\n4,5,6\n")
    with pytest.raises(DataError, match=r"line 3: 2 cells, where the header has 3: .*ragged = 'drop'"):
        read_log_table(file, TextFormat(), "a")
    table = read_log_table(file, TextFormat(ragged="drop"), "a")
    assert table["a"].tolist() == ["1", "3", "4"]  # an empty cell is none that is missing
    assert table.attrs["ragged"] == [3]


@pytest.mark.parametrize(("wrong", "said"), [("2", "1 cells"), ("2,3,4", "3 cells"), ("a,b", "repeats the header")])
def test_the_number_of_a_wrong_line_counts_the_comments_before_it(tmp_path: Path, wrong: str, said: str) -> None:
    file = tmp_path / "log.csv"
    file.write_text(f"recorder 7\n# of a day\na,b\n0,1\n# noon\n{wrong}\n3,4\n4,5\n")
    with pytest.raises(DataError, match=f"line 6: {said}"):
        read_log_table(file, TextFormat(comment="#", skip_rows=1), "a")
    table = read_log_table(file, TextFormat(comment="#", skip_rows=1, ragged="drop"), "a")
    assert table.attrs["ragged"] == [6]


@pytest.mark.parametrize("seed", seeds(3, 20))
def test_a_header_that_comes_again_is_left_out_with_its_units(seed: int, tmp_path: Path) -> None:
    """Of a logger that was switched off and on, whose units are a line of their own, a name was taken for a time."""
    draw = np.random.default_rng(seed)
    names, units = ("t", "x", "psi"), ("s", *draw.choice(["m", "deg", "kn", ""], 2))
    lines = [f"{k},{0.5 * k},{k % 7}" for k in range(40)]
    for place in sorted(draw.choice(np.arange(1, 40), 2, replace=False))[::-1]:
        lines.insert(place, ",".join(names))
    form = TextFormat(
        skip_rows=2,
        header=False,
        names=tuple(f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)),
        ragged="drop",
    )
    table = parse_text("\n".join([",".join(names), ",".join(units), *lines]), form, tmp_path)
    assert table.iloc[:, 0].astype(int).tolist() == list(range(40))
    assert len(table.attrs["ragged"]) == 2


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_what_a_power_cut_leaves_is_refused(seed: int, tmp_path: Path) -> None:
    """A cell ended at its NUL, and 111.1 became 11."""
    draw = np.random.default_rng(seed)
    lines = ["time,x,y", *(f"{k},{111.1 * k},{k % 7}" for k in range(2000))]
    hit = int(draw.integers(1, len(lines) + 1))
    nul = "\0" * int(draw.integers(1, 5000))
    place = int(draw.integers(0, len(lines[hit]) + 1)) if hit < len(lines) else 0
    lines[hit : hit + 1] = [lines[hit][:place] + nul + lines[hit][place:] if hit < len(lines) else nul]
    file = tmp_path / "log.csv"
    file.write_text("\n".join(lines) + "\n")
    with pytest.raises(DataError, match="holds NUL bytes"):
        read_log_table(file, TextFormat(ragged="drop"), "time")


def test_a_quote_that_is_never_closed_is_named(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text('time,x\n0,1\n1,"2\n' + "".join(f"{k},{k}\n" for k in range(2, 20_000)))
    with pytest.raises(DataError, match="is its closing quote lacking") as caught:
        read_log_table(tmp_path / "log.csv", TextFormat(), "time")
    assert caught.value.path == "line 3"


@pytest.mark.parametrize("separator", [",", "whitespace"])
@pytest.mark.parametrize(("cells", "refused"), [(WIDEST, False), (WIDEST + 1, True)])
def test_a_line_of_very_many_cells_is_refused(separator: str, cells: int, refused: bool) -> None:
    text = "t,u\n" + (" " if separator == "whitespace" else separator).join(["a"] * cells) + "\n"
    with pytest.raises(DataError, match=f"a line of more than {WIDEST} cells" if refused else "not a table with this"):
        parse_text(text, TextFormat(separator=separator), Path("log.csv"))


def test_nested_columns_of_parquet_are_left_and_durations_are_seconds(tmp_path: Path) -> None:
    """A list in every row is no column of a log; a clock that counts from the begin is one."""
    steps = np.arange(40) * 0.5
    plain = {"t": pd.to_timedelta(steps, unit="s"), "u": np.sin(steps)}
    frame = pd.DataFrame({**plain, "cells": [[1.0, 2.0]] * 40, "box": [{"a": 1}] * 40})
    frame.to_parquet(tmp_path / "log.parquet")
    table = read_log_table(tmp_path / "log.parquet", ParquetFormat(kind="parquet"), "t")
    assert list(table.columns) == ["t", "u"]
    np.testing.assert_allclose(parse_dates(table["t"]), steps)
    assert [*table.attrs["other"]] == ["cells", "box"]
    with pytest.raises(DataError, match=r"'box' is nested \(struct<a: int64>\): write each of its values as a column"):
        log_column(table, "box", tmp_path / "log.parquet", "columns.psi.from")


@pytest.mark.parametrize("kind", ["text", "parquet"])
def test_columns_that_are_not_asked_for_are_not_made(kind: str, log: pd.DataFrame, tmp_path: Path) -> None:
    """Of a name that is not there all are, for the line that says so."""
    file, form = tmp_path / "log", TextFormat() if kind == "text" else ParquetFormat(kind="parquet")
    log.to_csv(file, index=False) if kind == "text" else log.to_parquet(file)
    assert {*read_log_table(file, form, "time", ("u", "N"))} == {"time", "N", "u"}
    assert list(read_log_table(file, form, "time", ("u", "speed"))) == NAMES
    alone = read_log_table(file, form, "u", ("u",))
    np.testing.assert_allclose(pd.to_numeric(alone["u"]), log["u"])
