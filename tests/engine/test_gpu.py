"""Engines that run on a GPU agree with those of the processor; skipped where PyTorch sees no GPU."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from shipid.engine import torch as engine
from shipid.engine.integrate import Method
from shipid.engine.rollout import rollout
from shipid.study.prepare import obtain_runs, prepare
from shipid.study.run import run_unit
from shipid.vessel.load import load_vessel
from tests.drawn_ships import drawn_ship, extreme_inputs
from tests.study.tiny import mixed_plan, whole_unit

Draw = Callable[..., dict[str, dict[str, np.ndarray]]]
on_gpu = pytest.mark.skipif(not torch.cuda.is_available(), reason="PyTorch sees no GPU")


def spread(values: np.ndarray, count: int) -> np.ndarray:
    """So many sets of values within 10 % of these, (count, num_values)."""
    return values * np.random.default_rng(5).uniform(0.9, 1.1, (count, len(values)))


@on_gpu
@pytest.mark.parametrize("method", ["euler", "rk4"])
@pytest.mark.parametrize("varying", [False, True])
def test_a_family_on_a_gpu_is_that_of_the_processor(
    method: Method, varying: bool, draw_inputs: Draw, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "DEVICE_BLOCK", 1024)  # several blocks
    ship = load_vessel("gunnerus-28.9")
    given = draw_inputs(ship, 700)
    if varying:
        given["commands"] = {key: np.stack([x, 0.9 * x, 0.8 * x, x]) for key, x in given["commands"].items()}
    family = spread(np.array(list(ship.parameters.values())), 3)
    here, there = (
        rollout(ship, **given, step=0.5, num_steps=4, method=method, parameters=family, engine=one, device=device)
        for one, device in (("casadi", "cpu"), ("torch", "cuda"))
    )
    np.testing.assert_allclose(there.states, here.states, rtol=1e-10, atol=1e-10)


@on_gpu
@pytest.mark.parametrize("seed", range(6))
def test_strange_ships_on_a_gpu_are_those_of_the_processor(seed: int) -> None:
    ship = drawn_ship(seed)
    given = extreme_inputs(ship, 40, seed)
    here, there = (
        rollout(ship, **given, step=0.05, num_steps=3, engine=one, device=device)
        for one, device in (("casadi", "cpu"), ("torch", "cuda"))
    )
    np.testing.assert_array_equal(there.diverged, here.diverged)
    kept = ~here.diverged[0]
    np.testing.assert_allclose(there.states[..., kept, :], here.states[..., kept, :], rtol=1e-9, atol=1e-9)


@on_gpu
def test_a_study_on_a_gpu_gives_the_errors_of_the_processor(tmp_path: Path) -> None:
    plan = mixed_plan(tmp_path)
    data = obtain_runs(plan)
    units = [whole_unit(plan, batch) for batch in plan.batches]
    rows = []
    for device in ("cpu", "cuda"):
        prepared = prepare(plan, data, device)
        rows.append([cell.row for unit in units for cell in run_unit(plan, prepared, unit, device)])
    for here, there in zip(*rows, strict=True):
        assert (there["cell"], there["status"]) == (here["cell"], here["status"])
        rounding = 1e-3  # of single precision, in which networks are trained
        assert there["H"] == pytest.approx(here["H"], rel=rounding, nan_ok=True)
