"""Angles and positions in numbers that are no degrees (gon, 1e-7 degrees, degrees and minutes), turned into degrees."""

from __future__ import annotations

import re

import numpy as np
from pymap3d import geodetic2ned

from shipid.data.dataset import Array
from shipid.logs.guess.clues import State
from shipid.logs.guess.settings import SETTINGS
from shipid.logs.guess.words import factor_in_name, unit_in_name, units_in_name
from shipid.logs.mapping import UNITS, degrees_and_minutes
from shipid.units import DEGREE

TURNS = {400.0: "gon", 3600.0: "tenths of a degree", 36000.0: "hundredths of a degree", 6400.0: "mils"}
"""A whole turn in other numbers -> what they are."""
KNOTS = {0.1: "tenths of a knot", 0.01: "hundredths of a knot"}
"""Part of a knot that AIS (ITU-R M.1371) and receivers write as whole numbers -> its name."""
_PLACE_PARTS = {
    1 / 60: ("minutes of arc", r"(arc)? ?min(ute)?s?|['′]"),
    1 / 3600: ("seconds of arc", r"(arc)? ?sec(ond)?s?|[\"″]|as"),
    1e-7: ("whole numbers of 1e-7 deg", ""),
    1e-6: ("whole numbers of 1e-6 deg", ""),
    1 / 600_000: (
        "whole numbers of 1/10000 min",
        r"(1/10[., ']?000|1e-?0?4|10\^-4|0[.,]0001) ?(arc)?(min(utes?)?|')",
    ),
}
"""Part of a degree [deg] that logs count -> what it is, and how they write it as a unit, in lower case."""


def take_scales(state: State) -> None:
    """Put into degrees, in place, positions that are in other numbers, and what has a prefix before its unit."""
    for name in [*state.columns]:
        if (factor := factor_in_name(name)) != 1.0:
            set_scale(state, name, factor, f"its unit has a prefix: times {factor:g}")
    pairs = [(a, b) for a in state.called("latitude") for b in state.called("longitude")]
    if not pairs and not any(map(state.called, ("latitude", "longitude", "north", "east", "x", "y"))):
        coded = [name for name in state.eligible("latitude", "longitude") if _are_minutes(np.abs(state.columns[name]))]
        coded.sort(key=lambda name: float(np.abs(state.columns[name]).max()))
        pairs = [(coded[0], coded[1])] if len(coded) == 2 else []
    if pairs:
        _take_positions(state, *pairs[0])


def turn_of_jumps(values: Array) -> float | None:
    """The whole turn at which an angle jumps, after it has been all round; None where it does not."""
    span, steps = float(np.ptp(values)), np.abs(np.diff(values))
    if not span > 0 or not np.any(steps > 0.8 * span):
        return None
    return next((turn for turn in (360.0, 2 * np.pi, *TURNS) if 0.97 * turn < span <= 1.001 * turn), None)


def set_scale(state: State, name: str, factor: float, why: str) -> None:
    """Multiply a column by a factor, here and in the draft."""
    state.columns[name] = state.columns[name] * factor
    state.scaled[name] = factor, why
    if name in state.spikes:
        rows, size = state.spikes[name]
        state.spikes[name] = rows, size * factor


def _has_unit(name: str, words: str) -> bool:
    """Whether a name has these words as a unit, in brackets or at its end."""
    last = re.split(r"[_ ]", name.strip())[-1]
    said = [*units_in_name(name), *([last] if last != name.strip() else [])]
    return any(re.fullmatch(words, text.strip().lower()) for text in said)


def _are_minutes(values: Array) -> bool:
    """Whether sizes (N,) have the form of degrees and minutes, such as 6326.4012, and no other quantity has it."""
    fine = np.mean(np.abs(100 * values - np.round(100 * values)) > 1e-6) > 0.5
    return bool(
        fine and values.min() > 100 and values.max() < 18000 and np.all(values % 100 < 60) and np.ptp(values) < 100
    )


def _take_positions(state: State, north: str, east: str) -> None:
    """Put a latitude and longitude into degrees: in the likeliest of the units in which it is on the globe."""
    places = {**_places_in_degrees(state, north, east)}
    if not places:
        return
    costs = {unit: cost + _off_speed(state, *both) for unit, (both, cost) in places.items()}
    unit, *others = sorted(costs, key=costs.__getitem__)
    names = f"{north!r} and {east!r}"
    if others and costs[others[0]] < costs[unit] + SETTINGS.close:
        rivals = ", or ".join([unit, *others])
        state.ask(("latitude", "longitude", "t"), f"are {names} in {rivals}? {unit} is a guess; a speed would tell")
    for name, values in zip((north, east), places[unit][0], strict=True):
        part = next((part for part, (what, _) in _PLACE_PARTS.items() if what == unit), None)
        if part is not None:
            set_scale(state, name, part, unit)
        elif unit != "deg":
            state.columns[name] = values
            state.units[name] = "rad" if unit == "radians" else "ddmm"
            state.spikes.pop(name, None)
    if unit in ("deg", "ddmm"):
        _take_sides(state, north, east, unit)


def _places_in_degrees(state: State, north: str, east: str) -> dict[str, tuple[tuple[Array, Array], float]]:
    """Unit -> latitude and longitude in degrees, where they are on the globe, and what speaks against the unit."""
    a, b = state.columns[north], state.columns[east]
    written = {unit_in_name(name, "rad") for name in (north, east)}
    found: dict[str, tuple[tuple[Array, Array], float]] = {"deg": ((a, b), 0.0)}
    if written == {"rad"} or (written == {None} and np.abs(a).max() <= np.pi / 2 and np.abs(b).max() <= np.pi):
        found["radians"] = ((a / DEGREE, b / DEGREE), -9.0 if written == {"rad"} else SETTINGS.usual_unit)
    if np.abs(a).max() > 90 and np.abs(a).max() < 9000 and all(np.all(np.abs(one) % 100 < 60) for one in (a, b)):
        found["ddmm"] = ((degrees_and_minutes(a), degrees_and_minutes(b)), 0.0)
    for part, (what, words) in _PLACE_PARTS.items():
        said = words != "" and _has_unit(north, words) and _has_unit(east, words)
        counted = part < 1e-5 and all(np.mean(one % 1 == 0) > 0.1 and np.abs(one).max() > 1e6 for one in (a, b))
        if said or counted:
            usual = 0.0 if part == 1e-7 else SETTINGS.usual_unit
            found[what] = ((a * part, b * part), -9.0 if said else usual)
    return {
        unit: one for unit, one in found.items() if np.abs(one[0][0]).max() <= 90 and np.abs(one[0][1]).max() <= 360
    }


def _off_speed(state: State, latitude: Array, longitude: Array) -> float:
    """What a speed says against positions (N,) [deg]: how far the way is off its integral, in any usual unit."""
    north, east, _ = geodetic2ned(latitude, longitude, 0.0, float(latitude[0]), float(longitude[0]), 0.0)
    way = float(np.sum(np.abs(state.chosen.change(np.asarray(north + 1j * east)))))
    pairs = zip(state.called("velocity_north"), state.called("velocity_east"), strict=False)
    for names in (*((name,) for name in (*state.called("speed"), *state.called("u"))), *pairs):
        values, written = np.linalg.norm([state.columns[one] for one in names], axis=0), unit_in_name(names[0], "m/s")
        ran = float(np.sum(np.abs(state.chosen.change(np.cumsum(values * np.gradient(state.t))))))
        parts = (1.0, *KNOTS) if written is None and np.mean(values % 1 == 0) > 0.1 else (1.0,)
        units = [UNITS["m/s"][unit] for unit in ((written,) if written else ("m/s", "kn", "km/h"))]
        if ran > 0:
            off = min(abs(np.log(max(way, 1e-12) / (ran * unit * part))) for unit in units for part in parts)
            return float(off / SETTINGS.off_unit)
    return 0.0


def _take_sides(state: State, north: str, east: str, unit: str) -> None:
    """Turn the sign of a latitude of S or a longitude of W, which a column of letters says; ask where it changes."""
    for name, plus, minus in ((north, "N", "S"), (east, "E", "W")):
        if minus not in state.sides or state.columns[name].min() < 0:
            continue
        if plus in state.sides:
            words = f"{name!r} is {plus} in some rows and {minus} in others, as columns of letters say"
            state.ask(("latitude", "longitude"), f"{words}: write it as a number with a sign")
            continue
        state.negate(name)
        state.find("sign of a position", (name,), 0.95, f"{name!r} has no sign, and a column of letters says {minus}")
    lettered = state.sides & {"N", "S"} and state.sides & {"E", "W"}
    if unit == "ddmm" and not lettered and min(state.columns[one].min() for one in (north, east)) >= 0:
        words = f"do {north!r} and {east!r}, degrees and minutes without a sign, count to north and east?"
        state.ask(("latitude", "longitude"), f"{words} If they are S or W, write sign = -1")
