"""Tuning by gradients: an Optuna study per model; models with equal architectures train as one stack."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count

import numpy as np
import optuna
from optuna.trial import TrialState

from shipid.hybrid.compensator import Compensator, Network, Normaliser, flatten_paths
from shipid.hybrid.features import Inputs, choose_features
from shipid.hybrid.journal import frozen_trial
from shipid.hybrid.method import FitResult, Row, Task, input_table_key, shared_tables
from shipid.hybrid.search import Search, SearchMethod, best_trials, seed_of, trial_row
from shipid.hybrid.training import Length, train_stack

Stack = Mapping[str, Mapping[str, float]]
"""Models that train together: name -> hyperparameters."""


def tune_gradient(task: Task, method: SearchMethod, inputs: Inputs, length: Length) -> dict[str, FitResult]:
    """Train networks for each foundation.

    The objective is the mean validation loss over the folds; the compensator is the mean of the fold networks of the
    best trial. Foundations with the same inputs and architecture in a trial train as one stack. The sampler of a trial
    is seeded by its number.
    """
    trainer, search = _StackTrainer(task, method, inputs, length), Search(task, task.cases, method)
    space = method.space()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    studies = {key: optuna.create_study(direction="minimize") for key in search.rows}
    for key, study in studies.items():
        study.add_trials([frozen_trial(row, space) for row in search.rows[key]])
    best: dict[str, _TrialOutcome] = {}  # of the trials that were trained here
    for number, _ in search.left(count()):
        for key, study in studies.items():  # TPE as the paper's Optuna had it: later defaults differ
            seed = seed_of(task.seed, key, number)
            study.sampler = optuna.samplers.TPESampler(multivariate=False, constant_liar=False, seed=seed)
        trials = {key: study.ask(space) for key, study in studies.items()}
        fixed = {name: getattr(method, name) for name in method.SEARCHED}
        rows: dict[str, Row] = {}
        for stack in trainer.stacks({key: fixed | trial.params for key, trial in trials.items()}):
            start = time.process_time()
            for key, one in trainer.train(stack, number).items():
                rows[key] = trial_row(number, stack[key], one.value, start, one.epochs)
                rows[key]["seconds"] /= len(stack)
                if key not in best or one.value < best[key].value or np.isnan(best[key].value):
                    best[key] = one
        for key, trial in trials.items():
            complete = rows[key]["state"] == "complete"
            told = (rows[key]["value"], TrialState.COMPLETE) if complete else (None, TrialState.FAIL)
            studies[key].tell(trial, *told)
        search.record({key: rows[key] for key in studies})
    return {key: trainer.fitted(key, search.rows, best.get(key)) for key in studies}


@dataclass(frozen=True)
class _TrialOutcome:
    """A trial of a model: networks of the folds, mean validation loss [m^2], nan where one diverged, and epochs."""

    number: int
    networks: tuple[Network, ...]
    value: float
    epochs: int


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
        networks: dict[str, list[Network]] = {key: [] for key in stack}
        losses, epochs = [], []
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
                list(stack.values()),
                self.length,
                [seed_of(*entropy, key) for key in stack],
                order_seed=seed_of(*entropy),
                device=self.task.device,
            )
            losses.append(trained.loss)
            epochs.append(trained.epochs)
            for key, layers in zip(stack, trained.layers, strict=True):
                networks[key].append(Network(features, normaliser, np.eye(outputs.shape[-1] // 2), layers))
        made = zip(stack, np.transpose(losses), np.max(epochs, axis=0), strict=True)
        return {
            key: _TrialOutcome(number, tuple(networks[key]), float(np.mean(mine)), int(most))
            for key, mine, most in made
        }

    def fitted(self, key: str, rows: Mapping[str, list[Row]], best: _TrialOutcome | None) -> FitResult:
        """The networks of the best trial; those of an earlier session are trained once more, in the same stack."""
        seconds = sum(row["seconds"] for row in rows[key])
        kept = best_trials(rows[key])
        if not kept:
            return FitResult(None, rows[key], seconds)
        number = kept[0]["number"]
        if best is None or number != best.number:
            stacks = self.stacks({name: mine[number]["params"] for name, mine in rows.items()})
            best = self.train(next(stack for stack in stacks if key in stack), number)[key]
        return FitResult(Compensator(self.inputs, best.networks, kept[0]["params"]), rows[key], seconds)
