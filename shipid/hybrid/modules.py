"""Modules: bounded factors of hull, thrusters and rudders, learned from single steps, with an alarm off the data.

M nu_dot = sum over modules of f_m(u, v, r, commands) F_m + the rest, with 1 - limit <= f_m <= 1 + limit. What a module
does to a step is the difference of two steps of the physics, with and without it. f_m - 1 = w_m h is linear in a
constant and drawn hidden units h: w follows in closed form from the missing accelerations of single true steps, and is
cut at the limits. Far from the training data all factors fade to 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt

from shipid.data.windows import Instants
from shipid.errors import ResultError
from shipid.hybrid.bands import nearest_distances
from shipid.hybrid.compensator import Normaliser
from shipid.hybrid.features import feature_table
from shipid.hybrid.method import Array, Index, Task
from shipid.hybrid.physics import Needs, Physics
from shipid.hybrid.search import LearningProblem, Point, Scale, seed_of
from shipid.hybrid.stepping import StepMethod, StepProblem, step_alone, stepped_paths
from shipid.hybrid.stored import StoredData
from shipid.hybrid.units import Units, VaryingInputs, apply_blocks, solve_ridges
from shipid.physics import TERMS
from shipid.vessel.load import Vessel
from shipid.vessel.schema import term_blocks, upstream_signals

ALARM_MOMENTS = 2000  # moments from which the radius of the alarm is taken, about
MODULE_ORDER = "rudders", "thrusters", "hull"  # in which they are switched off: a rudder needs its propeller's wash


def modules_of(vessel: Vessel | None) -> dict[str, tuple[str, ...]]:
    """Module -> dotted paths of its blocks, in the order in which they are switched off; none without a vessel."""
    modules: dict[str, list[str]] = {name: [] for name in MODULE_ORDER}
    for path, key, _ in () if vessel is None else term_blocks(vessel.document):
        if key.startswith("hull."):
            modules["hull"].append(path)
        elif key.startswith("thruster."):
            rudder = key.startswith("thruster.rudder") or bool(upstream_signals(TERMS[key]))
            modules["rudders" if rudder else "thrusters"].append(path)
    return {name: tuple(paths) for name, paths in modules.items() if paths}


def physics_without_modules(physics: Physics) -> list[Physics]:
    """The physics without the first module, without the first two, ... of `modules_of`."""
    reduced: list[Physics] = []
    off: dict[str, bool] = {}
    for paths in modules_of(physics.vessel).values():
        off |= {f"{path}.off": True for path in paths}
        reduced.append(physics.with_values(off))
    return reduced


def module_accelerations(reduced: list[Physics], at: Instants, whole: Array, step: float) -> Array:
    """What each of K modules adds to the acceleration over one step, (S, K, 3); `whole` (S, 3) as of `step_alone`."""
    afters = [whole, *(step_alone(one, at) for one in reduced)]
    return np.stack([before - after for before, after in pairwise(afters)], axis=1) / step


@dataclass(frozen=True)
class Alarm(StoredData):
    """How far a moment is from the training data: the distance to the nearest of some of its moments.

    centres : (C, d) normalised inputs. radius : how far the moments of one run of training are from the other runs, at
    most; of a single run, from the centres.
    """

    normaliser: Normaliser
    centres: Array
    radius: float

    @classmethod
    def fit(cls, table: Mapping[str, Array], normaliser: Normaliser, count: int, run: NDArray[np.str_]) -> Self:
        """Choose centres, each the moment that is farthest from those before; `run` (S,)."""
        z = normaliser.apply(table)
        centres = [z[np.square(z).sum(axis=1).argmin()]]
        apart = np.linalg.norm(z - centres[0], axis=1)
        while len(centres) < min(count, len(z)) and apart.max() > 0:
            centres.append(z[apart.argmax()])
            apart = np.minimum(apart, np.linalg.norm(z - centres[-1], axis=1))
        few = np.arange(0, len(z), max(len(z) // ALARM_MOMENTS, 1))
        z, run = z[few], run[few]
        across = [
            _distance_to_centres(z[run == name], z[run != name]).max() for name in np.unique(run) if (run != name).any()
        ]
        return cls(normaliser, np.array(centres), float(max([*across, apart.max()])))

    def weight(self, table: Mapping[str, Array], fade: float) -> Array:
        """1 within the radius of a centre, falling to 0 at `fade` (in standard deviations) beyond it, (S,)."""
        z = self.normaliser.apply(table)
        weights = np.clip(1 - (self.away(z) - self.radius) / fade, 0.0, 1.0)
        return np.where(np.abs(weights) < np.inf, weights, 0.0)

    def away(self, z: Array) -> Array:
        """Distance (S,) of normalised inputs (S, d) to the nearest centre."""
        return _distance_to_centres(z, self.centres)


def _distance_to_centres(z: Array, centres: Array) -> Array:
    """Distance of each point (S, d) to the nearest of the centres (C, d), (S,)."""
    return np.asarray(np.sqrt(z.shape[1]) * nearest_distances(z, centres))


@dataclass(frozen=True)
class ModulesCorrector(StoredData):
    """Factors of the modules of the physics.

    weights : (..., K, M + 1) of the constant and the even hidden units, for each module; R in front are R corrections
        for R S inputs, in R blocks.
    limit : greatest departure of a factor from 1. fade : distance beyond the training data at which factors are 1.
    """

    commands: tuple[str, ...]
    modules: tuple[str, ...]
    units: Units
    weights: Array
    alarm: Alarm
    limit: float
    fade: float
    hyperparameters: Mapping[str, float]
    past: float = 0.0

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:  # noqa: ARG002
        """Return paths (T, S, 2) [m] in the frame (11) of the physics with these factors."""
        if tuple(modules_of(physics.vessel)) != self.modules:
            raise ResultError(f"the physics has other modules than {', '.join(self.modules)}", path="modules")
        reduced = physics_without_modules(physics)

        def acceleration(at: Instants, whole: Array) -> Array:
            extra = (self.factors(at) - 1).reshape(-1, len(reduced), 1)
            added: Array = (extra * module_accelerations(reduced, at, whole, physics.step)).sum(axis=1)
            return added

        return stepped_paths(physics, instants, acceleration)

    def factors(self, at: Instants) -> Array:
        """Factor of each module (S, K)."""
        table = feature_table(at.columns, self.commands)
        even, _ = self.units.parts(table)
        raw = apply_blocks(even, self.weights.swapaxes(-1, -2))
        weight = self.alarm.weight(table, self.fade).reshape(-1, 1)
        return 1 + weight * np.clip(raw, -self.limit, self.limit)


class ModulesProblem(StepProblem):
    """A foundation whose missing accelerations are shared among its modules."""

    def __init__(self, method: Modules, task: Task, name: str) -> None:
        super().__init__(method, task, name)
        self.modules = tuple(modules_of(self.case.physics.vessel))
        self.parts = module_accelerations(
            physics_without_modules(self.case.physics), self.steps.at, self.steps.free, self.steps.step
        )

    def solve(self, number: int, point: Point, windows: Index) -> ModulesCorrector:
        """Return factors on the steps of some windows."""
        task, method, steps, modules = self.task, self.method, self.steps, self.modules
        chosen = steps.of(windows)
        table = {key: values[chosen] for key, values in feature_table(steps.at.columns, task.commands).items()}
        table = {key: values for key, values in table.items() if not key.endswith("_rw")}  # factors are of the ship
        units = VaryingInputs.of(table, method.mirror).draw(point, method.units, seed_of(task.seed, number))
        even, _ = units.parts(table)
        missing, acting = steps.missing[chosen], self.parts[chosen]
        size = np.maximum(acting.std(axis=0).max(axis=0), 1e-12)  # of each axis
        rows = np.einsum("skj,sm->sjkm", acting / size, even).reshape(missing.size, -1)
        penalty = np.tile(np.r_[0.1, np.ones(method.units)], len(modules))
        weights = solve_ridges(rows, (missing / size).reshape(-1, 1), point["ridge"], penalty)
        weights = weights.reshape(*weights.shape[:-2], len(modules), -1)
        alarm = Alarm.fit(table, units.normaliser, method.centres, task.windows.run[steps.window[chosen]])
        return ModulesCorrector(task.commands, modules, units, weights, alarm, method.limit, method.fade, dict(point))


class Modules(StepMethod):
    """Bounded factors of hull, thrusters and rudders: a constant each, and a small network of state and commands.

    Parameters
    ----------
    trials : sets of hyperparameters tried per foundation, each with 6 ridges.
    units : drawn hidden units; 0 leaves constants alone.
    motion_scale, command_scale, offset : as in `one-step`.
    ridge : weight of the squared weights of the hidden units; the constants have a hundredth of it.
    limit : greatest departure of a factor from 1, below 1.
    centres : moments of training that the alarm keeps, at most.
    fade : distance beyond the training data, in standard deviations of the inputs, at which all factors are 1.
    mirror, samples : as in `StepMethod`.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = ("motion_scale", "command_scale", "offset", "ridge")
    RIDGES: ClassVar[int] = 6
    needs: ClassVar[Needs] = "equations"
    meets_none: ClassVar[bool] = False
    problem: ClassVar[type[LearningProblem]] = ModulesProblem
    corrector: ClassVar[type[Any]] = ModulesCorrector

    trials: PositiveInt = 6
    units: NonNegativeInt = 24
    motion_scale: Scale = (2.0, 16.0)
    command_scale: Scale = (2.0, 16.0)
    offset: Scale = (0.5, 4.0)
    ridge: Scale = (1e-6, 1.0)
    limit: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.5
    centres: PositiveInt = 256
    fade: PositiveFloat = 1.0

    def unfit(self, vessel: Vessel) -> str:
        """Return why there is no factor to learn; empty where there is."""
        lacks = "the vessel has no hull, thruster or rudder whose factor could be learned: give one"
        return "" if modules_of(vessel) else lacks
