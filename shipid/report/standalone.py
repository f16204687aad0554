"""Figures of the report as plain plotly figures, for a notebook or a file."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from textwrap import wrap
from typing import Any

import numpy as np
import plotly.graph_objects as go

from shipid.errors import ShipidError, choices
from shipid.report import (
    bands,
    checks,
    error_map,
    errors_over,
    factors,
    gain,
    identification,
    logs,
    manoeuvre,
    palette,
    search,
)
from shipid.report.figure import Chip, Control, Figure, Panel, Scale, label

FIGURES: dict[str, Callable[[Any], Figure | None]] = {
    "error_map": error_map.error_map,
    "gain": gain.gain,
    "coverage": bands.coverage,
    "width_map": bands.width_map,
    "error_over_horizon": errors_over.horizon,
    "error_over_time": errors_over.over_time,
    "factors": factors.factors,
    "tracks": logs.manoeuvres,
    "envelope": logs.envelope,
    "search": search.search,
    "motion": lambda content: checks.motion(content.series),
    "estimates": identification.estimates,
    "correlations": identification.correlations,
    "free_runs": identification.free_runs,
    "residuals": identification.residuals,
    "profiles": identification.profiles,
    "track": manoeuvre.track,
    "histories": manoeuvre.histories,
    "spiral": manoeuvre.spiral,
}
"""Name of a function of `shipid.figures` -> what draws it from the content of a page."""

LACKS: dict[str, Callable[[Any], str]] = {
    "error_map": error_map.lack,
    "width_map": error_map.lack,
    "gain": gain.lack,
}
"""Key of `FIGURES` -> what says why there is nothing to draw, if it is not that there are no rows."""

WIDTH, MARGIN, GAP = 900, 130, 70  # of a figure; height of what is around its panels, and between two of them [px]
BAR = 80  # of a scale below the panels [px]
LYING = {"orientation": "h", "title_side": "top", "thickness": 16, "x": 0.5, "y": -0.15, "yanchor": "top"}
BESIDE = 1.25  # of the width of the panels: a legend or a scale right of names that are right of the panel


def standalone(name: str, content: object, chosen: Sequence[object] = (), *, dark: bool = False) -> go.Figure:
    """Draw one figure of the report as a plotly figure with title, legend and real colours.

    Parameters
    ----------
    name : key of `FIGURES`.
    content : content of the page that holds the figure.
    chosen : an option of each control of the figure, in order; None for the one that the page shows first.
    dark : light ink on a dark ground.

    Raises ShipidError where the content has nothing to draw, or an option does not exist.
    """
    figure = FIGURES[name](content)
    if figure is None:
        lack = LACKS[name](content) if name in LACKS else ""
        raise ShipidError(f"there is nothing to draw: {lack or 'the results hold no rows for it'}", path=name)
    given = [*chosen, *[None] * (len(figure.controls) - len(chosen))]
    places = [_place(control, value, name) for control, value in zip(figure.controls, given, strict=True)]
    return dressed(figure, figure.views["-".join(map(str, places))], dark)


def dressed(figure: Figure, panels: Sequence[Panel], dark: bool = False) -> go.Figure:
    """Make one plotly figure of some panels of a figure of the report."""
    return painted(_titled(_stacked(panels, figure.height), figure), dark)


def painted(figure: go.Figure, dark: bool = False) -> go.Figure:
    """Replace the names of colours, `var(--ink)`, by the colours of the light or the dark page."""
    colours = _colours(dark)

    def paint(value: Any) -> Any:
        if isinstance(value, str):
            return re.sub(r"var\((--[\w-]+)\)", lambda match: colours[match[1]], value)
        if isinstance(value, Mapping):
            return {key: paint(item) for key, item in value.items()}
        if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype.kind in "OU"):
            return [paint(item) for item in value]
        return value

    data = [paint(trace.to_plotly_json()) for trace in figure.data]
    return go.Figure(data, {**paint(figure.layout.to_plotly_json()), "paper_bgcolor": colours["--page"]})


def _colours(dark: bool) -> dict[str, str]:
    """Name of a colour -> colour, from the style sheet and the palette of the page."""
    sheet = files("shipid.report").joinpath("style.css").read_text(encoding="utf-8")
    blocks = re.findall(r"\{([^{}]*--page:[^{}]*)\}", sheet)
    text = blocks[1 if dark else 0] + palette.variables(dark)
    return {name: value.strip() for name, value in re.findall(r"(--[\w-]+):([^;]+);", text)}


def _place(control: Control, value: object, name: str) -> int:
    """Find an option by its text, or by its number where the text is one."""
    if value is None:
        return control.start
    text = str(value)
    if text not in control.options:
        raise ShipidError(
            f"{control.label}: {text!r} is none of its options; {choices(text, control.options)}", path=name
        )
    return list(control.options).index(text)


def _stacked(panels: Sequence[Panel], height: int) -> go.Figure:
    """Put panels below each other, each on its axes."""
    if len(panels) == 1:
        figure = go.Figure(panels[0].figure)
        figure.update_layout(height=height + MARGIN)
        return figure
    total = len(panels) * (height + GAP)
    data: list[Any] = []
    layout = dict(panels[0].figure.layout.to_plotly_json())
    for name in ("xaxis", "yaxis"):
        layout.pop(name, None)
    shapes: list[Any] = []
    notes: list[Any] = []
    for row, panel in enumerate(panels):
        number = "" if row == 0 else str(row + 1)
        bottom = 1 - (row * (height + GAP) + height) / total
        axes = panel.figure.layout.to_plotly_json()
        layout[f"xaxis{number}"] = {**axes["xaxis"], "anchor": f"y{number}"}
        layout[f"yaxis{number}"] = {
            **axes["yaxis"],
            "anchor": f"x{number}",
            "domain": [bottom, bottom + height / total],
        }
        if "scaleanchor" in axes["xaxis"]:
            layout[f"xaxis{number}"]["scaleanchor"] = f"y{number}"
        tie = {"xaxis": f"x{number}", "yaxis": f"y{number}"}
        data += [{**trace.to_plotly_json(), **tie} for trace in panel.figure.data]
        for items, kind in ((shapes, "shapes"), (notes, "annotations")):
            items += [_moved(item, number) for item in axes.get(kind, ())]
        if panel.caption:
            place = {"x": 0, "xref": "paper", "xanchor": "left", "y": bottom + height / total, "yref": "paper"}
            notes.append({**place, "yanchor": "bottom", "text": label(panel.caption), "showarrow": False})
    return go.Figure(data, {**layout, "shapes": shapes, "annotations": notes, "height": total + MARGIN})


def _moved(item: Mapping[str, Any], number: str) -> dict[str, Any]:
    """Tie a shape or an annotation to the axes of its panel."""
    ties = {f"{axis}ref": str(item.get(f"{axis}ref", axis)) for axis in "xy"}
    return {
        **item,
        **{key: f"{key[0]}{number}" if tie == key[0] else f"{key[0]}{number} domain" for key, tie in ties.items()},
    }


def _titled(figure: go.Figure, record: Figure) -> go.Figure:
    """Add the title, the legend that the page has as text, and the scale of the colours."""
    for trace in figure.data:
        keys = [str(key) for key in trace.meta or ()]
        trace.showlegend = False
        if keys and hasattr(trace, "legendgroup"):
            trace.legendgroup = next((key for key in keys if key.startswith("model:")), keys[0])
    figure.layout.margin.t = 76
    beside = any(_is_beside(note) for note in figure.layout.annotations)
    if beside:
        figure.layout.legend.x = BESIDE
    if not any(trace.type.endswith("3d") for trace in figure.data):
        figure.add_traces([_entry(chip) for chip in record.chips])
        if record.scale:
            figure.add_trace(_bar(record.scale))
        if record.scale and record.chips and not beside:  # a legend of many models is as high as the plot
            figure.data[-1].marker.colorbar.update(LYING)
            figure.update_layout(height=figure.layout.height + BAR, margin_b=(figure.layout.margin.b or 0) + BAR)
    takeaway = label("\n".join(wrap(record.takeaway, 110))).replace("\n", "<br>")
    words = f"{label(record.title)}<br><sup>{takeaway}</sup>"
    figure.update_layout(
        title={"text": words, "x": 0, "xref": "paper", "y": 1, "yref": "container", "yanchor": "top", "pad": {"t": 14}},
        width=WIDTH,
        showlegend=bool(record.chips),
    )
    return figure


def _is_beside(note: Any) -> bool:
    """Whether an annotation is right of its panel, where plotly puts the legend: a name of a row, or of a line."""
    right = (note.xref == "paper" and note.x == 1) or note.axref == "pixel"
    return bool(right and note.xanchor == "left")


def _entry(chip: Chip) -> go.Scatter:
    """Entry of the legend without a point on the plot."""
    mode = "+".join(["lines"] * (chip.dash != "none") + ["markers"] * bool(chip.symbol)) or "lines"
    return go.Scatter(
        x=[None],
        y=[None],
        name=label(chip.label),
        mode=mode,
        legendgroup=chip.key,
        showlegend=True,
        line={"color": chip.colour, "width": chip.width, "dash": "solid" if chip.dash == "none" else chip.dash},
        marker={"color": chip.colour, "symbol": chip.symbol or "circle"},
    )


def _bar(scale: Scale) -> go.Scatter:
    """Colour bar of a logarithmic scale, without a point on the plot."""
    steps = np.linspace(0, 1, palette.LEVELS)
    least = palette.least_coloured((scale.low, scale.high))
    low, high = (math.log10(max(value, least)) for value in (scale.low, scale.high))
    ticks = np.linspace(low, high, 4)
    marker = {
        "color": [low, high],
        "colorscale": [[float(step), f"var({scale.gradient}-{i})"] for i, step in enumerate(steps)],
        "cmin": low,
        "cmax": high,
        "showscale": True,
        "colorbar": {
            "title": {"text": label(scale.label), "side": "right"},
            "tickvals": ticks.tolist(),
            "ticktext": [f"{10**tick:.3g}" for tick in ticks],
            "len": 0.7,
            "y": 0,
            "yanchor": "bottom",
            "x": BESIDE,
        },
    }
    return go.Scatter(x=[None, None], y=[None, None], mode="markers", marker=marker, showlegend=False, hoverinfo="skip")
