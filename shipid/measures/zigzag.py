"""The zigzag: overshoots, initial turning, time to check the yaw, period (MSC.137(76); ITTC 7.5-04-02-01)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shipid.measures.record import (
    AT_REST,
    FULL_HELM,
    HELM_NEVER_MOVED,
    NAN,
    Array,
    FirstExecute,
    Measures,
    Record,
    cubic_value_at,
    first_execute,
    integral_between,
    maximum_between,
    time_of_crossing,
)
from shipid.units import DEGREE

USUAL_HEADING_STEP = 5 * DEGREE  # execute headings are usually multiples of it
MOST_OVERSHOOTS = 4  # overshoots that are measured: later ones repeat them
TURNED_BACK_SHARE = 0.5  # of the execute heading: a ship that goes from there to the other side has turned back
HEADING_TOLERANCE = 1.5 * DEGREE  # tolerance of the execute heading at a reversal


def zigzag_measures(record: Record, execute_heading: float | None = None, course: float | None = None) -> Measures:
    """Measures of a zigzag.

    Each execute after the first is the time at which the heading passes the execute heading, independent of the delay
    of the rudder. The n-th overshoot is the largest heading beyond the execute heading before the ship turns back. The
    zigzag ends where the helm is released for longer than it was ever over.

    execute_heading : change of heading from the course [rad]; default: estimated from the reversals of the helm.
    course : course of the approach [rad]; default: the heading at the first execute.

    Returns
    -------
    Measures : `execute`, instant of the first one [s]; `helm`, `execute_heading` [rad]; `approach_speed` [m/s];
        `initial_turning` (track from first to second execute [m]) and `initial_turning_time` [s]; `overshoot_1` to at
        most `overshoot_4` [rad] and `time_to_check_1`, ... [s] after the execute; `reach` (from the first execute until
        back on course) [s]; `period` (second to fourth execute) [s]; `speed_loss` (greatest until the third execute, as
        a share of the approach speed).
    """
    over, measures = first_execute(record), Measures()
    start, helm = over.start, over.angle
    record = record.upto(last_row_of_zigzag(record, over) + 1)
    t = record.t
    around = cubic_value_at(t, record.psi, start) if course is None else course
    off = over.side * (record.psi - around)
    angle = _estimate_execute_heading(record, off, over) if execute_heading is None else abs(execute_heading)
    executes, why_no_more = _later_executes(t, off, angle, start)
    before = float(np.interp(start, t, record.speed)) if np.isfinite(start) else NAN
    measures.add(HELM_NEVER_MOVED, execute=(start, "s"), helm=(helm or NAN, "rad"))
    measures.add("the helm is never reversed", execute_heading=(angle, "rad"))
    measures.add(HELM_NEVER_MOVED, approach_speed=(before, "m/s"))
    second, third, fourth = (*executes, *[NAN] * 3)[:3]
    missing = why_no_more.format
    track = integral_between(t, record.speed, start, second)
    measures.add(missing("second"), initial_turning=(track, "m"), initial_turning_time=(second - start, "s"))
    for number, (moment, until) in enumerate(_legs_of_zigzag(executes, float(t[-1])), start=1):
        sense = 1.0 if number % 2 else -1.0
        turned, peak = maximum_between(t, sense * off, moment, until)
        why = "the log ends before the heading turns back" if np.isfinite(moment) else missing("next")
        peaks = {f"overshoot_{number}": (peak - angle, "rad"), f"time_to_check_{number}": (turned - moment, "s")}
        measures.add(why, **peaks)
    back = time_of_crossing(t, off, 0.0, second, rising=False) if np.isfinite(second) else NAN
    measures.add("the log ends before the ship is back on its course", reach=(back - start, "s"))
    measures.add(missing("fourth"), period=(fourth - second, "s"))
    slowest = NAN
    if np.isfinite(third):
        slowest = min(float(np.interp(third, t, record.speed)), *record.speed[(t >= start) & (t <= third)])
    lost = 1 - slowest / before if before else NAN
    measures.add(missing("third") if before else AT_REST, speed_loss=(lost, "-"))
    return measures


def last_row_of_zigzag(record: Record, over: FirstExecute) -> int:
    """Last row of a zigzag with the helm over; after it the helm is released for longer than it was ever over."""
    rows = np.flatnonzero(np.abs(record.helm) >= over.angle / 2)
    rows = rows[rows >= over.row] if over.angle else rows[-1:]
    gaps = np.flatnonzero(np.diff(rows) > 1)
    begins, ends = rows[np.append(0, gaps + 1)], rows[np.append(gaps, len(rows) - 1)]
    longest = float((record.t[ends] - record.t[begins]).max())
    long = np.flatnonzero(record.t[begins[1:]] - record.t[ends[:-1]] > longest)
    return int(ends[long[0]] if len(long) else ends[-1])


def _later_executes(t: Array, off: Array, angle: float, start: float) -> tuple[list[float], str]:
    """Times [s] of the second, third, ... execute, and why there are no more, with a place for the next one's name.

    The change of heading passes +angle, -angle, +angle, ... [rad]. Where it turns back before, rows are too far apart.
    """
    instants: list[float] = []
    moment, sense = start, 1.0
    while np.isfinite(moment) and np.isfinite(angle):
        before, moment = moment, time_of_crossing(t, sense * off, angle, moment)
        swing = sense * off[(t > before) & (t < moment if np.isfinite(moment) else True)] / angle
        over = np.maximum.accumulate(swing) if len(swing) else swing
        if (swing[over > TURNED_BACK_SHARE] < -TURNED_BACK_SHARE).any():
            return instants, "rows are too far apart: the heading passes that of the {} execute between them"
        if np.isfinite(moment):
            instants.append(moment)
        sense = -sense
    return instants, "the log ends before the {} execute"


def _legs_of_zigzag(executes: list[float], end: float) -> list[tuple[float, float]]:
    """Pairs of an execute and the next one, or the end of the log; at least two, as criteria need two overshoots."""
    legs = list(pairwise([*executes, end]))[:MOST_OVERSHOOTS]
    return legs + [(NAN, NAN)] * (2 - len(legs))


def _estimate_execute_heading(record: Record, off: Array, execute: FirstExecute) -> float:
    """Execute heading [rad]: change of heading from the course at which the helm is reversed.

    It is between the last row with the old helm and the next row, or slightly before because of the delay of the helm:
    the multiple of 5 deg there, else the last whole degree.
    """
    helm = execute.angle
    over = np.where(np.abs(record.helm) >= helm / 2, np.sign(record.helm), 0.0)
    rows = np.flatnonzero(over)
    rows = rows[rows >= execute.row]
    pairs = [(a, b) for a, b in pairwise(rows) if over[a] != over[b]]
    if not pairs:
        return NAN
    full = [_last_full(np.abs(record.helm[: a + 1]), helm) for a, _ in pairs]
    low = float(np.median(np.abs(off[full])))
    high = float(np.median([np.abs(off[row + 1]) for row in full]))
    whole = round((low + high) / 2 / USUAL_HEADING_STEP) * USUAL_HEADING_STEP
    if whole > 0 and low - HEADING_TOLERANCE <= whole <= high + HEADING_TOLERANCE:
        return whole
    return max(float(np.floor(high / DEGREE + 0.25)), 1.0) * DEGREE


def _last_full(size: Array, helm: float) -> int:
    """Last row with at least 95 % of the helm angle [rad]; the last row if there is none."""
    full = np.flatnonzero(size >= FULL_HELM * helm)
    return int(full[-1]) if len(full) else len(size) - 1
