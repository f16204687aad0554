"""What each method adds to the physics, as blocks: one function a kind of corrector, listed in CORRECTORS."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from casadi import SX

from shipid.errors import ShipidError
from shipid.export.blocks import Block, Dense, Forest, Formula, Graph, Mirrored, Nearest, Value, formula
from shipid.export.equations import Equations
from shipid.export.known import Known, feature_table, past_records
from shipid.hybrid.alone import Unchanged
from shipid.hybrid.calibrator import Calibrated, TrajectoryInputs
from shipid.hybrid.compensator import Compensator, Network, Normaliser
from shipid.hybrid.features import MOTIONS
from shipid.hybrid.forest import ForestCorrector
from shipid.hybrid.hankel_dmd import MISSED, HankelCorrector
from shipid.hybrid.learned_force import ForceCorrector
from shipid.hybrid.methods import METHODS
from shipid.hybrid.modules import ModulesCorrector, without
from shipid.hybrid.one_step import OneStepCorrector
from shipid.hybrid.recurrent import GatedNetwork, RecurrentCorrector
from shipid.hybrid.stepping import LIMIT
from shipid.hybrid.units import Units
from shipid.physics.signals import measurable, plain_inputs

Array = np.ndarray


@dataclass(frozen=True)
class Taken:
    """Inputs of a corrector: names of commands, names of its inputs (without those of the past)."""

    commands: tuple[str, ...]
    names: tuple[str, ...]

    @property
    def environment(self) -> tuple[str, ...]:
        """Channels of the environment that it takes: those of the relative wind, and others as they are."""
        wind = ("V_w", "beta_w") if any(name.endswith("_rw") for name in self.names) else ()
        return (*wind, *plain_inputs(self.names))


def z_score(normaliser: Normaliser) -> Formula:
    """(value - mean) / std."""
    x = SX.sym("x", len(normaliser.names))
    return formula("z_score", [("x", x)], (x - ca.DM(normaliser.mean)) / ca.DM(normaliser.std))


def shapes(basis: Array) -> Dense:
    """Outputs x_1 ... x_r, y_1 ... y_r that weigh shapes (T, r) -> path (T, 2), row by row."""
    steps, terms = basis.shape
    weight = np.zeros((2 * terms, 2 * steps))
    weight[:terms, 0::2], weight[terms:, 1::2] = basis.T, basis.T
    return Dense(weight, np.zeros(2 * steps), name="shapes")


def mirrored(network: Network) -> Mirrored | None:
    """A network of one hidden layer as mirrored pairs, where it is made of such."""
    if len(network.layers) != 2:
        return None
    (weight, offset), (output, bias) = network.layers
    half, terms = len(offset) // 2, len(bias) // 2
    if len(offset) % 2 or not np.array_equal(offset[:half], offset[half:]):
        return None
    x, y = np.split(output, 2, axis=1)
    if not (np.array_equal(x[:half], x[half:]) and np.array_equal(y[:half], -y[half:])) or not half:
        return None
    first, second = weight[:, :half], weight[:, half:]
    place, sign = np.full(len(weight), -1), np.zeros(len(weight))
    for i, row in enumerate(second):
        for s in (1.0, -1.0):
            same = [j for j in np.flatnonzero((first == s * row).all(axis=1)) if place[j] < 0]
            if same:
                place[same[0]], sign[same[0]] = i, s
                break
    if (place < 0).any():
        return None
    return Mirrored(first, offset[:half], place, sign, x[:half], y[:half], np.asarray(bias[: 2 * terms]))


def layers(graph: Graph, value: Value, network: Network) -> Value:
    """Outputs of a network for its normalised inputs."""
    pairs = mirrored(network)
    if pairs is not None:
        return graph.call(pairs, value)
    *hidden, (weight, bias) = network.layers
    for w, b in hidden:
        value = graph.call(Dense(w, b, True), value)
    return graph.call(Dense(weight, bias), value)


def _same(arrays: Sequence[Array]) -> bool:
    return all(np.array_equal(arrays[0], other) for other in arrays[1:])


def compensated(known: Known, corrector: Compensator) -> Value:
    """Path of the physics plus the mean of networks."""
    graph, names = known.graph, _names_of(corrector)
    steps: Sequence[int] = ()
    if isinstance(corrector.inputs, TrajectoryInputs) and any(name.startswith("physics-") for name in names):
        horizon = known.names.horizon
        steps = np.unique(np.round(np.linspace(0, horizon, corrector.inputs.moments + 1)[1:]).astype(int)).tolist()
    seen = known.table(corrector.inputs, steps).values(names)
    outputs = []
    for network in corrector.networks:
        z = graph.call(z_score(network.normaliser), _chosen(graph, seen, names, network.normaliser.names))
        outputs.append(layers(graph, z, network))
    return _plus(known, outputs, [network.basis for network in corrector.networks])


def _names_of(corrector: Compensator) -> list[str]:
    return list(dict.fromkeys(name for network in corrector.networks for name in network.normaliser.names))


def _chosen(graph: Graph, value: Value, names: Sequence[str], wanted: Sequence[str]) -> Value:
    """Some entries of a vector by name."""
    if list(names) == list(wanted):
        return value
    return graph.pack(*(value[names.index(name)] for name in wanted))


def _plus(known: Known, outputs: Sequence[Value], bases: Sequence[Array]) -> Value:
    """The path of the physics plus the mean of outputs on their shapes."""
    graph = known.graph
    if _same(bases):
        mean = graph.call(shapes(bases[0]), graph.total(outputs, float(len(outputs))))
    else:
        paths = [graph.call(shapes(basis), output) for basis, output in zip(bases, outputs, strict=True)]
        mean = graph.total(paths, float(len(paths)))
    return graph.total([known.path, mean])


def alone(known: Known, corrector: Unchanged) -> Value:  # noqa: ARG001
    """Path of the physics; a learned force is among its terms already."""
    return known.path


def forest(known: Known, corrector: ForestCorrector) -> Value:
    """Path of the physics plus the mean of trees."""
    trees = corrector.trees
    block = Forest(
        trees.first, trees.left, trees.right, trees.feature, trees.threshold, trees.value, len(corrector.names)
    )
    seen = known.table(corrector.inputs).values(corrector.names)
    return _plus(known, [known.graph.call(block, seen)], [corrector.basis])


def recurrent(known: Known, corrector: RecurrentCorrector) -> Value:
    """Path of the physics plus the mean of gated recurrent networks."""
    graph = known.graph
    outputs = []
    for network in corrector.networks:
        reader = network.reader
        rows = _signals(known, reader.past.names, corrector.inputs.commands, reader.steps)
        z = graph.map(z_score(reader.past), [rows], [], reader.steps + 1)
        now = graph.call(z_score(reader.now), known.table(corrector.inputs).values(reader.now.names))
        read = _gated(network, reader.steps + 1)
        output = graph.call(read, z, now)
        if reader.mirrors is not None:
            along, at = reader.mirrors
            image = graph.map(_image(along), [z], [], reader.steps + 1)
            other = graph.call(read, image, graph.call(_image(at), now))
            one, two = SX.sym("one", output.size), SX.sym("two", output.size)
            half = ca.DM(np.repeat([1.0, -1.0], output.size // 2))
            output = graph.call(
                formula("even_odd", [("one", one), ("two", two)], (one + half * two) / 2), output, other
            )
        outputs.append(output)
    return _plus(known, outputs, [network.basis for network in corrector.networks])


def _signals(known: Known, wanted: Sequence[str], commands: tuple[str, ...], steps: int) -> Value:
    """Motion, commands and relative wind at the last steps and at the instant, row by row."""
    names = [name for name in known.names.now if name not in ("north", "east")]
    row = SX.sym("row", len(names))
    table = feature_table(dict(zip(names, ca.vertsplit(row), strict=True)), commands)
    block = formula("signals", [("row", row)], [table[name] for name in wanted])
    first = known.names.before(steps)
    rows = known.graph.pack(known.rows("past", names, first, steps), known.of("now", names))
    return known.graph.map(block, [rows], [], steps + 1)


def _image(reflection: Array) -> Formula:
    z = SX.sym("z", len(reflection))
    return formula("image", [("z", z)], (z.T @ ca.sparsify(ca.DM(reflection))).T)


def _gated(network: GatedNetwork, steps: int) -> Graph:
    """(past rows, inputs at the instant) -> outputs of a gated recurrent network."""
    parts = network.layers
    units, width = parts["W_h"].shape[1], parts["W_i"].shape[1]
    cell = Graph("cell")
    hidden, row = cell.input("hidden", units), cell.input("row", width)
    a = cell.call(Dense(parts["W_i"].T, parts["b_i"]), row)
    b = cell.call(Dense(parts["W_h"].T, parts["b_h"]), hidden)
    x, y, h = SX.sym("a", 3 * units), SX.sym("b", 3 * units), SX.sym("h", units)
    (reset, update, fresh), (reset_h, update_h, fresh_h) = (ca.vertsplit(part, units) for part in (x, y))
    gate = (1 + ca.tanh((update + update_h) / 2)) / 2
    fresh = ca.tanh(fresh + (1 + ca.tanh((reset + reset_h) / 2)) / 2 * fresh_h)
    block = formula("gates", [("a", x), ("b", y), ("h", h)], (1 - gate) * fresh + gate * h)
    cell.finish(cell.call(block, a, b, hidden))
    graph = Graph("gated")
    past, now = graph.input("past", steps * width), graph.input("now", parts["W_1"].shape[1] - units)
    every = graph.scan(cell, graph.constant(np.zeros(units)), [past], [], steps)
    full = graph.pack(every[units * (steps - 1) :], now)
    after = graph.call(Dense(parts["W_1"].T, parts["c_1"], True), full)
    return graph.finish(graph.call(Dense(parts["W_2"].T, parts["c_2"]), after))


# What follows goes step by step: the carry is u, v, r, psi, x, y and what the method keeps.


def stepped(
    known: Known,
    kept: Value | None,
    build: Callable[[Graph, Mapping[str, Value], Value, Value | None], tuple[Value, Value | None]],
) -> Value:
    """Path of the physics with an acceleration added at each step, as `shipid.hybrid.stepping.stepped_paths`.

    build : (graph of the step, what holds at its start, velocities after it by the physics alone, what is kept) ->
    missing acceleration (3,), and what is kept after it.
    """
    graph, names = known.graph, known.names
    body = one_more_step(known, 0 if kept is None else kept.size, build)
    start = [known.of("now", (*MOTIONS, "psi")), graph.constant([0.0, 0.0]), *([] if kept is None else [kept])]
    every, rows = names.commands, names.horizon
    commands = known.rows("planned", every, 0, rows) if names.planned else graph.pack(*[known.of("now", every)] * rows)
    each = [commands, _reached(known, known.values["reached"], None)]
    weather = measurable(names.now)
    fixed = [known.of("now", weather), known.of("now", ["psi"]), known.values["parameters"]]
    records = graph.scan(body, graph.pack(*start), each, fixed, rows)
    size = body.size
    return graph.pack(*(records[size * k + 4 : size * k + 6] for k in range(rows)))


def _reached(known: Known, first: Value, records: Value | None) -> Value:
    """States of the actuators at the start of each step, row by row."""
    if known.physics.vessel is None or not known.equations.model.memory:
        return first[0:0]
    size, states = known.equations.num_carry, known.equations.num_states
    records = known.measured_records if records is None else records
    count = records.size // size
    return known.graph.pack(first, *(records[size * k + states : size * (k + 1)] for k in range(count - 1)))


def one_more_step(
    known: Known,
    num_kept: int,
    build: Callable[[Graph, Mapping[str, Value], Value, Value | None], tuple[Value, Value | None]],
) -> Graph:
    """(carry, commands, reached, weather, psi at the instant, parameters) -> carry."""
    names, h = known.names, known.physics.step
    graph = Graph("corrected_step")
    carry = graph.input("carry", 6 + num_kept)
    commands = graph.input("commands", len(names.commands))
    reached = graph.input("reached", len(names.reached))
    weather = graph.input("weather", len(measurable(names.now)))
    first = graph.input("psi0", 1)
    parameters = graph.input("parameters", len(names.parameters))
    at = {"carry": carry, "commands": commands, "reached": reached, "weather": weather, "parameters": parameters}
    nu = carry[:3]
    after, way = nu, None
    if known.physics.vessel is not None:
        after, way = _free(graph, known, known.equations, parameters, at)
    more, kept = build(graph, at, after, carry[6:] if num_kept else None)
    motion = _moved(h, way is not None and known.physics.integrator != "euler")
    ways = way if way is not None and known.physics.integrator != "euler" else carry[0:0]
    moved = graph.call(motion, carry[:6], after, more, ways, first)
    return graph.finish(graph.pack(moved, *([] if kept is None else [kept])))


def _moved(h: float, exact: bool) -> Formula:
    """Velocities, heading and place after a step."""
    carry, after, more = SX.sym("carry", 6), SX.sym("after", 3), SX.sym("more", 3)
    way, first = SX.sym("way", 3 if exact else 0), SX.sym("psi0")
    nu, psi, place = carry[:3], carry[3], carry[4:6]
    then = after + h * more
    sound: Any = SX(1)
    for i in range(3):
        sound = ca.logic_and(sound, ca.fabs(then[i]) <= LIMIT)
    then = ca.vertcat(*(ca.if_else(sound, then[i], np.nan) for i in range(3)))

    def turned(velocity: SX, angle: SX) -> SX:
        c, s = ca.cos(angle), ca.sin(angle)
        return ca.vertcat(c * velocity[0] - s * velocity[1], s * velocity[0] + c * velocity[1])

    if exact:
        moved = way + h**2 / 2 * more + ca.if_else(sound, 0, np.nan)
        psi_after = psi + moved[2]
        place = place + turned(moved, psi - first)
    else:
        psi_after = psi + h / 2 * (nu[2] + then[2])
        place = place + h / 2 * (turned(nu, psi - first) + turned(then, psi_after - first))
    given = [("carry", carry), ("after", after), ("more", more), ("way", way), ("psi0", first)]
    return formula("moved", given, ca.vertcat(then, psi_after, place))


def _free(
    graph: Graph, known: Known, equations: Equations, parameters: Value, at: Mapping[str, Value]
) -> tuple[Value, Value]:
    """Velocities (3,) after one step of the physics, and its way along, across and in heading (3,)."""
    model, names = equations.model, known.names
    zero: Value | None = None

    def entry(name: str) -> Value:
        nonlocal zero
        if name == "psi":
            return at["carry"][3]
        if name in MOTIONS:
            return at["carry"][MOTIONS.index(name)]
        zero = zero or graph.constant([0.0])
        return zero

    state = graph.pack(*(entry(name) for name in (*model.state, *model.hidden)))
    memory = [at["reached"][names.reached.index(name)] for name in model.memory]
    weather = measurable(names.now)
    environment = [
        at["weather"][weather.index(name)] if name in weather else entry("none") for name in model.environment
    ]
    commands = [at["commands"][names.commands.index(name)] for name in model.commands]
    carry = graph.pack(state, *memory)
    step = equations.step(known.physics.integrator, known.physics.step)
    empty = at["carry"][0:0]
    after = graph.call(
        step,
        carry,
        graph.pack(*commands) if commands else empty,
        graph.pack(*environment) if environment else empty,
        graph.constant(np.zeros(model.num_dof)),
        parameters,
    )
    places = equations.index(("north", "east", "psi"))
    x, psi = SX.sym("carry", equations.num_carry), SX.sym("psi")
    c, s = ca.cos(psi), ca.sin(psi)
    north, east = x[places["north"]], x[places["east"]]
    velocities = graph.call(formula("horizontal", [("carry", x)], equations.horizontal(x)), after)
    block = formula(
        "way", [("carry", x), ("psi", psi)], [c * north + s * east, c * east - s * north, x[places["psi"]] - psi]
    )
    return velocities, graph.call(block, after, at["carry"][3])


def _features(graph: Graph, known: Known, at: Mapping[str, Value], commands: tuple[str, ...], wanted: Sequence[str],
              more: Mapping[str, SX] | None = None, kept: tuple[SX, Value] | None = None) -> Value:  # fmt: skip
    """Inputs of a method at the start of a step; `more` are expressions of what is kept."""
    names = known.names
    weather = measurable(names.now)
    carry, orders = SX.sym("carry", 6), SX.sym("commands", len(names.commands))
    wind = SX.sym("weather", len(weather))
    now = dict(zip((*MOTIONS, "psi"), ca.vertsplit(carry)[:4], strict=True))
    now |= dict(zip(names.commands, ca.vertsplit(orders), strict=True)) if names.commands else {}
    now |= dict(zip(weather, ca.vertsplit(wind), strict=True)) if weather else {}
    table = feature_table(now, commands) | dict(more or {})
    given = [("carry", carry), ("commands", orders), ("weather", wind)]
    values = [at["carry"][:6], at["commands"], at["weather"]]
    if kept is not None:
        given.append(("kept", kept[0]))
        values.append(kept[1])
    return graph.call(formula("inputs", given, [table[name] for name in wanted]), *values)


def units_with(units: Units, even: Array, odd: Array) -> Block:
    """Hidden units and output weights: even units with a constant (M + 1, p), and odd ones (M or M + 1, q)."""
    size, p, q = len(units.offset) ** 0.5, even.shape[1], odd.shape[1]
    bias = np.concatenate([even[0], np.zeros(q) if units.reflection is not None else odd[0]])
    graph = Graph("units")
    x = graph.input("x", len(units.normaliser.names))
    z = graph.call(z_score(units.normaliser), x)
    if not len(units.offset):
        return graph.finish(graph.constant(bias))
    if units.reflection is None:
        hidden = graph.call(Dense(units.weight, units.offset, True), z)
        weight = np.concatenate([even[1:], odd[1:]], axis=1) / size
        return graph.finish(graph.call(Dense(weight, bias), hidden))
    row, place = np.nonzero(units.reflection)
    order = np.argsort(place)  # image_j = R_ij z_i
    block = Mirrored(
        units.weight,
        units.offset,
        row[order],
        units.reflection[row[order], place[order]],
        even[1:] / (2 * size),
        odd / (2 * size),
        bias,
    )
    assert (p, q) == (block.x.shape[1], block.y.shape[1])
    return graph.finish(graph.call(block, z))


def one_step(known: Known, corrector: OneStepCorrector) -> Value:
    """Networks that give the missing acceleration at every step."""
    return stepped(known, None, one_step_builder(known, corrector))


Builder = Callable[[Graph, Mapping[str, Value], Value, Value | None], tuple[Value, Value | None]]


def one_step_builder(known: Known, corrector: OneStepCorrector) -> Builder:
    """Missing acceleration of one step."""

    def build(graph: Graph, at: Mapping[str, Value], _: Value, __: Value | None) -> tuple[Value, None]:
        terms = []
        for head in corrector.heads:
            x = _features(graph, known, at, corrector.commands, head.units.normaliser.names)
            terms.append(graph.call(units_with(head.units, head.surge, head.sway_yaw), x))
        return graph.total(terms, float(len(terms))), None

    return build


def modules(known: Known, corrector: ModulesCorrector) -> Value:
    """Factors of single modules, faded out far from the training data."""
    return stepped(known, None, modules_builder(known, corrector))


def modules_builder(known: Known, corrector: ModulesCorrector) -> Builder:
    """Acceleration by the factors of one step."""
    reduced = [Equations(one.vessel) for one in without(known.physics) if one.vessel is not None]
    h, every = known.physics.step, known.names.parameters
    count = len(corrector.modules)

    def build(graph: Graph, at: Mapping[str, Value], whole: Value, _: Value | None) -> tuple[Value, None]:
        afters = [whole]
        for equations in reduced:
            places = [every.index(name) for name in equations.model.parameters]
            fewer = _runs(graph, at["parameters"], places)
            afters.append(_free(graph, known, equations, fewer, at)[0])
        x = _features(graph, known, at, corrector.commands, corrector.units.normaliser.names)
        raw = graph.call(units_with(corrector.units, corrector.weights.T, np.zeros((len(corrector.units.offset) +
                         (corrector.units.reflection is None), 0))), x)  # fmt: skip
        apart = graph.call(Nearest(corrector.alarm.centres), graph.call(z_score(corrector.units.normaliser), x))
        r, d, steps = SX.sym("raw", count), SX.sym("apart"), SX.sym("after", 3 * (count + 1))
        weight = 1 - (d - corrector.alarm.radius) / corrector.fade
        weight = ca.if_else(ca.fabs(d) < np.inf, ca.fmin(ca.fmax(weight, 0), 1), 0)
        total: Any = SX(3, 1)
        for k in range(count):
            extra = weight * ca.fmin(ca.fmax(r[k], -corrector.limit), corrector.limit)
            total = total + extra * (steps[3 * k : 3 * k + 3] - steps[3 * k + 3 : 3 * k + 6]) / h
        block = formula("factors", [("raw", r), ("apart", d), ("after", steps)], total)
        return graph.call(block, raw, apart, graph.pack(*afters)), None

    return build


def _runs(graph: Graph, value: Value, places: Sequence[int]) -> Value:
    """Entries at rising places, neighbours copied together."""
    parts, first = [], 0
    for i in range(1, len(places) + 1):
        if i == len(places) or places[i] != places[i - 1] + 1:
            parts.append(value[places[first] : places[i - 1] + 1])
            first = i
    return graph.pack(*parts)


def hankel(known: Known, corrector: HankelCorrector) -> Value:
    """A linear law of delays, rolled over the horizon."""
    law, names, graph = corrector.law, known.names, known.graph
    physical = known.physics.vessel is not None
    kept = [*MOTIONS, *law.commands, *(MISSED if physical else ())]
    first = names.before(law.delays)
    rows = [known.of("past", (*MOTIONS, *law.commands), first + k) for k in range(law.delays)]
    if physical:
        missed = _missed_before(known, first, law.delays)
        rows = [graph.pack(row, missed[3 * k : 3 * k + 3]) for k, row in enumerate(rows)]

    def build(step: Graph, at: Mapping[str, Value], _: Value, before: Value | None) -> tuple[Value, Value]:
        assert before is not None
        symbol = SX.sym("kept", before.size)
        more = {}
        for place, name in enumerate(kept):
            component, dot, signal = name.rpartition(".")
            for ago in range(1, law.delays + 1):
                row = law.delays - ago
                more[f"{component}{dot}past-{ago}.{signal}"] = symbol[row * len(kept) + place]
        x = _features(step, known, at, law.commands, law.normaliser.names, more, (symbol, before))
        residual = step.call(Dense(law.weights[:-1], law.weights[-1]), step.call(z_score(law.normaliser), x))
        orders = [at["commands"][names.commands.index(name)] for name in law.commands]
        newest = [at["carry"][:3], *orders, *([residual] if physical else [])]
        return residual, step.pack(before[len(kept) :], *newest)

    return stepped(known, graph.pack(*rows), build)


def _missed_before(known: Known, first: int, delays: int) -> Value:
    """Accelerations that single steps of the physics missed over the last steps of the past, row by row."""
    graph, names, model = known.graph, known.names, known.equations.model
    records = past_records(known, first, delays)
    reached = _reached(known, known.of("past", tuple(model.memory), first), records)
    body = Graph("missed")
    carry = body.input("carry", 4)
    after = body.input("after", 3)
    at = {
        "carry": carry,
        "commands": body.input("commands", len(names.commands)),
        "reached": body.input("reached", len(model.memory)),
        "weather": body.input("weather", len(measurable(names.now))),
    }
    parameters = body.input("parameters", len(names.parameters))
    alone_, _ = _free(body, known, known.equations, parameters, at)
    seen, predicted = SX.sym("seen", 3), SX.sym("predicted", 3)
    block = formula("missing", [("seen", seen), ("predicted", predicted)], (seen - predicted) / known.physics.step)
    body.finish(body.call(block, after, alone_))
    later = [known.of("past", MOTIONS, first + k) for k in range(1, delays)]
    each = [
        known.rows("past", (*MOTIONS, "psi"), first, delays),
        graph.pack(*later, known.of("now", MOTIONS)),
        known.rows("past", names.commands, first, delays),
        reached,
    ]
    weather = measurable(names.now)
    return graph.map(body, each, [known.of("past", weather, first), known.values["parameters"]], delays)


def _nothing(_: Any) -> Taken:
    return Taken((), ())


def _recurrent_taken(corrector: RecurrentCorrector) -> Taken:
    readers = [network.reader for network in corrector.networks]
    names = [name for reader in readers for name in (*reader.past.names, *reader.now.names)]
    return Taken(corrector.inputs.commands, tuple(names))


def _compensated_taken(corrector: Compensator) -> Taken:
    return Taken(corrector.inputs.commands, tuple(_names_of(corrector)))


def _one_step_taken(corrector: OneStepCorrector) -> Taken:
    return Taken(corrector.commands, tuple(n for head in corrector.heads for n in head.units.normaliser.names))


class Counterpart(NamedTuple):
    """A corrector as blocks: its path (T, 2), row by row, as a value of the graph, and what it takes."""

    path: Callable[[Known, Any], Value]
    takes: Callable[[Any], Taken]


CORRECTORS: dict[type[Any], Counterpart] = {
    Unchanged: Counterpart(alone, _nothing),
    ForceCorrector: Counterpart(alone, _nothing),
    Compensator: Counterpart(compensated, _compensated_taken),
    Calibrated: Counterpart(compensated, _compensated_taken),
    ForestCorrector: Counterpart(forest, lambda one: Taken(one.inputs.commands, one.names)),
    RecurrentCorrector: Counterpart(recurrent, _recurrent_taken),
    OneStepCorrector: Counterpart(one_step, _one_step_taken),
    ModulesCorrector: Counterpart(modules, lambda one: Taken(one.commands, one.units.normaliser.names)),
    HankelCorrector: Counterpart(hankel, lambda one: Taken(one.law.commands, one.law.normaliser.names)),
}
"""Class of a corrector -> its counterpart."""


def taken(corrector: Any) -> Taken:
    """Inputs of a corrector; ShipidError for a corrector that cannot be exported."""
    if type(corrector) not in CORRECTORS:
        kinds = [kind for kind, method in METHODS.items() if method.corrector in CORRECTORS]
        named = next((kind for kind, method in METHODS.items() if method.corrector is type(corrector)), "of this kind")
        raise ShipidError(f"a predictor by the method {named} cannot be exported; these can: {', '.join(kinds)}")
    return CORRECTORS[type(corrector)].takes(corrector)
