"""The growth of a small yaw is that of the textbook, and only whole runs of a course-unstable ship have the warning."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.document import bundled
from shipid.identification.unstable import grows, growth
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel, check_vessel, load_vessel

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


def straight(vessel: Vessel, speed: float) -> Dataset:
    columns = dict.fromkeys(("north", "east", "psi", "v", "r", *dynamics(vessel).commands), 0.0)
    return Dataset(pd.DataFrame({"run": "A", "t": [0.0, 1.0], "u": speed, "flags": 0} | columns), {"clock": "run"})


@pytest.mark.parametrize("N_v", [-6e5, -5e4, 1e5])
def test_it_is_the_root_of_the_equations_of_sway_and_yaw(N_v: float) -> None:
    """(m - Y_vdot) v' = Y_v v + (Y_r - m U) r, (I_z - N_rdot) r' = N_v v + N_r r."""
    vessel = ship(N_v)
    slopes = np.array([[Y_V, Y_R - M * U], [N_v, N_R]]) / np.array([[M - Y_VDOT], [I_Z - N_RDOT]])
    expected = max(np.linalg.eigvals(slopes).real.max(), -1e4 / (M + 1e4))  # the latter in surge
    assert growth(vessel, straight(vessel, U), ["A"]) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", sorted(bundled("models")))
def test_every_bundled_ship_has_one(name: str) -> None:
    vessel = load_vessel(name)
    speed = 0.2 * np.sqrt(9.81 * (vessel.length or 30.0))
    assert np.isfinite(growth(vessel, straight(vessel, speed), ["A"]))
    assert np.isfinite(growth(vessel, straight(vessel, 0.0), ["A"]))


def test_only_what_grows_within_the_runs_is_told() -> None:
    assert "e-fold in 10 s" in grows(0.1, 120.0, 8.0)
    assert "--horizon 24" in grows(0.1, 120.0, 8.0)
    assert grows(0.1, 20.0, 2.0) == grows(-0.1, 120.0, 8.0) == grows(0.1, 120.0, 60.0) == ""
