"""What the past shows: the observer along a test run, and what memory and observer bought, paired over test runs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shipid.report.content import Floats, ReportContent
from shipid.report.figure import Chip, Control, Figure, Panel, Plot, axis, label, layout, line, marks
from shipid.report.palette import INK, MUTED, category
from shipid.report.section import Section
from shipid.report.selection import in_words, spread
from shipid.report.tables import Cell, Table, figure, length_places, text
from shipid.report.wording import counted, difference, listed, metres, number

ROW, GAP, MARGIN = 118, 26, 56  # heights of a row of a stacked figure, between rows, and around them [px]
FEW = 6  # models that have a line in a figure
MOST_ROWS = 24  # models on the map of differences
CELL = 30  # height of a model there [px]
LONGEST = 16  # characters of a name at the axis
SMALL = 1e-6  # m/s: no current was looked for
DRAWN = {"measured": MUTED, "filtered": category(0), "ahead": category(1), "across": category(2)}


class Row(NamedTuple):
    """One row of the observer's figure: axis title with unit, factor to that unit, and (key, name, column) of lines."""

    title: str
    factor: float
    lines: Sequence[tuple[str, str, str]]


def _both(signal: str) -> list[tuple[str, str, str]]:
    return [("measured", f"{signal} measured", signal), ("filtered", f"{signal} filtered", f"observer.{signal}")]


ROWS = (
    Row("u [m/s]", 1.0, _both("u")),
    Row("v [m/s]", 1.0, _both("v")),
    Row("r [deg/s]", math.degrees(1), _both("r")),
    Row("force [cm/s²]", 100.0, [("ahead", "ahead", "observer.X"), ("across", "to starboard", "observer.Y")]),
    Row("moment [deg/s²]", math.degrees(1), [("filtered", "yaw", "observer.N")]),
    Row(
        "current [m/s]",
        1.0,
        [("ahead", "towards north", "observer.current_north"), ("across", "towards east", "observer.current_east")],
    ),
    Row("test [1]", 1.0, [("filtered", "test", "observer.test")]),
)


def observer(content: ReportContent) -> Figure | None:
    """Measured and filtered motion, slow forces, current and test of the observer; None in a study without one."""
    frame = content.frame("observer")
    if frame.empty:
        return None
    runs = [str(run) for run in pd.unique(frame.run)]
    rows = [row for row in ROWS if not row.title.startswith("current") or _has_current(frame)]
    views = {
        str(i): [Panel(_along(frame[frame.run.eq(run)], _moments(content, run), rows))] for i, run in enumerate(runs)
    }
    chips = [Chip("key:measured", "measured", DRAWN["measured"], "dot")]
    chips += [Chip("key:filtered", "filtered; moment; test", DRAWN["filtered"])]
    current = "; current towards {}" if _has_current(frame) else ""
    chips += [Chip("key:ahead", "force ahead" + current.format("north"), DRAWN["ahead"])]
    chips += [Chip("key:across", "force to starboard" + current.format("east"), DRAWN["across"])]
    words = ["motion, measured and filtered", "slow forces", *(["current"] if _has_current(frame) else []), "test"]
    return Figure(
        id="observer",
        title="What the observer thinks",
        takeaway=_takeaway_observer(frame, runs),
        how=f"The observer of {frame.model.iloc[0]} goes along a test run and never looks ahead. Forces and moment are "
        "slow disturbances over the inertia of the ship, so they are accelerations; they hold wind, waves' drift and "
        "what the model lacks. The test is the mean squared error of the prediction of each measurement over its "
        "expected square: 1 where the assumptions hold, above it where the observer is too sure. "
        f"{_fade(frame)} Dotted upright lines are new orders.",
        alternative=f"Lines over the time of one test run, one below the other: {listed(words, 6)}.",
        height=_height(len(rows)),
        views=views,
        controls=[Control("Test run", runs)],
        chips=chips,
    )


def _has_current(frame: pd.DataFrame) -> bool:
    return bool(frame[["observer.current_north", "observer.current_east"]].abs().max().max() > SMALL)


def _fade(frame: pd.DataFrame) -> str:
    fade, ahead = float(frame.fade.iloc[0]), float(frame.ahead.iloc[0])
    if fade == 0:
        return "In a prediction the force has no effect: it fades immediately."
    if ahead < 0.005 * fade:
        return f"In a prediction the force is held over the horizon of {ahead:g} s: it does not fade."
    left = 100 * math.exp(-ahead / fade)
    return (
        f"In a prediction the force fades with a time constant of {fade:.3g} s: {left:.0f} % is left {ahead:g} s ahead."
    )


def _takeaway_observer(frame: pd.DataFrame, runs: Sequence[str]) -> str:
    moved = float(np.sqrt(np.nanmean((frame["observer.v"] - frame.v) ** 2)))
    largest = {word: float(frame[f"observer.{name}"].abs().max()) for word, name in (("ahead", "X"), ("sideways", "Y"))}
    where = max(largest, key=lambda word: largest[word])
    parts = [
        f"the filtered sway velocity is {100 * moved:.2g} cm/s from the measured one (root mean square)",
        f"the slow force reaches {100 * largest[where]:.2g} cm/s² {where}",
    ]
    if _has_current(frame):
        speed = np.hypot(frame["observer.current_north"], frame["observer.current_east"])
        parts.append(f"the current that it sees is {float(speed.mean()):.2f} m/s on average")
    parts.append(f"its test is {number(float(frame['observer.test'].mean()))} on average")
    return f"Along {counted(len(runs), 'test run')}, {', '.join(parts[:-1])}, and {parts[-1]}."


def _moments(content: ReportContent, run: str) -> Floats:
    orders = content.frame("orders")
    return orders.t[orders.run.eq(run)].to_numpy(dtype=float) if len(orders) else np.zeros(0)


def _height(rows: int) -> int:
    return MARGIN + rows * (ROW + GAP)


def _domain(row: int, rows: int) -> list[float]:
    """Share of the height that a row takes, from the top."""
    total = rows * (ROW + GAP)
    low = (rows - 1 - row) * (ROW + GAP) / total
    return [low, low + ROW / total]


def _upright(moments: Floats) -> list[dict[str, Any]]:
    """Dotted lines over the whole height at the moments of new orders."""
    rule = {"type": "line", "yref": "paper", "y0": 0, "y1": 1, "layer": "below"}
    return [{**rule, "x0": t, "x1": t, "line": {"color": MUTED, "width": 1, "dash": "dot"}} for t in moments.tolist()]


def _along(frame: pd.DataFrame, moments: Floats, rows: Sequence[Row]) -> Plot:
    t, traces, axes = frame.t.to_numpy(dtype=float), [], {}
    for place, row in enumerate(rows):
        suffix = "" if place == 0 else str(place + 1)
        for key, name, column in row.lines:
            ink = {"color": DRAWN[key], "width": 2.5 if key == "measured" else 1.8}
            ink |= {"dash": "dot"} if key == "measured" else {}
            values = row.factor * frame[column].to_numpy(dtype=float)
            unit = row.title.partition("[")[2].rstrip("]")
            traces.append(line(name, t, values, [f"key:{key}"], unit, line=ink, xaxis="x", yaxis=f"y{suffix}"))
        axes[f"yaxis{suffix}"] = axis(row.title, domain=_domain(place, len(rows)), anchor="x", nticks=4)
    y = axes.pop("yaxis")
    x = axis("time in the run [s]", anchor=f"y{len(rows)}")
    return Plot(traces, layout(x, y, hovermode="x unified", shapes=_upright(moments), **axes))


def gain(content: ReportContent) -> Figure | None:
    """H of both rivals over N_D, and their difference with its interval; None where nothing is compared."""
    frame = content.frame("memory")
    if frame.empty:
        return None
    compared = _comparisons(frame)
    models = _lines_for(frame)
    views = {str(i): [Panel(_differences(frame[frame.comparison.eq(one)], models))] for i, one in enumerate(compared)}
    return Figure(
        id="memory-gain",
        title="What memory and observer bought",
        takeaway=_takeaway_gain(frame),
        how="Above: H (15) with (solid) and without (dotted) what is compared, over the same test windows, mean over "
        "the seeds that both have. Below: the difference, with over without, with its 95 % interval from "
        "draws of the test runs with replacement, both rivals on the same runs, or Student's where that is wider, with "
        "what another training would give. "
        "Windows of one run are alike, so runs are drawn whole; with fewer than five runs there is none. Every "
        "interval is for one comparison alone: of many, one in twenty excludes 0 by chance."
        + _left_out(frame, models)
        + _unequal(frame),
        alternative="Lines of the position error H over the number of manoeuvres, in pairs with and without memory or "
        "observer; below, the difference of each pair with an interval. The numbers are in the table below.",
        height=640,
        views=views,
        controls=[Control("Compared", compared)],
        chips=[
            *(Chip(f"model:{name}", name, category(i)) for i, name in enumerate(models)),
            Chip("side:with", "with", INK),
            Chip("side:without", "without", INK, "dot"),
        ],
    )


def _comparisons(frame: pd.DataFrame) -> list[str]:
    return [str(name) for name in pd.unique(frame.comparison)]


def _by_accuracy(frame: pd.DataFrame) -> pd.Series[float]:
    """A [m] of every model, mean over N_D, by rising A; without physics last."""
    return frame.groupby("model", sort=False).A.mean().sort_values(kind="stable", na_position="last")


def _lines_for(frame: pd.DataFrame) -> list[str]:
    return spread([str(name) for name in _by_accuracy(frame).index], FEW)


def _left_out(frame: pd.DataFrame, models: Sequence[str]) -> str:
    total = frame.model.nunique()
    return "" if len(models) == total else f" Of {total} models, {len(models)} spread over A have lines."


def _unequal(frame: pd.DataFrame) -> str:
    """Sentence on rivals that differ in more than what they take from the past."""
    uneven = frame[frame.differs.ne("")].drop_duplicates("comparison")
    words = [f"{row.comparison} ({row.differs})" for row in uneven.itertuples()]
    return f" Not memory alone differs in {listed(words)}." if words else ""


def _amounts(frame: pd.DataFrame) -> tuple[list[int], list[str]]:
    """N_D of a comparison in order, and what its axis calls them."""
    amounts = sorted(int(value) for value in pd.unique(frame.N_D))
    return amounts, [str(amount) if amount else "physics alone" for amount in amounts]


def _differences(frame: pd.DataFrame, models: Sequence[str]) -> Plot:
    amounts, names = _amounts(frame)
    shown = [name for name in models if frame.model.eq(name).any()]
    traces = []
    for i, name in enumerate(shown):
        mine = frame[frame.model.eq(name)].sort_values("N_D")
        shift = 0.09 * (i - (len(shown) - 1) / 2)  # intervals of several models would hide each other
        x = np.array([amounts.index(int(value)) for value in mine.N_D], dtype=float)
        ink = {"color": category(list(models).index(name)), "width": 2}
        mark = {"color": ink["color"], "size": 6}
        for side, column, dash in (("without", "H_without", "dot"), ("with", "H_with", "solid")):
            keys = [f"model:{name}", f"side:{side}"]
            traces.append(
                line(f"{name}, {side}", x, mine[column].to_numpy(dtype=float), keys, mode="lines+markers",
                     line={**ink, "dash": dash}, marker=mark)
            )  # fmt: skip
        middle, low, high = (mine[column].to_numpy(dtype=float) for column in ("difference", "low", "high"))
        reach = {"type": "data", "symmetric": False, "color": ink["color"], "thickness": 1.5, "width": 4}
        reach |= {"array": np.nan_to_num(high - middle), "arrayminus": np.nan_to_num(middle - low)}
        points = line(
            f"{name}, difference", x + shift, middle, [f"model:{name}"], mode="markers", marker=mark, yaxis="y2"
        )
        points.update(error_y=reach, customdata=[_interval(row) for row in mine.to_dict("records")])
        points.update(hovertemplate=f"{label(name)}: %{{customdata}}<extra></extra>")
        traces.append(points)
    ends = [-0.5, len(amounts) - 0.5]
    title = "manoeuvres, N_D [1]" if amounts != [0] else ""
    across = axis(title, anchor="y2", tickvals=list(range(len(amounts))), ticktext=names, range=ends, showgrid=False)
    y = axis("position error, H [m]", domain=[0.52, 1.0])
    below = axis("difference of H [m]", domain=[0.0, 0.44], anchor="x")
    zero = {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "yref": "y2", "y0": 0, "y1": 0}
    shapes = [{**zero, "line": {"color": INK, "width": 1}}]
    return Plot(traces, layout(across, y, hovermode="closest", yaxis2=below, shapes=shapes))


def _interval(row: dict[Any, Any]) -> str:
    low, high = float(row["low"]), float(row["high"])
    if not math.isfinite(low):
        return f"{metres(float(row['difference']))}, no interval from fewer than five runs"
    return difference(float(row["difference"]), low, high)


def _takeaway_gain(frame: pd.DataFrame) -> str:
    trained = frame[frame.N_D > 0]
    frame = trained if len(trained) else frame
    last = frame[frame.N_D.eq(frame.N_D.max())]
    gains, losses = int((last.high < 0).sum()), int((last.low > 0).sum())
    best = last.nsmallest(1, "difference").iloc[0]
    which = f"{in_words(best.model)}, {_interval(best.to_dict())} ({best.comparison})"
    where = f"With N_D = {int(best.N_D)}" if best.N_D else "With physics alone"
    return (
        f"{where}, {gains} of {counted(len(last), 'comparison')} lower H and {losses} raise it with an interval free "
        f"of 0; the lowest difference is that of {which}."
    )


def windows(content: ReportContent) -> Figure | None:
    """Error of both rivals at every instant of a test run; None where nothing is compared."""
    frame, sums = content.frame("memory_over_time"), content.frame("memory")
    if frame.empty or sums.empty:
        return None
    shown = list(_extremes(sums[sums.N_D.isin(frame.N_D)]))
    runs = [str(run) for run in pd.unique(frame.run)]
    mine = frame[frame.comparison.eq(shown[0][0]) & frame.model.eq(shown[0][1])].dropna(subset=["error_with"])
    worst = mine.nlargest(1, "error_without").iloc[0]
    views = {}
    for (i, (comparison, model)), (j, run) in itertools.product(enumerate(shown), enumerate(runs)):
        here = frame[frame.comparison.eq(comparison) & frame.model.eq(model) & frame.run.eq(run)]
        views[f"{i}-{j}"] = [Panel(_window_lines(here, _moments(content, run)))]
    return Figure(
        id="memory-windows",
        title="Window by window",
        takeaway=_takeaway_windows(mine, worst),
        how="At each instant t of a test run: mean position error of the prediction made there, over its horizon, with "
        "and without what is compared, at the largest N_D, mean over seeds; below, the difference. Both are judged on "
        "the same windows, those with enough past before them. Of each comparison, the model that gains most and the "
        "one that gains least are offered. Dotted upright lines are new orders.",
        alternative="Two lines of the position error over the time of one test run, with and without memory or "
        "observer, and below a line of their difference.",
        height=460,
        views=views,
        controls=[
            Control("Compared", [f"{model}, {one}" for one, model in shown]),
            Control("Test run", runs, runs.index(str(worst.run))),
        ],
        chips=[Chip("side:with", "with; difference", category(0)), Chip("side:without", "without", INK, "dot")],
    )


def _extremes(frame: pd.DataFrame) -> Iterator[tuple[str, str]]:
    """Comparison and model of the largest and of the smallest gain of each comparison."""
    for comparison, mine in frame.groupby("comparison", sort=False):
        ordered = mine.sort_values("difference", kind="stable").model
        for model in dict.fromkeys([str(ordered.iloc[0]), str(ordered.iloc[-1])]):
            yield str(comparison), model


def _window_lines(frame: pd.DataFrame, moments: Floats) -> Plot:
    t = frame.t.to_numpy(dtype=float)
    before, after = (frame[column].to_numpy(dtype=float) for column in ("error_without", "error_with"))
    first, second = (str(frame[column].iloc[0]) for column in ("without", "with"))
    ink = {"color": category(0), "width": 2}
    traces = [
        line(first, t, before, ["side:without"], line={"color": INK, "width": 1.8, "dash": "dot"}),
        line(second, t, after, ["side:with"], line=ink),
        line("difference", t, after - before, ["side:with"], line=ink, yaxis="y2"),
    ]
    x = axis("time in the run [s]", anchor="y2")
    y = axis("position error [m]", rangemode="tozero", domain=[0.45, 1.0])
    below = axis("difference [m]", domain=[0.0, 0.36], anchor="x", nticks=5, zeroline=True, zerolinecolor=INK)
    inside = moments[(moments >= t.min()) & (moments <= t.max())]
    return Plot(traces, layout(x, y, hovermode="x unified", yaxis2=below, shapes=_upright(inside)))


def _takeaway_windows(mine: pd.DataFrame, worst: Any) -> str:
    share = 100 * float((mine.error_with < mine.error_without).mean())
    first, other = (in_words(mine[column].iloc[0]) for column in ("with", "without"))
    return (
        f"{first} errs less than {other} in {share:.0f} % of the windows of {counted(mine.run.nunique(), 'test run')}; "
        f"where the latter errs most, in {worst.run} at t = {worst.t:g} s, "
        f"{metres(worst.error_without)} become {metres(worst.error_with)}."
    )


def difference_map(content: ReportContent) -> Figure | None:
    """Difference of H over A and N_D; None where no model was trained with two amounts or two models at one."""
    frame = content.frame("memory")
    if frame.empty:
        return None
    frame = frame[frame.N_D > 0]
    compared = [one for one in _comparisons(frame) if len(frame[frame.comparison.eq(one)]) > 1]
    if not compared:
        return None
    kept = spread([str(name) for name in _by_accuracy(frame).index], MOST_ROWS)
    frame = frame[frame.model.isin(kept)]
    span = float(frame.difference.abs().max())
    groups = [frame[frame.comparison.eq(one)] for one in compared]
    return Figure(
        id="memory-map",
        title="On the map of physics and data",
        takeaway=_takeaway_map(frame),
        how="Each cell is a model, by its A from below, at an N_D: H with less H without what is compared. Blue is a "
        "gain, orange a loss, grey neither, paler the nearer to 0; bold where the 95 % interval over test runs is free "
        "of 0. The interval is in the table below." + _left_out(content.frame("memory"), kept),
        alternative=f"Cells with the difference of H for {counted(len(kept), 'model')} by A and N_D. "
        "The numbers are in the table below.",
        height=90 + CELL * max(group.model.nunique() for group in groups),
        views={str(i): [Panel(_cells(group, span))] for i, group in enumerate(groups)},
        controls=[Control("Compared", compared)],
    )


def _cells(frame: pd.DataFrame, span: float) -> Plot:
    amounts, names = _amounts(frame)
    accuracy = _by_accuracy(frame)
    models = [str(name) for name in accuracy.index]
    places = [
        (amounts.index(int(row["N_D"])), models.index(str(row["model"])), row) for row in frame.to_dict("records")
    ]
    shares = [min(abs(float(row["difference"])) / max(span, 1e-12), 1.0) for *_, row in places]
    boxes = marks(
        "bar",
        x=[x for x, _, _ in places],
        y=[0.9] * len(places),
        base=[y - 0.45 for _, y, _ in places],
        width=[0.94] * len(places),
        marker={
            "color": [_gain_or_loss(float(row["difference"])) for *_, row in places],
            "opacity": [round(0.08 + 0.62 * share, 3) for share in shares],
        },
        customdata=[f"{label(str(row['with']))}, N_D = {row['N_D']}: {_interval(row)}" for *_, row in places],
        hovertemplate="%{customdata}<extra></extra>",
    )
    words = marks(
        "scatter",
        x=[x for x, _, _ in places],
        y=[y for _, y, _ in places],
        mode="text",
        text=[_written(row) for *_, row in places],
        textfont={"color": INK, "size": 12},
        hoverinfo="skip",
    )
    ticks = [
        label(_shortened(name)) + (f", {number(value)}" if math.isfinite(value) else "")
        for name, value in zip(models, accuracy, strict=True)
    ]
    x = axis("manoeuvres, N_D [1]", tickvals=list(range(len(amounts))), ticktext=names, showgrid=False)
    y = axis(
        "model, A [m]",
        tickvals=list(range(len(models))),
        ticktext=ticks,
        range=[-0.6, len(models) - 0.4],
        showgrid=False,
    )
    return Plot([boxes, words], layout(x, y, hovermode="closest", barmode="overlay"))


def _gain_or_loss(difference: float) -> str:
    """Colour of a difference of H [m]: blue is a gain, orange a loss, and neither is grey."""
    return category(0) if difference < 0 else category(1) if difference > 0 else MUTED


def _written(row: dict[Any, Any]) -> str:
    value = number(float(row["difference"]))
    return f"<b>{value}</b>" if _sure(row) else value


def _shortened(name: str) -> str:
    """Cut the middle of a long name: its end is the number of the member."""
    return name if len(name) <= LONGEST else f"{name[: LONGEST - 7]}…{name[-6:]}"


def _sure(row: dict[Any, Any]) -> bool:
    return bool(float(row["high"]) < 0 or float(row["low"]) > 0)


def _takeaway_map(frame: pd.DataFrame) -> str:
    """Mean difference at the smallest and largest N_D of the first comparison."""
    mine = frame[frame.comparison.eq(_comparisons(frame)[0])]
    means = mine.groupby("N_D").difference.mean()
    few, many = int(means.index.min()), int(means.index.max())
    text = f"Over {counted(mine.model.nunique(), 'model')}, H changes by {metres(means[few])}"
    text += f" at N_D = {few} and by {metres(means[many])} at {many}, in the mean" if few != many else " on average"
    return f"{text} ({mine.comparison.iloc[0]})."


def table(content: ReportContent) -> Table | None:
    """Every comparison with its interval."""
    frame = content.frame("memory")
    if frame.empty:
        return None
    rows: list[list[Cell]] = []
    lengths = ("A", "H_without", "H_with", "difference")
    places = length_places(frame["H_without"])
    for row in frame.to_dict("records"):
        bracket = f"{number(row['low'])} to {number(row['high'])}" if math.isfinite(row["low"]) else "–"
        named = [text(row[name]) for name in ("without", "with")]
        numbers = [figure(row["N_D"], 0), *(figure(row[name], places) for name in lengths)]
        rows.append(
            [*named, *numbers, Cell(bracket, row["low"]), Cell(f"{row['better']} of {row['runs']}", row["better"])]
        )
    headings = ["without", "with", "N_D [1]", "A [m]", "H without [m]", "H with [m]", "difference [m]"]
    headings += ["95 % interval [m]", "better runs"]
    seeds = int(frame.seeds.max())
    takeaway = (
        f"{counted(len(frame), 'comparison')}; N_D = 0 is physics alone; means over {counted(seeds, 'seed')} at most."
    )
    return Table("memory-table", "Every comparison", takeaway, headings, [False] * 2 + [True] * 7, rows)


SECTION = Section(
    "What the past shows",
    draw=lambda content: (observer(content), gain(content), windows(content), difference_map(content), table(content)),
    anchors=("observer", "memory-gain", "memory-windows", "memory-map", "memory-table"),
)
