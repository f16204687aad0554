"""Standard manoeuvres by name, with duration, approach speed and step scaled to the vessel."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast, get_args

import numpy as np

from shipid.arguments import number, numbers, of_class
from shipid.engine.rollout import SPEED_LIMIT
from shipid.errors import ShipidError, choices
from shipid.simulation.approach import Controls, balanced_shaft, service_speed
from shipid.simulation.manoeuvre import (
    HELMS,
    MOST_HEADING,
    MOST_HELM,
    RATES,
    Approached,
    CrashStop,
    PullOut,
    ReverseSpiral,
    Spiral,
    TurningCircle,
    Zigzag,
)
from shipid.units import DEGREE, RPM, plural
from shipid.vessel.load import Vessel
from shipid.vessel.stability import growths

log = logging.getLogger(__name__)
Side = Literal["starboard", "port"]
ROWS, STEPS = 50, 10  # rows of the log per ship length, steps per row
LEAST_STEPS, MOST_STEPS = 10, 1e7  # steps for a ship length, and of a manoeuvre
APPROACHES = ("steady", "helmsman", "rest")
SPIRALS = ("spiral", "reverse-spiral")
ROUND = ("turning", "pull-out", *SPIRALS)
# in ship lengths at the approach speed: log before the execute, and duration of each kind
LEAD, ZIGZAG, TURN, LEVEL, STOP = 1.0, 30.0, 60.0, 40.0, 80.0
DECAYS, LONGEST = 8.0, 200.0  # until a turn is steady: time constants of a small yaw, and at most ship lengths


@dataclass(frozen=True)
class Standard:
    """A standard manoeuvre, ready to simulate.

    Parameters
    ----------
    kind, title : key in `shipid.measures.MEASURES`, and a title in words.
    speed : approach speed [m/s]. step : of the integration [s]. interval : between rows of the log [s].
    """

    kind: str
    title: str
    manoeuvre: Approached
    speed: float
    step: float
    interval: float


def standard(
    vessel: Vessel,
    name: str,
    angles: Sequence[float] | float = (),
    *,
    speed: float | None = None,
    side: str = "starboard",
    duration: float | None = None,
    step: float | None = None,
    approach: str = "steady",
    n: float | None = None,
) -> Standard:
    """Define a standard manoeuvre for a vessel.

    Parameters
    ----------
    name : `zigzag`, `turning`, `pull-out`, `spiral`, `reverse-spiral`, `stop`.
    angles : one or several [deg], of helm and, of a zigzag, the execute heading; of a reverse spiral the greatest rate
        [deg/s].
    speed : approach speed [m/s]; default: the document's U_0, else Froude number 0.2.
    side : first turn, `starboard` or `port`.
    duration : [s]; of a spiral, the time of each level. Default: the time for 60 ship lengths at the approach speed, 30
        for a zigzag, 80 for a stop, 40 for a level of a spiral. A level of a direct spiral, and a pull-out after its
        turn of 30 lengths, take up to 200, see `_settling`.
    step : of the integration [s]; default: about 1/500 of the time for one ship length. A row has ten steps.
    approach : `steady` with the helm amidships, held on course by a `helmsman`, or from `rest`.
    n : shaft speed [rev/s] of the approach; default: that which gives the speed.

    Raises
    ------
    ShipidError : an unknown name, side or approach, angles that do not fit, no length, a speed that no shaft speed
        gives, a time that is not positive.
    """
    of_class("vessel", vessel, Vessel, "as of `load_vessel`")
    if not isinstance(name, str) or name not in KINDS:
        raise ShipidError(f"no manoeuvre is called {name!r}: {choices(name, KINDS)}", path="NAME")
    build, most = KINDS[name]
    angles = numbers("angles", angles).ravel().tolist()
    _check_angles(name, angles, most)
    if not isinstance(side, str) or side not in get_args(Side):
        raise ShipidError(f"{side!r} is no side: starboard or port", path="--side")
    if not isinstance(approach, str) or approach not in APPROACHES:
        raise ShipidError(f"{approach!r} is no approach: {choices(approach, APPROACHES)}", path="--approach")
    for option, value in (("--duration", duration), ("--step", step)):
        if value is not None and not 0 < number(option.strip("-"), value) < np.inf:
            raise ShipidError(f"{value:g} s must be positive and finite", path=option)
    length = vessel.length
    if length is None:
        raise ShipidError("particulars.L_pp is missing: manoeuvres are timed in ship lengths", file=vessel.file)
    asked = service_speed(vessel) if speed is None else number("speed", speed)
    controls = Controls(vessel)
    n_rpm = (shaft_speed(controls, asked) if n is None else number("n", n)) / RPM
    passing = length / asked  # s for one length
    interval = _round(passing / ROWS) if step is None else step * STEPS
    lead = _in_rows(LEAD * passing, interval)
    if duration is not None and name not in SPIRALS and duration <= lead:
        words = f"{duration:g} s is over before the first order, at {lead:g} s of the log"
        raise ShipidError(f"{words}: give more", path="--duration")
    course = 0.0 if name in ROUND else 90.0  # straight tracks are drawn from left to right
    how = {"n_rpm": n_rpm, "execute_at": lead, "course_deg": course, "approach": approach}
    if step is not None and step > passing / LEAST_STEPS:
        words = f"{step:g} s is too long for this ship, which runs a length in {passing:.3g} s"
        raise ShipidError(f"{words}: give {passing / LEAST_STEPS:.3g} s or less", path="--step")
    if name == "spiral" and duration is None:
        duration = passing * _settling(controls, asked, n_rpm * RPM, passing, LEVEL)
    manoeuvre = build(angles, cast(Side, side), duration, passing, how)
    if isinstance(manoeuvre, PullOut):  # between two rows the log would show the release after it
        manoeuvre = manoeuvre.model_copy(update={"turn": _in_rows(manoeuvre.turn, interval)})
        if duration is None:
            amidships = passing * _settling(controls, asked, n_rpm * RPM, passing, TURN / 2)
            manoeuvre = manoeuvre.model_copy(update={"duration": lead + manoeuvre.turn + amidships})
    manoeuvre.check(controls)
    steps = manoeuvre.length / interval * STEPS
    if steps > MOST_STEPS:
        option = "--duration" if step is None else "--step"
        remedy = f"at most {MOST_STEPS:.0e}: give a {'shorter duration' if step is None else 'longer step'}"
        raise ShipidError(f"{steps:.2g} steps of {interval / STEPS:g} s, {remedy}", path=option)
    return Standard(name, _title(name, manoeuvre), manoeuvre, float(asked), interval / STEPS, interval)


def _check_angles(name: str, angles: Sequence[float], most: int) -> None:
    """Refuse angles [deg] that do not fit; warn of a helm that may be in rad."""
    if len(angles) > most:
        raise ShipidError(f"{name} takes {most or 'no'} {plural(most, 'angle')}", path="ANGLES")
    if any(angle <= 0 for angle in angles):
        raise ShipidError("angles are positive: --side gives the direction of the first turn", path="ANGLES")
    for place, angle in enumerate(angles):
        greatest = MOST_HEADING if place else MOST_HELM  # as much of a reverse spiral, in deg/s
        if not angle <= greatest:
            raise ShipidError(f"{angle:g} deg: give at most {greatest:g} deg", path="ANGLES")
    if angles and name != "reverse-spiral" and angles[0] <= MOST_HELM * DEGREE:  # as every helm in rad is
        inside = f"they are in deg, and {angles[0]:g} rad are {angles[0] / DEGREE:.2g} deg"
        log.warning("ANGLES: %g deg of helm is little: %s", angles[0], inside)


def shaft_speed(controls: Controls, speed: float) -> float:
    """Shaft speed [rev/s] at which the ship goes straight ahead in calm water at a steady speed [m/s].

    Raises
    ------
    DocumentError : no command drives the ship.
    ShipidError : the speed is not positive, or no shaft speed up to 60,000 rpm gives it.
    """
    if not 0 < speed <= SPEED_LIMIT:
        words = f"the speed of the approach must be above 0 and at most {SPEED_LIMIT:g} m/s"
        raise ShipidError(f"{speed:g} m/s: {words}", path="--speed")
    _ = controls.drives  # DocumentError where nothing drives her, at any speed
    n = balanced_shaft(controls, speed)
    if n is None:
        raise ShipidError(
            f"no shaft speed drives {controls.vessel.name} at {speed:g} m/s: give a lower speed", path="--speed"
        )
    return n


def _settling(controls: Controls, speed: float, n: float, passing: float, least: float) -> float:
    """Ship lengths until a turn is steady, `least` or more: the rate of a nearly neutral ship takes long.

    The time is eight time constants of a small yaw about the straight course at a speed [m/s] and shaft speed [rev/s],
    the slowest of all turns, but at most 200 times that for a ship length, `passing` [s].
    """
    rates = growths(controls.vessel, speed, controls.ahead(n))
    decay = min(map(abs, rates)) * passing  # in a ship length
    return float(np.clip(DECAYS / decay if decay > 0 else np.inf, least, LONGEST))


def _title(name: str, manoeuvre: Approached) -> str:
    """Title of a manoeuvre with its angles and side."""
    words = name.replace("-", " ")
    if isinstance(manoeuvre, Zigzag):
        return f"{words} {manoeuvre.angle_deg:g}/{manoeuvre.reversal_deg:g}, first to {manoeuvre.side}"
    if isinstance(manoeuvre, (TurningCircle, PullOut)):
        return f"{words}, {manoeuvre.angle_deg:g} deg of helm to {manoeuvre.side}"
    if isinstance(manoeuvre, Spiral):
        return f"{words}, {max(manoeuvre.angles_deg):g} deg of helm to either side"
    return words


def _in_rows(time: float, interval: float) -> float:
    """The time [s] in whole intervals, rounded up."""
    return float(np.ceil(time / interval) * interval)


def _round(value: float) -> float:
    """The number 1, 2 or 5 times a power of ten with the smallest ratio to `value`."""
    decade = 10.0 ** np.floor(np.log10(value))
    steps = np.array([1, 2, 5, 10]) * decade
    return float(f"{steps[np.argmin(np.abs(np.log(steps / value)))]:.6g}")


Build = Callable[[Sequence[float], Side, float | None, float, dict[str, Any]], Approached]


def _zigzag(angles: Sequence[float], side: Side, duration: float | None, passing: float, how: dict[str, Any]) -> Zigzag:
    helm = angles[0] if angles else 10.0
    heading = angles[1] if len(angles) > 1 else helm
    time = how["execute_at"] + ZIGZAG * passing if duration is None else duration
    return Zigzag(angle_deg=helm, execute_heading_deg=heading, side=side, duration=time, **how)


def _turning(
    angles: Sequence[float], side: Side, duration: float | None, passing: float, how: dict[str, Any]
) -> TurningCircle:
    time = how["execute_at"] + TURN * passing if duration is None else duration
    return TurningCircle(angle_deg=angles[0] if angles else 35.0, side=side, duration=time, **how)


def _pull_out(
    angles: Sequence[float], side: Side, duration: float | None, passing: float, how: dict[str, Any]
) -> PullOut:
    time = how["execute_at"] + TURN * passing if duration is None else duration
    turn = (time - how["execute_at"]) / 2
    return PullOut(angle_deg=angles[0] if angles else 20.0, side=side, turn=turn, duration=time, **how)


def _spiral(angles: Sequence[float], side: Side, duration: float | None, passing: float, how: dict[str, Any]) -> Spiral:
    sense, most = (1 if side == "starboard" else -1), angles[0] if angles else HELMS[0]
    there = [sense * most / HELMS[0] * helm for helm in HELMS]
    hold = LEVEL * passing if duration is None else duration
    return Spiral(angles_deg=(*there, *there[-2::-1]), hold=hold, **how)


def _reverse_spiral(
    angles: Sequence[float], side: Side, duration: float | None, passing: float, how: dict[str, Any]
) -> ReverseSpiral:
    sense = 1 if side == "starboard" else -1
    most = angles[0] if angles else float(np.rad2deg(0.25 / passing))  # r L / U = 0.25
    hold = LEVEL * passing if duration is None else duration
    return ReverseSpiral(rates_deg=tuple(sense * most * rate / RATES[0] for rate in RATES), hold=hold, **how)


def _stop(
    angles: Sequence[float],  # noqa: ARG001
    side: Side,  # noqa: ARG001
    duration: float | None,
    passing: float,
    how: dict[str, Any],
) -> CrashStop:
    time = how["execute_at"] + STOP * passing if duration is None else duration
    return CrashStop(astern_rpm=how["n_rpm"], duration=time, **how)


KINDS: dict[str, tuple[Build, int]] = {
    "zigzag": (_zigzag, 2),
    "turning": (_turning, 1),
    "pull-out": (_pull_out, 1),
    "spiral": (_spiral, 1),
    "reverse-spiral": (_reverse_spiral, 1),
    "stop": (_stop, 0),
}
"""Name -> function that builds the manoeuvre, and its largest number of angles."""
