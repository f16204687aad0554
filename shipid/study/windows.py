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
from shipid.data.dataset import Array, read_dataset
from shipid.data.windows import Windows, join_windows
from shipid.errors import ShipidError
from shipid.files import write_json, write_table
from shipid.foundations.predictions import KEYS, PredictionTable, long_table, prediction_table
from shipid.hybrid.features import earlier_instants
from shipid.physics.signals import measurable_signals
from shipid.study import store
from shipid.study.cells import predictions
from shipid.study.plan import Batch, Plan, read_plan
from shipid.study.prepare import obtain_runs, prepare, steps_before

TRUTH_RECORD = "test-truth.json"  # in the folder of a run whose test windows went out with their future


@dataclass(frozen=True, eq=False)
class StudyWindows:
    """S windows of a study, those of training first; T steps of the horizon, P of the past; SI units, radians.

    windows : past, present and future of each. Orders over the horizon are those that the study knows, held or known.
        The future of test windows is NaN unless they went out `with_truth`.
    keys : a row a window: run, instant [s, clock of the run], split (`train` or `test`), fold (in which it validates,
        -1 for the test). folds : (training, validation) indices of each fold, which share no moment.
    before : numbers of steps before each window at which a method asks the physics, too; the tables then hold these
        instants, their split is `earlier`.
    physics : foundation -> its path (T, S, 2) [m] in the frame (11); zeros without physics; as in `PreparedStudy`.
    """

    windows: Windows
    keys: pd.DataFrame = field(repr=False)
    folds: Sequence[tuple[Array, Array]] = field(repr=False)
    physics: Mapping[str, Array] = field(repr=False)
    with_truth: bool
    before: Sequence[int] = ()

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
            "past": long_table(cut, cut.step * np.arange(-cut.num_past, 0), cut.past),
            "future": prediction_table(cut, cut.future, **cut.states, **cut.planned, **held),
            "physics": pd.concat(models, ignore_index=True),
        }
        for name, keys in (("windows", KEYS[:2]), ("future", KEYS)) if self.before else ():
            rows = pd.concat([frames[name], *(self._earlier_rows(count)[name] for count in sorted(self.before)[::-1])])
            frames[name] = rows[~rows[keys].round(dict.fromkeys(keys[1:], 4)).duplicated()].reset_index(drop=True)
        for frame in frames.values():  # Parquet keeps it, and so do copies of a frame
            frame.attrs["shipid"] = {"with_truth": self.with_truth}
        return frames

    def _earlier_rows(self, count: int) -> dict[str, pd.DataFrame]:
        """Rows of `windows` and `future` for the instants so many steps before each window, with the orders since."""
        cut, names = self.windows, self.names
        then = earlier_instants(cut.instants(), count, cut.step)
        given = {name: cut.past[name][-count:] for name in names["orders"]}
        given |= {name: np.tile(then.columns[name], (count, 1)) for name in names["wind"]}
        now: dict[str, Any] = {"run": cut.run, "instant": then.t, "split": "earlier", "fold": -1}
        now |= {name: then.columns[name] for name in (*names["state"], *names["wind"], *names["orders"])}
        cut = replace(cut, t=now["instant"])
        return {
            "windows": pd.DataFrame(now),
            "future": long_table(cut, cut.step * np.arange(1, count + 1), given),
        }

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
    every: bool = False,
    trust: bool = False,
) -> StudyWindows:
    """Cut the windows of a study for a method of others: those of one amount of data and seed, and those of the test.

    Parameters
    ----------
    study : a plan, a bundled study, the path of a document, or the folder of a run.
    N_D, seed : amount of data and seed, of the grid; default: the largest amount, the least seed.
    with_truth : whether the test windows hold their future. The folder of a run remembers it, and scores of it are
        "not blind".
    device : PyTorch device of rollouts.
    every : windows of all runs, and, `earlier`, the instants before them at which methods ask the physics: what a table
        of `predictions` must hold.
    trust : whether code that the study names may run.

    ShipidError for a study of several parts, and for an amount or a seed that the grid does not have.
    """
    place = (
        Path() if isinstance(study, Plan) else Path(study).parent if Path(study).name == store.STUDY else Path(study)
    )
    folder = place if not isinstance(study, Plan) and (place / store.PROVENANCE).is_file() else None
    plan = (
        study
        if isinstance(study, Plan)
        else read_plan(Path(study), trust=trust)
        if folder is None
        else store.stored_plan(folder, trust)
    )
    if plan.parts:
        raise ShipidError(
            f"has several parts: give the folder parts/{next(iter(plan.parts))} of its run, or of another",
            file=plan.file,
        )
    if every:  # without the tables that are to be made
        plan = replace(
            plan, foundations=tuple(one for one in plan.foundations if not isinstance(one.base, PredictionTable))
        )
    grid = plan.study.grid
    amount = max(grid.N_D) if N_D is None else N_D
    check_choice("N_D", str(amount), map(str, grid.N_D))
    seeds = plan.study.seeds_of(amount)
    batch = Batch(amount, seeds[0] if seed is None else seed)
    check_choice("seed", str(batch.seed), map(str, seeds))
    stored = place / store.DATASET
    prepared = prepare(plan, read_dataset(stored) if folder and stored.is_file() else obtain_runs(plan), device)
    runs, known = tuple(prepared.pool.spans) if every else prepared.runs(batch), plan.study.prediction.known
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
    before = {steps for way in plan.methods for name in way.foundations for steps in steps_before(plan, name)}
    return StudyWindows(cut, keys, folds, paths, with_truth, sorted(before) if every else ())


def hide_future(cut: Windows, known: bool, with_truth: bool) -> Windows:
    """Windows whose orders over the horizon are those at the instant unless they are `known`, without their future."""
    planned = cut.planned if known else {name: np.tile(cut.columns[name], (cut.horizon, 1)) for name in cut.planned}
    shown = 1.0 if with_truth else np.nan
    states = {name: shown * values for name, values in cut.states.items()}
    return replace(cut, planned=planned, future=np.ascontiguousarray(shown * cut.future), states=states)
