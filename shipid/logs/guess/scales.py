"""Angles and positions in numbers that are no degrees: gon, hundredths of a degree, 1e-7 degrees, degrees and minutes.

Their columns are turned into degrees before anything else is judged. The draft then has a factor, or the unit `ddmm`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from shipid.data.dataset import Array
from shipid.logs.guess.clues import State, unit_in_name
from shipid.logs.guess.words import fits, units_in
from shipid.logs.mapping import degrees_of
from shipid.units import DEGREE

TURNS = {400.0: "gon", 3600.0: "tenths of a degree", 36000.0: "hundredths of a degree", 6400.0: "mils"}
"""A whole turn in other numbers -> what they are."""
WRITTEN = {
    400.0: r"gons?|gradians?|neugrad|grades?|centesimal(es|i)?",
    3600.0: r"ddeg|decidegs?|0[.,]1 ?(deg|°)|1/10 ?(deg|°)|(deg|°) ?[*x] ?10|deg_?e-?1",
    36000.0: r"cdeg|centidegs?|0[.,]01 ?(deg|°)|1/100 ?(deg|°)|(deg|°) ?[*x] ?100|deg_?e-?2",
}
"""A whole turn -> regular expression of how logs write its unit, in lower case."""
ANGLES = ("psi", "course", "alpha", "beta_w")
WHOLE = 0.1  # share of the rows that are whole numbers, at least: between them rows without a value were filled
FINE = 1e-7  # deg, of whole numbers of a receiver
CLOSE = 0.97  # share of a whole turn that a heading sweeps before it jumps: it has been all round


def take_scales(state: State) -> None:
    """Put into degrees, in place, what is in other numbers; `state.scaled` and `state.unit_of` say so to the draft."""
    for name, values in state.columns.items():
        scores = fits(name)
        if max(scores, key=lambda one: scores[one], default="") in ANGLES:
            turn = _written(name) or _turn(values)
            if turn is not None:
                _scale(state, name, 360.0 / turn, f"a whole turn is {turn:g}: {TURNS[turn]}")
    pairs = [(a, b) for a in state.called("latitude") for b in state.called("longitude")]
    for north, east in pairs[:1]:
        if {unit_in_name(name, "rad") for name in (north, east)} == {"rad"}:
            for name in (north, east):
                _scale(state, name, 1.0 / DEGREE, "")
                state.scaled.pop(name)  # the unit says it
                state.units[name] = "rad"
        both = np.abs(state.columns[north]), np.abs(state.columns[east])
        if both[0].max() <= 90 and both[1].max() <= 360:
            _take_sides(state, north, east)
            continue
        if all(np.mean(one % 1 == 0) > WHOLE and one.max() > 1e6 for one in both) and _on_globe(both, FINE):
            for name in (north, east):
                _scale(state, name, FINE, "whole numbers of 1e-7 deg")
        elif all(_is_ddmm(one) for one in both) and both[0].max() < 9000 and both[1].max() < 18000:
            for name in (north, east):
                state.columns[name] = degrees_of(state.columns[name])
                state.spikes.pop(name, None)
                state.units[name] = "ddmm"
            _take_sides(state, north, east)
            lettered = state.sides & {"N", "S"} and state.sides & {"E", "W"}
            if not lettered and min(state.columns[north].min(), state.columns[east].min()) >= 0:
                words = f"do {north!r} and {east!r}, degrees and minutes without a sign, count to north and east? "
                state.ask(("latitude", "longitude"), f"{words}If they are S or W, write sign = -1")


def _take_sides(state: State, north: str, east: str) -> None:
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


def _scale(state: State, name: str, factor: float, why: str) -> None:
    state.columns[name] = state.columns[name] * factor
    state.scaled[name] = factor, why
    if name in state.spikes:
        rows, size = state.spikes[name]
        state.spikes[name] = rows, size * factor


def _written(name: str) -> float | None:
    """Whole turn in the unit that a name has in brackets or at its end."""
    last = re.split(r"[_ ]", name.strip())[-1]
    said = [*units_in(name), *([last] if last != name.strip() else [])]
    return next(
        (turn for turn, words in WRITTEN.items() if any(re.fullmatch(words, one.strip().lower()) for one in said)), None
    )


def _turn(values: Array) -> float | None:
    """Whole turn of an angle that jumps, where it is none of degrees or radians."""
    span = float(np.ptp(values))
    if not span > 0 or not np.any(np.abs(np.diff(values)) > 0.8 * span):
        return None
    return next((turn for turn in TURNS if CLOSE * turn < span <= turn), None)


def _on_globe(both: Iterable[Array], factor: float) -> bool:
    return all(float(one.max()) * factor <= most for one, most in zip(both, (90.0, 360.0), strict=True))


def _is_ddmm(values: Array) -> bool:
    """Whether numbers, too large for degrees, are degrees and minutes, as in 6326.4 for 63 deg 26.4 min."""
    return bool(np.all(values % 100 < 60))
