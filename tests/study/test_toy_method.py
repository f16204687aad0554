"""One edit: the method of docs/extending.md, a class and a line in METHODS, runs through a whole study."""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from shipid.data.dataset import read_dataset
from shipid.hybrid.methods import METHODS
from shipid.predictor import Predictor
from shipid.study import store
from shipid.study.apply import predict_log
from shipid.study.contents import report_content
from shipid.study.prepare import prepare
from shipid.study.results import read_results
from tests.study.tiny import run_here, tiny_plan

DOCUMENT = Path(__file__).parents[2] / "docs" / "extending.md"


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The code of the section "A method" as the module that its reader would write."""
    section = DOCUMENT.read_text().partition("\n## A method\n")[2].partition("\n## ")[0]
    file = tmp_path / "mean_error.py"
    file.write_text(section.partition("```python\n")[2].partition("```")[0])
    spec = spec_from_file_location("mean_error", file)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "mean_error", module)
    spec.loader.exec_module(module)
    return module


def test_a_new_method_goes_through_a_whole_study(
    tmp_path: Path, toy: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(METHODS, "mean-error", toy.MeanError)
    drawn = {"name": "drawn", "kind": "path-drawn", "trials": 1, "terms": 4, "units": 8}
    added = {"name": "toy", "kind": "mean-error", "families": ["right", "none"], "share": 0.5}
    bare = {"name": "bare", "kind": "alone", "families": ["*"]}
    changes = {"method": [drawn, added, bare], "claims": {"method": "toy"}, "grid.N_D": [4]}
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
    assert isinstance(predictor.corrector, toy.Shift)
    frame, _ = predict_log(folder, "right+toy-N0004-s0", folder / store.DATASET, None, tmp_path / "paths.csv")
    assert frame["cooperative_north"].notna().all()
    content = report_content(read_results(folder))
    assert "right+toy-N0004-s0" in set(content.trials["cell"])
    assert {"right + toy", "right + drawn"} <= set(content.cells["model"])
    # half of the mean error of the physics over the windows that train
    prepared = prepare(plan, read_dataset(folder / store.DATASET))
    batch = plan.batches[0]
    seen = np.isin(prepared.pool.run, prepared.runs(plan, batch))
    missed = (prepared.pool.future - prepared.pool_paths["right"])[:, seen]
    np.testing.assert_allclose(predictor.corrector.mean, 0.5 * missed.mean(axis=1, keepdims=True), atol=1e-12)
