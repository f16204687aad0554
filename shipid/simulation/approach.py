"""Approach of a manoeuvre: which commands drive and steer a ship, and its steady speed.

All results come from numerical evaluation of the vessel's equations, so they hold for any vessel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shipid.engine.casadi import evaluate_samples
from shipid.engine.integrate import Array, Method
from shipid.engine.rollout import rollout
from shipid.errors import DocumentError, ShipidError
from shipid.physics.helm import course_helmsman
from shipid.physics.signals import ACTUAL, SIGNALS, drive_scale, is_shaft, is_steering, neutral_value, signal_of
from shipid.units import GRAVITY
from shipid.vessel.dynamics import HELM, Dynamics, vessel_dynamics
from shipid.vessel.load import Vessel
from shipid.vessel.stability import bisect_root, service_shaft, straight_acceleration

PROBE_SHAFT, PROBE_HELM = 1.0, 0.1  # rev/s, rad: values at which the effect of commands is tested
FROUDE = 0.2  # of the service speed of a ship whose document gives none
NOTHING = 1e-12  # m/s^2, rad/s^2
CHUNK, LONGEST = 30.0, 3600.0  # s: interval of the check for a steady state, and longest approach of a small ship
PASSING = 200.0  # ship lengths: the longest approach of a large ship, whose speed settles over some 20
SETTLED = 1e-3  # m/s, rad/s: greatest change of a velocity over the last chunk, and greatest yaw rate
SLOW = 0.02  # s: the same in U^2 / L, for a large and slow ship: its speed is then right to about 1 %
STRAIGHT = 0.02  # rad in a ship length: a large and slow ship that turns less goes straight
CREEPING, AT_REST = 0.02, 1e-4  # Froude numbers: a ship below the second, or astern, is taken for one of the first
KEEPING = 0.35  # rad: greatest helm of the helmsman that holds the approach
LENGTH, FASTEST = 100.0, 100.0  # m, of a ship whose document does not say; m/s
REMEDY = 'let a helmsman hold the course (approach = "helmsman"), or start from rest (approach = "rest")'


@dataclass(frozen=True)
class Controls:
    """The effect of a vessel's commands; computed from the equations at first use.

    drives : shaft speeds and forces that push the vessel ahead; DocumentError where there is none.
    helm : angle command -> +1 or -1, the sign that turns the ship to starboard; angles without effect are left out;
        DocumentError where no angle turns the vessel.
    effects : the same two, empty where there is none: a ship under sail or water jets, one without a rudder.
    differential : whether no angle turns the vessel, but the difference of shafts that drive it does.
    """

    vessel: Vessel

    @property
    def commands(self) -> tuple[str, ...]:
        """Names of all commands of the vessel."""
        return vessel_dynamics(self.vessel).commands

    @property
    def drives(self) -> tuple[str, ...]:
        """Shaft speeds and forces that push the vessel ahead."""
        if not self._driving[0]:
            message = f"no command drives {self.vessel.name} ahead: a manoeuvre needs a shaft speed `n`, or a `force`"
            if self.commands:
                message += ", the kinds `turning` and `steps` of a [[truth.manoeuvre]] order each command by itself"
            raise DocumentError(message, file=self.vessel.file, path="thruster")
        return self._driving[0]

    @property
    def effects(self) -> tuple[tuple[str, ...], Mapping[str, float]]:
        """What `drives` and `helm` give, empty where there is none."""
        return self._driving[0], self._turning if self._driving[0] else {}

    @property
    def helm(self) -> Mapping[str, float]:
        """Angle command -> sign that turns the ship to starboard."""
        if self.drives and not self._turning:
            message = f"no angle turns {self.vessel.name}: a manoeuvre needs a rudder or an azimuth unit that does"
            if self.differential:
                message = (
                    "no rudder: the vessel steers by the difference of its drives; the kinds `turning` and `steps` of "
                    f"a [[truth.manoeuvre]] order each ({self.drives[0]}{'_rpm' if self.drive_unit == 'rpm' else ''})"
                )
            raise DocumentError(message, file=self.vessel.file, path="thruster")
        return self._turning

    @property
    def differential(self) -> bool:
        """Whether no angle turns the vessel, but the difference of two shafts that drive it ahead does."""
        return not self.effects[1] and {1.0, -1.0} <= set(self._driving[1])

    @property
    def drive_unit(self) -> str:
        """Unit in which a manoeuvre orders the drives: rpm, or N where all of them are forces."""
        return "rpm" if any(map(is_shaft, self.drives)) else SIGNALS[signal_of(self.drives[0])].read_in

    @cached_property
    def _driving(self) -> tuple[tuple[str, ...], tuple[float, ...]]:
        """Shaft speeds and forces that push the vessel ahead, if any, and the sides to which some turn it."""
        vessel = self.vessel
        idle = straight_acceleration(vessel, 0.0, {})  # at rest: at speed a slow shaft holds the ship back
        if not np.isfinite(idle).all():
            weather = ", ".join(vessel_dynamics(vessel).environment)
            zeros = f" and {weather} 0, as where none is given" if weather else ""
            message = f"the forces on {vessel.name} are not finite at rest, with commands neutral{zeros}"
            raise DocumentError(f"{message}: mend its terms or their numbers", file=vessel.file)
        ahead = {
            name: straight_acceleration(vessel, 0.0, {name: PROBE_SHAFT * drive_scale(name)})
            for name in self.commands
            if drive_scale(name)
        }
        drives = tuple(name for name, rates in ahead.items() if rates[0] - idle[0] > NOTHING)
        yaw = [ahead[name][2] - idle[2] for name in drives]
        return drives, tuple(float(np.sign(change)) for change in yaw if abs(change) > NOTHING)

    @cached_property
    def _turning(self) -> Mapping[str, float]:
        """Angle command -> sign that turns the ship to starboard, about its service speed.

        At another ratio of speed and shaft speed the polynomials of a screw, or a hull about that speed, may not hold.
        """
        speed = vessel_service_speed(self.vessel)
        n = service_shaft(self.vessel, speed)
        if n is None:  # nothing drives it so fast, or nothing holds it back
            n = PROBE_SHAFT
            speed = min(_balanced_speed(self.vessel, self.ahead(n)), speed)
        running = self.ahead(n)
        straight = straight_acceleration(self.vessel, speed, running)
        turned = {
            name: straight_acceleration(self.vessel, speed, {**running, name: PROBE_HELM})[2] - straight[2]
            for name in self.commands
            if is_steering(name)
        }
        return {name: float(np.sign(change)) for name, change in turned.items() if abs(change) > NOTHING}

    def ahead(self, n: float) -> dict[str, float]:
        """Every command on a straight course: what drives it at n (`drive_scale`), all else neutral."""
        return {name: n * drive_scale(name) if name in self.drives else neutral_value(name) for name in self.commands}

    def orders(self, n: Array, helm: Array) -> dict[str, Array]:
        """Every command (T,) from n [rev/s] (`drive_scale`) and helm angle [rad, > 0 to starboard], each (T,).

        With the helm amidships no angle need turn the ship: two screws that steer by their difference can stop it.
        """
        ordered = {name: n * drive_scale(name) for name in self.drives}
        ordered |= {name: sign * helm for name, sign in self.helm.items()} if helm.any() else {}
        return {name: ordered.get(name, np.full(len(n), neutral_value(name))) for name in self.commands}


def helm_effect(controls: Controls, n: float, u: float) -> float:
    """Yaw acceleration per helm angle [1/s^2] at shaft speed n [rev/s] and speed u [m/s]."""
    running = controls.ahead(n)
    turned = running | {name: sign * PROBE_HELM for name, sign in controls.helm.items()}
    yaw = [straight_acceleration(controls.vessel, u, orders)[2] for orders in (running, turned)]
    return float(yaw[1] - yaw[0]) / PROBE_HELM


def vessel_service_speed(vessel: Vessel) -> float:
    """Service speed U_0 of the document [m/s]; that of a Froude number of 0.2 if it gives none."""
    given = vessel.document.get("particulars", {}).get("U_0")
    return float(given or FROUDE * np.sqrt(GRAVITY * _length_or_usual(vessel)))


class NotStraight(ShipidError):
    """The ship does not go straight ahead with the helm amidships."""


@dataclass(frozen=True)
class Approach:
    """Steady straight motion of S samples.

    state, memory : name -> (S,), states, and actuator states. helm : angle command -> (S,) [rad] that holds the course.
    """

    state: dict[str, Array]
    memory: dict[str, Array]
    helm: dict[str, Array]


def steady_approach(
    controls: Controls, n: Array, *, step: float, method: Method, engine: str, held: bool = False
) -> Approach:
    """Steady straight motion in calm water at shaft speeds n (S,) [rev/s].

    Each sample is simulated from rest until no velocity changes by 0.001 m/s or rad/s in 30 s (large and slow ships: by
    0.02 s U^2 / L), with the helm amidships, or held on course by a helmsman. Position and heading are then set to 0.
    With the helm amidships it goes straight if it turns by less than 0.001 rad/s, and 0.02 rad in a ship length.

    ShipidError where it diverges; `NotStraight` where it is not steady after an hour or 200 ship lengths, or turns.
    """
    vessel, count, speeds, length = controls.vessel, len(n), n.tolist(), _length_or_usual(controls.vessel)
    helmsman = course_helmsman(controls.commands) if held else None
    model = vessel_dynamics(vessel, helmsman)
    names = (*model.state, *model.hidden)
    state = {name: np.zeros(count) for name in names}
    orders = controls.orders(n, np.full(count, KEEPING if held else 0.0))
    memory = {name: orders[name].copy() if name in orders else np.zeros(count) for name in model.memory}
    if held:
        memory |= {name: np.zeros(count) for name in memory if is_steering(name)}
        orders |= _course_inputs(controls, n)
    moving = np.arange(count)
    num_steps = max(round(CHUNK / step), 1)
    of_one, reached = np.sqrt(GRAVITY * length), np.array([_steady_speed(controls, shaft) for shaft in speeds])
    reached = np.where(reached < AT_REST * of_one, CREEPING * of_one, reached)
    longest = max(LONGEST, *(PASSING * length / reached))
    settled = np.minimum(SETTLED, SLOW * reached**2 / length)
    for _ in range(int(longest / CHUNK)):
        path = rollout(
            vessel,
            {name: values[moving] for name, values in state.items()},
            {name: values[moving] for name, values in orders.items()},
            {name: np.zeros(len(moving)) for name in model.environment},
            step=step,
            num_steps=num_steps,
            every=num_steps,
            method=method,
            memory={name: values[moving] for name, values in memory.items()},
            helmsman=helmsman,
            engine=engine,
        )
        if path.diverged.any():
            raise ShipidError(
                f"the approach of {vessel.name} at {_order_words(controls, n[moving], path.diverged[0])} diverges: "
                f"take a smaller step than {step:g} s"
            )
        velocities = model.state[model.num_dof :]
        changes = [np.abs(path[name][-1, 0] - state[name][moving]) for name in velocities]
        unsettled = np.max(changes, axis=0) >= settled[moving]
        if held:  # on course, too: a slow integral part changes the velocities little
            unsettled |= np.abs(path["psi"][-1, 0]) >= SETTLED
        for name in names:
            state[name][moving] = path[name][-1, 0]
        for name, values in memory.items():
            values[moving] = path[f"{ACTUAL}{name}"][-1, 0]
        moving = moving[unsettled]  # steady samples are frozen: no result may depend on the other samples
        if not len(moving):
            if not held:
                straight = np.minimum(SETTLED, STRAIGHT * reached / length)
                turning = np.abs(state["r"]) >= straight
                if turning.any():
                    raise NotStraight(
                        f"{vessel.name} turns with the helm amidships at {_order_words(controls, n, turning)}, so it "
                        f"has no straight approach: {REMEDY}"
                    )
            helm = _held_helm(controls, model, state, memory, orders) if held else {}
            anew = ("north", "east", "psi", *(name for name in model.hidden if name.startswith("waves.")))
            kept = {name: values for name, values in memory.items() if not name.startswith(f"{HELM}.")}
            return Approach(state | {name: np.zeros(count) for name in anew}, kept, helm)
    remedy = 'start from rest (approach = "rest")' if held else REMEDY
    ahead = f"straight ahead at {_order_words(controls, n[moving], moving >= 0)}"
    raise NotStraight(f"{vessel.name} is not steady after {longest:.0f} s {ahead}: {remedy}")


def _course_inputs(controls: Controls, n: Array) -> dict[str, Array]:
    """Inputs (S,) of the helmsman: course 0, natural frequency 2 U / L, and the effect of the helm at the speed U."""
    speeds = np.array([_steady_speed(controls, shaft) for shaft in n])
    effects = [KEEPING * helm_effect(controls, shaft, speed) for shaft, speed in zip(n, speeds, strict=True)]
    if min(effects) <= 0:
        raise ShipidError(
            f"the helm of {controls.vessel.name} does not turn it at {60 * n.min():g} {controls.drive_unit}"
        )
    return {
        "course": np.zeros(len(n)),
        "omega": 2 * speeds / _length_or_usual(controls.vessel),
        "effect": np.array(effects),
    }


def _length_or_usual(vessel: Vessel) -> float:
    """Length between perpendiculars [m], of a ship without one a usual length."""
    return vessel.length or LENGTH


def _steady_speed(controls: Controls, n: float) -> float:
    """Speed ahead [m/s] at which the surge acceleration is 0, at shaft speed n [rev/s] and helm amidships."""
    return _balanced_speed(controls.vessel, controls.ahead(n))


def _balanced_speed(vessel: Vessel, orders: Mapping[str, float]) -> float:
    """Speed ahead [m/s] at which the surge acceleration is 0 with these commands, the others neutral."""

    def shortfall(speed: float) -> float:
        return -float(straight_acceleration(vessel, speed, orders)[0])

    low, high = 0.0, 0.1
    while high < FASTEST and shortfall(high) < 0:
        low, high = high, 2 * high
    return bisect_root(shortfall, low, high, 30)


def _held_helm(
    controls: Controls,
    model: Dynamics,
    state: Mapping[str, Array],
    memory: Mapping[str, Array],
    orders: Mapping[str, Array],
) -> dict[str, Array]:
    """Angle command -> (S,) order [rad] that the helmsman gives in the steady state."""
    calm = [np.zeros(len(next(iter(state.values()))))] * len(model.environment)
    inputs = [
        [state[name] for name in (*model.state, *model.hidden)],
        [memory[name] for name in model.memory],
        [orders[name] for name in model.commands],
        calm,
    ]
    values = evaluate_samples(model, "orders", inputs, np.array(list(controls.vessel.parameters.values())))
    given = dict(zip(model.ordered, values, strict=True))
    return {name: given[name] for name in controls.helm}


def _order_words(controls: Controls, n: Array, faulty: NDArray[np.bool_]) -> str:
    return f"{60 * n[int(np.argmax(faulty))]:g} {controls.drive_unit}"
