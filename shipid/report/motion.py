"""Recorded and simulated motion: speeds and yaw rate over time, the track, and the errors of free runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from shipid.report.figure import (
    MOST_LINE_POINTS,
    Chip,
    Control,
    PageFigure,
    Panel,
    make_axis,
    make_chart,
    make_line,
    make_plot,
    names_in,
    zero_axis,
)

LOG_SERIES = "measured"
DEGREES = float(np.rad2deg(1.0))
MOTION_AXES = {"u": ("speed ahead, u", "m/s", 1.0), "v": ("to starboard, v", "m/s", 1.0)} | {
    "r": ("yaw rate, r", "deg/s", DEGREES)
}
"""Column -> what it is, the unit shown, and how many of those an SI unit is."""


def motion_figure(
    series: pd.DataFrame, inks: Mapping[str, Mapping[str, Any]], framed: Sequence[str], **texts: Any
) -> PageFigure:
    """Panels of a run that a reader picks: u, v, r over time, and the map, north up with equal axes.

    Parameters
    ----------
    series : `run`, `model`, `piece`, `t` [s], `north`, `east` [m], `u`, `v` [m/s], `r` [rad/s].
    inks : model -> colour and dash of its line.
    framed : models that the map shows whole; the others may leave it.
    texts : of the figure.
    """
    runs = names_in(series)
    return PageFigure(
        **texts,
        height=290,
        draw=lambda run: _draw_motion(series[series["run"] == run], inks, framed),
        controls=[Control("Run", runs)],
        chips=[Chip(name, name, ink["color"], ink["dash"]) for name, ink in inks.items()],
    )


def _draw_motion(rows: pd.DataFrame, inks: Mapping[str, Mapping[str, Any]], framed: Sequence[str]) -> list[Panel]:
    parts = {name: _with_gaps(rows[rows["model"] == name]) for name in inks}
    looks = {name: {**ink, "width": 1.4 if name == LOG_SERIES else 2} for name, ink in inks.items()}
    panels = []
    for column, (title, unit, factor) in MOTION_AXES.items():
        traces = [
            make_line(name, mine["t"] - rows["t"].min(), factor * mine[column], [name], unit, line=looks[name])
            for name, mine in parts.items()
        ]
        panels.append(
            make_plot(traces, make_axis("time in the run [s]", nticks=6), zero_axis(f"{title} [{unit}]", nticks=6))
        )
    tracks = [make_line(name, mine["east"], mine["north"], [name], line=looks[name]) for name, mine in parts.items()]
    shown = pd.concat([parts[name] for name in framed])
    bounds = [(float(shown[name].min()), float(shown[name].max())) for name in ("east", "north")]
    bounds = [(low, high) if high > low else (low - 1, low + 1) for low, high in bounds]
    return [*panels, make_chart(tracks, "east [m]", "north [m]", bounds, nticks=4)]  # the panel is narrow


def _with_gaps(mine: pd.DataFrame) -> pd.DataFrame:
    """Join the pieces of a line, of no more rows than a line needs, with a gap between them."""
    pieces = mine.groupby("piece", sort=False)
    kept = mine[(pieces.cumcount() % max(1, len(mine) // MOST_LINE_POINTS) == 0).to_numpy()]
    gaps = pieces.tail(1).assign(**dict.fromkeys(("north", "east", "u", "v", "r"), np.nan))
    whole = pd.concat([kept, gaps])
    order = {name: i for i, name in enumerate(pd.unique(mine["piece"]))}
    return whole.iloc[np.argsort(whole["piece"].map(order).to_numpy(), kind="stable")]
