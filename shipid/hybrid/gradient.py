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
from itertools import count, pairwise
from math import ceil

import numpy as np
import optuna

from shipid.hybrid.compensator import Compensator, Layers, Network, flatten_paths, smooth_basis
from shipid.hybrid.features import Inputs, input_group
from shipid.hybrid.journal import TRIAL_STATES, frozen_trial
from shipid.hybrid.method import Array, FitResult, Row, Task, input_table_key, shared_tables
from shipid.hybrid.search import (
    Search,
    SearchMethod,
    best_trials,
    mean_squared_error,
    seed_of,
    setting_at_share,
    trial_row,
)
from shipid.hybrid.training import Learner, Length, StackTraining
from shipid.hybrid.units import VaryingInputs

Trial = tuple[str, int]
"""Model and number."""
NARROW = 32  # units up to which a core waits for Python: networks of different widths train faster as one stack
STACK = 4  # of them; with more nothing is gained
HALVINGS = 4  # of the epochs, down to those after which the first trials of a race stop; with 6 slow ones are lost


def tune_gradient(
    task: Task,
    method: SearchMethod,
    inputs: Inputs,
    length: Length,
    *,
    mirror: bool = False,
    at_once: int = 1,
    terms: int | None = None,
) -> dict[str, FitResult]:
    """Train networks for each foundation.

    The objective is the mean validation error over the folds; the compensator is the mean of the fold networks of the
    best trial. The sampler of a trial is seeded by its number.

    mirror : whether networks are symmetric to port and starboard, where the inputs allow it.
    at_once : trials that are proposed at a time; more than one race. terms : of the polynomials that outputs weigh.
    """
    trainer, search = _Trainer(task, method, inputs, length, mirror, terms), Search(task, task.cases, method)
    space = method.space()
    if search.done != search.count:  # a round that was interrupted begins again
        search.rows = {key: rows[: search.done - search.done % at_once] for key, rows in search.rows.items()}
    studies = {key: optuna.create_study(direction="minimize") for key in search.rows}
    for key, study in studies.items():
        study.add_trials([frozen_trial(row, space) for row in search.rows[key]])
    best: dict[str, _TrialOutcome] = {}  # of the trials that were trained here
    fixed = {  # what `suggest` leaves out is in the middle
        name: setting_at_share(method, name, 0.5) if name in method.ranges() else getattr(method, name)
        for name in method.SEARCHED
    }
    for first, _ in search.left(count()):
        numbers = range(first, min(first + at_once, search.count or first + at_once))
        trials: dict[Trial, optuna.Trial] = {}
        for number in numbers:
            for key, study in studies.items():  # TPE as the paper's Optuna had it: later defaults differ
                seed = seed_of(task.seed, key, number)
                study.sampler = optuna.samplers.TPESampler(multivariate=False, constant_liar=at_once > 1, seed=seed)
                trials[key, number] = study.ask(space)
        outcomes = trainer.train({one: fixed | trial.params for one, trial in trials.items()})
        for (key, number), trial in trials.items():
            one, row = outcomes[key, number], outcomes[key, number].row
            if row["state"] == "stopped":
                trial.report(row["value"], row["epochs"])
            studies[key].tell(trial, row["value"] if row["state"] == "complete" else None, TRIAL_STATES[row["state"]])
            if row["state"] == "complete" and (key not in best or row["value"] < best[key].row["value"]):
                best[key] = one
        for number in numbers:
            search.record({key: outcomes[key, number].row for key in studies})
    return {key: trainer.fitted(key, search.rows, best.get(key), at_once) for key in studies}


@dataclass(frozen=True)
class _TrialOutcome:
    """A trial of a model: its row, and the networks of the folds."""

    row: Row
    networks: tuple[Network, ...]


@dataclass(frozen=True, eq=False)
class _StackMember:
    """A network in training: its trial and fold, what its inputs are, the scales (d,) that divide them, its data.

    basis : (T, r) [m] that its outputs weigh. floor : mean square [m^2] of the targets to watch that it cannot follow.
    """

    trial: Trial
    fold: int
    varying: VaryingInputs
    scales: Array
    learner: Learner
    basis: Array
    floor: float

    def networks(self, layers: Layers) -> list[Network]:
        """The network as it predicts, twice as large; with a mirror also its image, whose mean with it is symmetric."""
        (weight, bias), *others = layers
        scaled, mirror = weight / self.scales[:, None], self.varying.reflection
        every: list[Layers] = [((scaled, bias), *others)]
        if mirror is not None:
            *hidden, (last, offset) = ((mirror @ scaled, bias), *others)
            sign = np.repeat([1.0, -1.0], len(offset) // 2)
            every.append((*hidden, (last * sign, offset * sign)))
        return [Network(self.varying.features, self.varying.normaliser, self.basis, one) for one in every]


_RunningStack = tuple[list[_StackMember], StackTraining]


class _Trainer:
    """What all trials share: inputs, targets and folds."""

    def __init__(
        self, task: Task, method: SearchMethod, inputs: Inputs, length: Length, mirror: bool, terms: int | None
    ) -> None:
        self.task, self.method, self.inputs, self.length = task, method, inputs, length
        self.mirror, self.terms = mirror, terms
        self.tables = shared_tables(task, inputs)
        self.targets = task.targets
        self._seen: dict[object, tuple[VaryingInputs, Array]] = {}
        self._again: dict[int, dict[Trial, _TrialOutcome]] = {}

    def _inputs(self, key: str, fold: int) -> tuple[VaryingInputs, Array]:
        """What varies in the training windows of a fold, and its values (S, d), normalised; once for equal inputs."""
        table = self.tables[key]
        place = (fold, input_table_key(table))
        if place not in self._seen:
            training = {name: values[self.task.folds[fold][0]] for name, values in table.items()}
            varying = VaryingInputs.of(training, self.mirror)
            self._seen[place] = varying, varying.normaliser.apply(table)
        return self._seen[place]

    def _outputs(self, key: str, fold: int) -> tuple[Array, Array, float]:
        """Basis (T, r) [m], what it weighs (S, 2 r), about 1 in training, and what validation holds beside [m^2]."""
        training, validation = self.task.folds[fold]
        targets, terms = self.targets[key], self.terms
        if terms is None:  # as in the paper: each step, in metres
            return np.eye(len(targets)), flatten_paths(targets), 0.0
        plain = smooth_basis(len(targets), terms)
        weights = np.tensordot(plain.T, targets, 1)
        scale = max(float(np.sqrt(np.square(weights[:, training]).mean())), 1e-9)
        floor = mean_squared_error(np.tensordot(plain, weights, 1)[:, validation], targets[:, validation])
        return plain * scale, flatten_paths(weights / scale), floor

    def _stacks(self, asked: Mapping[Trial, Mapping[str, float]]) -> list[list[_StackMember]]:
        """Members of all trials and folds; those that are alike, and several that are narrow, as one stack."""
        stacks: dict[tuple[object, ...], list[_StackMember]] = defaultdict(list)
        race = len(asked) > len(self.tables) and not self.length.batch
        for (key, number), settings in asked.items():
            for fold, (training, validation) in enumerate(self.task.folds):
                varying, values = self._inputs(key, fold)
                names = varying.normaliser.names
                scales = np.array([settings.get(f"{input_group(name)}_scale", 1.0) for name in names])
                scaled = values if (scales == 1).all() else values / scales
                seed = seed_of(self.task.seed, number, fold, key)
                basis, outputs, floor = self._outputs(key, fold)
                learner = Learner(scaled, outputs, training, validation, settings, seed)
                narrow = race and settings["units"] <= NARROW
                alike = (number, fold, input_table_key(self.tables[key]), settings["units"])
                sizes = (settings["layers"], len(names), len(training), len(validation))
                mirror = varying.reflection if varying.reflection is None else varying.reflection.tobytes()
                place = (sizes, mirror, None if narrow else alike)
                stacks[place].append(_StackMember((key, number), fold, varying, scales, learner, basis, floor))
        return [
            members[start : start + size]
            for place, members in stacks.items()
            for size in (len(members) if place[-1] else STACK,)
            for start in range(0, len(members), size)
        ]

    def train(self, asked: Mapping[Trial, Mapping[str, float]]) -> dict[Trial, _TrialOutcome]:
        """Train the networks of some trials; several of a model race."""
        running = [
            (
                members,
                StackTraining(
                    [one.learner for one in members],
                    self.length,
                    order_seed=seed_of(self.task.seed, members[0].trial[1], members[0].fold),
                    reflection=members[0].varying.reflection,
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
            outcomes[trial] = _TrialOutcome(row, networks)
        return outcomes

    def fitted(self, key: str, rows: Mapping[str, list[Row]], best: _TrialOutcome | None, at_once: int) -> FitResult:
        """The networks of the best trial; those of an earlier session are trained once more, in the same company."""
        seconds = sum(row["seconds"] for row in rows[key])
        kept = best_trials(rows[key])
        if not kept:
            return FitResult(None, rows[key], seconds)
        number = kept[0]["number"]
        if best is None or number != best.row["number"]:
            first = number - number % at_once
            if first not in self._again:
                again = {  # in the order of the first training, so that stacks hold the same members
                    (name, place): rows[name][place]["params"]
                    for place in range(first, min(first + at_once, len(rows[key])))
                    for name in rows
                }
                self._again[first] = self.train(again)
            best = self._again[first][key, number]
        return FitResult(Compensator(self.inputs, best.networks, kept[0]["params"]), rows[key], seconds)


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
    ended: dict[Trial, list[tuple[int, float, int, list[Network]]]] = defaultdict(list)
    for members, training in running:
        parts = zip(members, training.losses(), training.best.epochs.tolist(), training.layers(), strict=True)
        for one, loss, epochs, layers in parts:
            error = float(loss) * np.square(one.basis).sum() / len(one.basis) + one.floor
            ended[one.trial].append((one.fold, error, epochs, one.networks(layers)))
    return {
        trial: (
            float(np.mean([loss for _, loss, _, _ in folds])),
            max(epochs for _, _, epochs, _ in folds),
            tuple(network for _, _, _, networks in sorted(folds, key=lambda fold: fold[0]) for network in networks),
        )
        for trial, folds in ended.items()
    }
