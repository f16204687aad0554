"""Physics alone: the path of the foundation, whatever the data."""

from __future__ import annotations

import numpy as np

from shipid.data.windows import Instants
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.physics import Physics


def test_the_path_of_the_physics_is_the_prediction() -> None:
    paths = np.random.default_rng(0).normal(size=(5, 7, 2))
    assert UnchangedPath({}).predict(Physics(None, 5, 1.0), Instants({"u": np.zeros(7)}), paths) is paths
