"""Asked: what the number of centres of `kernel` costs in H, in source and in the time of a prediction in C."""

from __future__ import annotations

import ctypes
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shipid.export.c_predictor import predictor_files
from shipid.export.model import build_model
from shipid.hybrid.features import Memory
from shipid.hybrid.kernel import Kernel
from shipid.metrics import position_error
from shipid.predictor import Predictor, limits_of
from shipid.study.cells import fit_method, work_of
from shipid.study.plan import read_plan
from shipid.study.prepare import obtain_runs, physics_of, prepare
from tests.export.compiled import library

FOUNDATION = "moderate-1"
MEMORY = Memory(
    history=(1.0, 2.0, 4.0, 8.0, 16.0), turned=(5.0, 10.0, 20.0), positions=(4.0, 8.0, 12.0, 20.0), error=(8.0,)
)
CALLS = 2_000


def run(seed: int = 7) -> dict[str, Any]:
    """H [m], core-seconds, source [MB] and time in C [ms] for 300, 600, 1,200 centres on a world of `quick`."""
    plan = read_plan("quick", {"truth.seed": seed, "split.seed": seed, "grid.N_D": [100]})
    prepared = prepare(plan, obtain_runs(plan))
    (unit,) = [one for one in plan.units if any(name == FOUNDATION for name, _ in one.pairs)]
    work = work_of(prepared, unit, plan.methods, "cpu")
    one, way, figures = work.known[FOUNDATION], work.ways[plan.methods[0].name], {}
    physics = physics_of(prepared.study, one.foundation.vessel)
    limits = limits_of(work.windows, prepared.commands)
    for centres in (300, 600, 1200):
        begun = time.process_time()
        method = Kernel(memory=MEMORY, centres=centres)
        fit = fit_method(work, replace(way, method=method, foundations=(FOUNDATION,)))[FOUNDATION]
        figures[f"{centres} centres: core-seconds"] = round(time.process_time() - begun, 2)
        predictor = Predictor(physics, "kernel", fit.corrector, limits)
        paths = predictor.predict(prepared.test.instants(), one.test_paths)
        figures[f"{centres} centres: H [m]"] = round(float(position_error(paths, prepared.test.future).mean()), 3)
        files = predictor_files(build_model(predictor), "ship")
        size = sum(len(text) for text in files.texts.values())
        figures[f"{centres} centres: source [MB]"] = round(size / 1e6, 2)
        figures[f"{centres} centres: C [ms]"] = round(_milliseconds(files, build_model(predictor).layout), 3)
    return figures


def _milliseconds(files: Any, layout: Any) -> float:
    """Time of a prediction by the compiled source."""
    with tempfile.TemporaryDirectory() as folder:
        code = library(files, Path(folder), "-O2")
        sizes = layout.sizes
        given = [np.full(max(1, size), 0.1) for size in (sizes["now"], sizes["reached"], sizes["past"])]
        given += [np.zeros(max(1, sizes[name])) for name in ("planned", "estimates")]
        path, work = np.empty(2 * layout.horizon), np.empty(1_000_000)
        pointers = [one.ctypes.data_as(ctypes.c_void_p) for one in (*given, path, work)]
        arguments = [*pointers[:5], None, pointers[5], None, pointers[6]]
        begun = time.process_time()
        for _ in range(CALLS):
            code.ship_path(*arguments)
        return (time.process_time() - begun) / CALLS * 1e3
