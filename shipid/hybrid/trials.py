"""Trials of a method: the values that are tried, how a trial is judged, and its row in the record."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from math import ceil, exp, floor, log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipid.hybrid.method import Corrector, FitResult, Index, Row, Task
from shipid.hybrid.settings import SearchMethod, seed_of, spread_points

Array = NDArray[np.float64]


def trial_points(method: SearchMethod, idle: frozenset[str] = frozenset({"ridge"})) -> Iterator[dict[str, float]]:
    """The trials of a method: a value of everything searched but what is `idle`, evenly spread over its range.

    A setting is spread by its logarithm unless it is one of `LINEAR`; one of `COUNTS` is rounded. They never end where
    a budget says how many are made. Where nothing is searched they differ in what is drawn at random.
    """
    ranges = {name: pair for name, pair in method.ranges().items() if name not in idle}
    fixed = {name: float(getattr(method, name)) for name in method.SEARCHED if name not in {*ranges, *idle}}
    for shares in spread_points(max(len(ranges), 1), None if method.budget else method.trials):
        point = {name: setting_at_share(method, name, share) for share, name in zip(shares, ranges, strict=False)}
        yield {**fixed, **point}


def setting_at_share(method: SearchMethod, name: str, share: float) -> float:
    """The value of a searched setting at a share of its range; inside the range, whatever the rounding."""
    low, high = method.ranges()[name]
    if name in method.LINEAR:
        return low + share * (high - low)
    value = exp(log(low) + share * (log(high) - log(low)))
    return min(max(round(value), ceil(low)), floor(high)) if name in method.COUNTS else value


def ridge_values(ridge: float | tuple[float, float], count: int) -> list[float]:
    """Ridges that every trial is solved with, evenly spread by their logarithm."""
    return [float(r) for r in np.geomspace(*ridge, count)] if isinstance(ridge, tuple) else [float(ridge)]


def diverged_result(method: SearchMethod, points: Iterable[Mapping[str, float]]) -> FitResult:
    """The result where the physics is not finite: no corrector, every trial diverged."""
    blank = {"value": np.nan, "seconds": 0.0, "epochs": 0, "state": "diverged"}
    some = islice(points, 1 if method.budget else None)
    return FitResult(None, [{"number": i, "params": dict(point), **blank} for i, point in enumerate(some)], 0.0)


def fit_each(
    task: Task,
    method: SearchMethod,
    points: Callable[[], Iterable[Mapping[str, float]]],
    fit: Callable[[str], FitResult],
) -> dict[str, FitResult]:
    """Result of `fit` for every foundation of a task by name; where its physics is not finite all trials diverged."""
    fitted = {}
    for name in task.cases:
        fitted[name] = fit(name) if is_finite_physics(task, name) else diverged_result(method, points())
    return fitted


def ridge_trial(
    task: Task, name: str, ridges: Sequence[float], samples: int, solve: Callable[[Index, Sequence[float]], Corrector]
) -> tuple[float, float]:
    """The ridge with the least mean squared error [m^2] of the path per coordinate, over all folds, and that error.

    solve : (indices of training windows, R ridges) -> R correctors in one, which takes R S instants in R blocks.
    samples : validation windows of a fold that are judged, at most.
    """
    errors, physics = np.zeros(len(ridges)), task.cases[name].physics
    for fold, (training, validation) in enumerate(task.folds):
        corrector = solve(training, ridges)
        judged = draw_windows(validation, samples, seed_of(task.seed, fold))
        instants = task.instants(name).select(np.tile(judged, len(ridges)))
        paths = np.split(corrector.predict(physics, instants, np.empty(0)), len(ridges), axis=1)
        errors += [mean_squared_error(path, task.windows.future[:, judged]) for path in paths]
    best = int(errors.argmin())
    return ridges[best], float(errors[best]) / len(task.folds)


def trial_row(number: int, params: Mapping[str, float], value: float, start: float, epochs: int = 0) -> dict[str, Any]:
    """The row of a trial that began at `start` by `time.process_time`; not a number where it diverged."""
    complete = bool(np.isfinite(value))
    return {
        "number": number,
        "params": dict(params),
        "value": value if complete else np.nan,
        "seconds": time.process_time() - start,
        "epochs": epochs,
        "state": "complete" if complete else "diverged",
    }


def best_trials(rows: Iterable[Row]) -> list[Row]:
    """Trials that ended with a value, the best first; of equal ones the earlier."""
    return sorted((row for row in rows if row["state"] == "complete"), key=lambda row: float(row["value"]))


def windows_of_folds(task: Task) -> Index:
    """Indices of the windows that train or validate in any fold."""
    return np.unique(np.concatenate([part for fold in task.folds for part in fold]))


def is_finite_physics(task: Task, name: str) -> bool:
    """Whether the physics of a foundation is finite on all windows of the folds."""
    return bool(np.isfinite(task.cases[name].paths[:, windows_of_folds(task)]).all())


def draw_windows(windows: Index, most: int, seed: int) -> Index:
    """At most so many of the windows, drawn without replacement, in order."""
    if len(windows) <= most:
        return windows
    return np.sort(np.random.default_rng(seed).choice(windows, most, replace=False))


def mean_squared_error(paths: Array, future: Array) -> float:
    """Mean squared error [m^2] per coordinate; infinite where a path is not finite."""
    value = float(np.square(paths - future).mean())
    return value if np.isfinite(value) else float("inf")
