"""Angles that wrap."""

import numpy as np
import pytest

from shipid.logs.frames import unwrap_in_place


@pytest.mark.parametrize("seed", range(3))
def test_angles_are_unwrapped_as_numpy_does(seed: int) -> None:
    random = np.random.default_rng(seed)
    turns = np.cumsum(random.normal(0.0, 1.5, 500))
    for values in (
        turns % (2 * np.pi),
        np.angle(np.exp(1j * turns)),
        np.pi * random.integers(-3, 4, 500).astype(float),
    ):
        expected = np.unwrap(values)
        unwrap_in_place(values)
        np.testing.assert_allclose(values, expected, atol=1e-9)
