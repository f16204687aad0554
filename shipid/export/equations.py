"""The equations of a vessel as blocks: rates, memories, a step and a rollout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
from casadi import SX

from shipid.engine.casadi import summed_rates
from shipid.engine.integrate import Method, integrate
from shipid.export.blocks import Duration, Formula, Graph, Value
from shipid.simulation.log import LEANING, aboard, horizontal
from shipid.vessel.dynamics import INPUTS, Dynamics, dynamics
from shipid.vessel.load import Vessel


@dataclass(frozen=True, eq=False)
class Equations:
    """Blocks of one vessel. Sums whose components are drawn, the waves of a truth, are left out: the sea is calm.

    A carry is the state with the hidden states of terms, then the memories.
    """

    vessel: Vessel

    @cached_property
    def model(self) -> Dynamics:
        """Symbolic equations of motion of the vessel."""
        return dynamics(self.vessel)

    @property
    def num_states(self) -> int:
        """Entries of state and hidden states."""
        return len(self.model.state) + len(self.model.hidden)

    @property
    def leans(self) -> bool:
        """Whether velocities along the ship's axes are not those of a log, which are horizontal."""
        return not set(self.model.state).isdisjoint(LEANING)

    @property
    def num_carry(self) -> int:
        """Entries of a carry."""
        return self.num_states + len(self.model.memory)

    def _symbols(self) -> list[SX]:
        model = self.model
        sizes = (self.num_states, *(len(getattr(model, name)) for name in INPUTS[1:]))
        return [SX.sym(name, size) for name, size in zip(INPUTS, sizes, strict=True)]

    @cached_property
    def rates(self) -> Formula:
        """(state, memory, commands, environment, parameters, tau_extra) -> d(state)/dt."""
        inputs, tau = self._symbols(), SX.sym("tau_extra", self.model.num_dof)
        written = replace(self.model, sums=tuple(term for term in self.model.sums if term.arrays is not None))
        result = ca.densify(SX(summed_rates(written, inputs, tau, {})))
        return Formula(ca.Function("rates", [*inputs, tau], [result], [*INPUTS, "tau_extra"], ["out"], {"cse": True}))

    @cached_property
    def advance(self) -> Formula:
        """(state, memory, commands, environment, parameters, dt) -> memory after dt."""
        inputs, dt = self._symbols(), SX.sym("dt")
        result = ca.densify(SX(self.model.advance(*inputs, dt)))
        return Formula(ca.Function("advance", [*inputs, dt], [result], [*INPUTS, "dt"], ["out"], {"cse": True}))

    def step(self, method: Method, step: float | None = None) -> Graph:
        """(carry, commands, environment, tau_extra, parameters) -> carry after `step` [s], or after an input `dt`."""
        model, graph = self.model, Graph("step")
        carry = graph.input("carry", self.num_carry)
        commands = graph.input("commands", len(model.commands))
        environment = graph.input("environment", len(model.environment))
        tau = graph.input("tau_extra", model.num_dof)
        parameters = graph.input("parameters", len(model.parameters))
        dt: float | Duration
        if step is None:
            given = graph.input("dt", 1)
            dt = Duration("dt[0]", given.symbol)
        else:
            dt = step
        state, memory = carry[: self.num_states], carry[self.num_states :]

        def rates(x: Value, m: Value) -> Value:
            return graph.call(self.rates, x, m, commands, environment, parameters, tau)

        def advance(m: Value, after: float | Duration) -> Value:
            if not model.memory:
                return m
            return graph.call(self.advance, state, m, commands, environment, parameters, graph.number(after))

        after, memory_after = integrate(rates, advance, graph.add, state, memory, dt, method)  # type: ignore[arg-type]
        return graph.finish(graph.pack(after, memory_after))

    def begun(self) -> Formula:
        """(commands, parameters) -> memories that have reached their orders, as far as their stops let them."""
        model = self.model
        commands, parameters = SX.sym("commands", len(model.commands)), SX.sym("parameters", len(model.parameters))
        ordered = ca.vertcat(SX(0, 1), *(commands[model.commands.index(name)] for name in model.memory))
        still = SX.zeros(self.num_states), SX.zeros(len(model.environment))
        reached = ca.densify(SX(model.advance(still[0], ordered, commands, still[1], parameters, 0)))
        return Formula(ca.Function("begun", [commands, parameters], [reached], ["commands", "parameters"], ["out"]))

    @cached_property
    def aboard(self) -> Formula:
        """State with horizontal u, v, r, as a log has them -> state with those along the ship's axes."""
        state = SX.sym("state", self.num_states)
        now = self._by_name(state)
        made = ca.densify(ca.vertcat(*(now | aboard(now, ca)).values()))
        return Formula(ca.Function("aboard", [state], [made], ["state"], ["out"]))

    def horizontal(self, carry: SX) -> list[SX]:
        """u, v, r of a carry in the horizontal plane."""
        return list(horizontal(self._by_name(carry), ca).values())

    def _by_name(self, carry: SX) -> dict[str, SX]:
        return dict(zip((*self.model.state, *self.model.hidden), ca.vertsplit(carry), strict=False))

    def index(self, names: Sequence[str]) -> dict[str, int]:
        """Place of some states or memories in a carry."""
        every = (*self.model.state, *self.model.hidden, *self.model.memory)
        return {name: every.index(name) for name in names}


def rollout(
    graph: Graph,
    step: Graph,
    carry: Value,
    series: Mapping[str, tuple[Value, bool]],
    parameters: Value,
    count: int,
) -> Value:
    """Carries after 1 ... count steps, one after the other.

    series : `commands`, `environment` and `tau_extra`, each with whether it has a row for each step.
    """
    names = [name for name, _ in step.inputs if name in series]
    each = [name for name in names if series[name][1]]
    body = Graph("rolled")
    given = {"carry": body.input("carry", carry.size)}
    for name in each:
        given[name] = body.input(name, series[name][0].size // count)
    held = [name for name in names if not series[name][1]]
    for name in held:
        given[name] = body.input(name, series[name][0].size)
    given["parameters"] = body.input("parameters", parameters.size)
    after = body.call(step, *(given[name] for name, _ in step.inputs))
    body.finish(after)
    rows = [series[name][0] for name in each]
    return graph.scan(body, carry, rows, [*(series[name][0] for name in held), parameters], count)
