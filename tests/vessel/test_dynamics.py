"""Assembled equations of every vessel: laws of the whole, and numbers computed apart."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from shipid.engine.rollout import rollout
from shipid.physics.inertia import total_mass
from shipid.vessel import dynamics as module
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel


def values(vessel: Vessel) -> np.ndarray:
    return np.array(list(vessel.parameters.values()))


def rates(vessel: Vessel, tau: Any = None, **given: float) -> dict[str, float]:
    """d(state)/dt by name; what is not given is zero; actuators have reached their commands."""
    model = vessel_dynamics(vessel)
    states = (*model.state, *model.hidden)
    groups = [[given.get(name.replace(".", "_"), 0.0) for name in names] for names in (states, model.memory)]
    groups += [
        [given.get(name.replace(".", "_"), 0.0) for name in names] for names in (model.commands, model.environment)
    ]
    force = np.zeros(model.num_dof) if tau is None else np.asarray(tau, dtype=float)
    for term in model.sums:
        if term.arrays is None:  # drawn: none in calm water
            continue
        mapped = [np.tile(np.array(group, ndmin=2).T, (1, len(term.arrays))) for group in [*groups, values(vessel)]]
        force = force + np.array(term.function.map(len(term.arrays))(*mapped, term.arrays.T)).sum(axis=1)
    derivatives = np.array(model.rates(*groups, values(vessel), force)).ravel()
    return dict(zip(states, derivatives, strict=True))


def test_rest_stays_rest(vessel: Vessel) -> None:
    assert max(abs(rate) for name, rate in rates(vessel).items() if not name.endswith(".t")) < 1e-6


def test_planar_equations_by_hand() -> None:
    """Set A with its rudderless hull only, section 3 of the parameters' source, re-computed in NumPy."""
    vessel = load_vessel("gunnerus-28.9").with_values(
        {"wind.off": True, "thruster.port.off": True, "thruster.starboard.off": True, "inertia.x_G": -0.7}
    )
    u, v, r, psi = 4.0, -0.5, 0.06, 0.4
    d = vessel.document["hull"]["derivatives"]
    motion = {"u": u, "v": v, "r": r}

    def force(axis: str) -> float:
        total = 0.0
        for name, value in d.items():
            if name.startswith(f"{axis}_"):
                pieces = name[2:].split("|")  # every second piece is between bars
                bare, modulus = "".join(pieces[::2]), "".join(pieces[1::2])
                total += value * np.prod([motion[s] for s in bare]) * np.prod([abs(motion[s]) for s in modulus])
        return total

    a = vessel.document["added_mass"]
    m, x_G, I_z = 410931.81, -0.7, 21450896.0
    M_RB = np.array([[m, 0, 0], [0, m, m * x_G], [0, m * x_G, I_z]])
    M_A = -np.array([[a["X_udot"], 0, 0], [0, a["Y_vdot"], a["Y_rdot"]], [0, a["N_vdot"], a["N_rdot"]]])

    def coriolis(M: np.ndarray) -> np.ndarray:
        sway = M[1, 1] * v + (M[1, 2] + M[2, 1]) / 2 * r
        return np.array([-sway * r, M[0, 0] * u * r, sway * u - M[0, 0] * u * v])

    hull = np.array([force(axis) for axis in "XYN"])
    expected = np.linalg.solve(M_RB + M_A, hull - coriolis(M_RB) - coriolis(M_A))
    moved = rates(vessel, u=u, v=v, r=r, psi=psi)
    np.testing.assert_allclose([moved["u"], moved["v"], moved["r"]], expected, rtol=1e-11)
    np.testing.assert_allclose(
        [moved["north"], moved["east"], moved["psi"]],
        [u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi), r],
    )


@pytest.mark.parametrize("coriolis", ["full", "none"])
@pytest.mark.parametrize("name", ["container-175", "naval-51"])
def test_a_current_carries_a_ship_that_heels_in_her_turn(name: str, coriolis: str) -> None:
    """Galilei: 120 s of a turn with a heel of some degrees; she was off by phi^2 V_c t."""
    ship = load_vessel(name).with_values({"current.kind": "uniform", "inertia.coriolis": coriolis})
    V_c, beta_c, psi = np.array([0.0, 1.5]), np.array([0.0, 2.2]), np.array([0.4, 0.4])
    start = dict.fromkeys(vessel_dynamics(ship).state, np.zeros(2)) | {"psi": psi}
    start |= {"u": 6.0 + V_c * np.cos(beta_c - psi), "v": V_c * np.sin(beta_c - psi)}
    shaft = 8.0 if name == "naval-51" else 1.2
    orders = {key: np.full(2, shaft if key.endswith(".n") else 0.4) for key in vessel_dynamics(ship).commands}
    path = rollout(ship, start, orders, {"V_c": V_c, "beta_c": beta_c}, step=0.2, num_steps=600, method="rk4")
    assert np.abs(path["phi"]).max() > 0.01
    carried = [V_c[1] * 120 * ratio for ratio in (np.cos(2.2), np.sin(2.2))]
    moved = [path[key][-1, 0, 1] - path[key][-1, 0, 0] for key in ("north", "east")]
    np.testing.assert_allclose(moved, carried, atol=1e-5)
    for key in ("phi", "psi", "p", "r"):
        np.testing.assert_allclose(path[key][:, 0, 1], path[key][:, 0, 0], atol=1e-6, err_msg=key)


def test_vessels_of_one_structure_share_one_compilation() -> None:
    base = load_vessel("gunnerus-28.9")
    assert vessel_dynamics(base) is vessel_dynamics(base.with_values({"inertia.m": 5e5, "wind.C_X.3": 0.1}))
    assert vessel_dynamics(base) is not vessel_dynamics(base.with_values({"wind.off": True}))


def test_written_out_sum_equals_mapped_sum(monkeypatch: pytest.MonkeyPatch) -> None:
    vessel = load_vessel("gunnerus-33.9").with_values({"hull.crossflow.strips": 30})
    given = {"u": 3.0, "v": 0.6, "r": 0.07, "port_n": 2.0}
    written_out = rates(vessel, **given)
    assert not vessel_dynamics(vessel).sums
    monkeypatch.setattr(module, "_compiled", {})
    monkeypatch.setattr(module, "UNROLL_UP_TO", 10)
    assert len(vessel_dynamics(vessel).sums) == 1
    for name, value in rates(vessel, **given).items():
        assert value == pytest.approx(written_out[name], rel=1e-12)


def test_actuator_memory_replaces_the_command(draw_inputs: Callable[..., Mapping[str, Any]]) -> None:
    base = load_vessel("gunnerus-28.9")
    lag = {"kind": "first_order", "T": 1.0, "rate": 0.17}
    lagged = base.with_values({"thruster.port.actuator.n": lag})
    model = vessel_dynamics(lagged)
    assert model.memory == {"port.n": "rev/s"}
    drawn = draw_inputs(base, 1)
    state, commands = ([float(x[0]) for x in drawn[group].values()] for group in ("start", "commands"))
    environment = [float(x[0]) for x in drawn["environment"].values()]
    direct = vessel_dynamics(base).rates(state, [], commands, environment, values(base), np.zeros(3))
    ordered_otherwise = [99.0, *commands[1:]]
    through = model.rates(state, commands[:1], ordered_otherwise, environment, values(lagged), np.zeros(3))
    np.testing.assert_allclose(np.array(through), np.array(direct), rtol=1e-14)
    after = float(model.advance(state, [1.0], [1.1, 0, 0, 0], environment, values(lagged), 0.5))
    assert after == pytest.approx(1.1 + (1.0 - 1.1) * np.exp(-0.5))


@pytest.mark.parametrize("name", ["gunnerus-28.9-6dof", "gunnerus-33.9-6dof"])
def test_heave_of_a_pitching_and_rolling_ship_does_not_drive_her(name: str) -> None:
    """Buoyancy stays vertical: w q gives no surge and w p no sway, but for drag, where a free body has q w and p w."""
    ship, w, angular = load_vessel(name), 0.5, 0.1
    heaving = rates(ship, w=w)
    for driven, turned in (("u", "q"), ("v", "p")):
        both, turning = (rates(ship, w=heave, **{turned: angular})[driven] for heave in (w, 0.0))
        assert abs(both - turning - heaving[driven]) < 0.2 * w * angular


def mass_matrix(vessel: Vessel) -> np.ndarray:
    inertia = {k: v for k, v in vessel.document["inertia"].items() if k != "source"}
    added = {k: v for k, v in vessel.document["added_mass"].items() if k not in ("source", "coriolis")}
    return np.array(total_mass(inertia, added))[np.ix_(vessel.axes, vessel.axes)]


def test_without_coriolis_the_mass_does_not_turn() -> None:
    """`[inertia] coriolis = "none"` leaves m v r and -m u r out."""
    ship = load_vessel("gunnerus-28.9")
    still = ship.with_values({"inertia.coriolis": "none"})
    m, M = ship.document["inertia"]["m"], mass_matrix(ship)
    v, r, u = 0.4, 0.05, 3.0
    full, none = (rates(vessel, u=u, v=v, r=r) for vessel in (ship, still))
    difference = np.array([full[name] - none[name] for name in ("u", "v", "r")])
    np.testing.assert_allclose(M @ difference, [m * v * r, -m * u * r, 0], atol=1e-6 * m)
