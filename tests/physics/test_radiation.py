"""Radiation memory: states against the convolution that they stand for, passivity, and the tables behind the fits."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics.radiation import heave_pitch, heave_pitch_rates, roll, roll_rates
from shipid.vessel.load import load_vessel
from tests.drawn import seeds
from tests.simulation.linear import linear

HULLS = ("gunnerus-28.9-6dof", "gunnerus-33.9-6dof")
AXIS = {"heave": 2, "roll": 3, "pitch": 4}
#: BEM data base of the 28.9 m hull, about its centre of gravity: rad/s -> B33, B44, B55 [SI], A33
TABLED = {
    0.9: (5.39e5, 4.9e4, 8.92e6, 9.22e5),
    1.1: (6.17e5, 1.5e5, 1.56e7, 7.54e5),
    1.3: (6.26e5, 3.5e5, 2.06e7, 6.32e5),
    1.5: (5.79e5, 6.0e5, 2.33e7, 5.62e5),
    1.8: (4.80e5, 7.5e5, 2.27e7, 5.31e5),
    2.2: (3.70e5, 9.7e5, 1.97e7, 5.31e5),
}


def blocks(name: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """[radiation.heave_pitch] and [radiation.roll] without their words."""
    radiation = load_vessel(name).document["radiation"]
    modes = [
        {key: value for key, value in radiation[kind].items() if key != "source"} for kind in ("heave_pitch", "roll")
    ]
    return modes[0], modes[1]


def driven(name: str, velocity: np.ndarray, step: float) -> np.ndarray:
    """Z, K, M (num_steps + 1, 3) of the terms, their states driven by (w, p, q) given at half steps, RK4."""
    upright, rolling = blocks(name)
    count, extra = 4 * len(upright["sigma"]), 2 * len(rolling["sigma"])
    state, nu = ca.SX.sym("state", count + extra), ca.SX.sym("nu", 6)
    heave_pitch_states, other = state[:count], state[count:]
    modes = {key: upright[key] for key in ("sigma", "omega")}
    rates = ca.vertcat(
        heave_pitch_rates(ca.SX(6, 1), nu, heave_pitch_states, **modes),
        roll_rates(nu, other, sigma=rolling["sigma"], omega=rolling["omega"]),
    )
    kernels = {key: value for key, value in upright.items() if key.startswith("K")}
    wrench = heave_pitch(heave_pitch_states, **kernels) + roll(
        other, K44_cos=rolling["K44_cos"], K44_sin=rolling["K44_sin"]
    )
    f, force = ca.Function("f", [state, nu], [rates]), ca.Function("force", [state], [ca.densify(wrench)])
    A = np.array(ca.Function("A", [state, nu], [ca.jacobian(rates, state)])(0, 0))
    B = np.array(ca.Function("B", [state, nu], [ca.jacobian(rates, nu)])(0, 0))[:, [2, 3, 4]]
    C = np.array(ca.Function("C", [state], [ca.jacobian(force(state), state)])(0))[[2, 3, 4]]
    assert np.abs(np.array(f(0, 0))).max() == np.abs(np.array(force(0))).max() == 0
    x, history = np.zeros(count + extra), []
    for i in range(0, len(velocity), 2):
        history.append(C @ x)
        if i + 2 < len(velocity):
            first, middle, last = velocity[i : i + 3] @ B.T
            k1 = A @ x + first
            k2 = A @ (x + step / 2 * k1) + middle
            k3 = A @ (x + step / 2 * k2) + middle
            k4 = A @ (x + step * k3) + last
            x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.array(history)


def band_limited(time: np.ndarray, seed: int) -> np.ndarray:
    """Random (w, p, q) of 0.2 to 3 rad/s, sizes of a ship in waves."""
    rng = np.random.default_rng(seed)
    omega, phase = rng.uniform(0.2, 3.0, (2, 3, 20))
    size = np.array([0.1, 0.02, 0.02])[:, None] * rng.normal(size=(3, 20))
    return np.asarray((size * np.sin(omega * time[:, None, None] + 2 * np.pi * phase)).sum(axis=-1))


def kernel(name: str, time: np.ndarray) -> np.ndarray:
    """K(t) (n, 3, 3) for heave, roll and pitch, by its formula."""
    upright, rolling = blocks(name)
    K = np.zeros((len(time), 3, 3))
    for block, entries in ((upright, {"33": (0, 0), "35": (0, 2), "55": (2, 2)}), (rolling, {"44": (1, 1)})):
        for entry, (i, j) in entries.items():
            columns = zip(block["sigma"], block["omega"], block[f"K{entry}_cos"], block[f"K{entry}_sin"], strict=True)
            for sigma, omega, a, b in columns:
                K[:, i, j] += np.exp(-sigma * time) * (a * np.cos(omega * time) + b * np.sin(omega * time))
            K[:, j, i] = K[:, i, j]
    return K


@pytest.mark.parametrize("name", HULLS)
def test_states_are_the_convolution(name: str) -> None:
    """-int K(t - s) v(s) ds, by the trapezoid on the same half steps."""
    step, count = 0.05, 400
    time = step / 2 * np.arange(2 * count + 1)
    velocity, K = band_limited(time, 1), kernel(name, time)
    forces = driven(name, velocity, step)
    for row in (100, 250, 400):
        last = 2 * row
        integrand = np.einsum("tij,tj->ti", K[last::-1], velocity[: last + 1])
        expected = -np.trapezoid(integrand, dx=step / 2, axis=0)
        assert (np.abs(forces[row] - expected) <= 2e-3 * np.abs(forces).max(axis=0)).all()


@pytest.mark.parametrize("name", HULLS)
@pytest.mark.parametrize("seed", seeds(1, 4))
def test_radiation_gives_no_energy(name: str, seed: int) -> None:
    """From calm water, the work done on the ship is never positive, whatever her motion (0.05 % of all for the fit)."""
    step = 0.05
    time = step / 2 * np.arange(2 * 2000 + 1)
    velocity = band_limited(time, seed)
    power = driven(name, velocity, step) * velocity[::2]
    work = np.cumsum(power.sum(axis=1)) * step
    assert work[-1] < 0
    assert work.max() <= 5e-4 * np.abs(work[-1])


def test_damping_and_added_mass_of_the_data_base() -> None:
    """Fits within 5 % of the tables they were made of (4 % of the peak of B), where the sea has its energy."""
    ship, omega = linear(load_vessel(HULLS[0])), np.array(list(TABLED))
    K, A = ship.memory(omega).real, ship.added_mass(omega)
    expected = np.array(list(TABLED.values()))
    for column, axis in enumerate((AXIS["heave"], AXIS["roll"], AXIS["pitch"])):
        peak = expected[:, column].max()
        np.testing.assert_allclose(K[:, axis, axis], expected[:, column], rtol=0, atol=0.04 * peak)
    np.testing.assert_allclose(A[:, 2, 2], expected[:, 3], rtol=0.05)
