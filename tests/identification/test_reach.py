"""How far data and manoeuvres reach, and the warning where a manoeuvre goes beyond."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.identification.bands import Reach, data_reach, extrapolation_sentence, of_log
from shipid.simulation.manoeuvre import TurningCircle
from shipid.simulation.perform import perform_manoeuvres
from shipid.units import DEGREE
from shipid.vessel.load import load_vessel
from tests.identification.trials import trials

SHIP = load_vessel("kvlcc2-l7")


def test_it_is_the_greatest_of_the_motion() -> None:
    u, v, r = np.array([2.0, 2.0, 0.8]), np.array([0.0, -2.0, 0.0]), np.array([0.0, 0.1, -0.3])
    helm = np.array([0.0, -30.0, 10.0]) * DEGREE
    reach = Reach.of(SHIP, {"u": u, "v": v, "r": r, "rudder.delta": helm, "propeller.n": u})
    assert reach.drift == pytest.approx(45)
    assert reach.rate == pytest.approx(0.3 * 7 / 0.8)
    assert reach.helm == pytest.approx(30)
    assert reach.speed == 0.8


@pytest.mark.parametrize(
    ("name", "words", "near", "far"),
    [
        ("drift", "deg of drift", 21.8, 23.0),
        ("rate", "r L / U of", 0.54, 0.58),
        ("helm", "deg of helm", 32.5, 34.0),
        ("speed", "a speed of", 1.9, 1.7),
    ],
)
def test_each_part_has_a_tenth_to_spare(name: str, words: str, near: float, far: float) -> None:
    data = Reach(drift=20.0, rate=0.5, helm=30.0, speed=2.0)
    assert extrapolation_sentence("a turn", replace(data, **{name: near}), data) == ""
    sentence = extrapolation_sentence("a turn", replace(data, **{name: far}), data)
    assert words in sentence
    assert " and " not in sentence
    little = Reach(drift=0.5, rate=0.01, helm=0.5, speed=2.0)
    assert extrapolation_sentence("a turn", Reach(drift=1.4, rate=0.029, helm=1.4, speed=2.0), little) == ""
    sentence = extrapolation_sentence("a turn", Reach(drift=1.6, rate=0.031, helm=1.6, speed=2.0), little)
    assert sentence == "a turn reaches 2 deg of drift, r L / U of 0.03 and 2 deg of helm; the data reach 0, 0.01 and 0"


def test_a_ship_at_rest_has_no_drift() -> None:
    still = dict.fromkeys(("u", "v", "r", "rudder.delta", "propeller.n"), np.zeros(3))
    assert Reach.of(SHIP, still) == Reach(0.0, 0.0, 0.0, 0.0)


def test_a_hard_turn_goes_beyond_gentle_trials_and_not_beyond_itself() -> None:
    hard = perform_manoeuvres(SHIP, [TurningCircle(n_rpm=627, angle_deg=35, duration=60)], step=0.1)
    gentle = perform_manoeuvres(SHIP, [TurningCircle(n_rpm=627, angle_deg=3, duration=20)], step=0.1)
    sentence = extrapolation_sentence("turning 35", of_log(SHIP, hard), of_log(SHIP, gentle))
    assert sentence.startswith("turning 35 reaches ")
    for word in ("deg of drift", "r L / U of", "35 deg of helm", "a speed of", "; the data reach"):
        assert word in sentence
    assert extrapolation_sentence("turning 35", of_log(SHIP, hard), of_log(SHIP, hard)) == ""
    data = trials(SHIP, runs=2, steps=40)
    assert data_reach(SHIP, data, ["M01"]).helm <= 0.6 / DEGREE
