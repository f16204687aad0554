"""Predictions of others on the test windows of a run: read, checked, and kept to be scored."""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from shipid.data.windows import constant_motion
from shipid.errors import DataError
from shipid.files import write_table
from shipid.foundations.faults import Array, doubt_of_places, errors_at_steps, path_of_places
from shipid.foundations.predictions import ordered_places, read_prediction_frame
from shipid.study.plan import grid_seeds
from shipid.study.results import Results
from shipid.study.windows import TRUTH_RECORD

SCORES = "scores"  # folder in that of a run, of the tables that were scored


class RivalPrediction(NamedTuple):
    """A prediction of somebody else on the test windows.

    label : its name, and whether it is `not blind` or `doubtful`; `given` where the study has a method or foundation
        of its name.
    paths : (T, S, 2) [m] in the frame (11).
    N_D, seed : -1 for any. doubt : what seems to be wrong with it, in one sentence; empty where nothing does.
    """

    label: str
    paths: Array
    N_D: int
    seed: int
    doubt: str


def read_predictions(file: Path, results: Results) -> list[RivalPrediction]:
    """Read a table of predictions: run, instant [s], ahead [s], north, east [m], each step of each test window once.

    Columns `model`, `N_D`, `seed` tell several predictions apart.

    Raises DataError for a file that is no table, a missing column, a value that is no number, and for steps that are
    missing, doubled or none of a test window.
    """
    frame = read_prediction_frame(file)
    rivals: list[RivalPrediction] = []
    blind = is_blind(file, frame, results.folder)
    groups = pd.DataFrame({"model": file.stem, "N_D": -1, "seed": -1} | {name: frame[name] for name in frame})
    for name, offered in (("N_D", results.plan.study.grid.N_D), ("seed", grid_seeds(results.plan))):
        if odd := [value for value in pd.unique(groups[name]) if value not in {-1, *offered}]:
            fault = f"{odd[0]} is not of the study: give one of {', '.join(map(str, offered))}, or -1 for any"
            raise DataError(fault, file=file, path=name)
    if groups["model"].isna().any() or not len(groups):
        raise DataError("a row has no name, or there is no row: give each step of each window", file=file, path="model")
    for (model, N_D, seed), part in groups.groupby(["model", "N_D", "seed"], sort=False):
        places = ordered_places(part, results.test, file)
        plan, doubt = results.plan, doubt_of_places(places, results.test, believable_errors(results))
        known = {way.name for way in plan.methods} | {one.name for one in plan.foundations}
        marks = {"not blind": not blind, "doubtful": bool(doubt), "given": str(model) in known}
        words, paths = [word for word, holds in marks.items() if holds], path_of_places(places, results.test)
        label = f"{model} ({', '.join(words)})" if words else str(model)
        rivals.append(RivalPrediction(label, paths, int(float(str(N_D))), int(float(str(seed))), doubt))
    return rivals


def is_blind(file: Path, frame: pd.DataFrame, folder: Path) -> bool:
    """Whether nothing says that the test windows went out with their future.

    What can say so: the folder of the run; a table of windows beside the predictions; and the predictions themselves,
    to which a frame of `StudyWindows` passes it on.
    """
    notes = [frame.attrs.get("shipid")]
    kept = file.parent == folder / SCORES  # it says what was so when it was scored
    for beside in () if kept else file.parent.glob("windows.parquet"):
        with suppress(OSError, ValueError):
            notes.append(pd.read_parquet(beside).attrs.get("shipid"))
    given = any(isinstance(note, dict) and note.get("with_truth") for note in notes)
    return not given and (kept or not (folder / TRUTH_RECORD).is_file())


@lru_cache(maxsize=1)
def believable_errors(results: Results) -> Array:
    """The least mean error (T,) [m] at each step that can be believed.

    That of the cells, of the physics, and of a quadratic law of the state and the orders that is fitted to the test
    itself, which nobody can know.
    """
    test, plain = results.test, constant_motion(results.test)
    values = np.stack([test.columns[name] for name in ("u", "v", "r", *test.planned)]).astype(float)
    values -= values.mean(axis=1, keepdims=True)
    rows = np.concatenate([np.ones((1, len(test))), values, *(values * row for row in values)])
    rows = rows.T / np.maximum(np.abs(rows).max(axis=1), 1e-12)
    missed = (test.future - plain).swapaxes(0, 1)
    law = rows @ np.linalg.lstsq(rows, missed.reshape(len(test), -1), rcond=1e-9)[0]
    fitted = plain + law.reshape(missed.shape).swapaxes(0, 1)
    known = [*results.physics.values(), *results.paths.values(), fitted]
    return np.asarray(np.nanmin([errors_at_steps(path, test) for path in known], axis=0))


def keep_predictions(file: Path, folder: Path) -> None:
    """Keep a table of predictions in the folder of a run, under its name, and whether it was blind.

    One of this name that was kept before is replaced.
    """
    frame = pd.read_parquet(file)
    frame.attrs["shipid"] = {"with_truth": not is_blind(file, frame, folder)}
    write_table(folder / SCORES / f"{file.stem}.parquet", frame)


def kept_predictions(results: Results, but: str = "") -> list[RivalPrediction]:
    """The predictions that the folder of a run keeps, but those of one table; errors as of `read_predictions`."""
    files = [file for file in sorted((results.folder / SCORES).glob("*.parquet")) if file.stem != but]
    return [one for file in files for one in read_predictions(file, results)]
