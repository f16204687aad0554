"""The process that workers fork from ends at once, and no other process does."""

from __future__ import annotations

import subprocess
import sys

import pytest

from shipid.study.workers import METHOD, QUICK_END


@pytest.mark.skipif(METHOD != "forkserver", reason="workers are forked on Linux only")
def test_it_is_imported_where_workers_fork_from_and_nowhere_else() -> None:
    program = f"""
import multiprocessing, sys
from shipid.study.workers import import_for_workers
import_for_workers()
ask = "import sys; print('{QUICK_END}' in sys.modules, flush=True)"
process = multiprocessing.get_context("forkserver").Process(target=exec, args=(ask,))
process.start()
process.join()
print("{QUICK_END}" in sys.modules)
"""
    process = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert process.stdout.split() == ["True", "False"], process.stderr


def test_it_ends_a_process_before_what_was_registered_earlier() -> None:
    late = f"import atexit; atexit.register(print, 'slowly'); import {QUICK_END}"
    process = subprocess.run([sys.executable, "-c", late], capture_output=True, text=True, check=True)
    assert process.stdout == ""
