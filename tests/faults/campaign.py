"""The rows of the campaign and how many trials each has: what the product must survive, and how the fault is made."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from tests.faults import clusters, documents, folders, foundations, recordings
from tests.faults.trials import HANG, Outcome, outcomes


@dataclass(frozen=True)
class Row:
    """One kind of fault.

    trial : seed -> None; it raises for a failure. count : trials at scale 5. limit : s that a trial may take.
    made : how the fault is made, for the table.
    """

    trial: Callable[[int], None]
    count: int
    made: str
    limit: float = HANG


ROWS: dict[str, Row] = {
    "study": Row(documents.study, 800, "mutated text"),
    "vessel": Row(documents.vessel, 800, "mutated text"),
    "mapping": Row(documents.mapping, 400, "mutated text"),
    "chain": Row(documents.chain, 40, "patches on patches"),
    "log": Row(documents.log, 1000, "mutated text"),
    **{f"{one} log": Row(recordings.recording(one), 500, "damaged, sizes forged", 60.0) for one in recordings.SOUND},
    "exchanged log": Row(recordings.exchanged, 100, "a link led elsewhere while it is read"),
    "fmu": Row(foundations.fmu, 500, "code, description, archive, table", 60.0),
    "function": Row(foundations.function, 500, "results, errors, arguments changed"),
    "predictions": Row(foundations.predictions, 500, "rows and columns changed"),
    "package": Row(foundations.package, 300, "entry points and members", 60.0),
    "predictor": Row(folders.predictor, 300, "arrays and header changed"),
    "dataset": Row(folders.dataset, 300, "columns and metadata changed"),
    "damaged": Row(folders.damaged, 1000, "files of a folder changed", 60.0),
    "killed": Row(folders.killed, 250, f"{folders.KILLS} SIGKILL of a run or worker at intercepted calls", 300.0),
    "full": Row(folders.full, 200, "limit of file size, and intercepted calls", 200.0),
    "together": Row(folders.together, 80, "two, three or twenty processes", 300.0),
    "two plans": Row(folders.two_plans, 60, "processes", 300.0),
    "shards": Row(folders.shards, 500, "SIGKILL, and files changed", 300.0),
    "user": Row(folders.another_user, 200, "files of another user, or read only", 200.0),
    "clock": Row(folders.clocks, 200, "the time jumps, files are of the future", 200.0),
    "version": Row(folders.another_version, 500, "keys of another version, sealed", 60.0),
    "exported": Row(documents.sanitized, 60, "sanitizers of gcc and clang", 120.0),
    "options": Row(documents.options, 500, "of expect and vessel similar"),
    "memory": Row(documents.memory, 100, "sizes beyond the machine"),
    "worker": Row(clusters.worker_lost, 12, "one of two killed, stopped, stopped for a while", 300.0),
    "hosts": Row(clusters.two_hosts, 60, "one processor begins, another goes on", 300.0),
    "cluster": Row(clusters.died, 10, "SIGKILL of scheduler or worker", 180.0),
}
EVERY = 30.0  # s between lines of progress


def campaign(scale: float, seed: int, only: tuple[str, ...] = ()) -> dict[str, list[Outcome]]:
    """Outcomes of every row, `scale` fifths of its trials; seeds begin at a million times `seed`."""
    rows = {}
    for name, row in ROWS.items():
        if only and name not in only:
            continue
        begun, count = time.perf_counter(), max(1, round(row.count * scale / 5))
        first = 1_000_000 * seed
        if row.trial.__module__ == folders.__name__:
            folders.reference()  # once, before the trials fork
        trials, told = [], begun
        with suppress(KeyboardInterrupt):  # the row ends with the trials that it has
            for one in outcomes(row.trial, range(first, first + count), row.limit):
                trials.append(one)
                if one.failed:
                    print(f"{name}, trial {one.trial}: {one.kind}: {one.words}", file=sys.stderr, flush=True)
                if time.perf_counter() - told > EVERY:
                    told = time.perf_counter()
                    print(f"... {name}: {len(trials)} of {count} trials", file=sys.stderr, flush=True)
        rows[f"{name} ({row.made})"] = trials
        failed = sum(one.failed for one in trials)
        words = f"{len(trials)} trials, {failed} failed, {time.perf_counter() - begun:.0f} s"
        print(f"{name}: {words}", file=sys.stderr, flush=True)
    return rows
