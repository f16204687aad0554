"""Recorded and simulated motion: speeds and yaw rate over time, and the track; the page of a replay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from shipid.report.content import AnswerSentence, PageContent
from shipid.report.figure import (
    INK,
    MOST_LINE_POINTS,
    Chip,
    Control,
    PageFigure,
    Panel,
    category_colour,
    make_axis,
    make_chart,
    make_line,
    make_plot,
    names_in,
    zero_axis,
)
from shipid.report.page import Section, write_page
from shipid.report.tables import PageTable, frame_table
from shipid.report.wording import number_text

LOG_SERIES = "measured"
DEGREES = float(np.rad2deg(1.0))
MOTION_AXES = {"u": ("speed ahead, u", "m/s", 1.0), "v": ("to starboard, v", "m/s", 1.0)} | {
    "r": ("yaw rate, r", "deg/s", DEGREES)
}
"""Column -> what it is, the unit shown, and how many of those an SI unit is."""

REPLAYED = "replayed"
REPLAY_INKS = {LOG_SERIES: {"color": INK, "dash": "solid"}, REPLAYED: {"color": category_colour(0), "dash": "solid"}}
REPLAY_ERRORS = {
    "run": "run",
    "u [m/s]": "u",
    "v [m/s]": "v",
    "r [deg/s]": "r",
    "position [m]": "position",
}


def motion_figure(
    series: pd.DataFrame, inks: Mapping[str, Mapping[str, Any]], framed: Sequence[str], **texts: Any
) -> PageFigure:
    """Panels of a run that a reader picks: u, v, r over time, and the map, north up with equal axes.

    series : run, model, piece, t [s], north, east [m], u, v [m/s], r [rad/s]. framed : models that the map shows whole.
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


@dataclass(frozen=True, eq=False, kw_only=True)
class ReplayContent(PageContent):
    """Everything the page shows.

    series : run, piece, t [s], model (`measured`, `replayed`), north, east [m], u, v [m/s], r [rad/s].
    errors : run (`all` at first), root mean squares u, v [m/s], r [rad/s], position [m].
    ahead : length of each simulation [s]; 0 for whole runs.
    """

    series: pd.DataFrame
    errors: pd.DataFrame
    ahead: float

    @property
    def answer(self) -> list[AnswerSentence]:
        """The error over all runs."""
        error = number_text(float(self.errors.set_index("run")["position"]["all"]))
        return [AnswerSentence(f"Position is {error} m off, RMS over all rows, {_length_words(self.ahead)}.", "errors")]


def _length_words(ahead: float) -> str:
    return f"in simulations of {ahead:g} s" if ahead else "in simulations as long as the runs"


def replayed_motion(content: ReplayContent) -> PageFigure:
    """Measured and replayed motion, one run at a time."""
    return motion_figure(
        content.series,
        REPLAY_INKS,
        (LOG_SERIES, REPLAYED),
        id="motion",
        title="Recorded and replayed",
        takeaway=content.answer[0].text,
        how="The vessel begins at the measured state and goes by the recorded orders and wind alone."
        + (" New simulations begin where lines are broken." if content.ahead else ""),
        alternative="Speeds, yaw rate and tracks, measured and replayed; the table below has the errors.",
    )


def replay_errors(content: ReplayContent) -> PageTable:
    """Root mean square errors, run by run."""
    title = f"Root mean square errors {_length_words(content.ahead)}"
    return frame_table("errors", title, "", content.errors.assign(r=DEGREES * content.errors["r"]), REPLAY_ERRORS)


REPLAY_PAGE = {
    "replay": Section(
        "Recorded and replayed", {"motion": (replayed_motion, "series"), "errors": (replay_errors, "series")}
    )
}
write_replay = partial(write_page, "replay", REPLAY_PAGE)
