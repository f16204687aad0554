"""Play a log as if at sea: rows arrive one by one, and each prediction uses the rows that have arrived."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset, clock_slack, stretches_of_runs
from shipid.data.windows import coarse_in_words, gaps_in_words
from shipid.engine.rollout import SPEED_LIMIT
from shipid.errors import DataError
from shipid.evidence import share_interval
from shipid.files import check_table, write_table
from shipid.hybrid.bands import Region
from shipid.hybrid.physics import check_columns, missing_columns
from shipid.logs.dates import format_span
from shipid.predictor import Predictor
from shipid.report.content import SummaryLine
from shipid.study.apply import BandSettings, Forecast, instants_along, predict_instants, read_or_import, tables_along
from shipid.study.store import read_predictor
from shipid.units import join_names, length_text, level_text, percent_text, plural_word

Array = np.ndarray
TRACK_COLUMNS = ["run", "t", "north", "east"]
MOMENTS_IN_SUMMARY = 5  # moments of the horizon that the summary shows
SHIP_CHANGED = "the ship, its loading or the weather is not that of the training, and bands do not hold"
ORDERS_UNKNOWN = "later orders were not known as they were in calibration"


@dataclass(frozen=True, eq=False)
class Replay:
    """What would have been seen at sea.

    instants : a row for each prediction: run, t, outside (the alarm), latency [s], and the error at the end of the
        horizon [m]. With a band also factor, by which it was wider than calibrated, and reach, the greatest error of
        the whole path over the band as calibrated; not a number where the log ends before.
    points : a row for each point of each path: run, t, ahead, north, east, physics_north, physics_east, error [m] where
        the log goes on. With a band also band_along, band_across [m], band_course [rad, clockwise from north].
    assumed : what the vessel feels and the log does not hold; it is 0.
    skipped : instants at which a prediction was due before there was a past.
    plan : whether orders were taken as held where the predictor knows a plan.
    band : what was asked of the band; None: none was asked.
    track : run, t [s], north, east [m] as measured, for a page. gaps : times without rows, in words. coarse : that rows
        are farther apart than the step, in words.
    """

    instants: pd.DataFrame
    points: pd.DataFrame
    step: float
    horizon: int
    skipped: int
    assumed: tuple[str, ...]
    plan: bool
    band: BandSettings | None = None
    track: pd.DataFrame = field(default_factory=lambda: pd.DataFrame(columns=TRACK_COLUMNS))
    gaps: str = ""
    coarse: str = ""


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

    every : seconds between predictions; default the step of the predictor. An instant is a row. A predictor that takes
    known commands is given the present orders as the plan: at sea the log's later orders are not known.
    level : share of whole paths that the band is to hold. kind : of the manoeuvre. rate : with one, the band adapts
    along each unbroken stretch by the paths that have ended by then.

    Raises DataError where a command is missing, no run is as long as the past that is needed, or no band of the level
    can be promised.
    """
    predictor = read_predictor(file)
    if level is not None:
        predictor.check_level(level, kind)
    band = None if level is None else BandSettings(level, kind, rate)
    dataset = read_or_import(log, mapping)
    vessel, step = predictor.vessel, predictor.physics.step
    names = list(map(str, dataset.frame.columns))
    if vessel is not None:
        check_columns(vessel, names, str(log))
    if every is not None and not every > 0:
        raise DataError(f"{every:g}: must be above 0", path="--every")
    instants, points, skipped = [], [], 0
    for run, piece in stretches_of_runs(dataset):
        rows, early = _due_rows(piece["t"].to_numpy(), every or step, predictor.past * step)
        skipped += early
        if len(rows):
            forecast, latency = _forecast_row_by_row(predictor, dataset, piece, rows, band)
            path, seen = tables_along(predictor, run, piece, forecast, band)
            points.append(path)
            instants.append(seen.assign(latency=latency))
    if not instants:
        past = f"the past of {predictor.past * step:g} s that the predictor needs"
        raise DataError(f"no instant has {past}: runs are shorter, or --every is longer", file=log)
    return Replay(
        pd.concat(instants, ignore_index=True),
        pd.concat(points, ignore_index=True),
        step,
        predictor.physics.horizon,
        skipped,
        () if vessel is None else tuple(missing_columns(vessel, names)),
        predictor.commands == "known",
        band,
        dataset.frame[TRACK_COLUMNS],
        gaps_in_words(dataset, step),
        coarse_in_words(dataset, step),
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
    forecasts, latency = [], []
    for i in rows:
        begin = time.perf_counter()
        known = instants_along(predictor, dataset, piece.iloc[: i + 1], slice(i, i + 1), plan=False)
        forecasts.append(predict_instants(predictor, known, band))
        latency.append(time.perf_counter() - begin)
    regions = [one.region for one in forecasts if one.region is not None]
    names = ("ahead", "along", "across")
    parts = [np.concatenate([getattr(region, name) for region in regions], axis=1) for name in names] if regions else []
    return Forecast(
        np.concatenate([one.predicted for one in forecasts], axis=1),
        np.concatenate([one.alone for one in forecasts], axis=1),
        Region(*parts) if regions else None,
        np.concatenate([one.outside for one in forecasts]),
        {name: np.concatenate([one.columns[name] for one in forecasts]) for name in forecasts[0].columns},
    ), latency


def write_replay_points(played: Replay, file: Path) -> None:
    """Write every point with the alarm and the latency of its instant."""
    check_table(file)
    kept = played.instants.drop(columns=["error", "reach"], errors="ignore").rename(columns={"factor": "band_factor"})
    write_table(file, played.points.merge(kept, on=["run", "t"], how="left"))


def replay_summary(played: Replay) -> list[SummaryLine]:
    """Summary of a replay, as lines that say what they are about."""
    instants, points = played.instants, played.points
    runs, outside = instants["run"].nunique(), instants["outside"].to_numpy(dtype=bool)
    early = f"{played.skipped} {plural_word(played.skipped, 'instant')} before there was a past"
    many = f"{len(instants)} {plural_word(len(instants), 'prediction')} in {runs} {plural_word(runs, 'run')}"
    lines = [SummaryLine("predictions", f"{many}, {played.horizon * played.step:g} s ahead; {early}")]
    limits = (
        f"not in the log, taken as 0: {', '.join(played.assumed)}" if played.assumed else "",
        played.coarse,
        f"{played.gaps}: no errors there, and a past over one of them is interpolated" if played.gaps else "",
        "the plan was: orders stay as they are, since at sea later orders are not known" if played.plan else "",
    )
    lines += [SummaryLine("limit", text) for text in limits if text]
    latency = 1e3 * instants["latency"].to_numpy()
    words = f"latency: median {np.median(latency):.1f} ms, 99 % below {np.quantile(latency, 0.99):.1f} ms"
    lines.append(SummaryLine("detail", words))
    share = f"{outside.sum()} of {len(outside)} instants ({percent_text(outside.mean())})"
    lines.append(SummaryLine("alarm", f"alarm: at {share} outside of the training"))
    lines += [SummaryLine("detail", text) for text in _longest_alarms(instants)]
    for place, text in enumerate(_band_lines(played)):
        lines.append(SummaryLine("detail" if place else "band", text))
    table = ["error where the log goes on [m]:  ahead   median   90 %   worst   median in alarm"]
    merged = points.merge(instants[["run", "t", "outside"]], on=["run", "t"])
    for moment in _moments_of_summary(points):
        here = merged[(merged["ahead"] == moment) & merged["error"].notna()]
        if len(here):
            error, alarm = here["error"].to_numpy(), here["outside"].to_numpy(dtype=bool)
            median, most, worst = map(length_text, (np.median(error), np.quantile(error, 0.9), error.max()))
            inside = length_text(np.median(error[alarm])) if alarm.any() else "-"
            table.append(f"{moment:>36g} s {median:>8} {most:>6} {worst:>7} {inside:>10}")
    return [*lines, *(SummaryLine("detail", text) for text in table)]


def _band_lines(played: Replay) -> list[str]:
    """How often the band held whole paths, then by how much it adapted and its size ahead; none without a band."""
    if played.band is None:
        return []
    why = f"{ORDERS_UNKNOWN}, or {SHIP_CHANGED}" if played.plan else SHIP_CHANGED
    lines = [_band_in_words(played.instants, played.band, why)]
    if played.band.rate is not None:
        factors = played.instants["factor"]
        ends = factors.groupby(played.instants["run"], sort=False).last()[:5]
        last = ", ".join(f"{run} {value:.2f}" for run, value in ends.items())
        lines.append(f"  times the calibrated one: {factors.min():.2f} to {factors.max():.2f}; at the end: {last}")
    points, none = played.points, []
    for moment in _moments_of_summary(points):
        here = points[points["ahead"] == moment]
        along, across = (float(np.median(here[name])) for name in ("band_along", "band_across"))
        if max(along, across) > SPEED_LIMIT * moment:
            none.append(f"{moment:g}")
            continue
        words = f"{length_text(along)} m along the track, {length_text(across)} m across (median)"
        lines.append(f"  {moment:g} s ahead: {words}")
    if none:
        why = "it is wider than a ship can go in that time, as where an input that did not vary in training now does"
        lines.append(f"  {join_names(none)} s ahead: no useful band: {why}")
    return lines


def _band_in_words(instants: pd.DataFrame, band: BandSettings, why: str) -> str:
    """How often the band held the whole paths that can be judged, and why if that is fewer than was promised."""
    reach, outside = instants["reach"].to_numpy(), instants["outside"].to_numpy(dtype=bool)
    judged = np.isfinite(reach)
    promised = judged & ~outside
    if not judged.any():
        return f"band of {level_text(band.level)}: no whole path can be judged, the log ends before"
    held = reach <= instants["factor"].to_numpy()
    of = "" if band.kind is None else f" of the kind {band.kind!r}"
    adapts = "" if band.rate is None else f", adapting at {band.rate:g}"
    inside = "all in alarm, where nothing is promised"
    if promised.any():
        inside = f"{percent_text(held[promised].mean())} of the {promised.sum()} without alarm, where it is promised"
    line = (
        f"band of {level_text(band.level)}{of}{adapts}: it held {percent_text(held[judged].mean())} of the "
        f"{judged.sum()} whole paths that can be judged, {inside}"
    )
    if promised.any() and share_interval(held[promised], instants["run"].to_numpy()[promised])[1] < band.level:
        line += f"; that is fewer than {level_text(band.level)} by more than chance: {why}"
    return line


def _moments_of_summary(points: pd.DataFrame) -> Array:
    """Some moments of the horizon, from the first to the last."""
    ahead = np.unique(points["ahead"])
    moments: Array = ahead[np.unique(np.linspace(0, len(ahead) - 1, MOMENTS_IN_SUMMARY).round().astype(int))]
    return moments


def _longest_alarms(instants: pd.DataFrame, most: int = 5) -> list[str]:
    """The longest times of alarm."""
    spans: list[tuple[float, str, float, float]] = []
    for run, rows in instants.groupby("run", sort=False):
        t, outside = rows["t"].to_numpy(), rows["outside"].to_numpy(dtype=bool)
        edges = np.flatnonzero(np.diff(np.r_[False, outside, False].astype(int)))
        spans += [(t[b - 1] - t[a], str(run), t[a], t[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    spans.sort(key=lambda span: -span[0])
    lines = [f"  {run}: from {format_span(first, last)}" for _, run, first, last in spans[:most]]
    return [*lines, f"  and {len(spans) - most} shorter ones"] if len(spans) > most else lines
