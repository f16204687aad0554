"""Each trial in a new process: each ends in an outcome, and none may hang or bring the campaign down."""

from __future__ import annotations

import multiprocessing
import os
import resource
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import pytest

from shipid.cli import error_line

HANG = 20.0  # s of processor or wall time that no trial may take
PATIENCE = float(os.environ.get("FAULTS_PATIENCE", "1"))  # times the limits, on a machine that others use
MEMORY = 12 << 30  # bytes of address space of a trial


@dataclass(frozen=True)
class Outcome:
    """How a trial ended.

    kind : `sound` (accepted, or mended), `refused` (one line), `skipped` (this machine lacks what it needs), or a
        failure: `traceback`, `hang`, `died`, and what a trial says itself.
    """

    trial: int
    kind: str
    words: str = ""

    @property
    def failed(self) -> bool:
        """Whether the product has failed."""
        return self.kind not in ("sound", "refused", "skipped")


class Failure(Exception):
    """A trial that showed what must not be; the first argument is the kind of failure."""


def outcomes(work: Callable[[int], Any], seeds: Sequence[int], limit: float = HANG) -> Iterator[Outcome]:
    """Outcome of each trial; `work` is called with its seed in a forked process, which a hanging trial ends."""
    context: Any = multiprocessing.get_context("fork")
    limit *= PATIENCE
    left = list(seeds)
    while left:
        here, there = context.Pipe()
        process = context.Process(target=_serve, args=(there, work, tuple(left)), daemon=False)
        process.start()
        there.close()
        begun = time.monotonic()
        try:
            while left:
                try:
                    waiting = here.poll(max(0.0, begun + limit - time.monotonic()))
                    end = here.recv() if waiting else Outcome(left[0], "hang", f"more than {limit:g} s")
                except EOFError:
                    process.join()
                    end = Outcome(left[0], "died", f"exit code {process.exitcode}")
                begun = time.monotonic()
                left.pop(0)
                yield end
                if end.kind in ("hang", "died"):
                    break
        finally:
            process.kill()
            process.join()
            here.close()


def _serve(pipe: Connection, work: Callable[[int], Any], seeds: Sequence[int]) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
    for seed in seeds:
        pipe.send(outcome(work, seed))
    pipe.close()


def outcome(work: Callable[[int], Any], seed: int) -> Outcome:
    """Outcome of one trial in this process."""
    try:
        work(seed)
    except Failure as error:
        return Outcome(seed, str(error.args[0]), " ".join(map(str, error.args[1:])))
    except Exception as error:
        line = error_line(error)
        if line is None:
            return Outcome(seed, "traceback", _short(error))
        good = all(part.isprintable() for part in line.split("\n")) and len(line) < 3000
        return Outcome(seed, "refused" if good else "no line", line)
    except pytest.skip.Exception as reason:
        return Outcome(seed, "skipped", str(reason))
    except BaseException as error:
        return Outcome(seed, "traceback", _short(error))
    return Outcome(seed, "sound")


def _short(error: BaseException) -> str:
    places = [frame for frame in traceback.extract_tb(error.__traceback__) if "/shipid/" in frame.filename]
    where = f"{places[-1].filename.rsplit('/', 1)[-1]}:{places[-1].lineno}" if places else "?"
    return f"{where} {type(error).__name__}: {str(error)[:120]!r}"


def table(rows: dict[str, list[Outcome]]) -> str:
    """A line per row of the campaign, and one per failure."""
    lines = [f"{'row':34} {'trials':>6}  outcomes"]
    for name, trials in rows.items():
        counts = Counter(one.kind for one in trials)
        lines.append(f"{name:34} {len(trials):6}  " + ", ".join(f"{n} {kind}" for kind, n in counts.most_common()))
    for name, trials in rows.items():
        lines += [f"FAILED {name}, trial {one.trial}: {one.kind}: {one.words}" for one in trials if one.failed]
    return "\n".join(lines)
