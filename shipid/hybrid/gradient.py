"""Tuning by gradients: an Optuna study per model; models with equal architectures train as one stack."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from math import inf, isfinite, nan
from typing import TYPE_CHECKING

import numpy as np
import optuna
from optuna.trial import TrialState

from shipid.hybrid.compensator import Compensator, Network, Normaliser, flatten
from shipid.hybrid.features import Inputs, choose_features
from shipid.hybrid.journal import distributions, frozen
from shipid.hybrid.method import Array, Fitted, Index, Row, Task, same_table, shared_tables
from shipid.hybrid.search import Search
from shipid.hybrid.settings import seed_of
from shipid.hybrid.training import Settings, train
from shipid.hybrid.trials import best_of

if TYPE_CHECKING:
    from shipid.hybrid.path_trained import PathTrained

Parameters = dict[str, float]


def tune_gradient(task: Task, method: PathTrained) -> dict[str, Fitted]:
    """Train networks for each foundation.

    The objective is the mean validation loss over the folds; the compensator is the mean of the fold networks of the
    best trial. Foundations with the same inputs and the same architecture in a trial train as one stack. The sampler of
    a trial is seeded by its number, so that a search that goes on after an interruption gives the same digits.
    """
    trainer = _Trainer(task, method)
    names = list(task.cases)
    search = Search(task, names, method)
    studies = {key: _study(search.rows[key], method) for key in names}
    best = {key: _Best() for key in names}
    for number, _ in search.left(count()):
        trials = {}
        for key, study in studies.items():
            study.sampler = _sampler(seed_of(task.seed, key, number))
            trials[key] = study.ask(distributions(method.space()))
        fixed = {name: getattr(method, name) for name in method.SEARCHED}
        asked: dict[str, Parameters] = {key: fixed | trial.params for key, trial in trials.items()}
        rows: dict[str, Row] = {}
        for stack in trainer.stacks(asked):
            start = time.process_time()
            results = trainer.train(stack, number)
            seconds = (time.process_time() - start) / len(stack)
            for key, parameters in stack.items():
                rows[key] = _row(number, parameters, results[key], seconds)
                best[key].consider(rows[key], results[key])
        for key, trial in trials.items():
            if rows[key]["state"] == "complete":
                studies[key].tell(trial, rows[key]["value"])
            else:
                studies[key].tell(trial, state=TrialState.FAIL)
        search.record({key: rows[key] for key in names})
    return {key: trainer.fitted(key, search, best[key]) for key in names}


@dataclass
class _Best:
    """The networks of the best trial that was trained here; none at first."""

    number: int = -1
    value: float = inf
    networks: tuple[Network, ...] = ()

    def consider(self, row: Row, results: Sequence[_Result]) -> None:
        if row["state"] == "complete" and row["value"] < self.value:
            self.number, self.value = row["number"], row["value"]
            self.networks = tuple(result.network for result in results)


class _Trainer:
    """What all trials share: inputs, targets and folds."""

    def __init__(self, task: Task, method: PathTrained) -> None:
        self.task, self.method = task, method
        self.inputs = Inputs(task.commands, method.memory)
        self.tables = shared_tables(task, self.inputs)
        self.outputs = {key: flatten(paths) for key, paths in task.targets.items()}
        self.data = {
            key: [_prepare(table, training, validation) for training, validation in task.folds]
            for key, table in self.tables.items()
        }

    def stacks(self, asked: Mapping[str, Parameters]) -> list[dict[str, Parameters]]:
        """Group models by inputs and architecture, in the order of their first member."""
        stacks: dict[tuple[object, ...], dict[str, Parameters]] = {}
        for key, parameters in asked.items():
            alike = (same_table(self.tables[key]), *(parameters[name] for name in self.method.COUNTS))
            stacks.setdefault(alike, {})[key] = parameters
        return list(stacks.values())

    def train(self, stack: Mapping[str, Parameters], number: int) -> dict[str, list[_Result]]:
        """Train the networks of a stack in a trial: model -> a result of each fold."""
        outputs = {key: self.outputs[key] for key in stack}
        folds = [
            _fit(fold, outputs, stack, self.method, (self.task.seed, number, i), self.task.device)
            for i, fold in enumerate(self.data[next(iter(stack))])
        ]
        return {key: [results[key] for results in folds] for key in stack}

    def fitted(self, key: str, search: Search, best: _Best) -> Fitted:
        """The networks of the best trial; those of an earlier session are trained once more, in the same stack."""
        rows = search.rows[key]
        seconds = sum(row["seconds"] for row in rows)
        kept = best_of(rows)
        if not kept:
            return Fitted(None, rows, seconds)
        number, networks = kept[0]["number"], best.networks
        if number != best.number:
            asked = {name: mine[number]["params"] for name, mine in search.rows.items()}
            stack = next(stack for stack in self.stacks(asked) if key in stack)
            networks = tuple(result.network for result in self.train(stack, number)[key])
        return Fitted(Compensator(self.inputs, networks, kept[0]["params"]), rows, seconds)


@dataclass(frozen=True)
class _Data:
    """One fold as networks see it."""

    features: dict[str, tuple[str, ...]]
    normaliser: Normaliser
    inputs: Array
    train_idx: Index
    val_idx: Index


@dataclass(frozen=True)
class _Result:
    """One trained network, its validation loss [m^2], its epochs and its status."""

    network: Network
    loss: float
    epochs: int
    status: str


def _row(number: int, parameters: Parameters, results: Sequence[_Result], seconds: float) -> Row:
    value = float(np.mean([result.loss for result in results]))
    complete = isfinite(value) and all(result.status == "ok" for result in results)
    row = {"number": number, "params": parameters, "value": value if complete else nan, "seconds": seconds}
    return row | {"epochs": max(r.epochs for r in results), "state": "complete" if complete else "diverged"}


def _prepare(table: Mapping[str, Array], training: Index, validation: Index) -> _Data:
    """Choose and normalise the inputs by the training windows alone."""
    seen = {name: values[training] for name, values in table.items()}
    features = choose_features(seen)
    normaliser = Normaliser.fit(seen, tuple(features))
    return _Data(features, normaliser, normaliser.apply(table), training, validation)


def _fit(
    data: _Data,
    targets: Mapping[str, Array],
    stack: Mapping[str, Parameters],
    method: PathTrained,
    entropy: tuple[int, ...],
    device: str,
) -> dict[str, _Result]:
    """Train one network per model of a stack on one fold."""
    first = next(iter(stack.values()))
    settings = Settings(
        layers=int(first["layers"]),
        units=int(first["units"]),
        learning_rate=tuple(p["learning_rate"] for p in stack.values()),
        weight_decay=tuple(p["weight_decay"] for p in stack.values()),
        input_dropout=tuple(p["input_dropout"] for p in stack.values()),
        hidden_dropout=tuple(p["hidden_dropout"] for p in stack.values()),
        epochs=method.epochs,
        batch=method.batch,
        patience=method.patience,
    )
    outputs = np.stack([targets[key] for key in stack])
    basis = np.eye(outputs.shape[-1] // 2)
    trained = train(
        data.inputs,
        outputs,
        data.train_idx,
        data.val_idx,
        settings,
        [seed_of(*entropy, key) for key in stack],
        order_seed=seed_of(*entropy),
        device=device,
    )
    return {
        key: _Result(
            Network(data.features, data.normaliser, basis, trained.layers[k]),
            float(trained.loss[k]),
            int(trained.epochs[k]),
            trained.status[k],
        )
        for k, key in enumerate(stack)
    }


def _study(rows: Sequence[Row], method: PathTrained) -> optuna.Study:
    """Make a study in memory that knows the trials so far."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(direction="minimize")
    where = distributions(method.space())
    study.add_trials([frozen(row, where) for row in rows])
    return study


def _sampler(seed: int) -> optuna.samplers.TPESampler:
    """TPE as the paper's Optuna had it: later defaults differ."""
    return optuna.samplers.TPESampler(multivariate=False, constant_liar=False, seed=seed)
