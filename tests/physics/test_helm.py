"""Helmsmen's laws alone: what they order and remember, number by number."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics.helm import Helmsman, Unit, course_keeping, station_keeping, yaw_rate, zigzag
from shipid.physics.signals import steers

COMMANDS = ("port.n", "port.alpha", "rudder.delta")


def numbers(values: Any) -> dict[str, float]:
    return {name: float(ca.DM(value)) for name, value in values.items()}


def test_angles_steer_and_shafts_do_not() -> None:
    assert [steers(name) for name in COMMANDS] == [False, True, True]


@pytest.mark.parametrize("make", [zigzag, yaw_rate, course_keeping])
def test_one_helmsman_per_set_of_commands(make: Any) -> None:
    """One object, one compilation; he gets every command."""
    assert make(COMMANDS) is make(COMMANDS)
    assert make(COMMANDS) != make(COMMANDS[:2])
    assert dict(list(make(COMMANDS).inputs.items())[:3]) == dict(zip(COMMANDS, ("rev/s", "rad", "rad"), strict=True))


@pytest.mark.parametrize("first", [1, -1])
@pytest.mark.parametrize(
    ("turned", "side", "after"), [(0.1, 1, 1), (0.2, 1, -1), (0.3, 1, -1), (0.1, -1, -1), (-0.2, -1, 1)]
)
def test_zigzag_reverses_at_the_execute_heading(first: int, turned: float, side: int, after: int) -> None:
    """With execute heading 0.2 rad either side of a heading of 1 rad; the mirror image does the mirror image."""
    inputs = {"port.n": 2.0, "port.alpha": -0.3 * first, "rudder.delta": 0.4 * first, "executed": 1.0}
    inputs["execute_heading"] = 0.2 * first
    seen = {"psi": ca.DM(1.0 + turned * first * 1.0000001)}
    memory = {"side": ca.DM(side), "original": ca.DM(1.0), "executed": ca.DM(1.0)}
    helmsman = zigzag(COMMANDS)
    ordered = numbers(helmsman.orders(seen, inputs, memory))
    assert ordered == {"port.n": 2.0, "port.alpha": -0.3 * first * after, "rudder.delta": 0.4 * first * after}
    assert helmsman.advance is not None
    assert numbers(helmsman.advance(seen, inputs, memory, 0.1)) == {"side": after, "original": 1.0, "executed": 1.0}


@pytest.mark.parametrize("psi", [-0.7, 0.0, 0.7])
def test_zigzag_counts_from_the_heading_at_the_first_order(psi: float) -> None:
    """However far wind has turned her before: nothing is reversed then, and the heading is kept from the order on."""
    helmsman, seen = zigzag(COMMANDS), {"psi": ca.DM(psi)}
    inputs = {"port.n": 2.0, "port.alpha": -0.3, "rudder.delta": 0.4, "execute_heading": 0.2}
    memory = {name: ca.DM(value) for name, value in helmsman.memory.items()}
    assert helmsman.advance is not None
    for executed in (0.0, 1.0):
        assert numbers(helmsman.orders(seen, inputs | {"executed": executed}, memory))["rudder.delta"] == 0.4
        after = numbers(helmsman.advance(seen, inputs | {"executed": executed}, memory, 0.1))
        assert after == {"side": 1.0, "original": psi, "executed": executed}


def test_yaw_rate_law() -> None:
    inputs = {"port.n": 2.0, "port.alpha": -0.5, "rudder.delta": 0.6, "rate": 0.03, "gain": 10.0, "reset": 4.0}
    helmsman = yaw_rate(COMMANDS)
    assert helmsman.advance is not None
    ordered = numbers(helmsman.orders({"r": 0.01}, inputs, {"integral": 0.1}))
    assert ordered == pytest.approx({"port.n": 2.0, "port.alpha": -0.5 * 0.3, "rudder.delta": 0.6 * 0.3})
    after = numbers(helmsman.advance({"r": 0.01}, inputs, {"integral": 0.1}, 0.2))
    assert after["integral"] == pytest.approx(0.1 + 10 / 4 * 0.02 * 0.2)
    hard_over = numbers(helmsman.orders({"r": 1.0}, inputs, {"integral": 0.9}))
    assert hard_over["port.alpha"] == 0.5
    assert numbers(helmsman.advance({"r": 9.0}, inputs, {"integral": 0.9}, 9.0)) == {"integral": -1.0}


def test_course_keeping_is_the_pid_law_of_its_frequency() -> None:
    """A ship r' = effect s with the helm share s: the error has the roots of (p + omega)^2 p + omega^3 / 10."""
    omega, effect, step = 0.2, 0.05, 0.05
    inputs = {"port.n": 2.0, "port.alpha": -0.5, "rudder.delta": 0.6, "course": 6.2, "omega": omega, "effect": effect}
    helmsman = course_keeping(COMMANDS)
    assert helmsman.advance is not None
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


UNITS = (
    Unit("port", (50.0, 0.0, -40.0), (0.0, 50.0, 3.0), (0.0, 1.0)),
    Unit("starboard", (50.0, 0.0, 40.0), (0.0, 50.0, 3.0), (0.0, -1.0)),
)
ORDERS = {"north": 3.0, "east": 4.0, "heading": 0.5, "omega": 0.1, "n_bias": 1.0, "n_max": 3.0}


def holding() -> Helmsman:
    return station_keeping(UNITS, ("bow.n",))


def thrusts(seen: dict[str, float], **changes: float) -> np.ndarray:
    """n^2 (cos, sin) of each unit, (units, 2)."""
    forces = numbers(holding().orders(seen, {**ORDERS, **changes}, dict.fromkeys(("north", "east", "heading"), 0.0)))
    assert forces.pop("bow.n") == 0.0
    polar = [(forces[f"{unit.name}.n"] ** 2, forces[f"{unit.name}.alpha"]) for unit in UNITS]
    return np.array([[square * np.cos(angle), square * np.sin(angle)] for square, angle in polar])


def at(**changes: float) -> dict[str, float]:
    return {"north": 3.0, "east": 4.0, "psi": 0.5, "u": 0.0, "v": 0.0, "r": 0.0} | changes


def test_on_station_only_the_bias_remains() -> None:
    np.testing.assert_allclose(thrusts(at()), [[0, 1], [0, -1]], atol=1e-6)


def test_an_error_is_turned_into_body_axes_and_shared() -> None:
    """2 m to the north of the ship, seen from heading 0.5 rad: ahead and to port."""
    acceleration = 0.1**2 * 2 * np.array([np.cos(0.5), -np.sin(0.5)])
    shared = 50 * acceleration + np.array([[0, 1], [0, -1]])
    np.testing.assert_allclose(thrusts(at(north=1.0)), shared, atol=1e-6)


@pytest.mark.parametrize("bias", np.linspace(-3.0, 3.0, 7))
def test_a_unit_may_have_its_bias_in_any_direction(bias: float) -> None:
    """What is wanted and the bias n^2 in its direction, and the jump of the angle opposite to it."""
    units = tuple(Unit(unit.name, unit.along, unit.across, (np.cos(bias), np.sin(bias))) for unit in UNITS)
    still = dict.fromkeys(("north", "east", "heading"), 0.0)
    ordered = numbers(station_keeping(units, ()).orders(at(north=1.0), {**ORDERS, "n_bias": 1.2}, still))
    wanted = 50 * 0.1**2 * 2 * np.exp(-0.5j) + 1.2**2 * np.exp(1j * bias)
    for unit in UNITS:
        assert ordered[f"{unit.name}.n"] ** 2 * np.exp(1j * ordered[f"{unit.name}.alpha"]) == pytest.approx(wanted)
        assert abs(ordered[f"{unit.name}.alpha"] - bias) <= np.pi


def test_speed_is_damped_and_heading_takes_the_short_way() -> None:
    np.testing.assert_allclose(thrusts(at(u=0.2))[:, 0], [-50 * 2 * 0.1 * 0.2] * 2, atol=1e-6)
    short = thrusts(at(psi=3.0), heading=-3.0)  # 0.28 rad to starboard: the port unit pushes less than its bias astern
    np.testing.assert_allclose(short[0, 0], -40 * 0.1**2 * (2 * np.pi - 6.0), atol=1e-6)


def test_an_error_that_lasts_counts_by_its_integral() -> None:
    """omega^2 (e + omega / 10 integral(e)): 5 m s to the north count as 0.05 m."""
    lasting = {"north": 5.0, "east": 0.0, "heading": 0.0}
    held = numbers(holding().orders(at(), ORDERS, lasting))
    known = numbers(holding().orders(at(north=3.0 - 0.05), ORDERS, dict.fromkeys(lasting, 0.0)))
    assert held == pytest.approx(known)
    assert held["port.alpha"] != pytest.approx(np.pi / 2, abs=1e-3)


def test_a_unit_keeps_to_its_greatest_speed() -> None:
    far = numbers(holding().orders(at(north=-1e4), ORDERS, dict.fromkeys(("north", "east", "heading"), 0.0)))
    assert far["port.n"] == far["starboard.n"] == 3.0


def test_the_angle_is_continuous_through_zero_thrust_on_the_bias_side() -> None:
    """From one side of the bias to the other; the jump lies opposite the bias."""
    angles = [
        numbers(holding().orders(at(u=u), ORDERS, dict.fromkeys(("north", "east", "heading"), 0.0)))["port.alpha"]
        for u in np.linspace(-1, 1, 201)
    ]
    assert np.abs(np.diff(angles)).max() < 0.2
    assert min(angles) < 0.2
    assert max(angles) > np.pi - 0.2


def test_memory_integrates_the_error() -> None:
    helmsman = holding()
    assert helmsman.advance is not None
    after = numbers(helmsman.advance(at(north=1.0), ORDERS, {"north": 0.5, "east": 0.0, "heading": 0.0}, 0.1))
    assert after == pytest.approx({"north": 0.7, "east": 0.0, "heading": 0.0})
