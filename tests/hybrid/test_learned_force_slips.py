"""Learned force: what it is trained on and what it is judged by, without a rollout."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shipid.hybrid.learned_force import LearnedForce, _Trainer
from shipid.hybrid.method import Case, Task
from shipid.hybrid.physics import Physics
from shipid.vessel.load import load_vessel
from tests.test_predictor_fit import HORIZON, turns


def test_a_trial_is_judged_by_windows_that_its_force_has_not_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of a validation window, not even its scale, reaches the training; the last fit takes all windows."""
    windows = turns(count=3, rows=15)
    future = windows.future
    names = np.array(list(windows.spans))
    folds = [(np.flatnonzero(windows.run != name), np.flatnonzero(windows.run == name)) for name in names]
    trained: list[_Trainer] = []
    judged: list[tuple[Any, Any]] = []

    def solve(trainer: _Trainer, *_: Any) -> tuple[Any, int]:
        trained.append(trainer)
        return trainer.start, 1

    def error(_: _Trainer, __: Any, instants: Any, paths: Any) -> float:
        judged.append((instants.columns["u"], paths))
        return 1.0

    monkeypatch.setattr(_Trainer, "solve", solve)
    monkeypatch.setattr(_Trainer, "error", error)
    physics = Physics(load_vessel("gunnerus-28.9"), HORIZON, 1.0)
    task = Task({"one": Case(physics, np.zeros_like(future))}, windows, folds, tuple(windows.planned))
    LearnedForce(trials=1, ridge=0.1, units=2).fit(task)
    assert len(trained) == len(folds) + 1
    for trainer, part in zip(trained, [*(training for training, _ in folds), np.arange(len(windows))], strict=True):
        np.testing.assert_array_equal(trainer.instants.columns["u"], windows.columns["u"][part])
        np.testing.assert_array_equal(trainer.future, future[:, part])
        assert trainer.first["u_scale"] == pytest.approx(windows.columns["u"][part].std())
    for (speeds, paths), (_, validation) in zip(judged, folds, strict=True):
        np.testing.assert_array_equal(speeds, windows.columns["u"][validation])
        np.testing.assert_array_equal(paths, future[:, validation])
