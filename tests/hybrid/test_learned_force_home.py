from __future__ import annotations

import pytest

from shipid.hybrid.learned_force import LearnedForce, mass
from shipid.vessel.load import load_vessel
from tests.hybrid.worlds import fitted, world


@pytest.mark.slow
def test_home_a_missing_cross_flow():
    truth = load_vessel("gunnerus-33.9")
    here = world(truth, truth.with_values({"hull.crossflow.off": True}), known=True)
    assert here.removed(fitted(LearnedForce(trials=1, ridge=1e-5), here)) > 0.8


def test_the_mass_is_that_of_the_equations():
    here = world(load_vessel("gunnerus-33.9"), load_vessel("gunnerus-33.9"), runs=2, seconds=20)
    document = here.physics.vessel.document
    inertia = mass(here.physics, here.test.instants().select([0]))
    for axis, key in enumerate(("X_udot", "Y_vdot", "N_rdot")):
        rigid = document["inertia"]["I_z" if axis == 2 else "m"]
        assert inertia[axis, axis] == pytest.approx(rigid - document["added_mass"][key], rel=1e-6)


def test_the_start_in_closed_form_is_better_than_no_force():
    truth = load_vessel("gunnerus-33.9")
    here = world(truth, truth.with_values({"hull.crossflow.off": True}), runs=8, seconds=40, known=True)
    assert here.removed(fitted(LearnedForce(trials=1, ridge=1e-3, iterations=1), here)) > 0.2
