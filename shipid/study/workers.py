"""Local workers: processes of one thread each that start quickly. Imports nothing heavy: it is called first of all."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import islice
from multiprocessing import Pipe, current_process, get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import ForkingPickler
from queue import SimpleQueue
from typing import Any, TypeVar, cast

from shipid.errors import ShipidError
from shipid.interrupts import hold_interrupts

METHOD = "forkserver" if sys.platform == "linux" else "spawn"  # of multiprocessing; forks are less safe elsewhere
LONGEST = 107 - len("/pymp-12345678/listener-12345678")  # bytes of a folder in which a forkserver has its socket
PRELOADED = ["shipid.study.run", "shipid.hybrid.training", "shipid.hybrid.ridge"]
"""Modules that workers need, PyTorch with them: a name that cannot be imported is passed over without a word."""
NO_GUARD = 64  # exit status of a worker whose script starts workers: EX_USAGE of sysexits.h
END = 5.0  # s in which a process that has closed its connection has ended
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")  # read at import

Task = TypeVar("Task")
Result = TypeVar("Result")


def import_for_workers() -> None:
    """Let a separate process import all that workers need, while this one goes on; they fork from it.

    Once per process. The workers ignore Ctrl-C, as their source does: this process stops them. Nothing happens where
    workers are not forked, or in a thread, which cannot set signals; then each worker imports for itself.
    """
    _check_guard()
    if _method() != "forkserver" or threading.current_thread() is not threading.main_thread():
        return
    from multiprocessing import forkserver

    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with _one_thread():
            forkserver.set_forkserver_preload(PRELOADED)
            forkserver.ensure_running()
    finally:
        signal.signal(signal.SIGINT, before)


def on_workers(work: Callable[[Task], Result], tasks: Iterable[Task], count: int) -> Iterator[tuple[Task, Result]]:
    """Tasks and their results from so many processes, as they finish; each process receives `work` once.

    What `work` raises is raised here; ShipidError if a process dies. The processes end with the iterator and with this
    process, whatever they are doing.
    """
    _check_guard()
    left, workers, doing, processes = iter(tasks), ExitStack(), {}, {}
    try:
        with hold_interrupts(), _one_thread():  # half a process would complain
            for task in islice(left, count):
                connection, process = _start(workers)
                with _alive(process):
                    connection.send(work)
                    connection.send(task)
                doing[connection], processes[connection] = task, process
        while doing:
            for ready in cast("list[Connection]", wait(list(doing))):
                with _alive(processes[ready]):
                    result, done = ready.recv(), doing.pop(ready)
                if isinstance(result, Exception):
                    raise result
                for task in islice(left, 1):
                    with _alive(processes[ready]):
                        ready.send(task)
                    doing[ready] = task
                yield done, result
    finally:
        workers.close()


def _check_guard() -> None:
    """End a worker that imports the script of its user, where the script starts workers: they would start more.

    A process begins with that import. What no line `if __name__ == "__main__":` guards is done once more. ShipidError
    for a script that is in no file, which they cannot import.
    """
    if getattr(sys.modules["__main__"], "__file__", None) == "<stdin>":
        raise ShipidError("a script from standard input cannot start workers: save it as a file, and run that")
    if getattr(current_process(), "_inheriting", False):  # where multiprocessing would raise an error of 20 lines
        os._exit(NO_GUARD)


@contextmanager
def _alive(process: BaseProcess) -> Iterator[None]:
    """ShipidError where the process at the other end of a connection is gone."""
    try:
        yield
    except (EOFError, ConnectionError):
        process.join(END)
        if process.exitcode == NO_GUARD:
            raise ShipidError(
                'each worker imports your script: put what it does below a line `if __name__ == "__main__":`',
                file=sys.modules["__main__"].__file__,
            ) from None
        raise ShipidError(
            "a worker was killed, perhaps because memory ran out; finished cells are kept: resume with fewer --workers"
        ) from None


def _method() -> str:
    """METHOD, or `spawn` where the path of the temporary folder (TMPDIR) is too long for the socket of a forkserver."""
    return METHOD if len(os.fsencode(tempfile.gettempdir())) <= LONGEST else "spawn"


def _start(workers: ExitStack) -> tuple[Connection, BaseProcess]:
    """Start a process, ended when `workers` closes; returns the connection to it, which takes the work, and itself.

    What a process gets as it starts is short: multiprocessing does not say how one ended that died before it had all.
    """
    context: Any = get_context(_method())
    here, there = Pipe()
    process = context.Process(target=_serve, args=(there,), daemon=True)
    process.start()
    there.close()
    workers.callback(process.join)
    workers.callback(process.kill)  # whatever the work has made of the signals
    return here, process


def _serve(connection: Connection) -> None:
    """Receive the work and do the tasks that come; errors are results that keep where they arose."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tasks: SimpleQueue[Any] = SimpleQueue()
    try:
        work = connection.recv()
        threading.Thread(target=_listen, args=(connection, tasks), daemon=True).start()
    except EOFError:
        return
    except Exception as error:  # a class of the user that cannot be imported here, or no more threads for this user
        connection.send_bytes(_pack_result(error))
        _listen(connection, tasks)  # so that the task that comes first is no write to a closed connection
    while True:
        result = None
        task = tasks.get()
        try:
            result = work(task)
        except Exception as error:
            error.add_note("".join(traceback.format_exception(error)))
            result = error
        connection.send_bytes(_pack_result(result))


def _pack_result(result: Any) -> Any:
    """The result as bytes, or an error where it cannot be sent: what a user's own method makes may be of any class."""
    try:
        content = ForkingPickler.dumps(result)
        if isinstance(result, Exception):
            ForkingPickler.loads(content)  # one that is made of more than a message cannot be made again
        return content
    except Exception as error:
        if isinstance(result, Exception):
            other: Exception = RuntimeError(f"{type(result).__name__}: {result}")
            other.add_note("\n".join(getattr(result, "__notes__", [])))
        else:
            words = f"what was computed cannot leave its process ({error}): give it classes and functions of a module"
            other = ShipidError(words)
        return ForkingPickler.dumps(other)


def _listen(connection: Connection, tasks: SimpleQueue[Any]) -> None:
    """Receive tasks until the other end is closed or gone; then end this process, whatever it is doing."""
    try:
        while True:
            tasks.put(connection.recv())
    except (EOFError, OSError):
        os._exit(0)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes started meanwhile use one thread, whatever they import."""
    before = dict(os.environ)
    try:
        os.environ.update(ONE_THREAD)
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
