"""Kernel ridge regression in PyTorch: the error of every run left out in closed form, its slope, and descents on it.

With G = (K + ridge)^-1 and a = G targets, what a fit without a block b misses of it is e_b = G_bb^-1 a_b, and its
weights are a - G_:b e_b (Rasmussen and Williams, 2006, section 5.4.2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize
from torch import Tensor

from shipid.hybrid.kernel import KernelCompensator, KernelMember, kernel_group, kernel_values
from shipid.hybrid.method import Array, Index, Row, Task
from shipid.hybrid.ridge import part_of_runs
from shipid.hybrid.search import PathProblem, Point, TrialWorth, windows_of_folds
from shipid.hybrid.units import VaryingInputs

PRIOR = 0.1  # weight of the squared distance from the start of a descent, in logarithms, where one run is seen
FOLDS_OF_PART = 3  # where fewer folds are left out by each trial, every trial sees all


class KernelProblem(PathProblem):
    """One foundation. Each trial leaves every `trials`-th fold out of its choice of scales.

    The errors of the runs of these folds are those of this trial alone, so that no run has a part in what predicts it.
    With few folds each trial sees all.
    """

    def __init__(self, method: Any, task: Task, name: str) -> None:
        super().__init__(method, task, name)
        self.windows = windows_of_folds(task)
        self.varying = VaryingInputs.of(self.rows(self.windows), method.mirror)
        self.values = self._tensor(self.varying.normaliser.apply(self.table))
        self.outputs = self._tensor(self.weights.T)  # (2, S, r)
        self.part = self.windows[part_of_runs(task.windows.run[self.windows], method.centres)]
        self.parts = method.trials if len(task.folds) >= FOLDS_OF_PART * method.trials else 1
        self.worth: dict[int, TrialWorth] = {}  # of each part

    def _tensor(self, values: Any) -> Tensor:
        return torch.as_tensor(values, dtype=torch.float64, device=self.task.device)

    def _eye(self, count: int) -> Tensor:
        return torch.eye(count, dtype=torch.float64, device=self.task.device)

    def kernels(self, points: Index, centres: Index, settings: Mapping[str, Any]) -> list[Tensor]:
        """Kernels (S, C) that make x and y, between windows, with the settings of a trial."""
        each = [settings[f"{kernel_group(name)}_scale"] for name in self.varying.normaliser.names]
        scales, seen = torch.stack([self._tensor(one) for one in each]), self.values[points]
        around = self.values[centres] / scales
        plain = kernel_values(seen / scales, around, settings["linear"], torch)
        if self.varying.reflection is None:
            return [plain, plain]
        mirrored = seen @ self._tensor(self.varying.reflection) / scales
        image = kernel_values(mirrored, around, settings["linear"], torch)
        return [plain + image, plain - image]

    def folds_left_out(self, number: int) -> list[tuple[Index, Index]]:
        """Folds that a trial leaves out of its choice of scales."""
        return list(self.task.folds)[number % self.parts :: self.parts]

    def judge(self, number: int, point: Point) -> TrialWorth:
        """Descend from a point; return the mean error [m^2] at the end, the settings there, and the steps made."""
        if number % self.parts in self.worth:
            return self.worth[number % self.parts]
        hidden, folds, seen = self.folds_left_out(number), self.task.folds, self.windows
        if self.parts > 1:
            folds = [fold for place, fold in enumerate(folds) if place % self.parts != number % self.parts]
            seen = np.setdiff1d(seen, np.concatenate([np.setdiff1d(seen, training) for training, _ in hidden]))
        rows = seen[part_of_runs(self.task.windows.run[seen], self.method.search_windows)]
        blocks, names = FoldBlocks(folds, rows, self.task.device), list(self.method.ranges())
        prior = PRIOR / len(np.unique(self.task.windows.run[rows]))
        start, ends = (np.log([table[name] for name in names]) for table in (point, self.method.ranges()))

        def value_and_slope(logs: Array) -> tuple[float, Array]:
            x, value = self._tensor(logs).requires_grad_(), 0.0
            settings = dict(zip(names, x.exp(), strict=True))
            for kernel, outputs in zip(self.kernels(rows, rows, settings), self.outputs[:, rows], strict=True):
                whole = kernel + settings["ridge"] * self._eye(len(rows))
                missed, slope = blocks.errors_and_slope(whole.detach(), outputs)
                value += float((missed**2).sum())
                whole.backward(slope, retain_graph=True)
            assert x.grad is not None
            away = logs - start
            return np.log(value) + prior * away @ away, x.grad.cpu().numpy() / value + 2 * prior * away

        options = {"maxfun": self.method.steps}
        best = minimize(value_and_slope, start, jac=True, method="L-BFGS-B", bounds=ends, options=options)
        values = np.clip(np.exp(best.x), *np.exp(ends).T)
        squares = np.exp(best.fun - prior * np.square(best.x - start).sum())
        chosen = dict(zip(names, map(float, values), strict=True))
        worth = float(squares) / (2 * len(self.basis) * blocks.count), chosen, int(best.nfev)
        return self.worth.setdefault(number % self.parts, worth)

    def solve(self, settings: Mapping[str, Any]) -> list[tuple[Tensor, Tensor]]:
        """G (C, C) and weights (C, r) of x and of y."""
        solved = []
        for kernel, outputs in zip(
            self.kernels(self.part, self.part, settings), self.outputs[:, self.part], strict=True
        ):
            inverse = torch.cholesky_inverse(torch.linalg.cholesky(kernel + settings["ridge"] * self._eye(len(kernel))))
            solved.append((inverse, inverse @ outputs))
        return solved

    def corrector(self, best: Sequence[Row]) -> KernelCompensator:
        """Return the mean of the solutions of all trials, and keep what they miss without each fold."""
        varying, centres, members = self.varying, self.values[self.part].cpu().numpy(), []
        self.left_out = left_out = np.full_like(self.targets, np.nan)
        for row in best if self.parts > 1 else best[:1]:
            settings = row["params"]
            scales = np.array([settings[f"{kernel_group(name)}_scale"] for name in varying.normaliser.names])
            solved = self.solve(settings)
            weights = torch.cat([weights for _, weights in solved], dim=1).cpu().numpy()
            members.append(KernelMember(scales, settings["linear"], weights))
            self._leave_out(self.folds_left_out(row["number"]), settings, solved, left_out)
        return KernelCompensator(
            self.inputs, varying.normaliser, varying.reflection, self.basis, centres, tuple(members), best[0]["params"]
        )

    def _leave_out(
        self,
        folds: Sequence[tuple[Index, Index]],
        settings: Mapping[str, Any],
        solved: list[tuple[Tensor, Tensor]],
        errors: Array,
    ) -> None:
        """Write errors (T, S, 2) [m] on the judged windows of folds, by solutions without each fold."""
        for training, judged in folds:
            out = np.flatnonzero(~np.isin(self.part, training))
            paths = []
            for kernel, (inverse, weights) in zip(self.kernels(judged, self.part, settings), solved, strict=True):
                missed = torch.linalg.solve(inverse[out][:, out], weights[out])
                paths.append((kernel @ (weights - inverse[:, out] @ missed)).cpu().numpy())
            errors[:, judged] = self.targets[:, judged] - np.tensordot(self.basis, np.stack(paths, axis=-1), (1, 1))


class FoldBlocks:
    """What folds leave out of some windows.

    out : places of the windows (F, b), filled up with 0. known : which of them are there; judged : which are judged.
    """

    def __init__(self, folds: Sequence[tuple[Index, Index]], rows: Index, device: str) -> None:
        outs = [np.flatnonzero(~np.isin(rows, training)) for training, _ in folds]
        width = max(map(len, outs))
        filled = np.stack([np.pad(out, (0, width - len(out))) for out in outs])
        known = np.arange(width) < np.array([[len(out)] for out in outs])
        judged = known & np.stack([np.isin(rows[out], fold[1]) for out, fold in zip(filled, folds, strict=True)])
        self.count = int(judged.sum())
        self.out, self.known, self.judged = (torch.as_tensor(each, device=device) for each in (filled, known, judged))

    def errors_and_slope(self, kernel: Tensor, outputs: Tensor) -> tuple[Tensor, Tensor]:
        """What a fit without each block misses of it (F, b, r), 0 where it is not judged; slope (S, S) of its square.

        kernel : (S, S) with the ridge. outputs : (S, r).
        """
        inverse = torch.cholesky_inverse(torch.linalg.cholesky(kernel))
        weights, columns = inverse @ outputs, inverse[self.out]  # (F, b, S)
        both = self.known[:, :, None] & self.known[:, None, :]
        eye = torch.eye(both.shape[1], dtype=kernel.dtype, device=kernel.device)
        blocks = torch.where(both, columns.take_along_dim(self.out[:, None, :], dim=2), eye)
        factors = torch.linalg.cholesky(blocks)
        every = torch.cholesky_solve(self.known[..., None] * weights[self.out], factors)
        missed = self.judged[..., None] * every
        left, right = ((columns.mT @ one).transpose(0, 1) for one in (torch.cholesky_solve(missed, factors), every))
        return missed, 2 * (left.flatten(1) @ right.flatten(1).T - left.sum(dim=1) @ weights.T)
