"""The PyTorch engine: width of blocks, entries of series, sums over components, agreement with CasADi."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from shipid.engine import torch as engine  # noqa: E402
from shipid.engine.rollout import rollout  # noqa: E402
from shipid.vessel.dynamics import vessel_dynamics  # noqa: E402
from shipid.vessel.load import load_vessel  # noqa: E402


@pytest.mark.parametrize("num_samples", [1, 255, 256, 8193, 20000])
@pytest.mark.parametrize("num_variants", [1, 16, 10_000])
def test_blocks_are_about_equal_and_bounded(num_samples: int, num_variants: int) -> None:
    width = engine._block_width(num_samples, num_variants, 1, "cpu")
    assert width * num_variants <= max(engine.CPU_BLOCK, engine.LEAST_SAMPLES * num_variants)
    assert -(-num_samples // width) * width - num_samples <= num_samples // width


def test_a_rollout_agrees_with_casadi() -> None:
    ship = load_vessel("gunnerus-28.9")
    model = vessel_dynamics(ship)
    start = {name: np.array([4.0, 3.0]) if name == "u" else np.zeros(2) for name in model.state}
    commands = {name: np.array([2.0, 1.5]) if name.endswith(".n") else np.array([0.1, -0.2]) for name in model.commands}
    calm = {name: np.zeros(2) for name in model.environment}
    paths = [rollout(ship, start, commands, calm, step=0.5, num_steps=4, engine=name) for name in ("torch", "casadi")]
    assert np.abs(paths[0]["east"][-1]).max() > 0
    assert np.allclose(paths[0].states, paths[1].states, rtol=1e-12, atol=1e-12)
