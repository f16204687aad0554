"""C99 of predictors and vessels: the same numbers as Python, whatever the predictor."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
import time
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid import observer
from shipid.data.dataset import Dataset, sample_columns
from shipid.data.windows import Instants, past_of_instants
from shipid.engine.casadi import memory_along
from shipid.engine.rollout import rollout
from shipid.export.c import SourceFiles, c_comment, c_name, c_strings
from shipid.export.c_predictor import predictor_files
from shipid.export.c_vessel import vessel_files
from shipid.export.equations import Equations
from shipid.export.known import POSITION_ENTRIES
from shipid.export.model import build_model
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.features import Memory
from shipid.hybrid.physics import Physics
from shipid.observer import AGE_COLUMN, LONGEST_FILTER_STEP, MOST_FILTER_STEPS, Observer, filter_bank, run_observer
from shipid.predictor import Predictor
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.conftest import pace, variety
from tests.drawn_ships import drawn_ship
from tests.export.compiled import (
    SANITIZERS,
    Recorder,
    compile_,
    compiler,
    inputs_of_model,
    library,
    paths,
    pointer,
    run_example,
    sources,
    write,
)
from tests.export.strange import KINDS, bands_of, drawn, remembering

NEAR = 1e-12  # m for each 100 m
INVALID, OUTSIDE, DIVERGED, NO_PAST, TIME = 1, 2, 4, 8, 16
ONE_FILTER = Observer(waves=(0.0,), change=(1.0,))


def with_faults(instants, taken, rng):
    """Instants of which every eighth has an entry that is not finite, every eighth a speed that no ship has."""
    columns = {name: values.copy() for name, values in instants.columns.items()}
    count = len(instants)
    faulty, fast = np.arange(count) % 8 == 0, np.arange(count) % 8 == 1
    for i in np.flatnonzero(faulty):
        columns[str(rng.choice(taken))][i] = rng.choice([np.nan, np.inf, -np.inf])
    columns["u"][fast] = rng.choice([-1.0, 1.0], fast.sum()) * 10 ** rng.uniform(3, 12, fast.sum())
    return replace(instants, columns=columns), faulty, fast


def agrees(strange, folder):
    """Paths, alarms and refusals are those of Python at instants with faults."""
    exported = build_model(strange.predictor)
    loaded = library(predictor_files(exported, "odd"), folder)
    taken = [name for name in exported.layout.now[len(POSITION_ENTRIES) :] if name in strange.instants.columns]
    instants, faulty, fast = with_faults(strange.instants, taken, np.random.default_rng(0))
    computed, _, results = paths(loaded, "odd", exported, instants)
    np.testing.assert_array_equal(results[faulty], INVALID)
    assert np.isnan(computed[:, faulty]).all()
    with np.errstate(all="ignore"):
        outside = strange.predictor.raise_alarm(instants)
    np.testing.assert_array_equal((results & OUTSIDE)[~faulty] > 0, outside[~faulty])
    sound = np.flatnonzero(~(faulty | fast))
    with np.errstate(all="ignore"):
        expected = strange.predictor.predict(instants.select(sound))
    whole = np.isfinite(expected).all(axis=(0, 2))
    np.testing.assert_array_equal((results[sound] & DIVERGED) == 0, whole)
    scale = max(1.0, float(np.abs(expected[:, whole]).max(initial=0.0)) / 100)
    np.testing.assert_allclose(computed[:, sound][:, whole], expected[:, whole], rtol=0, atol=NEAR * scale)


@pytest.mark.parametrize("kind", ["forest", "path-trained", "recurrent"])
def test_a_drawn_predictor_is_that_of_python(kind, tmp_path):
    agrees(drawn(kind, 5, vessel="mariner"), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", KINDS)
def test_every_method_is_that_of_python_on_strange_ships(kind, seed, tmp_path):
    agrees(drawn(kind, seed, count=1000), tmp_path)


def test_faults_in_the_inputs_give_a_result_and_no_path(tmp_path):
    strange = drawn("path-trained", 3, vessel="mariner")
    exported = build_model(strange.predictor)
    loaded = library(predictor_files(exported, "odd"), tmp_path)
    given = {
        key: np.ascontiguousarray(values[0]) for key, values in inputs_of_model(exported, strange.instants).items()
    }
    path, work = np.zeros((exported.layout.horizon, 2)), np.zeros(1_000_000)

    def result(group, place, value):
        faulty = given[group].copy()
        faulty[place] = value
        changed = {**given, group: faulty}
        code = loaded.odd_path(
            *(pointer(changed[key]) for key in exported.layout.sizes), None, pointer(path), None, pointer(work)
        )
        assert code & (OUTSIDE | DIVERGED) or np.isfinite(path).all() == (code == 0)
        return code

    for group in ("now", "past", "planned"):
        for place in range(len(POSITION_ENTRIES), len(given[group]), 7):
            assert {result(group, place, fault) for fault in (np.nan, np.inf, -np.inf)} == {INVALID}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_sanitizers_are_silent(kind, tmp_path):
    plain = (drawn(kind, seed) for seed in range(2, 20))
    strange = next(one for one in plain if one.predictor.physics.observer is None)
    run_example(predictor_files(build_model(strange.predictor), "odd"), tmp_path, *SANITIZERS)


@pytest.mark.slow
def test_a_prediction_is_fast_small_and_allocates_nothing(tmp_path):
    """Below 1 ms; object and working memory below 3 MB, for networks of some thousand weights and an observer."""
    physics = Physics(load_vessel("gunnerus-28.9"), 30, 1.0, observer=Observer())
    dataset = log_of(physics.vessel, 60, np.random.default_rng(1), 1.0)
    estimates = run_observer(physics.vessel, dataset, physics.observer).columns
    t = dataset.frame["t"].to_numpy()
    past = past_of_instants(dataset.frame, t, 10, 1.0, "position")
    predictor = remembering(physics, Memory(error=(10.0,), observer=True),
                            Instants(sample_columns(dataset.frame, t), past, None, None, estimates))  # fmt: skip
    recorder = Recorder(predictor, tmp_path)
    loaded = library(recorder.files, tmp_path / "fast", "-O1")
    recorder.follow(dataset.frame)
    path, begun = np.zeros((30, 2)), time.process_time()
    for _ in range(100):
        assert loaded.odd_predict(pointer(recorder.kept), None, None, pointer(path), None) == 0
    assert time.process_time() - begun < 0.1
    objects = tmp_path / "fast" / "odd_casadi.o"
    assert objects.stat().st_size + len(recorder.kept) < 3e6
    calls = subprocess.run(["nm", "-u", objects, tmp_path / "fast" / "model.so"], capture_output=True, text=True)
    assert not re.search("alloc", calls.stdout)


def log_of(vessel, seconds, rng, interval):
    """A run with orders that change, at uneven times; its heading goes on beyond pi."""
    slow, commands = pace(vessel), vessel_dynamics(vessel).commands
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


def columns_of(frame):
    return {name: frame[name].to_numpy() for name in frame if name not in ("run", "flags")}


def reached_in(vessel, frame):
    """Positions of the actuators along a log that begins with its first row."""
    return memory_along(
        vessel, {name: frame[name].to_numpy() for name in vessel_dynamics(vessel).commands}, frame["t"].to_numpy()
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("velocity", "longest"), [(False, LONGEST_FILTER_STEP), (True, LONGEST_FILTER_STEP), (False, 0.1)]
)
def test_a_recorder_knows_what_python_takes_from_a_log(velocity, longest, tmp_path, monkeypatch):
    """Past, actuators and estimates of the observer, row by row, at uneven times; also by parts of them."""
    monkeypatch.setattr(observer, "LONGEST_FILTER_STEP", longest)
    vessel = variety()["actuators"]
    dataset = log_of(vessel, 25, np.random.default_rng(1), 0.5)
    physics = Physics(vessel, 8, 1.0, "euler", Observer(), "velocity" if velocity else "position")
    rows, t = dataset.frame, dataset.frame["t"].to_numpy()
    estimates = run_observer(vessel, dataset, physics.observer)
    late = np.flatnonzero(t > t[0] + 4.0)
    hidden = {name: values[late] for name, values in reached_in(vessel, rows).items()}
    past = past_of_instants(rows, t[late], 4, 1.0, physics.path)
    seen = {name: values[late] for name, values in estimates.columns.items()}
    instants = Instants(sample_columns(rows, t[late]), past, None, hidden, seen)
    memory = Memory(history=(2.0, 3.0), turned=(4.0,), positions=(1.0, 4.0), error=(3.0,), observer=True)
    bands = bands_of(np.random.default_rng(1), physics, instants, ("u",), 1.0)
    predictor = remembering(physics, memory, instants, limits={"u": (0.0, 9.0)}, bands=bands, run_up=9.0)
    recorder, predicted, alarms = Recorder(predictor, tmp_path), [], []
    assert recorder.predict()[1] == NO_PAST
    for row in rows.to_dict("records"):
        at = row["t"]
        row["psi"] = (row["psi"] + np.pi) % (2 * np.pi) - np.pi
        path, result = recorder.path(at, row)
        assert recorder.record(at, row) == TIME
        assert recorder.record(at + 0.1, row | {"u": np.nan}) == INVALID
        assert result == (NO_PAST if at < t[0] + 4.0 - 1e-9 else 0 if at >= t[0] + 9.0 - 1e-9 else OUTSIDE)
        if at > t[0] + 4.0:
            predicted.append(path)
            alarms.append(result == OUTSIDE)
    expected = predictor.predict(instants, level=0.5)
    np.testing.assert_allclose(np.stack(predicted, axis=1), expected.paths, rtol=0, atol=1e-10)  # filters amplify
    np.testing.assert_array_equal(alarms, expected.outside)


@pytest.mark.parametrize("interval", [0.01, 0.1])
def test_rows_may_come_as_often_as_they_like(interval, tmp_path):
    """A past of many steps is long enough where rows come ten times and more in a step."""
    physics = Physics(variety()["gunnerus-28.9"], 3, 1.0)
    slow = log_of(physics.vessel, 16, np.random.default_rng(1), 1.0).frame
    t = slow["t"].iloc[0] + interval * np.arange(round(13 / interval))
    log = pd.DataFrame({**sample_columns(slow, t), "t": t, "run": "a"})
    instants = Instants(sample_columns(log, t[-1:]), past_of_instants(log, t[-1:], 10, 1.0, "position"))
    predictor = remembering(physics, Memory(history=(1.0, 10.0), error=(10.0,)), instants)
    found, _ = Recorder(predictor, tmp_path).follow(log)
    np.testing.assert_allclose(found[:, -1], predictor.predict(instants)[:, 0], rtol=0, atol=1e-9)


def test_a_row_just_after_an_instant_of_the_past_is_not_taken_for_it(tmp_path):
    """Its orders are in force, as for a row that is only rounding away; its motion is of its own time."""
    vessel, t = variety()["actuators"], np.array([0.0, 0.4, 1.0 + 5e-5, 2.0, 3.0])
    log = log_of(vessel, 5, np.random.default_rng(1), 1.0).frame.assign(t=t, u=[1.0, 5.0, 2.0, 3.0, 3.0])
    hidden = {name: values[-1:] for name, values in reached_in(vessel, log).items()}
    instants = Instants(sample_columns(log, t[-1:]), past_of_instants(log, t[-1:], 2, 1.0, "position"), None, hidden)
    predictor = remembering(Physics(vessel, 3, 1.0), Memory(history=(1.0, 2.0), error=(1.0,)), instants)
    found, _ = Recorder(predictor, tmp_path).follow(log)
    np.testing.assert_allclose(found[:, -1], predictor.predict(instants)[:, 0], rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("t", "first"),
    [
        (np.r_[:7, 7.0], 1),  # rows four steps apart are no pauses; of the first interval nobody knows that it is usual
        (np.r_[:7, 8.9], 1),
        (np.r_[:7, 9.2], 7),
        (np.r_[0:4, 3.25 + np.arange(10.0)], 8),  # two rows came together once: 3 x 0.25 x 1.1^3 < 1 < 3 x 0.25 x 1.1^4
    ],
)
def test_actuators_go_on_over_what_is_no_pause(t, first, tmp_path):
    vessel = variety()["actuators"]
    predictor = Predictor(Physics(vessel, 20, 0.25), "alone", UnchangedPath({}), {"u": (-9.0, 9.0)})
    log = log_of(vessel, 16, np.random.default_rng(5), 1.0).frame.iloc[: len(t)].assign(t=t.astype(float))
    hidden = {name: values[-1:] for name, values in reached_in(vessel, log.iloc[first:]).items()}
    columns = {name: values[-1:] for name, values in columns_of(log).items()}
    found, _ = Recorder(predictor, tmp_path).follow(log)
    np.testing.assert_allclose(
        found[:, -1], predictor.predict(Instants(columns, hidden=hidden))[:, 0], rtol=0, atol=1e-11
    )


def test_a_recorder_observes_without_the_force_that_was_learned(tmp_path):
    """As in Python: the observer is that of the physics, to which the method adds its force afterwards."""
    vessel = variety()["gunnerus-28.9"]
    dataset = log_of(vessel, 8, np.random.default_rng(3), 1.0)
    corrector = drawn("learned-force", 1, vessel="gunnerus-28.9").predictor.corrector
    physics = Physics(vessel, 5, 1.0, "euler", ONE_FILTER)
    predictor = Predictor(physics, "learned-force", corrector, {"u": (-9.0, 9.0)})
    columns, estimates = columns_of(dataset.frame), run_observer(vessel, dataset, physics.observer).columns
    found, _ = Recorder(predictor, tmp_path).follow(dataset.frame)
    np.testing.assert_allclose(found, predictor.predict(Instants(columns, estimates=estimates)), rtol=0, atol=1e-10)


@pytest.mark.parametrize("step", [0.4, pytest.param(5.0, marks=pytest.mark.slow)])
def test_after_a_pause_an_observer_begins_anew_aboard_and_in_python(step, tmp_path):
    """Row by row over drawn logs with pauses, those after which the past alone begins anew aboard among them."""
    vessel = variety()["actuators"]
    pause, anew = filter_bank(vessel, ONE_FILTER).pause, 0
    physics = Physics(vessel, 5, step, "rk4", ONE_FILTER)
    predictor = Predictor(physics, "alone", UnchangedPath({}), {"u": (-99.0, 99.0)}, run_up=3.0)
    recorder = Recorder(predictor, tmp_path)
    for seed, every in enumerate((0.3, 1.0, 4.0, 15.0)):
        rng = np.random.default_rng(seed)
        frame = log_of(vessel, 30 * every, rng, every).frame
        for place in rng.integers(1, len(frame), 6):
            frame.loc[place:, "t"] += rng.choice([2.0, 4.0, 0.9 * pause, 1.1 * pause, 60.0])
        t, least, begins = frame["t"].to_numpy(), np.inf, [False]
        for apart in np.diff(t):
            begins.append(apart > pause and (not np.isfinite(least) or apart > 3 * least))
            least = min(1.1 * least, apart)
        anew += sum(begins)
        parts = np.split(np.arange(len(t)), np.flatnonzero(begins))
        along = [reached_in(vessel, frame.iloc[part]) for part in parts]
        hidden = {name: np.concatenate([each[name] for each in along]) for name in along[0]}
        estimates = run_observer(vessel, Dataset(frame, {"clock": "run"}), ONE_FILTER).columns
        begun = np.repeat([t[part[0]] for part in parts], list(map(len, parts)))
        np.testing.assert_allclose(estimates[AGE_COLUMN], t - begun, atol=1e-9)
        found, results = recorder.follow(frame)
        expected = predictor.predict(Instants(columns_of(frame), hidden=hidden, estimates=estimates))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(results, np.where(t - begun < 3, OUTSIDE, 0))
    assert 5 < anew < 30


def test_an_observer_begins_anew_after_rows_as_far_apart_as_python_refuses(tmp_path):
    """A clock in micro- or nanoseconds: else a row would take minutes, or would never end."""
    vessel = variety()["gunnerus-28.9"]
    physics = Physics(vessel, 5, 1.0, "rk4", ONE_FILTER)
    predictor = Predictor(physics, "alone", UnchangedPath({}), {"u": (-99.0, 99.0)}, run_up=3.0)
    recorder, limit = Recorder(predictor, tmp_path), MOST_FILTER_STEPS * filter_bank(vessel, ONE_FILTER).longest
    assert f"after {limit:.4g} s, pause or not." in recorder.files.texts["odd.h"]
    for apart, result in ((0.99 * limit, 0), (1.01 * limit, OUTSIDE), (1e9, OUTSIDE)):
        recorder.begin()
        for i in range(4):
            path, code = recorder.path(i * apart, {})
        assert code == result
        assert np.isfinite(path).all()


def test_fast_math_is_refused_at_compilation(tmp_path):
    """It takes out isfinite: a row of NaN was kept, with result 0."""
    write(vessel_files(load_vessel("mariner"), "odd", "rk4"), tmp_path)
    command = [compiler(), "-std=c99", "-O2", "-ffast-math", "-c", "odd.c"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode != 0
    assert "compile without -ffast-math" in result.stderr


@pytest.mark.parametrize("program", ["gcc", "clang"])
def test_no_compiler_warns_of_a_conversion(program, tmp_path):
    if shutil.which(program) is None:
        pytest.skip(f"no {program}")
    for files in (
        vessel_files(drawn_ship(100, 4), "odd", "rk4"),
        predictor_files(build_model(drawn("recurrent", 100).predictor), "odd"),
    ):
        options = ("-O0", "-Wsign-conversion", "-o", "example", "main.c")
        compile_([program], write(files, tmp_path), *options, *sources(files))


def test_a_ship_without_orders_compiles_without_a_warning(tmp_path):
    vessel = variety()["mariner"]
    adrift = vessel.with_values({f"thruster.{name}.off": True for name in vessel.document["thruster"]})
    predictor = Predictor(Physics(adrift, 3, 1.0, observer=Observer()), "alone", UnchangedPath({}))
    library(predictor_files(build_model(predictor), "odd"), tmp_path)


@pytest.mark.parametrize("name", ["actuators"])
def test_a_vessel_steps_as_in_python(name, tmp_path, draw_inputs):
    _steps(variety()[name], tmp_path, draw_inputs)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(variety()))
def test_every_vessel_steps_as_in_python(name, tmp_path, draw_inputs):
    _steps(variety()[name], tmp_path, draw_inputs)
    run_example(vessel_files(variety()[name], "ship", "rk4"), tmp_path / "example", *SANITIZERS)


def _steps(vessel, folder, draw_inputs):
    """Sixty seconds in steps of a tenth, with loads, from drawn states."""
    equations, slow, steps = Equations(vessel), pace(vessel), 60
    drawn_ = draw_inputs(vessel, 3)
    loads = 1e-3 * float(vessel.document["inertia"]["m"]) * np.ones(equations.model.num_dof)
    loaded = library(vessel_files(vessel, "ship", "rk4"), folder)
    loaded.ship_step.argtypes = [*[ctypes.c_void_p] * 5, ctypes.c_double]
    expected = rollout(
        vessel, drawn_["start"], drawn_["commands"], drawn_["environment"], step=0.1 * slow, num_steps=steps,
        method="rk4", tau_extra=loads, engine="native",
    )  # fmt: skip
    names, values = equations.model.state, np.array(list(vessel.parameters.values()))
    for i in range(3):
        carry = np.zeros(len(equations.groups["carry"]))
        carry[: len(names)] = [drawn_["start"][name][i] for name in names]
        groups = [np.array([drawn_[key][name][i] for name in getattr(equations.model, key)] + [0.0])
                  for key in ("commands", "environment")]  # fmt: skip
        loaded.ship_begin(pointer(carry), pointer(groups[0]), pointer(values))
        given = [pointer(array) for array in (carry, *groups, loads, values)]
        before = carry.copy()
        assert [loaded.ship_step(*given, dt) for dt in (0.0, float("nan"))] == [2, 1]
        for name in vessel.above_zero:
            faulty = values * (np.array(list(vessel.parameters)) != name)
            assert loaded.ship_step(*given[:-1], pointer(faulty), 0.1 * slow) == 8
        np.testing.assert_array_equal(carry, before)
        results = [loaded.ship_step(*given, 0.1 * slow) for _ in range(steps)]
        assert any(results) == bool(expected.diverged[0, i])
        if not any(results):
            last = [expected[name][-1, 0, i] for name in names]
            np.testing.assert_allclose(carry[: len(names)], last, rtol=1e-12, atol=1e-12)


def test_states_that_terms_keep_have_units():
    units = Equations(load_vessel("gunnerus-28.9-6dof")).groups["carry"]
    assert "-" not in units.values()
    kept = ("heave_pitch.w0c", "heave_pitch.q2s", "roll.p1c")
    assert [units[f"radiation.{name}"] for name in kept] == ["m", "rad", "rad"]
    assert [units[f"waves.first_order.{name}"] for name in ("t", "east")] == ["s", "m"]


def test_names_are_those_of_c():
    given = {"moderate-3+drawn-N0030-s0": "moderate_3_drawn_n0030_s0", "33.9 m": "m_33_9_m", "Ærø": "r", "øøø": "model"}
    given |= {word: f"m_{word}" for word in ("main", "math", "casadi_x")} | {"double": "double"}
    assert {name: c_name(name) for name in given} == given


def test_examples_run_and_end_with_the_result_of_a_row_that_is_refused(tmp_path):
    predictor = Predictor(Physics(load_vessel("mariner"), 6, 5.0), "alone", UnchangedPath({}), {"u": (0.0, 8.0)})
    files = predictor_files(build_model(predictor), "m")
    assert "30 s: " in run_example(files, tmp_path / "a")
    assert "psi" in run_example(vessel_files(load_vessel("mariner"), "m", "rk4"), tmp_path / "b")
    broken = files.texts["main.c"].replace("[m_NUM_ROW] = {0}", "[m_NUM_ROW] = {0.0 / 0.0}")
    write(replace(files, texts={**files.texts, "main.c": broken}), tmp_path)
    compile_([compiler()], tmp_path, "-O0", "-o", "example", "main.c", *sources(files))
    result = subprocess.run([tmp_path / "example"], capture_output=True, text=True)
    assert (result.returncode, result.stdout) == (INVALID, f"row 0 is refused: result {INVALID}\n")


def test_a_comment_holds_what_is_printable_and_nothing_that_ends_it():
    assert c_comment(["M \u202e */ x\x07"]) == "/*\n * M \\u202e * / x\\x07\n */"


def test_any_text_is_a_string_of_c(tmp_path):
    texts = ['zig "zag"', "ö ü", "🚢 turn", "a\nb\tc\x07", "what??/ \\ back", "é1", "%d", ""]
    source = f"const char *const texts[] = {{\n    {c_strings(texts)}}};\n"
    loaded = library(SourceFiles("texts", {"texts.c": source}), tmp_path, "-O0", "-trigraphs")
    stored = (ctypes.c_char_p * len(texts)).in_dll(loaded, "texts")
    assert [text.decode() for text in stored] == texts
