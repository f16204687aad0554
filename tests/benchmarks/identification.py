"""Identification: by hand and by `identify`, from good and from bad starts, how it grows, and the whole command.

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
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from shipid.data.dataset import Dataset, write_dataset
from shipid.identification.residuals import Problem, build_problem
from shipid.identification.settings import Identify
from shipid.identification.solve import identify
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.benchmarks.by_hand import DERIVATIVES, Model
from tests.benchmarks.timing import best_of, clock
from tests.identification.trials import changed, trials
from tests.identification.voyages import SETTINGS, guess, voyages

RUNS, STEPS, MORE_RUNS, FEWER, VOYAGES = 20, 80, 80, 8, 35
NOISE = {"u": 0.05, "v": 0.05, "r": np.radians(0.1)}
SPREADS, STARTS = (1.0, 3.0), 8  # factors off by up to so much, so many draws
ROUNDS = 5
PATIENCE = 240.0  # s after which the way by hand is stopped: finite differences of an adaptive solver crawl
NEAR = 1e-3  # relative difference of two objectives that are the same optimum


def run() -> dict[str, Any]:
    """Times, optima and convergence of the three ways; growth of the third."""
    vessel = load_vessel("gunnerus-28.9")
    data, settings = (
        _noisy(vessel, RUNS),
        Identify(parameters=["hull.derivatives.*"], weights=NOISE, horizon=0, start="base"),
    )
    fit = build_problem(vessel, data, data.runs, settings)
    begin = 1 + 0.2 * np.sin(np.arange(fit.num_factors))
    start = dict(zip(fit.unknown.paths, begin.tolist(), strict=True))
    first = clock(lambda: identify(vessel, data, data.runs, settings, start=start))
    seconds = best_of({"identify": lambda: identify(vessel, data, data.runs, settings, start=start)}, ROUNDS)
    mine = identify(vessel, data, data.runs, settings, start=start)
    begun = time.perf_counter()
    theirs = by_hand(vessel, data, fit, begin)
    slow = time.perf_counter() - begun
    fine = {
        name: float((_differences(vessel, data, fit, x) ** 2).sum())
        for name, x in (("a", theirs.x), ("c", mine.factors))
    }
    result: dict[str, Any] = {
        "by hand [s]": round(slow, 1),
        "by hand: evaluations, Jacobians (0: stopped before its end)": f"{theirs.nfev}, {theirs.njev}",
        "identify [s]": round(seconds["identify"], 4),
        "identify: iterations": mine.iterations,
        "identify, first call [s]": round(first, 2),
        "by hand / identify": round(slow / seconds["identify"], 1),
        "objective, identify / by hand": round(fine["c"] / fine["a"], 6),
    }
    for spread in SPREADS:
        result |= _convergence(vessel, data, settings, mine.objective, spread)
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


def _differences(vessel: Vessel, data: Dataset, fit: Problem, theta: np.ndarray) -> np.ndarray:
    """Weighted residuals of the model by hand."""
    model, differences = Model(vessel), []
    for _, rows in data.frame.groupby("run", sort=False):
        measured = rows[["u", "v", "r"]].to_numpy()
        orders = rows[["port.n", "port.alpha"]].to_numpy()[:-1]
        differences.append((model.motion(measured[0], orders, theta, 1.0) - measured[1:]) / fit.deviations)
    return np.concatenate(differences).ravel()


def by_hand(vessel: Vessel, data: Dataset, fit: Problem, begin: np.ndarray) -> Any:
    """`least_squares` (trf, defaults) with finite differences; its model is checked against shipid's first."""
    model, model_equations = Model(vessel), vessel_dynamics(vessel)
    nu, orders = np.array([3.0, 0.4, -0.03]), (2.0, 0.3)
    commands = [orders[name.endswith("alpha")] for name in model_equations.commands]
    state = [0, 0, 0, *nu]
    rates = model_equations.rates(
        state, [], commands, np.zeros(len(model_equations.environment)), list(vessel.parameters.values()), np.zeros(3)
    )
    assert np.allclose(model.rates(nu, orders, np.ones(fit.num_factors)), np.array(rates).ravel()[3:], rtol=1e-9)
    begun, best = time.perf_counter(), SimpleNamespace(x=begin, cost=np.inf, nfev=0, njev=0)

    def residuals(theta: np.ndarray) -> np.ndarray:
        differences = _differences(vessel, data, fit, theta)
        best.nfev += 1
        if (differences**2).sum() / 2 < best.cost:
            best.x, best.cost = theta.copy(), float((differences**2).sum() / 2)
        if time.perf_counter() - begun > PATIENCE:
            raise TimeoutError
        return differences

    try:
        return least_squares(residuals, begin)
    except TimeoutError:
        return best


def _convergence(vessel: Vessel, data: Dataset, settings: Identify, best: float, spread: float) -> dict[str, Any]:
    """From how many of so many starts `identify` reaches the best optimum."""
    reached, count = 0, len(identify(vessel, data, data.runs, settings).paths)
    for seed in range(STARTS):
        paths = [path for path in vessel.parameters if path.startswith("hull.derivatives.")]
        begin = 1 + spread * np.random.default_rng(seed).uniform(-1, 1, count)
        start = dict(zip(paths, begin.tolist(), strict=True))
        reached += identify(vessel, data, data.runs, settings, start=start).objective < best * (1 + NEAR)
    return {f"starts off by {spread:.0%}: converge": f"{reached} of {STARTS}"}


def _growth(vessel: Vessel, settings: Identify) -> dict[str, Any]:
    """Time per unit of four times the runs, and of four times the parameters, over time per unit."""
    few = settings.model_copy(update={"fixed": [f"{DERIVATIVES}{axis}_*" for axis in "XY"] + ["hull.*r|", "hull.*v|"]})
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
