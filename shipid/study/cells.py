"""From foundations and methods to cells: what is fitted to what, and the errors of a predictor on the test."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from shipid.data.dataset import Dataset
from shipid.data.windows import Instants, Windows, covered_time
from shipid.engine.rollout import SPEED_LIMIT
from shipid.errors import DataError, ShipidError, shorten_line
from shipid.hybrid.journal import Journal
from shipid.hybrid.mean import MeanCorrector
from shipid.hybrid.method import Case, Corrector, FitResult, Task, fit_all
from shipid.hybrid.stack import sum_paths, weigh_errors
from shipid.metrics import (
    PREDICTION_ERRORS,
    coverage_share,
    position_error,
    summarise_errors,
    vector_lengths,
)
from shipid.predictor import Array, Predictor, limits_of, refit_folds, with_bands
from shipid.study.declared import Foundation, StudyMethod
from shipid.study.plan import Batch, Unit
from shipid.study.prepare import (
    FoundationPrediction,
    PreparedStudy,
    at_instants,
    chosen_observer,
    instants_of,
    physics_of,
    predict_foundation,
    rows_apart_from_test,
    rows_outside_test,
    window_memory,
)
from shipid.study.store import Cell
from shipid.units import percent_text
from shipid.version import __version__

if TYPE_CHECKING:
    from shipid.identification.fit import Solution


NO_ACCURACY = dict.fromkeys(("A", "A_90", "A_rms", "A_end", "A_end_90"), np.nan)  # of no physics
EQUAL_WEIGHTS = "weights are equal: errors on runs left out need `bands.refits`, such as 5"
Errors = dict[tuple[str, str], tuple[Array, float]]


class Work(NamedTuple):
    """A batch as the methods of a unit see it.

    windows : of its training and validation runs. ways : method -> with the foundations that it meets in the unit.
    known : foundation -> what it predicts for the batch.
    """

    prepared: PreparedStudy
    batch: Batch
    windows: Windows
    ways: Mapping[str, StudyMethod]
    known: Mapping[str, FoundationPrediction]
    device: str


def work_of(prepared: PreparedStudy, unit: Unit, ways: tuple[StudyMethod, ...], device: str) -> Work:
    """The windows of a unit, and its foundations, those fitted that are to be."""
    runs = prepared.runs(unit.batch)
    windows = prepared.pool.select(np.isin(prepared.pool.run, runs))
    known = predictions(prepared, runs, device, {name for name, _ in unit.pairs})
    met = {way.name: replace(way, foundations=unit.foundations(way.name)) for way in ways}
    return Work(
        prepared, unit.batch, windows, {name: way for name, way in met.items() if way.foundations}, known, device
    )


def fit_method(work: Work, way: StudyMethod, journal: Journal | None = None) -> dict[str, FitResult]:
    """Results of one method for the foundations that it meets; no corrector where it cannot learn from these runs."""
    prepared, windows, batch, method = work.prepared, work.windows, work.batch, way.method
    mine = {name: work.known[name] for name in way.foundations if not work.known[name].foundation.mean_of}
    cases = {
        name: Case(physics_of(prepared.study, one.foundation.source, one.foundation.observer), one.paths)
        for name, one in mine.items()
    }
    hidden = {
        name: window_memory(case.physics.vessel, prepared.data, windows)
        for name, case in cases.items()
        if case.physics.vessel is not None and method.compensates
    }
    try:
        task = Task(
            cases=cases,
            windows=windows,
            folds=prepared.folds(batch, windows, method.validation) if method.compensates else (),
            commands=prepared.commands,
            known=prepared.study.prediction.known,
            seed=batch.seed,
            hidden=hidden,
            estimates={name: at_instants(prepared.data, windows, one.estimates) for name, one in mine.items()},
            device=work.device,
            journal=journal,
            cells={name: batch.cell(name, way.name) for name in mine},
        )
        return fit_all(method, task)
    except DataError as error:
        return {name: FitResult(None, [], 0.0, sentence=str(error)) for name in mine}


def errors_left_out(work: Work, fitted: Mapping[str, Mapping[str, FitResult]]) -> Errors:
    """(Foundation, method) -> errors (T, S, 2) [m] by `bands.refits` cells fitted without these runs, and seconds.

    Of methods that learn step by step, and foundations fitted to the runs of the batch: others have them for nothing.
    """
    prepared, batch, windows = work.prepared, work.batch, work.windows
    adapted = {one.name for one in prepared.foundations if one.fitted}
    wanted: dict[str, tuple[str, ...]] = {}
    for way in work.ways.values():
        trained = [name for name, one in fitted[way.name].items() if one.corrector is not None]
        if names := tuple(one for one in trained if one in adapted or fitted[way.name][one].left_out is None):
            wanted[way.name] = names
    refits = prepared.study.bands.refits
    if not refits or not wanted:
        return {}
    left_out: Errors = {
        (name, method): (np.full_like(windows.future, np.nan), 0.0)
        for method, names in wanted.items()
        for name in names
    }
    kept = rows_outside_test(prepared.data, prepared.test)
    seen = replace(prepared, data=rows_apart_from_test(prepared.data, prepared.test))
    place = np.flatnonzero(np.isin(prepared.pool.run, prepared.runs(batch)))
    try:
        folds = refit_folds(windows, refits, batch.seed)
    except DataError:  # runs of one clock that overlap: without some of them nothing is left, so no run has errors
        folds = []
    for training, judged in folds:
        rest, part = windows.select(training), windows.select(judged)
        on_parts = {
            name: replace(
                one,
                paths=one.paths[:, place[training]],
                test_paths=one.paths[:, place[judged]],
                diverged=one.diverged[place[training]],
                test_diverged=one.diverged[place[judged]],
                estimates=one.estimates and one.estimates.select(kept),
            )
            for name, one in prepared.known.items()
        }
        inside = replace(seen, pool=rest, test=part, known=on_parts)
        known = predictions(inside, tuple(rest.spans), work.device, {name for name, _ in left_out})
        again = work._replace(prepared=inside, windows=rest, known=known)
        for method, names in wanted.items():
            way = replace(work.ways[method], foundations=names)
            for name, result in fit_method(again, way).items():
                one, (errors, seconds) = known[name], left_out[name, method]
                left_out[name, method] = errors, seconds + result.seconds + one.seconds
                if result.corrector is None:  # too little is left to train: the runs that it leaves out have no errors
                    continue
                predictor = _predictor(again, one.foundation, way, result.corrector, {})
                instants = instants_of(inside.study, predictor.vessel, inside.data, part, one.estimates)
                errors[:, judged] = part.future - predictor.predict(instants, one.test_paths)
    return left_out


def _fair_errors(
    work: Work, pair: tuple[str, str], fitted: Mapping[str, Mapping[str, FitResult]], left_out: Errors
) -> Array | None:
    """Errors (T, S, 2) [m] on the windows by models that saw nothing of their runs; None where there are none."""
    name, method = pair
    family, result = work.known[name].foundation.family, fitted[method][name]
    if result.left_out is None or any(one.fitted for one in work.prepared.foundations if one.family == family):
        return left_out.get(pair, (None, 0.0))[0]
    return result.left_out


def _described_cell(work: Work, pair: tuple[str, str], seconds: float, trials: list[dict[str, Any]]) -> dict[str, Any]:
    """The columns of a row that do not depend on the result."""
    (name, method), prepared, batch = pair, work.prepared, work.batch
    one = work.known[name]
    foundation = one.foundation
    return {
        "cell": batch.cell(name, method),
        "foundation": name,
        "family": foundation.family,
        "member": foundation.member,
        "method": method,
        **(accuracy_of(one.test_paths, prepared.test) if foundation.base is not None else NO_ACCURACY),
        "N_D": batch.N_D,
        "seed": batch.seed,
        "runs": len(prepared.runs(batch)),
        "minutes": covered_time(work.windows) / 60,
        "seconds": seconds,
        "trials": trials,
        "physics_diverged": 0.0,
    }


def evaluate_cell(
    work: Work,
    pair: tuple[str, str],
    fitted: Mapping[str, Mapping[str, FitResult]],
    left_out: Errors,
    origin: Mapping[str, str],
) -> Cell:
    """The predictor of a foundation and a method with its bands, and its errors on the test.

    left_out : errors of refits. origin : name and digest of the study, for the provenance of the predictor.
    """
    name, method = pair
    one, way, result, prepared = work.known[name], work.ways[method], fitted[method][name], work.prepared
    seconds = result.seconds + one.seconds + left_out.get(pair, (None, 0.0))[1]
    row = _described_cell(work, pair, seconds, result.trials)
    if result.corrector is None:
        return Cell(
            row | _failed_columns("failed", shorten_line(result.sentence or one.sentence or "no training converged"))
        )
    predictor = _predictor(work, one.foundation, way, result.corrector, origin)
    instants = instants_of(prepared.study, predictor.vessel, prepared.data, work.windows, one.estimates)
    errors = _fair_errors(work, pair, fitted, left_out)
    predictor = with_bands(predictor, errors, work.windows, instants, prepared.kinds)
    chosen = result.corrector.hyperparameters
    words = ", ".join(f"{key} {chosen[key]:.3g}" for key in way.method.varied() if key in chosen)
    outcome, paths = _test_errors(prepared, one, predictor, way)
    return Cell({**row, **outcome, "hyperparameters": words}, predictor, paths)


def evaluate_mean(
    work: Work,
    pair: tuple[str, str],
    cells: Mapping[tuple[str, str], Cell],
    fitted: Mapping[str, Mapping[str, FitResult]],
    left_out: Errors,
) -> Cell:
    """The mean of some foundations with one method, whose cells are there; price and errors as of `evaluate_cell`."""
    (name, method), prepared = pair, work.prepared
    foundation, pairs = work.known[name].foundation, [(part, method) for part in work.known[name].foundation.mean_of]
    parts = [cells[one] for one in pairs]
    row = _described_cell(work, pair, sum(part.row["seconds"] for part in parts), [])
    predictors = [part.predictor for part in parts if part.predictor is not None and part.paths is not None]
    if len(predictors) < len(parts):
        lost = next(part.row["foundation"] for part in parts if part.predictor is None or part.paths is None)
        return Cell(row | _failed_columns("failed", f"{lost}, of which it is the mean, has no result"))
    errors = [one for pair in pairs if (one := _fair_errors(work, pair, fitted, left_out)) is not None]
    weights, mean_errors = np.full(len(parts), 1 / len(parts)), None
    notes = [f"{part.row['foundation']}: {part.row['sentence']}" for part in parts if part.row["sentence"]]
    if len(errors) == len(parts):
        weights, mean_errors = weigh_errors(np.stack(errors), work.windows.run, by_left_out=foundation.by_left_out)
    elif foundation.by_left_out:
        notes.append(EQUAL_WEIGHTS)
    first = predictors[0]
    predictor = replace(
        first,
        corrector=MeanCorrector(tuple(predictors), weights),
        provenance={**first.provenance, "cell": row["cell"], "foundation": name},
        bands=None,
    )
    instants = instants_of(prepared.study, first.vessel, prepared.data, work.windows)
    predictor = with_bands(predictor, mean_errors, work.windows, instants, prepared.kinds)
    paths = sum_paths([part.paths for part in parts if part.paths is not None], weights)
    test = instants_of(prepared.study, first.vessel, prepared.data, prepared.test)
    words = ", ".join(f"{part} {weight:.2g}" for part, weight in zip(foundation.mean_of, weights, strict=True))
    outcome = _errors_of_paths(prepared, predictor, test, paths)
    outcome |= {"status": "ok", "sentence": "; ".join(notes), "hyperparameters": words}
    return Cell({**row, **outcome}, predictor, paths)


def accuracy_of(paths: Array, test: Windows) -> dict[str, float]:
    """A, A_90, A_rms, A_end, A_end_90 [m] of the paths (T, S, 2) of the physics alone on the test windows."""
    known: Mapping[str, Any] = summarise_errors(position_error(paths, test.future))
    ends = {"A_end": known["end"], "A_end_90": known["end_90"]}
    return {"A": known["mean"], "A_90": known["p90"], "A_rms": known["rms"], **ends}


def _failed_columns(status: str, sentence: str) -> dict[str, Any]:
    """The columns of a row without a result."""
    blank = dict.fromkeys((*PREDICTION_ERRORS, "rms", "coverage", "width"), np.nan)
    return {**blank, "status": status, "sentence": sentence, "hyperparameters": ""}


def _test_errors(
    prepared: PreparedStudy, one: FoundationPrediction, predictor: Predictor, way: StudyMethod
) -> tuple[dict[str, Any], Array | None]:
    """Errors [m] of a predictor on the test windows, and its paths, if a ship can reach them."""
    test, study, sentence = prepared.test, prepared.study, one.sentence
    if not np.isfinite(one.test_paths).all():
        return _failed_columns("diverged", sentence), None
    instants = instants_of(study, predictor.vessel, prepared.data, test, one.estimates)
    predictor.check_restored(instants, one.test_paths, way.method.corrector)
    moved = predictor.physics_with_force
    lost = one.test_diverged if moved is predictor.physics else moved.variant_paths(instants)[1][0]
    paths = predictor.predict(instants, one.test_paths)
    failed = ~(vector_lengths(paths) <= SPEED_LIMIT * test.step * len(paths)).all(axis=0)
    if failed.any():
        where = f"{percent_text(failed.mean(), 1)} of the test windows"
        return _failed_columns(
            "diverged", f"the prediction is not a number, or farther than any ship gets, on {where}"
        ), None
    outcome = _errors_of_paths(prepared, predictor, instants, paths)
    if lost.any():
        share = f"physics diverges on {percent_text(lost.mean(), 1)} of the test windows"
        sentence = "; ".join(
            filter(None, [sentence, f"{share}: paths there go no farther than the present speed takes the ship"])
        )
    return {**outcome, "status": "ok", "sentence": sentence, "physics_diverged": float(lost.mean())}, paths


def _errors_of_paths(prepared: PreparedStudy, predictor: Predictor, instants: Instants, paths: Array) -> dict[str, Any]:
    """Errors [m] of paths (T, S, 2) [m] of a predictor on the test windows, and coverage and width [m] of its band."""
    test, level = prepared.test, prepared.study.bands.level
    error: Mapping[str, Any] = summarise_errors(position_error(paths, test.future))
    outcome = {column: error[name] for column, name in PREDICTION_ERRORS.items()}
    outcome |= {"rms": error["rms"], "coverage": np.nan, "width": np.nan}
    if predictor.bands is not None and predictor.bands.promises(level):
        region = predictor.band(paths, instants, level)
        outcome["coverage"] = coverage_share(region.holds(test.future - paths), test.run)
        outcome["width"] = float(region.radius.mean())
    return outcome


def _predictor(
    work: Work, foundation: Foundation, way: StudyMethod, corrector: Corrector, origin: Mapping[str, str]
) -> Predictor:
    windows, study = work.windows, work.prepared.study
    named = {"cell": work.batch.cell(foundation.name, way.name), "foundation": foundation.name, "method": way.name}
    return Predictor(
        physics=physics_of(study, foundation.source, foundation.observer),
        method=way.kind,
        corrector=corrector,
        limits=limits_of(windows, work.prepared.commands),
        commands=study.prediction.commands,
        causal=tuple(study.data.causal) if study.data else (),
        run_up=windows.num_past * windows.step if foundation.observer is not None else 0.0,
        provenance={**origin, **named, "runs": list(windows.spans), "shipid": __version__},
    )


def predictions(
    prepared: PreparedStudy, runs: tuple[str, ...], device: str, wanted: Collection[str] | None = None
) -> dict[str, FoundationPrediction]:
    """Every foundation for some runs of the pool; those to be fitted see these runs, and no moment of the test.

    wanted : names of foundations; None: all.
    """
    mask = np.isin(prepared.pool.run, runs)
    windows = prepared.pool.select(mask)
    result = {}
    data: Dataset | None = None
    solved: dict[Any, Solution] = {}
    for name, one in prepared.known.items():
        if wanted is not None and name not in wanted:
            continue
        if not one.foundation.fitted:
            result[name] = replace(one, paths=one.paths[:, mask], diverged=one.diverged[mask])
        else:
            data = rows_apart_from_test(prepared.data, prepared.test) if data is None else data
            result[name] = _fit_foundation(prepared, one.foundation, runs, data, windows, device, solved)
    return result


def _fit_foundation(
    prepared: PreparedStudy,
    foundation: Foundation,
    runs: tuple[str, ...],
    data: Dataset,
    windows: Windows,
    device: str,
    known: dict[Any, Solution],
) -> FoundationPrediction:
    """One foundation fitted to the runs; `known` keeps solutions for foundations that differ in the observer alone.

    Where that fails, its paths are no numbers, and the sentence says why.
    """
    study = prepared.study
    now, sentence, seconds = foundation, "", 0.0
    try:
        variant, vessel = foundation.variant, foundation.vessel
        if foundation.identify is not None and variant is not None and vessel is not None:
            from shipid.identification.solve import identify  # SciPy's statistics: a quarter of what workers import

            key = variant.name, foundation.identify.model_dump_json()
            if key not in known:
                known[key] = identify(vessel, data, runs, foundation.identify)
            if known[key].status != "ok":
                raise ShipidError(known[key].sentence)
            values: Mapping[str, float] = {**variant.values, **known[key].values}
            now = replace(foundation, variant=replace(variant, values=values))
            sentence, seconds = known[key].sentence, known[key].seconds
        if now.observer is not None and now.observer.choose:
            begun = time.thread_time()
            now = replace(now, observer=chosen_observer(study, now, data.select(runs), windows))
            seconds += time.thread_time() - begun
        calls = sum(one.observer is not None for one in prepared.foundations)
        one = predict_foundation(study, prepared.data, (windows, prepared.test), now, device, calls)
    except ShipidError as error:
        words = "identification" if foundation.identify is not None else "observer"
        here, there = (np.full_like(part.future, np.nan) for part in (windows, prepared.test))
        lost = np.zeros(len(windows), bool), np.zeros(len(prepared.test), bool)
        return FoundationPrediction(foundation, here, there, *lost, sentence=f"{words}: {error.message}")
    return replace(one, sentence=sentence, seconds=seconds)
