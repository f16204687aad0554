"""The learned force: bounds by hand, what the ridge does, what it learns, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.data.windows import Windows, cut_windows
from shipid.engine.rollout import rollout
from shipid.errors import DataError
from shipid.hybrid.learned_force import (
    BLOCK,
    HIDDEN,
    OUTPUT,
    LearnedForce,
    _ForceLoss,
    force_limits,
    horizontal_mass,
    with_block,
)
from shipid.hybrid.method import Case, Task, fit_all
from shipid.hybrid.physics import Physics
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.hybrid.worlds import fitted, world
from tests.study.test_commands import weaving

SHIP = load_vessel("gunnerus-28.9")
WRONG = Physics(SHIP.with_values({"hull.derivatives.X_u|u|": 2 * SHIP.parameters["hull.derivatives.X_u|u|"]}), 5, 1.0)
CHEAP = {"trials": 2, "units": 3, "iterations": 25}


@pytest.fixture(scope="module")
def windows() -> Windows:
    """Windows of the right ship."""
    return cut_windows(weaving("abc"), horizon=5, interval=3.0)


def task(windows: Windows, physics: Physics = WRONG, seed: int = 1) -> Task:
    """One foundation whose resistance is wrong, commands known, every run left out in turn."""
    folds = [(np.flatnonzero(windows.run != run), np.flatnonzero(windows.run == run)) for run in windows.spans]
    case = Case(physics, physics.paths(windows.instants(known=True)))
    commands = tuple(name for name in windows.columns if "." in name)
    return Task({"wrong": case}, windows, folds, commands, known=True, seed=seed)


def error(paths: np.ndarray, windows: Windows) -> float:
    """Mean distance [m]."""
    return float(np.linalg.norm(paths - windows.future, axis=-1).mean())


def test_it_learns_most_of_a_wrong_resistance(windows: Windows) -> None:
    given = task(windows)
    fit = LearnedForce(**CHEAP, ridge=(1e-4, 1e-2)).fit(given)["wrong"]
    learned = fit.corrector.predict(WRONG, given.instants("wrong"), given.cases["wrong"].paths)
    assert error(learned, windows) < 0.3 * error(given.cases["wrong"].paths, windows)
    best = min(fit.trials, key=lambda row: row["value"])
    assert fit.corrector.hyperparameters == best["params"]
    assert [row["params"]["ridge"] for row in fit.trials] == pytest.approx([1e-2, 1e-4])  # from stiff to soft


def test_the_force_is_bounded_by_what_the_ship_is() -> None:
    document = SHIP.document
    m, I_z, length = document["inertia"]["m"], document["inertia"]["I_z"], document["particulars"]["L_pp"]
    bounds = force_limits(SHIP, 4.0, 0.5)
    assert bounds["X_max"][0] == bounds["Y_max"][0] == pytest.approx(0.5 * m * 16.0 / length)
    assert bounds["N_max"][0] == pytest.approx(0.5 * I_z * 16.0 / length**2)
    assert force_limits(SHIP, 0.0, 1.0)["X_max"][0] > 0


def block(units: int = 3, weight: float = 1.0) -> dict[str, np.ndarray]:
    """Numbers of a force."""
    rng = np.random.default_rng(0)
    numbers = {name: np.array([1.0]) for name in ("u_scale", "v_scale", "r_scale")} | force_limits(SHIP, 3.0, 1.0)
    return numbers | {name: weight * rng.normal(size=units) for name in (*HIDDEN, *OUTPUT)}


@pytest.mark.parametrize(
    ("vessel", "message"),
    [
        (
            with_block(WRONG, block(weight=1e3)).ship,
            f"has a learned force already: take the block {BLOCK} out",
        ),
        (
            load_vessel("gunnerus-28.9-6dof"),
            r"waves\.first_order is a sum over drawn waves, which has no gradient: take",
        ),
    ],
)
def test_a_vessel_that_can_have_none_is_refused(windows: Windows, vessel: Vessel, message: str) -> None:
    with pytest.raises(DataError, match=message):
        fit_all(LearnedForce(**CHEAP), task(windows, replace(WRONG, vessel=vessel)))


def test_windows_that_the_physics_cannot_follow_do_not_train(windows: Windows) -> None:
    """The others do: such a window goes straight on, whatever the force."""
    every = np.arange(len(windows))
    instants = windows.instants(known=True)
    broken = replace(instants, columns={**instants.columns, "u": np.where(every == 4, 1e9, instants.columns["u"])})
    trainer = _ForceLoss(WRONG, block(weight=0.0), broken, windows.future, 5)
    assert len(trainer.instants) == len(every) - 1
    np.testing.assert_array_equal(trainer.future, windows.future[:, every != 4])
    none = replace(instants, columns={**instants.columns, "u": np.full(len(every), 1e9)})
    hopeless = _ForceLoss(WRONG, block(weight=0.0), none, windows.future, 5)
    np.testing.assert_array_equal(hopeless.solve(0.1, None)[0], hopeless.start)
    now = np.stack([none.columns[name] for name in "uv"], axis=-1)
    straight = windows.step * np.arange(1, windows.horizon + 1)[:, None, None] * now
    error = np.square(straight - windows.future).sum(axis=-1).mean()
    assert hopeless.error(hopeless.start, none, windows.future) == pytest.approx(error)
    alone = _ForceLoss(WRONG, block(weight=0.0), instants.select(every[every != 4]), windows.future[:, every != 4], 5)
    np.testing.assert_array_equal(trainer.solve(0.1, None)[0], alone.solve(0.1, None)[0])


@pytest.mark.slow
def test_home_a_missing_cross_flow():
    truth = load_vessel("gunnerus-33.9")
    here = world(truth, truth.with_values({"hull.crossflow.off": True}), known=True)
    assert here.removed(fitted(LearnedForce(trials=1, ridge=1e-5), here)) > 0.8


@pytest.mark.parametrize("name", ["gunnerus-33.9", "gunnerus-28.9-6dof", "kvlcc2-l7"])
def test_the_mass_is_what_unit_forces_feel_in_one_step(name):
    """Against the equations of motion: a force of 1 kN and 1 kN m for one Euler step of 1 s, from rest."""
    vessel = load_vessel(name)
    model = vessel_dynamics(vessel)
    rows = [vessel.axes.index(axis) for axis in (0, 1, 5)]
    forces = np.zeros((1, 4, len(vessel.axes)))
    forces[0, range(3), rows] = 1e3
    zeros = {kind: {key: np.zeros(4) for key in getattr(model, kind)} for kind in ("state", "commands", "environment")}
    begun = zeros["state"], zeros["commands"], zeros["environment"]
    after = rollout(vessel, *begun, step=1.0, num_steps=1, tau_extra=forces, engine="casadi")
    moved = np.stack([after[motion][-1, 0] for motion in ("u", "v", "r")])
    np.testing.assert_allclose(horizontal_mass(vessel) @ (moved[:, :3] - moved[:, 3:]), 1e3 * np.eye(3), atol=1e-4)
