from __future__ import annotations

import numpy as np
import pytest

from shipid.hybrid.modules import Modules, modules_of, shares, without
from shipid.hybrid.physics import Physics
from shipid.hybrid.stepping import free
from shipid.vessel.load import load_vessel
from tests.hybrid.worlds import fitted, ship, world


def with_thrust(factor):
    return ship().with_values({f"thruster.{side}.k_T": factor for side in ("port", "starboard")})


def test_home_a_wrong_propeller():
    here = world(with_thrust(1.0), with_thrust(0.75), known=True)
    assert here.removed(fitted(Modules(), here)) > 0.8
