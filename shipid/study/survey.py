"""First looks, before any study: a dataset run by run with its typical runs, and a vessel against its log."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.checks import check_dataset, travelled_path
from shipid.data.dataset import Dataset, stretches_by_run, stretches_of_runs
from shipid.data.windows import PathSource, cut_windows
from shipid.hybrid.physics import Physics, check_columns
from shipid.metrics import position_error
from shipid.physics.signals import is_steering
from shipid.study.prepare import constant_motion, kinds_of_runs, longest_piece, window_memory
from shipid.vessel.load import Vessel

LEAST_OF_A_KIND = 3  # runs of a kind from which one may be set aside: two are left that train
LEAST_TURN_OF_WINDOW = np.radians(5.0)  # the share of a smaller turn is mostly noise of the heading
LEAST_ERROR = 1e-3  # m: no log has positions so near to the truth


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
        apart = rows["north"].to_numpy() + 1j * rows["east"].to_numpy() - travelled_path(rows)
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


@dataclass(frozen=True)
class Look:
    """How a vessel and a log agree.

    ahead : [s]. vessel_error, constant_error : mean position error [m] over it, infinite where a path diverges.
    turning, speed : how far the vessel turns, and how fast it is in the end, as shares of what the ship did (medians
        over windows); NaN where the ship hardly turns or moves.
    """

    vessel: Vessel
    ahead: float
    vessel_error: float
    constant_error: float
    turning: float
    speed: float

    @property
    def wrong(self) -> bool:
        """Whether the vessel should not be used as it is: no better than constant u, v, r, or of the other sign."""
        return self.vessel_error >= max(self.constant_error, LEAST_ERROR) or self.turning < 0

    @property
    def sentence(self) -> str:
        """One line: both errors, and how turning and speed differ."""
        name, errors = self.vessel.name, f"mean error over {self.ahead:g} s {self.vessel_error:.3g} m"
        errors += f", of constant u, v, r {self.constant_error:.3g} m"
        shares = ((self.speed, "its speed is then {:.2g} times that of the ship"),
                  (self.turning, "it turns {:.2g} times as far"))  # fmt: skip
        seen = "; ".join([errors, *(words.format(share) for share, words in shares if np.isfinite(share))])
        if self.turning < 0:
            return f"{name} turns the other way than the ship of the log: check the signs of angles and yaw; {seen}"
        how = "is no better than" if self.wrong else "is better than"
        return f"{name} {how} constant u, v, r: {seen}"


def first_look(
    vessel: Vessel, dataset: Dataset, runs: Iterable[str], *, ahead: float, step: float, path: PathSource = "position"
) -> Look:
    """Compare a vessel, stepped by RK4, with some runs of a log.

    Parameters
    ----------
    runs : names of the runs to look at. ahead, step : of the predictions [s]. path : as in `cut_windows`.

    Raises
    ------
    DataError : no run is as long as the horizon, or a command of the vessel is missing.
    """
    check_columns(vessel, dataset.frame.columns, str(vessel.file))
    part, horizon = dataset.select(runs), max(round(ahead / step), 1)
    windows = cut_windows(part, horizon=horizon, step=step, interval=max(step, horizon * step / 4), path=path)
    instants = windows.instants(known=True, hidden=window_memory(vessel, part, windows))
    physics = Physics(vessel, horizon, step, "rk4")
    paths, diverged = physics.variant_paths(instants)
    error = np.where(diverged, np.inf, position_error(paths[:, 0], windows.future))
    constant = position_error(constant_motion(windows), windows.future)
    predicted, true, now = physics.states(instants), windows.states, windows.columns["psi"]
    turned, speed = true["psi"][-1] - now, np.hypot(true["u"][-1], true["v"][-1])
    return Look(
        vessel, horizon * step, float(error.mean()), float(constant.mean()),
        _median_share(predicted["psi"][-1] - now, turned, LEAST_TURN_OF_WINDOW),
        _median_share(np.hypot(predicted["u"][-1], predicted["v"][-1]), speed, 0.0),
    )  # fmt: skip


def _median_share(predicted: NDArray[np.float64], true: NDArray[np.float64], least: float) -> float:
    """Median of predicted over true (N,), where the truth is larger than `least`; NaN where it nowhere is."""
    much = (np.abs(true) > least) & np.isfinite(predicted)
    return float(np.median(predicted[much] / true[much])) if much.any() else np.nan
