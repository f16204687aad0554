"""Trials of finished searches as Optuna keeps them, a study for each cell, for its dashboard."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, TrialState, create_trial

from shipid.files import replace_whole
from shipid.hybrid.method import Row

TRIAL_STATES = {"complete": TrialState.COMPLETE, "stopped": TrialState.PRUNED, "diverged": TrialState.FAIL}


class _StorageLines(JournalFileBackend):
    """The file of a storage that one process writes: no lock, and no waiting for the disk."""

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """Append entries, a line each."""
        with open(self._file_path, "ab") as stream:
            stream.writelines(json.dumps(log, separators=(",", ":")).encode() + b"\n" for log in logs)


def write_searches(file: Path, searches: Iterable[tuple[str, Sequence[Row], Mapping[str, Any]]]) -> None:
    """Write searches, (cell, its trials, where they were searched), as one file of Optuna; it appears whole."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    with replace_whole(file) as temporary:
        storage = JournalStorage(_StorageLines(str(temporary)))
        for cell, rows, space in searches:
            study = optuna.create_study(study_name=cell, storage=storage)
            study.add_trials([_frozen_trial(row, space) for row in rows])


def _frozen_trial(row: Row, space: Mapping[str, Any]) -> FrozenTrial:
    """A trial that ended; what is not searched stands in its row alone."""
    searched = {name: value for name, value in row["params"].items() if name in space}
    return create_trial(
        state=TRIAL_STATES[row["state"]],
        value=row["value"] if row["state"] == "complete" else None,
        intermediate_values={row["epochs"]: row["value"]} if row["state"] == "stopped" else None,
        params=searched,
        distributions={name: space[name] for name in searched},
        user_attrs={"row": row},
    )
