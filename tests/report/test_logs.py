import numpy as np
import pandas as pd

from shipid.report.logs import _beyond_words, envelope_figure, tracks_figure
from tests.report.views import views


def test_the_test_lies_on_top_in_another_colour(simulation):
    plot = views(tracks_figure(simulation))[""][0]
    colours = [trace.line.color for trace in plot.data]
    assert set(colours[-4:]) == {"var(--category-1)"}
    assert "var(--category-1)" not in colours[:-4]


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
