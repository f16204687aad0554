"""Identification: `identify`, how it grows, and the whole command.

32 hull derivatives of the 28.9 m Gunnerus, runs of 80 s at 1 Hz with noise, every factor off by up to 20 % at first.
The command: 35 runs of 100 to 300 s at 10 Hz with noise in gusty wind, 20 factors on a first guess from particulars.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from shipid.data.dataset import Dataset, write_dataset
from shipid.identification.residuals import build_problem
from shipid.identification.settings import Identify
from shipid.identification.solve import identify
from shipid.vessel.load import Vessel, load_vessel
from tests.benchmarks.timing import best_of, clock
from tests.identification.trials import changed, trials
from tests.identification.voyages import SETTINGS, guess, voyages

RUNS, STEPS, MORE_RUNS, FEWER, VOYAGES = 20, 80, 80, 8, 35
NOISE = {"u": 0.05, "v": 0.05, "r": np.radians(0.1)}
ROUNDS = 5


def run() -> dict[str, Any]:
    """Times of `identify`, its growth, and the whole command."""
    vessel = load_vessel("gunnerus-28.9")
    data, settings = (
        _noisy(vessel, RUNS),
        Identify(parameters=["hull.derivatives.*"], weights=NOISE, horizon=0, start="base", current="none"),
    )
    fit = build_problem(vessel, data, data.runs, settings)
    begin = 1 + 0.2 * np.sin(np.arange(fit.num_factors))
    start = dict(zip(fit.unknown.paths, begin.tolist(), strict=True))
    first = clock(lambda: identify(vessel, data, data.runs, settings, start=start))
    seconds = best_of({"identify": lambda: identify(vessel, data, data.runs, settings, start=start)}, ROUNDS)
    mine = identify(vessel, data, data.runs, settings, start=start)
    result: dict[str, Any] = {
        "identify [s]": round(seconds["identify"], 4),
        "identify: iterations": mine.iterations,
        "identify, first call [s]": round(first, 2),
    }
    return result | _growth(vessel, settings) | command()


def command(runs: int = VOYAGES) -> dict[str, Any]:
    """The whole of `shipid identify`, from the start of its process to the files: time, processor time, memory."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_dataset(voyages(runs), folder / "log.parquet")
        (folder / "guess.toml").write_text(guess().text)
        block = "".join(f"{key} = {_toml(value)}\n" for key, value in SETTINGS.model_dump(exclude_unset=True).items())
        (folder / "settings.toml").write_text(f"[identify]\n{block}")
        code = "from shipid.cli import main; main()"
        line = [sys.executable, "-c", code, "identify", "guess.toml", "log.parquet", "--settings", "settings.toml"]
        begun, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        output = subprocess.run(line, cwd=folder, check=True, capture_output=True, text=True).stdout
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        processor = used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime
    return {
        f"the command, {runs} runs: what it says": output.splitlines()[0],
        f"the command, {runs} runs [s]": round(time.perf_counter() - begun, 1),
        f"the command, {runs} runs: processor [s]": round(processor, 1),
        f"the command, {runs} runs: memory [GB]": round(used.ru_maxrss / 1e6, 2),
    }


def _toml(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_toml(item)}" for key, item in value.items()) + "}"
    return json.dumps(value)


def _noisy(vessel: Vessel, runs: int, steps: int = STEPS) -> Dataset:
    data, rng = trials(vessel, runs, steps), np.random.default_rng(11)
    return changed(data, **{name: data.frame[name] + rng.normal(0, s, len(data.frame)) for name, s in NOISE.items()})


def _growth(vessel: Vessel, settings: Identify) -> dict[str, Any]:
    """Time per unit of four times the runs, and of four times the parameters, over time per unit."""
    fixed = ["hull.derivatives.X_*", "hull.derivatives.Y_*", "hull.*r|", "hull.*v|"]
    few = settings.model_copy(update={"fixed": fixed})
    cases = {
        "runs": {RUNS: (RUNS, settings), MORE_RUNS: (MORE_RUNS, settings)},
        "parameters": {FEWER: (RUNS, few), 4 * FEWER: (RUNS, settings)},
    }
    result: dict[str, Any] = {}
    for name, sizes in cases.items():
        ways = {}
        for size, (runs, wanted) in sizes.items():
            data = _noisy(vessel, runs)
            ways[str(size)] = lambda data=data, wanted=wanted: identify(vessel, data, data.runs, wanted)
        seconds = best_of(ways, ROUNDS)
        small, large = sizes
        result |= {f"{size} {name} [s]": round(seconds[str(size)], 4) for size in sizes}
        result[f"{name}: time per unit, {large} / {small}"] = round(
            seconds[str(large)] / seconds[str(small)] * small / large, 3
        )
    return result
