"""What a study costs beside its cells, and what a second worker gains, against bare processes in the same run.

The cells of the first part are known work: the method solves next to nothing and then computes until each of its
cells has had a second of its thread's processor time. All else of a cell is as ever: windows, folds, predictors,
scores, files.
"""

from __future__ import annotations

import io
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, redirect_stdout
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import torch

from shipid.answer.start import event_line
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.method import FitResult, Task
from shipid.study import run as study
from shipid.study.plan import Plan, Unit, read_plan
from shipid.study.prepare import PreparedStudy, obtain_runs, prepare
from tests.benchmarks.timing import best_of, clock

CELL = 1.0  # s
WORKERS = (1, 2)
LIGHT = {"trials": 1, "steps": 1, "search_windows": 20, "centres": 20}
ONE = {"repeat": {}, "grid.seeds": [0]}  # world, and draw of the runs
KNOWN = {**ONE, "grid.N_D": [10, 20, 30, 40, 50, 60, 70, 80, 90, 100]}  # 60 cells
REAL = {**ONE, "grid.N_D": [30], "grid.seeds": list(range(10))}
PRODUCT, PRODUCTS = 1500, 40  # order of the matrices, and how many products each of two tasks is

run_unit, kernel_fit = study.run_unit, Kernel.fit


def run() -> dict[str, Any]:
    """Ratio of a whole study to the same work on bare processes, its parts, and the gain from a second worker."""
    return {**overhead(), **gain()}


def overhead() -> dict[str, Any]:
    """A study of 1-second cells by `run_study` with live progress, over its preparation and cells on bare processes."""
    plan = read_plan("calm", KNOWN)
    prepared = prepare(plan, obtain_runs(plan))  # compiled once, so that neither way compiles
    preparing = best_of({"prepare": lambda: prepare(plan, obtain_runs(plan))}, rounds=3)["prepare"]
    with _processes(2, plan, prepared) as pool:
        bare = clock(lambda: list(pool.map(_bare_unit, plan.units)))
    with patch.object(study, "run_unit", known_unit):
        whole, moments = _study(plan, 2)
    first, last = moments["cell"][0], moments["cell"][-1]
    waves = len(plan.batches) / 2 * len(plan.pairs) * CELL
    return {
        "cells": plan.cells,
        "study of 1 s cells [s]": round(whole, 2),
        "prepare alone [s]": round(preparing, 2),
        "cells on bare processes [s]": round(bare, 2),
        "until cells start [s]": round(moments["start"][0], 2),
        "until the first batch is done [s]": round(first, 2),
        "from the first batch to the last [s]": round(last - first, 2),
        "of it cells [s]": round(waves - len(plan.pairs) * CELL, 2),
        "after the last batch [s]": round(whole - last, 2),
        "study / bare processes": round(whole / (preparing + bare), 3),
    }


def known_unit(plan: Plan, prepared: PreparedStudy, unit: Unit, device: str, trials: Path | None = None) -> Any:
    """As `run_unit`, with cells that take a known time."""
    with patch.object(Kernel, "fit", _known_fit):
        return run_unit(plan, prepared, unit, device, trials)


def _known_fit(method: Kernel, task: Task) -> dict[str, FitResult]:
    begun = time.thread_time()
    tuned = kernel_fit(method.model_copy(update=LIGHT), task)
    a = np.ones((64, 64))
    while time.thread_time() - begun < CELL * len(task.cases):
        a @ a
    return tuned


def _study(plan: Plan, workers: int) -> tuple[float, dict[str, list[float]]]:
    """Wall time [s] of `run_study` with its lines, and the moments of its events."""
    moments: dict[str, list[float]] = {}

    def noted(events: Iterator[study.Event]) -> Iterator[study.Event]:
        for event in events:
            moments.setdefault(event.kind, []).append(time.perf_counter() - begun)
            yield event

    with tempfile.TemporaryDirectory() as folder, redirect_stdout(io.StringIO()):
        begun = time.perf_counter()
        for event in noted(study.run_study(plan, Path(folder) / "run", workers=workers)):
            sys.stdout.write(f"{event_line(event)}\n")
        return time.perf_counter() - begun, moments


def gain() -> dict[str, Any]:
    """Gain of a whole study, truly tuned, from a second worker, over that of a matrix product in two processes."""
    plan = read_plan("calm", REAL)
    prepare(plan, obtain_runs(plan))
    product = _product_gain()
    one, two = (_study(plan, count)[0] for count in WORKERS)
    product = max(product, _product_gain())
    return {
        "tuned study, 1 worker [s]": round(one, 1),
        "tuned study, 2 workers [s]": round(two, 1),
        "gain of the study": round(one / two, 3),
        "gain of a matrix product": round(product, 3),
        "gain of the study / of a product": round(one / two / product, 3),
    }


def _product_gain() -> float:
    """Time of two tasks of float32 products on one process over that on two."""
    with _processes(1) as one, _processes(2) as two:
        ways = {"one": lambda: list(one.map(_multiply, range(2))), "two": lambda: list(two.map(_multiply, range(2)))}
        seconds = best_of(ways, rounds=5)
    return seconds["one"] / seconds["two"]


def _multiply(_: int) -> None:
    a = torch.ones(PRODUCT, PRODUCT)
    for _ in range(PRODUCTS):
        a @ a


_shared: tuple[Any, ...] = ()  # of a bare process: the plan and what is prepared


@contextmanager
def _processes(count: int, *shared: Any) -> Iterator[ProcessPoolExecutor]:
    """Bare processes of one thread each that have imported and received all they need."""
    context = get_context("spawn")
    ready = context.Barrier(count + 1)
    with ProcessPoolExecutor(count, context, _receive, (ready, shared)) as pool:
        for _ in range(count):  # a process starts at each, since none is idle before all are ready
            pool.submit(os.getpid)
        ready.wait()
        yield pool


def _receive(ready: Any, shared: tuple[Any, ...]) -> None:
    global _shared
    _shared = shared
    study.use_threads(1)
    ready.wait()


def _bare_unit(unit: Unit) -> int:
    return len(known_unit(*_shared, unit, "cpu"))
