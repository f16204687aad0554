"""The page of an identification, from frames alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.report import identification
from shipid.report.identification import IdentificationContent, write_identification
from tests.report.test_page import Page
from tests.report.views import views

NAMES = ["Y_v", "N_r", "X_vv"]


def content(held_out: tuple[str, ...] = ("T <1>",), name: str = "a <b>ship</b>") -> IdentificationContent:
    factor = np.array([1.1, 0.8, 3.0])
    half = np.array([0.1, 0.2, np.inf])
    estimates = pd.DataFrame(
        {"name": NAMES, "path": [f"hull.{each}" for each in NAMES], "with": ["", "hull.N_v", ""], "unit": "kg"}
    ).assign(
        base=10.0, value=10 * factor, error=half * 5, factor=factor, factor_low=factor - half,
        factor_high=factor + half, identified=[True, True, False], reason="because",
    )  # fmt: skip
    t, parts = np.arange(0, 30.0), []
    for model, off in (("measured", 0.0), ("before", 1.0), ("after", 0.1)):
        for piece in (0, 1):
            motion = {
                "north": 2 * t + off,
                "east": t,
                "psi": 0 * t,
                "u": 2 + off + 0 * t,
                "v": 0 * t,
                "r": np.sin(t) / 9,
            }
            parts.append(
                pd.DataFrame({"run": "T <1>", "piece": piece, "t": 1e9 + 30 * piece + t, "model": model, **motion})
            )
    which = ["fit", "test"] if held_out else ["fit"]
    rows = [
        {"set": kind, "run": run, "model": model, "u": off, "v": 0.1 * off, "r": 0.01 * off, "position": 9 * off}
        for kind in which
        for run in ("all", f"{kind} run")
        for model, off in (("before", 1.0), ("after", 0.1))
    ]
    manoeuvres = pd.DataFrame(
        [
            ("zigzag 10/10", "overshoot 1", "deg", 3.0, 4.0, ""),
            ("turning 35", "advance", "m", np.nan, 80.0, "before: no"),
        ],
        columns=["manoeuvre", "measure", "unit", "before", "after", "note"],
    )
    return IdentificationContent(
        beyond=("turning 35 reaches 20 deg of drift; the data reach 13",),
        title=name,
        name="ship",
        estimates=estimates,
        correlations=np.array([[1, -0.9, 0], [-0.9, 1, 0.2], [0, 0.2, 1]]),
        unseen=["only Y_v and X_vv together"],
        warnings=["the horizon is short"],
        errors=pd.DataFrame(rows),
        series=pd.concat(parts, ignore_index=True),
        held_out=held_out,
        ahead=30.0,
        manoeuvres=manoeuvres,
        colours=pd.DataFrame({"signal": "u", "lag": [0.0, 1.0], "correlation": [1.0, 0.5]}),
        profiles=pd.DataFrame(
            {"path": "hull.Y_v", "factor": [1.0, 1.1, 1.2], "rise": [4.0, 0, 4.0], "limit": 3.9}
        ).assign(sentence="hull.Y_v lies between 1 and 1.2"),
        programme=pd.DataFrame(
            {"manoeuvre": ["zigzag"], "hours": 0.1, "gain": 2.0, "per_hour": 20.0, "narrows": "hull.Y_v", "before": 0.2}
        ).assign(after=0.1),
    )


def test_the_answer_counts_compares_and_warns() -> None:
    sentences = [sentence.text for sentence in content().answer]
    assert sentences[0] == "2 of 3 parameters are identified by these runs."
    assert "1 run held out" in sentences[1]
    assert "u from 1.00 to 0.10 m/s" in sentences[1]
    assert "r from 0.57 to 0.057 deg/s" in sentences[1]
    assert sentences[2] == "Careful: the horizon is short."
    assert "fitted runs" in content(()).answer[1].text


def test_what_is_not_identified_is_hollow_and_its_bar_is_cut() -> None:
    figure = views(identification.estimates_figure(content()))[""][0]
    dots = {trace.meta[0]: trace for trace in figure.data if trace.name == "estimate"}
    assert dots["identified"].marker.symbol == "circle"
    assert dots["vague"].marker.symbol == "circle-open"
    assert list(dots["vague"].x) == [3.0]
    low, high = figure.layout.xaxis.range
    bars = {key: (dot.x - dot.error_x.arrayminus, dot.x + dot.error_x.array) for key, dot in dots.items()}
    assert np.allclose(np.ravel(bars["vague"]), [low, high])
    assert np.allclose([end[0] for end in bars["identified"]], [1.0, 1.2])
    assert low < 0.6
    assert high > 3.0


def test_pieces_are_not_joined_and_time_starts_at_zero() -> None:
    panels = views(identification.free_runs_figure(content()))["0"]
    speed = next(trace for trace in panels[0].data if trace.name == "measured")
    gaps = np.flatnonzero(np.isnan(speed.y))
    assert gaps.tolist() == [30, 61]
    assert speed.x[0] == 0
    assert np.nanmax(speed.x) == 59  # a clock since 1970 in single precision would not tell seconds
    rate = next(trace for trace in panels[2].data if trace.name == "after")
    assert np.nanmax(rate.y) == pytest.approx(np.rad2deg(1 / 9), rel=0.01)


def test_tables_keep_the_order_and_say_why_numbers_are_missing() -> None:
    errors = identification.free_run_errors(content())
    assert [row[0].text for row in errors.rows] == ["all held out", "all fitted", "test run", "fit run"]
    assert [cell.text for cell in errors.rows[0][2:4]] == ["1", "0.100"]
    table = identification.manoeuvres_before_and_after(content())
    assert table.columns[-1] == "why missing"
    assert table.rows[1][-1].text == "before: no"
    assert "Extrapolated: turning 35 reaches 20 deg of drift; the data reach 13." in table.takeaway
    rows = identification.estimates_table(content()).rows
    assert rows[1][0].text == "hull.N_r (with hull.N_v)"
    assert [row[6].text for row in rows] == ["1.00 … 1.20", "0.60 … 1.00", "none"]


def test_what_was_not_asked_for_is_left_out(tmp_path: Path) -> None:
    bare = replace(content(), profiles=pd.DataFrame(), programme=pd.DataFrame(), unseen=[])
    page = Page(write_identification(bare, tmp_path / "page.html").read_text())
    assert "What to run next" not in " ".join(words for _, words in page.all("h2"))
    assert not {"profiles", "programme", "unseen"} & {attributes.get("id") for _, attributes, _ in page.elements}
