from __future__ import annotations

import sys

import numpy as np
import pytest

from shipid.errors import ShipidError
from shipid.hybrid.forest import Forest, Trees
from tests.hybrid.worlds import HORIZON, fitted, missed, ship, world


def stairs(columns):
    """An error of the path that jumps with the order and with the speed: what a smooth network cannot follow."""
    t = np.arange(1, HORIZON + 1)[:, None] / HORIZON
    high = np.where(columns["port.n"] > 2.2, 1.0, -0.6)
    side = np.where(columns["port.alpha"] > 0.1, 1.5, np.where(columns["port.alpha"] < -0.1, -1.5, 0.0))
    return np.stack([3 * t * high + t * (columns["u"] > 4), 4 * t**2 * side], axis=-1)


@pytest.mark.slow
def test_home_an_error_that_jumps():
    pytest.importorskip("sklearn")
    here = missed(world(ship(), ship()), lambda _, windows: stairs(windows.columns))
    assert here.removed(fitted(Forest(), here)) > 0.8


def test_the_arrays_say_what_scikit_learn_says():
    ensemble = pytest.importorskip("sklearn.ensemble")
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(300, 4)), rng.normal(size=(300, 6))
    forest = ensemble.RandomForestRegressor(20, min_samples_leaf=2, random_state=1).fit(x, y)
    fresh = rng.normal(size=(500, 4))
    mine = Trees.of([tree.tree_ for tree in forest.estimators_]).predict(fresh)
    np.testing.assert_allclose(mine, forest.predict(fresh), rtol=0, atol=1e-12)


@pytest.fixture(scope="module")
def set_aside():
    """Every path is set to starboard, and ahead where the ship is fast."""
    pytest.importorskip("sklearn")
    t = np.arange(1, HORIZON + 1)[:, None] / HORIZON

    def error(_, windows):
        return np.stack(
            [3 * t * np.sign(windows.columns["u"] - 3.5), np.ones_like(windows.columns["u"]) * t**2], axis=-1
        )

    return missed(world(ship(), ship(), runs=6, seconds=40), error)


def grown(here, **settings):
    return fitted(Forest(trials=1, trees=25, terms=3, **settings), here)


def test_one_leaf_is_the_mean_and_its_mirror_has_no_side(set_aside):
    for mirror, side in ((False, 1.0), (True, 0.0)):
        one = grown(set_aside, leaf=1e4, share=1.0, mirror=mirror)
        assert (one.trees.left == -1).all()
        instants = set_aside.test.instants(known=False)
        paths = one.predict(set_aside.physics, instants, np.zeros((HORIZON, len(set_aside.test), 2)))
        np.testing.assert_allclose(np.ptp(paths, axis=1), 0.0, atol=1e-9)
        assert paths[-1, 0, 1] == pytest.approx(side, abs=0.05)


def test_without_scikit_learn_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.ensemble", None)
    with pytest.raises(ShipidError, match=r"shipid\[forest\]"):
        Forest().fit(world(ship(), ship(), runs=2, seconds=20).task())
