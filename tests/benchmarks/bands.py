"""Do bands hold what they promise? Many seeded worlds, each with runs that no model has seen: docs/bands.md.

`python -m tests.benchmarks bands --replicates 200`; the real log is measured too where SHIPID_DATA names it.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from shipid.answer.bands import share_interval
from shipid.data.windows import Windows, run_folds
from shipid.hybrid.alone import Alone
from shipid.hybrid.bands import Bands, Region, runs_needed, track_directions
from shipid.hybrid.calibration import calibrate_bands
from shipid.hybrid.compensator import Compensator
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.method import Case, Corrector, Method, Task
from shipid.hybrid.physics import Physics
from shipid.identification.bands import band_refusal
from shipid.identification.bands import measure_bands as of_manoeuvres
from shipid.identification.outcome import COMPARED
from shipid.identification.settings import Identify
from shipid.identification.solve import identify
from shipid.identification.statistics import fit_statistics
from shipid.metrics import coverage_by_run, coverage_share
from shipid.predictor import limits_of
from shipid.simulation.measured import measure_standard
from shipid.study.plan import Batch, model_label, read_plan
from shipid.study.prepare import instants_of, obtain_runs, partition, prepare
from shipid.study.run import run_unit
from shipid.vessel.load import Vessel, load_vessel
from tests.benchmarks import coverage
from tests.benchmarks.worlds import World, world
from tests.study.tiny import whole_unit

Array = np.ndarray
SHARES = (0.5, 0.8, 0.9, 0.95)
METHODS: dict[str, Method] = {"alone": Alone(), "kernel": Kernel()}
VESSEL = "gunnerus-28.9"


@dataclass(frozen=True)
class Cell:
    """A fitted method on some runs of a world: errors without each run, and what it predicts for fresh runs."""

    windows: Windows
    corrector: Corrector
    left_out: Array
    inside: Array
    paths: Array
    spread: Array | None
    bands: Bands


def cell(made: World, runs: Sequence[str], method: Method, physics: Physics, seed: int) -> Cell | None:
    """Fit a method on some runs; None where the physics or the fit diverges."""
    windows = made.pool.select(np.isin(made.pool.run, runs))
    alone, ahead = physics.paths(windows.instants()), physics.paths(made.fresh.instants())
    if not (np.isfinite(alone).all() and np.isfinite(ahead).all()):
        return None
    folds = run_folds(windows, "runs", seed) if method.compensates else ()
    task = Task({"one": Case(physics, alone)}, windows, folds, tuple(windows.planned), seed=seed)
    fitted = method.fit(task)["one"]
    if fitted.corrector is None or fitted.left_out is None:
        return None
    paths = fitted.corrector.predict(physics, made.fresh.instants(), ahead)
    names = tuple(limits_of(windows, windows.planned))
    bands = calibrate_bands(
        fitted.left_out, windows.future, windows.run, windows.columns, names, windows.step, made.kinds
    )
    inside = windows.future - fitted.corrector.predict(physics, windows.instants(), alone)
    spread = None
    if isinstance(fitted.corrector, Compensator):
        table = fitted.corrector.inputs.table(physics, made.fresh.instants())
        single = np.stack([network.predict(table) for network in fitted.corrector.networks])
        spread = single.std(axis=0, ddof=1)
    return Cell(windows, fitted.corrector, fitted.left_out, inside, paths, spread, bands)


def by_run(run: Array, values: Array) -> float:
    """Mean over runs of the means over their windows."""
    _, place = np.unique(run, return_inverse=True)
    return float((np.bincount(place, values) / np.bincount(place)).mean())


def ideal_radius(scores: Array, run: Array, level: float) -> float:
    """Quantile of the scores of fresh runs, every run weighing the same: what the radius should have been."""
    _, place, count = np.unique(run, return_inverse=True, return_counts=True)
    order = np.argsort(scores)
    weights = (1 / count[place])[order]
    return float(np.interp(level, (np.cumsum(weights) - weights / 2) / weights.sum(), scores[order]))


def promised(made: World, one: Cell, runs: int, keys: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Coverage and width at every level that so many runs can promise, by kind of manoeuvre too, and the ideal."""
    fresh, errors = made.fresh, made.fresh.future - one.paths
    kinds = np.array([made.kinds[str(run)] for run in fresh.run])
    calibrated_kinds = [made.kinds[str(run)] for run in one.windows.spans]
    for level in SHARES:
        if not one.bands.promises(level):
            continue
        region = one.bands.region(one.paths, fresh.columns, fresh.step, level)
        reach = region.reach(errors).max(axis=0)
        row = {**keys, "runs": runs, "level": level, "width": float(region.radius.mean())}
        held = (reach <= 1).astype(float)
        row |= {"coverage": by_run(fresh.run, held), "ratio": 1 / ideal_radius(reach, fresh.run, level)}
        for kind in np.unique(kinds):
            mine = kinds == kind
            row |= {f"{kind}": by_run(fresh.run[mine], held[mine]), f"{kind} runs": calibrated_kinds.count(kind)}
            if one.bands.promises(level, str(kind)):
                known = one.bands.region(one.paths, fresh.columns, fresh.step, level, kind=str(kind))
                row[f"{kind} named"] = by_run(fresh.run[mine], known.holds(errors)[mine].astype(float))
        yield row


def rivals(made: World, one: Cell, level: float, keys: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The same share promised in other ways: coverage of whole paths and mean radius."""
    fresh, errors, windows = made.fresh, made.fresh.future - one.paths, one.windows
    ahead, size = track_directions(one.paths), one.paths.shape[:2]

    def circle(radius: Array) -> Region:
        wide = np.broadcast_to(np.maximum(radius, 1e-9), size)
        return Region(ahead, wide, wide)

    off, inside = np.hypot(*np.moveaxis(one.left_out, -1, 0)), np.hypot(*np.moveaxis(one.inside, -1, 0))
    columns, horizon = fresh.columns, len(off)

    def pooled(distances: Array) -> Region:
        scale = np.maximum(distances.mean(axis=1), 0.05 * distances.mean(axis=1).max())[:, None]
        scores = np.sort((distances / scale).max(axis=0))
        place = min(int(np.ceil(level * (len(scores) + 1))) - 1, len(scores) - 1)
        return circle(scale * scores[place])

    regions = {
        "band": one.bands.region(one.paths, columns, fresh.step, level),
        "each step alone": one.bands.region(one.paths, columns, fresh.step, level, pointwise=True),
        "Bonferroni over steps": circle(np.quantile(off, 1 - (1 - level) / horizon, axis=1)[:, None]),
        "windows pooled": pooled(off),
        "windows pooled, training errors": pooled(inside),
        "hierarchical conformal (proven)": _proven(one, windows, level, columns),
    }
    if one.spread is not None:
        z = float(np.sqrt(stats.chi2.ppf(level, 2)))
        regions["spread of the ensemble"] = Region(ahead, *(np.maximum(z * one.spread[..., i], 1e-9) for i in (0, 1)))
    for name, region in regions.items():
        held = region.holds(errors).astype(float)
        row = {**keys, "runs": len(windows.spans), "level": level, "rival": name}
        yield {**row, "coverage": by_run(fresh.run, held), "width": float(region.radius.mean())}


def _proven(one: Cell, windows: Windows, level: float, columns: Any) -> Region:
    """The band with the quantile of Lee, Barber and Willett, which has a proof for any distribution."""
    paths = windows.future - one.left_out
    reach = one.bands.region(paths, windows.columns, windows.step, 0.5).reach(one.left_out).max(axis=0)
    _, place, count = np.unique(windows.run, return_inverse=True, return_counts=True)
    order = np.argsort(reach)
    weights = np.cumsum((1 / (count[place] * (len(count) + 1)))[order])
    index = min(int(np.searchsorted(weights, level - 1e-12)), len(reach) - 1)
    return one.bands.region(one.paths, columns, windows.step, 0.5).scaled(float(reach[order][index]))


def worlds(
    count: int, *, amounts: Sequence[int] = (22,), every: int = 4, fresh: int = 1000, first: int = 0, show: bool = False
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Promises and rivals over seeded worlds; in every fourth world also with 5, 10 and 50 runs."""
    kept: list[dict[str, Any]] = []
    beside: list[dict[str, Any]] = []
    for seed in range(first, first + count):
        made = world(seed, fresh)
        runs = list(made.pool.spans)
        for size in (*amounts, *((5, 10, 50) if seed % every == 0 else ())):
            for label, method in METHODS.items():
                physics = made.physics
                if label == "kernel" and seed % 3 == 2:
                    physics, label = Physics(None, physics.horizon, physics.step), "kernel, no physics"
                one = cell(made, runs[:size], method, physics, seed)
                keys = {
                    "world": seed,
                    "ship": made.ship,
                    "mixed": made.mixed,
                    "method": label,
                    "horizon": made.pool.horizon,
                }
                if one is None:  # the wrong physics diverges
                    continue
                kept += promised(made, one, size, keys)
                if size == 22:
                    beside += rivals(made, one, 0.9, keys)
        if show:
            print(f"world {seed}", flush=True)
    return pd.DataFrame(kept), pd.DataFrame(beside)


def mean_interval(values: pd.Series[float]) -> str:
    """Mean over worlds with its 95 % interval."""
    values = values.dropna()
    half = 1.96 * values.std(ddof=1) / len(values) ** 0.5 if len(values) > 1 else float("nan")
    return f"{values.mean():.3f} +- {half:.3f}"


def figures(kept: pd.DataFrame, beside: pd.DataFrame) -> dict[str, Any]:
    """Tables of the docs as label -> text; the mean over the methods of a world counts once."""
    summary: dict[str, Any] = {"worlds": kept["world"].nunique()}
    for (runs, level), part in kept.groupby(["runs", "level"]):
        per = part.groupby("world")[["coverage", "ratio"]].mean()
        summary[f"{runs} runs, {level:.0%}: coverage"] = mean_interval(per["coverage"])
        summary[f"{runs} runs, {level:.0%}: width / ideal"] = mean_interval(per["ratio"])
    for key in ("method", "ship"):
        for (one, level), part in kept[kept.runs == 22].groupby([key, "level"]):
            summary[f"22 runs, {one}, {level:.0%}: coverage"] = mean_interval(part.groupby("world")["coverage"].mean())
    for kind in ("Turning", "Steps", "Zigzag"):
        for level, part in kept[kept.runs == 22].groupby("level"):
            if kind in part:
                enough = part[part[f"{kind} runs"] >= runs_needed(float(str(level)))]
                label = f"22 runs, {kind}, {level:.0%}: coverage"
                summary[label] = mean_interval(enough.groupby("world")[kind].mean())
                summary[f"{label}, kind named"] = mean_interval(enough.groupby("world")[f"{kind} named"].mean())
    for rival, part in beside.groupby("rival"):
        width = part.width.to_numpy() / _of_band(beside, part)
        summary[f"22 runs, 90%, {rival}: coverage"] = mean_interval(part["coverage"])
        summary[f"22 runs, 90%, {rival}: width / band"] = mean_interval(pd.Series(width))
    return summary


def _of_band(beside: pd.DataFrame, part: pd.DataFrame) -> Array:
    band = beside[beside.rival == "band"].set_index(["world", "method"])["width"]
    return np.array([band[key] for key in zip(part["world"], part["method"], strict=True)])


FAMILIES = [
    {"name": "accurate", "base": "gunnerus-28.9"},
    {"name": "template", "base": "gunnerus-33.9-template"},
]
WAYS = [
    {"name": "kernel", "kind": "kernel"},
    {"name": "alone", "kind": "alone"},
    {"name": "memory", "kind": "kernel", "memory": {"history": [2, 4, 8], "error": 8}},
]


def recorded(folder: Path, commands: str) -> pd.DataFrame:
    """Every zigzag of the real log in turn, all other runs train: a row per window and model, with its bands."""
    log = folder / "gunnerus_2022" / "RVG_ManeuveringTests.csv"
    changes = {"family": FAMILIES, "method": WAYS, "claims": None, "data.log": str(log)}
    plan = read_plan("full-scale", {**changes, "prediction.commands": commands, "grid.seeds": [0]})
    dataset = obtain_runs(plan)
    parts = []
    for test in (run for run in dataset.runs if str(run).startswith("ZZ")):
        split = plan.study.split.model_copy(update={"test": [test], "folds": 1})
        least = plan.study.model_copy(update={"split": split, "grid": plan.study.grid.model_copy(update={"N_D": [2]})})
        amount = len(partition(replace(plan, study=least, batches=()), dataset)[0].spans)
        study = least.model_copy(update={"grid": least.grid.model_copy(update={"N_D": [amount]})})
        turn = replace(plan, study=study, batches=(Batch(amount, 0),))
        prepared = prepare(turn, dataset)
        for row, predictor, _ in run_unit(turn, prepared, whole_unit(turn, turn.batches[0]), "cpu"):
            instants = instants_of(turn.study, predictor.vessel, dataset, prepared.test)
            model = model_label(plan, row["foundation"], row["method"])
            frame = pd.DataFrame({"test": test, "model": model, "H": row["H"]},
                                 index=range(len(prepared.test)))  # fmt: skip
            for level in (0.8, 0.9):
                prediction = predictor.predict(instants, level=level)
                frame[f"held {level}"] = prediction.region.holds(prepared.test.future - prediction.paths)
                frame[f"end {level}"] = prediction.region.radius[-1]
            parts.append(frame)
    return pd.concat(parts, ignore_index=True)


def recorded_figures(folder: Path) -> dict[str, Any]:
    """Coverage over the zigzags with its exact interval, clustered by run, and the radius 15 s ahead."""
    summary: dict[str, Any] = {}
    for commands in ("held", "known"):
        for model, part in recorded(folder, commands).groupby("model", sort=False):
            for level in (0.8, 0.9):
                held, wide = part[f"held {level}"].to_numpy(), part[f"end {level}"].mean()
                run = part["test"].to_numpy()
                share, (low, high) = coverage_share(held, run), share_interval(held, run)
                least = coverage_by_run(held, run).min()
                words = f"{share:.3f} [{low:.3f}, {high:.3f}], least of a run {least:.2f}, {wide:.2f} m at the end"
                summary[f"real log, {commands}, {model}, {level:.0%}"] = words
    return summary


def identified_figures(replicates: int = 30) -> dict[str, Any]:
    """Whether bands of 90 % on overshoots and circles hold the truth: simulated trials, whole runs and short horizons.

    The measures are linear about the truth here, because a thousand zigzags would take hours.
    """
    ship = load_vessel(VESSEL)
    paths = [f"hull.derivatives.{name}" for name in coverage.DERIVATIVES]
    slopes, truth = _slopes(ship, paths)

    def measure(one: Vessel) -> dict[str, float]:
        away = np.array([one.parameters[path] / ship.parameters[path] - 1 for path in paths])
        return {name: truth[name] + float(slope @ away) for name, slope in slopes.items()}

    summary: dict[str, Any] = {}
    for label, strength, horizon in (("white noise", 0.0, 0.0), ("process noise", 1.0, 0.0), ("doubled", 2.0, 0.0),
                                     ("doubled, 20 s", 2.0, 20.0), ("doubled, 10 s", 2.0, 10.0)):  # fmt: skip
        held: list[Array] = []
        refused = 0
        for seed in range(replicates):
            data = coverage._noisy(ship, seed, strength)
            settings = Identify(parameters=paths, weights=coverage.NOISE, horizon=horizon,
                                nuisance=["initial_state"], start="base", current="none")  # fmt: skip
            solution = identify(ship, data, data.runs, settings)
            judged = fit_statistics(solution)
            if band_refusal(solution, judged):
                refused += 1
                continue
            rows = of_manoeuvres(ship, solution, judged, lambda one: {"all": measure(one)}, 0.9)
            right = rows["measure"].map(truth)
            held.append(((rows["low"] <= right) & (right <= rows["high"])).to_numpy())
        text = f"{np.mean(held):.3f}, worst measure {np.mean(held, axis=0).min():.3f}" if held else "-"
        summary[f"identified, {label}: coverage of 90%"] = text
        summary[f"identified, {label}: refused"] = f"{refused} of {replicates}"
    return summary


def _slopes(ship: Vessel, paths: Sequence[str]) -> tuple[dict[str, Array], dict[str, float]]:
    """Change of each measure with each factor, and the measures of the truth."""

    def measure(one: Vessel) -> dict[str, float]:
        slopes = {}
        for kind, angles in (("zigzag", (20, 20)), ("turning", (35,))):
            rows = {row["measure"]: row for row in measure_standard(one, kind, angles, engine="repeated").measures}
            slopes |= {name: float(rows[name]["value"]) for name in COMPARED[kind]}
        return slopes

    truth = measure(ship)
    ends = [[measure(ship.with_values({path: ship.parameters[path] * (1 + side)})) for side in (0.02, -0.02)]
            for path in paths]  # fmt: skip
    return {name: np.array([(up[name] - down[name]) / 0.04 for up, down in ends]) for name in truth}, truth


def run(replicates: int = 200) -> dict[str, Any]:
    """Everything that docs/bands.md shows."""
    begun = time.perf_counter()
    results = figures(*worlds(replicates, show=True))
    results |= identified_figures()
    data = os.environ.get("SHIPID_DATA")
    if data:
        results |= recorded_figures(Path(data))
    results["seconds"] = round(time.perf_counter() - begun, 1)
    return results
