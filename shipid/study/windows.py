"""Windows of a study for methods of others: what is known at each instant, what the physics says, and what it misses.

The test windows go out without their future unless it is asked for; a score of predictions then says "not blind".
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset, read_dataset
from shipid.data.windows import Windows, from_frame, join_windows
from shipid.errors import ShipidError
from shipid.files import make_folder, write_json, write_table
from shipid.physics.signals import measurable_signals
from shipid.study import store
from shipid.study.foundations import predictions
from shipid.study.plan import Batch, Plan, read_plan
from shipid.study.prepare import obtain_runs, prepare

Array = np.ndarray
TRUTH_RECORD = "test-truth.json"  # in the folder of a run whose test windows went out with their future
TRAIN, TEST = "train", "test"


@dataclass(frozen=True, eq=False)
class StudyWindows:
    """S windows of a study, those of training first; T steps of the horizon, P of the past; SI units, radians.

    Arrays are float64, contiguous, time first, so `torch.from_numpy` takes each as it is.

    windows : run, instant, columns, past and future of each. Orders of the future are those that the study knows, held
        or planned. The future of test windows is NaN where `with_truth` is false.
    split : `train` or `test`, (S,). fold : in which the window validates, -1 for the test, (S,).
    folds : (training, validation) indices of each fold, which share no moment.
    physics : foundation -> path (T, S, 2) [m] in the frame (11); zeros without physics.
    digest : of the study.
    """

    windows: Windows
    split: Array
    fold: Array
    folds: Sequence[tuple[Array, Array]] = field(repr=False)
    physics: Mapping[str, Array] = field(repr=False)
    digest: str
    with_truth: bool

    @property
    def run(self) -> Array:
        """Name of the run, (S,)."""
        return self.windows.run

    @property
    def instant(self) -> Array:
        """Instant of prediction on the clock of the run [s], (S,)."""
        return self.windows.t

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """Names of the last axis of `state`, `past`, `orders` and `wind`."""
        wind, orders = tuple(measurable_signals(self.windows.columns)), tuple(self.windows.planned)
        others = {*wind, *orders, "t", "run", "flags"}
        state = tuple(name for name in self.windows.columns if name not in others)
        return {"state": state, "past": tuple(self.windows.past), "orders": orders, "wind": wind}

    @property
    def state(self) -> Array:
        """State at the instant, (S, d)."""
        return _last_axis(self.windows.columns, self.names["state"], (len(self.windows),))

    @property
    def past(self) -> Array:
        """Columns P, ..., 1 steps before the instant, the oldest first, (P, S, d)."""
        return _last_axis(self.windows.past, self.names["past"], (self.windows.num_past, len(self.windows)))

    @property
    def orders(self) -> Array:
        """Orders from step i-1 to i of the horizon as the study knows them, (T, S, c)."""
        return _last_axis(self.windows.planned, self.names["orders"], (self.windows.horizon, len(self.windows)))

    @property
    def wind(self) -> Array:
        """Wind and other environment at the instant, (S, w)."""
        return _last_axis(self.windows.columns, self.names["wind"], (len(self.windows),))

    @property
    def future(self) -> Array:
        """True path (T, S, 2) [m] in the frame (11)."""
        return self.windows.future

    @property
    def residual(self) -> dict[str, Array]:
        """Foundation -> (T, S, 2) [m], true path less that of the physics: the target of the paper, eqs. 12 and 13."""
        return {name: self.future - paths for name, paths in self.physics.items()}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the tables `windows`, `past`, `future` and `physics`, with the keys `run` and `instant`.

        A row of the last three is a time `ahead` [s] of a window. In `physics` a foundation is a `model`.
        """
        cut, steps = self.windows, _steps_ahead(self.windows)
        now = {name: values for name, values in cut.columns.items() if name not in ("t", "run", "flags")}
        keys = {"run": cut.run, "instant": cut.t, "split": self.split, "fold": self.fold}
        held = {name: np.tile(cut.columns[name], (cut.horizon, 1)) for name in self.names["wind"]}
        residual = self.residual
        models = [
            prediction_table(cut, paths, residual_x=residual[name][..., 0], residual_y=residual[name][..., 1]).assign(
                model=name
            )
            for name, paths in self.physics.items()
        ]
        frames = {
            "windows": pd.DataFrame(keys | now),
            "past": _long_table(cut, cut.step * np.arange(-cut.num_past, 0), cut.past),
            "future": prediction_table(cut, cut.future, **cut.states, **cut.planned, **held),
            "physics": pd.concat(models, ignore_index=True),
        }
        for frame in frames.values():  # Parquet keeps it, and so do copies of a frame
            frame.attrs["shipid"] = {"study": self.digest, "with_truth": self.with_truth}
        return frames if cut.num_past else {name: frame for name, frame in frames.items() if name != "past"}

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the tables as Parquet into a folder; the files. OSError where it cannot be written."""
        make_folder(Path(folder))
        files = {name: Path(folder) / f"{name}.parquet" for name in self.tables()}
        for name, frame in self.tables().items():
            write_table(files[name], frame)
        return list(files.values())


def windows(
    study: Plan | str | os.PathLike[str],
    *,
    N_D: int | None = None,
    seed: int | None = None,
    with_truth: bool = False,
    device: str = "cpu",
) -> StudyWindows:
    """Cut the windows of a study for a method of others: those of one amount of data and seed, and those of the test.

    Parameters
    ----------
    study : a plan, a bundled study, the path of a document, or the folder of a run.
    N_D, seed : amount of data and seed, of the grid; default: the largest amount, the least seed.
    with_truth : whether the test windows hold their future. The folder of a run remembers it, and scores of it are
        "not blind".
    device : PyTorch device of rollouts.

    ShipidError for a study of several parts, and for an amount or a seed that the grid does not have.
    """
    folder = Path(study) if not isinstance(study, Plan) and (Path(study) / store.STUDY).is_file() else None
    plan = study if isinstance(study, Plan) else read_plan(study) if folder is None else store.stored_plan(folder)
    if plan.parts:
        raise ShipidError(f"a study of several parts has windows for each: take that of one, {', '.join(plan.parts)}")
    grid = plan.study.grid
    batch = Batch(max(grid.N_D) if N_D is None else N_D, min(grid.seeds) if seed is None else seed)
    for name, value, known in (("N_D", batch.N_D, grid.N_D), ("seed", batch.seed, grid.seeds)):
        if value not in known:
            raise ShipidError(f"{value} is not in the grid of the study: {', '.join(map(str, known))}", path=name)
    if with_truth and folder is not None:
        write_json(folder / TRUTH_RECORD, {"with_truth": True})
    return _cut_batch(plan, _runs_of(plan, folder), batch, with_truth, device)


def _runs_of(plan: Plan, folder: Path | None) -> Dataset:
    """The runs of a study, as its folder holds them if there are any."""
    stored = folder is not None and (folder / store.DATASET).is_file()
    return read_dataset(folder / store.DATASET) if folder is not None and stored else obtain_runs(plan)


def _cut_batch(plan: Plan, dataset: Dataset, batch: Batch, with_truth: bool, device: str) -> StudyWindows:
    prepared = prepare(plan, dataset, device)
    runs = prepared.runs(batch)
    train = prepared.pool.select(np.isin(prepared.pool.run, runs))
    folds = prepared.folds(batch, train, "runs")
    parts = [
        hide_future(one, plan.study.prediction.known, with_truth or one is train) for one in (train, prepared.test)
    ]
    fold = np.full(sum(map(len, parts)), -1)
    for number, (_, validation) in enumerate(folds):
        fold[validation] = number
    known = predictions(prepared, runs, device)
    return StudyWindows(
        windows=join_windows(parts),
        split=np.repeat([TRAIN, TEST], [len(part) for part in parts]),
        fold=fold,
        folds=folds,
        physics={name: np.concatenate([one.paths, one.test_paths], axis=1) for name, one in known.items()},
        digest=plan.digest,
        with_truth=with_truth,
    )


def hide_future(cut: Windows, known: bool, with_truth: bool) -> Windows:
    """Windows whose orders over the horizon are those at the instant unless they are `known`, without their future."""
    held = {name: np.tile(cut.columns[name], (cut.horizon, 1)) for name in cut.planned}
    cut = cut if known else replace(cut, planned=held)
    hidden = {name: np.full_like(values, np.nan) for name, values in cut.states.items()}
    return cut if with_truth else replace(cut, future=np.full_like(cut.future, np.nan), states=hidden)


def prediction_table(cut: Windows, paths: Array, **columns: Array) -> pd.DataFrame:
    """Paths (T, S, 2) [m] in the frame (11) as a table: run, instant, ahead [s], north, east [m], x, y [m].

    columns : further ones, (T, S). `shipid study score` takes such a table of the test windows.
    """
    now, (x, y) = cut.columns, np.moveaxis(paths, -1, 0)
    north, east = from_frame(x, y, now["north"], now["east"], now["psi"])
    return _long_table(cut, _steps_ahead(cut), {"north": north, "east": east, "x": x, "y": y, **columns})


def _steps_ahead(cut: Windows) -> Array:
    return cut.step * np.arange(1, cut.horizon + 1)


def _long_table(cut: Windows, ahead: Array, columns: Mapping[str, Array]) -> pd.DataFrame:
    """A row for each window and time ahead (K,) [s], window by window; columns (K, S) by name."""
    keys: dict[str, Any] = {"run": np.repeat(cut.run, len(ahead)), "instant": np.repeat(cut.t, len(ahead))}
    keys["ahead"] = np.tile(ahead, len(cut))
    return pd.DataFrame(keys | {name: np.asarray(values).T.ravel() for name, values in columns.items()})


def _last_axis(columns: Mapping[str, Any], names: Sequence[str], shape: tuple[int, ...]) -> Array:
    """Columns of a shape as one array of float64, their names along the last axis."""
    return (
        np.stack([np.asarray(columns[name], dtype=float) for name in names], axis=-1)
        if names
        else np.zeros((*shape, 0))
    )
