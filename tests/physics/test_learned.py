"""The learned force: what its formula says by hand, its bounds, its silence, and 200 weights by dotted path."""

from __future__ import annotations

import casadi as ca
import numpy as np

from shipid.physics.learned import learned_wrench
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.conftest import WEIGHTS

SHIP = load_vessel("gunnerus-28.9")
OUTPUTS = ("c_X", "c_Y", "c_N")


def force(nu: np.ndarray, **changes: object) -> np.ndarray:
    return np.array(ca.evalf(learned_wrench(ca.SX(nu), **{**WEIGHTS, **changes}))).ravel()  # type: ignore[arg-type]


def test_the_formula_by_hand() -> None:
    nu = np.array([4.0, -0.7, 0.0, 0.0, 0.0, 0.08])
    w = {name: np.array(value) for name, value in WEIGHTS.items()}
    across = w["w_v"] * nu[1] / w["v_scale"] + w["w_r"] * nu[5] / w["r_scale"]
    along = w["w_u"] * nu[0] / w["u_scale"] + w["w_0"]
    starboard, port = np.tanh(along + across), np.tanh(along - across)
    expected = np.zeros(6)
    expected[0] = w["X_max"] * np.tanh(w["c_X"] @ ((starboard + port) / 2 - np.tanh(w["w_0"])))
    expected[1] = w["Y_max"] * np.tanh(w["c_Y"] @ (starboard - port) / 2)
    expected[5] = w["N_max"] * np.tanh(w["c_N"] @ (starboard - port) / 2)
    np.testing.assert_allclose(force(nu), expected, rtol=1e-12)


def test_without_output_weights_there_is_exactly_no_force() -> None:
    silent = {name: [0.0] * 3 for name in OUTPUTS}
    assert (force(np.array([6.0, 2.0, 0, 0, 0, 0.2]), **silent) == 0).all()


def test_two_hundred_weights_are_parameters_by_path_of_one_structure() -> None:
    rng = np.random.default_rng(0)
    lists = [name for name, value in WEIGHTS.items() if isinstance(value, list)]
    block = WEIGHTS | {name: rng.normal(size=29).tolist() for name in lists}
    vessel = SHIP.with_values({"hull.learned": block})
    changed = vessel.with_values({"hull.learned.w_v.28": 0.25, "hull.learned.c_N.3": -1.5})
    paths = [path for path in vessel.parameters if path.startswith("hull.learned.") and path.count(".") == 3]
    assert len(paths) == 7 * 29
    assert changed.parameters["hull.learned.w_v.28"] == 0.25
    assert changed.parameters["hull.learned.c_N.3"] == -1.5
    assert vessel_dynamics(changed) is vessel_dynamics(vessel)
