"""`--json`: one object on standard output and nothing else, with what the tables show."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shipid.cli import app
from shipid.cli.answer import Answer, open_answer
from shipid.document import bundled_documents
from shipid.study.store import DATASET


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
    assert {"accuracy", "drivers", "file"} == set(screened)
    assert answered("study", "check", tiny_run)["faults"] == []
    made = answered("simulate", study)
    assert made["runs"] == 12
    assert {row["set"] for row in made["envelope"]} >= {"test"}


@pytest.mark.slow
def test_data(tiny_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    frame = pd.read_parquet(tiny_run / DATASET)
    checks = answered(
        "data",
        "check",
        tiny_run / DATASET,
        code=CliRunner().invoke(app, ["data", "check", str(tiny_run / DATASET)]).exit_code,
    )
    assert len(checks["checks"]) >= frame["run"].nunique()
    assert "left" in answered("data", "measures", tiny_run / DATASET)
    errors = answered("replay", "gunnerus-28.9", tiny_run / DATASET, "--run", "M00*")
    assert len(errors["errors"]) == 9 + 1, "and all together"
    one = frame[frame["run"] == frame["run"].iloc[0]]
    one[["t", "north", "east", "psi", "u", "v", "r"]].to_csv("log.csv", index=False)
    guess = answered("data", "import", "--guess", "log.csv")
    assert {row["column"] for row in guess["columns"]} >= {"u", "v", "r"}


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
