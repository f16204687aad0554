"""A figure as plain SVG, which a page shows until Plotly has started, or where scripts do not run."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup, escape

from shipid.report.palette import GRID, INK

UNITS = 1000  # side of the square in which bars and lines are drawn, stretched to the axes
CHARACTER, TITLE = 7.0, 30  # width of a character at the axis, and of its title [px]
DASHES = {"dash": "6 4", "dot": "2 3", "dashdot": "6 3 2 3"}


def sketch(figure: go.Figure, height: int) -> Markup:
    """Draw bars, lines and texts of a figure whose two axes are linear with given range and ticks; of others nothing.

    Parameters
    ----------
    figure : with colours as CSS variables; points without a line are left out.
    height : of the whole, with margins [px]; it is as wide as its place on the page.
    """
    across, up = figure.layout.xaxis, figure.layout.yaxis
    if any(axis.range is None or axis.tickvals is None or axis.type == "log" for axis in (across, up)):
        return Markup("")
    margin = figure.layout.margin
    names = up.ticktext or up.tickvals
    left = max(margin.l, TITLE + CHARACTER * max((len(_plain(name)) for name in names), default=0))
    size = f"width: calc(100% - {left + margin.r:g}px); height: {height - margin.t - margin.b:g}px"
    place = f"position: relative; left: {left:g}px; top: {margin.t:g}px; {size}; overflow: visible"
    inside = [*_grid(up), *_rules(figure), *(mark for trace in figure.data for mark in _marks(trace, across, up))]
    texts = [*_texts(figure), *_tick_names(across, up), *_titles(across, up, height - margin.t - margin.b, left)]
    stretched = f'viewBox="0 0 {UNITS} {UNITS}" width="100%" height="100%" preserveAspectRatio="none"'
    return Markup(
        f'<svg class="sketch" aria-hidden="true" style="{place}">'
        f"<svg {stretched}>{''.join(inside)}</svg>{''.join(texts)}</svg>"
    )


def _plain(text: object) -> str:
    """Text of a tick or a note, which Plotly has escaped."""
    return html.unescape(str(text))


def _share(value: Any, axis: Any) -> float:
    """Place of a value between the ends of its axis, 0 to 1."""
    low, high = axis.range
    return (float(value) - float(low)) / (float(high) - float(low))


def _style(**properties: Any) -> str:
    return f'style="{escape("; ".join(f"{name}: {value}" for name, value in properties.items()))}"'


def _path(points: str, colour: str, width: float, dash: str | None = None) -> str:
    ink = {"fill": "none", "stroke": colour, "stroke-width": width, "stroke-dasharray": DASHES.get(dash or "", "none")}
    return f'<path d="{points}" vector-effect="non-scaling-stroke" {_style(**ink)}/>'


def _grid(up: Any) -> list[str]:
    heights = [UNITS * (1 - _share(value, up)) for value in up.tickvals]
    return [_path(f"M0 {y:.1f}H{UNITS}", GRID, 1) for y in heights if 0 <= y <= UNITS]


def _rules(figure: go.Figure) -> list[str]:
    """Lines across the whole plot."""
    rules = [rule for rule in figure.layout.shapes if rule.type == "line" and rule.xref == "paper"]
    heights = [UNITS * (1 - _share(rule.y0, figure.layout.yaxis)) for rule in rules]
    return [
        _path(f"M0 {y:.1f}H{UNITS}", rule.line.color, rule.line.width, rule.line.dash)
        for y, rule in zip(heights, rules, strict=True)
    ]


def _marks(trace: Any, across: Any, up: Any) -> Iterable[str]:
    if trace.type == "bar":
        colours, edge = trace.marker.color, trace.marker.line
        for i, (x, y, base, width) in enumerate(zip(trace.x, trace.y, trace.base, trace.width, strict=True)):
            low, high = (UNITS * _share(end, across) for end in (x - width / 2, x + width / 2))
            top, bottom = (UNITS * (1 - _share(end, up)) for end in (base + y, base))
            box = f'x="{low:.1f}" y="{top:.1f}" width="{high - low:.1f}" height="{bottom - top:.1f}"'
            colour = colours if isinstance(colours, str) else colours[i]
            ink = _style(fill=colour, stroke=edge.color, **{"stroke-width": edge.width})
            yield f'<rect {box} vector-effect="non-scaling-stroke" {ink}/>'
    elif "lines" in trace.mode and len(trace.x):
        x = [UNITS * _share(value, across) for value in trace.x]
        y = [UNITS * (1 - _share(value, up)) for value in trace.y]
        yield _path(_joined(x, y), trace.line.color, trace.line.width, trace.line.dash)


def _joined(x: Sequence[float], y: Sequence[float]) -> str:
    """Points as a path that begins anew after what is no number."""
    steps, command = [], "M"
    for point in zip(x, y, strict=True):
        if np.isfinite(point).all():
            steps.append(f"{command}{point[0]:.1f} {point[1]:.1f}")
        command = "L" if np.isfinite(point).all() else "M"
    return "".join(steps)


def _text(text: object, x: str, y: str, anchor: str, size: float = 12, more: str = "") -> str:
    rim = {"stroke": "var(--page)", "stroke-width": "4px", "paint-order": "stroke"}
    ink = _style(fill=INK, **rim, **{"font-size": f"{size:g}px", "text-anchor": anchor})
    return f'<text x="{x}" y="{y}" {more} {ink}>{escape(_plain(text))}</text>'


def _percent(share: float) -> str:
    return f"{100 * share:.2f}%"


def _texts(figure: go.Figure) -> list[str]:
    """Notes in the plot, and those right of it."""
    shown = []
    for note in figure.layout.annotations:
        aside = note.xref == "paper"
        x = note.x if aside else _share(note.x, figure.layout.xaxis)
        y = _percent(1 - _share(note.y, figure.layout.yaxis))
        shift = f'dx="{note.xshift or 0}" dy="4"'
        size = note.font.size or 12
        shown.append(_text(note.text, _percent(x), y, "start" if note.xanchor == "left" else "middle", size, shift))
    return shown


def _tick_names(across: Any, up: Any) -> list[str]:
    below = zip(across.tickvals, across.ticktext or across.tickvals, strict=True)
    beside = zip(up.tickvals, up.ticktext or up.tickvals, strict=True)
    return [
        *(_text(name, _percent(_share(value, across)), "100%", "middle", 13, 'dy="17"') for value, name in below),
        *(_text(name, "0", _percent(1 - _share(value, up)), "end", 13, 'dx="-4" dy="4"') for value, name in beside),
    ]


def _titles(across: Any, up: Any, height: float, left: float) -> list[str]:
    turned = f'transform="rotate(-90 {16 - left:g} {height / 2:g})"'
    return [
        _text(across.title.text, "50%", "100%", "middle", 13, 'dy="38"'),
        _text(up.title.text, f"{16 - left:g}", f"{height / 2:g}", "middle", 13, turned),
    ]
