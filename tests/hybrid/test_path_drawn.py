"""The drawn path with a memory: company, choice by validation, and the mirror of what it takes from the past."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.data.windows import Instants, Windows, cut_windows
from shipid.errors import DocumentError
from shipid.hybrid.features import Inputs, Memory, input_group
from shipid.hybrid.method import Case, Task
from shipid.hybrid.path_drawn import MEMORIES, MEMORY_KINDS, PathDrawn
from shipid.hybrid.physics import Physics
from shipid.observer import Observer, run_observer
from shipid.study.prepare import at_instants
from shipid.vessel.load import load_vessel
from tests.hybrid.mirror import mirrored
from tests.study.test_whole import windy

Array = np.ndarray
SHIP = load_vessel("gunnerus-28.9")
EVERYTHING = Memory(history=(2.0, 4.0), turned=6.0, positions=(1.0, 5.0), error=(3.0, 6.0), observer=True)  # type: ignore[arg-type]
SMALL: dict[str, Any] = {"trials": 6, "units": 24, "terms": 3, "memory": EVERYTHING}


def physics(observer: Observer | None = None, **values: float) -> Physics:
    """The ship with other derivatives, `N_ur=-3e5`."""
    changed = {f"hull.derivatives.{name}": value for name, value in values.items()}
    return Physics(SHIP.with_values(changed), 5, 1.0, "euler", observer)


def known_at(dataset: Dataset, windows: Windows, foundation: Physics) -> dict[str, Array]:
    """What the observer of a foundation knows at the windows."""
    if foundation.vessel is None or foundation.observer is None:
        return {}
    return at_instants(dataset, windows, run_observer(foundation.vessel, dataset, foundation.observer))


def task(dataset: Dataset, foundations: dict[str, Physics], future: Array | None = None, seed: int = 3) -> Task:
    """Foundations on the windows of a dataset, every run left out in turn."""
    windows = cut_windows(dataset, horizon=5, past=6)
    if future is not None:
        windows.future[:] = future
    estimates = {name: known_at(dataset, windows, one) for name, one in foundations.items()}
    folds = [(np.flatnonzero(windows.run != run), np.flatnonzero(windows.run == run)) for run in windows.spans]
    cases = {}
    for name, one in foundations.items():
        instants = windows.instants(estimates=estimates[name])
        cases[name] = Case(one, one.paths(instants))
    return Task(cases, windows, folds, tuple(dataset.commands), seed=seed, estimates=estimates)


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    """Runs in wind that the physics of no foundation explains."""
    return windy()


def kinds(corrector: Any) -> set[str]:
    """Groups of the inputs of all networks of a compensator."""
    return {input_group(name) for network in corrector.networks for name in network.features}


def target(dataset: Dataset, foundation: Physics, group: str) -> Array:
    """A future that the physics misses by what one group of inputs says, (T, S, 2)."""
    given = task(dataset, {"one": foundation})
    table = Inputs(tuple(dataset.commands), EVERYTHING).table(foundation, given.instants("one"))
    values = next(values for name, values in table.items() if input_group(name) == group)
    steps = np.arange(1.0, 6.0)[:, None] * values / np.abs(values).max()
    future: Array = given.cases["one"].paths + np.stack([steps, 0.0 * steps], axis=-1)
    return future


@pytest.mark.parametrize("group", ["history", "error"])
def test_choose_takes_the_memory_that_validates_best(dataset: Dataset, group: str) -> None:
    """What is missed is a function of one kind of memory: the trials that take it validate best, and are taken."""
    foundation = physics(N_ur=-3e5)
    method = PathDrawn(**{**SMALL, "trials": 15, "averaged": 1, "choose": True, "mirror": 0.0, "ridge": 1e-4})
    fit = method.fit(task(dataset, {"one": foundation}, target(dataset, foundation, group)))["one"]
    assert [row["params"]["memory"] for row in fit.trials] == [float(k % len(method.memories)) for k in range(15)]
    best = min(fit.trials, key=lambda row: row["value"])
    assert fit.corrector.hyperparameters == best["params"]
    assert group in MEMORIES[int(best["params"]["memory"])]
    without = [row["value"] for row in fit.trials if group not in MEMORIES[int(row["params"]["memory"])]]
    assert best["value"] < 0.9 * min(without)
    seen = {"history", "error"}  # without an observer its estimates are no inputs
    assert kinds(fit.corrector) & seen == seen & set(MEMORIES[int(best["params"]["memory"])])


@pytest.mark.parametrize("history", [0.0, 2.0])
@pytest.mark.parametrize("error", [0.0, 2.0])
@pytest.mark.parametrize("observer", [False, True])
def test_choose_chooses_between_what_the_memory_has(history: float, error: float, observer: bool) -> None:
    """Each choice once, one of them no memory: of a memory with history alone two thirds of the trials had none."""
    memory = {"history": history, "error": error, "observer": observer}
    there = {kind for kind, value in memory.items() if value}
    if not there:
        with pytest.raises(DocumentError, match="choose: there is no memory to choose from"):
            PathDrawn(choose=True, memory=memory)
        return
    method = PathDrawn(choose=True, memory=memory, trials=20)
    taken = [frozenset(MEMORY_KINDS) - method.left_out(point) for point in method.points()]
    assert set().union(*taken) == there
    assert frozenset() in taken
    assert max(map(taken.count, taken)) - min(map(taken.count, taken)) <= 1


def test_a_mirrored_trial_with_a_memory_answers_mirrored_runs_with_mirrored_paths(dataset: Dataset) -> None:
    foundation = physics(Observer(), N_ur=-3e5)
    method = PathDrawn(**{**SMALL, "mirror": 1.0})
    corrector = method.fit(task(dataset, {"one": foundation}))["one"].corrector
    assert corrector.hyperparameters["mirror"] == 1.0
    paths = []
    for data in (dataset, mirrored(dataset)):
        given = task(data, {"one": foundation})
        instants: Instants = given.instants("one")
        paths.append(corrector.predict(foundation, instants, given.cases["one"].paths))
    np.testing.assert_allclose(paths[1], paths[0] * [1.0, -1.0], rtol=0.0, atol=1e-5)
