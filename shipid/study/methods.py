"""Methods on the same cells: their errors, price and failures, and what one gains on another over test manoeuvres."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from shipid.arguments import of_class
from shipid.metrics import over_time, position_error
from shipid.study.declared import NO_MODEL
from shipid.study.evidence import ROUNDING, contrasts, mean_errors, over_worlds, training_error
from shipid.study.plan import judged_method, learns_from_runs
from shipid.study.results import Results

EVERY = "with physics"  # all families but `none` and those that saw the test runs
COLUMNS = [
    *("condition", "family", "N_D", "method", "cells", "failed", "missing"),
    *("H", "H_low", "H_high", "H_90", "end", "seconds", "trials"),
    *("reference", "pairs", "difference", "low", "high", "runs", "better"),
    *("worlds", "least", "greatest", "world_low", "world_high"),
    "ahead",
]


def compare_methods(results: Results) -> pd.DataFrame:
    """Compare the methods of a run: a row per family, N_D and method, in the columns of `compared`.

    The family `with physics` is the mean over all families but `none` and those that saw the test runs. The difference
    is that to the method by which the study judges. To choose the lowest H of a test chooses by the test: the interval
    does not count that.

    Raises ShipidError for results that are none.
    """
    of_class("results", results, Results, "as of `read_results`")
    return compared(method_cells(results), judged_method(results.plan))


def methods_frame(results: Results) -> pd.DataFrame:
    """Compare the methods of one run, see `compared`; no rows where fewer than two learn from data."""
    if sum(way.method.compensates for way in results.plan.methods) < 2:
        return pd.DataFrame(columns=COLUMNS)
    return compare_methods(results)


def method_cells(results: Results, condition: str = "", world: str = "") -> pd.DataFrame:
    """A row per cell, as `compared` takes it.

    Columns: condition, world, foundation, family, method, N_D, seed, status, H, H_90, end (mean error at the end of the
    horizon) [m], seconds (core-seconds), trials, trained (whether other training runs would change the prediction),
    saw_test (whether the numbers of the family rest on test runs), and `sums`, `counts`: test run -> sum over its
    windows of the mean error over the horizon [m], and number of windows. Without a result the errors are not numbers.
    """
    runs, place = np.unique(results.test.run, return_inverse=True)
    saw = results.saw_test
    counts = {str(run): int(count) for run, count in zip(runs, np.bincount(place), strict=True)}
    rows = []
    for row in results.rows:
        kept = {name: row[name] for name in ("foundation", "family", "method", "N_D", "seed", "status", "H", "H_90")}
        kept |= {"condition": condition, "world": world, "end": np.nan, "sums": {}, "counts": counts}
        kept |= {"seconds": row["seconds"], "trials": len(row["trials"]), "saw_test": row["family"] in saw}
        kept["trained"] = learns_from_runs(results.plan, row["family"], row["method"])
        if row["cell"] in results.paths:
            error = position_error(results.paths[row["cell"]], results.test.future)
            sums = np.bincount(place, over_time(error))
            kept |= {"end": float(error[-1].mean()), "sums": dict(zip(map(str, runs), sums, strict=True))}
        rows.append(kept)
    return pd.DataFrame(rows)


def compared(cells: pd.DataFrame, reference: str) -> pd.DataFrame:
    """Compare methods by condition, family and N_D; cells as of `method_cells`, of one or several worlds.

    H, H_90, end [m], seconds [s] and trials are means over the cells of a method that have a result; `failed` counts
    the others, and `missing` also the cells of other methods that this one does not have, since it does not run on
    their model: means of methods are over the same cells where both have 0. `H_low`, `H_high`: 95 % interval of H over
    test runs, without what another training would give; not a number with fewer than five. `difference` is H less that
    of the method `reference` over the `pairs` of cells in which both have one, every cell with the same weight, with a
    95 % interval `low`, `high` as of `contrasts`, over test runs: all windows and cells of a run, in its world, are
    drawn together, and what another training would give is in it. `better` counts test runs with a lower error.
    `least`, `greatest`: the difference by world; `world_low`, `world_high`: Student's 95 % interval over worlds, from
    three on. `ahead` names the methods that err less over the cells that both have. The family `with physics` is all of
    them but `none` and those that saw the test runs.
    """
    frames = [cells, cells[cells["family"].ne(NO_MODEL) & ~cells["saw_test"]].assign(family=EVERY)]
    every = pd.concat([frame for frame in frames if len(frame)], ignore_index=True)
    rows = []
    for (condition, family, N_D), group in every.groupby(["condition", "family", "N_D"], sort=False):
        by_method = {str(name): _by_key(mine) for name, mine in group.groupby("method", sort=False)}
        every_cell = len(group.drop_duplicates(["world", "foundation", "seed"]))
        for method, mine in group.groupby("method", sort=False):
            good = mine[mine["status"] == "ok"]
            row: dict[str, Any] = {"condition": condition, "family": family, "N_D": N_D, "method": method}
            row |= {"cells": len(mine), "failed": len(mine) - len(good), "missing": every_cell - len(good)}
            row["reference"] = reference
            row |= {name: good[name].astype(float).mean() for name in ("H", "H_90", "end")}
            row |= {name: mine[name].astype(float).mean() for name in ("seconds", "trials")}
            errors = by_method[str(method)]
            row["ahead"] = ", ".join(name for name, theirs in by_method.items() if _errs_less(theirs, errors))
            rows.append(row | _interval(errors) | _difference(errors, by_method.get(reference, {})))
    return pd.DataFrame(rows, columns=COLUMNS)


def _by_key(cells: pd.DataFrame) -> dict[tuple[str, str, int], Mapping[str, Any]]:
    good = cells[cells["status"] == "ok"].to_dict("records")
    return {(row["world"], row["foundation"], row["seed"]): {str(k): v for k, v in row.items()} for row in good}


def _errs_less(one: Mapping[Any, Mapping[str, Any]], other: Mapping[Any, Mapping[str, Any]]) -> bool:
    """Whether the mean H of one method is lower over the cells that both have, by more than rounding."""
    both = one.keys() & other.keys()
    return math.fsum(one[key]["H"] for key in both) < (1 - ROUNDING) * math.fsum(other[key]["H"] for key in both)


def _interval(mine: Mapping[Any, Mapping[str, Any]]) -> dict[str, float]:
    """95 % interval of the mean error over test runs, each drawn with all its windows and cells."""
    if not mine:
        return {"H_low": np.nan, "H_high": np.nan}
    sums, counts = _by_run({key: (cell["sums"], cell["counts"]) for key, cell in mine.items()})
    values, weights = np.array(list(sums.values())), np.array(list(counts.values()), dtype=float)
    judged = mean_errors((values / weights)[None, :], weights)
    return {"H_low": float(judged.low[0]), "H_high": float(judged.high[0])}


def _by_run(
    cells: Mapping[tuple[str, str, int], tuple[Mapping[str, float], Mapping[str, int]]],
) -> tuple[dict[tuple[str, str], float], dict[tuple[str, str], float]]:
    """Sums and weights of cells added up: (world, test run) -> sum [m], and -> share of the windows of its cells.

    Every cell weighs 1, as in the mean of H: a part of a study with a long test run is no more than one with a short.
    """
    sums: dict[tuple[str, str], float] = {}
    shares: dict[tuple[str, str], float] = {}
    for (world, *_), (added, windows) in cells.items():
        total = sum(windows.values())
        for run, count in windows.items():
            place = world, run
            sums[place] = sums.get(place, 0.0) + added[run] / total
            shares[place] = shares.get(place, 0.0) + count / total
    return sums, shares


def _difference(mine: Mapping[Any, Mapping[str, Any]], theirs: Mapping[Any, Mapping[str, Any]]) -> dict[str, Any]:
    """Difference of H over the cells that both have, its intervals, over test runs and over worlds."""
    keys = [key for key in mine if key in theirs]
    less = {key: {run: mine[key]["sums"][run] - theirs[key]["sums"][run] for run in mine[key]["sums"]} for key in keys}
    sums, counts = _by_run({key: (less[key], mine[key]["counts"]) for key in keys})
    blank = dict.fromkeys(("difference", "low", "high", "least", "greatest", "world_low", "world_high"), np.nan)
    row = {**blank, "pairs": len(keys), "runs": len(sums), "better": 0, "worlds": 0}
    if not keys:
        return row
    values, weights = np.array(list(sums.values())), np.array(list(counts.values()), dtype=float)
    training = math.hypot(*(_training(side, keys, less) for side in (mine, theirs)))
    judged = contrasts((values / weights)[None, :], weights, training)
    worlds = list(dict.fromkeys(world for world, _ in sums))
    means = np.array([_mean(sums, counts, world) for world in worlds])
    row |= {"difference": float(values.sum() / weights.sum()), "worlds": len(worlds)}
    row |= {"low": float(judged.low[0]), "high": float(judged.high[0])}
    row |= {"better": int((values < 0).sum()), "least": float(means.min()), "greatest": float(means.max())}
    row["world_low"], row["world_high"] = over_worlds(means)
    return row


def _training(
    cells: Mapping[Any, Mapping[str, Any]],
    keys: Sequence[tuple[str, str, int]],
    less: Mapping[Any, Mapping[str, float]],
) -> float:
    """Standard error [m] that training alone gives the mean H of some cells; what is alike in both adds nothing."""
    models: dict[tuple[str, str], list[tuple[str, str, int]]] = {}
    for key in keys:
        models.setdefault(key[:2], []).append(key)
    H = [np.array([cells[key]["H"] for key in model], dtype=float) for model in models.values()]
    moved = [
        np.array([cells[key]["trained"] and any(less[key].values()) for key in model], dtype=bool)
        for model in models.values()
    ]
    return training_error(H, moved)


def _mean(sums: Mapping[tuple[str, str], float], counts: Mapping[tuple[str, str], float], world: str) -> float:
    mine = [key for key in sums if key[0] == world]
    return sum(sums[key] for key in mine) / sum(counts[key] for key in mine)


def joined(cells: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """Cells of several parts, one below the other."""
    return pd.concat(list(cells), ignore_index=True)
