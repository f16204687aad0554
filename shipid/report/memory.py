"""What the past shows: the observer along a test run, and what memory and observer bought, paired over test runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from shipid.report.content import ReportContent, rows_as_tuples
from shipid.report.figure import (
    INK,
    MUTED,
    Chip,
    Control,
    PageFigure,
    Trace,
    category_colour,
    error_bars,
    escape_name,
    make_axis,
    make_line,
    make_plot,
    names_axis,
    names_in,
    zero_axis,
)
from shipid.report.section import Section
from shipid.report.selection import in_words, spread_items
from shipid.report.tables import PageTable, TableCell, TableColumn, frame_table, with_cells
from shipid.report.wording import counted_text, difference_text, join_few_names, number_text

OBSERVER_ROW, OBSERVER_GAP, OBSERVER_MARGIN = (
    118,
    26,
    56,
)  # heights of a row of a stacked figure, between rows, and around them [px]
MOST_MEMORY_LINES = 6  # models that have a line in a figure
LEAST_CURRENT = 1e-6  # m/s: no current was looked for
OBSERVER_INKS = {
    "measured": MUTED,
    "filtered": category_colour(0),
    "ahead": category_colour(1),
    "across": category_colour(2),
}
CURRENT_TITLE = "current [m/s]"
OBSERVER_ROWS: dict[str, tuple[float, dict[str, tuple[str, str]]]] = {
    "u [m/s]": (1.0, {"u": ("measured", "u measured"), "observer.u": ("filtered", "u filtered")}),
    "v [m/s]": (1.0, {"v": ("measured", "v measured"), "observer.v": ("filtered", "v filtered")}),
    "r [deg/s]": (math.degrees(1), {"r": ("measured", "r measured"), "observer.r": ("filtered", "r filtered")}),
    "force [cm/s²]": (100.0, {"observer.X": ("ahead", "ahead"), "observer.Y": ("across", "to starboard")}),
    "moment [deg/s²]": (math.degrees(1), {"observer.N": ("filtered", "yaw")}),
    CURRENT_TITLE: (
        1.0,
        {"observer.current_north": ("ahead", "towards north"), "observer.current_east": ("across", "towards east")},
    ),
    "test [1]": (1.0, {"observer.test": ("filtered", "test")}),
}
"""Title of the axis with its unit -> factor to that unit, and column of the frame -> key of its chip, and its name."""
COMPARISON_COLUMNS = {
    "without": TableColumn("without"),
    "with": TableColumn("with"),
    "N_D [1]": TableColumn("N_D", 0),
    "A [m]": TableColumn("A", "length"),
    "H without [m]": TableColumn("H_without", "length"),
    "H with [m]": TableColumn("H_with", "length"),
    "difference [m]": TableColumn("difference", "length"),
    "95 % interval [m]": TableColumn("interval", numeric=True),
    "better runs": TableColumn("better", numeric=True),
}


def observer_figure(content: ReportContent) -> PageFigure | None:
    """Measured and filtered motion, slow forces, current and test of the observer; None in a study without one."""
    frame = content.frame("observer")
    if frame.empty:
        return None
    runs, orders = names_in(frame), content.frame("orders")
    known = bool(frame[["observer.current_north", "observer.current_east"]].abs().max().max() > LEAST_CURRENT)
    rows = [title for title in OBSERVER_ROWS if title != CURRENT_TITLE or known]
    current = "; current towards {}" if known else ""
    words = ["motion, measured and filtered", "slow forces", *(["current"] if known else []), "test"]
    return PageFigure(
        id="observer",
        title="What the observer thinks",
        takeaway=_takeaway_observer(frame, runs, known),
        how=f"The observer of {frame.model.iloc[0]} goes along a test run and never looks ahead. Forces and moment are "
        "slow disturbances over the inertia of the ship, so they are accelerations; they hold wind, waves' drift and "
        "what the model lacks. The test is the mean squared error of the prediction of each measurement over its "
        "expected square: 1 where the assumptions hold, above it where the observer is too sure. "
        f"{_fade_words(frame)} Dotted upright lines are new orders.",
        alternative=f"Lines over the time of one test run, one below the other: {join_few_names(words, 6)}.",
        height=OBSERVER_MARGIN + len(rows) * (OBSERVER_ROW + OBSERVER_GAP),
        draw=lambda run: [
            _draw_observer(frame[frame.run.eq(run)], orders.t[orders.run.eq(run)] if len(orders) else (), rows)
        ],
        controls=[Control("Test run", runs)],
        chips=[
            Chip("key:measured", "measured", OBSERVER_INKS["measured"], "dot"),
            Chip("key:filtered", "filtered; moment; test", OBSERVER_INKS["filtered"]),
            Chip("key:ahead", "force ahead" + current.format("north"), OBSERVER_INKS["ahead"]),
            Chip("key:across", "force to starboard" + current.format("east"), OBSERVER_INKS["across"]),
        ],
    )


def _fade_words(frame: pd.DataFrame) -> str:
    fade, ahead = float(frame.fade.iloc[0]), float(frame.ahead.iloc[0])
    if fade == 0:
        return "In a prediction the force has no effect: it fades immediately."
    if ahead < 0.005 * fade:
        return f"In a prediction the force is held over the horizon of {ahead:g} s: it does not fade."
    left = f"{100 * math.exp(-ahead / fade):.0f} % is left {ahead:g} s ahead"
    return f"In a prediction the force fades with a time constant of {fade:.3g} s: {left}."


def _takeaway_observer(frame: pd.DataFrame, runs: Sequence[str], current: bool) -> str:
    moved = float(np.sqrt(np.nanmean((frame["observer.v"] - frame.v) ** 2)))
    largest = {word: float(frame[f"observer.{name}"].abs().max()) for word, name in (("ahead", "X"), ("sideways", "Y"))}
    where = max(largest, key=lambda word: largest[word])
    parts = [
        f"the filtered sway velocity is {100 * moved:.2g} cm/s from the measured one (root mean square)",
        f"the slow force reaches {100 * largest[where]:.2g} cm/s² {where}",
    ]
    if current:
        speed = np.hypot(frame["observer.current_north"], frame["observer.current_east"])
        parts.append(f"the current that it sees is {float(speed.mean()):.2f} m/s on average")
    test = f"its test is {number_text(float(frame['observer.test'].mean()))} on average"
    return f"Along {counted_text(len(runs), 'test run')}, {', '.join(parts)}, and {test}."


def _draw_observer(frame: pd.DataFrame, moments: Iterable[float], rows: Sequence[str]) -> go.Figure:
    """A row for each signal, from the top; dotted lines over the whole height at the moments of new orders."""
    traces, axes, total = [], {}, len(rows) * (OBSERVER_ROW + OBSERVER_GAP)
    for place, title in enumerate(rows, start=1):
        factor, columns = OBSERVER_ROWS[title]
        for column, (key, name) in columns.items():
            ink = {"color": OBSERVER_INKS[key], "width": 1.8} | (
                {"dash": "dot", "width": 2.5} if key == "measured" else {}
            )
            unit, tie = title.partition("[")[2].rstrip("]"), {"xaxis": "x", "yaxis": f"y{place}" if place > 1 else "y"}
            traces.append(make_line(name, frame.t, factor * frame[column], [f"key:{key}"], unit, line=ink, **tie))
        low = (len(rows) - place) * (OBSERVER_ROW + OBSERVER_GAP) / total
        axes[f"yaxis{place}"] = make_axis(title, domain=[low, low + OBSERVER_ROW / total], anchor="x", nticks=4)
    rule = {"type": "line", "yref": "paper", "y0": 0, "y1": 1, "layer": "below"}
    rules = [{**rule, "x0": t, "x1": t, "line": {"color": MUTED, "width": 1, "dash": "dot"}} for t in moments]
    x = make_axis("time in the run [s]", anchor=f"y{len(rows)}")
    return make_plot(traces, x, axes.pop("yaxis1"), hovermode="x unified", shapes=rules, **axes)


def memory_gain(content: ReportContent) -> PageFigure | None:
    """H of both rivals over N_D, and their difference with its interval; None where nothing is compared."""
    frame = content.frame("memory")
    if frame.empty:
        return None
    # By rising A, mean over N_D; without physics last.
    accuracy = frame.groupby("model", sort=False).A.mean().sort_values(kind="stable", na_position="last")
    models, compared = (
        spread_items([str(name) for name in accuracy.index], MOST_MEMORY_LINES),
        names_in(frame, "comparison"),
    )
    uneven = frame[frame.differs.ne("")].drop_duplicates("comparison")
    differing = [f"{row.comparison} ({row.differs})" for row in rows_as_tuples(uneven)]
    total = len(accuracy)
    return PageFigure(
        id="memory-gain",
        title="What memory and observer bought",
        takeaway=_takeaway_memory(frame),
        how="Above: H (15) with (solid) and without (dotted) what is compared, over the same test windows, mean over "
        "the seeds that both have. Below: the difference, with over without, with its 95 % interval from "
        "draws of the test runs with replacement, both rivals on the same runs, or Student's where that is wider, with "
        "what another training would give. "
        "Windows of one run are alike, so runs are drawn whole; with fewer than five runs there is none. Every "
        "interval is for one comparison alone: of many, one in twenty excludes 0 by chance."
        + (f" Of {total} models, {len(models)} spread over A have lines." if len(models) < total else "")
        + (f" Not memory alone differs in {join_few_names(differing)}." if differing else ""),
        alternative="Lines of the position error H over the number of manoeuvres, in pairs with and without memory or "
        "observer; below, the difference of each pair with an interval. The numbers are in the table below.",
        height=640,
        draw=lambda one: [_draw_memory(frame[frame.comparison.eq(one)], models)],
        controls=[Control("Compared", compared)],
        chips=[
            *(Chip(f"model:{name}", name, category_colour(i)) for i, name in enumerate(models)),
            Chip("side:with", "with", INK),
            Chip("side:without", "without", INK, "dot"),
        ],
    )


def _draw_memory(frame: pd.DataFrame, models: Sequence[str]) -> go.Figure:
    amounts = sorted(int(value) for value in pd.unique(frame.N_D))
    traces = []
    for i, name in enumerate(models):
        mine = frame[frame.model.eq(name)].sort_values("N_D")
        shift = 0.09 * (i - (len(models) - 1) / 2)  # intervals of several models would hide each other
        x = np.array([amounts.index(int(value)) for value in mine.N_D], dtype=float)
        ink, keys = {"color": category_colour(i), "width": 2}, [f"model:{name}"]
        mark = {"marker": {"color": ink["color"], "size": 6}}
        for side, dash in (("without", "dot"), ("with", "solid")):
            look: Trace = {"mode": "lines+markers", "line": {**ink, "dash": dash}, **mark}
            traces.append(make_line(f"{name}, {side}", x, mine[f"H_{side}"], [*keys, f"side:{side}"], **look))
        middle, low, high = (mine[column].to_numpy(dtype=float) for column in ("difference", "low", "high"))
        words = [f"{escape_name(name)}: {difference_text(*ends)}" for ends in zip(middle, low, high, strict=True)]
        looks: Trace = {
            "mode": "markers",
            **mark,
            "yaxis": "y2",
            "error_y": error_bars(middle, low, high, category_colour(i)),
        }
        traces.append(make_line(f"{name}, difference", x + shift, middle, keys, hover=words, **looks))
    names = [str(amount) if amount else "physics alone" for amount in amounts]
    title = "manoeuvres, N_D [1]" if amounts != [0] else ""
    x_axis = names_axis(names, title, anchor="y2", range=[-0.5, len(amounts) - 0.5], showgrid=False)
    below = zero_axis("difference of H [m]", INK, domain=[0.0, 0.44], anchor="x")
    return make_plot(traces, x_axis, make_axis("position error, H [m]", domain=[0.52, 1.0]), yaxis2=below)


def _takeaway_memory(frame: pd.DataFrame) -> str:
    last = frame[frame.N_D.eq(frame.N_D.max())]
    gains, losses = int((last.high < 0).sum()), int((last.low > 0).sum())
    best = last.nsmallest(1, "difference").iloc[0]
    which = f"{in_words(best.model)}, {difference_text(best.difference, best.low, best.high)} ({best.comparison})"
    where = f"With N_D = {int(best.N_D)}" if best.N_D else "With physics alone"
    text = f"{where}, {gains} of {counted_text(len(last), 'comparison')} lower H and {losses} raise it with an interval free "
    return f"{text}of 0; the lowest difference is that of {which}."


def memory_table(content: ReportContent) -> PageTable | None:
    """Every comparison with its interval."""
    frame = content.frame("memory")
    if frame.empty:
        return None
    ends = [
        TableCell(f"{number_text(row.low)} to {number_text(row.high)}" if math.isfinite(row.low) else "–", row.low)
        for row in rows_as_tuples(frame)
    ]
    better = [TableCell(f"{row.better} of {row.runs}", row.better) for row in rows_as_tuples(frame)]
    takeaway = f"{counted_text(len(frame), 'comparison')}; N_D = 0 is physics alone; "
    takeaway += f"means over {counted_text(int(frame.seeds.max()), 'seed')} at most."
    shown = with_cells(frame, interval=ends, better=better)
    return frame_table("memory-table", "Every comparison", takeaway, shown, COMPARISON_COLUMNS, like="H_without")


THE_PAST = Section(
    "What the past shows",
    draw=lambda content: (observer_figure(content), memory_gain(content), memory_table(content)),
    anchors=("observer", "memory-gain", "memory-table"),
)
