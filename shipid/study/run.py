"""The way of a study: document -> plan -> dataset -> windows -> foundation -> method -> cell -> stored evidence.

`_run_one` has the calls from a plan to what is stored, `run_unit` those within a unit of work.
"""

from __future__ import annotations

import logging
import os
import platform
import sys
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from shipid.arguments import as_path, check_class, check_whole_number
from shipid.capacity import processor_name, usable_cores
from shipid.data.dataset import read_dataset, write_dataset
from shipid.engine.engines import check_device
from shipid.engine.native import engine_description, noted_engine
from shipid.errors import ResultError, ShipidError
from shipid.files import make_folder, write_json
from shipid.hybrid.device import use_threads, vector_instructions
from shipid.hybrid.journal import Journal, append_lines, open_journal, whole_lines
from shipid.plugins import REGISTRIES, add_members, added_members, code_digest
from shipid.study import seals, store
from shipid.study.cells import (
    NO_ACCURACY,
    accuracy_of,
    errors_left_out,
    evaluate_cell,
    evaluate_mean,
    fit_method,
    work_of,
)
from shipid.study.cluster import journal_by_topic, on_dask
from shipid.study.envelope import input_envelope
from shipid.study.plan import Plan, Unit, own_code
from shipid.study.prepare import (
    PreparedStudy,
    foundation_record,
    obtain_runs,
    prepare,
    regression_paths,
    runs_by_amount,
)
from shipid.study.seals import PAGES, sole_writer
from shipid.study.workers import import_for_workers, on_workers
from shipid.version import __version__

DATA, COMMON = "dataset", "common"  # names of seals: of the runs, and of what all units share
PACKAGES = (
    *("casadi", "numpy", "scipy", "scikit-learn", "torch", "optuna", "pandas", "pyarrow"),
    *("dask", "distributed", "plotly"),
)
Code = Mapping[str, Mapping[str, str]]  # what a user wrote, as `Plan.code`
MAIN = "__main__"  # module of a script, a cell or a console
Computed = Iterator[tuple[Unit, list[store.Cell]]]


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


@dataclass(frozen=True)
class Means:
    """By what a study is computed: see `run_study`."""

    workers: int | None = None
    scheduler: str | None = None
    device: str = "cpu"
    shard: tuple[int, int] | None = None


def run_study(
    plan: Plan,
    folder: str | os.PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    device: str = "cpu",
    shard: tuple[int, int] | None = None,
) -> Generator[Event, None, None]:
    """Run what is not finished yet of a plan and store it in the folder; yields events.

    Numbers do not depend on the workers or on interruptions.

    workers : local processes, one thread each; default: one per core; 0: this process, for code of a cell.
    scheduler : address of a Dask scheduler to use instead, such as `tcp://host:8786`.
    device : PyTorch device of rollouts and training.
    shard : (i, n), i from 1: every n-th unit of the plan from the i-th on, into `shards/i-of-n` of a folder that
        `prepare_study` has made. The next run without a shard takes it in.

    Raises ShipidError where another process works in the folder, and where workers lack code that a user wrote.
    """
    check_class("plan", plan, Plan, "as of `read_plan`")
    folder = as_path("folder", folder)
    workers = None if workers is None else check_whole_number("workers", workers, 0)
    check_device(device)
    if scheduler is None and workers != 0:
        import_for_workers()
    for registry in REGISTRIES.values():
        _ = registry.offers  # says which names of packages are taken
    means = Means(workers, scheduler, device, shard)
    yield from (_run_parts if plan.parts else _run_one)(plan, folder, means)


def prepare_study(plan: Plan, folder: str | os.PathLike[str], *, device: str = "cpu") -> Iterator[Event]:
    """Make the folder of a study with what shards share: its runs, and what the physics alone says of them."""
    folder = as_path("folder", folder)
    with store.open_folder(folder, plan):
        for name, part in plan.parts.items():
            yield from prepare_study(part.plan, store.check_part(folder, name, part.plan), device=device)
        if not plan.parts:
            begun = session_on(device, own_code(plan))
            store.note_session(folder, begun)
            yield from _prepare_folder(plan, folder, folder, begun)
            make_folder(folder / store.SHARDS)
    yield Event("end", text=str(folder))


def _run_one(plan: Plan, folder: Path, means: Means) -> Iterator[Event]:
    """Run a study of one part, or a shard of it, alone in its folder."""
    start, shard = time.perf_counter(), means.shard
    place = folder if shard is None else store.shard_folder(folder, shard)
    if shard is not None:
        store.check_prepared(folder, plan, (DATA, COMMON))
    with store.open_folder(place, plan):
        for words in (*seals.unseal_missing(place), *(store.take_in(folder, plan) if shard is None else ())):
            yield Event("note", words)
        begun = session_on(means.device, own_code(plan))
        if changed := store.note_session(place, begun):
            yield Event("note", f"earlier results were computed otherwise: {'; '.join(changed)}")
        prepared = yield from _prepare_folder(plan, folder, place, begun)
        mine, left = _units(plan, folder, shard)
        if left:
            _check_common(folder, prepared)
        total, done = _cells(mine), _cells(mine) - _cells(left)
        yield Event("start", done=done, total=total)
        for unit, results in _compute(plan, prepared, left, place, begun, means):
            store.check_place(place, plan.digest)
            store.write_unit(place, unit, results)
            for cell in results:
                done += 1
                yield Event("cell", done=done, total=total, row=cell.row)
        if shard is None:
            _finish(plan, folder, prepared, means.device, start)
    yield Event("end", text=str(place), done=done, total=total)


def run_unit(
    plan: Plan, prepared: PreparedStudy, unit: Unit, device: str, journal: Journal | None = None
) -> list[store.Cell]:
    """All cells of one unit of work. Pure: the same on every worker. journal : in which its searches go on."""
    use_threads(1)
    check_device(device)
    work = work_of(prepared, unit, plan.methods, device)
    fitted = {name: fit_method(work, way, journal) for name, way in work.ways.items()}
    left_out = errors_left_out(work, fitted)
    origin = {"study": plan.name, "digest": plan.digest}
    cells: dict[tuple[str, str], store.Cell] = {}
    for name, method in unit.pairs:  # a mean comes after its parts
        is_mean = bool(work.known[name].foundation.mean_of)
        cells[name, method] = (
            evaluate_mean(work, (name, method), cells, fitted, left_out)
            if is_mean
            else evaluate_cell(work, (name, method), fitted, left_out, origin)
        )
    return list(cells.values())


def _prepare_folder(
    plan: Plan, folder: Path, place: Path, begun: dict[str, Any]
) -> Generator[Event, None, PreparedStudy]:
    """Make what all units share, from the runs of a study, which are obtained where they are not stored.

    place : the folder, or that of a shard, where the session is noted.
    """
    if not seals.is_sealed(folder, DATA):
        yield Event("note", _obtaining_words(plan))
        dataset = obtain_runs(plan)
        store.check_place(folder, plan.digest)
        note_sessions(place, session_by_now(begun))
        write_dataset(dataset, folder / store.DATASET)
        seals.write_seal(folder, DATA, [folder / store.DATASET])
    yield Event("note", "rolling out the foundations")
    prepared = prepare(plan, read_dataset(folder / store.DATASET), begun["device"])
    store.check_place(place, plan.digest)
    note_sessions(place, session_by_now(begun))
    if not seals.is_sealed(folder, COMMON):
        _write_common(plan, folder, prepared)
    for note in prepared.notes:
        yield Event("note", note)
    return prepared


def _paths_alone(prepared: PreparedStudy) -> dict[str, np.ndarray]:
    """Paths (T, S, 2) [m] on the test windows by foundation that is not fitted and no mean of others."""
    every = prepared.known.items()
    return {name: one.test_paths for name, one in every if not (one.foundation.fitted or one.foundation.mean_of)}


def _check_common(folder: Path, prepared: PreparedStudy) -> None:
    """Raise ResultError where true or physics paths of the test are stored that this shipid makes otherwise."""
    test, stored, *_ = store.read_test(folder)
    now = {"truth": prepared.test.future, **_paths_alone(prepared)}
    for name, old in {"truth": test.future, **stored}.items():
        if old.shape != now[name].shape or not np.allclose(old, now[name], rtol=1e-3, atol=1e-4, equal_nan=True):
            message = f"holds test paths of {name} by another version of shipid, which this one makes otherwise"
            raise ResultError(f"{message}: read its report.html, and run the study into a new folder", file=folder)


def _write_common(plan: Plan, folder: Path, prepared: PreparedStudy) -> None:
    """Store what no unit computes, so that a report needs nothing else."""
    test, paths = prepared.test, _paths_alone(prepared)
    store.write_test(folder, test, paths, prepared.naive, *regression_paths(prepared, plan.batches))
    rows = input_envelope(prepared.pool, test, runs_by_amount(plan.study, prepared.pool), prepared.commands)
    write_json(folder / store.ENVELOPE, rows)
    known = {
        name: accuracy_of(one.test_paths, test)
        | {"diverged_training": int(one.diverged.sum()), "diverged_test": int(one.test_diverged.sum())}
        for name, one in prepared.known.items()
        if name in paths and one.foundation.base is not None
    }
    described = [{**foundation_record(one), **known.get(one.name, NO_ACCURACY)} for one in prepared.foundations]
    write_json(folder / store.FOUNDATIONS, described)
    seals.write_seal(folder, COMMON, [folder / name for name in (store.TEST, store.ENVELOPE, store.FOUNDATIONS)])


def _compute(
    plan: Plan, prepared: PreparedStudy, units: Iterable[Unit], place: Path, begun: dict[str, Any], means: Means
) -> Computed:
    """Units and their results in the order in which they finish; what they were computed with is noted before."""
    folder, check = place.absolute() / store.JOURNALS, partial(store.check_place, place.absolute(), plan.digest)
    make_folder(folder)
    if means.scheduler is None:
        work = partial(_on_pool, plan, prepared, folder, check, begun)
        for unit, (session, results) in on_workers(
            work, units, usable_cores() if means.workers is None else means.workers
        ):
            note_sessions(place, session)
            yield unit, results
        return
    tasks = [(unit.key, (unit, whole_lines(folder / f"{unit.key}.log"))) for unit in units]

    def write(key: str, lines: bytes) -> None:
        append_lines(folder / f"{key}.log", check, lines)

    shared = plan, prepared, means.device, own_code(plan), added_members()
    for (unit, _), (noted, results) in on_dask(means.scheduler, _on_cluster, shared, tasks, plan.digest, write):
        note_sessions(place, *noted)
        yield unit, results


def _on_pool(
    plan: Plan, prepared: PreparedStudy, folder: Path, check: Callable[[], object], begun: dict[str, Any], unit: Unit
) -> tuple[dict[str, Any], list[store.Cell]]:
    """A unit on a worker of this machine: what it was computed with, and the results."""
    session = {**begun, **code_at_worker(plan, {})}
    journal = open_journal(folder / f"{unit.key}.log", check, plan.digest)
    results = run_unit(plan, prepared, unit, begun["device"], journal)
    return session_by_now(session), results


def _on_cluster(
    shared: tuple[Plan, PreparedStudy, str, Code, list[bytes]], task: tuple[Unit, bytes], topic: str
) -> tuple[list[dict[str, Any]], list[store.Cell]]:
    """A unit on a worker of a cluster: what it was computed with, before and after, and the results."""
    (plan, prepared, device, code, members), (unit, journal) = shared, task
    add_members(members)
    session, file = session_on(device, code_at_worker(plan, code)), Path(store.JOURNALS, f"{unit.key}.log")
    results = run_unit(plan, prepared, unit, device, journal_by_topic(journal, plan.digest, topic, file))
    return [session, {**session, "engine": engine_description()}], results


def _finish(plan: Plan, folder: Path, prepared: PreparedStudy, device: str, start: float) -> None:
    """Write what only the end of a run knows: the tables, and in the provenance notes, machine and time."""
    record = store.provenance(folder)
    if seals.is_sealed(folder, store.RESULTS) and record["wall_seconds"]:
        return
    record |= {"notes": list(prepared.notes), "machine": {**machine(), "device": device}}
    record["wall_seconds"] += time.perf_counter() - start
    write_json(folder / store.PROVENANCE, record)
    with sole_writer(folder, PAGES, wait=True):
        store.write_results(folder, plan, store.read_rows(folder, plan))


def _run_parts(plan: Plan, folder: Path, means: Means) -> Iterator[Event]:
    """Run the parts of a study one after the other, each in its folder; events count the cells of all parts.

    A shard goes on counting units from part to part.
    """
    with store.open_folder(folder, plan) if means.shard is None else nullcontext():
        works, done, total, before = {}, dict[str, int](), 0, 0
        for name, part in plan.parts.items():
            where, shard = store.check_part(folder, name, part.plan), means.shard
            if shard is not None:
                shard = (shard[0] - 1 - before) % shard[1] + 1, shard[1]
            mine, left = _units(part.plan, where, shard)
            works[name] = part.plan, where, replace(means, shard=shard)
            total, done[name] = total + _cells(mine), _cells(mine) - _cells(left)
            before += len(part.plan.units)
        yield Event("start", done=sum(done.values()), total=total)
        for name, work in works.items():
            yield Event("note", f"{name}:")
            for event in _run_one(*work):
                if event.kind != "note":
                    done[name] = event.done  # of shards that were taken in, too
                if event.kind in ("note", "cell"):
                    yield replace(event, done=sum(done.values()), total=total)
    yield Event("end", text=str(folder), done=sum(done.values()), total=total)


def _units(plan: Plan, folder: Path, shard: tuple[int, int] | None) -> tuple[Sequence[Unit], list[Unit]]:
    """The units of a plan, or of a shard of it, and those that are not finished."""
    mine = plan.units if shard is None else plan.units[shard[0] - 1 :: shard[1]]
    places = (folder,) if shard is None else (folder, store.shard_folder(folder, shard))
    finished = {unit.key for place in places for unit in store.finished_units(place, mine)}
    return mine, [unit for unit in mine if unit.key not in finished]


def _cells(units: Iterable[Unit]) -> int:
    return sum(len(unit.pairs) for unit in units)


def _obtaining_words(plan: Plan) -> str:
    """What is done to obtain the runs, in words."""
    if plan.study.data is None:
        return "simulating the truth"
    return "importing the log" if plan.study.data.dataset is None else "reading the dataset"


def note_sessions(folder: Path, *sessions: Mapping[str, Any]) -> None:
    """Note what this process or a worker computes with by now; a warning for a session that is new to the folder."""
    for session in sessions:
        known = session in store.provenance(folder)["sessions"]
        if not known and (changed := store.note_session(folder, session)):
            logging.getLogger(__name__).warning(
                "computed otherwise in this process or a worker: %s", "; ".join(changed)
            )


def session_by_now(begun: Mapping[str, Any]) -> dict[str, Any]:
    """A session of this process with its engine of now: another one from when on a model could not be compiled."""
    return {**begun, "engine": noted_engine() or begun["engine"]}


def session_on(device: str, code: Code) -> dict[str, Any]:
    """What results depend on beside the plan, to the last digit: versions, engine, processor, device, users' code."""
    computer = machine()
    others = {name: version for name, version in computer["packages"].items() if name != "shipid"}
    return {
        "shipid": f"{__version__}, code {code_digest()}",  # the code may differ and the version not
        "engine": engine_description(),
        "processor": computer["processor"],
        "python": computer["python"],
        "device": device,
        "packages": others,
        **code,
    }


def machine() -> dict[str, Any]:
    """What the results were computed with: interpreter, packages, machine."""
    packages = {"shipid": __version__}
    for name in PACKAGES:
        with suppress(PackageNotFoundError):  # an extra that is not installed
            packages[name] = version(name)
    system = {"python": sys.version.split()[0], "system": platform.platform(terse=True), "machine": platform.machine()}
    return {
        **system,
        "processor": f"{processor_name()}, {vector_instructions()}",
        "cores": usable_cores(),
        "packages": packages,
    }


def code_at_worker(plan: Plan, code: Code) -> dict[str, dict[str, str]]:
    """What the user wrote as a worker has it; `code` is that of the process that gave the work.

    A method of that process's script has no file on another machine. Raises ShipidError where the worker lacks a term.
    """
    imported = replace(plan, methods=tuple(way for way in plan.methods if type(way.method).__module__ != MAIN))
    try:
        here = own_code(imported)
    except KeyError as unknown:
        remedy = "write it into a file that they can import or that `--with` names, or take workers = 0"
        raise ShipidError(f"workers lack the term {unknown}: {remedy}") from None
    return {what: {**code.get(what, {}), **here.get(what, {})} for what in {**code, **here}}
