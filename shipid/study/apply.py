"""Use a finished cell: its predictor along a log."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from shipid.data.causal import causal_columns
from shipid.data.dataset import Dataset, clock_slack, in_force, pieces, read_dataset, sample
from shipid.data.windows import Instants, coarse_in_words, from_frame, future_of, gaps_in_words, past_of, without_rows
from shipid.errors import DataError, ResultError, choices
from shipid.files import check_table, write_table
from shipid.hybrid.bands import Region, adapted, adaptive, factor
from shipid.hybrid.physics import Physics, check_columns
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping
from shipid.observer import Estimates, observe
from shipid.predictor import Predictor
from shipid.study.prepare import states_along
from shipid.study.store import cell_file, read_predictor

Array = np.ndarray


def predict_log(
    folder: Path,
    cell: str,
    log: Path,
    mapping: str | None,
    out: Path,
    *,
    level: float | None = None,
    kind: str | None = None,
    rate: float | None = None,
) -> tuple[pd.DataFrame, float]:
    """Write physics and cooperative paths in north-east for every instant of a log.

    Where the predictor takes known commands they are those that the log holds later, and an instant needs them for the
    whole horizon.

    Parameters
    ----------
    level : share of whole paths that the columns of the band hold; None: no such columns. kind : of the manoeuvre.
    rate : with one, the band adapts along each run at this rate, see `shipid.hybrid.bands.adapted`.

    Returns the frame (run, t, ahead [s], physics_north, physics_east, cooperative_north, cooperative_east [m], outside;
    with a level also band_along, band_across [m], band_course [rad], half axes and direction, clockwise from north, of
    the ellipse that holds the true place, and band_factor where it adapts) and the share of instants outside the
    training's limits. Cells without physics have NaN for physics. `attrs["gaps"]` of the frame says how many times
    without rows the log has, and the longest; `attrs["coarse"]` that its rows are farther apart than the step.
    """
    check_table(out)
    predictor = read_predictor(_known_cell(folder, cell))
    if level is not None:
        predictor.check_level(level, kind)
    dataset = dataset_of(log, mapping)
    if predictor.vessel is not None:
        check_columns(predictor.vessel, dataset.frame.columns, str(log))
    if predictor.causal:
        dataset = causal_columns(dataset, predictor.causal)
    estimates = None
    if predictor.vessel is not None and predictor.physics.observer is not None:
        estimates = observe(predictor.vessel, dataset, predictor.physics.observer)
    band = None if level is None else Band(level, kind, rate)
    parts = [_along(predictor, dataset, run, rows, estimates, band) for run, rows in pieces(dataset)]
    frame = pd.concat(parts, ignore_index=True)
    if frame.empty:
        raise DataError(_too_short(predictor), file=log)
    write_table(out, frame)
    step = predictor.physics.step
    frame.attrs |= {"gaps": gaps_in_words(dataset, step), "coarse": coarse_in_words(dataset, step)}
    return frame, float(frame["outside"].mean())


def dataset_of(log: Path, mapping: str | None) -> Dataset:
    """A dataset, or a raw log with its mapping; DataError for what is neither."""
    if mapping is None:
        return read_dataset(log, remedy=", or give the log itself with --mapping")
    return import_log(read_mapping(mapping), log)


@dataclass(frozen=True)
class Band:
    """Settings of a band along a log: its level, the kind of manoeuvre, and the rate at which it adapts, if any."""

    level: float
    kind: str | None = None
    rate: float | None = None


def _too_short(predictor: Predictor) -> str:
    step = predictor.physics.step
    length = predictor.physics.horizon * step
    past = f"the past of {predictor.past * step:g} s" if predictor.past else ""
    plan = f"the horizon of {length:g} s, over which commands are known" if predictor.commands == "known" else ""
    return f"no run is as long as {' and '.join(filter(None, (past, plan)))}"


def _known_cell(folder: Path, cell: str) -> Path:
    available = {file.stem for file in (folder / "cells").glob("*.npz")}
    if not folder.is_dir():
        raise ResultError("no such folder: give that of a run", file=folder)
    if not available:
        raise ResultError("holds no finished cells: is it the folder of a run?", file=folder)
    if cell not in available:
        raise ResultError(f"no such cell: {choices(cell, available)}", file=folder, path=f"--cell {cell}")
    return cell_file(folder, cell)


def _along(
    predictor: Predictor,
    dataset: Dataset,
    run: str,
    rows: pd.DataFrame,
    estimates: Estimates | None,
    band: Band | None = None,
) -> pd.DataFrame:
    """Predictions from every instant of one unbroken stretch that has the past and the plan that they need."""
    physics, t = predictor.physics, rows["t"].to_numpy()
    slack = clock_slack(t)
    first = int((t < t[0] + predictor.past * physics.step - slack).sum())  # earlier instants have no whole past
    last = len(t)
    ahead = physics.step * np.arange(physics.horizon)
    if predictor.commands == "known":
        last = int((t + ahead[-1] <= t[-1] + slack).sum())  # later instants have no whole plan
    count = last - first
    if count <= 0:
        return pd.DataFrame()
    planned = None
    if predictor.commands == "known":
        planned = in_force(rows, t[first:last] + physics.step * np.arange(physics.horizon + 1)[:, None])
    hidden = None if predictor.vessel is None else states_along(predictor.vessel, dataset.commands, rows)
    hidden = hidden and {name: values[first:last] for name, values in hidden.items()}
    columns = {**sample(rows, t[first:last]), "t": t[first:last]}
    past = past_of(rows, t[first:last], predictor.past, physics.step, physics.path)
    known = {}
    if estimates is not None:
        places = rows.index.to_numpy()[first:last]
        known = {name: values[places] for name, values in estimates.columns.items()}
    instants = Instants(columns, past, planned, hidden, known)
    origin, steps = (columns["north"], columns["east"], columns["psi"]), physics.horizon
    result = {
        "run": np.full(steps * count, run),
        "t": np.repeat(columns["t"], steps),
        "ahead": np.tile(physics.step * np.arange(1, steps + 1), count),
    }
    alone = predictor.alone(instants)
    predicted = predictor.predict(instants, alone)
    if predictor.vessel is None:
        alone = np.full_like(alone, np.nan)
    for name, path in (("physics", alone), ("cooperative", predicted)):
        north, east = from_frame(path[..., 0], path[..., 1], *origin)
        result[f"{name}_north"], result[f"{name}_east"] = north.T.ravel(), east.T.ravel()
    if band is not None:
        region = predictor.band(predicted, instants, band.level, kind=band.kind)
        if band.rate is not None:
            assert predictor.bands is not None
            judged = _later(rows, t[first:last], predicted, region, physics)
            table = predictor.bands.table(band.kind)
            factors = along_run(judged, columns["t"] + physics.horizon * physics.step, columns["t"], band, table)
            region, result["band_factor"] = region.scaled(factors), np.repeat(factors, steps)
        course = np.arctan2(region.ahead[..., 1], region.ahead[..., 0]) + columns["psi"]
        result["band_along"], result["band_across"] = region.along.T.ravel(), region.across.T.ravel()
        result["band_course"] = np.mod(course, 2 * np.pi).T.ravel()
    result["outside"] = np.repeat(predictor.outside({**columns, **known}), steps)
    return pd.DataFrame(result)


def _later(rows: pd.DataFrame, instants: Array, predicted: Array, region: Region, physics: Physics) -> Array:
    """Greatest reach (S,) over the horizon of the paths that the log holds later; not a number where it ends before."""
    t, horizon = rows["t"].to_numpy(), physics.horizon * physics.step
    grid = instants + physics.step * np.arange(physics.horizon + 1)[:, None]
    whole = (instants + horizon <= t[-1] + clock_slack(t)) & ~without_rows(t, grid, physics.step).any(axis=0)
    reach = np.full(len(instants), np.nan)
    if whole.any():
        future = future_of(rows, instants[whole], physics.horizon, physics.step, physics.path)
        some = Region(region.ahead[:, whole], region.along[:, whole], region.across[:, whole])
        reach[whole] = some.reach(future - predicted[:, whole]).max(axis=0)
    return reach


def along_run(reach: Array, known_at: Array, now: Array, band: Band, table: Array) -> Array:
    """Factors (S,) of a band that adapts along a run: at each instant, by the paths that have ended until then.

    Parameters
    ----------
    reach : (S,) greatest error of each path over its band as calibrated; not a number where it never ends in the log.
    known_at, now : (S,) when each path ends, and the instants themselves [s], in order. table : radii of the band.
    """
    state, factors, waiting = adaptive(band.level, band.rate or 0.0), np.ones(len(now)), 0
    slack = clock_slack(now)
    together = np.maximum(np.searchsorted(now, known_at - slack) - np.arange(len(now)), 1)
    for i, t in enumerate(now):
        while waiting < i and known_at[waiting] <= t + slack:
            if np.isfinite(reach[waiting]):
                state = adapted(state, bool(reach[waiting] > factors[waiting]), int(together[waiting]))
            waiting += 1
        factors[i] = factor(state, table)
    return factors
