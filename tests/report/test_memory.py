"""The section on the past: what it says and draws, from frames made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid.report import ReportContent, memory
from shipid.report.page import render_page
from shipid.report.sections import SECTIONS
from tests.report.views import views

NASTY = "<b>wrong</b>"
ONLY = {"the-past": SECTIONS["the-past"]}
SUMS = [  # comparison, model, N_D, A, H_without, H_with, low, high
    ("memory: b against a", "right", 10, 1.0, 0.8, 0.7, -0.2, -0.01),
    ("memory: b against a", "right", 30, 1.0, 0.6, 0.55, -0.1, 0.02),
    ("memory: b against a", NASTY, 10, 3.0, 1.8, 1.2, -0.8, -0.4),
    ("memory: b against a", NASTY, 30, 3.0, 1.5, 1.1, -0.6, -0.2),
    ("memory: b against a", "none", 30, np.nan, 2.0, 2.3, 0.1, 0.5),
    ("observer: physics alone", "right", 0, 1.0, 1.0, 0.9, np.nan, np.nan),
]


@pytest.fixture
def past(simulation: ReportContent) -> ReportContent:
    names = ["comparison", "model", "N_D", "A", "H_without", "H_with", "low", "high"]
    sums = pd.DataFrame(SUMS, columns=names)
    sums = sums.assign(difference=sums.H_with - sums.H_without, runs=20, better=15, seeds=2, differs="", added="memory")
    sums = sums.assign(**{"without": sums.model + " + a", "with": sums.model + " + b"})
    return replace(simulation, frames={"memory": sums})


@pytest.fixture
def little(past: ReportContent) -> ReportContent:
    """The same past in a study that draws nothing else over time."""
    none = {name: getattr(past, name).iloc[:0] for name in ("horizon", "over_time", "trials")}
    return replace(past, snapshots=[], answer=[], **none)


def test_a_study_without_a_past_has_no_such_section(little: ReportContent) -> None:
    assert "What the past shows" not in render_page("study", ONLY, replace(little, frames={}))


def test_the_gain_counts_intervals_free_of_zero(past: ReportContent) -> None:
    figure = memory.memory_gain(past)
    assert figure is not None
    assert "With N_D = 30, 1 of 3 comparisons lower H and 1 raise it" in figure.takeaway
    assert "−0.40 m [−0.60, −0.20]" in figure.takeaway
    points = [trace for trace in views(figure)["0"][0].data if trace.yaxis == "y2"]
    heights = {value for trace in points for value in np.asarray(trace.y, dtype=float).round(4)}
    assert heights == {-0.1, -0.05, -0.6, -0.4, 0.3}
    bars = next(trace for trace in points if NASTY not in trace.name and "none" not in trace.name and len(trace.y) == 2)
    low, high = (
        np.asarray(bars.y) + sign * np.asarray(bars.error_y[side]) for sign, side in ((-1, "arrayminus"), (1, "array"))
    )
    np.testing.assert_allclose([low, high], [[-0.2, -0.1], [-0.01, 0.02]], atol=1e-6)


def test_rivals_without_physics_are_named_as_everywhere(past: ReportContent) -> None:
    """`none + b errs less than none + a` says that nothing does."""
    sums = past.frames["memory"]
    bare = replace(past, frames={**past.frames, "memory": sums[sums.model.eq("no physics")]})
    table = memory.memory_table(bare)
    assert table is not None
    assert [cell.text for cell in table.rows[0][:2]] == ["no physics + a", "no physics + b"]
    gained = memory.memory_gain(bare)
    assert gained is not None
    assert 'is that of "no physics", 0.30 m' in gained.takeaway


def test_the_table_has_every_comparison(past: ReportContent) -> None:
    table = memory.memory_table(past)
    assert table is not None
    assert len(table.rows) == len(SUMS)
    assert [cell.text for cell in table.rows[-1]][-2:] == ["–", "15 of 20"]
    small = past.frames["memory"].assign(H_without=0.0123, H_with=0.0119, difference=-0.0004)
    of_a_model_ship = memory.memory_table(replace(past, frames={**past.frames, "memory": small}))
    assert of_a_model_ship is not None
    assert [cell.text for cell in of_a_model_ship.rows[0][4:7]] == ["0.012", "0.012", "−0.00040"]
