from __future__ import annotations

import numpy as np
import pytest

from shipid.hybrid.recurrent import Recurrent
from tests.hybrid.worlds import FINE, fitted, ship, world

MEMORY = 8.0  # s


def wake(nus, told):
    """A force of the mean orders of the last seconds."""
    last = told[-round(MEMORY / FINE) :]
    n, alpha = (np.mean([here[name] for here in last], axis=0) for name in ("port.n", "port.alpha"))
    return np.stack([8e3 * (n - 2.2), 2e4 * alpha, -4e5 * alpha], axis=1)


def test_home_a_force_of_past_orders():
    here = world(ship(), ship(), force=wake, past=10, known=True, hold=(5.0, 12.0))
    assert here.removed(fitted(Recurrent(), here)) > 0.8
