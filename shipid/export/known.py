"""Inputs of a predictor at an instant as symbols, and what physics and memory compute from them."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from casadi import MX

from shipid.engine.rollout import SPEED_LIMIT
from shipid.export.equations import Equations, rollout_records, split_by_name, symbols_of
from shipid.hybrid.features import MOTIONS, PLAN_PARTS, Inputs, count_steps
from shipid.hybrid.physics import Physics
from shipid.observer import ESTIMATE_COLUMNS, filter_bank, moves_start
from shipid.physics.signals import direct_inputs

NamedExpressions = Mapping[str, MX]
TRACE_OF_WIND = 1e-12  # m/s: of a wind that is exactly 0, so that its direction has a derivative
POSITION_ENTRIES = ("north", "east")


@dataclass(frozen=True)
class InputLayout:
    """Names of the entries of each input of a predictor, in order.

    now : measured at the instant. reached : actuators that lag behind their orders. past : entries of each of
    `num_past` rows, the oldest first, 1 ... num_past steps before the instant; x, y are positions in the frame of the
    instant. planned : commands of each of `horizon` rows. estimates : of the observer.
    physics : x, y of each of `horizon` rows of the path of the physics, where a simulator gives it.
    """

    now: tuple[str, ...]
    reached: tuple[str, ...]
    past: tuple[str, ...]
    num_past: int
    planned: tuple[str, ...]
    horizon: int
    estimates: tuple[str, ...]
    commands: tuple[str, ...]
    physics: tuple[str, ...] = ()

    def before(self, steps: int) -> int:
        """Row of the past so many steps before the instant; IndexError where the past is shorter."""
        if steps > self.num_past:
            raise IndexError(f"{steps} steps of the past are taken, of {self.num_past}")
        return self.num_past - steps

    @property
    def sizes(self) -> dict[str, int]:
        """Entries of each input."""
        given = {"physics": self.horizon * len(self.physics)} if self.physics else {}
        return given | {
            "now": len(self.now),
            "reached": len(self.reached),
            "past": self.num_past * len(self.past),
            "planned": self.horizon * len(self.planned),
            "estimates": len(self.estimates),
        }


def column_of_entries(table: NamedExpressions, names: Sequence[str]) -> MX:
    """Entries of a table in a column, in the order of the names; what it does not hold is 0."""
    return ca.vertcat(MX(0, 1), *(table.get(name, MX(0)) for name in names))


def all_within(values: MX, limit: float = sys.float_info.max) -> MX:
    """Whether all values are from -limit to limit: false where one is NaN, by default also where one is infinite."""
    return ca.sum1(ca.vec(ca.fabs(values) <= limit)) > values.numel() - 0.5


def turn_vectors(vectors: MX, angle: MX) -> MX:
    """Vectors (2, n) of axes that have turned by an angle, in the axes before."""
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(c * vectors[0, :] - s * vectors[1, :], s * vectors[0, :] + c * vectors[1, :])


class PredictorInputs:
    """Symbols of the inputs of a predictor, and the motion of its physics.

    physics : as in the predictor, its vessel with the terms of a method. inputs : name -> symbol of `Layout.sizes`.
    """

    def __init__(self, physics: Physics, names: InputLayout) -> None:
        self.physics, self.names = physics, names
        self.inputs = symbols_of(names.sizes)
        self.now = split_by_name(names.now, self.inputs["now"])
        rows = ca.reshape(self.inputs["past"], len(names.past), names.num_past)
        self.past = [split_by_name(names.past, row) for row in ca.horzsplit(rows)] if names.past else []
        self.past_errors: dict[float, MX] = {}

    @cached_property
    def equations(self) -> Equations:
        """Equations of the physics."""
        assert self.physics.vessel is not None
        return Equations(self.physics.vessel)

    @cached_property
    def step(self) -> ca.Function:
        """One step of the physics."""
        return self.equations.step(self.physics.integrator, self.physics.step)

    def commands(self, names: Sequence[str]) -> MX:
        """Commands (n, T) over the horizon, or (n, 1) where they are held."""
        every, horizon = self.names.planned, self.names.horizon
        if not every:
            return column_of_entries(self.now, names)
        return ca.reshape(self.inputs["planned"], len(every), horizon)[[every.index(name) for name in names], :]

    def _begun(self, row: NamedExpressions) -> MX:
        """State of the vessel at a measured row, at the origin; hidden states of terms are 0."""
        known = {name: value for name, value in row.items() if name not in POSITION_ENTRIES}
        return self.equations.aboard(column_of_entries(known, self.equations.states))

    def _rolled_out(self, begun: MX, environment: MX, tau: MX) -> MX:
        inputs = [self.commands(self.equations.model.commands), environment, tau]
        carry = ca.vertcat(begun, self.inputs["reached"])
        return rollout_records(self.step, carry, inputs, self.equations.values, self.names.horizon)

    @cached_property
    def measured_records(self) -> MX:
        """Carries (n, T) of the physics after each step from the measured state, without an observer."""
        model = self.equations.model
        return self._rolled_out(
            self._begun(self.now), column_of_entries(self.now, model.environment), MX(np.zeros(model.num_dof))
        )

    @cached_property
    def records(self) -> MX:
        """Carries (n, T) of the physics after each step; with an observer those in the moving water."""
        return self.measured_records if self.physics.observer is None else self._rolled_out(*self._observed())

    @cached_property
    def seen(self) -> dict[str, MX]:
        """Estimates of the observer by their names in `shipid.observer.ESTIMATE_COLUMNS`."""
        return split_by_name(ESTIMATE_COLUMNS, self.inputs["estimates"])

    def _observed(self) -> tuple[MX, MX, MX]:
        """State, environment and slow force over the horizon, as `shipid.observer.observed_start`."""
        physics, model, now, seen = self.physics, self.equations.model, self.now, self.seen
        filters = filter_bank(self.equations.vessel, physics.observer)
        north, east, psi = seen["current_north"], seen["current_east"], seen["psi"]
        state = {"psi": psi, "r": seen["r"]}
        if moves_start(filters.settings, physics.path):
            state |= {name: seen[name] - now[name] for name in POSITION_ENTRIES}
        state["u"] = seen["u"] - north * ca.cos(psi) - east * ca.sin(psi)
        state["v"] = seen["v"] + north * ca.sin(psi) - east * ca.cos(psi)
        weather = dict(now)
        if "V_w" in model.environment:
            ahead = now["V_w"] * ca.cos(now["beta_w"]) - north
            across = now["V_w"] * ca.sin(now["beta_w"]) - east
            ahead += ca.if_else(ahead**2 + across**2 == 0, TRACE_OF_WIND, 0)
            weather |= {"V_w": ca.sqrt(ahead**2 + across**2), "beta_w": ca.atan2(across, ahead)}
        weather |= {name: MX(0) for name in ("V_c", "beta_c")}
        ages = (np.arange(physics.horizon) + 0.5) * physics.step
        faded = np.exp(-ages / filters.fade) if filters.fade > 0 else np.zeros(physics.horizon)
        force = ca.DM(filters.mass) @ column_of_entries(seen, "XYN")
        tau = force @ ca.DM(faded).T
        return column_of_entries(state, self.equations.states), column_of_entries(weather, model.environment), tau

    @cached_property
    def path(self) -> MX:
        """Path (2, T) of the physics alone [m], see `shipid.hybrid.physics.hold_velocity`; zeros without physics."""
        if self.names.physics:
            return ca.reshape(self.inputs["physics"], 2, self.names.horizon)
        if self.physics.vessel is None:
            return MX(np.zeros((2, self.names.horizon)))
        way = self.records[:2, :]
        if self.physics.observer is not None:
            ages = ca.DM(self.physics.step * np.arange(1, self.names.horizon + 1))
            way += column_of_entries(self.seen, ("current_north", "current_east")) @ ages.T
        path = turn_vectors(way, -self.now["psi"])
        places, last = [MX(np.zeros(2))], self.physics.step * column_of_entries(self.now, "uv")
        before, sound = places[0], MX(1)
        reach = _row_lengths(last) @ ca.DM(np.arange(1, path.shape[1] + 1)).T
        for place in ca.horzsplit(path):
            step = place - before
            sound = ca.logic_and(sound, step.T @ step <= (SPEED_LIMIT * self.physics.step) ** 2)
            last, before = ca.if_else(sound, step, last), place
            places.append(ca.if_else(sound, place, places[-1] + last))
        held = ca.horzcat(*places[1:])
        held *= ca.repmat(reach / ca.fmax(_row_lengths(held), reach), 2, 1)
        return ca.if_else(self._slow(self.records), path, held)

    @property
    def diverges(self) -> MX:
        """Whether the rollout of the physics diverges; never without physics."""
        return MX(0) if self.physics.vessel is None else ca.logic_not(self._slow(self.records))

    def _slow(self, records: MX) -> MX:
        """Whether no velocity of some carries is above that of any ship: in Python the rollout diverged."""
        num_dof = self.equations.model.num_dof
        return all_within(records[num_dof : 2 * num_dof, :], SPEED_LIMIT)

    def past_records(self, steps: int) -> MX:
        """Carries (n, steps) over the last steps, from the measured state before them, actuators at their orders."""
        model, rows = self.equations.model, self.past[self.names.before(steps) :]
        carry = ca.vertcat(self._begun(rows[0]), column_of_entries(rows[0], tuple(model.memory)))
        commands = ca.horzcat(*(column_of_entries(row, model.commands) for row in rows))
        inputs = [commands, column_of_entries(rows[0], model.environment), MX(np.zeros(model.num_dof))]
        return rollout_records(self.step, carry, inputs, self.equations.values, steps)

    def _past_error(self, seconds: float) -> MX:
        """x, y, u, v, r of `shipid.hybrid.features.past_error`."""
        steps = count_steps(seconds, self.physics.step)
        records, then = self.past_records(steps), self.past[self.names.before(steps)]
        last, change = records[:, -1], self.now["psi"] - then["psi"]
        here = turn_vectors(-column_of_entries(then, "xy"), change)  # the present position in the frame of the start
        missed = turn_vectors(here - turn_vectors(last[:2], -then["psi"]), -change)
        errors = ca.vertcat(missed, column_of_entries(self.now, MOTIONS) - self.equations.horizontal(last))
        return ca.if_else(ca.logic_and(all_within(errors), self._slow(records)), errors, 0)

    def table(self, inputs: Inputs, moments: Sequence[int] = ()) -> dict[str, MX]:
        """Every input that a method may take, see `shipid.hybrid.features.Inputs.table`.

        moments : steps of the horizon at which the physics is seen (calibrator).
        """
        table = (
            feature_expressions(self.now, (*inputs.commands, *inputs.memory.states))
            | self._plans(inputs)
            | self._history(inputs)
        )
        if self.physics.vessel is None:
            return table
        if inputs.memory.observer and self.physics.observer is not None:
            table |= self._estimates()
        axes = ("x", "y", *MOTIONS)
        for seconds in inputs.memory.error:
            if seconds not in self.past_errors:
                self.past_errors[seconds] = self._past_error(seconds)
            table |= split_by_name([f"error-{seconds:g}.{name}" for name in axes], self.past_errors[seconds])
        if moments:
            every = ca.vertcat(self.path, self.equations.horizontal(self.records))
            every = ca.if_else(ca.logic_and(all_within(every), self._slow(self.records)), every, 0)
            for k in moments:
                table |= split_by_name([f"physics-{k * self.physics.step:g}.{name}" for name in axes], every[:, k - 1])
        return table

    def _plans(self, inputs: Inputs) -> dict[str, MX]:
        """Mean order less the present one in parts of the horizon, see `shipid.hybrid.features.planned_means`."""
        if not self.names.planned:
            return {}
        table, horizon = {}, self.names.horizon
        for name, orders in split_by_name(inputs.commands, self.commands(inputs.commands)).items():
            component, _, signal = name.rpartition(".")
            for number, part in enumerate(np.array_split(np.arange(horizon), min(PLAN_PARTS, horizon)), start=1):
                mean = ca.sum2(orders[:, part[0] : part[-1] + 1]) / len(part)
                table[f"{component}.planned-{number}.{signal}"] = mean - self.now[name]
        return table

    def _history(self, inputs: Inputs) -> dict[str, MX]:
        columns, now, step = {}, self.now, self.physics.step
        for seconds in inputs.memory.history:
            row = self.past[self.names.before(count_steps(seconds, step))]
            for name in (*MOTIONS, *inputs.commands, *inputs.memory.states):
                component, dot, signal = name.rpartition(".")
                columns[f"{component}{dot}past-{seconds:g}.{signal}"] = row[name] - now[name]
        for seconds in inputs.memory.turned:
            row = self.past[self.names.before(count_steps(seconds, step))]
            columns[f"turned-{seconds:g}.psi"] = now["psi"] - row["psi"]
        for seconds in inputs.memory.positions:
            row = self.past[self.names.before(count_steps(seconds, step))]
            columns |= {f"past-{seconds:g}.{axis}": row[axis] for axis in "xy"}
        return columns

    def _estimates(self) -> dict[str, MX]:
        """Inputs of `shipid.hybrid.features.observer_inputs`."""
        now, seen = self.now, self.seen
        table = {f"observer-force.{motion}": seen[name] for motion, name in zip(MOTIONS, "XYN", strict=True)}
        current = turn_vectors(column_of_entries(seen, ("current_north", "current_east")), -now["psi"])
        table |= split_by_name(("observer-current.u", "observer-current.v"), current)
        return table | {f"observer-wave.{name}": now[name] - seen[name] for name in MOTIONS}


def feature_expressions(now: NamedExpressions, commands: Sequence[str]) -> dict[str, MX]:
    """u, v, r, commands, relative wind and other environment, as `shipid.hybrid.features.feature_table`."""
    table = {name: now[name] for name in (*MOTIONS, *commands)}
    if "V_w" in now and "beta_w" in now:
        angle = now["beta_w"] - now["psi"]
        table["u_rw"] = now["u"] - now["V_w"] * ca.cos(angle)
        table["v_rw"] = now["v"] - now["V_w"] * ca.sin(angle)
    return table | {name: now[name] for name in direct_inputs(now)}


def _row_lengths(places: MX) -> MX:
    """Lengths (1, T) of places (2, T), above 0: the root of 0 has no derivative."""
    return ca.sqrt(ca.fmax(ca.sum1(places**2), 1e-300))
