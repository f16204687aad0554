from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.errors import ResultError
from shipid.hybrid.modules import Alarm, Modules, module_accelerations, modules_of, physics_without_modules
from shipid.hybrid.physics import Physics
from shipid.hybrid.stepping import step_alone
from shipid.hybrid.units import VaryingInputs
from shipid.vessel.load import load_vessel
from tests.hybrid.worlds import fitted, ship, world


def with_thrust(factor):
    return ship().with_values({f"thruster.{side}.k_T": factor for side in ("port", "starboard")})


@pytest.fixture(scope="module")
def here():
    return world(with_thrust(1.0), with_thrust(0.75), known=True)


@pytest.fixture(scope="module")
def corrector(here):
    return fitted(Modules(), here)


def test_home_a_wrong_propeller(here, corrector):
    assert here.removed(corrector) > 0.8
    factors = corrector.factors(here.train.instants())
    np.testing.assert_allclose(factors.mean(axis=0), [1 / 0.75, 1.0], atol=0.05)  # thrusters, hull


def test_modules_are_switched_off_behind_before_ahead():
    physics = Physics(load_vessel("kvlcc2-l7"), 1, 1.0)
    assert list(modules_of(physics.vessel)) == ["rudders", "thrusters", "hull"]
    assert len(physics_without_modules(physics)) == 3
    assert modules_of(None) == {}


def test_the_share_of_a_module_is_what_its_factor_changes(here):
    """With Euler's rule an acceleration is linear in the forces: half the thrust is half the share of the thrusters."""
    whole, half = (Physics(with_thrust(factor), 1, 1.0) for factor in (1.0, 0.5))
    at = here.test.instants()
    effects = module_accelerations(physics_without_modules(whole), at, step_alone(whole, at), 1.0)
    np.testing.assert_allclose(step_alone(whole, at) - step_alone(half, at), effects[:, 0] / 2, atol=1e-12)
    assert np.abs(effects).max(axis=(0, 2)).min() > 1e-3


def test_factors_stay_in_their_limits_and_fade_to_one_off_the_data(here, corrector):
    wild = replace(corrector, weights=50 * corrector.weights)
    factors = wild.factors(here.test.instants())
    assert factors.min() >= 0.5
    assert factors.max() <= 1.5
    assert (factors == 1.5).any()
    far = {**here.test.columns, "u": here.test.columns["u"] + 20.0}
    np.testing.assert_array_equal(wild.factors(Instants(far)), 1.0)


def test_another_ship_is_refused(here, corrector):
    with pytest.raises(ResultError, match="other modules"):
        corrector.predict(replace(here.physics, vessel=load_vessel("kvlcc2-l7")), here.test.instants(), np.empty(0))


def test_the_alarm_is_silent_on_its_data_and_between_runs():
    rng = np.random.default_rng(0)
    table = {"u": rng.normal(size=200), "v": rng.normal(size=200)}
    alarm = Alarm.fit(table, VaryingInputs.of(table, mirror=False).normaliser, 40, np.repeat(["a", "b"], 100))
    np.testing.assert_array_equal(alarm.weight(table, 1.0), 1.0)
    edge = {"u": np.array([alarm.radius / 2, 100.0, np.nan]), "v": np.zeros(3)}
    np.testing.assert_array_equal(alarm.weight(edge, 1.0), [1.0, 0.0, 0.0])
    assert len(alarm.centres) == 40
