"""Tuning by gradients, beside the drawn path where both promise the same."""

import numpy as np
import pytest
import torch

from shipid.hybrid.features import Inputs
from shipid.hybrid.path_trained import PathTrained
from shipid.hybrid.training import StackTraining
from tests.hybrid.tasks import compensation, tune

torch.set_num_threads(1)
COMMANDS = ("port.n", "port.delta", "starboard.n", "starboard.delta")
SMALL = PathTrained(trials=3, units=16, layers=1, learning_rate=1e-2, epochs=40, patience=0)
SEARCHED = PathTrained(trials=3, epochs=6)
FOLD = (np.arange(40, 200), np.arange(40))


@pytest.fixture
def columns():
    rng = np.random.default_rng(0)
    columns = {name: rng.normal(size=240) for name in ("psi", "u", "v", "r", "V_w", "beta_w", "port.n", "port.delta")}
    return columns | {"starboard.n": columns["port.n"].copy(), "starboard.delta": columns["port.delta"].copy()}


@pytest.fixture
def targets(columns):
    """What two models miss (6, 240, 2): a smooth function of the inputs that grows along the horizon."""
    steps = np.arange(1.0, 7.0)[:, None]
    x = steps * columns["u"] + 0.1 * steps**2 * np.tanh(columns["port.n"])
    y = steps * columns["v"] + 0.2 * steps**2 * columns["r"] * columns["port.delta"]
    return {"high-1": np.stack([x, y], axis=-1), "none": np.stack([5.0 * x, -3.0 * y], axis=-1)}


def test_equal_architectures_train_as_one_stack_and_others_alone(columns, targets, monkeypatch):
    stacks = []

    def counted(learners, *args, **kwargs):
        stacks.append(len(learners))
        return StackTraining(learners, *args, **kwargs)

    monkeypatch.setattr("shipid.hybrid.gradient.StackTraining", counted)
    tune(columns, COMMANDS, targets, [FOLD], SMALL, seed=4)
    assert stacks == [2] * 3
    stacks.clear()
    tune(columns, COMMANDS, targets, [FOLD], SEARCHED.model_copy(update={"epochs": 2}), seed=4)
    assert stacks == [1] * 6


def test_the_best_of_a_race_goes_to_the_end(columns, targets):
    race = {"trials": 5, "at_once": 3, "layers": 1, "units": (4, 20), "epochs": 128, "patience": 0}
    tuned = tune(columns, COMMANDS, targets, [FOLD], PathTrained(**race), seed=4)
    for fit in tuned.values():
        rows = fit.trials
        assert [row["state"] == "complete" for row in rows].count(True) == 2  # one a round
        for part in (rows[:3], rows[3:]):
            assert [row["epochs"] for row in part if row["state"] == "complete"] == [128]
        assert {row["epochs"] for row in rows if row["state"] == "stopped"} <= {8, 16}  # 3, 2 and 1 trials go on


def test_the_objective_is_the_mean_loss_of_the_folds(columns, targets):
    folds = [(np.arange(80, 240), np.arange(80)), (np.arange(160), np.arange(160, 240))]
    tuned = tune(columns, COMMANDS, targets, folds, SMALL, seed=1)["none"]
    best = min(tuned.trials, key=lambda row: row["value"])
    assert tuned.corrector.hyperparameters == best["params"]
    losses = []
    for network, (_, validation) in zip(tuned.corrector.networks, folds, strict=True):
        one_fold = type(tuned.corrector)(Inputs(COMMANDS), (network,), {})
        predicted = compensation(one_fold, {name: values[validation] for name, values in columns.items()})
        losses.append(np.square(predicted - targets["none"][:, validation]).mean())
    assert best["value"] == pytest.approx(np.mean(losses), rel=1e-4)


def test_the_statistics_are_those_of_the_training_windows(columns, targets):
    before = tune(columns, COMMANDS, targets, [FOLD], SMALL, seed=1)["none"].corrector.networks[0]
    columns["u"][3] = 1e6  # a validation window
    columns["starboard.n"][5] = -40.0  # equal to port in training all the same
    targets["none"][:, 7] = 1e4
    after = tune(columns, COMMANDS, targets, [FOLD], SMALL, seed=1)["none"].corrector.networks[0]
    np.testing.assert_array_equal(after.normaliser.mean, before.normaliser.mean)
    np.testing.assert_array_equal(after.normaliser.std, before.normaliser.std)
    assert after.features == before.features
    assert before.normaliser.mean[0] == pytest.approx(columns["u"][40:200].mean())
