"""Where the error grows: over the horizon, and over the time of a test run with its commands below."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from shipid.report import tables
from shipid.report.content import Floats, Indices, ReportContent
from shipid.report.figure import Chip, Control, Figure, Panel, Plot, Trace, apart, axis, layout, line, silent
from shipid.report.palette import DASHES, INK, NAIVE, close_styles
from shipid.report.section import Section
from shipid.report.selection import (
    FEW_RUNS,
    data_driven,
    drawn_source,
    exemplars,
    in_words,
    over_seeds,
    sizes,
    spread,
    thinned,
)
from shipid.report.wording import CONSTANT, counted, listed, metres, shortened

BY = ["model", "source", "N_D"]
ERROR, GAP, COMMAND, MARGIN = 270, 30, 104, 56  # heights of the parts of error over time [px]
PIXELS = 540  # twice the height of the error over time
LONGEST = 14  # characters of a name beside a line
NAME = 0.055  # height of a name beside a line, as a share of the greatest error
LEADER, LETTER, EDGE = 16, 7, 6  # line from an end to its name; a letter of a name, at most; space around it [px]
STATISTICS = {  # option -> column of the frame, title of the axis, unit
    "mean": ("mean", "position error, mean", "m"),
    "90th percentile": ("p90", "position error, 90th percentile", "m"),
    "along (surge)": ("along", "error along, mean absolute", "m"),
    "across (sway)": ("across", "error across, mean absolute", "m"),
    "course": ("course", "error of the course, mean absolute", "deg"),
}
BY_AXIS = (
    " Along and across are the axes of the ship at the instant of prediction (11), the directions of surge and sway. "
    "Predictors give positions, so no error of the heading is shown. The course is the direction of the track, "
    "where the ship truly makes 0.2 m/s or more."
)
COMMAND_DASHES = ("solid", "dash", "dot", "dashdot")


def horizon(content: ReportContent) -> Figure | None:
    """Mean and 90th percentile of the error at each second ahead; None without rows."""
    if content.horizon.empty:
        return None
    frame = _settled(content.horizon, content)
    statistics = {word: given for word, given in STATISTICS.items() if given[0] in frame}
    columns = [column for column, *_ in statistics.values()]
    means, counts = over_seeds(frame, [*BY, "ahead"], columns), sizes(frame.N_D)
    groups = frame[frame.source.eq("cooperative")].groupby([*BY, "ahead"])
    seeds = {column: groups[column].agg(["min", "max", "size"]).reset_index() for column in columns}
    views = {}
    for (i, (column, title, unit)), (j, size) in itertools.product(enumerate(statistics.values()), enumerate(counts)):
        traces = _traces(content, means[means.N_D.isin([0, size])], "ahead", column, unit)
        traces = [*_seed_bands(content, traces, seeds[column][seeds[column].N_D.eq(size)]), *traces]
        y = axis(f"{title} [{unit}]", rangemode="tozero")
        names = _names_at_the_end(traces)
        reach = float(means.ahead.max())
        x = axis("time ahead [s]", range=[0.0, reach])
        room = (
            LEADER + EDGE + LETTER * max((len(name["text"]) for name in names), default=0)
        )  # that names fit any window
        margin = {"l": 48, "r": max(12, room), "t": 12, "b": 44}
        plot = layout(x, y, hovermode="x unified", annotations=names, margin=margin)
        views[f"{i}-{j}"] = [Panel(Plot(traces, plot))]
    return Figure(
        id="horizon",
        title="Error over the horizon",
        takeaway=_takeaway_horizon(content, means, counts[-1]),
        how="Position error of the points predicted that many seconds ahead, over all windows of all test manoeuvres, "
        "mean over seeds."
        + (" Pale bands reach from the least seed to the greatest." if (seeds["mean"]["size"] > 1).any() else "")
        + (BY_AXIS if "along" in columns else "")
        + _drawn(content),
        alternative="Lines of the position error that grow with the time ahead, one per model with and without "
        "compensation.",
        height=420,
        views=views,
        controls=[Control("Error", list(statistics)), _size_control(counts)],
        chips=model_chips(content, set(means.source)),
    )


def over_time(content: ReportContent) -> Figure | None:
    """Error per instant of prediction of a test run, the commands below on the same axis; None without times."""
    if content.over_time.empty:
        return None
    frame = _settled(content.over_time, content)
    runs = spread(sorted(frame.run[frame.t.notna()].unique()), FEW_RUNS)
    if not runs:
        return None
    means = over_seeds(frame[frame.run.isin(runs)], [*BY, "run", "t"], ["error"])
    counts = sizes(means.N_D)
    # Controls show run first: it is what a reader looks for.
    by_run = dict(iter(means.groupby("run", sort=False)))
    views = {
        f"{i}-{j}": [Panel(_with_commands(content, by_run[run][by_run[run].N_D.isin([0, size])], run))]
        for (i, run), (j, size) in itertools.product(enumerate(runs), enumerate(counts))
    }
    left = content.over_time.run.nunique() - len(runs)
    last = means[means.N_D.isin([0, counts[-1]])]
    worst = _worst(content, last)
    return Figure(
        id="over-time",
        title="Error over time",
        takeaway=_takeaway_time(worst, last),
        how="At each instant t of a test run: mean position error of the prediction made there, over its horizon. "
        "The commands that were given are below."
        + (f" Of {seeds} seeds the first is drawn." if (seeds := content.cells["seed"].nunique()) > 1 else "")
        + _drawn(content)
        + (f" {counted(left, 'test run')} more are not drawn." if left else ""),
        alternative="Lines of the position error over the time of one test run, above lines of its commands.",
        height=_height(content.commands),
        views=views,
        controls=[Control("Test run", runs, 0 if worst is None else runs.index(worst.run)), _size_control(counts)],
        chips=[*model_chips(content, set(means.source)), *_command_chips(content.commands)],
    )


def model_chips(content: ReportContent, sources: set[str]) -> list[Chip]:
    """Legend of a close-up: models by colour, sources by dash."""
    looks = close_styles(content)
    chips = [
        Chip(f"model:{name}", name, looks[name].colour, width=looks[name].width, symbol=looks[name].symbol)
        for name in exemplars(content)
    ]
    sources = {drawn_source(content, name, source) for name in exemplars(content) for source in sources}
    words = {"cooperative": "compensated or no physics", "physics": "physics alone", "naive": CONSTANT}
    return chips + [
        Chip(f"source:{source}", word, NAIVE if source == "naive" else INK, DASHES[source])
        for source, word in words.items()
        if source in sources
    ]


def _settled(frame: pd.DataFrame, content: ReportContent) -> pd.DataFrame:
    """Return the rows of the models in the close-up; physics and naive do not depend on N_D and have N_D = 0."""
    frame = frame.assign(N_D=frame.N_D.where(frame.source.eq("cooperative"), 0).astype(int))
    frame["model"] = frame.model.astype(object).where(frame.source.ne("naive"), "")
    kept = frame.model.isin(exemplars(content)) | frame.source.eq("naive")
    counts = sizes(frame.N_D)
    return frame[kept & frame.N_D.isin([0, *counts])]


def _drawn(content: ReportContent) -> str:
    """Return a sentence on which models are drawn; empty if all are."""
    total, shown = content.models.model.nunique(), exemplars(content)
    return (
        ""
        if len(shown) >= total
        else f" Of {total} models, the middle one of each family by A, and the best in validation: {listed(shown, 6)}."
    )


def _size_control(counts: Sequence[int]) -> Control:
    return Control("Manoeuvres, N_D", [str(count) for count in counts], len(counts) - 1)


def _traces(content: ReportContent, means: pd.DataFrame, across: str, column: str, unit: str = "m") -> list[Trace]:
    looks, pure, traces = close_styles(content), data_driven(content), []
    # What has no physics first: thick ink must not cover the others.
    places: dict[Any, Any] = dict(means.groupby(["model", "source"], sort=False).indices)
    groups = sorted(places.items(), key=lambda group: (group[0][0] != pure, group[1][0]))
    every = means[[across, column]].to_numpy(dtype=float)
    visible = _visible([every[mine] for _, mine in groups])
    for (key, _), points in zip(groups, visible, strict=True):
        model, given = (str(part) for part in key)
        source = drawn_source(content, model, given)
        ink = {"color": NAIVE, "width": 1.5} if source == "naive" else {"color": looks[model].colour}
        ink = {"width": looks[model].width if given == "cooperative" else 1.5, **ink} if model else ink
        name = CONSTANT if source == "naive" else model if model == pure else f"{model}, {_word(source)}"
        keys = [f"source:{source}"] + ([f"model:{model}"] if model else [])
        traces.append(line(name, points[:, 0], points[:, 1], keys, unit, line={"dash": DASHES[source], **ink}))
        if model and given == "cooperative":
            mark = {"symbol": looks[model].symbol, "size": 7, "color": ink["color"], "maxdisplayed": 9}
            traces[-1].update(mode="lines+markers", marker=mark)
    return traces


def _seed_bands(content: ReportContent, traces: Sequence[Trace], seeds: pd.DataFrame) -> list[Trace]:
    """Areas from the least to the greatest seed at each time ahead, in the colours of the lines of their models."""
    colours = {
        key: trace["line"]["color"] for trace in traces for key in trace["meta"] if trace["mode"] == "lines+markers"
    }
    bands = []
    for name, mine in seeds[seeds["size"] > 1].groupby("model", sort=False):
        ahead = mine["ahead"].to_numpy(dtype=float)
        x, y = np.concatenate([ahead, ahead[::-1]]), np.concatenate([mine["max"], mine["min"].to_numpy()[::-1]])
        colour = colours.get(f"model:{name}")
        if colour is not None:
            keys = [f"source:{drawn_source(content, str(name), 'cooperative')}", f"model:{name}"]
            bands.append(line(f"{name}, seeds", x, y, keys, line={"width": 0}, fill="toself", fillcolor=colour))
            bands[-1] = silent(bands[-1]) | {"opacity": 0.18}
    return bands


def _names_at_the_end(traces: Sequence[Trace]) -> list[dict[str, Any]]:
    """Names joined to the ends of the compensated lines, moved apart where they would collide in this view.

    Of more names than have room, some at even distances.
    """
    most = max((float(np.nanmax(t["y"])) for t in traces if np.isfinite(t["y"]).any()), default=0.0)
    ends = sorted(
        ((float(t["y"][-1]), float(t["x"][-1]), t) for t in traces if t["mode"] == "lines+markers" and len(t["y"])),
        key=lambda end: end[:2],
    )
    ends = [ends[int(i)] for i in spread([str(i) for i in range(len(ends))], int(1 / NAME))]
    heights = apart([height for height, _, _ in ends], NAME * most, 1.1 * most)
    notes = []
    for height, (end, place, trace) in zip(heights, ends, strict=True):
        short = trace["name"].removesuffix(f", {_word('cooperative')}").removesuffix(f", {_word('physics')}")
        short = shortened(short, LONGEST)
        colour = trace["line"]["color"]
        text = {"text": short, "xanchor": "left", "align": "left", "font": {"size": 11, "color": colour}}
        leader = {"axref": "pixel", "ayref": "y", "ax": LEADER, "ay": height, "arrowhead": 0, "arrowwidth": 1}
        notes.append({"x": place, "y": end, **text, **leader, "arrowcolor": colour, "showarrow": True})
    return notes


def _word(source: str) -> str:
    return "compensated" if source == "cooperative" else "physics alone"


def _visible(lines: Sequence[Floats]) -> list[Floats]:
    """Points of lines (n, 2) that differ visibly at the height of the plot; a line with gaps keeps all."""
    kept = list(lines)
    whole = [i for i, line in enumerate(lines) if len(line) and np.isfinite(line).all()]
    unit = [lines[i] / np.maximum(np.ptp(lines[i], axis=0), 1e-9) for i in whole]
    for i, chosen in zip(whole, thinned(unit, 1 / PIXELS), strict=True):
        kept[i] = lines[i][chosen]
    return kept


def _changes(values: Floats) -> Indices:
    """Find the samples of a held command that a step line needs: where it changes, and both ends."""
    changed = np.flatnonzero(np.diff(values) != 0)
    return np.unique(np.concatenate([[0], changed, changed + 1, [len(values) - 1]]))


def _height(commands: pd.DataFrame) -> int:
    return MARGIN + ERROR + (COMMAND + GAP) * len(_units(commands))


def _units(commands: pd.DataFrame) -> dict[str, list[str]]:
    """Map each unit to the command columns in it, in the order of the frame."""
    units: dict[str, list[str]] = {}
    for column in commands.columns:
        if column not in ("run", "t"):
            units.setdefault(column.partition("[")[2].rstrip("] ") or "1", []).append(column)
    return units


def _command_chips(commands: pd.DataFrame) -> list[Chip]:
    return [
        Chip(f"command:{column}", column.partition("[")[0].strip(), INK, COMMAND_DASHES[i % 4], 1.5)
        for columns in _units(commands).values()
        for i, column in enumerate(columns)
    ]


def _with_commands(content: ReportContent, means: pd.DataFrame, run: str) -> Plot:
    """Error on top; below, one row per unit of the commands, all on one time axis."""
    units = _units(content.commands)
    mine = content.commands[content.commands.run == run]
    traces, total = _traces(content, means, "t", "error"), _height(content.commands) - MARGIN
    axes = {}
    for row, (unit, columns) in enumerate(units.items(), start=2):
        for i, column in enumerate(columns):
            t, values = mine.t.to_numpy(dtype=float), mine[column].to_numpy(dtype=float)
            keep = _changes(values)
            ink = {"color": INK, "width": 1.5, "dash": COMMAND_DASHES[i % 4], "shape": "hv"}
            name = column.partition("[")[0].strip()
            traces.append(
                line(name, t[keep], values[keep], [f"command:{column}"], unit, line=ink, xaxis="x", yaxis=f"y{row}")
            )
        low = (len(units) - row + 1) * (COMMAND + GAP) / total
        shared = ", ".join(sorted({column.partition("[")[0].split()[-1] for column in columns}))
        axes[f"yaxis{row}"] = axis(f"{shared} [{unit}]", domain=[low, low + COMMAND / total], anchor="x", nticks=4)
    # The time axis belongs to the lowest row, so that it is drawn at the bottom and shared by all.
    lowest = "y" if not units else f"y{len(units) + 1}"
    x = axis("time in the run [s]", anchor=lowest)
    y = axis("position error [m]", rangemode="tozero", domain=[1 - ERROR / total, 1.0])
    return Plot(traces, layout(x, y, hovermode="x unified", **axes))


def _takeaway_horizon(content: ReportContent, means: pd.DataFrame, size: int) -> str:
    end = means[means.ahead.eq(means.ahead.max()) & means.N_D.isin([0, size])]
    together = end[end.source == "cooperative"].set_index("model")["mean"]
    alone = end[end.source == "physics"].set_index("model")["mean"]
    if together.empty:
        return "No compensated model gave a prediction."
    pure = data_driven(content)
    best = content.best if content.best in together.index else str(together.idxmin())
    of = "" if content.best in together.index or len(together) < 2 else f", the least of {len(together)} models"
    text = f"{means.ahead.max():g} s ahead and with N_D = {size}, {in_words(best)} is "
    text += f"{metres(together[best])} off on average{of}"
    text += f", its physics alone {metres(alone[best])}" if best in alone.index else ""
    return text + (
        f"; {in_words(pure)} {metres(together[pure])}." if pure and pure != best and pure in together.index else "."
    )


def _worst(content: ReportContent, means: pd.DataFrame) -> Any | None:
    """Row of the run and instant at which the best model, compensated, errs most; None without one."""
    together = means[means.source == "cooperative"]
    if together.empty:
        return None
    best = content.best if content.best in set(together.model) else str(together.model.iloc[0])
    return together[together.model == best].nlargest(1, "error").iloc[0]


def _takeaway_time(worst: Any | None, means: pd.DataFrame) -> str:
    if worst is None:
        return "No compensated model gave a prediction."
    text = f"{in_words(worst.model)} errs most in {worst.run} at t = {worst.t:g} s: {metres(worst.error)}"
    same = means[
        means.model.eq(worst.model) & means.source.eq("physics") & means.run.eq(worst.run) & means.t.eq(worst.t)
    ]
    return f"{text} on average over the horizon" + (
        f", where its physics alone errs by {metres(float(same.error.iloc[0]))}." if len(same) else "."
    )


SECTION = Section(
    "Where the error grows",
    draw=lambda content: (horizon(content), tables.kinds(content), over_time(content)),
    anchors=("horizon", "kinds", "over-time"),
)
