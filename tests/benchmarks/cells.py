"""A tuned cell of the study `calm`: all foundations of a batch together, on one thread."""

from __future__ import annotations

import time
from typing import Any

from shipid.study.declared import NO_MODEL
from shipid.study.plan import read_plan
from shipid.study.prepare import obtain_runs, prepare
from shipid.study.run import run_unit
from tests.study.tiny import whole_unit


def run() -> dict[str, Any]:
    """Seconds per cell of each batch, and the mean H over the foundations with physics [m]."""
    plan = read_plan("calm", {"repeat": {}, "grid.seeds": [0]})
    start = time.perf_counter()
    prepared = prepare(plan, obtain_runs(plan))
    result: dict[str, Any] = {"simulate, roll out [s]": round(time.perf_counter() - start, 2)}
    for batch in plan.batches:
        start = time.perf_counter()
        rows = [cell.row for cell in run_unit(plan, prepared, whole_unit(plan, batch), "cpu")]
        seconds = (time.perf_counter() - start) / len(rows)
        errors = [row["H"] for row in rows if row["foundation"] != NO_MODEL]
        mean = sum(errors) / len(errors)
        result[f"N_D {batch.N_D}: s per cell"] = round(seconds, 2)
        result[f"N_D {batch.N_D}: mean H [m]"] = round(mean, 3)
    return result
