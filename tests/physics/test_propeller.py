"""A propeller behind a hull against numbers worked by hand; limits of wake and thrust."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics.propeller import (
    controllable_pitch,
    controllable_wash,
    four_quadrant,
    four_quadrant_wash,
    propeller_torque,
    propeller_wash,
    propeller_wrench,
    quadratic_propeller_wrench,
    quadratic_wash,
)

# KVLCC2 at 7 m: Yasukawa and Yoshimura (2015), tables 1 and 3
WAKE = {"w_P0": 0.40, "C_1": 2.0, "C_2_plus": 1.6, "C_2_minus": 1.1}
SCREW: dict[str, Any] = {"x": -3.36, "D_p": 0.216, "K_T": {"1": 0.2931, "J": -0.2753, "JJ": -0.1385}, **WAKE}
RHO = 1000.0


def thrust(u: float, n: float, **other: Any) -> np.ndarray:
    nu_r = ca.SX(np.array([u, 0, 0, 0, 0, 0]))
    return np.array(ca.evalf(propeller_wrench(nu_r, ca.SX(n), t_P=0.220, rho=RHO, **{**SCREW, **other}))).ravel()


def washed(nu_r: list[float], n: float, **other: Any) -> np.ndarray:
    return np.array(ca.evalf(propeller_wash(ca.SX(np.array(nu_r)), ca.SX(n), **{**SCREW, **other}))).ravel()


def test_thrust_by_hand() -> None:
    """J = 0.6 x 1.179 / (10.4 x 0.216) = 0.3149, K_T = 0.1927: 0.78 x 1000 x 10.4^2 x 0.216^4 x K_T = 35.4 N."""
    assert thrust(1.179, 10.4)[0] == pytest.approx(35.39, abs=0.02)


@pytest.mark.parametrize("u", [1.179, -0.4])
@pytest.mark.parametrize("n", [10.4, -8.0])
def test_a_torque_by_the_polynomial_of_the_thrust_is_the_thrust_times_the_diameter(u: float, n: float) -> None:
    """Q = K_Q rho n^2 D^5 and T = K_T rho n^2 D^4 by definition, of a screw astern in its sense too."""
    numbers = {name: value for name, value in SCREW.items() if name != "K_T"} | {"K_Q": SCREW["K_T"], "rho": RHO}
    torque = propeller_torque(ca.SX(np.array([u, 0, 0, 0, 0, 0])), ca.SX(n), **numbers)
    assert float(ca.evalf(torque)) == pytest.approx(0.216 * thrust(u, n)[0] / 0.78, rel=1e-9)


def test_race_is_momentum_theory() -> None:
    """u_race = u_P sqrt(1 + 8 K_T / (pi J^2)); at J = 0.3149 and K_T = 0.1927: 2.438 u_P."""
    u_P, race, D_p = washed([1.179, 0, 0, 0, 0, 0], 10.4)
    assert (u_P, D_p) == (pytest.approx(0.7074), pytest.approx(0.216))
    assert race / u_P == pytest.approx(2.438, abs=0.002)


@pytest.mark.parametrize(("v", "C_2"), [(-0.3, 1.6), (0.3, 1.1)])
def test_wake_with_drift(v: float, C_2: float) -> None:
    """Drift to port (v < 0: beta > 0) takes C_2_plus; the inflow rises by 1 + (1 - exp(-2 beta)) (C_2 - 1)."""
    beta = np.arctan(0.3)
    rise = 1 + (1 - np.exp(-2 * beta)) * (C_2 - 1)
    assert washed([1.0, v, 0, 0, 0, 0], 10.0)[0] == pytest.approx(0.6 * rise, rel=1e-3)


@pytest.mark.parametrize(("v", "r"), [(-0.3, 0.0), (0.3, 0.05), (0.0, -0.1)])
def test_wake_by_tau_and_C_P(v: float, r: float) -> None:
    """1 - w_P = 0.6 + tau |v_P| + C_P v_P^2, the same to both sides."""
    v_P = (v - 3.36 * r) / np.hypot(1.0, v)
    plain = {"C_1": 0.0, "tau": 0.2, "C_P": 0.9}
    expected = 0.6 + 0.2 * abs(v_P) + 0.9 * v_P**2
    assert washed([1.0, v, 0, 0, 0, r], 10.0, **plain)[0] == pytest.approx(expected, rel=1e-12)
    assert washed([1.0, -v, 0, 0, 0, -r], 10.0, **plain)[0] == pytest.approx(expected, rel=1e-12)
    given = {**VARIABLE, **plain, "t_P": 0.0, "rho": RHO}
    nu_r = ca.SX(np.array([1.0, v, 0, 0, 0, r]))
    thrust_there = float(ca.evalf(controllable_pitch(nu_r, ca.SX(8.0), ca.SX(0.5), **given))[0])
    by_hand = RHO * 0.216**4 * (VARIABLE["k_P"] * 0.5 * 64 - VARIABLE["k_J"] * 8 * expected / 0.216)
    assert thrust_there == pytest.approx(by_hand, rel=1e-12)


ASTERN = {"1": 0.25, "J": 0.30, "JJ": 0.05}


def test_a_stopped_screw_drags_by_its_disc() -> None:
    """k_drag rho D^2 u_P|u_P| (1 - t_P); the drag takes energy, and is nothing inside the curve."""
    for u in (1.2, -0.8):
        u_P = 0.6 * u
        assert thrust(u, 0.0, k_drag=0.15)[0] == pytest.approx(-0.78 * 0.15 * RHO * 0.216**2 * u_P * abs(u_P))
    assert thrust(1.179, 10.4, k_drag=0.15)[0] == thrust(1.179, 10.4)[0]
    rng = np.random.default_rng(3)
    for u, n in rng.uniform([-2, -12], [2, 12], (30, 2)):
        driven = thrust(u, n, k_drag=0.3)[0]
        assert (driven - thrust(u, n)[0]) * u <= 0
        assert thrust(-u, -n, k_drag=0.3)[0] == pytest.approx(-driven)  # ship and screw the other way round


def test_a_screw_astern_pushes_the_stern_aside() -> None:
    """Y = rho n^2 D^4 Y_astern(J), N = rho n^2 D^5 N_astern(J), only astern; a left-handed screw is its mirror."""
    aside = {"Y_astern": {"1": -0.03, "J": 0.02}, "N_astern": {"1": 0.4}}
    n, u, unit = -8.0, 0.5, RHO * 64 * 0.216**4
    forces = thrust(u, n, **aside)
    J = 0.6 * u / (n * 0.216)
    np.testing.assert_allclose(forces[[1, 5]], [unit * (-0.03 + 0.02 * J), unit * 0.216 * 0.4])
    assert forces[0] == thrust(u, n)[0]
    np.testing.assert_array_equal(thrust(u, 8.0, **aside), thrust(u, 8.0))
    left = {"Y_astern": {"1": 0.03, "J": -0.02}, "N_astern": {"1": -0.4}}
    np.testing.assert_allclose(thrust(u, n, **left), forces * [1, -1, 1, -1, 1, -1])
    lower = thrust(u, n, z=0.3, **aside) - forces
    np.testing.assert_allclose(lower, [0, 0, 0, -0.3 * forces[1], 0.3 * forces[0], 0], atol=1e-12)


def test_a_screw_astern_draws_water_past_the_rudder() -> None:
    """u_P - k (sqrt(u_P^2 + 8 K n^2 D^2 / pi) - |u_P|), over the whole rudder; nothing of it ahead."""
    n, u_P = -9.0, 0.6
    J = u_P / (n * 0.216)
    K = 0.2931 - 0.2753 * J - 0.1385 * J**2
    added = np.sqrt(u_P**2 + 8 / np.pi * K * (n * 0.216) ** 2) - u_P
    flow = washed([1.0, 0, 0, 0, 0, 0], n, k_suction=0.4)
    np.testing.assert_allclose(flow, [u_P - 0.4 * added, u_P - 0.4 * added, 0.216], rtol=1e-3)
    assert flow[0] < 0.1 * u_P
    np.testing.assert_array_equal(washed([1.0, 0, 0, 0, 0, 0], 9.0, k_suction=0.4), washed([1.0, 0, 0, 0, 0, 0], 9.0))
    near = [washed([1.0, 0, 0, 0, 0, 0], n, k_suction=0.4) for n in (-1e-5, 1e-5)]
    np.testing.assert_allclose(*near, atol=1e-3)


@cache
def four_quadrants() -> ca.Function:
    """(u, n) -> surge force and slipstream of KVLCC2's screw, whose polynomial is laid on the quadrants n > 0."""
    beta = np.linspace(-180, 180, 721)
    J = np.clip(0.7 * np.pi * np.tan(np.radians(beta)), -1.0, 1.5)
    K = 0.2931 - 0.2753 * J - 0.1385 * J**2
    ahead = np.cos(np.radians(beta)) ** 2 * 8 / np.pi * K / (0.7 * np.pi) ** 2
    C_T = np.where(np.abs(beta) < 90, ahead, -0.8 * ahead[::-1])
    C_T[0] = C_T[-1] = -0.1
    given = {**WAKE, "x": -3.36, "D_p": 0.216, "beta_deg": list(ca.SX(beta).nz), "C_T": list(ca.SX(C_T).nz)}
    u, n = ca.SX.sym("u"), ca.SX.sym("n")
    nu_r = ca.vertcat(u, ca.SX(5, 1))
    force = four_quadrant(nu_r, n, t_P=0.22, rho=RHO, **given)[0]
    return ca.Function("four_quadrants", [u, n], [force, four_quadrant_wash(nu_r, n, **given)])


def in_four_quadrants(u: float, n: float) -> tuple[float, np.ndarray]:
    force, flow = four_quadrants()(u, n)
    return float(force), np.array(flow).ravel()


@pytest.mark.parametrize(("u", "n"), [(1.179, 10.4), (0.0, 8.0), (-0.4, 9.0), (1.0, 5.0)])
def test_a_screw_in_four_quadrants_is_its_polynomial_ahead(u: float, n: float) -> None:
    force, flow = in_four_quadrants(u, n)
    assert force == pytest.approx(thrust(u, n)[0], rel=1e-3)
    if u >= 0:
        np.testing.assert_allclose(flow, washed([u, 0, 0, 0, 0, 0], n), rtol=1e-3)


QUADRATIC: dict[str, Any] = {"x": -0.5, "T_nn": 3.6e-3, "T_nu": 1.5e-4}


def quadratic_wrench(u: float, n: float, **other: Any) -> np.ndarray:
    nu_r = ca.SX(np.array([u, 0.1, 0, 0, 0, 0]))
    return np.array(ca.evalf(quadratic_propeller_wrench(nu_r, ca.SX(n), **{**QUADRATIC, **other}))).ravel()


def quadratic_flow(u: float, n: float, **other: Any) -> np.ndarray:
    nu_r = ca.SX(np.array([u, 0.1, 0, 0, 0, 0]))
    given = {name: value for name, value in {**QUADRATIC, "rho": 1014.0, **other}.items() if name != "x"}
    return np.array(ca.evalf(quadratic_wash(nu_r, ca.SX(n), **given))).ravel()


def test_quadratic_thrust_by_hand() -> None:
    """T = T_nn n|n| - T_nu |n| u - T_uu u|u|; Y and N are shares of T."""
    u, n = 0.7, 20.0
    T = 3.6e-3 * 400 - 1.5e-4 * 20 * u - 0.2 * u**2
    forces = quadratic_wrench(u, n, T_uu=0.2, t_P=0.1, Y_T=0.04, N_T=-0.3, y=0.2, z=0.5)
    X, Y = 0.9 * T, 0.04 * T
    np.testing.assert_allclose(forces, [X, Y, 0, -0.5 * Y, 0.5 * X, -0.3 * T - 0.2 * X], atol=1e-12)
    astern = quadratic_wrench(u, -n, k_astern=1.4, dT_nu=3e-4)[0]
    assert astern == pytest.approx(-1.4 * 3.6e-3 * 400 - 4.5e-4 * 20 * u)


def test_race_of_a_quadratic_screw() -> None:
    """Momentum theory, or c^2 = c_un u n + c_nn n^2; a screw astern takes at most all flow of a ship going ahead."""
    u, n = 0.7, 20.0
    T = 3.6e-3 * 400 - 1.5e-4 * 20 * u
    race = np.sqrt(u**2 + 8 * T / (np.pi * 1014 * 0.06**2))
    np.testing.assert_allclose(quadratic_flow(u, n, D_p=0.06), [u, race, 0.06], rtol=1e-12)
    flow = quadratic_flow(u, n, c_un=0.6, c_nn=38.0)
    np.testing.assert_allclose(flow, [u, np.sqrt(0.6 * u * n + 38 * n**2), 0], rtol=1e-12)
    assert quadratic_flow(u, -n, D_p=0.06)[1] == 0
    assert quadratic_flow(-u, -n, D_p=0.06)[1] == pytest.approx(-u)


# the same screw as a line: K_T = 0.2931 at P/D = 0.721 and J = 0, and the slope between J = 0 and 0.3149
VARIABLE: dict[str, Any] = {"x": -3.36, "D_p": 0.216, "k_P": 0.2931 / 0.721, "k_J": 0.3189, **WAKE}


def test_race_of_a_controllable_pitch_propeller_is_momentum_theory() -> None:
    def flow(n: float, pitch: float) -> np.ndarray:
        nu_r = ca.SX(np.array([1.179, 0, 0, 0, 0, 0]))
        return np.array(ca.evalf(controllable_wash(nu_r, ca.SX(n), ca.SX(pitch), **VARIABLE))).ravel()

    u_P, race, D_p = flow(10.4, 0.721)
    assert (u_P, D_p) == (pytest.approx(0.7074), pytest.approx(0.216))
    assert race / u_P == pytest.approx(2.438, abs=0.002)
    assert flow(10.4, -0.5)[1] == 0  # drives astern, and takes all the flow


@pytest.mark.parametrize("u", [1.0, 0.0, -0.6])
def test_astern_thrust_has_a_separate_curve(u: float) -> None:
    """X = -(1 - t_P) k_astern rho n^2 D^4 K(J), J = 0.6 u / (n D), negative on a ship that still goes ahead."""
    n, J = -9.0, 0.6 * u / (-9.0 * 0.216)
    K = 0.25 + 0.30 * J + 0.05 * J**2
    X = thrust(u, n, K_T_astern=ASTERN, k_astern=0.9)[0]
    assert pytest.approx(-0.78 * 0.9 * RHO * 81 * 0.216**4 * K) == X
    assert thrust(u, n, K_T_astern=SCREW["K_T"])[0] == thrust(u, n)[0]
    assert thrust(u, 9.0, K_T_astern=ASTERN)[0] == thrust(u, 9.0)[0]
