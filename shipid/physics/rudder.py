"""Rudders: behind a propeller (MMG), or as derivatives about a service speed. delta > 0 turns the ship to starboard."""

from __future__ import annotations

from typing import Annotated

import casadi as ca
from casadi import SX

from shipid.physics.frames import vector
from shipid.physics.grammar import POSITIVE, RUDDER_DEVIATIONS
from shipid.physics.hull import SPEED_FLOOR, about_service_speed
from shipid.physics.propeller import drift


def rudder(
    nu_r: SX,
    delta: SX,
    wash: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    z: Annotated[SX | float, "m"] = 0.0,
    A_R: Annotated[SX, "m^2", POSITIVE],
    H_R: Annotated[SX, "m", POSITIVE],
    f_alpha: Annotated[SX, "-", POSITIVE],
    epsilon: Annotated[SX, "-", POSITIVE],
    kappa: Annotated[SX, "-"],
    gamma_R_plus: Annotated[SX, "-"],
    gamma_R_minus: Annotated[SX, "-"],
    ell_R: Annotated[SX, "m"],
    t_R: Annotated[SX, "-"],
    a_H: Annotated[SX, "-"],
    x_H: Annotated[SX, "m"],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wrench (6) of a rudder in the slipstream `wash` of a propeller (Yasukawa and Yoshimura 2015, eqs. 18-27).

    wash : (u_P, u_race, D_p), inflow and slipstream speed [m/s] and propeller diameter [m]. delta [rad].

    F_N = 1/2 rho A_R f_alpha U_R^2 sin(alpha_R); X = -(1 - t_R) F_N sin(delta), Y = -(1 + a_H) F_N cos(delta),
    N = -(x + a_H x_H) F_N cos(delta). Along: u_R = epsilon sqrt(eta (u_P + kappa (u_race - u_P))^2 + (1 - eta) u_P^2),
    eta = D_p / H_R at most 1. Across: v_R = gamma_R (U beta - ell_R r), gamma_R_plus if U beta - ell_R r > 0.
    """
    u_P, u_race, D_p = wash[0], wash[1], wash[2]
    U, beta = drift(nu_r)
    across = U * beta - ell_R * nu_r[5]
    v_R = ca.if_else(across >= 0, gamma_R_plus, gamma_R_minus) * across
    eta = ca.fmin(D_p / H_R, 1)
    within = u_P + kappa * (u_race - u_P)
    size = ca.sqrt(eta * within**2 + (1 - eta) * u_P**2 + SPEED_FLOOR**2)
    u_R = epsilon * ca.if_else(within >= 0, size, -size)
    U_R = ca.sqrt(u_R**2 + v_R**2)
    F_N = rho / 2 * A_R * f_alpha * U_R * (u_R * ca.sin(delta) - v_R * ca.cos(delta))
    X, Y = -(1 - t_R) * F_N * ca.sin(delta), -(1 + a_H) * F_N * ca.cos(delta)
    return vector(X, Y, 0, -z * Y, z * X, -(x + a_H * x_H) * F_N * ca.cos(delta) - y * X)


def rudder_derivatives(
    nu_r: SX,
    delta: SX,
    *,
    L_pp: Annotated[SX, "m", POSITIVE],
    U_0: Annotated[SX, "m s^-1", POSITIVE],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
    **values: Annotated[SX, RUDDER_DEVIATIONS],
) -> SX:
    """Wrench (6) of rudder derivatives (Y_delta, X_deltadelta, Y_vvdelta) about the service speed (Abkowitz 1964).

    Prime system of the service speed U_0, as in `hull.abkowitz`; delta [rad] is not scaled.
    """
    return about_service_speed(nu_r, delta, values, L_pp, U_0, rho)
