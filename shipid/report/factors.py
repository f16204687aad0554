"""The models: how each was degraded, every perturbed number as a dot at its factor; tables of models and cells."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from shipid.report.content import DATA_DRIVEN, ReportContent, model_text, rows_as_tuples
from shipid.report.figure import (
    INK,
    MARKERS,
    Chip,
    PageFigure,
    Panel,
    category_colour,
    escape_name,
    log_axis,
    make_line,
    make_plot,
    names_axis,
)
from shipid.report.page import Section
from shipid.report.selection import models_by_accuracy
from shipid.report.tables import PageTable, frame_table, with_cells, word_cell
from shipid.report.wording import counted_text, duration_text, join_few_names, number_text, shorten_name

STRIP_HEIGHT = 30  # height of a model [px]
MODEL_COLUMNS = {
    "model": "model",
    "family": "family",
    "at the horizon [m]": "A_end",
    "nine in ten below [m]": "A_end_90",
    "A [m]": "A",
    "A_90 [m]": "A_90",
    "rms [m]": "A_rms",
    "A along [m]": "A_along",
    "A across [m]": "A_across",
    "diverged in training [1]": "diverged_training",
    "diverged in the test [1]": "diverged_test",
    "status": "status",
    "what it is": "description",
}


CELLS = {
    "model": "model",
    "A [m]": "A",
    "N_D [1]": "N_D",
    "data [min]": "minutes",
    "seed": "seed",
    "at the horizon [m]": "H_end",
    "nine in ten below [m]": "H_end_90",
    "H [m]": "H",
    "H_90 [m]": "H_90",
    "rms [m]": "rms",
    "in band [1]": "coverage",
    "radius of band [m]": "width",
    "status": "status",
    "time [s]": "seconds",
    "trials [1]": "trials",
    "stopped [1]": "stopped",
    "diverged [1]": "diverged",
    "chosen": "hyperparameters",
}


def factors_figure(content: ReportContent) -> PageFigure | None:
    """Dot strips of the factors, a row per model by rising A; None without rows."""
    frame = content.factors[content.factors.factor.notna()]
    if frame.empty:
        return None
    names = [str(name) for name in models_by_accuracy(content).model if name in set(frame.model)]
    bases = set(content.models.model[content.models.family.ne(DATA_DRIVEN)])  # further methods have their numbers
    untouched = [str(name) for name in models_by_accuracy(content).model if name in bases and name not in names]
    crosses = bool((frame.factor <= 0).any())  # a factor without a logarithm
    return PageFigure(
        id="factors",
        title="How the models were degraded",
        takeaway=_takeaway_factors(frame, names),
        how="One dot per perturbed number, at its factor on the base model, logarithmic; rows by "
        "rising A."
        + (" A factor that is not positive lies at the left edge: 0 removes the term." if crosses else "")
        + (f" Not perturbed: {join_few_names(untouched, 6)}." if untouched else ""),
        alternative=f"Dots at the factors of {counted_text(len(names), 'model')}; the table of models has A.",
        height=STRIP_HEIGHT * len(names) + 70,
        draw=lambda: [_draw_strips(frame, names)],
        chips=_group_chips(frame),
    )


def family_figure(factors: pd.DataFrame) -> PageFigure:
    """Dot strips of the factors (members, paths) of a family, a row per perturbed number with a dot per member."""
    rows = [
        (path, member, path.partition(".")[0], factor)
        for path in map(str, factors)
        for member, factor in factors[path].dropna().items()
    ]
    frame = pd.DataFrame(rows, columns=["model", "path", "group", "factor"])
    names = [str(name) for name in pd.unique(frame.model)]
    span = " to ".join(number_text(end) for end in (frame.factor.min(), frame.factor.max()))
    return PageFigure(
        id="factors",
        title="How the members differ from their base",
        takeaway=f"{counted_text(len(names), 'number')} of {counted_text(len(factors), 'member')}, times {span}.",
        how="One dot per member, at its factor on the base, logarithmic; one that is not positive is at the left edge.",
        alternative="Dots at the factors of every member.",
        height=max(STRIP_HEIGHT * len(names), 150) + 70,
        draw=lambda: [_draw_strips(frame, names)],
        chips=_group_chips(frame),
    )


def _group_chips(frame: pd.DataFrame) -> list[Chip]:
    """A chip for each group of perturbed numbers (`hull`, `inertia`)."""
    return [
        Chip(f"group:{name}", str(name).replace("_", " "), category_colour(i), "none", symbol=MARKERS[i % len(MARKERS)])
        for i, name in enumerate(pd.unique(frame.group))
    ]


def _draw_strips(frame: pd.DataFrame, names: list[str]) -> Panel:
    positive = frame.factor[frame.factor > 0].to_numpy(dtype=float)
    low, high = positive.min(initial=0.8), positive.max(initial=1.25)  # at least a quarter down and up
    edge = low * (low / high) ** 0.08
    groups, traces = pd.unique(frame.group), []
    for i, group in enumerate(groups):
        mine = frame[frame.group.eq(group) & frame.model.isin(names)]
        # Each group is drawn a little below the one before, so that equal factors do not hide each other.
        y = np.array([names.index(name) for name in mine.model]) + 0.24 * i / max(1, len(groups) - 1)
        marker = {"symbol": MARKERS[i % len(MARKERS)], "size": 8, "color": category_colour(i), "opacity": 0.75}
        words = [escape_name(f"{row.model}: {row.path} × {row.factor:.3g}") for row in rows_as_tuples(mine)]
        x = mine.factor.where(mine.factor > 0, edge)
        traces.append(make_line(str(group), x, y, [f"group:{group}"], mode="markers", marker=marker, hover=words))
    removed = bool((frame.factor <= 0).any())
    room, ends = 0.03 * math.log10(high / low), np.log10([edge if removed else low, high])
    x_axis = log_axis("factor [1]", range=[ends[0] - room, ends[1] + room], nticks=4, tickangle=0)
    y_axis = names_axis([shorten_name(name) for name in names], range=[len(names) - 0.4, -0.4])
    rule = {
        "type": "line",
        "layer": "below",
        "yref": "paper",
        "x0": 1,
        "x1": 1,
        "y0": 0,
        "y1": 1,
        "line": {"color": INK, "width": 1},
    }
    return make_plot(traces, x_axis, y_axis, shapes=[rule])


def _takeaway_factors(frame: pd.DataFrame, names: list[str]) -> str:
    """How many numbers, how far from 1, and which model is farthest from its base."""
    positive, removed = frame[frame.factor > 0], int((frame.factor == 0).sum())
    kept, models = frame.factor[frame.factor != 0], counted_text(len(names), "model")
    span = " to ".join(dict.fromkeys((number_text(kept.min()), number_text(kept.max()))))
    text = f"{counted_text(len(kept), 'number')} in {models}, times {span}" if len(kept) else f"{models} changed"
    text += f"; {counted_text(removed, 'term')} removed" if removed else ""
    if positive.model.nunique() > 1:
        away = np.exp(np.sqrt((np.log(positive.factor) ** 2).groupby(positive.model).mean()))
        text += f"; {away.idxmax()} is farthest from its base, by a factor of {away.max():.2f} (root mean square)"
    return f"{text}."


def models_table(content: ReportContent) -> PageTable:
    """List the models, by rising A."""
    frame = content.models.sort_values("A", kind="stable", na_position="last")
    known = frame[frame.A.notna()]
    ends = [f"{number_text(row.A)} m ({row.model})" for row in rows_as_tuples(known)]
    takeaway = f"A runs from {ends[0]} to {ends[-1]}." if len(ends) > 1 else "No physics model could be judged."
    takeaway = f"A of {known.model.iloc[0]} is {number_text(known.A.iloc[0])} m." if len(ends) == 1 else takeaway
    return frame_table(
        "models",
        "Every model",
        takeaway,
        with_failures(frame).assign(family=frame.family.map(model_text)),
        MODEL_COLUMNS,
    )


def cells_table(content: ReportContent) -> PageTable:
    """Every cell of the study, with how many trials it had; a failed one shows its status in place of numbers."""
    frame, trials = content.cells, content.trials
    bad = int((frame.status.ne("ok") | frame.H.isna()).sum())
    takeaway = f"{counted_text(len(frame), 'cell')} in {duration_text(float(frame.seconds.sum()))} of computing; "
    takeaway += f"{counted_text(bad, 'cell')} gave no result." if bad else "all gave a result."
    frame = frame.drop(columns="trials", errors="ignore")  # of a stored cell: the list of them
    if len(trials):
        states = pd.crosstab(trials.cell, trials.state).reindex(columns=["stopped", "diverged"], fill_value=0)
        states = states.assign(trials=trials.groupby("cell").size())
        frame = frame.merge(states, how="left", left_on="cell", right_index=True)
    return frame_table("cells", "Every cell", takeaway, with_failures(frame), CELLS)


def with_failures(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with a `status` that says why there is no result, or what to know of it."""
    why = frame.get("sentence", pd.Series("", index=frame.index)).fillna("")
    pairs = zip(frame.status, why, strict=True)
    cells = [word_cell(f"{status}: {words}" if words else status, bad=status != "ok") for status, words in pairs]
    return with_cells(frame, status=cells)


THE_MODELS = Section("The models", {"factors": (factors_figure, "factors"), "models": (models_table, "models")})
THE_CELLS = Section("The cells", {"cells": (cells_table, "cells")})
