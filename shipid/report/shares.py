"""What to measure next: the share of H that the error of each number makes, with its interval, at each N_D."""

from __future__ import annotations

import numpy as np
import pandas as pd

from shipid.report.content import ReportContent
from shipid.report.figure import (
    MARKERS,
    Chip,
    Control,
    PageFigure,
    Panel,
    category_colour,
    error_bars,
    make_line,
    make_plot,
    names_axis,
    names_in,
    zero_axis,
)
from shipid.report.page import Section
from shipid.report.selection import figure_sizes
from shipid.report.tables import PageTable, frame_table
from shipid.report.wording import join_few_names, shorten_name

ENDS = ["share", "low", "high"]
MOST_NUMBERS = 12  # of a family in the figure: those of the largest shares
ROW_OF_NUMBER = 36  # height [px]
SHARE_HEADINGS = {
    "family": "family",
    "members": "members",
    "N_D": "N_D",
    "H [m]": "H",
    "number": "number",
    "share of H [1]": "share",
    "from": "low",
    "to": "high",
}


def shares_figure(content: ReportContent) -> PageFigure | None:
    """Shares of H with intervals, a row for each number; None where every family has too few members."""
    frame = content.frame("shares").query("kind == 'number'")
    families, sizes = names_in(frame, "family"), [*dict.fromkeys((0, *figure_sizes(frame["N_D"])))]
    if not families:
        return None
    return PageFigure(
        id="shares",
        title="Which number buys H",
        takeaway=_takeaway_shares(content),
        how="Share of H, mean over the members of a family, that the error of a number makes, to first order, with "
        "95 % intervals (members left out in turn); N_D = 0 is the physics alone. A large share is worth a test. "
        f"The {MOST_NUMBERS} largest are drawn. An interval that reaches 0 tells nothing.",
        alternative="Points with intervals; the numbers are in the table below.",
        height=ROW_OF_NUMBER * min(MOST_NUMBERS, frame["number"].nunique()) + 70,
        draw=lambda family: [_draw_shares(frame[frame["family"].eq(family)], sizes)],
        controls=[Control("Family", families)],
        chips=[
            Chip(f"N_D:{N_D}", f"N_D = {N_D}", category_colour(i), "none", symbol=MARKERS[i])
            for i, N_D in enumerate(sizes)
        ],
    )


def _draw_shares(frame: pd.DataFrame, sizes: list[int]) -> Panel:
    """A row for each number, the largest share first; the amounts of data one below the other."""
    names = frame.groupby("number")["share"].max().nlargest(MOST_NUMBERS).index
    traces = []
    for i, N_D in enumerate(sizes):
        share, low, high = 100 * frame[frame["N_D"].eq(N_D)].set_index("number").reindex(names)[ENDS].to_numpy(float).T
        rows = np.arange(len(names)) + 0.22 * (i - (len(sizes) - 1) / 2)
        line = make_line(
            f"N_D = {N_D}", share, rows, [f"N_D:{N_D}"], mode="markers", hover=f"N_D = {N_D}: %{{x:.1f}} %"
        )
        marker = {"color": category_colour(i), "symbol": MARKERS[i], "size": 8}
        traces.append(line | {"marker": marker, "error_x": error_bars(share, low, high, category_colour(i))})
    y_axis = names_axis([shorten_name(name, 28) for name in names], range=[len(names) - 0.4, -0.6])
    return make_plot(traces, zero_axis("share of H [%]"), y_axis)


def _takeaway_shares(content: ReportContent) -> str:
    """For each family at the most runs: the numbers told apart from nothing, or how many members might tell."""
    frame, parts = content.frame("shares"), []
    for (family, N_D), mine in frame[frame["N_D"].eq(frame["N_D"].max())].groupby(["family", "N_D"], sort=False):
        found = mine[mine["kind"].eq("number") & mine["low"].gt(0)].sort_values("share", ascending=False)
        shares = zip(found["number"], *(found[name].map("{:.1%}".format) for name in ENDS), strict=True)
        words = join_few_names([f"{name} {share} ({low} to {high})" for name, share, low, high in shares])
        members, needed = mine[["members", "needed"]].iloc[0]
        unknown = f"{members} members cannot tell; about {needed} might: --set family.{family}.members={needed}"
        parts.append(f"{family} with N_D = {N_D}: {words if len(found) else unknown}.")
    return " ".join(parts)


def shares_table(content: ReportContent) -> PageTable:
    """Every share with its interval: numbers, blocks of numbers, the rest, and what all members share."""
    return frame_table(
        "shares-table", "Shares of H", _takeaway_shares(content), content.frame("shares"), SHARE_HEADINGS
    )


WHAT_TO_MEASURE = Section(
    "What to measure next", {"shares": (shares_figure, "shares"), "shares-table": (shares_table, "shares")}
)
