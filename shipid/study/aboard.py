"""Play a log as if at sea: rows arrive one by one, and each prediction uses the rows that have arrived."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset, clock_slack, stretches_of_runs
from shipid.data.windows import coarse_in_words, gaps_in_words
from shipid.engine.rollout import SPEED_LIMIT
from shipid.errors import DataError, placed_errors
from shipid.evidence import share_interval
from shipid.files import check_table, write_table
from shipid.hybrid.bands import Region
from shipid.hybrid.physics import missing_columns
from shipid.predictor import Array, Predictor
from shipid.report.content import SummaryLine
from shipid.study.apply import (
    BandSettings,
    Forecast,
    instants_along,
    is_kind_new,
    limits_in_words,
    predict_instants,
    read_to_apply,
    tables_along,
)
from shipid.units import length_text, level_text, percent_text, plural_word

TRACK_COLUMNS = ["run", "t", "north", "east"]
MOMENTS_OF_SUMMARY = np.linspace(0.0, 1.0, 5)  # of the horizon
SHIP_CHANGED = "the ship, its loading or the weather is not that of the training, and bands do not hold"
ORDERS_UNKNOWN = "later orders were known in calibration and are not here: nothing is promised"


@dataclass(frozen=True, eq=False)
class Replay:
    """What would have been seen at sea.

    instants : a row for each prediction: run, t, outside (the alarm), diverged (the physics), latency [s], error at the
        end of the horizon [m]; with a band factor, by which it was wider than calibrated, and reach, the greatest error
        of the whole path over the band as calibrated (not a number where the log ends before).
    points : a row for each point of each path: run, t, ahead, north, east, physics_north, physics_east, error [m];
        with a band band_along, band_across [m], band_course [rad, clockwise from north], no numbers with a plan.
    track : run, t [s], north, east [m] as measured. skipped : instants that were due before there was a past.
    plan : whether orders were taken as held where the predictor knows a plan. limits : of the comparison, in words.
    """

    instants: pd.DataFrame
    points: pd.DataFrame
    track: pd.DataFrame
    skipped: int
    plan: bool
    limits: tuple[str, ...] = ()
    band: BandSettings | None = None


def play_aboard(
    file: Path,
    log: Path,
    mapping: str | None = None,
    every: float | None = None,
    *,
    level: float | None = None,
    kind: str | None = None,
    rate: float | None = None,
) -> Replay:
    """Predict at every instant of a log from the rows up to then; the rows after it only judge.

    every : seconds between predictions; default the step of the predictor.
    level : share of whole paths that the band is to hold. kind : of the manoeuvre. rate : with one, the band adapts.

    Raises DataError where a command is missing, no run is as long as the past that is needed, or no band of the level
    can be promised.
    """
    band = None if level is None else BandSettings(level, kind, rate)
    predictor, dataset = read_to_apply(file, log, mapping, band)
    step = predictor.physics.step
    names = list(map(str, dataset.frame.columns))
    if every is not None and not every > 0:
        raise DataError(f"{every:g}: must be above 0", path="--every")
    instants, points, skipped = [], [], 0
    for run, piece in stretches_of_runs(dataset):
        rows, early = _due_rows(piece["t"].to_numpy(), every or step, predictor.past * step)
        skipped += early
        if len(rows):
            with placed_errors(DataError, file=log):
                forecast, latency = _forecast_row_by_row(predictor, dataset, piece, rows, band)
            path, one = tables_along(predictor, run, piece, forecast, band)
            points.append(path)
            instants.append(one.assign(latency=latency))
    if not instants:
        past = f"the past of {predictor.past * step:g} s that the predictor needs"
        raise DataError(f"no instant has {past}: runs are shorter, or --every is longer", file=log)
    seen = pd.concat(instants, ignore_index=True)
    assumed = dict.fromkeys(name for vessel in predictor.vessels for name in missing_columns(vessel, names))
    gaps, plan = gaps_in_words(dataset, step), predictor.commands == "known"
    limits = (
        f"not in the log, taken as 0: {', '.join(assumed)}" if assumed else "",
        coarse_in_words(dataset, step),
        f"{gaps}: no errors there, and a past over one of them is interpolated" if gaps else "",
        "the plan was: orders stay as they are, since at sea later orders are not known" if plan else "",
        *limits_in_words(predictor, dataset, seen["diverged"]),
    )
    return Replay(
        seen,
        pd.concat(points, ignore_index=True),
        dataset.frame[TRACK_COLUMNS],
        skipped,
        plan,
        tuple(filter(None, limits)),
        band,
    )


def _due_rows(t: Array, every: float, past: float) -> tuple[list[int], int]:
    """Rows at which a prediction is due and has its past [s], and how many due ones have none."""
    slack, due, rows = clock_slack(t), t[0], []
    for i, now in enumerate(t):
        if now >= due - slack:
            rows.append(i)
            due = max(due + every, now + slack)
    ready = [i for i in rows if t[i] - t[0] >= past - slack]
    return ready, len(rows) - len(ready)


def _forecast_row_by_row(
    predictor: Predictor, dataset: Dataset, piece: pd.DataFrame, rows: list[int], band: BandSettings | None
) -> tuple[Forecast, list[float]]:
    """Predictions at some rows of one unbroken stretch, each from the rows up to it, and the latency [s] of each."""
    forecasts, latency, new = [], [], is_kind_new(predictor, dataset, str(piece["run"].iloc[0]))
    for i in rows:
        begin = time.perf_counter()
        known = instants_along(predictor, dataset, piece.iloc[: i + 1], slice(i, i + 1), plan=False)
        forecasts.append(predict_instants(predictor, known, band, new))
        latency.append(time.perf_counter() - begin)
    regions = [one.region for one in forecasts if one.region is not None]
    names = ("ahead", "along", "across")
    parts = [np.concatenate([getattr(region, name) for region in regions], axis=1) for name in names] if regions else []
    if predictor.commands == "known":  # they were not: nothing is promised
        parts = [np.full_like(part, np.nan) for part in parts]
    return Forecast(
        np.concatenate([one.predicted for one in forecasts], axis=1),
        np.concatenate([one.alone for one in forecasts], axis=1),
        Region(*parts) if regions else None,
        np.concatenate([one.outside for one in forecasts]),
        np.concatenate([one.diverged for one in forecasts]),
        {name: np.concatenate([one.columns[name] for one in forecasts]) for name in forecasts[0].columns},
    ), latency


def write_replay_points(played: Replay, file: Path) -> None:
    """Write every point with the alarm and the latency of its instant."""
    check_table(file)
    kept = played.instants.drop(columns=["error", "reach", "diverged"], errors="ignore").rename(
        columns={"factor": "band_factor"}
    )
    write_table(file, played.points.merge(kept, on=["run", "t"], how="left"))


def replay_summary(played: Replay) -> list[SummaryLine]:
    """Summary of a replay, as lines that say what they are about."""
    instants, points = played.instants, played.points
    runs, outside = instants["run"].nunique(), instants["outside"].to_numpy(dtype=bool)
    early = f"{played.skipped} {plural_word(played.skipped, 'instant')} before there was a past"
    many = f"{len(instants)} {plural_word(len(instants), 'prediction')} in {runs} {plural_word(runs, 'run')}"
    latency = 1e3 * instants["latency"]
    return [
        SummaryLine("predictions", f"{many}, {points['ahead'].max():g} s ahead; {early}"),
        *(SummaryLine("limit", text) for text in played.limits),
        SummaryLine("detail", f"latency: median {latency.median():.1f} ms, 99 % below {latency.quantile(0.99):.1f} ms"),
        SummaryLine(
            "alarm",
            f"alarm: at {outside.sum()} of {len(outside)} instants ({percent_text(outside.mean())}) outside of the "
            "training",
        ),
        *([] if played.band is None else [SummaryLine("band", _band_in_words(played, played.band))]),
        *(SummaryLine("detail", text) for text in _errors_ahead(played)),
    ]


def _errors_ahead(played: Replay) -> list[str]:
    """Lines of a table: errors [m] at some moments ahead, and with a band its median half axes [m] there.

    A band that is wider than a ship can go in that time has none.
    """
    points = played.points.merge(played.instants[["run", "t", "outside"]], on=["run", "t"])
    moments = points["ahead"].quantile(MOMENTS_OF_SUMMARY, interpolation="nearest")
    points = points[points["ahead"].isin(moments) & points["error"].notna()]
    by_moment = points.groupby("ahead")
    columns = {
        "median": by_moment["error"].median(),
        "90 %": by_moment["error"].quantile(0.9),
        "worst": by_moment["error"].max(),
        "in alarm": points[points["outside"]].groupby("ahead")["error"].median(),
    }
    if played.band is not None:
        for name in ("along", "across"):
            half = by_moment[f"band_{name}"].median()
            columns[f"band {name}"] = half[half <= SPEED_LIMIT * half.index]
    table = pd.DataFrame(columns).rename_axis("s ahead").reset_index()
    formats = {"s ahead": "{:g}".format} | dict.fromkeys(columns, length_text)
    text = table.to_string(index=False, col_space=11, na_rep="-", formatters=formats)
    band = "" if played.band is None else ", and band"
    return [f"error where the log goes on{band} [m]:", *text.splitlines()]


def _band_in_words(played: Replay, band: BandSettings) -> str:
    """How often the band held the whole paths that can be judged, and why if that is fewer than was promised."""
    judged = played.instants[played.instants["reach"].notna()]
    if played.plan:
        return f"no band of {level_text(band.level)}: {ORDERS_UNKNOWN}"
    if judged.empty:
        return f"band of {level_text(band.level)}: no whole path can be judged, the log ends before"
    held, promised = (judged["reach"] <= judged["factor"]).to_numpy(), ~judged["outside"].to_numpy(dtype=bool)
    of = "" if band.kind is None else f" of the kind {band.kind!r}"
    adapts = "" if band.rate is None else f", adapting at {band.rate:g} up to {judged['factor'].max():.2f} times"
    share = f"it held {percent_text(held.mean())} of the {len(held)} whole paths that can be judged"
    line = f"band of {level_text(band.level)}{of}{adapts}: {share}"
    if not promised.any():
        return f"{line}, all in alarm, where nothing is promised"
    line += f", {percent_text(held[promised].mean())} of the {promised.sum()} without alarm, where it is promised"
    if share_interval(held[promised], judged["run"].to_numpy()[promised])[1] < band.level:
        line += f"; that is fewer than {level_text(band.level)} by more than chance: {SHIP_CHANGED}"
    return line
