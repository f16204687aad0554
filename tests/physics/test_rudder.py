"""Rudders against the formulae of their sources, written out once more."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics.rudder import rudder, rudder_derivatives

# KVLCC2 at 7 m: Yasukawa and Yoshimura (2015), tables 1 and 3
RUDDER: dict[str, Any] = {
    **{"x": -3.5, "A_R": 0.0539, "H_R": 0.345, "f_alpha": 2.747, "epsilon": 1.09, "kappa": 0.50},
    **{"gamma_R_plus": 0.640, "gamma_R_minus": 0.395, "ell_R": -4.97, "t_R": 0.387, "a_H": 0.312, "x_H": -3.248},
    "rho": 1000.0,
}
L, D_P = 7.0, 0.216


def wrench(nu_r: list[float], delta: float, wash: list[float], **other: Any) -> np.ndarray:
    inputs = ca.SX(np.array(nu_r)), ca.SX(delta), ca.SX(np.array(wash))
    return np.array(ca.evalf(rudder(*inputs, **{**RUDDER, **other}))).ravel()


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
    found = wrench([u, v, 0, 0, 0, r], delta, [u_P, u_P * np.sqrt(1 + 8 * K_T / (np.pi * J**2)), D_P])
    np.testing.assert_allclose(found[[0, 1, 5]], [X, Y, N], rtol=2e-3, atol=1e-3)


def test_helm_to_starboard_turns_to_starboard_and_costs_speed() -> None:
    X, Y, *_, N = wrench([1.0, 0, 0, 0, 0, 0], 0.3, [0.6, 1.4, D_P])
    assert X < 0
    assert Y < 0
    assert N > 0


def test_without_a_race_or_way_there_is_no_force() -> None:
    assert np.abs(wrench([0.0] * 6, 0.6, [0.0, 0.0, D_P])).max() < 0.02  # N, N m: the floor of the speed is 0.01 m/s


def test_going_astern_the_helm_works_the_other_way() -> None:
    assert wrench([-1.0, 0, 0, 0, 0, 0], 0.3, [-1.0, -1.0, D_P])[5] < 0


def test_derivatives_by_hand() -> None:
    """Y = 1/2 rho L^2 U_0^2 (Y_delta delta + Y_udelta u' delta + Y_vvdelta v'^2 delta), N with L^3."""
    values = {"Y_delta": -0.003, "Y_udelta": -0.006, "Y_vvdelta": -0.01, "N_delta": 0.0014}
    nu_r = ca.SX(np.array([6.0, -1.0, 0, 0, 0, 0.01]))
    found = ca.evalf(rudder_derivatives(nu_r, ca.SX(0.2), L_pp=160.0, U_0=7.5, rho=1025.0, **values))
    force = 1025 / 2 * 160**2 * 7.5**2
    u, v = 6.0 / 7.5 - 1, -1.0 / 7.5
    Y = force * 0.2 * (-0.003 - 0.006 * u - 0.01 * v**2)
    np.testing.assert_allclose(np.array(found).ravel(), [0, Y, 0, 0, 0, force * 160 * 0.0014 * 0.2], rtol=1e-12)
