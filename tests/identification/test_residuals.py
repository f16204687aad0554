"""Laws of the variational step: derivatives are differences, residuals are those of the rollout, engines agree."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.engine.native import compiler_target, find_compiler, pack_lanes
from shipid.engine.rollout import rollout
from shipid.errors import DataError, DocumentError
from shipid.identification import residuals
from shipid.identification.residuals import Predictions, Problem, build_problem, predict_residuals, run_compiled
from shipid.identification.sensitivities import FitLayout, build_variation, run_machine
from shipid.identification.settings import NUISANCES, Identify
from shipid.identification.solve import identify
from shipid.identification.statistics import fit_statistics
from shipid.simulation.manoeuvre import Excitation
from shipid.simulation.perform import perform_manoeuvres
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
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


TORQUE = {"1": 0.0367, "J": -0.0130, "JJ": -0.0235}
NOISE = {
    "u": 0.0005,
    "v": 0.0005,
    "r": 5e-5,
    "propeller.thrust": 0.5,
    "propeller.torque": 0.02,
    "rudder.normal_force": 0.3,
}
SPEED = Identify(
    parameters=["hull.mmg.R_0", "thruster.propeller.K_T.*"],
    together=[["thruster.propeller.K_T.*"]],
    horizon=0,
    step=1.0,
    weights={name: NOISE[name] for name in "uvr"},
    nuisance=["initial_state"],
)
"""Resistance and thrust from the speed of steady straight runs: only their ratio is known."""
START = {"hull.mmg.R_0": 0.8, "thruster.propeller.K_T.1": 1.2}


@cache
def tanker() -> Vessel:
    """A model tanker with K_Q, and with lags, so that outputs depend on actuator states."""
    ship = load_vessel("kvlcc2-l7")
    lag = {"kind": "first_order", "T": 0.5, "rate": 30.0}
    return ship.with_values({"thruster.propeller.K_Q": TORQUE, "thruster.propeller.actuator": {"n": lag}})


@cache
def tanker_trials(seed: int = 1, steady: bool = False) -> Dataset:
    """Straight runs at steady speed, or runs of random orders of rudder and shaft, with noise on what is measured."""
    ship, rng = tanker(), np.random.default_rng(seed)
    kinds = [
        Excitation(
            name=f"S{n}",
            n_rpm=n,
            amplitude_rpm=0.0 if steady else 0.2 * n,
            angle_deg=0.0 if steady else 15.0,
            duration=60.0,
            hold=(10.0, 20.0),
        )
        for n in (400.0, 700.0)
    ]
    frame = perform_manoeuvres(ship, kinds, step=1.0, outputs=list(ship_outputs()))
    frame = frame.drop(columns=[name for name in frame if str(name).startswith("actual.")])
    for name, size in NOISE.items():
        frame[name] += rng.normal(0, size, len(frame))
    return Dataset(frame, {"clock": "run", "flags": []})


def ship_outputs() -> tuple[str, ...]:
    return ("propeller.thrust", "propeller.torque", "rudder.normal_force")


def with_weights(settings: Identify, *names: str) -> Identify:
    return settings.model_copy(update={"weights": {**settings.weights, **{name: NOISE[name] for name in names}}})


def errors(settings: Identify, data: Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Factors, and their standard errors, of a fit that begins 20 % off."""
    solution = identify(tanker(), data, data.runs, settings, start=START)
    assert solution.status == "ok"
    return solution.factors, fit_statistics(solution).errors


def test_measured_thrust_separates_the_propeller_from_the_resistance() -> None:
    data = tanker_trials(steady=True)
    _, unknown = errors(SPEED, data)
    factors, known = errors(with_weights(SPEED, "propeller.thrust"), data)
    assert unknown.min() > 0.2
    assert known.max() < 0.002
    assert (np.abs(factors - 1) < 4 * known).all()


@pytest.mark.parametrize(
    ("output", "paths", "near"),
    [
        ("propeller.torque", ["thruster.propeller.K_Q.1"], 0.05),
        ("rudder.normal_force", ["thruster.rudder.kappa", "thruster.rudder.f_alpha"], 0.05),
        ("propeller.thrust", ["thruster.propeller.w_P0", "thruster.propeller.actuator.n.T"], 0.05),
    ],
)
def test_each_output_identifies_numbers_of_its_component(output: str, paths: list[str], near: float) -> None:
    settings = Identify(parameters=paths, step=1.0, horizon=20, weights={"u": 0.01, "v": 0.01, "r": 0.001})
    data = tanker_trials()
    start = dict.fromkeys(paths, 0.8)
    solution = identify(tanker(), data, data.runs, with_weights(settings, output), start=start)
    assert solution.status == "ok"
    np.testing.assert_allclose(solution.factors, 1.0, atol=near)


def problem(**more: object) -> Problem:
    settings = Identify.model_validate(
        {
            "parameters": [
                "hull.mmg.R_0",
                "thruster.propeller.K_T.1",
                "thruster.propeller.w_P0",
                "thruster.rudder.kappa",
            ],
            "step": 1.0,
            "horizon": 20.0,
            "weights": {
                "u": 0.01,
                "r": 0.001,
                "propeller": {"thrust": 0.5, "torque": 0.02},
                "rudder.normal_force": 0.3,
            },
            **more,
        }
    )
    return build_problem(tanker(), tanker_trials(), tanker_trials().runs[:2], settings)


def test_residuals_of_outputs_are_those_of_the_simulated_ones() -> None:
    """At the true numbers, from true states, what is left is the noise of the instruments."""
    one = problem()
    found = predict_residuals(one, np.ones(one.num_factors), np.zeros((2, 0)))
    for name in ("propeller.thrust", "propeller.torque", "rudder.normal_force"):
        settled = (found.signals == name) & (found.time > 4)  # a recorded shaft is taken for settled where a run begins
        assert np.std(found.r[settled]) == pytest.approx(1.0, abs=0.25)


def test_what_is_fitted_must_be_predicted_and_measured() -> None:
    data = tanker_trials()
    with pytest.raises(DocumentError, match=r"weights.port.thrust: .* predicts no port.thrust"):
        build_problem(tanker(), data, data.runs, SPEED.model_copy(update={"weights": {"port.thrust": 1.0}}))
    with pytest.raises(DocumentError, match="K_Q"):
        build_problem(
            load_vessel("kvlcc2-l7"), data, data.runs, SPEED.model_copy(update={"weights": {"propeller.torque": 1.0}})
        )
    less = Dataset(pd.DataFrame(data.frame.drop(columns="propeller.thrust")), data.metadata)
    with pytest.raises(DataError, match=r"propeller.thrust: was not measured; .* propeller.torque"):
        build_problem(tanker(), less, less.runs, SPEED.model_copy(update={"weights": {"propeller.thrust": 1.0}}))
    with pytest.raises(DocumentError, match=r"weights.thrust is no valid name: .*<component>.<signal>"):
        Identify(parameters=["hull.mmg.R_0"], weights={"thrust": 1.0})
