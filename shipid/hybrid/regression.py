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

from shipid.data.windows import Instants, choose_evenly, to_frame
from shipid.hybrid.features import MOTIONS, feature_table
from shipid.hybrid.method import Array, FitResult, Index, Method, Task
from shipid.hybrid.physics import Needs, Physics
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
    """Terms (S,) of the law, of which the first is 1.

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
    return np.stack([*to_frame(current[:, 0], current[:, 1], 0.0, 0.0, psi), np.zeros_like(psi)], axis=1)


def through_water(table: Mapping[str, Array], water: Array) -> dict[str, Array]:
    """Inputs (S,) with u and v through water of a velocity (S, 3)."""
    return {**table, "u": table["u"] - water[:, 0], "v": table["v"] - water[:, 1]}


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

        def acceleration(at: Instants, alone: Array) -> Array:
            psi, table = at.columns["psi"], feature_table(at.columns, self.commands)
            water = water_velocity(current, psi)
            more = apply_blocks(np.stack(law_terms(through_water(table, water), self.names), axis=1), self.weights)
            after = np.clip(alone - water + step * more, self.low, self.high)
            later = psi + step / 2 * (table["r"] + after[:, 2])
            return (after + water_velocity(current, later) - alone) / step

        return stepped_paths(physics, instants, acceleration)


def successive_windows(task: Task) -> Index:
    """Places of windows that follow one another, `LEARNED` at most: they hold every moment, hardly any twice."""
    windows, known = task.windows, windows_of_folds(task)
    run, number = windows.run[known], np.floor(windows.t[known] / (windows.horizon * windows.step) + 1e-9)
    turns = np.r_[True, (number[1:] != number[:-1]) | (run[1:] != run[:-1]), True]
    return choose_evenly(known[turns[:-1] | turns[1:]], LEARNED)


def ridge_laws(terms: Array, missing: Array, ridges: Sequence[float]) -> Array:
    """Weights (R, M, 3) of terms (..., M) for accelerations (..., 3), for each ridge; both count by their size."""
    terms, missing = (each.reshape(-1, each.shape[-1]) for each in (terms, missing))
    scale = np.maximum(np.sqrt(np.square(terms).mean(axis=0)), 1e-12)
    size = np.maximum(np.sqrt(np.square(missing).mean(axis=0)), 1e-12)
    return np.asarray(solve_ridges(terms / scale, missing / size, ridges) / scale[:, None] * size)


class RegressionProblem:
    """A foundation of a task: its true steps, (T, S) of windows one after the other, and the laws that they teach.

    Without physics there is a current, which is that of all windows.
    """

    def __init__(self, method: Regression, task: Task, name: str) -> None:
        self.method, self.task, self.physics = method, task, task.cases[name].physics
        self.windows = successive_windows(task)
        part, hidden = task.windows.select(self.windows), task.hidden.get(name)
        stepper = Stepper(self.physics, task.windows.instants(known=True, hidden=hidden).select(self.windows))
        self.shape, motion = (part.horizon, len(part)), true_motion(part)
        number, window = (each.ravel() for each in np.indices(self.shape))
        at = stepper.at(number, {key: values[number, window] for key, values in motion.items()}, window)
        self.table, self.psi = (
            feature_table(at.columns, task.commands),
            np.stack([motion["psi"][:-1], motion["psi"][1:]]),
        )
        self.missing = np.stack([motion[key][1:].ravel() for key in MOTIONS], axis=1) - step_alone(self.physics, at)
        self.seen = VaryingInputs.of(self.table, mirror=True)
        self.currents = [np.zeros(2), self.fit_current()] if self.physics.absent else [np.zeros(2)]

    def steps(self, current: Array) -> tuple[Array, Array]:
        """Terms (N, S, M) and missing accelerations (N, S, 3): means over steps, with their images in the mirror."""
        now, later = (water_velocity(np.broadcast_to(current, (psi.size, 2)), psi.ravel()) for psi in self.psi)
        names, through = self.seen.normaliser.names, through_water(self.table, now)
        values = self.seen.samples(through)
        table = {"u": np.resize(through["u"], len(values)), **dict(zip(names, values.T, strict=True))}
        missing = (self.missing - later + now) / self.task.windows.step
        missing = np.concatenate([missing, missing * MIRROR])[: len(values)]
        mean = min(self.method.steps, self.shape[0])
        blocks = (
            each.reshape(-1, *self.shape, each.shape[1])[:, : self.shape[0] // mean * mean]
            for each in (np.stack(law_terms(table, names), axis=1), missing)
        )
        terms, missing = (each.reshape(-1, mean, self.shape[1], each.shape[-1]).mean(axis=1) for each in blocks)
        return terms, missing

    def fit_current(self) -> Array:
        """The steady current (2,) north and east [m/s] with which a law misses least."""
        some, ridge = choose_evenly(np.arange(self.shape[1]), OF_CURRENT), [float(np.median(self.method.ridge))]
        speed = float(np.hypot(self.table["u"], self.table["v"]).mean()) or 1.0
        size = np.maximum(self.steps(np.zeros(2))[1][:, some].std(axis=(0, 1)), 1e-12)

        def missed(share: Array) -> Array:
            terms, missing = (each[:, some] for each in self.steps(share * speed))
            return np.append(((missing - terms @ ridge_laws(terms, missing, ridge)[0]) / size).ravel(), 0.1 * share)

        return np.asarray(least_squares(missed, np.zeros(2), bounds=(-1.0, 1.0), max_nfev=12).x * speed)

    def laws(self, several: Sequence[Index]) -> Array:
        """Weights (F, R, M, 3) for each current and ridge, learned from each of F sets of windows."""
        steps, ridges = [self.steps(current) for current in self.currents], self.method.ridge
        places = [np.isin(self.windows, windows) for windows in several]
        return np.stack(
            [
                np.concatenate([ridge_laws(terms[:, place], missing[:, place], ridges) for terms, missing in steps])
                for place in places
            ]
        )

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
    ridge : weights of the squared weights of terms of size 1. steps : number of steps over whose mean it learns.
    """

    validation: ClassVar[str] = "runs"
    needs: ClassVar[Needs] = "steps"
    meets_observer: ClassVar[bool] = False
    corrector: ClassVar[type[Any]] = RegressionCorrector

    ridge: Annotated[tuple[PositiveFloat, ...], Field(min_length=1)] = (1e-6, 1e-4, 1e-3, 1e-2)
    steps: PositiveInt = 5

    def varied(self) -> tuple[str, ...]:
        """Names of what differs between trials."""
        return "current", "ridge"

    def fit(self, task: Task) -> dict[str, FitResult]:
        """Learn every foundation; where its physics is not finite on windows of a fold, all trials diverged."""
        return {name: self.fit_one(task, name) for name in task.cases}

    def fit_one(self, task: Task, name: str, *, left_out: bool = False) -> FitResult:
        """Learn one foundation.

        left_out : whether errors by laws without each fold are wanted, with the current and the ridge of all runs: one
            run of two hardly tells them.
        """
        begun, case, every = time.process_time(), task.cases[name], windows_of_folds(task)
        if not np.isfinite(case.paths[:, every]).all():
            points = [{"current": 0.0, "ridge": ridge} for ridge in self.ridge]
            return FitResult(None, [trial_row(i, point, np.nan, begun) for i, point in enumerate(points)], 0.0)
        places = choose_evenly(np.arange(len(task.folds)), MOST_FOLDS)
        problem, folds = RegressionProblem(self, task, name), [task.folds[place] for place in places]
        currents = np.repeat(problem.currents, len(self.ridge), axis=0)
        points = [
            {"current": float(np.hypot(*current)), "ridge": ridge}
            for current, ridge in zip(currents, np.tile(self.ridge, len(problem.currents)).tolist(), strict=True)
        ]
        *weights, last = problem.laws([*(training for training, _ in folds), every])
        judged = [part[np.linspace(0, len(part) - 1, JUDGED).round().astype(int)] for _, part in folds]
        chosen = np.concatenate([np.tile(part, len(points)) for part in judged])
        without = problem.corrector(np.concatenate(weights), np.tile(currents, (len(folds), 1)), {})
        paths = without.predict(case.physics, task.instants(name).select(chosen), np.empty(0))
        missed = np.square(paths - task.windows.future[:, chosen]).reshape(len(paths), len(folds), len(points), -1)
        rows = [trial_row(i, point, float(missed[:, :, i].mean()), begun) for i, point in enumerate(points)]
        best = [int(row["number"]) for row in best_trials(rows)[:1]]
        whole = problem.corrector(last[best], currents[best], points[best[0]]) if best else None
        errors = None
        if best and left_out:
            fold = np.repeat(np.arange(len(folds)), [len(part) for _, part in folds])
            every, future = np.concatenate([part for _, part in folds]), task.windows.future
            laws = problem.corrector(np.stack(weights)[fold, best[0]], currents[best * len(fold)], {})
            errors = np.full_like(future, np.nan)
            errors[:, every] = future[:, every] - laws.predict(
                case.physics, task.instants(name).select(every), np.empty(0)
            )
        return FitResult(whole, rows, time.process_time() - begun, errors)
