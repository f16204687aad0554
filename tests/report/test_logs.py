from dataclasses import replace

import numpy as np
import pandas as pd

from shipid.report.logs import _beyond_words, envelope_figure, tracks_figure
from tests.report.views import views


def test_tracks_are_thinned_below_a_pixel_on_equal_axes(content, away):
    figure = tracks_figure(content)
    plot = views(figure)[""][0]
    assert plot.layout.xaxis.scaleanchor == "y"
    assert plot.layout.xaxis.scaleratio == 1
    assert len(plot.data) == content.tracks.run.nunique()
    extent = max(np.ptp(content.tracks.north), np.ptp(content.tracks.east))
    for trace, run in zip(plot.data, [t.hovertemplate.split(" (")[0] for t in plot.data], strict=True):
        mine = content.tracks[content.tracks.run == run][["east", "north"]].to_numpy()
        kept = np.column_stack([trace.x, trace.y])
        assert len(kept) < len(mine)
        assert away(mine, kept).max() < extent / 1500


def test_the_test_lies_on_top_in_another_colour(simulation):
    plot = views(tracks_figure(simulation))[""][0]
    colours = [trace.line.color for trace in plot.data]
    assert set(colours[-4:]) == {"var(--category-1)"}
    assert "var(--category-1)" not in colours[:-4]


def test_the_names_of_the_sets_are_explained(simulation):
    explained = "D_ and a number: so many runs, to train and to validate."
    assert explained in envelope_figure(simulation).how
    named = simulation.envelope.assign(set=simulation.envelope["set"].str.replace("D_", "train "))
    assert explained not in envelope_figure(replace(simulation, envelope=named)).how


def test_what_the_test_asks_beyond_training_is_named():
    columns = ["set", "quantity", "unit", "min", "mean", "max"]
    rows = [
        ("D_10", "u", "m/s", 0, 2, 5),
        ("D_20", "u", "m/s", 0, 2, 6),
        ("test", "u", "m/s", 1, 2, 5.5),
        ("D_10", "v", "m/s", -1, 0, 1),
        ("test", "v", "m/s", -1.2, 0, 1),
    ]
    frame = pd.DataFrame(rows, columns=columns)
    assert _beyond_words(frame) == "The test reaches outside what the other sets cover in 1 of 2 inputs: v."
    assert (
        _beyond_words(frame[frame.quantity == "u"]) == "The test stays inside what the other sets cover in all 1 input."
    )
    assert _beyond_words(frame[frame["set"] == "D_10"]) == "2 inputs in 1 set."


def test_ranges_run_from_smallest_to_largest(full_scale):
    panels = views(envelope_figure(full_scale))[""]
    frame = full_scale.envelope
    assert len(panels) == frame.quantity.nunique()
    bar, dot = panels[1].data[2:4]  # sway speed of the test
    expected = frame[(frame["set"] == "test") & frame.quantity.str.startswith("sway")].iloc[0]
    np.testing.assert_allclose([*bar.x, *dot.x], [expected["min"], expected["max"], expected["mean"]], rtol=1e-6)


def test_no_rows_no_figure(full_scale):
    assert tracks_figure(replace(full_scale, tracks=full_scale.tracks.iloc[:0])) is None
    assert envelope_figure(replace(full_scale, envelope=full_scale.envelope.iloc[:0])) is None
