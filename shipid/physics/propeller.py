"""Propellers behind a hull: fixed pitch (MMG), controllable pitch, or thrust minus resistance about a service speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Annotated, Any

from shipid.physics import symbols as ca
from shipid.physics.frames import SX, column_vector, differs_from_default, wrench_of_force
from shipid.physics.grammar import ADVANCE, POSITIVE
from shipid.physics.hull import SPEED_FLOOR
from shipid.physics.thruster import SHAFT_FLOOR, thrust_polynomial_value
from shipid.physics.wind import interpolate_ramps

ROOT_FLOOR = 1e-4  # m/s: below it the root of a square is a line


def drift_angle(nu_r: SX) -> tuple[SX, SX]:
    """Speed U [m/s] and drift angle beta = atan(-v / |u|) [rad] at the origin; finite, with derivatives, at rest.

    Astern it is measured from the stern, so that it stays small. Below SPEED_FLOOR |u| counts as 0.01 m/s; U is rounded
    off by it everywhere.
    """
    square = nu_r[0] ** 2 + nu_r[1] ** 2
    along = ca.if_else(square < SPEED_FLOOR**2, SPEED_FLOOR, ca.fabs(nu_r[0]))
    return ca.sqrt(square + SPEED_FLOOR**2), ca.atan2(-nu_r[1], along)


def signed_root(square: SX) -> SX:
    """sign(q) sqrt(|q|) [m/s] of a signed square q [m^2/s^2]; linear, with finite slope, below 1e-4 m/s."""
    return square / ca.sqrt(ca.fmax(ca.fabs(square), ROOT_FLOOR**2))


def propeller_inflow(
    nu_r: SX,
    x: SX,
    y: SX,
    w_P0: SX,
    C_1: SX,
    C_2_plus: SX,
    C_2_minus: SX,
    tau: SX | float,
    C_P: SX | float,
) -> SX:
    """u_P = (1 - w_P) u [m/s], the wake w_P changing with the drift beta_P at the propeller (MMG eqs. 16, 17).

    1 - w_P = (1 - w_P0) (1 + (1 - exp(-C_1 |beta_P|)) (C_2 - 1)) + tau |v_P| + C_P v_P^2, beta_P = beta - x r / U and
    v_P = (v + x r) / U. The part with tau and C_P is that of MMG models before C_1, C_2; Son and Nomoto (1982) have
    C_P alone.
    """
    U, beta = drift_angle(nu_r)
    beta_P = beta - x * nu_r[5] / U
    C_2 = ca.if_else(beta_P >= 0, C_2_plus, C_2_minus)
    change = 1 + (1 - ca.exp(-C_1 * ca.fabs(beta_P))) * (C_2 - 1)
    share = (1 - w_P0) * change
    if differs_from_default(tau, 0.0) or differs_from_default(C_P, 0.0):
        v_P = (nu_r[1] + x * nu_r[5]) / ca.sqrt(ca.fmax(nu_r[0] ** 2 + nu_r[1] ** 2, SPEED_FLOOR**2))
        share += tau * ca.fabs(v_P) + C_P * v_P**2
    return share * (nu_r[0] - nu_r[5] * y)


def propeller_thrust_coefficient(u_P: SX, n: SX, D_p: SX, K_T: Mapping[str, SX], J_min: SX, J_max: SX) -> SX:
    """K_T(J) with J = u_P / (|n| D_p), its sign reversed for n < 0, limited to J_min..J_max."""
    sense = ca.if_else(n >= 0, 1, -1)
    J = sense * u_P / (ca.fmax(ca.fabs(n), SHAFT_FLOOR) * D_p)
    return thrust_polynomial_value(K_T, ca.fmin(ca.fmax(J, J_min), J_max), ca.SX(1, 1), ca.SX(1))


def flow_beyond_polynomial(u_P: SX, n: SX, D_p: SX, J_min: SX, J_max: SX) -> SX:
    """Signed square [m^2/s^2] by which the inflow is beyond that of J_min..J_max: u_P|u_P| for a stopped screw.

    sign(u_P) max(u_P^2 - (J n D_p)^2, 0), J = J_max where the water drives the screw in its sense, J_min against it.
    """
    limit = ca.if_else(n * u_P >= 0, J_max, J_min)
    return ca.sign(u_P) * ca.fmax(u_P**2 - (limit * n * D_p) ** 2, 0)


def propeller_wrench(
    nu_r: SX,
    n: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    z: Annotated[SX | float, "m"] = 0.0,
    D_p: Annotated[SX, "m", POSITIVE],
    K_T: Annotated[Mapping[str, SX], ADVANCE],
    K_T_astern: Annotated[Mapping[str, SX] | None, ADVANCE] = None,
    Y_astern: Annotated[Mapping[str, SX] | None, ADVANCE] = None,
    N_astern: Annotated[Mapping[str, SX] | None, ADVANCE] = None,
    J_min: Annotated[SX | float, "-"] = -1.0,
    J_max: Annotated[SX | float, "-"] = 1.5,
    k_astern: Annotated[SX | float, "-"] = 1.0,
    k_drag: Annotated[SX | float, "-"] = 0.0,
    t_P: Annotated[SX, "-"],
    w_P0: Annotated[SX, "-"],
    C_1: Annotated[SX, "-"],
    C_2_plus: Annotated[SX, "-"],
    C_2_minus: Annotated[SX, "-"],
    tau: Annotated[SX | float, "-"] = 0.0,
    C_P: Annotated[SX | float, "-"] = 0.0,
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wrench (6) of a propeller behind a hull: X = (1 - t_P) rho n^2 D_p^4 K_T(J) (MMG eqs. 12-17).

    n [rev/s]; wake w_P0 on a straight course, C_1, C_2, tau, C_P its change with drift, see `propeller_inflow`. For n <
    0 X = -(1 - t_P) k_astern rho n^2 D_p^4 K(J), J = u_P / (n D_p), with K = K_T_astern, by default the polynomial of
    ahead. Yasukawa and Yoshimura (2015).

    Beyond J_min..J_max K_T stays, and the water drags the screw by k_drag rho D_p^2 `flow_beyond_polynomial`: a stopped
    screw by k_drag rho D_p^2 u_P|u_P|. A screw astern gives the side force Y = rho n^2 D_p^4 Y_astern(J) and the moment
    about the origin N = rho n^2 D_p^5 N_astern(J); for a right-handed screw, which moves the stern to port, Y_astern <
    0 < N_astern.
    """
    u_P = propeller_inflow(nu_r, ca.SX(x), ca.SX(y), w_P0, C_1, C_2_plus, C_2_minus, tau, C_P)
    low, high = ca.SX(J_min), ca.SX(J_max)
    K = propeller_thrust_coefficient(u_P, n, D_p, K_T, low, high)
    if K_T_astern:
        K = ca.if_else(n >= 0, K, propeller_thrust_coefficient(u_P, n, D_p, K_T_astern, low, high))
    thrust = ca.if_else(n >= 0, 1, -k_astern) * rho * n**2 * D_p**2 * D_p**2 * K
    if differs_from_default(k_drag, 0.0):
        thrust -= k_drag * rho * D_p**2 * flow_beyond_polynomial(u_P, n, D_p, low, high)
    wrench = wrench_of_force(ca.SX(x), ca.SX(y), ca.SX(z), (1 - t_P) * thrust, ca.SX(1, 1))
    if Y_astern or N_astern:
        unit = ca.if_else(n >= 0, 0, rho * n**2 * D_p**2 * D_p**2)
        Y, N = (propeller_thrust_coefficient(u_P, n, D_p, table or {}, low, high) for table in (Y_astern, N_astern))
        wrench += unit * column_vector(0, Y, 0, -z * Y, 0, D_p * N)
    return wrench


def shaft_thrust(wrench: Callable[..., SX]) -> Callable[..., SX]:
    """The function of the thrust [N] in the shaft of a screw with this wrench: before the thrust deduction."""

    @wraps(wrench)
    def thrust(*signals: SX, **numbers: Any) -> SX:
        return wrench(*signals, **{**numbers, "t_P": 0.0})[0]

    return thrust


def propeller_torque(
    nu_r: SX,
    n: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    D_p: Annotated[SX, "m", POSITIVE],
    K_Q: Annotated[Mapping[str, SX] | None, ADVANCE] = None,
    J_min: Annotated[SX | float, "-"] = -1.0,
    J_max: Annotated[SX | float, "-"] = 1.5,
    w_P0: Annotated[SX, "-"],
    C_1: Annotated[SX, "-"],
    C_2_plus: Annotated[SX, "-"],
    C_2_minus: Annotated[SX, "-"],
    tau: Annotated[SX | float, "-"] = 0.0,
    C_P: Annotated[SX | float, "-"] = 0.0,
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX | None:
    """Torque [N m] in the shaft of `propeller_wrench`, Q = sign(n) rho n^2 D_p^5 K_Q(J); None without K_Q.

    K_Q is that behind the ship: of the open-water test over the relative rotative efficiency (ITTC 7.5-02-03-01.4).
    """
    if K_Q is None:
        return None
    u_P = propeller_inflow(nu_r, ca.SX(x), ca.SX(y), w_P0, C_1, C_2_plus, C_2_minus, tau, C_P)
    K = propeller_thrust_coefficient(u_P, n, D_p, K_Q, ca.SX(J_min), ca.SX(J_max))
    return rho * n * ca.fabs(n) * D_p**2 * D_p**3 * K


def propeller_wash(
    nu_r: SX,
    n: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    D_p: Annotated[SX, "m", POSITIVE],
    K_T: Annotated[Mapping[str, SX], ADVANCE],
    K_T_astern: Annotated[Mapping[str, SX] | None, ADVANCE] = None,
    J_min: Annotated[SX | float, "-"] = -1.0,
    J_max: Annotated[SX | float, "-"] = 1.5,
    k_astern: Annotated[SX | float, "-"] = 1.0,
    k_suction: Annotated[SX | float, "-"] = 0.0,
    w_P0: Annotated[SX, "-"],
    C_1: Annotated[SX, "-"],
    C_2_plus: Annotated[SX, "-"],
    C_2_minus: Annotated[SX, "-"],
    tau: Annotated[SX | float, "-"] = 0.0,
    C_P: Annotated[SX | float, "-"] = 0.0,
) -> SX:
    """Propeller slipstream at a rudder behind it, (3): inflow u_P [m/s], slipstream speed far behind [m/s], D_p [m].

    Momentum theory: u_race^2 = u_P^2 + 8 K_T n^2 D_p^2 / pi, a signed square for u_P < 0. With the screw astern the
    rudder is in the water that it draws in: u_P less k_suction times sqrt(u_P^2 + 8 K n^2 D_p^2 / pi) - |u_P|, a share
    that by the same theory is 1/2 at the disc.
    """
    u_P = propeller_inflow(nu_r, ca.SX(x), ca.SX(y), w_P0, C_1, C_2_plus, C_2_minus, tau, C_P)
    K = propeller_thrust_coefficient(u_P, n, D_p, K_T, ca.SX(J_min), ca.SX(J_max))
    driven = 8 / ca.pi * K * (n * D_p) ** 2
    ahead = ca.sqrt(ca.fmax(u_P**2 + driven, 0) + SPEED_FLOOR**2)
    race = ca.if_else(u_P >= 0, ahead, signed_root(SPEED_FLOOR**2 - u_P**2 + ca.fmax(driven, 0)))
    if differs_from_default(k_suction, 0.0):
        K_a = propeller_thrust_coefficient(u_P, n, D_p, K_T_astern or K_T, ca.SX(J_min), ca.SX(J_max))
        added = 8 / ca.pi * k_astern * ca.fmax(K_a, 0) * (n * D_p) ** 2
        astern = u_P - k_suction * (ca.sqrt(u_P**2 + added + SPEED_FLOOR**2) - ca.sqrt(u_P**2 + SPEED_FLOOR**2))
        return ca.vertcat(ca.if_else(n >= 0, u_P, astern), ca.if_else(n >= 0, race, astern), D_p)
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
    tau: Annotated[SX | float, "-"] = 0.0,
    C_P: Annotated[SX | float, "-"] = 0.0,
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wrench (6) of a controllable-pitch propeller: X = (1 - t_P) rho D_p^4 (k_P p n|n| - k_J |n| u_P / D_p).

    n [rev/s]; pitch p [-], P/D at 0.7 of the radius, negative to drive astern; inflow u_P as of `propeller_inflow`.
    That is K_T = k_P p - k_J J: the bilinear thrust of Blanke (1981), in Fossen (2021), proportional to the pitch. It
    overestimates the thrust at the largest pitches.
    """
    u_P = propeller_inflow(
        nu_r, ca.SX(x), ca.SX(y), ca.SX(w_P0), ca.SX(C_1), ca.SX(C_2_plus), ca.SX(C_2_minus), tau, C_P
    )
    thrust = rho * D_p**2 * D_p**2 * bilinear_thrust(u_P, n, pitch, D_p, k_P, k_J, k_astern)
    return wrench_of_force(ca.SX(x), ca.SX(y), ca.SX(z), (1 - t_P) * thrust, ca.SX(1, 1))


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
    tau: Annotated[SX | float, "-"] = 0.0,
    C_P: Annotated[SX | float, "-"] = 0.0,
) -> SX:
    """Slipstream of a controllable-pitch propeller, (3): inflow [m/s], slipstream speed far behind [m/s], D_p [m].

    By momentum theory its signed square is u_P|u_P| + 8 T / (pi rho D_p^2); see `slipstream_speed`. So the flow at a
    rudder has no step where the pitch goes through zero.
    """
    u_P = propeller_inflow(
        nu_r, ca.SX(x), ca.SX(y), ca.SX(w_P0), ca.SX(C_1), ca.SX(C_2_plus), ca.SX(C_2_minus), tau, C_P
    )
    driven = 8 / ca.pi * D_p**2 * bilinear_thrust(u_P, n, pitch, D_p, k_P, k_J, k_astern)
    return ca.vertcat(u_P, slipstream_speed(u_P, u_P * ca.fabs(u_P), driven), D_p)


def quadratic_thrust(
    u_P: SX,
    n: SX,
    T_nn: SX,
    T_nu: SX | float,
    T_uu: SX | float,
    k_astern: SX | float,
    dT_nu: SX | float,
    k_driven: SX | float,
) -> SX:
    """Thrust [N] of a screw: T_nn n|n| - T_nu |n| u_P - T_uu u_P|u_P|; for n < 0 with k_astern T_nn and T_nu + dT_nu.

    The part against the sense of the shaft, of a screw that the water drives, is multiplied by k_driven.
    """
    ahead = n >= 0
    thrust = T_nn * ca.if_else(ahead, 1, k_astern) * n * ca.fabs(n)
    thrust -= (T_nu + ca.if_else(ahead, 0, dT_nu)) * ca.fabs(n) * u_P + T_uu * u_P * ca.fabs(u_P)
    if not differs_from_default(k_driven, 1.0):
        return thrust
    sense = ca.if_else(ahead, 1, -1)
    return sense * (ca.fmax(sense * thrust, 0) + k_driven * ca.fmin(sense * thrust, 0))


def quadratic_propeller_wrench(
    nu_r: SX,
    n: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    z: Annotated[SX | float, "m"] = 0.0,
    T_nn: Annotated[SX, "kg m", POSITIVE],
    T_nu: Annotated[SX | float, "kg"] = 0.0,
    T_uu: Annotated[SX | float, "kg m^-1"] = 0.0,
    k_astern: Annotated[SX | float, "-"] = 1.0,
    dT_nu: Annotated[SX | float, "kg"] = 0.0,
    k_driven: Annotated[SX | float, "-"] = 1.0,
    t_P: Annotated[SX | float, "-"] = 0.0,
    w_P0: Annotated[SX | float, "-"] = 0.0,
    Y_T: Annotated[SX | float, "-"] = 0.0,
    N_T: Annotated[SX | float, "m"] = 0.0,
) -> SX:
    """Wrench (6) of a screw with a quadratic law of thrust T: X = (1 - t_P) T, Y = Y_T T, N = N_T T - y X.

    See `quadratic_thrust`; n [rev/s], u_P = (1 - w_P0) u. Y_T and N_T are the side force and the moment of one turning
    screw. Norrbin (1970), van Berlekom and Goddard (1972); with T_uu = 0 the bilinear thrust of Blanke (1981).
    """
    u_P = (1 - w_P0) * nu_r[0]
    thrust = quadratic_thrust(u_P, n, T_nn, T_nu, T_uu, k_astern, dT_nu, k_driven)
    ahead = wrench_of_force(ca.SX(x), ca.SX(y), ca.SX(z), (1 - t_P) * thrust, ca.SX(1, 1))
    return ahead + thrust * column_vector(0, Y_T, 0, -z * Y_T, 0, N_T)


def quadratic_wash(
    nu_r: SX,
    n: SX,
    *,
    T_nn: Annotated[SX, "kg m", POSITIVE],
    T_nu: Annotated[SX | float, "kg"] = 0.0,
    T_uu: Annotated[SX | float, "kg m^-1"] = 0.0,
    k_astern: Annotated[SX | float, "-"] = 1.0,
    dT_nu: Annotated[SX | float, "kg"] = 0.0,
    k_driven: Annotated[SX | float, "-"] = 1.0,
    w_P0: Annotated[SX | float, "-"] = 0.0,
    D_p: Annotated[SX | float, "m"] = 0.0,
    c_uu: Annotated[SX | float, "-"] = 0.0,
    c_un: Annotated[SX | float, "m"] = 0.0,
    c_nn: Annotated[SX | float, "m^2"] = 0.0,
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Slipstream of a screw with a quadratic law of thrust, (3): inflow [m/s], slipstream speed [m/s], D_p [m].

    Its signed square is c_uu u_P|u_P| + c_un n u_P + c_nn n|n| (van Berlekom and Goddard 1972), and with a diameter
    u_P|u_P| + 8 T / (pi rho D_p^2) more, as momentum theory has it; see `slipstream_speed`. Without these numbers there
    is no slipstream, and a rudder is in the inflow.
    """
    u_P = (1 - w_P0) * nu_r[0]
    if not any(differs_from_default(number, 0.0) for number in (D_p, c_uu, c_un, c_nn)):
        return column_vector(u_P, u_P, D_p)
    still, driven = ca.SX(1, 1), c_uu * u_P * ca.fabs(u_P) + c_un * n * u_P + c_nn * n * ca.fabs(n)
    if differs_from_default(D_p, 0.0):
        thrust = quadratic_thrust(u_P, n, T_nn, T_nu, T_uu, k_astern, dT_nu, k_driven)
        still, driven = u_P * ca.fabs(u_P), driven + 8 * thrust / (ca.pi * rho * D_p**2)
    return column_vector(u_P, slipstream_speed(u_P, still, driven), D_p)


def slipstream_speed(u_P: SX, still: SX, driven: SX) -> SX:
    """Speed [m/s] of a slipstream of signed square `still` and what the screw adds to it, `driven` [m^2/s^2].

    A screw astern takes at most all flow of a ship that goes ahead; on a ship that goes astern it adds none.
    """
    return signed_root(ca.if_else(u_P >= 0, ca.fmax(still + driven, 0), still + ca.fmax(driven, 0)))


def four_quadrant_thrust(u_P: SX, n: SX, D_p: SX, beta_deg: list[SX], C_T: list[SX]) -> SX:
    """Thrust over rho [m^4/s^2]: 1/2 C_T(beta) (u_P^2 + (0.7 pi n D_p)^2) pi / 4 D_p^2, linear between the entries."""
    tip = 0.7 * ca.pi * n * D_p
    square = u_P**2 + tip**2
    beta = ca.atan2(u_P, ca.if_else(square < SPEED_FLOOR**2, SPEED_FLOOR, tip))
    coefficient = interpolate_ramps(beta * (180 / ca.pi), ca.vertcat(*beta_deg), ca.vertcat(*C_T))
    return ca.pi / 8 * D_p**2 * square * coefficient


def four_quadrant(
    nu_r: SX,
    n: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    z: Annotated[SX | float, "m"] = 0.0,
    D_p: Annotated[SX, "m", POSITIVE],
    beta_deg: Annotated[list[SX], "deg"],
    C_T: Annotated[list[SX], "-"],
    t_P: Annotated[SX | float, "-"] = 0.0,
    w_P0: Annotated[SX | float, "-"] = 0.0,
    C_1: Annotated[SX | float, "-"] = 0.0,
    C_2_plus: Annotated[SX | float, "-"] = 1.0,
    C_2_minus: Annotated[SX | float, "-"] = 1.0,
    tau: Annotated[SX | float, "-"] = 0.0,
    C_P: Annotated[SX | float, "-"] = 0.0,
    rho: Annotated[SX, "kg m^-3", POSITIVE],
) -> SX:
    """Wrench (6) of a propeller from its open-water test in four quadrants: X = (1 - t_P) T (Oltmann and Sharma 1984).

    T = 1/2 rho C_T(beta) (u_P^2 + (0.7 pi n D_p)^2) pi / 4 D_p^2 with the advance angle at 0.7 of the radius, beta =
    atan2(u_P, 0.7 pi n D_p): 0 to 90 deg ahead, 90 to 180 the screw astern while the ship goes ahead (crash stop), -90
    to 0 the screw ahead and the ship astern, -180 to -90 astern. A stopped screw, at +-90 deg, drags. Inflow u_P as
    in `propeller_inflow`.
    """
    u_P = propeller_inflow(
        nu_r, ca.SX(x), ca.SX(y), ca.SX(w_P0), ca.SX(C_1), ca.SX(C_2_plus), ca.SX(C_2_minus), tau, C_P
    )
    thrust = rho * four_quadrant_thrust(u_P, n, D_p, beta_deg, C_T)
    return wrench_of_force(ca.SX(x), ca.SX(y), ca.SX(z), (1 - t_P) * thrust, ca.SX(1, 1))


def four_quadrant_wash(
    nu_r: SX,
    n: SX,
    *,
    x: Annotated[SX, "m"],
    y: Annotated[SX | float, "m"] = 0.0,
    D_p: Annotated[SX, "m", POSITIVE],
    beta_deg: Annotated[list[SX], "deg"],
    C_T: Annotated[list[SX], "-"],
    w_P0: Annotated[SX | float, "-"] = 0.0,
    C_1: Annotated[SX | float, "-"] = 0.0,
    C_2_plus: Annotated[SX | float, "-"] = 1.0,
    C_2_minus: Annotated[SX | float, "-"] = 1.0,
    tau: Annotated[SX | float, "-"] = 0.0,
    C_P: Annotated[SX | float, "-"] = 0.0,
) -> SX:
    """Slipstream of a propeller in four quadrants, (3): inflow [m/s], slipstream speed [m/s], D_p [m].

    By momentum theory its signed square is u_P|u_P| + 8 T / (pi rho D_p^2); see `slipstream_speed`.
    """
    u_P = propeller_inflow(
        nu_r, ca.SX(x), ca.SX(y), ca.SX(w_P0), ca.SX(C_1), ca.SX(C_2_plus), ca.SX(C_2_minus), tau, C_P
    )
    driven = 8 / ca.pi * four_quadrant_thrust(u_P, n, D_p, beta_deg, C_T) / D_p**2
    return column_vector(u_P, slipstream_speed(u_P, u_P * ca.fabs(u_P), driven), D_p)


def service_speed_wrench(
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
    return column_vector(rho / 2 * L_pp**2 * U_0**2 * d * (X_u + d * (X_uu + d * X_uuu)), 0, 0, 0, 0, 0)
