"""The first figure as plain SVG."""

from __future__ import annotations

from xml.etree import ElementTree as XML

import plotly.graph_objects as go
import pytest

from shipid.report import ReportContent
from shipid.report.error_map import error_map
from shipid.report.figure import axis, layout, line
from shipid.report.gain import gain
from shipid.report.sketch import sketch


def test_the_map_has_a_box_for_every_cell_and_every_name(simulation: ReportContent) -> None:
    figure = error_map(simulation)
    assert figure is not None
    plot = figure.views["0"][0].figure
    drawn = XML.fromstring(sketch(plot, figure.height))
    boxes = drawn.findall(".//rect")
    assert len(boxes) == sum(len(trace.x) for trace in plot.data if trace.type == "bar")
    assert all(
        float(box.attrib["x"]) >= 0 and float(box.attrib["x"]) + float(box.attrib["width"]) <= 1000 for box in boxes
    )
    assert all(float(box.attrib["height"]) > 0 for box in boxes)
    words = {text.text for text in drawn.findall(".//text")}
    assert {*simulation.models.model[simulation.models.A.notna()], "10", "30", "100"} <= words
    assert len(drawn.findall(".//path")) == len(plot.layout.yaxis.tickvals) + len(plot.layout.shapes) + sum(
        "lines" in trace.mode and len(trace.x) > 0 for trace in plot.data if trace.type == "scatter"
    )


def test_points_lie_where_the_axes_say_and_gaps_stay() -> None:
    ticks = {"range": [0.0, 10.0], "tickvals": [0, 10]}
    plot = go.Figure([line("a", [0, 5, 6, 10], [0, 5, float("nan"), 10], [], line={"color": "var(--ink)", "width": 1})])
    plot.update_layout(layout(axis("t <s> [s]", **ticks), axis("x [m]", **ticks)))
    drawn = XML.fromstring(sketch(plot, 300))
    assert drawn.findall(".//path")[-1].attrib["d"] == "M0.0 1000.0L500.0 500.0M1000.0 0.0"
    assert "t <s> [s]" in {text.text for text in drawn.findall(".//text")}


@pytest.mark.parametrize("options", [{}, {"range": [0, 1], "tickvals": [1], "type": "log"}])
def test_of_other_axes_nothing_is_drawn(simulation: ReportContent, options: dict[str, object]) -> None:
    plot = go.Figure([], layout(axis("a [m]", **options), axis("b [m]", range=[0, 1], tickvals=[0])))
    assert sketch(plot, 300) == ""
    figure = gain(simulation)
    assert figure is not None
    assert sketch(figure.views["0-0"][0].figure, 300) == ""
