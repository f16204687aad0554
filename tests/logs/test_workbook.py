"""Workbooks of Excel and OpenDocument: a sheet is drafted and imported as the same table in a text."""

from __future__ import annotations

import datetime as dt
import sys
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from openpyxl import Workbook

from shipid.errors import DataError
from shipid.logs.formats import SheetFormat, TextFormat
from shipid.logs.guess.columns import guess
from shipid.logs.guess.draft import draft_mapping
from shipid.logs.guess.sniff import recognise_log
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping
from shipid.logs.readers import read_log_table
from tests.drawn import seeds
from tests.logs.simulated import as_bridge, si_log

BRIDGE = as_bridge(si_log()).round(4)


def saved(path: Path, cells: list[list[object]], title: str = "log") -> Path:
    book = Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.title = title
    for row in cells:
        sheet.append(row)
    book.save(path)
    return path


def rows_of(file: Path, **keys: object) -> list[list[str]]:
    return read_log_table(file, SheetFormat(kind="sheet", **keys), "time").to_numpy().tolist()


@pytest.mark.parametrize(("name", "left"), [("log.xlsx", 2), ("log.ods", 0)])
def test_a_sheet_is_drafted_and_imported_as_a_text(name: str, left: int, tmp_path: Path) -> None:
    """With a sheet of notes before it, empty rows above its header and empty columns at its left."""
    moments = pd.Timestamp("2024-05-01 23:59") + pd.to_timedelta(BRIDGE["time"], unit="s").dt.round("ms")
    log = BRIDGE.assign(time=moments)
    log.to_csv(tmp_path / "log.csv", index=False)
    with pd.ExcelWriter(str(tmp_path / name)) as book:
        pd.DataFrame({"ship": ["A"], "draught [m]": [4.5]}).to_excel(book, sheet_name="notes", index=False)
        log.to_excel(book, sheet_name="Trial 'A'", index=False, startrow=2, startcol=left)
    drafts, datasets = [], []
    for file in (tmp_path / "log.csv", tmp_path / name):
        proposal = guess(file)
        mapping = file.with_suffix(".toml")
        mapping.write_text(draft_mapping(proposal))
        drafts.append([(one.name, one.source, one.unit, one.confidence, one.extra) for one in proposal.columns])
        datasets.append(import_log(read_mapping(mapping), file).frame)
        mapping.unlink()
    assert drafts[0] == drafts[1]
    pd.testing.assert_frame_equal(*datasets)
    assert "of the workbook the sheet \"Trial 'A'\" is read, not 'notes'" in proposal.sniffed.notes


def test_cells_are_read_as_written(tmp_path: Path) -> None:
    cells = [
        ["time", "speed\n[kn]", "clock", "duration", "flag", "words"],
        [dt.datetime(2024, 5, 1, 12, 0, 0, 500000), 1 / 3, dt.time(1, 2, 3), dt.timedelta(hours=30), True, "3,14"],
        [dt.date(2024, 5, 2), 2, dt.time(1, 2, 3, 250000), dt.timedelta(seconds=0.5), False, "#N/A"],
        [None, -4.0, None, None, None, " a "],
    ]
    file = saved(tmp_path / "log.xlsx", cells)
    table = read_log_table(file, SheetFormat(kind="sheet"), "time")
    assert list(table.columns) == ["time", "speed [kn]", "clock", "duration", "flag", "words"]
    assert rows_of(file) == [
        ["2024-05-01 12:00:00.500000", "0.3333333333333333", "01:02:03", "108000", "TRUE", "3,14"],
        ["2024-05-02", "2", "01:02:03.250000", "0.5", "FALSE", ""],
        ["", "-4", "", "", "", "a"],
    ]


def test_a_sheet_is_chosen_by_its_name(tmp_path: Path) -> None:
    file = tmp_path / "log.xlsx"
    with pd.ExcelWriter(file) as book:
        for name, count in (("a", 3), ("b", 5)):
            pd.DataFrame({"time": range(count), "x": count}).to_excel(book, sheet_name=name, index=False)
    assert [len(rows_of(file, **keys)) for keys in ({}, {"sheet": "a"}, {"sheet": "b"})] == [5, 3, 5]
    with pytest.raises(DataError, match="no sheet 'c'") as caught:
        rows_of(file, sheet="c")
    assert caught.value.path == "format.sheet"
    assert "a, b" in caught.value.message or "'a'" in caught.value.message


def test_a_text_reader_names_the_kind(tmp_path: Path) -> None:
    file = saved(tmp_path / "log.csv", [["time", "x"], [0, 1], [1, 2]])
    with pytest.raises(DataError, match=r"set \[format\] kind = 'sheet'"):
        read_log_table(file, TextFormat(), "time")


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_a_damaged_workbook_is_no_traceback(seed: int, tmp_path: Path) -> None:
    """Or none: a changed digit in a cell is no damage that a reader can see."""
    rng = np.random.default_rng(seed)
    file = saved(tmp_path / "log.xlsx", [["time", "x"], *([k, float(k)] for k in range(50))])
    content = bytearray(file.read_bytes())
    if seed % 2:
        del content[int(rng.integers(4, len(content))) :]
    for place in rng.integers(0, len(content), 20):
        content[place] = int(rng.integers(256))
    file.write_bytes(content)
    for read in (recognise_log, rows_of):
        with suppress(DataError):
            read(file)


def test_the_package_that_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = saved(tmp_path / "log.xlsx", [["time", "x"], [0, 1], [1, 2]])
    monkeypatch.setitem(sys.modules, "python_calamine", None)
    with pytest.raises(DataError, match=r"pip install 'shipid\[sheet\]', or save its sheet as CSV"):
        recognise_log(file)


def test_a_part_that_unpacks_as_no_sheet_does_is_refused_at_once(tmp_path: Path) -> None:
    """A cell of 900 MB in a file of 1 MB was not read within a minute."""
    saved(tmp_path / "whole.xlsx", [["time", "x"], [0.0, 1.0], [1.0, 2.0]])
    with zipfile.ZipFile(tmp_path / "whole.xlsx") as whole, zipfile.ZipFile(tmp_path / "log.xlsx", "w") as packed:
        for part in whole.infolist():
            packed.writestr(part, whole.read(part))
        packed.writestr("xl/sharedStrings2.xml", b"a" * 30_000_000, zipfile.ZIP_DEFLATED)
    for read in (lambda: rows_of(tmp_path / "log.xlsx"), lambda: recognise_log(tmp_path / "log.xlsx")):
        with pytest.raises(DataError, match="unpacks as no sheet does"):
            read()
