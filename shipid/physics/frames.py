"""Kinematics and relative motion (Fossen 2021, ch. 2 and 10): planar motion is the case phi = theta = 0."""

from __future__ import annotations

from typing import TYPE_CHECKING

from shipid.physics import symbols as ca

if TYPE_CHECKING:  # in signatures alone; ca.SX makes symbols
    from casadi import SX as SX
else:
    from shipid.physics.symbols import SymbolStandIn as SX


def column_vector(*entries: float | SX) -> SX:
    """Column vector of the given scalars; zeros stay structural, so that later operations skip them."""
    return ca.vertcat(*(ca.SX(1, 1) if isinstance(entry, int | float) and entry == 0 else entry for entry in entries))


def differs_from_default(value: SX | float, neutral: float) -> bool:
    """Whether a parameter has another value than its neutral default: what has not stays out of the equations."""
    return isinstance(value, ca.SX) or value != neutral


def skew_matrix(a: SX) -> SX:
    """S(a), with S(a) b = a x b, for a (3)."""
    return ca.vertcat(
        ca.horzcat(ca.SX(1, 1), -a[2], a[1]),
        ca.horzcat(a[2], ca.SX(1, 1), -a[0]),
        ca.horzcat(-a[1], a[0], ca.SX(1, 1)),
    )


def rotation_matrix(phi: SX, theta: SX, psi: SX) -> SX:
    """R(phi, theta, psi) [3 x 3]: body to north-east-down, angles in rad (Fossen 2021, eq. 2.31)."""
    c_phi, s_phi, c_theta, s_theta = ca.cos(phi), ca.sin(phi), ca.cos(theta), ca.sin(theta)
    c_psi, s_psi = ca.cos(psi), ca.sin(psi)
    return ca.vertcat(
        ca.horzcat(c_psi * c_theta, -s_psi * c_phi + c_psi * s_theta * s_phi, s_psi * s_phi + c_psi * c_phi * s_theta),
        ca.horzcat(s_psi * c_theta, c_psi * c_phi + s_phi * s_theta * s_psi, -c_psi * s_phi + s_theta * s_psi * c_phi),
        ca.horzcat(-s_theta, c_theta * s_phi, c_theta * c_phi),
    )


def position_rates(eta: SX, nu: SX) -> SX:
    """eta_dot = J(eta) nu: eta = [north, east, down, phi, theta, psi] (m, rad), nu (6) in m/s, rad/s.

    With phi = theta = 0 this is eq. (1) of the method, eta_dot = R(psi) nu. Singular at theta = 90 deg
    (Fossen 2021, eq. 2.40).
    """
    phi, theta, psi = eta[3], eta[4], eta[5]
    p, q, r = nu[3], nu[4], nu[5]
    tangential = ca.sin(phi) * q + ca.cos(phi) * r
    angles = column_vector(
        p + tangential * ca.tan(theta),
        ca.cos(phi) * q - ca.sin(phi) * r,
        tangential / ca.cos(theta),
    )
    return ca.vertcat(rotation_matrix(phi, theta, psi) @ nu[:3], angles)


def heave_rate(eta: SX, nu: SX) -> SX:
    """Downward velocity [m/s] of the origin in the inertial frame: zero in any steady motion, for any trim."""
    return rotation_matrix(eta[3], eta[4], eta[5])[2, :] @ nu[:3]


def current_velocity(eta: SX, nu: SX, V_c: SX, beta_c: SX, *, heaves: bool = True) -> tuple[SX, SX]:
    """A steady uniform current in body axes, nu_c (6), and its rate d(nu_c)/dt.

    V_c in m/s, beta_c in rad: the direction the current sets towards, clockwise from north. The rate is
    -omega x nu_c; in the plane [r v_c, -r u_c, 0] (method eq. 3; Fossen 2021, sec. 10.3). Of a ship that rolls and does
    not heave nu_c has no w, and its v is greater by 1 / cos(phi).
    """
    towards = column_vector(V_c * ca.cos(beta_c), V_c * ca.sin(beta_c), 0)
    if heaves:
        linear = rotation_matrix(eta[3], eta[4], eta[5]).T @ towards
        rate = -skew_matrix(nu[3:]) @ linear
    else:
        level = rotation_matrix(ca.SX(1, 1), ca.SX(1, 1), eta[5]).T @ towards
        c_phi, turning = ca.cos(eta[3]), ca.cos(eta[3]) * nu[5]
        linear = column_vector(level[0], level[1] / c_phi, 0)
        rate = column_vector(turning * level[1], (nu[3] * ca.tan(eta[3]) * level[1] - turning * level[0]) / c_phi, 0)
    return ca.vertcat(linear, ca.SX(3, 1)), ca.vertcat(rate, ca.SX(3, 1))


def wrench_of_force(x: SX, y: SX, z: SX | float, F_x: SX, F_y: SX) -> SX:
    """Wrench (6) about the origin of a horizontal force (F_x, F_y) [N] at the point (x, y, z) [m]."""
    return column_vector(F_x, F_y, 0, -z * F_y, z * F_x, x * F_y - y * F_x)
