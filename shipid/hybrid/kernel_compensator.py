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


def kernel_values(points: Any, centres: Any, linear: Any, maths: Any = np) -> Any:
    """exp(-|z - c|^2 / 2) + l (1 + z c) (..., S, C), points (..., S, d) and centres (C, d) divided by their scales."""
    product = points @ centres.T
    values = product - (points**2).sum(-1).reshape(*points.shape[:-1], 1) / 2
    values -= (centres**2).sum(-1) / 2
    product += 1
    product *= linear
    return maths.exp(values) + product


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
        z, terms = self.normaliser.apply(table), self.basis.shape[1]
        total: Any = 0.0
        for one in self.members:
            centres = self.centres / one.scales
            total = total + kernel_values(z / one.scales, centres, one.linear) @ one.weights
            if self.reflection is not None:
                image = kernel_values(z @ self.reflection / one.scales, centres, one.linear) @ one.weights
                total = total + np.repeat([1.0, -1.0], terms) * image
        return weigh_shapes(self.basis, total / len(self.members))
