"""Sentences of NMEA 0183: what each kind says, and which say nothing."""

from typing import Any

import numpy as np
import pynmea2
import pytest

from shipid.logs.sentences import parse_sentence
from tests.drawn import seeds
from tests.logs.test_nmea import sentence

WHERE = "4807.038,N,01131.000,W"
PLACE = {"latitude": 48 + 7.038 / 60, "longitude": -(11 + 31 / 60)}


@pytest.mark.parametrize(
    ("body", "values"),
    [
        (f"GNGNS,120000,{WHERE},AN,09,0.9,5.0,40.0,,", PLACE),
        (f"GNGNS,120000,{WHERE},NN,09,0.9,5.0,40.0,,", {}),
        (f"GPGGA,120000,{WHERE},1,8,0.9,5.0,M,46.9,M,,", PLACE),
        (f"GPGGA,120000,{WHERE},0,0,,,M,,M,,", {}),
        (f"GPGLL,{WHERE},120000,A", PLACE),
        (f"GPRMC,120000,A,{WHERE},5.0,,271022", PLACE | {"sog": 5.0}),
        ("GPRMC,120000,A,,,,,5.0,84.0,271022,,,A", {"sog": 5.0, "cog": 84.0}),
        ("GPVTG,54.0,T,,M,,N,18.52,K,A", {"cog": 54.0, "sog": 10.0}),
        ("HETHS,123.4,A", {"heading": 123.4}),
        ("HETHS,123.4,V", {}),
        ("IIRPM,S,0,90.0,,A", {"rpm_0": 90.0}),
        ("IIRPM,S,3,90.0,,A", {"rpm_3": 90.0}),
        ("PGRMC,A,218.8,100,6378137.0", {}),
        ("HCHDG,120.0,,,3.0,E", {}),
    ],
)
def test_what_a_sentence_says(body: str, values: dict[str, float]) -> None:
    """One of Garmin that begins with $PGRMC is no RMC."""
    said = parse_sentence(sentence(body)[1:], checked=True)
    assert said is not None
    assert said.values() == pytest.approx(values)


@pytest.mark.parametrize("fields", ["4860.000,N,01131.000,W", "4807.038,,01131.000,W", "4807.038,N,01131.000,N"])
def test_a_position_that_is_none_is_refused(fields: str) -> None:
    """Before, a position without its side was at 0 deg."""
    said = parse_sentence(sentence(f"GPGLL,{fields},120000,A")[1:], checked=True)
    assert said is not None
    with pytest.raises(ValueError, match=r"is no (latitude|longitude)"):
        said.values()


@pytest.mark.parametrize(
    ("body", "time"),
    [(f"GPRMC,235960.5,A,{WHERE},5,84,271022", 86400.5), ("RATTM,01,2.3,45.0,T,,,T,,,N,A,T,,115957.00,A", None)],
)
def test_fixes_say_the_time_and_radar_targets_do_not(body: str, time: Any) -> None:
    said = parse_sentence(sentence(body)[1:], checked=True)
    assert said is not None
    assert said.time() == time


@pytest.mark.parametrize("time", ["240000", "126000", "120061", "-10000", "12-100"])
def test_a_time_that_no_day_has_is_refused(time: str) -> None:
    said = parse_sentence(sentence(f"GPGLL,{WHERE},{time},A")[1:], checked=True)
    assert said is not None
    with pytest.raises(ValueError, match="is no time of day"):
        said.time()


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_sentences_say_what_another_implementation_reads(seed: int) -> None:
    rng = np.random.default_rng(seed)
    degrees, minutes = rng.integers([0, 0], [90, 180]), rng.uniform(0, 60, 2)
    where = f"{degrees[0]:02d}{minutes[0]:07.4f},{rng.choice(['N', 'S'])}"
    where += f",{degrees[1]:03d}{minutes[1]:07.4f},{rng.choice(['E', 'W'])}"
    clock = f"{rng.integers(24):02d}{rng.integers(60):02d}{rng.uniform(0, 60):05.2f}"
    day = f"{rng.integers(1, 29):02d}{rng.integers(1, 13):02d}{rng.integers(100):02d}"
    a, b, c = (f"{value:.1f}" for value in rng.uniform(-40, 360, 3))
    talker = rng.choice(["GP", "GN", "II", "HE"])
    read = {
        f"GGA,{clock},{where},1,8,0.9,5.0,M,46.9,M,,": {"latitude": "latitude", "longitude": "longitude"},
        f"GLL,{where},{clock},A": {"latitude": "latitude", "longitude": "longitude"},
        f"RMC,{clock},A,{where},{a},{b},{day},,": {"sog": "spd_over_grnd", "cog": "true_course"},
        f"VTG,{a},T,,M,{b},N,{c},K,A": {"cog": "true_track", "sog": "spd_over_grnd_kts"},
        f"HDT,{a},T": {"heading": "heading"},
        f"ROT,{a},A": {"rot": "rate_of_turn"},
        f"RSA,{a},A,{b},A": {"rudder": "rsa_starboard", "rudder_port": "rsa_port"},
        f"RPM,S,1,{a},{b},A": {"rpm": "speed"},
        f"MWD,{a},T,{b},M,,N,{c},M": {"wind_from": "direction_true", "wind_speed": "wind_speed_meters"},
    }
    for body, names in read.items():
        text = sentence(f"{talker}{body}")
        ours, theirs = parse_sentence(text[1:], checked=True), pynmea2.parse(text, check=True)
        assert ours is not None
        values = ours.values()
        for name, other in names.items():
            assert values[name] == pytest.approx(float(getattr(theirs, other)), rel=1e-12), (body, name)
        if body.startswith(("GGA", "GLL", "RMC")):
            moment = theirs.timestamp
            seconds = 3600 * moment.hour + 60 * moment.minute + moment.second + 1e-6 * moment.microsecond
            assert ours.time() == pytest.approx(seconds, abs=1e-6)
        if body.startswith("RMC"):
            assert ours.day() == theirs.datestamp.toordinal()
    damaged = text[:-1] + ("0" if text[-1] != "0" else "1")
    assert parse_sentence(damaged[1:], checked=True) is None
    with pytest.raises(pynmea2.ChecksumError):
        pynmea2.parse(damaged, check=True)
