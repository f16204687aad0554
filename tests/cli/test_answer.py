"""`--json`: one object on standard output and nothing else, with what the tables show."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from shipid.cli import app
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
