"""A predictor as one CasADi function, with the names, units and limits of what goes in and comes out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.data.windows import Instants
from shipid.errors import ShipidError
from shipid.export.band import BAND_CHOICE, band_rows, is_band_promised, radii_at
from shipid.export.correctors import CORRECTORS, inputs_of
from shipid.export.equations import function_by_names, symbols_of
from shipid.export.known import InputLayout, PredictorInputs, input_layout
from shipid.hybrid.deployed import DeployedMethod
from shipid.hybrid.learned_force import ForceCorrector
from shipid.hybrid.method import widen_range
from shipid.hybrid.physics import Physics
from shipid.physics.signals import signal_of, signal_row
from shipid.simulation.log import state_column
from shipid.vessel.load import Vessel

Array = np.ndarray
UNITS_OF_FORCES = {"X": "m/s^2", "Y": "m/s^2", "N": "rad/s^2"}
"""Slow force of the observer over the mass -> unit; its other estimates are velocities."""
MOST_NUMBERS = 300_000
"""Numbers in the arrays of an exported predictor, at most: 8 MB of source, 2.4 MB compiled in double precision."""


@dataclass(frozen=True, eq=False)
class ExportModel:
    """A predictor that is ready to be written.

    physics : with the terms of the method. layout : names of the inputs.
    """

    predictor: DeployedMethod
    physics: Physics
    layout: InputLayout

    @property
    def vessel(self) -> Vessel | None:
        """The vessel with the terms of the method; None for no physics."""
        return self.physics.vessel

    @cached_property
    def function(self) -> ca.Function:
        """The inputs of `Layout.sizes` and a choice of a band -> path, outside, band, promised.

        path : (2, T) x and y [m] in body axes at the instant. outside : 1 for the alarm. band : (4, T), see
        `shipid.export.band.BAND_ROWS`; where `promised` is 0 it is not a number. The choice of a band and the last two
        outputs are there where the predictor has bands; a band has no derivative.

        ShipidError for a method whose parts do not fit together, or are too large.
        """
        self._check_size()
        known, corrector, bands = (
            PredictorInputs(self.physics, self.layout),
            self.predictor.corrector,
            self.predictor.bands,
        )
        try:
            path = CORRECTORS[type(corrector)].path(known, corrector)
        except (LookupError, ValueError, TypeError, AttributeError, RuntimeError, AssertionError) as error:
            raise ShipidError(
                f"the parts of the method {self.predictor.method!r} do not fit together ({error}): its file is damaged"
            ) from error
        inputs, outputs = dict(known.inputs), {"path": path, "outside": self._outside(known.now)}
        if bands is not None:
            choice = symbols_of(dict.fromkeys(BAND_CHOICE, 1))
            promised = is_band_promised(bands, **choice)
            rows = band_rows(bands, known.now, path, self.physics.step, radii_at(bands, **choice))
            inputs |= choice
            outputs |= {"band": ca.if_else(promised, rows, np.nan), "promised": promised}
        return function_by_names("predict", inputs, outputs, is_diff_out=[name == "path" for name in outputs])

    def _check_size(self) -> None:
        bands = self.predictor.bands
        arrays = [*self.predictor.corrector.arrays().values(), *([] if bands is None else bands.arrays().values())]
        count = sum(np.size(array) for array in arrays)
        if count > MOST_NUMBERS:
            raise ShipidError(
                f"the tables of {self.predictor.method} hold {count} numbers, an export at most {MOST_NUMBERS}: "
                "use fewer trees or units, larger leaves, or the method path-drawn"
            )

    def _outside(self, now: Mapping[str, MX]) -> MX:
        """Whether the instant is outside of what training has seen, as `Predictor.outside` without a run-up."""
        inside = MX(1 if self.predictor.limits else 0)
        for name, (low, high) in self.limits.items():
            inside = ca.logic_and(inside, ca.logic_and(now[name] >= low, now[name] <= high))
        return ca.logic_not(inside)

    @property
    def parameters(self) -> Array:
        """Values of the parameters, in order."""
        return np.array(list(self.vessel.parameters.values())) if self.vessel is not None else np.zeros(0)

    @cached_property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Entry of `now` -> least and greatest value without an alarm, with the slack of `Predictor.outside`."""
        given = {name: widen_range(*ends) for name, ends in self.predictor.limits.items() if name in self.layout.now}
        return {name: (float(low), float(high)) for name, (low, high) in given.items()}

    def unit(self, name: str) -> str:
        """SI unit of an entry of an input."""
        if self.vessel is not None and name in self.vessel.units:
            return self.vessel.units[name]
        row = signal_row(state_column(name))
        return UNITS_OF_FORCES.get(signal_of(name), "m/s") if row is None else row.unit

    def inputs(self, instants: Instants) -> dict[str, Array]:
        """The inputs of the function for S instants, name -> (S, entries); what a log does not hold is 0."""
        names, count, zero = self.layout, len(instants), np.zeros(len(instants))
        planned = instants.planned or {}
        columns: Mapping[str, Array] = {"down": instants.columns.get("z", zero), **instants.columns}
        past = {"down": instants.past.get("z", np.zeros((names.num_past, count))), **instants.past}
        orders = {name: planned.get(name, [columns.get(name)])[0] for name in names.reached}
        hidden = instants.hidden or orders
        groups: dict[str, list[Any]] = {
            "now": [columns.get(name, zero) for name in names.now],
            "reached": [hidden[name] for name in names.reached],
            "past": [
                past[name][k - names.num_past] if name in past else zero
                for k in range(names.num_past)
                for name in names.past
            ],
            "planned": [planned[name][k] for k in range(names.horizon) for name in names.planned],
            "estimates": [instants.estimates[name] for name in names.estimates],
        }
        stacked = {
            key: np.stack([np.asarray(row, dtype=float) for row in rows], axis=1) if rows else np.zeros((count, 0))
            for key, rows in groups.items()
        }
        return {**stacked, "parameters": np.tile(self.parameters, (count, 1))}


def build_model(predictor: DeployedMethod) -> ExportModel:
    """A predictor as a model; ShipidError for a method that has no counterpart."""
    corrector, physics = predictor.corrector, predictor.physics
    taken = inputs_of(corrector)
    if isinstance(corrector, ForceCorrector):
        physics = corrector.with_force(physics)
    names = input_layout(
        physics,
        taken.commands or tuple(name for name in predictor.limits if "." in name),
        predictor.past,
        known=predictor.commands == "known",
        environment=taken.environment,
        limited=(*predictor.limits, *(() if predictor.bands is None else predictor.bands.names)),
    )
    return ExportModel(predictor, physics, names)
