"""Measured outputs of components, such as thrust, as signals of a fit."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DataError, DocumentError
from shipid.identification.residuals import Problem, build_problem, predict_residuals
from shipid.identification.settings import Identify
from shipid.identification.solve import identify
from shipid.identification.statistics import fit_statistics
from shipid.simulation.manoeuvre import Excitation
from shipid.simulation.perform import perform_manoeuvres
from shipid.vessel.load import Vessel, load_vessel

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
def trials(seed: int = 1, steady: bool = False) -> Dataset:
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
    data = trials(steady=True)
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
    data = trials()
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
    return build_problem(tanker(), trials(), trials().runs[:2], settings)


def test_residuals_of_outputs_are_those_of_the_simulated_ones() -> None:
    """At the true numbers, from true states, what is left is the noise of the instruments."""
    one = problem()
    found = predict_residuals(one, np.ones(one.num_factors), np.zeros((2, 0)))
    for name in ("propeller.thrust", "propeller.torque", "rudder.normal_force"):
        settled = (found.signals == name) & (found.time > 4)  # a recorded shaft is taken for settled where a run begins
        assert np.std(found.r[settled]) == pytest.approx(1.0, abs=0.25)


def test_what_is_fitted_must_be_predicted_and_measured() -> None:
    data = trials()
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
