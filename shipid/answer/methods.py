"""Methods on the same cells: their errors, price and failures, and what one gains on another over test manoeuvres."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from shipid.answer.verdict import length_with_interval
from shipid.arguments import as_path, check_class
from shipid.errors import DataError
from shipid.evidence import FEWEST_WORLDS, CellErrors, compare_cells, percent_above, world_interval
from shipid.metrics import PREDICTION_ERRORS, error_of_windows, position_error, summarise_errors
from shipid.report.wording import counted_text, difference_text
from shipid.study.declared import NO_MODEL
from shipid.study.plan import Plan, learns_from_runs, uncounted_families, verdict_method
from shipid.study.results import Results, read_results
from shipid.study.score import RivalPrediction, keep_predictions, kept_predictions, read_predictions

WITH_PHYSICS = "with physics"  # all families but `none`, means, and those that saw the test runs
METHOD_COLUMNS = [
    *("condition", "family", "N_D", "method", "cells", "failed", "missing"),
    *PREDICTION_ERRORS,
    *("seconds", "trials"),
    *("reference", "pairs", "difference", "low", "high", "runs", "better"),
    *("worlds", "least", "greatest", "world_low", "world_high"),
]
ErrorsByCell = Mapping[tuple[str, str, int], CellErrors]  # by world, foundation and seed


def compare_methods(results: Results) -> pd.DataFrame:
    """Compare the methods of a run: a row per family, N_D and method, in the columns of `method_table`.

    The family `with physics` is all but `none`, means, and those that saw the test runs. The difference is to the
    method by which the study judges. No rows where fewer than two methods learn from data. Raises ShipidError for
    results that are none.
    """
    check_class("results", results, Results, "as of `read_results`")
    cells, learning = method_cells(results), {way.name for way in results.plan.methods if way.method.compensates}
    rivals = {*cells["method"]} - {way.name for way in results.plan.methods}
    if len(learning | rivals) < 2:
        return pd.DataFrame(columns=METHOD_COLUMNS)
    return method_table(cells, verdict_method(results.plan))


def score(
    folder: str | os.PathLike[str], predictions: str | os.PathLike[str], *, anyway: bool = False
) -> dict[str, pd.DataFrame]:
    """Score predictions of others on the test windows of a run, and keep them in its folder for its page.

    Parameters
    ----------
    predictions : a Parquet file, see `shipid.study.score.read_predictions`.
    anyway : score predictions that seem to be wrong, too; they are called doubtful.

    Returns for each prediction the table of `method_table` with its differences to this prediction, which is taken as
    it is: its training is not counted.

    Raises DataError for predictions that cannot be scored, one sentence that says why.
    """
    results, file = read_results(folder), as_path("predictions", predictions)
    rivals = read_predictions(file, results)
    if (doubt := next((one.doubt for one in rivals if one.doubt), "")) and not anyway:
        raise DataError(f"{doubt}; if it is meant so, --anyway scores it as doubtful", file=file)
    known = {(one.label, one.N_D, one.seed) for one in kept_predictions(results, but=file.stem)}
    if twice := next((one.label for one in rivals if (one.label, one.N_D, one.seed) in known), ""):
        raise DataError(f"{twice!r} is scored already, from another table: name it otherwise", file=file, path="model")
    keep_predictions(file, results.folder)
    cells, names = method_cells(results), {way.name for way in results.plan.methods}
    return {one.label: method_table(cells[cells["method"].isin({*names, one.label})], one.label) for one in rivals}


def method_cells(results: Results, condition: str = "", world: str = "") -> pd.DataFrame:
    """A row per cell, as `method_table` takes it.

    Columns: condition, world, foundation, family, method, N_D, seed, status, H_end, H_end_90, H, H_90 [m], seconds
    (core-seconds), trials, apart (a mean, or numbers that rest on test runs), errors (`CellErrors` or None).
    """
    apart, rows = {*results.saw_test, *(block.name for block in results.plan.study.model)}, []
    for row in results.rows:
        names = ("foundation", "family", "method", "N_D", "seed", "status", *PREDICTION_ERRORS)
        kept = {
            **{name: row[name] for name in names},
            "condition": condition,
            "world": world,
            "errors": None,
            "seconds": row["seconds"],
            "trials": len(row["trials"]),
            "apart": row["family"] in apart,
        }
        if (cell := row["cell"]) in results.paths:
            learns = learns_from_runs(results.plan, row["family"], row["method"])
            errors, share = results.errors[cell], row["N_D"] / results.pool
            kept["errors"] = CellErrors(
                row["foundation"], errors, results.windows, learns, world, int(row["seed"]), share
            )
        rows.append(kept)
    cells = pd.DataFrame(rows)
    return pd.concat([cells, *(_rival_cells(results, one, cells) for one in kept_predictions(results))])


def _rival_cells(results: Results, one: RivalPrediction, cells: pd.DataFrame) -> pd.DataFrame:
    """A prediction of somebody else beside every cell of its amount of data and seed, or of all: it has no foundation.

    It stands as it is: no other training of it is known.
    """
    error, world = position_error(one.paths, results.test.future), str(cells["world"].iloc[0])
    known: Mapping[str, Any] = summarise_errors(error)
    mine = CellErrors(one.label, results.by_run(error_of_windows(error)), results.windows, False, world)
    cells = cells.drop_duplicates(["foundation", "N_D", "seed"])
    for name, value in (("N_D", one.N_D), ("seed", one.seed)):
        cells = cells if value == -1 else cells[cells[name].eq(value)]
    numbers = {column: known[name] for column, name in PREDICTION_ERRORS.items()}
    numbers |= dict.fromkeys(("seconds", "trials"), np.nan)
    return cells.assign(
        method=one.label, status="ok", errors=pd.Series([mine] * len(cells), cells.index, object), **numbers
    )


def method_table(cells: pd.DataFrame, reference: str) -> pd.DataFrame:
    """Compare methods by condition, family and N_D; cells as of `method_cells`, of one or several worlds.

    H_end, H_end_90, H, H_90 [m], seconds [s] and trials are means over the cells of a method that have a result;
    `failed` counts the others, `missing` also cells that only other methods have. `difference` is by how much H is
    above that of `reference` [%] over the `pairs` of cells in which both have one, `low`, `high` its 95 % interval
    (`compare_cells`); `better` counts test runs with a lower error. `least`, `greatest`, `world_low`, `world_high`: the
    difference over worlds, with Student's interval.
    """
    frames = [cells, cells[cells["family"].ne(NO_MODEL) & ~cells["apart"]].assign(family=WITH_PHYSICS)]
    every = pd.concat([frame for frame in frames if len(frame)], ignore_index=True)
    rows = []
    for (condition, family, N_D), group in every.groupby(["condition", "family", "N_D"], sort=False):
        by_method = {str(name): _errors_by_cell(mine) for name, mine in group.groupby("method", sort=False)}
        every_cell = len(group.drop_duplicates(["world", "foundation", "seed"]))
        for method, mine in group.groupby("method", sort=False):
            good, errors = mine[mine["status"] == "ok"], by_method[str(method)]
            rows.append(
                {
                    "condition": condition,
                    "family": family,
                    "N_D": N_D,
                    "method": method,
                    "cells": len(mine),
                    "failed": len(mine) - len(good),
                    "missing": every_cell - len(good),
                    **{name: good[name].astype(float).mean() for name in PREDICTION_ERRORS},
                    **{name: mine[name].astype(float).mean() for name in ("seconds", "trials")},
                    "reference": reference,
                    **_difference_row(errors, by_method.get(reference, {})),
                }
            )
    return pd.DataFrame(rows, columns=METHOD_COLUMNS)


def sentences_on_worlds(plan: Plan, cells: pd.DataFrame) -> list[str]:
    """Error at the horizon of each family at the least and the largest N_D, over three worlds or more.

    Geometric means of those in each world, with Student's interval: it holds other test runs, training runs, members
    and worlds. cells : as of `method_cells`, of all parts. None where a study repeats other things than its world.
    """
    if set(plan.study.repeat) != {"seed"}:
        return []
    mine = cells[cells["method"].eq(verdict_method(plan)) & ~cells["family"].isin(uncounted_families(plan))]
    mine = mine[mine["status"].eq("ok") & mine["N_D"].isin([cells["N_D"].min(), cells["N_D"].max()])]
    mine = mine.astype({"H_end": float}).sort_values("N_D", ascending=False, kind="stable")  # the largest comes first
    by_world = np.log(mine.groupby(["condition", "N_D", "family", "world"], sort=False)["H_end"].mean())
    sentences, means = [], {block.name for block in plan.study.model}
    for (condition, N_D, family), logs in by_world.groupby(level=[0, 1, 2], sort=False):
        pure, count = (
            by_world[by_world.index.isin([(condition, N_D, NO_MODEL, world) for *_, world in logs.index])],
            len(logs),
        )
        error = length_with_interval(*np.exp([logs.mean(), *world_interval(logs.to_numpy())]))
        kind = "the mean" if family in means else "physics of"
        text = f"With {counted_text(N_D, 'run')}, in the mean of {count} worlds, "
        text += f"{'no physics' if family == NO_MODEL else f'{kind} {family!r}'} errs by {error} at the horizon"
        if family != NO_MODEL and len(pure) == count:
            apart = logs.to_numpy() - pure.to_numpy()
            more, low, high = (percent_above(one) for one in (apart.mean(), *world_interval(apart)))
            text += f". Its difference to no physics is {difference_text(more, low, high, '%')}"
        if count >= FEWEST_WORLDS:
            sentences.append(f"{text} ({condition})." if condition else f"{text}.")
    return sentences


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
    low, high = map(percent_above, world_interval(one.worlds))
    row = {"pairs": len(keys), "difference": one.mean, "low": one.low, "high": one.high, "runs": one.runs}
    row |= {"better": one.better, "worlds": len(one.worlds), "world_low": low, "world_high": high}
    return row | {"least": percent_above(one.worlds.min()), "greatest": percent_above(one.worlds.max())}
