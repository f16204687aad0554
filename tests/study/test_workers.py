"""Workers: one process imports for all, on one thread each, and what starts it is as it was."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from shipid.study.workers import METHOD, ONE_THREAD, import_for_workers

forked = pytest.mark.skipif(METHOD != "forkserver", reason="workers are forked on Linux only")


@forked
def test_environment_and_interrupts_are_as_before() -> None:
    environment, handler = dict(os.environ), signal.getsignal(signal.SIGINT)
    import_for_workers()
    assert dict(os.environ) == environment
    assert signal.getsignal(signal.SIGINT) is handler


@forked
def test_workers_have_imported_all_use_one_thread_and_ignore_interrupts() -> None:
    """Asked of a worker of a fresh process, whose environment says two threads."""
    program = """
import multiprocessing, os, signal, sys
from shipid.study.workers import ONE_THREAD, import_for_workers
import_for_workers()
ask = "import os, signal, sys; imported = int('shipid.study.run' in sys.modules); "
ask += "print(imported, *(os.environ[n] for n in {}), {}, flush=True)"
ask = ask.format(list(ONE_THREAD), "int(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)")
process = multiprocessing.get_context("forkserver").Process(target=exec, args=(ask,))
process.start()
process.join()
"""
    environment = os.environ | dict.fromkeys(ONE_THREAD, "2")
    found = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["1"] * (1 + len(ONE_THREAD) + 1), found.stderr
