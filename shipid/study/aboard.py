"""Play a log as if at sea: rows arrive one by one, and each prediction uses the rows that have arrived."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.causal import causal_columns
from shipid.data.dataset import Dataset, clock_slack, pieces, sample
from shipid.data.windows import (
    Instants,
    coarse_in_words,
    from_frame,
    gaps_in_words,
    past_of,
    true_path,
    without_rows,
)
from shipid.engine.rollout import SPEED_LIMIT
from shipid.errors import DataError
from shipid.evidence import share_interval
from shipid.files import check_table, write_table
from shipid.hybrid.bands import Bands, Region, at_level
from shipid.hybrid.physics import assumed, check_columns
from shipid.logs.dates import span_of
from shipid.metrics import share_of
from shipid.observer import observe
from shipid.predictor import Predictor
from shipid.report.content import Line
from shipid.study.apply import Band, along_run, dataset_of
from shipid.study.prepare import states_along
from shipid.study.store import read_predictor
from shipid.units import length_text, level_text, listed, percent, plural

Array = np.ndarray
TRACK = ["run", "t", "north", "east"]
AHEAD = 5  # moments of the horizon that the summary shows
CHANGED = "the ship, her loading or the weather is not that of the training, and bands do not hold"
UNPLANNED = "later orders were not known as they were in calibration"
STANDARD = (0.5, 0.8, 0.9, 0.95)  # levels that the summary judges beside the one that was asked for


@dataclass(frozen=True, eq=False)
class Played:
    """What would have been seen at sea.

    instants : a row for each prediction: run, t, outside (the alarm), latency [s], and the error at the end of the
        horizon [m]. With a band also factor, by which it was wider than calibrated, and reach, the greatest error of
        the whole path over the band as calibrated; not a number where the log ends before.
    points : a row for each point of each path: run, t, ahead, north, east, physics_north, physics_east, error [m] where
        the log goes on. With a band also band_along, band_across [m], band_course [rad, clockwise from north].
    assumed : what the vessel feels and the log does not hold; it is 0.
    skipped : instants at which a prediction was due before there was a past.
    plan : whether orders were taken as held where the predictor knows a plan.
    band : what was asked of the band; None: none was asked. bands : of the predictor, where it has some.
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
    band: Band | None = None
    bands: Bands | None = None
    track: pd.DataFrame = field(default_factory=lambda: pd.DataFrame(columns=TRACK))
    gaps: str = ""
    coarse: str = ""


def play(
    file: Path,
    log: Path,
    mapping: str | None = None,
    every: float | None = None,
    *,
    level: float | None = None,
    kind: str | None = None,
    rate: float | None = None,
) -> Played:
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
    band = None if level is None else Band(level, kind, rate)
    dataset = dataset_of(log, mapping)
    vessel, step = predictor.vessel, predictor.physics.step
    names = list(map(str, dataset.frame.columns))
    if vessel is not None:
        check_columns(vessel, names, str(log))
    if every is not None and not every > 0:
        raise DataError(f"{every:g}: must be above 0", path="--every")
    rows, paths, skipped = [], [], 0
    for run, piece in pieces(dataset):
        instants = _along(predictor, dataset, run, piece.reset_index(drop=True), every or step, band)
        rows += instants[0]
        paths += instants[1]
        skipped += instants[2]
    if not rows:
        past = predictor.past * step
        if every is not None and any(np.ptp(piece["t"]) >= past for _, piece in pieces(dataset)):
            message = f"{every:g}: no instant so many s apart has the past of {past:g} s that the predictor needs"
            raise DataError(f"{message}: give less, such as {past:g}", path="--every")
        raise DataError(f"no run is as long as the past of {past:g} s that the predictor needs", file=log)
    missing = () if vessel is None else tuple(assumed(vessel, names))
    return Played(
        pd.DataFrame(rows), pd.concat(paths, ignore_index=True), step, predictor.physics.horizon, skipped, missing,
        predictor.commands == "known", band, predictor.bands, dataset.frame[TRACK], gaps_in_words(dataset, step),
        coarse_in_words(dataset, step),
    )  # fmt: skip


def _along(
    predictor: Predictor, dataset: Dataset, run: str, rows: pd.DataFrame, every: float, band: Band | None
) -> tuple[list[dict[str, object]], list[pd.DataFrame], int]:
    """Predictions along one unbroken stretch; at how many instants that were due there was no past yet."""
    t = rows["t"].to_numpy()
    slack = clock_slack(t)
    entries: list[dict[str, Any]] = []
    paths, skipped, due = [], 0, t[0]
    for i in range(len(t)):
        if t[i] < due - slack:
            continue
        due = max(due + every, t[i] + slack)
        if t[i] - t[0] < predictor.past * predictor.physics.step - slack:
            skipped += 1
            continue
        begin = time.perf_counter()
        instants = known_at(predictor, dataset, rows.iloc[: i + 1])
        predicted = predictor.predict(instants)[:, 0]
        alone = predictor.alone(instants)[:, 0] if predictor.vessel is not None else np.full_like(predicted, np.nan)
        region = None if band is None else predictor.band(predicted[:, None], instants, band.level, kind=band.kind)
        latency = time.perf_counter() - begin
        outside = bool(predictor.outside({**instants.columns, **instants.estimates})[0])
        points, error, reach = _judged(predictor, rows, i, predicted, alone, region)
        points.insert(0, "run", run)
        points.insert(1, "t", t[i])
        paths.append(points)
        entries.append({"run": run, "t": float(t[i]), "outside": outside, "latency": latency, "error": error})
        if band is not None:
            entries[-1]["reach"] = reach
    if band is not None and entries:
        _adapt(predictor, entries, paths, band)
    return entries, paths, skipped


def _adapt(predictor: Predictor, instants: list[dict[str, Any]], paths: list[pd.DataFrame], band: Band) -> None:
    """Give each instant the factor of its band, and scale the bands of the paths with it."""
    assert predictor.bands is not None
    factors = np.ones(len(instants))
    if band.rate is not None:
        now = np.array([instant["t"] for instant in instants])
        reach = np.array([instant["reach"] for instant in instants])
        ends = now + predictor.physics.horizon * predictor.physics.step
        factors = along_run(reach, ends, now, band, predictor.bands.table(band.kind))
    for instant, points, factor in zip(instants, paths, factors, strict=True):
        instant["factor"] = float(factor)
        points[["band_along", "band_across"]] *= factor


def known_at(predictor: Predictor, dataset: Dataset, rows: pd.DataFrame) -> Instants:
    """What is known at the last of some rows of one stretch, from them alone.

    Fixes that were interpolated, the past, the actuators and the observer are all taken from these rows.
    """
    physics = predictor.physics
    seen = Dataset(rows.reset_index(drop=True), dataset.metadata)
    if predictor.causal:
        seen = causal_columns(seen, predictor.causal)
    last = seen.frame["t"].to_numpy()[-1:]
    columns = sample(seen.frame, last) | {"t": last}
    hidden = estimates = None
    if predictor.vessel is not None:
        along = states_along(predictor.vessel, dataset.commands, seen.frame)
        hidden = along and {name: values[-1:] for name, values in along.items()}
        if physics.observer is not None:
            observed = observe(predictor.vessel, seen, physics.observer).columns
            estimates = {name: values[-1:] for name, values in observed.items()}
    planned = None
    if predictor.commands == "known":
        planned = {name: np.tile(columns[name], (physics.horizon, 1)) for name in dataset.commands}
    past = past_of(seen.frame, last, predictor.past, physics.step, physics.path)
    return Instants(columns, past, planned, hidden, estimates or {})


def _judged(
    predictor: Predictor, rows: pd.DataFrame, i: int, predicted: Array, alone: Array, region: Region | None
) -> tuple[pd.DataFrame, float, float]:
    """Points of a path in north-east with errors and band, the error at the end, and the greatest over the band.

    What the log does not hold is not a number.
    """
    physics, t = predictor.physics, rows["t"].to_numpy()
    ahead = physics.step * np.arange(1, physics.horizon + 1)
    origin = tuple(float(rows[name].iloc[i]) for name in ("north", "east", "psi"))
    table: dict[str, Array] = {"ahead": ahead}
    for prefix, path in (("", predicted), ("physics_", alone)):
        table[f"{prefix}north"], table[f"{prefix}east"] = from_frame(path[:, 0], path[:, 1], *origin)
    later = t[i] + ahead
    there = (later <= t[-1] + clock_slack(t)) & ~without_rows(t, later, physics.step)
    missed = np.full((physics.horizon, 2), np.nan)
    if there.any():
        shown = np.append(t[i], later[there])
        true = true_path(rows, shown, sample(rows, shown), physics.path, longest=physics.step)[1:]
        missed[there] = true - predicted[there]
    error, reach = np.hypot(*missed.T), np.nan
    if region is not None:
        course = np.arctan2(region.ahead[:, 0, 1], region.ahead[:, 0, 0]) + origin[2]
        table |= {"band_along": region.along[:, 0], "band_across": region.across[:, 0]}
        table["band_course"] = np.mod(course, 2 * np.pi)
        reach = float(region.reach(missed[:, None]).max())
    return pd.DataFrame({**table, "error": error}), float(error[-1]), reach


def write(played: Played, file: Path) -> None:
    """Write every point with the alarm and the latency of its instant."""
    check_table(file)
    kept = played.instants.drop(columns=["error", "reach"], errors="ignore").rename(columns={"factor": "band_factor"})
    write_table(file, played.points.merge(kept, on=["run", "t"], how="left"))


def summary(played: Played) -> list[str]:
    """Summary of a replay, as lines of text."""
    return [line.text for line in summed_up(played)]


def summed_up(played: Played) -> list[Line]:
    """Summary of a replay, as lines that say what they are about."""
    instants, points = played.instants, played.points
    runs, outside = instants["run"].nunique(), instants["outside"].to_numpy(dtype=bool)
    early = f"{played.skipped} {plural(played.skipped, 'instant')} before there was a past"
    many = f"{len(instants)} {plural(len(instants), 'prediction')} in {runs} {plural(runs, 'run')}"
    lines = [Line("predictions", f"{many}, {played.horizon * played.step:g} s ahead; {early}")]
    if played.assumed:
        lines.append(Line("limit", f"not in the log, taken as 0: {', '.join(played.assumed)}"))
    if played.coarse:
        lines.append(Line("limit", played.coarse))
    if played.gaps:
        words = f"{played.gaps}: no errors there, and a past over one of them is interpolated"
        lines.append(Line("limit", words))
    if played.plan:
        words = "the plan was: orders stay as they are, since at sea later orders are not known"
        lines.append(Line("limit", words))
    latency = 1e3 * instants["latency"].to_numpy()
    words = f"latency: median {np.median(latency):.1f} ms, 99 % below {np.quantile(latency, 0.99):.1f} ms"
    lines.append(Line("detail", words))
    share = f"{outside.sum()} of {len(outside)} instants ({percent(outside.mean())})"
    lines.append(Line("alarm", f"alarm: at {share} outside of the training"))
    lines += [Line("detail", text) for text in _spans(instants)]
    for place, text in enumerate(_promise(played)):
        lines.append(Line("detail" if place else "band", text))
    table = ["error where the log goes on [m]:  ahead   median   90 %   worst   median in alarm"]
    merged = points.merge(instants[["run", "t", "outside"]], on=["run", "t"])
    for moment in _moments(points):
        here = merged[(merged["ahead"] == moment) & merged["error"].notna()]
        if len(here):
            error, alarm = here["error"].to_numpy(), here["outside"].to_numpy(dtype=bool)
            median, most, worst = map(length_text, (np.median(error), np.quantile(error, 0.9), error.max()))
            inside = length_text(np.median(error[alarm])) if alarm.any() else "-"
            table.append(f"{moment:>36g} s {median:>8} {most:>6} {worst:>7} {inside:>10}")
    return [*lines, *(Line("detail", text) for text in table)]


def _promise(played: Played) -> list[str]:
    """How often the band held whole paths, then by how much it adapted and its size ahead; none without a band."""
    if played.band is None or played.bands is None:
        return []
    lines = _held(played.instants, played.band, played.bands, f"{UNPLANNED}, or {CHANGED}" if played.plan else CHANGED)
    if played.band.rate is not None:
        factors = played.instants["factor"]
        ends = factors.groupby(played.instants["run"], sort=False).last()[:5]
        last = ", ".join(f"{run} {value:.2f}" for run, value in ends.items())
        lines.append(f"  times the calibrated one: {factors.min():.2f} to {factors.max():.2f}; at the end: {last}")
    points, none = played.points, []
    for moment in _moments(points):
        here = points[points["ahead"] == moment]
        along, across = (float(np.median(here[name])) for name in ("band_along", "band_across"))
        if max(along, across) > SPEED_LIMIT * moment:
            none.append(f"{moment:g}")
            continue
        words = f"{length_text(along)} m along the track, {length_text(across)} m across (median)"
        lines.append(f"  {moment:g} s ahead: {words}")
    if none:
        why = "it is wider than a ship can go in that time, as where an input that did not vary in training now does"
        lines.append(f"  {listed(none)} s ahead: no useful band: {why}")
    return lines


def _held(instants: pd.DataFrame, band: Band, bands: Bands, why: str) -> list[str]:
    """How often the band held the whole paths that can be judged, and why if that is fewer than was promised."""
    reach, outside = instants["reach"].to_numpy(), instants["outside"].to_numpy(dtype=bool)
    judged = np.isfinite(reach)
    promised = judged & ~outside
    if not judged.any():
        return [f"band of {level_text(band.level)}: no whole path can be judged, the log ends before"]
    held = reach <= instants["factor"].to_numpy()
    of = "" if band.kind is None else f" of the kind {band.kind!r}"
    adapts = "" if band.rate is None else f", adapting at {band.rate:g}"
    inside = "all in alarm, where nothing is promised"
    if promised.any():
        inside = f"{percent(held[promised].mean())} of the {promised.sum()} without alarm, where it is promised"
    lines = [
        f"band of {level_text(band.level)}{of}{adapts}: it held {percent(held[judged].mean())} of the {judged.sum()} "
        f"whole paths that can be judged, {inside}"
    ]
    if promised.any():
        run = instants["run"].to_numpy()[promised]
        _, most = share_interval(held[promised], run)
        if most < band.level:
            share = percent(share_of(held[promised], run))
            same = share == percent(held[promised].mean())
            what = "that is" if same else f"in the mean over runs {share}, which is"
            lines[0] += f"; {what} fewer than {level_text(band.level)} by more than chance: {why}"
        lines += _by_level(reach[promised], band, bands)
    return lines


def _by_level(reach: Array, band: Band, bands: Bands) -> list[str]:
    """How often bands of other levels held the paths of a reach, without alarm; none of a band that adapts."""
    table = bands.table(band.kind)
    usual = at_level(table, band.level)
    if band.rate is not None or not usual > 0:
        return []
    levels = sorted(level for level in {*STANDARD, band.level} if bands.promises(level, band.kind))
    shares = (
        f"{level_text(level)} held {percent((reach <= float(at_level(table, level) / usual)).mean())}"
        for level in levels
    )
    return [f"  by level, without alarm: {', '.join(shares)}"] if levels else []


def _moments(points: pd.DataFrame) -> Array:
    """Some moments of the horizon, from the first to the last."""
    ahead = np.unique(points["ahead"])
    moments: Array = ahead[np.unique(np.linspace(0, len(ahead) - 1, AHEAD).round().astype(int))]
    return moments


def _spans(instants: pd.DataFrame, most: int = 5) -> list[str]:
    """The longest times of alarm."""
    spans: list[tuple[float, str, float, float]] = []
    for run, rows in instants.groupby("run", sort=False):
        t, outside = rows["t"].to_numpy(), rows["outside"].to_numpy(dtype=bool)
        edges = np.flatnonzero(np.diff(np.r_[False, outside, False].astype(int)))
        spans += [(t[b - 1] - t[a], str(run), t[a], t[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    spans.sort(key=lambda span: -span[0])
    lines = [f"  {run}: from {span_of(first, last)}" for _, run, first, last in spans[:most]]
    return [*lines, f"  and {len(spans) - most} shorter ones"] if len(spans) > most else lines
