"""From columns to a record: which angle is the helm, and which way it turns the ship."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.measures.recognise import recognise_kinds, record_of
from shipid.measures.record import Record
from shipid.measures.stopping import stopping_measures
from shipid.measures.zigzag import zigzag_measures
from shipid.units import DEGREE
from tests.measures.made_records import RECORDS, START, clock, every, made_record, nomoto


def columns(record: Record) -> dict[str, np.ndarray]:
    return {name: getattr(record, name) for name in ("t", "north", "east", "psi", "u", "v", "r")}


@pytest.mark.parametrize("kind", [kind for kind in RECORDS if kind != "stop"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_helm_is_counted_by_what_it_does(kind: str, sign: float) -> None:
    record = every(RECORDS[kind](), 0.5)
    angles = {"rudder.delta": sign * record.helm, "bow.alpha": -sign * record.helm, "idle.alpha": 0 * record.helm}
    np.testing.assert_allclose(record_of(columns(record) | angles).helm, record.helm)


@pytest.mark.parametrize("kind", ["zigzag", "turning"])
@pytest.mark.parametrize(("parked", "noise"), [(90.0, 0.0), (0.3, 0.05)])
def test_an_angle_that_stays_where_it_is_is_no_helm(kind: str, parked: float, noise: float) -> None:
    record = every(RECORDS[kind](), 0.5)
    still = parked + noise * np.random.default_rng(0).standard_normal(len(record.t))
    given = columns(record) | {"rudder.delta": record.helm, "bow.alpha": still * DEGREE}
    np.testing.assert_allclose(record_of(given).helm, record.helm)


def test_shafts_that_run_and_columns_that_lack() -> None:
    record = every(RECORDS["stop"](), 0.5)
    given = columns(record) | {"port.n": record.shaft, "bow.n": 0 * record.t, "actual.port.n": 9 + 0 * record.t}
    np.testing.assert_array_equal(record_of(given).shaft, record.shaft)
    assert record_of(columns(record)).shaft is None


@pytest.mark.parametrize("counted", ["to 180 deg", "to 360 deg"])
@pytest.mark.parametrize("takes", [0.0, 15.0])
def test_azimuth_units_turned_astern_stop_a_ship(counted: str, takes: float) -> None:
    """Both are turned outwards by half a turn while their shafts go on; it was said that no shaft is reversed."""
    record = every(RECORDS["stop"](), 0.5)
    share = np.clip((record.t - START) / takes, 0, 1) if takes else np.where(record.t >= START, 1.0, 0.0)
    given = columns(record) | {"port.n": np.full(len(record.t), 2.0), "starboard.n": np.full(len(record.t), 2.0)}
    given |= {"port.alpha": 0.05 - np.pi * share, "starboard.alpha": -0.05 + np.pi * share}
    if counted == "to 360 deg":
        given |= {name: given[name] % (2 * np.pi) for name in ("port.alpha", "starboard.alpha")}
    seen = record_of(given)
    assert recognise_kinds(seen) == (("stop",), "")
    assert stopping_measures(seen)["execute"].value == pytest.approx(START, abs=0.6)


@pytest.mark.parametrize("turning", [True, False])
@pytest.mark.parametrize("takes", [0.0, 12.0])
def test_a_controllable_pitch_stops_a_ship_whose_shaft_goes_on(turning: bool, takes: float) -> None:
    """Ordered, or as measured on its way from 0.9 to -0.7; a log may not have the speed of the shaft."""
    record = every(RECORDS["stop"](), 0.5)
    share = np.clip((record.t - START) / takes, 0, 1) if takes else np.where(record.t >= START, 1.0, 0.0)
    given = columns(record) | {"screw.pitch": 0.9 - 1.6 * share}
    if turning:
        given["screw.n"] = np.full(len(record.t), 2.0)
    seen = record_of(given)
    assert recognise_kinds(seen) == (("stop",), "")
    assert stopping_measures(seen)["execute"].value == pytest.approx(START, abs=0.5)
    ahead = record_of(given | {"screw.pitch": np.full(len(record.t), 0.9)})
    np.testing.assert_array_equal(ahead.shaft, 2.0 if turning else 1.0)


def run(legs: list[tuple[float, float]], end: float) -> Record:
    """Nomoto's ship with these orders (s, deg), at 10 Hz."""
    t = clock(end)
    psi, r, helm = nomoto(t, [(begin, angle * DEGREE) for begin, angle in legs])
    return every(made_record(t, psi, r, helm, np.full_like(t, 5.0), 0 * t), 0.1)


def test_a_helm_left_over_from_before_is_no_execute() -> None:
    t = clock(200.0)
    psi, r, helm = nomoto(t, [(0.0, 12 * DEGREE), (30.0, 0.0), (110.0, 10 * DEGREE), (120.0, -10 * DEGREE)])
    record = every(made_record(t, psi, r, helm, np.full_like(t, 5.0), 0 * t), 0.1)
    later = Record(*(getattr(record, name)[200:] for name in ("t", "north", "east", "psi", "u", "v", "r", "helm")))
    assert zigzag_measures(later)["execute"].value == pytest.approx(110.0)
    assert zigzag_measures(record)["execute"].value == pytest.approx(0.0)  # put over there: she goes straight


def test_what_is_no_manoeuvre_says_why() -> None:
    assert "less than 3 deg" in recognise_kinds(run([(START, 2)], 60.0))[1]
    assert "turned by 90 deg" in recognise_kinds(run([(START, 10), (START + 5, 0)], 60.0))[1]
    wide = run([(START, 20), (START + 64, -20), (START + 170, 20), (START + 270, -20)], 330.0)  # a ship slow to check
    assert "helm is reversed, but the heading changes by 90 deg or more" in recognise_kinds(wide)[1]
    already = run([(0.0, 20), (30.0, 1), (33.0, 20)], 60.0)
    begun = Record(*(getattr(already, name)[200:] for name in ("t", "north", "east", "psi", "u", "v", "r", "helm")))
    assert "turns already" in recognise_kinds(begun)[1]


def test_a_helm_put_amidships_for_long_is_a_pull_out_too() -> None:
    """A fifth of the time of the turn, 38 s, until the helm is moved again or the log ends."""
    assert recognise_kinds(run([(10.0, 20)], 200.0)) == (("turning",), "")
    assert recognise_kinds(run([(10.0, 20), (200.0, 0)], 230.0)) == (("turning",), "")
    assert recognise_kinds(run([(10.0, 20), (200.0, 0)], 250.0)) == (("turning", "pull-out"), "")
    assert recognise_kinds(run([(10.0, 20), (200.0, 0), (230.0, 10)], 300.0)) == (("turning",), "")
    assert recognise_kinds(run([(10.0, 20), (200.0, 0), (250.0, 10)], 300.0)) == (("turning", "pull-out"), "")
    slow = [(10.0, 20), (200.0, 8), (220.0, 0)]  # the helm goes back in steps: the time counts from amidships
    assert recognise_kinds(run([*slow, (245.0, 10)], 300.0)) == (("turning",), "")
    assert recognise_kinds(run([*slow, (265.0, 10)], 300.0)) == (("turning", "pull-out"), "")
