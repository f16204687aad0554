"""Regression: accelerations by least squares on motion, orders and wind in one steady current, rolled over the horizon.

a = W t(u, v, r, orders, u_rw, v_rw), with t the products of velocities through the water, also with magnitudes, and of
orders as they act; W is a ridge regression on means over true steps. Velocities stay near those of training, so that no
path diverges. It is the simplest rival of physics (system identification by least squares, Ljung 1999, section 4.2).
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, product
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt
from scipy.optimize import least_squares

from shipid.data.windows import Instants, choose_evenly
from shipid.hybrid.features import MOTIONS, feature_table
from shipid.hybrid.method import Array, FitResult, Index, Method, Task, Traits
from shipid.hybrid.physics import Physics
from shipid.hybrid.search import best_trials, trial_row, windows_of_folds
from shipid.hybrid.stepping import Stepper, step_alone, stepped_paths, true_motion
from shipid.hybrid.stored import StoredData
from shipid.hybrid.units import VaryingInputs, apply_blocks, solve_ridges
from shipid.physics.signals import is_steering

MARGIN = 0.25  # of the range of a velocity in training, by which a path may leave it
MOST_FOLDS, JUDGED = 5, 40  # runs that are left out, and windows of each on which laws are judged
LEARNED, OF_CURRENT = 100, 30  # windows at most, one after the other, that give the steps of a law, and of a current
MIRROR = np.array([1.0, -1.0, -1.0])


def law_terms(table: Mapping[str, Any], names: Sequence[str]) -> list[Any]:
    """Terms (S,) of the law, of which the first is 1; also of symbols.

    table : u, v, r through the water and every other input. names : inputs that vary; orders have a dot.
    """
    u, orders = table["u"], [name for name in names if "." in name]
    thrusts = [name for name in orders if not is_steering(name)]
    terms = [1.0 + 0.0 * u]
    for held in ([n for n in names if n in MOTIONS], [n for n in names if n not in {*MOTIONS, *orders}]):
        values = [table[name] for name in held]
        terms += values + [a * b for a, b in combinations_with_replacement(values, 2)]
        terms += [a * abs(b) for a, b in product(values, values)]
    for name in orders:
        value = np.sin(table[name]) if is_steering(name) else table[name]
        terms += [value, value * u, value * (abs(u) * u if is_steering(name) else abs(value))]
        if is_steering(name):
            mine = [one for one in thrusts if one.partition(".")[0] == name.partition(".")[0]]
            pulls = [table[one] * abs(table[one]) for one in mine or thrusts]
            terms += [pull * side for pull in pulls for side in (value, np.cos(table[name]))]
    return terms


def water_velocity(current: Array, psi: Array) -> Array:
    """Velocity (S, 3) of the water, current (S, 2) north and east [m/s], in axes of the ship at headings (S,)."""
    c, s = np.cos(psi), np.sin(psi)
    north, east = current.T
    return np.stack([c * north + s * east, c * east - s * north, np.zeros_like(c)], axis=1)


@dataclass(frozen=True)
class RegressionCorrector(StoredData):
    """Laws of acceleration, rolled over the horizon: R of them for instants in R blocks, of a fitted method one.

    names : inputs of the terms. weights : (R, M, 3). current : (R, 2) north and east [m/s].
    low, high : least and greatest u, v, r through the water, (3,).
    """

    commands: tuple[str, ...]
    names: tuple[str, ...]
    weights: Array
    current: Array
    low: Array
    high: Array
    hyperparameters: Mapping[str, float]
    past: float = 0.0

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:  # noqa: ARG002
        """Return paths (T, S, 2) [m] in the frame (11)."""
        current, step = np.repeat(self.current, len(instants) // len(self.current), axis=0), physics.step

        def acceleration(at: Instants, _: int, alone: Array) -> Array:
            psi, table = at.columns["psi"], feature_table(at.columns, self.commands)
            water = water_velocity(current, psi)
            through = table | dict(zip("uv", (np.stack([table["u"], table["v"]]) - water.T[:2]), strict=True))
            more = apply_blocks(np.stack(law_terms(through, self.names), axis=1), self.weights)
            after = np.clip(alone - water + step * more, self.low, self.high)
            later = psi + step / 2 * (table["r"] + after[:, 2])
            return np.asarray((after + water_velocity(current, later) - alone) / step)

        return stepped_paths(physics, instants, acceleration)


def successive_windows(task: Task) -> Index:
    """Places of windows that follow one another, `LEARNED` at most: they hold every moment, hardly any twice."""
    windows, known = task.windows, windows_of_folds(task)
    run, number = windows.run[known], np.floor(windows.t[known] / (windows.horizon * windows.step) + 1e-9)
    turns = np.r_[True, (number[1:] != number[:-1]) | (run[1:] != run[:-1]), True]
    return choose_evenly(known[turns[:-1] | turns[1:]], LEARNED)


def ridge_laws(terms: Array, missing: Array, ridges: Sequence[float]) -> Array:
    """Weights (R, M, 3) of terms (N, M) for accelerations (N, 3), for each ridge; both count by their size."""
    scale = np.maximum(np.sqrt(np.square(terms).mean(axis=0)), 1e-12)
    size = np.maximum(np.sqrt(np.square(missing).mean(axis=0)), 1e-12)
    return np.asarray(solve_ridges(terms / scale, missing / size, ridges) / scale[:, None] * size)


class RegressionProblem:
    """A foundation of a task: its true steps, (T, S) of windows one after the other, and the laws that they teach."""

    def __init__(self, method: Regression, task: Task, name: str) -> None:
        self.method, self.task, self.physics = method, task, task.cases[name].physics
        self.windows = successive_windows(task)
        part, hidden = task.windows.select(self.windows), task.hidden.get(name)
        stepper = Stepper(self.physics, task.windows.instants(known=True, hidden=hidden).select(self.windows))
        self.shape, motion = (part.horizon, len(part)), true_motion(part)
        number, window = (each.ravel() for each in np.indices(self.shape))
        at = stepper.at(number, {key: values[number, window] for key, values in motion.items()}, window)
        self.table, self.psi = feature_table(at.columns, task.commands), motion["psi"]
        self.missing = np.stack([motion[key][1:].ravel() for key in MOTIONS], axis=1) - step_alone(self.physics, at)
        self.seen = VaryingInputs.of(self.table, method.mirror)

    def steps(self, windows: Index, current: Array, mean: int) -> tuple[Array, Array]:
        """Terms (N, M) and missing accelerations (N, 3) of steps of some windows, with their images in the mirror.

        windows : places in `self.windows`. current : (2,) [m/s]. mean : of so many steps after one another.
        """
        step, flat = self.task.windows.step, np.arange(np.prod(self.shape)).reshape(self.shape)[:, windows].ravel()
        now, later = (
            water_velocity(np.broadcast_to(current, (len(flat), 2)), psi[:, windows].ravel())
            for psi in (self.psi[:-1], self.psi[1:])
        )
        table = {key: values[flat] for key, values in self.table.items()}
        table |= {"u": table["u"] - now[:, 0], "v": table["v"] - now[:, 1]}
        missing = (self.missing[flat] - later + now) / step
        names, values = self.seen.normaliser.names, self.seen.samples(table)
        images = dict(zip(names, values.T, strict=True))
        terms = np.stack(law_terms({"u": np.resize(table["u"], len(values))} | images, names), axis=1)
        missing = np.concatenate([missing, missing * MIRROR])[: len(values)]
        return tuple(self._means(each, len(windows), mean) for each in (terms, missing))  # type: ignore[return-value]

    def _means(self, values: Array, windows: int, mean: int) -> Array:
        """Means over `mean` steps after one another, of values (K T S, n) with their images or without."""
        by_step = values.reshape(-1, self.shape[0], windows, values.shape[1])
        kept = by_step[:, : self.shape[0] // mean * mean]
        means = kept.reshape(len(kept), -1, mean, windows, values.shape[1]).mean(axis=2)
        return np.asarray(means.reshape(-1, values.shape[1]))

    def fit_current(self, windows: Index, mean: int) -> Array:
        """The steady current (2,) north and east [m/s] with which a law misses least of some windows."""
        some, ridge = choose_evenly(windows, OF_CURRENT), [float(np.median(self.method.ridge))]
        speed = float(np.hypot(self.table["u"], self.table["v"]).mean()) or 1.0
        size = np.maximum(self.steps(some, np.zeros(2), mean)[1].std(axis=0), 1e-12)

        def missed(share: Array) -> Array:
            terms, missing = self.steps(some, share * speed, mean)
            return np.append(((missing - terms @ ridge_laws(terms, missing, ridge)[0]) / size).ravel(), 0.1 * share)

        return np.asarray(least_squares(missed, np.zeros(2), bounds=(-1.0, 1.0), max_nfev=12).x * speed)

    def laws(self, several: Sequence[Index]) -> tuple[Array, Array]:
        """Weights (F, R, M, 3) of every point of the search, learned from each of F sets of windows; currents (R, 2).

        The current is that of all windows.
        """
        every, weights, currents, ridges = np.arange(len(self.windows)), [], [], self.method.ridge
        places = [np.isin(self.windows, windows) for windows in several]
        settings = self.method.settings(self.physics.vessel is None)
        steady = (
            self.fit_current(every, max(self.method.steps)) if any(drifts for _, drifts in settings) else np.zeros(2)
        )
        for mean, drifts in settings:
            current = drifts * steady
            terms, missing = self.steps(every, current, mean)
            rows = [np.resize(place, len(terms)) for place in places]
            weights.append([ridge_laws(terms[row], missing[row], ridges) for row in rows])
            currents += [current] * len(ridges)
        return np.concatenate(weights, axis=1), np.array(currents)

    def corrector(self, weights: Array, current: Array, params: Mapping[str, float]) -> RegressionCorrector:
        """The corrector of some laws; a path may leave the velocities of training by a margin and the current."""
        motion = np.stack([self.table[name] for name in MOTIONS], axis=1)
        both = np.concatenate([motion, motion * MIRROR]) if self.seen.reflection is not None else motion
        low, high = both.min(axis=0), both.max(axis=0)
        wide = MARGIN * (high - low) + np.append(np.full(2, np.abs(current).max()), 0.0)
        return RegressionCorrector(
            self.task.commands, self.seen.normaliser.names, weights, current, low - wide, high + wide, params
        )


class Regression(Method):
    """Least squares on accelerations, rolled over the horizon; what runs left out say best is learned from all.

    Parameters
    ----------
    ridge : weights of the squared weights of terms of size 1. steps : numbers of steps over whose mean it learns.
    mirror : whether port and starboard are mirror images, where the inputs allow it.
    """

    validation: ClassVar[str] = "runs"
    meets_observer: ClassVar[bool] = False
    corrector: ClassVar[type[Any]] = RegressionCorrector

    ridge: Annotated[tuple[PositiveFloat, ...], Field(min_length=1)] = (1e-6, 1e-4, 1e-3, 1e-2)
    steps: Annotated[tuple[PositiveInt, ...], Field(min_length=1)] = (1, 5)
    mirror: bool = True

    @property
    def traits(self) -> Traits:
        """What a study says of this method."""
        return Traits(mirror=self.mirror)

    def varied(self) -> tuple[str, ...]:
        """Names of what differs between trials."""
        return "steps", "current", "ridge"

    def settings(self, alone: bool) -> list[tuple[int, bool]]:
        """Numbers of steps, each without a current and, if there is no physics, which has its own, with one."""
        return list(product(self.steps, (False, True)[: 1 + alone]))

    def fit(self, task: Task) -> dict[str, FitResult]:
        """Learn every foundation; where its physics is not finite on windows of a fold, all trials diverged."""
        return {name: self._fit(task, name) for name in task.cases}

    def _fit(self, task: Task, name: str) -> FitResult:
        begun, case = time.process_time(), task.cases[name]
        settings = self.settings(case.physics.vessel is None)
        points = [
            {"steps": float(mean), "current": float(drifts), "ridge": ridge}
            for (mean, drifts), ridge in product(settings, self.ridge)
        ]
        if not np.isfinite(case.paths[:, windows_of_folds(task)]).all():
            return FitResult(None, [trial_row(i, point, np.nan, begun) for i, point in enumerate(points)], 0.0)
        problem, folds = RegressionProblem(self, task, name), task.folds[:: -(-len(task.folds) // MOST_FOLDS)]
        weights, currents = problem.laws([*(training for training, _ in folds), windows_of_folds(task)])
        judged = [part[np.linspace(0, len(part) - 1, JUDGED).round().astype(int)] for _, part in folds]
        every = np.concatenate([np.tile(part, len(points)) for part in judged])
        left_out = problem.corrector(np.concatenate(weights[:-1]), np.tile(currents, (len(folds), 1)), {})
        paths = left_out.predict(case.physics, task.instants(name).select(every), np.empty(0))
        missed = np.square(paths - task.windows.future[:, every]).mean(axis=(0, 2))
        losses = missed.reshape(len(folds), len(points), -1).mean(axis=(0, 2))
        rows = [trial_row(i, point, float(losses[i]), begun) for i, point in enumerate(points)]
        chosen = [row["number"] for row in best_trials(rows)[:1]]
        best = problem.corrector(weights[-1][chosen], currents[chosen], points[chosen[0]]) if chosen else None
        return FitResult(best, rows, time.process_time() - begun)
