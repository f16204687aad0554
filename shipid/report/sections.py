"""The sections of a study's page, in order. A new section is one file that defines a `Section`, and one line here."""

from __future__ import annotations

from shipid.report import bands, cells, errors_over, factors, logs, methods, paths, physics_and_data, search
from shipid.report.section import Section

SECTIONS: dict[str, Section] = {
    "results": physics_and_data.WHAT_PHYSICS_AND_DATA_BUY,
    "errors": errors_over.WHERE_ERRORS_GROW,
    "how-far-off": bands.HOW_FAR_OFF,
    "the-methods": methods.THE_METHODS,
    "predictions": paths.PREDICTIONS,
    "the-models": factors.THE_MODELS,
    "data": logs.THE_DATA,
    "the-search": search.THE_SEARCH,
    "all-cells": cells.THE_CELLS,
}
