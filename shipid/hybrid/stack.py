"""Means of predictions by errors on runs left out: `stack` is that of `kernel` and a `regression` without physics.

Errors of predictions that differ cancel in part (Bates and Granger 1969, Breiman 1996: stacked regressions). With few
runs a law of accelerations in a steady current errs by less than a kernel, with many runs by more.
"""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from shipid.data.windows import Instants, run_folds
from shipid.errors import DataError
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.kernel_compensator import KernelCompensator
from shipid.hybrid.method import Array, Case, FitResult, Method, Task, Traits
from shipid.hybrid.physics import Physics
from shipid.hybrid.regression import MOST_FOLDS, Regression, RegressionCorrector
from shipid.hybrid.search import trial_row, windows_of_folds

SUM = 1e4  # weight, of the size of the errors, with which weights are held to the sum 1


@dataclass(frozen=True)
class StackCompensator(KernelCompensator):
    """A compensator, and the share that the path of a law has in its prediction.

    law : None where the runs do not suffice for one.
    """

    law: RegressionCorrector | None = None
    share: float = 0.0

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:
        """Return paths (T, S, 2) [m] in the frame (11)."""
        path = super().predict(physics, instants, paths)
        if self.law is None:
            return path
        return path + self.share * (self.law.predict(physics.absence, instants, paths) - path)


class Stack(Method):
    """The mean of `kernel` and of a `regression` without physics, weighed by their errors on runs left out.

    Parameters
    ----------
    kernel : settings of `kernel`.
    """

    validation: ClassVar[str] = "runs"
    corrector: ClassVar[type[Any]] = StackCompensator

    kernel: Kernel = Kernel()

    @property
    def traits(self) -> Traits:
        """What a study compares this method by: that of the kernel."""
        return self.kernel.traits

    def varied(self) -> tuple[str, ...]:
        """Names of what the kernel chooses, and the share of the law."""
        return (*self.kernel.varied(), "law")

    def fit(self, task: Task) -> dict[str, FitResult]:
        """Fit every foundation; the law is the same for all."""
        begun, windows, every = time.process_time(), task.windows, windows_of_folds(task)
        name, case = next(iter(task.cases.items()))
        case, law = Case(case.physics.absence, np.zeros_like(windows.future)), FitResult(None, [], 0.0)
        with suppress(DataError):  # runs that do not suffice
            folds = run_folds(windows.select(every), "share", task.seed, MOST_FOLDS)
            folds = [(every[training], every[judged]) for training, judged in folds]
            without = Task({name: case}, windows, folds, task.commands, task.known)
            law = Regression().fit_one(without, name, left_out=True)
        seconds = (time.process_time() - begun) / len(task.cases)
        fitted = self.kernel.fit(replace(task, journal=None))
        for name, one in fitted.items():
            if one.corrector is None:
                continue
            stack = StackCompensator(**vars(one.corrector))
            if law.left_out is None:
                fitted[name] = replace(one, corrector=stack)
                continue
            known = one.left_out is not None
            both = np.stack([law.left_out if one.left_out is None else one.left_out, law.left_out])
            weights, errors = weigh_errors(both, windows.run, by_left_out=known)
            chosen = {**stack.hyperparameters, "law": float(weights[1])}
            stack = replace(
                stack, law=cast(RegressionCorrector, law.corrector), share=chosen["law"], hyperparameters=chosen
            )
            row = trial_row(0, chosen, float(np.nanmean(np.square(errors))), begun)
            fitted[name] = FitResult(stack, [row], one.seconds + seconds, errors if known else None)
        return fitted


def sum_paths(paths: list[Array], weights: Array) -> Array:
    """Weighted sum (T, S, 2) [m] of K paths."""
    return np.asarray(np.tensordot(weights, np.stack(paths), 1))


def weigh_errors(errors: Array, run: NDArray[np.str_], *, by_left_out: bool) -> tuple[Array, Array]:
    """Weights (K,) of K foundations, and the errors (T, S, 2) [m] of their mean on runs left out.

    errors : (K, T, S, 2) [m] on runs left out, not numbers where there are none. run : (S,) of each window.

    With `by_left_out` weights are those, from 0 on and of sum 1, that leave the least squared error; errors on a run
    are by the weights that the others give. Weights are equal of one run, and where no errors are known.
    """
    count, runs = len(errors), np.unique(run)
    equal = np.full(count, 1 / count)
    if not by_left_out or len(runs) < 2:
        return equal, sum_paths([*errors], equal)
    known = np.isfinite(errors).all(axis=(0, 1, 3))
    each = [np.where(known, errors.swapaxes(2, 3), 0.0)[..., run == one].reshape(count, -1) for one in runs]
    squares = np.stack([values @ values.T / max(values.shape[1], 1) for values in each])
    left_out = np.full_like(errors[0], np.nan)
    for one, own in zip(runs, squares, strict=True):
        mine = run == one
        left_out[:, mine] = sum_paths([*errors[:, :, mine]], _least_weights(squares.sum(axis=0) - own))
    return _least_weights(squares.sum(axis=0)), left_out


def _least_weights(squares: Array) -> Array:
    """Weights (K,) from 0 on and of sum 1 with the least w' S w, S (K, K); equal where S says nothing."""
    if not squares.any():
        return np.full(len(squares), 1 / len(squares))
    values, axes = np.linalg.eigh(squares)
    size = float(np.sqrt(max(values.max(), 1e-300)))
    rows = np.sqrt(np.maximum(values, 0.0))[:, None] * axes.T / size
    weights = nnls(np.concatenate([rows, np.full((1, len(rows)), SUM)]), np.append(np.zeros(len(rows)), SUM))[0]
    return np.asarray(weights / weights.sum())
