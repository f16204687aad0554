"""The CasADi engine: actuator states along recorded orders."""

from __future__ import annotations

import numpy as np

from shipid.engine.casadi import BLOCK, evaluate_samples, memory_along
from shipid.vessel.dynamics import vessel_dynamics
from tests.conftest import variety

LAGGED = variety()["actuators"]


def stepped(num_rows: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """A step of every order of 0.1 after row 1, rows 0.5 s apart."""
    t = 0.5 * np.arange(num_rows)
    return {name: np.where(t > 0.25, 0.1, 0.0) for name in vessel_dynamics(LAGGED).commands}, t


def test_states_begin_at_the_first_order_and_follow_the_lag() -> None:
    orders, t = stepped(BLOCK + 20)  # more than one block
    states, model = memory_along(LAGGED, orders, t) or {}, vessel_dynamics(LAGGED)
    reached, given = (
        np.array([one[name] for name in names]) for one, names in ((states, model.memory), (orders, model.commands))
    )
    after = model.advance(0, reached[:, :-1], given[:, :-1], 0, [*LAGGED.parameters.values()], 0.5)
    np.testing.assert_array_equal(np.array(after), reached[:, 1:])
    for state in states.values():
        assert state[0] == state[1] == 0  # the order of row 0 holds until row 1
        assert abs(state[-1] - 0.1) < 1e-6


def test_orders_of_many_samples_are_those_of_each() -> None:
    """One sample, a block, one more than a block, and some blocks."""
    model, rng = vessel_dynamics(LAGGED), np.random.default_rng(0)
    values = np.array(list(LAGGED.parameters.values()))
    names = ((*model.state, *model.hidden), model.memory, model.commands, model.environment)
    inputs = [rng.uniform(0.1, 1.0, (len(each), 3 * BLOCK + 1)) for each in names]
    for count in (1, BLOCK, BLOCK + 1, 3 * BLOCK + 1):
        together = evaluate_samples(model, "orders", [part[:, :count] for part in inputs], values)
        assert together.shape == (len(model.ordered), count)
        for k in {0, count // 2, count - 1}:
            alone = np.array(model.orders(*(part[:, k] for part in inputs), values)).ravel()
            np.testing.assert_array_equal(together[:, k], alone)
