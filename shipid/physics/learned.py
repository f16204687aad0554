"""A force term learned from data: a small bounded neural network of the velocity through the water."""

from __future__ import annotations

from typing import Annotated

from shipid.physics import symbols as ca
from shipid.physics.frames import SX, column_vector
from shipid.physics.grammar import POSITIVE


def learned_wrench(
    nu_r: SX,
    *,
    u_scale: Annotated[SX, "m s^-1", POSITIVE],
    v_scale: Annotated[SX, "m s^-1", POSITIVE],
    r_scale: Annotated[SX, "s^-1", POSITIVE],
    X_max: Annotated[SX, "N", POSITIVE],
    Y_max: Annotated[SX, "N", POSITIVE],
    N_max: Annotated[SX, "N m", POSITIVE],
    w_u: Annotated[list[SX], "-"],
    w_v: Annotated[list[SX], "-"],
    w_r: Annotated[list[SX], "-"],
    w_0: Annotated[list[SX], "-"],
    c_X: Annotated[list[SX], "-"],
    c_Y: Annotated[list[SX], "-"],
    c_N: Annotated[list[SX], "-"],
) -> SX:
    """Wrench (6) of one hidden layer of tanh units, |X| < X_max, |Y| < Y_max, |N| < N_max.

    Unit j is h_j(u, v, r) = tanh(w_u u / u_scale + w_v v / v_scale + w_r r / r_scale + w_0). Its even part e_j is half
    the sum of h_j at (u, v, r) and at (u, -v, -r), its odd part o_j half the difference:
    X = X_max tanh(sum_j c_X (e_j - tanh(w_0))), Y = Y_max tanh(sum_j c_Y o_j), N = N_max tanh(sum_j c_N o_j).
    Every list has one number for each unit; nu_r (6) [m/s, rad/s] is the velocity through the water.

    A network inside the equations of motion is a universal differential equation (Rackauckas et al. 2020,
    arXiv:2001.04385); for the damping of a marine vehicle see van de Ven et al. (2007).
    """
    u, v, r = nu_r[0] / u_scale, nu_r[1] / v_scale, nu_r[5] / r_scale
    X, Y, N = ca.SX(0), ca.SX(0), ca.SX(0)
    for a_u, a_v, a_r, a_0, b_X, b_Y, b_N in zip(w_u, w_v, w_r, w_0, c_X, c_Y, c_N, strict=True):
        along, across = a_u * u + a_0, a_v * v + a_r * r
        one, other = ca.tanh(along + across), ca.tanh(along - across)
        X += b_X * ((one + other) / 2 - ca.tanh(a_0))
        odd = (one - other) / 2
        Y, N = Y + b_Y * odd, N + b_N * odd
    return column_vector(X_max * ca.tanh(X), Y_max * ca.tanh(Y), 0, 0, 0, N_max * ca.tanh(N))
