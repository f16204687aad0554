"""The equations of a vessel as CasADi functions: rates, memories, a step and a rollout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
from casadi import MX, SX

from shipid.engine.casadi import summed_rates
from shipid.engine.integrate import Method, integrate_step
from shipid.simulation.log import LEANING, body_velocities, horizontal_velocities
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
    def num_carry(self) -> int:
        """Entries of a carry."""
        return len(self.states) + len(self.model.memory)

    def _symbols(self) -> list[SX]:
        model = self.model
        return [SX.sym(INPUTS[0], len(self.states)), *(SX.sym(name, len(getattr(model, name))) for name in INPUTS[1:])]

    @cached_property
    def rates(self) -> ca.Function:
        """(state, memory, commands, environment, parameters, tau_extra) -> d(state)/dt."""
        inputs, tau = self._symbols(), SX.sym("tau_extra", self.model.num_dof)
        calm = replace(self.model, sums=tuple(term for term in self.model.sums if term.arrays is not None))
        given = dict(zip((*INPUTS, "tau_extra"), (*inputs, tau), strict=True))
        return function_by_names("rates", given, {"rates": SX(summed_rates(calm, inputs, tau, {}))}, cse=True)

    @cached_property
    def advance(self) -> ca.Function:
        """(memory, commands, parameters, dt) -> memory after dt; neither state nor weather moves an actuator."""
        state, memory, commands, environment, parameters = self._symbols()
        dt = SX.sym("dt")
        after = self.model.advance(0 * state, memory, commands, 0 * environment, parameters, dt)
        inputs = {"memory": memory, "commands": commands, "parameters": parameters, "dt": dt}
        return function_by_names("advance", inputs, {"after": SX(after)}, cse=True)

    def step(self, method: Method, step: float | None = None) -> ca.Function:
        """(carry, commands, environment, tau_extra, parameters) -> carry after `step` [s], or after an input `dt`."""
        model, states = self.model, len(self.states)
        sizes = {"carry": self.num_carry, "commands": len(model.commands), "environment": len(model.environment)}
        sizes |= {"tau_extra": model.num_dof, "parameters": len(model.parameters)} | ({} if step else {"dt": 1})
        inputs = symbols_of(sizes)
        carry, commands, environment, tau, parameters = (*inputs.values(),)[:5]

        def rates(x: MX, m: MX) -> MX:
            return self.rates(x, m, commands, environment, parameters, tau)

        def advance(m: MX, after: Any) -> MX:
            return self.advance(m, commands, parameters, after) if model.memory else m

        length: Any = step or inputs["dt"]
        after = integrate_step(
            rates, advance, lambda x, a, k: x + a * k, carry[:states], carry[states:], length, method
        )
        return function_by_names("step", inputs, {"after": ca.vertcat(*after)})

    def begun(self, commands: MX, parameters: MX) -> MX:
        """Memories that have reached their orders, as far as their stops let them."""
        places = [self.model.commands.index(name) for name in self.model.memory]
        return MX(self.advance(commands[places], commands, parameters, 0)) if places else MX(0, 1)

    def aboard(self, state: MX) -> MX:
        """State with velocities along the ship's axes from one with horizontal u, v, r, as a log has them."""
        if set(self.model.state).isdisjoint(LEANING):
            return state
        now = split_by_name(self.states, state)
        return MX(ca.vertcat(*(now | body_velocities(now, ca)).values()))

    def horizontal(self, carries: MX) -> MX:
        """u, v, r in the horizontal plane of one carry, or of a column for each step."""
        return MX(
            ca.vertcat(*horizontal_velocities(split_by_name((*self.states, *self.model.memory), carries), ca).values())
        )


def rollout_records(step: ca.Function, carry: MX, inputs: Sequence[MX], parameters: MX, count: int) -> MX:
    """Carries (num_carry, T) after 1 ... T steps.

    inputs : commands, environment and tau_extra, each with a column for every step, or one for all.
    """
    series = [ca.horzsplit(value) * (count // value.shape[1]) for value in inputs]
    records = []
    for columns in zip(*series, strict=True):
        carry = step(carry, *columns, parameters)
        records.append(carry)
    return ca.horzcat(*records)
