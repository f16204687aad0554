"""A network of PyTorch of one's own as a method: what a trial suggests, and how the network is built.

It reads the past and the inputs at the instant, normalised, and gives the error of the path on a basis of polynomials
of time; see `shipid.hybrid.recurrent`, whose search, training and mirror it shares.
"""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor
from torch.func import functional_call

from shipid.errors import ResultError
from shipid.hybrid.method import Array
from shipid.hybrid.methods import METHODS, method_kind
from shipid.hybrid.recurrent import (
    GatedNetwork,
    Recurrent,
    RecurrentCorrector,
    RecurrentProblem,
    SequenceReader,
    Sequences,
)
from shipid.hybrid.search import Point, SearchProblem
from shipid.hybrid.training import Length, train_reader


@dataclass(frozen=True)
class TrainedModule(GatedNetwork):
    """The network of one fold: its parameters and buffers of the best epoch, and how it is built again.

    kind, settings : of its method, the settings as JSON. point : of its trial.
    """

    kind: str
    settings: str
    point: Mapping[str, float]

    def module(self) -> torch.nn.Module:
        """Build the network in double precision, ready to predict.

        ResultError where it has other parameters or buffers than in training.
        """
        method: Any = METHODS[self.kind].model_validate_json(self.settings)
        built: torch.nn.Module = method.network(
            self.point, len(self.reader.past.names), len(self.reader.now.names), 2 * self.basis.shape[1]
        )
        own = dict([*built.named_parameters(), *built.named_buffers()])
        shapes = [{(name, tuple(one.shape)) for name, one in held.items()} for held in (own, self.layers)]
        if self.layers and (other := sorted({name for name, _ in shapes[0] ^ shapes[1]})):
            raise ResultError(f"`network` builds {', '.join(other)} otherwise than in training", path=self.kind)
        for name, layer in self.layers.items():
            own[name].data = torch.tensor(layer)
        return built.double().eval()

    def _outputs(self, seen: Sequences) -> Array:
        with torch.no_grad():
            return np.asarray(self.module()(*map(torch.from_numpy, map(np.asarray, seen))).numpy())


class MeasuredNetworks(torch.nn.Module):
    """Networks with what is around them: past (P + 1, S, d) and now (S, e) as measured -> compensation (S, T, 2) [m].

    past, now : names of the last axis of what goes in.
    """

    def __init__(self, networks: Sequence[TrainedModule]) -> None:
        super().__init__()
        self.networks, self.parts = networks, torch.nn.ModuleList([one.module() for one in networks]).float()
        self.past = tuple(dict.fromkeys(name for one in networks for name in one.reader.past.names))
        self.now = tuple(dict.fromkeys(name for one in networks for name in one.reader.now.names))

    def forward(self, past: Tensor, now: Tensor) -> Tensor:
        """Normalise, ask every network, also with port and starboard exchanged, and weigh the basis."""
        tensor, paths = partial(torch.tensor, dtype=torch.float32), []
        for module, one in zip(self.parts, self.networks, strict=True):
            sides = ((past, self.past, one.reader.past), (now, self.now, one.reader.now))
            seen = [
                (given[..., [names.index(name) for name in norm.names]] - tensor(norm.mean)) / tensor(norm.std)
                for given, names, norm in sides
            ]
            outputs = module(*seen).unflatten(1, (2, -1))
            if one.reader.mirrors is not None:
                images = [side @ tensor(mirror) for side, mirror in zip(seen, one.reader.mirrors, strict=True)]
                outputs = (outputs + tensor([[1.0], [-1.0]]) * module(*images).unflatten(1, (2, -1))) / 2
            paths.append((outputs @ tensor(one.basis.T)).swapaxes(1, 2))
        return torch.stack(paths).mean(dim=0)


@dataclass(frozen=True)
class NetworkCorrector(RecurrentCorrector):
    """The mean of the networks of the folds."""

    networks: tuple[TrainedModule, ...]

    def trace_onnx(self, file: Path) -> dict[str, tuple[str, ...]]:
        """Write the networks as ONNX; names of the last axis of the inputs `past` and `now`.

        In single precision: runtimes have no recurrent units in double.
        """
        whole = MeasuredNetworks(self.networks).eval()
        zeros = torch.zeros(self.networks[0].reader.steps + 1, 1, len(whole.past)), torch.zeros(1, len(whole.now))
        with warnings.catch_warnings(action="ignore"):  # what PyTorch takes for constants are constants
            torch.onnx.export(
                whole,
                zeros,
                str(file),
                dynamo=False,
                input_names=["past", "now"],
                output_names=["compensation"],
                dynamic_axes={"past": {1: "S"}, "now": {0: "S"}, "compensation": {0: "S"}},
            )
        return {"past": whole.past, "now": whole.now}


class NetworkProblem(RecurrentProblem):
    """A foundation whose error of the path a network of the user gives."""

    def learn(self, reader: SequenceReader, parts: Any, point: Point, scale: float, seed: int) -> tuple[Any, int]:
        """Return the network of the best epoch, and its number of epochs."""
        method, basis, rate = self.method, self.basis * scale, point["learning_rate"]
        network = TrainedModule(reader, {}, basis, method_kind(method), method.model_dump_json(), dict(point))
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            module = network.module().float()
            learned = {name: layer for name, layer in module.named_parameters() if layer.requires_grad}
            layers, epochs = train_reader(
                parts,
                lambda layers, *seen: functional_call(  # one window alone has no spread that BatchNorm could learn
                    module.train(torch.is_grad_enabled() and len(seen[1]) > 1), dict(layers), seen
                ),
                torch.nn.utils.parameters_to_vector(learned.values()).detach()[None].clone(),
                {name: tuple(layer.shape) for name, layer in learned.items()},
                (rate, method.weight_decay),
                Length(method.epochs, method.batch, method.patience),
                torch.Generator().manual_seed(seed),
                lambda: {
                    name: held.numpy(force=True).copy()
                    for name, held in (*module.named_parameters(), *module.named_buffers())
                },
            )
        return replace(network, layers=layers), epochs


class NetworkMethod(Recurrent):
    """A method whose network a subclass builds: write `network`, and `suggest(self, trial)` for what is searched.

    The settings are those of `Recurrent`; `units` is the subclass's own.
    """

    problem: ClassVar[type[SearchProblem]] = NetworkProblem
    corrector: ClassVar[type[Any]] = NetworkCorrector

    @abstractmethod
    def network(self, point: Point, past: int, now: int, outputs: int) -> torch.nn.Module:
        """Return a module whose `forward(past, now)` takes (P + 1, S, past) and (S, now), and gives (S, outputs).

        point : what the trial suggested.
        """
