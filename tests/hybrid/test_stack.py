"""The mean of a kernel and a law: what each counts, and what it is when a law cannot be had."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.data.windows import cut_windows, run_folds
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.method import FitResult, Task
from shipid.hybrid.regression import MOST_FOLDS, Regression
from shipid.hybrid.stack import Stack, StackCompensator
from tests.drawn import seeds
from tests.hybrid.test_regression import STEP, drawn_law, log_of, task_of

KERNEL = Kernel(trials=3, steps=4, search_windows=60, centres=120)


def task_by_law(seed: int, noise: float = 0.0, runs: int = 12) -> Task:
    """A ship that obeys a law in a current."""
    random = np.random.default_rng([seed, 88])
    log = log_of(drawn_law(random), random.uniform(-0.4, 0.4, 2), random, runs, noise=noise)
    return task_of(cut_windows(log, horizon=12, step=STEP, interval=3.0))


def fitted(task: Task) -> FitResult:
    return Stack(kernel=KERNEL).fit(task)["none"]


def paths_of(corrector: object, task: Task) -> np.ndarray:
    case = task.cases["none"]
    return corrector.predict(case.physics, task.instants("none"), case.paths)


@pytest.mark.parametrize("seed", seeds(2, 10))
def test_a_ship_that_obeys_a_law_is_left_to_it(seed: int) -> None:
    task = task_by_law(seed)
    one, alone = fitted(task), Regression().fit(task)["none"].corrector
    assert isinstance(one.corrector, StackCompensator)
    assert one.corrector.share > 0.95
    assert one.corrector.hyperparameters["law"] == one.corrector.share
    kernel = KERNEL.fit(task)["none"].corrector
    share = one.corrector.share
    expected = share * paths_of(alone, task) + (1 - share) * paths_of(kernel, task)
    np.testing.assert_allclose(paths_of(one.corrector, task), expected, atol=1e-9)


def test_a_law_that_errs_more_counts_less() -> None:
    task = task_by_law(3)
    reach = task.windows.columns["port.n"] * 20.0  # a place that no acceleration explains, and the orders do
    moved = replace(task.windows, future=task.windows.future + reach[None, :, None])
    assert fitted(replace(task, windows=moved)).corrector.share < 0.2


@pytest.mark.parametrize("seed", seeds(2, 10))
def test_errors_left_out_are_those_of_both_by_weights_of_the_other_runs(seed: int) -> None:
    task = task_by_law(seed, noise=0.5)
    folds = run_folds(task.windows, "share", task.seed, MOST_FOLDS)
    law = Regression().fit_one(replace(task, folds=folds), "none", left_out=True).left_out
    kernel, both = KERNEL.fit(task)["none"].left_out, fitted(task).left_out
    weights = []
    for run in task.windows.spans:
        mine = task.windows.run == run
        toward, done = (law - kernel)[:, mine], (both - kernel)[:, mine]
        weights.append((toward * done).sum() / np.square(toward).sum())
        np.testing.assert_allclose(done, weights[-1] * toward, atol=1e-9)
    assert -1e-9 < min(weights) < max(weights) < 1 + 1e-9


def test_the_value_of_its_trial_is_the_error_left_out() -> None:
    one = fitted(task_by_law(5, noise=0.05))
    assert one.trials[0]["value"] == pytest.approx(np.square(one.left_out).mean())
    assert set(Stack(kernel=KERNEL).varied()) - {"wind_scale"} <= set(one.trials[0]["params"])


def test_without_a_law_it_is_the_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    task = task_by_law(6)
    lacking = FitResult(None, [], 0.0)
    monkeypatch.setattr(Regression, "fit_one", lambda *_, **__: lacking)
    one, kernel = fitted(task), KERNEL.fit(task)["none"]
    np.testing.assert_array_equal(paths_of(one.corrector, task), paths_of(kernel.corrector, task))
    np.testing.assert_array_equal(one.left_out, kernel.left_out)
