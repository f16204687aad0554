"""The sections of a study's page, in order. A new section is one file that defines a `Section`, and one line here."""

from __future__ import annotations

from shipid.report import bands, cells, error_map, errors_over, factors, logs, memory, methods, paths, search
from shipid.report.section import Section

SECTIONS: dict[str, Section] = {
    "results": error_map.SECTION,
    "errors": errors_over.SECTION,
    "how-far-off": bands.SECTION,
    "the-methods": methods.SECTION,
    "the-past": memory.SECTION,
    "predictions": paths.SECTION,
    "the-models": factors.SECTION,
    "data": logs.SECTION,
    "the-search": search.SECTION,
    "all-cells": cells.SECTION,
}
