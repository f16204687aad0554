"""Recurrent: a gated recurrent unit reads the past, and gives the compensation of the path.

h_k = GRU(h_(k-1), [u, v, r, commands, relative wind]_k) over the past up to the instant; then
[dx, dy] = B (W_2 tanh(W_1 [h, inputs at the instant] + c_1) + c_2), with B polynomials of time; where commands are
known, the plan is among the inputs at the instant, as in `path-drawn`. AdamW on the mean squared error of the path,
early stopping on the validation windows; the mean of the networks of the folds is the corrector. With mirror, x is even
and y odd under the exchange of port and starboard, by construction. The usual deep rival (the unit: Cho et al. 2014);
PyTorch trains it, plain arrays predict.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, pi
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat, PositiveFloat, PositiveInt

from shipid.data.windows import Instants
from shipid.errors import DataError
from shipid.hybrid.compensator import Normaliser, unflatten
from shipid.hybrid.features import Inputs, Memory, feature_table, steps_of
from shipid.hybrid.method import Fitted, Index, Task, Traits, shared_tables
from shipid.hybrid.physics import Physics
from shipid.hybrid.search import Search
from shipid.hybrid.settings import Scale, Searched, seed_of
from shipid.hybrid.stored import Stored
from shipid.hybrid.trials import best_of, fit_each, mean_square, points_of, row_of
from shipid.hybrid.units import Seen

if TYPE_CHECKING:
    import torch

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sequences:
    """What a network reads, normalised: the past with the instant (P + 1, S, d), and inputs at the instant (S, e)."""

    past: Array
    now: Array


@dataclass(frozen=True)
class Reader(Stored):
    """Names, statistics and mirrors of what a network reads.

    past, now : z-scores of the signals of the past, the instant among them, and of the inputs at the instant.
    mirrors : of both; None where port and starboard are not mirror images.
    steps : number of past steps.
    """

    past: Normaliser
    now: Normaliser
    mirrors: tuple[Array, Array] | None
    steps: int

    def read(self, table: Mapping[str, Array], instants: Instants, commands: tuple[str, ...]) -> Sequences:
        """Read instants, with their inputs (S,) as `Inputs.table` gives them."""
        rows = [self.past.apply(signals) for signals in signals_of(instants, self.steps, commands)]
        return Sequences(np.stack(rows), self.now.apply(table))

    def mirrored(self, seen: Sequences) -> Sequences:
        """The image of port and starboard."""
        assert self.mirrors is not None
        along, at = self.mirrors
        return Sequences(seen.past @ along, seen.now @ at)


def signals_of(instants: Instants, steps: int, commands: tuple[str, ...]) -> list[dict[str, Array]]:
    """Motion, commands and relative wind (S,) at the last `steps` steps and at the instant, the oldest first."""
    held = len(instants.past.get("u", ()))
    if held < steps:
        raise DataError(f"the method needs {steps} steps of the past, there are {held}", path="u")
    before = [{name: values[k] for name, values in instants.past.items()} for k in range(held - steps, held)]
    return [feature_table(columns, commands) for columns in (*before, instants.columns)]


@dataclass(frozen=True)
class GatedNetwork(Stored):
    """One trained network: what it reads, its layers by name, and its basis (T, r) [m]."""

    reader: Reader
    layers: Mapping[str, Array]
    basis: Array

    def predict(self, table: Mapping[str, Array], instants: Instants, commands: tuple[str, ...]) -> Array:
        """Compensation (T, S, 2) [m]."""
        seen = self.reader.read(table, instants, commands)
        outputs = self._outputs(seen)
        if self.reader.mirrors is not None:
            half = np.repeat([1.0, -1.0], outputs.shape[1] // 2)
            outputs = (outputs + half * self._outputs(self.reader.mirrored(seen))) / 2
        return np.tensordot(self.basis, unflatten(outputs), 1)

    def _outputs(self, seen: Sequences) -> Array:
        layers = self.layers
        hidden = np.zeros((len(seen.now), layers["W_h"].shape[1]))
        for row in seen.past:
            a = row @ layers["W_i"].T + layers["b_i"]
            b = hidden @ layers["W_h"].T + layers["b_h"]
            reset, update, fresh = np.split(a, 3, axis=1)
            reset_h, update_h, fresh_h = np.split(b, 3, axis=1)
            gate = _sigmoid(update + update_h)
            hidden = (1 - gate) * np.tanh(fresh + _sigmoid(reset + reset_h) * fresh_h) + gate * hidden
        full = np.concatenate([hidden, seen.now], axis=1)
        outputs: Array = np.tanh(full @ layers["W_1"].T + layers["c_1"]) @ layers["W_2"].T + layers["c_2"]
        return outputs


def _sigmoid(values: Array) -> Array:
    return (1 + np.tanh(values / 2)) / 2


@dataclass(frozen=True)
class RecurrentCorrector(Stored):
    """The mean of the networks of the folds."""

    inputs: Inputs
    past: float
    networks: tuple[GatedNetwork, ...]
    hyperparameters: Mapping[str, float]

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:
        """Return paths (T, S, 2) [m] in the frame (11): those of the physics plus the compensation."""
        table = self.inputs.table(physics, instants)
        corrections = [network.predict(table, instants, self.inputs.commands) for network in self.networks]
        return np.asarray(paths + np.mean(corrections, axis=0))


class Recurrent(Searched):
    """A gated recurrent unit on the past, trained on the errors of the path.

    Parameters
    ----------
    trials : networks tried per foundation and fold, each from other initial weights; the best by validation is taken.
    seconds : length of the past that it reads.
    units : of the recurrent state, and of the layer after it.
    learning_rate : of AdamW at the start, falling to 0 by half a cosine; a range is searched by its logarithm.
    weight_decay : decoupled.
    epochs : passes over the training windows, at most.
    batch : windows per optimiser step.
    patience : epochs without a better validation loss after which training stops.
    terms : the compensation is a polynomial of time with so many terms.
    mirror : whether the compensation has the symmetry of port and starboard, where the inputs allow it.
    memory : what the inputs at the instant hold of the past.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = ("learning_rate",)
    corrector: ClassVar[type[Any]] = RecurrentCorrector

    trials: PositiveInt = 3
    seconds: PositiveFloat = 10.0
    units: PositiveInt = 24
    learning_rate: Scale = (3e-3, 2e-2)
    weight_decay: NonNegativeFloat = 1e-3
    epochs: PositiveInt = 80
    batch: PositiveInt = 128
    patience: PositiveInt = 20
    terms: PositiveInt = 6
    mirror: bool = True
    memory: Memory = Memory()

    @property
    def past(self) -> float:
        """Length of the past that windows must hold [s]."""
        return max(self.seconds, self.memory.past)

    @property
    def traits(self) -> Traits:
        """What a study says of this method and compares it by."""
        return Traits(mirror=self.mirror, memory=self.memory, terms=self.terms)

    def fit(self, task: Task) -> dict[str, Fitted]:
        """Train networks for every foundation; the corrector is the mean of the fold networks of the best trial."""
        inputs = Inputs(task.commands, self.memory)
        tables = shared_tables(task, inputs)
        return fit_each(task, self, lambda: points_of(self), lambda name: self._fit(task, name, inputs, tables[name]))

    def _fit(self, task: Task, name: str, inputs: Inputs, table: Mapping[str, Array]) -> Fitted:
        from shipid.hybrid.ridge import smooth_basis  # a study is read without PyTorch

        search, trained = Search(task, [name], self), dict[int, tuple[GatedNetwork, ...]]()
        basis = smooth_basis(task.windows.horizon, self.terms)
        targets = task.targets[name]

        def networks_of(number: int, point: Mapping[str, float]) -> tuple[tuple[GatedNetwork, ...], int]:
            """A network of each fold, and the most epochs that one took."""
            trained = []
            for fold, (training, validation) in enumerate(task.folds):
                seed = seed_of(task.seed, name, number, fold)
                trained.append(self._trained(task, name, table, targets, basis, training, validation, point, seed))
            return tuple(network for network, _ in trained), max(epochs for _, epochs in trained)

        for number, point in search.left(points_of(self)):
            start, losses = time.process_time(), []
            trained[number], most = networks_of(number, point)
            for network, (_, validation) in zip(trained[number], task.folds, strict=True):
                here = {key: values[validation] for key, values in table.items()}
                predicted = network.predict(here, task.instants(name).select(validation), task.commands)
                losses.append(mean_square(predicted, targets[:, validation]))
            search.record({name: row_of(number, point, float(np.mean(losses)), start, most)})
        rows = search.rows[name]
        if not best_of(rows):
            return Fitted(None, rows, search.seconds)
        best = best_of(rows)[0]
        number, params = best["number"], best["params"]
        networks = trained[number] if number in trained else networks_of(number, params)[0]  # of an earlier session
        return Fitted(RecurrentCorrector(inputs, self.past, networks, params), rows, search.seconds)

    def _reader(self, task: Task, table: Mapping[str, Array], training: Index) -> Reader:
        """Statistics of the training windows alone."""
        steps = steps_of(self.seconds, task.windows.step)
        rows = signals_of(task.windows.select(training).instants(), steps, task.commands)
        along = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
        at = {name: values[training] for name, values in table.items()}
        past, now = (Seen.of(part, self.mirror) for part in (along, at))
        if past.reflection is None or now.reflection is None:
            return Reader(past.normaliser, now.normaliser, None, steps)
        return Reader(past.normaliser, now.normaliser, (past.reflection, now.reflection), steps)

    def _trained(
        self,
        task: Task,
        name: str,
        table: Mapping[str, Array],
        targets: Array,
        basis: Array,
        training: Index,
        validation: Index,
        point: Mapping[str, float],
        seed: int,
    ) -> tuple[GatedNetwork, int]:
        """Train a network on one fold; the network of the best epoch, and the number of epochs."""
        reader = self._reader(task, table, training)
        weights = np.tensordot(basis.T, targets, 1)
        data = []
        scale = max(float(np.sqrt(np.square(weights[:, training]).mean())), 1e-9)
        for part in (training, validation):
            here = {key: values[part] for key, values in table.items()}
            seen = reader.read(here, task.instants(name).select(part), task.commands)
            image = None if reader.mirrors is None else reader.mirrored(seen)
            outputs = np.concatenate([weights[:, part, 0], weights[:, part, 1]]).T / scale
            data.append((seen, image, outputs))
        layers, epochs = train(data, self.units, point["learning_rate"], self, seed)
        scaled = {**layers, "W_2": layers["W_2"] * scale, "c_2": layers["c_2"] * scale}
        return GatedNetwork(reader, scaled, basis), epochs


Part = tuple[Sequences, Sequences | None, Array]
Read = tuple["torch.Tensor", "torch.Tensor"]
"""The past (P + 1, S, d) and the inputs at the instant (S, e)."""


def train(
    data: list[Part], units: int, learning_rate: float, method: Recurrent, seed: int
) -> tuple[dict[str, Array], int]:
    """Train on the first part of the data, stop by the second; layers by name and the number of epochs.

    Each part is what is read, its mirror image or None, and the outputs (S, 2 r). On one thread, for the same digits.
    """
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        return _train(data, units, learning_rate, method, seed)
    finally:
        torch.set_num_threads(threads)


def _train(
    data: list[Part], units: int, learning_rate: float, method: Recurrent, seed: int
) -> tuple[dict[str, Array], int]:
    import torch

    from shipid.hybrid.training import Adam

    generator = torch.Generator().manual_seed(seed)
    weights, layers = _begun(data[0], units, generator)
    (seen, outputs), watched = map(_tensors, data)
    adam = Adam(weights, [method.weight_decay])
    best, kept, since, epoch = float("inf"), {}, 0, 0
    for epoch in range(1, method.epochs + 1):
        rate = torch.tensor([[learning_rate * (1 + cos(pi * (epoch - 1) / method.epochs)) / 2]])
        order = torch.randperm(len(outputs), generator=generator)
        for rows in (order[first : first + method.batch] for first in range(0, len(order), method.batch)):
            loss = _loss(layers, [(past[:, rows], now[rows]) for past, now in seen], outputs[rows])
            gradients = torch.autograd.grad(loss, list(layers.values()))
            with torch.no_grad():
                adam.step(torch.cat([gradient.flatten() for gradient in gradients])[None], rate)
        with torch.no_grad():
            value = float(_loss(layers, *watched))
        since += 1
        if value < best:
            best, since, kept = value, 0, _numbers(layers)
        if since >= method.patience:
            break
    return kept or _numbers(layers), epoch  # where no loss was a number, nor are the weights


def _begun(part: Part, units: int, generator: torch.Generator) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
    """Initial weights (1, P) drawn as PyTorch draws them, and the layers by name, which are leaves in their memory."""
    import torch

    read, _, outputs = part
    shapes = {"W_i": (3 * units, read.past.shape[2]), "W_h": (3 * units, units), "b_i": (3 * units,)}
    shapes |= {"b_h": (3 * units,), "W_1": (units, units + read.now.shape[1]), "c_1": (units,)}
    shapes |= {"W_2": (outputs.shape[1], units), "c_2": (outputs.shape[1],)}
    bounds = {name: (units if name[2] in "ih" else shape[-1]) ** -0.5 for name, shape in shapes.items()}
    draws = [(torch.rand(shape, generator=generator) * 2 - 1) * bounds[name] for name, shape in shapes.items()]
    weights = torch.cat([draw.flatten() for draw in draws])[None]
    pieces = torch.split(weights[0], [draw.numel() for draw in draws])
    return weights, {
        name: piece.view(shape).requires_grad_() for (name, shape), piece in zip(shapes.items(), pieces, strict=True)
    }


def _tensors(part: Part) -> tuple[list[Read], torch.Tensor]:
    """What is read, and then its mirror image if there is one, and the outputs (S, 2 r)."""
    import torch

    def tensor(values: Array) -> torch.Tensor:
        return torch.as_tensor(values, dtype=torch.float32)

    seen, image, outputs = part
    return [(tensor(one.past), tensor(one.now)) for one in (seen, image) if one is not None], tensor(outputs)


def _loss(layers: Mapping[str, torch.Tensor], seen: list[Read], outputs: torch.Tensor) -> torch.Tensor:
    """Mean squared error of the network on outputs (S, 2 r); with an image, x is made even and y odd."""
    import torch

    past, now = (torch.cat(arrays, dim=-2) for arrays in zip(*seen, strict=True))
    flat = [layers[name] for name in ("W_i", "W_h", "b_i", "b_h")]
    start = torch.zeros(1, len(now), layers["W_h"].shape[1])
    _, hidden = torch.gru(past, start, flat, True, 1, 0.0, False, False, False)
    full = torch.cat([hidden[0], now], dim=1)
    made = torch.tanh(full @ layers["W_1"].T + layers["c_1"]) @ layers["W_2"].T + layers["c_2"]
    if len(seen) == 2:
        sign = torch.ones(made.shape[1])
        sign[len(sign) // 2 :] = -1.0
        plain, image = made.chunk(2)
        made = (plain + sign * image) / 2
    loss: torch.Tensor = (made - outputs).square().mean()
    return loss


def _numbers(layers: Mapping[str, torch.Tensor]) -> dict[str, Array]:
    return {name: layer.detach().double().numpy().copy() for name, layer in layers.items()}
