"""A predictor as one graph of blocks, with the names, units and limits of what goes in and comes out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from shipid.data.windows import Instants
from shipid.errors import ShipidError
from shipid.export.band import Radii, band_graph, radii
from shipid.export.blocks import Graph, num_numbers
from shipid.export.correctors import CORRECTORS, taken
from shipid.export.known import Known, Layout, layout
from shipid.hybrid.bands import Bands
from shipid.hybrid.learned_force import ForceCorrector
from shipid.hybrid.method import Corrector, widened
from shipid.hybrid.physics import Physics
from shipid.physics.signals import row_of, signal_of
from shipid.simulation.log import column_of
from shipid.vessel.load import Vessel

Array = np.ndarray
ESTIMATES = {"X": "m/s^2", "Y": "m/s^2", "N": "rad/s^2"}
"""Slow force of the observer over the mass -> unit; its other estimates are velocities."""
MOST_NUMBERS = 250_000
"""Numbers in the tables of an exported predictor, at most: about 5 MB of source, 2 MB compiled in double."""


class Exportable(Protocol):
    """The parts of a predictor that an export uses, see `shipid.predictor.Predictor`."""

    @property
    def physics(self) -> Physics: ...  # noqa: D102
    @property
    def method(self) -> str: ...  # noqa: D102
    @property
    def corrector(self) -> Corrector: ...  # noqa: D102
    @property
    def limits(self) -> Mapping[str, tuple[float, float]]: ...  # noqa: D102
    @property
    def provenance(self) -> Mapping[str, Any]: ...  # noqa: D102
    @property
    def commands(self) -> str: ...  # noqa: D102
    @property
    def causal(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def past(self) -> int: ...  # noqa: D102
    @property
    def bands(self) -> Bands | None: ...  # noqa: D102
    @property
    def no_band(self) -> str: ...  # noqa: D102
    @property
    def run_up(self) -> float: ...  # noqa: D102


@dataclass(frozen=True, eq=False)
class Model:
    """A predictor that is ready to be written.

    physics : with the terms of the method. layout : names of the inputs. limits : entries of `now` -> (least, greatest)
    seen in training, with the slack of `Predictor.outside`.
    """

    predictor: Exportable
    physics: Physics
    layout: Layout

    @property
    def vessel(self) -> Vessel | None:
        """The vessel with the terms of the method; None for no physics."""
        return self.physics.vessel

    @cached_property
    def graph(self) -> Graph:
        """(now, reached, past, planned, estimates, parameters) -> path (T, 2), row by row."""
        known, corrector = Known(self.physics, self.layout), self.predictor.corrector
        try:
            path = CORRECTORS[type(corrector)].path(known, corrector)
        except (LookupError, ValueError, TypeError, AttributeError, RuntimeError, AssertionError) as error:
            raise ShipidError(
                f"the parts of the method {self.predictor.method!r} do not fit together ({error}): its file is damaged"
            ) from error
        graph = known.graph.finish(path)
        count = num_numbers(graph) + (0 if self.band is None else num_numbers(self.band))
        if count > MOST_NUMBERS:
            raise ShipidError(
                f"the tables of {self.predictor.method} hold {count} numbers, an export at most {MOST_NUMBERS}: "
                "use fewer trees or units, larger leaves, or the method path-drawn"
            )
        return graph

    @cached_property
    def radii(self) -> Radii | None:
        """(level, pointwise, kind) -> radius (T,) of the band; None where the predictor has none."""
        return None if self.predictor.bands is None else radii(self.predictor.bands)

    @cached_property
    def band(self) -> Graph | None:
        """(now, path, level, pointwise, kind) -> band, a row for each step, see `shipid.export.band.COLUMNS`."""
        if self.radii is None or self.predictor.bands is None:
            return None
        return band_graph(self.predictor.bands, self.layout.now, self.physics.step, self.radii)

    @property
    def no_band(self) -> str:
        """Why there is no band."""
        return self.predictor.no_band

    @property
    def parameters(self) -> Array:
        """Values of the parameters, in order."""
        return np.array(list(self.vessel.parameters.values())) if self.vessel is not None else np.zeros(0)

    @cached_property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Entry of `now` -> least and greatest value without an alarm."""
        given = {name: widened(*ends) for name, ends in self.predictor.limits.items() if name in self.layout.now}
        return {name: (float(low), float(high)) for name, (low, high) in given.items()}

    def unit(self, name: str) -> str:
        """SI unit of an entry of an input."""
        if self.vessel is not None and name in self.vessel.units:
            return self.vessel.units[name]
        row = row_of(column_of(name))
        return ESTIMATES.get(signal_of(name), "m/s") if row is None else row.unit

    def inputs(self, instants: Instants) -> dict[str, Array]:
        """The inputs of the graph for S instants, name -> (S, entries); what a log does not hold is 0."""
        names, count, zero = self.layout, len(instants), np.zeros(len(instants))
        columns: Mapping[str, Array] = {"down": instants.columns.get("z", zero), **instants.columns}
        now = [np.asarray(columns.get(name, zero), dtype=float) for name in names.now]
        past = []
        for row in range(names.num_past):
            at = len(next(iter(instants.past.values()))) - names.num_past + row
            rows = {"down": instants.past.get("z", np.zeros((at + 1, count))), **instants.past}
            past += [np.asarray(rows[name][at]) if name in rows else zero for name in names.past]
        planned = [
            np.asarray((instants.planned or {})[name][k]) for k in range(names.horizon) for name in names.planned
        ]
        orders = {name: (instants.planned or {}).get(name, [columns.get(name)])[0] for name in names.reached}
        reached = [np.asarray((instants.hidden or orders)[name], dtype=float) for name in names.reached]
        estimates = [np.asarray(instants.estimates[name]) for name in names.estimates]
        groups = {"now": now, "reached": reached, "past": past, "planned": planned, "estimates": estimates}
        stacked = {key: np.stack(rows, axis=1) if rows else np.zeros((count, 0)) for key, rows in groups.items()}
        return {**stacked, "parameters": np.tile(self.parameters, (count, 1))}


def model(predictor: Exportable) -> Model:
    """A predictor as a model; ShipidError for a method that has no counterpart."""
    corrector, physics = predictor.corrector, predictor.physics
    taken_ = taken(corrector)
    if isinstance(corrector, ForceCorrector):
        physics = corrector.with_force(physics)
    names = layout(
        physics,
        taken_.commands or _orders(predictor),
        predictor.past,
        known=predictor.commands == "known",
        environment=taken_.environment,
        limited=(*predictor.limits, *(() if predictor.bands is None else predictor.bands.names)),
    )
    return Model(predictor, physics, names)


def _orders(predictor: Exportable) -> tuple[str, ...]:
    return tuple(name for name in predictor.limits if "." in name)
