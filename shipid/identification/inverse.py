"""Inverse dynamics: a first estimate without simulation, by least squares on the forces of the measured motion.

M nu_dot = F is multiplied by a test function phi(t) that moves along the run, and integrated by parts:

0 = integral of (phi F + phi' M nu) dt

No measured signal is differentiated, and the problem is linear in hydrodynamic derivatives and added mass. Parameters
that enter nonlinearly are detected numerically, and the fit is repeated about the present values. Noise of the
regressors biases it: an initial value.

Source of the weak form: Messenger, Bortz, Journal of Computational Physics 443 (2021) 110525, whose bumps are used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
import pandas as pd

from shipid.data.dataset import Array, Dataset, stretches_of_runs
from shipid.engine.casadi import memory_along
from shipid.errors import DataError
from shipid.identification.settings import ENVIRONMENT
from shipid.physics.signals import is_wrapped_angle
from shipid.simulation.log import body_velocities
from shipid.vessel.dynamics import Dynamics, vessel_dynamics
from shipid.vessel.load import Vessel

MEASURED = ("u", "v", "r")
LEAST_SAMPLES, LENGTHS = 8, 1.0  # a bump lasts so many samples, and so many ship lengths of way, at least
SMOOTHNESS = 3  # p of the bump (1 - s^2)^p
STRIDE = 4  # bumps begin a quarter of their length apart
ROUNDS, SETTLED, HALVINGS = 20, 1e-5, 6  # SETTLED: of the levels; factors that are not seen may wander on
RANK = 1e-8  # of the largest singular value, with columns of unit length: below it a step is left out
LOOSE = 1.0  # base values: widest prior
CHANNEL = f"{ENVIRONMENT}."


def inverse_dynamics(
    vessel: Vessel,
    dataset: Dataset,
    runs: Sequence[str],
    groups: Sequence[Sequence[str]],
    scale: Sequence[Sequence[float]],
    prior: Array,
    overrides: Mapping[str, Mapping[str, float]],
) -> tuple[Array, dict[str, float]]:
    """Factors (n,) with which the forces explain the motion of the runs, and the levels of what is left.

    groups : parameters that share each of the n factors. scale : their values at factor 1.
    prior : (n,) standard deviation of each factor about its base (1, or 0 where that is 0), at most 1.
    overrides : run -> values of `resolve_overrides`, of which those of the environment count; others are 0.

    The levels are velocity (u, v, r) -> standard deviation of the residuals of its equation [m/s^2, rad/s^2].
    Raises DataError for runs too short for one bump.
    """
    model = vessel_dynamics(vessel)
    stretches = [
        stretch
        for run, rows in stretches_of_runs(dataset)
        if run in runs and len(rows) > LEAST_SAMPLES
        for stretch in [_weighted_stretch(vessel, model, rows, overrides.get(run, {}))]
        if len(stretch.pull)
    ]
    if not stretches:
        raise DataError(f"no stretch of these runs is longer than {LEAST_SAMPLES} rows and the window", path="runs")
    centre = np.array([0.0 if vessel.parameters[group[0]] == 0 else 1.0 for group in groups])
    return _solve_weighted(_Problem(vessel, model, groups, scale, stretches), centre, np.minimum(prior, LOOSE))


def _solve_weighted(problem: _Problem, centre: Array, widths: Array) -> tuple[Array, dict[str, float]]:
    """Gauss-Newton with step halving on weighted residuals and priors: factors (n,), levels.

    Minimum-norm steps keep undetermined factors at their base.
    """
    factors, (residual, jacobian) = centre.copy(), problem.evaluate(centre)
    levels = problem.levels(residual)
    for round_ in range(ROUNDS):
        weight = np.array([1 / levels[name] for name in problem.signals])
        rows = np.vstack([jacobian * weight[:, None], np.diag(1 / widths)])
        left = np.append(residual * weight, (factors - centre) / widths)
        lengths = np.sqrt((rows**2).sum(axis=0))
        lengths = np.where(lengths > 0, lengths, 1.0)
        step = -np.linalg.lstsq(rows / lengths, left, rcond=RANK)[0] / lengths
        for _ in range(HALVINGS):
            trial = factors + step
            evaluated = problem.evaluate(trial)
            cost = float(((evaluated[0] * weight) ** 2).sum() + (((trial - centre) / widths) ** 2).sum())
            if cost <= float(left @ left):
                break
            step = step / 2
        else:
            return factors, levels  # no step lowers the cost
        factors, (residual, jacobian) = trial, evaluated
        after = problem.levels(residual)
        moved = max(abs(after[name] / levels[name] - 1) for name in levels)
        levels = after
        if round_ and moved < SETTLED:
            break
    return factors, levels


@dataclass(frozen=True)
class _Stretch:
    """One unbroken stretch of a run: inputs of the equations of motion, and quadrature weights of the test functions.

    inputs : state, memory, commands, environment, each (channels, num_points).
    nu : (num_rows, n_dof) velocities. weigh : (num_bumps, num_points) weights of the forces.
    pull : (num_bumps, num_rows) weights of nu.
    """

    inputs: tuple[Array, Array, Array, Array]
    nu: Array
    weigh: Array
    pull: Array


class _Problem:
    """Residuals of all equations and test functions, and their derivatives to the factors."""

    def __init__(
        self,
        vessel: Vessel,
        model: Dynamics,
        groups: Sequence[Sequence[str]],
        scales: Sequence[Sequence[float]],
        stretches: Sequence[_Stretch],
    ) -> None:
        self.stretches = stretches
        self.base = np.array(list(vessel.parameters.values()))
        names = list(vessel.parameters)
        self.free = [names.index(path) for group in groups for path in group]
        self.spread = np.zeros((len(self.free), len(groups)))
        row = 0
        for j, stretch in enumerate(scales):
            for size in stretch:
                self.spread[row, j] = size
                row += 1
        velocities = model.state[model.num_dof :]
        self.rows = [velocities.index(name) for name in MEASURED]
        motion = force_equations(model, tuple(self.free))
        shared = [motion.n_in() - 1]  # the parameters
        sizes = {stretch.inputs[0].shape[1] for stretch in stretches}
        by_size = {size: motion.map("equations", "serial", size, shared, []) for size in sizes}
        self.mapped = [by_size[stretch.inputs[0].shape[1]] for stretch in stretches]
        still = motion(*(np.zeros(motion.size1_in(i)) for i in range(shared[0])), self.base)
        self.inertia = np.diag(np.array(still[2]))[self.rows]
        self.signals = tuple(name for stretch in stretches for name in MEASURED for _ in stretch.weigh)

    def evaluate(self, factors: Array) -> tuple[Array, Array]:
        """Residuals (m,) [m/s^2, rad/s^2] and d residual / d factor (m, n); forces are divided by the base inertia."""
        values = self.base.copy()
        values[self.free] = self.spread @ factors
        residuals, jacobians = [], []
        for stretch, mapped in zip(self.stretches, self.mapped, strict=True):
            force, by_force, mass, by_mass = (np.array(out) for out in mapped(*stretch.inputs, values))
            dof, points = force.shape
            free = len(self.free)
            by_force = by_force.reshape(dof, points, free)
            mass, by_mass = mass[:, :dof], by_mass[:, :free].reshape(dof, dof, free, order="F")
            pulled = stretch.pull @ stretch.nu  # (bumps, dof): integral of phi' nu
            residual = stretch.weigh @ force.T + pulled @ mass.T
            slope = np.einsum("bp,dpf->bdf", stretch.weigh, by_force, optimize=True)
            slope += np.einsum("be,def->bdf", pulled, by_mass)
            residuals.append((residual[:, self.rows] / self.inertia).T.ravel())
            kept = slope[:, self.rows] / self.inertia[:, None] @ self.spread
            jacobians.append(kept.transpose(1, 0, 2).reshape(-1, self.spread.shape[1]))
        return np.concatenate(residuals), np.concatenate(jacobians)

    def levels(self, residuals: Array) -> dict[str, float]:
        """Velocity -> root mean square of the residuals (m,) of its equation, at least a small positive number."""
        labels = np.array(self.signals)
        rms = {name: float(np.sqrt((residuals[labels == name] ** 2).mean())) for name in MEASURED}
        least = 1e-12 * max(max(rms.values()), 1e-12)
        return {name: max(value, least) for name, value in rms.items()}


@lru_cache(maxsize=16)
def force_equations(model: Dynamics, free: tuple[int, ...]) -> ca.Function:
    """(state, memory, commands, environment, parameters) -> F, dF/d free, M, dM/d free.

    The accelerations are M^-1 (F + tau), so M is the inverse of their derivative to tau.
    """
    sizes = (len(model.state) + len(model.hidden), len(model.memory), len(model.commands), len(model.environment))
    inputs = [ca.SX.sym(f"in{i}", size) for i, size in enumerate(sizes)]
    parameters, dof = ca.SX.sym("parameters", len(model.parameters)), model.num_dof
    tau = ca.SX.sym("tau", dof)
    total = tau
    for term in model.sums:
        for entry in () if term.arrays is None else term.arrays:
            total = total + term.function(*inputs, parameters, entry)
    acceleration = model.rates(*inputs, parameters, total)[dof : 2 * dof]
    mass = ca.inv(ca.densify(ca.jacobian(acceleration, tau)))
    force = mass @ ca.substitute(acceleration, tau, ca.SX.zeros(dof))
    theta = ca.vertcat(*(parameters[i] for i in free))
    result = [
        force,
        ca.densify(ca.jacobian(force, theta)),
        ca.densify(mass),
        ca.densify(ca.jacobian(ca.vec(mass), theta)),
    ]
    return ca.Function("equations", [*inputs, parameters], result, {"cse": True})


def _test_function_width(vessel: Vessel, rows: pd.DataFrame) -> float:
    """Time [s] for one ship length at the run's speed, at least 8 samples, at most a quarter of the run."""
    t = rows["t"].to_numpy()
    speed = float(np.sqrt((rows["u"].to_numpy() ** 2 + rows["v"].to_numpy() ** 2).mean()))
    samples = LEAST_SAMPLES * float(np.median(np.diff(t)))
    return float(max(samples, min(LENGTHS * (vessel.length or 0.0) / max(speed, 1e-3), (t[-1] - t[0]) / 4)))


def _weighted_stretch(
    vessel: Vessel,
    model: Dynamics,
    rows: pd.DataFrame,
    overrides: Mapping[str, float],
) -> _Stretch:
    """One stretch with its weights, none if it is shorter than a test function."""
    t = rows["t"].to_numpy(dtype=float)
    columns = {str(name): rows[name].to_numpy() for name in rows.columns if name not in ("run", "t", "flags")}
    columns |= {name: np.unwrap(columns[name]) for name in columns if is_wrapped_angle(name)}
    zero = np.zeros(len(t))
    columns |= {**body_velocities(columns), "down": columns.get("z", zero)}
    state = np.array([columns.get(name, zero) for name in (*model.state, *model.hidden)])
    commands = np.array([columns[name] for name in model.commands]).reshape(-1, len(t))
    reached = memory_along(vessel, {name: columns[name] for name in model.commands}, t) or {}
    memory = np.array([reached[name] for name in model.memory]).reshape(-1, len(t))
    columns |= {path.partition(".")[2]: np.full(len(t), x) for path, x in overrides.items() if path.startswith(CHANNEL)}
    weather = np.array([columns.get(name, zero) for name in model.environment]).reshape(-1, len(t))
    before, after, pull = _test_functions(t, _test_function_width(vessel, rows))
    # an order is held until the next row, so where it changes the end of the interval is an additional point
    changed = 1 + np.flatnonzero((np.diff(commands, axis=1) != 0).any(axis=0))
    rows_at = np.append(np.arange(len(t)), changed)
    weigh = np.concatenate([before + after, before[:, changed]], axis=1)
    weigh[:, changed] -= before[:, changed]
    orders = np.concatenate([commands, commands[:, changed - 1]], axis=1)
    nu = state[model.num_dof : 2 * model.num_dof].T
    return _Stretch((state[:, rows_at], memory[:, rows_at], orders, weather[:, rows_at]), nu, weigh, pull)


def _test_functions(t: Array, window: float) -> tuple[Array, Array, Array]:
    """Quadrature weights (num_bumps, N) of the test functions at times t [s], each of integral 1.

    Of forces at the end and at the start of intervals, and of velocities. phi = c (1 - s^2)^p, s from -1 to 1 over the
    window [s]; trapezoid rule. Those of velocities are exact for velocities linear in time.
    """
    first = np.arange(t[0], t[-1] - window + 1e-9 * window, window / STRIDE)
    s = 2 * (t - first[:, None]) / window - 1
    rest = 1 - np.minimum(s**2, 1)
    dt = np.diff(t)
    part = np.append(dt, 0.0) / 2 + np.append(0.0, dt) / 2  # of each row in the trapezoid rule
    phi, pull = rest**SMOOTHNESS, -s * rest ** (SMOOTHNESS - 1) * part
    area = phi @ part
    kept = (phi > 0).sum(axis=1) >= LEAST_SAMPLES // 2
    phi, pull = phi[kept] / area[kept, None], pull[kept]
    pull = pull - pull.sum(axis=1, keepdims=True) * phi * part
    middle = (phi * part * t).sum(axis=1, keepdims=True)
    pull = -pull / (pull * (t - middle)).sum(axis=1, keepdims=True)
    return phi * np.append(0.0, dt) / 2, phi * np.append(dt, 0.0) / 2, pull
