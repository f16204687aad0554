"""The smallest study there is: 12 short manoeuvres, 3 models, descents of two steps."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset
from shipid.metrics import ErrorSummary, position_error, summarise_errors
from shipid.report import page
from shipid.report.sections import SECTIONS
from shipid.study import run, store
from shipid.study.plan import Batch, Plan, Unit, build_plan, read_plan
from shipid.study.prepare import PreparedStudy

TINY = Path(__file__).parents[1] / "bad" / "studies" / "plain.toml"


def tiny_plan(folder: Path, changes: Mapping[str, Any] | None = None) -> Plan:
    """Plan of the tiny study, written into a folder as `tiny.toml`."""
    file = folder / "tiny.toml"
    file.write_text(TINY.read_text())
    return read_plan(file, changes)


def command(*words: object, folder: Path, site: Path | str = "") -> str:
    """What `shipid` prints to either stream in a folder, with the packages of another one; it ends well."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TINY.parents[3]), str(site)])}
    line = [sys.executable, "-m", "shipid", *map(str, words)]
    done = subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def whole_unit(plan: Plan, batch: Batch) -> Unit:
    """All cells of a batch as one unit."""
    return Unit(batch, tuple((name, way.name) for name, way in plan.pairs), batch.key)


def physics_errors(prepared: PreparedStudy, foundation: str) -> ErrorSummary:
    """Mean, 90th percentile and RMS error [m] of the physics alone on the test windows."""
    return summarise_errors(position_error(prepared.known[foundation].test_paths, prepared.test.future))


MIXED = [
    {"name": "kernel", "kind": "kernel", "trials": 2, "steps": 2, "terms": 4},
    {"name": "trained", "kind": "path-trained", "trials": 2, "epochs": 3, "units": [4, 5], "layers": [1, 2]},
    {
        "name": "stacked",
        "kind": "path-trained",
        "trials": 1,
        "epochs": 3,
        "units": 4,
        "layers": 1,
        "families": ["wrong"],
    },
    {"name": "step", "kind": "one-step", "trials": 1, "units": 8, "families": ["wrong"]},
    {"name": "alone", "kind": "alone"},
]
FITTED = {
    "name": "fitted",
    "extends": "right",
    "identify": {"parameters": ["hull.derivatives.N_ur"], "weights": {"u": 0.01, "v": 0.01, "r": 0.001}},
}


def mixed_plan(folder: Path, changes: Mapping[str, Any] | None = None) -> Plan:
    """A tiny study whose work is cut into several units: six methods, one family identified."""
    document = tiny_plan(folder).document
    document |= {"method": MIXED, "grid": {"N_D": [4]}, "family": [*document["family"], FITTED], **(changes or {})}
    return build_plan(document, folder / "tiny.toml")


def make_run(folder: Path, plan: Plan) -> None:
    """Make the folder of a run, or open it again."""
    with store.open_folder(folder, plan):
        pass


def run_here(plan: Plan, folder: Path) -> list[run.Event]:
    """Run a study in this process, without a cluster."""
    return list(events_here(plan, folder))


def events_here(plan: Plan, folder: Path) -> Iterator[run.Event]:
    """The same, event by event."""
    with without_workers():
        yield from run.run_study(plan, folder)


@contextmanager
def without_figures() -> Iterator[None]:
    """Pages of studies are texts alone, where figures are not the point: these take most of the time of a page."""
    draw = page.draw_sections
    with patch.object(page, "draw_sections", lambda parts, content: [] if parts is SECTIONS else draw(parts, content)):
        yield


@contextmanager
def without_workers() -> Iterator[None]:
    """Whatever runs a study computes it in this process."""

    def in_turn(work: Callable[[Unit], Any], units: Iterable[Unit], _: int) -> Iterator[Any]:
        return ((unit, work(unit)) for unit in units)

    with patch.object(run, "on_workers", in_turn):
        yield


def logged(runs: Mapping[str, Mapping[str, Any]], t: np.ndarray, **metadata: Any) -> Dataset:
    """Dataset of runs with constant or given columns: name -> column -> value or array; commands default to rest."""
    still = dict.fromkeys(("north", "east", "psi", "u", "v", "r"), 0.0)
    orders = {f"{side}.{signal}": 0.0 for side in ("port", "starboard") for signal in ("n", "alpha")}
    frames = [
        pd.DataFrame({"run": pd.Series([name] * len(t), dtype="str"), "t": t, **still, **orders, **columns, "flags": 0})
        for name, columns in runs.items()
    ]
    frame = pd.concat(frames, ignore_index=True)
    numbers = [name for name in frame.columns if name not in ("run", "flags")]
    return Dataset(frame.astype(dict.fromkeys(numbers, "float64")), {"clock": "run", "flags": [], **metadata})
