"""From a run's folder to frames: what a report shows, computed from what was stored."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.arguments import path_of
from shipid.data.dataset import Dataset, read_dataset
from shipid.data.windows import Windows
from shipid.errors import DataError, ResultError, ShipidError
from shipid.files import read_arrays, read_json
from shipid.hybrid.bands import Bands, Region
from shipid.metrics import (
    course_over_horizon,
    error_by_axis,
    over_horizon,
    over_horizon_by_axis,
    over_time,
    position_error,
    summary,
)
from shipid.observer import Estimates, observe
from shipid.physics.signals import SIGNALS, read_unit, signal_of
from shipid.predictor import Predictor, checked_bands, read_bands
from shipid.report.selection import FEW_RUNS, spread
from shipid.study import seals, store
from shipid.study.declared import NO_MODEL, Way
from shipid.study.envelope import envelope_table
from shipid.study.kinds import kinds_of
from shipid.study.plan import (
    Plan,
    families_aside,
    families_set_from,
    grid_seeds,
    judged_method,
    learns_from_runs,
    model_label,
    vessels_of,
)
from shipid.study.prepare import constant_motion, instants_of, known_by_then
from shipid.vessel.outline import ship_outline

ALL_KINDS = "all"
MOST_POINTS = 400  # of a track on the map: more than its pixels can show
STRIDE = 20  # cells read between words on how far it is
MOST_KEPT = 2**30  # bytes of predicted paths in memory
CLOCK = 6  # digits after the point of a time in a run [s]
INSTANTS, MOST_WINDOWS = 7, 84  # windows of a test run in the browser, and of all test runs


class StoredPaths(Mapping[str, np.ndarray]):
    """Predicted test paths (T, S, 2) [m] by cell, read from their files when they are asked for.

    The last ones stay in memory, up to `MOST_KEPT`. files : cell -> its file. kept : cell -> paths without a file.
    """

    def __init__(self, files: Mapping[str, Path], kept: Mapping[str, np.ndarray]) -> None:
        self._files, self._kept = files, kept
        self._read: dict[str, np.ndarray] = {}
        self._bytes = 0

    def __getitem__(self, cell: str) -> np.ndarray:
        if cell in self._kept:
            return self._kept[cell]
        if cell not in self._read:
            self._read[cell] = read_arrays(self._files[cell])["paths"]
            self._bytes += self._read[cell].nbytes
            while self._bytes > MOST_KEPT and len(self._read) > 1:
                self._bytes -= self._read.pop(next(iter(self._read))).nbytes
        return self._read[cell]

    def __contains__(self, cell: object) -> bool:
        return cell in self._files or cell in self._kept

    def __iter__(self) -> Iterator[str]:
        return iter((*self._files, *self._kept))

    def __len__(self) -> int:
        return len(self._files) + len(self._kept)


@dataclass(frozen=True, repr=False, eq=False)
class Results:
    """A run's folder, read: the plan, one row per cell, models, test windows, and errors (T, S) of every cell.

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

    def __repr__(self) -> str:
        done = f"{len(self.cells)} of {self.plan.cells} cells"
        return f"<Results of {self.plan.name!r} in {self.folder}: {done}, {len(self.test)} test windows>"

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One plain dict per cell."""
        return [{str(key): value for key, value in row.items()} for row in self.cells.to_dict("records")]

    @property
    def complete(self) -> bool:
        """Whether every cell of the plan is there."""
        return len(self.cells) == self.plan.cells

    @cached_property
    def kinds(self) -> dict[str, str]:
        """Test run -> kind of manoeuvre; the usual speeds come from the other runs."""
        return kinds_of(self.dataset, self.test.spans, test=self.test.spans)

    @property
    def aside(self) -> set[str]:
        """Families that are shown, but that no claim and no sentence of the answer counts."""
        return {*families_aside(self.plan), *self.saw_test}

    @property
    def saw_test(self) -> set[str]:
        """Families whose numbers rest on test runs: those that the claims set aside, or that name such a run."""
        claims = self.plan.study.claims
        return {*(claims.aside if claims else ()), *families_set_from(self.plan, self.test.spans)}

    @property
    def missing(self) -> str:
        """How many cells are not finished, in words."""
        return f"{self.plan.cells - len(self.cells)} of {self.plan.cells} cells are not finished"

    def to_xarray(self) -> Any:
        """Return an `xarray.Dataset` of the metrics [m, 1, s] over foundation, method, N_D and seed; needs xarray.

        Cells that are not there, or have no result, are NaN; `units` and the study's name are attributes.
        """
        if find_spec("xarray") is None:  # pandas makes the dataset
            raise ShipidError("needs xarray, which is not installed: pip install xarray")
        keys = ["foundation", "method", "N_D", "seed"]
        dataset = self.cells.set_index(keys)[list(store.METRICS)].to_xarray()
        for name, unit in store.UNITS.items():
            dataset[name].attrs["units"] = unit
        dataset.attrs.update({"study": self.plan.name, "digest": self.plan.digest})
        return dataset


def read_cells(folder: str | os.PathLike[str]) -> pd.DataFrame:
    """Read one row per finished cell of a run, without its predictors: the quick way from a folder to a table.

    Columns: cell, foundation, family, member, method, model (foundation, with the method where several learn), N_D,
    runs, minutes [min], seed, status, sentence, A, A_90, A_rms, H, H_90, rms, width [m], coverage [1], seconds [s],
    trials (a list of dicts), and, of a study of several parts, condition and part. Raises ResultError for a folder
    without a finished cell, and where a row is not as it was written.
    """
    folder = path_of("folder", folder)
    plan = store.stored_plan(folder)
    if not plan.parts:
        return _cells(folder, plan)
    frames = [
        _cells(place, part.plan).assign(condition=part.condition, part=name)
        for name, part in plan.parts.items()
        if (place := store.check_part(folder, name, part.plan)).is_dir() and store.finished(place, part.plan.units)
    ]
    if not frames:
        raise ResultError("no cell is finished yet: continue with `shipid study resume`", file=folder)
    return pd.concat(frames, ignore_index=True)


def _cells(folder: Path, plan: Plan) -> pd.DataFrame:
    seals.check(folder, "batches/")
    return _labelled(store.read_rows(folder, plan), plan)


def _labelled(cells: pd.DataFrame, plan: Plan) -> pd.DataFrame:
    """The cells with the name that figures give their models."""
    return cells.assign(
        model=[model_label(plan, *pair) for pair in zip(cells["foundation"], cells["method"], strict=True)]
    )


def read_results(folder: str | os.PathLike[str], say: Callable[[str], object] | None = None) -> Results:
    """Read a run's folder: its tables, and the path that every cell predicts on every test window.

    say : called with a few words on how far it is.
    """
    folder = path_of("folder", folder)
    plan = store.stored_plan(folder)
    if plan.parts:
        named = ", ".join(str(store.part_folder(Path(), name)) for name in plan.parts)
        raise ResultError(f"holds a study of several parts: read them one by one ({named})", file=folder)
    seals.check(folder)
    cells = _labelled(store.read_rows(folder, plan), plan)
    test, physics, naive = store.read_test(folder)
    dataset = read_dataset(folder / store.DATASET)
    bands: dict[str, Bands] = {}
    no_band: dict[str, str] = {}
    files: dict[str, Path] = {}
    kept: dict[str, np.ndarray] = {}
    known: dict[str, Estimates] = {}
    good = cells[cells["status"] == "ok"].to_dict("records")
    for count, row in enumerate(good, start=1):
        cell = row["cell"]
        if say is not None and count % STRIDE == 0:
            say(f"reading cells: {count} of {len(good)}")
        file = store.cell_file(folder, cell)
        if store.paths_file(folder, cell).is_file():
            files[cell] = store.paths_file(folder, cell)
            band, reason = read_bands(file)
        else:  # of an earlier version
            predictor = Predictor.load(file)
            alone = physics.get(row["foundation"])  # None where its numbers depend on the cell
            estimates = _observed(predictor, known_by_then(plan.study, dataset), known)
            kept[cell] = predictor.predict(instants_of(plan.study, predictor.vessel, dataset, test, estimates), alone)
            band, reason = predictor.bands, predictor.no_band
        if band is not None:
            bands[cell] = band
        try:
            checked_bands(band, reason, plan.study.bands.level)
        except DataError as error:
            no_band[cell] = error.message
    return Results(
        folder=folder,
        plan=plan,
        cells=cells,
        models=_models(folder, physics, test),
        test=test,
        physics=physics,
        naive=naive,
        paths=StoredPaths(files, kept),
        dataset=dataset,
        provenance=store.provenance(folder),
        bands=bands,
        no_band=no_band,
    )


def _observed(predictor: Predictor, dataset: Dataset, known: dict[str, Estimates]) -> Estimates | None:
    """Estimates of the observer of a predictor along the runs; `known` caches them for predictors of one vessel."""
    if predictor.vessel is None or predictor.physics.observer is None:
        return None
    key = f"{predictor.vessel.digest} {predictor.physics.observer.model_dump_json()}"
    if key not in known:
        known[key] = observe(predictor.vessel, dataset, predictor.physics.observer)
    return known[key]


def _models(folder: Path, physics: Mapping[str, np.ndarray], test: Windows) -> pd.DataFrame:
    """One row per model: accuracy [m], also by axis of the frame (11), and whether it diverged on the test windows."""
    frame = pd.DataFrame(read_json(folder / store.FOUNDATIONS))
    frame["model"] = frame["foundation"]
    for name in ("A", "A_90", "A_rms"):
        frame[name] = frame[name].astype(float)
    diverged = {name: not np.isfinite(path).all() for name, path in physics.items()}
    frame["status"] = ["diverged" if diverged.get(name) else "ok" for name in frame["model"]]
    known = {name: error_by_axis(path, test.future) for name, path in physics.items() if name != NO_MODEL}
    for axis, column in enumerate(("A_along", "A_across")):
        frame[column] = [known[name][axis] if name in known else np.nan for name in frame["model"]]
    return frame


def shown_amounts(results: Results) -> list[int]:
    """Return the N_D that curves and paths are kept for: smallest, middle (of the logarithm) and largest."""
    amounts = sorted(set(results.cells["N_D"]))
    middle = np.sqrt(amounts[0] * amounts[-1])
    return sorted({amounts[0], min(amounts, key=lambda amount: abs(np.log(amount / middle))), amounts[-1]})


def alone_models(results: Results) -> frozenset[str]:
    """Models of the cells whose method learns nothing from data: each is the path of its physics."""
    learning = {way.name for way in results.plan.methods if way.method.compensates}
    return frozenset(row["model"] for row in results.rows if row["method"] not in learning)


def _physics_beside(results: Results) -> list[tuple[str, np.ndarray]]:
    """Finite paths of physics alone that are not those of a cell of that name, too: model, path."""
    alone = alone_models(results)
    known = [(model, path) for model, path in results.physics.items() if model != NO_MODEL and model not in alone]
    return [(model, path) for model, path in known if np.isfinite(path).all()]


def _shown_cells(results: Results) -> list[dict[str, Any]]:
    """Rows of the cells that have paths, at the shown amounts."""
    amounts = shown_amounts(results)
    return [row for row in results.rows if row["cell"] in results.paths and row["N_D"] in amounts]


def horizon_frame(results: Results) -> pd.DataFrame:
    """Mean and 90th percentile error, mean error along x and across [m] and of the course [deg], per step ahead [s].

    Of physics, cooperative models and constant u, v, r; x and y are those of the frame (11).
    """
    parts = [_horizon(results, constant_motion(results.test), "naive", 0, 0, "naive")]
    for model, path in _physics_beside(results):
        parts.append(_horizon(results, path, model, 0, 0, "physics"))
    for row in _shown_cells(results):
        path = results.paths[row["cell"]]
        parts.append(_horizon(results, path, row["model"], row["N_D"], row["seed"], "cooperative"))
    return pd.concat(parts, ignore_index=True)


def kinds_frame(results: Results) -> pd.DataFrame:
    """Mean error over the horizon and at its end [m], by kind of test run: kind, runs, model, source, N_D, mean, end.

    At the largest N_D; over the seeds that have a result. `all` are the test runs of every kind, if there are several.
    """
    kinds = np.array([results.kinds.get(str(run), "") for run in results.test.run])
    errors: dict[tuple[str, str, int], list[np.ndarray]] = {("naive", "naive", 0): [results.naive]}
    for model, path in results.physics.items():
        if model != NO_MODEL and np.isfinite(path).all():
            errors[model, "physics", 0] = [position_error(path, results.test.future)]
    largest = int(results.cells["N_D"].max()) if len(results.cells) else 0
    for row in results.rows:
        with_data = learns_from_runs(results.plan, row["family"], row["method"])
        if row["cell"] in results.paths and row["N_D"] == largest and with_data:
            one = position_error(results.paths[row["cell"]], results.test.future)
            errors.setdefault((row["model"], "cooperative", largest), []).append(one)
    rows = []
    for kind in [*dict.fromkeys(kinds), *([ALL_KINDS] if len(set(kinds)) > 1 else [])]:
        mask = (kinds == kind) | (kind == ALL_KINDS)
        runs = ", ".join(dict.fromkeys(map(str, results.test.run[mask])))
        for (model, source, N_D), distances in errors.items():
            mean = float(np.mean([error[:, mask].mean() for error in distances]))
            end = float(np.mean([error[-1, mask].mean() for error in distances]))
            rows.append(
                {"kind": kind, "runs": runs, "model": model, "source": source, "N_D": N_D, "mean": mean, "end": end}
            )
    return pd.DataFrame(rows, columns=["kind", "runs", "model", "source", "N_D", "mean", "end"])


def _horizon(results: Results, path: np.ndarray, model: str, N_D: int, seed: int, source: str) -> pd.DataFrame:
    true, test = results.test.future, results.test
    keys = {"model": model, "N_D": N_D, "seed": seed, "source": source}
    ahead = test.step * np.arange(1, test.horizon + 1)
    errors = {**over_horizon(position_error(path, true)), **over_horizon_by_axis(path, true)}
    errors["course"] = np.degrees(course_over_horizon(path, true, test.step))
    return pd.DataFrame({**keys, "ahead": ahead, **errors})


def shown_runs(results: Results) -> list[str]:
    """Test runs that figures over time show: of many some at even distances, first and last included."""
    return spread(list(results.test.spans), FEW_RUNS)


def time_frame(results: Results) -> pd.DataFrame:
    """Mean error over the horizon [m] per instant of prediction [s] in the shown test runs, first seed."""
    parts = []
    seed = int(results.cells["seed"].min())
    mask = np.isin(results.test.run, shown_runs(results))

    def add(error: np.ndarray, model: str, N_D: int, source: str) -> None:
        keys = {"run": results.test.run[mask], "t": results.test.t[mask], "model": model, "N_D": N_D, "seed": seed}
        parts.append(pd.DataFrame({**keys, "source": source, "error": over_time(error)[mask]}))

    add(results.naive, "naive", 0, "naive")
    for model, path in _physics_beside(results):
        add(position_error(path, results.test.future), model, 0, "physics")
    for row in _shown_cells(results):
        if row["seed"] == seed:
            add(
                position_error(results.paths[row["cell"]], results.test.future),
                row["model"],
                row["N_D"],
                "cooperative",
            )
    return with_gaps(pd.concat(parts, ignore_index=True), ["run", "model", "N_D", "source"])


def in_the_run(results: Results, frame: pd.DataFrame) -> pd.DataFrame:
    """Rows of runs with the time `t` [s] since the begin of each; other frames as they are.

    Figures are in single precision, in which a clock that counts from 1970 has steps of two minutes.
    """
    if not {"run", "t"} <= set(frame.columns):
        return frame
    begins = results.dataset.frame.groupby("run", sort=False)["t"].min()
    return frame.assign(t=(frame["t"] - frame["run"].map(begins).astype(float)).round(CLOCK))


def with_gaps(frame: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """A row without numbers wherever time jumps within a group, so that no line is drawn across what is not there."""
    step = frame.groupby(keys, sort=False)["t"].diff()
    hole = step > 1.5 * step.median()
    holes = frame[hole].assign(t=frame["t"][hole] - step[hole] / 2)
    numbers = [name for name in frame.columns if name not in keys and frame[name].dtype.kind == "f" and name != "t"]
    holes[numbers] = np.nan
    holes.index = holes.index - 0.5
    return pd.concat([frame, holes]).sort_index(kind="stable").reset_index(drop=True)


def commands_frame(results: Results) -> pd.DataFrame:
    """Commands over time in the shown test runs, in the units of sailors; equal commands are shown once."""
    frame = results.dataset.frame
    frame = frame[frame["run"].isin(shown_runs(results))]
    result = frame[["run", "t"]].reset_index(drop=True)
    shown: dict[str, str] = {}
    for name in results.dataset.commands:
        alike = (other for other in shown if signal_of(other) == signal_of(name))
        twin = next((other for other in alike if np.allclose(frame[other], frame[name], atol=1e-9)), None)
        word = SIGNALS[signal_of(name)].word
        component = name.partition(".")[0].replace("_", " ").removesuffix(word).strip()  # port_rudder, rudder
        if twin is None:
            shown[name] = component
        else:
            shown[twin] += f" and {component}"
    for name, components in shown.items():
        unit, factor = read_unit(name)
        words = f"{components} {SIGNALS[signal_of(name)].word}".strip()
        result[f"{words} [{unit}]"] = frame[name].to_numpy() * factor
    return with_gaps(result, ["run"])


def snapshots(results: Results) -> list[dict[str, Any]]:
    """Windows of the shown test runs, spread over each run, with every model's paths of the first seed."""
    particulars: Mapping[str, float] = next(
        (one.base.document.get("particulars", {}) for one in results.plan.foundations if one.base), {}
    )
    outline = ship_outline(particulars)
    begins = results.dataset.frame.groupby("run", sort=False)["t"].min()
    seed, test = int(results.cells["seed"].min()), results.test
    rows, naive, cells = [], constant_motion(test), _shown_cells(results)
    level, edges, alone = results.plan.study.bands.level, {}, alone_models(results)
    for row in cells:
        bands_of_cell = results.bands.get(row["cell"])
        if bands_of_cell is not None and bands_of_cell.promises(level):
            edges[row["cell"]] = bands_of_cell.region(results.paths[row["cell"]], test.columns, test.step, level)
    for run in shown_runs(results):
        indices = np.flatnonzero(test.run == run)
        most = min(INSTANTS, max(3, MOST_WINDOWS // len(shown_runs(results))))
        for index in indices[np.unique(np.linspace(0, len(indices) - 1, most).round().astype(int))]:
            paths = {
                (model, "physics", 0): path[:, index]
                for model, path in results.physics.items()
                if model not in (NO_MODEL, *alone) and np.isfinite(path[:, index]).all()
            }
            for row in cells:
                if row["seed"] == seed:
                    paths[row["model"], "cooperative", row["N_D"]] = results.paths[row["cell"]][:, index]
            paths["", "naive", 0] = naive[:, index]
            bands = {
                (row["model"], "cooperative", row["N_D"]): border(edges[row["cell"]], results.paths[row["cell"]], index)
                for row in cells
                if row["seed"] == seed and row["cell"] in edges
            }
            origin = np.zeros((1, 2))
            rows.append(
                {
                    "run": run,
                    "t": round(float(test.t[index] - begins[run]), CLOCK),
                    "outline": outline,
                    "psi_end": _final_heading(results, run, float(test.t[index])),
                    "truth": np.concatenate([origin, test.future[:, index]]),
                    "paths": {key: np.concatenate([origin, path]) for key, path in paths.items()},
                    "wind": _wind(test, int(index)),
                    "bands": bands,
                }
            )
    return rows


def border(region: Region, paths: np.ndarray, index: int) -> np.ndarray:
    """Outline (n, 2) [m] of a band in the frame (11): port side, round the last region, and back along starboard."""
    path, ahead = paths[:, index], region.ahead[:, index]
    aside = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    reach = region.across[:, index, None] * aside
    round_ = np.linspace(-np.pi / 2, np.pi / 2, 13)[:, None]
    end = path[-1] + region.along[-1, index] * np.cos(round_) * ahead[-1] + np.sin(round_) * reach[-1]
    origin = np.zeros((1, 2))
    return np.concatenate([origin, path - reach, end, (path + reach)[::-1], origin])


def _final_heading(results: Results, run: str, t: float) -> float:
    rows = results.dataset.frame[results.dataset.frame["run"] == run]
    psi = np.unwrap(rows["psi"].to_numpy())
    end = t + results.test.horizon * results.test.step
    return float(np.interp(end, rows["t"], psi) - np.interp(t, rows["t"], psi))


def _wind(test: Windows, index: int) -> tuple[float, float] | None:
    if "V_w" not in test.columns:
        return None
    columns = test.columns
    return float(columns["V_w"][index]), float(columns["beta_w"][index] - columns["psi"][index])


def tracks_frame(results: Results) -> pd.DataFrame:
    """Path of every run [m] and its part in the study, thinned to what pixels can show."""
    test = set(results.test.spans)
    parts = []
    for run, rows in results.dataset.frame.groupby("run", sort=False):
        thin = rows.iloc[:: max(1, len(rows) // MOST_POINTS)]
        part = "test" if run in test else "training and validation"
        parts.append(pd.DataFrame({"run": run, "set": part, "north": thin["north"], "east": thin["east"]}))
    return pd.concat(parts, ignore_index=True)


def envelope_frame(results: Results) -> pd.DataFrame:
    """Least, mean and greatest input per set, as the paper's Tables 1 and 2; degrees and rpm."""
    return envelope_table(read_json(results.folder / store.ENVELOPE), results.plan.study.published)


def factors_frame(results: Results) -> pd.DataFrame:
    """One row per perturbed number of a model: its path, its group (hull, inertia, ...) and factor; 0 is removed."""
    rows = [
        {"model": model["model"], "path": path, "group": path.partition(".")[0], "factor": float(factor)}
        for model in results.models.to_dict("records")
        for path, factor in (model["factors"].items() if isinstance(model.get("factors"), Mapping) else ())
    ]
    return pd.DataFrame(rows, columns=["model", "path", "group", "factor"])


def trials_frame(results: Results) -> pd.DataFrame:
    """One row per trial of the search, value [m^2], with a column for all that varies; the best trials are `chosen`."""
    methods = {way.name: way.method for way in results.plan.methods}
    searched = list(dict.fromkeys(name for method in methods.values() for name in method.varied()))
    rows = []
    for cell in results.rows:
        done = [trial for trial in cell["trials"] if trial["state"] == "complete" and trial["value"] is not None]
        best = sorted(done, key=lambda trial: trial["value"])[: methods[cell["method"]].num_chosen()]
        for trial in cell["trials"]:
            row = {name: cell[name] for name in ("cell", "model", "N_D", "seed")}
            row |= {name: trial[name] for name in ("number", "state", "value", "epochs", "seconds")}
            row |= {"chosen": trial in best, **{name: trial["params"].get(name) for name in searched}}
            rows.append(row)
    columns = ["cell", "model", "N_D", "seed", "number", "state", "value", "epochs", "seconds", "chosen", *searched]
    return pd.DataFrame(rows, columns=columns).astype(dict.fromkeys(["value", "seconds", *searched], float))


def repairs_frame(results: Results) -> pd.DataFrame:
    """Every repair that the importer made, with its count."""
    rows = results.dataset.metadata.get("repairs", [])
    return pd.DataFrame(rows, columns=["kind", "column", "count", "note"])


def naive_summary(results: Results) -> dict[str, float]:
    """Mean, p90 and rms [m] of constant u, v, r on the test windows."""
    errors = summary(results.naive)
    return {"mean": errors["mean"], "p90": errors["p90"], "rms": errors["rms"]}


def _source_words(source: Any) -> str:
    """Where the runs come from, in one line."""
    if isinstance(source, Mapping):
        return "; ".join(f"{key} {value}" for key, value in source.items())
    return str(source)


def _method_words(way: Way) -> str:
    """A method in a few words: its name, its kind and how much it searches."""
    trials = way.method.num_trials()
    kind = "" if way.kind == way.name else f" ({way.kind})"
    return f"{way.name}{kind}" + (f": {trials} trials" if trials else "")


def judged_cells(results: Results) -> pd.DataFrame:
    """Rows of the cells of the method that findings and the answer speak of; `model` is the foundation."""
    cells = results.cells[results.cells["method"] == judged_method(results.plan)]
    return cells.assign(model=cells["foundation"])


def provenance_words(results: Results) -> dict[str, str]:
    """What the results are based on, as label -> text."""
    record, plan = results.provenance, results.plan
    machine = record.get("machine", {})
    words = {
        "study": f"{results.plan.name}, digest {record['digest']}",
        "vessels": "; ".join(sorted({f"{v.key} {v.digest}" for v in vessels_of(results.plan)})),
        "data": _source_words(results.dataset.metadata.get("source", "")),
        "cells": f"{len(results.cells)} of {results.plan.cells} finished",
        "seeds": ", ".join(map(str, grid_seeds(plan))),
        "methods": "; ".join(_method_words(way) for way in results.plan.methods),
        "computed with": f"Python {machine.get('python', '?')} on {machine.get('system', '?')}, "
        f"{machine.get('cores', '?')} cores",
        "packages": ", ".join(f"{name} {number}" for name, number in machine.get("packages", {}).items()),
        "wall time": f"{record.get('wall_seconds', float('nan')):.0f} s, without interrupted sessions",
    }
    if plan.study.seed:
        words["world"] = f"seed {plan.study.seed}"
    if plan.study.published is not None:
        words["published envelope"] = plan.study.published.source
    redrawn = [row for row in results.models.to_dict("records") if (row.get("counter") or 0) > 0]
    if redrawn:
        words["redrawn"] = "; ".join(f"{row['model']}: counter {int(row['counter'])}" for row in redrawn)
    sessions = record.get("sessions", [])
    changed = [words for one, other in pairwise(sessions) for words in store.differences(one, other)]
    if changed:
        words["computed in parts"] = "; ".join(changed)
    notes = record.get("notes", [])
    if notes:
        words["notes"] = "; ".join(notes)
    return words
