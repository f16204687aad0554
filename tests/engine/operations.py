"""Every operation that the physics may use, for the tests of what prints them."""

from __future__ import annotations

import casadi as ca


def operations(a: ca.SX, b: ca.SX, k: ca.SX) -> list[ca.SX]:
    """Values of all operations on two states and a parameter, truths in arithmetic included."""
    unary = (ca.exp, ca.sin, ca.cos, ca.tan, ca.atan, ca.sinh, ca.cosh, ca.tanh, ca.fabs, ca.sign, ca.floor, ca.ceil)
    values = [f(a) for f in unary] + [f(k) for f in unary]
    values += [ca.log(ca.fabs(a)), ca.sqrt(ca.fabs(a)), ca.asin(ca.tanh(a)), ca.acos(ca.tanh(b))]
    values += [1 / a, 2 * a, a**2, -a, a + b, a - b, a * b, a / b, a**3, k**1.5, 2.5**a]
    values += [ca.fabs(a) ** b, ca.fabs(a) ** 2.5, ca.atan2(a, b), ca.atan2(a, 0.3), ca.atan2(0.3, b)]
    values += [ca.fmin(a, b), ca.fmax(a, b), ca.fmax(k, 0.1), ca.fmin(a, 0.2), ca.fmax(0.2, b), ca.fmin(k, a)]
    values += [a < b, a <= b, a == b, a != b, (a > 0) + (b > 0), (a > 0) - ca.logic_not(a > k)]
    values += [ca.if_else(ca.logic_and(a > 0, b > 0), 1e-6, -3.3), ca.if_else(ca.logic_or(a > k, k > 2), b, 0)]
    return [*values, ca.if_else(a, b, k)]
