"""Laws over ships that nobody would build: every engine says the same of them, at any state that a ship can be in."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shipid.engine.gradient import rollout_gradient, squared_distance_loss
from shipid.engine.native import find_compiler
from shipid.engine.rollout import Trajectories, rollout
from shipid.export.c_vessel import vessel_files
from shipid.physics import TERMS
from shipid.vessel.load import Vessel
from shipid.vessel.schema import term_blocks
from tests.drawn_ships import GRAVITY, drawn_ship, extreme_inputs
from tests.export.compiled import SANITIZERS, run_example

SHIPS = [(27, 6), (47, 3), (14, 6), (3, 4), (5, 3)]  # seed and degrees of freedom; all terms but those of waves
ALL = pytest.mark.parametrize(("seed", "dof"), SHIPS)
NEAR = {"native": 1e-9, "torch": 1e-9, "single": 2e-3}  # of the greatest value of each channel
SAMPLES, STEPS = 9, 8

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")


def step_of(vessel: Vessel) -> float:
    """A twentieth of the time in which a wave of her length moves on."""
    return 0.05 * float(np.sqrt(vessel.document["particulars"]["L_pp"] / GRAVITY))


def rolled(vessel: Vessel, engine: str, method: Any) -> Trajectories:
    """Two variants, with orders that turn round on the way."""
    given = extreme_inputs(vessel, SAMPLES)
    turn = np.repeat([1.0, -1.0], STEPS // 2)[:, None]
    given["commands"] = {name: turn * values for name, values in given["commands"].items()}
    values = np.array(list(vessel.parameters.values()))
    return rollout(
        vessel, **given, step=step_of(vessel), num_steps=STEPS, method=method, engine=engine,
        parameters=np.stack([values, values * (1 + 0.02 * np.sin(np.arange(len(values))))]),
    )  # fmt: skip


def test_the_drawn_ships_have_every_term() -> None:
    having = {key for ship in SHIPS for _, key, _ in term_blocks(drawn_ship(*ship).document)}
    assert having == {key for key in TERMS if not key.startswith("waves")}


@ALL
def test_engines_agree(seed: int, dof: int) -> None:
    vessel, method = drawn_ship(seed, dof), ("euler", "rk4")[seed % 2]
    expected = rolled(vessel, "casadi", method)
    sound = ~expected.diverged
    assert sound.mean() > 0.7
    scale = np.abs(expected.states[:, sound]).max(axis=(0, 1)) + 1e-3
    for engine, near in NEAR.items():
        found = rolled(vessel, engine, method)
        np.testing.assert_array_equal(found.diverged, expected.diverged)
        assert (np.abs(found.states - expected.states)[:, sound] / scale).max() < near, engine


@ALL
def test_gradients_agree_and_are_finite(seed: int, dof: int) -> None:
    vessel = drawn_ship(seed, dof)
    given = extreme_inputs(vessel, SAMPLES)
    names = [str(name) for name in np.random.default_rng(seed).choice(list(vessel.parameters), 8, replace=False)]
    loss = squared_distance_loss(np.zeros((STEPS, SAMPLES, 2)))
    native, torch = (
        rollout_gradient(
            vessel, **given, loss=loss, step=step_of(vessel), num_steps=STEPS, names=names, keep=("u", "r"),
            engine=engine,
        )
        for engine in ("native", "torch")
    )  # fmt: skip
    sound = ~native.diverged
    for one, other in (
        (native.parameters, torch.parameters),
        *((native.start[n], torch.start[n]) for n in native.start),
    ):
        assert np.isfinite(one[sound]).all()
        np.testing.assert_allclose(other[sound], one[sound], rtol=1e-7, atol=1e-7 * (1e-3 + np.abs(one[sound]).max()))


@pytest.mark.slow
@ALL
def test_exported_equations_run_without_a_warning(seed: int, dof: int, tmp_path: Any) -> None:
    vessel = drawn_ship(seed, dof)
    run_example(vessel_files(vessel, "ship", "rk4"), tmp_path, *SANITIZERS)
