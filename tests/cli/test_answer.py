"""`--json`: one object on standard output and nothing else, with what the tables show."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from shipid.cli import answer, app
from shipid.cli.answer import Answer, open_answer
from shipid.document import bundled_documents


def answered(*arguments: object, code: int = 0) -> dict[str, Any]:
    """What a command says as JSON; standard output must hold nothing else."""
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == code, result.output
    document: dict[str, Any] = json.loads(result.stdout, parse_constant=pytest.fail)  # NaN is no JSON
    return document


def test_lists_and_one_vessel() -> None:
    assert [row["name"] for row in answered("vessel", "list")["vessels"]] == list(bundled_documents("models"))
    assert [row["name"] for row in answered("study", "list")["studies"]] == list(bundled_documents("studies"))
    ship = answered("vessel", "show", "gunnerus-28.9-6dof")
    assert ship["particulars"]["L_pp"] == 28.9
    assert all(isinstance(row["value"], float) for row in ship["parameters"])


def test_studies(study: Path, tiny_run: Path) -> None:
    screened = answered("study", "screen", study, "--members", 3)
    assert {"accuracy", "file"} == set(screened)
    assert answered("study", "check", tiny_run)["faults"] == []
    made = answered("simulate", study)
    assert made["runs"] == 12
    assert {row["set"] for row in made["envelope"]} >= {"test"}


def test_numbers_and_files_of_an_answer_are_json(capsys: pytest.CaptureFixture[str]) -> None:
    with open_answer(True) as answer:
        answer.say("two faults", faults=np.int64(2), worst=np.nan, file=Path("a"), many=np.arange(2))
        answer.say("a heading")
    assert json.loads(capsys.readouterr().out) == {"faults": 2, "worst": None, "file": "a", "many": [0, 1]}
    with pytest.raises(ValueError, match="broken"), open_answer(True):
        raise ValueError("broken")
    assert capsys.readouterr().out == "", "half an answer is none"


def test_people_see_tables_and_lines(capsys: pytest.CaptureFixture[str]) -> None:
    answer = Answer(False)
    answer.say("a heading", number=1)
    answer.say()
    answer.records("rows", [{"a": 1, "b": 2}], {"a": "a"})
    answer.records("none", [{"a": 1}], shown=[])
    assert [line.strip() for line in capsys.readouterr().out.splitlines() if line.strip("─ ")] == [
        "a heading",
        "a",
        "1",
    ]


def test_without_a_terminal_a_row_is_one_line_and_columns_stay_in_line(capsys: pytest.CaptureFixture[str]) -> None:
    """A search for a name finds the whole row."""
    from shipid.cli.answer import print_table

    print_table(["ship", "H [m]"], [["b", "[bold]4"], ["a", "x" * 300]])
    first, heading, rule, *rows, last = capsys.readouterr().out.splitlines()
    assert (first, heading, last) == ("", "  ship   H [m]", "")
    assert rows == ["  b      [bold]4", f"  a      {'x' * 300}"]
    assert set(rule.strip()) == {"\u2500"}


def test_digits() -> None:
    from shipid.cli.answer import four_digits

    assert [four_digits(value) for value in (1.23456, -0.00001, float("nan"), 1.6e9)] == [
        "1.235",
        "0",
        "-",
        "1600000000.0",
    ]


def test_a_table_of_measures_has_no_minus_zero(capsys: pytest.CaptureFixture[str]) -> None:
    from shipid.cli.answer import MEASURE_FORMATS, MEASURES, Answer

    row = {"measure": "lateral deviation", "value": -1e-7, "unit": "m", "lengths": -3e-9, "note": ""}
    Answer(False).records("measures", [row], MEASURES, MEASURE_FORMATS)
    out = capsys.readouterr().out
    assert "0.00" in out
    assert "-" not in out


def test_long_cells_are_no_silence(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:

    monkeypatch.setattr(answer, "SILENCE", 0.02)
    looks, done = iter(["", "trial 1", "trial 2", "trial 2"]), threading.Event()

    def look() -> str:
        if (word := next(looks, None)) is None:
            done.set()
        return "trial 2" if word is None else word

    with answer.show_steps(look=look):
        assert done.wait(60)
    assert capsys.readouterr().err.splitlines() == ["trial 1", "trial 2"], "each once"


def test_an_interruption_says_what_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    from shipid.cli.answer import end_on_interrupt

    with pytest.raises(SystemExit) as end, end_on_interrupt("what is finished is kept"):
        raise KeyboardInterrupt
    assert end.value.code == 130
    assert capsys.readouterr().err == "what is finished is kept\n"
