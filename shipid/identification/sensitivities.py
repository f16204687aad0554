"""Variational equations: the ship's motion and its forward sensitivities to the unknowns, in one integration.

S = dz/d[node, factors, nuisances] of the state z goes along by S' = (df/dz) S + df/d[...]: the exact derivative of the
discrete motion. The node is the initial state of a prediction. Numbers are inputs; states that do not influence a
fitted signal are left out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np
from casadi import SX

from shipid.data.dataset import Array
from shipid.engine.casadi import summed_rates
from shipid.engine.integrate import Method, integrate_step
from shipid.identification.settings import MOVING
from shipid.interrupts import hold_interrupts
from shipid.physics.signals import is_output, is_steering
from shipid.simulation.log import body_velocities, horizontal_velocities
from shipid.vessel.dynamics import Dynamics

THRUST = re.compile(r"thruster\.[^.]+\.(?:k_T|(?:K_T|K_T_astern|C_T)\..+|k_P|k_J|T_nn|T_nu|T_uu|dT_nu)")
"""Parameters in which the thrust of azimuth units and screws is linear."""


@dataclass(frozen=True)
class FitLayout:
    """Structure of a fit without its numbers: the key under which equations are built and compiled.

    groups : paths that share each factor. signals : fitted columns. nuisances : scalars, those that change the motion
    first. weather : environment channels that are inputs; the others are 0. lags : largest delay of commands in steps.
    """

    model: Dynamics
    groups: tuple[tuple[str, ...], ...]
    signals: tuple[str, ...]
    nuisances: tuple[str, ...]
    weather: tuple[str, ...]
    lags: int
    step: float
    method: Method

    @property
    def num_moving(self) -> int:
        """Number of nuisances that change the motion."""
        return sum(name in MOVING for name in self.nuisances)

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Fitted outputs of components, such as `propeller.thrust`."""
        return tuple(name for name in self.signals if is_output(name))

    @cached_property
    def num_seen(self) -> int:
        """Inputs of the residuals at each instant: signals, their weights; with outputs also commands and weather."""
        now = len(self.model.commands) * (1 + self.lags) + len(self.weather) if self.outputs else 0
        return 2 * len(self.signals) + now

    @cached_property
    def carried(self) -> bool:
        """Whether the actuator states depend on an unknown, and so are integrated with sensitivities."""
        free = any(".actuator." in path for group in self.groups for path in group)
        return bool(self.model.memory) and (free or "latency" in self.nuisances)


def is_thrust(path: str) -> bool:
    """Whether a parameter is a thrust coefficient of any kind of thruster, which `thrust_scale` multiplies."""
    return THRUST.fullmatch(path) is not None


@dataclass(frozen=True, eq=False)
class Variation:
    """The variational equations of one layout as SX functions of dense vectors.

    rates : (z, m, fixed, known) -> d(z)/dt; z holds the states and the columns of S, m memories (and theirs).
    advance : (m, fixed, known, dt) -> m after dt.
    outputs : (z, m, fixed, seen) -> weighted residuals and their sensitivities, column by column.
    begin : (measured, nuisances) -> states of a node for the row `measured` of the log.
    begin_slope : derivative of `begin` to the nuisances. states : names of the states.
    node : names of the node's entries: states, then memories where they depend on an unknown.
    """

    layout: FitLayout
    rates: ca.Function
    advance: ca.Function
    outputs: ca.Function
    begin: ca.Function
    begin_slope: ca.Function
    states: tuple[str, ...]
    node: tuple[str, ...]

    @cached_property
    def entries(self) -> tuple[str, ...]:
        """Names of the log columns that `begin` takes as `measured`."""
        return _initial_columns(self.states)

    @property
    def num_columns(self) -> int:
        """Number of columns of S: node, factors, and nuisances that change the motion."""
        return len(self.node) + len(self.layout.groups) + self.layout.num_moving

    @property
    def size(self) -> int:
        """Number of entries of the state with its sensitivities; includes memories where they are integrated."""
        return len(self.node) * (1 + self.num_columns)

    @cached_property
    def step(self) -> ca.Function:
        """(x, fixed, known, seen) -> (x after one step, outputs there); x is the node with its sensitivities."""
        layout, num = self.layout, len(self.states) * (1 + self.num_columns)
        x, fixed = SX.sym("x", self.size), SX.sym("fixed", self.rates.size1_in(2))
        known, seen = SX.sym("known", self.rates.size1_in(3)), SX.sym("seen", layout.num_seen)
        count = len(layout.model.memory)
        memory = x[num:] if layout.carried else known[known.shape[0] - count :]
        after, later = integrate_step(
            lambda z, m: self.rates(z, m, fixed, known),
            lambda m, dt: self.advance(m, fixed, known, dt),
            lambda z, a, k: z + a * k,
            x[:num],
            memory,
            layout.step,
            layout.method,
        )
        record = self.outputs(after, later, fixed, seen)
        following = ca.vertcat(after, later) if layout.carried else after
        return ca.Function("step", [x, fixed, known, seen], [following, record], {"cse": True})


class _Ship:
    """Symbols of all inputs of a layout, and the ship's equations in these symbols.

    moving, seen : unknowns that change the motion (factors, then nuisances), and nuisances that only the measurement
    shows. fixed, known : inputs that are constant along a run, and those of every step: commands, weather, and actuator
    states that are not integrated. now : commands and weather at the instant of a measured output, if one is fitted.
    """

    def __init__(self, layout: FitLayout) -> None:
        model = layout.model
        self.layout, self.model = layout, model
        self.theta, self.q = SX.sym("theta", len(layout.groups)), SX.sym("q", len(layout.nuisances))
        self.base = SX.sym("base", len(model.parameters))
        self.scale = SX.sym("scale", sum(map(len, layout.groups)))
        self.commands = SX.sym("commands", len(model.commands) * (1 + layout.lags))
        self.weather = SX.sym("weather", len(layout.weather))
        self.memory = SX.sym("memory", len(model.memory))
        self.names = (*model.state, *model.hidden)
        each, moving = ca.vertsplit(self.q) if layout.nuisances else [], layout.num_moving
        self.value_of = dict(zip(layout.nuisances, each, strict=True))
        self.moving, self.seen = ca.vertcat(self.theta, *each[:moving]), ca.vertcat(SX(0, 1), *each[moving:])
        self.fixed = ca.vertcat(self.theta, self.q, self.base, self.scale)
        given = [] if layout.carried else [SX.sym("given", self.memory.shape[0])]  # goes in as the memory
        self.known = ca.vertcat(self.commands, self.weather, *given)
        self.now = ca.vertcat(self.commands, self.weather) if layout.outputs else SX(0, 1)
        commands = _delay_commands(layout, self.commands, self.value_of)
        environment = _environment_channels(layout, self.weather, self.value_of)
        parameters = _scaled_parameters(layout, self.base, self.scale, self.theta, self.value_of)
        self.orders = [self.memory, commands, environment, parameters]
        zero = self.value_of.get("helm_zero", SX(1, 1))
        memory, actual = (
            part - zero * ca.DM([float(is_steering(name)) for name in names])
            for part, names in ((self.memory, model.memory), (commands, model.commands))
        )
        self.inputs = [memory, actual, environment, parameters]

    def rates(self, state: SX) -> SX:
        """d(state)/dt of the whole state, in calm water."""
        drawn = {term.path: ca.DM.zeros(sum(term.widths.values()), 1) for term in self.model.drawn}
        return SX(summed_rates(self.model, [state, *self.inputs], SX(self.model.num_dof, 1), drawn))

    def advance(self, dt: SX) -> SX:
        """Actuator states after a time dt [s]."""
        return SX(self.model.advance(SX(len(self.names), 1), *self.orders, dt))

    def signals(self, state: SX, names: Sequence[str], values: SX) -> SX:
        """Fitted signals: of the whole state, of which `values` are those called `names`."""
        shown: dict[str, SX] = {}
        if self.layout.outputs:
            outputs = SX(self.model.measured(state, *self.inputs))
            shown = dict(zip(self.model.outputs, ca.vertsplit(outputs), strict=True))
        return _sensed_signals(
            self.layout.signals, dict(zip(names, ca.vertsplit(values), strict=True)) | shown, self.value_of
        )


@lru_cache(maxsize=32)
def build_variation(layout: FitLayout) -> Variation:
    """Build the variational equations of a layout; the result is cached."""
    ship = _Ship(layout)
    needed = _influential_states(ship)
    states = tuple(ship.names[i] for i in needed)
    node = (*states, *layout.model.memory) if layout.carried else states
    z, whole = SX.sym("states", len(needed)), SX(len(ship.names), 1)
    whole[needed] = z
    f, dt = ship.rates(whole)[needed], SX.sym("dt")
    later, h = ship.advance(dt), ship.signals(whole, states, z)
    width = len(node) + ship.moving.shape[0]
    S, D = SX.sym("S", len(states), width), SX.sym("D", ship.memory.shape[0] if layout.carried else 0, width)

    def direct(result: SX) -> SX:
        """Direct derivative to [node, factors, nuisances]; that to the node is 0."""
        return ca.horzcat(SX(result.shape[0], len(node)), ca.jacobian(result, ship.moving))

    slope, more = ca.jacobian(f, z) @ S + direct(f), SX(0, width)
    if layout.carried:
        slope += ca.jacobian(f, ship.memory) @ D
        more = ca.jacobian(later, ship.memory) @ D + direct(later)
    seen, count = SX.sym("seen", 2 * len(layout.signals)), len(layout.signals)
    moved = ca.jacobian(h, z) @ S
    if layout.outputs:
        moved += direct(h)
        if layout.carried:
            moved += ca.jacobian(h, ship.memory) @ D
    R = ca.horzcat(moved, ca.jacobian(h, ship.seen))
    weighted = [seen[count:] * (h - seen[:count]), ca.vec(ca.repmat(seen[count:], 1, R.shape[1]) * R)]
    entries, begin = _initial_state(states, ship.value_of)
    both = {"z": ca.vertcat(z, ca.vec(S)), "m": ca.vertcat(ship.memory, ca.vec(D)), "fixed": ship.fixed}
    timed = {"m": both["m"], "fixed": ship.fixed, "known": ship.known, "dt": dt}
    return Variation(
        layout=layout,
        rates=_variation_function("rates", {**both, "known": ship.known}, ca.vertcat(f, ca.vec(slope))),
        advance=_variation_function("advance", timed, ca.vertcat(later, ca.vec(more))),
        outputs=_variation_function("outputs", {**both, "seen": ca.vertcat(seen, ship.now)}, ca.vertcat(*weighted)),
        begin=_variation_function("begin", {"measured": entries, "nuisances": ship.q}, begin),
        begin_slope=_variation_function(
            "slope", {"measured": entries, "nuisances": ship.q}, ca.jacobian(begin, ship.q)
        ),
        states=states,
        node=node,
    )


def _variation_function(name: str, inputs: Mapping[str, SX], result: SX) -> ca.Function:
    return ca.Function(name, list(inputs.values()), [ca.densify(result)], list(inputs), ["result"], {"cse": True})


def _scaled_parameters(layout: FitLayout, base: SX, scale: SX, theta: SX, value_of: Mapping[str, SX]) -> SX:
    """Every parameter of the vessel: its base value, or scale x factor; thrust coefficients times their scale."""
    place = {path: i for i, path in enumerate(layout.model.parameters)}
    result, number = SX(base), 0
    for i, group in enumerate(layout.groups):
        for path in group:
            result[place[path]] = scale[number] * theta[i]
            number += 1
    if "thrust_scale" in value_of:
        for path in filter(is_thrust, layout.model.parameters):
            result[place[path]] *= value_of["thrust_scale"]
    return result


def _delay_commands(layout: FitLayout, commands: SX, value_of: Mapping[str, SX]) -> SX:
    """Commands delayed by the nuisance `latency` [s]; linear interpolation between steps.

    commands : values at this step, then at the `lags` steps before it.
    """
    parts = ca.vertsplit(commands, [i * len(layout.model.commands) for i in range(layout.lags + 2)])
    if "latency" not in value_of:
        return parts[0]
    late = value_of["latency"] / layout.step
    return sum((ca.fmax(0, 1 - ca.fabs(late - j)) * part for j, part in enumerate(parts)), SX(parts[0].shape[0], 1))


def _environment_channels(layout: FitLayout, weather: SX, value_of: Mapping[str, SX]) -> SX:
    """All environment channels: from the inputs, from the nuisances, or 0."""
    channel = dict(zip(layout.weather, ca.vertsplit(weather) if layout.weather else [], strict=True))
    if "current_north" in value_of:
        north, east = value_of["current_north"], value_of["current_east"]
        channel |= {"V_c": ca.sqrt(north**2 + east**2), "beta_c": ca.atan2(east, north)}
    return ca.vertcat(SX(0, 1), *(channel.get(name, SX(1, 1)) for name in layout.model.environment))


def _sensed_signals(signals: Sequence[str], state: Mapping[str, SX], value_of: Mapping[str, SX]) -> SX:
    """Signals of a log with the sensor faults in `value_of`, from the true states and outputs.

    Velocities are horizontal. heading_bias [rad] is added to the true heading, and u and v are resolved along the
    biased heading: the velocity over ground is unchanged, and then times velocity_scale. The logged point is lever_arm
    [m] ahead of the origin.
    """
    zero = SX(1, 1)
    b, x = value_of.get("heading_bias", zero), value_of.get("lever_arm", zero)
    u, v, r = map(SX, horizontal_velocities({**dict.fromkeys(("u", "v", "r"), zero), **state}, ca).values())
    psi = state.get("psi", zero)
    across, scale = v + x * r, value_of.get("velocity_scale", zero + 1)
    read = {
        "u": lambda: scale * (ca.cos(b) * u + ca.sin(b) * across) + value_of.get("velocity_bias_u", zero),
        "v": lambda: scale * (ca.cos(b) * across - ca.sin(b) * u) + value_of.get("velocity_bias_v", zero),
        "r": lambda: r + value_of.get("rate_bias", zero),
        "psi": lambda: psi + b,
        "north": lambda: state["north"] + x * ca.cos(psi),
        "east": lambda: state["east"] + x * ca.sin(psi),
    }
    return ca.vertcat(*(read[name]() if name in read else state[name] for name in signals))


def _initial_state(states: Sequence[str], value_of: Mapping[str, SX]) -> tuple[SX, SX]:
    """Symbols of a row of the log, and the true states for which `_sensed_signals` gives that row: its inverse."""
    entry = {name: SX.sym(name) for name in _initial_columns(states)}
    zero = SX(1, 1)
    b, x = value_of.get("heading_bias", zero), value_of.get("lever_arm", zero)
    scale = value_of.get("velocity_scale", zero + 1)
    u, v = ((entry[name] - value_of.get(f"velocity_bias_{name}", zero)) / scale for name in ("u", "v"))
    psi, r = entry["psi"] - b, entry["r"] - value_of.get("rate_bias", zero)
    true = dict(entry)
    true |= {"u": ca.cos(b) * u - ca.sin(b) * v, "v": ca.sin(b) * u + ca.cos(b) * v - x * r, "psi": psi, "r": r}
    true |= body_velocities(true, ca)
    true |= {"north": entry["north"] - x * ca.cos(psi), "east": entry["east"] - x * ca.sin(psi)}
    return ca.vertcat(*entry.values()), ca.vertcat(*(true[name] for name in states))


def _initial_columns(states: Sequence[str]) -> tuple[str, ...]:
    """Columns needed for an initial state: the states, and the columns that sensor faults mix with them."""
    return tuple(dict.fromkeys(("u", "v", "r", "psi", "north", "east", *states)))


def _influential_states(ship: _Ship) -> list[int]:
    """Indices of the states that influence a fitted signal, directly or through other states; u, v, r always."""
    x = SX.sym("x", len(ship.names))
    h = ship.signals(x, ship.names, x)
    felt, seen = (np.array(ca.DM(ca.jacobian_sparsity(result, x), 1)) != 0 for result in (ship.rates(x), h))
    wanted = seen.any(axis=0) | np.isin(ship.names, ("u", "v", "r"))  # the motion itself
    while (more := wanted | felt[wanted].any(axis=0)).sum() > wanted.sum():
        wanted = more
    return [int(i) for i in np.flatnonzero(wanted)]


@lru_cache(maxsize=32)
def prediction_scan(layout: FitLayout, num_steps: int) -> ca.Function:
    """One prediction on CasADi's virtual machine: (x, fixed, known, seen) -> outputs of each of `num_steps` steps."""
    model = build_variation(layout)
    one = model.step
    x, fixed = ca.MX.sym("x", one.size1_in(0)), ca.MX.sym("fixed", one.size1_in(1))
    known, seen = (ca.MX.sym(name, one.size1_in(i), num_steps) for i, name in ((2, "known"), (3, "seen")))
    record = one.mapaccum(num_steps)(x, ca.repmat(fixed, 1, num_steps), known, seen)[1]
    return ca.Function("prediction", [x, fixed, known, seen], [record])


def run_machine(layout: FitLayout, x: Array, fixed: Array, known: Array, seen: Array) -> Array:
    """Outputs (1, K, N, .) of K predictions of N steps, by CasADi's virtual machine.

    x : (K, size) initial states with their sensitivities. fixed : (K, .) constants of each prediction.
    known, seen : (K, N, .) inputs, and measured signals with their weights.
    """
    count, num_steps = known.shape[:2]
    with hold_interrupts():
        record = prediction_scan(layout, num_steps).map(count)(
            x.T, fixed.T, known.reshape(count * num_steps, -1).T, seen.reshape(count * num_steps, -1).T
        )
    return np.array(record).T.reshape(1, count, num_steps, -1)
