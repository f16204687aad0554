"""CasADi files: the same numbers, and loops that are closed with them."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.export.model import build_model
from shipid.export.write import export_predictor, export_vessel
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.physics import Physics
from shipid.observer import ESTIMATE_COLUMNS, Observer
from shipid.predictor import Predictor
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.export.compiled import inputs_of_model
from tests.export.strange import drawn


@pytest.mark.parametrize("kind", ["forest", "hankel-dmd", "modules"])
def test_a_predictor_is_one_function(kind, tmp_path):
    strange = drawn(kind, 5, count=4, vessel="mariner")
    file, names, *_ = export_predictor(strange.predictor, "casadi", tmp_path / "ship.casadi")
    function, listed = ca.Function.load(str(file)), json.loads(names.read_text())
    given = inputs_of_model(build_model(strange.predictor), strange.instants)
    expected = strange.predictor.predict(strange.instants)
    for i in range(4):
        path = np.array(function(**{key: values[i] for key, values in given.items()})["path"])
        np.testing.assert_allclose(path.T, expected[:, i], rtol=0, atol=1e-11)
    assert [entry["name"] for entry in listed["inputs"]["now"]] == list(build_model(strange.predictor).layout.now)


@pytest.mark.parametrize("settings", [Observer(), Observer(measured=("psi", "u", "v", "r"), current=0.0)])
@pytest.mark.parametrize("path", ["position", "velocity"])
def test_a_path_starts_where_it_does_in_python(settings, path, tmp_path):
    """At the filtered position where positions are measured and make the true path, else where the ship is."""
    vessel, rng = load_vessel("mariner"), np.random.default_rng(1)
    columns = {
        name: rng.uniform(0.1, 0.2, 3)
        for name in ("north", "east", "psi", "u", "v", "r", *vessel_dynamics(vessel).commands)
    }
    columns |= {"u": np.full(3, 7.0)}
    estimates = {f"observer.{name}": columns.get(name, 0.0) + rng.normal(0, 1e-4, 3) for name in ESTIMATE_COLUMNS}
    estimates["observer.north"] = estimates["observer.north"] + 300.0
    predictor = Predictor(
        Physics(vessel, 4, 5.0, observer=settings, path=path), "alone", UnchangedPath({}), {"u": (0.0, 9.0)}
    )
    instants = Instants(columns, estimates=estimates)
    file, *_ = export_predictor(predictor, "casadi", tmp_path / "ship.casadi")
    given, expected = inputs_of_model(build_model(predictor), instants), predictor.predict(instants)
    for i in range(3):
        seen = ca.Function.load(str(file))(**{key: values[i] for key, values in given.items()})["path"]
        np.testing.assert_allclose(np.array(seen).T, expected[:, i], rtol=0, atol=1e-9)
    assert (np.abs(expected[0]).max() > 200) == (path == "position" and "north" in settings.measured)


@pytest.mark.parametrize("step", [20.0, 60.0])
def test_a_path_that_diverged_keeps_its_last_velocity(step, tmp_path):
    """As in Python, and the alarm is raised: a band around it promises nothing."""
    vessel = load_vessel("mariner")
    columns = {name: np.zeros(2) for name in ("psi", "v", "r")} | {"u": np.array([7.0, 0.1])}
    columns |= {"propeller.n": np.array([1.3, 0.0]), "rudder.delta": np.array([0.5, 0.0])}
    predictor = Predictor(Physics(vessel, 6, step), "alone", UnchangedPath({}), {"u": (0.0, 9.0)})
    file, *_ = export_predictor(predictor, "casadi", tmp_path / "ship.casadi")
    given, expected = inputs_of_model(build_model(predictor), Instants(columns)), predictor.predict(Instants(columns))
    raised = predictor.raise_alarm(Instants(columns))
    for i in range(2):
        seen = ca.Function.load(str(file))(**{key: values[i] for key, values in given.items()})
        np.testing.assert_allclose(np.array(seen["path"]).T, expected[:, i], rtol=1e-9)
        assert bool(seen["outside"]) == raised[i]
    assert raised.tolist() == [step == 60.0, False]
    straight = np.hypot(*np.diff(expected[:, 0], n=2, axis=0).T) < 1e-6
    assert straight[-2:].all() == (step == 60.0)
    assert np.isfinite(expected).all()


def test_an_observer_without_wind_and_current_has_derivatives(tmp_path):
    """Before, the Hessian by the orders was no number, for the direction of no wind is none; IPOPT gave up."""
    physics = Physics(load_vessel("gunnerus-28.9"), 5, 1.0, observer=Observer(current=0.0))
    predictor = Predictor(physics, "alone", UnchangedPath({}), {}, {}, "known")
    file, *_ = export_predictor(predictor, "casadi", tmp_path / "ship.casadi")
    function, names = ca.Function.load(str(file)), build_model(predictor).layout
    given = {key: np.zeros(size) for key, size in names.sizes.items()}
    given["now"][names.now.index("u")] = given["estimates"][names.estimates.index("observer.u")] = 4.0
    orders = ca.MX.sym("orders", names.sizes["planned"])
    path = function(**{**given, "planned": orders})["path"]
    hessian = ca.Function("hessian", [orders], [ca.hessian(ca.sumsqr(path), orders)[0]])
    assert np.isfinite(hessian(np.ones(orders.numel())).full()).all()

    def ahead(wind):
        now = given["now"].copy()
        now[names.now.index("V_w")] = wind
        return function(**{**given, "now": now})["path"].full()[0, -1]

    now = ca.MX.sym("now", names.sizes["now"])
    jacobian = ca.jacobian(function(**{**given, "now": now})["path"], now)
    slopes = ca.Function("slopes", [now], [jacobian])(given["now"]).full()
    assert slopes[8, names.now.index("V_w")] == pytest.approx((ahead(1e-4) - ahead(-1e-4)) / 2e-4, rel=1e-4)
    assert np.isfinite(slopes).all()


def test_a_point_of_the_training_has_derivatives():
    """Before, those of `modules` by the state at it, which has no distance to the nearest one, were no numbers."""
    strange = drawn("modules", 301, count=1)
    exported = build_model(strange.predictor)
    given = {key: values[0] for key, values in inputs_of_model(exported, strange.instants).items()}
    now = ca.MX.sym("now", exported.layout.sizes["now"])
    path = exported.function(**{**given, "now": now})["path"]
    assert np.isfinite(ca.Function("slopes", [now], [ca.jacobian(path, now)])(given["now"]).full()).all()


@pytest.mark.slow
def test_the_example_of_the_docs_keeps_a_course(tmp_path, monkeypatch, capsys):
    """It runs as it is printed: a receding horizon brings a vessel 20 m to starboard."""
    text = (Path(__file__).parents[2] / "docs/export-casadi.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    export_vessel(load_vessel("mariner"), "casadi", tmp_path / "mariner.casadi")
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "docs/export-casadi.md", "exec"), {})
    assert abs(float(capsys.readouterr().out.split()[-1]) - 20) < 8


def test_a_name_that_is_not_utf_8_can_be_written(tmp_path):
    file, _ = export_vessel(load_vessel("mariner"), "casadi", tmp_path / os.fsdecode(b"\xe9.casadi"))
    os.rename(file, tmp_path / "plain.casadi")
    assert ca.Function.load(str(tmp_path / "plain.casadi")).n_in() > 0
