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

from shipid.arguments import check_choice
from shipid.data.dataset import read_dataset
from shipid.data.windows import Windows, from_frame, join_windows
from shipid.errors import ShipidError
from shipid.files import write_json, write_table
from shipid.physics.signals import measurable_signals
from shipid.study import store
from shipid.study.cells import predictions
from shipid.study.plan import Batch, Plan, read_plan
from shipid.study.prepare import obtain_runs, prepare

Array = np.ndarray
TRUTH_RECORD = "test-truth.json"  # in the folder of a run whose test windows went out with their future


@dataclass(frozen=True, eq=False)
class StudyWindows:
    """S windows of a study, those of training first; T steps of the horizon, P of the past; SI units, radians.

    windows : past, present and future of each. Orders over the horizon are those that the study knows, held or known.
        The future of test windows is NaN unless they went out `with_truth`.
    keys : a row a window: run, instant [s, clock of the run], split (`train` or `test`), fold (in which it validates,
        -1 for the test). folds : (training, validation) indices of each fold, which share no moment.
    physics : foundation -> its path (T, S, 2) [m] in the frame (11); zeros without physics; as in `PreparedStudy`.
    """

    windows: Windows
    keys: pd.DataFrame = field(repr=False)
    folds: Sequence[tuple[Array, Array]] = field(repr=False)
    physics: Mapping[str, Array] = field(repr=False)
    with_truth: bool

    @property
    def residual(self) -> dict[str, Array]:
        """Foundation -> (T, S, 2) [m], true path less its own: the target of the paper, eqs. 12 and 13."""
        return {name: self.windows.future - paths for name, paths in self.physics.items()}

    @property
    def names(self) -> dict[str, list[str]]:
        """Names of the last axis of `state`, `wind`, `past` and `orders` of `arrays`."""
        cut, wind = self.windows, measurable_signals(self.windows.columns)
        state = [name for name in cut.columns if name not in {*wind, *cut.planned, "t", "run", "flags"}]
        return {"state": state, "wind": wind, "past": list(cut.past), "orders": list(cut.planned)}

    def arrays(self) -> dict[str, Array]:
        """Return arrays of float64, time first, of which `torch.from_numpy` takes each as it is.

        state (S, d) and wind (S, w) at the instant; past (P, S, e), the oldest first; orders (T, S, c) from step i-1 to
        i; future (T, S, 2) [m] in the frame (11).
        """
        cut = self.windows
        tables: dict[str, Mapping[str, Any]] = {"past": cut.past, "orders": cut.planned}
        return {"future": cut.future} | {
            key: np.ascontiguousarray(np.stack([tables.get(key, cut.columns)[name] for name in names], axis=-1), float)
            for key, names in self.names.items()
            if names
        }

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the tables `windows`, `past`, `future` and `physics`, with the keys `run` and `instant`.

        A row of the last three is a time `ahead` [s] of a window. In `physics` a foundation is a `model`.
        """
        cut, names = self.windows, self.names
        held = {name: np.tile(cut.columns[name], (cut.horizon, 1)) for name in names["wind"]}
        models = [
            prediction_table(cut, self.physics[name], residual_x=missed[..., 0], residual_y=missed[..., 1]).assign(
                model=name
            )
            for name, missed in self.residual.items()
        ]
        now = {name: cut.columns[name] for name in (*names["state"], *names["wind"], *names["orders"])}
        frames = {
            "windows": self.keys.assign(**now),
            "past": _long_table(cut, cut.step * np.arange(-cut.num_past, 0), cut.past),
            "future": prediction_table(cut, cut.future, **cut.states, **cut.planned, **held),
            "physics": pd.concat(models, ignore_index=True),
        }
        for frame in frames.values():  # Parquet keeps it, and so do copies of a frame
            frame.attrs["shipid"] = {"with_truth": self.with_truth}
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
    place = (
        Path() if isinstance(study, Plan) else Path(study).parent if Path(study).name == store.STUDY else Path(study)
    )
    folder = place if not isinstance(study, Plan) and (place / store.PROVENANCE).is_file() else None
    plan = study if isinstance(study, Plan) else read_plan(Path(study)) if folder is None else store.stored_plan(folder)
    if plan.parts:
        raise ShipidError(f"a study of several parts has windows for each: take that of one, {', '.join(plan.parts)}")
    grid = plan.study.grid
    amount = max(grid.N_D) if N_D is None else N_D
    check_choice("N_D", str(amount), map(str, grid.N_D))
    seeds = plan.study.seeds_of(amount)
    batch = Batch(amount, seeds[0] if seed is None else seed)
    check_choice("seed", str(batch.seed), map(str, seeds))
    stored = folder is not None and (folder / store.DATASET).is_file()
    dataset = read_dataset(folder / store.DATASET) if folder is not None and stored else obtain_runs(plan)
    prepared = prepare(plan, dataset, device)
    runs, known = prepared.runs(batch), plan.study.prediction.known
    train = prepared.pool.select(np.isin(prepared.pool.run, runs))
    cut = join_windows([hide_future(train, known, True), hide_future(prepared.test, known, with_truth)])
    folds, fold = prepared.folds(batch, train, "runs"), np.full(len(cut), -1)
    for number, (_, validation) in enumerate(folds):
        fold[validation] = number
    keys = pd.DataFrame({"run": cut.run, "instant": cut.t, "split": np.where(fold < 0, "test", "train"), "fold": fold})
    paths = {
        name: np.ascontiguousarray(np.concatenate([one.paths, one.test_paths], axis=1))
        for name, one in predictions(prepared, runs, device).items()
    }
    if with_truth and folder is not None:
        write_json(folder / TRUTH_RECORD, {"with_truth": True})
    return StudyWindows(cut, keys, folds, paths, with_truth)


def hide_future(cut: Windows, known: bool, with_truth: bool) -> Windows:
    """Windows whose orders over the horizon are those at the instant unless they are `known`, without their future."""
    planned = cut.planned if known else {name: np.tile(cut.columns[name], (cut.horizon, 1)) for name in cut.planned}
    shown = 1.0 if with_truth else np.nan
    states = {name: shown * values for name, values in cut.states.items()}
    return replace(cut, planned=planned, future=np.ascontiguousarray(shown * cut.future), states=states)


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
