"""Every cell of a study in a table."""

from __future__ import annotations

import pandas as pd

from shipid.report.content import ReportContent
from shipid.report.factors import with_failures
from shipid.report.section import Section
from shipid.report.tables import Column, Table, frame_table
from shipid.report.wording import counted, duration

CELLS = {
    "model": Column("model"),
    "A [m]": Column("A", "length"),
    "N_D [1]": Column("N_D", 0),
    "data [min]": Column("minutes", 1),
    "seed": Column("seed", 0),
    "H [m]": Column("H", "length"),
    "H_90 [m]": Column("H_90", "length"),
    "rms [m]": Column("rms", "length"),
    "in band [1]": Column("coverage", 2),
    "radius of band [m]": Column("width", "length"),
    "status": Column("status"),
    "time [s]": Column("seconds", 0),
    "trials [1]": Column("trials", 0),
    "stopped [1]": Column("stopped", 0),
    "diverged [1]": Column("diverged", 0),
    "chosen": Column("hyperparameters"),
}


def cells_table(content: ReportContent) -> Table:
    """Every cell of the study, with how many trials it had; a failed one shows its status in place of numbers."""
    frame, trials = content.cells, content.trials
    bad = int((frame.status.ne("ok") | frame.H.isna()).sum())
    takeaway = f"{counted(len(frame), 'cell')} in {duration(float(frame.seconds.sum()))} of computing; "
    takeaway += f"{counted(bad, 'cell')} gave no result." if bad else "all gave a result."
    frame = frame.drop(columns="trials", errors="ignore")  # of a stored cell: the list of them
    if len(trials):
        states = pd.crosstab(trials.cell, trials.state).reindex(columns=["stopped", "diverged"], fill_value=0)
        states = states.assign(trials=trials.groupby("cell").size())
        frame = frame.merge(states, how="left", left_on="cell", right_index=True)
    return frame_table("cells", "Every cell", takeaway, with_failures(frame), CELLS)


THE_CELLS = Section("The cells", draw=lambda content: (cells_table(content),), needs=("cells",), anchors=("cells",))
