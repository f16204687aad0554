"""Wave loads on the moving ship, written for one wave component: first-order forces and mean drift.

A component has frequency omega [rad/s], direction of travel chi [rad, towards, clockwise from north], amplitude and
phase; its loads are Fourier series in the relative heading beta = chi - psi. Surge, heave and pitch are even in beta,
sway, roll and yaw odd, as for any ship with port/starboard symmetry.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from shipid.physics import symbols as ca
from shipid.physics.frames import SX, rotation_matrix
from shipid.physics.grammar import AXES

EVEN = (0, 2, 4)
FORCES = tuple(f"{axis}_{part}" for axis in AXES for part in ("real", "imag"))
DRIFT = ("X_drift", "Y_drift", "N_drift")
TABLES = {"waves.first_order": ("omega", "beta_deg", *FORCES), "waves.drift": ("omega", "beta_deg", *DRIFT)}


def passage_states(block: Mapping[str, Any]) -> tuple[str, ...]:  # noqa: ARG001
    """Names of the wave states: time [s], and the displacement of the water by the current, north and east [m]."""
    return ("t", "north", "east")


def passage_rates(eta: SX, nu: SX, nu_r: SX) -> SX:
    """d(state)/dt of the wave states: 1, then the current velocity north and east [m/s]."""
    return ca.vertcat(ca.SX(1), (rotation_matrix(eta[3], eta[4], eta[5]) @ (nu - nu_r)[:3])[:2])


def first_order_widths(*, table: Mapping[str, Any], harmonics: int) -> dict[str, int]:  # noqa: ARG001
    """Widths of the component arguments of `first_order`; `real`, `imag`: six series of complex coefficients."""
    series = 6 * (harmonics + 1)
    return {"omega": 1, "k": 1, "c_chi": 1, "s_chi": 1, "epsilon": 1, "real": series, "imag": series}


def drift_widths(*, table: Mapping[str, Any], harmonics: int) -> dict[str, int]:  # noqa: ARG001
    """Widths of the component arguments of `drift_wrench`; `drift_wrench`: three series of real coefficients."""
    return {"c_chi": 1, "s_chi": 1, "drift": 3 * (harmonics + 1)}


def multiples(c: SX, s: SX, count: int) -> tuple[list[SX], list[SX]]:
    """cos(m beta), sin(m beta) for m = 0 ... count from cos(beta), sin(beta), without a further trigonometric call."""
    cosines, sines = [ca.SX(1), c], [ca.SX(1, 1), s]
    for _ in range(2, count + 1):
        cosines.append(2 * c * cosines[-1] - cosines[-2])
        sines.append(2 * c * sines[-1] - sines[-2])
    return cosines[: count + 1], sines[: count + 1]


def relative_heading(psi: SX, c_chi: SX, s_chi: SX) -> tuple[SX, SX]:
    """cos(beta) and sin(beta) of beta = chi - psi."""
    c, s = ca.cos(psi), ca.sin(psi)
    return c_chi * c + s_chi * s, s_chi * c - c_chi * s


def first_order(eta: SX, state: SX, omega: SX, k: SX, c_chi: SX, s_chi: SX, epsilon: SX, real: SX, imag: SX) -> SX:
    """Wrench (6) of one component: Re F(omega, beta) a exp(i(omega t - k(N cos chi + E sin chi) + epsilon)).

    The phase is that at the ship's position relative to the water; the transfer function is at the wave frequency omega
    [rad/s]. k [rad/m]; c_chi, s_chi: cosine and sine of the direction of travel; epsilon [rad]: phase at the origin at
    t = 0; real, imag (6 series, one after the other): Fourier coefficients of a F [N, N m].
    """
    phase = omega * state[0] - k * (c_chi * (eta[0] - state[1]) + s_chi * (eta[1] - state[2])) + epsilon
    c, s = ca.cos(phase), ca.sin(phase)
    count = real.numel() // 6
    cosines, sines = multiples(*relative_heading(eta[5], c_chi, s_chi), count - 1)
    wrench = []
    for axis in range(6):
        basis = cosines if axis in EVEN else sines
        entries = slice(axis * count, (axis + 1) * count)
        wrench.append(c * _series(real[entries], basis) - s * _series(imag[entries], basis))
    return ca.vertcat(*wrench)


def _series(coefficients: SX, basis: list[SX]) -> SX:
    return sum((coefficients[m] * entry for m, entry in enumerate(basis)), ca.SX(1, 1))


def drift_wrench(eta: SX, c_chi: SX, s_chi: SX, drift: SX) -> SX:
    """Wrench (6) of the mean drift force of one direction of waves: surge, sway and yaw.

    drift (3 series, one after the other): Fourier coefficients of the sum of a^2 D(omega, beta) [N, N m].
    """
    count = drift.numel() // 3
    cosines, sines = multiples(*relative_heading(eta[5], c_chi, s_chi), count - 1)
    X, Y, N = (_series(drift[i * count : (i + 1) * count], basis) for i, basis in enumerate((cosines, sines, sines)))
    return ca.vertcat(X, Y, ca.SX(3, 1), N)
