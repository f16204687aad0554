"""First looks, before any study: a dataset run by run with its typical runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from shipid.data.checks import check_dataset, way_not_travelled
from shipid.data.dataset import Dataset, stretches_by_run, stretches_of_runs
from shipid.physics.signals import is_steering
from shipid.study.prepare import kinds_of_runs, longest_piece

LEAST_OF_A_KIND = 3  # runs of a kind from which one may be set aside: two are left that train


@dataclass(frozen=True)
class Survey:
    """Measures of the runs of a dataset, from which `study new` makes its choices.

    runs : a row per run, by name: `duration` [s] of its longest unbroken piece, `kind` (see `kinds_of_runs`), `speed`
        [m/s], `rate` [rad/s] (RMS of r), `helm` [rad] (spread of the angles), `whole` (unbroken).
    step : usual time between rows [s].
    failed : rows of `check_dataset` that are not ok.
    """

    runs: pd.DataFrame
    step: float
    failed: pd.DataFrame

    @property
    def speed(self) -> float:
        """Median of the runs' mean speeds [m/s]."""
        return float(self.runs["speed"].median())


def survey_dataset(dataset: Dataset) -> Survey:
    """Look at every run of a dataset: how long, how fast, what manoeuvre, in which order."""
    by_run, kinds, checks = stretches_by_run(dataset), kinds_of_runs(dataset), check_dataset(dataset)
    angles = [name for name in dataset.commands if is_steering(name)]
    runs = {}
    for run, parts in by_run.items():
        rows = longest_piece(parts)
        runs[run] = {
            "duration": float(np.ptp(rows["t"])),
            "kind": kinds[run],
            "speed": float(np.hypot(rows["u"], rows["v"]).mean()),
            "rate": float(np.sqrt((rows["r"] ** 2).mean())),
            "helm": float(rows[angles].std(ddof=0).mean()) if angles else 0.0,
            "whole": len(parts) == 1,
        }
    steps = np.concatenate([np.diff(part["t"]) for parts in by_run.values() for part in parts])
    step = round(float(np.median(steps)), 6) if len(steps) else 1.0
    return Survey(pd.DataFrame(list(runs.values()), index=list(runs)), step, checks[~checks["ok"].astype(bool)])


def separation_of_sources(dataset: Dataset, lag: float) -> float:
    """RMS distance [m] by which positions and integrated velocities part within a lag [s]; 0 where no run is so long.

    Jitter of the positions does not grow with the lag, errors of the velocities do.
    """
    parted = []
    for _, rows in stretches_of_runs(dataset):
        t = rows["t"].to_numpy()
        apart = way_not_travelled(rows)
        early = t <= t[-1] - lag
        parted.append(np.interp(t[early] + lag, t, apart) - apart[early])
    every = np.abs(np.concatenate(parted))
    return float(np.sqrt(np.mean(every**2))) if len(every) else 0.0


def typical_runs(seen: Survey) -> list[str]:
    """From each kind that has three runs or more, the one in the middle; one of all where that leaves too few."""
    runs = seen.runs
    groups = [group for _, group in runs.groupby("kind", sort=False) if len(group) >= LEAST_OF_A_KIND]
    many = len(runs) > 2 * LEAST_OF_A_KIND or len(groups) == 1
    return [_middle_run(group, set(seen.failed["run"])) for group in (groups if many else []) or [runs]]


def _middle_run(runs: pd.DataFrame, failed: set[str]) -> str:
    """The run whose rank of speed, yaw rate and helm is nearest to the middle.

    Neither one that is broken, nor one that fails a check, nor the longest, where there are others.
    """
    allowed = runs
    for good in (~runs.index.isin(failed), runs["whole"], runs["duration"] < runs["duration"].max()):
        left = allowed.index.intersection(runs.index[good])
        allowed = allowed.loc[left] if len(left) else allowed
    ranks = runs[["speed", "rate", "helm"]].rank(pct=True)
    return str(((ranks - ranks.median()) ** 2).sum(axis=1)[allowed.index].idxmin())
