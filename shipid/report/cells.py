"""Every cell of a study in a table."""

from __future__ import annotations

import pandas as pd

from shipid.report.content import ReportContent
from shipid.report.factors import with_failures
from shipid.report.section import Section
from shipid.report.tables import PageTable, TableColumn, frame_table
from shipid.report.wording import counted_text, duration_text

CELLS = {
    "model": TableColumn("model"),
    "A [m]": TableColumn("A", "length"),
    "N_D [1]": TableColumn("N_D", 0),
    "data [min]": TableColumn("minutes", 1),
    "seed": TableColumn("seed", 0),
    "H [m]": TableColumn("H", "length"),
    "H_90 [m]": TableColumn("H_90", "length"),
    "rms [m]": TableColumn("rms", "length"),
    "in band [1]": TableColumn("coverage", 2),
    "radius of band [m]": TableColumn("width", "length"),
    "status": TableColumn("status"),
    "time [s]": TableColumn("seconds", 0),
    "trials [1]": TableColumn("trials", 0),
    "stopped [1]": TableColumn("stopped", 0),
    "diverged [1]": TableColumn("diverged", 0),
    "chosen": TableColumn("hyperparameters"),
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


THE_CELLS = Section("The cells", draw=lambda content: (cells_table(content),), needs=("cells",), anchors=("cells",))
