"""The variational step: structure of a layout, states that are left out, and derivatives of one step."""

from __future__ import annotations

from typing import Any

import pytest

from shipid.identification.sensitivities import FitLayout, build_variation, is_thrust
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.drawn_ships import drawn_ship

SHIP = load_vessel("gunnerus-28.9")
PATH = "hull.derivatives.N_ur"


def layout(signals: tuple[str, ...] = ("u", "v", "r"), nuisances: tuple[str, ...] = (), step: float = 0.5) -> FitLayout:
    return FitLayout(vessel_dynamics(SHIP), ((PATH,),), signals, nuisances, (), 0, step, "rk4")


def test_thrust_coefficients_are_recognised() -> None:
    assert is_thrust("thruster.port.k_T")
    assert is_thrust("thruster.propeller.K_T.J")
    assert not is_thrust("thruster.port.D_p")
    assert not is_thrust("hull.mmg.R_0")


@pytest.mark.parametrize(
    ("kind", "sense"),
    [("azimuth", 1.0), ("propeller", -1.0), ("controllable_pitch", 1.0), ("four_quadrant", -1.0), ("quadratic", 1.0)],
)
def test_thrust_of_every_kind_is_linear_in_its_coefficients(kind: str, sense: float) -> None:
    ships = (drawn_ship(seed) for seed in range(100))
    ship, name = next((one, name) for one in ships for name, block in thrusters(one) if block["kind"] == kind)
    ship = ship.with_values({f"thruster.{name}.k_drag": 0.0}) if kind == "propeller" else ship

    def thrust(scale: float) -> float:
        values = [value * (scale if is_thrust(path) else 1.0) for path, value in ship.parameters.items()]
        model = vessel_dynamics(ship)
        state = [{"u": 1.0, "v": 0.2, "r": 0.01}.get(one, 0.0) for one in (*model.state, *model.hidden)]
        orders = [sense if one.endswith((".n", ".pitch")) else 0.1 for one in model.commands]
        memory = [orders[list(model.commands).index(one)] for one in model.memory]
        shown = model.measured(state, memory, orders, [0.0] * len(model.environment), values)
        return float(shown[list(model.outputs).index(f"{name}.thrust")])

    assert thrust(1.0) != 0.0
    assert thrust(1.2) == pytest.approx(1.2 * thrust(1.0), rel=1e-12)


def thrusters(ship: Vessel) -> list[tuple[str, dict[str, Any]]]:
    return list(ship.document["thruster"].items())


def test_only_states_that_influence_a_signal_are_integrated() -> None:
    assert set(build_variation(layout()).states) == {"u", "v", "r"}
    assert {"north", "east", "psi"} <= set(build_variation(layout((*layout().signals, "north", "east"))).states)


def test_nuisances_that_change_the_motion_are_columns() -> None:
    one = layout(nuisances=("current_north", "current_east", "heading_bias"))
    assert one.num_moving == 2
    assert build_variation(one).num_columns == len(build_variation(one).node) + 1 + 2
