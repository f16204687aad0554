"""Wave radiation with memory (Cummins 1962): retardation kernels as sums of damped cosines and sines.

K(t) = sum over k of exp(-sigma_k t) (a_k cos omega_k t + b_k sin omega_k t). Each velocity drives a pair of states
(c, s) for each mode k: c' = -sigma c - omega s + velocity, s' = omega c - sigma s; the force is -(a c + b s). Added
mass at infinite frequency belongs in [added_mass]. Surge, sway and yaw have none: a manoeuvring model includes theirs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from shipid.physics import symbols as ca
from shipid.physics.frames import SX, column_vector, heave_rate
from shipid.physics.grammar import POSITIVE


def mode_rates(velocity: SX, state: SX, sigma: Sequence[SX], omega: Sequence[SX]) -> list[SX]:
    """d(state)/dt of the states (c, s) of all modes, driven by one velocity; sigma [1/s], omega [rad/s] by mode."""
    rates = []
    for k, (decay, frequency) in enumerate(zip(sigma, omega, strict=True)):
        c, s = state[2 * k], state[2 * k + 1]
        rates += [velocity - decay * c - frequency * s, frequency * c - decay * s]
    return rates


def kernel_force(state: SX, a: Sequence[SX], b: Sequence[SX]) -> SX:
    """Convolution of the kernel a cos + b sin with the velocity that drives the states (c, s) of each mode."""
    pairs = zip(a, b, strict=True)
    return sum((a_k * state[2 * k] + b_k * state[2 * k + 1] for k, (a_k, b_k) in enumerate(pairs)), ca.SX(1, 1))


def _names(block: Mapping[str, Any], drivers: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"{driver}{k}{part}" for driver in drivers for k in range(len(block["sigma"])) for part in "cs")


def heave_pitch_states(block: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the states: two (c, s) for each mode, first driven by the heave rate, then by the pitch rate."""
    return _names(block, ("w", "q"))


def heave_pitch(
    state: SX,
    *,
    K33_cos: Annotated[list[SX], "kg s^-2"],
    K33_sin: Annotated[list[SX], "kg s^-2"],
    K35_cos: Annotated[list[SX], "kg m s^-2"],
    K35_sin: Annotated[list[SX], "kg m s^-2"],
    K55_cos: Annotated[list[SX], "kg m^2 s^-2"],
    K55_sin: Annotated[list[SX], "kg m^2 s^-2"],
) -> SX:
    """Wrench (6) of heave and pitch radiation; states (4 x modes) [m, rad] are driven by heave rate and pitch rate.

    K_ij : kernel of force i by velocity j (K_35 = K_53): a (`cos`) and b (`sin`) of each mode.
    """
    middle = state.numel() // 2
    heave, pitch = state[:middle], state[middle:]
    Z = kernel_force(heave, K33_cos, K33_sin) + kernel_force(pitch, K35_cos, K35_sin)
    M = kernel_force(heave, K35_cos, K35_sin) + kernel_force(pitch, K55_cos, K55_sin)
    return column_vector(0, 0, -Z, 0, -M, 0)


def heave_pitch_rates(
    eta: SX,
    nu: SX,
    state: SX,
    *,
    sigma: Annotated[list[SX], "s^-1", POSITIVE],
    omega: Annotated[list[SX], "s^-1"],
) -> SX:
    """d(state)/dt of the heave and pitch radiation states; the heave rate is inertial: w - u theta, not w."""
    middle = state.numel() // 2
    heave = mode_rates(heave_rate(eta, nu), state[:middle], sigma, omega)
    return ca.vertcat(*heave, *mode_rates(nu[4], state[middle:], sigma, omega))


def roll_states(block: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the states: two (c, s) for each mode, driven by the roll rate."""
    return _names(block, ("p",))


def roll(
    state: SX,
    *,
    K44_cos: Annotated[list[SX], "kg m^2 s^-2"],
    K44_sin: Annotated[list[SX], "kg m^2 s^-2"],
) -> SX:
    """Wrench (6) of roll radiation; states (2 x modes) [rad] are driven by the roll rate."""
    return column_vector(0, 0, 0, -kernel_force(state, K44_cos, K44_sin), 0, 0)


def roll_rates(
    nu: SX,
    state: SX,
    *,
    sigma: Annotated[list[SX], "s^-1", POSITIVE],
    omega: Annotated[list[SX], "s^-1"],
) -> SX:
    """d(state)/dt of the roll radiation states."""
    return ca.vertcat(*mode_rates(nu[3], state, sigma, omega))
