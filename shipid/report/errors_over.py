"""Where the error grows: over the horizon, and over the time of a test run with its commands below."""

from __future__ import annotations

from typing import Any

import pandas as pd

from shipid.report.content import ReportContent, rows_as_tuples
from shipid.report.figure import (
    INK,
    LINE_DASHES,
    MOST_LINE_POINTS,
    NAIVE,
    Chip,
    Control,
    PageFigure,
    Panel,
    Trace,
    even_places,
    log_axis,
    make_axis,
    make_line,
    make_plot,
)
from shipid.report.page import Section
from shipid.report.selection import (
    SOURCE_DASHES,
    close_styles,
    close_up_models,
    data_driven,
    drawn_source,
    figure_sizes,
    in_words,
    model_chips,
    nothing_learns,
    over_seeds,
)
from shipid.report.tables import PageTable, frame_table
from shipid.report.wording import CONSTANT_MOTION, counted_text, join_few_names, metres_text, number_text

LINE_COLUMNS = ["model", "source", "N_D"]
ERROR_HEIGHT, COMMAND_HEIGHT = 326, 134  # of the error over time and of a row of commands below it [px]
HORIZON_ERRORS = {  # option -> column of the frame, title of the axis, unit
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
KIND_COLUMNS = {
    "kind of run": "kind",
    "test runs": "runs",
    "model": "model",
    "how": "how",
    "at the horizon [m]": "end",
    "mean over the horizon [m]": "mean",
}
HOW_PREDICTED = {"naive": CONSTANT_MOTION, "physics": "physics alone", "cooperative": "with data"}


def horizon_figure(content: ReportContent) -> PageFigure:
    """Mean and 90th percentile of the error at each second ahead."""
    frame = _rows_of_close_up(content.horizon, content)
    statistics = [word for word, (column, *_) in HORIZON_ERRORS.items() if column in frame]
    columns, counts = [HORIZON_ERRORS[word][0] for word in statistics], figure_sizes(frame.N_D)
    means = over_seeds(frame, [*LINE_COLUMNS, "ahead"], columns)
    last = means["mean"][means.ahead.eq(means.ahead.max())]
    ends = f"{metres_text(last.min())} to {metres_text(last.max())}"
    return PageFigure(
        id="horizon",
        title="Error over the horizon",
        takeaway=content.sentence_of("horizon", f"At the horizon mean errors run from {ends}."),
        how="Position error of the points predicted that many seconds ahead, over all windows of all test manoeuvres, "
        "mean over seeds." + (BY_AXIS if "along" in columns else "") + _models_of_close_up(content),
        alternative="Lines of the position error that grow with the time ahead, one per model with and without "
        "compensation.",
        height=420,
        draw=lambda word, size: [_draw_horizon(content, means, word, size)],
        controls=[Control("Error", statistics), Control("Manoeuvres, N_D", counts, len(counts) - 1)],
        chips=close_up_chips(content, set(means.source)),
    )


def _draw_horizon(content: ReportContent, means: pd.DataFrame, statistic: str, size: int) -> Panel:
    column, title, unit = HORIZON_ERRORS[statistic]
    lines = _error_lines(content, means[means.N_D.isin([0, size])], "ahead", column, unit)
    x = make_axis("time ahead [s]", range=[0.0, float(means.ahead.max())])
    return make_plot(lines, x, log_axis(f"{title} [{unit}]"), hovermode="x unified")


def time_figure(content: ReportContent) -> PageFigure | None:
    """Error per instant of prediction of a test run, the commands below on the same axis; None without times."""
    frame = _rows_of_close_up(content.over_time, content)
    runs, size = sorted(frame.run[frame.t.notna()].unique()), figure_sizes(frame.N_D)[-1]
    if not runs:
        return None
    means = over_seeds(frame[frame.run.isin(runs) & frame.N_D.isin([0, size])], [*LINE_COLUMNS, "run", "t"], ["error"])
    seeds = content.cells["seed"].nunique()
    worst, units = _worst_instant(content, means), _commands_by_unit(content.commands)
    chips = [
        Chip(f"command:{column}", column.partition("[")[0].strip(), INK, LINE_DASHES[i % 4], 1.5)
        for columns in units.values()
        for i, column in enumerate(columns)
    ]
    return PageFigure(
        id="over-time",
        title="Error over time",
        takeaway=_takeaway_time(worst, means),
        how="At each instant t of a test run: mean position error of the prediction made there, over its horizon"
        + (f", with N_D = {size}" if size else "")
        + ". The commands that were given are below."
        + (f" Of {seeds} seeds the first is drawn." if seeds > 1 else "")
        + _models_of_close_up(content),
        alternative="Lines of the position error over the time of one test run, above lines of its commands.",
        height=ERROR_HEIGHT + COMMAND_HEIGHT * len(units),
        draw=lambda run: [_draw_time(content, means[means.run == run], content.commands[content.commands.run == run])],
        controls=[Control("Test run", runs, 0 if worst is None else runs.index(worst.run))],
        chips=[*close_up_chips(content, set(means.source)), *chips],
    )


def close_up_chips(content: ReportContent, sources: set[str]) -> list[Chip]:
    """Legend of a close-up: models by colour, sources by dash."""
    names = close_up_models(content)
    drawn = {drawn_source(content, name, source) for name in names for source in sources}
    words = {"cooperative": "compensated or no physics", "physics": "physics alone", "naive": CONSTANT_MOTION}
    chips = [
        Chip(f"source:{source}", word, NAIVE if source == "naive" else INK, SOURCE_DASHES[source])
        for source, word in words.items()
        if source in drawn
    ]
    return [*model_chips(names, close_styles(content)), *chips]


def _rows_of_close_up(frame: pd.DataFrame, content: ReportContent) -> pd.DataFrame:
    """The rows of the models in the close-up; physics and naive do not depend on N_D and have N_D = 0."""
    frame = frame.assign(N_D=frame.N_D.where(frame.source.eq("cooperative"), 0).astype(int))
    frame["model"] = frame.model.astype(object).where(frame.source.ne("naive"), "")
    kept = frame.model.isin(close_up_models(content)) | frame.source.eq("naive")
    return frame[kept & frame.N_D.isin([0, *figure_sizes(frame.N_D)])]


def _models_of_close_up(content: ReportContent) -> str:
    """A sentence on which models are drawn; empty if all are."""
    total, shown = content.models.model.nunique(), close_up_models(content)
    names = join_few_names(shown, 6)
    words = f" Of {total} models, some spread over A and the best in validation: {names}."
    return words if len(shown) < total else ""


def _error_lines(content: ReportContent, means: pd.DataFrame, over: str, column: str, unit: str = "m") -> list[Trace]:
    """A line for each model and source; what has no physics first: thick ink must not cover the others."""
    looks, pure, traces = close_styles(content), data_driven(content), []
    groups: list[Any] = list(means.groupby(["model", "source"], sort=False))
    for (model, given), mine in sorted(groups, key=lambda group: (group[0][0] != pure, group[0][1])):
        points, look = mine.iloc[even_places(len(mine), MOST_LINE_POINTS)], line_look(content, model, given)
        mark = {"symbol": looks[model].symbol, "size": 7, "maxdisplayed": 9} if model in looks else {}
        more: Trace = {"mode": "lines+markers", "marker": mark} if mark and given == "cooperative" else {}
        ends = points[over], points[column], look["keys"], unit
        traces.append(make_line(look["name"], *ends, line=look["line"], **more))
    return traces


def line_look(content: ReportContent, model: str, given: str) -> dict[str, Any]:
    """`name`, `keys` of the chips that hide it, and `line` of a path or an error of a close-up."""
    source, look = drawn_source(content, model, given), close_styles(content).get(model)
    name = f"{model}, {'compensated' if source == 'cooperative' else 'physics alone'}"
    name = model if model == data_driven(content) else name
    width = look.width if look and given == "cooperative" else 1.5
    ink = {"color": look.colour if look else NAIVE, "dash": SOURCE_DASHES[source], "width": width}
    keys = [f"source:{source}", *[f"model:{model}"] * bool(model)]
    return {"name": CONSTANT_MOTION if source == "naive" else name, "keys": keys, "line": ink}


def _commands_by_unit(commands: pd.DataFrame) -> dict[str, list[str]]:
    """Map each unit to the command columns in it, in the order of the frame."""
    units: dict[str, list[str]] = {}
    for column in commands.columns.drop(["run", "t"]):
        units.setdefault(column.partition("[")[2].rstrip("] ") or "1", []).append(column)
    return units


def _draw_time(content: ReportContent, means: pd.DataFrame, commands: pd.DataFrame) -> Panel:
    """Error on top; below, one row per unit of the commands, all on one time axis."""
    units, traces = _commands_by_unit(commands), _error_lines(content, means, "t", "error")
    share, axes = COMMAND_HEIGHT / (ERROR_HEIGHT + COMMAND_HEIGHT * len(units)), {}
    for row, (unit, columns) in enumerate(units.items(), start=2):
        for i, column in enumerate(columns):
            ink = {"color": INK, "width": 1.5, "dash": LINE_DASHES[i % 4], "shape": "hv"}
            name, place = column.partition("[")[0].strip(), {"xaxis": "x", "yaxis": f"y{row}"}
            traces.append(make_line(name, commands.t, commands[column], [f"command:{column}"], unit, line=ink, **place))
        low = (len(units) - row + 1) * share
        shared = ", ".join(sorted({column.partition("[")[0].split()[-1] for column in columns}))
        axes[f"yaxis{row}"] = make_axis(f"{shared} [{unit}]", domain=[low, low + 0.78 * share], anchor="x", nticks=4)
    # The time axis belongs to the lowest row, so that it is drawn at the bottom and shared by all.
    x = make_axis("time in the run [s]", anchor=f"y{len(units) + 1}" if units else "y")
    y = make_axis("position error [m]", rangemode="tozero", domain=[len(units) * share, 1.0])
    return make_plot(traces, x, y, hovermode="x unified", **axes)


def _worst_instant(content: ReportContent, means: pd.DataFrame) -> Any | None:
    """Row of the run and instant at which the best model, compensated, errs most; None without one."""
    together = means[means.source == "cooperative"]
    known = together[together.model == content.best] if content.best in set(together.model) else together
    return None if known.empty else known.nlargest(1, "error").iloc[0]


def _takeaway_time(worst: Any | None, means: pd.DataFrame) -> str:
    if worst is None:
        return "No compensated model gave a prediction."
    text = f"{in_words(worst.model)} errs most in {worst.run} at t = {worst.t:g} s: {metres_text(worst.error)}"
    same = means[means.source.eq("physics")].merge(worst.to_frame().T[["model", "run", "t"]].astype({"t": float}))
    alone = f", where its physics alone errs by {metres_text(float(same.error.iloc[0]))}" if len(same) else ""
    return f"{text} on average over the horizon{alone}."


def error_by_kind(content: ReportContent) -> PageTable:
    """Error over the horizon and at its end, by kind of test run."""
    frame = content.frame("kinds")
    how = [
        HOW_PREDICTED[row.source] + (f", {counted_text(int(row.N_D), 'run')}" if row.N_D else "")
        for row in rows_as_tuples(frame[["source", "N_D"]])
    ]
    of, source = ("of physics alone", "physics") if nothing_learns(content) else ("with data", "cooperative")
    learned = frame[frame.source.eq(source)]
    best = learned.loc[learned.groupby("kind", sort=False)["mean"].idxmin()] if len(learned) else learned
    parts = [
        f"{row['kind']} {number_text(row['end'])} m at the horizon, H {number_text(row['mean'])} m ({row['model']})"
        for row in best.to_dict("records")
    ]
    takeaway = (
        f"Lowest errors {of}, which only the test shows, too late for a choice: {'; '.join(parts)}."
        if parts
        else "No model with data has a result."
    )
    shown = frame.assign(how=how, model=frame.model.where(frame.model.ne("naive"), ""))
    return frame_table("kinds", "Errors by kind of run", takeaway, shown, KIND_COLUMNS)


WHERE_ERRORS_GROW = Section(
    "Where the error grows",
    {
        "horizon": (horizon_figure, "horizon"),
        "kinds": (error_by_kind, "kinds"),
        "over-time": (time_figure, "over_time"),
    },
)
