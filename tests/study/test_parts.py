"""A study of several parts: repetitions and conditions, each a separate run, and a page over all."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import shipid
from shipid.answer.pages import write_pages
from shipid.errors import DocumentError, ResultError, ShipidError
from shipid.hybrid.search import SearchMethod
from shipid.study import store
from shipid.study.check import check_folder
from shipid.study.plan import Plan, read_plan
from shipid.study.results import read_cells, read_results
from tests.study.tiny import events_here, make_run, run_here, tiny_plan, without_figures

pytestmark = pytest.mark.slow

METHODS = [
    {"name": "kernel", "kind": "kernel", "trials": 2, "steps": 2, "terms": 4},
    {"name": "step", "kind": "one-step", "trials": 1, "units": 4, "averaged": 1, "families": ["right", "none"]},
]
FOUR: dict[str, Any] = {
    "method": METHODS,
    "grid.N_D": [4],
    "repeat": {"seed": [0, 1]},
    "condition": [{"name": "held"}, {"name": "known", "set": {"prediction.commands": "known"}}],
}


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, Path]:
    """A finished study of two worlds in two conditions."""
    folder = tmp_path_factory.mktemp("parts")
    plan = tiny_plan(folder, FOUR)
    run_here(plan, folder / "run")
    with without_figures():
        write_pages(folder / "run")
    return plan, folder / "run"


def test_every_repetition_in_every_condition_is_a_study(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, FOUR)
    assert list(plan.parts) == ["held-1", "held-2", "known-1", "known-2"]
    assert [part.condition for part in plan.parts.values()] == ["held", "held", "known", "known"]
    assert [part.plan.study.prediction.commands for part in plan.parts.values()] == ["held", "held", "known", "known"]
    assert [part.plan.study.seed for part in plan.parts.values()] == [0, 1, 0, 1]
    assert not any(part.plan.parts for part in plan.parts.values())
    digests = {part.plan.digest for part in plan.parts.values()}
    assert len(digests | {plan.digest}) == 5
    alone = tiny_plan(tmp_path, {key: FOUR[key] for key in ("method", "grid.N_D")} | {"seed": 1})
    assert plan.parts["held-2"].plan.digest == alone.digest
    assert not alone.parts
    only = tiny_plan(tmp_path, {**FOUR, "condition": []})
    assert list(only.parts) == ["1", "2"]


def test_a_part_is_the_run_that_it_would_be_alone(four: tuple[Plan, Path], tmp_path: Path) -> None:
    plan, folder = four
    alone = tiny_plan(tmp_path, {**plan.parts["known-2"].plan.changes})
    assert not alone.parts
    run_here(alone, tmp_path / "alone")
    kept = [store.read_rows(part)[["cell", "H"]] for part in (store.part_folder(folder, "known-2"), tmp_path / "alone")]
    pd.testing.assert_frame_equal(*kept)


@pytest.mark.parametrize("foreign", [True, False])
def test_a_part_that_is_another_is_refused(foreign: bool, four: tuple[Plan, Path], tmp_path: Path) -> None:
    """Parts of another study, or two that changed places, were reported under the name of their folder."""
    folder = shutil.copytree(four[1], tmp_path / "run")
    parts = folder / store.PARTS
    if foreign:
        plan = tiny_plan(tmp_path, {**four[0].parts["held-1"].plan.changes, "truth.seed": 9})
        shutil.rmtree(parts / "held-1")
        run_here(plan, parts / "held-1")
    else:
        (parts / "held-1").rename(tmp_path / "held-1")
        (parts / "known-1").rename(parts / "held-1")
        (tmp_path / "held-1").rename(parts / "known-1")
    for look in (check_folder, write_pages, read_cells, lambda folder: list(events_here(four[0], folder))):
        with pytest.raises(ResultError, match=r"held-1: is not part held-1 of this study: move it away, and resume"):
            look(folder)


def test_the_folder_has_a_page_over_all_and_one_for_each(four: tuple[Plan, Path]) -> None:
    plan, folder = four
    assert "methods-table" in (folder / "report.html").read_text()
    assert (folder / "answer.txt").read_text().count("errs least") == 2  # a sentence for each condition
    frame = pd.read_csv(folder / "methods.csv")
    assert set(frame.condition) == {"held", "known"}
    assert set(frame.worlds[frame.method.eq("step")]) == {2}
    for name in plan.parts:
        assert (store.part_folder(folder, name) / "report.html").is_file()
        assert read_results(store.part_folder(folder, name)).complete
    assert store.stored_plan(folder).digest == plan.digest
    assert list(store.stored_plan(folder).parts) == list(plan.parts)


def test_an_interrupted_study_goes_on_in_its_parts(four: tuple[Plan, Path], tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, FOUR)
    events = events_here(plan, tmp_path / "run")
    for event in events:
        if event.kind == "cell" and event.done == 8:  # in the second part
            break
    events.close()  # type: ignore[attr-defined]
    with without_figures():
        write_pages(tmp_path / "run")  # of what is there
    again = run_here(store.stored_plan(tmp_path / "run"), tmp_path / "run")
    start = next(event for event in again if event.kind == "start")
    assert 6 <= start.done < start.total == again[-1].total == again[-1].done
    for name in plan.parts:
        rows = [store.read_rows(store.part_folder(folder, name)) for folder in (tmp_path / "run", four[1])]
        pd.testing.assert_frame_equal(rows[0][["cell", "H"]], rows[1][["cell", "H"]])


def test_results_of_several_parts_are_read_one_by_one(four: tuple[Plan, Path], tmp_path: Path) -> None:
    plan, folder = four
    with pytest.raises(ResultError, match="several parts"):
        read_results(folder)
    cells = read_cells(folder)
    assert len(cells) == sum(part.plan.cells for part in plan.parts.values())
    assert set(cells["part"]) == set(plan.parts)
    assert set(cells["condition"]) == {part.condition for part in plan.parts.values()}
    tiny_plan(tmp_path)
    with pytest.raises(ShipidError, match="several parts"):
        shipid.run(tmp_path / "tiny.toml", set=FOUR)
    empty = tmp_path / "run"
    make_run(empty, plan)
    for read in (write_pages, read_cells):
        with pytest.raises(ResultError, match="no cell is finished"):
            read(empty)


BAD: dict[str, tuple[dict[str, Any], str, str]] = {
    "two of a name": ({"condition": [{"name": "a"}, {"name": "a"}]}, "condition.1.name", "two conditions"),
    "a name that is no file": ({"condition": [{"name": "a/b"}]}, "condition.a/b.name", "pattern"),
    "no value": ({"repeat": {"seed": []}}, "repeat.seed", "must be a list of 1 or more entries .it has 0"),
    "a world twice": ({"repeat": {"seed": [0, 1, 0]}}, "repeat", "3 has the settings of 1: equal studies"),
    "equal conditions": (
        {"condition": [{"name": "a"}, {"name": "b", "set": {"prediction.commands": "held"}}]},
        "condition.b.set",
        "b has the settings of a",
    ),
    "an unknown block": ({"repeat": {"sead": [1]}}, "repeat.sead", "did you mean 'seed'"),
    "a part of parts": ({"repeat": {"repeat.seed": [1]}}, "repeat.repeat.seed", "no such block"),
    "a path into a number": ({"repeat": {"truth.seed.x": [1]}}, "repeat.truth.seed.x", "there is no .x."),
    "a wrong value": ({"repeat": {"prediction.step": [-1.0]}}, "prediction.step", "must be above 0"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_wrong_part_is_one_line_before_anything_runs(tmp_path: Path, kind: str) -> None:
    changes, path, message = BAD[kind]
    with pytest.raises(DocumentError, match=message) as caught:
        tiny_plan(tmp_path, changes)
    assert caught.value.path == path


@pytest.mark.parametrize(("name", "count"), [("methods", 4), ("methods-full-scale", 14)])
def test_bundled_comparisons_have_their_parts(name: str, count: int) -> None:
    plan = read_plan(name)
    assert len(plan.parts) == count
    assert len([way for way in plan.methods if way.method.compensates]) >= 8
    budgets = {way.method.budget for way in plan.methods if isinstance(way.method, SearchMethod)}  # of a kernel: None
    assert len(budgets - {None}) == 1  # equal, so that nobody wins by time
