"""The observer: laws of its equations, causality, missing samples, and what it buys in seeded worlds."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import casadi as ca
import numpy as np
import pandas as pd
import pytest
from casadi import SX
from scipy.linalg import expm

from shipid.data.dataset import Dataset, write_dataset
from shipid.data.windows import Instants, Windows, cut_windows, from_frame
from shipid.engine import samples
from shipid.engine.native import find_compiler
from shipid.engine.rollout import rollout
from shipid.errors import DataError, DocumentError
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.physics import Physics
from shipid.metrics import position_error
from shipid.observer import (
    AGE_COLUMN,
    ESTIMATE_COLUMNS,
    FILTER_NUMBERS,
    FILTER_STATES,
    MEASURED_MOTION,
    NUM_LOW_STATES,
    Estimates,
    Observer,
    _covariance_growth,
    _low_rates,
    _wave_transition,
    estimates_at_windows,
    filter_bank,
    filter_function,
    first_filter_states,
    observed_start,
    observer_function,
    run_observer,
    tune_observer,
)
from shipid.predictor import Predictor
from shipid.study.prepare import at_instants, window_memory
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.benchmarks.observer import World, errors, physics, world
from tests.conftest import structure
from tests.hybrid.runs import made
from tests.study.test_commands import weaving


@cache
def sea() -> World:
    return world("gunnerus-28.9-6dof", 15, runs=6, duration=180.0, waves=True, current=True, changing=True)


@cache
def calm() -> World:
    return world("gunnerus-28.9-6dof", 16, runs=6, duration=180.0, waves=False, current=False, changing=True)


def test_moving_water_gives_the_equations_of_the_current_block() -> None:
    vessel = load_vessel("gunnerus-28.9").with_values({"current.kind": "uniform"})
    model, rng = vessel_dynamics(vessel), np.random.default_rng(1)
    low, orders = SX.sym("low", NUM_LOW_STATES), SX.sym("orders", len(model.commands))
    weather, values = SX.sym("weather", len(model.environment)), SX(list(vessel.parameters.values()))
    ours = ca.Function("f", [low, orders, weather], [_low_rates(model, low, SX(0, 1), orders, weather, values)])
    for _ in range(5):
        motion = rng.uniform([-9, -9, -3, 0, -1, -0.1], [9, 9, 3, 5, 1, 0.1])
        speed, towards = rng.uniform(0.1, 1.0), rng.uniform(0, 6)
        given = {"V_w": 0.0, "beta_w": 0.0, "V_c": speed, "beta_c": towards}
        felt = [given[name] for name in model.environment]
        orders_now = rng.uniform(0.5, 2.0, len(model.commands))
        full = model.rates(motion, [], orders_now, felt, list(vessel.parameters.values()), np.zeros(3))
        known = [*motion, 0, 0, 0, speed * np.cos(towards), speed * np.sin(towards)]
        still = [0.0 for _ in model.environment]
        np.testing.assert_allclose(np.array(ours(known, orders_now, still))[:6], np.array(full), rtol=1e-4, atol=1e-5)


def test_one_step_is_finite_and_leaves_a_covariance(bundled_vessel: Vessel) -> None:
    model = vessel_dynamics(bundled_vessel)
    if model.num_dof != 3:
        with pytest.raises(DocumentError, match="observer takes 3"):
            filter_bank(bundled_vessel)
        return
    filters = filter_bank(bundled_vessel)
    count, n = filters.num_filters, len(FILTER_STATES)
    orders = np.full(len(model.commands), 0.3)
    for measured in (np.zeros(6), np.full(6, np.nan), np.array([0, np.nan, 0.1, 1.0, 0.0, np.nan])):
        states = first_filter_states(filters, measured, orders)
        for _ in range(5):
            values = np.array(list(bundled_vessel.parameters.values()))
            weather = np.zeros(len(model.environment))
            inputs = states, orders, weather, values, measured, filters.noise, filters.numbers.T, 0.5
            outputs = observer_function(model, count)(*inputs)
            states = np.array(outputs[0])
            assert np.isfinite(states).all()
        for column in states.T:
            covariance = column[n : n + n * n].reshape(n, n)
            np.testing.assert_allclose(covariance, covariance.T)
            scale = np.sqrt(np.diag(covariance)) + 1e-30
            assert np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() > -1e-6
        assert np.array(outputs[4]).sum() == pytest.approx(1.0)


def test_it_never_looks_ahead() -> None:
    frame, vessel = calm().data.frame, load_vessel("gunnerus-28.9")
    run = frame[frame["run"] == "M000"].iloc[:40].reset_index(drop=True)
    changed = run.copy()
    changed.loc[25:, ["u", "v", "r", "north", "port.alpha"]] += 0.3
    one, other = (run_observer(vessel, Dataset(rows, calm().data.metadata)).columns for rows in (run, changed))
    for name, values in one.items():
        np.testing.assert_array_equal(values[:25], other[name][:25], err_msg=name)
    assert np.abs(one["observer.u"][25:] - other["observer.u"][25:]).max() > 0.01


def test_an_order_and_wind_act_from_their_row_on() -> None:
    """What is known at a row comes from those in force before it; the new ones move the ship after it."""
    frame, vessel = calm().data.frame, load_vessel("gunnerus-28.9")
    run = frame[frame["run"] == "M000"].iloc[:30].reset_index(drop=True)
    one = run_observer(vessel, Dataset(run, calm().data.metadata)).columns
    for change in ({"port.alpha": 0.3}, {"V_w": 5.0}):
        changed = run.copy()
        for name, more in change.items():
            changed.loc[25:, name] += more
        other = run_observer(vessel, Dataset(changed, calm().data.metadata)).columns
        moved = np.any([np.abs(one[name] - other[name]) > 1e-9 for name in one], axis=0)
        assert np.flatnonzero(moved)[0] == 26, change


@pytest.mark.parametrize(
    ("change", "moved"),
    [
        ({"force": 2.0}, {"a_u": 2.0, "a_v": 2.0}),
        ({"moment": 2.0}, {"a_r": 2.0}),
        ({"model_error": 2.0}, {"q_u": 2.0, "q_v": 2.0, "q_r": 2.0}),
        ({"jump": 2.0, "settle": 3.0, "memory": 5.0}, {"jump": 2.0, "settle": 3.0, "memory": 5.0}),
        ({"current": 2.0}, {"current": 2.0, "current_north": 2.0, "current_east": 2.0}),
        ({"period": 2.0}, {"omega": 0.5, "x_w": 2.0, "y_w": 2.0, "psi_w": 2.0}),
        ({"damping": 1.5}, {"zeta": 1.5}),
    ],
)
def test_a_setting_scales_what_it_names_and_nothing_else(change: dict[str, float], moved: dict[str, float]) -> None:
    vessel, plain = load_vessel("gunnerus-28.9"), Observer()
    other = Observer(**{name: factor * getattr(plain, name) for name, factor in change.items()})
    before, after = filter_bank(vessel, plain), filter_bank(vessel, other)
    for names, one, two in (
        (FILTER_NUMBERS, before.numbers, after.numbers),
        (FILTER_STATES, before.first, after.first),
    ):
        np.testing.assert_allclose(two, one * [moved.get(name, 1.0) for name in names], rtol=1e-12)


@pytest.mark.parametrize("dt", [0.1, 0.8])
def test_waves_are_the_oscillator_and_stay_as_high_as_they_are(dt: float) -> None:
    """xi'' + 2 zeta omega xi' + omega^2 xi = noise; steady velocities have the spread of the numbers."""
    number = dict(
        zip(FILTER_NUMBERS, ca.vertsplit(ca.DM(filter_bank(load_vessel("gunnerus-28.9")).numbers[-1])), strict=True)
    )
    omega, zeta = float(number["omega"]), float(number["zeta"])
    transition, noise = (
        np.array(ca.evalf(part)) for part in _wave_transition({k: SX(v) for k, v in number.items()}, SX(dt))
    )
    rate = np.kron([[0, 1], [-(omega**2), -2 * zeta * omega]], np.eye(3))
    np.testing.assert_allclose(transition, expm(rate * dt), atol=1e-12)
    speeds = np.array([float(number[f"wave_{name}"]) for name in "uvr"])
    steady = np.diag(np.concatenate([speeds / omega, speeds]) ** 2)
    np.testing.assert_allclose(transition @ steady @ transition.T + noise, steady, atol=1e-15)
    assert np.linalg.eigvalsh(noise).min() > 0


def test_two_steps_add_the_uncertainty_of_one_twice_as_long() -> None:
    """White accelerations in axes of the ship: Q(2 dt) = F Q(dt) F^T + Q(dt), F moving the place by the velocities."""
    number = {name: SX(0.1 * (i + 1)) for i, name in enumerate(FILTER_NUMBERS)}
    psi, dt, restless = 0.7, 0.4, SX([0.2, 0.1, 0.3])
    once, twice = (
        np.array(ca.evalf(ca.densify(_covariance_growth(number, SX(psi), restless, SX(k * dt))))) for k in (1, 2)
    )
    c, s = np.cos(psi), np.sin(psi)
    move = np.eye(NUM_LOW_STATES)
    move[:3, 3:6] = dt * np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    np.testing.assert_allclose(twice, move @ once @ move.T + once, atol=1e-12)
    powers = [float(number[f"q_{k}"]) ** 2 + float(number["jump"] * restless[i]) ** 2 for i, k in enumerate("uvr")]
    np.testing.assert_allclose(np.diag(once)[3:6], dt * np.array(powers))


def test_rows_far_apart_make_no_force_of_an_order() -> None:
    """Mariner, rows every 8 s, new orders every 160 s; the truth is without noise, and no force is in it."""
    vessel, step, rows = load_vessel("mariner"), 8.0, 160
    rng, (shaft, helm) = np.random.default_rng(4), vessel_dynamics(vessel).commands
    orders = {shaft: rng.uniform(1.1, 1.4, rows // 20), helm: rng.uniform(-0.4, 0.4, rows // 20)}
    orders = {name: np.repeat(values, 20) for name, values in orders.items()}
    begun = {name: np.zeros(1) for name in vessel_dynamics(vessel).state} | {"u": np.full(1, 6.0)}
    fine = {name: np.repeat(values, 20)[:, None] for name, values in orders.items()}
    path = rollout(vessel, begun, fine, {}, step=step / 20, num_steps=20 * rows, every=20, method="rk4")
    log = pd.DataFrame({name: path[name][:rows, 0, 0] for name in MEASURED_MOTION} | orders)
    log = log.assign(run="a", t=step * np.arange(rows), flags=0)
    seen = run_observer(vessel, Dataset(log, {"clock": "run", "flags": []})).columns
    settled = slice(40, None)
    assert seen["observer.test"][settled].max() < 0.1  # by one step from row to row: 1.4
    assert np.abs(seen["observer.u"] - log["u"])[settled].max() < 0.003  # 0.016 m/s
    assert np.abs(seen["observer.Y"][settled]).max() < 1e-4  # 5e-4 m/s^2


def test_rows_hours_apart_are_refused() -> None:
    rows = calm().data.frame.query("run == 'M000'")
    hourly = Dataset(rows.assign(t=3600.0 * np.arange(len(rows))), calm().data.metadata)
    with pytest.raises(
        DataError, match=r"^t: rows are up to 3.6e\+03 s apart: .* at most 1.03e\+03 s apart; is the unit"
    ):
        run_observer(load_vessel("gunnerus-28.9"), hourly)


def test_runs_together_are_runs_alone() -> None:
    vessel, frame = load_vessel("gunnerus-28.9"), calm().data.frame
    short = frame[(frame["run"] != "M001") | (frame["t"] < 30)]
    short = short[short["t"] < 50].reset_index(drop=True)
    together = run_observer(vessel, Dataset(short, calm().data.metadata)).columns["observer.Y"]
    for run in ("M000", "M001"):
        rows = short[short["run"] == run]
        alone = run_observer(vessel, Dataset(rows.reset_index(drop=True), calm().data.metadata)).columns["observer.Y"]
        np.testing.assert_allclose(together[rows.index], alone, rtol=1e-6, atol=1e-12)


@cache
def estimated(name: str, made: Callable[[], World]) -> Estimates:
    """What the observer knows with a vessel's physics: the same whether later orders are known or not."""
    return run_observer(physics((name,))[name], made().data)


WRONG = ["nominal", "moderate-3", "moderate-10", "high-4"]


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("known", [True, False])
def test_in_waves_and_current_half_of_the_avoidable_error_goes(name: str, known: bool) -> None:
    rms = errors(physics((name,))[name], sea(), known=known, estimates=estimated(name, sea))
    assert rms["alone"] - rms["observer"] >= 0.5 * (rms["alone"] - rms["floor"])
    assert rms["observer"] < rms["alone"]


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("known", [True, False])
def test_in_calm_water_it_costs_two_per_cent_at_most(name: str, known: bool) -> None:
    rms = errors(physics((name,))[name], calm(), known=known, estimates=estimated(name, calm))
    assert rms["observer"] <= 1.02 * rms["alone"]


def test_the_force_fades_and_moves_the_ship_as_its_acceleration_says() -> None:
    vessel = load_vessel("gunnerus-28.9")
    filters = filter_bank(vessel)
    columns = {f"observer.{name}": np.array([x]) for name, x in zip("XYN", (0.01, -0.02, 0.001), strict=True)}
    still = dict.fromkeys((*MEASURED_MOTION, "current_north", "current_east"), np.zeros(1))
    columns |= still | {f"observer.{name}": values for name, values in still.items()}
    tau = observed_start(filters, columns, 30, 1.0).tau_extra
    assert tau.shape == (30, 1, 3)
    assert tau[20, 0, 0] / tau[0, 0, 0] == pytest.approx(np.exp(-20.0 / filters.fade))
    model = vessel_dynamics(vessel)
    inputs = [np.zeros(6), [], np.zeros(len(model.commands)), np.zeros(len(model.environment))]
    inputs.append(list(vessel.parameters.values()))
    gained = np.array(model.rates(*inputs, tau[0, 0])) - np.array(model.rates(*inputs, np.zeros(3)))
    now = np.exp(-0.5 / filters.fade) * np.array([0.01, -0.02, 0.001])
    np.testing.assert_allclose(gained[3:, 0], now, rtol=1e-9)


def test_moving_water_carries_the_path_and_the_wind_along() -> None:
    """Galilei: ship, wind and water faster by one velocity make a path that goes with it, under the same force."""
    vessel, rng, count, horizon, step = load_vessel("gunnerus-28.9"), np.random.default_rng(5), 4, 20, 0.5
    water = np.array([[0.5], [-0.8]])
    columns = {name: rng.uniform(0.3, 1.5, count) for name in (*MEASURED_MOTION, *vessel_dynamics(vessel).commands)}
    columns |= {"u": rng.uniform(2, 4, count), "psi": rng.uniform(-3, 3, count), "r": rng.uniform(-0.05, 0.05, count)}
    wind = rng.uniform(-6, 6, (2, count))
    force = {f"observer.{name}": rng.uniform(-1e-3, 1e-3, count) for name in "XYN"}

    def path(flow: np.ndarray) -> np.ndarray:
        c, s = np.cos(columns["psi"]), np.sin(columns["psi"])
        moved = columns | {"u": columns["u"] + c * flow[0] + s * flow[1], "v": columns["v"] + c * flow[1] - s * flow[0]}
        north, east = wind + flow
        moved |= {"V_w": np.hypot(north, east), "beta_w": np.arctan2(east, north)}
        seen = {f"observer.{name}": moved[name] for name in MEASURED_MOTION} | force
        seen |= {f"observer.current_{name}": flow[i] + np.zeros(count) for i, name in enumerate(("north", "east"))}
        paths = Physics(vessel, horizon, step, observer=Observer()).paths(Instants(moved, estimates=seen))
        x, y = np.moveaxis(paths, -1, 0)
        return np.array([c * x - s * y, s * x + c * y])

    ages = step * np.arange(1, horizon + 1)
    carried = np.broadcast_to(water[:, :, None] * ages[:, None], (2, horizon, count))
    np.testing.assert_allclose(path(water) - path(0 * water), carried, atol=1e-9)


@pytest.mark.parametrize("path", ["position", "velocity"])
def test_a_path_starts_where_it_is_compared(path: Literal["position", "velocity"]) -> None:
    """With `velocity` a path starts where the ship is; with `position`, where the observer believes her to be."""
    vessel, rng, count = load_vessel("gunnerus-28.9"), np.random.default_rng(4), 3
    motion = {
        name: rng.uniform(low, low + 0.05, count)
        for name, low in zip(MEASURED_MOTION, (-9, 4, 1, 3, 0, 0), strict=True)
    }
    columns = motion | {name: rng.uniform(0.2, 0.5, count) for name in vessel_dynamics(vessel).commands}
    columns |= {"V_w": np.full(count, 5.0), "beta_w": rng.uniform(0, 6, count)}
    seen = {f"observer.{name}": motion.get(name, 0.0) + rng.normal(0, 1e-4, count) for name in ESTIMATE_COLUMNS}
    seen["observer.north"] = seen["observer.north"] + 2.0
    farther = seen | {"observer.north": seen["observer.north"] + 3.0}
    physics = Physics(vessel, 20, 1.0, observer=Observer(), path=path)
    ours, shifted = (physics.paths(Instants(columns, estimates=known)) for known in (seen, farther))
    moved = np.hypot(*(shifted - ours).T)
    np.testing.assert_allclose(moved, 3.0 if path == "position" else 0.0, atol=1e-6)


def some_windows(log: Dataset) -> Windows:
    return cut_windows(log, horizon=10, interval=5.0, past=5)


@pytest.mark.parametrize("commands", ["held", "known"])
def test_tuning_takes_what_errs_least_by_the_paths_of_the_physics(commands: Literal["held", "known"]) -> None:
    """Each error is that of `Physics.paths` with these settings, actuators on their way included."""
    vessel, log = structure("actuators"), weaving("abc")
    windows, given = some_windows(log), Observer(waves=(0.0, 0.01), change=(1e-4,), current=0.0, fade=5.0, choose=True)
    memory = window_memory(vessel, log, windows)
    assert memory

    def paths(settings: Observer, estimates: Mapping[str, np.ndarray]) -> np.ndarray:
        instants = windows.instants(known=commands == "known", hidden=memory, estimates=estimates)
        return Physics(vessel, 10, 1.0, "rk4", settings).paths(instants)

    chosen, tried = tune_observer(vessel, log, windows, paths, given)

    def error(settings: Observer) -> float:
        estimates = at_instants(log, windows, run_observer(vessel, log, settings))
        return float(position_error(paths(settings, estimates), windows.future).mean())

    assert not chosen.choose
    assert error(chosen) == pytest.approx(min(tried.values()), rel=1e-9)
    assert tried["as given, fade 5.0"] == pytest.approx(error(given), rel=1e-9)
    alone = given.model_copy(update={"waves": (0.01,), "fade": 0.0})
    assert tried["waves (0.01,), fade 0.0"] == pytest.approx(error(alone), rel=1e-9)
    assert {label.split(",")[0].split()[0] for label in tried} == {"as", "waves"}
    assert max(tried.values()) > 1.05 * min(tried.values())


def test_a_compass_counts_from_zero_again() -> None:
    """Full turns in a log change no estimate; at an instant the heading counts turns as its window does."""
    vessel, log = load_vessel("gunnerus-28.9"), weaving("a")
    turn = np.pi + 0.05
    north, east = from_frame(log.frame["north"], log.frame["east"], 0.0, 0.0, turn)
    logs = [log.frame.assign(psi=log.frame["psi"] + turn, north=north, east=east)]
    logs.append(logs[0].assign(psi=np.mod(logs[0]["psi"] + np.pi, 2 * np.pi) - np.pi))
    assert np.abs(np.diff(logs[1]["psi"])).max() > 6
    (whole, around), windows = (run_observer(vessel, Dataset(frame, log.metadata)) for frame in logs), []
    for name, values in whole.columns.items():
        full = 2 * np.pi if name == "observer.psi" else 0.0
        np.testing.assert_allclose(around.columns[name] + full, values, atol=1e-8, err_msg=name)
    for frame, estimates in zip(logs, (whole, around), strict=True):
        data = Dataset(frame.assign(psi=frame["psi"] + 4 * np.pi), log.metadata)
        windows.append(estimates_at_windows(data, estimates, some_windows(data)))
        np.testing.assert_allclose(windows[-1]["observer.psi"], windows[-1]["psi"], atol=0.1)


@pytest.mark.parametrize(
    ("block", "remedy"),
    [
        ({"measured": ("u", "v", "r"), "current": 0.0}, "lacks 'psi'"),
        ({"measured": ("psi", "u", "v", "r")}, "set it to 0"),
        ({"noise": {"speed": 0.1}}, "speed"),
    ],
)
def test_measurements_that_cannot_serve_are_refused(block: dict[str, Any], remedy: str) -> None:
    with pytest.raises(DocumentError, match=remedy):
        Observer(**block)


def test_a_band_is_promised_once_the_observer_has_run_as_long_as_in_training() -> None:
    """In every unbroken stretch anew, at instants between rows too; where nobody knows how long it ran, never."""
    vessel, log = load_vessel("gunnerus-28.9"), weaving("ab")
    broken = (log.frame["run"] == "a") & (log.frame["t"] == 20)
    log = Dataset(log.frame.assign(flags=broken.astype(int)), {**log.metadata, "flags": ["break"]})
    windows, bands = cut_windows(log, horizon=8, interval=0.7), made(0)[1]
    physics = Physics(vessel, 8, 1.0, "rk4", Observer(waves=(0.0,), change=(1.0,)))
    columns = estimates_at_windows(log, run_observer(vessel, log, physics.observer), windows)
    predictor = Predictor(physics, "alone", UnchangedPath({}), {"u": (-50.0, 50.0)}, bands=bands, run_up=9.0)
    since = windows.t - np.where((windows.run == "a") & (windows.t >= 20), 20.0, 0.0)
    prediction = predictor.predict(windows.instants(estimates=columns), level=0.5)
    np.testing.assert_array_equal(prediction.outside, since < 9.0 - 1e-3)
    assert 10 < prediction.outside.sum() < len(windows) - 10
    nobody = {name: values for name, values in columns.items() if name != AGE_COLUMN}
    assert predictor.predict(windows.instants(estimates=nobody), level=0.5).outside.all()


def test_a_ship_adrift_is_observed_too() -> None:
    vessel, log = load_vessel("gunnerus-28.9"), weaving("ab")
    off = {f"thruster.{name}.off": True for name in vessel.document["thruster"]}
    adrift = vessel.with_values(off)
    assert not vessel_dynamics(adrift).commands
    estimates = run_observer(adrift, log, Observer(waves=(0.0,), change=(1.0,)))
    assert all(np.isfinite(values).all() for values in estimates.columns.values())


def test_a_vessel_without_a_length_is_refused() -> None:
    vessel = load_vessel("gunnerus-28.9")
    document = {key: value for key, value in vessel.document.items() if key != "particulars"}
    with pytest.raises(DocumentError, match=r"has no particulars\.L_pp"):
        filter_bank(replace(vessel, document=document))


def test_along_a_log_it_is_the_function_that_goes_aboard(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiled or interpreted, all runs at once or instant by instant; also where a filter begins again."""
    vessel, frame = load_vessel("gunnerus-28.9"), calm().data.frame
    run = frame[frame["run"] == "M000"].iloc[:25].reset_index(drop=True)
    settings = Observer(waves=(0.01,), change=(2e-4, 1e9), measured=("north", "east", "psi", "u", "r"))
    filters = filter_bank(vessel, settings)  # half of them diverge at once
    log = Dataset(run, calm().data.metadata)
    ways = []
    for from_here in (np.inf, 0.0):
        monkeypatch.setattr(samples, "COMPILE_FROM", from_here)
        ways.append(run_observer(vessel, log, filters.settings))
    one = filter_function(filters.model)
    assert find_compiler() is None or samples._compile_sample_function(one, ("parameters",)) is not None
    step, model = observer_function(filters.model, filters.num_filters), filters.model
    orders, weather = run[list(model.commands)].to_numpy(), run[list(model.environment)].to_numpy()
    measured, values = run[list(MEASURED_MOTION)].to_numpy(), list(vessel.parameters.values())
    measured[:, MEASURED_MOTION.index("v")] = np.nan
    states = first_filter_states(filters, measured[0], orders[0])
    for k in range(1, len(run)):
        numbers = filters.numbers.T
        given = orders[k - 1], weather[k - 1], values, measured[k], filters.noise, numbers, 1.0
        states, estimate, _, _, weights = map(np.array, step(states, *given))
        assert (weights[2:] == 0).all()  # those that diverged
        for one in ways:
            columns = [one.columns[f"observer.{name}"][k] for name in ESTIMATE_COLUMNS]
            np.testing.assert_allclose(columns, estimate[:, 0], rtol=1e-6, atol=1e-9)


def test_the_spread_of_an_innovation_is_that_of_the_state_and_of_the_sensor() -> None:
    filters = filter_bank(load_vessel("gunnerus-28.9"))
    model = filters.model
    start = np.array([0.0, 0.0, 0.3, 4.0, 0.1, 0.0])
    states = first_filter_states(filters, start, np.zeros(len(model.commands)))[:, 0]
    given = [np.zeros(len(model.commands)), np.zeros(len(model.environment)), list(filters.vessel.parameters.values())]
    step, numbers = filter_function(model), filters.numbers[0]
    spreads = [np.array(step(states, *given, start, noise, numbers, 1.0)[3]).ravel() for noise in (0.0, 2.0, 3.0)]
    np.testing.assert_allclose(spreads[1] - spreads[0], 4.0)
    np.testing.assert_allclose(spreads[2] - spreads[0], 9.0)
    assert (spreads[0] > 0).all()


@pytest.mark.parametrize(
    ("name", "wrong"), [("east", -1e6), pytest.param("u", 1e4, marks=pytest.mark.slow), ("psi", 1e3)]
)
def test_a_spike_of_a_sensor_passes(name: str, wrong: float) -> None:
    """A measurement that cannot be is left out: twenty rows later the estimates are where they would be without it."""
    vessel, frame = load_vessel("gunnerus-28.9"), sea().data.frame
    run = frame[frame["run"] == "M000"].iloc[:60].reset_index(drop=True)
    spiked = run.copy()
    spiked.loc[30, name] += wrong
    with_it, without = (run_observer(vessel, Dataset(log, sea().data.metadata)).columns for log in (spiked, run))
    for column, scale in (
        ("north", 1.0),
        ("east", 1.0),
        ("psi", 0.05),
        ("u", 0.2),
        ("v", 0.2),
        ("X", 0.02),
        ("Y", 0.02),
    ):
        difference = with_it[f"observer.{column}"][50:] - without[f"observer.{column}"][50:]
        assert np.abs(difference).max() < scale, column
    if name != "psi":  # at most half a turn: not 300 standard deviations
        assert with_it["observer.test"][30] < 2 * without["observer.test"][25:35].max()  # it is no measurement


def test_the_example_of_the_documentation_runs(tmp_path: Path) -> None:
    page = (Path(__file__).parents[1] / "docs" / "observer.md").read_text(encoding="utf-8")
    text = page.partition("```python\n")[2].partition("```")[0]
    log = write_dataset(sea().data, tmp_path / "log.parquet")
    names: dict[str, Any] = {}
    exec(re.sub(r'"results/quick-[0-9a-f]*/dataset.parquet"', repr(str(log)), text), names)
    assert names["predicted"].shape == (30, len(names["windows"]), 2)
    assert len(names["tried"]) > 1
