"""From results to frames: what the figures and tables of a report show, in the units that they are labelled with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.windows import constant_motion
from shipid.hybrid.bands import Region
from shipid.metrics import (
    PREDICTION_ERRORS,
    course_over_horizon,
    error_at_horizon,
    error_of_windows,
    position_error,
    summarise_errors,
)
from shipid.physics.signals import SIGNALS, read_unit, signal_of
from shipid.report import WindowSnapshot
from shipid.report.content import TRIAL_COLUMNS, PathKey, model_text
from shipid.report.figure import ship_outline
from shipid.report.selection import FEW_RUNS, figure_sizes, spread_items
from shipid.study import store
from shipid.study.declared import NO_MODEL, StudyMethod
from shipid.study.plan import grid_seeds, learns_from_runs, vessels_of
from shipid.study.results import Results

ALL_KINDS = "all"
CLOCK = 6  # digits after the point of a time in a run [s]
INSTANTS, MOST_WINDOWS = 7, 84  # windows of a test run in the browser, and of all test runs


def figure_runs(results: Results) -> list[str]:
    """Test runs that figures over time show: of many some at even distances, first and last included."""
    return spread_items(list(results.test.spans), FEW_RUNS)


def alone_models(results: Results) -> frozenset[str]:
    """Models of the cells whose method learns nothing from data: each is the path of its physics."""
    learning = {way.name for way in results.plan.methods if way.method.compensates}
    return frozenset(row["model"] for row in results.rows if row["method"] not in learning)


def _finite_physics(results: Results) -> dict[str, np.ndarray]:
    """Paths of physics alone that diverge in no window, by model."""
    return {m: path for m, path in results.physics.items() if m != NO_MODEL and np.isfinite(path).all()}


def _figure_paths(results: Results) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """Keys of a curve and its path: physics alone, where no cell has the same name, and the cells of shown amounts."""
    alone, amounts = alone_models(results), figure_sizes(results.cells["N_D"])
    for model, path in _finite_physics(results).items():
        if model not in alone:
            yield {"model": model, "N_D": 0, "seed": 0, "source": "physics"}, path
    for row in results.rows:
        if row["cell"] in results.paths and row["N_D"] in amounts:
            keys = {name: row[name] for name in ("model", "N_D", "seed")}
            yield keys | {"source": "cooperative"}, results.paths[row["cell"]]


def horizon_frame(results: Results) -> pd.DataFrame:
    """Mean and 90th percentile error, mean error along x and across [m] and of the course [deg], per step ahead [s].

    Of physics, cooperative models and constant u, v, r; x and y are those of the frame (11).
    """
    true, test = results.test.future, results.test
    ahead, curves, parts = test.step * np.arange(1, test.horizon + 1), [], []
    naive = {"model": "naive", "N_D": 0, "seed": 0, "source": "naive"}, constant_motion(test)
    for keys, path in (naive, *_figure_paths(results)):
        error, (along, across) = position_error(path, true), np.abs(path - true).mean(axis=1).T
        course = np.degrees(course_over_horizon(path, true, test.step))
        parts.append([ahead, error.mean(axis=1), np.quantile(error, 0.9, axis=1), along, across, course])
        curves += [keys] * len(ahead)
    names = ["ahead", "mean", "p90", "along", "across", "course"]
    return pd.DataFrame(curves).assign(**dict(zip(names, np.concatenate(parts, axis=1), strict=True)))


def time_frame(results: Results) -> pd.DataFrame:
    """Mean error over the horizon [m] per instant of prediction [s] in the shown test runs, first seed."""
    test, seed, mask = results.test, int(results.cells["seed"].min()), np.isin(results.test.run, figure_runs(results))
    curves = [({"model": "naive", "N_D": 0, "source": "naive"}, results.naive)]
    for keys, path in _figure_paths(results):
        if keys["seed"] == seed or keys["source"] == "physics":
            curves.append((keys, position_error(path, test.future)))
    columns = ["run", "t", "model", "N_D", "seed", "source", "error"]
    parts = [
        pd.DataFrame(
            {"run": test.run[mask], "t": test.t[mask], **keys, "seed": seed, "error": error_of_windows(error)[mask]}
        )
        for keys, error in curves
    ]
    frame = insert_gaps(pd.concat(parts, ignore_index=True)[columns], ["run", "model", "N_D", "source"])
    return count_from_start(results, frame)


def kinds_frame(results: Results) -> pd.DataFrame:
    """Mean error over the horizon and at its end [m], by kind of test run: kind, runs, model, source, N_D, mean, end.

    At the largest N_D; over the seeds that have a result. `all` are the test runs of every kind, if there are several.
    """
    test, kinds = results.test, np.array([results.kinds.get(str(run), "") for run in results.test.run])
    errors = {("naive", "naive", 0): [results.naive]}
    for model, path in _finite_physics(results).items():
        errors[model, "physics", 0] = [position_error(path, test.future)]
    for row in results.rows:
        learns = learns_from_runs(results.plan, row["family"], row["method"])
        if learns and row["cell"] in results.paths and row["N_D"] == results.cells["N_D"].max():
            error = position_error(results.paths[row["cell"]], test.future)
            errors.setdefault((row["model"], "cooperative", int(row["N_D"])), []).append(error)
    rows = []
    for kind in [*dict.fromkeys(kinds), *([ALL_KINDS] if len(set(kinds)) > 1 else [])]:
        mask = (kinds == kind) | (kind == ALL_KINDS)
        runs = ", ".join(dict.fromkeys(map(str, test.run[mask])))
        for keys, distances in errors.items():
            parts = [error[:, mask] for error in distances]
            ends = np.mean([error_at_horizon(part).mean() for part in parts])
            rows.append((kind, runs, *keys, np.mean([part.mean() for part in parts]), ends))
    return pd.DataFrame(rows, columns=["kind", "runs", "model", "source", "N_D", "mean", "end"])


def regression_frame(results: Results) -> pd.DataFrame:
    """Errors [m] of the regressions, mean over draws: N_D, H_end, H_end_90, H, H_90, rms."""
    names, rows = {**PREDICTION_ERRORS, "rms": "rms"}, []
    for batch in results.plan.batches:
        if (path := results.regression.get(batch.key)) is not None:
            known: Mapping[str, Any] = summarise_errors(position_error(path, results.test.future))
            rows.append({"N_D": batch.N_D, **{name: known[key] for name, key in names.items()}})
    return pd.DataFrame(rows, columns=["N_D", *names]).groupby("N_D", as_index=False).mean()


def count_from_start(results: Results, frame: pd.DataFrame) -> pd.DataFrame:
    """Rows of runs with the time `t` [s] since the begin of each.

    Figures are in single precision, in which a clock that counts from 1970 has steps of two minutes.
    """
    begins = results.dataset.frame.groupby("run", sort=False)["t"].min()
    return frame.assign(t=(frame["t"] - frame["run"].map(begins).astype(float)).round(CLOCK))


def insert_gaps(frame: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """A row without numbers wherever time jumps within a group, so that no line is drawn across what is not there."""
    step = frame.groupby(keys, sort=False)["t"].diff()
    hole = step > 1.5 * step.median()
    holes = frame[hole].assign(t=frame["t"][hole] - step[hole] / 2)
    numbers = [name for name in frame.columns if name not in keys and frame[name].dtype.kind == "f" and name != "t"]
    holes[numbers] = np.nan
    holes.index = holes.index - 0.5
    return pd.concat([frame, holes]).sort_index(kind="stable").reset_index(drop=True)


def commands_frame(results: Results) -> pd.DataFrame:
    """Commands over time in the shown test runs, in the units of sailors."""
    frame = results.dataset.frame
    frame = frame[frame["run"].isin(figure_runs(results))]
    result = frame[["run", "t"]].reset_index(drop=True)
    for name in results.dataset.commands:
        (unit, factor), word = read_unit(name), SIGNALS[signal_of(name)].word
        component = name.partition(".")[0].replace("_", " ").removesuffix(word).strip()  # port_rudder, rudder
        result[f"{component} {word}".strip() + f" [{unit}]"] = frame[name].to_numpy() * factor
    return count_from_start(results, insert_gaps(result, ["run"]))


def window_snapshots(results: Results) -> list[WindowSnapshot]:
    """Windows of the shown test runs, spread over each run, with every model's paths of the first seed."""
    particulars: Mapping[str, float] = next(
        (one.vessel.document.get("particulars", {}) for one in results.plan.foundations if one.vessel), {}
    )
    test, level, origin = results.test, results.plan.study.bands.level, np.zeros((1, 2))
    paths: dict[PathKey, np.ndarray] = {("", "naive", 0): constant_motion(test)}
    edges: dict[PathKey, Region] = {}
    alone, amounts, seed = alone_models(results), figure_sizes(results.cells["N_D"]), int(results.cells["seed"].min())
    paths |= {(m, "physics", 0): path for m, path in results.physics.items() if m != NO_MODEL and m not in alone}
    for row in results.rows:
        if row["cell"] in results.paths and row["N_D"] in amounts and row["seed"] == seed:
            key = model_text(row["model"]), "cooperative", int(row["N_D"])
            paths[key], bands = results.paths[row["cell"]], results.bands.get(row["cell"])
            if bands is not None and bands.promises(level):
                edges[key] = bands.region(paths[key], test.columns, test.step, level, past=test.past)
    windows, runs = [], figure_runs(results)
    most, V_w = min(INSTANTS, max(3, MOST_WINDOWS // len(runs))), test.columns.get("V_w")
    for run in runs:
        indices, log = np.flatnonzero(test.run == run), results.dataset.frame[results.dataset.frame["run"] == run]
        clock, psi = log["t"].to_numpy(), np.unwrap(log["psi"].to_numpy())
        for index in indices[np.unique(np.linspace(0, len(indices) - 1, most).round().astype(int))]:
            lines = {key: path[:, index] for key, path in paths.items() if np.isfinite(path[:, index]).all()}
            t = float(test.t[index])
            now, end = np.interp([t, t + test.horizon * test.step], clock, psi)
            towards = None if V_w is None else float(test.columns["beta_w"][index] - test.columns["psi"][index])
            windows.append(
                WindowSnapshot(
                    run=run,
                    t=round(t - float(clock.min()), CLOCK),
                    outline=ship_outline(particulars),
                    psi_end=float(end - now),
                    truth=np.concatenate([origin, test.future[:, index]]),
                    paths={key: np.concatenate([origin, line]) for key, line in lines.items()},
                    wind=None if V_w is None or towards is None else (float(V_w[index]), towards),
                    bands={key: region_outline(region, paths[key], index) for key, region in edges.items()},
                )
            )
    return windows


def region_outline(region: Region, paths: np.ndarray, index: int) -> np.ndarray:
    """Outline (n, 2) [m] of a band in the frame (11): port side, round the last region, and back along starboard."""
    path, ahead = paths[:, index], region.ahead[:, index]
    aside = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    reach = region.across[:, index, None] * aside
    round_ = np.linspace(-np.pi / 2, np.pi / 2, 13)[:, None]
    end = path[-1] + region.along[-1, index] * np.cos(round_) * ahead[-1] + np.sin(round_) * reach[-1]
    origin = np.zeros((1, 2))
    return np.concatenate([origin, path - reach, end, (path + reach)[::-1], origin])


def tracks_frame(results: Results) -> pd.DataFrame:
    """Path of every run [m] and its part in the study."""
    frame = results.dataset.frame[["run", "north", "east"]]
    return frame.assign(set=np.where(frame["run"].isin(list(results.test.spans)), "test", "training and validation"))


def factors_frame(results: Results) -> pd.DataFrame:
    """One row per perturbed number of a model: its path, its group (hull, inertia, ...) and factor; 0 is removed."""
    rows = [
        (model["model"], path, path.partition(".")[0], float(factor))
        for model in results.models.to_dict("records")
        for path, factor in (model["factors"].items() if isinstance(model.get("factors"), Mapping) else ())
    ]
    return pd.DataFrame(rows, columns=["model", "path", "group", "factor"])


def trials_frame(results: Results) -> pd.DataFrame:
    """One row per trial of the search, value [m^2], with a column for all that varies; the best trials are `chosen`."""
    methods = {way.name: way.method for way in results.plan.methods}
    searched = list(dict.fromkeys(name for method in methods.values() for name in method.varied()))
    rows = [cell | trial["params"] | trial for cell in results.rows for trial in cell["trials"]]
    columns = [name for name in TRIAL_COLUMNS if name != "chosen"]
    frame = pd.DataFrame(rows, columns=[*columns, "method", *searched])
    frame = frame.astype(dict.fromkeys(["value", "seconds", *searched], float))
    place = frame["value"].where(frame["state"] == "complete").groupby(frame["cell"], sort=False).rank(method="first")
    frame["chosen"] = place <= frame["method"].map({name: method.num_chosen() for name, method in methods.items()})
    return frame[[*TRIAL_COLUMNS, *searched]]


def _method_words(way: StudyMethod) -> str:
    """A method in a few words: its name, its kind and how much it searches."""
    trials = way.method.num_trials()
    kind = "" if way.kind == way.name else f" ({way.kind})"
    return f"{way.name}{kind}" + (f": {trials} trials" if trials else "")


def provenance_words(results: Results) -> dict[str, str]:
    """What the results are based on, as label -> text."""
    record, plan, source = results.provenance, results.plan, results.dataset.metadata.get("source", "")
    machine, sessions = record.get("machine", {}), record.get("sessions", [])
    redrawn = [row for row in results.models.to_dict("records") if (row.get("counter") or 0) > 0]
    whole = isinstance(source, Mapping)
    words = {
        "study": f"{plan.name}, digest {record['digest']}",
        "vessels": "; ".join(sorted({f"{v.key} {v.digest}" for v in vessels_of(plan)})),
        "data": "; ".join(f"{key} {value}" for key, value in source.items()) if whole else str(source),
        "cells": f"{len(results.cells)} of {plan.cells} finished",
        "seeds": ", ".join(map(str, grid_seeds(plan))),
        "methods": "; ".join(map(_method_words, plan.methods)),
        "computed with": f"Python {machine.get('python', '?')} on {machine.get('system', '?')}, "
        f"{machine.get('cores', '?')} cores",
        "packages": ", ".join(f"{name} {number}" for name, number in machine.get("packages", {}).items()),
        "wall time": f"{record.get('wall_seconds', float('nan')):.0f} s, without interrupted sessions",
        "world": f"seed {plan.study.seed}" if plan.study.seed else "",
        "published envelope": plan.study.published.source if plan.study.published else "",
        "redrawn": "; ".join(f"{row['model']}: counter {int(row['counter'])}" for row in redrawn),
        "computed in parts": "; ".join(w for pair in pairwise(sessions) for w in store.differences(*pair)),
        "notes": "; ".join(record.get("notes", [])),
    }
    return {label: text for label, text in words.items() if text or label in ("data", "vessels")}
