"""The page of a replay: recorded runs, and the motion of a vessel with the recorded orders."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import pandas as pd

from shipid.report.content import AnswerSentence, PageContent
from shipid.report.figure import INK, PageFigure, category_colour
from shipid.report.motion import DEGREES, LOG_SERIES, motion_figure
from shipid.report.page import write_page
from shipid.report.section import Section
from shipid.report.tables import PageTable, frame_table
from shipid.report.wording import number_text

REPLAYED = "replayed"
REPLAY_INKS = {LOG_SERIES: {"color": INK, "dash": "solid"}, REPLAYED: {"color": category_colour(0), "dash": "solid"}}
REPLAY_ERRORS = {
    "run": "run",
    "u [m/s]": "u",
    "v [m/s]": "v",
    "r [deg/s]": "r",
    "position [m]": "position",
}


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
        "Recorded and replayed",
        lambda content: (replayed_motion(content), replay_errors(content)),
        needs=("series",),
        anchors=("motion", "errors"),
    ),
}
write_replay = partial(write_page, "replay", REPLAY_PAGE)
