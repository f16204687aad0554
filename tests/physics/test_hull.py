from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics import hull
from shipid.physics.grammar import hull_derivative
from tests.drawn import seeds

UPRIGHT = ca.SX(6, 1)


def numbers(expression: Any) -> np.ndarray:
    return np.array(ca.evalf(ca.densify(expression))).ravel()


def test_derivatives_sum_on_their_axes() -> None:
    u, v, r = 2.0, 0.5, -0.1
    nu_r = ca.SX(ca.DM([u, v, 0, 0, 0, r]))
    wrench = numbers(
        hull.derivatives_wrench(nu_r, UPRIGHT, **{"X_u|u|": -10.0, "Y_uv": 3.0, "Y_v|v|": -4.0, "N_r": 7.0, "K_v": 2.0})
    )
    np.testing.assert_allclose(wrench, [-10 * u * u, 3 * u * v - 4 * v * abs(v), 0, 2 * v, 0, 7 * r])


def cross_flow(strips: int, v: float, r: float, **other: float) -> np.ndarray:
    """Wrench of the bundled formula, all strips summed."""
    columns = hull.hull_strips(strips=strips)
    nu_r = ca.SX(ca.DM([1.0, v, 0, 0, 0, r]))
    numbers_of = {"C_d": 1.2, "x_aft": -15.0, "x_fwd": 18.0, "T": 2.6, "rho": 1025.0, **other}
    rows = zip(columns["fraction"], columns["share"], strict=True)
    return sum(numbers(hull.cross_flow(nu_r, fraction, share, **numbers_of)) for fraction, share in rows)


def test_cross_flow_in_pure_sway_is_the_closed_form() -> None:
    """Y = -1/2 rho C_d T L v|v| at the middle of the length."""
    wrench = cross_flow(15, 0.8, 0.0)
    Y = -0.5 * 1025 * 1.2 * 2.6 * 33.0 * 0.8**2
    assert wrench[1] == pytest.approx(Y, rel=1e-12)
    assert wrench[5] == pytest.approx(1.5 * Y, rel=1e-12)


def test_cross_flow_along_the_hull_has_coefficients_for_force_and_for_moment() -> None:
    """Pure sway: the force of C_d, its centre k_fwd L / 6 forward. Pure yaw about the middle: 1 + k_ends / 2."""
    uniform, along = (cross_flow(400, 0.5, 0.0, **more) for more in ({}, {"k_fwd": 0.4, "k_ends": 0.6}))
    assert along[1] == pytest.approx(uniform[1], rel=1e-4)
    assert along[5] / along[1] == pytest.approx(1.5 + 0.4 * 33.0 / 6, rel=1e-4)
    ends = {"x_aft": -16.5, "x_fwd": 16.5}
    plain, strong = (cross_flow(400, 0.0, 0.04, k_ends=k, **ends)[5] for k in (0.0, 0.6))
    assert strong / plain == pytest.approx(1.3, rel=1e-3)


@pytest.mark.parametrize("seed", seeds(3, 20))
def test_cross_flow_of_any_shape_takes_energy_and_is_mirrored(seed: int) -> None:
    """Also of shapes that would be negative somewhere along the hull."""
    rng = np.random.default_rng(seed)
    v, r = rng.uniform(-2, 2), rng.uniform(-0.2, 0.2)
    shape = {"k_fwd": rng.uniform(-3, 3), "k_ends": rng.uniform(-3, 3)}
    wrench = cross_flow(11, v, r, **shape)
    assert wrench[1] * v + wrench[5] * r <= 0
    np.testing.assert_allclose(cross_flow(11, -v, -r, **shape), -wrench, rtol=1e-12)


def test_resistance_polynomial() -> None:
    """Set B at 5 m/s: (677.85 + 0.65505 x 625) x 25 N, against the motion on either course."""
    expected = (677.85 + 0.65505 * 625) * 25
    for u, sign in ((5.0, -1), (-5.0, 1)):
        wrench = numbers(hull.resistance_wrench(ca.SX(ca.DM([u, 0.3, 0, 0, 0, 0])), R_0=677.85, R_4=0.65505))
        np.testing.assert_allclose(wrench, [sign * expected, 0, 0, 0, 0, 0])


def test_astern_the_hull_has_more_resistance() -> None:
    """k_astern times that ahead, continuous at rest, always against the motion."""
    mmg = {"R_0": 0.02, "L_pp": 7.0, "T": 0.46, "rho": 1000.0}
    kinds = (
        lambda nu, **k: hull.mmg_wrench(nu, UPRIGHT, **mmg, **k),
        lambda nu, **k: hull.resistance_wrench(nu, R_0=70.0, R_2=3.0, **k),
    )
    for kind in kinds:
        ahead, astern = (numbers(kind(ca.SX(ca.DM([u, 0.1, 0, 0, 0, 0])), k_astern=1.4))[0] for u in (0.8, -0.8))
        assert astern == pytest.approx(-1.4 * ahead)
        assert ahead < 0 < astern
        assert ahead == numbers(kind(ca.SX(ca.DM([0.8, 0.1, 0, 0, 0, 0]))))[0]
        near = [numbers(kind(ca.SX(ca.DM([u, 0, 0, 0, 0, 0])), k_astern=1.4))[0] for u in (-1e-6, 1e-6)]
        assert np.abs(near).max() < 1e-3


def test_bis_derivatives_by_hand() -> None:
    """Norrbin (1970): m sqrt(g / L) X_u'' u, m Y_ur'' u r and m L N_uv'' / L u v; linear damping holds at rest."""
    m, L, g, (u, v, r) = 1025.0 * 5000, 76.2, 9.81, (0.8, -0.3, 0.01)
    values = {"X_u": -0.0358, "Y_ur": -0.7, "N_uv": -0.45, "N_r": -0.03, "K_p": -0.01}
    nu_r = ca.SX(ca.DM([u, v, 0, 0.02, 0, r]))
    forces = numbers(hull.bis_derivatives(nu_r, UPRIGHT, nabla=5000.0, L_pp=L, rho=1025.0, g=g, **values))
    rate = np.sqrt(g / L)
    expected = [-0.0358 * m * rate * u, -0.7 * m * u * r, 0, -0.01 * m * L**2 * rate * 0.02, 0]
    np.testing.assert_allclose(forces, [*expected, m * -0.45 * u * v - 0.03 * m * L**2 * rate * r], rtol=1e-12)


def test_the_mmg_hull_is_its_formula() -> None:
    """Yasukawa and Yoshimura (2015), eqs. 9-11: X with R_0 and a fourth order, forces on L T, the moment on L^2 T."""
    u, v, r, L, T = 1.2, -0.3, 0.05, 7.0, 0.46
    U = np.hypot(u, v)
    v_, r_ = v / U, r * L / U
    force = 0.5 * 1000 * L * T * U**2
    X = force * (-0.02 - 0.04 * v_**2 + 0.77 * v_**4)
    Y, N = force * (-0.315 * v_ + 0.083 * r_), force * L * (-0.049 * r_ - 0.294 * v_**2 * r_)
    values = {"X_vv": -0.04, "X_vvvv": 0.77, "Y_v": -0.315, "Y_r": 0.083, "N_r": -0.049, "N_vvr": -0.294}
    forces = hull.mmg_wrench(ca.SX(ca.DM([u, v, 0, 0, 0, r])), UPRIGHT, R_0=0.02, L_pp=L, T=T, rho=1000.0, **values)
    np.testing.assert_allclose(numbers(forces), [X, Y, 0, 0, 0, N], rtol=1e-4, atol=1e-9)


TURNED = {"X_vv": -0.04, "X_rr": 0.01, "X_vvvv": 0.7, "Y_r": 0.08, "Y_|r|r": -0.04, "Y_vvr": 0.4, "N_v": -0.1}
TURNED |= {"N_|v|v": -0.03, "N_vrr": 0.05, "K_r": 0.02, "M_v": 0.01, "N_vv": 0.01}
ALIKE = {"X_vr": 0.002, "Y_v": -0.3, "Y_|v|v": -0.7, "Y_vrr": -0.4, "N_r": -0.05, "N_|r|r": -0.03, "N_vvr": -0.3}
ALIKE |= {"N_uv": -0.1, "X_u": -0.02, "K_v": 0.01, "Y_rr": 0.01, "Y_phi": -0.01}


def mmg(name: str, value: float, u: float, v: float, r: float) -> np.ndarray:
    nu_r, eta = ca.SX(ca.DM([u, v, 0, 0, 0, r])), ca.SX(ca.DM([0, 0, 0, 0.1, 0, 0]))
    still = hull.mmg_wrench(nu_r, eta, R_0=0.02, L_pp=7.0, T=0.46, rho=1000.0)
    return numbers(hull.mmg_wrench(nu_r, eta, R_0=0.02, L_pp=7.0, T=0.46, rho=1000.0, **{name: value})) - numbers(still)


@pytest.mark.parametrize(("name", "value"), [*TURNED.items(), *ALIKE.items()])
def test_astern_the_mmg_hull_is_alike_fore_and_aft(name: str, value: float) -> None:
    """Seen in a mirror abeam, X, M, N and u, q, r have the other sign: N_v, Munk's moment, had none of u."""
    mirror = np.array([-1, 1, 1, 1, -1, -1])
    for u, v, r in ((1.2, 0.4, 0.1), (0.3, -0.5, 0.05), (0.1, 0.02, -0.3)):
        ahead, astern = mmg(name, value, u, v, r), mmg(name, value, -u, v, -r)
        np.testing.assert_allclose(astern, mirror * ahead, rtol=1e-12, atol=1e-12)
    U, axis = np.hypot(1.2, 0.4), "XYZKMN".index(name[0])
    factors = {"u": 1.2 / U, "v": 0.4 / U, "r": 0.1 * 7 / U, "phi": 0.1}
    formula = hull_derivative(name)
    expected = value * np.prod([factors[symbol] for symbol, _ in formula.factors])  # ahead, as it is written
    lever = 7.0 if axis > 2 else 1.0
    assert mmg(name, value, 1.2, 0.4, 0.1)[axis] == pytest.approx(500 * 7 * 0.46 * U**2 * lever * expected, rel=1e-4)
    abeam = mmg(name, value, 0.0, 0.4, 0.0)[axis]
    assert (abeam == 0) or name in ALIKE
