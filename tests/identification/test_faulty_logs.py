"""The drawn ships and logs agree with their documents and with their truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipid import Dataset, load_vessel, read_dataset, write_dataset
from shipid.vessel.dynamics import vessel_dynamics
from tests.identification.faulty_logs import (
    ACCEPTED,
    ALL_CAUSES,
    CAUSES,
    NOISES,
    FaultyLog,
    FieldShip,
    apply_fault,
    dataset_frame,
    document_rates,
    draw_faulty_log,
    draw_ship,
    find_amount,
    judge_causes,
    physics_error,
    possible_causes,
    simulate_runs,
    true_rates,
    vessel_document,
)


@pytest.fixture(scope="module", params=[0, 1, 2])
def ship(request: pytest.FixtureRequest) -> FieldShip:
    return draw_ship(request.param, seed=7)


def test_the_document_has_the_accelerations_that_were_fitted(ship: FieldShip, tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    calm = simulate_runs(ship, random, 2, 0.0, 0.0)
    log = FaultyLog(ship, ship.fit | {"mass": 1.2}, calm, (), (), (), "none", windy=True)
    file = tmp_path / "drawn.toml"
    file.write_text(vessel_document(log))
    dynamics = vessel_dynamics(vessel := load_vessel(str(file)))
    L, U = ship.L, ship.U
    for _ in range(20):
        state = random.uniform([-3, 0.2, -0.3, -0.5, 0.2, 0.2, -0.6], [3, 1, 0.3, 0.5, 1, 1, 0.6])
        if ship.drive == "rudder":
            state[5] = state[4]
        towards, speed = float(random.uniform(-3, 3)), 2.0
        wind = speed * np.array([np.cos(towards), np.sin(towards)])
        n = state[4:6] * ship.n_max
        given = {"V_w": speed * U, "beta_w": towards, "rudder.delta": state[6], "propeller.n": n[0]}
        given |= {"port.n": n[0], "starboard.n": n[1]}
        vectors = [[given[name] for name in names] for names in (dynamics.commands, dynamics.environment)]
        numbers = [vessel.parameters[name] for name in dynamics.parameters]
        moving = [0, 0, state[0], U * state[1], U * state[2], U / L * state[3]]
        rates = np.array(dynamics.rates(moving, [], *vectors, numbers, 0)).ravel()[3:6]
        expected = document_rates(ship, log.fit, state, wind) * [U * U / L, U * U / L, (U / L) ** 2]
        assert np.allclose(rates, expected, rtol=1e-3, atol=2e-3 * U * U / L * np.array([1, 1, 1 / L]))  # table of wind


def test_the_document_errs_little_on_a_sound_log(ship: FieldShip) -> None:
    calm = simulate_runs(ship, np.random.default_rng(2), 8, 0.0, 0.0)
    assert 0.001 < physics_error(ship, ship.fit, calm) < 0.04
    still = dict.fromkeys(ship.fit, 0.0)
    assert physics_error(ship, still, calm) > 4 * physics_error(ship, ship.fit, calm)


def test_the_motion_of_a_log_is_one_motion(ship: FieldShip) -> None:
    log = simulate_runs(ship, np.random.default_rng(3), 8, 2.0, 1.0)
    cos, sin = np.cos(log["psi"]), np.sin(log["psi"])
    for key, rate in (("north", log["u"] * cos - log["v"] * sin), ("east", log["u"] * sin + log["v"] * cos)):
        change = np.diff(log[key], axis=1) - (rate[:, 1:] + rate[:, :-1]) / 2 * np.diff(log["t"], axis=1)
        assert np.max(np.abs(change)) < 1e-3
    state = np.stack([log[key][:, 50] for key in ("psi", "u", "v", "r", "n1", "n2", "delta")])
    mirror = state * np.array([-1, 1, -1, -1, 1, 1, -1])[:, None]
    zero = np.zeros((2, 8))
    image = true_rates(ship, mirror, zero, zero) * np.array([[1], [-1], [-1]])
    assert not np.allclose(image, true_rates(ship, state, zero, zero), rtol=1e-3)  # not alike on both sides


@pytest.mark.slow
@pytest.mark.parametrize("cause", ALL_CAUSES)
def test_a_fault_has_the_factor_that_was_asked_for(ship: FieldShip, cause: str) -> None:
    log = simulate_runs(ship, np.random.default_rng(4), 8, 2.0, 0.5)
    if cause not in possible_causes(ship, windy=True):
        return
    sound = physics_error(ship, ship.fit, log)
    amount, factor = find_amount(ship, cause, 1.0, log, 2.0, sound)
    table, fit = apply_fault(ship, cause, amount, 1.0, log, ship.fit)
    assert factor == pytest.approx(physics_error(ship, fit, table) / sound)
    if cause in CAUSES and CAUSES[cause][0] == 0:
        assert amount == 0
    else:
        assert factor == pytest.approx(2.0, rel=0.05) or (amount == CAUSES[cause][0] and factor < 2)  # or all there is


def test_a_log_is_a_dataset_and_its_draw_is_by_seed(ship: FieldShip, tmp_path: Path) -> None:
    log, again = (draw_faulty_log(5, 3, ship, 2) for _ in range(2))
    assert (log.causes, log.factors, log.noise) == (again.causes, again.factors, again.noise)
    assert len(log.causes) == 2
    assert log.noise in NOISES
    assert set(ACCEPTED) == set(ALL_CAUSES)
    file = tmp_path / "drawn.parquet"
    write_dataset(Dataset(dataset_frame(log), {}), file)
    frame = read_dataset(file).frame
    assert frame["run"].nunique() == 8
    assert np.allclose(frame["u"], (log.table["u"] * ship.U).ravel())


def test_a_diagnosis_is_judged_by_its_key(ship: FieldShip) -> None:
    log = draw_faulty_log(5, 3, ship, 0)
    assert judge_causes(log, [], []) == "quiet"
    assert judge_causes(log, ["current"], []) == "alarm"
    faulty = replace(log, causes=("antenna", "current"), factors=(4.0, 1.3))
    assert judge_causes(faulty, ["lever arm position"], []) == "right"
    assert judge_causes(faulty, ["lever arm position", "current"], []) == "right"
    assert judge_causes(faulty, ["current"], []) == "part"
    assert judge_causes(faulty, ["lever arm position", "wind scale"], []) == "extra"
    assert judge_causes(faulty, ["lever arm position and velocity"], []) == "wrong"
    assert judge_causes(faulty, ["wind scale"], ["lever arm position"]) == "cannot tell"
    assert judge_causes(faulty, [], []) == "missed"
