"""The checks of a log as one page: what failed and why, the tracks, and run by run what the checks compare."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import pandas as pd

from shipid.report import logs
from shipid.report.content import AnswerSentence, PageContent, rows_as_tuples
from shipid.report.figure import (
    MOST_LINE_POINTS,
    Chip,
    Control,
    PageFigure,
    Panel,
    category_colour,
    even_places,
    make_axis,
    make_line,
    make_plot,
    names_in,
)
from shipid.report.motion import DEGREES
from shipid.report.page import Section, write_page
from shipid.report.tables import PageTable, TableCell, digits_cell, frame_table, with_cells, word_cell
from shipid.report.wording import counted_text, join_few_names, metres_text, scientific_text, set_sentence

CHECK_COLUMNS = {
    "run": "run",
    "check": "check",
    "result": "ok",
    "value": "value",
    "limit": "limit",
    "what it says": "sentence",
}
SIGNALS_OF_CHECKS = {
    "rate [deg/s]": {"psi_rate": "rate of the heading", "r": "yaw rate r"},
    "distance [m]": {"drift": "position off integrated velocities"},
    "velocity [m/s]": {"u": "u", "v": "v"},
}
"""Title of an axis with its unit -> column of the series -> name."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CheckContent(PageContent):
    """Everything the page of a checked log shows.

    checks : check, run, value, unit, limit, ok, sentence. tracks : run, set, north, east [m].
    series : run, t [s], r and psi_rate [rad/s], drift [m], u, v [m/s]. repairs : kind, column, count, note.
    """

    checks: pd.DataFrame
    series: pd.DataFrame
    tracks: pd.DataFrame
    repairs: pd.DataFrame
    title: str = "Is this log in order?"

    @property
    def answer(self) -> list[AnswerSentence]:
        """How many checks passed, and which failed."""
        failed, runs = self.checks[~self.checks["ok"].astype(bool)], counted_text(self.checks["run"].nunique(), "run")
        every = counted_text(len(self.checks), "check")
        if failed.empty:
            return [AnswerSentence(f"All {every} of {runs} passed.")]
        return [
            AnswerSentence(f"{len(failed)} of {every} failed, in {failed['run'].nunique()} of {runs}."),
            AnswerSentence(f"What failed: {join_few_names(names_in(failed, 'check'), 8)}."),
        ]


def checks_table(content: CheckContent) -> PageTable:
    """The table of all checks, failed ones first; what these say is shown whole."""
    frame = content.checks.assign(ok=content.checks["ok"].astype(bool)).sort_values("ok", kind="stable")
    units = frame["unit"].mask(frame["unit"].eq("1"), "")
    values = zip(frame["value"], units, strict=True)
    cells = {
        "ok": [word_cell("passed" if ok else "failed", bad=not ok) for ok in frame["ok"]],
        "value": [TableCell(f"{scientific_text(one, 3)} {unit}".rstrip(), float(one)) for one, unit in values],
        "limit": [digits_cell(limit, 3) for limit in frame["limit"]],
        "sentence": [word_cell(set_sentence(row.sentence), bad=not row.ok) for row in rows_as_tuples(frame)],
    }
    return frame_table("all-checks", "Every check", "", with_cells(frame, **cells), CHECK_COLUMNS)


def checked_motion(content: CheckContent) -> PageFigure:
    """Rate of the heading and yaw rate, drift of the position, and velocities, over time, one run at a time."""
    series, runs = content.series, names_in(content.series)
    worst = series.groupby("run")["drift"].max()
    names = [name for columns in SIGNALS_OF_CHECKS.values() for name in columns.items()]
    return PageFigure(
        id="motion-figure",
        title="Heading, yaw rate, position and velocity",
        takeaway=f"Positions leave integrated velocities most in {worst.idxmax()}: {metres_text(worst.max())}.",
        how="Rate of the heading by central differences; distance between the position and integrated u, v, psi, which "
        "start together every 30 s.",
        alternative="Lines over time; the table below has the results of the checks.",
        height=240,
        draw=lambda run: _draw_checked(series[series["run"] == run]),
        controls=[Control("Run", runs, runs.index(str(worst.idxmax())))],
        chips=[Chip(column, name, category_colour(i)) for i, (column, name) in enumerate(names)],
    )


def _draw_checked(rows: pd.DataFrame) -> list[Panel]:
    shown = rows.iloc[even_places(len(rows), MOST_LINE_POINTS)]
    t = shown["t"] - rows["t"].iloc[0]  # single precision would not do for a clock since 1970
    shown = shown.assign(psi_rate=DEGREES * shown["psi_rate"], r=DEGREES * shown["r"])
    order, panels = [column for columns in SIGNALS_OF_CHECKS.values() for column in columns], []
    for title, columns in SIGNALS_OF_CHECKS.items():
        unit = title.partition("[")[2].rstrip("]")
        traces = [
            make_line(
                name,
                t,
                shown[column],
                [column],
                unit,
                line={"color": category_colour(order.index(column)), "width": 1.5},
            )
            for column, name in columns.items()
        ]
        panels.append(make_plot(traces, make_axis("time in the run [s]"), make_axis(title)))
    return panels


CHECK_PAGE = {
    "motion": Section("What the checks compare", {"motion-figure": (checked_motion, "series")}),
    "checks": Section("The checks", {"all-checks": (checks_table, "checks")}),
    "data": Section(
        "The data", {"manoeuvres": (logs.tracks_figure, "tracks"), "repairs": (logs.repairs_table, "repairs")}
    ),
}
write_checks = partial(write_page, "data check", CHECK_PAGE)
