from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics.inertia import coriolis_force, mass_matrix, rigid_body_entries
from tests.drawn import seeds


def numbers(expression: Any) -> np.ndarray:
    return np.array(ca.evalf(ca.densify(expression)))


def test_rigid_body_has_the_kinetic_energy_of_its_points() -> None:
    """Eight point masses, symmetric about the centre plane: 1/2 nu' M nu = sum of 1/2 m |v + omega x p|^2."""
    rng = np.random.default_rng(3)
    half = rng.uniform(-4, 4, (4, 3))
    half[:, 2] += 1.0
    points, masses = np.vstack([half, half * [1, -1, 1]]), np.tile(rng.uniform(1, 5, 4), 2)
    x, y, z = points.T
    m = masses.sum()
    M = numbers(
        mass_matrix(
            rigid_body_entries(
                m=m,
                x_G=masses @ x / m,
                z_G=masses @ z / m,
                I_x=masses @ (y**2 + z**2),
                I_y=masses @ (x**2 + z**2),
                I_z=masses @ (x**2 + y**2),
            )
        )
    )
    products = np.zeros((6, 6))
    products[3, 5] = products[5, 3] = -(masses @ (x * z))  # the one product of inertia that the model leaves out
    nu = rng.uniform(-1, 1, 6)
    velocity = nu[:3] + np.cross(nu[3:], points)
    energy = 0.5 * masses @ (velocity**2).sum(axis=1)
    assert 0.5 * nu @ (M + products) @ nu == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_coriolis_does_no_work(seed: int) -> None:
    rng = np.random.default_rng(seed)
    M, nu = rng.normal(size=(6, 6)), rng.normal(size=6)  # not even symmetric
    force = numbers(coriolis_force(ca.SX(ca.DM(M)), ca.SX(ca.DM(nu)))).ravel()
    assert np.abs(force).max() > 0.1
    assert nu @ force == pytest.approx(0, abs=1e-13)


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_planar_closed_form(seed: int) -> None:
    """C(M) nu = [-(m22 v + c r) r, m11 u r, (m22 v + c r) u - m11 u v], c = (m23 + m32) / 2."""
    rng = np.random.default_rng(seed)
    M = np.zeros((6, 6))
    M[0, 0], M[1, 1], M[1, 5], M[5, 1], M[5, 5] = rng.uniform(1, 5, 5)
    u, v, r = rng.uniform(-2, 2, 3)
    forces = numbers(coriolis_force(ca.SX(ca.DM(M)), ca.SX(ca.DM([u, v, 0, 0, 0, r])))).ravel()[[0, 1, 5]]
    sway = M[1, 1] * v + (M[1, 5] + M[5, 1]) / 2 * r
    np.testing.assert_allclose(forces, [-sway * r, M[0, 0] * u * r, sway * u - M[0, 0] * u * v], atol=1e-13)


def test_free_rigid_body_keeps_its_momentum() -> None:
    """Kirchhoff without fluid: with M nu_dot = -C nu, momentum in fixed axes does not change."""
    rng = np.random.default_rng(1)
    M = numbers(mass_matrix(rigid_body_entries(m=3.0, I_x=2.0, I_y=5.0, I_z=6.0, x_G=0.4, z_G=-0.2)))
    nu = rng.normal(size=6)
    nu_dot = np.linalg.solve(M, -numbers(coriolis_force(ca.SX(ca.DM(M)), ca.SX(ca.DM(nu)))).ravel())
    linear, angular = np.split(M @ nu, 2)
    linear_dot, angular_dot = np.split(M @ nu_dot, 2)
    np.testing.assert_allclose(linear_dot + np.cross(nu[3:], linear), 0, atol=1e-13)
    np.testing.assert_allclose(angular_dot + np.cross(nu[3:], angular) + np.cross(nu[:3], linear), 0, atol=1e-13)
