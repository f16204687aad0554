"""Bands of a study: what share of test paths they hold, by model, kind of manoeuvre and step.

A share, or coverage, is the mean over runs: a long run counts as much as a short one, as the promise does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd

from shipid.answer.verdict import count_runs, least_to_greatest, length_in_metres, model_list
from shipid.evidence import share_interval
from shipid.hybrid.bands import Region
from shipid.metrics import coverage_share
from shipid.predictor import NO_BAND
from shipid.report.wording import join_few_names
from shipid.study.results import Results
from shipid.units import level_text, percent_text, plural_word

Array = np.ndarray
REPORTED_LEVELS = (0.5, 0.8, 0.9, 0.95)
"""Nominal levels that the report compares with what was measured."""
NEW_KIND = "no run of this kind calibrated the band: nothing is promised"


def cell_regions(
    results: Results, levels: Sequence[float], rows: Sequence[Mapping[str, Any]] | None = None
) -> Iterator[tuple[Mapping[str, Any], dict[float, Region], Array]]:
    """Row, region by level and errors (T, S, 2) [m] of every cell, or of some rows, whose band promises a level."""
    for row in results.rows if rows is None else rows:
        bands = results.bands.get(row["cell"])
        if bands is not None and any(bands.promises(level) for level in levels):
            paths = results.paths[row["cell"]]
            by_level = bands.regions(paths, results.test.columns, results.test.step, levels)
            yield row, by_level, results.test.future - paths


def _largest_regions(results: Results) -> Iterator[tuple[Mapping[str, Any], Region, Array]]:
    """Row, region at the level of the study and errors (T, S, 2) [m] of the cells of the largest N_D and first seed."""
    level, cells = results.plan.study.bands.level, results.cells
    largest, seed = cells["N_D"].max(), cells["seed"].min()
    rows = [row for row in results.rows if row["N_D"] == largest and row["seed"] == seed]
    for row, by_level, errors in cell_regions(results, [level], rows):
        yield row, by_level[level], errors


@lru_cache(maxsize=1)  # the answer and the figures ask for it
def coverage_frame(results: Results) -> pd.DataFrame:
    """Share of whole test paths in their bands, by model, N_D and level, over seeds.

    Columns: model, family, N_D, level, coverage, low, high (95 % interval, clustered by run), width [m] (mean radius
    over the horizon), end [m] (at its end), lengths (the same end in ship lengths), runs (test runs), seeds.
    """
    length, run, count = ship_length(results), results.test.run, len(results.test.spans)
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
        numbers = coverage_share(held, run), *share_interval(held, run), width, end, end / length
        rows.append((model, family, N_D, level, *numbers, count, len(seeds)))
    columns = ["model", "family", "N_D", "level", "coverage", "low", "high", "width", "end", "lengths", "runs", "seeds"]
    return pd.DataFrame(rows, columns=columns)


@lru_cache(maxsize=1)
def groups_frame(results: Results) -> pd.DataFrame:
    """Coverage at the level of the study at the largest N_D, by kind of manoeuvre and time ahead.

    Columns: model, by (`kind`, `ahead`), group, coverage, low, high, width [m], runs (test runs in the group),
    note (a kind that too few runs calibrated). The band is the one for all kinds: the coverage is that
    of a ship whose kind of manoeuvre is not given. By time ahead: share of the positions at that step alone.
    """
    level, test, rows = results.plan.study.bands.level, results.test, []
    kind = np.array([results.kinds[str(run)] for run in test.run])
    steps = np.unique(np.linspace(0, test.horizon - 1, 5).round().astype(int))
    for row, region, errors in _largest_regions(results):
        bands, held, radius = results.bands[row["cell"]], region.holds(errors), region.radius.mean(axis=0)
        reach, everywhere = region.reach(errors) <= 1, np.ones(len(test), dtype=bool)
        groups = []
        for name in map(str, np.unique(kind)):
            known, note = bands.kinds.get(name, 0), ""
            if bands.kinds and not known:
                note = NEW_KIND
            elif not bands.promises(level, name):
                note = f"{count_runs(known)} of this kind calibrated the band: too few"
            groups.append(("kind", name, kind == name, held, radius, note))
        for step in steps:
            label = f"{(step + 1) * test.step:g} s"
            groups.append(("ahead", label, everywhere, reach[step], region.radius[step], ""))
        for by, group, chosen, inside, wide, note in groups:
            run, shares = test.run[chosen], inside[chosen]
            numbers = coverage_share(shares, run), *share_interval(shares, run), float(wide[chosen].mean())
            rows.append((row["model"], by, group, *numbers, len(np.unique(run)), note))
    columns = ["model", "by", "group", "coverage", "low", "high", "width", "runs", "note"]
    return pd.DataFrame(rows, columns=columns)


def answer_on_bands(results: Results) -> list[tuple[str, str]]:
    """What bands promise and held, and for which manoeuvres they promise nothing, each with the anchor of its figure.

    Means over the models at the largest N_D that has bands, without families whose numbers were set from test runs.
    """
    level, frame = results.plan.study.bands.level, coverage_frame(results)
    mine = frame[frame["level"].eq(level) & ~frame["family"].isin(results.saw_test)]
    if mine.empty:
        refused = refused_frame(results).groupby("reason", sort=False)["model"]
        reasons = {str(reason).removeprefix(NO_BAND): model_list(map(str, models)) for reason, models in refused}
        each = [*reasons] if len(reasons) == 1 else [f"{models}: {reason}" for reason, models in reasons.items()]
        return [(f"No band is promised: {'; '.join(each)}.", "cells")] if reasons else []
    top = mine[mine["N_D"] == mine["N_D"].max()]
    share, low, high = (percent_text(float(top[name].mean())) for name in ("coverage", "low", "high"))
    radius = least_to_greatest(length_in_metres(top["width"].min()), length_in_metres(top["width"].max()))
    methods = results.cells["method"][results.cells["model"].isin(top["model"])].unique()
    data = f"{of_methods(results, [*methods])} with {top['N_D'].iloc[0]} runs; 95 % interval"
    mean = f"mean of {len(top)} models{data} of a single model" if len(top) > 1 else data.lstrip()
    sentence = (
        f"Bands of {level_text(level)} held {share} of the whole test paths ({mean} {low} to {high}); their mean "
        f"radius is {radius}."
    )
    groups = groups_frame(results)
    new = set(groups.loc[groups["note"].eq(NEW_KIND), "group"])
    sentences = [(sentence, "coverage")]
    if new:
        text = f"Nothing is promised for {join_few_names(sorted(new))}: no such run calibrated the bands."
        sentences.append((text, "coverage-groups"))
    return sentences


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


def ship_length(results: Results) -> float:
    """Length between perpendiculars, else over all [m], of the first vessel that gives it; not a number without."""
    vessels = [one.base.document.get("particulars", {}) for one in results.plan.foundations if one.base]
    given = (float(known[name]) for known in vessels for name in ("L_pp", "L_oa") if name in known)
    return next(given, float("nan"))
