"""Standard manoeuvres by name: speeds, sides, steps, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from shipid.errors import ShipidError
from shipid.measures.recognise import record_of
from shipid.measures.record import Measures
from shipid.simulation.approach import Controls
from shipid.simulation.manoeuvre import Zigzag
from shipid.simulation.perform import perform_manoeuvres
from shipid.simulation.standard import define_standard, shaft_speed
from shipid.vessel.load import load_vessel
from tests.measures.test_laws import SIGNED, TOLERANCE

SHIP = load_vessel("gunnerus-28.9")


def measured(name: str, *angles: float, **how: object) -> Measures:
    chosen = define_standard(SHIP, name, angles, **how)  # type: ignore[arg-type]
    log = perform_manoeuvres(SHIP, [chosen.manoeuvre], step=chosen.step, interval=chosen.interval)
    return chosen.manoeuvre.measures(record_of({str(key): log[key].to_numpy() for key in log if key != "run"}))


@pytest.mark.parametrize("speed", [1.5, 3.0, 5.0])
def test_shaft_speed_gives_the_speed(speed: float) -> None:
    n_rpm = 60 * shaft_speed(Controls(SHIP), speed)
    path = perform_manoeuvres(SHIP, [Zigzag(n_rpm=n_rpm, duration=1.0)], step=0.1)
    assert path["u"].iloc[0] == pytest.approx(speed, abs=0.02)  # an approach ends where it changes by 1 mm/s in 30 s


def test_a_speed_that_no_shaft_speed_gives_is_refused() -> None:
    with pytest.raises(ShipidError, match=r"--speed: no shaft speed or force drives .* at 100 m/s: give a lower speed"):
        define_standard(SHIP.with_values({"hull.derivatives.X_uu": -1e9}), "turning", speed=100.0)


def test_thrust_about_a_service_speed_says_nothing_of_a_stop() -> None:
    """The Mariner would stop in 0.3 lengths: thrust less resistance is a cubic of u / U_0 - n / n_0."""
    mariner = load_vessel("mariner")
    with pytest.raises(
        ShipidError, match=r"thruster\.propeller: Mariner .* cannot stop: .* near its service speed alone"
    ):
        define_standard(mariner, "stop")
    assert define_standard(mariner, "turning").speed == pytest.approx(7.7175)


@pytest.mark.parametrize(
    ("name", "angles"), [("zigzag", (10.0, 10.0)), ("turning", ()), ("stop", ()), ("pull-out", ())]
)
def test_all_is_measured_and_sides_mirror(name: str, angles: tuple[float, ...]) -> None:
    """The bundled ship has the same helm to both sides."""
    starboard, port = (measured(name, *angles, side=side) for side in ("starboard", "port"))
    assert all(np.isfinite(one.value) for one in starboard.values())
    for key, one in starboard.items():
        sign = -1 if key in SIGNED else 1
        assert port[key].value == pytest.approx(sign * one.value, abs=2 * TOLERANCE[one.unit]), key


@pytest.mark.parametrize(
    ("name", "angles", "how", "message"),
    [
        ("zigzak", (), {}, "manoeuvre 'zigzak' is not known: did you mean 'zigzag'?"),
        ("zigzag", (1, 2, 3), {}, "ANGLES: zigzag takes 2 angles"),
        ("stop", (1,), {}, "ANGLES: stop takes no angles, not 1"),
        ("turning", (-35,), {}, "ANGLES: -35 deg: angles are above 0 and at most 90 deg"),
        ("turning", (), {"side": "left"}, "side 'left' is not known"),
        ("turning", (), {"speed": 0.0}, "--speed: 0 m/s"),
        ("turning", (), {"speed": 1e160}, "--speed: 1e+160 m/s: the speed of the approach must be above 0"),
        ("turning", (), {"duration": 0.0}, "duration must be a number above 0"),
        ("turning", (), {"duration": 1e12}, "--duration: "),
        ("turning", (), {"duration": 3.0}, "--duration: 3 s is over before the first order, at 8.6 s of the log"),
        ("turning", (float("inf"),), {}, "ANGLES: inf deg: angles are above 0 and at most 90 deg"),
        ("zigzag", (20, 400), {}, "ANGLES: 400 deg: angles are above 0 and at most 180 deg"),
    ],
)
def test_what_cannot_be_done_is_refused(
    name: str, angles: tuple[float, ...], how: dict[str, object], message: str
) -> None:
    with pytest.raises(ShipidError, match=f"^{re.escape(message)}"):
        define_standard(SHIP, name, angles, **how)  # type: ignore[arg-type]
