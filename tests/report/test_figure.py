import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipid.report.figure import Panel, Plot, apart, axis, label, layout, line, logarithmic, plane


def test_tick_names_of_a_map_of_kilometres_leave_room_for_its_title():
    """ "−8000" has five signs of 8 px; a gap of 8 px and a line of 15 px follow."""
    assert plane("east [m]", "north [m]")["margin"]["l"] >= 5 * 8 + 8 + 15 + 4


def test_names_of_the_user_are_text_for_plotly():
    assert label("<b>a & b</b>") == "&lt;b&gt;a &amp; b&lt;/b&gt;"
    assert line("<b>", [0.0], [1.0], [])["name"] == "&lt;b&gt;"


def test_a_line_is_in_single_precision_and_keeps_its_gaps():
    drawn = line("a", [0.0, 1.0, 2.0], [1.0, np.nan, 2.0], ["model:a"])
    assert drawn["y"].dtype == np.float32
    assert drawn["connectgaps"] is False
    assert drawn["meta"] == ["model:a"]


def test_ticks_of_a_logarithmic_axis_are_numbers_one_can_read():
    made = logarithmic("error [m]")
    assert made["type"] == "log"
    assert dict(zip(made["tickvals"], made["ticktext"], strict=True))[0.5] == "0.5"


def test_a_plane_has_equal_axes_and_room_around():
    made = plane("y [m]", "x [m]", [(0.0, 100.0), (-5.0, 5.0)])
    assert (made["xaxis"]["scaleanchor"], made["xaxis"]["scaleratio"]) == ("y", 1)
    assert made["xaxis"]["range"] == [-4.0, 104.0]
    assert made["yaxis"]["range"] == [-9.0, 9.0]


def test_options_override_the_layout():
    made = layout(axis("a [1]"), axis("b [1]"), hovermode="closest", margin={"t": 1})
    assert made["hovermode"] == "closest"
    assert made["margin"] == {"t": 1}
    assert made["xaxis"]["title"]["text"] == "a [1]"


@given(st.lists(st.floats(0, 100), max_size=20).map(sorted), st.floats(0.1, 5))
def test_names_moved_apart_keep_their_order_and_their_distance(places, gap):
    moved = apart(places, gap, 100.0)
    assert all(b - a >= gap - 1e-9 for a, b in itertools.pairwise(moved))
    assert all(place <= 100.0 + 1e-9 for place in moved)
    if all(b - a >= gap for a, b in itertools.pairwise(places)):
        assert moved == pytest.approx(places)


def test_ticks_of_one_page_are_written_in_one_way():
    """Plotly writes -5k where the next axis has -6000."""
    made = Panel(Plot([], plane("east [m]", "north [m]"))).figure.layout
    assert made.xaxis.minexponent == made.yaxis.minexponent == 6
