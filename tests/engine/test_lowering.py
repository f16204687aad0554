"""The lowered step against CasADi: numbers, derivatives, batches, failures, compilations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
import torch

from shipid.engine.native import find_compiler
from shipid.engine.rollout import Method, rollout
from shipid.engine.torch import lower_function
from shipid.simulation.weather import Sea, draw_components, wave_loads
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import Family, draw_members
from tests.conftest import structure
from tests.engine.operations import operations

ENGINES = ["casadi", "torch", *(["native"] if find_compiler() else [])]
Draw = Callable[..., dict[str, dict[str, np.ndarray]]]


def family(vessel: Vessel, count: int) -> np.ndarray:
    scales = ["thruster.*.k_T"] if any(path.endswith(".k_T") for path in vessel.parameters) else []
    rules = [{"parameters": ["hull.*", "inertia.m", *scales], "factor": (0.7, 1.3)}]
    drawn = draw_members(Family(name="f", members=count, perturb=rules), vessel)
    return np.array([variant.parameters for variant in drawn])


@pytest.fixture(autouse=True, scope="module")
def empty_cache(libraries_kept: Path) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(libraries_kept))
        yield


def evaluate(function: ca.Function, inputs: dict[str, np.ndarray]) -> np.ndarray:
    """Lowered function on inputs (channels, batch), parameters the same for all."""
    lowered = lower_function(function)
    names = [function.name_in(i) for i in range(function.n_in())]
    given = [torch.tensor(inputs[name]) for name in names]
    given[names.index("parameters")] = given[names.index("parameters")][:, :1]
    width = next(iter(inputs.values())).shape[1]
    channels = [torch.as_tensor(c, dtype=torch.float64).expand(width) for c in lowered(*given)]
    return torch.stack(channels).numpy() if channels else np.zeros((0, width))


def by_casadi(function: ca.Function, inputs: dict[str, np.ndarray]) -> np.ndarray:
    names = [function.name_in(i) for i in range(function.n_in())]
    width = next(iter(inputs.values())).shape[1]
    return np.hstack([np.array(function(*(inputs[name][:, k] for name in names))) for k in range(width)])


@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_rollout_equals_casadi(vessel: Vessel, draw_inputs: Draw, method: Method) -> None:
    """The whole rollout, three variants, time-varying commands, a sea: to 1e-12 of each channel's size a step."""
    given = draw_inputs(vessel, 5)
    given["commands"] = {name: np.tile(value, (6, 1)) for name, value in given["commands"].items()}
    for value in given["commands"].values():
        value[3:] *= 0.5
    tau = np.random.default_rng(0).normal(size=(5, len(vessel.axes))) * 1e3
    options: dict[str, Any] = {"step": 0.5, "num_steps": 6, "method": method, "tau_extra": tau}
    options["parameters"] = family(vessel, 3)
    drawn = draw_components(Sea(H_s=1.0, T_p=5.0, components=7), np.linspace(0, 6, 5), range(5))
    options["components"] = wave_loads(vessel, drawn)
    compiled = method == "rk4" or vessel is structure("gunnerus-28.9")  # a compilation takes most of the time
    engines = ENGINES if compiled else [engine for engine in ENGINES if engine != "native"]
    one, *others = (rollout(vessel, **given, **options, engine=engine) for engine in engines)  # type: ignore[arg-type]
    scale = np.abs(one.states).max(axis=(0, 1, 2)) + 1e-3
    for other in others:
        assert np.abs((other.states - one.states) / scale).max() < 1e-12
        np.testing.assert_array_equal(other.diverged, one.diverged)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_diverged_member_spoils_no_other(draw_inputs: Draw, engine: Any) -> None:
    vessel = load_vessel("gunnerus-28.9")
    given, parameters = draw_inputs(vessel, 4), family(vessel, 3)
    options: dict[str, Any] = {"step": 1.0, "num_steps": 30, "engine": engine}
    sound = rollout(vessel, **given, **options, parameters=parameters)
    assert not sound.diverged.any()
    names = list(vessel.parameters)
    spoilt = parameters.copy()
    spoilt[1, names.index("hull.derivatives.X_u|u|")] = 1e9  # drives, and how
    given["start"]["v"] = given["start"]["v"].copy()
    given["start"]["v"][2] = np.nan
    path = rollout(vessel, **given, **options, parameters=spoilt)
    expected = np.zeros((3, 4), dtype=bool)
    expected[1], expected[:, 2] = True, True
    np.testing.assert_array_equal(path.diverged, expected)
    keep = ~expected
    np.testing.assert_allclose(path.states[:, keep], sound.states[:, keep], rtol=1e-12)


def test_every_printed_operation_has_casadis_value() -> None:
    x, p = ca.SX.sym("x", 2), ca.SX.sym("parameters", 2)
    function = ca.Function("f", [x, p], [ca.vertcat(*operations(x[0], x[1], p[0]))], ["x", "parameters"], ["y"])
    rng = np.random.default_rng(0)
    inputs = {"x": rng.uniform(-2, 2, (2, 50)), "parameters": np.tile([[0.7], [0.1]], (1, 50))}
    np.testing.assert_allclose(evaluate(function, inputs), by_casadi(function, inputs), rtol=1e-14, atol=1e-15)
