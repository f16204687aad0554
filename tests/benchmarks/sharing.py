"""What sharing a folder costs: one process plays many workers that claim, store and finish cells without any work.

All is done by the functions of a run. Figures are processor time, of the system included; waiting for a disk is not,
so the folder is in memory where it can be. Every twentieth worker dies with a claim, and as many join midway.
"""

from __future__ import annotations

import json
import os
import random
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from shipid.answer.pages import write_pages
from shipid.study import store
from shipid.study.claims import LATE, UnitClaims
from shipid.study.plan import Plan, Unit
from shipid.study.prepare import obtain, prepare
from shipid.study.run import _write_common, _write_data, run_unit
from tests.faults.folders import PLACE
from tests.study.tiny import tiny_plan

SIZES = {1000: 50, 10000: 500}
"""Cells -> workers."""
MODELS = 20
TRAINED = {"method": [{"name": "trained", "kind": "path-trained", "trials": 1, "epochs": 1, "units": [4, 8]}]}


def run() -> dict[str, Any]:
    """Milliseconds a cell, and how they grow from 1,000 cells with 50 workers to 10,000 with 500."""
    costs = {cells: played(cells, workers) for cells, workers in SIZES.items()}
    few, many = sorted(costs)
    result: dict[str, Any] = {}
    for name in costs[few]:
        result |= {f"{name}, {cells} cells [ms a cell]": round(costs[cells][name] / cells * 1e3, 3) for cells in costs}
        growth = costs[many][name] / costs[few][name] * few / many
        result[f"{name}: time a cell, {many} / {few}"] = round(growth, 3)
    return result


def played(cells: int, workers: int) -> dict[str, float]:
    """Seconds of each part for so many cells of 20 models and so many workers."""
    with tempfile.TemporaryDirectory(dir=PLACE) as place:
        changes = {"grid.N_D": [4], "grid.seeds": list(range(cells // MODELS)), "family.1.members": MODELS - 2}
        plan = tiny_plan(Path(place), {**changes, "method": TRAINED["method"]})
        assert len(plan.units) == plan.cells == cells
        folder = Path(place) / "run"
        store.open_folder(folder, plan)
        _write_data(plan, folder)
        prepared = prepare(plan, obtain(plan))
        _write_common(plan, folder, prepared)
        first = plan.units[0]
        (cell,) = run_unit(plan, prepared, first, "cpu")
        seconds = _played(plan, folder, workers, cell)
        seconds["results"] = -time.process_time()
        store.write_results(folder, plan, store.read_rows(folder, plan))
        seconds["results"] += time.process_time()
        seconds["report"] = -time.process_time()
        write_pages(folder)
        seconds["report"] += time.process_time()
        return seconds


def _played(plan: Plan, folder: Path, workers: int, cell: store.Cell) -> dict[str, float]:
    """Seconds that claims and files take until every cell is stored."""
    units, seconds = {unit.key: unit for unit in plan.units}, {"claims": 0.0, "files": 0.0}
    rng, left = random.Random(1), len(units)

    def taken(claims: UnitClaims) -> Iterator[str]:
        return claims.free(
            list(units),
            partial(store.finished_keys, folder, units),
            lambda key: store.is_finished(folder, units[key]),
        )

    with ExitStack() as stack:
        joined = [stack.enter_context(UnitClaims(folder)) for _ in range(workers)]
        at_work = [(claims, taken(claims)) for claims in joined]
        die, join = set(range(0, workers, 20)), workers // 20
        while left:
            place = rng.randrange(len(at_work))
            claims, free = at_work[place]
            begun = time.process_time()
            key = next(free, None)
            seconds["claims"] += time.process_time() - begun
            if key is None:
                at_work[place] = (claims, taken(claims))
                continue
            if place in die:
                die.remove(place)
                _dies(folder, key, claims)
                if join:
                    join -= 1
                    claims = stack.enter_context(UnitClaims(folder))
                    at_work[place] = (claims, taken(claims))
                continue
            begun = time.process_time()
            store.write_unit(folder, units[key], _as(units[key], cell))
            seconds["files"] += time.process_time() - begun
            begun = time.process_time()
            claims.give_back(key)
            seconds["claims"] += time.process_time() - begun
            left -= 1
    return seconds


def _dies(folder: Path, key: str, claims: UnitClaims) -> None:
    """The claim is that of another machine, and has not been renewed for a while."""
    file = folder / "claims" / key
    claims._mine.discard(key)
    file.unlink()
    file.write_text(json.dumps({"host": "elsewhere", "process": 1, "system": ""}))
    late = time.time() - LATE - 60
    os.utime(file, (late, late))


def _as(unit: Unit, cell: store.Cell) -> list[store.Cell]:
    """The result of one cell under the name of another."""
    row, predictor, paths = cell
    foundation, method = unit.pairs[0]
    name = unit.batch.cell(foundation, method)
    assert predictor is not None
    mine = {"cell": name, "foundation": foundation, "method": method, "N_D": unit.batch.N_D, "seed": unit.batch.seed}
    predictor = replace(predictor, provenance={**predictor.provenance, **mine})
    return [store.Cell({**row, **mine}, predictor, paths)]
