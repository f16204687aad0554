"""Run a plan: units of work on workers, results stored as they come, so that an interrupted run resumes."""

from __future__ import annotations

import logging
import os
import platform
import sys
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipid.arguments import of_class, path_of, whole_number
from shipid.capacity import cores, processor
from shipid.data.dataset import read_dataset, write_dataset
from shipid.data.windows import Instants, Windows, covered
from shipid.engine.engines import check_device
from shipid.engine.native import engine, engine_so_far
from shipid.engine.rollout import SPEED_LIMIT
from shipid.errors import DataError, ShipidError, legible
from shipid.files import make_folder, write_json
from shipid.hybrid.device import use_threads, vectors
from shipid.hybrid.journal import Journal
from shipid.hybrid.method import Case, Corrector, Fitted, Task, fit_all
from shipid.hybrid.physics import Physics
from shipid.metrics import lengths, position_error, share_of, summary
from shipid.physics import TERMS
from shipid.predictor import Array, Predictor, bands_of, limits_of, refit_folds
from shipid.study import seals, store
from shipid.study.claims import WAIT, Holder, TakenOver, UnitClaims, pause
from shipid.study.code import UNKNOWN, code_digest
from shipid.study.declared import Foundation, Way
from shipid.study.envelope import envelope
from shipid.study.foundations import Prediction, predictions
from shipid.study.plan import USER_SCRIPT, Batch, Plan, Unit
from shipid.study.prepare import (
    Prepared,
    apart,
    at_instants,
    describe,
    instants_of,
    obtain,
    outside_of,
    physics_of,
    prepare,
    runs_by_amount,
    window_memory,
)
from shipid.study.workers import import_for_workers, on_workers
from shipid.units import listed, percent
from shipid.users import of_users
from shipid.version import __version__

PACKAGES = (
    "casadi",
    "numpy",
    "scipy",
    "scikit-learn",
    "torch",
    "optuna",
    "pandas",
    "pyarrow",
    "dask",
    "distributed",
    "plotly",
)

MAIN = "__main__"  # module of a script, a cell or a console
DATA, COMMON = "dataset", "common"  # names of seals: of the runs, and of what all units share
SESSIONS = "sessions"  # name of the claim on the record of what a run is computed with
MENDING, MENDED = "mending", "mended"  # claims: on the look at all files, and of the process that has looked
Results = list[store.Cell]
Computed = Iterator[tuple[Unit, Results | str]]

log = logging.getLogger(__name__)

ACCURACY = {"A": "mean", "A_90": "p90", "A_rms": "rms"}  # of the physics alone


@dataclass(frozen=True)
class Event:
    """Something a user may want to see while a study runs.

    kind : `note` (text), `start` (done and total cells known), `cell` (one finished: row), `others` (done: with what
        other processes in the folder have finished), `end` (text: the folder; done: all, or less if others go on).
    """

    kind: str
    text: str = ""
    done: int = 0
    total: int = 0
    row: dict[str, Any] = field(default_factory=dict)


def run_study(
    plan: Plan,
    folder: str | os.PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    device: str = "cpu",
    leave: bool = False,
) -> Generator[Event, None, None]:
    """Run what is not finished yet of a plan and store it in the folder; yields events.

    Numbers do not depend on the workers or on interruptions: an interrupted unit of work is done again, its searches go
    on from their journal. Any number of processes, on one machine or several, may run one plan in one folder.

    Parameters
    ----------
    workers : local processes, one thread each; default: one per core, no more than units of work.
    scheduler : address of a Dask scheduler to use instead, such as `tcp://host:8786`.
    device : PyTorch device of rollouts and training.
    leave : end when other processes work on all that is left; the one that ends last writes the tables.

    Raises ShipidError before any work for a plan that is none, for a number of workers below 1, and where local workers
    lack the code that a user wrote, such as that of a notebook.
    """
    of_class("plan", plan, Plan, "as of `read_plan`")
    folder = path_of("folder", folder)
    workers = None if workers is None else whole_number("workers", workers, 1)
    check_device(device)
    if scheduler is None:
        import_for_workers()
        _check_code(plan, folder)
    store.open_folder(folder, plan)
    with store.in_place(folder, plan):
        run = _run_parts if plan.parts else _run_one
        yield from run(plan, folder, workers, scheduler, device, leave)


def _check_code(plan: Plan, folder: Path) -> None:
    """ShipidError where a local worker has not the code that a user wrote, unless nothing is left for one to do."""
    units = {unit.key: unit for unit in plan.units}
    if not plan.code or (folder.is_dir() and store.finished_keys(folder, units) >= units.keys()):
        return
    here, there, failed, why = _code_of(plan), dict[str, str](), "", ""
    try:
        ((_, there),) = on_workers(partial(_code_of, plan), [None], 1)
    except ShipidError:
        raise
    except Exception as error:  # of a module as it is imported, of a class or of a name in TERMS that is not there
        why = "" if isinstance(error, KeyError) and any(key in error.args for key in TERMS) else f" ({error})"
        in_script = isinstance(error, AttributeError) and any(
            type(way.method).__module__ == MAIN for way in plan.methods
        )
        failed = "" if in_script or not why else legible(f"{type(error).__name__}: {error}".removesuffix(": "))
    if not (other := {what: digest for what, digest in here.items() if there.get(what) != digest}):
        return
    named = listed([*other])
    if failed and UNKNOWN not in other.values():
        raise ShipidError(f"a worker cannot import the {named}: {failed}")
    if there.keys() >= other.keys() and UNKNOWN not in other.values():
        words = f"the file of the {named}, or one that it imports, has changed since it was imported"
        raise ShipidError(f"{words}: start this process again")
    if file := getattr(sys.modules[MAIN], "__file__", None):
        remedy = 'they import your script: define and name it above the line `if __name__ == "__main__":`'
    elif "term" in named:
        script = f"a script, as {USER_SCRIPT} in docs/extending.md"
        remedy = f"write it, with its line TERMS[...] = ..., into {script}, and run the study by that"
    else:
        remedy = "write it into a file, such as my_method.py, and import it from there"
    words = f"workers are processes, which do not see what a cell or a console defines: they lack the {named}{why}"
    raise ShipidError(f"{words}: {remedy}", file=file)


def _code_of(plan: Plan, _: None = None) -> dict[str, str]:
    """What the user wrote, in words, as this process or a worker has it -> digest."""
    return {f"{what.split()[-1]} {name!r}": digest for what, held in plan.code.items() for name, digest in held.items()}


def _run_one(
    plan: Plan, folder: Path, workers: int | None, scheduler: str | None, device: str, leave: bool
) -> Iterator[Event]:
    """Run a study of one part."""
    begun = time.perf_counter()
    with UnitClaims(folder) as claims:
        for words in _mended(folder, claims):
            yield Event("note", words)
        origin = Origin(folder, claims, session_on(device, plan.code))
        if changed := origin.note(origin.session):
            yield Event("note", f"earlier results were computed otherwise: {'; '.join(changed)}")
        if not seals.is_sealed(folder, DATA):
            yield Event("note", plan.obtaining)
            claims.once(DATA, partial(seals.is_sealed, folder, DATA), partial(_write_data, plan, folder, origin))
        dataset = read_dataset(folder / store.DATASET)
        yield Event("note", "rolling out the foundations")
        prepared = prepare(plan, dataset, device)
        store.check_place(folder, plan)
        origin.note_engine(engine_so_far())
        claims.once(COMMON, partial(seals.is_sealed, folder, COMMON), partial(_write_common, plan, folder, prepared))
        for note in prepared.notes:
            yield Event("note", note)
        make_folder(folder / store.JOURNALS)

        def compute(units: Iterable[Unit]) -> Computed:
            return _compute(plan, prepared, units, workers, scheduler, device, origin)

        cells = 0
        for event in _shared(plan, folder, claims, compute, leave):
            cells = event.done
            yield event
        if cells == plan.cells:
            finish = partial(_finish, plan, folder, claims, prepared, device, begun)
            claims.once(store.RESULTS, partial(_is_finished, folder), finish)
    yield Event("end", text=str(folder), done=cells, total=plan.cells)


def _run_parts(
    plan: Plan, folder: Path, workers: int | None, scheduler: str | None, device: str, leave: bool
) -> Iterator[Event]:
    """Run the parts of a study one after the other, each in its folder; events count the cells of all parts.

    What others work on is left to the end.
    """
    total = sum(part.plan.cells for part in plan.parts.values())
    folders = {name: store.check_part(folder, name, part.plan) for name, part in plan.parts.items()}
    done = {name: _cells(store.finished(folders[name], part.plan.units)) for name, part in plan.parts.items()}
    yield Event("start", done=sum(done.values()), total=total)
    for leaves in (True, False)[: 1 if leave else 2]:
        for name, part in plan.parts.items():
            if not leaves and done[name] == part.plan.cells:
                continue
            yield Event("note", f"{name}:")
            where = folders[name]
            for event in run_study(part.plan, where, workers=workers, scheduler=scheduler, device=device, leave=leaves):
                if event.kind == "note":
                    yield event
                else:
                    done[name] = event.done
                if event.kind in ("cell", "others"):
                    yield replace(event, done=sum(done.values()), total=total)
    yield Event("end", text=str(folder), done=sum(done.values()), total=total)


def _cells(units: Iterable[Unit]) -> int:
    return sum(len(unit.pairs) for unit in units)


def _write_data(plan: Plan, folder: Path, origin: Origin) -> None:
    """Store the runs of a study."""
    dataset = obtain(plan)
    store.check_place(folder, plan)
    origin.note_engine(engine_so_far())
    write_dataset(dataset, folder / store.DATASET)
    seals.write_seal(folder, DATA, [folder / store.DATASET])


def _finish(plan: Plan, folder: Path, claims: UnitClaims, prepared: Prepared, device: str, begun: float) -> None:
    """Write what only the end of a run knows: the tables, and in the provenance notes, machine and time."""
    with claims.alone(SESSIONS):  # a process that joins notes its session there
        record = store.provenance(folder)
        record["notes"] = list(prepared.notes)
        record["machine"] = {**machine(), "device": device}
        record["wall_seconds"] = record.get("wall_seconds", 0.0) + time.perf_counter() - begun
        write_json(folder / store.PROVENANCE, record)
    rows = store.read_rows(folder, plan)
    store.write_results(folder, plan, rows, whole=len(rows) == plan.cells)


def _is_finished(folder: Path) -> bool:
    """Whether the tables hold all cells, and the provenance what the end of a run says."""
    return seals.is_sealed(folder, store.RESULTS) and "wall_seconds" in store.provenance(folder)


def _mended(folder: Path, claims: UnitClaims) -> list[str]:
    """Take away damaged files, so that they are computed again; one process looks, others wait until it has."""
    with claims.alone(MENDING):
        return list(seals.mend(folder)) if claims.take(MENDED) else []


def _write_common(plan: Plan, folder: Path, prepared: Prepared) -> None:
    """Store what all batches share, so that a report needs nothing else."""
    store.check_place(folder, plan)
    fixed = {one.name: prepared.test_paths[one.name] for one in prepared.foundations if not one.fitted}
    store.write_test(folder, prepared.test, fixed, prepared.naive)
    write_json(
        folder / store.ENVELOPE,
        envelope(prepared.pool, prepared.test, runs_by_amount(plan, prepared.pool), prepared.commands),
    )
    write_json(
        folder / store.FOUNDATIONS, [{**describe(one), **_accuracy(one, prepared)} for one in prepared.foundations]
    )
    seals.write_seal(folder, COMMON, [folder / name for name in (store.TEST, store.ENVELOPE, store.FOUNDATIONS)])


@dataclass
class Origin:
    """What the results in a folder are computed with: noted there before they are stored, each kind once by a process.

    session : of this process as it begins. Its engine, or that of a worker, is another one from the moment on at which
        a model cannot be compiled.
    """

    folder: Path
    claims: UnitClaims
    session: dict[str, Any]
    noted: list[Mapping[str, Any]] = field(default_factory=list)

    def note(self, session: Mapping[str, Any]) -> list[str]:
        """Note a session; returns a sentence per difference to the one before, of this process or of another."""
        if session in self.noted:
            return []
        self.noted.append(session)
        with self.claims.alone(SESSIONS):
            return store.note_session(self.folder, session)

    def note_engine(self, now: str | None) -> None:
        """Note by which engine this process or a worker computes by now; a warning where it was another before."""
        if now is not None and (changed := self.note({**self.session, "engine": now})):
            log.warning("computed otherwise in this process or a worker: %s", "; ".join(changed))


def session_on(device: str, code: Mapping[str, Mapping[str, str]]) -> dict[str, Any]:
    """What results depend on beside the plan, to the last digit: versions, engine, processor, device, users' code."""
    computer = machine()
    others = {name: version for name, version in computer["packages"].items() if name != "shipid"}
    return {
        "shipid": f"{computer['packages']['shipid']}, code {code_digest()}",  # the code may differ and the version not
        "engine": engine(),
        "processor": computer["processor"],
        "python": computer["python"],
        "device": device,
        "packages": others,
        **code,
    }


def _shared(
    plan: Plan, folder: Path, claims: UnitClaims, compute: Callable[[Iterable[Unit]], Computed], leave: bool
) -> Iterator[Event]:
    """Compute every unit that is not finished yet, here or, where another process is at work on it, there."""
    units = {unit.key: unit for unit in plan.units}
    known = store.finished_keys(folder, units)
    cells = _cells(units[key] for key in known)
    yield Event("start", done=cells, total=plan.cells)
    wait = WAIT
    while True:
        store.check_place(folder, plan)
        if known >= units.keys():  # unless another process has just mended some of them
            known = store.finished_keys(folder, units)
            cells = _cells(units[key] for key in known)
        if not (left := [key for key in units if key not in known]):
            return
        before = len(known)
        free = claims.free(
            left,
            partial(store.finished_keys, folder, units),
            lambda key: store.is_finished(folder, units[key]),
        )
        for unit, results in compute(units[key] for key in free):
            try:
                store.check_place(folder, plan)
                claims.holder.check(unit.key)
                if isinstance(results, str):
                    raise TakenOver(results)
                store.write_unit(folder, unit, results)
            except TakenOver as lost:
                yield Event("note", str(lost))
                continue
            finally:
                claims.give_back(unit.key)
            known.add(unit.key)
            for cell in results:
                cells += 1
                yield Event("cell", done=cells, total=plan.cells, row=cell.row)
        known |= store.finished_keys(folder, units)
        if cells < _cells(units[key] for key in known):
            cells = _cells(units[key] for key in known)
            yield Event("others", done=cells, total=plan.cells)
        if leave and not known >= units.keys():
            return
        wait = pause(wait) if len(known) == before else WAIT


def run_unit(
    plan: Plan,
    prepared: Prepared,
    unit: Unit,
    device: str,
    trials: Path | None = None,
    check: Callable[[], object] = lambda: None,
) -> Results:
    """All cells of one unit of work. Pure: the same on every worker.

    trials : the folder of the journals in which searches go on; on a machine that does not see it, they are kept in
        memory. check : called before each write to a journal; what it raises ends the search.
    """
    use_threads(1)
    check_device(device)
    journal = (
        Journal(trials / f"{unit.key}.log", check, plan.digest) if trials is not None and trials.is_dir() else None
    )
    batch = unit.batch
    runs = prepared.runs(plan, batch)
    windows = prepared.pool.select(np.isin(prepared.pool.run, runs))
    known = predictions(plan, prepared, runs, device, {name for name, _ in unit.pairs})
    ways = {way.name: replace(way, foundations=unit.foundations(way.name)) for way in plan.methods}
    fitted = {
        name: _fitted(plan, prepared, batch, windows, known, way, device, journal)
        for name, way in ways.items()
        if way.foundations
    }
    left_out = refitted(plan, prepared, batch, windows, fitted, device)
    return [
        _cell(plan, prepared, batch, windows, known[name], ways[method], fitted[method][name], left_out)
        for name, method in unit.pairs
    ]


def _cell(
    plan: Plan,
    prepared: Prepared,
    batch: Batch,
    windows: Windows,
    one: Prediction,
    way: Way,
    result: Fitted,
    left_out: Mapping[tuple[str, str], tuple[Array, float]],
) -> store.Cell:
    """The predictor of a foundation and a method with its bands, and its errors on the test; `left_out` of refits."""
    name = one.foundation.name
    row = {"cell": batch.cell(name, way.name), **_names(one, way, prepared.test)}
    row |= {"N_D": batch.N_D, "seed": batch.seed, "runs": len(prepared.runs(plan, batch))}
    row["minutes"] = covered(windows) / 60
    errors, seconds = left_out.get((name, way.name), (None, 0.0))
    row |= {"seconds": result.seconds + one.seconds + seconds, "trials": result.trials}
    if result.corrector is None:
        why = result.sentence or one.sentence or "no training converged"
        return store.Cell({**row, **_failed(legible(why))}, None, None)
    predictor = _predictor(plan, prepared, one.foundation, way, batch, result.corrector, windows)
    if one.foundation.family not in plan.fitted and result.left_out is not None:
        errors = result.left_out  # fair: numbers and observer were not taken from these runs
    bands, reason = bands_of(errors, windows, predictor.limits, prepared.kinds)
    known_why = {} if bands is not None else {"no_band": reason}
    predictor = replace(predictor, bands=bands, provenance={**predictor.provenance, **known_why})
    outcome, paths = _judged(plan, prepared, one, predictor, way)
    return store.Cell({**row, **outcome}, predictor, paths)


def refitted(
    plan: Plan,
    prepared: Prepared,
    batch: Batch,
    windows: Windows,
    fitted: Mapping[str, Mapping[str, Fitted]],
    device: str,
) -> dict[tuple[str, str], tuple[Array, float]]:
    """Errors (T, S, 2) [m] on the windows of a batch by cells fitted without their runs, and seconds that they took.

    For the (foundation, method) pairs that have no such errors for nothing: methods that learn step by step, and
    foundations fitted to the runs of the batch. None of them unless the study has `bands.refits`.
    """
    adapted = {one.name for one in prepared.foundations if one.fitted}
    pairs = [
        (name, way)
        for name, way in plan.pairs
        if name in fitted.get(way.name, {})
        and fitted[way.name][name].corrector is not None
        and (name in adapted or fitted[way.name][name].left_out is None)
    ]
    refits = plan.refits
    if not refits or not pairs:
        return {}
    left_out = {(name, way.name): (np.full_like(windows.future, np.nan), 0.0) for name, way in pairs}
    names = {name for name, _ in pairs}
    data, kept = apart(prepared.data, prepared.test), outside_of(prepared.data, prepared.test)
    estimates = {name: known.select(kept) for name, known in prepared.estimates.items()}
    place = np.flatnonzero(np.isin(prepared.pool.run, prepared.runs(plan, batch)))
    try:
        folds = refit_folds(windows, refits, batch.seed)
    except DataError:  # runs of one clock that overlap: without some of them nothing is left, so no run has errors
        folds = []
    for training, judged in folds:
        rest, part = windows.select(training), windows.select(judged)
        inside = replace(
            prepared,
            data=data,
            estimates=estimates,
            pool=rest,
            test=part,
            pool_paths={name: paths[:, place[training]] for name, paths in prepared.pool_paths.items()},
            test_paths={name: paths[:, place[judged]] for name, paths in prepared.pool_paths.items()},
        )
        known = predictions(plan, inside, tuple(rest.spans), device, names)
        for way in plan.methods:
            mine = [name for name, other in pairs if other.name == way.name]
            if not mine:
                continue
            again = _fitted(plan, inside, batch, rest, known, replace(way, foundations=tuple(mine)), device, None)
            for name in mine:
                one, result, (errors, seconds) = known[name], again[name], left_out[name, way.name]
                left_out[name, way.name] = errors, seconds + result.seconds + one.seconds
                if result.corrector is None:  # too little is left to train: the runs that it leaves out have no errors
                    continue
                predictor = _predictor(plan, inside, one.foundation, way, batch, result.corrector, rest)
                instants = instants_of(plan, predictor.vessel, inside.data, part, one.estimates)
                errors[:, judged] = part.future - predictor.predict(instants, one.test_paths)
    return left_out


def _fitted(
    plan: Plan,
    prepared: Prepared,
    batch: Batch,
    windows: Windows,
    known: Mapping[str, Prediction],
    way: Way,
    device: str,
    journal: Journal | None,
) -> dict[str, Fitted]:
    """Results of one method for the foundations that it meets; no corrector where it cannot learn from these runs."""
    mine = {name: known[name] for name in way.foundations}
    try:
        return fit_all(way.method, _task(plan, prepared, batch, windows, mine, way, device, journal))
    except DataError as error:
        return {name: Fitted(None, [], 0.0, sentence=error.message) for name in mine}


def _task(
    plan: Plan,
    prepared: Prepared,
    batch: Batch,
    windows: Windows,
    mine: Mapping[str, Prediction],
    way: Way,
    device: str,
    journal: Journal | None,
) -> Task:
    """What one method is fitted to: the foundations that it meets."""
    cases = {name: Case(_physics(plan, one.foundation), one.paths) for name, one in mine.items()}
    return Task(
        cases=cases,
        windows=windows,
        folds=prepared.folds(plan, batch, windows, way.method.validation) if way.method.compensates else (),
        commands=prepared.commands,
        known=plan.known,
        seed=batch.seed,
        hidden={
            name: window_memory(case.physics.vessel, prepared.data, windows)
            for name, case in cases.items()
            if case.physics.vessel is not None and way.method.compensates
        },
        estimates={name: at_instants(prepared.data, windows, one.estimates) for name, one in mine.items()},
        device=device,
        journal=journal,
        cells={name: batch.cell(name, way.name) for name in mine},
    )


def _physics(plan: Plan, foundation: Foundation) -> Physics:
    return physics_of(plan, foundation.vessel, foundation.observer)


def _names(one: Prediction, way: Way, test: Windows) -> dict[str, Any]:
    """Which foundation and method a row is of, and how accurate the physics alone."""
    foundation = one.foundation
    known = one.accuracy(test) if foundation.base is not None else None
    row = {"foundation": foundation.name, "family": foundation.family, "member": foundation.member, "method": way.name}
    return row | {key: known[name] if known else np.nan for key, name in ACCURACY.items()}


def _failed(sentence: str, status: str = "failed") -> dict[str, Any]:
    """The columns of a row without a result."""
    blank = dict.fromkeys(("H", "H_90", "rms", "coverage", "width"), np.nan)
    return {**blank, "status": status, "sentence": sentence, "hyperparameters": ""}


def _judged(
    plan: Plan, prepared: Prepared, one: Prediction, predictor: Predictor, way: Way
) -> tuple[dict[str, Any], Array | None]:
    """Errors [m] of a predictor on the test windows and what its search chose, and its paths where they are finite."""
    chosen, test = predictor.corrector.hyperparameters, prepared.test
    words = ", ".join(f"{name} {chosen[name]:.3g}" for name in way.method.varied() if name in chosen)
    failed = ~np.isfinite(one.test_paths).all(axis=(0, 2))
    if failed.any():
        share = f"physics diverges on {percent(failed.mean(), 1)} of the test windows"
        sentence = share if np.isfinite(one.paths).all() else one.sentence
        return _failed(sentence, "diverged") | {"hyperparameters": words}, None
    instants = instants_of(plan, predictor.vessel, prepared.data, test, one.estimates)
    predictor.check_restored(instants, one.test_paths, way.method.corrector)
    paths = predictor.predict(instants, one.test_paths)
    failed = _beyond_ships(paths, test.step)
    if failed.any():
        where = f"{percent(failed.mean(), 1)} of the test windows"
        sentence = f"the prediction is not a number, or farther than any ship gets, on {where}"
        return _failed(sentence, "diverged") | {"hyperparameters": words}, None
    error = summary(position_error(paths, test.future))
    errors = {"H": error["mean"], "H_90": error["p90"], "rms": error["rms"]}
    errors |= _promise(plan, predictor, instants, paths, test)
    return {**errors, "status": "ok", "sentence": one.sentence, "hyperparameters": words}, paths


def _beyond_ships(paths: Array, step: float) -> NDArray[np.bool_]:
    """Which windows (S,) have a place of paths (T, S, 2) [m] that is no number, or out of reach within the horizon.

    The limit of speed is that at which the physics has diverged, too.
    """
    within = lengths(paths) <= SPEED_LIMIT * step * len(paths)
    return np.asarray(~within.all(axis=0))


def _promise(plan: Plan, predictor: Predictor, instants: Instants, paths: Array, test: Windows) -> dict[str, float]:
    """Share of whole test paths in the band of the study's level, and its mean radius [m]; NaN without a band."""
    level = plan.level
    if predictor.bands is None or not predictor.bands.promises(level):
        return {"coverage": np.nan, "width": np.nan}
    region = predictor.band(paths, instants, level)
    return {"coverage": share_of(region.holds(test.future - paths), test.run), "width": float(region.radius.mean())}


def machine() -> dict[str, Any]:
    """What the results were computed with: interpreter, packages, machine."""
    packages = {"shipid": __version__}
    for name in PACKAGES:
        with suppress(PackageNotFoundError):  # an extra that is not installed
            packages[name] = version(name)
    system = {"python": sys.version.split()[0], "system": platform.platform(terse=True), "machine": platform.machine()}
    return {**system, "processor": f"{processor()}, {vectors()}", "cores": cores(), "packages": packages}


def _accuracy(foundation: Foundation, prepared: Prepared) -> dict[str, Any]:
    """A, A_90, A_rms [m] of a foundation; not a number without physics, and where it depends on the batch."""
    if foundation.base is None or foundation.fitted:
        return dict.fromkeys(ACCURACY, np.nan)
    accuracy: Mapping[str, Any] = prepared.accuracy(foundation.name)
    return {key: accuracy[name] for key, name in ACCURACY.items()}


def _predictor(
    plan: Plan,
    prepared: Prepared,
    foundation: Foundation,
    way: Way,
    batch: Batch,
    corrector: Corrector,
    windows: Windows,
) -> Predictor:
    return Predictor(
        physics=_physics(plan, foundation),
        method=way.kind,
        corrector=corrector,
        limits=limits_of(windows, prepared.commands),
        commands=plan.commands,
        causal=plan.causal,
        run_up=windows.num_past * windows.step if foundation.observer is not None else 0.0,
        provenance={
            "study": plan.name,
            "digest": plan.digest,
            "cell": batch.cell(foundation.name, way.name),
            "foundation": foundation.name,
            "method": way.name,
            "runs": list(windows.spans),
            "shipid": __version__,
        },
    )


def _compute(
    plan: Plan,
    prepared: Prepared,
    units: Iterable[Unit],
    workers: int | None,
    scheduler: str | None,
    device: str,
    origin: Origin,
) -> Computed:
    """Units and their results in the order in which they finish; what they were computed with is noted before."""
    trials, holder = (origin.folder / store.JOURNALS).absolute(), origin.claims.holder
    if scheduler is None:
        work = partial(_here, plan, prepared, device=device, trials=trials, holder=holder)
        for unit, (now, results) in on_workers(work, units, workers or cores()):
            origin.note_engine(now)
            yield unit, results
        return
    from shipid.study.cluster import on_dask  # takes time to import, and memory in every worker

    shared = plan, prepared, device, trials, holder, plan.code
    of_user = [way.method for way in plan.methods if of_users(type(way.method))]
    named = ((unit.key, unit) for unit in units)
    for unit, (sessions, results) in on_dask(scheduler, _there, shared, named, plan.digest, of_user):
        for session in sessions:
            if changed := origin.note(session):
                log.warning("computed otherwise on the cluster: %s", "; ".join(changed))
        yield unit, results


def _here(
    plan: Plan, prepared: Prepared, unit: Unit, device: str, trials: Path, holder: Holder
) -> tuple[str | None, Results | str]:
    """A unit on a worker of this machine: the engine that the worker has by now, and the results."""
    results = _claimed(plan, prepared, unit, device, trials, holder)
    return engine_so_far(), results


def _there(
    shared: tuple[Plan, Prepared, str, Path, Holder, Mapping[str, Mapping[str, str]]], unit: Unit
) -> tuple[list[dict[str, Any]], Results | str]:
    """A unit on a machine of a cluster: what it was computed with, before and after, and the results."""
    plan, prepared, device, trials, holder, code = shared
    imported = replace(plan, methods=tuple(way for way in plan.methods if type(way.method).__module__ != "__main__"))
    try:
        here = imported.code
    except KeyError as unknown:
        words = f"its workers lack the term {unknown}: start them with --preload and your file that puts it into TERMS"
        raise ShipidError(words, path="--scheduler") from None
    session = session_on(device, {what: {**code.get(what, {}), **here.get(what, {})} for what in {**code, **here}})
    results = _claimed(plan, prepared, unit, device, trials, holder)
    return [session, {**session, "engine": engine()}], results


def _claimed(plan: Plan, prepared: Prepared, unit: Unit, device: str, trials: Path, holder: Holder) -> Results | str:
    """A unit whose claim is looked at before each write; a sentence in place of results where it is lost."""
    try:
        return run_unit(plan, prepared, unit, device, trials, partial(holder.check, unit.key))
    except TakenOver as lost:
        return str(lost)
