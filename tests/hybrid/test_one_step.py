from __future__ import annotations

import numpy as np
import pytest

from shipid.hybrid.one_step import OneStep
from tests.hybrid.worlds import fitted, ship, world


def missing(nus, commands):
    """A force of state and commands that no coefficient of the physics can stand for."""
    u, v, r = nus[-1].T
    n, alpha = commands[-1]["port.n"], commands[-1]["port.alpha"]
    return np.stack(
        [-6e3 * np.tanh(u - 3) - 4e5 * r**2, 3e4 * np.tanh(4 * r * n) - 2e4 * v, 2e5 * alpha * np.tanh(v)], 1
    )


@pytest.mark.slow
def test_home_a_missing_acceleration_that_depends_on_state_and_orders():
    here = world(ship(), ship(), force=missing, known=True)
    assert here.removed(fitted(OneStep(), here)) > 0.8
