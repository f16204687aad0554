"""Only whole runs of a course-unstable ship have the warning."""

from __future__ import annotations

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset
from shipid.identification.unstable import growth_warning, yaw_growth_rate
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel
from shipid.vessel.stability import yaw_growth
from tests.vessel.test_stability import U, ship


def straight(vessel: Vessel, speed: float) -> Dataset:
    columns = dict.fromkeys(("north", "east", "psi", "v", "r", *vessel_dynamics(vessel).commands), 0.0)
    return Dataset(pd.DataFrame({"run": "A", "t": [0.0, 1.0], "u": speed, "flags": 0} | columns), {"clock": "run"})


def test_it_is_of_the_median_speed_and_orders_of_the_runs() -> None:
    vessel = ship(1e5)
    assert yaw_growth_rate(straight(vessel, U), ["A"], vessel) == yaw_growth(vessel, U, {"screw.n": 0.0})
    assert np.isfinite(yaw_growth_rate(straight(vessel, 0.0), ["A"], vessel))


def test_only_what_grows_within_the_runs_is_said() -> None:
    assert "e-fold in 10 s" in growth_warning(0.1, 120.0, 8.0)
    assert "--horizon 24" in growth_warning(0.1, 120.0, 8.0)
    assert growth_warning(0.1, 20.0, 2.0) == growth_warning(-0.1, 120.0, 8.0) == growth_warning(0.1, 120.0, 60.0) == ""
