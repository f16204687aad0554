"""The map H(A, N_D): what a manoeuvre and a metre of accuracy are worth, flat and as bars."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from statistics import fmean
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shipid.report.content import DATA_DRIVEN, NO_PHYSICS, Floats, ReportContent
from shipid.report.contours import FEWEST, contour, length, nice_levels, smoothed
from shipid.report.figure import (
    Chip,
    Control,
    Figure,
    Panel,
    Plot,
    Scale,
    Trace,
    apart,
    axis,
    label,
    layout,
    line,
    marks,
    silent,
)
from shipid.report.gain import gain, unplotted
from shipid.report.palette import INK, MUTED, level
from shipid.report.section import Section
from shipid.report.selection import (
    FEW_MODELS,
    data_driven,
    left_out,
    nothing_learns,
    overview,
    same_physics,
    spread,
    trained,
)
from shipid.report.wording import counted, listed, metres, number, shortened

HEIGHT, THICK = 580, 26  # of the plot and at most of a cell [px]
MARGIN = {"l": 52, "r": 12, "t": 12, "b": 44}
NAMED, LINE = 84, 13  # margin that holds the names of rows, and the height of one [px]
MOST_LINES = 5
NEIGHBOURS = (2.0, 1.0)  # models and N_D over which H is averaged before lines are drawn
TICKS = (1, 5, 10, 2, 20, 50, 100, 200, 500, 1000, 30, 15, 3, 7, 0.5)  # of A [m], the welcome ones first
SHORT = 12  # characters of a name at the axis
# Of the oblique bars: half a width; how far aside and up (of the highest) an N_D is.
WIDE, ASIDE, BACK = 0.34, 0.45, 0.11
SHADE = "rgba(0,0,0,0.28)"
Pieces = list[tuple[float, Floats]]  # of lines of equal value: level and points (k, 2)


class Spot(NamedTuple):
    """A model and an N_D: H and its range over seeds [m], whether it beats no physics, and its hover text."""

    model: str
    row: int
    size: int
    H: float
    worse: bool
    words: str


class Map(NamedTuple):
    """The models by A, see `_rows`, each N_D, what there is at both, and the least and greatest H [m]."""

    rows: pd.DataFrame
    counts: list[int]
    spots: list[Spot]
    span: tuple[float, float]


def error_map(content: ReportContent) -> Figure | None:
    """H over A and N_D; None where `lack` says why not, or H is A: nothing learns."""
    drawn = _map(content)
    if drawn is None or nothing_learns(content):
        return None
    rows, _, spots, span = drawn
    pieces, bounds = _pieces(drawn, content.frames.get("intervals"))
    many = [f"{FEWEST * width:.0f}" for width in NEIGHBOURS]
    lined = f" Lines of equal error follow H, averaged over neighbouring models where there are {many[0]} or more, and "
    lined += f"over neighbouring N_D where there are {many[1]} or more. No line is drawn beside a cell without a "
    lined += "result; pieces shorter than the distance of two N_D are left out."
    if bounds:
        lined += " Dotted: the same lines through the ends of the 95 % interval of H over test manoeuvres. Between the "
        lined += "two dotted lines of a level the data do not say on which side of the level H lies; one that is "
        lined += "missing lies beyond the cells."
    return Figure(
        id="map",
        title="Physics and data: the map",
        takeaway=_takeaway(rows, spots) + _method(content, rows),
        how="Each cell is a model, at its A on a square-root scale, given N_D manoeuvres; colour is H, mean over seeds."
        + (f" Hatched: H is not below that of {_rival(rows)} at the same N_D." if any(s.worse for s in spots) else "")
        + (lined if pieces else "")
        + " The bars show the same cells, models in the order of A; the front row is the largest N_D."
        + left_out(content)
        + _beside(content)
        + unplotted(content),
        alternative=f"Cells of the position error H for {counted(len(rows), 'model')} by A and N_D. The numbers are in "
        "the table of cells.",
        height=HEIGHT,
        views={
            "0": [Panel(_flat(drawn, pieces, bounds))],
            "1": [Panel(_bars(drawn))],
        },
        controls=[Control("View", ["map", "bars"])],
        chips=([Chip("iso", "lines of equal H", INK, width=1.5)] if pieces else [])
        + ([Chip("bounds", "ends of the 95 % interval", INK, "dot", 1.5)] if bounds else []),
        scale=Scale("position error, mean, H [m]", *span, "--heat"),
    )


def cells_map(content: ReportContent, *, id: str, title: str, scale: str, how: str, hatched: str) -> Figure | None:
    """Another quantity than H over A and N_D, which the content holds in the place of H; None as for `error_map`.

    hatched : what a hatched cell is, said where there is one.
    """
    drawn = _map(content)
    if drawn is None:
        return None
    drawn = drawn._replace(spots=[spot._replace(words=_plainly(spot)) for spot in drawn.spots])
    low, high = _ends(drawn.spots)
    return Figure(
        id=id,
        title=title,
        takeaway=f"The {scale.partition(' [')[0]} goes from {low} to {high}.",
        how=how + (f" Hatched: {hatched}" if any(spot.worse for spot in drawn.spots) else ""),
        alternative=f"Cells of {scale} for {counted(len(drawn.rows), 'model')} by A and N_D. "
        "The numbers are in a table.",
        height=HEIGHT,
        views={"": [Panel(_flat(drawn, [], []))]},
        scale=Scale(scale, *drawn.span, "--heat"),
    )


def _plainly(spot: Spot) -> str:
    """Hover text of a quantity that is not H."""
    return f"<b>{label(spot.model)}</b>, N_D = {spot.size}<br>{metres(spot.H)}"


def lack(content: ReportContent) -> str:
    """What a map needs that the content does not have, as the end of a sentence; empty where it can be drawn."""
    cells = content.cells
    physics = cells[cells.family.ne(DATA_DRIVEN)].groupby("model").A.first()
    needs = {
        "rows of cells": not cells.empty,
        "two N_D or more": cells.N_D.nunique() > 1,
        "two models with physics or more": len(physics) > 1,
        "the column A [m], a number for two models with physics or more": physics.notna().sum() > 1,
        "cells with a result": not trained(content).merge(_rows(content)[["model"]]).empty,
    }
    return next((f"it needs {name}" for name, there in needs.items() if not there), "")


def _map(content: ReportContent) -> Map | None:
    """What the map shows; None where `lack` says why not."""
    if lack(content):
        return None
    rows = _rows(content)
    counts = sorted({int(size) for size in content.cells.N_D})
    means = trained(content).merge(rows[["model"]])
    return Map(rows, counts, _spots(content, means, rows), (float(means.H.min()), float(means.H.max())))


def _rows(content: ReportContent) -> pd.DataFrame:
    """Return the models of the cells by A: model, family, A [m], y (square root of A; models without A above), short.

    short : the name, without the method where all have the same one.

    Of several methods on the same physics, which have one place, the first: the one judged, where it is among them.
    """
    frame = overview(content)
    frame = frame[~same_physics(frame)].reset_index(drop=True)
    top = math.sqrt(max(float(frame.A.max(skipna=True)), 1e-3)) if frame.A.notna().any() else 1.0
    without = frame.A.isna()
    strips = top * (1.05 + 0.06 * without.cumsum())
    parts = [str(name).partition(" + ") for name in frame.model]
    one = len({method for _, _, method in parts}) == 1
    short = [foundation if one else str(name) for (foundation, _, _), name in zip(parts, frame.model, strict=True)]
    return frame.assign(y=np.sqrt(frame.A).where(~without, strips), short=short)


def _method(content: ReportContent, rows: pd.DataFrame) -> str:
    """Sentence on the method of the cells on the map, where other methods are not on it; empty if all are."""
    if not (_beside(content) or left_out(content)):
        return ""
    drawn = content.cells[content.cells.model.isin(rows.model[rows.family.ne(DATA_DRIVEN)])]
    names = sorted({str(name) for name in drawn.method}) if "method" in drawn else []
    return f" Of several methods, {listed(names) if names else 'the first'} is drawn."


def _beside(content: ReportContent) -> str:
    """Sentence on the methods whose place on the map another has; empty if there are none."""
    beside = overview(content).loc[same_physics, "model"]
    return f" Not on the map, where another method has their place: {listed(list(beside), 6)}." if len(beside) else ""


def _spots(content: ReportContent, means: pd.DataFrame, rows: pd.DataFrame) -> list[Spot]:
    errors = {(str(model), int(size)): float(H) for model, size, H in zip(means.model, means.N_D, means.H, strict=True)}
    pure, rival = set(rows.model[rows.family == DATA_DRIVEN]), data_driven(content)
    learned = {size: H for (model, size), H in errors.items() if model == rival}
    place, accuracy = {str(name): i for i, name in enumerate(rows.model)}, dict(zip(rows.model, rows.A, strict=True))
    cells: dict[tuple[str, int], list[dict[Hashable, Any]]] = {}
    for cell in content.cells[content.cells.model.isin(rows.model)].to_dict("records"):
        cells.setdefault((str(cell["model"]), int(cell["N_D"])), []).append(cell)
    spots = []
    for (model, size), mine in sorted(cells.items()):
        H, floor = errors.get((model, size), math.nan), learned.get(size, math.inf)
        worse = model not in pure and floor <= H
        words = _words(mine, model, size, float(accuracy[model]), H, floor if worse else None)
        spots.append(Spot(model, place[model], size, H, worse, words))
    return spots


def _words(
    cells: Sequence[dict[Hashable, Any]], model: str, size: int, A: float, H: float, learned: float | None
) -> str:
    """Return the lines of the hover box of one model and N_D, of which there are some cells."""
    good = sorted((one for one in cells if one["status"] == "ok" and math.isfinite(one["H"])), key=lambda one: one["H"])
    lines = [f"<b>{label(model)}</b>, " + (f"A {metres(A)}, " if math.isfinite(A) else "") + f"N_D = {size}"]
    if not good:
        first = cells[0]
        return "<br>".join([*lines, label(f"{first['status']}: {first['sentence']}".rstrip(": "))])
    best, worst = good[0], good[-1]
    lines.append(f"H {metres(H)}, H_90 {metres(fmean(one['H_90'] for one in good))}")
    if len(cells) > 1:
        lines.append(f"{number(best['H'])} to {metres(worst['H'])} over {counted(len(good), 'seed')}")
    if len(good) < len(cells):
        lines.append(f"{len(cells) - len(good)} of {counted(len(cells), 'seed')} gave no result")
    if learned is not None:
        lines.append(f"no better than no physics, {metres(learned)}")
    return "<br>".join([*lines, label(str(best["hyperparameters"]))] if best.get("hyperparameters") else lines)


def _widths(counts: Sequence[int]) -> dict[int, float]:
    """Width of a cell [N_D]: most of the way to its nearer neighbour, but no cell much wider than another."""
    gaps = np.diff(counts)
    nearest = np.minimum(np.append(gaps, gaps[-1]), np.insert(gaps, 0, gaps[0]))
    widths = 0.86 * np.minimum(nearest, 1.5 * gaps.min())
    return {size: float(width) for size, width in zip(counts, widths, strict=True)}


def _reaches(y: Floats, most: float) -> tuple[Floats, Floats]:
    """How far the cells of each row reach down and up: half way to the next row, but not farther than `most`."""
    half = np.minimum(np.diff(y) / 2, most)
    ends = [min(most, float(half[0])) if len(half) else most, min(most, float(half[-1])) if len(half) else most]
    return np.insert(half, 0, ends[0]), np.append(half, ends[1])


def _pieces(drawn: Map, intervals: pd.DataFrame | None) -> tuple[Pieces, Pieces]:
    """Lines of equal H through the physics models, level [m] and points (N_D, y); those of the ends of its interval."""
    rows, counts, spots, _ = drawn
    physics = rows[rows.A.notna() & rows.family.ne(DATA_DRIVEN)]
    x, y = np.asarray(counts, dtype=float), physics.y.to_numpy(dtype=float)
    errors = {(spot.model, spot.size): spot.H for spot in spots}

    def over(known: Mapping[tuple[str, int], float]) -> Floats:
        values = np.array([[known.get((str(name), size), math.nan) for size in counts] for name in physics.model])
        return smoothed(values, NEIGHBOURS)

    mean = over(errors)
    levels = nice_levels(mean, MOST_LINES)

    def lines(heights: Floats) -> Pieces:
        every = [(height, piece) for height in levels for piece in contour(x, y, heights, height)]
        return [(height, piece) for height, piece in every if np.ptp(piece[:, 0]) >= np.diff(x).min()]

    through = lines(mean)
    if intervals is None:
        return through, []
    keys = [(str(model), int(size)) for model, size in zip(intervals.model, intervals.N_D, strict=True)]
    ends = [over(dict(zip(keys, intervals[side], strict=True))) for side in ("low", "high")]
    named = {height for height, _ in through}  # a dotted line without its line is taken for that of another
    return through, [piece for end in ends for piece in lines(end) if piece[0] in named]


def _flat(drawn: Map, pieces: Pieces, bounds: Pieces) -> Plot:
    """Cells at A and N_D, hatched or crossed where they are of no use, under lines of equal H."""
    rows, counts, spots, span = drawn
    top, widths = float(rows.y.max()) * 1.04, _widths(counts)
    most = THICK / 2 * top / (HEIGHT - MARGIN["t"] - MARGIN["b"])
    y = rows.y.to_numpy(dtype=float)
    low, high = _reaches(y, most)
    good, bad = [s for s in spots if math.isfinite(s.H)], [s for s in spots if not math.isfinite(s.H)]

    def boxes(some: Sequence[Spot], marker: Mapping[str, Any], **options: Any) -> Trace:
        return marks(
            "bar",
            x=[spot.size for spot in some],
            y=[round(low[spot.row] + high[spot.row], 4) for spot in some],
            base=[round(y[spot.row] - low[spot.row], 4) for spot in some],
            width=[widths[spot.size] for spot in some],
            marker=marker,
            **options,
        )

    shades = [f"var(--heat-{level(spot.H, span)})" for spot in good]
    cells = boxes(
        good,
        {"color": shades, "line": {"width": 0.5, "color": MUTED}},
        customdata=[spot.words for spot in good],
        hovertemplate="%{customdata}<extra></extra>",
    )
    lattice = {"shape": "/", "fgcolor": "#000000", "size": 8, "solidity": 0.16}
    hatched = boxes(
        [spot for spot in good if spot.worse],
        {"color": "rgba(0,0,0,0)", "line": {"width": 1.2, "color": INK}, "pattern": lattice},
        hoverinfo="skip",
    )
    failed = marks(
        "scatter",
        x=[spot.size for spot in bad],
        y=[y[spot.row] for spot in bad],
        mode="markers",
        marker={"symbol": "x-thin", "size": 8, "line": {"width": 2, "color": "var(--bad)"}},
        customdata=[spot.words for spot in bad],
        hovertemplate="%{customdata}<extra></extra>",
    )
    lines, names = _isolines(pieces)
    dots = {"color": INK, "width": 1.2, "dash": "dot"}
    lines += [silent(line(metres(height), piece[:, 0], piece[:, 1], ["bounds"], line=dots)) for height, piece in bounds]
    names += _row_names(rows, top)
    ends = [counts[0] - 0.75 * widths[counts[0]], counts[-1] + 0.75 * widths[counts[-1]]]
    x = axis("manoeuvres, N_D [1]", tickvals=list(counts), range=ends, showgrid=False)
    up = axis("error of the physics alone, A [m]", range=[0, top], automargin=True, **_ticks(rows))
    plot = layout(x, up, hovermode="closest", barmode="overlay", annotations=names, margin={**MARGIN, "r": NAMED})
    strips = rows[rows.A.isna()]
    if len(strips):
        edge = float(np.mean([rows.y[rows.A.notna()].max(), strips.y.min()]))
        rule = {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": edge, "y1": edge}
        plot["shapes"] = [{**rule, "line": {"color": MUTED, "width": 1, "dash": "dot"}}]
    return Plot([cells, hatched, failed, *lines], plot)


def _row_names(rows: pd.DataFrame, top: float) -> list[dict[str, Any]]:
    """Names of the models with an A, right of their cells; of more than have room there, some at even distances.

    A few always have their names, even where their cells cover each other.
    """
    high = HEIGHT - MARGIN["t"] - MARGIN["b"]
    known = rows[rows.A.notna()].reset_index(drop=True)
    room = 1 + int(np.ptp(known.y) / top * high / LINE) if len(known) else 0
    shown = [int(i) for i in spread([str(i) for i in known.index], max(room, FEW_MODELS))]
    heights = apart(known.y[shown].tolist(), LINE / high * top, float(known.y.max()))
    place = {"xref": "paper", "x": 1, "xanchor": "left", "xshift": 4, "showarrow": False}
    return [
        {**place, "y": height, "text": label(shortened(name, SHORT)), "font": {"size": 11, "color": INK}}
        for height, name in zip(heights, known.short[shown], strict=True)
    ]


def _ticks(rows: pd.DataFrame) -> dict[str, list[Any]]:
    """Ticks of A where the rows are, far enough apart to read; a strip is named."""
    known = rows[rows.A.notna()]
    room, values = 0.06 * float(rows.y.max()), [0.0]
    largest = max(float(known.A.max()), 1e-6)
    decade = math.floor(math.log10(largest))
    scale = decade - 1 if decade < 0 else max(decade - 3, 0)  # a model in a basin errs by centimetres
    for tick in (float(f"{tick}e{scale}") for tick in TICKS):
        if tick <= known.A.max() and all(abs(math.sqrt(tick) - math.sqrt(other)) > room for other in values):
            values.append(float(tick))
    strips = rows[rows.A.isna()]
    names = [shortened(name, SHORT) for name in strips.short]
    return {
        "tickvals": [*(math.sqrt(value) for value in values), *strips.y],
        "ticktext": [*(f"{value:g}" for value in values), *map(label, names)],
    }


def _isolines(pieces: Pieces) -> tuple[list[Trace], list[dict[str, Any]]]:
    """Ink lines on a pale rim, and the level written once, on the longest piece."""
    traces, names = [], []
    longest: dict[float, Floats] = {}
    for ink in ({"color": "var(--page)", "width": 4}, {"color": INK, "width": 1.5}):
        for height, piece in pieces:
            traces.append(silent(line(metres(height), piece[:, 0], piece[:, 1], ["iso"], line=ink)))
    for height, piece in pieces:
        if height not in longest or length(piece) > length(longest[height]):
            longest[height] = piece
    taken: list[Floats] = []
    for height, piece in longest.items():
        taken.append(_free_place(piece, taken, np.ptp(np.concatenate([*longest.values()]), axis=0)))
        x, y = taken[-1].tolist()
        names.append(
            {"x": x, "y": y, "text": f"{height:g} m", "showarrow": False}
            | {"font": {"size": 11, "color": INK}, "bgcolor": "var(--page)", "borderpad": 1}
        )
    return traces, names


def _free_place(piece: Floats, taken: Sequence[Floats], span: Floats) -> Floats:
    """Place on a line (k, 2) that is farthest from those taken, in parts of the span of all lines; else its middle."""
    along = np.linspace(0, len(piece) - 1, 11)[1:-1]
    places = np.column_stack([np.interp(along, np.arange(len(piece)), column) for column in piece.T])
    scale = np.where(span > 0, span, 1.0)
    away = [min((float(np.hypot(*((place - other) / scale))) for other in taken), default=0.0) for place in places]
    free: Floats = places[int(np.argmax(away)) if taken else len(places) // 2]
    return free


def _bars(drawn: Map) -> Plot:
    """One box per model and N_D, as in the paper's Fig. 8, drawn obliquely: heights of the front are true."""
    rows, counts, spots, span = drawn
    depth = {size: len(counts) - 1 - i for i, size in enumerate(counts)}
    back = BACK * span[1]
    traces = []
    for spot in sorted(spots, key=lambda spot: (-depth[spot.size], spot.row)):  # what is nearer covers the rest
        if not math.isfinite(spot.H):
            x, y = _oblique(spot.row, depth[spot.size], 0.0, back)
            traces.append(marks("scatter", x=[x], y=[y], mode="markers", marker={"symbol": "x", "color": "var(--bad)"}))
        else:
            colour = f"var(--heat-{level(spot.H, span)})"
            body, side = _box(spot.row, depth[spot.size], spot.H, back)
            traces += [_face(body, colour, INK), _face(side, SHADE, SHADE)]
        traces[-1].update(text=f"{label(spot.model)}, N_D = {spot.size}: H {metres(spot.H)}", hoverinfo="text")
    return Plot(traces, _stage(rows, counts, span, back))


def _oblique(x: float, depth: float, height: float, back: float) -> tuple[float, float]:
    """Place on the page of a point at a model, so many N_D behind the front, at a height [m]."""
    return x + ASIDE * depth, height + back * depth


def _box(row: int, depth: int, height: float, back: float) -> tuple[Floats, Floats]:
    """Outlines (k, 2) of a bar: front, top and right side, set apart by points that are no numbers; the side alone."""
    near, far, left, right = float(depth), depth + 2 * WIDE, row - WIDE, row + WIDE
    front = [(left, near, 0.0), (right, near, 0.0), (right, near, height), (left, near, height)]
    top = [(left, near, height), (right, near, height), (right, far, height), (left, far, height)]
    side = [(right, near, 0.0), (right, far, 0.0), (right, far, height), (right, near, height)]
    outlines = [np.array([_oblique(*corner, back) for corner in [*face, face[0]]]) for face in (front, top, side)]
    hole = np.full((1, 2), np.nan)
    return np.concatenate([outlines[0], hole, outlines[1], hole, outlines[2]]), outlines[2]


def _face(outline: Floats, fill: str, edge: str) -> Trace:
    """Draw a filled outline, whose text shows wherever the pointer is over it."""
    x, y = outline.T.round(4)
    ink = {"color": edge, "width": 0.6}
    return marks("scatter", x=x, y=y, mode="lines", fill="toself", fillcolor=fill, line=ink, hoveron="fills", name="")


def _stage(rows: pd.DataFrame, counts: Sequence[int], span: tuple[float, float], back: float) -> dict[str, Any]:
    """Lay out the bars: the largest N_D in front, since H falls with N_D and short bars hide nothing."""
    last, deep = len(rows) - 1, len(counts) - 1
    shown = np.unique(np.linspace(0, last, min(len(rows), 8)).round().astype(int))
    words = [
        NO_PHYSICS if row.family == DATA_DRIVEN else number(float(str(row.A))) for row in rows.iloc[shown].itertuples()
    ]
    x = axis("models by A [m]", tickvals=shown.tolist(), ticktext=words, showgrid=False)
    top = 1.03 * (span[1] + back * (deep + 2 * WIDE))
    y = axis("H, front row [m]", range=[0, top], tickvals=_heights(span[1]))
    some = np.unique(np.linspace(0, deep, min(len(counts), 5)).round().astype(int))
    places = [_oblique(last + 0.55, deep - i, 0.0, back) for i in some]
    notes = [
        {"x": place[0], "y": place[1], "text": f"N_D = {counts[i]}", "showarrow": False, "xanchor": "left"}
        | {"yanchor": "bottom", "font": {"size": 11, "color": INK}}
        for i, place in zip(some, places, strict=True)
    ]
    x["range"] = [-0.7, last + ASIDE * deep + 0.25 * (last + ASIDE * deep) + 0.9]
    return layout(x, y, hovermode="closest", annotations=notes, margin=MARGIN)


def _heights(most: float) -> list[float]:
    """About five round heights up to the highest bar."""
    steps = (float(f"{digit}e{decade}") for decade in range(-6, 7) for digit in (1, 2, 5))
    step = next((step for step in steps if most / step <= 6), most)
    return [float(f"{step * k:.6g}") for k in range(int(most / step) + 1)]


def _pure(rows: pd.DataFrame) -> list[str]:
    """The models without physics."""
    return [str(name) for name in rows.model[rows.family == DATA_DRIVEN]]


def _rival(rows: pd.DataFrame) -> str:
    """The model without physics that others are compared with: by name where there are several."""
    return next(iter(_pure(rows)), NO_PHYSICS)


def _ends(spots: Sequence[Spot]) -> tuple[str, str]:
    """The least and the greatest H, each with its model and N_D."""
    good = [spot for spot in spots if math.isfinite(spot.H)]
    ends = min(good, key=lambda spot: spot.H), max(good, key=lambda spot: spot.H)
    least, greatest = (f"{metres(spot.H)} ({spot.model}, N_D = {spot.size})" for spot in ends)
    return least, greatest


def _takeaway(rows: pd.DataFrame, spots: list[Spot]) -> str:
    """Where H is lowest and highest, and up to which A physics helped at every N_D."""
    pure = set(_pure(rows))
    accuracy = dict(zip(rows.model, rows.A, strict=True))
    good = [spot for spot in spots if math.isfinite(spot.H)]
    text = "H runs from {} to {}".format(*_ends(spots))
    judged = {spot.size for spot in good if spot.model in pure}
    physics = [spot for spot in good if spot.model not in pure and spot.size in judged]
    worse, rival = [spot for spot in physics if spot.worse], _rival(rows)
    if not physics:
        return f"{text}."
    if not worse:
        return f"{text}; H is below that of {rival} in all {counted(len(physics), 'cell')} with physics."
    limit = float(np.nanmin([accuracy[spot.model] for spot in worse] + [math.inf]))
    text += f"; in {len(worse)} of {counted(len(physics), 'cell')} with physics H is not below that of {rival}"
    below = sum(float(accuracy[spot.model]) < limit for spot in physics)
    return text + (f", none of them below A = {metres(limit)}." if below else ".")


SECTION = Section(
    "What physics and data buy",
    draw=lambda content: (error_map(content), gain(content)),
    needs=("cells",),
    anchors=("map", "gain"),
)
