"""Twelve made-up ships with their logs, from particulars to a report by the commands of the README, without an edit.

`python -m tests.benchmarks strangers`. For each: mean error of physics alone and compensated over that of constant
u, v, r, with known commands, at the proposed horizon and at twice that; and the same of the vessel that made the log.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
import tomllib
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

from shipid.cli import app
from shipid.data.dataset import write_dataset
from shipid.hybrid.physics import Physics
from shipid.metrics import position_error
from shipid.study.contents import write_pages
from shipid.study.plan import read_plan
from shipid.study.prepare import constant_motion, path_of, prepare, window_memory
from shipid.study.results import judged_cells, read_results
from tests.strangers import Stranger, stranger
from tests.study.tiny import run_here

FIRST, SHIPS = 100, 12
GOAL, NEAR = 0.25, 1.3  # of constant u, v, r; of the true vessel, where that is above the goal
FEWER = 3  # times as long between instants of prediction as in the study: the answer is the same, sooner
SHORT = {"grid.seeds": [0], "prediction.commands": "known"}


def run(ships: int = SHIPS, first: int = FIRST) -> dict[str, Any]:
    """Figures of all ships, failures included."""
    figures: dict[str, Any] = {}
    passed = [0, 0]
    for seed in range(first, first + ships):
        try:
            outcome = one(seed)
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            figures[f"{seed} failed"] = f"{type(error).__name__}: {error}"[:110]
            print(f"{seed}: {type(error).__name__}: {error}", file=sys.stderr)
            continue
        for place, far in enumerate(("1x", "2x")):
            numbers = outcome[far]
            passed[place] += numbers["passed"]
            figures[f"{seed} {far}"] = (
                f"{outcome['words']}; {numbers['ahead']:g} s; alone {numbers['alone']:.2f}, corrected "
                f"{numbers['corrected']:.2f}, compensated {numbers['compensated']:.2f}, true vessel "
                f"{numbers['true']:.2f} of {numbers['constant']:.3g} m{'' if numbers['passed'] else ' MISSED'}"
            )
        figures[f"{seed} warning"] = outcome["warning"][:400]
        print(figures[f"{seed} 1x"], figures[f"{seed} 2x"], outcome["warning"], sep="\n", file=sys.stderr, flush=True)
    figures["within the goal at the proposed horizon, at twice that"] = f"{passed[0]}, {passed[1]} of {ships}"
    return figures


def one(seed: int, runs: int = 18) -> dict[str, Any]:
    """Figures of one ship: particulars -> vessel, log -> study -> report."""
    ship, begun = stranger(seed, runs), time.perf_counter()
    with tempfile.TemporaryDirectory() as name, chdir(name):
        write_dataset(ship.dataset, Path("log.parquet"))
        output = command("vessel", "new", *ship.options, "--out", "ship.toml")
        output = command("study", "new", "--vessel", "./ship.toml", "--data", "log.parquet", "--out", "study.toml")
        document = tomllib.loads(Path("study.toml").read_text())
        ahead, most = document["prediction"]["ahead"], document["grid"]["N_D"][-1]
        result: dict[str, Any] = {"words": ship.words, "warning": _warning(output)}
        for times, far in ((1, "1x"), (2, "2x")):
            changes = SHORT | {"prediction.ahead": times * ahead, "grid.N_D": [most]}
            changes |= {"prediction.interval": FEWER * document["prediction"]["interval"]}
            plan = read_plan("study.toml", changes)
            folder = Path(f"run-{far}")
            run_here(plan, folder)
            if times == 1:
                write_pages(folder)
            result[far] = figures_of(ship, plan, folder)
        return result | {"seconds": time.perf_counter() - begun}


def command(*words: str) -> str:
    """Output of a command; RuntimeError with its message where it fails."""
    result = CliRunner().invoke(app, list(words))
    if result.exit_code:
        raise RuntimeError(f"{' '.join(words[:2])}: {result.exception or result.output}")
    return result.output


def figures_of(ship: Stranger, plan: Any, folder: Path) -> dict[str, Any]:
    """Errors over that of constant u, v, r, on the test runs."""
    cells = judged_cells(read_results(folder))
    prepared = prepare(plan, ship.dataset)
    test = prepared.test
    constant = float(position_error(constant_motion(test), test.future).mean())
    hidden = window_memory(ship.truth, ship.dataset, test)
    physics = Physics(ship.truth, test.horizon, test.step, "rk4", None, path_of(plan))
    true = float(position_error(physics.paths(test.instants(known=True, hidden=hidden)), test.future).mean())
    with_physics = cells[cells["family"] != "none"]
    first, corrected = with_physics.iloc[0], with_physics[with_physics["family"].str.endswith("-corrected")]
    losses = [
        min((t["value"] for t in trials if t["value"] is not None), default=np.inf) for trials in with_physics["trials"]
    ]
    best = with_physics.iloc[int(np.argmin(losses))]  # by validation
    numbers = {
        "ahead": test.horizon * test.step, "constant": constant, "alone": first["A"] / constant,
        "corrected": (corrected.iloc[0] if len(corrected) else first)["A"] / constant,
        "compensated": best["H"] / constant, "true": true / constant,
    }  # fmt: skip
    bound = GOAL if numbers["true"] <= GOAL else NEAR * numbers["true"]
    return numbers | {"passed": bool(numbers["compensated"] <= bound)}


def _warning(message: str) -> str:
    return " ".join(
        line for line in message.splitlines() if "would explain" in line or "agree" in line or "constant u" in line
    )


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    for chosen in map(int, sys.argv[1:]):
        run(1, chosen)
