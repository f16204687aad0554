from itertools import pairwise

import numpy as np
import pytest
import torch

from shipid.hybrid import training
from shipid.hybrid.path_trained import PathTrained
from shipid.hybrid.training import NetworkTraining, tanh_network

torch.set_num_threads(1)
TRAIN, VAL = np.arange(96), np.arange(96, 128)


@pytest.fixture(scope="module")
def problem():
    rng = np.random.default_rng(3)
    x = rng.normal(size=(128, 5))
    y = np.stack([np.tanh(x @ rng.normal(size=(5, 6))) + 0.1 * rng.normal(size=(128, 6)) for _ in range(3)])
    return x, y


def begun(x, y, seed, *, rate=1e-2, decay=0.0, units=8, dropout=(0.0, 0.0), judged=VAL, **length):
    """A network of two hidden layers on samples (n, 5) -> (n, m), not trained yet."""
    parts = [([(x[rows],)], y[rows]) for rows in (TRAIN, judged)]
    widths = [x.shape[1], units, units, y.shape[1]]
    return NetworkTraining(
        lambda: tanh_network(widths, *dropout),
        parts,
        PathTrained(**{"epochs": 30, "patience": 0, **length}),
        lambda _: rate,
        decay,
        seed,
    )


def trained(*args, epochs=30, **settings):
    one = begun(*args, epochs=epochs, **settings)
    one.advance(epochs)
    return one


@pytest.mark.parametrize("decay", [0.0, 0.3])
def test_the_loop_is_that_of_torch_optim(problem, decay):
    """Adam without decay, from the start that PyTorch draws."""
    x, y = problem
    epochs = 40
    one = trained(x, y[0], 7, decay=decay, epochs=epochs, judged=TRAIN)
    torch.manual_seed(7)
    parts = []
    for i, o in pairwise([5, 8, 8, 6]):
        parts += [torch.nn.Linear(i, o), torch.nn.Tanh()]
    network = torch.nn.Sequential(*parts[:-1])
    kind = (
        torch.optim.AdamW(network.parameters(), lr=1e-2, weight_decay=decay)
        if decay
        else torch.optim.Adam(network.parameters(), lr=1e-2)
    )
    inputs, targets = torch.tensor(x[TRAIN], dtype=torch.float32), torch.tensor(y[0, TRAIN], dtype=torch.float32)
    for _ in range(epochs):
        kind.zero_grad()
        torch.nn.functional.mse_loss(network(inputs), targets).backward()
        kind.step()
    for layer, expected in zip(one.kept.values(), network.parameters(), strict=True):
        np.testing.assert_allclose(layer, expected.detach().numpy(), atol=2e-5)


def test_a_network_does_not_notice_its_company_or_that_it_is_trained_in_parts(problem):
    x, y = problem
    run = {"patience": 6, "dropout": (0.1, 0.2), "batch": 20}
    whole = [trained(x, y[k], k, epochs=40, **run) for k in range(3)]
    others = [begun(x, y[k], k, epochs=40, **run) for k in range(3)]
    for part in (7, 3, 30):
        for one in others:
            one.advance(part)
            torch.rand(1)  # whatever else draws
    assert len({one.epochs for one in whole} | {one.loss for one in whole}) > 1
    for one, other in zip(whole, others, strict=True):
        assert (one.loss, one.epochs) == (other.loss, other.epochs)
        for layer, same in zip(one.kept.values(), other.kept.values(), strict=True):
            np.testing.assert_array_equal(layer, same)


def test_drop_out_of_everything_gives_the_bias(problem):
    x, y = problem
    one = trained(x, y[0], 3, dropout=(1.0, 1.0), rate=0.05, epochs=400)
    assert one.loss == pytest.approx(np.square(y[0][VAL]).mean(), rel=0.5)  # layers that saw nothing
    assert np.isfinite([*one.kept.values()][-1]).all()


def solved_error(x, y, weight, offset, ridge):
    """Mean squared error of each third of the samples, by output weights of drawn units that the others solve."""
    features = np.tanh(x @ weight + offset) / len(offset) ** 0.5
    missed = []
    for part in np.split(np.arange(96), 3):
        rest = np.setdiff1d(np.arange(96), part)
        gram = features[rest].T @ features[rest] + ridge * np.eye(len(offset))
        missed.append(features[part] @ np.linalg.solve(gram, features[rest].T @ y[rest]) - y[part])
    return np.square(missed).mean()


def test_a_step_moves_hidden_units_against_the_gradient_of_the_error_on_what_is_left_out(problem):
    """The first step of Adam moves each weight by the learning rate, against the sign of its slope."""
    x, y = problem[0][:96], problem[1][0, :96]
    rng, rate, ridge = np.random.default_rng(0), 1e-3, 0.03
    weight, offset = rng.normal(size=(5, 7)), rng.normal(size=7)
    part = torch.arange(96) // 32
    dealt = [[(part != k, part == k) for k in range(3)]]
    (moved, shifted), (last, _) = training.train_units(
        (weight, offset), [np.eye(5)], x, y, np.arange(96), dealt, rate, ridge
    )
    for new, old, place in ((moved, weight, (2, 3)), (moved, weight, (0, 6)), (shifted, offset, (4,))):
        near = [weight.copy(), offset.copy(), weight.copy(), offset.copy()]
        for copy, step in ((near[old is offset], 1e-5), (near[2 + (old is offset)], -1e-5)):
            copy[place] += step
        slope = solved_error(x, y, *near[:2], ridge) - solved_error(x, y, *near[2:], ridge)
        assert new[place] - old[place] == pytest.approx(-rate * np.sign(slope), rel=1e-3)
    features = np.tanh(x @ moved + shifted) / 7**0.5  # in the end all samples solve
    expected = np.linalg.solve(features.T @ features + ridge * np.eye(7), features.T @ y)
    np.testing.assert_allclose(last * 7**0.5, expected, rtol=1e-8)


def test_early_stopping_keeps_the_best_epoch(problem):
    x, y = problem
    y = np.random.default_rng(1).normal(size=y.shape)  # nothing to learn: the validation loss soon rises
    run = {"rate": 3e-2, "units": 64}
    losses = [trained(x, y[0], 4, **run, epochs=n).loss for n in range(1, 40)]
    best = int(np.argmin(losses)) + 1
    stopped = trained(x, y[0], 4, **run, epochs=500, patience=12)
    assert best < 25
    assert stopped.epochs == best + 12
    assert stopped.loss == losses[best - 1]
    kept = trained(x, y[0], 4, **run, epochs=best)
    for layer, same in zip(stopped.kept.values(), kept.kept.values(), strict=True):
        np.testing.assert_array_equal(layer, same)


def test_a_network_that_diverges_ends_and_has_no_loss(problem):
    x, y = problem
    broken = y[1].copy()
    broken[3, 2] = np.nan
    one = trained(x, broken, 2, epochs=10, batch=32)
    assert np.isnan(one.loss)
    assert one.epochs == 1
