"""Growth of cost over a decade: time per unit of ten times the work over time per unit of the work."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shipid.engine.rollout import rollout
from shipid.study.plan import build_plan
from shipid.vessel.load import load_vessel
from tests.benchmarks.rollouts import inputs
from tests.benchmarks.timing import best_of
from tests.study.tiny import events_here, tiny_plan

VARIANTS, SAMPLES, CELLS, MODELS, FAMILIES = (10, 100), (1000, 10000), (40, 400), (10, 100), (300, 3000)
STEPS = 30
ROUNDS, STUDY_ROUNDS = 5, 2


def run() -> dict[str, Any]:
    """Time per unit at ten times the units over time per unit: 1 is linear, less is better than linear."""
    result: dict[str, Any] = {}
    parts = {"variants": variants, "samples": samples, "cells": cells, "models": models, "families": families}
    for name, seconds in ((name, measured()) for name, measured in parts.items()):
        few, many = sorted(seconds)
        result |= {f"{count} {name} [s]": round(seconds[count], 4) for count in (few, many)}
        result[f"{name}: time per unit, {many} / {few}"] = round(seconds[many] / seconds[few] * few / many, 3)
    return result


def variants() -> dict[int, float]:
    """Rollouts of a family, 1,000 samples, north and east kept."""
    return _rollouts({count: (count, SAMPLES[0]) for count in VARIANTS})


def samples() -> dict[int, float]:
    """Rollouts of a family of ten, north and east kept."""
    return _rollouts({count: (VARIANTS[0], count) for count in SAMPLES})


def _rollouts(sizes: Mapping[int, tuple[int, int]]) -> dict[int, float]:
    vessel = load_vessel("gunnerus-28.9")
    values = np.array(list(vessel.parameters.values()))

    def rolled(num_variants: int, num_samples: int) -> Any:
        factors = np.random.default_rng(1).uniform(0.8, 1.2, (num_variants, len(values)))
        parameters, given = values * np.where(values == 0, 1, factors), inputs(num_samples)
        return lambda: rollout(
            vessel, *given, step=1.0, num_steps=STEPS, parameters=parameters, keep=("north", "east"), engine="native"
        )

    seconds = best_of({str(count): rolled(*size) for count, size in sizes.items()}, ROUNDS)
    return {int(count): value for count, value in seconds.items()}


def cells() -> dict[int, float]:
    """The cells of a tiny study in this process, files included: 8 cells a seed, all batches alike."""
    return _studies({count: {"grid.seeds": list(range(count // 8))} for count in CELLS})


def models() -> dict[int, float]:
    """The same with more models, which train together: two batches."""
    return _studies({count: {"family.1.members": count - 2} for count in MODELS})


def families() -> dict[int, float]:
    """The plan of a study of so many families, from its document, with its units of work."""
    with tempfile.TemporaryDirectory() as folder:
        plan = tiny_plan(Path(folder))
        one = plan.document["family"][1] | {"members": 1}

        def planned(count: int) -> Any:
            many = plan.document | {
                "family": [plan.document["family"][0], *({**one, "name": f"f{i}"} for i in range(count))]
            }
            return lambda: build_plan(many, Path(plan.file)).units

        seconds = best_of({str(count): planned(count) for count in FAMILIES}, STUDY_ROUNDS)
    return {int(count): value for count, value in seconds.items()}


def _studies(changes: Mapping[int, Mapping[str, Any]]) -> dict[int, float]:
    """Least wall time [s] from the first cell's start to the last file, of each study."""
    best = dict.fromkeys(changes, float("inf"))
    for _ in range(STUDY_ROUNDS):
        for count, change in changes.items():
            with tempfile.TemporaryDirectory() as folder:
                plan = tiny_plan(Path(folder), change)
                for event in events_here(plan, Path(folder) / "run"):
                    if event.kind == "start":
                        begun = time.perf_counter()
                best[count] = min(best[count], time.perf_counter() - begun)
    return best
