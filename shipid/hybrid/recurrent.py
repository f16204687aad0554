"""Recurrent: a gated recurrent unit reads the past, and gives the compensation of the path.

h_k = GRU(h_(k-1), [u, v, r, commands, relative wind]_k) over the past up to the instant; then
[dx, dy] = B (W_2 tanh(W_1 [h, inputs at the instant] + c_1) + c_2), with B polynomials of time. AdamW on the mean
squared error of the path, early stopping on the validation windows; the corrector is the mean over the folds. With
mirror, x is even and y odd by construction. The unit: Cho et al. (2014); PyTorch trains it, plain arrays predict.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat, PositiveInt

from shipid.data.windows import Instants
from shipid.hybrid.compensator import Normaliser, flatten_paths, mean_paths, weigh_shapes
from shipid.hybrid.features import Inputs, Memory, count_steps, feature_table, last_steps
from shipid.hybrid.method import Array, Index, Row, Task
from shipid.hybrid.physics import Physics
from shipid.hybrid.search import (
    PathProblem,
    Point,
    Scale,
    SearchedAlone,
    SearchProblem,
    TrialWorth,
    mean_squared_error,
    seed_of,
)
from shipid.hybrid.stored import StoredData
from shipid.hybrid.units import VaryingInputs

Sequences = tuple[list[Array], Array]
"""What a network reads, normalised: P + 1 rows (S, d), the past with the instant, and inputs at the instant (S, e)."""


@dataclass(frozen=True)
class SequenceReader(StoredData):
    """Names, statistics and mirrors of what a network reads.

    past, now : z-scores of the signals of the past with the instant, and of the inputs at the instant.
    mirrors : of both; None where port and starboard are not mirror images. steps : of the past.
    """

    past: Normaliser
    now: Normaliser
    mirrors: tuple[Array, Array] | None
    steps: int

    def read(self, table: Mapping[str, Array], instants: Instants, commands: tuple[str, ...]) -> Sequences:
        """Read instants, with their inputs (S,) as `Inputs.table` gives them."""
        rows = [self.past.apply(signals) for signals in past_signals(instants, self.steps, commands)]
        return rows, self.now.apply(table)

    def mirrored(self, seen: Sequences) -> Sequences:
        """The image of port and starboard."""
        assert self.mirrors is not None
        return [row @ self.mirrors[0] for row in seen[0]], seen[1] @ self.mirrors[1]


def past_signals(instants: Instants, steps: int, commands: tuple[str, ...]) -> list[dict[str, Array]]:
    """Motion, commands and relative wind (S,) at the last `steps` steps and at the instant, the oldest first."""
    past = last_steps(instants, steps)
    before = [{name: values[k] for name, values in past.items()} for k in range(steps)]
    return [feature_table(columns, commands) for columns in (*before, instants.columns)]


@dataclass(frozen=True)
class GatedNetwork(StoredData):
    """One trained network: what it reads, its layers by name, and its basis (T, r) [m]."""

    reader: SequenceReader
    layers: Mapping[str, Array]
    basis: Array

    def predict(self, table: Mapping[str, Array], instants: Instants, commands: tuple[str, ...]) -> Array:
        """Compensation (T, S, 2) [m]."""
        seen = self.reader.read(table, instants, commands)
        outputs = self._outputs(seen)
        if self.reader.mirrors is not None:
            half = np.repeat([1.0, -1.0], outputs.shape[1] // 2)
            outputs = (outputs + half * self._outputs(self.reader.mirrored(seen))) / 2
        return weigh_shapes(self.basis, outputs)

    def _outputs(self, seen: Sequences) -> Array:
        layers, (past, now) = self.layers, seen
        hidden = np.zeros((len(now), layers["W_h"].shape[1]))
        for row in past:
            a = row @ layers["W_i"].T + layers["b_i"]
            b = hidden @ layers["W_h"].T + layers["b_h"]
            reset, update, fresh = np.split(a, 3, axis=1)
            reset_h, update_h, fresh_h = np.split(b, 3, axis=1)
            gate = _logistic(update + update_h)
            hidden = (1 - gate) * np.tanh(fresh + _logistic(reset + reset_h) * fresh_h) + gate * hidden
        full = np.concatenate([hidden, now], axis=1)
        return np.tanh(full @ layers["W_1"].T + layers["c_1"]) @ layers["W_2"].T + layers["c_2"]


def _logistic(values: Array) -> Array:
    return (1 + np.tanh(values / 2)) / 2


@dataclass(frozen=True)
class RecurrentCorrector(StoredData):
    """The mean of the networks of the folds."""

    inputs: Inputs
    past: float
    networks: tuple[GatedNetwork, ...]
    hyperparameters: Mapping[str, float]

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:
        """Return paths (T, S, 2) [m] in the frame (11): those of the physics plus the compensation."""
        table = self.inputs.table(physics, instants)
        corrections = [network.predict(table, instants, self.inputs.commands) for network in self.networks]
        return paths + mean_paths(corrections)


class RecurrentProblem(PathProblem):
    """A foundation whose past is read by networks, one for each fold, that give the error of the path on the basis."""

    def __init__(self, method: Recurrent, task: Task, name: str) -> None:
        super().__init__(method, task, name)
        self.trained: dict[int, tuple[GatedNetwork, ...]] = {}  # trial -> networks of the folds

    def judge(self, number: int, point: Point) -> TrialWorth:
        """Return the error of the networks of the folds, and the most epochs of one."""
        networks = [self._train(number, point, fold) for fold in range(len(self.task.folds))]
        self.trained[number] = tuple(network for network, _ in networks)
        losses = []
        for network, (_, validation) in zip(self.trained[number], self.task.folds, strict=True):
            here, instants = self.rows(validation), self.instants.select(validation)
            predicted = network.predict(here, instants, self.task.commands)
            losses.append(mean_squared_error(predicted, self.targets[:, validation]))
        return float(np.mean(losses)), point, max(epochs for _, epochs in networks)

    def corrector(self, best: Sequence[Row]) -> Any:
        """Return the mean of the networks of the best trial; those of an earlier session are trained once more."""
        number, params = best[0]["number"], best[0]["params"]
        if number not in self.trained:
            self.judge(number, params)
        return self.method.corrector(self.inputs, self.method.past, self.trained[number], params)

    def _reader(self, training: Index) -> SequenceReader:
        """Statistics of the training windows alone."""
        steps = count_steps(self.method.seconds, self.task.windows.step)
        rows = past_signals(self.task.windows.select(training).instants(), steps, self.task.commands)
        along = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
        past, now = (VaryingInputs.of(part, self.method.mirror) for part in (along, self.rows(training)))
        mirrors = past.reflection, now.reflection
        both = None if mirrors[0] is None or mirrors[1] is None else (mirrors[0], mirrors[1])
        return SequenceReader(past.normaliser, now.normaliser, both, steps)

    def _train(self, number: int, point: Point, fold: int) -> tuple[GatedNetwork, int]:
        """The network of the best epoch of a fold, and the number of epochs."""
        training = self.task.folds[fold][0]
        reader, parts = self._reader(training), []
        scale = max(float(np.sqrt(np.square(self.weights[:, training]).mean())), 1e-9)
        for windows in self.task.folds[fold]:
            seen = reader.read(self.rows(windows), self.instants.select(windows), self.task.commands)
            both = [seen] if reader.mirrors is None else [seen, reader.mirrored(seen)]
            parts.append((both, flatten_paths(self.weights[:, windows]) / scale))
        seed = seed_of(self.task.seed, self.name, number, fold)
        return self.learn(reader, parts, point, scale, seed)

    def learn(self, reader: SequenceReader, parts: Any, point: Point, scale: float, seed: int) -> tuple[Any, int]:
        """Return a network trained on parts of the data, see `train_gated`, and its epochs; outputs have a scale."""
        from shipid.hybrid.training import Length, train_gated  # a study is read without PyTorch

        method = self.method
        length = Length(method.epochs, method.batch, method.patience)
        layers, epochs = train_gated(parts, method.units, point["learning_rate"], method.weight_decay, length, seed)
        scaled = {**layers, "W_2": layers["W_2"] * scale, "c_2": layers["c_2"] * scale}
        return GatedNetwork(reader, scaled, self.basis), epochs


class Recurrent(SearchedAlone):
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
    problem: ClassVar[type[SearchProblem]] = RecurrentProblem
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
        return max(self.seconds, super().past)
