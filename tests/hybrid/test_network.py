"""A network of one's own: searched by Optuna, saved, read back, interrupted and exported."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import shipid
from shipid.hybrid.features import select_inputs
from shipid.hybrid.journal import Journal
from shipid.hybrid.methods import METHODS
from shipid.hybrid.network import NetworkMethod
from shipid.hybrid.recurrent import past_signals
from tests.hybrid.quick import small_world


class Reader(torch.nn.Module):
    """A gated recurrent unit on the past, and a layer on its state and the present."""

    def __init__(self, past: int, now: int, outputs: int, units: int) -> None:
        super().__init__()
        self.gru, self.head = torch.nn.GRU(past, units), torch.nn.Linear(units + now, outputs)

    def forward(self, past: torch.Tensor, now: torch.Tensor) -> torch.Tensor:
        return self.head(torch.cat([self.gru(past)[1][-1], now], dim=1))


class Gated(NetworkMethod):
    def suggest(self, trial: Any) -> None:
        trial.suggest_int("units", 3, 9, log=True)
        trial.suggest_float("learning_rate", 1e-3, 1e-1, log=True)

    def network(self, point: Any, past: int, now: int, outputs: int) -> torch.nn.Module:
        return Reader(past, now, outputs, int(point["units"]))


@pytest.fixture(autouse=True)
def _listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, "gated", Gated)


def test_a_network_of_ones_own_is_fitted_saved_and_exported(tmp_path: Path) -> None:
    world = small_world()
    predictor = shipid.fit(Gated(trials=2, epochs=30, seconds=3.0), world.physics, world.train, commands="known")
    assert world.removed(predictor.corrector) > 0
    instants = world.test.instants(known=True)
    predicted, alone = predictor.predict(instants), predictor.alone(instants)
    read = shipid.Predictor.load(predictor.save(tmp_path / "p.npz"))
    np.testing.assert_array_equal(read.predict(instants), predicted)
    pytest.importorskip("onnx")
    runtime = pytest.importorskip("onnxruntime")
    (file,) = read.export("onnx", tmp_path / "p.onnx")
    session = runtime.InferenceSession(str(file), providers=["CPUExecutionProvider"])
    names = json.loads(session.get_modelmeta().custom_metadata_map["inputs"])
    corrector: Any = read.corrector
    rows = past_signals(instants, 3, corrector.inputs.commands)
    past = np.stack([select_inputs(row, names["past"]) for row in rows])
    now = select_inputs(corrector.inputs.table(read.physics, instants), names["now"])
    (made,) = session.run(None, {"past": past.astype(np.float32), "now": now.astype(np.float32)})
    np.testing.assert_allclose(made.swapaxes(0, 1), predicted - alone, atol=1e-4 * np.abs(predicted - alone).max())


def test_a_search_that_was_interrupted_goes_on_with_the_same_trials(tmp_path: Path) -> None:
    world = small_world()

    def trials(count: int, journal: Journal | None) -> list[dict[str, Any]]:
        task = world.task(seed=5, journal=journal)
        return Gated(trials=count, epochs=2, seconds=3.0).fit(task)["physics"].trials

    trials(3, Journal(tmp_path / "t.log"))
    resumed, whole = trials(12, Journal(tmp_path / "t.log")), trials(12, None)
    assert [row["params"] for row in resumed] == [row["params"] for row in whole]
    assert Gated().varied() == ("units", "learning_rate")


def test_a_method_that_builds_no_network_says_so_at_once() -> None:
    class Unwritten(NetworkMethod):
        def suggest(self, trial: Any) -> None:
            trial.suggest_int("units", 3, 9)

    with pytest.raises(TypeError, match=r"Unwritten.*network"):
        Unwritten()  # type: ignore[abstract]
