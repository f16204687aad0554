"""What to buy: the error of every way over its price, and the best way with each physics."""

from __future__ import annotations

import numpy as np
import pandas as pd

from shipid.report.content import ReportContent, model_text, rows_as_tuples
from shipid.report.figure import (
    INK,
    MUTED,
    OKABE_ITO,
    Chip,
    PageFigure,
    Panel,
    Trace,
    category_colour,
    escape_name,
    log_axis,
    make_axis,
    make_line,
    make_plot,
    names_in,
)
from shipid.report.page import Section
from shipid.report.tables import PageTable, frame_table
from shipid.report.wording import counted_text, difference_text, metres_text, price_text
from shipid.units import percent_text

WAY_COLUMNS = {
    "physics": "foundation",
    "runs, N_D [1]": "N_D",
    "price": "price",
    "error at the horizon [m]": "H_end",
    "from [m]": "low",
    "to [m]": "high",
    "chance": "probability",
    "price and error": "expected",
}


def frontier_figure(content: ReportContent) -> PageFigure:
    """Expected error at the horizon over the price, a line per physics, and the frontier."""
    ways = content.frame("cost")
    best, unit = ways[ways["frontier"]], ways["unit"].iloc[0]
    goal = "" if ways["goal"].isna().all() else " The dashed line is the goal."
    chips = [
        Chip(f"way:{name}", model_text(name), category_colour(i)) for i, name in enumerate(names_in(ways, "foundation"))
    ]
    return PageFigure(
        id="frontier",
        title="What to buy: error over price",
        takeaway=f"{content.sentence_of('frontier')} From {metres_text(best['H_end'].max())} for "
        f"{price_text(best['price'].min(), unit)} to {metres_text(best['H_end'].min())} for "
        f"{price_text(best['price'].max(), unit)}.".lstrip(),
        how="Each point is a number of runs with one physics: its price, and the median of the error at the horizon as "
        "the law of exchange expects it, given the cells of this study. The law was learned from simulated ships. "
        "Points with a ring are on the frontier: no cheaper way has a lower error." + goal,
        alternative="Lines of the expected error over the price, one for each physics; the best in the table below.",
        height=420,
        draw=lambda: [_draw_frontier(ways)],
        chips=chips,
    )


def _draw_frontier(ways: pd.DataFrame) -> Panel:
    traces = []
    for i, name in enumerate(names_in(ways, "foundation")):
        mine, colour = ways[ways["foundation"] == name], category_colour(i % len(OKABE_ITO))
        words = [
            f"{escape_name(model_text(name))}, {counted_text(row.N_D, 'run')}: {price_text(row.price, row.unit)}<br>"
            f"{difference_text(row.H_end, row.low, row.high)}"
            + (f"<br>chance {percent_text(row.probability)}" if np.isfinite(row.probability) else "")
            for row in rows_as_tuples(mine)
        ]
        ring = {"color": colour, "size": 8, "line": {"color": INK, "width": 2 * mine["frontier"]}}
        style: Trace = {"mode": "lines+markers", "line": {"color": colour, "width": 1.5}, "marker": ring}
        traces.append(make_line(name, mine["price"], mine["H_end"], [f"way:{name}"], hover=words, **style))
    if np.isfinite(goal := ways["goal"].iloc[0]):
        dashed = {"color": MUTED, "dash": "dash", "width": 1.5}
        ends = [ways["price"].min(), ways["price"].max()]
        traces.append(make_line("goal", ends, [goal, goal], [], hover=f"goal: {metres_text(goal)}", line=dashed))
    x = make_axis(f"price [{escape_name(ways['unit'].iloc[0])}]", rangemode="tozero")
    return make_plot(traces, x, log_axis("error at the horizon [m]"))


def ways_table(content: ReportContent) -> PageTable:
    """The best way with each physics."""
    ways = content.frame("cost")
    best = ways[ways["chosen"]].sort_values("price").assign(foundation=lambda one: one["foundation"].map(model_text))
    columns = {name: column for name, column in WAY_COLUMNS.items() if best[column].notna().any()}
    unit = ways["unit"].iloc[0]
    more = '"chance" is that of the goal.'
    if best["goal"].isna().all():
        more = '"price and error" adds what the expected error costs.'
    return frame_table("ways", "The best way with each physics", f"Prices are in {unit}; {more}", best, columns)


WHAT_TO_BUY = Section("What to buy", {"frontier": (frontier_figure, "cost"), "ways": (ways_table, "cost")})
