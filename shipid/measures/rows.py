"""Measures and criteria as rows of a table, in degrees and ship lengths as sailors read them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from shipid.measures.criteria import Criterion
from shipid.measures.record import Measures
from shipid.units import DEGREE

SHOWN = {"rad": ("deg", DEGREE), "rad/s": ("deg/s", DEGREE)}  # SI unit -> what is shown, and how much of SI it is


def measure_rows(measures: Measures, length: float | None) -> list[dict[str, Any]]:
    """Rows of `measure`, `value`, `unit`, `lengths` (of the ship [m]; NaN for what is no distance), `note`."""
    rows = []
    for name, found in measures.items():
        unit, size = SHOWN.get(found.unit, (found.unit, 1.0))
        lengths = found.value / length if length and found.unit == "m" else float("nan")
        label = name.replace("_", " ")
        rows.append(
            {"measure": label, "value": found.value / size, "unit": unit, "lengths": lengths, "note": found.why}
        )
    return rows


def criterion_rows(criteria: Sequence[Criterion]) -> list[dict[str, Any]]:
    """Rows of `criterion`, `value`, `limit`, `unit`, `verdict` ("met", "not met", "not judged"), `note`."""
    words = {True: "met", False: "not met", None: "not judged"}
    rows = []
    for one in criteria:
        unit, size = SHOWN.get(one.unit, (one.unit, 1.0))
        numbers = {"value": one.value / size, "limit": one.limit / size}
        rows.append({"criterion": one.name, **numbers, "unit": unit, "verdict": words[one.met], "note": one.note})
    return rows
