"""Every cell of a study in a table."""

from __future__ import annotations

from shipid.report import tables
from shipid.report.section import Section

SECTION = Section(
    "The cells",
    draw=lambda content: (tables.cells(content),),
    needs=("cells",),
    anchors=("cells",),
)
