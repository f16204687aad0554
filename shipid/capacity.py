"""Processor and memory of this machine; a demand beyond its memory is refused before it is allocated."""

from __future__ import annotations

import math
import os
import platform
from contextlib import suppress
from functools import cache
from pathlib import Path

GIB = 2**30
_GROUP = Path("/sys/fs/cgroup")  # limits of a container


def processor_name() -> str:
    """Name of the processor; its family where the system gives no name."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())


def usable_cores() -> int:
    """Number of cores that this process may use, by its affinity and by its container."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(count, _container_cores(_GROUP) or count)


@cache
def _container_cores(group: Path) -> int | None:
    """Number of cores that a container may use, None without a limit; read once, for each rollout asks for it."""
    try:
        quota, period = map(int, (group / "cpu.max").read_text().split())
    except (OSError, ValueError):  # no such limit, or the word "max"
        return None
    return max(math.ceil(quota / period), 1) if quota > 0 < period else None


def usable_memory() -> int:
    """Bytes of memory that this process may have in all, by the machine and by its container."""
    limits = [2**62]
    if hasattr(os, "sysconf"):
        limits.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    with suppress(OSError, ValueError):  # no such limit, or the word "max"
        limits.append(int((_GROUP / "memory.max").read_text()))
    return min(limits)


def excess_memory_words(numbers: float) -> str | None:
    """Words for an amount of numbers of 8 bytes that cannot be had, such as `take 224 GiB ...`; None if it fits."""
    needed, most = 8.0 * numbers, usable_memory()
    return f"take {needed / GIB:.3g} GiB of memory, and there are {most / GIB:.3g}" if needed > most else None
