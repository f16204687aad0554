"""Measures and criteria as rows of a table, in degrees and ship lengths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from shipid.measures.criteria import Criterion
from shipid.measures.record import Measures
from shipid.units import DEGREE

SHOWN_UNITS = {
    "rad": ("deg", DEGREE),
    "rad/s": ("deg/s", DEGREE),
}  # SI unit -> unit in tables, and its size in SI units


def measure_rows(measures: Measures, length: float | None) -> list[dict[str, Any]]:
    """Rows of `measure`, `value`, `unit`, `lengths`, `note`.

    lengths : value in ship lengths; NaN if it is no distance or the ship length `length` [m] is None.
    """
    rows = []
    for name, measure in measures.items():
        unit, size = SHOWN_UNITS.get(measure.unit, (measure.unit, 1.0))
        lengths = measure.value / length if length and measure.unit == "m" else float("nan")
        label = name.replace("_", " ")
        rows.append(
            {"measure": label, "value": measure.value / size, "unit": unit, "lengths": lengths, "note": measure.why}
        )
    return rows


def criterion_rows(criteria: Sequence[Criterion]) -> list[dict[str, Any]]:
    """Rows of `criterion`, `value`, `limit`, `unit`, `verdict` ("met", "not met", "not judged"), `note`."""
    words = {True: "met", False: "not met", None: "not judged"}
    rows = []
    for one in criteria:
        unit, size = SHOWN_UNITS.get(one.unit, (one.unit, 1.0))
        numbers = {"value": one.value / size, "limit": one.limit / size}
        rows.append({"criterion": one.name, **numbers, "unit": unit, "verdict": words[one.met], "note": one.note})
    return rows
