"""What the past shows: the observer along a test run, and what memory and observer bought, paired over test runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from shipid.report.content import ReportContent, rows_in
from shipid.report.figure import (
    INK,
    MUTED,
    Chip,
    Control,
    Figure,
    Trace,
    axis,
    category,
    escaped,
    intervals,
    line,
    names_axis,
    plot,
    run_names,
    zero_axis,
)
from shipid.report.section import Section
from shipid.report.selection import in_words, spread
from shipid.report.tables import Cell, Column, Table, frame_table, with_cells
from shipid.report.wording import counted, difference_text, listed, number

ROW, GAP, AROUND = 118, 26, 56  # heights of a row of a stacked figure, between rows, and around them [px]
FEW = 6  # models that have a line in a figure
SMALL = 1e-6  # m/s: no current was looked for
KEYS = {"measured": MUTED, "filtered": category(0), "ahead": category(1), "across": category(2)}
CURRENT = "current [m/s]"
SIGNALS: dict[str, tuple[float, dict[str, tuple[str, str]]]] = {
    "u [m/s]": (1.0, {"u": ("measured", "u measured"), "observer.u": ("filtered", "u filtered")}),
    "v [m/s]": (1.0, {"v": ("measured", "v measured"), "observer.v": ("filtered", "v filtered")}),
    "r [deg/s]": (math.degrees(1), {"r": ("measured", "r measured"), "observer.r": ("filtered", "r filtered")}),
    "force [cm/s²]": (100.0, {"observer.X": ("ahead", "ahead"), "observer.Y": ("across", "to starboard")}),
    "moment [deg/s²]": (math.degrees(1), {"observer.N": ("filtered", "yaw")}),
    CURRENT: (
        1.0,
        {"observer.current_north": ("ahead", "towards north"), "observer.current_east": ("across", "towards east")},
    ),
    "test [1]": (1.0, {"observer.test": ("filtered", "test")}),
}
"""Title of the axis with its unit -> factor to that unit, and column of the frame -> key of its chip, and its name."""
COMPARISONS = {
    "without": Column("without"),
    "with": Column("with"),
    "N_D [1]": Column("N_D", 0),
    "A [m]": Column("A", "length"),
    "H without [m]": Column("H_without", "length"),
    "H with [m]": Column("H_with", "length"),
    "difference [m]": Column("difference", "length"),
    "95 % interval [m]": Column("interval", numeric=True),
    "better runs": Column("better", numeric=True),
}


def observer(content: ReportContent) -> Figure | None:
    """Measured and filtered motion, slow forces, current and test of the observer; None in a study without one."""
    frame = content.frame("observer")
    if frame.empty:
        return None
    runs, orders = run_names(frame), content.frame("orders")
    known = bool(frame[["observer.current_north", "observer.current_east"]].abs().max().max() > SMALL)
    rows = [title for title in SIGNALS if title != CURRENT or known]
    current = "; current towards {}" if known else ""
    words = ["motion, measured and filtered", "slow forces", *(["current"] if known else []), "test"]
    return Figure(
        id="observer",
        title="What the observer thinks",
        takeaway=_takeaway_observer(frame, runs, known),
        how=f"The observer of {frame.model.iloc[0]} goes along a test run and never looks ahead. Forces and moment are "
        "slow disturbances over the inertia of the ship, so they are accelerations; they hold wind, waves' drift and "
        "what the model lacks. The test is the mean squared error of the prediction of each measurement over its "
        "expected square: 1 where the assumptions hold, above it where the observer is too sure. "
        f"{_fade_words(frame)} Dotted upright lines are new orders.",
        alternative=f"Lines over the time of one test run, one below the other: {listed(words, 6)}.",
        height=AROUND + len(rows) * (ROW + GAP),
        draw=lambda run: [
            _draw_observer(frame[frame.run.eq(run)], orders.t[orders.run.eq(run)] if len(orders) else (), rows)
        ],
        controls=[Control("Test run", runs)],
        chips=[
            Chip("key:measured", "measured", KEYS["measured"], "dot"),
            Chip("key:filtered", "filtered; moment; test", KEYS["filtered"]),
            Chip("key:ahead", "force ahead" + current.format("north"), KEYS["ahead"]),
            Chip("key:across", "force to starboard" + current.format("east"), KEYS["across"]),
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
    test = f"its test is {number(float(frame['observer.test'].mean()))} on average"
    return f"Along {counted(len(runs), 'test run')}, {', '.join(parts)}, and {test}."


def _draw_observer(frame: pd.DataFrame, moments: Iterable[float], rows: Sequence[str]) -> go.Figure:
    """A row for each signal, from the top; dotted lines over the whole height at the moments of new orders."""
    traces, axes, total = [], {}, len(rows) * (ROW + GAP)
    for place, title in enumerate(rows, start=1):
        factor, columns = SIGNALS[title]
        for column, (key, name) in columns.items():
            ink = {"color": KEYS[key], "width": 1.8} | ({"dash": "dot", "width": 2.5} if key == "measured" else {})
            unit, tie = title.partition("[")[2].rstrip("]"), {"xaxis": "x", "yaxis": f"y{place}" if place > 1 else "y"}
            traces.append(line(name, frame.t, factor * frame[column], [f"key:{key}"], unit, line=ink, **tie))
        low = (len(rows) - place) * (ROW + GAP) / total
        axes[f"yaxis{place}"] = axis(title, domain=[low, low + ROW / total], anchor="x", nticks=4)
    rule = {"type": "line", "yref": "paper", "y0": 0, "y1": 1, "layer": "below"}
    rules = [{**rule, "x0": t, "x1": t, "line": {"color": MUTED, "width": 1, "dash": "dot"}} for t in moments]
    x = axis("time in the run [s]", anchor=f"y{len(rows)}")
    return plot(traces, x, axes.pop("yaxis1"), hovermode="x unified", shapes=rules, **axes)


def memory_gain(content: ReportContent) -> Figure | None:
    """H of both rivals over N_D, and their difference with its interval; None where nothing is compared."""
    frame = content.frame("memory")
    if frame.empty:
        return None
    # By rising A, mean over N_D; without physics last.
    accuracy = frame.groupby("model", sort=False).A.mean().sort_values(kind="stable", na_position="last")
    models, compared = spread([str(name) for name in accuracy.index], FEW), run_names(frame, "comparison")
    uneven = frame[frame.differs.ne("")].drop_duplicates("comparison")
    differing = [f"{row.comparison} ({row.differs})" for row in rows_in(uneven)]
    total = len(accuracy)
    return Figure(
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
        + (f" Not memory alone differs in {listed(differing)}." if differing else ""),
        alternative="Lines of the position error H over the number of manoeuvres, in pairs with and without memory or "
        "observer; below, the difference of each pair with an interval. The numbers are in the table below.",
        height=640,
        draw=lambda one: [_draw_memory(frame[frame.comparison.eq(one)], models)],
        controls=[Control("Compared", compared)],
        chips=[
            *(Chip(f"model:{name}", name, category(i)) for i, name in enumerate(models)),
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
        ink, keys = {"color": category(i), "width": 2}, [f"model:{name}"]
        mark = {"marker": {"color": ink["color"], "size": 6}}
        for side, dash in (("without", "dot"), ("with", "solid")):
            look: Trace = {"mode": "lines+markers", "line": {**ink, "dash": dash}, **mark}
            traces.append(line(f"{name}, {side}", x, mine[f"H_{side}"], [*keys, f"side:{side}"], **look))
        middle, low, high = (mine[column].to_numpy(dtype=float) for column in ("difference", "low", "high"))
        words = [f"{escaped(name)}: {difference_text(*ends)}" for ends in zip(middle, low, high, strict=True)]
        looks: Trace = {"mode": "markers", **mark, "yaxis": "y2", "error_y": intervals(middle, low, high, category(i))}
        traces.append(line(f"{name}, difference", x + shift, middle, keys, hover=words, **looks))
    names = [str(amount) if amount else "physics alone" for amount in amounts]
    title = "manoeuvres, N_D [1]" if amounts != [0] else ""
    x_axis = names_axis(names, title, anchor="y2", range=[-0.5, len(amounts) - 0.5], showgrid=False)
    below = zero_axis("difference of H [m]", INK, domain=[0.0, 0.44], anchor="x")
    return plot(traces, x_axis, axis("position error, H [m]", domain=[0.52, 1.0]), yaxis2=below)


def _takeaway_memory(frame: pd.DataFrame) -> str:
    last = frame[frame.N_D.eq(frame.N_D.max())]
    gains, losses = int((last.high < 0).sum()), int((last.low > 0).sum())
    best = last.nsmallest(1, "difference").iloc[0]
    which = f"{in_words(best.model)}, {difference_text(best.difference, best.low, best.high)} ({best.comparison})"
    where = f"With N_D = {int(best.N_D)}" if best.N_D else "With physics alone"
    text = (
        f"{where}, {gains} of {counted(len(last), 'comparison')} lower H and {losses} raise it with an interval free "
    )
    return f"{text}of 0; the lowest difference is that of {which}."


def memory_table(content: ReportContent) -> Table | None:
    """Every comparison with its interval."""
    frame = content.frame("memory")
    if frame.empty:
        return None
    ends = [
        Cell(f"{number(row.low)} to {number(row.high)}" if math.isfinite(row.low) else "–", row.low)
        for row in rows_in(frame)
    ]
    better = [Cell(f"{row.better} of {row.runs}", row.better) for row in rows_in(frame)]
    takeaway = f"{counted(len(frame), 'comparison')}; N_D = 0 is physics alone; "
    takeaway += f"means over {counted(int(frame.seeds.max()), 'seed')} at most."
    shown = with_cells(frame, interval=ends, better=better)
    return frame_table("memory-table", "Every comparison", takeaway, shown, COMPARISONS, like="H_without")


THE_PAST = Section(
    "What the past shows",
    draw=lambda content: (observer(content), memory_gain(content), memory_table(content)),
    anchors=("observer", "memory-gain", "memory-table"),
)
