"""Tuning by gradients: an Optuna study per model; networks that are alike train as one stack, and trials may race.

With `at_once` above 1 so many trials are proposed at a time, and race: the better half of those of a model goes on
(successive halving: Jamieson and Talwalkar, 2016). Where all trials run to their end, most of the time goes into those
that are hopeless early.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np

from shipid.hybrid.compensator import Compensator, Network, flatten_paths
from shipid.hybrid.features import Inputs
from shipid.hybrid.method import FitResult, Row, Task, input_table_key, shared_tables
from shipid.hybrid.search import (
    Search,
    SearchMethod,
    best_trials,
    seed_of,
    suggested_points,
    trial_row,
)
from shipid.hybrid.training import Learner, Length, StackTraining
from shipid.hybrid.units import VaryingInputs

Trial = tuple[str, int]
"""Model and number."""
HALVINGS = 4  # of the epochs, down to those after which the first trials of a race stop; with 6 slow ones are lost


def tune_gradient(
    task: Task, method: SearchMethod, inputs: Inputs, length: Length, at_once: int = 1
) -> dict[str, FitResult]:
    """Train networks for each foundation.

    The objective is the mean validation error over the folds; the compensator is the mean of the fold networks of the
    best trial. The sampler of a trial is seeded by its number.

    at_once : trials that are proposed at a time; more than one race.
    """
    trainer, search = _Trainer(task, inputs, length), Search(task, task.cases, method)
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
    return {key: trainer.fitted(key, search.rows, best.get(key), at_once) for key in search.rows}


@dataclass(frozen=True, eq=False)
class _StackMember:
    """A network in training: its trial and fold, what its inputs are, its data."""

    trial: Trial
    fold: int
    varying: VaryingInputs
    learner: Learner


_TrialOutcome = tuple[Row, tuple[Network, ...]]  # the row of a trial, and the networks of the folds
_RunningStack = tuple[list[_StackMember], StackTraining]


class _Trainer:
    """What all trials share: inputs, targets and folds."""

    def __init__(self, task: Task, inputs: Inputs, length: Length) -> None:
        self.task, self.inputs, self.length = task, inputs, length
        self.tables = shared_tables(task, inputs)
        self.targets = {key: flatten_paths(paths) for key, paths in task.targets.items()}

    def _stacks(self, asked: Mapping[Trial, Mapping[str, float]]) -> list[list[_StackMember]]:
        """Members of all trials and folds; those that are alike as one stack."""
        stacks: dict[object, list[_StackMember]] = defaultdict(list)
        for (key, number), settings in asked.items():
            for fold, (training, validation) in enumerate(self.task.folds):
                table, seed = self.tables[key], seed_of(self.task.seed, number, fold, key)
                varying = VaryingInputs.of({name: values[training] for name, values in table.items()}, mirror=False)
                values = varying.normaliser.apply(table)
                learner = Learner(values, self.targets[key], training, validation, settings, seed)
                alike = number, fold, input_table_key(table), settings["layers"], settings["units"]
                stacks[alike].append(_StackMember((key, number), fold, varying, learner))
        return list(stacks.values())

    def train(self, asked: Mapping[Trial, Mapping[str, float]]) -> dict[Trial, _TrialOutcome]:
        """Train the networks of some trials; several of a model race."""
        running = [
            (
                members,
                StackTraining(
                    [one.learner for one in members],
                    self.length,
                    order_seed=seed_of(self.task.seed, members[0].trial[1], members[0].fold),
                    device=self.task.device,
                ),
            )
            for members in self._stacks(asked)
        ]
        seconds = dict.fromkeys(asked, 0.0)
        stopped: set[Trial] = set()
        per_model = len(asked) // len(self.tables)
        ends = [self.length.epochs >> halving for halving in range(HALVINGS if per_model > 1 else 0, -1, -1)]
        for place, (before, epoch) in enumerate(pairwise([0, *filter(None, ends)]), start=1):
            for members, training in running:
                start = time.process_time()
                training.advance(epoch - before)
                spent = (time.process_time() - start) / len(members)
                for one in members:
                    seconds[one.trial] += spent
            if epoch < self.length.epochs:
                stopped |= _stop_worst(running, ceil(per_model / 2**place))
        outcomes = {}
        for trial, (value, epochs, networks) in _gather_trials(running).items():
            row = trial_row(trial[1], asked[trial], value, 0.0, epochs) | {"seconds": seconds[trial]}
            if trial in stopped and row["state"] == "complete":
                row["state"] = "stopped"
            outcomes[trial] = row, networks
        return outcomes

    def fitted(self, key: str, rows: Mapping[str, list[Row]], best: _TrialOutcome | None, at_once: int) -> FitResult:
        """The networks of the best trial; those of an earlier session are trained once more, in the same company."""
        seconds = sum(row["seconds"] for row in rows[key])
        kept = best_trials(rows[key])
        if not kept:
            return FitResult(None, rows[key], seconds)
        number = kept[0]["number"]
        if best is None or number != best[0]["number"]:
            first = number - number % at_once
            again = {  # in the order of the first training, so that stacks hold the same members
                (name, place): rows[name][place]["params"]
                for place in range(first, min(first + at_once, len(rows[key])))
                for name in rows
            }
            best = self.train(again)[key, number]
        return FitResult(Compensator(self.inputs, best[1], kept[0]["params"]), rows[key], seconds)


def _stop_worst(running: list[_RunningStack], kept: int) -> set[Trial]:
    """Stop the trials of each model that are not among so many best ones by now, unless they have ended."""
    losses, going = defaultdict(list), set()
    for members, training in running:
        for one, loss, goes in zip(members, training.losses(), training.best.running.tolist(), strict=True):
            losses[one.trial].append(loss)
            going |= {one.trial} if goes else set()
    order = sorted(losses, key=lambda trial: (trial[0], np.nan_to_num(np.mean(losses[trial]), nan=np.inf)))
    per_model = len(order) // len({key for key, _ in order})
    worst = {trial for place, trial in enumerate(order) if place % per_model >= kept} & going
    for members, training in running:
        for k, one in enumerate(members):
            if one.trial in worst:
                training.best.running[k] = False
    return worst


def _gather_trials(running: list[_RunningStack]) -> dict[Trial, tuple[float, int, tuple[Network, ...]]]:
    """Mean validation loss [m^2] over the folds, the most epochs of a fold, and the networks, for each trial."""
    ended: dict[Trial, list[tuple[int, float, int, Network]]] = defaultdict(list)
    for members, training in running:
        parts = zip(members, training.losses(), training.best.epochs.tolist(), training.layers(), strict=True)
        for one, loss, epochs, layers in parts:
            basis = np.eye(one.learner.targets.shape[1] // 2)
            network = Network(one.varying.features, one.varying.normaliser, basis, layers)
            ended[one.trial].append((one.fold, float(loss), epochs, network))
    return {
        trial: (
            float(np.mean([loss for _, loss, _, _ in folds])),
            max(epochs for _, _, epochs, _ in folds),
            tuple(network for _, _, _, network in sorted(folds, key=lambda fold: fold[0])),
        )
        for trial, folds in ended.items()
    }
