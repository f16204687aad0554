"""Ranges of what any ship or model of one can be: slips of unit, sign of the exponent and place are refused.

A vessel that is meant so names the number in `unusual`, a list of dotted paths at the top of its document.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from shipid import document as documents
from shipid.units import GRAVITY

UNUSUAL = "unusual"
"""Key of the list of dotted paths (* matches any characters) whose numbers may lie outside their range."""
WATER = 1000.0  # kg/m^3, to judge a mass by
SLOWEST = 100.0  # of a lag, in sqrt(L / g)
LEAST_BLOCK = 0.05
# Judgement, far from ships: SOLAS asks 65 deg of helm in 28 s, which is 0.18 rad in sqrt(L / g) of a ship of 200 m.
FASTEST = 4.0  # rad in sqrt(L / g)
NEAR = 0.05  # ship lengths by which positions of rudder and screw may disagree: those of publications do
_OF_RUDDER = {
    "x_H": "its force on the hull acts on the same side",
    "ell_R": "the lever of the flow across it has the same sign",
}
_SIDES = {"port": -1, "left": -1, "starboard": 1, "right": 1}  # words in names of units
_SHARES = {"t_P": "a thrust deduction", "t_R": "a deduction of the rudder's drag", "w_P0": "a wake"}


@dataclass(frozen=True)
class ShipSize:
    """The size of a ship by which numbers are judged: length L [m] and mass m [kg]."""

    L: float
    m: float


@dataclass(frozen=True)
class MagnitudeRange:
    """Least and greatest magnitude of a number, and what it should be, in words."""

    most: Callable[[ShipSize], float]
    words: str
    least: Callable[[ShipSize], float] = lambda _: 0.0


_NAMED: dict[str, MagnitudeRange] = {
    "particulars.L_pp": MagnitudeRange(
        lambda _: 600.0, "a length between perpendiculars of 0.05 to 600 m", lambda _: 0.05
    ),
    "inertia.m": MagnitudeRange(
        lambda s: 0.5 * WATER * s.L**3, "a mass of 0.0001 to 0.5 rho L^3 in kg", lambda s: 1e-4 * WATER * s.L**3
    ),
    **{
        f"inertia.I_{axis}": MagnitudeRange(
            lambda s: s.m * s.L**2, "a radius of gyration of 0.01 to 1 ship length", lambda s: s.m * (0.01 * s.L) ** 2
        )
        for axis in "xyz"
    },
    "constants.rho": MagnitudeRange(lambda _: 3000.0, "a density of water in kg/m^3", lambda _: 500.0),
    "constants.rho_a": MagnitudeRange(lambda _: 100.0, "a density of air in kg/m^3", lambda _: 0.01),
    "constants.g": MagnitudeRange(lambda _: 100.0, "an acceleration in m/s^2", lambda _: 0.1),
}
_BY_UNIT: dict[str, MagnitudeRange] = {
    "m": MagnitudeRange(lambda s: 5 * s.L, "at most 5 ship lengths, in m"),
    "m^2": MagnitudeRange(lambda s: 10 * s.L**2, "at most 10 squares of the ship length, in m^2"),
    "m^3": MagnitudeRange(lambda s: 10 * s.L**3, "at most 10 cubes of the ship length, in m^3"),
    "s": MagnitudeRange(lambda _: 1e4, "at most 10,000 s"),
    "deg": MagnitudeRange(lambda _: 360.0, "an angle of at most 360 deg"),
    "rad": MagnitudeRange(lambda _: 7.0, "an angle of at most a full turn in rad"),
    "m s^-1": MagnitudeRange(lambda _: 100.0, "a speed of at most 100 m/s"),
    "-": MagnitudeRange(lambda _: 100.0, "without unit, at most 100"),
    **dict.fromkeys(
        ("prime", "bis"), MagnitudeRange(lambda _: 100.0, "without unit, at most 100 (is it written in 1e-5?)")
    ),
}
_BY_NAME: dict[str, MagnitudeRange] = {
    "D_p": MagnitudeRange(lambda s: 0.3 * s.L, "a diameter of at most 0.3 ship lengths, in m"),
    "A_R": MagnitudeRange(lambda s: 0.05 * s.L**2, "a rudder of at most 0.05 squares of the ship length, in m^2"),
}
_ADDED: dict[str, MagnitudeRange] = {
    "kg": MagnitudeRange(lambda s: 20 * s.m, "at most 20 times the mass"),
    "kg m": MagnitudeRange(lambda s: 20 * s.m * s.L, "at most 20 times mass times length"),
    "kg m^2": MagnitudeRange(lambda s: 20 * s.m * s.L**2, "at most 20 times mass times length squared"),
}


def out_of_range(
    document: Mapping[str, Any], values: Mapping[str, float], units: Mapping[str, str]
) -> tuple[str, str] | None:
    """Dotted path of the first number that no ship has, and a sentence; None where all are usual.

    values, units : of every number that the equations use, by dotted path.
    """
    meant, size = document.get(UNUSUAL, []), _ship_size(document, values)
    tables: dict[str, list[float]] = {}
    for path, unit in units.items():
        limits, value = _range_of(path, unit), abs(values[path])
        if limits is not None:
            least, most = limits.least(size), limits.most(size)
            if not least <= value <= most and not _is_unusual(path, meant):
                words = f"{values[path]:g}: expected {limits.words} ({least:.3g} to {most:.3g})"
                return path, f"{words}; {_unusual_remedy(path)}"
        table, _, place = path.rpartition(".")
        if unit == "deg" and place.isdecimal():
            tables.setdefault(table, []).append(value)
    for path, angles in tables.items():
        if len(angles) > 1 and max(angles) <= 2 * math.pi and not _is_unusual(path, meant):
            return path, f"angles up to {max(angles):.3g}: expected degrees, are these radians? {_unusual_remedy(path)}"
    return None


def first_contradiction(document: Mapping[str, Any], values: Mapping[str, float]) -> tuple[str, str] | None:
    """Dotted path of the first number that contradicts another one, and a sentence; None where none does."""
    first = next(iter(find_contradictions(document, values).items()), None)
    return None if first is None else (first[0], f"{first[1]}; {_unusual_remedy(first[0])}")


def find_contradictions(document: Mapping[str, Any], values: Mapping[str, float]) -> dict[str, str]:
    """Dotted path of every number that contradicts another one, unless `unusual` names it -> a sentence."""
    meant = document.get(UNUSUAL, [])
    return {path: words for path, words in _all_contradictions(document, values) if not _is_unusual(path, meant)}


def _all_contradictions(document: Mapping[str, Any], values: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    sizes = document.get("particulars") or {}
    block = sizes.get("C_b")
    if block is not None and not LEAST_BLOCK <= block <= 1:
        yield "particulars.C_b", f"{block:g}: expected a block coefficient of {LEAST_BLOCK:g} to 1"
    for less, more, words in (("B", "L_pp", "beam below the length"), ("T", "B", "draught below the beam")):
        if {less, more} <= sizes.keys() and sizes[less] >= sizes[more]:
            yield f"particulars.{less}", f"{sizes[less]:g} m: expected a {words}, {more} = {sizes[more]:g} m"
    length = _ship_size(document, values).L
    time = (length / GRAVITY) ** 0.5
    for path, value in values.items():
        if path.endswith((".actuator.delta.rate", ".actuator.alpha.rate")) and abs(value) > FASTEST / time:
            most = f"at most {FASTEST / time:.3g} rad/s"
            yield path, f"{value:g} rad/s: expected {most}, 4 rad in sqrt(L / g); is it in deg/s?"
        if ".actuator." in path and path.endswith(".T") and value > SLOWEST * time:
            yield path, f"{value:g} s: expected at most {SLOWEST * time:.3g} s, 100 sqrt(L / g)"
        yield from _thruster_contradictions(path, value, values)
    for name, unit in document.get("thruster", {}).items():
        if isinstance(unit, Mapping) and isinstance(unit.get("behind"), str):
            yield from _rudder_contradictions(name, unit["behind"], values, NEAR * length)


def _thruster_contradictions(path: str, value: float, values: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """A number of a thruster that contradicts another one of it, its name, or what the number means."""
    block, _, key = path.rpartition(".")
    if key == "x":
        for other, words in _OF_RUDDER.items():
            if values.get(f"{block}.{other}", 0.0) * value < 0:
                yield f"{block}.{other}", f"{values[f'{block}.{other}']:g} m, the rudder at x = {value:g} m: {words}"
    if key == "y":
        sides = [word for word in re.split("[_-]", block.rpartition(".")[2].lower()) if word in _SIDES]
        if len(sides) == 1 and _SIDES[sides[0]] * value < 0:
            yield path, f"{value:g} m, and the name says {sides[0]}: y counts to starboard from the centre line"
    if key in _SHARES and value >= 1:
        yield path, f"{value:g}: expected {_SHARES[key]} below 1; is it in per cent?"
    if key == "J_max" and value <= (least := values.get(f"{block}.J_min", -1.0)):
        yield path, f"{value:g}: expected more than J_min, {least:g}"


def _rudder_contradictions(
    name: str, screw: str, values: Mapping[str, float], near: float
) -> Iterator[tuple[str, str]]:
    """A rudder ahead of its screw by more than `near` [m], or on the other side of the ship."""
    (x, y), (x_of, y_of) = ([values.get(f"thruster.{one}.{axis}", 0.0) for axis in "xy"] for one in (name, screw))
    if x and x_of and x > x_of + near:  # 0 where forces act by derivatives, not by places
        words = f"{x:g} m is ahead of {screw!r} at {x_of:g} m, which it is behind: x counts forward from the origin"
        yield f"thruster.{name}.x", words
    if y * y_of < 0 and min(abs(y), abs(y_of)) > near / 5:
        yield f"thruster.{name}.behind", f"{screw!r} at y = {y_of:g} m is on the other side: this is at y = {y:g} m"


def _range_of(path: str, unit: str) -> MagnitudeRange | None:
    by_unit = _ADDED if path.startswith("added_mass.") else _BY_UNIT
    return _NAMED.get(path) or _BY_NAME.get(path.rpartition(".")[2]) or by_unit.get(unit)


def _ship_size(document: Mapping[str, Any], values: Mapping[str, float]) -> ShipSize:
    """Length and mass; the length of a ship of this mass where the document gives none."""
    m = abs(values["inertia.m"])
    usual = 5.4 * (m / WATER) ** (1 / 3)
    return ShipSize((document.get("particulars") or {}).get("L_pp") or usual, m)


def _is_unusual(path: str, meant: Iterable[str]) -> bool:
    return any(documents.match_paths(pattern, [path]) for pattern in meant)


def _unusual_remedy(path: str) -> str:
    return f'if it is meant, write {UNUSUAL} = ["{path}"] at the top of the vessel'
