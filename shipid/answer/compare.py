"""Finished runs compared: what their documents differ in, and errors cell by cell.

Cells are set against those of the first run with the same family, member, method, N_D and seed, on the test windows
that both predict.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid import document as documents
from shipid.answer.verdict import too_few_manoeuvres
from shipid.arguments import as_path
from shipid.document import Document
from shipid.errors import DocumentError, ResultError, ShipidError, suggest_name
from shipid.evidence import CellErrors, compare_cells, which_significant
from shipid.metrics import error_of_windows, position_error, summarise_errors
from shipid.notebooks import NotebookView
from shipid.report.wording import counted_text
from shipid.study.declared import NO_METHOD, NO_MODEL
from shipid.study.plan import Plan, drawn_conditions, fitted_families, learns_from_runs
from shipid.study.results import Results, read_results
from shipid.study.schema import WORLDS, Study

IDENTICAL = "identical"
"""Verdict on cells that err alike to the digit."""
MATCHED_KEYS = ["family", "member", "method", "N_D", "seed"]
MOTION_COLUMNS = ("psi", "u", "v", "r")  # what says whether two windows are the same moment of the same recording
ABSENT = "-"  # shown where a document has no such key


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(NotebookView, shown=("names", "notes", "errors")):
    """Several runs beside the first of them.

    names : of the folders. documents : a row per value that differs: path, and a column of text per name.
    errors : a row per other folder, family, method and N_D (0: the physics alone): `cells` that match, and means over
        them, as H `first` and `other` [m], at the horizon `first_end`, `other_end`, and 90 % quantiles `first_end_90`,
        `other_end_90`; `difference`: by how much H of the other is above [%], with its 95 % interval `low`, `high`,
        `verdict` ("lower", "higher", "identical" to the digit, or empty; corrected for the number of rows),
        `coverage_first`, `coverage_other`.
    notes : sentences on what could not be matched, and what the intervals rest on.
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
    pairs : family or method of the first run -> its counterpart in the others. Equal names match without.

    Raises ResultError for a folder without a result, ShipidError where no cell, or no test manoeuvre, is in both.
    """
    several = isinstance(folders, Sequence) and not isinstance(folders, str)
    places = [as_path("folder", folder) for folder in folders] if several else []
    if len(places) < 2 or len({place.resolve() for place in places}) < len(places):
        raise ShipidError("name two folders or more, each once", path="folders")
    return compare_results([read_results(place) for place in places], pairs)


def compare_results(runs: Sequence[Results], pairs: Mapping[str, str] | None = None) -> Comparison:
    """Set the cells of runs that have been read beside those of the first: `compare` without its folders."""
    _check_pairs(runs, pairs or {})
    folders, notes, frames = [results.folder.resolve() for results in runs], [], []
    called = {other: first for first, other in (pairs or {}).items()}
    shared = os.path.commonpath(folders)
    names = tuple(str(folder.relative_to(shared)) for folder in folders)
    for name, results in zip(names, runs, strict=True):
        good = int((results.cells["status"] == "ok").sum())
        if not good:
            raise ResultError("has no cell with a result", file=results.folder)
        if good < results.plan.cells:
            notes.append(f"{name}: {good} of {results.plan.cells} cells have a result")
        if results is not runs[0]:
            frame, words = _compare_with_first(runs[0], results, called)
            frames.append(frame.assign(folder=name))
            notes += [f"{name}: {note}" for note in words]
    documents = document_differences([results.plan for results in runs], [{}, *[called] * len(frames)])
    documents.columns = pd.Index(["path", *names])
    errors = pd.concat(frames, ignore_index=True)
    return Comparison(names, documents, errors[["folder", *errors.columns.drop("folder")]], tuple(notes))


def _check_pairs(runs: Sequence[Results], pairs: Mapping[str, str]) -> None:
    """DocumentError for a name that is no family or method of the first run, or a counterpart that no other run has."""
    first, *others = ({*results.cells["family"], *results.cells["method"], NO_METHOD} for results in runs)
    for words, named, known in (
        ("the first run", pairs, first),
        ("any other run", pairs.values(), set().union(*others)),
    ):
        for name in named:
            if name not in known:
                message = f"{name!r} is no family or method of {words}: {suggest_name(name, known)}"
                raise DocumentError(message, path="--pair")


def _compare_with_first(first: Results, other: Results, called: Mapping[str, str]) -> tuple[pd.DataFrame, list[str]]:
    """Rows of `Comparison.errors` for one run, without its name, and notes; called : its names -> the first's."""
    mine, others, notes, named = _matching_cells(first), _matching_cells(other), [], set(called.values())
    for key in ("family", "method"):
        names = others[key].map(lambda name: called.get(name, name if name not in named else None))
        others = others.assign(**{key: names, f"{key} there": others[key]})
        for who, one, rest in (("the first", mine, others), ("this", others, mine)):
            if lonely := [name for name in dict.fromkeys(one[key].dropna()) if name not in set(rest[key])]:
                notes.append(f"only {who} has {key} {', '.join(lonely)} (--pair FIRST=OTHER names counterparts)")
    both = mine.merge(others, on=MATCHED_KEYS, suffixes=("_first", "_other")).sort_values("N_D", kind="stable")
    if not (both["N_D"] > 0).any():
        raise ShipidError(
            f"no cell of {other.folder} matches one of {first.folder}: {_keys_in_words(first)}; there: "
            f"{_keys_in_words(other)}; name counterparts by --pair FIRST=OTHER, or run the other study with the same "
            "grid by --set grid.N_D=... --set grid.seeds=..."
        )
    here, away = _common_windows(first, other)
    rows, differences = [], []
    for _, part in both.groupby(["family", "method", "N_D"], sort=False):
        means, mine_cells = _cell_errors(first, part, "first", here)
        means_there, other_cells = _cell_errors(other, part, "other", away)
        sides = {"first": mine_cells, "other": other_cells}
        difference = compare_cells(sides["other"], sides["first"])
        same = all(np.array_equal(a.errors, b.errors) for a, b in zip(*sides.values(), strict=True))
        rows.append(
            {
                **{key: " ~ ".join(dict.fromkeys(part[[key, f"{key} there"]].iloc[0])) for key in ("family", "method")},
                "N_D": int(part["N_D"].iloc[0]),
                "cells": len(part),
                **means,
                **means_there,
                "difference": difference.mean,
                "low": difference.low,
                "high": difference.high,
                "verdict": IDENTICAL if same else "",
                **{f"coverage_{side}": part[f"coverage_{side}"].mean() for side in sides},
            }
        )
        differences.append(difference)
    for verdict, side in (("lower", "below"), ("higher", "above")):
        shown = which_significant(np.array([getattr(difference, side) for difference in differences]))
        rows = [
            row | {"verdict": verdict} if sure and not row["verdict"] else row
            for row, sure in zip(rows, shown, strict=True)
        ]
    same_rows, runs = sum(row["verdict"] == IDENTICAL for row in rows), len(set(first.test.run[here]))
    whole = len(here) == len(first.test) == len(other.test)
    notes.append(
        f"paired over {counted_text(runs, 'test manoeuvre')}{'' if whole else f', on the {len(here)} windows of both'}"
    )
    if same_rows:
        notes.append(f"{same_rows} of {len(rows)} rows are identical to the digit: no training sets them apart")
    return pd.DataFrame(rows), [*notes, *([few] if (few := too_few_manoeuvres(runs)) else [])]


def _matching_cells(results: Results) -> pd.DataFrame:
    """Keys, predictor and band of every cell with a result; one more row per foundation for A, where it is known."""
    columns = ["cell", "foundation", *MATCHED_KEYS, "coverage"]
    good = results.cells[results.cells["status"] == "ok"].reindex(columns=columns)
    good = good.assign(seed=good["seed"] - WORLDS * results.plan.study.seed)
    known = [name for name, path in results.physics.items() if name != NO_MODEL and np.isfinite(path).all()]
    alone = results.cells.drop_duplicates("foundation").reindex(columns=columns)
    alone = alone[alone["foundation"].isin(known) & ~alone["family"].isin(fitted_families(results.plan))]
    alone = alone.assign(cell="", method=NO_METHOD, N_D=0, seed=0, coverage=np.nan)
    return pd.concat([alone, good], ignore_index=True).astype({"coverage": float})


def _keys_in_words(results: Results) -> str:
    names = {key: ", ".join(map(str, dict.fromkeys(results.cells[key]))) for key in ("family", "method", "N_D", "seed")}
    return "; ".join(f"{key} {words}" for key, words in names.items())


def _common_windows(first: Results, other: Results) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Places of the windows that both runs have; ShipidError where there are none, or they are other recordings."""
    one, two = (
        pd.Series(range(len(of)), pd.MultiIndex.from_arrays([of.run.astype(str), of.t.astype(float).round(4)]))
        for of in (first.test, other.test)
    )
    keys = one.index[one.index.isin(two.index)]
    here, there = (np.asarray(of[keys], dtype=np.int64) for of in (one, two))
    columns = [(first.test.columns[name][here], other.test.columns[name][there]) for name in MOTION_COLUMNS]
    same = all(np.allclose(a, b, rtol=1e-6, atol=1e-9) for a, b in columns)
    drawn = drawn_conditions(first.plan)  # the same orders, whatever the ship
    if not len(here) or not (same or (drawn is not None and drawn == drawn_conditions(other.plan))):
        raise ShipidError(f"tests on other manoeuvres than {first.folder}: nothing can be paired", file=other.folder)
    return here, there


def _cell_errors(
    results: Results, part: pd.DataFrame, side: str, windows: NDArray[np.int64]
) -> tuple[dict[str, float], list[CellErrors]]:
    """Mean errors [m] of the cells of a group on some windows, named by the side, and their errors by manoeuvre."""
    test, cells, known = results.test, [], []
    _, place, counts = np.unique(test.run[windows], return_inverse=True, return_counts=True)
    rows = results.cells.set_index("cell")[["family", "method"]]
    for cell, foundation, seed in zip(part[f"cell_{side}"], part[f"foundation_{side}"], part["seed"], strict=True):
        path = results.paths[str(cell)] if cell else results.physics[str(foundation)]
        errors = position_error(path[:, windows], test.future[:, windows])
        known.append(summarise_errors(errors))
        error = error_of_windows(errors)
        learns = bool(cell) and learns_from_runs(results.plan, *rows.loc[cell])
        by_run, share = np.bincount(place, error) / counts, int(part["N_D"].iloc[0]) / results.pool
        cells.append(CellErrors(str(foundation), by_run, counts.astype(float), learns, "", seed, share))
    means = {side: float(np.mean([cell.mean for cell in cells]))}
    means |= {f"{side}_end": float(np.mean([one["end"] for one in known]))}
    means |= {f"{side}_end_90": float(np.mean([one["end_90"] for one in known]))}
    return means, cells


def whole_document(plan: Plan, called: Mapping[str, str] | None = None) -> Document:
    """Return the study of a plan with every default; methods, families and conditions go by name, not by place.

    called : method or family -> the name that it goes by here instead.
    """
    study = documents.parse_model(Study, plan.document, plan.file)
    document: Document = study.model_dump(mode="json")
    for block, way in zip(document["method"], plan.methods, strict=True):
        block |= way.method.model_dump(mode="json")
    for key in ("method", "family", "condition"):
        document[key] = {(called or {}).get(entry["name"], entry["name"]): entry for entry in document[key]}
    return document


def document_differences(plans: Sequence[Plan], called: Sequence[Mapping[str, str]] = ()) -> pd.DataFrame:
    """One row per value that is not the same in all plans: `path`, then a column of text for each plan, from 0 on.

    Compared are studies with their defaults, vessels that all have, and digests of data. called : see `whole_document`.
    """
    shared = set.intersection(*({*plan.vessels} for plan in plans))
    whole = [
        {
            **whole_document(plan, names),
            "digest of": dict(plan.sources),
            "vessel": {name: {"digest": plan.vessels[name].digest, **plan.vessels[name].document} for name in shared},
        }
        for plan, names in zip(plans, called or [{}] * len(plans), strict=True)
    ]
    rows = [
        [path, *(ABSENT if one is None else one if isinstance(one, str) else json.dumps(one) for one in values)]
        for path, values in _differing_values(whole, "")
    ]
    return pd.DataFrame(rows, columns=["path", *map(str, range(len(plans)))])


def _differing_values(values: Sequence[Any], path: str) -> Iterator[tuple[str, Sequence[Any]]]:
    """Dotted path and values where they are not all equal, as deep as all of them have tables."""
    if all(isinstance(value, list) and value and isinstance(value[0], Mapping) for value in values):
        values = [{str(place): entry for place, entry in enumerate(value)} for value in values]
    if all(isinstance(value, Mapping) for value in values):
        for key in dict.fromkeys(key for value in values for key in value):
            yield from _differing_values([value.get(key) for value in values], f"{path}.{key}".removeprefix("."))
    elif any(value != values[0] for value in values):
        yield path, values
