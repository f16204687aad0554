"""Mass, added mass and their Coriolis and centripetal terms (Fossen 2021, ch. 3 and 6)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from shipid.physics import symbols as ca
from shipid.physics.frames import SX, skew_matrix
from shipid.physics.grammar import ADDED_MASS, AXES, MOTIONS, POSITIVE

Entries = dict[tuple[int, int], Any]
"""Row and column in a matrix [6 x 6] -> entry, a symbol, a number or an array (members,); what is not named is zero."""


def rigid_body_entries(
    *,
    m: Annotated[SX, "kg", POSITIVE],
    I_z: Annotated[SX, "kg m^2", POSITIVE],
    x_G: Annotated[SX, "m"],
    z_G: Annotated[SX | float, "m"] = 0.0,
    I_x: Annotated[SX | float, "kg m^2"] = 0.0,
    I_y: Annotated[SX | float, "kg m^2"] = 0.0,
) -> Entries:
    """M_RB about the origin, with the centre of gravity at (x_G, 0, z_G) (Fossen 2021, eq. 3.49).

    I_x, I_y, I_z [kg m^2] are about the origin. Three degrees of freedom need m, I_z and x_G only.
    """
    masses, moments = {(i, i): m for i in range(3)}, {(3, 3): I_x, (4, 4): I_y, (5, 5): I_z}
    right = {(0, 4): -m * -z_G, (1, 3): -m * z_G, (1, 5): -m * -x_G, (2, 4): -m * x_G}  # -m S(x_G, 0, z_G)
    left = {(3, 1): m * -z_G, (4, 0): m * z_G, (4, 2): m * -x_G, (5, 1): m * x_G}
    return masses | right | left | moments


def added_mass_entries(**derivatives: Annotated[SX, ADDED_MASS]) -> Entries:
    """M_A = -[X_udot ...]: the named acceleration derivatives with their sign turned (SNAME 1950).

    Derivatives are on the force side (X_udot < 0), in kg, kg m or kg m^2 by their name; what is not named is zero.
    """
    return {(AXES.index(name[0]), MOTIONS.index(name[2])): -value for name, value in derivatives.items()}


def mass_matrix(entries: Entries) -> SX:
    """A matrix [6 x 6] of symbols; its zeros stay structural."""
    M = ca.SX(6, 6)
    for place, value in entries.items():
        M[place] = value
    return M


def total_mass(inertia: Mapping[str, Any], added: Mapping[str, Any]) -> list[list[Any]]:
    """Rows of M_RB + M_A [6 x 6] from the arguments of `rigid_body_entries` and of `added_mass_entries`."""
    M_RB, M_A = rigid_body_entries(**inertia), added_mass_entries(**added)
    return [[M_RB.get((i, j), 0.0) + M_A.get((i, j), 0.0) for j in range(6)] for i in range(6)]


def coriolis_force(M: SX, nu: SX) -> SX:
    """C(nu) nu (6) of a mass matrix M [6 x 6], by its symmetric part: it does no work (Fossen 2021, eq. 3.57).

    In the plane: [-(m22 v + c r) r, m11 u r, (m22 v + c r) u - m11 u v], c = (m26 + m62) / 2.
    """
    momentum = (M + M.T) / 2 @ nu
    linear, angular = skew_matrix(momentum[:3]), skew_matrix(momentum[3:])
    return -ca.vertcat(linear @ nu[3:], linear @ nu[:3] + angular @ nu[3:])
