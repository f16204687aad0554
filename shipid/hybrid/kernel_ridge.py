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

from shipid.hybrid.kernel_compensator import GROUPS, KernelCompensator, KernelMember, kernel_group, kernel_values
from shipid.hybrid.method import Array, Index, Row, Task
from shipid.hybrid.ridge import part_of_runs
from shipid.hybrid.search import PathProblem, Point, TrialWorth, windows_of_folds
from shipid.hybrid.units import VaryingInputs

PRIOR = 0.1  # weight of the squared distance from the start of a descent, in logarithms, where one run is seen
FOLDS_OF_PART = 3  # where fewer folds are left out by each trial, what they choose is for errors left out alone


class KernelProblem(PathProblem):
    """One foundation. Each trial leaves every `parts`-th fold out of its choice of scales.

    The errors of the runs of these folds are those of this trial alone, so that no run has a part in what predicts it.
    With few folds the solution is by a descent on all of them. With one part there are no errors left out.
    """

    def __init__(self, method: Any, task: Task, name: str) -> None:
        super().__init__(method, task, name)
        self.windows = windows_of_folds(task)
        self.varying = VaryingInputs.of(self.rows(self.windows), method.mirror)
        self.scales = [f"{kernel_group(name)}_scale" for name in self.varying.normaliser.names]
        self.values = self._tensor(self.varying.normaliser.apply(self.table))
        self.outputs = self._tensor(self.weights.T)  # (2, S, r)
        self.part = self.windows[part_of_runs(task.windows.run[self.windows], method.centres)]
        self.parts = min(method.trials, len(task.folds))
        self.few = self.parts > 1 and len(task.folds) < FOLDS_OF_PART * method.trials

    def _tensor(self, values: Any) -> Tensor:
        return torch.as_tensor(values, dtype=torch.float64, device=self.task.device)

    def kernels(self, points: Index, centres: Index, settings: Mapping[str, Any]) -> list[Tensor]:
        """Kernels (S, C) that make x and y, between windows, with the settings of a trial."""
        scales, seen = torch.stack([self._tensor(settings[name]) for name in self.scales]), self.values[points]
        around = self.values[centres] / scales
        plain = kernel_values(seen / scales, around, settings["linear"], torch)
        if self.varying.reflection is None:
            return [plain, plain]
        mirrored = seen @ self._tensor(self.varying.reflection) / scales
        image = kernel_values(mirrored, around, settings["linear"], torch)
        return [plain + image, plain - image]

    def folds_left_out(self, number: int) -> list[tuple[Index, Index]]:
        """Folds that a trial leaves out of its choice of scales."""
        return list(self.task.folds)[number % self.parts :: self.parts] if self.parts > 1 else []

    def judge(self, number: int, point: Point) -> TrialWorth:
        """Descend without the folds of a trial."""
        return self.descend(point, self.folds_left_out(number))

    def descend(self, point: Point, hidden: Sequence[tuple[Index, Index]] = ()) -> TrialWorth:
        """Descend from a point by the other folds; return the mean error [m^2] there, the settings, and the steps."""
        seen, out = self.windows, {id(fold) for fold in hidden}
        for training, _ in hidden:
            seen = np.intersect1d(seen, training)
        folds = [fold for fold in self.task.folds if id(fold) not in out]
        rows = seen[part_of_runs(self.task.windows.run[seen], self.method.search_windows)]
        idle = {f"{group}_scale" for group in GROUPS} - {*self.scales}
        ranges, point = ({k: v for k, v in table.items() if k not in idle} for table in (self.method.ranges(), point))
        blocks, names = FoldBlocks(folds, rows, self.task.device), list(ranges)
        prior = PRIOR / len(np.unique(self.task.windows.run[rows]))
        start, ends = (np.log([table[name] for name in names]) for table in (point, ranges))

        def value_and_slope(logs: Array) -> tuple[float, Array]:
            x, value = self._tensor(logs).requires_grad_(), 0.0
            settings = {**point, **dict(zip(names, x.exp(), strict=True))}
            for kernel, outputs in zip(self.kernels(rows, rows, settings), self.outputs[:, rows], strict=True):
                whole = kernel + settings["ridge"] * torch.eye(len(rows)).to(kernel)
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
        chosen = {**point, **dict(zip(names, map(float, values), strict=True))}
        return float(squares) / (2 * len(self.basis) * blocks.count), chosen, int(best.nfev)

    def solve(self, settings: Mapping[str, Any]) -> list[tuple[Tensor, Tensor]]:
        """G (C, C) and weights (C, r) of x and of y."""
        solved = []
        for kernel, outputs in zip(
            self.kernels(self.part, self.part, settings), self.outputs[:, self.part], strict=True
        ):
            inverse = torch.cholesky_inverse(
                torch.linalg.cholesky(kernel + settings["ridge"] * torch.eye(len(kernel)).to(kernel))
            )
            solved.append((inverse, inverse @ outputs))
        return solved

    def corrector(self, best: Sequence[Row]) -> KernelCompensator:
        """Return the mean of the solutions, and keep what those of the trials miss without each fold."""
        varying, centres, members = self.varying, self.values[self.part].cpu().numpy(), []
        tried = [(row["params"], self.folds_left_out(row["number"])) for row in best if row["number"] < self.parts]
        if self.few:
            tried.append((self.descend(next(iter(self.method.points())))[1], []))
        errors, first = np.full_like(self.targets, np.nan), -1 if self.few else 0
        for settings, folds in tried:
            solved, scales = self.solve(settings), np.array([settings[name] for name in self.scales])
            weights = torch.cat([weights for _, weights in solved], dim=1).cpu().numpy()
            members.append(KernelMember(scales, settings["linear"], weights))
            self._leave_out(folds, settings, solved, errors)
        self.left_out, members = errors if self.parts > 1 else None, members[first:]
        return KernelCompensator(
            self.inputs, varying.normaliser, varying.reflection, self.basis, centres, tuple(members), tried[first][0]
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
