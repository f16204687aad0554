"""Foundations identified from the runs of a batch: their own physics, seen nowhere but there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shipid.data.dataset import Dataset, pieces
from shipid.errors import DocumentError
from shipid.identification import solve
from shipid.predictor import Predictor
from shipid.study import store
from shipid.study.advise import answer
from shipid.study.plan import Batch, Plan
from shipid.study.prepare import prepare, window_memory
from shipid.study.reidentify import apart, foundations
from shipid.study.results import read_results
from tests.study.test_commands import weaving
from tests.study.tiny import run_here

PATHS = ["hull.derivatives.X_u|u|", "hull.derivatives.N_uv", "hull.derivatives.N_ur"]
WEIGHTS = {"u": 0.01, "v": 0.01, "r": 0.001}
FITTED: dict[str, Any] = {"name": "wrong", "base": "gunnerus-28.9", "perturb": [{"parameters": PATHS, "factor": 1.3}]}
FITTED["identify"] = {"parameters": PATHS, "weights": WEIGHTS, "method": "euler"}

Recorded = Callable[..., tuple[Plan, Dataset]]


def study(recorded: Recorded, families: list[dict[str, Any]], **changes: Any) -> tuple[Plan, Dataset]:
    """Runs of the 28.9 m ship itself, commands known: the right numbers leave nothing."""
    ahead = {"horizon": 5, "commands": "known"}
    return recorded(weaving(), split={"test": ["f"]}, prediction=ahead, family=families, grid={"N_D": [3]}, **changes)


def test_a_wrong_model_finds_the_right_numbers(recorded: Recorded) -> None:
    plan, dataset = study(recorded, [FITTED])
    prepared = prepare(plan, dataset)
    found = foundations(plan, prepared, plan.batches[0], "cpu")
    assert list(found) == ["wrong", "wrong-identified", "wrong-both", "none"]
    assert found["wrong"].accuracy(prepared.test)["mean"] > 0.01
    assert found["wrong-both"].accuracy(prepared.test)["mean"] < 1e-4
    variant = found["wrong-both"].model.variant
    assert variant is not None
    right = plan.vessels["gunnerus-28.9"].parameters
    assert [variant.values[path] for path in PATHS] == pytest.approx([right[path] for path in PATHS], rel=1e-3)
    np.testing.assert_array_equal(found["wrong-identified"].test_paths, found["wrong-both"].test_paths)
    assert "converged" in found["wrong-both"].sentence


def test_other_runs_teach_nothing(recorded: Recorded) -> None:
    """What the test run and the runs of no batch hold does not change what is identified."""
    plan, dataset = study(recorded, [FITTED])
    prepared = prepare(plan, dataset)
    batch = plan.batches[0]
    seen = set(prepared.runs(plan, batch))
    frame = dataset.frame.copy()
    frame.loc[~frame["run"].isin(seen), "u"] += 0.3
    other = prepare(plan, Dataset(frame, dataset.metadata))
    pair = [foundations(plan, each, batch, "cpu")["wrong-both"].model.variant for each in (prepared, other)]
    assert pair[0] == pair[1]


def test_moments_of_the_test_are_cut_out_where_runs_share_a_clock(recorded: Recorded) -> None:
    plan, dataset = study(recorded, [FITTED])
    prepared = prepare(plan, dataset)
    assert apart(dataset, prepared.test) is dataset  # every run has a clock of its own
    frame = dataset.frame.copy()
    frame["t"] += 30.0 * (frame["run"].str[0].map(ord) - ord("a"))  # the next begins before one ends
    test = replace(prepared.test, t=prepared.test.t + 150.0, shared_clock=True)
    left = apart(Dataset(frame, {**dataset.metadata, "clock": "shared"}), test).frame
    assert set(left["run"]) == set("abcde")
    assert left[left["run"] == "e"]["t"].max() < 150.0
    assert len(left) == 4 * 41 + 30


def test_cells_stand_side_by_side(tmp_path: Path, recorded: Recorded) -> None:
    """Compensated, identified alone, identified then compensated: rows, stored predictors and the report's paths."""
    plan, _ = study(recorded, [FITTED])
    run_here(plan, tmp_path / "run")
    results = read_results(tmp_path / "run")
    rows = results.cells.set_index("model")
    assert rows.loc["wrong-identified", "H"] == rows.loc["wrong-identified", "A"] == rows.loc["wrong-both", "A"]
    assert rows.loc["wrong-both", "A"] < 0.1 * rows.loc["wrong", "A"]
    assert (rows["status"] == "ok").all()
    dataset, test = results.dataset, results.test
    for row in rows.itertuples():
        predictor = Predictor.load(store.cell_file(tmp_path / "run", str(row.cell)))
        memory = window_memory(predictor.vessel, dataset, test) if predictor.vessel else None
        paths = predictor.predict(test.columns, memory, test.planned)
        np.testing.assert_allclose(results.paths[str(row.cell)], paths, atol=1e-9)
    assert "wrong-both" not in results.physics  # its numbers depend on the cell
    assert not any("wrong-identified" in text for text, _ in answer(results))


def test_what_cannot_be_identified_fails_in_its_own_cells(tmp_path: Path, recorded: Recorded) -> None:
    """Whole runs that diverge under explicit Euler: one sentence, and all other cells are there."""
    bad = {**FITTED, "name": "bad", "identify": {**FITTED["identify"], "step": 20.0, "horizon": 40.0}}
    plan, _ = study(recorded, [bad])
    run_here(plan, tmp_path / "run")
    rows = store.read_rows(tmp_path / "run").set_index("model")
    assert rows.loc["bad", "status"] == rows.loc["none", "status"] == "ok"
    for name in ("bad-identified", "bad-both"):
        assert rows.loc[name, "status"] in ("failed", "diverged")
        assert str(rows.loc[name, "sentence"]).startswith("identification: ")


def test_a_hole_breaks_a_run(recorded: Recorded) -> None:
    plan, dataset = study(recorded, [FITTED])
    test = prepare(plan, dataset).test
    middle = replace(test, t=np.full(len(test), 15.0), shared_clock=True)  # five seconds ahead
    parts = [rows["t"] for run, rows in pieces(apart(dataset, middle)) if run == "a"]
    assert [(part.min(), part.max()) for part in parts] == [(0.0, 14.0), (21.0, 40.0)]


def test_a_member_that_diverges_is_redrawn_once_for_all_its_ways(recorded: Recorded) -> None:
    """Yaw damping of the wrong sign in nearly every draw; the three ways stand on the same member."""
    family = {"name": "wild", "base": "gunnerus-28.9", "identify": FITTED["identify"], "seed": 2}
    family["perturb"] = [{"parameters": ["hull.derivatives.N_r|r|", "hull.derivatives.N_ur"], "factor": [-60.0, 3.0]}]
    plan, dataset = study(recorded, [family])
    prepared = prepare(plan, dataset)
    variants = [model.variant for model in prepared.models if model.variant]
    assert len(variants) == 3
    assert variants[0] == variants[1] == variants[2]
    assert variants[0].counter > 0
    assert sum("redrawn" in note for note in prepared.notes) == variants[0].counter


def test_values_that_the_vessel_refuses_fail_in_their_own_cells(
    recorded: Recorded, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, dataset = study(recorded, [FITTED])
    prepared = prepare(plan, dataset)
    found = SimpleNamespace(status="ok", sentence="", seconds=1.0, values={"inertia.m": -1.0})
    monkeypatch.setattr(solve, "identify", lambda *_: found)
    both = foundations(plan, prepared, plan.batches[0], "cpu")["wrong-both"]
    assert np.isnan(both.paths).all()
    assert both.sentence.startswith("identification: ")


@pytest.mark.parametrize(
    ("block", "path", "said"),
    [
        ({"parameters": ["hull.derivatives.Q_q"]}, "family.0.identify.parameters", "selects nothing"),
        ({"parameters": PATHS, "fixed": PATHS}, "family.0.identify.fixed", "nothing is left"),
        ({"parameters": PATHS, "weight": {}}, "family.0.identify.weight", "weights"),
        ({}, "family.0.identify.parameters", "missing"),
    ],
)
def test_a_wrong_block_is_one_line(recorded: Recorded, block: dict[str, Any], path: str, said: str) -> None:
    with pytest.raises(DocumentError, match=said) as caught:
        study(recorded, [{**FITTED, "identify": block}])
    assert caught.value.path == path


def test_the_prediction_of_the_study_is_the_default(recorded: Recorded) -> None:
    plan, _ = study(recorded, [{**FITTED, "identify": {"parameters": PATHS}}])
    settings = plan.models[1].identify
    assert settings is not None
    assert (settings.horizon, settings.step, settings.method) == (5.0, 1.0, "euler")
    assert plan.identified == {"wrong-both", "wrong-identified"}
    assert plan.aside == {"wrong-identified"}
    assert Batch(3, 0) in plan.batches
