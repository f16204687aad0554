"""Laws of the variational step: derivatives are differences, residuals are those of the rollout, engines agree."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.engine.native import compiler_target, find_compiler, pack_lanes
from shipid.engine.rollout import rollout
from shipid.identification import residuals
from shipid.identification.residuals import Predictions, build_problem, predict_residuals, run_compiled
from shipid.identification.sensitivities import FitLayout, build_variation, run_machine
from shipid.identification.settings import NUISANCES, Identify
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.conftest import PATCHED, variety
from tests.identification.trials import trials

EVERY = {"u": 0.1, "v": 0.1, "r": 0.003, "psi": 0.02, "position": 1.0}
#: structure -> what is free in it
CASES = {
    "gunnerus-28.9": ["hull.derivatives.Y_u*", "thruster.*.k_T", "inertia.m"],
    "gunnerus-33.9": ["hull.crossflow.C_d", "hull.resistance.*", "wind.C_Dt"],
    "actuators": ["hull.derivatives.N_u*", "thruster.port.actuator.*"],
    "many-strips": ["hull.crossflow.C_d"],
    "roll": ["hull.derivatives.K_p", "hull.derivatives.N_uv"],
    "kvlcc2-l7": ["hull.mmg.Y_*", "thruster.*.K_T.*"],
}


@pytest.mark.parametrize("name", CASES)
def test_slopes_are_differences(name: str) -> None:
    vessel = variety()[name] if name in PATCHED else load_vessel(name)
    nuisance = [key for key in NUISANCES if key != "thrust_scale" or any("k_T" in path for path in vessel.parameters)]
    slow = 0.2 if name == "kvlcc2-l7" else 1.0
    dataset = trials(vessel, runs=2, steps=12, step=slow)
    wanted = Identify(parameters=CASES[name], weights=EVERY, nuisance=nuisance, horizon=0, step=slow)
    fit = build_problem(vessel, dataset, dataset.runs, wanted)
    rng = np.random.default_rng(3)
    factors = fit.unknown.centre + rng.normal(0, 0.02, fit.num_factors)
    nuisances = np.abs(rng.normal(0.5, 0.1, (2, len(fit.names))))
    away = rng.normal(0, 1e-2, (2, len(fit.model.node)))
    here = predict_residuals(fit, factors, nuisances, away)
    columns = [(here.by_factor[:, i], _moved(i), 0) for i in range(fit.num_factors)]
    columns += [(here.by_nuisance[:, i], 0, _moved(i)) for i in range(len(fit.names))]
    for slope, by_factor, by_nuisance in columns:
        ends = []
        for sense in (1, -1):
            factor = factors.copy()
            other = nuisances.copy()
            if by_factor:
                factor[by_factor - 1] += sense * 1e-5
            if by_nuisance:
                other[:, by_nuisance - 1] += sense * 1e-5
            ends.append(predict_residuals(fit, factor, other, away).r)
        difference = (ends[0] - ends[1]) / 2e-5
        assert np.abs(slope - difference).max() < 1e-5 * (1 + np.abs(difference).max())
    for i, unit in enumerate(np.eye(len(fit.node_scale))):
        ends = [predict_residuals(fit, factors, nuisances, away + sense * 1e-5 * unit).r for sense in (1, -1)]
        difference = (ends[0] - ends[1]) / 2e-5
        assert np.abs(here.by_start[:, i] - difference).max() < 1e-5 * (1 + np.abs(difference).max())


def _moved(i: int) -> int:
    return i + 1


def test_residuals_are_those_of_the_rollout() -> None:
    vessel = load_vessel("gunnerus-28.9")
    dataset = trials(vessel, runs=2, steps=30)
    other = vessel.with_values({"hull.derivatives.N_ur": 1.3 * vessel.parameters["hull.derivatives.N_ur"]})
    fit = build_problem(vessel, dataset, dataset.runs, Identify(parameters=["hull.derivatives.N_ur"], horizon=0))
    prediction = predict_residuals(fit, np.array([1.3]), np.zeros((2, 0)))
    for number, (_, rows) in enumerate(dataset.frame.groupby("run")):
        start = {name: rows[name].to_numpy()[:1] for name in vessel_dynamics(other).state}
        commands = {name: rows[name].to_numpy()[:-1, None] for name in dataset.commands}
        weather = {name: np.zeros(1) for name in vessel_dynamics(other).environment}
        path = rollout(other, start, commands, weather, step=1.0, num_steps=30, method="rk4", engine="casadi")
        for name, width in zip(("u", "v", "r"), fit.deviations, strict=True):
            mine = prediction.r[(prediction.run == number) & (prediction.signals == name)]
            assert np.allclose(mine * width, path[name][1:, 0, 0] - rows[name].to_numpy()[1:], atol=1e-12)


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("name", ["gunnerus-28.9", "actuators"])
def test_engines_agree(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    vessel = variety()[name]
    dataset = trials(vessel, runs=3, steps=20)
    wanted = Identify(parameters=["hull.derivatives.N_u*"], nuisance=["current", "latency", "lever_arm"], horizon=0)
    fit = build_problem(vessel, dataset, dataset.runs, wanted)
    evaluated = []
    for least in (np.inf, 0.0):
        monkeypatch.setattr(residuals, "COMPILE_FROM", least)
        side_by_side = Predictions(fit)
        assert (side_by_side.packed is not None) is (least == 0.0)
        nuisances = fit.centres + 0.5 * fit.widths * np.ones((3, 1))
        begun = side_by_side.begin(nuisances)[0]
        evaluated.append(side_by_side.evaluate(begun, np.full(fit.num_factors, 1.1), nuisances))
    for one, other in zip(*evaluated, strict=True):
        assert np.abs(one - other).max() <= 1e-12 * (1 + np.abs(one).max())


def test_what_no_signal_feels_is_left_out() -> None:
    vessel = load_vessel("gunnerus-28.9")
    dataset = trials(vessel, runs=1, steps=10)
    plain = build_problem(vessel, dataset, dataset.runs, Identify(parameters=["hull.derivatives.*"], horizon=0))
    assert plain.model.node == ("u", "v", "r")
    wanted = Identify(parameters=["hull.derivatives.*"], horizon=0, weights={"position": 1.0})
    assert build_problem(vessel, dataset, dataset.runs, wanted).model.node == ("north", "east", "psi", "u", "v", "r")


SHIP = load_vessel("gunnerus-28.9")


@pytest.mark.skipif(find_compiler() is None, reason="needs a C compiler")
def test_compiled_outputs_are_those_of_the_virtual_machine() -> None:
    layout = FitLayout(vessel_dynamics(SHIP), (("inertia.m",),), ("u", "r"), (), (), 0, 0.5, "euler")
    model, rng, count, steps = build_variation(layout), np.random.default_rng(0), compiler_target().lanes + 2, 3
    x = np.zeros((count, model.size))
    x[:, :3] = rng.uniform([3.0, -0.1, -0.02], [5.0, 0.1, 0.02], (count, 3))
    x[:, 3:12] = np.eye(3).ravel()
    base = np.array(list(SHIP.parameters.values()))
    fixed = np.tile(np.concatenate([[1.05], base, [SHIP.parameters["inertia.m"]]]), (count, 1))
    known = rng.uniform(0.5, 2.0, (count, steps, model.rates.size1_in(3)))
    seen = np.concatenate([np.zeros((count, steps, 2)), np.ones((count, steps, 2))], axis=-1)
    expected = run_machine(layout, x, fixed, known, seen)[0]
    record = run_compiled(layout, x, fixed, pack_lanes(known), pack_lanes(seen))
    result = record.reshape(-1, *record.shape[2:])[:count]
    assert np.abs(expected).max() > 1
    assert np.allclose(result, expected, rtol=1e-9, atol=1e-12)
