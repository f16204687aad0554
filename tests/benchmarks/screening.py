"""Screening of a family on every window of the study `simulation`: time, growth with the members, and memory.

By default 1,000 members stand for 10,000: the time of each further member is what is measured. Run as
`python -m tests.benchmarks.screening 10000` it takes them all.
"""

from __future__ import annotations

import resource
import sys
import time
from typing import Any

import pandas as pd

from shipid.engine.engines import REPEATED
from shipid.study.plan import read_plan
from shipid.study.prepare import obtain_runs
from shipid.study.screen import drawn_families, join_blocks, screen

STUDY, FAMILY, MEMBERS, ALL = "simulation", "high", 1000, 10_000


def run(members: int = MEMBERS) -> dict[str, Any]:
    """Wall time of a tenth of the members and of all, drawing and checking them included, and the greatest memory."""
    plan = read_plan(STUDY)
    wanted = drawn_families(plan, FAMILY)
    few, begun, few_busy, _ = _timed(plan, wanted, members // 10)
    _, _, few_single, _ = _timed(plan, wanted, members // 10, "single")
    few_memory = _memory()
    many, _, busy, frame = _timed(plan, wanted, members)
    _, _, busy_single, _ = _timed(plan, wanted, members, "single")
    more = members - members // 10
    each = (many - few) / more
    return {
        "data and windows, first block [s]": round(begun, 2),
        f"{members // 10} members [s]": round(few, 2),
        f"{members} members [s]": round(many, 2),
        "each further member [ms]": round(1e3 * each, 2),
        "each further member, of all threads [ms]": round(1e3 * (busy - few_busy) / more, 2),
        "single / double precision, each further member": round((busy_single - few_single) / (busy - few_busy), 2),
        f"{ALL} members, from these [s]": round(many + each * (ALL - members), 1),
        f"memory at {members // 10} / {members} members [MB]": f"{few_memory:.0f} / {_memory():.0f}",
        "A, median [m]": round(float(frame["A"].median()), 3),
    }


def _timed(plan: Any, wanted: Any, members: int, engine: str = REPEATED) -> tuple[float, float, float, pd.DataFrame]:
    """Wall time of all blocks and of the first, time that all threads were busy, and the rows."""
    start, busy = time.perf_counter(), time.process_time()
    blocks, begun = [], 0.0
    for block in screen(plan, obtain_runs(plan), wanted, members, engine=engine):
        begun = begun or time.perf_counter() - start
        blocks.append(block)
    return time.perf_counter() - start, begun, time.process_time() - busy, join_blocks(blocks)


def _memory() -> float:
    """Greatest resident memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    for label, value in run(int(sys.argv[1]) if sys.argv[1:] else MEMBERS).items():
        print(f"{label:45s} {value}")
