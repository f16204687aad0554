"""Commands that change between rows: what they are meanwhile."""

from __future__ import annotations

import numpy as np

from shipid.identification.late import held_over_steps, interpolate_commands
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.conftest import variety

SHIP = load_vessel("gunnerus-28.9")


def test_at_the_rows_and_in_the_middle_between_them() -> None:
    ship = variety()["actuators"]
    rng, t = np.random.default_rng(1), np.array([0.0, 1.0, 2.5, 3.0])
    rows = {name: rng.normal(size=4) for name in vessel_dynamics(ship).commands}
    at_rows, later = (
        interpolate_commands(ship, {"t": t, **rows}, t),
        interpolate_commands(ship, {"t": t, **rows}, np.array([[1.74, 1.76]])),
    )
    for name, values in rows.items():
        np.testing.assert_array_equal(at_rows[name], values)
        if name in vessel_dynamics(ship).memory:
            np.testing.assert_array_equal(later[name], [values[1:3]])
        else:
            mean = (values[1] + values[2]) / 2
            np.testing.assert_allclose(later[name].mean(), mean, atol=1e-12)


def test_an_order_within_a_step_counts_from_the_step_that_begins_nearest() -> None:
    """A command without an actuator has its mean over the step."""
    t = np.array([0.0, 1.4, 2.6])
    for ship, by_hand in ((variety()["actuators"], [1.0, 2.0, 2.0, 4.0]), (SHIP, [1.0, 1.6, 2.8, 4.0])):
        commands = vessel_dynamics(ship).commands
        assert set(vessel_dynamics(ship).memory) == (set() if ship is SHIP else set(commands))
        rows = {name: np.array([1.0, 2.0, 4.0]) for name in commands}
        held = held_over_steps(ship, {"t": t, **rows}, np.arange(4.0), 1.0)
        for name in commands:
            np.testing.assert_allclose(held[name], by_hand, atol=1e-12, err_msg=name)
