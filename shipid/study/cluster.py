"""Units of work on the cluster of a Dask scheduler: what is left when it, or a worker, dies is reported in one line.

Workers touch no folder: what a search writes as it goes is sent to the process that gave the task.
"""

from __future__ import annotations

import logging
import pickle
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from shipid.errors import ShipidError
from shipid.hybrid.method import Row, Space

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
Known = tuple[list[Row], int | None]  # trials of a search so far, and how many there will be
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Line:
    """Sends messages of a task from a worker to the process that gave it, by a topic of the scheduler."""

    topic: str

    def send(self, *message: Any) -> None:
        """Send a message."""
        from dask.distributed import get_worker

        get_worker().log_event(self.topic, pickle.dumps(message))

    def sent(self) -> list[tuple[Any, ...]]:
        """Messages of this task so far: of a worker that has died meanwhile."""
        from dask.distributed import get_client

        return [pickle.loads(content) for _, content in get_client().get_events(self.topic)]


class SentSearches:
    """The searches of a unit on a worker of a cluster: each trial is sent as it ends, see `shipid.hybrid.journal`.

    known : what the journal holds, by cell; what a worker that died has sent since is added.
    """

    def __init__(self, known: Mapping[str, Known], line: Line) -> None:
        self._rows = {cell: list(rows) for cell, (rows, _) in known.items()}
        self._counts = {cell: count for cell, (_, count) in known.items()}
        self._line = line
        for name, *given in line.sent():
            (self._keep if name == "add" else self._fix)(*given)

    def rows(self, cell: str) -> list[Row]:
        """Return the trials of a search that ended, in order."""
        return list(self._rows[cell])

    def count(self, cell: str) -> int | None:
        """Return how many trials the budget of a search allowed; None before that is decided."""
        return self._counts[cell]

    def add(self, rows: Mapping[str, Sequence[Row]], space: Space) -> None:
        """Append trials to searches: cell -> rows, each with the next number."""
        self._keep(rows, space)
        self._line.send("add", rows, space)

    def decide(self, cells: Sequence[str], count: int) -> None:
        """Write how many trials some searches have."""
        self._fix(cells, count)
        self._line.send("decide", cells, count)

    def _keep(self, rows: Mapping[str, Sequence[Row]], _: Space) -> None:
        for cell, more in rows.items():
            for row in more:
                if row["number"] == len(self._rows[cell]):  # two workers may have sent it
                    self._rows[cell].append(row)

    def _fix(self, cells: Sequence[str], count: int) -> None:
        self._counts |= dict.fromkeys(cells, count)


def on_dask(
    scheduler: str,
    work: Callable[[Shared, Task, Line], Result],
    shared: Shared,
    tasks: Iterable[tuple[str, Task]],
    name: str,
    receive: Callable[..., object] = lambda *_: None,
) -> Iterator[tuple[Task, Result]]:
    """Tasks and what `work(shared, task, line)` makes of them, in the order in which they finish.

    A task whose worker dies is done by another one. While there is no worker at all it waits for one, and says so.

    Parameters
    ----------
    scheduler : address of a Dask scheduler, such as `tcp://host:8786`.
    shared : sent once to each worker. tasks : with a key each, taken when workers are about to need them. name : of the
        whole work; beside it the keys name this client, since a scheduler computes a key once for all its clients.
    receive : called in this thread with the key of a task and each message that it sends by its line.

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
            yield from _results(client, work, shared, tasks, f"shipid-{name}-{client.id}", _Watch(client), receive)
        except ShipidError as error:
            raise ShipidError(error.message, file=error.file, path=error.path or f"--scheduler {scheduler}") from error
        finally:
            with suppress(Exception):  # a client whose scheduler is gone complains in many ways
                client.close(timeout=2)


def _results(
    client: Any,
    work: Callable[[Shared, Task, Line], Result],
    shared: Shared,
    tasks: Iterable[tuple[str, Task]],
    name: str,
    watch: _Watch,
    receive: Callable[..., object],
) -> Iterator[tuple[Task, Result]]:
    from dask.distributed import CancelledError, KilledWorker

    came: SimpleQueue[tuple[str, Any]] = SimpleQueue()  # (key, future that has ended, or message)
    left: dict[str, tuple[Task, Any]] = {}
    killed: list[str] = []
    mistake: Exception | None = None
    waiting, given = iter(tasks), None
    try:
        given = client.submit(_return_shared, shared, key=f"{name}-shared", pure=False)  # made again if its worker dies
        while mistake is None:
            watch.look()
            for key, task in islice(waiting, max(AHEAD * watch.threads - len(left), 0)):
                topic = f"{name}-{key}"
                client.subscribe_topic(topic, lambda event, key=key: came.put((key, event[1])))
                future = client.submit(work, given, task, Line(topic), key=topic, pure=False)
                left[key] = task, future
                future.add_done_callback(lambda future, key=key: came.put((key, future)))
            if not left:
                break
            try:
                key, future = came.get(timeout=LOOK)
            except Empty:
                continue
            if isinstance(future, bytes):
                receive(key, *pickle.loads(future))
                continue
            task, _ = left.pop(key)
            client.unsubscribe_topic(f"{name}-{key}")
            try:
                results = future.result(timeout=SILENT)
            except KilledWorker:
                killed.append(key)
            except Exception as error:
                if future.status != "error":
                    raise
                mistake = error  # of the task, and not of the cluster
            else:
                yield task, results
                del future, results  # a worker may forget them
    except (OSError, TimeoutError, CancelledError):
        if given is not None and given.status == "error":  # the work was refused, and all that needs it with it
            raise ShipidError(_unread(given)) from None
        raise ShipidError(f"the Dask scheduler is gone; {KEPT}") from None
    if mistake is not None:
        raise mistake
    if killed:
        more = f" and {len(killed) - 3} more" if len(killed) > 3 else ""
        words = (
            f"workers of the cluster die at {', '.join(killed[:3])}{more}: for want of memory, or of a module of yours"
        )
        raise ShipidError(f"{words}; {REMEDY}, or take larger workers; {KEPT}")


def _return_shared(shared: Shared) -> Shared:
    return shared


def _unread(given: Any) -> str:
    """Why what is shared could not be sent, in one line: the scheduler unpacks it, and may lack a module."""
    error = given.exception(timeout=SILENT)
    while error.__cause__ is not None:
        error = error.__cause__
    return f"the Dask scheduler cannot read the work ({str(error).splitlines()[0]}): {REMEDY}"


class _Watch:
    """Looks at a scheduler: OSError where it is gone, a warning where it has no worker for a while.

    threads : of all workers at the last look; at least 1, so that there is something to wait for.
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._looked, self._seen, self._warned = float("-inf"), time.monotonic(), False
        self.threads = 1

    def look(self) -> None:
        """Look, if the last look is some time ago."""
        if time.monotonic() - self._looked < LOOK:
            return
        if self._client.status not in ("running", "connecting"):
            raise OSError("closed")
        workers = self._client.sync(self._client.scheduler.identity, callback_timeout=SILENT)["workers"]
        self._looked = time.monotonic()
        self.threads = max(sum(worker["nthreads"] for worker in workers.values()), 1)
        if workers:
            self._seen, self._warned = time.monotonic(), False
        elif not self._warned and time.monotonic() - self._seen > PATIENCE:
            log.warning("the Dask scheduler has no workers: waiting for one")
            self._warned = True


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
