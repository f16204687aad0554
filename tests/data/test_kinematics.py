"""The smoother finds the velocities of a known motion, and errs as much as it says."""

import numpy as np
import pytest
from scipy.stats import chi2

from shipid.data.kinematics import (
    FILTER_STATES,
    Noise,
    _move_state,
    _process_noise,
    _start_of_filter,
    _transition,
    smooth_motion,
)
from tests.logs.conftest import turning

T = np.arange(0.0, 120.0, 1.0)


def noise(position: float, heading: float, acceleration: float, angular: float) -> Noise:
    errors = {"north": position, "east": position, "psi": heading, "u": 0.05, "v": 0.05, "r": 1e-3}
    return Noise(errors, acceleration, angular)


@pytest.mark.parametrize("step", [0.2, 1.0, 2.0])
def test_constant_turn_without_noise(step: float) -> None:
    t = np.arange(0.0, 120.0, step)
    motion = turning(t)
    logged = {name: motion[name].to_numpy() for name in ("north", "east", "psi")}
    smoothed = smooth_motion(t, logged, noise(0.01, 1e-4, 0.02, 1e-3))
    inside = slice(3, -3)
    np.testing.assert_allclose(smoothed.state("u")[inside], 4.0, atol=0.01)
    np.testing.assert_allclose(smoothed.state("v")[inside], -0.5, atol=0.01)
    np.testing.assert_allclose(smoothed.state("r")[inside], 0.05, atol=1e-4)


def random_motion(random: np.random.Generator, t: np.ndarray, given: Noise) -> np.ndarray:
    """The model of the filter in fine steps: u, v, r walk at random; (N, 6)."""
    fine, states = 20, np.zeros((len(t), 6))
    x = np.array([0.0, 0.0, 1.0, 5.0, 0.3, 0.02])
    states[0] = x
    for index in range(1, len(t)):
        dt = (t[index] - t[index - 1]) / fine
        for _ in range(fine):
            c, s = np.cos(x[2]), np.sin(x[2])
            walk = [given.acceleration, given.acceleration, given.angular_acceleration] * random.standard_normal(3)
            rates = np.array([x[3] * c - x[4] * s, x[3] * s + x[4] * c, x[5], 0.0, 0.0, 0.0])
            x = x + dt * rates + np.append(np.zeros(3), walk * np.sqrt(dt))
        states[index] = x
    return states


@pytest.mark.slow
@pytest.mark.parametrize("logged", [("north", "east", "psi"), ("north", "east", "psi", "r"), FILTER_STATES])
def test_errors_are_as_large_as_it_says(logged: tuple[str, ...]) -> None:
    """NEES of (u, v, r) is chi-square (Bar-Shalom et al. 2001, 5.4.2): its mean over 120 motions lies in the band."""
    random, given = np.random.default_rng(3), noise(0.5, np.radians(0.5), 0.05, np.radians(0.1))
    steps = np.tile([0.5, 1.0, 1.5], 14)  # an irregular clock
    t = np.append(0.0, np.cumsum(steps))
    nees, consistency = [], []
    for _ in range(120):
        truth = random_motion(random, t, given)
        noisy = {
            name: truth[:, FILTER_STATES.index(name)] + given.sample[name] * random.standard_normal(len(t))
            for name in logged
        }
        smoothed = smooth_motion(t, noisy, given)
        error = (smoothed.states - truth)[20, 3:]
        nees.append(error @ np.linalg.solve(smoothed.covariances[20][3:, 3:], error))
        consistency.append(smoothed.consistency)
    low, high = chi2.ppf([0.001, 0.999], 3 * 120) / 120
    assert low < np.mean(nees) < high
    assert np.mean(consistency) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("dt", [0.1, 1.0, 5.0])
def test_the_transition_is_the_slope_of_the_motion(dt: float) -> None:
    """By central differences, of ships that drift and turn fast."""
    rng = np.random.default_rng(5)
    for x in rng.uniform([-50, -50, -4, -2, -2, -0.2], [50, 50, 4, 9, 2, 0.2], (5, 6)):
        slopes = [(_move_state(x + 1e-5 * e, dt) - _move_state(x - 1e-5 * e, dt)) / 2e-5 for e in np.eye(6)]
        np.testing.assert_allclose(_transition(x, dt), np.transpose(slopes), atol=1e-6)


@pytest.mark.parametrize("dt", [0.5, 5.0])
def test_white_accelerations_move_a_ship_that_turns_as_on_the_heading_of_the_middle(dt: float) -> None:
    rng, given = np.random.default_rng(6), noise(0.5, 0.01, 0.05, 0.003)
    densities = np.diag([0.05, 0.05, 0.003]) ** 2
    for x in rng.uniform([-50, -50, -4, -2, -2, -0.2], [50, 50, 4, 9, 2, 0.2], (5, 6)):
        c, s = np.cos(x[2] + x[5] * dt / 2), np.sin(x[2] + x[5] * dt / 2)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        ways = [np.vstack([left * turn, np.eye(3)]) for left in np.linspace(0, dt, 2001)]  # what an impulse moves
        added = np.trapezoid([way @ densities @ way.T for way in ways], dx=dt / 2000, axis=0)
        np.testing.assert_allclose(_process_noise(x, dt, given), added, rtol=1e-5, atol=1e-12)


def test_wrong_noise_is_reported() -> None:
    """Samples that err three times more than declared give innovations above one."""
    random = np.random.default_rng(4)
    motion = turning(T)
    noisy = {name: motion[name].to_numpy() + 3.0 * random.standard_normal(len(T)) for name in ("north", "east")}
    noisy["psi"] = motion["psi"].to_numpy()
    assert smooth_motion(T, noisy, noise(1.0, 0.01, 0.02, 1e-3)).consistency > 2.0


def test_a_straight_way_begins_with_its_velocities() -> None:
    """Two velocities in the axes of the ship from the places alone, at any heading."""
    t, psi, u, v = np.arange(0.0, 20.0), 1.0, 3.0, 0.4
    ways = u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)
    logged = {"north": 5.0 + ways[0] * t, "east": -2.0 + ways[1] * t, "psi": np.full_like(t, psi)}
    first, _ = _start_of_filter(t, logged, noise(0.01, 1e-4, 0.02, 1e-3))
    np.testing.assert_allclose(first, [5.0, -2.0, psi, u, v, 0.0], atol=1e-9)
