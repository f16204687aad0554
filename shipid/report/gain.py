"""What physics and data buy: H over N_D, one line per model, or A -> H per model when there is one N_D."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shipid.report.content import DATA_DRIVEN, ReportContent
from shipid.report.figure import (
    Chip,
    Control,
    Figure,
    Panel,
    Plot,
    Scale,
    Trace,
    axis,
    label,
    layout,
    line,
    logarithmic,
    silent,
)
from shipid.report.palette import INK, NAIVE, Style, accuracy_range, styles
from shipid.report.selection import data_driven, in_words, left_out, nothing_learns, overview, spread, trained
from shipid.report.wording import CONSTANT, counted, listed, metres, shortened

ROW = 46  # height of a model in the dumbbell figure [px]
MOST_LINES, FAR = 12, 30.0  # models with physics that have a line; H by the least H that needs a logarithmic axis
LONGEST = 28  # characters of a name that fit beside its numbers on a phone


class Statistic(NamedTuple):
    """One way to sum up the position error: its columns in the cells, the models and constant u, v, r."""

    name: str
    cell: str
    model: str
    naive: str


STATISTICS = (
    Statistic("mean", "H", "A", "mean"),
    Statistic("90th percentile", "H_90", "A_90", "p90"),
    Statistic("root mean square", "rms", "A_rms", "rms"),
)
HOW = (
    "Position error over all predicted points of all windows of all test manoeuvres: its mean is H (15), of the "
    "physics alone A (14). Where a cell was trained with several seeds, {seeds}. The dashed line is constant u, v, r: "
    "surge, sway and yaw rate stay as they are at the instant of prediction, the least that any model must beat."
)


def gain(content: ReportContent) -> Figure | None:
    """H over N_D, or the dumbbell A -> H when the study has a single N_D; None where `lack` says why not."""
    if lack(content):
        return None
    means = trained(content).merge(overview(content)[["model"]])
    return _over_size(content, means) if content.cells.N_D.nunique() > 1 else _dumbbell(content, means)


def lack(content: ReportContent) -> str:
    """Why there is nothing to draw, as the end of a sentence; empty where it can be drawn."""
    if content.cells.empty:
        return "it needs rows of cells"
    if nothing_learns(content) and not _differs(content):
        return "no method learns from data, so that every H is the A of its physics, whatever N_D"
    return ""


def _differs(content: ReportContent) -> bool:
    """Whether the H of some model differs from one cell to another, as that of identified physics does."""
    return bool((content.cells.groupby("model").H.nunique() > 1).any())


def unplotted(content: ReportContent) -> str:
    """Sentence naming the cells that gave no result; empty if all did."""
    names, by = [], ["model", "N_D"]
    every = content.cells.groupby(by, sort=False).size().to_dict()
    bad = content.cells[content.cells.status.ne("ok") | content.cells.H.isna()]
    for (model, size), failed in bad.groupby(by, sort=False):
        count = every[model, size]
        share = f", {len(failed)} of {count} seeds" if len(failed) < count else ""
        names.append(f"{model} at N_D = {size} ({failed.status.iloc[0]}{share})")
    return f" Not plotted: {listed(names, 6)}; reasons in the table of cells." if names else ""


def _over_size(content: ReportContent, means: pd.DataFrame) -> Figure:
    looks, span = styles(content), accuracy_range(content)
    order, drawn = _lined(content)
    shown = {name: looks[name] for name in order}
    views = {
        f"{i}-{j}": [Panel(plot)]
        for i, statistic in enumerate(STATISTICS)
        for j, plot in enumerate(_lines(content, means, statistic, shown))
    }
    heights = means.H[means.model.isin(order) & means.H.gt(0)]
    far = len(heights) > 0 and heights.max() > FAR * heights.min()
    accuracy = content.cells.groupby("model").A.first()
    chips = [
        Chip(
            f"model:{name}",
            f"{name}, A {metres(accuracy[name])}" if np.isfinite(accuracy[name]) else name,
            looks[name].colour,
            width=looks[name].width,
            symbol=looks[name].symbol,
        )
        for name in order
    ]
    return Figure(
        id="gain",
        title="What another manoeuvre buys",
        takeaway=_takeaway_sizes(content, means),
        how=HOW.format(seeds="the line joins their means and the pale points are the seeds")
        + (" Colour is A; the" if span else " The")
        + " marker is the family; N_D counts manoeuvres to train and to validate."
        + left_out(content)
        + drawn
        + unplotted(content),
        alternative=f"Lines of the position error over the number of manoeuvres for {counted(len(order), 'model')}. "
        "The numbers are in the table of cells.",
        height=460 if len(order) <= 10 else 560,
        views=views,
        controls=[
            Control("Position error", [statistic.name for statistic in STATISTICS]),
            Control("Axis", ["linear", "logarithmic"], int(far)),
        ],
        chips=[*chips, Chip("naive", CONSTANT, NAIVE, "dash")],
        scale=Scale("error of the physics alone, A [m]", *span) if span else None,
    )


def _lined(content: ReportContent) -> tuple[list[str], str]:
    """Models that have a line, by A, and a sentence on those that have none: of many some, or no line is told apart."""
    frame = overview(content)
    pure = frame.family.eq(DATA_DRIVEN)
    physics = [str(name) for name in frame.model[~pure]]
    kept = {*spread(physics, MOST_LINES), content.best, *frame.model[pure]}
    order = [str(name) for name in frame.model if name in kept]
    few = len(order) - int(pure.sum())
    words = (
        f" Of {len(physics)} models with physics, {few} have a line: some spread over A" if few < len(physics) else ""
    )
    words += " and the best in validation" if words and content.best else ""
    return order, f"{words}; the others are in the map and in the table of cells." if words else ""


def _lines(content: ReportContent, means: pd.DataFrame, statistic: Statistic, looks: Mapping[str, Style]) -> list[Plot]:
    """Lines over N_D, on a linear and on a logarithmic axis."""
    sizes = sorted(content.cells.N_D.unique())
    traces = []
    ended = content.cells[content.cells.status.eq("ok")]
    each = {str(name): seeds for name, seeds in ended.groupby("model", sort=False)}
    middle = {str(name): mine.set_index("N_D")[statistic.cell] for name, mine in means.groupby("model", sort=False)}
    for name, style in reversed(list(looks.items())):  # what has no physics first: it must not cover the others
        if name not in middle:
            continue
        marker = {"symbol": style.symbol, "size": 8, "color": style.colour}
        keys = [f"model:{name}"]
        # A size whose cells all failed stays NaN: the line has a gap there.
        heights = middle[name].reindex(sizes).to_numpy()
        ink = {"color": style.colour, "width": style.width}
        traces.append(line(name, sizes, heights, keys, mode="lines+markers", line=ink, marker=marker))
        seeds = each[name]
        if seeds.seed.nunique() > 1:
            faint, values = {**marker, "size": 5}, seeds[statistic.cell].to_numpy()
            dots = line(f"{name}, seed", seeds.N_D.to_numpy(), values, keys, "m", "markers", marker=faint)
            traces.append({**dots, "opacity": 0.4})
    traces.append(_floor(content, statistic, [sizes[0], sizes[-1]], across=True))
    x = axis("manoeuvres, N_D [1]", tickvals=[int(size) for size in sizes])
    title = f"position error, {statistic.name} [m]"
    return [
        Plot(traces, layout(x, y, hovermode="closest")) for y in (axis(title, rangemode="tozero"), logarithmic(title))
    ]


def _floor(content: ReportContent, statistic: Statistic, ends: list[float], across: bool) -> Trace:
    level = [content.naive[statistic.naive]] * 2
    ink = {"color": NAIVE, "dash": "dash", "width": 1.5}
    trace = line(CONSTANT, *((ends, level) if across else (level, ends)), ["naive"], line=ink)
    trace["hovertemplate"] = f"{CONSTANT}: {metres(level[0])}<extra></extra>"
    return trace


def _takeaway_sizes(content: ReportContent, means: pd.DataFrame) -> str:
    pure = data_driven(content)
    if means.empty:
        return "No cell gave a result."
    parts = []
    for size in (means.N_D.min(), means.N_D.max()):
        here = means[means.N_D.eq(size)].set_index("model").H
        known = [
            f"{in_words(name)} has H = {metres(here[name])}"
            for name in (content.best, pure)
            if name and name in here.index
        ]
        parts.append(
            f"at N_D = {size}, {' and '.join(known) or f'H runs from {metres(here.min())} to {metres(here.max())}'}"
        )
    best = f" {content.best} is the best in validation." if content.best else ""
    return f"{parts[0][0].upper()}{parts[0][1:]}; {parts[1]}.{best}"


def _dumbbell(content: ReportContent, means: pd.DataFrame) -> Figure:
    looks, sizes = styles(content), content.cells.N_D.unique()
    names = [str(name) for name in overview(content).model]
    ranked = means.set_index("model").H.reindex(names).sort_values(na_position="last")
    views = {
        str(i): [Panel(_dumbbells(content, means, statistic, looks, list(ranked.index)))]
        for i, statistic in enumerate(STATISTICS)
    }
    return Figure(
        id="gain",
        title="What compensation buys",
        takeaway=_takeaway_dumbbell(content, means),
        how=f"Open marker: the physics alone; filled: with the compensator trained on N_D = {sizes[0]} manoeuvres. "
        + HOW.format(seeds="the filled marker is their mean and the pale points are the seeds")
        + left_out(content)
        + unplotted(content),
        alternative=f"Position error before and after compensation for {counted(len(names), 'model')}. "
        "The numbers are in the tables of models and cells.",
        height=ROW * len(names) + 90,
        views=views,
        controls=[Control("Position error", [statistic.name for statistic in STATISTICS])],
        chips=[
            Chip("before", "physics alone", INK, "none", symbol="circle-open"),
            Chip("after", "with compensation (or no physics)", INK, "none", symbol="circle"),
            Chip("naive", CONSTANT, NAIVE, "dash"),
        ],
    )


def _dumbbells(
    content: ReportContent, means: pd.DataFrame, statistic: Statistic, looks: Mapping[str, Style], names: list[str]
) -> Plot:
    before = content.models.set_index("model")[statistic.model].reindex(names).astype(float)
    after = means.set_index("model")[statistic.cell].reindex(names)
    traces, texts = [_floor(content, statistic, [len(names) - 0.4, -0.6], across=False)], []
    for row, name in enumerate(names):
        colour, old, new = looks[name].colour, before[name], after[name]
        good = content.cells[content.cells.model.eq(name) & content.cells.status.eq("ok")][statistic.cell]
        traces.append(line(name, [old, new], [row, row], ["before", "after"], line={"color": colour, "width": 3}))
        traces[-1] = silent(traces[-1])
        traces.append(_dot(name, old, row, "before", "circle-open", colour))
        if len(good) > 1:
            traces += [_dot(name, each, row, "after", "circle", colour, small=True) for each in good]
        traces.append(_dot(name, new, row, "after", "circle", colour))
        texts.append(_row_text(name, row, old, new))
    x = axis(f"position error, {statistic.name} [m]", rangemode="tozero")
    y = axis("", range=[len(names) - 0.4, -0.75], showticklabels=False, showgrid=False)
    return Plot(traces, layout(x, y, annotations=texts, hovermode="closest", margin={"l": 8, "r": 12, "t": 4, "b": 44}))


def _dot(name: str, value: float, row: int, key: str, symbol: str, colour: str, small: bool = False) -> Trace:
    marker = {"symbol": symbol, "size": 7 if small else 13, "color": colour, "line": {"width": 2, "color": colour}}
    what = "physics alone" if key == "before" else "with compensation"
    trace = line(name, [value], [row], [key], mode="markers", marker=marker, opacity=0.4 if small else 1.0)
    trace["hovertemplate"] = f"{label(name)}, {what}: %{{x:.4~r}} m<extra></extra>"
    return trace


def _row_text(name: str, row: int, old: float, new: float) -> dict[str, Any]:
    """Return the name and numbers of a row as text; it is written above the row, so long names need no margin."""
    numbers = " → ".join(metres(value) for value in (old, new) if np.isfinite(value))
    if not np.isfinite(new):
        numbers += " → no result"
    short = shortened(name, LONGEST)
    return {
        "bgcolor": "var(--page)",
        "x": 0,
        "xref": "paper",
        "xanchor": "left",
        "y": row,
        "yshift": 17,
        "showarrow": False,
        "font": {"size": 12},
        "text": f"<b>{label(short)}</b>  {numbers}",
    }


def _takeaway_dumbbell(content: ReportContent, means: pd.DataFrame) -> str:
    after = means.set_index("model").H
    if after.empty:
        return "No cell gave a result."
    before = content.models.set_index("model").A.reindex(after.index).dropna()
    better = before.index[after[before.index] < before]
    best, pure = content.best, data_driven(content)
    text = (
        f"{best}, best in validation, has H = {metres(after[best])}; compensation"
        if best in after.index
        else "Compensation"
    )
    text += f" improves {len(better)} of {counted(len(before), 'physics model')}"
    if before.empty:
        text = "No physics model has a result with data"
    if pure and pure in after.index:
        text += f"; {in_words(pure)} has H = {metres(after[pure])}"
    return f"{text}; {CONSTANT} {metres(content.naive['mean'])}."
