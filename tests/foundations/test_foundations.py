"""The law of all simulators: what says the vessel's own paths has the digits of the vessel's own family."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pandas as pd
import pytest

import shipid
from shipid.errors import ShipidError
from shipid.predictor import Predictor
from shipid.study import seals, store
from shipid.study.check import check_folder
from shipid.study.prepare import obtain_runs, prepare
from shipid.study.run import run_study
from shipid.study.windows import windows
from tests.cli.running import ended, output_of
from tests.foundations.ships import simulated_table, study_file
from tests.study.tiny import TINY, run_here, without_figures, without_workers

FAMILIES = """
[[family]]
name = "own"
base = "gunnerus-28.9"
[[family]]
name = "table"
predictions = ["paths.parquet", "again.parquet"]
[[family]]
name = "function"
function = "my_ship:simulate"
[[model]]
name = "mean"
mean_of = ["own", "table", "function"]
"""
METHODS = """
[[method]]
name = "instant"
kind = "kernel"
trials = 2
steps = 2
terms = 4
[[method]]
name = "kernel"
kind = "kernel"
trials = 1
steps = 2
terms = 4
memory = {error = [2.0]}
[[method]]
name = "alone"
kind = "alone"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that was moved; its study and its tables are gone."""
    place = tmp_path_factory.mktemp("others")
    file = study_file(place, FAMILIES, methods=METHODS)
    made = simulated_table(windows(file, every=True, trust=True))
    made.to_parquet(place / "paths.parquet")
    made.drop(columns=["psi", "u", "v", "r"]).to_parquet(place / "again.parquet")
    run_here(shipid.read_plan(file, trust=True), place / "run")
    away = tmp_path_factory.mktemp("moved")
    shutil.move(place / "run", away / "run")
    for name in ("study.toml", "paths.parquet", "again.parquet"):
        (place / name).unlink()
    return away / "run"


def test_a_simulator_of_the_own_paths_has_the_digits_of_the_vessel(folder: Path) -> None:
    cells = shipid.read_results(folder).cells
    assert len(cells) == 2 * (4 * 3 + 2 + 2)
    assert cells["status"].eq("ok").all()
    own = cells[cells["family"].eq("own")].reset_index()
    for foundation in ("table-1", "table-2", "function"):
        mine = cells[cells["foundation"].eq(foundation)].reset_index()
        same = mine["method"].ne("kernel") | (foundation != "table-2")  # whose memory has the place of the ship alone
        for name in ("A", "H", "H_end_90"):
            np.testing.assert_allclose(mine[name][same], own[name][same], rtol=1e-9, err_msg=f"{foundation} {name}")


def test_pages_checks_and_what_is_finished_need_no_code(folder: Path) -> None:
    with without_figures():
        assert "table-1" in shipid.write_pages(folder).read_text()
    assert not check_folder(folder).faults
    assert shipid.read_results(folder).plan.simulators["my_ship:simulate"].digest
    sessions = store.provenance(folder)["sessions"]
    assert sessions[0]["code of the function"] == {
        "my_ship:simulate": shipid.read_results(folder).plan.simulators["my_ship:simulate"].digest
    }


def test_a_moved_folder_resumes_with_its_own_tables_and_with_trust(folder: Path) -> None:
    before = shipid.read_results(folder).cells
    status, _, said = ended("study", "resume", folder)
    assert status
    assert "add --trust" in said
    plan = store.stored_plan(folder, trust=True)
    seals.remove_seal(folder, plan.units[0].key)
    assert [event.kind for event in run_here(plan, folder)].count("cell") == len(plan.units[0].pairs)
    pd.testing.assert_frame_equal(shipid.read_results(folder).cells[["cell", "H"]], before[["cell", "H"]])


def test_the_corrector_alone_is_exported_with_the_path_as_an_input(folder: Path, tmp_path: Path) -> None:
    file = store.cell_file(folder, "table-1+instant-N0006-s0")
    predictor, results = Predictor.load(file), shipid.read_results(folder)
    predictor.export("casadi", tmp_path / "a.casadi")
    function, test = ca.Function.load(str(tmp_path / "a.casadi")), results.test
    names = predictor_names(tmp_path / "a.casadi.json")
    for k in (0, len(test) - 1):
        given = {name: np.array([test.columns[entry][k] for entry in entries]) for name, entries in names.items()}
        path = function(**{**given, "physics": results.physics["table-1"][:, k].ravel()})["path"]
        np.testing.assert_allclose(np.array(path).T, results.paths["table-1+instant-N0006-s0"][:, k], atol=1e-9)
    for to, cell, words in (
        ("c", "table-1+instant", "casadi or onnx writes the corrector alone"),
        ("casadi", "function+kernel", "asks it for more than a path"),
    ):
        with pytest.raises(ShipidError, match=words):
            Predictor.load(store.cell_file(folder, f"{cell}-N0006-s0")).export(to, tmp_path / f"b.{to}")


@pytest.mark.slow
def test_workers_give_the_digits_of_one_process(folder: Path, tmp_path: Path) -> None:
    plan = store.stored_plan(folder, trust=True)
    list(run_study(plan, tmp_path / "run", workers=2))
    both = [shipid.read_results(place).cells for place in (folder, tmp_path / "run")]
    np.testing.assert_array_equal(*(cells.sort_values("cell")["H"] for cells in both))


def predictor_names(file: Path) -> dict[str, list[str]]:
    """Entries of the inputs of an exported predictor that are measured."""
    inputs = json.loads(file.read_text())["inputs"]
    assert [entry["name"] for entry in inputs["physics"]] == ["x", "y"]
    return {"now": [entry["name"] for entry in inputs["now"]]}


def test_a_saved_predictor_takes_the_paths_of_the_physics(folder: Path) -> None:
    results = shipid.read_results(folder)
    predictor = Predictor.load(store.cell_file(folder, "function+instant-N0006-s0"))
    with pytest.raises(ShipidError, match="the physics is my_ship:simulate, which is not in the file"):
        predictor.predict(results.test.instants())
    paths = predictor.predict(results.test.instants(), results.physics["function"])
    np.testing.assert_allclose(paths, results.paths["function+instant-N0006-s0"], atol=1e-12)


def test_a_study_has_the_digits_of_a_task_by_hand(tmp_path: Path) -> None:
    """Paths that fall short by 7 % and run off, as of a user who had no other way than a Task with his own Case."""
    families = '[[family]]\nname = "short"\npredictions = "paths.parquet"\n'
    file = study_file(tmp_path, families, methods=METHODS.replace("memory = {error = [2.0]}", ""))
    cut = windows(file, every=True, with_truth=True).windows
    short = 0.93 * cut.future + 0.02 * np.arange(1, cut.horizon + 1)[:, None, None]
    shipid.prediction_table(cut, short).to_parquet(tmp_path / "paths.parquet")
    plan = shipid.read_plan(file)
    run_here(plan, tmp_path / "run")
    results, prepared = shipid.read_results(tmp_path / "run"), prepare(plan, obtain_runs(plan))
    part, known = plan.batches[0], dict(zip(zip(cut.run, cut.t, strict=True), short.swapaxes(0, 1), strict=True))
    mine = prepared.pool.select(np.isin(prepared.pool.run, prepared.runs(part)))
    before, after = (
        np.stack([known[key] for key in zip(one.run, one.t, strict=True)], axis=1) for one in (mine, prepared.test)
    )
    none = shipid.Physics(None, cut.horizon, cut.step)
    for way in plan.methods[:2]:
        folds = prepared.folds(part, mine, way.method.validation)
        task = shipid.Task({"short": shipid.Case(none, before)}, mine, folds, prepared.commands, seed=part.seed)
        corrector = way.method.fit(task)["short"].corrector
        error = shipid.position_error(corrector.predict(none, prepared.test.instants(), after), prepared.test.future)
        (row,) = (row for row in results.rows if row["cell"] == part.cell("short", way.name))
        assert row["H"] == pytest.approx(error.mean(), rel=1e-9)
        assert row["A"] == pytest.approx(shipid.position_error(after, prepared.test.future).mean(), rel=1e-9)
        assert row["H"] < row["A"] / 2


@pytest.mark.slow
def test_the_page_of_simulators_runs_as_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (Path(__file__).parents[2] / "docs" / "own-simulator.md").read_text(encoding="utf-8")
    for name, code in re.findall(r"^```python\n# (\w+\.py)\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        (tmp_path / name).write_text(code)
    (families, _) = re.findall(r"^```toml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    study = TINY.read_text().split("[[family]]")[0]
    (tmp_path / "mine.toml").write_text(study + families)
    (tmp_path / "table.toml").write_text(f'{study}[[family]]\nname = "mine"\npredictions = "paths.parquet"\n')
    commands = [shlex.split(line) for line in re.findall(r"^\$ (.*)$", page, re.MULTILINE)]
    assert [command[0] for command in commands] == ["shipid", "shipid", "python", "shipid"]
    monkeypatch.chdir(tmp_path)
    with without_figures(), without_workers():
        for program, *arguments in commands:
            if program == "shipid":
                output_of(*arguments)
            else:
                subprocess.run([sys.executable, *arguments], check=True)
    function, table = (shipid.read_results(tmp_path / name).cells for name in ("mine", "table"))
    of_page = [cells[cells["foundation"].eq("mine")].reset_index() for cells in (function, table)]
    np.testing.assert_allclose(*(cells["H"] for cells in of_page), rtol=1e-9)
    assert sorted(function["foundation"].unique()) == ["mine", "none", "rough-1", "rough-2", "rough-3"]
    assert (of_page[0]["H"] < of_page[0]["A"]).all()
