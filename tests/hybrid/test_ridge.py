"""The recipe in closed form: what it says of itself is what refitting says; port and starboard are alike."""

import numpy as np
import pytest
import torch

from shipid.hybrid.compensator import Compensator, smooth_basis
from shipid.hybrid.features import Inputs
from shipid.hybrid.path_drawn import PathDrawn
from shipid.hybrid.ridge import (
    _BestTrials,
    _fold_blocks,
    _left_out_errors,
    _LeftOutErrors,
    _ridges_for_all,
    _SidePiece,
    _TrialVerdict,
    _with_axes,
    _without_each_fold,
    hidden_layer,
    matrix_product,
    part_of_runs,
)
from tests.hybrid.tasks import compensation, tune

TWINS = ("port.n", "port.alpha", "starboard.n", "starboard.alpha")
RUDDER = ("engine.n", "rudder.delta")
SMALL = PathDrawn(trials=6, units=24, terms=4)
STEPS, LENGTHS = 9, (18, 25, 18, 30, 11, 18)  # windows of the runs
ALL = np.arange(sum(LENGTHS))
ENDS = np.cumsum(LENGTHS)
RUNS = [np.arange(end - length, end) for length, end in zip(LENGTHS, ENDS, strict=True)]
FOLDS = [(np.setdiff1d(ALL, run), run) for run in RUNS]


def recipe(**changes):
    return SMALL.model_copy(update=changes)


def drawn(commands=TWINS, seed=0, count=120):
    """Columns that are mirrored nowhere, all different."""
    rng = np.random.default_rng(seed)
    columns = {name: rng.normal(0.5, 1.0, count) for name in ("psi", "u", "v", "r", "beta_w", *commands)}
    return columns | {"V_w": rng.uniform(1.0, 9.0, count)}


def mirrored(columns):
    """The ship and the wind as a mirror shows them."""
    sides = {"port": "starboard", "starboard": "port"}
    columns_ = {}
    for name, values in columns.items():
        component, _, signal = name.rpartition(".")
        odd = signal in ("psi", "v", "r", "beta_w", "alpha", "delta")
        columns_[f"{sides.get(component, component)}.{signal}" if component else name] = -values if odd else values
    return columns_


@pytest.fixture
def columns():
    return drawn()


@pytest.fixture
def targets(columns):
    """What two models miss (T, S, 2) [m]: one smooth in time, the other with something faster than any basis."""
    return {"smooth": missed(columns), "rough": missed(columns) + np.random.default_rng(1).normal(size=(STEPS, 120, 2))}


def missed(columns):
    t = np.arange(1.0, STEPS + 1)[:, None] / STEPS
    x = t * columns["u"] + 2.0 * t**2 * np.tanh(columns["port.n"])
    y = t * columns["v"] - 1.5 * t**2 * columns["r"]
    return np.stack([x, y], axis=-1)


def tuned(columns, targets, setup, *, commands=TWINS, folds=FOLDS, seed=3):
    return tune(columns, commands, targets, folds, setup, seed)


def part_of(side, features, targets):
    """A coordinate as the search holds it."""
    return _with_axes((side,), torch.tensor(features), [torch.tensor(targets)])


@pytest.mark.parametrize("units", [12, 300])  # fewer and more than windows
@pytest.mark.parametrize("ridge", [1e-3, 5.0])
@pytest.mark.parametrize("kind", ["runs", "more left out than judged", "one pair"])
def test_errors_without_a_block_are_those_of_a_fit_without_it(units, ridge, kind):
    rng = np.random.default_rng(0)
    folds = FOLDS
    if kind == "more left out than judged":  # neighbours that share a moment are in neither part
        folds = [(np.setdiff1d(ALL, np.arange(run[0] - 4, run[-1] + 3)), run[: len(run) // 2]) for run in RUNS]
    elif kind == "one pair":
        folds = [(np.arange(30, 120), np.arange(30))]
    features = [rng.normal(size=(len(ALL), units)) / units**0.5 for _ in range(2)]
    wanted = [rng.normal(size=(len(ALL), 6)) for _ in range(2)]  # 3 models with 2 shapes each
    expected = np.zeros(3)
    for seen, made in zip(features, wanted, strict=True):
        for training, judged in folds:
            gram = seen[training].T @ seen[training] + ridge * np.eye(units)
            weights = np.linalg.solve(gram, seen[training].T @ made[training])
            expected += np.square(made[judged] - seen[judged] @ weights).reshape(-1, 3, 2).sum(axis=(0, 2))
    parts = [part_of(side, *pair) for side, pair in enumerate(zip(features, wanted, strict=True))]
    sums, others, errors = _left_out_errors(parts, [ridge], _fold_blocks(folds, ALL), 2)
    np.testing.assert_allclose(sums[0], expected, rtol=1e-8)
    np.testing.assert_allclose(others[0].sum(axis=0), (len(folds) - 1) * expected, rtol=1e-8)
    judged = np.unique(np.concatenate([part for _, part in folds]))
    kept = [errors.of(np.zeros(len(folds), dtype=int), model)[:, judged].double().numpy() for model in range(3)]
    np.testing.assert_allclose([np.square(one).sum() for one in kept], expected, rtol=1e-5)


def drawn_parts(seed, models=1):
    """A few folds of a few windows, with features and noise of very different sizes: x and y, folds, windows.

    Each model has 2 shapes.
    """
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5))
    lengths = [int(rng.integers(3, 9)) for _ in range(count)]
    windows, ends = np.arange(sum(lengths)), np.cumsum(lengths)
    runs = [np.arange(end - length, end) for end, length in zip(ends, lengths, strict=True)]
    units = int(rng.integers(1, 12))
    features = [rng.normal(size=(len(windows), units)) * rng.lognormal(0, 1.5, size=units) for _ in range(2)]
    parts = []
    for side, seen in enumerate(features):
        made = seen @ rng.normal(size=(units, 2 * models)) * rng.uniform(0, 2)
        noise = rng.lognormal(0, 1) * rng.normal(size=made.shape)
        parts.append(part_of(side, seen, made + noise * np.repeat(rng.lognormal(0, 1, count), lengths)[:, None]))
    return parts, runs, windows


def one_by_one_ridge(parts, ridges, blocks):
    """Sums of squares over all folds, (ridges, K), and over all but one, (ridges, F, K), of each ridge alone."""
    alone = [_left_out_errors(parts, [ridge], blocks, 2) for ridge in ridges]
    return tuple(np.concatenate([one[place] for one in alone]) for place in (0, 1))


def descent(curves):
    """Where each of some curves (C, ridges) is least among those that a descent of them all from the middle sees."""
    low = high = curves.shape[1] // 2
    while low > 0 and (curves[:, low : high + 1].argmin(axis=1) == 0).any():
        low -= 1
    while high < curves.shape[1] - 1 and (curves[:, low : high + 1].argmin(axis=1) == high - low).any():
        high += 1
    return low + curves[:, low : high + 1].argmin(axis=1)


def test_each_model_takes_the_ridge_to_which_it_descends_from_the_middle():
    """By all folds and by all but any one, whatever its company; with one minimum only, this is the best of all."""
    ridges, asked, alike, curves_of_all = list(np.geomspace(1e-4, 1e4, 9)), 0, 0, 0
    for seed in range(15):
        parts, runs, windows = drawn_parts(seed, models=3)
        blocks = _fold_blocks([(np.setdiff1d(windows, run), run) for run in runs], windows)
        sums, others, _ = _left_out_errors(parts, ridges, blocks, 2)
        every, but_one = one_by_one_ridge(parts, ridges, blocks)
        for model in range(3):
            seen, known = (
                np.concatenate([one[:, None, model], rest[..., model]], axis=1).T
                for one, rest in ((sums, others), (every, but_one))
            )
            np.testing.assert_array_equal(seen.argmin(axis=1), descent(known))
            alike += int((descent(known) == known.argmin(axis=1)).sum())
            curves_of_all += len(known)
        asked += int(np.isfinite(sums).sum())
    assert asked < 0.6 * 15 * 3 * 9
    assert alike / curves_of_all > 0.9


@pytest.mark.parametrize("seed", range(5))
def test_windows_are_taken_evenly_from_each_run(seed):
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 60, rng.integers(1, 12))
    run = np.repeat([f"run {number}" for number in range(len(lengths))], lengths)
    most = int(rng.integers(1, 2 * len(run)))
    taken = part_of_runs(run, most)
    if len(run) <= most:
        np.testing.assert_array_equal(taken, np.arange(len(run)))
        return
    assert (np.diff(taken) > 0).all()
    counts = np.array([(run[taken] == name).sum() for name in np.unique(run)])
    shares = np.array([(run == name).sum() for name in np.unique(run)]) * most / len(run)
    assert (counts >= 1).all()
    assert (np.abs(counts - np.maximum(shares, 1)) <= 0.5).all()
    for name in np.unique(run):
        steps = np.diff(taken[run[taken] == name])
        assert len(steps) == 0 or np.ptp(steps) <= 1


def test_all_windows_choose_the_ridge_of_a_part_or_one_that_is_smaller_by_its_share():
    ridges = [1e-3, 1e-2, 1e-1, 1.0, 10.0]
    assert _ridges_for_all(ridges, 1.0, np.array([3])).tolist() == [3]
    assert _ridges_for_all(ridges, 0.5, np.array([3])).tolist() == [2, 3]
    assert _ridges_for_all(ridges, 0.1, np.array([3])).tolist() == [2, 3]
    assert _ridges_for_all(ridges, 0.03, np.array([1, 4])).tolist() == [0, 1, 2, 3, 4]
    assert _ridges_for_all([0.5], 0.1, np.array([0])).tolist() == [0]


@pytest.mark.parametrize("search_windows", [1000, 40])
@pytest.mark.parametrize("mirror", [0.0, 1.0])
def test_errors_left_out_are_those_of_a_model_without_the_run(columns, targets, mirror, search_windows):
    """One trial, one ridge: nothing is chosen, so a fit without the run must give the same errors on it."""
    plain = recipe(trials=1, averaged=1, ridge=0.1, mirror=mirror, search_windows=search_windows)
    fitted = tune(columns, TWINS, targets, FOLDS, plain, seed=0)["rough"]
    (network,) = fitted.corrector.networks
    expected = refitted(network, mirror, 0.1, columns, targets["rough"], FOLDS)
    assert np.square(fitted.left_out[:, ALL]).mean() == pytest.approx(expected, rel=1e-5)
    assert fitted.trials[0]["value"] == pytest.approx(expected, rel=1e-5)


def test_a_run_has_no_part_in_the_choice_of_what_judges_it():
    """Two trials, two folds: the first is best for fold 0 and the second for fold 1, so each judges the other fold."""
    search, rows = _BestTrials(most=1), [np.array([0, 1]), np.array([2, 3])]
    for number, by_fold in enumerate([[1.0, 5.0], [4.0, 2.0]]):
        left_out = sum(by_fold) - np.array(by_fold), torch.full((2, 4, 3), float(number))
        search.consider(_TrialVerdict(sum(by_fold), np.array([0]), {}, lambda: None, lambda kept=left_out: kept))
    np.testing.assert_array_equal(search.without(rows)[0, :, 0], [1.0, 1.0, 0.0, 0.0])


def test_a_run_has_no_part_in_the_choice_of_the_ridge_that_judges_it():
    """The first ridge is best for fold 0 and the second for fold 1, so each judges the other fold."""
    errors = _LeftOutErrors(4, 2, 2)
    folds = [(np.array([2, 3]), np.array([0, 1])), (np.array([0, 1]), np.array([2, 3]))]
    (block,) = _fold_blocks(folds, np.arange(4))
    piece = _SidePiece((0, 1), slice(0, 2), block, None)
    for ridge in (0, 1):
        errors.keep(ridge, piece, [0], torch.full((2, 2, 4), float(ridge)))
    by_fold = np.array([[1.0, 5.0], [4.0, 2.0]])
    others, chosen = _without_each_fold(by_fold.sum(axis=1, keepdims=True) - by_fold, errors, 0)
    np.testing.assert_array_equal(others, [2.0, 1.0])
    np.testing.assert_array_equal(chosen[0, :, 0], [1.0, 1.0, 0.0, 0.0])


def refitted(network, mirror, ridge, columns, paths, folds):
    """Mean squared error of the windows judged, each predicted by the output weights that the others ask for.

    The hidden units of the network stay; those of a mirrored trial come in pairs, even in x and odd in y.
    """
    (weight, offset), _ = network.layers
    table = columns | wind(columns)
    hidden = np.tanh(network.normaliser.apply(table) @ weight + offset)
    if mirror:
        first, image = np.split(hidden, 2, axis=1)
        features = [(first + image) / (2 * first.shape[1]) ** 0.5, (first - image) / (2 * first.shape[1]) ** 0.5]
    else:
        features = [hidden / hidden.shape[1] ** 0.5] * 2
    errors = []
    for axis, seen in enumerate(features):
        for training, judged in folds:
            made = paths[:, training, axis].T @ network.basis
            gram = seen[training].T @ seen[training] + ridge * np.eye(seen.shape[1])
            weights = np.linalg.solve(gram, seen[training].T @ made)
            errors.append((seen[judged] @ weights @ network.basis.T - paths[:, judged, axis].T).ravel())
    return float(np.square(np.concatenate(errors)).mean())


def wind(columns):
    angle = columns["beta_w"] - columns["psi"]
    return {
        "u_rw": columns["u"] - columns["V_w"] * np.cos(angle),
        "v_rw": columns["v"] - columns["V_w"] * np.sin(angle),
    }


def test_the_compensator_is_the_mean_of_the_best_trials(columns, targets):
    one = tuned(columns, targets, recipe(averaged=4))["rough"]
    assert [row["number"] for row in one.trials] == list(range(6))
    assert {row["state"] for row in one.trials} == {"complete"}
    assert all(set(row["params"]) == set(SMALL.varied()) for row in one.trials)
    assert all(row["epochs"] == 0 and row["seconds"] > 0 for row in one.trials)
    best = sorted(one.trials, key=lambda row: row["value"])
    assert one.corrector.hyperparameters == best[0]["params"]
    assert len(one.corrector.networks) == 4
    for network, row in zip(one.corrector.networks, best, strict=False):
        mirror, ridge = row["params"]["mirror"], row["params"]["ridge"]
        assert refitted(network, mirror, ridge, columns, targets["rough"], FOLDS) == pytest.approx(row["value"])
    apart = [compensation(Compensator(Inputs(TWINS), (network,), {}), columns) for network in one.corrector.networks]
    np.testing.assert_allclose(compensation(one.corrector, columns), np.mean(apart, axis=0), atol=1e-12)
    assert len(tuned(columns, targets, recipe(averaged=9))["rough"].corrector.networks) == 6


@pytest.mark.parametrize("commands", [TWINS, RUDDER])
def test_a_mirrored_ship_gets_the_mirrored_compensation(commands):
    seen, new = drawn(commands), drawn(commands, seed=9)
    paths = np.random.default_rng(2).normal(size=(STEPS, len(ALL), 2))
    one = tuned(seen, {"any": paths}, recipe(mirror=1.0), commands=commands)["any"]
    assert {row["params"]["mirror"] for row in one.trials} == {1.0}
    here, there = compensation(one.corrector, new), compensation(one.corrector, mirrored(new))
    assert np.abs(here).max() > 0.01
    np.testing.assert_allclose(there, here * [1.0, -1.0], atol=1e-12)
    plain = tuned(seen, {"any": paths}, recipe(mirror=0.0), commands=commands)["any"].corrector
    assert np.abs(compensation(plain, mirrored(new)) - compensation(plain, new) * [1.0, -1.0]).max() > 0.01


@pytest.mark.parametrize(("horizon", "terms"), [(30, 8), (15, 1), (50, 12), (2, 8), (1, 8)])
def test_shapes_are_orthonormal_and_hold_all_polynomials_from_0(horizon, terms):
    basis = smooth_basis(horizon, terms)
    assert basis.shape == (horizon, min(terms, horizon))
    np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-12)
    t = np.arange(1, horizon + 1) / horizon
    powers = t[:, None] ** np.arange(1, basis.shape[1] + 1)
    np.testing.assert_allclose(basis @ (basis.T @ powers), powers, atol=1e-12)
    if terms < horizon - 1:
        above = t ** (terms + 1)
        assert np.abs(basis @ (basis.T @ above) - above).max() > 1e-10
        assert np.abs(basis @ (basis.T @ np.ones(horizon)) - 1.0).max() > 1e-3  # an error starts from 0


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_products_are_sums_of_products(dtype: torch.dtype) -> None:
    generator = torch.Generator().manual_seed(1)
    left, right = (torch.randn(3, 4, 5, generator=generator, dtype=dtype) for _ in range(2))
    expected = torch.einsum("fij,fkj->fik", left, right)
    tight = {"rtol": 1e-5, "atol": 1e-5} if dtype == torch.float32 else {"rtol": 1e-13, "atol": 1e-13}
    torch.testing.assert_close(matrix_product(left, right.mT), expected, **tight)
    torch.testing.assert_close(matrix_product(left, right.mT.contiguous()), expected, **tight)
    torch.testing.assert_close(
        matrix_product(left[0][:, 1:], right[0].mT[1:]), left[0][:, 1:] @ right[0][:, 1:].T, **tight
    )
    torch.testing.assert_close(matrix_product(left, right[0].mT), torch.einsum("fij,kj->fik", left, right[0]), **tight)
    assert matrix_product(left, right.mT).dtype == dtype


def test_a_layer_is_the_tanh_of_its_sums() -> None:
    generator = torch.Generator().manual_seed(3)
    values, weight, offset = (
        torch.randn(*shape, generator=generator, dtype=torch.float64) for shape in ((9, 3), (3, 5), (5,))
    )
    before = [part.clone() for part in (values, weight, offset)]
    expected = torch.tanh(torch.einsum("sd,dm->sm", values, weight) + offset)
    torch.testing.assert_close(hidden_layer(values, weight, offset), expected, rtol=1e-13, atol=1e-13)
    assert all(torch.equal(one, other) for one, other in zip(before, (values, weight, offset), strict=True))
