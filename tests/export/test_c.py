"""C99 of predictors and vessels: the same numbers as Python, whatever the predictor."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid import observer
from shipid.data.dataset import Dataset, sample
from shipid.data.windows import Instants, past_of
from shipid.engine.casadi import memory_along
from shipid.engine.rollout import rollout
from shipid.export.c import Files, Precision, c_name, comment, strings
from shipid.export.c_predictor import predictor_files
from shipid.export.c_vessel import VesselParts, vessel_files
from shipid.export.casadi import predictor_function
from shipid.export.equations import Equations
from shipid.export.model import model
from shipid.hybrid.alone import Unchanged
from shipid.hybrid.features import MOTIONS, Memory
from shipid.hybrid.physics import Physics
from shipid.observer import AGE, LONGEST, MOST_PARTS, Observer, bank, observe
from shipid.predictor import Predictor
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import load_vessel
from tests.conftest import pace, variety
from tests.drawn_ships import drawn_ship
from tests.export.compiled import SANITIZERS, compile_, compiler, library, paths, pointer, run_example, write
from tests.export.strange import KINDS, bands_of, drawn, network_of

NEAR = 1e-12  # m
INVALID, OUTSIDE, DIVERGED, NO_PAST, TIME, PARAMETER = 1, 2, 4, 8, 16, 64


def agree(computed, results, strange):
    """Paths are those of Python, and results say what they must."""
    with np.errstate(all="ignore"):
        expected = strange.predictor.predict(strange.instants)
    whole = np.isfinite(expected).all(axis=(0, 2))
    np.testing.assert_array_equal((results & DIVERGED) > 0, ~whole)
    np.testing.assert_array_equal((results & OUTSIDE) > 0, strange.predictor.outside(strange.instants.columns))
    scale = max(1.0, float(np.abs(expected[:, whole]).max(initial=0.0)) / 100)
    np.testing.assert_allclose(computed[:, whole], expected[:, whole], rtol=0, atol=NEAR * scale)


@pytest.mark.parametrize("kind", ["path-drawn", "recurrent"])
def test_drawn_predictors_say_the_same(kind, tmp_path):
    strange = drawn(kind, 5, vessel="mariner")
    exported = model(strange.predictor)
    loaded = library(predictor_files(exported, "odd", Precision()), tmp_path)
    agree(*paths(loaded, "odd", exported, strange.instants), strange)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", KINDS)
def test_every_method_on_strange_ships(kind, seed, tmp_path):
    strange = drawn(kind, seed, count=50)
    exported = model(strange.predictor)
    loaded = library(predictor_files(exported, "odd", Precision()), tmp_path)
    agree(*paths(loaded, "odd", exported, strange.instants), strange)


@pytest.mark.parametrize("constant", [-4.0, -0.2, 4.0])
def test_factors_of_modules_stop_at_both_limits(constant):
    """However far the networks go, the written equations take a factor no further from 1 than Python does."""
    strange = drawn("modules", 5, count=4, vessel="mariner")
    corrector = strange.predictor.corrector
    weights = np.full_like(corrector.weights, 0.05)
    weights[:, 0] = constant
    corrector = replace(corrector, weights=weights)
    predictor = replace(strange.predictor, corrector=corrector)
    far = np.abs(corrector.factors(strange.instants) - 1).max()
    assert far == pytest.approx(corrector.limit) if abs(constant) > 1 else 0.1 < far < corrector.limit
    exported = model(predictor)
    function, _ = predictor_function(exported, "odd")
    given = exported.inputs(strange.instants)
    expected = predictor.predict(strange.instants)
    for i in range(4):
        path = np.array(function(**{key: values[i] for key, values in given.items()})["path"])
        np.testing.assert_allclose(path.T, expected[:, i], rtol=0, atol=1e-11)


def test_faults_in_the_inputs_give_a_result_and_no_path(tmp_path):
    strange = drawn("path-drawn", 3, vessel="mariner")
    exported = model(strange.predictor)
    loaded = library(predictor_files(exported, "odd", Precision()), tmp_path)
    given = {key: np.ascontiguousarray(values[0]) for key, values in exported.inputs(strange.instants).items()}
    path, work = np.zeros((exported.layout.horizon, 2)), np.zeros(1_000_000)

    def result(**changed):
        return loaded.odd_path(*(pointer({**given, **changed}[key]) for key in exported.layout.sizes), pointer(path), pointer(work))

    assert result() & ~OUTSIDE == 0
    for group in ("now", "past", "planned", "parameters"):
        for place in range(len(given[group])):
            for fault in (np.nan, np.inf, -np.inf):
                faulty = given[group].copy()
                faulty[place] = fault
                assert result(**{group: faulty}) == INVALID
                assert np.isnan(path).all()
    places = [exported.layout.parameters.index(name) for name in exported.vessel.above_zero]
    assert places
    for place in places:
        for fault in (0.0, -1.0):
            faulty = given["parameters"].copy()
            faulty[place] = fault
            assert result(parameters=faulty) == PARAMETER
            assert np.isnan(path).all()
    for size in (1e6, 1e100, 1e300):
        huge = given["now"].copy()
        huge[exported.layout.now.index("u")] = size
        assert result(now=huge) & OUTSIDE
    wide = result(now=huge)
    assert wide & DIVERGED or np.isfinite(path).all()


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_thousand_instants_with_faults(kind, tmp_path):
    """Every eighth instant has an entry that is not finite, every eighth one that no ship has."""
    strange = drawn(kind, 11, count=1000)
    exported = model(strange.predictor)
    loaded = library(predictor_files(exported, "odd", Precision()), tmp_path)
    rng = np.random.default_rng(0)
    columns = {name: values.copy() for name, values in strange.instants.columns.items()}
    taken = [name for name in exported.layout.now if name in columns]
    faulty = np.zeros(1000, dtype=bool)
    for i in range(0, 1000, 8):
        columns[str(rng.choice(taken))][i] = rng.choice([np.nan, np.inf, -np.inf])
        faulty[i] = True
        columns["u"][i + 1] = rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(3, 12)
    instants = Instants(
        columns, strange.instants.past, strange.instants.planned, strange.instants.hidden, strange.instants.estimates
    )
    computed, results = paths(loaded, "odd", exported, instants)
    np.testing.assert_array_equal(results[faulty], INVALID)
    assert np.isnan(computed[:, faulty]).all()
    sound = np.flatnonzero(~faulty & (np.abs(columns["u"]) < 100))
    with np.errstate(all="ignore"):
        expected = strange.predictor.predict(instants.select(sound))
    whole = np.isfinite(expected).all(axis=(0, 2))
    np.testing.assert_array_equal((results[sound] & DIVERGED) == 0, whole)
    np.testing.assert_allclose(computed[:, sound][:, whole], expected[:, whole], rtol=0, atol=NEAR)
    large = ~faulty & (np.abs(columns["u"]) >= 100)
    assert ((results[large] & OUTSIDE) > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_sanitizers_are_silent(kind, tmp_path):
    """The example runs under address and undefined behaviour sanitizers; a bank of filters would take minutes."""
    plain = (drawn(kind, seed) for seed in range(2, 20))
    strange = next(one for one in plain if one.predictor.physics.observer is None)
    run_example(predictor_files(model(strange.predictor), "odd", Precision()), tmp_path, *SANITIZERS)


@pytest.mark.slow
def test_no_address_is_wrong_with_an_observer(tmp_path):
    physics = Physics(variety()["actuators"], 10, 1.0, "rk4", Observer())
    predictor = Predictor(physics, "alone", Unchanged({}), {})
    run_example(predictor_files(model(predictor), "odd", Precision()), tmp_path, "-fsanitize=address")


def log_of(vessel, seconds, rng, interval):
    """A run with orders that change, at uneven times; its heading goes on beyond pi."""
    slow, commands = pace(vessel), dynamics(vessel).commands
    t = np.cumsum(rng.uniform(0.8, 1.2, round(seconds / interval)) * interval) * slow
    frame = pd.DataFrame({"run": "a", "t": t, "flags": 0})
    psi = 3.0 + 0.03 / slow * (t - t[0])
    frame["psi"] = psi
    frame["u"], frame["v"] = slow * (3 + 0.2 * np.sin(t)), slow * 0.2 * np.cos(t)
    frame["r"] = np.full(len(t), 0.03 / slow)
    frame["north"] = 200 + np.cumsum(np.r_[0, np.diff(t) * frame["u"].to_numpy()[1:] * np.cos(psi[1:])])
    frame["east"] = np.cumsum(np.r_[0, np.diff(t) * frame["u"].to_numpy()[1:] * np.sin(psi[1:])])
    frame["V_w"], frame["beta_w"] = slow * 5.0, 0.3
    for name in commands:
        level = 0.3 if name.endswith(("alpha", "delta")) else 1.5 / slow
        frame[name] = level * np.repeat(rng.uniform(0.2, 1, len(t) // 4 + 1), 4)[: len(t)]
    return Dataset(frame, {"clock": "run"})


def path_after(exported, t, log, folder):
    """Path (T, 2) [m] of exported C that has recorded the rows of a log at times t [s]."""
    files = predictor_files(exported, "odd", Precision())
    kept = np.zeros(_size_of_struct(files, folder) + 64, dtype=np.uint8)
    path = np.zeros((exported.layout.horizon, 2))
    loaded = library(files, folder)
    loaded.odd_init(pointer(kept))
    loaded.odd_record.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
    order = exported.layout.now
    for at, row in zip(t, log[list(order)].to_numpy(dtype=float), strict=True):
        assert loaded.odd_record(pointer(kept), at, pointer(np.ascontiguousarray(row))) == 0
    assert loaded.odd_predict(pointer(kept), None, pointer(path)) == 0
    return path


@pytest.mark.slow
@pytest.mark.parametrize(("velocity", "longest"), [(False, LONGEST), (True, LONGEST), (False, 0.1)])
def test_a_recorder_knows_what_python_takes_from_a_log(velocity, longest, tmp_path, monkeypatch):
    """Past, actuators and estimates of the observer, row by row, at uneven times; also by parts of them."""
    monkeypatch.setattr(observer, "LONGEST", longest)
    vessel = variety()["actuators"]
    rng = np.random.default_rng(1)
    dataset = log_of(vessel, 25, rng, 0.5)
    strange = drawn("path-drawn", 7, vessel="actuators")
    physics = Physics(vessel, 8, 1.0, "euler", Observer(), "velocity" if velocity else "position")
    corrector = strange.predictor.corrector
    memory = Memory(history=(2.0, 3.0), turned=(4.0,), error=(3.0,), observer=True)
    inputs = type(corrector.inputs)(corrector.inputs.commands, memory)
    rows = dataset.frame
    t = rows["t"].to_numpy()
    late = t[t > t[0] + 4.0]
    estimates = observe(vessel, dataset, physics.observer)
    along = memory_along(vessel, {name: rows[name].to_numpy() for name in dynamics(vessel).commands}, t)
    assert along is not None
    places = np.flatnonzero(t > t[0] + 4.0)
    instants = Instants(
        sample(rows, late),
        past_of(rows, late, 4, 1.0, physics.path),
        None,
        {name: values[places] for name, values in along.items()},
        {name: values[places] for name, values in estimates.columns.items()},
    )
    table = inputs.table(physics, instants)
    names = [name for name in table if "." not in name or rng.random() < 0.6]
    network = network_of(rng, names, table, physics.horizon, 3, False)
    bands = bands_of(rng, physics, instants, ("u",), 1.0)
    corrector = type(corrector)(inputs, (network,), {})
    predictor = Predictor(physics, "path-drawn", corrector, {"u": (0.0, 9.0)}, bands=bands, run_up=9.0)
    exported = model(predictor)
    files = predictor_files(exported, "odd", Precision())
    size = _size_of_struct(files, tmp_path)
    loaded = library(files, tmp_path)
    kept = np.zeros(size + 64, dtype=np.uint8)
    loaded.odd_init(pointer(kept))
    path = np.zeros((physics.horizon, 2))
    assert loaded.odd_predict(pointer(kept), None, pointer(path)) == NO_PAST
    order = exported.layout.now
    loaded.odd_record.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
    predicted, alarms = [], []
    for i in range(len(t)):
        row = np.ascontiguousarray(rows.iloc[i][list(order)].to_numpy(dtype=float))
        row[order.index("psi")] = (row[order.index("psi")] + np.pi) % (2 * np.pi) - np.pi
        assert loaded.odd_record(pointer(kept), t[i], pointer(row)) == 0
        assert loaded.odd_record(pointer(kept), t[i], pointer(row)) == TIME
        bad = row.copy()
        bad[3] = np.nan
        assert loaded.odd_record(pointer(kept), t[i] + 0.1, pointer(bad)) == INVALID
        result = loaded.odd_predict(pointer(kept), None, pointer(path))
        settled = t[i] >= t[0] + 9.0 - 1e-9
        assert result == (NO_PAST if t[i] < t[0] + 4.0 - 1e-9 else 0 if settled else OUTSIDE)
        if t[i] > t[0] + 4.0:
            predicted.append(path.copy())
            alarms.append(result == OUTSIDE)
    expected = predictor.predict(instants, level=0.5)
    np.testing.assert_allclose(
        np.stack(predicted, axis=1), expected.paths, rtol=0, atol=1e-10
    )  # filters amplify rounding
    np.testing.assert_array_equal(alarms, expected.outside)


def test_a_row_just_after_an_instant_of_the_past_is_not_taken_for_it(tmp_path):
    """Its orders are in force, as for a row that is only rounding away; its motion is of its own time."""
    t = np.array([0.0, 0.4, 1.0 + 5e-5, 2.0, 3.0])
    strange = drawn("path-drawn", 7, vessel="actuators")
    log = log_of(variety()["actuators"], 5, np.random.default_rng(1), 1.0).frame.assign(t=t)
    log["u"] = [1.0, 5.0, 2.0, 3.0, 3.0]
    corrector, physics = strange.predictor.corrector, Physics(variety()["actuators"], 3, 1.0)
    inputs = type(corrector.inputs)(corrector.inputs.commands, Memory(history=(1.0, 2.0), error=(1.0,)))
    along = memory_along(physics.vessel, {name: log[name].to_numpy() for name in inputs.commands}, t)
    hidden = {name: values[-1:] for name, values in along.items()}
    instants = Instants(sample(log, t[-1:]), past_of(log, t[-1:], 2, 1.0, "position"), None, hidden)
    table = inputs.table(physics, instants)
    network = network_of(np.random.default_rng(2), list(table), table, 3, 2, False)
    exported = model(Predictor(physics, "path-drawn", type(corrector)(inputs, (network,), {}), {"u": (-9.0, 9.0)}))
    path = path_after(exported, t, log, tmp_path)
    expected = exported.predictor.predict(instants)[:, 0]
    np.testing.assert_allclose(path, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("interval", [0.01, 0.07, 0.1])
def test_rows_may_come_as_often_as_they_like(interval, tmp_path):
    """Before, a past of three steps and more was never long enough where rows came ten times in a step."""
    strange = drawn("path-drawn", 7, vessel="gunnerus-28.9")
    corrector, physics = strange.predictor.corrector, Physics(variety()["gunnerus-28.9"], 3, 1.0)
    slow = log_of(physics.vessel, 16, np.random.default_rng(1), 1.0).frame
    t = slow["t"].iloc[0] + interval * np.arange(round(13 / interval))
    log = pd.DataFrame({**sample(slow, t), "t": t, "run": "a"})
    inputs = type(corrector.inputs)(corrector.inputs.commands, Memory(history=(1.0, 10.0), error=(10.0,)))
    instants = Instants(sample(log, t[-1:]), past_of(log, t[-1:], 10, 1.0, "position"))
    table = inputs.table(physics, instants)
    network = network_of(np.random.default_rng(2), list(table), table, 3, 2, False)
    exported = model(Predictor(physics, "path-drawn", type(corrector)(inputs, (network,), {}), {"u": (-9.0, 9.0)}))
    path = path_after(exported, t, log, tmp_path)
    np.testing.assert_allclose(path, exported.predictor.predict(instants)[:, 0], rtol=0, atol=1e-9)


@pytest.mark.parametrize(("pause", "kept_on"), [(1.0, True), (2.9, True), (3.2, False)])
def test_rows_far_apart_for_the_steps_are_no_pauses(pause, kept_on, tmp_path):
    """Rows four steps apart; before, each began anew, with its actuators at their orders."""
    vessel = variety()["actuators"]
    physics = Physics(vessel, 20, 0.25)
    exported = model(Predictor(physics, "alone", Unchanged({}), {"u": (-9.0, 9.0)}))
    log = log_of(vessel, 9, np.random.default_rng(5), 1.0).frame.iloc[:8]
    t = np.arange(8.0)
    t[7:] += pause - 1
    names = dynamics(vessel).commands
    first = 1 if kept_on else 7  # of the first interval nobody knows that it is the usual one
    orders = {name: log[name].to_numpy()[first:] for name in names}
    along = memory_along(vessel, orders, t[first:])
    columns = {name: log[name].to_numpy()[-1:] for name in log if name not in ("run", "flags")}
    expected = exported.predictor.predict(Instants(columns, hidden={k: values[-1:] for k, values in along.items()}))
    path = path_after(exported, t, log, tmp_path)
    np.testing.assert_allclose(path, expected[:, 0], rtol=0, atol=1e-11)


def test_two_rows_that_came_together_once_are_forgotten(tmp_path):
    """Before, rows four steps apart each began anew from then on, with their actuators at their orders."""
    vessel = variety()["actuators"]
    exported = model(Predictor(Physics(vessel, 20, 0.25), "alone", Unchanged({}), {"u": (-9.0, 9.0)}))
    log = log_of(vessel, 16, np.random.default_rng(5), 1.0).frame.iloc[:14]
    t = np.array([0.0, 1.0, 2.0, 3.0, *(3.25 + np.arange(10.0))])
    first = 8  # 3 x 0.25 x 1.1^3 s are less than 1 s, 3 x 0.25 x 1.1^4 s more
    orders = {name: log[name].to_numpy()[first:] for name in dynamics(vessel).commands}
    along = memory_along(vessel, orders, t[first:])
    columns = {name: log[name].to_numpy()[-1:] for name in log if name not in ("run", "flags")}
    expected = exported.predictor.predict(Instants(columns, hidden={k: values[-1:] for k, values in along.items()}))
    path = path_after(exported, t, log, tmp_path)
    np.testing.assert_allclose(path, expected[:, 0], rtol=0, atol=1e-11)
    assert np.abs(path - exported.predictor.predict(Instants(columns))[:, 0]).max() > 1e-3


def test_a_recorder_observes_without_the_force_that_was_learned(tmp_path):
    """As in Python: the observer is that of the physics, to which the method adds its force afterwards."""
    vessel = variety()["gunnerus-28.9"]
    dataset = log_of(vessel, 8, np.random.default_rng(3), 1.0)
    corrector = drawn("learned-force", 1, vessel="gunnerus-28.9").predictor.corrector
    physics = Physics(vessel, 5, 1.0, "euler", Observer(waves=(0.0,), change=(1.0,)))
    predictor = Predictor(physics, "learned-force", corrector, {"u": (-9.0, 9.0)})
    exported, rows = model(predictor), dataset.frame
    files = predictor_files(exported, "odd", Precision())
    kept = np.zeros(_size_of_struct(files, tmp_path) + 64, dtype=np.uint8)
    loaded, path = library(files, tmp_path), np.zeros((5, 2))
    loaded.odd_init(pointer(kept))
    loaded.odd_record.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
    order = exported.layout.now
    predicted = []
    for t, row in zip(rows["t"], rows[list(order)].to_numpy(dtype=float), strict=True):
        assert loaded.odd_record(pointer(kept), t, pointer(np.ascontiguousarray(row))) == 0
        assert loaded.odd_predict(pointer(kept), None, pointer(path)) == 0
        predicted.append(path.copy())
    columns = {name: rows[name].to_numpy() for name in order}
    expected = predictor.predict(Instants(columns, estimates=observe(vessel, dataset, physics.observer).columns))
    np.testing.assert_allclose(np.stack(predicted, axis=1), expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("step", [0.4, 5.0])
def test_after_a_pause_an_observer_begins_anew_aboard_and_in_python(step, tmp_path):
    """Row by row over drawn logs with pauses, those after which the past alone begins anew aboard among them."""
    vessel, settings = variety()["actuators"], Observer(waves=(0.0,), change=(1.0,))
    pause = bank(vessel, settings).pause
    assert (pause > 3 * step) == (step < 1)
    predictor = Predictor(
        Physics(vessel, 5, step, "rk4", settings), "alone", Unchanged({}), {"u": (-99.0, 99.0)}, run_up=3.0
    )
    exported, anew = model(predictor), np.zeros(0, dtype=bool)
    files = predictor_files(exported, "odd", Precision())
    size, loaded = _size_of_struct(files, tmp_path) + 64, library(files, tmp_path)
    loaded.odd_record.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
    order = exported.layout.now
    path = np.zeros((5, 2))
    for seed, every in enumerate((0.3, 1.0, 4.0, 15.0)):
        rng = np.random.default_rng(seed)
        frame = log_of(vessel, 30 * every, rng, every).frame
        for place in rng.integers(1, len(frame), 6):
            frame.loc[place:, "t"] += rng.choice([2.0, 4.0, 0.9 * pause, 1.1 * pause, 60.0])
        t, orders = frame["t"].to_numpy(), {name: frame[name].to_numpy() for name in dynamics(vessel).commands}
        least, found = np.inf, [False]
        for apart in np.diff(t):
            found.append(apart > pause and (not np.isfinite(least) or apart > 3 * least))
            least = min(1.1 * least, apart)
        anew = np.append(anew, found)
        parts = np.split(np.arange(len(t)), np.flatnonzero(found))
        along = [memory_along(vessel, {name: orders[name][part] for name in orders}, t[part]) for part in parts]
        hidden = {name: np.concatenate([each[name] for each in along]) for name in along[0]}
        columns = {name: frame[name].to_numpy() for name in frame if name not in ("run", "flags")}
        estimates = observe(vessel, Dataset(frame, {"clock": "run"}), settings).columns
        begun = np.repeat([t[part[0]] for part in parts], list(map(len, parts)))
        np.testing.assert_allclose(estimates[AGE], t - begun, atol=1e-9)
        expected = predictor.predict(Instants(columns, hidden=hidden, estimates=estimates))
        kept = np.zeros(size, dtype=np.uint8)
        loaded.odd_init(pointer(kept))
        for i, row in enumerate(frame[list(order)].to_numpy(dtype=float)):
            assert loaded.odd_record(pointer(kept), t[i], pointer(np.ascontiguousarray(row))) == 0
            assert loaded.odd_predict(pointer(kept), None, pointer(path)) == (OUTSIDE if t[i] - begun[i] < 3 else 0)
            np.testing.assert_allclose(path, expected[:, i], rtol=0, atol=1e-9)
    assert 5 < anew.sum() < 30


@pytest.mark.parametrize("single", [False, True])
def test_an_observer_begins_anew_after_rows_as_far_apart_as_python_refuses(single, tmp_path):
    """Before, a row took 5 min with a clock in microseconds, and none ended with one in nanoseconds."""
    vessel, settings = variety()["gunnerus-28.9"], Observer(waves=(0.0,), change=(1.0,))
    real = np.float32 if single else np.float64
    physics = Physics(vessel, 5, 1.0, "rk4", settings)
    exported = model(Predictor(physics, "alone", Unchanged({}), {"u": (-99.0, 99.0)}, run_up=3.0))
    files = predictor_files(exported, "odd", Precision(single))
    limit = MOST_PARTS * bank(vessel, settings).longest
    assert f"After {limit:.4g} s all does, pause or not." in files.texts["odd.h"]
    kept, loaded = np.zeros(_size_of_struct(files, tmp_path) + 64, dtype=np.uint8), library(files, tmp_path)
    loaded.odd_record.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
    row, path = np.zeros(len(exported.layout.now), real), np.zeros((5, 2), real)
    for apart, result in ((0.99 * limit, 0), (1.01 * limit, OUTSIDE), (1e6, OUTSIDE), (1e9, OUTSIDE)):
        loaded.odd_init(pointer(kept))
        for i in range(4):
            assert loaded.odd_record(pointer(kept), i * apart, pointer(row)) == 0
        assert loaded.odd_predict(pointer(kept), None, pointer(path)) == result
        assert np.isfinite(path).all()


def test_the_past_begins_anew_before_the_observer_does(tmp_path):
    """Over a pause of 6 s the filters go on, as in Python, and no row of the past lies before it."""
    vessel, settings = variety()["gunnerus-28.9"], Observer(waves=(0.0,), change=(1.0,))
    rng, strange = np.random.default_rng(1), drawn("path-drawn", 7, vessel="gunnerus-28.9")
    frame = log_of(vessel, 20, rng, 1.0).frame
    frame.loc[10:, "t"] += 6.0
    dataset, t = Dataset(frame, {"clock": "run"}), frame["t"].to_numpy()
    physics, corrector = Physics(vessel, 5, 1.0, "rk4", settings), strange.predictor.corrector
    inputs = type(corrector.inputs)(corrector.inputs.commands, Memory(history=(1.0, 3.0), observer=True))
    estimates = observe(vessel, dataset, settings).columns
    assert (np.diff(estimates[AGE]) > 0).all()
    instants = Instants(sample(frame, t), past_of(frame, t, 3, 1.0, "position"), None, None, estimates)
    table = inputs.table(physics, instants)
    network = network_of(rng, list(table), table, 5, 2, False)
    predictor = Predictor(physics, "path-drawn", type(corrector)(inputs, (network,), {}), {"u": (-99.0, 99.0)})
    exported = model(predictor)
    files = predictor_files(exported, "odd", Precision())
    kept, loaded = np.zeros(_size_of_struct(files, tmp_path) + 64, dtype=np.uint8), library(files, tmp_path)
    loaded.odd_record.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
    order = exported.layout.now
    expected, path = predictor.predict(instants), np.zeros((5, 2))
    loaded.odd_init(pointer(kept))
    for i, row in enumerate(frame[list(order)].to_numpy(dtype=float)):
        assert loaded.odd_record(pointer(kept), t[i], pointer(np.ascontiguousarray(row))) == 0
        young = t[i] - t[0 if i < 10 else 10] < 3.0
        assert loaded.odd_predict(pointer(kept), None, pointer(path)) == (NO_PAST if young else 0)
        if not young:
            np.testing.assert_allclose(path, expected[:, i], rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", ["learned-force", "path-drawn"])
@pytest.mark.parametrize(
    ("low", "high", "angles", "least"),
    [
        (-50, 50, [-40, -10, 20, 10, -30, -50, 49, 0], None),  # any turns: 350 for -10
        (-170, 170, [-100, 100, -160, 165, 0, -5, 90, -90], None),  # orders of a unit that does not turn all round
        (-200, 500, [350, 380, 400, 365, 350, 300, 330, 362], 0),  # a unit that turns all round, from 0 to 360
        (-20, 20, [30, 50, 80, 130, 170, 200, 260, 300], -180),  # beyond the training: an alarm, the shortest way
    ],
)
def test_angles_may_wrap(kind, low, high, angles, least, tmp_path):
    """Rows whose angles differ by whole turns give the paths of those that go on, and the same alarm."""
    rng = np.random.default_rng(high)
    vessel = variety()["gunnerus-28.9"]
    rows = log_of(vessel, 8, rng, 1.0).frame.iloc[: len(angles)]
    rows = rows.assign(**{"port.alpha": np.radians(angles)})
    limits = {"u": (-9.0, 9.0), "port.alpha": tuple(np.radians([low, high]))}
    strange = drawn(kind, 3, vessel="gunnerus-28.9").predictor
    if kind == "path-drawn":
        inputs = type(strange.corrector.inputs)(strange.corrector.inputs.commands, Memory(history=(1.0, 2.0)))
        size, orders = len(rows), inputs.commands
        names = (*MOTIONS, "psi", "x", "y", "V_w", "beta_w", *orders)
        instants = Instants(sample(rows, rows["t"].to_numpy()), {name: np.zeros((2, size)) for name in names})
        table = inputs.table(Physics(vessel, 5, 1.0), instants)
        corrector = type(strange.corrector)(inputs, (network_of(rng, list(table), table, 5, 2, False),), {})
    else:
        corrector = strange.corrector
    exported = model(Predictor(Physics(vessel, 5, 1.0, "euler"), kind, corrector, limits, commands="known"))
    files = predictor_files(exported, "odd", Precision())
    size, loaded = _size_of_struct(files, tmp_path) + 64, library(files, tmp_path)
    loaded.odd_record.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
    order = exported.layout.now
    plan = np.tile(rows[list(exported.layout.planned)].to_numpy()[-1], (5, 1))
    place = exported.layout.planned.index("port.alpha")
    plan[:, place] += np.radians(0.2 * (high - low) * np.linspace(0, 1, 5)) * (-1 if angles[-1] > 0 else 1)

    def made(turned):
        """Paths and results, a row at a time, with the angles as they are `turned`."""
        kept, found, results = np.zeros(size, dtype=np.uint8), [], []
        loaded.odd_init(pointer(kept))
        log = rows.assign(**{"port.alpha": turned(rows["port.alpha"].to_numpy())})
        orders = plan.copy()
        orders[:, place] = turned(plan[:, place])
        for t, row in zip(log["t"], log[list(order)].to_numpy(dtype=float), strict=True):
            assert loaded.odd_record(pointer(kept), t, pointer(np.ascontiguousarray(row))) == 0
            for planned in (None, pointer(orders)):
                path = np.zeros((5, 2))
                results.append(loaded.odd_predict(pointer(kept), planned, pointer(path)))
                found.append(path)
        return np.array(found), results

    def turned(values):
        if least is None:
            return values + 2 * np.pi * rng.integers(-2, 3, len(values))
        return (values - np.radians(least)) % (2 * np.pi) + np.radians(least)

    expected, results = made(lambda values: values)
    assert OUTSIDE in results if low == -20 else OUTSIDE not in results
    got, others = made(turned)
    assert others == results
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-9)


def test_fast_math_is_refused_at_compilation(tmp_path):
    """It takes out isfinite: a row of NaN was kept, with result 0."""
    strange = drawn("path-drawn", 7, vessel="mariner")
    write(predictor_files(model(strange.predictor), "odd", Precision()), tmp_path)
    for options in (["-Ofast"], ["-O2", "-ffast-math"]):
        result = subprocess.run(
            [compiler(), "-std=c99", *options, "-c", "odd.c"], cwd=tmp_path, capture_output=True, text=True
        )
        assert result.returncode != 0
        assert "compile without -ffast-math" in result.stderr


@pytest.mark.parametrize("program", ["gcc", "clang"])
@pytest.mark.parametrize("single", [False, True])
def test_no_compiler_warns_of_a_conversion(program, single, tmp_path):
    """Before, clang saw numbers as truth values, and both saw numbers of the example that single precision rounds."""
    if shutil.which(program) is None:
        pytest.skip(f"no {program}")
    precision = Precision(single)
    every = [vessel_files(drawn_ship(100, 4), "odd", "rk4", precision)]
    every += [predictor_files(model(drawn(kind, 100).predictor), "odd", precision) for kind in ("forest", "recurrent")]
    for files in every:
        compile_([program], write(files, tmp_path), "-O0", "-Wsign-conversion", "-o", "example", "main.c", "odd.c", "odd_casadi.c")


def test_the_example_ends_with_the_result_of_a_row_that_is_refused(tmp_path):
    files = predictor_files(model(drawn("path-drawn", 7, vessel="mariner").predictor), "odd", Precision())
    text = files.texts["main.c"]
    first = re.search(r"row\[odd_NUM_ROW\] = \{([^,}]+)", text)
    assert first is not None
    broken = {**files.texts, "main.c": text.replace(first[0], first[0].replace(first[1], "0.0 / 0.0"), 1)}
    write(replace(files, texts=broken), tmp_path)
    compile_([compiler()], tmp_path, "-O0", "-o", "example", "main.c", "odd.c", "odd_casadi.c")
    result = subprocess.run([tmp_path / "example"], capture_output=True, text=True)
    assert (result.returncode, result.stdout) == (INVALID, f"row 0 is refused: result {INVALID}\n")


def test_a_ship_without_orders_compiles_without_a_warning(tmp_path):
    strange = drawn("one-step", 6, count=3, vessel="mariner")
    vessel = variety()["mariner"]
    adrift = vessel.with_values({f"thruster.{name}.off": True for name in vessel.document["thruster"]})
    head = strange.predictor.corrector.heads[0]
    names = ("u", "v", "r")
    units = replace(
        head.units, normaliser=replace(head.units.normaliser, names=names, mean=np.zeros(3), std=np.ones(3)),
        weight=np.ones((3, 2)), offset=np.zeros(2), reflection=None,
    )  # fmt: skip
    heads = (replace(head, units=units, surge=np.ones((3, 1)), sway_yaw=np.ones((3, 2))),)
    corrector = replace(strange.predictor.corrector, commands=(), heads=heads)
    predictor = Predictor(Physics(adrift, 3, 1.0), "one-step", corrector)
    library(predictor_files(model(predictor), "odd", Precision()), tmp_path)


def _size_of_struct(files, folder):
    write(files, folder)
    (folder / "size.c").write_text(
        '#include <stdio.h>\n#include "odd.h"\nint main(void) { printf("%d", (int)sizeof(odd)); return 0; }\n'
    )
    compile_([compiler()], folder, "-O0", "-o", "size", "size.c")
    return int(subprocess.run([folder / "size"], capture_output=True, text=True).stdout)


@pytest.mark.parametrize("name", ["actuators", "mariner"])
def test_a_vessel_steps_as_in_python(name, tmp_path, draw_inputs):
    _steps(variety()[name], tmp_path, draw_inputs)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(variety()))
def test_every_vessel_steps_as_in_python(name, tmp_path, draw_inputs):
    _steps(variety()[name], tmp_path, draw_inputs)
    run_example(vessel_files(variety()[name], "ship", "rk4", Precision()), tmp_path / "example", *SANITIZERS)


def _steps(vessel, folder, draw_inputs):
    """Sixty seconds in steps of a tenth, with loads, from drawn states."""
    equations, slow = Equations(vessel), pace(vessel)
    drawn_ = draw_inputs(vessel, 3)
    loads = 1e-3 * float(vessel.document["inertia"]["m"]) * np.ones(equations.model.num_dof)
    loaded = library(vessel_files(vessel, "ship", "rk4", Precision()), folder)
    loaded.ship_step.argtypes = [*[ctypes.c_void_p] * 5, ctypes.c_double]
    steps = 60
    expected = rollout(
        vessel, drawn_["start"], drawn_["commands"], drawn_["environment"], step=0.1 * slow, num_steps=steps,
        method="rk4", tau_extra=loads, engine="native",
    )  # fmt: skip
    for i in range(3):
        carry = np.zeros(equations.num_carry)
        carry[: len(equations.model.state)] = [drawn_["start"][name][i] for name in equations.model.state]
        groups = [np.array([drawn_[key][name][i] for name in getattr(equations.model, key)] + [0.0])
                  for key in ("commands", "environment")]  # fmt: skip
        values = np.array(list(vessel.parameters.values()))
        loaded.ship_begin(pointer(carry), pointer(groups[0]))
        given = [pointer(array) for array in (carry, *groups, loads, values)]
        assert loaded.ship_step(*given, 0.0) == 2
        assert loaded.ship_step(*given, float("nan")) == 1
        for place, name in enumerate(vessel.parameters):
            faulty, before = values.copy(), carry.copy()
            faulty[place] = 0.0
            if name in vessel.above_zero:
                assert loaded.ship_step(*given[:-1], pointer(faulty), 0.1 * slow) == 8
                np.testing.assert_array_equal(carry, before)
        for _ in range(steps):
            result = loaded.ship_step(*given, 0.1 * slow)
            if result:
                break
        assert bool(result) == bool(expected.diverged[0, i])
        if not result:
            names = equations.model.state
            last = [expected[name][-1, 0, i] for name in names]
            np.testing.assert_allclose(carry[: len(names)], last, rtol=1e-12, atol=1e-12)


@pytest.mark.slow
def test_single_precision_is_near(tmp_path):
    strange = drawn("path-drawn", 5, vessel="mariner")
    exported = model(strange.predictor)
    loaded = library(predictor_files(exported, "odd", Precision(single=True)), tmp_path)
    computed, _ = paths(loaded, "odd", exported, strange.instants, np.float32)
    expected = strange.predictor.predict(strange.instants)
    assert np.abs(computed - expected).max() < 1e-4 * np.abs(expected).max()


def test_a_long_way_costs_single_precision_no_digits(tmp_path):
    """The past by integrated velocities: after 48 h at 7 m/s a path of 61 m was 5 m elsewhere, in the same state."""
    strange = drawn("path-drawn", 7, vessel="gunnerus-28.9")
    corrector = strange.predictor.corrector
    physics = Physics(variety()["gunnerus-28.9"], 3, 1.0, path="velocity")
    log = log_of(physics.vessel, 16, np.random.default_rng(1), 1.0).frame
    t = log["t"].to_numpy()[12:]
    inputs = type(corrector.inputs)(corrector.inputs.commands, Memory(history=(1.0, 10.0), error=(10.0,)))
    instants = Instants(sample(log, t), past_of(log, t, 10, 1.0, "velocity"))
    table = inputs.table(physics, instants)
    network = network_of(np.random.default_rng(2), list(table), table, 3, 2, False)
    exported = model(Predictor(physics, "path-drawn", type(corrector)(inputs, (network,), {}), {"u": (-9.0, 9.0)}))
    files = predictor_files(exported, "odd", Precision(single=True))
    size, loaded = _size_of_struct(files, tmp_path) + 64, library(files, tmp_path)
    loaded.odd_record.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
    order = exported.layout.now

    def path_after(fast):
        """Path where so many rows of 2 km/s came before those of 7 m/s."""
        kept, path = np.zeros(size, dtype=np.uint8), np.zeros((3, 2), dtype=np.float32)
        loaded.odd_init(pointer(kept))
        for k in range(fast + 120):
            given = {"u": 2000.0 if k < fast else 7.0, "psi": 0.4}
            row = np.array([given.get(name, 1.5 if name.endswith(".n") else 0.0) for name in order], dtype=np.float32)
            assert loaded.odd_record(pointer(kept), 0.1 * k, pointer(row)) == 0
        assert loaded.odd_predict(pointer(kept), None, pointer(path)) == 0
        return path

    np.testing.assert_allclose(path_after(6000), path_after(0), rtol=0, atol=1e-3)


def test_the_header_in_single_precision_warns_of_coordinates_of_a_map():
    """The path of a boat of 1.2 m was 6 cm off after 4 s at a northing of 7,034 km, and 1 um near the origin."""
    assert np.spacing(np.float32(7e6)) == 0.5
    exported = model(Predictor(Physics(load_vessel("mariner"), 6, 5.0), "alone", Unchanged({}), {}))
    for single in (False, True):
        precision = Precision(single=single)
        for files in (
            predictor_files(exported, "m", precision),
            vessel_files(load_vessel("mariner"), "m", "rk4", precision),
        ):
            assert ("from a point nearby" in files.texts["m.h"]) == single


@pytest.mark.parametrize("observer", [None, Observer()])
def test_the_header_says_that_deviations_of_a_log_are_no_entry(observer):
    """Python widens the noise of the observer by them: the path of a ship of 28.9 m ended 0.4 m elsewhere."""
    predictor = Predictor(Physics(load_vessel("mariner"), 6, 5.0, observer=observer), "alone", Unchanged({}), {})
    header = predictor_files(model(predictor), "m", Precision()).texts["m.h"]
    assert ("std_u, std_v, std_r of a log" in header) == (observer is not None)


def test_states_that_terms_keep_have_units():
    """Before, the header said that the states of radiation and the time of the waves have none."""
    units = VesselParts(load_vessel("gunnerus-28.9-6dof"), "rk4").units()["carry"]
    assert "-" not in units.values()
    kept = ("heave_pitch.w0c", "heave_pitch.q2s", "roll.p1c")
    assert [units[f"radiation.{name}"] for name in kept] == ["m", "rad", "rad"]
    assert [units[f"waves.first_order.{name}"] for name in ("t", "east")] == ["s", "m"]


def test_names_are_those_of_c():
    assert c_name("moderate-3+drawn-N0030-s0") == "moderate_3_drawn_n0030_s0"
    assert c_name("33.9 m") == "m_33_9_m"
    assert c_name("double") == "m_double"
    assert c_name("exp") == "m_exp"  # of the library
    assert c_name("class") == "m_class"  # of C++
    assert c_name("Concept") == "m_concept"  # of C++20
    assert c_name("math") == "m_math"  # math.h would be that of the library
    assert c_name("Ærø") == "r"
    assert c_name("øøø") == "model"


def test_examples_run(tmp_path):
    predictor = Predictor(Physics(load_vessel("mariner"), 6, 5.0), "alone", Unchanged({}), {"u": (0.0, 8.0)})
    text = run_example(predictor_files(model(predictor), "m", Precision()), tmp_path / "a")
    assert "30 s: " in text
    assert "psi" in run_example(vessel_files(load_vessel("mariner"), "m", "rk4", Precision()), tmp_path / "b")


def test_a_comment_holds_what_is_printable_and_nothing_that_ends_it():
    assert comment(["M \u202e */ x\x07"]) == "/*\n * M \\u202e * / x\\x07\n */"


def test_any_text_is_a_string_of_c(tmp_path):
    """Before, a kind of manoeuvre with an emoji or a control character gave C that no compiler takes."""
    texts = ['zig "zag"', "ö ü", "🚢 turn", "a\nb\tc\x07", "what??/ \\ back", "é1", "%d", ""]
    source = f"const char *const texts[] = {{\n    {strings(texts)}}};\n"
    loaded = library(Files("texts", {"texts.c": source}), tmp_path, "-O0", "-trigraphs")
    stored = (ctypes.c_char_p * len(texts)).in_dll(loaded, "texts")
    assert [text.decode() for text in stored] == texts
