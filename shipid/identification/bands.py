"""Standard manoeuvres of an identified vessel: bands that the uncertainty of its numbers leaves open, extrapolation.

The vessel performs each manoeuvre one standard deviation to either side along each principal axis of the covariance.
Half the difference of a measure is its linear part, the mean of both less the estimate its bend: the variance is the
linear part squared plus twice the bend squared, the mean shifts by the bend; axes add up. A band reaches Student's
quantile of standard deviations to both sides, and by the shift further. It does not hold what the equations cannot
follow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from shipid.data.dataset import Array, Dataset
from shipid.document import short_names
from shipid.engine.engines import REPEATED
from shipid.errors import DataError, ShipidError
from shipid.identification.fit import Solution
from shipid.identification.settings import free_factors
from shipid.identification.statistics import Statistics
from shipid.physics.signals import is_steering
from shipid.simulation.measured import MeasuredManoeuvre, measure_all
from shipid.units import DEGREE, join_names, significant_digits
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

Perform = Callable[[Vessel], Mapping[str, Mapping[str, float]]]
"""Vessel -> title of each manoeuvre that it can perform -> measure -> value."""
Trial = tuple[str, tuple[float, ...], str]
"""Kind of a standard manoeuvre, its angles [deg], and side."""
LONG = 10.0  # a horizon is long from this multiple of the correlation time of the residuals on
ORDINARY = 0.995  # of the rows: what only fewer rows exceed may be noise
MARGIN = 1.1  # a manoeuvre within this factor of the data is no extrapolation
SLOW = 0.1  # of the greatest speed: slower rows have no drift angle
SMALL = 1e-4  # of the standard deviation along the greatest axis of a covariance: shorter axes are left out


def perform_trials(vessel: Vessel, trials: Mapping[str, Trial]) -> tuple[dict[str, MeasuredManoeuvre], dict[str, str]]:
    """Title -> standard manoeuvre in calm water, and title -> reason of those that the vessel cannot perform."""
    done, refused = dict[str, MeasuredManoeuvre](), dict[str, str]()
    try:
        return dict(zip(trials, measure_all(vessel, list(trials.values()), engine=REPEATED), strict=True)), {}
    except ShipidError:  # one of them: the others may be performed
        for title, trial in trials.items():
            try:
                done[title] = measure_all(vessel, [trial], engine=REPEATED)[0]
            except ShipidError as error:
                refused[title] = error.message
    return done, refused


def select_measures(
    done: Mapping[str, MeasuredManoeuvre], shown: Mapping[str, Sequence[str]]
) -> dict[str, dict[str, float]]:
    """Title of each manoeuvre performed -> measure -> value. shown : kind of a manoeuvre -> measures."""
    return {
        title: {
            row["measure"]: float(row["value"]) for row in one.measures if row["measure"] in shown[one.standard.kind]
        }
        for title, one in done.items()
    }


def check_level(level: float | None) -> None:
    """Raise DataError for a level that is not between 0 and 1."""
    if level is not None and not (isinstance(level, int | float | np.number) and 0 < level < 1):
        raise DataError(f"{level} is no level of a band: give a share between 0 and 1, such as 0.9")


def residual_spacing(solution: Solution) -> float:
    """Median time between residuals of one signal within a run [s], over all runs."""
    selected = np.array(solution.signals) == solution.signals[0]
    steps = np.diff(solution.times[selected])[np.diff(solution.clusters[selected]) == 0]
    return float(np.median(steps)) if len(steps) else solution.settings.step


def memory_of_signals(solution: Solution, judged: Statistics) -> dict[str, float]:
    """Signal whose residuals are not white -> their correlation time [s]."""
    between = residual_spacing(solution)
    return {name: one.memory * between for name, one in judged.whiteness.items() if not one.white}


def band_refusal(solution: Solution, judged: Statistics) -> str:
    """Why no band can be promised, in one sentence; empty where one can. See `docs/identification-coverage.md`."""
    horizon, longest = solution.settings.horizon, max(memory_of_signals(solution, judged).values(), default=0.0)
    if 0 < horizon < LONG * longest:
        return (
            f"the horizon of {horizon:g} s is short against residuals that are correlated over "
            f"{significant_digits(longest)} s: estimates may be biased beyond any interval; fit whole runs (horizon 0)"
        )
    best = judged.covariances[judged.chosen]
    if not best.trusted:
        return f"the standard errors are not to be trusted: {best.reason}"
    open_ = [path for path, error in zip(solution.paths, judged.errors, strict=True) if np.isinf(error)]
    if open_:
        return f"the data do not determine {join_names(short_names(open_))}: give priors, or fix some"
    return ""


def measure_bands(
    vessel: Vessel, solution: Solution, judged: Statistics, perform: Perform, level: float = 0.9
) -> pd.DataFrame:
    """Band of every measure of some manoeuvres: `manoeuvre`, `measure`, `value`, `deviation`, `low`, `high`, `note`.

    vessel : the base. level : share of such bands that hold the truth; DataError where it is not between 0 and 1.
    """
    check_level(level)
    best, free = judged.covariances[judged.chosen], solution.free
    quantile = float(stdtrit(np.median(best.freedom), 0.5 + level / 2))
    unknown, sides = free_factors(vessel, solution.settings), list[Mapping[str, Mapping[str, float]]]()
    refused = "diverges within the interval of the numbers"
    for axis in principal_axes(best.matrix).T:
        for sign in (1.0, -1.0):
            factors = solution.factors.copy()
            factors[free] += sign * axis
            try:
                sides.append(perform(vessel.with_values(unknown.values(factors))))
            except ShipidError as error:  # it can perform none, or the vessel refuses the numbers
                sides.append({})
                refused = error.message
    rows = list[dict[str, Any]]()
    for title, centre in perform(vessel.with_values(solution.values)).items():
        if not all(title in side for side in sides):
            rows.append({"manoeuvre": title, "measure": "", "note": refused})
            continue
        for name, value in centre.items():
            ends = np.array([side[title].get(name, np.nan) for side in sides]).reshape(-1, 2)
            slopes, bends = (ends[:, 0] - ends[:, 1]) / 2, ends.mean(axis=1) - value
            deviation, shift = float(np.sqrt((slopes**2 + 2 * bends**2).sum())), float(bends.sum())
            wide, note = quantile * deviation, "" if np.isfinite(deviation) else "not reached on both sides of an axis"
            low, high = value - wide + min(shift, 0.0), value + wide + max(shift, 0.0)
            numbers = {"value": value, "deviation": deviation, "low": low, "high": high}
            rows.append({"manoeuvre": title, "measure": name, **numbers, "note": note})
    return pd.DataFrame(rows, columns=["manoeuvre", "measure", "value", "deviation", "low", "high", "note"])


def principal_axes(covariance: Array) -> Array:
    """Principal axes (n, k) of a covariance (n, n), each as long as its standard deviation; tiny ones are left out."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    kept = values > SMALL**2 * max(float(values.max(initial=0.0)), 1e-300)
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))


@dataclass(frozen=True)
class Reach:
    """Greatest drift angle [deg], yaw rate r L / U [1] and rudder or azimuth angle [deg], and least speed [m/s]."""

    drift: float
    rate: float
    helm: float
    speed: float

    @classmethod
    def of(cls, vessel: Vessel, columns: Mapping[str, Array], share: float = 1.0) -> Reach:
        """Reach of a motion: `u`, `v` [m/s], `r` [rad/s] and commands [rad], each (N,).

        share : of the rows that lie within the reach.
        """
        u, v, r = (np.asarray(columns[name], dtype=float) for name in ("u", "v", "r"))
        speed = np.hypot(u, v)
        moving = speed >= SLOW * np.quantile(speed, share)
        length = vessel.length or 1.0
        helms = [np.abs(columns[name]) for name in vessel_dynamics(vessel).commands if is_steering(name)]
        return cls(
            float(np.quantile(np.abs(np.arctan2(v, np.abs(u)))[moving], share)) / DEGREE,
            float(np.quantile((np.abs(r) * length / np.maximum(speed, 1e-9))[moving], share)),
            max((float(np.quantile(angle, share)) for angle in helms), default=0.0) / DEGREE,
            float(np.quantile(speed, 1 - share)),
        )


def data_reach(vessel: Vessel, dataset: Dataset, runs: Sequence[str]) -> Reach:
    """Reach of the runs of a dataset."""
    names = ["u", "v", "r", *vessel_dynamics(vessel).commands]
    rows = dataset.frame.loc[dataset.frame["run"].isin(runs), names].dropna()
    return Reach.of(vessel, {name: rows[name].to_numpy() for name in names}, ORDINARY)


def extrapolation_sentence(title: str, one: Reach, data: Reach) -> str:
    """Sentence where a manoeuvre goes beyond the data: `turning 35 reaches 20 deg of drift; the data reach 13`."""
    parts = [
        (f"{one.drift:.0f} deg of drift", f"{data.drift:.0f}", one.drift > max(MARGIN * data.drift, data.drift + 1)),
        (f"r L / U of {one.rate:.2f}", f"{data.rate:.2f}", one.rate > max(MARGIN * data.rate, data.rate + 0.02)),
        (f"{one.helm:.0f} deg of helm", f"{data.helm:.0f}", one.helm > max(MARGIN * data.helm, data.helm + 1)),
        (f"a speed of {one.speed:.3g} m/s", f"{data.speed:.3g}", one.speed < data.speed / MARGIN),
    ]
    far = [(there, here) for there, here, yes in parts if yes]
    if not far:
        return ""
    return f"{title} reaches {join_names([a for a, _ in far])}; the data reach {join_names([b for _, b in far])}"


def extrapolation_sentences(
    vessel: Vessel, done: Mapping[str, MeasuredManoeuvre], dataset: Dataset, runs: Sequence[str]
) -> tuple[str, ...]:
    """A sentence on each manoeuvre performed, by title, that goes beyond the runs of a dataset."""
    data = data_reach(vessel, dataset, runs)
    said = (extrapolation_sentence(title, of_log(vessel, one.frame), data) for title, one in done.items())
    return tuple(filter(None, said))


def of_log(vessel: Vessel, frame: pd.DataFrame) -> Reach:
    """Reach of a simulated manoeuvre, with the columns of `perform`."""
    return Reach.of(vessel, {str(name): frame[name].to_numpy() for name in frame if name != "run"})
