"""What each method adds to the physics, as CasADi expressions: one function a kind of corrector, see CORRECTORS."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from casadi import MX

from shipid.export.equations import Equations, function_by_names, split_by_name, symbols_of
from shipid.export.known import (
    NamedExpressions,
    PredictorInputs,
    all_within,
    column_of_entries,
    feature_expressions,
    turn_vectors,
)
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.calibrator import TrajectoryCompensator, TrajectoryInputs
from shipid.hybrid.compensator import Compensator, Layers, Normaliser
from shipid.hybrid.features import MOTIONS
from shipid.hybrid.forest import ForestCorrector, Trees
from shipid.hybrid.hankel_dmd import MISSED_NAMES, HankelCorrector
from shipid.hybrid.kernel_compensator import KernelCompensator
from shipid.hybrid.learned_force import ForceCorrector
from shipid.hybrid.modules import ModulesCorrector, physics_without_modules
from shipid.hybrid.one_step import OneStepCorrector
from shipid.hybrid.recurrent import GatedNetwork, RecurrentCorrector
from shipid.hybrid.regression import RegressionCorrector, law_terms
from shipid.hybrid.stepping import VELOCITY_LIMIT
from shipid.hybrid.units import Units
from shipid.physics.signals import measurable_signals

Array = np.ndarray


def layer_outputs(x: MX, weight: Array, bias: Array) -> MX:
    """Outputs x @ weight + bias (o,) of a layer, weight (i, o), bias (o,)."""
    return ca.mtimes(ca.DM(weight.T), x) + ca.DM(bias)


def normalised_inputs(table: NamedExpressions, normaliser: Normaliser) -> MX:
    """(value - mean) / std of the named inputs."""
    return (stacked_inputs(table, normaliser.names) - ca.DM(normaliser.mean)) / ca.DM(normaliser.std)


def stacked_inputs(table: NamedExpressions, names: Sequence[str]) -> MX:
    """Inputs of a method in a column; KeyError where the table lacks one."""
    return ca.vertcat(*(table[name] for name in names))


def mean_of(values: Sequence[MX]) -> MX:
    """The mean of expressions of one shape."""
    return sum(values[1:], start=values[0]) / len(values)


def path_of_shapes(weights: MX, basis: Array) -> MX:
    """Path (2, T) that outputs x_1 ... x_r, y_1 ... y_r weigh shapes (T, r) to."""
    return ca.mtimes(ca.DM(basis), ca.reshape(weights, basis.shape[1], 2)).T


def network_outputs(value: MX, layers: Layers) -> MX:
    """Outputs of layers with tanh between them."""
    *hidden, last = layers
    for weight, bias in hidden:
        value = ca.tanh(layer_outputs(value, weight, bias))
    return layer_outputs(value, *last)


def compensated_path(known: PredictorInputs, corrector: Compensator) -> MX:
    """Path of the physics plus the mean of networks."""
    moments: Sequence[int] = ()
    if isinstance(corrector.inputs, TrajectoryInputs):
        horizon = known.names.horizon
        moments = np.unique(np.round(np.linspace(0, horizon, corrector.inputs.moments + 1)[1:]).astype(int)).tolist()
    table = known.table(corrector.inputs, moments)
    return known.path + mean_of(
        [
            path_of_shapes(network_outputs(normalised_inputs(table, one.normaliser), one.layers), one.basis)
            for one in corrector.networks
        ]
    )


def kernel_path(known: PredictorInputs, corrector: KernelCompensator) -> MX:
    """Path of the physics plus the mean of kernel ridge regressions."""
    point, terms = normalised_inputs(known.table(corrector.inputs), corrector.normaliser), corrector.basis.shape[1]
    images, paths = [(point, np.ones(2 * terms))], []
    if corrector.reflection is not None:
        images.append((ca.mtimes(ca.sparsify(ca.DM(corrector.reflection.T)), point), np.repeat([1.0, -1.0], terms)))
    for one in corrector.members:
        weight, outputs = 1 / one.scales**2, MX(np.zeros(2 * terms))
        for image, sign in images:
            product = ca.mtimes(ca.DM(corrector.centres), weight * image)
            apart = ca.DM(corrector.centres**2 @ weight) + ca.dot(weight * image, image) - 2 * product
            outputs += sign * ca.mtimes(ca.DM(one.weights.T), ca.exp(-apart / 2) + one.linear * (1 + product))
        paths.append(path_of_shapes(outputs, corrector.basis))
    return known.path + mean_of(paths)


def physics_path(known: PredictorInputs, corrector: UnchangedPath) -> MX:  # noqa: ARG001
    """Path of the physics; a learned force is among its terms already."""
    return known.path


def forest_path(known: PredictorInputs, corrector: ForestCorrector) -> MX:
    """Path of the physics plus the mean of trees."""
    seen = stacked_inputs(known.table(corrector.inputs), corrector.names)
    return known.path + path_of_shapes(mean_of_trees(corrector.trees, seen), corrector.basis)


def mean_of_trees(trees: Trees, seen: MX) -> MX:
    """Mean of the leaves that inputs come to, as `Trees.predict`; all trees go down together, a level at a time.

    Nodes are numbered anew, those of leaves last. Python compares inputs in single precision: a threshold becomes the
    greatest number in double precision that goes left.
    """
    leaf = np.asarray(trees.left < 0)
    inner = int((~leaf).sum())
    number = np.where(leaf, inner + np.cumsum(leaf) - 1, np.cumsum(~leaf) - 1)
    node = MX(ca.DM(number[trees.first]))
    if inner:
        children = ca.DM(number[np.stack([trees.left, trees.right], axis=1)[~leaf]].ravel())
        feature, threshold = ca.DM(trees.feature[~leaf]), ca.DM(greatest_left(trees.threshold[~leaf]))
    for _ in range(depth_of(trees)):
        at = ca.fmin(node, inner - 1)
        right = seen[MX(feature)[at]] > MX(threshold)[at]
        node = ca.if_else(node >= inner, node, MX(children)[2 * at + right])
    outputs, values = trees.value.shape[1], MX(ca.DM(trees.value[leaf].ravel()))
    places = ca.repmat((node - inner).T * outputs, outputs, 1) + ca.repmat(ca.DM(range(outputs)), 1, len(trees.first))
    return ca.sum2(ca.reshape(values[ca.vec(places)], outputs, len(trees.first))) / len(trees.first)


def depth_of(trees: Trees) -> int:
    """Number of comparisons from the roots to the deepest leaf."""
    level, depth = trees.first[trees.left[trees.first] >= 0], 0
    while level.size:
        level = np.concatenate([trees.left[level], trees.right[level]])
        level, depth = level[trees.left[level] >= 0], depth + 1
    return depth


def greatest_left(threshold: Array) -> Array:
    """The greatest x in double precision whose rounding to single precision is at most the threshold.

    Between f, the greatest single at most the threshold, and the next one lies their middle, which rounds to the even.
    """
    low = threshold.astype(np.float32)
    low = np.where(low > threshold, np.nextafter(low, np.float32(-np.inf)), low)
    middle = (low.astype(float) + np.nextafter(low, np.float32(np.inf)).astype(float)) / 2
    return np.asarray(np.where(middle.astype(np.float32) == low, middle, np.nextafter(middle, -np.inf)))


def recurrent_path(known: PredictorInputs, corrector: RecurrentCorrector) -> MX:
    """Path of the physics plus the mean of gated recurrent networks."""
    table, paths = known.table(corrector.inputs), []
    for network in corrector.networks:
        reader = network.reader
        rows = [*known.past[known.names.before(reader.steps) :], known.now]
        signals = [normalised_inputs(feature_expressions(row, corrector.inputs.commands), reader.past) for row in rows]
        now, read = normalised_inputs(table, reader.now), gated_network_function(network)
        output = read(ca.horzcat(*signals), now)
        if reader.mirrors is not None:
            along, at = (ca.sparsify(ca.DM(one.T)) for one in reader.mirrors)
            other = read(ca.mtimes(along, ca.horzcat(*signals)), ca.mtimes(at, now))
            half = ca.DM(np.repeat([1.0, -1.0], output.numel() // 2))
            output = (output + half * other) / 2
        paths.append(path_of_shapes(output, network.basis))
    return known.path + mean_of(paths)


def gated_network_function(network: GatedNetwork) -> ca.Function:
    """(Rows of the past and the instant (d, P + 1), inputs at the instant) -> outputs of a gated recurrent network."""
    parts = network.layers
    units, width = parts["W_h"].shape[1], parts["W_i"].shape[1]
    hidden, row = MX.sym("hidden", units), MX.sym("row", width)
    a, b = layer_outputs(row, parts["W_i"].T, parts["b_i"]), layer_outputs(hidden, parts["W_h"].T, parts["b_h"])
    (reset, update, fresh), (reset_h, update_h, fresh_h) = (ca.vertsplit(part, units) for part in (a, b))
    gate = (1 + ca.tanh((update + update_h) / 2)) / 2
    fresh = ca.tanh(fresh + (1 + ca.tanh((reset + reset_h) / 2)) / 2 * fresh_h)
    cell = ca.Function("cell", [hidden, row], [(1 - gate) * fresh + gate * hidden])
    rows, now = MX.sym("rows", width, network.reader.steps + 1), MX.sym("now", parts["W_1"].shape[1] - units)
    after = MX(np.zeros(units))
    for column in ca.horzsplit(rows):
        after = cell(after, column)
    full = ca.tanh(layer_outputs(ca.vertcat(after, now), parts["W_1"].T, parts["c_1"]))
    return ca.Function("gated", [rows, now], [layer_outputs(full, parts["W_2"].T, parts["c_2"])])


# What follows goes step by step: the carry is u, v, r, psi, x, y and what the method keeps.


class StepStart(NamedTuple):
    """What holds at the start of a step: motion, orders and weather by name, and actuators."""

    row: NamedExpressions
    reached: MX


AddedAcceleration = Callable[[StepStart, MX, MX], tuple[MX, MX]]
"""(Start of a step, velocities after it by the physics alone, what is kept) -> missing acceleration (3,), and kept."""


def stepped_path(known: PredictorInputs, added: AddedAcceleration, kept: MX | None = None) -> MX:
    """Path of the physics with an acceleration added at each step, as `shipid.hybrid.stepping.stepped_paths`."""
    names, kept = known.names, MX(0, 1) if kept is None else kept
    weather = column_of_entries(known.now, measurable_signals(names.now))
    step = corrected_step(known, kept.numel(), added)
    carry, path = ca.vertcat(column_of_entries(known.now, (*MOTIONS, "psi")), MX(np.zeros(2)), kept), []
    commands = known.commands(names.commands)
    orders = ca.horzsplit(commands) * (names.horizon // commands.shape[1])
    reached = reached_at_starts(known, known.inputs["reached"], lambda: known.measured_records, names.horizon)
    for k in range(names.horizon):
        carry = step(carry, orders[k], reached[k], weather, known.now["psi"])
        path.append(carry[4:6])
    return ca.horzcat(*path)


def reached_at_starts(known: PredictorInputs, first: MX, records: Callable[[], MX], steps: int) -> list[MX]:
    """States of the actuators at the start of each step, of records of the physics."""
    if known.physics.vessel is None or not known.equations.model.memory:
        return [MX(0, 1)] * steps
    return [first, *ca.horzsplit(records()[len(known.equations.states) :, :])[:-1]]


def corrected_step(known: PredictorInputs, num_kept: int, added: AddedAcceleration) -> ca.Function:
    """(carry, commands, reached, weather, psi at the instant) -> carry."""
    names, h = known.names, known.physics.step
    weather = measurable_signals(names.now)
    sizes = {"carry": 6 + num_kept, "commands": len(names.commands), "reached": len(names.reached)}
    symbols = symbols_of(sizes | {"weather": len(weather), "psi0": 1})
    carry, first = symbols["carry"], symbols["psi0"]
    nu, psi, place = carry[:3], carry[3], carry[4:6]
    row = split_by_name((*MOTIONS, "psi"), carry[:4])
    row |= split_by_name(names.commands, symbols["commands"]) | split_by_name(weather, symbols["weather"])
    start, after, way = StepStart(row, symbols["reached"]), nu, None
    if known.physics.vessel is not None:
        after, way = free_step(known, known.equations, start)
    more, kept = added(start, after, carry[6:])
    then = after + h * more
    then = ca.if_else(all_within(then, VELOCITY_LIMIT), then, np.nan)
    if way is not None and known.physics.integrator != "euler":
        moved = way + h**2 / 2 * more + 0 * then
        turned_by, shift = moved[2], turn_vectors(moved[:2], psi - first)
    else:
        turned_by = h / 2 * (nu[2] + then[2])
        shift = h / 2 * (turn_vectors(nu[:2], psi - first) + turn_vectors(then[:2], psi + turned_by - first))
    after_all = ca.vertcat(then, psi + turned_by, place + shift, kept)
    return function_by_names("corrected_step", symbols, {"after": after_all})


def free_step(known: PredictorInputs, equations: Equations, start: StepStart) -> tuple[MX, MX]:
    """Velocities (3,) after one step of the physics, and its way along, across and in heading (3,)."""
    model, names = equations.model, known.names
    memory = start.reached[[names.reached.index(name) for name in model.memory]] if model.memory else MX(0, 1)
    carry = ca.vertcat(column_of_entries(start.row, equations.states), memory)
    commands, environment = (
        column_of_entries(start.row, model.commands),
        column_of_entries(start.row, model.environment),
    )
    step = equations.step(known.physics.integrator, known.physics.step)
    after = step(carry, commands, environment, np.zeros(model.num_dof), equations.values)
    end, psi = split_by_name(equations.states, after[: len(equations.states)]), start.row["psi"]
    place = turn_vectors(column_of_entries(end, ("north", "east")), -psi)
    return equations.horizontal(after), ca.vertcat(place, end["psi"] - psi)


def layers_of_units(units: Units, even: Array, odd: Array) -> Layers:
    """Two layers that give `Units.parts` times weights: `even` (M + 1, p), `odd` (M or M + 1, q)."""
    size = max(len(units.offset), 1) ** 0.5
    if units.reflection is None:
        weight = np.concatenate([even, odd], axis=1)
        return (units.weight, units.offset), (weight[1:] / size, weight[0])
    inner = np.concatenate([units.weight, units.reflection @ units.weight], axis=1)
    outer = np.block([[even[1:], odd], [even[1:], -odd]]) / (2 * size)
    return (inner, np.tile(units.offset, 2)), (outer, np.r_[even[0], np.zeros(odd.shape[1])])


def one_step_path(known: PredictorInputs, corrector: OneStepCorrector) -> MX:
    """Networks that give the missing acceleration at every step."""

    def added(start: StepStart, _: MX, kept: MX) -> tuple[MX, MX]:
        table, networks = feature_expressions(start.row, corrector.commands), networks_of(corrector)
        return mean_of([network_outputs(normalised_inputs(table, one), layers) for one, layers in networks]), kept

    return stepped_path(known, added)


def networks_of(corrector: OneStepCorrector) -> list[tuple[Normaliser, Layers]]:
    """The z-score and the layers of each network."""
    return [(head.units.normaliser, layers_of_units(head.units, head.surge, head.sway_yaw)) for head in corrector.heads]


def distance_to_nearest(point: MX, centres: Array) -> MX:
    """Distance of a point (d,) to the nearest of some centres (C, d); a slope of 0 at a centre."""
    apart = ca.DM(centres.T) - ca.repmat(point, 1, len(centres))
    least = ca.mmin(ca.sum1(apart**2))
    return ca.if_else(least == 0, 0, ca.sqrt(ca.if_else(least == 0, 1, least)))


def modules_path(known: PredictorInputs, corrector: ModulesCorrector) -> MX:
    """Factors of single modules, faded out far from the training data."""
    reduced = [Equations(one.vessel) for one in physics_without_modules(known.physics) if one.vessel is not None]

    def added(start: StepStart, whole: MX, kept: MX) -> tuple[MX, MX]:
        afters = [whole, *(free_step(known, equations, start)[0] for equations in reduced)]
        even, units = corrector.weights.T, corrector.units
        z = normalised_inputs(feature_expressions(start.row, corrector.commands), units.normaliser)
        none = np.zeros((len(units.offset) + (units.reflection is None), 0))
        raw = network_outputs(z, layers_of_units(units, even, none))
        away = distance_to_nearest(z, corrector.alarm.centres)
        weight = ca.fmin(ca.fmax(1 - (away - corrector.alarm.radius) / corrector.fade, 0), 1)
        weight = ca.if_else(all_within(away), weight, 0)
        extra = weight * ca.fmin(ca.fmax(raw, -corrector.limit), corrector.limit)
        shares = ca.horzcat(*(before - after for before, after in itertools.pairwise(afters)))
        return ca.mtimes(shares, extra) / known.physics.step, kept

    return stepped_path(known, added)


def hankel_path(known: PredictorInputs, corrector: HankelCorrector) -> MX:
    """A linear law of delays, rolled over the horizon."""
    law, physical = corrector.law, known.physics.vessel is not None
    kept_names = [*MOTIONS, *law.commands, *(MISSED_NAMES if physical else ())]
    rows = [column_of_entries(row, (*MOTIONS, *law.commands)) for row in known.past[known.names.before(law.delays) :]]
    if physical:
        rows = [ca.vertcat(*pair) for pair in zip(rows, missed_accelerations(known, law.delays), strict=True)]

    def added(start: StepStart, _: MX, before: MX) -> tuple[MX, MX]:
        table = feature_expressions(start.row, law.commands)
        for ago, row in enumerate(reversed(ca.vertsplit(before, len(kept_names))), start=1):
            for name, value in split_by_name(kept_names, row).items():
                component, dot, signal = name.rpartition(".")
                table[f"{component}{dot}past-{ago}.{signal}"] = value
        residual = layer_outputs(normalised_inputs(table, law.normaliser), law.weights[:-1], law.weights[-1])
        newest = column_of_entries(start.row, (*MOTIONS, *law.commands))
        return residual, ca.vertcat(before[len(kept_names) :], newest, residual if physical else MX(0, 1))

    return stepped_path(known, added, ca.vertcat(*rows))


def missed_accelerations(known: PredictorInputs, delays: int) -> list[MX]:
    """Accelerations (3,) that single steps of the physics missed over the last steps of the past."""
    rows = known.past[known.names.before(delays) :]
    first = column_of_entries(rows[0], tuple(known.equations.model.memory))
    reached = reached_at_starts(known, first, lambda: known.past_records(delays), delays)
    held, missed = {name: rows[0][name] for name in measurable_signals(known.names.now)}, []
    for row, at, later in zip(rows, reached, [*rows[1:], known.now], strict=True):
        start = held | {name: row[name] for name in (*MOTIONS, "psi", *known.names.commands)}
        alone, _ = free_step(known, known.equations, StepStart(start, at))
        missed.append((column_of_entries(later, MOTIONS) - alone) / known.physics.step)
    return missed


def regression_path(known: PredictorInputs, corrector: RegressionCorrector) -> MX:
    """A law of acceleration through the water, which flows steadily; velocities stay within their limits."""
    h, current, weights = known.physics.step, MX(ca.DM(corrector.current[0])), ca.DM(corrector.weights[0].T)

    def added(start: StepStart, alone: MX, kept: MX) -> tuple[MX, MX]:
        table, psi = feature_expressions(start.row, corrector.commands), start.row["psi"]
        water = ca.vertcat(turn_vectors(current, -psi), 0)
        through = table | {"u": table["u"] - water[0], "v": table["v"] - water[1]}
        after = alone - water + h * ca.mtimes(weights, ca.vertcat(*law_terms(through, corrector.names, ca)))
        after = ca.fmin(ca.fmax(after, ca.DM(corrector.low)), ca.DM(corrector.high))
        later = psi + h / 2 * (table["r"] + after[2])
        return (after + ca.vertcat(turn_vectors(current, -later), 0) - alone) / h, kept

    return stepped_path(known, added)


CORRECTORS: dict[type[Any], Callable[[PredictorInputs, Any], MX]] = {
    UnchangedPath: physics_path,
    ForceCorrector: physics_path,
    Compensator: compensated_path,
    TrajectoryCompensator: compensated_path,
    ForestCorrector: forest_path,
    KernelCompensator: kernel_path,
    RecurrentCorrector: recurrent_path,
    OneStepCorrector: one_step_path,
    ModulesCorrector: modules_path,
    HankelCorrector: hankel_path,
    RegressionCorrector: regression_path,
}
"""Class of a corrector -> its path (2, T)."""
