"""Record of a run from the columns of a dataset, and recognition of the standard manoeuvre."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from shipid.measures.record import Array, Record, find_plateaus, first_execute, row_of_release
from shipid.measures.turning import MIDSHIPS
from shipid.measures.zigzag import last_row_of_zigzag
from shipid.physics.signals import drive_scale, is_all_round, is_command, is_steering, is_thrust_order
from shipid.units import DEGREE, percent_text

RECORD_STATES = ("t", "north", "east", "psi", "u", "v", "r")
LEAST_HELM, LEAST_TURN_OF_CIRCLE = 3 * DEGREE, 90 * DEGREE
SPIRAL_LEVELS, SPIRAL_LEVEL_DISTANCE = 5, 2 * DEGREE  # levels of helm that make a spiral, and how far they are apart
ZIGZAG_HELM_TIME = 0.7  # of the time that a zigzag's helm is over, to either side
PULL_OUT_TIME = 0.2  # of the time of the turn that a pull-out's helm is amidships
ASTERN_ANGLE = 120 * DEGREE  # of an azimuth unit, from which it pushes astern rather than aside
STRAIGHT_RATE = 0.25  # of the greatest yaw rate, up to which a ship goes straight


def record_of(columns: Mapping[str, Array], helm: Mapping[str, float] | None = None) -> Record:
    """Record of one run from the columns of a dataset.

    The helm is the mean of the angle commands that move by a quarter of the one that moves most or more, each with the
    sign that turns the ship to starboard: that in `helm`, angle command -> +1 or -1, where the vessel is known; else
    that of the sum of angle times change of yaw rate. The shaft is the mean of the speeds that are not 0 at the start;
    in a stop the slowest of those that are reversed, else stopped. It counts times the pitch over the greatest pitch,
    and that of an azimuth unit turned astern times 1 at 0 deg to -1 at 180 deg.
    """
    states = {name: np.asarray(columns[name], dtype=float) for name in RECORD_STATES}
    angles = _commands_that(columns, is_steering)
    known = (
        {name: float(np.sign(angle[:-1] @ np.diff(states["r"]))) for name, angle in angles.items()}
        if helm is None
        else helm
    )
    moved = {name: float(np.ptp(angle)) for name, angle in angles.items() if known.get(name, 0.0) and angle.any()}
    least = MIDSHIPS * max(moved.values(), default=0.0)
    helms = [known[name] * angles[name] for name, size in moved.items() if size >= least]
    return Record(
        **states,
        helm=np.mean(helms, axis=0) if helms else np.zeros(len(states["t"])),
        shaft=_shaft_of_ship(_driving_shafts(columns), states["u"]),
    )


def _driving_shafts(columns: Mapping[str, Array]) -> list[Array]:
    """Shaft speed of each screw (`drive_scale`), > 0 where it drives ahead, as `record_of` says; else the pitch."""
    driven = _commands_that(columns, lambda name: drive_scale(name) > 0)
    shafts = {f"{name.rpartition('.')[0]}.n": values / drive_scale(name) for name, values in driven.items()}
    for name, pitch in _commands_that(columns, lambda name: is_thrust_order(name) and not drive_scale(name)).items():
        shaft = f"{name.rpartition('.')[0]}.n"
        shafts[shaft] = shafts.get(shaft, np.ones(len(pitch))) * pitch / (np.abs(pitch).max() or 1.0)
    for name, angle in _commands_that(columns, is_all_round).items():
        shaft, off = f"{name.rpartition('.')[0]}.n", np.abs(np.arctan2(np.sin(angle), np.cos(angle)))
        if shaft in shafts and off.max() > ASTERN_ANGLE:
            shafts[shaft] = shafts[shaft] * (1 - off / (90 * DEGREE))
    return list(shafts.values())


def _shaft_of_ship(shafts: list[Array], u: Array) -> Array | None:
    """Shaft speed of the ship, as `record_of` says; None where no shaft runs."""
    for below in (np.less, np.less_equal):
        stopped = [shaft for shaft in shafts if shaft[0] > 0 and below(shaft.min(), 0)]
        if not stopped:
            continue
        slowest = np.asarray(np.min(stopped, axis=0))
        if (u[int(np.argmax(below(slowest, 0))) :] <= 0).any():
            return slowest
    running = [shaft for shaft in shafts if shaft[0] != 0]
    return np.asarray(np.mean(running, axis=0)) if running else None


def _commands_that(columns: Mapping[str, Array], wanted: Callable[[str], bool]) -> dict[str, Array]:
    return {
        name: np.asarray(values, dtype=float) for name, values in columns.items() if is_command(name) and wanted(name)
    }


def recognise_kinds(record: Record) -> tuple[tuple[str, ...], str]:
    """Kinds of manoeuvre of a run as `shipid manoeuvre` names them, and the reason as a sentence if there is none.

    Stop: the shaft changes from ahead to astern. Else the course is straight when the helm is first put over. Zigzag:
    the helm is reversed while the heading changes by less than 90 deg. Turning: it is on one side for 90 deg or more.
    Pull-out, in addition: it is then amidships for a fifth of the time of the turn. Of a spiral the user has to say so.
    """
    shaft, over = record.shaft, first_execute(record)
    if shaft is not None and shaft[0] > 0 > shaft.min():
        return ("stop",), ""
    if over.angle < LEAST_HELM:
        return (), f"the helm moves by less than {LEAST_HELM / DEGREE:g} deg, and the shafts are not reversed"
    straight = abs(float(np.interp(over.start, record.t, record.r))) <= STRAIGHT_RATE * np.abs(record.r).max()
    share = over.side * record.helm / over.angle
    last = last_row_of_zigzag(record, over) + 1
    off = np.abs(record.psi - record.psi[over.row])
    within = slice(over.row, last)
    if straight and (share[within] <= -0.5).any() and off[within].max() < LEAST_TURN_OF_CIRCLE:
        both = float((np.abs(share[within]) >= 0.5).mean())
        few = f"the helm is over to either side for {percent_text(both)} of the time only"
        return (("zigzag",), "") if both >= ZIGZAG_HELM_TIME else ((), few)
    levels = {
        round(float(record.helm[b]) / SPIRAL_LEVEL_DISTANCE)
        for _, b in find_plateaus(record.t, record.helm, SPIRAL_LEVEL_DISTANCE / 4)
    }
    if len(levels) >= SPIRAL_LEVELS:
        return (), f"the helm is held at {len(levels)} levels: say whether it is a spiral"
    if not straight:
        return (), "the ship turns already where the helm is first put over"
    row = row_of_release(record, over)
    if off[: row + 1][-1] < LEAST_TURN_OF_CIRCLE:
        if off[within].max() >= LEAST_TURN_OF_CIRCLE and (share[within] <= -0.5).any():
            return (), "the helm is reversed, but the heading changes by 90 deg or more: say whether it is a zigzag"
        return (), "the helm is let go before the ship has turned by 90 deg"
    turn, rest = record.t[row - 1] - record.t[over.row], np.abs(share[row:]) < MIDSHIPS
    amidships = row + np.flatnonzero(rest)
    if not len(amidships):
        return ("turning",), ""
    moved = np.flatnonzero(~rest[amidships[0] - row :])
    end = amidships[0] + int(moved[0]) - 1 if len(moved) else len(record.t) - 1
    long = record.t[end] - record.t[amidships[0]] >= PULL_OUT_TIME * turn
    return (("turning", "pull-out") if long else ("turning",)), ""
