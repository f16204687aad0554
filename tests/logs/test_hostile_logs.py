"""Broken and hostile logs: each ends in one line that names the file, and leaves nothing behind."""

from __future__ import annotations

import os
import sqlite3
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat
from typer.testing import CliRunner

from shipid.cli import app
from shipid.errors import DataError, ShipidError
from shipid.logs.readers import READERS, read_log_table
from tests.logs.conftest import PLAIN, as_log, turning

T = np.arange(0.0, 60.0, 0.5)
HEADER = "time,N,E,heading,u,v,rot,rpm"
Write = Callable[[Path, str], object]


def good() -> str:
    lines = [HEADER]
    for row in turning(T).itertuples():
        psi, rot = np.degrees(row.psi) % 360, np.degrees(row.r) * 60
        lines.append(f"{row.t},{row.north:.4f},{row.east:.4f},{psi:.4f},{row.u},{row.v},{rot:.4f},{60 * row.Index % 7}")
    return "\n".join(lines) + "\n"


GOOD = good()
ROWS = GOOD.splitlines()


def text(change: Callable[[str], str], encoding: str = "utf-8") -> Write:
    return lambda file, good: file.write_bytes(change(good).encode(encoding))


def raw(content: bytes) -> Write:
    return lambda file, _: file.write_bytes(content)


def cell(row: int, column: str, value: str) -> Write:
    """Put a value into one cell; rows count from 1."""

    def change(good: str) -> str:
        lines = good.splitlines()
        cells = lines[row].split(",")
        cells[HEADER.split(",").index(column)] = value
        lines[row] = ",".join(cells)
        return "\n".join(lines)

    return text(change)


def frame(change: Callable[[pd.DataFrame], pd.DataFrame]) -> Write:
    return text(
        lambda _: change(pd.DataFrame([row.split(",") for row in ROWS[1:]], columns=HEADER.split(","))).to_csv(
            index=False
        )
    )


def without(column: str) -> Write:
    return frame(lambda f: f.drop(columns=column))


def renamed(old: str, new: str) -> Write:
    return frame(lambda f: f.rename(columns={old: new}))


def archive(file: Path, good: str) -> None:
    with zipfile.ZipFile(file, "w") as target:
        target.writestr("log.csv", good)


def database(file: Path, _: str) -> None:
    connection = sqlite3.connect(file)
    connection.execute("create table log (t real)")
    connection.commit()
    connection.close()


def sixteen_bit(file: Path, good: str) -> None:
    file.write_bytes(good.encode("utf-16-le"))


IMPORTS: dict[str, tuple[Write, str]] = {
    # what it is -> how it is made, a part of the line
    "empty": (raw(b""), "the file is empty"),
    "one newline": (raw(b"\n"), "holds no line with values"),
    "blanks only": (raw(b"   \n  \n"), "holds no line with values"),
    "one word": (raw(b"hello"), "needs two rows"),
    "header only": (text(lambda _: HEADER + "\n"), "needs two rows"),
    "one row": (text(lambda _: "\n".join(ROWS[:2])), "needs two rows"),
    "binary noise": (raw(bytes(np.random.default_rng(0).integers(0, 256, 5000, dtype=np.uint8))), "NUL"),
    "binary without NUL": (raw(bytes(range(128, 256)) * 40), "not utf-8"),
    "an image": (raw(b"\x89PNG\r\n\x1a\n" + bytes(400)), "NUL"),
    "a zip": (archive, "a ZIP archive"),
    "a database": (database, "a data base of SQLite"),
    "a parquet file": (lambda file, _: pd.DataFrame({"a": [1.0]}).to_parquet(file), "kind = 'parquet'"),
    "HTML": (text(lambda _: "<!doctype html>\n<html><body>404, not found</body></html>\n" * 3), "a page"),
    "JSON": (text(lambda _: '{"time": 1}\n{"time": 2}\n{"time": 3}\n'), "JSON"),
    "UTF-16 without mark": (sixteen_bit, "UTF-16"),
    "UTF-16 with mark": (text(lambda g: g, "utf-16"), "UTF-16"),
    "UTF-32": (text(lambda g: g, "utf-32"), "UTF-16"),
    "cp1252": (text(lambda g: g.replace("heading", "Kurs °"), "cp1252"), "often cp1252"),
    "two encodings": (lambda f, g: f.write_bytes(g.encode() + "99,å\n".encode("latin-1")), "not utf-8"),
    "NUL in the middle": (text(lambda g: g.replace("10.0,", "10.0\0,", 1)), "NUL"),
    "semicolons": (text(lambda g: g.replace(",", ";")), "is the separator right"),
    "tabs": (text(lambda g: g.replace(",", "\t")), "is the separator right"),
    "decimal commas": (text(lambda g: g.replace(".", ",")), "separator"),
    "a longer row": (text(lambda g: g + "60.0,1,2,3,4,5,6,7,8,9\n"), "line 122: 10 cells, where the header has 8"),
    "an open quote": (text(lambda g: g.replace("20.0,", '"20.0,', 1)), ""),
    "cut in a row": (text(lambda g: g[: len(g) // 2].rpartition(",")[0]), "cells, where the header has 8"),
    "a shorter row": (text(lambda g: g + "60.0,1\n"), "line 122: 2 cells, where the header has 8"),
    "header twice": (text(lambda g: g + g), "repeats the header"),
    "header in the middle": (text(lambda g: g + HEADER + "\n60.0,1,2,3,4,5,6,7\n"), "repeats the header"),
    "no header": (text(lambda _: "\n".join(ROWS[1:])), "not in the log"),
    "units in a second line": (text(lambda g: g.replace("\n", "\ns,m,m,deg,m/s,m/s,deg/min,rpm\n", 1)), "no number"),
    "total in the last line": (text(lambda g: g + "sum,,,,,,,\n"), "no number"),
    "NaN": (cell(20, "u", "NaN"), "max_gap"),
    "NaN throughout": (frame(lambda f: f.assign(u="NaN")), "max_gap"),
    "empty cell": (cell(20, "heading", ""), "max_gap"),
    "infinity": (cell(20, "u", "inf"), "no number"),
    "minus infinity": (cell(20, "N", "-inf"), "no number"),
    "too large for a float": (cell(20, "N", "1e999"), "no number"),
    "words for numbers": (cell(20, "v", "stopped"), "no number"),
    "a formula": (cell(20, "v", "=cmd|' /C calc'!A0"), "no number"),
    "an Excel error": (cell(20, "rot", "#REF!"), "no number"),
    "1,5 in quotes": (cell(20, "v", '"1;5"'), "no number"),
    "hexadecimal": (cell(20, "v", "0x1p3"), "no number"),
    "minus in Unicode": (cell(20, "v", "−0.5"), "no number"),
    "true": (cell(20, "v", "true"), "no number"),
    "time missing": (cell(20, "time", ""), "no time"),
    "time NaN": (cell(20, "time", "nan"), "no time"),
    "time infinite": (cell(20, "time", "inf"), "no number"),
    "time of day": (cell(20, "time", "12:00:09"), "no number"),
    "time twice": (cell(20, "time", "9.0"), "twice"),
    "time back": (cell(20, "time", "2.25"), "goes back"),
    "time reversed": (frame(lambda f: f.iloc[::-1]), "goes back"),
    "time constant": (frame(lambda f: f.assign(time=5)), "twice"),
    "rows shuffled": (frame(lambda f: f.sample(frac=1, random_state=0)), "goes back"),
    "the log twice": (text(lambda g: g + "\n".join(ROWS[1:]) + "\n"), "goes back"),
    "no time": (without("time"), "clock.from"),
    "no position": (without("N"), "columns.north.from"),
    "no heading": (without("heading"), "columns.psi.from"),
    "no speed": (without("u"), "columns.u.from"),
    "no yaw rate": (without("rot"), "columns.r.from"),
    "no shaft": (without("rpm"), "propeller.n"),
    "another case": (renamed("heading", "Heading"), "did you mean 'Heading'"),
    "a column twice": (renamed("v", "u"), "twice"),
    "an invisible name": (renamed("u", "u\u200b"), "columns.u.from"),
    "a very long line": (text(lambda g: g + "9" * 2_000_000 + "\n"), ""),
    "a very long name": (renamed("u", "u" * 100_000), "columns.u.from"),
    "control characters": (renamed("u", "\x1b[31mu\x07"), "columns.u.from"),
    "huge": (text(lambda g: g + (ROWS[-1] + "\n") * 50_000), "twice"),
    "many columns": (
        text(
            lambda _: (
                ",".join(map(str, range(400))) + "\n" + ",".join(["1"] * 400) + "\n" + ",".join(["2"] * 400) + "\n"
            )
        ),
        "clock.from",
    ),
}

WRONG_UNITS: dict[str, tuple[Write, str]] = {
    # they import, for nothing in a cell says so, but the checks say it
    "speed in knots": (frame(lambda f: f.assign(u=f["u"].astype(float) / 0.514444)), "path"),
    "heading in radians": (frame(lambda f: f.assign(heading=np.radians(f["heading"].astype(float)))), "heading"),
    "rate in deg/s": (frame(lambda f: f.assign(rot=f["rot"].astype(float) / 60)), "heading scale"),
    "rate to port": (frame(lambda f: f.assign(rot=-f["rot"].astype(float))), "heading scale"),
    "shaft in 1/s": (frame(lambda f: f.assign(rpm=1e4)), "range propeller.n"),
    "position in km": (frame(lambda f: f.assign(N=f["N"].astype(float) / 1e3, E=f["E"].astype(float) / 1e3)), "path"),
    "frozen": (frame(lambda f: f.iloc[np.arange(120) // 4 * 4].assign(time=T)), "frozen"),
}


def shipid(*arguments: str) -> tuple[int, str]:
    """Run a command as the entry point does: its status, and the one line of an error."""
    result = CliRunner().invoke(app, list(arguments))
    if isinstance(result.exception, ShipidError):
        return 1, str(result.exception)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.output


def left(folder: Path) -> set[str]:
    return {str(file.relative_to(folder)) for file in folder.rglob("*")}


def test_there_are_enough() -> None:
    assert len(IMPORTS) + len(WRONG_UNITS) + len(SPECIAL) >= 60


def test_the_log_they_come_from_is_good(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(GOOD)
    status, output = shipid(
        "data", "import", str(PLAIN), str(tmp_path / "log.csv"), "--out", str(tmp_path / "o.parquet")
    )
    assert status == 0, output


@pytest.mark.parametrize("name", IMPORTS)
def test_import(name: str, tmp_path: Path) -> None:
    write, part = IMPORTS[name]
    log = tmp_path / "log.csv"
    write(log, GOOD)
    before = left(tmp_path)
    status, output = shipid("data", "import", str(PLAIN), str(log), "--out", str(tmp_path / "out" / "o.parquet"))
    assert status == 1
    assert_one_line(output, log, part)
    assert left(tmp_path) == before


def assert_one_line(message: str, log: Path, part: str) -> None:
    assert message.startswith(str(log))
    assert part in message
    assert message.isprintable()
    assert len(message) < 800


@pytest.mark.parametrize("name", IMPORTS)
def test_guess(name: str, tmp_path: Path) -> None:
    """A draft, where enough can be read, or one line; never half a draft."""
    log = tmp_path / "log.csv"
    IMPORTS[name][0](log, GOOD)
    before = left(tmp_path)
    status, output = shipid("data", "import", "--guess", str(log), "--out", str(tmp_path / "draft.toml"))
    if status == 0:
        assert left(tmp_path) == before | {"draft.toml", ".shipid", ".shipid/mapping.schema.json"}
        return
    assert_one_line(output, log, "")
    assert left(tmp_path) == before


@pytest.mark.parametrize("name", WRONG_UNITS)
def test_wrong_units_are_reported_by_the_checks(name: str, tmp_path: Path) -> None:
    write, part = WRONG_UNITS[name]
    write(tmp_path / "log.csv", GOOD)
    out = str(tmp_path / "o.parquet")
    status, output = shipid("data", "import", str(PLAIN), str(tmp_path / "log.csv"), "--out", out)
    assert status == 0, output
    status, output = shipid("data", "check", out)
    assert status == 1
    assert part in output.partition("what to look at")[2]


def a_folder(folder: Path) -> Path:
    (folder / "log.csv").mkdir()
    return folder / "log.csv"


def a_dead_link(folder: Path) -> Path:
    (folder / "log.csv").symlink_to(folder / "nowhere")
    return folder / "log.csv"


def an_absent_file(folder: Path) -> Path:
    return folder / "log.csv"


SPECIAL = {"a folder": a_folder, "a dead link": a_dead_link, "absent": an_absent_file}


@pytest.mark.parametrize("name", SPECIAL)
@pytest.mark.parametrize("arguments", [("data", "import", str(PLAIN)), ("data", "import", "--guess")])
def test_no_file(name: str, arguments: tuple[str, ...], tmp_path: Path) -> None:
    log = SPECIAL[name](tmp_path)
    before = left(tmp_path)
    ending = "toml" if "--guess" in arguments else "parquet"
    status, output = shipid(*arguments, str(log), "--out", str(tmp_path / f"o.{ending}"))
    assert status == 1
    assert_one_line(output, log, "cannot be read")
    assert left(tmp_path) == before


FORMATS = {
    "parquet": b"PAR1" + bytes(100) + b"PAR1",
    "mat": b"MATLAB 5.0 MAT-file, damaged".ljust(128, b" ") + bytes(50),
    "nmea": b"$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*00\n" * 9,
}


@pytest.mark.parametrize("kind", FORMATS)
def test_damaged_files_of_other_formats(kind: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_bytes(FORMATS[kind])
    mapping = tmp_path / "m.toml"
    mapping.write_text(PLAIN.read_text().replace("[clock]", f'[format]\nkind = "{kind}"\n[clock]'))
    before = left(tmp_path)
    for arguments in (("data", "import", str(mapping), str(log)), ("data", "import", "--guess", str(log))):
        ending = "toml" if "--guess" in arguments else "parquet"
        status, output = shipid(*arguments, "--out", str(tmp_path / f"o.{ending}"))
        assert status == 1
        assert_one_line(output, log, "")
        assert left(tmp_path) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_place_where_one_may_not_write(tmp_path: Path) -> None:
    as_log(turning(T), tmp_path / "log.csv")
    (tmp_path / "closed").mkdir(mode=0o500)
    out = str(tmp_path / "closed" / "o.parquet")
    status, output = shipid("data", "import", str(PLAIN), str(tmp_path / "log.csv"), "--out", out)
    assert status == 1
    assert "cannot be written" in output


@pytest.mark.parametrize("mark", [",", " "])
def test_a_line_of_a_million_cells_is_refused(mark: str, tmp_path: Path) -> None:
    """Before, a draft said that there is no table of numbers."""
    (tmp_path / "log.csv").write_text("\n".join(mark.join(map(str, range(1_000_000))) for _ in range(2)))
    for arguments in (("--guess",), (str(PLAIN),)):
        status, output = shipid("data", "import", *arguments, str(tmp_path / "log.csv"))
        assert status == 1
        assert ("more than 10000 cells" in output) == (mark == "," or "--guess" in arguments)


@pytest.mark.parametrize("kind", ["mat", "parquet"])
def test_damaged_bytes_are_said_to_be_damaged(kind: str, tmp_path: Path) -> None:
    """Before, some were "cannot be read (None)": the library has errors of the system without a number."""
    table, file = pd.DataFrame({"t": T, "x": np.sin(T)}), tmp_path / f"log.{kind}"
    if kind == "mat":
        savemat(file, {name: table[name].to_numpy() for name in table})
    else:
        table.to_parquet(file)
    whole, random, said = file.read_bytes(), np.random.default_rng(0), []
    for _ in range(40):
        damaged = bytearray(whole)
        for place in random.integers(130, len(damaged) - 8, 10):
            damaged[place] = random.integers(256)
        file.write_bytes(damaged[: None if kind == "parquet" else int(random.integers(130, len(damaged)))])
        try:
            read_log_table(file, READERS[kind].options(kind=kind), "t")
        except DataError as error:
            said.append(str(error))
    assert said
    assert not [one for one in said if "None" in one]
