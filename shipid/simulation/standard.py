"""Standard manoeuvres by name, with duration, approach speed and step scaled to the vessel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast, get_args

import numpy as np

from shipid.arguments import as_float_array, check_choice, check_class, check_number, check_positive
from shipid.engine.rollout import SPEED_LIMIT
from shipid.errors import ShipidError
from shipid.simulation.approach import Controls, vessel_service_speed
from shipid.simulation.manoeuvre import KINDS, MOST_HEADING, MOST_HELM, Request, Side, Trial, round_to_rows
from shipid.units import RPM, plural_word
from shipid.vessel.load import Vessel
from shipid.vessel.stability import service_shaft

ROWS, STEPS = 50, 10  # rows of the log per ship length, steps per row
MOST_STEPS = 1e7  # of a manoeuvre
APPROACHES = ("steady", "helmsman", "rest")
LEAD = 1.0  # ship lengths in the log before the execute
CALLED = {"turning_circle": "turning", "crash_stop": "stop"}
"""Kinds of documents that have another name here; `pull_out` is `pull-out`."""


@dataclass(frozen=True)
class Standard:
    """A standard manoeuvre, ready to simulate.

    kind, title : key of `standard_manoeuvres()`, and a title in words.
    speed : approach speed [m/s]. step : of the integration [s]. interval : between rows of the log [s].
    """

    kind: str
    title: str
    manoeuvre: Trial
    speed: float
    step: float
    interval: float


def standard_manoeuvres() -> dict[str, type[Trial]]:
    """Name -> class of every standard manoeuvre: the kinds of `KINDS` that are a `Trial`."""
    return {CALLED.get(name, name.replace("_", "-")): kind for name, kind in KINDS.items() if issubclass(kind, Trial)}


def define_standard(
    vessel: Vessel,
    name: str,
    angles: Sequence[float] | float = (),
    *,
    speed: float | None = None,
    side: str = "starboard",
    duration: float | None = None,
    approach: str = "steady",
    n: float | None = None,
) -> Standard:
    """Define a standard manoeuvre for a vessel; the time for one ship length has about 500 steps, a row has ten.

    name : a key of `standard_manoeuvres()`, such as `zigzag`, `turning` or `pull-out`.
    angles : one or several [deg], of helm and, of a zigzag, the execute heading.
    speed : approach speed [m/s]; default: the document's U_0, else Froude number 0.2.
    side : first turn, `starboard` or `port`.
    duration : [s]; of a spiral, the time of each level. Default: by the kind, see `Trial.scaled`.
    approach : `steady` with the helm amidships, held on course by a `helmsman`, or from `rest`.
    n : shaft speed [rev/s] of the approach; default: that which gives the speed.

    ShipidError for what is not known or does not fit, and for a speed that no shaft speed gives.
    """
    check_class("vessel", vessel, Vessel, "as of `load_vessel`")
    kinds = standard_manoeuvres()
    check_choice("manoeuvre", name, kinds)
    kind = kinds[name]
    angles = as_float_array("angles", angles).ravel().tolist()
    _check_angles(name, angles, len(kind.angles))
    check_choice("side", side, get_args(Side))
    check_choice("approach", approach, APPROACHES)
    duration = None if duration is None else check_positive("duration", duration)
    length = vessel.length
    if length is None:
        raise ShipidError("particulars.L_pp is missing: manoeuvres are timed in ship lengths", file=vessel.file)
    asked = vessel_service_speed(vessel) if speed is None else check_number("speed", speed)
    controls = Controls(vessel)
    n_rpm = (shaft_speed(controls, asked) if n is None else check_number("n", n)) / RPM
    passing = length / asked  # s for one length
    interval = _round_to_125(passing / ROWS)
    lead = round_to_rows(LEAD * passing, interval)
    if duration is not None and "duration" in kind.model_fields and duration <= lead:  # else of a level
        raise ShipidError(
            f"{duration:g} s is over before the first order, at {lead:g} s of the log: give more", path="--duration"
        )
    course = 90.0 if kind.straight else 0.0  # drawn from left to right
    keys = {"n_rpm": n_rpm, "execute_at": lead, "course_deg": course, "approach": approach}
    request = Request(
        controls,
        n_rpm * RPM,
        asked,
        angles=tuple(angles),
        side=cast(Side, side),
        duration=duration,
        passing=passing,
        interval=interval,
        keys=keys,
    )
    manoeuvre = kind.scaled(request)
    manoeuvre.check(controls)
    steps = manoeuvre.length / interval * STEPS
    if steps > MOST_STEPS:
        raise ShipidError(
            f"{steps:.2g} steps of {interval / STEPS:g} s, at most {MOST_STEPS:.0e}: give a shorter duration",
            path="--duration",
        )
    return Standard(name, manoeuvre.title(name.replace("-", " ")), manoeuvre, float(asked), interval / STEPS, interval)


def _check_angles(name: str, angles: Sequence[float], most: int) -> None:
    """Refuse angles [deg] that a kind does not take, or that are none."""
    if len(angles) > most:
        raise ShipidError(f"{name} takes {most or 'no'} {plural_word(most, 'angle')}, not {len(angles)}", path="ANGLES")
    for angle, greatest in zip(angles, (MOST_HELM, MOST_HEADING), strict=False):
        if not 0 < angle <= greatest:
            remedy = f"angles are above 0 and at most {greatest:g} deg: --side gives the side of the first turn"
            raise ShipidError(f"{angle:g} deg: {remedy}", path="ANGLES")


def shaft_speed(controls: Controls, speed: float) -> float:
    """Shaft speed [rev/s] at which the ship goes straight ahead in calm water at a steady speed [m/s].

    DocumentError where no command drives the ship, ShipidError where no shaft speed gives the speed.
    """
    if not 0 < speed <= SPEED_LIMIT:
        raise ShipidError(
            f"{speed:g} m/s: the speed of the approach must be above 0 and at most {SPEED_LIMIT:g} m/s", path="--speed"
        )
    _ = controls.drives  # DocumentError where nothing drives it, at any speed
    n = service_shaft(controls.vessel, speed)
    if n is None:
        raise ShipidError(
            f"no shaft speed or force drives {controls.vessel.name} at {speed:g} m/s: give a lower speed",
            path="--speed",
        )
    return n


def _round_to_125(value: float) -> float:
    """The number 1, 2 or 5 times a power of ten with the smallest ratio to `value`."""
    decade = 10.0 ** np.floor(np.log10(value))
    steps = np.array([1, 2, 5, 10]) * decade
    return float(f"{steps[np.argmin(np.abs(np.log(steps / value)))]:.6g}")
