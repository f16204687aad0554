"""Tuning in closed form: hidden units are drawn, output weights are a least-squares solution with a ridge.

The output weights of all models follow from one decomposition, for every ridge, and so does the error on each run left
out in turn: from the residuals r of the whole and the hat matrix H, that of a left-out block is (I - H_bb)^-1 r_b
(Allen, 1974).

A mirrored trial pairs each hidden unit with its mirror image, with equal output weights for x and opposite ones for y:
mirrored inputs then give the mirrored path exactly.

Where windows are many, trials are compared by a part of them, evenly taken from each run; the best ones are judged once
more, and solved, with all of them: successive halving (Jamieson and Talwalkar, 2016).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shipid.data.windows import WindowMask, choose_evenly
from shipid.hybrid.compensator import Network, smooth_basis
from shipid.hybrid.features import input_group
from shipid.hybrid.method import Array, FitResult, Index, Row, Task, input_table_key, shared_tables
from shipid.hybrid.search import (
    CLOSING_TRIALS,
    Point,
    Search,
    diverged_result,
    ridge_values,
    seed_of,
    trial_row,
    windows_of_folds,
)
from shipid.hybrid.units import Units, VaryingInputs

Seeing = tuple[VaryingInputs, Tensor]
"""Windows as hidden units see them: what is seen, and its values (S, d), normalised."""

RIDGES = 9  # of a range
GOLDEN = 0.6180339887498949  # multiples of it are spread evenly over a step
FINAL_PRICE = 2  # trials by a part of the windows that one by all costs, about
SPARE_TRIALS = 4  # further trials whose errors without each run are kept


def tune_ridge(task: Task, method: Any) -> dict[str, FitResult]:
    """Solve networks for each foundation.

    The objective is the mean squared error [m^2] per coordinate over the validation windows of all folds, each
    predicted by the solution from its training part. The compensator is the mean of the networks of the best trials,
    solved with all windows of the folds.

    method : a `PathDrawn`, or a kind of it; the class itself imports this file, so it is not named here.
    """
    tuning = _RidgeTuning(task, method)
    tuning.search()
    return {key: tuning.fitted(key) for key in task.cases}


@dataclass(frozen=True)
class _Coordinates:
    """Coordinates that are made of the same features, with the axes of their Gram matrix, and what they have to make.

    sides : x, y or both, 0 and 1. features : (S, M); eigenvalues : (M,), rising; axes : (M, M);
    targets : (S, sides K r) [m], side by side; product : (M, sides K r), features on the axes by targets.
    """

    sides: tuple[int, ...]
    features: Tensor
    eigenvalues: Tensor
    axes: Tensor
    targets: Tensor
    product: Tensor

    def rotated(self, windows: Tensor) -> Tensor:
        """Features of some windows (...) on the axes, (..., M)."""
        every = torch.equal(windows, torch.arange(len(self.features)))
        return matrix_product(self.features if every else self.features[windows], self.axes)

    def columns(self, of_side: list[int]) -> list[int]:
        """Columns of all its sides, from those of one side."""
        width = self.targets.shape[1] // len(self.sides)
        return [place * width + column for place in range(len(self.sides)) for column in of_side]

    def weights(self, ridge: float, columns: list[int] | slice) -> Tensor:
        """Weights (M, C) of the axes, fitted to all windows, for some columns of the targets."""
        return self.product[:, columns] / (self.eigenvalues + ridge)[:, None]


@dataclass(frozen=True)
class _FoundationGroup:
    """Foundations whose inputs are the same arrays in a trial: one decomposition serves them all.

    names : the foundations. outputs : x and y of their targets on the basis, (S, K r) each.
    plain, mirrored : the inputs without and with the mirror; None where a column has no image in it.
    """

    names: tuple[str, ...]
    outputs: list[Tensor]
    plain: Seeing
    mirrored: Seeing | None

    def of_rows(self, rows: Tensor) -> _FoundationGroup:
        """The group with some of the windows; means and spreads of inputs stay those of all."""
        plain = self.plain[0], self.plain[1][rows]
        mirrored = (self.mirrored[0], self.mirrored[1][rows]) if self.mirrored else None
        return replace(self, outputs=[side[rows] for side in self.outputs], plain=plain, mirrored=mirrored)

    def only(self, names: Sequence[str], terms: int) -> _FoundationGroup:
        """The group for some of the foundations; `terms` is r."""
        columns = [self.names.index(name) * terms + term for name in names for term in range(terms)]
        return replace(self, names=tuple(names), outputs=[side[:, columns] for side in self.outputs])


@dataclass(frozen=True)
class _JudgingWindows:
    """Windows by which trials are judged: all, or a part.

    rows : places of the windows among all, (S,). share : of all windows, by which a ridge shrinks.
    blocks : what each fold leaves out of them. faster : sum of squares [m^2] of each foundation over those judged that
    no network follows. count : number of windows that are judged.
    """

    rows: Index
    share: float
    blocks: list[_FoldBlock]
    faster: dict[str, float]
    count: int

    @classmethod
    def of(cls, task: Task, windows: Index, rows: Index, targets: Mapping[str, Array], basis: Array) -> _JudgingWindows:
        """Take some rows (S,) of the windows, numbered as in the task; targets (T, S, 2) [m] of each foundation."""
        taken = windows[rows]
        folds = [
            (training[np.isin(training, taken)], judged[np.isin(judged, taken)]) for training, judged in task.folds
        ]
        judged = np.concatenate([validation for _, validation in folds])
        faster = {  # sums of squares [m^2] of what the basis cannot follow
            key: float(np.square(paths[:, judged] - np.tensordot(basis @ basis.T, paths[:, judged], 1)).sum())
            for key, paths in targets.items()
        }
        return cls(rows, len(rows) / len(windows), _fold_blocks(folds, taken), faster, len(judged))


@dataclass(frozen=True)
class _TrialVerdict:
    """One trial for one foundation.

    value : mean squared error [m^2] on runs left out. ridges : numbers of the ridges that all folds, or all but one,
    choose. network : solves the network. left_out : the errors without each fold, its ridge chosen by the others: sums
    of squares (F,) [m^2] over the judged windows of all folds but that one, and errors (2, S, r) of x and y on the
    basis, not numbers for windows that no fold judges.
    """

    value: float
    ridges: Index
    params: dict[str, float]
    network: Callable[[], Network]
    left_out: Callable[[], tuple[Array, Tensor]]


class _BestTrials:
    """The networks of the best trials of one model so far, and the errors without each fold of some more."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.networks: list[tuple[float, tuple[dict[str, float], Network]]] = []
        self.left_out: list[tuple[float, tuple[Array, Tensor]]] = []

    def consider(self, trial: _TrialVerdict) -> None:
        """Solve the network if the trial is among the best."""
        _keep_best(self.networks, self.most, trial.value, lambda: (trial.params, trial.network()))
        _keep_best(self.left_out, self.most + SPARE_TRIALS, trial.value, trial.left_out)

    def without(self, folds: Sequence[Index]) -> Array:
        """Errors (2, S, r) on the basis where no fold has a part in the choice of the trials that judge it."""
        others = np.stack([kept[0] for _, kept in self.left_out])  # (trials, F)
        tried = np.stack([np.asarray(kept[1]) for _, kept in self.left_out])  # (trials, 2, S, r)
        errors: Array = np.full_like(tried[0], np.nan)
        best = np.argsort(others, axis=0, kind="stable")[: self.most]
        for fold, rows in enumerate(folds):
            errors[:, rows] = tried[best[:, fold, None], :, rows].mean(axis=0).swapaxes(0, 1)
        return errors


def _keep_best(kept: list[tuple[float, Any]], most: int, value: float, make: Callable[[], Any]) -> None:
    """Add what `make` gives to the best so far, in order of their values, if it is one of so many."""
    if len(kept) < most or value < kept[-1][0]:
        kept[:] = sorted([*kept, (value, make())], key=lambda pair: pair[0])[:most]


class _RidgeTuning:
    """What the trials of a task share, and the best of them so far.

    windows : those of all folds. paths : foundation -> targets on the basis, where they are numbers. every : all
    windows as judges; first : those that judge all trials. rows : of each foundation, its trials.
    """

    def __init__(self, task: Task, method: Any) -> None:
        self.task, self.method, self.inputs = task, method, method.inputs(task.commands)
        self.windows, self.targets = windows_of_folds(task), task.targets
        sound = {key: paths for key, paths in self.targets.items() if np.isfinite(paths[:, self.windows]).all()}
        tables = _tables_of_windows(shared_tables(task, self.inputs), self.windows)
        self.tables = {key: tables[key] for key in sound}
        self.basis = smooth_basis(task.windows.horizon, method.terms)
        self.paths = {key: np.tensordot(self.basis.T, paths[:, self.windows], 1) for key, paths in sound.items()}
        self.every = _JudgingWindows.of(task, self.windows, np.arange(len(self.windows)), sound, self.basis)
        rows = part_of_runs(task.windows.run[self.windows], method.search_windows)
        lacks = any(not np.isin(part, self.windows[rows]).any() for fold in task.folds for part in fold)
        self.whole = len(rows) == len(self.windows) or lacks  # no fold may lose all windows of a part
        self.first = self.every if self.whole else _JudgingWindows.of(task, self.windows, rows, sound, self.basis)
        self.finalists = method.num_chosen() + SPARE_TRIALS
        self.best = {key: _BestTrials(method.num_chosen()) for key in sound}
        self.points: dict[int, Point] = {}
        self.groups: dict[frozenset[str], list[_FoundationGroup]] = {}
        self.rows: dict[str, list[Row]] = {}

    def search(self) -> None:
        """Judge all trials, by a part of the windows where they are many."""
        # networks are solved again after a break: it costs less than to keep them
        closing = CLOSING_TRIALS if self.whole else FINAL_PRICE * self.finalists
        search = Search(self.task, self.paths, self.method, again=True, closing=closing)
        promising: dict[str, list[tuple[float, int, Index]]] = {key: [] for key in self.paths}
        for number, point in search.left(self.method.points() if self.paths else ()):
            self.points[number] = point
            made: dict[str, Row] = {}
            for group in self._groups(number):
                start = time.process_time()
                for key, verdict in self._judge(group, number, self.first).items():
                    if self.whole:
                        self.best[key].consider(verdict)
                    promising[key].append((verdict.value, number, verdict.ridges))
                    made[key] = trial_row(number, verdict.params, verdict.value, start)
                for key in group.names:
                    made[key]["seconds"] = (time.process_time() - start) / len(group.names)
            search.record(made)
        self.rows = search.rows
        if not self.whole:
            self._judge_finalists(promising)

    def _judge_finalists(self, promising: Mapping[str, list[tuple[float, int, Index]]]) -> None:
        """Judge the best trials by a part of the windows once more, by all windows; the others stopped.

        promising : of each foundation value, number and ridges of its trials.
        """
        finals: dict[int, dict[str, Index]] = {}  # trial -> foundation -> numbers of ridges
        self.rows = {key: [{**row, "state": "stopped"} for row in rows] for key, rows in self.rows.items()}
        for key, tried in promising.items():
            for _, number, ridges in sorted(tried, key=lambda trial: trial[:2])[: self.finalists]:
                finals.setdefault(number, {})[key] = ridges
        for number, wanted in sorted(finals.items()):
            for group in self._groups(number, whole=True):
                names = [key for key in group.names if key in wanted]
                start = time.process_time()
                few = group.only(names, self.basis.shape[1])
                for key, verdict in self._judge(few, number, self.every, wanted).items() if names else ():
                    self.best[key].consider(verdict)
                    value = {"value": verdict.value, "params": verdict.params, "state": "complete"}
                    self.rows[key][number] |= value
                for key in names:
                    self.rows[key][number]["seconds"] += (time.process_time() - start) / len(names)

    def fitted(self, key: str) -> FitResult:
        """The mean of the best networks of a foundation, and its errors on runs left out.

        With a single fold there are none: nothing but that fold can choose the trials that judge it.
        """
        if key not in self.best:
            return diverged_result(self.method, self.method.points())
        best, errors = self.best[key], None
        folds = [row.numpy() for block in self.every.blocks for row in block.rows]
        if len(folds) > 1:
            missed = np.tensordot(self.basis, best.without(folds), (1, 2)).transpose(0, 2, 1)
            errors, targets = np.full_like(self.targets[key], np.nan), self.targets[key][:, self.windows]
            errors[:, self.windows] = targets - np.tensordot(self.basis, self.paths[key], 1) + missed
        params, networks = zip(*(kept for _, kept in best.networks), strict=True)
        corrector, rows = self.method.corrector(self.inputs, networks, params[0]), self.rows[key]
        return FitResult(corrector, rows, sum(row["seconds"] for row in rows), errors)

    def _groups(self, number: int, *, whole: bool = False) -> list[_FoundationGroup]:
        """Foundations with the same inputs in a trial together, with all windows, or with those that judge first."""
        left_out = self.method.left_out(self.points[number])
        if left_out not in self.groups:
            self.groups[left_out] = _group_foundations(self.tables, self.paths, left_out)
        if whole or self.whole:
            return self.groups[left_out]
        rows = torch.as_tensor(self.first.rows)
        return [group.of_rows(rows) for group in self.groups[left_out]]

    def _judge(
        self, group: _FoundationGroup, number: int, judges: _JudgingWindows, wanted: Mapping[str, Index] | None = None
    ) -> dict[str, _TrialVerdict]:
        """One trial for some foundations; `wanted` are the numbers of the ridges of each, else it descends."""
        point, terms, ridges = self.points[number], self.basis.shape[1], ridge_values(self.method.ridge, RIDGES)
        mirrored = bool(point["mirror"]) and group.mirrored is not None
        seen, values = group.mirrored if mirrored and group.mirrored is not None else group.plain
        units = seen.draw(point, self.method.units, seed_of(self.task.seed, number))
        layer = units.weight, units.offset  # the same arrays for all foundations
        if units.reflection is not None:  # and the mirror images
            layer = np.concatenate([layer[0], units.reflection @ layer[0]], axis=1), np.tile(layer[1], 2)
        parts = _coordinates_of_trial(values, units, group.outputs)
        asked = None
        if wanted is not None:
            asked = np.stack([np.isin(range(len(ridges)), wanted[key]) for key in group.names], axis=1)
        scaled = [ridge * judges.share for ridge in ridges]
        errors, others, kept = _left_out_errors(parts, scaled, judges.blocks, terms, asked)
        verdicts = {}
        for k, key in enumerate(group.names):
            place, columns = int(errors[:, k].argmin()), list(range(k * terms, (k + 1) * terms))
            chosen = np.unique([place, *others[:, :, k].argmin(axis=0)])
            verdicts[key] = _TrialVerdict(
                value=float(errors[place, k] + judges.faster[key]) / (2 * len(self.basis) * judges.count),
                ridges=_ridges_for_all(ridges, judges.share, chosen),
                params={**point, "mirror": float(mirrored), "ridge": ridges[place]},
                network=partial(_solved_network, seen, layer, parts, columns, scaled[place], self.basis),
                left_out=partial(_without_each_fold, others[:, :, k], kept, k),
            )
        return verdicts


def part_of_runs(run: NDArray[np.str_], most: int) -> Index:
    """Places of about `most` of the windows (S,), evenly taken from each run, one at least; all where they are few.

    run : name of the run of each window, (S,), in the order of time. Each run begins at another part of a step, so that
    all moments of alike manoeuvres are seen.
    """
    if len(run) <= most:
        return np.arange(len(run))
    taken = []
    for number, name in enumerate(np.unique(run)):
        mine = np.flatnonzero(run == name)
        count = max(1, round(len(mine) * most / len(run)))
        taken.append(choose_evenly(mine, count, (0.5 + number * GOLDEN) % 1.0))
    return np.sort(np.concatenate(taken))


def _ridges_for_all(ridges: Sequence[float], share: float, chosen: Index) -> Index:
    """Numbers of the rising ridges that all windows may choose where a share of them chose these.

    Where windows are alike, a fit to a part has ridges smaller by that share; where each has news, the same ones.
    """
    lowest = np.searchsorted(ridges, share * np.asarray(ridges)[chosen] * (1 + 1e-9), side="right") - 1
    ranges = zip(np.maximum(lowest, 0), chosen, strict=True)
    return np.unique(np.concatenate([np.arange(low, high + 1) for low, high in ranges]))


def _tables_of_windows(tables: Mapping[str, Mapping[str, Array]], windows: Index) -> dict[str, dict[str, Array]]:
    """Tables with the chosen windows alone; arrays that several tables share stay shared."""
    chosen = {id(values): values[windows] for table in tables.values() for values in table.values()}
    return {key: {name: chosen[id(values)] for name, values in table.items()} for key, table in tables.items()}


def _group_foundations(
    tables: Mapping[str, Mapping[str, Array]], paths: Mapping[str, Array], left_out: frozenset[str]
) -> list[_FoundationGroup]:
    """Foundations with the same inputs together; `left_out` names kinds of memory that the trial does not take."""
    alike: dict[Any, tuple[dict[str, Array], list[str]]] = {}
    for key, table in tables.items():
        taken = {name: values for name, values in table.items() if input_group(name) not in left_out}
        alike.setdefault(input_table_key(taken), (taken, []))[1].append(key)
    groups = []
    for table, keys in alike.values():
        outputs = [_double_tensor(np.concatenate([paths[key][..., axis].T for key in keys], axis=1)) for axis in (0, 1)]
        plain, mirrored = (_normalised_inputs(table, mirror) for mirror in (False, True))
        groups.append(
            _FoundationGroup(tuple(keys), outputs, plain, mirrored if mirrored[0].reflection is not None else None)
        )
    return groups


@dataclass(frozen=True)
class _FoldBlock:
    """Folds of equal size.

    out : rows of the windows that each fold leaves out, (folds, b). judged : which of those are judged, (folds, j).
    rows : the judged rows of the windows, (folds, j).
    """

    out: Tensor
    judged: Tensor

    @property
    def rows(self) -> Tensor:
        return self.out.take_along_dim(self.judged, dim=1)

    def of_judged(self, errors: Tensor) -> Tensor:
        """Those of errors (folds, b, K r) of what is left out that are judged, (folds, j, K r)."""
        every = self.judged.shape == self.out.shape
        return errors if every else errors.take_along_dim(self.judged[:, :, None], dim=1)


def _fold_blocks(folds: Sequence[tuple[Index, Index]], windows: Index) -> list[_FoldBlock]:
    """What each fold leaves out, and which of it is judged, equal sizes together."""
    pairs: dict[tuple[int, int], list[tuple[Index, Index]]] = {}
    for training, validation in folds:
        out = np.flatnonzero(~np.isin(windows, training))
        judged = np.flatnonzero(np.isin(windows[out], validation))
        pairs.setdefault((len(out), len(judged)), []).append((out, judged))
    return [
        _FoldBlock(*(torch.as_tensor(np.stack(part)) for part in zip(*same, strict=True))) for same in pairs.values()
    ]


def _normalised_inputs(table: Mapping[str, Array], mirror: bool) -> Seeing:
    """Choose and normalise the inputs; with a mirror, by the windows and their images."""
    seen = VaryingInputs.of(table, mirror)
    return seen, _double_tensor(seen.normaliser.apply(table))


def _coordinates_of_trial(values: Tensor, units: Units, outputs: Sequence[Tensor]) -> list[_Coordinates]:
    """Features of a trial with the targets of x and y: even and odd ones in the mirror, else the same for both."""
    weight, offset = (_double_tensor(part) for part in (units.weight, units.offset))
    size = len(offset) ** 0.5
    features = hidden_layer(values, weight, offset)
    if units.reflection is None:
        return [_with_axes((0, 1), features.div_(size), outputs)]
    image = hidden_layer(values, _double_tensor(units.reflection) @ weight, offset)
    even = (features + image).div_(2**0.5 * size)
    odd = features.sub_(image).div_(2**0.5 * size)
    return [_with_axes((0,), even, outputs[:1]), _with_axes((1,), odd, outputs[1:])]


def _with_axes(sides: tuple[int, ...], features: Tensor, outputs: Sequence[Tensor]) -> _Coordinates:
    """Coordinates that are made of features (S, M), with the targets (S, K r) of each."""
    eigenvalues, axes = torch.linalg.eigh(matrix_product(features.T, features))
    eigenvalues = eigenvalues.clamp(min=0.0)  # rounding makes none negative
    product = [matrix_product(axes.T, matrix_product(features.T, side)) for side in outputs]
    return _Coordinates(sides, features, eigenvalues, axes, torch.cat(list(outputs), dim=1), torch.cat(product, dim=1))


class _LeftOutErrors:
    """Errors of a trial over judged windows, each fold without itself, by ridge; in single precision."""

    def __init__(self, num_windows: int, terms: int, num_ridges: int) -> None:
        self.num_windows, self.terms = num_windows, terms
        self.blocks: list[list[tuple[_SidePiece, list[int], Tensor]]] = [[] for _ in range(num_ridges)]

    def keep(self, ridge: int, piece: _SidePiece, models: list[int], errors: Tensor) -> None:
        """Keep the errors (folds, j, sides x models x r) of some models on the judged windows of a piece."""
        self.blocks[ridge].append((piece, models, errors.float()))

    def of(self, ridges: Array, model: int) -> Tensor:
        """Errors (2, S, r) of a model, each fold by the ridge of this number; not numbers where none judges."""
        selected = torch.full((2, self.num_windows, self.terms), torch.nan, dtype=torch.float32)
        for ridge in np.unique(ridges):
            for piece, models, errors in self.blocks[ridge]:
                mine = torch.as_tensor(ridges[piece.folds] == ridge)
                rows, first = piece.block.rows[mine], models.index(model) * self.terms
                for side, of_side in zip(piece.sides, errors.chunk(len(piece.sides), dim=2), strict=True):
                    selected[side, rows] = of_side[mine, :, first : first + self.terms]
        return selected


def _left_out_errors(
    parts: Sequence[_Coordinates],
    ridges: Sequence[float],
    blocks: Sequence[_FoldBlock],
    terms: int,
    wanted: WindowMask | None = None,
) -> tuple[Array, Array, _LeftOutErrors]:
    """Errors over judged windows, each block without itself.

    `ridges` rise; `terms` is r. `wanted` (ridges, K) says which ridges are asked of which models. By default each model
    descends from the middle, to either side as long as the last one is the best so far by all folds, or all but one.

    Returns sums of squares (ridges, K) [m^2] over all folds, those over all folds but one (ridges, F, K), and the
    errors. The sums of a ridge that is not asked are infinite.
    """
    targets, ends = parts[0].targets, np.cumsum([len(block.out) for block in blocks])
    pieces = []
    for part in parts:
        for end, block in zip(ends, blocks, strict=True):
            solver = (_FewRows if block.out.shape[1] <= part.features.shape[1] else _ManyRows)(part, block)
            pieces.append(_SidePiece(part.sides, slice(end - len(block.out), end), block, solver))
    num_models = targets.shape[1] // (terms * len(parts[0].sides))
    sums = targets.new_full((len(ridges), num_models), torch.inf)
    others = targets.new_full((len(ridges), ends[-1], num_models), torch.inf)
    errors = _LeftOutErrors(len(targets), terms, len(ridges))

    def best_at(i: int) -> list[int]:
        """Models for which ridge i is the best so far, by all folds or by all but one."""
        curves = torch.cat([sums[:, None], others], dim=1) if ends[-1] > 1 else sums[:, None]
        return (curves.argmin(dim=0) == i).any(dim=0).nonzero().flatten().tolist()

    def asked() -> Iterator[tuple[int, list[int]]]:
        """Numbers of ridges, each with the models of which it is asked."""
        every, middle = range(len(ridges)), len(ridges) // 2
        if wanted is not None:
            yield from ((i, np.flatnonzero(wanted[i]).tolist()) for i in every)
            return
        yield middle, list(range(num_models))
        yield from ((i, best_at(i + 1)) for i in reversed(every[:middle]))
        yield from ((i, best_at(i - 1)) for i in every[middle + 1 :])

    for i, models in asked():
        if not models:
            continue
        columns = [k * terms + term for k in models for term in range(terms)]
        by_fold = targets.new_zeros((ends[-1], len(models)))
        for piece in pieces:
            every = len(models) == num_models
            without = piece.solver.without(ridges[i], slice(None) if every else piece.solver.part.columns(columns))
            made = piece.block.of_judged(without)
            squares = np.einsum("fbc,fbc->fc", made.numpy(), made.numpy())
            shares = torch.from_numpy(squares).reshape(len(made), len(piece.sides), len(models), terms)
            by_fold[piece.folds] += shares.sum(dim=(1, 3))
            errors.keep(i, piece, models, made)
        sums[i, models] = by_fold.sum(dim=0)
        others[i][:, models] = by_fold.sum(dim=0) - by_fold
    return sums.numpy(), others.numpy(), errors


@dataclass(frozen=True)
class _SidePiece:
    """Some sides, x and y, of the folds of a block. folds : their places among all folds."""

    sides: tuple[int, ...]
    folds: slice
    block: _FoldBlock
    solver: _FewRows | _ManyRows


def _without_each_fold(others: Array, errors: _LeftOutErrors, model: int) -> tuple[Array, Tensor]:
    """A trial without each fold in turn, for one model: others (ridges, F) [m^2] over all folds but that one."""
    return others.min(axis=0), errors.of(others.argmin(axis=0), model)


class _FewRows:
    """Errors (folds, b, K r) of blocks without themselves, by their part H_bb of the hat matrix, (b, b)."""

    def __init__(self, part: _Coordinates, block: _FoldBlock) -> None:
        self.part, self.rows, self.targets = part, part.rotated(block.out), part.targets[block.out]
        self.unit = torch.eye(block.out.shape[1], dtype=torch.float64)

    def without(self, ridge: float, columns: list[int] | slice) -> Tensor:
        """What a fit without each block misses of some columns of the targets; by I - H_bb."""
        missed = self.targets[..., columns] - matrix_product(self.rows, self.part.weights(ridge, columns))
        hat = matrix_product(self.rows / (self.part.eigenvalues + ridge), self.rows.mT)
        solved: Tensor = torch.linalg.solve(self.unit - hat, missed)
        return solved


class _ManyRows:
    """As `_FewRows`, by the output weights without each block, (M, M): for blocks of more windows than features."""

    def __init__(self, part: _Coordinates, block: _FoldBlock) -> None:
        self.part = part
        self.rows, self.targets = part.rotated(block.out), part.targets[block.out]  # (folds, b, M), (folds, b, K r)
        self.within = matrix_product(self.rows.mT, self.rows)
        self.other = part.product - matrix_product(self.rows.mT, self.targets)

    def without(self, ridge: float, columns: list[int] | slice) -> Tensor:
        """What a fit without each block misses of it."""
        remainder = torch.diag(self.part.eigenvalues + ridge) - self.within
        solved = torch.linalg.solve(remainder, self.other[..., columns])
        return self.targets[..., columns] - matrix_product(self.rows, solved)


def _solved_network(
    seen: VaryingInputs,
    layer: tuple[Array, Array],
    parts: Sequence[_Coordinates],
    columns: list[int],
    ridge: float,
    basis: Array,
) -> Network:
    """The network whose targets are some columns of a trial, solved with all windows."""
    x, y = (
        (part.axes @ weights).numpy() / part.features.shape[1] ** 0.5
        for part in parts
        for weights in part.weights(ridge, part.columns(columns)).chunk(len(part.sides), dim=1)
    )
    if seen.reflection is not None:
        x, y = np.concatenate([x, x]) / 2**0.5, np.concatenate([y, -y]) / 2**0.5
    output = np.concatenate([x, y], axis=1)
    return Network(seen.features, seen.normaliser, basis, (layer, (output, np.zeros(output.shape[1]))))


def _double_tensor(values: Array) -> Tensor:
    return torch.as_tensor(values, dtype=torch.float64)


# On AMD products and functions of NumPy take a third to nine tenths of the time of those of PyTorch, except tanh with
# AVX2 only. Both share their memory.


def matrix_product(left: Tensor, right: Tensor) -> Tensor:
    """Return left @ right, of matrices or stacks of them."""
    return torch.from_numpy(np.matmul(left.numpy(), right.numpy()))


def hidden_layer(values: Tensor, weight: Tensor, offset: Tensor) -> Tensor:
    """Return tanh(values @ weight + offset): units (S, M) of inputs (S, d) by weights (d, M) and offsets (M,)."""
    units = np.matmul(values.numpy(), weight.numpy())
    units += offset.numpy()
    return torch.from_numpy(np.tanh(units, out=units))
