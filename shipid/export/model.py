"""A predictor as one CasADi function, with the names, units and limits of what goes in and comes out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.errors import ShipidError
from shipid.export.band import BAND_CHOICE, band_rows, half_axes_at, is_band_promised
from shipid.export.correctors import symbolic_corrector
from shipid.export.equations import function_by_names, symbols_of
from shipid.export.known import POSITION_ENTRIES, InputLayout, PredictorInputs, change_arrays, symbolic_physics
from shipid.hybrid.deployed import DeployedMethod
from shipid.hybrid.features import MOTIONS
from shipid.hybrid.mean import MeanCorrector
from shipid.hybrid.method import widen_range
from shipid.hybrid.methods import METHODS
from shipid.hybrid.novelty import alarm_inputs
from shipid.hybrid.physics import Physics
from shipid.hybrid.simulated import SimulatedPhysics
from shipid.observer import ESTIMATE_COLUMNS
from shipid.physics.signals import signal_of, signal_row
from shipid.simulation.log import state_column
from shipid.users import error_location, is_user_code, locate_errors
from shipid.vessel.dynamics import vessel_dynamics

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
        `shipid.export.band.BAND_ROWS`; where `promised` is 0 it is not a number. The choice of a band and the last two
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
                "use fewer trees or units, larger leaves, or the method path-drawn"
            )
        known = PredictorInputs(self.physics, self.layout)
        physics, method = symbolic_physics(self.predictor.physics), self.predictor.method
        alone = known.paths(physics)
        try:
            predicted: Any = symbolic_corrector(corrector).predict(physics, known.instants, alone)
            path = MX(predicted.reshape(physics.horizon, 2)).T
        except Exception as error:  # of a damaged file, of what CasADi's arrays lack of NumPy's, or in a user's code
            raise ShipidError(
                f"the parts of the method {method!r} do not fit together ({error})"
                f"{error_location(error, type(corrector))}: its file is damaged, or `predict` takes what CasADi does "
                "not have of NumPy"
            ) from error
        if is_user_code(type(corrector)):
            self._check_by_numbers(known, alone, path)
        inputs, outputs = (
            dict(known.inputs),
            {"path": path, "outside": ca.logic_or(self._outside(known), known.diverges)},
        )
        if bands is not None:
            choice = symbols_of(dict.fromkeys(BAND_CHOICE, 1))
            promised = is_band_promised(bands, **choice)
            rows = band_rows(
                bands, known.now, path, self.physics.step, half_axes_at(bands, **choice), known.instants.past
            )
            inputs |= choice
            outputs |= {"band": ca.if_else(promised, rows, np.nan), "promised": promised}
        return function_by_names("predict", inputs, outputs, is_diff_out=[name == "path" for name in outputs])

    def _check_by_numbers(self, known: PredictorInputs, alone: Any, path: MX) -> None:
        """Raise ShipidError where `predict` gives another path on symbols than on numbers, at one drawn instant.

        alone : (T, 1, 2) of the physics. path : (2, T) that the method made of it. On arrays of three axes some
        functions of NumPy are silently others in CasADi, such as `np.max` and `np.ptp` along an axis.
        """
        random, home, drawn, arrays = np.random.default_rng(0), type(self.predictor.corrector), [], list[Any]()
        for group, size in self.layout.sizes.items():
            ends = [self.limits.get(name, (0.0, 1.0)) for name in getattr(self.layout, group)]
            drawn.append(random.uniform(*np.resize(np.reshape(ends, (-1, 2)), (size, 2)).T))
        change_arrays(known.instants, arrays.append)
        symbols = [path.T, *(MX(one.reshape(-1)) for one in (*arrays, alone))]
        made, *rest = map(np.array, ca.Function("values", [*known.inputs.values()], symbols).call(drawn))
        numbers = (value.reshape(one.shape) for value, one in zip(rest, (*arrays, alone), strict=True))
        given = change_arrays(known.instants, lambda _: next(numbers))
        with locate_errors(f"{home.__name__}.predict", home):
            expected = self.predictor.corrector.predict(self.predictor.physics, given, next(numbers))
        if not np.allclose(made, expected.reshape(made.shape), rtol=1e-6, atol=1e-6, equal_nan=True):  # beyond rounding
            raise ShipidError(
                f"`predict` of the method {self.predictor.method!r} gives another path on symbols of CasADi than on "
                "numbers: let it write to no array, and compute with arrays of one or two axes"
            )

    def _outside(self, known: PredictorInputs) -> MX:
        """Whether the alarm is raised: the calibrated one, or else by the limits."""
        if self.predictor.alarm is not None:
            alarm = self.predictor.alarm
            return MX(alarm.is_raised(alarm_inputs(alarm.inputs, alarm.past, known.physics, known.instants)))
        inside = MX(1 if self.limits else 0)
        for name, (low, high) in self.limits.items():
            inside = ca.logic_and(inside, ca.logic_and(known.now[name] >= low, known.now[name] <= high))
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
