"""The native engine: operations, groups and remainders, its cache, and what it says where it cannot work."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.engine import native
from shipid.engine.integrate import RolloutBatch, RolloutJob
from shipid.engine.native import NOTED, compiler_target, find_compiler, measure_native, run_native
from shipid.engine.rollout import prepare_batch, rollout, rollout_distances
from shipid.engine.vectors import CompilerTarget
from shipid.errors import ShipidError
from shipid.metrics import position_error, tally_errors
from shipid.vessel import dynamics as module
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.engine.conftest import QUICK
from tests.engine.operations import operations

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
SHIP = load_vessel("gunnerus-28.9")


@pytest.fixture(autouse=True)
def no_other_cache(libraries_kept: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A cache for tests alone, so that a library is compiled once; `empty_cache` is empty at first."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(libraries_kept))
    monkeypatch.setattr(native, "_refused", [])
    native._compile_rollout.cache_clear()
    yield
    native._compile_rollout.cache_clear()


@pytest.fixture
def empty_cache(no_other_cache: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:  # noqa: ARG001
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(native, "OPTIONS", QUICK)
    return tmp_path / "cache" / "shipid"


@pytest.mark.parametrize("wanted", ["here", "one lane at a time"])
def test_every_operation_has_casadis_value(wanted: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step of 1 s from rates that are the operations; with vector functions, and without."""
    if wanted != "here":
        monkeypatch.setattr(native, "compiler_target", lambda *_: CompilerTarget(2))
    x, p = ca.SX.sym("state", 6), ca.SX.sym("parameters", len(SHIP.parameters))
    values, model = operations(x[0], x[1], p[0] / 4e5), vessel_dynamics(SHIP)
    sizes = [("memory", 0), ("commands", 4), ("environment", 2)]
    middle = [ca.SX.sym(name, size) for name, size in sizes]
    tau = ca.SX.sym("tau_extra", 3)
    names = [*module.INPUTS, "tau_extra"]
    rng = np.random.default_rng(0)
    start = rng.uniform(-2, 2, (6, 21))
    start[0, :2] = start[1, :2]
    parameters = np.array([list(SHIP.parameters.values())])
    batch = RolloutBatch(
        start, np.zeros((0, 21)), np.zeros((1, 4, 21)), np.zeros((1, 2, 21)), np.zeros((1, 3, 21)), parameters
    )
    for first in range(0, len(values), 6):
        part = ca.vertcat(*(values[first : first + 6] + [ca.SX(0)] * 6)[:6])
        rates = ca.Function("rates", [x, *middle, p, tau], [ca.densify(part)], names, ["rates"])
        states, _ = run_native(replace(model, rates=rates), batch, RolloutJob(1.0, 1, "euler", 1, tuple(range(6))))
        expected = np.hstack(
            [np.array(rates(start[:, k], [], [0] * 4, [0] * 2, parameters[0], [0] * 3)) for k in range(21)]
        )
        np.testing.assert_allclose(states[1, 0].T - start, expected, rtol=1e-12, atol=1e-13, err_msg=str(first))


@pytest.mark.parametrize("count", [1, 7, 8, 9, 70])
def test_groups_and_remainders(count: int, draw_inputs: Callable[..., Any]) -> None:
    """A sample's numbers do not depend on who shares its vector or its thread."""
    given = draw_inputs(SHIP, 70)
    options: dict[str, Any] = {"step": 1.0, "num_steps": 5, "engine": "native"}
    whole = rollout(SHIP, **given, **options).states
    part = {group: {name: values[:count] for name, values in columns.items()} for group, columns in given.items()}
    np.testing.assert_array_equal(rollout(SHIP, **part, **options).states, whole[:, :, :count])


def test_a_library_is_made_once(empty_cache: Path, draw_inputs: Callable[..., Any]) -> None:
    """Another variant, size or number of steps needs no compilation; another step or method does."""

    def run(step: float, method: Any, count: int) -> None:
        rollout(SHIP, **draw_inputs(SHIP, count), step=step, num_steps=4, method=method, engine="native")
        native._compile_rollout.cache_clear()  # as a new process would find it

    run(1.0, "euler", 3)
    (made,) = empty_cache.iterdir()
    before = made.stat().st_mtime_ns
    run(1.0, "euler", 30)
    assert [entry.stat().st_mtime_ns for entry in empty_cache.iterdir()] == [before]
    run(0.5, "euler", 3)
    run(1.0, "rk4", 3)
    assert len(list(empty_cache.iterdir())) == 3


@pytest.mark.usefixtures("empty_cache")
def test_without_a_compiler_it_says_so(monkeypatch: pytest.MonkeyPatch, draw_inputs: Callable[..., Any]) -> None:
    monkeypatch.setattr(native, "find_compiler", lambda: None)
    with pytest.raises(ShipidError, match=r"install gcc\), or use engine 'torch'"):
        rollout(SHIP, **draw_inputs(SHIP, 2), step=1.0, num_steps=2, engine="native")


@pytest.mark.usefixtures("empty_cache")
def test_a_compiler_that_fails_is_one_line(monkeypatch: pytest.MonkeyPatch, draw_inputs: Callable[..., Any]) -> None:
    monkeypatch.setattr(
        native, "compiler_target", lambda *_: replace(compiler_target(), flags=("-mno-such-processor",))
    )
    with pytest.raises(ShipidError, match=r"the C compiler .* failed \(.*no-such-processor"):
        rollout(SHIP, **draw_inputs(SHIP, 2), step=1.0, num_steps=2, engine="native")


@pytest.mark.parametrize("count", [1, 7, 8, 9, 70])
@pytest.mark.parametrize("num_variants", [1, 3])
def test_distances_are_those_of_the_paths(count: int, num_variants: int, draw_inputs: Callable[..., Any]) -> None:
    """Summed and tallied on the way, in vectors with filling that must not be counted."""
    given = draw_inputs(SHIP, count)
    rng = np.random.default_rng(0)
    goal = rng.uniform(-9, 9, (5, count, 2))
    parameters = np.array(list(SHIP.parameters.values())) * rng.uniform(0.9, 1.1, (num_variants, 1))
    options: dict[str, Any] = {"step": 1.0, "parameters": parameters}
    paths = rollout(SHIP, **given, num_steps=5, keep=("north", "east"), engine="casadi", **options)
    expected = [position_error(paths.states[1:, variant], goal) for variant in range(num_variants)]
    for engine in ("native", "casadi"):
        measured = rollout_distances(SHIP, goal=goal, **given, engine=engine, **options)  # type: ignore[arg-type]
        np.testing.assert_allclose(measured.total, [variant.sum(axis=0) for variant in expected], rtol=1e-12)
        np.testing.assert_array_equal(measured.tally, [tally_errors(variant) for variant in expected])
        assert not measured.diverged.any()


@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("count", [5, 67])
def test_distances_of_a_long_rollout_are_all_counted(count: int, every: int, draw_inputs: Callable[..., Any]) -> None:
    """More than are noted at a time, also where a record is not every step and a start is no number."""
    given = draw_inputs(SHIP, count)
    given["start"]["u"][-1] = np.nan
    steps = every * (NOTED + 9)
    model, batch = prepare_batch(SHIP, **given, components={}, num_steps=steps, parameters=None, memory=None,
                            tau_extra=None, helmsman=None)  # fmt: skip
    job = RolloutJob(0.5, steps, "euler", every, (model.state.index("north"), model.state.index("east")))
    goal = np.random.default_rng(0).uniform(-90, 90, (steps // every, 2, count))
    records, worst = run_native(model, batch, job)
    total, counts, fastest = measure_native(model, batch, job, goal)
    apart = np.hypot(*(records[1:, 0] - goal.transpose(0, 2, 1)).transpose(2, 0, 1))
    np.testing.assert_allclose(total[0], apart.sum(axis=0), rtol=1e-12)
    np.testing.assert_array_equal(fastest, worst)
    assert np.isnan(total[0, -1])
    assert counts[0].sum() == apart.size
    assert np.abs(counts[0].astype(int) - tally_errors(apart)).sum() <= 2  # a distance may be rounded into the next bin


@pytest.mark.parametrize("name", ["gunnerus-28.9", "kvlcc2-l7", "esso-190k"])
def test_single_precision_follows_double(name: str, draw_inputs: Callable[..., Any]) -> None:
    """Paths from the origin to a part in ten thousand, distances to a part in a hundred thousand."""
    vessel = load_vessel(name)
    given = {**draw_inputs(vessel, 37), "step": 1.0}
    given["start"] = {**given["start"], "north": np.zeros(37), "east": np.zeros(37)}
    double, single = (rollout(vessel, **given, num_steps=20, engine=engine) for engine in ("native", "single"))
    path = double.states[:, 0, :, :2]
    far = np.abs(path).max()
    assert single.states.dtype == float
    assert np.abs(single.states[:, 0, :, :2] - path).max() < 1e-4 * far
    goal = path[1:] + 0.1 * far
    exact, near = (rollout_distances(vessel, **given, goal=goal, engine=engine) for engine in ("native", "single"))
    np.testing.assert_allclose(near.total, exact.total, rtol=1e-4)
    np.testing.assert_allclose(near.total.sum(), exact.total.sum(), rtol=1e-5)
    assert near.tally.sum() == exact.tally.sum() == 20 * 37
    assert np.array_equal(near.diverged, exact.diverged)


def test_the_engine_of_a_process_is_the_one_that_it_has_by_now() -> None:
    """No compiler is looked for to say so; a model that could not be compiled ends the native engine."""
    native.compiler_target.cache_clear()
    assert native.noted_engine() is None
    assert native.engine_description() == native.noted_engine()
    native.refuse_compiling("the C compiler failed (Killed)")
    assert native.noted_engine() == "casadi"
