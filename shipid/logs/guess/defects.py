"""Defects of a log whose columns are known: defects of rows, and contradictions of position, heading and velocity."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import FIRST_DATED_TIME, Array, Dataset
from shipid.errors import DataError
from shipid.identification.diagnosis import NONE, Diagnosis, diagnose
from shipid.logs.dates import LAST_DATE, format_date
from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State, unit_in_name
from shipid.logs.guess.evidence import Complex
from shipid.logs.guess.sniff import LogTable
from shipid.logs.mapping import source_columns, to_si

POSITIONS = ("latitude", "longitude", "north", "east")
SPIKY = ("speed", "course", "u", "v", "r", "psi", "phi", "theta", "V_w")
OF_POSITIONS = {"kind": "despike", "columns": ["north", "east"], "window": 10.0, "threshold": 10.0, "unit": "m"}
FEW = 4  # times that a sentence names
OFFSET = 0.02  # rad: less is no finding
SIGNALS_LATE = {
    "position": ("position", "velocity"),
    "velocity": ("velocity", "position"),
    "psi": ("heading", "yaw rate"),
    "r": ("yaw rate", "heading"),
}
"""Signal of a diagnosis -> its name, and that of the signal that is late where it is early."""
TURNED = np.radians(0.5)  # of a track against velocities, at least
CLEAR = 0.008  # rad: standard error of a heading that is off, at most
ONE_WAY = 0.9  # length of the mean of all directions, at most, of a ship on many courses
FILLS = (0.0, 90.0, -90.0, 180.0, -180.0)  # deg: what receivers write without a fix
NO_PLACE, FAR_STEPS = 0.01, 20.0  # deg, and usual steps, by which rows about it are away from it, at least
LOST = 0.5  # share of the rows without a fix, at most
STEPS_ABOUT = 5  # steps before and after a row, at least, whose median is usual there
NOTHING, OFTEN = 0.3, 20.0  # share of the rows that are 0 for no value, at most; s of a speed that count as a spike
TURN_SHOWS, SEVERAL = np.radians(3.0), 40  # of the heading in a window in which the ship turns; windows at least
IDENTICAL, EQUAL, ROUND = 0.9, np.radians(0.01), np.radians(1.0)  # share of rows; apart; largest step of a column
NO_HEADING = 0.4  # confidence of a heading that is a course
HALF, AWAY = 0.5, 18.0  # share of the usual speed, and parts of a turn, by which the rows around are away from 0


def defects_of_rows(state: State, sniffed: LogTable) -> None:
    """Report holes, missing values, and a log that was interpolated."""
    sources = [column.source for column in state.suggestions if column.name in ("north", "east", "latitude", "u", "r")]
    moving = [name for name in sources if np.ptp(state.columns[name]) > 0]
    if moving:
        share = float(np.median([evidence.interpolated_share(state.columns[name]) for name in moving]))
        if share > 0.2:
            state.find(
                "interpolated from a slower log",
                tuple(moving),
                0.9,
                f"{100 * share:.0f} % of the rows lie exactly between their neighbours: a slower log was interpolated",
            )
    steps = np.diff(sniffed.t)
    holes = int(np.sum(steps > evidence.GAP * np.median(steps)))
    holes = max(holes - sniffed.seams, 0)
    if holes:
        state.find(
            "holes in time",
            source_columns(sniffed.clock["from"]),
            0.99,
            f"{holes} steps are more than {evidence.GAP:g} times as long as the usual {np.median(steps):.3g} s",
        )
    missing = [name for name in sniffed.columns if np.isnan(sniffed.columns[name]).any()]
    if missing and not sniffed.scattered:  # no sentence says everything
        state.find(
            "missing values", tuple(missing), 0.99, f"some rows have no value in {', '.join(map(repr, missing))}"
        )


def defects_of_motion(state: State) -> None:
    """Report contradictions between position, heading, velocity and yaw rate."""
    course = _ask_if_course(state)
    if state.velocity is None or state.body is None:
        _report_position_jumps(state, _own_path(state))
    else:
        _report_position_jumps(state, _report_causes(state, () if course else ("psi", "r")))
    _report_heading_offset(state)


def _report_causes(state: State, turning: tuple[str, ...]) -> Complex:
    """Report what one cause explains of the contradictions, and a second beside it; the path (N,) [m] without them.

    turning : what may be late of heading and yaw rate.
    """
    assert state.velocity is not None
    path, found = evidence.integrate_rate(state.t, state.velocity), _diagnose_motion(state)
    while found is not None and found.cause != NONE:
        key, size = found.cause, [*found.size, 0.0]
        where, what = np.exp(1j * state.psi), key.removeprefix("sensor ").rpartition(" ")[0]
        if key == "lever arm position":
            path = np.asarray(path + complex(*size[:2]) * where)
            repair: dict[str, Any] = {"kind": "lever_arm", "x": round(size[0], 2), "y": round(size[1], 2)}
            words = f"{size[0]:+.1f} m forward and {size[1]:+.1f} m to starboard of the velocities'"
            _find_cause(state, "lever arm", f"positions are of a point {words}", found, repair | {"moves": "position"})
        elif key == "sensor r scale" and state.r is not None:
            sentence = f"the heading is {1 / size[0]:.4f} times the integral of the yaw rate"
            repair = {"kind": "scale", "columns": ["r"], "factor": round(1 / size[0], 4)}
            _find_cause(state, "factor", sentence, found, repair)
        elif key == "sensor psi bias":
            path = np.asarray(path * np.exp(-1j * size[0]))
            if abs(size[0]) > TURNED:
                _ask_about_north(state, -size[0], float(np.ptp(found.interval[0])) / 2)
        elif key == "velocity through water":
            flow = complex(*size[:2])
            words = f"a current of {abs(flow):.2g} m/s towards {np.degrees(np.angle(flow)) % 360.0:.0f} deg"
            sentence = f"positions and velocities part as in {words}: is the speed one through the water? "
            sentence += "Then take [estimate] in its place"
            _find_cause(state, "speed through water", sentence, found, None)
        elif key.endswith(" delay") and what in ("position", "velocity", *turning):
            late, other = SIGNALS_LATE[what][:: 1 if size[0] > 0 else -1]
            path = _late_path(state, path, {"position": size[0], "velocity": -size[0]}.get(what, 0.0))
            repair = {"kind": "latency", "signal": late, "seconds": round(abs(size[0]), 2)}
            sentence = f"{late} comes {abs(size[0]):.2g} s later than the {other} says"
            _find_cause(state, f"late {late}", sentence, found, repair)
        found = found.next
    return path


def _ask_about_north(state: State, angle: float, error: float) -> None:
    """Ask what is off where the track is turned by an angle [rad] against velocities over ground."""
    columns = {one.name: one for one in state.suggestions}
    name = "course" if "course" in columns else "psi"
    of = columns[name if name == "course" else "u"]
    remedy = f"write offset = {angle / to_si(columns[name].unit, 'psi'):.4g} ({columns[name].unit}) for {name}"
    what = "is the heading off, or the north of the positions another"
    if name == "course" or "frame" in of.extra:
        what = "is their north another than that of the positions, as that of a map or of a compass"
        remedy = "turn the positions, or these" if name == "psi" else f"{remedy}, and for psi, too, if it counts so"
    turned = f"the track is turned by {np.degrees(angle):+.1f} +- {np.degrees(error):.1f} deg against {of.source!r}"
    state.ask(("psi", "course", "u", "v"), f"{turned}: {what}? Then {remedy}")


def _late_path(state: State, path: Complex, seconds: float) -> Complex:
    """A path (N,) [m] late by so many seconds; beyond its ends as positions go, or they seem to jump."""
    instants = state.t - seconds
    late = np.interp(instants, state.t, path)
    known = np.flatnonzero((instants >= state.t[0]) & (instants <= state.t[-1]))[[0, -1]]
    for row, beyond in ((known[0], slice(None, known[0])), (known[1], slice(known[1], None))):
        late[beyond] = late[row] + state.position[beyond] - state.position[row]
    return np.asarray(late)


def _find_cause(state: State, kind: str, sentence: str, found: Diagnosis, repair: dict[str, Any] | None) -> None:
    share = f"{sentence} ({100 * found.share:.0f} % of the misfit)"
    state.find(kind, (), float(np.clip(found.share, 0.5, 0.95)), share, repair)


def _diagnose_motion(state: State) -> Diagnosis | None:
    """What is wrong with the motion of a log, by kinematics alone; None where its stretches are too short."""
    assert state.body is not None
    rate = np.gradient(state.psi, state.t) if state.r is None else state.r
    place, speed = state.position, state.body
    frame = pd.DataFrame({"t": state.t, "north": place.real, "east": place.imag, "psi": state.psi})
    frame = frame.assign(u=speed.real, v=speed.imag, r=rate, flags=0)
    holes = np.diff(state.t, prepend=state.t[0]) > evidence.GAP * np.median(np.diff(state.t))
    frame.insert(0, "run", np.char.add("part ", np.cumsum(holes).astype(str)).astype(object))
    try:
        return diagnose(None, Dataset(frame, {"clock": "run", "flags": []}))
    except DataError:
        return None


def _ask_if_course(state: State) -> bool:
    """Ask where the heading is a course, whose column has its values, or nearly so; whether it is."""
    place, heading = next((i, one) for i, one in enumerate(state.suggestions) if one.name == "psi")
    same = _same_as(state, heading.source)
    if same is None:
        return False
    seen = f"{heading.source!r} is {same[0]!r} in {100 * same[1]:.0f} % of the rows in which the ship turns"
    words = "is it the course over ground, and no heading? Then sway is not known, v is 0, and a heading is missing"
    state.ask(("psi", "u", "v", "speed", "course"), f"{seen}: {words}: name the column of a gyro or a compass")
    unsure = replace(heading, confidence=min(heading.confidence, NO_HEADING), evidence=f"{heading.evidence}; {seen}")
    state.suggestions[place] = unsure
    return True


def _same_as(state: State, heading: str) -> tuple[str, float] | None:
    """The column of a course that has the values of the heading where the ship turns, and in which share; else None."""
    turns = np.abs(state.chosen.change(state.psi).real) > TURN_SHOWS
    rows = ((state.chosen.first + state.chosen.last) // 2)[turns]
    if len(rows) < SEVERAL:
        return None
    units = {one.source: one.unit for one in state.suggestions}
    for name in state.all_called("course"):
        if name == heading:
            continue
        turn = to_si(units.get(name) or unit_in_name(name, "rad") or units[heading], "psi")
        apart = np.abs(np.angle(np.exp(1j * (state.psi[rows] - turn * state.columns[name][rows]))))
        rounded = max(_value_step(state.columns[name]) * turn, _value_step(state.columns[heading]) * turn)
        share = float(np.mean(apart <= 0.51 * min(rounded, ROUND) + EQUAL))
        if share >= IDENTICAL:
            return name, share
    return None


def _value_step(values: Array) -> float:
    steps = np.diff(np.unique(values))
    return float(steps.min()) if len(steps) else 0.0


def _jackknife_error(design: Array, values: Array, rows: NDArray[np.intp]) -> float:
    """Standard error of the first coefficient of a fit to some rows: the scatter without each of ten parts of them."""
    others = [np.setdiff1d(rows, part) for part in np.array_split(rows, 10)]
    without = [np.linalg.lstsq(design[kept], values[kept], rcond=None)[0][0] for kept in others]
    return float(np.std(without) * np.sqrt(len(without) - 1))


def _own_path(state: State) -> Complex:
    """Path (N,) [m] by the medians of the steps of the position about each row, where no velocities are logged."""
    steps = pd.Series(np.diff(state.t))
    rows = 2 * max(STEPS_ABOUT, round(0.5 * evidence.WINDOW / float(steps.median()))) + 1
    rates = np.diff(state.position) / steps.to_numpy()
    usual = [
        pd.Series(part).rolling(rows, center=True, min_periods=1).median().to_numpy()
        for part in (rates.real, rates.imag)
    ]
    return np.asarray(np.append(0j, np.cumsum((usual[0] + 1j * usual[1]) * steps.to_numpy())))


def _report_position_jumps(state: State, path: Complex) -> None:
    """Report where positions leave a path (N,) [m] and do not come back."""
    unit = to_si(state.clock_unit, "t")
    lost = [span for one in state.findings if one.kind == "no fix" and one.repair for span in one.repair["intervals"]]
    places = [
        place
        for place in evidence.position_jumps(state.t, state.position, path)
        if not any(unit * start <= place[1] and place[0] <= unit * end for start, end in lost)
    ]
    stay = [place for place in places if place[2] > 5.0]
    if stay:
        words = "the position jumps and does not come back"
        report_breaks(state, "position jumps", (), words, stay, "m")


def _report_heading_offset(state: State) -> None:
    angle, error, current = _off_on_all_courses(state)
    if error < CLEAR and np.pi / 4 > abs(angle) > max(OFFSET, 3 * error):  # of more it is a drift, or another zero
        why = f"on all courses the way leaves the heading by {np.degrees(angle):+.1f} deg (+- {np.degrees(error):.1f})"
        why += f", beside a steady current of {abs(current):.2g} m/s: heading off, positions in turned axes, or wind"
        repair = {"kind": "heading_offset", "offset": round(angle, 4), "unit": "rad"}
        state.find("heading offset", ("psi",), 0.6, why, repair)


def _off_on_all_courses(state: State) -> tuple[float, float, complex]:
    """How far the heading is off [rad], its standard error, and a steady current, north + i east [m/s].

    Over each window: way across the heading = tan(off) * (way along it) + arm * (turn) + (current across).
    """
    span = state.t[state.chosen.last] - state.t[state.chosen.first]
    psi = state.chosen.change(evidence.integrate_rate(state.t, state.psi)).real / span
    north = np.exp(-1j * psi)
    if state.body is None:
        ran = state.chosen.change(state.position) / span * north
    else:
        ran = state.chosen.change(evidence.integrate_rate(state.t, state.body)) / span
    ran = -ran if state.astern else ran
    columns = (ran.real, state.chosen.change(state.psi).real / span, north.imag, north.real)
    design = np.stack(columns, axis=1)
    keep = np.abs(ran) > 0.3 * np.percentile(np.abs(ran), 90)
    for _ in range(2):
        if keep.sum() < 40 or abs(complex(np.mean(north[keep]))) > ONE_WAY:  # across one course a current is no less
            return 0.0, np.inf, 0j
        found = np.linalg.lstsq(design[keep], ran.imag[keep], rcond=None)[0]
        miss = np.abs(ran.imag - design @ found)
        keep &= miss <= 6.0 * np.median(miss[keep]) + 1e-9
    error = _jackknife_error(design, ran.imag, np.flatnonzero(keep))
    off = float(np.arctan(found[0]))
    return off, error, complex(found[2], found[3]) * np.cos(off) * np.exp(1j * off)


def report_breaks(
    state: State, kind: str, columns: tuple[str, ...], words: str, places: list[tuple[float, float, float]], unit: str
) -> None:
    """Report stretches (start [s], end [s], size) that are wrong; the repair breaks the run there.

    Rows of several files have no clock in common, and no repair.
    """
    spans = [f"{clock_text(state, a)} to {clock_text(state, b)} ({size:.0f} {unit})" for a, b, size in places]
    first = ", ".join(spans[:FEW]) + f" and {len(spans) - FEW} more" * (len(spans) > FEW)
    where = f"in {len(places)} stretches of the files: `data check` shows where" if state.joined else first
    state.find(kind, columns, 0.9, f"{words}: {where}", break_repair(state, [place[:2] for place in places]))


def break_repair(state: State, spans: Iterable[tuple[float, float]]) -> dict[str, Any] | None:
    """The repair that breaks a run in stretches (start, end) [s]; none where the rows are of several files."""
    unit = to_si(state.clock_unit, "t")
    return (
        None if state.joined else {"kind": "break", "intervals": [[start / unit, end / unit] for start, end in spans]}
    )


def clock_text(state: State, t: float) -> str:
    """A time [s] as the clock of the log has it: a date, or a number."""
    return format_date(t) if FIRST_DATED_TIME < t < LAST_DATE else f"t = {t / to_si(state.clock_unit, 't'):.10g}"


def places_in_words(state: State, t: Array, spans: NDArray[np.intp]) -> str:
    """Where the rows of spans (K, 2), first and end, at t (N,) [s] are: their number, and the first few times."""
    count, several = int(np.sum(spans[:, 1] - spans[:, 0])), len(spans) > 1
    words = f"in {count} row{'s' * (count > 1)} at {len(spans)} place{'s' * several}"
    times = ", ".join(clock_text(state, float(t[first])) for first, _ in spans[:FEW])
    return f"{words} of the files" if state.joined else f"{words}, {'the first ' * (len(spans) > FEW)}near {times}"


def take_lost_fixes(state: State) -> None:
    """Interpolate, in place, positions that receivers write without a fix, such as 0 N, far from those about them."""
    for names in [(a, b) for a in state.called("latitude") for b in state.called("longitude") if a != b][:1]:
        lost = {name: lost_fixes(state.columns[name]) for name in names}
        if 0 < np.mean(lost[names[0]] | lost[names[1]]) < LOST:
            for name in (name for name in names if lost[name].any()):
                fills = " or ".join(f"{value:g}" for value in np.unique(state.columns[name][lost[name]]))
                _take_out(
                    state, name, lost[name], "no fix", fills, "the receiver had no fix", ("latitude", "longitude")
                )


def _take_out(
    state: State, name: str, rows: NDArray[np.bool_], kind: str, fills: str, why: str, about: tuple[str, ...]
) -> None:
    """Interpolate rows (N,) of a column that hold no value, and report them; the repair breaks the run there."""
    t, step = state.t, float(np.median(np.diff(state.t)))
    spans = evidence.row_spans(rows)
    state.columns[name] = np.interp(t, t[~rows], state.columns[name][~rows])
    sentence = f"{name!r} is {fills} {places_in_words(state, t, spans)}: {why}"
    if state.joined:
        state.ask(about, f"{sentence}. Leave these cells empty, and draft again")
    around = np.concatenate([[t[0] - step], t, [t[-1] + step]])
    state.find(kind, (name,), 0.95, sentence, break_repair(state, [(around[a], around[b + 1]) for a, b in spans]))


def lost_fixes(values: Array) -> NDArray[np.bool_]:
    """Rows (N,) of a latitude or longitude [deg] of exactly 0, 90 or 180 that is far from the rows before and after."""
    lost = np.zeros(len(values), dtype=bool)
    for value in FILLS:
        hit = values == value
        if not hit.any() or hit.all():
            continue
        steps = np.abs(np.diff(values[~hit]))
        least = max(NO_PLACE, FAR_STEPS * float(np.percentile(steps, 99))) if len(steps) else NO_PLACE
        for first, end in evidence.row_spans(hit):
            about = [values[row] - value for row in (first - 1, end) if 0 <= row < len(values)]
            lost[first:end] |= min(map(abs, about)) > least and (about[0] > 0) == (about[-1] > 0)
    return lost


def take_zeros(state: State) -> None:
    """Interpolate, in place, a speed or heading of 0 between rows far from it: no ship stops or turns in one row."""
    t, step = state.t, float(np.median(np.diff(state.t)))
    speeds = [*state.called("speed"), *state.called("u")]
    for name in dict.fromkeys([*speeds, *state.called("psi"), *state.called("course")]):
        values, known = state.columns[name], state.columns[name] != 0.0
        if step > 2.0 or not 0.0 < np.mean(~known) < NOTHING:
            continue
        turn = 360.0 if np.ptp(values) > 7.0 else 2 * np.pi
        size = np.abs(values if name in speeds else (values + turn / 2) % turn - turn / 2)
        least = HALF * float(np.percentile(size[known], 75)) if name in speeds else turn / AWAY
        edges = evidence.row_spans(~known)
        inside = [(a, b) for a, b in edges if a > 0 and b < len(t) and t[b] - t[a - 1] < (b - a + 2) * step]
        inside = [(a, b) for a, b in inside if min(size[a - 1], size[b]) > least]
        if not inside:
            continue
        rows = np.concatenate([np.arange(a, b) for a, b in inside])
        kept = np.ones(len(t), dtype=bool)
        kept[rows] = False
        smallest = float(min(min(size[a - 1], size[b]) for a, b in inside))
        most = OFTEN / step if name in speeds else 2
        if max(b - a for a, b in inside) <= most and name not in state.called("course"):
            state.columns[name] = np.interp(t, t[kept], values[kept])
            before, least = state.spikes.get(name, (rows, smallest))
            state.spikes[name] = np.union1d(rows, before), min(smallest, least)
            continue
        why = "between values far from it, it was written for no value"
        _take_out(state, name, ~kept, "zeros", "0", why, ("u", "v", "psi", "speed", "course"))


def take_spikes(t: Array, columns: dict[str, Array]) -> dict[str, tuple[NDArray[np.intp], float]]:
    """Interpolate spikes of columns (N,) in place; column -> their rows, and the least of their sizes."""
    found: dict[str, tuple[NDArray[np.intp], float]] = {}
    for name, values in columns.items():
        wild = evidence.spike_rows(values)
        if wild.any():
            healed = np.interp(t, t[~wild], values[~wild])
            found[name] = np.flatnonzero(wild), float(np.abs(values - healed)[wild].min())
            columns[name] = healed
    return found


def defects_of_spikes(state: State) -> None:
    """Report spikes of what was measured, with the repair; an order that is given for a moment is none."""
    step, rows = float(np.median(np.diff(state.t))), np.arange(len(state.t))
    places = [
        state.spikes[one.source][0] for one in state.suggestions if one.name in POSITIONS if one.source in state.spikes
    ]
    if places:
        where = places_in_words(state, state.t, evidence.row_spans(np.isin(rows, np.concatenate(places))))
        state.find("position spikes", (), 0.9, f"the position leaves and comes back {where}", OF_POSITIONS)
    for one in state.suggestions:
        if one.name in SPIKY and one.source in state.spikes:
            wild, size = state.spikes[one.source]
            spans = evidence.row_spans(np.isin(rows, wild))
            least = f"{size:.3g} {one.unit}{' or more' * (len(wild) > 1)}"
            sentence = (
                f"{one.source!r} leaves its course by {least} and comes back {places_in_words(state, state.t, spans)}"
            )
            width = max(5, 2 * int(np.max(spans[:, 1] - spans[:, 0])) + 3) * step
            repair = {"kind": "despike", "columns": [one.name], "window": round(max(width, 1e-3), 3)}
            threshold = float(f"{size / 2:.2g}")
            state.find("spikes", (one.source,), 0.9, sentence, repair | {"threshold": threshold, "unit": one.unit})
