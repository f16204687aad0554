"""Mass, added mass and their Coriolis and centripetal terms (Fossen 2021, ch. 3 and 6)."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated

import casadi as ca
from casadi import SX

from shipid.physics.frames import skew
from shipid.physics.grammar import ADDED_MASS, AXES, MOTIONS, POSITIVE


def rigid_body(
    *,
    m: Annotated[SX, "kg", POSITIVE],
    I_z: Annotated[SX, "kg m^2", POSITIVE],
    x_G: Annotated[SX, "m"],
    z_G: Annotated[SX | float, "m"] = 0.0,
    I_x: Annotated[SX | float, "kg m^2"] = 0.0,
    I_y: Annotated[SX | float, "kg m^2"] = 0.0,
) -> SX:
    """M_RB [6 x 6] about the origin, with the centre of gravity at (x_G, 0, z_G) (Fossen 2021, eq. 3.49).

    I_x, I_y, I_z [kg m^2] are about the origin. Three degrees of freedom need m, I_z and x_G only.
    """
    S_G = skew(ca.vertcat(SX(x_G), SX(1, 1), SX(z_G)))
    top = ca.horzcat(m * SX.eye(3), -m * S_G)
    bottom = ca.horzcat(m * S_G, ca.diag(ca.vertcat(SX(I_x), SX(I_y), SX(I_z))))
    return ca.vertcat(top, bottom)


def added_mass(**derivatives: Annotated[SX, ADDED_MASS]) -> SX:
    """M_A [6 x 6] = -[X_udot ...]: the named acceleration derivatives with their sign turned (SNAME 1950).

    Derivatives are on the force side (X_udot < 0), in kg, kg m or kg m^2 by their name; what is not named is zero.
    """
    M_A = SX(6, 6)
    for name, value in derivatives.items():
        row, column = AXES.index(name[0]), MOTIONS.index(name[2])
        M_A[row, column] = -value
    return M_A


@lru_cache(maxsize=64)
def mass(inertia: tuple[str, ...], added: tuple[str, ...]) -> ca.Function:
    """M_RB + M_A [6 x 6] as a function of one vector: the named arguments of `rigid_body`, then of `added_mass`."""
    values = SX.sym("values", len(inertia) + len(added))
    known, derivatives = ca.vertsplit(values)[: len(inertia)], ca.vertsplit(values)[len(inertia) :]
    M = rigid_body(**dict(zip(inertia, known, strict=True))) + added_mass(**dict(zip(added, derivatives, strict=True)))
    return ca.Function("mass", [values], [ca.densify(M)])


def coriolis(M: SX, nu: SX) -> SX:
    """C(nu) nu (6) of a mass matrix M [6 x 6], by its symmetric part: it does no work (Fossen 2021, eq. 3.57).

    In the plane: [-(m22 v + c r) r, m11 u r, (m22 v + c r) u - m11 u v], c = (m26 + m62) / 2.
    """
    momentum = (M + M.T) / 2 @ nu
    linear, angular = skew(momentum[:3]), skew(momentum[3:])
    return -ca.vertcat(linear @ nu[3:], linear @ nu[:3] + angular @ nu[3:])
