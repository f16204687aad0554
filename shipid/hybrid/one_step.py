"""One step: networks of state, commands and wind that give the acceleration the physics misses, at every step.

nu_(k+1) = physics(nu_k) + step f(u, v, r, commands, u_rw, v_rw), with f(z) = W tanh(V z + c), V and c drawn and W in
closed form by what single steps of the physics from true states miss. Skulstad et al. (2021) train it by gradients.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from pydantic import PositiveInt

from shipid.data.windows import Instants
from shipid.hybrid.compensator import mean_paths
from shipid.hybrid.features import feature_table
from shipid.hybrid.method import Array, Index, Row, Task
from shipid.hybrid.physics import Physics
from shipid.hybrid.search import LearningProblem, Point, Scale, seed_of, windows_of_folds
from shipid.hybrid.stepping import StepMethod, StepProblem, stepped_paths
from shipid.hybrid.stored import StoredData
from shipid.hybrid.units import Units, VaryingInputs, apply_blocks, solve_ridges


@dataclass(frozen=True)
class OutputWeights(StoredData):
    """One network: hidden units and their output weights, (M + 1, 1) for surge and (M or M + 1, 2) for sway and yaw.

    Weights may have R more in front, (R, M + 1, 1) and (R, M, 2), for R networks on the same units.
    """

    units: Units
    surge: Array
    sway_yaw: Array

    def acceleration(self, table: Mapping[str, Array]) -> Array:
        """Missing acceleration (S, 3) [m/s^2, rad/s^2] for inputs (S,); of R networks for R S inputs, in R blocks."""
        even, odd = self.units.parts(table)
        return np.concatenate([apply_blocks(even, self.surge), apply_blocks(odd, self.sway_yaw)], axis=1)


@dataclass(frozen=True)
class OneStepCorrector(StoredData):
    """The mean of some networks, applied at every step of the rollout."""

    commands: tuple[str, ...]
    heads: tuple[OutputWeights, ...]
    hyperparameters: Mapping[str, float]
    past: float = 0.0

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:  # noqa: ARG002
        """Return paths (T, S, 2) [m] in the frame (11), rolled out with the missing acceleration."""

        def acceleration(at: Instants, _: Array) -> Array:
            table = feature_table(at.columns, self.commands)
            return mean_paths([head.acceleration(table) for head in self.heads])

        return stepped_paths(physics, instants, acceleration)


class OneStepProblem(StepProblem):
    """A foundation whose missing accelerations are the targets of drawn networks."""

    def __init__(self, method: OneStep, task: Task, name: str) -> None:
        super().__init__(method, task, name)
        self.table = feature_table(self.steps.at.columns, task.commands)

    def solve(self, number: int, point: Point, windows: Index) -> OneStepCorrector:
        """Return networks on the steps of some windows."""
        chosen = self.steps.of(windows)
        here = {key: values[chosen] for key, values in self.table.items()}
        units = VaryingInputs.of(here, self.method.mirror).draw(
            point, self.method.units, seed_of(self.task.seed, number)
        )
        missing = self.steps.missing[chosen]
        size = np.maximum(missing.std(axis=0), 1e-12)
        even, odd = units.parts(here)
        surge = solve_ridges(even, missing[:, :1] / size[:1], point["ridge"]) * size[:1]
        sway_yaw = solve_ridges(odd, missing[:, 1:] / size[1:], point["ridge"]) * size[1:]
        return OneStepCorrector(self.task.commands, (OutputWeights(units, surge, sway_yaw),), point)

    def corrector(self, best: Sequence[Row]) -> OneStepCorrector:
        """Return the mean of the networks of the best trials."""
        every = windows_of_folds(self.task)
        solved = [self.solve(row["number"], row["params"], every) for row in best]
        heads = tuple(one.heads[0] for one in solved)
        return OneStepCorrector(self.task.commands, heads, solved[0].hyperparameters)


class OneStep(StepMethod):
    """Networks with drawn hidden units on the missing acceleration, applied at every step of the rollout.

    Parameters
    ----------
    trials : sets of hyperparameters tried per foundation.
    units : hidden units of tanh; in mirrored pairs where the inputs have a mirror.
    motion_scale, command_scale, wind_scale : how far an input must move, in its standard deviations, to change a hidden
        unit by about one.
    offset : spread of the offsets of the hidden units: large bends more.
    ridge : weight of the squared output weights beside the mean squared error of the accelerations, each axis by its
        standard deviation; each trial takes the best of 8.
    averaged : the accelerations are the mean of the networks of so many best trials.
    mirror, samples : as in `StepMethod`.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = ("motion_scale", "command_scale", "wind_scale", "offset", "ridge")
    problem: ClassVar[type[LearningProblem]] = OneStepProblem
    corrector: ClassVar[type[Any]] = OneStepCorrector

    trials: PositiveInt = 12
    units: PositiveInt = 200
    motion_scale: Scale = (1.0, 16.0)
    command_scale: Scale = (1.0, 16.0)
    wind_scale: Scale = (4.0, 64.0)
    offset: Scale = (0.5, 4.0)
    ridge: Scale = (1e-9, 1e-2)
    averaged: PositiveInt = 4

    def num_chosen(self) -> int:
        """Return how many of the best trials make the corrector, at most."""
        return self.averaged
