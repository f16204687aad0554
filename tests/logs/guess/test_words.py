"""Names of columns, cut into parts, fit their meanings in several languages and styles."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from shipid.logs.guess.words import (
    CONCEPTS,
    OTHERS,
    PHRASES,
    is_magnetic,
    is_order,
    is_run,
    meaning_scores,
    name_parts,
    side_in_name,
    units_in_name,
    wind_kind,
)
from shipid.physics.signals import SIGNALS


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("GPS_Lat", ("gps", "lat")),
        ("ShaftRPM_port", ("shaft", "rpm", "port")),
        ("yawRate", ("yaw", "rate")),
        ("Ruderwinkel [Grad]", ("rudder", "angle")),
        ("Kurs über Grund", ("course", "over", "ground")),
        ("ψ_m", ("psi", "m")),
        ("M/E RPM", ("me", "rpm")),
        ("左舷舵角（度）", ("port", "rudder", "angle")),
        ("ﾌﾟﾛﾍﾟﾗ回転数", ("propeller", "rpm")),
        ("舵機油圧", ("rudder", "unknownword")),
        ("eta_1", ("eta", "1")),
        ("", ()),
        ("[deg]", ()),
    ],
)
def test_parts(name: str, parts: tuple[str, ...]) -> None:
    assert name_parts(name) == parts


@pytest.mark.parametrize(
    ("name", "meaning"),
    [
        ("GPS_Lat", "latitude"),
        ("Rudder angle [deg]", "delta"),
        ("psi_meas", "psi"),
        ("Heading(deg T)", "psi"),
        ("v_long_ms", "u"),
        ("Speed trans.", "v"),
        ("yawRate", "r"),
        ("ShaftRPM_port", "n"),
        ("Wellendrehzahl", "n"),
        ("Svingrate", "r"),
        ("WIND SPD", "V_w"),
        ("water depth", "depth" if "depth" in SIGNALS else ""),
        ("STW", ""),
        ("KRÄNGUNG", "phi"),
        ("FÜG", "speed"),
        ("FüG", "speed"),
        ("Kurs über Grund", "course"),
        ("Fahrt durchs Wasser", ""),
        ("Vy / m/s", "v"),
        ("Drehmoment / kNm", "torque"),
        ("Taux de giration", "r"),
        ("VITESSE ARBRE [rpm]", "n"),
        ("ME RPS", "n"),
        ("A/E RPM", ""),
        ("船首方位", "psi"),
        ("対地針路", "course"),
        ("对地航速(节)", "speed"),
        ("转艏角速度", "r"),
        ("横摇角速度", "p"),
        ("舵角指令", "delta"),
        ("타각", "delta"),
        ("주기관 회전수", "n"),
        ("상대풍향", "beta_w"),
        ("加速度", ""),
        ("Широта", "latitude"),
        ("Частота вращения винта", "n"),
        ("BT_speed_[RPM]", "n"),
        ("Bow thr. [rpm]", "n"),
        ("Propellturtall satt", "n"),
        ("Koers over de grond", "course"),
        ("Toerental schroef", "n"),
        ("Ángulo de timón", "delta"),
        ("Velocidad sobre el fondo", "speed"),
        ("Giri elica", "n"),
        ("Sbandamento", "phi"),
        ("Rudder pump 1", ""),
        ("Azimut Bb 1/min", "n"),
        ("Pod Stb [U/min]", "n"),
        ("Z-Drive port rpm", "n"),
        ("Azipod port min-1", "n"),
        ("SRP Bb 1/min", "n"),
        ("SRP Bb Winkel", "alpha"),
        ("Pod Stb Winkel", "alpha"),
        ("T_prop", "thrust"),
        ("T_LEFT_N", "thrust"),
        ("field.pose.pose.position.x", "x"),  # as `rostopic echo -p` names it
        ("field.twist.twist.angular.z", "r"),
        ("LATI", "latitude"),
        ("LONGI", "longitude"),
    ],
)
def test_the_best_meaning(name: str, meaning: str) -> None:
    scores = meaning_scores(name)
    assert max(scores, key=lambda one: scores[one]) == meaning


@pytest.mark.parametrize("name", ["Heading setpoint", "psi_d", "Sollkurs", "HDG SET", "rudder_cmd"])
def test_an_order_is_no_measured_motion(name: str) -> None:
    assert is_order(name)
    motion = {meaning for meaning in meaning_scores(name) if meaning in SIGNALS and SIGNALS[meaning].role == "motion"}
    assert not motion


def test_an_order_of_the_rudder_is_a_command() -> None:
    assert meaning_scores("Rudder order")["delta"] > 0.6


@pytest.mark.parametrize(
    ("name", "side"),
    [("RPM P", "port"), ("n StB", "starboard"), ("Ruder BB", "port"), ("p", None), ("n act[1/s]", None)],
)
def test_sides(name: str, side: str | None) -> None:
    assert side_in_name(name) == side


@pytest.mark.parametrize("name", ["Ruderpropeller_Winkel_{}_deg", "rpm{}", "Ruder{}", "Drehzahl {} [1/min]", "n_{}"])
@pytest.mark.parametrize(("port", "starboard"), [("BB", "StB"), ("BB", "STB"), ("Bb", "Stb"), ("PS", "SB")])
def test_both_sides_of_a_pair_fit_the_same(name: str, port: str, starboard: str) -> None:
    names = name.format(port), name.format(starboard)
    assert [side_in_name(one) for one in names] == ["port", "starboard"]
    assert meaning_scores(names[0]) == meaning_scores(names[1])


TABLE = {meaning: phrases.split(", ") for meaning, phrases in {**PHRASES, "": OTHERS}.items()}
"""Meaning -> phrases of the table."""


def earlier_phrases() -> dict[str, list[str]]:
    """Meaning -> phrases, by language, of an earlier table that listed them all."""
    blocks = re.split(r"^\[(\w+)\]$", Path(__file__).with_name("phrases.txt").read_text(encoding="utf-8"), flags=re.M)
    return {
        "" if meaning == "OTHERS" else meaning: re.split(r",\s+", text.strip())
        for meaning, text in zip(blocks[1::2], blocks[2::2], strict=True)
    }


@pytest.mark.parametrize("table", [TABLE, earlier_phrases()], ids=["now", "earlier"])
def test_every_phrase_fits_its_meaning(table: dict[str, list[str]]) -> None:
    for meaning, phrases in table.items():
        for phrase in phrases:
            taken = not meaning and SIGNALS.keys() & meaning_scores(phrase)  # a signal takes a name that had no meaning
            if not is_order(phrase) and not taken:
                assert meaning_scores(phrase).get(meaning, 0.0) > 0.6, (meaning, phrase, meaning_scores(phrase))


def test_a_word_says_one_concept_and_a_concept_is_not_translated() -> None:
    words = [word for words in CONCEPTS.values() for word in words.split()]
    assert len(words) == len({*words})
    assert not {*words} & CONCEPTS.keys()


@pytest.mark.parametrize("angle", ["winkel", "vinkel", "hoek", " angolo", " angle", "Ang", "_angulo"])
@pytest.mark.parametrize(
    ("thing", "meaning"),
    [("Ruder", "delta"), ("TIMONE", "delta"), ("Roder", "delta"), ("thruster", "alpha"), ("azimut", "alpha")],
)
def test_combinations_of_languages_that_nobody_listed(thing: str, angle: str, meaning: str) -> None:
    name = f"{thing}{angle.upper() if thing.isupper() else angle} SB"
    scores = meaning_scores(name)
    assert max(scores, key=lambda one: scores[one]) == meaning


@pytest.mark.parametrize("prefix", ["f", "lr"])
@pytest.mark.parametrize("name", ["PosN", "TrueHeading", "Speed", "YawRate", "Rudder", "ShaftSpeed", "WindDirection"])
def test_a_type_before_a_name_says_nothing(prefix: str, name: str) -> None:
    assert meaning_scores(prefix + name) == meaning_scores(name)


@pytest.mark.parametrize(("name", "meaning"), [("nShaft", "n"), ("vEast", "velocity_east"), ("xEarth", "north")])
def test_a_symbol_before_a_name_is_no_type(name: str, meaning: str) -> None:
    scores = meaning_scores(name)
    assert max(scores, key=lambda one: scores[one]) == meaning


def test_a_name_that_says_nothing_fits_nothing() -> None:
    assert meaning_scores("Kanal 17") == {}
    assert meaning_scores("") == {}


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("AWA", "apparent"), ("Rel. wind dir", "apparent"), ("ApparentWindSpeed", "apparent"),
        ("TWD", "true"), ("true_wind_speed", "true"), ("TWA", ""), ("Wind", ""), ("true or relative wind", ""),
    ],
)  # fmt: skip
def test_the_name_of_a_wind_says_which(name: str, kind: str) -> None:
    assert wind_kind(name) == kind


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Run", True),
        ("test no", True),
        ("Versuch Nr.", True),
        ("essai_nr", True),
        ("Running hours", False),
        ("n", False),
    ],
)
def test_a_name_says_that_its_column_is_the_run(name: str, said: bool) -> None:
    assert is_run(name) == said


@pytest.mark.parametrize(
    ("name", "units"),
    [("Schub / kN", ["kN"]), ("v, m/s", ["m/s"]), ("u [kn]", ["kn"]), ("m/s", []), ("Wind speed", [])],
)
def test_units_that_are_set_off(name: str, units: list[str]) -> None:
    assert units_in_name(name) == units


@pytest.mark.parametrize(
    ("name", "magnetic"),
    [
        ("Hdg (mag)", True),
        ("Heading [deg M]", True),
        ("Heading (°M)", True),
        ("Magnetic heading", True),
        ("Compass", True),
        ("Hdg (true)", False),
        ("Heading [deg]", False),
        ("HDG_DEG_MEAN", False),
        ("Gyro compass", False),
        ("GPS compass heading", False),
    ],
)
def test_a_name_says_a_magnetic_compass(name: str, magnetic: bool) -> None:
    """In brackets, too: a magnetic heading was taken beside a true one, for a current made it keep to the track."""
    assert is_magnetic(name) == magnetic


@pytest.mark.parametrize(
    ("spelt", "plain"),
    [
        ("prop_rev_per_s_port", "prop_port [rev/s]"),
        ("yawRateDegPerSec", "yawRate [Deg/Sec]"),
        ("shaft revs per min", "shaft [revs/min]"),
        ("surge_m_per_s", "surge [m/s]"),
        ("thrust_newton_left", "thrust_left [N]"),
    ],
)
def test_a_unit_that_is_spelt_out_is_that_in_brackets(spelt: str, plain: str) -> None:
    assert name_parts(spelt) == name_parts(plain)
    assert units_in_name(spelt) == units_in_name(plain)


@pytest.mark.parametrize("name", ["temperature_s", "propeller_speed", "upper_deck", "newton", "giri_per_elica"])
def test_other_words_with_per_are_kept(name: str) -> None:
    assert units_in_name(name) == []
    assert name_parts(name) == tuple(part for word in name.split("_") for part in name_parts(word))
