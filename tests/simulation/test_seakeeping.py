"""The truth in waves: periods, irregular seas against the linear ship, drift, calm water."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.engine.native import find_compiler
from shipid.engine.rollout import Trajectories, rollout
from shipid.physics.frames import skew_matrix
from shipid.simulation.truth import Truth, simulate_truth
from shipid.simulation.weather import Sea, draw_components, wave_loads
from shipid.units import GRAVITY
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.simulation.linear import HEAVE, PITCH, ROLL, UPRIGHT, linear

HULLS = ("gunnerus-28.9-6dof", "gunnerus-33.9-6dof")
BOTH = pytest.mark.parametrize("name", HULLS)
OF = {HEAVE: "down", ROLL: "phi", PITCH: "theta"}
OFF = {f"thruster.{side}.off": True for side in ("port", "starboard")}
LOW = Sea(H_s=0.1, T_p=5.0)  # linear: heading and path of a ship that no course keeper holds stay as they were
ENGINE = "auto" if find_compiler() is None else "native"

#: BEM data base, uncoupled about the centre of gravity: natural periods [s] of heave, pitch, roll
PERIODS = {HULLS[0]: {HEAVE: 4.12, PITCH: 4.03, ROLL: 5.57}, HULLS[1]: {HEAVE: 4.29, PITCH: 4.19, ROLL: 5.46}}
#: BEM data base: height of the centre of gravity, down from the waterline [m]
Z_G = {HULLS[0]: -0.974494, HULLS[1]: -0.526006}


@cache
def ship(name: str, thrust: bool = False) -> Vessel:
    """A bundled truth, adrift unless it has thrust."""
    vessel = load_vessel(name)
    return vessel if thrust else vessel.with_values(OFF)


def run(
    vessel: Vessel,
    start: Mapping[str, np.ndarray],
    duration: float,
    *,
    orders: Mapping[str, float] | None = None,
    step: float = 0.05,
    interval: float = 0.2,
    **more: Any,
) -> Trajectories:
    """RK4 from `start`, zero where it says nothing; constant orders, no wind."""
    model, count = vessel_dynamics(vessel), len(next(iter(start.values())))
    zero, given = np.zeros(count), orders or {}
    return rollout(
        vessel,
        {**dict.fromkeys(model.state, zero), **start},
        {key: zero + given.get(key.rpartition(".")[2], 0.0) for key in model.commands},
        dict.fromkeys(model.environment, zero),
        step=step,
        num_steps=round(duration / step),
        method="rk4",
        every=round(interval / step),
        engine=ENGINE,
        **more,
    )


@dataclass(frozen=True)
class Linearised:
    """rates, linearised at a steady state of a ship on a straight course: x' = A x + B tau, by CasADi."""

    names: tuple[str, ...]
    A: np.ndarray
    B: np.ndarray
    steady: Mapping[str, float]

    def response(self, omega: np.ndarray, force: np.ndarray) -> dict[str, np.ndarray]:
        """Amplitudes (n,) of every state under forces (n, 6) of frequencies omega; positions are those of a straight
        course. The force itself does not depend on where she is: linear."""
        rows = [i for i, name in enumerate(self.names) if name not in ("north", "east") and not name.endswith(".t")]
        system = 1j * omega[:, None, None] * np.eye(len(rows)) - self.A[np.ix_(rows, rows)]
        amplitudes = np.linalg.solve(system, (force @ self.B[rows].T)[..., None])[..., 0]
        result = {self.names[i]: amplitudes[:, k] for k, i in enumerate(rows)}
        speed = self.steady.get("u", 0.0)
        return result | {
            "north": result["u"] / (1j * omega),
            "east": (result["v"] + speed * result["psi"]) / (1j * omega),
        }


def linearised(vessel: Vessel, steady: Mapping[str, float] | None = None, n: float = 0.0) -> Linearised:
    """At a state, heading north, with a shaft speed [rev/s] that is reached."""
    model, steady = vessel_dynamics(vessel), steady or {}
    names = (*model.state, *model.hidden)
    x, tau = ca.SX.sym("x", len(names)), ca.SX.sym("tau", 6)
    levels = [[n if key.endswith(".n") else 0.0 for key in keys] for keys in (model.memory, model.commands)]
    rates = model.rates(x, *levels, [0.0] * len(model.environment), [*vessel.parameters.values()], tau)
    jacobians = ca.Function("jacobians", [x, tau], [ca.jacobian(rates, x), ca.jacobian(rates, tau)])
    A, B = (np.array(part) for part in jacobians([steady.get(key, 0.0) for key in names], 0))
    return Linearised(names, A, B, steady)


def elevation(drawn: Mapping[str, np.ndarray]) -> np.ndarray:
    """Complex amplitudes (S, num_components)."""
    return np.asarray(drawn["amplitude"] * np.exp(1j * drawn["epsilon"]))


def on_the_response(
    responses: Sequence[Mapping[str, np.ndarray]], wave: np.ndarray, steady: Mapping[str, float]
) -> dict[str, np.ndarray]:
    """States (S,) at t = 0 of ships that have always been in these waves: nothing has to settle."""
    return {
        key: steady.get(key, 0.0)
        + np.array([(response[key] @ a).real for response, a in zip(responses, wave, strict=True)])
        for key in responses[0]
    }


def first_order(vessel: Vessel, drawn: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """First-order loads alone: what a linear response answers to."""
    return {path: loads for path, loads in wave_loads(vessel, drawn).items() if path == "waves.first_order"}


# ---- natural periods


def about_centre_of_gravity(name: str, matrix: np.ndarray) -> np.ndarray:
    """A matrix about the origin moved to the centre of gravity: nu_CG = H nu_O, H = [[I, -S(r)], [0, I]]."""
    H = np.eye(6)
    H[:3, 3:] = -np.array(ca.evalf(ca.densify(skew_matrix(ca.SX([0, 0, Z_G[name]])))))
    back = np.linalg.inv(H)
    return np.asarray(back.T @ matrix @ back)


@BOTH
@pytest.mark.parametrize("axis", UPRIGHT)
def test_undamped_periods_are_those_of_the_data_base(name: str, axis: int) -> None:
    """omega^2 (M + A(omega)) = C, each direction alone about the centre of gravity, within 1 %.

    Heave of the 33.9 m ship within 2 %: she has the 531 t of the trials for which her manoeuvring model was fitted,
    the data base the 574 t of her design draught.
    """
    theory, omega = linear(ship(name)), 1.4
    for _ in range(50):
        inertia = about_centre_of_gravity(name, theory.M + theory.added_mass(np.array([omega]))[0])
        omega = np.sqrt(theory.C[axis, axis] / inertia[axis, axis])
    exception = name == HULLS[1] and axis == HEAVE
    assert 2 * np.pi / omega == pytest.approx(PERIODS[name][axis], rel=0.02 if exception else 0.01)


# ---- the linear ship


@BOTH
def test_equations_at_rest_are_the_linear_ship_of_the_document(name: str) -> None:
    """All six directions free, beam and bow waves: the linearised rates against the document's matrices."""
    omega, theory = np.linspace(0.4, 3.0, 14), linear(ship(name))
    for beta in (np.pi / 2, 2.4):
        response = linearised(ship(name)).response(omega, theory.excitation(omega, beta))
        expected = theory.response(omega, beta)
        names = ("north", "east", "down", "phi", "theta", "psi")
        np.testing.assert_allclose(np.stack([response[key] for key in names], axis=-1), expected, rtol=1e-7, atol=1e-12)


@BOTH
@pytest.mark.parametrize("thrust", [False, True])
def test_motions_in_irregular_waves_follow_the_linear_response(name: str, thrust: bool) -> None:
    """All six free, adrift and under way at 140 rpm (the encounter of a moving ship), record by record.

    Started on the linear response itself, so that nothing has to settle: the rest is of second order, at most 5 %.
    """
    vessel, n = ship(name, thrust), 140 / 60
    steady: dict[str, float] = {}
    if thrust:
        calm = run(vessel, {"u": np.array([4.5])}, 400.0, orders={"n": n}, interval=400.0)
        steady = {key: float(calm[key][-1, 0, 0]) for key in calm.names if not key.startswith("actual")}
        steady |= {"north": 0.0, "east": 0.0, "waves.first_order.t": 0.0}
    model, theory = linearised(vessel, steady, n if thrust else 0.0), linear(vessel)
    beta = np.radians((90, 135, 180))
    drawn = draw_components(LOW, beta, ["beam", "bow", "head"])
    speed = steady.get("u", 0.0)
    met = drawn["omega"] - drawn["omega"] ** 2 / GRAVITY * speed * np.cos(beta)[:, None]
    responses = [model.response(met[s], theory.excitation(drawn["omega"][s], beta[s])) for s in range(3)]
    wave = elevation(drawn)
    start = on_the_response(responses, wave, steady)
    orders = {"n": n} if thrust else {}
    path = run(vessel, start, 80.0, orders=orders, components=first_order(vessel, drawn), keep=tuple(OF.values()))
    time = path.interval * np.arange(len(path.states))
    for s in range(3):
        carrier = np.exp(1j * np.outer(time, met[s])) * wave[s]
        for key in OF.values():
            expected = (carrier @ responses[s][key]).real
            error = path[key][:, 0, s] - steady.get(key, 0.0) - expected
            limit = 0.05 * expected.std() if expected.std() > 1e-4 else 1e-5  # no roll in a head sea
            assert np.sqrt((error**2).mean()) < limit, f"{key} at {np.degrees(beta[s]):.0f} deg"


@BOTH
@pytest.mark.parametrize("beta_deg", [90, 180])
def test_first_order_loads_do_not_drift_the_ship(name: str, beta_deg: int) -> None:
    """Adrift in 1 m waves without the table of drift: the mean force along the waves, from the path's curvature over
    40 s, is below 30 % of the table's. Forces that tilted with the ship (m w q, m w p) would undo the drift."""
    sea, count, beta = Sea(H_s=1.0, T_p=5.0), 24, np.radians(beta_deg)
    vessel = ship(name)
    drawn = draw_components(sea, np.full(count, beta), list(range(count)))
    model, theory = linearised(vessel), linear(vessel)
    responses = [model.response(omega, theory.excitation(omega, beta)) for omega in drawn["omega"]]
    start = on_the_response(responses, elevation(drawn), {})
    path = run(vessel, start, 40.0, components=first_order(vessel, drawn), keep=("north", "east"))
    time = path.interval * np.arange(len(path.states))
    channel, axis = ("east", 1) if beta_deg == 90 else ("north", 0)
    mean = (theory.M + theory.A)[axis, axis] * 2 * np.polyfit(time, path[channel][:, 0], 2)[0].mean()
    table = wave_loads(vessel, drawn)["waves.drift"][0, 0, 2:].reshape(3, -1)[axis]
    harmonics = np.arange(len(table)) * beta
    drift = table @ (np.cos(harmonics) if axis == 0 else np.sin(harmonics))
    assert abs(mean) < 0.3 * abs(drift)


# ---- calm water


def calm(name: str, **changes: Any) -> Truth:
    block = {"n_rpm": (50.0, 200.0), "alpha_deg": (-50.0, 50.0), "start_speed": (0.0, 0.5), "actuators_at": "rest"}
    block |= {key: changes.pop(key) for key in block if key in changes}
    given = {"vessel": name, "manoeuvres": 12, "duration": 160.0, "wind_speed": (0.0, 0.0), "seed": 3}
    return Truth(**given | {"manoeuvre": [block]} | changes)


@BOTH
def test_calm_water_is_the_manoeuvring_model(name: str) -> None:
    """Turns of 160 s from near rest, 50-200 rpm, +-50 deg, no wind: u, v within 0.02 m/s, r within 0.05 deg/s RMS."""
    ship_ = load_vessel(name)
    lags = {f"thruster.{side}.actuator": ship_.document["thruster"][side]["actuator"] for side in ("port", "starboard")}
    flat = load_vessel(name.removesuffix("-6dof")).with_values(lags)
    for orders in ({}, {"manoeuvres": 2, "n_rpm": (140.0, 140.0), "alpha_deg": (30.0, 30.0)}):
        six, three = simulate_truth(calm(name, **orders), ship_), simulate_truth(calm(name, **orders), flat)
        for column, limit in (("u", 0.02), ("v", 0.02), ("r", np.radians(0.05))):
            error = (six[column] - three[column]) ** 2
            assert np.sqrt(error.groupby(six["run"]).mean()).max() < limit, column
