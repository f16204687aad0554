"""Collinearity: known indices, published thresholds, sets as small as they can be."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.identification.collinearity import MOST_COLLINEAR, collinear_sets

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
