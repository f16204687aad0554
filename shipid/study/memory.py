"""What the past shows: the observer along test runs, and what memory and observer bought, paired over test runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
import pandas as pd

from shipid.metrics import over_time, position_error
from shipid.observer import bank, observe
from shipid.predictor import Predictor
from shipid.study import store
from shipid.study.declared import Foundation, Way
from shipid.study.evidence import contrasts, training_error
from shipid.study.plan import learns_from_runs, model_label
from shipid.study.prepare import known_by_then
from shipid.study.results import Results, shown_runs, with_gaps

Array = np.ndarray
Added = Literal["memory", "observer", "both"]
PHYSICS_ALONE = "physics alone"
ORDER = 0.05  # share of a command's range in a run that counts as a new order
NOT_COMPARED = ("memory", "choose", "history_scale", "error_scale", "observer_scale")  # settings of memory itself
ALONG = [
    *("u", "v", "r", "observer.u", "observer.v", "observer.r", "observer.X", "observer.Y", "observer.N"),
    *("observer.current_north", "observer.current_east", "observer.test"),
]


@dataclass(frozen=True)
class Pair:
    """Two ways to predict that differ in what they take from the past.

    added : what the second takes beside the first. comparison : the same in words, for all models alike.
    without, remembering : foundation and method of both; the method is `physics alone` where there is none.
    differs : settings in which the methods differ beside those of memory.
    """

    added: Added
    comparison: str
    without: tuple[str, str]
    remembering: tuple[str, str]
    differs: tuple[str, ...] = ()


def pairs(foundations: Sequence[Foundation], ways: Sequence[Way]) -> list[Pair]:
    """Every pair of a study: the same foundation with and without memory, and every observed one with its original.

    Methods are compared with others of their kind alone: between kinds, memory is not all that differs.
    """
    rows = []
    for one in foundations:
        rows += [_memory_pair(one, one, way, rival) for way, rival in _rivals(ways, one, one)]
    for observed, original in _observed(foundations):
        if not observed.fitted:
            label = f"observer: {PHYSICS_ALONE}"
            rows.append(Pair("observer", label, (original.name, PHYSICS_ALONE), (observed.name, PHYSICS_ALONE)))
        for way in ways:
            if observed.name in way.foundations and original.name in way.foundations:
                label = f"observer: {way.name}"
                rows.append(Pair("observer", label, (original.name, way.name), (observed.name, way.name)))
        rows += [_memory_pair(original, observed, way, rival) for way, rival in _rivals(ways, original, observed)]
    order: dict[Added, int] = {"memory": 0, "observer": 1, "both": 2}
    return sorted(rows, key=lambda pair: order[pair.added])


def taken(way: Way, foundation: Foundation) -> frozenset[str]:
    """Kinds of memory that a method takes on a foundation: `history`, `error`, `observer`, or `past` for any other."""
    memory = way.method.traits.memory
    kinds = {"history"} if memory.history or memory.turned else set()
    kinds |= {"error"} if memory.error and foundation.base is not None else set()
    if not kinds and not memory.past and way.method.past > 0:
        kinds = {"past"}
    return frozenset(kinds | ({"observer"} if memory.observer and foundation.observer is not None else set()))


def _rivals(ways: Sequence[Way], original: Foundation, observed: Foundation) -> Iterator[tuple[Way, Way]]:
    """Each method with memory on one foundation, and the method of its kind that takes least on the other."""
    for way in ways:
        if observed.name not in way.foundations:
            continue
        mine = taken(way, observed)
        others = [one for one in ways if one.kind == way.kind and original.name in one.foundations]
        fewer = [one for one in others if one is not way and taken(one, original) < mine]
        if original is not observed and not mine - {"observer"}:
            continue  # the observer alone: compared with the same method
        if fewer:
            yield way, min(fewer, key=lambda one: (len(taken(one, original)), len(_differing(way, one))))


def _memory_pair(original: Foundation, observed: Foundation, way: Way, rival: Way) -> Pair:
    added: Added = "memory" if original is observed else "both"
    words = "memory" if original is observed else "observer and memory"
    names = (original.name, rival.name), (observed.name, way.name)
    return Pair(added, f"{words}: {way.name} against {rival.name}", *names, _differing(way, rival))


def _differing(one: Way, other: Way) -> tuple[str, ...]:
    """Settings, memory's apart, that differ between two methods of a kind."""
    mine, theirs = one.method.model_dump(mode="json"), other.method.model_dump(mode="json")
    return tuple(name for name in mine if name not in NOT_COMPARED and mine[name] != theirs.get(name))


def _observed(foundations: Sequence[Foundation]) -> Iterator[tuple[Foundation, Foundation]]:
    """Every foundation with an observer and the same without one, where the study has it."""
    for one in foundations:
        if one.observer is None or one.variant is None:
            continue
        for other in foundations:
            same = other.variant is not None and other.variant.name == one.variant.name
            if same and other.observer is None and other.identify == one.identify:
                yield one, other


def memory_frame(results: Results) -> pd.DataFrame:
    """H [m] of both members of every pair at every N_D, and their difference with its interval by `contrasts`.

    What another training would give is in the interval, as in those of findings.

    Columns: comparison, added, model (the foundation without), without, with, N_D (0: physics alone), A [m] of the
    foundation without, H_without, H_with, difference, low, high [m], runs, better (test runs with a lower error), seeds
    (that both have), differs.
    """
    rows, differences, training = list[dict[str, Any]](), list[Array](), list[float]()
    runs, place = np.unique(results.test.run, return_inverse=True)
    counts = np.bincount(place).astype(float)
    family = {one.name: one.family for one in results.plan.foundations}
    for pair, N_D, first, second in _errors(results):
        before, after, seeds = first.mean(axis=0), second.mean(axis=0), len(first)
        learns = [
            learns_from_runs(results.plan, family[name], method) for name, method in (pair.without, pair.remembering)
        ]
        apart = (
            training_error([one.mean(axis=1)]) for one, moved in zip((first, second), learns, strict=True) if moved
        )
        training.append(math.hypot(*apart))
        sums = np.bincount(place, after - before)
        differences.append(sums / counts)
        rows.append(
            _names(pair, partial(model_label, results.plan))
            | {"N_D": N_D, "A": _accuracy(results, pair.without[0], N_D)}
            | {"H_without": before.mean(), "H_with": after.mean(), "difference": (after - before).mean()}
            | {"low": np.nan, "high": np.nan, "runs": len(runs), "better": int((sums < 0).sum()), "seeds": seeds}
            | {"differs": ", ".join(pair.differs)}
        )
    frame = pd.DataFrame(rows)
    if rows:
        judged = contrasts(np.stack(differences), counts, np.array(training))
        frame["low"], frame["high"] = judged.low, judged.high
    return frame


def memory_time_frame(results: Results) -> pd.DataFrame:
    """Mean error over the horizon [m] at each instant of the shown test runs, of both members of every pair.

    Columns: comparison, model, without, with, N_D, run, t [s], error_without, error_with [m]; mean over seeds; the
    largest N_D alone.
    """
    shown = np.isin(results.test.run, shown_runs(results))
    parts, largest = [], int(results.cells["N_D"].max())
    for pair, N_D, first, second in _errors(results):
        if N_D in (0, largest):
            before, after = first.mean(axis=0), second.mean(axis=0)
            names = {
                key: value for key, value in _names(pair, partial(model_label, results.plan)).items() if key != "added"
            }
            columns = {"run": results.test.run[shown], "t": results.test.t[shown]}
            columns |= {"error_without": before[shown], "error_with": after[shown]}
            parts.append(pd.DataFrame({**names, "N_D": N_D, **columns}))
    if not parts:
        return pd.DataFrame()
    return with_gaps(pd.concat(parts, ignore_index=True), ["comparison", "model", "without", "with", "N_D", "run"])


def _names(pair: Pair, label: Callable[[str, str], str]) -> dict[str, Any]:
    words = [
        f"{name}, {PHYSICS_ALONE}" if method == PHYSICS_ALONE else label(name, method)
        for name, method in (pair.without, pair.remembering)
    ]
    named = {"comparison": pair.comparison, "added": pair.added, "model": pair.without[0]}
    return named | {"without": words[0], "with": words[1]}


def _errors(results: Results) -> Iterator[tuple[Pair, int, Array, Array]]:
    """Pair, N_D, and of both the mean error over the horizon (seeds, S) [m], for the seeds that both have."""
    cells: dict[tuple[str, str, int], dict[int, str]] = {}
    for row in results.rows:
        if row["cell"] in results.paths:
            key = str(row["foundation"]), str(row["method"]), int(row["N_D"])
            cells.setdefault(key, {})[int(row["seed"])] = str(row["cell"])
    amounts = sorted({key[2] for key in cells})
    known: dict[str, Array] = {}

    def error(cell: str) -> Array:
        if cell not in known:
            known[cell] = over_time(position_error(results.paths[cell], results.test.future))
        return known[cell]

    for pair in pairs(results.plan.foundations, results.plan.methods):
        if pair.without[1] == PHYSICS_ALONE:
            alone = [results.physics.get(name) for name, _ in (pair.without, pair.remembering)]
            finite = [path for path in alone if path is not None and np.isfinite(path).all()]
            if len(finite) == 2:
                before, after = (over_time(position_error(path, results.test.future))[None] for path in finite)
                yield pair, 0, before, after
            continue
        for N_D in amounts:
            first, second = cells.get((*pair.without, N_D), {}), cells.get((*pair.remembering, N_D), {})
            seeds = sorted(first.keys() & second.keys())
            if seeds:
                both = [np.stack([error(one[seed]) for seed in seeds]) for one in (first, second)]
                yield pair, N_D, both[0], both[1]


def _accuracy(results: Results, foundation: str, N_D: int) -> float:
    """A [m] of a foundation; of the numbers identified at this N_D, where they are."""
    cells = results.cells[results.cells["foundation"] == foundation]
    here = cells[cells["N_D"] == N_D] if N_D else cells
    return float(here["A"].astype(float).mean())


def observer_frame(results: Results) -> pd.DataFrame:
    """Estimates of the observer of one foundation along the shown test runs; no rows in a study without observers.

    Columns: run, t [s]; u, v, r as measured; `observer.u`, ... as filtered; `observer.X`, `.Y` [m/s^2], `.N` [rad/s^2];
    `observer.current_north`, `.current_east` [m/s]; `observer.test` [1]; model; fade [s], the time constant of the
    force ahead; ahead [s], the horizon.
    """
    predictor = _exemplar(results)
    if predictor is None or predictor[1].vessel is None:
        return pd.DataFrame()
    name, vessel, settings = predictor[0], predictor[1].vessel, predictor[1].physics.observer
    part = results.dataset.select(shown_runs(results))
    known = observe(vessel, known_by_then(results.plan.study, part), settings)
    begins = np.isnan(known.innovation).all(axis=1)
    table = pd.DataFrame({**part.frame[["run", "t", "u", "v", "r"]], **known.columns})[["run", "t", *ALONG]]
    table["observer.test"] = np.where(begins, np.nan, table["observer.test"])
    table = table.assign(model=name, fade=bank(vessel, settings).fade, ahead=results.test.horizon * results.test.step)
    return with_gaps(table, ["run", "model", "fade", "ahead"])


def orders_frame(results: Results) -> pd.DataFrame:
    """Moments of new orders in the shown test runs: run, t [s]; a command jumps, or begins to move as fast."""
    frames = []
    for run, rows in results.dataset.frame.groupby("run", sort=False):
        if run in shown_runs(results):
            values = rows[results.dataset.commands].to_numpy(dtype=float)
            steps = np.abs(np.diff(values, axis=0)) > ORDER * np.ptp(values, axis=0) + 1e-9
            moved = steps.any(axis=1)
            begins = moved & ~np.concatenate([[False], moved[:-1]])
            frames += [{"run": run, "t": float(t)} for t in rows["t"].to_numpy()[1:][begins]]
    return pd.DataFrame(frames, columns=["run", "t"])


def _exemplar(results: Results) -> tuple[str, Predictor] | None:
    """The observed foundation that is shown and a predictor on it: of the first family, the one of middle A."""
    observed = [one for one in results.plan.foundations if one.observer is not None]
    observed.sort(key=lambda one: one.fitted)
    good = results.cells[results.cells["cell"].isin(list(results.paths))]
    known = [one for one in observed if (good["foundation"] == one.name).any()]
    if not known:
        return None
    family = [one.name for one in known if one.family == known[0].family]
    A = good[good["foundation"].isin(family)].groupby("foundation")["A"].mean().sort_values(kind="stable")
    name = str(A.index[(len(A) - 1) // 2])
    cells = good[good["foundation"] == name].sort_values(["N_D", "seed"], ascending=[False, True], kind="stable")
    return name, Predictor.load(store.cell_file(results.folder, str(cells["cell"].iloc[0])))
