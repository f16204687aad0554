"""Recorded and simulated motion: speeds and yaw rate over time, and the track."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from shipid.report.figure import Panel, Plot, axis, layout, line, plane
from shipid.report.palette import GRID

POINTS = 600  # of one line: more than pixels are wide
LOG = "measured"
MOTIONS = {"u": ("speed ahead, u", "m/s", 1.0), "v": ("to starboard, v", "m/s", 1.0)} | {
    "r": ("yaw rate, r", "deg/s", float(np.rad2deg(1.0)))
}
"""Column -> what it is, the unit shown, and how many of those an SI unit is."""


def panels(rows: pd.DataFrame, lines: Mapping[str, Mapping[str, Any]], framed: Sequence[str]) -> list[Panel]:
    """Panels of one run: u, v, r over time, and the map, north up with equal axes.

    rows : `model`, `piece`, `t` [s], `north`, `east` [m], `u`, `v` [m/s], `r` [rad/s]. lines : model -> colour and dash
    of its line. framed : models that the map shows whole; the others may leave it.
    """
    start, parts = float(rows["t"].min()), {name: _joined(rows[rows["model"] == name]) for name in lines}
    inks = {name: {**ink, "width": 1.4 if name == LOG else 2} for name, ink in lines.items()}
    result = []
    for column, (title, unit, factor) in MOTIONS.items():
        traces = [
            line(name, mine["t"].to_numpy() - start, factor * mine[column].to_numpy(), [name], unit, line=inks[name])
            for name, mine in parts.items()
        ]
        y = axis(f"{title} [{unit}]", nticks=6, zeroline=True, zerolinecolor=GRID)
        result.append(Panel(Plot(traces, layout(axis("time in the run [s]", nticks=6), y, hovermode="closest"))))
    tracks = [
        line(name, mine["east"].to_numpy(), mine["north"].to_numpy(), [name], line=inks[name])
        for name, mine in parts.items()
    ]
    shown = pd.concat([parts[name] for name in framed])
    bounds = [(float(shown[name].min()), float(shown[name].max())) for name in ("east", "north")]
    chart = plane("east [m]", "north [m]", _finite(bounds))
    chart["xaxis"]["nticks"] = 4  # the panel is narrow
    return [*result, Panel(Plot(tracks, chart))]


def _finite(bounds: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the spans (low, high) of a map; one without width gets 1 on each side."""
    return [(low, high) if high > low else (low - 1, low + 1) for low, high in bounds]


def _joined(mine: pd.DataFrame) -> pd.DataFrame:
    """Join the pieces of a line, with a gap between them."""
    every = max(1, len(mine) // POINTS)
    pieces = mine.groupby("piece", sort=False)
    kept = mine[(pieces.cumcount() % every == 0).to_numpy()]
    gaps = pieces.tail(1).assign(**dict.fromkeys(("north", "east", "u", "v", "r"), np.nan))
    whole = pd.concat([kept, gaps])
    numbers = pd.Series(range(pieces.ngroups), index=pd.unique(mine["piece"]))
    return whole.iloc[np.argsort(whole["piece"].map(numbers).to_numpy(), kind="stable")]
