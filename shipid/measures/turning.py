"""Turning circle and pull-out (MSC.137(76); MSC/Circ.1053; ITTC 7.5-04-02-01)."""

from __future__ import annotations

import numpy as np

from shipid.measures.record import (
    AT_REST,
    HELM_NEVER_MOVED,
    NAN,
    STEADY_CHANGE,
    Array,
    Measures,
    Record,
    cubic_value_at,
    first_execute,
    integral_between,
    maximum_between,
    mean_between,
    row_of_release,
    settled_mean,
    start_of_change,
    time_of_crossing,
)
from shipid.units import DEGREE

MIDSHIPS = 0.25  # of the helm in the turn: smaller angles count as amidships


def turning_measures(record: Record) -> Measures:
    """Measures of a turning circle, up to the release of the helm.

    Distances are those of the logged point, in axes of the heading at the execute.

    Returns
    -------
    Measures : `execute`, its instant [s]; `helm` [rad]; `approach_speed` [m/s]; `advance` and `transfer` where the
        heading has changed by 90 deg, `tactical_diameter` by 180 deg, `greatest_advance`, `greatest_transfer` [m];
        `time_to_90`, `time_to_180`, `time_to_360` [s]; of the steady turn, means over the last 180 deg of heading:
        `steady_diameter` (2 V / r) [m], `steady_speed` [m/s], `steady_rate` [rad/s], `steady_drift` (> 0: the bow
        points inwards) [rad], `speed_loss` (share of the approach speed), and `current_speed` [m/s]: the velocity over
        ground that does not turn with the ship, by current or wind. Nothing else is corrected for it.
    """
    over, measures = first_execute(record), Measures()
    start, helm, side = over.start, over.angle, over.side
    record = record.upto(row_of_release(record, over))
    t, moving = record.t, np.isfinite(start)
    turned = side * (record.psi - cubic_value_at(t, record.psi, start)) if moving else np.zeros(len(t))
    ahead, aside = record.along(start)
    before = float(np.interp(start, t, record.speed)) if moving else NAN
    passed = {angle: time_of_crossing(t, turned, angle * DEGREE, start) for angle in (90, 180, 270, 360)}
    against = turned.min(initial=0.0) <= -90 * DEGREE
    why = {
        angle: "the ship turns against its helm" if against else f"the heading changes by less than {angle} deg"
        for angle in passed
    }
    measures.add(HELM_NEVER_MOVED, execute=(start, "s"), helm=(helm or NAN, "rad"), approach_speed=(before, "m/s"))
    advance, transfer = cubic_value_at(t, ahead, passed[90]), side * cubic_value_at(t, aside, passed[90])
    measures.add(why[90], advance=(advance, "m"), transfer=(transfer, "m"))
    measures.add(why[180], tactical_diameter=(side * cubic_value_at(t, aside, passed[180]), "m"))
    for name, way, values, angle in (("advance", "ahead", ahead, 180), ("transfer", "aside", side * aside, 270)):
        still = f"the ship still goes {way} where the heading has changed by {angle} deg"
        missing = still if np.isfinite(passed[angle]) else why[angle]
        greatest = maximum_between(t, values, start, passed[angle])[1] if np.isfinite(passed[angle]) else NAN
        measures.add(missing, **{f"greatest_{name}": (greatest, "m")})
    for angle in (90, 180, 360):
        measures.add(why[angle], **{f"time_to_{angle}": (passed[angle] - start, "s")})
    _add_steady_turn(record, side, turned, passed[180], before, measures, why[360])
    return measures


def _add_steady_turn(
    record: Record, side: float, turned: Array, beyond: float, before: float, measures: Measures, why: str
) -> None:
    """Add the measures of the steady turn: means over the last 180 deg of heading, after the first 180 deg.

    The turn is steady if the last two quarter turns differ by at most 5 % in time. why : of a turn that is none.
    """
    t, end = record.t, float(record.t[-1])
    first, middle = (
        time_of_crossing(t, turned, turned[-1] - angle * DEGREE, float(t[0])) if np.isfinite(beyond) else NAN
        for angle in (180, 90)
    )
    rate = NAN
    if first >= beyond:
        quarters = np.array([middle - first, end - middle])
        steady = abs(quarters[1] / quarters[0] - 1) <= STEADY_CHANGE
        rate = np.pi / (end - first) if steady else NAN
        why = "the turn is not steady: the last two quarter turns differ by more than 5 % in time"
    speed = drift = carried = NAN
    if np.isfinite(rate):
        speed, carried = mean_between(t, record.speed, first, end), _speed_of_water(record, first, end)
        drift = mean_between(t, np.arctan2(-side * record.v, record.u), first, end)
    measures.add(
        why,
        steady_diameter=(2 * speed / rate, "m"),
        steady_speed=(speed, "m/s"),
        steady_rate=(rate, "rad/s"),
        steady_drift=(drift, "rad"),
    )
    measures.add(why if before else AT_REST, speed_loss=(1 - speed / before if before else NAN, "-"))
    measures.add(why, current_speed=(carried, "m/s"))


def _speed_of_water(record: Record, first: float, end: float) -> float:
    """Speed [m/s] of the water in a steady turn: u + i v is a constant through the water and c exp(-i psi) of it."""
    within = (record.t >= first) & (record.t <= end)
    turning = np.exp(-1j * record.psi[within])
    parts = np.stack([np.ones_like(turning), turning], axis=1)
    found = np.linalg.lstsq(parts, record.u[within] + 1j * record.v[within])[0]
    return float(abs(found[1]))


def pull_out_measures(record: Record) -> Measures:
    """Measures of a pull-out: the residual yaw rate after the helm is put amidships; 0 for a stable ship.

    Returns
    -------
    Measures : `execute`, its instant [s]; `helm` [rad]; `turning_rate`, at the release, and `residual_rate`, settled at
        the end [rad/s], both > 0 to the side of the turn; `heading_change` from the release to the end [rad].
    """
    over, measures = first_execute(record), Measures()
    row = row_of_release(record, over)
    put = row < len(record.t)
    release = start_of_change(record.t, record.helm, row) if put else NAN
    if put:  # the helm is left amidships until it is moved again
        moved = row + np.flatnonzero(np.diff((np.abs(record.helm[row:]) > MIDSHIPS * over.angle).astype(int)) > 0) + 1
        record = record.upto(int(moved[0]) if len(moved) else len(record.t))
    t, end = record.t, float(record.t[-1])
    rate = over.side * float(np.interp(release, t, record.r)) if put else NAN
    why = "the helm is not put amidships after the turn"
    measures.add(HELM_NEVER_MOVED, execute=(over.start, "s"), helm=(over.angle or NAN, "rad"))
    measures.add(why, turning_rate=(rate, "rad/s"))
    residual = over.side * settled_mean(t, record.r, release, end, rate) if put else NAN
    late = "the rate still changes over the last half of the log: let it run longer"
    measures.add(late if put else why, residual_rate=(residual, "rad/s"))
    measures.add(why, heading_change=(over.side * integral_between(t, record.r, release, end), "rad"))
    return measures
