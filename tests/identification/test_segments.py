"""Runs become predictions: gaps part them, ends that are too short are left, rows between the steps count for none."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DataError
from shipid.identification.residuals import build_problem, predict_residuals
from shipid.identification.segments import cut_segments, held_over_steps, interpolate_commands, too_short
from shipid.identification.settings import Identify
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.conftest import variety
from tests.identification.trials import changed, trials

SHIP = load_vessel("gunnerus-28.9")
DATA = trials(SHIP, runs=2, steps=50)


@pytest.mark.parametrize("step", [1.0, 0.5])
def test_a_run_is_cut_into_horizons_and_its_end_counts_from_half_of_one(step: float) -> None:
    for horizon, lengths in ((0.0, [50]), (20.0, [20, 20, 10]), (30.0, [30, 20]), (22.0, [22, 22]), (80.0, [50])):
        segments = cut_segments(SHIP, DATA, DATA.runs, step, horizon)
        assert [one.num_steps * step for one in segments if one.run == 0] == lengths
        assert all(np.allclose(np.diff(one.t), step) for one in segments)
        assert too_short(DATA, DATA.runs, step, horizon) == []
    assert too_short(DATA, DATA.runs, step, 104.0) == list(DATA.runs)


@pytest.mark.parametrize("begin", [0, 9])
def test_a_run_has_as_many_steps_in_seconds_since_1970(begin: int) -> None:
    """Twenty rows a second: the last of them ends a step, though such times are rounded to some 1e-7 s."""
    rows = DATA.frame[DATA.frame["t"] < 50]
    data = Dataset(rows.assign(t=1_700_000_000 + (0.05 * (begin + rows["t"])).round(2)), DATA.metadata)
    assert [one.num_steps for one in cut_segments(SHIP, data, data.runs, 0.05, 0.0)] == [49, 49]
    assert too_short(data, data.runs, 0.05, 4.9) == []


def test_earlier_orders_are_those_before_the_segment_the_latest_first() -> None:
    frame = DATA.frame.assign(**{"port.n": 1.0 + 0.01 * DATA.frame["t"]})
    segments = cut_segments(SHIP, Dataset(frame, DATA.metadata), DATA.runs, 1.0, 20.0, lags=3)
    for one in segments:
        steps = np.maximum(one.t[0] - [1.0, 2.0, 3.0], 0.0)  # before the first row its order holds
        np.testing.assert_allclose(one.earlier["port.n"], 1.0 + 0.01 * steps, atol=1e-12)
    assert {one.t[0] for one in segments} == {0.0, 20.0, 40.0}


def test_commands_between_rows() -> None:
    """An order to a gear changes in the middle between two rows, a command without one goes on evenly."""
    ship = variety()["actuators"]
    rows = trials(ship, runs=1, steps=20)
    lagging = next(name for name in rows.commands if name in vessel_dynamics(ship).memory)
    frame = rows.frame.assign(**{lagging: np.where(rows.frame["t"] < 10, 1.0, 2.0)})
    stepped = Dataset(frame, rows.metadata)
    (one,) = cut_segments(ship, stepped, stepped.runs, 0.25, 0.0, commands="between")
    np.testing.assert_array_equal(one.columns[lagging], np.where(one.t + 0.125 < 9.5, 1.0, 2.0))
    (held,) = cut_segments(ship, stepped, stepped.runs, 0.25, 0.0)
    np.testing.assert_array_equal(held.columns[lagging], np.where(held.t < 10, 1.0, 2.0))
    with pytest.raises(DataError, match=r"step: 1 s: orders to the actuator of .* 1 s apart: give at most 0\.5"):
        cut_segments(ship, stepped, stepped.runs, 1.0, 0.0, commands="between")
    frame = DATA.frame.assign(**{"port.n": 1.0 + 0.01 * DATA.frame["t"]})
    for one in cut_segments(SHIP, Dataset(frame, DATA.metadata), DATA.runs, 1.0, 20.0, commands="between"):
        np.testing.assert_allclose(one.columns["port.n"][:-1], 1.0 + 0.01 * (one.t[:-1] + 0.5), atol=1e-12)


def test_a_break_parts_a_run() -> None:
    frame = DATA.frame.copy()
    frame.loc[(frame["run"] == "M01") & (frame["t"] == 20), "flags"] = 1
    broken = Dataset(frame, {"clock": "run", "flags": ["break"]})
    segments = cut_segments(SHIP, broken, ["M01"], 1.0, 0.0)
    assert [(one.t[0], one.num_steps) for one in segments] == [(0.0, 19), (20.0, 30)]


def test_wind_that_was_logged_is_felt() -> None:
    V_w, beta_w = np.array([8.0, 4.0]), np.array([0.5, 2.5])
    windy = trials(SHIP, runs=2, steps=30, weather={"V_w": V_w, "beta_w": beta_w})
    each = np.repeat([0, 1], 31)
    logged = changed(windy, V_w=V_w[each], beta_w=beta_w[each])
    wanted = Identify(parameters=["hull.derivatives.N_ur"], horizon=0)
    worst = []
    for data in (logged, windy):
        fit = build_problem(SHIP, data, data.runs, wanted)
        worst.append(np.abs(predict_residuals(fit, np.ones(1), np.zeros((2, 0))).r).max())
    assert worst[0] < 1e-9
    assert worst[1] > 0.1


def test_a_command_that_was_not_logged_is_reported() -> None:
    without = Dataset(DATA.frame.drop(columns="port.n"), DATA.metadata)
    with pytest.raises(DataError, match=r"port\.n: .* needs this command; the data have port\.alpha"):
        cut_segments(SHIP, without, without.runs, 1.0, 0.0)


def test_a_ship_that_heels_is_seen_in_the_horizontal_plane() -> None:
    """u, v and r of a log are horizontal; the states of a ship with 4 or 6 degrees of freedom are along its axes."""
    vessel = variety()["six"]
    data = trials(vessel, runs=2, steps=40)
    assert np.abs(data.frame["phi"]).max() > 0.02
    wanted = Identify(parameters=["hull.derivatives.N_uv"], horizon=10, weights={"u": 1e-3, "v": 1e-3, "r": 1e-4})
    at = predict_residuals(build_problem(vessel, data, data.runs, wanted), np.ones(1), np.zeros((2, 0)))
    assert np.abs(at.r).max() < 1e-6


def test_actuators_lag_as_in_each_run() -> None:
    """An override of an actuator's time constant also sets the actuator's position when a prediction begins."""
    vessel = variety()["actuators"]
    lags = {path: 3.0 * x for path, x in vessel.parameters.items() if path.startswith("thruster.port.actuator.n.")}
    numbers = np.tile(list(vessel.parameters.values()), (2, 1))
    numbers[1] = list(vessel.with_values(lags).parameters.values())
    data = trials(vessel, runs=2, steps=40, parameters=numbers)
    overrides = {f"M02.{path}": x for path, x in lags.items()}
    worst = []
    for runs in ({}, overrides):
        for free in ("hull.derivatives.N_uv", "thruster.starboard.actuator.*"):  # memory as given, and carried
            fit = build_problem(vessel, data, data.runs, Identify(parameters=[free], horizon=7, runs=runs))
            worst.append(np.abs(predict_residuals(fit, np.ones(fit.num_factors), np.zeros((2, 0))).r).max())
    assert min(worst[:2]) > 1e-3
    assert max(worst[2:]) < 1e-6


def test_every_segment_begins_at_a_row_and_no_row_is_left_out() -> None:
    """A state interpolated between two rows is wrong by what happened there: at the true numbers nothing is left."""
    coarse = Dataset(DATA.frame[DATA.frame["t"] % 5 == 0], DATA.metadata)
    segments = cut_segments(SHIP, coarse, coarse.runs[:1], 1.0, 12.0)
    assert [(one.t[0], one.t[-1]) for one in segments] == [(0, 12), (10, 22), (20, 32), (30, 42), (40, 50)]
    fit = build_problem(SHIP, coarse, coarse.runs, Identify(parameters=["hull.derivatives.N_ur"], horizon=12))
    at = predict_residuals(fit, np.ones(1), np.zeros((2, 0)))
    assert sorted(set(at.time)) == [5.0 * i for i in range(1, 11)]
    assert np.abs(at.r).max() < 1e-9
    with pytest.raises(DataError, match=r"rows of 'M01' are so far apart that no prediction of 4 s holds two of them"):
        cut_segments(SHIP, coarse, coarse.runs, 1.0, 4.0)


SHIP = load_vessel("gunnerus-28.9")


def test_at_the_rows_and_in_the_middle_between_them() -> None:
    ship = variety()["actuators"]
    rng, t = np.random.default_rng(1), np.array([0.0, 1.0, 2.5, 3.0])
    rows = {name: rng.normal(size=4) for name in vessel_dynamics(ship).commands}
    at_rows, later = (
        interpolate_commands(ship, {"t": t, **rows}, t),
        interpolate_commands(ship, {"t": t, **rows}, np.array([[1.74, 1.76]])),
    )
    for name, values in rows.items():
        np.testing.assert_array_equal(at_rows[name], values)
        if name in vessel_dynamics(ship).memory:
            np.testing.assert_array_equal(later[name], [values[1:3]])
        else:
            mean = (values[1] + values[2]) / 2
            np.testing.assert_allclose(later[name].mean(), mean, atol=1e-12)


def test_an_order_within_a_step_counts_from_the_step_that_begins_nearest() -> None:
    """A command without an actuator has its mean over the step."""
    t = np.array([0.0, 1.4, 2.6])
    for ship, by_hand in ((variety()["actuators"], [1.0, 2.0, 2.0, 4.0]), (SHIP, [1.0, 1.6, 2.8, 4.0])):
        commands = vessel_dynamics(ship).commands
        assert set(vessel_dynamics(ship).memory) == (set() if ship is SHIP else set(commands))
        rows = {name: np.array([1.0, 2.0, 4.0]) for name in commands}
        held = held_over_steps(ship, {"t": t, **rows}, np.arange(4.0), 1.0)
        for name in commands:
            np.testing.assert_allclose(held[name], by_hand, atol=1e-12, err_msg=name)
