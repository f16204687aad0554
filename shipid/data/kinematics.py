"""Velocities that a log lacks: a kinematic extended Kalman filter with a Rauch-Tung-Striebel smoother.

State x = (north, east, psi, u, v, r). Between samples u, v and r change by white accelerations:

    north' = u cos(psi) - v sin(psi),  east' = u sin(psi) + v cos(psi),  psi' = r,  (u, v, r)' = w.

Sources: Rauch, Tung, Striebel, AIAA Journal 3 (1965) 1445; Bar-Shalom, Li, Kirubarajan, Estimation with Applications
to Tracking and Navigation (2001), ch. 6 (white-noise acceleration) and 5.4 (consistency). Written here and not taken
from a library because steps are irregular, some columns may be measured and others not, and the smoother must use
the transition at the filtered state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipid.data.dataset import Array

STATES = ("north", "east", "psi", "u", "v", "r")
SETTLING = 10.0  # s, over which the first guess of u, v and r is taken


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one sample, by name of `STATES`, and of the change of u, v and of r in one second."""

    sample: dict[str, float]
    acceleration: float
    angular_acceleration: float


@dataclass(frozen=True)
class Smoothed:
    """States (N, 6), their covariances (N, 6, 6), and the mean squared normalised innovation: 1 if the noise fits."""

    states: Array
    covariances: Array
    consistency: float

    def state(self, name: str) -> Array:
        """One state, (N,)."""
        return self.states[:, STATES.index(name)]

    def deviation(self, name: str) -> Array:
        """Standard deviation of one state, (N,)."""
        index = STATES.index(name)
        return np.sqrt(self.covariances[:, index, index])


def smooth(t: Array, measured: dict[str, Array], noise: Noise) -> Smoothed:
    """Estimate the states at every instant from all samples before and after it.

    Parameters
    ----------
    t : instants (N,) [s], rising, N >= 2.
    measured : north, east, psi (unwrapped) and those of u, v, r that are logged: name -> (N,), SI units.
    noise : how far samples err and how fast velocities change.
    """
    names = [name for name in STATES if name in measured]
    seen = [STATES.index(name) for name in names]
    samples = np.stack([measured[name] for name in names], axis=1)
    errors = np.diag([noise.sample[name] ** 2 for name in names])
    x, cov = _start(t, measured, noise)
    squares = 0.0
    means, covs, transitions, ahead_means, ahead_covs = [], [], [], [], []
    for index, sample in enumerate(samples):
        if index:
            dt = t[index] - t[index - 1]
            transition, change = _transition(x, dt), _change(x, dt, noise)
            x, cov = _move(x, dt), transition @ cov @ transition.T + change
            transitions.append(transition)
            ahead_means.append(x)
            ahead_covs.append(cov)
        innovation, spread = sample - x[seen], cov[np.ix_(seen, seen)] + errors
        gain = np.linalg.solve(spread, cov[seen]).T
        squares += float(innovation @ np.linalg.solve(spread, innovation)) if index else 0.0
        x = x + gain @ innovation
        kept = np.eye(6)
        kept[:, seen] -= gain
        cov = kept @ cov @ kept.T + gain @ errors @ gain.T  # Joseph's form stays symmetric
        means.append(x)
        covs.append(cov)
    for index in range(len(t) - 2, -1, -1):
        back = np.linalg.solve(ahead_covs[index], transitions[index] @ covs[index]).T
        means[index] = means[index] + back @ (means[index + 1] - ahead_means[index])
        covs[index] = covs[index] + back @ (covs[index + 1] - ahead_covs[index]) @ back.T
    return Smoothed(np.stack(means), np.stack(covs), squares / max(1, (len(t) - 1) * len(seen)))


def _start(t: Array, measured: dict[str, Array], noise: Noise) -> tuple[Array, Array]:
    """First state and covariance: the first sample, and velocities from straight lines through the first seconds."""
    until = max(2, int(np.searchsorted(t, t[0] + SETTLING, side="right")))
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
    deviations = np.array([noise.sample[name] if name in measured else wide[name] for name in STATES])
    # twice as wide: the first update uses the first sample again
    return np.array([first[name] for name in STATES]), np.diag((2.0 * deviations) ** 2)


def _move(x: Array, dt: float) -> Array:
    """State after dt [s] at constant u, v, r; the heading of the way is that of its middle."""
    psi = x[2] + x[5] * dt / 2
    c, s = np.cos(psi), np.sin(psi)
    return x + dt * np.array([x[3] * c - x[4] * s, x[3] * s + x[4] * c, x[5], 0.0, 0.0, 0.0])


def _transition(x: Array, dt: float) -> Array:
    """Jacobian of `_move`."""
    psi = x[2] + x[5] * dt / 2
    c, s = np.cos(psi), np.sin(psi)
    result = np.eye(6)
    result[0, 2], result[1, 2] = -dt * (x[3] * s + x[4] * c), dt * (x[3] * c - x[4] * s)
    result[:2, 3], result[:2, 4] = (dt * c, dt * s), (-dt * s, dt * c)
    result[:2, 5] = dt / 2 * result[:2, 2]
    result[2, 5] = dt
    return result


def _change(x: Array, dt: float, noise: Noise) -> Array:
    """Covariance that white accelerations of u, v, r add in dt [s]."""
    psi = x[2] + x[5] * dt / 2
    c, s = np.cos(psi), np.sin(psi)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    power = np.diag([noise.acceleration**2, noise.acceleration**2, noise.angular_acceleration**2])
    cross = dt**2 / 2 * turn @ power
    return np.block([[dt**3 / 3 * turn @ power @ turn.T, cross], [cross.T, dt * power]])
