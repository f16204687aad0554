"""Broken and hostile logs: each ends in one line that names the file, and leaves nothing behind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shipid.cli import app
from shipid.errors import ShipidError
from tests.logs.conftest import PLAIN, turning

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


IMPORTS: dict[str, tuple[Write, str]] = {
    # what it is -> how it is made, a part of the line
    "empty": (raw(b""), "the file is empty"),
    "one row": (text(lambda _: "\n".join(ROWS[:2])), "needs two rows"),
    "binary noise": (raw(bytes(np.random.default_rng(0).integers(0, 256, 5000, dtype=np.uint8))), "NUL"),
    "HTML": (text(lambda _: "<!doctype html>\n<html><body>404, not found</body></html>\n" * 3), "a page"),
    "UTF-16 with mark": (text(lambda g: g, "utf-16"), "UTF-16"),
    "cp1252": (text(lambda g: g.replace("heading", "Kurs °"), "cp1252"), "often cp1252"),
    "NUL in the middle": (text(lambda g: g.replace("10.0,", "10.0\0,", 1)), "NUL"),
    "a longer row": (text(lambda g: g + "60.0,1,2,3,4,5,6,7,8,9\n"), "line 122: 10 cells, where the header has 8"),
    "an open quote": (text(lambda g: g.replace("20.0,", '"20.0,', 1)), ""),
    "cut in a row": (text(lambda g: g[: len(g) // 2].rpartition(",")[0]), "cells, where the header has 8"),
    "header in the middle": (text(lambda g: g + HEADER + "\n60.0,1,2,3,4,5,6,7\n"), "repeats the header"),
    "no header": (text(lambda _: "\n".join(ROWS[1:])), "not in the log"),
    "NaN": (cell(20, "u", "NaN"), "max_gap"),
    "infinity": (cell(20, "u", "inf"), "no number"),
    "words for numbers": (cell(20, "v", "stopped"), "no number"),
    "a formula": (cell(20, "v", "=cmd|' /C calc'!A0"), "no number"),
    "minus in Unicode": (cell(20, "v", "−0.5"), "no number"),
    "time missing": (cell(20, "time", ""), "no time"),
    "time of day": (cell(20, "time", "12:00:09"), "no number"),
    "time twice": (cell(20, "time", "9.0"), "twice"),
    "time back": (cell(20, "time", "2.25"), "goes back"),
    "no time": (without("time"), "clock.from"),
    "no position": (without("N"), "columns.north.from"),
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
    "speed in knots": (frame(lambda f: f.assign(u=f["u"].astype(float) / 0.514444)), "sensor u"),
    "rate in deg/s": (frame(lambda f: f.assign(rot=f["rot"].astype(float) / 60)), "sensor r"),
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


@pytest.mark.parametrize("name", [*IMPORTS][::3])
def test_guess(name: str, tmp_path: Path) -> None:
    """A draft, where enough can be read, or one line; never half a draft."""
    log = tmp_path / "log.csv"
    IMPORTS[name][0](log, GOOD)
    before = left(tmp_path)
    status, output = shipid("data", "import", "--guess", str(log), "--out", str(tmp_path / "draft.toml"))
    if status == 0:
        assert left(tmp_path) == before | {"draft.toml"}
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
    assert part in output.partition("what to look at")[2] + output.partition("checks passed")[2]


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
