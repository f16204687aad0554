"""Means over foundations: members that a study declares, beside the foundations of which they are the mean."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit
from pandas.testing import assert_frame_equal

from shipid.answer.findings import _errors_by_step
from shipid.answer.methods import WITH_PHYSICS, method_cells, method_table
from shipid.answer.pages import write_pages
from shipid.answer.sentences import answer_sentences
from shipid.data.windows import to_frame
from shipid.errors import DocumentError
from shipid.predictor import Predictor
from shipid.study.apply import NO_PATH_ALONE, predict_log
from shipid.study.cells import EQUAL_WEIGHTS
from shipid.study.plan import Batch, Plan, build_plan
from shipid.study.results import read_results
from shipid.study.store import cell_file
from shipid.vessel.load import load_vessel
from tests.study.tiny import MIXED, run_here, tiny_plan

EQUAL, WEIGHED = {"name": "equal", "mean_of": ["*"], "weights": "equal"}, {"name": "weighed", "mean_of": ["*"]}


def plan_of(folder: Path, **changes: Any) -> Plan:
    document = tiny_plan(folder).document | {
        "method": [*MIXED, {"name": "rival", "kind": "regression", "families": ["none"]}],
        "grid": {"N_D": [2, 6], "seeds": [0]},
        "model": [EQUAL, WEIGHED],
    }
    return build_plan(document | changes, folder / "tiny.toml")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, Path]:
    folder = tmp_path_factory.mktemp("means")
    plan = plan_of(folder)
    run_here(plan, folder / "run")
    return plan, folder / "run"


def test_every_method_that_learns_from_all_parts_has_its_mean(finished: tuple[Plan, Path]) -> None:
    plan, _ = finished
    met = {way.name for name, way in plan.pairs if name == "equal"}
    parts = next(one.mean_of for one in plan.foundations if one.name == "equal")
    assert met == {way.name for way in plan.methods if {*parts} <= {*way.foundations} and way.method.compensates}
    assert met
    for unit in plan.units:
        for method in {way for name, way in unit.pairs if name == "equal"}:
            assert {(part, method) for part in parts} <= {*unit.pairs}


def test_paths_are_the_mean_and_the_error_is_no_greater_than_the_mean_of_errors(finished: tuple[Plan, Path]) -> None:
    plan, folder = finished
    results = read_results(folder)
    parts = next(one.mean_of for one in plan.foundations if one.name == "equal")
    cells = results.cells.set_index(["foundation", "method", "N_D"])
    for (name, method, amount), row in cells[cells.index.get_level_values(0).isin(["equal", "weighed"])].iterrows():
        mine = [cells.loc[(part, method, amount), "cell"] for part in parts]
        paths = [results.paths[cell] for cell in mine]
        predictor = Predictor.load(cell_file(folder, row["cell"]))
        weights = predictor.corrector.weights  # type: ignore[attr-defined]
        np.testing.assert_allclose(results.paths[row["cell"]], np.tensordot(weights, paths, 1), atol=1e-5)
        assert row["H"] <= weights @ [cells.loc[(part, method, amount), "H"] for part in parts] + 1e-6
        assert row["seconds"] == pytest.approx(sum(cells.loc[(part, method, amount), "seconds"] for part in parts))
        assert np.isnan(row["A"])
        if name == "equal":
            np.testing.assert_array_equal(weights, np.full(len(parts), 1 / len(parts)))
    assert not {"equal", "weighed"} & {*results.physics}
    for row in (one for one in results.rows if one["method"] == "rival"):  # of more runs than it leaves out, too
        np.testing.assert_array_equal(results.paths[row["cell"]], results.regression[Batch(row["N_D"], 0).key])


def test_a_mean_is_shown_and_counted_among_no_physics(finished: tuple[Plan, Path]) -> None:
    _, folder = finished
    write_pages(folder)
    answer, summary = (folder / "answer.txt").read_text(), (folder / "summary.md").read_text()
    assert " equal, a mean of foundations, has H " in answer
    assert "| equal " in summary
    for row in (one for one in read_results(folder).rows if one["foundation"] == "weighed"):
        equal = np.ptp(Predictor.load(cell_file(folder, row["cell"])).corrector.weights) == 0  # type: ignore[attr-defined]
        assert (EQUAL_WEIGHTS in row["sentence"]) == (row["method"] != "kernel") == equal
    assert f"ok: {EQUAL_WEIGHTS}" in summary
    assert EQUAL_WEIGHTS not in answer
    results = read_results(folder)
    trained = replace(results.plan, methods=[way for way in results.plan.methods if way.name == "trained"])
    assert EQUAL_WEIGHTS in " ".join(text for text, _ in answer_sentences(replace(results, plan=trained)))
    counted = [line for line in answer.splitlines() if "physics models do" in line]
    assert all("equal" not in line and "weighed" not in line for line in counted)
    assert results.complete
    assert not {"equal", "weighed"} & {*_errors_by_step(results, 6)}
    cells = method_cells(results)
    tables = [method_table(one, "kernel") for one in (cells, cells[~cells["family"].isin(["equal", "weighed"])])]
    assert_frame_equal(*(one[one["family"] == WITH_PHYSICS].reset_index(drop=True) for one in tables))


def test_along_a_log_each_part_has_its_own_actuators(tmp_path: Path) -> None:
    document = tiny_plan(tmp_path).document
    vessel = dict(load_vessel("gunnerus-28.9").document)
    actuator = {"n": {"kind": "first_order", "T": 4.0, "rate": 0.1}}
    vessel["thruster"] = {name: {**one, "actuator": actuator} for name, one in vessel["thruster"].items()}
    (tmp_path / "lazy.toml").write_text(tomlkit.dumps(vessel))
    lazy = {"name": "lazy", "base": "./lazy.toml"}
    wrong = {"parameters": ["hull.derivatives.X_u|u|"], "factor": [-100.0, -90.0], "change_sign": True}
    families = [*document["family"], lazy, {"name": "mad", "base": "gunnerus-28.9", "perturb": [wrong]}]
    plan = plan_of(tmp_path, family=families, model=[EQUAL], method=MIXED[:1], grid={"N_D": [4]})
    run_here(plan, tmp_path / "run")
    results = read_results(tmp_path / "run")
    cell, said = next((row["cell"], row["sentence"]) for row in results.rows if row["foundation"] == "equal")
    frame, _ = predict_log(tmp_path / "run", cell, tmp_path / "run" / "dataset.parquet", None, tmp_path / "out.parquet")
    assert said.startswith("mad: physics diverges on ")
    assert any(text.startswith("physics diverges on ") for text in frame.attrs["limits"])
    assert frame["physics_north"].isna().all()
    assert NO_PATH_ALONE in frame.attrs["limits"]
    test, steps = results.test, results.test.horizon
    for place in range(0, len(test), 3):
        rows = frame[(frame["run"] == test.run[place]) & np.isclose(frame["t"], test.t[place])]
        here = (test.columns[name][place] for name in ("north", "east", "psi"))
        x, y = to_frame(rows["cooperative_north"].to_numpy(), rows["cooperative_east"].to_numpy(), *here)
        np.testing.assert_allclose(np.stack([x, y], axis=1), results.paths[cell][:, place], atol=1e-4)
        assert len(rows) == steps


@pytest.mark.parametrize(
    ("model", "words"),
    [
        ({"name": "m", "mean_of": ["nothing"]}, "'nothing' is no family with physics"),
        ({"name": "m", "mean_of": ["none"]}, "'none' is no family with physics"),
        ({"name": "m", "mean_of": ["right", "right"]}, "a family stands there twice"),
        ({"name": "m", "mean_of": ["right"]}, "right: a mean takes two foundations or more"),
        ({"name": "Right", "mean_of": ["*"]}, "model.Right.name: 'Right' is a family, or no physics: rename the mean"),
        ({"name": "None", "mean_of": ["*"]}, "model.None.name: 'None' is a family, or no physics: rename the mean"),
        ({"name": "m", "mean_of": ["*"], "weights": "heavy"}, "weights"),
    ],
)
def test_a_mean_that_cannot_be_is_one_line(tmp_path: Path, model: dict[str, Any], words: str) -> None:
    with pytest.raises(DocumentError, match=words):
        plan_of(tmp_path, model=[model])
