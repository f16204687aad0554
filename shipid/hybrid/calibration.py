"""Calibration: from errors on runs that a model did not see, to bands that hold their share of paths of a new run.

Windows of one run are alike, runs are exchangeable: each run weighs the same, and what a score is divided by comes from
the other runs. The rank of a window among those of the other runs says which quantile of theirs would have held it; the
radius is the quantile of all windows that would have held the wanted share of the windows of runs left out.

Sources: Lee, Barber and Willett, "Distribution-free inference with hierarchical data" (arXiv 2306.06342); Dunn,
Wasserman and Ramdas, "Distribution-free prediction sets for two-layer hierarchical models" (arXiv 1809.07441); Barber,
Candes, Ramdas and Tibshirani, "Predictive inference with the jackknife+" (Annals of Statistics 2021).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shipid.data.windows import choose_evenly
from shipid.hybrid.bands import (
    FEWEST,
    LEVELS,
    TRAITS,
    Bands,
    FastMotion,
    fast_power,
    nearest_distances,
    path_chords,
    prediction_traits,
    split_along_track,
    track_directions,
)
from shipid.hybrid.features import MOTIONS
from shipid.metrics import Array, vector_lengths

FLOOR = 0.3  # of the greatest scale: the motion of waves early in the horizon does not decide about a path
CENTRES = 128  # points of training that the distance is measured from, about
WINDOWS = 60  # of a run that calibrate, at most
FEWEST_PAST_ROWS = 8  # of a past in which fast motion can be told from manoeuvres
WIDER = 1.1  # times the band without, that growth with fast motion costs on average under the law of training
PRIOR = 0.3  # standard deviation of a slope: how strongly one trait is believed to matter, as a logarithm


@dataclass(frozen=True)
class RunShares:
    """Windows (S,) sorted into G runs.

    place : index of the run of each window. weight : of each window, (S,), the same sum for each run, 1 in all.
    """

    place: NDArray[np.int64]
    weight: Array
    count: int

    @cached_property
    def sizes(self) -> NDArray[np.int64]:
        """Number of windows of each run, (G,)."""
        return np.bincount(self.place, minlength=self.count)

    def means(self, values: Array) -> Array:
        """Means (G, ...) over the windows of each run, of values (S, ...)."""
        order = np.argsort(self.place, kind="stable")
        sums: Array = np.add.reduceat(values[order], np.cumsum(self.sizes) - self.sizes, axis=0)
        return sums / self.sizes.reshape(-1, *[1] * (values.ndim - 1))


def calibrate_bands(
    left_out: Array,
    future: Array,
    run: NDArray[np.str_],
    columns: Mapping[str, Array],
    names: Sequence[str],
    step: float,
    kinds: Mapping[str, str] | None = None,
    past: Mapping[str, Array] | None = None,
) -> Bands | None:
    """Calibrate bands; None where fewer than three runs have errors.

    left_out : errors (T, S, 2) [m], true less predicted, of models that saw the run of the window neither in training
        nor in any choice; windows with values that are not finite do not count.
    future : true paths (T, S, 2) [m] in the frame (11). run : name of the run of each window, (S,).
    columns : measured columns at the instants, name -> (S,). names : those in which the distance is measured.
    step : of the path [s]. kinds : kind of manoeuvre by run, where it is known.
    past : name -> (P, S), as predictions will have it.
    """
    chosen = _pick_over_runs(run, np.all(np.isfinite(left_out), axis=(0, 2)))
    runs = shares_of_runs(run[chosen])
    if runs.count < FEWEST:
        return None
    errors = left_out[:, chosen]
    paths = future[:, chosen] - errors
    before = {name: values[:, chosen] for name, values in (past or {}).items() if name in MOTIONS}
    columns = {name: np.asarray(columns[name], dtype=float)[chosen] for name in {*names, "r", *before}}
    centres, spread, away = _training_distances(runs, np.stack([columns[name] for name in names], axis=1))
    far = max(float(away.max()), 1e-9)
    length = max(float(np.hypot(*path_chords(paths)).sum(axis=0) @ runs.weight), 1e-9)
    seen = prediction_traits(paths, columns, step, away, length)
    middle = runs.weight @ seen
    deviation = np.sqrt(runs.weight @ (seen - middle) ** 2)
    deviation = np.where(deviation > 1e-9, deviation, 1.0)
    normal = (seen - middle) / deviation
    apart = np.stack(
        [np.abs(part) for part in split_along_track(errors, track_directions(paths))], axis=-1
    )  # (T, S, 2)
    scale, slopes, fitted = _fit_scores(runs, apart, normal)
    whole = band_radii(fitted.max(axis=0), runs)
    of = np.array([(kinds or {}).get(str(name), "") for name in np.unique(run[chosen])])
    known = {str(kind): int((of == kind).sum()) for kind in np.unique(of) if kind}
    of, growth = of[runs.place], np.exp(normal @ slopes)
    by_kind, scales = (np.repeat(table[None], len(known), axis=0) for table in (whole, scale))
    for place, kind in enumerate(known):
        if known[kind] >= FEWEST:  # of fewer runs no band is promised, whatever is here
            mine = of == kind
            same = shares_of_runs(runs.place[mine])
            scales[place], scores = _scale_errors(same, apart[:, mine])
            by_kind[place] = band_radii(scores.max(axis=0) / growth[mine], same)
    return Bands(
        runs=runs.count,
        along=scale[:, 0],
        across=scale[:, 1],
        whole=whole,
        steps=np.stack([band_radii(row, runs) for row in fitted], axis=1),
        names=tuple(names),
        centres=centres,
        spread=spread,
        far=far,
        middle=middle,
        deviation=deviation,
        low=seen.min(axis=0),
        high=seen.max(axis=0),
        slopes=slopes,
        length=length,
        kinds=known,
        by_kind=by_kind,
        scales=scales,
        fast=_fit_fast_motion(runs, columns, before, growth),
    )


def _fit_fast_motion(
    runs: RunShares, columns: Mapping[str, Array], past: Mapping[str, Array], size: Array
) -> FastMotion | None:
    """Growth with fast motion, from a level on at which bands of size (S,) are as much wider as they may be.

    None where the past is too short or not known.
    """
    rows = len(past.get("u", ()))
    if rows < FEWEST_PAST_ROWS or not all(np.isfinite(values).all() for values in past.values()):
        return None
    power = fast_power(columns, past, rows)
    mean = runs.weight @ power
    weights = np.divide(1.0, mean, out=np.zeros(len(mean)), where=mean > 1e-20 * mean.max())
    root = np.sqrt((power * weights).max(axis=1))
    order = np.argsort(root)
    root, share = np.maximum(root[order], 1e-6), (runs.weight * size)[order]
    below, above = np.cumsum(share), np.cumsum((share * root)[::-1])[::-1]
    start = root[np.argmax(below - share + above / root <= WIDER * below[-1])]
    return FastMotion(rows, weights / start**2)


def band_radii(scores: Array, runs: RunShares) -> Array:
    """Radii (99,) that hold a share `LEVELS` of the windows of a new run, from scores (S,) of the windows of G runs."""
    order = np.argsort(scores, kind="stable")
    ranks = _ranks_among_others(order, runs)
    rising_ranks = np.argsort(ranks, kind="stable")
    at = np.cumsum(runs.weight[rising_ranks]) - runs.weight[rising_ranks] / 2
    wanted = np.interp(LEVELS, at, ranks[rising_ranks])
    # Where windows of a run are nearly one window, the new run may also fall between two others: (G + 1) level.
    wanted = np.clip(wanted + _intraclass_correlation(ranks, runs) ** 2 * (LEVELS - 0.5) / (runs.count - 1), 0.0, 1.0)
    weights = runs.weight[order]
    at = np.cumsum(weights) - weights / 2
    at = (at - at[0]) / (at[-1] - at[0]) if at[-1] > at[0] else at
    return np.asarray(np.maximum.accumulate(np.interp(wanted, at, scores[order])))


def _ranks_among_others(order: NDArray[np.int64], runs: RunShares) -> Array:
    """Share (S,) of the windows of the other runs, each run weighing the same, that come before in an order."""
    below = np.empty(len(order))
    below[order] = np.cumsum(runs.weight[order]) - runs.weight[order]  # of all
    by_run = order[np.argsort(runs.place[order], kind="stable")]
    sizes, mine = runs.sizes[runs.place], np.empty(len(order))
    starts = (np.cumsum(runs.sizes) - runs.sizes)[runs.place]
    mine[by_run] = (np.arange(len(order)) - starts[by_run]) / sizes[by_run]
    return np.asarray(np.clip((runs.count * below - mine) / (runs.count - 1), 0.0, 1.0))


def _intraclass_correlation(ranks: Array, runs: RunShares) -> float:
    """How alike the windows of one run are, 0 to 1: share of the variance of their ranks that lies between runs."""
    means = runs.means(ranks)
    within = float(runs.weight @ (ranks - means[runs.place]) ** 2)
    sizes = runs.sizes
    within *= float(np.mean(sizes / np.maximum(sizes - 1, 1)))
    between = float(means.var(ddof=1)) - within * float(np.mean(1 / sizes))
    total = max(between, 0.0) + within
    return 1.0 if sizes.max() == 1 else max(between, 0.0) / total if total > 0 else 1.0


def _fit_scores(runs: RunShares, apart: Array, normal: Array) -> tuple[Array, Array, Array]:
    """Scale (T, 2) [m] and slopes (5,) of the growth from all runs, and scores (T, S) by the other runs alone."""
    scale, plain = _scale_errors(runs, apart)
    slopes, without = _growth_slopes(runs, normal, plain.max(axis=0))
    return scale, slopes, plain / np.exp((normal * without[runs.place]).sum(axis=1))


def _scale_errors(runs: RunShares, apart: Array) -> tuple[Array, Array]:
    """Scale (T, 2) [m] from all runs, and errors (T, S) over the scale of the other runs."""
    means = runs.means(apart.transpose(1, 0, 2))  # (G, T, 2)
    total = means.sum(axis=0)
    others = _floor_scale((total - means) / (runs.count - 1))[runs.place].transpose(1, 0, 2)  # (T, S, 2)
    return _floor_scale(total / runs.count), vector_lengths(apart / others)


def _floor_scale(scale: Array) -> Array:
    """Scales (..., T, 2) [m] that are nowhere below a share of the greatest, nor zero."""
    most = scale.max(axis=-2, keepdims=True)
    return np.asarray(np.maximum(scale, np.maximum(FLOOR * most, 1e-9)), dtype=float)


def _growth_slopes(runs: RunShares, normal: Array, scores: Array) -> tuple[Array, Array]:
    """Slopes (5,) of the logarithm of scores (S,) over traits, from all runs, and without each run, (G, 5).

    Ridge regression in which every run counts as one sample. The distance from training makes no band narrower.
    """
    typical = max(float(np.median(scores)), 1e-300)
    target = np.log(np.maximum(scores, 1e-3 * typical))
    full = np.column_stack([np.ones(len(normal)), normal])
    products = runs.means(full[:, :, None] * full[:, None, :])
    rights = runs.means(full * target[:, None])
    noise = max(float(runs.weight @ (target - runs.weight @ target) ** 2), 1e-12)
    penalty = np.diag([0.0, *[noise / PRIOR**2] * len(TRAITS)])

    def solved(product: Array, right: Array) -> Array:
        normal_equations = product + penalty + 1e-9 * np.eye(len(right))
        slopes: Array = np.asarray(np.linalg.solve(normal_equations, right), dtype=float)
        if slopes[-1] >= 0:
            return slopes[1:]
        slopes[:-1], slopes[-1] = np.linalg.solve(normal_equations[:-1, :-1], right[:-1]), 0.0
        return slopes[1:]

    product, right = products.sum(axis=0), rights.sum(axis=0)
    without = [solved(product - products[i], right - rights[i]) for i in range(runs.count)]
    return solved(product, right), np.stack(without)


def _training_distances(runs: RunShares, points: Array) -> tuple[Array, Array, Array]:
    """Centres (m, d) of training windows (S, d), spread (d,) of each column, and distances (S,) from other runs."""
    deviation = np.sqrt(runs.weight @ (points - runs.weight @ points) ** 2)
    spread = np.maximum(deviation, np.maximum(1e-3 * np.abs(points).max(axis=0), 1e-9))
    each = max(-(-CENTRES // runs.count), 1)
    chosen = np.concatenate([choose_evenly(np.flatnonzero(runs.place == one), each) for one in range(runs.count)])
    centres = points[chosen]
    away = nearest_distances(points / spread, centres / spread, runs.place, runs.place[chosen])
    return centres, spread, away


def _pick_over_runs(run: NDArray[np.str_], sound: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Indices of sound windows, at most `WINDOWS` of each run, in order."""
    rows = np.flatnonzero(sound)
    parts = (choose_evenly(rows[run[rows] == name], WINDOWS) for name in np.unique(run[rows]))
    return np.sort(np.concatenate([rows[:0], *parts]))


def shares_of_runs(names: NDArray[np.str_] | NDArray[np.int64]) -> RunShares:
    """Windows sorted by the names of their runs, (S,)."""
    known, place = np.unique(names, return_inverse=True)
    sizes = np.bincount(place, minlength=len(known))
    return RunShares(place, 1.0 / (len(known) * sizes[place]) if len(known) else np.zeros(0), len(known))
