"""The truth of the study `simulation`: turning manoeuvres of 80 s at 0.05 s, six degrees of freedom in waves."""

from __future__ import annotations

import tempfile
import time
from typing import Any

import pytest

from shipid.engine import native
from shipid.simulation.truth import Truth, simulate_truth
from shipid.study.plan import read_plan
from tests.benchmarks.timing import best_of

COUNTS = (120, 1200)


def run() -> dict[str, Any]:
    """Wall time [s] of all manoeuvres in one call, and of the first call, which compiles."""
    plan = read_plan("simulation")
    vessel, declared = plan.truth, plan.study.truth

    def simulated(count: int) -> Any:
        return simulate_truth(Truth(**{**declared.model_dump(), "manoeuvres": count}), vessel)

    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", folder)
        native._compile_rollout.cache_clear()
        begun = time.perf_counter()
        simulated(COUNTS[0])
        first = time.perf_counter() - begun
    seconds = best_of({str(count): lambda count=count: simulated(count) for count in COUNTS}, rounds=3)  # type: ignore[misc]
    few, many = (seconds[str(count)] for count in COUNTS)
    return {
        "first call, compilation included [s]": round(first, 2),
        **{f"{count} manoeuvres [s]": round(seconds[str(count)], 2) for count in COUNTS},
        "growth from 120 to 1200": round(many / few, 1),
    }
