"""Units of work on the cluster of a Dask scheduler: what is left when it, or a worker, dies is reported in one line."""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from shipid.errors import ShipidError
from shipid.study.code import asked, code_digest
from shipid.version import __version__

DASK = {  # a graph holds the windows once; a scheduler that is gone is noticed in seconds
    "distributed.admin.large-graph-warning-threshold": "1GB",
    "distributed.comm.timeouts.connect": "5s",
    "distributed.comm.timeouts.tcp": "15s",
    "distributed.comm.retry.count": 0,
}
KEPT = "what is finished is kept: go on with `shipid study resume`"
REMEDY = "start scheduler and workers where shipid, and methods that you wrote, can be imported as here"
LOOK = 2.0  # s between looks at the scheduler while nothing comes
SILENT = 30.0  # s that a scheduler may take to answer
PATIENCE = 20.0  # s without any worker until that is reported
AHEAD = 3  # tasks for each thread of the workers: others are left to whoever comes

Shared = TypeVar("Shared")
Task = TypeVar("Task")
Result = TypeVar("Result")
log = logging.getLogger(__name__)


def on_dask(
    scheduler: str,
    work: Callable[[Shared, Task], Result],
    shared: Shared,
    tasks: Iterable[tuple[str, Task]],
    name: str,
    needs: object = None,
) -> Iterator[tuple[Task, Result]]:
    """Tasks and what `work(shared, task)` makes of them, in the order in which they finish.

    A task whose worker dies is done by another one. While there is no worker at all it waits for one, and says so.

    Parameters
    ----------
    scheduler : address of a Dask scheduler, such as `tcp://host:8786`.
    shared : sent once to each worker. tasks : with a key each, taken when workers are about to need them. name : of the
        whole work; beside it the keys name this client, since a scheduler computes a key once for all its clients.
    needs : a small part of `shared`; a worker that cannot read it is named, since it dies of the whole without a word.

    Raises
    ------
    ShipidError : the scheduler does not answer, or dies; a task has killed worker after worker. All other tasks are
        done before that. What `work` raises is raised here.
    """
    try:
        import dask
        from dask.distributed import Client
    except ImportError:
        message = "a Dask scheduler needs the package dask: pip install 'shipid[dask]'"
        raise ShipidError(message, path=f"--scheduler {scheduler}") from None

    with warnings.catch_warnings(), dask.config.set(DASK), _without_logs("distributed", "tornado", "asyncio"):
        warnings.simplefilter("ignore")
        try:
            client = Client(scheduler, timeout="10s")
        except (OSError, ValueError) as error:
            raise ShipidError(f"no Dask scheduler answers there ({error})", path=f"--scheduler {scheduler}") from None
        try:
            yield from _results(client, scheduler, work, shared, tasks, name, needs)
        finally:
            with suppress(Exception):  # a client whose scheduler is gone complains in many ways
                client.close(timeout=2)


def _results(
    client: Any,
    scheduler: str,
    work: Callable[[Shared, Task], Result],
    shared: Shared,
    tasks: Iterable[tuple[str, Task]],
    name: str,
    needs: object,
) -> Iterator[tuple[Task, Result]]:
    from dask.distributed import CancelledError, KilledWorker

    def gone() -> ShipidError:
        return ShipidError(f"the Dask scheduler is gone; {KEPT}", path=f"--scheduler {scheduler}")

    ended: SimpleQueue[Any] = SimpleQueue()
    killed: list[str] = []
    mistake: Exception | None = None
    given: Any = None
    keys = f"shipid-{name}-{client.id}"
    try:
        watch = _Watch(client, needs)
        watch.look()  # before anything is sent: what cannot be read ends a worker
        given = client.submit(_given, shared, key=f"{keys}-shared", pure=False)  # made again if its worker dies
        left: dict[str, tuple[str, Task, Any]] = {}
        waiting = iter(tasks)
        while True:
            watch.look()
            for key, task in islice(waiting, max(AHEAD * watch.threads - len(left), 0)):
                future = client.submit(work, given, task, key=f"{keys}-{key}", pure=False)
                left[future.key] = (key, task, future)
                future.add_done_callback(ended.put)
            if not left:
                break
            try:
                future = ended.get(timeout=LOOK)
            except Empty:
                continue
            key, task, _ = left.pop(future.key)
            try:
                results = future.result(timeout=SILENT)
            except KilledWorker:
                killed.append(key)
                continue
            except Exception as error:
                if future.status != "error":
                    raise
                mistake = error  # of the task, and not of the cluster
                break
            yield task, results
            del future, results  # a worker may forget them
    except (OSError, TimeoutError, CancelledError):
        if given is not None and given.status == "error":  # the work was refused, and all that needs it with it
            raise ShipidError(_unread(given), path=f"--scheduler {scheduler}") from None
        raise gone() from None
    if mistake is not None:
        raise mistake
    if killed:
        words = f"workers of the cluster die, perhaps for want of memory, at {', '.join(killed[:3])}"
        more = f" and {len(killed) - 3} more" if len(killed) > 3 else ""
        raise ShipidError(f"{words}{more}; {KEPT} and larger workers", path=f"--scheduler {scheduler}")


def _given(shared: Shared) -> Shared:
    return shared


def _unread(given: Any) -> str:
    """Why what is shared could not be sent, in one line: the scheduler unpacks it, and may lack a module."""
    error = given.exception(timeout=SILENT)
    while error.__cause__ is not None:
        error = error.__cause__
    return f"the Dask scheduler cannot read the work ({str(error).splitlines()[0]}): {REMEDY}"


class _Watch:
    """Looks at a scheduler: OSError where it is gone, a warning where it has no worker for a while.

    Workers that have joined are asked for their code, and whether they can read what tasks need: one that lacks it dies
    of its first task without a word.

    threads : of all workers at the last look; at least 1, so that there is something to wait for.
    """

    def __init__(self, client: Any, needs: object = None) -> None:
        from distributed.protocol.pickle import dumps

        self._needs: bytes = dumps(needs)
        self._client, self._alone, self._warned = client, time.monotonic(), False
        self._looked, self.threads = float("-inf"), 1
        self._asked: set[str] = set()

    def look(self) -> None:
        """Look, if the last look is some time ago."""
        if time.monotonic() - self._looked < LOOK:
            return
        if self._client.status not in ("running", "connecting"):
            raise OSError("closed")
        workers = self._client.sync(self._client.scheduler.identity, callback_timeout=SILENT)["workers"]
        self._looked = time.monotonic()
        self.threads = max(sum(worker["nthreads"] for worker in workers.values()), 1)
        self._ask(workers.keys() - self._asked)
        if workers:
            self._alone, self._warned = time.monotonic(), False
        elif not self._warned and time.monotonic() - self._alone > PATIENCE:
            log.warning("the Dask scheduler has no workers: waiting for one")
            self._warned = True

    def _ask(self, workers: Collection[str]) -> None:
        """Ask workers for their code, once each; a warning for each where it is another."""
        if not workers:
            return
        self._asked |= set(workers)
        ask = self._client._run  # `Client.run` has no limit of time
        answers: dict[str, Any] = {}
        with suppress(OSError, TimeoutError):  # a worker that is slow to answer gets its tasks all the same
            answers = self._client.sync(
                ask, asked, self._needs, workers=list(workers), on_error="return", callback_timeout=SILENT
            )
        for address, answer in sorted(answers.items()):
            if isinstance(answer, OSError):
                log.warning("the worker %s died before it said what it can read: %s", address, REMEDY)
                continue
            if isinstance(answer, Exception):
                log.warning(
                    "the worker %s has no shipid %s as here, and may die of a task (%s)", address, __version__, answer
                )
                continue
            code, missing = answer
            if missing:
                log.warning("the worker %s cannot read the work, and dies of it (%s): %s", address, missing, REMEDY)
            elif code != code_digest():
                log.warning("the worker %s has another shipid: code %s, here %s", address, code, code_digest())


@contextmanager
def _without_logs(*names: str) -> Iterator[None]:
    """Silence loggers and those below them, whose errors are reported in one line."""
    every = [logging.getLogger(name) for name in logging.root.manager.loggerDict if name.split(".")[0] in names]
    before = {logger: logger.level for logger in every}
    try:
        for logger in every:
            logger.setLevel(logging.CRITICAL + 1)
        yield
    finally:
        for logger, level in before.items():
            logger.setLevel(level)
