"""Each run of a study as the test run in turn: how much an answer owes to the choice of the test run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

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
    matching = {pattern: documents.match_paths(pattern, runs) for pattern in patterns}
    for pattern, matches in matching.items():
        if not matches:
            raise DocumentError(f"{pattern!r} matches no run: {suggest_name(pattern, runs)}", path="--tests")
    return [run for run in runs if any(run in matches for matches in matching.values())]


def rotate_test_runs(
    plan: Plan, dataset: Dataset, tests: Sequence[str], kept: Path, device: str = "cpu"
) -> Iterator[pd.DataFrame]:
    """Set one run aside after the other, train on all others, and yield the cells of each turn.

    A row has test, foundation, family, method, N_D (runs that were left), seed, A, H, H_90 [m], coverage
    [1] and width [m] of the band, naive [m], status. No training window shares a moment with the test run.

    kept : folder for the turns, each a study of its own: the same call goes on after an interruption.
    """
    for test in tests:
        rest, _, _ = partition(rotated_plan(plan, test, 2), dataset)
        changes = {"split.test": [test], "grid.N_D": [len(rest.spans)]}
        document = documents.replace_values(plan.document, changes)
        turn = build_plan(document, Path(plan.file), plan.vessels, plan.sources)
        folder = kept / documents.digest_document(test)
        for _ in run_study(turn, folder, device=device):
            pass
        floor = float(store.read_test(folder)[2].mean())
        yield read_cells(folder).assign(test=test, naive=floor)[TURN_COLUMNS]


def kept_folder(file: Path, plan: Plan, dataset: Dataset, device: str = "cpu") -> Path:
    """Folder of the turns of an interrupted rotation: one for each study, dataset, device and code."""
    vessels = {name: vessel.digest for name, vessel in plan.vessels.items()}  # the digest has them without their names
    decides = [plan.digest, vessels, dataset.digest, device, code_digest(), own_code(plan)]
    return file.with_name(f"{file.name}.turns-{documents.digest_document(decides)}")


def turns_table(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per foundation and method over the turns, seeds averaged: A, H, its range, H_90 [m], turns where H < A."""
    good = frame[frame["status"] == "ok"].reindex(columns=TURN_COLUMNS)  # frames of older turns have no bands
    numbers = ["A", "H", "H_90", "coverage", "width"]
    turns = good.groupby(["test", "foundation", "method"], sort=False)[numbers].mean().reset_index()
    compensated = turns["A"].notna() & turns["H"].ne(turns["A"])
    turns["better"] = turns["H"].lt(turns["A"]).astype(float).where(compensated)
    means = {name: (name, "mean") for name in numbers}
    grouped = turns.groupby(["foundation", "method"], sort=False)
    table = grouped.agg(turns=("test", "size"), **means, least=("H", "min"), greatest=("H", "max"))
    return table.assign(better=grouped["better"].sum(min_count=1)).reset_index()


def turn_findings(frame: pd.DataFrame, plan: Plan) -> list[ClaimVerdict]:
    """Verdicts on R1-R4 over the turns, each a test manoeuvre; R4 by the mean over the horizon.

    Turns share training runs and so are not independent: intervals are too narrow. UndecidedClaim where
    the numbers of either model were set from runs that test. Nothing without `accurate` and `inaccurate`, or where
    fewer than two turns have what they need.
    """
    claims, tests = plan.study.claims, set(frame["test"])
    if claims is None or claims.accurate is None or claims.inaccurate is None:
        return []
    if unfair := unfair_reason(plan, tests):
        return leave_undecided(FULL_SCALE_RULES, unfair)
    aside, rivals = {*uncounted_families(plan), *families_set_from(plan, tests)}, (claims.accurate, claims.inaccurate)
    mine = frame[(frame["method"] == verdict_method(plan)) & ~frame["family"].isin(aside)]
    mine = mine.assign(model=mine["family"].where(mine["family"].isin(rivals), mine["foundation"]))
    good = mine[mine["status"] == "ok"]
    H = good.pivot_table(index="test", columns=["model", "seed"], values="H").dropna()
    models = list(dict.fromkeys(H.columns.get_level_values(0)))
    if not {*rivals, NO_MODEL} <= set(models) or len(H) < 2:
        return []
    A = mine.pivot_table(index="test", columns="model", values="A").loc[H.index].dropna(axis=1)
    errors = {name: H[name].to_numpy(dtype=float).T[None] for name in models}
    alone = {str(name): values.to_numpy(dtype=float) for name, values in A.items()}
    steps = {name: values[0].mean(axis=0)[None] for name, values in errors.items()}
    steps |= {f"{name} alone": values[None] for name, values in alone.items()}
    table = ErrorTable((1,), np.ones(len(H)), alone, errors)
    return judge_rivals(Rivals(table, *rivals, steps), remedy="name more runs with --tests")
