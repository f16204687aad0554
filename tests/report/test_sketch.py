"""The first figure as plain SVG."""

from __future__ import annotations

import re
from xml.etree import ElementTree as XML

import numpy as np

from shipid.report import ReportContent
from shipid.report.error_map import error_map
from shipid.report.errors_over import over_time
from shipid.report.figure import Plot, axis, label, layout, line, logarithmic, plane
from shipid.report.page import render
from shipid.report.sketch import sketch


def test_the_map_has_a_box_for_every_cell_and_every_name(simulation: ReportContent) -> None:
    figure = error_map(simulation)
    assert figure is not None
    plot = figure.views["0"][0].plot
    drawn = XML.fromstring(sketch(plot, figure.height))
    boxes = drawn.findall(".//rect")
    assert len(boxes) == sum(len(trace["x"]) for trace in plot.traces if trace["type"] == "bar")
    assert all(
        float(box.attrib["x"]) >= 0 and float(box.attrib["x"]) + float(box.attrib["width"]) <= 1000 for box in boxes
    )
    assert all(float(box.attrib["height"]) > 0 for box in boxes)
    words = {text.text for text in drawn.findall(".//text")}
    assert {*simulation.models.model[simulation.models.A.notna()], "10", "30", "100"} <= words
    points = [trace for trace in plot.traces if trace["type"] == "scatter" and len(trace["x"])]
    marks = sum(("lines" in trace["mode"]) + ("markers" in trace["mode"]) for trace in points)
    assert len(drawn.findall(".//path")) == 1 + len(plot.layout["shapes"]) + marks, "one path is the grid"


def test_points_lie_where_the_axes_say_and_gaps_stay() -> None:
    ticks = {"range": [0.0, 10.0], "tickvals": [0, 10]}
    ink = {"color": "var(--ink)", "width": 1}
    traces = [line("a", [0, 5, 6, 10], [0, 5, float("nan"), 10], [], line=ink)]
    plot = Plot(traces, layout(axis(label("t <s> [s]"), **ticks), axis("x [m]", **ticks)))
    drawn = XML.fromstring(sketch(plot, 300))
    assert drawn.findall(".//path")[-1].attrib["d"] == "M0.0 1000.0L500.0 500.0M1000.0 0.0"
    assert "t <s> [s]" in {text.text for text in drawn.findall(".//text")}


def test_an_axis_without_range_holds_all_and_has_few_round_ticks() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        values = rng.normal(rng.normal(scale=100), 10 ** rng.uniform(-3, 4), (2, 7))
        plot = Plot([line("a", *values, [], mode="markers")], layout(axis("a [m]"), axis("b [m]")))
        drawn = XML.fromstring(sketch(plot, 300))
        dots = re.findall(r"M(\S+) (\S+)h0", drawn.findall(".//path")[-1].attrib["d"])
        assert len(dots) == 7
        assert all(0 < float(place) < 1000 for dot in dots for place in dot)
        names = [text.text for text in drawn.findall(".//text")][:-2]
        assert 4 <= len(names) <= 14, names
        assert len({*names}) >= len(names) / 2


def test_logarithmic_axes_equal_axes_and_intervals() -> None:
    ends = {"range": [0.0, 2.0]}
    dots = line("a", [1.0, 10.0, 100.0], [1.0, 2.0, 3.0], [], mode="markers", error_y={"array": [1.0, 1.0, 0.5]})
    plot = Plot([dots], layout(logarithmic("a [m]", **ends), axis("b [m]", range=[0.0, 4.0], tickvals=[0, 2])))
    bars, points = XML.fromstring(sketch(plot, 300)).findall(".//path")[-2:]
    assert points.attrib["d"] == "M0.0 750.0h0M500.0 500.0h0M1000.0 250.0h0"
    assert bars.attrib["d"] == "M0.0 1000.0L0.0 500.0M500.0 750.0L500.0 250.0M1000.0 375.0L1000.0 125.0"
    plot = Plot([line("a", [0.0, 4.0], [0.0, 2.0], [])], plane("a [m]", "b [m]", [(0.0, 4.0), (0.0, 2.0)]))
    assert "aspect-ratio: 1.86207" in sketch(plot, 300), "4.32 over 2.32: as wide as it is in metres"


def test_a_band_is_an_area_of_its_colour() -> None:
    outline = line("a", [0.0, 10.0, 10.0], [0.0, 0.0, 10.0], [], fill="toself", fillcolor="var(--band)")
    plot = Plot([outline], layout(axis("t [s]", range=[0.0, 10.0]), axis("x [m]", range=[0.0, 10.0])))
    drawn = XML.fromstring(sketch(plot, 300)).findall(".//path")[-1].attrib
    assert drawn["d"] == "M0.0 1000.0L1000.0 1000.0L1000.0 0.0"
    assert "fill: var(--band)" in drawn["style"]
    assert drawn["style"].count("fill:") == 1


def test_of_what_has_no_numbers_or_two_axes_nothing_is_drawn(simulation: ReportContent) -> None:
    axes = layout(axis("a [m]"), axis("b [m]"))
    assert sketch(Plot([], axes), 300) == ""
    assert sketch(Plot([{"type": "heatmap", "z": [[1.0]]}], axes), 300) == ""
    assert sketch(Plot([{"type": "scatter", "x": ["one", "two"], "y": [1, 2], "mode": "lines"}], axes), 300) == ""
    figure = over_time(simulation)
    assert figure is not None
    assert sketch(figure.views["0-0"][0].plot, 300) == "", "commands lie on axes of their own"


def test_the_first_figure_of_every_kind_of_page_is_sketched(
    simulation: ReportContent, full_scale: ReportContent
) -> None:
    for content in (simulation, full_scale):
        text = render(content)
        first = text[text.index("<figure ") : text.index("</figure>")]
        assert first.count('<svg class="sketch"') == first.count('class="plot"') > 0
