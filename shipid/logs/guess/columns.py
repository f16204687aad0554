"""Guess what the columns of an unknown log are, how sure that is, and what is wrong with them.

The name of a column gives candidates; kinematic tests decide between them. A guess is a draft for a person to read. It
corrects nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pymap3d import geodetic2ned

from shipid.data.dataset import Array
from shipid.errors import DataError
from shipid.logs.guess import evidence
from shipid.logs.guess.clues import SIDES, Finding, State, Suggestion, unit_said
from shipid.logs.guess.defects import defects_of_motion, defects_of_rows
from shipid.logs.guess.evidence import Complex, Fit
from shipid.logs.guess.sniff import Sniffed, sniff
from shipid.logs.mapping import UNITS, to_si
from shipid.physics.signals import SIGNALS, named, steers

CLEAR, LIKELY = 1.5, 0.6
AZIMUTH = "thruster"  # component of the command of an azimuth unit whose name has no side


@dataclass(frozen=True)
class Guess:
    """The result of a guess.

    sniffed : the log as numbers. columns, findings : suggested columns and defects. unused : columns without a meaning.
    """

    file: Path
    sniffed: Sniffed
    columns: tuple[Suggestion, ...]
    findings: tuple[Finding, ...]
    unused: tuple[str, ...]

    def column(self, name: str) -> Suggestion | None:
        """Return the suggestion for a column of the dataset; None if there is none."""
        return next((column for column in self.columns if column.name == name), None)

    @property
    def kinds(self) -> set[str]:
        """Kinds of all findings."""
        return {finding.kind for finding in self.findings}


def guess(file: str | Path, names: tuple[str, ...] = ()) -> Guess:
    """Guess the mapping of a log.

    Parameters
    ----------
    file : text, Parquet, MATLAB or NMEA 0183.
    names : of the columns of a text log that has no header.

    Raises
    ------
    DataError : if the log cannot be read, or has no clock, no heading or no position.
    """
    sniffed = sniff(Path(file), names)
    columns = evidence.filled(sniffed.t, sniffed.columns.items())
    state = State(sniffed.t, sniffed.clock["unit"], columns, evidence.windows(sniffed.t))
    for name in [
        name for name, values in columns.items() if np.array_equal(values, np.arange(len(values)) + values[0])
    ]:
        state.taken.add(name)  # numbers of rows
    if len(state.chosen.first) < 5:
        raise DataError(f"{len(sniffed.t)} rows: too few for a guess", file=file)
    _pose(state, file)
    _velocities(state)
    _yaw_rate(state)
    _orders(state)
    _others(state)
    defects_of_rows(state, sniffed)
    defects_of_motion(state)
    left = tuple(state.free())
    return Guess(Path(file), sniffed, tuple(state.suggestions), tuple(state.findings), left)


def _pose(state: State, file: str | Path) -> None:
    """Choose position and heading: the pair of columns and the angle whose course and heading agree best.

    Columns with fitting names are tried first. Raises DataError if no column can be a position or a heading.
    """
    pairs = [(n, e) for n in state.called("north") for e in state.called("east")]
    globe = [(n, e) for n in state.called("latitude") for e in state.called("longitude")]
    headings = state.called("psi")
    numbered = all(name.isdecimal() for name in state.columns)
    if globe and not pairs:
        pairs = globe
    if numbered:
        rated = _differentiated(state)
        headings = rated
        free = rated if len(rated) > 2 else state.free()
        pairs = [(a, b) for a in free for b in free if a != b]
    best: tuple[float, str, str, str, str, complex, complex] | None = None
    for north, east in pairs:
        position = _plane(state, north, east, (north, east) in globe)
        track = state.chosen.change(position)
        for heading in headings:
            if heading in (north, east):
                continue
            for unit in ("deg", "rad"):
                psi, _ = evidence.heal(state.columns[heading], 2 * np.pi / to_si(unit, "psi"), state.t)
                middle = to_si(unit, "psi") * psi[(state.chosen.first + state.chosen.last) // 2]
                same, mirrored = evidence.agreement(track, middle), evidence.agreement(track, -middle)
                said = unit_said(heading, "rad")
                score = max(same.real, abs(mirrored) - 0.05) + 0.02 * (unit == (said or "deg"))
                if best is None or score > best[0]:
                    best = (score, north, east, heading, unit, same, mirrored)
    if best is None:
        missing = "position (north and east, or latitude and longitude)" if not pairs else "heading"
        raise DataError(f"no column can be the {missing}: name the columns with --names, or map by hand", file=file)
    _take_pose(state, *best[1:], on_globe=best[1:3] in globe)


def _differentiated(state: State) -> list[str]:
    """Return the columns whose rate is another column: the candidates for a heading in a log without names."""
    integrated = []
    integrals = {name: state.chosen.change(evidence.integral(state.t, state.columns[name])) for name in state.free()}
    for name in state.free():
        change = state.chosen.change(state.columns[name])
        fits = [evidence.fit(change, integrals[other]) for other in integrals if other != name]
        if any(fit.left < 0.05 and abs(fit.scale - 1) < 0.05 for fit in fits):
            integrated.append(name)
    return integrated


def _plane(state: State, north: str, east: str, on_globe: bool) -> Complex:
    a, b = state.columns[north], state.columns[east]
    if on_globe:
        a, b, _ = geodetic2ned(a, b, 0.0, float(a[0]), float(b[0]), 0.0)
    return np.asarray(a + 1j * b)


def _take_pose(
    state: State, north: str, east: str, heading: str, unit: str, same: complex, mirrored: complex, on_globe: bool
) -> None:
    names = ("latitude", "longitude") if on_globe else ("north", "east")
    position = _plane(state, north, east, on_globe)
    extra: dict[str, Any] = {"wrap": True}
    worse = (1.0 - abs(same)) / max(1.0 - abs(mirrored), 1e-9)
    confidence = float(np.clip(1.0 - 0.5 * worse, 0.5, 0.99)) * min(1.0, abs(same) + 0.1)
    if abs(mirrored) > 1.3 * abs(same) and abs(mirrored) > 0.7:
        turned = float(np.degrees(np.angle(mirrored)))
        if abs(abs(turned) - 90.0) < 30.0:
            sentence = f"course and heading agree only with {north!r} as east and {east!r} as north"
            state.find("north and east swapped", (north, east), abs(mirrored), sentence)
            north, east = east, north
            position = _plane(state, north, east, on_globe)
        else:
            sentence = f"{heading!r} rises where the course falls: it counts to port, or east is west"
            state.find("heading counted to port", (heading,), abs(mirrored), sentence)
            extra["sign"] = -1
        confidence = min(0.9, abs(mirrored))
    position_unit = "deg" if on_globe else "m"
    why = f"course over ground keeps to the heading (agreement {max(abs(same), abs(mirrored)):.3f} of 1)"
    for name, source in zip(names, (north, east), strict=True):
        state.suggest(name, source, position_unit, confidence, why)
    own_turn = 2 * np.pi / to_si(unit, "psi")
    psi, false = evidence.heal(state.columns[heading], own_turn, state.t)
    if false.any():
        across = "360" if unit == "deg" else "2 pi"
        sentence = f"{int(false.sum())} steps of {heading!r} lie between two headings across {across}"
        repair = {"kind": "wrap_interpolation", "columns": ["psi"], "threshold": 20.0, "unit": "deg"}
        state.find("interpolation across 360", (heading,), 0.98, sentence, repair)
    state.suggest("psi", heading, unit, confidence, f"{why}; in {unit} rather than another unit", **extra)
    state.position, state.psi = position, psi * to_si(unit, "psi") * extra.get("sign", 1)


def _velocities(state: State) -> None:
    """Choose the two velocity columns: the pair, frame, order and sign whose integral fits the track best.

    A pair with fitting names wins if it fits nearly as well.
    """
    assert state.position is not None
    assert state.psi is not None
    seen = state.chosen.change(state.position)
    ranked = sorted(_hypotheses(state, seen), key=lambda entry: entry[0].left)
    if not ranked or ranked[0][0].left > 0.5:
        _speed_and_course(state, seen)
        return
    best = ranked[0]
    named = [entry for entry in ranked if entry[1] in state.called("u") and entry[2] in state.called("v")]
    if not named and not all(name.isdecimal() for name in state.columns) and _speed_and_course(state, seen):
        return
    plain_body = [entry for entry in named if entry[3] == "body"]
    for better in (named[:1], plain_body[:1]):
        if better and better[0][0].left < CLEAR * best[0].left + 1e-6:
            best = better[0]
    if not named and best[0].left > 0.1:
        return
    runner = next(
        (entry for entry in ranked if entry[3] != best[3] and {entry[1], entry[2]} == {best[1], best[2]}), None
    )
    _take_velocities(state, best, runner[0] if runner else None)


Hypothesis = tuple[Fit, str, str, str, Complex]


def _hypotheses(state: State, seen: Complex) -> Iterator[Hypothesis]:
    """Yield every ordered pair of free columns as earth-fixed, as body-fixed, and as body-fixed with v to port."""
    assert state.psi is not None
    numbered = all(name.isdecimal() for name in state.columns)
    free = [name for name in state.free() if np.ptp(state.columns[name]) > 0]
    if not numbered:
        free = [name for name in free if name in {*state.called("u"), *state.called("v")}]
    turn = np.exp(1j * state.psi)
    earth = {name: evidence.integral(state.t, state.columns[name]) for name in free}
    body = {name: evidence.integral(state.t, state.columns[name] * turn) for name in free}
    for first in free:
        for second in free:
            if first == second:
                continue
            for frame, path in (
                ("earth", earth[first] + 1j * earth[second]),
                ("body", body[first] + 1j * body[second]),
                ("mirrored", body[first] - 1j * body[second]),
            ):
                change = state.chosen.change(path)
                keep = evidence.robust(seen, change)
                result = evidence.fit(seen[keep], change[keep])
                if result.scale > 0:
                    yield result, first, second, frame, path


def _take_velocities(state: State, best: Hypothesis, runner: Fit | None) -> None:
    fit, first, second, frame, _ = best
    assert state.psi is not None
    unit, rest = _speed_unit(fit, (first, second), state)
    factor = to_si(unit, "u")
    contrast = 1.0 - fit.left / runner.left if runner is not None and runner.left > 0 else 1.0
    confidence = float(np.clip(0.6 + 0.4 * contrast, 0.0, 0.99)) * (1 - min(0.5, fit.left))
    fixed = "earth" if frame == "earth" else "body"
    why = f"integrated as {fixed}-fixed [{unit}] they leave {100 * fit.left:.2g} % of the track unexplained"
    if runner is not None:
        why += f", otherwise {100 * runner.left:.2g} %"
    in_unit = state.columns[first] * factor, state.columns[second] * factor
    extra_v: dict[str, Any] = {}
    if frame == "earth":
        extra = {"frame": "earth"}
        if first in state.all_called("u"):
            sentence = (
                f"{first!r} and {second!r} are named like body-fixed velocities, but are the rates of north and east"
            )
            state.find("earth-fixed velocities", (first, second), confidence, sentence)
    else:
        extra = {}
        if frame == "mirrored":
            sentence = f"{second!r} is positive to port: the track is met with its sign changed"
            state.find("wrong sign of v", (second,), confidence, sentence)
            extra_v = {"sign": -1}
        if first in state.all_called("v") and second in state.all_called("u"):
            state.find(
                "u and v swapped", (first, second), confidence, f"{first!r} is along the heading, {second!r} across it"
            )
    state.suggest("u", first, unit, confidence, why, **extra)
    state.suggest("v", second, unit, confidence, why, **extra, **extra_v)
    pair = in_unit[0] + 1j * in_unit[1] * (-1 if frame == "mirrored" else 1)
    turn = np.exp(1j * state.psi)
    state.velocity = np.asarray(pair if frame == "earth" else pair * turn)
    state.body = np.asarray(pair / turn if frame == "earth" else pair)
    _factor(state, rest, Fit(fit.scale / factor, fit.error / factor, fit.left), (first, second), unit)


def _speed_unit(fit: Fit, sources: tuple[str, str], state: State) -> tuple[str, bool]:
    """Return the unit nearest to the fitted scale, and whether a factor remains; report another unit in the name."""
    units = UNITS["m/s"]
    unit = min(units, key=lambda name: abs(np.log(max(fit.scale, 1e-9) / units[name])))
    said = unit_said(sources[0], "m/s")
    if unit != (said or "m/s") and abs(fit.scale / units[unit] - 1) < 0.08:
        word = "knots" if "kn" in (unit, said) else "speed unit"
        wanted = f"the name says {said}" if said else "nothing says so"
        sentence = f"the track is {fit.scale:.3f} times the integral: {sources[0]!r} is in {unit} ({wanted})"
        state.find(word, sources, 0.95, sentence)
    elif said is not None and abs(fit.scale / units[unit] - 1) >= 0.08:
        unit = said
    return unit, abs(fit.scale / units[unit] - 1) > 0.004


def _factor(state: State, remains: bool, fit: Fit, sources: tuple[str, str], unit: str) -> None:
    """Report a factor that remains after the unit: shown by the rounding of the values, or larger than its error."""
    per_knot = 1.0 / (UNITS["m/s"]["kn"] / UNITS["m/s"][unit])
    rounds = [evidence.lattice(state.columns[source], 0.85 * per_knot, 1.15 * per_knot) for source in sources]
    near = [entry for entry in rounds if entry[1] > 0.9]
    if near and unit != "kn":
        multiplier, _, count = max(near, key=lambda entry: entry[2])
        factor = multiplier / per_knot
        if abs(factor - fit.scale) < max(0.03, 3 * fit.error) and abs(factor - 1.0) > 1e-3:
            sentence = (
                f"{count} values are round in knots if these were divided by {multiplier:.4f}, not {per_knot:.4f}"
            )
            sentence += f" (the track says {fit.scale:.3f} +- {fit.error:.3f})"
            repair = {"kind": "scale", "columns": ["u", "v"], "factor": round(factor, 4)}
            state.find("factor", sources, 0.95, sentence, repair)
        return
    off = abs(fit.scale - 1.0)
    if not remains or not np.isfinite(fit.error) or off < max(3 * fit.error, 0.004):
        return
    sure = float(np.clip(off / (5 * fit.error + 1e-9), 0.2, 0.9))
    pair = f"{sources[0]!r} and {sources[1]!r} in {unit}"
    sentence = f"the track is {fit.scale:.4f} +- {fit.error:.4f} times the integral of {pair}"
    repair = {"kind": "scale", "columns": ["u", "v"], "factor": round(fit.scale, 4)}
    state.find("factor", sources, sure, sentence, repair)


def _speed_and_course(state: State, seen: Complex) -> bool:
    """Take speed and course over ground, if the log has them, instead of velocities."""
    for speed in state.called("speed"):
        for course in state.called("course"):
            angle, _ = evidence.heal(state.columns[course], 360.0, state.t)
            path = evidence.integral(state.t, state.columns[speed] * np.exp(1j * np.radians(angle)))
            fit = evidence.fit(seen, state.chosen.change(path))
            if fit.left > 0.2:
                continue
            units = UNITS["m/s"]
            unit = min(units, key=lambda name: abs(np.log(max(fit.scale, 1e-9) / units[name])))
            why = f"along the course [deg] it leaves {100 * fit.left:.2g} % of the track unexplained"
            state.suggest("speed", speed, unit, 0.9, why)
            state.suggest("course", course, "deg", 0.9, why, wrap=True)
            state.velocity = np.asarray(to_si(unit, "u") * state.columns[speed] * np.exp(1j * np.radians(angle)))
            state.body = np.asarray(state.velocity * np.exp(-1j * state.psi))  # type: ignore[operator]
            return True
    return False


def _yaw_rate(state: State) -> None:
    """Choose the yaw rate: the column whose integral fits the heading best; a fitting name wins if nearly as good."""
    assert state.psi is not None
    change = state.chosen.change(state.psi)
    if float(np.std(change)) < np.radians(0.5):
        _rate_by_name(state)
        return
    candidates = []
    for name in state.free():
        fit = evidence.fit(change, state.chosen.change(evidence.integral(state.t, state.columns[name])))
        unit = min(UNITS["rad/s"], key=lambda entry: abs(np.log(max(abs(fit.scale), 1e-12) / UNITS["rad/s"][entry])))
        if fit.left < 0.5 and abs(abs(fit.scale) / UNITS["rad/s"][unit] - 1) < 0.25:
            candidates.append((fit, name, unit))
    candidates.sort(key=lambda entry: entry[0].left)
    if not candidates:
        return
    best, called = candidates[0], state.all_called("r")
    named = [entry for entry in candidates if entry[1] in called and entry[0].left < CLEAR * best[0].left + 0.1]
    fit, name, unit = named[0] if named else best
    extra: dict[str, Any] = {}
    why = f"integrated in {unit} it leaves {100 * fit.left:.2g} % of the heading's change unexplained"
    confidence = 0.99 * (1 - min(0.5, fit.left))
    if fit.scale < 0:
        extra["sign"] = -1
        state.find("wrong sign of r", (name,), confidence, f"{name!r} is positive where the heading falls")
    if name not in called and not name.isdecimal():
        other = f", which {called[0]!r} is not" if called else ""
        state.find("yaw rate under another name", (name,), confidence, f"{name!r} is the rate of the heading{other}")
    said = unit_said(name, "rad/s")
    if said is not None and said != unit:
        state.find("unit of r", (name,), confidence, f"{name!r} says {said}, but is in {unit}")
    state.suggest("r", name, unit, confidence, why, **extra)
    state.r = state.columns[name] * to_si(unit, "r") * extra.get("sign", 1)


def _rate_by_name(state: State) -> None:
    for name in state.called("r")[:1]:
        unit = unit_said(name, "rad/s") or "deg/s"
        state.suggest("r", name, unit, 0.4, "by its name; the ship turns too little to see unit and sign")


def _orders(state: State) -> None:
    """Choose rudder, azimuth and shaft columns by name, and their sign by their effect on the yaw rate."""
    numbered = all(name.isdecimal() for name in state.columns)
    r = state.r if state.r is not None else np.gradient(state.psi, state.t) if state.psi is not None else None
    angles = [(name, signal) for signal in named("command") if steers(signal) for name in state.called(signal)]
    if numbered and r is not None:
        small = [
            name
            for name in state.free()
            if 0 < np.abs(state.columns[name]).max() < 95 and np.ptp(state.columns[name]) > 0
        ]
        # an order is held at its largest value; a response such as roll is not
        strength = {
            name: evidence.effect(state.t, r, state.columns[name]) * _held(state.columns[name]) for name in small
        }
        likely = max(strength, key=lambda name: abs(strength[name]), default="")
        angles = [(likely, "delta")] if likely and abs(strength[likely]) > 4 else []
    azimuth = any(SIGNALS[signal].component == AZIMUTH for _, signal in angles)
    used: dict[str, int] = {}
    for name, signal in angles:
        values = state.columns[name]
        unit = _unit_of(state, name, signal)
        power = 0.0 if r is None else evidence.effect(state.t, r, values)
        extra: dict[str, Any] = {}
        why = "by its name; it is not seen to turn the ship"
        confidence = 0.4 if numbered else 0.5
        if abs(power) > 4:
            confidence = 0.95
            sides = (
                ("port", "starboard") if power > 0 else ("starboard", "port")
            )  # side to which it does not turn the ship, side to which it does
            why = f"positive turns the ship to {sides[1]} (t value {abs(power):.0f})"
            if (power > 0) != (SIGNALS[signal].turns > 0):  # an azimuth is taken for one aft of the origin
                extra["sign"] = -1
                sentence = f"positive {name!r} turns to {sides[1]} (t value {abs(power):.0f}); here to {sides[0]}"
                state.find("wrong sign of rudder", (name,), confidence, sentence)
        component = _component(name, SIGNALS[signal].component)
        state.suggest(_unique(f"{component}.{signal}", used), name, unit, confidence, why, **extra)
    for signal in (signal for signal in named("command") if not steers(signal)):
        for name in state.called(signal):
            said = unit_said(name, SIGNALS[signal].unit)
            component = _component(name, AZIMUTH if azimuth else SIGNALS[signal].component)
            why = f"by its name; up to {float(np.abs(state.columns[name]).max()):.4g}"
            unit = _unit_of(state, name, signal)
            state.suggest(_unique(f"{component}.{signal}", used), name, unit, 0.9 if said else 0.7, why)


def _unit_of(state: State, name: str, signal: str) -> str:
    """Return the unit of a column taken as this signal: the unit in its name, else the likely one by its magnitude."""
    row = SIGNALS[signal]
    large = row.read_as_SI is not None and float(np.abs(state.columns[name]).max()) > row.read_as_SI
    return unit_said(name, row.unit) or (
        row.read_in if large or (row.shaft and row.read_in in name.lower()) else row.unit
    )


def _held(values: Array) -> float:
    """Return the share of rows that repeat the value before (to 1/1000 of the range), floored: orders are held."""
    return 0.05 + float(np.mean(np.abs(np.diff(values)) < 1e-3 * np.ptp(values)))


def _component(name: str, fallback: str) -> str:
    side = re.search(SIDES, name.lower())
    return {"stbd": "starboard"}.get(side.group(1), side.group(1)) if side else fallback


def _unique(name: str, used: dict[str, int]) -> str:
    used[name] = used.get(name, 0) + 1
    component, _, signal = name.partition(".")
    return name if used[name] == 1 else f"{component}_{used[name]}.{signal}"


def _others(state: State) -> None:
    """Choose roll, pitch and wind columns by their names alone."""
    for meaning in ("phi", "theta"):
        for name in state.called(meaning)[:1]:
            unit = _unit_of(state, name, meaning)
            state.suggest(meaning, name, unit, 0.5, "by its name; the log does not show its sign")
    if {"apparent_angle", "apparent_speed"} <= set(state.free()):
        why = "the sentence says that it is relative to the bow"
        state.suggest("V_w", "apparent_speed", "m/s", 0.9, why)
        state.suggest("beta_w", "apparent_angle", "deg", 0.9, why, direction="from", relative=True, wrap=True)
    speeds, angles = state.called("V_w"), state.called("beta_w")
    if speeds and angles:
        unit = unit_said(speeds[0], "m/s") or "m/s"
        state.suggest("V_w", speeds[0], unit, 0.5, "by its name; the log does not show whether it is true or apparent")
        said = "from" if "towards" not in angles[0].lower() else "towards"
        why = f"by its name; taken as {said!r}, as is usual at sea"
        turn = _unit_of(state, angles[0], "beta_w")
        state.suggest("beta_w", angles[0], turn, 0.5, why, direction=said, wrap=True)
