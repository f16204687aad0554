"""Drawn ships: the same by any order, inside their ranges, course-keeping as a ship's, and none of the template's."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.exchange.ships import SHIP_TYPES, Dice, DrawnShip, _linear_derivatives, draw_ship
from shipid.simulation.approach import Controls
from shipid.simulation.manoeuvre import ConstantOrders
from shipid.simulation.perform import perform_manoeuvres
from shipid.vessel.stability import service_shaft
from shipid.vessel.template import Particulars, first_guess

SEED = 611  # no record has it


@pytest.fixture(scope="module")
def fleet() -> list[DrawnShip]:
    return [draw_ship(SEED, number) for number in range(len(SHIP_TYPES))]


def test_a_ship_depends_on_its_seed_and_number_alone(fleet: list[DrawnShip]) -> None:
    alone = draw_ship(SEED, 7)
    assert alone == fleet[7]
    assert alone.vessel().digest == fleet[7].vessel().digest
    digests = {ship.vessel().digest for ship in (*fleet, draw_ship(SEED + 1, 7), draw_ship(SEED, 17))}
    assert len(digests) == len(fleet) + 2


def test_every_type_is_drawn_within_its_ranges(fleet: list[DrawnShip]) -> None:
    assert {ship.type for ship in fleet} == set(SHIP_TYPES)
    for ship in fleet:
        kind, given = SHIP_TYPES[ship.type], ship.particulars
        numbers = (
            given.length,
            given.service / np.sqrt(9.81 * given.length),
            given.length / given.beam,
            given.beam / given.draught,
            given.block,
        )
        ranges = (kind.length, kind.froude, kind.slender, kind.beamy, kind.block)
        assert all(
            low <= value * (1 + 1e-9) and value <= high * (1 + 1e-9)
            for value, (low, high) in zip(numbers, ranges, strict=True)
        )


def test_a_ship_turns_to_the_side_of_its_helm_and_loses_speed(fleet: list[DrawnShip]) -> None:
    for ship in fleet:
        vessel, given = ship.vessel(), ship.particulars
        controls, rpm, passing = Controls(vessel), given.rpm, given.length / given.service
        turns = []
        for side in (1.0, -1.0):
            if controls.differential:
                orders = {"port.n_rpm": rpm * (0.85 + 0.15 * side), "starboard.n_rpm": rpm * (0.85 - 0.15 * side)}
            else:
                name, sign = next(iter(controls.helm.items()))
                orders = {"n_rpm": rpm, f"{name.rpartition('.')[2]}_deg": 10 * side * sign}
            turns.append(ConstantOrders(orders=orders, duration=15 * passing, start_speed=given.service))
        end = perform_manoeuvres(vessel, turns, step=passing / 50).groupby("run").last()
        assert (np.sign(end["r"]) == [1, -1]).all(), ship
        assert (end["u"] < given.service).all(), ship


def test_the_shaft_speed_of_the_particulars_holds_the_service_speed(fleet: list[DrawnShip]) -> None:
    for ship in fleet:
        given, vessel = ship.particulars, ship.vessel()
        n = service_shaft(vessel, given.service)
        assert given.rpm == pytest.approx(60 * float(n or 0))


def test_the_truth_is_not_what_the_template_gives(fleet: list[DrawnShip]) -> None:
    """Same commands, so that one log fits both; no hull number of the one is in the other, and the paths part."""
    for ship in fleet:
        truth, guess = ship.vessel(), first_guess(ship.particulars, "guess", "guess.toml").vessel
        assert Controls(truth).commands == Controls(guess).commands
        hulls = [
            {path for path in one.parameters if path.startswith("hull.") and "R_" not in path} for one in (truth, guess)
        ]
        assert not hulls[0] & hulls[1]


def test_the_regressions_are_those_of_the_mariner_within_their_scatter() -> None:
    """Planar motion tests of Chislett and Stroem-Tejsen (1965): Y_v -1160e-5, N_v -264e-5, N_r -166e-5."""
    mariner = Particulars(160.93, 23.17, 7.47, 0.597)
    drawn = [_linear_derivatives(mariner, Dice((SEED, number))) for number in range(60)]
    for name, measured in {"Y_v": -1160e-5, "N_v": -264e-5, "N_r": -166e-5}.items():
        values = np.array([one[name] for one in drawn])
        assert 0.6 < np.median(values) / measured < 1.8, name
        assert np.ptp(values) > 0.3 * abs(measured), name


def test_dice_of_another_name_change_no_draw() -> None:
    dice = Dice((1, "ship"))
    before = dice("length", 2.0, 300.0)
    dice("beam", 0.0, 1.0)
    assert dice("length", 2.0, 300.0) == before
    factors = [Dice((k,)).scatter("x", 0.25) for k in range(400)]
    assert 0.8 <= min(factors) < 0.82 < 1.22 < max(factors) <= 1.25
    assert abs(np.log(factors).mean()) < 0.02
