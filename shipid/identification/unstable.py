"""Ships that do not keep their course by themselves: how fast a small yaw grows, and what it does to long predictions.

In a prediction over a whole run a random force early in the run then grows, and a run that comes near to turning the
other way decides most of the estimates: `docs/identification-coverage.md`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shipid.data.dataset import Dataset
from shipid.identification.collinearity import digits
from shipid.physics.signals import neutral, steers
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel

GROWN = 3.0  # times e-fold within a prediction: from there on random forces count
SHORTER = 3.0  # correlation times of the residuals of whole runs, that a prediction should last instead
PLACES = ("north", "east", "psi")  # states that no force depends on in calm water
STEP, SLOWEST = 1e-4, 0.01  # of the speed, for differences; m/s


def growth(vessel: Vessel, dataset: Dataset, runs: Sequence[str]) -> float:
    """Largest growth rate [1/s] of a small change of the motion, straight ahead at the median speed and orders of runs.

    Rudders and azimuths are amidships. It is negative where the ship is course-stable.
    """
    model, rows = dynamics(vessel), dataset.frame[dataset.frame["run"].isin(runs)]
    speed = max(float(np.median(np.hypot(rows["u"], rows["v"]))), SLOWEST)
    orders = {name: neutral(name) if steers(name) else float(rows[name].median()) for name in model.commands}
    names = (*model.state, *model.hidden)
    moving = [place for place, name in enumerate(names) if name not in PLACES]
    straight = np.array([speed if name == "u" else 0.0 for name in names])
    given = (
        [orders[name] for name in model.memory],
        list(orders.values()),
        np.zeros(len(model.environment)),
        list(vessel.parameters.values()),
        np.zeros(model.num_dof),
    )

    def rates(change: np.ndarray) -> np.ndarray:
        return np.array(model.rates(straight + change, *given)).ravel()

    size = STEP * speed / np.where([name in "pqr" for name in names], vessel.length or 1.0, 1.0)
    columns = [(rates(step) - rates(-step))[moving] / (2 * step.max()) for step in np.diag(size)[moving]]
    slopes = np.column_stack(columns)
    return float(np.linalg.eigvals(slopes).real.max()) if np.isfinite(slopes).all() else -np.inf


def grows(rate: float, longest: float, memory: float) -> str:
    """A sentence where predictions of the `longest` run [s] let random forces grow; empty where they do not.

    rate : [1/s] as of `growth`. memory : correlation time of the residuals [s].
    """
    if rate * longest < GROWN or SHORTER * memory >= longest:
        return ""
    return (
        f"the identified ship is course-unstable: a small yaw grows e-fold in {digits(1 / rate)} s, and random forces "
        f"with it over whole runs, so estimates may be several times worse than need be, and intervals too narrow; "
        f"compare with --horizon {digits(SHORTER * memory, 2)}"
    )
