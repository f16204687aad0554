"""Tuning by gradients: an Optuna study per model; models with equal architectures train as one stack."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from math import inf, nan

import numpy as np
import optuna
from optuna.distributions import BaseDistribution
from optuna.trial import TrialState

from shipid.hybrid.compensator import Compensator, Network, Normaliser, flatten_paths
from shipid.hybrid.features import Inputs, choose_features
from shipid.hybrid.journal import frozen_trial
from shipid.hybrid.method import FitResult, Row, Task, input_table_key, shared_tables
from shipid.hybrid.search import Search, SearchMethod, best_trials, seed_of, trial_row
from shipid.hybrid.training import Length, StackSettings, train_stack

Stack = Mapping[str, Mapping[str, float]]
"""Models that train together: name -> hyperparameters."""


def tune_gradient(task: Task, method: SearchMethod, inputs: Inputs, length: Length) -> dict[str, FitResult]:
    """Train networks for each foundation.

    The objective is the mean validation loss over the folds; the compensator is the mean of the fold networks of the
    best trial. Foundations with the same inputs and the same architecture in a trial train as one stack. The sampler of
    a trial is seeded by its number, so that a search that goes on after an interruption gives the same digits.
    """
    trainer, search = _StackTrainer(task, method, inputs, length), Search(task, task.cases, method)
    space = method.space()
    studies = {key: _memory_study(rows, space) for key, rows in search.rows.items()}
    best = {key: (inf, _TrialOutcome(-1)) for key in studies}  # of the trials that were trained here
    for number, _ in search.left(count()):
        for key, study in studies.items():  # TPE as the paper's Optuna had it: later defaults differ
            seed = seed_of(task.seed, key, number)
            study.sampler = optuna.samplers.TPESampler(multivariate=False, constant_liar=False, seed=seed)
        trials = {key: study.ask(space) for key, study in studies.items()}
        fixed = {name: getattr(method, name) for name in method.SEARCHED}
        rows: dict[str, Row] = {}
        for stack in trainer.stacks({key: fixed | trial.params for key, trial in trials.items()}):
            start = time.process_time()
            outcomes = trainer.train(stack, number)
            for key, one in outcomes.items():
                rows[key] = trial_row(number, stack[key], one.value, start, one.epochs)
                best[key] = min(
                    best[key], (rows[key]["value"], one), key=lambda pair: inf if np.isnan(pair[0]) else pair[0]
                )
            for key in stack:
                rows[key]["seconds"] /= len(stack)
        for key, trial in trials.items():
            complete = rows[key]["state"] == "complete"
            told = (rows[key]["value"], TrialState.COMPLETE) if complete else (None, TrialState.FAIL)
            studies[key].tell(trial, *told)
        search.record({key: rows[key] for key in studies})
    return {key: trainer.fitted(key, search.rows, best[key][1]) for key in studies}


def _memory_study(rows: Sequence[Row], space: Mapping[str, BaseDistribution]) -> optuna.Study:
    """Make a study in memory that knows the trials so far."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(direction="minimize")
    study.add_trials([frozen_trial(row, space) for row in rows])
    return study


@dataclass(frozen=True)
class _TrialOutcome:
    """A trial of a model: networks of the folds, mean validation loss [m^2], nan where one diverged, and epochs."""

    number: int
    networks: tuple[Network, ...] = ()
    value: float = nan
    epochs: int = 0


class _StackTrainer:
    """What all trials share: inputs, targets and folds."""

    def __init__(self, task: Task, method: SearchMethod, inputs: Inputs, length: Length) -> None:
        self.task, self.method, self.inputs, self.length = task, method, inputs, length
        self.tables = shared_tables(task, inputs)
        self.outputs = {key: flatten_paths(paths) for key, paths in task.targets.items()}

    def stacks(self, asked: Stack) -> list[Stack]:
        """Group models by inputs and architecture, in the order of their first member."""
        stacks: dict[tuple[object, ...], dict[str, Mapping[str, float]]] = {}
        for key, parameters in asked.items():
            alike = (input_table_key(self.tables[key]), *(parameters[name] for name in self.method.COUNTS))
            stacks.setdefault(alike, {})[key] = parameters
        return list(stacks.values())

    def train(self, stack: Stack, number: int) -> dict[str, _TrialOutcome]:
        """Train the networks of a stack in a trial, those of each fold together."""
        table, outputs = self.tables[next(iter(stack))], np.stack([self.outputs[key] for key in stack])
        made: dict[str, list[tuple[Network, float, int]]] = {key: [] for key in stack}
        for i, (training, validation) in enumerate(self.task.folds):
            entropy = self.task.seed, number, i
            seen = {name: values[training] for name, values in table.items()}
            features = choose_features(seen)
            normaliser = Normaliser.fit(seen, tuple(features))
            trained = train_stack(
                normaliser.apply(table),
                outputs,
                training,
                validation,
                _stack_settings(list(stack.values()), self.length),
                [seed_of(*entropy, key) for key in stack],
                order_seed=seed_of(*entropy),
                device=self.task.device,
            )
            for k, key in enumerate(stack):
                network = Network(features, normaliser, np.eye(outputs.shape[-1] // 2), trained.layers[k])
                loss = float(trained.loss[k]) if trained.status[k] == "ok" else nan
                made[key].append((network, loss, int(trained.epochs[k])))
        return {key: _outcome_of_folds(number, results) for key, results in made.items()}

    def fitted(self, key: str, rows: Mapping[str, list[Row]], best: _TrialOutcome) -> FitResult:
        """The networks of the best trial; those of an earlier session are trained once more, in the same stack."""
        seconds = sum(row["seconds"] for row in rows[key])
        kept = best_trials(rows[key])
        if not kept:
            return FitResult(None, rows[key], seconds)
        number = kept[0]["number"]
        if number != best.number:
            stacks = self.stacks({name: mine[number]["params"] for name, mine in rows.items()})
            best = self.train(next(stack for stack in stacks if key in stack), number)[key]
        return FitResult(Compensator(self.inputs, best.networks, kept[0]["params"]), rows[key], seconds)


def _stack_settings(members: Sequence[Mapping[str, float]], length: Length) -> StackSettings:
    """Structure and hyperparameters of the members of a stack."""
    return StackSettings(
        layers=int(members[0]["layers"]),
        units=int(members[0]["units"]),
        learning_rate=tuple(one["learning_rate"] for one in members),
        weight_decay=tuple(one["weight_decay"] for one in members),
        input_dropout=tuple(one["input_dropout"] for one in members),
        hidden_dropout=tuple(one["hidden_dropout"] for one in members),
        length=length,
    )


def _outcome_of_folds(number: int, results: Sequence[tuple[Network, float, int]]) -> _TrialOutcome:
    """A trial by the networks, losses and epochs of its folds."""
    networks, losses, epochs = zip(*results, strict=True)
    return _TrialOutcome(number, networks, float(np.mean(losses)), max(epochs))
