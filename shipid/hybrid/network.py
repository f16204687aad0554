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
from shipid.hybrid.compensator import Layers, Normaliser
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

    In single precision: runtimes have no recurrent units in double. zeros : an example of what goes in, by name.
    names : of the last axis of each.
    """

    def __init__(self, networks: Sequence[TrainedModule]) -> None:
        super().__init__()
        self.networks, self.parts = networks, torch.nn.ModuleList([one.module() for one in networks]).float()
        self.names = {
            side: list(dict.fromkeys(name for one in networks for name in getattr(one.reader, side).names))
            for side in ("past", "now")
        }
        past, now = (torch.zeros(1, len(names)) for names in self.names.values())
        self.zeros = {"past": past.expand(networks[0].reader.steps + 1, -1, -1), "now": now}

    def forward(self, past: Tensor, now: Tensor) -> Tensor:
        """Normalise, ask every network, also with port and starboard exchanged, and weigh the basis."""
        tensor, paths = partial(torch.tensor, dtype=torch.float32), []
        for module, one in zip(self.parts, self.networks, strict=True):
            seen = [
                _normalise_tensor(past, self.names["past"], one.reader.past),
                _normalise_tensor(now, self.names["now"], one.reader.now),
            ]
            outputs = module(*seen)
            if one.reader.mirrors is not None:
                images = [side @ tensor(mirror) for side, mirror in zip(seen, one.reader.mirrors, strict=True)]
                half = tensor(np.repeat([1.0, -1.0], one.basis.shape[1]))
                outputs = (outputs + half * module(*images)) / 2
            paths.append(_weigh_basis(outputs, one.basis))
        return torch.stack(paths).mean(dim=0)


class MeasuredLayers(torch.nn.Module):
    """Plain networks with what is around them: inputs (S, d) as measured -> the mean of their outputs (S, ...).

    networks : normaliser, layers, and the basis (T, r) [m] that the outputs weigh, if any. zeros, names : as of
        `MeasuredNetworks`.
    """

    def __init__(self, networks: Sequence[tuple[Normaliser, Layers, Array | None]], single: bool) -> None:
        super().__init__()
        self.networks, self.names = networks, list(dict.fromkeys(name for one, *_ in networks for name in one.names))
        kind = torch.float32 if single else torch.float64
        self.zeros = {"inputs": torch.zeros(1, len(self.names), dtype=kind)}

    def forward(self, inputs: Tensor) -> Tensor:
        """Normalise, ask every network, and weigh the basis."""
        outputs, tensor = [], partial(torch.tensor, dtype=inputs.dtype)
        for normaliser, layers, basis in self.networks:
            x = _normalise_tensor(inputs, self.names, normaliser)
            for number, (weight, bias) in enumerate(layers):
                x = (x.tanh() if number else x) @ tensor(weight) + tensor(bias)
            outputs.append(x if basis is None else _weigh_basis(x, basis))
        return torch.stack(outputs).mean(dim=0)


def _normalise_tensor(given: Tensor, names: list[str], normaliser: Normaliser) -> Tensor:
    mean, std = (torch.tensor(each, dtype=given.dtype) for each in (normaliser.mean, normaliser.std))
    return (given[..., [names.index(name) for name in normaliser.names]] - mean) / std


def _weigh_basis(outputs: Tensor, basis: Array) -> Tensor:
    """Paths (S, T, 2) [m] of outputs (S, 2 r), see `weigh_shapes`."""
    weights = outputs.reshape(-1, 2, basis.shape[1])
    return (weights @ torch.tensor(basis.T, dtype=outputs.dtype)).swapaxes(1, 2)


def trace_module(whole: MeasuredNetworks | MeasuredLayers, result: str, file: Path, opset: int) -> None:
    """Write a module as ONNX; `result` is the name of its output."""
    axes = {name: {zeros.ndim - 2: "S"} for name, zeros in whole.zeros.items()} | {result: {0: "S"}}
    with warnings.catch_warnings(action="ignore"):  # what PyTorch takes for constants are constants
        torch.onnx.export(
            whole.eval(),
            tuple(whole.zeros.values()),
            str(file),
            dynamo=False,
            opset_version=opset,
            input_names=list(whole.zeros),
            output_names=[result],
            dynamic_axes=axes,
        )


@dataclass(frozen=True)
class NetworkCorrector(RecurrentCorrector):
    """The mean of the networks of the folds."""

    of_torch: ClassVar[bool] = True
    networks: tuple[TrainedModule, ...]


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
