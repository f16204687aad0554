"""Bands in C and in CasADi: those of Python, and none where none can be promised."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.errors import DataError
from shipid.export.c_predictor import predictor_files
from shipid.export.model import BAND_CHOICE, band_rows, build_model, half_axes_at
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.bands import Region
from shipid.hybrid.features import NO_MEMORY, Inputs
from shipid.hybrid.novelty import alarm_inputs, calibrate_alarm
from shipid.hybrid.physics import Physics
from shipid.predictor import Predictor
from shipid.vessel.load import load_vessel
from tests.export.compiled import Recorder, library, paths, pointer
from tests.export.strange import KINDS, drawn

NEAR = 1e-10
OUTSIDE, DIVERGED, NO_BAND = 2, 4, 32
ASKED = [(level, pointwise, kind) for level in (0.005, 0.3, 0.5, 0.777, 0.9, 0.95, 0.99) for pointwise in (0, 1)
         for kind in ((0, 1, 2) if not pointwise else (0,))]  # fmt: skip


def rows_of(region: Region) -> np.ndarray:
    return np.concatenate([region.along[..., None], region.across[..., None], region.ahead], axis=-1)


def expected(predictor, instants, path, level, pointwise, kind):
    """Rows of the band by Python; None where Python promises none."""
    name = None if not kind else ([*predictor.bands.kinds, "none", "none"])[kind - 1]
    try:
        return rows_of(predictor.band(path, instants, level, pointwise=bool(pointwise), kind=name))
    except DataError:
        return None


def agrees(predictor, instants, folder):
    """Half axes and directions of C are those of Python for every level; how many bands there were."""
    exported, count = build_model(predictor), 0
    loaded = library(predictor_files(exported, "odd"), folder)
    outside = np.where(predictor.raise_alarm(instants), OUTSIDE, 0)
    for asked in ASKED:
        path, computed, results = paths(loaded, "odd", exported, instants, *asked)
        whole = np.isfinite(path).all(axis=(0, 2))
        assert (results[~whole] == outside[~whole] + DIVERGED + NO_BAND).all()
        assert np.isnan(computed[:, ~whole]).all()
        right = expected(predictor, instants, path, *asked)
        if right is None:
            assert (results[whole] == outside[whole] + NO_BAND).all()
            assert np.isnan(computed).all()
            continue
        count += 1
        assert (results[whole] == outside[whole]).all()
        np.testing.assert_allclose(computed[:, whole, :2], right[:, whole, :2], rtol=NEAR, atol=0)
        np.testing.assert_allclose(computed[:, whole, 2:], right[:, whole, 2:], rtol=0, atol=NEAR)
    return count


def test_a_drawn_predictor_has_the_band_of_python(tmp_path):
    strange = drawn("path-trained", 5, vessel="mariner")
    assert agrees(strange.predictor, strange.instants, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_method_has_the_band_of_python(kind, tmp_path):
    strange = drawn(kind, 20, count=40)
    assert agrees(strange.predictor, strange.instants, tmp_path)


@pytest.mark.parametrize("seed", range(3))
def test_a_graph_of_the_band_is_the_arithmetic_of_python(seed):
    """Any path: at rest, back and forth, of one step; instants at points of training and far from them."""
    rng = np.random.default_rng(seed)
    strange = drawn("alone", seed, count=12, vessel="mariner")
    predictor, instants, horizon = strange.predictor, strange.instants, int(rng.integers(1, 20))
    bands_ = predictor.bands
    steps = np.cumsum(rng.exponential(0.1, (99, horizon)), axis=0)
    scale = rng.uniform(0.1, 3, (2, horizon))
    scales = rng.uniform(0.1, 3, (len(bands_.kinds), horizon, 2))
    bands_ = replace(bands_, runs=200, along=scale[0], across=scale[1], steps=steps, scales=scales)
    path = np.cumsum(rng.normal(0, 10.0 ** rng.integers(-3, 3), (horizon, 12, 2)), axis=0)
    path[:, 0] = 0
    path[horizon // 2 :, 1] = path[horizon // 2, 1]
    path[1::2, 2] = 0
    now = build_model(predictor).layout.now
    columns = {name: values * np.where(np.arange(12) % 4 == 3, 30.0, 1.0) for name, values in instants.columns.items()}
    given = np.stack([columns.get(name, np.zeros(12)) for name in now], axis=1)
    place = {name: ca.MX.sym(name) for name in now}
    shape, choice = ca.MX.sym("path", 2, horizon), [ca.MX.sym(name) for name in BAND_CHOICE]
    rows = band_rows(bands_, place, shape, 2.0, half_axes_at(bands_, *choice))
    function = ca.Function("band", [ca.vertcat(*place.values()), shape, *choice], [rows])
    for level, pointwise in ((0.005, False), (0.4, True), (0.905, False), (0.99, True)):
        right = rows_of(bands_.region(path, columns, 2.0, level, pointwise=pointwise))
        for i in range(12):
            computed = np.array(function(given[i], path[:, i].T, level, pointwise, 0)).T
            np.testing.assert_allclose(computed[:, :2], right[:, i, :2], rtol=NEAR, atol=0)
            np.testing.assert_allclose(computed[:, 2:], right[:, i, 2:], rtol=0, atol=NEAR)


def test_faults_give_a_result_and_no_band(tmp_path):
    strange = drawn("alone", 6, count=4, vessel="mariner")
    predictor = replace(
        strange.predictor, bands=replace(strange.predictor.bands, runs=10), limits={"u": (-1e9, 1e9)}, alarm=None
    )
    exported = build_model(predictor)
    loaded = library(predictor_files(exported, "odd"), tmp_path)

    def result(level=0.9, pointwise=0, kind=0, **changed):
        instants = replace(strange.instants, columns={**strange.instants.columns, **changed})
        _, computed, results = paths(loaded, "odd", exported, instants, level, pointwise, kind)
        assert np.isnan(computed[:, results > 0]).all()
        assert np.isfinite(computed[:, results == 0]).all()
        return set(results)

    assert result() == {0}
    for level in (0.0, -0.1, 0.991, 1.0, 2.0, np.nan, np.inf, -np.inf, 0.95):
        assert result(level=level) == {NO_BAND}
    for kind in (-1, 9, 2**30, -(2**31)):
        assert result(kind=kind) == {NO_BAND}
    assert result(pointwise=1, kind=1) == {NO_BAND}
    for fault in (np.nan, np.inf, -np.inf):
        assert result(r=np.full(4, fault)) == {1}


def test_without_bands_none_is_promised(tmp_path):
    predictor = Predictor(
        Physics(load_vessel("mariner"), 3, 5.0), "alone", UnchangedPath({}), {}, {"no_band": "too few"}
    )
    recorder = Recorder(predictor, tmp_path)
    assert "No band: too few." in recorder.files.texts["odd.h"]
    recorder.record(0.0, {"u": 4.0})
    path, band = np.zeros((3, 2)), np.zeros((3, 4))
    given = pointer(recorder.kept), None, pointer(np.array([0.9, 0.0, 0.0])), pointer(path), pointer(band)
    assert recorder.loaded.odd_predict(*given) == OUTSIDE + NO_BAND
    assert np.isfinite(path).all()
    assert np.isnan(band).all()


def test_the_recorder_gives_path_and_band(tmp_path):
    """From rows alone; a ship of which nothing is known has no band."""
    strange = drawn("alone", 6, count=4, vessel="mariner")
    predictor = replace(strange.predictor, bands=replace(strange.predictor.bands, runs=10), commands="held", alarm=None)
    recorder, columns = Recorder(predictor, tmp_path), strange.instants.columns
    path, band = (np.zeros((predictor.physics.horizon, size)) for size in (2, 4))

    def result(level):
        choice = np.array([level, 0.0, 0.0])
        return recorder.loaded.odd_predict(pointer(recorder.kept), None, pointer(choice), pointer(path), pointer(band))

    assert result(0.9) == 8
    assert np.isnan(band).all()
    recorder.record(0.0, {name: values[0] for name, values in columns.items()})
    held = {name: columns[name][:1] for name in recorder.model.layout.reached}
    right = predictor.predict(Instants({name: values[:1] for name, values in columns.items()}, hidden=held), level=0.9)
    assert result(0.9) == OUTSIDE * int(right.outside[0])
    np.testing.assert_allclose(path, right.paths[:, 0], rtol=0, atol=1e-11)
    np.testing.assert_allclose(band[:, :2], rows_of(right.region)[:, 0, :2], rtol=NEAR)
    assert result(0.95) == OUTSIDE * int(right.outside[0]) + NO_BAND
    assert np.isfinite(path).all()
    assert np.isnan(band).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_alarm_of_a_graph_is_raised_as_in_python_also_by_what_is_no_number(seed):
    """Drawn alarms; a fault in an order now or before, in an input that was constant, or in one that varied."""
    rng = np.random.default_rng(seed)
    table = {name: rng.normal(size=40) for name in ("u", "a.n", "a.range.n")} | {"calm": np.zeros(40)}
    run = np.array([f"M{i % 5}" for i in range(40)])
    alarm = calibrate_alarm(Inputs(("a.n",), NO_MEMORY), 1, table | {"a.range.n": np.abs(table["a.range.n"])}, run)
    symbols = before, now, u, calm = [ca.MX.sym(name) for name in ("before", "now", "u", "calm")]
    columns = {name: ca.ArrayInterface.MX(one, shape=(1,)) for name, one in (("u", u), ("a.n", now), ("calm", calm))}
    instants = Instants({**columns, "v": columns["u"], "r": columns["u"]}, {"a.n": ca.ArrayInterface(before)})
    seen = alarm_inputs(Inputs(("a.n",), NO_MEMORY), 1, Physics(None, 1, 1.0), instants) | columns
    graph = ca.Function("alarm", symbols, [ca.MX(alarm.is_raised(seen))])
    given = rng.normal(size=(60, 4)) * [2, 2, 2, 0]
    given[np.arange(32), np.arange(32) % 4] = np.repeat([np.nan, np.inf, 0.1, 9.0], 8)
    with np.errstate(invalid="ignore"):
        right = alarm.is_raised(
            {"u": given[:, 2], "a.n": given[:, 1], "calm": given[:, 3], "a.range.n": np.ptp(given[:, :2], axis=1)}
        )
    assert [bool(graph(*row)) for row in given] == right.tolist()
    assert 0 < right[32:].mean() < 1


def test_a_band_of_known_commands_is_not_promised_where_they_stay(tmp_path):
    strange = drawn("alone", 6, count=4, vessel="mariner")
    bands = replace(strange.predictor.bands, runs=10)
    recorder = Recorder(replace(strange.predictor, bands=bands, commands="known", alarm=None), tmp_path)
    columns, layout = strange.instants.columns, recorder.model.layout
    recorder.record(0.0, {name: values[0] for name, values in columns.items()})
    plan = np.array([[columns[name][0] for name in layout.planned]] * layout.horizon)
    made = {}
    for words, given in (("stay", None), ("known", pointer(plan))):
        path, band = (np.zeros((layout.horizon, size)) for size in (2, 4))
        choice = pointer(np.array([0.9, 0.0, 0.0]))
        asked = pointer(recorder.kept), given, choice, pointer(path), pointer(band)
        made[words] = recorder.loaded.odd_predict(*asked) & NO_BAND, path, np.isfinite(band).all()
    assert [(result, whole) for result, _, whole in made.values()] == [(NO_BAND, False), (0, True)]
    np.testing.assert_array_equal(made["stay"][1], made["known"][1])
