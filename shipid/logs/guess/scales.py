"""Angles and positions in numbers that are no degrees (gon, 1e-7 degrees, degrees and minutes), turned into degrees."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import product

import numpy as np
from pymap3d import geodetic2ned

from shipid.data.dataset import Array
from shipid.logs.guess.clues import State, factor_in_name, unit_in_name
from shipid.logs.guess.evidence import Complex
from shipid.logs.guess.words import meaning_scores, units_in_name
from shipid.logs.mapping import UNITS, degrees_and_minutes
from shipid.units import DEGREE

TURNS = {400.0: "gon", 3600.0: "tenths of a degree", 36000.0: "hundredths of a degree", 6400.0: "mils"}
"""A whole turn in other numbers -> what they are."""
WRITTEN = {
    400.0: r"gons?|gradians?|neugrad|grades?|centesimal(es|i)?",
    3600.0: r"0[.,]1 ?(deg|°)|1/10 ?(deg|°)|(deg|°) ?[*x] ?10|deg_?e-?1",
    36000.0: r"0[.,]01 ?(deg|°)|1/100 ?(deg|°)|(deg|°) ?[*x] ?100|deg_?e-?2",
}
"""A whole turn -> regular expression of how logs write its unit, in lower case."""
ANGLES = ("psi", "course", "alpha", "beta_w")
WHOLE = 0.1  # share of the rows that are whole numbers, at least: between them rows without a value were filled
FINE, AIS = 1e-7, 1.0 / 600_000.0  # deg
PARTS = {FINE: "1e-7 deg", 1e-6: "1e-6 deg", AIS: "1/10000 min"}
"""Part of a degree [deg] that receivers and AIS (ITU-R M.1371) write as whole numbers -> its name."""
OF_AIS = re.compile(r"(1/10[., ']?000|1e-?0?4|10\^-4|0[.,]0001) ?(arc)?(min(utes?)?|')")
SPEEDS, DOUBTED = ("m/s", "kn", "km/h"), 0.4  # of a speed without a unit; share of how far off the next part is
KNOTS, OFF_KNOT = {0.1: "tenths of a knot", 0.01: "hundredths of a knot"}, 0.15
"""Part of a knot that AIS (ITU-R M.1371) and receivers write as whole numbers -> its name; how far off a speed is."""
ARC = {1 / 60: r"(arc)? ?min(ute)?s?|['′]", 1 / 3600: r"(arc)? ?sec(ond)?s?|[\"″]|as"}
"""Part of a degree [deg] -> regular expression of how logs write it as a unit, in lower case."""
OF_KNOTS = {
    0.1: r"(1/10|0[.,]1|d) ?(kn|kts?|knots?)|(kn|kts?|knots?) ?[*x/] ?10",
    0.01: r"(1/100|0[.,]01|c) ?(kn|kts?|knots?)|(kn|kts?|knots?) ?[*x/] ?100",
}
"""Part of a knot -> regular expression of how logs write it as a unit, in lower case."""
CLOSE = 0.97  # share of a whole turn that a heading sweeps before it jumps: it has been all round
BEYOND, TWICE = 360.5, 720.0  # deg: a compass shows less; more than two turns in a row are rare
OFF, BETTER, AGREES = 0.02, 4.0, 0.2  # misfit of a course and a heading, 1 - cos: of 11 deg; times; of a bad one


def take_scales(state: State) -> None:
    """Put into degrees, in place, what is in other numbers; `state.scaled` and `state.unit_of` say so to the draft."""
    for name, values in state.columns.items():
        if (factor := factor_in_name(name)) != 1.0:
            _set_scale(state, name, factor, f"its unit has a prefix: times {factor:g}")
            continue
        scores = meaning_scores(name)
        best = max(scores, key=lambda one: scores[one], default="")
        if best in ANGLES or best in ("delta", "phi", "theta"):
            turn = _turn_in_name(name) or (_whole_turn(values) if best in ANGLES else None)
            if turn is not None:
                _set_scale(state, name, 360.0 / turn, f"a whole turn is {turn:g}: {TURNS[turn]}")
    _take_positions(state)
    _take_speeds(state)
    _by_track(state)


def _take_positions(state: State) -> None:
    pairs = [(a, b) for a in state.called("latitude") for b in state.called("longitude")]
    for north, east in pairs[:1]:
        written = {unit_in_name(name, "rad") for name in (north, east)}
        if written == {"rad"} or (written == {None} and _in_radians(state, north, east)):
            for name in (north, east):
                _set_scale(state, name, 1.0 / DEGREE, "")
                state.scaled.pop(name)  # the unit says it
                state.units[name] = "rad"
        both = np.abs(state.columns[north]), np.abs(state.columns[east])
        if both[0].max() <= 90 and both[1].max() <= 360:
            _take_sides(state, north, east)
            continue
        named = [[unit.strip().lower() for unit in units_in_name(one)] for one in (north, east)]
        arc = next(
            (part for part, words in ARC.items() if all(any(re.fullmatch(words, u) for u in units) for units in named)),
            None,
        )
        if arc is not None and _within_globe(both, arc):
            for name in (north, east):
                _set_scale(state, name, arc, f"{'minutes' if arc == 1 / 60 else 'seconds'} of arc, as its name says")
        elif all(np.mean(one % 1 == 0) > WHOLE and one.max() > 1e6 for one in both) and _within_globe(both, FINE):
            fine = _angle_fraction(state, north, east)
            for name in (north, east):
                _set_scale(state, name, fine, f"whole numbers of {PARTS[fine]}")
        elif all(np.all(one % 100 < 60) for one in both) and both[0].max() < 9000 and both[1].max() < 18000:
            for name in (north, east):
                state.columns[name] = degrees_and_minutes(state.columns[name])
                state.spikes.pop(name, None)
                state.units[name] = "ddmm"
            _take_sides(state, north, east)
            lettered = state.sides & {"N", "S"} and state.sides & {"E", "W"}
            if not lettered and min(state.columns[north].min(), state.columns[east].min()) >= 0:
                state.ask(
                    ("latitude", "longitude"),
                    f"do {north!r} and {east!r}, degrees and minutes without a sign, count to north and east? "
                    f"If they are S or W, write sign = -1",
                )


def _in_radians(state: State, north: str, east: str) -> bool:
    """Whether positions in numbers that small are radians, as a speed shows; asked where there is none."""
    size = np.abs(state.columns[north]).max(), np.abs(state.columns[east]).max()
    if size[0] > np.pi / 2 or size[1] > np.pi:
        return False
    told = _position_unit_by_speed(state, north, east, [1.0, 1.0 / DEGREE])
    if told is None:
        state.ask(
            ("latitude", "longitude"),
            f"are {north!r} and {east!r} degrees, off West Africa, or radians? deg is a guess",
        )
        return False
    return told[1] != 1.0 and told[3] < DOUBTED


def _angle_fraction(state: State, north: str, east: str) -> float:
    """Part of a degree [deg] that whole numbers count, as their names or the speed show; else asked."""
    if all(any(OF_AIS.fullmatch(unit.strip().lower()) for unit in units_in_name(name)) for name in (north, east)):
        return AIS
    both = np.abs(state.columns[north]), np.abs(state.columns[east])
    parts = [fine for fine in PARTS if _within_globe(both, fine)]
    if len(parts) == 1:
        return parts[0]
    names = f"{north!r} and {east!r}"
    told = _position_unit_by_speed(state, north, east, parts)
    if told is not None:
        name, best, other, off = told
        if off > DOUBTED:
            state.ask(
                ("latitude", "longitude", "t"),
                f"are {names} whole numbers of {PARTS[best]}, or of {PARTS[other]}?"
                f" The speed {name!r} does not say it clearly",
            )
        return best
    last = [PARTS[fine] for fine in parts]
    state.ask(
        ("latitude", "longitude", "t"),
        f"are {names} whole numbers of {', '.join(last[:-1])} or of {last[-1]}? {last[0]} is a guess",
    )
    return parts[0]


def _position_unit_by_speed(
    state: State, north: str, east: str, parts: list[float]
) -> tuple[str, float, float, float] | None:
    """Column of a speed, the sizes [deg] of the unit of a position best and next to it, and their relative distance."""
    way = {fine: _distance_run(state, *(fine * state.columns[name] for name in (north, east))) for fine in parts}
    for name in [*state.called("speed"), *state.called("u")]:
        ran = state.chosen.change(np.cumsum(np.abs(state.columns[name]) * np.gradient(state.t)))
        length, written = float(np.sum(np.abs(ran))), unit_in_name(name, "m/s")
        if not length > 0:
            continue
        off = {
            fine: min(
                abs(np.log(max(way[fine], 1e-12) / (length * unit)))
                for unit in ([UNITS["m/s"][written]] if written else _speed_units(state, name))
            )
            for fine in parts
        }
        best, other, *_ = sorted(parts, key=off.__getitem__)
        return name, best, other, off[best] / max(off[other], 1e-12)
    return None


def _speed_units(state: State, name: str) -> list[float]:
    """Units [m/s] that a speed without one in its name may have: whole numbers may be parts of a knot."""
    whole = np.mean(state.columns[name] % 1 == 0) > WHOLE
    parts = [part * UNITS["m/s"]["kn"] for part in KNOTS] if whole else []
    return [*(UNITS["m/s"][unit] for unit in SPEEDS), *parts]


def _take_speeds(state: State) -> None:
    """Put into knots a speed in whole parts of a knot, as its name or the track says."""
    track = _track_changes(state)
    for name in [*state.called("speed")]:
        values = state.columns[name]
        said = [unit.strip().lower() for unit in units_in_name(name)]
        part = next((part for part, words in OF_KNOTS.items() if any(re.fullmatch(words, one) for one in said)), None)
        if part is None and track is not None and unit_in_name(name, "m/s") is None:
            length = float(np.sum(np.abs(state.chosen.change(np.cumsum(np.abs(values) * np.gradient(state.t))))))
            found = float(np.sum(np.abs(track))) / max(length, 1e-12) / UNITS["m/s"]["kn"]
            whole = np.mean(values % 1 == 0) > WHOLE
            part = next((part for part in KNOTS if whole and abs(found / part - 1.0) < OFF_KNOT), None)
        if part is not None:
            _set_scale(state, name, part, f"whole numbers of {KNOTS[part]}")


def _distance_run(state: State, latitude: Array, longitude: Array) -> float:
    """Way [m] over the windows, of positions (N,) [deg]."""
    north, east, _ = geodetic2ned(latitude, longitude, 0.0, float(latitude[0]), float(longitude[0]), 0.0)
    return float(np.sum(np.abs(state.chosen.change(np.asarray(north + 1j * east)))))


def _by_track(state: State) -> None:
    """Find a heading or course without jump and unit, in parts of a turn with which it keeps to the track."""
    track = _track_changes(state)
    for name, values in state.columns.items():
        scores = meaning_scores(name)
        best = max(scores, key=lambda one: scores[one], default="")
        if best not in ("psi", "course") or name in state.scaled or unit_in_name(name, "rad") or track is None:
            continue
        top, low = float(values.max()), float(values.min())
        if top <= 2.2 * np.pi or _angle_jumps(values):
            continue
        left = {
            turn: _heading_misfits(state, track, values, turn)
            for turn in (360.0, *TURNS)
            if top <= 1.01 * turn or turn == 360.0
        }
        turn = min(left, key=lambda one: left[one][0])
        degrees = left[360.0]
        about = ("psi", "u", "v", "r") if best == "psi" else ("course", "u", "v")
        better = degrees[0] > OFF and left[turn][0] * BETTER < degrees[0] and left[turn][0] < AGREES
        offset = 2.0 * degrees[1] < left[turn][1]  # degrees with another zero
        if better and not offset and top > BEYOND and low >= 0.0:
            _set_scale(
                state, name, 360.0 / turn, f"a whole turn is {turn:g}: {TURNS[turn]}, with which it keeps to the track"
            )
        elif (better and not offset) or (top > TWICE and degrees[0] > AGREES):
            words = (
                f"{name!r}, {low:g} to {top:g}, has no unit: degrees, or gon, tenths or hundredths of a degree (factor"
            )
            why = f"; in {TURNS[turn]} it keeps to the track better" if better else ""
            state.ask(about, f"{words} = 0.9, 0.1, 0.01)? deg is a guess{why}")


def _track_changes(state: State) -> Complex | None:
    """Changes (W,) of the position over the windows, north + i east; None where no names say a position."""
    for meanings in (("latitude", "longitude"), ("north", "east"), ("x", "y")):
        for north, east in product(*(state.called(one) for one in meanings)):
            a, b = state.columns[north], state.columns[east]
            if north == east or len(state.chosen.first) < 2:
                continue
            if meanings[0] == "latitude":
                if max(np.abs(a).max() / 90.0, np.abs(b).max() / 360.0) > 1.0:
                    continue
                a, b, _ = geodetic2ned(a, b, 0.0, float(a[0]), float(b[0]), 0.0)
            return state.chosen.change(np.asarray(a + 1j * b))
    return None


def _heading_misfits(state: State, track: Complex, values: Array, turn: float) -> tuple[float, float]:
    """1 - cos of the angle between a track and a heading in parts of a turn: as it is, and with any other zero."""
    middle = (state.chosen.first + state.chosen.last) // 2
    angle = np.exp(2j * np.pi * values[middle] / turn)
    size = max(float(np.sum(np.abs(track))), 1e-12)
    both = [complex(np.sum(track * way)) / size for way in (np.conj(angle), angle)]
    zeros = [max(abs(one.real), abs(one.imag)) for one in both]
    return 1.0 - max(zeros), 1.0 - max(map(abs, both))


def _angle_jumps(values: Array) -> bool:
    """Whether an angle jumps by most of its range, at the end of a turn."""
    return bool(np.any(np.abs(np.diff(values)) > 0.8 * float(np.ptp(values))))


def _take_sides(state: State, north: str, east: str) -> None:
    """Turn the sign of a latitude of S or a longitude of W, which a column of letters says; ask where it changes."""
    for name, plus, minus in ((north, "N", "S"), (east, "E", "W")):
        if minus not in state.sides or state.columns[name].min() < 0:
            continue
        if plus in state.sides:
            state.ask(
                ("latitude", "longitude"),
                f"{name!r} is {plus} in some rows and {minus} in others, as columns of letters say"
                f": write it as a number with a sign",
            )
            continue
        state.negate(name)
        state.find("sign of a position", (name,), 0.95, f"{name!r} has no sign, and a column of letters says {minus}")


def _set_scale(state: State, name: str, factor: float, why: str) -> None:
    state.columns[name] = state.columns[name] * factor
    state.scaled[name] = factor, why
    if name in state.spikes:
        rows, size = state.spikes[name]
        state.spikes[name] = rows, size * factor


def _turn_in_name(name: str) -> float | None:
    """Whole turn in the unit that a name has in brackets or at its end."""
    last = re.split(r"[_ ]", name.strip())[-1]
    said = [*units_in_name(name), *([last] if last != name.strip() else [])]
    return next(
        (turn for turn, words in WRITTEN.items() if any(re.fullmatch(words, one.strip().lower()) for one in said)), None
    )


def _whole_turn(values: Array) -> float | None:
    """Whole turn of an angle that jumps, where it is none of degrees or radians."""
    span = float(np.ptp(values))
    if not span > 0 or not _angle_jumps(values):
        return None
    return next((turn for turn in TURNS if CLOSE * turn < span <= turn), None)


def _within_globe(both: Iterable[Array], factor: float) -> bool:
    return all(float(one.max()) * factor <= most for one, most in zip(both, (90.0, 360.0), strict=True))
