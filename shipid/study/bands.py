"""Bands of a study: what share of test paths they hold, by model, kind of manoeuvre, step, speed and run.

A share, or coverage, is the mean over runs: a long run counts as much as a short one, as the promise does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import betaincinv, stdtrit

from shipid.hybrid.bands import Region
from shipid.metrics import share_of, shares_by_run
from shipid.predictor import NO_BAND
from shipid.report.wording import listed
from shipid.study.results import Results
from shipid.study.verdict import metres, named, runs, span
from shipid.units import level_text, percent, plural

Array = np.ndarray
SHOWN = (0.5, 0.8, 0.9, 0.95)
"""Nominal levels that the report compares with what was measured."""
CONFIDENCE = 0.95
SPEEDS = 3  # groups of equal size
NEW_KIND = "no run of this kind calibrated the band: nothing is promised"


def share_interval(held: Array, run: Array) -> tuple[float, float]:
    """95 % interval of `share_of`, by Clopper and Pearson for so many windows as those of few runs are worth.

    Windows of one run are alike: the number of windows is reduced until their variance is that between runs, and is
    never below the number of runs. Source: Korn and Graubard (1998), Survey Methodology 24. For one window a run it is
    the exact interval.

    Parameters
    ----------
    held : (S,) whether each window lies in its band. run : its run, (S,).
    """
    shares, windows = shares_by_run(held, run), len(held)
    runs, share = len(shares), float(shares.mean())
    count, tail = float(runs), (1 - CONFIDENCE) / 2
    if runs > 1 and 0 < share < 1:
        variance = float(shares.var(ddof=1)) / runs
        freedom = (stdtrit(max(windows - 1, 1), tail) / stdtrit(runs - 1, tail)) ** 2
        count = float(np.clip(freedom * share * (1 - share) / max(variance, 1e-12), runs, windows))
    inside = share * count
    low = 0.0 if inside == 0 else float(betaincinv(inside, count - inside + 1, tail))
    high = 1.0 if inside >= count else float(betaincinv(inside + 1, count - inside, 1 - tail))
    return low, high


def regions(
    results: Results, levels: Sequence[float], rows: Sequence[Mapping[str, Any]] | None = None
) -> Iterator[tuple[Mapping[str, Any], dict[float, Region], Array]]:
    """Row, region by level and errors (T, S, 2) [m] of every cell, or of some rows, whose band promises a level."""
    for row in results.rows if rows is None else rows:
        bands = results.bands.get(row["cell"])
        if bands is not None and any(bands.promises(level) for level in levels):
            paths = results.paths[row["cell"]]
            yield (
                row,
                bands.regions(paths, results.test.columns, results.test.step, levels),
                results.test.future - paths,
            )


def _largest(results: Results) -> Iterator[tuple[Mapping[str, Any], Region, Array]]:
    """Row, region at the level of the study and errors (T, S, 2) [m] of the cells of the largest N_D and first seed."""
    level, cells = results.plan.study.bands.level, results.cells
    largest, seed = cells["N_D"].max(), cells["seed"].min()
    rows = [row for row in results.rows if row["N_D"] == largest and row["seed"] == seed]
    for row, by_level, errors in regions(results, [level], rows):
        yield row, by_level[level], errors


@lru_cache(maxsize=1)  # the answer and the figures ask for it
def coverage_frame(results: Results) -> pd.DataFrame:
    """Share of whole test paths in their bands, by model, N_D and level, over seeds.

    Columns: model, family, N_D, level, coverage, low, high (95 % interval, clustered by run), width [m] (mean radius
    over the horizon), end [m] (at its end), lengths (the same end in ship lengths), runs (test runs), seeds.
    """
    length, run, rows = ship_length(results), results.test.run, list[dict[str, Any]]()
    levels = sorted({*SHOWN, results.plan.study.bands.level})
    held: dict[float, dict[tuple[str, str, int], list[Array]]] = {level: {} for level in levels}
    sizes: dict[tuple[float, str, str, int], list[tuple[float, float]]] = {}
    for row, by_level, errors in regions(results, levels):
        key = (row["model"], row["family"], int(row["N_D"]))
        for level, region in by_level.items():
            held[level].setdefault(key, []).append(region.holds(errors))
            ends = float(region.radius.mean()), float(region.radius[-1].mean())
            sizes.setdefault((level, *key), []).append(ends)
    for level in levels:
        for (model, family, N_D), parts in held[level].items():
            mean = np.mean(parts, axis=0)  # seeds predict the same windows: they are no further evidence
            low, high = share_interval(mean, run)
            width, end = np.mean(sizes[level, model, family, N_D], axis=0)
            names = {"model": model, "family": family, "N_D": N_D, "level": level}
            entry = {**names, "coverage": share_of(mean, run), "low": low, "high": high, "width": width, "end": end}
            rows.append({**entry, "lengths": end / length, "runs": len(results.test.spans), "seeds": len(parts)})
    columns = ["model", "family", "N_D", "level", "coverage", "low", "high", "width", "end", "lengths", "runs", "seeds"]
    return pd.DataFrame(rows, columns=columns)


@lru_cache(maxsize=1)
def groups_frame(results: Results) -> pd.DataFrame:
    """Coverage at the level of the study at the largest N_D, by kind of manoeuvre, time ahead and speed.

    Columns: model, by (`kind`, `ahead`, `speed`), group, coverage, low, high, width [m], runs (test runs in the group),
    note (a kind that too few runs calibrated). The band is the one for all kinds: the coverage is that
    of a ship whose kind of manoeuvre is not given. By time ahead: share of the positions at that step alone.
    """
    level, test, rows = results.plan.study.bands.level, results.test, []
    kind = np.array([results.kinds[str(run)] for run in test.run])
    speed = np.hypot(test.columns["u"], test.columns["v"])
    edges = np.quantile(speed, np.linspace(0, 1, SPEEDS + 1))
    decimals = max(0, 1 - math.floor(math.log10(max(float(edges[-1]), 1e-3))))  # two digits of the greatest speed
    part = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, SPEEDS - 1)
    for row, region, errors in _largest(results):
        bands, held, radius = results.bands[row["cell"]], region.holds(errors), region.radius.mean(axis=0)

        def add(by: str, group: str, chosen: Array, inside: Array, wide: float, note: str = "") -> None:
            run = test.run[chosen]
            low, high = share_interval(inside, run)
            entry = {"model": row["model"], "by": by, "group": group, "coverage": share_of(inside, run)}  # noqa: B023
            runs = len(np.unique(run))
            rows.append({**entry, "low": low, "high": high, "width": wide, "runs": runs, "note": note})

        for name in np.unique(kind):
            chosen, known = kind == name, bands.kinds.get(str(name), 0)
            few = "" if bands.promises(level, str(name)) else f"{runs(known)} of this kind calibrated the band: too few"
            few = NEW_KIND if bands.kinds and not known else few
            add("kind", str(name), chosen, held[chosen], float(radius[chosen].mean()), few)
        for place in range(SPEEDS):
            chosen = part == place
            if chosen.any():
                label = f"{edges[place]:.{decimals}f} to {edges[place + 1]:.{decimals}f} m/s"
                add("speed", label, chosen, held[chosen], float(radius[chosen].mean()))
        reach, every = region.reach(errors) <= 1, np.ones(len(test), dtype=bool)
        for step in np.unique(np.linspace(0, test.horizon - 1, 5).round().astype(int)):
            wide = float(region.radius[step].mean())
            add("ahead", f"{(step + 1) * test.step:g} s", every, reach[step], wide)
    columns = ["model", "by", "group", "coverage", "low", "high", "width", "runs", "note"]
    return pd.DataFrame(rows, columns=columns)


def answer(results: Results) -> list[tuple[str, str]]:
    """What bands promise and held, and which kinds of manoeuvre had too few runs, each with the anchor of its figure.

    Means over the models at the largest N_D that has bands, without families whose numbers were set from test runs.
    """
    level, frame = results.plan.study.bands.level, coverage_frame(results)
    mine = frame[frame["level"].eq(level) & ~frame["family"].isin(results.saw_test)]
    if mine.empty:
        refused = refused_frame(results).groupby("reason", sort=False)["model"]
        reasons = {str(reason).removeprefix(NO_BAND): named(map(str, models)) for reason, models in refused}
        each = [*reasons] if len(reasons) == 1 else [f"{models}: {reason}" for reason, models in reasons.items()]
        return [(f"No band is promised: {'; '.join(each)}.", "cells")] if reasons else []
    top = mine[mine["N_D"] == mine["N_D"].max()]
    share, low, high = (float(top[name].mean()) for name in ("coverage", "low", "high"))
    radius = span(metres(top["width"].min()), metres(top["width"].max()))
    amount = int(top["N_D"].iloc[0])
    cells = results.cells[results.cells["model"].isin(top["model"])]
    data = f"{of_methods(results, [*cells['method'].unique()])} with {amount} runs; 95 % interval"
    mean = f"mean of {len(top)} models{data} of a single model" if len(top) > 1 else data.lstrip()
    spread = f"{mean} {percent(low)} to {percent(high)}"
    sentence = f"Bands of {level_text(level)} held {percent(share)} of the whole test paths ({spread}); "
    sentence += f"their mean radius is {radius}."
    sentences = [(sentence, "coverage")]
    groups = groups_frame(results)
    new = sorted(set(groups.loc[groups["note"].eq(NEW_KIND), "group"]))
    if new:
        sentences.append(
            (f"Nothing is promised for {listed(new)}: no such run calibrated the bands.", "coverage-groups")
        )
    few = sorted({*groups.loc[groups["by"].eq("kind") & groups["note"].ne(""), "group"]} - {*new})
    if few:
        text = f"Too few runs calibrate a band of {level_text(level)} for one kind of manoeuvre alone: {listed(few)}."
        sentences.append((text, "coverage-groups"))
    return sentences


def of_methods(results: Results, names: Sequence[str]) -> str:
    """Say whose bands are meant, ` of the method 'drawn'`; nothing in a study of one method."""
    if len(results.plan.methods) == 1:
        return ""
    return f" of the {plural(len(names), 'method')} {listed([repr(str(name)) for name in names])}"


def worst_frame(results: Results) -> pd.DataFrame:
    """Test runs that pay: share of their paths in the band of the study's level, at the largest N_D, lowest first.

    Columns: model, run, kind, coverage, reach (the greatest error over its band, 1 is the border).
    """
    test, rows = results.test, []
    places = {run: test.run == run for run in test.spans}
    for row, region, errors in _largest(results):
        reach = region.reach(errors).max(axis=0)
        for run, mine in places.items():
            inside = float((reach[mine] <= 1).mean())
            entry = {"model": row["model"], "run": run, "kind": results.kinds[run], "coverage": inside}
            rows.append({**entry, "reach": float(reach[mine].max())})
    columns = ["model", "run", "kind", "coverage", "reach"]
    return pd.DataFrame(rows, columns=columns).sort_values(["coverage", "reach"], ascending=[True, False])


def refused_frame(results: Results) -> pd.DataFrame:
    """Models without a band of the study's level at the largest N_D, and why: model, N_D, reason."""
    level, rows = results.plan.study.bands.level, []
    done = [row for row in results.rows if row["status"] == "ok"]
    most = max((row["N_D"] for row in done), default=0)
    for row in done:
        bands = results.bands.get(row["cell"])
        if row["N_D"] == most and (bands is None or not bands.promises(level)):
            rows.append({"model": row["model"], "N_D": row["N_D"], "reason": results.no_band.get(row["cell"], "")})
    return pd.DataFrame(rows, columns=["model", "N_D", "reason"]).drop_duplicates(ignore_index=True)


def ship_length(results: Results) -> float:
    """Length between perpendiculars, else over all [m], of the first vessel that gives it; not a number without."""
    for one in results.plan.foundations:
        given = {} if one.base is None else one.base.document.get("particulars", {})
        for name in ("L_pp", "L_oa"):
            if name in given:
                return float(given[name])
    return float("nan")
