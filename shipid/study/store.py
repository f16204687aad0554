"""Results: a folder that can be copied and opened anywhere, written batch by batch."""

from __future__ import annotations

import errno
import json
import os
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shipid import document as documents
from shipid.data.windows import Windows
from shipid.errors import DocumentError, ResultError, ShipidError
from shipid.files import (
    as_argument,
    make_folder,
    open_file,
    part_of,
    read_arrays,
    read_json,
    sweep,
    sync,
    temporary_folder,
    write_arrays,
    write_json,
    write_table,
    write_text,
)
from shipid.hybrid.methods import METHODS
from shipid.physics import TERMS
from shipid.predictor import Predictor
from shipid.study import seals
from shipid.study.code import code_digest
from shipid.study.declared import Foundation
from shipid.study.plan import METHOD_CODE, TERM_CODE, USER_SCRIPT, WITH, Plan, Unit, build_plan
from shipid.units import listed, plural
from shipid.version import __version__
from shipid.vessel.load import check_vessel

STUDY, VESSELS, PROVENANCE, FOUNDATIONS = "study.toml", "vessels.json", seals.PROVENANCE, "foundations.json"
DATASET, TEST, ENVELOPE = "dataset.parquet", "test.npz", "envelope.json"
JOURNALS, TRIALS = "trials", "trials.log"
FOLDERS = ("cells", "predictions", "batches", "claims", seals.FOLDER, JOURNALS)
LISTED = ("batches", "claims", seals.FOLDER, JOURNALS)  # folders whose files say how far a run is
RESULTS = "results"  # name of the seal of the tables
PARTS = "parts"
COPY = "copy the folder of the run, and name the copy"  # what helps where this user may not write
UNITS = {**dict.fromkeys(("A", "A_90", "A_rms", "H", "H_90", "rms", "width"), "m"), "coverage": "1", "seconds": "s"}
METRICS = tuple(UNITS)
ENTRIES: dict[str, tuple[type | tuple[type, ...], type]] = {
    **dict.fromkeys(("digest", "name", "file", "program"), (str, object)),
    **dict.fromkeys(("sources", "changes", "machine", METHOD_CODE, TERM_CODE), (dict, object)),
    **{"sessions": (list, dict), "notes": (list, str), "wall_seconds": ((float, int), object)},
}
"""Entries of the provenance -> what each is, and what those in it are."""


class NotTaken(ResultError):
    """The folder of a run whose documents this shipid does not take: of another version, or of a user's method."""


class Cell(NamedTuple):
    """Result of a cell: its row, and where it has a result its predictor and the test paths (T, S, 2) [m] it gives."""

    row: dict[str, Any]
    predictor: Predictor | None = None
    paths: np.ndarray | None = None


def open_folder(folder: Path, plan: Plan) -> None:
    """Make the folder of a run, or check that an existing one belongs to the same study.

    It appears with all that says what it is, so that of two runs that begin at once only one makes it; the other joins
    it, or is refused if it is of another plan.
    """
    if folder.is_symlink() and not folder.exists():
        raise ResultError("is a link that leads nowhere: choose another --out", file=folder)
    if folder.exists() and not folder.is_dir():
        raise ResultError("is a file: choose another --out", file=folder)
    try:
        make_folder(folder.parent)
        sweep(folder.parent)
        if not (folder / STUDY).exists():
            if os.path.realpath(folder) == os.getcwd():  # it is made anew, under the feet of this process
                raise ResultError("is the working folder: name a new one by --out, such as --out run", file=folder)
            _make(folder, plan)
    except OSError as error:
        raise ResultError(f"cannot be made ({error.strerror}): choose another --out", file=folder) from None
    check_readable(folder)
    if provenance(folder)["digest"] != plan.digest:
        raise ResultError(_other_study(folder, plan), file=folder)
    for name in FOLDERS:
        if os.path.lexists(folder / name) and not (folder / name).is_dir():
            raise ResultError("is no folder, where one belongs: move it away, and resume", file=folder / name)
    check_writable(folder)
    _check_journals(folder, plan)
    _mend(folder, plan)
    sweep_run(folder)


def _other_study(folder: Path, plan: Plan) -> str:
    """What a folder holds that is of another digest: where the documents are equal, what was changed since."""
    if documents.read(folder / STUDY) != plan.document:
        return f"holds the results of another study than {plan.file}: choose another --out"
    stored, record = read_json(folder / VESSELS), provenance(folder)
    try:
        vessels = [one.file for name, one in plan.vessels.items() if stored[name]["document"] != one.document]
    except (TypeError, KeyError):
        raise ResultError("damaged: run the study again into a new folder", file=folder / VESSELS) from None
    before = record.get("sources", plan.sources)  # an early version noted none
    sources = [name for name, digest in plan.sources.items() if before.get(name) != digest]
    changed = [*vessels, *(f"the {name.rpartition('/')[2]} of {plan.file}" for name in sources)]
    if not changed:
        then, now = record.get(METHOD_CODE, {}), plan.code.get(METHOD_CODE, {})
        changed = [f"the method {name!r}" for name, digest in then.items() if now.get(name) != digest]
    if not changed:
        return _otherwise_made(record)
    words = f"holds results from before {listed(changed)} changed: choose another --out"
    resume = f"{plan.program} study resume {as_argument(folder)}"
    return f"{words}, or go on with the vessel as it was: `{resume}`" if changed == vessels else words


def _otherwise_made(record: Mapping[str, Any]) -> str:
    """What a folder of the same documents and data is whose digest is another one."""
    made = next((str(session["shipid"]) for session in record.get("sessions", [])[-1:] if "shipid" in session), "")
    here = f"{__version__}, code {code_digest()}"
    if made == here:
        why = "it was changed by hand, or a method has other defaults"
        return f"says that it is of another study, and holds this one: {why}: choose another --out"
    versions = f"{made}; this is {here}" if made else f"this is {here}"
    return f"was made by another version of shipid ({versions}), whose defaults are others: choose another --out"


def check_readable(folder: Path) -> None:
    """Raise ResultError for what says which run a folder holds, and how far, where this user may not read it."""
    for name in (STUDY, VESSELS, PROVENANCE):
        try:
            with open_file(folder / name) as stream:
                stream.read()
        except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
            continue  # said elsewhere
        except OSError as error:
            raise ResultError(f"cannot be read ({error.strerror}): let this user read it", file=folder / name) from None
    for name in LISTED:
        if (folder / name).is_dir() and not os.access(folder / name, os.R_OK | os.X_OK):
            raise ResultError("is a folder that this user may not read: let this user read it", file=folder / name)


def check_writable(folder: Path) -> None:
    """Raise ResultError for the folder of a run, or one in it, where this user may not write or replace files."""
    for place in (folder, *(folder / name for name in (*FOLDERS, PARTS))):
        if place.is_dir() and not os.access(place, os.W_OK | os.X_OK):
            raise ResultError(f"is a folder that this user may not write into: let this user, or {COPY}", file=place)
        if place.is_dir() and (kept := _kept(place)):
            message = f"its files may be replaced by their owners alone (sticky), such as {kept}"
            raise ResultError(f"{message}: `chmod -t` ends that; or {COPY}", file=place)


def _kept(place: Path) -> str:
    """Name of a file that another user has and that the system lets nobody else replace; empty if there is none."""
    status = place.stat()
    user = os.geteuid() if hasattr(os, "geteuid") else 0
    if not status.st_mode & stat.S_ISVTX or user in (0, status.st_uid):
        return ""
    with os.scandir(place) as entries:
        return next((entry.name for entry in entries if entry.stat(follow_symlinks=False).st_uid != user), "")


def _check_journals(folder: Path, plan: Plan) -> None:
    """Raise ResultError for the journal of a search that is not finished where this user may not go on with it."""
    units = {} if plan.parts else {unit.key: unit for unit in plan.units}
    left = units.keys() - finished_keys(folder, units)
    for file in (folder / JOURNALS).glob("*.log"):
        if file.stem in left and not os.access(file, os.R_OK | os.W_OK):
            message = f"is a journal that this user may not read and write: let this user, or {COPY}"
            raise ResultError(message, file=file)


@contextmanager
def in_place(folder: Path, plan: Plan) -> Iterator[None]:
    """Raise ResultError in place of an error in the folder of a run that is gone, or that this user may not change."""
    try:
        yield
    except (OSError, ShipidError) as error:
        check_place(folder, plan)
        if isinstance(error, PermissionError):
            check_readable(folder)
            check_writable(folder)
        raise


def check_place(folder: Path, plan: Plan) -> None:
    """Raise ResultError where the folder is no longer that of the run: it may be moved, removed or replaced meanwhile.

    Call it before each write: else the results of two plans mix, or a part of them appears at the old place.
    """
    try:
        record = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
        same = record["digest"] == plan.digest
    except FileNotFoundError:
        same = (folder / STUDY).exists()
    except (OSError, ValueError, TypeError, KeyError):  # a file server that is slow, or a damage: it says nothing else
        return
    if not same:
        message = "was moved, removed or replaced while this run worked in it: what was finished is where it is now"
        raise ResultError(f"{message}; `shipid study resume` goes on there", file=folder)


def sweep_run(folder: Path) -> None:
    """Remove what processes that are gone were writing into the folder of a run."""
    for place in (folder, *(folder / name for name in FOLDERS)):
        sweep(place)


def _mend(folder: Path, plan: Plan) -> None:
    """Write study and vessels again where they cannot be read; ResultError where they can and were changed."""
    try:
        changed = documents.digest(documents.read(folder / STUDY)) != documents.digest(plan.document)
    except DocumentError:
        write_text(folder / STUDY, plan.text())
        changed = False
    try:
        stored = read_json(folder / VESSELS)
        digests = {name: documents.digest(entry["document"]) for name, entry in stored.items()}
        changed = changed or digests != {name: vessel.digest for name, vessel in plan.vessels.items()}
    except (ResultError, TypeError, KeyError, AttributeError):
        _write_vessels(folder, plan)
    if changed:
        raise ResultError("its study or vessels were changed by hand: choose another --out", file=folder)


def _write_vessels(folder: Path, plan: Plan) -> None:
    vessels = {name: {"document": vessel.document, "file": vessel.file} for name, vessel in plan.vessels.items()}
    write_json(folder / VESSELS, vessels)


def _make(folder: Path, plan: Plan) -> None:
    """Make the folder at once; nothing happens where another run has just made it."""
    folder = Path(os.path.realpath(folder))  # a folder takes the place of an empty one, not of a link to it
    with temporary_folder(folder.parent) as above:
        _describe(above / folder.name, plan)
        try:
            os.rename(above / folder.name, folder)
            sync(folder.parent)
            return
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
    if (folder / STUDY).exists():
        return
    if any(entry.name not in (PROVENANCE, VESSELS) for entry in folder.iterdir()):
        raise ResultError("is not empty and holds no run of shipid: choose another --out", file=folder)
    _describe(folder, plan)


def _describe(folder: Path, plan: Plan) -> None:
    """Write what a folder is: provenance, vessels and, last, the study."""
    origin: dict[str, Any] = {"name": plan.name, "file": str(Path(plan.file).absolute()), "sources": dict(plan.sources)}
    origin["changes"] = dict(plan.changes)
    if plan.code:
        origin |= {"program": plan.program, **plan.code}
    write_json(folder / PROVENANCE, {"digest": plan.digest, **origin})
    _write_vessels(folder, plan)
    write_text(folder / STUDY, plan.text())


def stored_plan(folder: Path) -> Plan:
    """The plan of a run from its folder alone: the study and the vessels as they were when the run began.

    Raises ResultError where it is no folder of a run, is damaged or cannot be read, `NotTaken` where it may be whole.
    """
    check_readable(folder)
    if not (folder / STUDY).is_file():
        raise ResultError("is not the folder of a run: it holds no study.toml", file=folder)
    record = provenance(folder)
    try:
        document = documents.read(folder / STUDY)
    except DocumentError as error:
        raise ResultError(f"damaged ({error.message}): run the study again", file=folder / STUDY) from None
    remedy = _needed_script(folder, record, document)
    stored = read_json(folder / VESSELS)
    try:
        vessels = {name: check_vessel(entry["document"], entry["file"]) for name, entry in stored.items()}
    except (TypeError, KeyError, AttributeError, ValueError):
        raise ResultError("damaged: run the study again into a new folder", file=folder / VESSELS) from None
    except DocumentError as error:
        raise _not_taken(error, folder / VESSELS, remedy) from None
    try:
        sources, changes = (record.get(key, {}) for key in ("sources", "changes"))
        plan = build_plan(document, Path(record["file"]), vessels, sources, changes)
    except DocumentError as error:
        raise _not_taken(error, folder / STUDY, remedy) from None
    if plan.digest != record["digest"]:
        raise ResultError(
            "its study or vessels were changed by hand, or this shipid has other defaults: run the study again",
            file=folder,
        )
    return plan


def _not_taken(error: DocumentError, file: Path, remedy: str) -> NotTaken:
    """The error for a document in the folder of a run that was right when the run began."""
    other = "if the run is of another version, read its report.html, and run the study again into a new folder"
    message = f"shipid {__version__} does not take it ({error.message}): {other}"
    return NotTaken(remedy or message, file=file, path=error.path)


def _needed_script(folder: Path, record: Mapping[str, Any], document: documents.Document) -> str:
    """How to open a run with terms and methods of a user that this process lacks; empty where it has all.

    Their names are in the provenance, or in its sessions where an earlier version made the folder.
    """
    noted = [record, *record.get("sessions", [])]
    terms, methods = ({name for one in noted for name in _names_in(one, what)} for what in (TERM_CODE, METHOD_CODE))
    blocks = document.get("method")
    ways = [way for way in blocks if isinstance(way, dict)] if isinstance(blocks, list) else []
    kinds = {str(way.get("kind")) for way in ways if way.get("name") in methods}
    lacking = [*sorted(terms - TERMS.keys()), *sorted(kinds - METHODS.keys())]
    if not lacking:
        return ""
    program = record.get("program", f"python {USER_SCRIPT}")
    words = f"{listed(lacking)}, which a user wrote, {plural(len(lacking), 'is', 'are')} not known to this process"
    script = f"open the run by the script that puts {plural(len(lacking), 'it', 'them')} into TERMS or METHODS"
    return f"{words}: {script}: `{program} study report {as_argument(folder)}`"


def _names_in(record: Mapping[str, Any], what: str) -> list[str]:
    held = record.get(what)
    return list(held) if isinstance(held, dict) else []


def provenance(folder: Path) -> dict[str, Any]:
    """Read what says to which study a folder belongs; ResultError where it does not say so, or an entry is no such."""
    record = read_json(folder / PROVENANCE)
    if not isinstance(record, dict) or not {"digest", "name", "file"} <= record.keys():
        raise ResultError("damaged: run the study again into a new folder", file=folder / PROVENANCE)
    for key, (kind, inner) in ENTRIES.items():
        if key not in record:
            continue
        held = record[key]
        every = held.values() if isinstance(held, dict) else held if isinstance(held, list) else ()
        if not isinstance(held, kind) or not all(isinstance(one, inner) for one in every):
            message = "is not what shipid writes there: put it back, or run the study again into a new folder"
            raise ResultError(message, file=folder / PROVENANCE, path=key)
    return record


def check_part(folder: Path, name: str, plan: Plan) -> Path:
    """The folder of one part of a study; ResultError where it holds another one, such as a part of another study."""
    place = part_folder(folder, name)
    if (place / STUDY).exists() and provenance(place)["digest"] != plan.digest:
        raise ResultError(f"is not part {name} of this study: move it away, and resume", file=place)
    return place


def write_patches(folder: Path, foundations: Iterable[Foundation]) -> int:
    """Write a patch document for every variant and return how many; it loads from anywhere and rebuilds it exactly."""
    count = 0
    for one in foundations:
        if one.base is not None and one.variant is not None and one.identify is None:
            named = documents.bundled("models").get(one.variant.base) == Path(one.base.file)
            base = one.variant.base if named else str(Path(one.base.file).absolute())
            write_text(folder / f"{one.name}.toml", replace(one.variant, base=base).document())
            count += 1
    return count


def rows_file(folder: Path, key: str) -> Path:
    """Where the rows of a finished unit of work, or of a whole batch, are."""
    return folder / "batches" / f"{key}.json"


def cell_file(folder: Path, cell: str) -> Path:
    """Where the predictor of a cell is."""
    return folder / "cells" / f"{cell}.npz"


def read_predictor(file: Path) -> Predictor:
    """Read the predictor of a cell; one that is in no folder of a run has no seal.

    Raises ResultError for a file that is not as the study wrote it.
    """
    folder = file.absolute().parent.parent
    for fault in seals.faults(folder, f"cells/{file.name}"):
        if fault.file == f"cells/{file.name}":
            raise seals.wrong(folder, fault)
    return Predictor.load(file)


def paths_file(folder: Path, cell: str) -> Path:
    """Where the predicted test paths of a cell are."""
    return folder / "predictions" / f"{cell}.npz"


def part_folder(folder: Path, part: str) -> Path:
    """Where the run of one part of a study is: a folder like that of any run."""
    return folder / PARTS / part


def finished(folder: Path, units: Iterable[Unit]) -> list[Unit]:
    """Units whose results are stored whole: with a seal, or in a batch that was one unit to an earlier version."""
    known = {unit.key: unit for unit in units}
    done = finished_keys(folder, known)
    return [unit for key, unit in known.items() if key in done]


def finished_keys(folder: Path, units: Mapping[str, Unit]) -> set[str]:
    """Keys of the units, by key, whose results are stored whole; 10,000 take some milliseconds."""
    sealed = seals.sealed(folder)
    batches = {name for name in sealed - seals.FIRST.keys() if WITH not in name}
    before = {key for key, unit in units.items() if unit.batch.key in batches} if batches else set()
    return (sealed & units.keys()) | before


def is_finished(folder: Path, unit: Unit) -> bool:
    """Whether the results of one unit are stored whole."""
    return seals.is_sealed(folder, unit.key) or seals.is_sealed(folder, unit.batch.key)


def write_unit(folder: Path, unit: Unit, results: Sequence[Cell]) -> None:
    """Store the rows, predictors and test paths of a unit; the seal comes last, when all the rest is on the disk."""
    if is_finished(folder, unit):  # by a process that took it over while this one was held up
        return
    files = []
    for row, predictor, paths in results:
        if predictor is not None:
            files.append(predictor.save(cell_file(folder, row["cell"])))
        if paths is not None:
            files.append(paths_file(folder, row["cell"]))
            write_arrays(files[-1], {"paths": paths})
    write_json(rows_file(folder, unit.key), [cell.row for cell in results])
    seals.remove(folder, RESULTS)  # of the tables, which do not hold this unit
    seals.write_seal(folder, unit.key, [rows_file(folder, unit.key), *files])


def note_session(folder: Path, session: Mapping[str, Any]) -> list[str]:
    """Note in the provenance what a run is computed with; returns a sentence per difference to the session before.

    session : entries such as `shipid`, `engine`, `processor` and `packages`, as plain data; each kind is noted once,
        the latest last.
    """
    record, now = provenance(folder), dict(session)
    before = record.get("sessions", [])
    if now not in before[-1:]:
        others = [one for one in before if one != now]
        write_json(folder / PROVENANCE, {**record, "sessions": [*others, now]})
    return differences(before[-1], now) if before else []


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """A sentence per entry in which two sessions differ."""
    one, other = dict(documents.leaves(before)), dict(documents.leaves(now))
    changed = [name for name in {**one, **other} if one.get(name) != other.get(name)]
    return [f"{name} was {one.get(name)}, now {other.get(name)}" for name in changed]


def _names(folder: Path, plan: Plan) -> set[str]:
    """Names of the files of a plan's units: their keys, and those of batches that an earlier version stored whole."""
    sealed = seals.sealed(folder)
    return {unit.key for unit in plan.units} | ({unit.batch.key for unit in plan.units} & sealed)


def read_rows(folder: Path, plan: Plan | None = None) -> pd.DataFrame:
    """One row per finished cell, with its trials; ordered by N_D, seed and, with the plan, foundation and method.

    Other files, such as copies by a program that synchronises folders, are left out where the plan is given.
    """
    wanted = seals.sealed(folder)  # other files are of units that are computed again, perhaps cut in another way
    wanted &= _names(folder, plan) if plan is not None else wanted
    files = sorted(file for file in (folder / "batches").glob("*.json") if file.stem in wanted)
    rows = [row for file in files for row in read_json(file)]
    if not rows:
        raise ResultError("no cell is finished yet: continue with `shipid study resume`", file=folder)
    frame = pd.DataFrame(rows)
    for name in METRICS:
        frame[name] = frame[name].astype(float) if name in frame else np.nan
    pairs = [(name, way.name) for name, way in plan.pairs] if plan is not None else []
    place = {pair: number for number, pair in enumerate(pairs)}
    frame["place"] = [place.get(pair, 0) for pair in zip(frame["foundation"], frame["method"], strict=True)]
    return frame.sort_values(["N_D", "seed", "place"], kind="stable").drop(columns="place").reset_index(drop=True)


def write_results(folder: Path, plan: Plan, rows: pd.DataFrame, whole: bool = True) -> Path:
    """`results.parquet`: one row per cell and metric, and `trials.parquet`: one row per cell and trial.

    `trials.log` holds the journals of all units of the plan.

    whole : whether all cells are there; only then the tables have a seal, which says that a run has ended.
    """
    seals.remove(folder, RESULTS)
    keys = ["cell", "foundation", "family", "member", "method", "N_D", "runs", "minutes", "seed", "status"]
    table = rows.melt(id_vars=keys, value_vars=list(METRICS), var_name="metric", value_name="value")
    table["unit"] = table["metric"].map(UNITS)
    write_table(folder / "results.parquet", table)
    trials = [{"cell": row["cell"], **_flat(trial)} for _, row in rows.iterrows() for trial in row["trials"]]
    write_table(folder / "trials.parquet", pd.DataFrame(trials))
    names = _names(folder, plan)
    if journals := sorted(file for file in (folder / JOURNALS).glob("*.log") if file.stem in names):
        from shipid.hybrid.journal import merge  # with Optuna, which a study is read without

        merge(journals, folder / TRIALS)
    sweep_run(folder)  # again: a worker of a killed run may outlive it by a moment, and be gone only by now
    if whole:
        seals.write_seal(folder, RESULTS, [folder / "results.parquet", folder / "trials.parquet"])
    return folder / "results.parquet"


def _flat(trial: Mapping[str, Any]) -> dict[str, Any]:
    return {**{k: v for k, v in trial.items() if k != "params"}, **trial.get("params", {})}


def write_test(folder: Path, test: Windows, paths: Mapping[str, np.ndarray], naive: np.ndarray) -> None:
    """Store the test windows and the physics paths of every foundation on them, so that a report needs nothing else."""
    arrays: dict[str, np.ndarray] = {"run": test.run, "t": test.t, "future": test.future, "naive": naive}
    arrays |= {f"column {name}": values for name, values in test.columns.items()}
    arrays |= {f"planned {name}": values for name, values in test.planned.items()}
    arrays |= {f"past {name}": values for name, values in test.past.items()}
    arrays |= {f"states {name}": values for name, values in test.states.items()}
    arrays |= {f"physics {name}": values for name, values in paths.items()}
    arrays["meta"] = np.array(json.dumps({"horizon": test.horizon, "step": test.step, "shared": test.shared_clock}))
    write_arrays(folder / TEST, arrays, compressed=True)


def read_test(folder: Path) -> tuple[Windows, dict[str, np.ndarray], np.ndarray]:
    """Test windows, physics paths by foundation, and the errors (T, S) of constant u, v, r."""
    try:
        arrays = read_arrays(folder / TEST)
        meta = json.loads(str(arrays["meta"]))
    except (OSError, ValueError, KeyError):
        raise ResultError("missing or damaged: continue with `shipid study resume`", file=folder / TEST) from None

    windows = Windows(
        run=arrays["run"],
        t=arrays["t"],
        columns=part_of(arrays, "column "),
        future=arrays["future"],
        planned=part_of(arrays, "planned "),
        past=part_of(arrays, "past "),
        states=part_of(arrays, "states "),
        horizon=meta["horizon"],
        step=meta["step"],
        shared_clock=meta["shared"],
    )
    return windows, part_of(arrays, "physics "), arrays["naive"]
