"""A row of the campaign: a Dask scheduler or its workers die while a study runs on them."""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from unittest.mock import patch

from shipid.errors import ShipidError
from shipid.study.run import run_study
from tests.faults.folders import _continued, _same_as_reference, a_place, reference, searched_plan
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
