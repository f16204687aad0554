"""Tasks in C on threads: each is done once, in calls between which an interrupt takes effect."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipid.engine import native, threads
from shipid.engine.integrate import count_threads
from shipid.engine.native import compile_source, find_compiler
from shipid.engine.threads import run_tasks, threaded_source
from tests.engine.conftest import QUICK

COUNT = threaded_source(["shift"], {"done": "int", "nothing": "int"}, "done[number + shift] += nothing ? 100 : 1;")


@pytest.fixture
def count(libraries_kept: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A C function that counts how often it does each task."""
    if find_compiler() is None:
        pytest.skip("no C compiler on this machine")
    monkeypatch.setenv("XDG_CACHE_HOME", str(libraries_kept))
    monkeypatch.setattr(native, "OPTIONS", QUICK)
    return compile_source(COUNT)


@pytest.mark.parametrize("num_cores", [1, 2, 5])
@pytest.mark.parametrize("work", [1.0, threads.AT_ONCE / 3, 1e9])
@pytest.mark.parametrize("num_tasks", [0, 1, 37])
def test_every_task_is_done_once(
    count: Any, monkeypatch: pytest.MonkeyPatch, num_cores: int, work: float, num_tasks: int
) -> None:
    monkeypatch.setattr(threads, "count_threads", lambda: num_cores)
    done = np.zeros(40, dtype=np.intc)
    run_tasks(count, [3], [done, None], num_tasks, work)
    assert done.tolist() == [0, 0, 0, *[1] * num_tasks, *[0] * (37 - num_tasks)]


def test_after_an_interrupt_nothing_more_is_begun(count: Any) -> None:
    """Long tasks are done a few in one call of C, so that Python sees the interrupt after these few."""
    done = np.zeros(1003, dtype=np.intc)

    def interrupted(*arguments: Any) -> None:
        count(*arguments)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_tasks(interrupted, [3], [done, None], 1000, threads.AT_ONCE)
    assert 0 < done.sum() <= 2 * count_threads()
