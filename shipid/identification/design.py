"""Experiment design: the manoeuvre with the greatest expected information gain (Bayesian D-optimality).

Each candidate is simulated with the present parameters and cut into the predictions of a fit, each of whose initial
states is known by its row alone. Added to the present information M their marginal Jacobian J gains

gain = 1/2 log2 det(M + J^T J) / det(M)     bits.

The design is local: unreliable for motions unlike the fitted ones (astern, a stop). Bits per hour favour short runs.

Sources: Lindley, Annals of Mathematical Statistics 27 (1956) 986; Chaloner, Verdinelli, Statistical Science 10 (1995)
273; Goodwin, Payne, Dynamic System Identification (1977), ch. 6.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Array, Dataset
from shipid.errors import ShipidError
from shipid.identification.residuals import build_problem, predict_residuals
from shipid.identification.settings import Identify, free_factors
from shipid.physics.signals import ACTUAL, drive_scale
from shipid.simulation.approach import FROUDE, Controls, NotStraight
from shipid.simulation.manoeuvre import ApproachedManoeuvre, Excitation
from shipid.simulation.perform import perform_manoeuvres
from shipid.simulation.standard import define_standard, shaft_speed
from shipid.units import GRAVITY, RPM
from shipid.vessel.load import Vessel

MEASURED_ONCE = 1.0  # standard deviations of the signals: an initial state is known by its row alone
UNKNOWN = 1.0  # standard deviation of a factor of which nothing is known
SWING = 0.3  # of the shaft speed: how far it moves in speed runs
FARTHEST_HELM = 35.0  # deg, of any candidate
RUN = 20.0  # ship lengths at the speed of the approach that a run of excitation takes
ANGLES: dict[str, tuple[tuple[float, ...], ...]] = {
    "zigzag": ((10.0, 10.0), (20.0, 20.0), (35.0, 20.0)),
    "turning": ((10.0,), (20.0,), (35.0,)),
    "pull-out": ((20.0,),),
    "stop": ((),),
}
"""Standard manoeuvres and angles [deg] that are candidates; spirals are left out, because they take hours."""


@dataclass(frozen=True)
class Candidate:
    """A manoeuvre that could be run."""

    title: str
    manoeuvre: ApproachedManoeuvre

    @property
    def hours(self) -> float:
        """Duration [h], without the approach."""
        return self.manoeuvre.length / 3600


@dataclass(frozen=True)
class InformedCandidate:
    """A candidate with its Fisher information (n, n) of the factors, for the declared standard deviations."""

    candidate: Candidate
    information: Array


def recorded_limits(vessel: Vessel, dataset: Dataset, runs: Iterable[str]) -> tuple[float, float]:
    """Median speed [m/s] of some runs, and the greatest speed [rpm] or force [N] of what drives the ship ahead."""
    rows = dataset.frame[dataset.frame["run"].isin(list(runs))]
    greatest = [float(rows[name].abs().max()) / drive_scale(name) / RPM for name in Controls(vessel).effects[0]]
    return float(np.median(np.hypot(rows["u"], rows["v"]))), max(greatest, default=np.inf)


def candidate_manoeuvres(vessel: Vessel, speeds: Sequence[float], most: float = np.inf) -> list[Candidate]:
    """Candidate manoeuvres at each approach speed [m/s] with at most 35 deg of helm and `most` rpm (or N) of the drive.

    Zigzags, turning circles, a pull-out, a stop, and a speed run in steps of the shaft.
    """
    length, result = vessel.length, []
    if length is None:
        raise ShipidError("particulars.L_pp is missing: manoeuvres are timed in ship lengths", file=vessel.file)
    for speed in speeds:
        for kind, angles in ANGLES.items():
            standard = [define_standard(vessel, kind, angle, speed=speed) for angle in angles]
            result += [Candidate(f"{one.title}, {speed:.2g} m/s", one.manoeuvre) for one in standard]
        result += _excitation_candidates(vessel, speed, length, most)
    return [candidate for candidate in result if within_limits(candidate.manoeuvre, most)]


def _excitation_candidates(vessel: Vessel, speed: float, length: float, most: float) -> Iterator[Candidate]:
    controls, passing = Controls(vessel), length / speed
    n_rpm, unit = shaft_speed(controls, speed) / RPM, controls.drive_unit
    swing = min(SWING * n_rpm, most - n_rpm)
    if swing <= 0:
        return
    how: dict[str, Any] = {"n_rpm": n_rpm, "amplitude_rpm": swing, "duration": RUN * passing}
    steps = Excitation(hold=(2 * passing, 5 * passing), **how)
    yield Candidate(f"speed run, {n_rpm:.3g} +- {swing:.2g} {unit}, {speed:.2g} m/s", steps)


def within_limits(manoeuvre: ApproachedManoeuvre, most: float) -> bool:
    """Whether all orders of a manoeuvre are at most 35 deg of helm and `most` rpm of the shaft."""
    helm, shaft = manoeuvre.greatest_orders
    return shaft <= most * (1 + 1e-9) and helm <= FARTHEST_HELM * (1 + 1e-9)


def information_of_candidates(
    vessel: Vessel, choice: Sequence[Candidate], settings: Identify, factors: Array | None = None
) -> list[InformedCandidate]:
    """Simulate candidates and compute the Fisher information of the free factors that each adds.

    vessel : the base. settings : of the fit: rows are its step apart. factors : (n,) of the ship that performs them;
    default: those of the base.

    Raises ShipidError for no candidate, or one that cannot be simulated.
    """
    if not choice:
        raise ShipidError("no manoeuvre is within the limits of the actuators")
    horizon = settings.horizon if settings.horizon <= min(one.manoeuvre.length for one in choice) else 0.0
    alone = {"nuisance": {"initial_state": MEASURED_ONCE}, "current": "none", "runs": {}, "commands": "held"}
    settings = settings.model_copy(update={**alone, "loss": "squared", "horizon": horizon})
    unknown = free_factors(vessel, settings)
    factors = unknown.centre if factors is None else factors
    ship = vessel.with_values(unknown.values(factors))
    log = perform_candidates(ship, choice, settings.step)
    rows = log[[name for name in log if not str(name).startswith(ACTUAL)]]
    dataset = Dataset(rows, {"clock": "run", "flags": []})
    problem = build_problem(vessel, dataset, dataset.runs, settings)
    at = predict_residuals(problem, factors, np.zeros((len(choice), 0)))
    if not np.isfinite(at.by_factor).all():
        raise ShipidError(f"{ship.name} diverges in steps of {settings.step:g} s: take a shorter step")
    slopes = [at.marginal()[1][at.rows(number)] for number in range(len(choice))]
    return [InformedCandidate(one, J.T @ J) for one, J in zip(choice, slopes, strict=True)]


def information_where_possible(
    vessel: Vessel, choice: Sequence[Candidate], *args: Any, **how: Any
) -> list[InformedCandidate]:
    """As `information_of_candidates`, without the candidates that cannot be simulated; ShipidError where none can."""
    try:
        return information_of_candidates(vessel, choice, *args, **how)
    except ShipidError:
        result = list[InformedCandidate]()
        for one in choice if len(choice) > 1 else ():
            with suppress(ShipidError):  # the ship may perform the others
                result += information_of_candidates(vessel, [one], *args, **how)
        if not result:
            raise
        return result


def perform_candidates(vessel: Vessel, choice: Sequence[Candidate], interval: float) -> pd.DataFrame:
    """Log of all candidates, `run` 0000, 0001, ..., rows `interval` [s] apart, in 40 or more steps per ship length.

    A helmsman approaches where the ship does not go straight.
    """
    length = vessel.length or 30.0
    passing = length / (FROUDE * float(np.sqrt(GRAVITY * length)))  # s, at Froude number 0.2
    step = interval / max(int(np.ceil(40 * interval / passing)), 1)
    named = [one.manoeuvre.model_copy(update={"name": f"{number:04d}"}) for number, one in enumerate(choice)]
    try:
        return perform_manoeuvres(vessel, named, step=step, interval=interval)
    except NotStraight:
        held = [one.model_copy(update={"approach": "helmsman"}) for one in named]
        return perform_manoeuvres(vessel, held, step=step, interval=interval)


def rank_candidates(
    contributions: Sequence[InformedCandidate], paths: Sequence[str], present: Array | None = None
) -> pd.DataFrame:
    """Candidates by bits per hour: `manoeuvre`, `hours`, `gain` [bits], `per_hour`, `narrows`, `before`, `after`.

    `narrows` is the factor whose standard error falls by the largest ratio, from `before` to `after`.
    present : (n, n) information before, to which a standard deviation of 1 of each factor is added.
    """
    known = np.eye(len(paths)) / UNKNOWN**2 + (0.0 if present is None else present)
    before, rows = _standard_errors(known), []
    for one in contributions:
        total = known + one.information
        gain, after = _information_bits(total) - _information_bits(known), _standard_errors(total)
        most = int(np.argmax(before / after))
        rate = gain / one.candidate.hours
        rows.append((one.candidate.title, one.candidate.hours, gain, rate, paths[most], before[most], after[most]))
    table = pd.DataFrame(rows, columns=["manoeuvre", "hours", "gain", "per_hour", "narrows", "before", "after"])
    return table.sort_values("per_hour", ascending=False, ignore_index=True)


def _information_bits(information: Array) -> float:
    """1/2 log2 det [bits]."""
    return float(np.linalg.slogdet(information)[1] / (2 * np.log(2)))


def _standard_errors(information: Array) -> Array:
    return np.sqrt(np.diag(np.linalg.inv(information)))
