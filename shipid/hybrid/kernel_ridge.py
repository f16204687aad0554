"""Kernel ridge regression: the error of every run left out in closed form, its slope, and descents on it.

With G = (K + ridge)^-1 and a = G targets, what a fit without a block b misses of it is e_b = G_bb^-1 a_b, and its
weights are a - G_:b e_b (Rasmussen and Williams, 2006, section 5.4.2). Products and exponentials are NumPy's, which
take less time than PyTorch's on AMD and Intel; factors and inverses of large matrices are PyTorch's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize

from shipid.data.windows import part_of_runs
from shipid.hybrid.compensator import unflatten_paths
from shipid.hybrid.kernel_compensator import (
    KernelCompensator,
    KernelMember,
    bell_values,
    kernel_group,
    mirrored_sides,
    weighed_kernels,
    with_constant,
)
from shipid.hybrid.method import Array, Index, Row, Task
from shipid.hybrid.search import PathProblem, Point, TrialWorth, windows_of_folds
from shipid.hybrid.units import VaryingInputs

PRIOR = 0.1  # weight of the squared distance from the start of a descent, in logarithms, where one run is seen
TINY = np.finfo(float).tiny  # in place of the squared error where the physics misses nothing
FOLDS_OF_PART = 3  # where fewer folds are left out by each trial, one more descent leaves none out


class KernelProblem(PathProblem):
    """One foundation. Each trial leaves every `parts`-th fold out of its choice of scales.

    The errors of the runs of these folds are those of this trial alone, so that no run has a part in what predicts it.
    With few folds one more descent is on all of them: a third of three runs would choose by two. With one part there
    are no errors left out.
    """

    def __init__(self, method: Any, task: Task, name: str) -> None:
        super().__init__(method, task, name)
        self.windows = windows_of_folds(task)
        self.varying = VaryingInputs.of(self.rows(self.windows), method.mirror)
        self.scales = [f"{kernel_group(name)}_scale" for name in self.varying.normaliser.names]
        values, reflection = self.varying.normaliser.apply(self.table), self.varying.reflection
        self.values, self.sides = values, mirrored_sides(values, reflection)  # (S, d), (K, S, d)
        apart = self.weights.T.reshape(len(self.sides), -1, *self.weights.T.shape[1:])  # x and y, or both together
        self.outputs = np.concatenate([*apart.swapaxes(0, 1)], axis=2)  # (K, S, R)
        self.part = self.windows[part_of_runs(task.windows.run[self.windows], method.centres)]
        self.parts = min(method.trials, len(task.folds))
        self.few = self.parts > 1 and len(task.folds) < FOLDS_OF_PART * method.trials

    def kernels(self, points: Index, centres: Index, settings: Mapping[str, Any]) -> Array:
        """Kernels (K, S, C) between windows, with the settings of a trial: those of x and of y, or one of both."""
        scales = np.array([settings[name] for name in self.scales])
        sides, around = self.sides[:, points] / scales, self.values[centres] / scales
        whole = bell_values(sides, around)
        whole += (settings["linear"] * with_constant(sides)) @ with_constant(around).T
        return mirror_sums(whole)

    def folds_left_out(self, number: int) -> list[tuple[Index, Index]]:
        """Folds that a trial leaves out of its choice of scales."""
        return list(self.task.folds)[number % self.parts :: self.parts] if self.parts > 1 else []

    def judge(self, number: int, point: Point) -> TrialWorth:
        """Descend without the folds of a trial."""
        return self.descend(point, self.folds_left_out(number))

    def descend(self, point: Point, hidden: Sequence[tuple[Index, Index]] = ()) -> TrialWorth:
        """Descend from a point by the other folds; return the mean error [m^2] there, the settings, and the steps."""
        out, others = {id(fold) for fold in hidden}, np.concatenate([self.windows[:0], *(fold[0] for fold in hidden)])
        seen = self.windows[np.bincount(others, minlength=self.windows[-1] + 1)[self.windows] == len(hidden)]
        folds = [fold for fold in self.task.folds if id(fold) not in out]
        rows = seen[part_of_runs(self.task.windows.run[seen], self.method.search_windows)]
        idle = {name for name in point if name.endswith("_scale")} - {*self.scales}
        ranges, point = ({k: v for k, v in table.items() if k not in idle} for table in (self.method.ranges(), point))
        blocks, names = FoldBlocks(folds, rows), list(ranges)
        prior = PRIOR / len(np.unique(self.task.windows.run[rows]))
        start, ends = (np.log([table[name] for name in names]) for table in (point, ranges))
        values, sides, outputs = self.values[rows], self.sides[:, rows], self.outputs[:, rows]
        groups = list(dict.fromkeys(self.scales))
        of_group = np.array(groups)[:, None] == self.scales  # (G, d)

        def value_and_slope(logs: Array) -> tuple[float, Array]:
            settings = {**point, **dict(zip(names, np.exp(logs), strict=True))}
            scales, linear = np.array([settings[name] for name in self.scales]), settings["linear"]
            z, images = values / scales, with_constant(sides / scales)
            bell, plane = bell_values(images[..., :-1], z), with_constant(z)
            whole = mirror_sums(bell + (linear * images) @ plane.T)
            np.einsum("kii->ki", whole)[:] += settings["ridge"]
            missed, slope = blocks.errors_and_slope(whole, outputs)
            by_ridge, plain = np.trace(slope, axis1=1, axis2=2).sum(), mirror_sums(slope)
            bell *= plain
            by_linear = linear * (images * (plain @ plane)).sum((0, 1))
            by_input = (images[..., :-1] * (bell @ z)).sum((0, 1)) + by_linear[:-1]
            by_input -= (bell.sum((0, 1)) + bell.sum((0, 2))) @ z**2 / 2
            slopes = dict(zip(groups, -2 * of_group @ by_input, strict=True))
            slopes |= {"linear": by_linear.sum(), "ridge": settings["ridge"] * by_ridge}
            value, away = float((missed**2).sum()) or TINY, logs - start
            slope_of_logs = np.array([float(slopes[name]) for name in names])
            return np.log(value) + prior * away @ away, slope_of_logs / value + 2 * prior * away

        options = {"maxfun": self.method.steps}
        best = minimize(value_and_slope, start, jac=True, method="L-BFGS-B", bounds=ends, options=options)
        values = np.clip(np.exp(best.x), *np.array([ranges[name] for name in names]).T)
        squares = np.exp(best.fun - prior * np.square(best.x - start).sum())
        chosen = {**point, **dict(zip(names, map(float, values), strict=True))}
        return float(squares) / (2 * len(self.basis) * blocks.count), chosen, int(best.nfev)

    def solve(self, settings: Mapping[str, Any], folds: Sequence[tuple[Index, Index]]) -> list[Array]:
        """Weights (C, K R) of a solution, and of those without each fold.

        Centres that any fold leaves out come last in the Cholesky factor, [[L, 0], [A, B]]: the last block of G is then
        the inverse of B B^T, and what is above it is -L^-T A^T times that.
        """
        outs = ~windows_within((self.part, *(training for training, _ in folds)), self.part)
        order, first = np.argsort(outs.any(axis=0), kind="stable"), int((~outs.any(axis=0)).sum())
        part = self.part[order]
        kernel = torch.from_numpy(self.kernels(part, part, settings))
        kernel.diagonal(dim1=1, dim2=2).add_(settings["ridge"])
        factor = torch.linalg.cholesky(kernel)
        weights = torch.cholesky_solve(torch.from_numpy(self.outputs[:, part]), factor)
        inverse, last = torch.cholesky_inverse(factor[:, first:, first:]), weights[:, first:]
        places = map(np.flatnonzero, outs[:, order[first:]])
        parts = [inverse[:, :, b] @ torch.linalg.solve(inverse[:, b][:, :, b], last[:, b]) for b in places]
        below, left = torch.cat(parts, dim=2), factor[:, :, :first].mT  # L^T beside A^T
        above = torch.linalg.solve_triangular(left[:, :, :first], left[:, :, first:] @ below, upper=True)
        every = weights.repeat(1, 1, len(parts)) - torch.cat([-above, below], dim=1)
        return [np.concatenate([*one], axis=1) for one in np.split(every.numpy()[:, np.argsort(order)], len(parts), 2)]

    def corrector(self, best: Sequence[Row]) -> KernelCompensator:
        """Return the mean of the solutions, and keep what those of the trials miss without each fold."""
        varying, centres, members = self.varying, self.values[self.part], []
        tried = [(row["params"], self.folds_left_out(row["number"])) for row in best if row["number"] < self.parts]
        if self.few:
            tried.append((self.descend(next(iter(self.method.points())))[1], []))
        errors = np.full_like(self.targets, np.nan)
        for settings, folds in tried:
            scales = np.array([settings[name] for name in self.scales])
            weights, *others = self.solve(settings, folds)
            members.append(KernelMember(scales, settings["linear"], weights))
            sides, around = (each / scales for each in (self.sides, centres))
            for (_, judged), own in zip(folds, others, strict=True):
                outputs = unflatten_paths(weighed_kernels(sides[:, judged], around, settings["linear"], own))
                errors[:, judged] = self.targets[:, judged] - np.tensordot(self.basis, outputs, 1)
        self.left_out = errors if self.parts > 1 else None
        made: KernelCompensator = self.method.corrector(
            self.inputs, varying.normaliser, varying.reflection, self.basis, centres, tuple(members), tried[0][0]
        )
        return made


def mirror_sums(sides: Array) -> Array:
    """Sum and difference (2, S, C) of kernels with windows as they are and with mirrored ones, in their place.

    These make x and y. Without a mirror there is one (1, S, C), which stays.
    """
    if len(sides) == 2:
        sides[0] += sides[1]
        sides[1] *= -2
        sides[1] += sides[0]
    return sides


def windows_within(sets: Sequence[Index], windows: Index) -> NDArray[np.bool_]:
    """Whether windows (S,) are in each of some sets, (F, S)."""
    table = np.zeros((len(sets), 1 + max(windows.max(), *(each.max() for each in sets))), bool)
    for row, each in zip(table, sets, strict=True):
        row[each] = True
    return table[:, windows]


class FoldBlocks:
    """What folds leave out of some windows.

    out : places of the windows (F, b), filled up with others. known : those left out; judged : those that are judged.
    """

    def __init__(self, folds: Sequence[tuple[Index, Index]], rows: Index) -> None:
        out, judges = (
            ~windows_within([fold[0] for fold in folds], rows),
            windows_within([fold[1] for fold in folds], rows),
        )
        places = np.argsort(~out, axis=1, kind="stable")[:, : out.sum(axis=1).max()]
        known = np.take_along_axis(out, places, axis=1)
        judged = known & np.take_along_axis(judges, places, axis=1)
        self.out, self.known, self.judged, self.count = places, known, judged, int(judged.sum())

    def errors_and_slope(self, kernel: Array, outputs: Array) -> tuple[Array, Array]:
        """What fits without each block miss of it (K, F, b, R), 0 where it is not judged; slope of its square.

        kernel : (K, S, S) with the ridge. outputs : (K, S, R).
        """
        inverse = torch.cholesky_inverse(torch.linalg.cholesky(torch.from_numpy(kernel))).mT.numpy()  # symmetric
        weights, columns = inverse @ outputs, inverse[:, self.out]  # (K, F, b, S)
        both = self.known[:, :, None] & self.known[:, None, :]
        blocks = np.where(both, inverse[:, self.out[:, :, None], self.out[:, None]], np.eye(both.shape[1]))
        every = np.linalg.solve(blocks, self.known[..., None] * weights[:, self.out])
        missed = self.judged[..., None] * every
        within = np.linalg.solve(blocks, missed)
        inner = (within @ every.mT) @ columns
        left, inner, within = (each.reshape(len(each), -1, each.shape[-1]) for each in (columns, inner, within))
        return missed, 2 * (left.mT @ inner - (left.mT @ within) @ weights.mT)
