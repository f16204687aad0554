"""What the report says and draws of shares of H: only what is told apart from nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from shipid.report import ReportContent
from shipid.report.page import draw_sections
from shipid.report.sections import SECTIONS
from shipid.report.shares import MOST_NUMBERS, shares_figure, shares_table
from tests.report.views import views


def content() -> ReportContent:
    """Two families: `many` tells one of 20 numbers, `few` has three members."""
    rows = [
        ("many", N_D, 40, 40, 2.0, f"hull.n_{k}", "number", share, share - 0.1, share + 0.1)
        for N_D in (0, 10, 30)
        for k in range(20)
        for share in [0.5 - 0.005 * N_D if k == 7 else 0.002 * k]
    ]
    rows += [("many", 30, 40, 40, 2.0, "what all members share", "common", 0.3, 0.2, 0.4)]
    rows += [("few", 30, 3, 42, 2.0, "cannot be told", "", *[np.nan] * 3)]
    columns = ["family", "N_D", "members", "needed", "H", "number", "kind", "share", "low", "high"]
    cells, models = ["model", "family", "A"], ["model", "family", "A", "A_90", "A_rms"]
    empty = (pd.DataFrame(columns=names) for names in (cells, models))
    frames = {"shares": pd.DataFrame(rows, columns=columns)}
    return ReportContent(
        title="", name="", **dict(zip(("cells", "models"), empty, strict=True)), naive={}, frames=frames
    )


def test_what_is_told_and_what_cannot_be_told() -> None:
    figure = shares_figure(content())
    told, unknown = figure.takeaway.split(". few")
    assert told == "many with N_D = 30: hull.n_7 35.0% (25.0% to 45.0%)"
    assert unknown == " with N_D = 30: 3 members cannot tell; about 42 might: --set family.few.members=42."


def test_the_largest_shares_are_drawn_with_their_intervals() -> None:
    figure = shares_figure(content())
    plot = views(figure)["0"][0]
    assert [trace.name for trace in plot.data] == ["N_D = 0", "N_D = 10", "N_D = 30"]
    assert [chip.label for chip in figure.chips] == [trace.name for trace in plot.data]
    assert plot.layout.yaxis.ticktext[:2] == ("hull.n_7", "hull.n_19")
    assert len(plot.layout.yaxis.ticktext) == MOST_NUMBERS
    first = plot.data[0]
    assert (first.x[0], first.error_x.array[0], first.error_x.arrayminus[0]) == (50.0, 10.0, 10.0)
    assert first.hovertemplate.startswith("N_D = 0")


def test_where_no_family_tells_there_is_a_table_and_no_figure() -> None:
    made = content()
    frame = made.frame("shares")
    few = replace(made, frames={"shares": frame[frame["family"].eq("few")]})
    (section,) = draw_sections({"to-measure": SECTIONS["to-measure"]}, few)
    assert [item.id for item in section.items] == ["shares-table"]
    assert [cell.text for cell in shares_table(few).rows[0]] == ["few", "3", "30", "2.00", "cannot be told", *"–––"]
