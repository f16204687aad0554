"""Profiles: the linear one is the interval of the standard error, others follow their formula, open ends are named."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import least_squares

from shipid.identification.profile import profile_factor, variance_ratio
from shipid.identification.statistics import fit_statistics
from tests.identification.linear import design, fitted, labels, noise

Residuals = Callable[[np.ndarray], np.ndarray]


def refit_of(residuals: Residuals) -> Callable[[str, float, np.ndarray], tuple[float, np.ndarray]]:
    """Hold the first factor, fit the others."""

    def refit(path: str, value: float, start: np.ndarray) -> tuple[float, np.ndarray]:  # noqa: ARG001
        if len(start) == 1:
            return float((residuals(np.array([value])) ** 2).sum()), np.array([value])
        optimum = least_squares(lambda rest: residuals(np.append(value, rest)), start[1:])
        return 2 * float(optimum.cost), np.append(value, optimum.x)

    return refit


@pytest.mark.parametrize("phi", [0.0, 0.8])
def test_a_linear_profile_is_the_interval(phi: float) -> None:
    jacobian, (clusters, signals) = design(12, 40, 3), labels(12, 40)
    error = noise(np.random.default_rng(0), 12, 40, phi)
    fit = fitted(jacobian, error, clusters, signals)
    estimates = fit_statistics(fit)

    def residuals(factors: np.ndarray) -> np.ndarray:
        return fit.residuals - jacobian @ (factors - fit.factors)

    freedom = estimates.covariances[estimates.chosen].freedom[0]
    curve = profile_factor(
        "p0", fit.factors, 0, float(fit.residuals @ fit.residuals), refit_of(residuals),
        half_width=estimates.high[0] - fit.factors[0], freedom=freedom, ratio=variance_ratio(estimates, "p0"),
    )  # fmt: skip
    assert curve.low == pytest.approx(estimates.low[0], abs=0.03 * (estimates.high[0] - fit.factors[0]))
    assert curve.high == pytest.approx(estimates.high[0], abs=0.03 * (estimates.high[0] - fit.factors[0]))
    assert len(curve.values) < 12
    assert "lies between" in curve.sentence
    np.testing.assert_array_equal(curve.values, np.sort(curve.values))


def test_a_skewed_profile_has_the_ends_of_its_formula() -> None:
    """One residual (exp(f) - 1) / w: the interval is ln(1 -+ t w), which the standard error does not know."""
    t, w = stats.t.ppf(0.975, 30), 0.3
    curve = profile_factor(
        "a", np.zeros(1), 0, 0.0, refit_of(lambda f: (np.exp(f) - 1) / w), half_width=t * w, freedom=30.0
    )  # fmt: skip
    assert curve.low == pytest.approx(np.log(1 - t * w), rel=0.05)
    assert curve.high == pytest.approx(np.log(1 + t * w), rel=0.05)
    assert "not converged" not in curve.sentence

    def worse(path: str, value: float, start: np.ndarray) -> tuple[float, np.ndarray]:
        objective, factors = refit_of(lambda f: (np.exp(f) - 1) / w)(path, value, start)
        return objective + 700.0, factors

    other = profile_factor("a", np.zeros(1), 0, 700.0, worse, half_width=t * w, freedom=30.0)  # what no factor explains
    assert (other.low, other.high) == pytest.approx((curve.low, curve.high))
    assert other.sentence == curve.sentence


def test_open_ends_are_reported() -> None:
    """Residual (1 - exp(-5 f)) / 0.4 never exceeds 2.5 on the right but for t = 2; here 0.6: open upwards."""
    one = profile_factor(
        "a", np.zeros(1), 0, 0.0, refit_of(lambda f: (1 - np.exp(-5 * f)) / 0.6), half_width=0.2, freedom=100
    )
    assert np.isfinite(one.low)
    assert np.isinf(one.high)
    assert "upwards it is open" in one.sentence
    flat = profile_factor("a", np.ones(1), 0, 0.0, refit_of(lambda f: 0 * f), half_width=np.inf, freedom=100)
    assert (flat.low, flat.high) == (-np.inf, np.inf)
    assert "not identified" in flat.sentence


def test_a_bound_is_never_passed() -> None:
    asked: list[float] = []

    def refit(path: str, value: float, start: np.ndarray) -> tuple[float, np.ndarray]:  # noqa: ARG001
        asked.append(value)
        return 0.0, start

    curve = profile_factor("a", np.ones(1), 0, 0.0, refit, half_width=0.1, freedom=100, bounds=(0.5, 1.2))
    assert min(asked) == 0.5
    assert max(asked) == 1.2
    assert np.isinf(curve.high)
    assert "from 0.5 (its bound) to 1.2 (its bound) times its base value" in curve.sentence


def test_a_better_fit_on_the_way_is_reported() -> None:
    curve = profile_factor("a", np.ones(1), 0, 6.25, refit_of(lambda f: (f - 1.5) / 0.2), half_width=0.4, freedom=1e6)
    assert "the fit had not converged" in curve.sentence
    assert curve.high == pytest.approx(1.5 + 1.96 * 0.2, abs=0.03)
