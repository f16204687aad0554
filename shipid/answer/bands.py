"""Bands of a study: what share of test paths they hold.

A share, or coverage, is the mean over runs: a long run counts as much as a short one, as the promise does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from shipid.answer.verdict import least_to_greatest, model_list
from shipid.evidence import share_interval
from shipid.hybrid.bands import Region
from shipid.metrics import coverage_share
from shipid.predictor import NO_BAND, Array
from shipid.report.wording import join_few_names, metres_text
from shipid.study.results import Results
from shipid.units import level_text, percent_text, plural_word

REPORTED_LEVELS = (0.5, 0.8, 0.9, 0.95)
"""Nominal levels that the report compares with what was measured."""


def cell_regions(
    results: Results, levels: Sequence[float]
) -> Iterator[tuple[Mapping[str, Any], dict[float, Region], Array]]:
    """Row, region by level and errors (T, S, 2) [m] of every cell whose band promises a level."""
    for row in results.rows:
        bands = results.bands.get(row["cell"])
        if bands is not None and any(bands.promises(level) for level in levels):
            paths, test = results.paths[row["cell"]], results.test
            kept, given = filter(bands.promises, levels), (paths, test.columns, test.step)
            size = bands.growth(*given, test.past)
            by_level = {level: bands.region(*given, level, size=size) for level in kept}
            yield row, by_level, test.future - paths


def coverage_frame(results: Results) -> pd.DataFrame:
    """Share of whole test paths in their bands, by model, N_D and level, over seeds.

    Columns: model, family, N_D, level, coverage, low, high (95 % interval, clustered by run), width [m] (mean radius),
    end [m] (at the end of the horizon), runs (test runs), seeds.
    """
    run, count = results.test.run, len(results.test.spans)
    levels = sorted({*REPORTED_LEVELS, results.plan.study.bands.level})
    parts: dict[tuple[float, str, str, int], list[tuple[Array, float, float]]] = {}
    for row, by_level, errors in cell_regions(results, levels):
        for level, region in by_level.items():
            sizes = float(region.radius.mean()), float(region.radius[-1].mean())
            key = level, row["model"], row["family"], int(row["N_D"])
            parts.setdefault(key, []).append((region.holds(errors), *sizes))
    rows = []
    for (level, model, family, N_D), seeds in sorted(parts.items(), key=lambda part: part[0][0]):
        inside, widths, ends = zip(*seeds, strict=True)  # seeds predict the same windows: no further evidence
        held, width, end = np.mean(inside, axis=0), np.mean(widths), np.mean(ends)
        numbers = coverage_share(held, run), *share_interval(held, run), width, end
        rows.append((model, family, N_D, level, *numbers, count, len(seeds)))
    columns = ["model", "family", "N_D", "level", "coverage", "low", "high", "width", "end", "runs", "seeds"]
    return pd.DataFrame(rows, columns=columns)


def answer_on_bands(results: Results, coverage: pd.DataFrame) -> list[tuple[str, str]]:
    """What bands promise and held, and for which manoeuvres they promise nothing, each with the anchor of its figure.

    Means over the models at the largest N_D with bands, without families set from test runs. coverage :
    `coverage_frame`.
    """
    level = results.plan.study.bands.level
    mine = coverage[coverage["level"].eq(level) & ~coverage["family"].isin(results.saw_test)]
    if mine.empty:
        refused = refused_frame(results).groupby("reason", sort=False)["model"]
        each = [f"{str(reason).removeprefix(NO_BAND)} ({model_list(map(str, models))})" for reason, models in refused]
        return [(f"No band is promised: {'; '.join(each)}.", "cells")] if each else []
    top = mine[mine["N_D"] == mine["N_D"].max()]
    share, low, high = map(percent_text, (top["coverage"].mean(), top["low"].min(), top["high"].max()))
    radius = least_to_greatest(metres_text(top["width"].min()), metres_text(top["width"].max()))
    cells = results.cells[results.cells["model"].isin(top["model"]) & results.cells["N_D"].isin(top["N_D"])]
    data = f"{of_methods(results, [*cells['method'].unique()])} with {top['N_D'].iloc[0]} runs; 95 % interval"
    mean = f"mean of {len(top)} models{data}s of single models lie in" if len(top) > 1 else data.lstrip()
    sentence = (
        f"Bands of {level_text(level)} held {share} of the whole test paths ({mean} {low} to {high}); their mean "
        f"radius is {radius}."
    )
    new = sorted(uncalibrated_kinds(results, cells["cell"]))
    text = f"Nothing is promised for {join_few_names(new)}: no such run calibrated the bands."
    return [(sentence, "coverage"), *([(text, "coverage")] if new else [])]


def uncalibrated_kinds(results: Results, cells: Iterable[str]) -> set[str]:
    """Kinds of manoeuvre of test runs that no run of calibration has, for a band of some cells: nothing is promised."""
    known = [results.bands[cell].kinds for cell in cells if cell in results.bands and results.bands[cell].kinds]
    return {kind for kind in results.kinds.values() if not all(kind in kinds for kinds in known)}


def of_methods(results: Results, names: Sequence[str]) -> str:
    """Say whose bands are meant, ` of the method 'drawn'`; nothing in a study of one method."""
    if len(results.plan.methods) == 1:
        return ""
    return f" of the {plural_word(len(names), 'method')} {join_few_names([repr(str(name)) for name in names])}"


def refused_frame(results: Results) -> pd.DataFrame:
    """Models without a band of the study's level at the largest N_D, and why: model, N_D, reason."""
    done = results.cells[results.cells["status"] == "ok"]
    refused = done[(done["N_D"] == done["N_D"].max()) & done["cell"].isin(list(results.no_band))]
    frame: pd.DataFrame = refused[["model", "N_D"]].assign(reason=refused["cell"].map(dict(results.no_band)))
    return frame.drop_duplicates(ignore_index=True)
