"""Each run of a study as the test run in turn: how much an answer owes to the choice of the test run."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import nullcontext, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from shipid import document as documents
from shipid.answer.error_table import ErrorTable
from shipid.answer.findings import FULL_SCALE_RULES, Rivals, judge_rivals
from shipid.answer.verdict import ClaimVerdict, leave_undecided
from shipid.data.dataset import Dataset
from shipid.errors import DocumentError, suggest_name
from shipid.study import store
from shipid.study.code import code_digest
from shipid.study.declared import NO_MODEL
from shipid.study.plan import (
    Plan,
    build_plan,
    families_set_from,
    own_code,
    rotated_plan,
    uncounted_families,
    unfair_reason,
    verdict_method,
)
from shipid.study.prepare import all_windows, partition
from shipid.study.results import read_cells
from shipid.study.run import run_study

TURN_COLUMNS = [
    *("test", "foundation", "family", "method", "N_D", "seed", "A", "H", "H_90"),
    *("coverage", "width", "naive", "status"),
]


def choose_turns(plan: Plan, dataset: Dataset, patterns: Sequence[str]) -> list[str]:
    """Runs with windows that match any pattern, in the order of the dataset; DocumentError where one matches none."""
    cut = all_windows(plan, dataset).spans
    runs = [run for run in dataset.runs if run in cut]
    chosen: set[str] = set()
    for pattern in patterns:
        matching = documents.match_paths(pattern, runs)
        if not matching:
            raise DocumentError(f"{pattern!r} matches no run: {suggest_name(pattern, runs)}", path="--tests")
        chosen.update(matching)
    if len(chosen) < 2:
        message = f"only {chosen.pop()!r} matches: take turns with two or more of {', '.join(runs)}"
        raise DocumentError(message, path="--tests")
    return [run for run in runs if run in chosen]


def rotate_test_runs(
    plan: Plan, dataset: Dataset, tests: Sequence[str], device: str = "cpu", kept: Path | None = None
) -> Iterator[pd.DataFrame]:
    """Set one run aside after the other, train on all others, and yield the cells of each turn.

    A row has test, foundation, family, method, N_D (runs that were left), seed, A, H, H_90 [m], coverage
    [1] and width [m] of the band, naive [m], status. No training window shares a moment with the test run.

    Parameters
    ----------
    kept : folder for the runs of the turns, each a study of its own; made where it is not there. The same call with the
        same folder goes on after an interruption, and yields the same digits. None: nothing is kept.
    """
    with TemporaryDirectory() if kept is None else nullcontext(kept) as place:
        for test in tests:
            rest, _, _ = partition(rotated_plan(plan, test, 2), dataset)
            changes = {"split.test": [test], "grid.N_D": [len(rest.spans)]}
            turn = build_plan(
                documents.replace_values(plan.document, changes), Path(plan.file), plan.vessels, plan.sources
            )
            folder = Path(place) / documents.digest_document(test)
            for _ in run_study(turn, folder, device=device):
                pass
            floor = float(store.read_test(folder)[2].mean())
            yield read_cells(folder).assign(test=test, naive=floor)[TURN_COLUMNS]


def kept_folder(file: Path, plan: Plan, dataset: Dataset, device: str = "cpu") -> Path:
    """Folder of the turns of an interrupted rotation: one for each study, dataset, device and code."""
    vessels = {name: vessel.digest for name, vessel in plan.vessels.items()}  # the digest has them without their names
    decides = [plan.digest, vessels, dataset.digest, device, code_digest(), own_code(plan)]
    return file.with_name(f"{file.name}.turns") / documents.digest_document(decides)


def remove_kept(kept: Path) -> None:
    """Remove the folder of kept turns, whose table is written."""
    shutil.rmtree(kept, ignore_errors=True)
    with suppress(OSError):  # of another rotation to the same file
        kept.parent.rmdir()


def turns_table(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per foundation and method over the turns, seeds averaged: A, H, its range, H_90 [m], turns where H < A."""
    good = frame[frame["status"] == "ok"].reindex(columns=TURN_COLUMNS)  # frames of older turns have no bands
    numbers = ["A", "H", "H_90", "coverage", "width"]
    per_turn = good.groupby(["test", "foundation", "family", "method"], sort=False)[numbers].mean().reset_index()
    rows = []
    for (foundation, method), part in per_turn.groupby(["foundation", "method"], sort=False):
        row: dict[str, Any] = {"foundation": foundation, "method": method, "turns": len(part)}
        row |= {name: part[name].mean() for name in numbers}
        row |= {"least": part["H"].min(), "greatest": part["H"].max()}
        compensated = part["A"].notna().all() and not (part["H"] == part["A"]).all()
        rows.append(row | {"better": (part["H"] < part["A"]).sum() if compensated else np.nan})
    return pd.DataFrame(rows)


def turn_findings(frame: pd.DataFrame, plan: Plan) -> list[ClaimVerdict]:
    """Verdicts on R1-R4 over the turns, each a test manoeuvre; R4 by the mean over the horizon.

    Turns share training runs and so are not independent: intervals are too narrow. UndecidedClaim where
    the numbers of either model were set from runs that test. Nothing without `accurate` and `inaccurate`, or where
    fewer than two turns have what they need.
    """
    claims = plan.study.claims
    if claims is None or claims.accurate is None or claims.inaccurate is None:
        return []
    tests = set(frame["test"])
    if unfair := unfair_reason(plan, tests):
        return leave_undecided(FULL_SCALE_RULES, unfair)
    aside = {*uncounted_families(plan), *families_set_from(plan, tests)}
    mine = frame[(frame["method"] == verdict_method(plan)) & ~frame["family"].isin(aside)]
    good, bad = claims.accurate, claims.inaccurate
    mine = mine.assign(model=mine["family"].where(mine["family"].isin([good, bad]), mine["foundation"]))
    H = mine[mine["status"] == "ok"].pivot_table(index="test", columns=["model", "seed"], values="H")
    models = list(dict.fromkeys(H.columns.get_level_values(0)))
    if any(name not in models for name in (good, bad, NO_MODEL)):
        return []
    H = H.dropna()
    A = mine.pivot_table(index="test", columns="model", values="A").loc[H.index].dropna(axis=1)
    if len(H) < 2:
        return []
    errors = {name: H[name].to_numpy(dtype=float).T[None] for name in models}
    alone = {str(name): values.to_numpy(dtype=float) for name, values in A.items()}
    table = ErrorTable((1,), np.ones(len(H)), alone, errors)
    steps = {name: values[0].mean(axis=0)[None] for name, values in errors.items()}
    steps |= {f"{name} alone": values[None] for name, values in alone.items()}
    return judge_rivals(Rivals(table, good, bad, steps), remedy="name more runs with --tests")
