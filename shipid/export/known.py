"""Inputs of a predictor at an instant as symbols, and its physics on them.

They are arrays of CasADi with the functions of NumPy: what a method computes for S instants is an expression for one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.data.windows import Instants
from shipid.engine.engines import AUTO
from shipid.engine.rollout import SPEED_LIMIT
from shipid.export.equations import Equations, rollout_records, split_by_name, step_function
from shipid.hybrid.features import MOTIONS
from shipid.hybrid.physics import Physics, positions_in_frame
from shipid.vessel.dynamics import vessel_dynamics

NamedExpressions = Mapping[str, Any]
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
    physics: tuple[str, ...] = ()

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


def turn_vectors(vectors: MX, angle: MX) -> MX:
    """Vectors (2, n) of axes that have turned by an angle, in the axes before."""
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(c * vectors[0, :] - s * vectors[1, :], s * vectors[0, :] + c * vectors[1, :])


def rows_by_name(names: Sequence[str], values: MX, *shape: int) -> dict[str, Any]:
    """Rows of a matrix (n, T) by name, as arrays (T, 1), or of this shape."""
    rows = zip(names, ca.vertsplit(values) if names else (), strict=True)
    return {name: ca.ArrayInterface.MX(row.T, shape=shape or row.T.shape) for name, row in rows}


def change_arrays(instants: Instants, change: Callable[[Any], Any]) -> Instants:
    """Instants with other arrays, or symbols, in place of each array, in order."""
    groups = instants.columns, instants.past, instants.planned, instants.hidden, instants.estimates
    changed: Any = (group and {name: change(one) for name, one in group.items()} for group in groups)
    return Instants(*changed)


@dataclass(frozen=True)
class SymbolicPhysics(Physics):
    """Physics whose instants hold symbols, of one instant."""

    def records(self, instants: Instants) -> MX:
        """Carries (n, T + 1) after 0..T steps, see `Equations`; with an observer those in the moving water."""
        start, commands, environment, slow, _ = self._inputs(instants)
        equations, model = Equations(self.ship), vessel_dynamics(self.ship)

        def rows(names: Sequence[str], table: Mapping[str, Any]) -> MX:
            return ca.vertcat(*(MX(table[name]).T for name in names)) if names else MX(0, 1)

        orders = rows(model.commands, commands)
        reached = split_by_name(model.commands, orders[:, 0]) if instants.hidden is None else instants.hidden
        carry = ca.vertcat(column_of_entries(start, equations.states), rows(tuple(model.memory), reached))
        tau = MX(np.zeros(model.num_dof)) if slow is None else MX(slow.reshape(self.horizon, model.num_dof)).T
        step, inputs = (
            step_function(model, self.integrator, self.step),
            [orders, rows(model.environment, environment), tau],
        )
        return ca.horzcat(carry, rollout_records(step, carry, inputs, equations.values, self.horizon))

    def is_slow(self, records: MX) -> MX:
        """Whether no velocity of some carries is above that of any ship: in Python the rollout diverged."""
        num_dof = vessel_dynamics(self.ship).num_dof
        speeds = records[num_dof : 2 * num_dof, :]
        return ca.sum1(ca.vec(ca.fabs(speeds) <= SPEED_LIMIT)) > speeds.numel() - 0.5  # false where one is NaN

    def positions(self, instants: Instants, records: MX) -> tuple[Any, Any]:
        """Positions (T, 1) [m] in the frame (11) of some carries, over ground."""
        north, east = rows_by_name(POSITION_ENTRIES, records[:2, 1:]).values()
        drift = self._inputs(instants)[-1]
        if drift is not None:
            ages = self.step * np.arange(1.0, self.horizon + 1)[:, None]
            north, east = north + ages * drift[0], east + ages * drift[1]
        return positions_in_frame(instants, north, east)

    def states(self, instants: Instants, *, engine: str = AUTO) -> dict[str, Any]:  # noqa: ARG002
        """Return x, y, u, v, r and psi after 1..T steps, (T, 1), as `Physics.states`."""
        equations, records = Equations(self.ship), self.records(instants)
        motion = rows_by_name(equations.states, records[: len(equations.states), 1:])
        motion |= rows_by_name(MOTIONS, equations.horizontal(records[:, 1:]))
        x, y = self.positions(instants, records)
        lost = ca.ArrayInterface.MX(ca.if_else(self.is_slow(records), 0, np.nan), shape=(1,))
        return {"x": x + lost, "y": y + lost, **{name: motion[name] + lost for name in (*MOTIONS, "psi")}}

    def reached(self, instants: Instants) -> dict[str, Any]:
        """Return what the actuators have reached after 0..T steps, (T + 1, 1), as `Physics.reached`."""
        names = () if self.vessel is None else tuple(vessel_dynamics(self.vessel).memory)
        return rows_by_name(names, self.records(instants)[-len(names) :, :]) if names else {}

    def paths(self, instants: Instants) -> Any:
        """Return the path (T, 1, 2) [m], as `Physics.paths`: see `hold_velocity`."""
        if self.vessel is None:
            return np.zeros((self.horizon, 1, 2))
        records = self.records(instants)
        path = ca.horzcat(*(MX(side) for side in self.positions(instants, records))).T
        begun = self.step * ca.vertcat(*(MX(instants.columns[name]) for name in "uv"))
        places, last, before, sound = [MX(np.zeros(2))], begun, MX(np.zeros(2)), MX(1)
        reach = _row_lengths(begun) @ ca.DM(np.arange(1, self.horizon + 1)).T
        for place in ca.horzsplit(path):
            step = place - before
            sound = ca.logic_and(sound, step.T @ step <= (SPEED_LIMIT * self.step) ** 2)
            last, before = ca.if_else(sound, step, last), place
            places.append(ca.if_else(sound, place, places[-1] + last))
        held = ca.horzcat(*places[1:])
        held *= ca.repmat(reach / ca.fmax(_row_lengths(held), reach), 2, 1)
        return ca.ArrayInterface.MX(ca.if_else(self.is_slow(records), path, held).T, shape=(self.horizon, 1, 2))

    def call_once(self, function: Callable[..., dict[str, Any]]) -> Callable[..., dict[str, Any]]:
        """Return a function of instants and arrays as one of CasADi: code for each step of a path would be long."""
        made: list[tuple[ca.Function, dict[str, tuple[int, ...]]]] = []

        def call(at: Instants, *arrays: Any) -> dict[str, Any]:
            given = list[Any]()
            change_arrays(at, given.append)
            given += arrays
            if not made:
                symbols = [MX.sym("given", value.size) for value in given]
                pairs = zip(symbols, given, strict=True)
                shaped = (ca.ArrayInterface.MX(symbol, shape=value.shape) for symbol, value in pairs)
                results = function(change_arrays(at, lambda _: next(shaped)), *shaped)
                flat = [MX(value.reshape(-1)) for value in results.values()]
                made.append((ca.Function("advance", symbols, flat), {key: one.shape for key, one in results.items()}))
            one, shapes = made[0]
            flat = one.call([MX(value.reshape(-1)) for value in given])
            return {
                key: ca.ArrayInterface.MX(value, shape=shape)
                for (key, shape), value in zip(shapes.items(), flat, strict=True)
            }

        return call


def symbolic_physics(physics: Physics) -> SymbolicPhysics:
    """The physics on symbols; that of a simulator has no vessel, as its path is an input."""
    return SymbolicPhysics(**{one.name: getattr(physics, one.name) for one in fields(Physics)})


def symbolic_instants(names: InputLayout, given: Mapping[str, MX]) -> Instants:
    """The instant of symbols of `InputLayout.sizes`; places are relative to it."""
    columns = rows_by_name(names.now, given["now"], 1)
    estimates = rows_by_name(names.estimates, given["estimates"], 1)
    for name in POSITION_ENTRIES:
        place = columns.pop(name)
        if f"observer.{name}" in estimates:
            estimates[f"observer.{name}"] = estimates[f"observer.{name}"] - place
    return Instants(
        columns,
        rows_by_name(names.past, ca.reshape(given["past"], len(names.past), names.num_past)),
        rows_by_name(names.planned, ca.reshape(given["planned"], -1, names.horizon)) if names.planned else None,
        rows_by_name(names.reached, given["reached"], 1) or None,
        estimates,
    )


def _row_lengths(places: MX) -> MX:
    """Lengths (1, T) of places (2, T), above 0: the root of 0 has no derivative."""
    return ca.sqrt(ca.fmax(ca.sum1(places**2), 1e-300))
