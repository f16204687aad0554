"""Wind forces (method eqs. 5-9) from tables of coefficients or from Blendermann's formula."""

from __future__ import annotations

from typing import Annotated

from shipid.physics import symbols as ca
from shipid.physics.frames import SX, column_vector
from shipid.physics.grammar import POSITIVE

CALM = 1e-6  # m/s: below this relative wind the angle of attack is taken as that of a head wind


def relative_wind(nu: SX, psi: SX, V_w: SX, beta_w: SX) -> tuple[SX, SX]:
    """Square of the relative wind speed [m^2/s^2] and its angle of attack gamma_rw [rad] (method eqs. 6-9).

    V_w [m/s], beta_w [rad, towards, clockwise from north]; gamma_rw = 0 is a head wind, > 0 comes from port.
    Finite, with finite derivatives, also when ship and wind are at rest.
    """
    north, east = V_w * ca.cos(beta_w), V_w * ca.sin(beta_w)  # turned by psi: fewer sines than of beta_w - psi
    u_rw = nu[0] - (north * ca.cos(psi) + east * ca.sin(psi))
    v_rw = nu[1] - (east * ca.cos(psi) - north * ca.sin(psi))
    square = u_rw**2 + v_rw**2
    along = ca.if_else(square < CALM**2, CALM, u_rw)
    return square, -ca.atan2(v_rw, along)


def interpolate_ramps(x: SX, grid: SX, values: SX) -> SX:
    """Piecewise linear interpolation as a sum of ramps, constant beyond the ends; in SX, for all engines."""
    x = ca.fmin(ca.fmax(x, grid[0]), grid[-1])
    slopes = ca.diff(values) / ca.diff(grid)
    result = values[0] + slopes[0] * (x - grid[0])
    for i in range(1, slopes.numel()):
        result += (slopes[i] - slopes[i - 1]) * ca.fmax(x - grid[i], 0)
    return result


def wind_table_wrench(
    nu: SX,
    psi: SX,
    V_w: SX,
    beta_w: SX,
    *,
    gamma_deg: Annotated[list[SX], "deg"],
    C_X: Annotated[list[SX], "-"],
    C_Y: Annotated[list[SX], "-"],
    C_N: Annotated[list[SX], "-"],
    A_FW: Annotated[SX, "m^2", POSITIVE],
    A_LW: Annotated[SX, "m^2", POSITIVE],
    L_oa: Annotated[SX, "m", POSITIVE],
    rho_a: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wind wrench (6) from tables over |gamma_rw| in 0..180 deg, mirrored to the other side (method eq. 5).

    X = q A_FW C_X, Y = sgn(gamma) q A_LW C_Y, N = sgn(gamma) q A_LW L_oa C_N, q = 1/2 rho_a V_rw^2.
    """
    square, gamma = relative_wind(nu, psi, V_w, beta_w)
    q, side = rho_a / 2 * square, ca.sign(gamma)
    grid = ca.vertcat(*gamma_deg) * (ca.pi / 180)
    C_X_, C_Y_, C_N_ = (interpolate_ramps(ca.fabs(gamma), grid, ca.vertcat(*values)) for values in (C_X, C_Y, C_N))
    return column_vector(q * A_FW * C_X_, side * q * A_LW * C_Y_, 0, 0, 0, side * q * A_LW * L_oa * C_N_)


def blendermann_wrench(
    nu: SX,
    psi: SX,
    V_w: SX,
    beta_w: SX,
    *,
    C_Dt: Annotated[SX, "-", POSITIVE],
    C_Dl_bow: Annotated[SX, "-"],
    C_Dl_stern: Annotated[SX, "-"],
    delta: Annotated[SX, "-"],
    kappa: Annotated[SX, "-"],
    s_L: Annotated[SX, "m"],
    s_H: Annotated[SX, "m"],
    A_FW: Annotated[SX, "m^2", POSITIVE],
    A_LW: Annotated[SX, "m^2", POSITIVE],
    L_oa: Annotated[SX, "m", POSITIVE],
    rho_a: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wind wrench (6) by Blendermann (1994), J. Wind Eng. Ind. Aerodyn. 51, 339-351.

    C_Dt transverse and C_Dl_bow / C_Dl_stern longitudinal drag (on A_FW), delta cross-force and kappa rolling-moment
    parameters; s_L [m] centroid of the lateral area forward of the origin, s_H [m] above the waterline.
    """
    square, angle = relative_wind(nu, psi, V_w, beta_w)
    q, side, gamma = rho_a / 2 * square, ca.sign(angle), ca.fabs(angle)
    C_Dl = ca.if_else(ca.cos(gamma) >= 0, C_Dl_bow, C_Dl_stern)
    along = C_Dl * A_FW / A_LW / C_Dt
    damping = 1 - delta / 2 * (1 - along) * ca.sin(2 * gamma) ** 2
    C_X = -C_Dl * ca.cos(gamma) / damping
    C_Y = C_Dt * ca.sin(gamma) / damping
    C_N = (s_L / L_oa - 0.18 * (gamma - ca.pi / 2)) * C_Y
    Y = side * q * A_LW * C_Y
    return column_vector(q * A_FW * C_X, Y, 0, kappa * s_H * Y, 0, side * q * A_LW * L_oa * C_N)
