"""Candidate inputs of a method: what is measured at the instant, what is planned, and what the past says."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, NonNegativeFloat, PositiveFloat, field_validator

from shipid.checked import CheckedModel
from shipid.data.windows import Instants, from_frame, to_frame
from shipid.errors import DataError
from shipid.hybrid.physics import Physics
from shipid.physics.signals import direct_inputs, measurable_signals, rows_of_role

Array = NDArray[np.float64]
MOTIONS = ("u", "v", "r")
TOLERANCE = 1e-9  # two columns that differ by less, relative to their size, are one column written twice
PLAN_PARTS = 3  # of the horizon, in which a method sees planned commands


def planned_means(columns: Mapping[str, Array], planned: Mapping[str, Array]) -> dict[str, Array]:
    """The mean command less the present one in each of `PLAN_PARTS` parts of the horizon, or in each step of fewer.

    `port.alpha` (T, S) gives `port.planned-1.alpha` (S,), ...
    """
    means: dict[str, Array] = {}
    for name, values in planned.items():
        component, _, signal = name.rpartition(".")
        for number, part in enumerate(np.array_split(values, min(PLAN_PARTS, len(values))), start=1):
            change = part.mean(axis=0) - columns[name]
            rounding = TOLERANCE * np.abs(columns[name])  # of a mean of equal orders: no change
            means[f"{component}.planned-{number}.{signal}"] = np.where(np.abs(change) > rounding, change, 0.0)
    return means


def feature_table(columns: Mapping[str, Array], commands: Sequence[str]) -> dict[str, Array]:
    """Return the inputs at the instant: u, v, r, the commands and, where measured, relative wind and other environment.

    u_rw = u - V_w cos(beta_w - psi), v_rw = v - V_w sin(beta_w - psi), (6) and (7).

    columns : quantities (S,), SI and radians; DataError where a motion or a command is missing.
    commands : names of the command columns, `<component>.<signal>`.
    """
    for name in (*MOTIONS, *commands):
        if name not in columns:
            raise DataError(f"the compensator needs this column; there are {', '.join(sorted(columns))}", path=name)
    table = {name: columns[name] for name in (*MOTIONS, *commands)}
    if "V_w" in columns and "beta_w" in columns:
        angle = columns["beta_w"] - columns["psi"]
        table["u_rw"] = table["u"] - columns["V_w"] * np.cos(angle)
        table["v_rw"] = table["v"] - columns["V_w"] * np.sin(angle)
    return table | {name: columns[name] for name in direct_inputs(columns)}


def select_inputs(table: Mapping[str, Array], names: Sequence[str]) -> Array:
    """Inputs (S, d) of a fitted method; DataError where the table lacks one that it was trained with."""
    missing = next((name for name in names if name not in table), None)
    if missing is not None:
        remedy = "measure wind (V_w, beta_w)" if missing.endswith("_rw") else "the data must hold what it is made of"
        raise DataError(f"the method was trained with this input; {remedy}", path=missing)
    if not names:  # a log without orders has none that an alarm could limit
        return np.empty((len(next(iter(table.values()))), 0))
    return np.stack([table[name] for name in names], axis=1)


OneOrMore = NonNegativeFloat | tuple[PositiveFloat, ...]


class Memory(CheckedModel, BaseModel):
    """What a method takes from the past, in seconds before the instant, rounded to whole steps, one at least.

    Parameters
    ----------
    history : u, v, r and the commands so long ago, less their present values.
    turned : change of heading over so long.
    positions : position so long ago in the frame (11) of the instant.
    states : further measured columns as inputs, with their history: of z, phi, theta, w, p, q.
    observer : the estimates of the observer of the physics: slow forces as accelerations, current, and the filtered
        velocities less the measured ones.
    error : what the physics, started so long ago with the commands then given, gets wrong by now: along and across the
        present heading, and in u, v, r.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    history: tuple[PositiveFloat, ...] = ()
    turned: tuple[PositiveFloat, ...] = ()
    positions: tuple[PositiveFloat, ...] = ()
    states: tuple[Literal["z", "phi", "theta", "w", "p", "q"], ...] = ()
    error: tuple[PositiveFloat, ...] = ()
    observer: bool = False

    @field_validator("history", "turned", "positions", "error", mode="before", json_schema_input_type=OneOrMore)
    @classmethod
    def _several(cls, value: Any) -> Any:
        """Take one number as a list of one; 0 as none."""
        return ((value,) if value else ()) if isinstance(value, int | float) else value

    @property
    def past(self) -> float:
        """Length of the past that is needed [s]."""
        return max((*self.history, *self.turned, *self.positions, *self.error), default=0.0)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of inputs that it gives, as `input_group` calls them."""
        held = {
            "history": self.history or self.turned or self.positions,
            "error": self.error,
            "observer": self.observer,
        }
        return tuple(kind for kind, one in held.items() if one)


NO_MEMORY = Memory()


@dataclass(frozen=True)
class Inputs:
    """Which inputs a method takes: names of commands, and the memory.

    A difference to the past is called `past-4.u` or `port.past-4.alpha`, a position `past-4.x`, a change of heading
    `turned-10.psi`, the error of the physics `error-8.x`: the last part is the signal.
    """

    commands: tuple[str, ...]
    memory: Memory = NO_MEMORY

    def table(self, physics: Physics, instants: Instants) -> dict[str, Array]:
        """Return every input (S,) at the instants; DataError where a column or a part of the past is missing."""
        return self.common(instants, physics.step) | self.of_physics(physics, instants)

    def common(self, instants: Instants, step: float) -> dict[str, Array]:
        """Return the inputs (S,) that do not depend on the physics."""
        planned = {name: instants.planned[name] for name in self.commands} if instants.planned is not None else {}
        means = planned_means(instants.columns, planned)
        table = feature_table({**instants.columns, **means}, (*self.commands, *means, *self.memory.states))
        for seconds in self.memory.history:
            for name in (*MOTIONS, *self.commands, *self.memory.states):
                component, dot, signal = name.rpartition(".")
                label = f"{component}{dot}past-{seconds:g}.{signal}"
                table[label] = value_before(instants, name, seconds, step) - instants.columns[name]
        for seconds in self.memory.turned:
            before = value_before(instants, "psi", seconds, step)
            table[f"turned-{seconds:g}.psi"] = instants.columns["psi"] - before
        for seconds in self.memory.positions:
            table |= {f"past-{seconds:g}.{axis}": value_before(instants, axis, seconds, step) for axis in "xy"}
        return table

    def of_physics(self, physics: Physics, instants: Instants) -> dict[str, Array]:
        """Return the inputs (S,) that the physics gives: its error over the last seconds; none without physics."""
        if physics.absent:
            return {}
        table = observer_inputs(instants) if self.memory.observer and physics.observer is not None else {}
        for seconds in self.memory.error:
            errors = past_error(replace(physics, observer=None), instants, seconds)
            table |= {f"error-{seconds:g}.{name}": values for name, values in errors.items()}
        return table


def value_before(instants: Instants, name: str, seconds: float, step: float) -> Array:
    """Values (S,) of a column so long before the instants; DataError where their past is shorter."""
    steps, held = count_steps(seconds, step), len(instants.past.get(name, ()))
    if held < steps:
        raise DataError(f"the method needs {seconds:g} s of the past, there are {held * step:g} s", path=name)
    values: Array = instants.past[name][-steps]
    return values


def input_group(name: str) -> str:
    """Kind of an input by its name: `motion`, `wind`, `command`, `history`, `error`, `observer` or `physics`.

    A plan is a command; `physics` is a trajectory, `wind` also other environment.
    """
    if name in rows_of_role("motion"):
        return "motion"
    if name.endswith("_rw") or measurable_signals([name]):
        return "wind"
    kind = re.match(r"(?:.*\.)?(past|turned|error|observer|physics)-", name)
    if kind is None:
        return "command"
    return kind[1] if kind[1] in ("error", "observer", "physics") else "history"


def observer_inputs(instants: Instants) -> dict[str, Array]:
    """Estimates of the observer as inputs (S,), in body axes.

    `observer-force.u`, `.v`, `.r` [m/s^2, rad/s^2]; `observer-current.u`, `.v` [m/s]; `observer-wave.u`, `.v`, `.r`
    [m/s, rad/s]: the measured velocity less the filtered one.
    """
    known, columns = instants.estimates, instants.columns
    table = {f"observer-force.{motion}": known[f"observer.{name}"] for motion, name in zip(MOTIONS, "XYN", strict=True)}
    north, east = (known[f"observer.current_{axis}"] for axis in ("north", "east"))
    through = to_frame(north, east, 0.0, 0.0, columns["psi"])
    table |= dict(zip(("observer-current.u", "observer-current.v"), through, strict=True))
    return table | {f"observer-wave.{name}": columns[name] - known[f"observer.{name}"] for name in MOTIONS}


def count_steps(seconds: float, step: float) -> int:
    """Number of steps in so many seconds, at least one."""
    return max(round(seconds / step), 1)


def last_steps(instants: Instants, steps: int) -> dict[str, Array]:
    """The past of the last `steps` steps, the oldest first, name -> (steps, S); DataError where it is shorter."""
    held = len(instants.past.get("u", ()))
    if held < steps:
        raise DataError(f"the method needs {steps} steps of the past, there are {held}", path="u")
    return {name: values[held - steps :] for name, values in instants.past.items()}


def earlier_instants(instants: Instants, steps: int, step: float, *, placed: bool = True) -> Instants:
    """Instants so many steps [s] before others, with the orders given since.

    placed : whether they have north, east [m] of the ship, too; else its place is the origin.
    """
    past = last_steps(instants, steps)
    then, given = {name: values[0] for name, values in past.items()}, {name: past[name] for name in past if "." in name}
    if placed:
        places = from_frame(then["x"], then["y"], *(instants.columns[name] for name in ("north", "east", "psi")))
        then |= dict(zip(("north", "east"), places, strict=True))
    return Instants(then, planned=given, run=instants.run, t=None if instants.t is None else instants.t - steps * step)


def past_error(physics: Physics, instants: Instants, seconds: float) -> dict[str, Array]:
    """Errors (S,) at the instants of a prediction by the physics from `seconds` before, with the commands given since.

    x, y : true less predicted position [m], along and across the present heading. u, v, r : true less predicted
    velocities [m/s, rad/s], where the physics says them. A prediction that diverged gives zeros.
    """
    steps, columns = count_steps(seconds, physics.step), instants.columns
    value_before(instants, "x", seconds, physics.step)
    begun = earlier_instants(instants, steps, physics.step, placed=physics.vessel is None)  # as a simulator asks
    then, before = begun.columns, replace(physics, horizon=steps)
    ends = {name: values[-1] for name, values in before.states(begun).items()}
    turned = columns["psi"] - then["psi"]
    x0, y0 = to_frame(0.0, 0.0, then["x"], then["y"], -turned)  # the present position in the frame of the start
    dx, dy = x0 - ends["x"], y0 - ends["y"]
    errors = dict(zip("xy", to_frame(dx, dy, 0.0, 0.0, turned), strict=True))
    errors |= {name: columns[name] - ends[name] for name in MOTIONS if name in ends}
    sound = (np.abs(np.stack([*errors.values()])) < np.inf).all(axis=0)
    return {name: np.where(sound, values, 0.0) for name, values in errors.items()}


def choose_features(table: Mapping[str, Array]) -> dict[str, tuple[str, ...]]:
    """Merge columns that are equal and drop those that are constant: (12) becomes (13) where both azimuths act as one.

    table : features (S,) of training samples. Returns the name of each feature that stays -> all the columns equal to
    it, itself first; DataError where none varies.
    """
    chosen: dict[str, tuple[str, ...]] = {}
    for name, values in table.items():
        tolerance = TOLERANCE * max(1e-300, float(np.abs(values).max(initial=0.0)))
        if np.ptp(values) <= tolerance:
            continue
        same = (kept for kept in chosen if "." in name and np.abs(table[kept] - values).max() <= tolerance)
        twin = next(same, name)
        chosen[twin] = (*chosen.get(twin, ()), name)
    if not chosen:
        raise DataError(
            f"none of {', '.join(table)} varies over the training windows: nothing can be learned from them"
        )
    return chosen
