"""The command line as a whole: help, mistakes in one line, interruptions, logging."""

from __future__ import annotations

import errno
import os
import re
import sys
from collections.abc import Callable
from typing import Any

import pytest
import typer

import shipid
from shipid import cli
from tests.cli.running import BAD, ended, shell


def test_help_version_and_vessels_are_light() -> None:
    """Nobody waits for PyTorch to read a help page, or for arrays and symbols to read a vessel."""
    heavy = {"torch", "casadi", "pandas", "optuna", "numpy", "dask", "plotly", "pyarrow"}
    asked = (["--help"], ["--version"], ["study", "run", "--help"], ["vessel"], ["vessel", "show", "gunnerus-28.9"])
    code = (
        f"import sys\nfrom shipid.cli import main\nfor words in {asked!r}:\n    sys.argv[1:] = words\n"
        "    try:\n        main()\n    except SystemExit as end:\n"
        f"        print('ended', end.code, sorted({heavy!r} & set(sys.modules)))"
    )
    result = shell(code=code)
    assert re.findall(r"^ended (?:0|2|None) \[\]$", result.stdout, re.MULTILINE) == re.findall("ended.*", result.stdout)
    assert result.stdout.count("ended ") == len(asked), result
    assert shipid.__version__ in result.stdout


def test_commands_that_no_word_names_keep_their_help() -> None:
    """And the one that is named is whole."""

    def commands(group: Any, path: str) -> dict[str, Any]:
        inner = getattr(group, "commands", {}).items()
        return {path: group} | {
            key: one for name, below in inner for key, one in commands(below, f"{path} {name}").items()
        }

    whole, narrow = (
        commands(typer.main.get_command(app), "shipid")
        for app in (cli.app, cli.narrow_commands(cli.app, ["study", "run"]))
    )
    assert {path: one.help for path, one in narrow.items()} == {path: one.help for path, one in whole.items()}
    options, known = (
        {path: [param.name for param in one.params] for path, one in tree.items()} for tree in (narrow, whole)
    )
    assert options["shipid study run"] == known["shipid study run"]
    assert known["shipid study new"]
    assert not options["shipid study new"]


@pytest.mark.parametrize(
    ("raised", "line"),
    [
        (RuntimeError("can't start new thread"), "error: system: can't start new thread: .*raise `ulimit -u`, or .*"),
        (
            OSError(errno.EAGAIN, "Busy"),
            "error: system: Busy: this user has too many processes and threads: end some.*",
        ),
        (OSError(errno.EMFILE, "Too many"), "error: system: Too many: raise `ulimit -n`"),
        (OSError(errno.ENOENT, "None", "a.toml"), r"error: a\.toml: None"),
    ],
)
def test_an_error_of_the_system_that_names_no_file_says_what_helps(
    raised: Exception, line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def command() -> Any:
        raise raised

    monkeypatch.setattr(sys, "argv", ["shipid", "study"])
    monkeypatch.setattr(cli, "narrow_commands", lambda *_: command)
    with pytest.raises(SystemExit, match="1"):
        cli.main()
    assert re.fullmatch(line + "\n", capsys.readouterr().err)
    raised = RuntimeError("another one")
    with pytest.raises(RuntimeError, match="another"):
        cli.main()


def test_a_compiled_package_that_cannot_be_loaded_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As under a limit of memory; a name that is missing in Python code is a fault of that code, with its traceback."""

    def refused(error: ImportError) -> Callable[..., Any]:
        def command() -> Any:
            raise error

        return command

    monkeypatch.setattr(sys, "argv", ["shipid", "study"])
    monkeypatch.setattr(cli, "narrow_commands", lambda *_: refused(ImportError("failed to map", path="/lib/_C.so")))
    with pytest.raises(SystemExit, match="1"):
        cli.main()
    assert capsys.readouterr().err.startswith("error: /lib/_C.so: cannot be loaded (failed to map): ")
    monkeypatch.setattr(
        cli, "narrow_commands", lambda *_: refused(ImportError("cannot import name", path="/lib/mine.py"))
    )
    with pytest.raises(ImportError, match="cannot import name"):
        cli.main()


MISTAKES = {
    "unknown vessel": (["vessel", "show", "gunerus-28.9"], "did you mean 'gunnerus-28.9'?"),
    "unknown study": (["study", "run", "quik"], "did you mean 'quick'?"),
    "broken study": (["study", "run", BAD / "studies" / "no-question.toml"], "no-question.toml: question: missing"),
    "no --set path": (["study", "run", "quick", "--set", "grid.N_D"], "write --set path=value"),
    "bad --set value": (["study", "run", "quick", "--set", "grid.N_D=[1000]"], "less 20 test runs leave 100"),
    "no folder": (["study", "resume", "nowhere"], "nowhere: is not the folder of a run: there is no such folder"),
    "foreign folder": (["study", "report", BAD], "holds no study.toml"),
    "broken mapping": (["data", "import", BAD / "mappings" / "unknown_unit.toml", "x.csv"], "valid here: rad/s"),
    "no dataset": (["data", "check", "gone.parquet"], "gone.parquet: cannot be read"),
    "no public log": (["data", "fetch", "gunnerus-2021"], "did you mean 'gunnerus-2022'?"),
    "no cells": (["predict", BAD, "x.parquet", "--cell", "a"], "holds no finished cells"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line(mistake: str, capfd: pytest.CaptureFixture[str]) -> None:
    arguments, remedy = MISTAKES[mistake]
    status, out, err = ended(*arguments)
    assert (status, out) == (1, "")
    assert capfd.readouterr() == ("", "")
    assert re.fullmatch(r"error: [^\n]*\n", err)
    assert remedy in err


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["study", "run"], "Missing argument 'study': `shipid study run --help`"),
        (["study", "run", "quick", "--nonsense"], "No such option: --nonsense: `shipid study run --help`"),
        (["nosuch"], "No such command 'nosuch': `shipid --help`"),
        (["study", "rotate", "q"], "No such command 'rotate': it is retired: write [repeat]"),
        (["data", "join", "a", "b"], "No such command 'join': it is retired: give both mappings one [origin]"),
        (
            ["simulate", "mariner", "--manoeuvres", "m"],
            "No such option: --manoeuvres: it is retired: `shipid study new",
        ),
        (["study", "run", "quick", "--workers", "many"], "Invalid value for '--workers': "),
    ],
)
def test_a_wrong_argument_is_one_line(arguments: list[str], fault: str) -> None:
    """It was four: usage, a hint, a blank and the fault."""
    status, out, err = ended(*arguments)
    assert (status, out) == (2, "")
    assert re.fullmatch(r"error: [^\n]*\n", err)
    assert fault in err


def test_an_argument_that_is_not_utf_8_is_refused_before_any_work() -> None:
    """Documents, pages and tables would have to name the file."""
    code, _, error = ended("study", "run", os.fsdecode(b"caf\xe9.toml"))
    assert code == 1
    assert error == "error: caf\\udce9.toml: is not UTF-8: rename the file or folder, or set LC_ALL=C.UTF-8\n"
