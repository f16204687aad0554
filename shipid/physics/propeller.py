"""Propellers behind a hull: fixed pitch (MMG), controllable pitch, or thrust minus resistance about a service speed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import casadi as ca
from casadi import SX

from shipid.physics.frames import force_at, vector
from shipid.physics.grammar import POSITIVE, THRUST
from shipid.physics.hull import SPEED_FLOOR
from shipid.physics.thruster import SHAFT_FLOOR, polynomial


def drift(nu_r: SX) -> tuple[SX, SX]:
    """Speed U [m/s] and drift angle beta = atan(-v / |u|) [rad] at the origin; finite, with derivatives, at rest.

    Ahead it is the drift angle of the MMG model; astern it is measured from the stern, so that it stays small.
    """
    square = nu_r[0] ** 2 + nu_r[1] ** 2
    along = ca.if_else(square < SPEED_FLOOR**2, SPEED_FLOOR, ca.fabs(nu_r[0]))
    return ca.sqrt(square + SPEED_FLOOR**2), ca.atan2(-nu_r[1], along)


def inflow(nu_r: SX, x: SX, y: SX, w_P0: SX, C_1: SX, C_2_plus: SX, C_2_minus: SX) -> SX:
    """u_P = (1 - w_P) u [m/s], the wake w_P changing with the drift beta_P at the propeller (MMG eqs. 16, 17).

    (1 - w_P) / (1 - w_P0) = 1 + (1 - exp(-C_1 |beta_P|)) (C_2 - 1), beta_P = beta - x r / U.
    """
    U, beta = drift(nu_r)
    beta_P = beta - x * nu_r[5] / U
    C_2 = ca.if_else(beta_P >= 0, C_2_plus, C_2_minus)
    change = 1 + (1 - ca.exp(-C_1 * ca.fabs(beta_P))) * (C_2 - 1)
    return (1 - w_P0) * change * (nu_r[0] - nu_r[5] * y)


def thrust_coefficient(u_P: SX, n: SX, D_p: SX, K_T: Mapping[str, SX], J_min: SX, J_max: SX) -> SX:
    """K_T(J) with J = u_P / (|n| D_p), its sign reversed for n < 0, limited to J_min..J_max."""
    sense = ca.if_else(n >= 0, 1, -1)
    J = sense * u_P / (ca.fmax(ca.fabs(n), SHAFT_FLOOR) * D_p)
    return polynomial(K_T, ca.fmin(ca.fmax(J, J_min), J_max), SX(1, 1), SX(1))


def propeller(
    nu_r: SX,
    n: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    z: Annotated[SX | float, "m"] = 0.0,
    D_p: Annotated[SX, "m", POSITIVE],
    K_T: Annotated[Mapping[str, SX], THRUST],
    J_min: Annotated[SX | float, "-"] = -1.0,
    J_max: Annotated[SX | float, "-"] = 1.5,
    k_astern: Annotated[SX | float, "-"] = 1.0,
    t_P: Annotated[SX, "-"],
    w_P0: Annotated[SX, "-"],
    C_1: Annotated[SX, "-"],
    C_2_plus: Annotated[SX, "-"],
    C_2_minus: Annotated[SX, "-"],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wrench (6) of a propeller behind a hull: X = (1 - t_P) rho n^2 D_p^4 K_T(J) (MMG eqs. 12-17).

    n [rev/s]; wake w_P0 on a straight course, C_1, C_2 its change with drift (C_2_plus where beta_P > 0). Astern the
    polynomial is used with the sign of J reversed, times k_astern. Yasukawa and Yoshimura (2015).
    """
    u_P = inflow(nu_r, SX(x), SX(y), w_P0, C_1, C_2_plus, C_2_minus)
    sense = ca.if_else(n >= 0, 1, -k_astern)
    thrust = sense * rho * n**2 * D_p**2 * D_p**2 * thrust_coefficient(u_P, n, D_p, K_T, SX(J_min), SX(J_max))
    return force_at(SX(x), SX(y), SX(z), (1 - t_P) * thrust, SX(1, 1))


def wash(
    nu_r: SX,
    n: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    D_p: Annotated[SX, "m", POSITIVE],
    K_T: Annotated[Mapping[str, SX], THRUST],
    J_min: Annotated[SX | float, "-"] = -1.0,
    J_max: Annotated[SX | float, "-"] = 1.5,
    w_P0: Annotated[SX, "-"],
    C_1: Annotated[SX, "-"],
    C_2_plus: Annotated[SX, "-"],
    C_2_minus: Annotated[SX, "-"],
) -> SX:
    """Propeller slipstream at a rudder behind it, (3): inflow u_P [m/s], slipstream speed far behind [m/s], D_p [m].

    Momentum theory: u_race^2 = u_P^2 + 8 K_T n^2 D_p^2 / pi, that is u_P^2 (1 + 8 K_T / (pi J^2)); no race astern.
    """
    u_P = inflow(nu_r, SX(x), SX(y), w_P0, C_1, C_2_plus, C_2_minus)
    K = thrust_coefficient(u_P, n, D_p, K_T, SX(J_min), SX(J_max))
    race = ca.sqrt(ca.fmax(u_P**2 + 8 / ca.pi * K * (n * D_p) ** 2, 0) + SPEED_FLOOR**2)
    return ca.vertcat(u_P, ca.if_else(n >= 0, race, u_P), D_p)


def bilinear_thrust(u_P: SX, n: SX, pitch: SX, D_p: SX, k_P: SX, k_J: SX, k_astern: SX | float) -> SX:
    """Open-water thrust over rho D_p^4 [s^-2] of a controllable-pitch propeller: k_P p n|n| - k_J |n| u_P / D_p.

    u_P [m/s], n [rev/s], pitch p = P/D [-]. Where shaft and pitch drive astern together, k_astern times the first part.
    """
    driven = pitch * n * ca.fabs(n)
    return k_P * ca.if_else(driven >= 0, 1, k_astern) * driven - k_J * ca.fabs(n) * u_P / D_p


def controllable_pitch(
    nu_r: SX,
    n: SX,
    pitch: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    z: Annotated[SX | float, "m"] = 0.0,
    D_p: Annotated[SX, "m", POSITIVE],
    k_P: Annotated[SX, "-", POSITIVE],
    k_J: Annotated[SX, "-", POSITIVE],
    k_astern: Annotated[SX | float, "-"] = 1.0,
    t_P: Annotated[SX | float, "-"] = 0.0,
    w_P0: Annotated[SX | float, "-"] = 0.0,
    C_1: Annotated[SX | float, "-"] = 0.0,
    C_2_plus: Annotated[SX | float, "-"] = 1.0,
    C_2_minus: Annotated[SX | float, "-"] = 1.0,
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wrench (6) of a controllable-pitch propeller: X = (1 - t_P) rho D_p^4 (k_P p n|n| - k_J |n| u_P / D_p).

    n [rev/s]; pitch p [-], the ratio P/D at 0.7 of the radius, negative to drive astern. That is K_T = k_P p - k_J J:
    no thrust at p = 0 in still water, zero thrust at J = k_P p / k_J, and drag of a rotating propeller of zero pitch.
    The inflow u_P is that behind a hull (see `inflow`). The form is the bilinear thrust T_nn n|n| - T_nV |n| V_a of
    Blanke (1981), in Fossen (2021), with T_nn proportional to the pitch: a linear approximation of the K_T curves of
    the Wageningen B-series over pitch, not a fit. It overestimates the thrust at the largest pitches.
    """
    u_P = inflow(nu_r, SX(x), SX(y), SX(w_P0), SX(C_1), SX(C_2_plus), SX(C_2_minus))
    thrust = rho * D_p**2 * D_p**2 * bilinear_thrust(u_P, n, pitch, D_p, k_P, k_J, k_astern)
    return force_at(SX(x), SX(y), SX(z), (1 - t_P) * thrust, SX(1, 1))


def controllable_wash(
    nu_r: SX,
    n: SX,
    pitch: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    D_p: Annotated[SX, "m", POSITIVE],
    k_P: Annotated[SX, "-", POSITIVE],
    k_J: Annotated[SX, "-", POSITIVE],
    k_astern: Annotated[SX | float, "-"] = 1.0,
    w_P0: Annotated[SX | float, "-"] = 0.0,
    C_1: Annotated[SX | float, "-"] = 0.0,
    C_2_plus: Annotated[SX | float, "-"] = 1.0,
    C_2_minus: Annotated[SX | float, "-"] = 1.0,
) -> SX:
    """Slipstream of a controllable-pitch propeller, (3): inflow [m/s], slipstream speed far behind [m/s], D_p [m].

    u_race^2 = u_P^2 + 8 T / (pi rho D_p^2) by momentum theory; no race where the propeller drives astern.
    """
    u_P = inflow(nu_r, SX(x), SX(y), SX(w_P0), SX(C_1), SX(C_2_plus), SX(C_2_minus))
    lift = 8 / ca.pi * D_p**2 * bilinear_thrust(u_P, n, pitch, D_p, k_P, k_J, k_astern)
    race = ca.sqrt(ca.fmax(u_P**2 + lift, 0) + SPEED_FLOOR**2)
    return ca.vertcat(u_P, ca.if_else(pitch * n >= 0, race, u_P), D_p)


def service_speed(
    nu_r: SX,
    n: SX,
    *,
    n_0: Annotated[SX, "s^-1", POSITIVE],
    X_u: Annotated[SX, "prime"],
    X_uu: Annotated[SX | float, "prime"] = 0.0,
    X_uuu: Annotated[SX | float, "prime"] = 0.0,
    L_pp: Annotated[SX, "m", POSITIVE],
    U_0: Annotated[SX, "m s^-1", POSITIVE],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wrench (6) of thrust minus resistance about the steady speed U_0 n / n_0 for a shaft speed n [rev/s].

    X = 1/2 rho L^2 U_0^2 (X_u d + X_uu d^2 + X_uuu d^3), d = u / U_0 - n / n_0 (Abkowitz 1964). This expansion about
    steady motion is valid only near that speed.
    """
    d = nu_r[0] / U_0 - n / n_0
    return vector(rho / 2 * L_pp**2 * U_0**2 * d * (X_u + d * (X_uu + d * X_uuu)), 0, 0, 0, 0, 0)
