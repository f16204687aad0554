"""What the past shows: pairs, intervals over test runs, and the frames of a small study with memory and observer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipid.answer import memory
from shipid.metrics import position_error
from shipid.study.results import Results, read_results
from tests.study.tiny import run_here, tiny_plan

SMALL: dict[str, Any] = {"kind": "path-drawn", "trials": 1, "terms": 4, "units": 8}
CHANGES: dict[str, Any] = {
    "truth.run_up": 4.0,
    "truth.manoeuvres": 12,
    "split.test": 5,
    "method": [
        {"name": "drawn", **SMALL},
        {"name": "remembers", **SMALL, "memory": {"history": [2.0], "error": 4.0}},
        {"name": "alone", "kind": "alone", "families": ["wrong*"]},
    ],
    "family": [
        {"name": "wrong", "base": "gunnerus-28.9", "members": 2,
         "perturb": [{"parameters": ["hull.derivatives.*"], "factor": [0.4, 1.6]}]},
        {"name": "seen", "extends": "wrong", "observer": {"fade": 6.0}},
    ],
}  # fmt: skip
COMPARED = {
    "memory: remembers against drawn": {"wrong-1", "wrong-2", "seen-1", "seen-2", "none"},
    "observer: physics alone": {"wrong-1", "wrong-2"},
    "observer: drawn": {"wrong-1", "wrong-2"},
    "observer: remembers": {"wrong-1", "wrong-2"},
    "observer and memory: remembers against drawn": {"wrong-1", "wrong-2"},
}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    folder = tmp_path_factory.mktemp("past")
    run_here(tiny_plan(folder, CHANGES), folder / "run")
    return read_results(folder / "run")


def test_pairs_are_alike_but_for_the_past(results: Results) -> None:
    comparisons: dict[str, set[str]] = {}
    for pair in memory.memory_pairs(results.plan.foundations, results.plan.methods):
        comparisons.setdefault(pair.comparison, set()).add(pair.without[0])
        assert pair.differs == ()
        same = pair.without[0] == pair.remembering[0]
        assert same == (pair.added == "memory")
    assert comparisons == COMPARED


def test_what_differs_beside_memory_is_named(tmp_path: Path) -> None:
    uneven = [CHANGES["method"][0], {**CHANGES["method"][1], "trials": 2}]
    plan = tiny_plan(tmp_path, {**CHANGES, "method": uneven})
    assert {
        pair.differs for pair in memory.memory_pairs(plan.foundations, plan.methods) if pair.added != "observer"
    } == {("trials",)}


def test_physics_alone_that_depends_on_the_cell_is_no_rival(tmp_path: Path) -> None:
    chosen = [CHANGES["family"][0], {**CHANGES["family"][1], "observer": {"choose": True}}]
    plan = tiny_plan(tmp_path, {**CHANGES, "family": chosen})
    compared = {pair.comparison for pair in memory.memory_pairs(plan.foundations, plan.methods)}
    assert compared == {*COMPARED} - {"observer: physics alone"}


def test_a_study_without_memory_has_no_pairs(tiny_run: Path) -> None:
    results = read_results(tiny_run)
    assert memory.memory_frame(results).empty
    assert memory.observer_frame(results).empty


def test_the_frame_holds_the_mean_errors_of_both(results: Results) -> None:
    frame = memory.memory_frame(results)
    assert set(frame["N_D"]) == {0, 4, 6}
    row = frame[frame["comparison"].eq("observer and memory: remembers against drawn") & frame["N_D"].eq(6)].iloc[0]
    H = results.cells.set_index("cell")["H"]
    assert row["H_without"] == pytest.approx(H["wrong-1+drawn-N0006-s0"])
    assert row["H_with"] == pytest.approx(H["seen-1+remembers-N0006-s0"])
    assert row["difference"] == pytest.approx(row["H_with"] - row["H_without"])
    assert row["low"] <= row["difference"] <= row["high"]
    assert row["without"] == "wrong-1"
    alone = frame[frame["N_D"] == 0].set_index("model")
    for member in (1, 2):
        A = [
            position_error(results.physics[f"{name}-{member}"], results.test.future).mean()
            for name in ("wrong", "seen")
        ]
        assert alone.loc[f"wrong-{member}", ["H_without", "H_with"]].tolist() == pytest.approx(A)
        assert alone.loc[f"wrong-{member}", "A"] == pytest.approx(A[0])


def test_the_observer_frame_holds_every_row_of_the_shown_runs(results: Results) -> None:
    frame = memory.observer_frame(results)
    rows = results.dataset.frame
    rows = rows[rows["run"].isin(set(results.test.run))]
    assert frame["t"].tolist() == rows["t"].tolist()
    assert frame["u"].tolist() == rows["u"].tolist()
    assert frame["model"].iloc[0] in {"seen-1", "seen-2"}
    assert frame["fade"].iloc[0] == pytest.approx(6.0 * np.sqrt(28.9 / 9.81), rel=0.05)
    assert frame["ahead"].iloc[0] == 5.0
    first = frame.groupby("run").head(1)
    assert first["observer.test"].isna().all()
    assert frame.drop(first.index)["observer.test"].notna().all()
