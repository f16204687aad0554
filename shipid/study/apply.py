"""Use a finished cell: its predictor along a log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from shipid.data.causal import causal_columns
from shipid.data.dataset import Dataset, clock_slack, pieces, read_dataset, sample
from shipid.data.windows import Instants, from_frame, past_of
from shipid.errors import DataError, ResultError, choices
from shipid.files import check_table, write_table
from shipid.hybrid.physics import check_columns
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping
from shipid.observer import Estimates, observe
from shipid.predictor import Predictor
from shipid.study import seals
from shipid.study.prepare import states_along
from shipid.study.store import cell_file


def predict_log(folder: Path, cell: str, log: Path, mapping: str | None, out: Path) -> tuple[pd.DataFrame, float]:
    """Write physics and cooperative paths in north-east for every instant of a log.

    Where the predictor takes known commands they are those that the log holds later, and an instant needs them for the
    whole horizon.

    Returns the frame (run, t, ahead [s], physics_north, physics_east, cooperative_north, cooperative_east [m],
    outside) and the share of instants outside the training's limits. Pure data-driven cells have NaN for physics.
    """
    check_table(out)
    predictor = Predictor.load(_known_cell(folder, cell))
    dataset = read_dataset(log) if mapping is None else import_log(read_mapping(mapping), log)
    if predictor.vessel is not None:
        check_columns(predictor.vessel, {name: np.empty(0) for name in map(str, dataset.frame.columns)}, str(log))
    if predictor.causal:
        dataset = causal_columns(dataset, predictor.causal)
    estimates = None
    if predictor.vessel is not None and predictor.physics.observer is not None:
        estimates = observe(predictor.vessel, dataset, predictor.physics.observer)
    parts = [_along(predictor, dataset, run, rows, estimates) for run, rows in pieces(dataset)]
    frame = pd.concat(parts, ignore_index=True)
    if frame.empty:
        raise DataError(_too_short(predictor), file=log)
    write_table(out, frame)
    return frame, float(frame["outside"].mean())


def _too_short(predictor: Predictor) -> str:
    step = predictor.physics.step
    length = predictor.physics.horizon * step
    past = f"the past of {predictor.past * step:g} s" if predictor.past else ""
    plan = f"the horizon of {length:g} s, over which commands are known" if predictor.commands == "known" else ""
    return f"no run is as long as {' and '.join(filter(None, (past, plan)))}"


def _known_cell(folder: Path, cell: str) -> Path:
    available = {file.stem for file in (folder / "cells").glob("*.npz")}
    if not available:
        raise ResultError("holds no finished cells: is it the folder of a run?", file=folder)
    if cell not in available:
        raise ResultError(f"no such cell: {choices(cell, available)}", file=folder, path=f"--cell {cell}")
    file = cell_file(folder, cell)
    fault = next((fault for fault in seals.faults(folder) if folder / fault.file == file), None)
    if fault is not None:
        raise seals.wrong(folder, fault)
    return file


def _along(
    predictor: Predictor, dataset: Dataset, run: str, rows: pd.DataFrame, estimates: Estimates | None
) -> pd.DataFrame:
    """Predictions from every instant of one unbroken stretch that has the past and the plan that they need."""
    physics, t = predictor.physics, rows["t"].to_numpy()
    slack = clock_slack(t)
    first = int((t < t[0] + predictor.past * physics.step - slack).sum())  # earlier instants have no whole past
    last = len(t)
    ahead = physics.step * np.arange(physics.horizon)
    if predictor.commands == "known":
        last = int((t + ahead[-1] <= t[-1] + slack).sum())  # later instants have no whole plan
    count = last - first
    if count <= 0:
        return pd.DataFrame()
    planned = None
    if predictor.commands == "known":
        later = sample(rows, t[first:last] + ahead[:, None])
        planned = {name: later[name] for name in dataset.commands}
    hidden = None if predictor.vessel is None else states_along(predictor.vessel, dataset.commands, rows)
    hidden = hidden and {name: values[first:last] for name, values in hidden.items()}
    columns = {str(name): rows[name].to_numpy()[first:last] for name in rows.columns if name != "run"}
    past = past_of(rows, t[first:last], predictor.past, physics.step, physics.path)
    known = {}
    if estimates is not None:
        places = rows.index.to_numpy()[first:last]
        known = {name: values[places] for name, values in estimates.columns.items()}
    instants = Instants(columns, past, planned, hidden, known)
    origin, steps = (columns["north"], columns["east"], columns["psi"]), physics.horizon
    result = {
        "run": np.full(steps * count, run),
        "t": np.repeat(columns["t"], steps),
        "ahead": np.tile(physics.step * np.arange(1, steps + 1), count),
    }
    alone = predictor.alone(instants)
    predicted = predictor.predict(instants, alone)
    if predictor.vessel is None:
        alone = np.full_like(alone, np.nan)
    for name, path in (("physics", alone), ("cooperative", predicted)):
        north, east = from_frame(path[..., 0], path[..., 1], *origin)
        result[f"{name}_north"], result[f"{name}_east"] = north.T.ravel(), east.T.ravel()
    result["outside"] = np.repeat(predictor.outside(columns), steps)
    return pd.DataFrame(result)
