import itertools
import re

import numpy as np
import plotly.graph_objects as go
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipid.errors import ShipidError
from shipid.report.figure import (
    Chip,
    Control,
    PageFigure,
    draw_alone,
    escape_name,
    make_axis,
    make_chart,
    make_line,
    make_plot,
    page_colours,
    ship_outline,
    spread_places,
)
from shipid.report.selection import accuracy_range, model_styles


def test_names_of_the_user_are_text_for_plotly():
    assert escape_name("<b>a & b</b>") == "&lt;b&gt;a &amp; b&lt;/b&gt;"
    assert make_line("<b>", [0.0], [1.0], [])["name"] == "&lt;b&gt;"


def test_a_line_is_in_single_precision_and_keeps_its_gaps():
    drawn = make_line("a", [0.0, 1.0, 2.0], [1.0, np.nan, 2.0], ["model:a"])
    assert drawn["y"].dtype == np.float32
    assert drawn["connectgaps"] is False
    assert drawn["meta"] == ["model:a"]


@given(st.lists(st.floats(0, 100), max_size=20).map(sorted), st.floats(0.1, 5))
def test_names_moved_apart_keep_their_order_and_their_distance(places, gap):
    moved = spread_places(places, gap, 100.0)
    assert all(b - a >= gap - 1e-9 for a, b in itertools.pairwise(moved))
    assert all(place <= 100.0 + 1e-9 for place in moved)
    if all(b - a >= gap for a, b in itertools.pairwise(places)):
        assert moved == pytest.approx(places)


def test_a_map_has_equal_axes_and_room_for_its_ticks():
    """ "−8000" has five signs of 8 px; a gap of 8 px and a line of 15 px follow."""
    made = go.Figure(make_chart([], "y [m]", "x [m]", [(0.0, 100.0), (-5.0, 5.0)])).layout
    assert (made.xaxis.scaleanchor, made.xaxis.scaleratio) == ("y", 1)
    assert (made.xaxis.range, made.yaxis.range) == ((-4.0, 104.0), (-9.0, 9.0))
    assert made.margin.l >= 5 * 8 + 8 + 15 + 4
    assert made.xaxis.minexponent == made.yaxis.minexponent == 6, "Plotly writes -5k where the next axis has -6000"


def test_panels_become_one_figure_of_plotly_with_legend_and_real_colours():
    def panels(option):
        trace = make_line("a", [1.0, 2.0], [option, option], ["a"], line={"color": "var(--ink)"})
        return [make_plot([trace], make_axis("t [s]"), make_axis(name)) for name in ("u [m/s]", "v [m/s]")]

    texts = {"id": "a", "title": "<A>", "takeaway": "Both.", "how": "", "alternative": ""}
    figure = PageFigure(
        **texts, height=200, draw=panels, controls=[Control("N", [3, 5])], chips=[Chip("a", "a", "var(--ink)")]
    )
    made = draw_alone(figure, ["5"], dark=True)
    assert [trace.yaxis for trace in made.data] == ["y", "y2", None]
    assert [list(trace.y) for trace in made.data[:2]] == [[5.0, 5.0]] * 2
    assert made.data[0].line.color == page_colours("dark")["ink"] != page_colours("light")["ink"]
    assert (made.layout.yaxis.title.text, made.layout.yaxis2.title.text) == ("u [m/s]", "v [m/s]")
    assert made.layout.title.text == "&lt;A&gt;<br><sup>Both.</sup>"
    with pytest.raises(ShipidError, match=r"N: '4' is none of its options; valid: 3, 5|N: '4'"):
        draw_alone(figure, [4])


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2."""
    parts = re.findall(r"\d+", colour) if colour.startswith("rgb") else [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (int(p) / 255 for p in parts)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def scale(dark: bool) -> list[float]:
    return [
        luminance(c)
        for c in [
            colour for name, colour in page_colours("dark" if dark else "light").items() if name.startswith("scale-")
        ]
    ]


def test_the_scale_is_ordered_and_has_contrast_on_both_pages():
    for dark, page in ((False, "#ffffff"), (True, "#12151a")):
        levels = scale(dark)
        assert len(levels) == 24
        assert levels == sorted(levels)
        paper = luminance(page)
        contrast = [(max(level, paper) + 0.05) / (min(level, paper) + 0.05) for level in levels]
        assert min(contrast) > 2


def test_named_colours_are_distinct_and_the_first_has_most_contrast():
    for dark, page in ((False, "#ffffff"), (True, "#12151a")):
        named = [page_colours("dark" if dark else "light")[f"category-{i}"] for i in range(6)]
        assert len(set(named)) == 6
        paper = luminance(page)
        first = luminance(named[0])
        assert (max(first, paper) + 0.05) / (min(first, paper) + 0.05) >= 4.5


def test_few_models_have_names_many_have_a_scale(simulation, full_scale):
    assert accuracy_range(full_scale) is None
    assert accuracy_range(simulation) == (0.9, 13.0)
    colours = [style.colour for style in model_styles(full_scale).values()]
    assert len(set(colours)) == len(colours)
    symbols = {name.split("-")[0]: style.symbol for name, style in model_styles(simulation).items()}
    assert len(set(symbols.values())) == len(symbols)


def test_the_outline_is_to_scale_closed_and_symmetric():
    outline = ship_outline({"L_oa": 31.25, "L_pp": 28.9, "B": 9.6})
    assert (np.ptp(outline[:, 0]), np.ptp(outline[:, 1])) == (31.25, 9.6)
    np.testing.assert_array_equal(outline[0], outline[-1])
    mirrored = {(x, -y) for x, y in outline.tolist()}
    assert mirrored == set(map(tuple, outline.tolist()))
    bow = outline[outline[:, 0].argmax()]
    assert bow[1] == 0.0, "the bow is pointed and ahead"
