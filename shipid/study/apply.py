"""Roll a predictor along a log: each instant with what is known there, and each path beside how the log goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from shipid.data.causal import causal_columns
from shipid.data.dataset import (
    Dataset,
    clock_slack,
    cumulative_integral,
    mean_commands,
    read_dataset,
    sample_columns,
    stretches_of_runs,
)
from shipid.data.windows import (
    Instants,
    coarse_in_words,
    from_frame,
    future_of_instants,
    gaps_in_words,
    is_without_rows,
    past_of_instants,
)
from shipid.errors import DataError, ResultError, placed_errors, suggest_name
from shipid.files import check_table, write_table
from shipid.hybrid.bands import Region, adapt_band, adaptive_factor, start_adaptation
from shipid.hybrid.mean import MeanCorrector
from shipid.hybrid.physics import check_columns
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping
from shipid.metrics import summarise_errors
from shipid.observer import Array, run_observer
from shipid.predictor import Predictor
from shipid.study.prepare import states_along
from shipid.study.store import cell_file, read_predictor
from shipid.units import length_text, percent_text, plural_word
from shipid.vessel.load import Vessel

NO_PATH_ALONE = "a mean of foundations has no physics of its own: its path of physics alone is empty"
COOPERATIVE_COLUMNS = ("cooperative_north", "cooperative_east")


@dataclass(frozen=True)
class BandSettings:
    """Settings of a band along a log: its level, the kind of manoeuvre, and the rate at which it adapts, if any."""

    level: float
    kind: str | None = None
    rate: float | None = None


@dataclass(frozen=True, eq=False)
class Forecast:
    """Predictions from S instants of one stretch, in the frame (11).

    predicted, alone : paths (T, S, 2) [m], compensated and of the physics alone, NaN without physics and of a mean.
    region : of the band, where one was asked for. outside, diverged : the alarm, and where the physics diverges, (S,).
    columns : of the log at the instants.
    """

    predicted: Array
    alone: Array
    region: Region | None
    outside: Array
    diverged: Array
    columns: dict[str, Array]


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
    rate : with one, the band adapts along each run at this rate, see `shipid.hybrid.bands.adapt_band`.

    Returns the frame (run, t, ahead [s], physics_north, physics_east, cooperative_north, cooperative_east [m], outside;
    with a level also band_along, band_across [m], band_course [rad], half axes and direction, clockwise from north, of
    the ellipse that holds the true place, and band_factor where it adapts) and the share of instants outside the
    training's limits. Cells without physics, and means, have NaN for physics. `attrs["gaps"]` of the frame says how
    many times without rows the log has, and the longest; `attrs["coarse"]` that rows are farther apart than the step;
    `attrs["errors"]` how far off the paths are that end before the log does; `attrs["limits"]` lists why these errors
    may mislead.
    """
    check_table(out)
    band = None if level is None else BandSettings(level, kind, rate)
    predictor, dataset = read_to_apply(_find_cell_file(folder, cell), log, mapping, band)
    with placed_errors(DataError, file=log):
        tables = [table_of_stretch(predictor, dataset, run, rows, band) for run, rows in stretches_of_runs(dataset)]
    parts = [table for table in tables if len(table)]
    if not parts:
        steps = predictor.past + (predictor.physics.horizon if predictor.commands == "known" else 0)
        needed = f"{steps * predictor.physics.step:g} s"
        raise DataError(f"no run has {needed} for the past and, where commands are known, the horizon", file=log)
    frame = pd.concat(parts, ignore_index=True)
    errors = frame.pop("error").to_numpy().reshape(-1, predictor.physics.horizon).T
    limits = limits_in_words(predictor, dataset, frame.pop("diverged"))
    write_table(out, frame)
    step = predictor.physics.step
    frame.attrs["errors"] = _errors_in_words(errors[:, np.isfinite(errors).all(axis=0)], step)
    frame.attrs |= {"gaps": gaps_in_words(dataset, step), "coarse": coarse_in_words(dataset, step), "limits": limits}
    return frame, float(frame["outside"].mean())


def table_of_stretch(
    predictor: Predictor, dataset: Dataset, run: str, rows: pd.DataFrame, band: BandSettings | None = None
) -> pd.DataFrame:
    """The table of `predict_log` for a stretch, `error` [m] and `diverged`; empty without the past and plan needed."""
    some = _usable_rows(predictor, rows["t"].to_numpy())
    if some.start >= some.stop:
        return pd.DataFrame()
    known = instants_along(predictor, dataset, rows, some, plan=True)
    forecast = predict_instants(predictor, known, band, is_kind_new(predictor, dataset, run))
    points, instants = tables_along(predictor, run, rows, forecast, band)
    points = points.rename(columns=dict(zip(("north", "east"), COOPERATIVE_COLUMNS, strict=True)))
    if band is not None and band.rate is not None:
        points["band_factor"] = np.repeat(instants["factor"].to_numpy(), predictor.physics.horizon)
    by_instant = {"outside": forecast.outside, "diverged": forecast.diverged}
    return points.assign(**{name: np.repeat(values, predictor.physics.horizon) for name, values in by_instant.items()})


def limits_in_words(predictor: Predictor, dataset: Dataset, diverged: pd.Series[bool]) -> list[str]:
    """Limits of what is told along a log: its runs trained, the physics diverges, a mean has no path of its own."""
    trained = set(predictor.provenance.get("runs", ())).intersection(dataset.runs)
    many = f"{len(trained)} of {len(dataset.runs)} {plural_word(len(dataset.runs), 'run')}"
    lost = f"physics diverges on {percent_text(diverged.mean(), 1)} of the instants"
    texts = (
        f"{many} named like runs that trained this predictor: if they are the same, their errors are no evidence"
        if trained
        else "",
        f"{lost}: paths there go no farther than the present speed takes the ship" if diverged.any() else "",
        NO_PATH_ALONE if isinstance(predictor.corrector, MeanCorrector) else "",
    )
    return [*filter(None, texts)]


def _errors_in_words(error: Array, step: float) -> str:
    """How far off (T, S) [m] predictions are whose whole path the log holds; empty without one."""
    if not error.size:
        return ""
    known, count = summarise_errors(error), error.shape[1]
    end, end_90, mean = (length_text(value) for value in (known["end"], known["end_90"], known["mean"]))
    return (
        f"{len(error) * step:g} s ahead predictions err by {end} m on average, nine in ten below {end_90} m; mean over "
        f"the horizon {mean} m ({count} {plural_word(count, 'path')} that the log holds whole)"
    )


def read_to_apply(file: Path, log: Path, mapping: str | None, band: BandSettings | None) -> tuple[Predictor, Dataset]:
    """A predictor, which has the band, and a log with what it needs."""
    predictor = read_predictor(file)
    if band is not None:
        predictor.check_level(band.level, band.kind)
    return predictor, read_or_import(log, mapping, predictor.vessels)


def read_or_import(log: Path, mapping: str | None, vessels: Sequence[Vessel]) -> Dataset:
    """A dataset, or a raw log with its mapping, with what vessels need; DataError, also for a heading in degrees."""
    if mapping is None:
        dataset = read_dataset(log, remedy=", or give the log itself with --mapping")
    else:
        dataset = import_log(read_mapping(mapping), log)
    for vessel in vessels:
        check_columns(vessel, dataset.frame.columns, str(log))
    for run, rows in stretches_of_runs(dataset):
        t, psi, r = (rows[name].to_numpy() for name in ("t", "psi", "r"))
        changed, turned = np.ptp(psi), cumulative_integral(t, np.abs(r))[-1]
        if changed > 4 * np.pi + 2 * turned:
            words = f"changes by {changed:.0f} rad in run {run!r}, where r turns it by {turned:.2g}"
            raise DataError(f"{words}: give the heading in radians; are these degrees?", file=log, path="psi")
    return dataset


def _find_cell_file(folder: Path, cell: str) -> Path:
    available = {file.stem for file in (folder / "cells").glob("*.npz")}
    if not available:
        raise ResultError("holds no finished cells: give the folder of a run", file=folder)
    if cell not in available:
        raise ResultError(f"no such cell: {suggest_name(cell, available)}", file=folder, path=f"--cell {cell}")
    return cell_file(folder, cell)


def _usable_rows(predictor: Predictor, t: Array) -> slice:
    """Rows of one unbroken stretch at t (N,) [s] that have the past and the plan that the predictor needs."""
    physics, slack = predictor.physics, clock_slack(t)
    first = int((t < t[0] + predictor.past * physics.step - slack).sum())
    plan = (physics.horizon - 1) * physics.step if predictor.commands == "known" else 0.0
    return slice(first, int((t + plan <= t[-1] + slack).sum()))


def instants_along(predictor: Predictor, dataset: Dataset, rows: pd.DataFrame, some: slice, *, plan: bool) -> Instants:
    """What is known at some rows of one stretch, from its rows alone; `rows` ends where knowledge ends.

    Fixes that were interpolated, the past, the actuators and the observer are all taken from these rows.
    plan : whether a predictor with known commands gets those that the rows hold later, or the present orders.
    """
    physics = predictor.physics
    seen = Dataset(rows.reset_index(drop=True), dataset.metadata)
    if predictor.causal:
        seen = causal_columns(seen, predictor.causal)
    t = seen.frame["t"].to_numpy()[some]
    columns = sample_columns(seen.frame, t) | {"t": t}
    planned = None
    if predictor.commands == "known" and plan:
        planned = mean_commands(seen.frame, t + physics.step * np.arange(physics.horizon + 1)[:, None])
    elif predictor.commands == "known":
        planned = {name: np.tile(columns[name], (physics.horizon, 1)) for name in dataset.commands}
    hidden, estimates = None, {}
    if predictor.vessel is not None:
        of_mean = predictor.vessels if isinstance(predictor.corrector, MeanCorrector) else ()
        vessels = {"": predictor.vessel, **{f"{k}:": vessel for k, vessel in enumerate(of_mean)}}
        along = {
            prefix + name: values[some]
            for prefix, vessel in vessels.items()
            for name, values in (states_along(vessel, dataset.commands, seen.frame) or {}).items()
        }
        hidden = along or None
        if physics.observer is not None:
            observed = run_observer(predictor.vessel, seen, physics.observer).columns
            estimates = {name: values[some] for name, values in observed.items()}
    past = past_of_instants(seen.frame, t, predictor.past, physics.step, physics.path)
    return Instants(columns, past, planned, hidden, estimates)


def is_kind_new(predictor: Predictor, dataset: Dataset, run: str) -> bool:
    """Whether a run is said to be a kind of manoeuvre of which no run calibrated the band."""
    kind, bands = dataset.metadata.get("manoeuvres", {}).get(run), predictor.bands
    return bool(kind and bands is not None and bands.kinds and kind not in bands.kinds)


def predict_instants(predictor: Predictor, instants: Instants, band: BandSettings | None, new: bool) -> Forecast:
    """Paths, band and alarm at some instants; new : whether the alarm is raised at all, for the kind of the run."""
    alone, diverged = predictor.roll_out(instants)
    predicted = predictor.predict(instants, alone)
    region = None if band is None else predictor.band(predicted, instants, band.level, kind=band.kind)
    columns = {name: instants.columns[name] for name in ("t", "north", "east", "psi")}
    alone = alone if predictor.vessel else np.full_like(alone, np.nan)
    return Forecast(predicted, alone, region, predictor.raise_alarm(instants, diverged) | new, diverged, columns)


def tables_along(
    predictor: Predictor, run: str, rows: pd.DataFrame, forecast: Forecast, band: BandSettings | None
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Points and instants of a forecast along one unbroken stretch, all of whose rows are `rows`.

    Points have run, t, ahead, physics_north, physics_east, north, east, error [m] where the log goes on; with a band
    band_along, band_across, band_course. Instants have run, t, outside, diverged, and the error at the end of the
    horizon; with a band reach, the greatest error of the whole path over the band as calibrated, and factor, by which
    it adapted.
    """
    physics, columns = predictor.physics, forecast.columns
    steps, count = physics.horizon, len(columns["t"])
    missed = _errors_along(predictor, rows, forecast)
    error = np.hypot(missed[..., 0], missed[..., 1])
    points = {
        "run": np.full(steps * count, run),
        "t": np.repeat(columns["t"], steps),
        "ahead": np.tile(physics.step * np.arange(1, steps + 1), count),
    }
    for prefix, path in (("physics_", forecast.alone), ("", forecast.predicted)):
        places = from_frame(path[..., 0], path[..., 1], columns["north"], columns["east"], columns["psi"])
        points |= {f"{prefix}{name}": place.T.ravel() for name, place in zip(("north", "east"), places, strict=True)}
    instants = {"run": run, "t": columns["t"], "outside": forecast.outside, "diverged": forecast.diverged}
    instants["error"] = error[-1]
    if band is not None and forecast.region is not None:
        region, reach, factors = forecast.region, forecast.region.reach(missed).max(axis=0), np.ones(count)
        if band.rate is not None:
            assert predictor.bands is not None
            ends, table = columns["t"] + steps * physics.step, predictor.bands.table(band.kind)
            factors = adapt_along_run(reach, ends, columns["t"], band, table)
        instants |= {"reach": reach, "factor": factors}
        course = np.arctan2(region.ahead[..., 1], region.ahead[..., 0]) + columns["psi"]
        points["band_along"], points["band_across"] = (
            (axis * factors).T.ravel() for axis in (region.along, region.across)
        )
        points["band_course"] = np.mod(course, 2 * np.pi).T.ravel()
    return pd.DataFrame(points | {"error": error.T.ravel()}), pd.DataFrame(instants)


def _errors_along(predictor: Predictor, rows: pd.DataFrame, forecast: Forecast) -> Array:
    """How far paths are from how the log goes on (T, S, 2) [m]; not a number where it holds no rows."""
    physics, t, now = predictor.physics, rows["t"].to_numpy(), forecast.columns["t"]
    later = now + physics.step * np.arange(1, physics.horizon + 1)[:, None]
    there = (later <= t[-1] + clock_slack(t)) & ~is_without_rows(t, later, physics.step)
    future = future_of_instants(rows, now, physics.horizon, physics.step, physics.path)
    return np.where(there[..., None], future - forecast.predicted, np.nan)


def adapt_along_run(reach: Array, known_at: Array, now: Array, band: BandSettings, table: Array) -> Array:
    """Factors (S,) of a band that adapts along a run: at each instant, by the paths that have ended until then.

    Parameters
    ----------
    reach : (S,) greatest error of each path over its band as calibrated; not a number where it never ends in the log.
    known_at, now : (S,) when each path ends, and the instants themselves [s], in order. table : radii of the band.
    """
    state, factors, waiting = start_adaptation(band.level, band.rate or 0.0), np.ones(len(now)), 0
    slack = clock_slack(now)
    together = np.maximum(np.searchsorted(now, known_at - slack) - np.arange(len(now)), 1)
    for i, t in enumerate(now):
        while waiting < i and known_at[waiting] <= t + slack:
            if np.isfinite(reach[waiting]):
                state = adapt_band(state, bool(reach[waiting] > factors[waiting]), int(together[waiting]))
            waiting += 1
        factors[i] = adaptive_factor(state, table)
    return factors
