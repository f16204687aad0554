"""Learned force: a small bounded network inside the equations of motion, trained through multi-step rollouts.

M nu_dot = (forces of the vessel) + tau(u, v, r), tau = tau_max tanh(c h(u, v, r)), the term `hull.learned`. Its numbers
minimise the mean squared position error over the horizon plus a ridge, by L-BFGS on exact gradients of the rollout;
output weights start from a ridge regression on the forces that single true steps miss. Rackauckas et al. (2020); as the
damping of a ship: van de Ven et al. (2007).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from pydantic import PositiveFloat, PositiveInt

from shipid.data.windows import Instants
from shipid.document import LEAST_NUMBER
from shipid.hybrid.features import MOTIONS
from shipid.hybrid.method import Array, Index, Task
from shipid.hybrid.physics import Needs, Physics
from shipid.hybrid.search import LearningProblem, Point, Scale, SearchedAlone, TrialWorth, ridge_values, seed_of
from shipid.hybrid.stepping import true_steps
from shipid.hybrid.stored import StoredData
from shipid.hybrid.units import solve_ridges
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

BLOCK = "hull.learned"
SCALES = ("u_scale", "v_scale", "r_scale")
LIMITS = ("X_max", "Y_max", "N_max")
HIDDEN = ("w_u", "w_v", "w_r", "w_0")
OUTPUT = ("c_X", "c_Y", "c_N")
START_RIDGE = 1e-5
LARGEST_START = 0.95  # of the limit that a force may have at the start
LEAST_SCALE = 1e-3  # m/s and rad/s: of a motion that does not vary


@dataclass(frozen=True)
class ForceCorrector(StoredData):
    """A force added to the equations: numbers of the block `hull.learned`, name -> (units,) or (1,)."""

    block: Mapping[str, Array]
    hyperparameters: Mapping[str, float]
    past: float = 0.0

    def with_force(self, physics: Physics) -> Physics:
        """Return the physics with the learned force among its terms."""
        return with_block(physics, self.block)

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:  # noqa: ARG002
        """Return paths (T, S, 2) [m] in the frame (11) of the physics with the learned force."""
        return self.with_force(physics).paths(instants)


class ForceProblem(LearningProblem):
    """A foundation whose true steps give the first weights of its force, and whose rollouts the others."""

    def __init__(self, method: LearnedForce, task: Task, name: str) -> None:
        super().__init__(method, task, name)
        measured = replace(self.case, physics=replace(self.case.physics, observer=None))
        self.steps = true_steps(replace(task, cases={name: measured}), name)  # they start from measured states
        self.starts: dict[int, Array] = {}  # fold -> weights of the trial before

    def judge(self, number: int, point: Point) -> TrialWorth:  # noqa: ARG002
        """Return the error on the validation windows of a force that starts from that of the trial before."""
        losses, most = [], 0
        for fold, (training, validation) in enumerate(self.task.folds):
            trainer = self._trainer(training, seed_of(self.task.seed, self.name, fold))
            weights, count = trainer.solve(point["ridge"], self.starts.get(fold))
            self.starts[fold], most = weights, max(most, count)
            losses.append(trainer.error(weights, self.instants.select(validation), self.future[:, validation]))
        return float(np.mean(losses)) / 2, point, most  # per coordinate, as the other methods

    def solve(self, number: int, point: Point, windows: Index) -> ForceCorrector:  # noqa: ARG002
        """Return the force of a ridge, learned from some windows."""
        trainer = self._trainer(windows, seed_of(self.task.seed, self.name))
        weights, _ = trainer.solve(point["ridge"], None)
        return ForceCorrector(trainer.block(weights), dict(point))

    def _trainer(self, windows: Index, seed: int) -> _ForceLoss:
        """The loss on some windows: of a physics with the block, on at most `samples` of the windows."""
        generator, method, some = np.random.default_rng(seed), self.method, windows
        if len(windows) > method.samples:
            some = np.sort(generator.choice(windows, method.samples, replace=False))
        physics = self.case.physics
        columns = {motion: self.instants.columns[motion][windows] for motion in MOTIONS}
        block: dict[str, Array] = {
            scale: np.array([max(float(columns[motion].std()), LEAST_SCALE)])
            for scale, motion in zip(SCALES, MOTIONS, strict=True)
        }
        block |= force_limits(physics.ship, float(np.hypot(columns["u"], columns["v"]).max()), method.limit)
        block |= {key: generator.standard_normal(method.units) for key in HIDDEN}
        block |= {key: np.zeros(method.units) for key in OUTPUT}
        here = self.steps.of(windows)
        block = first_output_weights(block, physics, self.steps.at.select(here), self.steps.missing[here])
        return _ForceLoss(physics, block, self.instants.select(some), self.future[:, some], method.iterations)


class LearnedForce(SearchedAlone):
    """A bounded tanh network of u, v, r as a force in the equations, trained on the errors of the path.

    Parameters
    ----------
    trials : values of the ridge that are tried; with a `budget` as many of them as fit, from the stiffest on.
    units : hidden units of the network.
    ridge : weight of the mean squared output weight [m^2]; a range is searched.
    limit : bound of the force, times m U^2 / L_pp, and of the moment, times I_z (U / L_pp)^2, with U the greatest speed
        of the training windows.
    iterations : of L-BFGS, at most.
    samples : training windows that the loss is taken over, at most; more are drawn from.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = ("ridge",)
    CHAINED: ClassVar[bool] = True
    needs: ClassVar[Needs] = "equations"
    meets_none: ClassVar[bool] = False
    problem: ClassVar[type[LearningProblem]] = ForceProblem
    corrector: ClassVar[type[Any]] = ForceCorrector

    trials: PositiveInt = 3
    units: PositiveInt = 32
    ridge: Scale = (1e-5, 1e-1)
    limit: PositiveFloat = 1.0
    iterations: PositiveInt = 60
    samples: PositiveInt = 1500

    def unfit(self, vessel: Vessel) -> str:
        """Return why there is no scale of the force, no place for it or no gradient; empty where all is there."""
        if vessel.length is None:
            return "the vessel has no particulars.L_pp, which scales the learned force: give it"
        if "learned" in vessel.document.get("hull", {}):
            return f"the vessel has a learned force already: take the block {BLOCK} out"
        if drawn := vessel_dynamics(vessel).drawn:
            remedy = "take a base that extends the vessel, with `off = true` in that block"
            return f"{drawn[0].path} is a sum over drawn waves, which has no gradient: {remedy}"
        return ""

    def points(self) -> list[Point]:
        """Return the trials: from stiff to soft, for each starts from the one before."""
        return [{"ridge": ridge} for ridge in ridge_values(self.ridge, self.trials)[::-1]]


def first_output_weights(
    block: Mapping[str, Array], physics: Physics, at: Instants, missing: Array
) -> dict[str, Array]:
    """The block with output weights from the accelerations (N, 3) that single steps of the physics miss at `at`."""
    force = missing @ horizontal_mass(physics.ship).T
    weights = [block[key][:, None] for key in ("w_u", "w_v", "w_r")]
    u, v, r = (at.columns[motion] / block[scale] for motion, scale in zip(MOTIONS, SCALES, strict=True))
    along = weights[0] * u + block["w_0"][:, None]
    across = weights[1] * v + weights[2] * r
    one, other = np.tanh(along + across).T, np.tanh(along - across).T
    even, odd = (one + other) / 2 - np.tanh(block["w_0"]), (one - other) / 2
    initial = dict(block)
    for key, limit, axis, features in zip(OUTPUT, LIMITS, range(3), (even, odd, odd), strict=True):
        goal = np.arctanh(np.clip(force[:, axis] / block[limit], -LARGEST_START, LARGEST_START))
        initial[key] = solve_ridges(features, goal[:, None], START_RIDGE)[:, 0]
    return initial


def horizontal_mass(vessel: Vessel) -> Array:
    """Mass plus added mass (3, 3) [kg, kg m, kg m^2] that a force in surge, sway and yaw moves; others move freely."""
    rows = [vessel.axes.index(axis) for axis in (0, 1, 5)]
    return np.asarray(np.linalg.inv(np.linalg.inv(vessel.mass)[np.ix_(rows, rows)]))


def force_limits(vessel: Vessel, speed: float, factor: float) -> dict[str, Array]:
    """Bounds of the force: factor times m U^2 / L [N] and I_z (U / L)^2 [N m], by name."""
    assert vessel.length is not None
    inertia, length = vessel.document["inertia"], vessel.length
    force = factor * float(inertia["m"]) * max(speed, LEAST_SCALE) ** 2 / length
    moment = factor * float(inertia["I_z"]) * (max(speed, LEAST_SCALE) / length) ** 2
    return {"X_max": np.array([force]), "Y_max": np.array([force]), "N_max": np.array([moment])}


def with_block(physics: Physics, block: Mapping[str, Array]) -> Physics:
    """The physics with the block, as a vessel document holds it, whatever the size of its numbers.

    They are numbers and lists of numbers; 0 for one too near to 0 for a document.
    """
    held = {name: np.where(np.abs(values) < LEAST_NUMBER, 0.0, values) for name, values in block.items()}
    usual = {name: values.tolist() if name in (*HIDDEN, *OUTPUT) else float(values[0]) for name, values in held.items()}
    return physics.with_values({BLOCK: usual, "unusual": [*physics.ship.document.get("unusual", []), f"{BLOCK}.*"]})


class _ForceLoss:
    """Loss and slope of the weights of one network on some windows, without those that diverge at its first weights."""

    def __init__(
        self, physics: Physics, block: Mapping[str, Array], instants: Instants, future: Array, iterations: int
    ) -> None:
        self.physics = with_block(physics, block)
        lost = self.physics.variant_paths(instants)[1][0]
        sound = np.flatnonzero(~lost | lost.all())  # where all are lost, no force makes the error finite
        self.instants, self.future = instants.select(sound), future[:, sound]
        self.first, self.iterations = dict(block), iterations
        self.names = [f"{BLOCK}.{key}.{unit}" for key in (*HIDDEN, *OUTPUT) for unit in range(len(block["w_0"]))]
        paths = list(self.physics.ship.parameters)
        self.places = np.array([paths.index(name) for name in self.names])
        self.values = np.array(list(self.physics.ship.parameters.values()))
        self.start = np.concatenate([block[key] for key in (*HIDDEN, *OUTPUT)])
        self.num_hidden = len(HIDDEN) * len(block["w_0"])

    def with_weights(self, weights: Array) -> Array:
        """All numbers of the vessel with these weights, (P,)."""
        values = self.values.copy()
        values[self.places] = weights
        return values

    def solve(self, ridge: float, start: Array | None) -> tuple[Array, int]:
        """Minimise the loss from a start, by default `first_output_weights`; weights and the number of iterations."""
        from scipy.optimize import minimize  # a study is read without it

        def loss(weights: Array) -> tuple[float, Array]:
            value, slope = self.physics.gradient(self.instants, self.future, self.names, self.with_weights(weights))
            if not np.isfinite(value) or not np.isfinite(slope).all():
                return 1e12, np.zeros(len(weights))
            apart = weights - np.where(np.arange(len(weights)) < self.num_hidden, self.start, 0.0)
            return value + ridge * float((apart**2).mean()), slope + 2 * ridge * apart / len(weights)

        optimum = minimize(
            loss,
            self.start if start is None else start,
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": self.iterations},
        )
        return np.asarray(optimum.x), int(optimum.nit)

    def error(self, weights: Array, instants: Instants, future: Array) -> float:
        """Mean squared position error [m^2] on other windows."""
        paths = self.physics.variant_paths(instants, self.with_weights(weights)[None])[0][:, 0]
        return float(np.square(paths - future).sum(axis=-1).mean())

    def block(self, weights: Array) -> dict[str, Array]:
        """The block with these weights."""
        parts: Sequence[Array] = np.split(weights, len(HIDDEN) + len(OUTPUT))
        return self.first | dict(zip((*HIDDEN, *OUTPUT), parts, strict=True))
