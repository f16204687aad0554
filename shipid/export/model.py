"""A predictor as one CasADi function, with the names, units and limits of what goes in and comes out; its band."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.data.windows import Instants
from shipid.errors import ShipidError
from shipid.export.equations import function_by_names, split_by_name, symbols_of
from shipid.export.known import (
    POSITION_ENTRIES,
    InputLayout,
    NamedExpressions,
    change_arrays,
    symbolic_instants,
    symbolic_physics,
)
from shipid.hybrid.bands import FEWEST, LEVELS, Bands, track_directions
from shipid.hybrid.features import MOTIONS
from shipid.hybrid.forest import ForestCorrector, Trees
from shipid.hybrid.kernel_compensator import KernelCompensator
from shipid.hybrid.mean import DeployedMethod, MeanCorrector
from shipid.hybrid.method import Corrector, widen_range
from shipid.hybrid.methods import METHODS
from shipid.hybrid.modules import Alarm, ModulesCorrector
from shipid.hybrid.novelty import alarm_inputs
from shipid.hybrid.physics import Physics
from shipid.hybrid.simulated import SimulatedPhysics
from shipid.observer import ESTIMATE_COLUMNS
from shipid.physics.signals import signal_of, signal_row
from shipid.plugins import error_location, is_user_code, locate_errors
from shipid.simulation.log import state_column
from shipid.vessel.dynamics import vessel_dynamics

Array = np.ndarray


def symbolic_corrector(corrector: Corrector) -> Corrector:
    """The same corrector, which also predicts from symbols."""
    if isinstance(corrector, ForestCorrector):
        return replace(corrector, trees=SymbolicTrees(**vars(corrector.trees)))
    if isinstance(corrector, ModulesCorrector):
        return replace(corrector, alarm=SymbolicAlarm(**vars(corrector.alarm)))
    if isinstance(corrector, KernelCompensator):  # else the centres over the scales of each member were written out
        members = tuple(replace(one, scales=_symbolic_constant(one.scales)) for one in corrector.members)
        return replace(corrector, centres=_symbolic_constant(corrector.centres), members=members)
    return corrector


def _symbolic_constant(values: Array) -> Any:
    """Numbers that CasADi keeps apart from what is computed with them."""
    return ca.ArrayInterface.MX(MX(ca.DM(values)), shape=values.shape)


class SymbolicTrees(Trees):
    """Trees of symbols; all go down together, a level at a time.

    Nodes are numbered anew, those of leaves last. Python compares inputs in single precision: a threshold becomes the
    greatest number in double precision that goes left.
    """

    def predict(self, inputs: Any) -> Any:
        """Mean of the leaves that inputs (1, d) come to, (1, outputs)."""
        seen, leaf = MX(inputs).T, np.asarray(self.left < 0)
        inner = int((~leaf).sum())
        number = np.where(leaf, inner + np.cumsum(leaf) - 1, np.cumsum(~leaf) - 1)
        node = MX(ca.DM(number[self.first]))
        if inner:
            children = ca.DM(number[np.stack([self.left, self.right], axis=1)[~leaf]].ravel())
            feature, threshold = ca.DM(self.feature[~leaf]), ca.DM(greatest_left(self.threshold[~leaf]))
        for _ in range(depth_of(self)):
            at = ca.fmin(node, inner - 1)
            right = seen[MX(feature)[at]] > MX(threshold)[at]
            node = ca.if_else(node >= inner, node, MX(children)[2 * at + right])
        outputs, values = self.value.shape[1], MX(ca.DM(self.value[leaf].ravel()))
        places = ca.repmat((node - inner).T * outputs, outputs, 1)
        places += ca.repmat(ca.DM(range(outputs)), 1, len(self.first))
        leaves = ca.reshape(values[ca.vec(places)], outputs, len(self.first))
        return ca.ArrayInterface(ca.sum2(leaves).T / len(self.first))


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


class SymbolicAlarm(Alarm):
    """Distances of symbols."""

    def away(self, z: Any) -> Any:
        """Distance (1,) of normalised inputs (1, d) to the nearest centre."""
        return ca.ArrayInterface.MX(distance_to_nearest(MX(z).T, self.centres), shape=(1,))


def distance_to_nearest(point: MX, centres: Array) -> MX:
    """Distance of a point (d,) to the nearest of some centres (C, d); a slope of 0 at a centre."""
    apart = ca.DM(centres.T) - ca.repmat(point, 1, len(centres))
    least = ca.mmin(ca.sum1(apart**2))
    return ca.if_else(least == 0, 0, ca.sqrt(ca.if_else(least == 0, 1, least)))


BAND_CHOICE = ("level", "pointwise", "kind")
"""Inputs of a band: its level, whether each step is taken alone (0 or 1), the kind of manoeuvre (0: any)."""
BAND_ROWS = ("along", "across", "ahead_x", "ahead_y")
"""Rows of a band: half axes [m], and the unit vector of the track in body axes; a column for each step."""


def half_axes_at(bands: Bands, level: MX, pointwise: MX, kind: MX) -> MX:
    """Half axes (T, 2) of a band before it grows: radius, linear between `LEVELS`, times scale.

    Each table has a weight of 1 at its place.
    """
    whole = np.vstack([bands.whole[None], bands.by_kind.reshape(-1, len(LEVELS))])
    near = ca.fmax(0, 1 - ca.fabs(100 * level - ca.DM(100 * LEVELS)))
    of = ca.fmax(0, 1 - ca.fabs(kind - ca.DM(range(len(whole)))))
    radius = ca.dot(of, ca.mtimes(ca.DM(whole), near))
    radii = ca.if_else(pointwise != 0, ca.mtimes(ca.DM(bands.steps.T), near), ca.repmat(radius, len(bands.along), 1))
    scales = np.concatenate([np.stack([bands.along, bands.across], axis=1)[None], bands.scales])
    return ca.horzcat(*(ca.mtimes(ca.DM(scales[..., side].T), of) * radii for side in (0, 1)))


def band_rows(
    bands: Bands, now: NamedExpressions, path: MX, step: float, half: MX, past: Mapping[str, Any] | None = None
) -> MX:
    """Rows (4, T) of `BAND_ROWS` around a path (2, T) of steps [s]; half axes (T, 2), rows of the past."""
    columns: dict[str, Any] = {name: ca.ArrayInterface.MX(now[name], shape=(1,)) for name in (*MOTIONS, *bands.names)}
    paths: Any = ca.ArrayInterface.MX(path.T, shape=(path.shape[1], 1, 2))
    grown = MX(SymbolicBands(**vars(bands)).growth(paths, columns, step, past))
    ahead: Any = track_directions(paths)
    return ca.vertcat(grown * half.T, MX(ahead.reshape(path.shape[1], 2)).T)


class SymbolicBands(Bands):
    """Bands of symbols."""

    def away(self, points: Any) -> Any:
        """Distance (1,) of points (1, d) from the windows of training."""
        nearest = distance_to_nearest(MX(points / self.spread).T, self.centres / self.spread)
        return ca.ArrayInterface.MX(nearest / np.sqrt(self.centres.shape[1]), shape=(1,))


def is_band_promised(bands: Bands, level: MX, pointwise: MX, kind: MX) -> MX:
    """Whether enough runs calibrated the level, or the kind, as `Bands.check`."""
    counts = ca.DM([bands.runs, *bands.kinds.values()])
    runs = ca.dot(counts, kind == ca.DM(range(len(bands.kinds) + 1)))
    promised = ca.logic_and(ca.logic_and(level > 0, level <= float(LEVELS[-1])), runs >= FEWEST)
    promised = ca.logic_and(promised, level / (1 - level) - 1e-9 <= runs)
    return ca.logic_and(promised, ca.logic_not(ca.logic_and(pointwise != 0, kind != 0)))


UNITS_OF_FORCES = {"X": "m/s^2", "Y": "m/s^2", "N": "rad/s^2"}
"""Slow force of the observer over the mass -> unit; its other estimates are velocities."""
MOST_NUMBERS = 300_000
"""Numbers in the arrays of an exported predictor, at most: 8 MB of source, 2.4 MB compiled."""


@dataclass(frozen=True, eq=False)
class ExportModel:
    """A predictor that is ready to be written.

    physics : with the terms of the method. layout : names of the inputs.
    """

    predictor: DeployedMethod
    physics: Physics
    layout: InputLayout

    @cached_property
    def function(self) -> ca.Function:
        """The inputs of `InputLayout.sizes` and a choice of a band -> path, outside, band, promised.

        path : (2, T) x and y [m] in body axes at the instant. outside : 1 for the alarm. band : (4, T), see
        `shipid.export.model.BAND_ROWS`; where `promised` is 0 it is not a number. The choice of a band and the last two
        outputs are there where the predictor has bands; a band has no derivative.

        `predict` of the method itself runs on symbols. ShipidError for a mean, for networks of PyTorch, for a method
        whose parts do not fit together or are too large, or that CasADi cannot follow.
        """
        corrector, bands = self.predictor.corrector, self.predictor.bands
        if isinstance(corrector, MeanCorrector):
            raise ShipidError("a mean over foundations cannot be exported: export the cells of its foundations")
        if getattr(corrector, "of_torch", False):
            raise ShipidError(
                f"a predictor by the method {self.predictor.method} cannot be exported so: its networks are of "
                "PyTorch, export them to onnx"
            )
        tables = [part.arrays() for part in (corrector, bands, self.predictor.alarm) if part is not None]
        arrays = [array for table in tables for array in table.values()]
        count = sum(np.size(array) for array in arrays)
        if count > MOST_NUMBERS:
            raise ShipidError(
                f"the tables of {self.predictor.method} hold {count} numbers, an export at most {MOST_NUMBERS}: "
                "use fewer trees, units or centres, or larger leaves"
            )
        inputs, layout, method = symbols_of(self.layout.sizes), self.layout, self.predictor.method
        now, instants = split_by_name(layout.now, inputs["now"]), symbolic_instants(layout, inputs)
        physics, moved = symbolic_physics(self.predictor.physics), symbolic_physics(self.physics)
        given = ca.reshape(inputs["physics"], 2, layout.horizon).T if layout.physics else None
        alone: Any = (
            physics.paths(instants) if given is None else ca.ArrayInterface.MX(given, shape=(layout.horizon, 1, 2))
        )
        try:
            predicted: Any = symbolic_corrector(corrector).predict(physics, instants, alone)
            path = MX(predicted.reshape(physics.horizon, 2)).T
        except Exception as error:  # of a damaged file, of what CasADi's arrays lack of NumPy's, or in a user's code
            raise ShipidError(
                f"the parts of the method {method!r} do not fit together ({error})"
                f"{error_location(error, type(corrector))}: its file is damaged, or `predict` takes what CasADi does "
                "not have of NumPy"
            ) from error
        if is_user_code(type(corrector)):
            self._check_by_numbers(inputs, instants, alone, path)
        alarm = self.predictor.alarm
        raised = (
            self._is_beyond_limits(now)
            if alarm is None
            else MX(alarm.is_raised(alarm_inputs(alarm.inputs, alarm.past, moved, instants)))
        )
        diverges = MX(0) if moved.vessel is None else ca.logic_not(moved.is_slow(moved.records(instants)))
        outputs = {"path": path, "outside": ca.logic_or(raised, diverges)}
        if bands is not None:
            choice = symbols_of(dict.fromkeys(BAND_CHOICE, 1))
            promised = is_band_promised(bands, **choice)
            rows = band_rows(bands, now, path, self.physics.step, half_axes_at(bands, **choice), instants.past)
            inputs |= choice
            outputs |= {"band": ca.if_else(promised, rows, np.nan), "promised": promised}
        return function_by_names("predict", inputs, outputs, is_diff_out=[name == "path" for name in outputs])

    def _check_by_numbers(self, inputs: NamedExpressions, instants: Instants, alone: Any, path: MX) -> None:
        """Raise ShipidError where `predict` gives another path on symbols than on numbers, at one drawn instant.

        alone : (T, 1, 2) of the physics. path : (2, T) that the method made of it. On arrays of three axes some
        functions of NumPy are silently others in CasADi, such as `np.max` and `np.ptp` along an axis.
        """
        random, home, drawn, arrays = np.random.default_rng(0), type(self.predictor.corrector), [], list[Any]()
        for group, size in self.layout.sizes.items():
            ends = [self.limits.get(name, (0.0, 1.0)) for name in getattr(self.layout, group)]
            drawn.append(random.uniform(*np.resize(np.reshape(ends, (-1, 2)), (size, 2)).T))
        change_arrays(instants, arrays.append)
        symbols = [path.T, *(MX(one.reshape(-1)) for one in (*arrays, alone))]
        made, *rest = map(np.array, ca.Function("values", [*inputs.values()], symbols).call(drawn))
        numbers = (value.reshape(one.shape) for value, one in zip(rest, (*arrays, alone), strict=True))
        given = change_arrays(instants, lambda _: next(numbers))
        with locate_errors(f"{home.__name__}.predict", home):
            expected = self.predictor.corrector.predict(self.predictor.physics, given, next(numbers))
        if not np.allclose(made, expected.reshape(made.shape), rtol=1e-6, atol=1e-6, equal_nan=True):  # beyond rounding
            raise ShipidError(
                f"`predict` of the method {self.predictor.method!r} gives another path on symbols of CasADi than on "
                "numbers: let it write to no array, and compute with arrays of one or two axes"
            )

    def _is_beyond_limits(self, now: NamedExpressions) -> MX:
        """Whether the limits raise the alarm, where none is calibrated."""
        inside = MX(1 if self.limits else 0)
        for name, (low, high) in self.limits.items():
            inside = ca.logic_and(inside, ca.logic_and(now[name] >= low, now[name] <= high))
        return MX(ca.logic_not(inside))

    @cached_property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Entry of `now` -> least and greatest value without an alarm, with the slack of `Predictor.outside`."""
        given = {name: widen_range(*ends) for name, ends in self.predictor.limits.items() if name in self.layout.now}
        return {name: (float(low), float(high)) for name, (low, high) in given.items()}

    def units(self, group: str) -> dict[str, str]:
        """Entries of an input, entry -> SI unit."""
        rows = {name: signal_row(state_column(name)) for name in getattr(self.layout, group)}
        return {
            name: UNITS_OF_FORCES.get(signal_of(name), "m/s") if row is None else row.unit for name, row in rows.items()
        }


def build_model(predictor: DeployedMethod) -> ExportModel:
    """A predictor as a model.

    Its inputs are those of the physics, or the path of a simulator, and what the alarm and the band look at: every
    input of a method is among them, but for the direction of the wind.
    """
    physics = predictor.physics_with_force
    states, memory, orders, weather = (tuple[str, ...](),) * 4
    if physics.vessel is not None:
        model = vessel_dynamics(physics.vessel)
        states, memory, orders, weather = model.state, tuple(model.memory), model.commands, model.environment
    limited = [*predictor.limits, *(() if predictor.bands is None else predictor.bands.names)]
    wind = ("V_w", "beta_w") if "V_w" in limited else ()
    commands = tuple(dict.fromkeys((*orders, *(name for name in predictor.limits if "." in name))))
    motion = (*POSITION_ENTRIES, "psi", *MOTIONS)
    measured = predictor.inputs.memory.states
    now = tuple(dict.fromkeys((*motion, *states, *commands, *weather, *wind, *limited, *measured)))
    past = (*now[len(POSITION_ENTRIES) :], "x", "y") if predictor.past else ()
    estimates = tuple(f"observer.{name}" for name in ESTIMATE_COLUMNS) if physics.observer is not None else ()
    planned = commands if predictor.commands == "known" else ()
    given = ("x", "y") if isinstance(physics, SimulatedPhysics) else ()
    if given and (METHODS[predictor.method].needs != "path" or predictor.inputs.memory.error):
        words = "the physics is a simulator, which no file holds, and the method asks it for more than a path"
        raise ShipidError(f"{words}: take one that needs the path alone, without memory.error")
    return ExportModel(
        predictor,
        physics,
        InputLayout(now, memory, past, predictor.past, planned, physics.horizon, estimates, given),
    )
