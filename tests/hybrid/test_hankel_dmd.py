from __future__ import annotations

import numpy as np
import pytest

from shipid.hybrid.hankel_dmd import HankelDMD
from shipid.hybrid.physics import Physics
from tests.hybrid.worlds import FINE, HORIZON, fitted, ship, world

AGO = 4.0  # s


def late(nus, told):
    """A force of the velocities and orders four seconds ago."""
    then = max(len(nus) - 1 - round(AGO / FINE), 0)
    u, v, r = nus[then].T
    return np.stack([-3e3 * (u - 3.5), -2e4 * v - 2e5 * r, -1.5e6 * r + 2e5 * told[then]["port.alpha"]], 1)


def test_home_a_force_that_comes_late():
    here = world(ship(), ship(), force=late, past=8, known=True)
    assert here.removed(fitted(HankelDMD(), here)) > 0.8
