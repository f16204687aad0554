"""The growth of a small yaw is that of the textbook."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.document import bundled
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel, check_vessel, load_vessel
from shipid.vessel.stability import growth

U, M, I_Z, Y_VDOT, N_RDOT = 4.0, 2e5, 2e7, -1.5e5, -1.2e7
Y_V, Y_R, N_R = -4e4, 1e5, -4e6


def ship(N_v: float) -> Vessel:
    return check_vessel(
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
    assert growth(vessel, U, {"screw.n": 1.0}) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", sorted(bundled("models")))
def test_every_bundled_ship_has_one(name: str) -> None:
    vessel = load_vessel(name)
    speed = 0.2 * np.sqrt(9.81 * (vessel.length or 30.0))
    assert np.isfinite(growth(vessel, speed, dict.fromkeys(dynamics(vessel).commands, 0.0)))


@pytest.mark.parametrize(("name", "slowest"), [("gunnerus-28.9", -0.1), ("gunnerus-33.9", -0.093)])
def test_the_water_of_a_ship_in_waves_is_no_motion_of_hers(name: str, slowest: float) -> None:
    """Time goes on by itself: as a motion it had a growth of 0. Of the first ship a memory of heave is the slowest."""
    plane, waves = load_vessel(name), load_vessel(f"{name}-6dof")
    n = dict.fromkeys(dynamics(plane).commands, 2.0)
    assert growth(waves, 5.0, n) == pytest.approx(slowest, rel=0.01)
    assert growth(plane, 5.0, n) <= growth(waves, 5.0, n) + 1e-3
