"""Course stability: how fast a small yaw of a ship that goes straight ahead grows or dies out."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shipid.physics.signals import neutral, steers
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel

HELD = ("north", "east", "psi", "u")  # states that no transverse force depends on in calm water, and the speed
WATER = "waves."  # prefix of states of the water, which no motion changes: time, and where the current carries it
STEP = 1e-4  # of the speed, for differences


def growth(vessel: Vessel, speed: float, orders: Mapping[str, float]) -> float:
    """Largest real part [1/s] of the eigenvalues of sway, yaw and what moves with them, in calm water.

    It is negative where the ship is course-stable (Fossen 2021), and -inf where the equations give no number.

    speed : straight ahead [m/s], above 0. orders : commands [SI], such as shaft speeds; rudders and azimuths are
    amidships, and every actuator has reached its order.
    """
    model = dynamics(vessel)
    given = {name: neutral(name) if steers(name) else orders[name] for name in model.commands}
    names = (*model.state, *model.hidden)
    moving = [place for place, name in enumerate(names) if name not in HELD and not name.startswith(WATER)]
    straight = np.array([speed if name == "u" else 0.0 for name in names])
    rest = (
        [given[name] for name in model.memory],
        list(given.values()),
        np.zeros(len(model.environment)),
        list(vessel.parameters.values()),
        np.zeros(model.num_dof),
    )

    def rates(change: np.ndarray) -> np.ndarray:
        return np.array(model.rates(straight + change, *rest)).ravel()

    size = STEP * speed / np.where([name in "pqr" for name in names], vessel.length or 1.0, 1.0)
    columns = [(rates(step) - rates(-step))[moving] / (2 * step.max()) for step in np.diag(size)[moving]]
    slopes = np.column_stack(columns)
    return float(np.linalg.eigvals(slopes).real.max()) if np.isfinite(slopes).all() else -np.inf
