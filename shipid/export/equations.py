"""The equations of a vessel as CasADi functions: rates, memories, a step and a rollout; their inputs with units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
from casadi import MX, SX

from shipid.engine.casadi import input_symbols, summed_rates
from shipid.engine.integrate import Method, integrate_step
from shipid.physics.grammar import AXES
from shipid.physics.signals import ACTUAL, SIGNALS, signal_of, signal_row
from shipid.simulation.log import horizontal_velocities, state_column
from shipid.vessel.dynamics import INPUTS, Dynamics, vessel_dynamics
from shipid.vessel.load import Vessel


def split_by_name(names: Sequence[str], vector: Any) -> dict[str, Any]:
    """Entries of a vector, or rows of a matrix, by name."""
    return dict(zip(names, ca.vertsplit(vector), strict=True)) if names else {}


def symbols_of(sizes: Mapping[str, int]) -> dict[str, MX]:
    """A symbol for each name, a vector of its size."""
    return {name: MX.sym(name, size) for name, size in sizes.items()}


def function_by_names(name: str, inputs: Mapping[str, Any], outputs: Mapping[str, Any], **options: Any) -> ca.Function:
    """A function of inputs and outputs by name; outputs are dense."""
    dense = [ca.densify(value) for value in outputs.values()]
    return ca.Function(name, [*inputs.values()], dense, [*inputs], [*outputs], options)


@dataclass(frozen=True, eq=False)
class Equations:
    """Functions of one vessel. Sums whose components are drawn, the waves of a truth, are left out: the sea is calm.

    A carry is the state with the hidden states of terms, then the memories.
    """

    vessel: Vessel

    @cached_property
    def model(self) -> Dynamics:
        """Symbolic equations of motion of the vessel."""
        return vessel_dynamics(self.vessel)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states and of the hidden states of terms."""
        return (*self.model.state, *self.model.hidden)

    @property
    def values(self) -> MX:
        """Numbers of the vessel."""
        return MX(ca.DM(list(self.vessel.parameters.values())))

    @cached_property
    def groups(self) -> dict[str, dict[str, str]]:
        """Entries of each input of a step, entry -> SI unit."""
        model = self.model
        reached = [f"{ACTUAL}{name}" for name in model.memory]
        axes = [AXES[axis] for axis in self.vessel.axes]
        return {
            "carry": {name: _unit_of_entry(name) for name in (*self.states, *reached)},
            "commands": {name: _unit_of_entry(name) for name in model.commands},
            "environment": {name: _unit_of_entry(name) for name in model.environment},
            "loads": {axis: "N" if axis in "XYZ" else "N m" for axis in axes},
            "parameters": {name: self.vessel.units[name] for name in model.parameters},
        }

    def functions(self, method: Method) -> dict[str, ca.Function]:
        """`step`, and of its inputs but `dt`: `rates`, and `begin`, the carry with actuators at their orders."""
        inputs, count = symbols_of({group: len(units) for group, units in self.groups.items()}), len(self.states)
        carry, commands, environment, loads, parameters = inputs.values()
        rates = calm_rates(self.model)(carry[:count], carry[count:], commands, environment, parameters, loads)
        begun = ca.vertcat(carry[:count], self.begun(commands, parameters))
        return {
            "step": step_function(self.model, method),
            "rates": function_by_names("rates", inputs, {"rates": rates}),
            "begin": function_by_names("begin", inputs, {"begun": begun}),
        }

    def begun(self, commands: MX, parameters: MX) -> MX:
        """Memories that have reached their orders, as far as their stops let them."""
        places = [self.model.commands.index(name) for name in self.model.memory]
        return MX(memory_advance(self.model)(commands[places], commands, parameters, 0)) if places else MX(0, 1)

    def horizontal(self, carries: MX) -> MX:
        """u, v, r in the horizontal plane of one carry, or of a column for each step."""
        return MX(
            ca.vertcat(*horizontal_velocities(split_by_name((*self.states, *self.model.memory), carries), ca).values())
        )


@lru_cache(maxsize=32)
def calm_rates(model: Dynamics) -> ca.Function:
    """(state, memory, commands, environment, parameters, tau_extra) -> d(state)/dt, of all vessels of one structure."""
    inputs, tau = input_symbols(model), SX.sym("tau_extra", model.num_dof)
    given = dict(zip((*INPUTS, "tau_extra"), (*inputs, tau), strict=True))
    return function_by_names("rates", given, {"rates": SX(summed_rates(model, inputs, tau, {}))}, cse=True)


@lru_cache(maxsize=32)
def memory_advance(model: Dynamics) -> ca.Function:
    """(memory, commands, parameters, dt) -> memory after dt; neither state nor weather moves an actuator."""
    state, memory, commands, environment, parameters = input_symbols(model)
    dt = SX.sym("dt")
    after = model.advance(0 * state, memory, commands, 0 * environment, parameters, dt)
    inputs = {"memory": memory, "commands": commands, "parameters": parameters, "dt": dt}
    return function_by_names("advance", inputs, {"after": SX(after)}, cse=True)


@lru_cache(maxsize=32)
def step_function(model: Dynamics, method: Method, step: float | None = None) -> ca.Function:
    """(carry, commands, environment, loads, parameters) -> carry after `step` [s], or after a sixth input `dt`."""
    states = len(model.state) + len(model.hidden)
    sizes = {"carry": states + len(model.memory), "commands": len(model.commands)}
    sizes |= {"environment": len(model.environment), "loads": model.num_dof, "parameters": len(model.parameters)}
    inputs = symbols_of(sizes | ({} if step else {"dt": 1}))
    carry, commands, environment, loads, parameters = (*inputs.values(),)[:5]

    def rates(x: MX, m: MX) -> MX:
        return calm_rates(model)(x, m, commands, environment, parameters, loads)

    def advance(m: MX, after: Any) -> MX:
        return memory_advance(model)(m, commands, parameters, after) if model.memory else m

    length: Any = step or inputs["dt"]
    after = integrate_step(rates, advance, lambda x, a, k: x + a * k, carry[:states], carry[states:], length, method)
    return function_by_names("step", inputs, {"after": ca.vertcat(*after)})


def _unit_of_entry(name: str) -> str:
    """SI unit of a signal, or of a state that a term keeps: a time, or what a velocity adds up to."""
    row = signal_row(state_column(name))
    if row is not None:
        return row.unit
    state = signal_of(name)
    return "s" if state == "t" else SIGNALS[state[0]].unit.removesuffix("/s")


def rollout_records(step: ca.Function, carry: MX, inputs: Sequence[MX], parameters: MX, count: int) -> MX:
    """Carries (num_carry, T) after 1 ... T steps.

    inputs : commands, environment and loads, each with a column for every step, or one for all.
    """
    series = [ca.horzsplit(value) * (count // value.shape[1]) for value in inputs]
    records = []
    for columns in zip(*series, strict=True):
        carry = step(carry, *columns, parameters)
        records.append(carry)
    return ca.horzcat(*records)
