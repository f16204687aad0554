import itertools
import re
from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
import pytest

from shipid.errors import ShipidError
from shipid.report.standalone import painted, standalone


def test_colours_are_those_of_the_page():
    names = go.Figure([go.Scatter(y=[1.0], line={"color": "var(--category-0)"}, customdata=["var(--ink)"])])
    light, dark = painted(names), painted(names, dark=True)
    assert light.data[0].line.color == "#0072B2"
    assert dark.data[0].line.color == "#56B4E9"
    assert light.layout.paper_bgcolor == "#ffffff"
    assert dark.layout.paper_bgcolor != light.layout.paper_bgcolor


def test_what_is_drawn_is_what_the_page_draws(simulation):
    from shipid.report.gain import gain

    ours, page = standalone("gain", simulation), gain(simulation).views["0-0"][0].figure
    for mine, theirs in zip(ours.data, page.data, strict=False):
        np.testing.assert_array_equal(mine.y, theirs.y)
    chips = gain(simulation).chips
    assert [trace.name for trace in ours.data if trace.showlegend] == [chip.label for chip in chips]
    assert "What another manoeuvre buys" in ours.layout.title.text


def test_options_choose_the_view(simulation):
    mean, worst = (standalone("gain", simulation, [name]) for name in ("mean", "90th percentile"))
    np.testing.assert_allclose(worst.data[0].y, 2.2 * np.array(mean.data[0].y), rtol=1e-6)
    with pytest.raises(
        ShipidError, match=r"gain: Position error: 'meen' is none of its options; did you mean 'mean'\?"
    ):
        standalone("gain", simulation, ["meen"])


def test_panels_lie_below_each_other(simulation):
    made = standalone("envelope", simulation)
    quantities = simulation.envelope.quantity.nunique()
    axes = [name for name in made.layout.to_plotly_json() if re.fullmatch(r"yaxis\d*", name)]
    assert len(axes) == quantities > 1
    domains = sorted(made.layout[name].domain for name in axes)
    assert all(a[1] < b[0] for a, b in itertools.pairwise(domains)), "no panel lies on another"
    assert domains[0][0] >= -1e-9
    assert domains[-1][1] <= 1 + 1e-9


@pytest.mark.parametrize("name", ["error_map", "error_over_horizon"])
def test_a_legend_lies_right_of_names_that_are_right_of_the_panel(simulation, name):
    made = standalone(name, simulation)
    assert any(note.xanchor == "left" for note in made.layout.annotations)
    assert made.layout.legend.x == 1.25
    assert standalone("gain", simulation).layout.legend.x is None


def test_a_scale_beside_a_legend_lies_below_the_plot(simulation):
    """With six models or more the bar of A covered their names."""
    made = standalone("gain", simulation)
    (bar,) = [trace.marker.colorbar for trace in made.data if trace.marker.showscale]
    assert made.layout.showlegend
    assert (bar.orientation, bar.yanchor) == ("h", "top")
    assert bar.y < 0 < bar.x < 1
    (bar,) = [trace.marker.colorbar for trace in standalone("error_map", simulation).data if trace.marker.showscale]
    assert (bar.orientation, bar.x) == (None, 1.25)


def test_nothing_to_draw_is_a_sentence(full_scale):
    with pytest.raises(ShipidError, match="error_map: there is nothing to draw: it needs two N_D or more"):
        standalone("error_map", full_scale)
    with pytest.raises(ShipidError, match="search: there is nothing to draw: the results hold no rows for it"):
        standalone("search", replace(full_scale, trials=full_scale.trials[:0]))
