"""The growth of a small yaw is that of the textbook."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.engine.rollout import rollout
from shipid.simulation.approach import Controls
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, check_document, load_vessel
from shipid.vessel.stability import service_shaft, yaw_growth, yaw_growths

U, M, I_Z, Y_VDOT, N_RDOT = 4.0, 2e5, 2e7, -1.5e5, -1.2e7
Y_V, Y_R, N_R = -4e4, 1e5, -4e6


def ship(N_v: float) -> Vessel:
    return check_document(
        {
            "name": "A ship with linear damping",
            "dof": 3,
            "particulars": {"L_pp": 30.0},
            "constants": {"rho": 1025.0},
            "inertia": {"m": M, "I_z": I_Z, "x_G": 0.0},
            "added_mass": {"X_udot": -1e4, "Y_vdot": Y_VDOT, "N_rdot": N_RDOT, "coriolis": "none"},
            "hull": {"derivatives": {"X_u": -1e4, "Y_v": Y_V, "Y_r": Y_R, "N_v": N_v, "N_r": N_R}},
            "thruster": {"screw": {"kind": "quadratic", "x": -14.0, "T_nn": 1e3}},
        },
        "ship.toml",
    )


@pytest.mark.parametrize("N_v", [-6e5, -5e4, 1e5])
def test_it_is_the_root_of_the_equations_of_sway_and_yaw(N_v: float) -> None:
    """(m - Y_vdot) v' = Y_v v + (Y_r - m U) r, (I_z - N_rdot) r' = N_v v + N_r r."""
    vessel = ship(N_v)
    slopes = np.array([[Y_V, Y_R - M * U], [N_v, N_R]]) / np.array([[M - Y_VDOT], [I_Z - N_RDOT]])
    expected = np.linalg.eigvals(slopes).real.max()
    assert yaw_growth(vessel, U, {"screw.n": 1.0}) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", ["gunnerus-28.9", "gunnerus-33.9"])
def test_water_heave_and_roll_are_no_yaw(name: str) -> None:
    """Time as a motion had a growth of 0, and of the first ship a memory of roll, and roll itself, are slower."""
    plane, waves = load_vessel(name), load_vessel(f"{name}-6dof")
    n = dict.fromkeys(vessel_dynamics(plane).commands, 2.0)
    flat, all_axes = yaw_growth(plane, 5.0, n), yaw_growth(waves, 5.0, n)
    assert flat < -0.09
    assert all_axes == pytest.approx(flat, rel=0.02)


@pytest.mark.parametrize("side", [0, 1])
def test_a_ship_whose_sides_differ_has_two(side: int) -> None:
    """KVLCC2 in a simulation: a yaw of 1e-6 to starboard dies out, one to port grows."""
    vessel = load_vessel("kvlcc2-l7")
    controls = Controls(vessel)
    n = service_shaft(vessel, 1.1787)
    rates = yaw_growths(vessel, 1.1787, controls.ahead(n))
    assert rates[0] < 0 < rates[1] == yaw_growth(vessel, 1.1787, controls.ahead(n))
    start = dict.fromkeys(vessel_dynamics(vessel).state, np.zeros(1)) | {"u": np.full(1, 1.1787)}
    start |= {"r": np.full(1, 1e-6 * (1, -1)[side])}
    orders = {name: np.full(1, value) for name, value in controls.ahead(n).items()}
    path = rollout(vessel, start, orders, step=0.1, num_steps=800, method="rk4", keep=("r",), engine="casadi")
    r = np.abs(path["r"][:, 0, 0])
    late = np.log(r[800] / r[500]) / 30.0  # when the faster mode has died out
    assert late == pytest.approx(rates[side], rel=0.03)
