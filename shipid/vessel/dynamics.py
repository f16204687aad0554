"""From a vessel to equations: one short place where the terms are summed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
from casadi import SX

from shipid.physics import ACTUATORS, SIGNALS, TERMS, Term
from shipid.physics.frames import current, kinematics
from shipid.physics.inertia import added_mass, coriolis, rigid_body
from shipid.vessel.bindings import Binding, bindings
from shipid.vessel.load import Vessel
from shipid.vessel.schema import counts, signals, term_blocks

ETA = ("north", "east", "down", "phi", "theta", "psi")
NU = ("u", "v", "w", "p", "q", "r")
ETA_UNITS = ("m", "m", "m", "rad", "rad", "rad")
INPUTS = ("state", "memory", "commands", "environment", "parameters")
UNROLL_UP_TO = 32  # components: beyond it a sum is mapped, not written out


@dataclass(frozen=True, eq=False)
class SumOverComponents:
    """A term written for one component, to be mapped over its component arrays and added to tau_extra.

    function : (state, memory, commands, environment, parameters, component) -> wrench (n_dof).
    arrays : (num_components, num_arguments).
    """

    function: ca.Function
    arrays: np.ndarray


@dataclass(frozen=True, eq=False)
class Dynamics:
    """The symbolic right-hand side of a vessel's structure; numbers are inputs.

    rates : (state, memory, commands, environment, parameters, tau_extra) -> d(state)/dt.
    advance : (state, memory, commands, environment, parameters, dt) -> memory after dt, exactly.
    state, memory, commands, environment, parameters : names of the entries of each input vector.
    """

    rates: ca.Function
    advance: ca.Function
    sums: tuple[SumOverComponents, ...]
    state: tuple[str, ...]
    memory: dict[str, str]
    commands: tuple[str, ...]
    environment: tuple[str, ...]
    parameters: tuple[str, ...]

    @property
    def num_dof(self) -> int:
        """Degrees of freedom."""
        return len(self.state) // 2


_compiled: dict[str, Dynamics] = {}


def dynamics(vessel: Vessel) -> Dynamics:
    """Equations of a vessel; vessels of one structure (all members of a family) share one object."""
    if vessel.structure not in _compiled:
        _compiled[vessel.structure] = _assemble(vessel)
    return _compiled[vessel.structure]


def _assemble(vessel: Vessel) -> Dynamics:
    axes = vessel.axes
    state_names = tuple(ETA[i] for i in axes) + tuple(NU[i] for i in axes)
    terms = list(term_blocks(vessel.document))
    command_names = tuple(
        f"{path.rsplit('.', 1)[-1]}.{signal}"
        for path, key, _ in terms
        for signal in signals(TERMS[key].function)
        if signal in SIGNALS.commands
    )
    environment_names = _environment(vessel)
    state, commands = SX.sym("state", 2 * len(axes)), SX.sym("commands", len(command_names))
    environment = SX.sym("environment", len(environment_names))
    parameters = SX.sym("parameters", len(vessel.parameters))
    tau_extra, dt = SX.sym("tau_extra", len(axes)), SX.sym("dt")
    value_of = dict(zip(vessel.parameters, ca.vertsplit(parameters) if len(vessel.parameters) else [], strict=True))
    bound = bindings(vessel.document)

    eta, nu = SX(6, 1), SX(6, 1)
    for position, axis in enumerate(axes):
        eta[axis], nu[axis] = state[position], state[len(axes) + position]
    given = dict(zip(command_names, ca.vertsplit(commands) if command_names else [], strict=True))
    given.update(zip(environment_names, ca.vertsplit(environment) if environment_names else [], strict=True))

    memory, actual, advanced = _actuators(terms, bound, given, value_of, dt)

    nu_c, nu_c_dot = SX(6, 1), SX(6, 1)
    if "current" in vessel.document:
        nu_c, nu_c_dot = current(eta, nu, given["V_c"], given["beta_c"])
    nu_r = nu - nu_c
    shared = {"eta": eta, "nu": nu, "nu_r": nu_r, "psi": eta[5], **given}

    M_RB = rigid_body(**_values(bound["inertia"], value_of))
    M_A = added_mass(**_values(bound["added_mass"], value_of))
    force = M_A @ nu_c_dot - coriolis(M_RB, nu) - coriolis(M_A, nu_r)
    summed, mapped = _sum_of_terms(terms, {**shared, **actual}, bound, value_of)
    force += summed
    inputs = [state, ca.vertcat(*memory.values()), commands, environment, parameters]
    rows, options = list(axes), {"cse": True}
    sums = [
        SumOverComponents(
            ca.Function(
                f"sum_{i}", [*inputs, entry], [ca.densify(wrench[rows])], [*INPUTS, "component"], ["tau"], options
            ),
            arrays,
        )
        for i, (entry, wrench, arrays) in enumerate(mapped)
    ]
    acceleration = ca.inv_minor(ca.densify((M_RB + M_A)[rows, rows])) @ (force[rows] + tau_extra)
    rates = ca.vertcat(kinematics(eta, nu)[rows], acceleration)
    return Dynamics(
        rates=ca.Function(
            "rates", [*inputs, tau_extra], [ca.densify(rates)], [*INPUTS, "tau_extra"], ["rates"], options
        ),
        advance=ca.Function(
            "advance", [*inputs, dt], [ca.densify(ca.vertcat(*advanced))], [*INPUTS, "dt"], ["memory_after"], options
        ),
        sums=tuple(sums),
        state=state_names,
        memory={name: _command_unit(name) for name in memory},
        commands=command_names,
        environment=environment_names,
        parameters=tuple(vessel.parameters),
    )


def _sum_of_terms(
    terms: list[tuple[str, str, Mapping[str, Any]]],
    available: Mapping[str, SX],
    bound: Mapping[str, Binding],
    value_of: Mapping[str, SX],
) -> tuple[SX, list[tuple[SX, SX, np.ndarray]]]:
    """Wrench (6) of all terms; and, of what has too many components to write out, (component, its wrench, all)."""
    total, mapped = SX(6, 1), []
    for path, key, block in terms:
        component = path.rsplit(".", 1)[-1]
        own = {
            name: available[f"{component}.{name}"] for name in SIGNALS.commands if f"{component}.{name}" in available
        }
        wrench = partial(_wrench, TERMS[key], {**available, **own}, _values(bound[path], value_of))
        columns, arrays = _components(TERMS[key], block)
        if len(arrays) <= UNROLL_UP_TO:
            for row in arrays:
                total += wrench(dict(zip(columns, row, strict=True)))
        else:
            entry = SX.sym("component", len(columns))
            mapped.append((entry, wrench(dict(zip(columns, ca.vertsplit(entry), strict=True))), arrays))
    return total, mapped


def _components(term: Term, block: Mapping[str, Any]) -> tuple[tuple[str, ...], np.ndarray]:
    """Names and values (num_components, num_arguments) of what a term sums over; one empty row if it does not."""
    if term.components is None:
        return (), np.zeros((1, 0))
    columns = term.components(**{name: block[name] for name in counts(term)})
    return tuple(columns), np.column_stack(list(columns.values()))


def _wrench(term: Term, available: Mapping[str, SX], keywords: Mapping[str, Any], entries: Mapping[str, Any]) -> Any:
    """One term on its signals, found by name; `entries` are those of one component."""
    here = {**available, **entries}
    return term.function(*(here[name] for name in signals(term.function)), **keywords)


def _environment(vessel: Vessel) -> tuple[str, ...]:
    """Environment channels that the terms of a vessel ask for."""
    wanted = {name for _, key, _ in term_blocks(vessel.document) for name in signals(TERMS[key].function)}
    if "current" in vessel.document:
        wanted |= {"V_c", "beta_c"}
    return tuple(name for name in SIGNALS.environment if name in wanted)


def _actuators(
    terms: list[tuple[str, str, Mapping[str, Any]]],
    bound: Mapping[str, Binding],
    given: Mapping[str, SX],
    value_of: Mapping[str, SX],
    dt: SX,
) -> tuple[dict[str, SX], dict[str, SX], list[SX]]:
    """Memory states of lagged commands, the signals that the terms then see, and the states after dt."""
    memory: dict[str, SX] = {}
    actual = dict(given)
    advanced = []
    for path, _, block in terms:
        for command, actuator in (block.get("actuator") or {}).items():
            if not isinstance(actuator, Mapping):
                continue
            name = f"{path.rsplit('.', 1)[-1]}.{command}"
            member = ACTUATORS[actuator["kind"]]
            memory[name] = SX.sym(name)
            actual[name] = member.output(memory[name])
            keywords = _values(bound[f"{path}.actuator.{command}"], value_of)
            advanced.append(member.advance(given[name], memory[name], dt, **keywords))
    return memory, actual, advanced


def _values(binding: Binding, value_of: Mapping[str, SX]) -> dict[str, Any]:
    """Keywords of a physics function, paths replaced by the symbols that stand for their values."""

    def resolve(target: Any) -> Any:
        if isinstance(target, str):
            return value_of[target]
        if isinstance(target, list):
            return [value_of[path] for path in target]
        if isinstance(target, dict):
            return {key: value_of[path] for key, path in target.items()}
        return target

    return {keyword: resolve(target) for keyword, target in binding.items()}


def _command_unit(name: str) -> str:
    return SIGNALS.commands[name.rsplit(".", 1)[-1]]
