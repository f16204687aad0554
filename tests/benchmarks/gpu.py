"""A GPU against all cores of the processor: rollouts of gunnerus-28.9."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from shipid.engine.rollout import rollout
from shipid.vessel.load import load_vessel
from tests.benchmarks.rollouts import STEPS, inputs, variants
from tests.benchmarks.timing import best_of

SIZES = ((6016, 1), (6016, 16), (60160, 16))  # samples, variants


def run() -> dict[str, Any]:
    """Million steps per second with the final states, and first calls."""
    if not torch.cuda.is_available():
        return {"GPU": "PyTorch sees none"}
    figures: dict[str, Any] = {"GPU": torch.cuda.get_device_name()}
    for samples, count in SIZES:
        figures |= _rollouts(samples, count)
    return figures


def _rollouts(samples: int, count: int) -> dict[str, Any]:
    vessel = load_vessel("gunnerus-28.9")
    start, commands, environment = inputs(samples)
    family = variants(vessel, count)

    def states(engine: str, device: str) -> np.ndarray:
        return rollout(
            vessel, start, commands, environment, step=1.0, num_steps=STEPS, every=STEPS, parameters=family,
            engine=engine, device=device,  # type: ignore[arg-type]
        ).states  # fmt: skip

    ways = {
        "native": lambda: states("native", "cpu"),
        "torch on the GPU": lambda: states("torch", "cuda"),
    }
    for name in ways:
        assert np.allclose(ways[name](), ways["native"](), rtol=1e-9, atol=1e-9), name
    seconds = best_of(ways, rounds=5, settled=True)
    size = f"{samples} samples, {count} variants"
    work = samples * count * STEPS / 1e6
    return {f"{size}: {name} [million steps/s]": round(work / took, 1) for name, took in seconds.items()}
