"""Bands in C and in CasADi: those of Python, and none where none can be promised."""

from __future__ import annotations

import ctypes
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.errors import DataError
from shipid.export.band import band_graph, radii
from shipid.export.c import Precision
from shipid.export.c_predictor import predictor_files
from shipid.export.model import model
from shipid.hybrid.alone import Unchanged
from shipid.hybrid.bands import Region, adapted, adaptive, factor
from shipid.hybrid.physics import Physics
from shipid.predictor import Predictor
from shipid.vessel.load import load_vessel
from tests.export.compiled import bands, library, pointer, run_example
from tests.export.strange import KINDS, drawn

NEAR = 1e-10
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
    exported, count = model(predictor), 0
    loaded = library(predictor_files(exported, "odd", Precision()), folder)
    with np.errstate(all="ignore"):
        path = predictor.predict(instants)
    whole = np.isfinite(path).all(axis=(0, 2))
    for asked in ASKED:
        computed, results = bands(loaded, "odd", exported, instants, path, *asked)
        assert (results[~whole] == 4).all()
        assert np.isnan(computed[:, ~whole]).all()
        right = expected(predictor, instants, path, *asked)
        if right is None:
            assert (results[whole] == 32).all()
            assert np.isnan(computed).all()
            continue
        count += 1
        assert (results[whole] == 0).all()
        np.testing.assert_allclose(computed[:, whole, :2], right[:, whole, :2], rtol=NEAR, atol=0)
        np.testing.assert_allclose(computed[:, whole, 2:], right[:, whole, 2:], rtol=0, atol=NEAR)
    return count


@pytest.mark.slow
def test_a_drawn_predictor_has_the_band_of_python(tmp_path):
    strange = drawn("path-drawn", 5, vessel="mariner")
    assert agrees(strange.predictor, strange.instants, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_method_has_the_band_of_python(kind, tmp_path):
    strange = drawn(kind, 20, count=40)
    assert agrees(strange.predictor, strange.instants, tmp_path)


@pytest.mark.parametrize("seed", range(12))
def test_a_graph_of_the_band_is_the_arithmetic_of_python(seed):
    """Any path: at rest, back and forth, of one step; instants at points of training and far from them."""
    rng = np.random.default_rng(seed)
    strange = drawn("alone", seed, count=12, vessel="mariner")
    predictor, instants, horizon = strange.predictor, strange.instants, int(rng.integers(1, 20))
    bands_ = predictor.bands
    steps = np.cumsum(rng.exponential(0.1, (99, horizon)), axis=0)
    scale = rng.uniform(0.1, 3, (2, horizon))
    bands_ = replace(bands_, runs=200, along=scale[0], across=scale[1], steps=steps)
    path = np.cumsum(rng.normal(0, 10.0 ** rng.integers(-3, 3), (horizon, 12, 2)), axis=0)
    path[:, 0] = 0
    path[horizon // 2 :, 1] = path[horizon // 2, 1]
    path[1::2, 2] = 0
    now = model(predictor).layout.now
    columns = {name: values * np.where(np.arange(12) % 4 == 3, 30.0, 1.0) for name, values in instants.columns.items()}
    given = np.stack([columns.get(name, np.zeros(12)) for name in now], axis=1)
    function = band_graph(bands_, now, 2.0, radii(bands_)).function
    for level, pointwise in ((0.005, False), (0.4, True), (0.905, False), (0.99, True)):
        right = rows_of(bands_.region(path, columns, 2.0, level, pointwise=pointwise))
        for i in range(12):
            computed = np.array(function(given[i], path[:, i].ravel(), level, pointwise, 0)).reshape(horizon, 4)
            np.testing.assert_allclose(computed[:, :2], right[:, i, :2], rtol=NEAR, atol=0)
            np.testing.assert_allclose(computed[:, 2:], right[:, i, 2:], rtol=0, atol=NEAR)


def test_faults_give_a_result_and_no_band(tmp_path):
    strange = drawn("alone", 6, count=4, vessel="mariner")
    predictor = replace(strange.predictor, bands=replace(strange.predictor.bands, runs=10))
    exported, path = model(predictor), strange.predictor.predict(strange.instants)
    loaded = library(predictor_files(exported, "odd", Precision()), tmp_path)

    def result(path=path, level=0.9, pointwise=0, kind=0, **changed):
        instants = replace(strange.instants, columns={**strange.instants.columns, **changed})
        computed, results = bands(loaded, "odd", exported, instants, path, level, pointwise, kind)
        assert np.isnan(computed[:, results > 0]).all()
        assert np.isfinite(computed[:, results == 0]).all()
        return set(results)

    assert result() == {0}
    for level in (0.0, -0.1, 0.991, 1.0, 2.0, np.nan, np.inf, -np.inf, 0.95):
        assert result(level=level) == {32}
    for kind in (-1, 9, 2**30, -(2**31)):
        assert result(kind=kind) == {32}
    assert result(pointwise=1, kind=1) == {32}
    for fault in (np.nan, np.inf, -np.inf):
        assert result(r=np.full(4, fault)) == {1}
        assert result(path=np.full_like(path, fault)) == {4}
    assert result(u=np.full(4, 1e300)) <= {0, 32}


def test_a_band_adapts_as_in_python(tmp_path):
    rng = np.random.default_rng(0)
    strange = drawn("alone", 6, vessel="mariner")
    table = strange.predictor.bands
    loaded = library(predictor_files(model(strange.predictor), "odd", Precision()), tmp_path)
    for name, kinds in (("odd_adapted", "dddi"), ("odd_factor", "ddi")):
        function = getattr(loaded, name)
        function.argtypes = [ctypes.c_double if kind == "d" else ctypes.c_int for kind in kinds]
        function.restype = ctypes.c_double
    for level, rate, share in ((0.9, 0.02, 0.1), (0.5, 0.3, 0.9), (0.99, 0.05, 0.0), (0.3, 0.2, 1.0)):
        state, miss = adaptive(level, rate), 1 - level
        for missed in rng.random(60) < share:
            state, miss = adapted(state, bool(missed)), loaded.odd_adapted(miss, level, rate, int(missed))
            assert miss == pytest.approx(state.miss, rel=1e-12, abs=1e-14)
            for kind, radius in enumerate((table.whole, *table.by_kind)):
                assert loaded.odd_factor(miss, level, kind) == pytest.approx(factor(state, radius), rel=1e-9)
    for wrong in ((0.1, 0.9, 9), (np.nan, 0.9, 0), (np.inf, 0.9, 0), (0.1, np.nan, 0), (0.1, 0.0, 0), (0.1, 1.5, 0)):
        assert np.isnan(loaded.odd_factor(*wrong))


def test_casadi_gives_path_and_band(tmp_path):
    strange = drawn("path-drawn", 5, count=4, vessel="mariner")
    predictor = replace(strange.predictor, bands=replace(strange.predictor.bands, runs=10))
    files = predictor.export("casadi", tmp_path / "ship.casadi")
    assert [file.name for file in files[2:]] == ["ship-band.casadi", "ship-band.casadi.json"]
    path, band = (ca.Function.load(str(file)) for file in (files[0], files[2]))
    given = model(predictor).inputs(strange.instants)
    for level, pointwise in ((0.9, False), (0.6, True)):
        right = predictor.predict(strange.instants, level=level, pointwise=pointwise)
        for i in range(4):
            entry = {key: values[i] for key, values in given.items()}
            ahead = path(**entry)["path"]
            output = band(now=entry["now"], path=ahead, level=level, pointwise=pointwise)
            assert output["promised"] == 1
            np.testing.assert_allclose(np.array(ahead).T, right.paths[:, i], rtol=0, atol=1e-11)
            for name in ("along", "across"):
                axis = getattr(right.region, name)[:, i]
                np.testing.assert_allclose(np.array(output[name]).ravel(), axis, rtol=NEAR, atol=0)
            np.testing.assert_allclose(np.array(output["ahead"]).T, right.region.ahead[:, i], rtol=0, atol=NEAR)
    for asked in (
        {"level": 0.95},
        {"level": 0.0},
        {"level": 0.5, "kind": 9},
        {"level": 0.5, "pointwise": 1, "kind": 1},
    ):
        refused = band(now=entry["now"], path=ahead, **asked)
        assert refused["promised"] == 0
        assert np.isnan(np.array(refused["along"])).all()


def test_no_bands_leave_no_trace(tmp_path):
    predictor = Predictor(Physics(load_vessel("mariner"), 3, 5.0), "alone", Unchanged({}), {}, {"no_band": "too few"})
    files = predictor_files(model(predictor), "m", Precision())
    assert "No band: too few." in files.texts["m.h"]
    assert "m_band" not in files.texts["m.c"]
    assert len(predictor.export("casadi", tmp_path / "m.casadi")) == 2


def test_the_tables_of_a_band_are_interpolated_in_c_alone():
    """C of the radii names each table once."""
    strange = drawn("alone", 6, vessel="mariner")
    text, _ = c_functions([radii(strange.predictor.bands)], Precision())
    assert text.count("static const real") == 2


def test_the_recorder_gives_path_and_band(tmp_path):
    """From rows alone; a ship of which nothing is known has no band, and the example shows one."""
    strange = drawn("alone", 6, count=4, vessel="mariner")
    predictor = replace(strange.predictor, bands=replace(strange.predictor.bands, runs=10), commands="held")
    exported = model(predictor)
    files = predictor_files(exported, "odd", Precision())
    loaded, horizon = library(files, tmp_path), exported.layout.horizon
    loaded.odd_record.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
    around = [ctypes.c_double, ctypes.c_int, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p]
    loaded.odd_predict_band.argtypes = [ctypes.c_void_p, ctypes.c_void_p, *around]
    kept, path, band = np.zeros(1_000_000), np.zeros((horizon, 2)), np.zeros((horizon, 4))
    loaded.odd_init(pointer(kept))
    order = exported.layout.now
    columns = strange.instants.columns

    def result(level):
        return loaded.odd_predict_band(pointer(kept), None, level, 0, 0, pointer(path), pointer(band))

    assert result(0.9) == 8
    assert np.isnan(band).all()
    loaded.odd_record(pointer(kept), 0.0, pointer(np.array([columns.get(name, [0.0])[0] for name in order])))
    held = {name: columns[name][:1] for name in exported.layout.reached}
    now = Instants({name: values[:1] for name, values in columns.items()}, hidden=held or None)
    right = predictor.predict(now, level=0.9)
    assert result(0.9) == 2 * int(right.outside[0])
    np.testing.assert_allclose(path, right.paths[:, 0], rtol=0, atol=1e-11)
    np.testing.assert_allclose(band[:, :2], rows_of(right.region)[:, 0, :2], rtol=NEAR)
    assert result(0.95) == 2 * int(right.outside[0]) + 32
    assert np.isfinite(path).all()
    assert np.isnan(band).all()
    assert "half of the paths" in run_example(files, tmp_path / "example")
