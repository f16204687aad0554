"""No command writes over what it reads, and nothing is lost by the attempt; Ctrl-C is answered with one line."""

from __future__ import annotations

import os
import re
import shutil
import signal
from pathlib import Path

import pytest
import typer.main

from shipid.cli import app
from shipid.cli.outputs import OUTPUTS, GuardedCommand, check_output
from shipid.document import bundled_documents
from shipid.errors import ShipidError
from tests.cli.running import ended, output_of


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a vessel and a dataset."""
    folder = tmp_path_factory.mktemp("made")
    shutil.copy(bundled_documents("models")["mariner"], folder / "ship.toml")
    words = ["zigzag", "10", "10", "--out", folder / "page.html", "--log", folder / "log.parquet"]
    output_of("manoeuvre", folder / "ship.toml", *words)
    return folder


@pytest.fixture
def there(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(shutil.copytree(made, tmp_path / "there"))
    Path("link.html").symlink_to("ship.toml")
    Path("link.parquet").symlink_to("log.parquet")
    return tmp_path / "there"


@pytest.mark.parametrize(
    "words",
    [
        "manoeuvre ./ship.toml zigzag 20 20 --out ship.toml",
        "manoeuvre ./ship.toml zigzag 20 20 --out link.html",
        "data measures log.parquet --csv log.parquet",
        "data measures log.parquet --csv ../there/log.parquet",
        "data measures link.parquet --csv log.parquet",
        "replay ./ship.toml log.parquet --csv log.parquet",
    ],
)
def test_what_is_read_is_not_written(words: str, there: Path) -> None:
    before = {file.name: file.read_bytes() for file in there.iterdir()}
    status, _, error = ended(*words.split())
    assert status == 1
    assert "is named twice" in error
    assert {file.name: file.read_bytes() for file in there.iterdir()} == before


@pytest.mark.parametrize(
    "words",
    [
        "data import gunnerus-2022 --out a.csv",
        "simulate quick --out a.csv",
        "manoeuvre mariner zigzag 10 10 --log a.csv",
        "manoeuvre mariner zigzag 10 10 --out a.htm",
        "data check log.parquet --html a.htm",
        "aboard log.parquet --predictor a.npz --html a.htm",
        "identify mariner log.parquet --html a.htm",
        "replay mariner log.parquet --out a.htm",
    ],
)
def test_a_dataset_or_page_of_another_ending_is_refused_before_anything_is_read(words: str) -> None:
    file, ending = ("a.csv", ".parquet") if "a.csv" in words else ("a.htm", ".html")
    option = words.split()[-2]
    assert ended(*words.split()) == (1, "", f"error: {file}: {option}: let the name end in {ending}\n")


@pytest.mark.usefixtures("there")
def test_what_cannot_be_written_is_refused_before_anything_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    status, _, error = ended("manoeuvre", "./ship.toml", "zigzag", "20", "20", "--out", "ship.toml/new/a.html")
    assert status == 1
    assert "ship.toml: --out: is a file, not a folder: name another place to write" in error
    monkeypatch.setattr(os, "access", lambda folder, _: Path(folder).name != "locked")
    Path("locked").mkdir()
    for name in ("locked/a.html", "locked/new/a.html"):
        with pytest.raises(ShipidError, match="is in a folder that this user may not write into: name another"):
            check_output(Path(name))
    check_output(Path("new/a.html"))


def test_no_file_of_results_is_written_over(there: Path) -> None:
    """A folder of results, whatever file it is: the seal would say that it was edited."""
    results = there / "results" / "quick"
    for name in ("study.toml", "provenance.json", "cells/a.parquet"):
        (results / name).parent.mkdir(parents=True, exist_ok=True)
        (results / name).write_text("sealed")
    status, _, error = ended("data", "measures", "log.parquet", "--csv", "results/quick/cells/a.parquet")
    assert status == 1
    assert "--csv: belongs to the results of a study" in error
    assert (results / "cells/a.parquet").read_text() == "sealed"


@pytest.mark.parametrize("value", ["inf", "-inf", "nan"])
@pytest.mark.parametrize(
    "words",
    ["data measures log.parquet --length", "replay ./ship.toml log.parquet --step",
     "manoeuvre ./ship.toml stop --speed",
     "aboard log.parquet --predictor cell.npz --every"],
)  # fmt: skip
@pytest.mark.usefixtures("there")
def test_numbers_are_finite(words: str, value: str) -> None:
    status, _, error = ended(*f"{words}={value}".split())
    assert status in (1, 2)  # shipid's, or Typer's, which checks ranges first
    assert re.fullmatch(rf"error: (--\w+: {value}: must be a finite number|Invalid value for '--\w+': .+)\n", error)
    status, _, error = ended("manoeuvre", "./ship.toml", "turning", "--", value)
    assert (status, error) == (1, f"error: ANGLES: {value}: must be a finite number\n")


def test_every_command_is_guarded() -> None:
    """Also one that is added later, if its output has one of the names."""

    def commands(group: object) -> list[object]:
        inner = list(getattr(group, "commands", {}).values())
        return [leaf for one in inner for leaf in commands(one)] if inner else [group]

    leaves = commands(typer.main.get_command(app))
    assert len(leaves) > 20
    assert all(isinstance(one, GuardedCommand) for one in leaves)
    assert {param.name for one in leaves for param in one.params} >= set(OUTPUTS)


def test_ctrl_c_is_one_line_in_every_command(monkeypatch: pytest.MonkeyPatch) -> None:
    def pressed(*_: object) -> None:
        raise KeyboardInterrupt

    def pressed_in_compiled_code(*_: object) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise SystemError("returned a result with an exception set") from None

    for press in (pressed, pressed_in_compiled_code):
        monkeypatch.setattr("shipid.document.bundled_documents", press)
        assert ended("study", "list") == (130, "", "interrupted\n")
