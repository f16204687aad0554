"""Hankel-DMD with control: a linear law of state, delayed states and commands, in closed form, rolled over the horizon.

a_k = A [nu_k, nu_(k-1) ... nu_(k-d), a_(k-1) ... a_(k-d), commands_k ... commands_(k-d), wind_k] + b, with a_k the
acceleration that a single step of the physics misses (without physics: the acceleration, and its delays are left out).
A, b are a ridge regression on true steps; then nu_(k+1) = physics(nu_k) + step a_k. For ships: Diez et al. (2021-24).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import Field, PositiveFloat
from pydantic import model_validator as validator

from shipid.data.windows import Instants
from shipid.hybrid.compensator import Normaliser
from shipid.hybrid.features import MOTIONS, count_steps, earlier_instants, feature_table, last_steps
from shipid.hybrid.method import Array, Index
from shipid.hybrid.physics import Physics
from shipid.hybrid.search import LearningProblem, Point, Scale
from shipid.hybrid.stepping import (
    MISSED_NAMES,
    StepMethod,
    Stepper,
    StepProblem,
    step_alone,
    stepped_paths,
    true_motion,
)
from shipid.hybrid.stored import StoredData
from shipid.hybrid.units import VaryingInputs, apply_blocks, solve_ridges


@dataclass(frozen=True)
class LinearLaw(StoredData):
    """The linear law, with its inputs.

    commands : names of the command columns. delays : number of past steps.
    weights : (..., d + 1, 3) of normalised inputs and a constant; R in front are R laws for R S inputs, in R blocks.
    """

    commands: tuple[str, ...]
    delays: int
    normaliser: Normaliser
    weights: Array

    def __call__(self, table: Mapping[str, Array]) -> Array:
        """Missing acceleration (S, 3) [m/s^2, rad/s^2] for inputs (S,)."""
        z = self.normaliser.apply(table)
        return apply_blocks(np.concatenate([z, np.ones((len(z), 1))], axis=1), self.weights)


def delayed_inputs(
    now: Mapping[str, Array], before: Mapping[str, Array], delays: int, commands: tuple[str, ...]
) -> dict[str, Array]:
    """Inputs (S,) of the law: those at the instant and, for each name of `before` (P, S), the last `delays` of them.

    The name of a delay says how many steps ago it was: `past-2.u`, `port.past-1.n`, `missed.past-1.v`.
    """
    table = feature_table(now, commands)
    for name, values in before.items():
        component, dot, signal = name.rpartition(".")
        for ago in range(1, delays + 1):
            table[f"{component}{dot}past-{ago}.{signal}"] = values[-ago]
    return table


def missed_steps(physics: Physics, instants: Instants, motion: Mapping[str, Array]) -> dict[str, Array]:
    """Accelerations that single steps of the physics miss, `MISSED_NAMES` -> (T, S), of T steps from the instants on.

    motion : true u, v, r and psi after 0..T steps, (T + 1, S).
    """
    stepper, residuals = Stepper(physics, instants), []
    for k in range(physics.horizon):
        at = stepper.at(k, {name: values[k] for name, values in motion.items()})
        after = np.stack([motion[name][k + 1] for name in MOTIONS], axis=1)
        residuals.append((after - step_alone(physics, at)) / physics.step)
    return {name: np.stack([step[:, axis] for step in residuals]) for axis, name in enumerate(MISSED_NAMES)}


def past_rows(physics: Physics, instants: Instants, delays: int, commands: tuple[str, ...]) -> dict[str, Array]:
    """Velocities, commands and what the physics missed over the last steps before the instants, (P, S) by name."""
    past = last_steps(instants, delays)
    rows = {name: past[name] for name in (*MOTIONS, *commands)}
    if physics.absent:
        return rows
    then = earlier_instants(instants, delays, physics.step, placed=False)
    motion = {name: np.concatenate([past[name], np.stack([instants.columns[name]])]) for name in (*MOTIONS, "psi")}
    return rows | missed_steps(replace(physics, horizon=delays), then, motion)


@dataclass(frozen=True)
class HankelCorrector(StoredData):
    """The law, rolled over the horizon from the past of the instants."""

    law: LinearLaw
    past: float
    hyperparameters: Mapping[str, float]

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:  # noqa: ARG002
        """Return paths (T, S, 2) [m] in the frame (11)."""
        law = self.law

        def acceleration(at: Instants, _: Array) -> Array:
            return law(delayed_inputs(at.columns, at.past, law.delays, law.commands))

        return stepped_paths(physics, instants, acceleration, past_rows(physics, instants, law.delays, law.commands))


class HankelProblem(StepProblem):
    """A foundation whose missing accelerations are the targets of linear laws."""

    def solve(self, number: int, point: Point, windows: Index) -> HankelCorrector:  # noqa: ARG002
        """Return the law on the steps of some windows."""
        delays = count_steps(point["delays"], self.task.windows.step)
        chosen, table = self.steps.of(windows), self.table(delays)
        here = {key: values[chosen] for key, values in table.items()}
        seen, missing = VaryingInputs.of(here, self.method.mirror), self.steps.missing[chosen]
        if seen.reflection is not None:
            missing = np.concatenate([missing, missing * [1.0, -1.0, -1.0]])
        values = (seen.samples(here) - seen.normaliser.mean) / seen.normaliser.std
        full = np.concatenate([values, np.ones((len(values), 1))], axis=1)
        size = np.maximum(missing.std(axis=0), 1e-12)
        penalty = np.r_[np.ones(values.shape[1]), 1e-3]
        weights = solve_ridges(full, missing / size, point["ridge"], penalty) * size
        return HankelCorrector(LinearLaw(self.task.commands, delays, seen.normaliser, weights), point["delays"], point)

    def table(self, delays: int) -> dict[str, Array]:
        """Return inputs (N,) at the true steps: before them are the past and the horizon of their windows."""
        windows, steps, physics = self.task.windows, self.steps, self.case.physics
        past = past_rows(physics, self.task.instants(self.name), delays, self.task.commands)
        motion = true_motion(windows)
        later = {**motion, **windows.planned}
        if not physics.absent:
            instants = windows.instants(known=True, hidden=self.task.hidden.get(self.name))
            later |= missed_steps(physics, instants, motion)
        at, before = delays + steps.number, {}
        for key, values in past.items():
            rows = np.concatenate([values, later[key]])
            before[key] = np.stack([rows[at - ago, steps.window] for ago in range(delays, 0, -1)])
        return delayed_inputs(steps.at.columns, before, delays, self.task.commands)


class HankelDMD(StepMethod):
    """A linear law with delays and control; it needs a past, and works with and without physics.

    Parameters
    ----------
    delays : how far back the law may look [s]; each is a trial, so `trials` is refused.
    ridge : weight of the squared weights of normalised inputs; 8 from low to high.
    mirror, samples : as in `StepMethod`; the image of every step in the mirror counts, too.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = ("ridge",)
    problem: ClassVar[type[LearningProblem]] = HankelProblem
    corrector: ClassVar[type[Any]] = HankelCorrector

    delays: Annotated[tuple[PositiveFloat, ...], Field(min_length=1)] = (2.0, 4.0, 8.0)
    ridge: Scale = (1e-8, 1e-1)

    @validator(mode="after")
    def _delays_are_the_trials(self) -> Self:
        """Refuse a number of trials, which nothing would ask for."""
        if "trials" in self.model_fields_set:
            raise ValueError("trials: each of `delays` is a trial: leave it out")
        return self

    @property
    def past(self) -> float:
        """Length of the past that windows must hold [s]."""
        return max(self.delays)

    def choices(self) -> dict[str, tuple[float, ...]]:
        """Return what is searched among some values: the delays."""
        return {"delays": self.delays}

    def points(self) -> list[Point]:
        """Return the trials: every delay."""
        return [{"delays": delays} for delays in self.delays]
