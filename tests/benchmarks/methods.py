"""`kernel` against the yardstick `path-trained`: the same cells, each tuned alone, on worlds not chosen on."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from shipid.hybrid.kernel import Kernel
from shipid.hybrid.method import Case, Method, Task
from shipid.metrics import position_error, summarise_errors
from shipid.study.plan import Batch, Plan, read_plan
from shipid.study.prepare import PreparedStudy, instants_of, obtain_runs, physics_of, prepare
from shipid.study.run import run_unit
from tests.study.tiny import physics_errors, whole_unit

KEPT = Path(__file__).with_name("yardstick.json")  # `path-trained` on cells of worlds that no method was chosen on


@dataclass(frozen=True)
class Cell:
    """A cell of the study `simulation` in another world (top-level `seed`)."""

    world: int
    N_D: int
    model: str


@cache
def world(number: int) -> tuple[Plan, PreparedStudy]:
    """The study `simulation` in a world: its plan and all that its cells need."""
    plan = read_plan("simulation", {"seed": number, "method": [{"name": "kernel", "kind": "kernel"}]})
    return plan, prepare(plan, obtain_runs(plan))


def tune_cell(plan: Plan, prepared: PreparedStudy, cell: Cell, method: Method) -> dict[str, Any]:
    """Tune one cell alone, on one thread: core-seconds, H and H_90 [m], and its trials."""
    batch = Batch(cell.N_D, plan.batches[0].seed)
    mask = np.isin(prepared.pool.run, prepared.runs(batch))
    windows = prepared.pool.select(mask)
    vessel = next(one.vessel for one in prepared.foundations if one.name == cell.model)
    physics = physics_of(plan.study, vessel)
    folds = prepared.folds(batch, windows, method.validation)
    case = Case(physics, prepared.known[cell.model].paths[:, mask])
    start = time.process_time()
    fit = method.fit(Task({cell.model: case}, windows, folds, prepared.commands, seed=batch.seed))[cell.model]
    seconds = time.process_time() - start
    instants = instants_of(plan.study, vessel, prepared.data, prepared.test)
    paths = fit.corrector.predict(physics, instants, prepared.known[cell.model].test_paths)
    error = summarise_errors(position_error(paths, prepared.test.future))
    alone = None if cell.model == "none" else physics_errors(prepared, cell.model)["mean"]
    row = {"world": cell.world, "N_D": cell.N_D, "model": cell.model, "A": alone, "H": error["mean"]}
    chosen = dict(fit.corrector.hyperparameters)
    return {**row, "H_90": error["p90"], "core_seconds": seconds, "chosen": chosen, "trials": fit.trials}


def run() -> dict[str, Any]:
    """Core-seconds and errors of each cell of the yardstick by the kernel, and the ratios of the means."""
    pairs = [
        (kept, _by_kernel(Cell(kept["world"], kept["N_D"], kept["model"]))) for kept in json.loads(KEPT.read_text())
    ]
    result: dict[str, Any] = {"cells": len(pairs)}
    for kept, made in pairs:
        name = f"world {kept['world']}, N_D {kept['N_D']}, {kept['model']}"
        result[f"{name}: core-seconds, trained / kernel"] = f"{kept['core_seconds']:.0f} / {made['core_seconds']:.1f}"
        result[f"{name}: H, trained / kernel [m]"] = f"{kept['H']:.2f} / {made['H']:.2f}"
    for key, label in (("core_seconds", "time"), ("H", "mean H"), ("H_90", "mean H_90")):
        counted = pairs if key == "core_seconds" else [pair for pair in pairs if not pair[0]["extrapolated"]]
        trained, made = (np.array([pair[side][key] for pair in counted]) for side in (0, 1))
        result |= {
            f"{label}, trained": round(float(trained.mean()), 3),
            f"{label}, kernel": round(float(made.mean()), 3),
        }
        result[f"{label}, kernel / trained"] = round(float(made.mean() / trained.mean()), 4)
        if key != "core_seconds":
            result[f"{label}: kernel is better in"] = f"{int((made < trained).sum())} of {len(counted)}"
    return result | _in_company(pairs[0][0]["world"])


def _by_kernel(cell: Cell) -> dict[str, Any]:
    return tune_cell(*world(cell.world), cell, Kernel())


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
