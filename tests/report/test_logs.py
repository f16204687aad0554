import re

import numpy as np
import pandas as pd

from shipid.report.logs import CheckContent, _beyond_words, envelope_figure, tracks_figure, write_checks
from shipid.report.wording import set_sentence
from tests.report.test_page import NASTY, Page
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


CHECKS = pd.DataFrame(
    [
        {"check": "gap", "run": "a", "value": 1.0, "unit": "s", "limit": 3.0, "ok": True, "sentence": "fine"},
        {"check": "path", "run": NASTY, "value": 9.0, "unit": "m", "limit": 2.0, "ok": False, "sentence": NASTY},
    ]
)
RUNS = ["a", "a", NASTY, NASTY]
SERIES = pd.DataFrame(
    {"run": RUNS, "t": [1.7e9, 1.7e9 + 1, 0.0, 1.0], "r": 0.1, "psi_rate": [0.1, float("nan"), 0.1, 0.1]}
).assign(drift=[0.0, 1.0, 2.0, 3.0], u=1.0, v=0.0)
TRACKS = pd.DataFrame({"run": RUNS, "set": "the log", "north": [0.0, 1.0, 2.0, 3.0], "east": 0.0})
REPAIRS = pd.DataFrame(columns=["kind", "column", "count", "note"])


def content(name: str, checks: pd.DataFrame = CHECKS) -> CheckContent:
    return CheckContent(
        name=name, checks=checks, series=SERIES, tracks=TRACKS, repairs=REPAIRS, provenance={"log": name}
    )


def test_page_of_checks(tmp_path):
    file = write_checks(content(NASTY), tmp_path / "new" / "c.html")
    text = file.read_text()
    assert text.count(NASTY) == 0
    page = Page(text)
    assert not page.open
    assert not re.search(r'(src|href)="https?:', text.partition("* plotly.js (")[0])
    cells = [text for attributes, text in page.all("td") if "bad" in str(attributes.get("class")).split()]
    assert cells[0] == "failed"
    assert cells[1:] == [set_sentence(sentence) for sentence in CHECKS.sentence[~CHECKS.ok]], (
        "shown whole, not cut at its end"
    )
    sentences = [text for _, text in page.all("li")]
    assert any("1 of 2 checks failed, in 1 of 2 runs." in sentence for sentence in sentences)
    assert "shipid data check" in text


def test_a_log_in_order(tmp_path):
    file = write_checks(content("log", CHECKS.iloc[:1]), tmp_path / "c.html")
    assert "All 1 check of 1 run passed." in file.read_text()
