"""Statistics of a fit: intervals cover, what is not identified is named, nothing depends on units or order."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from shipid.errors import ShipidError
from shipid.identification.statistics import (
    MOST_COLLINEAR,
    Basis,
    LinearFit,
    _Drift,
    _signal_drift,
    against_priors,
    block_clusters,
    collinear_sets,
    factors_of_single_runs,
    fit_statistics,
    invert_information,
    open_to_drift,
    pooled_autocorrelation,
    residual_whiteness,
)
from tests.drawn import seeds
from tests.identification.linear import SIGNALS, design, fitted, labels, linear_fit, noise

RUNS, SAMPLES, COUNT = 20, 80, 6
JACOBIAN = design(RUNS, SAMPLES, COUNT)
CLUSTERS, NAMES = labels(RUNS, SAMPLES)


def one(phi: float = 0.0, seed: int = 3, **more: object) -> LinearFit:
    return fitted(JACOBIAN, noise(np.random.default_rng(seed), RUNS, SAMPLES, phi), CLUSTERS, NAMES, **more)


@pytest.mark.slow
@pytest.mark.parametrize(("runs", "samples", "phi"), [(20, 40, 0.0), (4, 200, 0.8)])
def test_intervals_cover_in_white_and_coloured_noise(runs: int, samples: int, phi: float) -> None:
    """200 replicates: 95 % on average within 92..98, no parameter below 90."""
    jacobian, (clusters, signals) = design(runs, samples, COUNT), labels(runs, samples)
    rng, covered = np.random.default_rng(1), np.zeros(COUNT)
    for _ in range(200):
        estimates = fit_statistics(fitted(jacobian, noise(rng, runs, samples, phi), clusters, signals))
        covered += (estimates.low <= 1) & (estimates.high >= 1)
    assert 0.92 <= covered.mean() / 200 <= 0.98
    assert covered.min() / 200 >= 0.90


def test_which_form_is_chosen() -> None:
    assert fit_statistics(one(0.0)).chosen == "fisher"
    coloured = fit_statistics(one(0.8))
    assert coloured.chosen == "sandwich"
    assert not coloured.covariances["fisher"].trusted
    few = fitted(
        design(3, 400, 3), noise(np.random.default_rng(0), 3, 400, 0.8), *labels(3, 400)
    )  # 3 runs are under 4 degrees of freedom
    assert fit_statistics(few).chosen == "blocks"
    assert "mislead" in fit_statistics(few).covariances["sandwich"].reason


def test_residuals_of_a_signal_that_says_nothing_of_a_factor_do_not_count() -> None:
    """The yaw rate of straight runs: its drift made a fit by two runs doubtful."""
    of_r = np.array(NAMES) == "r"
    error = np.where(
        of_r, noise(np.random.default_rng(1), RUNS, SAMPLES, 0.95), noise(np.random.default_rng(0), RUNS, SAMPLES, 0.0)
    )
    jacobian = np.where(of_r[:, None], 0.0, JACOBIAN)
    fit = fitted(jacobian, error, CLUSTERS, NAMES)
    assert not residual_whiteness(fit, Basis.of_none(fit))["r"].white
    assert fit_statistics(fit).chosen == "fisher"
    assert fit_statistics(fitted(JACOBIAN, error, CLUSTERS, NAMES)).chosen == "sandwich"


def test_factors_that_priors_alone_hold_lend_no_trust() -> None:
    """Four that the data do not see made the sandwich of three runs trusted, and of one run: without a warning."""
    error, names = noise(np.random.default_rng(0), 3, 400, 0.8), labels(3, 400)
    jacobian = design(3, 400, 7) * np.where(np.arange(7) < 3, 1.0, 1e-6)
    widths = np.full(7, 0.3)
    few = fit_statistics(fitted(jacobian[:, :3], error, *names, prior_widths=widths[:3]))
    more = fit_statistics(fitted(jacobian, error, *names, prior_widths=widths))
    assert not more.covariances["sandwich"].trusted
    assert more.chosen == few.chosen
    np.testing.assert_allclose(more.high[:3] - more.low[:3], few.high - few.low, rtol=1e-3)
    np.testing.assert_allclose(more.errors[3:], widths[3:], rtol=1e-3)


def test_fisher_is_the_textbook_formula() -> None:
    """One signal, no prior: s^2 (J^T J)^-1, n - p degrees of freedom."""
    rows = np.array(NAMES) == "u"
    jacobian = JACOBIAN[rows]
    fit = fitted(jacobian, np.random.default_rng(0).normal(size=len(jacobian)), CLUSTERS[rows], ("u",) * rows.sum())
    estimates = fit_statistics(fit).covariances["fisher"]
    freedom = len(jacobian) - COUNT
    expected = fit.residuals @ fit.residuals / freedom * np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(estimates.matrix, expected, rtol=1e-9)
    np.testing.assert_allclose(estimates.freedom, freedom)
    np.testing.assert_allclose(fit_statistics(fit).information, np.linalg.inv(expected), rtol=1e-9)


@pytest.mark.parametrize("runs", [1, 3])
def test_fisher_counts_the_correlation_of_the_residuals(runs: int) -> None:
    """One signal: s^2 J^+ R J^+^T with the error level of residuals (1 - H) e of errors with the correlations R."""
    jacobian, error = design(runs, 120, 3)[:: len(SIGNALS)], noise(np.random.default_rng(0), runs, 120, 0.8)
    clusters = np.repeat(np.arange(runs), 120)
    fit = fitted(jacobian, error[: len(jacobian)], clusters, ("u",) * len(jacobian))
    estimates = fit_statistics(fit)
    memory = estimates.whiteness["u"].memory
    apart = np.abs(np.subtract.outer(np.arange(len(jacobian)), np.arange(len(jacobian))))
    correlation = ((memory - 1) / (memory + 1)) ** apart * (clusters[:, None] == clusters)
    inverse = np.linalg.pinv(jacobian)
    left = (np.eye(len(jacobian)) - jacobian @ inverse) @ correlation
    level = fit.residuals @ fit.residuals / np.trace(left)
    form = estimates.covariances["fisher"]
    np.testing.assert_allclose(form.matrix, level * inverse @ correlation @ inverse.T, rtol=1e-9)
    np.testing.assert_allclose(form.freedom, np.trace(left) ** 2 / np.trace(left @ left), rtol=1e-9)
    assert not form.trusted


def test_sandwich_is_the_jackknife_over_runs() -> None:
    """In the ratios of its entries: the estimates are computed again without each run."""
    fit = one(0.8)
    matrix = fit_statistics(fit).covariances["sandwich"].matrix
    again = [
        np.linalg.lstsq(fit.jacobian[fit.clusters != run], -fit.residuals[fit.clusters != run], rcond=None)[0]
        for run in range(RUNS)
    ]
    expected = np.array(again).T @ np.array(again)
    np.testing.assert_allclose(matrix / matrix[0, 0], expected / expected[0, 0], rtol=1e-6, atol=1e-6)
    assert matrix[0, 0] / expected[0, 0] == pytest.approx((RUNS - 1) / RUNS, rel=0.1)


def test_intervals_cover_what_one_run_alone_excites() -> None:
    """That run has no residuals along such a factor: they say nothing of its error."""
    runs, samples = 10, 40
    jacobian, (clusters, signals) = design(runs, samples, COUNT), labels(runs, samples)
    jacobian[clusters > 0, 0] = 0.0
    rng, covered = np.random.default_rng(1), np.zeros(COUNT)
    for _ in range(60):
        estimates = fit_statistics(fitted(jacobian, noise(rng, runs, samples, 0.8), clusters, signals))
        assert estimates.chosen == "sandwich"
        covered += (estimates.low <= 1) & (estimates.high >= 1)
    assert covered.min() / 60 >= 0.9


def test_a_run_that_alone_decides_a_factor_is_named() -> None:
    names = tuple(f"M{number + 1:02d}" for number in range(RUNS))
    jacobian = JACOBIAN.copy()
    jacobian[CLUSTERS != 4, 2] *= 0.01
    fit = fitted(jacobian, noise(np.random.default_rng(0), RUNS, SAMPLES, 0.8), CLUSTERS, NAMES, runs=names)
    assert factors_of_single_runs(fit_statistics(fit)) == {fit.paths[2]: "M05"}
    assert factors_of_single_runs(fit_statistics(one(0.8, runs=names))) == {}


def test_freedom_of_a_mean_over_equal_clusters() -> None:
    """G equal clusters, one mean: Satterthwaite gives G - 1."""
    clusters = np.repeat(np.arange(7), 12)
    fit = fitted(np.ones((84, 1)), np.random.default_rng(0).normal(size=84), clusters, ("u",) * 84)
    assert fit_statistics(fit).covariances["sandwich"].freedom[0] == pytest.approx(6)


def test_scaling_a_parameter_scales_its_interval() -> None:
    fit, scale = one(0.8), np.array([1e-6, 1.0, 1e3, 1e6, 0.1, 7.0])
    scaled = replace(fit, jacobian=fit.jacobian / scale, factors=fit.factors * scale)
    np.testing.assert_allclose(fit_statistics(scaled).errors, fit_statistics(fit).errors * scale, rtol=1e-6)
    np.testing.assert_allclose(fit_statistics(scaled).correlations, fit_statistics(fit).correlations, atol=1e-9)


def test_order_of_runs_and_parameters_is_of_no_account() -> None:
    fit, rng = one(0.8), np.random.default_rng(5)
    estimates = fit_statistics(fit)
    rows = np.concatenate([np.flatnonzero(fit.clusters == run) for run in rng.permutation(RUNS)])
    columns = rng.permutation(COUNT)
    moved = linear_fit(
        tuple(fit.paths[j] for j in columns),
        fit.factors[columns],
        fit.residuals[rows],
        fit.jacobian[np.ix_(rows, columns)],
        fit.clusters[rows],
        tuple(fit.signals[k] for k in rows),
    )
    np.testing.assert_allclose(fit_statistics(moved).errors, estimates.errors[columns], rtol=1e-8)
    assert [fit_statistics(moved).sentences[k] for k in range(COUNT)] == [estimates.sentences[j] for j in columns]


def test_levels_and_memory_are_measured() -> None:
    """An AR(1) of 0.8 has an integrated correlation time of (1 + 0.8) / (1 - 0.8) = 9 samples."""
    colours = fit_statistics(one(0.0)).whiteness
    assert {name: round(colours[name].level, 1) for name in SIGNALS} == {"u": 1.3, "v": 0.6, "r": 1.0}
    assert all(colour.white for colour in colours.values())
    coloured = fit_statistics(one(0.8)).whiteness
    assert np.mean([colour.memory for colour in coloured.values()]) == pytest.approx(9, rel=0.25)
    assert not any(colour.white for colour in coloured.values())
    fit = one(0.8)
    of_u = np.array(fit.signals) == "u"
    rho = pooled_autocorrelation([fit.residuals[of_u & (fit.clusters == run)] for run in np.unique(fit.clusters)])
    pairs = [rho[k] + rho[k + 1] for k in range(1, len(rho) - 1, 2)]
    until = next(k for k, pair in enumerate(pairs) if pair <= 0)
    assert coloured["u"].memory == pytest.approx(1 + 2 * sum(pairs[:until]))


def test_whiteness_is_that_of_ljung_and_box_and_of_means_over_quarters() -> None:
    """Q = n (n + 2) sum r_k^2 / (n - k) is chi squared, of several runs the sums are added; so are means over quarters.

    The smaller probability counts, times two for two tests.
    """
    expected, freedom, runs = 0.0, 0, (37, 60)
    errors = [np.random.default_rng(n).normal(size=n) for n in runs]
    for error in errors:
        n, lags = len(error), min(10, len(error) // 5)
        r = np.array([error[k:] @ error[:-k] for k in range(1, lags + 1)]) / (error @ error)
        expected += n * (n + 2) * float((r**2 / (n - np.arange(1, lags + 1))).sum())
        freedom += lags
    clusters = np.repeat([0, 1], runs)
    fit = linear_fit(("p",), np.ones(1), np.concatenate(errors), np.ones((97, 1)), clusters, ("u",) * 97)
    drifts = sum(float(part.sum() ** 2 / len(part) / np.mean(e**2)) for e in errors for part in np.array_split(e, 4))
    both = stats.chi2.sf(expected, freedom), stats.chi2.sf(drifts, 8)
    assert residual_whiteness(fit, Basis.of_none(fit))["u"].probability == pytest.approx(min(2 * min(both), 1.0))


T = np.arange(200)
START = 3 * np.exp(-T / 60)  # what a start that is known to one standard deviation does to a run
SLOW = np.column_stack([np.ones(200), np.sin(T / 32), np.sin(T / 14), np.sin(T / 6), np.cos(T / 2)])
QUARTER = np.kron(np.eye(4), np.ones(50))


def begun(error: np.ndarray, jacobian: np.ndarray = SLOW, runs: int = 1) -> LinearFit:
    """Fit of runs of 200 rows whose starts, drawn from their priors by the caller, are nuisances."""
    away = START[:, None] / np.linalg.norm(START)
    shrunk = 1 / np.sqrt(1 + START @ START) - 1
    whiten = np.kron(np.eye(runs), np.eye(200) + shrunk * away @ away.T)
    spent = np.tile((away**2).ravel() * (1 - (1 + shrunk) ** 2), runs)
    clusters, signals = np.repeat(np.arange(runs), 200), ("u",) * 200 * runs
    return fitted(whiten @ np.tile(jacobian, (runs, 1)), whiten @ error, clusters, signals, spent=spent)


def drifts(fit: LinearFit) -> _Drift:
    return _signal_drift(fit, [np.flatnonzero(fit.clusters == run) for run in np.unique(fit.clusters)], Basis.of(fit))


def drift_levels(fit: LinearFit) -> np.ndarray:
    """Variance of the residuals of each run, with what the factors have taken."""
    left = 1 - Basis.of(fit).leverage
    return np.array([np.square(fit.residuals[fit.clusters == run]).sum() / left[fit.clusters == run].sum()
                     for run in np.unique(fit.clusters)])  # fmt: skip


@pytest.mark.parametrize("prior", [np.inf, 0.2])
def test_the_covariance_of_means_over_quarters_is_that_of_residuals_of_a_fit(prior: float) -> None:
    """Q (I - H) Q^T: the factors have taken in what is slow."""
    fit = begun(np.random.default_rng(0).normal(size=400), runs=2)
    fit = replace(fit, prior_widths=np.full(SLOW.shape[1], prior))
    Q = np.kron(np.eye(2), QUARTER) / 50**0.5
    inverse = np.linalg.inv(fit.jacobian.T @ fit.jacobian + np.eye(SLOW.shape[1]) / prior**2)
    C = Q @ (np.eye(400) - fit.jacobian @ inverse @ fit.jacobian.T) @ Q.T
    z, expected, squares = Q @ fit.residuals, np.trace(C), np.trace(C @ C)
    freedom, level = expected**2 / squares, np.repeat(drift_levels(fit), 4)
    seen, total = drifts(fit), float((z**2 / level).sum())
    assert seen.ratio == pytest.approx(1 + (total - expected) / squares)
    assert seen.probability == pytest.approx(stats.chi2.sf(total * expected / squares, freedom))
    assert seen.hidden == pytest.approx((stats.chi2.isf(0.025, freedom) / freedom - 1) * expected / squares)
    assert expected < 7


def test_ten_runs_show_a_drift_that_would_matter() -> None:
    rng = np.random.default_rng(0)
    few, more = (fit_statistics(begun(rng.normal(size=200 * runs), runs=runs)) for runs in (2, 10))
    assert open_to_drift(few)["p0"] > 1.3
    assert not open_to_drift(more)


def test_autocorrelation_is_the_mean_product_of_all_pairs() -> None:
    """Over runs of different lengths; runs of few rows or without errors count for nothing."""
    rng = np.random.default_rng(4)
    runs = [rng.normal(size=count).cumsum() for count in (30, 50)]
    rho = pooled_autocorrelation([runs[0], np.ones(3), np.zeros(40), runs[1]])
    products = [[run[i] * run[i + lag] for run in runs for i in range(len(run) - lag)] for lag in range(50)]
    np.testing.assert_allclose(rho, [np.mean(each) / np.mean(products[0]) for each in products], rtol=1e-9)


@pytest.mark.parametrize("phi", [0.0, 0.8])
def test_a_prior_much_narrower_than_the_data_is_the_error_in_every_form(phi: float) -> None:
    widths = 1e-5 * np.arange(1, COUNT + 1)
    estimates = fit_statistics(one(phi, prior_widths=widths))
    assert {"fisher", "sandwich"} <= set(estimates.covariances)
    for form in estimates.covariances.values():
        np.testing.assert_allclose(form.errors, widths, rtol=1e-3)


@pytest.mark.parametrize(("phi", "width"), [(0.0, 1.0), (0.8, 1e-3)])
def test_what_the_data_alone_say_is_not_changed_by_priors(phi: float, width: float) -> None:
    """Correlated residuals widen it as without priors: tight priors hid them, and factors were called identified."""
    without = fit_statistics(one(phi))
    widths = np.where(np.arange(COUNT) < 4, width, np.inf)
    np.testing.assert_allclose(fit_statistics(one(phi, prior_widths=widths)).alone, without.alone, rtol=1e-6)


def test_a_pair_that_acts_as_one_is_named() -> None:
    """p1 has 2 x the effect of p0, but for 1e-6: neither is identified, their combination is named, others are."""
    jacobian = JACOBIAN.copy()
    jacobian[:, 1] = 2 * jacobian[:, 0] + 1e-6 * jacobian[:, 1]
    estimates = fit_statistics(fitted(jacobian, noise(np.random.default_rng(0), RUNS, SAMPLES, 0.0), CLUSTERS, NAMES))
    assert estimates.identifiable.tolist() == [False, False, True, True, True, True]
    assert "only p0 and p1 together; +10 % of p0 with -5 % of p1 has no effect" in estimates.sentences[0]


def test_what_has_no_effect_is_named() -> None:
    jacobian = JACOBIAN.copy()
    jacobian[:, 2] = 0
    estimates = fit_statistics(fitted(jacobian, noise(np.random.default_rng(0), RUNS, SAMPLES, 0.0), CLUSTERS, NAMES))
    assert np.isinf(estimates.high[2])
    assert not estimates.identifiable[2]
    assert estimates.identifiable.sum() == COUNT - 1
    assert "p2 has no effect" in estimates.sentences[2]


@pytest.mark.parametrize(("size", "why"), [(1.0, "others do a part of the same"), (0.01, "hardly excited")])
def test_a_wide_interval_has_its_reason(size: float, why: str) -> None:
    """p1 and p0 at an angle of 8 deg are no set, but each would be known without the other; it was 'hardly excited'."""
    jacobian = np.linalg.qr(np.random.default_rng(3).normal(size=(3000, 3)))[0] * 10
    jacobian[:, 1] = size * (np.cos(np.radians(8)) * jacobian[:, 0] + np.sin(np.radians(8)) * jacobian[:, 1])
    error = np.random.default_rng(0).normal(size=3000)
    estimates = fit_statistics(fitted(jacobian, error, np.repeat(np.arange(6), 500), ("u",) * 3000))
    assert not estimates.combinations
    assert estimates.identifiable[2]
    assert estimates.sentences[1].endswith(f"% of its base value, {why}")


def test_a_prior_narrows_the_interval_but_identifies_nothing() -> None:
    jacobian = JACOBIAN.copy()
    jacobian[:, 2] *= 1e-4
    error, widths = noise(np.random.default_rng(0), RUNS, SAMPLES, 0.0), np.full(COUNT, 0.2)
    estimates = fit_statistics(fitted(jacobian, error, CLUSTERS, NAMES, prior_widths=widths))
    assert estimates.errors[2] == pytest.approx(0.2, rel=1e-3)
    assert not estimates.identifiable[2]
    assert estimates.alone[2] > 10
    assert re.fullmatch(r"p2 is not identified: \+-\d+ % of its base value, hardly excited", estimates.sentences[2])


def test_what_ends_at_a_bound_has_no_interval_and_harms_no_other() -> None:
    bound = np.array([False, True, False, False, False, False])
    estimates = fit_statistics(one(at_bound=bound))
    assert np.isinf(estimates.high[1])
    assert "bound" in estimates.sentences[1]
    fewer = np.delete(one().jacobian, 1, axis=1)
    without = linear_fit("abcde", np.ones(5), one().residuals, fewer, CLUSTERS, NAMES)
    np.testing.assert_allclose(estimates.errors[~bound], fit_statistics(without).errors, rtol=1e-9)


def test_what_is_held_counts_as_known() -> None:
    """Held or dropped factors have no interval and do not widen those of others."""
    held = np.array([False, True, False, True, False, False])
    estimates = fit_statistics(one(held=held, dropped=("p3",)))
    assert np.isinf(estimates.high[held]).all()
    assert not estimates.identifiable[held].any()
    assert "p1 was held at " in estimates.sentences[1]
    assert "p3 was dropped" in estimates.sentences[3]
    without = linear_fit("abcd", np.ones(4), one().residuals, one().jacobian[:, ~held], CLUSTERS, NAMES)
    np.testing.assert_allclose(estimates.errors[~held], fit_statistics(without).errors, rtol=1e-9)


def test_nuisances_cost_degrees_of_freedom() -> None:
    """A free level for each run and signal, projected out: the level of the noise stays right."""
    error = noise(np.random.default_rng(0), RUNS, 8, 0.0)
    shape = (RUNS * 3, 8)

    def centred(values: np.ndarray) -> np.ndarray:
        parts = values.reshape(*shape, -1)
        return (parts - parts.mean(axis=1, keepdims=True)).reshape(len(values), -1)

    jacobian = centred(design(RUNS, 8, 3))
    fit = fitted(jacobian, centred(error[:, None])[:, 0], *labels(RUNS, 8), spent=np.full(len(error), 1 / 8))
    levels = {name: colour.level for name, colour in fit_statistics(fit).whiteness.items()}
    plain = {name: colour.level for name, colour in fit_statistics(replace(fit, spent=0 * fit.spent)).whiteness.items()}
    assert levels["u"] == pytest.approx(1.3, abs=0.15)
    assert levels["u"] / plain["u"] == pytest.approx(np.sqrt(8 / 7), rel=0.01)


def test_blocks_cut_all_signals_at_the_same_times() -> None:
    numbers = block_clusters(one(), 20)
    assert len(np.unique(numbers)) == RUNS * 4
    for run in range(RUNS):
        u, v, r = (numbers[(run == CLUSTERS) & (np.array(NAMES) == name)] for name in SIGNALS)
        assert (u == v).all()
        assert (v == r).all()


def test_fits_without_a_meaning_are_refused() -> None:
    fit = one()
    with pytest.raises(ShipidError, match="use more data"):
        fit_statistics(linear_fit(fit.paths, fit.factors, fit.residuals[:5], fit.jacobian[:5], CLUSTERS[:5], NAMES[:5]))
    with pytest.raises(ShipidError, match="finite"):
        fit_statistics(replace(fit, residuals=fit.residuals * np.nan))


@pytest.mark.parametrize(("width", "true", "contrary"), [(0.01, 1.6, True), (0.1, 1.6, True), (1.0, 1.6, False)])
def test_a_prior_that_the_data_contradict_is_told(width: float, true: float, contrary: bool) -> None:
    """However tight it is: 0.01 holds the estimate near 1, with an interval that is far from the truth."""
    rng = np.random.default_rng(5)
    J = rng.normal(0, 0.5, (400, 2))
    measured = J @ np.array([true, 1.0]) + rng.normal(0, 1.0, 400)
    prior = np.array([width, np.inf])
    precision = np.diag(1 / prior**2)
    factors = np.linalg.solve(J.T @ J + precision, J.T @ measured + precision @ np.ones(2))
    fit = linear_fit(
        ("hull.p1", "hull.p2"),
        factors,
        J @ factors - measured,
        J,
        np.repeat(np.arange(8), 50),
        ("u",) * 400,
        prior_widths=prior,
    )
    alone = np.linalg.lstsq(J, measured, rcond=None)[0]
    error = np.sqrt(np.linalg.inv(J.T @ J)[0, 0])
    assert (abs(alone[0] - 1) > 3 * np.hypot(width, error)) == contrary
    told = against_priors(fit_statistics(fit))
    assert list(told) == (["hull.p1"] if contrary else [])
    if contrary:
        assert told["hull.p1"][:2] == pytest.approx((width, alone[0]))


def test_what_may_have_no_effect_is_not_identified() -> None:
    """A factor of 0.66 [-0.015, 1.33] was called identified."""
    fit = one()
    small = replace(fit, factors=np.where(np.arange(len(fit.factors)) == 0, 1e-3, fit.factors))
    before, after = fit_statistics(fit), fit_statistics(small)
    assert before.identifiable[0]
    assert not after.identifiable[0]
    assert after.low[0] < 0 < after.high[0]
    assert "its interval holds 0, no effect" in after.sentences[0]
    assert (after.identifiable[1:] == before.identifiable[1:]).all()


@pytest.mark.parametrize("seed", range(8))
def test_nothing_is_called_identified_whose_interval_holds_no_effect(seed: int) -> None:
    """Also a current, or a number whose base is 0: its sentence has its unit, and no share of a scale."""
    rng = np.random.default_rng(seed)
    fit = one(float(rng.choice([0.0, 0.8])), prior_widths=rng.choice([0.01, 0.3, np.inf], COUNT))
    shown = replace(
        fit, factors=rng.choice([0.0, 1e-3, 0.1, 1.0], COUNT) * rng.choice([-1, 1], COUNT),
        centre=rng.choice([0.0, 1.0], COUNT), sizes=((-5.0, "m/s"),) * COUNT,
    )  # fmt: skip
    judged = fit_statistics(shown)
    no_effect = (judged.low <= 0) & (judged.high >= 0)
    assert no_effect.any()
    assert not judged.identifiable[no_effect].any()
    for known, sentence, centre in zip(judged.identifiable, judged.sentences, shown.centre, strict=True):
        assert (" is not identified: " in sentence) != known
        assert re.search(r"\+-[\d.]+ m/s" if centre == 0 else r"\+-[\d.]+ % of its base value", sentence)
        assert "scale" not in sentence


RNG = np.random.default_rng(0)
FREE = np.linalg.qr(RNG.normal(size=(200, 6)))[0]


def correlated(cosine: float) -> np.ndarray:
    """Two columns at an angle of this cosine."""
    return np.stack([FREE[:, 0], cosine * FREE[:, 0] + np.sqrt(1 - cosine**2) * FREE[:, 1]], axis=1)


@pytest.mark.parametrize("cosine", [0.996, 0.9999])
def test_index_of_two_columns_is_known(cosine: float) -> None:
    """gamma = 1 / sqrt(1 - cosine) (Brun et al. 2001, eq. 10)."""
    (pair,) = collinear_sets(correlated(cosine), "ab")
    assert pair.gamma == pytest.approx(1 / np.sqrt(1 - cosine))


def test_a_set_has_an_index_above_the_limit() -> None:
    """gamma = 15 at a cosine of 1 - 1 / 225."""
    limit = 1 - 1 / MOST_COLLINEAR**2
    assert collinear_sets(correlated(limit - 1e-5), "ab") == ()
    assert len(collinear_sets(correlated(limit + 1e-5), "ab")) == 1


def test_nothing_depends_on_units() -> None:
    """b = a, and c has no effect: the weights of the set are those of the factors."""
    jacobian = np.column_stack([correlated(0.9999), np.zeros(200), FREE[:, 2]])
    scale = np.array([0.01, 30.0, 1.0, 100.0])
    for one, other in zip(collinear_sets(jacobian, "abcd"), collinear_sets(jacobian * scale, "abcd"), strict=True):
        assert one.names == other.names
        assert one.gamma == pytest.approx(other.gamma, rel=1e-6)
        if len(one.names) == 2:
            ratio = np.array(other.weights) / one.weights
            assert ratio[1] / ratio[0] == pytest.approx(0.01 / 30.0)


def test_the_weights_move_the_residuals_as_little_as_the_index_says() -> None:
    jacobian = correlated(0.999) * np.array([1.0, 20.0])
    (pair,) = collinear_sets(jacobian, "ab")
    moved = np.array(pair.weights)
    seen = np.linalg.norm(jacobian @ moved) / np.linalg.norm(moved * [1.0, 20.0])
    assert seen == pytest.approx(1 / pair.gamma)


def test_sets_are_as_small_as_they_can_be() -> None:
    """b = a, and e = c + d / 2: two sets, and f in neither."""
    a, c, d, f = FREE[:, :4].T
    jacobian = np.stack([a, a + 1e-4 * FREE[:, 4], c, d, c + 0.5 * d + 1e-4 * FREE[:, 5], f], axis=1)
    sets = collinear_sets(jacobian, "abcdef")
    assert {entry.paths for entry in sets} == {("a", "b"), ("c", "d", "e")}
    three = next(entry for entry in sets if len(entry.paths) == 3)
    weights = np.array(three.weights) / three.weights[2]
    np.testing.assert_allclose(weights, [-1, -0.5, 1], atol=1e-3)


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_of_seen_directions_it_is_the_inverse(seed: int) -> None:
    """Parameters of very different size too: an information matrix in mixed units."""
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(30, 5)) * 10.0 ** rng.uniform(-6, 6, 5)
    inverse, silent = invert_information(J.T @ J)
    scale = np.sqrt(np.diag(J.T @ J))
    np.testing.assert_allclose(
        inverse * np.outer(scale, scale), np.linalg.inv((J / scale).T @ (J / scale)), rtol=1e-6, atol=1e-9
    )
    assert not silent.any()


def test_parameters_along_a_direction_without_data_are_named() -> None:
    """The first two act together, the last not at all; the third is known as if it were alone."""
    J = np.zeros((20, 4))
    J[:, 0] = J[:, 1] = np.linspace(-1, 1, 20)
    J[:, 2] = 2.0
    inverse, silent = invert_information(J.T @ J)
    assert silent.tolist() == [True, True, False, True]
    assert inverse[2, 2] == pytest.approx(1 / (20 * 4.0))
    assert np.isfinite(inverse).all()
