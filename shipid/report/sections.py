"""The sections of a study's page, in order. A new section is one file that defines a `Section`, and one line here."""

from __future__ import annotations

from pathlib import Path

from shipid.report import bands, cost, errors_over, factors, logs, methods, paths, physics_and_data, search, shares
from shipid.report.content import ReportContent
from shipid.report.page import HEAD, Section, write_page

SECTIONS: dict[str, Section] = {
    HEAD: paths.AT_A_GLANCE,
    "results": physics_and_data.WHAT_PHYSICS_AND_DATA_BUY,
    "cost": cost.WHAT_TO_BUY,
    "errors": errors_over.WHERE_ERRORS_GROW,
    "how-far-off": bands.HOW_FAR_OFF,
    "the-methods": methods.THE_METHODS,
    "predictions": paths.PREDICTIONS,
    "to-measure": shares.WHAT_TO_MEASURE,
    "the-models": factors.THE_MODELS,
    "data": logs.THE_DATA,
    "the-search": search.THE_SEARCH,
    "all-cells": factors.THE_CELLS,
}


def write_report(content: ReportContent, file: Path) -> Path:
    """Write the page of a study as one HTML file that makes no request; returns the file. Raises OSError."""
    windows = paths.window_data(content) if content.snapshots else None
    return write_page("study", SECTIONS, content, file, windows)
