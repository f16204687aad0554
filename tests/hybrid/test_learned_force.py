from __future__ import annotations

import pytest

from shipid.hybrid.learned_force import LearnedForce
from shipid.vessel.load import load_vessel
from tests.hybrid.worlds import fitted, world


def test_home_a_missing_cross_flow():
    truth = load_vessel("gunnerus-33.9")
    here = world(truth, truth.with_values({"hull.crossflow.off": True}), known=True)
    assert here.removed(fitted(LearnedForce(), here)) > 0.8
