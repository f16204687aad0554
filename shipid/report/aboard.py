"""The page of a log played as if at sea: what an officer would have seen, and how it went on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from shipid.report.content import AnswerSentence, Floats, PageContent, SummaryLine
from shipid.report.figure import (
    INK,
    Chip,
    Control,
    PageFigure,
    Panel,
    category_colour,
    even_places,
    make_axis,
    make_chart,
    make_line,
    make_plot,
    names_in,
)
from shipid.report.page import Section, write_page
from shipid.report.wording import metres_text

LOGGED_TRACK, PATH, PHYSICS, BAND, ALARM = "logged track", "predicted path", "physics alone", "band", "alarm"
LOOKS = {
    LOGGED_TRACK: {"color": INK, "dash": "solid"},
    PATH: {"color": category_colour(0), "dash": "solid"},
    PHYSICS: {"color": category_colour(1), "dash": "dash"},
    BAND: {"color": category_colour(0), "dash": "dot"},
}
HALF_AXES = {"band along": ("band_along", "dash"), "band across": ("band_across", "dot")}
"""Half axes of the band in the figure over time: name -> column, dash."""
FIRST_KINDS = ("predictions", "alarm", "band")  # kinds of lines that the page begins with
MOMENTS = 6  # instants of a run whose paths are drawn


@dataclass(frozen=True, eq=False, kw_only=True)
class AboardContent(PageContent):
    """Everything the page shows.

    lines : the summary. track : run, t [s], north, east [m].
    instants : run, t [s], outside (the alarm), error at the end of the horizon [m], latency [s].
    points : run, t, ahead [s], north, east, physics_north, physics_east [m]; with a band also band_along, band_across
    [m] and band_course [rad, clockwise from north].
    """

    lines: Sequence[SummaryLine]
    instants: pd.DataFrame
    points: pd.DataFrame
    track: pd.DataFrame

    @property
    def answer(self) -> list[AnswerSentence]:
        """What was predicted, how often the alarm was raised, whether the band kept its promise; then its limits."""
        first = [line for line in self.lines if line.kind in FIRST_KINDS]
        limits = [line for line in self.lines if line.kind == "limit"]
        return [AnswerSentence(sentence_of(line), "seen") for line in (*first, *limits)]


def sentence_of(line: SummaryLine) -> str:
    """A line of the terminal as a sentence of the page."""
    return f"{line.text[0].upper()}{line.text[1:]}."


def _control_of_runs(content: AboardContent) -> Control:
    """Runs to choose from; first the one with the largest error."""
    worst, runs = int(content.instants["error"].fillna(-1.0).argmax()), names_in(content.instants)
    return Control("Run", runs, runs.index(str(content.instants["run"].iloc[worst])))


def band_outline(points: pd.DataFrame, corners: int = 16) -> tuple[Floats, Floats]:
    """East and north [m] of the ellipses of a band around the points of a path, with a gap between two."""
    turn = np.append(np.linspace(0, 2 * np.pi, corners), np.nan)
    columns = ("band_along", "band_across", "band_course", "north", "east")
    along, across, course, north, east = (points[name].to_numpy()[:, None] for name in columns)
    x, y = along * np.cos(turn), across * np.sin(turn)
    north, east = north + x * np.cos(course) - y * np.sin(course), east + x * np.sin(course) + y * np.cos(course)
    return east.ravel(), north.ravel()


def paths_figure(content: AboardContent) -> PageFigure:
    """The track of a run with the paths, and bands, that were shown at some instants."""
    banded, physics = "band_along" in content.points, bool(content.points["physics_north"].notna().any())
    drawn = [LOGGED_TRACK, PATH, *[PHYSICS] * physics, *[BAND] * banded]
    return PageFigure(
        id="seen",
        title="What was seen",
        takeaway=sentence_of(next((line for line in content.lines if line.kind == "band"), content.lines[0])),
        how=f"Paths of at most {MOMENTS} instants of a run, predicted from the rows up to then; the track went on as "
        "drawn." + (" Ellipses are the band at a few steps of each path." if banded else ""),
        alternative="The measured track, with the paths predicted along it and those of the physics alone.",
        height=520,
        draw=lambda run: [_draw_moments(content, run, drawn)],
        controls=[_control_of_runs(content)],
        chips=[Chip(name, name, str(LOOKS[name]["color"]), str(LOOKS[name]["dash"])) for name in drawn],
    )


def _draw_moments(content: AboardContent, run: str, drawn: Sequence[str]) -> Panel:
    track, points = (frame[frame["run"] == run] for frame in (content.track, content.points))
    traces = [make_line(LOGGED_TRACK, track["east"], track["north"], [LOGGED_TRACK], line=LOOKS[LOGGED_TRACK])]
    times = points["t"].unique()
    for t in times[even_places(len(times), MOMENTS)]:
        mine = points[points["t"] == t]
        places = {PATH: (mine["east"], mine["north"]), PHYSICS: (mine["physics_east"], mine["physics_north"])}
        places |= {BAND: band_outline(mine.iloc[even_places(len(mine), 4)[1:]])} if BAND in drawn else {}
        traces += [make_line(name, x, y, [name], line=LOOKS[name]) for name, (x, y) in places.items() if name in drawn]
    return make_chart(traces, "east [m]", "north [m]")


def along_run_figure(content: AboardContent) -> PageFigure:
    """Error at the end of each path, size of the band there, and the alarm, over the time of a run."""
    error, runs, banded = content.instants["error"], _control_of_runs(content), "band_along" in content.points
    takeaway = f"Over all runs, the median error at the end of a path is {metres_text(error.median())}; the largest, "
    takeaway += f"{metres_text(float(error.max()))}, is in {runs.options[runs.start]}."
    colour = category_colour(0)
    return PageFigure(
        id="along",
        title="Along the run",
        takeaway=takeaway if error.notna().any() else "The log ends before a path can be judged: 0 errors.",
        how="Error at the end of the path predicted at each instant"
        + (", with the half axes of the band there" if banded else "")
        + "; marks are instants outside of the training, where nothing is promised.",
        alternative="Error over time, with instants of alarm marked.",
        height=300,
        draw=lambda run: [_draw_along(content, run)],
        controls=[runs],
        chips=[
            Chip(PATH, "error", colour),
            *(Chip(name, name, colour, dash) for name, (_, dash) in HALF_AXES.items() if banded),
            Chip(ALARM, "alarm", INK, "none", symbol="triangle-up"),
        ],
    )


def _draw_along(content: AboardContent, run: str) -> Panel:
    mine, points = (frame[frame["run"] == run] for frame in (content.instants, content.points))
    t = mine["t"] - float(content.track.loc[content.track["run"] == run, "t"].min())
    traces = [make_line("error", t, mine["error"], [PATH], line={"color": category_colour(0), "width": 2})]
    last = points.groupby("t", sort=False).last()
    for name, (column, dash) in HALF_AXES.items() if "band_along" in last else ():
        traces.append(make_line(name, t, last[column], [name], line={"color": category_colour(0), "dash": dash}))
    raised = t[mine["outside"].astype(bool)]
    marker = {"color": INK, "size": 8, "symbol": "triangle-up"}
    traces.append(make_line(ALARM, raised, np.zeros(len(raised)), [ALARM], mode="markers", marker=marker))
    return make_plot(
        traces, make_axis("time in the run [s]"), make_axis("at the end of the path [m]", rangemode="tozero")
    )


ABOARD_PAGE = {
    "aboard": Section("As if at sea", {"seen": (paths_figure, "instants"), "along": (along_run_figure, "instants")})
}
write_aboard = partial(write_page, "aboard", ABOARD_PAGE)
