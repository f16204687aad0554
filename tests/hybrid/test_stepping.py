from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.errors import DataError
from shipid.hybrid.physics import Physics
from shipid.hybrid.stepping import step_alone, stepped_paths, true_steps
from shipid.observer import Observer
from tests.hybrid.worlds import HORIZON, ship, world

LAG = {"n": {"kind": "first_order", "T": 3.0, "rate": 0.5}, "alpha": {"kind": "first_order", "T": 2.0, "rate": 0.2}}


def nothing(at, _):
    return np.zeros((len(at), 3))


@pytest.fixture(scope="module")
def here():
    return world(ship(), ship(), runs=3, seconds=30, known=True)


def test_a_perfect_physics_misses_nothing_of_the_true_steps(here):
    steps = true_steps(here.task(), "physics")
    assert np.abs(steps.missing).max() < 5e-3  # what one step of a second errs after a jump of the orders
    assert np.abs(steps.free - np.stack([steps.at.columns[name] for name in "uvr"], 1)).max() > 0.01


def test_every_moment_of_a_run_comes_once(here):
    steps = true_steps(here.task(), "physics")
    t = here.train.t[steps.window] + steps.number * here.train.step
    moments = set(zip(here.train.run[steps.window], t, strict=True))
    assert len(moments) == len(t) == 3 * 29  # 30 samples of each run, a step between two
    first = steps.number[np.isin(t, here.train.t)]
    assert (first == 0).all()  # nearest to the instant, where the wind is fresh


def test_windows_without_states_are_refused(here):
    with pytest.raises(DataError, match="true velocities"):
        true_steps(replace(here.task(), windows=replace(here.train, states={})), "physics")


def test_physics_with_an_observer_are_refused(here):
    """Its filtered start and slow force would be left out without a word."""
    observed = replace(here.physics, observer=Observer())
    task = here.task()
    with pytest.raises(DataError, match="observer"):
        true_steps(replace(task, cases={"physics": replace(task.cases["physics"], physics=observed)}), "physics")
    with pytest.raises(DataError, match="observer"):
        stepped_paths(observed, here.test.instants(known=True), nothing)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("lag", [False, True])
def test_steps_one_by_one_are_the_rollout(here, known, lag):
    """Velocities and path step by step are those of one rollout, also where actuators lag."""
    vessel = ship().with_values({f"thruster.{side}.actuator": LAG for side in ("port", "starboard")} if lag else {})
    physics = Physics(vessel, HORIZON, 1.0, "rk4")
    hidden = {name: 0.5 * here.test.columns[name] for name in here.commands} if lag else None
    instants = here.test.instants(known=known, hidden=hidden)
    seen = []

    def spy(at, after):
        seen.append(after)
        return nothing(at, after)

    paths = stepped_paths(physics, instants, spy)
    states = physics.states(instants)
    np.testing.assert_allclose(np.stack(seen).transpose(2, 0, 1), [states[name] for name in "uvr"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(paths, np.stack([states["x"], states["y"]], -1), rtol=0, atol=1e-8)


def test_the_trapezoid_takes_half_a_step_of_lag_out_of_euler(here):
    """With perfect equations, what is left of Euler's error is that of its velocities."""
    euler, instants = replace(here.physics, integrator="euler"), here.test.instants(known=True)
    assert here.error(stepped_paths(euler, instants, nothing)) < 0.7 * here.error(euler.paths(instants))


def test_without_physics_the_velocities_stay(here):
    physics = Physics(None, HORIZON, 1.0)
    instants = here.test.instants()
    np.testing.assert_array_equal(
        step_alone(physics, instants), np.stack([instants.columns[name] for name in "uvr"], 1)
    )
    straight = Instants({**instants.columns, "r": np.zeros(len(instants)), "v": np.zeros(len(instants))})
    paths = stepped_paths(physics, straight, nothing)
    np.testing.assert_allclose(paths[-1, :, 0], HORIZON * instants.columns["u"])
    np.testing.assert_allclose(paths[..., 1], 0, atol=1e-12)


def test_an_acceleration_moves_the_ship_as_it_must(here):
    instants = here.test.instants()
    still = Instants({**instants.columns, **{name: np.zeros(len(instants)) for name in "uvr"}})
    paths = stepped_paths(Physics(None, HORIZON, 2.0), still, lambda at, _: np.tile([0.1, 0.0, 0.0], (len(at), 1)))
    np.testing.assert_allclose(paths[-1, :, 0], 0.1 * (2 * HORIZON) ** 2 / 2)


def test_a_path_that_diverges_is_not_finite_and_harms_no_other(here):
    instants = here.test.instants(known=True)

    steps = iter(range(HORIZON))

    def wild(at, _):
        accelerations = np.zeros((len(at), 3))
        accelerations[0] = 1e3 if next(steps) == 2 else 0.0
        return accelerations

    paths = stepped_paths(here.physics, instants, wild)
    assert np.isfinite(paths[:2]).all()
    assert np.isnan(paths[2:, 0]).all()
    np.testing.assert_allclose(paths[:, 1:], stepped_paths(here.physics, instants, nothing)[:, 1:], rtol=0, atol=1e-12)
