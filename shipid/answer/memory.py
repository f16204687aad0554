"""What the past shows: the observer along test runs, and what memory and observer bought, paired over test runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd

from shipid.answer.frames import figure_runs, insert_gaps
from shipid.evidence import CellErrors, compare_cells
from shipid.observer import filter_bank, run_observer
from shipid.predictor import Predictor
from shipid.study import store
from shipid.study.declared import Foundation, StudyMethod
from shipid.study.plan import learns_from_runs, model_label
from shipid.study.prepare import known_by_then
from shipid.study.results import Results

Array = np.ndarray
Added = Literal["memory", "observer", "both"]
CellName = tuple[str, str]  # foundation and method
PHYSICS_ALONE = "physics alone"
NOT_COMPARED = ("memory", "choose", "history_scale", "error_scale", "observer_scale")  # settings of memory itself
OBSERVER_COLUMNS = [
    *("u", "v", "r", "observer.u", "observer.v", "observer.r", "observer.X", "observer.Y", "observer.N"),
    *("observer.current_north", "observer.current_east", "observer.test"),
]
ADDED_WORDS: dict[Added, str] = {"memory": "memory", "observer": "observer", "both": "observer and memory"}


@dataclass(frozen=True)
class MemoryPair:
    """Two ways to predict that differ in what they take from the past.

    added : what the second takes beside the first. comparison : the same in words, for all models alike.
    without, remembering : foundation and method of both; the method is `physics alone` where there is none.
    differs : settings in which the methods differ beside those of memory.
    """

    added: Added
    comparison: str
    without: CellName
    remembering: CellName
    differs: tuple[str, ...] = ()


def memory_pairs(foundations: Sequence[Foundation], ways: Sequence[StudyMethod]) -> list[MemoryPair]:
    """Every pair of a study: the same foundation with and without memory, and every observed one with its original.

    Methods are compared with others of their kind alone: between kinds, memory is not all that differs.
    """
    pairs = [pair for one in foundations for pair in _method_pairs(one, one, ways)]
    for observed, original in _observed_foundations(foundations):
        both = [way.name for way in ways if observed.name in way.foundations and original.name in way.foundations]
        for method in (*([] if observed.fitted else [PHYSICS_ALONE]), *both):
            names = (original.name, method), (observed.name, method)
            pairs.append(MemoryPair("observer", f"observer: {method}", *names))
        pairs += _method_pairs(original, observed, ways)
    return sorted(pairs, key=lambda pair: [*ADDED_WORDS].index(pair.added))


def kinds_of_memory(way: StudyMethod, foundation: Foundation) -> frozenset[str]:
    """Kinds of memory that a method takes on a foundation: `history`, `error`, `observer`, or `past` for any other."""
    memory = way.method.traits.memory
    kinds = {"history"} if memory.history or memory.turned else set()
    kinds |= {"error"} if memory.error and foundation.base is not None else set()
    if not kinds and not memory.past and way.method.past > 0:
        kinds = {"past"}
    return frozenset(kinds | ({"observer"} if memory.observer and foundation.observer is not None else set()))


def _method_pairs(original: Foundation, observed: Foundation, ways: Sequence[StudyMethod]) -> Iterator[MemoryPair]:
    """Each method with memory on one foundation, and the method of its kind that takes least on the other."""
    added: Added = "memory" if original is observed else "both"
    for way in (way for way in ways if observed.name in way.foundations):
        mine = kinds_of_memory(way, observed)
        if added == "both" and not mine - {"observer"}:
            continue  # the observer alone: compared with the same method
        others = [one for one in ways if one.kind == way.kind and original.name in one.foundations and one is not way]
        taken = {one.name: kinds_of_memory(one, original) for one in others}
        if fewer := [one for one in others if taken[one.name] < mine]:
            rival = min(fewer, key=lambda one: (len(taken[one.name]), len(_differing_settings(way, one))))
            words = f"{ADDED_WORDS[added]}: {way.name} against {rival.name}"
            names = (original.name, rival.name), (observed.name, way.name)
            yield MemoryPair(added, words, *names, _differing_settings(way, rival))


def _differing_settings(one: StudyMethod, other: StudyMethod) -> tuple[str, ...]:
    """Settings, memory's apart, that differ between two methods of a kind."""
    mine, others = one.method.model_dump(mode="json"), other.method.model_dump(mode="json")
    return tuple(name for name in mine if name not in NOT_COMPARED and mine[name] != others.get(name))


def _observed_foundations(foundations: Sequence[Foundation]) -> Iterator[tuple[Foundation, Foundation]]:
    """Every foundation with an observer and the same without one, where the study has it."""
    plain = [one for one in foundations if one.observer is None and one.variant is not None]
    for one in foundations:
        if one.observer is not None and one.variant is not None:
            for other in plain:
                if other.variant.name == one.variant.name and other.identify == one.identify:  # type: ignore[union-attr]
                    yield one, other


def memory_frame(results: Results) -> pd.DataFrame:
    """H [m] of both members of every pair at every N_D, and their difference with its interval by `compare_cells`.

    Columns: comparison, added, model (the foundation without), without, with, N_D (0: physics alone), A [m] of the
    foundation without, H_without, H_with, difference, low, high [m], runs, better (test runs with a lower error), seeds
    (that both have), differs.
    """
    rows, family = list[dict[str, Any]](), {one.name: one.family for one in results.plan.foundations}

    def errors(named: CellName, paths: Sequence[Array]) -> list[CellErrors]:
        learns = learns_from_runs(results.plan, family[named[0]], named[1])
        return [CellErrors(named[0], results.path_errors(path), results.windows, learns) for path in paths]

    for pair, N_D, first, second in _paired_paths(results):
        before, after = errors(pair.without, first), errors(pair.remembering, second)
        one = compare_cells(after, before)
        means = {"H_without": np.mean([cell.mean for cell in before]), "H_with": np.mean([cell.mean for cell in after])}
        rows.append(
            _names_of_pair(pair, results)
            | {"N_D": N_D, "A": _accuracy_at(results, pair.without[0], N_D), **means}
            | {"difference": one.mean, "low": one.low, "high": one.high, "runs": one.runs, "better": one.better}
            | {"seeds": len(first), "differs": ", ".join(pair.differs)}
        )
    return pd.DataFrame(rows)


def _names_of_pair(pair: MemoryPair, results: Results) -> dict[str, Any]:
    without, remembering = (
        f"{name}, {method}" if method == PHYSICS_ALONE else model_label(results.plan, name, method)
        for name, method in (pair.without, pair.remembering)
    )
    names = {"comparison": pair.comparison, "added": pair.added, "model": pair.without[0]}
    return names | {"without": without, "with": remembering}


def _paired_paths(results: Results) -> Iterator[tuple[MemoryPair, int, list[Array], list[Array]]]:
    """Pair, N_D (0: physics alone), and the paths (T, S, 2) [m] of both, for the seeds that both have."""
    cells: dict[tuple[CellName, int], dict[int, str]] = {}
    for row in results.rows:
        if row["cell"] in results.paths:
            key = (str(row["foundation"]), str(row["method"])), int(row["N_D"])
            cells.setdefault(key, {})[int(row["seed"])] = row["cell"]
    for pair in memory_pairs(results.plan.foundations, results.plan.methods):
        if pair.without[1] == PHYSICS_ALONE:
            alone = [results.physics.get(name) for name, _ in (pair.without, pair.remembering)]
            if all(path is not None and np.isfinite(path).all() for path in alone):
                yield pair, 0, [alone[0]], [alone[1]]  # type: ignore[list-item]
            continue
        for N_D in sorted({amount for _, amount in cells}):
            first, second = (cells.get((named, N_D), {}) for named in (pair.without, pair.remembering))
            if seeds := sorted(first.keys() & second.keys()):
                before, after = ([results.paths[one[seed]] for seed in seeds] for one in (first, second))
                yield pair, N_D, before, after


def _accuracy_at(results: Results, foundation: str, N_D: int) -> float:
    """A [m] of a foundation; of the numbers identified at this N_D, where they are."""
    cells = results.cells[results.cells["foundation"] == foundation]
    return float(cells[cells["N_D"].eq(N_D) | (N_D == 0)]["A"].astype(float).mean())


def observer_frame(results: Results) -> pd.DataFrame:
    """Estimates of the observer of one foundation along the shown test runs; no rows in a study without observers.

    Columns: run, t [s]; u, v, r as measured; `observer.u`, ... as filtered; `observer.X`, `.Y` [m/s^2], `.N` [rad/s^2];
    `observer.current_north`, `.current_east` [m/s]; `observer.test` [1]; model; fade [s], the time constant of the
    force ahead; ahead [s], the horizon.
    """
    predictor = _observed_exemplar(results)
    if predictor is None or predictor[1].vessel is None:
        return pd.DataFrame()
    name, vessel, settings = predictor[0], predictor[1].vessel, predictor[1].physics.observer
    part = results.dataset.select(figure_runs(results))
    known = run_observer(vessel, known_by_then(results.plan.study, part), settings)
    begins = np.isnan(known.innovation).all(axis=1)
    table = pd.DataFrame({**part.frame[["run", "t", "u", "v", "r"]], **known.columns})[["run", "t", *OBSERVER_COLUMNS]]
    table["observer.test"] = np.where(begins, np.nan, table["observer.test"])
    table = table.assign(
        model=name, fade=filter_bank(vessel, settings).fade, ahead=results.test.horizon * results.test.step
    )
    return insert_gaps(table, ["run", "model", "fade", "ahead"])


def _observed_exemplar(results: Results) -> tuple[str, Predictor] | None:
    """The observed foundation that is shown and a predictor on it: of the first family, the one of middle A."""
    good = results.cells[results.cells["cell"].isin(list(results.paths))]
    observed = sorted((one for one in results.plan.foundations if one.observer is not None), key=lambda one: one.fitted)
    known = [one for one in observed if one.name in set(good["foundation"])]
    if not known:
        return None
    family = [one.name for one in known if one.family == known[0].family]
    A = good[good["foundation"].isin(family)].groupby("foundation")["A"].mean().sort_values(kind="stable")
    name = str(A.index[(len(A) - 1) // 2])
    cells = good[good["foundation"] == name].sort_values(["N_D", "seed"], ascending=[False, True], kind="stable")
    return name, Predictor.load(store.cell_file(results.folder, str(cells["cell"].iloc[0])))
