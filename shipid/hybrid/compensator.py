"""The compensator: small networks, plain arrays, that predict what the physics misses, eq. (12) and (13)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from shipid.data.windows import Instants
from shipid.hybrid.features import Array, Inputs, select_inputs
from shipid.hybrid.physics import Physics
from shipid.hybrid.stored import StoredData

Layers = tuple[tuple[Array, Array], ...]


@dataclass(frozen=True)
class Normaliser(StoredData):
    """The z-score of the training samples: (value - mean) / std, (d,) each, of the named features."""

    names: tuple[str, ...]
    mean: Array
    std: Array

    @classmethod
    def fit(cls, table: Mapping[str, Array], names: Sequence[str]) -> Self:
        """Take the statistics of training samples (S,)."""
        values = [table[name] for name in names]
        return cls(tuple(names), np.array([v.mean() for v in values]), np.array([v.std() for v in values]))

    def apply(self, table: Mapping[str, Array]) -> Array:
        """Return normalised inputs (S, d) of features (S,); DataError where one is missing."""
        return (select_inputs(table, self.names) - self.mean) / self.std


@dataclass(frozen=True)
class Network(StoredData):
    """One trained network with what belongs to its data.

    features : name of each input -> the columns that were equal to it in training.
    normaliser : z-score of those inputs.
    basis : (T, r) shapes over the horizon [m] that the outputs weigh; the identity where each step has an output.
    layers : (weight (i, o), bias (o,)) of each layer; outputs are x_1 ... x_r, y_1 ... y_r.
    """

    features: Mapping[str, tuple[str, ...]]
    normaliser: Normaliser
    basis: Array
    layers: Layers

    def predict(self, table: Mapping[str, Array]) -> Array:
        """Return the compensation (T, S, 2) [m] for features (S,)."""
        *hidden, (weight, bias) = self.layers
        units = self.normaliser.apply(table)
        for inner, offset in hidden:
            units = np.tanh(units @ inner + offset)
        return weigh_shapes(self.basis, units @ weight + bias)


@dataclass(frozen=True)
class PathCorrector(StoredData, ABC):
    """What adds a compensation to the path of the physics, from what is known at the instant.

    inputs : which quantities it may take.
    """

    inputs: Inputs

    @property
    def past(self) -> float:
        """Length of the past that a prediction needs [s]."""
        return self.inputs.memory.past

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:
        """Return paths (T, S, 2) [m] in the frame (11): those of the physics plus the compensation."""
        return paths + self.compensation(self.inputs.table(physics, instants))

    @abstractmethod
    def compensation(self, table: Mapping[str, Array]) -> Array:
        """Return the compensation (T, S, 2) [m] in the frame (11), from inputs (S,) by name."""


@dataclass(frozen=True)
class Compensator(PathCorrector):
    """The mean of some networks, one per fold."""

    networks: tuple[Network, ...]
    hyperparameters: Mapping[str, float]

    def compensation(self, table: Mapping[str, Array]) -> Array:
        """Return the compensation (T, S, 2) [m] in the frame (11), from inputs (S,) by name."""
        return mean_paths([network.predict(table) for network in self.networks])


def mean_paths(paths: Sequence[Array]) -> Array:
    """The mean of paths (T, S, 2); IndexError where there is none."""
    return sum(paths[1:], start=paths[0]) / len(paths)


def flatten_paths(paths: Array) -> Array:
    """Arrange outputs (S, 2 r) of a network, x_1 ... x_r, y_1 ... y_r as in (12), for paths or shapes (r, S, 2)."""
    return np.concatenate([paths[..., 0], paths[..., 1]]).T


def unflatten_paths(outputs: Array) -> Array:
    """Arrange paths or shapes (r, S, 2) of outputs (S, 2 r): the inverse of `flatten_paths`."""
    return np.stack(np.split(outputs.T, 2), axis=-1)


def weigh_shapes(basis: Array, outputs: Array) -> Array:
    """Paths (T, S, 2) [m] that outputs (S, 2 r), x_1 ... x_r, y_1 ... y_r, weigh shapes (T, r) to."""
    weights = unflatten_paths(outputs).reshape(basis.shape[1], -1)
    return (basis @ weights).reshape(len(basis), -1, 2)


def smooth_basis(horizon: int, terms: int) -> Array:
    """Orthonormal polynomials (T, r) of time without a constant: an error starts from 0. r is at most T."""
    time_ = np.arange(1, horizon + 1) / horizon
    powers = np.polynomial.chebyshev.chebvander(2 * time_ - 1, min(terms, horizon) - 1) * time_[:, None]
    return np.asarray(np.linalg.qr(powers)[0])
