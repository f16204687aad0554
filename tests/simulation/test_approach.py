"""What commands do, by the equations; the steady approach; how units share a load."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import fsolve

from shipid.errors import DocumentError, ShipidError
from shipid.simulation.approach import (
    Controls,
    NotStraight,
    steady_approach,
)
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.stability import service_shaft, straight_acceleration
from shipid.vessel.template import Particulars, first_guess
from tests.conftest import PATCHED

SHIP = load_vessel("gunnerus-28.9")
TUNNEL = SHIP.with_values(PATCHED["tunnel"][1])
BOTH = {"port.alpha": -1.0, "starboard.alpha": -1.0}


def moved(**places: float) -> Vessel:
    return SHIP.with_values({f"thruster.{name.replace('_', '.')}": value for name, value in places.items()})


def test_aft_azimuths_turn_against_their_angle_and_forward_ones_with_it() -> None:
    for vessel in (SHIP, TUNNEL, load_vessel("gunnerus-28.9-6dof")):
        controls = Controls(vessel)
        assert controls.drives == ("port.n", "starboard.n")  # a tunnel unit drives nothing ahead
        assert controls.helm == BOTH
    tractor = Controls(moved(port_x=8.0))
    assert tractor.helm == {"port.alpha": 1.0, "starboard.alpha": -1.0}


@pytest.mark.parametrize("key", ["kvlcc2-l7", "mariner"])
def test_a_positive_rudder_angle_turns_the_ship_to_starboard(key: str) -> None:
    assert Controls(load_vessel(key)).helm == {"rudder.delta": 1.0}


def test_a_vessel_that_nothing_drives_or_turns_is_refused() -> None:
    fixed = {f"thruster.{side}.off": True for side in ("port", "starboard")}
    with pytest.raises(DocumentError, match="no command drives R/V Gunnerus") as caught:
        _ = Controls(TUNNEL.with_values(fixed)).helm
    assert caught.value.path == "thruster"
    amidships = {"thruster.port.x": 0.0, "thruster.port.y": 0.0, "thruster.starboard.off": True}
    balanced = SHIP.with_values(amidships | {"added_mass.Y_rdot": 0.0, "added_mass.N_vdot": 0.0})
    with pytest.raises(DocumentError, match="no angle turns R/V Gunnerus"):
        _ = Controls(balanced).helm


def test_two_screws_steer_by_their_difference() -> None:
    """Any two to either side of the middle; not one, nor two in line, nor those of a ship with a helm."""
    otter = Controls(load_vessel("otter"))
    assert otter.differential
    with pytest.raises(
        DocumentError,
        match=r"no rudder: .* difference of its drives; .* order each .port.n_rpm",
    ):
        _ = otter.helm
    assert otter.ahead(2.0) == {"port.n": 2.0, "starboard.n": 2.0}
    inline = otter.vessel.with_values({"thruster.port.y": 0.0, "thruster.starboard.y": 0.0})
    one = otter.vessel.with_values({"thruster.port.off": True})
    assert not any(Controls(ship).differential for ship in (inline, one, SHIP, load_vessel("kvlcc2-l7")))


def test_a_steady_approach_is_an_equilibrium_at_each_shaft_speed() -> None:
    """Speeds of the 2015 derivatives, computed separately in NumPy: 75, 145, 200 rpm."""
    n = np.array([75, 145, 200]) / 60
    approach = steady_approach(Controls(SHIP), n, step=0.1, method="rk4", engine="casadi")
    state = approach.state
    np.testing.assert_allclose(state["u"], [2.27, 4.39, 6.06], atol=0.02)
    assert approach.memory == {}
    for shaft, u in zip(n, state["u"], strict=True):
        assert np.abs(straight_acceleration(SHIP, u, {"port.n": shaft, "starboard.n": shaft})).max() < 5e-4
    for name in ("north", "east", "psi", "v", "r"):
        np.testing.assert_allclose(state[name], 0, atol=1e-9)


def test_an_approach_that_never_settles_or_diverges_is_reported() -> None:
    gains = Controls(SHIP.with_values({"hull.derivatives.X_u|u|": 1e5}))
    with pytest.raises(ShipidError, match=r"at 145 rpm diverges: take a smaller step"):
        steady_approach(gains, np.array([145 / 60]), step=0.5, method="euler", engine="casadi")
    ponderous = Controls(
        SHIP.with_values({"added_mass.X_udot": -1e9, "hull.derivatives.X_u|u|": -2.1, "unusual": ["added_mass.X_udot"]})
    )
    with pytest.raises(ShipidError, match=r"after 3600 s straight ahead at 145 rpm: let a helmsman"):
        steady_approach(ponderous, np.array([145 / 60]), step=0.5, method="euler", engine="casadi")


def test_a_large_and_slow_ship_reaches_her_speed_whatever_time_that_takes() -> None:
    given = Particulars(length=300.0, beam=58.0, draught=20.8, block=0.82, speed=8.0)
    tanker = Controls(first_guess(given, "tanker", "tanker.toml").vessel)
    for shaft in (0.4,):
        steadily = steady_approach(tanker, np.array([shaft]), step=1.0, method="euler", engine="casadi")
        balanced = fsolve(
            lambda u, n=shaft: straight_acceleration(tanker.vessel, float(u[0]), tanker.ahead(n))[0], 8 * shaft
        )
        assert steadily.state["u"][0] == pytest.approx(balanced[0], rel=0.015)
    creeping = service_shaft(tanker.vessel, 0.2) or 0.0  # she was said to be steady at 0.15 m/s, and at 0.1 m/s at rest
    slowly = steady_approach(tanker, np.array([creeping]), step=30.0, method="rk4", engine="casadi")
    assert slowly.state["u"][0] == pytest.approx(0.2, rel=0.015)
    stopped = steady_approach(tanker, np.array([0.0, 1e-4]), step=1.0, method="euler", engine="casadi")
    np.testing.assert_allclose(stopped.state["u"], 0.0, atol=0.05)  # at rest at once, not after hours of approach


LAGS = {"thruster.port.actuator.alpha": {"kind": "first_order", "T": 0.5, "rate": 0.21}}


@pytest.mark.parametrize(
    ("key", "changes", "n"),
    [
        ("gunnerus-28.9", {"thruster.starboard.off": True}, [2.0, 3.0]),
        ("gunnerus-28.9", {"thruster.starboard.off": True} | LAGS, [2.0]),
        ("kvlcc2-l7", {"hull.mmg.N_u": 4e-4, "hull.mmg.Y_u": -1e-3}, [10.229]),  # course-unstable, and uneven
    ],
)
def test_a_helmsman_holds_what_does_not_go_straight(key: str, changes: dict[str, object], n: list[float]) -> None:
    """No velocity changes with the helm that he holds, and the yaw rate is nil."""
    vessel = load_vessel(key).with_values(changes)
    controls, model = Controls(vessel), vessel_dynamics(vessel)
    how = {"step": 0.1, "method": "rk4", "engine": "casadi"}
    with pytest.raises(NotStraight, match="helmsman"):
        steady_approach(controls, np.array(n), **how)  # type: ignore[arg-type]
    approach = steady_approach(controls, np.array(n), held=True, **how)  # type: ignore[arg-type]
    assert set(approach.helm) == set(controls.helm)
    assert set(approach.memory) == set(model.memory)
    for place, shaft in enumerate(n):
        helm = {name: values[place] for name, values in approach.helm.items()}
        orders = {name: shaft if name in controls.drives else 0.0 for name in model.commands} | helm
        state = [approach.state[name][place] for name in (*model.state, *model.hidden)]
        memory = [approach.memory[name][place] for name in model.memory]
        rates = np.array(
            model.rates(
                state, memory, [orders[name] for name in model.commands], np.zeros(len(model.environment)),
                list(vessel.parameters.values()), np.zeros(model.num_dof),
            )
        ).ravel()  # fmt: skip
        assert np.abs(rates[3:]).max() < 1e-4 * approach.state["u"][place]
        assert abs(approach.state["r"][place]) < 1e-4
        assert 0.001 < max(map(abs, helm.values())) < 0.3
    alone = steady_approach(controls, np.array(n[:1]), held=True, **how)  # type: ignore[arg-type]
    assert alone.state["u"][0] == approach.state["u"][0]  # whatever the company
