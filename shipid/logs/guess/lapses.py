"""Rows that hold no value: spikes, fills between rows far from them, sensors that are stuck."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipid.data.checks import stuck_spans
from shipid.data.dataset import FIRST_DATED_TIME, Array
from shipid.logs.dates import LAST_DATE, format_date
from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State
from shipid.logs.mapping import to_si

POSITIONS = ("latitude", "longitude", "north", "east")
SPIKY = ("speed", "course", "u", "v", "r", "psi", "phi", "theta", "V_w")
OF_POSITIONS = {"kind": "despike", "columns": ["north", "east"], "window": 10.0, "threshold": 10.0, "unit": "m"}
FEW = 4  # times that a sentence names
FILLS = (0.0, 90.0, -90.0, 180.0, -180.0)  # deg: what receivers write without a fix
NOTHING = (0.0, -1.0)  # what is written for no speed and no direction
NO_PLACE, HALF, AWAY = 0.01, 0.5, 18.0  # deg, share of a usual speed, part of a turn: rows about a fill are farther
MOST_FILLS, BRIEF, SLOWEST_ROWS = 0.5, 20.0, 2.0  # share of the rows; s: of a speed that is a spike; from row to row
SURE = 0.9  # that it is no value
Spans = Sequence[tuple[int, int]] | NDArray[np.intp]
"""First row of each stretch, and the row after its last."""


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


def take_fills(state: State) -> None:
    """Interpolate, in place, what is written for no value: a position of 0 N without a fix, a speed or heading of 0.

    Rows before and after are far from it, as no ship stops or turns in one row. Short ones of a speed or a heading
    count as spikes.
    """
    t, step = state.t, evidence.usual_step(state.t)
    places = [name for meaning in ("latitude", "longitude") for name in state.called(meaning)[:1]]
    speeds, courses = [*state.called("speed"), *state.called("u")], state.called("course")
    for name in dict.fromkeys([*places, *speeds, *state.called("psi"), *courses]):
        values, place = state.columns[name], name in places
        turn = np.inf if name in (*places, *speeds) else 360.0 if np.ptp(values) > 7.0 else 2 * np.pi
        least = (
            NO_PLACE if place else HALF * float(np.percentile(np.abs(values), 75)) if name in speeds else turn / AWAY
        )
        spans = [
            (int(a), int(b))
            for fill in (FILLS if place else NOTHING)
            for a, b in evidence.row_spans(values == fill)
            if all(min(off := abs(values[row] - fill), turn - off) > least for row in (a - 1, b) if 0 <= row < len(t))
            and (place or (step <= SLOWEST_ROWS and a > 0 and b < len(t) and t[b] - t[a - 1] < (b - a + 2) * step))
        ]
        rows = np.isin(np.arange(len(t)), [row for a, b in spans for row in range(a, b)])
        if not 0.0 < rows.mean() < MOST_FILLS:
            continue
        fills, size = np.unique(values[rows]), np.abs(values - np.interp(t, t[~rows], values[~rows]))[rows]
        state.columns[name] = np.interp(t, t[~rows], values[~rows])
        if name in (*places, *courses) or max(b - a for a, b in spans) > (BRIEF / step if name in speeds else 2):
            kind, why = ("no fix", "the receiver had no fix") if place else ("zeros", "it was written for no value")
            said = f"is {' or '.join(f'{one:g}' for one in fills)} {{}}, far from the rows about: {why}."
            _report(state, (kind, said), name, t, spans, ("u", "v", "psi", "speed", "course", *POSITIONS))
        else:
            before, least = state.spikes.get(name, (np.flatnonzero(rows), np.inf))
            state.spikes[name] = np.union1d(np.flatnonzero(rows), before), min(least, float(size.min()))


def report_stuck_sensors(state: State) -> None:
    """Report a heading, yaw rate, course or speed that repeats one value for long while the ship moves otherwise."""
    t, follows = state.t, np.diff(state.t) <= evidence.GAP * evidence.usual_step(state.t)
    over_ground = np.zeros(len(t), dtype=np.complex128) if state.velocity is None else state.velocity
    rates = 0.0 * t if state.r is None else state.r, over_ground
    for one in (one for one in state.suggestions if one.name in ("psi", "r", "course", "speed")):
        spans = stuck_spans(one.name, t, state.columns[one.source], (state.psi, state.position), rates, follows)
        if spans:  # a jump that follows may be taken for one across 360
            rows = [(first + 1, min(last + 2, len(t))) for first, last in spans]
            fault = "frozen sensor", "repeats one value while the ship moves otherwise {}."
            _report(state, fault, one.source, t, rows, (one.name,))


def report_spikes(state: State) -> None:
    """Report spikes of what was measured, with the repair; an order that is given for a moment is none."""
    step, rows = evidence.usual_step(state.t), np.arange(len(state.t))
    spiky = {one.name: one for one in state.suggestions if one.source in state.spikes}
    places = [state.spikes[spiky[name].source][0] for name in POSITIONS if name in spiky]
    if places:
        where = places_in_words(state, state.t, evidence.row_spans(np.isin(rows, np.concatenate(places))))
        state.find("position spikes", (), SURE, f"the position leaves and comes back {where}", OF_POSITIONS)
    for name, one in ((name, one) for name, one in spiky.items() if name in SPIKY):
        wild, size = state.spikes[one.source]
        spans = evidence.row_spans(np.isin(rows, wild))
        where = places_in_words(state, state.t, spans)
        least = f"{size:.3g} {one.unit}{' or more' * (len(wild) > 1)}"
        width = max(5, 2 * int(np.max(spans[:, 1] - spans[:, 0])) + 3) * step
        repair = {"kind": "despike", "columns": [name], "window": round(max(width, 1e-3), 3), "unit": one.unit}
        sentence = f"{one.source!r} leaves its course by {least} and comes back {where}"
        state.find("spikes", (one.source,), SURE, sentence, repair | {"threshold": float(f"{size / 2:.2g}")})


def _report(state: State, fault: tuple[str, str], name: str, t: Array, spans: Spans, about: tuple[str, ...]) -> None:
    """Report rows at t (N,) [s] of a column that hold no value; the repair breaks the run there.

    It is asked of rows of several files, which have no clock in common.
    """
    kind, words = fault
    sentence = f"{name!r} {words.format(places_in_words(state, t, spans))}"
    if state.joined:
        state.ask(about, f"{sentence} Unless it was so, leave these cells empty, and draft again")
    state.find(kind, (name,), SURE, sentence, break_repair(state, t, spans))


def break_repair(state: State, t: Array, spans: Spans) -> dict[str, Any] | None:
    """The repair that breaks a run in stretches of rows at t (N,) [s]; none where the rows are of several files."""
    unit, step = to_si(state.clock_unit, "t"), evidence.usual_step(t)
    around = np.concatenate([[t[0] - step], t, [t[-1] + step]]) / unit
    intervals = [[float(around[a]), float(around[b + 1])] for a, b in spans]
    return None if state.joined else {"kind": "break", "intervals": intervals}


def clock_text(state: State, t: float) -> str:
    """A time [s] as the clock of the log has it: a date, or a number."""
    return format_date(t) if FIRST_DATED_TIME < t < LAST_DATE else f"t = {t / to_si(state.clock_unit, 't'):.10g}"


def places_in_words(state: State, t: Array, spans: Spans) -> str:
    """Where the rows of spans, at t (N,) [s], are: their number, and the first few times."""
    count, several = int(sum(b - a for a, b in spans)), len(spans) > 1
    words = f"in {count} row{'s' * (count > 1)} at {len(spans)} place{'s' * several}"
    times = ", ".join(clock_text(state, float(t[first])) for first, _ in spans[:FEW])
    return f"{words} of the files" if state.joined else f"{words}, {'the first ' * (len(spans) > FEW)}near {times}"
