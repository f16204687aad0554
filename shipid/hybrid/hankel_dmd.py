"""Hankel-DMD with control: a linear law of state, delayed states and commands, in closed form, rolled over the horizon.

a_k = A [nu_k, nu_(k-1) ... nu_(k-d), a_(k-1) ... a_(k-d), commands_k ... commands_(k-d), wind_k] + b, with a_k the
acceleration that a single step of the physics misses (without physics: the acceleration itself, and its delays are
left out, for those of nu hold them). A, b are a ridge regression on true steps; then
nu_(k+1) = physics(nu_k) + step a_k. Dynamic mode decomposition with delays and control for ships: Diez et al.
(2021-24).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat
from pydantic import model_validator as validator

from shipid.data.windows import Instants
from shipid.errors import DataError
from shipid.hybrid.compensator import Normaliser
from shipid.hybrid.features import MOTIONS, choose_features, feature_table, steps_of
from shipid.hybrid.method import Index
from shipid.hybrid.mirror import reflection
from shipid.hybrid.physics import Physics
from shipid.hybrid.search import Problem
from shipid.hybrid.settings import Point, Scale
from shipid.hybrid.stepping import Stepped, Stepper, StepProblem, free, stepped_paths, true_motion
from shipid.hybrid.stored import Stored
from shipid.hybrid.units import solve

Array = NDArray[np.float64]
MISSED = ("missed.u", "missed.v", "missed.r")


@dataclass(frozen=True)
class Law(Stored):
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
        full = np.concatenate([z, np.ones((len(z), 1))], axis=1)
        if self.weights.ndim == 2:
            return full @ self.weights
        return np.asarray((full.reshape(len(self.weights), -1, full.shape[1]) @ self.weights).reshape(-1, 3))


def delayed(
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


class _History:
    """The last steps of a rollout: velocities, commands and what the physics missed, (P, S) by name."""

    def __init__(self, physics: Physics, instants: Instants, delays: int, commands: tuple[str, ...]) -> None:
        self.delays, held = delays, len(instants.past.get("u", ()))
        if held < delays:
            raise DataError(f"the method needs {delays} steps of the past, there are {held}", path="u")
        past = {name: instants.past[name][held - delays :] for name in (*MOTIONS, *commands)}
        self.rows = {name: list(values) for name, values in past.items()}
        if physics.vessel is not None:
            for name, values in zip(MISSED, _missed_before(physics, instants, delays), strict=True):
                self.rows[name] = list(values)

    def move(self, at: Instants, missed: Array) -> None:
        """Go one step: what held at its start becomes the past."""
        for name, values in self.rows.items():
            values.append(missed[:, MISSED.index(name)] if name in MISSED else at.columns[name])

    def before(self) -> dict[str, Array]:
        """The last steps (P, S) by name, the oldest first."""
        return {name: np.stack(values[-self.delays :]) for name, values in self.rows.items()}


def _missed_before(physics: Physics, instants: Instants, delays: int) -> list[Array]:
    """What single steps of the physics missed over the last `delays` steps before the instants, u, v, r (P, S) each."""
    first = len(instants.past["u"]) - delays
    past = {name: values[first:] for name, values in instants.past.items()}
    given = {name: values for name, values in past.items() if "." in name}
    then = Instants({name: values[0] for name, values in past.items()}, planned=given)
    before = replace(physics, horizon=delays)
    stepper = Stepper(before, then)
    residuals = []
    for k in range(delays):
        motion = {name: past[name][k] for name in (*MOTIONS, "psi")}
        after = [past[name][k + 1] if k + 1 < delays else instants.columns[name] for name in MOTIONS]
        residuals.append((np.stack(after, axis=1) - free(before, stepper.at(k, motion))) / physics.step)
    return [np.stack([step[:, axis] for step in residuals]) for axis in range(3)]


@dataclass(frozen=True)
class HankelCorrector(Stored):
    """The law, rolled over the horizon from the past of the instants."""

    law: Law
    past: float
    hyperparameters: Mapping[str, float]

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:  # noqa: ARG002
        """Return paths (T, S, 2) [m] in the frame (11)."""
        law = self.law
        history = _History(physics, instants, law.delays, law.commands)

        def acceleration(at: Instants, _: int, __: Array) -> Array:
            residual = law(delayed(at.columns, history.before(), law.delays, law.commands))
            history.move(at, residual)
            return residual

        return stepped_paths(physics, instants, acceleration)


class HankelProblem(StepProblem):
    """A foundation whose missing accelerations are the targets of linear laws."""

    def solve_ridges(self, number: int, point: Point, windows: Index, ridges: Sequence[float]) -> HankelCorrector:  # noqa: ARG002
        """Return the law on the steps of some windows for all ridges; one ridge has no axis in front."""
        delays = steps_of(point["delays"], self.task.windows.step)
        chosen, table = self.steps.of(windows), self.table(delays)
        here = {key: values[chosen] for key, values in table.items()}
        features = choose_features(here)
        names = tuple(features)
        values, missing = np.stack([here[key] for key in names], axis=1), self.steps.missing[chosen]
        image = reflection(here, features) if self.method.mirror else None
        if image is not None:
            values = np.concatenate([values, values @ image])
            missing = np.concatenate([missing, missing * [1.0, -1.0, -1.0]])
        normaliser = Normaliser(names, values.mean(axis=0), values.std(axis=0))
        full = np.concatenate([(values - normaliser.mean) / normaliser.std, np.ones((len(values), 1))], axis=1)
        size = np.maximum(missing.std(axis=0), 1e-12)
        penalty = np.r_[np.ones(len(names)), 1e-3]
        weights = solve(full, missing / size, ridges, penalty) * size
        law = Law(self.task.commands, delays, normaliser, weights[0] if len(ridges) == 1 else weights)
        return HankelCorrector(law, point["delays"], point)

    def table(self, delays: int) -> dict[str, Array]:
        """Return inputs (N,) at the true steps: before them are the past and the horizon of their windows."""
        task, steps, windows = self.task, self.steps, self.task.windows
        if windows.num_past < delays:
            raise DataError(
                f"the method needs {delays} steps of the past, the windows hold {windows.num_past}", path="past"
            )
        first = windows.num_past - delays
        before: dict[str, Array] = {}
        for key in MOTIONS:
            before[key] = np.concatenate([windows.past[key][first:], windows.columns[key][None], windows.states[key]])
        for key in task.commands:
            before[key] = np.concatenate([windows.past[key][first:], windows.planned[key]])
        if self.case.physics.vessel is not None:
            instants = windows.instants(known=True, hidden=task.hidden.get(self.name))
            stepper, missed = Stepper(self.case.physics, instants), []
            for k in range(windows.horizon):
                after = np.stack([windows.states[key][k] for key in MOTIONS], axis=1)
                missed.append((after - free(self.case.physics, stepper.at(k, true_motion(windows, k)))) / windows.step)
            for axis, key in enumerate(MISSED):
                past = _missed_before(self.case.physics, instants, delays)[axis]
                before[key] = np.concatenate([past, np.stack([step[:, axis] for step in missed])])
        at = delays + steps.number
        chosen = {
            key: np.stack([values[at - ago, steps.window] for ago in range(delays, 0, -1)])
            for key, values in before.items()
        }
        return delayed(steps.at.columns, chosen, delays, task.commands)


class HankelDMD(Stepped):
    """A linear law with delays and control; it needs a past, and works with and without physics.

    Parameters
    ----------
    delays : how far back the law may look [s]; each is a trial, with every ridge, and judged by the path. `trials`
        is therefore refused.
    ridge : weight of the squared weights of normalised inputs; 8 from low to high.
    mirror, samples : as in `Stepped`; the image of every step in the mirror counts, too.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = ("ridge",)
    problem: ClassVar[type[Problem]] = HankelProblem
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

    def varied(self) -> tuple[str, ...]:
        """Return the names of the hyperparameters that differ between trials."""
        return ("delays", *self.ranges())

    def num_trials(self) -> int | None:
        """Return how many delays are tried; None where the budget decides it."""
        return None if self.budget else len(self.delays)

    def choices(self) -> dict[str, tuple[float, ...]]:
        """Return what is searched among some values: the delays."""
        return {"delays": self.delays}

    def points(self) -> list[Point]:
        """Return the trials: every delay."""
        return [{"delays": delays} for delays in self.delays]
