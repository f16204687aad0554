"""Panels of a figure as the page draws them."""

from __future__ import annotations

from itertools import product

import plotly.graph_objects as go

from shipid.report.figure import PageFigure


def views(figure: PageFigure) -> dict[str, list[go.Figure]]:
    """Indices of the options of the controls, joined by `-` -> panels; one view of the key "" without controls."""
    result = {}
    for places in product(*(range(len(control.options)) for control in figure.controls)):
        options = [control.options[place] for control, place in zip(figure.controls, places, strict=True)]
        result["-".join(map(str, places))] = [go.Figure(panel) for panel in figure.draw(*options)]
    return result


def first_panel(figure: PageFigure, view: str | None = None) -> go.Figure:
    """The first panel of a view; default: the one that a reader sees first."""
    return views(figure)["-".join(str(control.start) for control in figure.controls) if view is None else view][0]
