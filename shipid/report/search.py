"""The hyperparameter search: trials per cell, their states, the chosen values and the time they took."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from shipid.report.content import TRIAL_COLUMNS, Floats, ReportContent
from shipid.report.figure import (
    INK,
    MUTED,
    Chip,
    Control,
    PageFigure,
    Panel,
    category_colour,
    escape_name,
    even_places,
    log_axis,
    make_axis,
    make_line,
    make_plot,
)
from shipid.report.page import Section
from shipid.report.selection import figure_sizes
from shipid.report.tables import PageTable, frame_table
from shipid.report.wording import counted_text, duration_text, fixed_text, number_text

MOST_DOTS = 1200  # of a kind in one panel: more hide each other
MEDIAN_BINS = 9  # of the middle line
WIDE_RANGE = 3.0  # largest / smallest value from which an axis is logarithmic
HIGHEST_RATIO, DIVERGED_RATIO = 4.0, 5.0  # times the best of the cell: farther off is drawn here, and what diverged
HYPERPARAMETER_UNITS = {"delays": "s"}  # others have none
STATES_OF_TRIALS = {  # outcome of a trial -> its name in the legend, marker and colour; the first is drawn smaller
    "complete": ("trial", "circle", MUTED),
    "stopped": ("stopped early", "triangle-up", category_colour(4)),
    "diverged": ("diverged", "x", "var(--bad)"),
    "chosen": ("chosen", "diamond", category_colour(0)),
}


def search_figure(content: ReportContent) -> PageFigure | None:
    """Error of the trials over each searched hyperparameter; None without trials or without any."""
    names, frame = searched_names(content), _with_ratio(content.trials)
    if not names or frame.empty:
        return None
    counts = figure_sizes(frame.N_D) if frame.N_D.nunique() > 1 else []
    early = "triangles are those that a race ended early; "
    thinned = f"of many, at most {MOST_DOTS:,} are drawn in a panel; "
    return PageFigure(
        id="search",
        title="Trials of the search",
        takeaway=_takeaway_search(frame, names),
        how="Each dot is a trial: the root of its validation error over the best of its cell; "
        + (thinned if len(frame) > MOST_DOTS else "")
        + (early if frame.state.eq("stopped").any() else "")
        + "diamonds are those that the cell uses; those beyond "
        f"{HIGHEST_RATIO:g} times lie at the upper edge, those that diverged above it. The line joins the medians. "
        "Rank correlation (Spearman) is taken within each cell, then averaged over cells: it sees "
        "what rises or falls throughout, not an optimum in the middle.",
        alternative="Dots of the relative validation error of trials over each hyperparameter; a table sums up.",
        height=270,
        draw=lambda size="all": [
            _draw_trials(mine, name, frame[name])
            for mine in [frame if size == "all" else frame[frame.N_D.eq(size)]]
            for name in names
        ],
        controls=[Control("Manoeuvres, N_D", ["all", *counts])] if counts else [],
        chips=[
            *(
                Chip(f"state:{state}", word, colour, "none", symbol=symbol)
                for state, (word, symbol, colour) in STATES_OF_TRIALS.items()
                if state == "chosen" or frame.state.eq(state).any()
            ),
            Chip("median", "median", INK),
        ],
        captions=[
            f"rank correlation {fixed_text(value, 2)}" if math.isfinite(value) else "no rank correlation"
            for value in (trial_rank_correlation(frame, name) for name in names)
        ],
    )


def searched_names(content: ReportContent) -> list[str]:
    """Names of the searched hyperparameters: further columns of the trials that take more than one value."""
    frame = content.trials
    return [str(name) for name in frame.columns if name not in TRIAL_COLUMNS and frame[name].nunique() > 1]


def trial_rank_correlation(frame: pd.DataFrame, name: str) -> float:
    """Rank correlation of the error with a hyperparameter within cells, mean over cells; NaN where nothing varies."""
    cells = frame[frame.value.notna() & frame[name].notna() & frame.cell.notna()].groupby("cell")
    cell, counts = cells.ngroup().to_numpy(), cells.size().to_numpy()
    x, y = cells[[name, "value"]].rank().to_numpy(dtype=float).T - (counts[cell] + 1) / 2
    xy, xx, yy = (np.bincount(cell, product, len(counts)) for product in (x * y, x * x, y * y))
    varying = (counts > 2) & (xx > 0) & (yy > 0)
    return float((xy[varying] / np.sqrt(xx * yy)[varying]).mean()) if varying.any() else math.nan


def _with_ratio(trials: pd.DataFrame) -> pd.DataFrame:
    """Trials with `ratio` [1]: the root of the value over the best of the cell; one that diverged has no value."""
    good = trials.value.where(trials.state.ne("diverged")).astype(float)
    best = good.where(trials.state.eq("complete")).groupby(trials.cell).transform("min")
    return trials.assign(value=good, ratio=np.sqrt(good / best))


def _draw_trials(frame: pd.DataFrame, name: str, every: pd.Series[float]) -> Panel:
    """One hyperparameter; its axis holds `every` value, so that it stays when N_D changes."""
    drawn, traces = frame.iloc[even_places(len(frame), MOST_DOTS)], []
    states = drawn.state.mask(drawn.chosen.astype(bool), "chosen").to_numpy()
    x, ratio = (drawn[column].to_numpy(dtype=float) for column in (name, "ratio"))
    y = np.where(np.isnan(ratio), DIVERGED_RATIO, np.minimum(ratio, HIGHEST_RATIO)).round(3)
    unit = f" {HYPERPARAMETER_UNITS[name]}" if name in HYPERPARAMETER_UNITS else ""
    for state, (_, symbol, colour) in STATES_OF_TRIALS.items():
        mine = states == state
        known = "" if state == "diverged" else ", %{y:.2f} times the best of its cell"
        hover = f"{state}: {escape_name(name.replace('_', ' '))} %{{x:.3g}}{unit}{known}"
        look: Any = {
            "marker": {"symbol": symbol, "size": 6 - 2 * (state == "complete"), "color": colour, "opacity": 0.6},
            "hover": hover,
        }
        traces.append(make_line(state, x[mine], y[mine], [f"state:{state}"], mode="markers", **look))
    middle = _median_ratios(frame[frame.ratio.notna()], name)
    ink = {"color": INK, "width": 2.5}
    traces.insert(3, make_line("median", middle[:, 0], middle[:, 1], ["median"], "times the best", line=ink))
    ticks = {1: "1", 1.5: "1.5", 2: "2", 3: "3", HIGHEST_RATIO: f"≥{HIGHEST_RATIO:g}", DIVERGED_RATIO: "div."}
    span = [-0.02, math.log10(DIVERGED_RATIO) + 0.04]
    up = log_axis("error / best of cell [1]", tickvals=list(ticks), ticktext=list(ticks.values()), range=span)
    return make_plot(traces, _axis_of_values(name, every), up)


def _median_ratios(frame: pd.DataFrame, name: str) -> Floats:
    """Median ratio per value of a hyperparameter, or of `MEDIAN_BINS` parts of them where there are many: (n, 2)."""
    values = frame[name].astype(float)
    if values.nunique() < 2:
        return np.empty((0, 2))
    groups = values if values.nunique() <= MEDIAN_BINS else values.rank(pct=True).mul(MEDIAN_BINS).apply(np.ceil)
    medians = pd.DataFrame({"x": values, "y": frame.ratio}).groupby(groups).median().sort_values("x")
    return np.asarray(np.minimum(medians.to_numpy(dtype=float), [np.inf, HIGHEST_RATIO]))


def _axis_of_values(name: str, every: pd.Series[float]) -> dict[str, Any]:
    """Axis of a hyperparameter: yes and no, logarithmic where its values are factors apart, or linear."""
    if set(every.dropna()) == {0.0, 1.0}:
        return make_axis(escape_name(name.replace("_", " ")), tickvals=[0, 1], ticktext=["no", "yes"])
    ends = np.array([every.min(), every.max()], dtype=float)
    axis = log_axis if ends[0] > 0 and ends[1] / ends[0] > WIDE_RANGE else make_axis
    low, high = np.log10(ends) if axis is log_axis else ends
    room = 0.04 * (high - low)
    title = f"{name.replace('_', ' ')} [{HYPERPARAMETER_UNITS.get(name, '1')}]"
    return axis(escape_name(title), range=[low - room, high + room], nticks=3)


def _takeaway_search(frame: pd.DataFrame, names: list[str]) -> str:
    """The median ratio of a trial to the best of its cell, and the hyperparameter most correlated with it."""
    if frame.ratio.isna().all():
        return f"None of {counted_text(len(frame), 'trial')} ended with a value."
    text = (
        f"The median error of a trial is {number_text(float(frame.ratio.median()))} times that of the best of its cell"
    )
    correlations = {name: value for name in names if math.isfinite(value := trial_rank_correlation(frame, name))}
    if correlations:
        most = max(correlations, key=lambda name: abs(correlations[name]))
        text += (
            f"; errors vary most with {most.replace('_', ' ')}, rank correlation {fixed_text(correlations[most], 2)}"
        )
    return f"{text}."


def search_table(content: ReportContent) -> PageTable:
    """Sum the trials up by N_D."""
    frame = content.trials
    states = pd.crosstab(frame.N_D, frame.state).reindex(columns=["stopped", "diverged"], fill_value=0)
    groups = frame.groupby("N_D", sort=True)
    shown = states.assign(cells=groups.cell.nunique(), trials=groups.size())
    shown = shown.assign(epochs=groups.epochs.sum()) if frame.epochs.any() else shown  # methods in closed form have 0
    columns = {
        "N_D [1]": "N_D",
        "cells [1]": "cells",
        "trials [1]": "trials",
        "stopped [1]": "stopped",
        "diverged [1]": "diverged",
        "epochs [1]": "epochs",
        "time [s]": "seconds",
        "time per cell [s]": "each",
    }
    stopped, diverged = (int(states[state].sum()) or "none" for state in ("stopped", "diverged"))
    takeaway = (
        f"{counted_text(len(frame), 'trial')} in {counted_text(frame.cell.nunique(), 'cell')}: {stopped} stopped "
    )
    takeaway += f"early, {diverged} diverged; {duration_text(float(frame.seconds.sum()))} of training."
    shown = shown.assign(seconds=groups.seconds.sum(), each=groups.seconds.sum() / shown.cells).reset_index()
    return frame_table("search-table", "The search by N_D", takeaway, shown, columns)


THE_SEARCH = Section("The search", {"search": (search_figure, "trials"), "search-table": (search_table, "trials")})
