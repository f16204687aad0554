"""Errors by side, rudder level and speed: where a model is wrong, which no total says.

Free runs of one horizon are compared with the log by rows: the side to which the ship turns, a level of its rudder or
azimuth angle, a third of the speeds. The error of the turning is the sum of predicted less measured yaw rate over that
of the measured one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import stdtr

from shipid.data.dataset import Array, Dataset
from shipid.identification.free_run import MEASURED
from shipid.identification.segments import near_a_row
from shipid.physics.signals import is_steering
from shipid.units import DEGREE, percent_text
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

LEVELS = (2.5, 7.5, 12.5, 17.5, 22.5, 27.5, 32.5)  # deg, between levels of helm that trials have
TURNING = 0.1  # of the greatest yaw rate: slower rows turn to no side
WORSE, LEAST = 2.0, 0.05  # a side is worse from this ratio of errors on, and from this error of the turning on
FEWEST = 20  # rows that make a group
FALSE_ALARM = 0.05  # chance that any of the tests made finds a difference where there is none
COLUMNS = ("group", "side", "rows", "u", "v", "r", "r_error", "turning", "error", "pieces")


def by_group(series: pd.DataFrame, model: str, vessel: Vessel, dataset: Dataset) -> pd.DataFrame:
    """Errors of free runs at rows: `group`, `side` (`starboard`, `port`, none), `rows`, RMS `u`, `v`, `r`, `turning`.

    u, v [m/s], r, its standard error r_error [rad/s]. turning, error : relative error of the change of heading [1], its
    standard error. pieces : free runs with rows of the group.

    series : `FreeRuns.series`. model : one of its models. dataset : of the runs, for the commands.
    """
    log, mine = (series[series["model"] == name].reset_index(drop=True) for name in (MEASURED, model))
    helm = _mean_helm(vessel, dataset, log)
    begin = ~log.duplicated(["run", "piece"])
    away = {name: mine[name].to_numpy() - log[name].to_numpy() for name in ("u", "v", "r")}
    seen = ~begin.to_numpy() & np.isfinite(away["r"]) & _instants_with_rows(dataset, log)
    r, speed = log["r"].to_numpy(), np.hypot(log["u"].to_numpy(), log["v"].to_numpy())
    pieces = log.groupby(["run", "piece"], sort=False).ngroup().to_numpy()
    rows = [
        {
            "group": group,
            "side": side,
            "rows": int(mask.sum()),
            **{name: float(np.sqrt((values[mask] ** 2).mean())) for name, values in away.items()},
            **(_turning_error(away["r"][mask], r[mask], pieces[mask]) if side else {}),
        }
        for group, side, mask in _side_groups(seen, r, helm, speed)
        if mask.sum() >= FEWEST
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _instants_with_rows(dataset: Dataset, log: pd.DataFrame) -> NDArray[np.bool_]:
    """Instants (N,) of the free runs at which there is a row of the log: between far rows it is only interpolated."""
    seen, steps = np.zeros(len(log), dtype=bool), log.groupby(["run", "piece"], sort=False)["t"].diff()
    for run, rows in log.groupby("run", sort=False):
        t = dataset.frame.loc[dataset.frame["run"] == run, "t"].to_numpy()
        seen[rows.index] = near_a_row(t, rows["t"].to_numpy(), float(steps[rows.index].median()))
    return seen


def _turning_error(away: Array, r: Array, pieces: NDArray[np.integer[Any]]) -> dict[str, float]:
    """Relative error of the change of heading, and standard errors from the pieces, which are independent."""
    _, place = np.unique(pieces, return_inverse=True)
    of_row = (away, r, away**2, np.ones_like(r))
    missed, turned, squares, rows = (np.bincount(place, values).astype(float) for values in of_row)
    share, error = _ratio_of_sums(missed, turned)
    square, more = _ratio_of_sums(squares, rows)
    rms = float(np.sqrt(square))
    return {
        "turning": share,
        "error": error,
        "r_error": more / (2 * rms) if rms > 0 else 0.0,
        "pieces": int(place.max()) + 1,
    }


def _ratio_of_sums(a: Array, b: Array) -> tuple[float, float]:
    """Ratio of two sums over pieces, and its standard error; infinite from one piece."""
    share, count = float(a.sum() / b.sum()), len(a)
    error = float(np.sqrt(count / (count - 1) * ((a - share * b) ** 2).sum()) / abs(b.sum())) if count > 1 else np.inf
    return share, error


def _mean_helm(vessel: Vessel, dataset: Dataset, log: pd.DataFrame) -> Array | None:
    """Mean magnitude (N,) [rad] of the angles that steer, at the rows of the free runs; None where no angle steers."""
    names = [name for name in vessel_dynamics(vessel).commands if is_steering(name)]
    if not names:
        return None
    helm = np.zeros(len(log))
    for run, rows in log.groupby("run", sort=False):
        of_run = dataset.frame[dataset.frame["run"] == run]
        angles = np.abs(of_run[names].to_numpy(dtype=float)).mean(axis=1)
        places = np.searchsorted(of_run["t"].to_numpy(), rows["t"].to_numpy() + 1e-6, side="right") - 1
        helm[rows.index] = angles[np.clip(places, 0, len(angles) - 1)]
    return helm


def _side_groups(
    seen: NDArray[np.bool_], r: Array, helm: Array | None, speed: Array
) -> Iterator[tuple[str, str, NDArray[np.bool_]]]:
    least = TURNING * (np.abs(r[seen]).max(initial=0.0))
    sides = {"starboard": seen & (r > least), "port": seen & (r < -least)}
    yield from (("all", side, mask) for side, mask in sides.items())
    if helm is not None:
        level = np.digitize(helm, np.array(LEVELS) * DEGREE)
        for number in range(len(LEVELS) + 1):
            here = level == number
            if (here & seen).sum() < FEWEST:
                continue
            name = f"helm about {np.median(helm[here & seen]) / DEGREE:.0f} deg"
            yield from ((name, side, mask & here) for side, mask in sides.items())
    thirds = np.quantile(speed[seen], [1 / 3, 2 / 3]) if seen.any() else np.zeros(2)
    for number in range(3):
        here = seen & (np.digitize(speed, thirds) == number)
        if here.any():
            yield f"speed {speed[here].min():.3g} to {speed[here].max():.3g} m/s", "", here


def uneven_side_warnings(groups: pd.DataFrame) -> tuple[str, ...]:
    """Sentences on groups whose one side is more than twice as wrong as the other, in its turning or its yaw rate.

    By a t test over the pieces, at a level divided by the number of tests (Bonferroni).
    """
    sentences = []
    rows = [row for row in groups.to_dict("records") if row["side"]]
    by = {
        group: [row for row in rows if row["group"] == group] for group in dict.fromkeys(row["group"] for row in rows)
    }
    both = {group: of for group, of in by.items() if len(of) == len(("starboard", "port"))}
    level = FALSE_ALARM / max(2 * len(both), 1)
    for group, of in both.items():
        where = "" if group == "all" else f" at {group}"
        freedom = min(row["pieces"] for row in of) - 1
        better, worse = sorted(of, key=lambda row: abs(float(row["turning"])))
        apart = abs(worse["turning"]) - abs(better["turning"])
        chance = _two_sided_p(apart, float(np.hypot(worse["error"], better["error"])), freedom)
        if chance <= level and abs(worse["turning"]) > max(WORSE * abs(better["turning"]), LEAST):
            sentences.append(
                f"the error of the turning{where} is {percent_text(worse['turning'], signed=True)} to {worse['side']} "
                f"and {percent_text(better['turning'], signed=True)} to {better['side']}: the model lacks what "
                f"makes the sides differ; to run next: turns to both sides{where}"
            )
            continue
        better, worse = sorted(of, key=lambda row: float(row["r"]))
        chance = _two_sided_p(worse["r"] - better["r"], float(np.hypot(worse["r_error"], better["r_error"])), freedom)
        if chance <= level and worse["r"] > WORSE * better["r"]:
            sentences.append(
                f"the error of the yaw rate{where} is {worse['r'] / better['r']:.1f} times as large to {worse['side']} "
                f"as to {better['side']}"
            )
    return tuple(sentences)


def _two_sided_p(apart: float, error: float, freedom: int) -> float:
    """Two-sided p-value of a difference with so many degrees of freedom; 1 where nothing is known of its error."""
    if freedom < 1 or not np.isfinite(error):
        return 1.0
    return float(2 * stdtr(freedom, -apart / error)) if error > 0 else float(apart <= 0)


def side_table_rows(groups: pd.DataFrame) -> list[list[str]]:
    """Rows of a table: group, side, rows, u, v [m/s], r [deg/s], error of the turning [%]."""
    return [
        [
            str(row["group"]),
            str(row["side"]),
            str(row["rows"]),
            *(f"{row[name]:.3g}" for name in ("u", "v")),
            f"{row['r'] / DEGREE:.3g}",
            _turning_error_text(float(row["turning"]), float(row["error"])),
        ]
        for row in groups.to_dict("records")
    ]


def _turning_error_text(turning: float, error: float) -> str:
    """The error of the turning [%] with its standard error, where more than one piece shows it."""
    share = "" if np.isnan(turning) else f"{100 * turning:+.1f}"
    return f"{share} +-{100 * error:.1f}" if share and np.isfinite(error) else share


HEADS = ("group", "turning to", "rows", "u [m/s]", "v [m/s]", "r [deg/s]", "turning [%]")
"""Columns of `side_table_rows`."""
