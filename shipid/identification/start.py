"""Where a fit begins: a horizon that grows, and inverse dynamics.

A long prediction from poor factors diverges, and its objective has many minima. Over two steps it is nearly linear in
the factors. So the same fit is solved for short horizons first, each from the factors of the one before: continuation.
A start need not be exact: a share of the data and a rough tolerance are enough.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Dataset
from shipid.errors import DataError
from shipid.identification.fit import Progress, Result, origin, search
from shipid.identification.inverse import inverse_dynamics
from shipid.identification.problem import ENVIRONMENT, overrides
from shipid.identification.residuals import Fit, build

Array = NDArray[np.float64]
HORIZONS = (2.0, 5.0, 15.0, 60.0)  # s
ENOUGH = 20000  # steps of all predictions of a short horizon: more take time and change a start little
ROUGH, MOST = 1e-3, 25  # tolerance and evaluations of a short horizon


def grown(
    fit: Fit, dataset: Dataset, factors: Array, progress: Progress | None = None, before: int = 0
) -> tuple[Array, int, bool]:
    """Factors that predict best over horizons that grow up to that of the fit.

    Returns
    -------
    Factors (n,), iterations counted on from those `before`, and whether `progress` asked to stop.
    """
    longest = max(segment.num_steps for segment in fit.segments) * fit.settings.step
    iterations = before
    for horizon in HORIZONS:
        steps = max(2, round(horizon / fit.settings.step))
        if steps * fit.settings.step >= longest:
            break
        found = _at(fit, dataset, factors, steps * fit.settings.step, progress, iterations)
        if found is None or not np.isfinite(found.objective):
            continue
        factors, iterations = found.factors, found.iterations
        if found.status == "stopped":
            return factors, iterations, True
    return factors, iterations, False


def _at(
    fit: Fit, dataset: Dataset, factors: Array, horizon: float, progress: Progress | None, before: int
) -> Result | None:
    """The fit with a shorter horizon; None where the runs cannot be cut so."""
    widths = {name: width for name, width in fit.settings.widths.items() if name != "initial_state"}
    settings = fit.settings.model_copy(update={"horizon": horizon, "nuisance": widths})
    try:
        short = build(fit.vessel, dataset, fit.runs, settings)
    except DataError:
        return None
    short = replace(short, unknown=fit.unknown, segments=_spread(short))
    return search(short, factors, origin(short), progress, before=before, tolerance=ROUGH, most=MOST)


def _spread(fit: Fit) -> tuple[object, ...]:
    """Predictions at equal distances, of every run at least one, that have no more steps than are enough."""
    steps = sum(segment.num_steps for segment in fit.segments)
    every = max(1, round(steps / ENOUGH))
    runs = [[one for one in fit.segments if one.run == run] for run in range(len(fit.runs))]
    return tuple(one for of_run in runs for one in of_run[::every])


def by_inverse_dynamics(fit: Fit, dataset: Dataset) -> Array:
    """Factors (n,) that explain the accelerations, within the bounds."""
    unknown = fit.unknown
    given = overrides(fit.settings, fit.runs, fit.vessel, fit.layout.model.environment, dataset.runs)
    head = f"{ENVIRONMENT}."
    weather: Mapping[str, Mapping[str, float]] = {
        run: {key.removeprefix(head): value for key, value in values.items() if key.startswith(head)}
        for run, values in given.items()
    }
    found = inverse_dynamics(
        fit.vessel, dataset, fit.runs, unknown.groups, scale=unknown.scale, prior=unknown.prior, environment=weather
    )
    return np.asarray(np.clip(found.factors, unknown.low, unknown.high))
