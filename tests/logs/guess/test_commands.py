"""Commands are chosen by name; sign and unit by what they do to the ship."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.logs.guess.clues import LIKELY, State
from shipid.logs.guess.commands import choose_commands, likely_unit
from shipid.logs.guess.motion import report_misnomers
from tests.drawn import seeds
from tests.logs.simulated import si_log, state_with_pose

LOG = si_log()
T, R, ALPHA, N = (LOG[name].to_numpy() for name in ("t", "r", "alpha", "n"))
RUDDER = -np.degrees(ALPHA)  # > 0 to starboard
RPM = 60.0 * N


def chosen(columns: dict[str, np.ndarray], quiet: bool = False) -> State:
    state = state_with_pose(columns)
    state.r = R
    if quiet:
        assert state.psi is not None
        state.psi = state.r = 0.0 * state.psi
    choose_commands(state)
    report_misnomers(state)
    return state


def described(state: State) -> dict[str, tuple[str, str, int]]:
    return {c.name: (c.source, c.unit, c.extra.get("sign", 1)) for c in state.suggestions}


@pytest.mark.parametrize(
    ("columns", "expected", "kinds"),
    [
        ({"rudder": RUDDER}, {"rudder.delta": ("rudder", "deg", 1)}, set()),
        ({"rudder": -RUDDER}, {"rudder.delta": ("rudder", "deg", -1)}, {"other sign"}),
        ({"rudder": np.radians(RUDDER)}, {"rudder.delta": ("rudder", "rad", 1)}, set()),
        ({"azimuth": -RUDDER}, {"thruster.alpha": ("azimuth", "deg", 1)}, set()),
        ({"azimuth": RUDDER}, {"thruster.alpha": ("azimuth", "deg", -1)}, {"other sign"}),
        ({"channel a": np.sin(T), "channel b": RUDDER}, {"rudder.delta": ("channel b", "deg", 1)}, set()),
    ],
    ids=["starboard", "port", "rad", "azimuth", "azimuth to starboard", "no name"],
)
def test_what_steers(
    columns: dict[str, np.ndarray], expected: dict[str, tuple[str, str, int]], kinds: set[str]
) -> None:
    state = chosen(columns)
    assert described(state) == expected
    assert {finding.kind for finding in state.findings} == kinds


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("middle", "turns"), [(180.0, 1), (180.0, -1)])
def test_an_azimuth_angle_of_half_a_turn_ahead_is_asked(middle: float, sign: int, turns: int) -> None:
    """It says where the water goes; the units pushed astern at full speed ahead without a word."""
    state = chosen({"azimuth": (middle - sign * RUDDER) % 360.0, "rpm": turns * RPM})
    assert described(state)["thruster.alpha"] == ("azimuth", "deg", sign)
    asked = [question.sentence for question in state.questions if question.about == ("alpha",)]
    assert len(asked) == (middle == 180.0 and turns > 0)
    assert all(f"write offset = {-sign * 180} (deg)" in sentence for sentence in asked)


@pytest.mark.parametrize("seed", seeds(3, 12))
def test_an_angle_in_pulses_is_that_of_a_servo(seed: int) -> None:
    """A rudder of 1157 to 1843 us was read in degrees, and its middle as half a turn."""
    draw = np.random.default_rng(seed)
    sign, most = int(draw.choice([-1, 1])), float(draw.uniform(100.0, 500.0))
    name, signal = (("rudder", "delta"), ("azimuth", "alpha"))[seed % 2]
    state = chosen({name: 1500.0 + sign * most * RUDDER / np.abs(RUDDER).max()})
    ((source, unit, counted),) = described(state).values()
    assert (source, unit, counted) == (name, "deg", sign * (1 if signal == "delta" else -1))
    assert state.suggestions[0].name.endswith(signal)
    assert any(name in one.sentence and "45 deg is a guess" in one.sentence for one in state.questions)


@pytest.mark.parametrize("seed", seeds(2, 8))
def test_two_rudders_whose_sides_are_words_that_are_not_known_are_both_read_and_asked(seed: int) -> None:
    """Of two rudders of a Russian ship one was left out."""
    draw = np.random.default_rng(seed)
    names = [f"rudder {''.join(draw.choice(list('bcdghjkqvwxz'), 4))}" for _ in range(2)]
    state = chosen({name: RUDDER + draw.normal(0.0, 0.1, len(T)) for name in names})
    assert [one.source for one in state.suggestions] == names
    asked = [one.sentence for one in state.questions if "another side" in one.sentence]
    assert [sum(repr(name) in one for one in asked) for name in names] == [1, 1]


def test_the_side_of_a_rudder_that_is_never_negative_is_asked_and_not_found() -> None:
    state = chosen({"rudder [deg]": 40.0 - RUDDER})
    assert described(state) == {"rudder.delta": ("rudder [deg]", "deg", 1)}
    assert state.findings == []
    assert "is never negative, but the ship turns to both sides" in state.questions[0].sentence


@pytest.mark.parametrize(("unit", "full"), [("%", 100), ("per mille", 1000), ("p.u.", 1)])
def test_a_rudder_in_a_share_is_asked_for_the_angle_of_the_whole(unit: str, full: int) -> None:
    (question,) = chosen({f"rudder [{unit}]": full / 35.0 * RUDDER}).questions
    assert question.sentence.endswith(f"of which angle? Write factor = (deg at {full}) / {full}")


def test_the_sign_of_a_rudder_that_moves_nothing_is_not_known() -> None:
    (column,) = chosen({"rudder": RUDDER}, quiet=True).suggestions
    assert column.confidence <= 0.5
    assert "its sign is not known" in column.evidence


def test_the_measured_angle_is_taken_rather_than_the_order() -> None:
    state = chosen({"rudder order": RUDDER, "rudder angle": RUDDER})
    assert described(state)["rudder.delta"][0] == "rudder angle"
    (finding,) = state.findings
    assert finding.kind == "several columns for one command"


def test_the_shaft_of_a_controllable_pitch_propeller_is_no_pitch() -> None:
    state = chosen({"CPP_ShaftRpm": RPM, "CPP_Pitch": 0.8 + 0.01 * np.sin(T), "CPP oil temp": 40.0 + 0.0 * T})
    assert described(state) == {"propeller.n": ("CPP_ShaftRpm", "rpm", 1), "propeller.pitch": ("CPP_Pitch", "-", 1)}


@pytest.mark.parametrize(
    ("name", "values", "unit", "asked", "kinds"),
    [
        ("shaft speed", RPM, "rpm", False, set()),
        ("shaft speed", N, "rev/s", False, set()),
        ("shaft [rpm]", RPM, "rpm", False, set()),
        ("shaft [rpm]", RPM / 60, "rev/s", False, {"other unit"}),
        ("shaft speed [%]", RPM / 2.5, "rpm", True, set()),
        ("shaft speed", RPM / 2.5, "rpm", True, set()),
    ],
    ids=["rpm", "rev/s", "rpm in the name", "wrong unit in the name", "%", "% not in the name"],
)
def test_the_unit_of_a_shaft(name: str, values: np.ndarray, unit: str, asked: bool, kinds: set[str]) -> None:
    state = chosen({"rudder": RUDDER, name: values})
    assert described(state)["propeller.n"][:2] == (name, unit)
    assert [question.about for question in state.questions] == [("n",)] * asked
    assert {finding.kind for finding in state.findings} == kinds


@pytest.mark.parametrize("idle", [0.0, 0.01])
@pytest.mark.parametrize("name", ["shaft [rpm]", "shaft speed"])
def test_a_shaft_that_hardly_turns_for_most_of_the_log_keeps_its_unit(name: str, idle: float) -> None:
    """A ship that drifts, coasts or is in port: her rpm were read as rev/s, 60 times too fast, or asked."""
    state = chosen({"rudder": RUDDER, name: np.where(0.6 * T[-1] > T, idle * RPM, RPM)})
    assert described(state)["propeller.n"][:2] == (name, "rpm")
    assert not state.findings
    assert not state.questions


def test_a_shaft_that_counts_the_other_way_has_its_sign() -> None:
    """Before, the shaft of a left-handed screw ran astern while the ship went ahead, without a word."""
    state = chosen({"rudder": RUDDER, "rpm_port": RPM, "rpm_stbd": -RPM})
    assert described(state)["port.n"] == ("rpm_port", "rpm", 1)
    assert described(state)["starboard.n"] == ("rpm_stbd", "rpm", -1)
    assert [finding.columns for finding in state.findings] == [("rpm_stbd",)]


def test_a_screw_that_stops_the_ship_keeps_its_sign() -> None:
    state = chosen({"rudder": RUDDER, "rpm": np.where(np.arange(len(T)) < 0.6 * len(T), RPM, -RPM)})
    assert described(state)["propeller.n"] == ("rpm", "rpm", 1)


def test_a_unit_is_the_one_in_the_name_or_else_the_likely_one() -> None:
    state = state_with_pose({"rudder": RUDDER, "rudder rad": RUDDER, "delta": np.radians(RUDDER)})
    assert [likely_unit(state, name, "delta") for name in state.columns] == ["deg", "rad", "rad"]


def test_an_azimuth_that_jumps_at_a_whole_turn_is_one_about_zero() -> None:
    state = chosen({"azimuth": -RUDDER % 360.0})
    assert described(state) == {"thruster.alpha": ("azimuth", "deg", 1)}
    assert state.suggestions[0].extra["wrap"]


@pytest.mark.parametrize("name", ["n_bow", "bow thruster speed"])
def test_the_unit_of_a_tunnel_thruster_is_that_of_the_shafts_and_asked(name: str) -> None:
    state = chosen({"rudder": RUDDER, name: 13.0 * np.sin(T), "shaft speed": RPM})
    assert described(state)["bow.n"] == (name, "rpm", 1)
    assert described(state)["propeller.n"] == ("shaft speed", "rpm", 1)
    assert [question.about for question in state.questions] == [("n",)]


@pytest.mark.parametrize(
    ("name", "top", "asked"),
    [("Engine RPM", 1800, True), ("motor rpm port", 900, True), ("ME rpm", 110, False), ("shaft rpm", 1800, False)],
)
def test_a_fast_engine_is_asked_for_its_gear(name: str, top: float, asked: bool) -> None:
    """Before, 1800 rpm of an engine were those of the shaft."""
    state = chosen({name: top * (0.9 + 0.1 * np.sin(T))})
    assert any("is there a gear? Write factor = 1 / its ratio" in one.sentence for one in state.questions) == asked


@pytest.mark.parametrize("name", ["engineRPM", "propellerpm", "MERPM"])
def test_turns_of_an_engine_are_not_electrical(name: str) -> None:
    state = chosen({name: 400 + 50 * np.sin(T)})
    assert not any("poles" in question.sentence for question in state.questions)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("rudder", 1000 / 35),
        ("rudder_pwm", 11.0),
        ("rudder_pct", 100 / 35),
        ("rudder [%]", 100 / 35),
        ("rudder_norm", 1 / 35),
    ],
)
def test_a_rudder_that_is_no_angle_is_asked_for_its_largest_angle(name: str, factor: float) -> None:
    """Before, per mille, per cent and pulses were degrees without a word: an angle 2.9 or 29 times too large."""
    state = chosen({name: factor * RUDDER})
    assert any("angle" in question.sentence for question in state.questions)


@pytest.mark.parametrize(
    ("name", "values", "column"),
    [("Rudder [mV]", 100.0 * RUDDER, "rudder.delta"), ("Shaft [counts]", 100.0 * N, "propeller.n")],
)
def test_a_unit_that_is_not_known_is_asked(name: str, values: np.ndarray, column: str) -> None:
    state = chosen({name: values})
    (found,) = (one for one in state.suggestions if one.name == column)
    assert found.confidence < LIKELY
    assert [one.sentence.partition(":")[0] for one in state.questions if name in one.sentence] == [
        f"{name!r} says {name.partition('[')[2][:-1]!r}, no unit that is known here"
    ]


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("names", [("RCOU.C1", "RCOU.C3"), ("servo1_raw", "servo3_raw"), ("chan 1", "throttle_pct")])
def test_pulses_are_drafted_by_what_the_ship_does_after_them(names: tuple[str, str], sense: int) -> None:
    """1500 us is amidships; the angle of the largest pulse is asked, and so is the shaft speed of a throttle."""
    state = chosen({names[0]: 1500.0 + sense * 400.0 / 45.0 * RUDDER, names[1]: 1500.0 + 2.0 * RPM})
    assert described(state)["rudder.delta"] == (names[0], "deg", sense)
    (angle,) = (one for one in state.suggestions if one.name == "rudder.delta")
    assert angle.confidence < LIKELY
    assert angle.extra["factor"] * 400.0 == pytest.approx(45.0)
    assert angle.extra["offset"] == pytest.approx(-sense * 1500.0 * 45.0 / 400.0)
    assert described(state)["propeller.n"][0] == names[1]
    assert any("dead band" in one.sentence for one in state.questions)


@pytest.mark.parametrize(
    ("name", "taken"),
    [
        ("thrust_cmd", True),
        ("motor_cmd_left", True),
        ("throttle 1", True),
        ("motor_temp", False),
        ("engine load", False),
    ],
)
def test_an_order_of_an_actuator_is_asked_though_its_effect_is_not_seen(name: str, taken: bool) -> None:
    """The order of the only screw of a boat was left out without a word where wind hid what it does."""
    state = chosen({name: np.random.default_rng(4).uniform(0.0, 1.0, len(T))})
    assert [one.source for one in state.suggestions if one.name.endswith(".n")] == [name] * taken
    assert any(repr(name) in one.sentence and "n" in one.about for one in state.questions) == taken


ALWAYS, BACK, STOPS = np.where(T % 40 < 20, 90.0, 60.0), np.sign(T.mean() - T), np.clip(1.2 - T % 200 / 60, 0.05, 1)


@pytest.mark.parametrize(
    ("name", "shaft", "way", "asked"),
    [
        ("rpm", np.abs(RPM), T**0, False),
        ("rpm", RPM, T**0, False),
        ("rpm", ALWAYS, BACK, True),
        ("rpm", ALWAYS, np.where(0.9 * T[-1] > T, 1.0, -1.0), True),
        ("rpm", ALWAYS, -(T**0), True),
        ("rpm", ALWAYS * BACK, BACK, False),
        ("rpm", ALWAYS * (BACK > 0), BACK, False),
        ("rpm", ALWAYS, STOPS, True),
        ("rpm", ALWAYS * STOPS, STOPS, False),
        ("bow thruster rpm", ALWAYS, BACK, False),
    ],
)
def test_a_shaft_that_hides_its_turns_astern_is_asked(
    name: str, shaft: np.ndarray, way: np.ndarray, asked: bool
) -> None:
    """It was drafted as if it drove the ship ahead, in a log that goes astern for a share of it, without a word."""
    state = state_with_pose({name: shaft})
    state.r = R
    state.position = np.cumsum(2.0 * way * np.exp(1j * LOG["psi"].to_numpy()))
    choose_commands(state)
    assert any("says its sense" in one.sentence for one in state.questions) == asked
