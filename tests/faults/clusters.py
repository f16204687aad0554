"""Rows of the campaign: a Dask scheduler or its workers die, and hosts with other processors share a folder."""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from unittest.mock import patch

import numpy as np

from shipid.engine import engines, native
from shipid.errors import ShipidError
from shipid.study.results import read_results
from shipid.study.run import run_study
from shipid.study.store import PROVENANCE, provenance
from tests.export.compiled import compiler
from tests.faults.folders import (
    _continued,
    _killed_at,
    _same_as_reference,
    a_place,
    child,
    reference,
    run_here,
    searched_plan,
)
from tests.faults.trials import Failure


@contextmanager
def a_cluster(place: Path, workers: int = 1) -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """Address of a scheduler on this machine with some workers, and their processes: scheduler, worker, ..."""
    options = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    with ExitStack() as stack:
        processes = [stack.enter_context(_process("scheduler", options, place))]
        address = _address(place / "scheduler.log")
        processes += [stack.enter_context(a_worker(address, place, "--no-nanny")) for _ in range(workers)]
        yield address, processes


def a_worker(address: str, place: Path, *more: str) -> AbstractContextManager[subprocess.Popen[str]]:
    """A worker of a scheduler, killed in the end."""
    return _process("worker", [address, "--nthreads", "1", "--no-dashboard", *more], place)


@contextmanager
def _process(kind: str, options: list[str], place: Path) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *options]
    with (place / f"{kind}.log").open("w") as log:
        process = subprocess.Popen(command, stderr=log, stdout=log, text=True, cwd=place)
        try:
            yield process
        finally:
            process.kill()
            process.wait()


def _address(log: Path) -> str:
    for _ in range(600):
        match = re.search(r"Scheduler at:\s+(tcp://\S+)", log.read_text())
        if match:
            return match[1]
        time.sleep(0.1)
    raise Failure("no cluster", log.read_text()[-500:])


def worker_lost(seed: int) -> None:
    """One of two workers is killed, stopped, or stopped for a while: the other does its work, to the same digits."""
    rng = random.Random(f"worker {seed}")
    reference()
    with a_place() as place, patch.dict(os.environ, DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL="45s"):
        with a_cluster(place, 2) as (address, processes):
            plan, victim = searched_plan(place), rng.choice(processes[1:])
            how, after = ["killed", "stopped", "paused"][seed % 3], rng.choice(["start", "cell"])
            for event in run_study(plan, place / "run", scheduler=address):
                if event.kind == after:
                    victim.send_signal(signal.SIGKILL if how == "killed" else signal.SIGSTOP)
                    if how == "paused":
                        time.sleep(rng.choice([0.5, 3.0]))
                        victim.send_signal(signal.SIGCONT)
        _same_as_reference(place / "run", f"a worker {how} at {after}")


def died(seed: int) -> None:
    """The scheduler or the worker is killed after a while: one line, and what is finished is kept."""
    rng = random.Random(seed)
    reference()
    with a_place() as place, a_cluster(place) as (address, processes):
        plan = searched_plan(place)
        victim = processes[0] if seed % 2 == 0 else processes[1]
        after = rng.choice(["start", "cell"])
        began = time.monotonic()
        try:
            for event in run_study(plan, place / "run", scheduler=address):
                if event.kind == after and victim.poll() is None:
                    victim.send_signal(signal.SIGKILL)
                    if victim is processes[1]:
                        time.sleep(0.5)
                        processes[0].send_signal(signal.SIGKILL)  # else it waits for another worker, as it should
        except ShipidError as error:
            if "go on with `shipid study resume`" not in str(error) and "no Dask scheduler" not in str(error):
                raise Failure("no line", str(error)) from None
        if time.monotonic() - began > 120:
            raise Failure("hang", "more than 120 s until the line")
        _continued(place, f"killed at {after}")


HOSTS = {"own": "$", "avx2": "avx512", "sse2": "avx|fma"}
"""Processor of a host -> features of the one of this machine that it lacks."""
COMPILER = """#!/bin/sh
for word do shift; [ "$word" = -march=native ] && word=-march={}; set -- "$@" "$word"; done
exec {} "$@"
"""


def on_host(name: str, place: Path, work: Callable[[], None]) -> int:
    """Exit code of work on a host with another processor, for the engine; hosts share a cache of libraries."""

    def there() -> None:
        (place / "gcc").write_text(COMPILER.format("native" if name == "own" else "haswell", compiler("gcc")))
        (place / "gcc").chmod(0o755)
        flags = frozenset(one for one in native._processor_flags() if not re.match(HOSTS[name], one))
        os.environ.update(PATH=f"{place}:{os.environ['PATH']}", XDG_CACHE_HOME=str(place / "cache"))
        native.compiler_target.cache_clear()
        native._compiler_on_path.cache_clear()
        with patch.object(native, "_processor_flags", lambda: flags), patch.object(engines, "NATIVE_FROM", 0.0):
            work()

    return child(there)


def two_hosts(seed: int) -> None:
    """A host begins a study and one with another processor goes on with it: said in the folder, numbers to rounding."""
    rng, flags = random.Random(f"hosts {seed}"), native._processor_flags()
    first, second = rng.sample([name for name in HOSTS if name != "avx2" or "avx512f" in flags], 2)
    with a_place() as place:
        plan, folder, at = searched_plan(place), place / "run", rng.randrange(reference()[2])
        on_host(first, place, lambda: _killed_at(at, lambda: run_here(plan, folder)))
        begun = provenance(folder)["sessions"] if (folder / PROVENANCE).exists() else []
        libraries = {*place.glob("cache/*/*.so")}
        what = f"{first}, killed at call {at}, then {second}"
        if code := on_host(second, place, lambda: run_here(plan, folder)):
            raise Failure("not resumed", what, f"exit code {code}")
        if not {*place.glob("cache/*/*.so")} - libraries:
            raise Failure("mixed", what, "libraries of the other processor are used")
        if begun and len({one["engine"] for one in provenance(folder)["sessions"]}) < 2:
            raise Failure("not said", what)
        on_host(first, place, lambda: run_here(plan, place / "alone"))
        cells, alone = (read_results(one).cells.select_dtypes("float") for one in (folder, place / "alone"))
        for name in cells.columns.drop("seconds", errors="ignore"):
            if not np.allclose(cells[name], alone[name], rtol=1e-9, atol=1e-12, equal_nan=True):
                raise Failure("mixed", what, name, str((cells[name] - alone[name]).abs().max()))
