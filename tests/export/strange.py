"""Predictors that nobody has fitted: every method with drawn numbers, on drawn vessels, horizons and memories."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shipid.data.windows import Instants
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.bands import Bands, FastMotion, fast_power
from shipid.hybrid.calibrator import TrajectoryCompensator, TrajectoryInputs
from shipid.hybrid.compensator import Compensator, Network, Normaliser, smooth_basis
from shipid.hybrid.features import MOTIONS, Inputs, Memory, feature_table
from shipid.hybrid.forest import ForestCorrector, Trees
from shipid.hybrid.hankel_dmd import HankelCorrector, LinearLaw
from shipid.hybrid.kernel_compensator import KernelCompensator, KernelMember
from shipid.hybrid.learned_force import HIDDEN, OUTPUT, ForceCorrector
from shipid.hybrid.modules import Alarm, ModulesCorrector, modules_of
from shipid.hybrid.novelty import alarm_inputs, calibrate_alarm
from shipid.hybrid.one_step import OneStepCorrector, OutputWeights
from shipid.hybrid.physics import Physics
from shipid.hybrid.recurrent import GatedNetwork, RecurrentCorrector, SequenceReader
from shipid.hybrid.regression import RegressionCorrector, law_terms
from shipid.hybrid.stack import StackCompensator
from shipid.hybrid.stepping import MISSED_NAMES
from shipid.hybrid.units import Units
from shipid.observer import ESTIMATE_COLUMNS, Observer
from shipid.predictor import Predictor
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel
from tests.conftest import ENVELOPE, SPEEDS, pace, variety

KINDS = (
    *("alone", "calibrator", "forest", "hankel-dmd", "learned-force", "modules"),
    *("one-step", "path-trained", "recurrent", "kernel", "regression", "stack"),
)
STEPPED = ("hankel-dmd", "modules", "one-step", "regression")  # corrected by step: they refuse an observer
NEEDS_PHYSICS = ("alone", "calibrator", "learned-force", "modules")


@dataclass(frozen=True)
class Strange:
    """A predictor, and instants at which it knows all that it needs."""

    predictor: Predictor
    instants: Instants


def drawn(kind: str, seed: int, count: int = 20, vessel: str | None = None) -> Strange:
    """A predictor of a kind with drawn numbers."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    ships = variety()
    name = vessel or str(rng.choice(sorted(ships)))
    ship: Vessel | None = ships[name]
    if kind not in NEEDS_PHYSICS and rng.random() < 0.2 and vessel is None:
        ship = None
    if kind == "learned-force" and ship is not None and "learned" in ship.document.get("hull", {}):
        ship = ships["gunnerus-28.9"]
    slow = 1.0 if ship is None else pace(ship)
    model = None if ship is None else vessel_dynamics(ship)
    three = model is not None and model.num_dof == 3 and not model.hidden
    observer = Observer(fade=12.0) if three and rng.random() < 0.3 and kind not in STEPPED else None
    physics = Physics(
        ship,
        int(rng.integers(3, 16)),
        float(slow * rng.choice([0.25, 0.5, 1.0])),
        str(rng.choice(["euler", "rk4"])),  # type: ignore[arg-type]
        observer,
        str(rng.choice(["position", "velocity"])),  # type: ignore[arg-type]
    )
    known, steps = bool(rng.random() < 0.5), int(rng.integers(4, 12))
    commands = model.commands if model is not None else ("port.n", "port.alpha")
    instants = _instants(rng, physics, commands, count, steps, slow, known)
    memory = Memory(
        history=tuple(physics.step * k for k in rng.choice(steps, 2, replace=False) + 1),
        turned=(physics.step * 2,),
        positions=(physics.step, physics.step * 3),
        states=("phi",),
        error=tuple(physics.step * k for k in rng.choice(steps, int(rng.integers(1, 3)), replace=False) + 1),
        observer=observer is not None,
    )
    inputs = Inputs(tuple(commands), memory if rng.random() < 0.7 else Memory())
    corrector = _corrector(kind, rng, physics, inputs, instants, slow)
    limits = {key: tuple(np.quantile(instants.columns[key], [0.05, 0.95])) for key in (*MOTIONS, *commands, "V_w")}
    predictor = Predictor(
        physics, kind, corrector, limits, {"seed": seed, "odd": 'a "quote", a */ and ??('},
        "known" if known else "held",
        bands=bands_of(np.random.default_rng([seed, 77]), physics, instants, tuple(limits), slow),
    )  # fmt: skip
    return Strange(watchful(predictor, instants, np.random.default_rng([seed, 78])), instants)


def watchful(predictor, instants, rng):
    """The predictor with an alarm that half of the instants raise, and a band that grows with fast motion."""
    past, run = predictor.past, np.array([f"M{i % 4}" for i in range(len(instants))])
    table = alarm_inputs(predictor.inputs, past, predictor.physics, instants)
    alarm = calibrate_alarm(predictor.inputs, past, table, run)
    if alarm is None:  # of one instant
        return predictor
    away = np.linalg.norm((np.stack([table[name] for name in alarm.names], axis=1) - alarm.middle) @ alarm.root, axis=1)
    alarm = replace(alarm, farthest=float(np.median(away)) * (1 + 1e-6), slack=0.3)
    bands = predictor.bands
    if past:
        power = fast_power(instants.columns, instants.past, past)
        weights = rng.dirichlet(np.ones(6)) / np.maximum(power.mean(axis=0), 1e-9)
        bands = replace(bands, fast=FastMotion(past, weights / np.median((power * weights).max(axis=1))))
    return replace(predictor, alarm=alarm, bands=bands)


def remembering(physics, memory, instants, seed=2, **more):
    """A predictor whose network takes every input that the physics and a memory give at some instants."""
    commands = vessel_dynamics(physics.vessel).commands
    inputs = Inputs(commands, memory)
    table = inputs.table(physics, instants)
    network = network_of(np.random.default_rng(seed), list(table), table, physics.horizon, 2, False)
    corrector = Compensator(inputs, (network,), {})
    return Predictor(physics, "path-trained", corrector, **{"limits": {"u": (-99.0, 99.0)}, **more})


def bands_of(rng, physics, instants, names, slow):
    """Bands that nobody has calibrated: tables that rise, points of training of which some are instants."""
    horizon, count = physics.horizon, len(instants)
    seen = np.stack([instants.columns[name] for name in names], axis=1)
    near = rng.integers(count, size=int(rng.integers(1, 40)))
    centres = seen[near] * rng.choice([1.0, 1.1], (len(near), 1))
    along = slow * np.cumsum(rng.uniform(0.01, 1, horizon))
    across = along if rng.random() < 0.3 else slow * np.cumsum(rng.uniform(0.01, 1, horizon))
    kinds = {name: int(rng.integers(1, 30)) for name in ("turning", 'odd "kind"')[: int(rng.integers(0, 3))]}
    middle = np.array([0.0, 0.5, 0.0, 0.5, 0.3]) + rng.normal(0, 0.1, 5)
    spread = rng.uniform(0.5, 2, 5)
    return Bands(
        runs=int(rng.integers(3, 60)), along=along, across=across,
        whole=np.cumsum(rng.exponential(0.03, 99)), steps=np.cumsum(rng.exponential(0.02, (99, horizon)), axis=0),
        names=names, centres=centres, spread=np.maximum(seen.std(axis=0), 1e-3), far=float(rng.uniform(0.2, 2)),
        middle=middle, deviation=rng.uniform(0.2, 1, 5), low=middle - spread, high=middle + spread,
        slopes=rng.normal(0, 0.3, 5), length=float(slow * physics.step * horizon * 4),
        kinds=kinds, by_kind=np.cumsum(rng.exponential(0.03, (len(kinds), 99)), axis=1),
        scales=slow * np.cumsum(rng.uniform(0.01, 1, (len(kinds), horizon, 2)), axis=1),
    )  # fmt: skip


def _instants(rng, physics, commands, count, steps, slow, known):
    def one(name, *shape):
        last = name.rpartition(".")[2]
        low, high = ENVELOPE.get(last, (0.3, 0.9))
        factor = slow if name in SPEEDS else 1.0
        return factor * rng.uniform(low, high, shape)

    model = None if physics.vessel is None else vessel_dynamics(physics.vessel)
    states = () if model is None else model.state
    names = tuple(dict.fromkeys(("psi", *MOTIONS, *states, *commands, "V_w", "beta_w", "V_c", "beta_c", "phi")))
    names = tuple(name for name in names if name not in ("north", "east"))
    columns = {name: one(name, count) for name in names}
    past = {name: columns[name] + 0.1 * (one(name, steps, count) - columns[name]) for name in names}
    for name in ("x", "y"):
        past[name] = rng.uniform(-30, 30, (steps, count)) * slow
    planned = {name: one(name, physics.horizon, count) for name in commands} if known else None
    hidden = None
    if model is not None and model.memory:
        hidden = {name: one(name, count) for name in model.memory}
    estimates = {}
    if physics.observer is not None:
        columns |= {"north": rng.uniform(-5, 5, count), "east": rng.uniform(-5, 5, count)}
        spread = {"X": 0.02, "Y": 0.02, "N": 0.002, "current_north": 0.2, "current_east": 0.2}
        for name in ESTIMATE_COLUMNS:
            near = rng.normal(0, slow * spread.get(name, 0.02), count)
            estimates[f"observer.{name}"] = columns.get(name, np.zeros(count)) + near
    return Instants(columns, past, planned, hidden, estimates)


def _normaliser(names, table):
    mean = np.array([np.mean(table[name]) for name in names])
    return Normaliser(tuple(names), mean, np.array([max(np.std(table[name]), 1e-2) for name in names]))


def _signs(rng, size):
    """A signed permutation that equals its inverse."""
    matrix, order = np.zeros((size, size)), rng.permutation(size)
    for a, b in zip(order[0::2], order[1::2], strict=False):
        matrix[a, b] = matrix[b, a] = rng.choice([-1.0, 1.0])
    for a in order[len(order) // 2 * 2 :]:
        matrix[a, a] = rng.choice([-1.0, 1.0])
    return matrix


def network_of(rng, names, table, horizon, terms, mirrored):
    normaliser = _normaliser(names, table)
    units = int(rng.integers(2, 20))
    weight, offset = rng.normal(0, 0.4, (len(names), units)), rng.normal(size=units)
    if mirrored:
        x, y = rng.normal(0, 2, (2, units, terms))
        weight = np.concatenate([weight, _signs(rng, len(names)) @ weight], axis=1)
        output = np.concatenate([np.concatenate([x, x]), np.concatenate([y, -y])], axis=1)
        layers = ((weight, np.concatenate([offset, offset])), (output, rng.normal(size=2 * terms)))
    else:
        more = ((rng.normal(0, 0.4, (units, 5)), rng.normal(size=5)),) if rng.random() < 0.5 else ()
        last = 5 if more else units
        layers = ((weight, offset), *more, (rng.normal(0, 2, (last, 2 * terms)), rng.normal(size=2 * terms)))
    basis = smooth_basis(horizon, terms) if rng.random() < 0.7 else rng.normal(size=(horizon, terms))
    return Network({name: (name,) for name in names}, normaliser, basis, layers)


def _units(rng, names, table, count):
    mirror = rng.random() < 0.6
    return Units(
        _normaliser(names, table),
        rng.normal(0, 0.4, (len(names), count)),
        rng.normal(size=count),
        _signs(rng, len(names)) if mirror else None,
    )


def _corrector(kind, rng, physics, inputs, instants, slow):
    horizon, size = physics.horizon, len(instants)
    seen = replace_planned(instants)
    wind = {name for name in ("u_rw", "v_rw") if rng.random() < 0.5}
    if kind == "alone":
        return UnchangedPath({})
    if kind == "learned-force":
        mass = float(physics.vessel.document["inertia"]["m"])
        block = {"u_scale": 5.0 * slow, "v_scale": slow, "r_scale": 0.1 / slow}
        block |= {"X_max": 0.01 * mass * slow, "Y_max": 0.01 * mass * slow, "N_max": 0.02 * mass * slow}
        arrays = {name: np.array([value]) for name, value in block.items()}
        return ForceCorrector(arrays | {name: rng.normal(size=4) for name in (*HIDDEN, *OUTPUT)}, {})
    if kind == "one-step":
        table = feature_table(instants.columns, inputs.commands)
        names = [name for name in table if not name.endswith("_rw") or name in wind]
        heads = []
        for _ in range(2):
            units = _units(rng, names, table, 6)
            odd = 6 + (units.reflection is None)
            scale = 0.02 * slow
            heads.append(OutputWeights(units, rng.normal(0, scale, (7, 1)), rng.normal(0, scale * 0.3, (odd, 2))))
        return OneStepCorrector(inputs.commands, tuple(heads), {})
    if kind == "modules":
        table = feature_table(instants.columns, inputs.commands)
        names = [name for name in table if not name.endswith("_rw")]
        count = int(rng.integers(0, 6))
        units = _units(rng, names, table, count)
        modules = tuple(modules_of(physics.vessel))
        centres = units.normaliser.apply(table)[: max(2, size // 3)]
        weights = rng.normal(0, 0.3, (len(modules), count + 1))
        alarm = Alarm(units.normaliser, centres, 1.0)
        return ModulesCorrector(inputs.commands, modules, units, weights, alarm, 0.5, 2.0, {})
    if kind == "hankel-dmd":
        delays = int(rng.integers(1, 4))
        table = feature_table(instants.columns, inputs.commands)
        kept = [*MOTIONS, *inputs.commands, *(MISSED_NAMES if physics.vessel is not None else ())]
        names = [name for name in table if not name.endswith("_rw") or name in wind]
        for name in kept:
            component, dot, signal = name.rpartition(".")
            for ago in range(1, delays + 1):
                label = f"{component}{dot}past-{ago}.{signal}"
                names.append(label)
                table[label] = rng.normal(size=size)
        normaliser = Normaliser(tuple(names), np.zeros(len(names)), np.full(len(names), 3.0))
        weights = rng.normal(0, 0.01 * slow, (len(names) + 1, 3))
        law = LinearLaw(inputs.commands, delays, normaliser, weights)
        return HankelCorrector(law, delays * physics.step, {})
    if kind == "regression":
        return _law(rng, inputs, instants, wind, slow)
    if kind == "calibrator":
        inputs = TrajectoryInputs(inputs.commands, inputs.memory, int(rng.integers(1, 4)))
    planned = instants if rng.random() < 0.5 else seen
    table = inputs.table(physics, planned if instants.planned else seen)
    taken = [name for name in table if rng.random() < 0.7 and (not name.endswith("_rw") or name in wind)]
    taken = taken or ["u", "r"]
    terms = int(rng.integers(1, horizon + 1))
    if kind == "path-trained":
        networks = []
        for _ in range(int(rng.integers(1, 4))):
            fewer = [name for name in taken if rng.random() < 0.8] or taken
            networks.append(network_of(rng, fewer, table, horizon, terms, rng.random() < 0.5))
        return Compensator(inputs, tuple(networks), {})
    if kind in ("kernel", "calibrator", "stack"):
        normaliser, count = _normaliser(taken, table), int(rng.integers(1, 40))
        centres = normaliser.apply(table)[rng.integers(size, size=count)]
        members = tuple(
            KernelMember(
                rng.uniform(0.5, 9, len(taken)), float(rng.uniform(0, 2)), rng.normal(0, 2, (count, 2 * terms))
            )
            for _ in range(int(rng.integers(1, 4)))
        )
        reflection = _signs(rng, len(taken)) if rng.random() < 0.6 else None
        made, basis = TrajectoryCompensator if kind == "calibrator" else KernelCompensator, smooth_basis(horizon, terms)
        if kind == "stack":
            law, share = _law(rng, inputs, instants, wind, slow), float(rng.uniform())
            return StackCompensator(inputs, normaliser, reflection, basis, centres, members, {}, law, share)
        return made(inputs, normaliser, reflection, basis, centres, members, {})
    if kind == "forest":
        values = np.stack([table[name] for name in taken], axis=1)
        trees = _trees(rng, values, terms)
        return ForestCorrector(inputs, tuple(taken), smooth_basis(horizon, terms), trees, {})
    steps, units = int(rng.integers(1, 4)), 5
    now = feature_table(instants.columns, inputs.commands)
    names = [name for name in now if not name.endswith("_rw") or name in wind]
    networks = []
    for _ in range(2):
        shapes = {
            "W_i": (3 * units, len(names)), "W_h": (3 * units, units), "b_i": (3 * units,), "b_h": (3 * units,),
            "W_1": (units, units + len(taken)), "c_1": (units,), "W_2": (2 * terms, units), "c_2": (2 * terms,),
        }  # fmt: skip
        layers = {key: rng.normal(0, 0.5, shape) for key, shape in shapes.items()}
        mirrors = (_signs(rng, len(names)), _signs(rng, len(taken))) if rng.random() < 0.5 else None
        reader = SequenceReader(_normaliser(names, now), _normaliser(taken, table), mirrors, steps)
        networks.append(GatedNetwork(reader, layers, smooth_basis(horizon, terms)))
    past = max(steps * physics.step, inputs.memory.past)
    return RecurrentCorrector(inputs, past, tuple(networks), {})


def _law(rng, inputs, instants, wind, slow):
    table = feature_table(instants.columns, inputs.commands)
    names = tuple(name for name in table if not name.endswith("_rw") or name in wind)
    terms = np.stack(law_terms(table, names))
    weights = rng.normal(0, 0.01 * slow, (1, len(terms), 3)) / np.abs(terms).max(axis=1)[:, None]
    reach = slow * rng.uniform([3.0, 1.0, 0.1], [9.0, 3.0, 0.5])
    current = slow * rng.normal(0, 0.3, (1, 2))
    return RegressionCorrector(inputs.commands, names, weights, current, -reach, reach, {})


def replace_planned(instants):
    return Instants(instants.columns, instants.past, None, instants.hidden, instants.estimates)


def _trees(rng, values, terms):
    first, left, right, feature, threshold, leaves = [], [], [], [], [], []

    def grow(depth):
        node = len(left)
        left.append(-1)
        right.append(-1)
        feature.append(0)
        threshold.append(-2.0)
        leaves.append(rng.normal(size=2 * terms))
        if depth and rng.random() < 0.9:
            feature[node] = int(rng.integers(values.shape[1]))
            threshold[node] = float(rng.choice(values[:, feature[node]])) + 1e-3
            left[node], right[node] = grow(depth - 1), grow(depth - 1)
        return node

    first.extend(grow(int(rng.integers(0, 5))) for _ in range(5))
    whole = [np.array(part, dtype=np.int64) for part in (first, left, right, feature)]
    return Trees(*whole, np.array(threshold), np.array(leaves))
