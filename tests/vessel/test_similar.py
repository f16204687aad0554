"""Similar ships: scaling laws over all bundled vessels, friction and screws, the order of neighbours."""

from __future__ import annotations

import math
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import tomlkit

from shipid.document import bundled_documents
from shipid.engine.rollout import rollout
from shipid.errors import DocumentError
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.similar import (
    SCREW_SIZES,
    fit_screws,
    friction_change,
    nearest_ships,
    particulars_distance,
    read_ships,
    scale_vessel,
    similar_vessels,
    vessel_particulars,
)
from shipid.vessel.stability import service_shaft, straight_acceleration, straight_orders

EVERY = pytest.mark.parametrize("name", list(bundled_documents("models")))
LIKE_ESSO = {"L_pp": 320.0, "B": 50.0, "T": 19.0, "C_b": 0.82, "U_0": 8.0}


@EVERY
def test_scaling_by_one_is_the_identity(name: str) -> None:
    vessel = load_vessel(name)
    scaled = scale_vessel(vessel, 1.0, vessel.document["constants"]["rho"])
    assert scaled.parameters == {path: vessel.parameters[path] for path in scaled.parameters}
    assert {path for path in vessel.parameters if path not in scaled.parameters} <= {"constants.g"}  # of the waves


@EVERY
def test_scaling_up_and_down_returns(name: str) -> None:
    vessel = load_vessel(name)
    there = scale_vessel(vessel, 0.37, 1000.0)
    back = scale_vessel(there, 1 / 0.37, vessel.document["constants"]["rho"])
    assert back.parameters == pytest.approx({path: vessel.parameters[path] for path in back.parameters}, rel=1e-12)
    assert vessel_particulars(back) == pytest.approx(vessel_particulars(vessel), rel=1e-12)


@EVERY
@pytest.mark.parametrize(("ratio", "rho"), [(1.7, None), (0.2, 1000.0)])
def test_a_scaled_ship_performs_the_same_path_in_ship_lengths(name: str, ratio: float, rho: float | None) -> None:
    """At the same Froude number, with orders and steps in its own time; an MMG hull has a least speed of 0.01 m/s."""
    vessel = scale_vessel(load_vessel(name), 1.0)
    vessel = vessel.with_values({"wind.off": True}) if "wind" in vessel.document else vessel
    scaled, fast = scale_vessel(vessel, ratio, rho), math.sqrt(ratio)
    U = vessel_particulars(vessel).get("U_0", 3.0)
    n = service_shaft(vessel, U) or 0.0
    turned = {path: 0.3 for path in vessel_dynamics(vessel).commands if path.endswith(("delta", "alpha"))}
    shafts = [path for path in vessel_dynamics(vessel).commands if path not in turned]
    paths = []
    for ship, time in ((vessel, 1.0), (scaled, fast)):
        orders = {path: value * np.ones(1) for path, value in (straight_orders(ship, n / time) | turned).items()}
        orders[shafts[-1]] = orders[shafts[-1]] * 0.8
        start = {name: np.zeros(1) for name in vessel_dynamics(ship).state} | {"u": np.full(1, U * time)}
        calm = {name: np.zeros(1) for name in vessel_dynamics(ship).environment}
        step = 0.02 * vessel_particulars(ship)["L_pp"] / (U * time)
        path = rollout(ship, start, orders, calm, step=step, num_steps=100, method="rk4")
        paths.append(np.stack([path["north"], path["east"]]) / vessel_particulars(ship)["L_pp"])
    assert np.ptp(paths[0][0]) > 0.3  # it went somewhere
    np.testing.assert_allclose(paths[1], paths[0], rtol=0, atol=1e-4 if "mmg" in vessel.document["hull"] else 1e-9)


def test_friction_is_that_of_the_ittc_line() -> None:
    """KVLCC2 at 7 m and 320 m, with the formulae written out."""
    model = load_vessel("kvlcc2-l7")
    ratio = 320 / 7
    ship = scale_vessel(model, ratio)
    U = 1.179 * math.sqrt(ratio)
    Re = [1.179 * 7 / 1.19e-6, U * 320 / 1.19e-6]
    C_F = [0.075 / (math.log10(number) - 2) ** 2 for number in Re]
    k = -0.095 + 25.6 * 0.81 / ((7 / 1.27) ** 2 * math.sqrt(1.27 / 0.46))
    S = 2.6 * math.sqrt(ship.parameters["inertia.m"] / 1000 * 320)
    by_hand = 500 * S * ((1 + k) * (C_F[1] - C_F[0]) + 0.006 * 420**-0.16 - 0.00205)
    assert friction_change(ship, ratio, U) == pytest.approx(by_hand, rel=1e-9)
    assert pytest.approx(27194, rel=0.05) == S  # SIMMAN 2008 gives 27,194 m^2
    assert friction_change(model, 1.0, 1.179) == 0


@EVERY
def test_screws_hold_the_speed_at_the_shaft_speed(name: str) -> None:
    vessel = load_vessel(name)
    U = vessel_particulars(vessel).get("U_0", 3.0)
    n = 1.1 * (service_shaft(vessel, U) or 0.0)
    fitted, factor = fit_screws(vessel, U, n)
    assert SCREW_SIZES[0] < factor <= 1
    assert straight_acceleration(fitted, U, straight_orders(fitted, n))[0] == pytest.approx(0, abs=1e-8)
    assert fit_screws(vessel, U, 0.05 * n)[1] == 1.0  # no screw is so large


@EVERY
def test_every_ship_has_neighbours_that_take_its_orders_and_hold_its_speed(name: str) -> None:
    own = load_vessel(name)
    known = vessel_particulars(own)
    found = [*islice(similar_vessels(known, read_ships(), own), 3)]
    assert [distance for distance, _ in found] == sorted(distance for distance, _ in found)
    assert len({one.key for _, one in found}) == 3
    for _, one in found:
        assert one.digest != own.digest
        assert set(vessel_dynamics(one).commands) <= set(vessel_dynamics(own).commands)
        assert one.length == pytest.approx(own.length)
    again = next(similar_vessels(known, [*read_ships()][::-1], own))  # in another order
    assert again[1].digest == found[0][1].digest


def test_written_vessels_load_as_they_are(tmp_path: Path) -> None:
    for _, one in islice(similar_vessels(LIKE_ESSO, read_ships()), 3):
        file = tmp_path / f"{one.key}.toml"
        file.write_text(tomlkit.dumps(one.document), encoding="utf-8")
        assert load_vessel(file).digest == one.digest


def test_the_nearest_ship_is_the_one_of_its_kind() -> None:
    ships = read_ships()
    order = [vessel.key for _, vessel in nearest_ships(LIKE_ESSO, ships)]
    assert order[0] == "esso-190k"
    assert len(order) < len(ships)  # one vessel of each ship
    assert len({"kvlcc2-l7", "kvlcc2-hsva"} & set(order)) == 1
    assert particulars_distance(LIKE_ESSO, LIKE_ESSO) == 0
    assert particulars_distance(LIKE_ESSO, {"L_pp": 320.0}) == pytest.approx(math.sqrt(8 / 5))  # what one lacks is far


def test_ships_of_a_folder_count(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(
        tomlkit.dumps(next(similar_vessels(LIKE_ESSO, read_ships()))[1].document), encoding="utf-8"
    )
    (tmp_path / "study.toml").write_text('question = "?"\n')
    assert Path(read_ships(tmp_path)[-1].file).name == "mine.toml"
    with pytest.raises(DocumentError, match="no vessel in the TOML files of this folder"):
        read_ships(tmp_path / "none")


def test_a_ship_driven_otherwise_lends_its_hull_alone() -> None:
    own: Vessel = load_vessel("naval-51")
    found = {one.key: one for _, one in similar_vessels(vessel_particulars(own), read_ships(), own)}
    assert "screws and helms are those of your own ship" in found["gunnerus-28.9"].document["source"]
    assert vessel_dynamics(found["cybership2"]).commands == vessel_dynamics(own).commands
    assert "mariner" not in found  # its thrust and resistance are one polynomial


def test_a_screw_about_its_service_speed_takes_any_shaft_speed() -> None:
    vessel = load_vessel("mariner")
    for n in (0.2, 4.1):  # geared otherwise: the speed is held all the same
        fitted, factor = fit_screws(vessel, 7.7, n)
        assert factor != 1.0
        assert straight_acceleration(fitted, 7.7, straight_orders(fitted, n))[0] == pytest.approx(0, abs=1e-8)
