"""Defects of a log whose columns are known: defects of rows, and contradictions of position, heading and velocity."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from shipid import document
from shipid.data.dataset import Dataset
from shipid.errors import DataError
from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State
from shipid.logs.guess.evidence import Complex
from shipid.logs.guess.lapses import break_repair, places_in_words
from shipid.logs.guess.sniff import LogTable
from shipid.logs.mapping import source_columns, to_si

if TYPE_CHECKING:
    from shipid.identification.diagnosis import Diagnosis

CAUSES = {
    "lever arm position": "lever arm",
    "sensor r scale": "factor",
    "velocity through water": "speed through water",
    **dict.fromkeys((f"sensor {name} delay" for name in ("position", "velocity", "psi", "r")), "delay"),
}
"""Cause of a diagnosis -> kind of the finding."""
OTHER = {"position": "velocity", "velocity": "position", "heading": "yaw rate", "yaw rate": "heading"}
"""Signal that may be late -> the one that it is compared with."""
TURNED_TRACK = np.radians(0.5)  # of a track against velocities, at least
TURN_SHOWS, SEVERAL = np.radians(6.0), 40  # of the heading in a window in which the ship turns; windows at least
EQUAL, MOST = np.radians(0.52), 0.9  # drift of a heading in whole degrees that is the course; share of the windows
STEPS_ABOUT = 5  # steps before and after a row, at least, whose median is usual there


def defects_of_rows(state: State, sniffed: LogTable) -> None:
    """Report holes and missing values."""
    usual = evidence.usual_step(sniffed.t)
    holes = int(np.sum(np.diff(sniffed.t) > evidence.GAP * usual))
    holes = max(holes - sniffed.seams, 0)
    if holes:
        state.find(
            "holes in time",
            source_columns(sniffed.clock["from"]),
            0.99,
            f"{holes} steps are more than {evidence.GAP:g} times as long as the usual {usual:.3g} s",
        )
    missing = [name for name in sniffed.columns if np.isnan(sniffed.columns[name]).any()]
    if missing and not sniffed.scattered:  # no sentence says everything
        state.find(
            "missing values", tuple(missing), 0.99, f"some rows have no value in {', '.join(map(repr, missing))}"
        )


def defects_of_motion(state: State) -> None:
    """Report contradictions between position, heading, velocity and yaw rate, and positions that jump."""
    found = None
    if state.body is not None:
        found = _diagnose_motion(state)
        _ask_if_course(state, state.body)
    while found is not None:
        repair = document.parse_toml(found.repair).get("repair", [None])[0] if found.repair.startswith("[[") else None
        if repair is not None and repair.get("seconds", 0.0) < 0.0:  # the other one is late
            repair |= {"signal": OTHER[repair["signal"]], "seconds": -repair["seconds"]}
        if found.cause == "sensor psi bias" and abs(found.size[0]) > TURNED_TRACK:
            _ask_about_north(state, -found.size[0], float(np.ptp(found.interval[0])) / 2)
        elif found.cause in CAUSES:
            known = np.ptp(found.interval[0]) < abs(found.size[0])  # else half of it may be none
            sure = float(np.clip(found.share, 0.5, 0.95)) if known else 0.5
            state.find(CAUSES[found.cause], (), sure, found.sentence.partition("; ")[0], repair)
        found = found.next
    _report_position_jumps(state)


def _ask_if_course(state: State, body: Complex) -> None:
    """Ask where the course is the heading of a ship that turns, so that u + i v (N,) [m/s] has no drift."""
    turns = np.abs(state.chosen.change(state.psi).real) > TURN_SHOWS
    drift = np.angle(body[((state.chosen.first + state.chosen.last) // 2)[turns]])
    logged = any(one.name == "course" for one in state.suggestions)
    if logged and len(drift) >= SEVERAL and np.mean(np.abs(drift) < EQUAL) > MOST:
        words = "the ship does not drift as it turns: is the heading the course over ground? Then sway is not known, v"
        words += " is 0, and a heading is missing: name the column of a gyro or a compass"
        state.ask(("psi", "u", "v", "speed", "course"), words)


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


def _diagnose_motion(state: State) -> Diagnosis | None:
    """What is wrong with the motion of a log, by kinematics alone; None where its stretches are too short."""
    from shipid.identification.diagnosis import diagnose  # few logs have what it needs, and it takes its time

    assert state.body is not None
    rate = np.gradient(state.psi, state.t) if state.r is None else state.r
    place, speed = state.position, state.body
    frame = pd.DataFrame({"t": state.t, "north": place.real, "east": place.imag, "psi": state.psi})
    frame = frame.assign(u=speed.real, v=speed.imag, r=rate, flags=0)
    holes = np.diff(state.t, prepend=state.t[0]) > evidence.GAP * evidence.usual_step(state.t)
    frame.insert(0, "run", np.char.add("part ", np.cumsum(holes).astype(str)).astype(object))
    try:
        return diagnose(None, Dataset(frame, {"clock": "run", "flags": []}))
    except DataError:
        return None


def _report_position_jumps(state: State) -> None:
    """Report where positions leave the integral of the velocities, or of their own usual steps, for good."""
    t, steps = state.t, pd.Series(np.diff(state.t))
    if state.velocity is not None:
        path = evidence.integrate_rate(t, state.velocity)
    else:  # medians of the steps about each row
        rows = 2 * max(STEPS_ABOUT, round(0.5 * evidence.WINDOW / float(steps.median()))) + 1
        rates = np.diff(state.position) / steps.to_numpy()
        usual = [pd.Series(one).rolling(rows, center=True, min_periods=1).median() for one in (rates.real, rates.imag)]
        path = np.append(0j, np.cumsum((usual[0] + 1j * usual[1]) * steps))
    lost = [span for one in state.findings if one.kind == "no fix" and one.repair for span in one.repair["intervals"]]
    unit = to_si(state.clock_unit, "t")
    places = [
        (first + 1, last, size)
        for first, last, size in evidence.position_jumps(t, state.position, path)
        if size > 5.0 and not any(unit * start <= t[last] and t[first] <= unit * end for start, end in lost)
    ]
    if places:
        spans, most = [(a, b) for a, b, _ in places], max(size for *_, size in places)
        words = f"the position jumps by up to {most:.0f} m and does not come back {places_in_words(state, t, spans)}"
        state.find("position jumps", (), 0.9, words, break_repair(state, t, spans))
