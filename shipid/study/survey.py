"""Summary of a dataset, run by run, and its typical runs: the choices of a new study use it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.checks import check_dataset
from shipid.data.dataset import Dataset, cumulative_integral, pieces
from shipid.physics.signals import steers
from shipid.study.kinds import kinds_of, longest

GRAVE = ("range", "overlap")  # checks that fail where a unit is wrong, spikes are left, or a run is there twice
OF_A_KIND = 3  # runs of a kind from which one may be set aside

STREAM_WINDOW = 10.0  # s, over which jitter of the positions is little
STREAM_SHARE, CLEARER = 0.6, 0.5  # least share of the misfit that a stream explains; what it leaves, of a factor's rest
SLOW_STREAM = 0.02  # of the speed: a slower stream is not reported


@dataclass(frozen=True)
class Survey:
    """Measures of the runs of a dataset, from which `study new` makes its choices.

    runs : a row per run, by name: `duration` [s] of its longest unbroken piece, `kind` (see `kinds_of`), `speed`
        [m/s], `rate` [rad/s] (RMS of r), `helm` [rad] (spread of the angles), `whole`, `sound` (passes its checks,
        `path` apart), `straying` (fails `path`).
    step : usual time between rows [s].
    factor : positions over integrated velocities, the best complex factor; its angle is a turn.
    faults : sentences on what no ship does, run by run.
    stream : steady velocity [m/s], north + i east, that positions have more than u, v, psi say; 0 where there is none.
    stream_share : share of the misfit of positions and velocities that it explains.
    """

    runs: pd.DataFrame
    step: float
    factor: complex
    faults: tuple[str, ...] = ()
    stream: complex = 0j
    stream_share: float = 0.0

    @property
    def speed(self) -> float:
        """Median of the runs' mean speeds [m/s]."""
        return float(self.runs["speed"].median())


def survey(dataset: Dataset) -> Survey:
    """Look at every run of a dataset: how long, how fast, what manoeuvre, in which order."""
    stretches: dict[str, list[pd.DataFrame]] = {}
    for run, rows in pieces(dataset):
        stretches.setdefault(run, []).append(rows)
    kinds = kinds_of(dataset)
    checks = check_dataset(dataset)
    failed = checks[~checks["ok"].astype(bool)]
    straying = set(failed.loc[failed["check"] == "path", "run"])
    unsound = set(failed.loc[failed["check"] != "path", "run"])
    runs = {}
    for run, parts in stretches.items():
        whole = longest(parts)
        t = whole["t"].to_numpy()
        angles = whole[[name for name in dataset.commands if steers(name)]]
        runs[run] = {
            "duration": float(t[-1] - t[0]),
            "kind": kinds[run],
            "speed": float(np.hypot(whole["u"], whole["v"]).mean()),
            "rate": float(np.sqrt((whole["r"] ** 2).mean())),
            "helm": float(angles.std(ddof=0).mean()) if angles.shape[1] else 0.0,
            "whole": len(parts) == 1,
            "sound": run not in unsound,
            "straying": run in straying,
        }
    steps = np.concatenate([np.diff(part["t"]) for parts in stretches.values() for part in parts])
    step = round(float(np.median(steps)), 6) if len(steps) else 1.0
    grave = failed[failed["check"].astype(str).str.startswith(GRAVE)]
    faults = tuple(f"run {row['run']!r}: {row['sentence']}" for row in grave.to_dict("records"))
    return Survey(
        pd.DataFrame(list(runs.values()), index=list(runs)), step, _factor(dataset), faults, *_stream(dataset)
    )


def _factor(dataset: Dataset) -> complex:
    """Least-squares factor from what u, v, psi say was run in each second or row, to what positions say."""
    run, seen = [], []
    for _, rows in pieces(dataset):
        t, psi = rows["t"].to_numpy(), rows["psi"].to_numpy()
        velocity = (rows["u"].to_numpy() + 1j * rows["v"].to_numpy()) * np.exp(1j * psi)
        position = rows["north"].to_numpy() + 1j * rows["east"].to_numpy()
        run.append((velocity[1:] + velocity[:-1]) / 2 * np.diff(t))
        seen.append(np.diff(position))
    ran, was = np.concatenate(run), np.concatenate(seen)
    size = float(np.vdot(ran, ran).real)
    return complex(np.vdot(ran, was) / size) if size > 0 else 1.0 + 0.0j


def _stream(dataset: Dataset) -> tuple[complex, float]:
    """The steady velocity [m/s] that u, v, psi lack, and its share of their misfit to the positions.

    0 where a factor explains the misfit as well: a wrong unit, or runs of one heading.
    """
    run: list[NDArray[Any]] = []
    seen: list[NDArray[Any]] = []
    span: list[NDArray[Any]] = []
    for _, rows in pieces(dataset):
        t, psi = rows["t"].to_numpy(), rows["psi"].to_numpy()
        velocity = (rows["u"].to_numpy() + 1j * rows["v"].to_numpy()) * np.exp(1j * psi)
        way = cumulative_integral(t, velocity.real) + 1j * cumulative_integral(t, velocity.imag)
        position = rows["north"].to_numpy() + 1j * rows["east"].to_numpy()
        places = np.unique(np.searchsorted(t, np.arange(t[0], t[-1], STREAM_WINDOW)))
        for into, values in ((run, way), (seen, position), (span, t)):
            into.append(np.diff(np.asarray(values)[places]))
    ran, was, lasted = np.concatenate(run), np.concatenate(seen), np.concatenate(span).real
    misfit = was - ran
    before, size, time = (float(np.sum(np.abs(one) ** 2)) for one in (misfit, ran, lasted))
    if not (before > 0 and size > 0):
        return 0j, 0.0
    stream = complex(np.sum(misfit * lasted) / time)
    factor = complex(np.vdot(ran, misfit) / size)
    left, scaled = (float(np.sum(np.abs(misfit - one) ** 2)) for one in (stream * lasted, factor * ran))
    speed = float(np.sum(np.abs(ran)) / np.sum(lasted))
    clear = left < (1 - STREAM_SHARE) * before and left < CLEARER * scaled and abs(stream) > SLOW_STREAM * speed
    return (stream, 1 - left / before) if clear else (0j, 0.0)


def separation(dataset: Dataset, lag: float) -> float:
    """RMS distance [m] by which positions and integrated velocities part within a lag [s]; 0 where no run is so long.

    Jitter of the positions does not grow with the lag, errors of the velocities do.
    """
    parted = []
    for _, rows in pieces(dataset):
        t, psi = rows["t"].to_numpy(), rows["psi"].to_numpy()
        velocity = (rows["u"].to_numpy() + 1j * rows["v"].to_numpy()) * np.exp(1j * psi)
        run = cumulative_integral(t, velocity.real) + 1j * cumulative_integral(t, velocity.imag)
        apart = rows["north"].to_numpy() + 1j * rows["east"].to_numpy() - run
        early = t <= t[-1] - lag
        parted.append(np.interp(t[early] + lag, t, apart) - apart[early])
    every = np.abs(np.concatenate(parted))
    return float(np.sqrt(np.mean(every**2))) if len(every) else 0.0


def helm_sense(dataset: Dataset) -> dict[str, float]:
    """Correlation of every angle command that moves with the yaw acceleration that follows: > 0 turns to starboard."""
    senses: dict[str, float] = {}
    for name in filter(steers, dataset.commands):
        pairs = [(rows[name].to_numpy()[:-1], np.diff(rows["r"])) for _, rows in pieces(dataset)]
        angle, change = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        size = float(np.linalg.norm(angle) * np.linalg.norm(change))
        if size > 0:
            senses[name] = float(angle @ change) / size
    return senses


def typical_runs(runs: pd.DataFrame) -> list[str]:
    """Typical runs: from each kind that has three runs or more, the one in the middle.

    In the middle: of speed, yaw rate and helm over the runs of the kind; neither broken, suspicious nor the longest.
    """
    groups = [group for kind in runs["kind"].unique() if len(group := runs[runs["kind"] == kind]) >= OF_A_KIND]
    return [_middle(group) for group in groups if len(groups) == 1 or len(runs) > 2 * OF_A_KIND] or [_middle(runs)]


def _middle(runs: pd.DataFrame) -> str:
    allowed = runs
    for mask in (runs["sound"], runs["whole"], runs["duration"] < runs["duration"].max()):
        left = allowed[mask.reindex(allowed.index)]
        allowed = left if len(left) else allowed
    looked_at = ["speed", "rate", "helm"]
    middle = runs[looked_at].median()
    spread = (runs[looked_at] - middle).abs().median().clip(lower=1e-9 + 0.05 * middle.abs())
    return str((((allowed[looked_at] - middle) / spread) ** 2).sum(axis=1).idxmin())
