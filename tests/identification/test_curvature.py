"""Laws of curved fits: linear ones are never named, curved ones are, on the side on which the profile is longer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from shipid.identification.fit import local_linearisation
from shipid.identification.profile import MOST, Beside, curvature_sentence, curvature_warning, interval_end_ratios
from shipid.identification.residuals import build_problem
from shipid.identification.settings import Identify
from shipid.identification.solve import identify
from shipid.identification.statistics import Statistics, fit_statistics
from shipid.vessel.load import load_vessel
from tests.drawn import seeds
from tests.identification.linear import design, fitted, labels, linear_fit, noise
from tests.identification.trials import noisy, trials


@pytest.mark.parametrize("seed", seeds(2, 2))
@pytest.mark.parametrize("prior", [None, 0.4])
def test_a_linear_fit_is_not_named(seed: int, prior: float | None) -> None:
    n, (clusters, signals) = 4, labels(6, 40)
    jacobian = design(6, 40, n, seed=seed) / 10
    error = noise(np.random.default_rng(seed), 6, 40, 0.0)
    widths = np.full(n, np.inf if prior is None else prior)
    fit = fitted(jacobian, error, clusters, signals, prior_widths=widths)
    judged = fit_statistics(fit)

    def at(change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        priors = (fit.factors + change - 1) / widths
        return (
            np.append(fit.residuals + fit.jacobian @ change, priors),
            np.vstack([fit.jacobian, np.diag(1 / widths)]),
        )

    seen = interval_end_ratios(judged, at)
    assert seen
    np.testing.assert_allclose(list(seen.values()), 1.0, rtol=1e-6)
    assert curvature_sentence(judged, seen) == ""


def test_a_single_factor_has_the_rise_of_its_formula() -> None:
    """Residuals (exp(f - 1) - 1) / w: at the end h the squares rise by (exp(h) - 1)^2 in place of h^2."""
    rng, m = np.random.default_rng(0), 60
    error = rng.normal(size=m)
    error -= error.mean()
    w = 0.25 * m**0.5

    def at(change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return error + (np.exp(change[0]) - 1) / w, np.full((m, 1), np.exp(change[0]) / w)

    judged = _judged(("a",), np.ones(1), at)
    h = float(judged.high[0] - 1)
    assert interval_end_ratios(judged, at, ["a"]) == {}
    assert interval_end_ratios(judged, at)["a"] == pytest.approx((h / (1 - np.exp(-h)), h / (np.exp(h) - 1)), rel=1e-6)


def test_growth_that_is_cut_short_is_named() -> None:
    """y = a (1 - exp(-b t)), the curved example of Bates and Watts: the first part of the growth, and all of it."""
    named = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        a, b, error = rng.uniform(0.8, 1.2), rng.uniform(0.8, 1.2), 0.04 * rng.normal(size=40)
        judged, at = _growth(np.linspace(0.2, 6, 40), a, b, error)
        assert curvature_sentence(judged, interval_end_ratios(judged, at)) == ""
        judged, at = _growth(np.linspace(0.05, 0.9, 40), a, b, error)
        named += bool(curvature_sentence(judged, interval_end_ratios(judged, at)))
    assert named >= 18


def test_an_end_that_diverges_is_outside_and_one_that_is_flat_is_far() -> None:
    judged = _judged(("a",), np.ones(1), _line)

    def diverging(change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        e, J = _line(change)
        return (e * np.nan, J) if change[0] > 0 else (e, J)

    assert interval_end_ratios(judged, diverging)["a"] == pytest.approx((1.0, 0.0))
    seen = interval_end_ratios(judged, lambda change: _line(np.minimum(change, 0.01)))
    assert seen["a"] == pytest.approx((1.0, MOST))
    assert "estimates: a upwards 3; compare with --profile a, or" in curvature_sentence(judged, seen)


def _line(change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    J = np.ones((40, 1))
    return np.tile([1.0, -1.0], 20) + J @ change, J


@pytest.mark.parametrize("more", [{}, {"loss": "huber"}, {"prior": {"*": 0.3}}, {"nuisance": []}])
def test_the_fit_beside_the_estimate(more: dict[str, Any]) -> None:
    """Its squares are the objective; changes of it are those of its Jacobian; curvature at an end as evaluated anew."""
    vessel = load_vessel("gunnerus-28.9")
    sizes = {"u": 0.05, "v": 0.05, "r": np.radians(0.1)}
    data = noisy(trials(vessel, 2, 40), sizes, 3)
    paths = [f"hull.derivatives.{name}" for name in ("X_u|u|", "Y_uv", "N_ur")]
    settings = Identify(
        **{"parameters": paths, "weights": sizes, "nuisance": ["initial_state"], "start": "base", **more}
    )
    solution = identify(vessel, data, data.runs, settings)
    problem = build_problem(solution.vessel, data, solution.runs, solution.settings)
    at = local_linearisation(problem, solution.factors, solution.point)
    e, J = at(np.zeros(3))
    assert e @ e == pytest.approx(solution.objective, rel=1e-7)
    change = 1e-5 * np.array([1.0, -2.0, 3.0])
    assert np.square(at(change)[0]).sum() - e @ e == pytest.approx(
        2 * e @ J @ change + np.square(J @ change).sum(), abs=1e-6
    )
    judged = fit_statistics(solution)
    assert curvature_warning(solution, data, judged) == ""
    for times in interval_end_ratios(judged, at).values():
        np.testing.assert_allclose(times, 1.0, atol=0.1)


def _judged(paths: tuple[str, ...], factors: np.ndarray, at: Beside) -> Statistics:
    e, J = at(np.zeros(len(paths)))
    m = len(e)
    return fit_statistics(linear_fit(paths, factors, e, J, np.zeros(m, dtype=int), ("u",) * m))


def _growth(t: np.ndarray, a: float, b: float, error: np.ndarray) -> tuple[Statistics, Beside]:
    """A fit of growth with these errors of 0.04, linearised at other factors."""
    y = a * (1 - np.exp(-b * t)) + error

    def residuals(f: np.ndarray) -> np.ndarray:
        return np.asarray((f[0] * (1 - np.exp(-f[1] * t)) - y) / 0.04)

    def jacobian(f: np.ndarray) -> np.ndarray:
        return np.stack([1 - np.exp(-f[1] * t), f[0] * t * np.exp(-f[1] * t)], axis=1) / 0.04

    best = least_squares(residuals, [1.0, 1.0], jac=jacobian, xtol=1e-12, ftol=1e-12).x

    def at(change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return residuals(best + change), jacobian(best + change)

    return _judged(("a", "b"), best, at), at
