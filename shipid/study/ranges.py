"""Ranges of the numbers of a study document: slips of unit and of exponent are refused before anything is computed.

A study that is meant so names the number in `unusual`, a list of dotted paths at the top of its document.
"""

from __future__ import annotations

from shipid import document as documents
from shipid.document import Document
from shipid.errors import DocumentError
from shipid.simulation.truth import LONGEST

UNUSUAL_KEY = "unusual"
"""Key of the list of dotted paths (* matches any characters) whose numbers may lie outside their range."""

RANGES: dict[str, tuple[float, float, str]] = {
    "truth.duration": (0.0, LONGEST, "s"),
    "truth.run_up": (0.0, LONGEST, "s"),
    "truth.step": (1e-4, 60.0, "s"),
    "truth.interval": (1e-4, 3600.0, "s"),
    "truth.wind_speed.*": (0.0, 100.0, "m/s"),
    "truth.current_speed.*": (0.0, 20.0, "m/s"),
    "truth.waves.H_s": (0.0, 30.0, "m"),
    "truth.waves.T_p": (0.1, 60.0, "s"),
    "truth.manoeuvre.*_deg*": (-360.0, 360.0, "deg"),
    "truth.manoeuvre.*n_rpm*": (-1e5, 1e5, "rpm"),
    "truth.manoeuvre.*start_speed*": (-60.0, 60.0, "m/s"),
    "truth.manoeuvre.*_time": (0.0, LONGEST, "s"),
    "prediction.ahead": (0.0, 1e5, "s"),
    "prediction.step": (1e-3, 3600.0, "s"),
    "prediction.interval": (1e-3, 1e5, "s"),
    "prediction.past": (0.0, 1e5, "s"),
    "family.*.perturb.*.factor*": (-100.0, 100.0, "a factor"),
    "method.*.trials": (0, 1e5, "trials"),
    "method.*.epochs": (0, 1e6, "epochs"),
    "method.*.units": (0, 1e5, "units"),
}
"""Dotted path with * for any characters -> least, greatest, unit."""


def check_ranges(document: Document) -> None:
    """Raise DocumentError for a number of a study document outside `RANGES`, unless it is named in `unusual`."""
    meant = document.get(UNUSUAL_KEY, [])
    for path, value in documents.document_leaves(document):
        if not isinstance(value, int | float) or isinstance(value, bool):
            continue
        limits = next((row for pattern, row in RANGES.items() if documents.match_paths(pattern, [path])), None)
        named = documents.path_with_names(document, path)
        if limits is None or any(documents.match_paths(str(one), [path, named]) for one in meant):
            continue
        least, most, unit = limits
        if not least <= value <= most:
            message = f"{value:g}: expected {least:g} to {most:g} {unit}"
            remedy = f'if it is meant, write {UNUSUAL_KEY} = ["{named}"] at the top of the study'
            raise DocumentError(f"{message}; {remedy}", path=path)
