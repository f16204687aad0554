"""The skeleton every figure hangs on: a takeaway above, panels with controls, how it was computed below."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go

from shipid.report.content import Floats
from shipid.report.palette import GRID, INK


@dataclass(frozen=True)
class Control:
    """A choice above a figure: a row of radio buttons for a few options, a list for many."""

    label: str
    options: Sequence[str]
    start: int = 0


@dataclass(frozen=True)
class Chip:
    """An entry of the legend; pressing it hides and shows every line whose `meta` holds its key."""

    key: str
    label: str
    colour: str
    dash: str = "solid"
    width: float = 2.0
    symbol: str = ""


@dataclass(frozen=True)
class Panel:
    """One plot with the caption below it."""

    figure: go.Figure
    caption: str = ""


@dataclass(frozen=True)
class FixedWindow:
    """A panel that shows one window of the browser: indices of run, instant and N_D among those offered there."""

    caption: str
    run: int
    instant: int
    size: int


@dataclass(frozen=True)
class Figure:
    """A figure of the page.

    Parameters
    ----------
    id, title, takeaway, how, alternative : texts; the alternative says what a reader who cannot see it would miss.
    views : option indices of the controls, joined by "-" ("" without controls) -> panels.
    height : of one panel [px].
    windows : panels drawn from the windows of the page instead of views.
    browser : test run -> its instants [s]; a window browser instead of views.
    """

    id: str
    title: str
    takeaway: str
    how: str
    alternative: str
    height: int
    views: Mapping[str, Sequence[Panel]]
    controls: Sequence[Control] = ()
    chips: Sequence[Chip] = ()
    windows: Sequence[FixedWindow] = ()
    browser: bool = False


def label(text: str) -> str:
    """A name as Plotly text, which would otherwise read tags and links in it."""
    return html.escape(text, quote=False)


def axis(title: str, **options: Any) -> dict[str, Any]:
    """An axis with its title; the title carries the unit."""
    base = {"gridcolor": GRID, "linecolor": GRID, "zeroline": False, "automargin": True}
    return {**base, "title": {"text": title, "standoff": 8}, **options}


def layout(x: dict[str, Any], y: dict[str, Any], **options: Any) -> dict[str, Any]:
    """Layout without background, legend or template: the page gives colours and the legend is text."""
    base = {
        "template": None,
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif", "size": 13, "color": INK},
        "margin": {"l": 48, "r": 12, "t": 12, "b": 44},
        "showlegend": False,
        "hoverlabel": {"bgcolor": "var(--card)", "bordercolor": GRID, "font": {"color": INK}, "namelength": -1},
    }
    return {**base, "xaxis": x, "yaxis": y, **options}


def line(
    name: str,
    x: Sequence[float] | Floats,
    y: Sequence[float] | Floats,
    keys: Sequence[str],
    unit: str = "m",
    mode: str = "lines",
    **options: Any,
) -> go.Scatter:
    """One line in single precision; its hover says name, x and y."""
    return go.Scatter(
        x=np.asarray(x, dtype=np.float32),
        y=np.asarray(y, dtype=np.float32),
        mode=mode,
        name=label(name),
        meta=list(keys),
        connectgaps=False,
        hovertemplate=f"{label(name)}: %{{y:.2f}} {label(unit)}<extra></extra>",
        **options,
    )
