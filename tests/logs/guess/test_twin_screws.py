"""Screws of two sides whose columns name no shaft speed, on craft that steer by their difference, drawn by seed."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd
import pytest

from shipid.engine.rollout import rollout
from shipid.logs.guess.clues import State
from shipid.logs.guess.commands import choose_commands
from shipid.logs.guess.evidence import row_windows
from shipid.vessel.load import load_vessel
from tests.drawn import seeds

STEP = 0.2
NAMES = (
    ("cmd_port_pct", "cmd_stbd_pct"),
    ("throttle left", "throttle right"),
    ("Motor BB Soll", "Motor StB Soll"),
    ("esc_port", "esc_starboard"),
    ("Port thruster cmd [%]", "Starboard thruster cmd [%]"),
    ("pwm_port", "pwm_stbd"),
)
SCALES = ((50.0, 50.0), (0.0, 100.0), (1500.0, 500.0), (0.0, 1.0))  # value of a stopped screw, and how far it goes


@cache
def craft(seed: int, twin: bool = True) -> pd.DataFrame:
    """A log of the Otter, SI units: at rest, then orders of both screws that change every 6 to 20 s.

    twin : whether these differ; else they are one, full astern each other time, from a start under way.
    """
    random = np.random.default_rng(seed)
    share = [np.zeros((150, 2))] if twin else []
    for number in range(30):
        mean, apart = random.uniform(0.2, 0.7), random.uniform(-0.25, 0.25)
        mean, apart = (mean, apart) if twin else ((0.9, -0.6)[number % 2], 0.0)
        share.append(np.tile([mean + apart, mean - apart], (int(random.uniform(30, 100)), 1)))
    orders = np.concatenate(share)
    top = 15.0  # rev/s
    commands = {name: top * orders[:, place, None] for place, name in enumerate(("port.n", "starboard.n"))}
    start = {name: np.zeros(1) for name in ("north", "east", "psi", "u", "v", "r")}
    wind = {name: np.zeros((len(orders), 1)) for name in ("V_w", "beta_w")}
    path = rollout(load_vessel("otter"), start, commands, wind, step=STEP, num_steps=len(orders), method="rk4")
    frame = pd.DataFrame({name: path[name][:-1, 0, 0] for name in start})
    noise = {"north": 0.1, "east": 0.1, "psi": 3e-3, "r": 3e-3}
    noisy = {name: frame[name] + random.normal(0, std, len(frame)) for name, std in noise.items()}
    return frame.assign(t=STEP * np.arange(len(frame)), port=orders[:, 0], starboard=orders[:, 1], **noisy)


def guessed(log: pd.DataFrame, columns: dict[str, np.ndarray]) -> State:
    t = log["t"].to_numpy()
    state = State(t, "s", columns, row_windows(t), r=log["r"].to_numpy())
    state.position, state.psi = (log["north"] + 1j * log["east"]).to_numpy(), log["psi"].to_numpy()
    choose_commands(state)
    return state


def drawn(seed: int) -> tuple[pd.DataFrame, tuple[str, str], float, dict[str, np.ndarray]]:
    """A log, the names of its two columns, the value of a stopped screw, and its columns in any order."""
    log, random = craft(seed), np.random.default_rng(1000 + seed)
    names, (still, far) = NAMES[random.integers(len(NAMES))], SCALES[random.integers(len(SCALES))]
    pair = {name: still + far * log[side].to_numpy() for name, side in zip(names, ("port", "starboard"), strict=True)}
    columns = pair | {"batt_V": 25 - log["t"].to_numpy() / 1000, "temp": random.normal(20, 1, len(log))}
    order = random.permutation(list(columns))
    return log, names, still, {name: columns[name] for name in order}


@pytest.mark.parametrize("seed", seeds(2, 3))
def test_each_side_has_its_screw_with_the_value_of_a_stopped_one(seed: int) -> None:
    log, names, still, columns = drawn(seed)
    state = guessed(log, columns)
    found = {one.name: one for one in state.suggestions}
    assert {name: one.source for name, one in found.items()} == dict(zip(("port.n", "starboard.n"), names, strict=True))
    assert [one.extra.get("offset", 0.0) for one in found.values()] == pytest.approx([-still, -still])
    assert "Of which shaft speed" in state.questions[0].sentence
    assert not state.findings


@pytest.mark.parametrize("seed", seeds(2, 3))
@pytest.mark.parametrize("names", [NAMES[1], NAMES[4], ("throttle_babord_pct", "throttle_styrbord_pct")])
def test_levers_that_move_as_one_are_two_screws_that_stop_at_zero(seed: int, names: tuple[str, str]) -> None:
    """A ship that goes from ahead to astern is at rest for a moment while its screws run astern."""
    log = craft(seed, twin=False)
    columns = {name: 100.0 * log["port"].to_numpy() for name in names}
    state = guessed(log, columns)
    found = {one.name: (one.source, one.extra.get("offset", 0.0)) for one in state.suggestions}
    assert found == {"port.n": (names[0], 0.0), "starboard.n": (names[1], 0.0)}
    (question,) = state.questions
    assert all(repr(name) in question.sentence for name in names)


@pytest.mark.parametrize("names", [("rpm_port", "rpm_starboard"), ("A port", "A starboard")])
def test_a_screw_of_one_side_is_no_rudder(names: tuple[str, str]) -> None:
    log = craft(0)
    columns = {name: 60.0 * log[side].to_numpy() for name, side in zip(names, ("port", "starboard"), strict=True)}
    assert not [one.name for one in guessed(log, columns).suggestions if one.name.endswith("delta")]


def test_swapped_sides_are_reported() -> None:
    log = craft(0)
    columns = {"throttle left": log["starboard"].to_numpy(), "throttle right": log["port"].to_numpy()}
    assert [one.kind for one in guessed(log, columns).findings] == ["sides of the screws"]


@pytest.mark.parametrize("names", [("batt port V", "batt stbd V"), ("draft port", "draft stbd"), ("temp P", "temp S")])
def test_what_is_no_throttle_is_left(names: tuple[str, str]) -> None:
    log = craft(2)
    columns = {name: log[side].to_numpy() for name, side in zip(names, ("port", "starboard"), strict=True)}
    assert guessed(log, columns).suggestions == []


@pytest.mark.parametrize("names", [("motor1", "motor2"), ("RCOU.C1", "RCOU.C3"), ("esc0", "esc1")])
@pytest.mark.parametrize("order", [1, -1])
def test_two_orders_that_turn_the_craft_against_each_other_are_its_screws(names: tuple[str, str], order: int) -> None:
    """Whatever the order of the columns; the sides are asked, as no name says them."""
    log = craft(1)
    pair = {
        name: 1500.0 + 400.0 * log[side].to_numpy() for name, side in zip(names, ("port", "starboard"), strict=True)
    }
    state = guessed(log, dict([*pair.items()][::order]))
    assert {one.name: one.source for one in state.suggestions} == {"port.n": names[0], "starboard.n": names[1]}
    assert any(f"is {names[0]!r} to port and {names[1]!r} to starboard?" in one.sentence for one in state.questions)
