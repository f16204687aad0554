"""What every figure is made of: colours, axes, lines, the legend, and the words around it.

A figure of a page names CSS variables, `var(--ink)`: one serves a light, a dark and a printed page.
"""

from __future__ import annotations

import html
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.colors import sample_colorscale
from plotly.subplots import make_subplots
from plotly.utils import PlotlyJSONEncoder

from shipid.errors import ShipidError, suggest_name
from shipid.report.content import Floats, Indices

INK, MUTED, GRID, TRUTH, NAIVE = "var(--ink)", "var(--muted)", "var(--grid)", "var(--truth)", "var(--muted)"
TRANSPARENT = "rgba(0,0,0,0)"
PAGE_COLOURS = {
    "light": {
        "page": "#ffffff", "card": "#f6f7f9", "ink": "#15191f", "muted": "#5a6472", "grid": "#dfe3e8",
        "truth": "#c3cad3", "accent": "#00598c", "good": "#0b6b3a", "bad": "#a8321a", "open": "#6a5200",
        "hull": "rgba(90, 100, 114, 0.25)",
    },
    "dark": {
        "page": "#12151a", "card": "#1b2027", "ink": "#eef1f5", "muted": "#a3adba", "grid": "#303742",
        "truth": "#4d5866", "accent": "#7cc0ee", "good": "#66cf96", "bad": "#ff9a80", "open": "#e6c35c",
        "hull": "rgba(163, 173, 186, 0.3)",
    },
}  # fmt: skip
# Okabe and Ito (2008), "Color universal design"; yellow and black are left out: one page is white, one nearly black.
OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = ("circle", "diamond", "square", "triangle-up", "cross", "star")
LINE_DASHES = ("solid", "dash", "dot", "dashdot")
COLOUR_LEVELS, DARK_LEVELS = 24, 11  # of a scale; those of viridis on which white has more contrast than black
ROUNDING_SHARE = 1e-9  # of the greatest error: that of an exact model
MILLION = 6  # power of ten from which ticks are short: Plotly would write -5k on one axis and -6000 on the other
MOST_LINE_POINTS = 600  # of a line over time: more than pixels are wide
NumbersOfLine: TypeAlias = "Sequence[float] | Floats | pd.Series[Any]"
Trace = dict[str, Any]  # as Plotly takes it: `type` and the options of that type
Panel = dict[str, Any]  # a figure as Plotly takes it: `data`, a list of traces, and `layout`


def category_colour(index: int) -> str:
    """The CSS variable of the index-th category colour."""
    return f"var(--category-{index % len(OKABE_ITO)})"


def page_colours(theme: str) -> dict[str, str]:
    """Name of a CSS variable -> colour of the `light` or `dark` page, with viridis and the Okabe-Ito colours.

    `scale-0` on are for lines: those of viridis with contrast to the page; `heat-0` on are all of it, and `on-heat-0`
    on what is written on them.
    """
    dark = theme == "dark"
    # Dark blue has contrast to white but not to black: the dark page takes sky blue instead, and the reverse.
    named = (OKABE_ITO[-1], *OKABE_ITO[1:-1], OKABE_ITO[0]) if dark else OKABE_ITO
    colours = PAGE_COLOURS[theme] | {f"category-{i}": colour for i, colour in enumerate(named)}
    for name, ends in (("scale", (0.28, 1.0) if dark else (0.0, 0.72)), ("heat", (0.0, 1.0))):
        steps = sample_colorscale("Viridis", list(np.linspace(*ends, COLOUR_LEVELS)))
        colours |= {f"{name}-{i}": colour for i, colour in enumerate(steps)}
        colours[name] = f"linear-gradient(90deg, {', '.join(steps)})"
    written = {f"on-heat-{i}": "#ffffff" if i < DARK_LEVELS else "#000000" for i in range(COLOUR_LEVELS)}
    return colours | written


def least_coloured(span: tuple[float, float]) -> float:
    """Where a scale of colours begins, above 0: at its least magnitude; where that is rounding, at 1e-4 of its end."""
    low, high = span
    return (low if low >= ROUNDING_SHARE * high else 1e-4 * high) or 1.0


def colour_level(value: float, span: tuple[float, float]) -> int:
    """Place of a magnitude on a logarithmic scale of `COLOUR_LEVELS` colours: errors are factors apart."""
    low, high, place = np.log(np.maximum([*span, value], least_coloured(span)))
    return round(float(np.clip((place - low) / (high - low), 0, 1)) * (COLOUR_LEVELS - 1)) if high > low else 0


@dataclass(frozen=True)
class Control:
    """A choice above a figure: a row of radio buttons for a few options, a list for many; `start` is an index."""

    label: str
    options: Sequence[Any]
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
class ColourScale:
    """A logarithmic colour scale: a label with its unit, the least and greatest value, the CSS variable of it."""

    label: str
    low: float
    high: float
    gradient: str = "scale"


@dataclass(frozen=True)
class PageFigure:
    """A figure of the page.

    alternative : what a reader who cannot see it would miss. height : of one panel [px].
    draw : an option of each control -> panels, as many for all options. captions : of the panels; empty for none.
    browser : whether the page draws the window that a reader picks, instead of `draw`.
    """

    id: str
    title: str
    takeaway: str
    how: str
    alternative: str
    height: int
    draw: Callable[..., Sequence[Panel]]
    controls: Sequence[Control] = ()
    chips: Sequence[Chip] = ()
    captions: Sequence[str] = ()
    scale: ColourScale | None = None
    browser: bool = False


def escape_name(text: object) -> str:
    """Escape a name for Plotly, which reads tags and links in its texts."""
    return html.escape(str(text), quote=False)


def make_axis(title: str, **options: Any) -> dict[str, Any]:
    """Make an axis; its title carries the unit."""
    base = {"gridcolor": GRID, "linecolor": GRID, "zeroline": False, "automargin": True, "minexponent": MILLION}
    return {**base, "title": {"text": title, "standoff": 8, "font": {"size": 13}}, **options}


def zero_axis(title: str, colour: str = GRID, **options: Any) -> dict[str, Any]:
    """Make an axis with a line at 0."""
    return make_axis(title, zeroline=True, zerolinecolor=colour, **options)


def log_axis(title: str, **options: Any) -> dict[str, Any]:
    """Make a logarithmic axis; its format writes whole numbers at all ticks: Plotly would write 0.5 as 5."""
    return make_axis(title, type="log", tickformat="~g", **options)


def names_axis(names: Sequence[object], title: str = "", **options: Any) -> dict[str, Any]:
    """Make an axis with a name at 0, 1, 2, ..."""
    return make_axis(title, tickvals=list(range(len(names))), ticktext=list(map(escape_name, names)), **options)


def make_plot(traces: Sequence[Trace], x: dict[str, Any], y: dict[str, Any], **options: Any) -> Panel:
    """Make a panel without background, legend or template: the page gives colours and the legend is text."""
    base = {
        "template": None,
        "paper_bgcolor": TRANSPARENT,
        "plot_bgcolor": TRANSPARENT,
        "font": {"family": "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif", "size": 13, "color": INK},
        "margin": {"l": 48, "r": 12, "t": 12, "b": 44},
        "showlegend": False,
        "hovermode": "closest",
        "hoverlabel": {"bgcolor": "var(--card)", "bordercolor": GRID, "font": {"color": INK}, "namelength": -1},
    }
    return {"data": [*traces], "layout": {**base, "xaxis": x, "yaxis": y, **options}}


def make_chart(
    traces: Sequence[Trace], x: str, y: str, spans: Sequence[tuple[float, float]] = (), nticks: int = 6
) -> Panel:
    """Make a plot of two lengths on equal axes, over given spans of x and y [m] or over what is drawn."""
    room = 0.04 * max((high - low for low, high in spans), default=0.0)
    ranges = [{"range": [low - room, high + room]} for low, high in spans] or [{}, {}]
    # Margins are fixed: automatic ones and equal axes chase each other.
    right = make_axis(x, scaleanchor="y", scaleratio=1, nticks=nticks, automargin=False, **ranges[0])
    up = make_axis(y, nticks=8, automargin=False, **ranges[1])
    return make_plot(traces, right, up, margin={"l": 70, "r": 12, "t": 12, "b": 44})


def make_line(
    name: str,
    x: NumbersOfLine,
    y: NumbersOfLine,
    keys: Sequence[str],
    unit: str = "m",
    *,
    mode: str = "lines",
    hover: str | Sequence[str] | None = None,
    **options: Any,
) -> Trace:
    """One line or its points, in single precision.

    name : in the hover box and in what a reader saves. keys : of the chips that hide it. unit : of y.
    hover : template of the hover box, or the text of each point; empty for no box, None for name and y.
    """
    template = "%{customdata}" if not isinstance(hover, str | None) else hover
    template = f"{escape_name(name)}: %{{y:.4~r}} {escape_name(unit)}" if template is None else template
    trace = {
        "type": "scatter",
        "x": np.asarray(x, dtype=np.float32),
        "y": np.asarray(y, dtype=np.float32),
        "mode": mode,
        "name": escape_name(name),
        "meta": list(keys),
        "connectgaps": False,
    }
    trace |= {"hovertemplate": f"{template}<extra></extra>"} if template else {"hoverinfo": "skip"}
    return {**trace, **({} if isinstance(hover, str | None) else {"customdata": list(hover)}), **options}


def error_bars(middle: Floats, low: Floats, high: Floats, colour: str) -> dict[str, Any]:
    """Error bars from low to high around the middle; none where an end is not finite."""
    reach = {"array": np.nan_to_num(high - middle, posinf=0.0), "arrayminus": np.nan_to_num(middle - low, posinf=0.0)}
    return {"type": "data", "symmetric": False, "color": colour, "thickness": 1.5, "width": 4, **reach}


def spread_places(places: Sequence[float], gap: float, most: float) -> list[float]:
    """Move rising places at least `gap` apart and none beyond `most`, each as little as those before it allow."""
    moved: list[float] = []
    for place in places:
        moved.append(max(place, moved[-1] + gap) if moved else place)
    for i in reversed(range(len(moved))):
        moved[i] = min(moved[i], most if i == len(moved) - 1 else moved[i + 1] - gap)
    return moved


def even_places(length: int, most: int) -> Indices:
    """At most so many indices of a sequence at even distances, the first and the last included."""
    return np.linspace(0, length - 1, min(length, most)).round().astype(int)


def names_in(frame: pd.DataFrame, column: str = "run") -> list[str]:
    """Names in a column of a frame, each once, in their order."""
    return [str(name) for name in pd.unique(frame[column])]


def draw_alone(figure: PageFigure, chosen: Sequence[object] = (), *, dark: bool = False) -> go.Figure:
    """Draw a figure of a page as one Plotly figure with title, legend and real colours.

    chosen : an option of each control, in order; None for the one that the page shows first; ShipidError for another.
    """
    given = [*chosen, *[None] * (len(figure.controls) - len(chosen))]
    panels = figure.draw(*(_find_option(*pair) for pair in zip(figure.controls, given, strict=True)))
    whole = make_subplots(rows=len(panels), subplot_titles=[*map(escape_name, figure.captions)] or None)
    whole = go.Figure(panels[0]) if len(panels) == 1 else whole
    for row, panel in enumerate(panels if len(panels) > 1 else (), start=1):
        layout, across = panel["layout"], {**panel["layout"]["xaxis"]}
        across |= {"scaleanchor": f"y{row}"} if "scaleanchor" in across else {}
        whole.add_traces(panel["data"], rows=row, cols=1)
        whole.update_xaxes(across, row=row, col=1).update_yaxes(layout["yaxis"], row=row, col=1)
        whole.update_layout(template=None, plot_bgcolor=TRANSPARENT, font=layout["font"], hovermode="closest")
    whole.update_traces(showlegend=False)
    whole.add_traces([_legend_entry(chip) for chip in figure.chips])
    if figure.scale is not None:
        whole.add_trace(_scale_bar(figure.scale))
    takeaway = "<br>".join(map(escape_name, wrap(figure.takeaway, 110)))
    title = {
        "text": f"{escape_name(figure.title)}<br><sup>{takeaway}</sup>",
        "x": 0,
        "xref": "paper",
        "y": 1,
        "yref": "container",
        "yanchor": "top",
        "pad": {"t": 24},
    }
    height = len(panels) * figure.height + 130 + 70 * (len(panels) - 1)
    beside = 1.25 if whole.layout.annotations else 1.02  # right of names that stand beside the lines
    colours = page_colours("dark" if dark else "light")
    whole.update_layout(
        title=title,
        width=900,
        height=height,
        margin_t=90,
        legend_x=beside,
        showlegend=bool(figure.chips),
        paper_bgcolor=colours["page"],
    )
    parts = {"data": [trace.to_plotly_json() for trace in whole.data], "layout": whole.layout.to_plotly_json()}
    plain = json.dumps(parts, cls=PlotlyJSONEncoder)
    return go.Figure(json.loads(re.sub(r"var\(--([\w-]+)\)", lambda match: colours[match[1]], plain)))


def _find_option(control: Control, value: object) -> Any:
    """An option by its text, or by its number where the text is one."""
    texts = [str(option) for option in control.options]
    if value is not None and str(value) not in texts:
        words = f"{control.label}: {str(value)!r} is none of its options; {suggest_name(str(value), texts)}"
        raise ShipidError(words, path="figures")
    return control.options[control.start if value is None else texts.index(str(value))]


def _legend_entry(chip: Chip) -> Trace:
    """Entry of the legend without a point on the plot."""
    mode = "+".join(["lines"] * (chip.dash != "none") + ["markers"] * bool(chip.symbol))
    ink = {"color": chip.colour, "width": chip.width, "dash": "solid" if chip.dash == "none" else chip.dash}
    marker = {"color": chip.colour, "symbol": chip.symbol or "circle"}
    entry = {"x": [None], "y": [None], "name": escape_name(chip.label), "mode": mode, "line": ink, "marker": marker}
    return {"type": "scatter", "showlegend": True, **entry}


def _scale_bar(scale: ColourScale) -> Trace:
    """Colour bar of a logarithmic scale below the panels, without a point on the plot."""
    least = least_coloured((scale.low, scale.high))
    low, high = (math.log10(max(value, least)) for value in (scale.low, scale.high))
    ticks = np.linspace(low, high, 4).tolist()
    bar = {
        "title": {"text": escape_name(scale.label), "side": "top"},
        "orientation": "h",
        "y": -0.15,
        "yanchor": "top",
        "tickvals": ticks,
        "ticktext": [f"{10**tick:.3g}" for tick in ticks],
        "thickness": 16,
    }
    steps = [[step, f"var(--{scale.gradient}-{i})"] for i, step in enumerate(np.linspace(0, 1, COLOUR_LEVELS).tolist())]
    marker = {"color": [low, high], "colorscale": steps, "cmin": low, "cmax": high, "showscale": True, "colorbar": bar}
    return {
        "type": "scatter",
        "x": [None, None],
        "y": [None, None],
        "mode": "markers",
        "marker": marker,
        "showlegend": False,
    }


LENGTH, SLENDERNESS = 30.0, 6.0  # of a ship whose particulars do not say: m; length over beam


def ship_outline(particulars: Mapping[str, float]) -> np.ndarray:
    """Return the outline (k, 2) of a ship from above [m]: a box with a pointed bow.

    Body axes: the first column is ahead, the second to starboard, midships at 0, 0.

    particulars : of a vessel [m]: L_oa, else L_pp, else 30 m; B, else a sixth of the length.
    """
    length = particulars.get("L_oa", particulars.get("L_pp", LENGTH))
    beam = particulars.get("B", length / SLENDERNESS)
    half, shoulder = beam / 2, length / 2 - 0.25 * length
    stern = -length / 2
    points = [(stern, -half), (shoulder, -half), (length / 2, 0.0), (shoulder, half), (stern, half), (stern, -half)]
    return np.array(points)
