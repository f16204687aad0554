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

from shipid.data.dataset import read_dataset
from shipid.data.windows import Windows, from_frame, join_windows
from shipid.errors import ShipidError
from shipid.files import write_json, write_table
from shipid.physics.signals import measurable_signals
from shipid.study import store
from shipid.study.foundations import predictions
from shipid.study.plan import Batch, Plan, read_plan
from shipid.study.prepare import PreparedStudy, obtain_runs, prepare

Array = np.ndarray
TRUTH_RECORD = "test-truth.json"  # in the folder of a run whose test windows went out with their future


@dataclass(frozen=True, eq=False)
class StudyWindows:
    """S windows of a study, those of training first; T steps of the horizon, P of the past; SI units, radians.

    Arrays are float64, contiguous, time first, so `torch.from_numpy` takes each as it is.

    run, instant [s, clock of the run], split (`train` or `test`), fold (in which the window validates, -1 for the
    test) : the keys, (S,). folds : (training, validation) indices of each fold, which share no moment.
    state : at the instant, (S, d). past : columns P, ..., 1 steps before, the oldest first, (P, S, e).
    orders : from step i-1 to i of the horizon, held or known as in the study, (T, S, c).
    wind : and other environment at the instant, (S, w).
    names : names of the last axis of `state`, `past`, `orders` and `wind`.
    future : true path (T, S, 2) [m] in the frame (11); NaN for the test unless it went out `with_truth`.
    physics : foundation -> its path (T, S, 2) [m]; zeros without physics.
    residual : foundation -> future less that path, the target of the paper, eqs. 12 and 13.
    windows : the same as `Windows`, for methods of shipid. digest : of the study.
    """

    run: Array = field(repr=False)
    instant: Array = field(repr=False)
    split: Array = field(repr=False)
    fold: Array = field(repr=False)
    folds: Sequence[tuple[Array, Array]] = field(repr=False)
    state: Array = field(repr=False)
    past: Array = field(repr=False)
    orders: Array = field(repr=False)
    wind: Array = field(repr=False)
    names: Mapping[str, tuple[str, ...]]
    future: Array = field(repr=False)
    physics: Mapping[str, Array] = field(repr=False)
    residual: Mapping[str, Array] = field(repr=False)
    windows: Windows = field(repr=False)
    digest: str
    with_truth: bool

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the tables `windows`, `past`, `future` and `physics`, with the keys `run` and `instant`.

        A row of the last three is a time `ahead` [s] of a window. In `physics` a foundation is a `model`.
        """
        cut = self.windows
        keys = {"run": self.run, "instant": self.instant, "split": self.split, "fold": self.fold}
        held = {name: np.tile(cut.columns[name], (cut.horizon, 1)) for name in self.names["wind"]}
        missed = {name: dict(zip("xy", np.moveaxis(one, -1, 0), strict=True)) for name, one in self.residual.items()}
        models = [
            prediction_table(cut, paths, **{f"residual_{axis}": missed[name][axis] for axis in "xy"}).assign(model=name)
            for name, paths in self.physics.items()
        ]
        frames = {
            "windows": pd.DataFrame(keys | {name: cut.columns[name] for name in _measured_names(cut)}),
            "past": _long_table(cut, cut.step * np.arange(-cut.num_past, 0), cut.past),
            "future": prediction_table(cut, cut.future, **cut.states, **cut.planned, **held),
            "physics": pd.concat(models, ignore_index=True),
        }
        for frame in frames.values():  # Parquet keeps it, and so do copies of a frame
            frame.attrs["shipid"] = {"study": self.digest, "with_truth": self.with_truth}
        return frames

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the tables as Parquet into a folder; the files. OSError where it cannot be written."""
        tables = {Path(folder) / f"{name}.parquet": frame for name, frame in self.tables().items()}
        for file, frame in tables.items():
            write_table(file, frame)
        return list(tables)


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
    plan = study if isinstance(study, Plan) else read_plan(Path(study)) if folder is None else store.stored_plan(folder)
    if plan.parts:
        raise ShipidError(f"a study of several parts has windows for each: take that of one, {', '.join(plan.parts)}")
    grid = plan.study.grid
    batch = Batch(max(grid.N_D) if N_D is None else N_D, min(grid.seeds) if seed is None else seed)
    for name, value, known in (("N_D", batch.N_D, grid.N_D), ("seed", batch.seed, grid.seeds)):
        if value not in known:
            raise ShipidError(f"{value} is not in the grid of the study: {', '.join(map(str, known))}", path=name)
    stored = folder is not None and (folder / store.DATASET).is_file()
    dataset = read_dataset(folder / store.DATASET) if folder is not None and stored else obtain_runs(plan)
    if with_truth and folder is not None:
        write_json(folder / TRUTH_RECORD, {"with_truth": True})
    return _cut_batch(prepare(plan, dataset, device), plan.digest, batch, with_truth, device)


def _cut_batch(prepared: PreparedStudy, digest: str, batch: Batch, with_truth: bool, device: str) -> StudyWindows:
    runs, known = prepared.runs(batch), prepared.study.prediction.known
    train = prepared.pool.select(np.isin(prepared.pool.run, runs))
    folds = prepared.folds(batch, train, "runs")
    cut = join_windows([hide_future(train, known, True), hide_future(prepared.test, known, with_truth)])
    fold = np.full(len(cut), -1)
    for number, (_, validation) in enumerate(folds):
        fold[validation] = number
    wind, orders = tuple(measurable_signals(cut.columns)), tuple(cut.planned)
    state = tuple(name for name in _measured_names(cut) if name not in {*wind, *orders})
    names = {"state": state, "past": tuple(cut.past), "orders": orders, "wind": wind}
    physics = {
        name: np.concatenate([one.paths, one.test_paths], axis=1)
        for name, one in predictions(prepared, runs, device).items()
    }
    return StudyWindows(
        run=cut.run,
        instant=cut.t,
        split=np.repeat(["train", "test"], [len(train), len(prepared.test)]),
        fold=fold,
        folds=folds,
        state=_last_axis(cut.columns, state, (len(cut),)),
        past=_last_axis(cut.past, names["past"], (cut.num_past, len(cut))),
        orders=_last_axis(cut.planned, orders, (cut.horizon, len(cut))),
        wind=_last_axis(cut.columns, wind, (len(cut),)),
        names=names,
        future=cut.future,
        physics=physics,
        residual={name: cut.future - paths for name, paths in physics.items()},
        windows=cut,
        digest=digest,
        with_truth=with_truth,
    )


def _measured_names(cut: Windows) -> list[str]:
    """Names of the columns that hold what is measured."""
    return [name for name in cut.columns if name not in ("t", "run", "flags")]


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
    steps = cut.step * np.arange(1, cut.horizon + 1)
    return _long_table(cut, steps, {"north": north, "east": east, "x": x, "y": y, **columns})


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
