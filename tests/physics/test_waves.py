"""Loads of one wave component: written out as complex numbers, at the encounter of the moving ship."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from shipid.physics.frames import current_velocity
from shipid.physics.waves import drift_wrench, first_order, passage_rates
from tests.drawn import seeds

COUNT = 7  # harmonics 0 ... 6
OMEGA, CHI, EPSILON = 1.2, 2.3, 0.8
K = OMEGA**2 / 9.81
EVEN = np.array([True, False, True, False, True, False])
MIRROR = np.where(EVEN, 1, -1)
RNG = np.random.default_rng(8)
COEFFICIENTS = RNG.normal(size=(6, COUNT)) + 1j * RNG.normal(size=(6, COUNT))
DRIFT = RNG.normal(size=(3, COUNT))


def function() -> ca.Function:
    eta, state, chi = ca.SX.sym("eta", 6), ca.SX.sym("state", 3), ca.SX.sym("chi")
    real, imag = (ca.DM(part.ravel()) for part in (COEFFICIENTS.real, COEFFICIENTS.imag))
    wrench = first_order(eta, state, OMEGA, K, ca.cos(chi), ca.sin(chi), EPSILON, real, imag)
    return ca.Function("wrench", [eta, state, chi], [wrench])


FIRST_ORDER = function()


def force(t: float, north: float = 0.0, east: float = 0.0, psi: float = 0.0, chi: float = CHI) -> np.ndarray:
    return np.array(FIRST_ORDER([north, east, 0.1, 0.02, 0.01, psi], [t, 0, 0], chi)).ravel()


def transfer(beta: float) -> np.ndarray:
    """F (6) of the series: cosines for X, Z, M, sines for Y, K, N."""
    m = np.arange(COUNT)
    return np.where(EVEN, COEFFICIENTS @ np.cos(m * beta), COEFFICIENTS @ np.sin(m * beta))


@pytest.mark.parametrize("seed", seeds(1, 3))
def test_the_water_goes_where_the_current_sets(seed: int) -> None:
    """Whatever the heading and the motion of the ship."""
    rng = np.random.default_rng(seed)
    eta, nu = (ca.SX(rng.uniform(-0.5, 3.0, 6) * [1, 1, 1, 0.1, 0.1, 1]) for _ in range(2))
    nu_c, _ = current_velocity(eta, nu, ca.SX(0.8), ca.SX(2.2))
    rates = np.array(ca.evalf(passage_rates(eta, nu, nu - nu_c))).ravel()
    np.testing.assert_allclose(rates, [1, 0.8 * np.cos(2.2), 0.8 * np.sin(2.2)])


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_force_is_the_real_part_of_the_transfer_function(seed: int) -> None:
    """Re F(omega, chi - psi) exp(i(omega t - k(N cos chi + E sin chi) + epsilon)), wherever and whenever."""
    t, north, east, psi = np.random.default_rng(seed).uniform([0, -300, -300, -7], [500, 300, 300, 7])
    phase = OMEGA * t - K * (north * np.cos(CHI) + east * np.sin(CHI)) + EPSILON
    expected = (transfer(CHI - psi) * np.exp(1j * phase)).real
    np.testing.assert_allclose(force(t, north, east, psi), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("beta_deg", [0, 60, 90, 180])
def test_a_moving_ship_meets_the_waves_at_the_frequency_of_encounter(beta_deg: int) -> None:
    """omega_e = omega - k U cos(beta): after one period of encounter the force is the same, at no time before."""
    speed, psi, beta = 3.0, 0.4, np.radians(beta_deg)
    met = OMEGA - K * speed * np.cos(beta)

    def load_at(t: float) -> np.ndarray:
        return force(t, speed * t * np.cos(psi), speed * t * np.sin(psi), psi, psi + beta)

    period = 2 * np.pi / met
    np.testing.assert_allclose(load_at(2.0 + period), load_at(2.0), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(load_at(2.0 + period / 2), -load_at(2.0), rtol=1e-9, atol=1e-9)


def test_drift_is_a_series_in_the_relative_heading() -> None:
    eta, chi = ca.SX.sym("eta", 6), ca.SX.sym("chi")
    wrench = drift_wrench(eta, ca.cos(chi), ca.sin(chi), ca.DM(DRIFT.ravel()))
    compiled = ca.Function("drift", [eta, chi], [ca.densify(wrench)])
    m = np.arange(COUNT)
    for psi in (-2.0, 0.0, 1.3):
        beta = CHI - psi
        X, Y, N = DRIFT[0] @ np.cos(m * beta), DRIFT[1] @ np.sin(m * beta), DRIFT[2] @ np.sin(m * beta)
        forces = np.array(compiled([5, 6, 0.1, 0.02, 0.01, psi], CHI)).ravel()
        np.testing.assert_allclose(forces, [X, Y, 0, 0, 0, N], atol=1e-12)
        mirrored = np.array(compiled([5, -6, 0.1, -0.02, 0.01, -psi], -CHI)).ravel()
        np.testing.assert_allclose(mirrored, MIRROR * forces, atol=1e-12)


def test_waves_travel_with_the_water() -> None:
    """A ship that a current has carried along with the water meets the same wave as one that stayed in still water."""
    carried = np.array(FIRST_ORDER([30.0, -8.0, 0.1, 0.02, 0.01, 0.3], [9.0, 25.0, -12.0], CHI)).ravel()
    np.testing.assert_allclose(carried, force(9.0, 5.0, 4.0, 0.3), rtol=1e-12)
