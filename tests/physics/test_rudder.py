"""Rudders against the formulae of their sources, written out once more."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics.propeller import propeller_wash
from shipid.physics.rudder import (
    coefficients_normal_force,
    polynomial_normal_force,
    rudder_coefficients,
    rudder_derivatives,
    rudder_wrench,
)

# KVLCC2 at 7 m: Yasukawa and Yoshimura (2015), tables 1 and 3
RUDDER: dict[str, Any] = {
    **{"x": -3.5, "A_R": 0.0539, "H_R": 0.345, "f_alpha": 2.747, "epsilon": 1.09, "kappa": 0.50},
    **{"gamma_R_plus": 0.640, "gamma_R_minus": 0.395, "ell_R": -4.97, "t_R": 0.387, "a_H": 0.312, "x_H": -3.248},
    "rho": 1000.0,
}
L, D_P = 7.0, 0.216


def wrench(nu_r: list[float], delta: float, wash: list[float], **other: Any) -> np.ndarray:
    inputs = ca.SX(np.array(nu_r)), ca.SX(delta), ca.SX(np.array(wash))
    return np.array(ca.evalf(rudder_wrench(*inputs, **{**RUDDER, **other}))).ravel()


@pytest.mark.parametrize("v", [-0.2, 0.15])
@pytest.mark.parametrize("r", [-0.1, 0.08])
@pytest.mark.parametrize("delta", [-0.6, 0.0, 0.3])
def test_the_formulae_of_the_paper(v: float, r: float, delta: float) -> None:
    """Eqs. 18-27 as they are printed: primes, angles, J and K_T."""
    u, w_P, n = 1.1, 0.35, 10.0
    U, beta = np.hypot(u, v), np.arctan2(-v, u)
    J = u * (1 - w_P) / (n * D_P)
    K_T = 0.2931 - 0.2753 * J - 0.1385 * J**2
    eta = D_P / 0.345
    beta_R = beta - (-0.710) * r * L / U
    v_R = U * (0.640 if beta_R > 0 else 0.395) * beta_R
    race = 1 + 0.50 * (np.sqrt(1 + 8 * K_T / (np.pi * J**2)) - 1)
    u_R = 1.09 * u * (1 - w_P) * np.sqrt(eta * race**2 + 1 - eta)
    F_N = 0.5 * 1000 * 0.0539 * (u_R**2 + v_R**2) * 2.747 * np.sin(delta - np.arctan2(v_R, u_R))
    X, Y = -(1 - 0.387) * F_N * np.sin(delta), -(1 + 0.312) * F_N * np.cos(delta)
    N = -(-0.5 + 0.312 * -0.464) * L * F_N * np.cos(delta)
    u_P = u * (1 - w_P)
    flow = [u_P, u_P * np.sqrt(1 + 8 * K_T / (np.pi * J**2)), D_P]
    forces = wrench([u, v, 0, 0, 0, r], delta, flow, y=0.4, z=0.2)
    np.testing.assert_allclose(forces, [X, Y, 0, -0.2 * Y, 0.2 * X, N - 0.4 * X], rtol=2e-3, atol=1e-3)


def test_derivatives_by_hand() -> None:
    """Y = 1/2 rho L^2 U_0^2 (Y_delta delta + Y_udelta u' delta + Y_vvdelta v'^2 delta), N with L^3."""
    values = {"Y_delta": -0.003, "Y_udelta": -0.006, "Y_vvdelta": -0.01, "N_delta": 0.0014}
    nu_r = ca.SX(np.array([6.0, -1.0, 0, 0, 0, 0.01]))
    forces = ca.evalf(rudder_derivatives(nu_r, ca.SX(0.2), L_pp=160.0, U_0=7.5, rho=1025.0, **values))
    force = 1025 / 2 * 160**2 * 7.5**2
    u, v = 6.0 / 7.5 - 1, -1.0 / 7.5
    Y = force * 0.2 * (-0.003 - 0.006 * u - 0.01 * v**2)
    np.testing.assert_allclose(np.array(forces).ravel(), [0, Y, 0, 0, 0, force * 160 * 0.0014 * 0.2], rtol=1e-12)


def test_rudder_coefficients_by_hand() -> None:
    """1/2 rho L^2 (Y |c|c delta + ...), moments with L^3; c between inflow and race; even parts favour one side."""
    values = {"Y_|c|cdelta": -0.02, "Y_cc|delta|": -0.001, "X_ccdeltadelta": -0.01, "N_|c|c|beta|betadelta": 0.03}
    u, v, delta = 2.0, -0.4, 0.3
    c, beta = 1.5 + 0.5 * (2.5 - 1.5), np.arctan2(-v, u)
    given = ca.SX(np.array([u, v, 0, 0, 0, 0])), ca.SX(delta), ca.SX(np.array([1.5, 2.5, D_P]))
    forces = np.array(ca.evalf(rudder_coefficients(*given, kappa=0.5, L_pp=L, rho=1000.0, **values))).ravel()
    force = 500 * L**2 * c**2
    Y, N = force * (-0.02 * delta - 0.001 * delta), force * L * 0.03 * abs(beta) * beta * delta
    X = force * -0.01 * delta**2
    np.testing.assert_allclose(forces, [X, Y, 0, 0, 0, N], rtol=1e-9)
    shown = ca.evalf(coefficients_normal_force(*given, kappa=0.5, L_pp=L, rho=1000.0, **values))
    assert float(shown) == pytest.approx(-X * np.sin(delta) - Y * np.cos(delta))  # across the blade


@pytest.mark.parametrize("u", [0.02, 2.0, -0.5])
def test_a_screw_that_does_not_push_leaves_a_rudder_in_its_inflow(u: float) -> None:
    """However much of the blade is in the slipstream, at the slowest speeds too."""
    nu_r, n = ca.SX(np.array([u, 0.1, 0, 0, 0, 0])), ca.SX(1.0)
    wake = {"w_P0": 0.0, "C_1": 2.0, "C_2_plus": 1.6, "C_2_minus": 1.1}
    wash = propeller_wash(nu_r, n, x=-3.4, D_p=D_P, K_T={"1": ca.SX(0.0)}, **wake)
    numbers = {"A_R": 0.05, "f_alpha": 2.7, "epsilon": 1.0, "v_R": {"v": -0.5}, "L_pp": L, "rho": 1000.0}
    forces = [float(ca.evalf(polynomial_normal_force(nu_r, ca.SX(0.3), wash, k_x=k, **numbers))) for k in (0.0, 0.9)]
    assert forces[1] == pytest.approx(forces[0], rel=1e-9)


def side_force(delta: float, **other: float) -> float:
    return float(wrench([1.0, 0, 0, 0, 0, 0], delta, [0.6, 1.4, D_P], **other)[1])


@pytest.mark.parametrize("delta", [0.2, 0.6])
def test_a_rudder_force_may_differ_by_side_and_angle(delta: float) -> None:
    """F_N times 1 + f_angle |s| + f_side sign(s) + f_angle_side s, s = sin(delta) in flow from ahead."""
    shape = {"f_angle": -0.2, "f_side": 0.05, "f_angle_side": 0.1}
    for sense in (1, -1):
        s = np.sin(sense * delta)
        factor = 1 - 0.2 * abs(s) + 0.05 * sense + 0.1 * s
        assert side_force(sense * delta, **shape) == pytest.approx(factor * side_force(sense * delta))
    mirrored = {**shape, "f_side": -0.05, "f_angle_side": -0.1}  # a screw that turns the other way
    assert side_force(-delta, **mirrored) == pytest.approx(-side_force(delta, **shape))
    both = side_force(delta, f_angle=-0.2), side_force(-delta, f_angle=-0.2)
    assert both[0] == -both[1]
