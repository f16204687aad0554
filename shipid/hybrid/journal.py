"""Journals of searches: the trials of a unit of work in a file, which Optuna and its dashboard open.

One process writes a journal, a line for each trial that has ended. A last line that a killed process left half written
is cut off when the file is opened again. Each trial carries a checksum, each study the digest of its plan.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import optuna
from optuna.exceptions import DuplicatedStudyError
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, TrialState, create_trial

from shipid.errors import ResultError
from shipid.files import replace_whole
from shipid.hybrid.method import Row, Space

COUNT = "trials"  # attribute of a study: how many it will have
DIGEST = "digest"  # attribute of a study: of the plan that it belongs to
ROW, CHECKSUM = "row", "crc32"  # attributes of a trial: its row as it was added; of its cell and row
TRIAL_STATES = {"complete": TrialState.COMPLETE, "stopped": TrialState.PRUNED, "diverged": TrialState.FAIL}
REMEDY = "take the journal away, and searches that were interrupted begin again"


class Journal:
    """Searches on disk, an Optuna study for each cell; one process writes them.

    Parameters
    ----------
    file : the journal; made where there is none. ResultError where it is not one.
    check : called before each write; what it raises, where this process may not write any more, ends the search.
    study : digest of the plan that the searches belong to: those of another are refused. Empty for any.
    """

    def __init__(self, file: Path, check: Callable[[], object] = lambda: None, study: str = "") -> None:
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self.file, self.check, self.digest = file, check, study
        try:
            for line in _read_whole_lines(file)[-1:]:
                json.loads(line)  # Optuna would pass over a last one that it cannot read
            self.storage = JournalStorage(_JournalLines(str(file)))
        except (ValueError, KeyError, TypeError, AttributeError):
            raise ResultError(f"damaged: no journal of trials; {REMEDY}", file=file) from None
        names = optuna.get_all_study_names(self.storage)
        self._studies = {name: optuna.load_study(study_name=name, storage=self.storage) for name in names}

    def rows(self, cell: str) -> list[Row]:
        """Return the trials of a search that ended, in order; ResultError for one that is not as it was written."""
        if cell not in self._studies:
            return []
        study = self._studies[cell]
        unsaid = "" if study.trials else self.digest  # of a study that a process began, and was stopped before its digest
        if self.digest and study.user_attrs.get(DIGEST, unsaid) != self.digest:
            raise ResultError(f"the trials of {cell} are of another study; {REMEDY}", file=self.file)
        rows: list[Row] = []
        for trial in study.trials:
            row, checksum = (trial.user_attrs.get(name) for name in (ROW, CHECKSUM))
            if trial.state.is_finished() and checksum != _row_checksum(cell, row):
                raise ResultError(f"damaged: trial {len(rows)} of {cell} is not as written; {REMEDY}", file=self.file)
            if row is not None and row["number"] == len(rows):  # not one that came twice
                rows.append(row)
        return rows

    def count(self, cell: str) -> int | None:
        """Return how many trials the budget of a search allowed; None before that is decided."""
        return self._studies[cell].user_attrs.get(COUNT) if cell in self._studies else None

    def decide(self, cells: Sequence[str], count: int) -> None:
        """Write how many trials some searches have."""
        for cell in cells:
            self._study(cell).set_user_attr(COUNT, count)

    def add(self, rows: Mapping[str, Sequence[Row]], space: Space) -> None:
        """Append trials to searches: cell -> rows, each with the next number."""
        for cell, mine in rows.items():
            self._study(cell).add_trials([frozen_trial(row, space, cell) for row in mine])

    def _study(self, cell: str) -> optuna.Study:
        """The study of a cell to be written to, made where there is none."""
        self.check()
        if cell not in self._studies:
            try:
                self._studies[cell] = optuna.create_study(study_name=cell, storage=self.storage)
            except AssertionError:  # of Optuna, which does not find the study that it has just written
                raise ResultError(f"damaged: no journal of trials; {REMEDY}", file=self.file) from None
        if DIGEST not in self._studies[cell].user_attrs:
            self._studies[cell].set_user_attr(DIGEST, self.digest)
        return self._studies[cell]


class _JournalLines(JournalFileBackend):
    """The file of a journal, without a lock and without waiting for the disk."""

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """Append entries, a line each."""
        with open(self._file_path, "ab") as stream:
            stream.writelines(json.dumps(log, separators=(",", ":")).encode() + b"\n" for log in logs)


def _read_whole_lines(file: Path) -> list[bytes]:
    """Lines of a file, none where there is no file; a last one that is not whole is cut off it."""
    lines = file.read_bytes().splitlines(keepends=True) if file.exists() else []
    if lines and not lines[-1].endswith(b"\n"):
        os.truncate(file, sum(map(len, lines[:-1])))
        return lines[:-1]
    return lines


def frozen_trial(row: Row, space: Space, cell: str = "") -> FrozenTrial:
    """A trial of a cell that ended, as Optuna keeps it; what is not searched stands in its row alone."""
    searched = {name: value for name, value in row["params"].items() if name in space}
    return create_trial(
        state=TRIAL_STATES[row["state"]],
        value=row["value"] if row["state"] == "complete" else None,
        intermediate_values={row["epochs"]: row["value"]} if row["state"] == "stopped" else None,
        params=searched,
        distributions={name: space[name] for name in searched},
        user_attrs={ROW: row, CHECKSUM: _row_checksum(cell, row)},
    )


def _row_checksum(cell: str, row: Row | None) -> int:
    """CRC-32 of a row of a search."""
    return zlib.crc32(json.dumps([cell, row]).encode())


def merge_journals(files: Iterable[Path], target: Path) -> None:
    """Write one journal that holds the studies of all; it appears whole. ResultError for a file that is damaged."""
    with replace_whole(target) as temporary:
        into = JournalStorage(_JournalLines(str(temporary)))
        for file in files:
            storage = Journal(file).storage
            for name in optuna.get_all_study_names(storage):
                try:
                    optuna.copy_study(from_study_name=name, from_storage=storage, to_storage=into)
                except DuplicatedStudyError:
                    raise ResultError(f"another journal holds {name}, too; {REMEDY}", file=file) from None
