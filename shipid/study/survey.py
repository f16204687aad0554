"""Summary of a dataset, run by run, and its typical runs: the choices of a new study use it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from shipid.data.checks import check_dataset, way
from shipid.data.dataset import Dataset, pieces, pieces_by_run
from shipid.physics.signals import steers
from shipid.study.kinds import kinds_of, longest

GRAVE = ("range", "overlap")  # checks that fail where a unit is wrong, spikes are left, or a run is there twice
LAG = 10.0  # s, over which positions and velocities are compared
WEAK, FLOW, FACTOR = 0.03, 0.5, 0.1  # of the speed; of the misfit that a current may, and that a factor must, leave
OF_A_KIND = 3  # runs of a kind from which one may be set aside


@dataclass(frozen=True)
class Survey:
    """Measures of the runs of a dataset, from which `study new` makes its choices.

    runs : a row per run, by name: `duration` [s] of its longest unbroken piece, `kind` (see `kinds_of`), `speed`
        [m/s], `rate` [rad/s] (RMS of r), `helm` [rad] (spread of the angles), `whole`, `sound` (passes its checks,
        `path` apart), `straying` (fails `path`).
    step : usual time between rows [s].
    factor : positions over integrated velocities, the best complex factor; its angle is a turn.
    faults : sentences on what no ship does, run by run.
    stream : steady current, north + i east [m/s], that u and v lack where they look like speeds through the water,
        and the share of what positions and velocities part by that it explains; None where they do not.
    """

    runs: pd.DataFrame
    step: float
    factor: complex
    faults: tuple[str, ...] = ()
    stream: tuple[complex, float] | None = None

    @property
    def speed(self) -> float:
        """Median of the runs' mean speeds [m/s]."""
        return float(self.runs["speed"].median())


def survey(dataset: Dataset) -> Survey:
    """Look at every run of a dataset: how long, how fast, what manoeuvre, in which order."""
    stretches, kinds = pieces_by_run(dataset), kinds_of(dataset)
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
    return Survey(pd.DataFrame(list(runs.values()), index=list(runs)), step, _factor(dataset), faults, _stream(dataset))


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


def _stream(dataset: Dataset) -> tuple[complex, float] | None:
    """The steady current, north + i east [m/s], that u and v lack, and its share of the misfit to positions.

    Changes over `LAG` are compared. None where the current explains little, where a factor explains about as much, such
    as a wrong unit or heading on one course, or where it is weak.
    """
    run, seen, lags = [], [], []
    for _, rows in pieces(dataset):
        t = rows["t"].to_numpy()
        path, position = way(rows), rows["north"].to_numpy() + 1j * rows["east"].to_numpy()
        last = np.minimum(np.searchsorted(t, t + LAG), len(t) - 1)
        whole = t[last] - t >= 0.5 * LAG
        run.append((path[last] - path)[whole])
        seen.append((position[last] - position)[whole])
        lags.append((t[last] - t)[whole])
    ran, was, lag = np.concatenate(run), np.concatenate(seen), np.concatenate(lags)
    size = float(np.vdot(ran, ran).real)
    apart = float(np.sum(np.abs(was - ran) ** 2))
    if size <= 0 or apart <= 0:
        return None
    current = complex(np.sum(lag * (was - ran)) / np.sum(lag**2))
    left = float(np.sum(np.abs(was - ran - current * lag) ** 2))
    by_factor = float(np.sum(np.abs(was - np.vdot(ran, was) / size * ran) ** 2))
    weak = abs(current) < WEAK * float(np.sum(np.abs(ran)) / np.sum(lag))
    if weak or by_factor < FACTOR * apart or left > FLOW * min(apart, by_factor):
        return None
    return current, 1.0 - left / apart


def separation(dataset: Dataset, lag: float) -> float:
    """RMS distance [m] by which positions and integrated velocities part within a lag [s]; 0 where no run is so long.

    Jitter of the positions does not grow with the lag, errors of the velocities do.
    """
    parted = []
    for _, rows in pieces(dataset):
        t = rows["t"].to_numpy()
        apart = rows["north"].to_numpy() + 1j * rows["east"].to_numpy() - way(rows)
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
