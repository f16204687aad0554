"""What the closed form says of runs left out is what refits without them say, and no run chooses for itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import check_grad, minimize

from shipid.hybrid import kernel_ridge
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.kernel_ridge import FoldBlocks, KernelProblem
from shipid.hybrid.method import Task
from tests.hybrid.tasks import ALL, FOLDS, RUNS, TWINS, drawn_columns, missed_paths, task_of

NAMES = np.repeat([f"run-{place}" for place in range(len(RUNS))], [len(run) for run in RUNS])
SMALL = Kernel(trials=2, steps=4, terms=4)


def given(folds: list = FOLDS, targets: np.ndarray | None = None) -> Task:
    """A task of six runs."""
    columns = drawn_columns()
    task = task_of(columns, TWINS, {"one": missed_paths(columns) if targets is None else targets}, folds, 3)
    return replace(task, windows=replace(task.windows, run=NAMES))


@pytest.mark.parametrize("kind", ["runs", "more left out than judged", "one pair"])
def test_errors_without_a_block_are_those_of_a_fit_without_it(kind: str) -> None:
    rng, folds = np.random.default_rng(0), FOLDS
    if kind == "more left out than judged":  # neighbours that share a moment are in neither part
        folds = [(np.setdiff1d(ALL, np.arange(run[0] - 4, run[-1] + 3)), run[: len(run) // 2]) for run in RUNS]
    elif kind == "one pair":
        folds = [(np.arange(30, 120), np.arange(30))]
    features = rng.normal(size=(len(ALL), 200))
    kernel, outputs = features @ features.T / 200 + 0.3 * np.eye(len(ALL)), rng.normal(size=(len(ALL), 3))
    made, _ = FoldBlocks(folds, ALL).errors_and_slope(kernel[None], outputs[None])
    for (training, judged), errors in zip(folds, made[0], strict=True):
        weights = np.linalg.solve(kernel[np.ix_(training, training)], outputs[training])
        expected = outputs[judged] - kernel[np.ix_(judged, training)] @ weights
        np.testing.assert_allclose(errors[np.abs(errors).sum(axis=1) > 0], expected, atol=1e-10)


@pytest.mark.parametrize("mirror", [True, False])
def test_a_descent_goes_by_the_kernel_of_the_solution_and_by_its_slope(mirror: bool, monkeypatch: Any) -> None:
    """Its value is the error of fits with that kernel; its slope by hand is the difference."""
    method = SMALL.model_copy(update={"mirror": mirror})
    problem, blocks = KernelProblem(method, given(), "one"), FoldBlocks(FOLDS, ALL)
    assert len(problem.sides) == 1 + mirror

    def check(function: Any, start: np.ndarray, **how: Any) -> Any:
        away = start + np.linspace(-0.3, 0.4, len(start))
        assert check_grad(lambda x: function(x)[0], lambda x: function(x)[1], away) < 1e-5
        kernel = problem.kernels(ALL, ALL, point) + point["ridge"] * np.eye(len(ALL))
        missed, _ = blocks.errors_and_slope(kernel, problem.outputs[:, ALL])
        assert function(start)[0] == pytest.approx(np.log((missed**2).sum()), rel=1e-10)
        return minimize(function, start, **how)

    monkeypatch.setattr(kernel_ridge, "minimize", check)
    point = next(iter(method.points()))
    problem.descend(point)


@pytest.mark.parametrize("centres", [1000, 60])  # all windows, and a part of them
def test_errors_of_runs_left_out_are_those_of_refits(centres: int) -> None:
    """Refits with the settings of the trial that has not seen the run, on the centres of the other runs."""
    method, task = SMALL.model_copy(update={"centres": centres}), given()
    fit = method.fit(task)["one"]
    problem = KernelProblem(method, task, "one")
    assert len(problem.part) == min(centres, len(ALL))
    for number, row in enumerate(fit.trials):
        for training, judged in FOLDS[number::2]:
            rest = np.intersect1d(problem.part, training)
            made = []
            for kernel, around, outputs in zip(
                problem.kernels(rest, rest, row["params"]),
                problem.kernels(judged, rest, row["params"]),
                problem.outputs[:, rest],
                strict=True,
            ):
                gram = kernel + row["params"]["ridge"] * np.eye(len(rest))
                made.append(around @ np.linalg.solve(gram, outputs))
            paths = np.einsum("tk,cnk->tnc", problem.basis, np.stack(made))
            np.testing.assert_allclose(fit.left_out[:, judged], problem.targets[:, judged] - paths, atol=1e-8)


@pytest.mark.parametrize(("folds", "trials"), [(FOLDS, 2), (FOLDS[:4], 2), (FOLDS[:3], 3), (FOLDS[:2], 3)])
def test_no_run_has_a_part_in_the_settings_that_predict_it(folds: list, trials: int) -> None:
    """Other errors in the runs that a trial does not see: its settings stay; those of another do not."""
    method, spoilt, parts = (
        SMALL.model_copy(update={"trials": trials}),
        missed_paths(drawn_columns()),
        min(trials, len(folds)),
    )
    spoilt[:, np.concatenate(RUNS[0 : len(folds) : parts])] *= -3.0
    first, second = (method.fit(given(folds, targets))["one"] for targets in (None, spoilt))
    assert first.trials[0]["params"] == second.trials[0]["params"]
    assert len(folds) == parts == 2 or first.trials[1]["params"] != second.trials[1]["params"]
    assert np.isfinite(first.left_out[:, np.concatenate(RUNS[: len(folds)])]).all()


@pytest.mark.parametrize(("folds", "trials"), [(FOLDS[:4], 2), (FOLDS[:3], 3), (FOLDS[:1], 3), (FOLDS, 1)])
def test_with_few_folds_one_more_descent_sees_all_of_them(folds: list, trials: int) -> None:
    """A third of three runs would choose by two; without a part there are no errors left out."""
    fit, alone = (SMALL.model_copy(update={"trials": n}).fit(given(folds))["one"] for n in (trials, 1))
    assert alone.left_out is None
    parts = min(len(folds), trials)
    assert len(fit.corrector.members) == parts + (parts > 1)
    np.testing.assert_array_equal(fit.corrector.members[-1].weights, alone.corrector.members[0].weights)
    assert (fit.left_out is None) == (parts == 1)
