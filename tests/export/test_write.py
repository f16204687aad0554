"""What a user asks for is written, or refused in one line."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.errors import ShipidError
from shipid.export.fmu import predictor_unit, vessel_unit
from shipid.export.model import build_model
from shipid.export.write import EXPORT_TARGETS, export_predictor, export_vessel
from shipid.files import read_arrays, write_arrays
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.compensator import Normaliser
from shipid.hybrid.methods import METHODS
from shipid.hybrid.physics import Physics
from shipid.hybrid.stored import StoredData
from shipid.predictor import Predictor
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.documented import module
from tests.export.compiled import inputs_of_model
from tests.export.strange import drawn


@pytest.fixture(scope="module")
def simple():
    return Predictor(Physics(load_vessel("mariner"), 3, 5.0), "alone", UnchangedPath({}), {})


def test_no_name_of_a_source_is_a_public_one():
    """Whatever the export is called: no name by hand ends as a public one does."""
    kept = build_model(drawn("recurrent", 1).predictor)
    for unit in (predictor_unit(kept, "zzz"), vessel_unit(load_vessel("mariner"), "zzz", "rk4")):
        source = "\n".join([unit.files.texts["zzz.h"], unit.files.texts["zzz.c"], unit.wrapper("")])
        names = set(re.findall(r"\b[A-Za-z]\w*", source))
        public = {name.removeprefix("zzz") for name in names if name.startswith("zzz_")}
        assert len(public) > 10
        assert [
            name for name in names - {"zzz"} if name.islower() and name.endswith(tuple(public)) and name[:3] != "zzz"
        ] == []


def test_the_folder_of_c_holds_four_files(simple, tmp_path):
    files = simple.export("c", tmp_path / "my-ship")
    assert {file.name for file in files} == {"my_ship.c", "my_ship_casadi.c", "my_ship.h", "main.c"}
    assert all(file.is_file() for file in files)
    assert simple.export("c", tmp_path / "other", name="my ship")[0].name == "my_ship.h"


def test_an_example_that_the_user_has_made_hers_is_kept(simple, tmp_path):
    first = simple.export("c", tmp_path / "ship")
    (tmp_path / "ship" / "main.c").write_text("mine")
    again = simple.export("c", tmp_path / "ship")
    assert {file.name for file in first} - {file.name for file in again} == {"main.c"}
    assert (tmp_path / "ship" / "main.c").read_text() == "mine"


@pytest.mark.parametrize(("to", "seed"), [(to, seed) for to in ("c", "casadi") for seed in range(1)])
def test_on_a_full_disk_the_export_that_was_there_stays(simple, tmp_path, monkeypatch, to, seed):
    """Before, CasADi wrote a part of its function and said nothing, and the names of the old one were gone."""
    resource = pytest.importorskip("resource")
    file = tmp_path / f"ship{EXPORT_TARGETS[to].ending}"
    old = {one: one.read_bytes() for one in simple.export(to, file)}
    monkeypatch.setattr("shipid.export.write.EXAMPLE_FILE", "none")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    least = int(np.random.default_rng(seed).integers(max(map(len, old.values()))))
    resource.setrlimit(resource.RLIMIT_FSIZE, (least, hard))
    try:
        with pytest.raises(OSError, match="too large") as caught:
            simple.export(to, file)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert caught.value.filename in map(str, old)
    assert {one: one.read_bytes() for one in tmp_path.rglob("*") if one.is_file()} == old


@pytest.mark.parametrize(
    ("to", "out", "options", "message"),
    [
        ("matlab", "a", {}, "--to: 'matlab' is no target: valid: c, casadi, fmu, onnx"),
        ("fmu", "a.zip", {}, "ends in .fmu"),
        ("casadi", "log.csv", {}, "ends in .casadi"),
        ("onnx", "ship.toml", {}, "ends in .onnx"),
        ("fmu", "a.fmu", {"single": True}, "always in double precision"),
        ("casadi", ".", {}, "ends in .casadi"),
    ],
)
def test_a_wrong_wish_is_one_line(simple, tmp_path, to, out, options, message):
    with pytest.raises(ShipidError, match=message):
        export_predictor(simple, to, tmp_path / out, **options)


def test_a_vessel_has_no_networks(tmp_path):
    with pytest.raises(ShipidError, match="takes nothing else"):
        export_vessel(load_vessel("mariner"), "onnx", tmp_path / "a.onnx")
    assert set(EXPORT_TARGETS) == {"c", "fmu", "casadi", "onnx"}


@pytest.mark.parametrize(
    ("vessel", "integrator", "message"),
    [
        (None, "rk5", "integrator 'rk5' is not known"),
        (None, "RK4", "integrator 'RK4' is not known: did you mean 'rk4'"),
        ("mariner", "rk4", "vessel must be a Vessel, as of `load_vessel`, not 'mariner'"),
    ],
)
def test_a_wrong_vessel_or_integrator_is_one_line(vessel, integrator, message, tmp_path):
    with pytest.raises(ShipidError, match=message):
        export_vessel(vessel or load_vessel("mariner"), "c", tmp_path / "mariner", integrator=integrator)
    assert not list(tmp_path.iterdir())


def test_a_forest_beyond_the_size_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr("shipid.export.model.MOST_NUMBERS", 10)
    with pytest.raises(ShipidError, match=r"hold .* numbers, an export at most 10: use fewer trees"):
        export_predictor(drawn("forest", 5, vessel="mariner").predictor, "c", tmp_path / "f")


def test_a_method_of_ones_own_is_exported_unasked(simple, monkeypatch, tmp_path):
    """What `predict` of docs/extending.md computes by NumPy is the function that CasADi writes."""
    linear = module("A method", "linear_of_the_page", monkeypatch)
    monkeypatch.setitem(METHODS, "linear", linear.Linear)
    rng, horizon = np.random.default_rng(0), simple.physics.horizon
    normaliser = Normaliser(("u", "r"), rng.normal(size=2), np.ones(2))
    corrector = linear.LinearCorrector((), normaliser, rng.normal(size=(horizon, 3, 2)), {})
    predictor = Predictor(simple.physics, "linear", corrector, simple.limits)
    commands = vessel_dynamics(simple.physics.vessel).commands
    instants = Instants({name: rng.uniform(0.1, 0.2, 1) for name in ("psi", "u", "v", "r", *commands)})
    file, *_ = predictor.export("casadi", tmp_path / "own.casadi")
    given = {name: values[0] for name, values in inputs_of_model(build_model(predictor), instants).items()}
    path = ca.Function.load(str(file))(**given)["path"]
    np.testing.assert_allclose(np.array(path).T, predictor.predict(instants)[:, 0], rtol=0, atol=1e-12)
    assert np.abs(np.array(path).T - simple.predict(instants)[:, 0]).max() > 0.1


@dataclass(frozen=True)
class Added(StoredData):
    """A path of the physics to which a function of it is added."""

    hyperparameters: Mapping[str, float]
    added: Callable[[Any], Any] = np.abs
    past: float = 0.0

    def predict(self, physics, instants, paths):  # noqa: ARG002
        return paths + self.added(paths)


@pytest.mark.parametrize("added", [np.sort, np.isnan, lambda paths: paths.copy(), lambda paths: paths if paths else 0])
def test_what_casadi_cannot_follow_is_refused_in_one_line_with_its_place(added, simple, tmp_path):
    predictor = replace(simple, corrector=Added({}, added))
    with pytest.raises(ShipidError, match=rf"in {__file__}, line \d+: .* takes what CasADi does not have"):
        predictor.export("c", tmp_path / "out")


def written(paths):
    paths[0] = 7.0
    return paths


@pytest.mark.parametrize("added", [written, *(partial(one, axis=0) for one in (np.ptp, np.max, np.min, np.std))])
def test_what_is_another_function_in_casadi_is_refused(added, simple, tmp_path):
    """It was exported, and wrong."""
    predictor = replace(simple, corrector=Added({}, added))
    with pytest.raises(ShipidError, match="gives another path on symbols of CasADi than on numbers: let"):
        predictor.export("c", tmp_path / "out")


def test_what_is_the_same_function_in_casadi_is_exported(simple, tmp_path):
    predictor = replace(simple, corrector=Added({}, lambda paths: np.sin(paths).mean(axis=(0, 1))))
    assert predictor.export("casadi", tmp_path / "own.casadi")


@pytest.mark.parametrize(
    ("kind", "place", "value", "message"),
    [
        ("path-trained", "networks", [], "'path-trained' do not fit together"),
        ("one-step", "heads", {}, "'one-step' do not fit together"),
        ("recurrent", "networks.0.layers.b_h", np.zeros(14), "b_h: the arrays of the saved method do not fit together"),
        (
            "recurrent",
            "networks.0.reader.steps",
            10**9,
            "'recurrent' do not fit together .*1000000000 steps of the past",
        ),
        ("hankel-dmd", "past", 1e18, "damaged: a past of 1?[0-9]* steps: 0 to 100000"),
        ("hankel-dmd", "past", -30.0, "damaged: a past of -[0-9]* steps: 0 to 100000"),
        ("hankel-dmd", "law.delays", 1, "'hankel-dmd' do not fit together .past-2.u"),
        ("path-trained", "inputs.memory.history", [1e-300], "'path-trained' do not fit together"),
    ],
)
def test_a_damaged_predictor_is_one_line(kind, place, value, message, tmp_path):
    """Before, these could be read, and were tracebacks, or no end, at the prediction or the export."""
    file = drawn(kind, 3, count=4, vessel="mariner").predictor.save(tmp_path / "sound.npz")
    arrays = read_arrays(file)
    header = json.loads(str(arrays["header"]))
    *way, last = place.split(".")
    if place in arrays:
        arrays[place] = value
    else:
        part = header["corrector"]
        for key in way:
            part = part[int(key) if isinstance(part, list) else key]
        part[last] = value
    write_arrays(file, {**arrays, "header": np.array(json.dumps(header))})
    with pytest.raises(ShipidError, match=message):
        Predictor.load(file).export("c", tmp_path / "out")
