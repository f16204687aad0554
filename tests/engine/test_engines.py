"""The dict of engines: a new one is one line, `auto` chooses by size, and what an engine cannot do is reported."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from shipid.engine import engines
from shipid.engine.engines import ENGINES, Engine, choose_engine
from shipid.engine.integrate import Array, RolloutBatch, RolloutJob
from shipid.engine.rollout import rollout, rollout_distances
from shipid.errors import ShipidError
from shipid.metrics import position_error, tally_errors
from shipid.vessel.dynamics import Dynamics
from shipid.vessel.load import load_vessel

Draw = Callable[..., dict[str, dict[str, np.ndarray]]]
SHIP = load_vessel("gunnerus-28.9")


def drift(_: Dynamics, batch: RolloutBatch, job: RolloutJob) -> tuple[Array, Array]:
    """A toy: whatever the forces, everything moves by its number of seconds."""
    times = np.arange(0, job.num_steps + 1, job.every) * job.step
    path = batch.state[list(job.rows)].T[None, None] + times[:, None, None, None]
    records = np.repeat(path, len(batch.parameters), axis=1)
    return records, np.ones(records.shape[1:3])


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setitem(ENGINES, "drift", Engine(drift))
    return "drift"


def test_an_engine_is_one_line(toy: str, draw_inputs: Draw) -> None:
    given = draw_inputs(SHIP, 3)
    path = rollout(SHIP, **given, step=2.0, num_steps=6, every=3, keep=("east", "u"), engine=toy)
    for name in ("east", "u"):
        expected = given["start"][name] + np.array([0.0, 6.0, 12.0])[:, None]
        np.testing.assert_allclose(path[name][:, 0], expected)
    assert not path.diverged.any()


def test_a_new_engine_measures_from_its_paths(toy: str, draw_inputs: Draw) -> None:
    given, goal = draw_inputs(SHIP, 3), np.zeros((4, 3, 2))
    measured = rollout_distances(SHIP, **given, goal=goal, step=1.0, engine=toy)
    path = rollout(SHIP, **given, step=1.0, num_steps=4, keep=("north", "east"), engine=toy)
    apart = position_error(path.states[1:, 0], goal)
    np.testing.assert_allclose(measured.total[0], apart.sum(axis=0))
    np.testing.assert_array_equal(measured.tally[0], tally_errors(apart))


def test_a_wrong_name_lists_all_engines(toy: str, draw_inputs: Draw) -> None:
    with pytest.raises(ShipidError, match="engine 'wind' is not known") as caught:
        rollout(SHIP, **draw_inputs(SHIP, 1), step=1.0, num_steps=1, engine="wind")
    for name in ("auto", toy, "native", "casadi", "torch"):
        assert name in str(caught.value)


@pytest.mark.parametrize(
    ("num_samples", "num_steps", "device", "has_compiler", "expected"),
    [
        (10, 10, "cpu", True, "casadi"),
        (10, 30_000, "cpu", True, "native"),
        (10, 30_000, "cpu", False, "casadi"),
        (4000, 10, "cpu", True, "torch"),
        (4000, 100, "cpu", True, "native"),
        (4000, 100, "cpu", False, "torch"),
        (4000, 100, "cuda", True, "torch"),
    ],
)
def test_auto_goes_by_size_and_by_what_there_is(
    num_samples: int,
    num_steps: int,
    device: str,
    has_compiler: bool,
    expected: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(engines, "find_compiler", lambda: "cc" if has_compiler else None)
    empty: Any = np.zeros((1, 0, num_samples))
    batch = RolloutBatch(np.zeros((6, num_samples)), empty[0], empty, empty, empty, np.zeros((1, 3)))
    assert choose_engine(batch, RolloutJob(1.0, num_steps, "euler", 1, (0, 1), device)) is ENGINES[expected]
