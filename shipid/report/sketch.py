"""A plot as plain SVG, which a page shows until Plotly has started, or where scripts do not run."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup, escape

from shipid.report.content import Floats
from shipid.report.figure import Plot
from shipid.report.palette import GRID, INK
from shipid.report.selection import thinned

UNITS = 1000  # side of the square in which marks and lines are drawn, stretched to the axes
CHARACTER, TITLE = 7.0, 30  # width of a character at the axis, and of its title [px]
ROOM = 0.055  # share of what is drawn that an axis leaves free beyond it
STEPS = 6  # most steps of an axis without given ticks
GROUPS = ("line", "marker", "font", "title", "error_x", "error_y")  # that hold options and may be left out
DASHES = {"dash": "6 4", "dot": "2 3", "dashdot": "6 3 2 3"}


class Options:
    """Options of a trace or of the layout as attributes.

    An option that is not given is None; one of `GROUPS` is empty `Options`, so that its options are None.
    """

    def __init__(self, given: Mapping[str, Any]) -> None:
        self._given = given

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        value = self._given.get(name)
        if name in GROUPS:
            value = value or {}
        return Options(value) if isinstance(value, Mapping) else value


@dataclass(frozen=True)
class Axis:
    """An axis with its ends and ticks; of a logarithmic one these are powers of ten."""

    low: float
    high: float
    values: Sequence[float]
    names: Sequence[object]
    title: str
    grid: bool
    logarithmic: bool

    def share(self, value: Any) -> Floats:
        """Places of values between the ends of the axis, 0 to 1; NaN for what it cannot show."""
        given = np.asarray(value, dtype=float)
        if self.logarithmic:
            given = np.log10(np.where(given > 0, given, np.nan))
        return (given - self.low) / (self.high - self.low)

    @property
    def ticks(self) -> list[tuple[float, object]]:
        """Place, 0 to 1, and name of each tick between the ends."""
        places = [(value - self.low) / (self.high - self.low) for value in self.values]
        return [(place, name) for place, name in zip(places, self.names, strict=True) if -1e-9 <= place <= 1 + 1e-9]


def sketch(plot: Plot, height: int) -> Markup:
    """Draw bars, lines, points and texts of a plot with one pair of axes of numbers; of others nothing.

    Parameters
    ----------
    plot : with colours as CSS variables.
    height : of the whole, with margins [px]; it is as wide as its place on the page.
    """
    layout, every = Options(plot.layout), map(Options, plot.traces)
    traces = [trace for trace in every if trace.type != "scatter" or (trace.x is not None and len(trace.x))]
    if not traces or not all(map(_simple, traces)):
        return Markup("")
    spread = any(trace.type == "bar" or "markers" in trace.mode for trace in traces)
    across = _axis(layout.xaxis, [_ends(trace, "x") for trace in traces], ROOM if spread else 0.0)
    up = _axis(layout.yaxis, [_ends(trace, "y") for trace in traces], ROOM)
    margin = layout.margin
    longest = max((len(_plain(name)) for _, name in up.ticks), default=0)
    left = max(margin.l, TITLE * bool(up.title) + CHARACTER * longest)
    tall = height - margin.t - margin.b
    wide, from_left = f"100% - {left + margin.r:g}px", f"{left:g}px"
    size = f"width: calc({wide}); height: {tall:g}px"
    if layout.xaxis.scaleanchor:
        ratio = (across.high - across.low) / (up.high - up.low)
        fitted = f"min({wide}, {tall * ratio:g}px)"
        size = f"width: {fitted}; aspect-ratio: {ratio:g}"
        from_left = f"calc({left:g}px + ({wide} - {fitted}) / 2)"  # in the middle of its place
    place = f"display: block; position: relative; left: {from_left}; top: {margin.t:g}px; {size}; overflow: visible"
    inside = [*_grid(across, up), *_rules(layout, across, up)]
    inside += [mark for trace in traces for mark in _marks(trace, across, up)]
    texts = [*_texts(layout, across, up), *_tick_names(across, up), *_titles(across, up, left)]
    stretched = f'viewBox="0 0 {UNITS} {UNITS}" width="100%" height="100%" preserveAspectRatio="none"'
    return Markup(
        f'<svg class="sketch" aria-hidden="true" style="{place}">'
        f"<svg {stretched}>{''.join(inside)}</svg>{''.join(texts)}</svg>"
    )


def _simple(trace: Options) -> bool:
    """Whether a trace has numbers on the first pair of axes."""
    if trace.type not in ("scatter", "bar") or {trace.xaxis or "x", trace.yaxis or "y"} != {"x", "y"}:
        return False
    return trace.orientation != "h" and all(np.asarray(column).dtype.kind in "fiu" for column in (trace.x, trace.y))


def _ends(trace: Options, name: str) -> Floats:
    """All values of a trace along an axis, with the reach of bars and intervals."""
    values = np.asarray(getattr(trace, name), dtype=float)
    if trace.type == "bar" and name == "x":
        return np.concatenate([values - np.asarray(trace.width) / 2, values + np.asarray(trace.width) / 2])
    if trace.type == "bar":
        return np.concatenate([np.asarray(trace.base, dtype=float), values + np.asarray(trace.base)])
    return np.concatenate([values, *_reach(trace, name)])


def _reach(trace: Options, name: str) -> list[Floats]:
    """Lower and upper ends of the intervals of a trace along an axis; empty without."""
    values, interval = np.asarray(getattr(trace, name), dtype=float), getattr(trace, f"error_{name}")
    if interval.array is None:
        return []
    more = np.asarray(interval.array, dtype=float)
    less = more if interval.arrayminus is None else np.asarray(interval.arrayminus, dtype=float)
    return [values - less, values + more]


def _axis(axis: Options, drawn: Sequence[Floats], room: float) -> Axis:
    logarithmic = axis.type == "log"
    values = np.concatenate(drawn)
    if logarithmic:
        values = np.log10(values[values > 0])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    free = room * (high - low) or (1.0 if high == low else 0.0)
    zero = axis.rangemode == "tozero" and not logarithmic
    low, high = (min(low, 0.0) if zero and low >= 0 else low - free), high + free
    if axis.range is not None:
        low, high = map(float, axis.range)
    ticks = _steps(min(low, high), max(low, high)) if axis.tickvals is None else np.asarray(axis.tickvals, dtype=float)
    names = axis.ticktext or [f"{tick:g}".replace("-", "−") for tick in ticks]
    if axis.showticklabels is False:
        names = [""] * len(names)
    if logarithmic and axis.tickvals is not None:
        ticks = np.log10(ticks)
    elif logarithmic:
        names = [f"{10**tick:g}" for tick in ticks]
    return Axis(low, high, ticks.tolist(), names, axis.title.text or "", axis.showgrid is not False, logarithmic)


def _steps(low: float, high: float) -> Floats:
    """Round values between two ends, at most `STEPS` apart."""
    decade = 10.0 ** math.floor(math.log10((high - low) / STEPS))
    step = next(decade * factor for factor in (1, 2, 5, 10) if (high - low) / (decade * factor) <= STEPS)
    ticks = step * np.arange(math.ceil(low / step), math.floor(high / step) + 1)
    return np.round(ticks, max(0, 1 - math.floor(math.log10(step))))


def _plain(text: object) -> str:
    """Text of a tick or a note without the tags and escapes of Plotly."""
    return html.unescape(re.sub(r"<[^>]*>", "", str(text)))


def _style(**properties: Any) -> str:
    return f'style="{escape("; ".join(f"{name}: {value}" for name, value in properties.items()))}"'


def _path(points: str, colour: str, width: float | None, dash: str | None = None, **more: Any) -> str:
    ink = {"fill": "none", "stroke": colour, "stroke-width": 2 if width is None else width}
    if dash in DASHES:
        ink["stroke-dasharray"] = DASHES[dash]
    return f'<path d="{points}" vector-effect="non-scaling-stroke" {_style(**(ink | more))}/>'


def _grid(across: Axis, up: Axis) -> list[str]:
    flat = [f"M0 {UNITS * (1 - place):.1f}H{UNITS}" for place, _ in up.ticks if up.grid]
    upright = [f"M{UNITS * place:.1f} 0V{UNITS}" for place, _ in across.ticks if across.grid]
    return [_path("".join([*flat, *upright]), GRID, 1)] if flat or upright else []


def _rules(layout: Options, across: Axis, up: Axis) -> list[str]:
    """Lines across the whole plot, from side to side or from top to bottom."""
    rules = []
    for rule in map(Options, layout.shapes or ()):
        if rule.type == "line" and rule.xref == "paper":
            rules.append((f"M0 {UNITS * (1 - up.share(rule.y0)):.1f}H{UNITS}", rule.line))
        elif rule.type == "line" and rule.yref == "paper":
            rules.append((f"M{UNITS * across.share(rule.x0):.1f} 0V{UNITS}", rule.line))
    return [_path(points, ink.color, ink.width, ink.dash) for points, ink in rules]


def _marks(trace: Options, across: Axis, up: Axis) -> Iterable[str]:
    if trace.type == "bar":
        yield from _bars(trace, across, up)
        return
    points = UNITS * np.column_stack([across.share(trace.x), 1 - up.share(trace.y)])
    for name, axis, side in (("x", across, 0), ("y", up, 1)):
        ends = _reach(trace, name)
        if ends:
            low, high = (UNITS * (side + (1 - 2 * side) * axis.share(end)) for end in ends)
            pairs = [points.copy(), points.copy(), np.full_like(points, np.nan)]
            pairs[0][:, side], pairs[1][:, side] = low, high
            yield _path(_joined(np.stack(pairs, axis=1).reshape(-1, 2)), getattr(trace, f"error_{name}").color, 1.5)
    shade = {} if trace.opacity is None else {"opacity": trace.opacity}
    if "lines" in trace.mode:
        if trace.line.shape == "hv":
            points = np.column_stack([np.repeat(points[:, 0], 2)[1:], np.repeat(points[:, 1], 2)[:-1]])
        filled = {"fill": trace.fillcolor} if trace.fill == "toself" else {}
        yield _path(_joined(_thinned(points)), trace.line.color, trace.line.width, trace.line.dash, **filled, **shade)
    if "markers" in trace.mode:
        yield from _points(trace, points[np.isfinite(points).all(axis=1)], shade)


def _bars(trace: Options, across: Axis, up: Axis) -> Iterable[str]:
    colours, edge = trace.marker.color, trace.marker.line
    for i, (x, y, base, width) in enumerate(zip(trace.x, trace.y, trace.base, trace.width, strict=True)):
        low, high = (UNITS * across.share(end) for end in (x - width / 2, x + width / 2))
        top, bottom = (UNITS * (1 - up.share(end)) for end in (base + y, base))
        box = f'x="{low:.1f}" y="{top:.1f}" width="{high - low:.1f}" height="{bottom - top:.1f}"'
        colour = colours if isinstance(colours, str) else colours[i]
        ink = _style(fill=colour, stroke=edge.color, **{"stroke-width": edge.width})
        yield f'<rect {box} vector-effect="non-scaling-stroke" {ink}/>'


def _points(trace: Options, points: Floats, shade: dict[str, float]) -> Iterable[str]:
    """Points of a trace as round or square dots: lines without length, whose caps no stretching distorts."""
    marker = trace.marker
    size, symbol = marker.size or 6, str(marker.symbol or "circle")
    colour = marker.color if isinstance(marker.color, str) else marker.line.color or INK
    cap = {"stroke-linecap": "square" if symbol.startswith("square") else "round"} | shade
    places = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in points)
    yield _path(places, colour, size, None, **cap)
    if symbol.endswith("open"):
        yield _path(places, "var(--page)", size - 2 * (marker.line.width or 1), None, **cap)


def _thinned(points: Floats) -> Floats:
    """Points (n, 2) without those that no eye misses, piece by piece between what is no number."""
    known = np.isfinite(points).all(axis=1)
    pieces = np.split(points, np.flatnonzero(np.diff(known)) + 1)
    kept = iter(thinned([piece for piece in pieces if np.isfinite(piece[0]).all()], 1.0))
    return np.concatenate([piece[next(kept)] if np.isfinite(piece[0]).all() else piece for piece in pieces])


def _joined(points: Floats) -> str:
    """Points (n, 2) as a path that begins anew after what is no number."""
    steps, command = [], "M"
    for x, y in points:
        known = math.isfinite(x) and math.isfinite(y)
        if known:
            steps.append(f"{command}{x:.1f} {y:.1f}")
        command = "L" if known else "M"
    return "".join(steps)


def _text(text: object, x: str, y: str, anchor: str, size: float = 12, more: str = "") -> str:
    rim = {"stroke": "var(--page)", "stroke-width": "4px", "paint-order": "stroke"}
    ink = _style(fill=INK, **rim, **{"font-size": f"{size:g}px", "text-anchor": anchor})
    return f'<text x="{x}" y="{y}" {more} {ink}>{escape(_plain(text))}</text>'


def _percent(share: float) -> str:
    return f"{100 * share:.2f}%"


def _texts(layout: Options, across: Axis, up: Axis) -> list[str]:
    """Notes in the plot, and those beside it."""
    shown = []
    for note in map(Options, layout.annotations or ()):
        x = note.x if note.xref == "paper" else float(across.share(note.x))
        y = _percent(1 - float(up.share(note.y)))
        shift = f'dx="{note.xshift or 0}" dy="{4 - (note.yshift or 0):g}"'
        anchor = "start" if note.xanchor == "left" else "middle"
        shown.append(_text(note.text, _percent(x), y, anchor, note.font.size or 12, shift))
    return shown


def _tick_names(across: Axis, up: Axis) -> list[str]:
    return [
        *(_text(name, _percent(place), "100%", "middle", 13, 'dy="17"') for place, name in across.ticks if name != ""),
        *(_text(name, "0", _percent(1 - place), "end", 13, 'dx="-4" dy="4"') for place, name in up.ticks if name != ""),
    ]


def _titles(across: Axis, up: Axis, left: float) -> list[str]:
    beside = f"transform: translateX({16 - left:g}px) rotate(-90deg); transform-origin: 0 50%"
    shown = [_text(across.title, "50%", "100%", "middle", 13, 'dy="38"')] if across.title else []
    if up.title:
        shown.append(f'<g style="{beside}">{_text(up.title, "0", "50%", "middle", 13)}</g>')
    return shown
