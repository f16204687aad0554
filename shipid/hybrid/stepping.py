"""Velocities one step at a time: what a step of the physics misses, and paths on which something is added to each step.

After a step the velocities are those of the physics plus step x a, with a the missing acceleration. By `rk4`, heading
and position move as it says, plus step^2 / 2 x a; by `euler`, which errs there by half a step, and without a vessel
they are the trapezoid of the velocities. Steps start from measured states: physics with an observer are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from pydantic import PositiveInt

from shipid.data.windows import Instants, Windows, from_frame
from shipid.engine.engines import AUTO, REPEATED
from shipid.errors import DataError
from shipid.hybrid.features import MOTIONS
from shipid.hybrid.method import Array, Index, Task
from shipid.hybrid.physics import Needs, Physics
from shipid.hybrid.search import (
    LearningProblem,
    Point,
    Scale,
    SearchedAlone,
    TrialWorth,
    mean_squared_error,
    ridge_values,
    seed_of,
)
from shipid.physics.signals import measurable_signals

Acceleration = Callable[[Instants, Array], Array]
MISSED_NAMES = ("missed.u", "missed.v", "missed.r")
STEPWISE_FROM = 2000  # steps of paths, asked for one by one: below it compiling C costs more than it saves
VELOCITY_LIMIT = 100.0  # m/s and rad/s: no ship, so the path has diverged


class Stepper:
    """The physics in single steps from S instants; DataError for physics with an observer."""

    def __init__(self, physics: Physics, instants: Instants) -> None:
        if physics.observer is not None:
            raise DataError("steps start from measured states: physics with an observer cannot be corrected by step")
        self.instants = instants
        kept = {"psi", *measurable_signals(instants.columns)}  # what a step needs beside u, v, r and the commands
        self.columns = {name: values for name, values in instants.columns.items() if name in kept or "." in name}
        self.reached = physics.reached(instants)

    def at(self, k: int | Index, motion: Mapping[str, Array], window: Index | slice = slice(None)) -> Instants:
        """What holds at the start of step k = 0..T-1, given u, v, r and psi (S,) then; k may be (S,)."""
        columns = {name: values[window] for name, values in self.columns.items()}
        columns |= {name: values[k, window] for name, values in (self.instants.planned or {}).items()}
        hidden = {name: values[k, window] for name, values in self.reached.items()}
        return Instants({**columns, **motion}, hidden=hidden or None)


def step_alone(physics: Physics, at: Instants) -> Array:
    """Velocities u, v, r (S, 3) that the physics alone says after one step from `at`."""
    return _step_and_way(physics, at)[0]


def _step_and_way(physics: Physics, at: Instants) -> tuple[Array, Array | None]:
    """Velocities (S, 3) after a step, and how far it moves along, across and in heading (S, 3); None: not known."""
    if physics.absent:
        return np.stack([at.columns[name] for name in MOTIONS], axis=1), None
    engine = REPEATED if len(at) * physics.horizon > STEPWISE_FROM else AUTO
    states = replace(physics, horizon=1).states(at, engine=engine)
    after = np.stack([states[name][0] for name in MOTIONS], axis=1)
    if physics.integrator == "euler":
        return after, None
    return after, np.stack([states["x"][0], states["y"][0], states["psi"][0] - at.columns["psi"]], axis=1)


def stepped_paths(
    physics: Physics, instants: Instants, acceleration: Acceleration, past: Mapping[str, Array] | None = None
) -> Array:
    """Paths (T, S, 2) [m] in the frame (11) on which `acceleration` is added to each step of the physics.

    acceleration : (start of the step, velocities (S, 3) after it by the physics alone) -> missing acceleration (S, 3)
        [m/s^2, rad/s^2].
    past : rows (P, S) before the first step that a start holds, of columns and `MISSED_NAMES`; they move on by a row.
    """
    step, stepper = physics.step, Stepper(physics, instants)

    def advance(at: Instants, first: Array, place: Array) -> dict[str, Array]:
        nu, psi = np.stack([at.columns[name] for name in MOTIONS], axis=1), at.columns["psi"]
        alone, way = _step_and_way(physics, at)
        more = acceleration(at, alone)
        after = alone + step * more
        after = np.where((np.abs(after) <= VELOCITY_LIMIT).all(axis=1).reshape(-1, 1), after, np.nan)
        if way is None:
            psi_after = psi + step / 2 * (nu[:, 2] + after[:, 2])
            moved = _rotate_velocity(nu, psi - first) + _rotate_velocity(after, psi_after - first)
            place = place + step / 2 * moved
        else:
            way = np.where(np.abs(after) < np.inf, way + step**2 / 2 * more, np.nan)
            psi_after = psi + way[:, 2]
            place = place + _rotate_velocity(way, psi - first)
        motion = {name: after[:, axis] for axis, name in enumerate(MOTIONS)}
        missed = {name: more[:, axis] for axis, name in enumerate(MISSED_NAMES)}
        return {**motion, "psi": psi_after, "place": place, **missed}

    one, first, places, rows = physics.call_once(advance), instants.columns["psi"], [], dict(past or {})
    now = {name: instants.columns[name] for name in (*MOTIONS, "psi")} | {"place": np.zeros((len(instants), 2))}
    with np.errstate(all="ignore"):  # a diverged path is not finite, and no news to the caller
        for k in range(physics.horizon):
            at = replace(stepper.at(k, {name: now[name] for name in (*MOTIONS, "psi")}), past=rows)
            now = one(at, first, now["place"])
            places.append(now["place"])
            held = {**now, **at.columns}
            rows = {name: np.concatenate([values[1:], np.stack([held[name]])]) for name, values in rows.items()}
    return np.stack(places)


def _rotate_velocity(nu: Array, angle: Array) -> Array:
    """Velocity over ground (S, 2) in axes from which the ship has turned by an angle (S,)."""
    return np.stack(from_frame(nu[:, 0], nu[:, 1], 0.0, 0.0, angle), axis=1)


@dataclass(frozen=True)
class TrueSteps:
    """Steps of the true motion, each moment of a run once.

    at : what held at the start of N steps, with the commands in force.
    free, after : velocities (N, 3) after the step by the physics alone, and the true ones.
    window : index of the window that each step was taken from, (N,).
    number : how far into its horizon the step lies, 0..T-1, (N,).
    """

    at: Instants
    free: Array
    after: Array
    window: Index
    number: Index
    step: float

    @property
    def missing(self) -> Array:
        """Acceleration (N, 3) [m/s^2, rad/s^2] that the physics misses."""
        return (self.after - self.free) / self.step

    def of(self, windows: Index) -> Index:
        """Indices of the steps that were taken from these windows."""
        return np.flatnonzero(np.isin(self.window, windows))


def true_steps(task: Task, name: str) -> TrueSteps:
    """Steps of the true motion over the windows of a task; DataError where they hold no true states.

    A moment that several windows of a run hold is taken where it is nearest to the instant: the wind is fresh there.
    """
    windows, physics = task.windows, task.cases[name].physics
    if not windows.states:
        raise DataError("the method learns from the true velocities over the horizon: these windows hold none")
    stepper = Stepper(physics, windows.instants(known=True, hidden=task.hidden.get(name)))
    number, window = np.divmod(_first_of_each_moment(task), len(windows))
    at = stepper.at(number, {key: values[number, window] for key, values in true_motion(windows).items()}, window)
    after = np.stack([windows.states[key][number, window] for key in MOTIONS], axis=1)
    return TrueSteps(at, step_alone(physics, at), after, window, number, physics.step)


def true_motion(windows: Windows) -> dict[str, Array]:
    """True u, v, r [m/s, rad/s] and psi [rad] after 0..T steps of each window, (T + 1, S)."""
    return {key: np.concatenate([windows.columns[key][None], windows.states[key]]) for key in (*MOTIONS, "psi")}


def _first_of_each_moment(task: Task) -> Index:
    """Indices into (T, S), flattened, of steps such that no moment of a run comes twice."""
    windows = task.windows
    runs = np.unique(windows.run, return_inverse=True)[1]
    t = windows.t + windows.step * np.arange(windows.horizon)[:, None]
    moments = np.stack([np.broadcast_to(runs, t.shape).ravel(), np.round(t.ravel() / (windows.step / 1000))], axis=1)
    return np.sort(np.unique(moments, axis=0, return_index=True)[1])


class StepProblem(LearningProblem):
    """A foundation whose true steps are solved for several ridges; a trial takes the one that predicts the path best.

    `solve` must give one corrector for a point whose ridge is a list of R: it takes R S instants, in R blocks.
    """

    def __init__(self, method: StepMethod, task: Task, name: str) -> None:
        super().__init__(method, task, name)
        self.steps = true_steps(task, name)

    def judge(self, number: int, point: Point) -> TrialWorth:
        """Return the least error over the ridges, on `samples` of the validation windows of each fold at most."""
        method, task, errors = self.method, self.task, np.zeros(())
        ridges = ridge_values(method.ridge, method.RIDGES)
        for fold, (training, judged) in enumerate(task.folds):
            corrector = self.solve(number, {**point, "ridge": ridges}, training)
            if len(judged) > method.samples:
                generator = np.random.default_rng(seed_of(task.seed, fold))
                judged = np.sort(generator.choice(judged, method.samples, replace=False))
            instants = self.instants.select(np.tile(judged, len(ridges)))
            paths = np.split(corrector.predict(self.case.physics, instants, np.empty(0)), len(ridges), axis=1)
            errors = errors + [mean_squared_error(path, self.future[:, judged]) for path in paths]
        best = int(errors.argmin())
        return float(errors[best]) / len(task.folds), {**point, "ridge": ridges[best]}, 0


class StepMethod(SearchedAlone):
    """A method that adds to each step: a trial is solved on true steps for several ridges, and judged by the path.

    RIDGES : how many ridges are solved where `ridge` is a range.

    Parameters
    ----------
    ridge : weight of the squared weights of the solution; of a range, from low to high, each trial takes the best.
    mirror : whether port and starboard are mirror images, where the inputs allow it.
    samples : validation windows that a trial is judged on, at most.
    """

    RIDGES: ClassVar[int] = 8
    IDLE: ClassVar[frozenset[str]] = frozenset({"ridge"})
    needs: ClassVar[Needs] = "steps"
    meets_observer: ClassVar[bool] = False

    ridge: Scale
    mirror: bool = True
    samples: PositiveInt = 300
