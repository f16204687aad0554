"""A propeller behind a hull against numbers worked by hand; limits of wake and thrust."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics.propeller import controllable_pitch, controllable_wash, propeller, service_speed, wash
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import check_vessel, load_vessel

# KVLCC2 at 7 m: Yasukawa and Yoshimura (2015), tables 1 and 3
WAKE = {"w_P0": 0.40, "C_1": 2.0, "C_2_plus": 1.6, "C_2_minus": 1.1}
SCREW: dict[str, Any] = {"x": -3.36, "D_p": 0.216, "K_T": {"1": 0.2931, "J": -0.2753, "JJ": -0.1385}, **WAKE}
RHO = 1000.0


def thrust(u: float, n: float, **other: Any) -> np.ndarray:
    nu_r = ca.SX(np.array([u, 0, 0, 0, 0, 0]))
    return np.array(ca.evalf(propeller(nu_r, ca.SX(n), t_P=0.220, rho=RHO, **{**SCREW, **other}))).ravel()


def washed(nu_r: list[float], n: float, **other: Any) -> np.ndarray:
    return np.array(ca.evalf(wash(ca.SX(np.array(nu_r)), ca.SX(n), **{**SCREW, **other}))).ravel()


def test_thrust_by_hand() -> None:
    """J = 0.6 x 1.179 / (10.4 x 0.216) = 0.3149, K_T = 0.1927: 0.78 x 1000 x 10.4^2 x 0.216^4 x K_T = 35.4 N."""
    assert thrust(1.179, 10.4)[0] == pytest.approx(35.39, abs=0.02)


def test_astern_is_the_ahead_thrust_turned_when_standing() -> None:
    assert thrust(0.0, -10.0)[0] == pytest.approx(-thrust(0.0, 10.0)[0])
    assert thrust(0.0, -10.0, k_astern=0.7)[0] == pytest.approx(-0.7 * thrust(0.0, 10.0)[0])


def test_beyond_the_polynomial_the_coefficient_stays() -> None:
    fast = [thrust(u, 5.0, J_max=1.0)[0] for u in (3.0, 6.0)]
    assert fast[0] == fast[1] < 0


def test_a_screw_off_the_middle_turns_the_ship() -> None:
    there = thrust(1.0, 10.0, y=0.5)
    assert there[5] == pytest.approx(-0.5 * there[0])


def test_race_is_momentum_theory() -> None:
    """u_race = u_P sqrt(1 + 8 K_T / (pi J^2)); at J = 0.3149 and K_T = 0.1927: 2.438 u_P."""
    u_P, race, D_p = washed([1.179, 0, 0, 0, 0, 0], 10.4)
    assert (u_P, D_p) == (pytest.approx(0.7074), pytest.approx(0.216))
    assert race / u_P == pytest.approx(2.438, abs=0.002)


def test_no_race_astern() -> None:
    u_P, race, _ = washed([1.0, 0, 0, 0, 0, 0], -10.0)
    assert u_P == race


@pytest.mark.parametrize(("v", "C_2"), [(-0.3, 1.6), (0.3, 1.1)])
def test_wake_with_drift(v: float, C_2: float) -> None:
    """Drift to port (v < 0: beta > 0) takes C_2_plus; the inflow rises by 1 + (1 - exp(-2 beta)) (C_2 - 1)."""
    beta = np.arctan(0.3)
    rise = 1 + (1 - np.exp(-2 * beta)) * (C_2 - 1)
    assert washed([1.0, v, 0, 0, 0, 0], 10.0)[0] == pytest.approx(0.6 * rise, rel=1e-3)


def test_turning_is_drift_at_the_screw() -> None:
    """beta_P = beta - x r / U: r = U tan-like 0.1 at x = -3.36 m is a drift of 0.336."""
    still, turning = (washed([1.0, 0, 0, 0, 0, r], 10.0)[0] for r in (0.0, 0.1))
    assert turning / still == pytest.approx(1 + (1 - np.exp(-2 * 0.336)) * 0.6, rel=1e-3)


def test_a_ship_at_the_speed_of_her_shaft_has_no_thrust_to_spare() -> None:
    numbers = {"n_0": 1.0, "X_u": -0.002, "X_uu": -0.001, "X_uuu": -0.002, "L_pp": 160.0, "U_0": 7.7, "rho": 1025.0}

    def surge(u: float, n: float) -> float:
        return float(ca.evalf(service_speed(ca.SX(np.array([u, 0, 0, 0, 0, 0])), ca.SX(n), **numbers))[0])

    assert surge(7.7, 1.0) == 0.0
    assert surge(3.85, 0.5) == 0.0
    assert surge(7.0, 1.0) > 0 > surge(8.0, 1.0)
    by_hand = 1025 / 2 * 160**2 * 7.7**2 * (0.002 * 0.1 - 0.001 * 0.01 + 0.002 * 0.001)
    assert surge(0.9 * 7.7, 1.0) == pytest.approx(by_hand)


# the same screw as a line: K_T = 0.2931 at P/D = 0.721 and J = 0, and the slope between J = 0 and 0.3149
VARIABLE: dict[str, Any] = {"x": -3.36, "D_p": 0.216, "k_P": 0.2931 / 0.721, "k_J": 0.3189, **WAKE}


def variable_thrust(u: float, n: float, pitch: float, **other: Any) -> float:
    nu_r = ca.SX(np.array([u, 0, 0, 0, 0, 0]))
    given = {"t_P": 0.220, "rho": RHO, **VARIABLE, **other}
    return float(ca.evalf(controllable_pitch(nu_r, ca.SX(n), ca.SX(pitch), **given))[0])


def test_at_the_pitch_of_a_fixed_screw_the_thrust_is_that_screws() -> None:
    assert variable_thrust(0.0, 10.4, 0.721) == pytest.approx(thrust(0.0, 10.4)[0], rel=1e-3)
    assert variable_thrust(1.179, 10.4, 0.721) == pytest.approx(35.39, rel=1e-3)


def test_no_thrust_without_pitch_and_astern_thrust_by_pitch_or_shaft() -> None:
    assert variable_thrust(0.0, 10.0, 0.0) == 0.0
    ahead = variable_thrust(0.0, 10.0, 0.7)
    assert ahead > 0
    assert variable_thrust(0.0, 10.0, -0.7) == pytest.approx(-ahead)
    assert variable_thrust(0.0, -10.0, 0.7) == pytest.approx(-ahead)
    assert variable_thrust(0.0, 10.0, -0.7, k_astern=0.6) == pytest.approx(-0.6 * ahead)
    assert variable_thrust(0.0, -10.0, -0.7, k_astern=0.6) == pytest.approx(ahead)


def test_a_disc_of_zero_pitch_drags_and_a_stopped_one_does_nothing() -> None:
    assert variable_thrust(1.0, 10.0, 0.0) < 0 < variable_thrust(-1.0, 10.0, 0.0)
    assert variable_thrust(1.0, 0.0, 0.7) == 0.0


def test_thrust_grows_with_pitch_and_vanishes_at_its_advance() -> None:
    """J = k_P p / k_J: u = n D_p J / (1 - w_P0)."""
    forces = [variable_thrust(1.0, 10.0, pitch) for pitch in (-0.8, -0.2, 0.0, 0.2, 0.5, 0.8)]
    assert (np.diff(forces) > 0).all()
    J = VARIABLE["k_P"] * 0.6 / VARIABLE["k_J"]
    assert variable_thrust(10.0 * 0.216 * J / 0.6, 10.0, 0.6) == pytest.approx(0.0, abs=1e-9)


def test_race_of_a_controllable_pitch_propeller_is_momentum_theory() -> None:
    def flow(n: float, pitch: float) -> np.ndarray:
        nu_r = ca.SX(np.array([1.179, 0, 0, 0, 0, 0]))
        return np.array(ca.evalf(controllable_wash(nu_r, ca.SX(n), ca.SX(pitch), **VARIABLE))).ravel()

    u_P, race, D_p = flow(10.4, 0.721)
    assert (u_P, D_p) == (pytest.approx(0.7074), pytest.approx(0.216))
    assert race / u_P == pytest.approx(2.438, abs=0.002)
    assert flow(10.4, -0.5)[1] == flow(10.4, -0.5)[0]


def test_a_ship_with_one_takes_pitch_as_an_order_and_her_rudder_its_wash() -> None:
    """KVLCC2 with the line for her screw: surge as the fixed screw gives it, less of it at a smaller pitch."""
    fixed = load_vessel("kvlcc2-l7")
    block = {"kind": "controllable_pitch", **VARIABLE, "t_P": 0.220}
    ship = check_vessel({**fixed.document, "thruster": {**fixed.document["thruster"], "propeller": block}}, "CP")
    assert dynamics(ship).commands == ("propeller.n", "propeller.pitch", "rudder.delta")

    def rates(vessel: Any, *orders: float) -> np.ndarray:
        model = dynamics(vessel)
        held = dict(zip(model.commands, orders, strict=True))
        memory = [held[name] for name in model.memory]
        state = [0.0, 0.0, 0.0, 1.179, 0.0, 0.0]
        return np.array(model.rates(state, memory, list(orders), [], list(vessel.parameters.values()), np.zeros(3)))

    both = rates(fixed, 10.4, 0.2).ravel(), rates(ship, 10.4, 0.721, 0.2).ravel()
    np.testing.assert_allclose(both[1], both[0], rtol=2e-3, atol=1e-9)
    assert rates(ship, 10.4, 0.4, 0.0)[3] < rates(ship, 10.4, 0.721, 0.0)[3]
    assert 0 < rates(ship, 10.4, 0.4, 0.2)[5] < rates(ship, 10.4, 0.721, 0.2)[5]
