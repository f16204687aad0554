"""Every run tests in its turn: how much an answer owes to the choice of the test run."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid import document as documents
from shipid.data.checks import repeated
from shipid.data.dataset import Dataset
from shipid.errors import DocumentError, choices
from shipid.files import make_folder, read_table, sweep, write_table, write_text
from shipid.hybrid.journal import Journal
from shipid.logs.importing import sha256_of
from shipid.study.code import code_digest
from shipid.study.declared import NO_MODEL
from shipid.study.error_table import ErrorTable
from shipid.study.findings import CLAIMS, Rivals, judged
from shipid.study.lock import sole_writer
from shipid.study.plan import (
    Batch,
    Plan,
    families_aside,
    families_set_from,
    judged_method,
    own_code,
    rotated_plan,
    unfair_reason,
    whole_unit,
)
from shipid.study.prepare import all_windows, partition, prepare
from shipid.study.run import run_unit
from shipid.study.verdict import Finding, undecided

KEYS = [
    *("test", "foundation", "family", "method", "N_D", "seed", "A", "H", "H_90"),
    *("coverage", "width", "naive", "status"),
]


def turns(plan: Plan, dataset: Dataset, patterns: Sequence[str]) -> list[str]:
    """Runs with windows that match any pattern, in the order of the dataset; DocumentError where one matches none."""
    cut = all_windows(plan, dataset).spans
    runs = [run for run in dataset.runs if run in cut]
    chosen: set[str] = set()
    for pattern in patterns:
        matching = documents.match(pattern, runs)
        if not matching:
            raise DocumentError(f"{pattern!r} matches no run: {choices(pattern, runs)}", path="--tests")
        chosen.update(matching)
    if len(chosen) < 2:
        message = f"only {chosen.pop()!r} matches: take turns with two or more of {', '.join(runs)}"
        raise DocumentError(message, path="--tests")
    return [run for run in runs if run in chosen]


def copied(plan: Plan, dataset: Dataset) -> str:
    """Say which runs move as others do, so that a turn tests a run that trains; empty where none does."""
    same = repeated(dataset, all_windows(plan, dataset).spans)
    pairs = ", ".join(f"{run!r} as {other!r}" for run, other in same.items())
    words = f"runs that move as others do ({pairs}): where one tests the other trains, so its errors say nothing of new"
    return f"{words} runs: leave out copies" if same else ""


def rotate(
    plan: Plan, dataset: Dataset, tests: Sequence[str], device: str = "cpu", kept: Path | None = None
) -> Iterator[pd.DataFrame]:
    """Set one run aside after the other, train on all others, and yield the cells of each turn, batch by batch.

    A row has test, foundation, family, method, N_D (runs that were left), seed, A, H, H_90 [m], coverage
    [1] and width [m] of the band, naive [m], status. No training window shares a moment with the test run.

    Parameters
    ----------
    kept : folder for what is finished, seed by seed, and for the trials of searches; made where it is not there. The
        same call with the same folder goes on after an interruption, and yields the same digits. None: nothing is kept.
    """
    with nullcontext() if kept is None else _alone_in(kept):
        for test in tests:
            rest, _, _ = partition(rotated_plan(plan, test, 2), dataset)
            turn = rotated_plan(plan, test, len(rest.spans))
            done = {} if kept is None else {batch: _read(_file(kept, test, batch)) for batch in turn.batches}
            if any(done.get(batch) is None for batch in turn.batches):
                yield from _computed(turn, dataset, test, device, kept)
            else:
                yield from (frame for frame in done.values() if frame is not None)


@contextmanager
def _alone_in(kept: Path) -> Iterator[None]:
    """Keep other processes out of a folder of kept turns."""
    make_folder(kept)
    with sole_writer(kept):
        sweep(kept)
        yield


def _computed(turn: Plan, dataset: Dataset, test: str, device: str, kept: Path | None) -> Iterator[pd.DataFrame]:
    """Cells of a turn, batch by batch; those of batches that nobody has computed are, and kept."""
    prepared = prepare(turn, dataset, device)
    floor = float(prepared.naive.mean())

    def computed(batch: Batch, journal: Journal | None = None) -> pd.DataFrame:
        rows = [cell.row for cell in run_unit(turn, prepared, whole_unit(turn, batch), device, journal)]
        return pd.DataFrame([{**row, "test": test, "naive": floor} for row in rows])[KEYS]

    if kept is None:
        yield from (computed(batch) for batch in turn.batches)
        return
    trials = kept / documents.digest(test)
    make_folder(trials)
    for batch in turn.batches:
        file = _file(kept, test, batch)
        frame = _read(file)
        if frame is None:
            frame = computed(batch, Journal(trials / f"{batch.key}.log", study=turn.digest))
            write_table(file, frame)
            write_text(_seal(file), sha256_of(file))
        yield frame


def kept_folder(file: Path, plan: Plan, dataset: Dataset, device: str = "cpu") -> Path:
    """Folder of the finished turns of an interrupted rotation: one for each study, dataset, device and code."""
    vessels = {name: vessel.digest for name, vessel in plan.vessels.items()}  # the digest has them without their names
    decides = [plan.digest, vessels, dataset.digest, device, code_digest(), own_code(plan)]
    return file.with_name(f"{file.name}.turns") / documents.digest(decides)


def forget(kept: Path) -> None:
    """Remove the folder of kept turns, whose table is written."""
    shutil.rmtree(kept, ignore_errors=True)
    with suppress(OSError):  # of another rotation to the same file
        kept.parent.rmdir()


def _file(kept: Path, test: str, batch: Batch) -> Path:
    return kept / f"{documents.digest(test)}-{batch.key}.parquet"


def _seal(file: Path) -> Path:
    """Where the digest of the rows of a batch is, which is written last."""
    return file.with_suffix(".sha256")


def _read(file: Path) -> pd.DataFrame | None:
    """Rows of a batch of a turn; None where it is not finished, or the file is not as it was written."""
    try:
        if _seal(file).read_text(encoding="utf-8") != sha256_of(file):
            return None
        return read_table(file)
    except (OSError, ValueError):
        return None


def spread(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per foundation and method over the turns, seeds averaged: A, H, its range, H_90 [m], turns where H < A."""
    per_turn = _per_turn(frame)
    rows = []
    for (foundation, method), part in per_turn.groupby(["foundation", "method"], sort=False):
        row: dict[str, Any] = {
            "foundation": foundation,
            "method": method,
            "turns": len(part),
            "A": part["A"].mean(),
            "H": part["H"].mean(),
        }
        row |= {"least": part["H"].min(), "greatest": part["H"].max(), "H_90": part["H_90"].mean()}
        row |= {"coverage": part["coverage"].mean(), "width": part["width"].mean()}
        compensated = part["A"].notna().all() and not (part["H"] == part["A"]).all()
        rows.append(row | {"better": (part["H"] < part["A"]).sum() if compensated else np.nan})
    return pd.DataFrame(rows)


def turn_findings(frame: pd.DataFrame, plan: Plan) -> list[Finding]:
    """Verdicts on R1-R4 over the turns, each a test manoeuvre; R4 by the mean over the horizon.

    Turns share training runs and so are not independent: intervals are too narrow rather than too wide. Undecided where
    the numbers of either model were set from runs that test. Nothing without `accurate` and `inaccurate`, or where
    fewer than two turns have what they need.
    """
    claims = plan.study.claims
    if claims is None or claims.accurate is None or claims.inaccurate is None:
        return []
    tests = set(frame["test"])
    if unfair := unfair_reason(plan, tests):
        return undecided(CLAIMS, unfair)
    aside = {*families_aside(plan), *families_set_from(plan, tests)}
    mine = frame[(frame["method"] == judged_method(plan)) & ~frame["family"].isin(aside)]
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
    return judged(Rivals(table, good, bad, steps), remedy="name more runs with --tests")


def _per_turn(frame: pd.DataFrame) -> pd.DataFrame:
    """Means over the seeds of every turn, foundation and method; cells that failed are left out."""
    good = frame[frame["status"] == "ok"].reindex(columns=KEYS)  # frames of older turns have no bands
    keys, numbers = ["test", "foundation", "family", "method"], ["A", "H", "H_90", "coverage", "width", "naive"]
    return good.groupby(keys, sort=False)[numbers].mean().reset_index()
