"""A search that was interrupted goes on to the digits of one that was not; a budget is a number of trials."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from shipid.hybrid import search as searches
from shipid.hybrid.journal import Journal, append_lines, open_journal
from shipid.hybrid.method import Task
from shipid.hybrid.methods import METHODS
from shipid.hybrid.physics import Physics
from shipid.hybrid.search import (
    CLOSING_TRIALS,
    TIMED_TRIALS,
    LearningProblem,
    SearchedAlone,
    SearchMethod,
    affordable_trials,
)
from shipid.hybrid.stored import StoredData
from tests.hybrid.quick import DOCUMENTED, list_documented, quick, small_world
from tests.hybrid.worlds import HORIZON, World

#: as many trials as an interruption needs; those of others follow from other settings
LONGER: dict[str, dict[str, Any]] = {
    "hankel-dmd": {"delays": (2.0, 3.0, 4.0)},
    "path-trained": {"trials": 14, "epochs": 3, "units": (4, 12)},
    DOCUMENTED: {},
}
documented = pytest.fixture(autouse=True)(list_documented)
here = pytest.fixture(scope="module")(small_world)
SEARCHING = [kind for kind, method in METHODS.items() if issubclass(method, SearchMethod)] + [DOCUMENTED]


def longer(kind: str, **settings: Any) -> Any:
    return quick(kind, **LONGER.get(kind, {"trials": 3}) | settings)


def cases_of(here: World, kind: str) -> dict[str, Physics]:
    return {"a": here.physics, **({"none": Physics(None, HORIZON, 1.0)} if METHODS[kind].meets_none else {})}


class Stopped(Exception):
    pass


def stopping(file: Path, left: int) -> Journal:
    """A journal whose process dies before the write that would take it beyond so many."""
    journal, writes = open_journal(file), count()

    def write(lines: bytes) -> None:
        if next(writes) >= left:
            raise Stopped
        append_lines(file, str, lines)

    journal.write = write
    return journal


def digits(fits: Any, here: World, kind: str) -> dict[str, Any]:
    """What a fit gave, without what a clock measured; rows as text, for files keep the order of settings too."""
    instants = here.test.instants(known=True)
    digits_of = {}
    for name, physics in cases_of(here, kind).items():
        fitted = fits[name]
        rows = [{key: value for key, value in row.items() if key != "seconds"} for row in fitted.trials]
        digits_of[name] = repr(rows), fitted.corrector.predict(physics, instants, physics.paths(instants)).tobytes()
    return digits_of


def task_in(here: World, kind: str, journal: Journal | None) -> Task:
    return replace(here.task(cases_of(here, kind), seed=2), journal=journal, cells={"a": "a+way-N0006-s2"})


CUT = [(kind, 1 + len(kind) % 2, False) for kind in SEARCHING]
RACE = {"at_once": 4, "epochs": 64}


@pytest.fixture(scope="module")
def undisturbed(here: World) -> Callable[[str, bool], dict[str, Any]]:
    """What a search gives that nothing interrupts, by kind and whether it is a race; each is made once."""

    def whole(kind: str, race: bool) -> dict[str, Any]:
        return digits(longer(kind, **RACE if race else {}).fit(task_in(here, kind, None)), here, kind)

    return cache(whole)


@pytest.mark.parametrize(
    ("kind", "after", "race"),
    [*CUT, ("path-trained", 12, False), *(("path-trained", after, True) for after in (6, 13, 14))],
)
def test_a_search_that_was_interrupted_ends_with_the_same_digits(
    kind: str, after: int, race: bool, here: World, undisturbed: Callable[[str, bool], Any], tmp_path
) -> None:
    method = longer(kind, **RACE if race else {})
    file = tmp_path / "trials.log"
    journal = stopping(file, after)
    with suppress(Stopped):  # those that write once at the end have ended
        method.fit(task_in(here, kind, journal))
    resumed = method.fit(task_in(here, kind, open_journal(file)))
    assert digits(resumed, here, kind) == undisturbed(kind, race)
    again = open_journal(file)  # and the journal holds it all, each trial once
    for name, cell in (("a", "a+way-N0006-s2"), ("none", "none")):
        if name in resumed:
            kept = again.rows(cell)
            assert [row["number"] for row in kept] == list(range(len(resumed[name].trials)))
            for row, other in zip(kept, resumed[name].trials, strict=True):
                assert {**row, "seconds": 0} == {**other, "seconds": 0}


def test_the_sampler_learns_from_the_trials_before(here: World) -> None:
    """The law above would be empty if TPE had not begun: its first ten trials are drawn at random."""
    method = longer("path-trained")
    first = method.fit(task_in(here, "path-trained", None))["a"].trials
    other = method.model_copy(update={"epochs": 6}).fit(task_in(here, "path-trained", None))["a"].trials
    params = [[row["params"]["learning_rate"] for row in rows] for rows in (first, other)]
    assert params[0][:10] == params[1][:10]
    assert params[0][11:] != params[1][11:]


@pytest.mark.parametrize("kind", ["one-step", "path-trained"])
def test_a_budget_is_a_number_of_trials_that_is_replayed(kind: str, here: World, tmp_path, monkeypatch) -> None:
    """Whatever the clock says the second time: what was decided is written down."""
    file, method = tmp_path / "trials.log", longer(kind, budget=100.0)
    monkeypatch.setattr(searches, "affordable_trials", lambda *known: 2 if known[-1] else None)
    first = method.fit(task_in(here, kind, open_journal(file)))
    assert {len(fit.trials) for fit in first.values()} == {2}
    monkeypatch.setattr(searches, "affordable_trials", lambda *_: 3)
    second = method.fit(task_in(here, kind, open_journal(file)))
    assert digits(second, here, kind) == digits(first, here, kind)
    assert open_journal(file).count("a+way-N0006-s2") == 2
    assert digits(longer(kind, trials=2).fit(task_in(here, kind, None)), here, kind) == digits(first, here, kind)


def test_a_price_is_that_of_the_trials_after_the_first() -> None:
    assert affordable_trials(10.0, 0.0, []) is None
    assert affordable_trials(10.0, 0.0, [0.5]) is None
    assert affordable_trials(10.0, 0.0, [2.0, 0.5, 0.5, 0.5]) == 20 - CLOSING_TRIALS
    assert affordable_trials(10.0, 4.0, [2.0, 0.5, 0.5, 0.5]) == 12 - CLOSING_TRIALS
    assert affordable_trials(10.0, 0.0, [6.0]) == 1  # one trial took more than half
    assert affordable_trials(10.0, 9.0, [0.1]) == 10 - CLOSING_TRIALS
    assert affordable_trials(1.0, 0.0, [0.2] * TIMED_TRIALS) == 5 - CLOSING_TRIALS
    assert affordable_trials(1e-9, 0.0, [5.0]) == 1
    assert affordable_trials(100.0, 0.0, [0.0] * TIMED_TRIALS) > 1000  # a clock that does not tick


class CountingProblem(LearningProblem):
    """What is solved from windows is a path with as many metres as there are windows and trials before."""

    def solve(self, number: int, point: Any, windows: Any) -> Any:
        return Moved(dict(point), 0.0, float(len(windows) + number))


@dataclass(frozen=True)
class Moved(StoredData):
    hyperparameters: Any
    past: float
    metres: float

    def predict(self, physics: Any, instants: Any, paths: Any) -> Any:  # noqa: ARG002
        return paths + self.metres


class CountingMethod(SearchedAlone):
    SEARCHED: ClassVar[tuple[str, ...]] = ("width",)
    problem: ClassVar[Any] = CountingProblem
    corrector: ClassVar[Any] = Moved
    trials: int = 3
    width: Any = (1.0, 4.0)


def test_a_method_of_ones_own_is_how_a_trial_is_solved(here: World) -> None:
    """It is judged on the validation windows of what the training windows gave, and solved with all of them."""
    task, (fit, *_) = here.task(), CountingMethod().fit(here.task()).values()
    ((training, validation),) = task.folds
    missed = task.targets["physics"][:, validation] - len(training)
    for number, row in enumerate(fit.trials):
        assert row["value"] == pytest.approx(np.square(missed - number).mean(), rel=1e-9)
    best = min(fit.trials, key=lambda row: row["value"])
    assert fit.corrector == Moved(best["params"], 0.0, len(training) + len(validation) + best["number"])
