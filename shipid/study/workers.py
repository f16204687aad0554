"""Local workers: processes of one thread each that start quickly. Imports nothing heavy: it is called first of all."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import current_process, get_context, parent_process
from typing import Any, TypeVar

from shipid.errors import ShipidError
from shipid.interrupts import hold_interrupts
from shipid.plugins import TRIED_FILES, add_members, added_members, import_files

METHOD = "forkserver" if sys.platform == "linux" else "spawn"  # of multiprocessing; forks are less safe elsewhere
LONGEST = 107 - len("/pymp-12345678/listener-12345678")  # bytes of a folder in which a forkserver has its socket
PRELOADED = ["shipid.study.run", "shipid.hybrid.training", "shipid.hybrid.kernel_ridge"]
"""Modules that workers need, PyTorch with them: a name that cannot be imported is passed over without a word."""
NO_GUARD = 64  # exit status of a worker whose script starts workers: EX_USAGE of sysexits.h
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")  # read at import
KEPT_MEMORY = f"glibc.malloc.mmap_threshold={32 * 2**20}:glibc.malloc.trim_threshold={sys.maxsize}"
"""Lets glibc keep memory that was freed, of arrays as large as it can (mallopt(3)): to get it again takes time."""
_WORK: list[Any] = []  # of a worker: what it does with its tasks, as bytes until the first one; see `_begin`

Task = TypeVar("Task")
Result = TypeVar("Result")


def import_for_workers() -> None:
    """Let a separate process, which ignores Ctrl-C, import all that workers need; they fork from it.

    Nothing happens where workers are not forked, or in a thread, which cannot set signals.
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
    """Tasks and their results from so many processes, 0 for this one, as they finish; each receives `work` once.

    What `work` raises is raised here; ShipidError if a process dies. The processes end with the iterator and with this
    process, whatever they are doing.
    """
    if not count:
        yield from ((task, work(task)) for task in tasks)
        return
    _check_guard()
    given = (pickle.dumps(work), TRIED_FILES, added_members())
    pool = ProcessPoolExecutor(count, get_context(_method()), _begin, given)
    workers = pool._processes  # Python 3.14 has `kill_workers`
    try:
        with hold_interrupts(), _one_thread():  # half a process would complain
            futures = {pool.submit(_answer, task): task for task in tasks}
        for future in as_completed(futures):
            yield futures.pop(future), pickle.loads(future.result())
    except (BrokenProcessPool, BrokenPipeError) as error:
        if isinstance(error, BrokenPipeError) or NO_GUARD in {worker.exitcode for worker in workers.values()}:
            words = 'each worker imports your script: put what it does below a line `if __name__ == "__main__":`'
            raise ShipidError(words, file=sys.modules["__main__"].__file__) from None
        words = (
            "a worker was killed, perhaps because memory ran out; finished cells are kept: resume with fewer --workers"
        )
        raise ShipidError(words) from None
    finally:
        for worker in list(workers.values()):
            worker.kill()  # whatever the work has made of the signals
        pool.shutdown(cancel_futures=True)


def _check_guard() -> None:
    """End a worker that imports the script of its user, where the script starts workers: they would start more.

    A process begins with that import. ShipidError for a script that is in no file, which they cannot import.
    """
    if getattr(sys.modules["__main__"], "__file__", None) == "<stdin>":
        raise ShipidError("a script from standard input cannot start workers: save it as a file, and run that")
    if getattr(current_process(), "_inheriting", False):  # where multiprocessing would raise an error of 20 lines
        os._exit(NO_GUARD)


def _method() -> str:
    """METHOD, or `spawn` where the path of the temporary folder (TMPDIR) is too long for the socket of a forkserver."""
    return METHOD if len(os.fsencode(tempfile.gettempdir())) <= LONGEST else "spawn"


def _begin(*given: Any) -> None:
    """Begin a worker: it leaves Ctrl-C to its parent, and ends with that, whatever it is doing.

    given : its work as bytes, files that it runs before, and what it takes into the registries.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _WORK.extend(given)


def _end_with_parent() -> None:
    parent: Any = parent_process()
    parent.join()
    os._exit(0)


def _answer(task: Any) -> bytes:
    """What the work makes of a task; ShipidError where a user's own method makes what cannot be sent."""
    if isinstance(_WORK[0], bytes):
        try:
            import_files(_WORK[1])
            add_members(_WORK[2])
            _WORK[0] = pickle.loads(_WORK[0])
        except Exception as error:  # of a module as it is imported, or of a class that is not there
            words = f"workers import your files anew, and there it does not go ({type(error).__name__}: {error})"
            raise ShipidError(f"{words}: write methods and terms into a file, or take workers = 0") from None
    try:
        result = _WORK[0](task)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # it would end the pool
            raise RuntimeError(f"{type(error).__name__}: {error}") from None
        raise
    try:
        return pickle.dumps(result)
    except Exception as error:
        words = f"what was computed cannot leave its process ({error}): give it classes and functions of a module"
        raise ShipidError(words) from None


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes started meanwhile use one thread, whatever they import, and keep memory that they have freed."""
    before = dict(os.environ)
    os.environ.update({"GLIBC_TUNABLES": KEPT_MEMORY} | before | ONE_THREAD)  # a user may know better
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
