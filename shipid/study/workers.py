"""How local workers start: quickly where that is safe. Imports nothing heavy, so that it can be called first of all."""

from __future__ import annotations

import os
import signal
import sys
import threading

METHOD = "forkserver" if sys.platform == "linux" else "spawn"  # of multiprocessing; forks are less safe elsewhere
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")  # read at import


def import_for_workers() -> None:
    """Let a process of its own import all that workers need, while this one goes on; they fork from it.

    Once per process. The workers ignore Ctrl-C, as their source does: this process stops them. Nothing happens where
    workers are not forked, or in a thread, which cannot set signals; then each worker imports for itself.
    """
    if METHOD != "forkserver" or threading.current_thread() is not threading.main_thread():
        return
    from multiprocessing import forkserver

    before, environment = signal.signal(signal.SIGINT, signal.SIG_IGN), dict(os.environ)
    try:  # both are inherited
        os.environ.update(ONE_THREAD)
        forkserver.set_forkserver_preload(["shipid.study.run", "distributed.nanny"])
        forkserver.ensure_running()
    finally:
        os.environ.clear()
        os.environ.update(environment)
        signal.signal(signal.SIGINT, before)
