"""Rollouts of every vessel: laws of the path, order of the integrators, what comes in and what is refused."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.engine.integrate import Method
from shipid.engine.native import find_compiler
from shipid.engine.rollout import rollout, rollout_distances
from shipid.errors import DataError, ShipidError
from shipid.interrupts import hold_interrupts
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.conftest import OF_LAWS, pace

Draw = Callable[..., dict[str, dict[str, np.ndarray]]]
LAG = {"kind": "first_order", "T": 2.0, "rate": 1e3}


def zeros(names: tuple[str, ...], num_samples: int = 1) -> dict[str, np.ndarray]:
    return {name: np.zeros(num_samples) for name in names}


@pytest.mark.parametrize(("value", "said"), [(20.0, "rudder.delta reaches 20 rad: was deg meant?"), (0.35, "")])
def test_an_order_in_another_unit_is_said(value: float, said: str, caplog: pytest.LogCaptureFixture) -> None:
    ship = load_vessel("mariner")
    names = vessel_dynamics(ship)
    rollout(
        ship,
        {**zeros(names.state), "u": np.array([7.0])},
        {**zeros(names.commands), "rudder.delta": np.array([value])},
        step=0.5,
        num_steps=2,
    )
    assert said in caplog.text
    assert bool(said) == bool(caplog.text)


def test_turning_the_chart_turns_the_path(vessel: Vessel, draw_inputs: Draw) -> None:
    """Frame invariance: heading, start, wind and current turned by an angle give the same path, turned."""
    angle, given = 1.234, draw_inputs(vessel, 4)
    turned = {group: dict(values) for group, values in given.items()}
    north, east = given["start"]["north"], given["start"]["east"]
    turned["start"]["north"] = north * np.cos(angle) - east * np.sin(angle)
    turned["start"]["east"] = north * np.sin(angle) + east * np.cos(angle)
    turned["start"]["psi"] = given["start"]["psi"] + angle
    for name in ("beta_w", "beta_c"):
        if name in turned["environment"]:
            turned["environment"][name] = given["environment"][name] + angle
    first, second = (rollout(vessel, **inputs, step=0.5, num_steps=20) for inputs in (given, turned))
    north, east = first["north"], first["east"]
    np.testing.assert_allclose(second["north"], north * np.cos(angle) - east * np.sin(angle), atol=1e-8)
    np.testing.assert_allclose(second["east"], north * np.sin(angle) + east * np.cos(angle), atol=1e-8)
    np.testing.assert_allclose(second["psi"], first["psi"] + angle, atol=1e-10)
    for name in ("u", "v", "r"):
        np.testing.assert_allclose(second[name], first[name], atol=1e-10)
    assert not first.diverged.any()


@pytest.mark.parametrize("bundled_vessel", OF_LAWS, indirect=True)
def test_mirroring_the_manoeuvre_mirrors_the_path(bundled_vessel: Vessel) -> None:
    """Of a ship whose screw, if there is but one, works alike on both sides."""
    values = bundled_vessel.parameters
    alike = {path: values[path.removesuffix("_minus") + "_plus"] for path in values if path.endswith("_minus")}
    vessel = bundled_vessel.with_values(alike)
    model = vessel_dynamics(vessel)
    start = zeros(model.state, 2) | {"u": np.full(2, 4.0)}
    angle = np.array([0.5, -0.5])
    commands = {name: np.full(2, 2.5) if name.endswith(".n") else angle for name in model.commands}
    weather = {"V_w": np.full(2, 6.0), "beta_w": np.array([0.8, -0.8])}
    environment = {name: weather[name] for name in model.environment}
    motion = rollout(vessel, start, commands, environment, step=0.1, num_steps=500, method="rk4")
    for name, sign in (("north", 1), ("east", -1), ("psi", -1), ("u", 1), ("v", -1), ("r", -1)):
        np.testing.assert_allclose(motion[name][..., 1], sign * motion[name][..., 0], rtol=1e-9, atol=1e-9)
    to_starboard = 1 if "rudder.delta" in commands else -1  # delta > 0 turns there, alpha > 0 to port
    assert to_starboard * motion["psi"][-1, 0, 0] > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("bundled_vessel", OF_LAWS, indirect=True)
def test_without_thrust_a_ship_slows_down(bundled_vessel: Vessel) -> None:
    """From anywhere in the envelope with u >= 0, shafts stopped, no wind: no start gains, all fade within 10 minutes.

    Not from step to step: once a ship has come to drift astern, a polynomial hull may gain a little for a while.
    """
    if "abkowitz" in bundled_vessel.document["hull"]:
        pytest.skip("a polynomial about one speed says nothing of a ship that stops")
    u, v, r = (x.ravel() for x in np.meshgrid([0.5, 3.0, 6.0], [-1.0, 0.2, 1.0], [-0.13, 0.02, 0.13]))
    model = vessel_dynamics(bundled_vessel)
    start = zeros(model.state, len(u)) | {"u": u, "v": v, "r": r}
    held = zeros(model.commands, len(u)), zeros(model.environment, len(u))
    path = rollout(bundled_vessel, start, *held, step=0.5, num_steps=1200, every=120, method="rk4")
    energy = 0.5 * (path["u"] ** 2 + path["v"] ** 2 + 70 * path["r"] ** 2)[:, 0]  # r_66^2 = 70 m^2
    assert not path.diverged.any()
    assert (energy <= energy[0]).all()
    assert (energy[-1] < 0.35 * energy[0]).all()
    assert np.hypot(path["u"], path["v"])[-1].max() < 0.7


def last_state(vessel: Vessel, draw_inputs: Draw, method: Method, step: float, seed: int = 7) -> np.ndarray:
    """State after 8 s of the ordinary ship: smooth, one side of every kink (rates and drift keep their sign)."""
    given, slow = draw_inputs(vessel, 3, seed), pace(vessel)
    given["start"] |= {"u": np.full(3, 3.0 * slow), "v": np.full(3, 0.4 * slow), "r": np.full(3, -0.05)}
    commands = {name: np.full(3, 0.7 if name.endswith("alpha") else 2.0) for name in given["commands"]}
    environment = {name: np.zeros(3) for name in given["environment"]}
    memory = {name: np.full(3, 0.6 if name.endswith("alpha") else 1.5) for name in vessel_dynamics(vessel).memory}
    path = rollout(
        vessel,
        given["start"],
        commands,
        environment,
        step=step * slow,
        num_steps=round(8 / step),
        method=method,
        memory=memory,
    )
    return path.states[-1, 0, :, : 2 * len(vessel.axes)]


def smooth(vessel: Vessel) -> Vessel:
    """The lag without its rate limit, a kink that no order survives, and not shorter than a step resolves."""
    numbers = vessel.parameters.items()
    lags = {path: value for path, value in numbers if ".actuator." in path and path.endswith((".T", ".rate"))}
    limits = {path: 1e3 if path.endswith(".rate") else max(value, 1.0) for path, value in lags.items()}
    calm = {"wind.off": True} if "wind" in vessel.document else {}
    return vessel.with_values({**calm, **limits})


@pytest.mark.parametrize(("method", "order", "step"), [("euler", 1, 0.25), ("rk4", 4, 1.0)])
def test_order_of_the_integrator(vessel: Vessel, draw_inputs: Draw, method: Method, order: int, step: float) -> None:
    """Halving the step divides the error by 2^order, also with lagged actuators and held commands."""
    calm = smooth(vessel)
    exact = last_state(calm, draw_inputs, "rk4", 1 / 32)
    errors = [np.abs(last_state(calm, draw_inputs, method, step / 2**k) - exact).max(axis=1) for k in range(3)]
    orders = np.median(np.log2(np.array(errors[:-1]) / errors[1:]), axis=1)  # a sample may meet a kink
    assert np.abs(orders - order).min() < 0.35
    assert orders[-1] == pytest.approx(order, abs=0.5)


@pytest.mark.parametrize("engine", ["casadi", "torch"])
def test_commands_act_from_step_to_step(draw_inputs: Draw, engine: Any) -> None:
    """A horizon in one piece equals two pieces joined by hand, commands changing in between."""
    vessel = load_vessel("gunnerus-28.9").with_values({"thruster.port.actuator.n": LAG})
    first, second = draw_inputs(vessel, 3, seed=1), draw_inputs(vessel, 3, seed=2)
    options: dict[str, Any] = {"step": 0.5, "engine": engine}
    one = rollout(vessel, **first, num_steps=6, **options)
    joined = {name: one[name][-1, 0] for name in vessel_dynamics(vessel).state}
    two = rollout(
        vessel,
        joined,
        second["commands"],
        first["environment"],
        memory={"port.n": one["actual.port.n"][-1, 0]},
        num_steps=4,
        **options,
    )
    changing = {
        n: np.vstack([np.tile(first["commands"][n], (6, 1)), np.tile(second["commands"][n], (4, 1))])
        for n in first["commands"]
    }
    whole = rollout(vessel, first["start"], changing, first["environment"], num_steps=10, **options)
    np.testing.assert_allclose(whole.states[6:], two.states, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(whole.states[:7], one.states, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("engine", ["casadi", "torch"])
@pytest.mark.parametrize("shape", ["sample", "held", "steps"])
def test_extra_force_enters_as_force(engine: Any, shape: str) -> None:
    """At rest one small Euler step gives tau / M dt: surge mass 410,931.81 + 79,320.5895 kg."""
    vessel = load_vessel("gunnerus-28.9").with_values({"wind.off": True})
    tau = {"sample": np.array([5e3, 0, 0]), "held": np.tile([5e3, 0, 0], (2, 1)), "steps": np.zeros((3, 2, 3))}[shape]
    if shape == "steps":
        tau[1, :, 0] = 5e3
    model = vessel_dynamics(vessel)
    start, commands = zeros(model.state, 2), zeros(model.commands, 2)
    path = rollout(vessel, start, commands, step=1e-3, num_steps=3, tau_extra=tau, engine=engine)
    gained = 5e3 / (410931.81 + 79320.5895) * 1e-3
    expected = {"steps": [0, 0, 1, 1]}.get(shape, [0, 1, 2, 3])
    np.testing.assert_allclose(path["u"][:, 0, 1], gained * np.array(expected), rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize("engine", ["native", "single", "casadi", "torch"])
@pytest.mark.parametrize(
    "where", ["start", "memory", "commands", "late command", "environment", "tau", "parameters", "drawn"]
)
def test_an_input_that_is_no_number_is_reported_though_a_limit_hides_it(
    draw_inputs: Draw, engine: Any, where: str
) -> None:
    """Its samples alone, in paths and in distances; the last sample shares no vector with the first."""
    if engine in ("native", "single") and find_compiler() is None:
        pytest.skip("no C compiler on this machine")
    limits = {f"thruster.port.actuator.{name}": {**LAG, "low": -3.0, "high": 3.0} for name in ("n", "alpha")}
    vessel = load_vessel("gunnerus-28.9-6dof" if where == "drawn" else "gunnerus-28.9").with_values(limits)
    count = 18
    given: dict[str, Any] = draw_inputs(vessel, count)
    wrong = np.where(np.isin(np.arange(count), (3, 17)), np.nan, 0.0)
    further: dict[str, Any] = {"memory": {f"port.{name}": np.full(count, 0.5) for name in ("n", "alpha")}}
    bad = np.isnan(wrong)[None]
    if where in ("start", "commands", "environment"):
        name = {"start": "u", "commands": "port.n", "environment": "V_w"}[where]
        given[where] = {**given[where], name: given[where][name] + wrong}
    elif where == "late command":
        held = np.tile(given["commands"]["port.n"], (4, 1))
        held[3] += wrong
        given["commands"] = {**given["commands"], "port.n": held}
    elif where == "memory":
        further["memory"]["port.n"] = further["memory"]["port.n"] + wrong
    elif where == "tau":
        further["tau_extra"] = np.tile(wrong[:, None], (1, 3))
    elif where == "parameters":
        values = np.array([list(vessel.parameters.values())] * 2)
        values[1, list(vessel.parameters).index("thruster.port.actuator.n.high")] = np.nan
        further["parameters"], bad = values, np.array([[False], [True]]) & np.ones((2, count), dtype=bool)
    else:
        waves = np.zeros((count, 2, sum(vessel_dynamics(vessel).drawn[0].widths.values())))
        waves[:, 1, 3] += wrong
        further = {"components": {"waves.first_order": waves}}
    path = rollout(vessel, **given, **further, step=0.5, num_steps=4, engine=engine)
    np.testing.assert_array_equal(path.diverged, bad)
    if where not in ("tau", "drawn"):
        measured = rollout_distances(vessel, **given, **further, goal=np.zeros((4, count, 2)), step=0.5, engine=engine)
        np.testing.assert_array_equal(measured.diverged, bad)


@pytest.mark.parametrize("group", ["start", "commands", "environment"])
def test_a_missing_channel_is_named(bundled_vessel: Vessel, draw_inputs: Draw, group: str) -> None:
    given = draw_inputs(bundled_vessel, 2)
    if not given[group]:
        pytest.skip("needs none")
    name = {"start": "psi", "commands": list(given["commands"])[-1], "environment": "beta_w"}[group]
    given[group][name + "_"] = given[group].pop(name)
    with pytest.raises(DataError, match=f"{name!r} is needed") as caught:
        rollout(bundled_vessel, **given, step=1.0, num_steps=2)
    assert bundled_vessel.name in str(caught.value)


def test_an_interrupt_waits_for_casadi_and_is_not_lost() -> None:
    reached = False
    before = signal.getsignal(signal.SIGINT)

    def work() -> None:
        nonlocal reached
        with hold_interrupts():
            os.kill(os.getpid(), signal.SIGINT)
            reached = True

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached
    assert signal.getsignal(signal.SIGINT) is before


def marked(vessel: Vessel) -> dict[str, dict[str, np.ndarray]]:
    """Start, commands and environment of two samples, each channel with its own number."""
    model = vessel_dynamics(vessel)
    names = {"start": model.state, "commands": model.commands, "environment": model.environment}
    return {
        group: {name: np.array([1.0, 2.0]) / 8 + number / 64 for number, name in enumerate(channels)}
        for group, channels in names.items()
    }


def test_parameters_with_names_are_taken_by_name() -> None:
    """A frame may have its columns in any order; before, the numbers were taken by place without a word."""
    ship = load_vessel("gunnerus-28.9")
    given = marked(ship)
    turned = dict(reversed((ship.parameters | {"inertia.m": 5e5}).items()))
    right = [turned[path] for path in ship.parameters]
    path = rollout(ship, **given, step=0.5, num_steps=4, parameters=np.array([right, right]), engine="casadi")
    for named in (pd.DataFrame([turned, turned]), pd.Series(turned), turned):
        again = rollout(ship, **given, step=0.5, num_steps=4, parameters=named, engine="casadi")
        np.testing.assert_array_equal(again.states[:, 0], path.states[:, 0])
    for odd, message in (
        ({"inertia.m": 5e5}, "parameters lack '"),
        ({**turned, "inertia.M": 1.0}, r"parameters hold 'inertia\.M', did you mean 'inertia\.m'\?"),
    ):
        with pytest.raises(ShipidError, match=message):
            rollout(ship, **given, step=0.5, num_steps=4, parameters=odd)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"method": "Euler"}, r"method 'Euler' is not known: did you mean 'euler'\?"),
        ({"step": -0.5}, "step must be a number above 0"),
        ({"step": "0.5"}, "step must be a number"),
        ({"num_steps": 4.5}, "num_steps must be a whole number, 1 or more, not 4.5"),
        ({"device": "nope"}, "PyTorch has no such device here: use cpu"),
        ({"device": None}, "PyTorch has no such device here: use cpu"),
        ({"device": "cuda:99"}, "PyTorch has no such device here: use cpu"),
        ({"device": "meta"}, "PyTorch has no such device here: use cpu"),
        ({"components": pd.DataFrame({"waves": [1.0]})}, "whose components are drawn, 'waves' is not known"),
        ({"every": 0}, "every must be a whole number, 1 or more, not 0"),
        ({"tau_extra": 1e5}, r"tau_extra must be \(3,\), \(2, 3\) or \(4, 2, 3\), not \(\)"),
        ({"tau_extra": np.zeros((2, 1))}, r"tau_extra must be .*, not \(2, 1\)"),
        ({"tau_extra": np.zeros((4, 3))}, r"tau_extra must be .*, not \(4, 3\)"),
        ({"components": {"waves": np.zeros((2, 1, 5))}}, "whose components are drawn, 'waves' is not known"),
        ({"parameters": np.zeros((0, 3))}, r"parameters must be \(variants, "),
        ({"start": {"north": 0.0}}, r"state 'north' must be \(S,\), a value for each of S samples, not \(\)"),
        ({"start": {}}, "start holds no state"),
    ],
)
def test_a_wrong_argument_is_one_line(wrong: dict[str, Any], message: str) -> None:
    """Before, an unknown method was rk4, and what is one number or one column was taken for all axes."""
    ship = load_vessel("gunnerus-28.9")
    with pytest.raises(ShipidError, match=message):
        rollout(ship, **{**marked(ship), "step": 0.5, "num_steps": 4, **wrong})


@pytest.mark.parametrize("name", ["bow.n", "port.alhpa"])
def test_a_command_that_the_vessel_does_not_have_is_refused(name: str) -> None:
    """Before, it was passed over without a word."""
    ship = load_vessel("gunnerus-28.9")
    given = marked(ship)
    given["commands"] = {**given["commands"], name: np.zeros(2)}
    with pytest.raises(ShipidError, match=f"commands: .* has no '{name}'"):
        rollout(ship, **given, step=0.5, num_steps=4)
