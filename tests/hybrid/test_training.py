from itertools import pairwise

import numpy as np
import pytest
import torch

from shipid.hybrid import training
from shipid.hybrid.training import Learner, Length, StackTraining

torch.set_num_threads(1)
TRAIN, VAL = np.arange(96), np.arange(96, 128)


def settings(num_members=1, **changes):
    """Plain full-batch Adam, one set of hyperparameters for all members: `members` and `length` of a stack."""
    common = {"learning_rate": 1e-2, "weight_decay": 0.0, "input_dropout": 0.0, "hidden_dropout": 0.0}
    common |= {"layers": 2, "units": 8}
    length = {"epochs": 30} | {name: value for name, value in changes.items() if name not in common}
    common |= {name: value for name, value in changes.items() if name in common}
    members = [{k: v[i] if isinstance(v, tuple) else v for k, v in common.items()} for i in range(num_members)]
    return members, Length(**length)


@pytest.fixture(scope="module")
def problem():
    rng = np.random.default_rng(3)
    x = rng.normal(size=(128, 5))
    y = np.stack([np.tanh(x @ rng.normal(size=(5, 6))) + 0.1 * rng.normal(size=(128, 6)) for _ in range(3)])
    return x, y


def train_stack(x, y, training_idx, val_idx, members, length, seeds, order_seed=0, **options):
    """Train to the end: a member for each of the targets (K, n, m)."""
    pieces = zip(y, members, seeds, strict=True)
    learners = [Learner(x, mine, training_idx, val_idx, member, seed) for mine, member, seed in pieces]
    stack = StackTraining(learners, length, order_seed=order_seed, **options)
    stack.advance()
    return stack


def torch_network(seed, widths):
    torch.manual_seed(seed)
    parts = []
    for i, o in pairwise(widths):
        parts += [torch.nn.Linear(i, o), torch.nn.Tanh()]
    return torch.nn.Sequential(*parts[:-1])


def assert_same_weights(layers, network, tolerance):
    linear = [module for module in network if isinstance(module, torch.nn.Linear)]
    for (weight, bias), module in zip(layers, linear, strict=True):
        np.testing.assert_allclose(weight, module.weight.detach().numpy().T, atol=tolerance)
        np.testing.assert_allclose(bias, module.bias.detach().numpy(), atol=tolerance)


def test_networks_start_as_those_of_pytorch():
    widths = [5, 16, 16, 4]
    flat = training.initial_weights(widths, [torch.Generator().manual_seed(11), torch.Generator().manual_seed(12)])
    for k, seed in enumerate((11, 12)):
        shapes = [shape for i, o in pairwise(widths) for shape in ((i, o), (1, o))]
        pieces = [piece[k].numpy() for piece in training.split_layers(flat, shapes)]
        layers = [(w, b[0]) for w, b in zip(pieces[::2], pieces[1::2], strict=True)]
        assert_same_weights(layers, torch_network(seed, widths), 1e-7)


@pytest.mark.parametrize("decay", [0.0, 0.3])
def test_the_loop_is_that_of_torch_optim(problem, decay):
    x, y = problem
    epochs = 40
    trained = train_stack(x, y[:1], TRAIN, TRAIN, *settings(weight_decay=decay, epochs=epochs), [7])
    network = torch_network(7, [5, 8, 8, 6])
    if decay:
        optimiser = torch.optim.AdamW(network.parameters(), lr=1e-2, weight_decay=decay)
    else:
        optimiser = torch.optim.Adam(network.parameters(), lr=1e-2)
    inputs, targets = torch.tensor(x[TRAIN], dtype=torch.float32), torch.tensor(y[0, TRAIN], dtype=torch.float32)
    for _ in range(epochs):
        optimiser.zero_grad()
        torch.nn.functional.mse_loss(network(inputs), targets).backward()
        optimiser.step()
    assert_same_weights(trained.layers()[0], network, 2e-5)


def test_a_member_does_not_notice_its_company(problem):
    x, y = problem
    wide = {
        "learning_rate": (1e-2, 3e-3, 2e-2),
        "weight_decay": (0.0, 0.1, 0.5),
        "input_dropout": (0.0, 0.2, 0.0),
        "hidden_dropout": (0.1, 0.0, 0.0),
    }
    shared = {"batch": 20, "epochs": 25, "patience": 4}
    together = train_stack(x, y, TRAIN, VAL, *settings(3, **wide, **shared), [1, 2, 3], order_seed=5)
    for k in range(3):
        alone = {name: value[k] for name, value in wide.items()}
        one = train_stack(x, y[k : k + 1], TRAIN, VAL, *settings(**alone, **shared), [k + 1], order_seed=5)
        assert one.best.epochs[0] == together.best.epochs[k]
        assert one.losses()[0] == pytest.approx(together.losses()[k], rel=1e-4)
        for mine, theirs in zip(one.layers()[0], together.layers()[k], strict=True):
            np.testing.assert_allclose(mine[0], theirs[0], atol=2e-4)


def test_a_stack_does_not_notice_that_it_is_trained_in_parts(problem):
    x, y = problem
    run = {"epochs": 40, "patience": 6, "input_dropout": 0.1, "hidden_dropout": 0.2}
    members, length = settings(3, **run)
    stack = StackTraining([Learner(x, y[k], TRAIN, VAL, members[k], k) for k in range(3)], length)
    for part in (7, 3, None):
        stack.advance(part)
    whole = train_stack(x, y, TRAIN, VAL, members, length, range(3))
    np.testing.assert_array_equal(stack.losses(), whole.losses())


@pytest.mark.parametrize("rate", [0.1, 0.5, 0.999])
def test_drop_out_is_that_of_torch_bit_by_bit(rate):
    one, other = torch.Generator().manual_seed(3), torch.Generator().manual_seed(3)
    drawn = training.draw_dropout([rate], (40, 30), [one])[0]
    assert torch.equal(drawn, torch.empty(40, 30).bernoulli_(1 - rate, generator=other).div_(1 - rate))
    assert torch.equal(one.get_state(), other.get_state())


def test_early_stopping_keeps_the_best_epoch(problem):
    x, y = problem
    y = np.random.default_rng(1).normal(size=y.shape)  # nothing to learn: the validation loss soon rises
    run = {"learning_rate": 3e-2, "units": 64}
    losses = [train_stack(x, y[:1], TRAIN, VAL, *settings(**run, epochs=n), [4]).losses()[0] for n in range(1, 40)]
    best = int(np.argmin(losses)) + 1
    stopped = train_stack(x, y[:1], TRAIN, VAL, *settings(**run, epochs=500, patience=12), [4])
    assert best < 25
    assert stopped.best.epochs[0] == best + 12
    assert stopped.losses()[0] == losses[best - 1]
    kept = train_stack(x, y[:1], TRAIN, VAL, *settings(**run, epochs=best), [4])
    np.testing.assert_array_equal(stopped.layers()[0][0][0], kept.layers()[0][0][0])


def test_a_diverged_member_harms_nobody(problem):
    x, y = problem
    broken = y.copy()
    broken[1, 3, 2] = np.nan
    config = settings(3, epochs=10, batch=32)
    good, bad = (train_stack(x, targets, TRAIN, VAL, *config, [1, 2, 3]) for targets in (y, broken))
    assert np.isnan(bad.losses()).tolist() == [False, True, False]
    np.testing.assert_array_equal(bad.losses()[[0, 2]], good.losses()[[0, 2]])
