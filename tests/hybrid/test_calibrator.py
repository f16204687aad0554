from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.hybrid.calibrator import Calibrator, TrajectoryInputs
from tests.hybrid.worlds import HORIZON, fitted, missed, ship, world


def of_the_way(world_, windows):
    """An error of the path that depends on where the physics says the ship will be, and how fast she will turn."""
    states = world_.physics.states(windows.instants(known=world_.known))
    t = np.arange(1, HORIZON + 1)[:, None] / HORIZON
    x, y, r = states["x"][-1], states["y"][-1], states["r"][-1]
    return np.stack([3 * t * np.tanh((x - 40) / 15) - 30 * t * r**2, 4 * t**2 * np.tanh(y / 8) + 20 * t * r], axis=-1)


@pytest.mark.slow
def test_home_an_error_that_depends_on_the_trajectory():
    here = missed(world(ship(), ship(), known=True, hold=(4.0, 9.0)), of_the_way)
    assert here.removed(fitted(Calibrator(), here)) > 0.8


def test_the_trajectory_is_seen_at_even_moments_and_zero_where_it_diverged():
    here = world(ship(), ship(), runs=2, seconds=20)
    inputs = TrajectoryInputs(here.commands, moments=3)
    instants = here.test.instants()
    columns = inputs.of_physics(here.physics, instants)
    assert sorted({name.split(".")[0] for name in columns}) == ["physics-10", "physics-15", "physics-5"]
    np.testing.assert_array_equal(columns["physics-15.y"], here.physics.states(instants)["y"][-1])
    broken = instants.columns["u"].copy()
    broken[2] = np.nan
    spoilt = inputs.of_physics(here.physics, replace(instants, columns={**instants.columns, "u": broken}))
    assert spoilt["physics-15.y"][2] == 0.0
    np.testing.assert_array_equal(np.delete(spoilt["physics-15.y"], 2), np.delete(columns["physics-15.y"], 2))
    assert inputs.of_physics(replace(here.physics, vessel=None), instants) == {}
