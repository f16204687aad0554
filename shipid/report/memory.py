"""What memory and observer bought, paired over test runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from shipid.report.content import ReportContent, rows_as_tuples
from shipid.report.figure import (
    INK,
    Chip,
    Control,
    PageFigure,
    Panel,
    Trace,
    category_colour,
    error_bars,
    escape_name,
    make_axis,
    make_line,
    make_plot,
    names_axis,
    names_in,
    zero_axis,
)
from shipid.report.page import Section
from shipid.report.selection import FEW_MODELS, in_words, spread_items
from shipid.report.tables import PageTable, TableCell, frame_table, range_cell, with_cells
from shipid.report.wording import counted_text, difference_text, join_few_names

COMPARISON_COLUMNS = {
    "without": "without",
    "with": "with",
    "N_D [1]": "N_D",
    "A [m]": "A",
    "H without [m]": "H_without",
    "H with [m]": "H_with",
    "difference [m]": "difference",
    "95 % interval [m]": "interval",
    "better runs": "better",
}


def memory_gain(content: ReportContent) -> PageFigure:
    """H of both rivals over N_D, and their difference with its interval."""
    frame = content.frame("memory")
    # By rising A, mean over N_D; without physics last.
    accuracy = frame.groupby("model", sort=False).A.mean().sort_values(kind="stable", na_position="last")
    models, total = spread_items([str(name) for name in accuracy.index], FEW_MODELS), len(accuracy)
    uneven = frame[frame.differs.ne("")].drop_duplicates("comparison")
    differing = [f"{row.comparison} ({row.differs})" for row in rows_as_tuples(uneven)]
    return PageFigure(
        id="memory-gain",
        title="What memory and observer bought",
        takeaway=_takeaway_memory(frame),
        how="Above: H (15) with (solid) and without (dotted) what is compared, over the same test windows, mean over "
        "the seeds that both have. Below: the difference, with over without, with its 95 % interval from "
        "draws of the test runs with replacement, both rivals on the same runs, or Student's where that is wider, with "
        "what another training would give. "
        "Windows of one run are alike, so runs are drawn whole; with fewer than five runs there is none. Every "
        "interval is for one comparison alone: of many, one in twenty excludes 0 by chance."
        + (f" Of {total} models, {len(models)} spread over A have lines." if len(models) < total else "")
        + (f" Not memory alone differs in {join_few_names(differing)}." if differing else ""),
        alternative="Lines of the position error H over the number of manoeuvres, in pairs with and without memory or "
        "observer; below, the difference of each pair with an interval. The numbers are in the table below.",
        height=640,
        draw=lambda one: [_draw_memory(frame[frame.comparison.eq(one)], models)],
        controls=[Control("Compared", names_in(frame, "comparison"))],
        chips=[
            *(Chip(f"model:{name}", name, category_colour(i)) for i, name in enumerate(models)),
            Chip("side:with", "with", INK),
            Chip("side:without", "without", INK, "dot"),
        ],
    )


def _draw_memory(frame: pd.DataFrame, models: Sequence[str]) -> Panel:
    amounts = sorted(int(value) for value in pd.unique(frame.N_D))
    traces = []
    for i, name in enumerate(models):
        mine = frame[frame.model.eq(name)].sort_values("N_D")
        shift = 0.09 * (i - (len(models) - 1) / 2)  # intervals of several models would hide each other
        x = np.array([amounts.index(int(value)) for value in mine.N_D], dtype=float)
        ink, keys = {"color": category_colour(i)}, [f"model:{name}"]
        for side, dash in (("without", "dot"), ("with", "solid")):
            look: Trace = {"mode": "lines+markers", "line": {**ink, "dash": dash}}
            traces.append(make_line(f"{name}, {side}", x, mine[f"H_{side}"], [*keys, f"side:{side}"], **look))
        middle, low, high = (mine[column].to_numpy(dtype=float) for column in ("difference", "low", "high"))
        words = [f"{escape_name(name)}: {difference_text(*ends)}" for ends in zip(middle, low, high, strict=True)]
        bars = error_bars(middle, low, high, category_colour(i))
        looks: Trace = {"mode": "markers", "marker": {"color": category_colour(i)}, "yaxis": "y2", "error_y": bars}
        traces.append(make_line(f"{name}, difference", x + shift, middle, keys, hover=words, **looks))
    names = [str(amount) if amount else "physics alone" for amount in amounts]
    x_axis = names_axis(names, "manoeuvres, N_D [1]" if amounts != [0] else "", anchor="y2", showgrid=False)
    below = zero_axis("difference of H [m]", INK, domain=[0.0, 0.44], anchor="x")
    return make_plot(traces, x_axis, make_axis("position error, H [m]", domain=[0.52, 1.0]), yaxis2=below)


def _takeaway_memory(frame: pd.DataFrame) -> str:
    last = frame[frame.N_D.eq(frame.N_D.max())]
    gains, losses = int((last.high < 0).sum()), int((last.low > 0).sum())
    best = last.nsmallest(1, "difference").iloc[0]
    which = f"{in_words(best.model)}, {difference_text(best.difference, best.low, best.high)} ({best.comparison})"
    where = f"With N_D = {int(best.N_D)}" if best.N_D else "With physics alone"
    text = f"{where}, {gains} of {counted_text(len(last), 'comparison')} lower H and {losses} raise it with an interval"
    return f"{text} free of 0; the lowest difference is that of {which}."


def memory_table(content: ReportContent) -> PageTable:
    """Every comparison with its interval."""
    frame = content.frame("memory")
    rows = rows_as_tuples(frame)
    ends = [range_cell(row.low, row.high) for row in rows]
    better = [TableCell(f"{row.better} of {row.runs}", row.better) for row in rows]
    takeaway = f"{counted_text(len(frame), 'comparison')}; N_D = 0 is physics alone; "
    takeaway += f"means over {counted_text(int(frame.seeds.max()), 'seed')} at most."
    shown = with_cells(frame, interval=ends, better=better)
    return frame_table("memory-table", "Every comparison", takeaway, shown, COMPARISON_COLUMNS)


THE_PAST = Section(
    "What the past shows", {"memory-gain": (memory_gain, "memory"), "memory-table": (memory_table, "memory")}
)
