"""The search of a method: its trials, which are left, how many fit into a budget, and the skeleton of most methods.

Whatever is random in a trial is seeded by its number, so a search that was interrupted goes on from its journal and
gives the digits of one that was not. A budget becomes a number of trials by the time of the first ones, written down.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import count, islice
from math import exp, log
from statistics import fmean
from typing import Annotated, Any, ClassVar, Self, TypeVar
from zlib import crc32

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt
from pydantic import model_validator as validator

from shipid.hybrid.compensator import smooth_basis
from shipid.hybrid.features import NO_MEMORY, Inputs, Memory
from shipid.hybrid.method import Array, FitResult, Index, Method, Row, Task, Traits

Probability = Annotated[float, Field(ge=0.0, le=1.0)]
Scale = PositiveFloat | tuple[PositiveFloat, PositiveFloat]
Point = Mapping[str, Any]
"""A trial: values of hyperparameters by name."""
TrialWorth = tuple[float, Point, int]
"""Mean squared validation error [m^2] per coordinate of a trial, all its settings, and its epochs."""
Any_ = TypeVar("Any_")
TIMED_TRIALS = 4  # first trials from whose time the number of all follows
CLOSING_TRIALS = 1  # trials that the last fit costs, about


class SearchMethod(Method):
    """A method that tries sets of hyperparameters and keeps the best by validation.

    SEARCHED : names of the settings that may be ranges, searched by their logarithm. LINEAR : those of them that are
        not, such as a share from 0 to 1. COUNTS : those that are whole numbers.

    Parameters
    ----------
    trials : sets of hyperparameters tried per foundation.
    budget : core-seconds [s] per foundation for the whole fit, in place of `trials`: as many trials as fit by the time
        that the first ones take, one at least.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = ()
    COUNTS: ClassVar[tuple[str, ...]] = ()
    LINEAR: ClassVar[tuple[str, ...]] = ()
    suggest: ClassVar[Any] = None

    trials: PositiveInt = 50
    budget: PositiveFloat | None = None

    @validator(mode="after")
    def _ranges_rise(self) -> Self:
        for name, (low, high) in self.ranges().items():
            if low >= high:
                raise ValueError(f"{name}: a range goes from low to high, got [{low}, {high}]")
        return self

    @property
    def traits(self) -> Traits:
        """What a study compares this method by: its settings `mirror`, `memory` and `terms`, where it has such."""
        mirror, memory, terms = (getattr(self, name, None) for name in ("mirror", "memory", "terms"))
        return Traits(
            mirror if isinstance(mirror, bool) else None,
            memory if isinstance(memory, Memory) else NO_MEMORY,
            terms if isinstance(terms, int) else None,
        )

    def inputs(self, commands: tuple[str, ...]) -> Inputs:
        """Return which quantities the method may take, given the names of the command columns."""
        return Inputs(commands, self.traits.memory)

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return what is to be searched: name -> (low, high)."""
        return {name: value for name in self.SEARCHED if isinstance(value := getattr(self, name), tuple)}

    def varied(self) -> tuple[str, ...]:
        """Return the names of the hyperparameters that differ between trials."""
        return (*self.ranges(), *self.choices()) if self.suggest is None else tuple(self.space())

    def num_trials(self) -> int | None:
        """Return how many sets of hyperparameters are tried per foundation; None where the budget decides it."""
        return None if self.budget else self.trials

    def choices(self) -> dict[str, tuple[float, ...]]:
        """Return what is searched among some values: name -> values."""
        return {}

    def space(self) -> dict[str, Any]:
        """Return where each hyperparameter that differs between trials is searched, as Optuna's distributions."""
        import optuna  # slow to import
        from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

        optuna.logging.set_verbosity(optuna.logging.WARNING)
        if self.suggest is not None:
            trial = optuna.create_study().ask()
            self.suggest(trial)
            return trial.distributions
        space: dict[str, Any] = {}
        for name, (low, high) in self.ranges().items():
            log = name not in self.LINEAR
            space[name] = (
                IntDistribution(int(low), int(high)) if name in self.COUNTS else FloatDistribution(low, high, log=log)
            )
        return space | {name: CategoricalDistribution(values) for name, values in self.choices().items()}


def spread_points(num_dims: int, num_points: int | None = None) -> Iterator[list[float]]:
    """Spread points evenly over the unit cube, any number of them, the first in the middle: an additive recurrence.

    Point k is frac(1/2 + k / phi^j) in dimension j = 1 ... d with phi^(d+1) = phi + 1 (Roberts, "The unreasonable
    effectiveness of quasirandom sequences", 2018). Without a number of points it never ends.
    """
    phi = 2.0
    for _ in range(60):  # the fixed point phi = (1 + phi)^(1 / (d + 1)) contracts by at least a half
        phi = (1.0 + phi) ** (1.0 / (num_dims + 1))
    for k in count() if num_points is None else range(num_points):
        yield [(0.5 + k / phi**j) % 1.0 for j in range(1, num_dims + 1)]


def seed_of(*entropy: int | str) -> int:
    """Draw a seed from numbers and names, the same on every machine."""
    words = [crc32(part.encode()) if isinstance(part, str) else part for part in entropy]
    return int(np.random.SeedSequence(words).generate_state(1)[0])


def affordable_trials(budget: float, before: float, seconds: Sequence[float]) -> int | None:
    """How many trials fit into a budget; None before enough have been timed, or half of the budget is gone.

    budget : core-seconds for everything. before : what the search has cost before its first trial [s].
    seconds : of the trials so far; the first one also warms up, so the others tell the price.
    """
    if not seconds or (len(seconds) < TIMED_TRIALS and before + sum(seconds) < budget / 2):
        return None
    price = max(fmean(seconds[1:] or seconds), 1e-6)
    return max(len(seconds), int((budget - before) / price) - CLOSING_TRIALS)


class Search:
    """The trials of one or several foundations that go trial by trial together.

    names : the foundations.
    again : each trial needs what the one before left behind, so nothing is taken over from an interrupted search but
        its number of trials.
    rows : foundation -> its trials so far, those of an interrupted search first.
    """

    def __init__(self, task: Task, names: Iterable[str], method: SearchMethod, *, again: bool = False) -> None:
        self.begun = time.process_time()
        self.method, self.journal = method, task.journal
        self.cells = {name: task.cells.get(name, name) for name in names}
        self.rows: dict[str, list[Row]] = {name: [] for name in self.cells}
        self.known = dict.fromkeys(self.cells, 0)  # trials that the journal holds
        self.count = method.num_trials()
        self.before: float | None = None
        self._earlier = 0.0
        if self.journal is None:
            return
        known = {name: self.journal.rows(cell) for name, cell in self.cells.items()}
        self.known = {name: len(rows) for name, rows in known.items()}
        if method.budget:
            self.count = next(filter(None, map(self.journal.count, self.cells.values())), None)
        if not again:
            done = min(self.known.values(), default=0)
            self.rows = {name: rows[:done] for name, rows in known.items()}
            self._earlier = sum(row["seconds"] for rows in self.rows.values() for row in rows)

    @property
    def done(self) -> int:
        """Number of trials that have ended for every foundation."""
        return min(map(len, self.rows.values()), default=0)

    @property
    def seconds(self) -> float:
        """Core-seconds [s] of the search so far, those of an interrupted one included, for all foundations."""
        return time.process_time() - self.begun + self._earlier

    def left(self, points: Iterable[Any_]) -> Iterator[tuple[int, Any_]]:
        """Number and point of each trial that has not been made; its rows must be recorded before the next."""
        for number, point in enumerate(points):
            if self.count is not None and number >= self.count:
                return
            if number >= self.done:
                if self.before is None:
                    self.before = time.process_time() - self.begun
                yield number, point
            if self.count is None:
                self._decide(number + 1)

    def record(self, rows: Mapping[str, Row]) -> None:
        """Keep a trial of every foundation, and write to the journal what it does not hold yet."""
        for name, row in rows.items():
            self.rows[name].append(row)
        new = {self.cells[name]: [row] for name, row in rows.items() if len(self.rows[name]) > self.known[name]}
        if self.journal is not None and new:
            self.journal.add(new)

    def _decide(self, done: int) -> None:
        """Turn the budget into a number of trials, as soon as enough are timed, and write it down."""
        assert self.method.budget is not None
        seconds = [sum(rows[k]["seconds"] for rows in self.rows.values()) for k in range(done)]
        before = time.process_time() - self.begun if self.before is None else self.before
        self.count = affordable_trials(self.method.budget * len(self.rows), before, seconds)
        if self.count is not None and self.journal is not None:
            self.journal.add({cell: [self.count] for cell in self.cells.values()})


def trial_points(method: SearchMethod, idle: frozenset[str] = frozenset({"ridge"})) -> Iterator[dict[str, float]]:
    """The trials of a method: a value of everything searched but what is `idle`, evenly spread over its range.

    They never end where a budget says how many are made. Where nothing is searched they differ in what is drawn.
    """
    ranges = {name: pair for name, pair in method.ranges().items() if name not in idle}
    fixed = {name: float(getattr(method, name)) for name in method.SEARCHED if name not in {*ranges, *idle}}
    for shares in spread_points(max(len(ranges), 1), None if method.budget else method.trials):
        point = {name: setting_at_share(method, name, share) for share, name in zip(shares, ranges, strict=False)}
        yield {**fixed, **point}


def suggested_points(
    method: SearchMethod, search: Search, seed: int, at_once: int = 1
) -> Iterator[dict[tuple[str, int], dict[str, Any]]]:
    """The trials (foundation, number) as Optuna's TPE chooses them, so many at a time: a round for each of its numbers.

    What `suggest` leaves out is in the middle. The trials of an interrupted search are told again; the sampler of a
    trial is seeded by its number.
    """
    import optuna  # a study is read without it

    from shipid.hybrid.trials import TRIAL_STATES

    space, studies = method.space(), {key: optuna.create_study() for key in search.rows}
    older: dict[str, Any] = (
        {} if method.suggest else {"multivariate": False, "constant_liar": at_once > 1}
    )  # the paper's defaults
    fixed = {
        name: setting_at_share(method, name, 0.5) if name in method.ranges() else getattr(method, name)
        for name in method.SEARCHED
    }
    for first in count(0, at_once):
        trials: dict[tuple[str, int], optuna.Trial] = {}
        for number in range(first, min(first + at_once, search.count or first + at_once)):
            for key, study in studies.items():
                study.sampler = optuna.samplers.TPESampler(**older, seed=seed_of(seed, key, number))
                if number < len(search.rows[key]):
                    study.enqueue_trial(search.rows[key][number]["params"])
                trials[key, number] = study.ask(None if method.suggest else space)
                if method.suggest:
                    method.suggest(trials[key, number])
        asked = {one: fixed | trial.params for one, trial in trials.items()}
        yield from [asked] * at_once
        for (key, number), trial in trials.items():
            row = search.rows[key][number]
            if row["state"] == "stopped":
                trial.report(row["value"], row["epochs"])
            value = row["value"] if row["state"] == "complete" else None
            studies[key].tell(trial, value, TRIAL_STATES[row["state"]])


def setting_at_share(method: SearchMethod, name: str, share: float) -> float:
    """The value of a searched setting at a share of its range; inside the range, whatever the rounding."""
    low, high = method.ranges()[name]
    linear = name in method.LINEAR
    value = low + share * (high - low) if linear else exp(log(low) + share * (log(high) - log(low)))
    return min(max(round(value) if name in method.COUNTS else value, low), high)


def ridge_values(ridge: float | tuple[float, float], count: int) -> list[float]:
    """Ridges that every trial is solved with, evenly spread by their logarithm."""
    return [float(r) for r in np.geomspace(*ridge, count)] if isinstance(ridge, tuple) else [float(ridge)]


def diverged_result(method: SearchMethod, points: Iterable[Mapping[str, float]]) -> FitResult:
    """The result where the physics is not finite: no corrector, every trial diverged."""
    start, some = time.process_time(), islice(points, 1 if method.budget else None)
    return FitResult(None, [trial_row(i, point, np.nan, start) for i, point in enumerate(some)], 0.0)


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


def mean_squared_error(paths: Array, future: Array) -> float:
    """Mean squared error [m^2] per coordinate; infinite where a path is not finite."""
    return float(np.nan_to_num(np.square(paths - future).mean(), nan=np.inf, posinf=np.inf))


class SearchProblem(ABC):
    """A foundation of a task as a method sees it: what its trials share, and how one is judged.

    left_out : as in `FitResult`, known once there is a corrector.
    """

    left_out: Array | None = None

    def __init__(self, method: Any, task: Task, name: str) -> None:
        self.method, self.task, self.name = method, task, name
        self.case, self.instants = task.cases[name], task.instants(name)
        self.future, self.targets = task.windows.future, task.targets[name]

    @abstractmethod
    def judge(self, number: int, point: Point) -> TrialWorth:
        """Return the mean error [m^2] of a trial over the folds, what it chose, and its epochs."""

    @abstractmethod
    def corrector(self, best: Sequence[Row]) -> Any:
        """Return the corrector that the best trials make, of which there are `num_chosen` at most."""


class LearningProblem(SearchProblem):
    """A problem whose trials learn from any windows that they are given."""

    @abstractmethod
    def solve(self, number: int, point: Point, windows: Index) -> Any:
        """Return the corrector of a trial, learned from these windows alone."""

    def judge(self, number: int, point: Point) -> TrialWorth:
        """Return the mean error over the folds on validation windows of what the training windows taught."""
        losses = []
        for training, validation in self.task.folds:
            corrector, instants = self.solve(number, point, training), self.instants.select(validation)
            paths = corrector.predict(self.case.physics, instants, self.case.paths[:, validation])
            losses.append(mean_squared_error(paths, self.future[:, validation]))
        return float(np.mean(losses)), point, 0

    def corrector(self, best: Sequence[Row]) -> Any:
        """Return the corrector that the best trials make, of which there are `num_chosen` at most."""
        return self.solve(best[0]["number"], best[0]["params"], windows_of_folds(self.task))


class PathProblem(SearchProblem):
    """A foundation whose errors of the path, on a basis (T, r) [m], follow from what is known at the instant.

    table : inputs (S,) by name. weights : (r, S, 2), the errors on the basis.
    """

    def __init__(self, method: Any, task: Task, name: str) -> None:
        super().__init__(method, task, name)
        self.inputs = method.inputs(task.commands)
        self.table = self.inputs.table(self.case.physics, self.instants)
        self.basis = smooth_basis(task.windows.horizon, method.terms)
        self.weights = np.tensordot(self.basis.T, self.targets, 1)

    def rows(self, windows: Index) -> dict[str, Array]:
        """Inputs of some windows."""
        return {name: values[windows] for name, values in self.table.items()}


class SearchedAlone(SearchMethod):
    """A method that searches for one foundation after the other: its formula is its `problem`.

    problem : a `SearchProblem`, or a method (task, name) that makes one.
    IDLE : settings that a trial chooses by itself, so that they differ in no point.
    CHAINED : whether a trial begins with what the one before left behind.
    """

    problem: ClassVar[Callable[[Any, Task, str], SearchProblem]]
    IDLE: ClassVar[frozenset[str]] = frozenset()
    CHAINED: ClassVar[bool] = False

    def points(self) -> Iterable[Point]:
        """Return the trials: a value of everything searched, evenly spread."""
        return trial_points(self, self.IDLE)

    def num_trials(self) -> int | None:
        """Return how many trials there are for each foundation; None where the budget decides it."""
        return None if self.budget else len(list(self.points()))

    def fit(self, task: Task) -> dict[str, FitResult]:
        """Search for every foundation; where its physics is not finite on windows of a fold, all trials diverged."""
        every, fitted = windows_of_folds(task), {}
        for name, case in task.cases.items():
            finite = np.isfinite(case.paths[:, every]).all()
            fitted[name] = self._fit(task, name) if finite else diverged_result(self, self.points())
        return fitted

    def _fit(self, task: Task, name: str) -> FitResult:
        """Search for one foundation; the best trials make its corrector."""
        search, problem = Search(task, [name], self, again=self.CHAINED), type(self).problem(self, task, name)
        rounds = enumerate(suggested_points(self, search, task.seed)) if self.suggest else ()
        points = (asked.get((name, number), {}) for number, asked in rounds) if self.suggest else self.points()
        for number, point in search.left(points):
            start = time.process_time()
            value, params, epochs = problem.judge(number, point)
            search.record({name: trial_row(number, params, value, start, epochs)})
        rows = search.rows[name]
        best = best_trials(rows)[: self.num_chosen()]
        corrector = problem.corrector(best) if best else None
        return FitResult(corrector, rows, search.seconds, problem.left_out)
