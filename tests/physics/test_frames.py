from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics.frames import current_velocity, position_rates, rotation_matrix, skew_matrix, wrench_of_force
from tests.drawn import seeds


def numbers(expression: Any) -> np.ndarray:
    return np.array(ca.evalf(ca.densify(expression)))


def dm(values: Any) -> ca.SX:
    return ca.SX(ca.DM(values))


def test_rotation_is_yaw_then_pitch_then_roll() -> None:
    phi, theta, psi = 0.3, -0.2, 1.1

    def about(axis: int, angle: float) -> np.ndarray:
        matrix = np.eye(3)
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        matrix[i, i] = matrix[j, j] = np.cos(angle)
        matrix[i, j], matrix[j, i] = -np.sin(angle), np.sin(angle)
        return matrix

    expected = about(2, psi) @ about(1, theta) @ about(0, phi)
    np.testing.assert_allclose(numbers(rotation_matrix(phi, theta, psi)), expected, atol=1e-15)


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_euler_rates_agree_with_the_rate_of_the_rotation(seed: int) -> None:
    """dR/dt = R S(omega), with dR/dt by central differences along the angles' rates."""
    rng = np.random.default_rng(seed)
    angles, omega, h = rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3), 1e-6
    rates = numbers(position_rates(dm([0, 0, 0, *angles]), dm([0, 0, 0, *omega]))).ravel()[3:]
    slope = (numbers(rotation_matrix(*(angles + h * rates))) - numbers(rotation_matrix(*(angles - h * rates)))) / (
        2 * h
    )
    np.testing.assert_allclose(slope, numbers(rotation_matrix(*angles)) @ numbers(skew_matrix(dm(omega))), atol=1e-9)


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_rate_of_a_steady_current_is_its_derivative_along_the_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    eta = ca.SX.sym("eta", 6)
    nu = dm([*rng.uniform(-3, 3, 3), *rng.uniform(-0.3, 0.3, 3)])
    nu_c, rate = current_velocity(eta, nu, 0.8, 2.1)
    by_chain_rule = ca.jtimes(nu_c, eta, position_rates(eta, nu))
    function = ca.Function("both", [eta], [rate, by_chain_rule, nu_c])
    computed, expected, velocity = (np.array(x).ravel() for x in function(rng.uniform(-0.8, 0.8, 6)))
    np.testing.assert_allclose(computed, expected, atol=1e-14)
    assert np.linalg.norm(velocity) == pytest.approx(0.8)
    assert np.abs(computed).max() > 1e-3


def test_force_at_a_point_is_force_and_lever_cross_force() -> None:
    point, force = np.array([-13.0, 2.7, 2.1]), np.array([10.0, -4.0, 0.0])
    wrench = numbers(wrench_of_force(*(ca.SX(x) for x in point), *(ca.SX(f) for f in force[:2]))).ravel()
    np.testing.assert_allclose(wrench, [*force, *np.cross(point, force)])
