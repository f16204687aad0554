"""Two or more runs compared cell by cell: the same family, member, method, N_D and seed.

Each run is set against the first one. Where both predict the same test windows, the difference is taken in every test
manoeuvre and judged over manoeuvres (paired and clustered, `shipid.study.evidence`); else the manoeuvres of
each run are resampled separately.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.arguments import path_of
from shipid.data.windows import Windows
from shipid.errors import DocumentError, ResultError, ShipidError, choices
from shipid.metrics import over_time, position_error
from shipid.study.declared import NO_METHOD, NO_MODEL
from shipid.study.differences import document_differences
from shipid.study.evidence import Contrasts, contrasts, contrasts_apart, training_error
from shipid.study.plan import Plan, drawn_conditions, fitted_families, learns_from_runs
from shipid.study.results import Results, read_results
from shipid.study.schema import WORLDS
from shipid.study.verdict import manoeuvres, shown, too_few

Array = NDArray[np.float64]
Index = NDArray[np.int64]
IDENTICAL = "identical"
"""Verdict on cells that err alike to the digit."""
KEYS = ["family", "member", "method", "N_D", "seed"]
GROUP = ["family", "method", "N_D"]
GRID = {"N_D": "grid.N_D", "seed": "grid.seeds"}  # what two runs must share: key -> where the study says it
MEASURED = ("psi", "u", "v", "r")  # what says whether two windows are the same moment of the same recording


@dataclass(frozen=True, eq=False)
class Comparison:
    """Several runs beside the first of them.

    names : of the folders, the first one first.
    documents : a row per value that differs: path, and a column of text per name.
    errors : a row per other folder, family, method and N_D: `cells` that match, `first` and `other` [m], mean H over
        them, `difference` other less first [m] with its 95 % interval `low` to `high`, `verdict` ("lower", "higher" or
        empty, corrected for the number of rows; "identical" where every cell errs alike to the digit), `paired`, and
        `coverage_first`, `coverage_other` [1] of their bands.
        N_D = 0 is A of the physics alone.
    notes : sentences about what could not be matched, and what the intervals rest on.
    """

    names: tuple[str, ...]
    documents: pd.DataFrame
    errors: pd.DataFrame
    notes: tuple[str, ...]


def compare(folders: Sequence[str | os.PathLike[str]], pairs: Mapping[str, str] | None = None) -> Comparison:
    """Set finished cells of any runs beside those of the first.

    Parameters
    ----------
    folders : two or more folders of runs.
    pairs : family or method of the first run -> its counterpart in the others. Equal names match without; where one
        family, or one method, is left over in both runs, they match too.

    Raises ResultError for a folder without a result, ShipidError where no cell matches.
    """
    if isinstance(folders, str | os.PathLike) or not isinstance(folders, Sequence) or len(folders) < 2:
        raise ShipidError("name two folders or more")
    places = [path_of("folder", folder) for folder in folders]
    real = [os.path.realpath(place) for place in places]
    twice = next((place for place, one in zip(places, real, strict=True) if real.count(one) > 1), None)
    if twice is not None:
        raise ShipidError("is named twice: name each folder once", file=twice)
    return compare_results([read_results(place) for place in places], pairs)


def compare_results(runs: Sequence[Results], pairs: Mapping[str, str] | None = None) -> Comparison:
    """Set the cells of runs that have been read beside those of the first: `compare` without its folders."""
    names = _names([results.folder for results in runs])
    _check_pairs(runs, pairs or {})
    notes = []
    for name, results in zip(names, runs, strict=True):
        good = int((results.cells["status"] == "ok").sum())
        if not good:
            raise ResultError("has no cell with a result", file=results.folder)
        if good < results.plan.cells:
            notes.append(f"{name}: {good} of {results.plan.cells} cells have a result")
    frames, called = [], [dict[str, str]()]
    for name, results in zip(names[1:], runs[1:], strict=True):
        frame, matched, sentences = _beside(runs[0], results, pairs or {})
        frames.append(frame.assign(folder=name))
        called.append(matched)
        notes += [f"{name}: {words}" for words in sentences]
    sessions = [(results.provenance.get("sessions") or [{}])[-1] for results in runs]
    documents = document_differences([results.plan for results in runs], sessions, called)
    documents.columns = pd.Index(["path", *names])
    errors = pd.concat(frames, ignore_index=True)
    return Comparison(names, documents, errors[["folder", *errors.columns.drop("folder")]], tuple(notes))


def _check_pairs(runs: Sequence[Results], pairs: Mapping[str, str]) -> None:
    """DocumentError for a name that is no family or method of the first run, or a counterpart that no other run has."""
    first, *others = ({*results.cells["family"], *results.cells["method"], NO_METHOD} for results in runs)
    there = set[str]().union(*others)
    for words, named, known in (("the first run", pairs, first), ("any other run", pairs.values(), there)):
        wrong = next((name for name in named if name not in known), None)
        if wrong is not None:
            raise DocumentError(f"{wrong!r} is no family or method of {words}: {choices(wrong, known)}", path="--pair")


def _names(folders: Sequence[Path]) -> tuple[str, ...]:
    """The shortest last parts of folders that make their names different."""
    parts = [folder.resolve().parts for folder in folders]
    for count in range(1, max(map(len, parts)) + 1):
        short = ["/".join(part[-count:]) for part in parts]
        if len(set(short)) == len(short):
            return tuple(short)
    return tuple(map(str, folders))


def _beside(first: Results, other: Results, pairs: Mapping[str, str]) -> tuple[pd.DataFrame, dict[str, str], list[str]]:
    """Rows of `Comparison.errors` for one run, without its name; name there -> name in the first; notes."""
    mine, theirs = _cells(first), _cells(other)
    notes: list[str] = []
    called: dict[str, str] = {}
    for key in ("family", "method"):
        matched, words = _counterparts(mine[key], theirs[key], pairs)
        called |= matched
        notes += words
        names = theirs[key].map(matched).astype(mine[key].dtype)  # of none: pandas would make them numbers
        theirs = theirs[theirs[key].isin(matched)].assign(**{key: names, f"{key} there": theirs[key]})
    both = mine.merge(theirs, on=KEYS, suffixes=("_first", "_other")).sort_values("N_D", kind="stable")
    if not (both["N_D"] > 0).any():
        remedy = _remedy(first, other, bool((theirs["N_D"] > 0).any()))
        raise ShipidError(
            f"no cell of {other.folder} matches one of {first.folder}: {_spans(first)}; there: {_spans(other)}; "
            f"{remedy}"
        )
    here, there, paired, words = _windows(first, other)
    notes += words
    groups = [part for _, part in both.groupby(GROUP, sort=False)]
    one = _side(first, groups, "first", here)
    two = _side(other, groups, "other", there)
    alike = [paired & (a == b).all(axis=1) for a, b in zip(one.cells, two.cells, strict=True)]
    training = np.hypot(*(_training(groups, side, alike) for side in ("first", "other")))
    rows = (
        contrasts(two.errors - one.errors, one.counts, training)
        if paired
        else contrasts_apart(two.errors, two.counts, one.errors, one.counts, training)
    )
    if same := sum(one.all() for one in alike):
        notes.append(f"{same} of {len(alike)} rows are identical to the digit: no training sets them apart")
    few = too_few(min(len(one.counts), len(two.counts)))
    if few:
        notes.append(few)
    frame = pd.DataFrame(
        {
            **{key: [_label(part, key) for part in groups] for key in ("family", "method")},
            "N_D": [int(part["N_D"].iloc[0]) for part in groups],
            "cells": [len(part) for part in groups],
            "first": one.errors @ (one.counts / one.counts.sum()),
            "other": two.errors @ (two.counts / two.counts.sum()),
            **{"difference": rows.mean, "low": rows.low, "high": rows.high},
            "verdict": np.where([same.all() for same in alike], IDENTICAL, _verdicts(rows)),
            "paired": paired,
            **{f"coverage_{side}": [part[f"coverage_{side}"].mean() for part in groups] for side in ("first", "other")},
        }
    )
    return frame, called, notes


def _cells(results: Results) -> pd.DataFrame:
    """Keys, predictor and band of every cell with a result; one more row per foundation for A, where it is known."""
    good = results.cells[results.cells["status"] == "ok"].reindex(
        columns=["cell", "foundation", *KEYS, "H", "coverage"]
    )
    trained = list(map(partial(learns_from_runs, results.plan), good["family"], good["method"]))
    good = good.assign(seed=good["seed"] - WORLDS * results.plan.study.seed, trained=trained)
    every = results.cells.drop_duplicates("foundation")
    known = every["foundation"].isin([name for name, path in results.physics.items() if np.isfinite(path).all()])
    alone = every[known & (every["family"] != NO_MODEL)].reindex(columns=good.columns)
    alone = alone.assign(cell="", method=NO_METHOD, N_D=0, seed=0, H=every["A"], coverage=np.nan, trained=False)
    alone = alone[~alone["family"].isin(fitted_families(results.plan))]
    return pd.concat([alone, good], ignore_index=True).astype({"coverage": float, "H": float, "trained": bool})


def _counterparts(here: pd.Series, there: pd.Series, pairs: Mapping[str, str]) -> tuple[dict[str, str], list[str]]:
    """Name there -> name here, of families or methods; a note for names that match without being equal."""
    mine, theirs = list(dict.fromkeys(here)), list(dict.fromkeys(there))
    matched = {pairs[name]: name for name in mine if pairs.get(name) in theirs}
    matched |= {name: name for name in mine if name in theirs and name not in pairs and name not in matched}
    left = [name for name in mine if name not in matched.values()]
    over = [name for name in theirs if name not in matched]
    if len(left) == len(over) == 1 and left[0] not in pairs:
        matched[over[0]] = left[0]
        return matched, [f"{over[0]} is set beside {left[0]}, the only one left (--pair says it otherwise)"]
    lonely = [f"{what} {', '.join(names)}" for what, names in (("only the first has", left), ("only this has", over))
              if names]  # fmt: skip
    return matched, ["; ".join(lonely)] if lonely else []


def _remedy(first: Results, other: Results, named: bool) -> str:
    """What would make cells of two runs match; `named`: whether families and methods have their counterparts."""
    pair = "name counterparts by --pair FIRST=OTHER"
    remedies = [] if named else [pair]
    for key, path in GRID.items():
        cells = [_cells(results) for results in (first, other)]
        wanted, there = (set(map(int, each.loc[each["N_D"] > 0, key])) for each in cells)
        if not wanted & there:
            values = ",".join(map(str, sorted(wanted)))
            remedies.append(f"they have no {key} in common, run the other study with --set {path}=[{values}]")
    return "; ".join(remedies) or pair


def _spans(results: Results) -> str:
    cells = results.cells
    names = {key: ", ".join(map(str, dict.fromkeys(cells[key]))) for key in ("family", "method", "N_D", "seed")}
    return "; ".join(f"{key} {words}" for key, words in names.items())


def _label(part: pd.DataFrame, key: str) -> str:
    here, there = part[key].iloc[0], part[f"{key} there"].iloc[0]
    return str(here) if here == there else f"{here} ~ {there}"


def _windows(first: Results, other: Results) -> tuple[Index, Index, bool, list[str]]:
    """Places of the windows that are judged in each run, whether they are pairs, and a note on it."""
    place = {key: k for k, key in enumerate(_moments(other.test))}
    here = np.array([k for k, key in enumerate(_moments(first.test)) if key in place], dtype=np.int64)
    there = np.array([place[key] for key in _moments(first.test) if key in place], dtype=np.int64)
    if len(here) and (_same_recording(first.test, other.test, here, there) or _same_draws(first.plan, other.plan)):
        common = manoeuvres(len(set(first.test.run[here])))
        all_of = len(here) == len(first.test) == len(other.test)
        text = f"paired over {common}" + ("" if all_of else f", on the {len(here)} windows that both have")
        return here, there, True, [text]
    counts = [len(set(results.test.run)) for results in (first, other)]
    text = f"other test manoeuvres ({counts[1]}, the first has {counts[0]}): not paired, so the intervals are wide"
    return np.arange(len(first.test)), np.arange(len(other.test)), False, [text]


def _moments(test: Windows) -> list[tuple[str, float]]:
    return [(str(run), round(float(t), 4)) for run, t in zip(test.run, test.t, strict=True)]


def _same_recording(one: Windows, two: Windows, here: Index, there: Index) -> bool:
    """Whether windows of the same name and moment hold the same measured motion."""
    names = [name for name in MEASURED if name in one.columns and name in two.columns]
    return all(
        np.allclose(one.columns[name][here], two.columns[name][there], rtol=1e-6, atol=1e-9) for name in names
    ) and bool(names)


def _same_draws(one: Plan, two: Plan) -> bool:
    """Whether two simulated truths draw the same manoeuvres: then runs of one name are pairs, whatever the ship."""
    return drawn_conditions(one) is not None and drawn_conditions(one) == drawn_conditions(two)


@dataclass(frozen=True)
class _Side:
    """One run's part: errors (cells, R) [m] of each group by cell and manoeuvre, and windows (R,)."""

    cells: list[Array]
    counts: Array

    @property
    def errors(self) -> Array:
        """(J, R) mean error of each group in each manoeuvre [m]."""
        return np.stack([errors.mean(axis=0) for errors in self.cells])


def _side(results: Results, groups: Sequence[pd.DataFrame], side: str, windows: Index) -> _Side:
    """Errors of each group of cells in every test manoeuvre, on some windows."""
    test = results.test
    order, place, counts = np.unique(test.run[windows], return_inverse=True, return_counts=True)
    future = test.future[:, windows]

    def by_run(path: Array) -> Array:
        error = over_time(position_error(path[:, windows], future))
        return np.bincount(place, weights=error, minlength=len(order)) / counts

    errors = []
    for part in groups:
        cells = zip(part["N_D"], part[f"cell_{side}"], part[f"foundation_{side}"], strict=True)
        paths = (results.physics[str(name)] if N_D == 0 else results.paths[str(cell)] for N_D, cell, name in cells)
        errors.append(np.stack([by_run(path) for path in paths]))
    return _Side(errors, counts.astype(float))


def _training(groups: Sequence[pd.DataFrame], side: str, alike: Sequence[NDArray[np.bool_]]) -> Array:
    """(J,) standard error [m] that training alone gives a difference; cells that are alike in both runs add nothing."""
    training = np.zeros(len(groups))
    for row, (part, same) in enumerate(zip(groups, alike, strict=True)):
        if not part[f"trained_{side}"].all():
            continue
        cells = part.assign(H=part[f"H_{side}"].astype(float), differs=~same)
        models = [one for _, one in cells.groupby(f"foundation_{side}", sort=False)]
        training[row] = training_error(
            [one["H"].to_numpy() for one in models], [one["differs"].to_numpy() for one in models]
        )
    return training


def _verdicts(compared: Contrasts) -> list[str]:
    """Verdict on each difference, corrected for their number in each direction."""
    if not np.isfinite(compared.below).all():
        return [""] * len(compared)
    lower, higher = shown(compared.below), shown(compared.above)
    return ["lower" if low else "higher" if high else "" for low, high in zip(lower, higher, strict=True)]
