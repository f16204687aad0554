"""Design: information adds, what excites a parameter ranks first for it, units and limits are respected."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from shipid.errors import ShipidError
from shipid.identification.design import (
    InformedCandidate,
    candidate_manoeuvres,
    information_of_candidates,
    information_where_possible,
    rank_candidates,
    within_limits,
)
from shipid.identification.settings import Identify
from shipid.simulation.manoeuvre import (
    ApproachedManoeuvre,
    CrashStop,
    Excitation,
    PullOut,
    Spiral,
    TurningCircle,
    Zigzag,
)
from shipid.vessel.load import load_vessel

SHIP = load_vessel("gunnerus-28.9")
WEIGHTS = {"u": 0.1, "v": 0.1, "r": 0.0035}
PATHS = tuple(f"hull.derivatives.{name}" for name in ("X_u|u|", "Y_ur", "N_ur", "N_r|r|"))
SETTINGS = Identify(parameters=list(PATHS), weights=WEIGHTS)
CHOICE = candidate_manoeuvres(SHIP, [3.0])


@cache
def informed_choice() -> list[InformedCandidate]:
    """What each candidate tells of the four factors."""
    return information_of_candidates(SHIP, CHOICE, SETTINGS)


def kind(title: str) -> str:
    return title.split(",")[0].split(" ")[0]


def alone(path: str, by: str) -> list[str]:
    """Manoeuvres in order, for one factor that is the only one unknown."""
    j = PATHS.index(path)
    single = [InformedCandidate(one.candidate, one.information[j : j + 1, j : j + 1]) for one in informed_choice()]
    return list(rank_candidates(single, (path,)).sort_values(by, ascending=False)["manoeuvre"])


def test_what_excites_a_parameter_ranks_first_for_it() -> None:
    """Drag: the speed run, which turns nothing. Yaw damping: a zigzag or a hard turn, a speed run last of all."""
    assert kind(alone("hull.derivatives.X_u|u|", "per_hour")[0]) == "speed"
    yaw = alone("hull.derivatives.N_r|r|", "per_hour")
    assert kind(yaw[0]) == "zigzag"
    for by in ("gain", "per_hour"):
        assert kind(alone("hull.derivatives.N_r|r|", by)[-1]) == "speed"


def test_a_speed_run_says_nothing_of_yaw() -> None:
    run = next(one for one in informed_choice() if one.candidate.title.startswith("speed"))
    np.testing.assert_allclose(run.information[1:, 1:], 0, atol=1e-9 * run.information[0, 0])


def test_information_adds() -> None:
    """Two runs bring what the first and then the second bring; more never harms; the second of a kind brings less."""
    table = rank_candidates(informed_choice(), PATHS).set_index("manoeuvre")
    first = informed_choice()[0]
    then = rank_candidates(informed_choice(), PATHS, first.information).set_index("manoeuvre")
    other = informed_choice()[1]
    both = InformedCandidate(other.candidate, first.information + other.information)
    assert rank_candidates([both], PATHS)["gain"][0] == pytest.approx(
        table["gain"][first.candidate.title] + then["gain"][other.candidate.title]
    )
    assert (table["gain"] > 0).all()
    assert (then["gain"] < table["gain"].reindex(then.index)).all()


def test_sensitivities_are_those_of_the_trajectory() -> None:
    """Free starts cost information; half the standard deviation brings four times as much; longer predictions more."""
    half = {name: width / 2 for name, width in WEIGHTS.items()}
    short, sharp = (
        information_of_candidates(SHIP, CHOICE[:1], SETTINGS.model_copy(update=change))[0].information
        for change in ({"horizon": 5.0}, {"weights": half})
    )
    assert (np.diag(short) < np.diag(informed_choice()[0].information)).all()
    np.testing.assert_allclose(sharp, 4 * informed_choice()[0].information, rtol=1e-9)


def test_what_the_ship_cannot_perform_is_left_out_and_the_others_are_as_they_were() -> None:
    wild = SHIP.with_values({"hull.derivatives.N_rrr": 2e10})  # she spins up in a hard turn
    with pytest.raises(ShipidError, match="diverges"):
        information_of_candidates(wild, CHOICE, SETTINGS)
    some = information_where_possible(wild, CHOICE, SETTINGS)
    titles = {kind(one.candidate.title) for one in some}
    assert "speed" in titles
    assert "turning" not in titles
    speed = next(one for one in some if kind(one.candidate.title) == "speed")
    alone = information_of_candidates(wild, [speed.candidate], SETTINGS)[0]
    np.testing.assert_allclose(speed.information, alone.information, rtol=1e-9)
    with pytest.raises(ShipidError, match="diverges"):
        information_where_possible(wild, [one for one in CHOICE if kind(one.title) == "turning"], SETTINGS)


@pytest.mark.parametrize(
    ("manoeuvre", "helm", "rpm"),
    [
        (TurningCircle(n_rpm=100, duration=60), 35, 100),
        (PullOut(n_rpm=100, duration=60, turn=30, angle_deg=15), 15, 100),
        (Zigzag(n_rpm=100, duration=60), 20, 100),
        (Spiral(n_rpm=100, hold=60), 25, 100),
        (CrashStop(n_rpm=100, astern_rpm=130, duration=60), 0, 130),
        (Excitation(n_rpm=100, amplitude_rpm=20, angle_deg=12, duration=60), 12, 120),
    ],
)
def test_no_kind_orders_more_than_the_limits(manoeuvre: ApproachedManoeuvre, helm: float, rpm: float) -> None:
    assert manoeuvre.greatest_orders == pytest.approx((helm, rpm))
    assert within_limits(manoeuvre, rpm)
    assert not within_limits(manoeuvre, 0.99 * rpm)
    time = np.linspace(0, manoeuvre.length, 1000)
    assert np.abs(manoeuvre.helm(time)).max() <= np.radians(helm) + 1e-9
    assert np.abs(manoeuvre.shaft(time)).max() <= rpm / 60 + 1e-9


def test_without_a_candidate_it_is_said() -> None:
    with pytest.raises(ShipidError, match="within the limits"):
        information_of_candidates(SHIP, candidate_manoeuvres(SHIP, [3.0], 1.0), SETTINGS)
