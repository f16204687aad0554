"""The method `path-trained` on cells of experiment 1: slow, so run once, piece by piece, and kept beside this file.

`python -m tests.benchmarks.yardstick` goes on where it was stopped: every trained network is kept in
`results/yardstick` until its cell is done, and finished cells are added to `yardstick.json`. `--close` adds cells that
were begun, with the trials they have; their core-seconds are then extrapolated, and marked so.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import subprocess
import sys
import time
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from shipid.hybrid import gradient
from shipid.hybrid.device import use_threads
from shipid.hybrid.method import Case, Method, Task
from shipid.hybrid.path_trained import PathTrained
from shipid.metrics import position_error, summarise_errors
from shipid.study.plan import Batch, Plan, read_plan
from shipid.study.prepare import PreparedStudy, instants_of, obtain_runs, physics_of, prepare
from shipid.study.sessions import machine

KEPT = Path(__file__).with_suffix(".json")
PIECES = Path("results/yardstick")


@dataclass(frozen=True)
class Cell:
    """A cell of the study `simulation` in another world (top-level `seed`)."""

    world: int
    N_D: int
    model: str

    @property
    def name(self) -> str:
        """File-safe name."""
        return f"world-{self.world}-N{self.N_D:03d}-{self.model}"


CELLS = (  # spanning N_D and A; worlds that no method was chosen on
    *(Cell(number, 10, model) for model in ("moderate-1", "high-1", "none", "nominal") for number in range(5, 10)),
    Cell(8, 30, "moderate-2"),
    Cell(9, 30, "high-2"),
    Cell(7, 30, "nominal"),
    Cell(5, 100, "moderate-3"),
    Cell(6, 100, "high-3"),
)


def world(number: int) -> tuple[Plan, PreparedStudy]:
    """The study `simulation` in a world: its plan and all that its cells need."""
    plan = read_plan("simulation", {"seed": number, "method": [{"name": "drawn", "kind": "path-drawn"}]})
    return plan, prepare(plan, obtain_runs(plan))


def tune_cell(plan: Plan, prepared: PreparedStudy, cell: Cell, method: Method) -> dict[str, Any]:
    """Tune one cell alone, on one thread: core-seconds, H and H_90 [m], and its trials."""
    batch = Batch(cell.N_D, plan.batches[0].seed)
    mask = np.isin(prepared.pool.run, prepared.runs(batch))
    windows = prepared.pool.select(mask)
    vessel = next(one.vessel for one in prepared.foundations if one.name == cell.model)
    physics = physics_of(plan.study, vessel)
    folds = prepared.folds(batch, windows, method.validation)
    case = Case(physics, prepared.pool_paths[cell.model][:, mask])
    start = time.process_time()
    fit = method.fit(Task({cell.model: case}, windows, folds, prepared.commands, seed=batch.seed))[cell.model]
    seconds = time.process_time() - start
    assert fit.corrector is not None
    instants = instants_of(plan.study, vessel, prepared.data, prepared.test)
    paths = fit.corrector.predict(physics, instants, prepared.test_paths[cell.model])
    error = summarise_errors(position_error(paths, prepared.test.future))
    alone = None if cell.model == "none" else prepared.accuracy(cell.model)["mean"]
    row = {"world": cell.world, "N_D": cell.N_D, "model": cell.model, "A": alone, "H": error["mean"]}
    chosen = dict(fit.corrector.hyperparameters)
    return {**row, "H_90": error["p90"], "core_seconds": seconds, "chosen": chosen, "trials": fit.trials}


def main() -> None:
    """Run the cells that are not kept yet; `--close` keeps those begun with the trials that they have."""
    use_threads(1)
    closing, whole = "--close" in sys.argv[1:], PathTrained()
    done = json.loads(KEPT.read_text()) if KEPT.exists() else []
    finished = {(row["world"], row["N_D"], row["model"]) for row in done}
    for cell in CELLS:
        trials = len(list((PIECES / cell.name).glob("*.pickle"))) if closing else whole.trials
        if (cell.world, cell.N_D, cell.model) in finished or trials == 0:
            continue
        plan, prepared = world(cell.world)
        spent = _remember(PIECES / cell.name)
        row = tune_cell(plan, prepared, cell, PathTrained(trials=trials))
        row |= {"core_seconds": sum(spent) * whole.trials / trials, "extrapolated": trials < whole.trials}
        row |= {
            "machine": {k: v for k, v in machine().items() if k != "system"},
            "date": date.today().isoformat(),
            "commit": _commit(),
        }
        done.append(row)
        KEPT.write_text(json.dumps(done, indent=1) + "\n")
        print(f"{cell.name}: {row['core_seconds']:.0f} core-seconds, {len(row['trials'])} trials", flush=True)


def _remember(folder: Path) -> list[float]:
    """Keep every network that a fit trains, so that it is trained once; returns the core-seconds as they add up."""
    folder.mkdir(parents=True, exist_ok=True)
    train = getattr(gradient._fit, "__wrapped__", gradient._fit)
    spent: list[float] = []

    def kept(data: Any, targets: Any, stack: Any, method: PathTrained, entropy: tuple[int, ...], device: str) -> Any:
        words = json.dumps([entropy, {key: dict(values) for key, values in stack.items()}], sort_keys=True)
        file = folder / f"{entropy[1]:02d}-{hashlib.sha256(words.encode()).hexdigest()[:12]}.pickle"
        if not file.exists():
            start = time.process_time()
            result = train(data, targets, stack, method, entropy, device)
            whole = file.with_suffix(".part")
            whole.write_bytes(pickle.dumps((time.process_time() - start, result)))
            whole.replace(file)
        seconds, result = pickle.loads(file.read_bytes())
        spent.append(seconds)
        return result

    kept.__wrapped__ = train  # type: ignore[attr-defined]
    gradient._fit = kept
    return spent


def _commit() -> str:
    return subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=True).stdout.strip()


if __name__ == "__main__":
    main()
