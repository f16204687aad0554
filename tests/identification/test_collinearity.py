"""Collinearity: known indices, published thresholds, sets as small as they can be."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.identification.collinearity import collinearity, combinations, index_of, listed

RNG = np.random.default_rng(0)
FREE = np.linalg.qr(RNG.normal(size=(200, 6)))[0]


def correlated(cosine: float) -> np.ndarray:
    """Two columns at an angle of this cosine."""
    return np.stack([FREE[:, 0], cosine * FREE[:, 0] + np.sqrt(1 - cosine**2) * FREE[:, 1]], axis=1)


@pytest.mark.parametrize("cosine", [0.0, 0.9, 0.999])
def test_index_of_two_columns_is_known(cosine: float) -> None:
    """gamma = 1 / sqrt(1 - cosine): 1 at right angles (Brun et al. 2001, eq. 10)."""
    assert index_of(correlated(cosine)) == pytest.approx(1 / np.sqrt(1 - cosine))


def test_condition_indices_and_shares_of_two_columns() -> None:
    """Eigenvalues 1 +- c: eta = sqrt((1 + c) / (1 - c)); the weak direction has (1 + c) / 2 of both variances."""
    diagnosis = collinearity(correlated(0.999), ("a", "b"))
    np.testing.assert_allclose(diagnosis.indices, [1, np.sqrt(1.999 / 0.001)], rtol=1e-9)
    np.testing.assert_allclose(diagnosis.shares[1], 0.9995, rtol=1e-9)
    np.testing.assert_allclose(diagnosis.shares.sum(axis=0), 1)


def test_nothing_depends_on_units() -> None:
    jacobian = RNG.normal(size=(50, 4)) @ RNG.normal(size=(4, 4))
    scale = np.array([1e-5, 1.0, 30.0, 1e4])
    one, other = collinearity(jacobian, "abcd"), collinearity(jacobian * scale, "abcd")
    assert one.gamma == pytest.approx(other.gamma)
    np.testing.assert_allclose(one.indices, other.indices, rtol=1e-6)
    np.testing.assert_allclose(np.abs(one.directions), np.abs(other.directions * scale), rtol=1e-6)


def test_directions_move_the_residuals_as_little_as_they_say() -> None:
    jacobian = correlated(0.999) * np.array([1.0, 20.0])
    diagnosis = collinearity(jacobian, ("a", "b"))
    seen = np.linalg.norm(jacobian @ diagnosis.directions.T, axis=0)
    np.testing.assert_allclose(seen[0] / seen, diagnosis.indices, rtol=1e-9)


def test_sets_are_as_small_as_they_can_be() -> None:
    """b = a, and e = c + d / 2: two sets, and f in neither."""
    a, c, d, f = FREE[:, :4].T
    jacobian = np.stack([a, a + 1e-4 * FREE[:, 4], c, d, c + 0.5 * d + 1e-4 * FREE[:, 5], f], axis=1)
    sets = combinations(jacobian, "abcdef")
    assert {entry.paths for entry in sets} == {("a", "b"), ("c", "d", "e")}
    three = next(entry for entry in sets if len(entry.paths) == 3)
    weights = np.array(three.weights) / three.weights[2]
    np.testing.assert_allclose(weights, [-1, -0.5, 1], atol=1e-3)


def test_columns_at_right_angles_have_no_set_and_each_silent_one_has_one() -> None:
    assert combinations(FREE, "abcdef") == ()
    silent = np.column_stack([FREE[:, :2], np.zeros(200)])
    (silent_one,) = combinations(silent, "abc")
    assert silent_one.sentence() == "c has no effect on these data"
    assert collinearity(silent, "abc").gamma == pytest.approx(1)


def test_a_pair_is_named_in_one_sentence() -> None:
    assert [listed(list("abc")[:count]) for count in (1, 2, 3)] == ["a", "a and b", "a, b and c"]
    (pair,) = combinations(correlated(0.9999) * [1.0, 2.0], ["hull.Y_v", "hull.Y_ur"])
    assert pair.sentence() == "only Y_v and Y_ur together; +10 % of Y_v with -5 % of Y_ur has no effect on these data"
