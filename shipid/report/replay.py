"""The page of a replay: recorded runs, and the motion of a vessel with the recorded orders."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from shipid.report.content import PageContent, Sentence
from shipid.report.figure import Chip, Control, Figure
from shipid.report.motion import LOG, MOTIONS, panels
from shipid.report.page import page, write
from shipid.report.palette import INK, category
from shipid.report.section import Section
from shipid.report.tables import Table, decimals, figure, text
from shipid.report.wording import number

REPLAYED = "replayed"
LINES = {LOG: {"color": INK, "dash": "solid"}, REPLAYED: {"color": category(0), "dash": "solid"}}


@dataclass(frozen=True, eq=False, kw_only=True)
class ReplayContent(PageContent):
    """Everything the page shows.

    Parameters
    ----------
    title, name : in words, and the vessel.
    series : `run`, `piece`, `t` [s], `model` (`measured`, `replayed`), `north`, `east` [m], `u`, `v` [m/s], `r`
        [rad/s].
    errors : `run` (`all` at first), root mean squares `u`, `v` [m/s], `r` [rad/s], `position` [m].
    ahead : length of each simulation [s]; 0 for whole runs.
    """

    series: pd.DataFrame
    errors: pd.DataFrame
    ahead: float

    @property
    def answer(self) -> list[Sentence]:
        """The error over all runs."""
        row = self.errors[self.errors["run"] == "all"].iloc[0]
        text = f"Position is {number(float(row['position']))} m off, RMS over all rows, {_length(self.ahead)}."
        return [Sentence(text, "errors")]


def write_replay(content: ReplayContent, file: Path) -> Path:
    """Write the page as one HTML file that makes no request; returns the file. Raises ResultError if it cannot."""
    return write(page(content, SECTIONS, "replay"), file)


def _length(ahead: float) -> str:
    return f"in simulations of {ahead:g} s" if ahead else "in simulations as long as the runs"


def motion(content: ReplayContent) -> Figure:
    """Measured and replayed motion, one run at a time."""
    runs = [str(run) for run in pd.unique(content.series["run"])]
    views = {
        str(i): panels(content.series[content.series["run"] == run], LINES, (LOG, REPLAYED))
        for i, run in enumerate(runs)
    }
    return Figure(
        id="motion",
        title="Recorded and replayed",
        takeaway=content.answer[0].text,
        how="The vessel begins at the measured state and goes by the recorded orders and wind alone."
        + (" New simulations begin where lines are broken." if content.ahead else ""),
        alternative="Speeds, yaw rate and tracks, measured and replayed; the table below has the errors.",
        height=290,
        views=views,
        controls=[Control("Run", runs)],
        chips=[Chip(name, name, str(ink["color"]), str(ink["dash"])) for name, ink in LINES.items()],
    )


def errors(content: ReplayContent) -> Table:
    """Root mean square errors, run by run."""
    factors = {name: factor for name, (_, _, factor) in MOTIONS.items()} | {"position": 1.0}
    places = decimals(content.errors["position"])
    rows = [
        [
            text(row["run"]),
            *(figure(factor * row[name], places if name == "position" else 3) for name, factor in factors.items()),
        ]
        for row in content.errors.to_dict("records")
    ]
    heads = ["run", "u [m/s]", "v [m/s]", "r [deg/s]", "position [m]"]
    title = f"Root mean square errors {_length(content.ahead)}"
    return Table("errors", title, "", heads, [False, True, True, True, True], rows)


SECTIONS: dict[str, Section] = {
    "replay": Section(
        "Recorded and replayed",
        lambda content: (motion(content), errors(content)),
        needs=("series",),
        anchors=("motion", "errors"),
    ),
}
"""Sections of the page in order."""
