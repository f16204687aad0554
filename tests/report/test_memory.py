"""The section on the past: what it says and draws, from frames made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid.report import ReportContent, memory
from shipid.report.page import render_page
from shipid.report.section import draw_sections
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


def along(current: float = 0.3, fade: float = 20.0) -> pd.DataFrame:
    t = np.arange(50.0)
    frame = pd.DataFrame({"run": "M001", "t": t, "u": 5.0, "v": 0.2 * np.sin(t), "r": 0.01})
    frame = frame.assign(**{"observer.u": 5.0, "observer.v": 0.0, "observer.r": 0.01, "observer.X": -0.02})
    frame = frame.assign(**{"observer.Y": 0.01, "observer.N": 1e-3, "observer.current_east": 0.0})
    frame["observer.current_north"] = current
    frame["observer.test"] = np.where(t == 0, np.nan, 1.5)
    return frame.assign(model="seen", fade=fade, ahead=30.0)


@pytest.fixture
def past(simulation: ReportContent) -> ReportContent:
    names = ["comparison", "model", "N_D", "A", "H_without", "H_with", "low", "high"]
    sums = pd.DataFrame(SUMS, columns=names)
    sums = sums.assign(difference=sums.H_with - sums.H_without, runs=20, better=15, seeds=2, differs="", added="memory")
    sums = sums.assign(**{"without": sums.model + " + a", "with": sums.model + " + b"})
    t = np.arange(20.0, 60.0)
    time = []
    for row in sums[sums.N_D.isin([0, 30])].to_dict("records"):
        names = {key: row[key] for key in ("comparison", "model", "without", "with", "N_D")}
        time.append(pd.DataFrame({**names, "run": "M001", "t": t, "error_without": 1.0 + t / 100, "error_with": 1.3}))
    frames = {"observer": along(), "memory": sums, "memory_over_time": pd.concat(time, ignore_index=True)}
    return replace(simulation, frames=frames)


@pytest.fixture
def little(past: ReportContent) -> ReportContent:
    """The same past in a study that draws nothing else over time."""
    none = {name: getattr(past, name).iloc[:0] for name in ("horizon", "over_time", "trials")}
    return replace(past, snapshots=[], answer=[], **none)


def test_the_section_is_on_the_page_and_names_are_escaped(little: ReportContent) -> None:
    text = render_page("study", ONLY, little)
    assert "What the past shows" in text
    assert NASTY not in text
    (section,) = draw_sections(ONLY, little)
    assert [item.id for item in section.items] == list(SECTIONS["the-past"].anchors)


def test_a_study_without_a_past_has_no_such_section(little: ReportContent) -> None:
    assert "What the past shows" not in render_page("study", ONLY, replace(little, frames={}))


def test_an_observer_alone_is_shown(past: ReportContent) -> None:
    only = replace(past, frames={"observer": along()})
    assert [item.id for item in SECTIONS["the-past"].draw(only) if item is not None] == ["observer"]


def test_the_observer_says_its_numbers(past: ReportContent) -> None:
    figure = memory.observer_figure(past)
    assert figure is not None
    moved = 100 * np.sqrt(np.mean((0.2 * np.sin(np.arange(50.0))) ** 2))
    assert f"{moved:.2g} cm/s" in figure.takeaway
    assert "reaches 2 cm/s² ahead" in figure.takeaway
    assert "0.30 m/s" in figure.takeaway
    assert "1.50 on average" in figure.takeaway
    assert f"{100 * np.exp(-1.5):.0f} % is left 30 s ahead" in figure.how
    plot = views(figure)["0"][0]
    force = next(trace for trace in plot.data if trace.name == "ahead")
    assert force.y == pytest.approx(-2.0)  # cm/s^2
    moment = next(trace for trace in plot.data if trace.name == "yaw")
    assert moment.y == pytest.approx(np.degrees(1e-3))
    rate = next(trace for trace in plot.data if trace.name == "r filtered")
    assert rate.y == pytest.approx(np.degrees(0.01))


@pytest.mark.parametrize(
    ("fade", "words"), [(0.0, "fades immediately"), (np.inf, "does not fade"), (2e6, "does not fade")]
)
def test_the_ends_of_the_fade_are_named(past: ReportContent, fade: float, words: str) -> None:
    figure = memory.observer_figure(replace(past, frames={"observer": along(fade=fade)}))
    assert figure is not None
    assert words in figure.how


def test_no_row_for_a_current_that_nobody_looked_for(past: ReportContent) -> None:
    figure = memory.observer_figure(replace(past, frames={"observer": along(current=0.0)}))
    assert figure is not None
    assert "current" not in figure.takeaway
    assert not any("towards" in trace.name for trace in views(figure)["0"][0].data)


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


def test_rivals_that_differ_in_more_are_named(past: ReportContent) -> None:
    sums = past.frames["memory"].assign(differs="trials")
    figure = memory.memory_gain(replace(past, frames={**past.frames, "memory": sums}))
    assert figure is not None
    assert "memory: b against a (trials)" in figure.how


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
    assert [cell.text for cell in of_a_model_ship.rows[0][4:7]] == ["0.012", "0.012", "0.000"]
