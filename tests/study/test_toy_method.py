"""One edit: the method of docs/extending.md, a class and a line in METHODS, runs through a whole study."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
import pytest

from shipid.answer.frames import provenance_words
from shipid.answer.pages import report_content
from shipid.data.dataset import read_dataset
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.method import FitResult, Method, Task, Traits
from shipid.hybrid.methods import METHODS
from shipid.hybrid.search import trial_row
from shipid.predictor import Predictor
from shipid.study import store
from shipid.study.apply import predict_log
from shipid.study.plan import model_label, plain_rival, verdict_method
from shipid.study.prepare import prepare
from shipid.study.results import read_results
from tests.documented import module
from tests.study.tiny import run_here, tiny_plan


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The code of the section "A method" as the module that its reader would write."""
    return module("A method", "linear_of_the_page", monkeypatch)


def test_a_new_method_goes_through_a_whole_study(
    tmp_path: Path, toy: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(METHODS, "linear", toy.Linear)
    drawn = {"name": "kernel", "kind": "kernel", "trials": 2, "steps": 2, "terms": 4}
    added = {"name": "toy", "kind": "linear", "families": ["right", "none"], "ridge": 1e-12}
    bare = {"name": "bare", "kind": "alone", "families": ["*"]}
    changes = {"method": [drawn, added, bare], "claims": {"method": "toy"}, "grid.N_D": [4]}
    plan = tiny_plan(tmp_path, changes)
    # four foundations with `kernel`, two with `toy`, three with `bare`: `alone` does not meet `none`
    assert plan.cells == 4 + 2 + 3
    assert verdict_method(plan) == "toy"
    assert model_label(plan, "right", "toy") == "right"
    folder = tmp_path / "run"
    run_here(plan, folder)
    rows = store.read_rows(folder).set_index("cell")
    assert {"right+toy-N0004-s0", "none+toy-N0004-s0", "right+bare-N0004-s0"} <= set(rows.index)
    assert not any(cell.startswith("none+bare") for cell in rows.index)
    assert (rows["status"] == "ok").all()
    bare_rows = rows[rows["method"] == "bare"]
    np.testing.assert_allclose(bare_rows["H"], bare_rows["A"])
    predictor = Predictor.load(store.cell_file(folder, "right+toy-N0004-s0"))
    assert isinstance(predictor.corrector, toy.LinearCorrector)
    frame, _ = predict_log(folder, "right+toy-N0004-s0", folder / store.DATASET, None, tmp_path / "paths.csv")
    assert frame["cooperative_north"].notna().all()
    content = report_content(read_results(folder))
    assert "right+toy-N0004-s0" in set(content.trials["cell"])
    assert {"right", "right + kernel"} <= set(content.cells["model"])
    # without a ridge what is left over the windows that train is orthogonal to every input: least squares
    prepared = prepare(plan, read_dataset(folder / store.DATASET))
    batch = plan.batches[0]
    seen = np.isin(prepared.pool.run, prepared.runs(batch))
    physics = prepared.known["right"].paths[:, seen]
    instants = prepared.pool.select(seen).instants()
    left = prepared.pool.future[:, seen] - predictor.corrector.predict(predictor.physics, instants, physics)
    for name in ("u", "v", "r"):
        np.testing.assert_allclose(left.transpose(0, 2, 1) @ (instants.columns[name]), 0.0, atol=1e-6)


class Otherwise(Method):
    """A method of a user whose settings have names of those of other methods, and another meaning."""

    corrector: ClassVar[type[Any]] = UnchangedPath
    trials: str = "sea trials of 2022"
    mirror: float = 0.0
    memory: str = "of the crew"
    terms: int = 2

    def fit(self, given: Task) -> dict[str, FitResult]:
        return {name: FitResult(UnchangedPath({}), [trial_row(0, {}, 1.0, 0.0)], 0.0) for name in given.cases}


def test_settings_of_a_users_method_mean_what_the_user_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They were taken for the trials, the mirror, the memory and the polynomial that a study speaks of."""
    monkeypatch.setitem(METHODS, "otherwise", Otherwise)
    drawn = {"name": "kernel", "kind": "kernel", "trials": 2, "steps": 2, "terms": 4}
    added = {"name": "mine", "kind": "otherwise", "families": ["none"]}
    plan = tiny_plan(tmp_path, {"method": [drawn, added], "grid.N_D": [4]})
    mine = plan.methods[1]
    assert (mine.method.traits, mine.method.num_trials()) == (Traits(), None)
    assert plain_rival(plan) is None
    run_here(plan, tmp_path / "run")
    results = read_results(tmp_path / "run")
    assert provenance_words(results)["methods"] == "kernel: 2 trials; mine (otherwise)"
    assert report_content(results).answer
