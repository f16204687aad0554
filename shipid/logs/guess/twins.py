"""Screws of two sides whose columns name no shaft speed: throttles, shares of full speed, pulses of a servo.

Two columns with one name but for the side, whose difference turns the ship, order them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shipid.logs.guess.clues import LIKELY, SEEN, STRONG, State, unit_in_name, unit_of_another
from shipid.logs.guess.words import is_order, meaning_scores, name_parts, side_in_name, words_of_side
from shipid.logs.mapping import UNITS

OF_THROTTLES = frozenset("throttle throttles thrust thruster motor motors engine esc pwm power gas".split())
REST, STILL, ALIKE = 0.05, 5, 0.02  # of the usual speed; windows at rest; of the range: how much alike values there are
CONFIDENCE = 0.5


def choose_twins(state: State, r: np.ndarray) -> None:
    """Suggest shaft speeds from one pair of free columns, port and starboard, whose difference turns the ship."""
    found = {
        pair: state.effect(r, state.columns[pair[0]] - state.columns[pair[1]])
        for pair in twin_columns(state)
        if all(_may_be_a_throttle(name) for name in pair)
    }
    pair = max(found, key=lambda one: abs(found[one]), default=None)
    if pair is None or abs(found[pair]) < SEEN:
        return
    turned = "starboard" if found[pair] > 0 else "port"
    why = f"by its side; the difference to the other side turns the ship to {turned} (t value {abs(found[pair]):.0f})"
    both = f"{pair[0]!r} and {pair[1]!r}"
    unit = unit_in_name(pair[0], "rev/s")
    if unit in UNITS["rev/s"] and unit == unit_in_name(pair[1], "rev/s"):  # the names say a shaft speed
        _say_sides(state, pair, found[pair])
        for side, name in zip(("port", "starboard"), pair, strict=True):
            state.suggest(f"{side}.n", name, str(unit), LIKELY, why)
        return
    state.ask(("n",), f"{both} turn the ship by their difference. Of which shaft speed is a value of 1? Write factor")
    stopped = _at_rest(state, pair)
    if stopped is None:
        state.ask(("n",), f"which value of {both} is a stopped screw? 0 is a guess: write offset = -factor * value")
    for side, name in zip(("port", "starboard"), pair, strict=True):
        extra: dict[str, Any] = {"factor": 1.0}
        said = why
        if stopped is not None and stopped[side] != 0.0:
            extra["offset"] = -stopped[side]
            said = f"{why}; {stopped[side]:g} while the ship is at rest"
        state.suggest(f"{side}.n", name, "rpm", CONFIDENCE, said, **extra)
    _say_sides(state, pair, found[pair])


def _say_sides(state: State, pair: tuple[str, str], effect: float) -> None:
    """Say so where more of the port screw turns the ship to port; effect: t value of port less starboard."""
    if effect < 0:
        state.find(
            "sides of the screws",
            pair,
            0.6,
            f"more of {pair[0]!r} turns the ship to port: are the sides swapped, or the yaw rate's sign?",
        )


def twin_columns(state: State) -> list[tuple[str, str]]:
    """The pairs of free columns, port and starboard, whose names are equal but for the side."""
    sides: dict[tuple[str, ...], dict[str, str]] = {}
    for name in state.free():
        side = side_in_name(name)
        if side in ("port", "starboard"):
            key = tuple(part for part in name_parts(name) if part not in words_of_side(side))
            sides.setdefault(key, {}).setdefault(side, name)
    return [
        (pair["port"], pair["starboard"])
        for pair in sides.values()
        if len(pair) == 2 and any(np.ptp(state.columns[name]) > 0 for name in pair.values())
    ]


def _may_be_a_throttle(name: str) -> bool:
    """Whether a name says an order, a throttle or per cent, or nothing at all; and no unit of another quantity."""
    said = is_order(name) or bool(OF_THROTTLES & set(name_parts(name))) or unit_in_name(name, "rev/s") == "%"
    fit = meaning_scores(name)
    foreign = unit_of_another(name, "n") is not None or (fit.get("", 0.0) >= STRONG and not said)
    return not foreign and (said or not fit)


def _at_rest(state: State, pair: tuple[str, str]) -> dict[str, float] | None:
    """Side -> value of its column at rest; None if the ship always moves, or values differ."""
    span = state.t[state.chosen.last] - state.t[state.chosen.first]
    speed = np.abs(state.chosen.change(state.position)) / span
    still = state.chosen.first[speed < REST * np.quantile(speed, 0.9)]
    if len(still) < STILL:
        return None
    values = {side: state.columns[name][still] for side, name in zip(("port", "starboard"), pair, strict=True)}
    usual = {side: float(np.median(value)) for side, value in values.items()}
    width = max(float(np.ptp(state.columns[name])) for name in pair)
    alike = all(float(np.median(np.abs(values[side] - usual[side]))) < ALIKE * width for side in values)
    return usual if alike else None
