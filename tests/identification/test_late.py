"""Commands that change between rows: where that matters, and what they are meanwhile."""

from __future__ import annotations

import numpy as np

from shipid.data.dataset import Dataset
from shipid.identification.late import CONSIDERABLE, held_over_steps, interpolate_commands, late_commands
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.conftest import variety
from tests.identification.trials import trials

SHIP = load_vessel("gunnerus-28.9")
DATA = trials(SHIP, runs=2, steps=40)


def at(interval: float) -> Dataset:
    """The same rows, so far apart."""
    return Dataset(DATA.frame.assign(t=DATA.frame["t"] * interval), DATA.metadata)


def test_lateness_counts_by_how_fast_the_ship_goes_her_length() -> None:
    late = late_commands(SHIP, at(1.0), DATA.runs)
    assert late is not None
    assert (late.interval, late.delay) == (1.0, 0.5)
    assert late.words == "rows are 1 s apart and commands count from their row, 0.5 s late on average"
    pace = float(DATA.frame["u"].abs().mean()) / SHIP.document["particulars"]["L_pp"]
    edge = 2 * CONSIDERABLE / pace  # s between rows
    assert late_commands(SHIP, at(1.01 * edge), DATA.runs) is not None
    assert late_commands(SHIP, at(0.99 * edge), DATA.runs) is None


def test_orders_that_never_change_are_not_late() -> None:
    steering = [name for name in DATA.commands if name.endswith(".alpha")]
    held = Dataset(DATA.frame.assign(**dict.fromkeys(steering, 0.1)), DATA.metadata)
    assert late_commands(SHIP, held, held.runs) is None


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
