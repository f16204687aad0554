from __future__ import annotations

import numpy as np
import pytest

from shipid.engine.rollout import rollout
from shipid.hybrid.learned_force import LearnedForce, horizontal_mass
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.hybrid.worlds import fitted, world


@pytest.mark.slow
def test_home_a_missing_cross_flow():
    truth = load_vessel("gunnerus-33.9")
    here = world(truth, truth.with_values({"hull.crossflow.off": True}), known=True)
    assert here.removed(fitted(LearnedForce(trials=1, ridge=1e-5), here)) > 0.8


@pytest.mark.parametrize("name", ["gunnerus-33.9", "gunnerus-28.9-6dof", "kvlcc2-l7"])
def test_the_mass_is_what_unit_forces_feel_in_one_step(name):
    """Against the equations of motion: a force of 1 kN and 1 kN m for one Euler step of 1 s, from rest."""
    vessel = load_vessel(name)
    model = vessel_dynamics(vessel)
    rows = [vessel.axes.index(axis) for axis in (0, 1, 5)]
    forces = np.zeros((1, 4, len(vessel.axes)))
    forces[0, range(3), rows] = 1e3
    zeros = {kind: {key: np.zeros(4) for key in getattr(model, kind)} for kind in ("state", "commands", "environment")}
    begun = zeros["state"], zeros["commands"], zeros["environment"]
    after = rollout(vessel, *begun, step=1.0, num_steps=1, tau_extra=forces, engine="casadi")
    moved = np.stack([after[motion][-1, 0] for motion in ("u", "v", "r")])
    np.testing.assert_allclose(horizontal_mass(vessel) @ (moved[:, :3] - moved[:, 3:]), 1e3 * np.eye(3), atol=1e-4)
