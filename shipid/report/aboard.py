"""The page of a log played as if at sea: what an officer would have seen, and how it went on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from shipid.report.content import Floats, Line, PageContent, Sentence
from shipid.report.figure import Chip, Control, Figure, Panel, Plot, Trace, axis, layout, line, plane
from shipid.report.page import page, write
from shipid.report.palette import INK, category
from shipid.report.section import Section
from shipid.report.selection import spread
from shipid.report.wording import metres

LOGGED, PATH, PHYSICS, BAND, ALARM = "logged track", "predicted path", "physics alone", "band", "alarm"
COLOURS = {LOGGED: INK, PATH: category(0), PHYSICS: category(1), BAND: category(0), ALARM: INK}
DASHES = {PHYSICS: "dash", BAND: "dot"}
FIRST = ("predictions", "alarm", "band")  # kinds of lines that the page begins with
MOST_RUNS, MOMENTS = 24, 6  # runs to choose from; instants of a run whose paths are drawn


@dataclass(frozen=True, eq=False, kw_only=True)
class AboardContent(PageContent):
    """Everything the page shows.

    Parameters
    ----------
    title, name : in words, and the predictor.
    lines : the lines of the summary, in the order of the terminal.
    instants : run, t [s], outside (the alarm), error at the end of the horizon [m], latency [s].
    points : run, t, ahead [s], north, east, physics_north, physics_east [m]; with a band also band_along, band_across
        [m] and band_course [rad, clockwise from north].
    track : run, t [s], north, east [m], as measured.
    """

    lines: Sequence[Line]
    instants: pd.DataFrame
    points: pd.DataFrame
    track: pd.DataFrame

    @property
    def answer(self) -> list[Sentence]:
        """What was predicted, how often the alarm was raised, whether the band kept its promise; then its limits."""
        first = [line for line in self.lines if line.kind in FIRST]
        limits = [line for line in self.lines if line.kind == "limit"]
        return [_sentence(line) for line in (*first, *limits)]

    @property
    def runs(self) -> list[str]:
        """Runs to choose from: if there are many some at even distances, and the one with the largest error."""
        every = [str(run) for run in pd.unique(self.instants["run"])]
        shown = {*spread(every, MOST_RUNS), self.worst}
        return [run for run in every if run in shown]

    @property
    def worst(self) -> str:
        """The run with the largest error at the end of a path; the first where none can be judged."""
        return str(self.instants["run"].iloc[int(self.instants["error"].fillna(-1.0).argmax())])

    @property
    def banded(self) -> bool:
        """Whether a band was asked for."""
        return "band_along" in self.points


def _sentence(line: Line) -> Sentence:
    """A line of the terminal as a sentence of the page."""
    return Sentence(line.text[0].upper() + line.text[1:] + ".", "seen")


AXES = {"band along": ("band_along", "dash"), "band across": ("band_across", "dot")}
"""Half axes of the band in the figure over time: name -> column, dash."""


def write_aboard(content: AboardContent, file: Path) -> Path:
    """Write the page as one HTML file that makes no request; returns the file. Raises ResultError if it cannot."""
    return write(page(content, SECTIONS, "aboard"), file)


def outline(points: pd.DataFrame, corners: int = 16) -> tuple[Floats, Floats]:
    """East and north [m] of the ellipses of a band around the points of a path, with a gap between two."""
    turn = np.append(np.linspace(0, 2 * np.pi, corners), np.nan)
    along = points["band_along"].to_numpy()[:, None] * np.cos(turn)
    across = points["band_across"].to_numpy()[:, None] * np.sin(turn)
    course = points["band_course"].to_numpy()[:, None]
    north = points["north"].to_numpy()[:, None] + along * np.cos(course) - across * np.sin(course)
    east = points["east"].to_numpy()[:, None] + along * np.sin(course) + across * np.cos(course)
    return east.ravel(), north.ravel()


def seen(content: AboardContent) -> Figure:
    """The track of a run with the paths, and bands, that were shown at some instants."""
    drawn = [LOGGED, PATH, *([PHYSICS] if content.points["physics_north"].notna().any() else [])]
    drawn += [BAND] if content.banded else []
    return Figure(
        id="seen",
        title="What was seen",
        takeaway=_sentence(next((line for line in content.lines if line.kind == "band"), content.lines[0])).text,
        how=f"Paths of at most {MOMENTS} instants of a run, predicted from the rows up to then; the track went on as "
        "drawn." + (" Ellipses are the band at a few steps of each path." if content.banded else ""),
        alternative="The measured track, with the paths predicted along it and those of the physics alone.",
        height=520,
        views={str(i): [Panel(_map(content, run))] for i, run in enumerate(content.runs)},
        controls=[Control("Run", content.runs, content.runs.index(content.worst))],
        chips=[Chip(name, name, COLOURS[name], DASHES.get(name, "solid")) for name in drawn],
    )


def _map(content: AboardContent, run: str) -> Plot:
    track = content.track[content.track["run"] == run]
    points = content.points[content.points["run"] == run]
    times = points["t"].unique()
    shown = times[np.unique(np.linspace(0, len(times) - 1, MOMENTS).round().astype(int))]
    traces = [_trace(LOGGED, track["east"].to_numpy(), track["north"].to_numpy(), 1.6)]
    for t in shown:
        mine = points[points["t"] == t]
        traces.append(_trace(PATH, mine["east"].to_numpy(), mine["north"].to_numpy(), 2.4))
        if mine["physics_north"].notna().any():
            traces.append(_trace(PHYSICS, mine["physics_east"].to_numpy(), mine["physics_north"].to_numpy(), 1.4))
        if content.banded:
            few = mine.iloc[np.unique(np.linspace(len(mine) // 4, len(mine) - 1, 3).round().astype(int))]
            traces.append(_trace(BAND, *outline(few), 1.2))
    return Plot(traces, plane("east [m]", "north [m]"))


def _trace(name: str, x: Floats, y: Floats, width: float) -> Trace:
    look = {"color": COLOURS[name], "dash": DASHES.get(name, "solid"), "width": width}
    return line(name, x, y, [name], line=look)


def along(content: AboardContent) -> Figure:
    """Error at the end of each path, size of the band there, and the alarm, over the time of a run."""
    error = content.instants["error"].median()
    takeaway = f"Over all runs, the median error at the end of a path is {metres(error)}"
    takeaway += f"; the largest, {metres(float(content.instants['error'].max()))}, is in {content.worst}."
    return Figure(
        id="along",
        title="Along the run",
        takeaway=takeaway if np.isfinite(error) else "The log ends before a path can be judged: 0 errors.",
        how="Error at the end of the path predicted at each instant"
        + (", with the half axes of the band there" if content.banded else "")
        + "; marks are instants outside of the training, where nothing is promised.",
        alternative="Error over time, with instants of alarm marked.",
        height=300,
        views={str(i): [Panel(_history(content, run))] for i, run in enumerate(content.runs)},
        controls=[Control("Run", content.runs, content.runs.index(content.worst))],
        chips=[
            Chip(PATH, "error", COLOURS[PATH]),
            *(Chip(name, name, COLOURS[BAND], dash) for name, (_, dash) in AXES.items() if content.banded),
            Chip(ALARM, "alarm", COLOURS[ALARM], "none", symbol="triangle-up"),
        ],
    )


def _history(content: AboardContent, run: str) -> Plot:
    mine = content.instants[content.instants["run"] == run]
    t = mine["t"].to_numpy() - float(content.track.loc[content.track["run"] == run, "t"].min())
    traces = [line("error", t, mine["error"].to_numpy(), [PATH], line={"color": COLOURS[PATH], "width": 2})]
    if content.banded:
        last = content.points[(content.points["run"] == run)].groupby("t", sort=False).last()
        for name, (column, dash) in AXES.items():
            look = {"color": COLOURS[BAND], "dash": dash, "width": 1.4}
            traces.append(line(name, t, last[column].to_numpy(), [name], line=look))
    alarm = mine["outside"].to_numpy(dtype=bool)
    marks = {"color": COLOURS[ALARM], "size": 8, "symbol": "triangle-up"}
    traces.append(line(ALARM, t[alarm], np.zeros(alarm.sum()), [ALARM], mode="markers", marker=marks))
    up = axis("at the end of the path [m]", rangemode="tozero")
    return Plot(traces, layout(axis("time in the run [s]"), up))


SECTIONS: dict[str, Section] = {
    "aboard": Section(
        "As if at sea", lambda content: (seen(content), along(content)), needs=("instants",), anchors=("seen", "along")
    ),
}
"""Sections of the page in order."""
