"""Free runs: simulations of recorded runs from one measured state, with the recorded commands and environment."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Array, Dataset, stretches_of_runs
from shipid.engine.rollout import SPEED_LIMIT, rollout
from shipid.errors import DataError
from shipid.identification.residuals import CURRENT, build_problem
from shipid.identification.segments import LEAST_STEPS, ShootingSegment
from shipid.identification.settings import ENVIRONMENT, Identify, resolve_overrides, run_overrides
from shipid.simulation.log import LEANING, body_velocities, horizontal_velocities, state_column
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

CHANNELS = ("north", "east", "psi", "u", "v", "r")
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
    values = (math.hypot(*current), math.atan2(*current[::-1]))
    known = {f"{run}.{ENVIRONMENT}.{name}": x for run in runs for name, x in zip(CURRENT, values, strict=True)}
    sea = vessel if "current" in vessel.document else vessel.with_values({"current.kind": "uniform"})
    return sea, settings.model_copy(update={"runs": known | run_overrides(settings, runs)})


def simulate_free_runs(
    vessels: Mapping[str, Vessel], dataset: Dataset, runs: Sequence[str], settings: Identify, length: float = 0.0
) -> FreeRuns:
    """Simulate vessels of one structure along recorded runs, in pieces of `length` [s]; 0: whole unbroken stretches.

    The settings give step, method and overrides; nuisances are at their fault-free values. Raises DataError for a
    length shorter than two steps, and what `residuals.build` raises.
    """
    check_length(settings, length)
    spans = [float(rows["t"].iloc[-1] - rows["t"].iloc[0]) for _, rows in stretches_of_runs(dataset.select(runs))]
    steps = sum(spans) / settings.step
    if steps > MOST_STEPS:
        many = f"{settings.step:g} s makes {steps:.2g} steps of these runs, at most {MOST_STEPS:.0e}"
        raise DataError(f"{many}: give a longer step, or fewer runs", path="step")
    overridden = run_overrides(settings, runs)
    first = next(iter(vessels.values()))
    asked = {"horizon": length, "nuisance": [], "current": "none", "runs": overridden}
    problem = build_problem(first, dataset, runs, settings.model_copy(update=_held_settings(first, overridden) | asked))
    given = np.array(list(first.parameters.values()))
    predicted: dict[tuple[int, int], Array] = {}
    for values in np.unique(problem.base, axis=0):  # runs of the same parameters at once
        places = [i for i, one in enumerate(problem.segments) if np.array_equal(problem.base[one.run], values)]
        rows = [np.where(values != given, values, list(vessel.parameters.values())) for vessel in vessels.values()]
        states_of = _predict_pieces(first, [problem.segments[i] for i in places], np.array(rows), settings)
        predicted |= {(model, places[piece]): states for (model, piece), states in states_of.items()}
    parts = []
    for number, run in enumerate(problem.runs):
        places = [i for i, one in enumerate(problem.segments) if one.run == number]
        parts += [
            (run, piece, name, problem.segments[place], predicted[model, place])
            for piece, place in enumerate(places)
            for model, name in enumerate((MEASURED, *vessels))
        ]
    series = _state_series(parts)
    return FreeRuns(series.drop(columns="measured"), _series_errors(series))


def _held_settings(vessel: Vessel, overrides: Mapping[str, object]) -> dict[str, object]:
    """Settings of a fit that is none: what is free plays no part in a free run, so one number that no run overrides."""
    numbers = (path for path, value in vessel.parameters.items() if value != 0)
    path = next(path for path in numbers if not any(key.endswith(f".{path}") for key in overrides))
    none: dict[str, object] = {"prior": {}, "bounds": {}, "scale": {}}
    return none | {"parameters": [path], "fixed": [], "together": [], "ranges": False}


def _predict_pieces(
    vessel: Vessel, segments: Sequence[ShootingSegment], values: Array, settings: Identify
) -> dict[tuple[int, int], Array]:
    """(model, piece) -> states (N + 1, channels); model 0 is the log, model i > 0 has the parameters values[i - 1]."""
    model = vessel_dynamics(vessel)
    longest = max(segment.num_steps for segment in segments)

    def column(segment: ShootingSegment, name: str) -> Array:
        return segment.columns.get(state_column(name), np.zeros(segment.num_steps + 1))

    def held(name: str) -> Array:  # (longest, S): the last one where a piece is shorter
        rows = [np.minimum(np.arange(longest), segment.num_steps - 1) for segment in segments]
        return np.array([column(segment, name)[row] for segment, row in zip(segments, rows, strict=True)]).T

    start = {
        name: np.array([column(segment, name)[0] for segment in segments]) for name in (*model.state, *model.hidden)
    }
    beside = tuple(name for name in LEANING if name in model.state)
    path = rollout(
        vessel,
        start | body_velocities(start),
        {name: held(name) for name in model.commands},
        {name: held(name) for name in model.environment},
        step=settings.step,
        num_steps=longest,
        method=settings.method,
        parameters=values,
        memory={name: np.array([segment.memory[name][0] for segment in segments]) for name in model.memory},
        keep=(*CHANNELS, *beside),
    )
    channels = {name: path[name] for name in (*CHANNELS, *beside)}
    with np.errstate(all="ignore"):  # a path that diverges
        channels |= horizontal_velocities(channels)
    moved = np.stack([channels[name] for name in CHANNELS], axis=-1)  # (N + 1, models, S, channels), as a log has them
    result = {}
    for piece, segment in enumerate(segments):
        result[0, piece] = np.array([column(segment, name) for name in CHANNELS]).T
        for number in range(len(values)):
            states = moved[: segment.num_steps + 1, number, piece]  # what follows belongs to no log
            failed = path.diverged[number, piece] and not _is_sound(states)
            result[number + 1, piece] = np.full_like(states, np.nan) if failed else states
    return result


def _is_sound(states: Array) -> bool:
    """Whether states (N + 1, channels) are finite and those of a ship; see `Trajectories.diverged`."""
    speed = np.hypot(states[:, CHANNELS.index("u")], states[:, CHANNELS.index("v")])
    return bool(np.isfinite(states).all() and (speed <= SPEED_LIMIT).all())


def _state_series(parts: Sequence[tuple[str, int, str, ShootingSegment, Array]]) -> pd.DataFrame:
    runs, pieces, models, segments, states = zip(*parts, strict=True)
    lengths = [len(segment.t) for segment in segments]
    heads = {"run": runs, "piece": pieces, "model": models}
    columns: dict[str, Any] = {name: np.repeat(np.array(head), lengths) for name, head in heads.items()}
    columns |= {"t": np.concatenate([segment.t for segment in segments])}
    columns |= dict(zip(CHANNELS, np.concatenate(states).T, strict=True))
    seen = [segment.measured & (np.arange(len(segment.t)) > 0) for segment in segments]
    frame = pd.DataFrame({**columns, "measured": np.concatenate(seen)})
    return frame[["run", "piece", "t", "model", *CHANNELS, "measured"]]


def _series_errors(series: pd.DataFrame) -> pd.DataFrame:
    log = series[series["model"] == MEASURED]
    rows = []
    for model in [name for name in series["model"].unique() if name != MEASURED]:
        rows_of_model = series[series["model"] == model]
        away = rows_of_model[list(CHANNELS)].to_numpy() - log[list(CHANNELS)].to_numpy()
        squares = {
            "u": away[:, 3] ** 2, "v": away[:, 4] ** 2, "r": away[:, 5] ** 2,
            "position": away[:, 0] ** 2 + away[:, 1] ** 2,
        }  # fmt: skip
        seen = rows_of_model["measured"].to_numpy()
        for run in (ALL, *rows_of_model["run"].unique()):
            selected = seen & (
                np.ones(len(rows_of_model), dtype=bool) if run == ALL else (rows_of_model["run"] == run).to_numpy()
            )
            rms = {name: float(np.sqrt(square[selected].mean())) for name, square in squares.items()}
            rows.append({"run": run, "model": model, **rms, "samples": int(selected.sum())})
    return pd.DataFrame(rows)
