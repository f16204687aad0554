"""How a figure is taken: the best of several runs in turn, so that a slow moment of the machine hits all alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

SETTLES = 0.05  # s


def clock(run: Callable[[], object]) -> float:
    """Wall time [s] of one call."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def best_of(ways: Mapping[str, Callable[[], object]], rounds: int, *, settled: bool = False) -> dict[str, float]:
    """Least wall time [s] of each way over `rounds` rounds, every round calling all of them in turn.

    settled : call a way for a while before it is timed, so that it does not pay for what the way before leaves behind:
        threads that still wait actively, and other data in the caches.
    """
    best = dict.fromkeys(ways, float("inf"))
    for _ in range(rounds):
        for name, run in ways.items():
            begun = time.perf_counter()
            while settled and time.perf_counter() - begun < SETTLES:
                run()
            best[name] = min(best[name], clock(run))
    return best
