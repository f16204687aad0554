"""Names of columns: their units, and what they may be."""

from __future__ import annotations

import pytest

from shipid.logs.guess.clues import names_another, unit_of_another, unknown_unit
from shipid.logs.guess.words import factor_in_name, unit_in_name


@pytest.mark.parametrize(
    ("name", "si", "unit"),
    [
        ("sog [kn]", "m/s", "kn"),
        ("sog (knots)", "m/s", "kn"),
        ("speed_kmh", "m/s", "km/h"),
        ("psi_rad", "rad", "rad"),
        ("rot [deg/min]", "rad/s", "deg/min"),
        ("shaft rpm", "rev/s", "rpm"),
        ("rpm", "rev/s", "rpm"),
        ("heading", "rad", None),
        ("Heading(deg T)", "rad", "deg"),
        ("v_long_ms", "m/s", "m/s"),
        ("Drehrate [°/s]", "rad/s", "deg/s"),
        ("r_deg_min", "rad/s", "deg/min"),
        ("Drehzahl [U/min]", "rev/s", "rpm"),
        ("Engine (%)", "rev/s", "%"),
        ("船速（ノット）", "m/s", "kn"),
        ("転回率 [度/分]", "rad/s", "deg/min"),
        ("主机转速(转/分)", "rev/s", "rpm"),
        ("sog [kn]", "rad", None),
        ("deg", "rad", None),
        ("Rudder [mrad]", "rad", "rad"),
        ("Engine [krpm]", "rev/s", "rpm"),
    ],
)
def test_a_unit_is_read_only_where_the_column_can_have_it(name: str, si: str, unit: str | None) -> None:
    assert unit_in_name(name, si) == unit


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        *(("Engine [krpm]", 1e3), ("kRPM", 1e3), ("shaft_krpm", 1e3), ("Rudder [mrad]", 1e-3), ("r_mdeg/s", 1e-3)),
        *(("rpm", 1.0), ("Tank RPM", 1.0), ("TankRPM", 1.0), ("Rudder [deg]", 1.0), ("Depth [cm]", 1.0), ("sog", 1.0)),
    ],
)
def test_the_prefix_of_a_unit_is_a_factor(name: str, factor: float) -> None:
    assert factor_in_name(name) == factor


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        *(("Rudder [mV]", "mV"), ("Rudder [V]", "V"), ("Shaft [counts]", "counts")),
        *((f"Roll [{part}]", part) for part in ("0.1 deg", "1/10 deg", "0,01°", "deg x 10", "deg*10", "deg/10")),
        *(
            (f"Rudder {note}", "")
            for note in ("[deg]", "[mrad]", "[-]", "(stbd)", "(P)", "(order)", "(feedback)", "(2)")
        ),
        *((f"Heading {note}", "") for note in ("[deg M]", "(deg T)", "(mag)", "(gyro)", "")),
    ],
)
def test_a_unit_that_is_not_known_is_told_from_a_note(name: str, unit: str) -> None:
    assert unknown_unit(name) == unit


@pytest.mark.parametrize(
    ("name", "meaning", "unit"),
    [
        ("VITESSE ARBRE [rpm]", "speed", "rpm"),
        ("Vitesse [kn]", "speed", None),
        ("T_prop_kN", "n", "kN"),
        ("Roll, deg", "r", "deg"),
        ("Ruder Bb U/min", "delta", "U/min"),
        ("Azimut Bb min-1", "alpha", "min-1"),
        ("Wendegeschw. 1/s", "r", None),
        ("Drive [krpm]", "delta", "krpm"),
        ("Drive [mrad]", "n", "mrad"),
        ("speed", "speed", None),
    ],
)
def test_a_unit_excludes_what_it_does_not_fit(name: str, meaning: str, unit: str | None) -> None:
    assert unit_of_another(name, meaning) == unit


@pytest.mark.parametrize(("name", "said"), [("RULL deg", True), ("Torque", True), ("p", False), ("wz", False)])
def test_a_word_for_another_quantity_is_no_yaw_rate(name: str, said: bool) -> None:
    assert names_another(name, "r") == said
