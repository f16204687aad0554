"""Thrusters and their actuators: azimuth and tunnel units, thrusters ordered by force; lags, rates and limits."""

from __future__ import annotations

from collections.abc import Mapping
from functools import wraps
from typing import Annotated, Any

from shipid.physics import symbols as ca
from shipid.physics.frames import SX, differs_from_default, wrench_of_force
from shipid.physics.grammar import POSITIVE, THRUST, thrust_monomial

SHAFT_FLOOR = 1e-3  # rev/s: J = u / (n D) stays finite at n = 0
UNLIMITED = 1e9  # default limit of a command: beyond all of them


def thrust_polynomial_value(coefficients: Mapping[str, SX], J: SX, J_y: SX, width: SX) -> SX:
    """Sum of named monomials in J, y = J_y and t = tanh(|J_y| / width)."""
    symbols = {"J": J, "y": J_y, "t": ca.tanh(ca.fabs(J_y) / width)}
    return sum((value * thrust_monomial(name).value(symbols) for name, value in coefficients.items()), ca.SX(1, 1))


def azimuth_wrench(
    nu_r: SX,
    n: SX,
    alpha: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX, "m"],
    z: Annotated[SX | float, "m"] = 0.0,
    D_p: Annotated[SX, "m", POSITIVE],
    k_T: Annotated[SX, "-"],
    k_astern: Annotated[SX, "-"],
    K_x: Annotated[Mapping[str, SX], THRUST],
    K_y: Annotated[Mapping[str, SX], THRUST],
    J_t: Annotated[SX, "-", POSITIVE],
    J_min: Annotated[SX, "-"],
    J_max: Annotated[SX, "-"],
    Jy_max: Annotated[SX, "-"],
    k_over: Annotated[SX, "-"],
    k_over2: Annotated[SX, "-"],
    k_under: Annotated[SX, "-"],
    k_side: Annotated[SX, "-"],
    k_sideJ: Annotated[SX, "-"],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wrench (6) of an azimuth thruster: F = R(alpha) k_T rho n^2 D_p^4 [K_x(J, J_y), K_y(J, J_y)].

    n [rev/s], alpha [rad, > 0 turns the thrust to starboard]; J, J_y from the water velocity in the axes of the unit,
    J = u'/(|n| D_p), its sign reversed for n < 0. The polynomials are used inside J_min..J_max and |J_y| < Jy_max and
    continued beyond (k_over, k_over2 over-running; k_under; k_side, k_sideJ side drag). Astern thrust is k_astern times
    ahead thrust. At n = 0 the force has a step where k_over2 is not 0: k_T rho D_p^2 k_over2 u'^2 of over-running drag
    from above, nothing from below.
    """
    along, across = nu_r[0] - nu_r[5] * y, nu_r[1] + nu_r[5] * x
    c, s = ca.cos(alpha), ca.sin(alpha)
    ahead = n >= 0
    speed = ca.fmax(ca.fabs(n), SHAFT_FLOOR)
    sense = ca.if_else(ahead, 1, -1)
    J = sense * (c * along + s * across) / (speed * D_p)
    J_y = (c * across - s * along) / (speed * D_p)
    J_c = ca.fmin(ca.fmax(J, J_min), J_max)
    Jy_c = ca.fmin(ca.fmax(J_y, -Jy_max), Jy_max)
    over, under, side = J - ca.fmin(J, J_max), J - ca.fmax(J, J_min), J_y - Jy_c
    K_x_ = thrust_polynomial_value(K_x, J_c, Jy_c, J_t) - over * (k_over + k_over2 * over) - k_under * under
    K_y_ = thrust_polynomial_value(K_y, J_c, Jy_c, J_t) - (k_side + k_sideJ * ca.fmax(J_c, 0)) * side
    scale = k_T * rho * speed**2 * D_p**2 * D_p**2
    F_x = scale * sense * ca.if_else(ahead, 1, k_astern) * K_x_
    F_y = scale * K_y_
    return wrench_of_force(x, y, z, c * F_x - s * F_y, s * F_x + c * F_y)


@wraps(azimuth_wrench, assigned=("__annotations__",))
def azimuth_thrust(nu_r: SX, n: SX, alpha: SX, **numbers: Any) -> SX:
    """Thrust [N] of `azimuth_wrench` along the axis of the unit."""
    force = azimuth_wrench(nu_r, n, alpha, **numbers)
    return ca.cos(alpha) * force[0] + ca.sin(alpha) * force[1]


def tunnel_wrench(
    n: SX,
    *,
    x: Annotated[SX, "m"],
    z: Annotated[SX | float, "m"] = 0.0,
    F_1: Annotated[SX, "N s"],
    F_2: Annotated[SX, "N s^2"],
    F_3: Annotated[SX, "N s^3"],
) -> SX:
    """Wrench (6) of a transverse tunnel thruster at zero ship speed: Y = F_1 n + F_2 n|n| + F_3 n^3, n [rev/s]."""
    return wrench_of_force(
        ca.SX(x), ca.SX(1, 1), ca.SX(z), ca.SX(1, 1), tunnel_side_force(n, F_1=F_1, F_2=F_2, F_3=F_3)
    )


def tunnel_side_force(
    n: SX,
    *,
    F_1: Annotated[SX, "N s"],
    F_2: Annotated[SX, "N s^2"],
    F_3: Annotated[SX, "N s^3"],
) -> SX:
    """Force [N] of `tunnel_wrench`, > 0 to starboard."""
    return n * (F_1 + ca.fabs(n) * (F_2 + ca.fabs(n) * F_3))


def force_wrench(
    force: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    z: Annotated[SX | float, "m"] = 0.0,
    k_T: Annotated[SX | float, "-"] = 1.0,
    k_astern: Annotated[SX | float, "-"] = 1.0,
) -> SX:
    """Wrench (6) of a thruster whose order is a force [N], > 0 ahead: k_T times it, astern k_T k_astern times it.

    Limits of the order, another one astern, are those of its actuator. The thrust does not depend on the speed.
    """
    return swivel_force_wrench(force, ca.SX(1, 1), x=x, y=y, z=z, k_T=k_T, k_astern=k_astern)


def swivel_force_wrench(
    force: SX,
    alpha: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    z: Annotated[SX | float, "m"] = 0.0,
    k_T: Annotated[SX | float, "-"] = 1.0,
    k_astern: Annotated[SX | float, "-"] = 1.0,
) -> SX:
    """Wrench (6) of an outboard or pod ordered by force [N], turned by alpha [rad, > 0 turns the thrust to starboard].

    See `force_wrench`.
    """
    thrust = swivel_thrust(force, k_T=k_T, k_astern=k_astern)
    return wrench_of_force(ca.SX(x), ca.SX(y), ca.SX(z), ca.cos(alpha) * thrust, ca.sin(alpha) * thrust)


def swivel_thrust(
    force: SX, *, k_T: Annotated[SX | float, "-"] = 1.0, k_astern: Annotated[SX | float, "-"] = 1.0
) -> SX:
    """Thrust [N] of `force_wrench` and `swivel_force_wrench` along their axis."""
    thrust = k_T * force
    return ca.if_else(force >= 0, thrust, k_astern * thrust) if differs_from_default(k_astern, 1.0) else thrust


def bounded_output(
    state: SX,
    *,
    low: Annotated[SX | float, "of the command"] = -UNLIMITED,
    high: Annotated[SX | float, "of the command"] = UNLIMITED,
) -> SX:
    """The actual value of a command: the actuator state, within the limits of the device.

    A limit that no document gives stays out of the equations.
    """
    if differs_from_default(low, -UNLIMITED):
        state = ca.fmax(state, low)
    return ca.fmin(state, high) if differs_from_default(high, UNLIMITED) else state


def first_order_advance(
    command: SX,
    state: SX,
    dt: SX,
    *,
    T: Annotated[SX, "s", POSITIVE],
    rate: Annotated[SX | float, "1/s of the command", POSITIVE] = UNLIMITED,
    low: Annotated[SX | float, "of the command"] = -UNLIMITED,
    high: Annotated[SX | float, "of the command"] = UNLIMITED,
) -> SX:
    """First-order lag over dt [s], solved exactly: a+ = c + (a - c) exp(-dt / T), the change limited to rate x dt.

    T [s], rate in the command's unit per second. Exact for a held command while the limit does not bind. The order c
    and the state a are kept within low and high.
    """
    reached = bounded_output(state, low=low, high=high)
    change = (bounded_output(command, low=low, high=high) - reached) * (1 - ca.exp(-dt / T))
    if not differs_from_default(rate, UNLIMITED):
        return reached + change
    return reached + ca.fmin(ca.fmax(change, -rate * dt), rate * dt)


def rate_limit_advance(
    command: SX,
    state: SX,
    dt: SX,
    *,
    rate: Annotated[SX, "1/s of the command", POSITIVE],
    low: Annotated[SX | float, "of the command"] = -UNLIMITED,
    high: Annotated[SX | float, "of the command"] = UNLIMITED,
) -> SX:
    """An actuator without lag over dt [s]: it goes to its order at `rate` and stays there.

    rate in the command's unit per second; the order and the state are kept within low and high.
    """
    reached = bounded_output(state, low=low, high=high)
    change = bounded_output(command, low=low, high=high) - reached
    return reached + ca.fmin(ca.fmax(change, -rate * dt), rate * dt)
