"""Equations of motion of a vessel as CasADi functions: the sum of its force terms."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
from casadi import SX

from shipid import document as documents
from shipid.arguments import check_class
from shipid.errors import DocumentError, ShipidError, suggest_name
from shipid.physics import ACTUATORS, GIVEN, TERMS, Term
from shipid.physics.frames import column_vector, current_velocity, heave_rate, position_rates
from shipid.physics.helm import Helmsman
from shipid.physics.inertia import added_mass_entries, coriolis_force, mass_matrix, rigid_body_entries
from shipid.physics.returned import check_returned
from shipid.physics.signals import rows_of_role, signal_units
from shipid.plugins import definition_location, is_user_code
from shipid.units import plural_word
from shipid.vessel.load import Vessel
from shipid.vessel.schema import (
    BEHIND,
    DOFS,
    Binding,
    active_actuators,
    bind_document,
    call_user_function,
    check_term,
    equation_functions,
    function_parameters,
    function_signals,
    parameter_units,
    structural_keys,
    term_blocks,
    term_parameters,
    term_states,
    upstream_signals,
    vessel_model,
)

ETA = ("north", "east", "down", "phi", "theta", "psi")
NU = ("u", "v", "w", "p", "q", "r")
INPUTS = ("state", "memory", "commands", "environment", "parameters")
LAST = {"rates": "tau_extra", "advance": "dt", "sum": "component"}  # input of each function beside those of all
PLANE, HEAVE = DOFS[3], 2
CORIOLIS = {"full": PLANE, "mmg": (0, 1), "none": ()}  # axes on which added mass turns with the ship by formula
HELM = "(helm)"  # prefix of the states of a helmsman: no thruster has such a name
WASH = 3  # numbers that a propeller gives to what is behind it, `shipid.physics.propeller.propeller_wash`
UNROLL_UP_TO = 32  # components: beyond it a sum is mapped, not written out


@dataclass(frozen=True, eq=False)
class SumOverComponents:
    """A term written for one component, to be mapped over its components and added to tau_extra.

    path : of the term's block.
    function : (state, memory, commands, environment, parameters, component) -> wrench (n_dof).
    widths : component argument -> how many entries of `component` it takes, in order.
    arrays : (num_components, num_entries); None where they are drawn for each sample of a rollout.
    """

    path: str
    function: ca.Function
    widths: Mapping[str, int]
    arrays: np.ndarray | None


@dataclass(frozen=True, eq=False)
class Dynamics:
    """The symbolic right-hand side of a vessel's structure; numbers are inputs.

    rates, advance, orders, measured : functions of `INPUTS`, and tau_extra or dt: d(state)/dt, the memory after dt,
        the order of each actuator, what instruments on the components show.
    state, hidden : names of the entries of the state vector: eta and nu, then the states that terms keep.
    memory, commands, environment, parameters : names of the entries of each other input vector.
    ordered : names of the orders: the commands, unless a helmsman gives them.
    outputs : name -> unit of the entries of `measured`: `propeller.thrust`.
    """

    rates: ca.Function
    advance: ca.Function
    orders: ca.Function
    measured: ca.Function
    sums: tuple[SumOverComponents, ...]
    state: tuple[str, ...]
    hidden: tuple[str, ...]
    memory: dict[str, str]
    commands: tuple[str, ...]
    environment: tuple[str, ...]
    parameters: tuple[str, ...]
    ordered: tuple[str, ...]
    outputs: dict[str, str]
    helmsman: Helmsman | None = None

    @property
    def num_dof(self) -> int:
        """Degrees of freedom."""
        return len(self.state) // 2

    @property
    def drawn(self) -> tuple[SumOverComponents, ...]:
        """Sums whose components are drawn for each sample."""
        return tuple(term for term in self.sums if term.arrays is None)


_compiled: dict[tuple[Any, ...], Dynamics] = {}


def vessel_dynamics(vessel: Vessel, helmsman: Helmsman | None = None) -> Dynamics:
    """Equations of a vessel; vessels of one structure (all members of a family) share one object.

    With a helmsman, its inputs take the place of the commands; DocumentError if its orders do not fit the vessel.
    ShipidError for what is no vessel.
    """
    check_class("vessel", vessel, Vessel, "as of `load_vessel`")  # here all that simulate, fit or identify come by
    key = (
        vessel.structure,
        helmsman,
        *equation_functions(vessel.document).values(),
    )  # a notebook may put another into TERMS
    if key not in _compiled:
        _compiled[key] = _assemble_dynamics(vessel, helmsman)
    return _compiled[key]


def _named_symbols(name: str, entries: Sequence[str]) -> tuple[SX, dict[str, SX]]:
    """A symbolic vector, and its entries by name."""
    vector = SX.sym(name, len(entries))
    return vector, dict(zip(entries, ca.vertsplit(vector) if entries else [], strict=True))


def _assemble_dynamics(vessel: Vessel, helmsman: Helmsman | None) -> Dynamics:
    axes = vessel.axes
    rows = list(axes)
    terms = list(term_blocks(vessel.document))
    for _, key, _ in terms:  # a notebook may have put another into TERMS since the vessel was read
        check_term(key)
    if any(is_user_code(function) for held in equation_functions(vessel.document).values() for function in held):
        documents.parse_model(vessel_model(vessel.document), vessel.document, vessel.file)
        if (bind_document(vessel.document), parameter_units(vessel.document)) != (vessel.bound, vessel.units):
            raise ShipidError("its terms take other numbers than when it was read: load it again", file=vessel.file)
    names = tuple(ETA[i] for i in axes) + tuple(NU[i] for i in axes)
    hidden = {
        path: [f"{path}.{name}" for name in term_states(key, block)]
        for path, key, block in terms
        if TERMS[key].states is not None
    }
    known = rows_of_role("command")
    ordered = tuple(
        f"{path.rsplit('.', 1)[-1]}.{signal}"  # `port.n`, by the last part of the path of the block
        for path, key, _ in terms
        for signal in function_signals(TERMS[key].function)
        if signal in known
    )
    state, state_of = _named_symbols("state", [*names, *(name for entries in hidden.values() for name in entries)])
    commands, input_of = _named_symbols("commands", tuple(helmsman.inputs) if helmsman else ordered)
    wanted = {name for _, key, _ in terms for name in function_signals(TERMS[key].function)}
    wanted |= {"V_c", "beta_c"} if "current" in vessel.document else set()
    environment, weather = _named_symbols(
        "environment", [name for name in rows_of_role("environment") if name in wanted]
    )
    parameters, value_of = _named_symbols("parameters", list(vessel.parameters))
    tau_extra, dt = SX.sym("tau_extra", len(axes)), SX.sym("dt")
    bound = vessel.bound

    helm: dict[str, SX] = {name: SX.sym(name) for name in (helmsman.memory if helmsman else ())}
    orders, helm_after = dict(input_of), list(helm.values())
    if helmsman:
        seen = {name: state_of[name] for name in names}
        orders = _orders_by_command(helmsman, ordered, helmsman.orders(seen, input_of, helm), vessel)
        if helmsman.advance:
            after = helmsman.advance(seen, input_of, helm, dt)
            helm_after = [after[name] for name in helm]
    lags, actual, lags_after = _assemble_actuators(terms, bound, orders, value_of, dt)
    memory = {**{f"{HELM}.{name}": symbol for name, symbol in helm.items()}, **lags}

    eta, nu = SX(6, 1), SX(6, 1)
    for position, axis in enumerate(axes):
        eta[axis], nu[axis] = state[position], state[len(axes) + position]
    nu_c, nu_c_dot = SX(6, 1), SX(6, 1)
    if "current" in vessel.document:
        nu_c, nu_c_dot = current_velocity(eta, nu, weather["V_c"], weather["beta_c"], heaves=HEAVE in axes)
    nu_r = nu - nu_c
    states_of = {path: ca.vertcat(*(state_of[name] for name in entries)) for path, entries in hidden.items()}
    available = {"eta": eta, "nu": nu, "nu_r": nu_r, "psi": eta[5], **weather, **actual}

    M_RB = mass_matrix(rigid_body_entries(**_symbol_arguments(bound["inertia"], value_of)))
    M_A = mass_matrix(added_mass_entries(**_symbol_arguments(bound["added_mass"], value_of)))
    kept = CORIOLIS[vessel.document.get("added_mass", {}).get("coriolis", "full")]
    force = _added_mass_force(M_A, nu_r, kept)
    if vessel.document["inertia"].get("coriolis", "full") == "full":
        force -= coriolis_force(
            M_RB, nu_r
        )  # with the water's own motion of M_RB nu_c_dot: that of nu (Fossen 2021, 10.3)
    if HEAVE in axes:
        force += _upright_correction(eta, nu_r, M_RB[0, 0])
    available |= _component_outputs(terms, available, bound, value_of, outputs=False)
    summed, mapped = _sum_of_terms(terms, available, states_of, bound, value_of)
    shown = _component_outputs(terms, available, bound, value_of, outputs=True)
    inverse = ca.inv_minor if len(rows) <= 3 else ca.inv  # four masses multiplied overflow single precision
    through_water = inverse(ca.densify((M_RB + M_A)[rows, rows])) @ ((force + summed)[rows] + tau_extra)
    acceleration = through_water + nu_c_dot[rows]
    more = [
        _state_rates(key, rates, {**available, "state": states_of[path]}, _symbol_arguments(bound[path], value_of))
        for path, key, _ in terms
        if (rates := TERMS[key].rates) is not None
    ]
    inputs = [state, ca.vertcat(*memory.values()), commands, environment, parameters]

    def function(name: str, result: SX, *extra: SX) -> ca.Function:
        last = [LAST[name.split("_")[0]]] if extra else []
        return ca.Function(name, [*inputs, *extra], [ca.densify(result)], [*INPUTS, *last], ["result"], {"cse": True})

    return Dynamics(
        rates=function("rates", ca.vertcat(position_rates(eta, nu)[rows], acceleration, *more), tau_extra),
        advance=function("advance", ca.vertcat(*helm_after, *lags_after), dt),
        orders=function("orders", ca.vertcat(*(orders[name] for name in ordered))),
        measured=function("measured", ca.vertcat(SX(0, 1), *shown.values())),
        sums=tuple(
            SumOverComponents(path, function(f"sum_{i}", wrench[rows], entry), widths, arrays)
            for i, (path, entry, wrench, widths, arrays) in enumerate(mapped)
        ),
        state=names,
        hidden=tuple(name for entries in hidden.values() for name in entries),
        memory={**dict.fromkeys(memory, "-"), **signal_units(lags)},
        commands=tuple(input_of),
        environment=tuple(weather),
        parameters=tuple(vessel.parameters),
        ordered=ordered,
        outputs=signal_units(shown),
        helmsman=helmsman,
    )


def _added_mass_force(M_A: SX, nu_r: SX, kept: tuple[int, ...]) -> SX:
    """Force (6) of added mass beyond -M_A d(nu_r)/dt.

    Surge, sway and yaw have the Coriolis terms of manoeuvring in calm water, on the axes `kept`. Heave acts in the
    inertial frame, on w_dot + p v - q u, and what is coupled to it has no others.
    """
    heave = nu_r[0] * nu_r[4] - nu_r[1] * nu_r[3]
    plane = ca.diag(column_vector(*(1 if axis in PLANE else 0 for axis in range(6))))
    turning = ca.diag(column_vector(*(1 if axis in kept else 0 for axis in range(6))))
    return M_A @ column_vector(0, 0, heave, 0, 0, 0) - turning @ coriolis_force(plane @ M_A @ plane, plane @ nu_r)


def _upright_correction(eta: SX, nu: SX, m: SX) -> SX:
    """Correction (6) of heave forces, which act vertically and not along the inclined body axis.

    The momentum of heave m h rotates with the body axes: -m q h in surge, m p h in sway; its cause stays vertical.
    Without it heave of a rolling ship has a mean along the body axes, which the table of mean drift includes already.
    """
    h = heave_rate(eta, nu)
    return column_vector(m * nu[4] * h, -m * nu[3] * h, 0, 0, 0, 0)


def _state_rates(
    key: str, function: Callable[..., Any], available: Mapping[str, SX], keywords: Mapping[str, Any]
) -> SX:
    """d(state)/dt of the additional states of a term, by its function."""
    where, count = f"rates of {key}", available["state"].numel()
    value, given = _call_term(where, key, function, available, keywords)
    words = f"{count} {plural_word(count, 'number')}, one for each of its states"
    return check_returned(where, function, value, given, count, words)


def _call_term(
    where: str, key: str, function: Callable[..., Any], available: Mapping[str, SX], keywords: Mapping[str, Any]
) -> tuple[Any, list[Any]]:
    """What a function of a term returns for its signals, selected by name, and those keywords that it takes; and these.

    where : the function in words, for errors.
    """
    others = {parameter.name for parameter in term_parameters(TERMS[key])}
    others -= {parameter.name for parameter in function_parameters(function)}
    kept = {keyword: value for keyword, value in keywords.items() if keyword not in others}
    unknown = next((name for name in function_signals(function) if name not in available), None)
    if unknown is not None:
        remedy = suggest_name(unknown, tuple(available))
        place = definition_location(function)
        raise ShipidError(f"{where}: its positional argument {unknown!r} is no signal: {remedy}{place}")
    taken = [available[name] for name in function_signals(function)]
    return call_user_function(where, function, *taken, **kept), [*taken, *kept.values()]


def _orders_by_command(
    helmsman: Helmsman, ordered: Sequence[str], given: Mapping[str, Any], vessel: Vessel
) -> dict[str, SX]:
    """Order of each command, from the helmsman's orders by command or by signal."""
    names = {name for name in given if name in ordered or any(name == o.rsplit(".", 1)[-1] for o in ordered)}
    unknown = sorted(set(given) - names)
    result = {name: given.get(name, given.get(name.rsplit(".", 1)[-1])) for name in ordered}
    missing = [name for name, order in result.items() if order is None]
    if missing or (unknown and not names):
        raise DocumentError(
            f"{helmsman.name} gives no order for {', '.join(missing) or suggest_name(unknown[0], ordered)}",
            file=vessel.file,
        )
    return {name: SX(order) for name, order in result.items()}


def _sum_of_terms(
    terms: list[tuple[str, str, Mapping[str, Any]]],
    available: Mapping[str, SX],
    states_of: Mapping[str, SX],
    bound: Mapping[str, Binding],
    value_of: Mapping[str, SX],
) -> tuple[SX, list[tuple[str, SX, SX, dict[str, int], np.ndarray | None]]]:
    """Wrench (6) of all terms that are written out, and the sums over components that are to be mapped.

    Each of the latter is (path, component symbol, wrench of one component, widths, arrays).
    """
    total, mapped = SX(6, 1), []
    for path, key, block in terms:
        term = TERMS[key]
        extra = _of_component(path, term, block, available)
        if path in states_of:
            extra["state"] = states_of[path]
        wrench = partial(_term_wrench, key, {**available, **extra}, _symbol_arguments(bound[path], value_of))
        widths, arrays = _component_arrays(key, block)
        if arrays is not None and len(arrays) <= UNROLL_UP_TO:
            for row in arrays:
                total += wrench(dict(zip(widths, row, strict=True)))
        else:
            entry = SX.sym("component", sum(widths.values()))
            parts = ca.vertsplit(entry, [0, *np.cumsum(list(widths.values())).tolist()])
            mapped.append((path, entry, wrench(dict(zip(widths, parts, strict=True))), widths, arrays))
    return total, mapped


def _of_component(path: str, term: Term, block: Mapping[str, Any], available: Mapping[str, SX]) -> dict[str, SX]:
    """Signals of one component: commands, as its actuators have reached them, and what one that it is behind gives."""
    component = path.rsplit(".", 1)[-1]
    mine = {name: f"{component}.{name}" for name in rows_of_role("command")}
    mine |= {name: f"{block[BEHIND]}.{name}" for name in upstream_signals(term)}
    return {name: available[source] for name, source in mine.items() if source in available}


def _component_outputs(
    terms: list[tuple[str, str, Mapping[str, Any]]],
    available: Mapping[str, SX],
    bound: Mapping[str, Binding],
    value_of: Mapping[str, SX],
    *,
    outputs: bool,
) -> dict[str, SX]:
    """What components give, by name: outputs (`propeller.thrust`), or signals to what is behind (`propeller.wash`)."""
    result = {}
    for path, key, block in terms:
        for name, function in TERMS[key].gives.items():
            if (name in GIVEN) != outputs:
                here = {**available, **_of_component(path, TERMS[key], block, available)}
                where = f"{name} of {key}"
                value, given = _call_term(where, key, function, here, _symbol_arguments(bound[path], value_of))
                if value is not None:  # an output whose parameters the block lacks
                    count = 1 if outputs else WASH
                    result[f"{path.rsplit('.', 1)[-1]}.{name}"] = check_returned(where, function, value, given, count)
    return result


def _component_arrays(key: str, block: Mapping[str, Any]) -> tuple[dict[str, int], np.ndarray | None]:
    """Arguments that a term sums over, with their widths, and their values (num_components, num_entries).

    No values where they are drawn outside; one empty row for a term that sums over nothing.
    """
    term = TERMS[key]
    keys = {name: block[name] for name in structural_keys(term)}
    if term.drawn is not None:
        return dict(call_user_function(f"drawn of {key}", term.drawn, **keys)), None
    if term.components is None:
        return {}, np.zeros((1, 0))
    columns = call_user_function(f"components of {key}", term.components, **keys)
    try:
        return dict.fromkeys(columns, 1), np.column_stack([np.array(values, float) for values in columns.values()])
    except (AttributeError, TypeError, ValueError):
        raise ShipidError(
            f"components of {key} must return a table, argument -> numbers (C,), equally many"
            f", not {columns!r}{definition_location(term.components)}"
        ) from None


def _term_wrench(key: str, available: Mapping[str, SX], keywords: Mapping[str, Any], entries: Mapping[str, Any]) -> SX:
    """Wrench of one term for its signals, selected by name; `entries` are those of one component."""
    function = TERMS[key].function
    value, given = _call_term(key, key, function, {**available, **entries}, keywords)
    return check_returned(key, function, value, given, 6, "a wrench (6)")


def _assemble_actuators(
    terms: list[tuple[str, str, Mapping[str, Any]]],
    bound: Mapping[str, Binding],
    orders: Mapping[str, SX],
    value_of: Mapping[str, SX],
    dt: SX,
) -> tuple[dict[str, SX], dict[str, SX], list[SX]]:
    """Actuator states, the commands after the actuators (inputs of the terms), and the actuator states after dt."""
    memory: dict[str, SX] = {}
    actual = dict(orders)
    advanced = []
    for path, _, block in terms:
        for command, actuator in active_actuators(block):
            name = f"{path.rsplit('.', 1)[-1]}.{command}"
            member = ACTUATORS[actuator["kind"]]
            memory[name] = SX.sym(name)
            keywords = _symbol_arguments(bound[f"{path}.actuator.{command}"], value_of)
            taken = {parameter.name for parameter in function_parameters(member.output)}
            actual[name] = member.output(memory[name], **{k: v for k, v in keywords.items() if k in taken})
            advanced.append(member.advance(orders[name], memory[name], dt, **keywords))
    return memory, actual, advanced


def _symbol_arguments(binding: Binding, value_of: Mapping[str, SX]) -> dict[str, Any]:
    """Keyword arguments of a physics function, with paths replaced by their symbols."""

    def resolve(target: Any) -> Any:
        if isinstance(target, list):
            return [value_of[path] for path in target]
        if isinstance(target, dict):
            return {key: value_of[path] for key, path in target.items()}
        return value_of[target] if isinstance(target, str) else target

    return {keyword: resolve(target) for keyword, target in binding.items()}
