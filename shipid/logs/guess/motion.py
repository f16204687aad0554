"""Draft the motion that the search finds: position, heading, velocities, yaw rate, what is odd and what is asked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from shipid.logs.guess import evidence
from shipid.logs.guess.clues import LIKELY, STRONG, State, si_unit
from shipid.logs.guess.evidence import Fit
from shipid.logs.guess.scales import KNOTS, TURNS, set_scale
from shipid.logs.guess.search import (
    PLAIN,
    WAYS,
    Axes,
    Frame,
    MotionReading,
    Sense,
    Velocity,
    length_unit,
    local_plane,
    search_motion,
)
from shipid.logs.guess.settings import SETTINGS
from shipid.logs.guess.words import is_magnetic, may_be_measured, meaning_scores, unit_in_name
from shipid.logs.mapping import UNITS, to_si
from shipid.physics.signals import signal_of
from shipid.units import GRAVITY

FASTEST, HARDEST, SLOWEST = 100.0, 20.0, 0.02  # m/s, m/s^2, m/s: no ship goes or turns harder, no trial is slower
FROUDE = 4.0  # U / sqrt(g L): nothing that is steered in trials is faster for its length
FAR = 2.0  # a factor that no sensor has


def choose_motion(state: State, file: Path, frame: Frame | None = None) -> None:
    """Choose position, heading, velocities and yaw rate, in the frame of the log where it is known.

    Raises DataError if no column can be position or heading, or if the ship does not move as in that frame.
    """
    motions = search_motion(state, file, frame)
    best = motions[0]
    _ask_about_names(state, best)
    _ask_about_rivals(state, motions)
    _take_pose(state, best)
    if best.velocity is not None:
        _take_velocities(state, best, best.velocity)
    _take_rate(state, best)
    _ask_about_axes(state, best)


# --- position and heading ---


def _take_pose(state: State, best: MotionReading) -> None:
    pose, axes = best.pose, best.axes
    place, sense = pose.place, best.axes.sense(pose.sense)
    plane = axes.place(local_plane(state, place.first, place.second, place.on_globe))
    sources = (place.second, place.first) if axes.swap else (place.first, place.second)
    for source, sign in zip(sources, (axes.north, axes.east), strict=True):
        if sign < 0:
            state.negate(source)
    length = "deg" if place.on_globe else length_unit(*sources)
    sure = 0.99 * (1.0 - min(0.5, 5.0 * pose.misfit**2))
    why = f"course over ground keeps to the heading (agreement {1.0 - pose.misfit:.3f} of 1)"
    for name, source in zip(("latitude", "longitude") if place.on_globe else ("north", "east"), sources, strict=True):
        state.suggest(name, source, length, sure, why)
    state.position = plane
    _report_axes(state, best, sources, sense)
    named = meaning_scores(pose.heading)
    if named.get("psi", 0.0) <= named.get("course", 0.0):
        sure = sure if state.numbered else min(sure, 0.5)
        if best.velocity is None if state.numbered else pose.heading in state.all_called("psi"):
            words = f"is {pose.heading!r} the heading, or the course over ground? Its name does not say which"
            state.ask(("psi",), words)
    if pose.turn in TURNS:
        what = f"a whole turn is {pose.turn:g}: {TURNS[pose.turn]}, with which it keeps to the track"
        set_scale(state, pose.heading, 360.0 / pose.turn, what)
    angle, false = evidence.heal_angle(state.columns[pose.heading], 2 * np.pi / to_si(pose.unit, "psi"), state.t)
    if false.any():
        across = "360" if pose.unit == "deg" else "2 pi"
        sentence = f"{int(false.sum())} steps of {pose.heading!r} lie between two headings across {across}"
        repair = {"kind": "wrap_interpolation", "columns": ["psi"], "threshold": 20.0, "unit": "deg"}
        state.find("interpolation across 360", (pose.heading,), 0.98, sentence, repair)
    why = f"{why}; in {pose.unit} rather than another unit"
    state.suggest("psi", pose.heading, pose.unit, sure, why, **_keys_of_sense(sense, pose.unit))
    state.psi = sense.direction(angle * to_si(pose.unit, "psi"))


def _keys_of_sense(sense: Sense, unit: str) -> dict[str, Any]:
    """Keys of a column in `unit` that counts in this sense."""
    zero = {"offset": round(sense.quarter * np.pi / 2 / to_si(unit, "psi"), 9)} if sense.quarter else {}
    return {"wrap": True} | ({"sign": -1} if sense.sign < 0 else {}) | zero


def _report_axes(state: State, best: MotionReading, sources: tuple[str, str], sense: Sense) -> None:
    """Note axes and a heading that count otherwise than usual, and ask where another reading is nearly as likely."""
    pose, axes = best.pose, best.axes
    agreement = 1.0 - pose.misfit
    if sense.quarter == 2 and sense.sign > 0:
        said = f"does the ship go astern, or has {pose.heading!r} another zero? If it goes astern, take the offset out"
        state.ask(("psi", "u", "v"), f"course and heading differ by about 180 deg: {said}")
    if (axes != Axes() or sense != Sense()) and not best.settled.startswith("--"):
        shown = f", as {best.settled!r} shows" if best.settled else ""
        words = f"course and heading agree with {_reading_in_words(best, axes)}{shown}"
        state.find("frame", (*sources, pose.heading), agreement, words)


def _ask_about_axes(state: State, best: MotionReading) -> None:
    """Ask where other axes are nearly as likely, and name all that turns with them."""
    place, axes = best.pose.place, best.axes
    rivals = (Axes(),) * (axes != Axes()) if place.on_globe else best.rivals
    if not rivals:
        return
    mirror = any(axes.hand != one.hand for one in rivals)
    turned = [one for one in state.suggestions if one.source not in (place.first, place.second, best.pose.heading)]
    turned = [one for one in turned if one.name == "course" or "frame" in one.extra or (mirror and one.name in "vr")]
    about = (*(one.name for one in turned), *("delta", "alpha") * mirror)
    also = ", ".join([*(repr(one.source) for one in turned), *["all that steers"] * mirror])
    sides = "; port and starboard change places" * mirror + f"; with it turn {also}" * bool(also)
    if place.on_globe:
        ways = zip((place.first, place.second), _ways(axes), strict=True)
        said = " and ".join(f"{name!r} to {way}" for name, way in ways)
        words = f"does the log count {said}? Else {best.pose.heading!r} counts otherwise{sides}"
        state.ask(("latitude", "longitude", "psi", *about), words)
    else:
        said = ", or ".join([f"is {_reading_in_words(best, axes)}", *(_reading_in_words(best, one) for one in rivals)])
        words = f"{said}? The motion is the same in all{sides}: answer with --frame ned, enu, zup or ros"
        state.ask(("psi", "north", "east", *about), words)


def _ways(axes: Axes) -> list[str]:
    """To where the first and the second axis point."""
    ways = [WAYS[0 if axes.north > 0 else 2], WAYS[1 if axes.east > 0 else 3]]
    return ways[::-1] if axes.swap else ways


def _reading_in_words(best: MotionReading, axes: Axes) -> str:
    place, sense, ways = best.pose.place, axes.sense(best.pose.sense), _ways(axes)
    side = "starboard" if sense.sign > 0 else "port"
    counts = f"{best.pose.heading!r} counted to {side} from {WAYS[sense.quarter % 4]}"
    return f"{place.first!r} to {ways[0]}, {place.second!r} to {ways[1]}, {counts}"


def _ask_about_names(state: State, best: MotionReading) -> None:
    """Ask about what names say of position and heading: a magnetic compass, set points, no agreement."""
    pose = best.pose
    first, second = pose.place.first, pose.place.second
    state.ask_for_unit("psi", pose.heading, pose.unit)
    if is_magnetic(pose.heading):
        words = f"{pose.heading!r} is of a magnetic compass: where are its variation and deviation taken out?"
        state.ask(("psi", "v"), f"{words} A `heading_offset` is one for all courses")
    shown = (
        best.velocity is not None and best.velocity.fit.left < SETTINGS.left
    )  # a ship that drifts keeps to no heading
    if pose.misfit > SETTINGS.poor and not shown and not state.numbered:
        words = f"course and heading agree badly (misfit {pose.misfit:.2f}): are {first!r}, {second!r} the position"
        state.ask(("psi", "north", "east", "u", "v", "r"), f"{words} and {pose.heading!r} the heading?")
    references = [name for name in (first, second, pose.heading) if may_be_measured(name)]
    if references:
        words = f"is {', '.join(map(repr, references))} measured, or a set point? By the name it may be either"
        state.ask(("psi", "north", "east", "latitude", "longitude"), words)


def _ask_about_rivals(state: State, motions: list[MotionReading]) -> None:
    """Ask where another column may be the heading nearly as well."""
    best, heading = motions[0], motions[0].pose.heading
    found = best.velocity
    others = [one for one in motions[1:] if one.pose.heading != heading and one.cost < best.cost + SETTINGS.close]
    other = found.second if found is not None and found.kind == "course" and found.unsure else ""
    other = others[0].pose.heading if others and state.numbered else other
    if other:
        words = f"is {heading!r} the heading and {other!r} the course, or are they exchanged? No ship drifts into its"
        about = ("psi", "north", "east", "u", "v", "r", "speed", "course")
        state.ask(about, f"{words} turns; a run in a known current, or the column of a gyro, tells")


# --- velocities ---


def _take_velocities(state: State, best: MotionReading, found: Velocity) -> None:
    axes, fit = best.axes, found.fit
    first, second = found.first, found.second
    sources = (first,) if found.kind == "course" else (first, second)
    unit, part = _unit_of_speed(state, fit, sources, found.kind == "course")
    factor = to_si(unit, "u") * part
    if part != 1.0:
        set_scale(state, first, part, f"whole numbers of {KNOTS[part]}")
    ground = axes.place(found.ground) * factor
    heading = np.exp(1j * state.psi)
    confidence = 0.99 * (1 - min(0.5, fit.left))
    if found.named < found.sure and not state.numbered:
        confidence = min(confidence, 0.59)
    leaves = f"leaves {100 * fit.left:.2g} % of the track unexplained"
    if found.kind == "course":
        turned = "rad" if found.turn < 7.0 else "deg"
        why = f"along the course [{turned}] it {leaves}"
        if found.turn in TURNS:
            set_scale(state, second, 360.0 / found.turn, f"a whole turn is {found.turn:g}: {TURNS[found.turn]}")
        if confidence < LIKELY:
            words = f"is {first!r} the speed over ground, not through the water, and {second!r} the course?"
            state.ask(("speed", "course"), f"{words} Not both names say so")
        state.suggest("speed", first, unit, min(0.9, confidence), why)
        sense = _keys_of_sense(axes.sense(found.sense), turned)
        state.suggest("course", second, turned, min(0.9, confidence), why, **sense)
    else:
        why = f"integrated as {found.kind}-fixed [{unit}] it {leaves}"
        _suggest_two(state, best, found, unit, confidence, why)
    state.velocity, state.body = ground, np.asarray(ground / heading)
    seen, ran = (state.chosen.change(one) for one in (state.position, evidence.integrate_rate(state.t, ground)))
    fit = evidence.fit_without_outliers(seen, ran * np.exp(1j * np.angle(np.vdot(ran, seen))))  # a turn is no factor
    _report_factor(state, fit, sources, unit, ("speed",) if found.kind == "course" else ("u", "v"))


def _suggest_two(state: State, best: MotionReading, found: Velocity, unit: str, confidence: float, why: str) -> None:
    """Suggest two columns as u and v: of the axes of the log, or of the ship."""
    first, second, axes = found.first, found.second, best.axes
    if found.kind == "earth":
        signs = (axes.north, axes.east * found.side) if not axes.swap else (axes.north * found.side, axes.east)
        pair = (second, first) if axes.swap else (first, second)
        for name, source, sign in zip(("u", "v"), pair, signs, strict=True):
            state.suggest(name, source, unit, confidence, why, frame="earth", **({"sign": -1} if sign < 0 else {}))
        return
    sign = found.side * axes.hand
    if found.unsure:
        words = (
            f"is {second!r} positive to {'starboard' if sign > 0 else 'port'}? It is drafted so that the ship drifts"
        )
        state.ask(("v",), f"{words} out of its turns, as ships do near midships; the track does not settle it")
    state.suggest("u", first, unit, confidence, why)
    state.suggest("v", second, unit, confidence, why, **({"sign": -1} if sign < 0 else {}))


def _unit_of_speed(state: State, fit: Fit, sources: tuple[str, ...], quiet: bool) -> tuple[str, float]:
    """The likeliest unit by the scale and the name, and the part of it that is counted."""
    name = sources[0]
    written = unit_in_name(name, "m/s")
    whole = quiet and float(np.mean(state.columns[name] % 1 == 0)) > 0.1
    costs: dict[tuple[str, float], float] = {}
    for unit, factor in UNITS["m/s"].items():
        for part in (1.0, *KNOTS) if unit == "kn" and whole else (1.0,):
            usual = SETTINGS.usual_unit * (unit != "m/s") if unit in PLAIN else SETTINGS.odd
            cost = (0.0 if written == unit else SETTINGS.odd + 2.0) if written else usual
            off = np.log(fit.scale / (factor * part)) / SETTINGS.off_unit
            costs[unit, part] = float(cost + SETTINGS.usual_unit * (part != 1.0) + off**2 / 2)
    best = min(costs, key=costs.__getitem__)
    if costs[best] > 20.0:  # a factor of no unit
        return written or ("kn" if name in state.scaled else "m/s"), 1.0
    return best


def _report_factor(state: State, fit: Fit, sources: tuple[str, ...], unit: str, columns: tuple[str, ...]) -> None:
    """Report a factor of the speeds that remains beside their unit."""
    pair = " and ".join(repr(source) for source in sources)
    begins = f"the track is {fit.scale:.4g} times the integral of {pair} in {unit}"
    if not 1 / FAR <= fit.scale <= FAR:
        if not any("t" in one.about for one in state.questions):
            words = "the unit of the clock, of the positions or of the speeds is another one"
            state.find("factor", sources, 0.6, f"{begins}: {words}")
            state.ask(("t", *columns), f"are the units of the clock, of the positions and of {pair} right? {begins}")
        return
    off = abs(fit.scale - 1.0)
    if np.isfinite(fit.error) and off > max(3 * fit.error, 0.004):
        sure = float(np.clip(off / (5 * fit.error + 1e-9), 0.2, 0.9))
        repair = {"kind": "scale", "columns": list(columns), "factor": round(fit.scale, 4)}
        state.find("factor", sources, sure, f"{begins} (+- {fit.error:.2g})", repair)


# --- yaw rate and clock ---


def _take_rate(state: State, best: MotionReading) -> None:
    found, called = best.rate, state.all_called("r")
    if found is None:
        free = [name for name in called if name in state.free()]
        if free and float(np.std(state.chosen.change(state.psi))) < np.radians(0.5):
            unit = unit_in_name(free[0], "rad/s") or "deg/s"
            state.suggest("r", free[0], unit, 0.4, "by its name; the ship turns too little to see unit and sign")
        elif free and not state.numbered:
            words = f"{free[0]!r} is named as a yaw rate, but its integral is not the heading: it is not used"
            state.find("yaw rate does not fit", (free[0],), 0.6, words)
        return
    name, unit, fit = found.name, found.unit, found.fit
    sign = (1 if fit.scale > 0 else -1) * best.axes.hand
    confidence = 0.99 * (1 - min(0.5, fit.left))
    why = f"integrated in {unit} it leaves {100 * fit.left:.2g} % of the heading's change unexplained"
    state.suggest("r", name, unit, confidence, why, **({"sign": -1} if sign < 0 else {}))
    state.r = state.columns[name] * to_si(unit, "r") * sign


def check_clock(state: State, length: float = np.inf) -> None:
    """Ask for the unit of the clock where no ship goes so fast, or so slowly. length : of the ship [m], if known."""
    span = state.t[state.chosen.last] - state.t[state.chosen.first]
    speeds, rates = (np.abs(state.chosen.change(one)) / span for one in (state.position, state.psi))
    speed, across = (float(np.percentile(one, 90)) for one in (speeds, speeds * rates))
    possible = SLOWEST < speed < min(FASTEST, FROUDE * np.sqrt(GRAVITY * length)) and across < HARDEST
    if not possible and not any("t" in question.about for question in state.questions):
        words = f"by the drafted clock, in {state.clock_unit}, the ship goes {speed:.3g} m/s and turns at"
        words += f" {across:.3g} m/s^2: are the units of the clock and of the positions right?"
        state.ask(("t", "north", "east"), words)


def report_misnomers(state: State) -> None:
    """Report columns whose names say another quantity or unit than the motion does, or that count the other way."""
    for one in state.suggestions if not state.numbered else ():
        signal = signal_of(one.name)
        meaning = {"u": "velocity_north", "v": "velocity_east"}.get(signal, signal) if "frame" in one.extra else signal
        names = {meaning, *({"x", "y"} if meaning in ("north", "east") else ())}
        scores = meaning_scores(one.source)
        written = unit_in_name(one.source, si_unit(signal)) if signal != "psi" else None
        rare = signal in ("u", "v") or (signal == "speed" and one.unit not in PLAIN)
        usual = written or ("m/s" if rare else one.unit)
        if max(scores.get(name, 0.0) for name in names) < 0.45 and one.confidence > 0.5:
            state.find("other name", (one.source,), one.confidence, f"{one.source!r} is {one.name}: {one.evidence}")
            if signal in ("u", "v", "r") and max(scores.values(), default=0.0) >= STRONG:
                words = f"is {one.source!r} {one.name}? By its name it is another quantity, by the motion it is this"
                state.ask((signal,), words)
        if one.unit != usual and written != "%":
            says = f"its name says {written}" if written else "nothing says so"
            state.find("other unit", (one.source,), one.confidence, f"{one.source!r} is in {one.unit}, and {says}")
        if "sign" in one.extra and signal not in ("psi", "course", "north", "east", "latitude", "longitude"):
            words = f"{one.source!r} counts the other way than {one.name}: {one.evidence}"
            state.find("other sign", (one.source,), one.confidence, words)
