"""Ships that do not keep their course by themselves: how fast a small yaw grows, and what it does to long predictions.

See `docs/identification-coverage.md`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shipid.data.dataset import Dataset
from shipid.units import significant_digits
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel
from shipid.vessel.stability import yaw_growth

GROWN = 3.0  # times e-fold within a prediction: from there on random forces count
SHORTER = 3.0  # correlation times of the residuals of whole runs, that a prediction should last instead
SLOWEST = 0.01  # m/s: a ship at rest is taken for one of this speed


def yaw_growth_rate(dataset: Dataset, runs: Sequence[str], vessel: Vessel) -> float:
    """Growth rate [1/s] of a small yaw at the median speed and orders of runs, see `shipid.vessel.stability`."""
    rows = dataset.frame[dataset.frame["run"].isin(runs)]
    speed = max(float(np.median(np.hypot(rows["u"], rows["v"]))), SLOWEST)
    return yaw_growth(vessel, speed, {name: float(rows[name].median()) for name in vessel_dynamics(vessel).commands})


def growth_warning(rate: float, longest: float, memory: float) -> str:
    """A sentence where predictions of the `longest` run [s] let random forces grow; empty where they do not.

    rate : [1/s] as of `yaw_growth_rate`. memory : correlation time of the residuals [s].
    """
    if rate * longest < GROWN or SHORTER * memory >= longest:
        return ""
    return (
        f"the identified ship is course-unstable: a small yaw grows e-fold in {significant_digits(1 / rate)} s, and "
        f"random forces with it over whole runs, so estimates may be several times worse than need be, "
        f"and intervals too narrow; compare with --horizon {significant_digits(SHORTER * memory, 2)}"
    )
