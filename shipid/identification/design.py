"""Experiment design: the manoeuvre with the greatest expected information gain (Bayesian D-optimality).

Each candidate is simulated with the present parameters, cut into predictions of one horizon, and replayed with every
perturbed parameter set: central differences give the sensitivities J of the measured signals, free initial states are
projected out. Added to the present information M it gains

gain = 1/2 log2 det(M + J^T J) / det(M)     bits.

The design is local: unreliable for motions unlike the fitted ones (astern, a stop). Bits per hour favour short runs.

Sources: Lindley, Annals of Mathematical Statistics 27 (1956) 986; Chaloner, Verdinelli, Statistical Science 10 (1995)
273; Goodwin, Payne, Dynamic System Identification (1977), ch. 6.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import Array, Dataset
from shipid.engine.rollout import rollout
from shipid.errors import ShipidError, suggest_name
from shipid.identification.settings import WEIGHTED
from shipid.physics.signals import ACTUAL
from shipid.simulation.approach import FROUDE, Controls, NotStraight
from shipid.simulation.log import body_velocities, horizontal_velocities
from shipid.simulation.manoeuvre import ApproachedManoeuvre, Excitation
from shipid.simulation.perform import perform_manoeuvres
from shipid.simulation.standard import define_standard, shaft_speed
from shipid.units import GRAVITY, RPM, percent_text
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

PERTURBED, START = 0.01, {"u": 0.01, "v": 0.01, "r": 0.001, "psi": 0.001, "north": 0.1, "east": 0.1}
UNKNOWN = 1.0  # standard deviation of a factor of which nothing is known
SWING = 0.3  # of the shaft speed: how far it moves in speed runs
RUN = 20.0  # ship lengths at the speed of the approach that a run of excitation takes
ANGLES: dict[str, tuple[tuple[float, ...], ...]] = {
    "zigzag": ((10.0, 10.0), (20.0, 20.0), (35.0, 20.0)),
    "turning": ((10.0,), (20.0,), (35.0,)),
    "pull-out": ((20.0,),),
    "stop": ((),),
}
"""Standard manoeuvres and angles [deg] that are candidates; spirals are left out, because they take hours."""


@dataclass(frozen=True)
class Limits:
    """Limits of the orders: helm angle [deg], shaft speed [rpm], their rates [deg/s, rpm/s]; None: no limit."""

    angle_deg: float = 35.0
    n_rpm: float = float("inf")
    angle_rate_deg: float | None = None
    shaft_rate_rpm: float | None = None


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


def recorded_limits(vessel: Vessel, dataset: Dataset, runs: Iterable[str]) -> tuple[float, Limits]:
    """Median speed [m/s] of some runs, and as limits the greatest speed of the shafts that drive the ship ahead."""
    rows = dataset.frame[dataset.frame["run"].isin(list(runs))]
    shafts = Controls(vessel).effects[0]
    limits = Limits(n_rpm=max(float(rows[name].abs().max()) for name in shafts) / RPM) if shafts else Limits()
    return float(np.median(np.hypot(rows["u"], rows["v"]))), limits


def candidate_manoeuvres(vessel: Vessel, speeds: Sequence[float] = (), limits: Limits | None = None) -> list[Candidate]:
    """Candidate manoeuvres at each approach speed [m/s] that respect the limits; default: Froude numbers 0.1 and 0.2.

    Zigzags, turning circles, a pull-out, a stop, a multisine of helm and shaft, and a speed run in steps of the shaft.
    """
    length = vessel.length
    if length is None:
        raise ShipidError("particulars.L_pp is missing: manoeuvres are timed in ship lengths", file=vessel.file)
    bounds = limits or Limits()
    asked = [share * FROUDE * float(np.sqrt(GRAVITY * length)) for share in (0.5, 1.0)]
    result = []
    for speed in speeds or asked:
        for kind, angles in ANGLES.items():
            for angle in angles:
                one = define_standard(vessel, kind, angle, speed=speed)
                result.append(Candidate(f"{one.title}, {speed:.2g} m/s", one.manoeuvre))
        result += _excitation_candidates(vessel, speed, length, bounds)
    return [candidate for candidate in result if within_limits(candidate.manoeuvre, bounds)]


def _excitation_candidates(vessel: Vessel, speed: float, length: float, limits: Limits) -> Iterator[Candidate]:
    n_rpm, passing = shaft_speed(Controls(vessel), speed) / RPM, length / speed
    swing = min(SWING * n_rpm, limits.n_rpm - n_rpm)
    if swing <= 0:
        return
    rates = {"angle_rate_deg": limits.angle_rate_deg, "shaft_rate_rpm": limits.shaft_rate_rpm}
    how: dict[str, Any] = {"n_rpm": n_rpm, "amplitude_rpm": swing, "duration": RUN * passing, **rates}
    steps = Excitation(signal="aprbs", hold=(2 * passing, 5 * passing), **how)
    yield Candidate(f"speed run, {n_rpm:.3g} +- {swing:.2g} rpm, {speed:.2g} m/s", steps)
    angle = min(20.0, limits.angle_deg)
    waves = Excitation(signal="multisine", angle_deg=angle, period=RUN * passing, harmonics=(1, 12), **how)
    yield Candidate(f"multisine, {angle:g} deg and {swing:.2g} rpm, {speed:.2g} m/s", waves)


def within_limits(manoeuvre: ApproachedManoeuvre, limits: Limits) -> bool:
    """Whether all orders of a manoeuvre are within the limits of helm and shaft; rates limit excitations only."""
    helm, shaft = manoeuvre.greatest_orders
    return shaft <= limits.n_rpm * (1 + 1e-9) and helm <= limits.angle_deg * (1 + 1e-9)


def information_of_candidates(
    vessel: Vessel,
    choice: Sequence[Candidate],
    groups: Sequence[Sequence[str]],
    *,
    scale: Sequence[Sequence[float]] | None = None,
    weights: Mapping[str, float],
    horizon: float = 30.0,
    interval: float = 1.0,
    step: float | None = None,
) -> list[InformedCandidate]:
    """Simulate candidates and compute the Fisher information of the factors that each adds.

    groups : parameter paths that share each of the n factors. scale : their values at factor 1; default: the vessel's.
    weights : measured signal (u, v, r, psi, position) -> standard deviation [m/s, rad/s, rad, m].
    horizon : of a prediction [s], 0 for whole runs. interval : between measured rows [s].
    step : of the integration (RK4) [s]; default: a part of the interval of about 0.2 s by Froude's scale.

    Raises ShipidError for an unknown signal, no candidate, or one that cannot be simulated.
    """
    unknown = next((name for name in weights if name not in WEIGHTED), None)
    if unknown is not None:
        raise ShipidError(f"no signal {unknown!r}: {suggest_name(unknown, WEIGHTED)}", path="weights")
    if not choice:
        raise ShipidError("no manoeuvre is within the limits of the actuators")
    every = steps_between(vessel, interval) if step is None else max(round(interval / step), 1)
    fine = interval / every
    log = perform_candidates(vessel, choice, step=fine)
    cut = _cut_predictions(vessel, log, round(horizon / interval) * every, every)
    signals = {name: width for signal, width in weights.items() for name in WEIGHTED[signal]}
    by_factor, by_start = _finite_difference_sensitivities(vessel, cut, groups, scale, signals, fine, every)
    each = _project_out_start(by_factor, by_start)
    return [InformedCandidate(one, each[cut.runs == number].sum(axis=0)) for number, one in enumerate(choice)]


def information_where_possible(
    vessel: Vessel, choice: Sequence[Candidate], *args: Any, **how: Any
) -> list[InformedCandidate]:
    """As `information_of_candidates`, without the candidates that cannot be simulated; ShipidError where none can."""
    try:
        return information_of_candidates(vessel, choice, *args, **how)
    except ShipidError as error:
        if len(choice) < 2:
            raise
        reason = error
    result = []
    for one in choice:
        try:
            result += information_of_candidates(vessel, [one], *args, **how)
        except ShipidError as error:  # the ship may perform the others
            reason = error
    if not result:
        raise reason
    return result


def perform_candidates(
    vessel: Vessel,
    choice: Sequence[Candidate],
    *,
    step: float,
    interval: float | None = None,
) -> pd.DataFrame:
    """Log of all candidates, `run` 0000, 0001, ...; by a helmsman's approach where the ship does not go straight."""
    named = [one.manoeuvre.model_copy(update={"name": f"{number:04d}"}) for number, one in enumerate(choice)]
    try:
        return perform_manoeuvres(vessel, named, step=step, interval=interval)
    except NotStraight:
        held = [one.model_copy(update={"approach": "helmsman"}) for one in named]
        return perform_manoeuvres(vessel, held, step=step, interval=interval)


def steps_between(vessel: Vessel, interval: float) -> int:
    """Integrator steps in one interval [s] between rows: 40 or more per ship length at Froude number 0.2."""
    length = vessel.length or 30.0
    passing = length / (FROUDE * float(np.sqrt(GRAVITY * length)))
    return max(int(np.ceil(40 * interval / passing)), 1)


@dataclass(frozen=True)
class _Cut:
    """S predictions: name -> (S,) initial states and actuator states, name -> (T, S) commands and environment.

    runs : (S,) index of the candidate. seen : (R, S) whether a record lies within its run.
    """

    start: dict[str, Array]
    memory: dict[str, Array]
    commands: dict[str, Array]
    environment: dict[str, Array]
    runs: NDArray[np.int64]
    seen: NDArray[np.bool_]


def _cut_predictions(vessel: Vessel, log: pd.DataFrame, steps: int, every: int) -> _Cut:
    """Cut logs into predictions of `steps` steps (0: whole runs); the last, shorter one of each run is kept."""
    model, names = vessel_dynamics(vessel), log["run"].to_numpy()
    bounds = [(np.flatnonzero(names == run)[0], int((names == run).sum())) for run in dict.fromkeys(names)]
    whole = max(count - 1 for _, count in bounds)
    most = steps or -(-whole // every) * every
    firsts, lasts, runs = [], [], []
    for run, (first, count) in enumerate(bounds):
        for begin in range(0, max(count - 1 - every, 1), most):
            firsts.append(first + begin)
            lasts.append(first + min(begin + most, count - 1))
            runs.append(run)
    rows = np.minimum(np.array(firsts) + np.arange(most)[:, None], np.array(lasts))  # (T, S)
    records = np.array(firsts) + np.arange(0, most + 1, every)[:, None]
    columns = {str(name): log[name].to_numpy() for name in log.columns if name != "run"}
    columns |= {**body_velocities(columns), "down": columns.get("z", np.zeros(len(log)))}
    still = np.zeros(len(log))
    return _Cut(
        {name: columns.get(name, still)[rows[0]] for name in (*model.state, *model.hidden)},
        {name: columns[f"{ACTUAL}{name}"][rows[0]] for name in model.memory},
        {name: columns[name][rows] for name in model.commands},
        {name: columns.get(name, still)[rows] for name in model.environment},
        np.array(runs),
        records <= np.array(lasts),
    )


def _finite_difference_sensitivities(
    vessel: Vessel,
    cut: _Cut,
    groups: Sequence[Sequence[str]],
    scale: Sequence[Sequence[float]] | None,
    signals: Mapping[str, float],
    step: float,
    every: int,
) -> tuple[Array, Array]:
    """Central differences of the signals over their standard deviations.

    To the factors (S, R * signals, n) and to the initial states (S, R * signals, q).
    """
    names, base = list(vessel.parameters), np.array(list(vessel.parameters.values()))
    moves = np.zeros((len(groups), len(base)))
    for j, group in enumerate(groups):
        for path, size in zip(group, [vessel.parameters[p] for p in group] if scale is None else scale[j], strict=True):
            moves[j, names.index(path)] = PERTURBED * size
    copies = np.concatenate([base + moves, base - moves])
    how: dict[str, Any] = {
        "step": step,
        "num_steps": len(next(iter(cut.commands.values()))),
        "every": every,
        "method": "rk4",
    }

    def records(start: dict[str, Array], times: int, parameters: Array) -> Array:  # (R, V, S, signals), whitened
        def tiled(given: dict[str, Array]) -> dict[str, Array]:
            return {name: np.concatenate([values] * times, axis=-1) for name, values in given.items()}

        path = rollout(
            vessel, start, tiled(cut.commands), tiled(cut.environment), parameters=parameters,
            memory=tiled(cut.memory) if cut.memory else None, **how,
        )  # fmt: skip
        if path.diverged.any():
            raise ShipidError(
                f"{vessel.name} diverges with a factor changed by {percent_text(PERTURBED)}: take a shorter step"
            )
        states = {name: path[name] for name in vessel_dynamics(vessel).state}
        seen = states | horizontal_velocities(states)
        return np.stack([seen[name] / width for name, width in signals.items()], axis=-1)

    def rows(values: Array) -> Array:  # (R, k, S, signals) -> (S, R * signals, k)
        inside = np.where(cut.seen[:, None, :, None], values, 0.0)
        return inside.transpose(2, 0, 3, 1).reshape(len(cut.runs), -1, values.shape[1])

    family = records(cut.start, 1, copies)
    by_factor = rows((family[:, : len(groups)] - family[:, len(groups) :]) / (2 * PERTURBED))
    free = [name for name in START if name in ("u", "v", "r") or name in signals]
    starts = [{**cut.start, name: cut.start[name] + sign * START[name]} for sign in (1, -1) for name in free]
    begun = {name: np.concatenate([start[name] for start in starts]) for name in cut.start}
    moved = records(begun, len(starts), base[None])[:, 0]
    apart = moved.reshape(len(moved), 2, len(free), len(cut.runs), len(signals))
    sizes = np.array([START[name] for name in free])[:, None, None]
    return by_factor, rows((apart[:, 0] - apart[:, 1]) / (2 * sizes))


def _project_out_start(by_factor: Array, by_start: Array) -> Array:
    """Fisher information (S, n, n) of the factors from each prediction, its initial state projected out."""
    crossed = by_start.swapaxes(1, 2) @ by_factor
    known = by_start.swapaxes(1, 2) @ by_start
    return np.asarray(by_factor.swapaxes(1, 2) @ by_factor - crossed.swapaxes(1, 2) @ np.linalg.pinv(known) @ crossed)


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
