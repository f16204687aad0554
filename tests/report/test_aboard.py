"""The page of a log played as if at sea."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid.report.aboard import AboardContent, along_run_figure, band_outline, paths_figure, write_aboard
from shipid.report.content import SummaryLine
from tests.report.views import views

NASTY = "<b>run</b>"


def content(banded: bool = True, physics: bool = True) -> AboardContent:
    times, ahead = np.arange(0.0, 40.0, 4.0), np.arange(1.0, 6.0)
    at, by = np.meshgrid(times, ahead, indexing="ij")
    points = pd.DataFrame({"run": NASTY, "t": at.ravel(), "ahead": by.ravel()})
    points["north"], points["east"] = 5 * (points["t"] + points["ahead"]), 0.1 * points["ahead"] ** 2
    points["physics_north"] = points["north"] + 0.5 if physics else np.nan
    points["physics_east"] = points["east"] if physics else np.nan
    if banded:
        points = points.assign(band_along=points["ahead"], band_across=0.5 * points["ahead"], band_course=0.3)
    instants = pd.DataFrame({"run": NASTY, "t": times, "outside": times > 20, "latency": 0.01})
    instants["error"] = np.where(times < 36, 1.0 + times / 10, np.nan)
    track = pd.DataFrame({"run": NASTY, "t": times, "north": 5 * times, "east": 0.0})
    lines = [
        SummaryLine("predictions", "10 predictions in 1 run, 5 s ahead; 0 instants before there was a past"),
        SummaryLine("alarm", "alarm: at 4 of 10 instants"),
        SummaryLine("detail", "latency: 10 ms"),
    ]
    return AboardContent(title="played", name="cell", lines=lines, instants=instants, points=points, track=track)


def test_the_outline_of_a_band_is_its_ellipse() -> None:
    """Every corner lies at distance 1 in half axes, turned by the course; a gap parts two ellipses."""
    points = content().points.iloc[:3]
    east, north = (values.reshape(3, -1) for values in band_outline(points, 12))
    assert np.isnan(east[:, -1]).all()
    away_n = north[:, :-1] - points["north"].to_numpy()[:, None]
    away_e = east[:, :-1] - points["east"].to_numpy()[:, None]
    ahead, aside = np.array([np.cos(0.3), np.sin(0.3)]), np.array([-np.sin(0.3), np.cos(0.3)])
    along_track = (away_n * ahead[0] + away_e * ahead[1]) / points["band_along"].to_numpy()[:, None]
    across = (away_n * aside[0] + away_e * aside[1]) / points["band_across"].to_numpy()[:, None]
    np.testing.assert_allclose(np.hypot(along_track, across), 1.0)


@pytest.mark.parametrize("banded", [True, False])
@pytest.mark.parametrize("physics", [True, False])
def test_it_draws_what_was_played(banded: bool, physics: bool, tmp_path) -> None:
    here = content(banded, physics)
    names = [trace.name for trace in views(paths_figure(here))["0"][0].data]
    assert names.count("predicted path") == 6
    assert names.count("physics alone") == 6 * physics
    assert names.count("band") == 6 * banded
    history = views(along_run_figure(here))["0"][0].data
    assert len(history) == 2 + 2 * banded
    np.testing.assert_allclose(history[-1].x, here.instants["t"][here.instants["outside"]])
    text = write_aboard(here, tmp_path / "seen.html").read_text()
    assert "Alarm: at 4 of 10 instants." in text
    assert NASTY not in text
    assert "latency: 10 ms" not in text


def test_what_limits_the_promise_is_on_the_page() -> None:
    """That bands do not hold, that wind was taken as 0 and times without rows were said in the terminal alone."""
    limits = [
        SummaryLine("limit", "not in the log, taken as 0: V_w"),
        SummaryLine("limit", "1 time without rows: no errors there"),
    ]
    broken = SummaryLine("band", "it held 40 % of the 20 whole paths; that is fewer than 90 % by more than chance")
    here = content()
    here = replace(
        here, lines=[here.lines[0], *limits, *here.lines[1:], SummaryLine("detail", "  b: from 1 to 2 s"), broken]
    )
    said = [one.text for one in here.answer]
    texts = [line.text for line in (here.lines[0], here.lines[3], broken, *limits)]
    assert said == [f"{text[0].upper()}{text[1:]}." for text in texts], "by kind, whatever the words"
    assert paths_figure(here).takeaway == said[2]
    assert paths_figure(content(banded=False)).takeaway == said[0], "the figure shows paths, no alarm"


def test_it_opens_at_the_worst_run_in_time_of_the_run() -> None:
    """Three runs of another day: the second errs most; its band is that of the last step, along and across."""
    here = content()
    frames: dict[str, list[pd.DataFrame]] = {"instants": [], "points": [], "track": []}
    for name, worse in (("a", 1.0), ("b", 3.0), ("c", 2.0)):
        for key, parts in frames.items():
            part = getattr(here, key).assign(run=name)
            parts.append(
                part.assign(t=part["t"] + 1e6, **({"error": worse * part["error"]} if "error" in part else {}))
            )
    three = replace(here, **{key: pd.concat(parts, ignore_index=True) for key, parts in frames.items()})
    for figure in (paths_figure(three), along_run_figure(three)):
        assert list(figure.controls[0].options) == ["a", "b", "c"]
        assert figure.controls[0].start == 1
    late = replace(three, instants=three.instants[three.instants["t"] >= 1e6 + 8], points=three.points)
    (error, *_) = views(along_run_figure(late))["1"][0].data
    assert error["x"][0] == 8, "the run began with its track, before there was a prediction"
    lines = {str(trace["name"]): trace for trace in views(along_run_figure(three))["1"][0].data}
    np.testing.assert_allclose(lines["error"]["x"], here.instants["t"])
    np.testing.assert_allclose(lines["error"]["y"], 3.0 * here.instants["error"], rtol=1e-6)
    np.testing.assert_allclose(lines["band along"]["y"], 5.0)
    np.testing.assert_allclose(lines["band across"]["y"], 2.5)
