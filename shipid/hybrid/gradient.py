"""Tuning by gradients: an Optuna study per model; models with equal architectures train as one stack."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, ClassVar, Protocol

import numpy as np
import optuna
from optuna.trial import Trial, TrialState

from shipid.hybrid.compensator import Compensator, Network, Normaliser, flatten
from shipid.hybrid.features import Inputs, Memory, choose_features
from shipid.hybrid.method import Array, Fitted, Index, Task, same_table, shared_tables
from shipid.hybrid.settings import seed_of
from shipid.hybrid.training import Settings, train

Parameters = dict[str, float]


class Trained(Protocol):
    """Settings of the search, see `shipid.hybrid.path_trained.PathTrained`."""

    SEARCHED: ClassVar[tuple[str, ...]]
    COUNTS: ClassVar[tuple[str, ...]]
    LOGARITHMIC: ClassVar[tuple[str, ...]]

    @property
    def trials(self) -> int: ...  # noqa: D102
    @property
    def epochs(self) -> int: ...  # noqa: D102
    @property
    def batch(self) -> int: ...  # noqa: D102
    @property
    def patience(self) -> int: ...  # noqa: D102
    @property
    def memory(self) -> Memory: ...  # noqa: D102
    def ranges(self) -> dict[str, tuple[float, float]]: ...  # noqa: D102


def tune_gradient(task: Task, method: Trained) -> dict[str, Fitted]:
    """Train networks for each foundation.

    The objective is the mean validation loss over the folds; the compensator is the mean of the fold networks of the
    best trial. Foundations with the same inputs and the same architecture in a trial train as one stack.
    """
    inputs = Inputs(task.commands, method.memory)
    tables = shared_tables(task, inputs)
    outputs = {key: flatten(paths) for key, paths in task.targets.items()}
    data = {key: [_prepare(tables[key], training, validation) for training, validation in task.folds] for key in tables}
    runs = {key: _Run(_study(seed_of(task.seed, key))) for key in outputs}

    for number in range(method.trials):
        trials = {key: run.study.ask() for key, run in runs.items()}
        asked = {key: _suggest(trial, method) for key, trial in trials.items()}
        for stack in _stacks(asked, tables, method.COUNTS):
            start = time.perf_counter()
            some = next(iter(stack))
            results = [
                _fit(fold, {key: outputs[key] for key in stack}, stack, method, (task.seed, number, i), task.device)
                for i, fold in enumerate(data[some])
            ]
            seconds = (time.perf_counter() - start) / len(stack)
            for key, parameters in stack.items():
                runs[key].record(parameters, [result[key] for result in results], seconds)
        for key, run in runs.items():
            run.tell(trials[key])
        if task.on_trial is not None:
            task.on_trial(number + 1, method.trials)

    return {key: run.fitted(inputs) for key, run in runs.items()}


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


class _Run:
    """The study of one model: its rows and its best networks so far."""

    def __init__(self, study: optuna.Study) -> None:
        self.study = study
        self.rows: list[dict[str, Any]] = []
        self.seconds = 0.0
        self.best_value = inf
        self.best_parameters: Parameters = {}
        self.best_networks: tuple[Network, ...] = ()

    def record(self, parameters: Parameters, results: Sequence[_Result], seconds: float) -> None:
        value = float(np.mean([result.loss for result in results]))
        complete = isfinite(value) and all(result.status == "ok" for result in results)
        row = {"number": len(self.rows), "params": parameters, "value": value, "seconds": seconds}
        row |= {"epochs": max(r.epochs for r in results), "state": "complete" if complete else "diverged"}
        self.rows.append(row)
        self.seconds += seconds
        if complete and value < self.best_value:
            self.best_value, self.best_parameters = value, parameters
            self.best_networks = tuple(result.network for result in results)

    def tell(self, trial: Trial) -> None:
        if self.rows[-1]["state"] == "complete":
            self.study.tell(trial, self.rows[-1]["value"])
        else:
            self.study.tell(trial, state=TrialState.FAIL)

    def fitted(self, inputs: Inputs) -> Fitted:
        found = Compensator(inputs, self.best_networks, self.best_parameters) if self.best_networks else None
        return Fitted(found, self.rows, self.seconds)


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
    method: Trained,
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


def _stacks(
    asked: Mapping[str, Parameters], tables: Mapping[str, Mapping[str, Array]], counts: Sequence[str]
) -> list[dict[str, Parameters]]:
    """Group models by inputs and architecture, in the order of their first member."""
    stacks: dict[tuple[object, ...], dict[str, Parameters]] = {}
    for key, parameters in asked.items():
        alike = (same_table(tables[key]), *(parameters[name] for name in counts))
        stacks.setdefault(alike, {})[key] = parameters
    return list(stacks.values())


def _study(seed: int) -> optuna.Study:
    """Make a study in memory with TPE as the paper's Optuna had it: later defaults differ."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    sampler = optuna.samplers.TPESampler(multivariate=False, constant_liar=False, seed=seed)
    return optuna.create_study(direction="minimize", sampler=sampler)


def _suggest(trial: Trial, method: Trained) -> Parameters:
    """Take each hyperparameter from the trial where the method has a range, else from the method."""
    parameters: Parameters = {name: getattr(method, name) for name in method.SEARCHED}
    for name, (low, high) in method.ranges().items():
        if name in method.COUNTS:
            parameters[name] = trial.suggest_int(name, int(low), int(high))
        else:
            parameters[name] = trial.suggest_float(name, low, high, log=name in method.LOGARITHMIC)
    return parameters
