"""IMO criteria of manoeuvrability (resolution MSC.137(76), annex, 5.3), and measures and criteria as rows of tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shipid.measures.record import AT_REST, NAN, Measures
from shipid.units import DEGREE

SHORTEST_SHIP = 100.0  # m: length from which the standards apply
ANGLE_TOLERANCE = 0.5 * DEGREE  # tolerance of the angle of a test
LARGEST_CURRENT = 0.1  # of the steady speed: a current from which a turning circle is not judged
SHOWN_UNITS = {
    "rad": ("deg", DEGREE),
    "rad/s": ("deg/s", DEGREE),
}  # SI unit -> unit in tables, and its size in SI units


@dataclass(frozen=True)
class Criterion:
    """One criterion with the measured value.

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


def judge_criteria(kind: str, measures: Measures, length: float | None, *, calm: bool = False) -> list[Criterion]:
    """Criteria of a manoeuvre; `length` [m] is that between perpendiculars. Empty for kinds without a criterion.

    calm : whether there is known to be no current and no wind, as in a simulation.

    The user must ensure the test conditions: test speed of at least 90 % of that at 85 % of the maximum engine power,
    full load, deep calm water (5.2), and a logged point at midships.
    """
    if kind == "turning":
        return list(_turning_criteria(measures, length, calm=calm))
    if kind == "zigzag":
        return list(_zigzag_criteria(measures, length))
    if kind != "stop":
        return []
    one = _judge_criterion(measures, "track_reach", "stopping ability: track reach (5.3.4)", 15.0, "L", length)
    more = "up to 20 L where a large displacement makes 15 L impracticable"
    return [replace(one, note="; ".join(filter(None, [one.note, more]))) if one.met is False else one]


def _turning_criteria(measures: Measures, length: float | None, *, calm: bool) -> Iterator[Criterion]:
    over = _wrong_angles(measures, {"helm": 35.0})
    note = f"{over}; the test asks for that, or for the greatest helm allowed at the test speed" if over else ""
    current, steady = measures["current_speed"].value, measures["steady_speed"].value
    why = "" if calm else measures["current_speed"].why
    remark = f"how far current or wind carried the ship is not known: {why}" if why else ""
    if not calm and current > LARGEST_CURRENT * steady:  # in calm water a turn that is not quite steady has some, too
        carried = f"current or wind carried the ship at {current:.2g} m/s: correct the track for it (MSC/Circ.1053)"
        note = "; ".join(filter(None, [note, carried]))
    for name, limit in (("advance", 4.5), ("tactical_diameter", 5.0)):
        label = f"turning ability: {name.replace('_', ' ')} (5.3.1)"
        yield _judge_criterion(measures, name, label, limit, "L", length, note=note, remark=remark)


def _zigzag_criteria(measures: Measures, length: float | None) -> Iterator[Criterion]:
    tested = {
        angle: not _wrong_angles(measures, dict.fromkeys(("helm", "execute_heading"), angle)) for angle in (10.0, 20.0)
    }
    if tested[20.0]:
        label = "yaw checking: 20/20 first overshoot (5.3.3.3)"
        yield _judge_criterion(measures, "overshoot_1", label, 25 * DEGREE, "rad", length)
    if not tested[10.0]:
        return
    label = "initial turning ability: track to 10 deg (5.3.2)"
    yield _judge_criterion(measures, "initial_turning", label, 2.5, "L", length)
    speed = measures["approach_speed"].value
    ratio, missing = length / speed if length and speed > 0 else NAN, AT_REST if speed == 0 else ""
    label = "yaw checking: 10/10 first overshoot (5.3.3.1)"
    yield _judge_criterion(measures, "overshoot_1", label, first_overshoot_limit(ratio), "rad", length, missing=missing)
    label = "yaw checking: 10/10 second overshoot (5.3.3.2)"
    yield _judge_criterion(
        measures, "overshoot_2", label, second_overshoot_limit(ratio), "rad", length, missing=missing
    )


def first_overshoot_limit(ratio: float) -> float:
    """Largest first overshoot [rad] allowed in a 10/10 zigzag, for `ratio` L/V [s]."""
    return float(np.clip(5 + ratio / 2, 10, 20)) * DEGREE


def second_overshoot_limit(ratio: float) -> float:
    """Largest second overshoot [rad] allowed in a 10/10 zigzag, for `ratio` L/V [s]."""
    return float(np.clip(17.5 + 0.75 * ratio, 25, 40)) * DEGREE


def _wrong_angles(measures: Measures, asked: dict[str, float]) -> str:
    """Text of the angles that differ from those of a test [deg]; empty if none differs."""
    angles = {name: (measures[name].value / DEGREE, angle) for name, angle in asked.items()}
    return ", ".join(
        f"{name.replace('_', ' ')} is {value:.1f} deg, not {angle:g}"
        for name, (value, angle) in angles.items()
        if not abs(value - angle) <= ANGLE_TOLERANCE / DEGREE
    )


def _judge_criterion(
    measures: Measures,
    name: str,
    label: str,
    limit: float,
    unit: str,
    length: float | None,
    *,
    note: str = "",
    remark: str = "",
    missing: str = "",
) -> Criterion:
    """One criterion; with a `note` it is not judged, a `remark` changes nothing. missing : why there is no limit."""
    measure = measures[name]
    value = measure.value if unit != "L" else measure.value / length if length else NAN
    if not np.isfinite(value) or not np.isfinite(limit):
        why = measure.why or missing or "the length of the ship is not known"
        return Criterion(label, value, limit, unit, None, why)
    short = f"the standards are for ships of {SHORTEST_SHIP:g} m and more" if length and length < SHORTEST_SHIP else ""
    met = None if note else value <= limit
    return Criterion(label, value, limit, unit, met, "; ".join(filter(None, [note, remark, short])))


def measure_rows(measures: Measures, length: float | None) -> list[dict[str, Any]]:
    """Rows of `measure`, `value`, `unit`, `lengths`, `note`.

    lengths : value in ship lengths; NaN if it is no distance or the ship length `length` [m] is None.
    """
    rows = []
    for name, measure in measures.items():
        unit, size = SHOWN_UNITS.get(measure.unit, (measure.unit, 1.0))
        lengths = measure.value / length if length and measure.unit == "m" else float("nan")
        label = name.replace("_", " ")
        rows.append(
            {"measure": label, "value": measure.value / size, "unit": unit, "lengths": lengths, "note": measure.why}
        )
    return rows


def criterion_rows(criteria: Sequence[Criterion]) -> list[dict[str, Any]]:
    """Rows of `criterion`, `value`, `limit`, `unit`, `verdict` ("met", "not met", "not judged"), `note`."""
    words = {True: "met", False: "not met", None: "not judged"}
    rows = []
    for one in criteria:
        unit, size = SHOWN_UNITS.get(one.unit, (one.unit, 1.0))
        numbers = {"value": one.value / size, "limit": one.limit / size}
        rows.append({"criterion": one.name, **numbers, "unit": unit, "verdict": words[one.met], "note": one.note})
    return rows
