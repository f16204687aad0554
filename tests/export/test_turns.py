"""Angles aboard: whatever turn a live angle comes by, the path is that of angles that go on."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.engine.casadi import memory_along
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.physics import Physics
from shipid.observer import Observer
from shipid.predictor import Predictor
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import check_document
from tests.conftest import variety
from tests.drawn_ships import drawn_ship, extreme_inputs
from tests.export.compiled import Recorder

OUTSIDE, TURN = 2, 2 * np.pi
LAG = {"kind": "first_order", "T": 0.5, "rate": 0.20944}
FREE = {"u": (-1e3, 1e3), "port.alpha": (-1e3, 1e3), "starboard.alpha": (-1e3, 1e3)}  # angles go on without end


def gunnerus(gear):
    """R/V Gunnerus whose azimuth units have a gear."""
    document = copy.deepcopy(variety()["gunnerus-28.9"].document)
    for side in ("port", "starboard"):
        document["thruster"][side]["actuator"] = {"alpha": gear}
    return check_document(document, "gunnerus.toml")


def limits_of(low, high):
    return FREE | {f"{side}.alpha": (np.radians(low), np.radians(high)) for side in ("port", "starboard")}


def played(folder, gear, limits, angles, observer=None):
    """Paths (N, T, 2) and alarms (N,) with angles [deg] of both units, a second apart."""
    physics = Physics(gunnerus(gear), 20, 1.0, "rk4", observer)
    recorder = Recorder(Predictor(physics, "alone", UnchangedPath({}), limits), folder)
    paths, alarms = [], []
    for i, angle in enumerate(angles):
        values = {"u": 4.0, "north": 4.0 * i, "port.n": 2.5, "starboard.n": 2.5}
        values |= dict.fromkeys(("port.alpha", "starboard.alpha"), np.radians(angle))
        path, result = recorder.path(float(i), values)
        assert result & ~OUTSIDE == 0
        paths.append(path)
        alarms.append(result == OUTSIDE)
    return np.array(paths), alarms


WALK = [*range(100, 700, 12), 650, 600, 560]


ROUNDS = [
    (-170, 170, [150, 168, 175, 182, 188, 192, 195]),  # slowly: outside of the training, and inside again
    (-170, 170, [140, 160, 165, 195, 200]),  # across 180 in one row, both within the training
    (-200, 120, [100, 110, 130, 150, 165, 165, 140]),  # in again at its other end
    (-50, 50, [10, 130, 250, 330, 370, 390]),  # once round
    (-200, 500, WALK),  # a training of more than a turn: on beyond it
]
OBSERVER = Observer(waves=(0.0,), change=(1.0,))


@pytest.mark.parametrize(
    ("low", "high", "angles", "observer"),
    [pytest.param(*one, OBSERVER, marks=pytest.mark.slow) for one in ROUNDS]
    + [pytest.param(*one, None, marks=[pytest.mark.slow] * (number % 2)) for number, one in enumerate(ROUNDS)],
)
def test_a_unit_that_turns_all_round_goes_the_shortest_way(low, high, angles, observer, tmp_path):
    """Inside of the training without an alarm, and nowhere does its gear go back by a turn."""
    turns = np.arange(len(angles)) % 3 - 1
    whole, _ = played(tmp_path / "whole", LAG, FREE, angles, observer)
    paths, alarms = played(tmp_path / "odd", LAG, limits_of(low, high), np.array(angles) + 360 * turns, observer)
    np.testing.assert_allclose(paths, whole, rtol=0, atol=1e-7)
    inside = [any(low <= angle + 360 * k <= high for k in range(-3, 4)) for angle in angles]
    assert alarms == [not within for within in inside]


def test_the_gear_begins_where_its_first_angle_is(tmp_path):
    """350 deg for -10, in the first row and after a pause."""
    whole, _ = played(tmp_path / "whole", LAG, limits_of(-50, 50), [-10])
    paths, alarms = played(tmp_path / "odd", LAG, limits_of(-50, 50), [350])
    np.testing.assert_allclose(paths, whole, rtol=0, atol=1e-9)
    assert alarms == [False]


@pytest.mark.parametrize("low_high", [(-50, 50), (-175, 175)])
def test_between_stops_a_jump_is_real(low_high, tmp_path):
    """A unit with stops at 175 deg goes from 165 to -165 through 0, outside of the training, too."""
    gear = LAG | {"low": np.radians(-175), "high": np.radians(175)}
    angles = [40, 160, 165, -165, -165, -160, 172]
    vessel, t = gunnerus(gear), np.arange(7.0)
    columns = {name: np.zeros(7) for name in ("psi", "v", "r")} | {"u": np.full(7, 4.0)}
    columns |= {
        name: np.radians(angles) if "alpha" in name else np.full(7, 2.5) for name in vessel_dynamics(vessel).commands
    }
    reached = memory_along(vessel, columns, t)
    physics = Physics(vessel, 20, 1.0)
    whole = Predictor(physics, "alone", UnchangedPath({})).predict(Instants(columns, hidden=reached)).swapaxes(0, 1)
    turns = np.array([0, 1, -1, 1, 0, 2, -1])
    limits = limits_of(*low_high)
    other = Recorder(Predictor(physics, "alone", UnchangedPath({}), limits), tmp_path / "odd")
    for i, angle in enumerate(np.array(angles) + 360 * turns):
        values = {name: column[i] for name, column in columns.items()}
        values |= dict.fromkeys(("port.alpha", "starboard.alpha"), np.radians(angle))
        path, result = other.path(float(i), values)
        np.testing.assert_allclose(path, whole[i], rtol=0, atol=1e-9)
        assert (result == OUTSIDE) == (not low_high[0] <= angles[i] <= low_high[1])


SHIPS = (2, 7, 17, 25, 33, 34, 38)  # with an azimuth unit
SEEDS = [seed + 100 * more for seed in SHIPS for more in range(4)]


@pytest.mark.parametrize("seed", [25, *(pytest.param(one, marks=pytest.mark.slow) for one in SEEDS if one != 25)])
def test_drawn_ships_take_angles_of_any_turn(seed, tmp_path):
    """Rows whose angles come by any turn give the paths of Python along the log in which they go on.

    Angles of training are drawn, too, so also their limits: all, or a part of a turn. Rudders and units with stops keep
    to their range, others walk without end.
    """
    vessel, rng = drawn_ship(seed % 100), np.random.default_rng(seed)
    count, horizon = 12, 5
    names = vessel_dynamics(vessel)
    given = extreme_inputs(vessel, count, seed)
    columns = given["start"] | given["commands"] | given["environment"] | {"north": np.zeros(count)}
    columns["u"], columns["v"], columns["r"] = np.abs(columns["u"]), 0.1 * columns["v"], 0.1 * columns["r"]
    step = 0.02 * float(np.sqrt(vessel.document["particulars"]["L_pp"] / 9.81))
    t, limits, stops = 2 * step * np.arange(count), {"u": (-1e6, 1e6)}, {}
    for name in names.commands:
        component, _, signal = name.rpartition(".")
        gear = vessel.document["thruster"][component].get("actuator", {}).get(signal, {})
        stops[name] = gear.get("low", -np.inf), gear.get("high", np.inf)
        if signal == "delta":
            columns[name] = rng.uniform(-0.6, 0.6, count)
            limits[name] = (-0.1, 0.2) if rng.random() < 0.5 else (-0.6, 0.6)
        if signal == "alpha":
            free = not np.isfinite(stops[name]).all()
            columns[name] = np.cumsum(rng.uniform(-2.9, 2.9, count)) if free else rng.uniform(*stops[name], count)
            begin = rng.uniform(-2, 2)
            limits[name] = (begin, begin + rng.uniform(0.1, 5.4)) if rng.random() < 0.7 else (-1e6, 1e6)
    predictor = Predictor(Physics(vessel, horizon, step), "alone", UnchangedPath({}), limits)
    reached = memory_along(vessel, {name: columns[name] for name in names.commands}, t)
    with np.errstate(all="ignore"):
        expected = predictor.predict(Instants(columns, hidden=reached))
    recorder, compared = Recorder(predictor, tmp_path), 0
    for i in range(count):
        values = {name: column[i] for name, column in columns.items()}
        for name in names.commands:
            if name.endswith(("alpha", "delta")):
                values[name] += TURN * rng.integers(-3, 4)
        path, result = recorder.path(t[i], values)
        whole = np.isfinite(expected[:, i]).all()
        assert (result & 4 > 0) == (not whole)
        if whole:
            scale = max(1.0, float(np.abs(expected[:, i]).max()))
            np.testing.assert_allclose(path, expected[:, i], rtol=0, atol=1e-9 * scale)
            compared += 1
    assert compared > count / 2
