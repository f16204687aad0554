"""Hydrostatic restoring against a body of vertical columns, and against the hydrostatics of the bundled hulls."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from shipid.physics.restoring import hydrostatic
from shipid.vessel.load import load_vessel

#: BEM data base of both hulls: C33 [N/m], C35 [N], C44, C55 [N m]; W = rho g nabla and A_wp do not appear twice in them
HULLS = {
    "gunnerus-28.9-6dof": (2.2549e6, 4.7402e6, 6.5495e6, 1.19136e8),
    "gunnerus-33.9-6dof": (2.7507e6, 5.7019e6, 9.2368e6, 2.04635e8),
}
ABOUT_ORIGIN = np.array([2, 3, 4])


def wrench(motion: np.ndarray, **values: float) -> np.ndarray:
    """Z, K, M of a displacement (z, phi, theta)."""
    eta = ca.DM([0, 0, motion[0], motion[1], motion[2], 0])
    return np.array(ca.evalf(ca.densify(hydrostatic(eta, **values)))).ravel()[ABOUT_ORIGIN]


def stiffness(**values: float) -> np.ndarray:
    """C = -d(Z, K, M)/d(z, phi, theta); the term is linear."""
    return -np.column_stack([wrench(unit, **values) for unit in np.eye(3)])


def test_columns_of_water() -> None:
    """A wall-sided body of columns: each is pushed up by its extra depth, its buoyancy leans with it.

    Moments of the weight and the buoyancy at rest, W (z_B - z_G) times the angle, are Fossen (2021), eq. 4.27.
    """
    rng = np.random.default_rng(4)
    x, y, draught, area = (rng.uniform(*limits, 200) for limits in ((-14, 16), (-4, 4), (1, 3), (0.5, 1.5)))
    x, y, draught, area = np.tile(x, 2), np.concatenate([y, -y]), np.tile(draught, 2), np.tile(area, 2)
    rho, g, z_G = 1025.0, 9.81, -0.8
    x -= (x @ (draught * area)) / (draught @ area)  # the origin is above the centre of buoyancy
    nabla, z_B = draught @ area, (area @ draught**2 / 2) / (draught @ area)
    expected = np.zeros((3, 3))
    for i, unit in enumerate(np.eye(3)):  # deeper by z - x theta + y phi, z positive down
        push = rho * g * area * (unit[0] - x * unit[2] + y * unit[1])
        expected[:, i] = [push.sum(), push @ y, -push @ x]
    expected[1, 1] += rho * g * nabla * (z_G - z_B)
    expected[2, 2] += rho * g * nabla * (z_G - z_B)
    computed = stiffness(
        A_wp=area.sum(),
        x_F=(x @ area) / area.sum(),
        nabla=nabla,
        GM_T=(area @ y**2) / nabla + z_G - z_B,
        GM_L=(area @ x**2) / nabla + z_G - z_B,
        rho=rho,
        g=g,
    )
    np.testing.assert_allclose(computed, expected, rtol=1e-9, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("name", list(HULLS))
def test_bundled_hulls_have_the_restoring_of_their_data_base(name: str) -> None:
    document = load_vessel(name).document
    block = {key: value for key, value in document["restoring"]["hydrostatic"].items() if isinstance(value, float)}
    C = stiffness(**block, rho=document["constants"]["rho"], g=document["constants"]["g"])
    np.testing.assert_allclose([C[0, 0], C[0, 2], C[1, 1], C[2, 2]], HULLS[name], rtol=1e-3)
