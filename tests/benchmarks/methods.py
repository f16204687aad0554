"""`path-drawn` against the yardstick `path-trained`: the same cells, each tuned alone, on worlds not chosen on."""

from __future__ import annotations

import json
import time
from functools import cache
from typing import Any

import numpy as np

from shipid.hybrid.path_drawn import PathDrawn
from shipid.study.plan import whole_unit
from shipid.study.run import run_unit
from tests.benchmarks.yardstick import KEPT, Cell, tune_cell, world

DRAWN = PathDrawn()
world = cache(world)


def run() -> dict[str, Any]:
    """Core-seconds and errors of each cell of the yardstick by the drawn path, and the ratios of the means."""
    pairs = [(kept, _drawn(Cell(kept["world"], kept["N_D"], kept["model"]))) for kept in json.loads(KEPT.read_text())]
    result: dict[str, Any] = {"cells": len(pairs)}
    for kept, drawn in pairs:
        name = f"world {kept['world']}, N_D {kept['N_D']}, {kept['model']}"
        result[f"{name}: core-seconds, trained / drawn"] = f"{kept['core_seconds']:.0f} / {drawn['core_seconds']:.1f}"
        result[f"{name}: H, trained / drawn [m]"] = f"{kept['H']:.2f} / {drawn['H']:.2f}"
    for key, label in (("core_seconds", "time"), ("H", "mean H"), ("H_90", "mean H_90")):
        counted = pairs if key == "core_seconds" else [pair for pair in pairs if not pair[0]["extrapolated"]]
        trained, drawn = (np.array([pair[side][key] for pair in counted]) for side in (0, 1))
        result |= {
            f"{label}, trained": round(float(trained.mean()), 3),
            f"{label}, drawn": round(float(drawn.mean()), 3),
        }
        result[f"{label}, drawn / trained"] = round(float(drawn.mean() / trained.mean()), 4)
        if key != "core_seconds":
            result[f"{label}: drawn is better in"] = f"{int((drawn < trained).sum())} of {len(counted)}"
    return result | _in_company(pairs[0][0]["world"])


def _drawn(cell: Cell) -> dict[str, Any]:
    return tune_cell(*world(cell.world), cell, DRAWN)


def _in_company(number: int) -> dict[str, Any]:
    """Core-seconds per cell where all foundations of an amount of data are tuned together, as a study does."""
    plan, prepared = world(number)
    result = {}
    for batch in plan.batches[:: len(plan.batches) - 1]:
        start = time.process_time()
        rows = run_unit(plan, prepared, whole_unit(plan, batch), "cpu")
        seconds = (time.process_time() - start) / len(rows)
        result[f"in a batch of {len(rows)}, N_D {batch.N_D}: core-seconds a cell"] = round(seconds, 2)
    return result
