"""What physics and data buy: the map H(A, N_D), and H over N_D, a line per model."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from statistics import fmean
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shipid.report.content import DATA_DRIVEN, NO_PHYSICS, ReportContent, rows_as_tuples
from shipid.report.figure import (
    INK,
    MUTED,
    NAIVE,
    TRANSPARENT,
    Chip,
    ColourScale,
    Control,
    PageFigure,
    Panel,
    Trace,
    colour_level,
    escape_name,
    even_places,
    log_axis,
    make_axis,
    make_line,
    make_plot,
    spread_places,
)
from shipid.report.page import Section
from shipid.report.selection import (
    FEW_MODELS,
    MOST_MODELS,
    accuracy_range,
    data_driven,
    errors_alone,
    errors_over_seeds,
    family_words,
    model_chips,
    model_styles,
    nothing_learns,
    overview_models,
    same_physics,
    spread_items,
    words_on_left_out,
)
from shipid.report.wording import (
    CONSTANT_MOTION,
    REGRESSION,
    counted_text,
    join_few_names,
    metres_text,
    number_text,
    shorten_name,
)

HEIGHT, THICKEST_CELL = 580, 26  # of the map and at most of a cell [px]
MAP_MARGIN = {"l": 52, "r": 84, "t": 12, "b": 44}  # the right one holds the names of rows [px]
NAME_HEIGHT, ROW_HEIGHT = 13, 21  # least of a name, and of a row where there is room for all [px]
INSIDE = HEIGHT - MAP_MARGIN["t"] - MAP_MARGIN["b"]
ROUND_DIGITS = (1, 2, 3, 5, 7)  # of the ticks of A
ERROR_STATISTICS = {  # of the position error -> its column in the cells and of constant u, v, r, title of the axis
    "at the horizon": ("H_end", "end", "error at the horizon, mean [m]"),
    "at the horizon, 90th percentile": ("H_end_90", "end_90", "error at the horizon, 90th percentile [m]"),
    "mean": ("H", "mean", "mean over the horizon, H [m]"),
    "90th percentile": ("H_90", "p90", "90th percentile over the horizon, H_90 [m]"),
    "root mean square": ("rms", "rms", "root mean square over the horizon [m]"),
}


class CellMap(NamedTuple):
    """What a map shows.

    rows : model, family, A [m], y (square root of A, moved where rows would touch; models without A above), short (name
        beside the row), by A.
    cells : model, N_D (0: the physics alone), family, A, y, low and high (reach below and above y), H [m], worse (not
        below that without physics), words (of the hover box).
    """

    rows: pd.DataFrame
    cells: pd.DataFrame


def map_figure(content: ReportContent) -> PageFigure | None:
    """H over A and N_D; None where `map_lack` says why not, or H is A: nothing learns."""
    shown = map_of_cells(content)
    if shown is None or nothing_learns(content):
        return None
    rows, cells = shown
    twins = list(overview_models(content).loc[same_physics, "model"])
    hatched = f" Hatched: H is not below that of {_model_without_physics(rows)} at the same N_D."
    return PageFigure(
        id="map",
        title="Physics and data: the map",
        takeaway=content.sentence_of("map", _ends_of_errors(cells[cells.N_D > 0])),
        how="Each cell is a model, at its A on a square-root scale, given N_D manoeuvres; colour and number are H, the "
        "mean error over the horizon, mean over seeds. N_D = 0 is the physics alone, whose H is A: read A "
        "there, since rows that would touch are moved apart."
        + family_words(content, rows.family)
        + (hatched if cells.worse.any() else "")
        + words_on_left_out(content)
        + (f" Not on the map, where another method has their place: {join_few_names(twins, 6)}." if twins else "")
        + cells_without_result(content),
        alternative=f"Cells of the position error H for {counted_text(len(rows), 'model')} by A and N_D. "
        "The numbers are in the table of cells.",
        height=HEIGHT,
        draw=lambda: [draw_map(shown)],
        scale=ColourScale("mean error over the horizon, H [m]", float(cells.H.min()), float(cells.H.max()), "heat"),
    )


def map_lack(content: ReportContent) -> str:
    """What a map needs that the content does not have, as the end of a sentence; empty where it can be drawn."""
    cells = content.cells
    physics = cells[cells.family.ne(DATA_DRIVEN)].groupby("model").A.first()
    needs = {
        "rows of cells": not cells.empty,
        "two N_D or more": cells.N_D.nunique() > 1,
        "two models with physics or more": len(physics) > 1,
        "the column A [m], a number for two models with physics or more": physics.notna().sum() > 1,
        "cells with a result": not errors_over_seeds(content).merge(_rows_of_map(content)[["model"]]).empty,
    }
    return next((f"it needs {name}" for name, there in needs.items() if not there), "")


def map_of_cells(content: ReportContent, *, with_physics: bool = True) -> CellMap | None:
    """What the map shows, with the physics alone or not; None where `map_lack` says why not."""
    if map_lack(content):
        return None
    rows = _rows_of_map(content)
    half = np.minimum(np.diff(rows.y) / 2, THICKEST_CELL / 2 * 1.04 * rows.y.max() / INSIDE)  # way to the next row
    rows = rows.assign(low=np.insert(half, 0, half[0]), high=np.append(half, half[-1]))
    cells = content.cells[["model", "N_D"]].drop_duplicates().merge(rows.drop(columns="short"))
    cells = cells.merge(errors_over_seeds(content)[["model", "N_D", "H"]], how="left")
    if with_physics:
        alone = errors_alone(content)[["model", "N_D", "H"]].merge(rows.drop(columns="short"))
        cells = pd.concat([alone, cells], ignore_index=True)
    learned = cells.N_D.map(cells[cells.model.eq(data_driven(content) or "")].set_index("N_D").H)
    groups = {key: mine.to_dict("records") for key, mine in content.cells.groupby(["model", "N_D"])}
    words = [_cell_words(groups.get((row.model, row.N_D), []), row) for row in rows_as_tuples(cells)]
    return CellMap(rows, cells.assign(worse=cells.family.ne(DATA_DRIVEN) & cells.H.ge(learned), words=words))


def _rows_of_map(content: ReportContent) -> pd.DataFrame:
    """The models of the cells as `CellMap.rows`, rows apart; of several methods on the same physics the first."""
    frame = overview_models(content)
    frame = frame[~same_physics(frame)].reset_index(drop=True)
    top = math.sqrt(max(float(frame.A.max(skipna=True)), 1e-3)) if frame.A.notna().any() else 1.0
    strips = top * (1.05 + 0.06 * frame.A.isna().cumsum())
    parts = [str(name).partition(" + ") for name in frame.model]
    alike = len({method for _, _, method in parts}) == 1
    short = [foundation for foundation, _, _ in parts] if alike else frame.model
    y = np.sqrt(frame.A).where(frame.A.notna(), strips)
    gap = float(np.ptp(y)) * min(ROW_HEIGHT / INSIDE, 1 / max(len(y) - 1, 1))
    return frame.assign(y=spread_places(y.tolist(), gap, float(y.max())), short=short)


def _cell_words(cells: Sequence[dict[Hashable, Any]], row: Any) -> str:
    """The lines of the hover box of one model and N_D, of which there are some cells."""
    good = [one for one in cells if one["status"] == "ok" and math.isfinite(one["H"])]
    accuracy = f"A {metres_text(row.A)}, " if math.isfinite(row.A) else ""
    if not cells:
        return f"<b>{escape_name(row.model)}</b>, A {metres_text(row.A)}<br>the physics alone"
    lines = [f"<b>{escape_name(row.model)}</b>, {accuracy}N_D = {row.N_D}"]
    if not good:
        return "<br>".join([*lines, escape_name(f"{cells[0]['status']}: {cells[0]['sentence']}".rstrip(": "))])
    end, end_90, H_90 = (metres_text(fmean(one[name] for one in good)) for name in ("H_end", "H_end_90", "H_90"))
    lines += [f"H {metres_text(row.H)}, H_90 {H_90}", f"at the horizon {end}, nine in ten below {end_90}"]
    lost = f"{len(cells) - len(good)} of {counted_text(len(cells), 'seed')} gave no result"
    return "<br>".join([*lines, *[lost] * (len(good) < len(cells))])


def draw_map(shown: CellMap) -> Panel:
    """Draw cells at A and N_D, hatched or crossed where they are of no use."""
    rows, cells = shown
    counts = np.unique(cells.N_D)
    good, bad = cells[cells.H.notna()], cells[cells.H.isna()]
    span = float(good.H.min()), float(good.H.max())
    levels = [colour_level(value, span) for value in good.H]
    box = {"marker": {"color": [f"var(--heat-{level})" for level in levels], "line": {"width": 1, "color": MUTED}}}
    lattice = {"shape": "/", "fgcolor": "#000000", "size": 8, "solidity": 0.16}
    hatched = {"marker": {"color": TRANSPARENT, "line": {"width": 1.2, "color": INK}, "pattern": lattice}}
    cross = {"symbol": "x-thin", "size": 8, "line": {"width": 2, "color": "var(--bad)"}}
    digits = {"color": [f"var(--on-heat-{level})" for level in levels], "size": 12, "shadow": "auto"}
    numbers = {"text": [number_text(value) for value in good.H], "textfont": digits, "textangle": 0}
    numbers |= {"marker": {"color": TRANSPARENT}, "textposition": "inside", "insidetextanchor": "middle"}
    failed = bad.N_D.astype(str).tolist()
    hover = {"customdata": list(good.words), "hovertemplate": "%{customdata}<extra></extra>"}
    traces: list[Trace] = [
        {**_cell_bars(good), **box, **hover},
        {**_cell_bars(good[good.worse]), **hatched, "hoverinfo": "skip"},
        {**make_line("no result", [], bad.y, [], mode="markers", marker=cross, hover=list(bad.words)), "x": failed},
        {**_cell_bars(good), **numbers, "hoverinfo": "skip"},
    ]
    low, top = float((rows.y - rows.low).min()), float((rows.y + rows.high).max())
    room = 0.02 * (top - low)
    axis = {"type": "category", "categoryarray": counts.astype(str).tolist(), "showgrid": False}
    x = make_axis("manoeuvres, N_D [1]", range=[-0.5, len(counts) - 0.5], **axis)
    y = make_axis("error of the physics alone, A [m]", range=[low - room, top + room], **_ticks_of_map(rows, low))
    edge = (rows.y[rows.A.notna()].max() + rows.y[rows.A.isna()].min()) / 2
    rule = {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": edge, "y1": edge}
    rules = [{**rule, "line": {"color": MUTED, "width": 1, "dash": "dot"}}] * bool(rows.A.isna().any())
    more = {"annotations": _names_of_rows(rows, top - low), "margin": MAP_MARGIN, "shapes": rules}
    return make_plot(traces, x, y, barmode="overlay", uniformtext={"mode": "hide", "minsize": 9}, **more)


def _cell_bars(cells: pd.DataFrame) -> Trace:
    """Bars around each cell."""
    columns = {"y": (cells.low + cells.high).round(4), "base": (cells.y - cells.low).round(4)}
    bars = {name: values.tolist() for name, values in columns.items()}
    return {"type": "bar", "width": 0.9, "x": cells.N_D.astype(str).tolist(), **bars}


def _names_of_rows(rows: pd.DataFrame, height: float) -> list[dict[str, Any]]:
    """Names of the models, right of their cells; of more than have room there, some at even distances."""
    known, without = rows[rows.A.notna()].reset_index(drop=True), rows[rows.A.isna()]
    room = 1 + int(np.ptp(known.y) / height * INSIDE / NAME_HEIGHT)
    some = even_places(len(known), max(room, FEW_MODELS))
    heights = spread_places(known.y[some].tolist(), NAME_HEIGHT / INSIDE * height, float(known.y.max()))
    place = {"xref": "paper", "x": 1, "xanchor": "left", "xshift": 4, "showarrow": False}
    names = [*zip(heights, known.short[some], strict=True), *zip(without.y, without.short, strict=True)]
    return [
        {**place, "y": y, "text": escape_name(shorten_name(name)), "font": {"size": 11, "color": INK}}
        for y, name in names
    ]


def _ticks_of_map(rows: pd.DataFrame, low: float) -> dict[str, list[Any]]:
    """Round ticks of A, from the least A on."""
    largest = float(rows.A.max())
    decades = range(math.floor(math.log10(max(largest, 1e-6))) - 1, math.ceil(math.log10(max(largest, 1e-6))) + 1)
    ticks = [digit * 10.0**decade for decade in decades for digit in ROUND_DIGITS]
    values = [tick for tick in ticks if max(low, 0.0) ** 2 <= tick <= largest and tick >= largest / 40]
    return {"tickvals": list(np.sqrt(values)), "ticktext": [f"{value:g}" for value in values]}


def _model_without_physics(rows: pd.DataFrame) -> str:
    """The model without physics that others are compared with: by name where there are several."""
    return next(iter(rows.model[rows.family == DATA_DRIVEN]), NO_PHYSICS)


def ends_of_map(cells: pd.DataFrame) -> str:
    """The least and the greatest H, each with its model and N_D, as `least to greatest`."""
    ends = rows_as_tuples(cells.loc[[cells.H.idxmin(), cells.H.idxmax()]])
    return " to ".join(f"{metres_text(row.H)} ({row.model}, N_D = {row.N_D})" for row in ends)


def _ends_of_errors(cells: pd.DataFrame) -> str:
    return f"H runs from {ends_of_map(cells)}." if cells.H.notna().any() else "No cell gave a result."


def cells_without_result(content: ReportContent) -> str:
    """Sentence naming the cells that gave no result; empty if all did."""
    by, every = ["model", "N_D"], content.cells.groupby(["model", "N_D"]).size().to_dict()
    bad = content.cells[content.cells.status.ne("ok") | content.cells.H.isna()]
    names = [
        f"{key[0]} at N_D = {key[1]} ({failed.status.iloc[0]}"
        + (f", {len(failed)} of {every[key]} seeds)" if len(failed) < every[key] else ")")
        for key, failed in bad.groupby(by, sort=False)
    ]
    return f" Not plotted: {join_few_names(names, 6)}; reasons in the table of cells." if names else ""


def gain_lack(content: ReportContent) -> str:
    """Why there is nothing to draw, as the end of a sentence; empty where it can be drawn."""
    if content.cells.empty:
        return "it needs rows of cells"
    # The H of identified physics may differ from one cell to another.
    if nothing_learns(content) and not (content.cells.groupby("model").H.nunique() > 1).any():
        return "no method learns from data, so that every H is the A of its physics, whatever N_D"
    return ""


def gain_figure(content: ReportContent) -> PageFigure | None:
    """Error over N_D, from the physics alone on; None where `gain_lack` says why not."""
    if gain_lack(content):
        return None
    learned = errors_over_seeds(content).merge(overview_models(content)[["model"]])
    means = pd.concat([errors_alone(content), learned], ignore_index=True)
    statistics = [word for word, (column, *_) in ERROR_STATISTICS.items() if learned[column].notna().any()]
    statistics = statistics or list(ERROR_STATISTICS)
    looks, span, (order, drawn) = model_styles(content), accuracy_range(content), _models_with_line(content)
    accuracy = content.cells.groupby("model").A.first()
    words = {name: f"{name}, A {metres_text(accuracy[name])}" for name in order if np.isfinite(accuracy[name])}
    return PageFigure(
        id="gain",
        title="What another manoeuvre buys",
        takeaway=content.sentence_of("gain", _ends_of_errors(learned)),
        how="Position error at the horizon, or over all predicted points of all windows of all test manoeuvres: their "
        "mean is H (15), or A (14) for the physics alone, at N_D = 0. Where a cell has several seeds, the line joins "
        "their means and the pale points are the seeds. The dashed line is constant u, v, r: surge, sway and yaw rate "
        "stay as they are at the instant of prediction, the least that any model must beat; "
        "the dotted one is least squares of accelerations on motion and orders."
        + (" Colour is A; marker" if span else " Marker")
        + " and dashes are the family; N_D counts manoeuvres to train and to validate."
        + words_on_left_out(content)
        + drawn
        + cells_without_result(content),
        alternative=f"Lines of the position error over N_D for {counted_text(len(order), 'model')}. "
        "The numbers are in the table of cells.",
        height=460,
        draw=lambda statistic, kind: [_draw_sizes(content, means, order, statistic, kind == "logarithmic")],
        controls=[
            Control("Position error", statistics),
            Control("Axis", ["logarithmic", "linear"]),
        ],
        chips=[
            *model_chips(order, looks, words),
            Chip("naive", CONSTANT_MOTION, NAIVE, "dash"),
            *([Chip("regression", REGRESSION, NAIVE, "dot")] if len(content.frame("regression")) else []),
        ],
        scale=ColourScale("error of the physics alone, A [m]", *span) if span else None,
    )


def _models_with_line(content: ReportContent) -> tuple[list[str], str]:
    """Models that have a line, by A, and a sentence on those that have none: of many some, or no line is told apart."""
    frame = overview_models(content)
    pure = frame.family.eq(DATA_DRIVEN)
    physics = [str(name) for name in frame.model[~pure]]
    kept = {*spread_items(physics, MOST_MODELS), content.best, *frame.model[pure]}
    order = [str(name) for name in frame.model if name in kept]
    few = len(order) - int(pure.sum())
    words = (
        f" Of {len(physics)} models with physics, {few} spread over A have a line; the others are in the map and in "
    )
    return order, f"{words}the table of cells." if few < len(physics) else ""


def _draw_sizes(
    content: ReportContent, means: pd.DataFrame, order: Sequence[str], statistic: str, logarithmic: bool
) -> Panel:
    """Lines over N_D; what has no physics first: it must not cover the others."""
    (column, constant, title), looks = ERROR_STATISTICS[statistic], model_styles(content)
    sizes = sorted({*content.cells.N_D, *means.N_D})
    ended, traces = content.cells[content.cells.status.eq("ok")], []
    for name in (name for name in reversed(order) if means.model.eq(name).any()):
        look, keys, seeds = looks[name], [f"model:{name}"], ended[ended.model.eq(name)]
        marker = {"symbol": look.symbol, "size": 8, "color": look.colour}
        # A size whose cells all failed stays NaN: the line has a gap there.
        heights = means[means.model.eq(name)].set_index("N_D")[column].reindex(sizes)
        ink = {"color": look.colour, "width": look.width, "dash": look.dash}
        traces.append(make_line(name, sizes, heights, keys, mode="lines+markers", line=ink, marker=marker))
        if seeds.seed.nunique() > 1:
            faint: Trace = {"mode": "markers", "marker": {**marker, "size": 5}, "opacity": 0.4}
            traces.append(make_line(f"{name}, seed", seeds.N_D, seeds[column], keys, **faint))
    level, dashed = content.naive[constant], {"color": NAIVE, "dash": "dash", "width": 1.5}
    hover = f"{CONSTANT_MOTION}: {metres_text(level)}"
    traces.append(make_line(CONSTANT_MOTION, [sizes[0], sizes[-1]], [level] * 2, ["naive"], line=dashed, hover=hover))
    if len(known := content.frame("regression")):
        dotted = {**dashed, "dash": "dot"}
        traces.append(make_line(REGRESSION, known.N_D, known[column], ["regression"], line=dotted))
    x = make_axis("manoeuvres, N_D [1]", tickvals=[int(size) for size in sizes])
    return make_plot(traces, x, log_axis(title) if logarithmic else make_axis(title, rangemode="tozero"))


WHAT_PHYSICS_AND_DATA_BUY = Section(
    "What physics and data buy", {"map": (map_figure, "cells"), "gain": (gain_figure, "cells")}
)
