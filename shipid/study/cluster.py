"""Units of work on the cluster of a Dask scheduler: what is left when it, or a worker, dies is reported in one line.

Workers do not touch the folder of the run: what a search writes is also sent to the process that gave the task.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from shipid.errors import ShipidError
from shipid.hybrid.journal import Journal
from shipid.plugins import TRIED_FILES, import_files

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

Shared = TypeVar("Shared")
Task = TypeVar("Task")
Result = TypeVar("Result")
log = logging.getLogger(__name__)


def journal_by_topic(content: bytes, study: str, topic: str, file: Path) -> Journal:
    """The journal of a task on a worker: what is added to it is sent by a topic of the scheduler.

    content : of its file in the folder of the run; what a worker that died has sent since is added. ResultError with
    the name of the file where that is damaged.
    """
    from dask.distributed import get_client, get_worker

    sent = (lines for _, lines in get_client().get_events(topic))
    return Journal(content + b"".join(sent), partial(get_worker().log_event, topic), study, file)


def on_dask(
    scheduler: str,
    work: Callable[[Shared, Task, str], Result],
    shared: Shared,
    tasks: Iterable[tuple[str, Task]],
    name: str,
    receive: Callable[..., object] = lambda *_: None,
) -> Iterator[tuple[Task, Result]]:
    """Tasks and what `work(shared, task, topic)` makes of them, in the order in which they finish.

    A task whose worker dies is done by another one; while there is no worker at all it waits for one.

    shared : sent once to each worker. tasks : with a key each. name : of the whole work.
    receive : called in this thread with the key of a task and each message that it sends by its topic.

    Raises ShipidError where the scheduler does not answer, and, when all others are done, for a task that has killed
    worker after worker. What `work` raises is raised here.
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
            yield from _results(client, work, shared, tasks, f"shipid-{name}-{client.id}", receive)
        finally:
            with suppress(Exception):  # a client whose scheduler is gone complains in many ways
                client.close(timeout=2)


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


def _results(
    client: Any,
    work: Callable[[Shared, Task, str], Result],
    shared: Shared,
    tasks: Iterable[tuple[str, Task]],
    name: str,
    receive: Callable[..., object],
) -> Iterator[tuple[Task, Result]]:
    from dask.distributed import CancelledError, KilledWorker

    came: SimpleQueue[tuple[str, Any]] = SimpleQueue()  # (key, future that has ended, or message)
    left: dict[str, tuple[Task, Any]] = {}
    killed: list[str] = []
    mistake: Exception | None = None
    lonely = False
    try:
        client.register_worker_callbacks(partial(import_files, list(TRIED_FILES)))
        given = client.submit(_return_shared, shared, key=f"{name}-shared", pure=False)  # made again if its worker dies
        for key, task in tasks:
            topic = f"{name}-{key}"
            client.subscribe_topic(topic, lambda event, key=key: came.put((key, event[1])))
            future = client.submit(work, given, task, topic, key=topic, pure=False)
            left[key] = task, future
            future.add_done_callback(lambda future, key=key: came.put((key, future)))
        while left and mistake is None:
            try:
                key, future = came.get(timeout=LOOK)
            except Empty:
                lonely = _has_no_workers(client, lonely)
                continue
            if isinstance(future, bytes):
                receive(key, future)
                continue
            task, _ = left.pop(key)
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
        raise ShipidError(f"the Dask scheduler is gone, or cannot read the work: {REMEDY}; {KEPT}") from None
    if mistake is not None:
        raise mistake
    if killed:
        words = f"workers of the cluster die at {', '.join(killed)}: for want of memory, or of a module of yours"
        raise ShipidError(f"{words}; {REMEDY}, or take larger workers; {KEPT}")


def _return_shared(shared: Shared) -> Shared:
    return shared


def _has_no_workers(client: Any, before: bool) -> bool:
    """Whether a scheduler has no workers, with a warning if it had some before; OSError where it is gone."""
    if client.status not in ("running", "connecting"):
        raise OSError("closed")
    workers = client.sync(client.scheduler.identity, callback_timeout=SILENT)["workers"]
    if not workers and not before:
        log.warning("the Dask scheduler has no workers: waiting for one")
    return not workers
