"""What one core of this machine can do, and how far a trial of the method `path-drawn` is from it."""

from __future__ import annotations

import cProfile
import pstats
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shipid.hybrid.path_drawn import PathDrawn
from tests.benchmarks.timing import best_of
from tests.hybrid.tasks import tune

ORDER = 2048  # of the big matrices
MODELS, RUNS, WINDOWS, HORIZON = 20, 50, 50, 30  # a batch of experiment 1 at N_D = 50
REPEAT = 200  # of small work, so that a clock can tell
TRIALS = 4
METHOD = PathDrawn(trials=TRIALS, mirror=1.0, ridge=1.0, search_windows=RUNS * WINDOWS)
ROUNDS = 7


def run() -> dict[str, Any]:
    """Rates of one core [G/s], the time of a trial, the least time its parts allow, and where it goes."""
    figures = rates()
    seconds = best_of({"tune": _tuning()}, ROUNDS)["tune"] / TRIALS
    least = bounds(figures)
    result: dict[str, Any] = {name: round(value, 2) for name, value in figures.items()}
    result["trial, 20 models, 50 runs [ms]"] = round(1e3 * seconds, 1)
    result |= {f"least time: {name} [ms]": round(1e3 * value, 1) for name, value in least.items()}
    result["trial / least time"] = round(seconds / sum(least.values()), 2)
    return result | shares()


def rates() -> dict[str, float]:
    """Best rates of one thread: products, copies (read and written), functions of float32 and float64."""
    double = np.random.default_rng(0).random((ORDER, ORDER))
    single = double.astype(np.float32)
    source = np.ones(1 << 27, dtype=np.float32)  # 512 MiB, more than caches hold
    target = np.empty_like(source)
    short = double.ravel()[: 1 << 14]
    out = np.empty_like(short)
    seconds = best_of(
        {
            "float32": lambda: single @ single,
            "float64": lambda: double @ double,
            "copy": lambda: np.copyto(target, source),
            "tanh": _often(lambda: np.tanh(short, out=out)),
            "exp": _often(lambda: np.exp(short, out=out)),
        },
        ROUNDS,
    )
    return {
        "product of order 2048, float32 [Gflop/s]": 2e-9 * ORDER**3 / seconds["float32"],
        "product of order 2048, float64 [Gflop/s]": 2e-9 * ORDER**3 / seconds["float64"],
        "copy of 512 MiB [GB/s]": 2e-9 * 4 * len(source) / seconds["copy"],
        "tanh, float64 [G/s]": 1e-9 * REPEAT * len(short) / seconds["tanh"],
        "exp, float64 [G/s]": 1e-9 * REPEAT * len(short) / seconds["exp"],
    }


def _often(run: Callable[[], object]) -> Callable[[], None]:
    def repeated() -> None:
        for _ in range(REPEAT):
            run()

    return repeated


def bounds(figures: dict[str, float]) -> dict[str, float]:
    """Least time [s] of a trial's parts: their flops at the peak of a product, tanh at its rate."""
    samples, units, columns = RUNS * WINDOWS, METHOD.units, MODELS * METHOD.terms
    decomposed = 2 * (2 * samples * units**2 + 9 * units**3)  # Gram matrix, and its axes (Golub & Van Loan)
    rotated = 2 * (2 * samples * units**2 + 2 * samples * units * columns)
    block = 2 * WINDOWS**2 * units + 2 * WINDOWS**3 / 3 + 2 * WINDOWS**2 * columns  # hat matrix, its factors, solution
    left_out = 2 * (2 * samples * units * columns + RUNS * block)
    flops = {"decomposition": decomposed, "projection": rotated, "runs left out": left_out}
    peak = 1e9 * figures["product of order 2048, float64 [Gflop/s]"]
    tanh = {"tanh": 2 * samples * units / (1e9 * figures["tanh, float64 [G/s]"])}
    return {**{name: value / peak for name, value in flops.items()}, **tanh}


def shares() -> dict[str, Any]:
    """Share of each function in the time of trials, without the time of what it calls, the six greatest."""
    profiler = cProfile.Profile()
    profiler.runcall(_tuning())
    spent = Counter[str]()
    for (file, _, name), row in pstats.Stats(profiler).stats.items():  # type: ignore[attr-defined]
        spent[name if file == "~" else f"{Path(file).stem}.{name}"] += row[2]
    return {f"share of {name}": round(seconds / spent.total(), 3) for name, seconds in spent.most_common(6)}


def _tuning() -> Callable[[], object]:
    rng = np.random.default_rng(0)
    names = ("u", "v", "r", "port.n", "port.alpha", "psi", "V_w", "beta_w")
    columns = {name: rng.normal(size=RUNS * WINDOWS) for name in names}
    targets = {f"model-{k}": rng.normal(size=(HORIZON, RUNS * WINDOWS, 2)) for k in range(MODELS)}
    run = np.repeat(np.arange(RUNS), WINDOWS)
    folds = [(np.flatnonzero(run != one), np.flatnonzero(run == one)) for one in range(RUNS)]
    return lambda: tune(columns, ("port.n", "port.alpha"), targets, folds, METHOD, 0)
