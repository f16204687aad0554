"""What a fit of a vessel's parameters gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from shipid.identification.fit import Point
from shipid.identification.settings import NUISANCES, Identify, free_factors
from shipid.vessel.load import Vessel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Solution:
    """Result of a fit: estimates, residuals, Jacobian, and the status of the solver.

    paths, factors : name and estimate (n,) of each factor; the name of a tied group is its first path.
    values : path -> value [SI] of every parameter that a factor acts on, tied ones included.
    nuisances : run -> name -> estimate [SI] of the unknowns of that run.
    residuals : (m,) predicted less measured over the declared standard deviation, nuisances projected out; by run, then
    time. With huber those of `Prediction.marginal`.
    jacobian : (m, n) d residual / d factor with the nuisances projected out: J^T J is the Fisher information.
    prior_widths : (n,) standard deviations of the factors' priors; inf: none. centre : (n,) their means.
    clusters, signals, times : (m,) index of the run, column and time [s] of each residual.
    spent : (m,) share of each residual that the nuisances have taken.
    objective_start, objective : sum of squares at the start, from the measured states, and at the end.
    status : `ok`, `refused` (values that the vessel's checks refuse), `not converged`, `diverged` or `stopped`.
    sentence : the status with its reason and a remedy. warnings : what the fit cannot see, one sentence each.
    at_bound : (n,) whether the estimate is at a bound. held : (n,) factors that are not free. dropped : their paths.
    effective : signal -> independent residuals that its residuals were counted as, where `discount` is on.
    within : signal -> share of its residuals up to the threshold of huber; 1 with the squared loss.
    """

    vessel: Vessel
    runs: tuple[str, ...]
    settings: Identify
    paths: tuple[str, ...]
    factors: Array
    values: Mapping[str, float]
    nuisances: Mapping[str, Mapping[str, float]]
    residuals: Array
    jacobian: Array
    prior_widths: Array
    centre: Array
    clusters: NDArray[np.intp]
    signals: tuple[str, ...]
    times: Array
    spent: Array
    objective_start: float
    objective: float
    iterations: int
    seconds: float
    status: str
    sentence: str
    at_bound: NDArray[np.bool_]
    held: NDArray[np.bool_]
    point: Point = field(repr=False)
    dropped: tuple[str, ...] = ()
    effective: Mapping[str, float] = field(default_factory=dict)
    within: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def common_current(self) -> tuple[float, float]:
        """Current of all runs, to north and to east [m/s]; 0 where none was estimated, or another one by run."""
        if self.settings.current != "one":
            return 0.0, 0.0
        north, east = (self.nuisances[self.runs[0]][name] for name in NUISANCES["current"])
        return north, east

    @property
    def sizes(self) -> tuple[tuple[float, str], ...]:
        """Value [SI] of the parameter at each factor of 1, or of a current of all runs [m/s], and its unit, (n,)."""
        unknown, units = free_factors(self.vessel, self.settings), self.vessel.units
        named = zip(unknown.paths, unknown.scale, strict=True)
        return tuple((scales[0], units.get(path, "m/s")) for path, scales in named)

    @property
    def identified(self) -> Vessel:
        """The vessel with the estimated values; DocumentError if its checks refuse them (status `refused`)."""
        return self.vessel.with_values(self.values)
