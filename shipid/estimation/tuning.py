"""Tuning: an Optuna study per model, all asked and told in step, so that equal architectures train as one stack."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any
from zlib import crc32

import numpy as np
import optuna
from numpy.typing import NDArray
from optuna.trial import Trial, TrialState

from shipid.errors import DataError
from shipid.estimation.compensator import (
    Compensator,
    Network,
    Normaliser,
    choose_features,
    feature_table,
    flatten,
    unflatten,
)
from shipid.estimation.recipe import COUNTS, LOGARITHMIC, SEARCHED, Recipe, sequence
from shipid.estimation.training import Settings, train

__all__ = ["Recipe", "Tuned", "tune"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Parameters = dict[str, float]


@dataclass(frozen=True)
class Tuned:
    """What tuning found for one model.

    Parameters
    ----------
    compensator : the best; None where every trial diverged (targets that are not numbers).
    trials : a row each: number, params, value [m^2], epochs, seconds, state (`complete` or `diverged`).
    seconds : time spent on this model, its share of each stack.
    """

    compensator: Compensator | None
    trials: list[dict[str, Any]]
    seconds: float


def tune(
    columns: Mapping[str, Array],
    commands: Sequence[str],
    targets: Mapping[str, Array],
    folds: Sequence[tuple[Index, Index]],
    recipe: Recipe,
    seed: int,
    *,
    on_trial: Callable[[int, int], None] | None = None,
    device: str = "cpu",
) -> dict[str, Tuned]:
    """Tune a compensator for each model on the same windows.

    The objective is the mean validation loss over the folds. The compensator is the mean of the fold networks of the
    best trial or, with `refit`, of networks trained on all the windows of the folds with the best hyperparameters.

    Parameters
    ----------
    columns : quantities (S,) at the instants of prediction, SI and radians.
    commands : names of the command columns.
    targets : model -> (T, S, 2) [m] what its physics misses, or the path itself for pure data-driven.
    folds : (training, validation) indices of windows, split by manoeuvre; one pair, or one per fold.
    recipe : what is searched, and how a network is trained.
    seed : of all that is random; a model's result depends on its name, not on its company.
    on_trial : called with (trials done, trials in all) after each trial of all models.
    device : a PyTorch device.

    Raises
    ------
    DataError : a column is missing, or a fold has no windows to train on or to validate with.
    """
    if any(len(part) == 0 for fold in folds for part in fold):
        raise DataError("a fold has no windows to train on or to validate with: use more manoeuvres")
    table = feature_table(columns, commands)
    outputs = {key: flatten(paths) for key, paths in targets.items()}
    data = [_prepare(table, outputs, training, validation) for training, validation in folds]
    runs = {key: _Run(_study(recipe, _seed(seed, key))) for key in targets}

    for number in range(recipe.trials):
        trials = {key: run.study.ask() for key, run in runs.items()}
        asked = {key: _suggest(trial, recipe) for key, trial in trials.items()}
        for stack in _stacks(asked):
            start = time.perf_counter()
            results = [_fit(fold, stack, recipe, (seed, number, i), device) for i, fold in enumerate(data)]
            seconds = (time.perf_counter() - start) / len(stack)
            for key, parameters in stack.items():
                runs[key].record(parameters, [result[key] for result in results], seconds)
        for key, run in runs.items():
            run.tell(trials[key])
        if on_trial is not None:
            on_trial(number + 1, recipe.trials)

    if recipe.refit:
        everything = np.unique(np.concatenate([part for fold in folds for part in fold]))
        whole = _prepare(table, outputs, everything, None)
        for stack in _stacks({key: run.best_parameters for key, run in runs.items() if run.best_networks}):
            start = time.perf_counter()
            results = [_fit(whole, stack, recipe, (seed, recipe.trials, i), device) for i in range(recipe.refit)]
            seconds = (time.perf_counter() - start) / len(stack)
            for key in stack:
                runs[key].replace([result[key] for result in results], seconds)
    return {key: run.tuned(tuple(commands)) for key, run in runs.items()}


@dataclass(frozen=True)
class _Data:
    """One fold as networks see it; `val_idx` is None where nothing is watched."""

    features: dict[str, tuple[str, ...]]
    normaliser: Normaliser
    inputs: Array
    outputs: dict[str, Array]
    train_idx: Index
    val_idx: Index | None


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

    def replace(self, results: Sequence[_Result], seconds: float) -> None:
        self.seconds += seconds
        if all(result.status == "ok" for result in results):
            self.best_networks = tuple(result.network for result in results)

    def tuned(self, commands: tuple[str, ...]) -> Tuned:
        found = Compensator(commands, self.best_networks, self.best_parameters) if self.best_networks else None
        return Tuned(found, self.rows, self.seconds)


def _prepare(table: Mapping[str, Array], outputs: dict[str, Array], training: Index, validation: Index | None) -> _Data:
    """Choose and normalise the inputs by the training windows alone."""
    seen = {name: values[training] for name, values in table.items()}
    features = choose_features(seen)
    normaliser = Normaliser.fit(seen, tuple(features))
    return _Data(features, normaliser, normaliser.apply(table), outputs, training, validation)


def _fit(
    data: _Data, stack: Mapping[str, Parameters], recipe: Recipe, entropy: tuple[int, ...], device: str
) -> dict[str, _Result]:
    """Train one network per model of a stack on one fold."""
    first = next(iter(stack.values()))
    batch = min(recipe.batch or len(data.train_idx), len(data.train_idx))
    settings = Settings(
        layers=int(first["layers"]),
        units=int(first["units"]),
        learning_rate=tuple(p["learning_rate"] for p in stack.values()),
        weight_decay=tuple(p["weight_decay"] for p in stack.values()),
        input_dropout=tuple(p["input_dropout"] for p in stack.values()),
        hidden_dropout=tuple(p["hidden_dropout"] for p in stack.values()),
        epochs=max(recipe.epochs, -(-recipe.min_steps // -(-len(data.train_idx) // batch))),
        batch=recipe.batch,
        patience=recipe.patience,
        one_cycle=recipe.one_cycle,
    )
    outputs = np.stack([data.outputs[key] for key in stack])
    scale = _scale(outputs[:, data.train_idx]) if recipe.scale_targets else np.ones(outputs[:, 0].shape)
    trained = train(
        data.inputs,
        outputs,
        data.train_idx,
        data.val_idx,
        settings,
        [_seed(*entropy, key) for key in stack],
        scale=scale,
        order_seed=_seed(*entropy),
        device=device,
    )
    return {
        key: _Result(
            Network(data.features, data.normaliser, unflatten(scale[k : k + 1])[:, 0], trained.layers[k]),
            float(trained.loss[k]),
            int(trained.epochs[k]),
            trained.status[k],
        )
        for k, key in enumerate(stack)
    }


def _scale(outputs: Array) -> Array:
    """Size (K, 2 T) [m] of outputs (K, n, 2 T): the geometric mean of the rms distance at a step and that at all steps.

    By the step alone, the noise of the first steps weighs as much as the metres of the last; by all alone, the first
    steps weigh nothing. x and y share a size because the metrics know only distance.
    """
    x, y = np.split(np.square(outputs).mean(axis=1), 2, axis=1)
    per_step = (x + y) / 2
    size = (per_step * per_step.mean(axis=1, keepdims=True)) ** 0.25
    size = np.where(size > 0, size, 1.0)  # an exact model misses nothing
    return np.concatenate([size, size], axis=1)


def _stacks(asked: Mapping[str, Parameters]) -> list[dict[str, Parameters]]:
    """Group models by architecture, in the order of their first member."""
    stacks: dict[tuple[float, ...], dict[str, Parameters]] = {}
    for key, parameters in asked.items():
        stacks.setdefault(tuple(parameters[name] for name in COUNTS), {})[key] = parameters
    return list(stacks.values())


def _study(recipe: Recipe, seed: int) -> optuna.Study:
    """Make a study in memory; TPE as the paper's Optuna had it (later defaults differ), or with its trials laid out."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    sampler: optuna.samplers.BaseSampler
    if recipe.sampler == "tpe":
        sampler = optuna.samplers.TPESampler(multivariate=False, constant_liar=False, seed=seed)
    else:
        sampler = optuna.samplers.RandomSampler(seed=seed)  # never asked: all trials are enqueued
    study = optuna.create_study(direction="minimize", sampler=sampler)
    if recipe.sampler == "sequence":
        for parameters in sequence(recipe.ranges(), recipe.trials):
            study.enqueue_trial(parameters)
    return study


def _suggest(trial: Trial, recipe: Recipe) -> Parameters:
    """Take each hyperparameter from the trial where the recipe has a range, else from the recipe."""
    parameters: Parameters = {name: getattr(recipe, name) for name in SEARCHED}
    for name, (low, high) in recipe.ranges().items():
        if name in COUNTS:
            parameters[name] = trial.suggest_int(name, int(low), int(high))
        else:
            parameters[name] = trial.suggest_float(name, low, high, log=name in LOGARITHMIC)
    return parameters


def _seed(*entropy: int | str) -> int:
    """Draw a seed from numbers and names, the same on every machine."""
    words = [crc32(part.encode()) if isinstance(part, str) else part for part in entropy]
    return int(np.random.SeedSequence(words).generate_state(1)[0])
