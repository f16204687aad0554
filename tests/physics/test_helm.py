"""Helmsmen's laws alone: what they order and remember, number by number."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics.helm import course_helmsman

COMMANDS = ("port.n", "port.alpha", "rudder.delta")


def numbers(values: Any) -> dict[str, float]:
    return {name: float(ca.DM(value)) for name, value in values.items()}


def test_course_keeping_is_the_pid_law_of_its_frequency() -> None:
    """A ship r' = effect s with the helm share s: the error has the roots of (p + omega)^2 p + omega^3 / 10."""
    omega, effect, step = 0.2, 0.05, 0.05
    inputs = {"port.n": 2.0, "port.alpha": -0.5, "rudder.delta": 0.6, "course": 6.2, "omega": omega, "effect": effect}
    helmsman = course_helmsman(COMMANDS)
    seen, memory = {name: ca.SX.sym(name) for name in ("psi", "r")}, {"integral": ca.SX.sym("integral")}
    ordered = helmsman.orders(seen, inputs, memory)
    assert ordered["port.n"] == 2.0
    after = [*(ordered[name] for name in COMMANDS[1:]), helmsman.advance(seen, inputs, memory, step)["integral"]]
    law = ca.Function("law", [*seen.values(), *memory.values()], after)
    psi, r, integral, path = 0.0, 0.0, 0.0, []  # 0.083 rad to port is the short way
    for _ in range(800):
        alpha, delta, integral = map(float, law(psi, r, integral))
        assert alpha / -0.5 == pytest.approx(delta / 0.6)
        r += step * effect * delta / 0.6
        psi += step * r
        path.append(psi)
    t = step * np.arange(1, 801)
    roots = np.roots([1, 2 * omega, omega**2, omega**3 / 10])
    start = np.vander(roots, 3, increasing=True).T  # error, its rate and acceleration at first
    error = 6.2 - 2 * np.pi
    shares = np.linalg.solve(start, [error, 0, -(omega**2) * error])
    expected = error - (np.exp(np.outer(t, roots)) @ shares).real
    np.testing.assert_allclose(path, expected, atol=0.02 * abs(error))
    still = dict.fromkeys(("psi", "r"), 0.0)
    for sign in (1, -1):
        hard = {**inputs, "course": sign * 3.0, "effect": 1e-3}
        assert numbers(helmsman.orders(still, hard, {"integral": 0.0}))["rudder.delta"] == sign * 0.6
        assert numbers(helmsman.advance(still, hard, {"integral": 0.0}, 1e3)) == {"integral": sign}
