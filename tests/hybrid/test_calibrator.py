from __future__ import annotations

import numpy as np

from shipid.hybrid.calibrator import Calibrator, TrajectoryInputs
from tests.hybrid.worlds import HORIZON, fitted, missed, ship, world


def of_the_way(world_, windows):
    """An error of the path that depends on where the physics says the ship will be, and how fast she will turn."""
    states = world_.physics.states(windows.instants(known=world_.known))
    t = np.arange(1, HORIZON + 1)[:, None] / HORIZON
    x, y, r = states["x"][-1], states["y"][-1], states["r"][-1]
    return np.stack([3 * t * np.tanh((x - 40) / 15) - 30 * t * r**2, 4 * t**2 * np.tanh(y / 8) + 20 * t * r], axis=-1)


def test_home_an_error_that_depends_on_the_trajectory():
    here = missed(world(ship(), ship(), known=True, hold=(4.0, 9.0)), of_the_way)
    assert here.removed(fitted(Calibrator(trials=24), here)) > 0.8
