"""The recipe in closed form: what it says of itself is what refitting says; port and starboard are alike."""

import numpy as np
import pytest
import torch

from shipid.hybrid.compensator import Compensator
from shipid.hybrid.features import Inputs, choose_features
from shipid.hybrid.mirror import reflection
from shipid.hybrid.path_drawn import PathDrawn
from shipid.hybrid.ridge import (
    SOUND,
    SPARE,
    _Best,
    _blocks,
    _chosen_without,
    _down_to,
    _Errors,
    _FewRows,
    _left_out,
    _LeftOut,
    _Piece,
    _Verdict,
    _with_axes,
    part_of_runs,
    smooth_basis,
)
from tests.hybrid.tasks import compensation, tune

TWINS = ("port.n", "port.alpha", "starboard.n", "starboard.alpha")
RUDDER = ("engine.n", "rudder.delta")
SMALL = PathDrawn(trials=6, units=24, terms=4)
STEPS, LENGTHS = 9, (18, 25, 18, 30, 11, 18)  # windows of the runs
ALL = np.arange(sum(LENGTHS))
EVERY = slice(None)  # column
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


def predicted(fits, columns):
    return {key: compensation(one.corrector, columns) for key, one in fits.items()}


# What is left out.


def part_of(features, targets):
    """A coordinate as the search holds it."""
    (part,) = _with_axes(torch.tensor(features), [torch.tensor(targets)])
    return part


def test_single_precision_ends_where_digits_would():
    rng = np.random.default_rng(0)
    part = part_of(rng.normal(size=(len(ALL), 300)), rng.normal(size=(len(ALL), 4)))
    (block, *_) = _blocks(FOLDS, ALL, "cpu")
    few = _FewRows(part, block)
    for ridge, single in ((1e4, True), (1e-6, False)):
        errors = few.without(ridge, few.missed(ridge, EVERY), EVERY)
        assert (errors.dtype == torch.float32) == single, ridge


def test_one_unsound_block_is_in_double_precision_and_leaves_the_others_as_they_are():
    """Three features that only one run has let it nearly fit itself: I - H_bb is almost singular, for it alone."""
    rng, ridge = np.random.default_rng(2), 1e-3
    runs = ALL.reshape(6, 20)
    features = np.concatenate([rng.normal(size=(len(ALL), 12)) / 12**0.5, np.zeros((len(ALL), 3))], axis=1)
    features[runs[1][:3], [12, 13, 14]] = 3.0
    wanted = rng.normal(size=(len(ALL), 4))
    (block,) = _blocks([(np.setdiff1d(ALL, run), run) for run in runs], ALL, "cpu")
    few = _FewRows(part_of(features, wanted), block)
    errors = few.without(ridge, few.missed(ridge, EVERY), EVERY)
    off = np.empty(len(runs))
    for fold, run in enumerate(runs):
        others = np.setdiff1d(ALL, run)
        weights = np.linalg.solve(
            features[others].T @ features[others] + ridge * np.eye(15), features[others].T @ wanted[others]
        )
        off[fold] = np.abs(errors[fold].numpy() - (wanted[run] - features[run] @ weights)).max()
    assert off[1] < 1e-9
    assert (np.delete(off, 1) > 1e-9).all()
    assert off.max() < 1e-5


@pytest.mark.parametrize("units", [12, 300])  # fewer and more than windows
@pytest.mark.parametrize("ridge", [1e-3, 5.0])
@pytest.mark.parametrize("kind", ["runs", "more left out than judged", "one pair"])
@pytest.mark.parametrize(("sound", "rtol"), [(np.inf, 1e-8), (SOUND, 1e-5)], ids=["double", "single"])
def test_errors_without_a_block_are_those_of_a_fit_without_it(units, ridge, kind, sound, rtol, monkeypatch):
    monkeypatch.setattr("shipid.hybrid.ridge.SOUND", sound)
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
    parts = [part_of(*pair) for pair in zip(features, wanted, strict=True)]
    sums, others, errors = _left_out(parts, [ridge], _blocks(folds, ALL, "cpu"), 2)
    np.testing.assert_allclose(sums[0], expected, rtol=rtol)
    np.testing.assert_allclose(others[0].sum(axis=0), (len(folds) - 1) * expected, rtol=rtol)
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
    for seen in features:
        made = seen @ rng.normal(size=(units, 2 * models)) * rng.uniform(0, 2)
        noise = rng.lognormal(0, 1) * rng.normal(size=made.shape)
        parts.append(part_of(seen, made + noise * np.repeat(rng.lognormal(0, 1, count), lengths)[:, None]))
    return parts, runs, windows


@pytest.mark.parametrize(("part_judged", "least", "most"), [(False, 100, 800), (True, 0, 0)])
def test_a_ridge_that_is_passed_over_would_not_be_chosen(part_judged, least, most):
    """Not by all folds, nor by all but one; of windows that are judged in part no such bound is known.

    In draw 3026 the ridge that is best over both folds is best over neither of them.
    """
    ridges, passed_over = list(np.geomspace(1e-4, 1e4, 9)), 0
    for seed in (*range(100), 3026):
        parts, runs, windows = drawn_parts(seed)
        folds = [(np.setdiff1d(windows, run), run[: len(run) // 2] if part_judged else run) for run in runs]
        blocks = _blocks(folds, windows, "cpu")
        sums, others, errors = _left_out(parts, ridges, blocks, 2, np.ones((9, 1), dtype=bool))
        one_by_one, but_one = one_by_one_ridge(parts, ridges, blocks)
        passed = np.isinf(sums).any(axis=1)
        passed_over += int(passed.sum())
        np.testing.assert_array_equal(sums[~passed], one_by_one[~passed])
        np.testing.assert_array_equal(sums.argmin(axis=0), one_by_one.argmin(axis=0))
        np.testing.assert_array_equal(others.argmin(axis=0), but_one.argmin(axis=0))
        kept = errors.of(others[:, :, 0].argmin(axis=0), 0)
        assert np.isfinite(kept[:, np.concatenate([judged for _, judged in folds])].numpy()).all()
    assert least <= passed_over <= most


def one_by_one_ridge(parts, ridges, blocks):
    """Sums of squares over all folds, (ridges, K), and over all but one, (ridges, F, K), of each ridge alone."""
    alone = [_left_out(parts, [ridge], blocks, 2) for ridge in ridges]
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
    for seed in range(200):
        parts, runs, windows = drawn_parts(seed, models=3)
        blocks = _blocks([(np.setdiff1d(windows, run), run) for run in runs], windows, "cpu")
        sums, others, _ = _left_out(parts, ridges, blocks, 2)
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
    assert asked < 0.6 * 200 * 3 * 9
    assert 0.9 < alike / curves_of_all < 1.0


@pytest.mark.parametrize("many_rows", [False, True])
def test_some_ridges_of_some_models_give_the_digits_of_all(many_rows):
    """Draws by seed: some ridges of some models give the digits of all ridges of all models, and nothing else."""
    ridges = list(np.geomspace(1e-3, 1e3, 5))
    for seed in range(20):
        rng = np.random.default_rng(seed)
        runs = np.split(np.arange(60), [20, 35])
        folds = [(np.setdiff1d(np.arange(60), run), run) for run in runs]
        units = int(rng.integers(2, 8)) if many_rows else 40
        seen = [rng.normal(size=(60, units)) for _ in range(2)]
        parts = [part_of(one, one[:, :2] @ rng.normal(size=(2, 8)) + rng.normal(size=(60, 8))) for one in seen]
        blocks, wanted = _blocks(folds, np.arange(60), "cpu"), rng.random((5, 4)) < 0.4
        sums, others, errors = _left_out(parts, ridges, blocks, 2, wanted)
        alone = [_left_out(parts, [ridge], blocks, 2) for ridge in ridges]
        told = np.isfinite(sums)
        assert not (told & ~wanted).any()
        assert (told.any(axis=0) == wanted.any(axis=0)).all()
        np.testing.assert_allclose(sums[told], np.concatenate([one[0] for one in alone])[told], rtol=1e-4)
        for ridge, model in zip(*np.nonzero(told), strict=True):
            np.testing.assert_allclose(others[ridge, :, model], alone[ridge][1][0, :, model], rtol=1e-4)
            kept, expected = (one.of(np.full(3, i), model) for one, i in ((errors, ridge), (alone[ridge][2], 0)))
            np.testing.assert_allclose(kept, expected, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("seed", range(30))
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
    assert _down_to(ridges, 1.0, np.array([3])).tolist() == [3]
    assert _down_to(ridges, 0.5, np.array([3])).tolist() == [2, 3]
    assert _down_to(ridges, 0.1, np.array([3])).tolist() == [2, 3]
    assert _down_to(ridges, 0.03, np.array([1, 4])).tolist() == [0, 1, 2, 3, 4]
    assert _down_to([0.5], 0.1, np.array([0])).tolist() == [0]


def test_a_part_of_the_windows_chooses_nearly_as_well_as_all(columns, targets):
    """The networks are solved with all windows, so that what a part chooses costs little, on the paths and in bands."""
    whole, part = (
        tune(columns, TWINS, targets, FOLDS, recipe(trials=20, averaged=3, search_windows=most), seed=0)["rough"]
        for most in (1000, 60)
    )
    judged = [np.square(one.left_out[:, ALL]).mean() for one in (whole, part)]
    assert judged[1] == pytest.approx(judged[0], rel=0.1)
    assert [trial["number"] for trial in part.trials] == list(range(20))
    assert [trial["state"] for trial in part.trials].count("stopped") == 20 - 3 - SPARE
    ended = [trial for trial in part.trials if trial["state"] == "complete"]
    known = {trial["number"]: trial["value"] for trial in whole.trials}
    assert all(trial["value"] >= known[trial["number"]] * (1 - 1e-6) for trial in ended)  # of fewer ridges
    assert sum(trial["value"] == pytest.approx(known[trial["number"]], rel=1e-5) for trial in ended) > len(ended) / 2
    best = sorted(ended, key=lambda trial: trial["value"])[:3]
    assert best[0]["params"] == part.corrector.hyperparameters


@pytest.mark.parametrize("seed", range(12))
def test_a_part_of_strange_windows_judges_too(seed):
    """Runs of 1 to 60 windows, 1 window to half of them as judges; a fold without any is judged by all windows."""
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 60, rng.integers(3, 9))
    count, ends = lengths.sum(), np.cumsum(lengths)
    runs = [np.arange(end - length, end) for end, length in zip(ends, lengths, strict=True)]
    folds = [(np.setdiff1d(np.arange(count), run), run) for run in runs]
    columns = drawn(seed=seed, count=count)
    targets = {name: scale * rng.normal(size=(STEPS, count, 2)) for name, scale in (("one", 1.0), ("other", 5.0))}
    most = int(rng.choice([1, max(count // 5, 1), count // 2]))
    method = recipe(trials=int(rng.integers(1, 20)), averaged=3, search_windows=most)
    for fitted in tune(columns, TWINS, targets, folds, method, seed=seed).values():
        assert np.isfinite(fitted.left_out).all()
        assert len(fitted.corrector.networks) == min(method.trials, 3)
        assert len(fitted.trials) == method.trials


@pytest.mark.parametrize("search_windows", [1000, 40])
@pytest.mark.parametrize("mirror", [0.0, 1.0])
def test_errors_left_out_are_those_of_a_model_without_the_run(columns, targets, mirror, search_windows):
    """One trial, one ridge: nothing is chosen, so a fit without the run must give the same errors on it."""
    plain = recipe(trials=1, averaged=1, ridge=0.1, mirror=mirror, search_windows=search_windows)
    fitted = tune(columns, TWINS, targets, FOLDS, plain, seed=0)["rough"]
    (network,) = fitted.corrector.networks
    table = columns | wind(columns)
    (weight, offset), _ = network.layers
    hidden = np.tanh(network.normaliser.apply(table) @ weight + offset)
    parts = np.split(hidden, 2, axis=1) if mirror else None
    for axis in (0, 1):
        seen = hidden / hidden.shape[1] ** 0.5
        if parts is not None:
            sign = 1 if axis == 0 else -1
            seen = (parts[0] + sign * parts[1]) / (2 * parts[0].shape[1]) ** 0.5
        for training, judged in FOLDS:
            made = targets["rough"][:, training, axis].T @ network.basis
            gram = seen[training].T @ seen[training] + 0.1 * np.eye(seen.shape[1])
            predicted = network.basis @ (seen[judged] @ np.linalg.solve(gram, seen[training].T @ made)).T
            expected = targets["rough"][:, judged, axis] - predicted
            np.testing.assert_allclose(fitted.left_out[:, judged, axis], expected, atol=1e-5)


def test_a_run_has_no_part_in_the_choice_of_what_judges_it():
    """Two trials, two folds: the first is best for fold 0 and the second for fold 1, so each judges the other fold."""
    search, rows = _Best(most=1), [np.array([0, 1]), np.array([2, 3])]
    for number, by_fold in enumerate([[1.0, 5.0], [4.0, 2.0]]):
        left_out = _LeftOut(sum(by_fold) - np.array(by_fold), torch.full((2, 4, 3), float(number)))
        search.consider(_Verdict(sum(by_fold), np.array([0]), {}, lambda: None, lambda kept=left_out: kept))
    np.testing.assert_array_equal(search.without(rows)[0, :, 0], [1.0, 1.0, 0.0, 0.0])


def test_a_run_has_no_part_in_the_choice_of_the_ridge_that_judges_it():
    """The first ridge is best for fold 0 and the second for fold 1, so each judges the other fold."""
    errors = _Errors(4, 2, 2)
    folds = [(np.array([2, 3]), np.array([0, 1])), (np.array([0, 1]), np.array([2, 3]))]
    (block,) = _blocks(folds, np.arange(4), "cpu")
    piece = _Piece((0, 1), slice(0, 2), block, None)
    for ridge in (0, 1):
        errors.keep(ridge, piece, [0], torch.full((2, 2, 4), float(ridge)))
    by_fold = np.array([[1.0, 5.0], [4.0, 2.0]])
    left_out = _chosen_without(by_fold.sum(axis=1, keepdims=True) - by_fold, errors, 0)
    np.testing.assert_array_equal(left_out.others, [2.0, 1.0])
    np.testing.assert_array_equal(left_out.errors[0, :, 0], [1.0, 1.0, 0.0, 0.0])


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


@pytest.mark.parametrize("mirror", [0.0, 1.0])
@pytest.mark.parametrize("pairs", [FOLDS, FOLDS[:1]])
def test_the_value_of_a_trial_is_the_error_on_windows_it_did_not_see(columns, targets, mirror, pairs):
    setup = recipe(trials=1, mirror=mirror, ridge=0.01)
    for key, one in tuned(columns, targets, setup, folds=pairs).items():
        (row,), (network,) = one.trials, one.corrector.networks
        assert row["params"]["mirror"] == mirror
        expected = refitted(network, mirror, 0.01, columns, targets[key], pairs)
        assert row["value"] == pytest.approx(expected, rel=1e-5)


def test_the_ridge_of_a_trial_is_the_best_of_all(columns, targets):
    setup = recipe(trials=1, ridge=(1e-4, 1e2))
    for key, one in tuned(columns, targets, setup).items():
        values = [tuned(columns, targets, recipe(trials=1, ridge=r))[key].trials[0]["value"] for r in setup.path()]
        assert one.trials[0]["value"] == pytest.approx(min(values), rel=1e-9)
        assert one.trials[0]["params"]["ridge"] == setup.path()[int(np.argmin(values))]


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


# Port and starboard.


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


def as_one(columns):
    for signal in ("n", "alpha"):
        columns[f"starboard.{signal}"] = columns[f"port.{signal}"]
    return ["port.n", "port.alpha"]


def at_one_speed(columns):
    columns["starboard.n"] = columns["port.n"]
    return ["port.n", "port.alpha", "starboard.alpha"]


def toe_in(columns):
    """Fixed a little inwards, each to its side: the mirror image is the ship itself."""
    columns["port.alpha"], columns["starboard.alpha"] = np.full(120, 0.1), np.full(120, -0.1)
    return ["port.n", "starboard.n"]


@pytest.mark.parametrize("act", [as_one, at_one_speed, toe_in])
def test_inputs_that_were_merged_or_dropped_are_mirrored_too(columns, act):
    kept = act(columns)
    paths = np.random.default_rng(2).normal(size=(STEPS, len(ALL), 2))
    one = tuned(columns, {"any": paths}, recipe(mirror=1.0))["any"].corrector
    assert list(one.networks[0].features) == ["u", "v", "r", *kept, "u_rw", "v_rw"]
    assert one.hyperparameters["mirror"] == 1.0
    np.testing.assert_allclose(
        compensation(one, mirrored(columns)), compensation(one, columns) * [1.0, -1.0], atol=1e-12
    )


def test_a_mirrored_log_teaches_a_mirrored_trial_the_same(columns, targets):
    image = {key: paths * [1.0, -1.0] for key, paths in targets.items()}
    here, there = tuned(columns, targets, recipe(mirror=1.0)), tuned(mirrored(columns), image, recipe(mirror=1.0))
    for key in targets:
        values = [[row["value"] for row in fits[key].trials] for fits in (here, there)]
        np.testing.assert_allclose(*values, rtol=1e-9)
        np.testing.assert_allclose(predicted(there, columns)[key], predicted(here, columns)[key], atol=1e-8)
    plain = [tuned(*log, recipe(mirror=0.0))["rough"] for log in ((columns, targets), (mirrored(columns), image))]
    assert plain[0].trials[0]["value"] != pytest.approx(plain[1].trials[0]["value"], rel=1e-3)


def turned(columns):
    columns["starboard.n"] = np.full(len(ALL), 2.0)
    return TWINS


def gone(columns):
    del columns["starboard.n"], columns["starboard.alpha"]
    return TWINS[:2]


def one_sided(columns):
    columns["v"] = np.full(len(ALL), 0.3)
    return TWINS


@pytest.mark.parametrize("spoil", [turned, gone, one_sided])
def test_a_column_without_an_image_leaves_no_mirror(columns, targets, spoil):
    commands = spoil(columns)
    one = tuned(columns, targets, recipe(mirror=1.0), commands=commands)["rough"]
    assert {row["params"]["mirror"] for row in one.trials} == {0.0}
    assert all(network.layers[0][0].shape[1] == 24 for network in one.corrector.networks)


def test_a_ship_that_is_alike_is_learned_from_one_side(columns):
    """Only turns to one side are seen; the mirror knows the other."""
    paths = missed(columns)
    side = np.flatnonzero((columns["r"] > 0.3) & (columns["v"] > 0.0))
    folds = [(np.setdiff1d(side, side[k::4]), side[k::4]) for k in range(4)]
    other = mirrored({name: values[side] for name, values in columns.items()})
    expected = paths[:, side] * [1.0, -1.0]
    left = []
    for share in (0.0, 1.0):
        setup = recipe(mirror=share, units=64)
        compensator = tuned(columns, {"any": paths}, setup, folds=folds)["any"].corrector
        left.append(np.square(compensation(compensator, other) - expected).mean())
    assert left[1] < 0.5 * left[0]


# Company, order, luck.


def test_a_model_does_not_notice_its_company(columns, targets):
    together = tuned(columns, targets, SMALL)
    alone = tuned(columns, {"rough": targets["rough"]}, SMALL)
    assert [row["params"] for row in alone["rough"].trials] == [row["params"] for row in together["rough"].trials]
    np.testing.assert_allclose(
        predicted(alone, columns)["rough"], predicted(together, columns)["rough"], rtol=1e-6, atol=1e-6
    )


def test_nor_the_order_of_runs_windows_or_columns(columns, targets):
    here = tuned(columns, targets, SMALL)
    order = np.random.default_rng(5).permutation(ALL)
    place = np.argsort(order)  # of each window in the new order
    shuffled = {name: values[order] for name, values in reversed(columns.items())}
    folds = [(place[training], place[judged]) for training, judged in reversed(FOLDS)]
    there = tuned(shuffled, {key: paths[:, order] for key, paths in targets.items()}, SMALL, folds=folds)
    for key in targets:
        values = [[row["value"] for row in fits[key].trials] for fits in (here, there)]
        np.testing.assert_allclose(*values, rtol=1e-5)
        np.testing.assert_allclose(predicted(there, columns)[key], predicted(here, columns)[key], rtol=1e-6, atol=1e-6)


def test_the_seed_decides(columns, targets):
    first, again, other = (tuned(columns, targets, SMALL, seed=seed) for seed in (3, 3, 4))
    for key in targets:
        np.testing.assert_array_equal(predicted(first, columns)[key], predicted(again, columns)[key])
        assert np.abs(predicted(other, columns)[key] - predicted(first, columns)[key]).max() > 1e-4


def test_windows_outside_the_folds_are_not_seen(columns, targets):
    folds = [(np.setdiff1d(training, RUNS[5]), judged) for training, judged in FOLDS[:5]]
    before = predicted(tuned(columns, targets, SMALL, folds=folds), drawn(seed=8))
    for values in columns.values():
        values[RUNS[5]] = 1e6
    for paths in targets.values():
        paths[:, RUNS[5]] = np.nan
    after = predicted(tuned(columns, targets, SMALL, folds=folds), drawn(seed=8))
    for key in targets:
        np.testing.assert_array_equal(before[key], after[key])


# What is learned.


def test_what_can_be_solved_is_learned(columns):
    """A compensation of the same kind, of the same hidden units, is recovered where nothing was seen."""
    new = drawn(seed=7)
    setup = recipe(mirror=0.0, trials=1, ridge=1e-9)
    first = tuned(columns, {"any": missed(columns)}, setup)["any"].corrector
    second = tuned(columns, {"any": compensation(first, columns)}, setup)["any"]
    assert second.trials[0]["value"] < 1e-10 * np.square(missed(columns)).mean()
    np.testing.assert_allclose(compensation(second.corrector, new), compensation(first, new), atol=1e-3)


def test_a_smooth_function_is_learned(columns, targets):
    new = drawn(seed=7)
    left = predicted(tuned(columns, targets, recipe(units=128, trials=20)), new)["smooth"] - missed(new)
    assert np.square(left).mean() < 0.1 * np.square(missed(new)).mean()


def test_a_model_that_misses_nothing_gets_nothing(columns, targets):
    one = tuned(columns, targets | {"exact": np.zeros_like(targets["rough"])}, SMALL)["exact"]
    assert (compensation(one.corrector, drawn(seed=7)) == 0.0).all()
    assert {row["value"] for row in one.trials} == {0.0}


def test_targets_in_other_units_scale_all(columns, targets):
    one = tuned(columns, {"any": targets["rough"]}, SMALL)["any"]
    ten = tuned(columns, {"any": 10.0 * targets["rough"]}, SMALL)["any"]
    assert [row["params"] for row in one.trials] == [row["params"] for row in ten.trials]
    np.testing.assert_allclose(
        compensation(ten.corrector, columns), 10.0 * compensation(one.corrector, columns), rtol=1e-7
    )


def test_inputs_in_other_units_change_nothing(columns, targets):
    """Each input has its own z-score: degrees and rpm do as well."""
    units = {"r": 57.3, "port.n": 60.0, "starboard.n": 60.0}
    others = {name: units.get(name, 1.0) * values for name, values in columns.items()}
    setup = recipe(trials=2)
    one, other = (tuned(here, {"any": targets["rough"]}, setup)["any"] for here in (columns, others))
    assert [row["params"] for row in one.trials] == [row["params"] for row in other.trials]
    np.testing.assert_allclose(
        compensation(other.corrector, others), compensation(one.corrector, columns), rtol=1e-5, atol=1e-6
    )


def test_a_model_without_numbers_is_a_value_and_harms_nobody(columns, targets):
    good = tuned(columns, targets, SMALL)
    one = {**targets, "rough": targets["rough"].copy()}
    one["rough"][2, 40, 1] = np.nan
    bad = tuned(columns, one, SMALL)
    assert bad["rough"].corrector is None
    assert [row["state"] for row in bad["rough"].trials] == ["diverged"] * 6
    assert np.isnan([row["value"] for row in bad["rough"].trials]).all()
    np.testing.assert_allclose(
        predicted({"smooth": bad["smooth"]}, columns)["smooth"], predicted(good, columns)["smooth"], atol=1e-6
    )
    lost = {"any": np.full_like(targets["rough"], np.inf)}
    none = tune(columns, TWINS, lost, FOLDS, SMALL, 3)
    assert none["any"].corrector is None
    assert [set(row) for row in none["any"].trials] == [set(row) for row in good["rough"].trials]


# Time.


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


def test_two_steps_are_enough(columns, targets):
    two = {key: paths[[3, 8]] for key, paths in targets.items()}
    for key, one in tuned(columns, two, recipe(units=96)).items():
        assert compensation(one.corrector, columns).shape == (2, 120, 2)
        assert one.trials[0]["value"] < np.square(two[key]).mean()


# Odd data.


def test_duplicates_constants_and_no_wind(columns, targets):
    columns["starboard.n"] = columns["port.n"].copy()
    columns["starboard.alpha"] = np.zeros(120)
    columns["port.alpha"] = np.zeros(120)
    del columns["V_w"]
    one = tuned(columns, targets, recipe(mirror=1.0))["smooth"]
    assert list(one.corrector.networks[0].features) == ["u", "v", "r", "port.n"]
    assert one.corrector.networks[0].features["port.n"] == ("port.n", "starboard.n")
    assert {row["params"]["mirror"] for row in one.trials} == {1.0}
    assert compensation(one.corrector, columns).shape == (STEPS, 120, 2)


def test_two_runs_are_enough(columns, targets):
    folds = [(RUNS[1], RUNS[2]), (RUNS[2], RUNS[1])]
    for key, one in tuned(columns, targets, SMALL, folds=folds).items():
        best = min(row["value"] for row in one.trials)
        assert np.isfinite(best)
        seen = np.concatenate(RUNS[1:3])
        assert best < 1.5 * np.square(targets[key][:, seen]).mean()
        assert np.isfinite(compensation(one.corrector, columns)).all()


@pytest.mark.parametrize(
    ("names", "mirrored"),
    [
        (("port_2.n", "starboard_2.n", "port_2.alpha", "starboard_2.alpha"), True),
        (("left.n", "right.n"), True),
        (("port_2.n", "port_2.alpha"), False),  # the other side is not recorded
        (("bow.n",), False),  # a tunnel's shaft may drive sideways
        (("bow.n", "bow.alpha"), True),
        (("propeller.n", "rudder.delta"), True),
    ],
)
def test_sides_are_distinguished_from_names(names, mirrored):
    rng = np.random.default_rng(2)
    table = {name: rng.normal(size=60) for name in ("u", "v", "r", *names)}
    assert (reflection(table, choose_features(table)) is not None) == mirrored
