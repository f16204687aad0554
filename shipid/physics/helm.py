"""Helmsmen: control laws that give the orders from the ship's state, as symbolic functions for all engines."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from shipid.physics import symbols as ca
from shipid.physics.frames import SX
from shipid.physics.signals import is_steering, signal_units

DAMPING = 1.0  # of course keeping: critical
INTEGRAL = 0.1  # of course keeping: integral gain over omega x proportional gain (Fossen 2021, sec. 15.3)

Named = Mapping[str, Any]


@dataclass(frozen=True, eq=False)  # one helmsman, one compilation
class Helmsman:
    """A control law from inputs (for each sample) and the ship's state to orders.

    inputs : name -> unit; the inputs take the place of the vessel's commands in a rollout.
    memory : name -> initial value of each state of the control law.
    orders : (signals, inputs, memory) -> order of each command (`port.n`), or of all commands of a signal (`n`,
        `alpha`, `delta`). Each argument maps names to scalars; `signals` are the states of the ship.
    advance : (signals, inputs, memory, dt) -> memory after dt [s], by name.
    """

    name: str
    inputs: Mapping[str, str]
    memory: Mapping[str, float] = field(default_factory=dict)
    orders: Callable[[Named, Named, Named], Named] = field(kw_only=True)
    advance: Callable[[Named, Named, Named, Any], Named] | None = field(default=None, kw_only=True)


@lru_cache
def zigzag_helmsman(commands: tuple[str, ...]) -> Helmsman:
    """Zigzag: reverse the helm when the heading has changed from the original heading by the execute heading.

    The original heading is that at the first order (MSC.137(76), 4.2.6). Inputs: each command as first executed;
    `executed`, 1 from the first order on; `execute_heading` [rad], > 0 where the first turn is to starboard. Memory:
    `side`, +1 as first executed, -1 reversed; `executed`; `original` [rad]. Reversed in the first step that starts
    at or beyond the execute heading.
    """

    def original(signals: Named, memory: Named) -> Any:
        return ca.if_else(memory["executed"] > 0, memory["original"], signals["psi"])

    def side(signals: Named, inputs: Named, memory: Named) -> Any:
        turned = memory["side"] * (signals["psi"] - original(signals, memory)) * inputs["execute_heading"]
        return ca.if_else(turned >= inputs["execute_heading"] ** 2, -memory["side"], memory["side"])

    def orders(signals: Named, inputs: Named, memory: Named) -> Named:
        return _steer_commands(commands, inputs, side(signals, inputs, memory))

    def advance(signals: Named, inputs: Named, memory: Named, _dt: Any) -> Named:
        now = {"original": original(signals, memory), "executed": inputs["executed"]}
        return {"side": side(signals, inputs, memory), **now}

    inputs = {**signal_units(commands), "executed": "-", "execute_heading": "rad"}
    memory = {"side": 1.0, "original": 0.0, "executed": 0.0}
    return Helmsman("zigzag", inputs, memory, orders=orders, advance=advance)


@lru_cache
def course_helmsman(commands: tuple[str, ...]) -> Helmsman:
    """PID control of the heading: share of the largest helm s = I + (omega^2 e - 2 omega r) / effect, e the error.

    dI/dt = omega^3 / 10 e / effect; s and I limited to -1..1. Inputs: each command with the largest helm to starboard;
    `course` [rad]; `omega` [rad/s], the natural frequency; `effect` [rad/s^2], yaw acceleration by the largest helm.
    """

    def error(signals: Named, inputs: Named) -> SX:
        off = inputs["course"] - signals["psi"]
        return ca.SX(ca.atan2(ca.sin(off), ca.cos(off)))

    def orders(signals: Named, inputs: Named, memory: Named) -> Named:
        omega = inputs["omega"]
        asked = omega**2 * error(signals, inputs) - 2 * DAMPING * omega * signals["r"]
        return _steer_commands(commands, inputs, _limit_share(memory["integral"] + asked / inputs["effect"]))

    def advance(signals: Named, inputs: Named, memory: Named, dt: Any) -> Named:
        gained = INTEGRAL * inputs["omega"] ** 3 * error(signals, inputs) / inputs["effect"] * dt
        return {"integral": _limit_share(memory["integral"] + gained)}

    inputs = {**signal_units(commands), "course": "rad", "omega": "rad/s", "effect": "rad/s^2"}
    return Helmsman("course keeping", inputs, {"integral": 0.0}, orders=orders, advance=advance)


def _limit_share(share: SX) -> SX:
    return ca.fmin(ca.fmax(share, -1), 1)


def _steer_commands(commands: Iterable[str], inputs: Named, share: SX) -> Named:
    """Order of each command: what it has with the largest helm, angles that steer times the share of that helm."""
    return {name: inputs[name] * share if is_steering(name) else inputs[name] for name in commands}
