"""IMO criteria of ship manoeuvrability: resolution MSC.137(76), annex, 5.3."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from shipid.measures.record import AT_REST, NAN, Measures
from shipid.units import DEGREE

SHORTEST = 100.0  # m: length from which the standards apply
SAME = 0.5 * DEGREE  # tolerance of the angle of a test
CARRIED = 0.1  # of the steady speed: a current from which a turning circle is not judged


@dataclass(frozen=True)
class Criterion:
    """One criterion with the measured value.

    Parameters
    ----------
    name : the measure, and the paragraph of the resolution.
    value, limit, unit : measured value, largest value allowed, and their unit: ship lengths ("L") or rad.
    met : whether value <= limit; None if the value is missing or the manoeuvre is not that of the criterion.
    note : why it is not judged, or a remark.
    """

    name: str
    value: float
    limit: float
    unit: str
    met: bool | None
    note: str = ""


def criteria(kind: str, measures: Measures, length: float | None, *, calm: bool = False) -> list[Criterion]:
    """Criteria of a manoeuvre; `length` [m] is that between perpendiculars. Empty for kinds without a criterion.

    calm : whether there is known to be no current and no wind, as in a simulation.

    The user must ensure the test conditions: test speed of at least 90 % of that at 85 % of the maximum engine power,
    full load, deep calm water (5.2), and a logged point at midships.
    """
    if kind == "turning":
        return list(_turning(measures, length, calm=calm))
    if kind == "zigzag":
        return list(_zigzag(measures, length))
    if kind == "stop":
        track = _lengths(measures, "track_reach", length)
        criterion = _judged(
            "stopping ability: track reach (5.3.4)", track, 15.0, "L", measures["track_reach"].why, length
        )
        if criterion.met is False:
            more = "up to 20 L where a large displacement makes 15 L impracticable"
            criterion = replace(criterion, note="; ".join(filter(None, [criterion.note, more])))
        return [criterion]
    return []


def _turning(measures: Measures, length: float | None, *, calm: bool) -> Iterator[Criterion]:
    over = _wrong(measures, {"helm": 35.0})
    note = f"{over}; the test asks for that, or for the greatest helm allowed at the test speed" if over else ""
    current, steady = measures["current_speed"].value, measures["steady_speed"].value
    why = "" if calm else measures["current_speed"].why
    remark = f"how far current or wind carried the ship is not known: {why}" if why else ""
    if not calm and current > CARRIED * steady:  # in calm water a turn that is not quite steady has some, too
        carried = f"current or wind carried the ship at {current:.2g} m/s: correct the track for it (MSC/Circ.1053)"
        note = "; ".join(filter(None, [note, carried]))
    for name, limit in (("advance", 4.5), ("tactical_diameter", 5.0)):
        label = f"turning ability: {name.replace('_', ' ')} (5.3.1)"
        missing = measures[name].why
        yield _judged(label, _lengths(measures, name, length), limit, "L", missing, length, note, remark)


def _zigzag(measures: Measures, length: float | None) -> Iterator[Criterion]:
    small = _wrong(measures, {"helm": 10.0, "execute_heading": 10.0})
    large = _wrong(measures, {"helm": 20.0, "execute_heading": 20.0})
    if not large:
        overshoot = measures["overshoot_1"]
        yield _judged(
            "yaw checking: 20/20 first overshoot (5.3.3.3)", overshoot.value, 25 * DEGREE, "rad", overshoot.why, length
        )
    if small:
        return
    travelled = _lengths(measures, "initial_turning", length)
    label = "initial turning ability: track to 10 deg (5.3.2)"
    yield _judged(label, travelled, 2.5, "L", measures["initial_turning"].why, length)
    speed = measures["approach_speed"].value
    ratio = length / speed if length and speed > 0 else NAN
    for number, paragraph, limit in ((1, "5.3.3.1", first_limit(ratio)), (2, "5.3.3.2", second_limit(ratio))):
        overshoot = measures[f"overshoot_{number}"]
        ordinal = "first" if number == 1 else "second"
        label = f"yaw checking: 10/10 {ordinal} overshoot ({paragraph})"
        missing = overshoot.why or (AT_REST if speed == 0 else "")
        yield _judged(label, overshoot.value, limit, "rad", missing, length)


def first_limit(ratio: float) -> float:
    """Largest first overshoot [rad] allowed in a 10/10 zigzag, for `ratio` L/V [s]."""
    return float(np.clip(5 + ratio / 2, 10, 20)) * DEGREE


def second_limit(ratio: float) -> float:
    """Largest second overshoot [rad] allowed in a 10/10 zigzag, for `ratio` L/V [s]."""
    return float(np.clip(17.5 + 0.75 * ratio, 25, 40)) * DEGREE


def _lengths(measures: Measures, name: str, length: float | None) -> float:
    return measures[name].value / length if length else NAN


def _wrong(measures: Measures, asked: dict[str, float]) -> str:
    """Text of the angles that differ from those of a test [deg]; empty if none differs."""
    angles = {name: (measures[name].value / DEGREE, angle) for name, angle in asked.items()}
    return ", ".join(
        f"{name.replace('_', ' ')} is {value:.1f} deg, not {angle:g}"
        for name, (value, angle) in angles.items()
        if not abs(value - angle) <= SAME / DEGREE
    )


def _judged(
    name: str,
    value: float,
    limit: float,
    unit: str,
    missing: str,
    length: float | None,
    note: str = "",
    remark: str = "",
) -> Criterion:
    """One criterion; with a `note` it is not judged, a `remark` changes nothing."""
    if not np.isfinite(value) or not np.isfinite(limit):
        why = missing or "the length of the ship is not known"
        return Criterion(name, value, limit, unit, None, why)
    short = f"the standards are for ships of {SHORTEST:g} m and more" if length and length < SHORTEST else ""
    return Criterion(
        name, value, limit, unit, None if note else value <= limit, "; ".join(filter(None, [note, remark, short]))
    )
