"""One edit: a method that is a class and a line in METHODS runs through a whole study."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.hybrid.method import Fitted, Method, Task
from shipid.hybrid.methods import METHODS
from shipid.hybrid.physics import Physics
from shipid.predictor import Predictor
from shipid.study import store
from shipid.study.apply import predict_log
from shipid.study.contents import report_content
from shipid.study.results import read_results
from tests.study.tiny import run_here, tiny_plan

Array = np.ndarray


@dataclass(frozen=True)
class Shifted:
    """Adds one mean error, whatever the instant."""

    mean: Array
    hyperparameters: Mapping[str, float]
    past: float = 0.0

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:  # noqa: ARG002
        """Paths (T, S, 2) [m] with the mean error (T, 1, 2) added."""
        return paths + self.mean

    def header(self) -> dict[str, Any]:
        """What is no array."""
        return {"hyperparameters": dict(self.hyperparameters)}

    def arrays(self) -> dict[str, Array]:
        """The mean."""
        return {"mean": self.mean}

    @classmethod
    def from_arrays(cls, header: Mapping[str, Any], arrays: Mapping[str, Array]) -> Self:
        """Rebuild."""
        return cls(arrays["mean"], header["hyperparameters"])


class MeanError(Method):
    """The mean error of the physics over the training windows, times a share."""

    corrector: ClassVar[type[Any]] = Shifted
    share: float = 1.0

    def fit(self, task: Task) -> dict[str, Fitted]:
        """One trial a foundation."""
        found = {}
        for name, paths in task.targets.items():
            mean = self.share * paths.mean(axis=1, keepdims=True)
            value = float(np.square(paths - mean).mean())
            trial = {"number": 0, "params": {}, "value": value, "epochs": 0, "seconds": 0.0, "state": "complete"}
            found[name] = Fitted(Shifted(mean, {}), [trial], 0.0)
        return found


def test_a_new_method_goes_through_a_whole_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, "mean-error", MeanError)
    drawn = {"name": "drawn", "kind": "path-drawn", "trials": 1, "terms": 4, "units": 8}
    toy = {"name": "toy", "kind": "mean-error", "families": ["right", "none"]}
    bare = {"name": "bare", "kind": "alone", "families": ["*"]}
    changes = {"method": [drawn, toy, bare], "claims": {"method": "toy"}, "grid.N_D": [4]}
    plan = tiny_plan(tmp_path, changes)
    # four foundations with `drawn`, two with `toy`, three with `bare`: `alone` does not meet `none`
    assert plan.cells == 4 + 2 + 3
    assert plan.judged == "toy"
    assert plan.label("right", "toy") == "right + toy"
    folder = tmp_path / "run"
    run_here(plan, folder)
    rows = store.read_rows(folder).set_index("cell")
    assert {"right+toy-N0004-s0", "none+toy-N0004-s0", "right+bare-N0004-s0"} <= set(rows.index)
    assert not any(cell.startswith("none+bare") for cell in rows.index)
    assert (rows["status"] == "ok").all()
    bare_rows = rows[rows["method"] == "bare"]
    np.testing.assert_allclose(bare_rows["H"], bare_rows["A"])
    predictor = Predictor.load(store.cell_file(folder, "right+toy-N0004-s0"))
    assert isinstance(predictor.corrector, Shifted)
    frame, _ = predict_log(folder, "right+toy-N0004-s0", folder / store.DATASET, None, tmp_path / "paths.csv")
    assert frame["cooperative_north"].notna().all()
    content = report_content(read_results(folder))
    assert "right+toy-N0004-s0" in set(content.trials["cell"])
    assert {"right + toy", "right + drawn"} <= set(content.cells["model"])
