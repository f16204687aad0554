"""Tuning by gradients: an Optuna study per model; trials may race.

With `at_once` above 1 so many trials are proposed at a time, and race: the better half of those of a model goes on
(successive halving: Jamieson and Talwalkar, 2016). Where all trials run to their end, most of the time goes into those
that are hopeless early.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import ceil
from typing import Any, NamedTuple, cast

import numpy as np
import torch
from torch import Tensor

from shipid.hybrid.compensator import Compensator, Network, flatten_paths
from shipid.hybrid.features import Inputs, input_group
from shipid.hybrid.method import FitResult, Index, Row, Task, shared_tables
from shipid.hybrid.ridge import part_of_runs
from shipid.hybrid.search import (
    Search,
    best_trials,
    seed_of,
    suggested_points,
    trial_row,
    windows_of_folds,
)
from shipid.hybrid.training import NetworkTraining, tanh_network, train_units
from shipid.hybrid.units import VaryingInputs

Trial = tuple[str, int]
"""Model and number."""
PARTS = 3  # of the folds: with one for each fold Adam soon finds what only they have in common
HALVINGS = 4  # of the epochs, down to those after which the first trials of a race stop; with 6 slow ones are lost


def tune_gradient(task: Task, method: Any) -> dict[str, FitResult]:
    """Train networks for each foundation.

    The objective is the mean validation error over the folds; the compensator is the mean of the fold networks of the
    best trial. The sampler of a trial is seeded by its number.

    method : a `PathTrained`.
    """
    trainer, search, at_once = _Trainer(task, method), Search(task, task.cases, method), method.at_once
    if search.done != search.count:  # a round that was interrupted begins again
        search.rows = {key: rows[: search.done - search.done % at_once] for key, rows in search.rows.items()}
    best: dict[str, _TrialOutcome] = {}  # of the trials that were trained here
    for first, asked in search.left(suggested_points(method, search, task.seed, at_once)):
        outcomes = trainer.train(asked)
        for (key, _), (row, networks) in outcomes.items():
            if row["state"] == "complete" and (key not in best or row["value"] < best[key][0]["value"]):
                best[key] = row, networks
        for number in range(first, first + len(asked) // len(search.rows)):
            search.record({key: outcomes[key, number][0] for key in search.rows})
    return {key: trainer.fitted(key, search.rows, best.get(key)) for key in search.rows}


class _FoldTraining(NamedTuple):
    """A network in training: its trial and fold, what its inputs are."""

    trial: Trial
    fold: int
    varying: VaryingInputs
    training: NetworkTraining


_TrialOutcome = tuple[Row, tuple[Network, ...]]  # the row of a trial, and the networks of the folds


class _Trainer:
    """What all trials share: inputs, targets and folds."""

    def __init__(self, task: Task, method: Any) -> None:
        self.task, self.method, self.inputs = task, method, Inputs(task.commands, method.memory)
        self.tables = shared_tables(task, self.inputs)
        self.targets = {key: flatten_paths(paths) for key, paths in task.targets.items()}

    def _begin(self, trial: Trial, fold: int, settings: Mapping[str, float]) -> _FoldTraining:
        """The network of a trial and a fold, not trained yet."""
        (key, number), (training, validation) = trial, self.task.folds[fold]
        table, targets = self.tables[key], self.targets[key]
        varying = VaryingInputs.of({name: values[training] for name, values in table.items()}, mirror=False)
        values = varying.normaliser.apply(table)
        widths = [values.shape[1], *[int(settings["units"])] * int(settings["layers"]), targets.shape[1]]
        begun = NetworkTraining(
            lambda: tanh_network(widths, settings["input_dropout"], settings["hidden_dropout"]),
            [([(values[rows],)], targets[rows]) for rows in (training, validation)],
            self.method,
            lambda _: settings["learning_rate"],
            settings["weight_decay"],
            seed_of(self.task.seed, number, fold, key),
            self.task.device,
        )
        return _FoldTraining(trial, fold, varying, begun)

    def train(self, asked: Mapping[Trial, Mapping[str, float]]) -> dict[Trial, _TrialOutcome]:
        """Train the networks of some trials; several of a model race."""
        folds = range(len(self.task.folds))
        running = {trial: [self._begin(trial, fold, point) for fold in folds] for trial, point in asked.items()}
        seconds, stopped = dict.fromkeys(asked, 0.0), set[Trial]()
        per_model = len(asked) // len(self.tables)
        ends = [self.method.epochs >> halving for halving in range(HALVINGS if per_model > 1 else 0, -1, -1)]
        for place, (before, epoch) in enumerate(pairwise([0, *filter(None, ends)]), start=1):
            for trial, members in running.items():
                start = time.process_time()
                for one in members:
                    one.training.advance(epoch - before)
                seconds[trial] += time.process_time() - start
            if epoch < self.method.epochs:
                stopped |= _stop_worst(running, ceil(per_model / 2**place))
        outcomes = {}
        for trial, members in running.items():
            value, epochs = _mean_loss(members), max(one.training.epochs for one in members)
            row = trial_row(trial[1], asked[trial], value, 0.0, epochs) | {"seconds": seconds[trial]}
            if trial in stopped and row["state"] == "complete":
                row["state"] = "stopped"
            outcomes[trial] = row, tuple(map(_trained_network, members))
        return outcomes

    def fitted(self, key: str, rows: Mapping[str, list[Row]], best: _TrialOutcome | None) -> FitResult:
        """The networks of the best trial; those of an earlier session are trained once more."""
        seconds = sum(row["seconds"] for row in rows[key])
        kept = best_trials(rows[key])
        if not kept:
            return FitResult(None, rows[key], seconds)
        number = kept[0]["number"]
        if best is None or number != best[0]["number"]:
            best = self.train({(key, number): kept[0]["params"]})[key, number]
        return FitResult(Compensator(self.inputs, best[1], kept[0]["params"]), rows[key], seconds)


def _mean_loss(members: Sequence[_FoldTraining]) -> float:
    """Mean validation loss [m^2] over the folds."""
    return float(np.mean([one.training.loss for one in members]))


def _stop_worst(running: Mapping[Trial, Sequence[_FoldTraining]], kept: int) -> set[Trial]:
    """Stop the trials of each model that are not among so many best ones by now, unless they have ended."""
    order = sorted(running, key=lambda trial: (trial[0], np.nan_to_num(_mean_loss(running[trial]), nan=np.inf)))
    per_model = len(order) // len({key for key, _ in order})
    worst = {trial for place, trial in enumerate(order) if place % per_model >= kept}
    going = {trial for trial in worst if any(one.training.running for one in running[trial])}
    for one in (one for trial in going for one in running[trial]):
        one.training.running = False
    return going


def _trained_network(one: _FoldTraining) -> Network:
    """The network of the best epoch."""
    arrays = [*one.training.kept.values()]
    layers = tuple((weight.T, bias) for weight, bias in zip(arrays[::2], arrays[1::2], strict=True))
    return Network(one.varying.features, one.varying.normaliser, np.eye(len(arrays[-1]) // 2), layers)


def train_drawn(task: Task, method: Any, drawn: Mapping[str, FitResult]) -> dict[str, FitResult]:
    """Train the hidden weights of drawn networks; output weights are solved in closed form at every step.

    Variable projection (Golub and Pereyra, 1973), but of the error on runs left out: each step deals the folds anew
    into `PARTS`, and predicts each part by output weights solved without it. What solves them is learned by heart.

    method : a `PathRefined`. drawn : foundation -> what `path-drawn` gives.
    """
    windows, refined = windows_of_folds(task), dict(drawn)
    rows = part_of_runs(task.windows.run[windows], method.search_windows)
    for key, table in shared_tables(task, method.inputs(task.commands)).items():
        fit, start, networks = drawn[key], time.process_time(), []
        if fit.corrector is None:
            continue
        corrector = cast(Compensator, fit.corrector)
        for row, network in zip(best_trials(fit.trials), corrector.networks, strict=False):
            left_out = method.left_out(row["params"])
            taken = {name: values[windows] for name, values in table.items() if input_group(name) not in left_out}
            seen = VaryingInputs.of(taken, bool(row["params"]["mirror"]))
            values, mirror = seen.normaliser.apply(taken), seen.reflection
            mirrors = [np.eye(values.shape[1]), *([] if mirror is None else [mirror])]
            outputs = flatten_paths(np.tensordot(network.basis.T, task.targets[key][:, windows], 1))
            dealt = _deal_folds(task.folds, windows[rows], method.epochs, seed_of(task.seed, row["number"]))
            rate, ridge = method.learning_rate, row["params"]["ridge"]
            layers = train_units(network.layers[0], mirrors, values, outputs, rows, dealt, rate, ridge)
            networks.append(replace(network, layers=layers))
        seconds = fit.seconds + time.process_time() - start
        corrector = replace(corrector, networks=tuple(networks))
        refined[key] = replace(fit, corrector=corrector, seconds=seconds, left_out=None)
    return refined


def _deal_folds(
    folds: Sequence[tuple[Index, Index]], windows: Index, epochs: int, seed: int
) -> Iterator[list[tuple[Tensor, Tensor]]]:
    """Masks (S,) of the windows that train, and of those that are judged, for each part of every epoch."""
    training, judged = (np.stack([np.isin(windows, fold[side]) for fold in folds]) for side in (0, 1))
    generator = np.random.default_rng(seed)
    for _ in range(epochs):
        parts = np.array_split(generator.permutation(len(folds)), min(PARTS, len(folds)))
        yield [
            (torch.from_numpy(training[one].all(axis=0)), torch.from_numpy(judged[one].any(axis=0))) for one in parts
        ]
