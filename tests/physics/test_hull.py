from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics import hull


def numbers(expression: Any) -> np.ndarray:
    return np.array(ca.evalf(ca.densify(expression))).ravel()


def test_derivatives_sum_on_their_axes() -> None:
    u, v, r = 2.0, 0.5, -0.1
    nu_r = ca.SX(ca.DM([u, v, 0, 0, 0, r]))
    wrench = numbers(hull.derivatives(nu_r, **{"X_u|u|": -10.0, "Y_uv": 3.0, "Y_v|v|": -4.0, "N_r": 7.0, "K_v": 2.0}))
    np.testing.assert_allclose(wrench, [-10 * u * u, 3 * u * v - 4 * v * abs(v), 0, 2 * v, 0, 7 * r])


def cross_flow(strips: int, v: float, r: float) -> np.ndarray:
    """Wrench of the bundled formula, all strips summed."""
    columns = hull.strips(strips=strips)
    nu_r = ca.SX(ca.DM([1.0, v, 0, 0, 0, r]))
    numbers_of = {"C_d": 1.2, "x_aft": -15.0, "x_fwd": 18.0, "T": 2.6, "rho": 1025.0}
    rows = zip(columns["fraction"], columns["share"], strict=True)
    return sum(numbers(hull.cross_flow(nu_r, fraction, share, **numbers_of)) for fraction, share in rows)


def test_cross_flow_in_pure_sway_is_the_closed_form() -> None:
    """Y = -1/2 rho C_d T L v|v| at the middle of the length."""
    wrench = cross_flow(15, 0.8, 0.0)
    Y = -0.5 * 1025 * 1.2 * 2.6 * 33.0 * 0.8**2
    assert wrench[1] == pytest.approx(Y, rel=1e-12)
    assert wrench[5] == pytest.approx(1.5 * Y, rel=1e-12)


def test_cross_flow_converges_to_the_integral() -> None:
    v, r = 0.3, -0.06
    x = np.linspace(-15.0, 18.0, 330_001)
    across = -0.5 * 1025 * 2.6 * 1.2 * (v + x * r) * np.abs(v + x * r)
    exact = np.array([np.trapezoid(across, x), np.trapezoid(x * across, x)])
    errors = [np.abs(cross_flow(strips, v, r)[[1, 5]] / exact - 1).max() for strips in (8, 32, 128)]
    assert errors[0] > 4 * errors[1] > 16 * errors[2]
    assert errors[2] < 2e-4


def test_strips_cover_the_length_once() -> None:
    columns = hull.strips(strips=7)
    assert columns["share"].sum() == pytest.approx(1.0)
    np.testing.assert_allclose(columns["fraction"], -columns["fraction"][::-1] + 1)


def test_resistance_polynomial() -> None:
    """Set B at 5 m/s: (677.85 + 0.65505 x 625) x 25 N, against the motion on either course."""
    expected = (677.85 + 0.65505 * 625) * 25
    for u, sign in ((5.0, -1), (-5.0, 1)):
        wrench = numbers(hull.resistance(ca.SX(ca.DM([u, 0.3, 0, 0, 0, 0])), R_0=677.85, R_4=0.65505))
        np.testing.assert_allclose(wrench, [sign * expected, 0, 0, 0, 0, 0])


def test_prime_derivatives_are_si_ones_at_their_speed() -> None:
    """Y_v' = -0.3: Y = -0.3 x 1/2 rho L^2 U v; the floor of the speed does not show at 4 m/s."""
    u, v = 4.0, 0.3
    found = numbers(hull.prime_derivatives(ca.SX(ca.DM([u, v, 0, 0, 0, 0])), L_pp=20.0, rho=1000.0, Y_v=-0.3))
    assert found[1] == pytest.approx(-0.3 * 0.5 * 1000 * 400 * np.hypot(u, v) * v, rel=1e-5)


def test_the_mmg_hull_is_its_formula() -> None:
    """Yasukawa and Yoshimura (2015), eqs. 9-11: X with R_0 and a fourth order, forces on L T, the moment on L^2 T."""
    u, v, r, L, T = 1.2, -0.3, 0.05, 7.0, 0.46
    U = np.hypot(u, v)
    v_, r_ = v / U, r * L / U
    force = 0.5 * 1000 * L * T * U**2
    X = force * (-0.02 - 0.04 * v_**2 + 0.77 * v_**4)
    Y, N = force * (-0.315 * v_ + 0.083 * r_), force * L * (-0.049 * r_ - 0.294 * v_**2 * r_)
    values = {"X_vv": -0.04, "X_vvvv": 0.77, "Y_v": -0.315, "Y_r": 0.083, "N_r": -0.049, "N_vvr": -0.294}
    found = hull.mmg(ca.SX(ca.DM([u, v, 0, 0, 0, r])), R_0=0.02, L_pp=L, T=T, rho=1000.0, **values)
    np.testing.assert_allclose(numbers(found), [X, Y, 0, 0, 0, N], rtol=1e-4, atol=1e-9)


def test_the_mmg_resistance_turns_round_with_the_ship() -> None:
    ahead, astern = (
        numbers(hull.mmg(ca.SX(ca.DM([u, 0.2, 0, 0, 0, 0])), R_0=0.02, L_pp=7.0, T=0.46, rho=1000.0))[0]
        for u in (1.0, -1.0)
    )
    assert ahead == -astern < 0


def test_abkowitz_counts_speed_from_that_of_service() -> None:
    """With Y_uv = Y_v the force goes with u v at any speed."""
    values = {"L_pp": 160.0, "U_0": 7.5, "rho": 1025.0, "Y_v": -0.01, "Y_uv": -0.01, "N_vvv": 0.02}
    for u, v in ((7.5, 0.4), (3.0, -0.5)):
        found = numbers(hull.abkowitz(ca.SX(ca.DM([u, v, 0, 0, 0, 0])), **values))
        assert found[1] == pytest.approx(-0.01 * 0.5 * 1025 * 160**2 * u * v)
        assert found[5] == pytest.approx(0.02 * 0.5 * 1025 * 160**3 * v**3 / 7.5)
