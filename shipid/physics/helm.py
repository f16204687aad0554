"""Who gives the orders when the clock does not: helmsmen's laws as symbols, so that they lower and batch."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import casadi as ca
from casadi import SX

from shipid.physics.signals import steers, units

DAMPING = 1.0  # of station keeping: critical
INTEGRAL = 0.1  # of station keeping: integral gain over omega x proportional gain (Fossen 2021, sec. 15.3)
SMALL = 1e-9  # (rev/s)^4: below it a thrust has no direction

Named = Mapping[str, Any]


@dataclass(frozen=True, eq=False)  # one helmsman, one compilation
class Helmsman:
    """A law that turns what it is told (per sample) and what it sees (the ship's state) into orders.

    inputs : name -> unit of what it is told: they take the place of the vessel's commands in a rollout.
    memory : name -> value at the start, of what it remembers from step to step.
    orders : (signals, told, memory) -> order by command (`port.n`) or, for all that have it, by signal (`n`, `alpha`,
        `delta`); each argument maps names to scalars; `signals` are the states, by name.
    advance : (signals, told, memory, dt) -> memory after dt, by name.
    """

    name: str
    inputs: Mapping[str, str]
    memory: Mapping[str, float] = field(default_factory=dict)
    orders: Callable[[Named, Named, Named], Named] = field(kw_only=True)
    advance: Callable[[Named, Named, Named, Any], Named] | None = field(default=None, kw_only=True)


@lru_cache
def zigzag(commands: tuple[str, ...]) -> Helmsman:
    """Reverse the helm whenever the heading has changed from the course of approach by the execute heading.

    Told: each command as first executed; `course` of the approach [rad]; `execute_heading` [rad], the
    change of heading at which the helm is first reversed, > 0 to starboard. Remembers `side`: +1 as first executed,
    -1 reversed. An order is reversed in the first step that starts at or beyond the execute heading.
    """

    def side(signals: Named, told: Named, memory: Named) -> Any:
        turned = memory["side"] * (signals["psi"] - told["course"]) * told["execute_heading"]
        return ca.if_else(turned >= told["execute_heading"] ** 2, -memory["side"], memory["side"])

    def orders(signals: Named, told: Named, memory: Named) -> Named:
        now = side(signals, told, memory)
        return {name: told[name] * now if steers(name) else told[name] for name in commands}

    return Helmsman(
        "zigzag",
        {**units(commands), "course": "rad", "execute_heading": "rad"},
        {"side": 1.0},
        orders=orders,
        advance=lambda signals, told, memory, _dt: {"side": side(signals, told, memory)},
    )


@lru_cache
def yaw_rate(commands: tuple[str, ...]) -> Helmsman:
    """Steer to a yaw rate: the share of the greatest helm is s = I + gain (rate - r), limited to -1..1.

    dI/dt = gain / reset (rate - r), I limited to -1..1. Told: each command with the greatest helm to starboard; `rate`
    [rad/s]; `gain` [s]; `reset` [s].
    """

    def share(signals: Named, told: Named, memory: Named) -> SX:
        return _limit(memory["integral"] + told["gain"] * (told["rate"] - signals["r"]))

    def orders(signals: Named, told: Named, memory: Named) -> Named:
        now = share(signals, told, memory)
        return {name: told[name] * now if steers(name) else told[name] for name in commands}

    def advance(signals: Named, told: Named, memory: Named, dt: Any) -> Named:
        gained = told["gain"] / told["reset"] * (told["rate"] - signals["r"]) * dt
        return {"integral": _limit(memory["integral"] + gained)}

    inputs = {**units(commands), "rate": "rad/s", "gain": "s", "reset": "s"}
    return Helmsman("yaw rate", inputs, {"integral": 0.0}, orders=orders, advance=advance)


def _limit(share: SX) -> SX:
    return ca.fmin(ca.fmax(share, -1), 1)


@dataclass(frozen=True)
class Unit:
    """An azimuth unit as station keeping uses it, its thrust taken as n^2 (cos alpha, sin alpha) times a constant.

    along, across : n^2 cos(alpha) and n^2 sin(alpha) [rev^2/s^2] per acceleration (surge, sway, yaw) asked for.
    bias : direction (along, across) of the thrust by which the units push against each other.
    """

    name: str
    along: tuple[float, float, float]
    across: tuple[float, float, float]
    bias: tuple[float, float]


@lru_cache
def station_keeping(units: tuple[Unit, ...], idle: tuple[str, ...]) -> Helmsman:
    """Hold a position and a heading: a PID law on acceleration, shared out to azimuth units; `idle` commands stay 0.

    a = omega^2 (e + omega / 10 integral(e)) - 2 omega nu, e the error of position and heading in body axes. Told:
    `north`, `east` [m], `heading` [rad] to hold; `omega` [rad/s], the natural frequency; `n_bias` [rev/s], at which the
    units push against each other so that a change of thrust turns none of them round; `n_max` [rev/s].
    """

    def error(signals: Named, told: Named) -> tuple[SX, SX, SX]:
        turn = told["heading"] - signals["psi"]
        wrapped = ca.atan2(ca.sin(turn), ca.cos(turn))
        return told["north"] - signals["north"], told["east"] - signals["east"], wrapped

    def orders(signals: Named, told: Named, memory: Named) -> Named:
        omega, c, s = told["omega"], ca.cos(signals["psi"]), ca.sin(signals["psi"])
        now = zip(error(signals, told), ("north", "east", "heading"), strict=True)
        north, east, yaw = (omega**2 * (e + INTEGRAL * omega * memory[name]) for e, name in now)
        asked = (c * north + s * east, c * east - s * north, yaw)
        damped = [a - 2 * DAMPING * omega * signals[name] for a, name in zip(asked, "uvr", strict=True)]
        found: dict[str, Any] = dict.fromkeys(idle, 0.0)
        for unit in units:
            n, alpha = _thrust(unit, damped, told)
            found |= {f"{unit.name}.n": n, f"{unit.name}.alpha": alpha}
        return found

    def advance(signals: Named, told: Named, memory: Named, dt: Any) -> Named:
        now = error(signals, told)
        return {name: value + e * dt for (name, value), e in zip(memory.items(), now, strict=True)}

    inputs = {"north": "m", "east": "m", "heading": "rad", "omega": "rad/s", "n_bias": "rev/s", "n_max": "rev/s"}
    memory = {"north": 0.0, "east": 0.0, "heading": 0.0}
    return Helmsman("station keeping", inputs, memory, orders=orders, advance=advance)


def _thrust(unit: Unit, acceleration: list[SX], told: Named) -> tuple[SX, SX]:
    """Shaft speed and angle of a unit; the angle is counted from the bias, where it is continuous all round but aft."""
    along = (
        sum(share * a for share, a in zip(unit.along, acceleration, strict=True)) + unit.bias[0] * told["n_bias"] ** 2
    )
    across = (
        sum(share * a for share, a in zip(unit.across, acceleration, strict=True)) + unit.bias[1] * told["n_bias"] ** 2
    )
    b_x, b_y = unit.bias
    with_bias, off_bias = b_x * along + b_y * across, b_x * across - b_y * along
    square = along**2 + across**2
    turned = ca.atan2(off_bias, ca.if_else(square < SMALL, 1, with_bias))
    return ca.fmin((square + SMALL) ** 0.25, told["n_max"]), ca.atan2(b_y, b_x) + turned
