"""A run's folder, read: its tables, and the paths that its cells predict on the test windows."""

from __future__ import annotations

import os
from collections import UserDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.arguments import as_path
from shipid.data.dataset import Dataset, read_dataset
from shipid.data.windows import Windows
from shipid.errors import DataError, ResultError
from shipid.files import read_arrays, read_json
from shipid.hybrid.bands import Bands
from shipid.metrics import error_by_axis, error_of_windows, position_error, summarise_errors
from shipid.notebooks import NotebookView
from shipid.predictor import check_bands, read_bands
from shipid.study import seals, store
from shipid.study.declared import NO_MODEL
from shipid.study.plan import Plan, families_set_from, model_label, uncounted_families, verdict_method
from shipid.study.prepare import kinds_of_runs

MOST_KEPT = 1000  # predicted paths in memory, of about 1 MB each


class StoredPaths(UserDict[str, Any]):
    """Predicted test paths (T, S, 2) [m] by cell, read from their files when asked for; the latest are kept."""

    def __init__(self, files: Mapping[str, Path]) -> None:
        super().__init__(files)
        self._read = lru_cache(MOST_KEPT)(lambda file: read_arrays(file)["paths"])

    def __getitem__(self, cell: str) -> np.ndarray:
        return self._read(self.data[cell])


@dataclass(frozen=True, repr=False, eq=False)
class Results(NotebookView, shown=("plan.name", "folder", "missing", "table")):
    """A run's folder, read: the plan, one row per cell, models, test windows, and the predictions of every cell.

    naive : errors (T, S) [m] of constant u, v, r. physics : model -> path (T, S, 2) [m] of the physics alone.
    regression, regression_loss : key of a batch -> path (T, S, 2) [m] of a regression on its runs, and its mean squared
        error [m^2] on runs left out.
    paths : cell -> predicted path (T, S, 2) [m] in the frame (11). bands : cell -> its bands, where it has any;
    no_band : cell -> why it has none of the level of the study.
    """

    folder: Path
    plan: Plan
    cells: pd.DataFrame
    models: pd.DataFrame
    test: Windows
    physics: Mapping[str, np.ndarray]
    naive: np.ndarray
    paths: Mapping[str, np.ndarray]
    dataset: Dataset
    provenance: Mapping[str, Any]
    bands: Mapping[str, Bands] = field(default_factory=dict)
    no_band: Mapping[str, str] = field(default_factory=dict)
    regression: Mapping[str, np.ndarray] = field(default_factory=dict)
    regression_loss: Mapping[str, float] = field(default_factory=dict)

    def table(self) -> pd.DataFrame:
        """H [m] of each model, the mean over methods and seeds, at each N_D."""
        return self.cells.pivot_table(index="model", columns="N_D", values="H")

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """One plain dict per cell."""
        return [{str(key): value for key, value in row.items()} for row in self.cells.to_dict("records")]

    @property
    def complete(self) -> bool:
        """Whether every cell of the plan is there."""
        return len(self.cells) == self.plan.cells

    @property
    def missing(self) -> str:
        """How many cells are not finished, in words."""
        return f"{self.plan.cells - len(self.cells)} of {self.plan.cells} cells are not finished"

    @cached_property
    def kinds(self) -> dict[str, str]:
        """Test run -> kind of manoeuvre."""
        return kinds_of_runs(self.dataset, self.test.spans)

    @property
    def aside(self) -> set[str]:
        """Families that are shown, but that no claim and no sentence of the answer counts."""
        return {*uncounted_families(self.plan), *self.saw_test}

    @property
    def saw_test(self) -> set[str]:
        """Families whose numbers rest on test runs: those that the claims set aside, or that name such a run."""
        claims = self.plan.study.claims
        return {*(claims.aside if claims else ()), *families_set_from(self.plan, self.test.spans)}

    @property
    def pool(self) -> int:
        """Runs from which those that train are drawn."""
        return len(self.dataset.runs) - len(self.test.spans)

    @cached_property
    def windows(self) -> np.ndarray:
        """(R,) windows of each test manoeuvre, by name."""
        return np.unique(self.test.run, return_counts=True)[1].astype(float)

    def by_run(self, values: np.ndarray) -> np.ndarray:
        """(R,) means of values of windows (S,) in each test manoeuvre, by name."""
        place = np.unique(self.test.run, return_inverse=True)[1]
        return np.asarray(np.bincount(place, values) / np.bincount(place))

    def path_errors(self, path: np.ndarray) -> np.ndarray:
        """(R,) mean error [m] of a path (T, S, 2) [m] in each test manoeuvre."""
        return self.by_run(error_of_windows(position_error(path, self.test.future)))

    @cached_property
    def errors(self) -> dict[str, np.ndarray]:
        """Cell -> (R,) mean error over the horizon [m] in each test manoeuvre, of every cell with a result."""
        return {cell: self.path_errors(path) for cell, path in self.paths.items()}

    @property
    def judged_cells(self) -> pd.DataFrame:
        """Rows of the cells of the method that findings and the answer speak of; `model` is the foundation."""
        cells = self.cells[self.cells["method"] == verdict_method(self.plan)]
        return cells.assign(model=cells["foundation"])


def read_cells(folder: str | os.PathLike[str]) -> pd.DataFrame:
    """Read one row per finished cell of a run, without its predictors.

    Columns: cell, foundation, family, member, method, model (foundation, with the method where several learn), N_D,
    runs, minutes [min], seed, status, sentence, A_end, A_end_90, A, A_90, A_rms,
    H_end, H_end_90, H, H_90, rms, width [m], coverage [1], seconds [s],
    trials (a list of dicts), and, of a study of several parts, condition and part. Raises ResultError where there is no
    finished cell, or a row is not as it was written.
    """
    folder = as_path("folder", folder)
    plan = store.stored_plan(folder)
    if not plan.parts:
        return _read_part_cells(folder, plan)
    frames = [
        _read_part_cells(place, part.plan).assign(condition=part.condition, part=name)
        for name, part in plan.parts.items()
        if (place := store.check_part(folder, name, part.plan)).is_dir()
        and store.finished_units(place, part.plan.units)
    ]
    if not frames:
        raise ResultError("no cell is finished yet: continue with `shipid study resume`", file=folder)
    return pd.concat(frames, ignore_index=True)


def _read_part_cells(folder: Path, plan: Plan) -> pd.DataFrame:
    """The rows of one run, with the name that figures give their models."""
    seals.check_seals(folder, "batches/")
    cells = store.read_rows(folder, plan)
    labels = [model_label(plan, *pair) for pair in zip(cells["foundation"], cells["method"], strict=True)]
    return cells.assign(model=labels)


def read_results(folder: str | os.PathLike[str], say: Callable[[str], object] | None = None) -> Results:
    """Read a run's folder: its tables, and the path that every cell predicts on every test window.

    say : called with a few words on how far it is.
    """
    folder = as_path("folder", folder)
    plan = store.stored_plan(folder)
    if plan.parts:
        named = ", ".join(str(store.part_folder(Path(), name)) for name in plan.parts)
        raise ResultError(f"holds a study of several parts: read them one by one ({named})", file=folder)
    seals.check_seals(folder)
    cells = _read_part_cells(folder, plan)
    test, physics, naive, regression, losses = store.read_test(folder)
    bands: dict[str, Bands] = {}
    no_band: dict[str, str] = {}
    good = [str(cell) for cell in cells["cell"][cells["status"] == "ok"]]
    for count, cell in enumerate(good, start=1):
        if say is not None:
            say(f"reading cells: {count} of {len(good)}")
        band, reason = read_bands(store.cell_file(folder, cell))
        if band is not None:
            bands[cell] = band
        try:
            check_bands(band, reason, plan.study.bands.level)
        except DataError as error:
            no_band[cell] = error.message
    return Results(
        folder=folder,
        plan=plan,
        cells=cells,
        models=_read_models(folder, physics, test),
        test=test,
        physics=physics,
        naive=naive,
        paths=StoredPaths({cell: store.paths_file(folder, cell) for cell in good}),
        dataset=read_dataset(folder / store.DATASET),
        provenance=store.provenance(folder),
        bands=bands,
        no_band=no_band,
        regression=regression,
        regression_loss=losses,
    )


def _read_models(folder: Path, physics: Mapping[str, np.ndarray], test: Windows) -> pd.DataFrame:
    """One row per model: accuracy [m], also by axis of the frame (11), and on how many windows it diverges, if any."""
    try:
        frame = pd.DataFrame(read_json(folder / store.FOUNDATIONS)).astype(dict.fromkeys(("A", "A_90", "A_rms"), float))
        counts = frame.filter(like="diverged_")
        frame = frame if counts.sum().any() else frame.drop(columns=counts)
        frame["model"] = frame["foundation"]
    except store.STRANGE:
        raise ResultError(store.OF_ANOTHER, file=folder / store.FOUNDATIONS) from None
    diverged = {name: not np.isfinite(path).all() for name, path in physics.items()}
    frame["status"] = ["diverged" if diverged.get(name) else "ok" for name in frame["model"]]
    for name, path in physics.items():
        mine = frame["model"].eq(name)
        if name != NO_MODEL:
            known = summarise_errors(position_error(path, test.future))
            frame.loc[mine, ["A_along", "A_across"]] = error_by_axis(path, test.future)
            frame.loc[mine, ["A_end", "A_end_90"]] = known["end"], known["end_90"]
    return frame.reindex(columns=list(dict.fromkeys([*frame.columns, "A_along", "A_across", "A_end", "A_end_90"])))
