"""Results: a folder that can be copied and opened anywhere, written batch by batch, by shards too.

Shards are the parts of a plan that the tasks of a job array compute, each in its own folder, and that a run takes in.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from pydantic import BaseModel, ConfigDict, ValidationError

from shipid import document as documents
from shipid.data.windows import Windows
from shipid.errors import DocumentError, ResultError, ShipidError
from shipid.files import (
    arrays_with_prefix,
    forget_folder,
    make_folder,
    quote_argument,
    read_arrays,
    read_json,
    replace_whole,
    sweep_temporary,
    sync_to_disk,
    temporary_folder,
    write_arrays,
    write_json,
    write_table,
    write_text,
)
from shipid.foundations import SIMULATORS
from shipid.foundations.predictions import PredictionTable
from shipid.hybrid.search import SearchMethod
from shipid.predictor import Predictor
from shipid.study import seals
from shipid.study.plan import FUNCTION_CODE, Plan, Unit, build_plan, own_code, plan_text, program_of
from shipid.study.seals import sole_writer
from shipid.version import __version__
from shipid.vessel.load import check_document

STUDY, VESSELS, PROVENANCE, FOUNDATIONS = "study.toml", "vessels.json", seals.PROVENANCE, "foundations.json"
DATASET, TEST, ENVELOPE = "dataset.parquet", "test.npz", "envelope.json"
JOURNALS, TRIALS = "trials", "trials.log"
FOLDERS = ("cells", "predictions", "batches", seals.FOLDER, JOURNALS)
RESULTS = "results"  # name of the seal of the tables
PARTS = "parts"
PREFIXES = {
    "columns": "column ",
    "planned": "planned ",
    "past": "past ",
    "states": "states ",
}  # of the arrays of `TEST`
LENGTHS = ("A_end", "A_end_90", "A", "A_90", "A_rms", "H_end", "H_end_90", "H", "H_90", "rms", "width")
UNITS = {**dict.fromkeys(LENGTHS, "m"), "coverage": "1", "seconds": "s"}
METRICS = tuple(UNITS)
SHARDS = "shards"
STRANGE = (TypeError, ValueError, KeyError, AttributeError)  # what a table raises of entries of another kind
OF_ANOTHER = "has entries that this shipid does not write: read report.html, and run the study again into a new folder"
SIMULATORS_FILE, TABLES = "simulators.json", "tables"  # those of others, and the tables of paths among them


class Provenance(BaseModel):
    """What says to which study a folder belongs, and what it was computed with; entries of others stay."""

    model_config = ConfigDict(extra="allow", strict=True)
    digest: str
    name: str
    file: str
    program: str = ""
    sources: dict[str, str] = {}
    changes: dict[str, Any] = {}
    machine: dict[str, Any] = {}
    sessions: list[dict[str, Any]] = []
    notes: list[str] = []
    wall_seconds: float = 0.0


class NotTaken(ResultError):
    """The folder of a run whose documents this shipid does not take: of another version, or of a user's method."""


class Cell(NamedTuple):
    """Result of a cell: its row, and where it has a result its predictor and the test paths (T, S, 2) [m] it gives."""

    row: dict[str, Any]
    predictor: Predictor | None = None
    paths: np.ndarray | None = None


@contextmanager
def open_folder(folder: Path, plan: Plan) -> Iterator[None]:
    """Work alone in the folder of a run, which is made, or is that of the same study already; else ResultError."""
    try:
        make_folder(folder.parent)
        sweep_temporary(folder.parent)
        if (folder / STUDY).exists() and provenance(folder)["digest"] != plan.digest:
            _remove_without_results(folder)
        if not (folder / STUDY).exists():
            if os.path.realpath(folder) == os.getcwd():  # it is made anew, under the feet of this process
                raise ResultError("is the working folder: name a new one by --out, such as --out run", file=folder)
            _make(folder, plan)
    except OSError as error:
        raise ResultError(f"cannot be made ({error.strerror}): choose another --out", file=folder) from None
    if provenance(folder)["digest"] != plan.digest:
        words = "holds another study, or this one from before a vessel, the data or a default of shipid changed"
        resume = f"`{program_of(plan)} study resume {quote_argument(folder)}`"
        raise ResultError(f"{words}: choose another --out, or go on with it as it was: {resume}", file=folder)
    with in_place(folder, plan), sole_writer(folder):
        stored_plan(folder)  # raises where it was changed by hand
        sweep_run(folder)
        yield


@contextmanager
def in_place(folder: Path, plan: Plan) -> Iterator[None]:
    """Raise ResultError in place of an error in the folder of a run that is gone."""
    try:
        yield
    except (OSError, ShipidError):
        check_place(folder, plan.digest)
        raise


def check_place(folder: Path, digest: str) -> None:
    """Raise ResultError where the folder is no longer that of a run of this digest; call it before each write."""
    if not (folder / STUDY).exists() or seals.study_digest(folder) not in (None, digest):
        message = "was moved, removed or replaced while this run worked in it: what was finished is where it is now"
        raise ResultError(f"{message}; `shipid study resume` goes on there", file=folder)


def sweep_run(folder: Path) -> None:
    """Remove what processes that are gone were writing into the folder of a run."""
    for place in (folder, *(folder / name for name in FOLDERS)):
        sweep_temporary(place)


def _make(folder: Path, plan: Plan) -> None:
    """Make the folder at once; nothing happens where another run has just made it."""
    folder = Path(os.path.realpath(folder))  # a folder takes the place of an empty one, not of a link to it
    with temporary_folder(folder.parent) as above:
        _write_plan(above / folder.name, plan)
        try:
            os.rename(above / folder.name, folder)
            forget_folder(folder)
            sync_to_disk(folder.parent)
        except OSError:
            if not (folder / STUDY).exists():
                raise


def _remove_without_results(folder: Path) -> None:
    """Remove the folder of a run that ended before its first cell: each of its files can be made again from a study.

    One that waits for its shards stays, and so does the working folder.
    """
    made = {STUDY, VESSELS, SIMULATORS_FILE, PROVENANCE, FOUNDATIONS, DATASET, TEST, ENVELOPE}
    with sole_writer(folder):
        files = [place for place in folder.rglob("*") if not place.is_dir()]
        mine = (
            file.name in made or file.parent.name in (seals.FOLDER, TABLES) or file.suffix == ".lock" for file in files
        )
        if (folder / SHARDS).exists() or os.path.realpath(folder) == os.getcwd() or not all(mine):
            return
        with temporary_folder(folder.parent) as above:
            os.rename(os.path.realpath(folder), above / folder.name)


def _write_plan(folder: Path, plan: Plan) -> None:
    """Write what a folder is: provenance, vessels and, last, the study."""
    origin: dict[str, Any] = {"name": plan.name, "file": str(Path(plan.file).absolute()), "sources": dict(plan.sources)}
    own: dict[str, Any] = {**own_code(plan)}
    own |= {"program": program_of(plan)} if own.keys() - {FUNCTION_CODE} else {}
    write_json(folder / PROVENANCE, {"digest": plan.digest, **origin, "changes": dict(plan.changes), **own})
    vessels = {name: {"document": vessel.document, "file": vessel.file} for name, vessel in plan.vessels.items()}
    write_json(folder / VESSELS, vessels)
    headers = {name: one.header() for name, one in plan.simulators.items()}
    if headers:
        write_json(folder / SIMULATORS_FILE, headers)
    for name, one in plan.simulators.items():
        if isinstance(one, PredictionTable):
            one.require()
            make_folder(folder / TABLES)
            shutil.copyfile(one.file, folder / TABLES / headers[name]["file"])
    write_text(folder / STUDY, plan_text(plan))


def stored_plan(folder: Path, trust: bool = False) -> Plan:
    """The plan of a run from its folder alone: the study and the vessels as they were when the run began.

    trust : as for `read_plan`.

    Raises ShipidError where it is no folder of a run, is damaged or cannot be read, `NotTaken` where it may be whole.
    """
    if not (folder / STUDY).is_file():
        raise ResultError(
            f"is not the folder of a run: {'it holds no study.toml' if folder.is_dir() else 'there is no such folder'}",
            file=folder,
        )
    record, document = provenance(folder), documents.read_document(folder / STUDY)
    stored, file = read_json(folder / VESSELS), folder / VESSELS
    headers = read_json(folder / SIMULATORS_FILE) if (folder / SIMULATORS_FILE).is_file() else {}
    try:
        vessels = {name: check_document(entry["document"], entry["file"]) for name, entry in stored.items()}
        file = folder / STUDY
        simulators = {
            name: SIMULATORS[one["kind"]].from_header(one, folder / TABLES, trust) for name, one in headers.items()
        }
        plan = build_plan(
            document, Path(record["file"]), vessels, record["sources"], record["changes"], simulators, trust
        )
    except DocumentError as error:
        remedy = "if the run is of another version, read its report.html, and run the study again into a new folder"
        if "program" in record:
            command = f"`{record['program']} study report {quote_argument(folder)}`"
            remedy = f"install the package, or name `--with` the file, that has its methods and terms: {command}"
        message = f"shipid {__version__} does not take it ({error.message}): {remedy}"
        raise NotTaken(message, file=file, path=error.path) from None
    except STRANGE:
        raise ResultError("damaged: run the study again into a new folder", file=folder / VESSELS) from None
    if plan.digest != record["digest"]:
        raise ResultError(
            "its study or vessels were changed by hand, or this shipid has other defaults: run the study again",
            file=folder,
        )
    return plan


def provenance(folder: Path) -> dict[str, Any]:
    """Read what says to which study a folder belongs, and what it was computed with.

    ResultError where an entry is not of the kind that shipid writes there.
    """
    try:
        record = Provenance.model_validate(read_json(folder / PROVENANCE))
    except ValidationError as error:
        path = ".".join(map(str, error.errors()[0]["loc"]))
        message = "is not what shipid writes there: put it back, or run the study again into a new folder"
        raise ResultError(message, file=folder / PROVENANCE, path=path) from None
    written = record.model_dump(exclude_unset=True)
    return {"sources": {}, "changes": {}, "sessions": [], "notes": [], "wall_seconds": 0.0, **written}


def check_part(folder: Path, name: str, plan: Plan) -> Path:
    """The folder of one part of a study; ResultError where it holds another one, such as a part of another study."""
    place = part_folder(folder, name)
    if (place / STUDY).exists() and provenance(place)["digest"] != plan.digest:
        raise ResultError(f"is not part {name} of this study: move it away, and resume", file=place)
    return place


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
    for fault in seals.sealed_faults(folder, f"cells/{file.name}"):
        if fault.file == f"cells/{file.name}":
            raise seals.fault_error(folder, fault)
    return Predictor.load(file)


def paths_file(folder: Path, cell: str) -> Path:
    """Where the predicted test paths of a cell are."""
    return folder / "predictions" / f"{cell}.npz"


def part_folder(folder: Path, part: str) -> Path:
    """Where the run of one part of a study is: a folder like that of any run."""
    return folder / PARTS / part


def finished_units(folder: Path, units: Iterable[Unit]) -> list[Unit]:
    """Units whose results are stored whole."""
    sealed = seals.seal_names(folder)
    return [unit for unit in units if unit.key in sealed]


def write_unit(folder: Path, unit: Unit, results: Sequence[Cell]) -> None:
    """Store the rows, predictors and test paths of a unit; the seal comes last, when all the rest is on the disk."""
    files = []
    for row, predictor, paths in results:
        if predictor is not None:
            files.append(predictor.save(cell_file(folder, row["cell"])))
        if paths is not None:
            files.append(paths_file(folder, row["cell"]))
            write_arrays(files[-1], {"paths": paths})
    write_json(rows_file(folder, unit.key), [cell.row for cell in results])
    seals.remove_seal(folder, RESULTS)  # of the tables, which do not hold this unit
    seals.write_seal(folder, unit.key, [rows_file(folder, unit.key), *files])


def note_session(folder: Path, session: Mapping[str, Any]) -> list[str]:
    """Note in the provenance what a run is computed with, each kind once; a sentence per difference to the last."""
    record, now = provenance(folder), dict(session)
    before = record["sessions"]
    if now not in before[-1:]:
        write_json(folder / PROVENANCE, {**record, "sessions": [*(one for one in before if one != now), now]})
    return differences(before[-1], now) if before else []


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """A sentence per entry in which two sessions differ."""
    one, other = dict(documents.document_leaves(before)), dict(documents.document_leaves(now))
    return [
        f"{name} was {one.get(name)}, now {other.get(name)}"
        for name in {**one, **other}
        if one.get(name) != other.get(name)
    ]


def read_rows(folder: Path, plan: Plan | None = None) -> pd.DataFrame:
    """One row per finished cell, with its trials; ordered by N_D, seed and, with the plan, foundation and method.

    Other files, such as copies by a program that synchronises folders, are left out.
    """
    wanted = seals.seal_names(folder) if plan is None else {unit.key for unit in finished_units(folder, plan.units)}
    rows = [
        row for file in sorted((folder / "batches").glob("*.json")) if file.stem in wanted for row in read_json(file)
    ]
    if not rows:
        raise ResultError("no cell is finished yet: continue with `shipid study resume`", file=folder)
    place = {(name, way.name): number for number, (name, way) in enumerate(plan.pairs if plan is not None else ())}
    try:
        frame = pd.DataFrame(rows).astype(dict.fromkeys(METRICS, float))
        frame["place"] = [place.get(pair, 0) for pair in zip(frame["foundation"], frame["method"], strict=True)]
        return frame.sort_values(["N_D", "seed", "place"], kind="stable").drop(columns="place").reset_index(drop=True)
    except STRANGE:
        raise ResultError(OF_ANOTHER, file=folder / "batches") from None


def write_results(folder: Path, plan: Plan, rows: pd.DataFrame, whole: bool = True) -> Path:
    """`results.parquet`: a row per cell and metric; `trials.parquet`: per cell and trial; `trials.log`: for Optuna.

    whole : whether all cells are there; only then the tables have a seal, which says that a run has ended.
    """
    seals.remove_seal(folder, RESULTS)
    keys = ["cell", "foundation", "family", "member", "method", "N_D", "runs", "minutes", "seed", "status"]
    table = rows.melt(id_vars=keys, value_vars=list(METRICS), var_name="metric", value_name="value")
    table["unit"] = table["metric"].map(UNITS)
    write_table(folder / "results.parquet", table)
    trials = [
        {"cell": cell} | {key: value for key, value in trial.items() if key != "params"} | trial.get("params", {})
        for cell, mine in zip(rows["cell"], rows["trials"], strict=True)
        for trial in mine
    ]
    write_table(folder / "trials.parquet", pd.DataFrame(trials))
    spaces = {way.name: way.method.space() for way in plan.methods if isinstance(way.method, SearchMethod)}
    searched = rows[rows["method"].isin([*spaces])]
    if len(searched):
        from shipid.hybrid.trials import write_searches  # with Optuna, which a study is read without

        places = zip(searched["cell"], searched["trials"], searched["method"], strict=True)
        write_searches(folder / TRIALS, ((cell, mine, spaces[method]) for cell, mine, method in places))
    sweep_run(folder)  # again: a worker of a killed run may outlive it by a moment, and be gone only by now
    if whole:
        seals.write_seal(folder, RESULTS, [folder / "results.parquet", folder / "trials.parquet"])
    return folder / "results.parquet"


def write_test(
    folder: Path,
    test: Windows,
    paths: Mapping[str, np.ndarray],
    naive: np.ndarray,
    regression: Mapping[str, np.ndarray],
    losses: Mapping[str, float],
) -> None:
    """Store the test windows, physics paths of every foundation on them; paths and losses of regressions by batch."""
    arrays: dict[str, np.ndarray] = {"run": test.run, "t": test.t, "future": test.future, "naive": naive}
    columns = {one: getattr(test, field) for field, one in PREFIXES.items()}
    for prefix, named in {**columns, "physics ": paths, "regression ": regression, "loss ": losses}.items():
        arrays |= {f"{prefix}{name}": np.asarray(values) for name, values in named.items()}
    arrays["meta"] = np.array(json.dumps({"horizon": test.horizon, "step": test.step, "shared": test.shared_clock}))
    write_arrays(folder / TEST, arrays, compressed=True)


def read_test(
    folder: Path,
) -> tuple[Windows, dict[str, np.ndarray], np.ndarray, dict[str, np.ndarray], dict[str, float]]:
    """Test windows, physics paths by foundation, errors (T, S) of constant u, v, r; paths and losses of regressions."""
    try:
        arrays = read_arrays(folder / TEST)
        meta = json.loads(str(arrays["meta"]))
    except (OSError, ValueError, KeyError):
        raise ResultError("missing or damaged: continue with `shipid study resume`", file=folder / TEST) from None

    named: dict[str, Any] = {field: arrays_with_prefix(arrays, prefix) for field, prefix in PREFIXES.items()}
    windows = Windows(
        run=arrays["run"],
        t=arrays["t"],
        future=arrays["future"],
        horizon=meta["horizon"],
        step=meta["step"],
        shared_clock=meta["shared"],
        **named,
    )
    physics, regression, losses = (arrays_with_prefix(arrays, one) for one in ("physics ", "regression ", "loss "))
    return windows, physics, arrays["naive"], regression, {key: float(value) for key, value in losses.items()}


def check_shard(shard: tuple[int, int]) -> tuple[int, int]:
    """Number and count of shard (i, n); ResultError unless i is 1 to n."""
    number, count = shard
    if not 1 <= number <= count:
        raise ResultError(f"{number}/{count}: must be i/n, i from 1 to n, such as 3/20", path="--shard")
    return shard


def shard_folder(folder: Path, shard: tuple[int, int]) -> Path:
    """Where shard (i, n) of a run is; ResultError unless i is 1 to n."""
    number, count = check_shard(shard)
    return folder / SHARDS / f"{number}-of-{count}"


def check_prepared(folder: Path, plan: Plan, names: Sequence[str]) -> None:
    """Raise ResultError unless a folder holds what shards of a plan share, under seals of these names, as written."""
    if not all(seals.is_sealed(folder, name) for name in names):
        raise ResultError("is not prepared for shards: `shipid study prepare` does that, once", file=folder)
    if provenance(folder)["digest"] != plan.digest:
        raise ResultError("is prepared for another study, or another version of it: choose another --out", file=folder)
    seals.check_seals(folder, names=names)


def take_in(folder: Path, plan: Plan) -> Iterator[str]:
    """Take the units of all shards into the folder of their run and remove the shards; yield a sentence each.

    Raises ResultError for a shard of another study or code of shipid, or at work, and for a unit whose results differ.
    """
    for place in sorted((folder / SHARDS).glob("*-of-*")):
        with sole_writer(place):
            _check_shard(folder, place, plan)
            yield from seals.unseal_missing(place)
            finished = finished_units(place, plan.units)
            for unit in finished:
                _take_unit(folder, place, unit.key)
        with temporary_folder(folder / SHARDS) as gone:  # what a kill leaves of it is no shard
            os.rename(place, gone / place.name)
        yield f"shard {place.name}: {len(finished)} units taken in"


def _check_shard(folder: Path, place: Path, plan: Plan) -> None:
    """Refuse a shard of another study, or of another code than the folder was prepared with."""
    here, there = provenance(folder), provenance(place)
    if there["digest"] != plan.digest:
        raise ResultError("is of another study: move it away, and start again", file=place)
    codes = [{str(one.get("shipid")) for one in record.get("sessions", [])} for record in (here, there)]
    if other := sorted(codes[1] - codes[0]):
        message = f"was computed with shipid {other[0]}, and the folder with {', '.join(sorted(codes[0]))}"
        raise ResultError(f"{message}: delete one of them and run it again with one version", file=place)


def _take_unit(folder: Path, place: Path, key: str) -> None:
    """Copy the files of a unit; ResultError where the folder has other results of it."""
    files = seals.named_files(place, key)
    if seals.is_sealed(folder, key):
        for name in files:
            if _content(folder / name) != _content(place / name):
                message = f"differs from {place / name}, of the same unit: delete one of the two with its seal"
                raise ResultError(message, file=folder / name)
        return
    for name in files:
        with replace_whole(folder / name) as temporary:
            shutil.copyfile(place / name, temporary)
    seals.write_seal(folder, key, [folder / name for name in files])


def _content(file: Path) -> Any:
    """What a file of results holds, without what a clock measured."""
    if file.suffix != ".json":
        return file.read_bytes()
    return json.loads(
        file.read_text(encoding="utf-8"),
        object_hook=lambda entry: {key: value for key, value in entry.items() if key != "seconds"},
    )
