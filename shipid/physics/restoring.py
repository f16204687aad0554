"""Hydrostatic restoring forces of a wall-sided ship (Fossen 2021, sec. 4.1)."""

from __future__ import annotations

from typing import Annotated

from shipid.physics.frames import SX, column_vector
from shipid.physics.grammar import POSITIVE


def hydrostatic(
    eta: SX,
    *,
    A_wp: Annotated[SX, "m^2", POSITIVE],
    x_F: Annotated[SX, "m"],
    nabla: Annotated[SX, "m^3", POSITIVE],
    GM_T: Annotated[SX, "m", POSITIVE],
    GM_L: Annotated[SX, "m", POSITIVE],
    rho: Annotated[SX, "kg m^-3", POSITIVE],
    g: Annotated[SX, "m s^-2", POSITIVE],
) -> SX:
    """Wrench (6) of linear restoring: C_33 = rho g A_wp, C_35 = -x_F C_33, C_44 and C_55 = rho g nabla GM.

    A_wp waterplane area; x_F centre of flotation forward of the origin; nabla displaced volume; GM_T, GM_L
    metacentric heights, the longitudinal one for trim about the origin. Heave and trim are zero at rest.
    """
    z, phi, theta = eta[2], eta[3], eta[4]
    stiffness, weight = rho * g * A_wp, rho * g * nabla
    Z = -stiffness * (z - x_F * theta)
    M = stiffness * x_F * z - weight * GM_L * theta
    return column_vector(0, 0, Z, -weight * GM_T * phi, M, 0)
