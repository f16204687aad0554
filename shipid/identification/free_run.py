"""Free runs: simulations of recorded runs from one measured state, with the recorded commands and environment."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from shipid.data.dataset import Array, Dataset, stretches_of_runs
from shipid.engine.rollout import SPEED_LIMIT, rollout
from shipid.errors import DataError
from shipid.identification.residuals import CURRENT
from shipid.identification.segments import LEAST_STEPS, ShootingSegment, cut_segments
from shipid.identification.settings import ENVIRONMENT, Identify, resolve_overrides, run_overrides
from shipid.observer import MEASURED_MOTION
from shipid.simulation.log import LEANING, body_velocities, horizontal_velocities, state_column
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

ERRORS_OF = ("u", "v", "r", "position")  # what free runs are judged by
MOST_STEPS = 1e7  # of all runs together
MEASURED, ALL = "measured", "all"
"""The log among the models of a series, and all runs together among the runs of a table of errors."""


@dataclass(frozen=True, eq=False)
class FreeRuns:
    """Time series and errors of the free runs of several vessels.

    series : `run`, `piece`, `t` [s], `model` (the log is `measured`), `north`, `east` [m], `psi` [rad],
        `u`, `v` [m/s], `r` [rad/s]; NaN where a prediction diverges.
    errors : `run` (first `all`), `model`, root mean square errors `u`, `v` [m/s], `r` [rad/s], `position` [m], and
        `samples`, the number of measured rows, without the initial row of each piece.
    """

    series: pd.DataFrame
    errors: pd.DataFrame


def missing_inputs(vessel: Vessel, dataset: Dataset, settings: Identify, runs: Sequence[str]) -> list[str]:
    """Columns of states and weather of the vessel that neither dataset, settings nor nuisances give: they are 0."""
    model = vessel_dynamics(vessel)
    given = {*map(str, dataset.frame), *(CURRENT if "current" in settings.widths else ())}
    needed = [state_column(name) for name in (*model.state, *model.environment)]
    overridden = resolve_overrides(settings, runs, vessel, model.environment, dataset.runs)
    return [
        name
        for name in needed
        if name not in given and not all(f"{ENVIRONMENT}.{name}" in overridden[run] for run in runs)
    ]


def check_length(settings: Identify, length: float) -> None:
    """Raise DataError for a length [s] of free runs that is shorter than two steps, or endless; 0 is valid."""
    if length and not LEAST_STEPS * settings.step <= length < np.inf:
        raise DataError(f"a free run of {length:g} s must hold two steps of {settings.step:g} s, or be 0", path="ahead")


def with_current(
    vessel: Vessel, settings: Identify, runs: Sequence[str], current: tuple[float, float]
) -> tuple[Vessel, Identify]:
    """Vessel and settings for free runs in one current, to north and to east [m/s]; what is set for a run stays."""
    if not any(current):
        return vessel, settings
    values = (math.hypot(*current), math.atan2(*current[::-1]))
    known = {f"{run}.{ENVIRONMENT}.{name}": x for run in runs for name, x in zip(CURRENT, values, strict=True)}
    sea = vessel if "current" in vessel.document else vessel.with_values({"current.kind": "uniform"})
    return sea, settings.model_copy(update={"runs": known | run_overrides(settings, runs)})


def simulate_free_runs(
    vessels: Mapping[str, Vessel],
    dataset: Dataset,
    runs: Sequence[str],
    settings: Identify,
    length: float = 0.0,
    currents: Mapping[str, tuple[float, float]] | None = None,
) -> FreeRuns:
    """Simulate vessels along recorded runs, in pieces of `length` [s]; 0: whole unbroken stretches.

    The settings give step, method and overrides; nuisances are at their fault-free values. currents : of a vessel by
    its name, to north and to east [m/s]. Raises DataError for a length shorter than two steps, and what `cut_segments`
    raises.
    """
    check_length(settings, length)
    spans = [float(rows["t"].iloc[-1] - rows["t"].iloc[0]) for _, rows in stretches_of_runs(dataset.select(runs))]
    steps = sum(spans) / settings.step
    if steps > MOST_STEPS:
        many = f"{settings.step:g} s makes {steps:.2g} steps of these runs, at most {MOST_STEPS:.0e}"
        raise DataError(f"{many}: give a longer step, or fewer runs", path="step")
    frames = list[pd.DataFrame]()
    for name, vessel in vessels.items():
        sea, known = with_current(vessel, settings, runs, (currents or {}).get(name, (0.0, 0.0)))
        overrides = resolve_overrides(known, runs, sea, vessel_dynamics(sea).environment, dataset.runs)
        pieces = cut_segments(
            sea, dataset, runs, settings.step, length, overrides=overrides, commands=settings.commands
        )
        if not frames:
            log = [np.array([_log_column(piece, channel) for channel in MEASURED_MOTION]).T for piece in pieces]
            frames = [_state_series(runs, pieces, MEASURED, log)]
        frames.append(_state_series(runs, pieces, name, _predict_pieces(sea, runs, pieces, overrides, settings)))
    series = pd.concat(frames, ignore_index=True)
    return FreeRuns(series.drop(columns="measured"), _series_errors(series))


def _predict_pieces(
    vessel: Vessel,
    runs: Sequence[str],
    pieces: Sequence[ShootingSegment],
    overrides: Mapping[str, Mapping[str, float]],
    settings: Identify,
) -> list[Array]:
    """States (N + 1, channels) of each piece; those of runs with the same parameters are simulated at once."""
    result = dict[int, Array]()
    numbers = [vessel.parameters | {k: x for k, x in overrides[run].items() if k in vessel.parameters} for run in runs]
    for values in np.unique([list(of_run.values()) for of_run in numbers], axis=0):
        places = [i for i, one in enumerate(pieces) if np.array_equal(list(numbers[one.run].values()), values)]
        alike = [pieces[i] for i in places]
        result |= dict(zip(places, _predict_alike(vessel, alike, values, settings), strict=True))
    return [result[i] for i in range(len(pieces))]


def _predict_alike(
    vessel: Vessel, pieces: Sequence[ShootingSegment], values: Array, settings: Identify
) -> Iterator[Array]:
    """States (N + 1, channels) of pieces that have the same parameters, NaN where one diverges."""
    model = vessel_dynamics(vessel)
    longest = max(piece.num_steps for piece in pieces)

    def held(name: str) -> Array:  # (longest, S): the last one where a piece is shorter
        rows = [np.minimum(np.arange(longest), piece.num_steps - 1) for piece in pieces]
        return np.array([_log_column(piece, name)[row] for piece, row in zip(pieces, rows, strict=True)]).T

    start = {name: np.array([_log_column(one, name)[0] for one in pieces]) for name in (*model.state, *model.hidden)}
    kept = (*MEASURED_MOTION, *(name for name in LEANING if name in model.state))
    path = rollout(
        vessel,
        start | body_velocities(start),
        {name: held(name) for name in model.commands},
        {name: held(name) for name in model.environment},
        step=settings.step,
        num_steps=longest,
        method=settings.method,
        parameters=values[None],
        memory={name: np.array([piece.memory[name][0] for piece in pieces]) for name in model.memory},
        keep=kept,
    )
    channels = {name: path[name] for name in kept}
    with np.errstate(all="ignore"):  # a path that diverges
        channels |= horizontal_velocities(channels)
    moved = np.stack(
        [channels[name][:, 0] for name in MEASURED_MOTION], axis=-1
    )  # (N + 1, S, channels), as a log has them
    for number, piece in enumerate(pieces):
        states = moved[: piece.num_steps + 1, number]  # what follows belongs to no log
        sound = np.isfinite(states).all() and (np.hypot(*states[:, 3:5].T) <= SPEED_LIMIT).all()
        yield states if sound or not path.diverged[0, number] else np.full_like(states, np.nan)


def _log_column(piece: ShootingSegment, name: str) -> Array:
    """Measured values (N + 1,) of a state or an input; 0 where there are none."""
    return piece.columns.get(state_column(name), np.zeros(piece.num_steps + 1))


def _state_series(
    runs: Sequence[str], pieces: Sequence[ShootingSegment], model: str, states: Sequence[Array]
) -> pd.DataFrame:
    """The series of one model; `measured`: rows that count for the errors."""
    numbers = np.array([piece.run for piece in pieces])
    place = np.arange(len(pieces)) - np.searchsorted(numbers, numbers)
    frames = [
        pd.DataFrame(values, columns=list(MEASURED_MOTION)).assign(
            run=runs[piece.run], piece=number, t=piece.t, model=model,
            measured=piece.measured & (np.arange(len(piece.t)) > 0),
        )
        for number, piece, values in zip(place, pieces, states, strict=True)
    ]  # fmt: skip
    return pd.concat(frames, ignore_index=True)[["run", "piece", "t", "model", *MEASURED_MOTION, "measured"]]


def _series_errors(series: pd.DataFrame) -> pd.DataFrame:
    """Root mean squares over the measured rows of all runs, and of each."""
    log, rows = series.loc[series["model"] == MEASURED, list(MEASURED_MOTION)].to_numpy(), list[dict[str, object]]()
    for model, mine in series[series["model"] != MEASURED].groupby("model", sort=False):
        squares = pd.DataFrame((mine[list(MEASURED_MOTION)].to_numpy() - log) ** 2, columns=list(MEASURED_MOTION))
        squares["position"] = squares["north"] + squares["east"]
        for run in (ALL, *mine["run"].unique()):
            selected = mine["measured"].to_numpy() & (np.full(len(mine), run == ALL) | (mine["run"] == run).to_numpy())
            rms = np.sqrt(squares.loc[selected, list(ERRORS_OF)].to_numpy().mean(axis=0))
            rows.append({"run": run, "model": model, **dict(zip(ERRORS_OF, rms.tolist(), strict=True))})
            rows[-1]["samples"] = int(selected.sum())
    return pd.DataFrame(rows)
