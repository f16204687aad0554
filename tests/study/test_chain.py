"""The chain of the paper on a part of the study `paper-small`: degraded physics, rollouts, PyTorch, TPE."""

from __future__ import annotations

from pathlib import Path

import optuna
import pytest

from shipid.hybrid.path_trained import PathTrained
from shipid.study.plan import read_plan
from shipid.study.results import read_results
from tests.study.tiny import run_here

PART = {
    "truth.manoeuvres": 18,
    "split.test": 6,
    "grid.N_D": [12],
    "method.0.trials": 4,
    "method.0.epochs": 300,
    "method.0.units": [10, 40],
    "method.0.learning_rate": [0.01, 0.1],
}


@pytest.mark.slow
def test_networks_trained_on_the_residuals_of_rollouts_improve_degraded_physics(tmp_path: Path) -> None:
    plan = read_plan("paper-small", PART)
    run_here(plan, tmp_path / "run")
    results = read_results(tmp_path / "run")
    cells = results.cells[results.cells["method"].eq("trained")].set_index("foundation")
    assert set(cells["status"]) == {"ok"}
    assert list(cells.index) == [one.name for one in plan.foundations] == ["nominal", "moderate", "high", "none"]
    assert cells["A"]["nominal"] < cells["A"]["moderate"] < cells["A"]["high"]
    assert (cells["H"] < cells["A"])[["nominal", "moderate", "high"]].all()
    storage = optuna.storages.JournalStorage(
        optuna.storages.journal.JournalFileBackend(str(tmp_path / "run/trials.log"))
    )
    method = plan.methods[0].method
    assert isinstance(method, PathTrained)
    for cell in cells["cell"]:
        study = optuna.load_study(study_name=cell, storage=storage)
        assert len(study.trials) == method.trials
        for trial in study.trials:
            assert set(trial.params) == set(method.ranges())
            assert all(low <= trial.params[name] <= high for name, (low, high) in method.ranges().items())
