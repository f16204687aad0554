"""The search that goes on, from journals that others write."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from shipid.files import write_json
from shipid.hybrid.journal import open_journal
from shipid.study import seals
from shipid.study.check import search_words
from shipid.study.store import JOURNALS, part_folder, rows_file
from tests.study.tiny import tiny_plan

ONE, OTHER = "right+kernel-N0004-s0", "wrong-1+kernel-N0004-s0"


def row(number: int, value: float) -> dict[str, Any]:
    known = {"number": number, "params": {"units": 2.0}, "value": value, "seconds": 1.0, "epochs": 0}
    return known | {"state": "complete" if value == value else "diverged"}


def test_a_search_is_followed_trial_by_trial_until_its_unit_is_finished(tmp_path: Path) -> None:
    plan, file = tiny_plan(tmp_path, {"method.0.trials": 5}), tmp_path / JOURNALS / "unit.log"
    file.parent.mkdir()
    assert search_words(plan, tmp_path) == ""
    journal = open_journal(file)
    assert search_words(plan, tmp_path) == ""
    journal.add({ONE: [row(0, 0.25)]})
    assert search_words(plan, tmp_path) == f"{ONE}: trial 1/5"
    journal.add({OTHER: [row(0, float("nan"))]})
    assert search_words(plan, tmp_path) == f"{OTHER}: trial 1/5"
    journal.add({ONE: [12]})  # of a budget
    journal.add({ONE: [row(1, 0.04)]})
    with file.open("a") as stream:
        stream.write('{"op_')  # half a line, by another process
    assert search_words(plan, tmp_path) == f"{ONE}: trial 2/12"
    write_json(rows_file(tmp_path, "unit"), [])
    seals.write_seal(tmp_path, "unit", [rows_file(tmp_path, "unit")])
    assert search_words(plan, tmp_path) == ""


def test_searches_of_parts_are_followed(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, {"method.0.trials": 5, "repeat": {"split.seed": [0, 1]}})
    file = part_folder(tmp_path, list(plan.parts)[1]) / JOURNALS / "unit.log"
    file.parent.mkdir(parents=True)
    open_journal(file).add({ONE: [row(0, 1.0)]})
    assert search_words(plan, tmp_path).startswith(f"{ONE}: trial 1/5")
