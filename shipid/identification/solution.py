"""What a fit of a vessel's parameters gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from shipid.data.dataset import Array
from shipid.identification.fit import Point
from shipid.identification.settings import NUISANCES, Identify
from shipid.identification.statistics import LinearFit
from shipid.vessel.load import Vessel


@dataclass(frozen=True, kw_only=True)
class Solution(LinearFit):
    """Result of a fit: its linearisation at the estimates, and the status of the solver.

    values : path -> value [SI] of every parameter that a factor acts on, tied ones included.
    nuisances : run -> name -> estimate [SI] of the unknowns of that run. times : (m,) [s] of each residual.
    objective_start, objective : sum of squares at the start, from the measured states, and at the end.
    status : `ok`, `refused` (values that the vessel's checks refuse), `not converged`, `diverged` or `stopped`.
    sentence : the status with its reason and a remedy. warnings : what the fit cannot see, one sentence each.
    effective : signal -> independent residuals that its residuals were counted as, where `discount` is on.
    within : signal -> share of its residuals up to the threshold of huber; 1 with the squared loss.
    """

    vessel: Vessel
    settings: Identify
    values: Mapping[str, float]
    nuisances: Mapping[str, Mapping[str, float]]
    times: Array
    objective_start: float
    objective: float
    iterations: int
    seconds: float
    status: str
    sentence: str
    within: Mapping[str, float]
    point: Point = field(repr=False)
    effective: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def common_current(self) -> tuple[float, float]:
        """Current of all runs, to north and to east [m/s]; 0 where none was estimated, or another one by run."""
        if self.settings.current != "one":
            return 0.0, 0.0
        north, east = (self.nuisances[self.runs[0]][name] for name in NUISANCES["current"])
        return north, east

    @property
    def identified(self) -> Vessel:
        """The vessel with the estimated values; DocumentError if its checks refuse them (status `refused`)."""
        return self.vessel.with_values(self.values)
