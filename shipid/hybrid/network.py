"""A network of PyTorch of one's own as a method: its class, what a trial suggests, and how the network is built.

It reads the past and the inputs at the instant, normalised, and gives the error of the path on a basis of polynomials of
time; see `shipid.hybrid.recurrent`, whose search, training and mirror it shares.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch

from shipid.data.windows import Instants
from shipid.errors import DataError
from shipid.hybrid.features import select_inputs
from shipid.hybrid.method import Array
from shipid.hybrid.methods import METHODS, method_kind
from shipid.hybrid.physics import Physics
from shipid.hybrid.recurrent import Recurrent, RecurrentCorrector, RecurrentProblem, SequenceReader, past_signals
from shipid.hybrid.search import LearningProblem, Point
from shipid.hybrid.stored import StoredData
from shipid.hybrid.training import Length, train_module


@dataclass(frozen=True)
class TrainedModule(StoredData):
    """The network of one fold: how it is built again, its weights by name, and its basis (T, r) [m].

    kind, settings : of its method, the settings as JSON. point : of its trial.
    """

    kind: str
    settings: str
    point: Mapping[str, float]
    reader: SequenceReader
    weights: Mapping[str, Array]
    basis: Array

    def module(self) -> torch.nn.Module:
        """Build the network in double precision, ready to predict."""
        built = METHODS[self.kind].model_validate_json(self.settings).network(self.point, *sizes_of(self.reader, self.basis))
        built.load_state_dict({name: torch.as_tensor(values) for name, values in self.weights.items()})
        return built.double().eval()

    def predict(self, table: Mapping[str, Array], instants: Instants, commands: tuple[str, ...]) -> Array:
        """Return the compensation (T, S, 2) [m]."""
        return Compensation([self]).predict(table, instants, commands)


def sizes_of(reader: SequenceReader, basis: Array) -> tuple[int, int, int]:
    """Sizes of what a network reads of the past and at the instant, and of its outputs."""
    return len(reader.past.names), len(reader.now.names), 2 * basis.shape[1]


class Compensation(torch.nn.Module):
    """The mean of networks with what is around them: past (P + 1, S, d), now (S, e) as measured -> (S, T, 2) [m].

    past, now : names of the last axis of what goes in.
    """

    def __init__(self, networks: Sequence[TrainedModule]) -> None:
        super().__init__()
        self.networks, self.parts = networks, torch.nn.ModuleList([one.module() for one in networks])
        readers = [one.reader for one in networks]
        self.past = tuple(dict.fromkeys(name for one in readers for name in one.past.names))
        self.now = tuple(dict.fromkeys(name for one in readers for name in one.now.names))

    def forward(self, past: torch.Tensor, now: torch.Tensor) -> torch.Tensor:
        """Normalise, ask every network, also with port and starboard exchanged, and weigh the basis."""
        paths = []
        for module, one in zip(self.parts, self.networks, strict=True):
            sides = ((past, self.past, one.reader.past), (now, self.now, one.reader.now))
            seen = [
                (given[..., [names.index(name) for name in norm.names]] - torch.tensor(norm.mean)) / torch.tensor(norm.std)
                for given, names, norm in sides
            ]
            outputs = module(*seen).unflatten(1, (2, -1))
            if one.reader.mirrors is not None:
                images = [side @ torch.tensor(mirror) for side, mirror in zip(seen, one.reader.mirrors, strict=True)]
                outputs = (outputs + torch.tensor([[1.0], [-1.0]]) * module(*images).unflatten(1, (2, -1))) / 2
            paths.append((outputs @ torch.tensor(one.basis.T)).swapaxes(1, 2))
        return torch.stack(paths).mean(dim=0)

    def predict(self, table: Mapping[str, Array], instants: Instants, commands: tuple[str, ...]) -> Array:
        """Return the compensation (T, S, 2) [m] of instants, with their inputs (S,) as `Inputs.table` gives them."""
        rows = past_signals(instants, self.networks[0].reader.steps, commands)
        past = np.stack([select_inputs(row, self.past) for row in rows])
        with torch.no_grad():
            made: Array = self(torch.from_numpy(past), torch.from_numpy(select_inputs(table, self.now))).numpy()
        return made.swapaxes(0, 1)


@dataclass(frozen=True)
class NetworkCorrector(RecurrentCorrector):
    """The mean of the networks of the folds."""

    networks: tuple[TrainedModule, ...]  # type: ignore[assignment]

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:
        """Return paths (T, S, 2) [m] in the frame (11): those of the physics plus the compensation."""
        table = self.inputs.table(physics, instants)
        return np.asarray(paths + Compensation(self.networks).predict(table, instants, self.inputs.commands))

    def trace_onnx(self, file: Path) -> dict[str, tuple[str, ...]]:
        """Write the networks as ONNX, in double precision; names of the last axis of the inputs `past` and `now`."""
        whole = Compensation(self.networks)
        past = torch.zeros(self.networks[0].reader.steps + 1, 2, len(whole.past), dtype=torch.float64)
        now = torch.zeros(2, len(whole.now), dtype=torch.float64)
        axes = {"past": {1: "S"}, "now": {0: "S"}, "compensation": {0: "S"}}
        names = {"input_names": ["past", "now"], "output_names": ["compensation"], "dynamic_axes": axes}
        torch.onnx.export(whole.eval(), (past, now), str(file), dynamo=False, **names)
        return {"past": whole.past, "now": whole.now}


class NetworkProblem(RecurrentProblem):
    """A foundation whose error of the path a network of the user gives."""

    def learn(self, reader: SequenceReader, parts: Any, point: Point, scale: float, seed: int) -> tuple[Any, int]:
        """Return the network of the best epoch, and its number of epochs."""
        method = self.method
        length, basis = Length(method.epochs, method.batch, method.patience), self.basis * scale
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            module = method.network(point, *sizes_of(reader, basis))
            epochs = train_module(parts, module, point["learning_rate"], method.weight_decay, length, seed)
        weights = {name: values.double().numpy() for name, values in module.state_dict().items()}
        settings = method.model_dump_json()
        return TrainedModule(method_kind(method), settings, dict(point), reader, weights, basis), epochs


class NetworkMethod(Recurrent):
    """A method whose network a subclass builds: write `network`, and `suggest(self, trial)` for what is searched.

    The settings are those of `Recurrent`; `units` is the subclass's own.
    """

    problem: ClassVar[type[LearningProblem]] = NetworkProblem
    corrector: ClassVar[type[Any]] = NetworkCorrector

    def network(self, point: Point, past: int, now: int, outputs: int) -> torch.nn.Module:
        """Return a module whose `forward(past, now)` takes (P + 1, S, past) and (S, now), and gives (S, outputs).

        point : what the trial suggested.
        """
        raise DataError(f"{type(self).__name__} must have `network(self, point, past, now, outputs)`")
