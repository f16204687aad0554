"""A network of one's own: searched by Optuna, saved, read back, interrupted and exported."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import shipid
from shipid.errors import ResultError
from shipid.hybrid import network as networks
from shipid.hybrid.features import select_inputs
from shipid.hybrid.journal import Journal, open_journal
from shipid.hybrid.methods import METHODS
from shipid.hybrid.network import NetworkMethod
from shipid.hybrid.recurrent import past_signals
from shipid.hybrid.training import BestEpochs, train_reader
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


class Held(torch.nn.Module):
    """Layers with values that are not learned: drawn buffers, a frozen parameter, and means over the batches."""

    def __init__(self, past: int, now: int, outputs: int) -> None:
        super().__init__()
        self.register_buffer("frequencies", torch.randn(past, 8))
        self.register_buffer("shift", torch.randn(now), persistent=False)
        self.gain = torch.nn.Parameter(torch.randn(now), requires_grad=False)
        self.norm = torch.nn.BatchNorm1d(8 + now)
        self.head = torch.nn.Linear(8 + now, outputs)
        self.tail = torch.nn.Linear(outputs, outputs)
        self.again = torch.nn.Linear(outputs, outputs)
        self.again.weight = self.tail.weight

    def forward(self, past: torch.Tensor, now: torch.Tensor) -> torch.Tensor:
        seen = torch.cat([torch.cos(past[-1] @ self.frequencies), now * self.gain + self.shift], dim=1)
        return self.again(self.tail(self.head(self.norm(seen))))


class Buffered(NetworkMethod):
    def network(self, point: Any, past: int, now: int, outputs: int) -> torch.nn.Module:  # noqa: ARG002
        return Held(past, now, outputs)


@pytest.fixture(autouse=True)
def _listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, "gated", Gated)
    monkeypatch.setitem(METHODS, "buffered", Buffered)


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


def test_a_network_predicts_with_the_buffers_of_its_best_epoch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its error on the validation windows is the least that was seen in training; also when it was read back."""
    bests, watched, built = [], [], []

    class Recorded(BestEpochs):
        def __init__(self, *args: Any) -> None:
            super().__init__(*args)
            bests.append(self)

    def trained(parts: Any, *args: Any) -> Any:
        watched.append(parts[1])
        return train_reader(parts, *args)

    def network(_: Any, point: Any, *sizes: int) -> torch.nn.Module:  # noqa: ARG001
        built.append(Held(*sizes))
        return built[-1]

    monkeypatch.setattr("shipid.hybrid.training.BestEpochs", Recorded)
    monkeypatch.setattr(networks, "train_reader", trained)
    monkeypatch.setattr(Buffered, "network", network)
    world = small_world()
    method = Buffered(trials=1, epochs=300, patience=4, seconds=3.0, mirror=False, learning_rate=0.1)
    predictor = shipid.fit(method, world.physics, world.train, commands="known")
    read = shipid.Predictor.load(predictor.save(tmp_path / "p.npz"))
    instants = world.test.instants(known=True)
    np.testing.assert_array_equal(read.predict(instants), predictor.predict(instants))
    corrector: Any = read.corrector
    for trained_one, best, (seen, outputs) in zip(corrector.networks, bests, watched, strict=True):
        assert 4 < best.epochs[0] < 300
        assert best.waited[0] == 4  # the last epoch is not the best one
        error = np.square(trained_one._outputs(seen[0]) - outputs).mean()
        assert error == pytest.approx(float(best.best[0]), rel=1e-4)
    first = built[0]  # in training; what it does not learn it keeps
    held = corrector.networks[0].layers
    for name in ("frequencies", "shift", "gain"):
        np.testing.assert_array_equal(held[name], getattr(first, name).detach().numpy())
    monkeypatch.setattr(Buffered, "network", lambda *_: torch.nn.Linear(2, 2))
    with pytest.raises(ResultError, match=r"^buffered: `network` builds .*, frequencies, .* otherwise than in"):
        read.predict(instants)


def test_a_last_batch_of_one_window_does_not_end_the_training() -> None:
    """A spread over one window alone does not exist, so a layer that learns it takes what it knows."""
    task = small_world().task()
    method = Buffered(trials=1, epochs=3, seconds=3.0, mirror=False, batch=len(task.folds[0][0]) - 1)
    (row,) = method.fit(task)["physics"].trials
    assert row["state"] == "complete"


def test_a_search_that_was_interrupted_goes_on_with_the_same_trials(tmp_path: Path) -> None:
    world = small_world()

    def trials(count: int, journal: Journal | None) -> list[dict[str, Any]]:
        task = world.task(seed=5, journal=journal)
        return Gated(trials=count, epochs=2, seconds=3.0).fit(task)["physics"].trials

    trials(3, open_journal(tmp_path / "t.log"))
    resumed, whole = trials(12, open_journal(tmp_path / "t.log")), trials(12, None)
    assert [row["params"] for row in resumed] == [row["params"] for row in whole]
    assert Gated().varied() == ("units", "learning_rate")


def test_a_method_that_builds_no_network_says_so_at_once() -> None:
    class Unwritten(NetworkMethod):
        def suggest(self, trial: Any) -> None:
            trial.suggest_int("units", 3, 9)

    with pytest.raises(TypeError, match=r"Unwritten.*network"):
        Unwritten()  # type: ignore[abstract]
