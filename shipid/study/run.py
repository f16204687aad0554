"""Run a plan: batches on workers, results stored as they come, so that an interrupted run resumes."""

from __future__ import annotations

import logging
import os
import platform
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from shipid.data.dataset import read_dataset, write_dataset
from shipid.data.windows import Instants, Windows, covered
from shipid.engine.native import engine
from shipid.errors import ShipidError
from shipid.files import read_json, write_json
from shipid.hybrid.journal import Journal
from shipid.hybrid.method import Case, Corrector, Fitted, Task
from shipid.hybrid.physics import Physics
from shipid.hybrid.training import check_device, use_threads
from shipid.metrics import position_error, summary
from shipid.predictor import Array, Predictor, bands_of, limits_of, refit_folds
from shipid.study import seals, store
from shipid.study.claims import Claims, pause
from shipid.study.envelope import envelope
from shipid.study.foundations import Prediction, apart, predictions
from shipid.study.plan import Batch, Foundation, Plan, Way
from shipid.study.prepare import (
    Prepared,
    at_instants,
    describe,
    instants_of,
    obtain,
    physics_of,
    prepare,
    runs_by_amount,
    window_memory,
)
from shipid.study.workers import import_for_workers, on_workers

PACKAGES = ("shipid", "casadi", "numpy", "torch", "optuna", "pandas", "pyarrow", "dask", "distributed", "plotly")

DASK = {  # a graph is never large here; a scheduler that is gone is noticed in seconds
    "distributed.admin.large-graph-warning-threshold": "1GB",
    "distributed.comm.timeouts.connect": "5s",
    "distributed.comm.retry.count": 0,
}
DATA, COMMON = "dataset", "common"  # names of seals: of the runs, and of what all batches share
Rows = list[dict[str, Any]]
Computed = Iterator[tuple[Batch, list[tuple[dict[str, Any], Predictor | None]]]]

ACCURACY = {"A": "mean", "A_90": "p90", "A_rms": "rms"}  # of the physics alone


@dataclass(frozen=True)
class Event:
    """Something a user may want to see while a study runs.

    kind : `note` (text), `start` (done and total cells known), `cell` (one finished: row), `end` (text: the folder).
    """

    kind: str
    text: str = ""
    done: int = 0
    total: int = 0
    row: dict[str, Any] = field(default_factory=dict)


def run_study(
    plan: Plan,
    folder: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    device: str = "cpu",
) -> Iterator[Event]:
    """Run what is not finished yet of a plan and store it in the folder; yields events.

    Numbers do not depend on the workers or on interruptions: an interrupted batch is done again, its searches go on
    from the journal of trials.

    Parameters
    ----------
    workers : local processes, one thread each; default: one per core, no more than batches.
    scheduler : address of a Dask scheduler to use instead, such as `tcp://host:8786`.
    device : PyTorch device of rollouts and training.
    """
    begun = time.perf_counter()
    check_device(device)
    store.open_folder(folder, plan)
    if plan.parts:
        yield from _run_parts(plan, folder, workers, scheduler, device)
        return
    for words in (*seals.mend(folder), *_other_session(folder, device)):
        yield Event("note", words)
    if scheduler is None:
        import_for_workers()
    if not seals.is_sealed(folder, DATA):
        made = plan.study.data is not None and plan.study.data.dataset is not None
        doing = "reading the dataset" if made else "importing the log"
        yield Event("note", "simulating the truth" if plan.study.truth else doing)
        write_dataset(obtain(plan), folder / store.DATASET)
        seals.write_seal(folder, DATA, [folder / store.DATASET])
    dataset = read_dataset(folder / store.DATASET)
    yield Event("note", "rolling out the foundations")
    prepared = prepare(plan, dataset, device)
    if not seals.is_sealed(folder, COMMON):
        _write_common(plan, folder, prepared)
    for note in prepared.notes:
        yield Event("note", note)
    cells = len(store.finished(folder, plan.batches)) * len(plan.pairs)
    yield Event("start", done=cells, total=plan.cells)
    trials = (folder / store.TRIALS).absolute()
    Journal(trials)

    def compute(batches: Iterable[Batch]) -> Computed:
        return _compute(plan, prepared, batches, workers, scheduler, device, trials)

    with Claims(folder) as claims:
        for rows in _shared(plan, folder, claims, compute):
            for row in rows:
                cells += 1
                yield Event("cell", done=cells, total=plan.cells, row=row)
    record = read_json(folder / store.PROVENANCE)
    record["notes"] = list(prepared.notes)
    record["machine"] = {**machine(), "device": device}
    record["wall_seconds"] = record.get("wall_seconds", 0.0) + time.perf_counter() - begun
    write_json(folder / store.PROVENANCE, record)
    store.write_results(folder, store.read_rows(folder))
    yield Event("end", text=str(folder), done=cells, total=plan.cells)


def _run_parts(plan: Plan, folder: Path, workers: int | None, scheduler: str | None, device: str) -> Iterator[Event]:
    """Run every part of a study in a folder of its own, one after the other; events count the cells of all."""
    total = sum(part.plan.cells for part in plan.parts.values())
    folders = {name: store.part_folder(folder, name) for name in plan.parts}
    done = sum(
        len(store.finished(folders[name], part.plan.batches)) * len(part.plan.pairs)
        for name, part in plan.parts.items()
    )
    yield Event("start", done=done, total=total)
    for name, part in plan.parts.items():
        yield Event("note", f"{name}:")
        for event in run_study(part.plan, folders[name], workers=workers, scheduler=scheduler, device=device):
            if event.kind == "cell":
                done += 1
                yield replace(event, done=done, total=total)
            elif event.kind == "note":
                yield event
    yield Event("end", text=str(folder), done=done, total=total)


def _write_common(plan: Plan, folder: Path, prepared: Prepared) -> None:
    """Store what all batches share, so that a report needs nothing else."""
    fixed = {one.name: prepared.test_paths[one.name] for one in prepared.foundations if one.identify is None}
    store.write_test(folder, prepared.test, fixed, prepared.naive)
    write_json(
        folder / store.ENVELOPE,
        envelope(prepared.pool, prepared.test, runs_by_amount(plan, prepared.pool), prepared.commands),
    )
    write_json(
        folder / store.FOUNDATIONS, [{**describe(one), **_accuracy(one, prepared)} for one in prepared.foundations]
    )
    seals.write_seal(folder, COMMON, [folder / name for name in (store.TEST, store.ENVELOPE, store.FOUNDATIONS)])


def _other_session(folder: Path, device: str) -> Iterator[str]:
    """Note what this run is computed with; a sentence where earlier results were computed with something else."""
    found = machine()
    packages = found["packages"]
    session = {"shipid": packages.pop("shipid"), "engine": engine(), "python": found["python"], "device": device}
    changed = store.note_session(folder, {**session, "packages": packages})
    if changed:
        yield f"earlier results were computed otherwise: {'; '.join(changed)}"


def _shared(plan: Plan, folder: Path, claims: Claims, compute: Callable[[Iterable[Batch]], Computed]) -> Iterator[Rows]:
    """Rows of every batch that is not finished yet, computed here or, where another run is at work on it, there."""
    known = set(store.finished(folder, plan.batches))
    while left := [batch for batch in plan.batches if batch not in known]:
        before = len(known)
        for batch, results in compute(_free(left, folder, claims)):
            store.write_batch(folder, batch, results)
            claims.give_back(batch.key)
            known.add(batch)
            yield [row for row, _ in results]
        for batch in store.finished(folder, left):
            if batch not in known:  # another run has finished it
                known.add(batch)
                yield store.read_batch(folder, batch)
        if len(known) == before:
            pause()


def _free(left: Sequence[Batch], folder: Path, claims: Claims) -> Iterator[Batch]:
    """Batches on which nobody works, each claimed when it is taken from here."""
    for batch in left:
        if not store.finished(folder, [batch]) and claims.take(batch.key):
            if store.finished(folder, [batch]):  # by another run, just before its claim ended
                claims.give_back(batch.key)
            else:
                yield batch


def run_batch(
    plan: Plan, prepared: Prepared, batch: Batch, device: str, trials: Path | None = None
) -> list[tuple[dict[str, Any], Predictor | None]]:
    """All cells of one batch: (row of results, predictor) each. Pure: the same on every worker.

    trials : the journal in which searches go on; on a machine that does not see the file, they are kept in memory.
    """
    use_threads(1)
    check_device(device)
    journal = Journal(trials) if trials is not None and trials.is_file() else None
    runs = prepared.runs(plan, batch)
    windows = prepared.pool.select(np.isin(prepared.pool.run, runs))
    known = predictions(plan, prepared, runs, device)
    shared = {"N_D": batch.N_D, "seed": batch.seed, "runs": len(runs), "minutes": covered(windows) / 60}
    fitted = {way.name: _fitted(plan, prepared, batch, windows, known, way, device, journal) for way in plan.methods}
    left_out = refitted(plan, prepared, batch, windows, fitted, device)
    results: list[tuple[dict[str, Any], Predictor | None]] = []
    for name, way in plan.pairs:
        one, result = known[name], fitted[way.name][name]
        row = {"cell": batch.cell(name, way.name), **_names(one, way, prepared.test), **shared}
        errors, seconds = left_out.get((name, way.name), (None, 0.0))
        row |= {"seconds": result.seconds + one.seconds + seconds, "trials": result.trials}
        if result.corrector is None:
            predictor, outcome = None, _failed(one.sentence or "no training converged")
        else:
            predictor = _predictor(plan, prepared, one.foundation, way, batch, result.corrector, windows)
            if one.foundation.identify is None and result.left_out is not None:
                errors = result.left_out  # fair: these numbers were not taken from these runs
            bands, reason = bands_of(errors, windows, predictor.limits, prepared.kinds)
            known_why = {} if bands is not None else {"no_band": reason}
            predictor = replace(predictor, bands=bands, provenance={**predictor.provenance, **known_why})
            outcome = _judged(plan, prepared, one, predictor, way)
        results.append(({**row, **outcome}, predictor))
    return results


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
    foundations identified from the runs of the batch. None of them unless the study has `bands.refits`.
    """
    identified = {one.name for one in prepared.foundations if one.identify is not None}
    pairs = [
        (name, way)
        for name, way in plan.pairs
        if fitted[way.name][name].corrector is not None
        and (name in identified or fitted[way.name][name].left_out is None)
    ]
    refits = plan.study.bands.refits
    if not refits or not pairs:
        return {}
    found = {(name, way.name): (np.full_like(windows.future, np.nan), 0.0) for name, way in pairs}
    names = {name for name, _ in pairs}
    data = apart(prepared.data, prepared.test)
    place = np.flatnonzero(np.isin(prepared.pool.run, prepared.runs(plan, batch)))
    for training, judged in refit_folds(windows, refits, batch.seed):
        rest, part = windows.select(training), windows.select(judged)
        inside = replace(
            prepared,
            data=data,
            pool=rest,
            test=part,
            pool_paths={name: paths[:, place[training]] for name, paths in prepared.pool_paths.items()},
            test_paths={name: paths[:, place[judged]] for name, paths in prepared.pool_paths.items()},
        )
        known = predictions(plan, inside, tuple(rest.spans), device, names)
        for way in plan.methods:
            mine = [name for name, other in pairs if other.name == way.name]
            again = _fitted(plan, inside, batch, rest, known, replace(way, foundations=tuple(mine)), device, None)
            for name in mine:
                one, result, (errors, seconds) = known[name], again[name], found[name, way.name]
                found[name, way.name] = errors, seconds + result.seconds + one.seconds
                if result.corrector is None:
                    continue
                predictor = _predictor(plan, inside, one.foundation, way, batch, result.corrector, rest)
                instants = instants_of(plan, predictor.vessel, inside.data, part, one.estimates)
                errors[:, judged] = part.future - predictor.predict(instants, one.test_paths)
    return found


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
    """Results of one method for the foundations that it meets."""
    mine = {name: known[name] for name in way.foundations}
    cases = {name: Case(_physics(plan, one.foundation), one.paths) for name, one in mine.items()}
    task = Task(
        cases=cases,
        windows=windows,
        folds=prepared.folds(plan, batch, windows, way.method.validation) if way.method.compensates else (),
        commands=prepared.commands,
        known=plan.study.prediction.commands == "known",
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
    return way.method.fit(task)


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


def _judged(plan: Plan, prepared: Prepared, one: Prediction, predictor: Predictor, way: Way) -> dict[str, Any]:
    """Errors [m] of a predictor on the test windows, and what its search chose."""
    chosen, test = predictor.corrector.hyperparameters, prepared.test
    words = ", ".join(f"{name} {chosen[name]:.3g}" for name in way.method.varied() if name in chosen)
    failed = ~np.isfinite(one.test_paths).all(axis=(0, 2))
    if failed.any():
        share = f"physics diverges on {failed.mean():.1%} of the test windows"
        sentence = share if np.isfinite(one.paths).all() else one.sentence
        return _failed(sentence, "diverged") | {"hyperparameters": words}
    instants = instants_of(plan, predictor.vessel, prepared.data, test, one.estimates)
    paths = predictor.predict(instants, one.test_paths)
    if not np.isfinite(paths).all():
        return _failed("the prediction diverges on test windows", "diverged") | {"hyperparameters": words}
    error = summary(position_error(paths, test.future))
    errors = {"H": error["mean"], "H_90": error["p90"], "rms": error["rms"]}
    errors |= _promise(plan, predictor, instants, paths, test)
    return {**errors, "status": "ok", "sentence": one.sentence, "hyperparameters": words}


def _promise(plan: Plan, predictor: Predictor, instants: Instants, paths: Array, test: Windows) -> dict[str, float]:
    """Share of whole test paths inside the band of the study's level, and its mean radius [m]; NaN without a band."""
    level = plan.study.bands.level
    if predictor.bands is None or not predictor.bands.promises(level):
        return {"coverage": np.nan, "width": np.nan}
    region = predictor.band(paths, instants, level)
    return {"coverage": float(region.holds(test.future - paths).mean()), "width": float(region.radius.mean())}


def machine() -> dict[str, Any]:
    """What the results were computed with: interpreter, packages, machine."""
    packages = {}
    for name in PACKAGES:
        with suppress(PackageNotFoundError):  # an extra that is not installed
            packages[name] = version(name)
    system = {"python": sys.version.split()[0], "system": platform.platform(terse=True), "machine": platform.machine()}
    return {**system, "cores": os.cpu_count(), "packages": packages}


def _accuracy(foundation: Foundation, prepared: Prepared) -> dict[str, Any]:
    """A, A_90, A_rms [m] of a foundation; not a number without physics, and where it depends on the batch."""
    if foundation.base is None or foundation.identify is not None:
        return dict.fromkeys(ACCURACY, np.nan)
    found: Mapping[str, Any] = prepared.accuracy(foundation.name)
    return {key: found[name] for key, name in ACCURACY.items()}


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
        commands=plan.study.prediction.commands,
        causal=plan.causal,
        provenance={
            "study": plan.name,
            "digest": plan.digest,
            "cell": batch.cell(foundation.name, way.name),
            "foundation": foundation.name,
            "method": way.name,
            "runs": list(windows.spans),
            "shipid": version("shipid"),
        },
    )


def _compute(
    plan: Plan,
    prepared: Prepared,
    batches: Iterable[Batch],
    workers: int | None,
    scheduler: str | None,
    device: str,
    trials: Path,
) -> Computed:
    """Batches and their results in the order in which they finish."""
    if scheduler is not None:
        yield from _on_dask(plan, prepared, batches, scheduler, device, trials)
        return
    work = partial(run_batch, plan, prepared, device=device, trials=trials)
    yield from on_workers(work, batches, workers or os.cpu_count() or 1)


def _on_dask(
    plan: Plan, prepared: Prepared, batches: Iterable[Batch], scheduler: str, device: str, trials: Path
) -> Computed:
    """The same on the cluster of an existing scheduler; ShipidError where it, or a worker, dies."""
    try:
        import dask
        from dask.distributed import CancelledError, Client, KilledWorker, as_completed
    except ImportError:
        message = "a Dask scheduler needs the package dask: pip install 'shipid[dask]'"
        raise ShipidError(message, path=f"--scheduler {scheduler}") from None

    with warnings.catch_warnings(), dask.config.set(DASK), _without_logs("distributed", "tornado", "asyncio"):
        warnings.simplefilter("ignore")
        try:
            client = Client(scheduler, timeout="10s")
        except (OSError, ValueError) as error:
            raise ShipidError(f"no Dask scheduler answers there ({error})", path=f"--scheduler {scheduler}") from None
        try:
            shared = client.scatter([plan, prepared], broadcast=True)
            futures = {
                client.submit(
                    run_batch, *shared, batch, device, trials, key=f"{plan.name}-{plan.digest}-{batch.key}", pure=False
                ): batch
                for batch in batches
            }
            for future in as_completed(futures):
                yield futures[future], future.result()
        except (OSError, TimeoutError, CancelledError, KilledWorker) as error:
            kept = "what is finished is kept: go on with `shipid study resume`"
            if isinstance(error, KilledWorker):
                message = f"workers of the cluster die, perhaps for want of memory; {kept} and larger workers"
            else:
                message = f"the Dask scheduler or its workers are gone; {kept}"
            raise ShipidError(message, path=f"--scheduler {scheduler}") from None
        finally:
            with suppress(Exception):  # a client whose scheduler is gone complains in many ways
                client.close(timeout=2)


@contextmanager
def _without_logs(*names: str) -> Iterator[None]:
    """Silence loggers and those below them, whose errors are said in one line."""
    every = [logging.getLogger(name) for name in logging.root.manager.loggerDict if name.split(".")[0] in names]
    before = {logger: logger.level for logger in every}
    try:
        for logger in every:
            logger.setLevel(logging.CRITICAL + 1)
        yield
    finally:
        for logger, level in before.items():
            logger.setLevel(level)
