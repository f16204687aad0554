"""The compensator of kernel ridge regression: the mean of some solutions, and their kernel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shipid.hybrid.compensator import Normaliser, PathCorrector, weigh_shapes
from shipid.hybrid.features import input_group
from shipid.hybrid.method import Array
from shipid.hybrid.stored import StoredData

GROUPS = {"motion": "", "command": "", "wind": ""} | {
    "history": "history",
    "turned": "turned",
    "position": "positions",
    "error": "error",
    "observer": "observer",
}
"""Groups of inputs, with a length scale each -> the setting of the memory that gives them, where it is one."""


def kernel_group(name: str) -> str:
    """Group of an input by its name: as `input_group`, with changes of heading and positions apart from history."""
    group = input_group(name)
    if group != "history":
        return group
    return "position" if name[-2:] in (".x", ".y") else "turned" if name.startswith("turned") else group


def with_constant(values: Array) -> Array:
    """Values (..., d + 1): those given, and 1."""
    return np.concatenate((values, np.ones_like(values[..., :1])), -1)


def bell_values(points: Array, centres: Array) -> Array:
    """exp(-|z - c|^2 / 2) (..., S, C), points (..., S, d) and centres (C, d) divided by their scales.

    The exponent is one product of matrices, [z, 1, -|z|^2 / 2] [c, -|c|^2 / 2, 1]^T.
    """
    near, far = ((one**2).sum(-1)[..., None] / -2 for one in (points, centres))
    values = np.concatenate((with_constant(points), near), -1) @ with_constant(np.concatenate((centres, far), -1)).T
    return np.exp(values, out=values)


def mirrored_sides(values: Array, reflection: Array | None) -> Array:
    """Normalised inputs (K, S, d): as they are, and their images where there is a mirror."""
    return np.stack([values] if reflection is None else [values, values @ reflection])


def weighed_kernels(sides: Array, centres: Array, linear: float, weights: Array) -> Any:
    """Kernels exp(-|z - c|^2 / 2) + l (1 + z c) times weights (C, R): outputs (S, R) of windows.

    sides : (K, S, d), windows as they are and, where there is a mirror, their images. centres : (C, d). Both are
    divided by their scales. The linear kernel goes through the few inputs, not through the centres.
    """
    slopes = linear * (with_constant(centres).T @ weights)
    values = bell_values(sides, centres) @ weights + with_constant(sides) @ slopes
    values[1:, :, weights.shape[1] // 2 :] *= -1
    return values.sum(0)


@dataclass(frozen=True)
class KernelMember(StoredData):
    """One solution: scales (d,) of the inputs, weight of the linear kernel, weights (C, 2 r) of the centres."""

    scales: Array
    linear: float
    weights: Array


@dataclass(frozen=True)
class KernelCompensator(PathCorrector):
    """The mean of some solutions on the same centres (C, d), which are normalised inputs.

    reflection : (d, d), or None: see `VaryingInputs`. basis : (T, r) shapes over the horizon [m] that outputs weigh.
    """

    normaliser: Normaliser
    reflection: Array | None
    basis: Array
    centres: Array
    members: tuple[KernelMember, ...]
    hyperparameters: Mapping[str, float]

    def compensation(self, table: Mapping[str, Array]) -> Array:
        """Return the compensation (T, S, 2) [m] in the frame (11), from inputs (S,) by name."""
        z, signs = self.normaliser.apply(table), np.repeat([1.0, -1.0], self.basis.shape[1])
        sides = [(1.0, z)] if self.reflection is None else [(1.0, z), (signs, z @ self.reflection)]
        total: Any = sum(
            sign * _weighed_values(points / one.scales, self.centres / one.scales, one)
            for one in self.members
            for sign, points in sides
        )
        return weigh_shapes(self.basis, total / len(self.members))


def _weighed_values(points: Any, centres: Array, one: KernelMember) -> Any:
    """Kernels exp(-|z - c|^2 / 2) + l (1 + z c) times weights (S, 2 r), by what arrays of CasADi have, too."""
    exponent = points @ centres.T - (points**2).sum(-1).reshape(-1, 1) / 2 - (centres**2).sum(-1) / 2
    slopes = points @ (centres.T @ one.weights) + one.weights.sum(0)
    return np.exp(exponent) @ one.weights + one.linear * slopes
