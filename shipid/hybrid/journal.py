"""Journals of searches: the trials of a unit of work in a file, which Optuna and its dashboard open.

There is one Optuna study for each cell. A process that works on a unit is alone in its journal: before it writes it
looks whether it still is, and of trials that two have written all the same each number counts once. `merge` makes one
file of those of a run. A trial is written when it has ended, in one line: a search has no trial that is half done, and
the order of the lines is the order of the trials. A last line that a killed process left behind half written, or that
is damaged, is cut off by the next one that writes. Each trial carries a checksum and the digest of its study.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from math import nan
from pathlib import Path
from typing import IO, Any

import optuna
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock
from optuna.storages.journal._storage import JournalOperation
from optuna.trial import FrozenTrial, TrialState, create_trial

from shipid.errors import ResultError
from shipid.files import open_file, whole
from shipid.hybrid.method import Row, Space

COUNT = "trials"  # attribute of a study: how many it will have
FIXED, NUMBER = "fixed", "number"  # attributes of a trial: all settings in order, null if searched; its place
CHECKSUM = "crc32"  # attribute of a trial: of its cell and row
STUDY = "digest"  # attribute of a trial: of the study that it belongs to
REMEDY = "take the journal away, and searches that were interrupted begin again"


class Journal:
    """Searches on disk, a study for each cell; several processes may write at once.

    Parameters
    ----------
    file : the journal; made where there is none. ResultError where it is not one, OSError for a device or a pipe.
    check : called before each write; what it raises, where this process may not write any more, ends the search.
    study : digest of the study that the searches are of, if they are of one: those of another are refused.
    """

    def __init__(self, file: Path, check: Callable[[], object] = lambda: None, study: str = "") -> None:
        self._own = {STUDY: study} if study else {}
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        with suppress(FileNotFoundError):
            open_file(file).close()  # Optuna would read a pipe without an end
        self._file = _Lines(str(file), check)
        try:
            self._storage = JournalStorage(self._file)
        except (ValueError, KeyError, TypeError, AttributeError):
            raise ResultError(f"damaged: no journal of trials; {REMEDY}", file=file) from None
        self._known = {study.study_name for study in self._storage.get_all_studies()}

    def rows(self, cell: str) -> list[Row]:
        """Return the trials of a search that ended, in order; ResultError for one that is not as it was written."""
        trials = self._study(cell).trials if cell in self._known else []
        numbered: list[Row] = []
        for trial in trials:
            if FIXED not in trial.user_attrs:  # someone else has put it in
                continue
            if trial.user_attrs.get(NUMBER, len(numbered)) == len(numbered):
                numbered.append(self._checked(cell, len(numbered), trial))
        return numbered

    def _checked(self, cell: str, number: int, trial: FrozenTrial) -> Row:
        """A trial as it was added; ResultError if it is damaged."""
        if self._own and trial.user_attrs.get(STUDY, self._own[STUDY]) != self._own[STUDY]:
            raise ResultError(f"trial {number} of {cell} is of another study; {REMEDY}", file=self._file.path)
        with suppress(KeyError, TypeError):  # an attribute is missing or is another's
            row = _row(number, trial)
            if trial.user_attrs.get(CHECKSUM) in (None, _checksum(cell, row)):  # none: from an earlier version
                return row
        raise ResultError(f"damaged: trial {number} of {cell} is not as written; {REMEDY}", file=self._file.path)

    def count(self, cell: str) -> int | None:
        """Return how many trials the budget of a search allowed; None before that is decided."""
        return self._study(cell).user_attrs.get(COUNT) if cell in self._known else None

    def decide(self, cells: Sequence[str], count: int) -> None:
        """Write how many trials some searches have."""
        for cell in cells:
            self._study(cell).set_user_attr(COUNT, count)

    def add(self, rows: Mapping[str, Sequence[Row]], space: Space) -> None:
        """Append trials to searches: cell -> rows, each with the next number."""
        where = distributions(space)
        trials = {
            self._study(cell): [frozen(row, where, **{CHECKSUM: _checksum(cell, row)}, **self._own) for row in mine]
            for cell, mine in rows.items()
        }
        with self._file.together():
            for study, mine in trials.items():
                study.add_trials(mine)

    def _study(self, cell: str) -> optuna.Study:
        if cell in self._known:
            return optuna.load_study(study_name=cell, storage=self._storage)
        self._known.add(cell)
        return optuna.create_study(study_name=cell, storage=self._storage, direction="minimize", load_if_exists=True)


def distributions(space: Space) -> dict[str, BaseDistribution]:
    """What Optuna calls the spans and the choices of a method."""
    drawn: dict[str, BaseDistribution] = {}
    for name, where in space.items():
        if isinstance(where, tuple):
            drawn[name] = CategoricalDistribution(where)
        elif where.whole:
            drawn[name] = IntDistribution(int(where.low), int(where.high))
        else:
            drawn[name] = FloatDistribution(where.low, where.high, log=where.log)
    return drawn


def frozen(row: Row, where: Mapping[str, BaseDistribution], **further: Any) -> FrozenTrial:
    """A trial that ended, as Optuna keeps it; an attribute holds what is not searched, and the order of all.

    further : more attributes, name -> value.
    """
    searched = {name: value for name, value in row["params"].items() if name in where}
    complete = row["state"] == "complete"
    fixed = {name: None if name in where else value for name, value in row["params"].items()}
    return create_trial(
        state=TrialState.COMPLETE if complete else TrialState.FAIL,
        value=row["value"] if complete else None,
        params=searched,
        distributions={name: _holding(where[name], value) for name, value in searched.items()},
        user_attrs={"seconds": row["seconds"], "epochs": row["epochs"], FIXED: fixed, NUMBER: row["number"], **further},
    )


def _checksum(cell: str, row: Row) -> int:
    """CRC-32 of a row of a search."""
    return zlib.crc32(json.dumps([cell, sorted(row.items())]).encode())


def _holding(where: BaseDistribution, value: float) -> BaseDistribution:
    """The span, with a value that rounding put just outside of it."""
    if isinstance(where, FloatDistribution) and not where.low <= value <= where.high:
        return FloatDistribution(min(where.low, value), max(where.high, value), log=where.log)
    return where


def _row(number: int, trial: FrozenTrial) -> Row:
    complete, known = trial.state == TrialState.COMPLETE, trial.user_attrs
    return {
        "number": number,
        "params": {**known[FIXED], **trial.params},
        "value": trial.value if complete else nan,
        "seconds": known["seconds"],
        "epochs": known["epochs"],
        "state": "complete" if complete else "diverged",
    }


def merge(files: Iterable[Path], target: Path) -> None:
    """Write one journal that holds the studies of all; it appears whole."""
    with whole(target) as temporary, temporary.open("w", encoding="utf-8") as out:
        studies = trials = 0
        for file in files:
            names: set[str] = set()
            created = 0
            for log in _entries(file):
                out.write(json.dumps(_moved(log, studies, trials), separators=(",", ":")) + "\n")
                names |= {log["study_name"]} if log["op_code"] == JournalOperation.CREATE_STUDY else set()
                created += log["op_code"] == JournalOperation.CREATE_TRIAL
            studies, trials = studies + len(names), trials + created


def _entries(file: Path) -> Iterator[dict[str, Any]]:
    """The whole lines of a journal; what is none is left out."""
    with file.open("rb") as stream:
        for line in stream:
            with suppress(ValueError):
                log = json.loads(line)
                if isinstance(log, dict) and "op_code" in log and line.endswith(b"\n"):
                    yield log


def _moved(log: dict[str, Any], studies: int, trials: int) -> dict[str, Any]:
    """An entry as it is after so many studies and trials of other journals: Optuna numbers them in order."""
    return log | {name: log[name] + by for name, by in (("study_id", studies), ("trial_id", trials)) if name in log}


class _Lines(JournalFileBackend):
    """The file of a journal: what a killed process left half written is cut off by the next one that writes."""

    def __init__(self, file: str, check: Callable[[], object]) -> None:
        super().__init__(file)
        self.path, self._check = file, check
        self._stream: IO[bytes] | None = None

    @contextmanager
    def together(self) -> Iterator[None]:
        """Write the entries of this block with the file locked once; the disk is waited for at the end."""
        with open(self.path, "r+b") as stream, _alone(stream, self.path):
            self._check()
            end = _last_whole(stream)
            stream.truncate(end)
            stream.seek(end)
            self._stream = stream
            try:
                yield
            finally:
                self._stream = None
                stream.flush()
                os.fsync(stream.fileno())

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """Append entries at the end of the file, after the last whole line."""
        if self._stream is None:
            with self.together():
                self.append_logs(logs)
            return
        lines = "".join(json.dumps(log, separators=(",", ":")) + "\n" for log in logs)
        self._stream.write(lines.encode())
        self._stream.flush()


def _last_whole(stream: IO[bytes]) -> int:
    """Where the last whole entry of a file ends: a last line that Optuna cannot read is none, it passes over it."""
    end = _after_newline(stream, stream.seek(0, os.SEEK_END))
    if end:
        begin = _after_newline(stream, end - 1)
        stream.seek(begin)
        try:
            json.loads(stream.read(end - begin))
        except ValueError:
            return begin
    return end


def _after_newline(stream: IO[bytes], end: int) -> int:
    """Place after the last newline of the first `end` bytes; 0 if there is none."""
    while end:
        begin = max(end - 4096, 0)
        stream.seek(begin)
        place = stream.read(end - begin).rfind(b"\n")
        if place >= 0:
            return begin + place + 1
        end = begin
    return 0


@contextmanager
def _alone(stream: IO[bytes], path: str) -> Iterator[None]:
    """Keep other processes from writing; where the system locks files, a lock ends with its process."""
    try:
        import fcntl
    except ImportError:  # Windows
        lock = JournalFileOpenLock(path)
        lock.acquire()
        try:
            yield
        finally:
            lock.release()
        return
    try:
        fcntl.flock(stream, fcntl.LOCK_EX)
    except OSError:  # a file system of a cluster that locks no files: only one process works on a unit
        yield
        return
    try:
        yield
    finally:
        fcntl.flock(stream, fcntl.LOCK_UN)
