"""Velocities that a log lacks: a kinematic extended Kalman filter with a Rauch-Tung-Striebel smoother.

State x = (north, east, psi, u, v, r). Between samples u, v and r change by white accelerations:

    north' = u cos(psi) - v sin(psi),  east' = u sin(psi) + v cos(psi),  psi' = r,  (u, v, r)' = w.

Rauch, Tung, Striebel, AIAA Journal 3 (1965) 1445; Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking
and Navigation (2001), ch. 6 (white-noise acceleration) and 5.4 (consistency). Written here and not taken from a library
because steps are irregular and some columns may be measured and others not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipid.data.dataset import Array

FILTER_STATES = ("north", "east", "psi", "u", "v", "r")
START_SECONDS = 10.0  # s, over which the first guess of u, v and r is taken


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one sample, by name of `FILTER_STATES`, and of the change of u, v and r in a second."""

    sample: dict[str, float]
    acceleration: float
    angular_acceleration: float


@dataclass(frozen=True)
class SmoothedMotion:
    """States (N, 6), their covariances (N, 6, 6), and the mean squared normalised innovation: 1 if the noise fits."""

    states: Array
    covariances: Array
    consistency: float

    def state(self, name: str) -> Array:
        """One state, (N,)."""
        return self.states[:, FILTER_STATES.index(name)]

    def deviation(self, name: str) -> Array:
        """Standard deviation of one state, (N,)."""
        index = FILTER_STATES.index(name)
        return np.sqrt(self.covariances[:, index, index])


def smooth_motion(t: Array, measured: dict[str, Array], noise: Noise) -> SmoothedMotion:
    """Estimate the states at every instant from all samples before and after it.

    t : instants (N,) [s], rising, N >= 2.
    measured : north, east, psi (unwrapped) and those of u, v, r that are logged: name -> (N,), SI units.
    noise : how far samples err and how fast velocities change.
    """
    names = [name for name in FILTER_STATES if name in measured]
    seen = [FILTER_STATES.index(name) for name in names]
    samples = np.stack([measured[name] for name in names], axis=1).tolist()
    errors = [noise.sample[name] ** 2 for name in names]
    steps, squares = np.diff(t).tolist(), 0.0
    x, cov = _start_of_filter(t, measured, noise)
    means, ahead_means = np.empty((2, len(t), 6))  # a row ahead of the first sample is not used
    covs, ahead_covs, transitions = np.empty((3, len(t), 6, 6))
    for index, sample in enumerate(samples):
        if index:
            transition, change = _transition(x, steps[index - 1]), _process_noise(x, steps[index - 1], noise)
            x, cov = _move_state(x, steps[index - 1]), transition @ cov @ transition.T + change
            transitions[index], ahead_means[index], ahead_covs[index] = transition, x, cov
        for state, value, error in zip(seen, sample, errors, strict=True):  # one by one, as they err independently
            row, innovation = cov[state], value - float(x[state])
            spread = float(row[state]) + error
            squares += innovation**2 / spread if index else 0.0
            gain = row / spread
            x, cov = x + innovation * gain, cov - gain[:, None] * row
        means[index], covs[index] = x, cov
    back = np.linalg.solve(ahead_covs[1:], transitions[1:] @ covs[:-1]).transpose(0, 2, 1)
    for index in range(len(t) - 2, -1, -1):
        means[index] += back[index] @ (means[index + 1] - ahead_means[index + 1])
        covs[index] += back[index] @ (covs[index + 1] - ahead_covs[index + 1]) @ back[index].T
    return SmoothedMotion(means, covs, squares / max(1, (len(t) - 1) * len(seen)))


def _start_of_filter(t: Array, measured: dict[str, Array], noise: Noise) -> tuple[Array, Array]:
    """First state and covariance: the first sample, and velocities from straight lines through the first seconds."""
    until = max(2, int(np.searchsorted(t, t[0] + START_SECONDS, side="right")))
    slope = {name: np.polyfit(t[:until] - t[0], measured[name][:until], 1)[0] for name in ("north", "east", "psi")}
    psi = float(np.mean(measured["psi"][:until]))
    c, s = np.cos(psi), np.sin(psi)
    first = {
        "u": c * slope["north"] + s * slope["east"],
        "v": c * slope["east"] - s * slope["north"],
        "r": slope["psi"],
    }
    first |= {name: float(values[0]) for name, values in measured.items()}
    speed = max(1.0, float(np.hypot(first["u"], first["v"])))
    wide = {"u": speed, "v": speed, "r": max(0.02, abs(float(slope["psi"])))}
    deviations = np.array([noise.sample[name] if name in measured else wide[name] for name in FILTER_STATES])
    # twice as wide: the first update uses the first sample again
    return np.array([first[name] for name in FILTER_STATES]), np.diag((2.0 * deviations) ** 2)


def _move_state(x: Array, dt: float) -> Array:
    """State after dt [s] at constant u, v, r; the heading of the way is that of its middle."""
    north, east, psi, u, v, r = x.tolist()
    c, s = math.cos(psi + r * dt / 2), math.sin(psi + r * dt / 2)
    return np.array([north + dt * (u * c - v * s), east + dt * (u * s + v * c), psi + dt * r, u, v, r])


def _transition(x: Array, dt: float) -> Array:
    """Jacobian of `_move_state`."""
    _, _, psi, u, v, r = x.tolist()
    c, s = dt * math.cos(psi + r * dt / 2), dt * math.sin(psi + r * dt / 2)
    by_north, by_east = -u * s - v * c, u * c - v * s  # of the heading
    return np.array(
        [
            [1.0, 0.0, by_north, c, -s, dt / 2 * by_north],
            [0.0, 1.0, by_east, s, c, dt / 2 * by_east],
            [0.0, 0.0, 1.0, 0.0, 0.0, dt],
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        ]
    )


def _process_noise(x: Array, dt: float, noise: Noise) -> Array:
    """Covariance that white accelerations of u, v, r add in dt [s]; those of u and v are alike in all directions."""
    psi = float(x[2] + x[5] * dt / 2)
    linear, angular = noise.acceleration**2, noise.angular_acceleration**2
    place, heading, turn = dt**3 / 3 * linear, dt**3 / 3 * angular, dt**2 / 2 * angular
    c, s = dt**2 / 2 * linear * math.cos(psi), dt**2 / 2 * linear * math.sin(psi)
    return np.array(
        [
            [place, 0.0, 0.0, c, -s, 0.0],
            [0.0, place, 0.0, s, c, 0.0],
            [0.0, 0.0, heading, 0.0, 0.0, turn],
            [c, s, 0.0, dt * linear, 0.0, 0.0],
            [-s, c, 0.0, 0.0, dt * linear, 0.0],
            [0.0, 0.0, turn, 0.0, 0.0, dt * angular],
        ]
    )
