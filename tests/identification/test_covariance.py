from __future__ import annotations

import numpy as np
import pytest

from shipid.identification.collinearity import invert_information
from tests.drawn import seeds


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
