"""The state of searches that go on, from journals that others write."""

from __future__ import annotations

import json
from math import inf
from pathlib import Path
from typing import Any

from optuna.distributions import FloatDistribution

from shipid.files import write_json
from shipid.hybrid.journal import Journal
from shipid.study import seals
from shipid.study.progress import SearchProgress, Watch
from shipid.study.store import JOURNALS, TRIALS, part_folder, rows_file
from tests.study.tiny import tiny_plan

SPACE = {"units": FloatDistribution(1, 100, log=True)}


def row(number: int, value: float) -> dict[str, Any]:
    known = {"number": number, "params": {"units": 2.0}, "value": value, "seconds": 1.0, "epochs": 0}
    return known | {"state": "complete" if value == value else "diverged"}


def test_a_search_is_followed_trial_by_trial(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, {"method.0.trials": 5})
    watch, file = Watch(plan, tmp_path), tmp_path / JOURNALS / "unit.log"
    file.parent.mkdir()
    assert watch.look() == []
    one, other = "right+drawn-N0004-s0", "wrong-1+drawn-N0004-s0"
    journal = Journal(file)
    journal.add({one: [row(0, 0.25)]}, SPACE)
    assert watch.look() == [SearchProgress(one, 1, 5, 0.25)]
    journal.add({one: [row(1, float("nan"))], other: [row(0, float("nan"))]}, SPACE)
    running = {search.cell: search for search in watch.look()}
    assert running == {one: SearchProgress(one, 2, 5, 0.25), other: SearchProgress(other, 1, 5, inf)}
    assert running[one].words == f"{one}: trial 2/5, best so far 0.5 m rms"
    assert running[other].words == f"{other}: trial 1/5"
    journal.add({other: [row(1, 0.04)]}, SPACE)
    assert watch.look()[0] == SearchProgress(other, 2, 5, 0.04), "the one that moved last comes first"
    journal.add({other: [row(number, 0.09) for number in (2, 3, 4)]}, SPACE)
    assert [search.cell for search in watch.look()] == [one], "all its trials have ended"
    write_json(rows_file(tmp_path, "unit"), [])
    seals.write_seal(tmp_path, "unit", [rows_file(tmp_path, "unit")])
    assert watch.look() == [], "the unit is finished"


def test_a_budget_says_its_number_when_it_knows_it(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, {"method.0.budget": 10.0})
    (tmp_path / JOURNALS).mkdir()
    watch, journal, cell = Watch(plan, tmp_path), Journal(tmp_path / JOURNALS / "unit.log"), "right+drawn-N0004-s0"
    journal.decide([cell], 12)
    journal.add({cell: [row(0, 0.01)]}, SPACE)
    assert watch.look() == [SearchProgress(cell, 1, 12, 0.01)]


def test_half_a_line_and_foreign_lines_do_no_harm(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, {"method.0.trials": 5})
    (tmp_path / JOURNALS).mkdir()
    watch, file, cell = Watch(plan, tmp_path), tmp_path / JOURNALS / "unit.log", "right+drawn-N0004-s0"
    Journal(file).add({cell: [row(0, 0.01)]}, SPACE)
    whole = file.read_bytes()
    for cut in (len(whole) - 5, len(whole)):
        file.write_bytes(whole[:cut])
        running = watch.look()
    assert running == [SearchProgress(cell, 1, 5, 0.01)]
    with file.open("a") as stream:
        stream.write('no json\n[1]\n{"op_code": 4}\n{"op_code": 2, "study_id": 9, "user_attr": {"trials": 3}}\n')
    assert watch.look() == running


def test_parts_of_a_study_have_cells_of_the_same_names(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, {"method.0.trials": 5, "repeat": {"split.seed": [0, 1]}})
    cell, watch = "right+drawn-N0004-s0", Watch(plan, tmp_path)
    for name, count in zip(plan.parts, (4, 3), strict=True):
        file = part_folder(tmp_path, name) / JOURNALS / f"{cell}.log"
        file.parent.mkdir(parents=True)
        Journal(file).add({cell: [row(number, 1.0) for number in range(count)]}, SPACE)
    assert sorted(search.done for search in watch.look()) == [3, 4]


def test_a_finished_run_searches_no_more(tiny_run: Path, tmp_path: Path) -> None:
    assert Watch(tiny_plan(tmp_path), tiny_run).look() == []
    entries = [json.loads(line) for line in (tiny_run / TRIALS).read_text().splitlines()]
    assert sum(entry["op_code"] == 4 for entry in entries) == 8, "the law above would be empty without trials"
