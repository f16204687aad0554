"""Hull forces in calm water: named derivatives in five scalings, strip cross-flow drag, straight-ahead resistance."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any

from shipid.physics import symbols as ca
from shipid.physics.frames import SX, column_vector, differs_from_default
from shipid.physics.grammar import (
    AXES,
    BIS_DERIVATIVES,
    DERIVATIVES,
    HEEL,
    HULL_DEVIATIONS,
    MOTIONS,
    POSITIVE,
    PRIME_DERIVATIVES,
    Monomial,
    bis_scale,
    hull_derivative,
    prime_scale,
    reverses_astern,
    service_deviation,
)

SPEED_FLOOR = 0.01  # m/s: keeps 1/U finite at rest
TIGHTEST = 2.0  # r L / U: turns of ships under rudders are wider, with r L / U up to 1.2


def derivatives_wrench(nu_r: SX, eta: SX, **values: Annotated[SX, DERIVATIVES]) -> SX:
    """Wrench (6) = sum over names of value x monomial(nu_r, phi), on the force side (SNAME 1950).

    nu_r (6) [m/s, rad/s] is the velocity through the water, phi = eta[3] [rad] the angle of heel; each value has the SI
    unit that its name implies.
    """
    motions = {**dict(zip(MOTIONS, ca.vertsplit(nu_r), strict=True)), HEEL: eta[3]}
    return sum_monomials(values, hull_derivative, motions)


def sum_monomials(
    values: Mapping[str, SX],
    formula_of: Callable[[str], Monomial],
    factors: Mapping[str, SX],
    force: SX | float = 1,
    lever: SX | float = 1,
) -> SX:
    """Wrench (6) = sum over names of value x monomial, times `force` [N], moments also times `lever` [m]."""
    wrench = [ca.SX(1, 1)] * 6
    for name, value in values.items():
        formula = formula_of(name)
        axis = AXES.index(formula.axis)
        unit = force * (1 if formula.axis in "XYZ" else lever)
        wrench[axis] = wrench[axis] + unit * value * formula.value(factors)
    return ca.vertcat(*wrench)


def prime_derivatives(
    nu_r: SX,
    eta: SX,
    *,
    L_pp: Annotated[SX, "m", POSITIVE],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
    **values: Annotated[SX, PRIME_DERIVATIVES],
) -> SX:
    """Wrench (6) of derivatives in the prime system: value x 1/2 rho L^a U^(2-order) x monomial (SNAME 1950).

    L_pp [m] is the reference length, U the instantaneous speed through the water with a floor of 0.01 m/s.
    """
    U = ca.sqrt(ca.fmax(nu_r[0] ** 2 + nu_r[1] ** 2, SPEED_FLOOR**2))
    return derivatives_wrench(
        nu_r, eta, **{name: value * prime_scale(name, rho, L_pp, U) for name, value in values.items()}
    )


def bis_derivatives(
    nu_r: SX,
    eta: SX,
    *,
    nabla: Annotated[SX, "m^3", POSITIVE],
    L_pp: Annotated[SX, "m", POSITIVE],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
    g: Annotated[SX, "m s^-2", POSITIVE],
    **values: Annotated[SX, BIS_DERIVATIVES],
) -> SX:
    """Wrench (6) of derivatives in the bis system: value x rho g nabla x monomial (Norrbin 1970; Fossen 2021, app. D).

    Moments with L_pp; motions are divided by sqrt(g L_pp), turning rates by sqrt(g / L_pp). nabla [m^3]: displaced
    volume. Unlike the prime system it holds at rest: linear damping stays linear.
    """
    scaled = {name: value * bis_scale(name, rho, g, nabla, L_pp) for name, value in values.items()}
    return derivatives_wrench(nu_r, eta, **scaled)


def mmg_wrench(
    nu_r: SX,
    eta: SX,
    *,
    R_0: Annotated[SX, "-", POSITIVE],
    k_astern: Annotated[SX | float, "-"] = 1.0,
    L_pp: Annotated[SX, "m", POSITIVE],
    T: Annotated[SX, "m", POSITIVE],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
    **values: Annotated[SX, PRIME_DERIVATIVES],
) -> SX:
    """Wrench (6) of the MMG hull polynomial (Yasukawa and Yoshimura 2015, eqs. 9-11).

    X = 1/2 rho L T U^2 (-R_0 + X_vv v'^2 + ...), N with L^2 T; v' = v / U, r' = r L / U at the origin (amidships). The
    resistance has its full value for drift angles below 45 deg, k_astern times that astern. U^2 = u^2 + v^2 + 0.01^2
    [m^2/s^2]; in the primes U is at least |r| L_pp / TIGHTEST: in tighter turns no such polynomial was measured.

    Astern the hull counts as alike fore and aft: Y_v |u| v, Y_r u r, N_v u v, N_r |u| r (Yoshimura et al. 2009). What
    turns round has its full value for drift angles below 45 deg and |r| L_pp / TIGHTEST below |u|, and fades from there
    to 0 abeam and on the spot.
    """
    U = ca.sqrt(nu_r[0] ** 2 + nu_r[1] ** 2 + SPEED_FLOOR**2)
    ahead = ca.fmin(ca.fmax(nu_r[0] / (ca.fabs(nu_r[1]) + SPEED_FLOOR), -1), 1)
    ahead = _more_astern(ahead, nu_r[0], k_astern)
    turning = nu_r[5] * L_pp / TIGHTEST
    at_least = ca.sqrt(ca.fmax(nu_r[0] ** 2 + nu_r[1] ** 2, turning**2) + SPEED_FLOOR**2)
    across = ca.fmax(ca.fabs(nu_r[1]), ca.fabs(turning)) + SPEED_FLOOR
    sense = ca.fmin(ca.fmax(nu_r[0] / across, -1), 1)
    scaled = {
        name: value
        * T
        / L_pp
        * prime_scale(name, rho, L_pp, at_least)
        * (sense if reverses_astern(hull_derivative(name)) else 1)
        for name, value in values.items()
    }
    return derivatives_wrench(nu_r, eta, **scaled) - column_vector(
        rho / 2 * L_pp * T * R_0 * U**2 * ahead, 0, 0, 0, 0, 0
    )


def _more_astern(value: SX, u: SX, k_astern: SX | float) -> SX:
    """The value, and k_astern times it where the ship goes astern."""
    return value * ca.if_else(u >= 0, 1, k_astern) if differs_from_default(k_astern, 1.0) else value


def about_service_speed(nu_r: SX, delta: SX | float, values: Mapping[str, SX], L_pp: SX, U_0: SX, rho: SX) -> SX:
    """Wrench (6) of an Abkowitz polynomial: 1/2 rho L^2 U_0^2 value x monomial, moments with L^3.

    Factors u' = (u - U_0) / U_0, v' = v / U_0, r' = r L / U_0, delta [rad].
    """
    factors = {"u": nu_r[0] / U_0 - 1, "v": nu_r[1] / U_0, "r": nu_r[5] * L_pp / U_0, "delta": ca.SX(delta)}
    return sum_monomials(values, service_deviation, factors, rho / 2 * L_pp**2 * U_0**2, L_pp)


def abkowitz_wrench(
    nu_r: SX,
    *,
    L_pp: Annotated[SX, "m", POSITIVE],
    U_0: Annotated[SX, "m s^-1", POSITIVE],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
    **values: Annotated[SX, HULL_DEVIATIONS],
) -> SX:
    """Wrench (6) of derivatives about straight running at the service speed U_0 (Abkowitz 1964), in its prime system.

    The factor u is the change of speed, (u - U_0) / U_0: Y_v with Y_uv = Y_v is a force that goes with u v.
    """
    return about_service_speed(nu_r, 0.0, values, L_pp, U_0, rho)


def hull_strips(*, strips: int) -> dict[str, Any]:
    """Midpoints of equal strips as a fraction of the length, and the fraction that each strip covers."""
    import numpy as np

    return {"fraction": (np.arange(strips) + 0.5) / strips, "share": np.full(strips, 1.0 / strips)}


def cross_flow(
    nu_r: SX,
    fraction: SX,
    share: SX,
    *,
    C_d: Annotated[SX, "-"],
    k_fwd: Annotated[SX | float, "-"] = 0.0,
    k_ends: Annotated[SX | float, "-"] = 0.0,
    x_aft: Annotated[SX, "m"],
    x_fwd: Annotated[SX, "m"],
    T: Annotated[SX, "m", POSITIVE],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wrench (6) of cross-flow drag on one strip of the hull: dY = -1/2 rho T C(x) (v + x r)|v + x r| dx, dN = x dY.

    C(x) = C_d (1 + k_fwd s + k_ends (3 s^2 - 1) / 2), at least 0, with s = -1 aft and 1 forward. C_d is the coefficient
    of pure sway; k_fwd moves the centre forward by k_fwd / 6 of the length; the moment of pure yaw goes as
    1 + k_ends / 2. x_aft, x_fwd, T [m]. Strip theory (Faltinsen 1990, sec. 6; Fossen 2021, sec. 6.7); coefficients that
    vary along the hull: Hooft (1994), Ocean Eng. 21, 329-342.
    """
    x = x_aft + (x_fwd - x_aft) * fraction
    across = nu_r[1] + x * nu_r[5]
    if differs_from_default(k_fwd, 0.0) or differs_from_default(k_ends, 0.0):
        s = 2 * fraction - 1
        C_d = C_d * ca.fmax(1 + k_fwd * s + k_ends * (3 * s**2 - 1) / 2, 0)
    dY = -rho / 2 * T * C_d * (x_fwd - x_aft) * share * across * ca.fabs(across)
    return column_vector(0, dY, 0, 0, 0, x * dY)


def resistance_wrench(
    nu_r: SX,
    *,
    R_0: Annotated[SX | float, "kg m^-1"] = 0.0,
    R_1: Annotated[SX | float, "kg m^-2 s"] = 0.0,
    R_2: Annotated[SX | float, "kg m^-3 s^2"] = 0.0,
    R_3: Annotated[SX | float, "kg m^-4 s^3"] = 0.0,
    R_4: Annotated[SX | float, "kg m^-5 s^4"] = 0.0,
    k_astern: Annotated[SX | float, "-"] = 1.0,
) -> SX:
    """Wrench (6) of straight-ahead resistance: X = -(R_0 + R_1|u| + R_2 u^2 + R_3|u|^3 + R_4 u^4) u|u| [N].

    Going astern k_astern times that: the hull, the stern foremost, has more resistance than ahead.
    """
    u = nu_r[0]
    a = ca.fabs(u)
    polynomial = R_0 + a * (R_1 + a * (R_2 + a * (R_3 + a * R_4)))
    return column_vector(_more_astern(-polynomial * u * a, u, k_astern), 0, 0, 0, 0, 0)
