"""Dask: what dies on a cluster costs nothing that is finished, and is one line; what joins midway helps."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from shipid.errors import ResultError, ShipidError
from shipid.study import cluster
from shipid.study.cluster import on_dask
from tests.faults.clusters import a_cluster, a_worker

Done = list[tuple[int, Any]]


@pytest.fixture(autouse=True)
def limit() -> Iterator[None]:
    """A cluster without workers waits for one: a test of it fails after four minutes instead."""

    def late(*_: Any) -> None:
        raise TimeoutError("four minutes are over")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(240)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@contextmanager
def workers(address: str, place: Path, *more: str) -> Iterator[None]:
    """Workers with a parent that starts them anew, as on most clusters."""
    with a_worker(address, place, *more) as process:
        yield
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(20)


def napping(seconds: float) -> Callable[[int, int, object], int]:
    """Work that takes some time; made here, so that it travels to the workers by value."""

    def work(shared: int, task: int, _: object) -> int:
        time.sleep(seconds)
        return shared + task

    return work


def test_a_damaged_journal_is_named_on_a_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    dask = importlib.import_module("dask.distributed")
    monkeypatch.setattr(dask, "get_client", lambda: type("Client", (), {"get_events": lambda *_: ()})())
    monkeypatch.setattr(dask, "get_worker", lambda: type("Worker", (), {"log_event": print})())
    with pytest.raises(ResultError, match=r"journals/unit\.log: damaged"):
        cluster.journal_by_topic(b"no checksum\n", "", "topic", Path("journals/unit.log"))


def test_no_scheduler_is_one_line() -> None:
    with pytest.raises(ShipidError, match="no Dask scheduler answers there"):
        list(on_dask("nonsense://x", napping(0.0), 1, [("a", 1)], "x"))


def test_tasks_and_results_on_a_cluster_in_this_process() -> None:
    from dask.distributed import LocalCluster

    options = {"processes": False, "protocol": "tcp://", "dashboard_address": ":0", "silence_logs": 50}
    with LocalCluster(n_workers=1, threads_per_worker=1, **options) as local:
        address = local.scheduler_address
        done = on_dask(address, napping(0.0), 10, [(f"t{i}", i) for i in range(12)], "x")
        assert sorted(done) == [(i, 10 + i) for i in range(12)]

        def full(_: int, __: int, ___: object) -> int:
            raise OSError(28, "No space left on device")

        with pytest.raises(OSError, match="No space left"):  # before, the scheduler was said to be gone
            list(on_dask(address, full, 10, [("t", 1)], "full"))

        one, other = (on_dask(address, napping(0.0), shared, [("t", 1), ("u", 2)], "z") for shared in (10, 20))
        both = [*islice(one, 1), *other, *one]  # before, the scheduler gave both runs of one plan the results of one
        assert sorted(both) == [(1, 11), (1, 21), (2, 12), (2, 22)]

        def failing(_: int, task: int, __: object) -> float:
            return 1 / task

        with pytest.raises(ZeroDivisionError):
            list(on_dask(address, failing, 10, [("t", 0)], "y"))


@pytest.mark.slow
@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGSTOP])
def test_a_scheduler_that_dies_or_falls_silent_is_one_line(
    sent: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "SILENT", 3.0)
    with a_cluster(tmp_path) as (address, (scheduler, _)):
        results = on_dask(address, napping(0.3), 1, ((f"t{i}", i) for i in range(2000)), "x")
        next(results)
        scheduler.send_signal(sent)
        killed = time.monotonic()
        with pytest.raises(ShipidError, match=r"scheduler is gone, or .*; what is finished is kept"):
            list(results)
        assert time.monotonic() - killed < 60  # on a loaded machine: docs/cluster.md has what was measured
        scheduler.send_signal(signal.SIGCONT)


@pytest.mark.slow
def test_a_worker_dies_and_another_joins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: Any) -> None:
    """Between the two there is no worker, and what both need must be sent anew."""
    monkeypatch.setattr(cluster, "LOOK", 0.2)
    tasks = [(f"t{i}", i) for i in range(6)]
    done: Done = []
    with a_cluster(tmp_path) as (address, (_, first)):
        results = on_dask(address, napping(0.3), 10, tasks, "x")
        done.append(next(results))
        first.kill()
        second = subprocess.Popen(
            [sys.executable, "-c", f"import time, os; time.sleep(4); os.execv({sys.executable!r}, {_late(address)!r})"],
            cwd=tmp_path,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            done += list(results)
        finally:
            second.kill()
            second.wait()
    assert sorted(done) == [(i, 10 + i) for i in range(6)]
    assert "has no workers: waiting for one" in caplog.text


@pytest.mark.slow
def test_a_scheduler_that_cannot_read_the_work_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It unpacks what workers get, and needs the module of a user's method as they do."""
    (tmp_path / "own_method_here.py").write_text("class Own:\n    pass\n")
    (tmp_path / "there").mkdir()
    with a_cluster(tmp_path / "there") as (address, _):
        monkeypatch.syspath_prepend(str(tmp_path))
        own = importlib.import_module("own_method_here").Own()
        with pytest.raises(ShipidError, match="cannot read the work: start scheduler and workers where"):
            list(on_dask(address, lambda *_: 0, own, [("t", 1)], "x"))


def _late(address: str) -> list[str]:
    return [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny"]


@pytest.mark.slow
def test_a_task_that_kills_its_workers_is_named_when_the_others_are_done(tmp_path: Path) -> None:
    def hungry(_: int, task: int, __: object) -> int:
        if task == 1:
            time.sleep(2.0)  # a nanny whose first worker dies before the nanny is up gives up
            os._exit(9)  # as the system ends a process that takes too much memory
        return task

    with a_cluster(tmp_path, workers=0) as (address, _), workers(address, tmp_path):
        done: Done = []
        with pytest.raises(ShipidError, match=r"workers of the cluster die at .*t1.*: for want of memory"):
            done.extend(on_dask(address, hungry, 0, [("t0", 0), ("t1", 1)], "x"))
    assert all(task != 1 for task, _ in done)
