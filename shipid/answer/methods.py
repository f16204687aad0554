"""Methods on the same cells: their errors, price and failures, and what one gains on another over test manoeuvres."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from shipid.arguments import check_class
from shipid.evidence import CellErrors, compare_cells, world_interval
from shipid.study.declared import NO_MODEL
from shipid.study.plan import learns_from_runs, verdict_method
from shipid.study.results import Results

WITH_PHYSICS = "with physics"  # all families but `none` and those that saw the test runs
ERROR_COLUMNS = ("H_end", "H_end_90", "H", "H_90")
METHOD_COLUMNS = [
    *("condition", "family", "N_D", "method", "cells", "failed", "missing"),
    *ERROR_COLUMNS,
    *("seconds", "trials"),
    *("reference", "pairs", "difference", "low", "high", "runs", "better"),
    *("worlds", "least", "greatest", "world_low", "world_high"),
]
ErrorsByCell = Mapping[tuple[str, str, int], CellErrors]  # by world, foundation and seed


def compare_methods(results: Results) -> pd.DataFrame:
    """Compare the methods of a run: a row per family, N_D and method, in the columns of `method_table`.

    The family `with physics` is all but `none` and those that saw the test runs. The difference is to the method by
    which the study judges. No rows where fewer than two methods learn from data. Raises ShipidError for results that
    are none.
    """
    check_class("results", results, Results, "as of `read_results`")
    if sum(way.method.compensates for way in results.plan.methods) < 2:
        return pd.DataFrame(columns=METHOD_COLUMNS)
    return method_table(method_cells(results), verdict_method(results.plan))


def method_cells(results: Results, condition: str = "", world: str = "") -> pd.DataFrame:
    """A row per cell, as `method_table` takes it.

    Columns: condition, world, foundation, family, method, N_D, seed, status, H_end, H_end_90, H, H_90 [m], seconds
    (core-seconds), trials, saw_test (numbers of the family rest on test runs), errors (`CellErrors` or None).
    """
    saw, rows = results.saw_test, []
    for row in results.rows:
        names = ("foundation", "family", "method", "N_D", "seed", "status", *ERROR_COLUMNS)
        kept = {name: row[name] for name in names} | {"condition": condition, "world": world, "errors": None}
        kept |= {"seconds": row["seconds"], "trials": len(row["trials"]), "saw_test": row["family"] in saw}
        if (cell := row["cell"]) in results.paths:
            learns = learns_from_runs(results.plan, row["family"], row["method"])
            kept["errors"] = CellErrors(row["foundation"], results.errors[cell], results.windows, learns, world)
        rows.append(kept)
    return pd.DataFrame(rows)


def method_table(cells: pd.DataFrame, reference: str) -> pd.DataFrame:
    """Compare methods by condition, family and N_D; cells as of `method_cells`, of one or several worlds.

    H_end, H_end_90, H, H_90 [m], seconds [s] and trials are means over the cells of a method that have a result;
    `failed` counts the others, `missing` also cells that only other methods have. `difference` is H less that of
    `reference` over the `pairs` of cells in which both have one, `low`, `high` its 95 % interval (`compare_cells`);
    `better` counts test runs with a lower error. `least`, `greatest`, `world_low`, `world_high`: the difference over
    worlds, with Student's interval.
    """
    frames = [cells, cells[cells["family"].ne(NO_MODEL) & ~cells["saw_test"]].assign(family=WITH_PHYSICS)]
    every = pd.concat([frame for frame in frames if len(frame)], ignore_index=True)
    rows = []
    for (condition, family, N_D), group in every.groupby(["condition", "family", "N_D"], sort=False):
        by_method = {str(name): _errors_by_cell(mine) for name, mine in group.groupby("method", sort=False)}
        every_cell = len(group.drop_duplicates(["world", "foundation", "seed"]))
        for method, mine in group.groupby("method", sort=False):
            good, errors = mine[mine["status"] == "ok"], by_method[str(method)]
            row: dict[str, Any] = {"condition": condition, "family": family, "N_D": N_D, "method": method}
            row |= {"cells": len(mine), "failed": len(mine) - len(good), "missing": every_cell - len(good)}
            row |= {name: good[name].astype(float).mean() for name in ERROR_COLUMNS}
            row |= {name: mine[name].astype(float).mean() for name in ("seconds", "trials")}
            row |= {"reference": reference, **_difference_row(errors, by_method.get(reference, {}))}
            rows.append(row)
    return pd.DataFrame(rows, columns=METHOD_COLUMNS)


def _errors_by_cell(cells: pd.DataFrame) -> ErrorsByCell:
    good = cells[cells["status"] == "ok"]
    keys = zip(good["world"], good["foundation"], good["seed"], strict=True)
    return dict(zip(keys, good["errors"], strict=True))


def _difference_row(mine: ErrorsByCell, others: ErrorsByCell) -> dict[str, Any]:
    """Difference of H over the cells that both have, its intervals, over test runs and over worlds."""
    keys = [key for key in mine if key in others]
    if not keys:
        return {"pairs": 0, "runs": 0, "better": 0, "worlds": 0}
    one = compare_cells([mine[key] for key in keys], [others[key] for key in keys])
    low, high = world_interval(one.worlds)
    row = {"pairs": len(keys), "difference": one.mean, "low": one.low, "high": one.high, "runs": one.runs}
    row |= {"better": one.better, "worlds": len(one.worlds), "world_low": low, "world_high": high}
    return row | {"least": float(one.worlds.min()), "greatest": float(one.worlds.max())}
