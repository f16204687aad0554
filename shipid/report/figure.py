"""The parts of every figure: a takeaway above, panels with controls, and below how it was computed."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go

from shipid.report.content import Floats
from shipid.report.palette import GRID, INK
from shipid.report.wording import scientific


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


Trace = dict[str, Any]  # as Plotly.js takes it: `type` and the options of that type


@dataclass(frozen=True)
class Plot:
    """Traces and layout as plain data: Plotly's Python classes take milliseconds a trace to check it."""

    traces: Sequence[Trace]
    layout: Mapping[str, Any]


@dataclass(frozen=True)
class Panel:
    """One plot with the caption below it."""

    plot: Plot
    caption: str = ""

    @property
    def figure(self) -> go.Figure:
        """The plot as a checked figure of Plotly; ValueError for an option that there is not."""
        return go.Figure(self.plot.traces, self.plot.layout)


@dataclass(frozen=True)
class FixedWindow:
    """A panel that shows one window of the browser: indices of run, instant and N_D among those offered there.

    `model` restricts it to the lines of one model; empty for those of all.
    """

    caption: str
    run: int
    instant: int
    size: int
    model: str = ""


@dataclass(frozen=True)
class Scale:
    """A colour scale: a label with its unit, the smallest and largest value, the CSS variable of the gradient."""

    label: str
    low: float
    high: float
    gradient: str = "--scale"


@dataclass(frozen=True)
class Figure:
    """A figure of the page.

    Parameters
    ----------
    id, title, takeaway, how, alternative : texts; the alternative says what a reader who cannot see it would miss.
    views : option indices of the controls, joined by "-" ("" without controls) -> panels.
    height : of one panel [px].
    windows : panels drawn from the windows of the page instead of views.
    browser : whether it is the window browser, instead of views.
    scale : the logarithmic colour scale, if there is one.
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
    scale: Scale | None = None


def label(text: str) -> str:
    """Escape a name for Plotly, which reads tags and links in its texts."""
    return html.escape(text, quote=False)


MILLION = 6  # power of ten from which ticks are short: Plotly would write -5k on one axis and -6000 on the other


def axis(title: str, **options: Any) -> dict[str, Any]:
    """Make an axis; its title carries the unit."""
    base = {"gridcolor": GRID, "linecolor": GRID, "zeroline": False, "automargin": True, "minexponent": MILLION}
    return {**base, "title": {"text": title, "standoff": 8, "font": {"size": 13}}, **options}


def logarithmic(title: str, steps: Sequence[float] = (1, 2, 5), **options: Any) -> dict[str, Any]:
    """Make a logarithmic axis with whole numbers at its ticks: Plotly would write 0.5 as 5."""
    ticks = [float(f"{step}e{decade}") for decade in range(-8, 5) for step in steps]
    return axis(title, type="log", **{"tickvals": ticks, "ticktext": [scientific(tick) for tick in ticks], **options})


def plane(x: str, y: str, spans: Sequence[tuple[float, float]] = ()) -> dict[str, Any]:
    """Lay out two lengths on equal axes, over given spans of x and y [m] or over what is drawn."""
    room = 0.04 * max((high - low for low, high in spans), default=0.0)
    ranges = [{"range": [low - room, high + room]} for low, high in spans] or [{}, {}]
    # Margins are fixed: automatic ones and equal axes chase each other.
    right = axis(x, scaleanchor="y", scaleratio=1, nticks=6, automargin=False, **ranges[0])
    up = axis(y, nticks=8, automargin=False, **ranges[1])
    return layout(right, up, hovermode="closest", margin={"l": 70, "r": 12, "t": 12, "b": 44})


def apart(places: Sequence[float], gap: float, most: float) -> list[float]:
    """Move rising places at least `gap` apart and none beyond `most`, each as little as those before it allow."""
    moved: list[float] = []
    for place in places:
        moved.append(max(place, moved[-1] + gap) if moved else place)
    for i in reversed(range(len(moved))):
        moved[i] = min(moved[i], most if i == len(moved) - 1 else moved[i + 1] - gap)
    return moved


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
) -> Trace:
    """One line in single precision; its hover says name, x and y."""
    return {
        "type": "scatter",
        "x": np.asarray(x, dtype=np.float32),
        "y": np.asarray(y, dtype=np.float32),
        "mode": mode,
        "name": label(name),
        "meta": list(keys),
        "connectgaps": False,
        "hovertemplate": f"{label(name)}: %{{y:.4~r}} {label(unit)}<extra></extra>",
        **options,
    }


def marks(kind: str, **options: Any) -> Trace:
    """Another trace than a line, of a type of Plotly such as `bar`."""
    return {"type": kind, **options}


def silent(trace: Trace) -> Trace:
    """Return the trace without a hover box."""
    return {**{key: value for key, value in trace.items() if key != "hovertemplate"}, "hoverinfo": "skip"}
