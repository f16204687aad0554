"""Inputs of a predictor at an instant as symbols of a graph, and what physics and memory compute from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
from casadi import SX

from shipid.engine.rollout import SPEED_LIMIT
from shipid.export.blocks import Graph, Value, formula
from shipid.export.equations import Equations, rollout
from shipid.hybrid.features import MOTIONS, PARTS, Inputs, steps_of
from shipid.hybrid.physics import Physics
from shipid.observer import COLUMNS, LOW, bank, moves_start
from shipid.physics.signals import plain_inputs

SX_of = Mapping[str, SX]
TRACE = 1e-12  # m/s: of a wind that is exactly 0, so that its direction is defined


@dataclass(frozen=True)
class Layout:
    """Names of the entries of each input of a predictor, in order.

    now : measured at the instant. reached : actuators that lag behind their orders. past : entries of each of
    `num_past` rows, the oldest first, 1 ... num_past steps before the instant; x, y are positions in the frame of the
    instant. planned : commands of each of `horizon` rows. estimates : of the observer. parameters : dotted paths.
    """

    now: tuple[str, ...]
    reached: tuple[str, ...]
    past: tuple[str, ...]
    num_past: int
    planned: tuple[str, ...]
    horizon: int
    estimates: tuple[str, ...]
    parameters: tuple[str, ...]
    commands: tuple[str, ...]

    def before(self, steps: int) -> int:
        """Row of the past so many steps before the instant; IndexError where the past is shorter."""
        if steps > self.num_past:
            raise IndexError(f"{steps} steps of the past are taken, of {self.num_past}")
        return self.num_past - steps

    @property
    def sizes(self) -> dict[str, int]:
        """Entries of each input."""
        return {
            "now": len(self.now),
            "reached": len(self.reached),
            "past": self.num_past * len(self.past),
            "planned": self.horizon * len(self.planned),
            "estimates": len(self.estimates),
            "parameters": len(self.parameters),
        }


def layout(
    physics: Physics,
    commands: Sequence[str],
    num_past: int,
    *,
    known: bool,
    environment: Sequence[str],
    limited: Sequence[str] = (),
) -> Layout:
    """Inputs that a predictor takes.

    physics : with all terms, also those of a method. commands : that a method takes. environment : channels that
    it takes. limited : columns that the alarm looks at.
    """
    vessel = physics.vessel
    states: list[str] = []
    memory: tuple[str, ...] = ()
    taken: tuple[str, ...] = ()
    weather: tuple[str, ...] = ()
    if vessel is not None:
        model = Equations(vessel).model
        states = [name for name in model.state if name not in ("north", "east", "psi", *MOTIONS)]
        memory, taken, weather = tuple(model.memory), model.commands, model.environment
    place = ("north", "east") if physics.observer is not None and physics.path == "position" else ()
    every = tuple(dict.fromkeys((*taken, *commands)))
    channels = tuple(dict.fromkeys((*weather, *environment)))
    others = dict.fromkeys(limited)
    channels += tuple(name for name in others if name not in (*MOTIONS, *every, *channels))
    now = (*place, "psi", *MOTIONS, *states, *every, *channels)
    past = tuple(name for name in now if name not in place)
    return Layout(
        now=now,
        reached=memory,
        past=(*past, "x", "y") if num_past else (),
        num_past=num_past,
        planned=every if known else (),
        horizon=physics.horizon,
        estimates=tuple(f"observer.{name}" for name in COLUMNS) if physics.observer is not None else (),
        parameters=() if vessel is None else tuple(vessel.parameters),
        commands=every,
    )


@dataclass
class Known:
    """Inputs of the graph of a predictor.

    physics : as in the predictor; its vessel is that of `equations`, with the terms of a method.
    """

    physics: Physics
    names: Layout
    graph: Graph = field(default_factory=lambda: Graph("predict"))
    values: dict[str, Value] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, size in self.names.sizes.items():
            self.values[name] = self.graph.input(name, size)

    @cached_property
    def equations(self) -> Equations:
        """Equations of the physics."""
        assert self.physics.vessel is not None
        return Equations(self.physics.vessel)

    def of(self, group: str, names: Sequence[str], row: int | None = None) -> Value:
        """Entries of an input by name, those that it does not hold are 0; `row` of the past or the plan."""
        every = getattr(self.names, group)
        first = 0 if row is None else row * len(every)
        value, zero = self.values[group], None
        parts = []
        for name in names:
            if name in every:
                parts.append(value[first + every.index(name)])
            else:
                zero = zero or self.graph.constant([0.0])
                parts.append(zero)
        return self.graph.pack(*parts) if parts else value[0:0]

    def rows(self, group: str, names: Sequence[str], first: int, count: int) -> Value:
        """Entries `names` of `count` rows of the past or of the plan, concatenated; 0 where a row lacks one."""
        parts = [self.of(group, names, row) for row in range(first, first + count)]
        return self.graph.pack(*parts) if names else self.values[group][0:0]

    def commands(self, names: Sequence[str]) -> tuple[Value, bool]:
        """Commands over the horizon, and whether they have a row for each step."""
        if self.names.planned:
            return self.rows("planned", names, 0, self.names.horizon), True
        return self.of("now", names), False

    def start(self, group: str = "now", row: int | None = None) -> Value:
        """State of the vessel, measured, in the frame (11) but for the heading; hidden states of terms are 0."""
        model = self.equations.model
        names = [name if name not in ("north", "east") else "" for name in (*model.state, *model.hidden)]
        state = self.of(group, names, row)
        return self.graph.call(self.equations.aboard, state) if self.equations.leans else state

    @cached_property
    def records(self) -> tuple[Value, Value | None]:
        """Carries of the physics after each step, and the drift of the water (2,) where there is an observer."""
        graph, equations, physics = self.graph, self.equations, self.physics
        model = equations.model
        if physics.observer is None:
            return self.measured_records, None
        begun, environment, drift, tau = self._observed()
        step = equations.step(physics.integrator, physics.step)
        series = {
            "commands": self.commands(model.commands),
            "environment": (environment, False),
            "tau_extra": (tau, True),
        }
        carry = graph.pack(begun, self.values["reached"])
        return rollout(graph, step, carry, series, self.values["parameters"], physics.horizon), drift

    @cached_property
    def measured_records(self) -> Value:
        """Carries of the physics after each step from the measured state, without an observer."""
        graph, equations, physics = self.graph, self.equations, self.physics
        model = equations.model
        step = equations.step(physics.integrator, physics.step)
        series = {
            "commands": self.commands(model.commands),
            "environment": (self.of("now", model.environment), False),
            "tau_extra": (graph.constant(np.zeros(model.num_dof)), False),
        }
        carry = graph.pack(self.start(), self.values["reached"])
        return rollout(graph, step, carry, series, self.values["parameters"], physics.horizon)

    def _observed(self) -> tuple[Value, Value, Value, Value]:
        """State, environment, drift and slow force over the horizon, as `shipid.observer.observed_start`."""
        graph, physics, model = self.graph, self.physics, self.equations.model
        assert physics.vessel is not None
        filters = bank(physics.vessel, physics.observer)
        names, estimates = SX.sym("now", len(self.names.now)), SX.sym("estimates", len(COLUMNS))
        now = dict(zip(self.names.now, ca.vertsplit(names), strict=True))
        seen = dict(zip(COLUMNS, ca.vertsplit(estimates), strict=True))
        north, east, psi = seen["current_north"], seen["current_east"], seen["psi"]
        place = [SX(0), SX(0)]
        if moves_start(filters.settings, physics.path):
            place = [seen["north"] - now["north"], seen["east"] - now["east"]]
        u = seen["u"] - north * ca.cos(psi) - east * ca.sin(psi)
        v = seen["v"] + north * ca.sin(psi) - east * ca.cos(psi)
        begun = formula("observed", [("now", names), ("estimates", estimates)], [*place, psi, u, v, seen["r"]])
        state = graph.call(begun, self.values["now"], self.values["estimates"])
        weather = {name: now[name] for name in model.environment}
        if "V_w" in weather:
            ahead = weather["V_w"] * ca.cos(weather["beta_w"]) - north
            across = weather["V_w"] * ca.sin(weather["beta_w"]) - east
            weather |= dict(zip(("V_w", "beta_w"), _polar(ahead, across), strict=True))
        weather |= {name: SX(0) for name in ("V_c", "beta_c") if name in weather}
        environment = self.values["now"][0:0]
        if weather:
            relative = formula("relative", [("now", names), ("estimates", estimates)], list(weather.values()))
            environment = graph.call(relative, self.values["now"], self.values["estimates"])
        ages = (np.arange(physics.horizon) + 0.5) * physics.step
        faded = np.exp(-ages / filters.fade) if filters.fade > 0 else np.zeros(physics.horizon)
        fade = SX.sym("fade")
        force = ca.DM(filters.mass) @ ca.vertcat(*(seen[name] for name in "XYN"))
        slow = formula("slow", [("fade", fade), ("estimates", estimates)], fade * force)
        tau = graph.map(slow, [graph.constant(faded)], [self.values["estimates"]], physics.horizon)
        assert len(COLUMNS) == LOW
        drift = self.values["estimates"][COLUMNS.index("current_north") : COLUMNS.index("current_east") + 1]
        return state, environment, drift, tau

    @cached_property
    def path(self) -> Value:
        """Path (T, 2) of the physics alone, row by row; zeros without physics."""
        graph, horizon = self.graph, self.names.horizon
        if self.physics.vessel is None:
            return graph.constant(np.zeros((horizon, 2)))
        records, drift = self.records
        carry, psi = SX.sym("carry", self.equations.num_carry), SX.sym("psi")
        age, water = SX.sym("age"), SX.sym("drift", 2 if drift is not None else 0)
        north, east = carry[0], carry[1]
        if drift is not None:
            north, east = north + age * water[0], east + age * water[1]
        c, s = ca.cos(psi), ca.sin(psi)
        slow = SX.sym("slow")
        frame = formula(
            "frame",
            [("carry", carry), ("age", age), ("psi", psi), ("drift", water), ("slow", slow)],
            [ca.if_else(slow, place, np.nan) for place in (c * north + s * east, c * east - s * north)],
        )
        ages = graph.constant(self.physics.step * np.arange(1, horizon + 1))
        fixed = [self.of("now", ["psi"]), drift if drift is not None else self.values["now"][0:0]]
        return graph.map(frame, [records, ages], [*fixed, self._slow(records, horizon)], horizon)

    def _slow(self, records: Value, count: int) -> Value:
        """1 while no velocity of some carries is above that of any ship; 0 for a rollout that Python says diverged."""
        carry, each = SX.sym("carry", self.equations.num_carry), SX.sym("fastest", count)
        speeds = ca.vertsplit(carry)[self.equations.model.num_dof : 2 * self.equations.model.num_dof]
        fastest = SX(0)
        for speed in speeds:
            fastest = ca.fmax(fastest, ca.fabs(speed))
        block = formula("fastest", [("carry", carry)], [fastest])
        slow = SX(1)
        for one in ca.vertsplit(each):
            slow = ca.logic_and(slow, one <= SPEED_LIMIT)
        return self.graph.call(
            formula("slow", [("fastest", each)], [slow]), self.graph.map(block, [records], [], count)
        )

    def past_error(self, seconds: float) -> Value:
        """x, y, u, v, r of `shipid.hybrid.features.past_error`."""
        graph, physics = self.graph, self.physics
        steps = steps_of(seconds, physics.step)
        first = self.names.before(steps)
        known = past_records(self, first, steps)
        carry, then = SX.sym("carry", self.equations.num_carry), SX.sym("then", 3)
        now = SX.sym("now", 4)
        places = self.equations.index(("north", "east"))
        x0, y0, psi_then = ca.vertsplit(then)
        turned = now[0] - psi_then
        # the present position in the frame of the start, and the predicted one
        c, s = ca.cos(-turned), ca.sin(-turned)
        here = c * (0 - x0) + s * (0 - y0), c * (0 - y0) - s * (0 - x0)
        c, s = ca.cos(psi_then), ca.sin(psi_then)
        north, east = carry[places["north"]], carry[places["east"]]
        dx, dy = here[0] - (c * north + s * east), here[1] - (c * east - s * north)
        c, s = ca.cos(turned), ca.sin(turned)
        errors = [c * dx + s * dy, c * dy - s * dx]
        errors += [now[1 + i] - motion for i, motion in enumerate(self.equations.horizontal(carry))]
        slow = SX.sym("slow")
        sound = ca.logic_and(finite(errors), slow)
        given = [("carry", carry), ("then", then), ("now", now), ("slow", slow)]
        block = formula("error", given, [ca.if_else(sound, e, 0) for e in errors])
        last = known[-self.equations.num_carry :] if known.size > self.equations.num_carry else known
        seen = self.of("past", ("x", "y", "psi"), first), self.of("now", ("psi", *MOTIONS))
        return graph.call(block, last, *seen, self._slow(known, steps))

    def table(self, inputs: Inputs, trajectory: Sequence[int] = ()) -> Table:
        """Every input that a method may take, see `shipid.hybrid.features.Inputs.table`.

        trajectory : steps of the horizon at which the physics is seen (calibrator).
        """
        return Table(self, inputs, tuple(trajectory))


def _polar(x: SX, y: SX) -> tuple[SX, SX]:
    """Length and direction of a vector, with finite derivatives where it has no length: a trace of it is ahead."""
    x += ca.if_else(x**2 + y**2 == 0, TRACE, 0)
    return ca.sqrt(x**2 + y**2), ca.atan2(y, x)


def past_records(known: Known, first: int, steps: int) -> Value:
    """Carries over `steps` past steps, from the measured state at row `first` of the past, actuators at their order."""
    graph, equations, physics = known.graph, known.equations, known.physics
    model = equations.model
    step = equations.step(physics.integrator, physics.step)
    series = {
        "commands": (known.rows("past", model.commands, first, steps), True),
        "environment": (known.of("past", model.environment, first), False),
        "tau_extra": (graph.constant(np.zeros(model.num_dof)), False),
    }
    reached = known.of("past", tuple(model.memory), first)
    carry = graph.pack(known.start("past", first), reached)
    return rollout(graph, step, carry, series, known.values["parameters"], steps)


def finite(values: Sequence[SX]) -> SX:
    """Whether all are finite: false for NaN, too."""
    sound: SX = SX(1)
    for value in values:
        sound = ca.logic_and(sound, ca.fabs(value) < np.inf)
    return sound


@dataclass
class Table:
    """Inputs of a method by name, as expressions of the inputs of the graph."""

    known: Known
    inputs: Inputs
    trajectory: tuple[int, ...]

    def values(self, names: Sequence[str]) -> Value:
        """Values of the inputs of a method, by their names and in this order."""
        known, layout_ = self.known, self.known.names
        groups = {name: SX.sym(name, size) for name, size in layout_.sizes.items() if name != "parameters"}
        given = {name: known.values[name] for name in groups}
        table = _at_instant(layout_, groups, self.inputs)
        table |= _history(layout_, groups, self.inputs, known.physics.step)
        if known.physics.vessel is not None:
            if self.inputs.memory.observer and known.physics.observer is not None:
                table |= _estimates(layout_, groups)
            for seconds in self.inputs.memory.error:
                label = f"error-{seconds:g}"
                wanted = [f"{label}.{name}" for name in ("x", "y", *MOTIONS)]
                if any(name in names for name in wanted):
                    symbol = SX.sym(f"error_{len(groups)}", 5)
                    groups[symbol[0].name()], given[symbol[0].name()] = symbol, known.past_error(seconds)
                    table |= dict(zip(wanted, ca.vertsplit(symbol), strict=True))
            if self.trajectory:
                symbol = SX.sym("trajectory", 5 * len(self.trajectory))
                groups["trajectory"], given["trajectory"] = symbol, self._trajectory()
                labels = [f"physics-{k * known.physics.step:g}" for k in self.trajectory]
                wanted = [f"{label}.{name}" for label in labels for name in ("x", "y", *MOTIONS)]
                table |= dict(zip(wanted, ca.vertsplit(symbol), strict=True))
        block = formula("inputs", list(groups.items()), [table[name] for name in names])
        return known.graph.call(block, *(given[name] for name in groups))

    def _trajectory(self) -> Value:
        """x, y, u, v, r of the physics at some steps; zeros where any step is not finite."""
        known, graph = self.known, self.known.graph
        records, _ = known.records
        size, horizon = known.equations.num_carry, known.names.horizon
        paths, carries = SX.sym("path", 2 * horizon), SX.sym("records", size * horizon)
        motions = [known.equations.horizontal(carries[size * k : size * (k + 1)]) for k in range(horizon)]
        sound = finite([*ca.vertsplit(paths), *(one for motion in motions for one in motion)])
        seen = []
        for k in self.trajectory:
            seen += [paths[2 * k - 2], paths[2 * k - 1], *motions[k - 1]]
        block = formula(
            "trajectory", [("path", paths), ("records", carries)], [ca.if_else(sound, one, 0) for one in seen]
        )
        return graph.call(block, known.path, records)


def _at_instant(names: Layout, groups: SX_of, inputs: Inputs) -> dict[str, SX]:
    now = dict(zip(names.now, ca.vertsplit(groups["now"]), strict=True))
    table = feature_table(now, inputs.commands)
    if names.planned:
        rows = ca.reshape(groups["planned"], len(names.planned), names.horizon)
        for name in inputs.commands:
            component, _, signal = name.rpartition(".")
            values = ca.horzsplit(rows[names.planned.index(name), :])
            parts = np.array_split(np.arange(names.horizon), min(PARTS, names.horizon))
            for number, part in enumerate(parts, start=1):
                mean = sum(values[int(k)] for k in part) / len(part)
                table[f"{component}.planned-{number}.{signal}"] = mean - now[name]
    return table


def feature_table(now: SX_of, commands: Sequence[str]) -> dict[str, SX]:
    """u, v, r, commands, relative wind and other environment, as `shipid.hybrid.features.feature_table`."""
    table = {name: now[name] for name in (*MOTIONS, *commands)}
    if "V_w" in now and "beta_w" in now:
        angle = now["beta_w"] - now["psi"]
        table["u_rw"] = now["u"] - now["V_w"] * ca.cos(angle)
        table["v_rw"] = now["v"] - now["V_w"] * ca.sin(angle)
    return table | {name: now[name] for name in plain_inputs(now)}


def _history(names: Layout, groups: SX_of, inputs: Inputs, step: float) -> dict[str, SX]:
    columns = {}
    now = dict(zip(names.now, ca.vertsplit(groups["now"]), strict=True))

    def before(name: str, seconds: float) -> SX:
        row = names.before(steps_of(seconds, step))
        return groups["past"][row * len(names.past) + names.past.index(name)]

    for seconds in inputs.memory.history:
        for name in (*MOTIONS, *inputs.commands):
            component, dot, signal = name.rpartition(".")
            columns[f"{component}{dot}past-{seconds:g}.{signal}"] = before(name, seconds) - now[name]
    for seconds in inputs.memory.turned:
        columns[f"turned-{seconds:g}.psi"] = now["psi"] - before("psi", seconds)
    return columns


def _estimates(names: Layout, groups: SX_of) -> dict[str, SX]:
    now = dict(zip(names.now, ca.vertsplit(groups["now"]), strict=True))
    seen = dict(zip(COLUMNS, ca.vertsplit(groups["estimates"]), strict=True))
    table = {f"observer-force.{motion}": seen[name] for motion, name in zip(MOTIONS, "XYN", strict=True)}
    c, s = ca.cos(now["psi"]), ca.sin(now["psi"])
    north, east = seen["current_north"], seen["current_east"]
    table |= {"observer-current.u": c * north + s * east, "observer-current.v": c * east - s * north}
    return table | {f"observer-wave.{name}": now[name] - seen[name] for name in MOTIONS}
