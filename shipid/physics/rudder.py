"""Rudders: behind a propeller (MMG and others), or as derivatives. delta > 0 turns the ship to starboard."""

from __future__ import annotations

from collections.abc import Mapping
from functools import wraps
from typing import Annotated, Any

from shipid.physics import symbols as ca
from shipid.physics.frames import SX, column_vector, differs_from_default
from shipid.physics.grammar import (
    CROSS_FLOWS,
    POSITIVE,
    RUDDER_DEVIATIONS,
    RUDDER_FLOWS,
    cross_flow_monomial,
    rudder_flow,
)
from shipid.physics.hull import SPEED_FLOOR, TIGHTEST, about_service_speed, sum_monomials
from shipid.physics.propeller import drift_angle, signed_root


def rudder_wrench(
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
    f_angle: Annotated[SX | float, "-"] = 0.0,
    f_side: Annotated[SX | float, "-"] = 0.0,
    f_angle_side: Annotated[SX | float, "-"] = 0.0,
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wrench (6) of a rudder in the slipstream `wash` of a propeller (Yasukawa and Yoshimura 2015, eqs. 18-27).

    wash : (u_P, u_race, D_p), inflow and slipstream speed [m/s] and propeller diameter [m]. delta [rad].

    F_N = 1/2 rho A_R f_alpha U_R^2 sin(alpha_R); X = -(1 - t_R) F_N sin(delta), Y = -(1 + a_H) F_N cos(delta),
    N = -(x + a_H x_H) F_N cos(delta). Along: u_R = epsilon sqrt(eta (u_P + kappa (u_race - u_P))^2 + (1 - eta) u_P^2),
    eta = D_p / H_R at most 1. Across: v_R = gamma_R (U beta - ell_R r), gamma_R_plus if U beta - ell_R r > 0.

    With s = sin(alpha_R), F_N is multiplied by 1 + f_angle |s| + f_side sign(s) + f_angle_side s: f_angle is the loss
    (or gain) with the angle, f_side and f_angle_side make starboard helm the stronger, as behind one turning screw.
    """
    F_N = normal_force(
        nu_r,
        delta,
        wash,
        A_R=A_R,
        H_R=H_R,
        f_alpha=f_alpha,
        epsilon=epsilon,
        kappa=kappa,
        gamma_R_plus=gamma_R_plus,
        gamma_R_minus=gamma_R_minus,
        ell_R=ell_R,
        f_angle=f_angle,
        f_side=f_side,
        f_angle_side=f_angle_side,
        rho=rho,
    )
    return _forces(F_N, delta, x, y, z, t_R, a_H, x_H)


def normal_force(
    nu_r: SX,
    delta: SX,
    wash: SX,
    *,
    A_R: Annotated[SX, "m^2", POSITIVE],
    H_R: Annotated[SX, "m", POSITIVE],
    f_alpha: Annotated[SX, "-", POSITIVE],
    epsilon: Annotated[SX, "-", POSITIVE],
    kappa: Annotated[SX, "-"],
    gamma_R_plus: Annotated[SX, "-"],
    gamma_R_minus: Annotated[SX, "-"],
    ell_R: Annotated[SX, "m"],
    f_angle: Annotated[SX | float, "-"] = 0.0,
    f_side: Annotated[SX | float, "-"] = 0.0,
    f_angle_side: Annotated[SX | float, "-"] = 0.0,
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Normal force F_N [N] on the blade of `rudder_wrench`, > 0 turns the ship to starboard."""
    u_P, u_race, D_p = wash[0], wash[1], wash[2]
    U, beta = drift_angle(nu_r)
    across = U * beta - ell_R * nu_r[5]
    v_R = ca.if_else(across >= 0, gamma_R_plus, gamma_R_minus) * across
    eta = ca.fmin(D_p / H_R, 1)
    within = u_P + kappa * (u_race - u_P)
    size = ca.sqrt(eta * within**2 + (1 - eta) * u_P**2 + SPEED_FLOOR**2)
    u_R = epsilon * ca.if_else(within >= 0, size, -size)
    U_R = ca.sqrt(u_R**2 + v_R**2)
    F_N = rho / 2 * A_R * f_alpha * U_R * (u_R * ca.sin(delta) - v_R * ca.cos(delta))
    if (
        differs_from_default(f_angle, 0.0)
        or differs_from_default(f_side, 0.0)
        or differs_from_default(f_angle_side, 0.0)
    ):
        s = (u_R * ca.sin(delta) - v_R * ca.cos(delta)) / U_R
        F_N *= 1 + f_angle * ca.fabs(s) + f_side * ca.sign(s) + f_angle_side * s
    return F_N


def _forces(F_N: SX, delta: SX, x: SX, y: SX | float, z: SX | float, t_R: SX, a_H: SX, x_H: SX) -> SX:
    """Wrench (6) of a normal force F_N on rudder and hull (Yasukawa and Yoshimura 2015, eq. 18)."""
    X, Y = -(1 - t_R) * F_N * ca.sin(delta), -(1 + a_H) * F_N * ca.cos(delta)
    return column_vector(X, Y, 0, -z * Y, z * X, -(x + a_H * x_H) * F_N * ca.cos(delta) - y * X)


def rudder_polynomial(
    nu_r: SX,
    delta: SX,
    wash: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    z: Annotated[SX | float, "m"] = 0.0,
    A_R: Annotated[SX, "m^2", POSITIVE],
    f_alpha: Annotated[SX, "-", POSITIVE],
    epsilon: Annotated[SX, "-", POSITIVE],
    k_x: Annotated[SX, "-"],
    v_R: Annotated[Mapping[str, SX], CROSS_FLOWS],
    t_R: Annotated[SX, "-"],
    a_H: Annotated[SX, "-"],
    x_H: Annotated[SX, "m"],
    L_pp: Annotated[SX, "m", POSITIVE],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wrench (6) of a rudder whose flow across is a polynomial (Son and Nomoto 1982).

    wash : (u_P, u_race, D_p) as of `rudder_wrench`. Along: u_R = epsilon sqrt(u_P^2 + k_x (u_race^2 - u_P^2)), signed.
    Across: v_R = U x the sum of value x monomial in v' = v / U and r' = r L_pp / U, signed as in `rudder_wrench`
    (-gamma_R is the value of "v"). U is at least |r| L_pp / TIGHTEST, see `mmg_wrench`. F_N and the forces of it are
    those of `rudder_wrench`.
    """
    F_N = polynomial_normal_force(
        nu_r, delta, wash, A_R=A_R, f_alpha=f_alpha, epsilon=epsilon, k_x=k_x, v_R=v_R, L_pp=L_pp, rho=rho
    )
    return _forces(F_N, delta, x, y, z, t_R, a_H, x_H)


def polynomial_normal_force(
    nu_r: SX,
    delta: SX,
    wash: SX,
    *,
    A_R: Annotated[SX, "m^2", POSITIVE],
    f_alpha: Annotated[SX, "-", POSITIVE],
    epsilon: Annotated[SX, "-", POSITIVE],
    k_x: Annotated[SX, "-"],
    v_R: Annotated[Mapping[str, SX], CROSS_FLOWS],
    L_pp: Annotated[SX, "m", POSITIVE],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Normal force F_N [N] on the blade of `rudder_polynomial`, > 0 turns the ship to starboard."""
    u_P, u_race = wash[0], wash[1]
    turning = nu_r[5] * L_pp / TIGHTEST
    U = ca.sqrt(ca.fmax(ca.fmax(nu_r[0] ** 2 + nu_r[1] ** 2, turning**2), SPEED_FLOOR**2))
    prime = {"v": nu_r[1] / U, "r": nu_r[5] * L_pp / U}
    across = U * sum((value * cross_flow_monomial(name).value(prime) for name, value in v_R.items()), ca.SX(1, 1))
    still = u_P * ca.fabs(u_P)
    race = u_race * ca.fabs(u_race) - SPEED_FLOOR**2  # the slipstream comes with a floor of its speed
    u_R = epsilon * signed_root(still + k_x * (race - still))
    U_R = ca.sqrt(ca.fmax(u_R**2 + across**2, SPEED_FLOOR**2))
    return rho / 2 * A_R * f_alpha * U_R * (u_R * ca.sin(delta) - across * ca.cos(delta))


def rudder_coefficients(
    nu_r: SX,
    delta: SX,
    wash: SX,
    *,
    kappa: Annotated[SX | float, "-"] = 1.0,
    L_pp: Annotated[SX, "m", POSITIVE],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
    **values: Annotated[SX, RUDDER_FLOWS],
) -> SX:
    """Wrench (6) of named rudder coefficients on the square of the flow at the rudder: 1/2 rho L^2 value x monomial.

    Moments with L_pp^3. Factors c = u_P + kappa (u_race - u_P) [m/s] from the `wash` of the screw ahead, twice in each
    name (`Y_|c|cdelta` turns with the flow), delta [rad], and beta = atan(-v / |u|), the drift angle. A coefficient
    even in delta (`Y_cc|delta|`) makes one side stronger. van Berlekom and Goddard (1972); Skjetne et al. (2004).
    """
    _, beta = drift_angle(nu_r)
    factors = {"c": wash[0] + kappa * (wash[1] - wash[0]), "beta": beta, "delta": delta}
    return sum_monomials(values, rudder_flow, factors, rho / 2 * L_pp**2, L_pp)


@wraps(rudder_coefficients, assigned=("__annotations__",))
def coefficients_normal_force(nu_r: SX, delta: SX, wash: SX, **numbers: Any) -> SX:
    """Force [N] of `rudder_coefficients` across the blade, > 0 turns the ship to starboard.

    The coefficients are of the ship with its rudder: the share that the rudder induces on the hull is in it.
    """
    force = rudder_coefficients(nu_r, delta, wash, **numbers)
    return -ca.sin(delta) * force[0] - ca.cos(delta) * force[1]


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
