"""Gradients of every structure: finite differences are the judge, and all engines that can agree."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from shipid.engine.engines import ENGINES
from shipid.engine.gradient import Gradient, rollout_gradient, squared_distance_loss
from shipid.engine.integrate import Array, Method
from shipid.engine.rollout import rollout
from shipid.errors import ShipidError
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.conftest import WEIGHTS

Draw = Callable[..., dict[str, dict[str, np.ndarray]]]
ABLE = [name for name, engine in ENGINES.items() if engine.gradient is not None and engine.available()]
SHIP = load_vessel("gunnerus-28.9").with_values({"hull.learned": WEIGHTS})
STEPS, SAMPLES, KEEP = 4, 5, ("north", "east", "u", "r")
RNG = np.random.default_rng(5)
GOAL, PUSH = RNG.uniform(-5, 5, (STEPS, SAMPLES, len(KEEP))), RNG.uniform(-2e4, 2e4, (STEPS, SAMPLES, 6))
LOSS = squared_distance_loss(GOAL, np.array([1.0, 1.0, 3.0, 200.0]))


def calm(vessel: Vessel) -> Vessel:
    """The vessel without forces of waves, whose components are drawn."""
    drawn = {f"{term.path}.off": True for term in vessel_dynamics(vessel).drawn}
    return vessel.with_values(drawn) if drawn else vessel


def losses(vessel: Vessel, given: Any, options: dict[str, Any], **changes: Any) -> Array:
    path = rollout(vessel, **given, **{**options, **changes}, keep=KEEP, engine="casadi")
    return np.asarray(LOSS(path.states[:, 0])[0])


def gradient(vessel: Vessel, given: Any, options: dict[str, Any], engine: str, names: Any) -> Gradient:
    return rollout_gradient(vessel, *given.values(), LOSS, **options, keep=KEEP, engine=engine, names=names)


def inputs(vessel: Vessel, draw_inputs: Draw, method: Method) -> tuple[Any, dict[str, Any]]:
    given = draw_inputs(vessel, SAMPLES)
    given = {name: given[name] for name in ("start", "commands", "environment")}
    num_dof = len(vessel.axes)
    return given, {"step": 0.5, "num_steps": STEPS, "method": method, "tau_extra": PUSH[..., :num_dof]}


def close(computed: Array, exact: Array, tolerance: float) -> None:
    np.testing.assert_allclose(computed, exact, rtol=tolerance, atol=tolerance * max(np.abs(exact).max(), 1e-300))


@pytest.mark.slow
def test_engines_agree_on_every_structure(vessel: Vessel, draw_inputs: Draw) -> None:
    """By RK4, whose sweep is the longer one; slopes are compared for one and the same relative change of numbers."""
    ship = calm(vessel)
    names = tuple(ship.parameters)[::3]
    scale = np.array([abs(ship.parameters[name]) or 1.0 for name in names])
    given, options = inputs(ship, draw_inputs, "rk4")
    first, *others = (gradient(ship, given, options, engine, names) for engine in ABLE)
    np.testing.assert_allclose(first.loss, losses(ship, given, options), rtol=1e-9)
    assert not first.diverged.any()
    for other in others:
        np.testing.assert_allclose(other.path, first.path, rtol=1e-9, atol=1e-9)
        close(other.tau_extra, first.tau_extra, 1e-9)
        close(other.parameters * scale, first.parameters * scale, 1e-9)
        for name, slope in first.start.items():
            close(other.start[name], slope, 1e-9)


@pytest.mark.parametrize("engine", ABLE)
@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_parameters_by_finite_differences(draw_inputs: Draw, method: Method, engine: str) -> None:
    """All numbers of a ship with a network, those of a lagged actuator included."""
    lag = {"n": {"kind": "first_order", "T": 1.0, "rate": 9.0}, "alpha": {"kind": "first_order", "T": 0.5, "rate": 9.0}}
    ship = SHIP.with_values({"thruster.port.actuator": lag})
    given, options = inputs(ship, draw_inputs, method)
    options["memory"] = {name: np.full(SAMPLES, 0.9) for name in vessel_dynamics(ship).memory}
    gradients = gradient(ship, given, options, engine, tuple(ship.parameters))
    values = np.array(list(ship.parameters.values()))
    widths = 1e-6 * np.maximum(np.abs(values), 1e-2)
    ends = values + np.concatenate([np.diag(widths), -np.diag(widths)])
    path = rollout(ship, **given, **options, parameters=ends, keep=KEEP, engine="casadi")
    ahead, behind = np.split(np.stack([LOSS(path.states[:, v])[0] for v in range(len(ends))], axis=1), 2, axis=1)
    slopes, noise = (ahead - behind) / (2 * widths), 1e-14 * gradients.loss.max() / widths
    weights = [name.startswith(("hull.learned", "thruster.port.actuator")) for name in ship.parameters]
    assert (np.abs(gradients.parameters[:, weights]).max(axis=0) > 0).mean() > 0.9
    for column, name in enumerate(ship.parameters):
        scale = 2e-5 * np.abs(slopes[:, column]).max() + 10 * noise[column]
        np.testing.assert_allclose(gradients.parameters[:, column], slopes[:, column], rtol=0, atol=scale, err_msg=name)


@pytest.mark.parametrize("engine", ABLE)
@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_force_and_start_by_finite_differences(draw_inputs: Draw, method: Method, engine: str) -> None:
    given, options = inputs(SHIP, draw_inputs, method)
    gradients = gradient(SHIP, given, options, engine, ())
    assert gradients.parameters.shape == (SAMPLES, 0)
    for step in range(STEPS):
        for axis in range(3):
            push = np.zeros((STEPS, SAMPLES, 3))
            push[step, :, axis] = 10.0 ** (1 + axis)
            ends = [losses(SHIP, given, options, tau_extra=options["tau_extra"] + sign * push) for sign in (1, -1)]
            close(gradients.tau_extra[step, :, axis], (ends[0] - ends[1]) / (2 * push[step, :, axis]), 1e-5)
    for name, slope in gradients.start.items():
        ends = [
            losses(SHIP, {**given, "start": given["start"] | {name: given["start"][name] + h}}, options)
            for h in (1e-5, -1e-5)
        ]
        close(slope, (ends[0] - ends[1]) / 2e-5, 1e-5)


@pytest.mark.parametrize("engine", ABLE)
def test_a_diverged_sample_is_named_and_harms_no_other(draw_inputs: Draw, engine: str) -> None:
    given, options = inputs(SHIP, draw_inputs, "euler")
    names = tuple(SHIP.parameters)
    sound = gradient(SHIP, given, options, engine, names)
    given["start"] = given["start"] | {"u": np.where(np.arange(SAMPLES) == 1, np.nan, given["start"]["u"])}
    harmed = gradient(SHIP, given, options, engine, names)
    assert harmed.diverged.tolist() == [False, True, False, False, False]
    others = [0, 2, 3, 4]
    np.testing.assert_allclose(harmed.parameters[others], sound.parameters[others], rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"engine": "casadi"}, "no gradient: use 'native' or 'torch'"),
        ({"names": ("hull.learned.w_u.9",)}, r"'hull\.learned\.w_u\.9' is not known.*hull\.learned\.w_u"),
        ({"keep": ("north", "depth")}, "'depth' is not known"),
        ({"loss": lambda path: (path.sum(), path)}, r"shapes \(5,\) and \(5, 5, 4\), not \(\) and"),
    ],
)
def test_what_cannot_be_is_refused(draw_inputs: Draw, changes: dict[str, Any], message: str) -> None:
    given, options = inputs(SHIP, draw_inputs, "euler")
    with pytest.raises(ShipidError, match=message):
        rollout_gradient(SHIP, **{**given, **options, "loss": LOSS, "keep": KEEP, "engine": "torch", **changes})
