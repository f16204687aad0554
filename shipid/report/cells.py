"""Every cell of a study in a table."""

from __future__ import annotations

import pandas as pd

from shipid.report.content import ReportContent
from shipid.report.factors import with_failures
from shipid.report.page import Section
from shipid.report.tables import PageTable, frame_table
from shipid.report.wording import counted_text, duration_text

CELLS = {
    "model": "model",
    "A [m]": "A",
    "N_D [1]": "N_D",
    "data [min]": "minutes",
    "seed": "seed",
    "H [m]": "H",
    "H_90 [m]": "H_90",
    "rms [m]": "rms",
    "in band [1]": "coverage",
    "radius of band [m]": "width",
    "status": "status",
    "time [s]": "seconds",
    "trials [1]": "trials",
    "stopped [1]": "stopped",
    "diverged [1]": "diverged",
    "chosen": "hyperparameters",
}


def cells_table(content: ReportContent) -> PageTable:
    """Every cell of the study, with how many trials it had; a failed one shows its status in place of numbers."""
    frame, trials = content.cells, content.trials
    bad = int((frame.status.ne("ok") | frame.H.isna()).sum())
    takeaway = f"{counted_text(len(frame), 'cell')} in {duration_text(float(frame.seconds.sum()))} of computing; "
    takeaway += f"{counted_text(bad, 'cell')} gave no result." if bad else "all gave a result."
    frame = frame.drop(columns="trials", errors="ignore")  # of a stored cell: the list of them
    if len(trials):
        states = pd.crosstab(trials.cell, trials.state).reindex(columns=["stopped", "diverged"], fill_value=0)
        states = states.assign(trials=trials.groupby("cell").size())
        frame = frame.merge(states, how="left", left_on="cell", right_index=True)
    return frame_table("cells", "Every cell", takeaway, with_failures(frame), CELLS)


THE_CELLS = Section("The cells", {"cells": (cells_table, "cells")})
